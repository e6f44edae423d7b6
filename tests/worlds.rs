//! Are volumes of all formats in one coordinate system, right-anterior-superior, sheared or not?
//! Expected positions are computed here from the header's own affine map and a pinhole projection.

use std::path::Path;

use rtl_model::Machine;
use serde_json::{Value, json};
use splatsim::accuracy::metrics;
use splatsim::golden::{Rules, render};
use splatsim::hardware::{fixed, machines, quantise};
use splatsim::scene::{Overrides, Scene};

const SIZE: [usize; 3] = [9, 8, 7];
const PICTURE: usize = 128;
const EYE_Z: f64 = 60.0;
const FOV_Y_DEGREES: f64 = 40.0;

/// Samples of 16 bits, 0 except at these positions.
fn samples(bright: &[[usize; 3]]) -> Vec<u8> {
    let at = |[x, y, z]: [usize; 3]| (z * SIZE[1] + y) * SIZE[0] + x;
    let mut values = vec![0_i16; SIZE.iter().product()];
    bright.iter().for_each(|place| values[at(*place)] = 100);
    values.into_iter().flat_map(i16::to_le_bytes).collect()
}

/// Steps along the three axes and the position of the first sample, in right-anterior-superior
/// coordinates.
type Grid = ([[f64; 3]; 3], [f64; 3]);

fn words(numbers: &[f64]) -> Vec<String> {
    numbers.iter().map(f64::to_string).collect()
}

/// The same in coordinates that point left, posterior and superior.
fn lps((axes, origin): &Grid) -> Grid {
    let turn = |[x, y, z]: [f64; 3]| [-x, -y, z];
    (axes.map(turn), turn(*origin))
}

fn nrrd(space: &str, (axes, origin): &Grid, samples: &[u8]) -> Vec<u8> {
    let vector = |vector: &[f64; 3]| format!("({})", words(vector).join(","));
    let directions = axes.each_ref().map(vector).join(" ");
    let header = format!(
        "NRRD0004\ntype: short\ndimension: 3\nspace: {space}\nsizes: 9 8 7\nspace directions: {directions}\nendian: little\nencoding: raw\nspace origin: {}\n\n",
        vector(origin)
    );
    [header.as_bytes(), samples].concat()
}

/// As ITK writes it: directions as columns of unit length, and separate spacings.
fn metaimage(grid: &Grid, samples: &[u8]) -> Vec<u8> {
    let (axes, origin) = lps(grid);
    let length = |axis: &[f64; 3]| axis.iter().map(|part| part * part).sum::<f64>().sqrt();
    let spacing = axes.each_ref().map(length);
    let matrix: Vec<f64> = axes
        .iter()
        .zip(spacing)
        .flat_map(|(axis, length)| axis.map(|part| part / length))
        .collect();
    let header = format!(
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nTransformMatrix = {}\nOffset = {}\nAnatomicalOrientation = ???\n\
         ElementSpacing = {}\nDimSize = 9 8 7\nElementType = MET_SHORT\nElementDataFile = LOCAL\n",
        words(&matrix).join(" "),
        words(&origin).join(" "),
        words(&spacing).join(" ")
    );
    [header.as_bytes(), samples].concat()
}

fn nifti((axes, origin): &Grid, samples: &[u8]) -> Vec<u8> {
    let mut header = vec![0_u8; 352];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &348_i32.to_le_bytes());
    [3_i16, 9, 8, 7, 1, 1, 1, 1]
        .iter()
        .enumerate()
        .for_each(|(i, n)| put(40 + 2 * i, &n.to_le_bytes()));
    put(70, &4_i16.to_le_bytes());
    [1.0_f32; 4]
        .iter()
        .enumerate()
        .for_each(|(i, n)| put(76 + 4 * i, &n.to_le_bytes()));
    put(108, &352.0_f32.to_le_bytes());
    put(254, &2_i16.to_le_bytes());
    for row in 0..3 {
        let numbers = [axes[0][row], axes[1][row], axes[2][row], origin[row]];
        numbers
            .iter()
            .enumerate()
            .for_each(|(i, n)| put(280 + 16 * row + 4 * i, &(*n as f32).to_le_bytes()));
    }
    put(344, b"n+1\0");
    [header, samples.to_vec()].concat()
}

fn scene(file: &str) -> Value {
    json!({"splats": {"volume": file, "transfer": [{"value": 0, "opacity": 0}, {"value": 100, "opacity": 0.05, "rgb": [1, 0, 0]}]},
        "camera": {"eye": [0, 0, EYE_Z], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": FOV_Y_DEGREES},
        "image": {"width": PICTURE, "height": PICTURE, "background": [0, 0, 0, 1]}, "kernel": {"low_pass": 0.0001},
        "materials": [{"unlit": true}]})
}

fn loaded(path: &Path) -> Scene {
    Scene::load(path, &Overrides::default()).unwrap()
}

fn of_file(name: &str, bytes: &[u8]) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(name), bytes).unwrap();
    let path = folder.path().join("scene.json");
    std::fs::write(&path, scene(name).to_string()).unwrap();
    loaded(&path)
}

/// Red light by pixel.
fn light(scene: &Scene) -> Vec<f64> {
    render(scene, &Rules::default())
        .picture
        .rgba
        .iter()
        .map(|pixel| pixel[0])
        .collect()
}

/// Mean and variances (xx, xy, yy) of the light within `reach` pixels of a position.
fn moments(light: &[f64], around: [f64; 2], reach: f64) -> ([f64; 2], [f64; 3]) {
    let pixels = light.iter().enumerate().map(|(i, light)| {
        (
            (i % PICTURE) as f64 + 0.5,
            (i / PICTURE) as f64 + 0.5,
            light,
        )
    });
    let near: Vec<_> = pixels
        .filter(|(x, y, _)| (x - around[0]).hypot(y - around[1]) < reach)
        .collect();
    let sum = |of: &dyn Fn(f64, f64) -> f64| {
        near.iter()
            .map(|(x, y, light)| of(*x, *y) * **light)
            .sum::<f64>()
    };
    let all = sum(&|_, _| 1.0);
    let [x, y] = [sum(&|x, _| x) / all, sum(&|_, y| y) / all];
    let variances = [
        sum(&|u, _| (u - x) * (u - x)) / all,
        sum(&|u, v| (u - x) * (v - y)) / all,
        sum(&|_, v| (v - y) * (v - y)) / all,
    ];
    ([x, y], variances)
}

fn place((axes, origin): &Grid, at: [usize; 3]) -> [f64; 3] {
    [0, 1, 2].map(|row| {
        origin[row]
            + (0..3)
                .map(|axis| axes[axis][row] * at[axis] as f64)
                .sum::<f64>()
    })
}

fn focal_px() -> f64 {
    PICTURE as f64 / 2.0 / (FOV_Y_DEGREES / 2.0).to_radians().tan()
}

fn lands([x, y, z]: [f64; 3]) -> [f64; 2] {
    let [scale, middle] = [focal_px() / (EYE_Z - z), PICTURE as f64 / 2.0];
    [middle + scale * x, middle - scale * y]
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

const STRAIGHT: Grid = (
    [[2.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 1.5]],
    [-10.0, -9.0, -4.0],
);
/// Rotated and left-handed.
const TURNED: Grid = (
    [[0.0, -2.0, 0.0], [0.0, 0.0, 2.5], [-1.8, 0.0, 0.0]],
    [6.0, 9.0, -7.0],
);
const SHEARED: Grid = (
    [[2.0, 0.0, 0.0], [1.0, 3.0, 0.5], [0.0, -1.2, 1.5]],
    [-10.0, -9.0, -4.0],
);
const BRIGHT: [[usize; 3]; 2] = [[6, 2, 3], [1, 1, 1]];

#[test]
fn one_image_is_one_picture_in_every_format_sheared_or_not() {
    for (what, grid) in [
        ("straight", STRAIGHT),
        ("turned", TURNED),
        ("sheared", SHEARED),
    ] {
        let data = samples(&BRIGHT);
        let mirrored = |[x, y, z]: [f64; 3]| [-x, y, z];
        let left = (grid.0.map(mirrored), mirrored(grid.1));
        let files = [
            (
                "x.nrrd",
                nrrd("left-posterior-superior", &lps(&grid), &data),
            ),
            ("x.nrrd", nrrd("RAS", &grid, &data)),
            ("x.nrrd", nrrd("LAS", &left, &data)),
            ("x.mha", metaimage(&grid, &data)),
            ("x.nii", nifti(&grid, &data)),
        ];
        let pictures = files.map(|(name, bytes)| light(&of_file(name, &bytes)));
        for (nth, picture) in pictures.iter().enumerate() {
            for bright in BRIGHT {
                let expected = lands(place(&grid, bright));
                let (middle, _) = moments(picture, expected, 6.0);
                assert!(
                    distance(middle, expected) < 0.1,
                    "{what}, file {nth}: {middle:?}, not {expected:?}"
                );
            }
            let apart = picture
                .iter()
                .zip(&pictures[1])
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f64::max);
            assert!(apart < 1e-5, "{what}, file {nth}: {apart:e}");
        }
    }
}

/// The variance of the kernel is radius² A Aᵀ. Its footprint, cut at r = 4, has 1 − 2e⁻²/(1 − e⁻²)
/// of the projected variance.
#[test]
fn a_kernel_of_a_sheared_grid_is_sheared() {
    let bright = [4, 3, 3];
    let (axes, origin) = SHEARED;
    let scene = of_file("x.nii", &nifti(&SHEARED, &samples(&[bright])));
    let at = place(&(axes, origin), bright);
    let (_, found) = moments(&light(&scene), lands(at), 30.0);
    let (focal, depth) = (focal_px(), EYE_Z - at[2]);
    // Rows of the projection's derivative: of u = W/2 + f·x/(e − z) and v = H/2 − f·y/(e − z).
    let rows = [
        [focal / depth, 0.0, focal * at[0] / (depth * depth)],
        [0.0, -focal / depth, -focal * at[1] / (depth * depth)],
    ];
    let steps =
        rows.map(|row| axes.map(|axis| 0.7 * (0..3).map(|i| row[i] * axis[i]).sum::<f64>()));
    let product = |a: usize, b: usize| {
        (0..3)
            .map(|axis| steps[a][axis] * steps[b][axis])
            .sum::<f64>()
    };
    let left = 1.0 - 2.0 * (-2.0_f64).exp() / (1.0 - (-2.0_f64).exp());
    let expected = [product(0, 0), product(0, 1), product(1, 1)].map(|variance| left * variance);
    for (found, expected) in found.iter().zip(expected) {
        assert!(
            (found - expected).abs() < 0.02 * (found.abs() + 1.0),
            "{found} of {expected}"
        );
    }
    assert!(expected[1].abs() > 0.3, "hardly sheared: {expected:?}");
}

/// The machine's shared axes can describe a sheared cell like any other.
#[test]
fn the_machine_draws_a_sheared_volume() {
    let bright: Vec<[usize; 3]> = (0..200).map(|i| [i % 9, i * 5 % 8, i * 3 % 7]).collect();
    let scene = of_file("x.nii", &nifti(&SHEARED, &samples(&bright)));
    let machine = Machine::named(machines::usual(&scene)).unwrap();
    let elaborated = fixed::elaborate(&machine).unwrap();
    let quantised = quantise::quantise(&scene, &machine).unwrap();
    let golden = render(&scene, &fixed::rules(&machine));
    let covered = golden
        .picture
        .covered
        .iter()
        .filter(|covered| **covered)
        .count();
    let drawn = fixed::picture(&elaborated, &fixed::draw(&elaborated, &quantised));
    let psnr = metrics(&drawn, &golden.picture).psnr_db.unwrap();
    assert!(
        machines::usual(&scene) == "volume" && covered > 1000 && psnr > 70.0,
        "{covered} pixels, {psnr} dB"
    );
}

#[test]
fn a_note_states_turned_axes_and_assumptions() {
    let data = samples(&BRIGHT);
    let notes = |name: &str, bytes: &[u8]| of_file(name, bytes).notes.join("\n");
    assert!(
        notes("x.nrrd", &nrrd("LPS", &STRAIGHT, &data))
            .contains("x and y are negated, so that the world is right-anterior-superior")
    );
    assert!(notes("x.mha", &metaimage(&STRAIGHT, &data)).contains("left-posterior-superior"));
    let bare = String::from_utf8_lossy(&nrrd("", &STRAIGHT, &[]))
        .replace("space: \n", "")
        .into_bytes();
    assert!(
        notes("x.nrrd", &[bare, data.clone()].concat())
            .contains("has no `space`: coordinates are drawn as they are")
    );
    assert!(!notes("x.nii", &nifti(&STRAIGHT, &data)).contains("coordinates"));
}

#[test]
fn the_images_of_other_programs_land_where_their_tools_say() {
    if let Some(folder) = crate::shared_input::find("outside/12-itk-nrrd-nii") {
        let pictures = ["nrrd", "mha", "nii"]
            .map(|end| light(&loaded(&folder.join(format!("scene-{end}.json")))));
        for picture in &pictures {
            let apart = picture
                .iter()
                .zip(&pictures[0])
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f64::max);
            assert!(apart < 1e-5, "{apart:e}");
            for expected in [[58.1, 55.2], [86.5, 47.2]] {
                assert!(distance(moments(picture, expected, 6.0).0, expected) < 0.3);
            }
        }
    }
    if let Some(folder) = crate::shared_input::find("outside/11-nifti-shear") {
        let picture = light(&loaded(&folder.join("scene.json")));
        for expected in [[75.8, 72.9], [44.3, 80.9]] {
            let (middle, _) = moments(&picture, expected, 6.0);
            assert!(
                distance(middle, expected) < 0.3,
                "{middle:?}, not {expected:?}"
            );
        }
    }
}

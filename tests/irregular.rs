//! Irregular volumes: does an evenly spaced grid equal the regular volume, do curvilinear kernels
//! have the variance of their cells, does the machine draw both, and is a broken file refused?

use assert_cmd::Command;
use glam::DVec3;
use rtl_model::Machine;
use serde_json::{Value, json};
use splatsim::accuracy::{lockstep, metrics};
use splatsim::golden::{self, Rules};
use splatsim::hardware::{fixed, machines, quantise};
use splatsim::output::picture::Picture;
use splatsim::scene::{Overrides, Scene};

const SIZE: [usize; 3] = [9, 8, 7];
const COUNT: usize = SIZE[0] * SIZE[1] * SIZE[2];

fn index(i: usize) -> [usize; 3] {
    [i % SIZE[0], i / SIZE[0] % SIZE[1], i / SIZE[0] / SIZE[1]]
}

/// Waves in [0, 1]; one sample in seven is below the visible range.
fn value(i: usize) -> f32 {
    let [x, y, z] = index(i).map(|at| at as f64);
    if i.is_multiple_of(7) {
        0.0
    } else {
        (0.5 + 0.5 * (0.9 * x + 0.4 * (y * z).sin()).sin()) as f32
    }
}

fn text(numbers: impl IntoIterator<Item = f64>) -> String {
    numbers
        .into_iter()
        .map(|number| format!("{number:?}"))
        .collect::<Vec<_>>()
        .join(" ")
}

fn array(
    kind: &str,
    name: &str,
    components: usize,
    numbers: impl IntoIterator<Item = f64>,
) -> String {
    let numbers = text(numbers);
    format!(
        "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"ascii\">{numbers}</DataArray>"
    )
}

fn vtk(set: &str, whole: &str, piece: &str, inside: &str) -> String {
    format!(
        "<VTKFile type=\"{set}\"><{set} {whole}><Piece {piece}>{inside}</Piece></{set}></VTKFile>"
    )
}

fn samples() -> String {
    array(
        "Float32",
        "waves",
        1,
        (0..COUNT).map(|i| f64::from(value(i))),
    )
}

fn extent() -> String {
    let [x, y, z] = SIZE.map(|size| size - 1);
    format!("WholeExtent=\"0 {x} 0 {y} 0 {z}\"")
}

fn vts(point: impl Fn(usize) -> DVec3) -> String {
    let points = array(
        "Float64",
        "points",
        3,
        (0..COUNT).flat_map(|i| point(i).to_array()),
    );
    vtk(
        "StructuredGrid",
        &extent(),
        "",
        &format!(
            "<PointData>{}</PointData><Points>{points}</Points>",
            samples()
        ),
    )
}

/// The text of a scene file: a source, and other fields from `look`.
fn scene(source: Value, look: &Value) -> Value {
    let mut scene = look.clone();
    scene["splats"] = source;
    scene
}

fn transfer() -> Value {
    json!([{"value": 0.1, "rgb": [0.1, 0.2, 0.9], "opacity": 0}, {"value": 0.5, "rgb": [0.9, 0.4, 0.1], "opacity": 0.1},
        {"value": 1, "rgb": [0.2, 1, 0.3], "opacity": 0.5}])
}

/// Loads a scene of these files.
fn loaded(files: &[(&str, &[u8])], scene: &Value) -> splatsim::error::Result<Scene> {
    let folder = tempfile::tempdir().unwrap();
    files
        .iter()
        .for_each(|(name, bytes)| std::fs::write(folder.path().join(name), bytes).unwrap());
    let path = folder.path().join("scene.json");
    std::fs::write(&path, scene.to_string()).unwrap();
    Scene::load(&path, &Overrides::default())
}

fn golden(scene: &Scene) -> Picture {
    golden::render(scene, &Rules::default()).picture
}

fn farthest(a: &Picture, b: &Picture) -> f64 {
    a.rgba
        .as_flattened()
        .iter()
        .zip(b.rgba.as_flattened())
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}

fn check_drawn(picture: &Picture) {
    let covered = picture.covered.iter().filter(|covered| **covered).count();
    assert!(covered * 5 > picture.covered.len(), "{covered} pixels");
}

const SPACING: [f64; 3] = [0.3, 0.5, 0.7];
const ORIGIN: [f64; 3] = [-0.1, 0.2, 1.3];

fn place(i: usize) -> DVec3 {
    let at = index(i);
    DVec3::from_array([0, 1, 2].map(|axis| ORIGIN[axis] + SPACING[axis] * at[axis] as f64))
}

fn even_look() -> Value {
    json!({"camera": {"eye": [5, 6, 9], "target": [1.1, 2, 3.4], "fov_y_degrees": 30}, "image": {"width": 72, "height": 64},
        "lights": [{"direction": [1, 2, 0.5]}], "sheets": {"stop": 0}})
}

/// Samples as a volume, and as each kind of irregular field. A rectilinear grid has the slices of
/// the volume. The others are drawn sample by sample, so they are compared in `ideal`, which blends
/// every contribution separately. Points are given the variances that follow from the grid's
/// spacing.
#[test]
fn an_even_grid_is_the_volume_that_it_is() {
    let values: Vec<u8> = (0..COUNT).flat_map(|i| value(i).to_le_bytes()).collect();
    let raw =
        json!({"file": "x.raw", "size": SIZE, "type": "f32", "spacing": SPACING, "origin": ORIGIN});
    let shown = |volume: Value| {
        let gradient = json!([{"magnitude": 0.1, "factor": 0.4}, {"magnitude": 2, "factor": 1}]);
        json!({"volume": volume, "transfer": transfer(), "gradient": gradient})
    };
    let even = loaded(&[("x.raw", &values)], &scene(shown(raw), &even_look())).unwrap();
    let axes = [0, 1, 2].map(|axis| {
        array(
            "Float64",
            "axis",
            1,
            (0..SIZE[axis]).map(|i| ORIGIN[axis] + SPACING[axis] * i as f64),
        )
    });
    let inside = format!(
        "<PointData>{}</PointData><Coordinates>{}</Coordinates>",
        samples(),
        axes.concat()
    );
    let vtr = vtk("RectilinearGrid", &extent(), "", &inside);
    let rectilinear = loaded(
        &[("x.vtr", vtr.as_bytes())],
        &scene(shown(json!("x.vtr")), &even_look()),
    )
    .unwrap();
    assert_eq!(
        (rectilinear.splats.len(), machines::usual(&rectilinear)),
        (even.splats.len(), "volume")
    );
    let picture = golden(&even);
    check_drawn(&picture);
    let apart = farthest(&golden(&rectilinear), &picture);
    assert!(apart < 1e-12, "rectilinear: {apart:e}");
    let curvilinear = loaded(
        &[("x.vts", vts(place).as_bytes())],
        &scene(shown(json!("x.vts")), &even_look()),
    )
    .unwrap();
    assert_eq!(machines::usual(&curvilinear), "gaussian");
    let ideal = golden::ideal(&even).picture;
    let apart = farthest(&golden::ideal(&curvilinear).picture, &ideal);
    assert!(apart < 1e-12, "curvilinear: {apart:e}");
    // Points have neighbours, but not a grid: their gradients at the border differ, so gradients
    // are not used here.
    let plain = |volume: Value, more: Value| {
        let mut source = json!({"volume": volume, "transfer": transfer()});
        more.as_object()
            .unwrap()
            .iter()
            .for_each(|(key, value)| source[key] = value.clone());
        let mut look = even_look();
        look["materials"] = json!([{"unlit": true}]);
        scene(source, &look)
    };
    let variance = array(
        "Float64",
        "v",
        3,
        (0..COUNT).flat_map(|_| SPACING.map(|step| (0.7 * step).powi(2))),
    );
    let points = array(
        "Float64",
        "points",
        3,
        (0..COUNT).flat_map(|i| place(i).to_array()),
    );
    let inside = format!(
        "<PointData>{}{variance}</PointData><Points>{points}</Points>",
        samples()
    );
    let vtp = vtk(
        "PolyData",
        "",
        &format!("NumberOfPoints=\"{COUNT}\""),
        &inside,
    );
    let scattered = loaded(
        &[("x.vtp", vtp.as_bytes())],
        &plain(json!("x.vtp"), json!({"variance": "v"})),
    )
    .unwrap();
    let even = loaded(
        &[("x.vts", vts(place).as_bytes())],
        &plain(json!("x.vts"), json!({})),
    )
    .unwrap();
    let apart = farthest(&golden(&scattered), &golden(&even));
    assert!(apart < 1e-12, "points: {apart:e}");
}

/// A sheared grid equals the curvilinear grid with the same positions: kernels, gradients, light
/// and depths, in `ideal`.
#[test]
fn a_sheared_grid_is_the_curvilinear_grid_that_it_is() {
    let steps = [[0.3, 0.0, 0.1], [0.2, 0.5, 0.0], [-0.1, 0.3, 0.7]].map(DVec3::from_array);
    let sheared = |i: usize| {
        (0..3).fold(DVec3::from_array(ORIGIN), |place, axis| {
            place + steps[axis] * index(i)[axis] as f64
        })
    };
    let shown = |volume: &str| {
        let gradient = json!([{"magnitude": 0.1, "factor": 0.4}, {"magnitude": 2, "factor": 1}]);
        scene(
            json!({"volume": volume, "transfer": transfer(), "gradient": gradient}),
            &even_look(),
        )
    };
    let vector = |of: DVec3| format!("({},{},{})", of.x, of.y, of.z);
    let header = format!(
        "NRRD0004\ntype: float\ndimension: 3\nspace: RAS\nsizes: {} {} {}\nspace directions: {}\nspace origin: {}\nendian: little\nencoding: raw\n\n",
        SIZE[0],
        SIZE[1],
        SIZE[2],
        steps.map(vector).join(" "),
        vector(DVec3::from_array(ORIGIN))
    );
    let values: Vec<u8> = (0..COUNT).flat_map(|i| value(i).to_le_bytes()).collect();
    let grid = loaded(
        &[("x.nrrd", &[header.as_bytes(), &values].concat())],
        &shown("x.nrrd"),
    )
    .unwrap();
    let curvilinear = loaded(&[("x.vts", vts(sheared).as_bytes())], &shown("x.vts")).unwrap();
    assert_eq!(
        (machines::usual(&grid), grid.splats.len()),
        ("volume", curvilinear.splats.len())
    );
    let picture = golden::ideal(&grid).picture;
    check_drawn(&picture);
    let apart = farthest(&golden::ideal(&curvilinear).picture, &picture);
    assert!(apart < 1e-9, "{apart:e}");
    // In slices it is nearly the same as sample by sample: the kernels of a slice are one sheet.
    let psnr = metrics(&golden(&grid), &picture).psnr_db.unwrap();
    assert!(psnr > 40.0, "{psnr} dB");
}

/// Kernels seen along their length are deeper than the range of the usual machine: the summary
/// names a format that is large enough.
#[test]
fn the_summary_of_needles_names_a_format_that_holds_them() {
    let folder = tempfile::tempdir().unwrap();
    let at = |i: usize| DVec3::new((i % 5) as f64, (i / 5) as f64, 0.0);
    let points = array(
        "Float64",
        "points",
        3,
        (0..25).flat_map(|i| at(i).to_array()),
    );
    let samples = array("Float32", "waves", 1, (0..25).map(|_| 1.0));
    let variance = array("Float64", "v", 3, (0..25).flat_map(|_| [0.01, 0.01, 4.0]));
    let inside = format!("<PointData>{samples}{variance}</PointData><Points>{points}</Points>");
    std::fs::write(
        folder.path().join("x.vtu"),
        vtk("UnstructuredGrid", "", "NumberOfPoints=\"25\"", &inside),
    )
    .unwrap();
    let camera = json!({"eye": [2, 2, 40], "target": [2, 2, 0], "fov_y_degrees": 8});
    let transfer = json!([{"value": 0, "opacity": 0}, {"value": 1, "opacity": 0.1}]);
    let scene = json!({"splats": {"volume": "x.vtu", "variance": "v", "transfer": transfer}, "camera": camera,
        "image": {"width": 32, "height": 32}, "kernel": {"low_pass": 0.01}});
    std::fs::write(folder.path().join("scene.json"), scene.to_string()).unwrap();
    let run = |more: &[&str]| {
        let mut run = Command::new(env!("CARGO_BIN_EXE_splatsim"));
        let output = run
            .current_dir(folder.path())
            .args(["run", "scene.json", "--out", "out"])
            .args(more)
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        String::from_utf8(output.stdout)
            .unwrap()
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ")
    };
    let told = run(&[]);
    assert!(
        told.contains("ellipse.visibility (U3F22) saturated 25 times"),
        "{told}"
    );
    let setting = told
        .split("`--set ")
        .nth(1)
        .and_then(|rest| rest.split('`').next())
        .unwrap_or_default();
    assert!(setting.starts_with("ellipse.visibility=U"), "{told}");
    assert!(
        !run(&["--set", setting]).contains("ellipse.visibility ("),
        "{setting}"
    );
}

/// A sample that is NaN is not visible, in every format, and the summary counts it.
#[test]
fn a_sample_that_is_nan_is_drawn_as_empty() {
    let holes = [30, 31, 250];
    let with = |hole: f32| -> Vec<f32> {
        (0..COUNT)
            .map(|i| if holes.contains(&i) { hole } else { value(i) })
            .collect()
    };
    let bytes = |values: &[f32]| -> Vec<u8> {
        values
            .iter()
            .flat_map(|value| value.to_le_bytes())
            .collect()
    };
    let joined = |header: &str, values: &[f32]| [header.as_bytes(), &bytes(values)].concat();
    let [nx, ny, nz] = SIZE;
    let of_text = |values: &[f32]| {
        array(
            "Float32",
            "waves",
            1,
            values.iter().map(|value| f64::from(*value)),
        )
    };
    let points = array(
        "Float64",
        "points",
        3,
        (0..COUNT).flat_map(|i| place(i).to_array()),
    );
    let axes = [0, 1, 2]
        .map(|axis| {
            array(
                "Float64",
                "axis",
                1,
                (0..SIZE[axis]).map(|i| ORIGIN[axis] + SPACING[axis] * i as f64),
            )
        })
        .concat();
    let nii = |values: &[f32]| {
        let mut header = vec![0_u8; 352];
        let mut put = |at: usize, word: &[u8]| header[at..at + word.len()].copy_from_slice(word);
        put(0, &348_i32.to_le_bytes());
        [3, nx, ny, nz, 1, 1, 1, 1]
            .iter()
            .enumerate()
            .for_each(|(i, n)| put(40 + 2 * i, &(*n as i16).to_le_bytes()));
        put(70, &16_i16.to_le_bytes());
        SPACING
            .iter()
            .enumerate()
            .for_each(|(i, n)| put(80 + 4 * i, &(*n as f32).to_le_bytes()));
        put(108, &352.0_f32.to_le_bytes());
        put(344, b"n+1\0");
        [header, bytes(values)].concat()
    };
    /// A file with these samples.
    type Written<'a> = Box<dyn Fn(&[f32]) -> Vec<u8> + 'a>;
    let files: Vec<(&str, Written<'_>)> = vec![
        (
            "x.nrrd",
            Box::new(|values| {
                joined(
                    &format!(
                        "NRRD0004\ntype: float\ndimension: 3\nsizes: {nx} {ny} {nz}\nendian: little\nencoding: raw\n\n"
                    ),
                    values,
                )
            }),
        ),
        (
            "x.mha",
            Box::new(|values| {
                joined(
                    &format!(
                        "NDims = 3\nDimSize = {nx} {ny} {nz}\nElementType = MET_FLOAT\nElementDataFile = LOCAL\n"
                    ),
                    values,
                )
            }),
        ),
        ("x.nii", Box::new(nii)),
        (
            "x.vti",
            Box::new(|values| {
                vtk(
                    "ImageData",
                    &extent(),
                    "",
                    &format!("<PointData>{}</PointData>", of_text(values)),
                )
                .into_bytes()
            }),
        ),
        (
            "x.vtr",
            Box::new(|values| {
                vtk(
                    "RectilinearGrid",
                    &extent(),
                    "",
                    &format!(
                        "<PointData>{}</PointData><Coordinates>{axes}</Coordinates>",
                        of_text(values)
                    ),
                )
                .into_bytes()
            }),
        ),
        (
            "x.vts",
            Box::new(|values| {
                vtk(
                    "StructuredGrid",
                    &extent(),
                    "",
                    &format!(
                        "<PointData>{}</PointData><Points>{points}</Points>",
                        of_text(values)
                    ),
                )
                .into_bytes()
            }),
        ),
        (
            "x.vtp",
            Box::new(|values| {
                let piece = format!("NumberOfPoints=\"{COUNT}\"");
                vtk(
                    "PolyData",
                    "",
                    &piece,
                    &format!(
                        "<PointData>{}</PointData><Points>{points}</Points>",
                        of_text(values)
                    ),
                )
                .into_bytes()
            }),
        ),
    ];
    let look = json!({"image": {"width": 40, "height": 36}, "materials": [{"unlit": true}]});
    // NaN would show in the opacity of the first point; the holes of the other file do not show.
    let mut points = transfer();
    points.as_array_mut().unwrap().splice(
        0..0,
        [
            json!({"value": -3, "opacity": 0.4}),
            json!({"value": -2, "opacity": 0}),
        ],
    );
    for (name, file) in files {
        let read = |hole: f32| {
            loaded(
                &[(name, &file(&with(hole)))],
                &scene(json!({"volume": name, "transfer": points}), &look),
            )
            .unwrap()
        };
        let (absent, unseen) = (read(f32::NAN), read(-1.0));
        assert_eq!(absent.splats.len(), unseen.splats.len(), "{name}");
        assert!(
            farthest(&golden(&absent), &golden(&unseen)) == 0.0,
            "{name}"
        );
        let said = absent.notes.iter().filter(|note| {
            note.ends_with(&format!(
                "3 of {COUNT} samples are NaN: they are drawn as empty"
            ))
        });
        assert_eq!(
            (
                said.count(),
                unseen.notes.iter().any(|note| note.contains("NaN"))
            ),
            (1, false),
            "{name}: {:?}",
            absent.notes
        );
        let all = vec![f32::NAN; COUNT];
        let told = loaded(
            &[(name, &file(&all))],
            &scene(json!({"volume": name}), &look),
        )
        .unwrap_err()
        .to_string();
        assert!(
            told.contains(&format!("all of its {COUNT} samples are NaN")),
            "{name}: {told}"
        );
    }
}

/// An isosurface ends at NaN: none of its splats comes from a step to a sample that is NaN.
#[test]
fn an_isosurface_ends_beside_samples_that_are_nan() {
    let size = [12, 6, 6];
    let slope = |hole: f32| -> Vec<u8> {
        let of = |i: usize| if i % 12 > 8 { hole } else { (i % 12) as f32 };
        (0..size.iter().product())
            .flat_map(|i| of(i).to_le_bytes())
            .collect()
    };
    let source = |isovalue: f64| json!({"volume": {"file": "x.raw", "size": size, "type": "f32"}, "isovalue": isovalue});
    let look = json!({"camera": {"eye": [-30, 3, 3], "target": [5, 3, 3]}});
    let at = |hole: f32, isovalue: f64| {
        loaded(&[("x.raw", &slope(hole))], &scene(source(isovalue), &look))
    };
    let scene = at(f32::NAN, 8.2).unwrap();
    assert!(
        scene.splats.len() == 36
            && scene
                .splats
                .iter()
                .all(|splat| (splat.position.x - 8.2).abs() < 1e-6),
        "{:?}",
        scene.splats
    );
    assert!(
        at(f32::NAN, 30.0)
            .unwrap_err()
            .to_string()
            .contains("no surface of this isovalue")
    );
}

/// A piece of a twisted tube: cells become longer outwards and towards one end.
fn twisted(i: usize) -> DVec3 {
    let [x, y, z] = index(i).map(|at| at as f64);
    let (radius, turn) = (0.6 + 0.1 * x + 0.015 * x * x, 0.5 * y + 0.15 * z);
    DVec3::new(
        radius * turn.cos(),
        radius * turn.sin(),
        0.2 * z + 0.03 * z * z,
    )
}

fn twisted_look() -> Value {
    json!({"camera": {"eye": [3, 2.4, 5], "target": [0, 0.4, 1.1], "fov_y_degrees": 40}, "image": {"width": 64, "height": 56},
        "materials": [{"unlit": true}], "sheets": {"stop": 0}, "kernel": {"low_pass": 0.5}})
}

fn twisted_scene(more: &Value) -> Scene {
    let source = json!({"volume": "x.vts", "transfer": transfer(), "layer": 0.2});
    let mut scene = scene(source, &twisted_look());
    more.as_object()
        .unwrap()
        .iter()
        .for_each(|(key, value)| scene[key] = value.clone());
    loaded(&[("x.vts", vts(twisted).as_bytes())], &scene).unwrap()
}

/// Every sample at every pixel, from the definitions: steps are differences of positions. The
/// variance of the footprint is that of the kernel times the derivative of the projection, which is
/// computed as a difference too. The depth along a ray is the sample's volume times the
/// scale of areas of this derivative.
fn oracle() -> Vec<[f64; 3]> {
    let (eye, target, size) = (
        DVec3::new(3.0, 2.4, 5.0),
        DVec3::new(0.0, 0.4, 1.1),
        [64, 56],
    );
    let forward = (target - eye).normalize();
    let right = forward.cross(DVec3::Y).normalize();
    let down = forward.cross(right);
    let focal = 28.0 / 20.0_f64.to_radians().tan();
    let pixel = |place: DVec3| {
        let way = place - eye;
        let depth = way.dot(forward);
        [
            32.0 + focal * way.dot(right) / depth,
            28.0 + focal * way.dot(down) / depth,
        ]
    };
    let step = |i: usize, axis: usize| {
        let (stride, at) = ([1, SIZE[0], SIZE[0] * SIZE[1]][axis], index(i)[axis]);
        let (low, high) = (
            if at > 0 { i - stride } else { i },
            if at + 1 < SIZE[axis] { i + stride } else { i },
        );
        (twisted(high) - twisted(low)) * if high - low == stride { 1.0 } else { 0.5 }
    };
    let classified = |v: f64| {
        let depth = |opacity: f64| -(1.0 - opacity).ln() / (1.0 - (-2.0_f64).exp());
        let points = [
            (0.1, [0.1, 0.2, 0.9, depth(0.0)]),
            (0.5, [0.9, 0.4, 0.1, depth(0.1)]),
            (1.0, [0.2, 1.0, 0.3, depth(0.5)]),
        ];
        let (low, high) = if v < 0.5 {
            (points[0], points[1])
        } else {
            (points[1], points[2])
        };
        let part = ((v - low.0) / (high.0 - low.0)).max(0.0);
        [0, 1, 2, 3].map(|i| low.1[i] + part * (high.1[i] - low.1[i]))
    };
    let mut order: Vec<usize> = (0..COUNT).collect();
    order.sort_by(|a, b| {
        (twisted(*a) - eye)
            .dot(forward)
            .total_cmp(&(twisted(*b) - eye).dot(forward))
    });
    let mut picture = vec![([0.0; 3], 1.0); size[0] * size[1]];
    for i in order {
        let [r, g, b, depth] = classified(f64::from(value(i)));
        let steps = [0, 1, 2].map(|axis| step(i, axis));
        let h = 1e-5;
        let slope = |axis: usize| {
            let along = |way: DVec3| {
                (pixel(twisted(i) + way * h)[axis] - pixel(twisted(i) - way * h)[axis]) / (2.0 * h)
            };
            DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z))
        };
        let slopes = [slope(0), slope(1)];
        let v = |a: usize, b: usize| {
            let spread: f64 = steps
                .iter()
                .map(|step| 0.49 * step.dot(slopes[a]) * step.dot(slopes[b]))
                .sum();
            spread + if a == b { 0.5 } else { 0.0 }
        };
        let determinant = v(0, 0) * v(1, 1) - v(0, 1) * v(0, 1);
        let volume = steps[0].cross(steps[1]).dot(steps[2]).abs();
        let peak = depth * volume / 0.2 * slopes[0].cross(slopes[1]).length()
            / (std::f64::consts::TAU * determinant.sqrt());
        let centre = pixel(twisted(i));
        for (at, (rgb, through)) in picture.iter_mut().enumerate() {
            let [dx, dy] = [at % size[0], at / size[0]].map(|p| p as f64 + 0.5);
            let [dx, dy] = [dx - centre[0], dy - centre[1]];
            let index =
                (v(1, 1) * dx * dx - 2.0 * v(0, 1) * dx * dy + v(0, 0) * dy * dy) / determinant;
            if index < 4.0 {
                let after = *through * (-peak * (-0.5 * index).exp()).exp();
                *rgb = [0, 1, 2].map(|c| rgb[c] + (*through - after) * [r, g, b][c]);
                *through = after;
            }
        }
    }
    picture.into_iter().map(|(rgb, _)| rgb).collect()
}

#[test]
fn a_curvilinear_kernel_has_the_variance_of_its_cell() {
    let picture = golden(&twisted_scene(&json!({})));
    check_drawn(&picture);
    let apart = picture.rgba.iter().zip(oracle()).map(|(drawn, rgb)| {
        (0..3)
            .map(|c| (drawn[c] - rgb[c]).abs())
            .fold(0.0, f64::max)
    });
    // A pixel on a rim may be on either side.
    let (far, most) = apart.fold((0, 0.0_f64), |(far, most), apart| {
        if apart > 1e-3 {
            (far + 1, most)
        } else {
            (far, most.max(apart))
        }
    });
    assert!(far <= 2 && most < 1e-7, "{far} pixels, others {most:e}");
}

/// Random points, with widths from their density.
fn cloud() -> Scene {
    let mut state = 1_u64;
    let mut random = || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let points: Vec<DVec3> = (0..900)
        .map(|_| DVec3::new(random(), random().powi(2), random()))
        .collect();
    let values = array(
        "Float32",
        "v",
        1,
        points
            .iter()
            .map(|p| 0.5 + 0.5 * (5.0 * p.x + 3.0 * p.y).sin()),
    );
    let places = array("Float32", "p", 3, points.iter().flat_map(|p| p.to_array()));
    let inside = format!("<PointData>{values}</PointData><Points>{places}</Points><Cells/>");
    let vtu = vtk("UnstructuredGrid", "", "NumberOfPoints=\"900\"", &inside);
    let look = json!({"image": {"width": 96, "height": 80}, "lights": [{"direction": [1, 2, 3]}]});
    let source = json!({"volume": "x.vtu", "transfer": transfer()});
    loaded(&[("x.vtu", vtu.as_bytes())], &scene(source, &look)).unwrap()
}

#[test]
fn the_machine_draws_them_within_its_bounds() {
    let linear =
        json!({"sheets": {"opacity": "linear", "stop": 0.1}, "image": {"width": 96, "height": 80}});
    for (name, scene) in [("curvilinear", twisted_scene(&linear)), ("points", cloud())] {
        let machine = Machine::named(machines::usual(&scene)).unwrap();
        let elaborated = fixed::elaborate(&machine).unwrap();
        let quantised = quantise::quantise(&scene, &machine).unwrap();
        let golden = golden::render(&scene, &fixed::rules(&machine));
        check_drawn(&golden.picture);
        let drawn = fixed::picture(&elaborated, &fixed::draw(&elaborated, &quantised));
        let psnr = metrics(&drawn, &golden.picture).psnr_db.unwrap();
        assert!(psnr > 65.0, "{name}: {psnr}");
        let frame = lockstep(&scene, &elaborated, &quantised);
        assert_eq!(
            (frame.violations, frame.flips.unexplained),
            (0, 0),
            "{name}: {:?}",
            frame.flips
        );
    }
}

#[test]
fn faulty_volumes_are_refused_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, bytes: &[u8], scene: Option<Value>| {
        std::fs::write(folder.path().join(name), bytes).unwrap();
        let input = scene.map_or(name.to_owned(), |scene| {
            std::fs::write(folder.path().join("s.json"), scene.to_string()).unwrap();
            "s.json".into()
        });
        let run = Command::new(env!("CARGO_BIN_EXE_splatsim"))
            .current_dir(&folder)
            .args(["run", &input, "--out", "out"])
            .output()
            .unwrap();
        let told = String::from_utf8(run.stderr).unwrap();
        assert_eq!(run.status.code(), Some(2), "{name}: {told}");
        assert!(
            !folder.path().join("out").exists()
                && told.trim_end().lines().count() == 1
                && told.len() < 500,
            "{name}: {told}"
        );
        told
    };
    let sound = vts(twisted);
    for (broken, word) in [
        (sound.replace("0.0 ", "NaN "), "NaN"),
        (sound[..sound.len() / 2].to_owned(), "numbers"),
        (sound.replace("0 8 0 7", "0 80000 0 70000"), "at most"),
        ("<svg><path d=\"M0 0\"/></svg>".into(), "no <VTKFile>"),
        (
            sound.replace("StructuredGrid", "HyperTreeGrid"),
            "only StructuredGrid",
        ),
        // The content determines the format.
        (
            sound.replace("StructuredGrid", "PolyData"),
            "`NumberOfPoints`",
        ),
        (
            vts(|_| DVec3::ZERO),
            "shows nothing of the volume; samples that its transfer function shows have a cell of no volume",
        ),
        (String::new(), "no <VTKFile>"),
    ] {
        let told = run("x.vts", broken.as_bytes(), None);
        assert!(told.contains(word), "{word} is not in: {told}");
    }
    let with = |more: Value| {
        let mut source = json!({"volume": "x.vts"});
        more.as_object()
            .unwrap()
            .iter()
            .for_each(|(key, value)| source[key] = value.clone());
        run("x.vts", sound.as_bytes(), Some(scene(source, &json!({}))))
    };
    assert!(
        with(json!({"array": "wind"})).contains("no array `wind` in <PointData>; there is waves")
    );
    assert!(with(json!({"variance": "v"})).contains("`variance` is of points"));
    assert!(
        with(json!({"isovalue": 0.5}))
            .contains("splats.isovalue is not read of VTR, VTS, VTU and VTP")
    );
    assert!(with(json!({"layer": 0})).contains("splats.layer is 0"));
    let back = scene(
        json!({"volume": "x.vts"}),
        &json!({"sheets": {"order": "back-to-front"}}),
    );
    assert!(
        run("x.vts", sound.as_bytes(), Some(back)).contains("sorted by depth come front-to-back")
    );
    let named = scene(
        json!({"volume": {"builtin": "fuzzy-clouds"}, "array": "x"}),
        &json!({}),
    );
    assert!(
        run("x.vts", sound.as_bytes(), Some(named))
            .contains("splats.array names an array of a VTK file")
    );
}

#[test]
fn an_array_of_a_vti_is_chosen_by_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let backwards = array(
        "Float32",
        "backwards",
        1,
        (0..COUNT).rev().map(|i| f64::from(value(i))),
    );
    let written = |name: &str, arrays: &str| {
        std::fs::write(
            folder.path().join(name),
            vtk(
                "ImageData",
                &extent(),
                "",
                &format!("<PointData>{arrays}</PointData>"),
            ),
        )
        .unwrap();
    };
    written("two.vti", &format!("{backwards}{}", samples()));
    written("one.vti", &samples());
    let picture = |source: Value| {
        std::fs::write(
            folder.path().join("s.json"),
            scene(source, &json!({})).to_string(),
        )
        .unwrap();
        let arguments = [
            "run", "s.json", "--check", "none", "--quiet", "--out", "out",
        ];
        let run = Command::new(env!("CARGO_BIN_EXE_splatsim"))
            .current_dir(&folder)
            .args(arguments)
            .output()
            .unwrap();
        assert!(
            run.status.success(),
            "{}",
            String::from_utf8_lossy(&run.stderr)
        );
        std::fs::read(folder.path().join("out/golden.png")).unwrap()
    };
    let alone = picture(json!({"volume": "one.vti"}));
    assert_eq!(
        picture(json!({"volume": "two.vti", "array": "waves"})),
        alone
    );
    assert_ne!(
        picture(json!({"volume": "two.vti", "array": "backwards"})),
        alone
    );
}

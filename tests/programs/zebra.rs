//! Compares filters of volumes on a zebra's coat that recedes from the eye (EWA Fig. 13 to 15):
//! thin slabs of 1024×512×3 samples and of 1024×256×3, whose samples are twice as long as wide, and
//! the same coat as a surface.
//!
//! ```sh
//! cargo run --release --example zebra -- [FOLDER]
//! ```
//! Prints a table and writes `zebra.png` (near and far dB over each tile), and slabs, surface and
//! scenes into the same folder. Each is compared with the coat itself, convolved with the low-pass
//! filter as a picture, from 64 rays per pixel. *Near* are rows in which two stripes are at least
//! six pixels wide, *far* those in which they are less than two: the pixel grid cannot represent
//! these, and contrast there is false.

use glam::DVec3;
use serde_json::json;
use splatsim::accuracy::metrics;
use splatsim::error::{Error, Result};
use splatsim::golden::{Rules, render};
use splatsim::output::chart::{Chart, PictureTile, write_png};
use splatsim::output::colour::srgb_encode;
use splatsim::output::picture::Picture;
use splatsim::scene::{Overrides, Scene};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

const WIDTH: usize = 256;
const HEIGHT: usize = 128;
/// The sides of the coat, and the width of two stripes, one dark and one light.
const COAT: [f64; 2] = [1024.0, 512.0];
const STRIPES: f64 = 12.0;
const LIGHT: f64 = 0.9;
const DARK: f64 = 0.08;
/// Rays per pixel across and down.
const RAYS: usize = 8;
/// The top slice.
const TOP: f64 = 2.0;

/// Curved stripes, smooth enough for samples two apart.
fn coat(x: f64, y: f64) -> f64 {
    let bend = 14.0 * (x / 61.0).sin() + 10.0 * (y / 37.0 + x / 113.0).sin();
    let wave = (TAU * (0.6 * x + 0.8 * y + bend) / STRIPES).cos();
    DARK + (LIGHT - DARK) * (0.5 + 0.5 * (1.6 * wave).tanh() / 1.6_f64.tanh())
}

fn written(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).map_err(|error| Error::Job(format!("{}: {error}", path.display())))
}

/// Samples of a slab with this length along y.
fn slab(rows: usize) -> Vec<u8> {
    let step = COAT[1] / rows as f64;
    let sample = |x: usize, y: usize| {
        ((coat(x as f64, y as f64 * step) - DARK) / (LIGHT - DARK) * 255.0).round() as u8
    };
    (0..3)
        .flat_map(|_| (0..rows).flat_map(move |y| (0..COAT[0] as usize).map(move |x| sample(x, y))))
        .collect()
}

/// The top slice of the finer slab as points, with colours as sRGB bytes.
fn points() -> Vec<u8> {
    let [width, height] = COAT.map(|side| side as usize);
    let properties = ["x", "y", "z", "nx", "ny", "nz", "radius"]
        .map(|name| format!("property float {name}\n"))
        .concat();
    let colours = ["red", "green", "blue"]
        .map(|name| format!("property uchar {name}\n"))
        .concat();
    let head = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\n{properties}{colours}end_header\n",
        width * height
    );
    let point = |i: usize| {
        let (x, y) = ((i % width) as f32, (i / width) as f32);
        let places: Vec<u8> = [x, y, TOP as f32, 0.0, 0.0, 1.0, 0.7]
            .into_iter()
            .flat_map(f32::to_le_bytes)
            .collect();
        [
            places,
            vec![(srgb_encode(coat(x.into(), y.into())) * 255.0).round() as u8; 3],
        ]
        .concat()
    };
    [
        head.into_bytes(),
        (0..width * height).flat_map(point).collect(),
    ]
    .concat()
}

/// A scene of a source; the coat recedes from the eye, wider than the picture.
fn scene(splats: &serde_json::Value, low_pass: f64, by: &str) -> String {
    json!({
        "splats": splats,
        "materials": [{"unlit": true}],
        "camera": {"eye": [512, -70, 130], "target": [512, 110, 0], "up": [0, 0, 1], "fov_y_degrees": 34},
        "image": {"width": WIDTH, "height": HEIGHT, "background": [0, 0, 0, 1]},
        "surface": {"z_threshold": 40, "coverage_threshold": 1e-3},
        "kernel": {"low_pass": low_pass, "low_pass_by": by},
    })
    .to_string()
}

fn loaded(folder: &Path, splats: &serde_json::Value, low_pass: f64, by: &str) -> Result<Scene> {
    let path = folder.join("zebra.json");
    written(&path, scene(splats, low_pass, by).as_bytes())?;
    Scene::load(&path, &Overrides::default())
}

/// Intersection of a pixel's ray and the plane at this height; none above the horizon.
fn meets(scene: &Scene, x: f64, y: f64, height: f64) -> Option<DVec3> {
    let view = scene.view();
    let [a, b] = view.slopes([x, y]);
    let way = view.rotation.transpose() * DVec3::new(a, b, 1.0);
    let along = (height - view.eye.z) / way.z;
    (along > 0.0).then(|| view.eye + way * along)
}

/// The coat itself at this height, convolved with a Gaussian with a variance of one pixel.
fn reference(scene: &Scene, height: f64) -> Picture {
    const REACH: usize = 4;
    let (width, rows) = ((WIDTH + 2 * REACH) * RAYS, (HEIGHT + 2 * REACH) * RAYS);
    let place = |i: usize| (i as f64 + 0.5) / RAYS as f64 - REACH as f64;
    let weights: Vec<f64> = (0..(2 * REACH + 1) * RAYS)
        .map(|i| (-0.5 * (place(i) - 0.5).powi(2)).exp())
        .collect();
    let sum: f64 = weights.iter().sum();
    let weighed = |values: &[f64], step: usize, from: usize| -> f64 {
        weights
            .iter()
            .enumerate()
            .map(|(i, weight)| weight * values[from + i * step])
            .sum::<f64>()
            / sum
    };
    let colour = |i: usize, j: usize| match meets(scene, place(i), place(j), height) {
        Some(p) if (-0.5..COAT[0] - 0.5).contains(&p.x) && (-0.5..COAT[1] - 0.5).contains(&p.y) => {
            coat(p.x, p.y)
        }
        _ => 0.0,
    };
    let across: Vec<f64> = (0..rows)
        .flat_map(|j| {
            let row: Vec<f64> = (0..width).map(|i| colour(i, j)).collect();
            (0..WIDTH)
                .map(|x| weighed(&row, 1, x * RAYS))
                .collect::<Vec<_>>()
        })
        .collect();
    let pixel = |at: usize| {
        let grey = weighed(&across, WIDTH, at / WIDTH * RAYS * WIDTH + at % WIDTH);
        [grey, grey, grey, 1.0]
    };
    Picture {
        width: WIDTH,
        height: HEIGHT,
        rgba: (0..WIDTH * HEIGHT).map(pixel).collect(),
        covered: vec![true; WIDTH * HEIGHT],
    }
}

fn rows(picture: &Picture, [first, end]: [usize; 2]) -> Picture {
    let rgba = picture.rgba[first * WIDTH..end * WIDTH].to_vec();
    Picture {
        width: WIDTH,
        height: end - first,
        covered: vec![true; rgba.len()],
        rgba,
    }
}

/// Standard deviation of grey.
fn contrast(picture: &Picture) -> f64 {
    let count = picture.rgba.len() as f64;
    let mean = picture.rgba.iter().map(|pixel| pixel[1]).sum::<f64>() / count;
    (picture
        .rgba
        .iter()
        .map(|pixel| (pixel[1] - mean).powi(2))
        .sum::<f64>()
        / count)
        .sqrt()
}

fn difference(a: &Picture, b: &Picture) -> Picture {
    let rgba = a
        .rgba
        .iter()
        .zip(&b.rgba)
        .map(|(a, b)| [0, 1, 2, 3].map(|i| a[i] - b[i]))
        .collect();
    Picture { rgba, ..a.clone() }
}

/// Rows near and far, by the width of two stripes in the middle of the picture in pixels: both the
/// distance and the foreshortening matter.
fn near_and_far(scene: &Scene) -> [[usize; 2]; 2] {
    let wide = |y: usize| {
        let [here, below] = [0.5, 1.5]
            .map(|more| meets(scene, WIDTH as f64 / 2.0, y as f64 + more, TOP).map(|p| p.y));
        // Two stripes are longer along y than across.
        here.zip(below)
            .map_or(0.0, |(here, below)| STRIPES / 0.8 / (here - below))
    };
    let on_coat = |y: usize| {
        meets(scene, WIDTH as f64 / 2.0, y as f64, TOP)
            .is_some_and(|p| (20.0..COAT[1] - 12.0).contains(&p.y))
    };
    let of = |fits: &dyn Fn(f64) -> bool| {
        let all: Vec<usize> = (2..HEIGHT - 2)
            .filter(|y| on_coat(*y) && fits(wide(*y)))
            .collect();
        [
            all.first().copied().unwrap_or(0),
            all.last().map_or(1, |last| last + 1),
        ]
    };
    [of(&|wide| wide >= 6.0), of(&|wide| wide < 2.0)]
}

fn main() -> Result<()> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "out".into()));
    std::fs::create_dir_all(&folder)
        .map_err(|error| Error::Job(format!("{}: {error}", folder.display())))?;
    written(&folder.join("zebra.ply"), &points())?;
    let opacity = json!([{"value": 0, "rgb": [DARK, DARK, DARK], "opacity": 0.9}, {"value": 255, "rgb": [LIGHT, LIGHT, LIGHT], "opacity": 0.9}]);
    let mut tiles = Vec::new();
    println!("| | near: dB | contrast kept | far: dB | false contrast |\n|---|---|---|---|---|");
    let mut told = |name: &str, scene: &Scene, reference: &Picture, picture: Picture| {
        let [near, far] = near_and_far(scene);
        let db = |of| {
            metrics(&rows(&picture, of), &rows(reference, of))
                .psnr_db
                .map_or("equal".into(), |db| format!("{db:.1}"))
        };
        let kept = 100.0 * contrast(&rows(&picture, near)) / contrast(&rows(reference, near));
        let left = 100.0 * contrast(&difference(&rows(&picture, far), &rows(reference, far)))
            / ((LIGHT - DARK) / 2.0);
        println!(
            "| {name} | {} | {kept:.0} % | {} | {left:.1} % |",
            db(near),
            db(far)
        );
        tiles.push(PictureTile {
            caption: format!("{name}: {}, {} dB", db(near), db(far)),
            picture,
        });
    };
    for count in [512, 256] {
        let file = format!("zebra-{count}.raw");
        written(&folder.join(&file), &slab(count))?;
        let raw = json!({"file": file, "size": [COAT[0] as usize, count, 3], "type": "u8", "spacing": [1.0, COAT[1] / count as f64, 1.0]});
        let splats = json!({"volume": raw, "transfer": opacity});
        let mut at_height: Option<Picture> = None;
        for (name, low_pass, by) in [
            ("convolution", 1.0, "convolution"),
            ("uniform scaling", 1.0, "scaling"),
            ("no filter", 0.0, "convolution"),
        ] {
            let scene = loaded(&folder, &splats, low_pass, by)?;
            let picture = render(&scene, &Rules::default()).picture;
            // The visible part of a soft slab is near its upper face, at a height that is the same
            // for all: the height at which the first is nearest to the coat.
            let reference = at_height.get_or_insert_with(|| {
                let [near, _] = near_and_far(&scene);
                let all = (0..8).map(|i| reference(&scene, TOP - 0.5 + 0.25 * f64::from(i)));
                let distance = |of: &Picture| {
                    metrics(&rows(&picture, near), &rows(of, near))
                        .psnr_db
                        .unwrap_or(f64::INFINITY)
                };
                all.max_by(|a, b| distance(a).total_cmp(&distance(b)))
                    .expect("there are heights")
            });
            told(
                &format!("1024×{count}×3, {name}"),
                &scene,
                reference,
                picture,
            );
        }
    }
    let scene = loaded(&folder, &json!({"file": "zebra.ply"}), 1.0, "convolution")?;
    let picture = render(&scene, &Rules::default()).picture;
    told(
        "surface, 1024×512",
        &scene,
        &reference(&scene, TOP),
        picture,
    );
    let tiles: Vec<&dyn Chart> = tiles.iter().map(|tile| tile as &dyn Chart).collect();
    write_png(
        &tiles,
        3,
        [WIDTH as u32 + 24, HEIGHT as u32 + 30],
        &folder.join("zebra.png"),
    )
}

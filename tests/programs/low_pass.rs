//! Compares the two ways to filter a volume seen from afar whose voxels are four times as wide as
//! high: each footprint convolved with the low-pass filter (EWA §6.2), or each kernel enlarged by
//! the same factor in all directions (Swan et al. 1997); EWA Fig. 14.
//!
//! ```sh
//! cargo run --release --example low_pass -- [FOLDER]
//! ```
//! Prints a table and writes `low-pass.png`, and the volume and its scene into the same folder. The
//! reference is the unfiltered picture at eight times the size, convolved with the filter as a
//! picture.

use serde_json::json;
use splatsim::accuracy::metrics;
use splatsim::error::{Error, Result};
use splatsim::golden::{Rules, render};
use splatsim::hardware::{fixed, machines};
use splatsim::output::chart::{Chart, PictureTile, write_png};
use splatsim::output::picture::Picture;
use splatsim::scene::{Overrides, Scene};
use std::path::{Path, PathBuf};

/// Side of the picture, pixels.
const SIDE: usize = 192;
/// Refinement of the reference.
const FINER: usize = 8;
/// Voxels across, down and in depth: half a pixel high and two pixels wide, seen from the front.
const SIZE: [usize; 3] = [80, 320, 4];
/// Pixels in the middle of the picture that are compared; the border of the slab is left out.
const COMPARED: usize = 144;

/// Rings around the middle, finer towards the outside: every direction, and every frequency that
/// the wide voxels can represent.
fn rings() -> Vec<u8> {
    let [width, height, slices] = SIZE;
    let place = |i: usize, of: usize| (i as f64 + 0.5) / of as f64 - 0.5;
    let ring = |x: usize, y: usize| {
        let radius = place(x, width).hypot(place(y, height));
        (127.5 + 127.5 * (160.0 * radius * radius).cos()).round() as u8
    };
    (0..slices)
        .flat_map(|_| (0..height).flat_map(move |y| (0..width).map(move |x| ring(x, y))))
        .collect()
}

/// A scene file's text: the slab fills 5/6 of the picture.
fn text(side: usize, low_pass: f64, by: &str) -> String {
    let [width, height, _] = SIZE;
    let distance = 2000.0;
    let half_view = 0.6 * height as f64;
    let fov_y_degrees = 2.0 * (half_view / distance).atan().to_degrees();
    let middle = [2.0 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0), 1.5];
    json!({
        "splats": {
            "volume": {"file": "rings.raw", "size": SIZE, "type": "u8", "endian": "little", "spacing": [4, 1, 1]},
            "transfer": [{"value": 0, "rgb": [0.02, 0.05, 0.2], "opacity": 0.40476490275606014}, {"value": 255, "rgb": [1, 0.85, 0.5], "opacity": 0.40476490275606014}],
        },
        "materials": [{"unlit": true}],
        "camera": {"eye": [middle[0], middle[1], middle[2] + distance], "target": middle, "fov_y_degrees": fov_y_degrees},
        "image": {"width": side, "height": side},
        "kernel": {"low_pass": low_pass, "low_pass_by": by},
    })
    .to_string()
}

fn drawn(folder: &Path, side: usize, low_pass: f64, by: &str) -> Result<Picture> {
    let path = folder.join("rings.json");
    written(&path, text(side, low_pass, by).as_bytes())?;
    let scene = Scene::load(&path, &Overrides::default())?;
    let rules: Rules = fixed::rules(&machines::load(machines::usual(&scene), &[])?);
    Ok(render(&scene, &rules).picture)
}

fn written(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).map_err(|error| Error::Job(format!("{}: {error}", path.display())))
}

/// Convolves with a Gaussian with a variance of one pixel, and samples at the centres of pixels.
fn filtered(fine: &Picture) -> Picture {
    let sigma = FINER as f64;
    let reach = 5 * FINER as i64;
    let weights = |at: usize| {
        let middle = ((at * FINER) as f64) + 0.5 * FINER as f64 - 0.5;
        let first = (middle as i64 - reach).max(0);
        let last = (middle as i64 + reach).min(fine.width as i64 - 1);
        let all: Vec<(usize, f64)> = (first..=last)
            .map(|i| {
                (
                    i as usize,
                    (-0.5 * ((i as f64 - middle) / sigma).powi(2)).exp(),
                )
            })
            .collect();
        let sum: f64 = all.iter().map(|(_, weight)| weight).sum();
        all.into_iter()
            .map(move |(i, weight)| (i, weight / sum))
            .collect::<Vec<_>>()
    };
    let add = |sum: [f64; 4], pixel: [f64; 4], weight: f64| {
        [0, 1, 2, 3].map(|i| sum[i] + weight * pixel[i])
    };
    let across: Vec<[f64; 4]> = (0..fine.height)
        .flat_map(|y| (0..SIDE).map(move |x| (x, y)))
        .map(|(x, y)| {
            weights(x).into_iter().fold([0.0; 4], |sum, (i, weight)| {
                add(sum, fine.rgba[y * fine.width + i], weight)
            })
        })
        .collect();
    let rgba = (0..SIDE)
        .flat_map(|y| (0..SIDE).map(move |x| (x, y)))
        .map(|(x, y)| {
            weights(y).into_iter().fold([0.0; 4], |sum, (i, weight)| {
                add(sum, across[i * SIDE + x], weight)
            })
        })
        .collect();
    Picture {
        width: SIDE,
        height: SIDE,
        rgba,
        covered: vec![true; SIDE * SIDE],
    }
}

/// The middle of a picture.
fn middle(picture: &Picture) -> Picture {
    let from = (SIDE - COMPARED) / 2;
    let row = |y: usize| &picture.rgba[(from + y) * SIDE + from..][..COMPARED];
    let rgba = (0..COMPARED).flat_map(|y| row(y).to_vec()).collect();
    Picture {
        width: COMPARED,
        height: COMPARED,
        rgba,
        covered: vec![true; COMPARED * COMPARED],
    }
}

/// Root mean square of differences between neighbours, across and down: a measure of detail.
fn detail(picture: &Picture, [right, down]: [usize; 2]) -> f64 {
    let (width, height) = (picture.width - right, picture.height - down);
    let difference = |x: usize, y: usize| {
        let [a, b] = [
            y * picture.width + x,
            (y + down) * picture.width + x + right,
        ]
        .map(|at| picture.rgba[at]);
        (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>()
    };
    let sum: f64 = (0..height)
        .flat_map(|y| (0..width).map(move |x| difference(x, y)))
        .sum();
    (sum / (3 * width * height) as f64).sqrt()
}

fn main() -> Result<()> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "out".into()));
    std::fs::create_dir_all(&folder)
        .map_err(|error| Error::Job(format!("{}: {error}", folder.display())))?;
    written(&folder.join("rings.raw"), &rings())?;
    let reference = filtered(&drawn(&folder, SIDE * FINER, 0.0, "convolution")?);
    let ways = [
        ("no filter", 0.0, "convolution"),
        ("uniform scaling", 1.0, "scaling"),
        ("convolution", 1.0, "convolution"),
    ];
    let kept = |picture: &Picture, axis| {
        detail(&middle(picture), axis) / detail(&middle(&reference), axis)
    };
    println!("| | dB against the reference | greatest error | detail kept across | down |");
    println!("|---|---|---|---|---|");
    let mut tiles = vec![PictureTile {
        caption: "reference".into(),
        picture: reference.clone(),
    }];
    for (name, low_pass, by) in ways {
        let picture = drawn(&folder, SIDE, low_pass, by)?;
        let found = metrics(&middle(&picture), &middle(&reference));
        let db = found
            .psnr_db
            .map_or("equal".into(), |db| format!("{db:.1}"));
        let [across, down] = [[1, 0], [0, 1]].map(|axis| 100.0 * kept(&picture, axis));
        println!(
            "| {name} | {db} | {:.3} | {across:.0} % | {down:.0} % |",
            found.max_error
        );
        tiles.push(PictureTile {
            caption: format!("{name}: {db} dB"),
            picture,
        });
    }
    let tiles: Vec<&dyn Chart> = tiles.iter().map(|tile| tile as &dyn Chart).collect();
    write_png(
        &tiles,
        tiles.len(),
        [SIDE as u32 + 12, SIDE as u32 + 30],
        &folder.join("low-pass.png"),
    )
}

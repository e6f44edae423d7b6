//! Compares three methods of texture acquisition: nearest samples, view-independent EWA, and
//! optimised coefficients (SS §5, Fig. 6), on a plane seen from afar, near and very near.
//!
//! ```sh
//! cargo run --release --example texture_acquisition -- [FOLDER]
//! ```
//! Prints a table and writes `texture-acquisition.png`. The reference is the picture itself, 8×8
//! samples per pixel, convolved with the renderer's low-pass filter.

use glam::DVec2;
use splatsim::error::{Error, Result};
use splatsim::golden::{Rules, render};
use splatsim::output::chart::{Chart, PictureTile, write_png};
use splatsim::output::picture::Picture;
use splatsim::sampling::{
    self, Acquisition, Amount, Pattern, Radii, SamplingRequest, file, sample,
};
use splatsim::scene::mesh::{Image, Mesh, Texture, Wrap};
use splatsim::scene::{Overrides, Scene};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Side of the picture, pixels, and of the middle part that is compared.
const SIDE: usize = 144;
const COMPARED: usize = 128;
/// Points of the unit square: 1/400 apart.
const POINTS: usize = 160_000;
/// Side of the textures, texels, and of a check.
const TEXELS: usize = 1024;
const CHECK: usize = 20;
/// Samples of the reference along a pixel's side, and the radius of its filter in standard
/// deviations.
const SAMPLES: usize = 8;
const REACH: usize = 4;
/// Pixels per point spacing: from afar, near, very near.
const VIEWS: [(&str, f64); 3] = [
    ("minification", 0.4),
    ("magnification", 4.0),
    ("extreme magnification", 16.0),
];
const WAYS: [(&str, Acquisition); 3] = [
    ("nearest", Acquisition::Nearest),
    ("EWA", Acquisition::Ewa),
    ("optimised", Acquisition::Optimised),
];
/// The middle of all views: no lattice of checks is symmetric about it.
const MIDDLE: DVec2 = DVec2::new(0.5137, 0.4891);

fn checkerboard() -> Image {
    let code = |place: usize| {
        if (place / TEXELS / CHECK + place % TEXELS / CHECK).is_multiple_of(2) {
            255
        } else {
            0
        }
    };
    let texels = (0..TEXELS * TEXELS)
        .map(|place| [code(place), code(place), code(place), 255])
        .collect();
    Image {
        width: TEXELS,
        height: TEXELS,
        texels,
    }
}

/// A texture like a photograph of pebbles: noise of all frequencies with an amplitude of 1/f, and
/// the edges of stones.
fn pebbles() -> Image {
    let texel = |place: usize| {
        let x = DVec2::new((place % TEXELS) as f64, (place / TEXELS) as f64) / TEXELS as f64;
        let rough: f64 = (0..7)
            .map(|octave| noise(x * f64::from(8 << octave), octave) / f64::from(1 << octave))
            .sum();
        let (edge, stone) = nearest_stone(x * 24.0);
        let light = (0.35 + 0.25 * rough + 0.5 * (edge * 6.0).min(1.0) - 0.2).clamp(0.0, 1.0);
        let tint = [0.8 + 0.2 * stone, 0.85, 1.0 - 0.25 * stone];
        let [r, g, b] = tint.map(|tint| (255.0 * light * tint).round() as u8);
        [r, g, b, 255]
    };
    Image {
        width: TEXELS,
        height: TEXELS,
        texels: (0..TEXELS * TEXELS).map(texel).collect(),
    }
}

/// A number in [0, 1) for a cell.
fn hash(x: i64, y: i64, salt: u32) -> f64 {
    let mut z = (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        ^ (y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f)
        ^ (u64::from(salt) << 32);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// Values at lattice points, interpolated smoothly, in [−1, 1].
fn noise(x: DVec2, salt: u32) -> f64 {
    let (cell, within) = (x.floor(), x - x.floor());
    let smooth = within * within * (3.0 - 2.0 * within);
    let at = |i: i64, j: i64| 2.0 * hash(cell.x as i64 + i, cell.y as i64 + j, salt) - 1.0;
    let row = |j: i64| at(0, j) + (at(1, j) - at(0, j)) * smooth.x;
    row(0) + (row(1) - row(0)) * smooth.y
}

/// Distance from the border between two stones, and the number of the stone.
fn nearest_stone(x: DVec2) -> (f64, f64) {
    let cell = x.floor();
    let (mut first, mut second, mut stone) = (f64::INFINITY, f64::INFINITY, 0.0);
    for (i, j) in (0..25).map(|n| (n % 5 - 2, n / 5 - 2)) {
        let (column, row) = (cell.x as i64 + i, cell.y as i64 + j);
        let middle = DVec2::new(
            column as f64 + hash(column, row, 100),
            row as f64 + hash(column, row, 101),
        );
        let distance = middle.distance(x);
        if distance < first {
            (second, first, stone) = (first, distance, hash(column, row, 102));
        } else {
            second = second.min(distance);
        }
    }
    (second - first, stone)
}

/// The ideal picture of the plane: samples of each pixel's texels, convolved.
fn reference(image: &Image, pixels_per_unit: f64) -> Picture {
    let fine = (SIDE + 2 * REACH) * SAMPLES;
    let linear: Vec<[f32; 4]> = (0..TEXELS * TEXELS)
        .map(|i| image.linear(i % TEXELS, i / TEXELS))
        .collect();
    let coordinate = |i: usize| {
        ((i as f64 + 0.5) / SAMPLES as f64 - (REACH + SIDE / 2) as f64) / pixels_per_unit
    };
    let index = |c: f64| ((c * TEXELS as f64).floor() as i64).rem_euclid(TEXELS as i64) as usize;
    // Rows of pictures count down, y counts up, and v = 1 − y.
    let texel = |i: usize, j: usize| {
        linear[index(1.0 - MIDDLE.y + coordinate(j)) * TEXELS + index(MIDDLE.x + coordinate(i))]
    };
    let taps = (2 * REACH + 1) * SAMPLES;
    let weight = |i: usize| {
        let pixels = (i as f64 + 0.5) / SAMPLES as f64 - (REACH as f64 + 0.5);
        (-0.5 * pixels * pixels).exp()
    };
    let whole: f64 = (0..taps).map(weight).sum();
    let weights: Vec<f64> = (0..taps).map(|i| weight(i) / whole).collect();
    let across: Vec<Vec<[f64; 3]>> = (0..fine)
        .map(|j| {
            let row: Vec<[f32; 4]> = (0..fine).map(|i| texel(i, j)).collect();
            let at = |x: usize| {
                weights.iter().enumerate().fold([0.0; 3], |sum, (i, w)| {
                    add(sum, row[x * SAMPLES + i].map(f64::from), *w)
                })
            };
            (0..SIDE).map(at).collect()
        })
        .collect();
    let at = |x: usize, y: usize| {
        let sum = |sum, (j, w): (usize, &f64)| {
            let [r, g, b] = across[y * SAMPLES + j][x];
            add(sum, [r, g, b, 1.0], *w)
        };
        let [r, g, b] = weights.iter().enumerate().fold([0.0; 3], sum);
        [r, g, b, 1.0]
    };
    let rgba = (0..SIDE * SIDE).map(|i| at(i % SIDE, i / SIDE)).collect();
    Picture {
        width: SIDE,
        height: SIDE,
        rgba,
        covered: vec![true; SIDE * SIDE],
    }
}

fn add(sum: [f64; 3], pixel: [f64; 4], weight: f64) -> [f64; 3] {
    [0, 1, 2].map(|c| sum[c] + weight * pixel[c])
}

/// Golden's scene of the plane, seen from the front.
fn scene(folder: &Path, cutoff: f64, pixels_per_unit: f64) -> Result<Scene> {
    let distance = 100.0 * SIDE as f64 / pixels_per_unit;
    let fov = 2.0
        * (0.5 * SIDE as f64 / pixels_per_unit / distance)
            .atan()
            .to_degrees();
    let text = serde_json::json!({
        "splats": {"file": "plane.ply"},
        "materials": [{"unlit": true}],
        "camera": {"eye": [MIDDLE.x, MIDDLE.y, distance], "target": [MIDDLE.x, MIDDLE.y, 0], "up": [0, 1, 0], "fov_y_degrees": fov},
        "image": {"width": SIDE, "height": SIDE},
        "kernel": {"cutoff": cutoff},
    });
    let path = folder.join("plane.json");
    std::fs::write(&path, text.to_string())
        .map_err(|error| Error::Job(format!("{}: {error}", path.display())))?;
    Scene::load(&path, &Overrides::default())
}

/// Decibels of the mean square difference, in linear light, in the middle of the pictures; colours
/// are not clamped.
fn decibels(a: &Picture, b: &Picture) -> f64 {
    let from = (SIDE - COMPARED) / 2;
    let places =
        (0..COMPARED * COMPARED).map(|i| (from + i / COMPARED) * SIDE + from + i % COMPARED);
    let squares: f64 = places
        .map(|at| {
            (0..3)
                .map(|c| (a.rgba[at][c] - b.rgba[at][c]).powi(2))
                .sum::<f64>()
        })
        .sum();
    -10.0 * (squares / (3 * COMPARED * COMPARED) as f64).log10()
}

fn main() -> Result<()> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "out".into()));
    std::fs::create_dir_all(&folder)
        .map_err(|error| Error::Job(format!("{}: {error}", folder.display())))?;
    let mut tiles = Vec::new();
    println!(
        "| picture | cutoff | view | nearest | EWA | optimised | the same, clamped | leave [0, 1] | by at most |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for (name, image) in [("checkerboard", checkerboard()), ("pebbles", pebbles())] {
        let image = Arc::new(image);
        for cutoff in [2.0, 8.0] {
            let picture = sampling::Picture::Texture(Texture {
                image: image.clone(),
                wrap: [Wrap::Repeat; 2],
            });
            let request = SamplingRequest {
                amount: Amount::Points(POINTS),
                pattern: Pattern::BlueNoise,
                seed: 0,
                radii: Radii::Area,
                acquisition: Acquisition::Nearest,
                picture,
                cutoff,
            };
            let ways: Vec<_> = WAYS
                .iter()
                .map(|(_, acquisition)| {
                    sample(
                        &Mesh::plane(),
                        &SamplingRequest {
                            acquisition: *acquisition,
                            ..request.clone()
                        },
                    )
                    .map_err(Error::Job)
                })
                .collect::<Result<_>>()?;
            file::write(&folder.join("plane.ply"), &ways[2].splats)?;
            for (view, pixels) in VIEWS {
                let pixels_per_unit = pixels * (POINTS as f64).sqrt();
                let reference = reference(&image, pixels_per_unit);
                // Clamped, as after reading a file.
                let read = scene(&folder, cutoff, pixels_per_unit)?;
                let mut scenes: Vec<Scene> = ways
                    .iter()
                    .map(|way| Scene {
                        splats: way.splats.clone(),
                        ..read.clone()
                    })
                    .collect();
                scenes.push(read);
                let drawn: Vec<Picture> = scenes
                    .iter()
                    .map(|scene| render(scene, &Rules::default()).picture)
                    .collect();
                let db: Vec<String> = drawn
                    .iter()
                    .map(|picture| format!("{:.1}", decibels(picture, &reference)))
                    .collect();
                let share = 100.0 * ways[2].beyond as f64 / POINTS as f64;
                println!(
                    "| {name} | {cutoff} | {view} | {} | {share:.1} % | {:.2} |",
                    db.join(" | "),
                    ways[2].most_beyond
                );
                if cutoff == 2.0 {
                    tiles.push(PictureTile {
                        caption: view.to_string(),
                        picture: reference,
                    });
                    let captions = WAYS
                        .iter()
                        .zip(&db)
                        .map(|((way, _), db)| format!("{way}: {db} dB"));
                    tiles.extend(
                        captions
                            .zip(drawn)
                            .map(|(caption, picture)| PictureTile { caption, picture }),
                    );
                }
            }
        }
    }
    let tiles: Vec<&dyn Chart> = tiles.iter().map(|tile| tile as &dyn Chart).collect();
    write_png(
        &tiles,
        4,
        [SIDE as u32 + 12, SIDE as u32 + 30],
        &folder.join("texture-acquisition.png"),
    )
}

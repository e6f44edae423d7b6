//! Compares four filters of splats on a checkerboard up to the horizon (SS Fig. 8). The reference
//! is the board itself, convolved with the low-pass filter as a picture, from 512 rays per pixel.
//!
//! ```sh
//! cargo run --release --example filters -- [FOLDER] [SCENE]
//! ```
//! With a scene it draws that scene instead, by its own `kernel.filter`: `golden.png` and
//! `ideal.png`, and their difference.
//!
//! Prints a table and writes `filters.png`. Rows near the eye show blur: there the pixel grid can
//! represent the board, and a filter's loss of contrast is an error. Rows near the horizon show
//! aliasing: there two fields are lower than two pixels, and any contrast that differs from the
//! filtered board's is false.

use glam::DVec3;
use splatsim::accuracy::metrics;
use splatsim::error::{Error, Result};
use splatsim::golden::{Rules, ideal, render};
use splatsim::hardware::{fixed, quantise};
use splatsim::output::chart::{Chart, PictureTile, write_png};
use splatsim::output::picture::Picture;
use splatsim::scene::{Camera, Filter, Image, Kernel, Material, Overrides, Scene, Splat};
use std::path::{Path, PathBuf};

const WIDTH: usize = 256;
const HEIGHT: usize = 128;
/// Full vertical angle of view, degrees.
const FOV_Y: f64 = 60.0;
/// The board: side of a field, distance of splats, depths at which it begins and ends; the eye is 1
/// above it.
const FIELD: f64 = 0.2;
const SPACING: f64 = 0.05;
const DEPTHS: [f64; 2] = [0.8, 40.0];
/// Colours of fields, linear light.
const LIGHT: f64 = 0.9;
const DARK: f64 = 0.1;
/// Very different from the board's mean, so that holes are visible.
const BACKGROUND: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
/// Rays per pixel across and down: fields are flatter than wide.
const RAYS: [usize; 2] = [8, 64];

fn field(x: f64, z: f64) -> f64 {
    if ((x / FIELD).floor() + (z / FIELD).floor()).rem_euclid(2.0) < 1.0 {
        LIGHT
    } else {
        DARK
    }
}

/// The board as splats.
fn board(focal_px: f64) -> Vec<Splat> {
    let rows = ((DEPTHS[1] - DEPTHS[0]) / SPACING) as usize;
    let row = |j: usize| {
        let z = DEPTHS[0] + (j as f64 + 0.5) * SPACING;
        let half = ((z * (WIDTH as f64 / 2.0 + 12.0) / focal_px) / SPACING).ceil() as i64;
        (-half..half).map(move |i| {
            let x = (i as f64 + 0.5) * SPACING;
            let rgb = [field(x, z); 3];
            Splat {
                position: DVec3::new(x, 0.0, z),
                normal: DVec3::Y,
                radius: SPACING,
                rgb,
                opacity: 1.0,
                material: 0,
            }
        })
    };
    (0..rows).flat_map(row).collect()
}

/// The scene, with its middle row on the horizon: one surface; every pixel counts as covered.
fn scene() -> Result<Scene> {
    let mut scene = Scene::load("checkerboard", &Overrides::default())?;
    scene.image = Image {
        width: WIDTH,
        height: HEIGHT,
        background: BACKGROUND,
        encoded: false,
    };
    scene.camera = Camera {
        eye: DVec3::Y,
        target: DVec3::new(0.0, 1.0, 1.0),
        up: DVec3::Y,
        fov_y_degrees: FOV_Y,
        near: 0.01,
        ..scene.camera
    };
    scene.materials = vec![Material::Unlit];
    (scene.surface.z_threshold, scene.surface.coverage_threshold) = (100.0, 1e-3);
    scene.splats = board(scene.view().focal_px[0]);
    Ok(scene)
}

/// The board itself, convolved with a Gaussian with a variance of one pixel: rays by rows and
/// columns, then both sums. `right` is the board's x to the right of the picture.
fn reference(focal_px: f64, right: f64) -> Picture {
    const REACH: usize = 5;
    let [across, down] = RAYS;
    let (width, height) = ((WIDTH + 2 * REACH) * across, (HEIGHT + 2 * REACH) * down);
    let place = |i: usize, rays: usize| (i as f64 + 0.5) / rays as f64 - REACH as f64;
    let weights = |rays: usize| -> Vec<f64> {
        let all: Vec<f64> = (0..(2 * REACH + 1) * rays)
            .map(|i| libm::exp(-0.5 * (place(i, rays) - 0.5).powi(2)))
            .collect();
        let sum: f64 = all.iter().sum();
        all.into_iter().map(|weight| weight / sum).collect()
    };
    let (of_row, of_column) = (weights(across), weights(down));
    let columns: Vec<f64> = (0..height)
        .flat_map(|j| {
            let below = place(j, down) - HEIGHT as f64 / 2.0;
            let z = focal_px / below;
            let colour = |i: usize| {
                let x = right * (place(i, across) - WIDTH as f64 / 2.0) / focal_px * z;
                if below > 0.0 && z < DEPTHS[1] {
                    field(x, z)
                } else {
                    BACKGROUND[0]
                }
            };
            let row: Vec<f64> = (0..width).map(colour).collect();
            let sum = |x: usize| {
                of_row
                    .iter()
                    .zip(&row[x * across..])
                    .map(|(weight, colour)| weight * colour)
                    .sum::<f64>()
            };
            (0..WIDTH).map(sum).collect::<Vec<_>>()
        })
        .collect();
    let pixel = |index: usize| {
        let (x, y) = (index % WIDTH, index / WIDTH);
        let grey = (of_column.iter().enumerate())
            .map(|(j, weight)| weight * columns[(y * down + j) * WIDTH + x])
            .sum::<f64>();
        [grey, grey, grey, 1.0]
    };
    Picture {
        width: WIDTH,
        height: HEIGHT,
        rgba: (0..WIDTH * HEIGHT).map(pixel).collect(),
        covered: vec![true; WIDTH * HEIGHT],
    }
}

/// Some rows of a picture.
fn rows(picture: &Picture, [first, end]: [usize; 2]) -> Picture {
    let rgba = picture.rgba[first * WIDTH..end * WIDTH].to_vec();
    Picture {
        width: WIDTH,
        height: end - first,
        covered: vec![true; rgba.len()],
        rgba,
    }
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

/// Standard deviation of grey: a measure of contrast.
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

fn main() -> Result<()> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "out".into()));
    std::fs::create_dir_all(&folder)
        .map_err(|error| Error::Job(format!("{}: {error}", folder.display())))?;
    if let Some(path) = std::env::args().nth(2) {
        return draw(&path, &folder);
    }
    let scene = scene()?;
    let focal_px = scene.view().focal_px[0];
    // Rows below the horizon in which a field is four pixels high, and in which two fields are two
    // pixels high.
    let below = |field_px: f64| HEIGHT / 2 + (field_px * focal_px / FIELD).sqrt() as usize;
    let last = HEIGHT / 2 + (focal_px / DEPTHS[1]).ceil() as usize + 4;
    let (near, far) = ([below(4.0), HEIGHT - 2], [last, below(1.0)]);
    let reference = reference(focal_px, scene.view().rotation.row(0).x);
    println!("| filter | near: dB | contrast kept | far: dB | false contrast |");
    println!("|---|---|---|---|---|");
    let figures = |picture: &Picture| {
        let db = |of: [usize; 2]| {
            metrics(&rows(picture, of), &rows(&reference, of))
                .psnr_db
                .map_or("equal".into(), |db| format!("{db:.1}"))
        };
        let kept = 100.0 * contrast(&rows(picture, near)) / contrast(&rows(&reference, near));
        let left = 100.0 * contrast(&difference(&rows(picture, far), &rows(&reference, far)))
            / ((LIGHT - DARK) / 2.0);
        [
            db(near),
            format!("{kept:.0} %"),
            db(far),
            format!("{left:.1} %"),
        ]
    };
    let (mut of_ewa, mut between): (Option<Picture>, Option<f64>) = (None, None);
    let mut tiles = vec![PictureTile {
        caption: "the board, convolved".into(),
        picture: reference.clone(),
    }];
    let machine = machines()?;
    let ways = [
        ("EWA", Filter::Ewa, 1.0),
        ("source-space EWA", Filter::SourceEwa, 1.0),
        ("elliptical, no low-pass", Filter::Ewa, 0.0),
        ("circular", Filter::Circular, 1.0),
    ];
    for (name, filter, low_pass) in ways {
        let scene = Scene {
            kernel: Kernel {
                filter,
                low_pass,
                ..scene.kernel
            },
            ..scene.clone()
        };
        let golden = render(&scene, &Rules::default()).picture;
        let figures_of = figures(&golden);
        println!("| {name} | {} |", figures_of.join(" | "));
        match (filter, &of_ewa) {
            (Filter::Ewa, None) => of_ewa = Some(golden.clone()),
            (Filter::SourceEwa, Some(ewa)) => between = metrics(&golden, ewa).psnr_db,
            _ => {}
        }
        if filter == Filter::Ewa {
            let quantised = quantise::quantise(&scene, &machine.machine)?;
            let fixed = fixed::picture(&machine, &fixed::draw(&machine, &quantised));
            println!(
                "| {name}, on `reference` | {} |",
                figures(&fixed).join(" | ")
            );
        }
        tiles.push(PictureTile {
            caption: format!("{name}: near {}, far {} dB", figures_of[0], figures_of[2]),
            picture: golden,
        });
    }
    println!(
        "\nEWA and source-space EWA are {:.1} dB apart",
        between.unwrap_or(f64::INFINITY)
    );
    let tiles: Vec<&dyn Chart> = tiles.iter().map(|tile| tile as &dyn Chart).collect();
    write_png(
        &tiles,
        1,
        [WIDTH as u32 + 12, HEIGHT as u32 + 30],
        &folder.join("filters.png"),
    )
}

/// `golden` and `ideal` of a scene, by its own filter.
fn draw(path: &str, folder: &Path) -> Result<()> {
    let scene = Scene::load(path, &Overrides::default())?;
    let (golden, ideal) = (
        render(&scene, &Rules::default()).picture,
        ideal(&scene).picture,
    );
    let db = metrics(&golden, &ideal)
        .psnr_db
        .map_or("equal".into(), |db| format!("{db:.1} dB"));
    println!("{}: golden − ideal {db}", scene.name);
    golden.write_png(&folder.join("golden.png"))?;
    ideal.write_png(&folder.join("ideal.png"))
}

/// The machine `reference`, with a table and words that hold a plane up to its horizon.
fn machines() -> Result<rtl_model::pipeline::Elaborated> {
    fixed::elaborate(&splatsim::hardware::machines::load("reference", &[])?)
}

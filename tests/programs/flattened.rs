//! Flattens the kernels of an isosurface step by step and compares with the same splats as discs:
//! they converge (EWA §6.4, (37)).
//!
//! ```sh
//! cargo run --release --example flattened -- [FOLDER]
//! ```
//! Prints a table and writes `flattened.png`: the differences of `golden` and of the machine from
//! `golden` of the discs. The amplitudes agree for flat kernels, so that pictures converge as the
//! variance does.

use serde_json::json;
use splatsim::accuracy::{Distance, distance};
use splatsim::error::{Error, Result};
use splatsim::golden::render;
use splatsim::hardware::{fixed, machines, quantise};
use splatsim::output::chart::{Axis, Mark, Panel, Series, write_png};
use splatsim::scene::{Overrides, Scene};
use std::path::{Path, PathBuf};

/// Flattening factor of kernels along the gradient.
const FLATTER: [f64; 9] = [1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1e3, 1e4, 1e6];

fn surface(folder: &Path, flatten: f64) -> Result<Scene> {
    let text = json!({
        "splats": {"volume": {"builtin": "marschner-lobb", "samples": 64}, "isovalue": 0.5, "flatten": flatten},
        "camera": {"eye": [0.6, -2.6, 2.4], "target": [0, 0, 0], "up": [0, 0, 1], "fov_y_degrees": 40},
        "image": {"width": 256, "height": 256},
    });
    let path = folder.join("flattened.json");
    std::fs::write(&path, text.to_string())
        .map_err(|error| Error::Job(format!("{}: {error}", path.display())))?;
    Scene::load(&path, &Overrides::default())
}

fn main() -> Result<()> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "out".into()));
    std::fs::create_dir_all(&folder)
        .map_err(|error| Error::Job(format!("{}: {error}", folder.display())))?;
    let machine = machines::load("volume", &[])?;
    let (elaborated, rules) = (fixed::elaborate(&machine)?, fixed::rules(&machine));
    let discs = Scene {
        ellipsoids: None,
        ..surface(&folder, 1.0)?
    };
    let limit = render(&discs, &rules).picture;
    let small = |distance: &Distance| format!("{:.1e}", distance.mean_covered_error);
    let [mut golden, mut fixed_] = [Vec::new(), Vec::new()];
    println!("| flattened by | golden − golden of discs, mean | fixed − golden of discs, mean |");
    println!("|---|---|---|");
    for flatten in FLATTER {
        let scene = surface(&folder, flatten)?;
        let drawing = fixed::draw(&elaborated, &quantise::quantise(&scene, &machine)?);
        let of_golden = distance(&render(&scene, &rules).picture, &limit);
        let of_fixed = distance(&fixed::picture(&elaborated, &drawing), &limit);
        println!(
            "| {flatten} | {} | {} |",
            small(&of_golden),
            small(&of_fixed)
        );
        golden.push([flatten, of_golden.mean_covered_error.max(1e-16)]);
        fixed_.push([flatten, of_fixed.mean_covered_error]);
    }
    let series = [("golden", golden, 6), ("volume", fixed_, 0)]
        .map(|(name, points, colour)| Series {
            name: name.into(),
            points,
            mark: Mark::Line,
            colour,
        })
        .into();
    let panel = Panel {
        title: "Flattened kernels become discs".into(),
        x: Axis::log("flattened by"),
        y: Axis::log("mean distance from golden of the discs"),
        series,
        ..Panel::default()
    };
    write_png(&[&panel], 1, [640, 420], &folder.join("flattened.png"))
}

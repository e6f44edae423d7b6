//! Draws a scene with increasingly coarse cuts of its tree, and from increasing distances: the
//! accuracy for a number of splats, cycles and bytes.
//!
//! ```sh
//! cargo run --release --example level_of_detail -- [FOLDER] [SCENE] [SIDE]
//! ```
//! Prints two tables and writes `level-of-detail.png`. The default scene is `torus-knot`, with 256
//! pixels per side.

use splatsim::accuracy::metrics;
use splatsim::error::{Error, Result};
use splatsim::golden::ideal;
use splatsim::hardware::{fixed, machines};
use splatsim::output::chart::{Axis, Chart, Mark, Panel, Series, write_png};
use splatsim::output::picture::Picture;
use splatsim::run::evaluation::Evaluation;
use splatsim::scene::tree::Tree;
use splatsim::scene::tree::cut::{Budget, Detail, DetailRules, DrawOrder};
use splatsim::scene::{Overrides, Scene};
use std::path::PathBuf;
use std::sync::Arc;

/// Limits of a node's size, pixels.
const PIXELS: [f64; 7] = [0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0];
/// Factors of the distance.
const DISTANCES: [f64; 5] = [1.0, 2.0, 4.0, 8.0, 16.0];
/// Limits that are drawn from all distances.
const FROM_AFAR: [f64; 4] = [0.0, 1.0, 4.0, 16.0];

/// Costs of a frame: splats, nodes read, cycles, megabytes, and golden − ideal, dB.
struct FrameCosts {
    splats: u64,
    read: u64,
    cycles: u64,
    megabytes: f64,
    db: f64,
}

fn row(
    scene: &Scene,
    tree: &Arc<Tree>,
    (pixels, order): (f64, DrawOrder),
    whole: &Picture,
) -> Result<FrameCosts> {
    let rules = DetailRules {
        pixels,
        order,
        culls: true,
        ahead: 8,
        budget: Budget::default(),
    };
    let scene = Scene {
        detail: Some(Detail::new(tree.clone(), rules)),
        ..scene.clone()
    }
    .cut();
    let machine = fixed::elaborate(&machines::load("reference", &[])?)?;
    let evaluation = Evaluation::on(&scene, &machine)?;
    let work = evaluation.observe().work;
    let cycles =
        rtl_model::timing::replay(&machine.timing, &work, rtl_model::timing::Detail::Accounts);
    Ok(FrameCosts {
        splats: scene.splats.len() as u64,
        read: work.walk.len() as u64,
        cycles: cycles.total,
        megabytes: cycles.memory.total_bytes() as f64 / 1e6,
        db: metrics(&evaluation.golden().picture, whole)
            .psnr_db
            .unwrap_or(f64::INFINITY),
    })
}

fn panel(title: &str, x: &str, series: Vec<(String, Vec<[f64; 2]>)>) -> Panel {
    let series = series.into_iter().enumerate();
    Panel {
        title: title.into(),
        x: Axis::log(x),
        y: Axis::linear("golden − ideal, dB"),
        series: series
            .map(|(colour, (name, points))| Series {
                name,
                points,
                mark: Mark::Rings,
                colour,
            })
            .collect(),
        ..Panel::default()
    }
}

fn main() -> Result<()> {
    let argument =
        |nth: usize, usual: &str| std::env::args().nth(nth).unwrap_or_else(|| usual.into());
    let folder = PathBuf::from(argument(1, "out"));
    std::fs::create_dir_all(&folder)
        .map_err(|error| Error::Job(format!("{}: {error}", folder.display())))?;
    let side: usize = argument(3, "256")
        .parse()
        .map_err(|_| Error::Job("SIDE must be a number of pixels".into()))?;
    let scene = Scene::load(
        argument(2, "torus-knot"),
        &Overrides {
            size: Some((side, side)),
        },
    )?;
    let tree = Tree::new(&scene.splats, 4)
        .ok_or_else(|| Error::Job("the scene holds no splats".into()))?;
    let tree = Arc::new(tree);
    let whole = ideal(&scene).picture;
    println!(
        "{} on reference, {side}×{side}: {} splats, {} nodes\n",
        scene.name,
        tree.leaves(),
        tree.nodes().len()
    );
    println!(
        "| pixels | splats | nodes read | cycles | coarse to fine | MB | golden − ideal, dB |"
    );
    println!("|---|---|---|---|---|---|---|");
    let mut rows = Vec::new();
    for pixels in PIXELS {
        let row_of = |order| row(&scene, &tree, (pixels, order), &whole);
        let (walk, listed) = (row_of(DrawOrder::Walk)?, row_of(DrawOrder::CoarseToFine)?);
        println!(
            "| {pixels} | {} | {} | {} | {} | {:.1} | {:.1} |",
            walk.splats, walk.read, walk.cycles, listed.cycles, walk.megabytes, walk.db
        );
        rows.push(walk);
    }
    println!(
        "\n| farther | {} |",
        FROM_AFAR
            .map(|pixels| format!("dB and splats at {pixels} px"))
            .join(" | ")
    );
    println!("|---|{}", "---|".repeat(FROM_AFAR.len()));
    let mut afar = FROM_AFAR.map(|pixels| (format!("{pixels} px"), Vec::new()));
    for distance in DISTANCES {
        let mut scene = scene.clone();
        scene.camera.eye =
            scene.camera.target + (scene.camera.eye - scene.camera.target) * distance;
        let whole = ideal(&scene).picture;
        let mut cells = Vec::new();
        for (pixels, (_, points)) in FROM_AFAR.iter().zip(&mut afar) {
            let row = row(&scene, &tree, (*pixels, DrawOrder::Walk), &whole)?;
            cells.push(format!("{:.1}, {}", row.db, row.splats));
            points.push([distance, row.db]);
        }
        println!("| {distance}× | {} |", cells.join(" | "));
    }
    let points = |of: fn(&FrameCosts) -> f64| {
        vec![(
            String::new(),
            rows.iter().map(|row| [of(row), row.db]).collect::<Vec<_>>(),
        )]
    };
    let panels = [
        panel(
            "what splats buy",
            "splats drawn",
            points(|row| row.splats as f64),
        ),
        panel("what cycles buy", "cycles", points(|row| row.cycles as f64)),
        panel(
            "what bytes buy",
            "MB to and from memory",
            points(|row| row.megabytes),
        ),
        panel("from afar", "times farther away", afar.into()),
    ];
    let charts: Vec<&dyn Chart> = panels.iter().map(|panel| panel as &dyn Chart).collect();
    write_png(&charts, 2, [480, 340], &folder.join("level-of-detail.png"))
}

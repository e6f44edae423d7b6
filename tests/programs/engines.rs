//! Replays scenes on machines with an increasing number of tile engines, and reports frames per
//! second and area by the bandwidth of the shared memory.
//!
//! ```sh
//! cargo run --release --example engines -- FOLDER SCENE…
//! ```
//! Prints a table for each scene and writes `engines.png`. Each scene is drawn once, at 512×512, on
//! `reference`.

use rtl_model::timing::{Detail, replay};
use splatsim::error::{Error, Result};
use splatsim::hardware::{fixed, machines};
use splatsim::output::chart::{Axis, Chart, Mark, Panel, Series, write_png};
use splatsim::performance::cost::{CostReport, Prices};
use splatsim::performance::cycles::CyclesReport;
use splatsim::run::evaluation::Evaluation;
use splatsim::scene::{Overrides, Scene};
use std::path::PathBuf;

const ENGINES: [u32; 5] = [1, 2, 4, 8, 16];
/// Bytes per cycle of the memory that all engines share.
const MEMORIES: [u32; 3] = [16, 64, 256];

/// Frames per second and area, and the bottleneck of the frame.
struct Point {
    frames_per_second: f64,
    area: f64,
    limited_by: String,
}

fn point(work: &rtl_model::work::Work, engines: u32, bytes: u32) -> Result<Point> {
    let settings = [
        format!("timing.engines={engines}"),
        format!("timing.memory.bytes_per_cycle={bytes}"),
    ];
    let machine = fixed::elaborate(&machines::load("reference", &settings)?)?;
    let cycles = replay(&machine.timing, work, Detail::Accounts);
    let report = CyclesReport::new(&machine.timing, work, &cycles);
    let area = CostReport::new(&machine, &cycles, &Prices::default())
        .cost
        .area;
    Ok(Point {
        frames_per_second: report.frames_per_second,
        area,
        limited_by: report.limited_by(),
    })
}

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().unwrap_or_else(|| "out".into()));
    std::fs::create_dir_all(&folder)
        .map_err(|error| Error::Job(format!("{}: {error}", folder.display())))?;
    let named: Vec<String> = arguments.collect();
    let scenes = if named.is_empty() {
        vec!["torus-knot".to_owned()]
    } else {
        named
    };
    let mut panels = Vec::new();
    for name in scenes {
        let scene = Scene::load(
            &name,
            &Overrides {
                size: Some((512, 512)),
            },
        )?;
        let machine = fixed::elaborate(&machines::load("reference", &[])?)?;
        let work = Evaluation::on(&scene, &machine)?.observe().work;
        println!(
            "{}, {} splats: frames/s by bytes a cycle of memory\n",
            scene.name,
            scene.splats.len()
        );
        println!(
            "| engines | area | {} |",
            MEMORIES.map(|bytes| bytes.to_string()).join(" | ")
        );
        println!("|---|---|{}", "---|".repeat(MEMORIES.len()));
        let mut series = MEMORIES.map(|bytes| (format!("{bytes} B a cycle"), Vec::new()));
        for engines in ENGINES {
            let points = MEMORIES
                .iter()
                .map(|bytes| point(&work, engines, *bytes))
                .collect::<Result<Vec<_>>>()?;
            let cells = points
                .iter()
                .map(|point| format!("{:.1} ({})", point.frames_per_second, point.limited_by));
            println!(
                "| {engines} | {:.0} | {} |",
                points[0].area,
                cells.collect::<Vec<_>>().join(" | ")
            );
            for ((_, line), point) in series.iter_mut().zip(&points) {
                line.push([point.area / 1e6, point.frames_per_second]);
            }
        }
        println!();
        let series = series.into_iter().enumerate();
        panels.push(Panel {
            title: format!("{}: 1 to 16 engines", scene.name),
            x: Axis::linear("area, million LUT equivalents"),
            y: Axis::linear("frames/s"),
            series: series
                .map(|(colour, (name, points))| Series {
                    name,
                    points,
                    mark: Mark::Rings,
                    colour,
                })
                .collect(),
            ..Panel::default()
        });
    }
    let charts: Vec<&dyn Chart> = panels.iter().map(|panel| panel as &dyn Chart).collect();
    write_png(
        &charts,
        charts.len().min(3),
        [420, 340],
        &folder.join("engines.png"),
    )
}

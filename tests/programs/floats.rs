//! Compares fixed-point and floating-point words at equal area: `gaussian` with fewer and fewer
//! fraction bits, and `fp16` with fewer and fewer significant bits, in the same words; also with
//! subnormal numbers flushed to zero, and with operators that round.
//!
//! ```sh
//! cargo run --release --example floats -- [FOLDER]
//! ```
//! Prints a table for each scene and writes `floats.png`. The area is that of logic and flip-flops,
//! in thousands of NAND2. The error is that of the arithmetic, fixed − golden.

use rtl_model::Machine;
use rtl_model::machine::Operators;
use rtl_model::num::Format;
use serde_json::Value;
use splatsim::accuracy::metrics;
use splatsim::error::{Error, Result};
use splatsim::golden::{Rules, render};
use splatsim::hardware::quantise::quantise;
use splatsim::hardware::{fixed, machines};
use splatsim::output::chart::{Axis, Chart, Mark, Panel, Series, write_png};
use splatsim::performance::cost::{Cost, DEFAULT};
use splatsim::scene::{Overrides, Scene};
use std::path::PathBuf;

const SCENES: [&str; 3] = ["glass-spheres", "nested-shells", "bouquet"];
/// Side of the pictures, pixels.
const SIDE: usize = 256;

/// A machine with more or fewer bits in the words that `fp16` has in floating point. `flushes`: their
/// subnormal numbers are flushed to zero.
fn finer(base: &Machine, bits: i32, flushes: bool) -> Result<Machine> {
    let half = machines::words(&machines::load("fp16", &[])?);
    let is_float = |path: &String| {
        half.iter()
            .any(|(known, format)| known == path && format.is_float())
    };
    let changes: Vec<(String, Value)> = machines::words(base)
        .into_iter()
        .filter(|(path, _)| is_float(path))
        .map(|(path, format): (String, Format)| {
            let bits = bits.max(-format.frac_bits);
            let format = Format {
                flushes,
                ..format.finer(bits)
            };
            (path, format.to_string().into())
        })
        .collect();
    machines::with(base, &changes, "")
}

/// Bits of fraction or significand, area, and the error in dB on each scene.
type Row = (i32, f64, [f64; SCENES.len()]);

fn rows(
    base: &Machine,
    steps: &[i32],
    width: impl Fn(i32) -> i32,
    flushes: bool,
) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    for step in steps {
        let elaborated = fixed::elaborate(&finer(base, *step, flushes)?)?;
        let gates = Cost::new(&elaborated, &DEFAULT).gates;
        let mut errors = [0.0; SCENES.len()];
        for (error, scene) in errors.iter_mut().zip(SCENES) {
            let size = Overrides {
                size: Some((SIDE, SIDE)),
            };
            let scene = Scene::load(scene, &size)?;
            let rules: Rules = fixed::rules(&elaborated.machine);
            let quantised = quantise(&scene, &elaborated.machine)?;
            let drawing = fixed::draw(&elaborated, &quantised);
            let picture = fixed::picture(&elaborated, &drawing);
            let golden = render(&scene, &rules).picture;
            *error = metrics(&picture, &golden).psnr_db.unwrap_or(f64::INFINITY);
        }
        rows.push((
            width(*step),
            (gates.logic + gates.flip_flops) / 1000.0,
            errors,
        ));
    }
    Ok(rows)
}

/// The error at an area, on a line between the two nearest rows.
fn at(rows: &[Row], area: f64, scene: usize) -> Option<f64> {
    rows.windows(2).find_map(|pair| {
        let [(_, a, x), (_, b, y)] = pair else {
            return None;
        };
        let part = (area - a) / (b - a);
        (0.0..=1.0)
            .contains(&part)
            .then(|| x[scene] + part * (y[scene] - x[scene]))
    })
}

fn main() -> Result<()> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "out".into()));
    std::fs::create_dir_all(&folder)
        .map_err(|error| Error::Job(format!("{}: {error}", folder.display())))?;
    let fixed: Vec<i32> = (-12..=0).step_by(2).collect();
    let fixed = rows(
        &machines::load("gaussian", &[])?,
        &fixed,
        |step| step,
        false,
    )?;
    let steps: Vec<i32> = (-6..=0).collect();
    let half = machines::load("fp16", &[])?;
    let rounding = Machine {
        operators: Operators::Rounded,
        ..half.clone()
    };
    let floats = rows(&half, &steps, |step| 11 + step, false)?;
    let flushed = rows(&half, &steps, |step| 11 + step, true)?;
    let rounded = rows(&rounding, &steps, |step| 11 + step, false)?;
    println!("| words | bits | kGE | {} |", SCENES.join(" | "));
    println!("|---|---|---|{}", "---|".repeat(SCENES.len()));
    let all = [
        ("fixed", &fixed),
        ("float", &floats),
        ("float, flushed", &flushed),
        ("float, operators rounded", &rounded),
    ];
    for (kind, rows) in all {
        for (bits, area, errors) in rows {
            let errors = errors.map(|error| format!("{error:.1}")).join(" | ");
            println!("| {kind} | {bits} | {area:.0} | {errors} |");
        }
    }
    println!("\nFloating point less fixed point at equal area, dB:");
    for (scene, name) in SCENES.iter().enumerate() {
        let gains: Vec<String> = floats
            .iter()
            .filter_map(|(bits, area, errors)| {
                let same = at(&fixed, *area, scene)?;
                Some(format!("{bits} bits {:+.1}", errors[scene] - same))
            })
            .collect();
        println!("{name}: {}", gains.join(", "));
    }
    let panels = SCENES.iter().enumerate().map(|(scene, name)| {
        let line = |name: &str, rows: &[Row], colour| Series {
            name: name.into(),
            points: rows
                .iter()
                .map(|(_, area, errors)| [*area, errors[scene]])
                .collect(),
            mark: Mark::Line,
            colour,
        };
        Panel {
            title: (*name).into(),
            x: Axis::linear("kGE"),
            y: Axis::linear("dB"),
            series: vec![line("fixed", &fixed, 0), line("float", &floats, 1)],
            ..Panel::default()
        }
    });
    let panels: Vec<Panel> = panels.collect();
    let charts: Vec<&dyn Chart> = panels.iter().map(|panel| panel as &dyn Chart).collect();
    write_png(&charts, 3, [360, 300], &folder.join("floats.png"))
}

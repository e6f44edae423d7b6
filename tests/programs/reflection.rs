//! Compares mirrors of the book's spheres by the size of their map, by the direction of look-up and
//! by their words.
//!
//! ```sh
//! cargo run --release --example reflection -- [FOLDER [DATA]]
//! ```
//! Prints four tables, and writes `reflection.png`: ideal, the machine along rays and along the
//! axis, and the machine with a map of 8 × 8. With the folder of scans it also draws
//! `reflection-scan.png`: the dragon as chrome and as porcelain under the sky.

use rtl_model::Machine;
use rtl_model::machine::Sight;
use rtl_model::timing::{self, Detail, Requester};
use serde_json::json;
use splatsim::accuracy::metrics;
use splatsim::error::{Error, Result};
use splatsim::golden::{Rules, ideal, render};
use splatsim::hardware::{fixed, machines, quantise};
use splatsim::output::picture::Picture;
use splatsim::performance::cost::{Cost, Prices};
use splatsim::scene::{Overrides, Scene};
use std::path::{Path, PathBuf};

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/book/reflection");

fn machine(settings: &[String]) -> Result<Machine> {
    machines::load(format!("{FOLDER}/mirror.json"), settings)
}

fn drawn(scene: &Scene, machine: &Machine) -> Result<Picture> {
    let elaborated = fixed::elaborate(machine)?;
    Ok(fixed::picture(
        &elaborated,
        &fixed::draw(&elaborated, &quantise::quantise(scene, machine)?),
    ))
}

fn golden(scene: &Scene, machine: &Machine) -> Picture {
    render(scene, &fixed::rules(machine)).picture
}

/// Decibels at covered pixels.
fn db(a: &Picture, b: &Picture) -> String {
    metrics(a, b)
        .psnr_covered_db
        .map_or("equal".into(), |db| format!("{db:.1}"))
}

/// Area of the unit, and cycles through shade.
fn cost(machine: &Machine) -> Result<(f64, u32)> {
    let elaborated = fixed::elaborate(machine)?;
    let cost = Cost::new(&elaborated, &Prices::default());
    let area = cost
        .units
        .iter()
        .find(|unit| unit.name == "reflect")
        .map_or(0.0, |unit| unit.area);
    Ok((area, elaborated.timing.shade.latency))
}

/// Costs of a map in memory and of a map on the chip: the area of the whole machine, cycles per
/// frame, bytes read of the map, and the hit rate of look-ups.
fn in_memory(scene: &Scene) -> Result<()> {
    println!(
        "\n| texels | lines of `timing.environment` | area | cycles | map, KB | hits |\n|---|---|---|---|---|---|"
    );
    for (bits, lines) in [6, 8]
        .into_iter()
        .flat_map(|bits| [None, Some(8), Some(32), Some(128)].map(|lines| (bits, lines)))
    {
        let cache = lines.map(|lines| format!("timing.environment={{\"lines\":{lines}}}"));
        let machine = machine(
            &std::iter::once(format!("reflect.index_bits={bits}"))
                .chain(cache)
                .collect::<Vec<_>>(),
        )?;
        let elaborated = fixed::elaborate(&machine)?;
        let (_, _, work) = fixed::draw_measured(&elaborated, &quantise::quantise(scene, &machine)?);
        let cycles = timing::replay(&elaborated.timing, &work, Detail::Accounts);
        let [read, _] = cycles.memory.bytes[Requester::Environment as usize];
        let [lookups, hits] = cycles.texels;
        println!(
            "| {0} × {0} | {1} | {2:.0} | {3} | {4:.1} | {5} |",
            1 << bits,
            lines.map_or("on the chip".into(), |lines: u32| lines.to_string()),
            Cost::new(&elaborated, &Prices::default()).area,
            cycles.total,
            read as f64 / 1e3,
            if lookups == 0 {
                "–".into()
            } else {
                format!("{:.1} %", 100.0 * hits as f64 / lookups as f64)
            }
        );
    }
    Ok(())
}

/// A scan under the sky, as chrome and as porcelain.
fn scan(data: &Path) -> Result<Picture> {
    let of = |reflect: f64, diffuse: f64| {
        let file = std::path::absolute(data.join("scans/dragon_stand_merged_normals_be.ply"))
            .unwrap_or_default();
        let scene = json!({
            "splats": {"file": file},
            "camera": {"eye": [0.061, 0.172, 0.26], "target": [-0.019, 0.112, -0.01], "up": [0, 1, 0], "fov_y_degrees": 40, "near": 0.01},
            "image": {"width": 256, "height": 256, "background": [1, 1, 1, 1]},
            "surface": {"z_threshold": 0.0016},
            "lights": [{"direction": [0.4, 0.8, 0.5]}],
            "materials": [{"ambient": 0.15, "diffuse": diffuse, "reflect": reflect}],
            "environment": {"builtin": "sky"}
        });
        drawn(
            &Scene::from_text(
                &scene.to_string(),
                "dragon",
                Path::new("."),
                &Overrides::default(),
                0,
            )?,
            &machine(&[])?,
        )
    };
    Ok(beside(&[of(1.0, 0.0)?, of(0.25, 0.8)?]))
}

/// Pictures next to each other.
fn beside(pictures: &[Picture]) -> Picture {
    let (height, width) = (
        pictures[0].height,
        pictures.iter().map(|picture| picture.width).sum(),
    );
    let rows = |row: usize| {
        pictures.iter().flat_map(move |picture| {
            (row * picture.width..(row + 1) * picture.width).map(move |at| (picture, at))
        })
    };
    let all = || (0..height).flat_map(rows);
    Picture {
        width,
        height,
        rgba: all().map(|(of, at)| of.rgba[at]).collect(),
        covered: all().map(|(of, at)| of.covered[at]).collect(),
    }
}

fn run(folder: Option<PathBuf>, data: Option<PathBuf>) -> Result<()> {
    let scene = Scene::load(format!("{FOLDER}/spheres.json"), &Overrides::default())?;
    let ideal = ideal(&scene).picture;
    // The same rules for fragments, and an exact environment: the remaining error is that of the
    // map.
    let as_they_are = render(
        &scene,
        &Rules {
            reflection: None,
            ..fixed::rules(&machine(&[])?)
        },
    )
    .picture;
    println!(
        "| `reflect.index_bits` | texels | Kbit | golden − golden without a map, dB | area |\n|---|---|---|---|---|"
    );
    for bits in 2..=8u32 {
        let machine = machine(&[format!("reflect.index_bits={bits}")])?;
        let (texels, light) = (1u32 << (2 * bits), 33.0);
        let kbit = f64::from(texels) * light / 1024.0;
        println!(
            "| {bits} | {0} × {0} | {kbit:.1} | {1} | {2:.0} |",
            1 << bits,
            db(&golden(&scene, &machine), &as_they_are),
            cost(&machine)?.0
        );
    }
    println!(
        "\n| `reflect.sight` | golden − golden without a map, dB | fixed − golden, dB | fixed − ideal, dB | area | shade, cycles |\n|---|---|---|---|---|---|"
    );
    let mut pictures = vec![ideal.clone()];
    for (name, sight) in [("ray", Sight::Ray), ("axis", Sight::Axis)] {
        let machine = machine(&[format!("reflect.sight={name}")])?;
        let (golden, fixed, (area, cycles)) = (
            golden(&scene, &machine),
            drawn(&scene, &machine)?,
            cost(&machine)?,
        );
        assert_eq!(machine.reflect.map(|reflect| reflect.sight), Some(sight));
        println!(
            "| `{name}` | {} | {} | {} | {area:.0} | {cycles} |",
            db(&golden, &as_they_are),
            db(&fixed, &golden),
            db(&fixed, &ideal)
        );
        pictures.push(fixed);
    }
    println!("\n| words | fixed − golden, dB | area |\n|---|---|---|");
    let narrower = [
        ("as in the file", vec![]),
        ("`light` U1F8", vec!["reflect.light=U1F8"]),
        ("`light` U1F5", vec!["reflect.light=U1F5"]),
        ("`coordinate` U1F9", vec!["reflect.coordinate=U1F9"]),
        ("`coordinate` U1F6", vec!["reflect.coordinate=U1F6"]),
        ("`fraction` U1F4", vec!["reflect.fraction=U1F4"]),
        ("`fraction` U1F1", vec!["reflect.fraction=U1F1"]),
        ("`direction` I3F9", vec!["reflect.direction=I3F9"]),
        ("`direction` I3F6", vec!["reflect.direction=I3F6"]),
        ("`facing` I2F8", vec!["reflect.facing=I2F8"]),
        ("`slope` I2F8", vec!["reflect.slope=I2F8"]),
        (
            "`reciprocal` without a step, 10 bits",
            vec![r#"reflect.reciprocal={"table_bits":8,"newton_steps":0,"bits":10}"#],
        ),
        ("`reflectance` U1F6", vec!["reflect.reflectance=U1F6"]),
    ];
    for (name, settings) in narrower {
        let machine = machine(&settings.into_iter().map(str::to_owned).collect::<Vec<_>>())?;
        println!(
            "| {name} | {} | {:.0} |",
            db(&drawn(&scene, &machine)?, &golden(&scene, &machine)),
            cost(&machine)?.0
        );
    }
    in_memory(&scene)?;
    let Some(folder) = folder else { return Ok(()) };
    pictures.push(drawn(
        &scene,
        &machine(&["reflect.index_bits=3".to_owned()])?,
    )?);
    std::fs::create_dir_all(&folder)
        .map_err(|e| Error::input(format!("{}: {e}", folder.display())))?;
    if let Some(data) = data {
        scan(&data)?.write_png(&folder.join("reflection-scan.png"))?;
    }
    beside(&pictures).write_png(&folder.join("reflection.png"))
}

fn main() -> std::process::ExitCode {
    let [folder, data] = [1, 2].map(|nth| std::env::args().nth(nth).map(PathBuf::from));
    match run(folder, data) {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            std::process::ExitCode::from(2)
        }
    }
}

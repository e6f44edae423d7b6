//! Prints the costs and benefits of sorting Gaussians: the machine that sorts, and machines that
//! draw them in input order, with and without windows. This is the table *Gaussians without a sort*
//! of docs/book/merging-experiments.md.
//!
//! ```sh
//! cargo run --release --example unsorted -- [SCENE]...
//! ```
//! The default scene is the bouquet. With windows each Gaussian is a separate surface. A fragment's
//! opacity is (Σw·α/W)·min(1, W/τ). With τ = 1, a Gaussian with weight √o·G and opacity √o
//! therefore covers o·G, as required. Weights less than 1/255 count there too. Gaussians within ε
//! are one surface; ε is a hundredth of the depth range of their middle half. A third of it and
//! three times it are no better.

use rtl_model::Machine;
use rtl_model::machine::{Group, Merge};
use rtl_model::timing::{self, Detail};
use rtl_model::units::fragment::MAX_LAYERS;
use rtl_model::units::fragment::window::overflow_cycles;
use splatsim::accuracy::distance;
use splatsim::error::Result;
use splatsim::golden::{self, Rules, WindowOptions, ideal, render};
use splatsim::hardware::machines;
use splatsim::output::picture::Picture;
use splatsim::output::text::thousands;
use splatsim::performance::cost::{Cost, Prices};
use splatsim::run::evaluation::Evaluation;
use splatsim::scene::{Overrides, Scene};

/// Layers per pixel, and the distance within which a contribution joins a cluster, in permille of
/// ε.
const WINDOWS: [(usize, u32); 5] = [(4, 0), (4, 500), (8, 0), (8, 500), (16, 0)];
/// ε as a fraction of the depth range of the middle half.
const PART: f64 = 0.01;

/// Gaussians in input order, each a separate surface.
fn surfaces(scene: &Scene) -> Scene {
    let mut scene = as_they_come(scene);
    scene.sheets = None;
    scene
        .splats
        .iter_mut()
        .for_each(|splat| splat.opacity = splat.opacity.sqrt());
    (scene.surface.z_threshold, scene.surface.coverage_threshold) =
        (PART * middle_half(&scene), 1.0);
    scene
}

/// Gaussians in input order, each blended behind those before it.
fn as_they_come(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    scene
        .ellipsoids
        .iter_mut()
        .for_each(|ellipsoids| ellipsoids.sorted = false);
    scene
}

/// Depth range from the first to the third quartile of the splats in front of the eye.
fn middle_half(scene: &Scene) -> f64 {
    let view = scene.view();
    let mut depths: Vec<f64> = scene
        .splats
        .iter()
        .map(|splat| (view.rotation * (splat.position - view.eye)).z)
        .collect();
    depths.retain(|z| *z > scene.camera.near);
    depths.sort_by(f64::total_cmp);
    let at = |quarter: usize| {
        depths
            .get(quarter * depths.len() / 4)
            .copied()
            .unwrap_or(1.0)
    };
    at(3) - at(1)
}

fn db(picture: &Picture, ideal: &Picture) -> String {
    distance(picture, ideal)
        .psnr_db
        .map_or("equal".into(), |db| format!("{db:.1}"))
}

/// Picture and costs of a machine for a scene.
fn row(scene: &Scene, machine: &Machine, ideal: &Picture) -> Result<String> {
    let evaluation = Evaluation::new(scene, machine)?;
    let observed = evaluation.observe();
    let cycles = timing::replay(&evaluation.machine.timing, &observed.work, Detail::Accounts);
    Ok([
        db(&evaluation.golden().picture, ideal),
        db(&observed.picture, ideal),
        format!("{:.2}", cycles.total as f64 / 1e6),
        format!("{:.1}", cycles.memory.total_bytes() as f64 / 1e6),
        thousands(Cost::new(&evaluation.machine, &Prices::default()).area as u64),
    ]
    .join(" | "))
}

/// The machine for Gaussians with the fragments of `window`.
fn with_windows(gaussian: &Machine, layers: usize, join_permille: u32) -> Result<Machine> {
    let mut machine = Machine {
        sort: None,
        fragment: machines::load("window", &[])?.fragment,
        ..gaussian.clone()
    };
    (
        machine.fragment.group,
        machine.fragment.merge,
        machine.fragment.layers,
    ) = (Group::Window, Merge::Window, layers as u32);
    machine
        .fragment
        .window
        .iter_mut()
        .for_each(|window| window.join_permille = join_permille);
    machine.timing.fragment.merge = machine.timing.fragment.merge.max(overflow_cycles(&machine));
    Ok(machine)
}

fn main() -> Result<()> {
    let mut paths: Vec<String> = std::env::args().skip(1).collect();
    if paths.is_empty() {
        paths.push("bouquet".into());
    }
    println!(
        "| scene | order | golden − ideal, dB | fixed − ideal, dB | Mcycles | MB | LUT equivalents |"
    );
    println!("|---|---|---|---|---|---|---|");
    let gaussian = machines::load("gaussian", &[])?;
    for path in paths {
        let scene = Scene::load(&path, &Overrides::default())?;
        let ideal = ideal(&scene).picture;
        println!(
            "| {} | sorted | {} |",
            scene.name,
            row(&scene, &gaussian, &ideal)?
        );
        let unsorted = Machine {
            sort: None,
            ..gaussian.clone()
        };
        println!(
            "| | as they come, blended | {} |",
            row(&as_they_come(&scene), &unsorted, &ideal)?
        );
        let surfaces = surfaces(&scene);
        for (layers, join_permille) in WINDOWS {
            let join = f64::from(join_permille) / 1000.0;
            let figures = if layers <= MAX_LAYERS {
                row(
                    &surfaces,
                    &with_windows(&gaussian, layers, join_permille)?,
                    &ideal,
                )?
            } else {
                // More than a machine may have.
                let window = WindowOptions {
                    join,
                    ..WindowOptions::default()
                };
                let rules = Rules {
                    layers,
                    group: golden::Group::Window,
                    merge: golden::Merge::Window,
                    window,
                    ..Rules::default()
                };
                format!(
                    "{} | – | – | – | –",
                    db(&render(&surfaces, &rules).picture, &ideal)
                )
            };
            let join = if join_permille > 0 {
                format!(", join {join}")
            } else {
                String::new()
            };
            println!("| | windows, l = {layers}{join} | {figures} |");
        }
    }
    Ok(())
}

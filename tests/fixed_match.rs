//! Does `fixed` draw what `golden` draws? The named machines on the built-in scenes and on real
//! scans, 512×512.

use crate::{shared_input, tier};
use rtl_model::Machine;
use splatsim::accuracy::{Metrics, metrics};
use splatsim::golden;
use splatsim::hardware::{fixed, quantise};
use splatsim::scene::{Overrides, Scene};

/// The required accuracy of a machine on a scene.
struct Target {
    machine: &'static str,
    psnr_db: f64,
    /// Share of pixels that may differ by more than 1/255.
    pixels_over: f64,
    /// Whether no signal may saturate.
    holds_all: bool,
}

const TARGETS: [Target; 2] = [
    Target {
        machine: "reference",
        psnr_db: 60.0,
        pixels_over: 0.01,
        holds_all: true,
    },
    Target {
        machine: "lean",
        psnr_db: 45.0,
        pixels_over: 1.0,
        holds_all: false,
    },
];

/// Signals that may saturate: the slope of a grazing plane is unlimited, and there the depth clamp
/// decides (docs/book/algorithm.md §3).
const CLAMPS: [&str; 1] = ["ellipse.depth_slope"];

/// Every target that a machine misses on a scene, one sentence each.
fn missed(target: &Target, measured: &Metrics, pixels: usize, saturated: &[String]) -> Vec<String> {
    let mut missed = Vec::new();
    for (name, db) in [
        ("psnr_db", measured.psnr_db),
        ("psnr_covered_db", measured.psnr_covered_db),
    ] {
        if db.is_some_and(|db| db.is_nan() || db < target.psnr_db) {
            missed.push(format!("{name} {db:?} is below {}", target.psnr_db));
        }
    }
    if measured.pixels_over_1_255 as f64 > target.pixels_over * pixels as f64 {
        missed.push(format!(
            "{} pixels are off by more than 1/255",
            measured.pixels_over_1_255
        ));
    }
    if target.holds_all {
        missed.extend(
            saturated
                .iter()
                .filter(|name| !CLAMPS.contains(&name.as_str()))
                .map(|name| format!("{name} saturates")),
        );
    }
    missed
}

/// Draws a scene on every machine, prints a row for each, and fails if one misses its target.
fn machines_meet_their_targets(name_or_path: &str) {
    let scene = Scene::load(
        name_or_path,
        &Overrides {
            size: Some((512, 512)),
        },
    )
    .unwrap();
    let mut sentences = Vec::new();
    for target in &TARGETS {
        let machine = Machine::named(target.machine).unwrap();
        let elaborated = fixed::elaborate(&machine).unwrap();
        let quantised = quantise::quantise(&scene, &machine).unwrap();
        let (drawing, ranges, _) = fixed::draw_measured(&elaborated, &quantised);
        let golden = golden::render(&scene, &fixed::rules(&machine));
        assert!(
            golden.fragments > 100_000,
            "{name_or_path}: {} fragments prove little",
            golden.fragments
        );
        let measured = metrics(&fixed::picture(&elaborated, &drawing), &golden.picture);
        let saturated: Vec<String> = (elaborated.signals.iter().zip(&ranges.0))
            .filter(|(_, range)| range.saturated_low + range.saturated_high > 0)
            .map(|(signal, _)| format!("{}.{}", signal.unit, signal.name))
            .collect();
        println!(
            "{} {}: {:.2} dB, {:.2} covered, {} pixels over 1/255, most {:.4}; saturated: {saturated:?}",
            scene.name,
            target.machine,
            measured.psnr_db.unwrap_or(f64::INFINITY),
            measured.psnr_covered_db.unwrap_or(f64::INFINITY),
            measured.pixels_over_1_255,
            measured.max_error,
        );
        let missed = missed(target, &measured, 512 * 512, &saturated);
        sentences.extend(
            missed
                .into_iter()
                .map(|sentence| format!("{} {}: {sentence}", scene.name, target.machine)),
        );
    }
    assert!(sentences.is_empty(), "{}", sentences.join("\n"));
}

fn machines_meet_their_targets_on_data(name: &str) {
    if let Some(path) = shared_input::find(name) {
        machines_meet_their_targets(path.to_str().unwrap());
    }
}

#[test]
fn glass_spheres() {
    machines_meet_their_targets("glass-spheres");
}

#[test]
fn checkerboard() {
    if !tier::has([3, 1], 0) {
        return;
    }
    machines_meet_their_targets("checkerboard");
}

#[test]
fn torus_knot() {
    if !tier::has([3, 1], 1) {
        return;
    }
    machines_meet_their_targets("torus-knot");
}

#[test]
fn terrain() {
    if !tier::has([3, 1], 2) {
        return;
    }
    machines_meet_their_targets("terrain");
}

#[test]
fn dragon() {
    if !tier::has([3, 1], 3) {
        return;
    }
    machines_meet_their_targets_on_data("scenes/dragon.json");
}

#[test]
fn bunny() {
    if !tier::has([3, 1], 4) {
        return;
    }
    machines_meet_their_targets_on_data("scans/bun_zipper.ply");
}

#[test]
fn pond() {
    if !tier::has([3, 1], 5) {
        return;
    }
    machines_meet_their_targets_on_data("scans/pond.0.ply");
}

#[test]
fn igea() {
    if !tier::has([3, 1], 6) {
        return;
    }
    machines_meet_their_targets_on_data("scans/igea.ply");
}

#[test]
fn a_missed_target_is_noticed() {
    let good = Metrics {
        psnr_db: Some(61.0),
        psnr_covered_db: Some(60.0),
        ssim: 1.0,
        max_error: 0.0,
        mean_error: 0.0,
        pixels_over_1_255: 10,
        not_finite: 0,
    };
    let told = |measured: &Metrics, saturated: &[&str]| {
        let saturated: Vec<String> = saturated.iter().map(|name| name.to_string()).collect();
        missed(&TARGETS[0], measured, 1000, &saturated).len()
    };
    assert_eq!(told(&good, &["ellipse.depth_slope"]), 0);
    assert_eq!(
        told(
            &Metrics {
                psnr_db: None,
                psnr_covered_db: None,
                ..good
            },
            &[]
        ),
        0
    );
    assert_eq!(
        told(
            &Metrics {
                psnr_db: Some(59.9),
                ..good
            },
            &[]
        ),
        1
    );
    assert_eq!(
        told(
            &Metrics {
                psnr_covered_db: Some(f64::NAN),
                ..good
            },
            &[]
        ),
        1
    );
    assert_eq!(
        told(
            &Metrics {
                pixels_over_1_255: 11,
                ..good
            },
            &[]
        ),
        1
    );
    assert_eq!(told(&good, &["fragment.weight_sum"]), 1);
}

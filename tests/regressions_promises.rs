//! Regressions of documented properties: bounds, numbers, stimuli, and limits of a frame.

use crate::handmade::{self, confetti, scene, splat};
use crate::mutation::{differences, mutated, mutations, named, with_format};
use crate::tier;
use glam::{DQuat, DVec3};
use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::TestRunner;
use rayon::prelude::*;
use rtl_model::Machine;
use rtl_model::num::Format;
use serde_json::json;
use splatsim::accuracy::attribution::attribute;
use splatsim::accuracy::{Lockstep, lockstep};
use splatsim::cosim::trace::{Origin, Window, trace};
use splatsim::explore::search;
use splatsim::golden::{Rules, ideal, render};
use splatsim::hardware::quantise::quantise;
use splatsim::hardware::{fixed, machines};
use splatsim::performance::cost::Prices;
use splatsim::scene::{
    Amplitude, Ellipsoids, Opacity, Orientation, Overrides, Scene, Sheet, Sheets,
};
use std::panic::{AssertUnwindSafe, catch_unwind};

// ---- bounds ----

/// One opaque disc that fills the picture.
fn disc() -> Scene {
    scene(24, 16, 20.0, vec![splat([0.0, 0.0, 1.0], 0.2)])
}

fn in_lockstep(scene: &Scene, machine: &Machine) -> Option<Lockstep> {
    let elaborated = machine.elaborate().ok()?;
    Some(lockstep(
        scene,
        &elaborated,
        &quantise(scene, machine).ok()?,
    ))
}

fn fault(frame: &Lockstep) -> Option<String> {
    let wrong = frame.violations > 0 || frame.flips.unexplained > 0;
    wrong.then(|| {
        format!(
            "{} pixels exceed their bound; {:?}",
            frame.violations, frame.flips
        )
    })
}

#[test]
fn a_sum_that_one_contribution_overflows_keeps_its_bound() {
    for name in ["reference", "lean", "tiny", "volume", "gaussian"] {
        for setting in [
            "fragment.opacity_sum=U-4F12",
            "fragment.colour_sum=U-6F20",
            "fragment.normal_sum=I-5F14",
            "fragment.weight_sum=U-3F12",
        ] {
            let machine = machines::load(name, &[setting.to_owned()]).unwrap();
            let Some(frame) = in_lockstep(&disc(), &machine) else {
                // Some machines cannot have such a word: `volume` and `gaussian` shade splats of
                // weight 1.
                assert!(machine.elaborate().is_err() || quantise(&disc(), &machine).is_err());
                continue;
            };
            assert_eq!(fault(&frame), None, "{name} {setting}");
        }
        let machine = machines::load(name, &["fragment.colour_sum=U-6F20".to_owned()]).unwrap();
        assert!(
            in_lockstep(&disc(), &machine)
                .is_some_and(|frame| frame.error.iter().any(|error| *error > 0.1)),
            "{name}: nothing saturates"
        );
    }
}

/// Scenes in which a bound has little information: one splat, none, all at one depth, a few.
fn bare() -> Vec<Scene> {
    let one_depth = |mut scene: Scene| {
        scene.splats.iter_mut().for_each(|splat| {
            splat.position *= 1.5 / splat.position.z;
            splat.normal = DVec3::NEG_Z;
        });
        scene
    };
    vec![
        disc(),
        confetti(0, 1),
        one_depth(confetti(30, 2)),
        confetti(30, 3),
    ]
}

/// A word of a machine with 1 to 3 bits, or a sum that holds less than one weight.
fn narrowed(machine: &Machine, rng: &mut handmade::Rng) -> Machine {
    let mut roll = |below: usize| (rng.roll() * below as f64) as usize;
    let sums = ["weight_sum", "colour_sum", "opacity_sum", "normal_sum"];
    let mut machine = machine.clone();
    for _ in 0..=roll(3) {
        let (word, format) = if roll(2) == 0 {
            let sum = sums[roll(4)];
            // No sum is larger than a fraction of one weight.
            let bits = 1 + roll(12) as i32;
            let frac_bits = bits + roll(8) as i32;
            let int_bits = bits - frac_bits;
            let signed = sum == "normal_sum";
            (
                format!("fragment.{sum}"),
                Format::fixed_point(signed, int_bits + i32::from(signed), frac_bits),
            )
        } else {
            let words = machines::words(&machine);
            let (word, format) = &words[roll(words.len())];
            (word.clone(), narrow(format.signed)[roll(9)])
        };
        machine = with_format(&machine, &word, format);
    }
    machine
}

/// All formats of 1 to 3 bits, from no integer bits to only integer bits.
fn narrow(signed: bool) -> Vec<Format> {
    (1..=3)
        .flat_map(|width| {
            (0..=width)
                .map(move |frac_bits| Format::fixed_point(signed, width - frac_bits, frac_bits))
        })
        .collect()
}

#[test]
fn no_pixel_of_a_machine_with_hardly_a_bit_exceeds_its_bound() {
    const MACHINES: usize = 400;
    let (scenes, mut runner, mut rng) = (bare(), TestRunner::deterministic(), handmade::Rng(7));
    let (mut drawn, mut asked, mut saturated) = (0, 0, 0);
    while drawn < MACHINES {
        asked += 1;
        assert!(
            asked < 100 * MACHINES,
            "only {drawn} of {asked} machines can draw"
        );
        let (name, changes) = (named(), mutations(0..3))
            .new_tree(&mut runner)
            .unwrap()
            .current();
        let machine = changes
            .iter()
            .fold(Machine::named(name).unwrap(), |machine, mutation| {
                mutated(&machine, mutation)
            });
        let machine = narrowed(&machine, &mut rng);
        let Some(frame) = in_lockstep(&scenes[asked % scenes.len()], &machine) else {
            continue;
        };
        assert_eq!(
            fault(&frame),
            None,
            "{} {:?} on scene {}",
            machine.name,
            differences(&machine),
            asked % scenes.len()
        );
        drawn += 1;
        saturated += usize::from(frame.error.iter().any(|error| *error > 0.2));
    }
    assert!(
        saturated > MACHINES / 8,
        "only {saturated} of {MACHINES} were far off"
    );
}

// ---- NaN ----

fn refused(scene: &serde_json::Value, sentence: &str) {
    let folder = tempfile::tempdir().unwrap();
    let ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nproperty float radius\nend_header\n0 0 0 1e-35\n";
    std::fs::write(folder.path().join("thin.ply"), ply).unwrap();
    std::fs::write(folder.path().join("samples.raw"), [9u8; 8]).unwrap();
    let path = folder.path().join("scene.json");
    std::fs::write(&path, scene.to_string()).unwrap();
    let told = Scene::load(path.to_str().unwrap(), &Overrides::default())
        .unwrap_err()
        .to_string();
    assert!(told.contains(sentence), "{told}");
}

#[test]
fn radii_whose_squares_vanish_are_refused_with_their_place() {
    refused(
        &json!({"splats": [{"position": [0, 0, 0], "radius": 1e-300}]}),
        "splats[0].radius is 1e-300; it must be at least 1e-30",
    );
    let volume = |radius: f64| json!({"splats": {"volume": {"builtin": "marschner-lobb", "samples": 8}, "radius": radius}});
    refused(
        &volume(1e-300),
        "splats.radius is 1e-300; it must be at least 1e-6",
    );
    refused(
        &volume(1e-7),
        "splats.radius is 1e-7; it must be at least 1e-6",
    );
    let raw = |spacing: f64| json!({"file": "samples.raw", "size": [2, 2, 2], "type": "u8", "spacing": [spacing, spacing, spacing]});
    refused(
        &json!({"splats": {"volume": raw(1e-29), "radius": 0.05}}),
        "splats has kernels of 5e-2 steps, ",
    );
    refused(
        &json!({"splats": {"file": "thin.ply"}}),
        "vertex 0 of 1 has the radius 0.000",
    );
}

/// Ellipsoids, volumes and Gaussians with extreme values of a scene file.
fn odd_ellipsoids() -> Vec<(String, Scene)> {
    let mut scenes = Vec::new();
    let lengths = [1e-30, 1e-12, 1.0, 1e12, 1e30];
    for (radius, depth) in lengths
        .into_iter()
        .flat_map(|radius| lengths.map(|depth| (radius, depth)))
    {
        for (amplitude, thin, low_pass) in [
            (Amplitude::Peak, 1e-60, 0.0),
            (Amplitude::Peak, 1e-60, 0.3),
            (Amplitude::LineIntegral, 1.0, 0.0),
            (Amplitude::LineIntegral, 1e-30, 1.0),
            (Amplitude::Disc, 1e-6, 0.0),
        ] {
            let mut odd = scene(5, 3, 40.0, Vec::new());
            odd.camera.near = 1e-300;
            odd.kernel.low_pass = low_pass;
            let orientation = |nth: usize| Orientation {
                rotation: DQuat::from_xyzw(0.1 * nth as f64, 0.3, -0.2, 0.4).normalize(),
                scales: [
                    DVec3::new(1.0, 1.0, thin),
                    DVec3::new(thin, thin, 1.0),
                    DVec3::ONE,
                ][nth % 3],
            };
            // Exactly in the centre of a pixel, and next to it.
            for x in [0.0, 0.3 * depth] {
                odd.splats
                    .extend((0..3).map(|_| splat([x, 0.0, depth], radius)));
            }
            // The maximum density of a volume's voxels.
            odd.splats.iter_mut().for_each(|splat| {
                splat.opacity = if amplitude == Amplitude::LineIntegral {
                    1.6e11
                } else {
                    1.0
                }
            });
            let orientations = (0..odd.splats.len()).map(orientation).collect();
            odd.ellipsoids = Some(Ellipsoids {
                orientations,
                amplitude,
                preshaded: false,
                sorted: amplitude == Amplitude::Peak,
                harmonics: None,
            });
            let peak = amplitude == Amplitude::Peak;
            odd.sheets = (amplitude != Amplitude::Disc).then(|| Sheets {
                of: if peak {
                    Sheet::Splat
                } else {
                    Sheet::Slice((0..odd.splats.len() as u32).collect())
                },
                back_to_front: false,
                opacity: if peak {
                    Opacity::Linear
                } else {
                    Opacity::Exponential
                },
                stop: 1e-4,
                keeps_last: false,
                least_weight: 0.0,
                most_weight: 0.99,
                weight_distance: None,
            });
            scenes.push((
                format!(
                    "{amplitude:?}, σ {radius}, {thin} thin, {depth} away, low-pass {low_pass}"
                ),
                odd,
            ));
        }
    }
    scenes
}

#[test]
fn golden_makes_numbers_of_every_legal_scene() {
    for (name, odd) in odd_ellipsoids() {
        for rendering in [render(&odd, &Rules::default()), ideal(&odd)] {
            let all = rendering.picture.rgba.as_flattened();
            assert!(
                all.iter().all(|value| value.is_finite() && *value >= 0.0),
                "{name}: {all:?}"
            );
        }
    }
}

#[test]
fn nan_is_equal_to_nothing_in_an_attribution() {
    let (scene, machine) = (confetti(20, 4), Machine::named("tiny").unwrap());
    let (elaborated, quantised) = (
        fixed::elaborate(&machine).unwrap(),
        quantise(&scene, &machine).unwrap(),
    );
    let mut golden = render(&scene, &fixed::rules(&machine)).picture;
    for wrong in [f64::NAN, f64::INFINITY] {
        golden.rgba[30][0] = wrong;
        let found = attribute(&scene, &elaborated, &quantised, &golden);
        let shares = || {
            found
                .units
                .iter()
                .chain(&found.words)
                .flat_map(|share| [share.alone, share.without])
        };
        assert!(shares().all(|distance| distance.not_finite == 1 && distance.psnr_db == Some(0.0)));
        let told = found.summary();
        assert!(told.contains("NaN") && !told.contains("equal"), "{told}");
    }
}

#[test]
fn a_search_meets_no_target_with_nan() {
    let mut scene = confetti(20, 4);
    let machine = Machine::named("reference").unwrap();
    let asked = |target| search::SearchOptions {
        target,
        views: 1,
        robust: 1,
        seed: 0,
        tries: 1,
        only: vec!["gauss.weight".into()],
        prices: Prices::default(),
        screen: true,
        budget: None,
        progress: false,
    };
    let run = |scene: &Scene, target| {
        let folder = tempfile::tempdir().unwrap();
        search::run(
            std::slice::from_ref(scene),
            &machine,
            folder.path(),
            &asked(target),
        )
        .map_err(|error| error.to_string())
    };
    let targets = [
        search::Target {
            psnr_db: Some(1e-3),
            ..search::Target::default()
        },
        search::Target {
            max_error: Some(1.0),
            ..search::Target::default()
        },
    ];
    for target in targets {
        run(&scene, target).unwrap();
    }
    scene.background_is_no_number();
    for target in targets {
        let told = run(&scene, target).unwrap_err();
        assert!(
            told.contains("meet no target") && !told.contains("equal"),
            "{told}"
        );
    }
}

trait Spoilt {
    fn background_is_no_number(&mut self);
}

impl Spoilt for Scene {
    /// A value that no file can contain.
    fn background_is_no_number(&mut self) {
        self.splats[3].rgb[1] = f64::NAN;
    }
}

#[test]
fn a_report_marks_nan() {
    let mut scene = confetti(20, 4);
    scene.splats[3].rgb[1] = f64::NAN;
    let outcome = splatsim::run::run(
        &scene,
        &Machine::named("reference").unwrap(),
        0.0,
        &splatsim::run::Options::default(),
    )
    .unwrap();
    let report = serde_json::to_value(&outcome.report).unwrap();
    let lockstep = &report["accuracy"]["lockstep"];
    assert!(
        lockstep["bound_violations"].as_u64() >= lockstep["not_finite"].as_u64()
            && lockstep["not_finite"].as_u64() > Some(0),
        "{lockstep}"
    );
    for pair in ["fixed_vs_golden", "golden_vs_ideal", "fixed_vs_ideal"] {
        let pair = &report["accuracy"][pair];
        assert!(
            pair["psnr_db"] == 0.0
                && pair["max_error"] == 1.0
                && pair["not_finite"].as_u64() > Some(0),
            "{pair}"
        );
    }
    let told = outcome.report.summary();
    assert!(told.contains("NaN") && !told.contains("equal"), "{told}");
}

// ---- made-up cases ----

fn made_up(name: &str, scene: &Scene, word: &str, format: Format) -> Result<bool, String> {
    let machine = with_format(&Machine::named(name).unwrap(), word, format);
    let folder = tempfile::tempdir().unwrap();
    let window = Window {
        stimulus: Some(0),
        ..Window::default()
    };
    let made = catch_unwind(AssertUnwindSafe(|| {
        trace(scene, Origin::default(), &machine, &window, folder.path())
    }));
    match made {
        Ok(Ok(_)) => Ok(true),
        // A sentence.
        Ok(Err(_)) => Ok(false),
        Err(_) => Err(format!("{name} {word}={format} panics")),
    }
}

/// Scenes for machines with different units: discs, voxels, Gaussians.
fn few_of_each() -> [(&'static str, Scene); 3] {
    let mut gaussians = Scene::load(
        "bouquet",
        &Overrides {
            size: Some((24, 24)),
        },
    )
    .unwrap();
    gaussians.splats.truncate(40);
    gaussians
        .ellipsoids
        .as_mut()
        .unwrap()
        .orientations
        .truncate(40);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    let fields = json!({"splats": {"volume": {"builtin": "marschner-lobb", "samples": 4}}, "image": {"width": 24, "height": 24}});
    std::fs::write(&path, fields.to_string()).unwrap();
    let volume = Scene::load(path.to_str().unwrap(), &Overrides::default()).unwrap();
    [
        ("tiny", disc()),
        ("volume", volume),
        ("gaussian", gaussians),
    ]
}

/// Each word of three machines in turn, with some of the formats of 1 to 3 bits; returns the number
/// of machines.
fn made_up_word_by_word(chosen: impl Fn(&str, &str, usize) -> bool) -> usize {
    let scenes = few_of_each();
    let mut all = Vec::new();
    for (name, scene) in &scenes {
        for (nth, (word, format)) in machines::words(&Machine::named(name).unwrap())
            .into_iter()
            .enumerate()
        {
            let formats = narrow(format.signed)
                .into_iter()
                .enumerate()
                .filter(|(which, _)| chosen(name, &word, which + nth));
            all.extend(formats.map(|(_, format)| (*name, scene, word.clone(), format)));
        }
    }
    let made: Vec<Result<bool, String>> = all
        .into_par_iter()
        .map(|(name, scene, word, format)| made_up(name, scene, &word, format))
        .collect();
    let panics: Vec<&String> = made.iter().filter_map(|made| made.as_ref().err()).collect();
    assert!(panics.is_empty(), "{panics:#?}");
    made.iter().filter(|made| **made == Ok(true)).count()
}

#[test]
fn cases_are_made_up_for_words_of_one_to_three_bits() {
    for format in ["U0F1", "U0F2", "U1F0", "U1F1"] {
        assert_eq!(
            made_up("tiny", &disc(), "fragment.depth", format.parse().unwrap()),
            Ok(true)
        );
    }
    // In cases in which sheets and ellipsoids differ, and in two formats of nine.
    let differs = |word: &str| {
        ["ellipse.ellipsoid", "sort", "fragment", "gauss"]
            .iter()
            .any(|unit| word.starts_with(unit))
    };
    let is_asked =
        |name: &str, word: &str, which: usize| which % 9 < 2 && (name == "tiny" || differs(word));
    let made = made_up_word_by_word(|name, word, which| {
        is_asked(name, word, which) && tier::has([3, 3], which / 9)
    });
    assert!(
        made > tier::of([3, 3], 40),
        "only {made} machines can be built"
    );
}

#[test]
fn cases_are_made_up_for_every_word_in_every_format_of_one_to_three_bits() {
    let made = made_up_word_by_word(|_, _, which| tier::has([144, 12], which));
    assert!(
        made > tier::of([144, 12], 400),
        "only {made} machines can be built"
    );
}

// ---- volumes and Gaussians ----

/// The middle of golden's picture of a slab: `layers` layers across the view, each with this
/// opacity, seen perpendicularly from afar.
fn slab(
    layers: usize,
    opacity: f64,
    law: &str,
    cutoff: f64,
    perpendicular_spacing: f64,
) -> Vec<f64> {
    let folder = tempfile::tempdir().unwrap();
    const SIDE: usize = 24;
    std::fs::write(
        folder.path().join("slab.raw"),
        vec![7u8; SIDE * SIDE * layers],
    )
    .unwrap();
    let scene = json!({
        "splats": {
            "volume": {"file": "slab.raw", "size": [SIDE, SIDE, layers], "type": "u8", "spacing": [1, 1, perpendicular_spacing]},
            "transfer": [{"value": 7, "opacity": opacity}],
            // Wide enough that kernels add up to a flat layer.
            "radius": 1.2,
        },
        "camera": {"eye": [11.5, 11.5, 2000], "target": [11.5, 11.5, 0], "fov_y_degrees": 0.3},
        "image": {"width": 40, "height": 40},
        "kernel": {"cutoff": cutoff},
        "sheets": {"opacity": law, "stop": 0},
        "materials": [{"unlit": true}],
    });
    let path = folder.path().join("scene.json");
    std::fs::write(&path, scene.to_string()).unwrap();
    let scene = Scene::load(path.to_str().unwrap(), &Overrides::default()).unwrap();
    let picture = render(&scene, &Rules::default()).picture;
    (10..30)
        .flat_map(|y| (10..30).map(move |x| y * 40 + x))
        .map(|index| picture.rgba[index][3])
        .collect()
}

/// Worked out by hand: the transmittance of n layers is (1 − α)ⁿ. A layer of truncated kernels is
/// slightly uneven: the mean is right within 0.5 %, and pixels within 5 %, or 10 % if kernels end
/// at half their height or higher.
#[test]
fn a_slab_is_as_opaque_as_it_says() {
    for (law, layers, opacity, cutoff, spacing, tolerance) in [
        ("exponential", 1, 0.5, 4.0, 1.0, 1.0),
        ("exponential", 1, 0.05, 4.0, 1.0, 1.0),
        ("exponential", 4, 0.2, 4.0, 1.0, 1.0),
        ("exponential", 1, 0.9, 9.0, 1.0, 1.0),
        ("exponential", 3, 0.3, 2.0, 1.0, 1.0),
        // An opacity belongs to a layer as thick as the shortest step: these layers are thicker,
        // and count as several.
        ("exponential", 1, 0.3, 4.0, 2.0, 1.0),
        // The optical depth of a linear sheet is −ln(1 − α), which is about α for small α.
        ("linear", 1, 0.02, 4.0, 1.0, 1.02),
        ("linear", 4, 0.02, 4.0, 1.0, 1.02),
    ] {
        let through = libm::pow(1.0 - opacity, layers as f64 * spacing);
        let all = slab(layers, opacity, law, cutoff, spacing);
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let ratio = mean / (1.0 - through);
        let told = format!(
            "{law}, {layers} layers of {opacity}, cutoff {cutoff}, {spacing} thick: {ratio}"
        );
        assert!(ratio > 0.995 && ratio < 1.005 * tolerance, "{told}");
        let uneven = all
            .iter()
            .map(|one| (one / mean - 1.0).abs())
            .fold(0.0, f64::max);
        // Kernels one step apart leave a ripple: 5.1 % with the usual cutoff.
        assert!(
            uneven < if cutoff < 4.0 { 0.1 } else { 0.06 },
            "{told}, {uneven} off"
        );
    }
}

#[test]
fn built_in_volumes_are_as_deep_as_they_were() {
    // The deepest voxel, from the depth of the field before opacity was defined as opacity: 0.9 per
    // step and so on, times the share of it that a ball of 0.7 steps has.
    let own = |name: &str| {
        std::fs::read_to_string(format!("golden_model/src/scene/builtin/{name}.json")).unwrap()
    };
    for (name, depths) in [
        ("nested-shells", &[0.0, 0.05, 0.15, 0.3, 0.8][..]),
        ("marschner-lobb", &[0.0, 0.9, 0.0]),
        ("fuzzy-clouds", &[0.0, 0.06, 0.25]),
    ] {
        let mut scene: serde_json::Value = serde_json::from_str(&own(name)).unwrap();
        scene["splats"]["volume"]["samples"] = json!(12);
        let points = scene["splats"]["transfer"].as_array().unwrap().clone();
        assert_eq!(points.len(), depths.len());
        for (point, depth) in points
            .into_iter()
            .zip(depths)
            .filter(|(_, depth)| **depth > 0.0)
        {
            // Everywhere as deep as at this value.
            scene["splats"]["transfer"] = json!([point]);
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("scene.json");
            std::fs::write(&path, scene.to_string()).unwrap();
            let read = Scene::load(path.to_str().unwrap(), &Overrides::default()).unwrap();
            let sigma = read.splats[0].radius;
            let step = sigma / 0.7;
            let was = depth * (step * step * step / (step * std::f64::consts::TAU * sigma * sigma));
            let opacity = read.splats[0].opacity;
            assert!(
                (opacity / was - 1.0).abs() < 1e-15 * 8.0,
                "{name}: {opacity}, but was {was}"
            );
        }
    }
}

/// One round Gaussian of opacity 1, six pixels wide, as a `.splat` file.
fn one_gaussian(cutoff: Option<f64>) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let floats = [0.0f32, 0.0, 0.0, 0.1, 0.1, 0.1];
    let bytes: Vec<u8> = floats
        .iter()
        .flat_map(|float| float.to_le_bytes())
        .chain([255, 255, 255, 255, 255, 128, 128, 128])
        .collect();
    std::fs::write(folder.path().join("one.splat"), bytes).unwrap();
    let mut scene = json!({
        "splats": {"file": "one.splat"},
        "camera": {"eye": [0, 0, -3], "target": [0, 0, 0]},
        "image": {"width": 160, "height": 160},
        "sheets": {"least_weight": 0},
    });
    if let Some(cutoff) = cutoff {
        scene["kernel"] = json!({"cutoff": cutoff});
    }
    let path = folder.path().join("scene.json");
    std::fs::write(&path, scene.to_string()).unwrap();
    Scene::load(path.to_str().unwrap(), &Overrides::default()).unwrap()
}

fn most_apart(a: &[[f64; 4]], b: &[[f64; 4]]) -> f64 {
    a.as_flattened()
        .iter()
        .zip(b.as_flattened())
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}

#[test]
fn gaussians_end_where_a_screen_of_8_bits_no_longer_shows_them() {
    let golden = |cutoff: Option<f64>| {
        render(&one_gaussian(cutoff), &Rules::default())
            .picture
            .rgba
    };
    let whole = golden(Some(60.0));
    let (usual, nine) = (
        most_apart(&golden(None), &whole),
        most_apart(&golden(Some(9.0)), &whole),
    );
    assert!(
        usual < 1.001 / 255.0 && usual > 0.9 / 255.0,
        "{}",
        usual * 255.0
    );
    assert!(nine > 2.5 / 255.0, "{}", nine * 255.0);
    assert!((one_gaussian(None).kernel.cutoff - 11.0825).abs() < 1e-4);
}

#[test]
fn ideal_has_no_cutoff_of_its_own_below_that() {
    let ideal = |cutoff: Option<f64>| ideal(&one_gaussian(cutoff)).picture.rgba;
    assert_eq!(ideal(Some(4.0)), ideal(None));
    assert!(most_apart(&ideal(Some(30.0)), &ideal(None)) > 0.5 / 255.0);
}

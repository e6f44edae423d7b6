//! Does the error bound hold? The machine with `golden` in lockstep, on built-in scenes, real scans
//! and random machines.

use crate::handmade::thinned;
use crate::mutation::{differences, mutated, mutations, named};
use crate::shared_input;
use crate::tier::{self, Tier};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use rtl_model::Machine;
use splatsim::accuracy::{CheckedTiles, Lockstep, lockstep, lockstep_in};
use splatsim::hardware::{fixed, machines, quantise};
use splatsim::scene::{Overrides, Scene};
use std::collections::HashSet;
use std::path::Path;

fn scene(name: &str, size: (usize, usize)) -> Scene {
    Scene::load(name, &Overrides { size: Some(size) }).unwrap()
}

fn in_lockstep(scene: &Scene, machine: &Machine) -> Lockstep {
    let elaborated = fixed::elaborate(machine).unwrap();
    lockstep(
        scene,
        &elaborated,
        &quantise::quantise(scene, machine).unwrap(),
    )
}

/// The fault of a frame, if there is one.
fn fault(frame: &Lockstep) -> Option<String> {
    let Lockstep {
        violations, flips, ..
    } = frame;
    let wrong = *violations > 0 || flips.unexplained > 0;
    wrong.then(|| format!("{violations} pixels exceed their bound; {flips:?}"))
}

#[test]
fn no_pixel_of_a_built_in_scene_exceeds_its_bound_and_every_flip_is_explained() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    for name in ["glass-spheres", "checkerboard", "torus-knot", "terrain"] {
        let scene = thinned(scene(name, (192, 160)), 20_000);
        for machine in Machine::NAMES {
            let frame = in_lockstep(&scene, &Machine::named(machine).unwrap());
            assert_eq!(fault(&frame), None, "{name} on {machine}");
            assert!(
                frame.flips.total() > 0 && frame.bound.iter().any(|bound| *bound > 0.0),
                "{name} on {machine} compared nothing"
            );
        }
    }
}

#[test]
fn no_pixel_of_a_scan_exceeds_its_bound_and_every_flip_is_explained() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let scans = [
        "scans/bun_zipper.ply",
        "scans/pond.0.ply",
        "scans/igea.ply",
        "scans/vol_total_rgb.ply",
        "scans/park_points_rgb.ply",
        "scenes/dragon.json",
    ];
    for (name, machine) in tier::some(
        [12, 6],
        scans
            .into_iter()
            .flat_map(|name| Machine::NAMES.map(|machine| (name, machine))),
    ) {
        let Some(path) = shared_input::find(name) else {
            continue;
        };
        let scene = scene(path.to_str().unwrap(), (192, 160));
        assert_eq!(
            fault(&in_lockstep(&scene, &Machine::named(machine).unwrap())),
            None,
            "{name} on {machine}"
        );
    }
}

/// Principal points off the middle, pixels that are not square, mirrors along such rays, and
/// compensated opacities.
#[test]
fn no_pixel_exceeds_its_bound_through_any_lens() {
    let [width, height] = [128, 96];
    let mirror = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/docs/book/reflection/mirror.json"
    );
    let mirrors = r#"{"splats": {"builtin": "glass-spheres", "count": 4000}, "environment": {"builtin": "sky"},
        "materials": [{"unlit": true}, {"diffuse": 0.8, "reflect": 0.6}]}"#;
    let overrides = Overrides {
        size: Some((width, height)),
    };
    for (name, machine) in [
        ("glass-spheres", "reference"),
        ("glass-spheres", "window"),
        ("nested-shells", "volume"),
        ("bouquet", "gaussian"),
        ("mirrors", mirror),
    ] {
        let load = || match name {
            "mirrors" => Scene::from_text(mirrors, name, Path::new(""), &overrides, 0).unwrap(),
            "glass-spheres" => thinned(scene(name, (width, height)), 20_000),
            _ => scene(name, (width, height)),
        };
        let settings = if name == "mirrors" {
            vec!["reflect.sight=ray".to_owned()]
        } else {
            Vec::new()
        };
        let machine = machines::load(machine, &settings).unwrap();
        let usual = in_lockstep(&load(), &machine).led;
        let lenses = [
            ([110.0, 83.0], [52.5, 61.25]),
            ([70.0, 125.0], [80.0, 40.0]),
            ([100.0, 100.0], [-10.0, 48.0]),
        ];
        for (focal_px, centre_px) in tier::some([3, 1], lenses) {
            let mut scene = load();
            (scene.camera.focal_px, scene.camera.centre_px) = (Some(focal_px), Some(centre_px));
            scene.kernel.compensate_opacity = name == "bouquet";
            let frame = in_lockstep(&scene, &machine);
            assert_eq!(
                fault(&frame),
                None,
                "{name} with {focal_px:?}, {centre_px:?}"
            );
            assert!(
                frame.bound.iter().filter(|bound| **bound > 0.0).count() > 500,
                "{name} with {focal_px:?}, {centre_px:?} compared little"
            );
            assert!(frame.led.rgba != usual.rgba);
            let summary = frame.summary(&frame.led);
            assert!(
                summary.psnr_db.is_none_or(|db| db > 55.0),
                "{name} with {focal_px:?}, {centre_px:?}: {:?} dB",
                summary.psnr_db
            );
        }
    }
}

/// The bound of nine covered pixels in ten is at most four steps of an 8-bit display.
#[test]
fn most_bounds_of_the_reference_machine_are_at_most_four_display_steps() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let mut scenes = vec![scene("glass-spheres", (512, 512))];
    scenes.extend(
        shared_input::find("scenes/dragon.json")
            .map(|path| scene(path.to_str().unwrap(), (512, 512))),
    );
    for scene in scenes {
        let machine = Machine::named("reference").unwrap();
        let frame = in_lockstep(&scene, &machine);
        assert_eq!(fault(&frame), None, "{}", scene.name);
        let summary = frame.summary(&frame.led).bound;
        assert!(
            summary.share_under_4_255 >= 0.9,
            "{}: {summary:?}",
            scene.name
        );
        // And not because there are no errors.
        assert!(summary.max_ratio > 0.2, "{}: {summary:?}", scene.name);
    }
}

/// A sampled frame has the whole frame's results for the tiles that it compares, and no results for
/// the others.
#[test]
fn a_sampled_frame_has_the_results_of_the_whole_frame_in_its_tiles() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    for (scene, name) in [
        (thinned(scene("glass-spheres", (150, 100)), 20_000), "tiny"),
        (scene("nested-shells", (90, 70)), "volume"),
    ] {
        let machine = Machine::named(name).unwrap();
        let (elaborated, quantised) = (
            fixed::elaborate(&machine).unwrap(),
            quantise::quantise(&scene, &machine).unwrap(),
        );
        let [whole, sampled] = [CheckedTiles::All, CheckedTiles::Sampled]
            .map(|tiles| lockstep_in(&scene, &elaborated, &quantised, tiles));
        let columns = scene.image.width;
        let mut tiles = HashSet::new();
        for pixel in 0..whole.bound.len() {
            let [column, row] = [pixel % columns / 16, pixel / columns / 16];
            let of = |frame: &Lockstep| {
                (
                    frame.bound[pixel],
                    frame.error[pixel],
                    frame.flipped[pixel],
                    frame.led.rgba[pixel],
                )
            };
            if (column + 3 * row) % 8 == 0 {
                assert_eq!(of(&sampled), of(&whole), "{name}, pixel {pixel}");
                tiles.insert([column, row]);
            } else {
                assert_eq!(
                    (
                        sampled.bound[pixel],
                        sampled.error[pixel],
                        sampled.flipped[pixel]
                    ),
                    (0.0, 0.0, 0)
                );
            }
        }
        // Some of the reported results, but not all.
        let told = |frame: &Lockstep| frame.summary(&frame.led);
        let is_held = |pixel: &usize| tiles.contains(&[pixel % columns / 16, pixel / columns / 16]);
        let held = (0..whole.bound.len()).filter(is_held).count() as u64;
        assert!(held > 0 && held < whole.bound.len() as u64 / 4, "{held}");
        assert_eq!(
            (told(&sampled).sampled_pixels, told(&whole).sampled_pixels),
            (Some(held), None)
        );
        assert!(
            (1..told(&whole).decision_flips).contains(&told(&sampled).decision_flips),
            "{:?}",
            sampled.flips
        );
        // A fault in a tile that is not compared is not found, nor is one where there is none.
        let mut wrong = whole.led.clone();
        let beside = (0..wrong.rgba.len()).find(|pixel| !is_held(pixel)).unwrap();
        wrong.rgba[beside] = [9.0; 4];
        assert_eq!(sampled.summary(&wrong).psnr_db, None);
        let green = &mut wrong.rgba[0][1];
        *green = if *green < 0.5 { 1.0 } else { 0.0 };
        assert!(sampled.summary(&wrong).max_error > 0.4);
    }
}

#[test]
fn no_pixel_exceeds_its_bound_where_operators_round() {
    let scene = thinned(scene("bouquet", (40, 32)), 2000);
    for name in ["fp16", "mixed"] {
        let [exact, rounded] = ["exact", "rounded"].map(|operators| {
            let change = format!("operators={operators}");
            in_lockstep(&scene, &machines::load(name, &[change]).unwrap())
        });
        assert_eq!(fault(&rounded), None, "{name}");
        // Each rounding makes a bound wider.
        let sum = |frame: &Lockstep| frame.bound.iter().map(|bound| bound.min(10.0)).sum::<f64>();
        assert!(sum(&rounded) > 1.01 * sum(&exact), "{name}");
    }
}

#[test]
fn no_pixel_of_a_random_machine_exceeds_its_bound() {
    const MACHINES: usize = 200;
    let scenes = [
        scene("torus-knot", (48, 40)),
        scene("glass-spheres", (40, 40)),
    ]
    .map(|scene| thinned(scene, 2000));
    let mut runner = TestRunner::deterministic();
    let (mut drawn, mut asked) = (0, 0);
    while drawn < MACHINES {
        asked += 1;
        assert!(
            asked < 100 * MACHINES,
            "only {drawn} of {asked} machines can draw"
        );
        let pick = (named(), mutations(1..12))
            .new_tree(&mut runner)
            .unwrap()
            .current();
        let machine = pick
            .1
            .iter()
            .fold(Machine::named(pick.0).unwrap(), |machine, mutation| {
                mutated(&machine, mutation)
            });
        let Ok(elaborated) = machine.elaborate() else {
            continue;
        };
        let scene = &scenes[asked % 2];
        let Ok(quantised) = quantise::quantise(scene, &machine) else {
            continue;
        };
        drawn += 1;
        if tier::has([12, 6], drawn) {
            let frame = lockstep(scene, &elaborated, &quantised);
            assert_eq!(
                fault(&frame),
                None,
                "{} {:?}",
                machine.name,
                differences(&machine)
            );
        }
    }
}

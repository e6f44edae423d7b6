//! Does every odd scene on every machine result in a picture or in one sentence? Scenes that a file
//! could request, and machines that a file could describe.

use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::handmade::{Rng, confetti, scene, splat};
use glam::DVec3;
use rtl_model::Machine;
use rtl_model::machine::{FragmentDepth, Merge, Rows};
use splatsim::hardware::{fixed, quantise};
use splatsim::scene::{Light, Material, Scene, Splat};

/// Result of a scene on a machine: the number of bytes of the picture that differ from the
/// background, or the error's sentence.
fn drawn(scene: &Scene, machine: &Machine) -> Result<usize, String> {
    let elaborated = fixed::elaborate(machine).map_err(|error| error.to_string())?;
    let quantised = quantise::quantise(scene, machine).map_err(|error| error.to_string())?;
    // With a probe, so that every word is checked.
    let (drawing, ..) = fixed::draw_measured(&elaborated, &quantised);
    let picture = fixed::picture(&elaborated, &drawing);
    assert_eq!(
        (picture.width, picture.height),
        (scene.image.width, scene.image.height)
    );
    assert_eq!(picture.rgba.len(), picture.width * picture.height);
    assert!(
        picture
            .rgba
            .as_flattened()
            .iter()
            .all(|channel| (0.0..=1.0).contains(channel)),
        "a channel outside [0, 1]"
    );
    let culled = drawing.culled;
    let culled = culled.near + culled.outside + culled.faint + culled.backface + culled.transparent;
    assert!(
        culled <= scene.splats.len() as u64,
        "{culled} of {} splats culled",
        scene.splats.len()
    );
    Ok(drawing.covered.iter().filter(|covered| **covered).count())
}

/// All faults of scenes on machines, one sentence each.
fn faults<'a>(cases: impl IntoIterator<Item = (String, &'a Scene, &'a Machine)>) -> Vec<String> {
    let fault = |(name, scene, machine): (String, &Scene, &Machine)| match catch_unwind(
        AssertUnwindSafe(|| drawn(scene, machine)),
    ) {
        Ok(Ok(_)) => None,
        Ok(Err(sentence)) if sentence.contains('\n') || sentence.len() > 1200 => {
            Some(format!("{name}: `{sentence}` is not a sentence"))
        }
        Ok(Err(_)) => None,
        Err(panic) => {
            let told = panic
                .downcast_ref::<String>()
                .map(String::as_str)
                .or(panic.downcast_ref::<&str>().copied());
            Some(format!("{name} panics: {}", told.unwrap_or("?")))
        }
    };
    cases.into_iter().filter_map(fault).collect()
}

fn changed(change: impl FnOnce(&mut Scene)) -> Scene {
    let mut scene = confetti(40, 9);
    change(&mut scene);
    scene
}

fn each_splat(change: impl FnMut(&mut Splat)) -> Scene {
    changed(|scene| scene.splats.iter_mut().for_each(change))
}

fn odd_scenes() -> Vec<(String, Scene)> {
    let mut scenes: Vec<(String, Scene)> = vec![
        ("no splats".into(), changed(|s| s.splats.clear())),
        ("one splat".into(), changed(|s| s.splats.truncate(1))),
        (
            "all at one point".into(),
            each_splat(|s| s.position = DVec3::new(0.1, 0.2, 1.5)),
        ),
        (
            "all at the eye".into(),
            each_splat(|s| s.position = DVec3::ZERO),
        ),
        (
            "all behind the eye".into(),
            each_splat(|s| s.position.z = -s.position.z),
        ),
        (
            "all in the plane of the eye".into(),
            each_splat(|s| s.position.z = 0.0),
        ),
        ("near beyond all".into(), changed(|s| s.camera.near = 1e9)),
        ("tiny near".into(), changed(|s| s.camera.near = 1e-300)),
        (
            "edge-on".into(),
            each_splat(|s| s.normal = DVec3::new(s.position.z, 0.0, -s.position.x).normalize()),
        ),
        (
            "edge-on and large".into(),
            each_splat(|s| {
                (s.normal, s.radius) = (
                    DVec3::new(0.0, s.position.z, -s.position.y).normalize(),
                    50.0,
                )
            }),
        ),
        (
            "faces away".into(),
            changed(|s| {
                s.surface.cull_backfaces = true;
                s.splats.iter_mut().for_each(|s| s.normal = -s.normal);
            }),
        ),
        ("no opacity".into(), each_splat(|s| s.opacity = 0.0)),
        ("black".into(), each_splat(|s| s.rgb = [0.0; 3])),
        (
            "white and opaque".into(),
            each_splat(|s| (s.rgb, s.opacity) = ([1.0; 3], 1.0)),
        ),
        ("no lights".into(), changed(|s| s.lights.clear())),
        (
            "light from the eye".into(),
            changed(|s| s.lights[0].direction = DVec3::NEG_Z),
        ),
        (
            "light from behind".into(),
            changed(|s| s.lights[0].direction = DVec3::Z),
        ),
        (
            "twenty lights".into(),
            changed(|s| {
                let mut rng = Rng(1);
                s.lights = (0..20)
                    .map(|_| Light {
                        direction: rng.direction(),
                        rgb: [1.0; 3],
                    })
                    .collect();
            }),
        ),
        (
            "blinding light".into(),
            changed(|s| s.lights[0].rgb = [1e9; 3]),
        ),
        (
            "dull".into(),
            changed(|s| {
                s.materials[1] = Material::BlinnPhong {
                    ambient: 0.0,
                    diffuse: 0.0,
                    specular: 0.0,
                    shininess: 0.0,
                }
            }),
        ),
        (
            "mirror".into(),
            changed(|s| {
                s.materials[1] = Material::BlinnPhong {
                    ambient: 1.0,
                    diffuse: 1.0,
                    specular: 1.0,
                    shininess: 1e6,
                }
            }),
        ),
    ];
    for (width, height) in [(1, 1), (16384, 1), (1, 16384), (33, 31)] {
        scenes.push((
            format!("{width}×{height}"),
            changed(|s| (s.image.width, s.image.height) = (width, height)),
        ));
    }
    for radius in [1e-300, 1e-12, 1e-3, 10.0, 1e12, 1e300] {
        scenes.push((
            format!("radius {radius}"),
            each_splat(|s| s.radius = radius),
        ));
        scenes.push((
            format!("one radius {radius}"),
            changed(|s| s.splats[0].radius = radius),
        ));
    }
    for far in [1e3, 1e12, 1e150] {
        scenes.push((format!("{far} apart"), each_splat(|s| s.position *= far)));
        scenes.push((
            format!("one {far} away"),
            changed(|s| s.splats[0].position *= far),
        ));
        scenes.push((
            format!("one {far} aside"),
            changed(|s| s.splats[0].position.x = far),
        ));
        scenes.push((
            format!("eye {far} away"),
            changed(|s| (s.camera.eye.z, s.camera.target.z) = (-far, 1.0)),
        ));
    }
    for fov in [1e-3, 1.0, 120.0, 179.0, 179.999] {
        scenes.push((
            format!("field of view {fov}°"),
            changed(|s| s.camera.fov_y_degrees = fov),
        ));
    }
    for cutoff in [1e-9, 0.01, 0.5, 4.0, 9.0, 1e6] {
        scenes.push((
            format!("cutoff {cutoff}"),
            changed(|s| s.kernel.cutoff = cutoff),
        ));
    }
    for low_pass in [0.0, 1e-9, 0.1, 10.0, 1e6] {
        scenes.push((
            format!("low-pass {low_pass}"),
            changed(|s| s.kernel.low_pass = low_pass),
        ));
        let narrow = |s: &mut Scene| {
            s.kernel.low_pass = low_pass;
            s.splats.iter_mut().for_each(|s| s.radius = 1e-4);
        };
        scenes.push((
            format!("low-pass {low_pass} and small splats"),
            changed(narrow),
        ));
    }
    for threshold in [1e-300, 1e-9, 100.0, 1e12] {
        scenes.push((
            format!("τ {threshold}"),
            changed(|s| s.surface.coverage_threshold = threshold),
        ));
        scenes.push((
            format!("ε {threshold}"),
            changed(|s| s.surface.z_threshold = threshold),
        ));
    }
    scenes
}

#[test]
fn every_odd_scene_ends_in_a_picture_or_a_sentence() {
    let machines: Vec<Machine> = Machine::NAMES
        .into_iter()
        .map(|name| Machine::named(name).unwrap())
        .collect();
    let scenes = odd_scenes();
    let cases = scenes.iter().flat_map(|(name, scene)| {
        machines
            .iter()
            .map(move |machine| (format!("{name} on {}", machine.name), scene, machine))
    });
    let faults = faults(cases);
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn every_rule_of_every_machine_draws() {
    let mut machines = Vec::new();
    for name in Machine::NAMES {
        for layers in 1..=8 {
            for merge in [Merge::NearestPair, Merge::FarthestPair, Merge::Replace] {
                for (evict_hidden, fragment_depth, rows) in [
                    (false, FragmentDepth::First, Rows::Seeded),
                    (true, FragmentDepth::Nearest, Rows::Differenced),
                ] {
                    let mut machine = Machine::named(name).unwrap();
                    machine.name = format!(
                        "{name} {layers} {merge:?} {evict_hidden} {fragment_depth:?} {rows:?}"
                    );
                    (machine.fragment.layers, machine.fragment.merge) = (layers, merge);
                    (
                        machine.fragment.evict_hidden,
                        machine.fragment.fragment_depth,
                        machine.raster.rows,
                    ) = (evict_hidden, fragment_depth, rows);
                    machines.push(machine);
                }
            }
        }
    }
    let mut small = confetti(300, 2);
    small.surface.z_threshold = 0.01;
    let faults = faults(
        machines
            .iter()
            .map(|machine| (machine.name.clone(), &small, machine)),
    );
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    let drawing = machines
        .iter()
        .filter(|machine| drawn(&small, machine).is_ok_and(|covered| covered > 500))
        .count();
    // `replace` has one layer.
    assert_eq!(drawing, 3 * (8 * 2 * 2 + 2));
}

#[test]
fn a_scene_that_cannot_be_drawn_is_refused_in_a_sentence_that_names_the_cause() {
    let told =
        |name: &str, scene: &Scene| drawn(scene, &Machine::named(name).unwrap()).unwrap_err();
    for name in ["reference", "lean"] {
        let sentence = told(name, &changed(|s| s.kernel.cutoff = 9.0));
        assert!(
            sentence.contains("gauss.radial_index") && sentence.contains("the scene's cutoff is 9"),
            "{sentence}"
        );
    }
    assert!(told("lean", &changed(|s| s.camera.fov_y_degrees = 0.1)).contains("project.focal"));
    assert!(told("tiny", &changed(|s| s.kernel.low_pass = 10.0)).contains("ellipse.low_pass"));
    assert!(
        told("reference", &changed(|s| s.lights[0].rgb = [100.0; 3])).contains("shade.reflectance")
    );
    let mut machine = Machine::named("tiny").unwrap();
    machine.fragment.layers = 9;
    assert!(
        drawn(&confetti(1, 1), &machine)
            .unwrap_err()
            .contains("fragment.layers")
    );
}

#[test]
fn an_ordinary_scene_draws_everywhere() {
    for name in Machine::NAMES {
        assert!(
            drawn(
                &scene(8, 8, 8.0, vec![splat([0.0, 0.0, 2.0], 0.5)]),
                &Machine::named(name).unwrap()
            )
            .unwrap()
                > 10
        );
    }
}

#[test]
fn a_panic_is_a_fault() {
    let broken = changed(|s| s.materials.clear());
    let machine = Machine::named("tiny").unwrap();
    let faults = faults([("no materials".to_owned(), &broken, &machine)]);
    assert!(
        faults.len() == 1 && faults[0].starts_with("no materials panics: "),
        "{faults:?}"
    );
}

//! Several kinds of splats in one frame (EWA Fig. 16): does each keep its opacity, do splats in
//! front hide those behind, and does the machine draw the frame?

use glam::{DQuat, DVec3};
use serde_json::{Value, json};
use splatsim::accuracy::{lockstep, metrics};
use splatsim::golden::{self, Rules};
use splatsim::hardware::{fixed, machines, quantise};
use splatsim::output::colour::srgb_decode;
use splatsim::output::picture::Picture;
use splatsim::scene::{Overrides, Scene, Sheet};
use std::path::Path;

fn load(scene: &Value, folder: &Path) -> Scene {
    let path = folder.join("scene.json");
    std::fs::write(&path, scene.to_string()).unwrap();
    Scene::load(&path, &Overrides::default()).unwrap()
}

fn made(scene: &Value) -> Scene {
    load(scene, tempfile::tempdir().unwrap().path())
}

fn golden(scene: &Scene) -> Picture {
    golden::render(scene, &Rules::default()).picture
}

fn farthest(a: &Picture, b: &Picture) -> f64 {
    a.rgba
        .as_flattened()
        .iter()
        .zip(b.rgba.as_flattened())
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}

fn centre(picture: &Picture) -> [f64; 4] {
    picture.rgba[picture.height / 2 * picture.width + picture.width / 2]
}

/// Seen along −z from far away, so that perspective has no effect.
fn front(splats: Value) -> Value {
    json!({"splats": splats, "materials": [{"unlit": true}], "sheets": {"stop": 0},
        "camera": {"eye": [0, 0, 1000], "target": [0, 0, 0], "fov_y_degrees": 0.12}, "image": {"width": 33, "height": 33}})
}

/// A square of discs, one per cell, with σ equal to the spacing.
fn plane(z: f64, rgb: [f64; 3], opacity: f64) -> Vec<Value> {
    let disc = |i: i32| {
        let position = [
            0.1 * f64::from(i % 31 - 15),
            0.1 * f64::from(i / 31 - 15),
            z,
        ];
        json!({"position": position, "normal": [0, 0, 1], "radius": 0.1, "rgb": rgb, "opacity": opacity})
    };
    (0..31 * 31).map(disc).collect()
}

/// A block of blue fog about the origin: 40 layers of 1/20 that absorb 4 % each.
fn fog(folder: &Path) -> Value {
    std::fs::write(folder.join("fog.raw"), vec![1; 60 * 60 * 40]).unwrap();
    let raw = json!({"file": "fog.raw", "size": [60, 60, 40], "type": "u8", "spacing": [0.05, 0.05, 0.05], "origin": [-1.475, -1.475, -0.975]});
    json!({"volume": raw, "transfer": [{"value": 1, "rgb": [0, 0, 1], "opacity": 0.04}]})
}

fn together(sources: impl IntoIterator<Item = Value>) -> Value {
    Value::Array(sources.into_iter().collect())
}

fn near(picture: &Picture, expected: [f64; 4], tolerance: f64, told: &str) {
    let found = centre(picture);
    let apart = (0..4)
        .map(|i| (found[i] - expected[i]).abs())
        .fold(0.0, f64::max);
    assert!(apart < tolerance, "{told}: {found:?} is not {expected:?}");
}

/// A surface in the middle of a fog: the fog in front, the surface, and the rest of the fog seen
/// through it. Layers, worked out by hand.
#[test]
fn a_surface_in_a_fog_has_half_of_it_in_front() {
    let folder = tempfile::tempdir().unwrap();
    for (z, before) in [(0.0, 20), (2.0, 0), (-2.0, 40), (0.5, 10)] {
        for opacity in [1.0, 0.6] {
            let sources = plane(z, [1.0, 0.0, 0.0], opacity)
                .into_iter()
                .chain([fog(folder.path())]);
            let scene = load(&front(together(sources)), folder.path());
            let sheets = scene.sheets.as_ref().unwrap();
            assert!(
                matches!(&sheets.of, Sheet::Slice(numbers) if numbers.len() == scene.splats.len())
            );
            let [over, under] = [before, 40 - before].map(|layers| 0.96_f64.powi(layers));
            let red = over * opacity;
            let blue = 1.0 - over + over * (1.0 - opacity) * (1.0 - under);
            near(
                &golden(&scene),
                [red, 0.0, blue, red + blue],
                0.03,
                &format!("{z} {opacity}"),
            );
        }
    }
}

/// Gaussians do not mirror, also if all materials of the scene are shiny.
#[test]
fn gaussians_beside_mirrors_mirror_nothing() {
    let mut scene = front(together(
        plane(0.0, [1.0, 0.0, 0.0], 1.0)
            .into_iter()
            .chain([json!({"gaussians": "bouquet", "count": 3})]),
    ));
    scene["materials"] = json!([{"unlit": true, "reflect": 0.5}, {"reflect": 1.0}]);
    scene["environment"] = json!({"builtin": "sky"});
    let scene = made(&scene);
    let mirrors = &scene.environment.as_ref().unwrap().mirrors;
    assert_eq!(mirrors.len(), scene.materials.len());
    let shares: Vec<f64> = scene
        .splats
        .iter()
        .map(|splat| mirrors[splat.material as usize].reflect)
        .collect();
    assert!(
        shares[..31 * 31].iter().all(|share| *share == 0.5) && shares[31 * 31..] == [0.0; 3],
        "{shares:?}"
    );
    golden(&scene);
}

/// One Gaussian of sRGB grey 0.5, as written by training programs.
fn gaussian(folder: &Path, logit: f64) -> Value {
    coloured(folder, logit, "")
}

/// One Gaussian with nine harmonics of degree 1 after its grey, or without them.
fn coloured(folder: &Path, logit: f64, harmonics: &str) -> Value {
    let names = [
        "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2",
    ];
    let rotations = ["rot_0", "rot_1", "rot_2", "rot_3"];
    let rest: Vec<String> = (0..harmonics.split_whitespace().count())
        .map(|i| format!("f_rest_{i}"))
        .collect();
    let names = names
        .iter()
        .chain(&rotations)
        .copied()
        .chain(rest.iter().map(String::as_str));
    let properties: String = names
        .map(|name| format!("property float {name}\n"))
        .collect();
    let row = format!("0 0 0 0 0 0 {logit} -0.7 0 -1.5 1 0.3 -0.2 0.5 {harmonics}\n");
    std::fs::write(
        folder.join("one.ply"),
        format!("ply\nformat ascii 1.0\nelement vertex 1\n{properties}end_header\n{row}"),
    )
    .unwrap();
    json!({"file": "one.ply"})
}

/// In any orientation, a Gaussian has the file's opacity at its middle, and the light of its
/// colour.
#[test]
fn a_gaussian_among_others_has_the_opacity_of_its_peak() {
    let folder = tempfile::tempdir().unwrap();
    for logit in [-2.0, 0.0, 2.0] {
        let sources = together(
            plane(-50.0, [0.0; 3], 0.0)
                .into_iter()
                .chain([gaussian(folder.path(), logit)]),
        );
        let mut scene = front(sources);
        scene["kernel"] = json!({"low_pass": 0});
        let alpha: f64 = 1.0 / (1.0 + f64::exp(-logit));
        let light = srgb_decode(0.5) * alpha;
        near(
            &golden(&load(&scene, folder.path())),
            [light, light, light, alpha],
            1e-6,
            &format!("{logit}"),
        );
    }
}

/// With a maximum weight of 1, an opaque Gaussian would be infinitely deep.
#[test]
fn an_opaque_gaussian_has_a_depth() {
    let folder = tempfile::tempdir().unwrap();
    let sources = together(
        plane(-50.0, [0.0; 3], 0.0)
            .into_iter()
            .chain([gaussian(folder.path(), 200.0)]),
    );
    let mut scene = front(sources);
    scene["sheets"] = json!({"stop": 0, "most_weight": 1});
    let scene = load(&scene, folder.path());
    assert!(scene.splats.iter().all(|splat| splat.opacity.is_finite()));
    let picture = golden(&scene);
    assert!(
        picture
            .rgba
            .as_flattened()
            .iter()
            .all(|value| value.is_finite())
    );
    let light = srgb_decode(0.5);
    near(&picture, [light, light, light, 1.0], 1e-4, "opaque");
}

#[test]
fn a_list_of_one_is_that_one() {
    let shells = json!({"volume": {"builtin": "nested-shells", "samples": 12}});
    let mut isosurface = shells.clone();
    isosurface["isovalue"] = json!(0.2);
    for source in [
        shells,
        isosurface,
        json!({"gaussians": "bouquet", "count": 50}),
        json!({"builtin": "terrain", "count": 50}),
    ] {
        let of =
            |splats: Value| made(&json!({"splats": splats, "image": {"width": 40, "height": 32}}));
        let alone = of(source.clone());
        assert_eq!(of(json!([source.clone()])), alone, "{source}");
        let unmoved = of(json!({"splats": source.clone(), "place": {}}));
        assert_eq!(unmoved.splats.len(), alone.splats.len());
        let (unmoved, alone) = (golden(&unmoved), golden(&alone));
        let apart = farthest(&unmoved, &alone);
        assert!(
            apart < 1e-12 && alone.covered.iter().any(|covered| *covered),
            "{source}: {apart:e}"
        );
    }
}

/// Surfaces and flattened kernels are still grouped by depth.
#[test]
fn isosurfaces_beside_discs_are_surfaces() {
    let isosurface =
        json!({"volume": {"builtin": "nested-shells", "samples": 30}, "isovalue": 0.2});
    let discs =
        json!({"splats": {"builtin": "torus-knot", "count": 3000}, "place": {"scale": 0.3}});
    let scene = made(&json!({"splats": [discs, isosurface], "image": {"width": 64, "height": 48}}));
    assert_eq!(
        (scene.sheets.is_none(), machines::usual(&scene)),
        (true, "volume")
    );
    let ellipsoids = scene.ellipsoids.as_ref().unwrap();
    assert_eq!(
        (ellipsoids.orientations.len(), ellipsoids.sorted),
        (scene.splats.len(), false)
    );
    // Alongside an ellipsoid, a disc is an ellipsoid without thickness.
    let alone = Scene {
        splats: scene.splats[..3000].to_vec(),
        ellipsoids: None,
        ..scene.clone()
    };
    let mut flat = Scene {
        splats: scene.splats[..3000].to_vec(),
        ..scene.clone()
    };
    flat.ellipsoids
        .as_mut()
        .unwrap()
        .orientations
        .truncate(3000);
    let (alone, flat) = (golden(&alone), golden(&flat));
    let apart = farthest(&alone, &flat);
    assert!(
        apart < 1e-6 && alone.covered.iter().filter(|covered| **covered).count() > 300,
        "{apart:e}"
    );
}

const TURN_DEGREES: f64 = 77.0;

/// The camera moved together with all splats: the same picture.
#[test]
fn splats_moved_together_with_the_eye_look_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let axes = ["0 0.1 0.4 0.5", "0 0.2 0.3", "0 0.3 0.5"]
        .map(|axis| format!("<DataArray type=\"Float64\" format=\"ascii\">{axis}</DataArray>"));
    let values = (0..36).map(|i| i.to_string()).collect::<Vec<_>>().join(" ");
    let vtr = format!(
        "<VTKFile type=\"RectilinearGrid\"><RectilinearGrid WholeExtent=\"0 3 0 2 0 2\"><Piece><PointData><DataArray type=\"Float32\" \
         format=\"ascii\">{values}</DataArray></PointData><Coordinates>{}</Coordinates></Piece></RectilinearGrid></VTKFile>",
        axes.concat()
    );
    std::fs::write(folder.path().join("x.vtr"), vtr).unwrap();
    let shells = json!({"volume": {"builtin": "nested-shells", "samples": 20}});
    let sources = [
        shells.clone(),
        json!({"volume": "x.vtr", "transfer": [{"value": 0, "rgb": [1, 0, 0], "opacity": 0.1}, {"value": 35, "rgb": [0, 1, 0.5], "opacity": 0.6}]}),
        json!({"gaussians": "bouquet", "count": 400}),
        coloured(folder.path(), 1.0, "0.3 -0.2 0.1 -0.4 0.2 0.3 0.1 0.4 -0.3"),
        json!({"builtin": "torus-knot", "count": 3000}),
        json!({"volume": {"builtin": "nested-shells", "samples": 20}, "isovalue": 0.2}),
        json!([shells, {"gaussians": "bouquet", "count": 200}, {"builtin": "torus-knot", "count": 500},
            {"volume": {"builtin": "nested-shells", "samples": 20}, "isovalue": 0.2}, {"volume": "x.vtr"}]),
    ];
    let (axis, way) = (DVec3::new(1.0, -2.0, 0.5), DVec3::new(3.0, 40.0, -7.0));
    let turn = DQuat::from_axis_angle(axis.normalize(), TURN_DEGREES.to_radians());
    let [eye, target, up, light] = [
        DVec3::new(1.5, 1.0, 4.0),
        DVec3::new(0.1, 0.2, 0.0),
        DVec3::Y,
        DVec3::new(3.0, 1.0, 1.0),
    ];
    let scene = |splats: Value, [eye, target, up, light]: [DVec3; 4], scale: f64| {
        json!({"splats": splats, "materials": [{}], "lights": [{"direction": light.to_array()}], "image": {"width": 48, "height": 40}, "surface": {"z_threshold": 0.2 * scale},
            "camera": {"eye": eye.to_array(), "target": target.to_array(), "up": up.to_array(), "fov_y_degrees": 40}})
    };
    for source in sources {
        let told = source.to_string();
        let here = golden(&load(
            &scene(source.clone(), [eye, target, up, light], 1.0),
            folder.path(),
        ));
        // In two steps.
        let first = json!({"splats": source, "place": {"scale": 1.5, "move": [20, -30, 40]}});
        let placed = json!({"splats": first, "place": {"scale": 2, "axis": axis.to_array(), "degrees": TURN_DEGREES, "move": way.to_array()}});
        let bring =
            |point: DVec3| turn * ((point * 1.5 + DVec3::new(20.0, -30.0, 40.0)) * 2.0) + way;
        let brought = [bring(eye), bring(target), turn * up, turn * light];
        let there = golden(&load(&scene(placed, brought, 3.0), folder.path()));
        let apart = farthest(&here, &there);
        assert!(
            apart < 1e-6 && here.covered.iter().any(|covered| *covered),
            "{told}: {apart:e}"
        );
    }
}

#[test]
fn the_machine_draws_a_mixed_frame_within_its_bounds() {
    let scene = made(&json!({
        "splats": [
            {"volume": {"builtin": "nested-shells", "samples": 24}, "isovalue": 0.9},
            {"volume": {"builtin": "nested-shells", "samples": 24}, "transfer": [{"value": 0.1, "rgb": [0.2, 0.5, 1], "opacity": 0},
                {"value": 0.6, "rgb": [0.2, 0.9, 0.3], "opacity": 0.2}]},
            {"splats": {"builtin": "torus-knot", "count": 2000}, "place": {"scale": 0.25, "degrees": 40}},
            {"splats": {"gaussians": "bouquet", "count": 300}, "place": {"move": [0.3, 0.2, 0]}},
        ],
        "camera": {"eye": [1.4, 1.2, 3.0], "target": [0, 0, 0], "fov_y_degrees": 36},
        "image": {"width": 64, "height": 56, "background": [1, 1, 1, 1]},
    }));
    assert_eq!(machines::usual(&scene), "gaussian");
    // A kernel much longer than wide, seen along its length, is deeper than eight times its width,
    // where the machine's word ends.
    for (change, least) in [
        (None, 50.0),
        (Some("ellipse.visibility=U7F18".to_owned()), 70.0),
    ] {
        let machine = machines::load("gaussian", change.as_slice()).unwrap();
        let elaborated = fixed::elaborate(&machine).unwrap();
        let quantised = quantise::quantise(&scene, &machine).unwrap();
        let golden = golden::render(&scene, &fixed::rules(&machine));
        let picture = fixed::picture(&elaborated, &fixed::draw(&elaborated, &quantised));
        let psnr = metrics(&picture, &golden.picture).psnr_db.unwrap();
        assert!(psnr > least, "{psnr} {change:?}");
        let frame = lockstep(&scene, &elaborated, &quantised);
        assert_eq!(
            (frame.violations, frame.flips.unexplained),
            (0, 0),
            "{:?}",
            frame.flips
        );
    }
}

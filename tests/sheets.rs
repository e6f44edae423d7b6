//! Volumes and Gaussians on the machine: does the bound hold, are flips explained, is the picture
//! good, and does every setting of a scene have an effect?

use crate::mutation::{differences, mutated, mutations};
use crate::shared_input;
use crate::tier::{self, Tier};
use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::TestRunner;
use rtl_model::{Drawing, Machine};
use serde_json::{Value, json};
use splatsim::accuracy::{Lockstep, lockstep, metrics};
use splatsim::golden;
use splatsim::golden::Rendering;
use splatsim::hardware::{fixed, machines, quantise};
use splatsim::scene;
use splatsim::scene::{Amplitude, Overrides, Scene, Splat};

const SIZE: (usize, usize) = (160, 128);

fn load(name: &str) -> Scene {
    Scene::load(name, &Overrides { size: Some(SIZE) }).unwrap()
}

fn of_size(scene: &Value, size: Option<(usize, usize)>) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    std::fs::write(&path, scene.to_string()).unwrap();
    Scene::load(path.to_str().unwrap(), &Overrides { size }).unwrap()
}

fn made(scene: &Value) -> Scene {
    of_size(scene, Some(SIZE))
}

/// A built-in scene with some of its fields changed.
fn changed(name: &str, change: impl FnOnce(&mut Value)) -> Scene {
    let mut scene = serde_json::from_str(&Scene::text(name).unwrap()).unwrap();
    change(&mut scene);
    made(&scene)
}

fn usual(scene: &Scene) -> Machine {
    Machine::named(machines::usual(scene)).unwrap()
}

fn draw(scene: &Scene, machine: &Machine) -> (Drawing, f64) {
    let elaborated = fixed::elaborate(machine).unwrap();
    let drawing = fixed::draw(&elaborated, &quantise::quantise(scene, machine).unwrap());
    let golden = golden::render(scene, &fixed::rules(machine));
    let psnr = metrics(&fixed::picture(&elaborated, &drawing), &golden.picture)
        .psnr_db
        .unwrap_or(f64::INFINITY);
    (drawing, psnr)
}

fn in_golden(scene: &Scene) -> Rendering {
    golden::render(scene, &golden::Rules::default())
}

fn in_lockstep(scene: &Scene, machine: &Machine) -> Lockstep {
    lockstep(
        scene,
        &fixed::elaborate(machine).unwrap(),
        &quantise::quantise(scene, machine).unwrap(),
    )
}

fn fault(frame: &Lockstep) -> Option<String> {
    let Lockstep {
        violations, flips, ..
    } = frame;
    (*violations > 0 || flips.unexplained > 0)
        .then(|| format!("{violations} pixels exceed their bound; {flips:?}"))
}

/// A quarter of the Gaussians of a built-in scene; volumes are unchanged.
fn thin(scene: &mut Value) {
    if !scene["splats"]["gaussians"].is_null() {
        scene["splats"]["count"] = json!(10_000);
    }
}

const MEDIA: [&str; 4] = ["marschner-lobb", "nested-shells", "fuzzy-clouds", "bouquet"];

/// The built-in scenes, and variants with rules that they do not have.
fn scenes() -> Vec<(String, Scene)> {
    let mut scenes: Vec<(String, Scene)> = MEDIA
        .iter()
        .map(|name| ((*name).to_owned(), changed(name, thin)))
        .collect();
    let variants = [
        (
            "nested-shells",
            json!({"opacity": "linear", "order": "back-to-front"}),
        ),
        (
            "marschner-lobb",
            json!({"opacity": "linear", "stop": 0.3, "keep_last": false, "least_weight": 0.01}),
        ),
        (
            "bouquet",
            json!({"keep_last": true, "stop": 0.2, "most_weight": 0.5}),
        ),
        ("bouquet", json!({"least_weight": 0, "stop": 0})),
    ];
    for (name, sheets) in variants {
        let told = format!("{name} with {sheets}");
        let change = |scene: &mut Value| {
            thin(scene);
            scene["sheets"] = sheets;
        };
        scenes.push((told, changed(name, change)));
    }
    scenes
}

#[test]
fn pictures_are_good() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    for name in MEDIA {
        let scene = load(name);
        let (drawing, psnr) = draw(&scene, &usual(&scene));
        assert!(psnr > 70.0, "{name}: {psnr}");
        assert!(
            drawing.covered.iter().filter(|covered| **covered).count() > 3000,
            "{name}"
        );
    }
}

#[test]
fn no_pixel_exceeds_its_bound_and_every_flip_is_explained() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let mut flips = 0;
    for (name, scene) in scenes() {
        let frame = in_lockstep(&scene, &usual(&scene));
        assert_eq!(fault(&frame), None, "{name}");
        assert!(frame.bound.iter().any(|bound| *bound > 0.0), "{name}");
        flips += frame.flips.total();
    }
    assert!(flips > 1000, "{flips}: it asked nothing");
}

/// A machine without a sort sums Gaussians: its picture is near that of `golden`, within its bounds,
/// and without flips, because nothing is decided by order.
#[test]
fn a_sum_of_gaussians_is_drawn_well_and_within_bounds() {
    let scene = load("bouquet");
    let machine = Machine::named("weighted").unwrap();
    let (drawing, psnr) = draw(&scene, &machine);
    assert!(psnr > 70.0, "{psnr}");
    let frame = in_lockstep(&scene, &machine);
    assert_eq!(fault(&frame), None);
    assert!(frame.bound.iter().any(|bound| *bound > 0.0));
    assert_eq!((frame.flips.order, frame.flips.eviction), (0, 0));
    let blended = draw(&scene, &usual(&scene)).0;
    assert_ne!(drawing.frame, blended.frame);
    // Several sources are one medium, which is drawn in the order of depth.
    let sources =
        json!([{"gaussians": "bouquet", "count": 30}, {"gaussians": "city", "count": 30}]);
    let refused = quantise::quantise(&made(&json!({ "splats": sources })), &machine).unwrap_err();
    let told = refused.to_string();
    assert!(told.contains("sums Gaussians of one source"), "{told}");
    // Sums with a single fraction bit, and sums that saturate.
    for coarse in ["U6F1", "U1F14"] {
        let mut coarser = machine.clone();
        coarser.fragment.weight_sum = serde_json::from_value(json!(coarse)).unwrap();
        coarser.fragment.colour_sum = coarser.fragment.weight_sum;
        assert_eq!(fault(&in_lockstep(&scene, &coarser)), None, "{coarse}");
        assert!(draw(&scene, &coarser).1 < psnr, "{coarse}");
    }
}

/// `weighted` with weights that fall with depth.
fn falling(words: &str) -> Machine {
    machines::load("weighted", &[format!("sort.depth_weight={words}")]).unwrap()
}

/// A sum whose weights fall with depth is drawn as well. The scene's distance decides the picture,
/// which is otherwise twice the greatest depth, and is noted where a machine does not use it.
#[test]
fn weights_that_fall_with_depth_are_drawn_well_and_within_bounds() {
    let scene = changed("bouquet", thin);
    let machine = falling("{}");
    let (drawing, psnr) = draw(&scene, &machine);
    assert!(psnr > 70.0, "{psnr}");
    let frame = in_lockstep(&scene, &machine);
    assert_eq!(fault(&frame), None);
    assert!(frame.bound.iter().any(|bound| *bound > 0.0));
    let same = Machine::named("weighted").unwrap();
    assert_ne!(drawing.frame, draw(&scene, &same).0.frame);

    let view = scene.view();
    let greatest = (scene.splats.iter())
        .map(|splat| (view.rotation * (splat.position - view.eye)).z)
        .fold(0.0, f64::max);
    assert!((scene.weight_distance().unwrap() / (2.0 * greatest) - 1.0).abs() < 1e-12);
    let at = |distance: f64| {
        changed("bouquet", |scene| {
            thin(scene);
            scene["sheets"]["weight_distance"] = json!(distance);
        })
    };
    assert_eq!(draw(&at(2.0 * greatest), &machine).0.frame, drawing.frame);
    let nearer = at(0.9 * greatest);
    let (other, psnr) = draw(&nearer, &machine);
    assert_ne!(other.frame, drawing.frame);
    assert!(psnr > 70.0, "{psnr}");
    assert_eq!(fault(&in_lockstep(&nearer, &machine)), None);
    assert!(other.culled.faint > drawing.culled.faint);
    // A distance beyond all powers of two of a record.
    for far in [1e30, 1e-30] {
        assert_eq!(fault(&in_lockstep(&at(far), &machine)), None, "{far}");
    }
    assert_eq!(
        draw(&at(1e30), &machine).0.frame,
        draw(&scene, &same).0.frame
    );
    let notes = quantise::quantise(&nearer, &same).unwrap().notes;
    let is_told = |note: &String| note.starts_with("sheets.weight_distance is ");
    assert_eq!(
        notes.iter().filter(|note| is_told(note)).count(),
        1,
        "{notes:?}"
    );
    let notes = quantise::quantise(&nearer, &machine).unwrap().notes;
    assert!(!notes.iter().any(is_told), "{notes:?}");
    // Coarse words.
    for words in [
        r#"{"share": "U1F3", "weight": "U1F8"}"#,
        r#"{"share": "U1F12S5", "weight": {"format": "U1F2", "round": "truncate"}}"#,
    ] {
        let coarse = falling(words);
        assert_eq!(fault(&in_lockstep(&scene, &coarse)), None, "{words}");
        assert!(draw(&scene, &coarse).1 < psnr, "{words}");
    }
}

/// The bound of nine covered pixels in ten is at most four steps of an 8-bit display.
#[test]
fn most_bounds_are_at_most_four_display_steps() {
    for name in tier::some([12, 12], MEDIA) {
        let scene = load(name);
        let frame = in_lockstep(&scene, &usual(&scene));
        let summary = frame.summary(&frame.led).bound;
        assert!(summary.share_under_4_255 >= 0.9, "{name}: {summary:?}");
    }
}

#[test]
fn no_pixel_of_a_random_machine_exceeds_its_bound() {
    const MACHINES: usize = 60;
    let scenes = ["nested-shells", "bouquet", "bouquet"].map(|name| {
        let fewer = |scene: &mut Value| {
            match name {
                "bouquet" => scene["splats"]["count"] = json!(1500),
                _ => scene["splats"]["volume"]["samples"] = json!(14),
            }
            scene["image"]["width"] = json!(40);
            scene["image"]["height"] = json!(32);
        };
        let mut scene = serde_json::from_str(&Scene::text(name).unwrap()).unwrap();
        fewer(&mut scene);
        of_size(&scene, None)
    });
    let mut runner = TestRunner::deterministic();
    let (mut drawn, mut asked) = (0, 0);
    while drawn < MACHINES {
        asked += 1;
        assert!(
            asked < 100 * MACHINES,
            "only {drawn} of {asked} machines can draw"
        );
        let scene = &scenes[asked % 3];
        let changes = mutations(1..10).new_tree(&mut runner).unwrap().current();
        let named = match asked % 6 {
            2 => Machine::named("weighted").unwrap(),
            5 => falling("{}"),
            _ => usual(scene),
        };
        let machine = changes
            .iter()
            .fold(named, |machine, mutation| mutated(&machine, mutation));
        let Ok(elaborated) = machine.elaborate() else {
            continue;
        };
        let Ok(quantised) = quantise::quantise(scene, &machine) else {
            continue;
        };
        drawn += 1;
        if tier::has([12, 3], drawn) {
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

/// Medical volumes, an engine, and a guitar.
#[test]
fn real_data_is_drawn_well_and_within_bounds() {
    if !tier::runs(Tier::Full) {
        return;
    }
    let head = json!([{"value": 500, "rgb": [0.9, 0.6, 0.45], "opacity": 0}, {"value": 900, "rgb": [0.9, 0.6, 0.45], "opacity": 0.0256063915328388},
        {"value": 1200, "rgb": [0.9, 0.6, 0.45], "opacity": 0.01714462355690158}, {"value": 1500, "rgb": [1, 1, 0.95], "opacity": 0.35100635764012655}]);
    let engine = json!([{"value": 60, "rgb": [0.5, 0.6, 0.7], "opacity": 0}, {"value": 120, "rgb": [0.5, 0.6, 0.7], "opacity": 0.042312003146259235},
        {"value": 180, "rgb": [0.9, 0.6, 0.3], "opacity": 0.08283370068226942}, {"value": 220, "rgb": [1, 0.8, 0.4], "opacity": 0.5407673088982273}]);
    let raw = |file: &str, size: [usize; 3], kind: &str, endian: &str, spacing: [f64; 3]| {
        shared_input::find(file)
            .map(|path| json!({"file": from_root(&path), "size": size, "type": kind, "endian": endian, "spacing": spacing}))
    };
    let cthead = raw(
        "volumes/CThead_256x256x113_u16be.raw",
        [256, 256, 113],
        "u16",
        "big",
        [1.0, 1.0, 2.0],
    );
    let headsq = raw(
        "volumes/headsq_64x64x93_i16le.raw",
        [64, 64, 93],
        "i16",
        "little",
        [3.2, 3.2, 1.5],
    );
    let block = shared_input::find("volumes/engine_256x256x128_u8.nii")
        .map(|path| json!(path.canonicalize().unwrap()));
    let mut scenes = Vec::new();
    for (name, volume, transfer, iso) in [
        ("CThead", cthead, &head, 1400),
        ("headsq", headsq, &head, 1400),
        ("engine", block, &engine, 150),
    ] {
        let Some(volume) = volume else { continue };
        let mut source = json!({"volume": volume, "transfer": transfer});
        // The two large ones take half a minute each: one as a volume, the other as a surface.
        if name != "engine" {
            scenes.push((name.to_owned(), json!({"splats": source})));
        }
        if name != "CThead" {
            source["isovalue"] = json!(iso);
            scenes.push((format!("{name}, flattened"), json!({"splats": source})));
        }
    }
    if let Some(path) = shared_input::find("splats3d/guitar_expanded.ply") {
        scenes.push((
            "guitar".into(),
            json!({"splats": {"file": path.canonicalize().unwrap()}}),
        ));
    }
    for (name, scene) in tier::some([12, 3], scenes) {
        // A surface at its own size: with few pixels, one flip has a large effect. A volume has
        // twenty times as many contributions.
        let is_surface = scene["splats"]["isovalue"].is_number();
        let scene = of_size(&scene, if is_surface { None } else { Some(SIZE) });
        let machine = usual(&scene);
        let (_, psnr) = draw(&scene, &machine);
        assert!(psnr > 55.0, "{name}: {psnr}");
        assert_eq!(fault(&in_lockstep(&scene, &machine)), None, "{name}");
    }
}

/// A path of `data`, relative to the root, because files of a scene must be below its folder.
fn from_root(path: &std::path::Path) -> String {
    let absolute = path.canonicalize().unwrap();
    format!("../../../../../../../../..{}", absolute.display())
}

/// In the limit of flattening, an ellipsoid is a disc, also on the machine.
#[test]
fn a_flat_ellipsoid_is_a_disc() {
    let flat = |flatten: f64| {
        changed("nested-shells", |scene| {
            scene["splats"]["isovalue"] = json!(0.2);
            scene["splats"]["flatten"] = json!(flatten);
        })
    };
    let machine = Machine::named("volume").unwrap();
    let discs = Scene {
        ellipsoids: None,
        ..flat(1e6)
    };
    let (drawing, _) = draw(&discs, &machine);
    let elaborated = fixed::elaborate(&machine).unwrap();
    let picture = fixed::picture(&elaborated, &drawing);
    let psnr: Vec<f64> = [1.5, 4.0, 20.0, 1e5]
        .into_iter()
        .map(|flatten| {
            let scene = flat(flatten);
            assert_eq!(
                scene.ellipsoids.as_ref().unwrap().amplitude,
                Amplitude::Disc
            );
            let (drawing, _) = draw(&scene, &machine);
            metrics(&fixed::picture(&elaborated, &drawing), &picture)
                .psnr_db
                .unwrap_or(f64::INFINITY)
        })
        .collect();
    assert!(psnr.is_sorted() && psnr[3] > 60.0, "{psnr:?}");
}

/// Ten Gaussians at one depth are drawn in the order of the file: the first one hides the other
/// nine.
#[test]
fn equal_depths_keep_their_order() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ten.ply");
    let names = [
        "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2",
        "rot_0", "rot_1", "rot_2", "rot_3",
    ];
    let properties: String = names
        .iter()
        .map(|name| format!("property float {name}\n"))
        .collect();
    let row = |red: f64| {
        format!(
            "0 0 0 {} 0 0 40 -1 -1 -1 1 0 0 0\n",
            (red - 0.5) / 0.28209479
        )
    };
    let order = |reds: &[f64]| {
        let rows: String = reds.iter().map(|red| row(*red)).collect();
        std::fs::write(
            &path,
            format!(
                "ply\nformat ascii 1.0\nelement vertex {}\n{properties}end_header\n{rows}",
                reds.len()
            ),
        )
        .unwrap();
        let scene = load(path.to_str().unwrap());
        let machine = usual(&scene);
        let elaborated = fixed::elaborate(&machine).unwrap();
        let centre = SIZE.0 * SIZE.1 / 2 + SIZE.0 / 2;
        [
            fixed::picture(&elaborated, &draw(&scene, &machine).0),
            in_golden(&scene).picture,
        ]
        .map(|picture| picture.rgba[centre][0])
    };
    let mut reds = [0.1; 10];
    reds[0] = 0.9;
    for red in order(&reds) {
        assert!((red - 0.9).abs() < 0.01, "{red}");
    }
    reds.reverse();
    for red in order(&reds) {
        assert!((red - 0.1).abs() < 0.01, "{red}");
    }
}

/// Each setting changes the picture or the work.
#[test]
fn every_setting_matters() {
    let plain = in_golden(&load("nested-shells"));
    for (path, value) in [
        ("/sheets", json!({"opacity": "linear"})),
        ("/sheets", json!({"stop": 0.5})),
        ("/sheets", json!({"least_weight": 0.05})),
        (
            "/splats/gradient",
            json!([{"magnitude": 5, "factor": 0}, {"magnitude": 50, "factor": 1}]),
        ),
        ("/splats/radius", json!(0.9)),
        ("/kernel", json!({"cutoff": 3})),
    ] {
        let scene = changed("nested-shells", |scene| {
            let (parent, name) = path.rsplit_once('/').unwrap();
            scene.pointer_mut(parent).unwrap()[name] = value.clone();
        });
        assert_ne!(
            in_golden(&scene).picture.rgba,
            plain.picture.rgba,
            "{path} {value}"
        );
    }
    // Sheets are the same in both directions, except for rounding.
    let stopless = |order: &str| {
        in_golden(&changed("nested-shells", |scene| {
            scene["sheets"] = json!({"stop": 0, "order": order})
        }))
    };
    let [front, back] = ["front-to-back", "back-to-front"].map(stopless);
    let apart = front
        .picture
        .rgba
        .as_flattened()
        .iter()
        .zip(back.picture.rgba.as_flattened())
        .map(|(a, b)| (a - b).abs());
    assert!(apart.fold(0.0, f64::max) < 1e-12);
    assert_eq!(front.fragments, back.fragments);
}

#[test]
fn a_scene_that_a_machine_cannot_draw_is_refused() {
    let shells = changed("nested-shells", |scene| {
        scene["splats"]["volume"]["samples"] = json!(12)
    });
    let bouquet = changed("bouquet", |scene| scene["splats"]["count"] = json!(100));
    for (scene, machine, told) in [
        (&shells, "reference", "only discs"),
        (&bouquet, "lean", "only discs"),
        (&bouquet, "volume", "no `sort`"),
    ] {
        let error = quantise::quantise(scene, &Machine::named(machine).unwrap())
            .unwrap_err()
            .to_string();
        assert!(error.contains(told), "{error}");
    }
    let immediate =
        machines::load("gaussian", &["timing.organisation=\"immediate\"".into()]).unwrap();
    assert!(
        fixed::elaborate(&immediate)
            .unwrap_err()
            .to_string()
            .contains("a sort needs all splats first")
    );
}

/// A voxel 4 wide and 1 high is enlarged in both directions by the factor that makes its smallest
/// width that of the filter.
#[test]
fn scaled_kernels_are_as_wide_as_the_filter_and_emit_as_much() {
    let of = |by: &str| {
        changed("fuzzy-clouds", |scene| {
            scene["splats"]["volume"]["samples"] = json!(24);
            scene["kernel"] = json!({"low_pass": 25.0, "low_pass_by": by});
        })
    };
    let (convolved, scaled) = (of("convolution"), of("scaling"));
    assert_eq!(
        (convolved.kernel.low_pass, scaled.kernel.low_pass),
        (25.0, 0.0)
    );
    let view = scaled.view();
    let thinnest = scaled
        .ellipsoids
        .as_ref()
        .unwrap()
        .orientation(0)
        .scales
        .min_element();
    let mut enlarged = 0;
    for (before, after) in convolved.splats.iter().zip(&scaled.splats) {
        let px = |splat: &Splat| {
            view.focal_px[0] * splat.radius * thinnest
                / (view.rotation * (splat.position - view.eye)).z
        };
        assert!(
            (px(after) - px(before).max(5.0)).abs() < 1e-9,
            "{} {}",
            px(before),
            px(after)
        );
        let emitted = |splat: &Splat| splat.opacity * splat.radius * splat.radius;
        assert!((emitted(after) / emitted(before) - 1.0).abs() < 1e-12);
        enlarged += u32::from(after.radius > before.radius);
    }
    assert!(enlarged > 0);
    let machine = usual(&scaled);
    assert!(draw(&scaled, &machine).1 > 55.0);
    assert_eq!(fault(&in_lockstep(&scaled, &machine)), None);
}

#[test]
fn scaling_and_culling_are_refused_without_a_kernel_or_a_back() {
    let told = |scene: Value| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.json");
        std::fs::write(&path, scene.to_string()).unwrap();
        Scene::load(path.to_str().unwrap(), &Overrides::default())
            .unwrap_err()
            .to_string()
    };
    for splats in [
        json!({"builtin": "torus-knot"}),
        json!({"gaussians": "bouquet"}),
    ] {
        let sentence = told(json!({"splats": splats, "kernel": {"low_pass_by": "scaling"}}));
        assert!(
            sentence.contains("only the kernels of a volume are scaled"),
            "{sentence}"
        );
    }
    for splats in [
        json!({"volume": {"builtin": "fuzzy-clouds", "samples": 8}}),
        json!({"gaussians": "bouquet"}),
    ] {
        let sentence = told(json!({"splats": splats, "surface": {"cull_backfaces": true}}));
        assert!(
            sentence.contains("neither voxels nor Gaussians have a back"),
            "{sentence}"
        );
    }
}

/// The pixel traces of every ninth pixel.
#[test]
fn a_pixel_trace_ends_with_the_colour_of_the_picture() {
    for (name, scene) in tier::some([12, 3], scenes()) {
        let scene = Scene {
            image: scene::Image {
                width: 40,
                height: 32,
                ..scene.image
            },
            ..scene
        };
        let golden = in_golden(&scene);
        for index in (0..40 * 32).step_by(47) {
            let trace =
                golden::pixel_trace(&scene, &golden::Rules::default(), index % 40, index / 40);
            assert_eq!(trace.rgba, golden.picture.rgba[index], "{name}");
            assert_eq!(
                !trace.contributions.is_empty(),
                golden.picture.covered[index],
                "{name}"
            );
            assert_eq!(
                trace.layers.len(),
                usize::from(golden.picture.covered[index]),
                "{name}"
            );
        }
    }
}

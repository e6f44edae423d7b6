//! Attribution: mixed precision draws some words in their formats and the others in f64. With no
//! word in its format it draws `golden`, with every word the machine.

use crate::handmade::thinned;
use crate::mutation::{differences, mutated, mutations, named};
use crate::tier::{self, Tier};
use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::TestRunner;
use rtl_model::Machine;
use rtl_model::machine::{Operators, Rows};
use rtl_model::num::{Format, Word};
use serde_json::json;
use splatsim::accuracy::attribution::{Share, attribute};
use splatsim::accuracy::partial::{ChosenWords, MixedDrawing, UNITS, words};
use splatsim::accuracy::{distance, metrics};
use splatsim::golden;
use splatsim::golden::Rendering;
use splatsim::hardware::quantise::{Quantised, quantise};
use splatsim::hardware::{fixed, machines};
use splatsim::output::picture::Picture;
use splatsim::scene::{Overrides, Scene};

const SCENES: [&str; 4] = ["glass-spheres", "checkerboard", "torus-knot", "terrain"];

fn scene(name: &str, size: (usize, usize)) -> Scene {
    Scene::load(name, &Overrides { size: Some(size) }).unwrap()
}

fn golden(scene: &Scene, machine: &Machine) -> Rendering {
    golden::render(scene, &fixed::rules(machine))
}

fn drawn(scene: &Scene, machine: &Machine) -> Option<(Quantised, Picture)> {
    let elaborated = machine.elaborate().ok()?;
    let quantised = quantise(scene, machine).ok()?;
    let fixed = fixed::picture(&elaborated, &fixed::draw(&elaborated, &quantised));
    Some((quantised, fixed))
}

/// Draws with those words in their formats for which the predicate holds.
fn mixed(
    scene: &Scene,
    machine: &Machine,
    quantised: &Quantised,
    is_chosen: impl Fn(&str) -> bool,
) -> Picture {
    let elaborated = machine.elaborate().unwrap();
    let stage = MixedDrawing::new(scene, &elaborated, quantised);
    let choice = ChosenWords::new(&elaborated, is_chosen);
    stage.fill(&choice, &stage.set_up(&choice))
}

/// Number of pixels that differ in any bit.
fn different(a: &Picture, b: &Picture) -> usize {
    let colours = a.rgba.iter().zip(&b.rgba).filter(|(a, b)| a != b).count();
    colours
        + a.covered
            .iter()
            .zip(&b.covered)
            .filter(|(a, b)| a != b)
            .count()
}

/// Volumes in either order and by either law, one of them with a flattened surface, and Gaussians;
/// each with its machine. And discs on a machine for Gaussians.
fn of_ellipsoids(size: (usize, usize)) -> Vec<(Scene, Machine)> {
    let texts = [
        json!({"splats": {"volume": {"builtin": "nested-shells", "samples": 48},
            "transfer": [{"value": 0.1, "rgb": [0.2, 0.4, 1], "opacity": 0}, {"value": 1, "rgb": [1, 0.2, 0.1], "opacity": 0.49929179534464957}]}}),
        json!({"splats": {"volume": {"builtin": "fuzzy-clouds", "samples": 32}},
            "sheets": {"order": "back-to-front", "opacity": "linear"}, "materials": [{"unlit": true}]}),
        json!({"splats": {"volume": {"builtin": "marschner-lobb", "samples": 32}, "isovalue": 0.5}}),
        json!({"splats": {"gaussians": "bouquet", "count": 3000, "degree": 3}}),
        json!({"splats": {"gaussians": "bouquet", "count": 3000}, "sheets": {"stop": 0.05, "keep_last": true, "least_weight": 0.1, "most_weight": 0.5}}),
    ];
    let folder = tempfile::tempdir().unwrap();
    let read = |(nth, text): (usize, serde_json::Value)| {
        let path = folder.path().join(format!("{nth}.json"));
        std::fs::write(&path, text.to_string()).unwrap();
        let scene = scene(path.to_str().unwrap(), size);
        let machine = Machine::named(machines::usual(&scene)).unwrap();
        (scene, machine)
    };
    let mut all: Vec<_> = texts.into_iter().enumerate().map(read).collect();
    let bouquet = all[3].0.clone();
    for name in ["fp16", "mixed", "weighted"] {
        all.push((bouquet.clone(), Machine::named(name).unwrap()));
    }
    for (name, change) in [
        ("weighted", "sort.depth_weight={}"),
        ("mixed", "operators=rounded"),
    ] {
        let machine = machines::load(name, &[change.to_owned()]).unwrap();
        all.push((bouquet.clone(), machine));
    }
    let rounding = machines::load("fp16", &["operators=rounded".to_owned()]).unwrap();
    all.push((thinned(scene("torus-knot", size), 5_000), rounding));
    all
}

fn surfaces(size: (usize, usize)) -> Vec<(Scene, Machine)> {
    let names = Machine::NAMES.into_iter().chain(Machine::WINDOW_NAMES);
    let on = |name| {
        let scene = thinned(scene(name, size), 20_000);
        names
            .clone()
            .map(move |machine| (scene.clone(), Machine::named(machine).unwrap()))
    };
    SCENES.into_iter().flat_map(on).collect()
}

#[test]
fn with_no_word_it_is_golden() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    for (scene, machine) in tier::some(
        [12, 6],
        surfaces((96, 80))
            .into_iter()
            .chain(of_ellipsoids((64, 48))),
    ) {
        let (quantised, _) = drawn(&scene, &machine).unwrap();
        let found = metrics(
            &mixed(&scene, &machine, &quantised, |_| false),
            &golden(&scene, &machine).picture,
        );
        assert!(
            found.max_error < 1e-12,
            "{} on {}: {found:?}",
            scene.name,
            machine.name
        );
    }
}

/// Bit for bit, although it computes in f64: a second implementation of every unit, quantisation
/// and rule.
#[test]
fn with_every_word_it_is_the_machine() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    for (scene, mut machine) in tier::some(
        [12, 6],
        surfaces((192, 160))
            .into_iter()
            .chain(of_ellipsoids((96, 80))),
    ) {
        for rows in [Rows::Seeded, Rows::Differenced, Rows::Direct] {
            machine.raster.rows = rows;
            machine.raster.square =
                (rows == Rows::Direct).then(|| Word::new(Format::signed(20, 10)));
            let (quantised, fixed) = drawn(&scene, &machine).unwrap();
            let mixed = mixed(&scene, &machine, &quantised, |_| true);
            assert_eq!(
                different(&mixed, &fixed),
                0,
                "{} on {}, {rows:?}",
                scene.name,
                machine.name
            );
        }
    }
}

/// The picture without a probe too: the host's kernels have no operators that round.
#[test]
fn with_every_word_it_is_a_machine_whose_operators_round() {
    let rounding = |(_, machine): &(Scene, Machine)| machine.operators == Operators::Rounded;
    let all: Vec<_> = (of_ellipsoids((48, 40)).into_iter().filter(rounding)).collect();
    assert_eq!(all.len(), 2);
    for (scene, machine) in all {
        let (quantised, fixed) = drawn(&scene, &machine).unwrap();
        let mixed = mixed(&scene, &machine, &quantised, |_| true);
        assert_eq!(different(&mixed, &fixed), 0, "{}", scene.name);
        let exact = Machine {
            operators: Operators::Exact,
            ..machine
        };
        let (_, exact) = drawn(&scene, &exact).unwrap();
        assert_ne!(different(&exact, &fixed), 0, "{}", scene.name);
    }
}

/// Words, tables, roundings and rules that no designer would choose.
#[test]
fn with_every_word_it_is_any_machine() {
    const MACHINES: usize = 200;
    let clouds = [
        scene("torus-knot", (48, 40)),
        scene("glass-spheres", (40, 40)),
    ]
    .map(|scene| (thinned(scene, 2000), None));
    let ellipsoids = of_ellipsoids((24, 20))
        .into_iter()
        .map(|(scene, machine)| (scene, Some(machine)));
    let scenes: Vec<(Scene, Option<Machine>)> = clouds.into_iter().chain(ellipsoids).collect();
    let mut runner = TestRunner::deterministic();
    let (mut held, mut asked) = (0, 0);
    while held < tier::of([12, 6], MACHINES) {
        asked += 1;
        assert!(
            asked < 100 * MACHINES,
            "only {held} of {asked} machines can draw"
        );
        let pick = (named(), mutations(1..12))
            .new_tree(&mut runner)
            .unwrap()
            .current();
        if !tier::has([12, 6], asked) {
            continue;
        }
        let (scene, usual) = &scenes[asked % scenes.len()];
        let base = usual
            .clone()
            .unwrap_or_else(|| Machine::named(pick.0).unwrap());
        let machine = pick
            .1
            .iter()
            .fold(base, |machine, mutation| mutated(&machine, mutation));
        let Some((quantised, fixed)) = drawn(scene, &machine) else {
            continue;
        };
        held += 1;
        let mixed = mixed(scene, &machine, &quantised, |_| true);
        assert_eq!(
            different(&mixed, &fixed),
            0,
            "{} on {} {:?}",
            scene.name,
            machine.name,
            differences(&machine)
        );
    }
}

fn named_share<'a>(shares: &'a [Share], name: &str) -> &'a Share {
    shares
        .iter()
        .find(|share| share.name == name)
        .unwrap_or_else(|| panic!("{name} has no share"))
}

/// One narrowed word of a good machine has the largest share of the error, and so has its unit.
#[test]
fn a_narrowed_word_has_the_largest_share_of_the_error() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let cloud = thinned(scene("glass-spheres", (48, 48)), 3000);
    let [(shells, _), .., (bouquet, _), _] = &of_ellipsoids((24, 20))[..] else {
        panic!("there are more")
    };
    for (scene, settings, name) in tier::some(
        [12, 12],
        [
            (&cloud, "splat.rgb=U1F4", "splat.rgb"),
            (
                &cloud,
                "ellipse.root.newton_steps=0 ellipse.root.table_bits=3",
                "ellipse.root",
            ),
            (&cloud, "gauss.falloff=U1F3", "gauss.falloff"),
            (&cloud, "shade.rgb=U1F4", "shade.rgb"),
            (shells, "fragment.sheets.ratio=U1F4", "fragment.ratio"),
            (bouquet, "ellipse.ellipsoid.scale=U1F4", "ellipse.scale"),
            (bouquet, "sort.key=U18F0", "sort.key"),
        ],
    ) {
        let base = if scene.name == "glass-spheres" {
            "reference"
        } else {
            machines::usual(scene)
        };
        let machine = machines::load(
            base,
            &settings.split(' ').map(String::from).collect::<Vec<_>>(),
        )
        .unwrap();
        let elaborated = fixed::elaborate(&machine).unwrap();
        let (quantised, _) = drawn(scene, &machine).unwrap();
        let found = attribute(
            scene,
            &elaborated,
            &quantised,
            &golden(scene, &machine).picture,
        );
        let unit = name.split('.').next().unwrap();
        for (shares, name) in [(&found.words, name), (&found.units, unit)] {
            let blamed = named_share(shares, name);
            let db = |share: &Share| share.alone.psnr_covered_db.unwrap_or(f64::INFINITY);
            assert!(
                shares
                    .iter()
                    .all(|share| share.name == name || db(share) > db(blamed) + 6.0),
                "{settings}: {name} among {shares:#?}"
            );
            let (all, without) = (
                found.all.psnr_covered_db.unwrap(),
                blamed.without.psnr_covered_db.unwrap_or(f64::INFINITY),
            );
            assert!(
                without > all + 6.0,
                "{settings}: {all} dB, without {name} {without} dB"
            );
        }
    }
}

#[test]
fn all_words_together_make_the_machines_error() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let cloud = thinned(scene("torus-knot", (64, 48)), 2000);
    let surfaces = Machine::NAMES.map(|name| (cloud.clone(), Machine::named(name).unwrap()));
    for (scene, machine) in tier::some(
        [12, 6],
        surfaces
            .into_iter()
            .chain(of_ellipsoids((20, 16)).into_iter().step_by(3)),
    ) {
        let name = &machine.name;
        let elaborated = fixed::elaborate(&machine).unwrap();
        let (quantised, picture) = drawn(&scene, &machine).unwrap();
        let golden = golden(&scene, &machine).picture;
        let found = attribute(&scene, &elaborated, &quantised, &golden);
        assert_eq!(found.all, distance(&picture, &golden), "{name}");
        let units: Vec<&str> = UNITS
            .into_iter()
            .filter(|unit| {
                (*unit != "sort" || machine.sorting().is_some())
                    && (*unit != "contribution" || machine.contribution.is_some())
                    && (*unit != "colour" || machine.colour.is_some())
                    && (*unit != "reflect" || machine.reflect.is_some())
            })
            .collect();
        assert_eq!(
            found
                .units
                .iter()
                .map(|share| &share.name)
                .collect::<Vec<_>>(),
            units
        );
        // Each word belongs to one unit, and each unit has words.
        for unit in units {
            assert!(
                found
                    .words
                    .iter()
                    .any(|share| share.name.starts_with(&format!("{unit}."))),
                "{unit} has no words"
            );
        }
    }
}

/// The eye is among the splats: some are behind it, outside the view, before the near plane, or
/// edge-on.
#[test]
fn culled_splats_have_no_share_of_the_error() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let mut scene = thinned(scene("torus-knot", (48, 40)), 1000);
    scene.camera.eye = scene
        .splats
        .iter()
        .map(|splat| splat.position)
        .sum::<glam::DVec3>()
        / scene.splats.len() as f64;
    let edge_on = scene.splats[0].position;
    scene.splats[0].normal = (edge_on - scene.camera.eye)
        .any_orthonormal_vector()
        .normalize();
    for name in tier::some([3, 3], Machine::NAMES) {
        let machine = Machine::named(name).unwrap();
        let elaborated = fixed::elaborate(&machine).unwrap();
        let (quantised, picture) = drawn(&scene, &machine).unwrap();
        let golden = golden(&scene, &machine);
        assert!(
            golden.culled.near > 0 && golden.culled.outside > 0 && golden.fragments > 0,
            "{:?}",
            golden.culled
        );
        assert_eq!(
            attribute(&scene, &elaborated, &quantised, &golden.picture).all,
            distance(&picture, &golden.picture),
            "{name}"
        );
    }
}

/// Every format of the description is one of the attributed words, except formats that are not read
/// as numbers.
#[test]
fn every_format_is_attributed() {
    let machine = Machine::named("reference").unwrap();
    let words = words(&fixed::elaborate(&machine).unwrap());
    let description = serde_json::to_value(&machine).unwrap();
    for unit in UNITS
        .into_iter()
        .filter(|unit| !description[unit].is_null())
    {
        for (field, value) in description[unit].as_object().unwrap() {
            let is_format = value.is_string() && value.as_str().unwrap().contains('F')
                || value.get("format").is_some()
                || value.get("bits").is_some();
            if is_format {
                assert!(
                    words.contains(&format!("{unit}.{field}")),
                    "{unit}.{field} is not a word"
                );
            }
        }
    }
}

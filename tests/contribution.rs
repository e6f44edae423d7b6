//! Does a contribution test lose what golden's loses, within the bounds of its words, and is it
//! followed by mixed precision, recordings and refusals?

use crate::mutation::{differences, mutated, mutations};
use crate::tier;
use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::TestRunner;
use rtl_model::Machine;
use rtl_model::machine::{Contribution, Leaders};
use rtl_model::num::{Rounding, Word};
use serde_json::{Value, json};
use splatsim::accuracy::partial::{ChosenWords, MixedDrawing, words};
use splatsim::accuracy::{lockstep, metrics};
use splatsim::golden;
use splatsim::hardware::{fixed, quantise};
use splatsim::output::picture::Picture;
use splatsim::performance::cost::Prices;
use splatsim::performance::recording::Recording;
use splatsim::scene::{Overrides, Scene};

/// Gaussians of all sizes, most of them small.
fn bouquet(count: u32, size: [u32; 2], sheets: &Value) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    let scene = json!({
        "splats": {"gaussians": "bouquet", "count": count},
        "image": {"width": size[0], "height": size[1]},
        "sheets": sheets,
    });
    std::fs::write(&path, scene.to_string()).unwrap();
    Scene::load(path.to_str().unwrap(), &Overrides { size: None }).unwrap()
}

/// Offset, square, product, conic, cross and radial index.
const WIDE: [&str; 6] = ["I15F10", "U18F8", "I18F8", "U2F20", "I3F20", "U18F12"];
const NARROW: [[&str; 6]; 5] = [
    [
        "I15F12S11",
        "U20F11S4",
        "I20F12S3",
        "U2F24S4",
        "I3F23S3",
        "U6F14S4",
    ],
    [
        "I8F24S11",
        "U16F12S4",
        "FP8(E4M3)",
        "U2F20S2",
        "FP8(E4M3)",
        "U6F6S2",
    ],
    ["I1F0", "U1F0", "I1F0", "U1F0", "I1F0", "U1F0"],
    ["I3F0", "U2F1", "I2F1", "U1F1", "I1F1", "U4F0"],
    ["I8F0", "U9F0", "I9F0", "U0F3", "I1F2", "U6F0"],
];

fn tested(name: &str, formats: [&str; 6], block_px: u32, leaders: Leaders) -> Machine {
    let mut formats = formats.into_iter();
    let mut word =
        || Word::new(formats.next().unwrap().parse().unwrap()).rounded(Rounding::Nearest);
    Machine {
        contribution: Some(Contribution {
            block_px,
            leaders,
            offset: word(),
            square: word(),
            product: word(),
            conic: word(),
            conic_cross: word(),
            radial: word(),
        }),
        ..Machine::named(name).unwrap()
    }
}

fn draw(scene: &Scene, machine: &Machine) -> Picture {
    let elaborated = fixed::elaborate(machine).unwrap();
    let drawing = fixed::draw(&elaborated, &quantise::quantise(scene, machine).unwrap());
    fixed::picture(&elaborated, &drawing)
}

fn psnr(one: &Picture, other: &Picture) -> f64 {
    metrics(one, other).psnr_db.unwrap_or(f64::INFINITY)
}

fn mixed(scene: &Scene, machine: &Machine, is_chosen: impl Fn(&str) -> bool) -> Picture {
    let elaborated = fixed::elaborate(machine).unwrap();
    let quantised = quantise::quantise(scene, machine).unwrap();
    let stage = MixedDrawing::new(scene, &elaborated, &quantised);
    let choice = ChosenWords::new(&elaborated, is_chosen);
    stage.fill(&choice, &stage.set_up(&choice))
}

/// The error of the method is golden's, and more leaders and smaller blocks lose less.
#[test]
fn a_machine_with_wide_words_draws_what_golden_draws() {
    let scene = bouquet(3000, [96, 80], &json!({}));
    let ideal = golden::ideal(&scene).picture;
    let plain = Machine::named("gaussian").unwrap();
    let untested = golden::render(&scene, &fixed::rules(&plain)).picture;
    let mut method = vec![psnr(&untested, &ideal)];
    for (block_px, leaders) in [
        (4, Leaders::Corners),
        (4, Leaders::Diagonal),
        (8, Leaders::Diagonal),
    ] {
        let machine = tested("gaussian", WIDE, block_px, leaders);
        let golden = golden::render(&scene, &fixed::rules(&machine)).picture;
        let drawn = draw(&scene, &machine);
        let own = psnr(&drawn, &golden);
        assert!(own > 45.0, "{block_px} {leaders:?}: {own}");
        assert!(
            psnr(&drawn, &draw(&scene, &plain)) < own,
            "it loses nothing"
        );
        method.push(psnr(&golden, &ideal));
    }
    assert!(method.is_sorted_by(|one, next| one > next), "{method:?}");
}

#[test]
fn no_decision_differs_without_its_bound() {
    let scenes = [
        bouquet(1500, [40, 32], &json!({})),
        bouquet(1500, [40, 32], &json!({"stop": 0.3, "least_weight": 0.1})),
        bouquet(1500, [40, 32], &json!({"least_weight": 0})),
    ];
    let mut runner = TestRunner::deterministic();
    let (mut drawn, mut asked, mut flips) = (0, 0, 0);
    let wanted = tier::of([3, 3], 60);
    while drawn < wanted {
        asked += 1;
        assert!(asked < 100 * wanted, "only {drawn} of {asked} can draw");
        let scene = &scenes[asked % 3];
        let formats = [&NARROW[..], &[WIDE]].concat()[asked % 6];
        let leaders = [Leaders::Corners, Leaders::Diagonal][asked / 6 % 2];
        let base = tested(
            ["gaussian", "fp16"][asked % 2],
            formats,
            [4, 8][asked / 12 % 2],
            leaders,
        );
        let changes = mutations(0..5).new_tree(&mut runner).unwrap().current();
        let machine = changes
            .iter()
            .fold(base, |machine, change| mutated(&machine, change));
        let (Ok(elaborated), Ok(quantised)) =
            (machine.elaborate(), quantise::quantise(scene, &machine))
        else {
            continue;
        };
        drawn += 1;
        let frame = lockstep(scene, &elaborated, &quantised);
        assert!(
            frame.violations == 0 && frame.flips.unexplained == 0,
            "{} violations, {:?} of {:?}",
            frame.violations,
            frame.flips,
            differences(&machine)
        );
        flips += frame.flips.coverage;
    }
    assert!(flips > 1000, "{flips}: no decision was near its bound");
}

#[test]
fn mixed_precision_follows_the_test() {
    let scene = bouquet(2000, [64, 48], &json!({}));
    // Errors of these words only, in dB.
    let mut alone = Vec::new();
    for formats in [WIDE, NARROW[0], NARROW[4]] {
        let machine = tested("gaussian", formats, 4, Leaders::Corners);
        let all = words(&fixed::elaborate(&machine).unwrap());
        assert!(all.contains(&"contribution.radial".to_owned()), "{all:?}");
        let golden = golden::render(&scene, &fixed::rules(&machine)).picture;
        let none = metrics(&mixed(&scene, &machine, |_| false), &golden);
        assert!(none.max_error < 1e-9, "{none:?}");
        let whole = metrics(&mixed(&scene, &machine, |_| true), &draw(&scene, &machine));
        assert!(whole.max_error == 0.0, "{formats:?}: {whole:?}");
        let own = mixed(&scene, &machine, |word| word.starts_with("contribution."));
        alone.push(psnr(&own, &golden));
    }
    assert!(alone.is_sorted_by(|one, next| one > next), "{alone:?}");
}

#[test]
fn a_recording_has_the_masks() {
    let scene = bouquet(1000, [64, 48], &json!({}));
    let machine = tested("gaussian", WIDE, 4, Leaders::Corners);
    let elaborated = fixed::elaborate(&machine).unwrap();
    let quantised = quantise::quantise(&scene, &machine).unwrap();
    let (_, _, work) = fixed::draw_measured(&elaborated, &quantised);
    let recording = Recording {
        scene: "bouquet".into(),
        machine,
        work,
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("work");
    recording.clone().write(&path).unwrap();
    let read = Recording::read(&path).unwrap();
    assert_eq!(read, recording);
    let cycles = |set: &str| {
        let mut read = read.clone();
        read.set(set).unwrap();
        read.replay_priced(&[], false, false, &Prices::default())
            .unwrap()
    };
    let [slow, fast] = [1, 8].map(|blocks| cycles(&format!("timing.contribution.blocks={blocks}")));
    let masks = |replayed: &splatsim::performance::recording::Replayed| {
        replayed.cycles.tile_tests.unwrap().masks.unwrap()
    };
    assert!(masks(&slow).subtiles_set < masks(&slow).subtiles_tested);
    assert_eq!(masks(&slow).subtiles_set, masks(&fast).subtiles_set);
    assert!(masks(&slow).list_cycles > masks(&fast).list_cycles);
    assert!(slow.cycles.total > fast.cycles.total);
    assert!(slow.cost.cost.area < fast.cost.cost.area);
    // The masks are not those of another record.
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 4]).unwrap();
    let error = Recording::read(&path).unwrap_err().to_string();
    assert!(error.contains("damaged"), "{error}");
}

#[test]
fn surfaces_and_volumes_are_refused() {
    let machine = tested("gaussian", WIDE, 4, Leaders::Corners);
    for name in ["torus-knot", "nested-shells"] {
        let scene = Scene::load(
            name,
            &Overrides {
                size: Some((32, 32)),
            },
        );
        let scene = scene.unwrap_or_else(|error| panic!("{error}"));
        let error = quantise::quantise(&scene, &machine)
            .unwrap_err()
            .to_string();
        assert!(error.contains("contribution"), "{name}: {error}");
    }
}

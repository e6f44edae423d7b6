//! Random scenes on random machines: is every scene that can be read drawn, or refused in one
//! sentence?
//!
//! The scenes have one or several kinds of splats, placements, mirrors, trees, one or many cameras,
//! and any rules. The machines are all named ones with changed fields, with and without a unit that
//! reflects. The cases are the same in every run; `PROPTEST_CASES=10000` draws that many others.

use crate::mutation::{Mutation, mutated, mutations};
use crate::tier;
use proptest::prelude::*;
use proptest::sample::select;
use proptest::test_runner::{RngAlgorithm, TestCaseError, TestError, TestRng, TestRunner};
use rtl_model::Machine;
use serde_json::{Map, Value, json};
use splatsim::error::{Error, Result};
use splatsim::hardware::{fixed, machines};
use splatsim::run::detail::bounded;
use splatsim::run::{self, Options, sequence};
use splatsim::scene::{Overrides, Scene, Sequence};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Fields of an object, each present in three of ten cases.
fn some_of(fields: Vec<(&'static str, BoxedStrategy<Value>)>) -> BoxedStrategy<Value> {
    let one = |(name, value)| {
        prop::option::weighted(0.3, value).prop_map(move |value| value.map(|value| (name, value)))
    };
    fields
        .into_iter()
        .map(one)
        .collect::<Vec<_>>()
        .prop_map(|fields| Value::Object(named(fields.into_iter().flatten())))
        .boxed()
}

fn named<'a>(fields: impl Iterator<Item = (&'a str, Value)>) -> Map<String, Value> {
    fields
        .map(|(name, value)| (name.to_owned(), value))
        .collect()
}

fn number(range: std::ops::Range<f64>) -> BoxedStrategy<Value> {
    range.prop_map(Value::from).boxed()
}

fn of<T: Into<Value> + Clone + std::fmt::Debug + 'static>(
    values: impl Into<Vec<T>>,
) -> BoxedStrategy<Value> {
    select(values.into()).prop_map(Into::into).boxed()
}

fn flag() -> BoxedStrategy<Value> {
    any::<bool>().prop_map(Value::from).boxed()
}

fn three(range: std::ops::Range<f64>) -> BoxedStrategy<Value> {
    [range.clone(), range.clone(), range]
        .prop_map(|numbers| json!(numbers))
        .boxed()
}

/// One or a few splats, of any material of a scene.
fn discs() -> BoxedStrategy<Value> {
    let material = select(vec![0, 0, 0, 1, 2]).prop_map(Value::from).boxed();
    let more = some_of(vec![
        ("rgb", three(0.0..1.0)),
        ("opacity", number(0.0..1.0)),
        ("material", material),
        ("normal", three(-1.0..1.0)),
    ]);
    let splat = ([-1.0..1.0, -1.0..1.0, -1.0..1.0f64], 0.01..0.8f64, more).prop_map(
        |(position, radius, mut splat)| {
            splat["position"] = json!(position);
            splat["radius"] = json!(radius);
            splat
        },
    );
    prop::collection::vec(splat, 1..12)
        .prop_map(Value::Array)
        .boxed()
}

/// Splats of one kind.
fn source() -> BoxedStrategy<Value> {
    let builtin = (
        select(vec![
            "glass-spheres",
            "checkerboard",
            "torus-knot",
            "terrain",
        ]),
        1..60u32,
        any::<bool>(),
    );
    let builtin = builtin
        .prop_map(|(name, count, mixed)| json!({"builtin": name, "count": count, "order": if mixed { "random" } else { "surface" }}));
    let gaussians = (1..40u32).prop_map(|count| json!({"gaussians": "bouquet", "count": count}));
    let fields = some_of(vec![
        ("radius", number(0.2..2.0)),
        ("layer", number(0.01..1.0)),
        ("isovalue", number(0.0..1.0)),
        ("flatten", of([1.0, 10.0, 1e6])),
        ("material", of([0, 1, 2])),
    ]);
    let volume = (
        select(vec!["marschner-lobb", "nested-shells", "fuzzy-clouds"]),
        2..7u32,
        fields,
    )
        .prop_map(|(name, samples, mut source)| {
            source["volume"] = json!({"builtin": name, "samples": samples});
            source
        });
    let one = prop_oneof![3 => discs(), 2 => builtin, 2 => gaussians, 2 => volume];
    let place = some_of(vec![
        ("scale", number(0.1..3.0)),
        ("axis", three(-1.0..1.0)),
        ("degrees", number(-180.0..180.0)),
        ("move", three(-1.0..1.0)),
    ]);
    let placed =
        (one.clone(), place).prop_map(|(splats, place)| json!({"splats": splats, "place": place}));
    prop_oneof![4 => one, 1 => placed].boxed()
}

fn camera() -> BoxedStrategy<Value> {
    some_of(vec![
        ("eye", three(-4.0..4.0)),
        ("target", three(-0.5..0.5)),
        ("up", three(-1.0..1.0)),
        ("fov_y_degrees", of([1.0, 30.0, 45.0, 100.0, 170.0])),
        ("near", of([1e-3, 0.5, 3.0])),
    ])
}

/// One camera, several, or a path: a field of a scene and its value.
fn cameras() -> BoxedStrategy<(&'static str, Value)> {
    let key = |at: usize, camera: Value| {
        let mut key = camera;
        key["at"] = json!(at);
        key
    };
    let keys = prop::collection::vec(camera(), 1..3).prop_map(move |cameras| {
        let keys: Vec<Value> = cameras
            .into_iter()
            .enumerate()
            .map(|(nth, camera)| key(2 * nth, camera))
            .collect();
        ("camera_path", json!({"keys": keys}))
    });
    let pan = (camera(), -2.0..2.0f64).prop_map(|(camera, pan)| {
        (
            "camera_path",
            json!({"pan_pixels": pan, "frames": 2, "camera": camera}),
        )
    });
    prop_oneof![
        5 => camera().prop_map(|camera| ("camera", camera)),
        1 => prop::collection::vec(camera(), 1..3).prop_map(|cameras| ("cameras", json!(cameras))),
        1 => keys,
        1 => pan,
    ]
    .boxed()
}

fn materials() -> BoxedStrategy<Value> {
    let material = some_of(vec![
        ("unlit", flag()),
        ("ambient", number(0.0..1.0)),
        ("diffuse", number(0.0..1.0)),
        ("specular", number(0.0..1.0)),
        ("shininess", of([0.0, 1.0, 32.0, 1e4])),
        ("reflect", of([0.0, 0.4, 1.0])),
        ("tint", three(0.0..1.0)),
    ]);
    prop::collection::vec(material, 3..5)
        .prop_map(Value::Array)
        .boxed()
}

fn scenes() -> BoxedStrategy<Value> {
    let splats = prop_oneof![2 => source(), 3 => prop::collection::vec(source(), 1..4).prop_map(Value::Array)];
    let light = (three(-1.0..1.0), three(0.0..2.0))
        .prop_map(|(direction, rgb)| json!({"direction": direction, "rgb": rgb}));
    let budget = some_of(vec![
        ("splats", of([1, 5, 50])),
        ("bytes", of([100, 10_000])),
        ("cycles", of([1000, 100_000])),
    ]);
    let detail = some_of(vec![
        ("pixels", of([0.0, 1.0, 8.0])),
        ("order", of(["walk", "coarse-to-fine"])),
        ("cull", flag()),
        ("ahead", of([1, 8])),
        ("children", of([2, 4])),
        ("budget", budget),
    ]);
    let kernel = some_of(vec![
        ("cutoff", of([0.1, 1.0, 4.0, 11.0])),
        ("low_pass", of([0.0, 0.3, 1.0, 50.0])),
        ("guard", of([0.5, 1.5, 100.0])),
        ("jacobian", of([0.1, 1.3])),
        ("low_pass_by", of(["convolution", "scaling"])),
        ("filter", of(["ewa", "elliptical"])),
    ]);
    let surface = some_of(vec![
        ("z_threshold", of([1e-3, 0.1, 5.0])),
        ("coverage_threshold", of([1e-3, 0.4, 1.0])),
        ("cull_backfaces", flag()),
    ]);
    let sheets = some_of(vec![
        ("order", of(["front-to-back", "back-to-front"])),
        ("opacity", of(["linear", "exponential"])),
        ("stop", of([0.0, 0.01])),
        ("keep_last", flag()),
        ("least_weight", of([0.0, 0.01])),
        ("most_weight", of([0.5, 1.0])),
    ]);
    let background = [0.0..1.0, 0.0..1.0, 0.0..1.0, 0.0..1.0f64]
        .prop_map(|background| json!(background))
        .boxed();
    let image = (
        1..24u32,
        1..24u32,
        some_of(vec![("background", background)]),
    )
        .prop_map(|(width, height, mut image)| {
            image["width"] = json!(width);
            image["height"] = json!(height);
            image
        });
    let more = some_of(vec![
        ("kernel", kernel),
        ("surface", surface),
        ("sheets", sheets),
        ("level_of_detail", detail),
        (
            "lights",
            prop::collection::vec(light, 0..3)
                .prop_map(Value::Array)
                .boxed(),
        ),
    ]);
    // Without these fields many splats would have undefined materials.
    let materials = prop::option::weighted(0.7, materials());
    (splats, cameras(), image, more, materials)
        .prop_map(|(splats, (which, cameras), image, mut scene, materials)| {
            scene["splats"] = splats;
            scene[which] = cameras;
            scene["image"] = image;
            if let Some(materials) = materials {
                let mirrors =
                    materials.as_array().unwrap().iter().any(|material| {
                        material["reflect"].as_f64().is_some_and(|part| part > 0.0)
                    });
                if mirrors {
                    scene["environment"] = json!({"builtin": "sky"});
                }
                scene["materials"] = materials;
            }
            scene
        })
        .boxed()
}

/// Construction of a machine: from a named one, or from the scene's default machine; with a unit
/// that reflects along the axis or along rays, or without; and with changed fields that keep it
/// valid.
#[derive(Clone, Debug)]
struct MachineRecipe {
    name: Option<&'static str>,
    along_rays: Option<bool>,
    changes: Vec<Mutation>,
}

fn made() -> BoxedStrategy<MachineRecipe> {
    let name = prop::option::weighted(0.5, select(Machine::names().collect::<Vec<_>>()));
    let parts = (
        name,
        select(vec![None, Some(false), Some(true)]),
        mutations(0..12),
    );
    parts
        .prop_map(|(name, along_rays, changes)| MachineRecipe {
            name,
            along_rays,
            changes,
        })
        .boxed()
}

impl MachineRecipe {
    fn machine(&self, scene: &Scene) -> Machine {
        let reflect = self.along_rays.map(|along_rays| {
            let mut words = json!({"sight": "axis", "facing": "I2F14", "direction": "I3F13",
                "reciprocal": {"table_bits": 8, "newton_steps": 1, "bits": 16}, "coordinate": "U1F12", "index_bits": 4,
                "fraction": "U1F7", "light": "U1F10", "reflectance": "U1F10"});
            if along_rays {
                words["sight"] = json!("ray");
                words["slope"] = json!("I2F14");
            }
            format!("reflect={words}")
        });
        let machine = machines::load(
            self.name.unwrap_or(machines::usual(scene)),
            &reflect.into_iter().collect::<Vec<_>>(),
        )
        .unwrap();
        self.changes.iter().fold(machine, |machine, change| {
            let other = mutated(&machine, change);
            if other.elaborate().is_ok() {
                other
            } else {
                machine
            }
        })
    }
}

/// The result of a case.
#[derive(Clone, Copy, Debug, Default)]
struct Met {
    drawn: usize,
    refused: usize,
    mixed: usize,
    mirrors: usize,
    trees: usize,
    sequences: usize,
    windows: usize,
}

/// Draws it as `run` does, in lockstep.
fn draw(path: &Path, made: &MachineRecipe, met: &mut Met) -> Result<()> {
    let mut frames = Sequence::load(path, &Overrides::default(), None)?;
    let machine = &made.machine(frames.scene());
    let elaborated = fixed::elaborate(machine)?;
    if frames.is_sequence() {
        sequence::check(&mut frames, machine)?;
        sequence::run(
            &mut frames,
            machine,
            None,
            0.0,
            &sequence::Output::default(),
            &splatsim::output::progress::Progress::of_steps(false, 2, ""),
        )?;
        met.sequences += 1;
    }
    let scene = bounded(frames.into_scene(), &elaborated)?;
    let outcome = run::run(
        &scene,
        machine,
        0.0,
        &Options {
            answers: true,
            ..Options::default()
        },
    )?;
    let summary = &outcome.report.accuracy.lockstep;
    assert!(!outcome.report.summary().is_empty() && summary.is_some());
    met.drawn += 1;
    met.mixed += usize::from(
        scene
            .ellipsoids
            .as_ref()
            .is_some_and(|all| all.sorted && all.orientations.len() > 1 && all.preshaded),
    );
    met.mirrors += usize::from(scene.environment.is_some());
    met.trees += usize::from(scene.detail.is_some());
    met.windows += usize::from(machine.fragment.window.is_some());
    Ok(())
}

#[test]
fn every_scene_that_is_read_draws_on_every_machine_or_ends_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    let given = std::env::var("PROPTEST_CASES")
        .ok()
        .and_then(|cases| cases.parse().ok());
    let cases = given.unwrap_or(tier::of([3, 3], 900) as u32);
    let config = ProptestConfig {
        cases,
        max_shrink_iters: 2_000,
        failure_persistence: None,
        ..ProptestConfig::default()
    };
    let seed = if given.is_some() {
        rand_seed()
    } else {
        [48; 32]
    };
    let mut runner =
        TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &seed));
    let met = std::cell::Cell::new(Met::default());
    let drawn = runner.run(&(scenes(), made()), |(scene, made)| {
        std::fs::write(&path, scene.to_string()).unwrap();
        let mut so_far = met.get();
        let drawn = catch_unwind(AssertUnwindSafe(|| draw(&path, &made, &mut so_far)));
        let told = match drawn {
            Ok(Ok(())) => None,
            Ok(Err(Error::Input(sentence))) => {
                so_far.refused += 1;
                (sentence.contains('\n') || sentence.len() > 2_000).then_some(sentence)
            }
            Ok(Err(error)) => Some(error.to_string()),
            Err(_) => Some("a panic".into()),
        };
        met.set(so_far);
        told.map_or(Ok(()), |told| {
            Err(TestCaseError::fail(format!("{told}: {scene} on {made:?}")))
        })
    });
    if let Err(TestError::Fail(why, _)) = drawn {
        panic!("{why}");
    }
    let met = met.get();
    let kinds = [
        met.drawn,
        met.mixed,
        met.mirrors,
        met.trees,
        met.sequences,
        met.windows,
    ];
    println!("{met:?}");
    // A small number of cases may miss some kinds.
    assert!(
        cases < 200 || met.drawn > cases as usize / 5 && kinds.iter().all(|count| *count > 0),
        "{met:?}"
    );
}

fn rand_seed() -> [u8; 32] {
    let mut seed = [0; 32];
    let time = std::time::SystemTime::now()
        .duration_since(std::time::UNIX_EPOCH)
        .unwrap()
        .as_nanos();
    seed[..16].copy_from_slice(&time.to_le_bytes());
    println!("seed {seed:?}");
    seed
}

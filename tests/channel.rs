//! How accurate is the replay if memory is shared? Built-in scenes, replayed and ticked cycle by
//! cycle.
//!
//! `cargo test --test suite channel:: -- --nocapture` prints a table.

use crate::tier::{self, Tier};
use rtl_model::Machine;
use rtl_model::machine::timing::{Cache, Memory, Organisation, Tile, Timing};
use rtl_model::timing::{Detail, replay};
use rtl_model::work::Work;
use scene::Scene;
use splatsim::hardware::quantise::quantise;
use splatsim::scene::Overrides;
use std::path::Path;

#[path = "../rtl_model/tests/ticking/binned.rs"]
mod binned;
#[allow(dead_code, reason = "no frame is drawn at random here")]
#[path = "../rtl_model/tests/machines/frames.rs"]
mod frames;
#[path = "../rtl_model/tests/ticking/immediate.rs"]
mod immediate;
#[path = "../rtl_model/tests/ticking/memory.rs"]
mod memory;
#[allow(dead_code, reason = "units are not compared here")]
#[path = "../rtl_model/tests/ticking/parts.rs"]
mod parts;
#[allow(dead_code, reason = "no scene is drawn at random here")]
#[path = "../rtl_model/tests/ticking/scene.rs"]
mod scene;
#[path = "../rtl_model/tests/ticking/sorters.rs"]
mod sorters;

/// Built-in scenes, and their number of splats here.
const SCENES: [(&str, usize); 4] = [
    ("glass-spheres", 6000),
    ("checkerboard", 3000),
    ("torus-knot", 2500),
    ("terrain", 4000),
];
const SIZE: (usize, usize) = (96, 72);

/// Work of the reference machine for a built-in scene with its own view, optionally with fewer
/// splats.
fn record(name: &str, count: Option<usize>, size: Option<(usize, usize)>) -> Work {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join(format!("golden_model/src/scene/builtin/{name}.json"));
    let mut scene: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(own).unwrap()).unwrap();
    if let Some(count) = count {
        scene["splats"]["count"] = count.into();
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    std::fs::write(&path, scene.to_string()).unwrap();
    let scene = splatsim::scene::Scene::load(path.to_str().unwrap(), &Overrides { size }).unwrap();
    let machine = Machine::named("reference").unwrap();
    splatsim::hardware::fixed::draw_measured(
        &splatsim::hardware::fixed::elaborate(&machine).unwrap(),
        &quantise(&scene, &machine).unwrap(),
    )
    .2
}

/// Prints a line of the table; returns the replay's difference as a share of the ticks.
fn compare(name: &str, work: &Work, scene: &Scene, what: &str, timing: Timing) -> f64 {
    let machine = Machine {
        timing,
        ..Machine::named("reference").unwrap()
    };
    let timing = splatsim::hardware::fixed::elaborate(&machine)
        .unwrap()
        .timing;
    let ticked = match timing.timing.organisation {
        Organisation::Immediate => immediate::draw(&timing, scene),
        Organisation::Binned => binned::draw(&timing, scene),
    };
    let replayed = replay(&timing, work, Detail::Accounts);
    assert_eq!(
        (ticked.traffic.bytes, ticked.traffic.bursts),
        (replayed.memory.bytes, replayed.memory.requests),
        "{name}, {what}"
    );
    let error = replayed.total as f64 / ticked.total as f64 - 1.0;
    println!(
        "{name:13} {what:29} {:10} {:10} {:+8.3} % {:8} {:8} {:9} {:9}",
        ticked.total,
        replayed.total,
        100.0 * error,
        ticked.traffic.row_hits,
        replayed.memory.row_hits,
        ticked.traffic.busy,
        replayed.memory.busy,
    );
    error.abs()
}

/// Both organisations; with a small cache, with two buffers; all of these also with a narrow
/// channel and few requests in flight.
fn machines() -> Vec<(String, Timing)> {
    let default = Machine::named("reference").unwrap().timing;
    let immediate = Timing {
        organisation: Organisation::Immediate,
        ..default
    };
    let binned = Timing {
        organisation: Organisation::Binned,
        ..default
    };
    let wide = [
        ("immediate", immediate),
        (
            "immediate, 16 lines",
            Timing {
                cache: Cache {
                    lines: 16,
                    ..default.cache
                },
                ..immediate
            },
        ),
        ("binned", binned),
        (
            "binned, 2 buffers",
            Timing {
                tile: Tile {
                    buffers: 2,
                    ..default.tile
                },
                ..binned
            },
        ),
    ];
    let narrow = |timing: Timing| Timing {
        memory: Memory {
            bytes_per_cycle: 4,
            outstanding: 4,
            ..timing.memory
        },
        cache: Cache {
            misses: 2,
            ..timing.cache
        },
        ..timing
    };
    wide.into_iter()
        .flat_map(|(name, timing)| {
            [
                (name.into(), timing),
                (format!("{name}, narrow"), narrow(timing)),
            ]
        })
        .collect()
}

fn check(name: &str, work: &Work, machines: &[(String, Timing)]) {
    let scene = Scene::read(work);
    println!(
        "{:43} {:>10} {:>10} {:>10} {:>17} {:>19}",
        "", "ticked", "replayed", "off by", "row hits of both", "memory busy, both"
    );
    for (what, timing) in machines {
        let error = compare(name, work, &scene, what, *timing);
        assert!(
            error <= 0.01,
            "{name}, {what}: off by {:.2} %",
            100.0 * error
        );
    }
}

#[test]
fn replayed_scenes_are_at_most_a_hundredth_off() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let machines = machines();
    for (name, count) in SCENES {
        check(name, &record(name, Some(count), Some(SIZE)), &machines);
    }
}

/// Trained Gaussians, with every sort; few lists fit into the buffers of the sorters. Also with
/// several channels and limits of how often rows are opened, and where several engines and
/// overlapping sorters share memory.
#[test]
fn a_replayed_scene_is_at_most_a_hundredth_off_with_any_sort() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let sorts = [
        &["sort.kind=radix"][..],
        &["sort.kind=tile"],
        &[
            "sort.kind=tile",
            "timing.sort={\"units\": 3, \"buffer_entries\": 32, \"network\": 8}",
        ],
        &[
            "sort.kind=hierarchical",
            "timing.sort={\"units\": 2, \"buffer_entries\": 32, \"network\": 8}",
        ],
        &[
            "sort.kind=hierarchical",
            "timing.sort={\"buffer_entries\": 64}",
            "timing.memory.bytes_per_cycle=4",
        ],
        &[
            "sort.kind=tile",
            "timing.sort.units=4",
            "timing.memory.preset=lpddr4-3200-x4",
        ],
        &[
            "sort.kind=hierarchical",
            "timing.sort.units=4",
            "timing.memory.preset=lpddr4-3200-x4",
        ],
        &[
            "sort.kind=tile",
            "timing.sort.units=4",
            "timing.sort.overlap=true",
            "timing.engines=4",
        ],
        &[
            "sort.kind=hierarchical",
            "timing.sort.units=4",
            "timing.sort.overlap=true",
            "timing.engines=4",
        ],
        &[
            "sort.kind=tile",
            "timing.engines=4",
            "timing.memory.preset=lpddr4-3200-x4",
        ],
        &[
            "sort.kind=tile",
            "timing.sort.units=4",
            "timing.sort.overlap=true",
            "timing.engines=4",
            "timing.memory.preset=lpddr4-3200-x4",
        ],
        &[
            "sort.kind=hierarchical",
            "timing.sort.units=4",
            "timing.sort.overlap=true",
            "timing.engines=4",
            "timing.memory.preset=lpddr4-3200-x4",
        ],
    ];
    let scene = splatsim::scene::Scene::load(
        "bouquet",
        &Overrides {
            size: Some((64, 48)),
        },
    )
    .unwrap();
    let mut off = Vec::new();
    for settings in sorts {
        let settings: Vec<String> = settings
            .iter()
            .map(|setting| (*setting).to_owned())
            .collect();
        let machine = splatsim::hardware::machines::load("gaussian", &settings).unwrap();
        let built = splatsim::hardware::fixed::elaborate(&machine).unwrap();
        let work =
            splatsim::hardware::fixed::draw_measured(&built, &quantise(&scene, &machine).unwrap())
                .2;
        let (ticked, replayed) = (
            binned::draw(&built.timing, &Scene::read(&work)),
            replay(&built.timing, &work, Detail::Accounts),
        );
        assert_eq!(
            (ticked.traffic.bytes, ticked.traffic.bursts),
            (replayed.memory.bytes, replayed.memory.requests),
            "{settings:?}"
        );
        let error = replayed.total as f64 / ticked.total as f64 - 1.0;
        println!(
            "{settings:?}: {} ticked, {} replayed, {:+.3} %",
            ticked.total,
            replayed.total,
            100.0 * error
        );
        // NaN is off too.
        let is_near = error.abs() <= 0.01;
        off.extend((!is_near).then_some(settings));
    }
    assert!(off.is_empty(), "off by more than 1 %: {off:?}");
}

#[test]
fn a_replayed_scene_of_full_size_is_at_most_a_hundredth_off() {
    if !tier::runs(Tier::Full) {
        return;
    }
    let mut machines = machines();
    machines.retain(|(what, _)| ["immediate", "binned"].contains(&what.as_str()));
    for (name, _) in SCENES {
        check(name, &record(name, None, None), &machines);
    }
}

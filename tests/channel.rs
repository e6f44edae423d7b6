//! How far off is the replay where memory is shared? Built-in scenes, replayed and ticked cycle by cycle.

use crate::scene::Scene;
use rtl_model::Machine;
use rtl_model::machine::timing::{Elaborated, Organisation, Timing};
use rtl_model::timing::replay;
use rtl_model::work::Work;
use splatsim::quantise::quantise;
use splatsim::scene::Overrides;
use std::path::Path;

#[path = "../rtl_model/tests/ticking/binned.rs"]
mod binned;
#[path = "../rtl_model/tests/machines/frames.rs"]
mod frames;
#[path = "../rtl_model/tests/ticking/immediate.rs"]
mod immediate;
#[path = "../rtl_model/tests/ticking/memory.rs"]
mod memory;
#[path = "../rtl_model/tests/ticking/parts.rs"]
mod parts;
#[path = "../rtl_model/tests/ticking/scene.rs"]
mod scene;

/// Built-in scenes, and how many splats they get here.
const SCENES: [(&str, usize); 4] = [("glass-spheres", 6000), ("checkerboard", 3000), ("torus-knot", 2500), ("terrain", 4000)];
const SIZE: (usize, usize) = (96, 72);

/// What the reference machine does to draw a built-in scene with its own view; with fewer splats, if so many are said.
fn record(name: &str, count: Option<usize>, size: Option<(usize, usize)>) -> Work {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("src/scene/builtin/{name}.json"));
    let mut scene: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(own).unwrap()).unwrap();
    if let Some(count) = count {
        scene["splats"]["count"] = count.into();
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    std::fs::write(&path, scene.to_string()).unwrap();
    let scene = splatsim::scene::Scene::load(path.to_str().unwrap(), &Overrides { size }).unwrap();
    let machine = Machine::named("reference").unwrap();
    splatsim::fixed::draw_recorded(&splatsim::fixed::elaborate(&machine).unwrap(), &quantise(&scene, &machine).unwrap()).1
}

fn elaborate(timing: Timing) -> Elaborated {
    let machine = Machine { timing, ..Machine::named("reference").unwrap() };
    splatsim::fixed::elaborate(&machine).unwrap().timing
}

/// A line of the table, and by what share of the ticks the replay is off.
fn compare(name: &str, work: &Work, scene: &Scene, what: &str, timing: Timing) -> f64 {
    let timing = elaborate(timing);
    let start = std::time::Instant::now();
    let ticked = match timing.timing.organisation {
        Organisation::Immediate => immediate::draw(&timing, scene),
        Organisation::Binned => binned::draw(&timing, scene),
    };
    let took = start.elapsed().as_secs_f64();
    let replayed = replay(&timing, work);
    assert_eq!((ticked.traffic.bytes, ticked.traffic.bursts), (replayed.memory.bytes, replayed.memory.requests), "{name}");
    let error = (replayed.total as f64 - ticked.total as f64) / ticked.total as f64;
    println!(
        "{name:14} {:10} {what:8} {:10} {:10} {:+7.3} % {:9} {:9} {:10} {:10} {took:.2}",
        format!("{:?}", timing.timing.organisation),
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

/// Narrow memory with few requests on their way.
fn narrow(timing: &mut Timing) {
    (timing.memory.bytes_per_cycle, timing.memory.outstanding, timing.cache.misses) = (4, 4, 2);
}

#[test]
fn a_replayed_scene_is_at_most_a_hundredth_off() {
    let mut worst: f64 = 0.0;
    for (name, count) in SCENES {
        let work = record(name, Some(count), Some(SIZE));
        let scene = Scene::read(&work);
        for organisation in [Organisation::Immediate, Organisation::Binned] {
            let mut timing = Timing { organisation, ..Machine::named("reference").unwrap().timing };
            for small in [false, true] {
                if small {
                    (timing.cache.lines, timing.cache.ways) = (16, 4);
                }
                for buffers in [1, 2] {
                    timing.tile.buffers = buffers;
                    worst = worst.max(compare(name, &work, &scene, "default", timing));
                    let mut slow = timing;
                    narrow(&mut slow);
                    worst = worst.max(compare(name, &work, &scene, "narrow", slow));
                }
            }
        }
    }
    assert!(worst <= 0.01, "{worst}");
}

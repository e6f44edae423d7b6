//! Time of a frame on one thread: setup and fill of the machine, both together, and the f64
//! renderer `golden` for comparison.
//!
//! `cargo bench`. The dragon scan is included if the input data of the tests exists.

use std::sync::LazyLock;

use divan::Bencher;
use divan::counter::ItemsCount;
use rtl_model::machine::Machine;
use rtl_model::pipeline::Elaborated;
use rtl_model::pipeline::{self, Setup};
use splatsim::golden;
use splatsim::hardware::fixed;
use splatsim::hardware::quantise::{Quantised, quantise};
use splatsim::scene::{Overrides, Scene};

#[path = "../shared_input/mod.rs"]
mod shared_input;

/// A scene, ready to be drawn by one machine.
struct Case {
    name: &'static str,
    scene: Scene,
    machine: Elaborated,
    quantised: Quantised,
    setup: Setup,
    fragments: u64,
}

/// Printed by divan.
impl std::fmt::Display for Case {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.name, self.machine.machine.name)
    }
}

static CASES: LazyLock<Vec<Case>> = LazyLock::new(|| {
    let scenes = [
        ("glass-spheres", Some("glass-spheres".into())),
        ("dragon", shared_input::find("scenes/dragon.json")),
    ];
    let there = scenes.into_iter().filter_map(|(name, path)| {
        let scene = Scene::load(path?, &Overrides::default()).expect("the scene is read");
        Some((name, scene))
    });
    there
        .flat_map(|(name, scene)| {
            ["reference", "lean"].map(|machine| case(name, scene.clone(), machine))
        })
        .collect()
});

fn case(name: &'static str, scene: Scene, machine: &str) -> Case {
    let machine = Machine::named(machine).unwrap();
    let quantised = quantise(&scene, &machine).unwrap();
    let machine = fixed::elaborate(&machine).unwrap();
    let setup = pipeline::set_up_unobserved(&machine, &quantised.frame);
    let fragments = pipeline::fill_unobserved(&machine, &quantised.frame, &setup)
        .outcomes
        .total();
    Case {
        name,
        scene,
        machine,
        quantised,
        setup,
        fragments,
    }
}

fn cases() -> impl Iterator<Item = &'static Case> {
    CASES.iter()
}

/// Items per second are splats.
#[divan::bench(args = cases())]
fn setup(bencher: Bencher, case: &Case) {
    let splats = bencher.counter(ItemsCount::new(case.scene.splats.len()));
    splats.bench(|| pipeline::set_up_unobserved(&case.machine, &case.quantised.frame));
}

/// Raster, gauss, fragment and resolve. Items per second are fragments, also below.
#[divan::bench(args = cases())]
fn fill(bencher: Bencher, case: &Case) {
    let fragments = bencher.counter(ItemsCount::new(case.fragments));
    fragments
        .bench(|| pipeline::fill_unobserved(&case.machine, &case.quantised.frame, &case.setup));
}

#[divan::bench(args = cases())]
fn whole_frame(bencher: Bencher, case: &Case) {
    let fragments = bencher.counter(ItemsCount::new(case.fragments));
    fragments.bench(|| fixed::draw(&case.machine, &case.quantised));
}

/// With all ranges observed.
#[divan::bench(args = cases())]
fn whole_frame_watched(bencher: Bencher, case: &Case) {
    let fragments = bencher.counter(ItemsCount::new(case.fragments));
    fragments.bench(|| fixed::draw_measured(&case.machine, &case.quantised));
}

/// The same picture in f64.
#[divan::bench(args = cases().filter(|case| case.machine.machine.name == "reference"))]
fn whole_frame_golden(bencher: Bencher, case: &Case) {
    let rules = fixed::rules(&case.machine.machine);
    let fragments = bencher.counter(ItemsCount::new(case.fragments));
    fragments.bench(|| golden::render(&case.scene, &rules));
}

fn main() {
    let one_thread = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build_global();
    one_thread.expect("the threads are not started yet");
    divan::Divan::from_args().sample_count(10).main();
}

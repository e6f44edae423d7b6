//! Which microarchitectures can be built, and does every one that can go through a frame?

use crate::frames::frame;
use proptest::prelude::*;
use rtl_model::Machine;
use rtl_model::machine::timing::Organisation;
use rtl_model::pipeline::draw_measured;
use rtl_model::timing::{Cycles, Detail, replay};
use rtl_model::work::Work;
use serde_json::{Value, json};

fn reference() -> Machine {
    Machine::named("reference").unwrap()
}

fn work() -> Work {
    let machine = reference();
    let mut frame = frame(&machine, 5, 10_000);
    (frame.width, frame.height) = (75, 40);
    frame.splats = (0..30).flat_map(|seed| crate::frames::frame(&machine, seed, 500).splats).collect();
    draw_measured(&machine.elaborate().unwrap(), &frame).2
}

/// A machine with one field of its timing changed.
fn with(machine: &Machine, field: &str, to: Value) -> Machine {
    let mut value = serde_json::to_value(machine).unwrap();
    let (unit, name) = field.split_once('/').unwrap();
    value["timing"][unit][name] = to;
    serde_json::from_value(value).unwrap()
}

/// What a machine without a mistake cannot have; each misfit names its field.
#[test]
fn impossible_microarchitectures_are_refused_all_at_once_in_sentences() {
    let wrong = [
        ("raster/fifo", json!(0), "timing.raster.fifo is 0: it can be 1 to 65536"),
        ("raster/lanes", json!([0, 4]), "timing.raster.lanes[0] is 0: it can be 1 to 64"),
        ("raster/lanes", json!([16, 16]), "timing.raster.lanes 16×16 are more than 64"),
        ("memory/bytes_per_cycle", json!(0), "timing.memory.bytes_per_cycle is 0: it can be 1 to 1048576"),
        ("memory/burst_bytes", json!(48), "timing.memory.burst_bytes is 48: it must be a power of two up to 1048576"),
        ("memory/burst_bytes", json!(2), "timing.memory.burst_bytes is 2: an entry of a tile's list has 4"),
        ("memory/burst_bytes", json!(4096), "timing.memory reads 4096 bytes at a time from rows of 2048"),
        ("memory/miss_latency", json!(3), "timing.memory.miss_latency is 3: it can be 20, the latency of an open row, to 1048576"),
        ("cache/line_px", json!([3, 4]), "timing.cache.line_px[0] is 3: it must be a power of two up to 1048576"),
        ("cache/ways", json!(512), "timing.cache has 256 lines in sets of 512: no set is full"),
        ("tile/side_px", json!(24), "timing.tile.side_px is 24: it must be a multiple of 16 up to 1024"),
        ("tile/buffers", json!(3), "timing.tile.buffers is 3: it can be 1 or 2"),
        ("project/units", json!(0), "timing.project.units is 0: it can be 1 to 16"),
        ("ellipse/interval", json!(0), "timing.ellipse.interval is 0: it can be 1 to 4096"),
    ];
    let mut all = reference();
    for (field, value, sentence) in wrong {
        let misfits = with(&reference(), field, value.clone()).elaborate().unwrap_err();
        assert_eq!(misfits, [sentence]);
        all = with(&all, field, value);
    }
    all.timing.clock_hz = 0;
    let misfits = all.elaborate().unwrap_err();
    assert!(misfits.len() >= 9 && misfits.iter().any(|misfit| misfit.starts_with("timing.clock_hz is 0")), "{misfits:#?}");
}

/// The four counts of every unit sum to the total, whatever it waits for.
fn accounts_for_all(cycles: &Cycles) {
    for unit in &cycles.units {
        let account = unit.account;
        assert_eq!(account.busy + account.starved + account.blocked + account.memory, cycles.total, "{} {account:?}", unit.name);
        let blamed: u64 = unit.blocked_by.iter().map(|(_, cycles)| cycles).sum();
        assert_eq!(blamed, if unit.blocked_by.is_empty() { 0 } else { account.blocked }, "{}", unit.name);
        let together = cycles.units.iter().filter(|other| other.name == unit.name);
        let [index, first] =
            [together.clone().filter(|other| other.index == unit.index).count(), together.clone().filter(|other| other.index == 0).count()];
        assert_eq!([index, first], [1, 1], "two units are called {}", unit.name);
        let busy: u64 = together.map(|unit| unit.account.busy).sum();
        let Some(timeline) = &unit.timeline else {
            assert!(unit.index > 0, "of {} nobody says when it was used", unit.name);
            continue;
        };
        let over_time: u64 = timeline.busy.iter().sum();
        let waits = unit.name == "cache" && over_time >= busy;
        assert!(over_time == busy || waits, "{}: {over_time} of {busy}", unit.name);
        assert!(timeline.busy.len() <= 257 && timeline.window * (timeline.busy.len() as u64 - 1) <= cycles.total);
    }
}

/// Numbers from the smallest to far too many.
fn numbers() -> impl Strategy<Value = Vec<u32>> {
    prop::collection::vec(
        prop_oneof![4 => 1..5u32, 3 => prop::sample::select(vec![8, 16, 32, 64]), 1 => prop::sample::select(vec![0, 4096, u32::MAX])],
        64,
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_microarchitecture_is_refused_in_sentences_or_goes_through_a_frame(
        numbers in numbers(), keep in prop::collection::vec(any::<bool>(), 64), binned in any::<bool>(),
    ) {
        let mut value = serde_json::to_value(reference()).unwrap();
        let mut at = 0;
        for unit in value["timing"].as_object_mut().unwrap().values_mut().filter_map(Value::as_object_mut) {
            for field in unit.values_mut() {
                let mut change = |old: &mut Value| {
                    if !keep[at] { *old = json!(numbers[at]) }
                    at += 1;
                };
                match field {
                    Value::Bool(flag) => *flag = numbers[at] % 2 == 1,
                    Value::Array(pair) => pair.iter_mut().for_each(change),
                    other => change(other),
                }
            }
        }
        value["timing"]["organisation"] = json!(if binned { "binned" } else { "immediate" });
        let machine: Machine = serde_json::from_value(value).unwrap();
        match machine.elaborate() {
            Ok(elaborated) => accounts_for_all(&replay(&elaborated.timing, &work(), Detail::Histograms)),
            Err(misfits) => prop_assert!(misfits.iter().all(|misfit| misfit.contains("timing") && misfit.len() < 200), "{:#?}", misfits),
        }
    }
}

#[test]
fn every_cycle_of_the_default_machines_is_accounted_for() {
    for organisation in [Organisation::Immediate, Organisation::Binned] {
        for buffers in [1, 2] {
            let mut machine = reference();
            (machine.timing.organisation, machine.timing.tile.buffers) = (organisation, buffers);
            accounts_for_all(&replay(&machine.elaborate().unwrap().timing, &work(), Detail::Histograms));
        }
    }
}

/// Where memory is slow and all else is quick, a frame takes what its bytes take.
#[test]
fn a_frame_bound_by_memory_takes_its_bytes_over_the_bandwidth() {
    for organisation in [Organisation::Immediate, Organisation::Binned] {
        let mut machine = reference();
        machine.timing.organisation = organisation;
        machine.timing.memory.bytes_per_cycle = 1;
        (machine.timing.shade.latency, machine.timing.cache.lines, machine.timing.cache.misses) = (Some(1), 4, 64);
        let cycles = replay(&machine.elaborate().unwrap().timing, &work(), Detail::Histograms);
        let bytes = cycles.memory.total_bytes();
        assert_eq!(cycles.memory.busy, bytes);
        assert!(cycles.total >= bytes && cycles.total * 100 < bytes * 105, "{organisation:?}: {} cycles for {bytes} bytes", cycles.total);
        assert_eq!(cycles.bottleneck(), "memory");
    }
}

/// Tiles of any size hold the same pixels and end with the same light.
#[test]
fn tiles_of_any_size_do_the_same_work() {
    let work = work();
    let of = |side: u32| {
        let mut machine = reference();
        (machine.timing.tile.side_px, machine.timing.raster.lanes) = (side, [1, 1]);
        let cycles = replay(&machine.elaborate().unwrap().timing, &work, Detail::Histograms);
        let items = |name: &str| cycles.units.iter().filter(|unit| unit.name == name).map(|unit| unit.items).sum::<u64>();
        (cycles.stamps, items("fragment"), items("bin"))
    };
    assert!(of(16).1 > 1000);
    for side in [32, 48, 64, 1024] {
        assert_eq!(of(side), of(16), "{side}");
    }
}

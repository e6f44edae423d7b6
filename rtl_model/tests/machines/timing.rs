//! Which microarchitectures elaborate, and does every one of them complete a frame?

use crate::frames::{ellipsoids, frame};
use proptest::prelude::*;
use rtl_model::Machine;
use rtl_model::elaboration::microarchitecture::Microarchitecture;
use rtl_model::elaboration::{Operator, Part, unit};
use rtl_model::machine::timing::{Organisation, Queue, Sorter, Technology};
use rtl_model::machine::{Bin, BinTest, SortKind};
use rtl_model::pipeline::draw_measured;
use rtl_model::timing::{Cycles, Detail, Limited, UnitCycles, limit, most_gained, replay};
use rtl_model::work::Work;
use serde_json::{Value, json};
use std::sync::LazyLock;

fn reference() -> Machine {
    Machine::named("reference").unwrap()
}

fn work() -> Work {
    work_of(&reference())
}

fn work_of(machine: &Machine) -> Work {
    let mut frame = frame(machine, 5, 10_000);
    (frame.width, frame.height) = (75, 40);
    frame.splats = (0..30)
        .flat_map(|seed| crate::frames::frame(machine, seed, 500).splats)
        .collect();
    draw_measured(&machine.elaborate().unwrap(), &frame).2
}

/// Work of ellipsoids, which are lit before they are drawn, and sorted on a machine that sorts.
fn work_of_sheets(machine: &Machine) -> Work {
    let mut frame = ellipsoids(machine, 5, 500);
    (frame.width, frame.height) = (75, 40);
    frame
        .ellipsoids
        .iter_mut()
        .for_each(|ellipsoids| ellipsoids.preshaded = true);
    draw_measured(&machine.elaborate().unwrap(), &frame).2
}

/// A machine with one field of its timing changed.
fn with(machine: &Machine, field: &str, to: Value) -> Machine {
    let mut value = serde_json::to_value(machine).unwrap();
    let (unit, name) = field.split_once('/').unwrap();
    value["timing"][unit][name] = to;
    serde_json::from_value(value).unwrap()
}

/// Impossible values; each elaboration error names its field.
#[test]
fn impossible_microarchitectures_are_refused_all_at_once_in_sentences() {
    let wrong = [
        (
            "raster/fifo",
            json!(0),
            "timing.raster.fifo is 0: it can be 1 to 65536",
        ),
        (
            "raster/lanes",
            json!([0, 4]),
            "timing.raster.lanes[0] is 0: it can be 1 to 64",
        ),
        (
            "raster/lanes",
            json!([16, 16]),
            "timing.raster.lanes 16×16 are more than 64",
        ),
        (
            "memory/bytes_per_cycle",
            json!(0),
            "timing.memory.bytes_per_cycle is 0: it can be 1 to 1048576",
        ),
        (
            "memory/burst_bytes",
            json!(48),
            "timing.memory.burst_bytes is 48: it must be a power of two up to 1048576",
        ),
        (
            "memory/burst_bytes",
            json!(2),
            "timing.memory.burst_bytes is 2: an entry of a tile's list has 4",
        ),
        (
            "memory/burst_bytes",
            json!(4096),
            "timing.memory reads 4096 bytes at a time from rows of 2048",
        ),
        (
            "memory/miss_latency",
            json!(3),
            "timing.memory.miss_latency is 3: it can be 20, the latency of an open row, to 1048576",
        ),
        (
            "cache/line_px",
            json!([3, 4]),
            "timing.cache.line_px[0] is 3: it must be a power of two up to 1048576",
        ),
        (
            "cache/ways",
            json!(512),
            "timing.cache.ways is 512: at most 64 are compared in a cycle",
        ),
        (
            "cache/lines",
            json!(2),
            "timing.cache has 2 lines in sets of 4: no set is full",
        ),
        (
            "tile/side_px",
            json!(132),
            "timing.tile.side_px is 132: it must be a multiple of 4 up to 128, or of 16 up to 1024",
        ),
        (
            "tile/side_px",
            json!(18),
            "timing.tile.side_px is 18: it must be a multiple of 4 up to 128, or of 16 up to 1024",
        ),
        (
            "tile/buffers",
            json!(3),
            "timing.tile.buffers is 3: it can be 1 or 2",
        ),
        (
            "project/units",
            json!(0),
            "timing.project.units is 0: it can be 1 to 16",
        ),
        (
            "fetch/splats",
            json!(0),
            "timing.fetch.splats is 0: it can be 1 to 16",
        ),
        (
            "fetch/splats",
            json!(17),
            "timing.fetch.splats is 17: it can be 1 to 16",
        ),
        (
            "fetch/splats",
            json!(2),
            "timing.fetch.splats is 2, but timing.project.units is 1: a unit takes at most one record per cycle",
        ),
        (
            "fragment/units",
            json!(3),
            "timing.fragment.units is 3: it must be a power of two, because the address of a pixel selects its unit",
        ),
        (
            "fragment/merges_in_flight",
            json!(65),
            "timing.fragment.merges_in_flight is 65: it can be 1 to 64",
        ),
        (
            "shade/units",
            json!(0),
            "timing.shade.units is 0: it can be 1 to 16",
        ),
        (
            "resolve/units",
            json!(17),
            "timing.resolve.units is 17: it can be 1 to 16",
        ),
        (
            "ellipse/interval",
            json!(0),
            "timing.ellipse.interval is 0: it can be 1 to 4096",
        ),
        (
            "shade/latency",
            json!(2),
            "timing.shade.latency is 2, but its critical path takes 565.0 FO4: 3 cycles at 400 MHz in 28 nm",
        ),
    ];
    let mut all = reference();
    for (field, value, sentence) in wrong {
        let errors = with(&reference(), field, value.clone())
            .elaborate()
            .unwrap_err();
        assert_eq!(errors, [sentence]);
        all = with(&all, field, value);
    }
    all.timing.clock_hz = 0;
    let errors = all.elaborate().unwrap_err();
    assert!(
        errors.len() >= 9
            && errors
                .iter()
                .any(|error| error.starts_with("timing.clock_hz is 0")),
        "{errors:#?}"
    );
}

/// An immediate machine has no tiles that engines could share.
#[test]
fn only_a_binned_machine_has_several_engines() {
    let mut machine = reference();
    (machine.timing.engines, machine.timing.queue) = (Some(2), Queue::Longest);
    assert!(machine.elaborate().is_ok());
    machine.timing.organisation = Organisation::Immediate;
    let errors = machine.elaborate().unwrap_err();
    assert_eq!(
        errors,
        [
            "timing.engines is 2, but an immediate machine has no tiles to share: use binned",
            "timing.queue is longest, but an immediate machine has no tiles: use order"
        ]
    );
    (machine.timing.organisation, machine.timing.engines) = (Organisation::Binned, Some(65));
    assert_eq!(
        machine.elaborate().unwrap_err(),
        ["timing.engines is 65: it can be 1 to 64"]
    );
}

/// A faster clock and shared multipliers cost cycles.
#[test]
fn a_machine_cannot_be_faster_than_its_operators() {
    let built = |change: &dyn Fn(&mut Machine)| {
        let mut machine = reference();
        change(&mut machine);
        machine.elaborate().map(|elaborated| elaborated.timing)
    };
    let refused = |change: &dyn Fn(&mut Machine)| built(change).unwrap_err();
    // In open 180 nm cells a layer takes resolve 5.8 ns and its register half a nanosecond.
    let errors = refused(&|m| m.timing.technology = Technology::Nm180);
    assert_eq!(
        errors,
        [
            "timing.clock_hz is 400000000, but resolve needs 57.8 FO4 for a layer, which has one cycle: at most 156 MHz in 180 nm"
        ]
    );
    assert!(
        built(&|m| (m.timing.technology, m.timing.clock_hz) = (Technology::Nm180, 156_000_000))
            .is_ok()
    );
    let errors = refused(&|m| m.timing.clock_hz = 2_500_000_000);
    assert!(
        errors.len() == 1 && errors[0].ends_with("at most 1536 MHz in 28 nm"),
        "{errors:?}"
    );
    // A pixel is not taken again before it has passed the whole critical path.
    let hazard_of_one = |clock_hz| {
        move |m: &mut Machine| (m.timing.fragment.hazard, m.timing.clock_hz) = (Some(1), clock_hz)
    };
    assert!(built(&hazard_of_one(700_000_000)).is_ok());
    assert_eq!(
        refused(&hazard_of_one(750_000_000)),
        [
            "timing.fragment.hazard is 1, but its critical path takes 132.1 FO4: 2 cycles at 750 MHz in 28 nm"
        ]
    );
    // A latency that is enough at a slow clock is too short at a fast one.
    let three = |clock_hz| {
        move |m: &mut Machine| (m.timing.shade.latency, m.timing.clock_hz) = (Some(3), clock_hz)
    };
    assert!(built(&three(500_000_000)).is_ok());
    assert!(
        refused(&three(540_000_000))[0].ends_with("takes 565.0 FO4: 4 cycles at 540 MHz in 28 nm")
    );
    // 19 products of project share one multiplier.
    let one = |interval, latency| {
        move |m: &mut Machine| {
            (
                m.timing.project.multipliers,
                m.timing.project.interval,
                m.timing.project.latency,
            ) = (Some(1), interval, latency)
        }
    };
    let turns = built(&one(None, None)).unwrap().project;
    assert_eq!([turns.interval, turns.latency], [19, 19]);
    assert_eq!(
        refused(&one(Some(18), None)),
        ["timing.project.interval is 18, but 19 products take 19 cycles where multipliers are 1"]
    );
    assert_eq!(refused(&one(None, Some(18))).len(), 1);
    // A merge of two fragments takes at least one cycle.
    assert_eq!(
        refused(&|m| m.timing.fragment.merge = 0),
        [
            "timing.fragment.merge is 0, but its critical path takes 60.1 FO4: 1 cycle at 400 MHz in 28 nm"
        ]
    );
    // All absurd values are refused in sentences.
    let absurd: [&dyn Fn(&mut Machine); 9] = [
        &|m| m.timing.clock_hz = u64::MAX,
        &|m| m.fragment.layers = u32::MAX,
        &|m| m.fragment.layers = 100_000_000,
        &|m| m.shade.reciprocal.newton_steps = u32::MAX,
        &|m| m.shade.reciprocal.table_bits = u32::MAX,
        &|m| m.shade.reciprocal.bits = u32::MAX,
        &|m| m.project.reciprocal.bits = u32::MAX,
        &|m| m.gauss.table.index_bits = u32::MAX,
        &|m| (m.timing.memory.outstanding, m.timing.memory.burst_bytes) = (u32::MAX, 1 << 31),
    ];
    for absurd in absurd {
        assert!(!refused(absurd).is_empty());
    }
    // Ideal gates are allowed for what-if studies.
    assert!(
        built(&|m| (
            m.timing.technology,
            m.timing.clock_hz,
            m.timing.shade.latency
        ) = (Technology::Ideal, 1 << 39, Some(1)))
        .is_ok()
    );
}

/// The four counts of every unit sum to the total, for every stall reason.
fn accounts_for_all(cycles: &Cycles) {
    for unit in &cycles.units {
        let account = unit.account;
        assert_eq!(
            account.busy + account.starved + account.blocked + account.memory,
            cycles.total,
            "{} {account:?}",
            unit.name
        );
        let blamed: u64 = unit.blocked_by.iter().map(|(_, cycles)| cycles).sum();
        assert_eq!(
            blamed,
            if unit.blocked_by.is_empty() {
                0
            } else {
                account.blocked
            },
            "{}",
            unit.name
        );
        let together = cycles.units.iter().filter(|other| other.name == unit.name);
        let [index, first] = [
            together
                .clone()
                .filter(|other| other.index == unit.index)
                .count(),
            together.clone().filter(|other| other.index == 0).count(),
        ];
        assert_eq!(
            [index, first],
            [1, 1],
            "two units have the name {}",
            unit.name
        );
        let busy = account.busy;
        let Some(timeline) = &unit.timeline else {
            panic!("the use of {} over time is missing", unit.name)
        };
        let over_time: u64 = timeline.busy.iter().sum();
        let waits = unit.name == "cache" && over_time >= busy;
        assert!(
            over_time == busy || waits,
            "{}: {over_time} of {busy}",
            unit.name
        );
        assert!(
            timeline.busy.len() <= 257
                && timeline.window * (timeline.busy.len() as u64 - 1) <= cycles.total
        );
        let most = timeline.busy.iter().max();
        assert!(
            most <= Some(&timeline.window),
            "{}: {most:?} busy cycles in a window of {}",
            unit.name,
            timeline.window
        );
    }
}

/// Numbers from the smallest to far too large.
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
        value["timing"]["clock_hz"] = json!([400_000_000, 0, 1, 1_000_000_000_000u64, u64::MAX, 400_000_000][numbers[62] as usize % 6]);
        value["timing"]["technology"] = json!(if numbers[63] % 2 == 0 { "28nm" } else { "ideal" });
        let machine: Machine = serde_json::from_value(value).unwrap();
        match machine.elaborate() {
            Ok(elaborated) => accounts_for_all(&replay(&elaborated.timing, &work(), Detail::Histograms)),
            Err(errors) => prop_assert!(errors.iter().all(|error| error.contains("timing") && error.len() < 200), "{:#?}", errors),
        }
    }
}

#[test]
fn every_cycle_of_the_default_machines_is_accounted_for() {
    for organisation in [Organisation::Immediate, Organisation::Binned] {
        for buffers in [1, 2] {
            let mut machine = reference();
            (machine.timing.organisation, machine.timing.tile.buffers) = (organisation, buffers);
            accounts_for_all(&replay(
                &machine.elaborate().unwrap().timing,
                &work(),
                Detail::Histograms,
            ));
        }
    }
}

/// With slow memory and all else fast, a frame takes the time of its bytes.
#[test]
fn a_frame_bound_by_memory_takes_its_bytes_over_the_bandwidth() {
    for organisation in [Organisation::Immediate, Organisation::Binned] {
        let mut machine = reference();
        machine.timing.organisation = organisation;
        machine.timing.memory.bytes_per_cycle = 1;
        machine.timing.technology = Technology::Ideal;
        (
            machine.timing.shade.latency,
            machine.timing.cache.lines,
            machine.timing.cache.misses,
        ) = (Some(1), 4, 64);
        let cycles = replay(
            &machine.elaborate().unwrap().timing,
            &work(),
            Detail::Histograms,
        );
        let bytes = cycles.memory.total_bytes();
        assert_eq!(cycles.memory.busy, bytes);
        assert!(
            cycles.total >= bytes && cycles.total * 100 < bytes * 105,
            "{organisation:?}: {} cycles for {bytes} bytes",
            cycles.total
        );
        let timing = machine.elaborate().unwrap().timing;
        assert_eq!(limit(&timing, &work(), &cycles).name, "memory");
    }
}

/// A machine whose merging is as fast as anything else.
fn quick() -> Machine {
    let mut machine = reference();
    machine.timing.technology = Technology::Ideal;
    (machine.timing.fragment.merge, machine.timing.shade.latency) = (0, Some(1));
    machine
}

/// Cycles of a frame when each of its limits is lifted, one at a time.
fn lifted(
    timing: &Microarchitecture,
    work: &Work,
    cycles: &Cycles,
) -> Vec<(u64, &'static str, Limited)> {
    let without = |unit: &UnitCycles| {
        (
            unit.name,
            Limited::Work,
            Microarchitecture {
                lifted: Some(unit.name),
                ..timing.clone()
            },
        )
    };
    let mut others: Vec<_> = cycles.units.iter().map(without).collect();
    others.push((
        "fragment",
        Limited::Hazard,
        Microarchitecture {
            hazard: 1,
            ..timing.clone()
        },
    ));
    let mut ideal = timing.clone();
    ideal.timing.memory.ideal = true;
    others.push(("memory", Limited::Memory, ideal));
    others
        .into_iter()
        .map(|(name, by, other)| (replay(&other, work, Detail::Accounts).total, name, by))
        .collect()
}

/// The limit is the one whose removal gains most, and no removal that is not tried would gain more.
#[test]
fn lifting_the_limit_gains_most() {
    let work = work();
    let fields: [(&str, &[Value]); 6] = [
        ("raster/lanes", &[json!([1, 1]), json!([8, 8])]),
        ("fragment/hazard", &[json!(500)]),
        ("fragment/merge", &[json!(40)]),
        ("project/interval", &[json!(4000)]),
        ("shade/latency", &[json!(300)]),
        ("memory/bytes_per_cycle", &[json!(1), json!(64)]),
    ];
    let mut met = Vec::new();
    for (field, values) in fields {
        for (value, organisation) in values.iter().flat_map(|value| {
            [Organisation::Immediate, Organisation::Binned]
                .map(|organisation| (value, organisation))
        }) {
            let mut machine = with(&quick(), field, value.clone());
            machine.timing.organisation = organisation;
            let timing = machine.elaborate().unwrap().timing;
            let cycles = replay(&timing, &work, Detail::Accounts);
            let found = limit(&timing, &work, &cycles);
            let least = lifted(&timing, &work, &cycles).into_iter().min().unwrap();
            assert_eq!(
                found.without,
                least.0.min(cycles.total),
                "{field} {value} {organisation:?}: {found:?}, but {least:?}"
            );
            met.push(if found.by == Limited::Hazard {
                "hazard"
            } else {
                found.name
            });
        }
    }
    for name in ["hazard", "memory", "raster", "fragment", "project"] {
        assert!(met.contains(&name), "{name} never is the limit: {met:?}");
    }
}

/// One pixel, repeated: the fragment unit stalls on itself. Memory is busier than any unit, and
/// still limits nothing.
#[test]
fn a_hazard_that_blocks_is_the_limit_not_a_busy_memory() {
    let mut machine = quick();
    machine.timing.fragment.hazard = Some(4096);
    machine.timing.memory.bytes_per_cycle = 2;
    let timing = machine.elaborate().unwrap().timing;
    let cycles = replay(&timing, &work(), Detail::Accounts);
    let busy = |name: &str| {
        cycles
            .units
            .iter()
            .find(|unit| unit.name == name)
            .unwrap()
            .account
            .busy
    };
    let [memory, fragment] = [cycles.memory.busy, busy("fragment")];
    assert!(
        memory > fragment && memory * 2 < cycles.total,
        "{memory} {fragment} {}",
        cycles.total
    );
    let found = limit(&timing, &work(), &cycles);
    assert_eq!((found.name, found.by), ("fragment", Limited::Hazard));
    assert!(
        found.without * 2 < cycles.total,
        "{found:?} of {}",
        cycles.total
    );
}

/// Tiles of any size contain the same pixels, with the same final light.
#[test]
fn tiles_of_any_size_do_the_same_work() {
    let work = work();
    let of = |side: u32| {
        let mut machine = reference();
        (machine.timing.tile.side_px, machine.timing.raster.lanes) = (side, [1, 1]);
        let cycles = replay(
            &machine.elaborate().unwrap().timing,
            &work,
            Detail::Histograms,
        );
        let items = |name: &str| {
            cycles
                .units
                .iter()
                .filter(|unit| unit.name == name)
                .map(|unit| unit.items)
                .sum::<u64>()
        };
        (cycles.stamps, items("fragment"), items("bin"))
    };
    assert!(of(16).1 > 1000);
    for side in [4, 8, 12, 20, 32, 36, 48, 64, 100, 128, 1024] {
        assert_eq!(of(side), of(16), "{side}");
    }
}

/// Machines and their work.
static WORKS: LazyLock<[(Machine, Work); 7]> = LazyLock::new(|| {
    let names = [
        ("reference", None),
        ("window", None),
        ("volume", None),
        ("gaussian", None),
    ];
    let sorters = [SortKind::Tile, SortKind::Hierarchical].map(|kind| ("gaussian", Some(kind)));
    let tested = [("gaussian", Some(SortKind::Radix))];
    let works = [names.as_slice(), &sorters, &tested]
        .concat()
        .into_iter()
        .map(|(name, kind)| {
            let mut machine = Machine::named(name).unwrap();
            let test = BinTest::Ellipse;
            machine.bin = (kind == Some(SortKind::Radix)).then_some(Bin {
                test,
                ..Bin::default()
            });
            let kind = kind.filter(|kind| *kind != SortKind::Radix);
            if let (Some(kind), Some(sort)) = (kind, &mut machine.sort) {
                sort.kind = kind;
                let units = if kind == SortKind::Tile { 1 } else { 3 };
                machine.timing.sort = Some(Sorter {
                    units,
                    buffer_entries: 4,
                    network: 2,
                    ..Sorter::default()
                });
            }
            let is_sheets = ["volume", "gaussian"].contains(&name);
            let work = if is_sheets {
                work_of_sheets(&machine)
            } else {
                work_of(&machine)
            };
            (machine, work)
        });
    let works: [(Machine, Work); 7] = works.collect::<Vec<_>>().try_into().unwrap();
    assert!(
        works.iter().all(|(_, work)| !work.footprints.is_empty()),
        "nothing is drawn"
    );
    let has = |which: fn(&Work) -> bool| works.iter().any(|(_, work)| which(work));
    assert!(
        has(|work| !work.order.is_empty()) && has(|work| work.preshaded),
        "nothing is sorted, or lit in setup"
    );
    works
});

/// Values that select between limits, one of each in turn.
const BETWEEN: [(&str, [u32; 5]); 10] = [
    ("fragment/hazard", [1, 2, 8, 40, 300]),
    ("fragment/merge", [0, 1, 3, 12, 60]),
    ("project/interval", [1, 3, 20, 100, 1000]),
    ("shade/latency", [1, 4, 12, 40, 200]),
    ("shade/interval", [1, 2, 5, 20, 60]),
    ("resolve/interval", [1, 2, 6, 20, 90]),
    ("memory/bytes_per_cycle", [1, 2, 4, 16, 64]),
    ("memory/outstanding", [1, 2, 4, 16, 64]),
    ("raster/fifo", [1, 2, 4, 16, 64]),
    ("tile/buffers", [1, 2, 1, 2, 1]),
];

/// Whether every limit of a machine with these values costs at most its bound, and the limit found
/// costs most.
fn bounds_hold(
    values: &[usize],
    binned: bool,
    which: usize,
    ideal: bool,
) -> Result<(), TestCaseError> {
    let (base, work) = &WORKS[which];
    let mut machine = base.clone();
    for ((field, choice), value) in BETWEEN.iter().zip(values) {
        machine = with(&machine, field, json!(choice[*value]));
    }
    // Forming windows takes 23 cycles.
    machine.timing.fragment.merge += if which == 1 { 23 } else { 0 };
    machine.timing.organisation = if binned {
        Organisation::Binned
    } else {
        Organisation::Immediate
    };
    (machine.timing.technology, machine.timing.memory.ideal) = (Technology::Ideal, ideal);
    let Ok(elaborated) = machine.elaborate() else {
        return Err(TestCaseError::reject("cannot be built"));
    };
    let timing = elaborated.timing;
    let cycles = replay(&timing, work, Detail::Accounts);
    let (lifted, total) = (lifted(&timing, work, &cycles), cycles.total);
    let mut gains = Vec::new();
    for (name, by, at_most) in most_gained(&timing, work, &cycles) {
        let (without, ..) = lifted
            .iter()
            .find(|(_, other, why)| (*other, *why) == (name, by))
            .unwrap();
        // Requests in another order may gain as much again, where others stall on one of them.
        let reordered = if ideal || by == Limited::Memory {
            0
        } else {
            total / 20
        };
        prop_assert!(
            total <= without + at_most + reordered,
            "{} {:?}: {} of {} cycles, but {} at most",
            name,
            by,
            without,
            total,
            at_most
        );
        gains.push(total.saturating_sub(*without).min(at_most));
    }
    let found = limit(&timing, work, &cycles);
    prop_assert_eq!(
        Some(total - found.without),
        gains.iter().max().copied(),
        "{:?}, but {:?}",
        found,
        gains
    );
    Ok(())
}

/// A case in which a bound was wrong in the past.
#[test]
fn bounds_on_limits_hold_in_a_former_failure() {
    bounds_hold(&[0, 0, 0, 1, 2, 0, 2, 0, 0, 0], true, 2, false).unwrap();
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 120, failure_persistence: None, ..ProptestConfig::default() })]

    /// Limits whose bound is below the found gain are not tried; so none of them would gain more.
    #[test]
    fn no_limit_costs_more_than_its_bound_without_a_replay(
        values in prop::collection::vec(0..5usize, BETWEEN.len()), binned in any::<bool>(), which in 0..7usize, ideal in prop::bool::weighted(0.25),
    ) {
        bounds_hold(&values, binned, which, ideal)?;
    }
}

/// Bits of multiplexers, registers and adders of `fetch`, and the places of the FIFO of records.
fn fetch_of(splats: Option<u32>) -> (u64, u32) {
    let mut machine = reference();
    (machine.timing.project.units, machine.timing.fetch.splats) = (4, splats);
    let built = machine.elaborate().unwrap();
    let bits = |part: &Part| {
        let bits = match part.operator {
            Operator::Choice([words, bits]) => (words - 1) * bits,
            Operator::Multiplexer(bits) | Operator::Register(bits) | Operator::Adder(bits) => bits,
            _ => panic!("{part:?}"),
        };
        u64::from(part.copies) * bits as u64
    };
    let of_fetch = built.parts.iter().filter(|part| part.unit == unit::FETCH);
    let fifo = built.timing.storage.fifos[0];
    (of_fetch.map(bits).sum(), fifo.places)
}

#[test]
fn each_further_record_of_a_cycle_takes_more_parts_and_no_places() {
    assert_eq!(fetch_of(None), fetch_of(Some(1)));
    let all = [1, 2, 3, 4].map(|splats| fetch_of(Some(splats)));
    assert_eq!(all.map(|(_, places)| places), [16, 16, 18, 16]);
    assert!(
        all.windows(2).all(|pair| {
            let record = u64::from(8 * reference().elaborate().unwrap().timing.splat_bytes);
            pair[1].0 > pair[0].0 + 4 * record
        }),
        "{all:?}"
    );
}

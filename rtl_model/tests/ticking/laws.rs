//! Which times are known in closed form, and can more of anything make a frame slower?

use crate::frames::Rng;
use crate::machines::{elaborate, ideal, random, several, sorting_lists};
use crate::scene::{End, Scene, Splat};
use crate::{immediate, scene};
use rtl_model::Machine;
use rtl_model::elaboration::microarchitecture::Microarchitecture;
use rtl_model::machine::SortKind;
use rtl_model::machine::timing::{Cache, Memory, Organisation, Queue, Sorter, Tile, Timing};
use rtl_model::timing::{Detail, EarlyTermination, Requester, limit, limits, replay, replay_all};
use rtl_model::work::{CullReason, Event};

/// This many splats on one pixel, the whole picture, and the pixel's final fragments.
fn dots(splats: usize, lit: u8, unlit: u8) -> Scene {
    Scene {
        width: 1,
        height: 1,
        splats: vec![Splat::dot([0, 0], Event::Accumulated); splats],
        ends: vec![End { lit, unlit }],
        preshaded: false,
        shared_axes: false,
        harmonics: 0,
        order: Vec::new(),
        keys: Vec::new(),
        unlisted: Default::default(),
        masks: Default::default(),
        blocks: None,
        kept: None,
        mirrored: None,
    }
}

/// One unit of each kind, and FIFOs deep enough for memory stalls.
fn single(rng: &mut Rng) -> Timing {
    let mut timing = random(rng);
    (timing.project.units, timing.ellipse.units) = (1, 1);
    timing.fetch.splats = None;
    timing.memory = ideal(1 + rng.below(30) as u32, 1 << 16, 64);
    timing.fetch.fifo = 64;
    // Laws in closed form; `a_row_of_a_box_takes_the_cycles_of_its_set_up`.
    (timing.raster.row_cycles, timing.tile.clear_cycles) = (None, None);
    timing
}

/// Cycles of both implementations, which must agree.
fn cycles(timing: Timing, scene: &Scene) -> u64 {
    let timing = elaborate(timing);
    let total = replay(&timing, &scene.record(), Detail::Accounts).total;
    assert_eq!(immediate::draw(&timing, scene).total, total);
    total
}

#[test]
fn a_frame_without_splats_is_resolved_at_once() {
    for seed in 0..200 {
        let timing = single(&mut Rng(seed));
        // Resolve takes the line in cycle 0; its word goes through it, then through memory.
        let resolve = timing.resolve.interval + timing.resolve.latency.unwrap();
        assert_eq!(
            cycles(timing, &dots(0, 0, 0)),
            u64::from(resolve + 1 + timing.memory.hit_latency)
        );
    }
}

#[test]
fn a_splat_of_a_pixel_takes_the_sum_of_all_latencies() {
    for seed in 0..300 {
        let mut rng = Rng(seed);
        let timing = single(&mut rng);
        let [lit, unlit] = [3, 3].map(|most| rng.below(most) as u8);
        let memory = 1 + timing.memory.hit_latency;
        let stages = [
            timing.project.latency,
            timing.ellipse.latency,
            timing.raster.latency,
            timing.gauss.latency,
        ];
        let written = memory
            + stages.map(Option::unwrap).iter().sum::<u32>()
            + timing.cache.latency
            + timing.fragment.latency.unwrap();
        let held = (u32::from(unlit) * timing.shade.interval)
            .max((lit + unlit).into())
            .max(timing.resolve.interval);
        let light = if unlit > 0 {
            timing.shade.latency.unwrap()
        } else {
            0
        };
        let total = written + held + light + timing.resolve.latency.unwrap() + memory;
        assert_eq!(
            cycles(timing, &dots(1, lit, unlit)),
            u64::from(total),
            "seed {seed}"
        );
    }
}

#[test]
fn a_row_of_a_box_takes_the_cycles_of_its_set_up() {
    for seed in 0..100 {
        let timing = single(&mut Rng(seed));
        let mut other = timing;
        other.raster.row_cycles = Some(7);
        let [plain, set_up] = [timing, other].map(|timing| cycles(timing, &dots(1, 1, 0)));
        assert_eq!(set_up, plain + 7, "seed {seed}");
    }
}

#[test]
fn splats_in_a_row_take_the_largest_interval_each() {
    for seed in 0..300 {
        let mut rng = Rng(seed);
        let timing = single(&mut rng);
        let splats = 2 + rng.below(40);
        // Every splat has the same pixel, so that the fragment unit's interval is the hazard.
        let intervals = [
            timing.project.interval,
            timing.ellipse.interval,
            timing.fragment.hazard,
        ]
        .map(Option::unwrap);
        let slowest = intervals.into_iter().max().unwrap();
        let one = cycles(timing, &dots(1, 0, 0));
        assert_eq!(
            cycles(timing, &dots(splats as usize, 0, 0)),
            one + (splats - 1) * u64::from(slowest),
            "seed {seed}"
        );
    }
}

/// For a stopped pixel, list reads nothing more and raster drops the entries that have arrived, for
/// any number of later splats.
#[test]
fn a_stopped_pixel_takes_no_cycles() {
    for seed in 0..60 {
        let mut rng = Rng(seed);
        let timing = Timing {
            organisation: Organisation::Binned,
            ..single(&mut rng)
        };
        let timing = elaborate(timing);
        let second_pass = |splats: usize, stops: bool| {
            let mut scene = dots(splats, 1, 0);
            if stops {
                scene.splats[2].pixels[0] = Some(Event::Stopped);
            }
            let replayed = replay(&timing, &scene.record(), Detail::Accounts);
            let items = |name: &str| {
                replayed
                    .units
                    .iter()
                    .find(|unit| unit.name == name)
                    .unwrap()
                    .items
            };
            let all = splats as u64;
            // A splat has one entry and one contribution here.
            let saved = stops.then(|| EarlyTermination {
                entries_skipped: all - items("list"),
                entries: all,
                contributions_left_out: all - items("fragment"),
                contributions: all,
            });
            assert_eq!(replayed.early_termination, saved, "seed {seed}");
            [
                items("list"),
                items("raster"),
                items("gauss"),
                items("fragment"),
            ]
        };
        assert_eq!(second_pass(2000, false), [2000; 4]);
        let [few, many] = [1000, 2000].map(|splats| second_pass(splats, true));
        assert!(
            few == many && many[0] < 600,
            "seed {seed}: {few:?} {many:?}"
        );
        // Each entry of the list is walked, or dropped by raster.
        assert!(
            many[0] == many[1] && many[2] < many[1] && many[2] == many[3],
            "seed {seed}: {many:?}"
        );
    }
}

type TimingField = fn(&mut Timing) -> &mut u32;

/// Numbers of a machine that can be raised.
const RAISES: [(&str, TimingField); 12] = [
    ("fetch.fifo", |timing| &mut timing.fetch.fifo),
    ("fetch.splats", |timing| {
        timing.fetch.splats.get_or_insert(1)
    }),
    ("project.fifo", |timing| &mut timing.project.fifo),
    ("project.units", |timing| &mut timing.project.units),
    ("ellipse.fifo", |timing| &mut timing.ellipse.fifo),
    ("ellipse.units", |timing| &mut timing.ellipse.units),
    ("raster.fifo", |timing| &mut timing.raster.fifo),
    ("gauss.fifo", |timing| &mut timing.gauss.fifo),
    ("cache.fifo", |timing| &mut timing.cache.fifo),
    ("cache.misses", |timing| &mut timing.cache.misses),
    ("tile.buffers", |timing| &mut timing.tile.buffers),
    ("memory.outstanding", |timing| {
        &mut timing.memory.outstanding
    }),
];

/// Fields that make a frame slower when raised: name, number of cases, and the first case.
type Slower = Vec<(&'static str, u64, u64)>;

fn note(found: &mut Slower, name: &'static str, seed: u64) {
    match found.iter_mut().find(|(other, ..)| *other == name) {
        Some((_, count, _)) => *count += 1,
        None => found.push((name, 1, seed)),
    }
}

/// Fields that make a frame slower when raised, in this many cases.
fn slower(cases: u64, of: impl Fn(&mut Rng) -> Timing) -> Slower {
    let mut found = Slower::new();
    for seed in 0..cases {
        let mut rng = Rng(seed);
        let timing = of(&mut rng);
        let scene = scene::random(&mut rng, [30, 30], 20).record();
        let before = replay(&elaborate(timing), &scene, Detail::Accounts).total;
        for (name, field) in RAISES {
            let mut more = timing;
            *field(&mut more) += 1 + rng.below(4) as u32;
            more.tile.buffers = more.tile.buffers.min(2);
            let units = more.project.units;
            more.fetch.splats = more.fetch.splats.map(|splats| splats.min(units));
            if replay(&elaborate(more), &scene, Detail::Accounts).total > before {
                note(&mut found, name, seed);
            }
        }
    }
    found
}

/// Culled splats end in `project`. With memory that stalls nothing, a splat is read in a cycle with as
/// many others as fetch reads.
#[test]
fn fetch_reads_as_many_records_per_cycle_as_it_may() {
    for splats in 1..=7 {
        let mut timing = single(&mut Rng(splats.into()));
        (timing.project.units, timing.project.interval) = (7, Some(1));
        (timing.fetch.fifo, timing.fetch.splats) = (1024, Some(splats));
        let mut scene = dots(100, 0, 0);
        scene.splats = vec![Splat::culled(CullReason::Outside); 100];
        let timing = elaborate(timing);
        let units = replay(&timing, &scene.record(), Detail::Log).units;
        let fetched: Vec<u64> = (0..100).map(|nth| nth / u64::from(splats)).collect();
        let fetch: Vec<_> = units.iter().filter(|unit| unit.name == "fetch").collect();
        assert_eq!((fetch.len(), &fetch[0].log), (splats as usize, &fetched));
        let items = fetch.iter().map(|unit| unit.items);
        assert_eq!(items.max(), Some(100_u64.div_ceil(splats.into())));
    }
}

#[test]
fn more_of_anything_is_never_slower_if_the_cache_holds_all() {
    let found = slower(1000, |rng| {
        let timing = random(rng);
        Timing {
            cache: Cache {
                lines: 16_384,
                ways: 64,
                ..timing.cache
            },
            ..timing
        }
    });
    assert_eq!(found, []);
}

/// The cache's lines depend only on the order of stamps, and a look-up waits for all before it.
#[test]
fn more_of_anything_is_never_slower_if_lines_come_and_go() {
    assert_eq!(slower(2000, random), []);
}

#[test]
fn more_of_anything_but_requests_is_never_slower_if_tiles_are_binned() {
    let mut found = slower(1500, |rng| {
        let timing = Timing {
            organisation: Organisation::Binned,
            ..random(rng)
        };
        Timing {
            tile: Tile {
                buffers: 1 + rng.below(2) as u32,
                ..timing.tile
            },
            ..timing
        }
    });
    found.retain(|(name, ..)| *name != "memory.outstanding");
    assert_eq!(found, []);
}

type Setting = fn(&mut Timing, u32);

/// Units that can be replicated, and the numbers that are tried.
const REPLICATED: [(&str, Setting); 5] = [
    ("fragment.units", |timing, more| {
        timing.fragment.units = Some((timing.fragment.units.unwrap_or(1) << (1 + more % 2)).min(16))
    }),
    ("fragment.merges_in_flight", |timing, more| {
        timing.fragment.merges_in_flight =
            Some(timing.fragment.merges_in_flight.unwrap_or(1) + more)
    }),
    ("shade.units", |timing, more| {
        timing.shade.units = Some(timing.shade.units.unwrap_or(1) + more)
    }),
    ("resolve.units", |timing, more| {
        timing.resolve.units = Some(timing.resolve.units.unwrap_or(1) + more)
    }),
    ("engines", |timing, more| {
        timing.engines = Some(timing.engines.unwrap_or(1) + more)
    }),
];

/// Units that make a frame slower when replicated: in how many of this many cases, and the first
/// case.
fn slower_in_parallel(cases: u64, of: impl Fn(&mut Rng) -> Timing) -> Slower {
    let mut found = Slower::new();
    for seed in 0..cases {
        let mut rng = Rng(seed);
        let timing = of(&mut rng);
        let scene = scene::random(&mut rng, [60, 40], 40).record();
        let before = replay(&elaborate(timing), &scene, Detail::Accounts).total;
        for (name, more_of) in REPLICATED
            .into_iter()
            .filter(|(name, _)| timing.organisation == Organisation::Binned || *name != "engines")
        {
            let mut more = timing;
            more_of(&mut more, 1 + rng.below(3) as u32);
            if replay(&elaborate(more), &scene, Detail::Accounts).total > before {
                note(&mut found, name, seed);
            }
        }
    }
    found
}

#[test]
fn more_parallel_units_are_never_slower() {
    let found = slower_in_parallel(800, |rng| {
        let timing = random(rng);
        several(rng, timing)
    });
    assert_eq!(found, []);
}

fn several_binned(rng: &mut Rng) -> Timing {
    let timing = Timing {
        organisation: Organisation::Binned,
        ..random(rng)
    };
    several(rng, timing)
}

#[test]
fn several_engines_are_never_slower_than_one_nor_more_units_in_that() {
    assert_eq!(
        slower_in_parallel(800, |rng| Timing {
            engines: None,
            ..several_binned(rng)
        }),
        []
    );
}

/// The engine that takes a tile depends on when lists end, not on the work behind them. With three
/// engines a tile may queue behind more work than with two.
#[test]
fn more_engines_can_be_slower_than_several_but_seldom_are() {
    let cases = 1500;
    let found = slower_in_parallel(cases, several_binned);
    assert!(
        found.iter().any(|(name, ..)| *name == "engines"),
        "{found:?}"
    );
    assert!(
        found.iter().all(|(_, count, _)| count * 100 < cases),
        "{found:?}"
    );
}

/// An entry that begins a burst issues two requests, but waits until one place is free. With five
/// in flight that one may be a splat, which was requested late; with four it is a burst of the
/// list.
#[test]
fn more_requests_can_be_slower_if_tiles_are_binned() {
    let scene = Scene {
        width: 4,
        height: 1,
        splats: (0..4)
            .map(|x| Splat::dot([x, 0], Event::Accumulated))
            .collect(),
        ends: vec![End::default(); 4],
        preshaded: false,
        shared_axes: false,
        harmonics: 0,
        order: Vec::new(),
        keys: Vec::new(),
        unlisted: Default::default(),
        masks: Default::default(),
        blocks: None,
        kept: None,
        mirrored: None,
    };
    let total = |outstanding: u32| {
        let timing = Timing {
            organisation: Organisation::Binned,
            memory: ideal(8, outstanding, 4),
            ..Machine::named("tiny").unwrap().timing
        };
        replay(&elaborate(timing), &scene.record(), Detail::Accounts).total
    };
    assert_eq!(total(5), total(4) + 8);
}

/// One channel serves requests in order of issue. An earlier request may take the place of a more
/// urgent one.
#[test]
fn more_of_something_can_be_slower_where_memory_is_shared() {
    let found = slower(600, |rng| {
        let timing = random(rng);
        Timing {
            memory: Memory {
                ideal: false,
                bytes_per_cycle: 4 << rng.below(5),
                ..timing.memory
            },
            ..timing
        }
    });
    assert!(!found.is_empty());
}

/// A wide stamp waits for all of its lines and all of its pixels.
#[test]
fn wider_lanes_can_be_slower() {
    let mut counts = [0; 3];
    for seed in 0..600 {
        let mut rng = Rng(seed);
        let mut timing = random(&mut rng);
        let scene = scene::random(&mut rng, [30, 30], 20).record();
        let before = replay(&elaborate(timing), &scene, Detail::Accounts).total;
        timing.raster.lanes = timing.raster.lanes.map(|lanes| 2 * lanes);
        counts[(1 + replay(&elaborate(timing), &scene, Detail::Accounts)
            .total
            .cmp(&before) as i8) as usize] += 1;
    }
    let [faster, _, slower] = counts;
    assert!(faster > 5 * slower && slower > 0, "{counts:?}");
}

/// In a batched replay each machine takes the time that it takes alone: machines that process tiles
/// alike, machines that do not, and machines with an infinitely fast part.
#[test]
fn a_batched_replay_equals_single_replays() {
    let (mut together, mut stamps, mut merges) = (0, 0, 0);
    for seed in 0..300 {
        let mut rng = Rng(seed);
        let mut scene = scene::random(&mut rng, [70, 40], 40);
        scene.preshaded = rng.below(4) == 0;
        let work = scene.record();
        let first = Timing {
            organisation: Organisation::Binned,
            ..random(&mut rng)
        };
        let lanes = if rng.below(4) == 0 {
            [16, 1]
        } else {
            first.raster.lanes
        };
        let side_px = [16, 16, 32, 48][rng.below(4) as usize];
        let mut machines: Vec<_> = (0..2 + rng.below(9))
            .map(|_| {
                let mut timing = Timing {
                    organisation: Organisation::Binned,
                    ..random(&mut rng)
                };
                (
                    timing.raster.lanes,
                    timing.tile.side_px,
                    timing.tile.buffers,
                ) = (lanes, side_px, 1 + rng.below(2) as u32);
                // Only fields of units behind the lists may differ.
                if rng.below(2) == 0 {
                    let Timing {
                        fetch,
                        project,
                        ellipse,
                        colour,
                        memory,
                        ..
                    } = first;
                    timing = Timing {
                        fetch,
                        project,
                        ellipse,
                        colour,
                        memory,
                        ..timing
                    };
                }
                // FIFOs fill up where fragment is slow.
                if rng.below(2) == 0 {
                    (timing.fragment.hazard, timing.fragment.merge) =
                        (Some(1 + rng.below(60) as u32), rng.below(40) as u32);
                }
                timing.queue = if rng.below(4) == 0 {
                    Queue::Longest
                } else {
                    Queue::Order
                };
                if rng.below(20) == 0 {
                    several(&mut rng, timing)
                } else {
                    timing
                }
            })
            .map(elaborate)
            .collect();
        for name in [
            "fetch", "project", "bin", "list", "raster", "gauss", "fragment", "shade", "resolve",
        ] {
            let like = &machines[rng.below(machines.len() as u64) as usize];
            machines.push(Microarchitecture {
                lifted: Some(name),
                ..like.clone()
            });
        }
        let mut ideal = machines[0].clone();
        ideal.timing.memory.ideal = true;
        machines.extend([
            Microarchitecture {
                hazard: 1,
                ..machines[0].clone()
            },
            ideal,
            elaborate(random(&mut rng)),
        ]);

        let all: Vec<&Microarchitecture> = machines.iter().collect();
        for detail in [Detail::Total, Detail::Accounts, Detail::Histograms] {
            for (nth, (machine, cycles)) in machines
                .iter()
                .zip(replay_all(&all, &work, detail))
                .enumerate()
            {
                assert_eq!(
                    cycles,
                    replay(machine, &work, detail),
                    "seed {seed}, machine {nth}"
                );
            }
        }
        let cycles: Vec<_> = machines
            .iter()
            .map(|machine| replay(machine, &work, Detail::Accounts))
            .collect();
        let frames: Vec<_> = all.iter().copied().zip(&cycles).collect();
        let one_by_one: Vec<_> = frames
            .iter()
            .map(|(machine, cycles)| limit(machine, &work, cycles))
            .collect();
        assert_eq!(limits(&frames, &work), one_by_one, "seed {seed}");
        if !work.stops() {
            together += machines
                .iter()
                .filter(|machine| machine.is_single())
                .count();
            stamps += cycles[0].stamps[1];
            merges += cycles[0]
                .units
                .iter()
                .filter(|unit| unit.name == "shade")
                .map(|unit| unit.items)
                .sum::<u64>();
        }
    }
    assert!(
        together > 4000 && stamps > 12_000 && merges > 4000,
        "{together} machines, {stamps} stamps, {merges} fragments to shade"
    );
}

/// One list with this many entries, in one tile.
fn list(splats: usize, keys: impl Fn(u32) -> u32) -> Scene {
    let scene = dots(splats, 1, 0);
    Scene {
        order: (0..splats).collect(),
        keys: (0..splats as u32).map(keys).collect(),
        ..scene
    }
}

/// Busy cycles of the sorter of a list, and the bytes that it reads and writes, in bursts of 64.
/// Memory responds immediately.
fn sorted(kind: SortKind, sorter: Sorter, scene: &Scene) -> (u64, [u64; 2]) {
    let mut machine = Machine::named("gaussian").unwrap();
    machine.sort.as_mut().unwrap().kind = kind;
    machine.timing.sort = Some(sorter);
    machine.timing.memory = ideal(1, 1 << 16, 64);
    let replayed = replay(
        &machine.elaborate().unwrap().timing,
        &scene.record(),
        Detail::Accounts,
    );
    let busy = replayed
        .units
        .iter()
        .filter(|unit| unit.name == "sort")
        .map(|unit| unit.account.busy)
        .sum();
    (busy, replayed.memory.bytes[Requester::Sort as usize])
}

/// Worked out by hand: runs of the network, its stages, ⌈log2(n/network)⌉·n cycles of merging
/// (GSCore's chunks), and nothing spilled.
#[test]
fn a_list_that_fits_the_buffer_takes_its_formula() {
    let sorter = |buffer_entries, network| Sorter {
        overlap: false,
        units: 1,
        buffer_entries,
        network,
        bucket_bits: None,
    };
    let up = |key| key << 12;
    // 7 bytes per entry, 4 of which are its number.
    assert_eq!(
        sorted(SortKind::Tile, sorter(256, 16), &list(256, up)),
        (16 + 10 + 4 * 256, [1792, 1024])
    );
    assert_eq!(
        sorted(SortKind::Tile, sorter(256, 16), &list(100, up)),
        (7 + 10 + 3 * 100, [704, 448])
    );
    assert_eq!(
        sorted(SortKind::Tile, sorter(256, 16), &list(5, up)),
        (1 + 10, [64, 64])
    );
    assert_eq!(
        sorted(SortKind::Tile, sorter(256, 256), &list(256, up)),
        (1 + 36, [1792, 1024])
    );
    assert_eq!(
        sorted(SortKind::Tile, sorter(256, 1), &list(256, up)),
        (256 + 8 * 256, [1792, 1024])
    );
    // A list that fits is not distributed.
    assert_eq!(
        sorted(SortKind::Hierarchical, sorter(256, 16), &list(256, up)),
        sorted(SortKind::Tile, sorter(256, 16), &list(256, up))
    );
}

/// Worked out by hand. For 1024 entries: four chunks of 256 and two passes of merging in memory; or
/// 4 of 16 buckets with 256 entries each, none of which is merged; or one bucket with all entries.
#[test]
fn a_list_that_does_not_fit_is_spilled() {
    let sorter = |bucket_bits| Sorter {
        overlap: false,
        units: 1,
        buffer_entries: 256,
        network: 16,
        bucket_bits,
    };
    let chunks = 4 * (16 + 10 + 4 * 256);
    let [keyed, numbers] = [7 * 1024, 4 * 1024];
    let even = list(1024, |key| (key / 256) << 20);
    assert_eq!(
        sorted(SortKind::Tile, sorter(None), &even),
        (chunks + 2 * 1024, [3 * keyed, 2 * keyed + numbers])
    );
    assert_eq!(
        sorted(SortKind::Hierarchical, sorter(Some(4)), &even),
        (chunks + 1024, [2 * keyed, keyed + numbers])
    );
    let same = list(1024, |_| 7 << 20);
    assert_eq!(
        sorted(SortKind::Hierarchical, sorter(Some(4)), &same),
        (chunks + 3 * 1024, [4 * keyed, 3 * keyed + numbers])
    );
}

/// Sorters do not share lists. More of them take at most as long, and a larger buffer never spills
/// more.
#[test]
fn more_sorters_are_never_slower_on_memory_without_limits() {
    for seed in 0..200 {
        let mut rng = Rng(seed);
        let timing = Timing {
            organisation: Organisation::Binned,
            ..random(&mut rng)
        };
        let machine = sorting_lists(&mut rng, timing);
        let work = scene::random(&mut rng, [60, 50], 200)
            .sorted(&mut rng)
            .record();
        let of = |change: &dyn Fn(&mut Sorter)| {
            let mut other = machine.clone();
            change(other.timing.sort.as_mut().unwrap());
            replay(&other.elaborate().unwrap().timing, &work, Detail::Accounts)
        };
        let [one, two] = [1, 2].map(|units| of(&|sorter: &mut Sorter| sorter.units = units));
        assert!(
            two.total <= one.total,
            "seed {seed}: {} of one, {} of two",
            one.total,
            two.total
        );
        let bytes = |entries: u32| {
            let replayed =
                of(&|sorter: &mut Sorter| sorter.buffer_entries = entries.max(sorter.network));
            replayed.memory.bytes[Requester::Sort as usize]
                .iter()
                .sum::<u64>()
        };
        assert!(
            machine.sort.unwrap().kind != SortKind::Tile || bytes(4096) <= bytes(64),
            "seed {seed}"
        );
    }
}

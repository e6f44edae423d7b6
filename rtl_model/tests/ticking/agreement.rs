//! Do ticked and replayed frames agree in every number, on any machine and any work?

use crate::frames::{Rng, ellipsoids, frame};
use crate::memory::Traffic;
use crate::parts::{Ticked, UnitInstance};
use crate::scene::Scene;
use crate::{binned, immediate, machines, scene};
use rtl_model::Machine;
use rtl_model::elaboration::microarchitecture::Microarchitecture;
use rtl_model::machine::timing::{Organisation, Timing};
use rtl_model::pipeline::draw_measured;
use rtl_model::timing::{
    Account, Cycles, Detail, MaskCounts, Share, TileCycles, UnitCycles, replay,
};
use rtl_model::work::Work;
use std::collections::BTreeMap;

/// First number in which they differ.
fn difference(ticked: &Ticked, replayed: &Cycles) -> Option<String> {
    let mut others = replayed.units.iter();
    for unit in &ticked.units {
        for (place, instance) in unit.instances.iter().enumerate() {
            let other = others.next().filter(|other| {
                other.name == unit.name && other.index as usize == unit.others as usize + place
            });
            let Some(other) = other else {
                return Some(format!("{} {place} is missing", unit.name));
            };
            if place == 0 && unit.log != other.log {
                let at = unit
                    .log
                    .iter()
                    .zip(&other.log)
                    .take_while(|(ticked, replayed)| ticked == replayed)
                    .count();
                let [ticked, replayed] =
                    [&unit.log, &other.log].map(|log| (log.len(), log.get(at)));
                return Some(format!(
                    "{} takes item {at} (item, cycle): ticked {ticked:?}, replayed {replayed:?}",
                    unit.name
                ));
            }
            let [ticked, replayed] = [
                (instance.items, instance.account),
                (other.items, other.account),
            ];
            if ticked != replayed {
                return Some(format!(
                    "{} {place}: ticked {ticked:?}, replayed {replayed:?}",
                    unit.name
                ));
            }
            if place == 0 && !unit.occupancy.is_empty() && unit.occupancy != other.occupancy {
                return Some(format!(
                    "behind {}: ticked {:?}, replayed {:?}",
                    unit.name, unit.occupancy, other.occupancy
                ));
            }
        }
    }
    if others.next().is_some() {
        return Some("a unit does not tick".into());
    }
    let [ticked, replayed] = [
        (ticked.total, ticked.lookups, ticked.texels, ticked.stamps),
        (
            replayed.total,
            replayed.lookups,
            replayed.texels,
            replayed.stamps,
        ),
    ];
    (ticked != replayed).then(|| {
        format!("total, look-ups, texels, stamps: ticked {ticked:?}, replayed {replayed:?}")
    })
}

/// Traffic does not depend on timing.
pub fn difference_in_traffic(ticked: &Ticked, replayed: &Cycles) -> Option<String> {
    let Traffic { bytes, bursts, .. } = ticked.traffic;
    let [ticked, replayed] = [
        (bytes, bursts),
        (replayed.memory.bytes, replayed.memory.requests),
    ];
    (ticked != replayed)
        .then(|| format!("bytes and bursts: ticked {ticked:?}, replayed {replayed:?}"))
}

pub fn tick(timing: &Microarchitecture, scene: &Scene) -> Ticked {
    match timing.timing.organisation {
        Organisation::Immediate => immediate::draw(timing, scene),
        Organisation::Binned => binned::draw(timing, scene),
    }
}

/// Cycles as reported at this level of detail.
fn at_detail(cycles: Cycles, detail: Detail) -> Cycles {
    let reported = if detail == Detail::Total {
        Vec::new()
    } else {
        cycles.units
    };
    let of = |unit: UnitCycles| match detail {
        Detail::Accounts => UnitCycles {
            log: Vec::new(),
            timeline: None,
            occupancy: Vec::new(),
            ..unit
        },
        _ => UnitCycles {
            log: Vec::new(),
            ..unit
        },
    };
    let tiles = cycles.tiles.filter(|_| detail >= Detail::Histograms);
    Cycles {
        units: reported.into_iter().map(of).collect(),
        requests: Vec::new(),
        tiles,
        ..cycles
    }
}

/// First engine whose tiles differ from its units' activity.
fn difference_in_shares(
    (name, base): (&str, &str),
    mut from: u64,
    (drawn, shares): (&[&TileCycles], &[Share]),
    instance: Option<(&UnitInstance, Option<&Vec<u64>>)>,
    stops: bool,
) -> Option<String> {
    // Shares are contiguous and cover all cycles.
    for Share {
        until,
        account:
            Account {
                busy,
                starved,
                blocked,
                memory,
            },
    } in shares
    {
        if from + busy + starved + blocked + memory != *until {
            return Some(format!(
                "{name}: a share from {from} to {until} has other cycles"
            ));
        }
        from = *until;
    }
    let sum = |of: fn(&Account) -> u64| shares.iter().map(|share| of(&share.account)).sum::<u64>();
    let shared = [
        sum(|account| account.busy),
        sum(|account| account.blocked),
        sum(|account| account.memory),
    ];
    // A shade unit used by setup did the same work before.
    if base == "shade" && shared == [0; 3] {
        return None;
    }
    let Some((UnitInstance { account: whole, .. }, log)) = instance else {
        return Some(format!("{name} does not tick"));
    };
    if shared != [whole.busy, whole.blocked, whole.memory] {
        return Some(format!("{name}: shares have {shared:?} of {whole:?}"));
    }
    let taken = log?;
    match base {
        "resolve" => {
            let starts: Vec<u64> = shares
                .iter()
                .map(|share| share.until - share.account.busy)
                .collect();
            (starts != *taken).then(|| format!("{name} takes tiles at {taken:?}, not {starts:?}"))
        }
        "list" if !stops => {
            let mut entries = 0;
            for (tile, share) in drawn.iter().zip(shares) {
                entries += tile.entries as usize;
                if taken
                    .get(entries - 1)
                    .is_none_or(|last| last + 1 != share.until)
                {
                    return Some(format!(
                        "list takes the last of {entries} entries at {:?}",
                        taken.get(entries - 1)
                    ));
                }
            }
            None
        }
        _ => None,
    }
}

/// First tile of a frame that differs from its units' activity.
fn difference_in_tiles(
    ticked: &Ticked,
    replayed: &Cycles,
    engines: u32,
    stops: bool,
) -> Option<String> {
    let Some(tiles) = &replayed.tiles else {
        // Without an entry there are no tiles.
        let is_drawn = ticked
            .units
            .iter()
            .any(|unit| unit.name == "list" && !unit.log.is_empty());
        return is_drawn.then(|| "there are none".into());
    };
    for engine in 0..engines as usize {
        let drawn: Vec<&TileCycles> = tiles
            .tiles
            .iter()
            .filter(|tile| tile.engine as usize == engine)
            .collect();
        for (nth, name) in tiles.units.iter().enumerate() {
            let shares: Vec<Share> = drawn.iter().map(|tile| tile.shares[nth]).collect();
            let (base, own) = name
                .split_once('.')
                .map_or((name.as_str(), 0), |(base, own)| {
                    (base, own.parse().unwrap())
                });
            let each = tiles
                .units
                .iter()
                .filter(|other| other.split('.').next() == Some(base))
                .count();
            // The first cycle of instances other than the first is unknown: logs cover all.
            let instance = ticked
                .units
                .iter()
                .filter(|unit| unit.name == base)
                .find_map(|unit| {
                    let place = (engine * each + own).checked_sub(unit.others as usize)?;
                    unit.instances.get(place).map(|instance| {
                        (instance, (unit.instances.len() == 1).then_some(&unit.log))
                    })
                });
            if let Some(difference) =
                difference_in_shares((name, base), tiles.from, (&drawn, &shares), instance, stops)
            {
                return Some(difference);
            }
        }
    }
    let sum: u64 = tiles.tiles.iter().map(|tile| tile.cycles).sum();
    let end = tiles.tiles.iter().map(|tile| tile.done).max()?;
    (tiles.from + sum != end || end > ticked.total)
        .then(|| format!("{} + {sum} is not {end}", tiles.from))
}

fn compare(timing: &Microarchitecture, scene: &Scene, work: &Work) -> Result<Ticked, String> {
    let ticked = tick(timing, scene);
    let replayed = replay(timing, work, Detail::Log);
    for detail in [Detail::Total, Detail::Accounts, Detail::Histograms] {
        let [brief, all] = [replay(timing, work, detail), replayed.clone()]
            .map(|cycles| at_detail(cycles, detail));
        assert_eq!(brief, all);
    }
    let in_tiles = || match timing.timing.organisation {
        Organisation::Immediate => replayed
            .tiles
            .as_ref()
            .map(|_| "an immediate machine has no tiles".into()),
        Organisation::Binned => {
            difference_in_tiles(&ticked, &replayed, timing.engines, work.stops())
        }
    };
    match difference(&ticked, &replayed)
        .or_else(|| difference_in_traffic(&ticked, &replayed))
        .or_else(in_tiles)
    {
        Some(difference) => Err(difference),
        None => Ok(ticked),
    }
}

/// Counts of events, to check that each kind really occurs.
#[derive(Default)]
struct EventCounts(BTreeMap<String, u64>);

impl EventCounts {
    fn count(&mut self, ticked: &Ticked) {
        for unit in &ticked.units {
            for instance in &unit.instances {
                let account = instance.account;
                for (what, cycles) in [
                    ("busy", account.busy),
                    ("starved", account.starved),
                    ("memory", account.memory),
                    ("blocked", account.blocked),
                ] {
                    *self.0.entry(format!("{} {what}", unit.name)).or_default() += cycles;
                }
            }
        }
        *self.0.entry("look-ups".into()).or_default() += ticked.lookups[0];
        *self.0.entry("texels".into()).or_default() += ticked.texels[0];
        *self.0.entry("texel hits".into()).or_default() += ticked.texels[1];
        *self.0.entry("misses".into()).or_default() += ticked.lookups[0] - ticked.lookups[1];
    }

    /// Required counts for drawn frames, where a third of the rare events may be missing.
    fn require_of_drawn(&self, never: &[&str]) {
        if crate::tier::tier() == crate::tier::Tier::Full {
            return self.require(15, never);
        }
        assert!(
            self.0
                .iter()
                .all(|(what, cycles)| *cycles == 0 || !never.contains(&what.as_str())),
            "{:?}",
            self.0
        );
        assert!(
            self.0["fragment blocked"] > 15 && self.0["resolve busy"] > 15,
            "{:?}",
            self.0
        );
    }

    fn require(&self, least: u64, never: &[&str]) {
        for (what, cycles) in &self.0 {
            // Few drawn frames have a colour that can block.
            let least = if what == "colour blocked" {
                least / 8
            } else {
                least
            };
            assert!(
                if never.contains(&what.as_str()) {
                    *cycles == 0
                } else {
                    *cycles > least
                },
                "{what}: {:?}",
                self.0
            );
        }
    }
}

/// Events that cannot happen to units of an immediate machine.
const NEVER: [&str; 9] = [
    "texels",
    "texel hits",
    "ellipse memory",
    "colour memory",
    "setup-shade memory",
    "raster memory",
    "gauss memory",
    "shade memory",
    "resolve blocked",
];
/// Events that cannot happen to units of a binned machine without a reflected map.
const NEVER_BINNED: [&str; 16] = [
    "texels",
    "texel hits",
    "ellipse memory",
    "colour memory",
    "setup-shade memory",
    "gauss memory",
    "shade memory",
    "fragment memory",
    "resolve-shade memory",
    "resolve-shade blocked",
    "resolve blocked",
    "resolve memory",
    "bin blocked",
    "sort blocked",
    "look-ups",
    "misses",
];

/// Any machine with ideal memory.
pub fn of(organisation: Organisation, rng: &mut Rng) -> Timing {
    let mut timing = Timing {
        organisation,
        ..machines::random(rng)
    };
    (timing.tile.side_px, timing.tile.buffers) = (
        [16, 16, 32, 48][rng.below(4) as usize],
        1 + rng.below(2) as u32,
    );
    // Separate random numbers, so that the rest does not change.
    let rng_of_tiles = &mut Rng(rng.0 ^ 0x51de);
    if rng_of_tiles.below(3) == 0 {
        timing.tile.side_px = 4 * (1 + rng_of_tiles.below(12) as u32);
    }
    timing
}

/// This run's third of the seeds.
fn seeds(cases: u64) -> impl Iterator<Item = u64> {
    // Eight consecutive seeds: the features of a scene depend on remainders of the seed.
    (0..cases).filter(|seed| crate::tier::has([3, 3], *seed as usize / 8))
}

/// Number of events required in this run's part of the seeds.
fn share_of(least: u64) -> u64 {
    crate::tier::of([3, 3], least as usize) as u64
}

fn compare_random(organisation: Organisation, cases: u64, never: &[&str]) {
    let mut events = EventCounts::default();
    for (size, splats, share) in [
        ([3, 3], 1, 1),
        ([4, 4], 3, 2),
        ([8, 8], 6, 2),
        ([20, 20], 12, 2),
        ([60, 50], 40, 3),
    ] {
        for seed in seeds(cases * share) {
            let mut rng = Rng(seed);
            let timing = of(organisation, &mut rng);
            let scene = scene::random(&mut rng, size, splats);
            let scene = if seed % 4 == 3 { scene.lit() } else { scene };
            // Some have harmonics, most of those with their own light.
            let scene = Scene {
                harmonics: [0, 0, 1, 2, 3][seed as usize % 5],
                ..scene
            };
            // Some are sorted.
            let sorts = organisation == Organisation::Binned && seed % 3 == 2;
            let scene = if sorts { scene.sorted(&mut rng) } else { scene };
            let scene = if seed % 5 < 2 {
                scene.stopping(&mut rng)
            } else {
                scene
            };
            let timing = if sorts {
                machines::sorting(&mut rng, timing)
                    .elaborate()
                    .unwrap()
                    .timing
            } else {
                machines::elaborate(timing)
            };
            match compare(&timing, &scene, &scene.record()) {
                Ok(ticked) => events.count(&ticked),
                Err(difference) => panic!(
                    "{difference}\nseed {seed} of {size:?}, {splats} splats\n{:#?}\n{scene:?}",
                    timing.timing
                ),
            }
        }
    }
    events.require(share_of(1000), never);
}

fn compare_drawn(organisation: Organisation, never: &[&str]) {
    let mut events = EventCounts::default();
    let sorting = (organisation == Organisation::Binned).then_some(("gaussian", 160));
    for (name, frames) in Machine::NAMES
        .into_iter()
        .chain(Machine::WINDOW_NAMES)
        .map(|name| (name, 80))
        .chain([("volume", 240)])
        .chain(sorting)
    {
        for seed in seeds(frames) {
            let mut machine = Machine::named(name).unwrap();
            machine.timing = of(organisation, &mut Rng(seed));
            if machine.fragment.window.is_some() {
                machine.timing.fragment.merge += 24;
            }
            if machine.sort.is_some() {
                machine = machines::sorting(&mut Rng(seed), machine.timing);
            }
            let is_volume = machine.fragment.sheets.is_some();
            let mut frame = if is_volume {
                ellipsoids(&machine, seed, 500)
            } else {
                frame(&machine, seed, 500)
            };
            if is_volume && frame.sheets.is_none() {
                // Splats that are lit are not lit again.
                frame
                    .ellipsoids
                    .iter_mut()
                    .for_each(|ellipsoids| ellipsoids.preshaded = false);
            }
            // Some are crowds.
            if seed % 8 == 0 && !is_volume {
                (frame.width, frame.height) = (75, 40);
                frame.splats = (0..20)
                    .flat_map(|other| crate::frames::frame(&machine, seed + other, 500).splats)
                    .collect();
            }
            let machine = machine.elaborate().unwrap();
            let (_, _, work) = draw_measured(&machine, &frame);
            match compare(&machine.timing, &Scene::read(&work), &work) {
                Ok(ticked) => events.count(&ticked),
                Err(difference) => panic!(
                    "{difference}\nframe {seed} of {name}\n{:#?}",
                    machine.timing.timing
                ),
            }
        }
    }
    events.require_of_drawn(never);
}

#[test]
fn a_frame_ticks_as_it_is_replayed() {
    compare_random(Organisation::Immediate, 1500, &NEVER);
}

#[test]
fn a_binned_frame_ticks_as_it_is_replayed() {
    compare_random(Organisation::Binned, 1500, &NEVER_BINNED);
}

/// Surroundings in memory behind any cache, or loaded before the frame.
#[test]
fn a_frame_with_reflections_ticks_as_it_is_replayed() {
    let mut events = EventCounts::default();
    for (nth, organisation) in (0..).zip([Organisation::Immediate, Organisation::Binned]) {
        for (size, splats, cases) in [([3, 3], 2, 300), ([8, 8], 5, 300), ([60, 50], 30, 60)] {
            for seed in seeds(cases) {
                let mut rng = Rng(seed + 1000 * nth);
                let timing = machines::mirroring(&mut rng, of(organisation, &mut Rng(seed)));
                let scene = scene::random(&mut rng, size, splats);
                let scene = if seed % 4 == 3 { scene.lit() } else { scene };
                let scene = Scene {
                    mirrored: Some(1 << timing.map.unwrap().index_bits),
                    ..scene
                };
                match compare(&timing, &scene, &scene.record()) {
                    Ok(ticked) => events.count(&ticked),
                    Err(difference) => panic!(
                        "{difference}\nseed {seed} of {size:?}, {splats} splats\n{:#?}\n{scene:?}",
                        timing.timing
                    ),
                }
            }
        }
    }
    for what in [
        "shade memory",
        "resolve-shade memory",
        "fetch memory",
        "texels",
        "texel hits",
    ] {
        assert!(events.0[what] > share_of(1000), "{what}: {:?}", events.0);
    }
    assert!(events.0["texels"] > events.0["texel hits"]);
}

#[test]
fn a_drawn_frame_ticks_as_it_is_replayed() {
    compare_drawn(Organisation::Immediate, &NEVER);
}

#[test]
fn a_drawn_and_binned_frame_ticks_as_it_is_replayed() {
    compare_drawn(Organisation::Binned, &NEVER_BINNED);
}

/// Parallel units share pixels, fragments or tiles.
fn compare_several(organisation: Organisation, cases: u64) {
    let mut events = EventCounts::default();
    for (size, splats) in [([4, 4], 3), ([12, 9], 12), ([60, 50], 40)] {
        for seed in seeds(cases) {
            let mut rng = Rng(seed);
            let timing = of(organisation, &mut rng);
            let timing = machines::several(&mut rng, timing);
            let scene = scene::random(&mut rng, size, splats);
            let scene = if seed % 4 == 3 { scene.lit() } else { scene };
            let scene = if seed % 5 == 1 {
                scene.stopping(&mut rng)
            } else {
                scene
            };
            let timing = machines::elaborate(timing);
            match compare(&timing, &scene, &scene.record()) {
                Ok(ticked) => events.count(&ticked),
                Err(difference) => panic!(
                    "{difference}\nseed {seed} of {size:?}, {splats} splats\n{:#?}\n{scene:?}",
                    timing.timing
                ),
            }
        }
    }
    let waits: u64 = ["fragment blocked", "resolve blocked"]
        .iter()
        .map(|what| events.0[*what].min(1))
        .sum();
    assert_eq!(waits, 2, "{:?}", events.0);
}

#[test]
fn parallel_units_tick_as_they_are_replayed() {
    compare_several(Organisation::Immediate, 250);
}

#[test]
fn engines_tick_as_they_are_replayed() {
    compare_several(Organisation::Binned, 250);
}

/// Enough entries that they are sorted in several parts.
#[test]
fn a_crowd_that_is_sorted_ticks_as_it_is_replayed() {
    let mut parts = 0;
    for seed in seeds(400) {
        let mut rng = Rng(seed);
        let timing = of(Organisation::Binned, &mut rng);
        let scene = scene::random(&mut rng, [120, 100], 2000).sorted(&mut rng);
        let elaborated = machines::sorting(&mut rng, timing)
            .elaborate()
            .unwrap()
            .timing;
        match compare(&elaborated, &scene, &scene.record()) {
            Ok(ticked) => {
                let entries = ticked
                    .units
                    .iter()
                    .find(|unit| unit.name == "list")
                    .unwrap()
                    .log
                    .len();
                parts = parts
                    .max((entries * elaborated.sort.unwrap().entry_bytes as usize).div_ceil(4096));
            }
            Err(difference) => panic!("{difference}\nseed {seed}\n{timing:#?}"),
        }
    }
    assert!(parts > 2, "{parts} parts");
}

/// Sorters of any size: lists that fit, chunks and buckets, long lists and short ones.
#[test]
fn sorters_tick_as_they_are_replayed() {
    let (mut events, mut jobs) = (EventCounts::default(), BTreeMap::new());
    for (size, splats, cases) in [
        ([8, 8], 6, 300),
        ([60, 50], 40, 300),
        ([40, 40], 400, 90),
        ([120, 100], 1500, 30),
    ] {
        for seed in seeds(cases) {
            let mut rng = Rng(seed);
            let timing = of(Organisation::Binned, &mut rng);
            let scene = scene::random(&mut rng, size, splats).sorted(&mut rng);
            let scene = if seed % 5 == 1 {
                scene.stopping(&mut rng)
            } else {
                scene
            };
            let timing = match seed % 3 {
                0 => machines::several(&mut rng, timing),
                _ => timing,
            };
            let machine = machines::sorting_lists(&mut rng, timing);
            let elaborated = machine.elaborate().unwrap().timing;
            match compare(&elaborated, &scene, &scene.record()) {
                Ok(ticked) => {
                    events.count(&ticked);
                    let units = ticked.units.iter().filter(|unit| unit.name == "sort");
                    *jobs
                        .entry(format!("{:?}", machine.sort.unwrap().kind))
                        .or_insert(0) += units.map(|unit| unit.log.len()).sum::<usize>();
                }
                Err(difference) => panic!(
                    "{difference}\nseed {seed} of {size:?}, {splats} splats\n{:#?}\n{scene:?}",
                    machine.timing
                ),
            }
        }
    }
    assert!(
        jobs.len() == 2 && jobs.values().all(|jobs| *jobs as u64 > share_of(3000)),
        "{jobs:?}"
    );
    assert!(
        ["sort busy", "sort memory", "sort starved"]
            .iter()
            .all(|what| events.0[*what] > share_of(10_000)),
        "{:?}",
        events.0
    );
}

/// Lists that are kept from frame to frame: stored, new and departed entries, long lists and short
/// ones; some machines test blocks, and some have masks of subtiles.
#[test]
fn kept_lists_tick_as_they_are_replayed() {
    let (mut events, mut counts, mut masks) = (EventCounts::default(), [0; 3], 0);
    for (size, splats, cases) in [
        ([8, 8], 6, 300),
        ([60, 50], 40, 300),
        ([40, 40], 400, 60),
        ([120, 100], 1000, 30),
    ] {
        for seed in seeds(cases) {
            let mut rng = Rng(seed);
            let timing = of(Organisation::Binned, &mut rng);
            let scene = scene::random(&mut rng, size, splats).sorted(&mut rng);
            let timing = match seed % 3 {
                0 => machines::several(&mut rng, timing),
                _ => timing,
            };
            let machine = machines::keeping_lists(&mut rng, timing);
            let elaborated = machine.elaborate().unwrap().timing;
            let (scene, words, cutoff) = match elaborated.bin {
                Some(_) => scene.tested(&mut rng, &elaborated),
                None => (scene, Vec::new(), 0),
            };
            let scene = match elaborated.contribution {
                Some(_) => scene.blocked(&mut rng, &elaborated),
                None => scene,
            };
            let scene = if seed % 5 == 1 {
                scene.stopping(&mut rng)
            } else {
                scene
            };
            let scene = scene.keeping(&mut rng, &elaborated);
            let mut work = scene.record();
            (work.tested, work.cutoff) = (words, cutoff);
            work.check().unwrap();
            let tests = replay(&elaborated, &work, Detail::Total).tile_tests;
            masks += tests
                .and_then(|tests| tests.masks)
                .map_or(0, |masks| masks.seeds);
            for entry in scene.kept.iter().flat_map(|kept| &kept.lists).flatten() {
                let kind = if entry.has_departed {
                    2
                } else {
                    usize::from(entry.is_new)
                };
                counts[kind] += 1;
            }
            match compare(&elaborated, &scene, &work) {
                Ok(ticked) => events.count(&ticked),
                Err(difference) => panic!(
                    "{difference}\nseed {seed} of {size:?}, {splats} splats\n{:#?}\n{scene:?}",
                    machine.timing
                ),
            }
        }
    }
    assert!(
        counts.iter().all(|count| *count > share_of(3000)) && masks > share_of(300),
        "{counts:?}, {masks} seeds of runs"
    );
    assert!(
        ["sort busy", "sort memory", "sort starved"]
            .iter()
            .all(|what| events.0[*what] > share_of(10_000)),
        "{:?}",
        events.0
    );
}

/// Tests of tiles, with lists of all kinds: many tiles are rejected, and some splats have no entry.
#[test]
fn tests_of_tiles_tick_as_they_are_replayed() {
    compare_tests(false);
}

/// Masks, with lists of all kinds: seeds and rejected tiles, made in `bin` and in `list`.
#[test]
fn masks_tick_as_they_are_replayed() {
    let masks = compare_tests(true);
    let counts = [masks.tested, masks.set, masks.list_cycles, masks.seeds];
    assert!(
        counts.iter().all(|count| *count > share_of(1000)) && masks.set < masks.tested,
        "{masks:?}"
    );
}

/// Tests of blocks in front of raster, with lists of all kinds.
#[test]
fn tests_of_blocks_tick_as_they_are_replayed() {
    let (mut events, mut counts) = (EventCounts::default(), [0; 4]);
    for (size, splats, cases) in [([60, 50], 40, 240), ([120, 100], 400, 60)] {
        for seed in seeds(cases) {
            let mut rng = Rng(seed);
            let timing = of(Organisation::Binned, &mut rng);
            let scene = scene::random_of(&mut rng, size, splats, [6, 20, 40, 60]);
            let (scene, machine) = match seed % 4 {
                0 => (scene, machines::testing_tiles(&mut rng, timing)),
                1 => {
                    let timing = machines::several(&mut rng, timing);
                    (scene, machines::testing_tiles(&mut rng, timing))
                }
                2 => {
                    let machine = machines::sorting(&mut rng, timing);
                    (scene.sorted(&mut rng), machine)
                }
                _ => {
                    let machine = machines::sorting_lists(&mut rng, timing);
                    (scene.sorted(&mut rng), machine)
                }
            };
            let machine = machines::with_blocks(&mut rng, machine);
            let elaborated = machine.elaborate().expect("a machine").timing;
            let (scene, words, cutoff) = match elaborated.bin {
                Some(_) => scene.tested(&mut rng, &elaborated),
                None => (scene, Vec::new(), 0),
            };
            let scene = scene.blocked(&mut rng, &elaborated);
            let scene = if seed % 3 == 1 {
                scene.stopping(&mut rng)
            } else {
                scene
            };
            let mut work = scene.record();
            (work.tested, work.cutoff) = (words, cutoff);
            let tests = replay(&elaborated, &work, Detail::Total).tile_tests;
            let masks = tests.and_then(|tests| tests.masks).unwrap();
            let own = [masks.tested, masks.set, masks.list_cycles, masks.seeds];
            counts
                .iter_mut()
                .zip(own)
                .for_each(|(all, own)| *all += own);
            match compare(&elaborated, &scene, &work) {
                Ok(ticked) => events.count(&ticked),
                Err(difference) => panic!(
                    "{difference}\nseed {seed} of {size:?}, {splats} splats\n{:#?}\n{scene:?}",
                    machine.timing
                ),
            }
        }
    }
    let [tested, set, ..] = counts;
    assert!(
        counts.iter().all(|count| *count > share_of(1000)) && set < tested,
        "{counts:?}"
    );
}

/// Compares machines that test tiles; returns the counts of their masks.
fn compare_tests(with_masks: bool) -> MaskCounts {
    let (mut events, mut unlisted, mut tiles) = (EventCounts::default(), 0, 0);
    let mut counts = [0; 4];
    let often = if with_masks { 4 } else { 1 };
    for (size, splats, cases) in [([60, 50], 40, 200 * often), ([120, 100], 400, 60 * often)] {
        for seed in seeds(cases) {
            let mut rng = Rng(seed);
            let timing = of(Organisation::Binned, &mut rng);
            let largest = if with_masks {
                [6, 20, 40, 60]
            } else {
                [1, 3, 6, 20]
            };
            let scene = scene::random_of(&mut rng, size, splats, largest);
            let (scene, machine) = match seed % 4 {
                0 => (scene, machines::testing_tiles(&mut rng, timing)),
                1 => {
                    let timing = machines::several(&mut rng, timing);
                    (scene, machines::testing_tiles(&mut rng, timing))
                }
                2 => {
                    let machine = machines::sorting(&mut rng, timing);
                    (scene.sorted(&mut rng), machine)
                }
                _ => {
                    let machine = machines::sorting_lists(&mut rng, timing);
                    (scene.sorted(&mut rng), machine)
                }
            };
            let machine = if with_masks {
                machines::with_masks(&mut rng, machine)
            } else {
                machines::with_test(&mut rng, machine)
            };
            let elaborated = machine.elaborate().unwrap().timing;
            let (scene, words, cutoff) = scene.tested(&mut rng, &elaborated);
            let scene = if seed % 3 == 1 {
                scene.stopping(&mut rng)
            } else {
                scene
            };
            let mut work = scene.record();
            (work.tested, work.cutoff) = (words, cutoff);
            unlisted += scene.unlisted.len() as u64;
            tiles += rtl_model::timing::Lists::new(&elaborated, &work).entries() as u64;
            let tests = replay(&elaborated, &work, Detail::Total)
                .tile_tests
                .unwrap();
            assert_eq!(tests.masks.is_some(), with_masks);
            if let Some(masks) = tests.masks {
                let own = [masks.tested, masks.set, masks.list_cycles, masks.seeds];
                counts
                    .iter_mut()
                    .zip(own)
                    .for_each(|(all, own)| *all += own);
            }
            match compare(&elaborated, &scene, &work) {
                Ok(ticked) => events.count(&ticked),
                Err(difference) => panic!(
                    "{difference}\nseed {seed} of {size:?}, {splats} splats\n{:#?}\n{scene:?}",
                    machine.timing
                ),
            }
        }
    }
    assert!(
        unlisted > share_of(500) && tiles > share_of(3000),
        "{unlisted} tiles are rejected, {tiles} are not"
    );
    assert!(events.0["bin busy"] > share_of(10_000), "{:?}", events.0);
    let [tested, set, list_cycles, seeds] = counts;
    MaskCounts {
        tested,
        set,
        list_cycles,
        seeds,
    }
}

#[test]
fn a_scene_is_read_back_from_its_record() {
    for seed in 0..300 {
        let scene = scene::random(&mut Rng(seed), [60, 50], 40);
        let scene = if seed % 4 == 3 { scene.lit() } else { scene };
        let scene = if seed % 3 == 2 {
            scene.sorted(&mut Rng(seed))
        } else {
            scene
        };
        let scene = if seed % 5 == 1 {
            scene.stopping(&mut Rng(seed))
        } else {
            scene
        };
        let scene = Scene {
            harmonics: (seed % 4) as u8,
            ..scene
        };
        assert_eq!(Scene::read(&scene.record()), scene, "seed {seed}");
    }
}

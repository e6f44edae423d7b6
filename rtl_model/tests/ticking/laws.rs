//! What can be said without ticking: how long a frame takes by hand, and that more of anything never makes it slower.

use crate::frames::Dice;
use crate::machines::{elaborate, ideal, random};
use crate::scene::{Scene, Splat};
use crate::{immediate, scene};
use rtl_model::machine::timing::{Cache, Timing};
use rtl_model::timing::replay;
use rtl_model::work::Event;

/// So many splats of the same pixel, of a picture of that one.
fn dots(splats: usize, left: u8) -> Scene {
    Scene { width: 1, height: 1, splats: vec![Splat::dot([0, 0], Event::Accumulated); splats], left: vec![left] }
}

/// One of each unit, and FIFOs that hold what memory keeps waiting.
fn single(dice: &mut Dice) -> Timing {
    let mut timing = random(dice);
    (timing.project.units, timing.ellipse.units) = (1, 1);
    timing.memory = ideal(1 + dice.below(30) as u32, 1 << 16, 64);
    timing.fetch.fifo = 64;
    timing
}

/// Both of them, which have to agree.
fn cycles(timing: Timing, scene: &Scene) -> u64 {
    let timing = elaborate(timing);
    let total = replay(&timing, &scene.record()).total;
    assert_eq!(immediate::draw(&timing, scene).total, total);
    total
}

#[test]
fn a_frame_without_splats_is_resolved_at_once() {
    for seed in 0..200 {
        let timing = single(&mut Dice(seed));
        // Resolve takes the line in cycle 0; its word goes through it, then through memory.
        let resolve = timing.resolve.interval + timing.resolve.latency.unwrap();
        assert_eq!(cycles(timing, &dots(0, 0)), u64::from(resolve + 1 + timing.memory.hit_latency));
    }
}

#[test]
fn a_splat_of_a_pixel_takes_the_sum_of_all_latencies() {
    for seed in 0..300 {
        let mut dice = Dice(seed);
        let timing = single(&mut dice);
        let left = dice.below(3) as u8;
        let memory = 1 + timing.memory.hit_latency;
        let stages = [timing.project.latency, timing.ellipse.latency, timing.raster.latency, timing.gauss.latency];
        let written = memory + stages.map(Option::unwrap).iter().sum::<u32>() + timing.cache.latency + timing.fragment.latency.unwrap();
        let held = (u32::from(left) * timing.shade.interval).max(timing.resolve.interval);
        let light = if left > 0 { timing.shade.latency.unwrap() } else { 0 };
        let total = written + held + light + timing.resolve.latency.unwrap() + memory;
        assert_eq!(cycles(timing, &dots(1, left)), u64::from(total), "seed {seed}");
    }
}

#[test]
fn splats_in_a_row_take_the_largest_interval_each() {
    for seed in 0..300 {
        let mut dice = Dice(seed);
        let timing = single(&mut dice);
        let splats = 2 + dice.below(40);
        // Every splat has the same pixel, so that the fragment unit's interval is the hazard.
        let intervals = [timing.project.interval, timing.ellipse.interval, timing.fragment.hazard].map(Option::unwrap);
        let slowest = intervals.into_iter().max().unwrap();
        let one = cycles(timing, &dots(1, 0));
        assert_eq!(cycles(timing, &dots(splats as usize, 0)), one + (splats - 1) * u64::from(slowest), "seed {seed}");
    }
}

/// Every number of which a machine can have more.
const RAISES: [(&str, fn(&mut Timing) -> &mut u32); 10] = [
    ("fetch.fifo", |timing| &mut timing.fetch.fifo),
    ("project.fifo", |timing| &mut timing.project.fifo),
    ("project.units", |timing| &mut timing.project.units),
    ("ellipse.fifo", |timing| &mut timing.ellipse.fifo),
    ("ellipse.units", |timing| &mut timing.ellipse.units),
    ("raster.fifo", |timing| &mut timing.raster.fifo),
    ("gauss.fifo", |timing| &mut timing.gauss.fifo),
    ("cache.fifo", |timing| &mut timing.cache.fifo),
    ("cache.misses", |timing| &mut timing.cache.misses),
    ("memory.outstanding", |timing| &mut timing.memory.outstanding),
];

/// Cycles that more of something costs in how many of so many cases; and the first of them.
fn slower(cases: u64, of: impl Fn(&mut Dice) -> Timing) -> Vec<(&'static str, u64, u64)> {
    let mut found: Vec<(&str, u64, u64)> = Vec::new();
    for seed in 0..cases {
        let mut dice = Dice(seed);
        let timing = of(&mut dice);
        let scene = scene::random(&mut dice, [30, 30], 20).record();
        let before = replay(&elaborate(timing), &scene).total;
        for (name, field) in RAISES {
            let mut more = timing;
            *field(&mut more) += 1 + dice.below(4) as u32;
            if replay(&elaborate(more), &scene).total > before {
                match found.iter_mut().find(|(other, ..)| *other == name) {
                    Some((_, count, _)) => *count += 1,
                    None => found.push((name, 1, seed)),
                }
            }
        }
    }
    found
}

#[test]
fn more_of_anything_is_never_slower_if_the_cache_holds_all() {
    let found = slower(1000, |dice| {
        let timing = random(dice);
        Timing { cache: Cache { lines: 1024, ways: 1024, ..timing.cache }, ..timing }
    });
    assert_eq!(found, []);
}

/// The cache's lines follow from the order of slots alone, and a look-up waits for all before it.
#[test]
fn more_of_anything_is_never_slower_if_lines_come_and_go() {
    assert_eq!(slower(2000, random), []);
}

#[test]
#[ignore]
fn explore_real_memory() {
    eprintln!(
        "real memory {:?}",
        slower(3000, |dice| {
            let mut timing = random(dice);
            timing.memory.bytes_per_cycle = 4 << dice.below(5);
            timing.memory.miss_latency += dice.below(20) as u32;
            timing.memory.row_bytes = 256 << dice.below(3);
            timing
        })
    );
    eprintln!(
        "narrow memory, one latency {:?}",
        slower(3000, |dice| {
            let mut timing = random(dice);
            timing.memory.bytes_per_cycle = 4 << dice.below(5);
            timing
        })
    );
    let mut lanes = [0; 3];
    for seed in 0..3000 {
        let mut dice = Dice(seed);
        let mut timing = random(&mut dice);
        let scene = scene::random(&mut dice, [30, 30], 20).record();
        let before = replay(&elaborate(timing), &scene).total;
        timing.raster.lanes = timing.raster.lanes.map(|l| 2 * l);
        let after = replay(&elaborate(timing), &scene).total;
        lanes[if after > before {
            2
        } else if after == before {
            1
        } else {
            0
        }] += 1;
    }
    eprintln!("lanes doubled: faster, same, slower {lanes:?}");
}

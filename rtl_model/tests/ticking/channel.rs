//! How large is the error of the replay where memory is shared: a narrow channel, few open rows,
//! any machine and any work?

use crate::agreement::{difference_in_traffic, of, tick};
use crate::frames::Rng;
use crate::machines::{elaborate, sorting_lists};
use crate::scene;
use rtl_model::machine::timing::{Memory, Organisation, Timing};
use rtl_model::timing::{Detail, replay};

/// Memory with any small numbers.
fn finite(rng: &mut Rng, memory: Memory) -> Memory {
    let hit_latency = 1 + rng.below(30) as u32;
    Memory {
        ideal: false,
        bytes_per_cycle: [1, 3, 4, 16, 64][rng.below(5) as usize],
        hit_latency,
        miss_latency: hit_latency + rng.below(40) as u32,
        row_bytes: [256, 512, 2048][rng.below(3) as usize],
        banks: 1 << rng.below(4),
        ..memory
    }
}

/// Such memory with channels, ranks, refresh, turns to writing, and limits on opening rows.
fn with_channels(rng: &mut Rng, memory: Memory) -> Memory {
    let mut some = |numbers: &[u32]| Some(numbers[rng.below(numbers.len() as u64) as usize]);
    let memory = Memory {
        bytes_per_cycle_permille: some(&[0, 250, 800]),
        channels: some(&[1, 2, 4]),
        interleave_bytes: some(&[256, 512]),
        ranks: some(&[1, 2]),
        rank_switch_cycles: some(&[0, 1, 2]),
        refresh_interval_cycles: some(&[0, 200, 390]),
        refresh_cycles: some(&[10, 26]),
        turnaround_cycles: some(&[0, 3, 8]),
        write_batch: some(&[1, 4, 16]),
        row_cycles: some(&[0, 10, 20]),
        four_rows_cycles: some(&[0, 12, 30]),
        ..memory
    };
    let is_refreshed = memory.refresh_interval_cycles != Some(0);
    finite(
        rng,
        Memory {
            refresh_cycles: memory.refresh_cycles.filter(|_| is_refreshed),
            ..memory
        },
    )
}

/// Checks a machine with sorters of lists, on scenes whose lists do not fit. All frames together
/// are off by at most `together` thousandths, and nine in ten by at most `most`.
fn check_sorters(memory: fn(&mut Rng, Memory) -> Memory, most: i64, together: i64) {
    let (mut errors, mut totals) = (Vec::new(), [0; 2]);
    for seed in 0..150 {
        let mut rng = Rng(seed);
        let timing = of(Organisation::Binned, &mut rng);
        let mut machine = sorting_lists(&mut rng, timing);
        machine.timing.memory = memory(&mut rng, machine.timing.memory);
        let timing = machine.elaborate().unwrap().timing;
        let scene = scene::random(&mut rng, [60, 50], 300).sorted(&mut rng);
        let (ticked, replayed) = (
            tick(&timing, &scene),
            replay(&timing, &scene.record(), Detail::Accounts),
        );
        if let Some(difference) = difference_in_traffic(&ticked, &replayed) {
            panic!("{difference}\nseed {seed}\n{:#?}", timing.timing);
        }
        errors.push((1000.0 * (replayed.total as f64 / ticked.total as f64 - 1.0)).round() as i64);
        totals = [totals[0] + ticked.total, totals[1] + replayed.total];
    }
    errors.sort_unstable();
    let all = (1000.0 * (totals[1] as f64 / totals[0] as f64 - 1.0)).round() as i64;
    let at = |share: usize| errors[(errors.len() - 1) * share / 100];
    println!(
        "sorters: {all} ‰ together; {:?} ‰",
        [0, 1, 5, 25, 50, 75, 95, 99, 100].map(at)
    );
    assert!(
        -most <= at(5) && at(95) <= most,
        "{} to {} ‰",
        at(5),
        at(95)
    );
    assert!(all.abs() <= together, "{all} ‰ together");
}

#[test]
fn a_frame_with_sorters_and_narrow_memory_moves_the_same_bytes_in_about_the_time() {
    check_sorters(finite, 20, 5);
}

#[test]
fn a_frame_with_sorters_and_channels_moves_the_same_bytes_in_about_the_time() {
    check_sorters(with_channels, 35, 5);
}

/// Error of the replay in thousandths of the ticks, from fastest to slowest, and for all ticks
/// together.
fn errors(
    organisation: Organisation,
    memory: fn(&mut Rng, Memory) -> Memory,
    cases: u64,
) -> (Vec<i64>, i64) {
    let mut errors = Vec::new();
    let mut totals = [0; 2];
    let thousandths = |[ticked, replayed]: [u64; 2]| {
        (1000.0 * (replayed as f64 / ticked as f64 - 1.0)).round() as i64
    };
    for seed in 0..cases {
        let mut rng = Rng(seed);
        let timing = of(organisation, &mut rng);
        let timing = elaborate(Timing {
            memory: memory(&mut rng, timing.memory),
            ..timing
        });
        let scene = scene::random(&mut rng, [60, 50], 40);
        let (ticked, replayed) = (
            tick(&timing, &scene),
            replay(&timing, &scene.record(), Detail::Accounts),
        );
        if let Some(difference) = difference_in_traffic(&ticked, &replayed) {
            panic!("{difference}\nseed {seed}\n{:#?}", timing.timing);
        }
        errors.push(thousandths([ticked.total, replayed.total]));
        totals = [totals[0] + ticked.total, totals[1] + replayed.total];
    }
    errors.sort_unstable();
    (errors, thousandths(totals))
}

/// Checks random frames: nine in ten are off by at most the first number of thousandths, all by at
/// most the second, and all together by the third. Frames with large errors are small: opening one
/// row again is a large part of them.
fn check(
    organisation: Organisation,
    memory: fn(&mut Rng, Memory) -> Memory,
    most: i64,
    worst: i64,
    together: i64,
) {
    let (errors, all) = errors(organisation, memory, 1500);
    let at = |share: usize| errors[(errors.len() - 1) * share / 100];
    println!(
        "{organisation:?}: {all} ‰ together; {:?} ‰",
        [0, 1, 5, 25, 50, 75, 95, 99, 100].map(at)
    );
    assert!(
        -most <= at(5) && at(95) <= most,
        "{} to {} ‰",
        at(5),
        at(95)
    );
    assert!(
        -worst <= at(0) && at(100) <= worst,
        "{} to {} ‰",
        at(0),
        at(100)
    );
    assert!(all.abs() <= together, "{all} ‰ together");
}

#[test]
fn a_frame_with_narrow_memory_moves_the_same_bytes_in_about_the_time() {
    check(Organisation::Immediate, finite, 15, 260, 5);
}

#[test]
fn a_binned_frame_with_narrow_memory_moves_the_same_bytes_in_about_the_time() {
    check(Organisation::Binned, finite, 45, 250, 5);
}

#[test]
fn a_frame_with_channels_moves_the_same_bytes_in_about_the_time() {
    check(Organisation::Immediate, with_channels, 35, 300, 10);
}

#[test]
fn a_binned_frame_with_channels_moves_the_same_bytes_in_about_the_time() {
    check(Organisation::Binned, with_channels, 45, 480, 5);
}

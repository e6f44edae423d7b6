//! Does every machine that elaborates draw every frame within its words, with and without a probe,
//! on any number of threads?

use crate::frames::{ellipsoids, frame};
use crate::mutation::{Mutation, differences, mutated, mutations, named};
use crate::tier;
use proptest::prelude::*;
use rtl_model::frame::Each;
use rtl_model::machine::{DepthWeight, Merge, Rows, SortKind};
use rtl_model::num::{Format, Word};
use rtl_model::pipeline::{draw, draw_measured, draw_unobserved};
use rtl_model::probe::{Range, Ranges};
use rtl_model::{Drawing, Elaborated, Frame, Machine};
use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Counts words one by one.
fn counted(machine: &Elaborated, frame: &Frame) -> Ranges {
    let mut ranges = Ranges::new(machine.signals.len());
    draw(machine, frame, &mut ranges);
    ranges
}

/// Draws with probes, in batches of eight words and one by one, without vectors, and without a
/// probe. Every recorded word must be in its signal's format.
fn draws(machine: &Elaborated, frame: &Frame) -> Drawing {
    let drawing = draw_unobserved(machine, frame);
    let (watched, ranges, _) = draw_measured(machine, frame);
    assert_eq!(
        watched, drawing,
        "the drawings with and without a probe differ"
    );
    let mut one_by_one = Ranges::new(machine.signals.len());
    assert_eq!(
        draw(machine, frame, &mut one_by_one),
        drawing,
        "with vectors and without"
    );
    assert_eq!(ranges, one_by_one);
    for (range, signal) in ranges
        .0
        .iter()
        .zip(&machine.signals)
        .filter(|(range, _)| range.words > 0)
    {
        let format = signal.word.format;
        assert!(
            format.min() <= range.min && range.max <= format.max(),
            "{}.{} left {format}",
            signal.unit,
            signal.name
        );
    }
    let culled = drawing.culled;
    assert!(
        culled.near + culled.outside + culled.faint + culled.backface + culled.transparent
            <= frame.splats.len() as u64
    );
    drawing
}

/// Applies the changes that leave a machine that elaborates.
fn wander(machine: Machine, changes: &[Mutation]) -> (Machine, Elaborated) {
    let first = machine.elaborate().unwrap();
    changes
        .iter()
        .fold((machine, first), |(machine, elaborated), change| {
            let other = mutated(&machine, change);
            match other.elaborate() {
                Ok(elaborated) => (other, elaborated),
                Err(_) => (machine, elaborated),
            }
        })
}

/// This number of random cases, or this run's third of them.
fn cases(all: u32) -> u32 {
    tier::of([3, 3], all as usize) as u32
}

/// The named machines of discs: all, or this run's part of them.
fn discs() -> impl Iterator<Item = &'static str> {
    tier::some(
        [12, 12],
        Machine::NAMES.into_iter().chain(Machine::WINDOW_NAMES),
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(256), max_shrink_iters: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_machine_that_elaborates_draws_every_frame(
        machine in named(),
        changes in mutations(0..60),
        seed in any::<u64>(),
        wildness in prop::sample::select(vec![1u64, 3, 12, 60, 10_000]),
    ) {
        let (machine, elaborated) = wander(Machine::named(machine).unwrap(), &changes);
        let frame = frame(&machine, seed, wildness);
        let drawn = catch_unwind(AssertUnwindSafe(|| draws(&elaborated, &frame)));
        prop_assert!(drawn.is_ok(), "a machine with {:#?} does not draw", differences(&machine));
    }
}

#[test]
fn meters_equal_counted_ranges() {
    for name in Machine::NAMES.into_iter().chain(Machine::WINDOW_NAMES) {
        for rows in [Rows::Seeded, Rows::Differenced, Rows::Direct] {
            let mut machine = Machine::named(name).unwrap();
            machine.raster.rows = rows;
            machine.raster.square =
                (rows == Rows::Direct).then(|| Word::new(Format::signed(20, 10)));
            let elaborated = machine.elaborate().unwrap();
            for (seed, wildness) in
                (0..20).flat_map(|seed| [1, 12, 10_000].map(|wildness| (seed, wildness)))
            {
                let frame = frame(&machine, seed, wildness);
                let (read, counted) = (
                    draw_measured(&elaborated, &frame).1,
                    counted(&elaborated, &frame),
                );
                for ((read, counted), signal) in
                    read.0.iter().zip(&counted.0).zip(&elaborated.signals)
                {
                    assert_eq!(read, counted, "{}.{} of {name}", signal.unit, signal.name);
                    assert_eq!(
                        read.bins.iter().sum::<u64>(),
                        read.words,
                        "{}.{} of {name}",
                        signal.unit,
                        signal.name
                    );
                }
            }
        }
    }
}

/// Ellipsoids and sheets: meters of eight lanes equal ranges counted word by word, and every word
/// is in its format.
#[test]
fn meters_of_ellipsoids_equal_counted_ranges() {
    let mut saturated = 0;
    for (name, depth_weight) in (Machine::ELLIPSOID_NAMES.iter().map(|name| (name, None)))
        .chain([(&"weighted", Some(DepthWeight::default()))])
    {
        let mut machine = Machine::named(name).unwrap();
        if depth_weight.is_some() {
            machine.sort.as_mut().unwrap().depth_weight = depth_weight;
        }
        let elaborated = machine.elaborate().unwrap();
        for (seed, wildness) in
            (0..40).flat_map(|seed| [1, 12, 10_000].map(|wildness| (seed, wildness)))
        {
            let frame = ellipsoids(&machine, seed, wildness);
            draws(&elaborated, &frame);
            let (read, counted) = (
                draw_measured(&elaborated, &frame).1,
                counted(&elaborated, &frame),
            );
            for ((read, counted), signal) in read.0.iter().zip(&counted.0).zip(&elaborated.signals)
            {
                assert_eq!(
                    read, counted,
                    "{}.{} of {name}, {seed} {wildness}",
                    signal.unit, signal.name
                );
                saturated += counted.saturated_low + counted.saturated_high;
            }
        }
    }
    assert!(saturated > 1000, "{saturated}");
}

/// More splats than one thread sets up at a time, and more tiles than are counted one by one.
fn crowd(machine: &Machine) -> Frame {
    let mut frame = frame(machine, 11, 10_000);
    (frame.width, frame.height) = (100, 60);
    let splats: Vec<_> = (0..400)
        .flat_map(|seed| crate::frames::frame(machine, seed, 10_000).splats)
        .collect();
    frame.splats = splats.iter().cycle().take(9_000).copied().collect();
    frame
}

/// Where meters count a sample, only the counts are less.
#[test]
fn meters_measure_all_and_count_a_sample() {
    for name in discs() {
        let machine = Machine::named(name).unwrap();
        let (elaborated, frame) = (machine.elaborate().unwrap(), crowd(&machine));
        let (read, counted) = (
            draw_measured(&elaborated, &frame).1,
            counted(&elaborated, &frame),
        );
        let mut most_left_out = 0.0f64;
        for ((read, counted), signal) in read.0.iter().zip(&counted.0).zip(&elaborated.signals) {
            let name = format!("{}.{} of {name}", signal.unit, signal.name);
            let Range {
                words,
                inexact,
                bins,
                ..
            } = *counted;
            assert_eq!(
                Range {
                    words,
                    inexact,
                    bins,
                    ..*read
                },
                *counted,
                "{name}"
            );
            assert_eq!(read.bins.iter().sum::<u64>(), read.words, "{name}");
            assert!(
                read.words <= words
                    && read.inexact <= inexact
                    && read.bins.iter().zip(&bins).all(|(read, all)| read <= all),
                "{name}"
            );
            if words > 10_000 {
                let share = |range: &Range| range.inexact as f64 / range.words as f64;
                // Windows are formed again for each contribution without a slot, from slots that
                // hardly change, so tiles differ. Shade also lights splats, fewer of which are
                // counted than of fragments.
                let apart = if name.ends_with(" of window") {
                    0.1
                } else {
                    0.05
                };
                assert!(
                    (share(read) - share(counted)).abs() < apart,
                    "{name}: {} and {}",
                    share(read),
                    share(counted)
                );
                most_left_out = most_left_out.max(1.0 - read.words as f64 / words as f64);
            }
        }
        assert!(most_left_out > 0.9, "{name}: {most_left_out}");
    }
}

/// Pixels that overflow repeatedly, with one slot to merge with or several, and neighbours with
/// different materials.
#[test]
fn queued_merges_equal_immediate_ones() {
    let rules = [
        (1, Merge::FarthestPair),
        (2, Merge::NearestPair),
        (3, Merge::FarthestPair),
        (7, Merge::NearestPair),
    ];
    for (layers, merge) in tier::some([12, 12], rules) {
        for evict_hidden in [false, true] {
            let mut machine = Machine::named("reference").unwrap();
            (
                machine.fragment.layers,
                machine.fragment.merge,
                machine.fragment.evict_hidden,
            ) = (layers, merge, evict_hidden);
            let (elaborated, frame) = (machine.elaborate().unwrap(), crowd(&machine));
            let waited = draw_unobserved(&elaborated, &frame);
            let merged = waited.outcomes.merged;
            assert!(
                merged > 5_000,
                "{layers} layers, {merge:?}, {evict_hidden}: {merged}"
            );
            assert!(
                waited == draw_measured(&elaborated, &frame).0,
                "{layers} layers, {merge:?}, {evict_hidden}"
            );
        }
    }
}

/// The same frame on one, two and three threads, with and without probes.
#[test]
fn threads_and_probes_change_no_bit() {
    for name in discs() {
        let machine = Machine::named(name).unwrap();
        let (elaborated, frame) = (machine.elaborate().unwrap(), crowd(&machine));
        let watched = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            let (drawing, ranges, _) = pool.install(|| draw_measured(&elaborated, &frame));
            assert_eq!(
                pool.install(|| draw_unobserved(&elaborated, &frame)),
                drawing
            );
            (drawing, ranges)
        };
        let one = watched(1);
        assert!(
            one.0.outcomes.merged + one.0.outcomes.evicted > 0,
            "{name} draws too little to compare: {:?}",
            one.0.outcomes
        );
        assert_eq!(watched(2), one, "{name}");
        assert_eq!(watched(3), one, "{name}");
    }
}

/// Without a sort, Gaussians are summed, and their order does not matter: a frame whose splats are
/// listed in the opposite order has the same picture.
#[test]
fn sums_of_gaussians_do_not_depend_on_their_order() {
    let machine = Machine::named("weighted").unwrap();
    let elaborated = machine.elaborate().unwrap();
    let (mut covered, mut differ) = (0, 0);
    for seed in 0..tier::of([10, 5], 200) as u64 {
        let mut frame = ellipsoids(&machine, seed, [1, 12, 500][seed as usize % 3]);
        let Some(sheets) = &mut frame.sheets else {
            continue;
        };
        (sheets.each, sheets.stop) = (Each::Slice, 0);
        sheets.numbers.clear();
        let of_pixels = |frame: &Frame| draw_unobserved(&elaborated, frame);
        let mut turned = frame.clone();
        turned.splats.reverse();
        let ellipsoids = turned.ellipsoids.as_mut().unwrap();
        ellipsoids.own.reverse();
        let of_degree = (usize::from(ellipsoids.harmonics) + 1).pow(2);
        let reversed = ellipsoids.coefficients.chunks(of_degree).rev();
        ellipsoids.coefficients = reversed.flatten().copied().collect();
        let (one, other) = (of_pixels(&frame), of_pixels(&turned));
        assert!(one.frame == other.frame, "seed {seed}");
        covered += one.covered.iter().filter(|covered| **covered).count();
        // By sheets of their own, their order matters.
        for frame in [&mut frame, &mut turned] {
            frame.sheets.as_mut().unwrap().each = Each::Splat;
        }
        differ += u64::from(of_pixels(&frame).frame != of_pixels(&turned).frame);
    }
    assert!(covered > 1000 && differ > 3, "{covered} {differ}");
}

/// All kinds of sorts give the picture of the radix sort, on random frames with random keys. Their
/// steps, repeated here one by one on the recorded keys, give the lists that are drawn.
#[test]
fn every_sort_with_an_order_draws_the_picture_of_radix() {
    let (mut distributed, mut equal_keys, mut pictures) = (0, 0, 0);
    for seed in 0..tier::of([2, 2], 45) as u64 {
        let mut machine = Machine::named("gaussian").unwrap();
        let key = ["U1F23", "U1F11", "U1F5"][seed as usize % 3];
        machine.sort.as_mut().unwrap().key = serde_json::from_value(key.into()).unwrap();
        let frame = ellipsoids(&machine, seed, 500);
        let with = |kind: SortKind, tile_bits: Option<u32>| {
            let mut other = machine.clone();
            let sort = other.sort.as_mut().unwrap();
            (sort.kind, sort.tile_bits) = (kind, tile_bits);
            draw_measured(&other.elaborate().unwrap(), &frame)
        };
        let (radix, _, work) = with(SortKind::Radix, None);
        assert!(work.keys.is_empty(), "keys are recorded without a use");
        for (kind, tile_bits) in [
            (SortKind::Tile, None),
            (SortKind::Hierarchical, None),
            (SortKind::Radix, Some(13)),
        ] {
            assert!(with(kind, tile_bits).0 == radix, "seed {seed}: {kind:?}");
        }
        pictures += u64::from(!work.order.is_empty());
        let farthest_first = (frame.sheets.as_ref()).is_some_and(|sheets| sheets.back_to_front);
        let (_, _, work) = with(SortKind::Hierarchical, None);
        assert_eq!(work.keys.len(), work.order.len());
        let bits = machine.sort.unwrap().key.format.width();
        let lists = work.bins(16);
        for list in (0..lists.tiles()).map(|tile| lists.of(tile)) {
            let mut buckets = vec![Vec::new(); 8];
            (0..work.footprints.len() as u32)
                .filter(|nth| list.contains(nth))
                .for_each(|nth| {
                    buckets[(work.keys[nth as usize] >> (bits - 3)) as usize]
                        .push((work.keys[nth as usize], nth))
                });
            distributed +=
                usize::from(buckets.iter().filter(|bucket| bucket.len() > 1).count() > 1);
            equal_keys += buckets.iter().flatten().count()
                - buckets
                    .iter()
                    .flatten()
                    .map(|(key, _)| *key)
                    .collect::<BTreeSet<_>>()
                    .len();
            // The farthest first where the frame is blended from the back.
            if farthest_first {
                buckets.reverse();
            }
            let sorted = buckets.into_iter().flat_map(|mut bucket| {
                bucket.sort_unstable();
                if farthest_first {
                    bucket.sort_by_key(|(key, _)| std::cmp::Reverse(*key));
                }
                bucket
            });
            assert_eq!(
                sorted.map(|(_, nth)| nth).collect::<Vec<_>>(),
                list,
                "seed {seed}"
            );
        }
    }
    assert!(
        pictures > 5 && distributed > 5 && equal_keys > 5,
        "{pictures} pictures, {distributed} lists, {equal_keys} equal keys"
    );
}

use crate::elaboration::Operator;
use crate::elaboration::Part;
use crate::machine::timing::Sorter;
use crate::machine::{Machine, SortKind};

#[test]
fn setup_makes_the_products_that_it_declares() {
    for name in Machine::NAMES {
        let file = Machine::named(name).unwrap();
        let machine = file.elaborate().unwrap();
        let declared = |unit: &str| {
            machine
                .parts
                .iter()
                .filter(|part| part.unit == unit)
                .map(Part::products)
                .sum::<u32>()
        };
        assert_eq!(
            machine.project.graph().products(),
            declared("project"),
            "{name}"
        );
        let disc = machine.ellipse.variant(file.ellipse.aspect.is_some(), None);
        assert_eq!(
            machine.ellipse.datapath(disc).graph.products(),
            declared("ellipse"),
            "{name}"
        );
    }
}

/// A wider digit saves a pass and costs memory: two counts for each of its values.
#[test]
fn counts_of_digits_are_memory() {
    let bits = |digit_bits| {
        let mut machine = Machine::named("gaussian").unwrap();
        machine
            .sort
            .iter_mut()
            .for_each(|sort| sort.digit_bits = digit_bits);
        machine.elaborate().unwrap().timing.storage.memory_bits
    };
    assert_eq!(bits(16) - bits(8), 2 * 32 * (65_536 - 256));
    assert_eq!(bits(9) - bits(8), 2 * 32 * 256);
    let without = Machine {
        sort: None,
        ..Machine::named("gaussian").unwrap()
    };
    assert_eq!(
        bits(8) - without.elaborate().unwrap().timing.storage.memory_bits,
        2 * 32 * 256
    );
}

/// The machine of trained Gaussians, with sorters of lists.
fn sorting(kind: SortKind, sorter: Option<Sorter>) -> Machine {
    let mut machine = Machine::named("gaussian").unwrap();
    machine.sort.iter_mut().for_each(|sort| sort.kind = kind);
    machine.timing.sort = sorter;
    machine
}

/// Buffers and buckets are memory, comparators are parts; each sorter has its own. Counts are
/// worked out by hand.
#[test]
fn every_part_of_a_sorter_is_counted() {
    let with = |overlap, kind, units, buffer_entries, network, bucket_bits| {
        let machine = sorting(
            kind,
            Some(Sorter {
                units,
                buffer_entries,
                network,
                bucket_bits,
                overlap,
            }),
        )
        .elaborate()
        .unwrap();
        let sum = |of: fn(Operator) -> i32| {
            let parts = machine.parts.iter().filter(|part| part.unit == "sort");
            parts
                .map(|part| i64::from(of(part.operator)) * i64::from(part.copies))
                .sum::<i64>()
        };
        let adders = sum(|operator| {
            if let Operator::Adder(bits) = operator {
                bits
            } else {
                0
            }
        });
        let registers = sum(|operator| {
            if let Operator::Register(bits) = operator {
                bits
            } else {
                0
            }
        });
        (machine.timing.storage.memory_bits, adders, registers)
    };
    let of = |kind, units, buffer_entries, network, bucket_bits| {
        with(false, kind, units, buffer_entries, network, bucket_bits)
    };
    // An entry has an index of 32 bits and a key of 24.
    let entry = 56;
    let (memory, adders, registers) = of(SortKind::Tile, 1, 256, 16, None);
    let radix = sorting(SortKind::Radix, None).elaborate().unwrap();
    // Two counts for each of 256 values of a digit are replaced by four buffers.
    assert_eq!(
        radix.timing.storage.memory_bits - 2 * 32 * 256 + 4 * 256 * 56,
        memory
    );
    // 4·5/2 stages of 8 comparators, the merger's, and 6 addresses; a register of the key, as
    // before.
    assert_eq!(
        (adders, registers),
        (
            80 * entry + entry + 6 * 32,
            24 + 160 * entry + 3 * entry + 6 * 32
        )
    );
    // Twice as many.
    let (twice, more_adders, more_registers) = of(SortKind::Tile, 2, 256, 16, None);
    assert_eq!(
        (twice - memory, more_adders, more_registers - 24),
        (4 * 256 * 56, 2 * adders, 2 * (registers - 24))
    );
    // Beside the engine that draws: the number of each sorter's list, and a comparison with it.
    assert_eq!(
        with(true, SortKind::Tile, 2, 256, 16, None),
        (twice, more_adders + 2 * 32, more_registers + 2 * 32)
    );
    // Without a network; as wide as the buffer, which then needs no merging.
    assert_eq!(
        of(SortKind::Tile, 1, 256, 1, None),
        (memory, entry + 6 * 32, 24 + 3 * entry + 6 * 32)
    );
    assert_eq!(
        of(SortKind::Tile, 1, 16, 16, None).0,
        memory - 4 * 256 * 56 + 2 * 16 * 56
    );
    // Each of 16 buckets gathers 64 bytes and has a count.
    let (buckets, with_count, _) = of(SortKind::Hierarchical, 1, 256, 16, Some(4));
    assert_eq!(
        (buckets - memory, with_count - adders),
        (16 * (512 + 32), 32)
    );
    let tile_bits = |bits| {
        let mut machine = sorting(SortKind::Radix, None);
        machine
            .sort
            .iter_mut()
            .for_each(|sort| sort.tile_bits = bits);
        machine.elaborate().unwrap().timing.sort.unwrap()
    };
    assert_eq!(
        [None, Some(8), Some(13)]
            .map(tile_bits)
            .map(|shape| (shape.passes, shape.entry_bytes)),
        [(3, 7), (4, 8), (5, 9)]
    );
}

#[test]
fn a_sorter_that_cannot_be_is_refused() {
    let sorter = Sorter::default();
    let tile = |sorter| sorting(SortKind::Tile, Some(sorter));
    let unsorted = Machine {
        sort: None,
        ..sorting(SortKind::Radix, Some(sorter))
    };
    let mut numbered = tile(sorter);
    numbered
        .sort
        .iter_mut()
        .for_each(|sort| sort.tile_bits = Some(8));
    let mut too_many = sorting(SortKind::Radix, None);
    too_many
        .sort
        .iter_mut()
        .for_each(|sort| sort.tile_bits = Some(21));
    let mut narrow = tile(sorter);
    narrow.timing.memory.burst_bytes = 4;
    let mut fast = tile(sorter);
    fast.timing.clock_hz = 5_000_000_000;
    let cases = [
        (
            sorting(SortKind::Radix, Some(sorter)),
            "timing.sort describes sorters of tiles' lists, but sort.kind is radix, which sorts in memory",
        ),
        (
            unsorted,
            "timing.sort describes sorters of tiles' lists, but the machine has no `sort`",
        ),
        (
            tile(Sorter {
                units: 65,
                ..sorter
            }),
            "timing.sort.units is 65: it can be 1 to 64",
        ),
        (
            tile(Sorter {
                buffer_entries: 100,
                ..sorter
            }),
            "timing.sort.buffer_entries is 100: it must be a power of two, 4 to 65536",
        ),
        (
            tile(Sorter {
                buffer_entries: 0,
                ..sorter
            }),
            "timing.sort.buffer_entries is 0: it must be a power of two, 4 to 65536",
        ),
        (
            tile(Sorter {
                network: 3,
                ..sorter
            }),
            "timing.sort.network is 3: it must be a power of two, 1 to 1024",
        ),
        (
            tile(Sorter {
                network: 512,
                ..sorter
            }),
            "timing.sort.network is 512, more than the 256 entries of timing.sort.buffer_entries",
        ),
        (
            tile(Sorter {
                bucket_bits: Some(4),
                ..sorter
            }),
            "timing.sort.bucket_bits is 4, but sort.kind tile has no buckets",
        ),
        (
            sorting(
                SortKind::Hierarchical,
                Some(Sorter {
                    bucket_bits: Some(13),
                    ..sorter
                }),
            ),
            "timing.sort.bucket_bits is 13: it can be 1 to 12",
        ),
        (
            numbered,
            "sort.tile_bits is a part of the key of radix, but each tile's list is sorted by itself",
        ),
        (too_many, "sort.tile_bits is 21: 1 to 20 can be built"),
        (
            narrow,
            "timing.memory.burst_bytes is 4: an entry of a list that is to be sorted has 7",
        ),
    ];
    for (machine, sentence) in cases {
        let errors = machine.elaborate().map(|_| ()).unwrap_err();
        assert!(
            errors.len() == 1 && errors[0].starts_with(sentence),
            "{sentence}: {errors:?}"
        );
    }
    let errors = fast.elaborate().map(|_| ()).unwrap_err();
    assert!(
        errors
            .iter()
            .any(|error| error.contains("a sorter takes one of two entries in a cycle: at most 4")),
        "{errors:?}"
    );
    assert!(
        tile(sorter).elaborate().is_ok()
            && sorting(SortKind::Hierarchical, None).elaborate().is_ok()
    );
}

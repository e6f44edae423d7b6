//! Which machines are tried? Any small numbers, and memory so wide that the arrival of data is
//! known in advance.

use crate::frames::Rng;
use rtl_model::Machine;
use rtl_model::elaboration::microarchitecture::Microarchitecture;
use rtl_model::machine;
use rtl_model::machine::timing::{
    Cache, Colour, Contribution as ContributionTiming, DEFAULT, Environment, Fetch, Fragment,
    Memory, Organisation, Queue, Raster, Resolve, Setup, Shade, Sorter, Stage, Technology, Tile,
    Timing,
};
use rtl_model::machine::{Bin, BinTest, Contribution, Incremental, Leaders, MaskMaker, SortKind};
use rtl_model::num::Word;

/// Memory in which a request in cycle t has its data in cycle t + 1 + latency.
pub fn ideal(latency: u32, outstanding: u32, burst_bytes: u32) -> Memory {
    Memory {
        ideal: false,
        bytes_per_cycle: 1 << 20,
        hit_latency: latency,
        miss_latency: latency,
        burst_bytes,
        outstanding,
        row_bytes: 2048,
        banks: 4,
        ..DEFAULT.memory
    }
}

pub fn elaborate(timing: Timing) -> Microarchitecture {
    let mut machine = Machine::named("tiny").unwrap();
    machine.timing = timing;
    machine.colour = Some(machine::Colour::default());
    machine.elaborate().unwrap().timing
}

/// A machine that reflects surroundings, by a map of any size on chip or behind any cache.
pub fn mirroring(rng: &mut Rng, timing: Timing) -> Microarchitecture {
    let index_bits = 1 + rng.below(6) as u32;
    let mut power = |most: u64| 1 << rng.below(most + 1);
    let [columns, rows] = [power(2), power(2)].map(|texels: u32| texels.min(1 << index_bits));
    let (lines, ways) = (power(5), power(2));
    let cache = Environment {
        line_texels: [columns, rows],
        lines,
        ways: ways.min(lines),
    };
    let environment = (rng.below(4) > 0).then_some(cache);
    let reflect = serde_json::json!({
        "sight": "axis", "facing": "I2F14", "direction": "I3F13", "reciprocal": {"table_bits": 8, "newton_steps": 1, "bits": 16},
        "coordinate": "U1F12", "index_bits": index_bits, "fraction": "U1F7", "light": "U1F10", "reflectance": "U1F10"
    });
    let machine = Machine {
        timing: Timing {
            environment,
            ..timing
        },
        reflect: Some(serde_json::from_value(reflect).unwrap()),
        ..Machine::named("tiny").unwrap()
    };
    machine.elaborate().unwrap().timing
}

/// A machine that sorts, by digits of any number of bits.
pub fn sorting(rng: &mut Rng, timing: Timing) -> Machine {
    let mut machine = Machine::named("gaussian").unwrap();
    machine.timing = timing;
    machine.sort.as_mut().unwrap().digit_bits = 1 + rng.below(8) as u32;
    machine
}

/// A machine with any sorters of lists, so small that most lists do not fit.
pub fn sorting_lists(rng: &mut Rng, timing: Timing) -> Machine {
    let mut machine = sorting(rng, timing);
    let kind = if rng.below(2) == 0 {
        SortKind::Tile
    } else {
        SortKind::Hierarchical
    };
    let buffer_entries = 4 << rng.below(6);
    let network = (1 << rng.below(7)).min(buffer_entries);
    let bucket_bits =
        (kind == SortKind::Hierarchical && rng.below(4) > 0).then(|| 1 + rng.below(8) as u32);
    machine.sort.as_mut().unwrap().kind = kind;
    machine.timing.sort = Some(Sorter {
        units: 1 + rng.below(4) as u32,
        buffer_entries,
        network,
        bucket_bits,
        overlap: rng.below(2) == 0,
    });
    machine.timing.memory.burst_bytes = machine.timing.memory.burst_bytes.max(8);
    machine.bin = Some(Bin {
        tiles_per_cycle: (rng.below(2) > 0).then(|| 1 + rng.below(6) as u32),
        ..Bin::default()
    });
    machine
}

/// A machine with any sorters, which keeps lists from frame to frame.
pub fn keeping_lists(rng: &mut Rng, timing: Timing) -> Machine {
    let mut machine = sorting_lists(rng, timing);
    let sorter = machine.timing.sort.as_mut().unwrap();
    sorter.bucket_bits = None;
    match rng.below(4) {
        0 => {
            machine = with_blocks(rng, machine);
            machine.bin = None;
            machine.timing.tile.side_px = 16 * (1 + rng.below(2) as u32);
        }
        1 => {
            machine = with_masks(rng, machine);
            let bin = machine.bin.as_mut().unwrap();
            bin.masks = Some(MaskMaker::List);
            let subtile_px = bin.subtile_px.unwrap();
            let most = (u64::from(subtile_px) / 2).min(4);
            machine.timing.tile.side_px = 16 * (1 + rng.below(most) as u32);
        }
        _ => machine.timing.tile.side_px = 16 * (1 + rng.below(4) as u32),
    }
    let sorter = machine.timing.sort.unwrap();
    let sort = machine.sort.as_mut().unwrap();
    sort.kind = SortKind::Incremental;
    sort.incremental = Some(Incremental {
        tile_px: machine.timing.tile.side_px,
        chunk: sorter.buffer_entries,
    });
    machine
}

/// A machine with this timing, without a sort.
pub fn testing_tiles(rng: &mut Rng, timing: Timing) -> Machine {
    let mut machine = sorting(rng, timing);
    machine.sort = None;
    machine
}

/// The machine with a test of tiles.
pub fn with_test(rng: &mut Rng, mut machine: Machine) -> Machine {
    let test = [BinTest::OrientedBox, BinTest::Ellipse][rng.below(2) as usize];
    machine.bin = Some(Bin {
        test,
        ..Bin::default()
    });
    machine
}

/// A machine with a test of tiles, and with masks in tiles of any size.
pub fn with_masks(rng: &mut Rng, machine: Machine) -> Machine {
    let mut machine = with_test(rng, machine);
    let subtile_px = 4 << rng.below(3) as u32;
    let across = 1 + rng.below([8, 6, 3][subtile_px as usize / 8]) as u32;
    machine.timing.tile.side_px = across * subtile_px;
    machine.timing.raster.row_cycles = None;
    machine.timing.memory.burst_bytes = machine.timing.memory.burst_bytes.max(16);
    let bin = machine.bin.as_mut().unwrap();
    bin.subtile_px = Some(subtile_px);
    bin.masks = [None, Some(MaskMaker::Bin), Some(MaskMaker::List)][rng.below(3) as usize];
    bin.mask_tests = (rng.below(3) > 0).then(|| 1 + rng.below(10) as u32);
    bin.tiles_per_cycle = (rng.below(2) > 0).then(|| 1 + rng.below(6) as u32);
    machine
}

/// A machine with a test of blocks, in tiles of any size; some also test tiles.
pub fn with_blocks(rng: &mut Rng, machine: Machine) -> Machine {
    let mut machine = if rng.below(3) == 0 {
        with_test(rng, machine)
    } else {
        machine
    };
    let word = |format: &str| Word::new(format.parse().unwrap());
    let block_px = 4 << rng.below(2) as u32;
    machine.contribution = Some(Contribution {
        block_px,
        leaders: [Leaders::Corners, Leaders::Diagonal][rng.below(2) as usize],
        offset: word("I15F4"),
        square: word("U20F4"),
        product: word("I21F4"),
        conic: word("U3F16"),
        conic_cross: word("I4F16"),
        radial: word("U8F8"),
    });
    machine.timing.tile.side_px = block_px * (1 + rng.below(8) as u32);
    machine.timing.raster.row_cycles = None;
    machine.timing.contribution = (rng.below(4) > 0).then(|| ContributionTiming {
        blocks: 1 + rng.below(10) as u32,
        latency: (rng.below(2) == 0).then(|| 1 + rng.below(9) as u32),
    });
    machine
}

/// Timing with several parallel units and merges in flight; for a binned machine several engines,
/// too.
pub fn several(rng: &mut Rng, timing: Timing) -> Timing {
    let mut some = |most: u64| (rng.below(3) > 0).then(|| 1 + rng.below(most) as u32);
    let mut other = timing;
    other.fragment.units = some(4).map(|log| 1 << (log - 1));
    other.fragment.merges_in_flight = some(4);
    other.shade.units = some(4);
    other.resolve.units = some(4);
    if timing.organisation == Organisation::Binned {
        other.engines = some(4);
        other.queue = if some(2) == Some(2) {
            Queue::Longest
        } else {
            Queue::Order
        };
    }
    other
}

pub fn random(rng: &mut Rng) -> Timing {
    let of = |rng: &mut Rng, values: &[u32]| values[rng.below(values.len() as u64) as usize];
    let to = |rng: &mut Rng, most: u64| 1 + rng.below(most) as u32;
    let setup = |rng: &mut Rng| Setup {
        units: to(rng, 3),
        latency: Some(to(rng, 9)),
        interval: Some(to(rng, 5)),
        multipliers: None,
        fifo: to(rng, 6),
    };
    let [project, ellipse] = [setup(rng), setup(rng)];
    // Separate random numbers, so that the rest does not change.
    let rng_of_colour = &mut Rng(rng.0 ^ 0xc010);
    let colour = (rng_of_colour.below(4) > 0).then(|| {
        let latency = (rng_of_colour.below(4) > 0).then(|| to(rng_of_colour, 3));
        let interval = (rng_of_colour.below(3) > 0).then(|| to(rng_of_colour, 2));
        // Where its duration is given, no product stalls on a multiplier.
        let multipliers = if latency.is_some() || interval.is_some() {
            80
        } else {
            to(rng_of_colour, 80)
        };
        Colour {
            units: to(rng_of_colour, 3),
            latency,
            interval,
            multipliers,
            fifo: to(rng_of_colour, 2),
        }
    });
    let rng_of_fetch = &mut Rng(rng.0 ^ 0xfe7c);
    let splats = (rng_of_fetch.below(2) == 0).then(|| to(rng_of_fetch, project.units.into()));
    let lines = of(rng, &[1, 2, 4, 8, 16, 16, 64, 512]);
    let rng_of_set_up = &mut Rng(rng.0 ^ 0x5e70);
    let row_cycles = (rng_of_set_up.below(3) == 0).then(|| to(rng_of_set_up, 4));
    let clear_cycles = (rng_of_set_up.below(3) == 0).then(|| to(rng_of_set_up, 90));
    let lanes = [[1, 1], [2, 2], [4, 1], [4, 4], [8, 1], [1, 3], [3, 2]][rng.below(7) as usize];
    Timing {
        organisation: Organisation::Immediate,
        technology: Technology::Ideal,
        fetch: Fetch {
            fifo: to(rng, 6),
            splats,
        },
        project,
        ellipse,
        colour,
        raster: Raster {
            lanes,
            row_cycles,
            latency: Some(to(rng, 9)),
            fifo: to(rng, 6),
        },
        gauss: Stage {
            latency: Some(to(rng, 9)),
            fifo: to(rng, 6),
        },
        cache: Cache {
            line_px: [of(rng, &[1, 2, 4, 8]), of(rng, &[1, 2, 4, 8])],
            lines,
            ways: of(rng, &[1, 2, 4]).min(lines),
            misses: to(rng, 4),
            latency: to(rng, 4),
            fifo: to(rng, 6),
        },
        fragment: Fragment {
            latency: Some(to(rng, 9)),
            hazard: Some(to(rng, 9)),
            merge: rng.below(4) as u32,
            ..DEFAULT.fragment
        },
        shade: Shade {
            units: None,
            latency: Some(to(rng, 9)),
            interval: to(rng, 3),
        },
        resolve: Resolve {
            units: None,
            latency: Some(to(rng, 9)),
            interval: to(rng, 3),
        },
        tile: Tile {
            clear_cycles,
            ..DEFAULT.tile
        },
        memory: {
            let outstanding = match rng.below(3) {
                0 => 1 << 16,
                _ => to(rng, 6),
            };
            let burst_bytes = of(rng, &[4, 16, 64, 256]);
            // Unlimited either by memory's own field or by the technology.
            Memory {
                ideal: rng.below(2) == 0,
                ..ideal(to(rng, 30), outstanding, burst_bytes)
            }
        },
        ..Machine::named("tiny").unwrap().timing
    }
}

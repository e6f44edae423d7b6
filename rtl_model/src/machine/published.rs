//! Machines that others published, as far as their papers describe them.
//!
//! Counts, widths, buffers and clocks are those of the papers. What the papers leave open follows
//! from the named machine that each is based on. `docs/book/published.md` says which is which.

use super::named::{fp16, gaussian};
use super::timing::{
    Fetch, Memory, Organisation, Preset, Raster as RasterTiming, Setup, Sorter, Tile, Timing,
};
use super::{Bin, BinTest, Ellipse, Machine, MaskMaker, Raster, Sort, SortKind};

impl Machine {
    /// Names of the machines that others published.
    pub const PUBLISHED_NAMES: [&str; 3] = ["gscore", "flicker", "nycu"];
}

/// `fp16`, with those words in fixed point that a test of tiles needs in fixed point.
fn tested_half() -> Machine {
    let (half, fixed) = (fp16(), gaussian());
    Machine {
        ellipse: Ellipse {
            conic: fixed.ellipse.conic,
            conic_cross: fixed.ellipse.conic_cross,
            ..half.ellipse
        },
        raster: Raster {
            offset: fixed.raster.offset,
            gradient: fixed.raster.gradient,
            ..half.raster
        },
        ..half
    }
}

/// The machine with lists sorted by sorters of this kind.
fn sorted(machine: Machine, kind: SortKind) -> Machine {
    Machine {
        sort: machine.sort.map(|sort| Sort { kind, ..sort }),
        ..machine
    }
}

/// Places of the FIFO of records, in front of setup and of each engine: with fewer, the latency of
/// memory and not its bandwidth limits a frame.
const PREFETCHED: Fetch = Fetch { fifo: 64 };

/// Memory of 51.2 GB/s with enough requests in flight for it.
fn lpddr4(memory: Memory) -> Memory {
    Memory {
        preset: Some(Preset::Lpddr4),
        bytes_per_cycle: 0,
        hit_latency: 0,
        miss_latency: 0,
        burst_bytes: 0,
        row_bytes: 0,
        banks: 0,
        outstanding: 128,
        ..memory
    }
}

/// Setup units that share multipliers.
fn setup(base: Setup, units: u32, multipliers: u32) -> Setup {
    Setup {
        units,
        multipliers: Some(multipliers),
        latency: None,
        interval: None,
        ..base
    }
}

/// GSCore (ASPLOS 2024): four cores with a setup unit, a sorter and 16 pixels per cycle each;
/// oriented boxes, tiles of 16 pixels with subtiles of 8, sorts in chunks of 256.
pub(super) fn gscore() -> Machine {
    let base = sorted(tested_half(), SortKind::Hierarchical);
    let t = base.timing;
    Machine {
        name: "gscore".into(),
        bin: Some(Bin {
            test: BinTest::OrientedBox,
            subtile_px: Some(8),
            masks: Some(MaskMaker::Bin),
            mask_tests: Some(4),
        }),
        timing: Timing {
            clock_hz: 1_000_000_000,
            organisation: Organisation::Binned,
            engines: Some(4),
            fetch: PREFETCHED,
            project: setup(t.project, 4, 16),
            ellipse: setup(t.ellipse, 4, 64),
            sort: Some(Sorter {
                units: 4,
                buffer_entries: 256,
                network: 16,
                bucket_bits: Some(3),
                overlap: true,
            }),
            raster: RasterTiming {
                lanes: [4, 4],
                latency: None,
                ..t.raster
            },
            tile: Tile {
                side_px: 16,
                buffers: 2,
                clear_cycles: None,
            },
            memory: lpddr4(t.memory),
            ..t
        },
        ..base
    }
}

/// FLICKER (DATE 2026): four cores with a setup unit, a sorter, a test of subtiles of 4 pixels and
/// eight pixels per cycle each. The subtiles are tested exactly, not by a few of their pixels.
pub(super) fn flicker() -> Machine {
    let base = sorted(tested_half(), SortKind::Tile);
    let gscore = gscore().timing;
    Machine {
        name: "flicker".into(),
        bin: Some(Bin {
            test: BinTest::OrientedBox,
            subtile_px: Some(4),
            masks: Some(MaskMaker::List),
            mask_tests: Some(2),
        }),
        timing: Timing {
            sort: gscore.sort.map(|sorter| Sorter {
                bucket_bits: None,
                ..sorter
            }),
            raster: RasterTiming {
                lanes: [4, 2],
                ..gscore.raster
            },
            ..gscore
        },
        ..base
    }
}

/// The chip of NYCU (TVCG 2026), of which only an abstract is known: one core at 800 MHz, lists
/// that are sorted tile by tile without comparisons of whole keys.
pub(super) fn nycu() -> Machine {
    let base = sorted(fp16(), SortKind::Hierarchical);
    let t = base.timing;
    Machine {
        name: "nycu".into(),
        timing: Timing {
            clock_hz: 800_000_000,
            organisation: Organisation::Binned,
            fetch: PREFETCHED,
            project: setup(t.project, 1, 8),
            ellipse: setup(t.ellipse, 1, 32),
            sort: Some(Sorter {
                units: 1,
                buffer_entries: 1024,
                network: 4,
                bucket_bits: Some(8),
                overlap: true,
            }),
            raster: RasterTiming {
                lanes: [4, 1],
                latency: None,
                ..t.raster
            },
            tile: Tile {
                side_px: 16,
                buffers: 2,
                clear_cycles: None,
            },
            memory: lpddr4(t.memory),
            ..t
        },
        ..base
    }
}

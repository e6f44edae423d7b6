//! Machines that others published, as far as their papers describe them.
//!
//! Counts, widths, buffers and clocks are those of the papers. What the papers leave open follows
//! from the named machine that each is based on. `docs/book/published.md` says which is which.

use super::named::{fp16, gaussian, signed, unsigned};
use super::timing::{
    Contribution as ContributionTiming, DEFAULT, Fetch, Memory, Organisation, Preset,
    Raster as RasterTiming, Setup, Sorter, Technology, Tile, Timing,
};
use super::{
    Bin, BinTest, Contribution, Ellipse, Fragment, Gauss, Incremental, Interpolation, Leaders,
    Machine, MaskMaker, Project, Raster, Resolve, Rows, Shade, Sheets, Sort, SortKind, Splat,
    TableShape,
};
use crate::num::{Format, Overflow, Rounding, Word};

impl Machine {
    /// Names of the machines that others published.
    pub const PUBLISHED_NAMES: [&str; 5] = ["gscore", "neo", "flicker", "nycu", "cubed"];
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
const PREFETCHED: Fetch = Fetch {
    fifo: 64,
    splats: None,
};

/// Tiles of 16 pixels in two buffers, this many pixels per cycle and engine, and memory of 51.2 GB/s
/// with enough requests in flight for it.
fn in_tiles(base: Timing, lanes: [u32; 2]) -> Timing {
    Timing {
        organisation: Organisation::Binned,
        fetch: PREFETCHED,
        raster: RasterTiming {
            lanes,
            latency: None,
            ..base.raster
        },
        tile: Tile {
            side_px: 16,
            buffers: 2,
            clear_cycles: None,
        },
        memory: Memory {
            outstanding: 128,
            ..base.memory.with_preset(Preset::Lpddr4)
        },
        ..base
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
            tiles_per_cycle: Some(2),
        }),
        timing: Timing {
            clock_hz: 1_000_000_000,
            engines: Some(4),
            project: setup(t.project, 4, 16),
            ellipse: setup(t.ellipse, 4, 64),
            sort: Some(Sorter {
                units: 4,
                buffer_entries: 256,
                network: 16,
                bucket_bits: Some(3),
                overlap: true,
            }),
            ..in_tiles(t, [4, 4])
        },
        ..base
    }
}

/// Neo (ASPLOS 2026): lists that are kept from frame to frame, in chunks of 256; 16 sorters (8 of
/// each kind), four cores with 64 pixels per cycle each, tiles of 64 pixels with masks of subtiles
/// that `list` makes.
pub(super) fn neo() -> Machine {
    let base = sorted(tested_half(), SortKind::Incremental);
    let Machine {
        timing: gscore,
        bin,
        ..
    } = gscore();
    let side_px = 64;
    Machine {
        name: "neo".into(),
        sort: base.sort.map(|sort| Sort {
            incremental: Some(Incremental {
                tile_px: side_px,
                ..Incremental::default()
            }),
            ..sort
        }),
        bin: bin.map(|bin| Bin {
            masks: Some(MaskMaker::List),
            ..bin
        }),
        timing: Timing {
            sort: gscore.sort.map(|sorter| Sorter {
                units: 16,
                bucket_bits: None,
                ..sorter
            }),
            raster: RasterTiming {
                lanes: [8, 8],
                ..gscore.raster
            },
            tile: Tile {
                side_px,
                ..gscore.tile
            },
            ..gscore
        },
        ..base
    }
}

/// FLICKER (DATE 2026): four cores with a setup unit, a sorter, a contribution test of blocks of 4
/// pixels and eight pixels per cycle each. The test evaluates eight leader pixels per cycle, in
/// words of 8 bits behind differences of 16 bits.
pub(super) fn flicker() -> Machine {
    let base = sorted(tested_half(), SortKind::Tile);
    let gscore = gscore().timing;
    Machine {
        name: "flicker".into(),
        bin: Some(Bin {
            test: BinTest::OrientedBox,
            tiles_per_cycle: Some(4),
            ..Bin::default()
        }),
        contribution: Some(TEST_IN_8_BITS),
        timing: Timing {
            sort: gscore.sort.map(|sorter| Sorter {
                bucket_bits: None,
                ..sorter
            }),
            raster: RasterTiming {
                lanes: [4, 2],
                ..gscore.raster
            },
            contribution: Some(ContributionTiming {
                blocks: 2,
                latency: None,
            }),
            ..gscore
        },
        ..base
    }
}

/// The contribution test of FLICKER: differences of 16 bits, and words of 8 bits behind them.
pub(super) const TEST_IN_8_BITS: Contribution = Contribution {
    block_px: 4,
    leaders: Leaders::Corners,
    offset: float(signed(15, 12), 11),
    square: float(unsigned(20, 11), 4),
    product: float(signed(20, 12), 3),
    conic: float(unsigned(2, 24), 4),
    conic_cross: float(signed(3, 23), 3),
    radial: float(unsigned(6, 14), 4),
};

/// A word that keeps this many significant bits.
const fn float(word: Word, significant_bits: i32) -> Word {
    Word::new(Format {
        significant_bits,
        ..word.format
    })
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
            project: setup(t.project, 1, 8),
            ellipse: setup(t.ellipse, 1, 32),
            sort: Some(Sorter {
                units: 1,
                buffer_entries: 1024,
                network: 4,
                bucket_bits: Some(8),
                overlap: true,
            }),
            ..in_tiles(t, [4, 1])
        },
        ..base
    }
}

/// The words of cubed, an open renderer for an FPGA (docs/book/machine-cubed.md): everything from
/// the record of a projected Gaussian to the pixel. Setup is that of `gaussian`: the original does
/// it in software.
pub(super) fn cubed() -> Machine {
    let base = gaussian();
    let truncated = |word: Word| word.rounded(Rounding::Truncate);
    Machine {
        name: "cubed".into(),
        splat: Splat {
            rgb: unsigned(0, 8),
            opacity: unsigned(0, 8),
            ..base.splat
        },
        project: Project {
            pixel: signed(base.project.pixel.format.int_bits, 4),
            ..base.project
        },
        // 2·Q01 has 14 fraction bits, as Q00 has.
        ellipse: Ellipse {
            conic: unsigned(2, 14),
            conic_cross: signed(2, 15),
            amplitude: unsigned(0, 8),
            ..base.ellipse
        },
        sort: Some(Sort {
            kind: SortKind::Radix,
            key: unsigned(1, 15),
            tile_bits: None,
            digit_bits: 8,
            incremental: None,
            depth_weight: None,
        }),
        raster: Raster {
            rows: Rows::Direct,
            cutoff: unsigned(5, 16),
            most_cutoff: Some(8),
            offset: signed(14, 4),
            square: Some(truncated(signed(28, 4))),
            radial: signed(14, 18).overflowing(Overflow::Wrap),
            ..base.raster
        },
        gauss: Gauss {
            radial_index: truncated(unsigned(3, 8)),
            // Without bits below the address, the words are those at the beginnings of steps.
            table: TableShape {
                index_bits: 11,
                interpolation: Interpolation::Linear,
            },
            falloff: unsigned(0, 16),
            weight: truncated(unsigned(0, 7)),
        },
        fragment: Fragment {
            layers: 1,
            weight_sum: unsigned(1, 7),
            colour_sum: unsigned(1, 15),
            opacity_sum: unsigned(1, 10),
            sheets: base.fragment.sheets.map(|sheets| Sheets {
                composite: Some(truncated(unsigned(0, 10))),
                ..sheets
            }),
            ..base.fragment
        },
        shade: Shade {
            premultiplied: unsigned(1, 15),
            ..base.shade
        },
        resolve: Resolve {
            frame: unsigned(1, 10),
            ..base.resolve
        },
        timing: Timing {
            clock_hz: 70_000_000,
            technology: Technology::Fpga,
            engines: Some(4),
            raster: RasterTiming {
                lanes: [1, 1],
                row_cycles: Some(3),
                ..DEFAULT.raster
            },
            tile: Tile {
                side_px: 32,
                buffers: 2,
                clear_cycles: Some(1024),
            },
            // A record has 32 bytes: the FIFO of 32 words of 64 bits holds eight.
            fetch: Fetch {
                fifo: 8,
                splats: None,
            },
            memory: Memory {
                bytes_per_cycle: 8,
                burst_bytes: 32,
                ..DEFAULT.memory
            },
            ..DEFAULT
        },
        ..base
    }
}

//! Timing: the microarchitecture of a machine: lanes, latencies, FIFOs, caches, memory.
//!
//! Nothing here changes a picture. Fields that are left out follow from the formats and the clock
//! ([`microarchitecture`](crate::elaboration::microarchitecture)).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Order in which a machine draws a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Organisation {
    /// Splats in input order, fragments in memory behind a cache of lines.
    Immediate,
    /// A first pass writes a list for each tile. Then each tile is drawn on the chip and written
    /// once.
    Binned,
}

/// Technology: the length of an FO4, the delay of a fanout-of-4 inverter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Technology {
    /// Operators take no time, and any clock and latency is accepted. It shows what latency costs;
    /// no real machine has it.
    Ideal,
    /// 180 nm: 98 ps.
    #[serde(rename = "180nm")]
    Nm180,
    /// 65 nm: 23.4 ps.
    #[serde(rename = "65nm")]
    Nm65,
    /// 28 nm: 10 ps.
    #[default]
    #[serde(rename = "28nm")]
    Nm28,
    /// 7 nm: 2.5 ps.
    #[serde(rename = "7nm")]
    Nm7,
    /// An FPGA such as a Xilinx 7, including its wires: 200 ps.
    Fpga,
}

impl Technology {
    /// An FO4 in the typical corner, femtoseconds; `None` if operators take no time. For 180 nm it
    /// is that of the open cells with which delays were measured. The others are 0.36 ps per
    /// nanometre of gate length (Ho, Mai and Horowitz, "The future of wires", 2001; 0.5 in the
    /// worst corner). It is an assumption that this holds below 100 nm. The FPGA's value is an
    /// assumption too. Wires are not counted.
    pub fn fo4_fs(self) -> Option<u64> {
        match self {
            Technology::Ideal => None,
            Technology::Nm180 => Some(98_000),
            Technology::Nm65 => Some(23_400),
            Technology::Nm28 => Some(10_000),
            Technology::Nm7 => Some(2_500),
            Technology::Fpga => Some(200_000),
        }
    }

    /// Its name in sentences.
    pub fn name(self) -> &'static str {
        match self {
            Technology::Ideal => "ideal gates",
            Technology::Nm180 => "180 nm",
            Technology::Nm65 => "65 nm",
            Technology::Nm28 => "28 nm",
            Technology::Nm7 => "7 nm",
            Technology::Fpga => "an FPGA",
        }
    }

    fn is_default(&self) -> bool {
        *self == Technology::default()
    }
}

/// Order in which the tiles of a binned machine are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Queue {
    /// Row by row.
    #[default]
    Order,
    /// The most entries first, and equal ones row by row. The lengths are sorted between the
    /// passes.
    Longest,
}

impl Queue {
    fn is_default(&self) -> bool {
        *self == Queue::default()
    }
}

/// The microarchitecture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Timing {
    /// Clock frequency, Hz.
    pub clock_hz: u64,
    /// Technology; left out, 28 nm. Together with the clock it determines the least latency of each
    /// unit.
    #[serde(default, skip_serializing_if = "Technology::is_default")]
    pub technology: Technology,
    /// Order in which a frame is drawn.
    pub organisation: Organisation,
    /// Tile engines of a binned machine, from `list` to `resolve`. Each takes the next tile from
    /// one queue when its `list` has finished the previous one. Left out, 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub engines: Option<u32>,
    /// Order in which engines take tiles; left out, row by row.
    #[serde(default, skip_serializing_if = "Queue::is_default")]
    pub queue: Queue,
    /// Reads splat records; in the second pass of a binned machine, lists and the records of their
    /// entries.
    pub fetch: Fetch,
    /// Walker of trees. Left out: a frame with a tree uses the default walker, which is not part of
    /// the machine's area.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub walk: Option<Walk>,
    /// World point → pixel.
    pub project: Setup,
    /// Normal and radius → conic, box.
    pub ellipse: Setup,
    /// Spherical harmonics → colour, on a machine with the unit `colour`; left out, one unit with
    /// 16 multipliers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub colour: Option<Colour>,
    /// Sorters of tiles' lists, on a machine whose `sort.kind` is `tile`, `hierarchical` or
    /// `incremental`; left out there, one with the default sizes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sort: Option<Sorter>,
    /// Contribution test, on a machine with the unit `contribution`; left out there, one block per
    /// cycle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contribution: Option<Contribution>,
    /// Ellipse → fragments.
    pub raster: Raster,
    /// Radial index → weight.
    pub gauss: Stage,
    /// Cache of the frame buffer, for an immediate machine.
    pub cache: Cache,
    /// Tiles on the chip, for a binned machine.
    pub tile: Tile,
    /// Fragments of a pixel.
    pub fragment: Fragment,
    /// Normalise and light.
    pub shade: Shade,
    /// The map of the environment in memory, with a cache for each shade unit. Left out: it is a
    /// table on the chip.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub environment: Option<Environment>,
    /// Blend into the frame.
    pub resolve: Resolve,
    /// Memory outside of the chip.
    pub memory: Memory,
}

/// The reader of splat records.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "FetchTiming")]
#[serde(deny_unknown_fields)]
pub struct Fetch {
    /// Places of the FIFO behind it, records.
    pub fifo: u32,
    /// Records that it reads per cycle, 1 to 16 and at most as many as there are units of
    /// `project`; left out, 1. The FIFO of records has this many banks, which share its places. The
    /// walker of a tree reads one per cycle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub splats: Option<u32>,
}

/// The walker with which `fetch` finds the splats of a tree. It tests one node per cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "WalkTiming")]
#[serde(deny_unknown_fields, default)]
pub struct Walk {
    /// Entries of the stack: nodes whose children are not read yet, each as an index and a count.
    pub stack: u32,
}

impl Default for Walk {
    fn default() -> Self {
        Walk { stack: 1024 }
    }
}

/// A unit of setup.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "SetupTiming")]
#[serde(deny_unknown_fields)]
pub struct Setup {
    /// Parallel units; splats are given to them in turn.
    pub units: u32,
    /// Cycles from a splat to its result; left out, the least that the formats and the clock allow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latency: Option<u32>,
    /// Initiation interval, cycles; left out, the least that the multipliers allow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval: Option<u32>,
    /// Multipliers that its products share; left out, each product has its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub multipliers: Option<u32>,
    /// Places of the FIFO behind it, results.
    pub fifo: u32,
}

/// The contribution test, in front of the rasteriser of each engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "ContributionTiming")]
#[serde(deny_unknown_fields, default)]
pub struct Contribution {
    /// Blocks that are tested per cycle, 1 to 16. Each has its own arithmetic for all of its
    /// leaders.
    pub blocks: u32,
    /// Cycles from the record of a splat to its mask; left out, the least that the clock allows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latency: Option<u32>,
}

impl Default for Contribution {
    fn default() -> Self {
        Contribution {
            blocks: 1,
            latency: None,
        }
    }
}

/// The colour unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "ColourTiming")]
#[serde(deny_unknown_fields, default)]
pub struct Colour {
    /// Parallel units; splats are given to them in turn.
    pub units: u32,
    /// Cycles from a splat to its colour; left out, the least that the degree of its harmonics and
    /// the clock allow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latency: Option<u32>,
    /// Initiation interval, cycles; left out, the least that its products and the multipliers
    /// allow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval: Option<u32>,
    /// Multipliers that the products of a splat share, at most as many as there are products of the
    /// greatest degree.
    pub multipliers: u32,
    /// Places of the FIFO behind it, results.
    pub fifo: u32,
}

impl Default for Colour {
    fn default() -> Self {
        Colour {
            units: 1,
            latency: None,
            interval: None,
            multipliers: 16,
            fifo: 4,
        }
    }
}

/// A sorter: it loads entries of a list into its buffer, sorts them there, and stores them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "SortTiming")]
#[serde(deny_unknown_fields, default)]
pub struct Sorter {
    /// Parallel sorters, 1 to 64. Each takes the next list from one queue.
    pub units: u32,
    /// Entries that a sorter sorts at a time, a power of two, 4 to 65536.
    pub buffer_entries: u32,
    /// Entries that its bitonic network sorts at a time, a power of two, 1 to 1024 and at most
    /// `buffer_entries`; 1: it has no network. The runs of the network are merged in the buffer,
    /// one entry per cycle.
    pub network: u32,
    /// Upper bits of the key that select the bucket of an entry, 1 to 12, on a machine whose
    /// `sort.kind` is `hierarchical`; left out there, 6.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bucket_bits: Option<u32>,
    /// Sort lists while earlier tiles are drawn; left out, false: the first tile is drawn when all
    /// lists are sorted.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub overlap: bool,
}

impl Default for Sorter {
    fn default() -> Self {
        Sorter {
            units: 1,
            buffer_entries: 256,
            network: 16,
            bucket_bits: None,
            overlap: false,
        }
    }
}

/// The rasteriser.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "RasterTiming")]
#[serde(deny_unknown_fields)]
pub struct Raster {
    /// Pixels tested per cycle: columns and rows of a stamp. A stamp with one covered pixel costs
    /// as much as a full one.
    pub lanes: [u32; 2],
    /// Cycles before the first stamp of each row of stamps, in which the row is set up, 0 to 1024.
    /// Left out, 0. A machine with masks of subtiles has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub row_cycles: Option<u32>,
    /// Cycles from a stamp to its contributions; left out, the least that the formats and the clock
    /// allow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latency: Option<u32>,
    /// Places of the FIFO behind it, stamps.
    pub fifo: u32,
}

/// A unit that takes one stamp per cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "StageTiming")]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// Cycles from a stamp to its result; left out, the least that the formats and the clock allow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latency: Option<u32>,
    /// Places of the FIFO behind it, stamps.
    pub fifo: u32,
}

/// A set-associative, least-recently-used write-back cache of the frame buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "CacheTiming")]
#[serde(deny_unknown_fields)]
pub struct Cache {
    /// Pixels of a line: columns and rows, powers of two. With large lines it is a tile cache.
    pub line_px: [u32; 2],
    /// Lines, a power of two.
    pub lines: u32,
    /// Lines of a set, a power of two up to 64.
    pub ways: u32,
    /// Outstanding misses: lines that can be on their way from memory at the same time.
    pub misses: u32,
    /// Cycles of a look-up.
    pub latency: u32,
    /// Places of the FIFO behind it: stamps whose lines are not loaded yet.
    pub fifo: u32,
}

/// Tiles on the chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "TileTiming")]
#[serde(deny_unknown_fields)]
pub struct Tile {
    /// Side, pixels: a multiple of 4 up to 128, or a multiple of 16 up to 1024.
    pub side_px: u32,
    /// 1: a tile is drawn after the previous one is resolved. 2: while the previous one is
    /// resolved; merging and resolving then have separate shade units.
    pub buffers: u32,
    /// Cycles in which the buffer of a tile is cleared before its first fragment, 0 to 1048576.
    /// Clearing begins when the previous tile of the engine has its last fragment and the buffer is
    /// free. Left out, 0: a bit per pixel marks those that were written.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clear_cycles: Option<u32>,
}

/// The fragment unit. Its lanes are those of the rasteriser.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "FragmentTiming")]
#[serde(deny_unknown_fields)]
pub struct Fragment {
    /// Units that share the rasteriser's lanes, a power of two. Pixel (x, y) belongs to unit (x +
    /// y·columns of a stamp) mod units, so the pixels of a stamp are distributed evenly. A stamp
    /// starts when all units that its pixels need are free. Left out, 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub units: Option<u32>,
    /// Stamps whose fragments can be merged in a unit at the same time. When this number is
    /// reached, the unit takes no stamp. Left out, 1: a merge occupies the unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub merges_in_flight: Option<u32>,
    /// Cycles from reading a fragment until it is written; left out, the least that the formats and
    /// the clock allow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latency: Option<u32>,
    /// Cycles until the same pixel can be read again; left out, the latency. 1 with forwarding.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hazard: Option<u32>,
    /// Additional cycles for each pixel of a stamp in which two fragments merge, after they are
    /// shaded.
    pub merge: u32,
}

/// The shade unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "ShadeTiming")]
#[serde(deny_unknown_fields)]
pub struct Shade {
    /// Parallel units, wherever the machine has one. A fragment goes to the first that is free.
    /// Left out, 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub units: Option<u32>,
    /// Cycles from a fragment to its light; left out, the least that the formats and the clock
    /// allow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latency: Option<u32>,
    /// Initiation interval, cycles.
    pub interval: u32,
}

/// A set-associative, least-recently-used, read-only cache of the map of the environment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "EnvironmentTiming")]
#[serde(deny_unknown_fields, default)]
pub struct Environment {
    /// Texels of a line: columns and rows, powers of two.
    pub line_texels: [u32; 2],
    /// Lines, a power of two.
    pub lines: u32,
    /// Lines of a set, a power of two up to 64.
    pub ways: u32,
}

impl Default for Environment {
    fn default() -> Self {
        Environment {
            line_texels: [4, 4],
            lines: 32,
            ways: 4,
        }
    }
}

/// The resolve unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "ResolveTiming")]
#[serde(deny_unknown_fields)]
pub struct Resolve {
    /// Units that share the pixels of a tile or a line. The next pixel goes to the first unit that
    /// is free. Left out, 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub units: Option<u32>,
    /// Cycles from the last light of a pixel to its word; left out, the least that the formats and
    /// the clock allow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latency: Option<u32>,
    /// Least cycles from one pixel to the next. A pixel takes longer if it has more fragments than
    /// this, or if shading takes longer.
    pub interval: u32,
}

/// Memory outside of the chip: channels with banks and open rows. A field that a preset fills is 0
/// or left out, unless the machine sets it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "MemoryTiming")]
#[serde(deny_unknown_fields)]
pub struct Memory {
    /// A memory standard. It fills every field below that is left out, except `outstanding`, with
    /// the numbers of its data sheet at the clock of the machine. Left out: the fields from
    /// `bytes_per_cycle` to `banks` are required.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub preset: Option<Preset>,
    /// Every request is served after the latency of an open row, regardless of other requests. It
    /// shows the cycles of the datapath.
    #[serde(default)]
    pub ideal: bool,
    /// Bytes per cycle of each channel.
    #[serde(default, skip_serializing_if = "is_left_out")]
    pub bytes_per_cycle: u32,
    /// Additional thousandths of a byte per cycle, below 1000; left out, 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bytes_per_cycle_permille: Option<u32>,
    /// Cycles from a request to its first byte if its row is open.
    #[serde(default, skip_serializing_if = "is_left_out")]
    pub hit_latency: u32,
    /// Cycles from a request to its first byte if another row is open.
    #[serde(default, skip_serializing_if = "is_left_out")]
    pub miss_latency: u32,
    /// Bytes of a request, a power of two, at least 4 (an entry of a list).
    #[serde(default, skip_serializing_if = "is_left_out")]
    pub burst_bytes: u32,
    /// Outstanding requests of `fetch`, and of `resolve`.
    pub outstanding: u32,
    /// Bytes of a row, a power of two.
    #[serde(default, skip_serializing_if = "is_left_out")]
    pub row_bytes: u32,
    /// Banks of a rank, a power of two. Each has one open row and its own share of the addresses.
    #[serde(default, skip_serializing_if = "is_left_out")]
    pub banks: u32,
    /// Channels, a power of two up to 64. Each has the bandwidth above and its own banks. Left
    /// out, 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub channels: Option<u32>,
    /// Bytes after which addresses continue in the next channel, a power of two, at least a burst;
    /// left out, a burst.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interleave_bytes: Option<u32>,
    /// Ranks of a channel, a power of two up to 8. Each has the number of banks above. Left out, 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ranks: Option<u32>,
    /// Cycles for which the bus of a channel is idle when it changes ranks; left out, 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rank_switch_cycles: Option<u32>,
    /// Cycles from one refresh of all ranks to the next (tREFI); 0 or left out: no refresh.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refresh_interval_cycles: Option<u32>,
    /// Cycles of a refresh (tRFC), less than `refresh_interval_cycles`. The bus is idle meanwhile,
    /// and every row is closed afterwards.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refresh_cycles: Option<u32>,
    /// Cycles for which the bus of a channel is idle when it turns from reads to writes and back;
    /// left out, 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turnaround_cycles: Option<u32>,
    /// Bursts that a channel gathers and writes together, if it has that many; left out, 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub write_batch: Option<u32>,
    /// Least cycles between two activations of the same bank (tRC); left out, 0: no limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub row_cycles: Option<u32>,
    /// Cycles in which a rank opens at most four rows (tFAW); left out, 0: no limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub four_rows_cycles: Option<u32>,
}

fn is_left_out(value: &u32) -> bool {
    *value == 0
}

/// A memory standard, with the numbers of its data sheet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Preset {
    /// LPDDR4 of 3200 MT/s, four channels of 32 bits (each of two devices of 8 Gbit and 16 bits):
    /// 51.2 GB/s.
    #[serde(rename = "lpddr4-3200-x4")]
    Lpddr4,
    /// LPDDR5 of 6400 MT/s, four channels of 16 bits (each of one device of 8 Gbit): 51.2 GB/s.
    #[serde(rename = "lpddr5-6400-x4")]
    Lpddr5,
    /// DDR5 of 4800 MT/s, one module: two channels of 32 bits (each of four devices of 16 Gbit and
    /// 8 bits): 38.4 GB/s.
    #[serde(rename = "ddr5-4800")]
    Ddr5,
    /// HBM2 of 2 Gbit/s per pin, one stack: eight channels of 128 bits (8 Gbit each): 256 GB/s.
    #[serde(rename = "hbm2")]
    Hbm2,
}

/// Numbers of a data sheet: picoseconds, bytes.
struct DataSheet {
    /// Bytes per second of a channel.
    bytes: u64,
    channels: u32,
    burst_bytes: u32,
    row_bytes: u32,
    banks: u32,
    /// CL or RL, tRCD, tRP.
    read: u64,
    activate: u64,
    precharge: u64,
    /// tRC, tFAW, tREFI, tRFC of all banks.
    row_cycle: u64,
    four_rows: u64,
    refresh_interval: u64,
    refresh: u64,
    /// tWTR_L and the read latency, and two clocks of the bus.
    turnaround: u64,
    /// Between ranks: two clocks of the bus.
    rank_switch: u64,
}

impl Preset {
    /// JESD209-4, JESD209-5B, JESD79-5 (speed bin 4800B) and JESD235. Where these leave a value to
    /// the manufacturer, a usual value.
    fn data_sheet(self) -> DataSheet {
        match self {
            Preset::Lpddr4 => DataSheet {
                bytes: 12_800_000_000,
                channels: 4,
                burst_bytes: 64,
                row_bytes: 4096,
                banks: 8,
                read: 17_500,
                activate: 18_000,
                precharge: 18_000,
                row_cycle: 60_000,
                four_rows: 40_000,
                refresh_interval: 3_904_000,
                refresh: 280_000,
                turnaround: 28_750,
                rank_switch: 1_250,
            },
            Preset::Lpddr5 => DataSheet {
                bytes: 12_800_000_000,
                channels: 4,
                burst_bytes: 32,
                row_bytes: 2048,
                banks: 16,
                read: 21_250,
                activate: 18_000,
                precharge: 18_000,
                row_cycle: 60_000,
                four_rows: 20_000,
                refresh_interval: 3_906_000,
                refresh: 210_000,
                turnaround: 35_750,
                rank_switch: 2_500,
            },
            Preset::Ddr5 => DataSheet {
                bytes: 19_200_000_000,
                channels: 2,
                burst_bytes: 64,
                row_bytes: 4096,
                banks: 32,
                read: 16_640,
                activate: 16_000,
                precharge: 16_000,
                row_cycle: 48_000,
                four_rows: 13_333,
                refresh_interval: 3_900_000,
                refresh: 295_000,
                turnaround: 27_500,
                rank_switch: 832,
            },
            Preset::Hbm2 => DataSheet {
                bytes: 32_000_000_000,
                channels: 8,
                burst_bytes: 64,
                row_bytes: 2048,
                banks: 16,
                read: 14_000,
                activate: 14_000,
                precharge: 14_000,
                row_cycle: 48_000,
                four_rows: 30_000,
                refresh_interval: 3_900_000,
                refresh: 260_000,
                turnaround: 24_000,
                rank_switch: 2_000,
            },
        }
    }
}

/// Bursts that the controller of a preset writes together: half of the usual 32 places of its
/// queue.
const WRITE_BATCH: u32 = 16;

impl Memory {
    /// Fields that a preset fills.
    pub const FILLED: [&str; 17] = [
        "bytes_per_cycle",
        "bytes_per_cycle_permille",
        "hit_latency",
        "miss_latency",
        "burst_bytes",
        "row_bytes",
        "banks",
        "channels",
        "interleave_bytes",
        "ranks",
        "rank_switch_cycles",
        "refresh_interval_cycles",
        "refresh_cycles",
        "turnaround_cycles",
        "write_batch",
        "row_cycles",
        "four_rows_cycles",
    ];

    /// The memory with every field set: a field that the machine leaves out is that of its preset
    /// at this clock. Bandwidth is rounded down to thousandths of a byte per cycle, times are
    /// rounded up to cycles.
    pub fn resolved(self, clock_hz: u64) -> Self {
        let Some(preset) = self.preset else {
            return self;
        };
        let sheet = preset.data_sheet();
        // At a clock of 1 Hz, there are more bytes per cycle than a field holds.
        let number = |value: u128| u32::try_from(value).unwrap_or(u32::MAX);
        let cycles = |picoseconds: u64| {
            number(
                (u128::from(picoseconds) * u128::from(clock_hz))
                    .div_ceil(1_000_000_000_000)
                    .max(1),
            )
        };
        let thousandths = u128::from(sheet.bytes) * 1000 / u128::from(clock_hz.max(1));
        let or = |given: u32, value: u32| if given == 0 { value } else { given };
        // Thousandths belong to the bytes of the preset.
        let permille = if self.bytes_per_cycle == 0 {
            number(thousandths % 1000)
        } else {
            0
        };
        let burst_bytes = or(self.burst_bytes, sheet.burst_bytes);
        let interval = self
            .refresh_interval_cycles
            .unwrap_or(cycles(sheet.refresh_interval));
        Memory {
            bytes_per_cycle: or(self.bytes_per_cycle, number(thousandths / 1000)),
            bytes_per_cycle_permille: self.bytes_per_cycle_permille.or(Some(permille)),
            hit_latency: or(self.hit_latency, cycles(sheet.read)),
            miss_latency: or(
                self.miss_latency,
                cycles(sheet.precharge + sheet.activate + sheet.read),
            ),
            burst_bytes,
            row_bytes: or(self.row_bytes, sheet.row_bytes),
            banks: or(self.banks, sheet.banks),
            channels: self.channels.or(Some(sheet.channels)),
            interleave_bytes: self.interleave_bytes.or(Some(burst_bytes)),
            ranks: self.ranks.or(Some(1)),
            rank_switch_cycles: self.rank_switch_cycles.or(Some(cycles(sheet.rank_switch))),
            refresh_interval_cycles: self.refresh_interval_cycles.or(Some(interval)),
            // With a slow clock both are one cycle.
            refresh_cycles: self
                .refresh_cycles
                .or(Some(cycles(sheet.refresh).min(interval.saturating_sub(1)))),
            turnaround_cycles: self.turnaround_cycles.or(Some(cycles(sheet.turnaround))),
            write_batch: self.write_batch.or(Some(WRITE_BATCH)),
            row_cycles: self.row_cycles.or(Some(cycles(sheet.row_cycle))),
            four_rows_cycles: self.four_rows_cycles.or(Some(cycles(sheet.four_rows))),
            ..self
        }
    }

    /// Channels.
    pub fn channels(&self) -> u32 {
        self.channels.unwrap_or(1)
    }

    /// Bytes after which addresses continue in the next channel.
    pub fn interleave_bytes(&self) -> u32 {
        self.interleave_bytes.unwrap_or(self.burst_bytes)
    }

    /// The memory with a preset, which fills all numbers ([`FILLED`](Self::FILLED)).
    pub fn with_preset(self, preset: Preset) -> Self {
        Memory {
            preset: Some(preset),
            bytes_per_cycle: 0,
            bytes_per_cycle_permille: None,
            hit_latency: 0,
            miss_latency: 0,
            burst_bytes: 0,
            row_bytes: 0,
            banks: 0,
            channels: None,
            interleave_bytes: None,
            ranks: None,
            rank_switch_cycles: None,
            refresh_interval_cycles: None,
            refresh_cycles: None,
            turnaround_cycles: None,
            write_batch: None,
            row_cycles: None,
            four_rows_cycles: None,
            ..self
        }
    }

    /// Whether more than the bandwidth and the open rows of a single channel matter. The memory must
    /// be [resolved](Self::resolved).
    pub fn has_channels(&self) -> bool {
        let limits = [
            self.bytes_per_cycle_permille,
            self.rank_switch_cycles,
            self.turnaround_cycles,
            self.row_cycles,
            self.four_rows_cycles,
            self.refresh_interval_cycles,
        ];
        let is_plain = limits.iter().all(|limit| limit.unwrap_or(0) == 0);
        !is_plain || self.channels() > 1 || self.ranks.unwrap_or(1) > 1
    }

    /// Distance between the lists of two tiles in memory, at least `bytes`. With channels, the next
    /// list begins in the next bank: lists of a frame grow at the same time, and a bank opens one
    /// row after another.
    pub fn list_stride(&self, bytes: u64) -> u64 {
        let next_bank = u64::from(self.channels()) * u64::from(self.row_bytes);
        bytes + if self.has_channels() { next_bank } else { 0 }
    }

    /// Thousandths of a byte that all channels together move per cycle.
    pub fn bytes_per_1000_cycles(&self) -> u64 {
        let of_one = u64::from(self.bytes_per_cycle) * 1000
            + u64::from(self.bytes_per_cycle_permille.unwrap_or(0));
        of_one * u64::from(self.channels())
    }
}

/// The default microarchitecture: tiles, one stamp of 4×1 pixels per cycle, all units pipelined,
/// memory of 6.4 GB/s.
pub const DEFAULT: Timing = Timing {
    clock_hz: 400_000_000,
    technology: Technology::Nm28,
    organisation: Organisation::Binned,
    engines: None,
    queue: Queue::Order,
    fetch: Fetch {
        fifo: 16,
        splats: None,
    },
    walk: None,
    project: Setup {
        units: 1,
        latency: None,
        interval: None,
        multipliers: None,
        fifo: 4,
    },
    ellipse: Setup {
        units: 1,
        latency: None,
        interval: None,
        multipliers: None,
        fifo: 16,
    },
    colour: None,
    sort: None,
    contribution: None,
    raster: Raster {
        lanes: [4, 1],
        row_cycles: None,
        latency: None,
        fifo: 16,
    },
    gauss: Stage {
        latency: None,
        fifo: 4,
    },
    cache: Cache {
        line_px: [4, 4],
        lines: 256,
        ways: 4,
        misses: 8,
        latency: 2,
        fifo: 32,
    },
    tile: Tile {
        side_px: 16,
        buffers: 1,
        clear_cycles: None,
    },
    fragment: Fragment {
        units: None,
        merges_in_flight: None,
        latency: None,
        hazard: None,
        merge: 1,
    },
    shade: Shade {
        units: None,
        latency: None,
        interval: 1,
    },
    environment: None,
    resolve: Resolve {
        units: None,
        latency: None,
        interval: 1,
    },
    memory: Memory {
        preset: None,
        ideal: false,
        bytes_per_cycle: 16,
        bytes_per_cycle_permille: None,
        hit_latency: 20,
        miss_latency: 50,
        burst_bytes: 64,
        outstanding: 16,
        row_bytes: 2048,
        banks: 8,
        channels: None,
        interleave_bytes: None,
        ranks: None,
        rank_switch_cycles: None,
        refresh_interval_cycles: None,
        refresh_cycles: None,
        turnaround_cycles: None,
        write_batch: None,
        row_cycles: None,
        four_rows_cycles: None,
    },
};

//! Timing: the microarchitecture of a machine: lanes, latencies, FIFOs, caches, memory.
//!
//! ```text
//! description ─►( elaborate: what is left out follows from the formats )─► latencies, intervals, record sizes
//!                                          └► every misfit, a sentence each
//! ```
//! Nothing here changes a picture.

use super::{Elaboration, FunctionUnit, Interpolation, Machine, Part};
use crate::num::Word;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How a machine goes through a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Organisation {
    /// Splats in input order, fragments in memory behind a cache of lines.
    Immediate,
    /// A first pass writes a list for each tile; then tile after tile is drawn on the chip and written once.
    Binned,
}

/// Where time goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Timing {
    /// Cycles a second.
    pub clock_hz: u64,
    /// How a frame is gone through.
    pub organisation: Organisation,
    /// Reads splat records; in the second pass of a binned machine, lists and what they point to.
    pub fetch: Fetch,
    /// World point → pixel.
    pub project: Setup,
    /// Normal and radius → conic, box.
    pub ellipse: Setup,
    /// Ellipse → fragments.
    pub raster: Raster,
    /// Radial index → weight.
    pub gauss: Stage,
    /// Lines of the frame buffer, of an immediate machine.
    pub cache: Cache,
    /// Tiles on the chip, of a binned machine.
    pub tile: Tile,
    /// Fragments of a pixel.
    pub fragment: Fragment,
    /// Normalise and light.
    pub shade: Shade,
    /// Blend into the frame.
    pub resolve: Resolve,
    /// What lies outside of the chip.
    pub memory: Memory,
}

/// The reader of splat records.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fetch {
    /// Records that can wait behind it.
    pub fifo: u32,
}

/// A unit that sets splats up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Setup {
    /// How many work side by side; splats take turns.
    pub units: u32,
    /// Cycles from a splat to its result; left out, what the formats ask for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latency: Option<u32>,
    /// Cycles from one splat to the next; left out, what the multipliers ask for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval: Option<u32>,
    /// Multipliers that its products share; left out, each has its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub multipliers: Option<u32>,
    /// Results that can wait behind it.
    pub fifo: u32,
}

/// The rasteriser.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Raster {
    /// Pixels tested in a cycle: columns and rows of a slot. One covered pixel costs the whole slot.
    pub lanes: [u32; 2],
    /// Cycles from a slot to its contributions; left out, what the formats ask for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latency: Option<u32>,
    /// Slots that can wait behind it.
    pub fifo: u32,
}

/// A unit that takes a slot a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// Cycles from a slot to its result; left out, what the formats ask for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latency: Option<u32>,
    /// Slots that can wait behind it.
    pub fifo: u32,
}

/// A set-associative write-back cache of the frame buffer, the line used longest ago going first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cache {
    /// Pixels of a line: columns and rows, powers of two. A tile cache has large ones.
    pub line_px: [u32; 2],
    /// Lines, a power of two.
    pub lines: u32,
    /// Lines of a set, a power of two.
    pub ways: u32,
    /// Lines that can be on their way from memory at a time.
    pub misses: u32,
    /// Cycles of a look-up.
    pub latency: u32,
    /// Slots that can wait behind it for their lines.
    pub fifo: u32,
}

/// Tiles on the chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tile {
    /// Side, pixels: a multiple of 16.
    pub side_px: u32,
    /// 1: a tile is drawn after the one before it is resolved. 2: while it is; merging and resolving then shade in units of their own.
    pub buffers: u32,
}

/// The fragment unit; its lanes are the raster's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fragment {
    /// Cycles from reading a fragment to having written it; left out, what the formats ask for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latency: Option<u32>,
    /// Cycles before the same pixel can be taken again; left out, the latency. 1 with forwarding.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hazard: Option<u32>,
    /// Further cycles for each fragment of a slot that makes two merge, besides shading them.
    pub merge: u32,
}

/// The shade unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Shade {
    /// Cycles from a fragment to its light; left out, what the formats ask for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latency: Option<u32>,
    /// Cycles from one fragment to the next.
    pub interval: u32,
}

/// The resolve unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Resolve {
    /// Cycles from the last light of a pixel to its word; left out, what the formats ask for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latency: Option<u32>,
    /// Cycles from one pixel to the next, if its fragments, one a cycle, or shading them take no longer.
    pub interval: u32,
}

/// Memory: one channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Memory {
    /// Every request is answered after the latency of an open row, whatever else is under way: for asking what the datapath alone takes.
    #[serde(default)]
    pub ideal: bool,
    /// Bytes a cycle.
    pub bytes_per_cycle: u32,
    /// Cycles from a request to its first byte where its row is open.
    pub hit_latency: u32,
    /// The same where another row is.
    pub miss_latency: u32,
    /// Bytes of a request, a power of two, at least the 4 of a list's entry.
    pub burst_bytes: u32,
    /// Requests that fetch, and resolve, can have on their way at a time.
    pub outstanding: u32,
    /// Bytes of a row, a power of two.
    pub row_bytes: u32,
    /// Rows that can be open at a time, a power of two; each its own share of addresses.
    pub banks: u32,
}

/// The default microarchitecture: tiles, one slot of 4×1 pixels a cycle, everything pipelined, memory of 6.4 GB/s.
pub const DEFAULT: Timing = Timing {
    clock_hz: 400_000_000,
    organisation: Organisation::Binned,
    fetch: Fetch { fifo: 16 },
    project: Setup { units: 1, latency: None, interval: None, multipliers: None, fifo: 4 },
    ellipse: Setup { units: 1, latency: None, interval: None, multipliers: None, fifo: 16 },
    raster: Raster { lanes: [4, 1], latency: None, fifo: 16 },
    gauss: Stage { latency: None, fifo: 4 },
    cache: Cache { line_px: [4, 4], lines: 256, ways: 4, misses: 8, latency: 2, fifo: 32 },
    tile: Tile { side_px: 16, buffers: 1 },
    fragment: Fragment { latency: None, hazard: None, merge: 1 },
    shade: Shade { latency: None, interval: 1 },
    resolve: Resolve { latency: None, interval: 1 },
    memory: Memory {
        ideal: false,
        bytes_per_cycle: 16,
        hit_latency: 20,
        miss_latency: 50,
        burst_bytes: 64,
        outstanding: 16,
        row_bytes: 2048,
        banks: 8,
    },
};

/// Cycles of a unit, nothing left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Pace {
    /// How many work side by side.
    pub units: u32,
    /// From an item to its result.
    pub latency: u32,
    /// From one item to the next.
    pub interval: u32,
    /// Results that can wait behind it; as many more as are on their way through it.
    pub fifo: u32,
}

impl Pace {
    /// Results that have room between this unit's accepting and the next one's.
    pub fn room(&self) -> usize {
        (self.fifo + self.latency.div_ceil(self.interval)) as usize * self.units as usize
    }
}

/// An elaborated microarchitecture: every derived value beside what it was derived from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Elaborated {
    /// The description.
    #[serde(skip)]
    pub timing: Timing,
    /// Record reader: an item is a splat.
    pub fetch: Pace,
    /// An item is a splat.
    pub project: Pace,
    /// An item is a splat.
    pub ellipse: Pace,
    /// An item is a slot.
    pub raster: Pace,
    /// An item is a slot that kept a pixel.
    pub gauss: Pace,
    /// An item is a slot whose weights are not all 0.
    pub cache: Pace,
    /// Likewise; merging takes more.
    pub fragment: Pace,
    /// Cycles before the same pixel can be taken again.
    pub hazard: u32,
    /// An item is a fragment.
    pub shade: Pace,
    /// An item is a pixel.
    pub resolve: Pace,
    /// The sort by depth, if splats are sorted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sort: Option<SortShape>,
    /// Bytes of a splat in memory.
    pub splat_bytes: u32,
    /// The same where all splats of a frame have the axes that lie in registers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voxel_bytes: Option<u32>,
    /// Bytes of a splat that is set up, in the memory of a binned machine.
    pub prepared_bytes: u32,
    /// Bytes of a fragment in the frame buffer.
    pub fragment_bytes: u32,
    /// Bytes of a frame word.
    pub frame_bytes: u32,
    /// Bytes of a line of the frame buffer.
    pub line_bytes: u32,
    /// What waits and what is kept on the chip.
    pub storage: Storage,
    /// A unit that is infinitely fast, to see what it costs: no machine has one.
    #[serde(skip)]
    pub lifted: Option<&'static str>,
}

/// Words kept on the chip, besides the registers of the units: bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Storage {
    /// All FIFOs, in the order of the diagram.
    pub fifos: [Fifo; 7],
    /// Tiles, or the cache.
    pub memory_bits: u64,
    /// A pixel of the frame buffer: frame words, or all fragments of an immediate machine.
    pub frame_bits_per_pixel: u64,
}

/// A radix sort.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct SortShape {
    /// How often every entry is read and written.
    pub passes: u32,
    /// Bits of the key that a pass looks at.
    pub digit_bits: u32,
    /// Bytes of an entry: which splat, and its key.
    pub entry_bytes: u32,
}

/// Cycles of operators, all pipelined: a product, a sum, a table's word, a normalisation (count zeros, shift).
const PRODUCT: u32 = 2;
const SUM: u32 = 1;
const TABLE: u32 = 1;
const NORMALISE: u32 = 2;
/// Bytes of an entry of a tile's list: which splat.
pub(crate) const ENTRY_BYTES: u32 = 4;
/// The most that a field of memory may say.
const MOST: u32 = 1 << 20;

/// Normalise, look up, and two products and a sum for each Newton step.
fn reciprocal(unit: FunctionUnit) -> u32 {
    NORMALISE + TABLE + unit.newton_steps * (2 * PRODUCT + SUM)
}

/// The same with the square of the guess before.
fn root(unit: FunctionUnit) -> u32 {
    NORMALISE + TABLE + unit.newton_steps * (3 * PRODUCT + SUM)
}

fn bytes(bits: i32) -> u32 {
    (bits.max(0) as u32).div_ceil(8)
}

/// Bits of so many words.
fn bits(words: &[(i32, Word)]) -> i32 {
    words.iter().map(|(count, word)| count * word.format.width()).sum()
}

impl Machine {
    /// Elaborates the microarchitecture; misfits are added to those of the formats.
    pub fn elaborate_timing(&self, e: &mut Elaboration) -> Elaborated {
        let t = &self.timing;
        t.check(e);
        let setup = |setup: Setup, latency: u32, products: u32| Pace {
            units: setup.units.max(1),
            latency: setup.latency.unwrap_or(latency).max(1),
            interval: setup
                .interval
                .unwrap_or_else(|| setup.multipliers.map_or(1, |multipliers| products.div_ceil(multipliers.max(1))))
                .max(1),
            fifo: setup.fifo,
        };
        let stage = |latency: Option<u32>, derived: u32, fifo: u32| Pace {
            units: 1,
            latency: latency.unwrap_or(derived).max(1),
            interval: 1,
            fifo,
        };
        let products = |unit: &str| e.parts.iter().filter(|part| part.unit == unit).map(Part::products).sum();
        let [project_products, ellipse_products] = ["project", "ellipse"].map(products);
        let (p, l, s) = (&self.project, &self.ellipse, &self.shade);
        // Difference, normalise, rotate, 1/t_z, quotient, pixel.
        let project = SUM + NORMALISE + (PRODUCT + 2 * SUM) + reciprocal(p.reciprocal) + 2 * PRODUCT;
        // Normal, facing; radius to variance; determinant, root, inverse, conic, amplitude. Extents and slopes beside that.
        let ellipse =
            (PRODUCT + 2 * SUM) * 2 + (PRODUCT + SUM) * 2 + PRODUCT + SUM + (PRODUCT + SUM) + NORMALISE + root(l.root) + 3 * PRODUCT;
        // Offset, gradient, seed, compare.
        let raster = SUM + (PRODUCT + SUM) * 2 + SUM;
        let gauss = TABLE + if self.gauss.table.interpolation == Interpolation::Linear { PRODUCT + SUM } else { 0 } + PRODUCT;
        // Read, compare depths, product, sum, write.
        let fragment = 1 + 1 + PRODUCT + SUM + 1;
        let line = if s.highlight_table.interpolation == Interpolation::Linear { PRODUCT + SUM } else { 0 };
        let shade = reciprocal(s.reciprocal).max(NORMALISE + PRODUCT + 2 * SUM + root(s.root) + PRODUCT)
            + (PRODUCT + 2 * SUM)
            + (TABLE + line)
            + (PRODUCT + SUM)
            + 2 * (PRODUCT + SUM)
            + PRODUCT;
        let fragment = stage(t.fragment.latency, fragment, 1);
        let f = &self.fragment;
        let prepared = bits(&[
            (2, p.pixel),
            (2, l.conic),
            (1, l.conic_cross),
            (1, p.depth),
            (2, l.depth_slope),
            (1, l.depth_range),
            (1, l.amplitude),
            (3, self.splat.rgb),
            (1, self.splat.opacity),
            (3, f.normal),
        ]) + 4 * 16
            + 8;
        // An ellipsoid's axes, which only a grid's splats have in common.
        let axes = l.ellipsoid.map_or(0, |ellipsoid| bits(&[(4, ellipsoid.quaternion), (3, ellipsoid.scale)]));
        let splat =
            bits(&[(3, self.splat.position), (3, self.splat.normal), (1, self.splat.radius), (3, self.splat.rgb), (1, self.splat.opacity)])
                + 8;
        e.require(self.sort.is_none() || t.organisation == Organisation::Binned, || {
            "timing.organisation is immediate, but a sort needs all splats first: binned would do".into()
        });
        let sort = self.sort.map(|sort| {
            let digit_bits = sort.digit_bits.clamp(1, 16);
            let key = sort.key.format.width();
            SortShape { passes: (key.max(1) as u32).div_ceil(digit_bits), digit_bits, entry_bytes: 4 + bytes(key) }
        });
        let fragment_bytes = bytes(self.fragment_bits());
        let frame_bytes = bytes(4 * self.resolve.frame.format.width());
        let pixels = t.cache.line_px[0].saturating_mul(t.cache.line_px[1]);
        let line_bytes = pixels.saturating_mul(f.layers).saturating_mul(fragment_bytes);
        e.require(line_bytes <= MOST, || {
            format!(
                "timing.cache.line_px {}×{} makes lines of {line_bytes} bytes: at most {MOST} can be had",
                t.cache.line_px[0], t.cache.line_px[1]
            )
        });
        Elaborated {
            timing: *t,
            fetch: stage(Some(1), 1, t.fetch.fifo),
            project: setup(t.project, project, project_products),
            ellipse: setup(t.ellipse, ellipse, ellipse_products),
            raster: stage(t.raster.latency, raster, t.raster.fifo),
            gauss: stage(t.gauss.latency, gauss, t.gauss.fifo),
            cache: stage(Some(t.cache.latency), 1, t.cache.fifo),
            fragment,
            hazard: t.fragment.hazard.unwrap_or(fragment.latency).max(1),
            shade: Pace { interval: t.shade.interval.max(1), ..stage(t.shade.latency, shade, 1) },
            resolve: Pace { interval: t.resolve.interval.max(1), ..stage(t.resolve.latency, f.layers * (PRODUCT + SUM), 1) },
            sort,
            splat_bytes: bytes(splat + axes),
            voxel_bytes: l.ellipsoid.map(|_| bytes(splat)),
            prepared_bytes: bytes(prepared),
            fragment_bytes,
            frame_bytes,
            line_bytes,
            storage: self.storage([splat, prepared], [fragment_bytes, frame_bytes]),
            lifted: None,
        }
    }
}

/// A FIFO.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Fifo {
    /// The unit that takes from it.
    pub to: &'static str,
    /// Results that it holds; none where the organisation has no such FIFO.
    pub places: u32,
    /// Bits of each.
    pub bits: u32,
}

impl Machine {
    /// What lies in FIFOs: splat records, points with the rest of their record, splats that are set up, slots. A slot's lanes carry a
    /// radial index or a weight, and a depth; its splat's attributes go with it.
    fn storage(&self, [splat, prepared]: [i32; 2], [fragment_bytes, frame_bytes]: [u32; 2]) -> Storage {
        let (t, p, f) = (&self.timing, &self.project, &self.fragment);
        let exponent = 8;
        let reciprocal = p.reciprocal.format().width();
        let point = bits(&[(3, p.camera), (1, p.depth), (2, p.slope), (2, p.pixel)]) + reciprocal + 2 * exponent;
        let rest = splat - bits(&[(3, self.splat.position)]);
        let attributes = bits(&[(3, self.splat.rgb), (1, self.splat.opacity), (3, f.normal)]) + 8;
        // What is out of range is a misfit already: here it must do no harm.
        let lanes = t.raster.lanes[0].saturating_mul(t.raster.lanes[1]).min(64) as i32;
        let slot = |word: Word| lanes * bits(&[(1, word), (1, f.depth)]) + attributes;
        let fragments = u64::from(f.layers) * u64::from(fragment_bytes) * 8;
        let fifo = |to, places: u32, units: u32, bits: i32| Fifo { to, places: places.saturating_mul(units), bits: bits.max(0) as u32 };
        let immediate = t.organisation == Organisation::Immediate;
        let (set_up, weighed) = if immediate { ("raster", "cache") } else { ("bin", "fragment") };
        let fifos = [
            fifo("project", t.fetch.fifo, 1, splat),
            fifo("ellipse", t.project.fifo, t.project.units, point + rest),
            fifo(set_up, t.ellipse.fifo, t.ellipse.units, prepared),
            fifo("raster", if immediate { 0 } else { t.fetch.fifo }, 1, prepared),
            fifo("gauss", t.raster.fifo, 1, slot(self.gauss.radial_index) + bits(&[(1, self.ellipse.amplitude)])),
            fifo(weighed, t.gauss.fifo, 1, slot(self.gauss.weight)),
            fifo("fragment", if immediate { t.cache.fifo } else { 0 }, 1, slot(self.gauss.weight)),
        ];
        let kept = if immediate {
            [t.cache.line_px[0], t.cache.line_px[1], t.cache.lines]
        } else {
            [t.tile.side_px, t.tile.side_px, t.tile.buffers]
        };
        let kept_px = kept.map(u64::from).into_iter().fold(1, u64::saturating_mul);
        Storage {
            fifos,
            memory_bits: kept_px.saturating_mul(fragments),
            frame_bits_per_pixel: if immediate { fragments } else { u64::from(frame_bytes) * 8 },
        }
    }
}

impl Timing {
    /// What no machine can be.
    fn check(&self, e: &mut Elaboration) {
        let (latency, fifo) = (1..=4096, 1..=65_536);
        let fields = [
            ("project.units", self.project.units, 1..=16),
            ("ellipse.units", self.ellipse.units, 1..=16),
            ("project.fifo", self.project.fifo, fifo.clone()),
            ("ellipse.fifo", self.ellipse.fifo, fifo.clone()),
            ("fetch.fifo", self.fetch.fifo, fifo.clone()),
            ("raster.fifo", self.raster.fifo, fifo.clone()),
            ("gauss.fifo", self.gauss.fifo, fifo.clone()),
            ("cache.fifo", self.cache.fifo, fifo),
            ("raster.lanes[0]", self.raster.lanes[0], 1..=64),
            ("raster.lanes[1]", self.raster.lanes[1], 1..=64),
            ("cache.misses", self.cache.misses, 1..=MOST),
            ("cache.latency", self.cache.latency, latency.clone()),
            ("shade.interval", self.shade.interval, latency.clone()),
            ("resolve.interval", self.resolve.interval, latency.clone()),
            ("fragment.merge", self.fragment.merge, 0..=4096),
            ("memory.bytes_per_cycle", self.memory.bytes_per_cycle, 1..=MOST),
            ("memory.hit_latency", self.memory.hit_latency, 1..=MOST),
            ("memory.outstanding", self.memory.outstanding, 1..=MOST),
        ];
        let left_out = [
            ("project.latency", self.project.latency),
            ("project.interval", self.project.interval),
            ("project.multipliers", self.project.multipliers),
            ("ellipse.latency", self.ellipse.latency),
            ("ellipse.interval", self.ellipse.interval),
            ("ellipse.multipliers", self.ellipse.multipliers),
            ("raster.latency", self.raster.latency),
            ("gauss.latency", self.gauss.latency),
            ("fragment.latency", self.fragment.latency),
            ("fragment.hazard", self.fragment.hazard),
            ("shade.latency", self.shade.latency),
            ("resolve.latency", self.resolve.latency),
        ];
        let given = left_out.into_iter().filter_map(|(name, value)| value.map(|value| (name, value, latency.clone())));
        for (name, value, range) in fields.into_iter().chain(given) {
            e.require(range.contains(&value), || format!("timing.{name} is {value}: it can be {} to {}", range.start(), range.end()));
        }
        e.require((1..=1_000_000_000_000).contains(&self.clock_hz), || {
            format!("timing.clock_hz is {}: it can be 1 to 1000000000000", self.clock_hz)
        });
        let [columns, rows] = self.raster.lanes;
        e.require(columns.saturating_mul(rows) <= 64, || format!("timing.raster.lanes {columns}×{rows} are more than 64"));
        for (name, value) in [
            ("cache.line_px[0]", self.cache.line_px[0]),
            ("cache.line_px[1]", self.cache.line_px[1]),
            ("cache.lines", self.cache.lines),
            ("cache.ways", self.cache.ways),
            ("memory.burst_bytes", self.memory.burst_bytes),
            ("memory.row_bytes", self.memory.row_bytes),
            ("memory.banks", self.memory.banks),
        ] {
            e.require(value.is_power_of_two() && value <= MOST, || {
                format!("timing.{name} is {value}: it must be a power of two up to {MOST}")
            });
        }
        let Cache { lines, ways, .. } = self.cache;
        e.require(ways <= lines, || format!("timing.cache has {lines} lines in sets of {ways}: no set is full"));
        let Memory { burst_bytes, row_bytes, hit_latency, miss_latency, .. } = self.memory;
        e.require(burst_bytes <= row_bytes, || format!("timing.memory reads {burst_bytes} bytes at a time from rows of {row_bytes}"));
        e.require(burst_bytes >= ENTRY_BYTES, || {
            format!("timing.memory.burst_bytes is {burst_bytes}: an entry of a tile's list has {ENTRY_BYTES}")
        });
        e.require((hit_latency..=MOST).contains(&miss_latency), || {
            format!("timing.memory.miss_latency is {miss_latency}: it can be {hit_latency}, the latency of an open row, to {MOST}")
        });
        let Tile { side_px, buffers } = self.tile;
        e.require(side_px % 16 == 0 && (16..=1024).contains(&side_px), || {
            format!("timing.tile.side_px is {side_px}: it must be a multiple of 16 up to 1024")
        });
        e.require((1..=2).contains(&buffers), || format!("timing.tile.buffers is {buffers}: it can be 1 or 2"));
    }
}

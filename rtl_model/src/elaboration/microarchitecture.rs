//! Microarchitecture: derives the values that a description of timing leaves out.
//!
//! ```text
//! description ─►( elaborate: missing values follow from the formats )─► latencies, intervals, record sizes
//!                                          └► every elaboration error, one sentence each
//! ```

use super::latency::Path;
use super::masks::Masks;
use super::sorter::SorterShape;
use super::{Elaboration, Operator, Part, unit};
use crate::machine::timing::{
    Cache, Environment, Fetch, Memory, Organisation, Queue, Setup, Technology, Tile, Timing,
};
use crate::machine::{BinTest, Group, Machine, MaskMaker, Merge, Rows};
use crate::num::Word;
use schemars::JsonSchema;
use serde::Serialize;

/// Cycles of a unit, every value given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Pace {
    /// Parallel units.
    pub units: u32,
    /// Cycles from an item to its result.
    pub latency: u32,
    /// Initiation interval, cycles.
    pub interval: u32,
    /// Places of the FIFO behind it; the results in its pipeline come in addition.
    pub fifo: u32,
}

impl Pace {
    /// Results that fit between the input of this unit and that of the next one.
    pub fn room(&self) -> usize {
        (self.fifo + self.latency.div_ceil(self.interval)) as usize * self.units as usize
    }
}

impl Microarchitecture {
    /// Whether the fill has one unit of each kind, which stalls while it merges.
    pub fn is_single(&self) -> bool {
        [
            self.engines,
            self.merges_in_flight,
            self.fragment.units,
            self.shade.units,
            self.resolve.units,
        ] == [1; 5]
    }

    /// Parallel sorters of lists; 0 if there are none.
    pub fn sorters(&self) -> u32 {
        self.sort
            .and_then(|sort| sort.sorter)
            .map_or(0, |sorter| sorter.units)
    }

    /// Whether lists are kept from frame to frame.
    pub fn keeps_lists(&self) -> bool {
        self.sort
            .and_then(|sort| sort.sorter)
            .is_some_and(|sorter| sorter.keeps_lists)
    }

    /// Whether sorters work while tiles are drawn.
    pub fn overlaps_sort(&self) -> bool {
        self.sort
            .and_then(|sort| sort.sorter)
            .is_some_and(|sorter| sorter.overlap)
    }

    /// Whether the same work takes the same cycles: only critical paths and on-chip storage may
    /// differ.
    pub fn same_cycles_as(&self, other: &Self) -> bool {
        let (paths, pipelines, storage) = (other.paths, other.pipelines, other.storage);
        Microarchitecture {
            paths,
            pipelines,
            storage,
            ..self.clone()
        } == *other
    }

    /// Whether a binned machine that visits tiles in the same order as another one writes the same
    /// lists in the same cycles: they may differ only in the units behind the lists. Shade is one
    /// of these unless splats are lit in setup.
    pub fn same_lists_as(&self, other: &Self, preshaded: bool) -> bool {
        let behind = [
            unit::LIST,
            unit::CONTRIBUTION,
            unit::RASTER,
            unit::GAUSS,
            unit::FRAGMENT,
            unit::RESOLVE,
        ];
        let is_behind = |name: &&str| behind.contains(name) || *name == unit::SHADE && !preshaded;
        let lifted = |of: &Self| of.lifted.filter(|name| !is_behind(name));
        let before = |of: &Self| {
            let Microarchitecture {
                contribution,
                raster,
                gauss,
                cache,
                fragment,
                hazard,
                resolve,
                timing,
                paths,
                pipelines,
                storage,
                ..
            } = *self;
            let Microarchitecture {
                fragment_bytes,
                frame_bytes,
                line_bytes,
                ..
            } = *self;
            let shade = if preshaded { of.shade } else { self.shade };
            let rest = Microarchitecture {
                fragment_bytes,
                frame_bytes,
                line_bytes,
                shade,
                lifted: None,
                ..of.clone()
            };
            Microarchitecture {
                contribution,
                raster,
                gauss,
                cache,
                fragment,
                hazard,
                resolve,
                timing,
                paths,
                pipelines,
                storage,
                ..rest
            }
        };
        self.timing.memory == other.timing.memory
            && lifted(self) == lifted(other)
            && before(self) == before(other)
    }

    /// Masks of the entries of lists, if they have any.
    pub fn masks(&self) -> Option<Masks> {
        let of_bin = self.bin.and_then(|bin| bin.masks);
        of_bin.or(self.contribution.and_then(|blocks| blocks.masks))
    }

    /// Masks that `list` makes, or that the contribution test makes for it, and their latency.
    pub fn masks_of_list(&self) -> Option<(Masks, u32)> {
        if let Some(blocks) = self.contribution {
            return Some((blocks.masks?, blocks.latency));
        }
        let masks = self.masks().filter(|masks| masks.made == MaskMaker::List)?;
        Some((masks, self.bin.and_then(|bin| bin.mask_latency)?))
    }

    /// Bytes of an entry of a tile's list: index of the splat, and its mask.
    pub fn entry_bytes(&self) -> u32 {
        entry_bytes(self.masks().map_or(0, |masks| masks.listed_bits()))
    }

    /// Lanes of a stamp that belong to one fragment unit.
    pub fn lanes_of_fragment(&self) -> u32 {
        lanes_of_fragment(&self.timing)
    }

    /// Colour timing of splats with harmonics of this degree; none if colours are stored as such.
    pub fn colour_of(&self, degree: u8) -> Option<&ColourPace> {
        usize::from(degree)
            .checked_sub(1)
            .and_then(|place| self.colour.get(place))
    }

    /// Bytes of a splat in memory, by whether all splats share their axes, and the degree of their
    /// harmonics.
    pub fn record_bytes(&self, shares_axes: bool, degree: u8) -> u32 {
        let own = self
            .colour_of(degree)
            .map_or(self.splat_bytes, |colour| colour.splat_bytes);
        self.voxel_bytes.filter(|_| shares_axes).unwrap_or(own)
    }
}

/// An elaborated microarchitecture: the description and the values derived from it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Microarchitecture {
    /// The description.
    #[serde(skip)]
    pub timing: Timing,
    /// Record reader: an item is a splat.
    pub fetch: Pace,
    /// An item is a splat.
    pub project: Pace,
    /// An item is a splat.
    pub ellipse: Pace,
    /// An item is a splat whose colour is harmonics of degree 1, 2 and so on; empty if the machine
    /// does not evaluate harmonics.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub colour: Vec<ColourPace>,
    /// An item is a stamp.
    pub raster: Pace,
    /// An item is a stamp that kept a pixel.
    pub gauss: Pace,
    /// An item is a stamp whose weights are not all 0.
    pub cache: Pace,
    /// An item is a stamp whose weights are not all 0; merging takes longer.
    pub fragment: Pace,
    /// Cycles until the same pixel can be read again.
    pub hazard: u32,
    /// Stamps that merge fragments at the same time, in each fragment unit.
    pub merges_in_flight: u32,
    /// Copies of all units behind the lists.
    pub engines: u32,
    /// An item is a fragment.
    pub shade: Pace,
    /// An item is a pixel.
    pub resolve: Pace,
    /// The test of tiles, if the machine has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bin: Option<BinShape>,
    /// Tiles of a splat's box that `bin` lists per cycle.
    #[serde(skip_serializing_if = "is_one")]
    pub tiles_per_cycle: u32,
    /// The test of blocks of pixels, if the machine has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contribution: Option<ContributionShape>,
    /// The sort by depth, if splats are sorted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sort: Option<SortShape>,
    /// Bytes of a splat in memory.
    pub splat_bytes: u32,
    /// Bytes of a splat in memory if all splats of a frame use the axes in registers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voxel_bytes: Option<u32>,
    /// Bytes of a splat after setup, in the memory of a binned machine.
    pub prepared_bytes: u32,
    /// Bytes of a tree node in memory: its splat, its sphere, its cone, the address of its
    /// children.
    #[serde(skip)]
    pub node_bytes: u32,
    /// Bytes of a fragment in the frame buffer.
    pub fragment_bytes: u32,
    /// Bytes of a frame word.
    pub frame_bytes: u32,
    /// Bytes of a line of the frame buffer.
    pub line_bytes: u32,
    /// The map of surroundings, if the machine reflects them.
    #[serde(skip)]
    pub map: Option<MapShape>,
    /// Setup has a shade unit for lighting splats, because fragments use the others at the same
    /// time: if they are grouped by windows.
    #[serde(skip)]
    pub lights_setup: bool,
    /// Total number of shade units: those for fragments; if windows are formed, as many for setup;
    /// if tiles have two buffers, as many for resolving. All but those of setup exist once per
    /// engine.
    #[serde(skip)]
    pub shade_units: u32,
    /// Critical path of each unit.
    #[serde(skip)]
    pub paths: Paths,
    /// Pipeline registers of each unit.
    #[serde(skip)]
    pub pipelines: [Pipeline; 11],
    /// Buffered words and words kept on the chip.
    pub storage: Storage,
    /// The memory at this clock, with the values of its preset.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory: Option<Memory>,
    /// A unit made infinitely fast, to measure its cost: not a real machine.
    #[serde(skip)]
    pub lifted: Option<&'static str>,
}

/// The map of surroundings in memory: loaded whole before a frame, or line by line through a cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MapShape {
    /// Side of the map: 2^this texels.
    pub index_bits: u32,
    /// Bytes of a texel.
    pub texel_bytes: u32,
    /// Its cache; none if the whole map is loaded onto the chip.
    pub cache: Option<Environment>,
}

impl MapShape {
    /// Bytes of the map.
    pub fn bytes(&self) -> u32 {
        self.texel_bytes << (2 * self.index_bits)
    }

    /// Bytes of a line of its cache.
    pub fn line_bytes(&self) -> u32 {
        self.cache.map_or(0, |cache| {
            cache.line_texels[0]
                .saturating_mul(cache.line_texels[1])
                .saturating_mul(self.texel_bytes)
        })
    }
}

/// Cycles and sizes for harmonics of one degree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ColourPace {
    /// Cycles.
    #[serde(flatten)]
    pub pace: Pace,
    /// Products per splat.
    pub products: u32,
    /// Bytes of a splat in memory, with coefficients instead of a colour.
    pub splat_bytes: u32,
    /// Bits more than those of a splat with a colour.
    #[serde(skip)]
    pub more_bits: u32,
}

/// Pipeline registers of a unit: each stage has half of the input bits and half of the output bits,
/// on average.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pipeline {
    /// The unit.
    pub unit: &'static str,
    /// Bits of one unit: stages that hold an item each, times bits per stage.
    pub bits: u64,
    /// Bits outside the pipeline of one unit: fragments that are to be merged.
    pub merge_bits: u64,
    /// Number of parallel units.
    pub units: u32,
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "the signature that serde requires"
)]
fn is_one(count: &u32) -> bool {
    *count == 1
}

/// A machine without a test of tiles.
const NO_TEST: Pipeline = Pipeline {
    unit: unit::BIN,
    bits: 0,
    merge_bits: 0,
    units: 0,
};

impl Pipeline {
    fn new(unit: &'static str, pace: &Pace, units: u32, [comes_in, goes_out]: [i64; 2]) -> Self {
        let stages = u64::from(pace.latency.div_ceil(pace.interval));
        Pipeline {
            unit,
            bits: (stages * (comes_in.max(0) + goes_out.max(0)) as u64).div_ceil(2),
            merge_bits: 0,
            units,
        }
    }
}

/// Words kept on the chip, except the registers of the units: bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Storage {
    /// All FIFOs, in the order of the diagram.
    pub fifos: [Fifo; 8],
    /// Tiles, or the cache with its tags and the lines in flight; counts of the sort's digits, or
    /// its buffers; outstanding requests to memory.
    pub memory_bits: u64,
    /// A pixel of the frame buffer: its frame word, or all fragments of an immediate machine.
    pub frame_bits_per_pixel: u64,
}

/// Width of the sort's counts: they index as many entries as 4 bytes can.
pub const SORT_COUNT_BITS: u64 = 32;

/// A test of tiles. It tests one group of tiles per cycle, or the subtiles of a tile if masks are
/// made in `bin`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct BinShape {
    /// Kind of the test.
    pub test: BinTest,
    /// Cycles from a splat to its first entry; 0 if only `list` tests, for its masks.
    pub latency: u32,
    /// Words of its arithmetic.
    #[serde(skip)]
    pub words: BinWords,
    /// Bits of a splat before the test, and of what the tests of its tiles use.
    #[serde(skip)]
    pub bits: [i32; 2],
    /// Masks of the entries of lists, if they have any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub masks: Option<Masks>,
    /// Cycles from the record of a splat to its mask.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mask_latency: Option<u32>,
}

/// A test of blocks of pixels, in front of the rasteriser of each engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ContributionShape {
    /// Masks of the entries of lists.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub masks: Option<Masks>,
    /// Cycles from the record of a splat to its mask.
    pub latency: u32,
    /// Bits of a splat before the test.
    #[serde(skip)]
    pub bits: i32,
}

impl BinShape {
    /// Critical path: from a splat to its first entry.
    pub fn path(&self) -> Path {
        match self.masks.filter(|masks| masks.made == MaskMaker::Bin) {
            Some(masks) => masks.path(self.words),
            None => self.words.path(),
        }
    }
}

/// A test of tiles, and the words that it uses. The unit `bin` builds its arithmetic from them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BinWords {
    /// Kind of the test.
    pub test: BinTest,
    /// `raster.rows`.
    pub rows: Rows,
    /// `project.pixel`.
    pub pixel: Word,
    /// `ellipse.conic`.
    pub conic: Word,
    /// `ellipse.conic_cross`.
    pub conic_cross: Word,
    /// `raster.cutoff`.
    pub cutoff: Word,
    /// `raster.offset`.
    pub offset: Word,
    /// `raster.gradient`.
    pub gradient: Word,
    /// `raster.radial`.
    pub radial: Word,
    /// `raster.first`.
    pub first: Word,
    /// `raster.second`.
    pub second: Word,
}

/// A sort.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct SortShape {
    /// Passes of a radix sort: times that every entry is read and written; 0 for other kinds.
    pub passes: u32,
    /// Bits of the key per pass; 0 for other kinds.
    pub digit_bits: u32,
    /// Bytes of an entry: index of the splat, and its key.
    pub entry_bytes: u32,
    /// The sorters of single lists; none for a radix sort.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sorter: Option<SorterShape>,
}

/// Critical path of each unit, from an item to its result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Paths {
    /// From a splat.
    pub project: Path,
    /// From a splat.
    pub ellipse: Path,
    /// From the record of a splat to the mask of its blocks, if they are tested.
    pub contribution: Path,
    /// From a splat to its colour, and products of it, by degree of harmonics from 1 on.
    pub colour: [Harmonics; 3],
    /// From a stamp.
    pub raster: Path,
    /// From a stamp.
    pub gauss: Path,
    /// From a stamp.
    pub fragment: Path,
    /// From two shaded fragments to their merged one.
    pub over: Path,
    /// From a fragment.
    pub shade: Path,
    /// From a pixel.
    pub resolve: Path,
    /// Feedback loops, which take one cycle by their nature or as in the RTL implementation: name,
    /// unit, path.
    pub one_cycle: [(&'static str, &'static str, Path); 3],
}

/// Cost of colours with harmonics of one degree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Harmonics {
    /// From a splat to its colour.
    pub path: Path,
    /// Products per splat.
    pub products: u32,
    /// Bits of its coefficients.
    pub bits: i32,
}

/// A FIFO.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Fifo {
    /// The unit that reads it.
    pub to: &'static str,
    /// Results that it holds; 0 if the organisation has no such FIFO.
    pub places: u32,
    /// Bits of each.
    pub bits: u32,
}

/// Values of a digit of a list's length, which has two digits, if the queue takes the longest list
/// first; and bits of their counts.
pub const LENGTH_VALUES: u64 = 1 << 8;
const LENGTH_COUNT_BITS: u64 = 32;

/// Number of units; 1 for missing values and for values that are refused elsewhere.
fn units(given: Option<u32>) -> u32 {
    given.unwrap_or(1).clamp(1, 64)
}

fn lanes_of_fragment(timing: &Timing) -> u32 {
    let [columns, rows] = timing.raster.lanes;
    columns
        .saturating_mul(rows)
        .min(64)
        .div_ceil(units(timing.fragment.units))
}

/// Bytes of an entry of a tile's list without a mask: index of the splat.
pub const ENTRY_BYTES: u32 = 4;

/// Bytes of an entry with a mask of these bits.
fn entry_bytes(mask_bits: u32) -> u32 {
    ENTRY_BYTES + bytes(mask_bits as i32)
}
/// Bits of a tree node besides its splat, sphere and widest σ: cone, first child, number of
/// children.
const NODE_BITS: i32 = 8 + 32 + 8;
/// Bits of the digit by which a pass sorts a walker's list.
pub const WALK_DIGIT_BITS: u32 = 8;
/// Bits of an entry of a walker's stack.
const STACK_BITS: u64 = 32 + 8;
/// Bits of the address of a pixel in flight.
const PIXEL_BITS: i32 = 28;
/// Bits of an address of memory.
const ADDRESS_BITS: i32 = 48;
/// Bits of a cache line's tag: address, dirty flag, time of last use.
const TAG_BITS: u64 = 32;
/// Greatest value of a field of memory.
const MOST: u32 = 1 << 20;
/// Greatest number of channels, and of ranks per channel.
const MOST_CHANNELS: u32 = 64;
const MOST_RANKS: u32 = 8;

fn bytes(bits: i32) -> u32 {
    (bits.max(0) as u32).div_ceil(8)
}

/// Bits of `words`, each with the number of its copies.
fn bits(words: &[(i32, Word)]) -> i32 {
    words
        .iter()
        .map(|(count, word)| count * word.format.stored_bits())
        .sum()
}

impl Machine {
    /// Elaborates the microarchitecture from the critical path of each unit. Adds its elaboration
    /// errors to those of the formats.
    pub fn elaborate_timing(
        &self,
        e: &mut Elaboration,
        paths: &Paths,
        bin: Option<BinShape>,
        blocks: Option<ContributionShape>,
    ) -> Microarchitecture {
        let memory = self.timing.memory.resolved(self.timing.clock_hz);
        let t = &Timing {
            memory,
            ..self.timing
        };
        check(t, e);
        e.require(
            self.contribution.is_none() || t.raster.row_cycles.unwrap_or(0) == 0,
            || {
                "timing.raster.row_cycles sets up rows of boxes, but contribution cuts boxes into runs: leave one of them out".into()
            },
        );
        let given = t.contribution.and_then(|of| of.latency);
        let contribution = blocks.map(|of| ContributionShape {
            latency: given.unwrap_or(of.latency),
            ..of
        });
        let has_masks = self.bin.is_some_and(|bin| bin.subtile_px.is_some());
        e.require(!has_masks || t.raster.row_cycles.unwrap_or(0) == 0, || {
            "timing.raster.row_cycles sets up rows of boxes, but bin.subtile_px cuts boxes into runs: leave one of them out".into()
        });
        check_memory(&self.timing.memory, &memory, e);
        // Fragments never merge if a pixel has one fragment or one open sheet.
        let merges = t.technology != Technology::Ideal
            && self.fragment.sheets.is_none()
            && self.fragment.merge != Merge::Replace;
        check_paths(
            t,
            paths,
            self.colour.as_ref().map_or(0, |colour| colour.degree),
            merges,
            e,
        );
        let setup = |setup: Setup, path: Path, products: u32| {
            let least = setup
                .multipliers
                .map_or(1, |multipliers| products.div_ceil(multipliers.max(1)));
            let interval = setup.interval.unwrap_or(least).max(1);
            // If products share multipliers, the latency is at least the initiation interval.
            let latency = setup
                .latency
                .unwrap_or_else(|| path.cycles_at(t).max(least))
                .max(1);
            Pace {
                units: setup.units.max(1),
                latency,
                interval,
                fifo: setup.fifo,
            }
        };
        let stage = |latency: Option<u32>, derived: u32, fifo: u32| Pace {
            units: 1,
            latency: latency.unwrap_or(derived).max(1),
            interval: 1,
            fifo,
        };
        let products = |unit: &str| {
            e.parts
                .iter()
                .filter(|part| part.unit == unit)
                .map(Part::products)
                .sum()
        };
        let [project_products, ellipse_products] = [unit::PROJECT, unit::ELLIPSE].map(products);
        for (name, of, products) in [
            ("project", t.project, project_products),
            ("ellipse", t.ellipse, ellipse_products),
        ] {
            check_turns(name, [of.interval, of.latency], of.multipliers, products, e);
        }
        let (p, l) = (&self.project, &self.ellipse);
        let several = |given: Option<u32>, pace: Pace| Pace {
            units: units(given),
            ..pace
        };
        let fragment = several(
            t.fragment.units,
            stage(t.fragment.latency, paths.fragment.cycles_at(t), 1),
        );
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
        ]) + f.window.map_or(0, |window| {
            bits(&[(3, self.splat.rgb), (1, window.density)])
        }) + 4 * 16
            + 8;
        // An ellipsoid's own axes. Only the splats of a grid share theirs.
        let axes = l.ellipsoid.map_or(0, |ellipsoid| {
            bits(&[(4, ellipsoid.quaternion), (3, ellipsoid.scale)])
        });
        let splat = bits(&[
            (3, self.splat.position),
            (3, self.splat.normal),
            (1, self.splat.radius),
            (3, self.splat.rgb),
            (1, self.splat.opacity),
        ]) + 8;
        let colour: Vec<ColourPace> = (self.colour.iter())
            .flat_map(|colour| &paths.colour[..colour.degree.min(3) as usize])
            .map(|harmonics| {
                let of = t.colour.unwrap_or_default();
                let more = (harmonics.bits - bits(&[(3, self.splat.rgb)])).max(0);
                check_turns(
                    "colour",
                    [of.interval, of.latency],
                    Some(of.multipliers),
                    harmonics.products,
                    e,
                );
                let least = harmonics.products.div_ceil(of.multipliers.max(1));
                let interval = of.interval.unwrap_or(least);
                ColourPace {
                    pace: Pace {
                        units: of.units.max(1),
                        latency: of
                            .latency
                            .unwrap_or_else(|| harmonics.path.cycles_at(t).max(least))
                            .max(1),
                        interval: interval.max(1),
                        fifo: of.fifo,
                    },
                    products: harmonics.products,
                    splat_bytes: bytes(splat + axes + more),
                    more_bits: more as u32,
                }
            })
            .collect();
        e.require(
            self.sorting().is_none() || t.organisation == Organisation::Binned,
            || {
                "timing.organisation is immediate, but a sort needs all splats first: use binned"
                    .into()
            },
        );
        let sorter = self.sorter_shape(e);
        let mask_bits = self.listed_mask_bits();
        let sort = self.sorting().map(|sort| {
            let [passes, digit_bits] = if sorter.is_some() {
                [0; 2]
            } else {
                [sort.passes(), sort.digit_bits.clamp(1, 16)]
            };
            SortShape {
                passes,
                digit_bits,
                entry_bytes: entry_bytes(mask_bits) + bytes(sort.key_bits() as i32),
                sorter,
            }
        });
        if let Some(sorter) = sorter {
            sorter.declare(e);
        }
        if let Some(shape) = sort.filter(|_| sorter.is_some()) {
            let burst_bytes = memory.burst_bytes;
            e.require(burst_bytes >= shape.entry_bytes || burst_bytes < ENTRY_BYTES, || {
                format!("timing.memory.burst_bytes is {burst_bytes}: an entry of a list that is to be sorted has {}", shape.entry_bytes)
            });
        }
        e.require(memory.burst_bytes >= entry_bytes(mask_bits) || memory.burst_bytes < ENTRY_BYTES, || {
            format!(
                "timing.memory.burst_bytes is {}: an entry of a tile's list with its mask has {}",
                memory.burst_bytes,
                entry_bytes(mask_bits)
            )
        });
        let fragment_bytes = bytes(self.fragment_bits());
        let frame_bytes = bytes(4 * self.resolve.frame.format.stored_bits());
        let pixels = t.cache.line_px[0].saturating_mul(t.cache.line_px[1]);
        let line_bytes = pixels
            .saturating_mul(f.layers)
            .saturating_mul(fragment_bytes);
        e.require(line_bytes <= MOST, || {
            format!(
                "timing.cache.line_px {}×{} makes lines of {line_bytes} bytes: at most {MOST} are possible",
                t.cache.line_px[0], t.cache.line_px[1]
            )
        });
        let map = self.map_shape(e);
        let project = setup(t.project, paths.project, project_products);
        let ellipse = setup(t.ellipse, paths.ellipse, ellipse_products);
        let raster = stage(t.raster.latency, paths.raster.cycles_at(t), t.raster.fifo);
        let gauss = stage(t.gauss.latency, paths.gauss.cycles_at(t), t.gauss.fifo);
        let shade = Pace {
            interval: t.shade.interval.max(1),
            ..stage(t.shade.latency, paths.shade.cycles_at(t), 1)
        };
        let resolve = Pace {
            interval: t.resolve.interval.max(1),
            ..stage(t.resolve.latency, paths.resolve.cycles_at(t), 1)
        };
        let (shade, resolve) = (
            several(t.shade.units, shade),
            several(t.resolve.units, resolve),
        );
        let (engines, merges_in_flight) = (units(t.engines), units(t.fragment.merges_in_flight));
        let hazard = t.fragment.hazard.unwrap_or(fragment.latency).max(1);
        // Forwarding: compare with the incoming pixels, and select instead of the read word, at
        // every stage that forwarding skips.
        let slots = f.layers.min(64) as i32 * self.fragment_bits();
        e.per_lane(|e| {
            e.copies(fragment.latency.saturating_sub(hazard), |e| {
                e.adders(unit::FRAGMENT, 1, PIXEL_BITS);
                e.choice(unit::FRAGMENT, 2, slots);
            });
        });
        if t.walk.is_some() {
            self.walker(e);
        }
        self.side_by_side(
            e,
            [&fragment, &shade, &resolve],
            [engines, merges_in_flight],
        );
        let widths = self.widths(splat, prepared, colour.last());
        let [light, frame] = [self.shade.premultiplied, self.resolve.frame]
            .map(|word| 4 * i64::from(word.format.stored_bits()));
        self.fetch_parts(e, widths.splat);
        let fragment_bits = i64::from(self.fragment_bits());
        // One slot of a pixel changes.
        let lanes = i64::from(lanes_of_fragment(t));
        let held =
            widths.weighed - (widths.lanes - lanes) * widths.weighed_lane + lanes * fragment_bits;
        let in_flight = i64::from(merges_in_flight - 1) * lanes * i64::from(self.in_flight_bits());
        let shade_units = self.shade_units();
        let coloured = colour.last().map_or(
            Pace {
                units: 0,
                latency: 1,
                interval: 1,
                fifo: 0,
            },
            |of| of.pace,
        );
        let in_list = bin
            .filter(|bin| bin.masks.is_some_and(|masks| masks.made == MaskMaker::List))
            .and_then(|bin| Some((bin.mask_latency?, bin.bits)));
        let [setup_in, setup_out] = [widths.point, widths.prepared + widths.more];
        let pipelines = [
            Pipeline::new(
                unit::PROJECT,
                &project,
                project.units,
                [widths.splat, setup_in],
            ),
            Pipeline::new(
                unit::ELLIPSE,
                &ellipse,
                ellipse.units,
                [setup_in, setup_out],
            ),
            Pipeline::new(
                unit::COLOUR,
                &coloured,
                coloured.units,
                [setup_out, widths.prepared],
            ),
            bin.filter(|bin| bin.latency > 0).map_or(
                NO_TEST,
                |BinShape { latency, bits, .. }| {
                    let pace = Pace {
                        units: 1,
                        latency,
                        interval: 1,
                        fifo: 0,
                    };
                    Pipeline::new(
                        unit::BIN,
                        &pace,
                        self.tiles_per_cycle(),
                        bits.map(i64::from),
                    )
                },
            ),
            in_list.map_or(NO_TEST, |(latency, bits)| {
                let pace = Pace {
                    units: 1,
                    latency,
                    interval: 1,
                    fifo: 0,
                };
                Pipeline::new(unit::LIST, &pace, engines, bits.map(i64::from))
            }),
            contribution.map_or(NO_TEST, |ContributionShape { latency, bits, .. }| {
                let pace = Pace {
                    units: 1,
                    latency,
                    interval: 1,
                    fifo: 0,
                };
                Pipeline::new(unit::CONTRIBUTION, &pace, engines, [i64::from(bits); 2])
            }),
            Pipeline::new(
                unit::RASTER,
                &raster,
                engines,
                [widths.prepared, widths.rastered],
            ),
            Pipeline::new(
                unit::GAUSS,
                &gauss,
                engines,
                [widths.rastered, widths.weighed],
            ),
            Pipeline {
                merge_bits: in_flight.max(0) as u64,
                ..Pipeline::new(
                    unit::FRAGMENT,
                    &fragment,
                    fragment.units * engines,
                    [held, held],
                )
            },
            Pipeline::new(unit::SHADE, &shade, shade_units, [fragment_bits, light]),
            Pipeline::new(
                unit::RESOLVE,
                &resolve,
                resolve.units * engines,
                [light, frame],
            ),
        ];
        Microarchitecture {
            timing: *t,
            memory: t.memory.preset.map(|_| t.memory),
            fetch: self.fetch_pace(),
            project,
            ellipse,
            storage: self.storage(
                &widths,
                [fragment_bytes, frame_bytes],
                colour.last().map(|of| of.pace),
                map,
                sort,
            ),
            map,
            colour,
            raster,
            gauss,
            cache: stage(Some(t.cache.latency), 1, t.cache.fifo),
            fragment,
            hazard,
            merges_in_flight,
            tiles_per_cycle: self.tiles_per_cycle(),
            engines,
            shade,
            resolve,
            shade_units,
            paths: *paths,
            pipelines,
            bin,
            contribution,
            sort,
            lights_setup: f.group != Group::First,
            splat_bytes: bytes(splat + axes),
            voxel_bytes: l.ellipsoid.map(|_| bytes(splat)),
            node_bytes: bytes(splat + bits(&[(2, self.splat.radius)]) + NODE_BITS),
            prepared_bytes: bytes(prepared),
            fragment_bytes,
            frame_bytes,
            line_bytes,
            lifted: None,
        }
    }
}

/// Bits of the words between units.
struct Widths {
    /// A splat's record, with its harmonics.
    splat: i64,
    /// A point with the remaining fields of its record.
    point: i64,
    prepared: i64,
    /// Harmonics beyond one colour.
    more: i64,
    /// A stamp of radial indices, and of weights. Each lane also carries a depth, and the stamp
    /// carries the attributes of its splat.
    rastered: i64,
    weighed: i64,
    /// A lane of a stamp of weights.
    weighed_lane: i64,
    /// Lanes of a stamp.
    lanes: i64,
}

impl Machine {
    /// Number of shade units: see [`Microarchitecture::shade_units`].
    pub fn shade_units(&self) -> u32 {
        let t = &self.timing;
        let lights_setup = u32::from(self.fragment.group != Group::First);
        let of_engine =
            1 + u32::from(t.organisation == Organisation::Binned && t.tile.buffers == 2);
        units(t.shade.units) * (lights_setup + units(t.engines) * of_engine)
    }

    /// Pace of `fetch`: each record of a cycle has a bank of the FIFO.
    fn fetch_pace(&self) -> Pace {
        let Fetch { fifo, splats } = self.timing.fetch;
        let units = splats.unwrap_or(1).clamp(1, 16);
        Pace {
            units,
            latency: 1,
            interval: 1,
            fifo: fifo.div_ceil(units),
        }
    }

    /// Parts for each record after the first that `fetch` reads in a cycle: it is cut out of its
    /// bursts, which begin at any byte, and has a register and the two places of a bank. Each bank
    /// can be written with any of them, and each unit of `project` reads any bank.
    fn fetch_parts(&self, e: &mut Elaboration, record_bits: i64) {
        let Pace { units, fifo, .. } = self.fetch_pace();
        if units == 1 {
            return;
        }
        let bits = record_bits.clamp(1, i64::from(i32::MAX)) as i32;
        let places = fifo.max(2).next_power_of_two().ilog2() as i32;
        let shifts = self.timing.memory.burst_bytes.clamp(2, MOST).ilog2();
        e.copies(units - 1, |e| {
            e.copies(shifts, |e| e.choice(unit::FETCH, 2, bits));
            e.part(unit::FETCH, Operator::Register(bits));
            e.adders(unit::FETCH, 2, places);
            e.copies(2, |e| e.part(unit::FETCH, Operator::Register(places)));
        });
        let readers = self.timing.project.units.clamp(1, 16);
        e.copies(units + readers, |e| e.choice(unit::FETCH, units, bits));
    }

    /// Bits of a lane in a merge in flight: both fragments, and the address of the pixel.
    fn in_flight_bits(&self) -> i32 {
        2 * self.fragment_bits() + PIXEL_BITS
    }

    /// Parts between parallel units of a kind.
    fn side_by_side(
        &self,
        e: &mut Elaboration,
        [fragment, shade, resolve]: [&Pace; 3],
        [engines, in_flight]: [u32; 2],
    ) {
        let fragment_bits = self.fragment_bits();
        let [light, word] = [self.shade.premultiplied, self.resolve.frame]
            .map(|word| 4 * word.format.stored_bits());
        let lane = bits(&[(1, self.gauss.weight), (1, self.fragment.depth)]);
        e.per_lane(|e| {
            // An incoming pixel is compared with each pixel in a merge. Results of merges are
            // written through a second port.
            e.copies(in_flight - 1, |e| {
                e.adders(unit::FRAGMENT, 1, PIXEL_BITS);
                e.choice(unit::FRAGMENT, 2, self.in_flight_bits());
            });
            // Lanes are routed to units by the address of their pixels: one shifter stage per bit
            // of a unit's index.
            e.copies(fragment.units.ilog2(), |e| {
                e.choice(unit::FRAGMENT, 2, lane)
            });
        });
        // Routes fragments to shade units, and colours back.
        e.copies(engines, |e| {
            e.choice(unit::SHADE, shade.units, fragment_bits + light)
        });
        // Each resolve unit reads another pixel of the same tile; all write through one port.
        e.choice(
            unit::RESOLVE,
            resolve.units,
            self.fragment.layers.min(64) as i32 * fragment_bits + word,
        );
        // Engines share one port to memory, whatever the number of channels.
        let memory = self.timing.memory.resolved(self.timing.clock_hz);
        let request = 8 * memory.bytes_per_cycle.min(MOST) as i32 + ADDRESS_BITS;
        e.choice(unit::FETCH, engines, 2 * request);
        e.choice(
            unit::FETCH,
            memory.channels().clamp(1, MOST_CHANNELS),
            request,
        );
    }

    /// The map of surroundings. Impossible ones are refused.
    fn map_shape(&self, e: &mut Elaboration) -> Option<MapShape> {
        let cache = self.timing.environment;
        e.require(cache.is_none() || self.reflect.is_some(), || {
            "timing.environment is the cache of a map, and the machine has no `reflect` that uses one: leave it out".into()
        });
        let reflect = self.reflect.as_ref()?;
        let index_bits = reflect.index_bits.clamp(1, 8);
        if let Some(Environment {
            line_texels,
            lines,
            ways,
        }) = cache
        {
            for (name, value, most) in [
                ("line_texels[0]", line_texels[0], 1 << index_bits),
                ("line_texels[1]", line_texels[1], 1 << index_bits),
                ("lines", lines, 1 << 16),
                ("ways", ways, 64),
            ] {
                e.require(value.is_power_of_two() && value <= most, || {
                    format!("timing.environment.{name} is {value}: it must be a power of two up to {most}")
                });
            }
            e.require(ways > 64 || ways <= lines, || {
                format!("timing.environment has {lines} lines in sets of {ways}: no set is full")
            });
            let t = &self.timing;
            let several = [
                t.engines,
                t.fragment.merges_in_flight,
                t.fragment.units,
                t.shade.units,
                t.resolve.units,
            ];
            e.require(several.into_iter().all(|several| units(several) == 1), || {
                "timing.environment, a map in memory, requires one engine, one unit each of fragment, shade and resolve, and one merge in \
                 flight: leave it out, and each shade unit has the map on the chip"
                    .into()
            });
        }
        Some(MapShape {
            index_bits,
            texel_bytes: bytes(3 * reflect.light.format.stored_bits()),
            cache,
        })
    }

    fn widths(&self, splat: i32, prepared: i32, colour: Option<&ColourPace>) -> Widths {
        let (t, p, f) = (&self.timing, &self.project, &self.fragment);
        let exponent = 8;
        let reciprocal = p.reciprocal.format().width();
        let point = bits(&[(3, p.camera), (1, p.depth), (2, p.slope), (2, p.pixel)])
            + reciprocal
            + 2 * exponent;
        let rest = splat - bits(&[(3, self.splat.position)]);
        let attributes = bits(&[(3, self.splat.rgb), (1, self.splat.opacity), (3, f.normal)]) + 8;
        // Values out of range are elaboration errors already; the limits here keep elaboration
        // safe.
        let lanes = t.raster.lanes[0].saturating_mul(t.raster.lanes[1]).min(64) as i32;
        let lane = |word: Word| bits(&[(1, word), (1, f.depth)]);
        let stamp = |word: Word| lanes * lane(word) + attributes;
        // Coefficients are buffered with their splat until they are evaluated.
        let more = colour.map_or(0, |of| of.more_bits as i32);
        let [
            splat,
            point,
            prepared,
            more,
            rastered,
            weighed,
            weighed_lane,
            lanes,
        ] = [
            splat + more,
            point + rest + more,
            prepared,
            more,
            stamp(self.gauss.radial_index) + bits(&[(1, self.ellipse.amplitude)]),
            stamp(self.gauss.weight),
            lane(self.gauss.weight),
            lanes,
        ]
        .map(i64::from);
        Widths {
            splat,
            point,
            prepared,
            more,
            rastered,
            weighed,
            weighed_lane,
            lanes,
        }
    }

    /// Parts of the test of a tree node, as wide as the words of the splat and of `project`. It has
    /// no divider: both sides of a comparison are multiplied by the depth.
    fn walker(&self, e: &mut Elaboration) {
        let width = |word: Word| word.format.stored_bits();
        let (p, splat) = (&self.project, &self.splat);
        let [position, camera, radius, focal, pixel, normal] = [
            splat.position,
            p.camera,
            splat.radius,
            p.focal,
            p.pixel,
            splat.normal,
        ]
        .map(width);
        let mut times = |count: u32, a: i32, b: i32| {
            e.copies(count, |e| e.part(unit::FETCH, Operator::Multiplier([a, b])))
        };
        // The centre in camera space.
        times(9, position, width(p.rotation));
        // Sphere against depth: its diameter and its widest splat's size in pixels, and the limit.
        times(2, radius, focal);
        times(1, pixel, camera);
        // Two planes per axis of the picture, by the magnitude of the centre: s·|x|, side·z, and
        // the sphere.
        times(2, camera, focal);
        times(2, camera, pixel);
        times(2, radius, pixel);
        // Normal and cone against the direction to the eye.
        times(3, normal, position);
        times(4, camera, camera);
        e.adders(unit::FETCH, 9, position + 2);
        e.adders(unit::FETCH, 8, camera + focal);
        e.adders(unit::FETCH, 6, 2 * camera);
        // Increments or sums counts of the list's sort.
        e.adders(unit::FETCH, 2, SORT_COUNT_BITS as i32);
    }

    /// Widths of the FIFOs: splat records, points with the rest of their record, splats after
    /// setup, stamps.
    fn storage(
        &self,
        w: &Widths,
        [fragment_bytes, frame_bytes]: [u32; 2],
        coloured: Option<Pace>,
        map: Option<MapShape>,
        sort: Option<SortShape>,
    ) -> Storage {
        let t = &self.timing;
        let engines = units(t.engines);
        let fragments = u64::from(self.fragment.layers) * u64::from(fragment_bytes) * 8;
        let fifo = |to, places: u32, units: u32, bits: i64| Fifo {
            to,
            places: places.saturating_mul(units),
            bits: bits.max(0) as u32,
        };
        let fetch = self.fetch_pace();
        let immediate = t.organisation == Organisation::Immediate;
        let (set_up, weighed) = if immediate {
            (unit::RASTER, "cache")
        } else {
            ("bin", unit::FRAGMENT)
        };
        let fifos = [
            fifo(unit::PROJECT, fetch.fifo, fetch.units, w.splat),
            fifo(unit::ELLIPSE, t.project.fifo, t.project.units, w.point),
            fifo(
                unit::COLOUR,
                if coloured.is_some() {
                    t.ellipse.fifo
                } else {
                    0
                },
                t.ellipse.units,
                w.prepared + w.more,
            ),
            match coloured {
                Some(pace) => fifo(set_up, pace.fifo, pace.units, w.prepared),
                None => fifo(set_up, t.ellipse.fifo, t.ellipse.units, w.prepared),
            },
            fifo(
                unit::RASTER,
                if immediate { 0 } else { t.fetch.fifo },
                engines,
                w.prepared + Masks::of(self).map_or(0, |masks| i64::from(masks.bits)),
            ),
            fifo(unit::GAUSS, t.raster.fifo, engines, w.rastered),
            fifo(weighed, t.gauss.fifo, engines, w.weighed),
            fifo(
                unit::FRAGMENT,
                if immediate { t.cache.fifo } else { 0 },
                1,
                w.weighed,
            ),
        ];
        // Lines in flight have their own places.
        let kept = if immediate {
            [
                t.cache.line_px[0],
                t.cache.line_px[1],
                t.cache.lines.saturating_add(t.cache.misses),
            ]
        } else {
            [
                t.tile.side_px,
                t.tile.side_px,
                t.tile.buffers.saturating_mul(engines),
            ]
        };
        let kept_px = kept.map(u64::from).into_iter().fold(1, u64::saturating_mul);
        let tags = if immediate {
            u64::from(kept[2]) * TAG_BITS
        } else {
            0
        };
        // Counts of the next digit are taken while entries move by the current one.
        let sort_counts = sort.map_or(0, |sort| match sort.sorter {
            None => (2 * SORT_COUNT_BITS) << sort.digit_bits,
            Some(sorter) => sorter.memory_bits(t.memory.resolved(t.clock_hz).burst_bytes),
        });
        // One bit per pixel of a tile for pixels that have stopped, if any can.
        let pixels = kept_px
            .saturating_mul(fragments + u64::from(!immediate && self.fragment.sheets.is_some()));
        // Requests of fetch and writes of resolve are buffered as whole requests.
        let requests = 16u64
            .saturating_mul(t.memory.outstanding.into())
            .saturating_mul(t.memory.burst_bytes.into());
        let requests = requests.saturating_mul(engines.into());
        // Writes that a channel gathers in a batch.
        let gathered = u64::from(t.memory.write_batch.filter(|batch| *batch > 1).unwrap_or(0))
            .saturating_mul(t.memory.channels().into());
        let requests = requests.saturating_add(
            gathered.saturating_mul(8 * u64::from(t.memory.burst_bytes) + ADDRESS_BITS as u64),
        );
        // Both digits of the lengths of lists are counted at the same time.
        let length_counts = if t.queue == Queue::Longest {
            2 * LENGTH_VALUES * LENGTH_COUNT_BITS
        } else {
            0
        };
        // Each entry has the index of a first child and the number of children. If the largest
        // nodes come first, nodes are counted by size: one digit is sorted while the next is
        // counted.
        let stack = t.walk.map_or(0, |walk| {
            u64::from(walk.stack) * STACK_BITS + ((2 * SORT_COUNT_BITS) << WALK_DIGIT_BITS)
        });
        // Each shade unit has its own cache of the map of surroundings, if the map is in memory.
        let line_bits = map.map_or(0, |map| u64::from(map.line_bytes()) * 8 + TAG_BITS);
        let lines = t.environment.map_or(0, |cache| {
            u64::from(cache.lines) * u64::from(self.shade_units())
        });
        let map_bits = line_bits.saturating_mul(lines);
        let kept = pixels
            .saturating_add(tags + sort_counts + length_counts)
            .saturating_add(requests)
            .saturating_add(stack);
        Storage {
            fifos,
            memory_bits: kept.saturating_add(map_bits),
            frame_bits_per_pixel: if immediate {
                fragments
            } else {
                u64::from(frame_bytes) * 8
            },
        }
    }
}

/// Refuses an interval or a latency that is too short for the number of products per multiplier.
fn check_turns(
    unit: &str,
    [interval, latency]: [Option<u32>; 2],
    multipliers: Option<u32>,
    products: u32,
    e: &mut Elaboration,
) {
    let Some(multipliers) = multipliers else {
        return;
    };
    let least = products.div_ceil(multipliers.max(1));
    for (name, cycles) in [("interval", interval), ("latency", latency)] {
        let cycles = cycles.unwrap_or(least);
        e.require(cycles >= least, || {
            format!("timing.{unit}.{name} is {cycles}, but {products} products take {least} cycles where multipliers are {multipliers}")
        });
    }
}

/// Refuses latencies that are too short at this clock.
fn check_paths(t: &Timing, paths: &Paths, degree: u32, merges: bool, e: &mut Elaboration) {
    let colour = degree
        .checked_sub(1)
        .map(|place| paths.colour[place.min(2) as usize].path);
    let at = format!("at {} in {}", hertz(t.clock_hz), t.technology.name());
    let ways = [
        ("project.latency", t.project.latency, Some(paths.project)),
        ("ellipse.latency", t.ellipse.latency, Some(paths.ellipse)),
        (
            "colour.latency",
            t.colour.and_then(|colour| colour.latency),
            colour,
        ),
        (
            "contribution.latency",
            t.contribution.and_then(|of| of.latency),
            Some(paths.contribution),
        ),
        ("raster.latency", t.raster.latency, Some(paths.raster)),
        ("gauss.latency", t.gauss.latency, Some(paths.gauss)),
        ("fragment.latency", t.fragment.latency, Some(paths.fragment)),
        // A forwarded pixel has passed the whole path.
        ("fragment.hazard", t.fragment.hazard, Some(paths.fragment)),
        (
            "fragment.merge",
            merges.then_some(t.fragment.merge),
            Some(paths.over),
        ),
        ("shade.latency", t.shade.latency, Some(paths.shade)),
        ("resolve.latency", t.resolve.latency, Some(paths.resolve)),
    ];
    let given_latencies = ways
        .into_iter()
        .filter_map(|(name, given, path)| Some((name, given?, path?)));
    // Feedback loops cannot be pipelined: the next layer needs the transmittance behind this one,
    // the next stamp the merge decision of this one, the next pixel the sums of this one.
    let slowest = paths
        .one_cycle
        .into_iter()
        .max_by_key(|(_, _, path)| path.delay);
    if let Some((item, unit, path)) =
        slowest.filter(|(_, _, path)| path.least_cycles(t.technology, t.clock_hz) != Some(1))
    {
        let allowed =
            given_latencies.filter_map(|(_, given, path)| path.highest_clock(t.technology, given));
        let highest = allowed
            .chain(path.highest_clock(t.technology, 1))
            .min()
            .unwrap_or(u64::MAX);
        e.errors.push(format!(
            "timing.clock_hz is {}, but {unit} needs {} for {item}, which has one cycle: at most {} in {}",
            t.clock_hz,
            fo4(path.delay),
            hertz(highest),
            t.technology.name()
        ));
        return;
    }
    for (name, given, path) in given_latencies {
        let least = path
            .least_cycles(t.technology, t.clock_hz)
            .unwrap_or(u32::MAX);
        e.require(given >= least, || {
            format!(
                "timing.{name} is {given}, but its critical path takes {}: {least} {} {at}",
                fo4(path.delay),
                if least == 1 { "cycle" } else { "cycles" }
            )
        });
    }
}

fn fo4(tenths: u32) -> String {
    format!("{}.{} FO4", tenths / 10, tenths % 10)
}

/// A clock in a sentence, MHz, rounded down.
fn hertz(clock_hz: u64) -> String {
    if clock_hz < 1_000_000 {
        format!("{clock_hz} Hz")
    } else {
        format!("{} MHz", clock_hz / 1_000_000)
    }
}

/// Refuses values that no machine can have.
fn check(timing: &Timing, e: &mut Elaboration) {
    let (latency, fifo) = (1..=4096, 1..=65_536);
    let colour = timing.colour.unwrap_or_default();
    let fields = [
        ("project.units", timing.project.units, 1..=16),
        ("ellipse.units", timing.ellipse.units, 1..=16),
        ("colour.units", colour.units, 1..=16),
        ("colour.multipliers", colour.multipliers, 1..=MOST),
        ("colour.fifo", colour.fifo, fifo.clone()),
        ("project.fifo", timing.project.fifo, fifo.clone()),
        ("ellipse.fifo", timing.ellipse.fifo, fifo.clone()),
        ("fetch.fifo", timing.fetch.fifo, fifo.clone()),
        (
            "walk.stack",
            timing.walk.unwrap_or_default().stack,
            1..=MOST,
        ),
        ("raster.fifo", timing.raster.fifo, fifo.clone()),
        ("gauss.fifo", timing.gauss.fifo, fifo.clone()),
        ("cache.fifo", timing.cache.fifo, fifo),
        ("raster.lanes[0]", timing.raster.lanes[0], 1..=64),
        ("raster.lanes[1]", timing.raster.lanes[1], 1..=64),
        ("cache.misses", timing.cache.misses, 1..=MOST),
        ("cache.latency", timing.cache.latency, latency.clone()),
        ("shade.interval", timing.shade.interval, latency.clone()),
        ("resolve.interval", timing.resolve.interval, latency.clone()),
        ("fragment.merge", timing.fragment.merge, 0..=4096),
        (
            "raster.row_cycles",
            timing.raster.row_cycles.unwrap_or(0),
            0..=1024,
        ),
        (
            "tile.clear_cycles",
            timing.tile.clear_cycles.unwrap_or(0),
            0..=MOST,
        ),
        (
            "memory.bytes_per_cycle",
            timing.memory.bytes_per_cycle,
            1..=MOST,
        ),
        ("memory.hit_latency", timing.memory.hit_latency, 1..=MOST),
        ("memory.outstanding", timing.memory.outstanding, 1..=MOST),
    ];
    let left_out = [
        ("project.latency", timing.project.latency),
        ("project.interval", timing.project.interval),
        ("project.multipliers", timing.project.multipliers),
        ("ellipse.latency", timing.ellipse.latency),
        ("ellipse.interval", timing.ellipse.interval),
        ("ellipse.multipliers", timing.ellipse.multipliers),
        ("colour.latency", colour.latency),
        ("colour.interval", colour.interval),
        ("raster.latency", timing.raster.latency),
        ("gauss.latency", timing.gauss.latency),
        ("fragment.latency", timing.fragment.latency),
        ("fragment.hazard", timing.fragment.hazard),
        ("shade.latency", timing.shade.latency),
        ("resolve.latency", timing.resolve.latency),
    ];
    let side_by_side = [
        ("fetch.splats", timing.fetch.splats, 1..=16),
        ("engines", timing.engines, 1..=64),
        ("fragment.units", timing.fragment.units, 1..=16),
        (
            "fragment.merges_in_flight",
            timing.fragment.merges_in_flight,
            1..=64,
        ),
        ("shade.units", timing.shade.units, 1..=16),
        ("resolve.units", timing.resolve.units, 1..=16),
    ];
    let given = left_out
        .into_iter()
        .map(|(name, value)| (name, value, latency.clone()))
        .chain(side_by_side);
    let given = given.filter_map(|(name, value, range)| value.map(|value| (name, value, range)));
    for (name, value, range) in fields.into_iter().chain(given) {
        e.require(range.contains(&value), || {
            format!(
                "timing.{name} is {value}: it can be {} to {}",
                range.start(),
                range.end()
            )
        });
    }
    e.require((1..=1_000_000_000_000).contains(&timing.clock_hz), || {
        format!(
            "timing.clock_hz is {}: it can be 1 to 1000000000000",
            timing.clock_hz
        )
    });
    let [columns, rows] = timing.raster.lanes;
    e.require(columns.saturating_mul(rows) <= 64, || {
        format!("timing.raster.lanes {columns}×{rows} are more than 64")
    });
    for (name, value) in [
        ("cache.line_px[0]", timing.cache.line_px[0]),
        ("cache.line_px[1]", timing.cache.line_px[1]),
        ("cache.lines", timing.cache.lines),
        ("cache.ways", timing.cache.ways),
        ("memory.burst_bytes", timing.memory.burst_bytes),
        ("memory.row_bytes", timing.memory.row_bytes),
        ("memory.banks", timing.memory.banks),
    ] {
        e.require(value.is_power_of_two() && value <= MOST, || {
            format!("timing.{name} is {value}: it must be a power of two up to {MOST}")
        });
    }
    let Cache { lines, ways, .. } = timing.cache;
    // A look-up compares all ways at once.
    e.require(ways <= 64, || {
        format!("timing.cache.ways is {ways}: at most 64 are compared in a cycle")
    });
    e.require(ways > 64 || ways <= lines, || {
        format!("timing.cache has {lines} lines in sets of {ways}: no set is full")
    });
    let Tile {
        side_px, buffers, ..
    } = timing.tile;
    let is_side = |multiple: u32, most: u32| side_px % multiple == 0 && side_px <= most;
    e.require(side_px > 0 && (is_side(4, 128) || is_side(16, 1024)), || {
        format!("timing.tile.side_px is {side_px}: it must be a multiple of 4 up to 128, or of 16 up to 1024")
    });
    let (splats, setups) = (timing.fetch.splats.unwrap_or(1), timing.project.units);
    e.require(splats <= setups || !(2..=16).contains(&splats), || {
        format!("timing.fetch.splats is {splats}, but timing.project.units is {setups}: a unit takes at most one record per cycle")
    });
    let of_fragment = units(timing.fragment.units);
    e.require(of_fragment.is_power_of_two(), || {
        format!("timing.fragment.units is {of_fragment}: it must be a power of two, because the address of a pixel selects its unit")
    });
    let is_immediate = timing.organisation == Organisation::Immediate;
    e.require(!is_immediate || units(timing.engines) == 1, || {
        format!(
            "timing.engines is {}, but an immediate machine has no tiles to share: use binned",
            units(timing.engines)
        )
    });
    e.require(!is_immediate || timing.queue == Queue::Order, || {
        "timing.queue is longest, but an immediate machine has no tiles: use order".into()
    });
    e.require((1..=2).contains(&buffers), || {
        format!("timing.tile.buffers is {buffers}: it can be 1 or 2")
    });
}

/// Refuses values that no memory can have: in the description, and after the preset filled it in.
fn check_memory(given: &Memory, memory: &Memory, e: &mut Elaboration) {
    let Memory {
        burst_bytes,
        row_bytes,
        hit_latency,
        miss_latency,
        ..
    } = *memory;
    e.require(burst_bytes <= row_bytes, || {
        format!("timing.memory reads {burst_bytes} bytes at a time from rows of {row_bytes}")
    });
    e.require(burst_bytes >= ENTRY_BYTES, || {
        format!("timing.memory.burst_bytes is {burst_bytes}: an entry of a tile's list has {ENTRY_BYTES}")
    });
    e.require((hit_latency..=MOST).contains(&miss_latency), || {
        format!("timing.memory.miss_latency is {miss_latency}: it can be {hit_latency}, the latency of an open row, to {MOST}")
    });
    let permille = memory.bytes_per_cycle_permille.unwrap_or(0);
    e.require(permille < 1000, || format!("timing.memory.bytes_per_cycle_permille is {permille}: it can be 0 to 999, because 1000 are a byte"));
    let interleave = memory.interleave_bytes();
    for (name, value, most) in [
        ("channels", memory.channels(), MOST_CHANNELS),
        ("ranks", memory.ranks.unwrap_or(1), MOST_RANKS),
        (
            "interleave_bytes",
            given.interleave_bytes.unwrap_or(1),
            MOST,
        ),
    ] {
        e.require(value.is_power_of_two() && value <= most, || {
            format!("timing.memory.{name} is {value}: it must be a power of two up to {most}")
        });
    }
    e.require(given.interleave_bytes.is_none() || interleave >= burst_bytes, || {
        format!("timing.memory.interleave_bytes is {interleave}: a burst of {burst_bytes} bytes comes from one channel")
    });
    let cycles = [
        ("rank_switch_cycles", memory.rank_switch_cycles, 0),
        ("refresh_interval_cycles", memory.refresh_interval_cycles, 0),
        ("refresh_cycles", memory.refresh_cycles, 0),
        ("turnaround_cycles", memory.turnaround_cycles, 0),
        ("write_batch", memory.write_batch, 1),
        ("row_cycles", memory.row_cycles, 0),
        ("four_rows_cycles", memory.four_rows_cycles, 0),
    ];
    for (name, value, least) in cycles {
        let value = value.unwrap_or(least);
        e.require((least..=MOST).contains(&value), || {
            format!("timing.memory.{name} is {value}: it can be {least} to {MOST}")
        });
    }
    let [interval, refresh] =
        [memory.refresh_interval_cycles, memory.refresh_cycles].map(|cycles| cycles.unwrap_or(0));
    if interval > 0 {
        e.require(refresh < interval, || {
            format!("timing.memory.refresh_cycles is {refresh}: it must be less than refresh_interval_cycles, {interval}, so that memory can move data")
        });
    } else {
        e.require(given.refresh_cycles.unwrap_or(0) == 0, || {
            format!("timing.memory.refresh_cycles is {refresh}, but refresh_interval_cycles is 0 or left out: nothing is refreshed")
        });
    }
}

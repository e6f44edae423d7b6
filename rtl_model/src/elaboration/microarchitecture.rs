//! Microarchitecture: works out what a description of timing leaves out.
//!
//! ```text
//! description ─►( elaborate: what is left out follows from the formats )─► latencies, intervals, record sizes
//!                                          └► every misfit, a sentence each
//! ```

use super::latency::Path;
use super::sorter::SorterShape;
use super::{Elaboration, Operator, Part, unit};
use crate::machine::timing::{
    Cache, Environment, Memory, Organisation, Queue, Setup, Technology, Tile, Timing,
};
use crate::machine::{Group, Machine, Merge};
use crate::num::Word;
use schemars::JsonSchema;
use serde::Serialize;

/// Cycles of a unit, nothing left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Pace {
    /// Units side by side.
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

impl Microarchitecture {
    /// Whether each unit of the fill stands alone, and merging holds it.
    pub fn is_single(&self) -> bool {
        [
            self.engines,
            self.merges_in_flight,
            self.fragment.units,
            self.shade.units,
            self.resolve.units,
        ] == [1; 5]
    }

    /// Sorters of lists side by side; 0 where there are none.
    pub fn sorters(&self) -> u32 {
        self.sort
            .and_then(|sort| sort.sorter)
            .map_or(0, |sorter| sorter.units)
    }

    /// Whether the same work takes the same cycles: nothing differs but how long paths are, and how
    /// many bits are kept on the chip.
    pub fn keeps_time_as(&self, other: &Self) -> bool {
        let (paths, pipelines, storage) = (other.paths, other.pipelines, other.storage);
        Microarchitecture {
            paths,
            pipelines,
            storage,
            ..self.clone()
        } == *other
    }

    /// Whether a binned machine that goes through tiles as another does writes the same lists in
    /// the same cycles, too: they differ in what comes behind these alone. Shade does, where splats
    /// are not lit in setup.
    pub fn lists_as(&self, other: &Self, preshaded: bool) -> bool {
        let behind = [unit::RASTER, unit::GAUSS, unit::FRAGMENT, unit::RESOLVE];
        let is_behind = |name: &&str| behind.contains(name) || *name == unit::SHADE && !preshaded;
        let lifted = |of: &Self| of.lifted.filter(|name| !is_behind(name));
        let before = |of: &Self| {
            let Microarchitecture {
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

    /// Lanes of a stamp that one of the fragment units has.
    pub fn lanes_of_fragment(&self) -> u32 {
        lanes_of_fragment(&self.timing)
    }

    /// What splats take whose colours are harmonics of a degree; none where colours are as they
    /// are.
    pub fn colour_of(&self, degree: u8) -> Option<&ColourPace> {
        usize::from(degree)
            .checked_sub(1)
            .and_then(|place| self.colour.get(place))
    }

    /// Bytes of a splat in memory, of a frame whose splats share their axes or not, and have
    /// harmonics of a degree.
    pub fn record_bytes(&self, shares_axes: bool, degree: u8) -> u32 {
        let own = self
            .colour_of(degree)
            .map_or(self.splat_bytes, |colour| colour.splat_bytes);
        self.voxel_bytes.filter(|_| shares_axes).unwrap_or(own)
    }
}

/// An elaborated microarchitecture: every derived value beside what it was derived from.
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
    /// An item is a splat whose colour is harmonics of degree 1, 2 and so on; none where the
    /// machine works no colours out.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub colour: Vec<ColourPace>,
    /// An item is a stamp.
    pub raster: Pace,
    /// An item is a stamp that kept a pixel.
    pub gauss: Pace,
    /// An item is a stamp whose weights are not all 0.
    pub cache: Pace,
    /// Likewise; merging takes more.
    pub fragment: Pace,
    /// Cycles before the same pixel can be taken again.
    pub hazard: u32,
    /// Stamps whose fragments are merged at a time, in each fragment unit.
    pub merges_in_flight: u32,
    /// Copies of all that follows the lists.
    pub engines: u32,
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
    /// Bytes of a tree's node in memory: its splat, its sphere, its cone, where its children are.
    #[serde(skip)]
    pub node_bytes: u32,
    /// Bytes of a fragment in the frame buffer.
    pub fragment_bytes: u32,
    /// Bytes of a frame word.
    pub frame_bytes: u32,
    /// Bytes of a line of the frame buffer.
    pub line_bytes: u32,
    /// The map of surroundings, of a machine that mirrors them.
    #[serde(skip)]
    pub map: Option<MapShape>,
    /// Splats are lit in setup by a shade unit of its own, for fragments take theirs meanwhile:
    /// where they are grouped by windows.
    #[serde(skip)]
    pub lights_setup: bool,
    /// Shade units, all together: those for fragments; where windows are formed, as many for setup;
    /// where tiles have two buffers, as many for resolving; all but setup's once for each engine.
    #[serde(skip)]
    pub shade_units: u32,
    /// Longest way through each unit.
    #[serde(skip)]
    pub paths: Paths,
    /// Registers between the stages of each unit.
    #[serde(skip)]
    pub pipelines: [Pipeline; 8],
    /// Words that wait and that are kept on the chip.
    pub storage: Storage,
    /// Memory that is bought as a preset has it, at this clock.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory: Option<Memory>,
    /// A unit that is infinitely fast, to see what it costs: no machine has one.
    #[serde(skip)]
    pub lifted: Option<&'static str>,
}

/// The map of surroundings in memory: all of it is loaded before a frame, or lines of it by a cache
/// while that is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MapShape {
    /// 2^this texels a side.
    pub index_bits: u32,
    /// Bytes of a texel.
    pub texel_bytes: u32,
    /// Its cache; none where the chip has all of it.
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

/// What harmonics of one degree take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ColourPace {
    /// Cycles.
    #[serde(flatten)]
    pub pace: Pace,
    /// Products for each splat.
    pub products: u32,
    /// Bytes of a splat in memory, its coefficients in the place of its colour.
    pub splat_bytes: u32,
    /// Bits that it has more than one with a colour.
    #[serde(skip)]
    pub more_bits: u32,
}

/// Registers between the stages of a unit: of each stage half of what comes in and half of what
/// goes out, on average.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pipeline {
    /// The unit.
    pub unit: &'static str,
    /// Bits of one such unit: stages that hold an item at a time, times bits of each.
    pub bits: u64,
    /// Bits beside the stages of one: what waits to be merged.
    pub beside: u64,
    /// How many work side by side.
    pub units: u32,
}

impl Pipeline {
    fn new(unit: &'static str, pace: &Pace, units: u32, [comes_in, goes_out]: [i64; 2]) -> Self {
        let stages = u64::from(pace.latency.div_ceil(pace.interval));
        Pipeline {
            unit,
            bits: (stages * (comes_in.max(0) + goes_out.max(0)) as u64).div_ceil(2),
            beside: 0,
            units,
        }
    }
}

/// Words kept on the chip, besides the registers of the units: bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Storage {
    /// All FIFOs, in the order of the diagram.
    pub fifos: [Fifo; 8],
    /// Tiles, or the cache with its tags and the lines that are on their way; counts of the sort's
    /// digits, or its buffers; requests to memory under way.
    pub memory_bits: u64,
    /// A pixel of the frame buffer: frame words, or all fragments of an immediate machine.
    pub frame_bits_per_pixel: u64,
}

/// Width of the sort's counts: as many entries as an index of 4 bytes tells apart.
pub const SORT_COUNT_BITS: u64 = 32;

/// A sort.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct SortShape {
    /// Passes of a radix sort: times that every entry is read and written; 0 of the other kinds.
    pub passes: u32,
    /// Bits of the key that a pass looks at; 0 of the other kinds.
    pub digit_bits: u32,
    /// Bytes of an entry: which splat, and its key.
    pub entry_bytes: u32,
    /// What sorts lists one by one; none of a radix sort.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sorter: Option<SorterShape>,
}

/// Longest way through each unit, from an item to its result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Paths {
    /// Of a splat.
    pub project: Path,
    /// Of a splat.
    pub ellipse: Path,
    /// Of a splat's colour, and the products that it takes, by degree of harmonics from 1 on.
    pub colour: [Harmonics; 3],
    /// Of a stamp.
    pub raster: Path,
    /// Of a stamp.
    pub gauss: Path,
    /// Of a stamp.
    pub fragment: Path,
    /// Of two fragments that merge, once they are shaded.
    pub over: Path,
    /// Of a fragment.
    pub shade: Path,
    /// Of a pixel.
    pub resolve: Path,
    /// Of what takes one cycle by its nature, or as the twins are built, for it waits for itself:
    /// its name, its unit.
    pub one_cycle: [(&'static str, &'static str, Path); 3],
}

/// What colours of one degree of harmonics ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Harmonics {
    /// From a splat to its colour.
    pub path: Path,
    /// Products for each splat.
    pub products: u32,
    /// Bits of its coefficients.
    pub bits: i32,
}

/// A FIFO.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Fifo {
    /// The unit that takes from it.
    pub to: &'static str,
    /// Results that it holds; none where the organisation has no such FIFO.
    pub places: u32,
    /// Bits of each.
    pub bits: u32,
}

/// Values of a digit of a list's length, which has two, where the queue takes the longest first;
/// and bits of their counts.
pub const LENGTH_VALUES: u64 = 1 << 8;
const LENGTH_COUNT_BITS: u64 = 32;

/// Units side by side where nothing or nonsense is said, which is refused elsewhere.
fn units(said: Option<u32>) -> u32 {
    said.unwrap_or(1).clamp(1, 64)
}

fn lanes_of_fragment(timing: &Timing) -> u32 {
    let [columns, rows] = timing.raster.lanes;
    columns
        .saturating_mul(rows)
        .min(64)
        .div_ceil(units(timing.fragment.units))
}

/// Bytes of an entry of a tile's list: which splat.
pub const ENTRY_BYTES: u32 = 4;
/// Bits of a tree's node beside its splat, sphere and widest σ: cone, first child, how many.
const NODE_BITS: i32 = 8 + 32 + 8;
/// Bits of the digit by which a walker's list is sorted in a pass.
pub const WALK_DIGIT_BITS: u32 = 8;
/// Bits of an entry of a walker's stack.
const STACK_BITS: u64 = 32 + 8;
/// Bits of a pixel's place among those under way.
const PIXEL_BITS: i32 = 28;
/// Bits of an address of memory.
const ADDRESS_BITS: i32 = 48;
/// Bits of a cache line's tag: an address, whether it was written, when it was used.
const TAG_BITS: u64 = 32;
/// The most that a field of memory may say.
const MOST: u32 = 1 << 20;
/// The most channels, and ranks of each.
const MOST_CHANNELS: u32 = 64;
const MOST_RANKS: u32 = 8;

fn bytes(bits: i32) -> u32 {
    (bits.max(0) as u32).div_ceil(8)
}

/// Bits of so many words.
fn bits(words: &[(i32, Word)]) -> i32 {
    words
        .iter()
        .map(|(count, word)| count * word.format.width())
        .sum()
}

impl Machine {
    /// Elaborates the microarchitecture, from the longest way through each unit; misfits are added
    /// to those of the formats.
    pub fn elaborate_timing(&self, e: &mut Elaboration, paths: &Paths) -> Microarchitecture {
        let memory = self.timing.memory.resolved(self.timing.clock_hz);
        let t = &Timing {
            memory,
            ..self.timing
        };
        check(t, e);
        check_memory(&self.timing.memory, &memory, e);
        // Who replaces, or has one sheet open, merges no two.
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
            // Where products take turns, a splat is as long under way as the next one waits.
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
        let several = |said: Option<u32>, pace: Pace| Pace {
            units: units(said),
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
        // An ellipsoid's axes, which only a grid's splats have in common.
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
        e.require(self.sort.is_none() || t.organisation == Organisation::Binned, || {
            "timing.organisation is immediate, but a sort needs all splats first: binned would do".into()
        });
        let sorter = self.sorter_shape(e);
        let sort = self.sort.map(|sort| {
            let [passes, digit_bits] = if sorter.is_some() {
                [0; 2]
            } else {
                [sort.passes(), sort.digit_bits.clamp(1, 16)]
            };
            SortShape {
                passes,
                digit_bits,
                entry_bytes: ENTRY_BYTES + bytes(sort.key_bits() as i32),
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
        let fragment_bytes = bytes(self.fragment_bits());
        let frame_bytes = bytes(4 * self.resolve.frame.format.width());
        let pixels = t.cache.line_px[0].saturating_mul(t.cache.line_px[1]);
        let line_bytes = pixels
            .saturating_mul(f.layers)
            .saturating_mul(fragment_bytes);
        e.require(line_bytes <= MOST, || {
            format!(
                "timing.cache.line_px {}×{} makes lines of {line_bytes} bytes: at most {MOST} can be had",
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
        // What is forwarded is compared with the pixels that come, and taken in the place of what
        // is read, at every stage it skips.
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
            .map(|word| 4 * i64::from(word.format.width()));
        let fragment_bits = i64::from(self.fragment_bits());
        // Of a pixel's slots one is changed.
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
                beside: in_flight.max(0) as u64,
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
            fetch: stage(Some(1), 1, t.fetch.fifo),
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
            engines,
            shade,
            resolve,
            shade_units,
            paths: *paths,
            pipelines,
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

/// Bits of what goes from unit to unit.
struct Widths {
    /// A splat's record, with its harmonics.
    splat: i64,
    /// A point with the rest of its record.
    point: i64,
    /// A splat that is set up.
    prepared: i64,
    /// Harmonics beyond one colour.
    more: i64,
    /// A stamp of radial indices, and of weights; a lane carries a depth beside that, and its
    /// splat's attributes go with it.
    rastered: i64,
    weighed: i64,
    /// A lane of the latter.
    weighed_lane: i64,
    /// Lanes of a stamp.
    lanes: i64,
}

impl Machine {
    /// Shade units: see [`Microarchitecture::shade_units`].
    pub fn shade_units(&self) -> u32 {
        let t = &self.timing;
        let lights_setup = u32::from(self.fragment.group != Group::First);
        let of_engine =
            1 + u32::from(t.organisation == Organisation::Binned && t.tile.buffers == 2);
        units(t.shade.units) * (lights_setup + units(t.engines) * of_engine)
    }

    /// What a merge in flight keeps of a lane: both fragments, and which pixel.
    fn in_flight_bits(&self) -> i32 {
        2 * self.fragment_bits() + PIXEL_BITS
    }

    /// Parts of what stands between units that stand side by side. Each unit of a kind has its own.
    fn side_by_side(
        &self,
        e: &mut Elaboration,
        [fragment, shade, resolve]: [&Pace; 3],
        [engines, in_flight]: [u32; 2],
    ) {
        let fragment_bits = self.fragment_bits();
        let [light, word] =
            [self.shade.premultiplied, self.resolve.frame].map(|word| 4 * word.format.width());
        let lane = bits(&[(1, self.gauss.weight), (1, self.fragment.depth)]);
        e.per_lane(|e| {
            // A pixel that comes is compared with each that is merged; what becomes of that is
            // written beside what comes.
            e.copies(in_flight - 1, |e| {
                e.adders(unit::FRAGMENT, 1, PIXEL_BITS);
                e.choice(unit::FRAGMENT, 2, self.in_flight_bits());
            });
            // Lanes go to units by their pixels: a stage of a shifter for each bit of a unit's
            // number.
            e.copies(fragment.units.ilog2(), |e| {
                e.choice(unit::FRAGMENT, 2, lane)
            });
        });
        // Fragments to those that shade them, and light back.
        e.copies(engines, |e| {
            e.choice(unit::SHADE, shade.units, fragment_bits + light)
        });
        // Each resolve unit reads another pixel of the same tile; their words leave by one way.
        e.choice(
            unit::RESOLVE,
            resolve.units,
            self.fragment.layers.min(64) as i32 * fragment_bits + word,
        );
        // Engines ask, and are answered, by one way, whatever channels that leads to.
        let memory = self.timing.memory.resolved(self.timing.clock_hz);
        let request = 8 * memory.bytes_per_cycle.min(MOST) as i32 + ADDRESS_BITS;
        e.choice(unit::FETCH, engines, 2 * request);
        e.choice(
            unit::FETCH,
            memory.channels().clamp(1, MOST_CHANNELS),
            request,
        );
    }

    /// The map of surroundings, and what it cannot be.
    fn map_shape(&self, e: &mut Elaboration) -> Option<MapShape> {
        let cache = self.timing.environment;
        e.require(cache.is_none() || self.reflect.is_some(), || {
            "timing.environment is the cache of a map, and the machine has no `reflect` that looks one up: it can be left out".into()
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
                "timing.environment, a map in memory, goes with one engine, one unit each of fragment, shade and resolve, and one merge in \
                 flight: leave it out, and each shade unit has the map on the chip"
                    .into()
            });
        }
        Some(MapShape {
            index_bits,
            texel_bytes: bytes(3 * reflect.light.format.width()),
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
        // What is out of range is a misfit already: here it must do no harm.
        let lanes = t.raster.lanes[0].saturating_mul(t.raster.lanes[1]).min(64) as i32;
        let lane = |word: Word| bits(&[(1, word), (1, f.depth)]);
        let stamp = |word: Word| lanes * lane(word) + attributes;
        // Coefficients wait with what they belong to until they are a colour.
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

    /// Parts of what tests a node of a tree, as wide as the words of the splat and of `project`; it
    /// divides nothing, for both sides of a comparison are multiplied by the depth.
    fn walker(&self, e: &mut Elaboration) {
        let width = |word: Word| word.format.width();
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
        // Sphere against depth: its diameter and its widest splat's reach in pixels, and the limit.
        times(2, radius, focal);
        times(1, pixel, camera);
        // Two planes a side of the picture, by the centre's magnitude: s·|x|, side·z, and the
        // sphere.
        times(2, camera, focal);
        times(2, camera, pixel);
        times(2, radius, pixel);
        // Normal and cone against the way to the eye.
        times(3, normal, position);
        times(4, camera, camera);
        e.adders(unit::FETCH, 9, position + 2);
        e.adders(unit::FETCH, 8, camera + focal);
        e.adders(unit::FETCH, 6, 2 * camera);
        // A count of the list's sort, up by one or summed up.
        e.adders(unit::FETCH, 2, SORT_COUNT_BITS as i32);
    }

    /// What lies in FIFOs: splat records, points with the rest of their record, splats that are set
    /// up, stamps.
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
        let immediate = t.organisation == Organisation::Immediate;
        let (set_up, weighed) = if immediate {
            (unit::RASTER, "cache")
        } else {
            ("bin", unit::FRAGMENT)
        };
        let fifos = [
            fifo(unit::PROJECT, t.fetch.fifo, 1, w.splat),
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
                w.prepared,
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
        // Lines that are on their way have a place of their own.
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
        // While entries go where one digit has them, the next digit is counted.
        let sort_counts = sort.map_or(0, |sort| match sort.sorter {
            None => (2 * SORT_COUNT_BITS) << sort.digit_bits,
            Some(sorter) => sorter.memory_bits(t.memory.resolved(t.clock_hz).burst_bytes),
        });
        // Of a tile beside its fragments which pixels have stopped, if any can.
        let pixels = kept_px
            .saturating_mul(fragments + u64::from(!immediate && self.fragment.sheets.is_some()));
        // What fetch has asked for, and what resolve writes, waits in whole requests.
        let requests = 16u64
            .saturating_mul(t.memory.outstanding.into())
            .saturating_mul(t.memory.burst_bytes.into());
        let requests = requests.saturating_mul(engines.into());
        // What a channel gathers before it turns to writing.
        let gathered = u64::from(t.memory.write_batch.filter(|batch| *batch > 1).unwrap_or(0))
            .saturating_mul(t.memory.channels().into());
        let requests = requests.saturating_add(
            gathered.saturating_mul(8 * u64::from(t.memory.burst_bytes) + ADDRESS_BITS as u64),
        );
        // Both digits of the lengths of lists are counted at once.
        let length_counts = if t.queue == Queue::Longest {
            2 * LENGTH_VALUES * LENGTH_COUNT_BITS
        } else {
            0
        };
        // Number of a first child and how many there are, for each entry; and what counts nodes by
        // size where the largest come first: while one digit sorts, the next is counted.
        let stack = t.walk.map_or(0, |walk| {
            u64::from(walk.stack) * STACK_BITS + ((2 * SORT_COUNT_BITS) << WALK_DIGIT_BITS)
        });
        // Each shade unit has a cache of the map of surroundings, if that lies in memory.
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

/// Refuses products that share fewer multipliers than their interval, or their latency, has turns
/// for.
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

/// Refuses latencies that the clock does not leave time for.
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
        ("raster.latency", t.raster.latency, Some(paths.raster)),
        ("gauss.latency", t.gauss.latency, Some(paths.gauss)),
        ("fragment.latency", t.fragment.latency, Some(paths.fragment)),
        // What is forwarded has gone the whole way.
        ("fragment.hazard", t.fragment.hazard, Some(paths.fragment)),
        (
            "fragment.merge",
            merges.then_some(t.fragment.merge),
            Some(paths.over),
        ),
        ("shade.latency", t.shade.latency, Some(paths.shade)),
        ("resolve.latency", t.resolve.latency, Some(paths.resolve)),
    ];
    let said = ways
        .into_iter()
        .filter_map(|(name, given, path)| Some((name, given?, path?)));
    // The next layer waits for the transmittance behind this one, the next stamp for whether this
    // one is merged, the next pixel for the sums of this one: no registers cut what waits for
    // itself.
    let slowest = paths
        .one_cycle
        .into_iter()
        .max_by_key(|(_, _, path)| path.delay);
    if let Some((item, unit, path)) =
        slowest.filter(|(_, _, path)| path.least_cycles(t.technology, t.clock_hz) != Some(1))
    {
        let allowed = said.filter_map(|(_, given, path)| path.highest_clock(t.technology, given));
        let highest = allowed
            .chain(path.highest_clock(t.technology, 1))
            .min()
            .unwrap_or(u64::MAX);
        e.misfits.push(format!(
            "timing.clock_hz is {}, but {item} takes {unit} {}, and has one cycle: at most {} in {}",
            t.clock_hz,
            fo4(path.delay),
            hertz(highest),
            t.technology.name()
        ));
        return;
    }
    for (name, given, path) in said {
        let least = path
            .least_cycles(t.technology, t.clock_hz)
            .unwrap_or(u32::MAX);
        e.require(given >= least, || {
            format!(
                "timing.{name} is {given}, but its longest way takes {}: {least} {} {at}",
                fo4(path.delay),
                if least == 1 { "cycle" } else { "cycles" }
            )
        });
    }
}

/// A delay in a sentence.
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

/// Refuses what no machine can be.
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
    // Each look-up compares them all at once.
    e.require(ways <= 64, || {
        format!("timing.cache.ways is {ways}: at most 64 are compared in a cycle")
    });
    e.require(ways > 64 || ways <= lines, || {
        format!("timing.cache has {lines} lines in sets of {ways}: no set is full")
    });
    let Tile { side_px, buffers } = timing.tile;
    e.require(side_px % 16 == 0 && (16..=1024).contains(&side_px), || {
        format!("timing.tile.side_px is {side_px}: it must be a multiple of 16 up to 1024")
    });
    let of_fragment = units(timing.fragment.units);
    e.require(of_fragment.is_power_of_two(), || {
        format!("timing.fragment.units is {of_fragment}: it must be a power of two, for pixels go to units by their address")
    });
    let is_immediate = timing.organisation == Organisation::Immediate;
    e.require(!is_immediate || units(timing.engines) == 1, || {
        format!(
            "timing.engines is {}, but an immediate machine has no tiles to share: binned would do",
            units(timing.engines)
        )
    });
    e.require(!is_immediate || timing.queue == Queue::Order, || {
        "timing.queue is longest, but an immediate machine has no tiles: order would do".into()
    });
    e.require((1..=2).contains(&buffers), || {
        format!("timing.tile.buffers is {buffers}: it can be 1 or 2")
    });
}

/// Refuses what no memory can be: as a machine gives it, and with what its preset fills.
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
    e.require(permille < 1000, || format!("timing.memory.bytes_per_cycle_permille is {permille}: it can be 0 to 999, more are a byte"));
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
            format!("timing.memory.refresh_cycles is {refresh}: it must be less than refresh_interval_cycles, {interval}, for memory to move anything")
        });
    } else {
        e.require(given.refresh_cycles.unwrap_or(0) == 0, || {
            format!("timing.memory.refresh_cycles is {refresh}, but refresh_interval_cycles is 0 or left out: nothing is refreshed")
        });
    }
}

//! Fragment: keeps at most `layers` fragments per pixel: accumulates, inserts, merges, evicts
//! (Surface Splatting §6, docs/book/algorithm.md §6).
//!
//! ```text
//! weight, depth, attributes ─►[ match: unshaded, |z − z_f| < ε, nearest ]─┬─ found ─► accumulate: sums += weight · attributes
//!                                                                        ├─ slot free ─► insert
//!                                                                        └─ full ─► evict the deepest if something is hidden,
//!                                                        shade ◄── two fragments ──┘ else merge an adjacent pair, front over back
//! ```
//! Losses: each sum is rounded once per contribution and saturates. The results of a merge are
//! written back through the same fits. A shaded slot keeps its premultiplied colour and its opacity
//! in the fields that hold the sums of an unshaded slot.
//!
//! Laws: `every_contribution_has_one_outcome`, `slots_are_in_depth_order_after_a_merge`.

use crate::elaboration::latency::Path;
use crate::elaboration::{Elaboration, Operator};
use crate::functions::{Reciprocal, table};
use crate::kernels::{
    Accumulator, HostPath, MAX_DEPTH_BITS, PackedSlot, PackedSums, PackedTile, SumLimits,
    fits_32_bits,
};
use crate::machine::{FragmentDepth, Group, Machine, Merge};
use crate::num::{Exact, Exacts, Fit, Lanes, Word, Words, fit, three};
use crate::probe::{Probe, Tap};
use crate::records::{SHEET_BITS, unit};
use sheets::SheetDatapath;
use std::cmp::Ordering;
use window::WindowDatapath;

pub use crate::records::{
    Attributes, COLOUR, Contribution, Decision, MAX_LAYERS, NORMAL, OPACITY, Outcomes,
    Premultiplied, SUM_SIGNALS, SUMS, Side, Slot, Sums, TILE_AREA, TILE_PX, WEIGHT,
};

const UNIT: &str = unit::FRAGMENT;

/// Input port: one contribution. Its material is read only when it opens a fragment.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// w (`gauss.weight`).
    pub weight: i64,
    /// z (`fragment.depth`).
    pub depth: i64,
    /// Attributes of the splat.
    pub attributes: &'a Attributes,
    /// Index into the frame's materials.
    pub material: &'a u32,
}

/// Registers that a frame loads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FragmentRegisters {
    /// ε (`fragment.depth`).
    pub z_threshold: i64,
    /// τ (`fragment.weight_sum`).
    pub coverage_threshold: i64,
}

/// Rule for one more fragment at a full pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FullRule {
    /// The nearer of the two fragments stays.
    Replace,
    /// Two fragments are merged.
    Merge(MergePair),
}

/// Which two fragments are merged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MergePair {
    Nearest,
    Farthest,
}

impl From<Merge> for FullRule {
    fn from(merge: Merge) -> Self {
        match merge {
            Merge::NearestPair => FullRule::Merge(MergePair::Nearest),
            Merge::FarthestPair => FullRule::Merge(MergePair::Farthest),
            Merge::Replace => FullRule::Replace,
            // Windows have their own rule and never use this one.
            Merge::Window => FullRule::Merge(MergePair::Farthest),
        }
    }
}

/// How two fragments are merged and shaded.
pub trait Merging<A, P> {
    /// Completes the postponed merges of a pixel before it is accessed again.
    fn settle(&mut self, unit: &Fragment, tile: &mut PackedTile<A>, pixel: u8, probe: &mut P);
    /// Merges the front and the back of a pair into this slot of a pixel.
    fn merge(
        &mut self,
        unit: &Fragment,
        tile: &mut PackedTile<A>,
        at: (u8, usize),
        pair: &[Slot; 2],
        probe: &mut P,
    );
}

/// Merges immediately, and shades by a function.
impl<A: Accumulator, P: Probe, F: Fn(&Slot, &mut Tap<P>) -> Premultiplied> Merging<A, P> for F {
    fn settle(&mut self, _: &Fragment, _: &mut PackedTile<A>, _: u8, _: &mut P) {}

    fn merge(
        &mut self,
        unit: &Fragment,
        tile: &mut PackedTile<A>,
        (pixel, slot): (u8, usize),
        [front, back]: &[Slot; 2],
        probe: &mut P,
    ) {
        tile.write(
            pixel,
            slot,
            PackedSlot::put(&unit.merged(front, back, &*self, &mut Tap::new(probe))),
        );
    }
}

/// Critical path: read, compare depths, product, sum, write.
pub fn path(machine: &Machine) -> Path {
    let m = &machine.fragment;
    let bits = |word: Word| word.format.width();
    let weight = machine.gauss.weight;
    // The product runs in parallel with the match, and is registered behind it.
    let product = Path::default()
        .product_of(weight, machine.splat.rgb)
        .parallel(Path::default().product_of(weight, m.normal));
    let matched = Path::default()
        .sum(bits(m.depth))
        .choose(m.layers.saturating_add(1));
    let way = Path::default()
        .memory()
        .then(Path {
            cycles: product.cycles + matched.cycles,
            ..product.parallel(matched)
        })
        .accumulate([m.colour_sum, m.normal_sum])
        .choose(m.layers.saturating_add(1))
        .memory();
    // No other part of the path is longer.
    let ways = [way, decision(machine), sheet(machine), stamp(machine)];
    // A composite is neither found nor summed.
    let ways = if m.composite().is_some() {
        &ways[2..]
    } else {
        &ways
    };
    let longest = ways.iter().map(|way| way.delay).max();
    Path {
        delay: longest.unwrap_or_default(),
        ..way
    }
}

/// From a contribution that is a whole sheet to the composite that includes it: its sums, the
/// closed sheet, front over back, and the test whether the pixel stops. A sheet that is already
/// open has the same path, after its sums.
fn sheet(machine: &Machine) -> Path {
    let m = &machine.fragment;
    let Some(words) = &m.sheets else {
        return Path::default();
    };
    let bits = |word: Word| word.format.width();
    if let Some(composite) = words.composite {
        let light = machine.shade.premultiplied;
        return Path::default()
            .memory()
            .product_of(machine.gauss.weight, machine.splat.rgb)
            .fit_word(light, bits(machine.gauss.weight) + bits(machine.splat.rgb))
            .parallel(Path::default().memory().product_of(composite, m.weight_sum))
            .sum(2 * bits(light))
            .fit_word(composite, 2 * bits(light))
            .memory();
    }
    let sum = bits(m.colour_sum).max(bits(m.weight_sum));
    let summed = Path::default()
        .memory()
        .product_of(machine.gauss.weight, machine.splat.rgb)
        .accumulate([m.colour_sum, m.weight_sum]);
    let looked_up = summed
        .fit(bits(words.depth_index))
        .then(table::path(words.table, bits(words.ratio)));
    looked_up
        .product_of(m.colour_sum, words.ratio)
        .parallel(looked_up.product_of(m.weight_sum, words.ratio))
        .fit_word(machine.shade.premultiplied, sum + bits(words.ratio))
        .then(over(machine))
        .sum(bits(m.opacity_sum))
        .choose(3)
        .memory()
}

/// From the read pixel to the written slots, as in the RTL implementation: the nearest slot, the
/// sum, the order of all slots.
fn decision(machine: &Machine) -> Path {
    let m = &machine.fragment;
    let bits = |word: Word| word.format.width();
    nearest(machine)
        .choose(m.layers)
        .accumulate([m.colour_sum, m.normal_sum])
        .sum(bits(m.depth))
        .choose(m.layers.saturating_add(1))
        .choose(3)
        .memory()
}

/// From the read pixel to the nearest slot.
fn nearest(machine: &Machine) -> Path {
    let m = &machine.fragment;
    let depth = m.depth.format.width();
    let nearer = Path::default().sum(depth).choose(2);
    Path::default()
        .memory()
        .sum(depth)
        .sum(depth)
        .choose(2)
        .then(nearer.times(m.layers.clamp(1, 64).next_power_of_two().ilog2()))
}

/// Logic in the one cycle in which the RTL implementation decides whether it can take another
/// stamp: one comparison per slot for its match, and one for the deepest fragment. Opaque slots are
/// marked when the pixel is read. For sheets it compares the number of the open sheet. Windows are
/// formed one slot per cycle, which takes longer than a match.
pub fn stamp(machine: &Machine) -> Path {
    let m = &machine.fragment;
    let bits = |word: Word| word.format.width();
    let places = m.layers.saturating_add(1);
    if m.sheets.is_some() {
        return Path::default().sum(SHEET_BITS).choose(4).choose(4);
    }
    let near = Path::default()
        .sum(bits(m.depth) + 2)
        .choose(places)
        .choose(places)
        .choose(4)
        .choose(4);
    near.parallel(window::slot(machine))
}

/// Merges two shaded fragments: the front over the back, and the result into a slot.
pub fn over(machine: &Machine) -> Path {
    let light = machine.shade.premultiplied;
    let bits = 2 * light.format.width();
    Path::default()
        .product_of(light, light)
        .sum(bits)
        .fit_word(machine.fragment.colour_sum, bits)
}

/// Opacity, in `fragment.opaque`, from which a fragment counts as opaque.
fn opaque(machine: &Machine) -> i128 {
    let m = &machine.fragment;
    i128::from(m.opaque.format.one()) * i128::from(m.opaque_permille) / 1000
}

/// Nonzero digits of a number in its non-adjacent form, the signed-digit form with the fewest: the
/// positions in which the number and three times the number differ.
fn signed_digits(number: i128) -> u32 {
    (number ^ number.wrapping_mul(3)).count_ones()
}

/// Elaborated unit.
#[derive(Clone, Debug)]
pub struct Fragment {
    layers: usize,
    full: FullRule,
    evict_hidden: bool,
    nearest_depth: bool,
    depth: Fit,
    /// Whether 32 bits hold every depth that raster's clamps produce.
    is_depth_natural: bool,
    sums: [Fit; SUMS],
    /// Left shifts that align a sum and a product.
    align: [[u32; 2]; SUMS],
    limits: SumLimits,
    /// Whether 32-bit sums and products hold everything.
    narrow: bool,
    /// Factors that align Σw·α and Σw times the opacity limit.
    opaque_scales: [i128; 2],
    /// Least opacity of an opaque shaded fragment.
    opaque_shaded: i64,
    /// From shaded words to the words of a slot, and back.
    store: [Fit; 2],
    read: [Fit; 2],
    blend: [Fit; 2],
    premultiplied_frac_bits: u32,
    sheets: Option<SheetDatapath>,
    windows: Option<WindowDatapath>,
    /// Fraction bits of a contribution's weight.
    weight_frac_bits: u32,
}

impl Fragment {
    /// Elaborates the unit. `depth` is the shape of the input depth.
    pub fn new(e: &mut Elaboration, machine: &Machine, depth: Exact) -> Self {
        let m = &machine.fragment;
        let layers = e.within(UNIT, "layers", m.layers, 1, MAX_LAYERS as u32) as usize;
        e.require(FullRule::from(m.merge) != FullRule::Replace || m.layers == 1, || {
            format!("fragment.merge is replace, a z-buffer, with {} layers: it needs fragment.layers 1", m.layers)
        });
        e.require((m.merge == Merge::Window) == (m.group != Group::First), || {
            "fragment.merge is window where fragment.group is interval or window, and nowhere else".into()
        });
        e.within(UNIT, "opaque_permille", m.opaque_permille, 1, 1000);
        e.number(UNIT, "normal", m.normal, true);
        e.holds_one(UNIT, "normal", m.normal);
        e.port(UNIT, "opaque", m.opaque);
        e.holds_one(UNIT, "opaque", m.opaque);
        e.fixed_point(UNIT, "opaque", m.opaque);
        e.signedness(UNIT, "depth", m.depth, false);
        e.fixed_point(UNIT, "depth", m.depth);
        e.saturates(UNIT, "depth", m.depth);
        e.require(m.depth.format.width() <= MAX_DEPTH_BITS, || {
            format!("fragment.depth is {}, {} bits: the depth comparators take at most {MAX_DEPTH_BITS}", m.depth, m.depth.format.width())
        });
        for (name, word, signed) in [
            ("weight_sum", m.weight_sum, false),
            ("colour_sum", m.colour_sum, false),
            ("opacity_sum", m.opacity_sum, false),
            ("normal_sum", m.normal_sum, true),
        ] {
            e.signedness(UNIT, name, word, signed);
        }
        let s = &machine.splat;
        let one = Word::new(crate::num::Format::unsigned(1, 0));
        let attributes = [
            one, s.rgb, s.rgb, s.rgb, s.opacity, m.normal, m.normal, m.normal,
        ];
        let words = [
            m.weight_sum,
            m.colour_sum,
            m.colour_sum,
            m.colour_sum,
            m.opacity_sum,
            m.normal_sum,
            m.normal_sum,
            m.normal_sum,
        ];
        // A machine whose pixels hold a composite only has no slots, and no sums but those of a
        // contribution, to which nothing is added.
        let composite = m.composite();
        let built = |lane: usize| u32::from(composite.is_none() || lane < OPACITY);
        let slots = u32::from(composite.is_none());
        let products: [Exact; SUMS] = std::array::from_fn(|lane| {
            if lane == WEIGHT {
                machine.gauss.weight.into()
            } else {
                e.copies(built(lane), |e| {
                    e.per_lane(|e| e.times(UNIT, machine.gauss.weight, attributes[lane]))
                })
            }
        });
        let sums: [Fit; SUMS] = std::array::from_fn(|lane| {
            e.per_lane(|e| {
                let terms = [products[lane], words[lane].into()];
                let sum = e.copies(slots, |e| e.sum(UNIT, terms));
                e.copies(built(lane), |e| {
                    e.fit(UNIT, SUM_SIGNALS[lane], words[lane], sum)
                })
            })
        });
        let slot = machine.fragment_bits();
        e.per_lane(|e| {
            // All slots, as read and as written.
            e.copies(2 * layers as u32, |e| {
                e.part(UNIT, Operator::Register(slot))
            });
            // A pixel that was read is held until it leaves the unit.
            e.copies(layers as u32, |e| e.part(UNIT, Operator::Hold(slot)));
            if composite.is_some() {
                // A pixel has one slot, which nothing is compared with.
            } else if m.sheets.is_some() {
                // A sheet's number is compared with the open one's. Each slot stays, is added to,
                // or is opened.
                e.adders(UNIT, 1, m.depth.format.width());
                e.copies(layers as u32, |e| e.choice(UNIT, 3, slot));
            } else if m.window.is_none() {
                Fragment::sorter(e, machine, layers as u32, slot);
            }
        });
        let align = std::array::from_fn(|lane| {
            let (sum, product) = (words[lane].format.frac_bits, products[lane].frac_bits);
            [
                (product - sum).clamp(0, 62) as u32,
                (sum - product).clamp(0, 62) as u32,
            ]
        });
        let premultiplied = machine.shade.premultiplied;
        let shaded = Exact::from(premultiplied);
        let light = premultiplied.format.width();
        let over = if let Some(word) = composite {
            e.number(UNIT, "composite", word, false);
            e.fixed_point(UNIT, "fragment.sheets.composite", word);
            // The front's opacity is a weight, and the back is a pixel: no more of their bits are
            // other than 0.
            let operands = [word, m.weight_sum].map(|word| word.format.factor_bits().min(light));
            e.per_lane(|e| {
                e.copies(4, |e| {
                    e.multiplier(UNIT, operands, premultiplied.format.is_float());
                    let product = shaded.times(shaded);
                    e.sum(UNIT, [product, shaded])
                })
            })
        } else {
            e.copies(4, |e| {
                let product = e.times(UNIT, premultiplied, premultiplied);
                e.sum(UNIT, [product, shaded])
            })
        };
        // 1 minus the front's opacity; colours of the front, of the back and of the result, shaded
        // earlier or now.
        e.adders(UNIT, 1, light);
        e.copies(2 * 4 * slots, |e| e.choice(UNIT, 2, light));
        e.choice(UNIT, layers as u32, slot);
        // The comparison of Σw·α with the opacity limit times Σw uses 128 bits.
        let limit = Exact::from(m.opaque).times(m.weight_sum);
        let compared = limit.plus(m.opacity_sum).bits();
        e.require(compared <= 126, || {
            format!(
                "fragment.opacity_sum {} is compared with fragment.opaque · fragment.weight_sum in {compared} bits: 126 can be held",
                m.opacity_sum
            )
        });
        let opaque = opaque(machine);
        let (limit_places, opacity_places) = (limit.frac_bits, m.opacity_sum.format.frac_bits);
        let half = sums.map(|fit| fit.half());
        let depth = e.copies(slots, |e| {
            e.per_lane(|e| e.fit(UNIT, "depth", m.depth, depth))
        });
        // The depth farthest from the centre's that a splat reaches.
        let farthest = machine
            .project
            .depth
            .format
            .int_bits
            .max(machine.ellipse.depth_range.format.int_bits)
            + 1;
        let right = align.map(|[right, _]: [u32; 2]| right);
        let mut fragment = Fragment {
            layers,
            full: m.merge.into(),
            evict_hidden: m.evict_hidden,
            nearest_depth: match m.fragment_depth {
                FragmentDepth::First => false,
                FragmentDepth::Nearest => true,
            },
            depth,
            is_depth_natural: depth.is_natural(farthest),
            limits: SumLimits::new(half, right, words),
            narrow: (0..SUMS).all(|lane| {
                fits_32_bits(
                    machine.gauss.weight,
                    attributes[lane],
                    words[lane],
                    &sums[lane],
                )
            }),
            sums,
            align,
            opaque_scales: [
                1 << (limit_places - opacity_places).max(0),
                opaque << (opacity_places - limit_places).max(0),
            ],
            opaque_shaded: -((-opaque << opacity_places) >> m.opaque.format.frac_bits) as i64,
            store: [
                e.copies(3 * slots, |e| {
                    e.fit(UNIT, "colour_sum", m.colour_sum, shaded)
                }),
                e.copies(slots, |e| e.fit(UNIT, "opacity_sum", m.opacity_sum, shaded)),
            ],
            read: [(3, m.colour_sum), (1, m.opacity_sum)].map(|(copies, sum)| {
                let held = composite.unwrap_or(sum);
                e.copies(copies, |e| {
                    e.fit(unit::SHADE, "premultiplied", premultiplied, held)
                })
            }),
            blend: [
                (3, "colour_sum", m.colour_sum),
                (1, "opacity_sum", m.opacity_sum),
            ]
            .map(|(copies, name, sum)| match composite {
                Some(word) => {
                    e.per_lane(|e| e.copies(copies, |e| e.fit(UNIT, "composite", word, over)))
                }
                None => e.copies(copies, |e| e.fit(UNIT, name, sum, over)),
            }),
            premultiplied_frac_bits: premultiplied.format.frac_bits as u32,
            sheets: SheetDatapath::new(e, machine),
            windows: WindowDatapath::new(e, machine),
            weight_frac_bits: machine.gauss.weight.format.frac_bits.max(0) as u32,
        };
        let simple = fragment.is_simple();
        fragment
            .windows
            .iter_mut()
            .for_each(|windows| windows.simple = simple);
        fragment
    }

    /// Finds a contribution's slot, or frees one. All slots and the new fragment are ranked,
    /// because any of them may be evicted.
    fn sorter(e: &mut Elaboration, machine: &Machine, layers: u32, slot: i32) {
        let m = &machine.fragment;
        let (depth, weight) = (m.depth.format.width(), m.weight_sum.format.width());
        let places = layers + 1;
        // |z − z_f| < ε against every slot; the nearest match accumulates.
        e.copies(layers, |e| {
            e.adders(UNIT, 3, depth);
            e.choice(UNIT, 2, depth);
        });
        e.copies(layers - 1, |e| e.limit(UNIT, depth));
        e.choice(UNIT, layers, slot);
        // Pairwise depth comparisons; each place selects one of the slots.
        e.adders(UNIT, places * layers / 2, depth);
        e.copies(places, |e| e.choice(UNIT, places, slot));
        // Tests for an opaque slot: Σw against the threshold, Σw·α against Σw times a constant,
        // which takes one adder less than the constant has digits.
        let limit = Exact::from(m.opaque).times(m.weight_sum).bits();
        e.copies(places, |e| {
            e.adders(UNIT, 1, weight);
            e.adders(UNIT, signed_digits(opaque(machine)), limit);
        });
        // Σw·α of the new fragment is computed before its pixel is read. It is held while a merge
        // holds the unit, as are the two depth limits of a match.
        let s = &machine.splat;
        e.times(UNIT, machine.gauss.weight, s.opacity);
        let fresh = [
            machine.gauss.weight,
            m.depth,
            m.depth,
            m.depth,
            s.rgb,
            s.rgb,
            s.rgb,
            s.opacity,
            m.normal,
            m.normal,
            m.normal,
        ];
        e.part(
            UNIT,
            Operator::Hold(fresh.iter().map(|word| word.format.stored_bits()).sum()),
        );
        // Colours of the front, of the back and of the result, of four words each.
        e.copies(3 * 4, |e| {
            e.choice(UNIT, 2, machine.shade.premultiplied.format.stored_bits())
        });
        // Each written slot selects the sums, the merged slot, or the slot that moves there.
        let written = |e: &mut Elaboration, slots: u32, more: u32| {
            e.copies(slots, |e| e.choice(UNIT, 3 + more, slot))
        };
        match FullRule::from(m.merge) {
            // The pair may be anywhere; slots behind it move up by one place.
            FullRule::Merge(MergePair::Nearest) => {
                e.adders(UNIT, layers, depth);
                e.copies(layers - 1, |e| e.limit(UNIT, depth));
                e.choice(UNIT, layers, slot);
                written(e, 1, 0);
                written(e, layers - 1, 1);
            }
            // The pair is fixed by wiring.
            FullRule::Merge(MergePair::Farthest) | FullRule::Replace => written(e, layers, 0),
        }
    }

    /// Whether all fits of its inner loop are simple.
    pub fn is_simple(&self) -> bool {
        let short = |fit: &Fit| fit.is_simple() && fit.places() < 32;
        self.is_depth_natural
            && self.sums.iter().all(short)
            && self.align.iter().all(|[_, left]| *left == 0)
    }

    /// Whether 32-bit sums and products hold everything.
    pub fn is_narrow(&self) -> bool {
        self.narrow
    }

    /// Opacity (`fragment.opacity_sum`) from which a shaded fragment counts as opaque.
    pub fn opaque_shaded(&self) -> i64 {
        self.opaque_shaded
    }

    /// 1/x of windows, `fragment.window.reciprocal`; `None` where fragments are not grouped by
    /// windows.
    pub fn window_reciprocal(&self) -> Option<&Reciprocal> {
        self.windows.as_ref().map(|windows| &windows.reciprocal)
    }

    /// Signals of its sums.
    pub fn sum_signals(&self) -> [usize; SUMS] {
        self.sums.map(|fit| fit.signal)
    }

    /// The fit of a depth.
    pub fn depth_fit(&self) -> &Fit {
        &self.depth
    }

    /// Depths as the comparators use them. Values below 0 differ from 0 for a probe only.
    #[inline(always)]
    pub fn depth<const SIMPLE_FITS: bool, V: Lanes, P: Probe>(
        &self,
        exact: V,
        tap: &mut Tap<P>,
    ) -> V {
        if P::WORDS {
            tap.fit(&self.depth, exact)
        } else {
            tap.fit_unsigned::<SIMPLE_FITS, V>(&self.depth, exact.max(V::splat(0)))
        }
    }

    /// Whether [`Fragment::short_depth`] is exact, for depths below 2^30.
    pub fn is_depth_narrow(&self) -> bool {
        self.depth.is_simple() && self.depth.places() < 31
    }

    /// [`Fragment::depth`] in words of 32 bits, for depths that were clamped at 0 before.
    #[inline(always)]
    pub fn short_depth<W: Words>(&self) -> fit::Natural<W> {
        self.depth.natural()
    }

    /// Adds one contribution to a pixel.
    #[inline(always)]
    pub fn contribute<H: HostPath, P: Probe>(
        &self,
        tile: &mut PackedTile<H::Accumulator>,
        pixel: u8,
        input: Input,
        registers: &FragmentRegisters,
        merging: &mut impl Merging<H::Accumulator, P>,
        tap: &mut Tap<P>,
    ) -> Decision {
        tile.count(pixel);
        let depth = input.depth as i32;
        if let Some(slot) = tile.nearest::<H::Lanes>(pixel, depth, registers.z_threshold as u32) {
            self.accumulate::<H, P>(
                tile.sums_mut(pixel, slot),
                input.weight,
                input.attributes,
                tap,
            );
            if self.nearest_depth {
                tile.bring_nearer(pixel, slot, depth);
            }
            return Decision::Accumulated(slot as u8);
        }
        let mut fresh = PackedSlot {
            sums: PackedSums::default(),
            key: depth,
            material: *input.material,
        };
        self.accumulate::<H, P>(&mut fresh.sums, input.weight, input.attributes, tap);
        if tile.live(pixel) < self.layers {
            return Decision::Inserted(tile.open(pixel, fresh));
        }
        self.overflow(tile, pixel, &fresh, registers, merging, tap.probe)
    }

    #[inline(always)]
    fn accumulate<H: HostPath, P: Probe>(
        &self,
        sums: &mut PackedSums<H::Accumulator>,
        weight: i64,
        attributes: &Attributes,
        tap: &mut Tap<P>,
    ) {
        if H::SIMPLE_FITS && (!P::WORDS || P::EIGHT) {
            let before = *sums;
            let limits = H::Accumulator::limits(&self.limits);
            match H::Accumulator::accumulate::<H::Lanes>(sums, attributes, weight, limits) {
                Some(seen) if P::WORDS => return tap.probe.sums(seen),
                _ if !P::WORDS => return,
                _ => *sums = before,
            }
        }
        self.accumulate_one_by_one(sums, weight, attributes, tap);
    }

    fn accumulate_one_by_one<A: Accumulator, P: Probe>(
        &self,
        sums: &mut PackedSums<A>,
        weight: i64,
        attributes: &Attributes,
        tap: &mut Tap<P>,
    ) {
        for (lane, sum) in sums.0.iter_mut().enumerate() {
            let [of_sum, of_product] = self.align[lane];
            let exact =
                (sum.get() << of_sum) + ((i64::from(attributes[lane]) * weight) << of_product);
            *sum = A::put(tap.fit_one(&self.sums[lane], exact));
        }
    }

    /// Handles one fragment too many: replace, evict or merge.
    #[cold]
    #[inline(never)]
    fn overflow<A: Accumulator, P: Probe>(
        &self,
        tile: &mut PackedTile<A>,
        pixel: u8,
        fresh: &PackedSlot<A>,
        registers: &FragmentRegisters,
        merging: &mut impl Merging<A, P>,
        probe: &mut P,
    ) -> Decision {
        let pair = match self.full {
            FullRule::Replace => return replace(tile, pixel, fresh),
            FullRule::Merge(pair) => pair,
        };
        merging.settle(self, tile, pixel, probe);
        // After the first overflow the slots stay in depth order.
        tile.sort(pixel, self.layers);
        // Stable: the new fragment comes after its equals.
        let place = tile.place(pixel, self.layers, fresh.key);
        if self.evict_hidden && self.hides(tile, pixel, fresh, place, registers) {
            if place < self.layers {
                (place..self.layers - 1)
                    .rev()
                    .for_each(|slot| tile.copy(pixel, slot, slot + 1));
                tile.write(pixel, place, *fresh);
            }
            return Decision::Evicted(place == self.layers);
        }
        let stacked = |position: usize, tile: &PackedTile<A>| match position.cmp(&place) {
            Ordering::Less => tile.read(pixel, position),
            Ordering::Equal => *fresh,
            Ordering::Greater => tile.read(pixel, position - 1),
        };
        let front = self.front_of_pair(pair, |position| stacked(position, tile).depth());
        let pair = [stacked(front, tile), stacked(front + 1, tile)].map(|fragment| fragment.get());
        // The slots between the pair and the place of the new fragment move by one.
        if place < front {
            (place..front - 1)
                .rev()
                .for_each(|slot| tile.copy(pixel, slot, slot + 1));
            tile.write(pixel, place, *fresh);
        } else if place > front + 1 {
            (front + 2..place).for_each(|slot| tile.copy(pixel, slot, slot - 1));
            tile.write(pixel, place - 1, *fresh);
        }
        merging.merge(self, tile, (pixel, front), &pair, probe);
        Decision::Merged(front as u8, front as u8 + 1)
    }

    /// Whether one of the fragments, including the new one at its place, hides the deepest.
    #[inline(always)]
    fn hides<A: Accumulator>(
        &self,
        tile: &PackedTile<A>,
        pixel: u8,
        fresh: &PackedSlot<A>,
        place: usize,
        registers: &FragmentRegisters,
    ) -> bool {
        let in_front = self.layers - usize::from(place < self.layers);
        (0..in_front)
            .any(|slot| self.is_opaque(tile.sums(pixel, slot), tile.key(pixel, slot), registers))
            || place < self.layers && self.is_opaque(&fresh.sums, fresh.key, registers)
    }

    /// The nearer of the two to merge, in a stack in depth order.
    fn front_of_pair(&self, pair: MergePair, depth: impl Fn(usize) -> i32) -> usize {
        match pair {
            // The first among equal gaps: the pair nearer to the eye.
            MergePair::Nearest => (0..self.layers)
                .min_by_key(|&i| depth(i + 1) - depth(i))
                .unwrap_or(0),
            MergePair::Farthest => self.layers - 1,
        }
    }

    /// Whether a fragment hides everything behind it: it is opaque and covers the pixel.
    #[inline(always)]
    fn is_opaque<A: Accumulator>(
        &self,
        sums: &PackedSums<A>,
        key: i32,
        registers: &FragmentRegisters,
    ) -> bool {
        let [weight, opacity] = [sums.0[WEIGHT].get(), sums.0[OPACITY].get()];
        if key < 0 {
            return opacity >= self.opaque_shaded;
        }
        let [of_opacity, of_weight] = self.opaque_scales;
        weight >= registers.coverage_threshold
            && i128::from(opacity) * of_opacity >= i128::from(weight) * of_weight
    }

    /// Front over back, at the front's depth.
    pub fn merged<P: Probe>(
        &self,
        front: &Slot,
        back: &Slot,
        shade: impl Fn(&Slot, &mut Tap<P>) -> Premultiplied,
        tap: &mut Tap<P>,
    ) -> Slot {
        let light = |fragment: &Slot, tap: &mut Tap<P>| {
            if fragment.shaded {
                return self.shaded(fragment, tap);
            }
            // A shaded fragment is kept in a slot, so the slot's words round it before the blend
            // and after it.
            let Premultiplied { colour, opacity } = shade(fragment, tap);
            let mut stored = *fragment;
            for (channel, colour) in colour.into_iter().enumerate() {
                stored.sums[COLOUR + channel] = tap.fit_one(&self.store[0], colour);
            }
            stored.sums[OPACITY] = tap.fit_one(&self.store[1], opacity);
            self.shaded(&stored, tap)
        };
        let (over, under) = (light(front, tap), light(back, tap));
        Slot {
            sums: self.blended(&over, &under, tap),
            depth: front.depth,
            material: front.material,
            shaded: true,
        }
    }

    /// Front over back.
    fn blended<P: Probe>(
        &self,
        over: &Premultiplied,
        under: &Premultiplied,
        tap: &mut Tap<P>,
    ) -> Sums {
        let one = 1 << self.premultiplied_frac_bits;
        let blend = |over: i64, under: i64, front: i64| {
            (over << self.premultiplied_frac_bits) + under * (one - front)
        };
        let mut sums = [0; SUMS];
        for channel in 0..3 {
            let exact = blend(over.colour[channel], under.colour[channel], over.opacity);
            sums[COLOUR + channel] = tap.fit_one(&self.blend[0], exact);
        }
        sums[OPACITY] = tap.fit_one(
            &self.blend[1],
            blend(over.opacity, under.opacity, over.opacity),
        );
        sums
    }

    /// One splat, of weight 1 and opaque, as a fragment: splats are lit with it before they are
    /// drawn.
    pub fn emitting<P: Probe>(
        &self,
        rgb: [i32; 3],
        normal: [i32; 3],
        material: u32,
        tap: &mut Tap<P>,
    ) -> Slot {
        let attributes: Attributes = [
            1, rgb[0], rgb[1], rgb[2], 0, normal[0], normal[1], normal[2],
        ];
        let mut sums = [0; SUMS];
        for (lane, sum) in sums.iter_mut().enumerate() {
            let [_, of_product] = self.align[lane];
            *sum = tap.fit_one(
                &self.sums[lane],
                (i64::from(attributes[lane]) << self.weight_frac_bits) << of_product,
            );
        }
        sums[OPACITY] = self.sums[OPACITY].word.format.one();
        Slot {
            sums,
            depth: 0,
            material,
            shaded: false,
        }
    }

    /// Whether each sum is a word of at most 32 bits, sign included.
    pub fn has_narrow_sums(&self) -> bool {
        self.sums.iter().all(|fit| {
            let format = fit.word.format;
            format.width() + i32::from(!format.signed) <= 32
        })
    }

    /// The sums of eight such splats, where they are narrow.
    #[inline(always)]
    pub fn emitting_lanes<W: Words, P: Probe>(
        &self,
        [r, g, b]: [W; 3],
        [x, y, z]: [W; 3],
        tap: &mut Tap<P>,
    ) -> [W; SUMS] {
        let attributes = [W::splat(1), r, g, b, W::splat(0), x, y, z];
        let mut sums = [W::splat(0); SUMS];
        for (lane, sum) in sums.iter_mut().enumerate() {
            let [_, of_product] = self.align[lane];
            let exact = attributes[lane].exact();
            *sum = tap.fit_words(
                &self.sums[lane],
                exact.left(self.weight_frac_bits + of_product),
            );
        }
        sums[OPACITY] = W::splat(self.sums[OPACITY].word.format.one());
        sums
    }

    /// Reads a shaded slot.
    pub fn shaded<P: Probe>(&self, fragment: &Slot, tap: &mut Tap<P>) -> Premultiplied {
        let s = &fragment.sums;
        Premultiplied {
            colour: three!(channel => tap.fit_one(&self.read[0], s[COLOUR + channel])),
            opacity: tap.fit_one(&self.read[1], s[OPACITY]),
        }
    }
}

/// Depth buffer: the nearer of the two fragments stays.
fn replace<A: Accumulator>(tile: &mut PackedTile<A>, pixel: u8, fresh: &PackedSlot<A>) -> Decision {
    if fresh.key < tile.depth(pixel, 0) {
        tile.write(pixel, 0, *fresh);
        return Decision::Replaced;
    }
    Decision::Dropped
}

pub mod real;
pub mod sheets;
pub mod window;

#[cfg(test)]
mod tests;

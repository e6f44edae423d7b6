//! Window: keeps at most `layers` slots per pixel as clusters of depth, and groups them into
//! windows of ε as late as possible (docs/book/algorithm-resolve.md §11).
//!
//! ```text
//! weight, depth, attributes ─►[ 1 a cluster spans it? ]─ yes ─► accumulate
//!              light, density ─►[ 2 its surface closed? ]─ yes ─► late: over the front, under the back; or inside
//!                               [ 3 slot free?          ]─ yes ─► insert, in the order of nearest depths
//!                               [ 4 windows: 1/max(W, τ), T ]──► 5 evict the deepest if T is 0
//!                                                               6 sum the cheapest pair narrower than ε
//!                                               shade ◄──────── 7 close the two deepest: one over or inside the other
//! ```
//! An open slot holds sums, the least and greatest depth, and Σw·z. A closed slot holds a
//! premultiplied colour, the depths and weights of its front part and its back part, TF (seen
//! behind the front) and TB (seen before the back). Depths and costs are compared exactly.
//!
//! Losses: words written into a slot are rounded once, by the fits of sums and of TF, TB. T, β and
//! the mean of a splat inside have their own words.
//!
//! Laws (tests/windows.rs of the program): `every_option_is_drawn_within_its_bound`,
//! `in_mixed_precision_it_is_golden_and_the_machine`.

use super::{
    Attributes, COLOUR, Decision, Fragment, FragmentRegisters, MAX_LAYERS, NORMAL, OPACITY,
    Premultiplied, SUM_SIGNALS, SUMS, Side, Slot, Sums, TILE_AREA, UNIT, WEIGHT,
};
use crate::elaboration::latency::Path;
use crate::elaboration::{Elaboration, Operator};
use crate::frame;
use crate::functions::{Reciprocal, Table, reciprocal, table};
use crate::kernels::{Accumulator, PackedSums};
use crate::machine::{Group, Machine, TableShape};
use crate::num::lanes::Plain;
use crate::num::{Exact, Fit, Word, align, three};
use crate::probe::{Probe, Tap};
use crate::records::Layer;
use crate::records::unit;
use std::array::from_fn;
use std::ops::{Mul, Shl};

/// Sums in which a closed slot keeps Wh, TF and TB: those of the normal.
const BACK_WEIGHT: usize = NORMAL;
const BEHIND_FRONT: usize = NORMAL + 1;
const BEFORE_BACK: usize = NORMAL + 2;

/// T is 2^−n for this n, 0 to 8; `None` for T = 0.
type Visibility = Option<u32>;
/// T below 2^−8 counts as 0.
const LEAST_SEEN: u32 = 8;

/// Input port: one contribution.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// w (`gauss.weight`).
    pub weight: i64,
    /// z (`fragment.depth`).
    pub depth: i64,
    /// Attributes of the splat.
    pub attributes: &'a Attributes,
    /// Index into the frame's materials.
    pub material: u32,
    /// The splat's own colour under the lights (`splat.rgb`).
    pub light: [i32; 3],
    /// −2·ln(1 − min(α, 0.95)) (`fragment.window.density`).
    pub density: i32,
}

/// Registers that a frame loads, and its tables.
#[derive(Clone, Debug)]
pub struct WindowRegisters {
    /// ε and τ.
    pub thresholds: FragmentRegisters,
    /// Limit of a cluster's width: a contribution joins only below it (`fragment.depth`).
    pub reach: i64,
    /// −2·ln(1 − min(α, 0.95)).
    pub density: Table,
    /// 1 − e^(−x).
    pub hidden: Table,
}

/// One slot of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cluster {
    /// Sums. In a closed slot Wl, the premultiplied colour and opacity, Wh, TF, TB.
    pub sums: Sums,
    /// Σw·z (`fragment.window.depth_sum`) of an open slot.
    pub depth_sum: i64,
    /// Nearest and farthest depth of the front part.
    pub front: [i64; 2],
    /// Nearest and farthest depth of the back part.
    pub back: [i64; 2],
    /// Index into the frame's materials.
    pub material: u32,
    /// Whether the slot is closed.
    pub closed: bool,
}

impl Cluster {
    /// lo.
    pub fn near(&self) -> i64 {
        self.front[0]
    }

    /// hi.
    pub fn far(&self) -> i64 {
        self.back[1]
    }

    fn slot(&self) -> Slot {
        Slot {
            sums: self.sums,
            depth: self.near(),
            material: self.material,
            shaded: self.closed,
        }
    }

    fn span(&mut self, near: i64, far: i64) {
        let span = [self.near().min(near), self.far().max(far)];
        (self.front, self.back) = (span, span);
    }

    /// Whether it has an inside that contains this closed slot.
    fn encloses(&self, other: &Cluster) -> bool {
        self.front[1] < other.near() && other.far() < self.back[1]
    }
}

/// Slots of a tile's pixels, each pixel with one spare slot.
#[derive(Clone, Debug)]
pub struct Clusters(Box<[[Cluster; MAX_LAYERS + 1]; TILE_AREA]>);

impl Default for Clusters {
    fn default() -> Self {
        Clusters(Box::new([[Cluster::default(); MAX_LAYERS + 1]; TILE_AREA]))
    }
}

impl Clusters {
    /// Slots of a pixel, with the spare slot.
    #[inline(always)]
    pub fn of(&mut self, pixel: u8) -> &mut [Cluster; MAX_LAYERS + 1] {
        &mut self.0[usize::from(pixel)]
    }
}

/// Result of step 4 for one slot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Window {
    /// Place at which its window starts.
    pub first: usize,
    /// Nearest depth of its window.
    pub start: i64,
    /// T: fraction of it that is seen through the windows before it.
    pub seen: Visibility,
}

/// Parts of the unit that only windows use.
#[derive(Clone, Debug)]
pub(super) struct WindowDatapath {
    interval: bool,
    late: bool,
    inside: bool,
    depth_sum: Fit,
    /// Sums of two slots.
    pub(super) sums: [Fit; SUMS],
    pub(super) depth_of_two: Fit,
    /// Whether 63 bits hold all compared values.
    narrow: bool,
    /// Whether [`Fragment::is_simple`].
    pub(super) simple: bool,
    /// Left shifts that align Σw·z with w·z.
    depth_align: [u32; 2],
    /// Left shifts that align Σw·z with Σw times a depth, for comparison.
    mean_align: [u32; 2],
    pub(super) reciprocal: Reciprocal,
    /// Numerators of the opacity of a window, of β, and of the loss of a closed slot's colour.
    pub(super) shares: [Fit; 3],
    pub(super) part: Fit,
    /// (1 − A)·β.
    pub(super) under: Fit,
    /// T after one more factor: an opacity, or TF.
    pub(super) through: [Fit; 2],
    /// 1 − A as TF.
    pub(super) rest: Fit,
    /// TF or TB times 1 − β, times 1 − A.
    pub(super) dimmed: [Fit; 2],
    pub(super) index: Fit,
    pub(super) hidden: Fit,
    pub(super) density: Fit,
    /// A splat inside: opacity and colour.
    pub(super) splat: [Fit; 2],
    /// A late contribution over the front: colour and opacity; under the back; inside.
    pub(super) over: [Fit; 2],
    pub(super) beneath: [Fit; 2],
    pub(super) within: [Fit; 2],
    density_shape: TableShape,
    hidden_shape: TableShape,
    opacity_bits: u32,
    /// Integer bits of the range of the density table.
    opacity_range: i32,
    index_bits: u32,
    frac: Fractions,
}

/// Fraction bits of values that are aligned.
#[derive(Clone, Copy, Debug)]
struct Fractions {
    light: i32,
    shaded: i32,
    part: i32,
    through: i32,
    weight: i32,
    opacity: i32,
}

/// Critical path after its match of a contribution that overflows the pixel or joins a closed slot:
/// the longer of the two.
///
/// Windows: opacities by one reciprocal, one slot per cycle, T, and the cost of a sum. Inside:
/// weight times density, the table, the splat's own light, its visible part, the reciprocal, and
/// the blend. A late contribution has a shorter path.
pub fn overflow_path(machine: &Machine) -> Path {
    let m = &machine.fragment;
    let Some(words) = &m.window else {
        return Path::default();
    };
    let bits = |word: Word| word.format.width();
    let (share, through, part, light) = (
        bits(words.share),
        bits(words.through),
        bits(words.part),
        bits(machine.splat.rgb),
    );
    let inverse = words.reciprocal.bits.min(64) as i32;
    let divide = reciprocal::path(words.reciprocal, bits(m.weight_sum)).product(share, inverse);
    // T passes from slot to slot, one slot per cycle.
    let slots = Path {
        cycles: 1,
        ..Path::default().product(part, through)
    }
    .times(m.layers);
    let windows = divide
        .then(slots)
        .product(part, through)
        .sum(part)
        .product(bits(m.weight_sum), part)
        .sum(bits(m.weight_sum));
    let inside = Path::default()
        .product(bits(machine.gauss.weight), bits(words.density))
        .then(table::path(words.hidden_table, bits(words.hidden)))
        .product(light, bits(words.hidden))
        .product(light, through)
        .then(divide)
        .product(bits(m.colour_sum), share)
        .sum(bits(m.colour_sum));
    if words.inside {
        windows.parallel(inside)
    } else {
        windows
    }
}

/// Logic of forming windows in the one cycle of a slot: T of the next slot.
pub fn slot(machine: &Machine) -> Path {
    let Some(words) = &machine.fragment.window else {
        return Path::default();
    };
    let [part, through] = [words.part, words.through].map(|word| word.format.width());
    Path::default()
        .product(part, through)
        .fit(through)
        .choose(2)
}

/// Cycles of that path. Its steps are sequenced, one slot per cycle, so every operator has its
/// registers.
pub fn overflow_cycles(machine: &Machine) -> u32 {
    overflow_path(machine).registered_at(&machine.timing)
}

impl WindowDatapath {
    pub(super) fn new(e: &mut Elaboration, machine: &Machine) -> Option<Self> {
        let m = &machine.fragment;
        if m.group == Group::First {
            e.require(m.window.is_none(), || {
                "fragment.window has words of windows, but fragment.group is first: use interval or window, or leave them out".into()
            });
            return None;
        }
        let Some(words) = &m.window else {
            e.require(false, || {
                "fragment.group is not first and fragment.window, its words, is missing".into()
            });
            return None;
        };
        e.require(m.sheets.is_none(), || {
            "fragment.sheets groups by sheets, and fragment.group by windows: one of them".into()
        });
        let cycles = overflow_cycles(machine);
        e.require(machine.timing.fragment.merge >= cycles, || {
            format!("timing.fragment.merge is {}, but to form windows and to blend takes {cycles} cycles", machine.timing.fragment.merge)
        });
        e.within(UNIT, "window.join_permille", words.join_permille, 0, 1000);
        for (name, word) in [
            ("window.share", words.share),
            ("window.part", words.part),
            ("window.through", words.through),
        ] {
            e.number(UNIT, name, word, false);
            e.holds_one(UNIT, name, word);
            e.fixed_point(UNIT, name, word);
        }
        for (name, word) in [
            ("weight_sum", m.weight_sum),
            ("colour_sum", m.colour_sum),
            ("opacity_sum", m.opacity_sum),
            ("normal_sum", m.normal_sum),
            ("window.depth_sum", words.depth_sum),
        ] {
            e.fixed_point(UNIT, name, word);
        }
        for (name, word) in [
            ("window.density", words.density),
            ("window.exponent", words.exponent),
            ("window.hidden", words.hidden),
        ] {
            e.number(UNIT, name, word, false);
            e.fixed_point(UNIT, name, word);
        }
        e.holds_one(UNIT, "window.hidden", words.hidden);
        e.signedness(UNIT, "window.depth_sum", words.depth_sum, false);
        let (weight, shaded, light) =
            (m.weight_sum, machine.shade.premultiplied, machine.splat.rgb);
        let layers = m.layers;
        let places = layers + 1;
        let depth_bits = m.depth.format.width();

        // 1, 2: gaps and widths against both ends of every slot, and of both parts; the nearest.
        e.per_lane(|e| {
            e.copies(2 * layers, |e| {
                e.adders(UNIT, 4, depth_bits);
                e.choice(UNIT, 4, depth_bits);
                e.limit(UNIT, depth_bits);
            });
            e.choice(UNIT, layers, machine.fragment_bits());
            // 3: pairwise comparisons; each place selects one slot.
            e.adders(UNIT, places * layers / 2, depth_bits);
            e.copies(places, |e| e.choice(UNIT, places, machine.fragment_bits()));
            e.copies(layers, |e| e.choice(UNIT, 4, machine.fragment_bits()));
            // 6: both slots of a pair; the slots behind it move up.
            e.copies(2, |e| e.choice(UNIT, places, machine.fragment_bits()));
            e.copies(layers, |e| e.choice(UNIT, 2, machine.fragment_bits()));
        });
        let product = e.per_lane(|e| e.times(UNIT, machine.gauss.weight, m.depth));
        let depth_sum = e.per_lane(|e| {
            let sum = e.sum(UNIT, [product, words.depth_sum.into()]);
            e.fit(UNIT, "window.depth_sum", words.depth_sum, sum)
        });
        // 4: whether the next slot joins, for every slot that may start the window: Σw·z against Σw
        // times the end of that window.
        let ends = e.copies(layers, |e| e.times(UNIT, weight, m.depth));
        e.copies(layers, |e| e.sum(UNIT, [ends, words.depth_sum.into()]));
        let mean_align = align([words.depth_sum.format.frac_bits, ends.frac_bits]);
        e.holds_exact(
            "fragment.weight_sum · fragment.depth, to compare it with fragment.window.depth_sum,",
            ends.plus(words.depth_sum),
        );
        // Opacities: sums of up to nine slots, over max(W, τ).
        let sum_words = [
            m.weight_sum,
            m.colour_sum,
            m.colour_sum,
            m.colour_sum,
            m.opacity_sum,
            m.normal_sum,
            m.normal_sum,
            m.normal_sum,
        ];
        let mut of_two = |name: &str, word: Word| {
            let sum = e.sum(UNIT, [word.into(), word.into()]);
            e.fit(UNIT, name, word, sum)
        };
        let sums = from_fn(|lane| of_two(SUM_SIGNALS[lane], sum_words[lane]));
        let depth_of_two = of_two("window.depth_sum", words.depth_sum);
        let reciprocal = Reciprocal::new(e, UNIT, "window.reciprocal", words.reciprocal, 0);
        e.normaliser(UNIT, weight.format.width());
        let nine = |word: Word| Exact {
            int_bits: Exact::from(word).int_bits + 4,
            ..word.into()
        };
        e.copies(layers, |e| {
            e.adders(UNIT, 1, nine(weight).bits());
            e.adders(UNIT, 1, nine(m.opacity_sum).bits());
        });
        let alpha = machine.splat.opacity;
        let late = e.copies(2, |e| e.times(UNIT, alpha, weight));
        let lost = e.times(UNIT, shaded, words.through);
        let inverse = words.reciprocal.format();
        let divided = e.times(UNIT, words.share, inverse);
        let shares = [nine(m.opacity_sum), late, lost]
            .map(|from| e.fit_shifted(UNIT, "window.share", words.share, from));
        e.limit(UNIT, words.part.format.width());
        let part = e.fit(UNIT, "window.part", words.part, divided);
        // T: after a window, and behind a closed slot.
        let by_part = e.copies(places, |e| e.times(UNIT, words.through, words.part));
        // For each place and each closed slot before it.
        let by_through = e.copies(places * layers / 2, |e| {
            e.times(UNIT, words.through, words.through)
        });
        e.adders(UNIT, layers, shaded.format.width());
        let through =
            [by_part, by_through].map(|from| e.fit(UNIT, "window.through", words.through, from));
        // 6: u·(ε + hi − start), shifted by T; the least. Intervals are summed only when complete.
        e.copies(if m.group == Group::Window { layers } else { 0 }, |e| {
            let cost = e.times(UNIT, m.depth, m.depth);
            e.adders(UNIT, 4, depth_bits);
            e.shifter(UNIT, cost.bits() + LEAST_SEEN as i32);
            e.limit(UNIT, cost.bits() + LEAST_SEEN as i32);
        });
        // 2, 7: colours, of three channels and opacity.
        let rest = e.fit(UNIT, "window.through", words.through, shaded);
        let dimmed = [
            e.copies(2, |e| e.times(UNIT, words.through, words.part)),
            e.times(UNIT, words.through, shaded),
        ]
        .map(|from| e.fit(UNIT, "window.through", words.through, from));
        let lit = e.copies(3, |e| e.times(UNIT, words.part, light));
        let kept = e.copies(4, |e| e.times(UNIT, words.part, shaded));
        let seen = e.copies(3, |e| e.times(UNIT, words.through, shaded));
        let hid = e.times(UNIT, shaded, shaded);
        let mut written = |colour: Exact, opacity: Exact| {
            [
                e.copies(3, |e| e.fit(UNIT, "colour_sum", m.colour_sum, colour)),
                e.fit(UNIT, "opacity_sum", m.opacity_sum, opacity),
            ]
        };
        let over = written(lit.plus(kept), kept.plus(words.part));
        let beneath = written(lit.plus(shaded), Exact::from(shaded).plus(words.part));
        let within = written(seen.plus(kept).plus(shaded), hid.plus(shaded));
        e.adders(UNIT, 8, kept.bits());
        let under = e.fit(UNIT, "window.part", words.part, kept);
        let opacity_bits = alpha.format.width();
        let density_shape = table::shape(
            e,
            UNIT,
            "window.density_table",
            words.density_table,
            opacity_bits,
        );
        let density_bits = Table::fraction_bits(density_shape.index_bits, opacity_bits as u32);
        e.part(
            UNIT,
            Operator::Rom([1 << density_shape.index_bits, words.density.format.width()]),
        );
        table::interpolator(e, UNIT, density_shape, words.density, density_bits);
        let exponent = e.times(UNIT, machine.gauss.weight, words.density);
        let index_bits = words.exponent.format.width();
        let hidden_shape = table::shape(
            e,
            UNIT,
            "window.hidden_table",
            words.hidden_table,
            index_bits,
        );
        let hidden_bits = Table::fraction_bits(hidden_shape.index_bits, index_bits as u32);
        e.part(
            UNIT,
            Operator::Rom([1 << hidden_shape.index_bits, words.hidden.format.width()]),
        );
        table::interpolator(e, UNIT, hidden_shape, words.hidden, hidden_bits);
        let coloured = e.copies(3, |e| e.times(UNIT, light, shaded));
        let depth_align = align([words.depth_sum.format.frac_bits, product.frac_bits]);
        Some(WindowDatapath {
            interval: m.group == Group::Interval,
            late: words.late,
            inside: words.inside,
            depth_sum,
            sums,
            depth_of_two,
            depth_align,
            mean_align,
            narrow: {
                let means = words.depth_sum.format.width() + mean_align[0] as i32;
                let ends = weight.format.width() + depth_bits + 1 + mean_align[1] as i32;
                // The product of two widths of up to three ranges, shifted by up to LEAST_SEEN
                // places.
                means.max(ends).max(2 * depth_bits + 3 + LEAST_SEEN as i32) < 63
            },
            simple: false,
            reciprocal,
            shares,
            part,
            under,
            through,
            rest,
            dimmed,
            index: e.fit(UNIT, "window.exponent", words.exponent, exponent),
            hidden: e.fit(
                UNIT,
                "window.hidden",
                words.hidden,
                table::interpolated(words.hidden, hidden_bits),
            ),
            density: e.fit(
                UNIT,
                "window.density",
                words.density,
                table::interpolated(words.density, density_bits),
            ),
            splat: [
                e.fit(unit::SHADE, "premultiplied", shaded, words.hidden),
                e.copies(3, |e| e.fit(unit::SHADE, "premultiplied", shaded, coloured)),
            ],
            over,
            beneath,
            within,
            density_shape,
            hidden_shape,
            opacity_bits: opacity_bits as u32,
            opacity_range: alpha.format.int_bits,
            index_bits: index_bits as u32,
            frac: Fractions {
                light: light.format.frac_bits,
                shaded: shaded.format.frac_bits,
                part: words.part.format.frac_bits,
                through: words.through.format.frac_bits,
                weight: weight.format.frac_bits,
                opacity: alpha.format.frac_bits,
            },
        })
    }
}

/// The rule, and the frame's registers.
#[derive(Clone, Copy)]
struct Rule<'a> {
    fragment: &'a Fragment,
    own: &'a WindowDatapath,
    registers: &'a WindowRegisters,
}

impl Rule<'_> {
    /// ε.
    fn epsilon(&self) -> i64 {
        self.registers.thresholds.z_threshold
    }

    /// 1: the open slot that a depth joins; the first among equally near slots.
    fn taker(&self, z: i64, slots: &[Cluster]) -> Option<usize> {
        let reach = if self.own.interval {
            self.epsilon()
        } else {
            self.registers.reach
        };
        let mut nearest: Option<(i64, usize)> = None;
        for (place, slot) in slots.iter().enumerate().filter(|(_, slot)| !slot.closed) {
            let span = [slot.near(), slot.far()];
            let gap = gap(span, z);
            let joins = gap == 0 || width_with(span, z) < reach;
            if joins && nearest.is_none_or(|(least, _)| gap < least) {
                nearest = Some((gap, place));
            }
        }
        nearest.map(|(_, place)| place)
    }

    /// 2: the closed slot, and its side, for which a depth is late. Among equally near ones it is
    /// the first, and its front before its back.
    fn late_for(&self, z: i64, slots: &[Cluster]) -> Option<(usize, Side)> {
        let closed = slots.iter().enumerate().filter(|(_, slot)| slot.closed);
        let parts = closed.flat_map(|(place, slot)| {
            [
                (place, Side::Front, slot.front),
                (place, Side::Back, slot.back),
            ]
        });
        let near = parts.filter(|(.., part)| width_with(*part, z) < self.epsilon());
        near.min_by_key(|(.., part)| gap(*part, z))
            .map(|(place, side, _)| (place, side))
    }

    /// Whether a slot belongs to the window that starts at a depth.
    fn joins(&self, start: i64, slot: &Cluster) -> bool {
        let (end, weight) = (start + self.epsilon(), slot.sums[WEIGHT]);
        let [of_mean, of_end] = self.own.mean_align;
        if slot.closed {
            false
        } else if weight <= 0 {
            slot.near() < end
        } else if self.own.narrow {
            slot.depth_sum << of_mean < (weight * end) << of_end
        } else {
            i128::from(slot.depth_sum) << of_mean < (i128::from(weight) * i128::from(end)) << of_end
        }
    }

    /// Quotient of non-negative words, at most 1. `frac_bits` is the number of fraction bits of the
    /// denominator beyond those of the numerator's fit.
    fn quotient<P: Probe>(
        &self,
        [numerator, denominator]: [i64; 2],
        frac_bits: i32,
        share: &Fit,
        tap: &mut Tap<P>,
    ) -> i64 {
        let one = self.own.part.word.format.one();
        if numerator <= 0 {
            return 0;
        }
        if denominator <= 0 {
            return one;
        }
        let (inverse, exponent) = self.own.reciprocal.one(denominator, tap);
        let share = tap.fit_one_shifted(share, numerator, -(exponent + i64::from(frac_bits)));
        tap.fit_one(&self.own.part, share * inverse).min(one)
    }

    /// Opacity of sums: Σw·α/max(W, τ).
    fn opacity<P: Probe>(&self, [weight, opacity]: [i64; 2], tap: &mut Tap<P>) -> i64 {
        let whole = weight.max(self.registers.thresholds.coverage_threshold);
        self.quotient(
            [opacity, whole],
            self.own.frac.weight,
            &self.own.shares[0],
            tap,
        )
    }

    /// 1 − A of a closed slot, as TF.
    fn rest<P: Probe>(&self, light: &Premultiplied, tap: &mut Tap<P>) -> i64 {
        tap.fit_one(&self.own.rest, self.one() - light.opacity)
            .max(0)
    }

    /// 1 as a shaded word.
    fn one(&self) -> i64 {
        1 << self.own.frac.shaded
    }

    fn read<P: Probe>(&self, slot: &Cluster, tap: &mut Tap<P>) -> Premultiplied {
        self.fragment.shaded(&slot.slot(), tap)
    }

    /// 4: the window of each slot, in order of nearest depth, and the slot's T.
    fn windows<P: Probe>(&self, slots: &[Cluster], tap: &mut Tap<P>) -> [Window; MAX_LAYERS + 1] {
        let mut windows = [Window::default(); MAX_LAYERS + 1];
        let own = self.own;
        let (one, part_one) = (own.through[0].word.format.one(), own.part.word.format.one());
        // The window that may still grow: its first place, its start, Σw and Σw·α.
        let mut growing: Option<(usize, i64, [i64; 2])> = None;
        let mut through = one;
        for (place, slot) in slots.iter().enumerate() {
            let joined = growing.filter(|(_, start, _)| self.joins(*start, slot));
            if let (None, Some((_, _, sums))) = (joined, growing.take()) {
                let opacity = self.opacity(sums, tap);
                through = tap.fit_one(&own.through[0], through * (part_one - opacity));
            }
            let (first, start, [weight, opacity]) = joined.unwrap_or((place, slot.near(), [0; 2]));
            if !slot.closed {
                growing = Some((
                    first,
                    start,
                    [weight + slot.sums[WEIGHT], opacity + slot.sums[OPACITY]],
                ));
            }
            let mut seen = through;
            for before in slots[..place].iter().filter(|before| before.closed) {
                let behind = if slot.near() < before.far() {
                    before.sums[BEHIND_FRONT]
                } else {
                    self.rest(&self.read(before, tap), tap)
                };
                seen = tap.fit_one(&own.through[1], seen * behind);
            }
            windows[place] = Window {
                first,
                start,
                seen: self.places_below(seen, one),
            };
        }
        windows
    }

    /// Bit length of `one` less that of `part`: about −log2(part/one). `None` for an invisible part.
    fn places_below(&self, part: i64, one: i64) -> Visibility {
        let below = one.leading_zeros() as i32 - part.leading_zeros() as i32;
        let places = (-below).max(0) as u32;
        (part > 0 && places <= LEAST_SEEN).then_some(places)
    }

    /// 6: the front of the pair with the least cost, among the pairs that may be summed. Among
    /// equal costs it is the pair nearer to the eye.
    fn pair_to_sum(&self, slots: &[Cluster], windows: &[Window]) -> Option<usize> {
        if self.own.narrow {
            self.cheapest::<i64>(slots, windows)
        } else {
            self.cheapest::<i128>(slots, windows)
        }
    }

    /// Costs are 2^9·ε times those of RULES: T·u·(ε + hi − start)/(2ε), or T·ε where the two slots
    /// are in different windows.
    fn cheapest<N>(&self, slots: &[Cluster], windows: &[Window]) -> Option<usize>
    where
        N: Copy + Ord + Default + From<i64> + Mul<Output = N> + Shl<u32, Output = N>,
    {
        let epsilon = self.epsilon();
        let mut least: Option<(N, usize)> = None;
        for front in 0..slots.len() - 1 {
            let (a, b) = (&slots[front], &slots[front + 1]);
            let far = a.far().max(b.far());
            let width = far - a.near();
            if a.closed || b.closed || width >= epsilon {
                continue;
            }
            let of_one = windows[front].first == windows[front + 1].first;
            let [one, other] = if of_one {
                [width, epsilon + far - windows[front].start]
            } else {
                [2 * epsilon, epsilon]
            };
            let seen = windows[front].seen.map_or(N::default(), |places| {
                (N::from(one) * N::from(other)) << (LEAST_SEEN - places)
            });
            if least.is_none_or(|(cost, _)| seen < cost) {
                least = Some((seen, front));
            }
        }
        least.map(|(_, front)| front)
    }

    /// 6: one open slot summed with another behind it; the front's material is kept. Sums saturate.
    fn summed<P: Probe>(&self, front: &Cluster, back: &Cluster, tap: &mut Tap<P>) -> Cluster {
        let mut sum = *front;
        for (lane, fit) in self.own.sums.iter().enumerate() {
            sum.sums[lane] = tap.fit_one(fit, front.sums[lane] + back.sums[lane]);
        }
        sum.depth_sum = tap.fit_one(&self.own.depth_of_two, front.depth_sum + back.depth_sum);
        sum.span(back.near(), back.far());
        sum
    }

    /// 7: a slot, shaded once.
    fn closed<P: Probe>(
        &self,
        slot: &Cluster,
        shade: impl Fn(&Slot, &mut Tap<P>) -> Premultiplied,
        tap: &mut Tap<P>,
    ) -> Cluster {
        if slot.closed {
            return *slot;
        }
        let light = shade(&slot.slot(), tap);
        let rest = self.rest(&light, tap);
        let mut closed = Cluster {
            closed: true,
            depth_sum: 0,
            ..*slot
        };
        self.store(&mut closed, &light, tap);
        closed.sums[BACK_WEIGHT] = slot.sums[WEIGHT];
        closed.sums[BEHIND_FRONT] = rest;
        closed.sums[BEFORE_BACK] = self.own.rest.word.format.one();
        closed
    }

    fn store<P: Probe>(&self, slot: &mut Cluster, light: &Premultiplied, tap: &mut Tap<P>) {
        for (channel, colour) in light.colour.into_iter().enumerate() {
            slot.sums[COLOUR + channel] = tap.fit_one(&self.fragment.store[0], colour);
        }
        slot.sums[OPACITY] = tap.fit_one(&self.fragment.store[1], light.opacity);
    }

    /// 7: merges a closed slot behind or inside another; returns whether inside.
    fn merge<P: Probe>(&self, front: &mut Cluster, back: &Cluster, tap: &mut Tap<P>) -> bool {
        let (over, under) = (self.read(front, tap), self.read(back, tap));
        if self.own.inside && front.encloses(back) {
            self.put_inside(front, &over, &under, [back.near(), back.far()], tap);
            return true;
        }
        if back.far() > front.far() {
            let through = (self.one() - over.opacity).max(0);
            front.sums[BEFORE_BACK] =
                tap.fit_one(&self.own.dimmed[1], back.sums[BEFORE_BACK] * through);
            front.sums[BACK_WEIGHT] = back.sums[BACK_WEIGHT];
            front.back = back.back;
        }
        let sums = self.fragment.blended(&over, &under, tap);
        front.sums[COLOUR..=OPACITY].copy_from_slice(&sums[COLOUR..=OPACITY]);
        false
    }

    /// 2, 7: blends x between the front and the back of a closed slot, all of which counts as one
    /// colour.
    fn put_inside<P: Probe>(
        &self,
        slot: &mut Cluster,
        light: &Premultiplied,
        x: &Premultiplied,
        [near, far]: [i64; 2],
        tap: &mut Tap<P>,
    ) {
        let Fractions {
            part: of_part,
            through: of_through,
            shaded: of_shaded,
            ..
        } = self.own.frac;
        let (one, part_one) = (self.one(), self.own.part.word.format.one());
        let through = self.rest(light, tap);
        // Visible part of x: what the front lets through; or, nearer to the back, what reaches the
        // back.
        let mut seen = slot.sums[BEHIND_FRONT].max(through);
        if near + far >= slot.front[1] + slot.back[0] {
            seen = slot.sums[BEFORE_BACK].max(through).min(seen);
        }
        let lost = self.quotient(
            [x.opacity * (seen - through), light.opacity],
            of_shaded,
            &self.own.shares[2],
            tap,
        );
        let [kept_up, seen_up] = align([of_part, of_through]);
        for channel in 0..3 {
            let exact = ((light.colour[channel] * (part_one - lost)) << kept_up)
                + ((x.colour[channel] * seen) << seen_up);
            slot.sums[COLOUR + channel] = tap.fit_one(&self.own.within[0], exact);
        }
        let behind = (one - x.opacity).max(0);
        let left = (one - light.opacity).max(0) * behind;
        slot.sums[OPACITY] = tap.fit_one(&self.own.within[1], one * one - left);
        slot.sums[BEFORE_BACK] = tap.fit_one(&self.own.dimmed[1], slot.sums[BEFORE_BACK] * behind);
    }

    /// 2: a contribution by itself, as a layer inside a closed slot.
    fn splat_inside<P: Probe>(&self, input: &Input, tap: &mut Tap<P>) -> Premultiplied {
        let index = tap.fit_one(&self.own.index, input.weight * i64::from(input.density));
        let hidden = tap.fit_one(&self.own.hidden, self.registers.hidden.exact(index));
        let opacity = tap.fit_one(&self.own.splat[0], hidden).min(self.one());
        Premultiplied {
            colour: three!(channel => tap.fit_one(&self.own.splat[1], i64::from(input.light[channel]) * opacity)),
            opacity,
        }
    }

    /// 2: adds a late contribution to a closed slot, where its surface did not cover the pixel yet.
    fn add_late<P: Probe>(&self, slot: &mut Cluster, side: Side, input: &Input, tap: &mut Tap<P>) {
        let own = self.own;
        let Fractions {
            light: of_light,
            shaded: of_shaded,
            part: of_part,
            weight,
            opacity,
            ..
        } = own.frac;
        let (alpha, threshold) = (
            i64::from(input.attributes[OPACITY]),
            self.registers.thresholds.coverage_threshold,
        );
        let place = if side == Side::Front {
            WEIGHT
        } else {
            BACK_WEIGHT
        };
        let had = slot.sums[place];
        let weighs = self.weight_after(0, input.weight, tap);
        slot.sums[place] = self.weight_after(had, input.weight, tap);
        let adds = alpha * weighs.min((threshold - had).max(0));
        let room = (threshold << opacity.max(0)) - alpha * had.min(threshold);
        let share = self.quotient([adds, room], weight + opacity, &own.shares[1], tap);
        let light = self.read(slot, tap);
        let part_one = own.part.word.format.one();
        match side {
            Side::Front => {
                let [lit_up, kept_up] = align([of_light, of_shaded]);
                for channel in 0..3 {
                    let (own_light, behind) =
                        (i64::from(input.light[channel]), light.colour[channel]);
                    let exact = ((own_light * share) << lit_up)
                        + ((behind * (part_one - share)) << kept_up);
                    slot.sums[COLOUR + channel] = tap.fit_one(&own.over[0], exact);
                }
                let exact = (share << of_shaded) + light.opacity * (part_one - share);
                slot.sums[OPACITY] = tap.fit_one(&own.over[1], exact);
                for kept in [BEHIND_FRONT, BEFORE_BACK] {
                    slot.sums[kept] =
                        tap.fit_one(&own.dimmed[0], slot.sums[kept] * (part_one - share));
                }
                slot.front = with(slot.front, input.depth);
            }
            Side::Back => {
                let seen = tap
                    .fit_one(&own.under, share * (self.one() - light.opacity).max(0))
                    .min(part_one);
                let [lit_up, held_up] = align([of_light + of_part, of_shaded]);
                for channel in 0..3 {
                    let exact = ((i64::from(input.light[channel]) * seen) << lit_up)
                        + (light.colour[channel] << held_up);
                    slot.sums[COLOUR + channel] = tap.fit_one(&own.beneath[0], exact);
                }
                let [seen_up, held_up] = align([of_part, of_shaded]);
                slot.sums[OPACITY] = tap.fit_one(
                    &own.beneath[1],
                    (seen << seen_up) + (light.opacity << held_up),
                );
                slot.back = with(slot.back, input.depth);
            }
        }
    }

    /// Σw after one more contribution.
    fn weight_after<P: Probe>(&self, weight: i64, more: i64, tap: &mut Tap<P>) -> i64 {
        let [of_sum, of_product] = self.fragment.align[WEIGHT];
        tap.fit_one(
            &self.fragment.sums[WEIGHT],
            (weight << of_sum) + (more << of_product),
        )
    }

    /// 1: adds a contribution to an open slot.
    fn accumulate<P: Probe>(&self, slot: &mut Cluster, input: &Input, tap: &mut Tap<P>) {
        let mut sums = PackedSums(slot.sums);
        if !P::WORDS && self.own.simple {
            i64::accumulate::<Plain>(
                &mut sums,
                input.attributes,
                input.weight,
                i64::limits(&self.fragment.limits),
            );
        } else {
            self.fragment
                .accumulate_one_by_one(&mut sums, input.weight, input.attributes, tap);
        }
        slot.sums = sums.0;
        let [of_sum, of_product] = self.own.depth_align;
        let exact = (slot.depth_sum << of_sum) + ((input.weight * input.depth) << of_product);
        slot.depth_sum = tap.fit_one(&self.own.depth_sum, exact);
        slot.span(input.depth, input.depth);
    }

    /// 5 to 7: handles one slot too many.
    fn overflow<P: Probe>(
        &self,
        slots: &mut [Cluster],
        place: usize,
        shade: impl Fn(&Slot, &mut Tap<P>) -> Premultiplied,
        tap: &mut Tap<P>,
    ) -> Decision {
        let deepest = slots.len() - 1;
        let windows = self.windows(slots, tap);
        if self.fragment.evict_hidden && windows[deepest].seen.is_none() {
            return Decision::Evicted(place == deepest);
        }
        let sum = if self.own.interval {
            None
        } else {
            self.pair_to_sum(slots, &windows)
        };
        if let Some(front) = sum {
            slots[front] = self.summed(&slots[front], &slots[front + 1], tap);
            slots[front + 1..].rotate_left(1);
            return Decision::Summed(front as u8, place as u8);
        }
        let back = self.closed(&slots[deepest], &shade, tap);
        slots[deepest - 1] = self.closed(&slots[deepest - 1], &shade, tap);
        let inside = self.merge(&mut slots[deepest - 1], &back, tap);
        Decision::Closed(place as u8, inside)
    }
}

impl Fragment {
    /// A frame's registers for windows; `None` where fragments are not grouped by windows.
    pub fn windows(
        &self,
        window: &frame::Window,
        thresholds: FragmentRegisters,
    ) -> Option<WindowRegisters> {
        let own = self.windows.as_ref()?;
        let table = |fit: Fit, shape: TableShape, bits: u32, words: &[i64]| {
            Table::new(fit, shape.index_bits, bits, shape.interpolation, words)
        };
        Some(WindowRegisters {
            thresholds,
            reach: window.reach,
            density: table(
                own.density,
                own.density_shape,
                own.opacity_bits,
                &window.density,
            ),
            hidden: table(own.hidden, own.hidden_shape, own.index_bits, &window.hidden),
        })
    }

    /// Rate, per weight, at which a splat with this opacity (`splat.opacity`) hides what is behind
    /// it.
    pub fn density<P: Probe>(
        &self,
        opacity: i32,
        registers: &WindowRegisters,
        tap: &mut Tap<P>,
    ) -> i32 {
        let density = &registers.density;
        tap.fit_one(density.fit(), density.exact(i64::from(opacity))) as i32
    }

    fn rule<'a>(&'a self, registers: &'a WindowRegisters) -> Option<Rule<'a>> {
        self.windows.as_ref().map(|own| Rule {
            fragment: self,
            own,
            registers,
        })
    }

    /// Adds one contribution to a pixel's slots. `live` of them are occupied, and one more is
    /// spare.
    pub fn contribute_to_window<P: Probe>(
        &self,
        slots: &mut [Cluster; MAX_LAYERS + 1],
        live: usize,
        input: &Input,
        registers: &WindowRegisters,
        shade: impl Fn(&Slot, &mut Tap<P>) -> Premultiplied,
        tap: &mut Tap<P>,
    ) -> Decision {
        let Some(rule) = self.rule(registers) else {
            return Decision::Dropped;
        };
        let (z, held) = (input.depth, &slots[..live]);
        if let Some(place) = rule.taker(z, held) {
            rule.accumulate(&mut slots[place], input, tap);
            return Decision::Accumulated(place as u8);
        }
        if let Some((place, side)) = rule.own.late.then(|| rule.late_for(z, held)).flatten() {
            rule.add_late(&mut slots[place], side, input, tap);
            return Decision::Late(place as u8, side);
        }
        let around = held
            .iter()
            .rposition(|slot| slot.closed && slot.near() < z && z < slot.far());
        if let Some(place) = around.filter(|_| rule.own.inside) {
            let x = rule.splat_inside(input, tap);
            let light = rule.read(&slots[place], tap);
            rule.put_inside(&mut slots[place], &light, &x, [z, z], tap);
            return Decision::Inside(place as u8);
        }
        slots[..live].sort_by_key(Cluster::near);
        let place = slots[..live].partition_point(|slot| slot.near() <= z);
        let mut fresh = Cluster {
            front: [z; 2],
            back: [z; 2],
            material: input.material,
            ..Cluster::default()
        };
        rule.accumulate(&mut fresh, input, tap);
        slots[live] = fresh;
        slots[place..=live].rotate_right(1);
        if live < self.layers {
            return Decision::Inserted(place as u8);
        }
        rule.overflow(&mut slots[..=live], place, shade, tap)
    }

    /// A pixel's windows, each shaded and blended behind or inside those before it, in depth order.
    /// Returns the number of layers, a bit mask of the places at which a window starts (the first
    /// place in the LSB), and the number of shaded windows.
    pub fn layers_of_windows<P: Probe>(
        &self,
        slots: &mut [Cluster],
        registers: &WindowRegisters,
        layers: &mut [Layer; MAX_LAYERS],
        shade: impl Fn(&Slot, &mut Tap<P>) -> Premultiplied,
        tap: &mut Tap<P>,
    ) -> (usize, u8, u8) {
        let Some(rule) = self.rule(registers) else {
            return (0, 0, 0);
        };
        slots.sort_by_key(Cluster::near);
        let (mut count, mut starts, mut shaded) = (0, 0, 0);
        let mut last = Cluster::default();
        let mut place = 0;
        while place < slots.len() {
            starts |= 1 << place;
            let (first, mut window) = (place, slots[place]);
            place += 1;
            while place < slots.len()
                && !window.closed
                && rule.joins(slots[first].near(), &slots[place])
            {
                window = rule.summed(&window, &slots[place], tap);
                place += 1;
            }
            let was_closed = window.closed;
            shaded += u8::from(!was_closed);
            let window = rule.closed(&window, &shade, tap);
            if count > 0 && rule.own.inside && last.encloses(&window) {
                let (light, x) = (rule.read(&last, tap), rule.read(&window, tap));
                rule.put_inside(&mut last, &light, &x, [window.near(), window.far()], tap);
                layers[count - 1].merged = true;
            } else {
                last = window;
                let weight = if was_closed { 0 } else { window.sums[WEIGHT] };
                layers[count] = Layer {
                    slot: first,
                    depth: window.near(),
                    weight,
                    merged: was_closed,
                    ..Layer::default()
                };
                count += 1;
            }
            let Premultiplied { colour, opacity } = rule.read(&last, tap);
            (layers[count - 1].colour, layers[count - 1].opacity) = (colour, opacity);
        }
        (count, starts, shaded)
    }
}

/// Distance of a depth from a span; 0 inside it.
fn gap([near, far]: [i64; 2], z: i64) -> i64 {
    (near - z).max(z - far).max(0)
}

/// Smallest span that contains a span and a depth.
fn with([near, far]: [i64; 2], z: i64) -> [i64; 2] {
    [near.min(z), far.max(z)]
}

fn width_with(span: [i64; 2], z: i64) -> i64 {
    let [near, far] = with(span, z);
    far - near
}

pub mod real;

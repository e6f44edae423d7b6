//! Pixel: the fragments of one pixel of `golden`, led by the machine's decisions, and bounds on the
//! machine's error.
//!
//! ```text
//! the machine's decision ─►┬─► golden's fragments do the same
//!                          └─► would golden have done so by itself? if not: a flip, and is its threshold within the bound?
//! ```
//! A fragment's sums are correlated: an error of a weight moves Σw·c and Σw alike. Therefore the
//! quotient is bounded,
//! ```text
//! |C_fixed − C| ≤ (Σ Δw_k·|c_k − C| + Σ w_k·Δc_k + K·(u_c + |C|·u_w)/2) / (W − ΔW),   Σ Δw_k·|c_k − C| ≤ ΔW·max |c_k − C|,
//! ```
//! so that a surface of one colour keeps its colour, whatever the errors of its weights.

use super::Flips;
use crate::golden::fragments::{Fragment, nearest_within};
use crate::golden::shade::{Shader, over};
use crate::golden::{FragmentDepth, Rules};
use glam::DVec4;
use rtl_model::machine::Machine;
use rtl_model::num::{Rounding, Word};
use rtl_model::pipeline::Elaborated;
use rtl_model::real::{Near, Real};
use rtl_model::units::fragment::Decision;
use rtl_model::units::shade::real::{Lighting, Sums};
use std::cell::OnceCell;

/// Attributes of a contribution: rgb, α, normal.
pub const ATTRIBUTES: usize = 7;
pub const OPACITY: usize = 3;

/// One contribution, exact and with the machine's bounds.
pub struct BoundedContribution<'a> {
    pub golden: Fragment,
    pub weight: Near,
    /// rgb, α, normal.
    pub attributes: &'a [Near; ATTRIBUTES],
    /// Part of a sum's word that a unit of weight fills with these attributes
    /// ([`SumLimits::filled`]).
    pub filled: f64,
    /// The machine's depth word, by which it sorts.
    pub depth_word: i64,
    /// Depth, computed on first use: most contributions that join a fragment do not need it.
    pub depth: OnceCell<Near>,
    pub find_depth: &'a dyn Fn() -> Near,
}

impl BoundedContribution<'_> {
    /// Depth, machine units.
    pub fn depth(&self) -> Near {
        *self.depth.get_or_init(self.find_depth)
    }
}

/// Values that the whole frame has in common.
pub struct Common<'a> {
    pub machine: &'a Elaborated,
    pub rules: &'a Rules,
    pub shader: &'a Shader,
    pub lighting: Lighting<Near>,
    /// ε, world units.
    pub z_threshold_world: f64,
    /// ε, machine units.
    pub z_threshold: Near,
    /// τ.
    pub coverage_threshold: Near,
    pub background: [Near; 4],
    pub limits: SumLimits,
}

/// Capacity of the machine's sums and the loss of one rounding of each ([`words`]), and the opacity
/// from which a fragment hides.
pub struct SumLimits {
    weight: [f64; 2],
    attributes: [[f64; ATTRIBUTES]; 2],
    /// Greatest part of a sum's word that one rounding may lose.
    lost: f64,
    opaque: Near,
}

impl SumLimits {
    /// Limits of a machine.
    pub fn new(machine: &Machine, opaque: Near) -> Self {
        let (weight, attributes) = words(machine);
        let most = |word: Word| word.format.value(word.format.max());
        let lost = attributes
            .into_iter()
            .chain([weight])
            .map(|word| loss(word) / most(word))
            .fold(0.0, greater);
        SumLimits {
            weight: [most(weight), loss(weight)],
            attributes: [attributes.map(most), attributes.map(loss)],
            lost,
            opaque,
        }
    }

    /// Part of its word that the fullest sum uses after a unit of weight was added with these
    /// attributes, on either side; infinite for NaN.
    pub fn filled(&self, attributes: &[Near; ATTRIBUTES]) -> f64 {
        let [most, _] = self.attributes;
        attributes
            .iter()
            .zip(most)
            .map(|(attribute, most)| attribute.most() / most)
            .fold(1.0 / self.weight[0], greater)
    }

    /// Greatest loss of one rounding of Σw.
    pub fn weight_loss(&self) -> f64 {
        self.weight[1]
    }

    /// Greatest loss of one rounding of the sum of an attribute.
    pub fn attribute_loss(&self, i: usize) -> f64 {
        self.attributes[1][i]
    }
}

/// Bounds on the error of the machine's fragment.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// Σ Δw, without rounding.
    weight: f64,
    /// Σ w·Δc per attribute.
    attribute: [f64; ATTRIBUTES],
    /// Contributions.
    pub count: f64,
    /// Least and greatest value per attribute.
    range: [[f64; ATTRIBUTES]; 2],
    /// Greatest part of a sum's word that a unit of weight fills.
    filled: f64,
    /// A sum may have left its word.
    pub overflowed: bool,
    depth: Near,
    depth_word: i64,
    /// After shading: premultiplied colour and opacity.
    shaded: [Near; 4],
}

/// The fragments of one pixel.
#[derive(Clone, Debug, Default)]
pub struct FragmentPixel {
    fragments: Vec<Fragment>,
    bounds: Vec<Bounds>,
}

/// The greater; infinite if the second is NaN.
fn greater(a: f64, b: f64) -> f64 {
    if b.is_nan() { f64::INFINITY } else { a.max(b) }
}

/// Greatest loss of one rounding of a sum.
pub fn loss(word: Word) -> f64 {
    let place = word.format.value(1);
    if word.round == Rounding::Truncate {
        place
    } else {
        place / 2.0
    }
}

/// The words of the sums: weight, then the attributes.
fn words(machine: &Machine) -> (Word, [Word; ATTRIBUTES]) {
    let f = &machine.fragment;
    let (c, n) = (f.colour_sum, f.normal_sum);
    (f.weight_sum, [c, c, c, f.opacity_sum, n, n, n])
}

impl Bounds {
    /// Bounds of a slot with one contribution, which may already overflow a sum's word.
    pub fn new(limits: &SumLimits, arrival: &BoundedContribution) -> Self {
        let range = [arrival.attributes.map(|c| c.value); 2];
        let shaded = [Near::default(); 4];
        let (depth, depth_word) = (arrival.depth(), arrival.depth_word);
        let (attribute, filled) = ([0.0; ATTRIBUTES], arrival.filled);
        let mut new = Bounds {
            weight: 0.0,
            attribute,
            count: 0.0,
            range,
            filled,
            overflowed: false,
            depth,
            depth_word,
            shaded,
        };
        new.add(limits, arrival, &arrival.golden);
        new
    }

    /// Adds one contribution; `golden` already contains it.
    pub fn add(&mut self, limits: &SumLimits, arrival: &BoundedContribution, golden: &Fragment) {
        self.weight += arrival.weight.error;
        self.count += 1.0;
        let most = arrival.weight.most();
        let [low, high] = &mut self.range;
        for (i, c) in arrival.attributes.iter().enumerate() {
            self.attribute[i] += most * c.error;
            // NaN leaves the range unchanged, as with `min` and `max`, which are slower.
            low[i] = if c.value < low[i] { c.value } else { low[i] };
            high[i] = if c.value > high[i] { c.value } else { high[i] };
        }
        self.filled = self.filled.max(arrival.filled);
        self.overflowed |= self.may_overflow(limits, golden);
    }

    /// Adds another slot whose sums were added; `golden` already contains both.
    pub fn join(&mut self, limits: &SumLimits, other: &Bounds, golden: &Fragment) {
        self.weight += other.weight;
        self.count += other.count;
        for i in 0..ATTRIBUTES {
            self.attribute[i] += other.attribute[i];
            self.range[0][i] = self.range[0][i].min(other.range[0][i]);
            self.range[1][i] = self.range[1][i].max(other.range[1][i]);
        }
        self.filled = self.filled.max(other.filled);
        self.overflowed |= other.overflowed || self.may_overflow(limits, golden);
    }

    /// Whether one of the machine's sums may have left its word.
    fn may_overflow(&self, limits: &SumLimits, golden: &Fragment) -> bool {
        // No sum exceeds the total weight times the fullest attributes, which is rarely much.
        // Rounding errors of f64 are less than a hundredth; NaN fails the comparison.
        let has_room =
            (golden.weight + self.weight) * self.filled + self.count * limits.lost < 0.99;
        !has_room && self.sum_may_overflow(limits, golden)
    }

    /// The same, sum by sum.
    #[inline(never)]
    fn sum_may_overflow(&self, limits: &SumLimits, golden: &Fragment) -> bool {
        let [most, losses] = limits.attributes;
        let sums = [
            golden.rgb.x,
            golden.rgb.y,
            golden.rgb.z,
            golden.alpha,
            golden.normal.x,
            golden.normal.y,
            golden.normal.z,
        ];
        // NaN counts as an overflow of every word.
        let exceeds = |most: f64, sum: f64| sum.is_nan() | (sum > most);
        let [most_weight, weight_loss] = limits.weight;
        let mut overflows = exceeds(
            most_weight,
            golden.weight + (self.weight + self.count * weight_loss),
        );
        // No early exit: to compute all sums is faster than to branch after each.
        for i in 0..ATTRIBUTES {
            overflows |= exceeds(most[i], sums[i].abs() + self.sum_error(i, 0.0, losses[i]));
        }
        overflows
    }

    /// ΔW.
    pub fn weight_error(&self, limits: &SumLimits) -> f64 {
        self.weight + self.count * limits.weight_loss()
    }

    /// Greatest |c − centre| among the contributions.
    fn spread(&self, i: usize, centre: f64) -> f64 {
        let [low, high] = [self.range[0][i], self.range[1][i]];
        (high - centre).max(centre - low).max(0.0)
    }

    /// A fragment's sums divided by its weight.
    pub fn sums(&self, common: &Common, golden: &Fragment) -> Sums<Near> {
        let limits = &common.limits;
        let weight_error = self.weight_error(limits);
        let least = golden.weight - weight_error;
        let attributes = [
            golden.rgb.x,
            golden.rgb.y,
            golden.rgb.z,
            golden.alpha,
            golden.normal.x,
            golden.normal.y,
            golden.normal.z,
        ];
        let mean = |i: usize| {
            let centre = if golden.weight > 0.0 {
                attributes[i] / golden.weight
            } else {
                0.0
            };
            let error = self.sum_error(i, centre, limits.attribute_loss(i))
                + centre.abs() * self.count * limits.weight_loss();
            Near::within(
                centre,
                if self.overflowed || least <= 0.0 {
                    f64::INFINITY
                } else {
                    error / least
                },
            )
        };
        Sums {
            weight: Near::within(
                golden.weight,
                if self.overflowed {
                    f64::INFINITY
                } else {
                    weight_error
                },
            ),
            rgb: [mean(0), mean(1), mean(2)],
            opacity: mean(OPACITY),
            normal: [mean(4), mean(5), mean(6)],
            material: golden.material,
            at: common.shader.off_middle(golden.pixel),
        }
    }

    /// Error bound of Σw·c apart from ΔW·centre, if one rounding may lose `loss`.
    pub fn sum_error(&self, i: usize, centre: f64, loss: f64) -> f64 {
        self.weight * self.spread(i, centre) + self.attribute[i] + self.count * loss
    }
}

/// Whether a fragment hides everything behind it, by golden's sums.
fn hides(common: &Common, golden: &Fragment) -> bool {
    golden.is_opaque(common.rules.opaque, common.coverage_threshold.value)
}

/// Whether the machine may decide that differently.
fn may_hide_differently(common: &Common, golden: &Fragment, bounds: &Bounds) -> bool {
    let limits = &common.limits;
    let opaque = limits.opaque;
    if golden.shaded {
        return bounds.shaded[3].may_cross(opaque);
    }
    let weight = Near::within(golden.weight, bounds.weight_error(limits));
    let error = bounds.sum_error(OPACITY, opaque.value, limits.attribute_loss(OPACITY))
        + opaque.value * bounds.count * limits.weight_loss()
        + opaque.error * weight.most();
    let margin = Near::within(golden.alpha - opaque.value * golden.weight, error);
    bounds.overflowed
        || margin.may_cross(Near::exact(0.0))
        || weight.may_cross(common.coverage_threshold)
}

impl FragmentPixel {
    /// Takes a contribution as the machine did; counts decisions that `golden` would take
    /// differently.
    pub fn take(
        &mut self,
        common: &Common,
        arrival: &BoundedContribution,
        decision: Decision,
        flips: &mut Flips,
    ) {
        self.check_slot(common, arrival, decision, flips);
        match decision {
            Decision::Accumulated(slot) => self.accumulate(common, usize::from(slot), arrival),
            Decision::Inserted(_) => self.push(common, arrival),
            Decision::Replaced | Decision::Dropped => {
                self.replace(common, arrival, decision, flips)
            }
            Decision::Merged(..) | Decision::Evicted(_) => {
                self.overflow(common, arrival, decision, flips)
            }
            // Windows only; handled by `WindowPixel`.
            Decision::Late(..)
            | Decision::Inside(_)
            | Decision::Summed(..)
            | Decision::Closed(..) => {}
        }
    }

    /// Removes all fragments, and keeps the capacity.
    pub fn clear(&mut self) {
        self.fragments.clear();
        self.bounds.clear();
    }

    fn push(&mut self, common: &Common, arrival: &BoundedContribution) {
        self.fragments.push(arrival.golden);
        self.bounds.push(Bounds::new(&common.limits, arrival));
    }

    fn accumulate(&mut self, common: &Common, slot: usize, arrival: &BoundedContribution) {
        let (golden, bounds) = (&mut self.fragments[slot], &mut self.bounds[slot]);
        golden.add(&arrival.golden);
        bounds.add(&common.limits, arrival, golden);
        if common.rules.fragment_depth == FragmentDepth::Nearest {
            golden.z = golden.z.min(arrival.golden.z);
            bounds.depth = bounds.depth.min(arrival.depth());
            bounds.depth_word = bounds.depth_word.min(arrival.depth_word);
        }
    }

    /// Compares the slot that the machine accumulated into, if any, with golden's choice.
    fn check_slot(
        &self,
        common: &Common,
        arrival: &BoundedContribution,
        decision: Decision,
        flips: &mut Flips,
    ) {
        let taken = if let Decision::Accumulated(slot) = decision {
            Some(usize::from(slot))
        } else {
            None
        };
        let wanted = nearest_within(common.z_threshold_world, arrival.golden.z, &self.fragments);
        if taken == wanted {
            return;
        }
        let distance = |slot: usize| (self.bounds[slot].depth - arrival.depth()).abs();
        let crosses = |slot: usize| distance(slot).may_cross(common.z_threshold);
        let explained = match (taken, wanted) {
            // Two slots are about equally near.
            (Some(a), Some(b)) => distance(a).may_cross(distance(b)) || crosses(b),
            (Some(slot), None) | (None, Some(slot)) => crosses(slot),
            (None, None) => true,
        };
        flips.slot(explained);
    }

    fn replace(
        &mut self,
        common: &Common,
        arrival: &BoundedContribution,
        decision: Decision,
        flips: &mut Flips,
    ) {
        let nearer = arrival.golden.z < self.fragments[0].z;
        if nearer != (decision == Decision::Replaced) {
            flips.order(arrival.depth().may_cross(self.bounds[0].depth));
        }
        if decision == Decision::Replaced {
            self.fragments[0] = arrival.golden;
            self.bounds[0] = Bounds::new(&common.limits, arrival);
        }
    }

    /// Overflow: repeats the machine's decision.
    fn overflow(
        &mut self,
        common: &Common,
        arrival: &BoundedContribution,
        decision: Decision,
        flips: &mut Flips,
    ) {
        self.sort();
        let place = self
            .bounds
            .iter()
            .filter(|bounds| bounds.depth_word <= arrival.depth_word)
            .count();
        self.fragments.insert(place, arrival.golden);
        self.bounds
            .insert(place, Bounds::new(&common.limits, arrival));
        // The fragments are in the machine's order; it may differ from golden's.
        let mut order_unsure = false;
        for i in 1..self.fragments.len() {
            let unsure = self.bounds[i - 1].depth.may_cross(self.bounds[i].depth);
            order_unsure |= unsure;
            if self.fragments[i].z < self.fragments[i - 1].z {
                flips.order(unsure);
            }
        }
        let deepest = self.fragments.len() - 1;
        let evicts = common.rules.evict_hidden
            && self.fragments[..deepest]
                .iter()
                .any(|golden| hides(common, golden));
        if evicts != matches!(decision, Decision::Evicted(_)) {
            let mut asked = self.fragments.iter().zip(&self.bounds);
            flips.eviction(
                order_unsure
                    || asked.any(|(golden, bounds)| may_hide_differently(common, golden, bounds)),
            );
        }
        if let Decision::Merged(front, _) = decision {
            let front = usize::from(front);
            let wanted = common
                .rules
                .merge
                .pair()
                .map_or(front, |pair| pair(&self.fragments));
            if wanted != front {
                let gap = |i: usize| self.bounds[i + 1].depth - self.bounds[i].depth;
                flips.pair(order_unsure || gap(front).may_cross(gap(wanted)));
            }
            self.merge(common, front);
        }
        self.fragments.truncate(deepest);
        self.bounds.truncate(deepest);
    }

    /// Brings the slots into the machine's order.
    fn sort(&mut self) {
        if self.bounds.is_sorted_by_key(|bounds| bounds.depth_word) {
            return;
        }
        let mut order: Vec<usize> = (0..self.fragments.len()).collect();
        order.sort_by_key(|&slot| self.bounds[slot].depth_word);
        self.fragments = order.iter().map(|&slot| self.fragments[slot]).collect();
        self.bounds = order.iter().map(|&slot| self.bounds[slot]).collect();
    }

    fn merge(&mut self, common: &Common, front: usize) {
        // A shaded fragment is stored in a slot, so its rounding comes before the blend as well as
        // after it.
        let stored = |slot: usize| {
            let (near, exact) = self.light(common, slot);
            (
                if self.fragments[slot].shaded {
                    near
                } else {
                    common.machine.real_stored(near)
                },
                exact,
            )
        };
        let [(near_over, exact_over), (near_under, exact_under)] =
            [stored(front), stored(front + 1)];
        let (near, exact) = (
            common.machine.real_merge(near_over, near_under),
            over(exact_over, exact_under),
        );
        self.fragments[front] = self.fragments[front].with_light(exact);
        self.bounds[front].shaded = [0, 1, 2, 3].map(|i| near[i].around(exact[i]));
        self.fragments.remove(front + 1);
        self.bounds.remove(front + 1);
    }

    /// Premultiplied colour and opacity of the fragment in a slot: with bounds, and exactly as in
    /// `golden`.
    fn light(&self, common: &Common, slot: usize) -> ([Near; 4], DVec4) {
        let (golden, bounds) = (&self.fragments[slot], &self.bounds[slot]);
        let exact = common.shader.premultiplied(golden);
        if golden.shaded {
            return (common.machine.real_read(bounds.shaded), exact);
        }
        let near = common
            .machine
            .real_shade(&common.lighting, &bounds.sums(common, golden));
        ([0, 1, 2, 3].map(|i| near[i].around(exact[i])), exact)
    }

    /// The pixel with its layers blended in the order of these slots, and the bound on the
    /// machine's.
    pub fn resolve(
        &self,
        common: &Common,
        order: impl Iterator<Item = usize> + Clone,
        flips: &mut Flips,
    ) -> [Near; 4] {
        let slots: Vec<usize> = order.collect();
        for pair in slots.windows(2) {
            if self.fragments[pair[1]].z < self.fragments[pair[0]].z {
                flips.order(
                    self.bounds[pair[0]]
                        .depth
                        .may_cross(self.bounds[pair[1]].depth),
                );
            }
        }
        let (lit, exact): (Vec<[Near; 4]>, Vec<DVec4>) =
            slots.iter().map(|&slot| self.light(common, slot)).unzip();
        let near = common.machine.real_resolve(&lit, common.background);
        let exact = common.shader.blend_lit(exact.into_iter());
        [0, 1, 2, 3].map(|i| near[i].around(exact[i]))
    }
}

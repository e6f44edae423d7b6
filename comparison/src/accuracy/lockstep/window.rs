//! Window: one pixel of `golden` grouped by windows, led by the machine's decisions, and bounds on
//! the machine's error.
//!
//! Decisions that depend only on depths can be repeated exactly, because the machine's depth words
//! are known: late surfaces, contributions inside, the order. Decisions that depend on sums
//! (windows, transmittance) are taken from the machine.
//!
//! Every decision is also computed by `golden` on the same slots. If the two differ, it is a flip.
//! It is explained if a number that either decision depends on lies within its bound of the
//! threshold.

use super::Flips;
use super::pixel::{BoundedContribution, Bounds, Common, OPACITY, loss};
use crate::golden::Side as GoldenSide;
use crate::golden::shade::over;
use crate::golden::window::{self, Closed, Layer, LayerVisibility, Open, Surface, Window};
use crate::hardware::quantise::Quantised;
use crate::hardware::registers::{Bounded, WindowWords};
use crate::scene::Scene;
use glam::{DVec3, DVec4};
use rtl_model::real::{Near, Real};
use rtl_model::units::fragment::window::real::{self, Single};
use rtl_model::units::fragment::{Decision, Side};

/// Values that the whole frame has in common.
pub struct WindowRules<'a> {
    rule: Window<'a>,
    words: WindowWords<Near>,
    /// ε, machine units.
    epsilon: Near,
    evict_hidden: bool,
    /// Machine units per world unit.
    scale: f64,
}

/// Appearance of a contribution's splat alone.
#[derive(Clone, Copy, Debug)]
pub struct SplatLight {
    /// The light that the splat sends, in golden and on the machine.
    pub golden: DVec3,
    pub light: [Near; 3],
    /// α.
    pub opacity: f64,
}

/// Bounds on the error of the machine's slot.
#[derive(Clone, Debug)]
struct SlotBounds {
    /// Bounds of an open slot.
    bounds: Bounds,
    /// Bounds of a closed slot.
    closed: Option<real::Closed<Near>>,
    /// Σ w·Δz, machine units.
    depth_error: f64,
    /// Least and greatest depth of its contributions, exact, machine units.
    depths: [f64; 2],
    /// Ends of its front and of its back, in the machine's words.
    end_words: [[i64; 2]; 2],
    /// The same ends as numbers.
    ends: [[Near; 2]; 2],
}

/// State of a pixel.
#[derive(Clone, Debug, Default)]
pub struct WindowPixel {
    layers: Vec<Layer>,
    slots: Vec<SlotBounds>,
    /// Slots at which the machine's windows start, one bit each, the first in the LSB.
    starts: u8,
}

/// A slot that closes, in golden and on the machine.
#[derive(Clone, Copy)]
struct ClosedPair {
    golden: Closed,
    near: real::Closed<Near>,
}

impl<'a> WindowRules<'a> {
    /// None if fragments are not grouped by windows.
    pub fn new(scene: &Scene, common: &Common<'a>, quantised: &Quantised) -> Option<Self> {
        Some(WindowRules {
            rule: Window::new(common.rules, scene.surface.z_threshold, common.shader),
            words: WindowWords::new(&Bounded, scene, common.machine, quantised)?,
            epsilon: common.z_threshold,
            evict_hidden: common.rules.evict_hidden,
            scale: quantised.scale.factor(),
        })
    }
}

impl SlotBounds {
    fn new(common: &Common, arrival: &BoundedContribution) -> Self {
        let (end_words, end) = ([arrival.depth_word; 2], [arrival.depth(); 2]);
        SlotBounds {
            bounds: Bounds::new(&common.limits, arrival),
            closed: None,
            depth_error: arrival.weight.most() * arrival.depth().error,
            depths: [arrival.depth().value; 2],
            end_words: [end_words; 2],
            ends: [end; 2],
        }
    }

    /// Extends one side, or an open slot, to a contribution's depth.
    fn span(&mut self, side: usize, arrival: &BoundedContribution) {
        let (end_words, z) = (&mut self.end_words[side], arrival.depth_word);
        *end_words = [end_words[0].min(z), end_words[1].max(z)];
        let [near, far] = self.ends[side];
        self.ends[side] = [near.min(arrival.depth()), far.max(arrival.depth())];
    }

    fn add(&mut self, common: &Common, arrival: &BoundedContribution, golden: &Open) {
        self.bounds.add(&common.limits, arrival, &golden.sums);
        self.depth_error += arrival.weight.most() * arrival.depth().error;
        let z = arrival.depth().value;
        self.depths = [self.depths[0].min(z), self.depths[1].max(z)];
        self.span(0, arrival);
        self.span(1, arrival);
    }

    /// Adds the slot behind; golden already contains both.
    fn join(&mut self, common: &Common, other: &SlotBounds, golden: &Open) {
        self.bounds
            .join(&common.limits, &other.bounds, &golden.sums);
        self.depth_error += other.depth_error;
        self.depths = [
            self.depths[0].min(other.depths[0]),
            self.depths[1].max(other.depths[1]),
        ];
        for side in 0..2 {
            let ([near, far], [other_near, other_far]) =
                (self.end_words[side], other.end_words[side]);
            self.end_words[side] = [near.min(other_near), far.max(other_far)];
            let ([near, far], [other_near, other_far]) = (self.ends[side], other.ends[side]);
            self.ends[side] = [near.min(other_near), far.max(other_far)];
        }
    }

    /// lo of the machine.
    fn near(&self) -> i64 {
        self.end_words[0][0]
    }

    fn far(&self) -> i64 {
        self.end_words[1][1]
    }

    fn is_open(&self) -> bool {
        self.closed.is_none()
    }

    /// Σw·z/Σw, machine units.
    fn mean_depth(&self, common: &Common, golden: &Open, scale: f64) -> Near {
        let mean = golden.mean_depth() * scale;
        let error = self.bounds.weight_error(&common.limits);
        let least = golden.sums.weight - error;
        let spread = (self.depths[1] - mean).max(mean - self.depths[0]).max(0.0);
        let fit = common.machine.fragment.depth_sum_fit().word;
        let off = error * spread
            + self.depth_error
            + self.bounds.count * (loss(fit) + mean.abs() * common.limits.weight_loss());
        let most = mean * golden.sums.weight + off + error * mean.abs();
        let outruns =
            self.bounds.overflowed || most.is_nan() || most > fit.format.value(fit.format.max());
        Near::within(
            mean,
            if outruns || least <= 0.0 {
                f64::INFINITY
            } else {
                off / least
            },
        )
    }
}

/// The power of two that T is rounded down to, as a number of places; none for 0.
fn places(through: f64) -> Option<u32> {
    (0..=8).find(|places| through * f64::from(1u32 << places) >= 1.0)
}

impl WindowPixel {
    /// Sets the places at which the machine's windows start.
    pub fn start(&mut self, starts: u8) {
        self.starts = starts;
    }

    /// Takes a contribution as the machine did; counts decisions that `golden` would take
    /// differently.
    pub fn take(
        &mut self,
        rules: &WindowRules,
        common: &Common,
        arrival: &BoundedContribution,
        own: &SplatLight,
        decision: Decision,
        flips: &mut Flips,
    ) {
        self.check_decision(rules, arrival, decision, flips);
        match decision {
            Decision::Accumulated(slot) => {
                let (Layer::Open(open), slot) = (
                    &mut self.layers[usize::from(slot)],
                    &mut self.slots[usize::from(slot)],
                ) else {
                    return;
                };
                open.add(&arrival.golden);
                slot.add(common, arrival, open);
            }
            Decision::Late(slot, side) => {
                self.add_late(rules, common, usize::from(slot), side, arrival, own)
            }
            Decision::Inside(slot) => {
                let single = rules.single(arrival, own);
                let x = Window::splat_inside(&own.arrival(arrival));
                let light = common.machine.fragment.real_splat_inside(
                    &single,
                    own.opacity,
                    &rules.words.registers,
                    &rules.words.tables,
                );
                let x_light = around(light, x.colour);
                let ends = [arrival.depth_word; 2];
                self.put_inside(
                    common,
                    usize::from(slot),
                    &x,
                    x_light,
                    ends,
                    [arrival.depth(); 2],
                    flips,
                );
            }
            Decision::Inserted(_) => {
                self.insert(common, arrival, flips);
            }
            _ => self.overflow(rules, common, arrival, decision, flips),
        }
    }

    /// Compares the decision about a contribution that takes no new slot with golden's.
    fn check_decision(
        &self,
        rules: &WindowRules,
        arrival: &BoundedContribution,
        decision: Decision,
        flips: &mut Flips,
    ) {
        let z = arrival.golden.z;
        let rule = &rules.rule;
        let taken = match decision {
            Decision::Accumulated(slot) => (Some(usize::from(slot)), None, None),
            Decision::Late(slot, side) => (None, Some((usize::from(slot), side)), None),
            Decision::Inside(slot) => (None, None, Some(usize::from(slot))),
            _ => (None, None, None),
        };
        let open = rule.slot_for(z, &self.layers);
        let late = if open.is_none() && rule.late {
            rule.late_for(z, &self.layers)
        } else {
            None
        };
        let late = late.map(|(slot, side)| {
            (
                slot,
                if side == GoldenSide::Front {
                    Side::Front
                } else {
                    Side::Back
                },
            )
        });
        let inside = if open.is_none() && late.is_none() && rule.inside {
            rule.around(z, &self.layers)
        } else {
            None
        };
        let wanted = (open, late, inside);
        if taken == wanted {
            return;
        }
        let slots = [taken, wanted]
            .map(|(open, late, inside)| open.or(late.map(|(slot, _)| slot)).or(inside));
        let in_doubt = slots
            .into_iter()
            .flatten()
            .any(|slot| self.may_decide_differently(rules, arrival, slot));
        let explained =
            in_doubt || self.may_be_equally_near(arrival, [taken.0, wanted.0], [taken.1, wanted.1]);
        if taken.0 != wanted.0 {
            flips.slot(explained);
        } else if taken.1 != wanted.1 {
            flips.late(explained);
        } else {
            flips.inside(explained);
        }
    }

    /// Whether the decision of a slot about a depth is within the depths' bounds.
    fn may_decide_differently(
        &self,
        rules: &WindowRules,
        arrival: &BoundedContribution,
        slot: usize,
    ) -> bool {
        let (slot, z) = (&self.slots[slot], arrival.depth());
        let narrow =
            |[near, far]: [Near; 2], limit: Near| (far.max(z) - near.min(z)).may_cross(limit);
        let at_an_end = slot.ends.iter().flatten().any(|end| z.may_cross(*end));
        let reach = if slot.is_open() {
            rules.words.reach
        } else {
            rules.epsilon
        };
        at_an_end || slot.ends.iter().any(|span| narrow(*span, reach))
    }

    /// Whether two open slots, or two surfaces of closed ones, may be equally near to a depth.
    fn may_be_equally_near(
        &self,
        arrival: &BoundedContribution,
        open: [Option<usize>; 2],
        late: [Option<(usize, Side)>; 2],
    ) -> bool {
        let z = arrival.depth();
        let gap = |[near, far]: [Near; 2]| (near - z).max(z - far).max(Near::exact(0.0));
        let spans = match (open, late) {
            ([Some(a), Some(b)], _) => [self.slots[a].ends[0], self.slots[b].ends[0]],
            (_, [Some(a), Some(b)]) => {
                [a, b].map(|(slot, side)| self.slots[slot].ends[usize::from(side == Side::Back)])
            }
            _ => return false,
        };
        gap(spans[0]).may_cross(gap(spans[1]))
    }

    fn add_late(
        &mut self,
        rules: &WindowRules,
        common: &Common,
        slot: usize,
        side: Side,
        arrival: &BoundedContribution,
        own: &SplatLight,
    ) {
        let Layer::Closed(golden) = &mut self.layers[slot] else {
            return;
        };
        let slot = &mut self.slots[slot];
        let Some(near) = &mut slot.closed else { return };
        let (of_golden, number) = if side == Side::Front {
            (GoldenSide::Front, 0)
        } else {
            (GoldenSide::Back, 1)
        };
        rules
            .rule
            .add_late(golden, of_golden, &own.arrival(arrival));
        common.machine.fragment.real_late(
            near,
            number,
            &rules.single(arrival, own),
            common.coverage_threshold,
        );
        *near = near_to(near, golden);
        slot.span(number, arrival);
    }

    /// Puts a layer inside a closed slot; its ends are given in the machine's words and as numbers.
    #[expect(
        clippy::too_many_arguments,
        reason = "the same thing in golden and on the machine"
    )]
    fn put_inside(
        &mut self,
        common: &Common,
        slot: usize,
        x: &Closed,
        light: [Near; 4],
        end_words: [i64; 2],
        ends: [Near; 2],
        flips: &mut Flips,
    ) {
        let Layer::Closed(golden) = &mut self.layers[slot] else {
            return;
        };
        let slot = &mut self.slots[slot];
        let Some(near) = &mut slot.closed else { return };
        let nearer_the_back =
            end_words[0] + end_words[1] >= slot.end_words[0][1] + slot.end_words[1][0];
        if nearer_the_back != golden.is_nearer_to_the_back(x) {
            flips.inside((ends[0] + ends[1]).may_cross(slot.ends[0][1] + slot.ends[1][0]));
        }
        golden.put_inside_at(x, nearer_the_back);
        common
            .machine
            .fragment
            .real_put_inside(near, light, nearer_the_back);
        *near = near_to(near, golden);
    }

    /// Brings the slots into the machine's order and compares it with golden's; returns whether any
    /// two may be in the other order.
    fn sort(&mut self, flips: &mut Flips) -> bool {
        let mut order: Vec<usize> = (0..self.slots.len()).collect();
        order.sort_by_key(|&slot| self.slots[slot].near());
        self.layers = order.iter().map(|&slot| self.layers[slot]).collect();
        self.slots = order.iter().map(|&slot| self.slots[slot].clone()).collect();
        self.check_order(flips)
    }

    fn check_order(&self, flips: &mut Flips) -> bool {
        let mut any = false;
        for place in 1..self.slots.len() {
            let unsure = self.slots[place - 1].ends[0][0].may_cross(self.slots[place].ends[0][0]);
            any |= unsure;
            if self.layers[place].near() < self.layers[place - 1].near() {
                flips.order(unsure);
            }
        }
        any
    }

    /// Opens a slot; returns its place, and whether the order is in doubt.
    fn insert(
        &mut self,
        common: &Common,
        arrival: &BoundedContribution,
        flips: &mut Flips,
    ) -> (usize, bool) {
        self.sort(&mut Flips::default());
        let place = self
            .slots
            .iter()
            .filter(|slot| slot.near() <= arrival.depth_word)
            .count();
        self.layers
            .insert(place, Layer::Open(Open::new(arrival.golden)));
        self.slots.insert(place, SlotBounds::new(common, arrival));
        (place, self.check_order(flips))
    }

    /// Transmittance in front of each slot on the machine, given golden's windows, and whether any
    /// window may differ.
    fn seen(
        &self,
        rules: &WindowRules,
        common: &Common,
        windows: &[LayerVisibility],
    ) -> (Vec<Near>, bool) {
        let fragment = &common.machine.fragment;
        let mut through = Near::exact(1.0);
        let mut doubt = false;
        let mut seen = Vec::new();
        let mut window: Option<(Open, SlotBounds)> = None;
        for (place, layer) in self.layers.iter().enumerate() {
            let slot = &self.slots[place];
            if let (Layer::Open(open), Some((_, of_window))) = (layer, &window) {
                let start = of_window.ends[0][0];
                doubt |= slot
                    .mean_depth(common, open, rules.scale)
                    .may_cross(start + rules.epsilon);
            }
            if windows[place].first == place
                && let Some((open, slot)) = window.take()
            {
                through = fragment.real_through_window(through, slot.opacity(common, &open));
            }
            if let Layer::Open(open) = layer {
                window = Some(match window.take() {
                    None => (*open, slot.clone()),
                    Some((whole, mut of_whole)) => {
                        let whole = whole.with(open);
                        of_whole.join(common, slot, &whole);
                        (whole, of_whole)
                    }
                });
            }
            let mut seen_here = through;
            for before in &self.slots[..place] {
                let Some(closed) = &before.closed else {
                    continue;
                };
                let rest = || fragment.real_rest(common.machine.real_read(closed.light)[3]);
                let behind = if slot.near() < before.far() {
                    closed.through[0]
                } else {
                    rest()
                };
                seen_here = fragment.real_through_closed(seen_here, behind);
                doubt |= slot.ends[0][0].may_cross(before.ends[1][1]);
            }
            seen.push(seen_here);
        }
        (seen, doubt)
    }

    /// Overflow: repeats the machine's decision.
    fn overflow(
        &mut self,
        rules: &WindowRules,
        common: &Common,
        arrival: &BoundedContribution,
        decision: Decision,
        flips: &mut Flips,
    ) {
        let (_, order_unsure) = self.insert(common, arrival, flips);
        let deepest = self.layers.len() - 1;
        let mut windows = Vec::new();
        rules.rule.windows(&self.layers, &mut windows);
        let (seen, window_unsure) = self.seen(rules, common, &windows);
        let is_split = |seen: &Near| places(seen.low()) != places(seen.high());
        let unsure = order_unsure || window_unsure;
        let evicts = rules.evict_hidden && windows[deepest].transmittance == 0.0;
        let evicted = matches!(decision, Decision::Evicted(_));
        if evicts != evicted {
            flips.eviction(
                unsure
                    || places(seen[deepest].low()).is_some()
                        != places(seen[deepest].high()).is_some(),
            );
        } else if !evicted {
            let wanted = rules
                .rule
                .sums
                .then(|| rules.rule.pair_to_sum(&self.layers, &windows))
                .flatten();
            let taken = if let Decision::Summed(front, _) = decision {
                Some(usize::from(front))
            } else {
                None
            };
            if wanted != taken {
                // The costs of the two pairs depend on the transmittance in front of them.
                let split = [wanted, taken]
                    .into_iter()
                    .flatten()
                    .any(|front| is_split(&seen[front]));
                flips.sum(unsure || split || self.may_sum_others(rules, &windows, wanted, taken));
            }
        }
        match decision {
            Decision::Summed(front, _) => self.sum(common, usize::from(front)),
            Decision::Closed(_, inside) => self.close(common, deepest - 1, inside, flips),
            _ => {}
        }
        self.layers.truncate(deepest);
        self.slots.truncate(deepest);
    }

    /// Whether one of two pairs may be too wide to be summed, or their costs may be equal.
    fn may_sum_others(
        &self,
        rules: &WindowRules,
        windows: &[LayerVisibility],
        a: Option<usize>,
        b: Option<usize>,
    ) -> bool {
        let epsilon = rules.epsilon;
        let union = |front: usize| {
            let ([near, far], other) = (
                [self.slots[front].ends[0][0], self.slots[front].ends[1][1]],
                self.slots[front + 1].ends[1][1],
            );
            (far.max(other) - near, far.max(other))
        };
        let cost = |front: usize| {
            let (
                (width, far),
                LayerVisibility {
                    first,
                    transmittance,
                    ..
                },
            ) = (union(front), windows[front]);
            let start = self.slots[first].ends[0][0];
            let of_one = first == windows[front + 1].first;
            (if of_one {
                width * (epsilon + far - start)
            } else {
                (epsilon * epsilon).times(2.0)
            })
            .times(transmittance)
        };
        let wide = [a, b]
            .into_iter()
            .flatten()
            .any(|front| union(front).0.may_cross(epsilon));
        wide || if let (Some(a), Some(b)) = (a, b) {
            cost(a).may_cross(cost(b))
        } else {
            false
        }
    }

    fn sum(&mut self, common: &Common, front: usize) {
        let (Layer::Open(a), Layer::Open(b)) = (self.layers[front], self.layers[front + 1]) else {
            return;
        };
        let whole = a.with(&b);
        let other = self.slots.remove(front + 1);
        self.layers.remove(front + 1);
        self.layers[front] = Layer::Open(whole);
        self.slots[front].join(common, &other, &whole);
    }

    /// Closes a slot and the one behind it, and combines the two.
    fn close(&mut self, common: &Common, front: usize, inside: bool, flips: &mut Flips) {
        let back = self.closed(common, front + 1);
        let ClosedPair { golden, near } = self.closed(common, front);
        self.layers[front] = Layer::Closed(golden);
        self.slots[front].closed = Some(near);
        let ends = [
            self.slots[front + 1].ends[0][0],
            self.slots[front + 1].ends[1][1],
        ];
        let end_words = [self.slots[front + 1].near(), self.slots[front + 1].far()];
        if inside != (common.rules.window.inside && golden.encloses(&back.golden)) {
            let own = &self.slots[front];
            flips.inside(own.ends[0][1].may_cross(ends[0]) || own.ends[1][1].may_cross(ends[1]));
        }
        if inside {
            let light = common.machine.real_read(back.near.light);
            self.put_inside(common, front, &back.golden, light, end_words, ends, flips);
        } else {
            self.put_behind(common, front, &back, flips);
        }
    }

    fn put_behind(&mut self, common: &Common, front: usize, back: &ClosedPair, flips: &mut Flips) {
        let behind = self.slots[front + 1].clone();
        let Layer::Closed(golden) = &mut self.layers[front] else {
            return;
        };
        let slot = &mut self.slots[front];
        let is_farther = behind.far() > slot.far();
        let unsure = behind.ends[1][1].may_cross(slot.ends[1][1]);
        let Some(near) = &mut slot.closed else { return };
        if is_farther != (back.golden.far() > golden.far()) {
            flips.order(unsure);
        }
        golden.put_over_as(&back.golden, is_farther);
        common
            .machine
            .fragment
            .real_put_behind(near, &back.near, is_farther);
        *near = near_to(near, golden);
        if is_farther {
            (slot.end_words[1], slot.ends[1]) = (behind.end_words[1], behind.ends[1]);
        }
    }

    /// A slot after it is closed.
    fn closed(&self, common: &Common, place: usize) -> ClosedPair {
        let slot = &self.slots[place];
        match (&self.layers[place], &slot.closed) {
            (Layer::Closed(golden), Some(near)) => ClosedPair {
                golden: *golden,
                near: *near,
            },
            (Layer::Open(open), _) => {
                let golden = Closed::of_one(
                    common.shader.premultiplied(&open.sums),
                    Surface {
                        span: open.span,
                        weight: open.sums.weight,
                    },
                );
                let sums = slot.bounds.sums(common, &open.sums);
                let shaded = around(
                    common.machine.real_shade(&common.lighting, &sums),
                    golden.colour,
                );
                let near = common.machine.fragment.real_closed(shaded, sums.weight);
                ClosedPair {
                    golden,
                    near: near_to(&near, &golden),
                }
            }
            (Layer::Closed(golden), None) => ClosedPair {
                golden: *golden,
                near: unknown(),
            },
        }
    }

    /// The pixel over the background, with windows that start where the machine's do, and the bound
    /// on the machine's.
    pub fn resolve(
        &mut self,
        rules: &WindowRules,
        common: &Common,
        flips: &mut Flips,
    ) -> [Near; 4] {
        self.sort(flips);
        let mut starts: Vec<bool> = (0..self.layers.len())
            .map(|place| self.starts >> place & 1 == 1)
            .collect();
        let mut place = 0;
        while place < self.layers.len() {
            let next = (place + 1..starts.len())
                .find(|at| starts[*at])
                .unwrap_or(starts.len());
            self.check_window(rules, common, place, next, flips);
            (place + 1..next).for_each(|_| self.sum_ahead(common, place));
            starts.drain(place + 1..next);
            let window = self.closed(common, place);
            self.layers[place] = Layer::Closed(window.golden);
            self.slots[place].closed = Some(window.near);
            if place > 0 {
                let ends = [self.slots[place].ends[0][0], self.slots[place].ends[1][1]];
                let end_words = [self.slots[place].near(), self.slots[place].far()];
                let last = &self.slots[place - 1];
                let inside = rules.rule.inside
                    && last.end_words[0][1] < end_words[0]
                    && end_words[1] < last.end_words[1][1];
                let Layer::Closed(golden) = &self.layers[place - 1] else {
                    return [Near::exact(f64::NAN); 4];
                };
                if inside != (rules.rule.inside && golden.encloses(&window.golden)) {
                    flips.inside(
                        last.ends[0][1].may_cross(ends[0]) || last.ends[1][1].may_cross(ends[1]),
                    );
                }
                if inside {
                    let light = common.machine.real_read(window.near.light);
                    self.put_inside(
                        common,
                        place - 1,
                        &window.golden,
                        light,
                        end_words,
                        ends,
                        flips,
                    );
                    self.layers.remove(place);
                    self.slots.remove(place);
                    starts.remove(place);
                    continue;
                }
            }
            place += 1;
        }
        let (mut lights, mut front) = (Vec::new(), DVec4::ZERO);
        for (layer, slot) in self.layers.iter().zip(&self.slots) {
            if let (Layer::Closed(golden), Some(near)) = (layer, &slot.closed) {
                front = over(front, golden.colour);
                lights.push(common.machine.real_read(near.light));
            }
        }
        let exact = over(front, DVec4::from_array(common.shader.background()));
        around(
            common.machine.real_resolve(&lights, common.background),
            exact,
        )
    }

    /// Adds the slot behind, whatever its distance.
    fn sum_ahead(&mut self, common: &Common, front: usize) {
        if let (Layer::Open(_), Layer::Open(_)) = (&self.layers[front], &self.layers[front + 1]) {
            self.sum(common, front);
        } else {
            // The machine cannot have done this; the slot is dropped and the pictures will differ.
            self.layers.remove(front + 1);
            self.slots.remove(front + 1);
        }
    }

    /// Compares the end of the machine's window with golden's.
    fn check_window(
        &self,
        rules: &WindowRules,
        common: &Common,
        first: usize,
        end: usize,
        flips: &mut Flips,
    ) {
        let start = self.slots[first].ends[0][0];
        for place in first + 1..(end + 1).min(self.layers.len()) {
            let (Layer::Open(_), Layer::Open(next)) = (&self.layers[first], &self.layers[place])
            else {
                return;
            };
            let joins = rules
                .rule
                .is_of_window(self.layers[first].near(), &self.layers[place]);
            if joins != (place < end) {
                flips.window(
                    self.slots[place]
                        .mean_depth(common, next, rules.scale)
                        .may_cross(start + rules.epsilon),
                );
            }
        }
    }
}

impl WindowRules<'_> {
    fn single(&self, arrival: &BoundedContribution, own: &SplatLight) -> Single<Near> {
        Single {
            weight: arrival.weight,
            opacity: arrival.attributes[OPACITY],
            light: own.light,
        }
    }
}

impl SplatLight {
    fn arrival(&self, arrival: &BoundedContribution) -> window::LitContribution {
        window::LitContribution {
            sums: arrival.golden,
            colour: self.golden,
            opacity: self.opacity,
        }
    }
}

impl SlotBounds {
    /// Opacity of an open slot, as in step 4.
    fn opacity(&self, common: &Common, golden: &Open) -> Near {
        let known = |error: f64| {
            if self.bounds.overflowed {
                f64::INFINITY
            } else {
                error
            }
        };
        let weight = Near::within(
            golden.sums.weight,
            known(self.bounds.weight_error(&common.limits)),
        );
        let opacity = Near::within(
            golden.sums.alpha,
            known(
                self.bounds
                    .sum_error(OPACITY, 0.0, common.limits.attribute_loss(OPACITY)),
            ),
        );
        common
            .machine
            .fragment
            .real_window_opacity(weight, opacity, common.coverage_threshold)
    }
}

/// The same bounds around golden's own slot.
fn near_to(near: &real::Closed<Near>, golden: &Closed) -> real::Closed<Near> {
    real::Closed {
        light: around(near.light, golden.colour),
        weights: [
            near.weights[0].around(golden.front.weight),
            near.weights[1].around(golden.back.weight),
        ],
        through: [
            near.through[0].around(golden.behind_front),
            near.through[1].around(golden.before_back),
        ],
    }
}

fn around(near: [Near; 4], exact: DVec4) -> [Near; 4] {
    [0, 1, 2, 3].map(|i| near[i].around(exact[i]))
}

/// A slot without any bound.
fn unknown() -> real::Closed<Near> {
    let unknown = Near {
        value: 0.0,
        error: f64::INFINITY,
    };
    real::Closed {
        light: [unknown; 4],
        weights: [unknown; 2],
        through: [unknown; 2],
    }
}

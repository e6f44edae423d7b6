//! Window: keeps at most `l` layers of one pixel as clusters of depth, and groups them like `ideal`
//! while they are still separate (docs/book/algorithm-resolve.md §11).
//! ```text
//! contribution ─► 1 a cluster spans it? ─► accumulate          7 close: shade two, one over or inside the other
//!                 2 its surface closed? ─► late, or inside     6 sum: two clusters of one window become one
//!                 3 room? ───────────────► insert              5 evict: the deepest is hidden
//!                 else ─► 4 windows of ε and their transmittance ─► 5, 6 or 7
//! ```
//! Open layers are sums, closed ones premultiplied colours. Each step is a function with the step's
//! number, on layers in the order of their nearest depths, so that a led renderer can run them one
//! by one.
//!
//! Laws (tests/golden_window.rs): `windows_equal_ideal_where_every_surface_has_a_slot`,
//! `the_figures_of_the_check_scene_in_surface_order`.

use std::ops::Range;

use glam::{DVec3, DVec4};
use rayon::prelude::*;

use super::footprint::{Footprint, Weights};
use super::fragments::{Fragment, Side};
pub use super::intervals::Span;
use super::intervals::nearest_that_stays_within;
use super::shade::{Shader, over};
use super::tiles::{Cover, PIXELS_IN_A_TILE, Painter, fill, footprints};
use super::{Decision, Group, Outcomes, Rendering, Rules};
use crate::scene::Scene;

/// Smaller transmittances are 0.
const LEAST_SEEN: f64 = 1.0 / 256.0;
/// Greatest opacity at the centre of a splat between two surfaces.
const MOST_INSIDE: f64 = 0.95;
/// The weight at which a splat between two surfaces hides by exactly its opacity.
const FULL_INSIDE: f64 = 0.5;
/// Opacity from which a closed layer has a colour.
const LEAST_OPACITY: f64 = 1e-9;
/// Least value of the remaining coverage of a late contribution.
const LEAST_REST: f64 = 1e-6;

/// Extinction of a splat per weight, from its opacity: −ln(1 − α)/0.5, with α at most 0.95.
pub fn density(opacity: f64) -> f64 {
    -libm::log1p(-opacity.min(MOST_INSIDE)) / FULL_INSIDE
}

/// A contribution, and its splat's appearance.
#[derive(Clone, Copy, Debug)]
pub struct LitContribution {
    /// The contribution as a fragment of its own.
    pub sums: Fragment,
    /// `col`: the splat's own colour under the lights.
    pub colour: DVec3,
    /// α of the splat.
    pub opacity: f64,
}

/// A cluster of contributions.
#[derive(Clone, Copy, Debug, Default)]
pub struct Open {
    /// Weighted sums of its contributions.
    pub sums: Fragment,
    /// Σw·z.
    pub depth: f64,
    /// lo and hi.
    pub span: Span,
}

/// One surface of a closed layer.
#[derive(Clone, Copy, Debug, Default)]
pub struct Surface {
    /// Depths of the surface.
    pub span: Span,
    /// Sum of weights.
    pub weight: f64,
}

/// Surfaces that were blended, from the front to the back.
#[derive(Clone, Copy, Debug, Default)]
pub struct Closed {
    /// C, premultiplied, and A.
    pub colour: DVec4,
    /// [lo, loh] and Wl.
    pub front: Surface,
    /// [hil, hi] and Wh.
    pub back: Surface,
    /// TF: transmittance behind the front.
    pub behind_front: f64,
    /// TB: transmittance before the back.
    pub before_back: f64,
}

/// One slot of a pixel.
#[derive(Clone, Copy, Debug)]
pub enum Layer {
    /// A cluster that still takes contributions.
    Open(Open),
    /// Surfaces that were blended.
    Closed(Closed),
}

/// Result of step 4 for one layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerVisibility {
    /// The layer at which its window starts.
    pub first: usize,
    /// Nearest depth of its window.
    pub start: f64,
    /// T: transmittance of the layers before it, a power of two or 0.
    pub transmittance: f64,
}

impl Open {
    /// A cluster of one contribution.
    pub fn new(sums: Fragment) -> Self {
        Open {
            sums,
            depth: sums.weight * sums.z,
            span: Span::at(sums.z),
        }
    }

    /// Adds one contribution.
    pub fn add(&mut self, sums: &Fragment) {
        self.sums.add(sums);
        self.depth += sums.weight * sums.z;
        self.span = self.span.with(sums.z);
    }

    /// Step 6: the sum with a cluster behind it; the material is the front's.
    pub fn with(mut self, back: &Open) -> Self {
        self.sums.add(&back.sums);
        self.depth += back.depth;
        self.span = self.span.union(back.span);
        self
    }

    /// Σw·z/W.
    pub fn mean_depth(&self) -> f64 {
        // All of its weights may have underflowed.
        if self.sums.weight > 0.0 {
            self.depth / self.sums.weight
        } else {
            self.span.near
        }
    }
}

impl Layer {
    /// lo.
    pub fn near(&self) -> f64 {
        match self {
            Layer::Open(open) => open.span.near,
            Layer::Closed(closed) => closed.front.span.near,
        }
    }
}

impl Default for Layer {
    fn default() -> Self {
        Layer::Open(Open::default())
    }
}

impl Closed {
    /// A closed layer from a contribution or a cluster that is one surface.
    pub fn of_one(colour: DVec4, part: Surface) -> Self {
        Closed {
            colour,
            front: part,
            back: part,
            behind_front: 1.0 - colour.w,
            before_back: 1.0,
        }
    }

    /// lo.
    pub fn near(&self) -> f64 {
        self.front.span.near
    }

    /// hi.
    pub fn far(&self) -> f64 {
        self.back.span.far
    }

    /// Whether a closed layer lies between its front and its back.
    pub fn encloses(&self, other: &Closed) -> bool {
        self.front.span.far < other.near() && other.far() < self.far()
    }

    /// Step 7, over: `back` is put behind it.
    pub fn put_over(&mut self, back: &Closed) {
        self.put_over_as(back, back.far() > self.far());
    }

    /// [`Closed::put_over`]; `is_farther` is whether the back reaches farther.
    pub fn put_over_as(&mut self, back: &Closed, is_farther: bool) {
        let through = 1.0 - self.colour.w;
        if is_farther {
            self.before_back = through * back.before_back;
            self.back = back.back;
        }
        self.colour = over(self.colour, back.colour);
    }

    /// Step 7, inside: `x` is put between its front and its back. It is treated as one colour.
    pub fn put_inside(&mut self, x: &Closed) {
        self.put_inside_at(x, self.is_nearer_to_the_back(x));
    }

    /// Whether an inside layer is nearer to the back than to the front.
    pub fn is_nearer_to_the_back(&self, x: &Closed) -> bool {
        x.near() + x.far() >= self.front.span.far + self.back.span.near
    }

    /// [`Closed::put_inside`]; the argument is whether `x` is nearer to the back.
    pub fn put_inside_at(&mut self, x: &Closed, nearer_to_the_back: bool) {
        let [opacity, hidden] = [self.colour.w, x.colour.w];
        let through = 1.0 - opacity;
        // Transmittance in front of x: that of the front, or, nearer to the back, that in front of
        // the back.
        let mut seen = self.behind_front.max(through);
        if nearer_to_the_back {
            seen = self.before_back.max(through).min(seen);
        }
        let own = if opacity > LEAST_OPACITY {
            self.colour.truncate() / opacity
        } else {
            DVec3::ZERO
        };
        let colour =
            self.colour.truncate() + x.colour.truncate() * seen - own * (hidden * (seen - through));
        self.colour = colour.extend(1.0 - through * (1.0 - hidden));
        self.before_back *= 1.0 - hidden;
    }
}

/// The parameters of the rule's steps.
#[derive(Clone, Copy)]
pub struct Window<'a> {
    /// Shades a cluster when it is closed.
    pub shader: &'a Shader,
    /// ε.
    pub z_threshold: f64,
    /// A contribution joins a cluster that stays narrower than this.
    pub reach: f64,
    /// `window.late` of the rules.
    pub late: bool,
    /// `window.inside` of the rules.
    pub inside: bool,
    /// `evict_hidden` of the rules.
    pub evict_hidden: bool,
    /// Whether clusters are summed on overflow.
    pub sums: bool,
}

impl<'a> Window<'a> {
    /// The parameters of a machine's rules, with ε of the scene.
    pub fn new(rules: &Rules, z_threshold: f64, shader: &'a Shader) -> Self {
        let clusters = rules.group == Group::Window;
        Window {
            shader,
            z_threshold,
            reach: if clusters {
                rules.window.join * z_threshold
            } else {
                z_threshold
            },
            late: rules.window.late,
            inside: rules.window.inside,
            evict_hidden: rules.evict_hidden,
            sums: clusters,
        }
    }

    /// Step 1: the cluster that a contribution of this depth joins.
    pub fn slot_for(&self, z: f64, layers: &[Layer]) -> Option<usize> {
        let open = layers
            .iter()
            .enumerate()
            .filter_map(|(slot, layer)| match layer {
                Layer::Open(open) => Some((slot, open.span)),
                Layer::Closed(_) => None,
            });
        nearest_that_stays_within(self.reach, z, open)
    }

    /// Step 2: the closed layer that a contribution of this depth is late for, and its side; on
    /// ties the lowest layer, its front first.
    pub fn late_for(&self, z: f64, layers: &[Layer]) -> Option<(usize, Side)> {
        let closed = layers
            .iter()
            .enumerate()
            .filter_map(|(slot, layer)| match layer {
                Layer::Open(_) => None,
                Layer::Closed(closed) => Some((slot, closed)),
            });
        let (mut least, mut nearest) = (f64::INFINITY, None);
        for (slot, closed) in closed {
            for (side, part) in [(Side::Front, closed.front), (Side::Back, closed.back)] {
                let gap = part.span.gap(z);
                if part.span.with(z).width() < self.z_threshold && gap < least {
                    (least, nearest) = (gap, Some((slot, side)));
                }
            }
        }
        nearest
    }

    /// Step 2: adds a late contribution, up to the coverage that its surface leaves.
    pub fn add_late(&self, closed: &mut Closed, side: Side, new: &LitContribution) {
        let (weight, threshold) = (new.sums.weight, self.shader.coverage_threshold());
        let part = match side {
            Side::Front => &mut closed.front,
            Side::Back => &mut closed.back,
        };
        let had = new.opacity * part.weight.min(threshold) / threshold;
        let adds = new.opacity * (threshold - part.weight).min(weight).max(0.0) / threshold;
        let share = if adds > 0.0 {
            (adds / (1.0 - had).max(LEAST_REST)).min(1.0)
        } else {
            0.0
        };
        part.weight += weight;
        part.span = part.span.with(new.sums.z);
        let late = (new.colour * share).extend(share);
        match side {
            Side::Front => {
                closed.colour = over(late, closed.colour);
                closed.behind_front *= 1.0 - share;
                closed.before_back *= 1.0 - share;
            }
            Side::Back => closed.colour = over(closed.colour, late),
        }
    }

    /// Step 2: the last closed layer that spans this depth.
    pub fn around(&self, z: f64, layers: &[Layer]) -> Option<usize> {
        layers.iter().rposition(
            |layer| matches!(layer, Layer::Closed(closed) if closed.near() < z && z < closed.far()),
        )
    }

    /// Step 2: a contribution as a layer that is put inside a closed one.
    pub fn splat_inside(new: &LitContribution) -> Closed {
        let opacity = -libm::expm1(-density(new.opacity) * new.sums.weight);
        let part = Surface {
            span: Span::at(new.sums.z),
            weight: new.sums.weight,
        };
        Closed::of_one((new.colour * opacity).extend(opacity), part)
    }

    /// Step 3: sorts layers by their nearest depths; stable on ties.
    pub fn sort(layers: &mut [Layer]) {
        layers.sort_by(|a, b| a.near().total_cmp(&b.near()));
    }

    /// Step 4: window and transmittance of each layer, front to back.
    pub fn windows(&self, layers: &[Layer], seen: &mut Vec<LayerVisibility>) {
        seen.clear();
        // The window that may still grow, and the transmittance of those before it.
        let mut window: Option<(usize, f64, Fragment)> = None;
        let mut through = 1.0;
        for (slot, layer) in layers.iter().enumerate() {
            let joins = window.filter(|(_, start, _)| self.is_of_window(*start, layer));
            if joins.is_none()
                && let Some((_, _, sums)) = window.take()
            {
                through *= 1.0 - self.opacity(&sums);
            }
            let (first, start) =
                joins.map_or((slot, layer.near()), |(first, start, _)| (first, start));
            if let Layer::Open(open) = layer {
                let sums = joins.map_or(open.sums, |(_, _, mut sums)| {
                    sums.add(&open.sums);
                    sums
                });
                window = Some((first, start, sums));
            }
            let transmittance = power_of_two(layers[..slot].iter().fold(
                through,
                |through, before| match before {
                    Layer::Open(_) => through,
                    Layer::Closed(closed) => through * closed.lets_through(layer.near()),
                },
            ));
            seen.push(LayerVisibility {
                first,
                start,
                transmittance,
            });
        }
    }

    /// Whether a layer belongs to the window that starts at this depth.
    pub fn is_of_window(&self, start: f64, layer: &Layer) -> bool {
        matches!(layer, Layer::Open(open) if open.mean_depth() - start < self.z_threshold)
    }

    /// Opacity of sums.
    pub fn opacity(&self, sums: &Fragment) -> f64 {
        if sums.weight > 0.0 {
            sums.alpha / sums.weight * (sums.weight / self.shader.coverage_threshold()).min(1.0)
        } else {
            0.0
        }
    }

    /// Step 6: the front of the best pair to sum, if any two may be summed; on ties the one nearer
    /// to the eye.
    pub fn pair_to_sum(&self, layers: &[Layer], seen: &[LayerVisibility]) -> Option<usize> {
        let (mut least, mut front) = (f64::INFINITY, None);
        for slot in 0..layers.len() - 1 {
            let (Layer::Open(a), Layer::Open(b)) = (&layers[slot], &layers[slot + 1]) else {
                continue;
            };
            let union = Span {
                near: a.span.near,
                far: a.span.far.max(b.span.far),
            };
            let start = (seen[slot].first == seen[slot + 1].first).then_some(seen[slot].start);
            let cost = seen[slot].transmittance * self.cost_of_sum(union, start);
            if union.width() < self.z_threshold && cost < least {
                (least, front) = (cost, Some(slot));
            }
        }
        front
    }

    /// Step 6: cost of the error of a sum of these depths; `start` is the start of their window if
    /// both belong to one.
    pub fn cost_of_sum(&self, union: Span, start: Option<f64>) -> f64 {
        let epsilon = self.z_threshold;
        start.map_or(epsilon, |start| {
            union.width() * (epsilon + union.far - start) / (2.0 * epsilon)
        })
    }

    /// Step 7: a layer after it is closed.
    pub fn close(&self, layer: &Layer) -> Closed {
        match layer {
            Layer::Open(open) => Closed::of_one(
                self.shader.premultiplied(&open.sums),
                Surface {
                    span: open.span,
                    weight: open.sums.weight,
                },
            ),
            Layer::Closed(closed) => *closed,
        }
    }

    /// Step 7: puts the back inside the front if it lies there, otherwise behind it; returns
    /// whether inside.
    pub fn merge(&self, front: &mut Closed, back: &Closed) -> bool {
        let inside = self.inside && front.encloses(back);
        if inside {
            front.put_inside(back);
        } else {
            front.put_over(back);
        }
        inside
    }

    /// Adds one contribution to the layers of a pixel, the last of which is spare; returns its
    /// outcome.
    pub fn take(
        &self,
        layers: &mut [Layer],
        used: &mut usize,
        seen: &mut Vec<LayerVisibility>,
        new: &LitContribution,
    ) -> Decision {
        let z = new.sums.z;
        if let Some(slot) = self.slot_for(z, &layers[..*used])
            && let Layer::Open(open) = &mut layers[slot]
        {
            open.add(&new.sums);
            return Decision::Accumulated { slot };
        }
        if let Some((slot, side)) = self
            .late
            .then(|| self.late_for(z, &layers[..*used]))
            .flatten()
            && let Layer::Closed(closed) = &mut layers[slot]
        {
            self.add_late(closed, side, new);
            return Decision::Late { slot, side };
        }
        if let Some(slot) = self
            .inside
            .then(|| self.around(z, &layers[..*used]))
            .flatten()
            && let Layer::Closed(closed) = &mut layers[slot]
        {
            closed.put_inside(&Self::splat_inside(new));
            return Decision::Inside { slot };
        }
        let place = insert(&mut layers[..=*used], Open::new(new.sums));
        if *used + 1 < layers.len() {
            *used += 1;
            return Decision::Inserted { slot: place };
        }
        self.windows(layers, seen);
        let deepest = *used;
        if self.evict_hidden && seen[deepest].transmittance == 0.0 {
            return Decision::Evicted {
                slot: (place < deepest).then_some(place),
            };
        }
        if let Some(slot) = self.sums.then(|| self.pair_to_sum(layers, seen)).flatten()
            && let (Layer::Open(front), Layer::Open(back)) = (layers[slot], layers[slot + 1])
        {
            layers[slot] = Layer::Open(front.with(&back));
            layers[slot + 1..].rotate_left(1);
            return Decision::Summed { slot, place };
        }
        let mut front = self.close(&layers[deepest - 1]);
        let inside = self.merge(&mut front, &self.close(&layers[deepest]));
        layers[deepest - 1] = Layer::Closed(front);
        Decision::Closed {
            slot: deepest - 1,
            place,
            inside,
        }
    }

    /// The pixel: windows summed and closed, one inside or behind the other, over the background.
    pub fn resolve(&self, layers: &mut [Layer]) -> [f64; 4] {
        Self::sort(layers);
        let mut front = DVec4::ZERO;
        let mut last: Option<Closed> = None;
        let mut done = 0;
        while done < layers.len() {
            let (next, taken) = self.close_window(&layers[done..]);
            done += taken;
            match &mut last {
                Some(last) if self.inside && last.encloses(&next) => last.put_inside(&next),
                _ => {
                    front = over(
                        front,
                        last.replace(next).map_or(DVec4::ZERO, |last| last.colour),
                    )
                }
            }
        }
        let front = over(front, last.map_or(DVec4::ZERO, |last| last.colour));
        over(front, DVec4::from_array(self.shader.background())).to_array()
    }

    /// The window that starts with the first layer, closed, and its number of layers.
    fn close_window(&self, layers: &[Layer]) -> (Closed, usize) {
        let Layer::Open(mut window) = layers[0] else {
            return (self.close(&layers[0]), 1);
        };
        let start = window.span.near;
        let mut taken = 1;
        while let Some(Layer::Open(next)) = layers.get(taken).copied() {
            if !self.is_of_window(start, &Layer::Open(next)) {
                break;
            }
            window = window.with(&next);
            taken += 1;
        }
        (self.close(&Layer::Open(window)), taken)
    }
}

impl Closed {
    /// Transmittance for a layer behind it that starts at this depth: that of its front only, if
    /// the layer is in front of its back.
    fn lets_through(&self, near: f64) -> f64 {
        if near < self.far() {
            self.behind_front
        } else {
            1.0 - self.colour.w
        }
    }
}

/// Step 3: inserts a new cluster in order, behind its equals; the last place is spare. Returns its
/// place.
fn insert(layers: &mut [Layer], new: Open) -> usize {
    let last = layers.len() - 1;
    Window::sort(&mut layers[..last]);
    let place =
        layers[..last].partition_point(|layer| layer.near().total_cmp(&new.span.near).is_le());
    layers[last] = Layer::Open(new);
    layers[place..].rotate_right(1);
    place
}

/// Rounded down to a power of two; 0 below the least transmittance.
fn power_of_two(transmittance: f64) -> f64 {
    const EXPONENT: u64 = 0xfff0_0000_0000_0000;
    if transmittance >= LEAST_SEEN {
        f64::from_bits(transmittance.to_bits() & EXPONENT)
    } else {
        0.0
    }
}

/// A footprint and its splat's own colour.
struct LitFootprint {
    footprint: Footprint,
    colour: DVec3,
}

impl Cover for LitFootprint {
    type Contribution = LitContribution;

    fn sides(&self) -> [Range<u32>; 2] {
        self.footprint.sides()
    }

    fn contribute(
        &self,
        columns: Range<u32>,
        rows: Range<u32>,
        mut take: impl FnMut([u32; 2], LitContribution),
    ) {
        let (colour, opacity) = (self.colour, self.footprint.opacity);
        self.footprint.contribute(columns, rows, |pixel, sums| {
            take(
                pixel,
                LitContribution {
                    sums,
                    colour,
                    opacity,
                },
            )
        });
    }
}

/// Draws a scene of surfaces.
pub(super) fn draw(scene: &Scene, shader: &Shader, rules: &Rules) -> Rendering {
    let (footprints, culled) = footprints(scene, shader, rules.turn_normals, Weights::default());
    let light = |footprint: Footprint| LitFootprint {
        colour: shader.emission(&footprint),
        footprint,
    };
    let lit: Vec<LitFootprint> = footprints.into_par_iter().map(light).collect();
    let pixels = || WindowPainter::new(rules, scene.surface.z_threshold, shader);
    Rendering {
        culled,
        ..fill(&scene.image, &lit, shader.background(), pixels)
    }
}

/// The fragments of one tile.
pub(super) struct WindowPainter<'a> {
    window: Window<'a>,
    /// Slots per pixel, including the spare one.
    slots: usize,
    /// A pixel's slots are contiguous.
    layers: Vec<Layer>,
    /// Slots in use, per pixel.
    used: Vec<usize>,
    seen: Vec<LayerVisibility>,
    outcomes: Outcomes,
}

impl<'a> WindowPainter<'a> {
    pub fn new(rules: &Rules, z_threshold: f64, shader: &'a Shader) -> Self {
        let slots = rules.layers.max(1) + 1;
        WindowPainter {
            window: Window::new(rules, z_threshold, shader),
            slots,
            layers: vec![Layer::default(); PIXELS_IN_A_TILE * slots],
            used: vec![0; PIXELS_IN_A_TILE],
            seen: Vec::with_capacity(slots),
            outcomes: Outcomes::default(),
        }
    }

    /// Takes one contribution and returns its outcome.
    pub fn decide(&mut self, pixel: usize, new: &LitContribution) -> Decision {
        let first = pixel * self.slots;
        self.window.take(
            &mut self.layers[first..first + self.slots],
            &mut self.used[pixel],
            &mut self.seen,
            new,
        )
    }

    /// The layers of one pixel in slot order.
    pub fn layers(&mut self, pixel: usize) -> &mut [Layer] {
        let first = pixel * self.slots;
        &mut self.layers[first..first + self.used[pixel]]
    }
}

impl Painter for WindowPainter<'_> {
    type Contribution = LitContribution;

    fn take(&mut self, pixel: usize, contribution: LitContribution) {
        let decision = self.decide(pixel, &contribution);
        self.outcomes.count(decision);
    }

    fn finish(&mut self, pixel: usize) -> [f64; 4] {
        let window = self.window;
        let layers = self.layers(pixel);
        let (colour, count) = (window.resolve(layers), layers.len() as u64);
        self.outcomes.most_surfaces_in_a_pixel = self.outcomes.most_surfaces_in_a_pixel.max(count);
        self.used[pixel] = 0;
        colour
    }

    fn outcomes(&self) -> Outcomes {
        self.outcomes
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Merge, WindowOptions};
    use super::*;

    /// τ.
    const COVERS: f64 = 0.25;
    const GREY: DVec3 = DVec3::splat(0.5);

    fn rules(layers: usize, join: f64) -> Rules {
        let window = WindowOptions {
            join,
            ..WindowOptions::default()
        };
        Rules {
            layers,
            group: Group::Window,
            merge: Merge::Window,
            window,
            ..Rules::default()
        }
    }

    /// Grey, of full weight.
    fn at(z: f64, opacity: f64) -> LitContribution {
        let sums = Fragment {
            weight: 1.0,
            rgb: GREY,
            alpha: opacity,
            normal: DVec3::NEG_Z,
            z,
            ..Fragment::default()
        };
        LitContribution {
            sums,
            colour: GREY,
            opacity,
        }
    }

    fn weighing(weight: f64, arrival: LitContribution) -> LitContribution {
        let Fragment {
            rgb, alpha, normal, ..
        } = arrival.sums;
        let sums = Fragment {
            weight,
            rgb: rgb * weight,
            alpha: alpha * weight,
            normal: normal * weight,
            ..arrival.sums
        };
        LitContribution { sums, ..arrival }
    }

    fn open(z: f64, opacity: f64) -> Layer {
        Layer::Open(Open::new(at(z, opacity).sums))
    }

    fn part(near: f64, far: f64, weight: f64) -> Surface {
        Surface {
            span: Span { near, far },
            weight,
        }
    }

    /// Two grey surfaces of opacity ½, front over back, which cover half.
    fn closed(front: [f64; 2], back: [f64; 2]) -> Closed {
        let colour = (GREY * 0.75).extend(0.75);
        let [front, back] = [front, back].map(|[near, far]| part(near, far, COVERS / 2.0));
        Closed {
            colour,
            front,
            back,
            behind_front: 0.5,
            before_back: 0.5,
        }
    }

    /// Decisions about these contributions at ε = 1, the final nearest depths of the slots, and the
    /// pixel.
    fn drawn(rules: &Rules, arrivals: &[LitContribution]) -> (Vec<Decision>, Vec<f64>, [f64; 4]) {
        let shader = Shader::unlit(COVERS);
        let mut pixels = WindowPainter::new(rules, 1.0, &shader);
        let decisions = arrivals
            .iter()
            .map(|arrival| pixels.decide(0, arrival))
            .collect();
        let near = pixels.layers(0).iter().map(Layer::near).collect();
        let window = pixels.window;
        (decisions, near, window.resolve(pixels.layers(0)))
    }

    fn last(rules: &Rules, depths: &[f64], opacity: f64) -> (Decision, Vec<f64>) {
        let arrivals: Vec<LitContribution> = depths.iter().map(|z| at(*z, opacity)).collect();
        let (decisions, near, _) = drawn(rules, &arrivals);
        (decisions[decisions.len() - 1], near)
    }

    fn with_rule<T>(rules: &Rules, read: impl FnOnce(&Window) -> T) -> T {
        read(&Window::new(rules, 1.0, &Shader::unlit(COVERS)))
    }

    fn seen(layers: &[Layer]) -> Vec<LayerVisibility> {
        let mut seen = Vec::new();
        with_rule(&rules(8, 0.0), |window| window.windows(layers, &mut seen));
        seen
    }

    fn assert_near(colour: DVec4, expected: DVec4) {
        assert!(
            (colour - expected).abs().max_element() < 1e-15,
            "{colour}, not {expected}"
        );
    }

    // --- Step 1 ---

    #[test]
    fn a_contribution_joins_the_cluster_that_spans_it() {
        let clusters = [9.0, 10.0, 9.5, 9.25];
        // The third contribution leaves 9 and 10 separate; the pixel overflows at two slots, where
        // 9 and 9.5 are summed.
        let (decision, near) = last(&rules(2, 0.0), &clusters, 0.0);
        assert_eq!(
            (decision, near),
            (Decision::Accumulated { slot: 0 }, vec![9.0, 10.0])
        );
        assert_eq!(
            last(&rules(2, 0.0), &[9.0, 9.0], 0.0).0,
            Decision::Accumulated { slot: 0 }
        );
        assert_eq!(
            last(&rules(2, 0.0), &[9.0, 9.001], 0.0).0,
            Decision::Inserted { slot: 1 }
        );
    }

    #[test]
    fn a_contribution_joins_the_nearest_cluster_that_stays_narrow_and_the_lowest_on_ties() {
        let rules = rules(8, 0.5);
        assert_eq!(
            last(&rules, &[10.0, 10.4375], 0.0).0,
            Decision::Accumulated { slot: 0 }
        );
        assert_eq!(
            last(&rules, &[10.0, 10.5], 0.0).0,
            Decision::Inserted { slot: 1 }
        );
        assert_eq!(
            last(&rules, &[10.0, 10.5, 10.25], 0.0).0,
            Decision::Accumulated { slot: 0 }
        );
        assert_eq!(
            last(&rules, &[10.0, 10.5, 10.375], 0.0).0,
            Decision::Accumulated { slot: 1 }
        );
        assert_eq!(
            last(&rules, &[10.5, 10.0, 10.25], 0.0).0,
            Decision::Accumulated { slot: 0 }
        );
    }

    #[test]
    fn intervals_join_up_to_the_threshold_and_are_not_summed() {
        let rules = Rules {
            group: Group::Interval,
            ..rules(2, 0.0)
        };
        assert_eq!(
            last(&rules, &[10.0, 10.75, 10.5, 9.875], 0.0),
            (Decision::Accumulated { slot: 0 }, vec![9.875])
        );
        assert_eq!(
            last(&rules, &[10.0, 10.75, 9.75], 0.0),
            (Decision::Inserted { slot: 0 }, vec![9.75, 10.0])
        );
        assert_eq!(
            last(&rules, &[10.0, 10.75, 11.0, 9.75], 0.0).0,
            Decision::Closed {
                slot: 1,
                place: 0,
                inside: false
            }
        );
    }

    // --- Step 2 ---

    #[test]
    fn a_late_contribution_goes_to_the_nearest_surface_that_stays_narrow() {
        let layers = [
            open(0.0, 0.0),
            Layer::Closed(closed([10.0, 10.5], [14.0, 14.0])),
            Layer::Closed(closed([15.0, 15.0], [20.0, 20.0])),
        ];
        let late = |z| with_rule(&rules(8, 0.0), |window| window.late_for(z, &layers));
        assert_eq!(late(9.75), Some((1, Side::Front)));
        assert_eq!(late(9.5), None);
        assert_eq!(late(11.0), None);
        assert_eq!(late(14.25), Some((1, Side::Back)));
        assert_eq!(late(14.5), Some((1, Side::Back)));
        assert_eq!(late(14.625), Some((2, Side::Front)));
        assert_eq!(late(20.5), Some((2, Side::Back)));
        assert_eq!(late(0.0), None);
    }

    #[test]
    fn a_contribution_equally_near_to_both_surfaces_is_late_for_the_front() {
        let layers = [Layer::Closed(closed([10.0, 10.0], [10.5, 10.5]))];
        let late = |z| with_rule(&rules(8, 0.0), |window| window.late_for(z, &layers));
        assert_eq!(late(10.25), Some((0, Side::Front)));
        assert_eq!(late(10.375), Some((0, Side::Back)));
    }

    #[test]
    fn a_late_front_covers_what_its_surface_did_not() {
        let mut late = closed([10.0, 10.0], [14.0, 14.0]);
        let white = LitContribution {
            colour: DVec3::ONE,
            ..weighing(COVERS / 4.0, at(9.5, 0.5))
        };
        with_rule(&rules(8, 0.0), |window| {
            window.add_late(&mut late, Side::Front, &white)
        });
        // It had ½·½, and half of that is added: a sixth of the ¾ that were left.
        let (share, rest) = (1.0 / 6.0, 5.0 / 6.0);
        assert_near(
            late.colour,
            DVec4::splat(share) + closed([0.0; 2], [0.0; 2]).colour * rest,
        );
        assert!(
            (late.behind_front - 0.5 * rest).abs() < 1e-15
                && (late.before_back - 0.5 * rest).abs() < 1e-15
        );
        assert_eq!(
            (late.front.span, late.front.weight),
            (
                Span {
                    near: 9.5,
                    far: 10.0
                },
                COVERS * 0.75
            )
        );
        assert_eq!(late.back.weight, COVERS / 2.0);
    }

    #[test]
    fn a_late_back_is_blended_behind_everything() {
        let mut late = closed([10.0, 10.0], [14.0, 14.0]);
        let white = LitContribution {
            colour: DVec3::ONE,
            ..weighing(COVERS / 4.0, at(14.5, 0.5))
        };
        with_rule(&rules(8, 0.0), |window| {
            window.add_late(&mut late, Side::Back, &white)
        });
        assert_near(
            late.colour,
            closed([0.0; 2], [0.0; 2]).colour + DVec4::splat(0.25 / 6.0),
        );
        assert_eq!((late.behind_front, late.before_back), (0.5, 0.5));
        assert_eq!(
            (late.back.span, late.back.weight),
            (
                Span {
                    near: 14.0,
                    far: 14.5
                },
                COVERS * 0.75
            )
        );
    }

    #[test]
    fn a_covering_surface_takes_no_more_colour() {
        let mut late = closed([10.0, 10.0], [14.0, 14.0]);
        late.front.weight = COVERS;
        with_rule(&rules(8, 0.0), |window| {
            window.add_late(&mut late, Side::Front, &at(10.0, 0.5))
        });
        assert_eq!(
            (late.colour, late.front.weight),
            (closed([0.0; 2], [0.0; 2]).colour, COVERS + 1.0)
        );
        // Half covered and opaque: only the other half is left.
        let mut late = closed([10.0, 10.0], [14.0, 14.0]);
        with_rule(&rules(8, 0.0), |window| {
            window.add_late(&mut late, Side::Front, &at(10.0, 1.0))
        });
        assert_eq!((late.colour, late.behind_front), (GREY.extend(1.0), 0.0));
    }

    #[test]
    fn a_contribution_inside_belongs_to_the_last_layer_that_spans_it() {
        let layers = [[10.0, 20.0], [12.0, 18.0], [30.0, 40.0]]
            .map(|[near, far]| Layer::Closed(closed([near; 2], [far; 2])));
        let around = |z| with_rule(&rules(8, 0.0), |window| window.around(z, &layers));
        let found = [11.0, 12.0, 15.0, 18.0, 10.0, 20.0, 25.0, 35.0].map(around);
        assert_eq!(
            found,
            [
                Some(0),
                Some(0),
                Some(1),
                Some(0),
                None,
                None,
                None,
                Some(2)
            ]
        );
    }

    #[test]
    fn a_splat_inside_hides_by_its_weight() {
        let opacity = |weight, opacity| {
            Window::splat_inside(&weighing(weight, at(1.0, opacity)))
                .colour
                .w
        };
        assert!((opacity(0.5, 0.75) - 0.75).abs() < 1e-15);
        assert!((opacity(1.0, 0.75) - 0.9375).abs() < 1e-15);
        assert!((opacity(0.5, 1.0) - 0.95).abs() < 1e-15);
        assert_eq!(opacity(0.0, 1.0), 0.0);
    }

    #[test]
    fn an_inside_layer_is_behind_the_front_and_hides_the_back() {
        let white = |z| Closed::of_one(DVec4::splat(0.5), part(z, z, 1.0));
        let mut both = closed([10.0; 2], [20.0; 2]);
        both.put_inside(&white(12.0));
        // ½ grey, then ½·½ white, then ¼·½ grey.
        assert_near(both.colour, (GREY * 0.625 + 0.25).extend(0.875));
        assert_eq!((both.behind_front, both.before_back), (0.5, 0.25));
        // The middle counts as nearer to the back: only a quarter of it is visible, and three
        // quarters of what it hides was there.
        both.colour = DVec4::splat(0.875);
        both.put_inside(&white(15.0));
        assert_near(both.colour, DVec4::splat(0.9375));
        assert_eq!(both.before_back, 0.125);
    }

    #[test]
    fn a_transparent_layer_takes_the_colour_of_an_inside_layer() {
        let mut clear = Closed {
            colour: DVec4::ZERO,
            behind_front: 1.0,
            before_back: 1.0,
            ..closed([10.0; 2], [20.0; 2])
        };
        clear.put_inside(&Closed::of_one(DVec4::splat(0.5), part(12.0, 12.0, 1.0)));
        assert_eq!(clear.colour, DVec4::splat(0.5));
    }

    // --- Step 3 ---

    #[test]
    fn slots_are_sorted_by_nearest_depth_and_stable_on_ties() {
        assert_eq!(
            last(&rules(8, 0.0), &[30.0, 10.0, 20.0], 0.0),
            (Decision::Inserted { slot: 1 }, vec![10.0, 20.0, 30.0])
        );
        let mut layers = [
            open(10.0, 0.5),
            Layer::Closed(closed([10.0; 2], [12.0; 2])),
            open(9.0, 0.0),
            Layer::default(),
        ];
        assert_eq!(insert(&mut layers, Open::new(at(10.0, 0.0).sums)), 3);
        let order: Vec<bool> = layers
            .iter()
            .map(|layer| matches!(layer, Layer::Open(_)))
            .collect();
        assert_eq!(order, [true, true, false, true]);
    }

    // --- Step 4 ---

    #[test]
    fn windows_begin_at_the_nearest_depth_and_hide_layers_behind_them() {
        let found = seen(&[
            open(0.0, 0.4),
            open(0.75, 0.4),
            open(1.0, 0.9),
            open(2.0, 0.0),
        ]);
        let expected = [
            (0, 0.0, 1.0),
            (0, 0.0, 1.0),
            (2, 1.0, 0.5),
            (3, 2.0, 0.03125),
        ];
        assert_eq!(
            found,
            expected.map(|(first, start, transmittance)| LayerVisibility {
                first,
                start,
                transmittance
            })
        );
    }

    #[test]
    fn a_cluster_belongs_to_the_window_of_its_mean() {
        let mut wide = Open::new(at(0.5, 0.0).sums);
        wide.add(&at(1.25, 0.0).sums);
        assert_eq!(seen(&[open(0.0, 0.0), Layer::Open(wide)])[1].first, 0);
        wide.add(&at(1.375, 0.0).sums);
        assert_eq!(seen(&[open(0.0, 0.0), Layer::Open(wide)])[1].first, 1);
    }

    #[test]
    fn a_closed_layer_ends_a_window_and_hides_by_the_depth_of_the_next() {
        let layers = [
            open(0.0, 0.5),
            Layer::Closed(closed([0.25; 2], [5.0; 2])),
            open(0.5, 0.0),
            open(5.0, 0.0),
        ];
        let transmittances: Vec<f64> = seen(&layers)
            .iter()
            .map(|seen| seen.transmittance)
            .collect();
        assert_eq!(transmittances, [1.0, 0.5, 0.25, 0.125]);
        assert_eq!(seen(&layers)[2].first, 2);
    }

    #[test]
    fn transmittance_is_a_power_of_two_or_0() {
        let rounded = [
            1.0,
            0.9,
            0.5,
            0.49,
            1.0 / 256.0,
            0.0039,
            0.0,
            -0.1,
            f64::NAN,
        ]
        .map(power_of_two);
        assert_eq!(
            rounded,
            [1.0, 0.5, 0.5, 0.25, 1.0 / 256.0, 0.0, 0.0, 0.0, 0.0]
        );
    }

    // --- Steps 5 and 6 ---

    #[test]
    fn a_hidden_layer_is_dropped() {
        let layers = |last: f64| [at(10.0, 1.0), at(20.0, 0.5), at(last, 0.5)];
        let (decided, near, _) = drawn(&rules(2, 0.0), &layers(15.0));
        assert_eq!(
            (decided[2], near),
            (Decision::Evicted { slot: Some(1) }, vec![10.0, 15.0])
        );
        let (decided, near, _) = drawn(&rules(2, 0.0), &layers(25.0));
        assert_eq!(
            (decided[2], near),
            (Decision::Evicted { slot: None }, vec![10.0, 20.0])
        );
        let (decided, ..) = drawn(
            &Rules {
                evict_hidden: false,
                ..rules(2, 0.0)
            },
            &layers(25.0),
        );
        assert_eq!(
            decided[2],
            Decision::Closed {
                slot: 1,
                place: 2,
                inside: false
            }
        );
    }

    #[test]
    fn the_pair_that_errs_least_is_summed() {
        // 0.25·(1 + 0.25)/2 against 0.25·(1 + 0.5)/2.
        assert_eq!(
            last(&rules(2, 0.0), &[0.25, 0.0, 0.5], 0.0),
            (Decision::Summed { slot: 0, place: 2 }, vec![0.0, 0.5])
        );
        // 0.75·1.75/2 of one window against 1 of two windows, although the latter two are nearer.
        assert_eq!(
            last(&rules(2, 0.0), &[0.0, 0.75, 1.25], 0.0).0,
            Decision::Summed { slot: 0, place: 2 }
        );
        // Half visible, the deeper pair costs half.
        let arrivals = [at(0.0, 0.5), at(0.25, 0.5), at(5.0, 0.0), at(5.25, 0.0)];
        assert_eq!(
            drawn(&rules(3, 0.0), &arrivals).0[3],
            Decision::Summed { slot: 2, place: 3 }
        );
    }

    #[test]
    fn on_equal_costs_the_nearer_pair_is_summed() {
        let arrivals = [at(0.0, 0.0), at(0.25, 0.0), at(5.0, 0.0), at(5.25, 0.0)];
        assert_eq!(
            drawn(&rules(3, 0.0), &arrivals).0[3],
            Decision::Summed { slot: 0, place: 3 }
        );
        let hidden = [
            at(0.0, 1.0),
            at(5.0, 0.0),
            at(5.75, 0.0),
            at(8.0, 0.0),
            at(8.25, 0.0),
        ];
        let rules = Rules {
            evict_hidden: false,
            ..rules(4, 0.0)
        };
        assert_eq!(
            drawn(&rules, &hidden).0[4],
            Decision::Summed { slot: 1, place: 4 }
        );
    }

    #[test]
    fn a_sum_keeps_the_material_of_its_front_and_spans_both() {
        let of_material = |z, material| {
            Open::new(Fragment {
                material,
                ..at(z, 0.5).sums
            })
        };
        let sum = of_material(0.25, 1).with(&of_material(0.75, 2));
        assert_eq!(
            (sum.sums.material, sum.span, sum.depth, sum.sums.weight),
            (
                1,
                Span {
                    near: 0.25,
                    far: 0.75
                },
                1.0,
                2.0
            )
        );
    }

    // --- Step 7 ---

    #[test]
    fn two_layers_too_far_apart_are_closed() {
        let (decision, near) = last(&rules(2, 0.0), &[10.0, 1.0, 11.0], 0.5);
        assert_eq!(
            (decision, near),
            (
                Decision::Closed {
                    slot: 1,
                    place: 2,
                    inside: false
                },
                vec![1.0, 10.0]
            )
        );
    }

    #[test]
    fn a_closed_surface_is_one_part() {
        let closed = with_rule(&rules(2, 0.0), |window| window.close(&open(3.0, 0.5)));
        assert_eq!(
            (closed.colour, closed.behind_front, closed.before_back),
            ((GREY * 0.5).extend(0.5), 0.5, 1.0)
        );
        assert_eq!(
            (
                closed.near(),
                closed.far(),
                closed.front.weight,
                closed.back.weight
            ),
            (3.0, 3.0, 1.0, 1.0)
        );
    }

    #[test]
    fn over_takes_the_deeper_back() {
        let one = |z| Closed::of_one((GREY * 0.5).extend(0.5), part(z, z, z));
        let mut both = one(1.0);
        both.put_over(&one(5.0));
        assert_eq!(
            (both.colour, both.behind_front, both.before_back),
            ((GREY * 0.75).extend(0.75), 0.5, 0.5)
        );
        assert_eq!(
            (both.far(), both.front.weight, both.back.weight),
            (5.0, 1.0, 5.0)
        );
        both.put_over(&one(3.0));
        assert_eq!(
            (both.colour.w, both.before_back, both.far()),
            (0.875, 0.5, 5.0)
        );
    }

    #[test]
    fn an_enclosed_layer_is_blended_inside() {
        let rule = rules(2, 0.0);
        let arrivals = [
            at(10.0, 0.5),
            at(1.0, 0.5),
            at(11.5, 0.5),
            at(0.0, 0.5),
            at(5.0, 0.5),
        ];
        // 1 and 10 and 11.5 are closed; 5 lies within their depths.
        let decided = drawn(&rule, &arrivals).0;
        assert_eq!(decided[4], Decision::Inside { slot: 1 });
        let outside = Rules {
            window: WindowOptions {
                inside: false,
                ..WindowOptions::default()
            },
            ..rule
        };
        assert_eq!(
            drawn(&outside, &arrivals).0[4],
            Decision::Closed {
                slot: 1,
                place: 2,
                inside: false
            }
        );
        let mut around = closed([10.0; 2], [20.0; 2]);
        let within = Closed::of_one(DVec4::splat(0.5), part(12.0, 12.0, 1.0));
        assert!(
            with_rule(&rule, |window| window.merge(&mut around, &within)) && around.far() == 20.0
        );
        assert!(!with_rule(&outside, |window| window.merge(&mut around, &within)));
    }

    #[test]
    fn a_late_contribution_finds_its_surface() {
        let arrivals = [
            at(10.0, 0.5),
            at(1.0, 0.5),
            at(20.0, 0.5),
            at(19.5, 0.5),
            at(9.5, 0.5),
        ];
        let rule = rules(2, 0.0);
        assert_eq!(
            drawn(&rule, &arrivals).0[3..],
            [
                Decision::Late {
                    slot: 1,
                    side: Side::Back
                },
                Decision::Late {
                    slot: 1,
                    side: Side::Front
                }
            ]
        );
        let never = Rules {
            window: WindowOptions {
                late: false,
                ..WindowOptions::default()
            },
            ..rule
        };
        assert_eq!(drawn(&never, &arrivals).0[3], Decision::Inside { slot: 1 });
    }

    // --- Resolve ---

    #[test]
    fn a_pixel_is_its_windows_front_to_back() {
        assert_eq!(drawn(&rules(2, 0.0), &[]).2, [0.0; 4]);
        assert_eq!(
            drawn(&rules(2, 0.0), &[at(3.0, 0.5)]).2,
            [0.25, 0.25, 0.25, 0.5]
        );
        // One window of three clusters; then two windows.
        assert_eq!(
            drawn(
                &rules(3, 0.0),
                &[at(3.0, 0.5), at(3.75, 0.5), at(3.25, 0.5)]
            )
            .2,
            [0.25, 0.25, 0.25, 0.5]
        );
        assert_eq!(
            drawn(&rules(3, 0.0), &[at(3.0, 0.5), at(4.0, 0.5)]).2,
            [0.375, 0.375, 0.375, 0.75]
        );
    }

    #[test]
    fn a_window_that_a_closed_layer_encloses_is_blended_inside() {
        let white = Layer::Open(Open::new(Fragment {
            rgb: DVec3::ONE,
            ..at(12.0, 0.5).sums
        }));
        let pixel = |rules: &Rules| {
            with_rule(rules, |window| {
                window.resolve(&mut [white, Layer::Closed(closed([10.0; 2], [20.0; 2]))])
            })
        };
        assert_eq!(pixel(&rules(2, 0.0)), [0.5625, 0.5625, 0.5625, 0.875]);
        let window = WindowOptions {
            inside: false,
            ..WindowOptions::default()
        };
        assert_eq!(
            pixel(&Rules {
                window,
                ..rules(2, 0.0)
            }),
            [0.5, 0.5, 0.5, 0.875]
        );
    }

    // --- Arbitrary input ---

    #[test]
    fn arbitrary_numbers_are_accepted() {
        let odd = [
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            -0.0,
            0.0,
            1e-300,
            1e300,
            -1.0,
            0.5,
            0.75,
            10.0,
            11.0,
            30.0,
        ];
        for group in [Group::Window, Group::Interval] {
            for layers in [1, 2, 3, 8] {
                let shader = Shader::unlit(COVERS);
                let rules = Rules {
                    group,
                    ..rules(layers, 0.25)
                };
                let mut pixels = WindowPainter::new(&rules, 1.0, &shader);
                for step in 0..2000 {
                    let pick = |stride: usize| odd[(step * stride + step / 7) % odd.len()];
                    let mut arrival = weighing(pick(5), at(pick(1), pick(3)));
                    arrival.colour = DVec3::splat(pick(2));
                    pixels.take(0, arrival);
                }
                pixels.finish(0);
                assert_eq!(pixels.outcomes().total(), 2000);
            }
        }
    }
}

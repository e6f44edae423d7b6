//! Windows: the pixels of a tile whose fragments are grouped by intervals or windows, in mixed
//! precision.
//!
//! The layers are golden's, in machine units, and so are the decisions that depend only on depths.
//! Sums, blends and transmittances are computed in the chosen words.

use super::{FrameWords, MixedContribution, number};
use crate::golden::Outcomes;
use crate::golden::fragments::{Fragment, Side};
use crate::golden::tiles::{PIXELS_IN_A_TILE, Painter};
use crate::golden::window::{self, Closed, Layer, LayerVisibility, Open, Surface, Window};
use crate::hardware::registers::WindowWords;
use glam::DVec4;
use rtl_model::real::MixedPrecision;
use rtl_model::units::fragment::window::real;

/// T below 2^−this is 0.
const LEAST_VISIBLE_LOG2: u32 = 8;

/// The pixels of a tile.
pub(super) struct WindowPixels<'a> {
    frame: &'a FrameWords<'a>,
    words: &'a WindowWords<MixedPrecision<'a>>,
    rule: Window<'a>,
    pixels: Vec<Vec<Layer>>,
}

impl<'a> WindowPixels<'a> {
    pub fn new(frame: &'a FrameWords<'a>, words: &'a WindowWords<MixedPrecision<'a>>) -> Self {
        let rule = Window {
            reach: words.reach.value,
            ..Window::new(&frame.stage.rules, frame.z_threshold, frame.shader)
        };
        WindowPixels {
            frame,
            words,
            rule,
            pixels: vec![Vec::new(); PIXELS_IN_A_TILE],
        }
    }

    /// An open layer after one more contribution.
    fn add(&self, open: &mut Open, arrival: &MixedContribution) {
        let fragment = &self.frame.stage.machine.fragment;
        self.frame.accumulate(&mut open.sums, arrival);
        let [sum, weight, depth] =
            [open.depth, arrival.weight, arrival.depth].map(|value| self.frame.word(value));
        open.depth = fragment.real_depth_sum(sum, weight, depth).value;
        open.span = open.span.with(arrival.depth);
    }

    fn single(&self, arrival: &MixedContribution) -> real::Single<MixedPrecision<'a>> {
        let word = |value: f64| self.frame.word(value);
        real::Single {
            weight: word(arrival.weight),
            opacity: word(arrival.footprint.attributes[3]),
            light: arrival.footprint.light.map(word),
        }
    }

    fn inside(&self, arrival: &MixedContribution) -> [MixedPrecision<'a>; 4] {
        let (fragment, single) = (&self.frame.stage.machine.fragment, self.single(arrival));
        let opacity = arrival.footprint.attributes[3];
        fragment.real_splat_inside(&single, opacity, &self.words.registers, &self.words.tables)
    }

    fn in_words(&self, closed: &Closed) -> real::Closed<MixedPrecision<'a>> {
        let word = |value: f64| self.frame.word(value);
        real::Closed {
            light: closed.colour.to_array().map(word),
            weights: [closed.front.weight, closed.back.weight].map(word),
            through: [closed.behind_front, closed.before_back].map(word),
        }
    }

    /// Whether a layer belongs to the window that starts at a depth.
    fn joins(&self, start: f64, layer: &Layer) -> bool {
        let Layer::Open(open) = layer else {
            return false;
        };
        let (end, weight) = (start + self.rule.z_threshold, open.sums.weight);
        if weight > 0.0 {
            open.depth < weight * end
        } else {
            open.span.near < end
        }
    }

    /// Transmittance of a closed layer for a layer behind it that begins at a depth.
    fn behind(&self, closed: &Closed, near: f64) -> MixedPrecision<'a> {
        let words = self.in_words(closed);
        let machine = self.frame.stage.machine;
        if near < closed.far() {
            words.through[0]
        } else {
            machine
                .fragment
                .real_rest(machine.real_read(words.light)[3])
        }
    }

    /// Step 4: the window and the transmittance of each layer, front to back.
    fn windows(&self, layers: &[Layer]) -> Vec<LayerVisibility> {
        let fragment = &self.frame.stage.machine.fragment;
        let mut seen = Vec::with_capacity(layers.len());
        // The window that may still grow: its first place, its start, Σw and Σw·α.
        let mut growing: Option<(usize, f64, [f64; 2])> = None;
        let mut through = self.frame.word(1.0);
        for (place, layer) in layers.iter().enumerate() {
            let joined = growing.filter(|(_, start, _)| self.joins(*start, layer));
            if let (None, Some((_, _, sums))) = (joined, growing.take()) {
                let [weight, opacity] = sums.map(|sum| self.frame.word(sum));
                let opacity = fragment.real_window_opacity(
                    weight,
                    opacity,
                    self.frame.word(self.frame.coverage_threshold),
                );
                through = fragment.real_through_window(through, opacity);
            }
            let (first, start, [weight, opacity]) =
                joined.unwrap_or((place, layer.near(), [0.0; 2]));
            if let Layer::Open(open) = layer {
                growing = Some((
                    first,
                    start,
                    [weight + open.sums.weight, opacity + open.sums.alpha],
                ));
            }
            let mut here = through;
            for before in &layers[..place] {
                if let Layer::Closed(closed) = before {
                    here = fragment.real_through_closed(here, self.behind(closed, layer.near()));
                }
            }
            let places = (0..=LEAST_VISIBLE_LOG2)
                .find(|places| here.value * f64::from(1u32 << places) >= 1.0);
            seen.push(LayerVisibility {
                first,
                start,
                transmittance: places.map_or(0.0, |places| 1.0 / f64::from(1u32 << places)),
            });
        }
        seen
    }

    /// Step 6: the sum of a layer and the one behind it.
    fn summed(&self, a: &Open, b: &Open) -> Open {
        let fragment = &self.frame.stage.machine.fragment;
        let exact = a.with(b);
        let two = |lane: usize, sum: f64| fragment.real_two(lane, self.frame.word(sum)).value;
        let Fragment {
            weight,
            rgb,
            alpha,
            normal,
            ..
        } = exact.sums;
        let sums = Fragment {
            weight: two(0, weight),
            rgb: glam::DVec3::new(two(1, rgb.x), two(2, rgb.y), two(3, rgb.z)),
            alpha: two(4, alpha),
            normal: glam::DVec3::new(two(5, normal.x), two(6, normal.y), two(7, normal.z)),
            ..exact.sums
        };
        Open {
            sums,
            depth: fragment
                .real_depth_of_two(self.frame.word(exact.depth))
                .value,
            span: exact.span,
        }
    }

    /// Step 7: a layer after it is closed.
    fn closed(&self, layer: &Layer) -> Closed {
        match layer {
            Layer::Closed(closed) => *closed,
            Layer::Open(open) => {
                let shaded = self.frame.light(&open.sums);
                let near = self
                    .frame
                    .stage
                    .machine
                    .fragment
                    .real_closed(shaded, self.frame.word(open.sums.weight));
                let part = Surface {
                    span: open.span,
                    weight: open.sums.weight,
                };
                with(&Closed::of_one(DVec4::ZERO, part), &near)
            }
        }
    }

    fn put_inside(
        &self,
        closed: &Closed,
        light: [MixedPrecision<'a>; 4],
        [near, far]: [f64; 2],
    ) -> Closed {
        let mut words = self.in_words(closed);
        let nearer_the_back = near + far >= closed.front.span.far + closed.back.span.near;
        self.frame
            .stage
            .machine
            .fragment
            .real_put_inside(&mut words, light, nearer_the_back);
        with(closed, &words)
    }

    /// Step 7: the back inside the front if it lies there, otherwise behind it.
    fn merge(&self, front: &Closed, back: &Closed) -> Closed {
        let machine = self.frame.stage.machine;
        let behind = self.in_words(back);
        if self.rule.inside && front.encloses(back) {
            return self.put_inside(
                front,
                machine.real_read(behind.light),
                [back.near(), back.far()],
            );
        }
        let (mut words, is_farther) = (self.in_words(front), back.far() > front.far());
        machine
            .fragment
            .real_put_behind(&mut words, &behind, is_farther);
        let mut merged = *front;
        if is_farther {
            merged.back = back.back;
        }
        with(&merged, &words)
    }

    /// Steps 4 to 7: overflow by one layer.
    fn overflow(&self, layers: &mut Vec<Layer>) {
        let deepest = layers.len() - 1;
        let seen = self.windows(layers);
        if self.rule.evict_hidden && seen[deepest].transmittance == 0.0 {
            layers.truncate(deepest);
            return;
        }
        if let Some(front) = self
            .rule
            .sums
            .then(|| self.rule.pair_to_sum(layers, &seen))
            .flatten()
            && let (Layer::Open(a), Layer::Open(b)) = (layers[front], layers[front + 1])
        {
            layers[front] = Layer::Open(self.summed(&a, &b));
            layers.remove(front + 1);
            return;
        }
        let merged = self.merge(
            &self.closed(&layers[deepest - 1]),
            &self.closed(&layers[deepest]),
        );
        layers.truncate(deepest);
        layers[deepest - 1] = Layer::Closed(merged);
    }
}

/// A closed layer with the values that a slot of words holds.
fn with(closed: &Closed, words: &real::Closed<MixedPrecision>) -> Closed {
    let [front, back] = words.weights.map(number);
    Closed {
        colour: DVec4::from_array(words.light.map(number)),
        front: Surface {
            weight: front,
            ..closed.front
        },
        back: Surface {
            weight: back,
            ..closed.back
        },
        behind_front: words.through[0].value,
        before_back: words.through[1].value,
    }
}

impl<'a> Painter for WindowPixels<'a> {
    type Contribution = MixedContribution<'a>;

    fn take(&mut self, pixel: usize, arrival: MixedContribution<'a>) {
        let z = arrival.depth;
        let mut layers = std::mem::take(&mut self.pixels[pixel]);
        if let Some(slot) = self.rule.slot_for(z, &layers)
            && let Layer::Open(open) = &mut layers[slot]
        {
            self.add(open, &arrival);
        } else if let Some((slot, side)) = self
            .rule
            .late
            .then(|| self.rule.late_for(z, &layers))
            .flatten()
            && let Layer::Closed(closed) = &mut layers[slot]
        {
            let mut words = self.in_words(closed);
            let threshold = self.frame.word(self.frame.coverage_threshold);
            let fragment = &self.frame.stage.machine.fragment;
            fragment.real_late(
                &mut words,
                usize::from(side == Side::Back),
                &self.single(&arrival),
                threshold,
            );
            *closed = with(closed, &words);
            let part = if side == Side::Front {
                &mut closed.front
            } else {
                &mut closed.back
            };
            part.span = part.span.with(z);
        } else if let Some(slot) = self
            .rule
            .inside
            .then(|| self.rule.around(z, &layers))
            .flatten()
            && let Layer::Closed(closed) = &layers[slot]
        {
            layers[slot] = Layer::Closed(self.put_inside(closed, self.inside(&arrival), [z, z]));
        } else {
            let (material, pixel) = (
                arrival.footprint.material,
                arrival.pixel.map(|place| place as u16),
            );
            let sums = Fragment {
                z,
                material,
                pixel,
                ..Fragment::default()
            };
            let mut fresh = Open {
                sums,
                depth: 0.0,
                span: window::Span::at(z),
            };
            self.add(&mut fresh, &arrival);
            Window::sort(&mut layers);
            let place = layers.partition_point(|layer| layer.near() <= z);
            layers.insert(place, Layer::Open(fresh));
            if layers.len() > self.frame.stage.rules.layers {
                self.overflow(&mut layers);
            }
        }
        self.pixels[pixel] = layers;
    }

    fn finish(&mut self, pixel: usize) -> [f64; 4] {
        let mut layers = std::mem::take(&mut self.pixels[pixel]);
        Window::sort(&mut layers);
        let mut done: Vec<Closed> = Vec::new();
        let mut place = 0;
        while place < layers.len() {
            let mut window = layers[place];
            let start = window.near();
            place += 1;
            while place < layers.len()
                && let (Layer::Open(whole), Layer::Open(next)) = (window, layers[place])
                && self.joins(start, &layers[place])
            {
                window = Layer::Open(self.summed(&whole, &next));
                place += 1;
            }
            let window = self.closed(&window);
            match done.last_mut() {
                Some(last) if self.rule.inside && last.encloses(&window) => {
                    let light = self
                        .frame
                        .stage
                        .machine
                        .real_read(self.in_words(&window).light);
                    *last = self.put_inside(last, light, [window.near(), window.far()]);
                }
                _ => done.push(window),
            }
        }
        let machine = self.frame.stage.machine;
        let lights: Vec<[MixedPrecision; 4]> = done
            .iter()
            .map(|closed| machine.real_read(self.in_words(closed).light))
            .collect();
        machine
            .real_resolve(&lights, self.frame.background)
            .map(number)
    }

    fn outcomes(&self) -> Outcomes {
        Outcomes::default()
    }
}

//! Resolve: shades the remaining fragments of a pixel, blends them front to back over the
//! background and writes the frame word (docs/book/algorithm-resolve.md §7).
//!
//! ```text
//! layers in depth order ─►(× transmittance)─►(Σ)─►(+ background)─► frame
//! opacity ─►(1 − α')─►(×)─► transmittance
//! ```
//! Losses: `transmittance` is rounded at each layer. The sum is exact and rounded once, into
//! `frame`.
//!
//! Laws: `an_empty_pixel_is_background`, `an_opaque_layer_hides_all_behind_it`.

use crate::elaboration::latency::Path;
use crate::elaboration::{Elaboration, Operator};
use crate::graph::{Asked, Builder, Graph, Program, Wire};
use crate::machine::Machine;
use crate::num::{Exact, three};
use crate::probe::{Probe, Tap};
use crate::records::unit;

pub use crate::records::Layer;

const UNIT: &str = unit::RESOLVE;

/// One layer's step. Inputs are the transmittance, three sums, a layer's colour and its opacity;
/// results the transmittance behind the layer and the sums.
fn layered(g: &mut Builder, machine: &Machine, sum: Exact) -> [Wire; 4] {
    let (m, premultiplied) = (&machine.resolve, machine.shade.premultiplied);
    let transmittance = g.input(m.transmittance);
    let sums = three!(_i => g.state(sum, false));
    let colour = three!(_i => g.input(premultiplied));
    let opacity = g.input(premultiplied);
    let [red, green, blue] = three!(i => {
        let part = g.times(transmittance, colour[i]);
        g.plus_within(sums[i], part, sum)
    });
    let one = g.one(premultiplied);
    let through = g.minus_within(one, opacity, premultiplied.into());
    let through = g.natural(through);
    let behind = g.times(transmittance, through);
    [
        g.fit("transmittance", m.transmittance, behind),
        red,
        green,
        blue,
    ]
}

/// The frame word. Inputs are the transmittance, three sums, and the background's colour and alpha.
fn framed(g: &mut Builder, machine: &Machine, sum: Exact) -> [Wire; 4] {
    let m = &machine.resolve;
    let transmittance = g.input(m.transmittance);
    let sums = three!(_i => g.state(sum, false));
    let background = three!(_i => g.input(m.frame));
    let alpha = g.input(m.frame);
    let [red, green, blue] = three!(i => {
        let part = g.times(transmittance, background[i]);
        let whole = g.plus_within(sums[i], part, sum);
        g.at_most_one(whole)
    });
    let one = g.one(m.frame);
    let clear = g.rest(one, alpha, m.frame.into());
    let part = g.times(transmittance, clear);
    let whole = g.one(sum);
    let covered = g.rest(whole, part, sum);
    [red, green, blue, covered].map(|channel| g.fit("frame", m.frame, channel))
}

/// Elaborated unit.
#[derive(Clone, Debug)]
pub struct Resolve {
    layer: Graph<4>,
    frame: Graph<4>,
    programs: [Program; 2],
    asked: [Asked<4>; 2],
    /// 1 as a transmittance.
    clear: i64,
}

impl Resolve {
    /// Elaborates the unit.
    pub fn new(e: &mut Elaboration, machine: &Machine) -> Self {
        let m = &machine.resolve;
        for (name, word) in [("transmittance", m.transmittance), ("frame", m.frame)] {
            e.number(UNIT, name, word, false);
            e.holds_one(UNIT, name, word);
        }
        // The transmittances add up to at most 1, as do the layers' parts and the background.
        let [through, behind] = [machine.shade.premultiplied, m.frame]
            .map(|word| Exact::from(m.transmittance).times(word));
        let sum = through
            .plus(through)
            .plus(through)
            .plus(through)
            .plus(behind);
        // The three sums are registered. The transmittance register is loaded with 1, with the
        // value behind a layer, or keeps its value.
        e.copies(3, |e| e.part(UNIT, Operator::Register(sum.bits())));
        e.choice(UNIT, 3, m.transmittance.format.stored_bits());
        let g = &mut Builder::new(e, UNIT);
        let results = layered(g, machine, sum);
        let layer = g.build(results);
        let g = &mut Builder::new(e, UNIT);
        let results = framed(g, machine, sum);
        let frame = g.build(results);
        let asked = [&layer, &frame].map(Graph::asked_for_results);
        Resolve {
            programs: [layer.program(), frame.program()],
            asked,
            layer,
            frame,
            clear: m.transmittance.format.one(),
        }
    }

    /// Critical path of a layer. The next layer depends on its transmittance.
    pub fn layer_path(&self) -> Path {
        self.layer.path()
    }

    /// The step of a layer, and the frame word.
    pub fn graphs(&self) -> [&Graph<4>; 2] {
        [&self.layer, &self.frame]
    }

    /// Programs for batches: the step of a layer, and the frame word. The first four inputs of both
    /// are the state of a pixel, which starts as [`Resolve::clear`]. The results of the first
    /// program are the next state.
    pub fn programs(&self) -> &[Program; 2] {
        &self.programs
    }

    /// State of a pixel before its first layer: a transmittance of 1, and sums of 0.
    pub fn clear(&self) -> [i64; 4] {
        [self.clear, 0, 0, 0]
    }

    /// Blends layers, in depth order, over the background.
    pub fn one<P: Probe>(
        &self,
        layers: &[Layer],
        background: [i64; 4],
        tap: &mut Tap<P>,
    ) -> [i64; 4] {
        let mut state = self.clear();
        for Layer {
            colour: [r, g, b],
            opacity,
            ..
        } in layers
        {
            let [transmittance, sums @ ..] = state;
            let [x, y, z] = sums;
            state = self
                .layer
                .one(&[transmittance, x, y, z, *r, *g, *b, *opacity], tap);
        }
        let [transmittance, x, y, z] = state;
        let [r, g, b, alpha] = background;
        self.frame
            .one(&[transmittance, x, y, z, r, g, b, alpha], tap)
    }
}

pub mod real;

#[cfg(test)]
mod tests;

//! Resolve: shades what a pixel still holds, blends it front to back over the background and writes the frame word
//! (docs/book/algorithm-resolve.md §7).
//!
//! ```text
//! layers in depth order ─►(× transmittance)─►(Σ)─►(+ background)─► frame
//! opacity ─►(1 − α')─►(×)─► transmittance
//! ```
//! Losses: `transmittance` is rounded at each layer; the sum is exact and rounded once, into `frame`.
//!
//! Laws: `an_empty_pixel_is_background`, `an_opaque_layer_hides_all_behind_it`.

use crate::elaboration::latency::Path;
use crate::elaboration::{Elaboration, Operator};
use crate::machine::Machine;
use crate::num::{Fit, three};
use crate::probe::{Probe, Tap};
use crate::records::unit;

pub use crate::records::Layer;

const UNIT: &str = unit::RESOLVE;

/// Longest way of a layer: a product and a sum, in which the next layer waits for its transmittance.
pub fn layer(machine: &Machine) -> Path {
    let (transmittance, premultiplied) = (machine.resolve.transmittance.format.width(), machine.shade.premultiplied.format.width());
    Path::default().product(transmittance, premultiplied).sum(transmittance + premultiplied).fit(transmittance)
}

/// Longest way: a product and a sum for each layer.
pub fn path(machine: &Machine) -> Path {
    layer(machine).times(machine.fragment.layers)
}

/// The elaborated unit.
#[derive(Clone, Debug)]
pub struct Resolve {
    transmittance: Fit,
    frame: Fit,
    /// 1 as a transmittance, as an opacity, as a channel, as the exact sum.
    one: [i64; 4],
    /// Left shifts that align layers and background.
    align: [u32; 2],
}

impl Resolve {
    /// Elaborates the unit.
    pub fn new(e: &mut Elaboration, machine: &Machine) -> Self {
        let (m, premultiplied) = (&machine.resolve, machine.shade.premultiplied);
        for (name, word) in [("transmittance", m.transmittance), ("frame", m.frame)] {
            e.port(UNIT, name, word);
            e.signedness(UNIT, name, word, false);
            e.holds_one(UNIT, name, word);
        }
        // Three colours and what goes through; a layer after the other.
        let through = e.copies(4, |e| e.times(UNIT, m.transmittance, premultiplied));
        let behind = e.copies(4, |e| e.times(UNIT, m.transmittance, m.frame));
        let sum = through.plus(through).plus(through).plus(through).plus(behind);
        // A colour: a layer added, the background added.
        e.copies(3, |e| {
            e.part(UNIT, Operator::Register(sum.bits()));
            e.adders(UNIT, 2, sum.bits());
        });
        // Opacity: 1 less what goes through, which begins as 1; and 1 less a layer's, at least 0, and 1 less the background's.
        e.adders(UNIT, 1, sum.bits());
        e.choice(UNIT, 3, m.transmittance.format.width());
        e.limit(UNIT, premultiplied.format.width());
        e.adders(UNIT, 1, m.frame.format.width());
        let finest = through.frac_bits.max(behind.frac_bits);
        Resolve {
            transmittance: e.fit(UNIT, "transmittance", m.transmittance, through),
            frame: e.copies(4, |e| e.fit(UNIT, "frame", m.frame, sum)),
            one: [m.transmittance.format.one(), premultiplied.format.one(), m.frame.format.one(), 1 << finest.clamp(0, 62)],
            align: [through.frac_bits, behind.frac_bits].map(|bits| (finest - bits).clamp(0, 62) as u32),
        }
    }

    /// Blends layers, which stand in depth order, over the background.
    pub fn one<P: Probe>(&self, layers: &[Layer], background: [i64; 4], tap: &mut Tap<P>) -> [i64; 4] {
        let [transmittance_one, opacity_one, frame_one, sum_one] = self.one;
        let [of_layer, of_background] = self.align;
        let mut transmittance = transmittance_one;
        let mut sums = [0i64; 3];
        for layer in layers {
            for (sum, colour) in sums.iter_mut().zip(layer.colour) {
                *sum += (transmittance * colour) << of_layer;
            }
            transmittance = tap.fit_one(&self.transmittance, transmittance * (opacity_one - layer.opacity).max(0));
        }
        let colour = |channel: usize, tap: &mut Tap<P>| {
            let exact = sums[channel] + ((transmittance * background[channel]) << of_background);
            tap.fit_one(&self.frame, exact.min(sum_one))
        };
        let rgb = three!(channel => colour(channel, tap));
        let see_through = (transmittance * (frame_one - background[3])) << of_background;
        let alpha = tap.fit_one(&self.frame, sum_one - see_through);
        [rgb[0], rgb[1], rgb[2], alpha]
    }
}

pub mod real;

#[cfg(test)]
mod tests;

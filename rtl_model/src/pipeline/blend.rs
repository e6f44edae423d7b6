//! Blend: resolve's graphs over a batch of pixels, layer by layer.
//!
//! ```text
//! transmittance, sums ─►[ layer ]─┐ once for each layer of the deepest pixel ─►[ frame ]─► frame words
//!          └──────────────────────┘
//! ```
//! Law: `pixels_of_a_batch_blend_as_single_pixels`.

use crate::graph::{Batch, ROWS, Run};
use crate::kernels::host::Host;
use crate::num::LANES;
use crate::probe::Probe;
use crate::records::Layer;
use crate::units::resolve::Resolve;

/// Batches for the two graphs.
#[derive(Clone, Debug)]
pub struct Blender([Batch; 2]);

impl Blender {
    /// Batches for a unit.
    pub fn new(resolve: &Resolve) -> Self {
        Blender([0, 1].map(|nth| resolve.programs()[nth].batch()))
    }

    /// Blends the layers of up to [`BATCH`](crate::graph::BATCH) pixels, in depth order, over the
    /// background. Returns the channels of each row of pixels.
    pub fn blend<H: Host, P: Probe>(
        &mut self,
        host: H,
        resolve: &Resolve,
        pixels: &[&[Layer]],
        background: [i64; 4],
        probe: &mut P,
    ) -> [[[i32; LANES]; ROWS]; 4] {
        let Blender([layer, frame]) = self;
        let [layered, framed] = resolve.programs();
        let rows = pixels.len().div_ceil(LANES).min(ROWS);
        for (input, kept) in resolve.clear().into_iter().enumerate() {
            layer.set(layered, input, &[[kept; LANES]; ROWS][..rows]);
        }
        let deepest = pixels.iter().map(|layers| layers.len()).max().unwrap_or(0);
        for nth in 0..deepest {
            // Pixels with fewer layers get a transparent one.
            let (mut light, mut live) = ([[[0; LANES]; ROWS]; 4], [0; ROWS]);
            for (item, layers) in pixels.iter().enumerate() {
                let (row, lane) = (item / LANES % ROWS, item % LANES);
                if let Some(Layer {
                    colour: [r, g, b],
                    opacity,
                    ..
                }) = layers.get(nth)
                {
                    for (input, word) in [*r, *g, *b, *opacity].into_iter().enumerate() {
                        light[input][row][lane] = word as i32;
                    }
                    live[row] |= 1 << lane;
                }
            }
            for (input, words) in light.iter().enumerate() {
                layer.set(layered, 4 + input, &words[..rows]);
            }
            host.run(Run {
                program: layered,
                batch: layer,
                live: &live[..rows],
                probe: &mut *probe,
            });
            for kept in 0..4 {
                layer.carry(layered.output(kept), rows, layered.input(kept), layer);
            }
        }
        for (kept, word) in background.into_iter().enumerate() {
            layer.carry(layered.input(kept), rows, framed.input(kept), frame);
            frame.set(framed, 4 + kept, &[[word; LANES]; ROWS][..rows]);
        }
        let live: [u8; ROWS] = std::array::from_fn(|row| {
            ((1u32 << pixels.len().saturating_sub(row * LANES).min(LANES)) - 1) as u8
        });
        host.run(Run {
            program: framed,
            batch: frame,
            live: &live[..rows],
            probe,
        });
        let mut words = [[[0; LANES]; ROWS]; 4];
        for (channel, words) in words.iter_mut().enumerate() {
            frame.words(framed, channel, &mut words[..rows]);
        }
        words
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::host::{Unvectorised, Vectorised};
    use crate::machine::Machine;
    use crate::probe::{NoProbe, Ranges, Tap};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn pixels_of_a_batch_blend_as_single_pixels(
            name in prop::sample::select(Machine::NAMES.to_vec()),
            pixels in prop::collection::vec(prop::collection::vec(prop::array::uniform4(0u32..=1 << 16), 0..5), 1..=64),
            background in prop::array::uniform4(0u32..=1 << 16),
        ) {
            let machine = Machine::named(name).unwrap().elaborate().unwrap();
            let [light, frame] = [machine.machine.shade.premultiplied, machine.machine.resolve.frame].map(|word| word.format.one());
            let part = |one: i64, part: u32| (one * i64::from(part)) >> 16;
            let layer = |[r, g, b, opacity]: &[u32; 4]| Layer {
                colour: [r, g, b].map(|channel| part(light, *channel)),
                opacity: part(light, *opacity),
                ..Layer::default()
            };
            let pixels: Vec<Vec<Layer>> = pixels.iter().map(|layers| layers.iter().map(layer).collect()).collect();
            let background = background.map(|channel| part(frame, channel));
            let mut alone = Ranges::new(machine.signals.len());
            let words: Vec<[i64; 4]> =
                pixels.iter().map(|layers| machine.resolve.one(layers, background, &mut Tap::new(&mut alone))).collect();
            let layers: Vec<&[Layer]> = pixels.iter().map(Vec::as_slice).collect();
            let blended = |words: [[[i32; LANES]; ROWS]; 4]| -> Vec<[i64; 4]> {
                (0..layers.len()).map(|item| words.map(|rows| rows[item / LANES][item % LANES].into())).collect()
            };
            let blender = &mut Blender::new(&machine.resolve);
            let mut together = Ranges::new(machine.signals.len());
            prop_assert_eq!(&blended(blender.blend(Unvectorised, &machine.resolve, &layers, background, &mut together)), &words);
            prop_assert_eq!(format!("{together:?}"), format!("{alone:?}"));
            if let Some(host) = Vectorised::detect() {
                // Rows that were used before.
                prop_assert_eq!(&blended(blender.blend(host, &machine.resolve, &layers, background, &mut NoProbe)), &words);
            }
        }
    }
}

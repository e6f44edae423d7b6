//! Merges: the host shades the merging fragments of a tile in batches of eight, once eight are
//! queued. Until then a slot is closed and its colour is pending. It is not read before the pixel
//! overflows again, or the tile is resolved.
//!
//! Laws: `every_machine_that_elaborates_draws_every_frame`, `queued_merges_equal_immediate_ones`.

use super::fill::{Shared, TileEntries};
use super::shading::{ShadeEight, input_of, shade_for_merge};
use crate::kernels::host::Host;
use crate::kernels::{Accumulator, NO_MATCH, PackedSlot, PackedTile};
use crate::num::LANES;
use crate::probe::{Probe, Tap};
use crate::records::{Premultiplied, Slot};
use crate::units::fragment::{Fragment, Merging};
use crate::units::shade;
use std::cell::Cell;

/// Queued merges of a tile, to be shaded.
#[derive(Clone, Copy, Debug, Default)]
pub struct Waiting {
    len: usize,
    pairs: [QueuedMerge; LANES],
    /// Bit mask of their pixels.
    pixels: [u64; 4],
    /// Number of their fragments that are not shaded.
    unshaded: usize,
}

/// One queued merge.
#[derive(Clone, Copy, Debug, Default)]
struct QueuedMerge {
    at: (u8, usize),
    /// Front and back.
    fragments: [Slot; 2],
}

/// Shades and merges the fragments of a tile.
pub struct Merges<'a, H> {
    pub host: H,
    pub shared: Shared<'a>,
    pub part: TileEntries<'a>,
    pub waiting: &'a mut Waiting,
}

impl<H: Host> Merges<'_, H> {
    /// Whether merges may be queued: not where a probe observes the order of shading.
    fn may_wait<P: Probe>(&self) -> bool {
        !P::WORDS && !P::DECISIONS && !P::WORK && !P::TRANSFERS && self.shared.is_lit_by_eight
    }

    /// Shades and merges all queued pairs.
    pub fn end<A: Accumulator, P: Probe>(&mut self, tile: &mut PackedTile<A>, probe: &mut P) {
        if self.waiting.len > 0 {
            self.shade(&self.shared.machine.fragment, tile, probe);
        }
    }

    #[inline(never)]
    fn shade<A: Accumulator, P: Probe>(
        &mut self,
        unit: &Fragment,
        tile: &mut PackedTile<A>,
        probe: &mut P,
    ) {
        let Waiting {
            len,
            pairs,
            unshaded: count,
            ..
        } = std::mem::take(self.waiting);
        let pairs = &pairs[..len];
        let mut inputs = [input_of(&Slot::default(), [0; 2]); LANES];
        let unshaded = pairs
            .iter()
            .flat_map(|pair| &pair.fragments)
            .filter(|fragment| !fragment.shaded);
        inputs
            .iter_mut()
            .zip(unshaded)
            .for_each(|(input, fragment)| *input = input_of(fragment, [0; 2]));
        let mut outputs = [shade::Output::default(); LANES];
        if count > 0 {
            let Shared {
                machine, lights, ..
            } = self.shared;
            outputs = self.host.run(ShadeEight {
                shade: &machine.shade,
                lights,
                inputs: &inputs[..count],
                probe: &mut *probe,
            });
        }
        // Results are read in the order in which the fragments were queued.
        let next = Cell::new(0);
        let light = |_: &Slot, _: &mut Tap<P>| {
            let shade::Output { colour, opacity } = outputs[next.replace(next.get() + 1) % LANES];
            Premultiplied { colour, opacity }
        };
        for QueuedMerge {
            at: (pixel, slot),
            fragments: [front, back],
        } in pairs
        {
            tile.write(
                *pixel,
                *slot,
                PackedSlot::put(&unit.merged(front, back, light, &mut Tap::new(probe))),
            );
        }
    }
}

impl<A: Accumulator, H: Host, P: Probe> Merging<A, P> for Merges<'_, H> {
    fn settle(&mut self, unit: &Fragment, tile: &mut PackedTile<A>, pixel: u8, probe: &mut P) {
        if self.waiting.pixels[usize::from(pixel) / 64] & 1 << (pixel % 64) != 0 {
            self.shade(unit, tile, probe);
        }
    }

    fn merge(
        &mut self,
        unit: &Fragment,
        tile: &mut PackedTile<A>,
        at: (u8, usize),
        pair: &[Slot; 2],
        probe: &mut P,
    ) {
        let (pixel, slot) = at;
        if !self.may_wait::<P>() {
            let Shared {
                machine, lights, ..
            } = self.shared;
            let place = self.part.pixel(pixel);
            let mut shade =
                |slot: &Slot, tap: &mut Tap<P>| shade_for_merge(machine, lights, slot, place, tap);
            return shade.merge(unit, tile, at, pair, probe);
        }
        let [front, _] = pair;
        tile.write(
            pixel,
            slot,
            PackedSlot {
                key: front.depth as i32 | NO_MATCH,
                material: front.material,
                ..PackedSlot::default()
            },
        );
        let waiting = &mut *self.waiting;
        waiting.pairs[waiting.len % LANES] = QueuedMerge {
            at,
            fragments: *pair,
        };
        waiting.len += 1;
        waiting.pixels[usize::from(pixel) / 64] |= 1 << (pixel % 64);
        waiting.unshaded += pair.iter().filter(|fragment| !fragment.shaded).count();
        // The queue keeps room for one more pair.
        if waiting.len == LANES || waiting.unshaded > LANES - 2 {
            self.shade(unit, tile, probe);
        }
    }
}

//! Tile: the fragments of 16 × 16 pixels, packed so that a contribution finds its fragment with one
//! vector instruction.

use super::packed::{Accumulator, PackedSlot, PackedSums};
use crate::num::Lanes;
use crate::records::{MAX_LAYERS, Slot, TILE_AREA};

/// Set in the key of a slot that is shaded or empty: its distance from any depth word is then
/// greater than any ε.
pub const NO_MATCH: i32 = i32::MIN;
/// Greatest width of a depth in the comparators, bits.
pub const MAX_DEPTH_BITS: i32 = 30;

/// The fragments of a tile's pixels.
#[derive(Clone, Debug)]
pub struct PackedTile<A> {
    /// Depth of each slot of each pixel, with [`NO_MATCH`] if no contribution may match it.
    keys: [[i32; MAX_LAYERS]; TILE_AREA],
    /// Slot by slot, so that slots in use are adjacent in the cache.
    sums: [[PackedSums<A>; TILE_AREA]; MAX_LAYERS],
    material: [[u32; TILE_AREA]; MAX_LAYERS],
    live: [u8; TILE_AREA],
    contributions: [u32; TILE_AREA],
}

impl<A: Accumulator> Default for PackedTile<A> {
    fn default() -> Self {
        PackedTile {
            keys: [[NO_MATCH; MAX_LAYERS]; TILE_AREA],
            sums: [[PackedSums::default(); TILE_AREA]; MAX_LAYERS],
            material: [[0; TILE_AREA]; MAX_LAYERS],
            live: [0; TILE_AREA],
            contributions: [0; TILE_AREA],
        }
    }
}

/// A slot's index modulo `MAX_LAYERS`, so that no bounds check is compiled.
#[inline(always)]
fn within(slot: usize) -> usize {
    slot % MAX_LAYERS
}

impl<A: Accumulator> PackedTile<A> {
    /// Empties the tile.
    pub fn clear(&mut self) {
        self.live.fill(0);
        self.contributions.fill(0);
        self.keys.fill([NO_MATCH; MAX_LAYERS]);
    }

    /// Counts a further contribution to a pixel.
    #[inline(always)]
    pub fn count(&mut self, pixel: u8) {
        self.contributions[usize::from(pixel)] += 1;
    }

    /// Contributions to a pixel so far.
    pub fn contributions(&self, pixel: u8) -> u32 {
        self.contributions[usize::from(pixel)]
    }

    /// Fragments of a pixel.
    #[inline(always)]
    pub fn live(&self, pixel: u8) -> usize {
        usize::from(self.live[usize::from(pixel)])
    }

    /// Sets the number of fragments of a pixel.
    #[inline(always)]
    pub fn set_live(&mut self, pixel: u8, live: u8) {
        self.live[usize::from(pixel)] = live;
    }

    /// Puts a fragment into the next free slot; returns its index.
    #[inline(always)]
    pub fn open(&mut self, pixel: u8, fragment: PackedSlot<A>) -> u8 {
        let live = self.live[usize::from(pixel)];
        self.write(pixel, usize::from(live), fragment);
        self.live[usize::from(pixel)] += 1;
        live
    }

    /// The fragment in a slot.
    pub fn slot(&self, pixel: u8, slot: usize) -> Slot {
        self.read(pixel, slot).get()
    }

    /// The slot of the fragment that is nearest to a depth, if it is nearer than a limit; the first
    /// of several at the same distance.
    #[inline(always)]
    pub fn nearest<V: Lanes>(&self, pixel: u8, depth: i32, limit: u32) -> Option<usize> {
        let keys = &self.keys[usize::from(pixel)];
        let near = V::near(keys, depth, limit);
        if near == 0 {
            return None;
        }
        // Rarely more than one.
        let several = near & (near - 1) != 0;
        Some(if several {
            V::nearest(keys, depth)
        } else {
            near.trailing_zeros() as usize
        })
    }

    /// The sums in a slot.
    #[inline(always)]
    pub fn sums(&self, pixel: u8, slot: usize) -> &PackedSums<A> {
        &self.sums[within(slot)][usize::from(pixel)]
    }

    /// The sums in a slot, mutable.
    #[inline(always)]
    pub fn sums_mut(&mut self, pixel: u8, slot: usize) -> &mut PackedSums<A> {
        &mut self.sums[within(slot)][usize::from(pixel)]
    }

    /// Depth of a slot, with [`NO_MATCH`] if no contribution may match it.
    #[inline(always)]
    pub fn key(&self, pixel: u8, slot: usize) -> i32 {
        self.keys[usize::from(pixel)][within(slot)]
    }

    /// Moves a slot nearer if this depth is nearer.
    #[inline(always)]
    pub fn bring_nearer(&mut self, pixel: u8, slot: usize, depth: i32) {
        let key = &mut self.keys[usize::from(pixel)][within(slot)];
        *key = (*key).min(depth);
    }

    /// Depth of a slot.
    #[inline(always)]
    pub fn depth(&self, pixel: u8, slot: usize) -> i32 {
        self.key(pixel, slot) & !NO_MATCH
    }

    /// The packed fragment in a slot.
    #[inline(always)]
    pub fn read(&self, pixel: u8, slot: usize) -> PackedSlot<A> {
        let material = self.material[within(slot)][usize::from(pixel)];
        PackedSlot {
            sums: *self.sums(pixel, slot),
            key: self.key(pixel, slot),
            material,
        }
    }

    /// Puts a fragment into a slot.
    #[inline(always)]
    pub fn write(&mut self, pixel: u8, slot: usize, fragment: PackedSlot<A>) {
        let (slot, pixel) = (within(slot), usize::from(pixel));
        self.sums[slot][pixel] = fragment.sums;
        self.keys[pixel][slot] = fragment.key;
        self.material[slot][pixel] = fragment.material;
    }

    /// Copies a fragment from one slot to another.
    #[inline(always)]
    pub fn copy(&mut self, pixel: u8, from: usize, to: usize) {
        self.write(pixel, to, self.read(pixel, from));
    }

    /// Sorts the first `slots` slots of a pixel by depth.
    #[inline(always)]
    pub fn sort(&mut self, pixel: u8, slots: usize) {
        if !self.keys[usize::from(pixel)][..slots].is_sorted_by_key(|key| key & !NO_MATCH) {
            let mut stack = [PackedSlot::default(); MAX_LAYERS];
            let stack = &mut stack[..slots];
            stack
                .iter_mut()
                .enumerate()
                .for_each(|(slot, fragment)| *fragment = self.read(pixel, slot));
            stack.sort_by_key(PackedSlot::depth);
            stack
                .iter()
                .enumerate()
                .for_each(|(slot, fragment)| self.write(pixel, slot, *fragment));
        }
    }

    /// Index of the first of `slots` slots, in depth order, that is behind a depth; `slots` if
    /// there is none.
    #[inline(always)]
    pub fn place(&self, pixel: u8, slots: usize, depth: i32) -> usize {
        self.keys[usize::from(pixel)][..slots]
            .iter()
            .position(|key| key & !NO_MATCH > depth)
            .unwrap_or(slots)
    }
}

//! Tile: the fragments of 16 × 16 pixels, packed so that a contribution finds its own with one
//! vector instruction.

use super::packed::{Accumulator, PackedSlot, PackedSums};
use crate::num::Lanes;
use crate::records::{MAX_LAYERS, Slot, TILE_AREA};

/// Set in the key of a slot that is shaded or empty: its depth is then farther than any ε from any
/// depth word.
pub const NO_MATCH: i32 = i32::MIN;
/// Widest depth that the comparators take, bits.
pub const MAX_DEPTH_BITS: i32 = 30;

/// The fragments of a tile's pixels.
#[derive(Clone, Debug)]
pub struct Tile<A> {
    /// Depth of each slot of each pixel, with [`NO_MATCH`] where it is not to be matched.
    keys: [[i32; MAX_LAYERS]; TILE_AREA],
    /// Slot by slot: those in use lie side by side in the cache.
    sums: [[PackedSums<A>; TILE_AREA]; MAX_LAYERS],
    material: [[u32; TILE_AREA]; MAX_LAYERS],
    live: [u8; TILE_AREA],
    contributions: [u32; TILE_AREA],
}

impl<A: Accumulator> Default for Tile<A> {
    fn default() -> Self {
        Tile {
            keys: [[NO_MATCH; MAX_LAYERS]; TILE_AREA],
            sums: [[PackedSums::default(); TILE_AREA]; MAX_LAYERS],
            material: [[0; TILE_AREA]; MAX_LAYERS],
            live: [0; TILE_AREA],
            contributions: [0; TILE_AREA],
        }
    }
}

/// A slot's number, as the host is to see it: never beyond the last.
#[inline(always)]
fn within(slot: usize) -> usize {
    slot % MAX_LAYERS
}

impl<A: Accumulator> Tile<A> {
    /// Empties the tile.
    pub fn clear(&mut self) {
        self.live.fill(0);
        self.contributions.fill(0);
        self.keys.fill([NO_MATCH; MAX_LAYERS]);
    }

    /// Counts one contribution more to a pixel.
    #[inline(always)]
    pub fn count(&mut self, pixel: u8) {
        self.contributions[usize::from(pixel)] += 1;
    }

    /// Contributions that a pixel has had.
    pub fn contributions(&self, pixel: u8) -> u32 {
        self.contributions[usize::from(pixel)]
    }

    /// Fragments of a pixel.
    #[inline(always)]
    pub fn live(&self, pixel: u8) -> usize {
        usize::from(self.live[usize::from(pixel)])
    }

    /// Sets how many fragments a pixel has.
    #[inline(always)]
    pub fn set_live(&mut self, pixel: u8, live: u8) {
        self.live[usize::from(pixel)] = live;
    }

    /// Puts a fragment into the next slot, which is free; says which.
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

    /// The slot of the fragment that is nearest to a depth, the first of equals, if it is nearer
    /// than a limit.
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

    /// The sums in a slot, to be added to.
    #[inline(always)]
    pub fn sums_mut(&mut self, pixel: u8, slot: usize) -> &mut PackedSums<A> {
        &mut self.sums[within(slot)][usize::from(pixel)]
    }

    /// Depth of a slot, with [`NO_MATCH`] where it is not to be matched.
    #[inline(always)]
    pub fn key(&self, pixel: u8, slot: usize) -> i32 {
        self.keys[usize::from(pixel)][within(slot)]
    }

    /// Brings a slot nearer, if this depth is.
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

    /// The fragment in a slot, as it lies there.
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

    /// Puts the fragment of one slot into another, too.
    #[inline(always)]
    pub fn copy(&mut self, pixel: u8, from: usize, to: usize) {
        self.write(pixel, to, self.read(pixel, from));
    }

    /// Brings the first so many slots of a pixel into depth order.
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

    /// The first of so many slots, which are in depth order, that lies behind a depth; after the
    /// last where none does.
    #[inline(always)]
    pub fn place(&self, pixel: u8, slots: usize, depth: i32) -> usize {
        self.keys[usize::from(pixel)][..slots]
            .iter()
            .position(|key| key & !NO_MATCH > depth)
            .unwrap_or(slots)
    }
}

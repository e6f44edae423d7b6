//! Slots: a footprint, cut into what the rasteriser's lanes test in a cycle.
//!
//! ```text
//!  box ┌──┬──┬──┐    lanes 4×1: three slots a row
//!      │··│##│#·│    a slot that keeps no pixel takes its cycle, and nothing comes of it
//!      └──┴──┴──┘
//! ```
//! Slots lie side by side from the first pixel of the box, or of its part in a tile, row by row.
//!
//! Laws: `tiles_of_any_size_do_the_same_work`, `a_drawn_frame_ticks_as_it_is_replayed`.

use crate::work::{Event, Footprint, Reader, TILE_PX, Work};
use std::ops::Range;

/// What happens in a slot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Slot {
    /// Pixels kept by the rasteriser.
    pub kept: u32,
    /// Those whose weight is 0.
    pub faint: u32,
    /// Contributions that make two fragments merge.
    pub merges: u32,
    /// Fragments shaded for that.
    pub shades: u32,
    /// Where its pixels that have a weight end in the list of all.
    pub end: u32,
}

/// The slots of one footprint.
#[derive(Clone, Debug, Default)]
pub struct Slots {
    /// Slot by slot.
    pub slots: Vec<Slot>,
    /// Pixels with a weight, slot by slot: column and row.
    pub pixels: Vec<[u16; 2]>,
    /// The slot of each.
    slot_of: Vec<u32>,
}

/// Readers of all recorded tiles, and where each tile's is.
pub struct Readers<'a> {
    work: &'a Work,
    columns: usize,
    /// By place in the picture: the recorded tile, if it has one.
    tiles: Vec<u32>,
    readers: Vec<Reader<'a>>,
}

impl<'a> Readers<'a> {
    pub fn new(work: &'a Work) -> Self {
        let [columns, rows] = [work.width, work.height].map(|size| (size as usize).div_ceil(TILE_PX));
        let mut tiles = vec![u32::MAX; columns * rows];
        for (index, tile) in work.tiles.iter().enumerate() {
            let [column, row] = tile.corner.map(|at| usize::from(at) / TILE_PX);
            tiles[row * columns + column] = index as u32;
        }
        Readers { work, columns, tiles, readers: work.tiles.iter().map(|tile| tile.reader()).collect() }
    }

    /// The next footprint of these pixels of the picture, which are whole recorded tiles, in slots of so many columns and rows.
    pub fn next(&mut self, footprint: &Footprint, corner: [u16; 2], side: u32, lanes: [u32; 2], slots: &mut Slots) {
        let within = |[first, last]: [u16; 2], corner: u16| {
            let end = u32::from(corner) + side - 1;
            [first.max(corner), u32::from(last).min(end) as u16]
        };
        let columns = within(footprint.columns, corner[0]);
        let rows = within(footprint.rows, corner[1]);
        let size = [columns, rows].map(|[first, last]| u32::from(last - first) + 1);
        let [across, down] = [size[0].div_ceil(lanes[0]), size[1].div_ceil(lanes[1])];
        slots.slots.clear();
        slots.slots.resize((across * down) as usize, Slot::default());
        slots.pixels.clear();
        slots.slot_of.clear();
        let tile = |at: u16| usize::from(at) / TILE_PX;
        for tile_row in tile(rows[0])..=tile(rows[1]) {
            for tile_column in tile(columns[0])..=tile(columns[1]) {
                let index = self.tiles[tile_row * self.columns + tile_column] as usize;
                self.part(index, columns, rows, across, lanes, slots);
            }
        }
        slots.settle();
    }

    /// The part in one recorded tile.
    #[inline(always)]
    fn part(&mut self, index: usize, columns: [u16; 2], rows: [u16; 2], across: u32, lanes: [u32; 2], slots: &mut Slots) {
        let [left, top] = self.work.tiles[index].corner;
        let reader = &mut self.readers[index];
        // The rows first, then what became of their pixels.
        let mut kept = [0u16; TILE_PX];
        let part = clip(rows, top);
        let mut all = 0;
        for row in part.clone() {
            kept[row] = reader.row();
            all += kept[row].count_ones();
        }
        let plain = reader.only_accumulates(all);
        for row in part {
            let y = top + row as u16;
            let slot_row = u32::from(y - rows[0]) / lanes[1] * across;
            let mut mask = kept[row];
            while mask != 0 {
                let column = mask.trailing_zeros() as u16;
                mask &= mask - 1;
                let x = left + column;
                let index = slot_row + u32::from(x - columns[0]) / lanes[0];
                let slot = &mut slots.slots[index as usize];
                slot.kept += 1;
                let event = if plain { Event::Accumulated } else { reader.event() };
                match event {
                    Event::Faint => {
                        slot.faint += 1;
                        continue;
                    }
                    Event::Merged(shades) => {
                        slot.merges += 1;
                        slot.shades += u32::from(shades);
                    }
                    _ => {}
                }
                slots.pixels.push([x, y]);
                slots.slot_of.push(index);
            }
        }
    }
}

impl Slots {
    /// Pixels by slots, in each row by row, wherever recorded tiles meet.
    fn settle(&mut self) {
        let place = |(slot, [x, y]): (u32, [u16; 2])| (slot, y, x);
        let all = || self.slot_of.iter().copied().zip(self.pixels.iter().copied());
        if !all().is_sorted_by_key(place) {
            let mut sorted: Vec<_> = all().collect();
            sorted.sort_unstable_by_key(|pixel| place(*pixel));
            self.pixels.clear();
            self.pixels.extend(sorted.into_iter().map(|(_, pixel)| pixel));
        }
        let mut end = 0;
        for slot in &mut self.slots {
            end += slot.kept - slot.faint;
            slot.end = end;
        }
    }
}

/// The part of an interval of pixels that lies in a recorded tile, counted from the tile's first.
#[inline(always)]
fn clip([first, last]: [u16; 2], corner: u16) -> Range<usize> {
    let [from, to] = [usize::from(first), usize::from(last) + 1].map(|pixel| pixel.saturating_sub(usize::from(corner)));
    from..to.min(TILE_PX)
}

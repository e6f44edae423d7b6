//! Slots: a footprint, cut into what the rasteriser's lanes test in a cycle.
//!
//! ```text
//!  box ┌──┬──┬──┐    lanes 4×1: three slots a row
//!      │··│##│#·│    a slot that keeps no pixel takes its cycle, and nothing comes of it
//!      └──┴──┴──┘
//! ```
//! Slots lie side by side from the first pixel of the box, or of its part in a tile, row by row. What a slot keeps lies in strips: 16
//! pixels of a row, as wide as a recorded tile.
//!
//! Laws: `tiles_of_any_size_do_the_same_work`, `a_drawn_frame_ticks_as_it_is_replayed`.

use crate::work::{Event, Footprint, Reader, TILE_PX, Work};
use std::ops::Range;

/// What a slot keeps in a strip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Piece {
    /// Which slot of the footprint.
    pub slot: u32,
    /// The strip's first pixel: column and row.
    pub corner: [u16; 2],
    /// Its pixels that have a weight, the first in the last place.
    pub pixels: u16,
    /// Contributions that make two fragments merge.
    pub merges: u8,
    /// Fragments shaded for that.
    pub shades: u8,
}

/// The slots of one footprint.
#[derive(Clone, Debug, Default)]
pub struct Slots {
    /// How many there are.
    pub count: u32,
    /// What they keep, slot by slot, in each row by row.
    pub pieces: Vec<Piece>,
    /// The recorded tiles side by side that the box lies in.
    parts: Vec<Part>,
}

/// What a splat did in a recorded tile: columns of each row, the first in the last place.
#[derive(Clone, Copy, Debug, Default)]
struct Part {
    kept: [u16; TILE_PX],
    /// Those whose weight is 0.
    faint: [u16; TILE_PX],
    merged: [u16; TILE_PX],
    /// Fragments shaded for the merges of a column: one if it is in the first, two if in the second.
    shaded: [[u16; TILE_PX]; 2],
}

/// Readers of all recorded tiles, and where each tile's is.
pub struct Readers<'a> {
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
        Readers { columns, tiles, readers: work.tiles.iter().map(|tile| tile.reader()).collect() }
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
        slots.count = across * down;
        slots.pieces.clear();
        let tile = |at: u16| usize::from(at) / TILE_PX;
        for tile_row in tile(rows[0])..=tile(rows[1]) {
            let top = (tile_row * TILE_PX) as u16;
            let part = clip(rows, top);
            slots.parts.clear();
            for tile_column in tile(columns[0])..=tile(columns[1]) {
                let index = self.tiles[tile_row * self.columns + tile_column] as usize;
                slots.parts.push(Part::read(&mut self.readers[index], part.clone()));
            }
            for row in part {
                let y = top + row as u16;
                let first_slot = u32::from(y - rows[0]) / lanes[1] * across;
                let mut left = columns[0] / TILE_PX as u16 * TILE_PX as u16;
                for part in &slots.parts {
                    part.cut(row, [left, y], columns[0], lanes[0], first_slot, &mut slots.pieces);
                    left += TILE_PX as u16;
                }
            }
        }
        if lanes[1] > 1 {
            slots.pieces.sort_by_key(|piece| piece.slot);
        }
    }
}

impl Part {
    #[inline(always)]
    fn read(reader: &mut Reader<'_>, rows: Range<usize>) -> Self {
        let mut part = Part::default();
        // The rows first, then what became of their pixels.
        let mut pixels = 0;
        for row in rows.clone() {
            part.kept[row] = reader.row();
            pixels += part.kept[row].count_ones();
        }
        if !reader.only_accumulates(pixels) {
            rows.for_each(|row| part.read_events(reader, row));
        }
        part
    }

    fn read_events(&mut self, reader: &mut Reader<'_>, row: usize) {
        let mut mask = self.kept[row];
        if reader.only_accumulates(mask.count_ones()) {
            return;
        }
        while mask != 0 {
            let pixel = mask & mask.wrapping_neg();
            mask -= pixel;
            match reader.event() {
                Event::Faint => self.faint[row] |= pixel,
                Event::Merged(shades) => {
                    self.merged[row] |= pixel;
                    if let Some(nth) = usize::from(shades).checked_sub(1) {
                        self.shaded[nth][row] |= pixel;
                    }
                }
                _ => {}
            }
        }
    }

    /// Cuts a row into slots of so many columns, the first of which begins in this one.
    #[inline(always)]
    fn cut(&self, row: usize, corner: [u16; 2], first: u16, lanes: u32, first_slot: u32, pieces: &mut Vec<Piece>) {
        let mut left = self.kept[row];
        while left != 0 {
            let column = u32::from(corner[0]) + left.trailing_zeros() - u32::from(first);
            let nth = column / lanes;
            let here = left & below(u32::from(first) + (nth + 1) * lanes - u32::from(corner[0]));
            left -= here;
            let merged = here & self.merged[row];
            let mut piece = Piece { slot: first_slot + nth, corner, pixels: here & !self.faint[row], merges: 0, shades: 0 };
            if merged != 0 {
                let [one, two] = self.shaded.map(|rows| (here & rows[row]).count_ones() as u8);
                (piece.merges, piece.shades) = (merged.count_ones() as u8, one + 2 * two);
            }
            pieces.push(piece);
        }
    }
}

/// The columns of a strip before this one.
#[inline(always)]
pub fn below(column: u32) -> u16 {
    if column < TILE_PX as u32 { (1 << column) - 1 } else { u16::MAX }
}

impl Slots {
    /// What each slot that keeps a pixel keeps.
    #[inline(always)]
    pub fn kept(&self) -> impl Iterator<Item = &[Piece]> {
        self.pieces.chunk_by(|one, next| one.slot == next.slot)
    }
}

/// The part of an interval of pixels that lies in a recorded tile, counted from the tile's first.
#[inline(always)]
fn clip([first, last]: [u16; 2], corner: u16) -> Range<usize> {
    let [from, to] = [usize::from(first), usize::from(last) + 1].map(|pixel| pixel.saturating_sub(usize::from(corner)));
    from..to.min(TILE_PX)
}

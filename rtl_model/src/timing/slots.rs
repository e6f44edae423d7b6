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
pub struct Slots<'a> {
    /// How many there are.
    pub count: u32,
    /// What they keep, slot by slot, in each row by row.
    pub pieces: Vec<Piece>,
    /// The recorded tiles side by side that the box lies in.
    parts: Vec<Part<'a>>,
    /// Of those in which more happened than that contributions were added, what else.
    told: Vec<Told>,
}

/// What a splat did in a recorded tile: columns of each row, the first in the last place.
#[derive(Clone, Copy, Debug)]
struct Part<'a> {
    kept: &'a [u16],
    /// Its place among what else is told.
    told: Option<u32>,
}

/// What became of columns that were kept.
#[derive(Clone, Debug, Default)]
struct Told {
    faint: [u16; TILE_PX],
    merged: [u16; TILE_PX],
    /// Merges for which one fragment was shaded, and those for which two were.
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
    pub fn next(&mut self, footprint: &Footprint, corner: [u16; 2], side: u32, lanes: [u32; 2], slots: &mut Slots<'a>) {
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
            let first_y = top + part.start as u16;
            slots.parts.clear();
            slots.told.clear();
            for tile_column in tile(columns[0])..=tile(columns[1]) {
                let index = self.tiles[tile_row * self.columns + tile_column] as usize;
                let (kept, events) = self.readers[index].splat(part.len());
                let told = (!events.is_empty()).then_some(slots.told.len() as u32);
                slots.parts.push(Part { kept, told });
                if told.is_some() {
                    slots.told.push(Told::of(events));
                }
            }
            for row in 0..part.len() {
                let y = first_y + row as u16;
                let first_slot = u32::from(y - rows[0]) / lanes[1] * across;
                let mut left = columns[0] / TILE_PX as u16 * TILE_PX as u16;
                for part in &slots.parts {
                    let told = part.told.map(|nth| &slots.told[nth as usize]);
                    for (nth, pixels) in cut(part.kept[row], left, columns[0], lanes[0]) {
                        let piece = Piece { slot: first_slot + nth, corner: [left, y], pixels, merges: 0, shades: 0 };
                        slots.pieces.push(told.map_or(piece, |told| told.of_piece(row, piece)));
                    }
                    left += TILE_PX as u16;
                }
            }
        }
        if lanes[1] > 1 {
            slots.pieces.sort_by_key(|piece| piece.slot);
        }
    }
}

/// Pixels of a strip, which begins in this column, cut into slots of so many, the first of which begins in that one.
#[inline(always)]
fn cut(mut pixels: u16, left: u16, first: u16, lanes: u32) -> impl Iterator<Item = (u32, u16)> {
    let [left, first] = [left, first].map(u32::from);
    std::iter::from_fn(move || {
        if pixels == 0 {
            return None;
        }
        let nth = (left + pixels.trailing_zeros() - first) / lanes;
        let here = pixels & below(first + (nth + 1) * lanes - left);
        pixels -= here;
        Some((nth, here))
    })
}

impl Told {
    fn of(events: &[(u8, Event)]) -> Self {
        let mut told = Told::default();
        for (place, event) in events {
            let (row, pixel) = (usize::from(*place) / TILE_PX, 1 << (usize::from(*place) % TILE_PX));
            match event {
                Event::Faint => told.faint[row] |= pixel,
                Event::Merged(shades) => {
                    told.merged[row] |= pixel;
                    if let Some(nth) = usize::from(*shades).checked_sub(1) {
                        told.shaded[nth][row] |= pixel;
                    }
                }
                _ => {}
            }
        }
        told
    }

    /// What else happened to a piece in this row.
    #[inline(always)]
    fn of_piece(&self, row: usize, piece: Piece) -> Piece {
        let pixels = piece.pixels & !self.faint[row];
        let merged = piece.pixels & self.merged[row];
        if merged == 0 {
            return Piece { pixels, ..piece };
        }
        let [one, two] = self.shaded.map(|rows| (merged & rows[row]).count_ones() as u8);
        Piece { pixels, merges: merged.count_ones() as u8, shades: one + 2 * two, ..piece }
    }
}

/// The columns of a strip before this one.
#[inline(always)]
pub fn below(column: u32) -> u16 {
    if column < TILE_PX as u32 { (1 << column) - 1 } else { u16::MAX }
}

impl Slots<'_> {
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

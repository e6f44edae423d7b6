//! Stamps: a footprint, cut into the pixels that the rasteriser's lanes test per cycle.
//!
//! ```text
//!  box ┌──┬──┬──┐    lanes 4×1: three stamps per row
//!      │··│##│#·│    a stamp without a kept pixel takes its cycle, and goes no further
//!      └──┴──┴──┘
//! ```
//! Stamps are adjacent, from the first pixel of the box, or of its part in a tile, row by row. The
//! kept pixels of a stamp are in strips: 16 pixels of a row, as wide as a recorded tile.
//!
//! A mask cuts the part of a box in a tile into *runs*, each with its own stamps ([`Run`]).
//!
//! Laws: `tiles_of_any_size_do_the_same_work`, `a_drawn_frame_ticks_as_it_is_replayed`,
//! `masks_tick_as_they_are_replayed`.

mod runs;

pub use runs::{are_whole, cuts};

use crate::work::{Event, Footprint, Reader, TILE_PX, Work};
use runs::Cut;
use std::ops::Range;

/// Kept pixels of a stamp in a strip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Piece {
    /// Index of the stamp in the footprint.
    pub stamp: u32,
    /// Index of the strip in the picture, row by row.
    pub strip: u32,
    /// Its first pixel: column and row.
    pub corner: [u16; 2],
    /// Its pixels with a weight, the first in the LSB.
    pub pixels: u16,
    /// Its kept pixels without a weight.
    pub faint: u16,
    /// Pixels in which two fragments merge.
    pub merged: u16,
    /// Those in which one of the fragments is shaded first, and those in which both are.
    pub shaded: [u16; 2],
    /// In a frame with reflections, the index of its first texel in [`Stamps::texels`].
    pub texels: u32,
}

impl Piece {
    /// Merges in these pixels, and fragments that are shaded for them.
    #[inline(always)]
    pub fn merges(&self, of: u16) -> [u64; 2] {
        if self.merged & of == 0 {
            return [0; 2];
        }
        let [one, two] = self
            .shaded
            .map(|pixels| u64::from((pixels & of).count_ones()));
        [(self.merged & of).count_ones().into(), one + 2 * two]
    }
}

/// A splat in a recorded tile: kept columns of each row, the first in the LSB; its rows are
/// followed by those of the next splats.
#[derive(Clone, Copy, Debug)]
struct TileSplat<'a> {
    kept: &'a [u16],
    /// Whether it has events.
    has_events: bool,
}

/// Decisions on kept columns.
#[derive(Clone, Debug, Default)]
struct TileEvents {
    faint: [u16; TILE_PX],
    merged: [u16; TILE_PX],
    /// Merges for which one fragment was shaded, and those for which two were.
    shaded: [[u16; TILE_PX]; 2],
    /// In a frame with reflections, for each merge with shaded fragments: the pixel and its texels.
    looked_up: Vec<(u8, [u16; 2])>,
}

/// Cuts footprints into stamps: all recorded tiles, and their positions.
pub struct Stamps<'a> {
    /// Columns and rows of a stamp.
    lanes: [u32; 2],
    width: Width,
    /// Recorded tiles per row of the picture.
    columns: usize,
    /// By position in the picture, the index of the recorded tile, if any.
    tiles: Vec<u32>,
    readers: Vec<Reader<'a>>,
    /// The adjacent recorded tiles that the box touches.
    parts: Vec<TileSplat<'a>>,
    /// Per recorded tile with events, these events.
    tile_events: Vec<TileEvents>,
    /// Pieces of the footprint, stamp by stamp, each row by row.
    pieces: Vec<Piece>,
    /// Whether each of its stamps has only one piece: it is in one recorded tile, and stamps end
    /// where strips do.
    is_single: bool,
    /// Texels of fragments that are shaded for its merges, piece by piece.
    texels: Vec<u16>,
    /// First and last column and row of the footprint's part.
    sides: [[u16; 2]; 2],
    /// For tiles that are no whole recorded tiles, or with masks.
    cut: Option<Box<Cut<'a>>>,
}

impl<'a> Stamps<'a> {
    pub fn new(work: &'a Work, lanes: [u32; 2]) -> Self {
        let [columns, rows] =
            [work.width, work.height].map(|size| (size as usize).div_ceil(TILE_PX));
        let mut tiles = vec![u32::MAX; columns * rows];
        for (index, tile) in work.tiles.iter().enumerate() {
            let [column, row] = tile.corner.map(|at| usize::from(at) / TILE_PX);
            tiles[row * columns + column] = index as u32;
        }
        Stamps {
            lanes,
            width: Width::new(lanes[0]),
            columns,
            tiles,
            readers: work.tiles.iter().map(|tile| tile.reader()).collect(),
            parts: Vec::new(),
            tile_events: Vec::new(),
            pieces: Vec::new(),
            is_single: false,
            texels: Vec::new(),
            sides: [[0; 2]; 2],
            cut: None,
        }
    }

    /// Cuts the part of the next footprint in these pixels of the picture, which are whole recorded
    /// tiles unless it finds splats. Returns the number of stamps.
    #[inline(always)]
    pub fn footprint(&mut self, footprint: &Footprint, corner: [u16; 2], side: u32) -> u32 {
        let within = |[first, last]: [u16; 2], corner: u16| {
            let end = u32::from(corner) + side - 1;
            [first.max(corner), u32::from(last).min(end) as u16]
        };
        let columns = within(footprint.columns, corner[0]);
        let rows = within(footprint.rows, corner[1]);
        self.sides = [columns, rows];
        let [first, last] = columns.map(u32::from);
        let across = self.width.divides(last - first + self.width.pixels);
        let down = u32::from(rows[1] - rows[0]) + 1;
        let tile = |at: u16| usize::from(at) / TILE_PX;
        let tile_columns = tile(columns[0])..tile(columns[1]) + 1;
        let left = columns[0] / TILE_PX as u16 * TILE_PX as u16;
        self.is_single =
            tile_columns.len() == 1 && self.lanes[1] == 1 && self.width.divides_strips();
        self.pieces.clear();
        self.texels.clear();
        if self.cut.is_some() {
            return self.cut_footprint(footprint, corner);
        }
        let mut first_stamp = 0;
        for tile_row in tile(rows[0])..=tile(rows[1]) {
            let top = (tile_row * TILE_PX) as u16;
            let part = clip(rows, top);
            let first_y = top + part.start as u16;
            self.read(tile_row * self.columns, tile_columns.clone(), part.len());
            if self.is_single {
                self.collect_from_tile(
                    part.len(),
                    [left, first_y],
                    columns[0] - left,
                    [first_stamp, across],
                );
                first_stamp += across * part.len() as u32;
            } else {
                self.collect(part.len(), [left, first_y], [columns[0], rows[0]], across);
            }
        }
        if self.lanes[1] > 1 {
            self.pieces.sort_by_key(|piece| piece.stamp);
        }
        across * down.div_ceil(self.lanes[1])
    }

    /// Skips the part of the next footprint in these pixels, which has no kept pixel.
    pub fn skip(&mut self, footprint: &Footprint, corner: [u16; 2], side: u32) {
        self.select(0, u64::MAX);
        // A damaged record may have a kept pixel there.
        self.footprint(footprint, corner, side);
    }

    /// Pieces of each stamp with a kept pixel.
    #[inline(always)]
    pub fn kept(&self) -> impl Iterator<Item = &[Piece]> {
        self.pieces.chunk_by(|one, next| one.stamp == next.stamp)
    }

    /// [`Self::kept`] if each stamp surely has one piece.
    #[inline(always)]
    pub fn single(&self) -> Option<&[Piece]> {
        self.is_single.then_some(&*self.pieces)
    }

    /// Texels of fragments that are shaded for its merges.
    pub fn texels(&self) -> &[u16] {
        &self.texels
    }

    /// Stamps of a row of the footprint, which is not cut by a mask.
    pub fn across(&self) -> u32 {
        u32::from(self.sides[0][1] - self.sides[0][0]) / self.lanes[0] + 1
    }

    /// Columns and rows of the row that begins with a stamp.
    pub fn row(&self, stamp: u32) -> [Range<usize>; 2] {
        let [first, last] = self.sides[0].map(usize::from);
        let [_, rows] = self.area(stamp);
        [first..last + 1, rows]
    }

    /// Columns and rows of one of its stamps.
    pub fn area(&self, stamp: u32) -> [Range<usize>; 2] {
        let (first_stamp, sides) = self.run_of(stamp);
        let across = u32::from(sides[0][1] - sides[0][0]) / self.lanes[0] + 1;
        let stamp = stamp - first_stamp;
        let at = [stamp % across, stamp / across];
        [0, 1].map(|axis| {
            let [first, last] = sides[axis].map(usize::from);
            let from = first + (at[axis] * self.lanes[axis]) as usize;
            from..(from + self.lanes[axis] as usize).min(last + 1)
        })
    }

    /// Collects the pieces of `rows` rows from this pixel on, for a footprint in one recorded tile
    /// whose stamps end where strips do: four rows at a time, and only stamps with a kept pixel.
    #[inline(always)]
    fn collect_from_tile(
        &mut self,
        rows: usize,
        [left, first_y]: [u16; 2],
        first: u16,
        [first_stamp, across]: [u32; 2],
    ) {
        let TileSplat {
            kept: mut all,
            has_events,
        } = self.parts[0];
        let first_strip = self.strip(left, first_y);
        let mut row = 0;
        while row < rows {
            let rows_here = u64::MAX / (1 << (64 - 16 * (rows - row).min(4)));
            let kept = (four(all) & rows_here) / (1 << first);
            let mut stamps = self.width.stamps(kept);
            while stamps != 0 {
                let at = stamps.trailing_zeros();
                stamps &= stamps - 1;
                let (row, column) = (row as u32 + at / 16, at % 16);
                let piece = Piece {
                    stamp: first_stamp + row * across + self.width.divides(column),
                    strip: first_strip + row * self.columns as u32,
                    corner: [left, first_y + row as u16],
                    pixels: ((kept / (1 << at)) as u16 & self.width.pixels_of_one)
                        << (column + u32::from(first)),
                    ..Piece::default()
                };
                self.pieces.push(if has_events {
                    self.tile_events[0].of_piece(row as usize, piece, &mut self.texels)
                } else {
                    piece
                });
            }
            all = all.get(4..).unwrap_or_default();
            row += 4;
        }
    }

    /// The strip of a pixel.
    #[inline(always)]
    fn strip(&self, x: u16, y: u16) -> u32 {
        u32::from(y) * self.columns as u32 + u32::from(x) / TILE_PX as u32
    }

    /// Reads the events of a splat in these recorded tiles, in `rows` rows.
    #[inline(always)]
    fn read(&mut self, first: usize, columns: Range<usize>, rows: usize) {
        self.parts.clear();
        for (nth, column) in columns.enumerate() {
            let index = self.tiles[first + column] as usize;
            let kept = self.readers[index].rows();
            let (_, events) = self.readers[index].splat(rows);
            self.parts.push(TileSplat {
                kept,
                has_events: !events.is_empty(),
            });
            if nth == self.tile_events.len() {
                self.tile_events.push(TileEvents::default());
            }
            if !events.is_empty() {
                self.tile_events[nth].read(events, rows, self.readers[index].texels(events));
            }
        }
    }

    /// Collects the pieces of `rows` rows from this pixel on, for a box that begins in column
    /// `left`.
    fn collect(&mut self, rows: usize, [left, first_y]: [u16; 2], first: [u16; 2], across: u32) {
        for row in 0..rows {
            let y = first_y + row as u16;
            let first_stamp = u32::from(y - first[1]) / self.lanes[1] * across;
            let mut left = left;
            for (part, tile_events) in self.parts.iter().zip(&self.tile_events) {
                for (nth, pixels) in cut(part.kept[row], left, first[0], self.width) {
                    let strip = self.strip(left, y);
                    let piece = Piece {
                        stamp: first_stamp + nth,
                        strip,
                        corner: [left, y],
                        pixels,
                        ..Piece::default()
                    };
                    self.pieces.push(if part.has_events {
                        tile_events.of_piece(row, piece, &mut self.texels)
                    } else {
                        piece
                    });
                }
                left += TILE_PX as u16;
            }
        }
    }
}

/// Pixels of a stamp's row, as a divisor.
#[derive(Clone, Copy, Debug)]
struct Width {
    pixels: u32,
    /// 2^32 divided by the pixels, rounded up: exact for numbers below 2^26, far more than there
    /// are columns, and up to 64 pixels.
    inverse: u64,
    /// Mask of as many pixels, the first of a strip.
    pixels_of_one: u16,
    /// Mask of the first pixel of each stamp in four strips, if stamps divide strips.
    first_of_each: u64,
}

impl Width {
    fn new(pixels: u32) -> Self {
        let firsts = (0..16)
            .step_by(pixels as usize)
            .map(|at| 0x0001_0001_0001_0001 << at);
        let first_of_each = firsts.fold(0, |all, first| all | first);
        Width {
            pixels,
            inverse: (1_u64 << 32).div_ceil(pixels.into()),
            pixels_of_one: below(pixels),
            first_of_each,
        }
    }

    #[inline(always)]
    fn divides(self, column: u32) -> u32 {
        (u64::from(column) * self.inverse / (1 << 32)) as u32
    }

    /// Whether stamps that begin with a strip also end with one.
    fn divides_strips(self) -> bool {
        (TILE_PX as u32).is_multiple_of(self.pixels)
    }

    /// For four strips, the first in the low bits: the first pixel of each stamp with a kept pixel.
    #[inline(always)]
    fn stamps(self, kept: u64) -> u64 {
        let (mut any, mut pixels) = (kept, 1);
        while pixels < self.pixels {
            any |= any / (1 << pixels);
            pixels *= 2;
        }
        any & self.first_of_each
    }
}

/// Pixels of a strip that begins in column `left`, cut into stamps, the first of which begins in
/// column `first`.
#[inline(always)]
fn cut(mut pixels: u16, left: u16, first: u16, width: Width) -> impl Iterator<Item = (u32, u16)> {
    let [left, first] = [left, first].map(u32::from);
    std::iter::from_fn(move || {
        if pixels == 0 {
            return None;
        }
        let nth = width.divides(left + pixels.trailing_zeros() - first);
        let here = pixels & below(first + (nth + 1) * width.pixels - left);
        pixels -= here;
        Some((nth, here))
    })
}

/// The first four of these rows, or fewer at the end, as one word, the first in the low bits.
#[inline(always)]
fn four(rows: &[u16]) -> u64 {
    if let [a, b, c, d, ..] = rows {
        return [*a, *b, *c, *d]
            .iter()
            .rev()
            .fold(0, |all, row| all * (1 << 16) + u64::from(*row));
    }
    rows.iter()
        .rev()
        .fold(0, |all, row| all * (1 << 16) + u64::from(*row))
}

impl TileEvents {
    /// Reads the decisions on a splat with `rows` rows.
    fn read(&mut self, events: &[(u8, Event)], rows: usize, mut texels: &[u16]) {
        self.looked_up.clear();
        let [one, two] = &mut self.shaded;
        [&mut self.faint, &mut self.merged, one, two]
            .into_iter()
            .for_each(|columns| columns[..rows].fill(0));
        for (place, event) in events {
            let (row, pixel) = (
                usize::from(*place) / TILE_PX,
                1 << (usize::from(*place) % TILE_PX),
            );
            match event {
                Event::Faint => self.faint[row] |= pixel,
                Event::Merged(shades) => {
                    self.merged[row] |= pixel;
                    if let Some(nth) = usize::from(*shades).checked_sub(1) {
                        self.shaded[nth][row] |= pixel;
                        if let Some((own, left)) = texels
                            .split_at_checked(nth + 1)
                            .filter(|_| !texels.is_empty())
                        {
                            self.looked_up.push((*place, [own[0], own[nth]]));
                            texels = left;
                        }
                    }
                }
                Event::MergedAndStopped => self.merged[row] |= pixel,
                Event::Accumulated
                | Event::Inserted
                | Event::Evicted
                | Event::Replaced
                | Event::Stopped => {}
            }
        }
    }

    /// Adds the events of a piece in this row.
    #[inline(always)]
    fn of_piece(&self, row: usize, piece: Piece, texels: &mut Vec<u16>) -> Piece {
        let faint = piece.pixels & self.faint[row];
        let pixels = piece.pixels & !faint;
        let merged = piece.pixels & self.merged[row];
        if merged == 0 {
            return Piece {
                pixels,
                faint,
                ..piece
            };
        }
        let first = texels.len() as u32;
        if !self.looked_up.is_empty() {
            self.look_up(row, merged, texels);
        }
        Piece {
            pixels,
            faint,
            merged,
            shaded: self.shaded.map(|rows| merged & rows[row]),
            texels: first,
            ..piece
        }
    }

    /// Appends the texels of these columns' merges in a row.
    fn look_up(&self, row: usize, mut merged: u16, texels: &mut Vec<u16>) {
        let [one, two] = self.shaded.map(|rows| rows[row]);
        merged &= one | two;
        while merged != 0 {
            let column = merged.trailing_zeros() as usize;
            let (pixel, at) = (merged & merged.wrapping_neg(), row * TILE_PX + column);
            merged -= pixel;
            if let Some((_, both)) = self
                .looked_up
                .iter()
                .find(|(place, _)| usize::from(*place) == at)
            {
                texels.extend(&both[..if two & pixel == 0 { 1 } else { 2 }]);
            }
        }
    }
}

/// Mask of the columns of a strip before this one.
#[inline(always)]
pub fn below(column: u32) -> u16 {
    !(u32::MAX << column.min(TILE_PX as u32)) as u16
}

/// The part of a range of pixels in a recorded tile, counted from the tile's first pixel.
#[inline(always)]
fn clip([first, last]: [u16; 2], corner: u16) -> Range<usize> {
    let [from, to] = [usize::from(first), usize::from(last) + 1]
        .map(|pixel| pixel.saturating_sub(usize::from(corner)));
    from..to.min(TILE_PX)
}

#[cfg(test)]
mod tests {
    use super::Width;

    #[test]
    fn widths_divide_all_columns() {
        for pixels in 1..=64 {
            let width = Width::new(pixels);
            assert!(
                (0..1 << 17).all(|column| width.divides(column) == column / pixels),
                "{pixels}"
            );
        }
    }

    #[test]
    fn stamps_of_four_strips_are_those_that_keep_a_pixel() {
        for width in [1, 2, 4, 8, 16].map(Width::new) {
            assert!(width.divides_strips());
            let stamp = |pixel: u32| pixel / width.pixels * width.pixels;
            for (one, other) in (0..64).flat_map(|one| (0..64).map(move |other| (one, other))) {
                let kept = 1_u64 << one | 1 << other;
                assert_eq!(
                    width.stamps(kept),
                    1 << stamp(one) | 1 << stamp(other),
                    "{} {kept:x}",
                    width.pixels
                );
            }
        }
        assert!(
            ![3, 5, 12, 32, 64]
                .map(Width::new)
                .into_iter()
                .any(Width::divides_strips)
        );
    }
}

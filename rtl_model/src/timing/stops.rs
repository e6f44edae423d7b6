//! Stops: the pixels of a tile that have stopped, and the cycles from which they have.
//!
//! ```text
//!            ┌── stop map: one bit per pixel of the tile ◄── transmittance below the limit ── fragment
//!            ▼
//! list ─► raster ─► gauss ─► fragment       every bit is set: list drops the rest of the tile, raster drops what it has received
//! ```
//! A bit is set when the contribution that stops its pixel is written. From that cycle on, raster
//! leaves the pixel out, and skips stamps with only set bits. Stamps in flight at that time
//! continue, and fragment drops them.
//!
//! The bits are part of the tile's buffer. An immediate machine has none: its fragments are in
//! memory, and contributions to a stopped pixel are looked up and dropped like any other.
//!
//! Laws: `a_binned_frame_ticks_as_it_is_replayed`, `a_stopped_pixel_takes_no_cycles`.

use super::stamps::Piece;
use crate::work::{Event, TILE_PX, Work};
use std::ops::Range;

/// Pixels, tile by tile.
#[derive(Clone, Debug)]
pub struct StopMap {
    /// Columns and rows of the picture.
    width: usize,
    height: usize,
    /// For each pixel, the splat with which it stops.
    by: Vec<u32>,
    /// For each pixel, the cycle from which it has stopped.
    from: Vec<u64>,
    /// The current tile.
    pub tile: TileStops,
    /// Savings of the frame so far.
    pub saved: EarlyTermination,
}

/// Work that a binned machine skips because pixels have stopped, and all work without the stop map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EarlyTermination {
    /// Entries of tiles' lists that are not read.
    pub entries_skipped: u64,
    /// Entries of all lists.
    pub entries: u64,
    /// Contributions that do not reach `gauss`.
    pub contributions_left_out: u64,
    /// Contributions of the frame.
    pub contributions: u64,
}

/// State of the pixels of a tile.
#[derive(Clone, Copy, Debug, Default)]
pub struct TileStops {
    /// Number of pixels, and of those that have not stopped; the cycle in which the others had.
    pixels: usize,
    left: usize,
    last: u64,
    /// The last cycle in which raster left a stamp out.
    left_out: u64,
}

impl TileStops {
    /// The cycle from which the whole tile has stopped, by the stamps taken so far.
    pub fn all(&self) -> u64 {
        if self.left == 0 { self.last } else { u64::MAX }
    }
}

impl StopMap {
    /// For a frame in which pixels stop.
    pub fn new(work: &Work) -> Option<Self> {
        if !work.stops() {
            return None;
        }
        let [width, height] = [work.width, work.height].map(|size| size as usize);
        let mut by = vec![u32::MAX; width * height];
        let lists = work.bins(TILE_PX);
        let mut contributions = 0;
        for tile in &work.tiles {
            let [left, top] = tile.corner.map(usize::from);
            let mut reader = tile.reader();
            for nth in lists.of(top / TILE_PX * lists.columns + left / TILE_PX) {
                let footprint = &work.footprints[*nth as usize];
                let first = usize::from(footprint.rows[0]).max(top);
                let end = (usize::from(footprint.rows[1]) + 1).min(top + TILE_PX);
                let (rows, events) = reader.splat(end - first);
                contributions += rows
                    .iter()
                    .map(|row| u64::from(row.count_ones()))
                    .sum::<u64>();
                contributions -= events
                    .iter()
                    .filter(|(_, event)| *event == Event::Faint)
                    .count() as u64;
                for (place, _) in events.iter().filter(|(_, event)| event.stops()) {
                    let [x, y] = [
                        left + usize::from(*place) % TILE_PX,
                        first + usize::from(*place) / TILE_PX,
                    ];
                    if x < width && y < height {
                        let at = &mut by[y * width + x];
                        *at = if *at == u32::MAX {
                            footprint.splat
                        } else {
                            *at
                        };
                    }
                }
            }
        }
        // All of them, until one reaches fragment.
        let saved = EarlyTermination {
            contributions_left_out: contributions,
            contributions,
            ..EarlyTermination::default()
        };
        Some(StopMap {
            width,
            height,
            from: vec![u64::MAX; by.len()],
            by,
            tile: TileStops::default(),
            saved,
        })
    }

    /// Begins the next tile, with this side.
    pub fn begin(&mut self, corner: [u32; 2], side_px: u32) {
        let [columns, rows] = [(corner[0], self.width), (corner[1], self.height)]
            .map(|(at, size)| (size - at as usize).min(side_px as usize));
        let pixels = columns * rows;
        self.tile = TileStops {
            pixels,
            left: pixels,
            ..TileStops::default()
        };
    }

    /// Whether a pixel of the tile has stopped, or will have, by the stamps taken so far.
    #[inline(always)]
    fn has_any(&self) -> bool {
        self.tile.left < self.tile.pixels
    }

    /// The cycle from which the whole tile has stopped, by the stamps taken so far.
    pub fn all(&self) -> u64 {
        self.tile.all()
    }

    /// Raster left out a stamp that fragment would have taken.
    pub fn leave_out(&mut self, now: u64) {
        self.tile.left_out = self.tile.left_out.max(now);
    }

    /// The cycle from which only stamps in flight can arrive. A tile that has stopped does not
    /// stall for skipped stamps.
    pub fn known(&self) -> u64 {
        self.tile.left_out.min(self.all())
    }

    /// Indices of a piece's pixels in the picture, with the bit of each.
    #[inline(always)]
    fn pixels(&self, piece: &Piece, mut bits: u16) -> impl Iterator<Item = (usize, u16)> + use<> {
        let first = usize::from(piece.corner[1]) * self.width + usize::from(piece.corner[0]);
        std::iter::from_fn(move || {
            let rest = bits & bits.checked_sub(1)?;
            let bit = bits - rest;
            bits = rest;
            Some((first + bit.trailing_zeros() as usize, bit))
        })
    }

    /// The cycle from which every kept pixel of a stamp has stopped: 0 if it has no kept pixel.
    pub fn whole(&self, stamp: &[Piece]) -> u64 {
        if !self.has_any() && !stamp.is_empty() {
            return u64::MAX;
        }
        let of = |piece: &Piece| {
            self.pixels(piece, piece.pixels | piece.faint)
                .map(|(at, _)| self.from[at])
                .max()
        };
        stamp.iter().filter_map(of).max().unwrap_or(0)
    }

    /// The cycle from which every pixel of these columns and rows has stopped; they are computed
    /// only if a pixel of the tile has.
    #[inline(always)]
    pub fn area(&self, sides: impl FnOnce() -> [Range<usize>; 2]) -> u64 {
        if !self.has_any() {
            return u64::MAX;
        }
        let [columns, rows] = sides();
        let row = |y: usize| &self.from[y * self.width..][columns.clone()];
        rows.flat_map(row).copied().max().unwrap_or(0)
    }

    /// The pixels of a stamp that raster keeps in this cycle.
    pub fn kept(&self, stamp: &[Piece], now: u64, kept: &mut Vec<Piece>) {
        kept.clear();
        if !self.has_any() {
            kept.extend_from_slice(stamp);
            return;
        }
        kept.extend(stamp.iter().map(|piece| {
            let stopped = self
                .pixels(piece, piece.pixels | piece.faint)
                .filter(|(at, _)| self.from[*at] <= now);
            let stopped = stopped.fold(0, |all, (_, bit)| all | bit);
            Piece {
                pixels: piece.pixels & !stopped,
                faint: piece.faint & !stopped,
                ..*piece
            }
        }));
    }

    /// Ends a tile with `entries` entries, of which `read` were read.
    pub fn end(&mut self, entries: usize, read: usize) {
        self.saved.entries += entries as u64;
        self.saved.entries_skipped += (entries - read) as u64;
    }

    /// A stamp of a splat is written in this cycle.
    pub fn written(&mut self, splat: u32, stamp: &[Piece], now: u64) {
        for piece in stamp {
            self.saved.contributions_left_out -= u64::from(piece.pixels.count_ones());
            for (at, _) in self.pixels(piece, piece.pixels) {
                if self.by[at] == splat && self.from[at] == u64::MAX {
                    self.from[at] = now;
                    self.tile.left -= 1;
                    self.tile.last = self.tile.last.max(now);
                }
            }
        }
    }
}

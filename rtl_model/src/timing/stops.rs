//! Stops: which pixels of a tile take nothing more, and from when on.
//!
//! ```text
//!            ┌── stop map: a bit a pixel of the tile ◄── a pixel lets too little through ── fragment
//!            ▼
//! list ─► raster ─► gauss ─► fragment       every bit is set: list drops the rest of the tile, raster what has come of it
//! ```
//! A bit is set when the contribution that makes its pixel stop is written; from that cycle on
//! raster leaves the pixel out, and passes over stamps in which all bits are set. What is under way
//! by then goes on, and fragment drops it in its turn.
//!
//! The bits lie beside the tile's buffer. An immediate machine has none: its fragments lie in
//! memory, and what comes to a pixel that has stopped is looked up, and dropped, like any other.
//!
//! Laws: `a_binned_frame_ticks_as_it_is_replayed`, `a_stopped_pixel_takes_no_cycles`.

use super::stamps::Piece;
use crate::work::{Event, TILE_PX, Work};
use std::ops::Range;

/// Pixels, tile by tile.
#[derive(Clone, Debug)]
pub struct Stops {
    /// Columns and rows of the picture.
    width: usize,
    height: usize,
    /// Of each pixel the splat with which it stops.
    by: Vec<u32>,
    /// From which cycle on it has stopped.
    from: Vec<u64>,
    /// The tile that is drawn.
    pub tile: Tile,
    /// What the frame saves so far.
    pub saved: EarlyTermination,
}

/// What a binned machine leaves out because pixels have stopped: of all that it would do without
/// the stop map.
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

/// What is known of a tile's pixels, all together.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tile {
    /// Those that have not stopped, and when the others had.
    left: usize,
    last: u64,
    /// When raster left a stamp out last.
    left_out: u64,
}

impl Stops {
    /// Of a frame in which pixels stop.
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
        // All of them, until one comes to fragment.
        let saved = EarlyTermination {
            contributions_left_out: contributions,
            contributions,
            ..EarlyTermination::default()
        };
        Some(Stops {
            width,
            height,
            from: vec![u64::MAX; by.len()],
            by,
            tile: Tile::default(),
            saved,
        })
    }

    /// The next tile begins, of so many pixels a side.
    pub fn begin(&mut self, corner: [u32; 2], side_px: u32) {
        let [columns, rows] = [(corner[0], self.width), (corner[1], self.height)]
            .map(|(at, size)| (size - at as usize).min(side_px as usize));
        self.tile = Tile {
            left: columns * rows,
            ..Tile::default()
        };
    }

    /// From which cycle on the whole tile has stopped, by what was taken so far.
    pub fn all(&self) -> u64 {
        if self.tile.left == 0 {
            self.tile.last
        } else {
            u64::MAX
        }
    }

    /// Raster left a stamp out, of which fragment would have had something.
    pub fn leave_out(&mut self, now: u64) {
        self.tile.left_out = self.tile.left_out.max(now);
    }

    /// From when on it is known that no stamp comes but those under way. A tile that has stopped
    /// waits for nothing that is left out.
    pub fn known(&self) -> u64 {
        self.tile.left_out.min(self.all())
    }

    /// Places of a piece's pixels in the picture, with the bit of each.
    fn pixels(&self, piece: &Piece, bits: u16) -> impl Iterator<Item = (usize, u16)> + use<> {
        let first = usize::from(piece.corner[1]) * self.width + usize::from(piece.corner[0]);
        (0..TILE_PX)
            .map(move |column| (first + column, 1 << column))
            .filter(move |(_, bit)| bits & bit != 0)
    }

    /// From which cycle on every pixel that a stamp keeps has stopped: from the first, if it keeps
    /// none.
    pub fn whole(&self, stamp: &[Piece]) -> u64 {
        let of = |piece: &Piece| {
            self.pixels(piece, piece.pixels | piece.faint)
                .map(|(at, _)| self.from[at])
                .max()
        };
        stamp.iter().filter_map(of).max().unwrap_or(0)
    }

    /// From which cycle on every pixel of these columns and rows has stopped.
    pub fn area(&self, [columns, rows]: [Range<usize>; 2]) -> u64 {
        let row = |y: usize| &self.from[y * self.width..][columns.clone()];
        rows.flat_map(row).copied().max().unwrap_or(0)
    }

    /// Pixels that raster leaves of a stamp in this cycle.
    pub fn kept(&self, stamp: &[Piece], now: u64, kept: &mut Vec<Piece>) {
        kept.clear();
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

    /// A tile with so many entries ends, of which so many were read.
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

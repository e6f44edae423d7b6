//! Runs: cuts the part of a box in a tile where the mask of its entry has bits that are not set.
//!
//! ```text
//! mask  1 1 0 0     runs  ┌───┐        a run: adjacent set bits of a row of subtiles
//!       1 1 0 1           │ 1 │ ┌─┐    the next run belongs to it, if it is directly below and as wide
//!       0 0 1 1           └───┘ │2│
//!       0 0 1 1             ┌───┴─┤    raster seeds each run of an entry but the first: one cycle
//!                           │  3  │
//!                           └─────┘
//! ```
//! Pixels of a run outside of the box are not walked. An entry without a set bit has no run.
//!
//! Tiles whose side is not a multiple of 16 have parts of recorded tiles. Their splats are found by
//! number: a recorded tile is read again for each tile that touches it.
//!
//! Laws: `masks_tick_as_they_are_replayed`, `tiles_of_any_size_do_the_same_work`.

use super::{Piece, Stamps, TileEvents, TileSplat, below, clip, cut};
use crate::elaboration::microarchitecture::Microarchitecture;
use crate::work::{Bins, Footprint, Reader, TILE_PX, Work};

/// A rectangle of a footprint that raster walks from one seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    /// Its first stamp in the footprint, and the first one behind it.
    pub stamps: [u32; 2],
    /// First and last column, first and last row.
    pub sides: [[u16; 2]; 2],
}

/// Cuts the footprints of a binned machine.
pub(super) struct Cut<'a> {
    work: &'a Work,
    /// Side of a tile, and of a subtile; without masks they are the same.
    side_px: u16,
    subtile_px: u16,
    /// The entry: the splat's place among the drawn ones, and its mask.
    entry: u32,
    mask: u64,
    /// Runs of the footprint, in the order in which they are walked.
    runs: Vec<Run>,
    recorded: Option<RecordedTiles>,
}

/// Splats of recorded tiles.
struct RecordedTiles {
    splats: Bins,
    /// By recorded tile, the number of splats that were read.
    read: Vec<usize>,
}

/// Whether a machine cuts footprints.
pub fn cuts(t: &Microarchitecture) -> bool {
    t.masks().is_some() || !are_whole(t)
}

/// Whether tiles consist of whole recorded tiles.
pub fn are_whole(t: &Microarchitecture) -> bool {
    (t.timing.tile.side_px as usize).is_multiple_of(TILE_PX)
}

impl<'a> Stamps<'a> {
    /// For the tiles of a binned machine.
    pub fn of_tiles(t: &Microarchitecture, work: &'a Work) -> Self {
        let side_px = t.timing.tile.side_px as u16;
        let subtile_px = t.masks().map_or(side_px, |masks| masks.subtile_px as u16);
        let recorded = || RecordedTiles {
            splats: work.bins(TILE_PX),
            read: vec![0; work.tiles.len()],
        };
        let cut = cuts(t).then(|| {
            Box::new(Cut {
                work,
                side_px,
                subtile_px,
                entry: 0,
                mask: u64::MAX,
                runs: Vec::new(),
                recorded: (!are_whole(t)).then(recorded),
            })
        });
        Stamps {
            cut,
            ..Stamps::new(work, t.timing.raster.lanes)
        }
    }

    /// Whether it finds the splat of an entry itself. Otherwise the boxes that touch a tile are to
    /// be given to it one after the other.
    #[inline(always)]
    pub fn finds_splats(&self) -> bool {
        self.cut.as_ref().is_some_and(|cut| cut.recorded.is_some())
    }

    /// Begins a tile.
    pub fn begin(&mut self, corner: [u16; 2]) {
        let Some(cut) = self.cut.as_deref_mut() else {
            return;
        };
        let Some(recorded) = &mut cut.recorded else {
            return;
        };
        let [columns, rows] = corner.map(|at| {
            let [at, side] = [at, cut.side_px].map(usize::from);
            at / TILE_PX..(at + side).div_ceil(TILE_PX)
        });
        for row in rows {
            for column in columns.start..columns.end.min(self.columns) {
                let index = self.tiles.get(row * self.columns + column);
                let tile = index.and_then(|index| cut.work.tiles.get(*index as usize));
                if let (Some(index), Some(tile)) = (index, tile) {
                    self.readers[*index as usize] = tile.reader();
                    recorded.read[*index as usize] = 0;
                }
            }
        }
    }

    /// The next footprint is that of this entry, with this mask.
    #[inline(always)]
    pub fn select(&mut self, entry: u32, mask: u64) {
        if let Some(cut) = &mut self.cut {
            (cut.entry, cut.mask) = (entry, mask);
        }
    }

    /// Runs of the footprint; none if footprints are not cut.
    #[inline(always)]
    pub fn runs(&self) -> Option<&[Run]> {
        self.cut.as_ref().map(|cut| &cut.runs[..])
    }

    /// The first stamp of the run of a stamp, and the run's columns and rows.
    pub(super) fn run_of(&self, stamp: u32) -> (u32, [[u16; 2]; 2]) {
        let run = self
            .runs()
            .and_then(|runs| runs.iter().find(|run| stamp < run.stamps[1]));
        run.map_or((0, self.sides), |run| (run.stamps[0], run.sides))
    }

    /// [`Stamps::footprint`] of an entry, run by run.
    #[inline(never)]
    pub(super) fn cut_footprint(&mut self, footprint: &Footprint, corner: [u16; 2]) -> u32 {
        let Some(mut cut) = self.cut.take() else {
            return 0;
        };
        self.is_single = false;
        let stamps = cut.find_runs(self.sides, corner, self.lanes);
        let tile = |at: u16| usize::from(at) / TILE_PX;
        let [columns, rows] = self.sides;
        for tile_row in tile(rows[0])..=tile(rows[1]) {
            let top = (tile_row * TILE_PX) as u16;
            let record = clip(footprint.rows, top);
            self.parts.clear();
            for (nth, column) in (tile(columns[0])..=tile(columns[1])).enumerate() {
                let number = tile_row * self.columns + column;
                let index = self.tiles[number] as usize;
                let reader = &mut self.readers[index];
                cut.skip_to_entry(number, index, reader, top);
                let (kept, events) = reader.splat(record.len());
                self.parts.push(TileSplat {
                    kept,
                    has_events: !events.is_empty(),
                });
                if nth == self.tile_events.len() {
                    self.tile_events.push(TileEvents::default());
                }
                if !events.is_empty() {
                    let texels = reader.texels(events);
                    self.tile_events[nth].read(events, record.len(), texels);
                }
            }
            for row in clip(rows, top) {
                let y = top + row as u16;
                for run in cut.runs.iter().filter(|run| run.has_row(y)) {
                    self.collect_from_run(run, row - record.start, [columns[0], y]);
                }
            }
        }
        if self.lanes[1] > 1 || cut.runs.len() > 1 {
            self.pieces.sort_by_key(|piece| piece.stamp);
        }
        self.cut = Some(cut);
        stamps
    }

    /// Collects the pieces of a run in this row of the picture, from the recorded tile of column `x`
    /// on; `row` is the row in the record.
    fn collect_from_run(&mut self, run: &Run, row: usize, [x, y]: [u16; 2]) {
        let [columns, rows] = run.sides;
        let across = self
            .width
            .divides(u32::from(columns[1] - columns[0]) + self.width.pixels);
        let first_stamp = run.stamps[0] + u32::from(y - rows[0]) / self.lanes[1] * across;
        let mut left = x / TILE_PX as u16 * TILE_PX as u16;
        for (part, tile_events) in self.parts.iter().zip(&self.tile_events) {
            let before = |column: u16| below(u32::from(column.saturating_sub(left)));
            let inside = before(columns[1] + 1) & !before(columns[0]);
            let kept = part.kept.get(row).map_or(0, |kept| kept & inside);
            for (nth, pixels) in cut(kept, left, columns[0], self.width) {
                let piece = Piece {
                    stamp: first_stamp + nth,
                    strip: self.strip(left, y),
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

impl Run {
    fn has_row(&self, row: u16) -> bool {
        (self.sides[1][0]..=self.sides[1][1]).contains(&row)
    }
}

impl Cut<'_> {
    /// Finds the runs of the mask in a part of a box, in a tile with this corner. Returns the number
    /// of their stamps.
    fn find_runs(
        &mut self,
        [columns, rows]: [[u16; 2]; 2],
        corner: [u16; 2],
        lanes: [u32; 2],
    ) -> u32 {
        let Cut {
            subtile_px,
            mask,
            ref mut runs,
            ..
        } = *self;
        let across = self.side_px / subtile_px;
        let inside = |[first, last]: [u16; 2], corner: u16, subtiles: [u16; 2]| {
            let from = corner + subtiles[0] * subtile_px;
            let to = corner + subtiles[1] * subtile_px + (subtile_px - 1);
            [first.max(from), last.min(to)]
        };
        runs.clear();
        let subtile = |pixel: u16, corner: u16| (pixel - corner) / subtile_px;
        let touched = columns.map(|column| subtile(column, corner[0]));
        for row in subtile(rows[0], corner[1])..=subtile(rows[1], corner[1]) {
            let rows = inside(rows, corner[1], [row; 2]);
            let is_set = |column: u16| mask & 1 << (row * across + column) != 0;
            let mut column = touched[0];
            while column <= touched[1] {
                let first = column;
                while column <= touched[1] && is_set(column) {
                    column += 1;
                }
                if column > first {
                    let columns = inside(columns, corner[0], [first, column - 1]);
                    match runs.last_mut().map(|run: &mut Run| &mut run.sides) {
                        Some([above, [_, last]]) if *above == columns && *last + 1 == rows[0] => {
                            *last = rows[1];
                        }
                        _ => runs.push(Run {
                            stamps: [0; 2],
                            sides: [columns, rows],
                        }),
                    }
                }
                column += 1;
            }
        }
        let mut stamps = 0;
        for run in runs {
            let first = stamps;
            let [across, down] = [0, 1].map(|axis| {
                let [first, last] = run.sides[axis].map(u32::from);
                (last - first + 1).div_ceil(lanes[axis])
            });
            stamps += across * down;
            run.stamps = [first, stamps];
        }
        stamps
    }

    /// Moves the reader of a recorded tile to the splat of the entry, if it is not there.
    fn skip_to_entry(&mut self, number: usize, index: usize, reader: &mut Reader, top: u16) {
        let Some(RecordedTiles { splats, read }) = &mut self.recorded else {
            return;
        };
        let read = &mut read[index];
        let left = &splats.of(number)[*read..];
        for nth in left.iter().take_while(|nth| **nth != self.entry) {
            let rows = clip(self.work.footprints[*nth as usize].rows, top).len();
            let (_, events) = reader.splat(rows);
            reader.texels(events);
            *read += 1;
        }
        *read += 1;
    }
}

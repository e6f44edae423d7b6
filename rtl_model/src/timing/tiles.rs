//! Tiles: the cycles of a binned machine's second pass, tile after tile.
//!
//! ```text
//!          sorted        tile 0 is done    tile 1     …        the last
//! frame      │── cycles of 0 ──│── of 1 ──│
//! raster     │ 0 ──────│ 1 ───────│ 2 …                  each unit has shares of its own: until it is free of a tile, it is the tile's
//! ```
//! Units work on several tiles at a time, so a tile has two measures: by how much it puts off the end of the frame, and what each unit did
//! for it. Both leave nothing out: shares of a unit lie end to end from the first cycle of the pass, and so do the tiles' own cycles, up to the last
//! word that is resolved; what memory still writes then is no tile's.
//!
//! Law: `a_binned_frame_ticks_as_it_is_replayed`.

use super::account::{Account, Unit};

/// Tiles of a frame, in the order in which they are drawn; those without an entry are not among them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tiles {
    /// Pixels of a side.
    pub side_px: u32,
    /// First cycle of the pass: lists are written and sorted.
    pub from: u64,
    /// Units of the pass, in the order of the diagram.
    pub units: Vec<&'static str>,
    /// Each tile.
    pub tiles: Vec<TileCycles>,
    /// What each unit did until the last of them: when it was free, and its cycles.
    before: Vec<(u64, Account)>,
    /// When all of them are done.
    end: u64,
}

/// A tile's cycles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TileCycles {
    /// Column and row among tiles.
    pub at: [u32; 2],
    /// Splats in its list.
    pub entries: u32,
    /// Cycle in which its last word is resolved.
    pub done: u64,
    /// Cycles from the end of all tiles before to its own; none where it is done before they are.
    pub cycles: u64,
    /// Share of each unit.
    pub shares: Vec<Share>,
}

/// Cycles of a unit that are a tile's: from the end of its share of the tile before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Share {
    /// Cycle in which the unit is free of the tile; that of the tile before, where it had nothing to do.
    pub until: u64,
    /// What it did until then.
    pub account: Account,
}

impl Tiles {
    /// Of a pass that begins in this cycle with these units, which did nothing yet.
    pub fn new(side_px: u32, from: u64, units: &[&Unit]) -> Self {
        let names = units.iter().map(|unit| unit.name()).collect();
        Tiles { side_px, from, units: names, tiles: Vec::new(), before: vec![(from, Account::default()); units.len()], end: from }
    }

    /// The next tile is through.
    pub fn push(&mut self, at: [u32; 2], entries: u32, done: u64, units: &[&Unit]) {
        let from = self.from;
        let share = |(before, unit): (&mut (u64, Account), &&Unit)| {
            let (free, all) = unit.so_far();
            let until = free.max(from);
            let (start, earlier) = std::mem::replace(before, (until, all));
            let [busy, blocked, memory] = [all.busy - earlier.busy, all.blocked - earlier.blocked, all.memory - earlier.memory];
            Share { until, account: Account { busy, starved: until - start - busy - blocked - memory, blocked, memory } }
        };
        let shares = self.before.iter_mut().zip(units).map(share).collect();
        // A tile with nothing to shade may overtake the one before.
        let cycles = done.saturating_sub(self.end);
        self.end = self.end.max(done);
        self.tiles.push(TileCycles { at, entries, done, cycles, shares });
    }
}

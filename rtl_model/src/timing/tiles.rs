//! Tiles: the cycles of a binned machine's second pass, tile by tile.
//!
//! ```text
//!          sorted        tile 0 is done    tile 1     …        the last
//! frame      │── cycles of 0 ──│── of 1 ──│
//! raster     │ 0 ──────│ 1 ───────│ 2 …                  each unit has its own shares: its cycles belong to a tile until it is free of that tile
//! ```
//! Units process several tiles at a time, so a tile has two measures: the cycles that it adds to
//! the frame, and the share of each unit. Both are complete: the shares of a unit follow each other
//! without gaps from the first cycle of the pass, and so do the tiles' own cycles, up to the last
//! resolved word. Later writes of memory belong to no tile. Each engine has its own units, and so
//! its own shares.
//!
//! Law: `a_binned_frame_ticks_as_it_is_replayed`.

use super::account::{Account, Unit};

/// Tiles of a frame, in the order in which engines take them, without those that have no entry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tiles {
    /// Side of a tile, pixels.
    pub side_px: u32,
    /// First cycle of the pass, after lists are written and sorted.
    pub from: u64,
    /// Units of an engine, in the order of the diagram; parallel ones have an index.
    pub units: Vec<String>,
    /// Each tile.
    pub tiles: Vec<TileCycles>,
}

/// A tile's cycles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TileCycles {
    /// Column and row among tiles.
    pub at: [u32; 2],
    /// The engine that draws it.
    pub engine: u32,
    /// Splats in its list.
    pub entries: u32,
    /// Cycle of its last resolved word.
    pub done: u64,
    /// Cycles from the end of all previous tiles to its own; 0 if it ends before them.
    pub cycles: u64,
    /// Share of each unit.
    pub shares: Vec<Share>,
}

/// Cycles of a unit for a tile: from the end of its share of the previous tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Share {
    /// Cycle in which the unit is free of the tile; that of the previous tile if it had nothing to
    /// do.
    pub until: u64,
    /// Its account until then.
    pub account: Account,
}

impl Tiles {
    /// For a pass that begins in this cycle, with all tiles and their positions in the queue.
    pub fn new(
        side_px: u32,
        from: u64,
        units: Vec<String>,
        mut turns: Vec<(usize, TileCycles)>,
    ) -> Self {
        turns.sort_unstable_by_key(|(turn, _)| *turn);
        let mut end = from;
        let mut in_turn = |(_, tile): (usize, TileCycles)| {
            // A tile without shading, or on another engine, can overtake the previous one.
            let cycles = tile.done.saturating_sub(end);
            end = end.max(tile.done);
            TileCycles { cycles, ..tile }
        };
        Tiles {
            side_px,
            from,
            units,
            tiles: turns.into_iter().map(&mut in_turn).collect(),
        }
    }
}

/// State of an engine's units at the end of its last tile: the cycles in which they were free, and
/// their accounts.
#[derive(Clone, Debug)]
pub struct Shares {
    from: u64,
    before: Vec<(u64, Account)>,
}

impl Shares {
    /// For a pass that begins in this cycle.
    pub fn new(from: u64) -> Self {
        Shares {
            from,
            before: Vec::new(),
        }
    }

    /// Shares of the next finished tile, from the state of each unit behind it.
    pub fn of(&mut self, units: impl Iterator<Item = (u64, Account)>) -> Vec<Share> {
        let from = self.from;
        let all: Vec<(u64, Account)> = units.collect();
        self.before.resize(all.len(), (from, Account::default()));
        let share = |(before, (free, all)): (&mut (u64, Account), (u64, Account))| {
            let until = free.max(from);
            let (start, earlier) = std::mem::replace(before, (until, all));
            let [busy, blocked, memory] = [
                all.busy - earlier.busy,
                all.blocked - earlier.blocked,
                all.memory - earlier.memory,
            ];
            Share {
                until,
                account: Account {
                    busy,
                    starved: until - start - busy - blocked - memory,
                    blocked,
                    memory,
                },
            }
        };
        self.before.iter_mut().zip(all).map(share).collect()
    }
}

/// Names of an engine's units, with an index if several have the same name.
pub fn names<'a>(units: impl Iterator<Item = &'a Unit>) -> Vec<String> {
    let names: Vec<&str> = units
        .flat_map(|unit| unit.so_far().map(|_| unit.name()))
        .collect();
    let count = |all: &[&str], name: &str| all.iter().filter(|other| **other == name).count();
    let name = |(at, name): (usize, &&str)| match count(&names, name) {
        1 => (*name).to_owned(),
        _ => format!("{name}.{}", count(&names[..at], name)),
    };
    names.iter().enumerate().map(name).collect()
}

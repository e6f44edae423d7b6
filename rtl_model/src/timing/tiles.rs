//! Tiles: the cycles of a binned machine's second pass, tile after tile.
//!
//! ```text
//!          sorted        tile 0 is done    tile 1     …        the last
//! frame      │── cycles of 0 ──│── of 1 ──│
//! raster     │ 0 ──────│ 1 ───────│ 2 …                  each unit has shares of its own: until it is free of a tile, it is the tile's
//! ```
//! Units work on several tiles at a time, so a tile has two measures: by how much it puts off the
//! end of the frame, and what each unit did for it. Both leave nothing out: shares of a unit lie
//! end to end from the first cycle of the pass, and so do the tiles' own cycles, up to the last
//! word that is resolved; what memory still writes then is no tile's. Each engine has units of its
//! own, and so shares that lie end to end.
//!
//! Law: `a_binned_frame_ticks_as_it_is_replayed`.

use super::account::{Account, Unit};

/// Tiles of a frame, in the order in which engines take them; those without an entry are not among
/// them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tiles {
    /// Pixels of a side.
    pub side_px: u32,
    /// First cycle of the pass: lists are written and sorted.
    pub from: u64,
    /// Units of an engine, in the order of the diagram; of several side by side, with a number.
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
    /// Cycle in which the unit is free of the tile; that of the tile before, where it had nothing
    /// to do.
    pub until: u64,
    /// What it did until then.
    pub account: Account,
}

impl Tiles {
    /// Of a pass that begins in this cycle; all of them, each with its turn.
    pub fn new(
        side_px: u32,
        from: u64,
        units: Vec<String>,
        mut turns: Vec<(usize, TileCycles)>,
    ) -> Self {
        turns.sort_unstable_by_key(|(turn, _)| *turn);
        let mut end = from;
        let mut in_turn = |(_, tile): (usize, TileCycles)| {
            // A tile with nothing to shade, or on another engine, may overtake the one before.
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

/// What an engine's units did until its last tile: when each was free, and its cycles.
#[derive(Clone, Debug)]
pub struct Shares {
    from: u64,
    before: Vec<(u64, Account)>,
}

impl Shares {
    /// Of a pass that begins in this cycle.
    pub fn new(from: u64) -> Self {
        Shares {
            from,
            before: Vec::new(),
        }
    }

    /// Those of the next tile, which is through.
    pub fn of<'a>(&mut self, units: impl Iterator<Item = &'a Unit>) -> Vec<Share> {
        let from = self.from;
        let all: Vec<(u64, Account)> = units.flat_map(Unit::so_far).collect();
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

/// Names of an engine's units, with a number where several have the same.
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

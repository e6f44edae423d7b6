//! Timing: recorded work → cycles. It never asks what a value is, and never decides what work there
//! is.
//!
//! ```text
//! Work ─►( stamps )─► immediate: fetch ─► project ─► ellipse [─► colour] ─► raster ─► gauss ─► cache ─► fragment ─► resolve
//!                └─► binned:    fetch ─► project ─► ellipse [─► colour] ─► lists ║ fetch ─► raster ─► gauss ─► fragment ─► resolve
//! ```
//! Units are in order. One takes an item at the latest of three moments: the item is here, the unit
//! is free, there is room behind it. The cycles that it waits have that moment's name. So nothing
//! ticks: a frame is gone through once, item by item, each through all units.
//!
//! - *Here*: `latency` cycles after the unit before took it.
//! - *Free*: `interval` cycles after the item before, or what that took.
//! - *Room*: behind a unit lie as many places as its FIFO has and as are under way in its pipeline.
//!   A place is taken when the unit takes an item that goes on, and given back when the next unit
//!   takes that; it can be taken again in the cycle after.
//!
//! Exact, cycle by cycle, is all of this but memory that is not ideal: its one channel serves
//! requests in the order in which items are gone through, not first come, first served
//! (`memory.rs`). A frame is off by at most 0.6 % on small versions of the built-in scenes, by 0.63
//! % on themselves. More channels, ranks, refresh, turnaround and limits of rows are in
//! `channels.rs`.
//!
//! Laws: `a_frame_ticks_as_it_is_replayed`, `a_binned_frame_ticks_as_it_is_replayed`,
//! `replayed_scenes_are_at_most_a_hundredth_off`.

mod account;
mod binned;
mod cache;
mod channels;
mod hazards;
mod immediate;
mod limit;
mod memory;
mod sorters;
mod stages;
mod stamps;
mod stops;
mod texels;
mod tiles;
mod walk;

pub use account::{Account, Detail, Timeline, UnitCycles, Wait};
pub use binned::abreast::replay_all;
pub use limit::{Limit, Limited, limit, limits, most_gained};
pub use memory::{CLIENTS, Client, Direction, MemoryCycles, Request, serve};
pub use stops::EarlyTermination;
pub use tiles::{Share, TileCycles, Tiles};

use crate::elaboration::microarchitecture::Microarchitecture;
use crate::elaboration::unit;
use crate::machine::timing::Organisation;
use crate::work::Work;
use account::Unit;
use memory::Memory;

/// Cycles of a frame, unit by unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cycles {
    /// From the first request to the last word written.
    pub total: u64,
    /// Every unit, in the order of the diagram; none of [`Detail::Total`].
    pub units: Vec<UnitCycles>,
    /// Memory, which lies outside of the chip.
    pub memory: MemoryCycles,
    /// Every request to memory, in the order in which items are gone through, if that was to be
    /// logged.
    pub requests: Vec<Request>,
    /// Lines looked up by the cache, and those among them that it had.
    pub lookups: [u64; 2],
    /// Lines of the map of surroundings looked up by its caches, and those among them that they
    /// had.
    pub texels: [u64; 2],
    /// Stamps of the rasteriser, and those among them that kept a pixel.
    pub stamps: [u64; 2],
    /// Cycles for which merges, and resolve, waited for light that does not mirror.
    pub light: u64,
    /// Degree of the harmonics that `colour` took.
    pub harmonics: u8,
    /// Tile after tile of a binned machine; of [`Detail::Histograms`] and above.
    pub tiles: Option<Tiles>,
    /// Of a binned machine on a frame in which pixels stop.
    pub early_termination: Option<EarlyTermination>,
}

impl Cycles {
    /// Of units and memory when all is through. Nothing looked up, no stamps.
    fn of(units: Vec<Unit>, memory: Memory, detail: Detail) -> Self {
        let (memory, requests, written) = memory.finish();
        let total = units.iter().map(Unit::done).max().unwrap_or(0).max(written);
        let told = if detail == Detail::Total {
            Vec::new()
        } else {
            units
        };
        let units: Vec<UnitCycles> = told
            .into_iter()
            .flat_map(|unit| unit.cycles(total))
            .collect();
        debug_assert!(
            units.iter().all(|unit| UNITS.contains(&unit.name)),
            "a unit is not listed"
        );
        Cycles {
            total,
            units,
            memory,
            requests,
            lookups: [0; 2],
            texels: [0; 2],
            stamps: [0; 2],
            light: 0,
            harmonics: 0,
            tiles: None,
            early_termination: None,
        }
    }
}

/// Every unit that has an account of its cycles in one organisation or another, in the order of the
/// diagrams.
pub const UNITS: [&str; 15] = [
    "fetch",
    unit::PROJECT,
    unit::ELLIPSE,
    unit::COLOUR,
    SETUP_SHADE,
    "bin",
    unit::SORT,
    "list",
    unit::RASTER,
    unit::GAUSS,
    "cache",
    unit::FRAGMENT,
    unit::SHADE,
    RESOLVE_SHADE,
    unit::RESOLVE,
];

/// The second shade unit of a machine of windows, which lights every splat in setup.
const SETUP_SHADE: &str = "setup-shade";
/// The second shade unit of a machine with two tile buffers, which lights what a tile holds in the
/// end.
const RESOLVE_SHADE: &str = "resolve-shade";

/// Replays a frame's work on a microarchitecture. What it takes is the same whatever is told of it.
pub fn replay(timing: &Microarchitecture, work: &Work, detail: Detail) -> Cycles {
    let cycles = match timing.timing.organisation {
        Organisation::Immediate => immediate::replay(timing, work, detail),
        Organisation::Binned => binned::replay(timing, work, detail),
    };
    Cycles {
        harmonics: work.harmonics,
        ..cycles
    }
}

//! Timing: recorded work → cycles. It does not depend on values, and never decides what work there
//! is.
//!
//! ```text
//! Work ─►( stamps )─► immediate: fetch ─► project ─► ellipse [─► colour] ─► raster ─► gauss ─► cache ─► fragment ─► resolve
//!                └─► binned:    fetch ─► project ─► ellipse [─► colour] ─► lists ║ fetch ─► raster ─► gauss ─► fragment ─► resolve
//! ```
//! Units are in order. A unit takes an item at the latest of three moments: the item has arrived,
//! the unit is free, there is room behind it. The cycles of a stall are named after that moment. So
//! there is no clock loop: a frame is replayed item by item, each through all units.
//!
//! - *Arrived*: `latency` cycles after the previous unit took it.
//! - *Free*: `interval` cycles after the previous item, or the cycles of that item.
//! - *Room*: a unit has as many places behind it as its FIFO has and as are in flight in its
//!   pipeline. A place is taken when the unit takes an item that continues, and given back when the
//!   next unit takes this item. It can be taken again in the following cycle.
//!
//! All of this is exact to the cycle, except memory that is not ideal: its one channel serves
//! requests in the order of the replay, not of their arrival (`memory.rs`). The error of a frame is
//! at most 0.6 % on small versions of the built-in scenes, and 0.63 % on the full ones. More
//! channels, ranks, refresh, turnaround and limits of rows are in `channels.rs`.
//!
//! Laws: `a_frame_ticks_as_it_is_replayed`, `a_binned_frame_ticks_as_it_is_replayed`,
//! `replayed_scenes_are_at_most_a_hundredth_off`.

mod account;
mod binned;
mod cache;
mod channels;
mod frame;
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
pub use binned::batched::{MOST_OF_A_BATCH, replay_all, stamp_order};
pub use binned::{Lists, MaskCounts, TileTests};
pub use frame::RecordedFrame;
pub use limit::{Limit, Limited, limit, limits, most_gained};
pub use memory::{Direction, MemoryCycles, REQUESTERS, Request, Requester, serve};
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
    /// Every unit, in the order of the diagram; empty for [`Detail::Total`].
    pub units: Vec<UnitCycles>,
    /// Traffic of memory, which is outside of the chip.
    pub memory: MemoryCycles,
    /// Every request to memory, in the order of the replay, for [`Detail::Log`].
    pub requests: Vec<Request>,
    /// Lines looked up by the cache, and the hits among them.
    pub lookups: [u64; 2],
    /// Lines of the map of surroundings looked up by its caches, and the hits among them.
    pub texels: [u64; 2],
    /// Stamps of the rasteriser, and those with a kept pixel.
    pub stamps: [u64; 2],
    /// Cycles for which merges and resolve stalled for light without reflections.
    pub light: u64,
    /// Degree of the harmonics evaluated by `colour`.
    pub harmonics: u8,
    /// Tile by tile for a binned machine; for [`Detail::Histograms`] and above.
    pub tiles: Option<Tiles>,
    /// For a binned machine on a frame in which pixels stop.
    pub early_termination: Option<EarlyTermination>,
    /// For a machine that tests tiles.
    pub tile_tests: Option<TileTests>,
    /// For a binned machine: the cycle in which all lists are written, and the first cycle of the
    /// second pass, after the sort.
    pub passes: Option<[u64; 2]>,
}

impl Cycles {
    /// From units and memory after the replay, without look-ups and stamps.
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
            tile_tests: None,
            passes: None,
        }
    }
}

/// Every unit with an account of its cycles in some organisation, in the order of the diagrams.
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

/// The second shade unit of a machine with windows, which lights every splat in setup.
const SETUP_SHADE: &str = "setup-shade";
/// The second shade unit of a machine with two tile buffers, which lights fragments for resolve.
const RESOLVE_SHADE: &str = "resolve-shade";

/// Replays a frame's work on a microarchitecture. The cycles do not depend on `detail`.
pub fn replay(timing: &Microarchitecture, work: &Work, detail: Detail) -> Cycles {
    replay_on(timing, &RecordedFrame::new(work), detail)
}

/// [`replay`], with what the replays of a frame share.
fn replay_on(timing: &Microarchitecture, frame: &RecordedFrame, detail: Detail) -> Cycles {
    let cycles = match timing.timing.organisation {
        Organisation::Immediate => immediate::replay(timing, frame, detail),
        Organisation::Binned => binned::replay(timing, frame, detail),
    };
    Cycles {
        harmonics: frame.work.harmonics,
        ..cycles
    }
}

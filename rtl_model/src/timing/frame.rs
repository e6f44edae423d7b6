//! Frame: a recorded frame, and what its replays share.
//!
//! ```text
//! work ─► lists, one for each shape of tiles and tests ─┐
//!      ─► pixels that stop, final pixels ───────────────┴─► replay, replay, …
//! ```
//! Lists follow from the side of tiles and from the words of `bin`, and neither from latencies nor
//! from memory. Building them takes up to half of the instructions of a replay. Those of the last
//! [`SHAPES`] shapes are kept.

use super::binned::Lists;
use super::binned::batched::replay_frame;
use super::limit::{Limit, limit_on, limits_on};
use super::stages::FinalPixels;
use super::stops::StopMap;
use super::{Cycles, Detail, replay_on};
use crate::elaboration::masks::Masks;
use crate::elaboration::microarchitecture::{BinWords, Microarchitecture};
use crate::work::Work;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Shapes of which the lists are kept.
const SHAPES: usize = 2;

/// What the lists of a machine follow from.
type Shape = (u32, Option<BinWords>, Option<Masks>);

/// A recorded frame.
pub struct RecordedFrame<'w> {
    /// Its recorded work.
    pub work: &'w Work,
    lists: Mutex<Vec<(Shape, Arc<Lists>)>>,
    stops: OnceLock<Option<StopMap>>,
    held: OnceLock<Arc<FinalPixels>>,
}

impl<'w> RecordedFrame<'w> {
    /// A frame of which nothing is prepared yet.
    pub fn new(work: &'w Work) -> Self {
        RecordedFrame {
            work,
            lists: Mutex::default(),
            stops: OnceLock::new(),
            held: OnceLock::new(),
        }
    }

    /// [`replay`](super::replay) of this frame.
    pub fn replay(&self, timing: &Microarchitecture, detail: Detail) -> Cycles {
        replay_on(timing, self, detail)
    }

    /// [`replay_all`](super::replay_all) of this frame.
    pub fn replay_all(&self, timings: &[&Microarchitecture], detail: Detail) -> Vec<Cycles> {
        replay_frame(timings, self, detail)
    }

    /// [`limit`](super::limit()) of this frame.
    pub fn limit(&self, timing: &Microarchitecture, cycles: &Cycles) -> Limit {
        limit_on(timing, self, cycles)
    }

    /// [`limits`](super::limits) of this frame.
    pub fn limits(&self, frames: &[(&Microarchitecture, &Cycles)]) -> Vec<Limit> {
        limits_on(frames, self)
    }

    /// Lists of a machine.
    pub(super) fn lists(&self, t: &Microarchitecture) -> Arc<Lists> {
        let shape = (t.timing.tile.side_px, t.bin.map(|bin| bin.words), t.masks());
        // The lock is held while lists are built, so that two threads do not build the same ones.
        let mut kept = self.lists.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, lists)) = kept.iter().find(|(of, _)| *of == shape) {
            return Arc::clone(lists);
        }
        let lists = Arc::new(Lists::new(t, self.work));
        if kept.len() == SHAPES {
            kept.remove(0);
        }
        kept.push((shape, Arc::clone(&lists)));
        lists
    }

    /// The stop map before the first tile, if pixels stop.
    pub(super) fn stops(&self) -> Option<StopMap> {
        self.stops.get_or_init(|| StopMap::new(self.work)).clone()
    }

    /// Final contents of the pixels.
    pub(super) fn held(&self) -> Arc<FinalPixels> {
        Arc::clone(
            self.held
                .get_or_init(|| Arc::new(FinalPixels::new(self.work))),
        )
    }
}

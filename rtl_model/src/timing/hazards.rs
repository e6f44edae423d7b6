//! Hazards: pixels that were taken, and cannot be taken again yet.
//!
//! ```text
//! strip ─► its last piece ─► its piece before that ─► … as long as they are in flight
//! ```
//! Later pieces are in flight for longer, so the first piece found that shares a pixel determines
//! the stall. This does not hold for merges of units that take stamps during a merge; these merges
//! are few, and are compared one by one.
//!
//! Law: `a_drawn_frame_ticks_as_it_is_replayed`.

use super::stamps::Piece;
use crate::elaboration::microarchitecture::Microarchitecture;
use crate::elaboration::unit;
use crate::work::{TILE_PX, Work};

/// A piece in flight: the end of its flight, its pixels, and the index of the previous piece of its
/// strip.
#[derive(Clone, Copy, Debug, Default)]
struct PieceInFlight {
    until: u64,
    before: u32,
    pixels: u16,
}

/// Greatest number of pieces in flight.
pub fn most_under_way(timing: &Microarchitecture) -> usize {
    let [across, down] = timing.timing.raster.lanes.map(|lanes| lanes as usize);
    // An infinitely fast unit takes all buffered stamps at once.
    let waiting = if timing.lifted == Some(unit::FRAGMENT) {
        timing.gauss.room().max(timing.cache.room()) + 1
    } else {
        0
    };
    // At least one cycle per stamp, and a limited number of strips per stamp.
    (timing.hazard as usize + waiting) * ((across - 1).div_ceil(TILE_PX) + 1) * down
}

/// Pixels in flight.
#[derive(Clone, Debug)]
pub struct Hazards {
    /// The last piece of each strip.
    last: Vec<PieceInFlight>,
    /// The piece before each piece of its strip: a ring of as many pieces as can be in flight.
    before: Box<[PieceInFlight]>,
    turn: usize,
    /// Merges of units that take stamps during a merge: the end of the flight, the strip, the
    /// pixels.
    merges: Vec<(u64, u32, u16)>,
}

impl Hazards {
    pub fn new(timing: &Microarchitecture, work: &Work) -> Self {
        let columns = (work.width as usize).div_ceil(TILE_PX);
        let under_way = most_under_way(timing);
        let last = vec![PieceInFlight::default(); columns * work.height as usize];
        Hazards {
            last,
            before: vec![PieceInFlight::default(); under_way].into(),
            turn: 0,
            merges: Vec::new(),
        }
    }

    /// The end of the flight of the stamp's pixels, if it is after `now`, the first cycle in which
    /// a stamp can be taken.
    #[inline(always)]
    pub fn until(&mut self, stamp: &[Piece], now: u64) -> u64 {
        let mut until = if self.merges.is_empty() {
            now
        } else {
            self.until_merged(stamp, now)
        };
        for piece in stamp {
            let mut taken = self.last[piece.strip as usize];
            while taken.until > until {
                if taken.pixels & piece.pixels != 0 {
                    until = taken.until;
                }
                taken = self.before[taken.before as usize];
            }
        }
        until
    }

    #[inline(never)]
    fn until_merged(&mut self, stamp: &[Piece], now: u64) -> u64 {
        self.merges.retain(|(until, ..)| *until > now);
        let waits_for = |(_, strip, pixels): &&(u64, u32, u16)| {
            stamp
                .iter()
                .any(|piece| piece.strip == *strip && piece.pixels & pixels != 0)
        };
        self.merges
            .iter()
            .filter(waits_for)
            .map(|(until, ..)| *until)
            .max()
            .unwrap_or(now)
    }

    /// Marks the pixels of a stamp in which fragments merge as in flight until `until`.
    pub fn take_merges(&mut self, stamp: &[Piece], of: impl Fn(&Piece) -> u16, until: u64) {
        let of = |piece: &Piece| (until, piece.strip, piece.pixels & of(piece));
        self.merges
            .extend(stamp.iter().map(of).filter(|(.., pixels)| *pixels != 0));
    }

    /// Marks the pixels of a stamp as in flight until `until`.
    #[inline(always)]
    pub fn take(&mut self, stamp: &[Piece], until: u64) {
        for piece in stamp {
            let last = &mut self.last[piece.strip as usize];
            self.before[self.turn] = *last;
            *last = PieceInFlight {
                until,
                before: self.turn as u32,
                pixels: piece.pixels,
            };
            self.turn = if self.turn + 1 == self.before.len() {
                0
            } else {
                self.turn + 1
            };
        }
    }
}

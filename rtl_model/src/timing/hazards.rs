//! Hazards: pixels that were taken, and cannot be taken again yet.
//!
//! ```text
//! strip ─► what was taken of it last ─► what before that ─► … as far back as it is under way
//! ```
//! What is taken later is under way longer, so the first that shares a pixel is the one to wait for.
//!
//! Law: `a_drawn_frame_ticks_as_it_is_replayed`.

use super::stamps::Piece;
use crate::elaboration::microarchitecture::Microarchitecture;
use crate::elaboration::unit;
use crate::work::{TILE_PX, Work};

/// A piece that was taken: until when it is under way, and its place.
#[derive(Clone, Copy, Debug, Default)]
struct Taken {
    until: u64,
    place: u32,
}

/// Pixels under way.
#[derive(Clone, Debug)]
pub struct Hazards {
    /// Of each strip what was taken last.
    last: Vec<Taken>,
    /// Pixels of each piece, and what was taken of its strip before: as many pieces as can be under way, in turn.
    pieces: Box<[(u16, Taken)]>,
    turn: usize,
}

impl Hazards {
    pub fn new(timing: &Microarchitecture, work: &Work) -> Self {
        let columns = (work.width as usize).div_ceil(TILE_PX);
        let [across, down] = timing.timing.raster.lanes.map(|lanes| lanes as usize);
        // Infinitely fast, it takes what waited for it at once.
        let waiting = if timing.lifted == Some(unit::FRAGMENT) { timing.gauss.room().max(timing.cache.room()) + 1 } else { 0 };
        // A cycle at least for each stamp; its pixels lie in so many strips at most.
        let under_way = (timing.hazard as usize + waiting) * ((across - 1).div_ceil(TILE_PX) + 1) * down;
        let last = vec![Taken::default(); columns * work.height as usize];
        Hazards { last, pieces: vec![(0, Taken::default()); under_way].into(), turn: 0 }
    }

    /// Until when a pixel of a stamp is under way, if that is after this cycle, from which on a stamp can be taken.
    #[inline(always)]
    pub fn until(&self, stamp: &[Piece], now: u64) -> u64 {
        let mut until = now;
        for piece in stamp {
            let mut taken = self.last[piece.strip as usize];
            while taken.until > until {
                let (pixels, before) = self.pieces[taken.place as usize];
                if pixels & piece.pixels != 0 {
                    until = taken.until;
                }
                taken = before;
            }
        }
        until
    }

    /// A stamp is taken, and under way until then.
    #[inline(always)]
    pub fn take(&mut self, stamp: &[Piece], until: u64) {
        for piece in stamp {
            let strip = piece.strip as usize;
            self.pieces[self.turn] = (piece.pixels, self.last[strip]);
            self.last[strip] = Taken { until, place: self.turn as u32 };
            self.turn = if self.turn + 1 == self.pieces.len() { 0 } else { self.turn + 1 };
        }
    }
}

//! Hazards: pixels that were taken, and cannot be taken again yet.
//!
//! ```text
//! strip ─► what was taken of it last ─► what before that ─► … as far back as it is under way
//! ```
//! What is taken later is under way longer, so the first that shares a pixel is the one to wait
//! for. Merges are not so, where units go on beside them: those in flight are few, and looked at
//! one by one.
//!
//! Law: `a_drawn_frame_ticks_as_it_is_replayed`.

use super::stamps::Piece;
use crate::elaboration::microarchitecture::Microarchitecture;
use crate::elaboration::unit;
use crate::work::{TILE_PX, Work};

/// A piece that was taken: until when it is under way, its pixels, and where what was taken of its
/// strip before lies.
#[derive(Clone, Copy, Debug, Default)]
struct Taken {
    until: u64,
    before: u32,
    pixels: u16,
}

/// Most pieces that can be under way.
pub fn most_under_way(timing: &Microarchitecture) -> usize {
    let [across, down] = timing.timing.raster.lanes.map(|lanes| lanes as usize);
    // Infinitely fast, it takes what waited for it at once.
    let waiting = if timing.lifted == Some(unit::FRAGMENT) {
        timing.gauss.room().max(timing.cache.room()) + 1
    } else {
        0
    };
    // A cycle at least for each stamp; its pixels lie in so many strips at most.
    (timing.hazard as usize + waiting) * ((across - 1).div_ceil(TILE_PX) + 1) * down
}

/// Pixels under way.
#[derive(Clone, Debug)]
pub struct Hazards {
    /// Of each strip what was taken last.
    last: Vec<Taken>,
    /// What was taken before each piece, of its strip: of as many pieces as can be under way, in
    /// turn.
    before: Box<[Taken]>,
    turn: usize,
    /// Merges beside which units go on: until when each is under way, its strip and its pixels.
    merges: Vec<(u64, u32, u16)>,
}

impl Hazards {
    pub fn new(timing: &Microarchitecture, work: &Work) -> Self {
        let columns = (work.width as usize).div_ceil(TILE_PX);
        let under_way = most_under_way(timing);
        let last = vec![Taken::default(); columns * work.height as usize];
        Hazards {
            last,
            before: vec![Taken::default(); under_way].into(),
            turn: 0,
            merges: Vec::new(),
        }
    }

    /// Until when a pixel of a stamp is under way, if that is after this cycle, from which on a
    /// stamp can be taken.
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

    /// Those pixels of a stamp are taken in which fragments merge, and under way until then.
    pub fn take_merges(&mut self, stamp: &[Piece], of: impl Fn(&Piece) -> u16, until: u64) {
        let of = |piece: &Piece| (until, piece.strip, piece.pixels & of(piece));
        self.merges
            .extend(stamp.iter().map(of).filter(|(.., pixels)| *pixels != 0));
    }

    /// A stamp is taken, and under way until then.
    #[inline(always)]
    pub fn take(&mut self, stamp: &[Piece], until: u64) {
        for piece in stamp {
            let last = &mut self.last[piece.strip as usize];
            self.before[self.turn] = *last;
            *last = Taken {
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

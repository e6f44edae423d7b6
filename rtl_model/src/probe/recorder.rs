//! Recorder: a probe that records [work](crate::work).

use super::Probe;
use crate::records::Decision;
use crate::work::{CULLED, Event, MergedLists, Recorder, TestedWords};

impl Probe for Recorder {
    const WORDS: bool = false;
    const QUICK: bool = true;
    const DECISIONS: bool = false;
    const WORK: bool = true;

    fn fork(&self) -> Self {
        Recorder::fork(self)
    }

    fn absorb(&mut self, fork: Self) {
        Recorder::absorb(self, fork);
    }

    fn culled(&mut self, first: u32, lanes: [u8; CULLED.len()]) {
        Recorder::culled(self, first, lanes);
    }

    fn sorted(&mut self, order: Vec<u32>, keys: Vec<u32>) {
        Recorder::sorted(self, order, keys);
    }

    fn merged(&mut self, lists: MergedLists) {
        Recorder::merged(self, lists);
    }

    fn tested(&mut self, words: Vec<TestedWords>, cutoff: i64) {
        Recorder::tested(self, words, cutoff);
    }

    fn ellipsoids(&mut self, preshaded: bool, shared_axes: bool, harmonics: u8) {
        Recorder::ellipsoids(self, preshaded, shared_axes, harmonics);
    }

    #[inline(always)]
    fn drawn(&mut self, splat: u32, sides: [[u16; 2]; 2]) {
        Recorder::drawn(self, splat, sides);
    }

    #[inline(always)]
    fn span(&mut self, rows: usize, left: usize, places: &[u8]) {
        Recorder::span(self, rows, left, places);
    }

    fn blocks(&mut self, mask: u16) {
        Recorder::blocks(self, mask);
    }

    #[inline(always)]
    fn became(&mut self, decision: Option<Decision>) {
        let event = match decision {
            Some(Decision::Accumulated(_)) => Event::Accumulated,
            Some(Decision::Inserted(_)) => Event::Inserted,
            Some(
                Decision::Merged(..)
                | Decision::Late(..)
                | Decision::Inside(_)
                | Decision::Summed(..)
                | Decision::Closed(..),
            ) => Event::Merged(self.take_shaded()),
            Some(Decision::Evicted(_)) => Event::Evicted,
            Some(Decision::Replaced | Decision::Dropped) => Event::Replaced,
            None => Event::Faint,
        };
        Recorder::became(self, event);
    }

    fn stopped(&mut self, by_merge: bool) {
        Recorder::became(
            self,
            if by_merge {
                Event::MergedAndStopped
            } else {
                Event::Stopped
            },
        );
    }

    fn shaded(&mut self) {
        Recorder::shaded(self);
    }

    fn lit(&mut self) {
        Recorder::lit(self);
    }

    fn looked_up(&mut self, texel: [u8; 2]) {
        Recorder::looked_up(self, texel);
    }

    fn mirrors(&mut self) {
        Recorder::mirrors(self);
    }

    #[inline(always)]
    fn held(&mut self, fragments: u8, shades: u8) {
        self.pixel(fragments, shades);
    }

    fn tile(&mut self, x: u32, y: u32) {
        Recorder::tile(self, [x as u16, y as u16]);
    }
}

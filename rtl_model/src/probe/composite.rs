//! Composite: [`Meters`] and a [`Recorder`] in one probe, so that ranges and work need only one
//! drawing.

use super::{Meters, Probe, Ranges};
use crate::num::{Fit, LANES, LimitedWords, Words};
use crate::records::{Decision, Signal};
use crate::work::{CULLED, MergedLists, Recorder, TestedWords, Work};
use std::ops::Range;

/// Measures the range of every signal and records the work.
#[derive(Clone, Debug)]
pub struct Composite {
    meters: Meters,
    recorder: Recorder,
}

impl Composite {
    /// For a machine with these signals.
    pub fn new(signals: &[Signal]) -> Self {
        Composite {
            meters: Meters::new(signals),
            recorder: Recorder::default(),
        }
    }

    /// The ranges measured, and the work of a frame of this size.
    pub fn finish(self, width: u32, height: u32) -> (Ranges, Work) {
        (self.meters.ranges(), self.recorder.work(width, height))
    }
}

impl Probe for Composite {
    const WORDS: bool = true;
    const EIGHT: bool = true;
    const QUICK: bool = true;
    const DECISIONS: bool = false;
    const WORK: bool = true;

    fn fork(&self) -> Self {
        Composite {
            meters: self.meters.fork(),
            recorder: self.recorder.fork(),
        }
    }

    fn absorb(&mut self, fork: Self) {
        self.meters.absorb(fork.meters);
        Probe::absorb(&mut self.recorder, fork.recorder);
    }

    // Words go to the meters.

    #[inline(always)]
    fn word(&mut self, fit: &Fit, exact: i64, more: i64, word: i64) {
        self.meters.word(fit, exact, more, word);
    }

    #[inline(always)]
    fn item(&mut self, nth: usize) {
        self.meters.item(nth);
    }

    #[inline(always)]
    fn one(&mut self, signal: usize, word: i64) {
        self.meters.one(signal, word);
    }

    #[inline(always)]
    fn eight<W: Words>(&mut self, signal: usize, fitted: LimitedWords<W>, live: u8) {
        self.meters.eight(signal, fitted, live);
    }

    #[inline(always)]
    fn wide(&mut self, signal: usize, words: [i64; LANES], limited: u8, live: u8) {
        self.meters.wide(signal, words, limited, live);
    }

    #[inline(always)]
    fn three(&mut self, signal: usize, words: [i64; 3]) {
        self.meters.three(signal, words);
    }

    #[inline(always)]
    fn sums<W: Words>(&mut self, fitted: LimitedWords<W>) {
        self.meters.sums(fitted);
    }

    fn wrapped(&mut self, signal: usize) {
        self.meters.wrapped(signal);
    }

    #[inline(always)]
    fn reached(&mut self, signal: usize, results: [i64; 2]) {
        self.meters.reached(signal, results);
    }

    #[inline(always)]
    fn resample(&mut self, item: usize, of: usize) -> Option<&mut Ranges> {
        self.meters.resample(item, of)
    }

    #[inline(always)]
    fn resample_batch(
        &mut self,
        items: Range<usize>,
        of: usize,
        repeat: impl FnMut(usize, &mut Ranges),
    ) {
        self.meters.resample_batch(items, of, repeat);
    }

    // Work goes to the recorder.

    fn culled(&mut self, first: u32, lanes: [u8; CULLED.len()]) {
        Probe::culled(&mut self.recorder, first, lanes);
    }

    #[inline(always)]
    fn drawn(&mut self, splat: u32, sides: [[u16; 2]; 2]) {
        Probe::drawn(&mut self.recorder, splat, sides);
    }

    fn sorted(&mut self, order: Vec<u32>, keys: Vec<u32>) {
        Probe::sorted(&mut self.recorder, order, keys);
    }

    fn merged(&mut self, lists: MergedLists) {
        Probe::merged(&mut self.recorder, lists);
    }

    fn tested(&mut self, words: Vec<TestedWords>, cutoff: i64) {
        Probe::tested(&mut self.recorder, words, cutoff);
    }

    fn ellipsoids(&mut self, preshaded: bool, shared_axes: bool, harmonics: u8) {
        Probe::ellipsoids(&mut self.recorder, preshaded, shared_axes, harmonics);
    }

    #[inline(always)]
    fn span(&mut self, rows: usize, left: usize, places: &[u8]) {
        Probe::span(&mut self.recorder, rows, left, places);
    }

    fn blocks(&mut self, mask: u16) {
        Probe::blocks(&mut self.recorder, mask);
    }

    #[inline(always)]
    fn became(&mut self, decision: Option<Decision>) {
        Probe::became(&mut self.recorder, decision);
    }

    fn stopped(&mut self, by_merge: bool) {
        Probe::stopped(&mut self.recorder, by_merge);
    }

    fn shaded(&mut self) {
        Probe::shaded(&mut self.recorder);
    }

    fn lit(&mut self) {
        Probe::lit(&mut self.recorder);
    }

    fn looked_up(&mut self, texel: [u8; 2]) {
        Probe::looked_up(&mut self.recorder, texel);
    }

    fn mirrors(&mut self) {
        Probe::mirrors(&mut self.recorder);
    }

    #[inline(always)]
    fn held(&mut self, fragments: u8, shades: u8) {
        Probe::held(&mut self.recorder, fragments, shades);
    }

    fn tile(&mut self, x: u32, y: u32) {
        Probe::tile(&mut self.recorder, x, y);
    }
}

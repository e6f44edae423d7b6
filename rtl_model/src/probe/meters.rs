//! Meters: measures the [`Ranges`] of all words eight at a time, and counts a sample of them one by
//! one.
//!
//! ```text
//! all words ─►[ least, greatest, every bit set ]──────────────┐
//!     └► some limited ──────┬─►( item of work repeated )─►[ Ranges ]─► saturated, wrapped
//! every n-th item of work ──┘                           └─►[ Ranges ]─► words, inexact, bins
//! ```
//! If single words are limited, a few of them are kept, so that their item is not repeated. An item
//! of work is eight splats in setup, a tile elsewhere. Extremes and limits are those of all words.
//! Counts are those of a sample that does not depend on threads: all items if they are few, at
//! least one in [`MOST_APART`] if they are many.
//!
//! Laws: `meters_equal_counted_ranges`, `a_sample_is_spread_evenly`.

use super::ranges::{Range, Ranges};
use super::{LimitedWords, Probe};
use crate::num::{Fit, LANES, Words};
use crate::records::{SUM_SIGNALS, Signal, unit};

/// Size up to which all items are in the sample.
const FEW: usize = 12;
/// The sample has at least one of this many items.
pub const MOST_APART: usize = 256;

/// Whether an item, out of `of`, belongs to the sample: a fraction of them, by steps of the golden
/// ratio, to which no picture width is related.
fn is_sampled(item: usize, of: usize) -> bool {
    let apart = (of / FEW).clamp(1, MOST_APART) as u32;
    (item as u32).wrapping_mul(0x9E37_79B9) <= u32::MAX / apart
}

/// Extremes of eight lanes, and every bit that was set.
#[derive(Clone, Copy, Debug)]
struct Extremes {
    min: [i32; LANES],
    max: [i32; LANES],
    any: [i32; LANES],
}

impl Default for Extremes {
    fn default() -> Self {
        Extremes {
            min: [i32::MAX; LANES],
            max: [i32::MIN; LANES],
            any: [0; LANES],
        }
    }
}

impl Extremes {
    #[inline(always)]
    fn add<W: Words>(&mut self, words: W) {
        self.min = W::from_array(self.min).min(words).to_array();
        self.max = W::from_array(self.max).max(words).to_array();
        self.any = (W::from_array(self.any) | words).to_array();
    }

    fn absorb(&mut self, other: &Extremes) {
        for lane in 0..LANES {
            self.min[lane] = self.min[lane].min(other.min[lane]);
            self.max[lane] = self.max[lane].max(other.max[lane]);
            self.any[lane] |= other.any[lane];
        }
    }

    fn add_to(&self, lane: usize, range: &mut Range) {
        SingleExtremes::of(
            self.min[lane].into(),
            self.max[lane].into(),
            self.any[lane].into(),
        )
        .add_to(range);
    }
}

/// Extremes of single words.
#[derive(Clone, Copy, Debug)]
struct SingleExtremes {
    min: i64,
    max: i64,
    /// Distance from the least to the greatest word.
    span: u64,
    any: i64,
}

impl Default for SingleExtremes {
    /// Every word except `i64::MAX`, which no signal has, is outside the span.
    fn default() -> Self {
        SingleExtremes {
            min: i64::MAX,
            max: i64::MIN,
            span: 0,
            any: 0,
        }
    }
}

impl SingleExtremes {
    /// Without words, the minimum is above the maximum.
    fn of(min: i64, max: i64, any: i64) -> Self {
        if min <= max {
            SingleExtremes {
                min,
                max,
                span: max.wrapping_sub(min) as u64,
                any,
            }
        } else {
            SingleExtremes::default()
        }
    }

    #[inline(always)]
    fn add(&mut self, word: i64) {
        self.any |= word;
        if word.wrapping_sub(self.min) as u64 > self.span {
            self.widen(word, word);
        }
    }

    /// Called rarely.
    #[cold]
    #[inline(never)]
    fn widen(&mut self, min: i64, max: i64) {
        (self.min, self.max) = (self.min.min(min), self.max.max(max));
        self.span = self.max.wrapping_sub(self.min) as u64;
    }

    fn absorb(&mut self, other: &SingleExtremes) {
        if other.min <= other.max {
            self.widen(other.min, other.max);
            self.any |= other.any;
        }
    }

    /// Without words, the minimum is above the maximum.
    fn add_to(&self, range: &mut Range) {
        if self.min <= self.max {
            range.min = range.min.min(self.min);
            range.max = range.max.max(self.max);
            range.reach(self.min);
            range.reach(self.max);
            range.any |= self.any;
        }
    }
}

/// Extremes of eight lanes of more than 32 bits.
#[derive(Clone, Debug)]
struct WideExtremes {
    min: [i64; LANES],
    max: [i64; LANES],
    any: [i64; LANES],
}

impl Default for WideExtremes {
    fn default() -> Self {
        WideExtremes {
            min: [i64::MAX; LANES],
            max: [i64::MIN; LANES],
            any: [0; LANES],
        }
    }
}

impl WideExtremes {
    #[inline(always)]
    fn add(&mut self, words: [i64; LANES]) {
        for (lane, word) in words.into_iter().enumerate() {
            self.min[lane] = self.min[lane].min(word);
            self.max[lane] = self.max[lane].max(word);
            self.any[lane] |= word;
        }
    }

    fn lanes(&self) -> impl Iterator<Item = SingleExtremes> {
        (0..LANES).map(|lane| SingleExtremes::of(self.min[lane], self.max[lane], self.any[lane]))
    }
}

/// A limited single word: bit of its item, fit, exact result, additional fraction bits of the
/// result, word.
type Limited = (u64, Fit, i64, i64, i64);

/// Greatest number of them kept per item of work; with more, the item is resampled.
const KEPT: usize = 64;

/// Measures the range of every signal.
#[derive(Clone, Debug)]
pub struct Meters {
    /// Per signal: words in groups of eight, of up to 32 bits and of more; single words; values
    /// that passed through registers.
    grouped: Vec<Extremes>,
    wide: Vec<WideExtremes>,
    single: Vec<SingleExtremes>,
    passed: Vec<SingleExtremes>,
    /// The sums of a fragment: every lane is another signal.
    sums: Extremes,
    /// Signals of the lanes of `sums`.
    sum_signals: [usize; LANES],
    /// Bit of the current item in a batch.
    item: u64,
    /// Items with a limited word in a group of eight; limited single words.
    is_limited: u64,
    limited: Vec<Limited>,
    /// Sampled items, word by word, and other items with a limited word.
    resampled: [Ranges; 2],
}

impl Meters {
    /// For a machine with these signals.
    pub fn new(signals: &[Signal]) -> Self {
        let of_sum = |name: &str| {
            signals
                .iter()
                .position(|signal| signal.unit == unit::FRAGMENT && signal.name == name)
                .unwrap_or_default()
        };
        Meters::of(signals.len(), SUM_SIGNALS.map(of_sum))
    }

    fn of(signals: usize, sum_signals: [usize; LANES]) -> Self {
        Meters {
            grouped: vec![Extremes::default(); signals],
            wide: vec![WideExtremes::default(); signals],
            single: vec![SingleExtremes::default(); signals],
            passed: vec![SingleExtremes::default(); signals],
            sums: Extremes::default(),
            sum_signals,
            item: 1,
            is_limited: 0,
            limited: Vec::new(),
            resampled: [Ranges::new(signals), Ranges::new(signals)],
        }
    }

    /// The measured ranges.
    pub fn ranges(&self) -> Ranges {
        let [sample, limited] = &self.resampled;
        let mut ranges = sample.clone();
        for (signal, range) in ranges.0.iter_mut().enumerate() {
            range.absorb(&Range {
                words: 0,
                inexact: 0,
                bins: Range::default().bins,
                ..limited.0[signal]
            });
            (0..LANES).for_each(|lane| self.grouped[signal].add_to(lane, range));
            self.wide[signal]
                .lanes()
                .for_each(|lane| lane.add_to(range));
            self.single[signal].add_to(range);
            let passed = self.passed[signal];
            if passed.min <= passed.max {
                range.reach(passed.min);
                range.reach(passed.max);
                range.any |= passed.any;
            }
        }
        for (lane, signal) in self.sum_signals.into_iter().enumerate() {
            self.sums.add_to(lane, &mut ranges.0[signal]);
        }
        ranges
    }
}

impl Probe for Meters {
    const WORDS: bool = true;
    const EIGHT: bool = true;
    const QUICK: bool = true;
    const DECISIONS: bool = false;

    fn fork(&self) -> Self {
        Meters::of(self.single.len(), self.sum_signals)
    }

    fn absorb(&mut self, fork: Self) {
        for (signal, single) in self.single.iter_mut().enumerate() {
            self.grouped[signal].absorb(&fork.grouped[signal]);
            fork.wide[signal]
                .lanes()
                .for_each(|lane| single.absorb(&lane));
            single.absorb(&fork.single[signal]);
            self.passed[signal].absorb(&fork.passed[signal]);
        }
        self.sums.absorb(&fork.sums);
        for (own, other) in self.resampled.iter_mut().zip(fork.resampled) {
            own.absorb(other);
        }
    }

    #[inline(always)]
    fn word(&mut self, fit: &Fit, exact: i64, more: i64, word: i64) {
        if fit.is_within(exact, more, word) {
            self.single[fit.signal].add(word);
        } else if self.limited.len() < KEPT {
            self.limited.push((self.item, *fit, exact, more, word));
        } else {
            self.is_limited |= self.item;
        }
    }

    #[inline(always)]
    fn item(&mut self, nth: usize) {
        self.item = 1 << nth;
    }

    #[inline(always)]
    fn one(&mut self, signal: usize, word: i64) {
        self.single[signal].add(word);
    }

    #[inline(always)]
    fn eight<W: Words>(&mut self, signal: usize, fitted: LimitedWords<W>, live: u8) {
        if live == 0 {
            return;
        }
        // A limited word is resampled, together with its item.
        if fitted.limited & live != 0 {
            self.is_limited |= self.item;
            return;
        }
        self.grouped[signal].add(
            fitted
                .words
                .pick(W::from_array(STAND_IN[usize::from(live)])),
        );
    }

    #[inline(always)]
    fn wide(&mut self, signal: usize, words: [i64; LANES], limited: u8, live: u8) {
        if limited & live != 0 {
            self.is_limited |= self.item;
        } else if live != 0 {
            self.wide[signal]
                .add(STAND_IN[usize::from(live)].map(|lane| words[lane as usize % LANES]));
        }
    }

    #[inline(always)]
    fn three(&mut self, signal: usize, words: [i64; 3]) {
        let single = &mut self.single[signal];
        single.any |= words[0] | words[1] | words[2];
        let [a, b, c] = words.map(|word| word.wrapping_sub(single.min) as u64);
        if a.max(b).max(c) > single.span {
            words.into_iter().for_each(|word| single.widen(word, word));
        }
    }

    #[inline(always)]
    fn sums<W: Words>(&mut self, fitted: LimitedWords<W>) {
        if fitted.limited != 0 {
            self.is_limited |= self.item;
            return;
        }
        self.sums.add(fitted.words);
    }

    fn wrapped(&mut self, _signal: usize) {
        self.is_limited |= self.item;
    }

    #[inline(always)]
    fn reached(&mut self, signal: usize, [low, high]: [i64; 2]) {
        let passed = &mut self.passed[signal];
        passed.add(low);
        passed.add(high);
    }

    #[inline(always)]
    fn resample(&mut self, item: usize, of: usize) -> Option<&mut Ranges> {
        let [sample, limited] = &mut self.resampled;
        let resampled = match (is_sampled(item, of), std::mem::take(&mut self.is_limited)) {
            (true, _) => Some(sample),
            (false, 1..) => Some(limited),
            (false, 0) => {
                self.limited
                    .drain(..)
                    .for_each(|(_, fit, exact, more, word)| limited.word(&fit, exact, more, word));
                return None;
            }
        };
        // The item is resampled as a whole.
        self.limited.clear();
        resampled
    }

    fn resample_batch(
        &mut self,
        items: std::ops::Range<usize>,
        of: usize,
        mut repeat: impl FnMut(usize, &mut Ranges),
    ) {
        let [sample, limited] = &mut self.resampled;
        let is_limited = std::mem::take(&mut self.is_limited);
        let mut bit = 1;
        for item in items {
            if is_sampled(item, of) {
                repeat(item, sample);
            } else if is_limited & bit != 0 {
                repeat(item, limited);
            } else {
                let single = self.limited.iter().filter(|word| word.0 == bit);
                single.for_each(|(_, fit, exact, more, word)| {
                    limited.word(fit, *exact, *more, *word)
                });
            }
            bit <<= 1;
        }
        self.limited.clear();
    }
}

/// For each set of live lanes, the lane that each of the eight lanes copies: itself if live, else
/// the first live one.
const STAND_IN: [[i32; LANES]; 256] = {
    let mut all = [[0; LANES]; 256];
    let mut live = 1;
    while live < 256_usize {
        let mut lane = 0;
        while lane < LANES {
            all[live][lane] = if live & (1 << lane) != 0 {
                lane as i32
            } else {
                live.trailing_zeros() as i32
            };
            lane += 1;
        }
        live += 1;
    }
    all
};

#[cfg(test)]
mod tests;

//! Ranges: the range of each signal's words, counted one by one. [`Meters`](super::Meters) measure
//! the same, and count a sample.
//!
//! ```text
//! exact ─►( round )─► before its limits ─►[ saturate | wrap ]─► word
//!     └► inexact         └► least, greatest     └► counts        └► min, max, any, bins
//! ```
//! Sums, minima, maxima and unions do not depend on the order, so threads cannot change them.
//!
//! Laws: `ranges_are_the_same_in_any_order_of_absorption`,
//! `the_narrowest_format_holds_every_result_and_no_narrower_one_does`.

use super::Probe;
use crate::num::{Fit, Format};

/// Bins of a histogram: words have less than 64 bits.
pub const BINS: usize = 64;

/// Range of one signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Range {
    /// Words counted.
    pub words: u64,
    /// Least word, `i64::MAX` if there was none.
    pub min: i64,
    /// Greatest word, `i64::MIN` if there was none.
    pub max: i64,
    /// Results below the format's range.
    pub saturated_low: u64,
    /// Results above the format's range.
    pub saturated_high: u64,
    /// Results whose high bits were dropped.
    pub wrapped: u64,
    /// Counted results that lost bits below the LSB.
    pub inexact: u64,
    /// Least result in ulp, rounded but not limited: what the word would be without limits.
    pub least: i64,
    /// Greatest result, in the same units.
    pub greatest: i64,
    /// Every bit that was set in some result, in the same units.
    pub any: i64,
    /// Words counted, by the number of bits of their magnitude: `bins[0]` counts zeros, `bins[n]`
    /// words from 2^(n−1) to 2^n − 1 ulp.
    pub bins: [u64; BINS],
}

impl Default for Range {
    fn default() -> Self {
        Range {
            words: 0,
            min: i64::MAX,
            max: i64::MIN,
            saturated_low: 0,
            saturated_high: 0,
            wrapped: 0,
            inexact: 0,
            least: i64::MAX,
            greatest: i64::MIN,
            any: 0,
            bins: [0; BINS],
        }
    }
}

/// The bin of a word.
#[inline(always)]
pub fn bin(word: i64) -> usize {
    (u64::BITS - word.unsigned_abs().leading_zeros()) as usize % BINS
}

impl Range {
    /// Counts one word.
    pub fn count(&mut self, fit: &Fit, exact: i64, more: i64, word: i64) {
        self.words += 1;
        // Rare: a new extreme.
        if word < self.min {
            self.min = word;
        }
        if word > self.max {
            self.max = word;
        }
        self.inexact += u64::from(fit.is_inexact(exact, more));
        self.bins[bin(word)] += 1;
        if !fit.is_within(exact, more, word) {
            return self.count_limited(fit, exact, more);
        }
        if word < self.least {
            self.least = word;
        }
        if word > self.greatest {
            self.greatest = word;
        }
        self.any |= word;
    }

    #[cold]
    #[inline(never)]
    fn count_limited(&mut self, fit: &Fit, exact: i64, more: i64) {
        let loss = fit.loss(exact, more);
        self.saturated_low += u64::from(loss.saturated_low);
        self.saturated_high += u64::from(loss.saturated_high);
        self.wrapped += u64::from(loss.wrapped);
        self.reach(fit.before_limits(exact, more));
    }

    /// Includes a result in the extremes, whether it became a word or not.
    pub fn reach(&mut self, result: i64) {
        self.least = self.least.min(result);
        self.greatest = self.greatest.max(result);
        self.any |= result;
    }

    /// Adds the counts of another range of the same signal.
    pub fn absorb(&mut self, other: &Range) {
        self.words += other.words;
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
        self.saturated_low += other.saturated_low;
        self.saturated_high += other.saturated_high;
        self.wrapped += other.wrapped;
        self.inexact += other.inexact;
        self.least = self.least.min(other.least);
        self.greatest = self.greatest.max(other.greatest);
        self.any |= other.any;
        for (own, other) in self.bins.iter_mut().zip(other.bins) {
            *own += other;
        }
    }

    /// Whether there was any word, counted or not.
    pub fn has_words(&self) -> bool {
        self.min <= self.max
    }

    /// The narrowest format, with the sign of `format`, that would have represented every result of
    /// a signal in `format`; none if there was no word. Results below 0 are ignored for an unsigned
    /// format.
    pub fn narrowest(&self, format: Format) -> Option<Format> {
        if !self.has_words() {
            return None;
        }
        // A sign, and the bits of the magnitude of −1 − x or x, whichever is longer.
        let bits = |result: i64| (u64::BITS - result.max(!result).leading_zeros()) as i32;
        let width = if format.signed {
            1 + bits(self.least).max(bits(self.greatest))
        } else {
            bits(self.greatest.max(0))
        };
        let unused = (self.any.trailing_zeros() as i32).min(format.frac_bits);
        let frac_bits = format.frac_bits - unused;
        let narrowest = Format {
            int_bits: (width - format.frac_bits).max(1 - frac_bits),
            frac_bits,
            ..format
        };
        // As many bits are left as are significant: it is in fixed point.
        let is_fixed = narrowest.magnitude_bits() <= format.significant_bits;
        Some(if is_fixed {
            narrowest.in_fixed_point()
        } else {
            narrowest
        })
    }
}

/// Counts the range of every signal, word by word.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ranges(pub Vec<Range>);

impl Ranges {
    /// For a machine with `signals` signals.
    pub fn new(signals: usize) -> Self {
        Ranges(vec![Range::default(); signals])
    }
}

impl Probe for Ranges {
    const WORDS: bool = true;
    const DECISIONS: bool = false;

    fn fork(&self) -> Self {
        Ranges::new(self.0.len())
    }

    fn absorb(&mut self, fork: Self) {
        for (own, other) in self.0.iter_mut().zip(&fork.0) {
            own.absorb(other);
        }
    }

    fn word(&mut self, fit: &Fit, exact: i64, more: i64, word: i64) {
        self.0[fit.signal].count(fit, exact, more, word);
    }

    fn wrapped(&mut self, signal: usize) {
        self.0[signal].wrapped += 1;
    }

    fn reached(&mut self, signal: usize, results: [i64; 2]) {
        results
            .into_iter()
            .for_each(|result| self.0[signal].reach(result));
    }
}

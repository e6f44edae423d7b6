//! Probe: what may be watched while the machine draws. It does nothing by default and then costs nothing.
//!
//! Units hand every fitted word and every decision to a [`Tap`]; with [`Unwatched`] the compiler removes all of it.
//! Parts of a frame are watched by forks of a probe; absorbing forks is associative, so threads cannot change a count.
//!
//! A probe hears words one by one, or ([`Probe::EIGHT`]) eight at a time as long as nothing leaves its range.

mod meters;
mod ranges;

pub use meters::Meters;
pub use ranges::{BINS, Range, Ranges};

use crate::num::{Exacts, Fit, LANES, Lanes, Register, Seen, Words};
use crate::units::fragment::{Contribution, Decision};
use crate::units::resolve::Layer;
use std::hint::cold_path;

/// A watcher of the machine.
pub trait Probe: Send + Sync + Sized {
    /// Whether words are wanted: if not, the compiler drops the calls.
    const WORDS: bool;
    /// Whether words that met no limit are wanted without their exact results, and eight at a time, where that can be done.
    const EIGHT: bool = false;
    /// Whether contributions and resolved pixels are wanted.
    const DECISIONS: bool;
    /// Whether its frames are worth vector instructions and paths of their own for common machines: quick to draw, slow to compile.
    const QUICK: bool = false;

    /// A fresh watcher of the same kind, for another part of the frame.
    fn fork(&self) -> Self;
    /// Takes over what a fork saw.
    fn absorb(&mut self, fork: Self);
    /// `exact` (with `more` fraction bits than elaborated) became `word` at `fit.signal`.
    fn word(&mut self, _fit: &Fit, _exact: i64, _more: i64, _word: i64) {}
    /// This became a word of a signal, exactly or not.
    #[inline(always)]
    fn one(&mut self, _signal: usize, _word: i64, _inexact: bool) {}
    /// These became words of a signal, as far as they are `live` (a lane a bit; one is). None met a limit.
    #[inline(always)]
    fn eight<W: Words>(&mut self, _signal: usize, _seen: Seen<W>, _live: u8) {}
    /// These became the eight sums of a fragment, in the order of their signals. None met a limit.
    #[inline(always)]
    fn sums<W: Words>(&mut self, _seen: Seen<W>) {}
    /// A register outran its format and wrapped.
    fn wrapped(&mut self, _signal: usize) {}
    /// A register of a signal was to hold all from the first to the second on its way, which are no words of their own.
    fn reached(&mut self, _signal: usize, _results: [i64; 2]) {}
    /// A splat contributed to pixel (x, y), and this became of it.
    fn contribution(&mut self, _x: u32, _y: u32, _contribution: &Contribution, _decision: Decision) {}
    /// Pixel (x, y) was resolved from these layers, front to back, into this frame word.
    fn resolved(&mut self, _x: u32, _y: u32, _layers: &[Layer], _frame: [i64; 4]) {}
    /// The tile whose first pixel is (x, y) is done: its decisions have all been told.
    fn tile(&mut self, _x: u32, _y: u32) {}
}

/// Nobody watches.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unwatched;

impl Probe for Unwatched {
    const QUICK: bool = true;
    const WORDS: bool = false;
    const DECISIONS: bool = false;
    fn fork(&self) -> Self {
        Unwatched
    }
    fn absorb(&mut self, _fork: Self) {}
}

/// A unit's connection to the probe: every fit passes through it.
#[derive(Debug)]
pub struct Tap<'a, P> {
    /// The watcher.
    pub probe: &'a mut P,
    /// Lanes that carry a live item, the first in the last place; the others are not shown to the watcher.
    pub live: u8,
}

impl<'a, P: Probe> Tap<'a, P> {
    /// A tap for one item at a time.
    #[inline(always)]
    pub fn new(probe: &'a mut P) -> Self {
        Tap { probe, live: u8::MAX }
    }

    /// Shows the watcher only the first so many lanes.
    #[inline(always)]
    pub fn first(self, lanes: usize) -> Self {
        Tap { live: ((1 << lanes.min(LANES)) - 1) as u8, ..self }
    }

    /// Shows the watcher no more of the lanes where the condition holds.
    #[inline(always)]
    pub fn drop_where<W: Words>(&mut self, condition: W) {
        if P::WORDS {
            self.live &= !condition.signs();
        }
    }

    /// Fits one result.
    #[inline(always)]
    pub fn fit_one(&mut self, fit: &Fit, exact: i64) -> i64 {
        if P::EIGHT
            && let Some((word, inexact)) = fit.one_seen(exact)
        {
            self.probe.one(fit.signal, word, inexact);
            return word;
        }
        let word = fit.one(exact);
        if P::WORDS {
            self.probe.word(fit, exact, 0, word);
        }
        word
    }

    /// Fits one result that has `more` fraction bits than was elaborated.
    #[inline(always)]
    pub fn fit_one_shifted(&mut self, fit: &Fit, exact: i64, more: i64) -> i64 {
        let word = fit.one_shifted(exact, more);
        if P::WORDS {
            self.probe.word(fit, exact, more, word);
        }
        word
    }

    /// Fits eight results.
    #[inline(always)]
    pub fn fit<L: Lanes>(&mut self, fit: &Fit, exact: L) -> L {
        if let Some(word) = self.lanes_seen::<false, L>(fit, exact) {
            return word;
        }
        let word = fit.lanes(exact);
        self.one_by_one(fit, exact, L::splat(0), word);
        word
    }

    /// Fits eight results into registers that wrap.
    #[inline(always)]
    pub fn fit_register<L: Lanes>(&mut self, fit: &Fit, register: Register, exact: L) -> L {
        let held = register.hold(fit.lanes_register(exact));
        self.one_by_one(fit, exact, L::splat(0), register.read_lanes(held));
        held
    }

    /// Fits eight results of which none is negative, into a word without a sign ([`Fit::lanes_natural`]).
    #[inline(always)]
    pub fn fit_natural<const PLAIN: bool, L: Lanes>(&mut self, fit: &Fit, exact: L) -> L {
        if let Some(word) = self.lanes_seen::<true, L>(fit, exact) {
            return word;
        }
        let word = fit.lanes_natural::<PLAIN, L>(exact);
        self.one_by_one(fit, exact, L::splat(0), word);
        word
    }

    /// [`Tap::fit_natural`] where the word is known to reach all results.
    #[inline(always)]
    pub fn fit_within<const PLAIN: bool, L: Lanes>(&mut self, fit: &Fit, exact: L) -> L {
        if P::EIGHT {
            return self.fit_natural::<PLAIN, L>(fit, exact);
        }
        let word = fit.lanes_within::<PLAIN, L>(exact);
        self.one_by_one(fit, exact, L::splat(0), word);
        word
    }

    /// Fits eight results into words of at most 32 bits.
    #[inline(always)]
    pub fn fit_words<X: Exacts>(&mut self, fit: &Fit, exact: X) -> X::Words {
        if P::EIGHT
            && let Some(words) = self.eight(fit, fit.words_seen(exact))
        {
            return words;
        }
        let words = fit.words(exact);
        self.one_by_one_of(fit, exact, X::Words::splat(0), words.exact());
        words
    }

    /// Fits eight results that a normaliser has shifted to the top of their 62 bits into words of at most 32 bits.
    #[inline(always)]
    pub fn fit_top<X: Exacts>(&mut self, fit: &Fit, exact: X) -> X::Words {
        if P::EIGHT
            && let Some(words) = self.eight(fit, fit.top_seen(exact))
        {
            return words;
        }
        let words = fit.top(exact);
        self.one_by_one_of(fit, exact, X::Words::splat(0), words.exact());
        words
    }

    /// Fits eight results into words that may have more than 32 bits.
    #[inline(always)]
    pub fn fit_wide<X: Exacts>(&mut self, fit: &Fit, exact: X) -> X {
        if P::EIGHT
            && let Some(words) = self.eight(fit, fit.wide_seen(exact))
        {
            return words.exact();
        }
        let words = fit.wide(exact);
        self.one_by_one_of(fit, exact, X::Words::splat(0), words);
        words
    }

    /// Fits eight results, each with `more` fraction bits than was elaborated, into words of at most 32 bits.
    #[inline(always)]
    pub fn fit_shifted<X: Exacts>(&mut self, fit: &Fit, exact: X, more: X::Words) -> X::Words {
        if P::EIGHT
            && let Some(words) = self.eight(fit, fit.shifted_seen(exact, more))
        {
            return words;
        }
        let words = fit.words_shifted(exact, more);
        self.one_by_one_of(fit, exact, more, words.exact());
        words
    }

    #[inline(always)]
    fn lanes_seen<const NATURAL: bool, L: Lanes>(&mut self, fit: &Fit, exact: L) -> Option<L> {
        if !P::EIGHT {
            return None;
        }
        let (words, seen) = fit.lanes_seen::<NATURAL, L>(exact)?;
        self.eight(fit, Some(seen)).map(|_| words)
    }

    /// Shows eight words at once, if that can be done.
    #[inline(always)]
    fn eight<W: Words>(&mut self, fit: &Fit, seen: Option<Seen<W>>) -> Option<W> {
        let seen = seen?;
        if seen.limited & self.live != 0 || self.live == 0 {
            cold_path();
            return None;
        }
        self.probe.eight(fit.signal, seen, self.live);
        Some(seen.words)
    }

    #[inline(always)]
    fn one_by_one_of<X: Exacts>(&mut self, fit: &Fit, exact: X, more: X::Words, words: X) {
        if P::WORDS {
            self.each(*fit, [exact.to_array(), more.exact().to_array(), words.to_array()]);
        }
    }

    #[inline(always)]
    fn one_by_one<L: Lanes>(&mut self, fit: &Fit, exact: L, more: L, words: L) {
        if P::WORDS {
            self.each(*fit, [exact.to_array(), more.to_array(), words.to_array()]);
        }
    }

    /// Shows what is live, one by one. Of a copy, as in `num::fit`.
    #[inline(never)]
    fn each(&mut self, fit: Fit, [exact, more, words]: [[i64; LANES]; 3]) {
        for lane in (0..LANES).filter(|lane| self.live & (1 << lane) != 0) {
            self.probe.word(&fit, exact[lane], more[lane], words[lane]);
        }
    }
}

#[cfg(test)]
mod tests;

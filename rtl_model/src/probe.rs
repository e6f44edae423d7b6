//! Probe: what may be watched while the machine draws. It does nothing by default and then costs nothing.
//!
//! Units hand every fitted word and every decision to a [`Tap`]; with [`Unwatched`] the compiler removes all of it.
//! Parts of a frame are watched by forks of a probe; absorbing forks is associative, so threads cannot change a count.

use crate::num::lanes::Plain;
use crate::num::register::{Held, Register};
use crate::num::{Exacts, Fit, LANES, Lanes, Loss, Mask, Words};
use crate::units::fragment::{Contribution, Decision};
use crate::units::resolve::Layer;

/// A watcher of the machine.
pub trait Probe: Send + Sync + Sized {
    /// Whether words are wanted: if not, the compiler drops the calls.
    const WORDS: bool;
    /// Whether contributions and resolved pixels are wanted.
    const DECISIONS: bool;

    /// A fresh watcher of the same kind, for another part of the frame.
    fn fork(&self) -> Self;
    /// Takes over what a fork saw.
    fn absorb(&mut self, fork: Self);
    /// `exact` (with `more` fraction bits than elaborated) became `word` at `fit.signal`.
    fn word(&mut self, _fit: &Fit, _exact: i64, _more: i64, _word: i64) {}
    /// A register outran its format and wrapped.
    fn wrapped(&mut self, _signal: usize, _words: u64) {}
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
    const WORDS: bool = false;
    const DECISIONS: bool = false;
    fn fork(&self) -> Self {
        Unwatched
    }
    fn absorb(&mut self, _fork: Self) {}
}

/// What one signal saw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Range {
    /// Words seen.
    pub words: u64,
    /// Least word, `i64::MAX` where none was seen.
    pub min: i64,
    /// Greatest word, `i64::MIN` where none was seen.
    pub max: i64,
    /// Results below the format's range.
    pub saturated_low: u64,
    /// Results above the format's range.
    pub saturated_high: u64,
    /// Results whose high bits were dropped.
    pub wrapped: u64,
    /// Results that lost bits below the last place.
    pub inexact: u64,
}

impl Default for Range {
    fn default() -> Self {
        Range { words: 0, min: i64::MAX, max: i64::MIN, saturated_low: 0, saturated_high: 0, wrapped: 0, inexact: 0 }
    }
}

impl Range {
    fn see(&mut self, word: i64, loss: Loss) {
        self.words += 1;
        self.min = self.min.min(word);
        self.max = self.max.max(word);
        self.saturated_low += u64::from(loss.saturated_low);
        self.saturated_high += u64::from(loss.saturated_high);
        self.wrapped += u64::from(loss.wrapped);
        self.inexact += u64::from(loss.inexact);
    }

    fn absorb(&mut self, other: &Range) {
        self.words += other.words;
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
        self.saturated_low += other.saturated_low;
        self.saturated_high += other.saturated_high;
        self.wrapped += other.wrapped;
        self.inexact += other.inexact;
    }
}

/// Watches the range of every signal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ranges(pub Vec<Range>);

impl Ranges {
    /// For a machine with so many signals.
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
        self.0[fit.signal].see(word, fit.loss(exact, more));
    }

    fn wrapped(&mut self, signal: usize, words: u64) {
        self.0[signal].wrapped += words;
    }
}

/// A unit's connection to the probe: every fit passes through it.
#[derive(Debug)]
pub struct Tap<'a, P> {
    /// The watcher.
    pub probe: &'a mut P,
    /// Lanes that carry a live item; the others are not shown to the watcher.
    pub live: Mask,
}

impl<'a, P: Probe> Tap<'a, P> {
    /// A tap for one item at a time.
    #[inline(always)]
    pub fn new(probe: &'a mut P) -> Self {
        Tap { probe, live: [true; LANES] }
    }

    /// Shows the watcher no more of the lanes where the condition holds.
    #[inline(always)]
    pub fn drop_where<W: Words>(&mut self, condition: W) {
        if P::WORDS {
            let dropped = condition.signs();
            for (lane, live) in self.live.iter_mut().enumerate() {
                *live &= dropped & (1 << lane) == 0;
            }
        }
    }

    /// Fits one result.
    #[inline(always)]
    pub fn fit_one(&mut self, fit: &Fit, exact: i64) -> i64 {
        self.fit_one_shifted(fit, exact, 0)
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

    /// Fits one result by the short way where `PLAIN` says that all fits allow it.
    #[inline(always)]
    pub fn fit_plain<const PLAIN: bool>(&mut self, fit: &Fit, exact: i64) -> i64 {
        let word = if PLAIN { fit.plain(exact) } else { fit.one(exact) };
        if P::WORDS {
            self.probe.word(fit, exact, 0, word);
        }
        word
    }

    /// Fits one result into a register that wraps, by the short way where `PLAIN` says that all fits allow it.
    #[inline(always)]
    pub fn fit_register<const PLAIN: bool>(&mut self, fit: &Fit, register: Register, exact: i64) -> Held {
        if P::WORDS {
            self.probe.word(fit, exact, 0, fit.one(exact));
        }
        register.hold(if PLAIN { fit.plain_register(exact) } else { fit.one(exact) })
    }

    /// Fits eight results.
    #[inline(always)]
    pub fn fit<L: Lanes>(&mut self, fit: &Fit, exact: L) -> L {
        let word = fit.lanes(exact);
        self.show(fit, exact, L::splat(0), word);
        word
    }

    /// Fits eight results into words of at most 32 bits.
    #[inline(always)]
    pub fn fit_words<X: Exacts>(&mut self, fit: &Fit, exact: X) -> X::Words {
        let words = fit.words(exact);
        self.show_words(fit, exact, X::Words::splat(0), words.exact());
        words
    }

    /// Fits eight results that a normaliser has shifted to the top of their 62 bits into words of at most 32 bits.
    #[inline(always)]
    pub fn fit_top<X: Exacts>(&mut self, fit: &Fit, exact: X) -> X::Words {
        let words = fit.top(exact);
        self.show_words(fit, exact, X::Words::splat(0), words.exact());
        words
    }

    /// Fits eight results into words that may have more than 32 bits.
    #[inline(always)]
    pub fn fit_wide<X: Exacts>(&mut self, fit: &Fit, exact: X) -> X {
        let words = fit.wide(exact);
        self.show_words(fit, exact, X::Words::splat(0), words);
        words
    }

    /// Fits eight results, each with `more` fraction bits than was elaborated, into words of at most 32 bits.
    #[inline(always)]
    pub fn fit_shifted<X: Exacts>(&mut self, fit: &Fit, exact: X, more: X::Words) -> X::Words {
        let words = fit.words_shifted(exact, more);
        self.show_words(fit, exact, more, words.exact());
        words
    }

    #[inline(always)]
    fn show_words<X: Exacts>(&mut self, fit: &Fit, exact: X, more: X::Words, words: X) {
        if P::WORDS {
            self.show(fit, Plain(exact.to_array()), Plain(more.exact().to_array()), Plain(words.to_array()));
        }
    }

    #[inline(always)]
    fn show<L: Lanes>(&mut self, fit: &Fit, exact: L, more: L, word: L) {
        if P::WORDS {
            let [exact, more, word] = [exact, more, word].map(L::to_array);
            for (lane, _) in self.live.iter().enumerate().filter(|(_, live)| **live) {
                self.probe.word(fit, exact[lane], more[lane], word[lane]);
            }
        }
    }
}

//! Fit: puts an exact result into a word, the one lossy act.
//!
//! ```text
//! exact ─►(<< left)─►(+ round)─►(>> right)─►[ saturate | wrap ]─► word
//! ```
//! Everything that depends on formats is worked out once, at elaboration; per value there are shifts, an add and limits.
//! A barrel shifter in front (`…_shifted`) takes results whose binary point the data decides, after a normalisation.
//!
//! Laws: `fit_agrees_with_exact_rationals`, `fit_agrees_with_the_crate_fixed`, `eight_lanes_equal_one`, `loss_is_told_truly`.

use super::{Exact, Lanes, Overflow, Rounding, Word};

/// What a [`Fit`] lost, for whoever watches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Loss {
    /// Bits that were not zero fell off below the last place.
    pub inexact: bool,
    /// The value lay below the range and the word is the least one.
    pub saturated_low: bool,
    /// The value lay above the range and the word is the greatest one.
    pub saturated_high: bool,
    /// The value lay outside the range and only its low bits are left.
    pub wrapped: bool,
}

/// An elaborated word: how exact results with a known number of fraction bits come into it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fit {
    /// Index of the signal in the elaborated machine's list.
    pub signal: usize,
    /// The word that comes out.
    pub word: Word,
    /// Fraction bits of the exact result less those of the word: places to the right.
    places: i64,
    /// What rounds to nearest before those places are cut; 0 where they are just cut.
    half: i64,
    min: i64,
    max: i64,
    /// Neither rounding to even nor wrapping.
    simple: bool,
    /// Places by which a result is first shifted left, for a barrel shifter that then only needs to go right.
    head: u32,
    /// Simple, and no shift to the left: an add, a shift and two limits.
    plain: bool,
    /// Places to the right, where there are none to the left.
    right: u32,
}

/// Room for data-dependent shifts to the left that the vector path keeps, bits.
const MOST_HEAD: i64 = 24;

impl Fit {
    /// Elaborates `word` for exact results of the shape `from`.
    pub fn new(signal: usize, word: Word, from: Exact) -> Self {
        let places = i64::from(from.frac_bits - word.format.frac_bits);
        let half = if word.round == Rounding::Truncate { 0 } else { half(places.clamp(0, 63) as u32) };
        let simple = word.round != Rounding::NearestEven && word.overflow == Overflow::Saturate;
        let plain = simple && (0..=62).contains(&places);
        let head = if places < MOST_HEAD { (62 - from.bits()).clamp(0, MOST_HEAD as i32) as u32 } else { 0 };
        Fit {
            signal,
            word,
            places,
            half,
            min: word.format.min(),
            max: word.format.max(),
            simple,
            head,
            plain,
            right: places.clamp(0, 62) as u32,
        }
    }

    /// The word for one exact result.
    #[inline(always)]
    pub fn one(&self, exact: i64) -> i64 {
        if !self.plain {
            return self.one_shifted(exact, 0);
        }
        (exact.wrapping_add(self.half) >> self.right).max(self.min).min(self.max)
    }

    /// What is added before places are cut.
    pub fn half(&self) -> i64 {
        self.half
    }

    /// Places to the right of an exact result that are cut.
    pub fn places(&self) -> i64 {
        self.places
    }

    /// Whether an add, a shift and two limits are all there is.
    pub fn is_plain(&self) -> bool {
        self.plain
    }

    /// The word for one exact result with `more` fraction bits than was elaborated.
    #[inline(always)]
    pub fn one_shifted(&self, exact: i64, more: i64) -> i64 {
        let places = self.places + more;
        if places < 0 {
            let left = (-places).min(63) as u32;
            let shifted = exact << left;
            return if shifted >> left == exact { self.limit(shifted) } else { self.limit_wide(i128::from(exact) << left) };
        }
        self.limit(self.cut(exact, places.min(63) as u32))
    }

    /// The words for eight exact results.
    #[inline(always)]
    pub fn lanes<L: Lanes>(&self, exact: L) -> L {
        if !self.plain {
            return self.lanes_one_by_one(exact, L::splat(0));
        }
        self.limit_lanes((exact + L::splat(self.half)).right(self.right))
    }

    /// The words for eight exact results before they are wrapped into a register.
    #[inline(always)]
    pub fn lanes_register<L: Lanes>(&self, exact: L) -> L {
        let plain = (0..=62).contains(&self.places) && self.word.round != Rounding::NearestEven && self.word.overflow == Overflow::Wrap;
        if !plain {
            return self.lanes_one_by_one(exact, L::splat(0));
        }
        (exact + L::splat(self.half)).right(self.right)
    }

    /// The words for eight exact results of which none is negative, in a word without a sign. `PLAIN` says that [`Fit::is_plain`], so
    /// that nothing has to be asked.
    #[inline(always)]
    pub fn lanes_natural<const PLAIN: bool, L: Lanes>(&self, exact: L) -> L {
        if !PLAIN && !self.plain {
            return self.lanes_one_by_one(exact, L::splat(0));
        }
        (exact + L::splat(self.half)).right_natural(self.right).min(L::splat(self.max))
    }

    /// [`Fit::lanes_natural`] where the word is known to reach all results.
    #[inline(always)]
    pub fn lanes_within<const PLAIN: bool, L: Lanes>(&self, exact: L) -> L {
        if !PLAIN && !self.plain {
            return self.lanes_one_by_one(exact, L::splat(0));
        }
        (exact + L::splat(self.half)).right_natural(self.right)
    }

    /// The words for eight exact results, each with `more` fraction bits than was elaborated.
    #[inline(always)]
    pub fn lanes_shifted<L: Lanes>(&self, exact: L, more: L) -> L {
        let right = more + L::splat(self.places + i64::from(self.head));
        if !self.simple || (right | (L::splat(62) - right)).any_negative() {
            return self.lanes_one_by_one(exact, more);
        }
        let rounds = i64::from(self.word.round == Rounding::Nearest);
        let half = L::splat(rounds).left_by(right).right(1);
        self.limit_lanes((exact.left(self.head) + half).right_by(right))
    }

    #[inline(always)]
    fn limit_lanes<L: Lanes>(&self, words: L) -> L {
        words.max(L::splat(self.min)).min(L::splat(self.max))
    }

    /// The long way: every rounding, every overflow, shifts to the left.
    #[inline(never)]
    fn lanes_one_by_one<L: Lanes>(&self, exact: L, more: L) -> L {
        let (mut words, more) = (exact.to_array(), more.to_array());
        for (word, more) in words.iter_mut().zip(more) {
            *word = self.one_shifted(*word, more);
        }
        L::from_array(words)
    }

    /// What is lost when `exact`, with `more` fraction bits than was elaborated, becomes a word.
    pub fn loss(&self, exact: i64, more: i64) -> Loss {
        let places = self.places + more;
        let (rounded, inexact) = if places < 0 {
            (i128::from(exact) << (-places).min(63), false)
        } else {
            let right = places.min(63) as u32;
            (i128::from(self.cut(exact, right)), exact & ((1u64 << right) - 1) as i64 != 0)
        };
        let (below, above) = (rounded < i128::from(self.min), rounded > i128::from(self.max));
        let wrap = self.word.overflow == Overflow::Wrap;
        Loss { inexact, saturated_low: below && !wrap, saturated_high: above && !wrap, wrapped: (below || above) && wrap }
    }

    #[inline(always)]
    fn cut(&self, v: i64, right: u32) -> i64 {
        let round = match self.word.round {
            Rounding::Truncate => 0,
            Rounding::Nearest => half(right),
            Rounding::NearestEven if right == 0 => 0,
            Rounding::NearestEven => half(right) - 1 + ((v >> right) & 1),
        };
        v.wrapping_add(round) >> right
    }

    #[inline(always)]
    fn limit(&self, v: i64) -> i64 {
        match self.word.overflow {
            Overflow::Saturate => v.max(self.min).min(self.max),
            Overflow::Wrap => self.wrap(v),
        }
    }

    #[cold]
    fn limit_wide(&self, v: i128) -> i64 {
        match self.word.overflow {
            Overflow::Saturate => v.clamp(i128::from(self.min), i128::from(self.max)) as i64,
            Overflow::Wrap => self.wrap(v as i64),
        }
    }

    #[inline(always)]
    fn wrap(&self, v: i64) -> i64 {
        let unused = 64 - self.word.format.width() as u32;
        let top = v << unused;
        if self.word.format.signed { top >> unused } else { ((top as u64) >> unused) as i64 }
    }
}

/// Half of the last place that `right` dropped places leave: 63 of them leave nothing but a sign of the 62 bits that are held.
#[inline(always)]
fn half(right: u32) -> i64 {
    ((1u64 << right) >> 1) as i64
}

#[cfg(test)]
mod tests;

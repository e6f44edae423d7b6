//! Fit: quantises an exact result to a word, the only lossy operation.
//!
//! ```text
//! exact ─►(<< left)─►(+ round)─►(>> right)─►[ saturate | wrap ]─► word
//! ```
//! Everything that depends on formats is computed once, at elaboration; a value takes shifts, an
//! addition and limits. A barrel shifter in front (`…_shifted`) accepts results whose binary point
//! depends on the data, as after a normalisation.
//!
//! Laws: `fit_agrees_with_exact_rationals`, `fit_agrees_with_the_crate_fixed`,
//! `eight_lanes_equal_one`, `eight_narrow_words_equal_one`, `loss_is_reported_exactly`.

use super::float::significant_shift;
use super::{Exact, Exacts, LANES, Lanes, Overflow, Rounding, Word, Words, three};
use std::hint::cold_path;

/// Losses of a [`Fit`], for probes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Loss {
    /// Bits other than zero were dropped below the LSB.
    pub inexact: bool,
    /// The value was below the range; the word is the least one.
    pub saturated_low: bool,
    /// The value was above the range; the word is the greatest one.
    pub saturated_high: bool,
    /// The value was outside the range; only its low bits remain.
    pub wrapped: bool,
}

/// Eight results of a simple fit (an addition, a shift and two limits), for probes.
#[derive(Clone, Copy, Debug)]
pub struct LimitedWords<W> {
    /// The words, of at most 31 bits.
    pub words: W,
    /// Lanes that a limit changed, the first lane in the LSB.
    pub limited: u8,
}

/// An elaborated word: how exact results with a given number of fraction bits become this word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fit {
    /// Index of the signal in the elaborated machine's list.
    pub signal: usize,
    /// The resulting word.
    pub word: Word,
    /// Fraction bits of the exact result less those of the word: the right shift.
    places: i64,
    /// Half an ulp, added before the shift to round to nearest; 0 for truncation.
    half: i64,
    min: i64,
    max: i64,
    /// Left shift in front of a barrel shifter, so that the barrel shifter only shifts right.
    head: u32,
    /// Right shift after `head` that leaves one bit for rounding; [`IMPOSSIBLE`] unless the fit is
    /// simple.
    barrel: i64,
    /// Default rounding and overflow, and no left shift: an addition, a shift and two limits.
    simple: bool,
    /// Simple, and every exact result of the elaborated shape is a word of 32 bits after a right
    /// shift of 0 to 31. The limits can then be applied to that word.
    narrow: bool,
    /// As `narrow`, for right shifts of 32 and more, after which every exact result is a word of 32
    /// bits.
    deep: bool,
    /// The right shift; 0 for a left shift.
    right: u32,
}

/// Greatest data-dependent left shift on the vector path, bits.
const MOST_HEAD: i64 = 24;
/// A shift beyond that of any shifter, whatever the data adds to it.
const IMPOSSIBLE: i64 = 1 << 20;

/// A [`Fit`] with its constants on all lanes, whose limits are applied to words of 32 bits: see
/// [`Fit::narrow`].
#[derive(Clone, Copy, Debug)]
pub struct Narrow<W: Words> {
    half: W::Exact,
    places: u32,
    min: W,
    max: W,
}

impl<W: Words> Narrow<W> {
    /// The words for eight exact results.
    #[inline(always)]
    pub fn words(&self, exact: W::Exact) -> W {
        (exact + self.half)
            .cut(self.places)
            .max(self.min)
            .min(self.max)
    }
}

/// A [`Fit`] with its constants on all lanes, for words of 31 bits: see [`Fit::natural`].
#[derive(Clone, Copy, Debug)]
pub struct Natural<W> {
    half: W,
    right: u32,
    max: W,
}

impl<W: Words> Natural<W> {
    /// The words for eight exact results.
    #[inline(always)]
    pub fn words(&self, exact: W) -> W {
        (exact + self.half).right(self.right).min(self.max)
    }
}

impl Fit {
    /// Elaborates `word` for exact results of the shape `from`.
    pub fn new(signal: usize, word: Word, from: Exact) -> Self {
        let places = i64::from(from.frac_bits - word.format.frac_bits);
        let half = if word.round == Rounding::Truncate {
            0
        } else {
            half(places.clamp(0, 63) as u32)
        };
        let usual = word.round != Rounding::NearestEven
            && word.overflow == Overflow::Saturate
            && !word.format.is_float();
        let simple = usual && (0..=62).contains(&places);
        let narrow = simple && places < 32 && i64::from(from.bits()) - places <= 30;
        let deep = simple && places >= 32;
        let head = if places < MOST_HEAD {
            (62 - from.bits()).clamp(0, MOST_HEAD as i32) as u32
        } else {
            0
        };
        let barrel = if usual {
            places + i64::from(head) - 1
        } else {
            IMPOSSIBLE
        };
        Fit {
            signal,
            word,
            places,
            half,
            min: word.format.min(),
            max: word.format.max(),
            head,
            barrel,
            simple,
            narrow,
            deep,
            right: places.clamp(0, 62) as u32,
        }
    }

    /// The word for one exact result.
    #[inline(always)]
    pub fn one(&self, exact: i64) -> i64 {
        if !self.simple {
            return self.one_shifted(exact, 0);
        }
        (exact.wrapping_add(self.half) >> self.right)
            .max(self.min)
            .min(self.max)
    }

    /// The constant added before the right shift.
    pub fn half(&self) -> i64 {
        self.half
    }

    /// Least and greatest word.
    #[inline(always)]
    pub fn limits(&self) -> [i64; 2] {
        [self.min, self.max]
    }

    /// Right shift of an exact result.
    pub fn places(&self) -> i64 {
        self.places
    }

    /// Whether the fit is an addition, a shift and two limits.
    pub fn is_simple(&self) -> bool {
        self.simple
    }

    /// Whether the right shift is at least 32, after which every exact result is a word of 32 bits
    /// ([`Fit::top`]).
    pub fn is_deep(&self) -> bool {
        self.deep
    }

    /// Whether an addition, a shift and one limit of 32 bits suffice for results from 0 to
    /// 2^`int_bits`.
    pub fn is_natural(&self, int_bits: i32) -> bool {
        self.simple && !self.word.format.signed && int_bits + self.word.format.frac_bits < 32
    }

    /// The word for one exact result with `more` fraction bits than elaborated.
    #[inline(always)]
    pub fn one_shifted(&self, exact: i64, more: i64) -> i64 {
        let places = self.places + more;
        if places < 0 {
            let left = (-places).min(63) as u32;
            let exact = self.cut(exact, places);
            let shifted = exact << left;
            return if shifted >> left == exact {
                self.limit(shifted)
            } else {
                self.limit_wide(i128::from(exact) << left)
            };
        }
        self.limit(self.cut(exact, places))
    }

    /// The words for eight exact results.
    #[inline(always)]
    pub fn lanes<L: Lanes>(&self, exact: L) -> L {
        if !self.simple {
            return L::from_array(one_by_one(*self, exact.to_array(), [0; LANES]));
        }
        self.limit_lanes((exact + L::splat(self.half)).right(self.right))
    }

    /// The words for eight exact results before they are wrapped into a register.
    #[inline(always)]
    pub fn lanes_register<L: Lanes>(&self, exact: L) -> L {
        if !self.is_register() {
            return L::from_array(one_by_one(*self, exact.to_array(), [0; LANES]));
        }
        (exact + L::splat(self.half)).right(self.right)
    }

    /// Whether the fit is an addition, a shift and a register that wraps.
    #[inline(always)]
    pub fn is_register(&self) -> bool {
        (0..=62).contains(&self.places)
            && self.word.round != Rounding::NearestEven
            && self.word.overflow == Overflow::Wrap
            && !self.word.format.is_float()
    }

    /// The words for eight exact results ≥ 0, as unsigned words. `SIMPLE_FITS` promises
    /// [`Fit::is_natural`], so that it is not tested.
    #[inline(always)]
    pub fn lanes_unsigned<const SIMPLE_FITS: bool, L: Lanes>(&self, exact: L) -> L {
        if SIMPLE_FITS {
            return (exact + L::splat(self.half))
                .right_unsigned(self.right)
                .min_of_halves(L::splat(self.max));
        }
        if !self.simple {
            return L::from_array(one_by_one(*self, exact.to_array(), [0; LANES]));
        }
        (exact + L::splat(self.half))
            .right_unsigned(self.right)
            .min(L::splat(self.max))
    }

    /// [`Fit::lanes_unsigned`] for a word that represents every result.
    #[inline(always)]
    pub fn lanes_within<const SIMPLE_FITS: bool, L: Lanes>(&self, exact: L) -> L {
        if !SIMPLE_FITS && !self.simple {
            return L::from_array(one_by_one(*self, exact.to_array(), [0; LANES]));
        }
        (exact + L::splat(self.half)).right_unsigned(self.right)
    }

    /// [`Fit::lanes_unsigned`] of words of 31 bits that do not overflow when rounded, for a simple
    /// word of 31 bits.
    #[inline(always)]
    pub fn natural<W: Words>(&self) -> Natural<W> {
        Natural {
            half: W::splat(self.half),
            right: self.right,
            max: W::splat(self.max),
        }
    }

    /// [`Fit::words`] with its constants on all lanes; none if it takes the slow path.
    #[inline(always)]
    pub fn narrow<W: Words>(&self) -> Option<Narrow<W>> {
        if !self.narrow {
            return None;
        }
        let (half, places) = (W::Exact::splat(self.half), self.places as u32);
        Some(Narrow {
            half,
            places,
            min: W::splat(self.min),
            max: W::splat(self.max),
        })
    }

    #[inline(always)]
    fn limit_lanes<L: Lanes>(&self, words: L) -> L {
        words.max(L::splat(self.min)).min(L::splat(self.max))
    }

    /// The words, of at most 32 bits, for eight exact results.
    #[inline(always)]
    pub fn words<X: Exacts>(&self, exact: X) -> X::Words {
        if !self.narrow {
            cold_path();
            return self.wide(exact).low();
        }
        self.limit_words(exact, (exact + X::splat(self.half)).cut(self.places as u32))
    }

    /// The words, of at most 32 bits, for eight exact results that a normaliser has shifted to the
    /// top of their 62 bits.
    #[inline(always)]
    pub fn top<X: Exacts>(&self, exact: X) -> X::Words {
        if !self.deep {
            cold_path();
            return self.wide(exact).low();
        }
        self.limit_words(
            exact,
            (exact + X::splat(self.half)).cut_deep(self.places as u32),
        )
    }

    #[inline(always)]
    fn limit_words<X: Exacts>(&self, exact: X, cut: X::Words) -> X::Words {
        let words = cut
            .max(X::Words::splat(self.min))
            .min(X::Words::splat(self.max));
        debug_assert_eq!(
            words.exact().to_array(),
            self.wide(exact).to_array(),
            "{exact:?} does not have the elaborated shape"
        );
        words
    }

    /// The words for eight exact results, which can have more than 32 bits.
    #[inline(always)]
    pub fn wide<X: Exacts>(&self, exact: X) -> X {
        if !self.simple {
            cold_path();
            return X::from_array(one_by_one(*self, exact.to_array(), [0; LANES]));
        }
        (exact + X::splat(self.half))
            .right(self.places as u32)
            .max(X::splat(self.min))
            .min(X::splat(self.max))
    }

    /// The words, of at most 32 bits, for eight exact results, each with `more` fraction bits than
    /// elaborated.
    #[inline(always)]
    pub fn words_shifted<X: Exacts>(&self, exact: X, more: X::Words) -> X::Words {
        match exact
            .left(self.head)
            .cut_by(more + X::Words::splat(self.barrel))
        {
            Some(cut) => {
                let round = X::Words::splat(i64::from(self.word.round == Rounding::Nearest));
                (cut + round)
                    .right(1)
                    .max(X::Words::splat(self.min))
                    .min(X::Words::splat(self.max))
            }
            None => {
                cold_path();
                X::from_array(one_by_one(*self, exact.to_array(), more.exact().to_array())).low()
            }
        }
    }

    /// [`Fit::lanes`], and the lanes that a limit changed; none if it takes the slow path.
    /// `UNSIGNED` promises that no result and no word is negative.
    #[inline(always)]
    pub fn lanes_limited<const UNSIGNED: bool, L: Lanes>(&self, exact: L) -> Option<(L, u8)> {
        if !self.simple {
            return None;
        }
        let rounded = exact + L::splat(self.half);
        let (cut, words) = if UNSIGNED {
            let cut = rounded.right_unsigned(self.right);
            (cut, cut.min(L::splat(self.max)))
        } else {
            let cut = rounded.right(self.right);
            (cut, self.limit_lanes(cut))
        };
        let limited = cut.above(words);
        let limited = if UNSIGNED {
            limited
        } else {
            limited | words.above(cut)
        };
        Some((words, limited.signs()))
    }

    /// [`Fit::words`], and the lanes that a limit changed; none if it takes the slow path.
    #[inline(always)]
    pub fn words_limited<X: Exacts>(&self, exact: X) -> Option<LimitedWords<X::Words>> {
        if !(self.narrow && self.is_short()) {
            return None;
        }
        Some(self.limit_reported((exact + X::splat(self.half)).cut(self.places as u32)))
    }

    /// [`Fit::top`], and the lanes that a limit changed; none if it takes the slow path.
    #[inline(always)]
    pub fn top_limited<X: Exacts>(&self, exact: X) -> Option<LimitedWords<X::Words>> {
        if !(self.deep && self.is_short()) {
            return None;
        }
        Some(self.limit_reported((exact + X::splat(self.half)).cut_deep(self.places as u32)))
    }

    /// [`Fit::wide`], and the lanes that a limit changed; none if it takes the slow path.
    #[inline(always)]
    pub fn wide_limited<X: Exacts>(&self, exact: X) -> Option<(X, u8)> {
        if !self.simple {
            return None;
        }
        let cut = (exact + X::splat(self.half)).right(self.places as u32);
        let words = cut.max(X::splat(self.min)).min(X::splat(self.max));
        Some((words, (cut.above(words) | words.above(cut)).signs()))
    }

    /// [`Fit::words_shifted`], and the lanes that a limit changed; none if it takes the slow path.
    #[inline(always)]
    pub fn shifted_limited<X: Exacts>(
        &self,
        exact: X,
        more: X::Words,
    ) -> Option<LimitedWords<X::Words>> {
        if !self.is_short() {
            return None;
        }
        let cut = exact
            .left(self.head)
            .cut_by(more + X::Words::splat(self.barrel))?;
        let round = X::Words::splat(i64::from(self.word.round == Rounding::Nearest));
        Some(self.limit_reported((cut + round).right(1)))
    }

    #[inline(always)]
    fn limit_reported<W: Words>(&self, cut: W) -> LimitedWords<W> {
        let words = cut.max(W::splat(self.min)).min(W::splat(self.max));
        LimitedWords {
            words,
            limited: !(cut - words).is_zero().signs(),
        }
    }

    /// [`Fit::one`]; none if a limit changes it.
    #[inline(always)]
    pub fn one_within(&self, exact: i64) -> Option<i64> {
        if !self.simple {
            return self.one_shifted_within(exact, 0);
        }
        let cut = exact.wrapping_add(self.half) >> self.right;
        (cut == cut.max(self.min).min(self.max)).then_some(cut)
    }

    /// [`Fit::one`] for three results; none if a limit changes one of them.
    #[inline(always)]
    pub fn three_within(&self, exact: [i64; 3]) -> Option<[i64; 3]> {
        if !self.simple {
            return self.three_shifted_within(exact, 0);
        }
        let cut = three!(i => exact[i].wrapping_add(self.half) >> self.right);
        self.is_range(cut).then_some(cut)
    }

    /// [`Fit::one_shifted`] for three results; none if a limit changes one of them.
    #[inline(always)]
    pub fn three_shifted_within(&self, exact: [i64; 3], more: i64) -> Option<[i64; 3]> {
        let places = self.places + more;
        let (words, is_held) = if places >= 0 {
            (three!(i => self.cut(exact[i], places)), true)
        } else {
            let left = (-places).min(63);
            let exact = three!(i => self.cut(exact[i], places));
            let words = three!(i => exact[i] << left);
            (words, three!(i => words[i] >> left) == exact)
        };
        (is_held && self.is_range(words)).then_some(words)
    }

    /// Whether the format represents all three values.
    #[inline(always)]
    fn is_range(&self, [a, b, c]: [i64; 3]) -> bool {
        a.min(b).min(c) >= self.min && a.max(b).max(c) <= self.max
    }

    /// [`Fit::one_shifted`]; none if a limit changes it.
    #[inline(always)]
    pub fn one_shifted_within(&self, exact: i64, more: i64) -> Option<i64> {
        let places = self.places + more;
        let (word, is_held) = if places >= 0 {
            (self.cut(exact, places), true)
        } else {
            let left = (-places).min(63);
            let exact = self.cut(exact, places);
            (exact << left, exact << left >> left == exact)
        };
        (is_held && word == word.max(self.min).min(self.max)).then_some(word)
    }

    /// Whether no limit changed a result that became `word`.
    #[inline(always)]
    pub fn is_within(&self, exact: i64, more: i64, word: i64) -> bool {
        // A limited word equals a limit.
        if self.word.overflow == Overflow::Saturate && word != self.min && word != self.max {
            return true;
        }
        if self.word.format.is_float() {
            return self.one_shifted_within(exact, more).is_some();
        }
        let places = self.places + more;
        let left = (-places).clamp(0, 63) as u32;
        // The word is a result shifted to the right or to the left. One that a limit changed,
        // shifted back, differs from the result or loses bits.
        self.cut(exact, places) == word >> left && word.trailing_zeros() >= left
    }

    /// Simple, and its words have at most 31 bits, so that [`LimitedWords`] can hold them.
    #[inline(always)]
    pub fn is_short(&self) -> bool {
        self.simple && self.word.format.width() < 32
    }

    /// Whether a result loses bits below the word's LSB.
    #[inline(always)]
    pub fn is_inexact(&self, exact: i64, more: i64) -> bool {
        let places = self.places + more;
        let right = places.clamp(0, 63) as u32;
        exact.trailing_zeros() < self.right_of(exact, right)
            || self.word.format.flushes && exact != 0 && self.cut(exact, places) == 0
    }

    /// A result rounded to the word's LSB, before its limits, saturated to 64 bits.
    pub fn before_limits(&self, exact: i64, more: i64) -> i64 {
        self.rounded(exact, more)
            .clamp(i64::MIN.into(), i64::MAX.into()) as i64
    }

    fn rounded(&self, exact: i64, more: i64) -> i128 {
        let places = self.places + more;
        if places < 0 {
            i128::from(self.cut(exact, places)) << (-places).min(63)
        } else {
            i128::from(self.cut(exact, places))
        }
    }

    /// Losses when `exact`, with `more` fraction bits than elaborated, becomes a word.
    pub fn loss(&self, exact: i64, more: i64) -> Loss {
        let rounded = self.rounded(exact, more);
        let inexact = self.is_inexact(exact, more);
        let (below, above) = (
            rounded < i128::from(self.min),
            rounded > i128::from(self.max),
        );
        let wrap = self.word.overflow == Overflow::Wrap;
        Loss {
            inexact,
            saturated_low: below && !wrap,
            saturated_high: above && !wrap,
            wrapped: (below || above) && wrap,
        }
    }

    /// Bits that are dropped from a result whose shift to the word's LSB is `right`.
    #[inline(always)]
    fn right_of(&self, v: i64, right: u32) -> u32 {
        match self.word.format.significant_bits {
            0 => right,
            bits => significant_shift(v.unsigned_abs().into(), bits, right),
        }
    }

    /// A result shifted to the right by `places`, in ulp; not yet shifted to the left where `places`
    /// is negative. A floating-point word rounds its magnitude, to an ulp that depends on it.
    #[inline(always)]
    fn cut(&self, v: i64, places: i64) -> i64 {
        if self.word.format.is_float() {
            cold_path();
            return self.cut_float(v.into(), places) as i64;
        }
        let right = places.clamp(0, 63) as u32;
        let round = match self.word.round {
            Rounding::Truncate => 0,
            Rounding::Nearest => half(right),
            Rounding::NearestEven if right == 0 => 0,
            Rounding::NearestEven => half(right) - 1 + ((v >> right) & 1),
        };
        v.wrapping_add(round) >> right
    }

    #[inline(never)]
    fn cut_float(&self, v: i128, places: i64) -> i128 {
        let [right, left] = [places, -places].map(|places| places.clamp(0, 63) as u32);
        let magnitude = v.unsigned_abs();
        let dropped = significant_shift(magnitude, self.word.format.significant_bits, right);
        let kept = magnitude >> dropped;
        let half = 1u128 << dropped >> 1;
        let round = match self.word.round {
            Rounding::Truncate => 0,
            Rounding::Nearest => half,
            Rounding::NearestEven if dropped == 0 => 0,
            Rounding::NearestEven => half - 1 + (kept & 1),
        };
        let word = ((magnitude + round) >> dropped << (dropped - right)) as i128;
        if word << left < i128::from(self.word.format.least_magnitude()) {
            return 0;
        }
        if v < 0 { -word } else { word }
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
        if self.word.format.signed {
            top >> unused
        } else {
            ((top as u64) >> unused) as i64
        }
    }
}

/// The slow path: every rounding, every overflow, left shifts. It takes a copy of the fit: after a
/// reference escapes, the compiler would reload its constants in each iteration.
#[cold]
#[inline(never)]
fn one_by_one(fit: Fit, mut exact: [i64; LANES], more: [i64; LANES]) -> [i64; LANES] {
    for (exact, more) in exact.iter_mut().zip(more) {
        *exact = fit.one_shifted(*exact, more);
    }
    exact
}

/// Half an ulp after a right shift. A shift of 63 leaves only the sign of the 62 bits.
#[inline(always)]
fn half(right: u32) -> i64 {
    ((1u64 << right) >> 1) as i64
}

#[cfg(test)]
mod tests;

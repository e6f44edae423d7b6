//! Real: the machine's steps over real numbers, so that the loss of each step can be bounded, or
//! made on purpose.
//!
//! ```text
//! exact scene ─► [ the same unit, over the reals ] ─► the exact result, and a bound of the machine's error
//! ```
//! A unit's `real.rs` follows its diagram with a [`Real`] on every wire. [`Near`] carries a value
//! and an error bound. The bounds of a sum are added; those of a product are scaled by the other
//! factor; the one lossy operation adds the loss of its format. So a unit's error bound is a
//! function of its formats, derived step by step from the machine's own diagram. It also holds if
//! something saturates on the way: a limit only shortens the interval.
//!
//! [`MixedPrecision`] makes only some of the losses, and makes them like the machine: it
//! attributes an error to its causes.
//!
//! This is not hardware, and units do not depend on it. Only files called `real.rs`, and the files
//! of this folder, use floats in this crate.
//!
//! Laws: `near_holds_every_outcome`, `a_fit_is_within_its_bound`, `a_share_is_within_its_bound`,
//! `a_power_is_within_its_bound`.

pub mod frame;
mod mixed_precision;

pub use crate::num::real::{floor_log2, normal_power_of_two, power_of_two};
pub use mixed_precision::{MixedPrecision, Switches};

use crate::frame::Scaled;
use crate::functions::map::real::RealMap;
use crate::functions::table::real::Power;
use crate::functions::{Reciprocal, ReciprocalRoot, Table};
use crate::num::{Fit, Overflow, Word};
use std::array;
use std::cmp::Ordering;
use std::f64::consts::SQRT_2;
use std::ops::{Add, Mul, Neg, Sub};

/// Least and greatest power of two to which a word can be relative:
/// `value = word · 2^(exponent − frac_bits)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scale {
    /// Least exponent.
    pub low: i32,
    /// Greatest exponent.
    pub high: i32,
}

impl Scale {
    /// The scale of a word that is not relative to a power of two.
    pub const ONE: Scale = Scale { low: 0, high: 0 };

    /// The scale of a product of two words.
    pub fn times(self, other: Scale) -> Scale {
        Scale {
            low: self.low + other.low,
            high: self.high + other.high,
        }
    }

    /// The scale of a reciprocal.
    pub fn inverse(self) -> Scale {
        Scale {
            low: -self.high,
            high: -self.low,
        }
    }

    /// The scale of an n-th power.
    pub fn power(self, n: i32) -> Scale {
        Scale {
            low: self.low * n,
            high: self.high * n,
        }
    }

    /// The scale times 2^`places`.
    pub fn shifted(self, places: i32) -> Scale {
        Scale {
            low: self.low + places,
            high: self.high + places,
        }
    }
}

/// A vector of length 1, on three wires.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction<R> {
    /// Its components, each with its own loss.
    pub parts: [R; 3],
    /// Sine of the greatest rotation of the machine's vector before these losses; 1 or more if it
    /// can have any direction.
    pub turn: f64,
}

impl<R: Real> Direction<R> {
    /// Quantises each component.
    pub fn fit(self, fit: &Fit) -> Self {
        Direction {
            parts: self.parts.map(|part| part.fit(fit, Scale::ONE)),
            ..self
        }
    }

    /// The opposite direction.
    pub fn turned_back(self) -> Self {
        Direction {
            parts: self.parts.map(R::neg),
            ..self
        }
    }
}

/// A number on a wire, with an exact side and a machine side.
pub trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// A constant that is exact on both sides.
    fn constant(value: f64) -> Self;
    /// A number that is exact on both sides, for the same machine as `self`.
    fn constant_like(self, value: f64) -> Self;
    /// The sum with a constant that is exact on both sides.
    fn plus(self, constant: f64) -> Self;
    /// The product with a constant that is exact on both sides.
    fn times(self, constant: f64) -> Self;
    /// Quantises the machine side; the exact side is unchanged.
    fn fit(self, fit: &Fit, scale: Scale) -> Self;
    /// Quantises items to the same word, each with its own scale.
    fn fit_each<const N: usize>(items: &[Self; N], fit: &Fit, scales: &[Scale; N]) -> [Self; N] {
        array::from_fn(|item| items[item].fit(fit, scales[item]))
    }
    /// Quantises the machine side, which has `frac_bits` fraction bits, without a shift. It loses
    /// nothing if the word has as many fraction bits.
    fn refit(self, frac_bits: i32, fit: &Fit) -> Self;
    /// The quotient on each side, exact: the operand of [`Real::share`] and [`Real::restored`].
    fn divided_by(self, whole: Self) -> Self;
    /// Quantises a share of `whole` to a word that saturates. The machine side is scaled by the
    /// power of two that brings `whole` to [1, 2).
    fn share(self, fit: &Fit, whole: Self) -> Self;
    /// Multiplies a share by `whole` and by the function unit's 1/`whole`.
    fn restored(self, unit: &Reciprocal, whole: Self) -> Self;
    /// The power of two at or below the magnitude of the machine side, as in a normaliser.
    fn leading(self) -> Scale;
    /// Magnitude.
    fn abs(self) -> Self;
    /// The greater number, on each side.
    fn max(self, other: Self) -> Self;
    /// The smaller number, on each side.
    fn min(self, other: Self) -> Self;
    /// Limits the machine side from below; the exact side has no limit.
    fn at_least(self, limit: f64) -> Self;
    /// Limits the machine side from above; the exact side has no limit.
    fn at_most(self, limit: f64) -> Self;
    /// Limits the machine side to one ulp below 1; the exact side has no limit.
    fn below_one(self, fit: &Fit) -> Self;
    /// Limits the machine side to at least one ulp of its word; the exact side has no limit.
    fn at_least_an_ulp(self, fit: &Fit, scale: Scale) -> Self;
    /// Adds one ulp of its word to the machine side.
    fn an_ulp_more(self, fit: &Fit) -> Self;
    /// Selects one of two continuations, by whether this number is at least the limit. Each side
    /// decides separately.
    fn branch<const N: usize>(
        self,
        limit: Self,
        at_least: impl FnOnce() -> [Self; N],
        below: impl FnOnce() -> [Self; N],
    ) -> [Self; N];
    /// 1/x of a positive number, by a function unit.
    fn reciprocal(self, unit: &Reciprocal) -> Self;
    /// 1/√x of a positive number, by a function unit.
    fn inverse_root(self, unit: &ReciprocalRoot) -> Self;
    /// √x of a number that is not negative, by a function unit.
    fn root(self, unit: &ReciprocalRoot) -> Self;
    /// The magnitude with the sign of another number, on each side.
    fn with_sign_of(self, other: Self) -> Self;
    /// A monotone function over [0, `range`), which the machine reads from a table. `error` is the
    /// greatest error of the table from an argument on, before the fit.
    fn table(
        self,
        table: &Table,
        range: f64,
        exact: impl Fn(f64) -> f64,
        error: impl Fn(f64) -> f64,
    ) -> Self;
    /// e^(−x/2), or 1 below 0, which the machine reads from a table over [0, `range`) with an error
    /// up to `error` before the fit.
    fn falloff(self, table: &Table, range: f64, error: f64) -> Self;
    /// x^exponent of a number from 0 to 1, by a table.
    fn power(self, table: &Power) -> Self;
    /// Light at a point of a map, whose coordinates go from 0 to 1.
    fn look_up(place: [Self; 2], map: &RealMap) -> [Self; 3];
    /// |v|.
    fn length(v: [Self; 3]) -> Self;
    /// v/|v| for shares of `whole` ([`Real::share`]), by a function unit for 1/√x; meaningless for
    /// 0.
    fn direction(v: [Self; 3], whole: Self, unit: &ReciprocalRoot) -> Direction<Self>;
    /// Σ dᵢ·vᵢ.
    fn dot(direction: &Direction<Self>, v: [Self; 3]) -> Self;
}

/// A number of the exact pipeline, and a bound of the machine's error.
///
/// The value can have rounding errors of f64; each step adds them to the bound.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Near {
    /// The exact number.
    pub value: f64,
    /// Greatest difference of the machine's number: never negative, never NaN, can be infinite.
    pub error: f64,
}

/// Relative error of one operation in f64, doubled to include the arithmetic of the bound.
const ROUNDING: f64 = f64::EPSILON;

impl Near {
    /// A number that is exact in the machine.
    pub const fn exact(value: f64) -> Self {
        Near { value, error: 0.0 }
    }

    /// A number, and its word in the machine.
    pub fn held(value: f64, word: Word, held: i64) -> Self {
        Near::within(value, word.format.value(held) - value)
    }

    /// A positive number, and the mantissa and power of two that represent it in the machine.
    pub fn held_scaled(value: f64, word: Word, held: Scaled) -> Self {
        Near::within(
            value,
            word.format.value(held.mantissa) * power_of_two(-held.places as i32) - value,
        )
    }

    /// A number, with a machine side that differs by at most |`error`|.
    #[inline]
    pub fn within(value: f64, error: f64) -> Self {
        Near {
            value,
            error: if error.is_nan() {
                f64::INFINITY
            } else {
                error.abs() * (1.0 + 2.0 * ROUNDING) + value.abs() * ROUNDING
            },
        }
    }

    /// A number, with a machine side in [low, high].
    #[inline]
    fn between(value: f64, low: f64, high: f64) -> Self {
        Near::within(value, (high - value).max(value - low).max(0.0))
    }

    /// The least value of the machine side.
    #[inline]
    pub fn low(self) -> f64 {
        self.value - self.error
    }

    /// The greatest value of the machine side.
    #[inline]
    pub fn high(self) -> f64 {
        self.value + self.error
    }

    /// The greatest magnitude on either side.
    #[inline]
    pub fn most(self) -> f64 {
        self.value.abs() + self.error
    }

    /// The same bound around a number that was computed elsewhere.
    #[inline]
    pub fn around(self, value: f64) -> Self {
        Near::within(value, self.error + (self.value - value).abs())
    }

    /// This number, with a machine side that can also be the other's.
    fn or(self, other: Near) -> Self {
        Near::between(
            self.value,
            self.low().min(other.low()),
            self.high().max(other.high()),
        )
    }

    /// Quantises the machine side to a word with an ulp of `fine` to `coarse`, which loses `down`
    /// and gains `up` ulp.
    ///
    /// Then applies the limits. A word that wraps and can be out of range can have any value.
    #[inline(always)]
    fn in_word(self, word: Word, [fine, coarse]: [f64; 2], [down, up]: [f64; 2]) -> Near {
        let (low, high) = (self.low() - down * coarse, self.high() + up * coarse);
        let ends = [word.format.min() as f64, word.format.max() as f64];
        let (result, is_away) = self.away_from(ends, [fine, coarse], [down, up]);
        if is_away {
            return result;
        }
        self.at_limits(word, [low, high], ends, [fine, coarse])
    }

    /// [`Near::in_word`] away from the limits of the word, and whether it is there: then NaN cannot
    /// occur. Without a branch.
    #[inline(always)]
    fn away_from(
        self,
        [least, most]: [f64; 2],
        [fine, coarse]: [f64; 2],
        [down, up]: [f64; 2],
    ) -> (Near, bool) {
        let (low, high) = (self.low() - down * coarse, self.high() + up * coarse);
        (
            Near::within(self.value, self.error + down.max(up) * coarse),
            (least * fine <= low) & (high <= most * fine),
        )
    }

    /// [`Near::in_word`] for floating point, whose ulp is that of the greatest magnitude, but at
    /// least the format's. A magnitude that is relative to a number in [1, 2) can be in the binade
    /// above.
    #[cold]
    fn in_float(self, word: Word, [fine, coarse]: [f64; 2]) -> Near {
        let format = word.format;
        let binade = if fine == coarse {
            power_of_two(floor_log2(self.most()))
        } else {
            self.most()
        };
        let ulp = coarse.max(binade * power_of_two(1 - format.significant_bits));
        // Results below the least normal number can be flushed to zero.
        let least = format.least_magnitude() as f64 * coarse;
        let is_flushed = format.flushes && self.low().max(-self.high()) < least;
        let flushed = if is_flushed { least } else { 0.0 };
        let [down, up] = word.loss().map(|ulps| flushed.max(ulps * ulp));
        let (low, high) = (self.low() - down, self.high() + up);
        let ends = [format.min() as f64, format.max() as f64];
        self.at_limits(word, [low, high], ends, [fine, coarse])
    }

    /// [`Near::in_word`] for machine sides from `low` to `high` before the limits.
    #[cold]
    fn at_limits(
        self,
        word: Word,
        [low, high]: [f64; 2],
        [least, most]: [f64; 2],
        [fine, coarse]: [f64; 2],
    ) -> Near {
        if word.overflow == Overflow::Wrap {
            return Near {
                error: f64::INFINITY,
                ..self
            };
        }
        Near::between(
            self.value,
            low.max(least * coarse).min(most * fine),
            high.min(most * coarse).max(least * fine),
        )
    }

    /// Widens the bound by `error`.
    pub(crate) fn off_by(self, error: f64) -> Near {
        Near::within(self.value, self.error + error)
    }

    /// A monotone function, which the machine computes with an error up to `error`.
    #[cold]
    #[inline(never)]
    fn function(self, exact: impl Fn(f64) -> f64, error: f64) -> Near {
        let (a, b) = (exact(self.low()), exact(self.high()));
        Near::between(exact(self.value), a.min(b) - error, a.max(b) + error)
    }

    /// e^(−x/2), or 1 below 0, which the machine computes with an error up to `error`. At x − d it
    /// is e^(d/2) times its value at x.
    #[inline]
    fn falling(self, error: f64) -> Near {
        self.growing(falloff, self.error / 2.0, error)
    }

    /// A monotone function, which the machine computes with an error up to `error`, and which
    /// changes by at most itself times e^`growth` − 1 within the bound.
    ///
    /// e^y − 1 ≤ y/(1 − y/2) if y < 2, which is faster than two evaluations of the function.
    #[inline]
    fn growing(self, exact: impl Fn(f64) -> f64, growth: f64, error: f64) -> Near {
        if growth < 0.5 && self.value.is_finite() {
            let value = exact(self.value);
            return Near::within(value, value * growth / (1.0 - growth / 2.0) + error);
        }
        self.function(exact, error)
    }

    /// Whether both sides can be on different sides of a limit.
    #[inline]
    pub fn may_cross(self, limit: Near) -> bool {
        // An infinite bound can cross any limit, also if the difference is NaN.
        (self.value - limit.value)
            .abs()
            .partial_cmp(&(self.error + limit.error))
            != Some(Ordering::Greater)
    }
}

impl Add for Near {
    type Output = Near;
    #[inline]
    fn add(self, other: Near) -> Near {
        Near::within(self.value + other.value, self.error + other.error)
    }
}

impl Sub for Near {
    type Output = Near;
    #[inline]
    fn sub(self, other: Near) -> Near {
        self + -other
    }
}

impl Neg for Near {
    type Output = Near;
    #[inline]
    fn neg(self) -> Near {
        Near {
            value: -self.value,
            ..self
        }
    }
}

impl Mul for Near {
    type Output = Near;
    #[inline]
    fn mul(self, other: Near) -> Near {
        let error = self.value.abs() * other.error + self.error * (other.value.abs() + other.error);
        Near::within(self.value * other.value, error)
    }
}

impl Real for Near {
    #[inline]
    fn constant(value: f64) -> Near {
        Near::exact(value)
    }

    #[inline]
    fn constant_like(self, value: f64) -> Near {
        Near::exact(value)
    }

    #[inline]
    fn plus(self, constant: f64) -> Near {
        self + Near::exact(constant)
    }

    #[inline]
    fn times(self, constant: f64) -> Near {
        self * Near::exact(constant)
    }

    #[inline(always)]
    fn fit(self, fit: &Fit, scale: Scale) -> Near {
        let places = [scale.low, scale.high]
            .map(|exponent| power_of_two(exponent - fit.word.format.frac_bits));
        if fit.word.format.is_float() {
            return self.in_float(fit.word, places);
        }
        self.in_word(fit.word, places, fit.word.loss())
    }

    /// In the common case, in which all items are away from the limits, without a branch per item.
    #[inline(always)]
    fn fit_each<const N: usize>(items: &[Near; N], fit: &Fit, scales: &[Scale; N]) -> [Near; N] {
        let Word { format, .. } = fit.word;
        let ends = [format.min() as f64, format.max() as f64];
        let (mut results, mut is_common) = (*items, !format.is_float());
        for (result, scale) in results.iter_mut().zip(scales) {
            let [low, high] = [scale.low, scale.high].map(|exponent| exponent - format.frac_bits);
            let places = [low, high].map(normal_power_of_two);
            let (fitted, is_away) = result.away_from(ends, places, fit.word.loss());
            is_common &= is_away & (low >= -1022) & (high <= 1023);
            *result = fitted;
        }
        if is_common {
            return results;
        }
        array::from_fn(|item| items[item].fit(fit, scales[item]))
    }

    #[inline]
    fn refit(self, frac_bits: i32, fit: &Fit) -> Near {
        let format = fit.word.format;
        let place = power_of_two(-format.frac_bits);
        if format.is_float() {
            return self.in_float(fit.word, [place; 2]);
        }
        let loss = if frac_bits <= format.frac_bits {
            [0.0; 2]
        } else {
            fit.word.loss()
        };
        self.in_word(fit.word, [place; 2], loss)
    }

    #[inline]
    fn divided_by(self, whole: Near) -> Near {
        let value = if whole.value == 0.0 {
            0.0
        } else {
            self.value / whole.value
        };
        if whole.low() <= 0.0 {
            return Near {
                value,
                error: f64::INFINITY,
            };
        }
        let ends = [self.low(), self.high()].map(|end| [end / whole.low(), end / whole.high()]);
        let [least, most] = ends
            .as_flattened()
            .iter()
            .fold([value; 2], |[least, most], end| {
                [least.min(*end), most.max(*end)]
            });
        Near::between(value, least, most)
    }

    /// The word holds x·w, where w is the whole in [1, 2): its ulp counts 1/w. A share with at most
    /// the fraction bits of the word loses nothing.
    fn share(self, fit: &Fit, whole: Near) -> Near {
        let Scale { low, high } = whole.leading();
        let [least, most] = if low == high {
            [whole.low(), whole.high()].map(|end| end * power_of_two(-low))
        } else {
            [1.0, 2.0]
        };
        let place = power_of_two(-fit.word.format.frac_bits);
        if fit.word.format.is_float() {
            return self.in_float(fit.word, [place / most, place / least]);
        }
        let loss = if fit.places() + i64::from(high) <= 0 {
            [0.0; 2]
        } else {
            fit.word.loss()
        };
        self.in_word(fit.word, [place / most, place / least], loss)
    }

    fn restored(self, unit: &Reciprocal, _whole: Near) -> Near {
        self * Near {
            value: 1.0,
            error: unit.relative_error(),
        }
    }

    #[inline]
    fn leading(self) -> Scale {
        let least = (self.value.abs() - self.error).max(0.0);
        Scale {
            low: floor_log2(least),
            high: floor_log2(self.most()),
        }
    }

    #[inline]
    fn abs(self) -> Near {
        Near {
            value: self.value.abs(),
            ..self
        }
    }

    #[inline]
    fn max(self, other: Near) -> Near {
        Near::between(
            self.value.max(other.value),
            self.low().max(other.low()),
            self.high().max(other.high()),
        )
    }

    #[inline]
    fn min(self, other: Near) -> Near {
        Near::between(
            self.value.min(other.value),
            self.low().min(other.low()),
            self.high().min(other.high()),
        )
    }

    #[inline]
    fn at_least(self, limit: f64) -> Near {
        Near::between(self.value, self.low().max(limit), self.high().max(limit))
    }

    #[inline]
    fn at_most(self, limit: f64) -> Near {
        Near::between(self.value, self.low().min(limit), self.high().min(limit))
    }

    fn below_one(self, fit: &Fit) -> Near {
        self.at_most(1.0 - power_of_two(-fit.word.format.frac_bits))
    }

    #[inline]
    fn at_least_an_ulp(self, fit: &Fit, scale: Scale) -> Near {
        self.at_least(power_of_two(scale.low - fit.word.format.frac_bits))
    }

    #[inline]
    fn an_ulp_more(self, fit: &Fit) -> Near {
        self.off_by(power_of_two(-fit.word.format.frac_bits))
    }

    fn branch<const N: usize>(
        self,
        limit: Near,
        at_least: impl FnOnce() -> [Near; N],
        below: impl FnOnce() -> [Near; N],
    ) -> [Near; N] {
        let (above, doubt) = (self.value - limit.value, self.error + limit.error);
        if above >= doubt {
            return at_least();
        }
        if above < -doubt {
            return below();
        }
        let (taken, other) = if above >= 0.0 {
            (at_least(), below())
        } else {
            (below(), at_least())
        };
        array::from_fn(|i| taken[i].or(other[i]))
    }

    #[inline]
    fn reciprocal(self, unit: &Reciprocal) -> Near {
        let error = unit.relative_error();
        inverse(self, |x| 1.0 / x, error)
    }

    #[inline]
    fn inverse_root(self, unit: &ReciprocalRoot) -> Near {
        let error = unit.relative_error();
        inverse(self, |x| 1.0 / x.sqrt(), error)
    }

    #[inline]
    fn root(self, unit: &ReciprocalRoot) -> Near {
        let error = unit.relative_error();
        Near::between(
            self.value.sqrt(),
            (1.0 - error) * self.low().max(0.0).sqrt(),
            (1.0 + error) * self.high().sqrt(),
        )
    }

    #[inline]
    fn with_sign_of(self, other: Near) -> Near {
        let value = self.value.abs().copysign(other.value);
        if other.low() < 0.0 && other.high() >= 0.0 {
            return Near::between(value, -self.most(), self.most());
        }
        Near {
            value,
            error: self.error,
        }
    }

    fn table(
        self,
        _table: &Table,
        _range: f64,
        exact: impl Fn(f64) -> f64,
        error: impl Fn(f64) -> f64,
    ) -> Near {
        self.function(exact, error(self.low()))
    }

    #[inline]
    fn falloff(self, _table: &Table, _range: f64, error: f64) -> Near {
        self.falling(error)
    }

    fn power(self, table: &Power) -> Near {
        self.growing(
            |x| table.exact(x),
            table.growth(self.value, self.error),
            table.error(self.low(), self.high()),
        )
    }

    fn look_up(place: [Near; 2], map: &RealMap) -> [Near; 3] {
        let at = place.map(|place| place.value);
        let (exact, error) = (
            map.exact(at),
            map.error(at, place.map(Near::low), place.map(Near::high)),
        );
        array::from_fn(|i| Near::within(exact[i], error[i]))
    }

    /// Vectors that differ by d differ in length by at most |d|.
    fn length(v: [Near; 3]) -> Near {
        Near::within(
            norm(v.map(|part| part.value)),
            norm(v.map(|part| part.error)),
        )
    }

    /// A vector that is moved by d rotates by at most the angle with sine |d|/|v|.
    fn direction(v: [Near; 3], _whole: Near, unit: &ReciprocalRoot) -> Direction<Near> {
        let length = Near::length(v);
        let part = |part: Near| {
            if length.value > 0.0 {
                part.value / length.value
            } else {
                0.0
            }
        };
        let error = unit.relative_error() + 4.0 * ROUNDING;
        Direction {
            parts: v.map(|v| Near::within(part(v), error)),
            turn: length.error / length.value,
        }
    }

    /// A direction at angle φ to v, rotated by θ, has the cosine cos φ·cos θ ± sin φ·sin θ with it,
    /// and has moved by at most √2·sin θ.
    fn dot(direction: &Direction<Near>, v: [Near; 3]) -> Near {
        let [x, y, z] = [0, 1, 2].map(|i| direction.parts[i] * v[i]);
        let (sum, sine) = (x + y + z, direction.turn);
        let (along, length) = (sum.value.abs(), norm(v.map(|part| part.value)));
        let across = (length * length - along * along).max(0.0).sqrt();
        let (turned, moved) = if sine < 1.0 {
            (
                along * sine * sine / (1.0 + (1.0 - sine * sine).sqrt()) + across * sine,
                sine * SQRT_2,
            )
        } else {
            (along + length, 2.0)
        };
        Near::within(
            sum.value,
            sum.error + turned + moved * norm(v.map(|part| part.error)),
        )
    }
}

/// e^(−x/2), or 1 below 0.
fn falloff(x: f64) -> f64 {
    (-0.5 * x.max(0.0)).exp()
}

/// √(x² + y² + z²).
fn norm([x, y, z]: [f64; 3]) -> f64 {
    (x * x + y * y + z * z).sqrt()
}

/// A decreasing function of a positive number, with a relative error. The bound is infinite if the
/// machine's number can be 0.
fn inverse(x: Near, exact: impl Fn(f64) -> f64, error: f64) -> Near {
    let value = exact(x.value);
    if x.low() <= 0.0 {
        return Near {
            value,
            error: f64::INFINITY,
        };
    }
    Near::between(
        value,
        (1.0 - error) * exact(x.high()),
        (1.0 + error) * exact(x.low()),
    )
}

#[cfg(test)]
pub(crate) mod tests;

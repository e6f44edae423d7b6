//! Real: the machine's steps over real numbers, so that what each step loses can be bounded, or made on purpose.
//!
//! ```text
//! exact scene ─► [ the same unit, over the reals ] ─► the exact result, and how far the machine's may lie from it
//! ```
//! A unit's `real.rs` walks its diagram once more, with a [`Real`] on every wire. [`Near`] carries a value and a bound: a
//! sum's bounds add up, a product's are weighed by the other factor, and the one lossy act adds what its format loses. So a
//! unit's error bound is a function of its formats, derived step by step from the very diagram that the machine follows, and
//! it holds whatever is saturated on the way: a limit is an interval's end like any other.
//!
//! Nothing here is hardware, and no unit's function depends on it. It is the one place of this crate with floats.
//!
//! Laws: `near_holds_every_outcome`, `a_fit_is_within_its_bound`.

use crate::num::{Fit, Overflow, Reciprocal, ReciprocalRoot, Rounding, Word};
use std::ops::{Add, Mul, Neg, Sub};

/// Powers of two that a word may be relative to, least and greatest: `value = word · 2^(exponent − frac_bits)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scale {
    /// Least exponent.
    pub low: i32,
    /// Greatest exponent.
    pub high: i32,
}

impl Scale {
    /// A word that is what it says.
    pub const ONE: Scale = Scale { low: 0, high: 0 };

    /// The scale of a product of two words.
    pub fn times(self, other: Scale) -> Scale {
        Scale { low: self.low + other.low, high: self.high + other.high }
    }

    /// The scale of a reciprocal.
    pub fn inverse(self) -> Scale {
        Scale { low: -self.high, high: -self.low }
    }

    /// The scale of an n-th power.
    pub fn power(self, n: i32) -> Scale {
        Scale { low: self.low * n, high: self.high * n }
    }

    /// The same times 2^`places`.
    pub fn shifted(self, places: i32) -> Scale {
        Scale { low: self.low + places, high: self.high + places }
    }
}

/// A number on a wire, as exact arithmetic and the machine both understand it.
pub trait Real: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self> {
    /// The sum with a constant that both hold exactly.
    fn plus(self, constant: f64) -> Self;
    /// The product with a constant that both hold exactly.
    fn times(self, constant: f64) -> Self;
    /// The machine's side becomes a word; the exact side stays.
    fn fit(self, fit: &Fit, scale: Scale) -> Self;
    /// The power of two at or below the machine's magnitude, as a normaliser finds it.
    fn leading(self) -> Scale;
    /// Magnitude.
    fn abs(self) -> Self;
    /// The greater, of machine and exact side each.
    fn max(self, other: Self) -> Self;
    /// The lesser, of machine and exact side each.
    fn min(self, other: Self) -> Self;
    /// The machine's side is at least this, a limit that the exact side does not have.
    fn at_least(self, limit: f64) -> Self;
    /// 1/x of a positive number, by a function unit.
    fn reciprocal(self, unit: &Reciprocal) -> Self;
    /// 1/√x of a positive number, by a function unit.
    fn inverse_root(self, unit: &ReciprocalRoot) -> Self;
    /// √x of a number that is not negative, by a function unit.
    fn root(self, unit: &ReciprocalRoot) -> Self;
    /// The machine's side may be off by as much more.
    fn off_by(self, error: f64) -> Self;
    /// The magnitude with the sign of another number, by machine and exact side each.
    fn with_sign_of(self, other: Self) -> Self;
    /// A monotone function that the machine has to within `error`.
    fn function(self, exact: impl Fn(f64) -> f64, error: f64) -> Self;
}

/// A number of the exact pipeline, and how far the machine's may lie from it.
///
/// The value may be rounded as f64 rounds: each step widens the bound by that too.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Near {
    /// The exact number.
    pub value: f64,
    /// The machine's differs by at most this: never negative, never NaN, perhaps infinite.
    pub error: f64,
}

/// What one operation in f64 may be wrong by, relative to its result; twice, for the bound's own arithmetic.
const ROUNDING: f64 = f64::EPSILON;

/// 2^exponent.
pub fn power_of_two(exponent: i32) -> f64 {
    f64::from(exponent).exp2()
}

/// ⌊log2 x⌋ of a positive number; of 0 the exponent of the least normal one.
pub fn floor_log2(x: f64) -> i32 {
    ((x.to_bits() >> 52) & 0x7ff) as i32 - 1023
}

impl Near {
    /// A number that the machine holds exactly.
    pub const fn exact(value: f64) -> Self {
        Near { value, error: 0.0 }
    }

    /// A number, and a word that the machine holds in its place.
    pub fn held(value: f64, word: Word, held: i64) -> Self {
        Near::within(value, word.format.value(held) - value)
    }

    /// A number from which the machine's differs by at most |`error`|.
    pub fn within(value: f64, error: f64) -> Self {
        Near { value, error: if error.is_nan() { f64::INFINITY } else { error.abs() * (1.0 + 2.0 * ROUNDING) + value.abs() * ROUNDING } }
    }

    /// The number of which the machine's side lies in [low, high].
    fn between(value: f64, low: f64, high: f64) -> Self {
        Near::within(value, (high - value).max(value - low).max(0.0))
    }

    /// The least that the machine's side can be.
    pub fn low(self) -> f64 {
        self.value - self.error
    }

    /// The greatest that the machine's side can be.
    pub fn high(self) -> f64 {
        self.value + self.error
    }

    /// The greatest magnitude of either side.
    pub fn most(self) -> f64 {
        self.value.abs() + self.error
    }

    /// The same bound around a number that another program computed.
    pub fn around(self, value: f64) -> Self {
        Near::within(value, self.error + (self.value - value).abs())
    }

    /// Whether machine and exact side may lie on different sides of a limit.
    pub fn may_cross(self, limit: Near) -> bool {
        // An infinite bound may cross anything, also where the difference is no number.
        !((self.value - limit.value).abs() > self.error + limit.error)
    }
}

impl Add for Near {
    type Output = Near;
    fn add(self, other: Near) -> Near {
        Near::within(self.value + other.value, self.error + other.error)
    }
}

impl Sub for Near {
    type Output = Near;
    fn sub(self, other: Near) -> Near {
        self + -other
    }
}

impl Neg for Near {
    type Output = Near;
    fn neg(self) -> Near {
        Near { value: -self.value, ..self }
    }
}

impl Mul for Near {
    type Output = Near;
    fn mul(self, other: Near) -> Near {
        let error = self.value.abs() * other.error + self.error * (other.value.abs() + other.error);
        Near::within(self.value * other.value, error)
    }
}

impl Real for Near {
    fn plus(self, constant: f64) -> Near {
        self + Near::exact(constant)
    }

    fn times(self, constant: f64) -> Near {
        self * Near::exact(constant)
    }

    /// Rounding loses half a last place, cutting a whole one, downwards; then the limits. A word that wraps and may have
    /// left its range can be anything.
    fn fit(self, fit: &Fit, scale: Scale) -> Near {
        let Word { format, round, overflow } = fit.word;
        let [fine, coarse] = [scale.low, scale.high].map(|exponent| power_of_two(exponent - format.frac_bits));
        let (down, up) = if round == Rounding::Truncate { (coarse, 0.0) } else { (coarse / 2.0, coarse / 2.0) };
        let (low, high) = (self.low() - down, self.high() + up);
        let (least, most) = (format.min() as f64, format.max() as f64);
        if overflow == Overflow::Wrap {
            let inside = least * fine <= low && high <= most * fine;
            return if inside { Near::between(self.value, low, high) } else { Near { error: f64::INFINITY, ..self } };
        }
        Near::between(self.value, low.max(least * coarse).min(most * fine), high.min(most * coarse).max(least * fine))
    }

    fn leading(self) -> Scale {
        let least = (self.value.abs() - self.error).max(0.0);
        Scale { low: floor_log2(least), high: floor_log2(self.most()) }
    }

    fn abs(self) -> Near {
        Near { value: self.value.abs(), ..self }
    }

    fn max(self, other: Near) -> Near {
        Near::between(self.value.max(other.value), self.low().max(other.low()), self.high().max(other.high()))
    }

    fn min(self, other: Near) -> Near {
        Near::between(self.value.min(other.value), self.low().min(other.low()), self.high().min(other.high()))
    }

    fn at_least(self, limit: f64) -> Near {
        Near::between(self.value, self.low().max(limit), self.high().max(limit))
    }

    fn reciprocal(self, unit: &Reciprocal) -> Near {
        let error = unit.relative_error();
        inverse(self, |x| 1.0 / x, error)
    }

    fn inverse_root(self, unit: &ReciprocalRoot) -> Near {
        let error = unit.relative_error();
        inverse(self, |x| 1.0 / x.sqrt(), error)
    }

    fn root(self, unit: &ReciprocalRoot) -> Near {
        let error = unit.relative_error();
        Near::between(self.value.sqrt(), (1.0 - error) * self.low().max(0.0).sqrt(), (1.0 + error) * self.high().sqrt())
    }

    fn off_by(self, error: f64) -> Near {
        Near::within(self.value, self.error + error)
    }

    fn with_sign_of(self, other: Near) -> Near {
        let value = self.value.abs().copysign(other.value);
        if other.low() < 0.0 && other.high() >= 0.0 {
            return Near::between(value, -self.most(), self.most());
        }
        Near { value, error: self.error }
    }

    fn function(self, exact: impl Fn(f64) -> f64, error: f64) -> Near {
        let (a, b) = (exact(self.low()), exact(self.high()));
        Near::between(exact(self.value), a.min(b) - error, a.max(b) + error)
    }
}

/// A falling function of a positive number, to within a relative error. Nothing is known where the machine's may be 0.
fn inverse(x: Near, exact: impl Fn(f64) -> f64, error: f64) -> Near {
    let value = exact(x.value);
    if x.low() <= 0.0 {
        return Near { value, error: f64::INFINITY };
    }
    Near::between(value, (1.0 - error) * exact(x.high()), (1.0 + error) * exact(x.low()))
}

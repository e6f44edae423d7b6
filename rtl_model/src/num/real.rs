//! Real numbers of words: powers of two, and bounds of rounding errors.

use super::{Format, Rounding, Word};

impl Format {
    /// Value of a word, for display and for the bench; units do not call this.
    #[inline]
    pub fn value(self, word: i64) -> f64 {
        word as f64 * power_of_two(-self.frac_bits)
    }

    /// Greatest distance between two neighbouring words up to a magnitude, in places of the format:
    /// 1 in fixed point. Half of it bounds the error of a result that is flushed to zero, too.
    #[inline]
    pub fn ulp_at(self, most: f64) -> f64 {
        if !self.is_float() {
            return 1.0;
        }
        let most = (most * power_of_two(self.frac_bits)).min(self.max() as f64);
        let ulp = power_of_two((floor_log2(most) - self.significant_bits + 1).max(0));
        if self.flushes {
            ulp.max(2.0 * self.least_magnitude() as f64)
        } else {
            ulp
        }
    }
}

impl Word {
    /// A number in places of the format, rounded, before limits.
    #[inline]
    pub fn rounded_real(self, places: f64) -> f64 {
        let format = self.format;
        if !format.is_float() {
            return match self.round {
                Rounding::Truncate => floor(places),
                Rounding::Nearest => floor(places + 0.5),
                Rounding::NearestEven => places.round_ties_even(),
            };
        }
        let ulp = power_of_two((floor_log2(places.abs()) - format.significant_bits + 1).max(0));
        let ulps = places / ulp;
        let rounded = ulp
            * match self.round {
                Rounding::Truncate => ulps.trunc(),
                Rounding::Nearest => ulps.round(),
                Rounding::NearestEven => ulps.round_ties_even(),
            };
        if rounded.abs() < format.least_magnitude() as f64 {
            return 0.0;
        }
        rounded
    }

    /// Greatest error downwards and upwards, in ulp: half an ulp each, or a whole one for
    /// truncation, which goes downwards in fixed point and towards zero in floating point.
    #[inline]
    pub fn loss(self) -> [f64; 2] {
        match (self.round, self.format.is_float()) {
            (Rounding::Truncate, false) => [1.0, 0.0],
            (Rounding::Truncate, true) => [1.0; 2],
            (Rounding::Nearest | Rounding::NearestEven, _) => [0.5; 2],
        }
    }
}

/// ⌊x⌋, fast for numbers in the range of i64.
#[inline]
fn floor(x: f64) -> f64 {
    if x.abs() >= (1u64 << 52) as f64 || x.is_nan() {
        return x;
    }
    let cut = x as i64 as f64;
    if cut > x { cut - 1.0 } else { cut }
}

/// 2^exponent, fast for normal numbers.
#[inline]
pub fn power_of_two(exponent: i32) -> f64 {
    if (-1022..=1023).contains(&exponent) {
        normal_power_of_two(exponent)
    } else {
        far_power_of_two(exponent)
    }
}

/// 2^exponent of a normal number, and its nearest limit for any other. It has no branch, so that
/// loops over items can be vectorised.
#[inline]
pub fn normal_power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((exponent.clamp(-1022, 1023) + 1023) as u64) << 52)
}

/// 2^exponent. A function of its own, because the compiler would otherwise work this out for normal
/// numbers too and select.
#[cold]
#[inline(never)]
fn far_power_of_two(exponent: i32) -> f64 {
    f64::from(exponent).exp2()
}

/// ⌊log2 x⌋ of a positive number; for 0 the exponent of the least normal number.
#[inline]
pub fn floor_log2(x: f64) -> i32 {
    ((x.to_bits() >> 52) & 0x7ff) as i32 - 1023
}

//! Real numbers of words: powers of two, and bounds of rounding errors.

use super::{Format, Rounding};

impl Format {
    /// Value of a word, for display and for the bench; units do not call this.
    #[inline]
    pub fn value(self, word: i64) -> f64 {
        word as f64 * power_of_two(-self.frac_bits)
    }
}

/// 2^exponent, fast for normal numbers.
#[inline]
pub fn power_of_two(exponent: i32) -> f64 {
    if (-1022..=1023).contains(&exponent) {
        f64::from_bits(((exponent + 1023) as u64) << 52)
    } else {
        f64::from(exponent).exp2()
    }
}

/// ⌊log2 x⌋ of a positive number; for 0 the exponent of the least normal number.
#[inline]
pub fn floor_log2(x: f64) -> i32 {
    ((x.to_bits() >> 52) & 0x7ff) as i32 - 1023
}

/// Greatest error downwards and upwards, in ulp: half an ulp each, or a whole one downwards for
/// truncation.
#[inline]
pub fn loss(round: Rounding) -> [f64; 2] {
    if round == Rounding::Truncate {
        [1.0, 0.0]
    } else {
        [0.5; 2]
    }
}

//! Real numbers beside words: powers of two, and what a rounding may lose.

use super::{Format, Rounding};

impl Format {
    /// Value that a word stands for, for human eyes and for the bench; no unit calls this.
    #[inline]
    pub fn value(self, word: i64) -> f64 {
        word as f64 * power_of_two(-self.frac_bits)
    }
}

/// 2^exponent, quickly where it is a normal number.
#[inline]
pub fn power_of_two(exponent: i32) -> f64 {
    if (-1022..=1023).contains(&exponent) {
        f64::from_bits(((exponent + 1023) as u64) << 52)
    } else {
        f64::from(exponent).exp2()
    }
}

/// ⌊log2 x⌋ of a positive number; of 0 the exponent of the least normal one.
#[inline]
pub fn floor_log2(x: f64) -> i32 {
    ((x.to_bits() >> 52) & 0x7ff) as i32 - 1023
}

/// Last places that a rounding may take away and add: half a place each, or a whole one, downwards,
/// where it cuts.
#[inline]
pub fn loss(round: Rounding) -> [f64; 2] {
    if round == Rounding::Truncate {
        [1.0, 0.0]
    } else {
        [0.5; 2]
    }
}

//! Real numbers beside words: powers of two, and what a rounding may lose.

pub use super::power_of_two;

use super::Rounding;

/// ⌊log2 x⌋ of a positive number; of 0 the exponent of the least normal one.
#[inline]
pub fn floor_log2(x: f64) -> i32 {
    ((x.to_bits() >> 52) & 0x7ff) as i32 - 1023
}

/// Last places that a rounding may take away and add: half a place each, or a whole one, downwards, where it cuts.
#[inline]
pub fn loss(round: Rounding) -> [f64; 2] {
    if round == Rounding::Truncate { [1.0, 0.0] } else { [0.5; 2] }
}

//! Bounds of the error of a reciprocal.

use super::{NORMALISED_FRAC_BITS, Reciprocal};
use crate::num::Fit;
use crate::num::real::{floor_log2, power_of_two};
use crate::probe::{NoProbe, Tap};

impl Reciprocal {
    /// Result of the unit for a positive real number. Its mantissa is truncated as a word's would
    /// be.
    pub fn of(&self, x: f64) -> f64 {
        let exponent = floor_log2(x);
        // At the top of the 62 bits, so that it needs no shift.
        let operand = x * power_of_two(NORMALISED_FRAC_BITS - exponent);
        let (mantissa, _) = self.one(operand as i64, &mut Tap::new(&mut NoProbe));
        mantissa as f64 * power_of_two(-(self.bits as i32) - exponent)
    }

    /// The fit of its result.
    pub fn result(&self) -> &Fit {
        &self.result
    }

    /// Greatest |1 − m·y₀| for a mantissa and its initial estimate, with u = 2^−bits.
    ///
    /// The middle of a step is at most half a step from m, so 1 − m·y₀ ≤ 2^−(table_bits + 1);
    /// rounding y₀ moves it by m·u/2 ≤ u.
    pub fn table_error(&self) -> f64 {
        let u = power_of_two(-(self.bits as i32));
        power_of_two(-(self.table_bits as i32 + 1)) + u
    }

    /// Greatest |1 − x·(1/x)|, with u = 2^−bits.
    ///
    /// It starts at [`Reciprocal::table_error`]. A Newton step squares the error; its correction is
    /// rounded by u/2, times m·y; its result by u/2, times m ≤ 2. The truncation of the mantissa
    /// counts once: x is at most u larger than m.
    pub fn relative_error(&self) -> f64 {
        let u = power_of_two(-(self.bits as i32));
        let left =
            (0..self.newton_steps).fold(self.table_error(), |e, _| e * e + (1.0 + e) * u / 2.0 + u);
        left + (1.0 + left) * u
    }
}

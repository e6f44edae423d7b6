//! Bounds of the error of a reciprocal root.

use super::ReciprocalRoot;
use crate::functions::reciprocal::NORMALISED_FRAC_BITS;
use crate::num::Fit;
use crate::num::real::{floor_log2, power_of_two};
use crate::probe::{NoProbe, Tap};

impl ReciprocalRoot {
    /// Result of the unit for 1/√x of a positive real number. Its mantissa is truncated as a word's
    /// would be.
    pub fn of(&self, x: f64) -> f64 {
        let (mantissa, half_exponent) = normalised(x);
        // An even power of two, so that the unit halves it.
        let places = NORMALISED_FRAC_BITS - 2
            + (NORMALISED_FRAC_BITS + self.operand_frac_bits as i32).rem_euclid(2);
        let (y, exponent) = self.one(
            (mantissa * power_of_two(places)) as i64,
            &mut Tap::new(&mut NoProbe),
        );
        let half_places = (places - self.operand_frac_bits as i32) / 2;
        y as f64 * power_of_two(exponent as i32 + half_places - half_exponent - self.bits as i32)
    }

    /// Result of the unit for √x of a positive real number.
    pub fn root_of(&self, x: f64) -> f64 {
        let (mantissa, half_exponent) = normalised(x);
        let place = power_of_two(1 - self.bits as i32);
        (mantissa / place).floor() * place * self.of(mantissa) * power_of_two(half_exponent)
    }

    /// The fit of its result.
    pub fn result(&self) -> &Fit {
        &self.result
    }

    /// Greatest |1 − y₀·√m| for a mantissa and its initial estimate, with u = 2^−bits and steps of
    /// h = 4/2^table_bits over [0, 4).
    ///
    /// y₀ = 1/√c at a step's middle c. √(m/c) is farthest from 1 at the ends of the first step that
    /// is read, [1, 1 + h). (With one table bit that step is [1, 2), and its word is that of the
    /// middle of [0, 2), which is 1.) The rounding of y₀, ¾u by two roundings, counts √m ≤ 2 times.
    pub fn table_error(&self) -> f64 {
        let u = power_of_two(-(self.bits as i32));
        let h = power_of_two(2 - self.table_bits as i32);
        let ends = if self.table_bits == 1 {
            2f64.sqrt() - 1.0
        } else {
            (1.0 - (1.0 + h / 2.0).sqrt().recip()).max(((1.0 + h) / (1.0 + h / 2.0)).sqrt() - 1.0)
        };
        ends + 1.5 * u
    }

    /// Greatest |1 − y·√x|, and |1 − m·y/√x|, with u = 2^−bits.
    ///
    /// It starts at [`ReciprocalRoot::table_error`]. A Newton step leaves (3e² + e³)/2; `square` is
    /// rounded by u/2, times y·√m·m/2; `correction` by u/2, times y·√m; `result` by u/2, times √m ≤
    /// 2. The truncation of the mantissa counts half: x is at most 2u larger than m.
    pub fn relative_error(&self) -> f64 {
        let u = power_of_two(-(self.bits as i32));
        let left = (0..self.newton_steps).fold(self.table_error(), |e, _| {
            (3.0 * e * e + e * e * e) / 2.0 + (1.0 + e) * 1.5 * u + u
        });
        left + (1.0 + left) * u
    }
}

/// A positive number as a mantissa in [1, 4) and half of its power of two.
fn normalised(x: f64) -> (f64, i32) {
    let half_exponent = floor_log2(x).div_euclid(2);
    (x * power_of_two(-2 * half_exponent), half_exponent)
}

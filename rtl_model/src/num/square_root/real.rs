//! How far a reciprocal root may be from the real one.

use super::ReciprocalRoot;

impl ReciprocalRoot {
    /// Greatest |1 − y₀·√m| of a mantissa and its first guess, with u = 2^−bits and steps of h = 4/2^table_bits over [0, 4).
    ///
    /// y₀ = 1/√c at a step's middle c; √(m/c) is farthest from 1 at the ends of the first step that is asked for, [1, 1 + h)
    /// (with one table bit: [1, 2), whose word is that of the middle of [0, 2), 1). Its rounding, ¾u by two roundings, counts √m ≤ 2 times.
    pub fn table_error(&self) -> f64 {
        let u = f64::from(self.bits).exp2().recip();
        let h = 4.0 * f64::from(self.table_bits).exp2().recip();
        let ends = if self.table_bits == 1 {
            2f64.sqrt() - 1.0
        } else {
            (1.0 - (1.0 + h / 2.0).sqrt().recip()).max(((1.0 + h) / (1.0 + h / 2.0)).sqrt() - 1.0)
        };
        ends + 1.5 * u
    }

    /// Greatest |1 − y·√x|, and |1 − m·y/√x|, with u = 2^−bits.
    ///
    /// It begins with [`ReciprocalRoot::table_error`].
    /// A Newton step leaves (3e² + e³)/2; `square` is rounded by u/2, times y·√m·m/2; `correction` by u/2, times y·√m; `result` by
    /// u/2, times √m ≤ 2. The mantissa's cut counts half: x is at most 2u larger than m.
    pub fn relative_error(&self) -> f64 {
        let u = f64::from(self.bits).exp2().recip();
        let left = (0..self.newton_steps).fold(self.table_error(), |e, _| (3.0 * e * e + e * e * e) / 2.0 + (1.0 + e) * 1.5 * u + u);
        left + (1.0 + left) * u
    }
}

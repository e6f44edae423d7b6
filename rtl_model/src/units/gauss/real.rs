//! Gauss over the reals: how far a weight may lie from the exact one.
//!
//! |Δw| ≤ A·e^(−r/2)·(|Δr| + u_r/2)/2 + ΔA·e^(−r/2) + A·(table error + u_f/2) + u_w/2, with last places u of `radial_index`,
//! `falloff` and `weight`; the table errs by h²/32 + u_f/2 with straight lines over steps of h, by h/4 + u_f/2 without.

use super::Gauss;
use crate::functions::table;
use crate::real::{Real, Scale, power_of_two};

impl Gauss {
    /// Greatest distance of the table from e^(−r/2), before its result is fitted.
    pub fn table_error(&self) -> f64 {
        table::real::error(self.table.fit(), self.table.interpolation(), self.range() * self.table.step(), 0.5, 0.25)
    }

    /// The table's arguments are below this.
    fn range(&self) -> f64 {
        power_of_two(self.radial_index.word.format.int_bits)
    }

    /// A·e^(−r/2).
    pub fn real<R: Real>(&self, radial: R, amplitude: R) -> R {
        self.real_within(radial, amplitude, self.table_error())
    }

    /// The same, whose [`Gauss::table_error`] is known.
    pub fn real_within<R: Real>(&self, radial: R, amplitude: R, table_error: f64) -> R {
        let index = radial.at_least(0.0).fit(&self.radial_index, Scale::ONE);
        let falloff = index.falloff(&self.table, self.range(), table_error);
        (amplitude * falloff.fit(self.table.fit(), Scale::ONE)).fit(&self.weight, Scale::ONE)
    }
}

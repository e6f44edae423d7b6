//! Gauss over the reals: bounds the distance of a weight from the exact one.
//!
//! |Δw| ≤ A·e^(−r/2)·(|Δr| + u_r/2)/2 + ΔA·e^(−r/2) + A·(table error + u_f/2) + u_w/2, with ulps u
//! of `radial_index`, `falloff` and `weight`. The error of the table is h²/32 + u_f/2 with linear
//! interpolation over steps of h, and h/4 + u_f/2 without. A `falloff` that does not hold 1 scales
//! the table by 1 − u_f, which is wrong by at most u_f more.

use super::Gauss;
use crate::functions::table;
use crate::real::{Real, power_of_two};

impl Gauss {
    /// Greatest distance of the table from e^(−r/2), before its result is fitted.
    pub fn table_error(&self) -> f64 {
        let table = self.table();
        table::real::error(
            table.fit(),
            table.interpolation(),
            self.range() * table.step(),
            0.5,
            0.25,
        ) + self.scaling()
    }

    /// Greatest distance of the table's scale from 1.
    fn scaling(&self) -> f64 {
        let format = self.table().fit().word.format;
        (1.0 - format.value(format.max())).max(0.0)
    }

    /// Upper limit of the table's arguments.
    fn range(&self) -> f64 {
        power_of_two(self.range_bits)
    }

    /// A·e^(−r/2).
    pub fn real<R: Real>(&self, radial: R, amplitude: R) -> R {
        self.real_within(radial, amplitude, self.table_error())
    }

    /// A·e^(−r/2), with a known [`Gauss::table_error`].
    pub fn real_within<R: Real>(&self, radial: R, amplitude: R, table_error: f64) -> R {
        let range = self.range();
        let [weight] = self.graph.real(
            &self.asked,
            [radial.at_least(0.0), amplitude],
            |table, index| index.falloff(table, range, table_error),
        );
        weight
    }
}

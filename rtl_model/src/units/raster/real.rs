//! How far the differencing registers of the raster may be from the quadratic that they walk.

use crate::machine::{Machine, Rows};
use crate::num::{Rounding, Word};
use crate::real::power_of_two;

/// Greatest distance of `raster.radial` from r = Q00·x² + 2·Q01·xy + Q11·y² after `columns` and `rows` steps from where it was seeded,
/// r; the conic's and the offset's words as they are, |x| and |y| at the seed at most `reach_px`.
///
/// Adds are exact, so what is left is what the words lost that are added (ALGORITHM §4), each of them as often as it is added:
/// - `radial`, once, and the gradients at the seed, weighed by x and y;
/// - `first`, once a step;
/// - `second`, once for each pair of steps: n(n−1)/2 along a row or a column, and, by column and row, their product.
///
/// A word that holds all of its exact result's places loses nothing; twice a conic needs one place less. Where rows are seeded
/// afresh, their steps do not count. Modulo the register's reach, and only where none of `gradient`, `first` and `second` saturates.
pub fn steps_error(machine: &Machine, reach_px: f64, [columns, rows]: [u32; 2]) -> f64 {
    let m = &machine.raster;
    let conic = machine.ellipse.conic.format.frac_bits;
    let loss = |word: Word, exact_frac_bits: i32| {
        let place = power_of_two(-word.format.frac_bits);
        match word.round {
            _ if exact_frac_bits <= word.format.frac_bits => 0.0,
            Rounding::Truncate => place,
            Rounding::Nearest | Rounding::NearestEven => place / 2.0,
        }
    };
    let offset = m.offset.format.frac_bits;
    let gradient = loss(m.gradient, conic + offset);
    let seed = loss(m.radial, offset + m.gradient.format.frac_bits) + 2.0 * reach_px * gradient;
    let first = loss(m.first, conic + offset);
    let second = loss(m.second, conic - 1);
    let [columns, rows] = [columns, if m.rows == Rows::Seeded { 0 } else { rows }].map(f64::from);
    let pairs = (columns * (columns - 1.0) + rows * (rows - 1.0)) / 2.0 + columns * rows;
    seed + (columns + rows) * first + pairs * second
}

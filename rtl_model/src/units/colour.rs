//! Colour: turns spherical harmonics and the viewing direction into the colour of a splat (Kerbl et
//! al. 2023).
//!
//! ```text
//! centre − eye ─►[ · / |·| ]─► direction ─►[ monomials ]─► basis ─►( Σ coefficient · basis )─► + ½, at least 0 ─► rgb
//!                                       coefficients, 3·(degree + 1)² ─┘
//! ```
//! This file declares the unit's operators and its latency only: it has no datapath yet. Colours
//! are computed in f64 before they are quantised (the bench's `quantise`). Constants of the basis
//! are assumed to be multiplied into the coefficients.

use crate::elaboration::latency::Path;
use crate::elaboration::{Elaboration, Operator};
use crate::machine::Machine;
use crate::records::unit;

const UNIT: &str = unit::COLOUR;

/// Greatest degree of harmonics.
pub const MOST_DEGREE: u32 = 3;

/// Bits of a coefficient in memory (single precision, as in files), and bits of its fraction in the
/// unit.
pub const COEFFICIENT_BITS: [i32; 2] = [32, 24];

/// Products per splat of a degree: three squares, an inverse root from a table with a Newton step,
/// three for scaling; monomials; and three channels of all coefficients except the constant one,
/// which needs no product. A colour of degree 0 is the same from all directions and needs no
/// products.
pub fn products(degree: u32) -> u32 {
    let monomials = match degree {
        0 => return 0,
        1 => 0,
        // Squares and products of two coordinates.
        2 => 6,
        // Each monomial of degree 3 is one of these, or a sum of some, times a coordinate.
        _ => 13,
    };
    3 + 3 + 3 + monomials + 3 * ((degree + 1) * (degree + 1) - 1)
}

/// Critical path: length, inverse root, direction, monomials one after the other, the coefficients'
/// products and a tree of their sums.
pub fn path(degree: u32) -> Path {
    let [_, bits] = COEFFICIENT_BITS;
    let product = Path::default().product(bits, bits);
    let sum = Path::default().sum(bits);
    let length = product
        .sum_of_three(2 * bits)
        .normalise(2 * bits)
        .table(8)
        .then(product.times(3))
        .then(product);
    let monomials = product.then(sum).times(degree.saturating_sub(1));
    let coefficients = (degree + 1) * (degree + 1);
    length
        .then(monomials)
        .then(product)
        .then(sum.times(coefficients.next_power_of_two().ilog2()))
}

/// Declares the operators of the unit, on a machine that has it.
pub fn declare(e: &mut Elaboration, machine: &Machine) {
    let Some(colour) = &machine.colour else {
        return;
    };
    let degree = e.within(UNIT, "degree", colour.degree, 1, MOST_DEGREE);
    let [_, bits] = COEFFICIENT_BITS;
    e.copies(products(degree), |e| {
        e.part(UNIT, Operator::Multiplier([bits, bits]));
        e.part(UNIT, Operator::Adder(bits));
        e.part(UNIT, Operator::Register(bits));
    });
    e.normaliser(UNIT, 2 * bits);
    e.part(UNIT, Operator::Rom([1 << 8, bits]));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counted by hand from the formulas: x, y, z; xy, yz, xz, xx, yy, zz; and seven of the third
    /// degree.
    #[test]
    fn a_degree_takes_the_products_of_its_formulas() {
        assert_eq!(
            [0, 1, 2, 3].map(products),
            [0, 9 + 9, 9 + 6 + 24, 9 + 13 + 45]
        );
        assert!((1..MOST_DEGREE).all(|degree| path(degree).cycles < path(degree + 1).cycles));
    }
}

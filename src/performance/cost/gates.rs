//! Gates: area of an operator in NAND2 of standard cells.
//!
//! ```text
//! multiplier   p · (a − 1)(b − 1) + 4/3 · (a + b − 1): full adders, except a row and a column of ANDs
//! rounder      nothing: half an ulp is a row of the product's array
//! multiplexer  0.56 p · words · bits, for more than two words: an AND per word, and a common OR
//! all else     p · bits
//! ```
//! The default unit costs are round numbers near the least squares of relative errors over units of
//! `tiny`, `lean` and `reference`, mapped for area to open 180 nm cells in which a NAND2 has 24
//! units of area (`sh tests/programs/gates.sh`; docs/book/cost.md has the table).
//!
//! Law: `a_bit_more_never_takes_fewer_gates`.

use super::PerBit;
use rtl_model::elaboration::Operator;

/// See the head of this file. A flip-flop is DFFPOSX1, 96 units. A bit of FIFOs and memory is
/// assumed to be a NAND2, including its share of read and write logic.
pub(super) const DEFAULT: PerBit = PerBit {
    multiplier: 9.5,
    adder: 6.0,
    multiplexer: 2.5,
    register: 4.0,
    rom: 0.25,
    fifo: 1.0,
    memory: 1.0,
};

/// An AND2X2, 32 units.
const AND: f64 = 32.0 / 24.0;
/// Cost per word of a multiplexer of more than two words, as a fraction of a multiplexer of two.
const OF_SEVERAL: f64 = 0.56;

/// Gates of an operator; a register is not logic.
pub(super) fn of(prices: &PerBit, operator: Operator) -> f64 {
    let bits = |bits: i32| f64::from(bits.max(0));
    match operator {
        Operator::Multiplier([a, b]) if a.min(b) > 0 => {
            prices.multiplier * bits(a - 1) * bits(b - 1) + AND * (bits(a) + bits(b) - 1.0)
        }
        Operator::Multiplier(_) | Operator::Rounder(_) | Operator::Register(_) => 0.0,
        Operator::Adder(width) => prices.adder * bits(width),
        Operator::Multiplexer(width) | Operator::Hold(width) => prices.multiplexer * bits(width),
        Operator::Choice([words, width]) => {
            OF_SEVERAL * prices.multiplexer * bits(words) * bits(width)
        }
        Operator::Rom([words, width]) => prices.rom * bits(words) * bits(width),
    }
}

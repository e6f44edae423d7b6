//! Reciprocal: 1/x by leading-zero normalisation, a table and Newton steps.
//!
//! ```text
//! x ─►[<< lz]─► mantissa m ∈ [1,2) ─┬─►[table]─► y₀ ─►┌ c = 2 − m·y ┐×steps ─► y ∈ [½,1]
//!       └─► exponent e              └────────────────►└ y = y·c     ┘          1/x = y · 2^−e
//! ```
//! Losses: `mantissa` is truncated (rounding up could leave [1,2)); `correction` and `result` are
//! rounded to nearest.
//!
//! Laws: `a_reciprocal_is_within_its_bound`, `normalisation_restores_the_operand`.

use crate::elaboration::latency::Path;
use crate::elaboration::{Elaboration, Operator};
use crate::machine::FunctionUnit;
use crate::num::{Exact, Exacts, Fit, Format, Rounding, Word, Words};
use crate::probe::{Probe, Tap};

/// Fraction bits of an operand that is shifted left until its leading one is at bit 61.
pub const NORMALISED_FRAC_BITS: i32 = 61;

/// A normalised positive operand or result of eight items: `value = mantissa · 2^exponent`.
#[derive(Clone, Copy, Debug)]
pub struct Scientific<L> {
    /// Words of the function unit's mantissa format.
    pub mantissa: L,
    /// Powers of two.
    pub exponent: L,
}

/// Critical path from an operand of `operand_bits` bits: normalise, look up, and two products and a
/// sum per Newton step.
pub fn path(unit: FunctionUnit, operand_bits: i32) -> Path {
    // More bits are an elaboration error already.
    let bits = unit.bits.min(64) as i32;
    let step = Path::default()
        .product(bits, bits)
        .sum(2 * bits)
        .product(bits, bits)
        .fit(bits);
    Path::default()
        .normalise(operand_bits)
        .table(unit.table_bits.min(64) as i32)
        .then(step.times(unit.newton_steps))
}

/// An elaborated reciprocal unit.
#[derive(Clone, Debug)]
pub struct Reciprocal {
    mantissa: Fit,
    correction: Fit,
    result: Fit,
    table: Vec<i32>,
    table_bits: u32,
    newton_steps: u32,
    bits: u32,
    operand_frac_bits: i64,
}

impl Reciprocal {
    /// Elaborates the unit called `name` for operands with `operand_frac_bits` fraction bits.
    pub fn new(
        e: &mut Elaboration,
        unit: &'static str,
        name: &str,
        config: FunctionUnit,
        operand_frac_bits: i32,
    ) -> Self {
        let config = e.function_unit(unit, name, config);
        let word = Word::new(Format::unsigned(1, config.bits as i32));
        let product = Exact::from(word).times(word);
        let steps = config.newton_steps;
        // m·y, 2 − m·y and y·c.
        e.copies(steps, |e| {
            let product = e.times(unit, word, word);
            e.part(unit, Operator::Adder(product.bits()));
            e.times(unit, word, word);
        });
        e.part(
            unit,
            Operator::Rom([1 << config.table_bits, config.bits as i32]),
        );
        let normalised = Exact {
            int_bits: 1,
            frac_bits: NORMALISED_FRAC_BITS,
        };
        Reciprocal {
            mantissa: e.fit(
                unit,
                &format!("{name}.mantissa"),
                word.rounded(Rounding::Truncate),
                normalised,
            ),
            correction: e.copies(steps, |e| {
                e.fit(unit, &format!("{name}.correction"), word, product)
            }),
            result: e.copies(steps, |e| {
                e.fit(unit, &format!("{name}.result"), word, product)
            }),
            table: table(config),
            table_bits: config.table_bits,
            newton_steps: config.newton_steps,
            bits: config.bits,
            operand_frac_bits: i64::from(operand_frac_bits),
        }
    }

    /// 1/x of eight positive words: mantissa with `bits` fraction bits, and its power of two. The
    /// mantissa is at most 1, and at least ½ less its own error.
    #[inline(always)]
    pub fn lanes<X: Exacts, P: Probe>(&self, x: X, tap: &mut Tap<P>) -> Scientific<X::Words> {
        let lead = x.leading_zeros() - X::Words::splat(2);
        let m = tap.fit_top(&self.mantissa, x.left_by(lead));
        let mut y = m.right(self.bits - self.table_bits).look_up(&self.table);
        for _ in 0..self.newton_steps {
            let correction =
                tap.fit_words(&self.correction, X::splat(2 << (2 * self.bits)) - m * y);
            y = tap.fit_words(&self.result, y * correction);
        }
        Scientific {
            mantissa: y,
            exponent: lead
                + X::Words::splat(self.operand_frac_bits - i64::from(NORMALISED_FRAC_BITS)),
        }
    }

    /// The shape of the unit.
    pub fn shape(&self) -> FunctionUnit {
        FunctionUnit {
            table_bits: self.table_bits,
            newton_steps: self.newton_steps,
            bits: self.bits,
        }
    }

    /// The ROM: an initial estimate with `bits` fraction bits for each of 2^`table_bits` steps of
    /// [1, 2).
    pub fn guesses(&self) -> Vec<i64> {
        self.table.iter().map(|&guess| guess.into()).collect()
    }

    /// 1/x of one positive word.
    #[inline(always)]
    pub fn one<P: Probe>(&self, x: i64, tap: &mut Tap<P>) -> (i64, i64) {
        let lead = i64::from(x.leading_zeros()) - 2;
        let m = tap.fit_one(&self.mantissa, x << lead);
        let mut y = i64::from(self.table[self.address(m)]);
        for _ in 0..self.newton_steps {
            let correction = tap.fit_one(&self.correction, (2 << (2 * self.bits)) - m * y);
            y = tap.fit_one(&self.result, y * correction);
        }
        (
            y,
            lead + self.operand_frac_bits - i64::from(NORMALISED_FRAC_BITS),
        )
    }

    #[inline(always)]
    fn address(&self, m: i64) -> usize {
        ((m >> (self.bits - self.table_bits)) & ((1 << self.table_bits) - 1)) as usize
    }
}

/// Initial estimates: the reciprocal at the middle of each of 2^`table_bits` steps of [1, 2),
/// rounded to nearest.
fn table(config: FunctionUnit) -> Vec<i32> {
    let steps = 1u128 << config.table_bits;
    (0..steps)
        .map(|i| {
            let twice_middle = 2 * (steps + i) + 1;
            ((((2 * steps) << (config.bits + 1)) / twice_middle + 1) >> 1) as i32
        })
        .collect()
}

mod real;

#[cfg(test)]
mod tests;

//! Square root: 1/√x and √x by leading-zero normalisation, a table and Newton steps.
//!
//! ```text
//! x ─►[<< even lz]─► mantissa m ∈ [1,4) ─┬─►[table]─► y₀ ─►┌ q = y·y       ┐×steps ─► y ∈ (½,1]
//!       └─► exponent 2e                  │                 │ c = 3 − m·q   │          1/√x = y · 2^−e
//!                                        └────────────────►└ y = ½·y·c     ┘          √x = m·y · 2^e
//! ```
//! Losses: `mantissa` is truncated (rounding up could leave [1,4)); `square`, `correction` and
//! `result` are rounded to nearest.
//!
//! Law: `a_reciprocal_root_is_within_its_bound`.

use super::reciprocal::{NORMALISED_FRAC_BITS, Scientific};
use crate::elaboration::latency::Path;
use crate::elaboration::{Elaboration, Operator};
use crate::machine::FunctionUnit;
use crate::num::{Exact, Exacts, Fit, Format, Rounding, Word, Words};
use crate::probe::{Probe, Tap};

/// Critical path from an operand of `operand_bits` bits: that of a
/// [reciprocal](super::reciprocal::path) with the square of the estimate before each step.
pub fn path(unit: FunctionUnit, operand_bits: i32) -> Path {
    // More bits are an elaboration error already.
    let bits = unit.bits.min(64) as i32;
    let step = Path::default()
        .product(bits, bits)
        .fit(bits)
        .product(bits, bits)
        .sum(2 * bits)
        .product(bits, bits)
        .fit(bits);
    Path::default()
        .normalise(operand_bits)
        .table(unit.table_bits.min(64) as i32)
        .then(step.times(unit.newton_steps))
}

/// An elaborated reciprocal square root unit.
#[derive(Clone, Debug)]
pub struct ReciprocalRoot {
    mantissa: Fit,
    square: Fit,
    correction: Fit,
    result: Fit,
    table: Vec<i32>,
    table_bits: u32,
    newton_steps: u32,
    bits: u32,
    operand_frac_bits: i64,
}

impl ReciprocalRoot {
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
        let operand =
            Word::new(Format::unsigned(2, config.bits as i32 - 1)).rounded(Rounding::Truncate);
        let product = Exact::from(word).times(word);
        let steps = config.newton_steps;
        // y·y, m·q, 3 − m·q and y·c.
        e.copies(steps, |e| {
            e.times(unit, word, word);
            let product = e.times(unit, operand, word);
            e.part(unit, Operator::Adder(product.bits()));
            e.times(unit, word, word);
        });
        e.part(
            unit,
            Operator::Rom([1 << config.table_bits, config.bits as i32]),
        );
        let normalised = Exact {
            int_bits: 2,
            frac_bits: NORMALISED_FRAC_BITS - 1,
        };
        ReciprocalRoot {
            mantissa: e.fit(unit, &format!("{name}.mantissa"), operand, normalised),
            square: e.copies(steps, |e| {
                e.fit(unit, &format!("{name}.square"), word, product)
            }),
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

    /// 1/√x of eight positive words: mantissa in [½, 1] with `bits` fraction bits, and its power of
    /// two.
    #[inline(always)]
    pub fn lanes<X: Exacts, P: Probe>(&self, x: X, tap: &mut Tap<P>) -> Scientific<X::Words> {
        self.with_operand(x, tap).1
    }

    /// √x of eight positive words: an exact product with `2·bits − 1` fraction bits, and its power
    /// of two.
    #[inline(always)]
    pub fn root_lanes<X: Exacts, P: Probe>(&self, x: X, tap: &mut Tap<P>) -> (X, X::Words) {
        let (m, y) = self.with_operand(x, tap);
        (m * y.mantissa, -y.exponent)
    }

    /// The operand's mantissa, and 1/√x.
    #[inline(always)]
    fn with_operand<X: Exacts, P: Probe>(
        &self,
        x: X,
        tap: &mut Tap<P>,
    ) -> (X::Words, Scientific<X::Words>) {
        let splat = X::Words::splat;
        let lead = x.leading_zeros() - splat(2);
        let odd =
            (lead + splat(self.operand_frac_bits + i64::from(NORMALISED_FRAC_BITS - 1))) & splat(1);
        let lead = lead - odd;
        let m = tap.fit_top(&self.mantissa, x.left_by(lead));
        let mut y = m
            .right(self.bits + 1 - self.table_bits)
            .look_up(&self.table);
        for _ in 0..self.newton_steps {
            let square = tap.fit_words(&self.square, y * y);
            // c = 3 − m·q, halved by wiring so that ½·y·c is a plain product.
            let half_correction = tap.fit_words(
                &self.correction,
                X::splat(3 << (2 * self.bits - 1)) - m * square,
            );
            y = tap.fit_words(&self.result, y * half_correction);
        }
        (
            m,
            Scientific {
                mantissa: y,
                exponent: (lead
                    + splat(self.operand_frac_bits - i64::from(NORMALISED_FRAC_BITS - 1)))
                .right(1),
            },
        )
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
    /// [0, 4). Those below 1 are never read.
    pub fn guesses(&self) -> Vec<i64> {
        self.table.iter().map(|&guess| guess.into()).collect()
    }

    /// 1/√x of one positive word.
    #[inline(always)]
    pub fn one<P: Probe>(&self, x: i64, tap: &mut Tap<P>) -> (i64, i64) {
        let lead = self.lead(x);
        let m = tap.fit_one(&self.mantissa, x << lead);
        let mut y = i64::from(self.table[self.address(m)]);
        for _ in 0..self.newton_steps {
            let square = tap.fit_one(&self.square, y * y);
            let half_correction =
                tap.fit_one(&self.correction, (3 << (2 * self.bits - 1)) - m * square);
            y = tap.fit_one(&self.result, y * half_correction);
        }
        (y, self.exponent(lead))
    }

    /// √x of one positive word, as [`ReciprocalRoot::root_lanes`].
    pub fn root_one<P: Probe>(&self, x: i64, tap: &mut Tap<P>) -> (i64, i64) {
        let (y, exponent) = self.one(x, tap);
        let m = self.mantissa.one(x << self.lead(x));
        (m * y, -exponent)
    }

    /// Left shift that brings the value to 2^(even) times [1, 4), read with one fraction bit less
    /// than the reciprocal's.
    #[inline(always)]
    fn lead(&self, x: i64) -> i64 {
        let lead = i64::from(x.leading_zeros()) - 2;
        lead - ((lead + self.operand_frac_bits + i64::from(NORMALISED_FRAC_BITS - 1)) & 1)
    }

    /// Half of the power of two of the inverse, for a left shift of `lead`.
    #[inline(always)]
    fn exponent(&self, lead: i64) -> i64 {
        (lead + self.operand_frac_bits - i64::from(NORMALISED_FRAC_BITS - 1)) >> 1
    }

    #[inline(always)]
    fn address(&self, m: i64) -> usize {
        (m >> (self.bits + 1 - self.table_bits)) as usize
    }
}

/// Initial estimates: the reciprocal root at the middle of each of 2^`table_bits` steps of [0, 4).
/// Those below 1 are never read.
fn table(config: FunctionUnit) -> Vec<i32> {
    let one = 1i64 << config.bits;
    (0..1u128 << config.table_bits)
        .map(|i| {
            // y = 1/√((2i + 1)·2 / 2^table_bits), as √(2^n / (2i + 1)) with two guard bits for
            // rounding.
            let n = 2 * config.bits + 4 + config.table_bits - 1;
            let guess = ((1u128 << n) / (2 * i + 1)).isqrt() as i64;
            ((guess + 2) >> 2).min(one) as i32
        })
        .collect()
}

mod real;

#[cfg(test)]
mod tests;

//! Table: a function of one argument, read from a ROM of 2^k steps, to the nearest entry or
//! linearly interpolated.
//!
//! ```text
//! argument = [ address | fraction ]        nearest:  word = ROM[address]                         (value at the step's middle)
//!                                          linear:   word = ROM[address] + Δ[address] · fraction (values at the step's ends)
//! ```
//! Losses: the words of the ROM are rounded to nearest when it is made; an interpolated sum is
//! fitted to the same format.
//!
//! Laws: `a_table_is_within_its_bound`, `the_exponential_table_is_right_within_half_an_ulp`.

use crate::elaboration::latency::Path;
use crate::elaboration::{Elaboration, Operator};
use crate::machine::{Interpolation, TableShape};
use crate::num::{Exact, Exacts, Fit, Format, Lanes, Word, Words};

/// An elaborated table.
#[derive(Clone, Debug)]
pub struct Table {
    fit: Fit,
    interpolation: Interpolation,
    fraction_bits: u32,
    /// At each address the value and the step to the next value (0 for nearest).
    words: Box<[[i64; 2]]>,
    /// The same as `words`, in 32 bits.
    short: Box<[[i32; 2]]>,
}

impl Table {
    /// A table of 2^`index_bits` steps over arguments of `argument_bits` bits, from its words.
    ///
    /// `words` are the values at the steps' middles (nearest), or at their 2^`index_bits` + 1 ends
    /// (linear). `fit` is elaborated for the words' own fraction bits plus the argument's fraction
    /// bits ([`Table::fraction_bits`]).
    pub fn new(
        fit: Fit,
        index_bits: u32,
        argument_bits: u32,
        interpolation: Interpolation,
        words: &[i64],
    ) -> Self {
        let steps = 1usize << index_bits;
        let delta = |i: usize| match interpolation {
            Interpolation::Nearest => 0,
            Interpolation::Linear => words[i + 1] - words[i],
        };
        let fraction_bits = Table::fraction_bits(index_bits, argument_bits);
        // A ROM whose words are the results has them as they are after the fit.
        let value = |i: usize| match interpolation {
            Interpolation::Linear if fraction_bits > 0 => words[i],
            _ => fit.one(words[i] << fraction_bits),
        };
        let words: Box<[[i64; 2]]> = (0..steps).map(|i| [value(i), delta(i)]).collect();
        Table {
            fit,
            interpolation,
            fraction_bits,
            short: words
                .iter()
                .map(|pair| pair.map(|word| word as i32))
                .collect(),
            words,
        }
    }

    /// Bits of an argument below the address.
    pub fn fraction_bits(index_bits: u32, argument_bits: u32) -> u32 {
        argument_bits.saturating_sub(index_bits)
    }

    /// The exact sum before [`Table::fit`].
    #[inline(always)]
    pub fn exact(&self, argument: i64) -> i64 {
        let address = address(argument, self.fraction_bits);
        let fraction = argument & ((1 << self.fraction_bits) - 1);
        let [value, delta] = self.words[address];
        (value << self.fraction_bits) + delta * fraction
    }

    /// [`Table::exact`] of eight arguments, none of them negative.
    #[inline(always)]
    pub fn exact_lanes<L: Lanes>(&self, argument: L) -> L {
        let address = argument.right_unsigned(self.fraction_bits);
        let fraction = argument - address.left(self.fraction_bits);
        let [value, delta] = address.look_up_pairs(&self.words);
        value.left(self.fraction_bits) + delta * fraction
    }

    /// [`Table::exact`] of eight arguments, none of them negative, in words of at most 32 bits.
    #[inline(always)]
    pub fn exact_words<W: Words>(&self, argument: W) -> W::Exact {
        let address = argument.right(self.fraction_bits);
        let fraction = argument - address.left(self.fraction_bits);
        let [value, delta] = address.look_up_pairs(&self.short);
        value.exact().left(self.fraction_bits) + delta * fraction
    }

    /// Whether words of 32 bits hold every value of [`Table::natural`].
    pub fn is_short(&self) -> bool {
        let held = |[value, step]: &[i64; 2]| {
            let product =
                (i128::from(*step) << self.fraction_bits.min(62)) + i128::from(self.fit.half());
            (0..1 << 31).contains(value) && (-1i128 << 31..1 << 31).contains(&product)
        };
        self.fit.is_simple()
            && self.fraction_bits < 31
            && self.fit.places() == i64::from(self.fraction_bits)
            && self.words.iter().all(held)
    }

    /// The same table with its constants on all lanes. Requires [`Table::is_short`] and a word that
    /// represents every result.
    #[inline(always)]
    pub fn natural<W: Words>(&self) -> Natural<'_, W> {
        Natural {
            words: &self.short,
            fraction_bits: self.fraction_bits,
            fraction: W::splat((1 << self.fraction_bits) - 1),
            half: W::splat(self.fit.half()),
        }
    }

    /// Interpolation between two entries.
    pub fn interpolation(&self) -> Interpolation {
        self.interpolation
    }

    /// The ROM: the value at each address and the step to the next value (0 for nearest).
    pub fn lines(&self) -> impl Iterator<Item = (i64, i64)> {
        self.words.iter().map(|&[value, delta]| (value, delta))
    }

    /// The fit of the result.
    #[inline(always)]
    pub fn fit(&self) -> &Fit {
        &self.fit
    }

    /// Bits of an address.
    pub fn index_bits(&self) -> u32 {
        self.words.len().ilog2()
    }

    /// Bits of an argument below the address.
    pub fn below(&self) -> u32 {
        self.fraction_bits
    }
}

/// A [`Table`] in words of 31 bits: see [`Table::natural`].
#[derive(Clone, Copy, Debug)]
pub struct Natural<'a, W> {
    words: &'a [[i32; 2]],
    fraction_bits: u32,
    /// Mask of the fraction bits of an argument.
    fraction: W,
    half: W,
}

impl<W: Words> Natural<'_, W> {
    /// The fitted words of eight arguments, none of them negative.
    #[inline(always)]
    pub fn words(&self, argument: W) -> W {
        let [value, step] = argument.right(self.fraction_bits).look_up_pairs(self.words);
        // Only the step has bits below those of the word.
        value + (step.times(argument & self.fraction) + self.half).right(self.fraction_bits)
    }
}

/// The step that contains an argument.
#[inline(always)]
pub fn address(argument: i64, fraction_bits: u32) -> usize {
    (argument >> fraction_bits) as usize
}

/// Fraction bits of [`exp_minus`].
pub const EXP_FRAC_BITS: u32 = 60;

/// `e^(−numerator / 2^shift)` with [`EXP_FRAC_BITS`] fraction bits, for arguments up to 32. It uses
/// integers, so every computer makes the same ROM.
///
/// The series of `e^(+x)` has no cancellation; its reciprocal is accurate to about 2⁻⁵⁵.
pub fn exp_minus(numerator: u64, shift: u32) -> u64 {
    let mut sum = 1u128 << EXP_FRAC_BITS;
    let mut term = sum;
    for n in 1u128.. {
        term = ((term * u128::from(numerator)) >> shift) / n;
        if term == 0 {
            break;
        }
        sum += term;
    }
    let one_squared = 1u128 << (2 * EXP_FRAC_BITS);
    (one_squared / sum) as u64
}

/// The words of `one · e^(−r/2)` over r in [0, 2^`range_bits`), for [`Table::new`].
pub fn gaussian_words(
    index_bits: u32,
    range_bits: i32,
    interpolation: Interpolation,
    one: u64,
) -> Vec<i64> {
    let (first, step, count) = match interpolation {
        Interpolation::Nearest => (1, 2, 1u64 << index_bits),
        Interpolation::Linear => (0, 2, (1u64 << index_bits) + 1),
    };
    // r/2 = half-steps · 2^(range_bits − index_bits − 2).
    let shift = index_bits as i32 + 2 - range_bits;
    (0..count)
        .map(|i| {
            let half_steps = first + i * step;
            let word = if shift >= 0 {
                exp_minus(half_steps, shift as u32)
            } else {
                exp_minus(half_steps << -shift, 0)
            };
            let scaled = u128::from(word) * u128::from(one);
            ((scaled + (1 << (EXP_FRAC_BITS - 1))) >> EXP_FRAC_BITS) as i64
        })
        .collect()
}

/// The shape of a table, moved into the legal range if it is outside, so that elaboration can go
/// on.
pub fn shape(
    e: &mut Elaboration,
    unit: &'static str,
    name: &str,
    shape: TableShape,
    argument_bits: i32,
) -> TableShape {
    let most = argument_bits.clamp(1, 12) as u32;
    TableShape {
        index_bits: e.within(
            unit,
            &format!("{name}.index_bits"),
            shape.index_bits,
            1,
            most,
        ),
        ..shape
    }
}

/// The multiplier of an interpolating table: the step stored with each word, times a fraction.
pub fn interpolator(
    e: &mut Elaboration,
    unit: &'static str,
    shape: TableShape,
    word: Word,
    fraction_bits: u32,
) {
    if shape.interpolation == Interpolation::Linear && fraction_bits > 0 {
        let line = e.times(unit, word, Format::unsigned(0, fraction_bits as i32));
        e.part(
            unit,
            Operator::Rom([1 << shape.index_bits, word.format.width() + 1]),
        );
        e.sum(unit, [line, word.into()]);
    }
}

/// Critical path from an argument to a word of `word_bits` bits: look up, and a product and a sum
/// if the table interpolates.
pub fn path(shape: TableShape, word_bits: i32) -> Path {
    let found = Path::default().table(shape.index_bits.min(64) as i32);
    match shape.interpolation {
        Interpolation::Nearest => found,
        Interpolation::Linear => found
            .product(word_bits, word_bits)
            .sum(word_bits)
            .fit(word_bits),
    }
}

/// Shape of a table word plus a step times a fraction.
pub fn interpolated(word: Word, fraction_bits: u32) -> Exact {
    let word = Exact::from(word);
    Exact {
        int_bits: word.int_bits,
        frac_bits: word.frac_bits + fraction_bits as i32,
    }
}

pub mod real;

#[cfg(test)]
mod tests;

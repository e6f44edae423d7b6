//! Words: eight words of at most 32 bits in parallel, and their exact results.
//!
//! Ports and multiplier operands are such words (elaboration checks it). A product of two [`Words`]
//! is [`Exacts`], of at most 62 bits; a fit turns it into words again. This is not hardware, but
//! lets the simulator use the host's vector units, with half the width of [`super::Lanes`].
//! [`PlainWords`] and [`Plain`] define every operation; `kernels/host.rs` has the same in vector
//! registers.
//!
//! Law: `vector_words_equal_plain_words`.

use super::LANES;
use super::lanes::{Plain, two};
use std::fmt::Debug;
use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Sub};

/// One signal of eight items, words of at most 32 bits. A condition is a signal of words −1 (holds)
/// and 0.
pub trait Words:
    Copy
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Neg<Output = Self>
    + BitAnd<Output = Self>
    + BitOr<Output = Self>
    + Mul<Output = Self::Exact>
{
    /// Exact results of such words.
    type Exact: Exacts<Words = Self>;

    /// From one word per lane.
    fn from_array(words: [i32; LANES]) -> Self;
    /// From one natural number per lane.
    fn from_bytes(bytes: [u8; LANES]) -> Self;
    /// One word per lane.
    fn to_array(self) -> [i32; LANES];
    /// The same word, of at most 32 bits, on every lane.
    fn splat(word: i64) -> Self;
    /// The same words as exact results.
    fn exact(self) -> Self::Exact;
    /// Each lane shifted left by the same amount, 0 to 31.
    fn left(self, by: u32) -> Self;
    /// Each lane shifted right towards minus infinity by the same amount, 0 to 31.
    fn right(self, by: u32) -> Self;
    /// The greater word of each lane.
    fn max(self, other: Self) -> Self;
    /// The lesser word of each lane.
    fn min(self, other: Self) -> Self;
    /// Where `self` is greater.
    fn above(self, other: Self) -> Self;
    /// `self` where the condition holds, `other` elsewhere.
    fn where_else(self, condition: Self, other: Self) -> Self;
    /// Where a lane is 0.
    fn is_zero(self) -> Self;
    /// Magnitude of each lane. No lane may be −2^31.
    fn abs(self) -> Self;
    /// The product of each lane, which must be a word of 32 bits.
    fn times(self, other: Self) -> Self;
    /// The sum modulo 2^32.
    fn wrapping_add(self, other: Self) -> Self;
    /// The product modulo 2^32.
    fn wrapping_times(self, other: Self) -> Self;
    /// The entries of a table of 2^n words at each lane's low n bits.
    fn look_up(self, table: &[i32]) -> Self;
    /// The entries of a table of 2^n pairs of words at each lane's low n bits.
    fn look_up_pairs(self, table: &[[i32; 2]]) -> [Self; 2];
    /// The signs of the lanes as bits, the first lane in the LSB: a condition as bits.
    fn signs(self) -> u8;
    /// Permutation: each lane gets the word of the lane with the index in `lanes`, 0 to 7.
    fn pick(self, lanes: Self) -> Self;
    /// Rows to columns: from eight items' words to eight signals, or back.
    fn transposed(rows: [Self; LANES]) -> [Self; LANES];

    /// The product of a row of constants with a vector.
    #[inline(always)]
    fn dot(row: [i64; 3], vector: [Self; 3]) -> Self::Exact {
        Self::splat(row[0]) * vector[0]
            + Self::splat(row[1]) * vector[1]
            + Self::splat(row[2]) * vector[2]
    }

    /// Where a lane is not above 0.
    #[inline(always)]
    fn is_none(self) -> Self {
        Self::splat(1).above(self)
    }

    /// The negated condition.
    #[inline(always)]
    fn not(self) -> Self {
        Self::splat(-1) - self
    }
}

/// Exact results of eight items: sums and products of [`Words`], of at most 62 bits, before a fit.
pub trait Exacts:
    Copy + Debug + Add<Output = Self> + Sub<Output = Self> + Neg<Output = Self> + BitOr<Output = Self>
{
    /// Their operands, and the words that a fit turns them into.
    type Words: Words<Exact = Self>;

    /// From one result per lane.
    fn from_array(words: [i64; LANES]) -> Self;
    /// One result per lane.
    fn to_array(self) -> [i64; LANES];
    /// From the even lanes, then the odd lanes: the order of products of words.
    fn from_evens_first(words: [i64; LANES]) -> Self;
    /// The even lanes, then the odd lanes.
    fn to_evens_first(self) -> [i64; LANES];
    /// The same result on every lane.
    fn splat(word: i64) -> Self;
    /// Each lane shifted left by the same amount, 0 to 63.
    fn left(self, by: u32) -> Self;
    /// Each lane shifted left by its own amount, 0 to 63.
    fn left_by(self, by: Self::Words) -> Self;
    /// Each lane shifted right towards minus infinity by the same amount, 0 to 63.
    fn right(self, by: u32) -> Self;
    /// The greater of each lane.
    fn max(self, other: Self) -> Self;
    /// The lesser of each lane.
    fn min(self, other: Self) -> Self;
    /// Where `self` is greater.
    fn above(self, other: Self) -> Self::Words;
    /// Magnitude of each lane.
    fn abs(self) -> Self;
    /// Leading zeros of each lane. All lanes must be positive.
    fn leading_zeros(self) -> Self::Words;
    /// The low 32 bits of each lane.
    fn low(self) -> Self::Words;
    /// The low 32 bits of each lane shifted right by the same amount, 0 to 31.
    fn cut(self, by: u32) -> Self::Words;
    /// Each lane shifted right by the same amount, 32 to 63, after which it is a word.
    fn cut_deep(self, by: u32) -> Self::Words;
    /// Each lane shifted right by its own amount; none unless all amounts are 0 to 63 and all
    /// results are words of 31 bits.
    fn cut_by(self, by: Self::Words) -> Option<Self::Words>;
}

/// Eight words as an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlainWords(pub [i32; LANES]);

impl PlainWords {
    #[cfg_attr(debug_assertions, inline(never))]
    #[cfg_attr(not(debug_assertions), inline)]
    fn zip(self, other: PlainWords, f: impl Fn(i32, i32) -> i32) -> Self {
        let mut out = self.0;
        for (own, other) in out.iter_mut().zip(other.0) {
            *own = f(*own, other);
        }
        PlainWords(out)
    }
}

impl Words for PlainWords {
    type Exact = Plain;

    #[inline]
    fn from_array(words: [i32; LANES]) -> Self {
        PlainWords(words)
    }
    #[inline]
    fn from_bytes(bytes: [u8; LANES]) -> Self {
        PlainWords(bytes.map(i32::from))
    }
    #[inline]
    fn times(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
    #[inline]
    fn to_array(self) -> [i32; LANES] {
        self.0
    }
    #[inline]
    fn splat(word: i64) -> Self {
        debug_assert!(
            word == i64::from(word as i32),
            "a constant is wider than 32 bits"
        );
        PlainWords([word as i32; LANES])
    }
    #[inline]
    fn exact(self) -> Plain {
        Plain(self.0.map(i64::from))
    }
    #[inline]
    fn left(self, by: u32) -> Self {
        self.zip(self, |v, _| v << by)
    }
    #[inline]
    fn right(self, by: u32) -> Self {
        self.zip(self, |v, _| v >> by)
    }
    #[inline]
    fn max(self, other: Self) -> Self {
        self.zip(other, i32::max)
    }
    #[inline]
    fn min(self, other: Self) -> Self {
        self.zip(other, i32::min)
    }
    #[inline]
    fn above(self, other: Self) -> Self {
        self.zip(other, |a, b| -i32::from(a > b))
    }
    #[inline]
    fn where_else(self, condition: Self, other: Self) -> Self {
        self.zip(condition, |v, holds| v & holds) | other.zip(condition, |v, holds| v & !holds)
    }
    #[inline]
    fn is_zero(self) -> Self {
        self.zip(self, |v, _| -i32::from(v == 0))
    }
    #[inline]
    fn abs(self) -> Self {
        self.zip(self, |v, _| v.abs())
    }
    #[inline]
    fn look_up(self, table: &[i32]) -> Self {
        self.zip(self, |v, _| table[v as usize & (table.len() - 1)])
    }
    #[inline]
    fn look_up_pairs(self, table: &[[i32; 2]]) -> [Self; 2] {
        two!(i => self.zip(self, |v, _| table[v as usize & (table.len() - 1)][i]))
    }
    #[inline]
    fn wrapping_add(self, other: Self) -> Self {
        self.zip(other, i32::wrapping_add)
    }
    #[inline]
    fn wrapping_times(self, other: Self) -> Self {
        self.zip(other, i32::wrapping_mul)
    }
    #[inline]
    fn signs(self) -> u8 {
        self.0
            .iter()
            .rev()
            .fold(0, |bits, &v| bits << 1 | u8::from(v < 0))
    }
    #[inline]
    fn pick(self, lanes: Self) -> Self {
        PlainWords(lanes.0.map(|lane| self.0[lane as usize % LANES]))
    }
    #[inline]
    fn transposed(rows: [Self; LANES]) -> [Self; LANES] {
        let mut columns = rows;
        for (i, column) in columns.iter_mut().enumerate() {
            for (word, row) in column.0.iter_mut().zip(&rows) {
                *word = row.0[i];
            }
        }
        columns
    }
}

impl Exacts for Plain {
    type Words = PlainWords;

    #[inline]
    fn from_array(words: [i64; LANES]) -> Self {
        Plain(words)
    }
    #[inline]
    fn to_array(self) -> [i64; LANES] {
        self.0
    }
    #[inline]
    fn from_evens_first([a, c, e, g, b, d, f, h]: [i64; LANES]) -> Self {
        Plain([a, b, c, d, e, f, g, h])
    }
    #[inline]
    fn to_evens_first(self) -> [i64; LANES] {
        let [a, b, c, d, e, f, g, h] = self.0;
        [a, c, e, g, b, d, f, h]
    }
    #[inline]
    fn splat(word: i64) -> Self {
        Plain([word; LANES])
    }
    #[inline]
    fn left(self, by: u32) -> Self {
        Plain(self.0.map(|v| v << by))
    }
    #[inline]
    fn left_by(self, by: PlainWords) -> Self {
        self.zip(by.exact(), |v, by| v << by)
    }
    #[inline]
    fn right(self, by: u32) -> Self {
        Plain(self.0.map(|v| v >> by))
    }
    #[inline]
    fn max(self, other: Self) -> Self {
        self.zip(other, i64::max)
    }
    #[inline]
    fn min(self, other: Self) -> Self {
        self.zip(other, i64::min)
    }
    #[inline]
    fn above(self, other: Self) -> PlainWords {
        self.zip(other, |a, b| -i64::from(a > b)).low()
    }
    #[inline]
    fn abs(self) -> Self {
        Plain(self.0.map(i64::abs))
    }
    #[inline]
    fn leading_zeros(self) -> PlainWords {
        debug_assert!(self.0.iter().all(|&v| v > 0), "a lane is not positive");
        PlainWords(self.0.map(|v| v.leading_zeros() as i32))
    }
    #[inline]
    fn low(self) -> PlainWords {
        PlainWords(self.0.map(|v| v as i32))
    }
    #[inline]
    fn cut(self, by: u32) -> PlainWords {
        Exacts::right(self, by).low()
    }
    #[inline]
    fn cut_deep(self, by: u32) -> PlainWords {
        Exacts::right(self, by).low()
    }
    #[inline]
    fn cut_by(self, by: PlainWords) -> Option<PlainWords> {
        let possible = by.0.iter().all(|by| (0..64).contains(by));
        let cut = self.zip(by.exact(), |v, by| v >> (by & 63));
        (possible && cut.0.iter().all(|v| (-1 << 30..1 << 30).contains(v))).then(|| cut.low())
    }
}

impl Add for PlainWords {
    type Output = PlainWords;
    #[inline]
    fn add(self, other: PlainWords) -> PlainWords {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for PlainWords {
    type Output = PlainWords;
    #[inline]
    fn sub(self, other: PlainWords) -> PlainWords {
        self.zip(other, |a, b| a - b)
    }
}

impl Neg for PlainWords {
    type Output = PlainWords;
    #[inline]
    fn neg(self) -> PlainWords {
        self.zip(self, |v, _| -v)
    }
}

impl BitAnd for PlainWords {
    type Output = PlainWords;
    #[inline]
    fn bitand(self, other: PlainWords) -> PlainWords {
        self.zip(other, |a, b| a & b)
    }
}

impl BitOr for PlainWords {
    type Output = PlainWords;
    #[inline]
    fn bitor(self, other: PlainWords) -> PlainWords {
        self.zip(other, |a, b| a | b)
    }
}

impl Mul for PlainWords {
    type Output = Plain;
    #[inline]
    fn mul(self, other: PlainWords) -> Plain {
        self.exact().zip(other.exact(), |a, b| a * b)
    }
}

#[cfg(test)]
mod tests;

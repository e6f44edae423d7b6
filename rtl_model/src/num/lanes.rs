//! Lanes: eight items in parallel on one set of wires. A unit is written once, as for one item, and
//! runs on eight.
//!
//! This is not hardware, but lets the simulator use the host's vector units. [`Plain`] defines
//! every operation; `kernels/host.rs` has the same eight lanes in vector registers. Every operation
//! is exact. Multiplier operands are words of at most 32 bits (elaboration checks it), so a product
//! has at most 64.
//!
//! Law: `vector_lanes_equal_plain_lanes`.

use super::words::{PlainWords, Words};
use std::fmt::Debug;
use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Sub};

/// Number of lanes.
pub const LANES: usize = 8;

/// One signal of eight items. A condition is a signal of words −1 (holds) and 0.
pub trait Lanes:
    Copy
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Neg<Output = Self>
    + BitAnd<Output = Self>
    + BitOr<Output = Self>
{
    /// Lanes of half the width.
    type Words: Words;

    /// From one word per lane.
    fn from_array(words: [i64; LANES]) -> Self;
    /// From one natural number per lane.
    fn from_bytes(bytes: [u8; LANES]) -> Self;
    /// Eight words of each of eight items, transposed: one result per word.
    fn transposed(items: &[[i32; LANES]; LANES]) -> [Self; LANES];
    /// One word per lane.
    fn to_array(self) -> [i64; LANES];
    /// The same word on every lane.
    fn splat(word: i64) -> Self;
    /// The low 32 bits of each lane.
    fn low(self) -> Self::Words;
    /// Each lane shifted left by the same amount, 0 to 63.
    fn left(self, by: u32) -> Self;
    /// Each lane shifted right towards minus infinity by the same amount, 0 to 63.
    fn right(self, by: u32) -> Self;
    /// Each lane shifted right by the same amount, 0 to 63. No lane may be negative.
    fn right_unsigned(self, by: u32) -> Self;
    /// The sum modulo 2^64, as registers wrap.
    fn wrapping_add(self, other: Self) -> Self;
    /// The product with natural numbers below 2^32, modulo 2^64.
    fn times(self, naturals: Self) -> Self;
    /// The greater word of each lane.
    fn max(self, other: Self) -> Self;
    /// The lesser word of each lane.
    fn min(self, other: Self) -> Self;
    /// The smaller low and the smaller high 32 bits of each lane, as naturals. For naturals below
    /// 2^32 this is the minimum.
    fn min_of_halves(self, other: Self) -> Self;
    /// Where `self` is greater.
    fn above(self, other: Self) -> Self;
    /// The entries of a table of 2^n words at each lane's low n bits.
    fn look_up(self, table: &[i64]) -> Self;
    /// The entries of a table of 2^n pairs of words at each lane's low n bits.
    fn look_up_pairs(self, table: &[[i64; 2]]) -> [Self; 2];
    /// The signs of the lanes as bits, the first lane in the LSB.
    fn signs(self) -> u8;
    /// The keys that differ from a word by less than a limit, as bits, the first key in the LSB.
    fn near(keys: &[i32; LANES], word: i32, limit: u32) -> u32;
    /// The index of the key nearest to a word, the first of several.
    fn nearest(keys: &[i32; LANES], word: i32) -> usize;

    /// `sums + (words · factor + half >> right)`, limited, in words of 32 bits, which do not
    /// overflow. Returns the sums before their limits for probes.
    fn add_product(
        sums: &mut [i32; LANES],
        words: &[i32; LANES],
        factor: i32,
        half: &[i32; LANES],
        right: &[i32; LANES],
        limits: [&[i32; LANES]; 2],
    ) -> Self::Words;

    /// Prefetches an item that is about to be read.
    #[inline(always)]
    fn prefetch<T>(_item: &T) {}

    /// Whether any lane is negative.
    #[inline(always)]
    fn any_negative(self) -> bool {
        self.signs() != 0
    }
}

/// `[f(0), f(1), f(2)]`, unrolled.
///
/// Larger closures are compiled separately, without the vector instructions of their caller
/// (`kernels/host.rs`).
macro_rules! three {
    ($i:ident => $f:expr) => {
        [
            {
                let $i = 0;
                $f
            },
            {
                let $i = 1;
                $f
            },
            {
                let $i = 2;
                $f
            },
        ]
    };
}

/// `[f(0), f(1)]`, unrolled (see `three`).
macro_rules! two {
    ($i:ident => $f:expr) => {
        [
            {
                let $i = 0;
                $f
            },
            {
                let $i = 1;
                $f
            },
        ]
    };
}
pub(crate) use {three, two};

/// Eight lanes as an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plain(pub [i64; LANES]);

impl Plain {
    #[cfg_attr(debug_assertions, inline(never))]
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn zip(self, other: Plain, f: impl Fn(i64, i64) -> i64) -> Self {
        let mut out = self.0;
        for (own, other) in out.iter_mut().zip(other.0) {
            *own = f(*own, other);
        }
        Plain(out)
    }
}

impl Lanes for Plain {
    type Words = PlainWords;

    #[inline]
    fn from_array(words: [i64; LANES]) -> Self {
        Plain(words)
    }
    #[inline]
    fn from_bytes(bytes: [u8; LANES]) -> Self {
        Plain(bytes.map(i64::from))
    }
    #[inline]
    fn transposed(items: &[[i32; LANES]; LANES]) -> [Self; LANES] {
        std::array::from_fn(|word| Plain(items.map(|item| i64::from(item[word]))))
    }
    #[inline]
    fn to_array(self) -> [i64; LANES] {
        self.0
    }
    #[inline]
    fn splat(word: i64) -> Self {
        Plain([word; LANES])
    }
    #[inline]
    fn low(self) -> PlainWords {
        PlainWords(self.0.map(|v| v as i32))
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
    fn right_unsigned(self, by: u32) -> Self {
        debug_assert!(!self.any_negative(), "a lane is negative");
        self.right(by)
    }
    #[inline]
    fn wrapping_add(self, other: Self) -> Self {
        self.zip(other, i64::wrapping_add)
    }
    #[inline]
    fn times(self, naturals: Self) -> Self {
        self.zip(naturals, i64::wrapping_mul)
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
    fn min_of_halves(self, other: Self) -> Self {
        self.zip(other, |a, b| {
            let [low, high] = [0, 32].map(|half| ((a >> half) as u32).min((b >> half) as u32));
            (u64::from(high) << 32 | u64::from(low)) as i64
        })
    }
    #[inline]
    fn above(self, other: Self) -> Self {
        self.zip(other, |a, b| -i64::from(a > b))
    }
    #[inline]
    fn look_up(self, table: &[i64]) -> Self {
        self.zip(self, |v, _| table[v as usize & (table.len() - 1)])
    }
    #[inline]
    fn look_up_pairs(self, table: &[[i64; 2]]) -> [Self; 2] {
        two!(i => self.zip(self, |v, _| table[v as usize & (table.len() - 1)][i]))
    }
    #[inline]
    fn signs(self) -> u8 {
        bits(self.0.map(|v| v < 0))
    }
    #[inline]
    fn add_product(
        sums: &mut [i32; LANES],
        words: &[i32; LANES],
        factor: i32,
        half: &[i32; LANES],
        right: &[i32; LANES],
        [min, max]: [&[i32; LANES]; 2],
    ) -> PlainWords {
        let mut unlimited = [0; LANES];
        for lane in 0..LANES {
            unlimited[lane] = sums[lane].wrapping_add(
                words[lane].wrapping_mul(factor).wrapping_add(half[lane]) >> right[lane],
            );
            sums[lane] = unlimited[lane].max(min[lane]).min(max[lane]);
        }
        PlainWords(unlimited)
    }
    #[inline]
    fn near(keys: &[i32; LANES], word: i32, limit: u32) -> u32 {
        bits(keys.map(|key| distance(key, word) < limit)).into()
    }
    #[inline]
    fn nearest(keys: &[i32; LANES], word: i32) -> usize {
        (0..LANES)
            .min_by_key(|&index| distance(keys[index], word))
            .unwrap_or(0)
    }
}

/// Distance between two words; at most 2^31 is assumed.
#[inline]
fn distance(a: i32, b: i32) -> u32 {
    a.wrapping_sub(b).unsigned_abs()
}

/// One bit per lane of a condition.
#[inline]
fn bits(mask: [bool; LANES]) -> u8 {
    mask.into_iter()
        .rev()
        .fold(0, |bits, holds| bits << 1 | u8::from(holds))
}

impl Add for Plain {
    type Output = Plain;
    #[inline]
    fn add(self, other: Plain) -> Plain {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for Plain {
    type Output = Plain;
    #[inline]
    fn sub(self, other: Plain) -> Plain {
        self.zip(other, |a, b| a - b)
    }
}

impl Neg for Plain {
    type Output = Plain;
    #[inline]
    fn neg(self) -> Plain {
        self.zip(self, |v, _| -v)
    }
}

impl BitAnd for Plain {
    type Output = Plain;
    #[inline]
    fn bitand(self, other: Plain) -> Plain {
        self.zip(other, |a, b| a & b)
    }
}

impl BitOr for Plain {
    type Output = Plain;
    #[inline]
    fn bitor(self, other: Plain) -> Plain {
        self.zip(other, |a, b| a | b)
    }
}

/// Product of two words of at most 32 bits each.
impl Mul for Plain {
    type Output = Plain;
    #[inline]
    fn mul(self, other: Plain) -> Plain {
        self.zip(other, |a, b| {
            debug_assert!(
                a == i64::from(a as i32) && b == i64::from(b as i32),
                "a multiplier operand is wider than 32 bits"
            );
            i64::from(a as i32) * i64::from(b as i32)
        })
    }
}

#[cfg(test)]
mod tests;

//! Lanes: eight items side by side on one set of wires, so that a unit is written once, as for one item, and runs eight wide.
//!
//! Nothing here is hardware: it is how the simulator keeps a host's vector units busy. [`Plain`] is what every operation
//! means; `host.rs` has the same eight lanes in vector registers. Every operation is exact; multiplier operands are words of
//! at most 32 bits (elaboration sees to it), so a product never leaves 64.
//!
//! Law: `vector_lanes_equal_plain_lanes`.

use super::words::{PlainWords, Words};
use std::fmt::Debug;
use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Sub};

/// Items that travel together.
pub const LANES: usize = 8;

/// One condition of eight items.
pub type Mask = [bool; LANES];

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

    /// From one word a lane.
    fn from_array(words: [i64; LANES]) -> Self;
    /// One word a lane.
    fn to_array(self) -> [i64; LANES];
    /// The same word on every lane.
    fn splat(word: i64) -> Self;
    /// Each lane shifted left by the same amount, 0 to 63.
    fn left(self, by: u32) -> Self;
    /// Each lane shifted right towards minus infinity by the same amount, 0 to 63.
    fn right(self, by: u32) -> Self;
    /// The greater word of each lane.
    fn max(self, other: Self) -> Self;
    /// The lesser word of each lane.
    fn min(self, other: Self) -> Self;
    /// Where `self` is greater.
    fn above(self, other: Self) -> Self;
    /// The entries of a table of 2^n words at each lane's low n bits.
    fn look_up(self, table: &[i64]) -> Self;
    /// The key nearest to a word: its distance, and its index, the lowest of equals.
    fn nearest_of_4(keys: &[i32; 4], word: i32) -> (u32, usize);
}

/// `[f(0), f(1), f(2)]`, written out.
///
/// A closure of any size is compiled on its own, without the vector instructions that its caller may use (`host.rs`).
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

/// `[f(0), f(1)]`, written out (see `three`).
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
    #[inline(always)]
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

    #[inline(always)]
    fn from_array(words: [i64; LANES]) -> Self {
        Plain(words)
    }
    #[inline(always)]
    fn to_array(self) -> [i64; LANES] {
        self.0
    }
    #[inline(always)]
    fn splat(word: i64) -> Self {
        Plain([word; LANES])
    }
    #[inline(always)]
    fn left(self, by: u32) -> Self {
        self.zip(self, |v, _| v << by)
    }
    #[inline(always)]
    fn right(self, by: u32) -> Self {
        self.zip(self, |v, _| v >> by)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, i64::max)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, i64::min)
    }
    #[inline(always)]
    fn above(self, other: Self) -> Self {
        self.zip(other, |a, b| -i64::from(a > b))
    }
    #[inline(always)]
    fn look_up(self, table: &[i64]) -> Self {
        self.zip(self, |v, _| table[v as usize & (table.len() - 1)])
    }
    #[inline(always)]
    fn nearest_of_4(keys: &[i32; 4], word: i32) -> (u32, usize) {
        nearest_of(keys, word)
    }
}

/// The key nearest to a word: its distance, and its index, the lowest of equals.
#[inline(always)]
pub fn nearest_of<const N: usize>(keys: &[i32; N], word: i32) -> (u32, usize) {
    let mut nearest = (u32::MAX, 0);
    for (index, key) in keys.iter().enumerate() {
        let distance = word.abs_diff(*key);
        if distance < nearest.0 {
            nearest = (distance, index);
        }
    }
    nearest
}

impl Add for Plain {
    type Output = Plain;
    #[inline(always)]
    fn add(self, other: Plain) -> Plain {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for Plain {
    type Output = Plain;
    #[inline(always)]
    fn sub(self, other: Plain) -> Plain {
        self.zip(other, |a, b| a - b)
    }
}

impl Neg for Plain {
    type Output = Plain;
    #[inline(always)]
    fn neg(self) -> Plain {
        self.zip(self, |v, _| -v)
    }
}

impl BitAnd for Plain {
    type Output = Plain;
    #[inline(always)]
    fn bitand(self, other: Plain) -> Plain {
        self.zip(other, |a, b| a & b)
    }
}

impl BitOr for Plain {
    type Output = Plain;
    #[inline(always)]
    fn bitor(self, other: Plain) -> Plain {
        self.zip(other, |a, b| a | b)
    }
}

/// Product of two words of at most 32 bits each.
impl Mul for Plain {
    type Output = Plain;
    #[inline(always)]
    fn mul(self, other: Plain) -> Plain {
        self.zip(other, |a, b| {
            debug_assert!(a == i64::from(a as i32) && b == i64::from(b as i32), "a multiplier operand is wider than 32 bits");
            i64::from(a as i32) * i64::from(b as i32)
        })
    }
}

#[cfg(test)]
mod tests;

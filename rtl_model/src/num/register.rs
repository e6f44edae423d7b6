//! Register: an accumulator whose adder has the width of its word and wraps.
//!
//! The word is at the top of a 64-bit host word, so that the host's wrapping is that of the
//! register. Additions are exact modulo 2^width. A sum reached step by step therefore equals the
//! closed form, and the simulator can start in the middle of a row.
//!
//! Law: `stepping_equals_the_closed_form` (unit `raster`).

use super::{Lanes, Word};

/// The shape of a wrapping register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register {
    unused: u32,
}

/// Bits of a [`Register`], at the top of a host word.
pub type RegisterBits = i64;

impl Register {
    /// A register that holds `word`.
    pub fn new(word: Word) -> Self {
        Register {
            unused: (64 - word.format.width()).clamp(0, 63) as u32,
        }
    }

    /// Loads a value with `places` fraction bits less than the register.
    #[inline(always)]
    pub fn load(self, value: i64, places: u32) -> RegisterBits {
        value << places << self.unused
    }

    /// [`Register::load`] of eight values.
    #[inline(always)]
    pub fn load_lanes<L: Lanes>(self, values: L, places: u32) -> L {
        values.left(places).left(self.unused)
    }

    /// Stores eight words, which wrap to the width of the register.
    #[inline(always)]
    pub fn hold<L: Lanes>(self, words: L) -> L {
        words.left(self.unused)
    }

    /// The words of eight registers.
    #[inline(always)]
    pub fn read_lanes<L: Lanes>(self, held: L) -> L {
        held.right(self.unused)
    }

    /// [`Register::read_lanes`] for registers that are not negative.
    #[inline(always)]
    pub fn read_unsigned<L: Lanes>(self, held: L) -> L {
        held.right_unsigned(self.unused)
    }

    /// The word of the register.
    #[inline(always)]
    pub fn read(self, held: RegisterBits) -> i64 {
        held >> self.unused
    }
}

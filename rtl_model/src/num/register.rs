//! Register: a word that is added to again and again, with an adder as wide as itself that wraps.
//!
//! The word is kept at the top of a 64-bit host word, so that the host's own wrapping is the
//! register's. Its adds are exact modulo 2^width: a sum reached step by step equals the same sum in
//! closed form, which is what lets the simulator enter a row in the middle.
//!
//! Law: `stepping_equals_the_closed_form` (unit `raster`).

use super::{Lanes, Word};

/// The shape of a wrapping register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register {
    unused: u32,
}

/// The contents of a [`Register`], at the top of a host word.
pub type Held = i64;

impl Register {
    /// A register that holds `word`.
    pub fn new(word: Word) -> Self {
        Register {
            unused: (64 - word.format.width()).clamp(0, 63) as u32,
        }
    }

    /// Loads a value that lacks so many of the register's fraction bits.
    #[inline(always)]
    pub fn load(self, value: i64, places: u32) -> Held {
        value << places << self.unused
    }

    /// [`Register::load`] of eight values.
    #[inline(always)]
    pub fn load_lanes<L: Lanes>(self, values: L, places: u32) -> L {
        values.left(places).left(self.unused)
    }

    /// Holds eight words that may have more bits than the register: it wraps.
    #[inline(always)]
    pub fn hold<L: Lanes>(self, words: L) -> L {
        words.left(self.unused)
    }

    /// The words that eight registers hold.
    #[inline(always)]
    pub fn read_lanes<L: Lanes>(self, held: L) -> L {
        held.right(self.unused)
    }

    /// [`Register::read_lanes`] where none is negative.
    #[inline(always)]
    pub fn read_unsigned<L: Lanes>(self, held: L) -> L {
        held.right_unsigned(self.unused)
    }

    /// The word that is held.
    #[inline(always)]
    pub fn read(self, held: Held) -> i64 {
        held >> self.unused
    }
}

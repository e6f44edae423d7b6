//! Records that cross the ports between units, and decisions of units. They are below probes and
//! units, so that both can name them.

mod fragment;
mod light;
mod setup;
pub mod unit;
mod words;

pub use fragment::*;
pub use light::*;
pub use setup::*;
pub use words::*;

use crate::num::{Exact, Word};

/// Bits of a column or a row: a picture has up to 16384.
pub const PIXEL_BITS: i32 = 14;
/// A column or a row.
pub const PLACE: Exact = Exact {
    int_bits: PIXEL_BITS,
    frac_bits: 0,
};
/// The picture's middle, which is up to 8192 pixels from its first pixel.
pub const MIDDLE: Exact = Exact {
    int_bits: PIXEL_BITS,
    frac_bits: 1,
};

/// A named place where bits can be lost.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Signal {
    /// Its unit.
    pub unit: &'static str,
    /// Its name in the unit.
    pub name: String,
    /// Its word.
    pub word: Word,
}

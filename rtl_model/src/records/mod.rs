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

use crate::num::Word;

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

//! Records: what crosses the ports between units, and what is decided there. They lie below probes
//! and units, so that both can name them.

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
    /// The unit it belongs to.
    pub unit: &'static str,
    /// Its name there.
    pub name: String,
    /// Its word.
    pub word: Word,
}

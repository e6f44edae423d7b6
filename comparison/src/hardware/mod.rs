//! Hardware: machine files, scenes as words, and the machine's frame.

pub mod datapath;
pub mod fixed;
pub mod machines;
pub mod quantise;
pub(crate) mod registers;
pub mod searched;

//! Hardware: machine files, scenes as words, and the frame that comes back.

pub mod fixed;
pub mod machines;
pub mod quantise;
pub(crate) mod registers;
pub mod searched;

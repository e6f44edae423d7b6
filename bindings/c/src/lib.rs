//! splatsim for C: opaque handles, a size with every array, no panic across the boundary.
//!
//! A function that makes a handle returns NULL on failure; one that returns an `int` or a count
//! returns a negative number. Then `splatsim_last_error` returns the reason, in a sentence, for the
//! calling thread. Every pointer is checked for NULL, and pointers to numbers for their alignment
//! and size. Several threads may use a handle: their calls are serialised.
#![allow(
    unsafe_code,
    reason = "pointers come from C; it is denied everywhere else except in the machine's vector instructions"
)]

mod handles;
mod text;
mod units;

pub use handles::*;
pub use text::*;
pub use units::*;

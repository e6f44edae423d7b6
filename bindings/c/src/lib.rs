//! splatsim for C: opaque handles, a size with every array, no panic across the boundary.
//!
//! A function that makes a handle gives NULL where it cannot; one that gives an `int` or a count
//! gives a negative number. Then `splatsim_last_error` says why, in a sentence, to the thread that
//! called. Every pointer is checked for NULL, and for its address where numbers lie there. A handle
//! may be used by several threads: they wait for each other.
#![allow(
    unsafe_code,
    reason = "pointers come from C; everywhere else but in the machine's vector instructions it is denied"
)]

mod handles;
mod text;
mod units;

pub use handles::*;
pub use text::*;
pub use units::*;

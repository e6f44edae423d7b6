//! Is a frame replayed by recurrences equal to the frame of a machine that ticks cycle by cycle,
//! and how large is the error if not?

mod agreement;
mod binned;
mod channel;
#[path = "../machines/frames.rs"]
mod frames;
mod immediate;
mod laws;
mod machines;
mod memory;
mod parts;
mod scene;
mod sorters;
#[path = "../../../tests/tier/mod.rs"]
#[expect(dead_code, reason = "the tests of the program use the rest")]
mod tier;

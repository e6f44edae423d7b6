//! Is a frame that is replayed by recurrences the frame that a machine, ticking cycle by cycle,
//! would draw? How far off is it if not?

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

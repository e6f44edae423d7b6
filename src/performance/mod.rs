//! Performance: cycles, area and energy of recorded work.

pub mod answers;
pub mod clock;
pub mod cost;
pub mod cycles;
pub mod given;
pub mod recording;
pub mod roofline;
pub mod timings;

//! Co-simulation, and the pages of the book that a trace contains.

pub use comparison::cosim::{diff, live, scoreboard, words, work_file};

pub mod trace;

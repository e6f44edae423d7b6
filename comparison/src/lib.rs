//! The machine beside what it is compared with: scenes as words, the errors of a picture and of
//! every step beside `golden_model`, and records of each unit beside RTL. Everything here knows both
//! `rtl_model` and `golden_model`, which do not know each other.
//!
//! From top to bottom; each layer names only those below it (`tests/layering.rs`).

pub mod cosim;

pub mod accuracy;

pub mod hardware;

// Paths are the same as in `splatsim`.
use golden_model::{error, golden, input, output, scene};

//! The exact side of splatsim: scenes with their files, and the renderers in f64 that the machine
//! is compared with. It does not depend on `rtl_model`: the checker shares no code with the checked
//! code.
//!
//! From top to bottom; each layer names only those below it (`tests/layering.rs`).

pub mod golden;

pub mod sampling;

pub mod scene;

pub mod input;

pub mod output;

pub mod error;

#[cfg(test)]
#[path = "../../tests/shared_input/mod.rs"]
mod shared_input;

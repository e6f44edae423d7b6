//! splatsim: the bench around `rtl_model`. Floats, files, comparison and the command line live here; the machine does not.
//!
//! From top to bottom; each layer names only those below it (`tests/layering.rs`).

pub mod cli;

pub mod view;

pub mod explore;

pub mod run;

pub mod cosim;

pub mod performance;

pub mod accuracy;

pub mod hardware;

pub mod golden;

pub mod sampling;

pub mod scene;

pub mod output;

pub mod error;

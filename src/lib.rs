//! splatsim: the bench around `rtl_model`. Floats, files, comparison and the command line live here; the machine does not.

pub mod attribute;
pub mod chart;
pub mod cli;
pub mod colour;
pub mod compare;
pub mod cost;
pub mod cycles;
pub mod error;
pub mod explain;
pub mod fixed;
pub mod golden;
pub mod machines;
pub mod mixed;
pub mod pareto;
pub mod picture;
pub mod prove;
pub mod quantise;
pub mod ranges;
mod registers;
pub mod report;
pub mod run;
pub mod scene;
pub mod search;
pub mod stress;
pub mod sweep;
pub mod timings;
mod validate;

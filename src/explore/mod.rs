//! Explore: runs many machines or many scenes.

pub mod pareto;
mod screen;
pub mod search;
pub mod stress;
pub mod sweep;

//! Explore: runs many machines or many scenes.

pub mod pareto;
pub mod search;
pub mod stress;
pub mod sweep;

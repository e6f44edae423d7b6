//! Co-simulation: records on the wires between units, comparison with a device's records, and
//! single units that run live.

pub mod diff;
pub mod live;
pub mod scoreboard;
pub mod trace;
pub mod words;
pub mod work_file;

//! Co-simulation: what crosses the wires, a device's records beside it, and units that answer live.

pub mod diff;
pub mod live;
pub mod scoreboard;
pub mod trace;
pub mod words;

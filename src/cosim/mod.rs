//! Co-simulation: what crosses the wires, and a device's records beside it.

pub mod diff;
pub mod trace;

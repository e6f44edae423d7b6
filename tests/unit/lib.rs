//! The unit tests of `splatsim`, compiled as a test of this package: without optimisation, which
//! takes a quarter of the time (`profile.dev` in the workspace's `Cargo.toml`). `splatsim` sets
//! `test = false`.

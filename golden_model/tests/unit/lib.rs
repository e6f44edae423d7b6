//! The unit tests of `golden_model`, compiled as a test of this package: without optimisation, which
//! takes a quarter of the time (`profile.dev` in the workspace's `Cargo.toml`). `golden_model` sets
//! `test = false`.

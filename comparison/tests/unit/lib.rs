//! The unit tests of `comparison`, compiled as a test of this package: without optimisation, which
//! takes a quarter of the time (`profile.dev` in the workspace's `Cargo.toml`). `comparison` sets
//! `test = false`.

//! The unit tests of `rtl_model`, compiled as a test of this package: with less optimisation than
//! `rtl_model` itself, which takes a third of the time (`profile.dev` in the workspace's
//! `Cargo.toml`). `rtl_model` sets `test = false`.

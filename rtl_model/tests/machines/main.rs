//! Which machines can be built, what is said about those that cannot, and whether those that can
//! draw whatever they are given.

mod drawing;
mod elaboration;
mod frames;
mod memory;
mod mutation;
mod reach;
#[path = "../../../tests/tier/mod.rs"]
#[expect(dead_code, reason = "the tests of the program use the rest")]
mod tier;
mod timing;
mod working;

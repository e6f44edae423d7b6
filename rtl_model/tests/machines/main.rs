//! Which machines elaborate, which errors are reported for the others, and does every machine that
//! elaborates draw every frame?

mod blocks;
mod drawing;
mod elaboration;
mod frames;
mod lists;
mod memory;
mod mutation;
mod reach;
#[path = "../../../tests/tier/mod.rs"]
#[expect(dead_code, reason = "the tests of the program use the rest")]
mod tier;
mod timing;
mod weights;
mod working;

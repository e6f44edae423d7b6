//! Which machines can be built, what is said about those that cannot, and whether those that can draw whatever they are given.

mod drawing;
mod elaboration;
mod frames;
mod mutation;
mod reach;
mod timing;
mod working;

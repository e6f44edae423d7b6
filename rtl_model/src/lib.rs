//! The machine: a splatting pipeline on integers, bit-accurate, every format chosen at run time.
//!
//! ```text
//!            ┌──────── "setup" ────────┐
//! splats ─►  project ─────►  ellipse ─────►  raster ─────►  gauss ─────►  fragment ─────►  resolve ─► frame
//!            world point     normal,         forward         radial        at most l          blend,
//!            → camera        radius          differencing:   index →       fragments a        frame
//!            → pixel         → conic, box,   ellipse →       weight        pixel: add,        word
//!                            depth slopes    fragments                     insert, merge,       ▲
//!                                                                          evict ◄─► shade ◄────┘
//! ```
//! A splat is a Gaussian disc; its *footprint* is what it covers on the screen; a *contribution* is one splat at one pixel,
//! with a *radial index* r, a weight and a depth; a *fragment* is what contributions of one surface add up to; a pixel holds
//! at most l of them, its *layers*. (Zwicker et al., *Surface Splatting*, 2001; *EWA Splatting*, 2002.)
//!
//! Each unit is one file in `units/`: ports, formats, losses, function, laws. `num/` says what a number is and holds the one
//! lossy act, [`num::Fit`]. [`machine`] holds every format on one page and elaborates it; [`pipeline`] wires the units;
//! [`probe`] watches; [`frame`] is what the machine is given; `host.rs` knows the computer that all this runs on. [`work`] records what
//! happened, and [`timing`] makes cycles of that: the two meet nowhere else.
//!
//! Absent on purpose: floats in the datapath, files, clocks, printing, hash-ordered maps. Real numbers become words in
//! the bench, in one file; no unit counts time.

pub mod alone;
pub mod frame;
pub mod host;
pub mod machine;
pub mod num;
pub mod pipeline;
pub mod ports;
pub mod probe;
pub mod real;
pub mod timing;
pub mod units;
pub mod work;

pub use frame::Frame;
pub use machine::{Elaborated, Machine};
pub use pipeline::{Drawing, draw};

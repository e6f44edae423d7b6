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
//! A splat is a Gaussian disc; its *footprint* is what it covers on the screen; a *contribution* is
//! one splat at one pixel, with a *radial index* r, a weight and a depth; a *fragment* is what
//! contributions of one surface add up to; a pixel holds at most l of them, its *layers*. (Zwicker
//! et al., *Surface Splatting*, 2001; *EWA Splatting*, 2002.)
//!
//! Each folder is a layer, and names those below it alone:
//!
//! ```text
//! timing        recorded work → cycles
//! pipeline      elaborates a machine and wires the units; ports field by field; a unit by itself
//! units         one unit a file: ports, formats, legality, latency, parts, function, laws
//! graph         a unit's arithmetic as operators on wires, and passes over it
//! kernels       the host's fast versions of what units do
//! real          the same steps over real numbers: bounds, partial precision
//! functions     reciprocal, square root, table
//! elaboration   what is gathered while a description is checked: misfits, signals, parts; the microarchitecture
//! machine       the description: every format on one page; named machines
//! probe         what may be watched while the machine draws
//! work          what happened in a frame, recorded for timing
//! frame         what the machine is given for one picture
//! records       what crosses the ports between units
//! num           what a number is, and the one lossy act, Fit
//! ```
//! Function and time meet in recorded [`work`] and nowhere else.
//!
//! Absent on purpose: floats in the datapath, files, clocks, printing, hash-ordered maps. Real
//! numbers become words in the bench, in one file; no unit counts time.

pub mod elaboration;
pub mod frame;
pub mod functions;
pub mod graph;
pub mod kernels;
pub mod machine;
pub mod num;
pub mod pipeline;
pub mod probe;
pub mod real;
pub mod records;
pub mod timing;
pub mod units;
pub mod work;

pub use frame::Frame;
pub use machine::Machine;
pub use pipeline::{Drawing, Elaborated, draw};

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
//! A splat is a Gaussian disc; its *footprint* is the screen area that it covers. A *contribution*
//! is one splat at one pixel, with a *radial index* r, a weight and a depth. A *fragment* is the
//! sum of the contributions of one surface; a pixel holds at most l fragments, its *layers*.
//! (Zwicker et al., *Surface Splatting*, 2001; *EWA Splatting*, 2002.)
//!
//! Each folder is a layer, and names only those below it:
//!
//! ```text
//! timing        recorded work → cycles
//! pipeline      elaborates a machine and wires the units; ports field by field; unit replay
//! units         one file per unit: ports, formats, legality, latency, parts, function, laws
//! graph         a unit's arithmetic as operators on wires, and passes over it
//! kernels       the host's fast versions of the units
//! real          the same steps over real numbers: bounds, mixed precision
//! functions     reciprocal, square root, table
//! elaboration   checks a description: elaboration errors, signals, parts; the microarchitecture
//! machine       the description: every format on one page; named machines
//! probe         what can be observed while the machine draws
//! work          recorded work of a frame, for timing
//! frame         constants and splats of one picture
//! records       records that cross the ports between units
//! num           numbers, and the one lossy operation, Fit
//! ```
//! Function and time meet only in recorded [`work`].
//!
//! Deliberately absent: floats in the datapath, files, clocks, printing, hash-ordered maps. The
//! bench converts real numbers into words, in one file; units do not count time.

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

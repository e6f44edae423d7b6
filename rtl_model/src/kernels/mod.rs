//! Kernels: the host's fast versions of the units: vector instructions, and the fragments of a tile
//! packed for them. This is not hardware.
//!
//! Tests check each kernel against its unit on random machines: `the_unit_is_the_algorithm`
//! (fragment), and the laws of [`host`].

pub mod host;
mod packed;
mod queue;
mod tile;
mod weigh;

pub use packed::{Accumulator, Limits, PackedSlot, PackedSums, SumLimits, fits_32_bits};
pub use queue::{ONES, Queue, Queued};
pub use tile::{MAX_DEPTH_BITS, NO_MATCH, PackedTile};
pub use weigh::{Short, Weigh, WeighShape};

use crate::num::Lanes;
use std::marker::PhantomData;

/// Host path through a unit: compiled once per combination, with the same results.
pub trait HostPath: Copy {
    /// Whether every fit of an inner loop is an addition, a right shift and two limits.
    const SIMPLE_FITS: bool;
    /// Eight lanes of the host.
    type Lanes: Lanes;
    /// The host's word for a sum.
    type Accumulator: Accumulator;
}

/// A host path by its three choices.
#[derive(Clone, Copy, Debug)]
pub struct Path<const SIMPLE_FITS: bool, V, A>(PhantomData<(V, A)>);

impl<const SIMPLE_FITS: bool, V: Lanes, A: Accumulator> HostPath for Path<SIMPLE_FITS, V, A> {
    const SIMPLE_FITS: bool = SIMPLE_FITS;
    type Lanes = V;
    type Accumulator = A;
}

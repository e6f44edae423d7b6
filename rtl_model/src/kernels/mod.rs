//! Kernels: how the simulator's host draws fast: vector instructions, and a tile's fragments packed
//! for them. No hardware is here.
//!
//! Each is held to what its unit means, on random machines: `the_unit_is_the_algorithm` (fragment),
//! and the laws of [`host`].

pub mod host;
mod packed;
mod queue;
mod tile;
mod weigh;

pub use packed::{Accumulator, Limits, PackedSlot, PackedSums, SumLimits, fits_32_bits};
pub use queue::{ONES, Queue, Queued};
pub use tile::{MAX_DEPTH_BITS, NO_MATCH, Tile};
pub use weigh::{Short, Weigh, WeighShape};

use crate::num::Lanes;
use std::marker::PhantomData;

/// Path of the host through a unit: a choice that changes no bit, compiled once for each.
pub trait HostPath: Copy {
    /// Whether every hot fit is known to be an add, a shift to the right and two limits.
    const SIMPLE_FITS: bool;
    /// Eight lanes of the host.
    type Lanes: Lanes;
    /// The host's word for a sum.
    type Accumulator: Accumulator;
}

/// A path by its three choices.
#[derive(Clone, Copy, Debug)]
pub struct Path<const SIMPLE_FITS: bool, V, A>(PhantomData<(V, A)>);

impl<const SIMPLE_FITS: bool, V: Lanes, A: Accumulator> HostPath for Path<SIMPLE_FITS, V, A> {
    const SIMPLE_FITS: bool = SIMPLE_FITS;
    type Lanes = V;
    type Accumulator = A;
}

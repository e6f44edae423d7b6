//! Lists: what a machine that keeps tiles' lists from frame to frame has in memory between two frames.

use std::sync::Arc;

/// First and last column, first and last row.
pub type Sides = [[u16; 2]; 2];

/// Memory of a machine that keeps lists, between two frames.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct KeptLists {
    /// Frames so far.
    pub frames: u32,
    /// By splat, its box in the frame before; none if it was culled. Empty before the first frame.
    pub boxes: Vec<Option<Sides>>,
    /// By tile, by rows: splats and their keys in the frame before, in drawing order. Empty before
    /// the first frame.
    pub lists: Vec<Vec<(u32, i64)>>,
}

/// What a frame begins with: none if it is the first one.
pub type ListsBefore = Option<Arc<KeptLists>>;

//! Lists: tiles' lists of a machine that keeps them from frame to frame.

use serde::{Deserialize, Serialize};

/// The list of a tile.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MergedList {
    /// Splats in drawing order. Some of them may have departed: their box does not touch the tile,
    /// or they are culled.
    pub splats: Vec<u32>,
    /// Whether each is new in the list; the others were in it in the frame before.
    pub new: Vec<bool>,
}

impl MergedList {
    /// Number of entries that come from the frame before.
    pub fn stored(&self) -> usize {
        self.new.iter().filter(|new| !**new).count()
    }
}

/// The lists of a frame.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MergedLists {
    /// Side of a tile, pixels.
    pub tile_px: u32,
    /// Entries that are sorted at a time.
    pub chunk: u32,
    /// Whether the first chunk of each list has half as many entries.
    pub is_odd: bool,
    /// By rows.
    pub tiles: Vec<MergedList>,
}

impl MergedLists {
    /// Number of entries of a stored list's chunks, in order.
    pub fn chunks(&self, stored: usize) -> impl Iterator<Item = usize> + use<> {
        let chunk = self.chunk.max(2) as usize;
        let first = if self.is_odd { chunk / 2 } else { chunk };
        let mut left = stored;
        let mut next = first;
        std::iter::from_fn(move || {
            let own = next.min(left);
            (left, next) = (left - own, chunk);
            (own > 0).then_some(own)
        })
    }
}

/// Whether a box touches a tile.
pub fn touches(sides: [[u16; 2]; 2], tile: usize, tile_px: u32, columns: usize) -> bool {
    let at = [tile % columns, tile / columns].map(|at| at as u32 * tile_px);
    (sides.iter().zip(at))
        .all(|([first, last], at)| u32::from(*first) < at + tile_px && u32::from(*last) >= at)
}

/// The part of a box in a tile that it touches.
pub fn clipped(sides: [[u16; 2]; 2], tile: usize, tile_px: u32, columns: usize) -> [[u16; 2]; 2] {
    let at = [tile % columns, tile / columns].map(|at| at as u32 * tile_px);
    [0, 1].map(|axis| {
        let [first, last] = sides[axis];
        let end = (at[axis] + tile_px - 1).min(u16::MAX.into()) as u16;
        [
            first.max(at[axis].min(u16::MAX.into()) as u16),
            last.min(end),
        ]
    })
}

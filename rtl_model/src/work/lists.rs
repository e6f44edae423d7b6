//! Lists: tiles' lists of a machine that keeps them from frame to frame.

use super::Bins;
use serde::{Deserialize, Serialize};

/// First and last column, first and last row.
type Sides = [[u16; 2]; 2];

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

    /// The splats by tiles with this side, each tile in the order of the list around it. `drawn`
    /// returns the entry of a splat and its box; none if the splat is culled. Splats that have
    /// departed from a list are left out.
    pub fn bins(
        &self,
        size_px: [u32; 2],
        side_px: usize,
        drawn: impl Fn(u32) -> Option<(u32, Sides)>,
    ) -> Bins {
        let columns = size_px[0].div_ceil(self.tile_px) as usize;
        let (drawn, tile_px) = (&drawn, self.tile_px);
        let lists = self.tiles.iter().enumerate();
        let listed = lists.flat_map(move |(tile, list)| {
            let here = list.splats.iter().filter_map(|splat| drawn(*splat));
            here.filter(move |(_, sides)| touches(*sides, tile, tile_px, columns))
                .map(move |(entry, sides)| (entry, clipped(sides, tile, tile_px, columns)))
        });
        Bins::new(size_px, side_px, listed)
    }
}

/// Whether a box touches a tile.
pub fn touches(sides: Sides, tile: usize, tile_px: u32, columns: usize) -> bool {
    let at = [tile % columns, tile / columns].map(|at| at as u32 * tile_px);
    (sides.iter().zip(at))
        .all(|([first, last], at)| u32::from(*first) < at + tile_px && u32::from(*last) >= at)
}

/// The part of a box in a tile that it touches.
fn clipped(sides: Sides, tile: usize, tile_px: u32, columns: usize) -> Sides {
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

//! Lists: a tile's list is kept from frame to frame, and is almost sorted when a frame begins
//! (Neo, arXiv 2511.12930).
//!
//! ```text
//! list of the frame before, its keys ─► sort chunk by chunk, one pass ─┐
//! splats whose box did not touch the tile before ─► sort ──────────────┴─► merge ─► list ─► drawn
//!                                                                                    └─► without the departed, new keys ─► next frame
//! ```
//! An entry of the list before moves by less than a chunk per frame, and its key is one frame old.
//! What remains unsorted is an error of the method. In odd frames the boundaries of chunks are
//! moved by half a chunk, so that an entry can cross them.
//!
//! Laws (tests/incremental.rs of the bench): `a_first_frame_is_sorted_as_by_radix`,
//! `lists_follow_their_specification`.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// First and last column, first and last row.
pub type Sides = [[u16; 2]; 2];

/// How lists are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ListShape {
    /// Side of a tile, pixels.
    pub tile_px: u32,
    /// Entries that are sorted at a time.
    pub chunk: u32,
    /// Whether the greatest key is drawn first.
    pub farthest_first: bool,
}

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

/// A drawn splat of a frame: its index, box and key.
pub type Drawn = (u32, Sides, i64);

/// Whether a box touches a tile.
pub fn touches(sides: Sides, tile: usize, tile_px: u32, columns: usize) -> bool {
    let at = [tile % columns, tile / columns].map(|at| at as u32 * tile_px);
    (sides.iter().zip(at))
        .all(|([first, last], at)| u32::from(*first) < at + tile_px && u32::from(*last) >= at)
}

/// The part of a box in a tile that it touches.
pub fn clipped(sides: Sides, tile: usize, tile_px: u32, columns: usize) -> Sides {
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

/// Tiles per row, and rows.
fn tiles_of(size_px: [u32; 2], tile_px: u32) -> [usize; 2] {
    size_px.map(|size| size.div_ceil(tile_px) as usize)
}

impl ListShape {
    /// Brings entries into the order of their keys; equal keys stay in input order.
    fn sort(&self, entries: &mut [(u32, i64)]) {
        entries.sort_unstable_by_key(|(splat, key)| (self.rank(*key), *splat));
    }

    /// A number that ascends in drawing order.
    fn rank(&self, key: i64) -> i64 {
        if self.farthest_first { -key } else { key }
    }

    /// Merges two lists by their heads: the lesser key first, of equal ones the stored one.
    fn merge(&self, stored: &[(u32, i64)], new: &[(u32, i64)]) -> MergedList {
        let mut merged = MergedList {
            splats: Vec::with_capacity(stored.len() + new.len()),
            new: Vec::with_capacity(stored.len() + new.len()),
        };
        let (mut stored, mut new) = (stored.iter().peekable(), new.iter().peekable());
        loop {
            let is_new = match (stored.peek(), new.peek()) {
                (Some(one), Some(other)) => self.rank(other.1) < self.rank(one.1),
                (one, _) => one.is_none(),
            };
            let head = if is_new { new.next() } else { stored.next() };
            let Some((splat, _)) = head else {
                return merged;
            };
            merged.splats.push(*splat);
            merged.new.push(is_new);
        }
    }
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

impl KeptLists {
    /// The lists of the next frame, whose drawn splats are given in input order.
    pub fn merged(&self, shape: ListShape, size_px: [u32; 2], drawn: &[Drawn]) -> MergedLists {
        let [columns, rows] = tiles_of(size_px, shape.tile_px);
        let mut lists = MergedLists {
            tile_px: shape.tile_px,
            chunk: shape.chunk,
            is_odd: self.frames % 2 == 1,
            tiles: Vec::with_capacity(columns * rows),
        };
        let mut new: Vec<Vec<(u32, i64)>> = vec![Vec::new(); columns * rows];
        for &(splat, sides, key) in drawn {
            let before = self.boxes.get(splat as usize).copied().flatten();
            let [across, down] = sides.map(|side| side.map(|at| u32::from(at) / shape.tile_px));
            for row in down[0]..=down[1] {
                for column in across[0]..=across[1] {
                    let tile = row as usize * columns + column as usize;
                    if !before.is_some_and(|before| touches(before, tile, shape.tile_px, columns)) {
                        new[tile].push((splat, key));
                    }
                }
            }
        }
        for (tile, mut new) in new.into_iter().enumerate() {
            let mut stored = self.lists.get(tile).cloned().unwrap_or_default();
            let mut left = &mut stored[..];
            for chunk in lists.chunks(left.len()) {
                let (own, rest) = left.split_at_mut(chunk);
                shape.sort(own);
                left = rest;
            }
            shape.sort(&mut new);
            lists.tiles.push(shape.merge(&stored, &new));
        }
        lists
    }

    /// The memory after the frame with these lists, of a scene with this number of splats.
    pub fn after(
        &self,
        lists: &MergedLists,
        size_px: [u32; 2],
        drawn: &[Drawn],
        splats: usize,
    ) -> KeptLists {
        let [columns, _] = tiles_of(size_px, lists.tile_px);
        let mut now: Vec<Option<(Sides, i64)>> = vec![None; splats];
        for &(splat, sides, key) in drawn {
            now[splat as usize] = Some((sides, key));
        }
        let left = |(tile, list): (usize, &MergedList)| {
            let of = |splat: &u32| {
                let (sides, key) = now.get(*splat as usize).copied().flatten()?;
                touches(sides, tile, lists.tile_px, columns).then_some((*splat, key))
            };
            list.splats.iter().filter_map(of).collect()
        };
        KeptLists {
            frames: self.frames + 1,
            lists: lists.tiles.iter().enumerate().map(left).collect(),
            boxes: now.into_iter().map(|now| Some(now?.0)).collect(),
        }
    }
}

/// What a frame begins with: none if it is the first one.
pub type ListsBefore = Option<Arc<KeptLists>>;

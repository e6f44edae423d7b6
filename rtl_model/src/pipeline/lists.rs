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

use crate::frame::KeptLists;
use crate::frame::lists::Sides;
use crate::work::lists::touches;
use crate::work::{MergedList, MergedLists};

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

/// A drawn splat of a frame: its index, box and key.
pub type Drawn = (u32, Sides, i64);

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

/// The lists of the next frame, whose drawn splats are given in input order.
pub fn merged(
    before: &KeptLists,
    shape: ListShape,
    size_px: [u32; 2],
    drawn: &[Drawn],
) -> MergedLists {
    let [columns, rows] = tiles_of(size_px, shape.tile_px);
    let mut lists = MergedLists {
        tile_px: shape.tile_px,
        chunk: shape.chunk,
        is_odd: before.frames % 2 == 1,
        tiles: Vec::with_capacity(columns * rows),
    };
    let mut new: Vec<Vec<(u32, i64)>> = vec![Vec::new(); columns * rows];
    for &(splat, sides, key) in drawn {
        let box_before = before.boxes.get(splat as usize).copied().flatten();
        let [across, down] = sides.map(|side| side.map(|at| u32::from(at) / shape.tile_px));
        for row in down[0]..=down[1] {
            for column in across[0]..=across[1] {
                let tile = row as usize * columns + column as usize;
                if !box_before.is_some_and(|sides| touches(sides, tile, shape.tile_px, columns)) {
                    new[tile].push((splat, key));
                }
            }
        }
    }
    for (tile, mut new) in new.into_iter().enumerate() {
        let mut stored = before.lists.get(tile).cloned().unwrap_or_default();
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
    before: &KeptLists,
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
        frames: before.frames + 1,
        lists: lists.tiles.iter().enumerate().map(left).collect(),
        boxes: now.into_iter().map(|now| Some(now?.0)).collect(),
    }
}

//! Lists: the order of a machine that keeps tiles' lists from frame to frame, with exact keys
//! (docs/book/incremental-sort.md).
//!
//! ```text
//! frames before: boxes, keys ─► [ListMemory] ─┬─► sorted chunk by chunk ─┐
//! this frame: boxes, keys ────────────────┴─► new splats, sorted ────┴─► merged ─► [TileOrder]
//! ```
//! The keys of `golden` are exact, so its lists are its own: where the machine's keys are equal or
//! swapped, a list can differ for several frames.

use super::footprint::{self, Footprint, Weights};
use crate::scene::{Camera, FramePath, Scene};
use rayon::prelude::*;
use std::cmp::Ordering;
use std::ops::Range;

/// How lists are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeptLists {
    /// Side of a tile, pixels: a multiple of 16.
    pub tile_px: usize,
    /// Entries of a stored list that are sorted at a time; half as many in the first chunk of odd
    /// frames.
    pub chunk: usize,
    /// Whether lists begin with the greatest depth.
    pub farthest_first: bool,
}

/// A drawn splat: columns and rows of its box, and its key.
#[derive(Clone, Debug, PartialEq)]
pub struct Listed {
    /// Index of the splat in the scene.
    pub splat: u32,
    /// Columns and rows of its box.
    pub sides: [Range<u32>; 2],
    /// Its key in the sort.
    pub key: f64,
}

/// Order of drawing in each tile: indices among the drawn splats of the frame, front to back.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TileOrder {
    tile_px: usize,
    columns: usize,
    tiles: Vec<Vec<u32>>,
}

impl TileOrder {
    /// The splats of the list around a pixel.
    pub fn around(&self, [x, y]: [usize; 2]) -> &[u32] {
        &self.tiles[y / self.tile_px * self.columns + x / self.tile_px]
    }
}

/// Boxes and lists of the frames so far, for a sequence that is drawn frame by frame.
#[derive(Clone, Debug, Default)]
pub struct ListMemory {
    frames: usize,
    boxes: Vec<Option<[Range<u32>; 2]>>,
    lists: Vec<Vec<(u32, f64)>>,
}

impl ListMemory {
    /// Lists the splats of the next frame, and keeps the lists for the frame after it. The drawn
    /// splats are in any order.
    pub(crate) fn next(
        &mut self,
        kept: &KeptLists,
        size_px: [usize; 2],
        splats: usize,
        drawn: &[Listed],
    ) -> TileOrder {
        let side = kept.tile_px;
        let [columns, rows] = size_px.map(|size| size.div_ceil(side));
        let by_key = |a: &(u32, f64), b: &(u32, f64)| kept.compare(a.1, b.1).then(a.0.cmp(&b.0));
        let mut now = vec![None; splats];
        for (index, listed) in drawn.iter().enumerate() {
            now[listed.splat as usize] = Some(index);
        }
        let offset = if self.frames.is_multiple_of(2) {
            0
        } else {
            kept.chunk / 2
        };
        self.lists.resize(columns * rows, Vec::new());
        for stored in &mut self.lists {
            let first = offset.min(stored.len());
            let (head, rest) = stored.split_at_mut(first);
            head.sort_by(by_key);
            rest.chunks_mut(kept.chunk)
                .for_each(|chunk| chunk.sort_by(by_key));
        }
        let mut fresh = vec![Vec::new(); columns * rows];
        for listed in drawn {
            let before = self
                .boxes
                .get(listed.splat as usize)
                .and_then(Option::as_ref);
            for tile in tiles_of(&listed.sides, side, columns) {
                let was_there = before
                    .is_some_and(|sides| tiles_of(sides, side, columns).any(|own| own == tile));
                if !was_there {
                    fresh[tile].push((listed.splat, listed.key));
                }
            }
        }
        let mut tiles = Vec::with_capacity(columns * rows);
        for (tile, (stored, mut fresh)) in self.lists.iter_mut().zip(fresh).enumerate() {
            fresh.sort_by(by_key);
            let mut merged = Vec::with_capacity(stored.len() + fresh.len());
            let mut fresh = fresh.into_iter().peekable();
            for &entry in stored.iter() {
                while let Some(new) =
                    fresh.next_if(|new| kept.compare(new.1, entry.1) == Ordering::Less)
                {
                    merged.push(new.0);
                }
                merged.push(entry.0);
            }
            merged.extend(fresh.map(|new| new.0));
            // Without the departed ones.
            let left = merged.into_iter().filter_map(|splat| now[splat as usize]);
            let left = left.filter(|index| {
                tiles_of(&drawn[*index].sides, side, columns).any(|own| own == tile)
            });
            let order: Vec<usize> = left.collect();
            *stored = order
                .iter()
                .map(|index| (drawn[*index].splat, drawn[*index].key))
                .collect();
            let mut order: Vec<u32> = order.into_iter().map(|index| index as u32).collect();
            if kept.farthest_first {
                order.reverse();
            }
            tiles.push(order);
        }
        let boxes = now
            .into_iter()
            .map(|index| Some(drawn[index?].sides.clone()));
        self.boxes = boxes.collect();
        self.frames += 1;
        TileOrder {
            tile_px: side,
            columns,
            tiles,
        }
    }
}

impl KeptLists {
    fn compare(&self, one: f64, other: f64) -> Ordering {
        let order = one.total_cmp(&other);
        if self.farthest_first {
            order.reverse()
        } else {
            order
        }
    }

    /// The order of a frame of a scene, with the footprints of its drawn splats; None if the scene
    /// is not sorted. Without a memory of the frames before, they are set up.
    pub(super) fn order(
        &self,
        scene: &Scene,
        (least_weight, memory): (f64, Option<&mut ListMemory>),
        footprints: &[Footprint],
    ) -> Option<TileOrder> {
        let of = |footprint: &Footprint| Listed {
            splat: footprint.splat,
            sides: [footprint.columns.clone(), footprint.rows.clone()],
            key: footprint.z(),
        };
        let now: Vec<Listed> = footprints.iter().map(of).collect();
        if let Some(memory) = memory {
            let size_px = [scene.image.width, scene.image.height];
            return scene
                .is_sorted()
                .then(|| memory.next(self, size_px, scene.splats.len(), &now));
        }
        let before = |earlier: &Scene| {
            let view = earlier.view();
            let drawn = (0..earlier.splats.len())
                .into_par_iter()
                .filter_map(|splat| {
                    let footprint =
                        footprint::set_up(earlier, &view, splat, Weights::at_least(least_weight));
                    footprint.ok().as_ref().map(of)
                });
            drawn.collect()
        };
        self.order_after(scene, before, &now)
    }

    /// The order of a frame after those before it, whose drawn splats `before` returns.
    pub fn order_after(
        &self,
        scene: &Scene,
        mut before: impl FnMut(&Scene) -> Vec<Listed>,
        now: &[Listed],
    ) -> Option<TileOrder> {
        if !scene.is_sorted() {
            return None;
        }
        let size_px = [scene.image.width, scene.image.height];
        let splats = scene.splats.len();
        let mut memory = ListMemory::default();
        scene.each_before(|earlier| {
            let drawn = before(earlier);
            memory.next(self, size_px, splats, &drawn);
        });
        Some(memory.next(self, size_px, splats, now))
    }
}

/// Every tile that a box touches.
fn tiles_of(sides: &[Range<u32>; 2], side: usize, columns: usize) -> impl Iterator<Item = usize> {
    let [across, down] = sides.clone().map(|side_px| {
        let (first, end) = (side_px.start as usize, side_px.end as usize);
        if first < end {
            first / side..end.div_ceil(side)
        } else {
            0..0
        }
    });
    down.flat_map(move |row| across.clone().map(move |column| row * columns + column))
}

impl Scene {
    /// Calls `visit` with each frame before this one, if it is a frame of a sequence.
    pub fn each_before(&self, mut visit: impl FnMut(&Scene)) {
        let before: Vec<Camera> = self.cameras_before().to_vec();
        let Some(path) = self.path.as_ref().filter(|_| !before.is_empty()) else {
            return;
        };
        let mut earlier = self.clone();
        for (frame, camera) in before.into_iter().enumerate() {
            earlier.camera = camera;
            earlier.path = Some(FramePath {
                cameras: path.cameras.clone(),
                frame,
            });
            visit(&earlier);
        }
    }
}

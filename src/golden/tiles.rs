//! Tiles: hands each pixel its contributions in splat order, tile by tile, so that a tile's fragments stay in the cache.
//!
//! Bands of tiles are drawn in parallel. A pixel depends on its own contributions alone and counts are integers, so the
//! result is the same at any number of threads.

use std::ops::Range;

use rayon::prelude::*;

use super::footprint::{self, Cull, Footprint};
use super::fragments::Fragment;
use super::{Culled, Outcomes, Rendering};
use crate::picture::Picture;
use crate::scene::Scene;

/// Tiles are squares of this many pixels: three layers of such a tile fit a second-level cache.
const TILE_PX: usize = 16;
/// Pixels that a painter needs room for.
pub(super) const PIXELS_IN_A_TILE: usize = TILE_PX * TILE_PX;

/// Makes pixels out of contributions, one tile at a time.
pub(super) trait Painter {
    /// Takes a contribution to a pixel of the tile.
    fn take(&mut self, pixel: usize, contribution: Fragment);
    /// The colour of a pixel that took something; the pixel is then as new.
    fn finish(&mut self, pixel: usize) -> [f64; 4];
    /// What became of all contributions so far.
    fn outcomes(&self) -> Outcomes;
}

/// Draws the scene, each band of tiles with a painter of its own.
pub(super) fn draw<P: Painter>(scene: &Scene, background: [f64; 4], painter: impl Fn() -> P + Sync) -> Rendering {
    let (footprints, culled) = set_up(scene);
    let (width, height) = (scene.image.width, scene.image.height);
    let bands = bands(&footprints, height);
    let mut rgba = vec![background; width * height];
    let mut covered = vec![false; width * height];
    let (fragments, outcomes) = rgba
        .par_chunks_mut(width * TILE_PX)
        .zip(covered.par_chunks_mut(width * TILE_PX))
        .zip(&bands)
        .enumerate()
        .filter(|(_, (_, members))| !members.is_empty())
        .map(|(index, ((rgba, covered), members))| {
            let (top, painter) = (index * TILE_PX, painter());
            let mut band = Band { top, width, rgba, covered, painter, fragments: 0, most_in_a_pixel: 0 };
            band.draw(&footprints, members);
            let outcomes = Outcomes { most_in_a_pixel: band.most_in_a_pixel, ..band.painter.outcomes() };
            (band.fragments, outcomes)
        })
        .reduce(Default::default, |a, b| (a.0 + b.0, a.1.and(b.1)));
    Rendering { picture: Picture { width, height, rgba, covered }, culled, fragments, outcomes }
}

/// The footprints of all splats that are drawn, in splat order, and a count of the others.
fn set_up(scene: &Scene) -> (Vec<Footprint>, Culled) {
    let view = scene.view();
    let set_up = |index| footprint::set_up(scene, &view, index);
    let results: Vec<Result<Footprint, Cull>> = (0..scene.splats.len()).into_par_iter().map(set_up).collect();
    let mut culled = Culled::default();
    let drawn = results.into_iter().filter_map(|result| result.map_err(|reason| culled.count(reason)).ok());
    (drawn.collect(), culled)
}

impl Culled {
    fn count(&mut self, reason: Cull) {
        *match reason {
            Cull::Near => &mut self.near,
            Cull::Outside => &mut self.outside,
            Cull::Backface => &mut self.backface,
            Cull::Faint => &mut self.faint,
        } += 1;
    }
}

/// For each band of tiles the indices of the footprints that reach into it, ascending.
fn bands(footprints: &[Footprint], height: usize) -> Vec<Vec<u32>> {
    let mut bands = vec![Vec::new(); height.div_ceil(TILE_PX)];
    for (index, footprint) in footprints.iter().enumerate() {
        for band in tiles(&footprint.rows) {
            bands[band].push(index as u32);
        }
    }
    bands
}

/// The tiles that hold some of these pixels, along one axis.
fn tiles(pixels: &Range<u32>) -> Range<usize> {
    let (first, end) = (pixels.start as usize, pixels.end as usize);
    if first == end { 0..0 } else { first / TILE_PX..end.div_ceil(TILE_PX) }
}

/// The part of a range that lies in the tile that begins at `start`.
fn clip(pixels: &Range<u32>, start: usize) -> Range<u32> {
    pixels.start.max(start as u32)..pixels.end.min((start + TILE_PX) as u32)
}

/// One row of tiles.
struct Band<'a, P> {
    /// First row of pixels.
    top: usize,
    width: usize,
    rgba: &'a mut [[f64; 4]],
    covered: &'a mut [bool],
    painter: P,
    fragments: u64,
    most_in_a_pixel: u64,
}

impl<P: Painter> Band<'_, P> {
    fn draw(&mut self, footprints: &[Footprint], members: &[u32]) {
        let mut columns = vec![Vec::new(); self.width.div_ceil(TILE_PX)];
        for &member in members {
            for column in tiles(&footprints[member as usize].columns) {
                columns[column].push(member);
            }
        }
        for (column, members) in columns.iter().enumerate() {
            let mut arrivals = [0; PIXELS_IN_A_TILE];
            for &member in members {
                self.scatter(column * TILE_PX, &footprints[member as usize], &mut arrivals);
            }
            self.gather(column * TILE_PX, &arrivals);
        }
    }

    /// Gives the painter what a footprint contributes to the tile whose first column is `left`.
    fn scatter(&mut self, left: usize, footprint: &Footprint, arrivals: &mut [u64; PIXELS_IN_A_TILE]) {
        let columns = clip(&footprint.columns, left);
        for y in clip(&footprint.rows, self.top) {
            let row = footprint.row(y);
            let first = (y as usize - self.top) * TILE_PX;
            for x in columns.clone() {
                if let Some(contribution) = row.at(x) {
                    let pixel = first + (x as usize - left);
                    arrivals[pixel] += 1;
                    self.painter.take(pixel, Fragment::new(footprint, &contribution));
                }
            }
        }
    }

    /// Collects the tile's finished pixels.
    fn gather(&mut self, left: usize, arrivals: &[u64; PIXELS_IN_A_TILE]) {
        for (pixel, &count) in arrivals.iter().enumerate().filter(|(_, count)| **count > 0) {
            let index = pixel / TILE_PX * self.width + left + pixel % TILE_PX;
            self.rgba[index] = self.painter.finish(pixel);
            self.covered[index] = true;
            self.fragments += count;
            self.most_in_a_pixel = self.most_in_a_pixel.max(count);
        }
    }
}

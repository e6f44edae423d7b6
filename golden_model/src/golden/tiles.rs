//! Tiles: passes contributions to each pixel in splat order, tile by tile, so that a tile's
//! fragments stay in the cache.
//!
//! Bands of tiles are drawn in parallel. A pixel depends only on its own contributions and counts
//! are integers, so the result is the same for any number of threads.

use std::ops::Range;

use rayon::prelude::*;

use super::footprint::{self, Cull, Footprint, Weights};
use super::fragments::Fragment;
use super::lists::{KeptLists, ListMemory, TileOrder};
use super::shade::Shader;
use super::{Culled, Outcomes, Rendering, Rules};
use crate::output::picture::Picture;
use crate::scene::{Image, Scene, View};

/// Tiles are squares with this side in pixels: three layers of such a tile fit into a second-level
/// cache.
const TILE_PX: usize = 16;
/// Pixels of a tile.
pub const PIXELS_IN_A_TILE: usize = TILE_PX * TILE_PX;

/// A primitive that covers pixels and contributes to each of them.
pub trait Cover: Sync {
    /// Contribution to one pixel.
    type Contribution;
    /// Pixel columns and rows of its box, within the picture.
    fn sides(&self) -> [Range<u32>; 2];
    /// Generates the contributions to these columns of these rows, which are inside the box.
    fn contribute(
        &self,
        columns: Range<u32>,
        rows: Range<u32>,
        take: impl FnMut([u32; 2], Self::Contribution),
    );
}

/// Computes pixels from contributions, one tile at a time.
pub trait Painter {
    /// Contribution to one pixel.
    type Contribution;
    /// Takes a contribution to a pixel of the tile.
    fn take(&mut self, pixel: usize, contribution: Self::Contribution);
    /// Returns the colour of a pixel with contributions, and resets the pixel.
    fn finish(&mut self, pixel: usize) -> [f64; 4];
    /// Outcomes of all contributions so far.
    fn outcomes(&self) -> Outcomes;
}

/// Draws the scene with these weights, with normals turned or not, with lists that are
/// kept from frame to frame or not; each band of tiles has its own painter.
pub(super) fn draw<P: Painter<Contribution = Fragment>>(
    scene: &Scene,
    shader: &Shader,
    (turn_normals, lists): (bool, Option<(KeptLists, Option<&mut ListMemory>)>),
    weights: Weights,
    painter: impl Fn() -> P + Sync,
) -> Rendering {
    let (image, background) = (&scene.image, shader.background());
    if scene.ellipsoids.is_some() {
        let (footprints, culled) = footprints(scene, shader, turn_normals, weights);
        let order = lists
            .and_then(|(lists, memory)| lists.order(scene, (weights.least, memory), &footprints));
        return Rendering {
            culled,
            ..fill_ordered(image, &footprints, order.as_ref(), background, painter)
        };
    }
    // Discs are neither lit nor sorted before they are drawn.
    let rules = &SetupRules {
        scene,
        view: scene.view(),
        weights,
        turn_normals,
    };
    let (discs, culled) = rules.all(
        |Footprint {
             splat,
             columns,
             rows,
             ..
         }| {
            let [columns, rows] = [columns, rows].map(|side| [side.start as u16, side.end as u16]);
            TileDisc {
                rules,
                splat,
                columns,
                rows,
            }
        },
    );
    Rendering {
        culled,
        ..fill(image, &discs, background, painter)
    }
}

/// Draws Gaussians whose blocks of pixels are tested.
pub(super) fn draw_tested<P: Painter<Contribution = Fragment>>(
    scene: &Scene,
    shader: &Shader,
    (rules, memory): (&Rules, Option<&mut ListMemory>),
    painter: impl Fn() -> P + Sync,
) -> Rendering {
    let weights = Weights::of(scene, rules);
    let (mut footprints, culled) = footprints(scene, shader, rules.turn_normals, weights);
    let order = (rules.lists)
        .and_then(|lists| lists.order(scene, (scene.least_weight(), memory), &footprints));
    for footprint in &mut footprints {
        footprint.blocks = rules.blocks;
    }
    Rendering {
        culled,
        ..fill_ordered(
            &scene.image,
            &footprints,
            order.as_ref(),
            shader.background(),
            painter,
        )
    }
}

/// How splats are set up.
struct SetupRules<'a> {
    scene: &'a Scene,
    view: View,
    weights: Weights,
    turn_normals: bool,
}

impl SetupRules<'_> {
    /// The footprint of a splat, or why it is culled.
    fn footprint(&self, splat: usize) -> Result<Footprint, Cull> {
        let mut footprint = footprint::set_up(self.scene, &self.view, splat, self.weights)?;
        if self.turn_normals {
            footprint.turn_normal();
        }
        Ok(footprint)
    }

    /// `kept` of the footprints of all drawn splats, in splat order, and a count of the culled
    /// ones.
    fn all<T: Send>(&self, kept: impl Fn(Footprint) -> T + Send + Sync) -> (Vec<T>, Culled) {
        let of = |splat| self.footprint(splat).map(&kept);
        let results: Vec<Result<T, Cull>> = (0..self.scene.splats.len())
            .into_par_iter()
            .map(of)
            .collect();
        let mut culled = Culled::default();
        let drawn = results
            .into_iter()
            .filter_map(|result| result.map_err(|reason| culled.count(reason)).ok());
        (drawn.collect(), culled)
    }
}

/// A drawn disc, as the pixels of its box. Its setup is repeated for each tile: that takes less
/// time than to store and fetch ten times as many bytes for all splats.
struct TileDisc<'a> {
    rules: &'a SetupRules<'a>,
    splat: u32,
    /// A picture has at most 2^14 columns and rows.
    columns: [u16; 2],
    rows: [u16; 2],
}

impl Cover for TileDisc<'_> {
    type Contribution = Fragment;

    fn sides(&self) -> [Range<u32>; 2] {
        [self.columns, self.rows].map(|[start, end]| start.into()..end.into())
    }

    fn contribute(
        &self,
        columns: Range<u32>,
        rows: Range<u32>,
        take: impl FnMut([u32; 2], Fragment),
    ) {
        if let Ok(footprint) = self.rules.footprint(self.splat as usize) {
            footprint.contribute(columns, rows, take);
        }
    }
}

/// The footprints of all drawn splats, lit and sorted if the scene requires it, and a count of the
/// culled ones.
pub(super) fn footprints(
    scene: &Scene,
    shader: &Shader,
    turn_normals: bool,
    weights: Weights,
) -> (Vec<Footprint>, Culled) {
    let rules = SetupRules {
        scene,
        view: scene.view(),
        weights,
        turn_normals,
    };
    let (mut footprints, culled) = rules.all(|footprint| footprint);
    put_in_order(scene, shader, &mut footprints);
    (footprints, culled)
}

/// Lights and sorts footprints, if the scene's splats are lit or sorted before they are drawn.
pub(super) fn put_in_order(scene: &Scene, shader: &Shader, footprints: &mut [Footprint]) {
    let Some(ellipsoids) = &scene.ellipsoids else {
        return;
    };
    if ellipsoids.preshaded {
        footprints
            .par_iter_mut()
            .for_each(|footprint| footprint.rgb = shader.emission(footprint));
    }
    if ellipsoids.sorted {
        footprints.sort_by(|a, b| a.z().total_cmp(&b.z()));
    }
}

/// Draws footprints, in their order.
pub(crate) fn fill<C: Cover, P: Painter<Contribution = C::Contribution>>(
    image: &Image,
    footprints: &[C],
    background: [f64; 4],
    painter: impl Fn() -> P + Sync,
) -> Rendering {
    fill_ordered(image, footprints, None, background, painter)
}

/// Fills all tiles, with an order of its own in each tile, if one is given.
pub fn fill_ordered<C: Cover, P: Painter<Contribution = C::Contribution>>(
    image: &Image,
    footprints: &[C],
    order: Option<&TileOrder>,
    background: [f64; 4],
    painter: impl Fn() -> P + Sync,
) -> Rendering {
    let (width, height) = (image.width, image.height);
    let bands = bands(footprints, height);
    let mut rgba = vec![background; width * height];
    let mut covered = vec![false; width * height];
    let (fragments, outcomes) = rgba
        .par_chunks_mut(width * TILE_PX)
        .zip(covered.par_chunks_mut(width * TILE_PX))
        .zip(&bands)
        .enumerate()
        .with_max_len(1)
        .filter(|(_, (_, members))| !members.is_empty())
        .map(|(index, ((rgba, covered), members))| {
            let (top, painter) = (index * TILE_PX, painter());
            let mut band = Band {
                top,
                width,
                rgba,
                covered,
                painter,
                fragments: 0,
                most_in_a_pixel: 0,
            };
            band.draw(footprints, members, order);
            let outcomes = Outcomes {
                most_in_a_pixel: band.most_in_a_pixel,
                ..band.painter.outcomes()
            };
            (band.fragments, outcomes)
        })
        .reduce(Default::default, |a, b| (a.0 + b.0, a.1.and(b.1)));
    Rendering {
        picture: Picture {
            width,
            height,
            rgba,
            covered,
        },
        culled: Culled::default(),
        fragments,
        outcomes,
    }
}

impl Culled {
    fn count(&mut self, reason: Cull) {
        *match reason {
            Cull::Near => &mut self.near,
            Cull::Outside => &mut self.outside,
            Cull::Transparent => &mut self.transparent,
            Cull::Backface => &mut self.backface,
            Cull::Faint => &mut self.faint,
        } += 1;
    }
}

/// For each band of tiles the indices of the footprints that reach into it, ascending.
fn bands<C: Cover>(footprints: &[C], height: usize) -> Vec<Vec<u32>> {
    let mut bands = vec![Vec::new(); height.div_ceil(TILE_PX)];
    for (index, footprint) in footprints.iter().enumerate() {
        let [_, rows] = footprint.sides();
        for band in tiles(&rows) {
            bands[band].push(index as u32);
        }
    }
    bands
}

/// The tiles that contain these pixels, along one axis.
fn tiles(pixels: &Range<u32>) -> Range<usize> {
    let (first, end) = (pixels.start as usize, pixels.end as usize);
    if first == end {
        0..0
    } else {
        first / TILE_PX..end.div_ceil(TILE_PX)
    }
}

/// The part of a range inside the tile that begins at `start`.
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
    fn draw<C: Cover<Contribution = P::Contribution>>(
        &mut self,
        footprints: &[C],
        members: &[u32],
        order: Option<&TileOrder>,
    ) {
        let mut columns = vec![Vec::new(); self.width.div_ceil(TILE_PX)];
        for &member in members {
            let [across, _] = footprints[member as usize].sides();
            for column in tiles(&across) {
                columns[column].push(member);
            }
        }
        for (column, members) in columns.iter().enumerate() {
            let listed: Vec<u32>;
            let members = match order {
                None => members,
                // Members are in ascending order.
                Some(order) => {
                    let all = order.around([column * TILE_PX, self.top]).iter().copied();
                    listed = all
                        .filter(|member| members.binary_search(member).is_ok())
                        .collect();
                    &listed
                }
            };
            let mut arrivals = [0; PIXELS_IN_A_TILE];
            for &member in members {
                self.scatter(
                    column * TILE_PX,
                    &footprints[member as usize],
                    &mut arrivals,
                );
            }
            self.gather(column * TILE_PX, &arrivals);
        }
    }

    /// Passes the contributions of a footprint to the tile whose first column is `left` to the
    /// painter.
    fn scatter<C: Cover<Contribution = P::Contribution>>(
        &mut self,
        left: usize,
        footprint: &C,
        arrivals: &mut [u64; PIXELS_IN_A_TILE],
    ) {
        let [columns, rows] = footprint.sides();
        footprint.contribute(
            clip(&columns, left),
            clip(&rows, self.top),
            |[x, y], contribution| {
                let pixel = (y as usize - self.top) * TILE_PX + (x as usize - left);
                arrivals[pixel] += 1;
                self.painter.take(pixel, contribution);
            },
        );
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

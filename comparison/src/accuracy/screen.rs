//! Screen: estimates the squared error of a machine on a scene from a sample of its tiles.
//!
//! ```text
//! reference machine, drawn in full ─► r_t per tile ─► sizes p_t ─► order of tiles ─► first n ─┐
//! tried machine ─► those splats only ─► tiles of the sample, drawn ─► x_t ────────────────────┴─► X̂ ± z·s
//!                                              ▲                                       │ not sure
//!                                              └──────────── twice as many ◄───────────┘
//! ```
//! x_t is the squared error of tile t (16×16 pixels), summed over pixels and channels; r_t is that of
//! the reference, the last machine near the target that was drawn in full. A step changes few tiles,
//! so the two are compared in pairs.
//!
//! *Sample.* Tiles are sampled in the order of u_t/p_t, with p_t ∝ √r_t plus a floor for all tiles
//! (sequential Poisson sampling: Ohlsson, *Sequential Poisson sampling*, 1998). The first n tiles
//! then contain tile t with probability π_t = min(1, λ·p_t), Σπ_t = n. u_t is a lattice of low
//! discrepancy over columns and rows instead of random numbers, which spreads the tiles evenly.
//!
//! *Estimate.* With B = Σ(x_t/π_t) / Σ(r_t/π_t), sums over the sample, X̂ = B·Σr_t, the last sum over
//! all tiles: a ratio estimator. With the residuals e_t = x_t − B·r_t and their mean A, weighted by
//! 1 − π_t, s² = n/(n − 1) · Σ(1 − π_t)·(e_t/π_t − A)² (Rosén, *On sampling with probability
//! proportional to size*, 1997). s is not taken as less than `LEAST_DEVIATION`·X̂/√n: a sample in
//! which nothing changed says little about the other tiles.
//!
//! *Interval.* X̂ ± 3·s (`Until::deviations`). Squared errors have heavy tails, so that a decision
//! which the interval calls sure is wrong in up to 5 % of all cases (`WRONG`), more often than by a
//! normal distribution. Decisions on the way ([`Until::Likely`]) use X̂ ± 1.5·s, and X̂ itself if the
//! last sample does not decide: a wrong one costs a step, which later stages find again. Two bounds
//! are exact: the error of the sample alone is less than that of the picture, and so is its greatest
//! error. Both can only reject.
//!
//! Splats are set up if their box on the unchanged machine, `MARGIN_PX` wider on each side, touches
//! a tile of the sample. Words do not depend on the other splats.
//!
//! Laws: `sure_decisions_are_seldom_wrong`, `a_tile_of_a_sample_is_that_of_the_picture`;
//! `screening_finds_machines_as_small_as_full_drawings_do` (tests/search.rs),
//! `only_machines_that_miss_the_psnr_are_screened_out` (tests/sweep.rs).

use crate::accuracy::pixel_errors;
use crate::error::Result;
use crate::hardware::fixed;
use crate::hardware::quantise::{Part, quantise, quantise_part};
use crate::hardware::searched::{Metric, Target};
use crate::output::picture::Picture;
use crate::scene::Scene;
use rtl_model::pipeline::{Elaborated, set_up_unobserved};
use rtl_model::work::{TILE_PX, each_tile};
use serde::{Deserialize, Serialize};

/// Most sure decisions that are wrong, as a part of all sure decisions.
#[cfg(test)]
const WRONG: f64 = 0.05;
/// Least standard deviation, as a part of the estimate, for a sample of one tile.
const LEAST_DEVIATION: f64 = 0.3;
/// Part of the sample that is spread over all tiles, whatever their errors.
const FLOOR: f64 = 0.3;
/// Tiles of the first sample.
const FIRST: usize = 8;
/// Pictures with fewer tiles are drawn in full.
const LEAST_TILES: usize = 64;
/// Tiles of the picture per tile of the last sample, after which the whole picture is drawn, or the
/// estimate decides.
const LAST: usize = 4;
/// Most tiles of a sample whose estimate decides; half as many for [`Until::Likely`].
const MOST: usize = 32;
/// Width by which boxes of splats are extended on each side, pixels.
const MARGIN_PX: u16 = 2;
/// Steps of a lattice of low discrepancy: 1/g and 1/g², g the plastic number (Roberts, *The
/// unreasonable effectiveness of quasirandom sequences*, 2018).
const LATTICE: [f64; 2] = [0.754_877_666_247, 0.569_840_290_998];
/// Shift of the lattice per reference: the golden ratio.
const LATTICE_SHIFT: f64 = 0.618_033_988_75;

/// A picture in tiles of [`TILE_PX`]×[`TILE_PX`] pixels, row by row.
#[derive(Clone, Copy)]
struct Grid {
    width: usize,
    height: usize,
}

impl Grid {
    fn of(picture: &Picture) -> Self {
        Grid {
            width: picture.width,
            height: picture.height,
        }
    }

    fn columns(self) -> usize {
        self.width.div_ceil(TILE_PX)
    }

    fn tiles(self) -> usize {
        self.columns() * self.height.div_ceil(TILE_PX)
    }

    /// Indices of a tile's pixels in the picture.
    fn pixels(self, tile: usize) -> impl Iterator<Item = usize> {
        let [left, top] = [tile % self.columns(), tile / self.columns()].map(|at| at * TILE_PX);
        let columns = left..self.width.min(left + TILE_PX);
        (top..self.height.min(top + TILE_PX))
            .flat_map(move |row| columns.clone().map(move |column| row * self.width + column))
    }
}

/// A scene from one camera, of which samples are drawn.
#[derive(Clone, Copy)]
pub struct View<'a> {
    /// The scene from this camera.
    pub scene: &'a Scene,
    /// The picture that machines are compared with.
    pub exact: &'a Picture,
    /// Squared error of the picture, summed over pixels and channels, at which the load is 1
    /// ([`allowed`]).
    pub allowed: f64,
    /// The splats of its tiles.
    pub splats: &'a TileSplats,
    /// [`Part::of`] the scene.
    pub part: &'a Part,
}

/// Squared error of a picture with this PSNR, summed over pixels and channels.
pub fn allowed(picture: &Picture, psnr_db: f64) -> f64 {
    let values = 3.0 * (picture.width * picture.height) as f64;
    values * libm::pow(10.0, -psnr_db / 10.0)
}

/// Indices of views in the order in which they are tried, by their allowed squared errors and those
/// of the reference per tile: a view that the reference hardly meets rejects most machines.
pub fn hardest_first(allowed: impl Iterator<Item = f64>, reference: &[Vec<f64>]) -> Vec<usize> {
    let loads: Vec<f64> = allowed
        .zip(reference)
        .map(|(allowed, tiles)| tiles.iter().sum::<f64>() / allowed)
        .collect();
    let mut order: Vec<usize> = (0..loads.len()).collect();
    order.sort_by(|a, b| loads[*b].total_cmp(&loads[*a]));
    order
}

/// Splats of each tile of a view.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TileSplats {
    /// Tile t's splats are `starts[t]..starts[t + 1]`.
    starts: Vec<u32>,
    splats: Vec<u32>,
}

impl TileSplats {
    /// Splats by their boxes on a machine; `None` if samples of the scene cannot be drawn or save
    /// no time: if the machine cannot hold it, if it is a tree, because its cut depends on the
    /// machine, or if the picture has few tiles.
    pub fn of(scene: &Scene, picture: &Picture, elaborated: &Elaborated) -> Option<Self> {
        let grid = Grid::of(picture);
        if scene.detail.is_some() || grid.tiles() < LEAST_TILES {
            return None;
        }
        let quantised = quantise(scene, &elaborated.machine).ok()?;
        let setup = set_up_unobserved(elaborated, &quantised.frame);
        let [width, height] = [grid.width, grid.height].map(|size| size as u16);
        let widened = |sides: [[u16; 2]; 2]| {
            [(0, width), (1, height)].map(|(axis, size)| {
                let [first, last]: [u16; 2] = sides[axis];
                [
                    first.saturating_sub(MARGIN_PX),
                    last.saturating_add(MARGIN_PX).min(size - 1),
                ]
            })
        };
        let mut tiles: Vec<Vec<u32>> = vec![Vec::new(); grid.tiles()];
        for (splat, sides) in setup.boxes() {
            each_tile(widened(sides), TILE_PX, grid.columns(), |tile| {
                tiles[tile].push(splat);
            });
        }
        let mut starts = vec![0];
        starts.extend(tiles.iter().scan(0, |end, splats| {
            *end += splats.len() as u32;
            Some(*end)
        }));
        Some(TileSplats {
            starts,
            splats: tiles.concat(),
        })
    }

    fn tile(&self, tile: usize) -> &[u32] {
        &self.splats[self.starts[tile] as usize..self.starts[tile + 1] as usize]
    }
}

/// Whether machines can be screened for a target: PSNR of pictures as they are, whose errors add up.
pub fn is_possible(target: &Target) -> bool {
    target.metric == Metric::Psnr && target.psnr_db.is_some() && !target.no_saturation
}

/// How far an estimate goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Until {
    /// Until the decision is sure; if a quarter of the picture does not decide, the machine must be
    /// drawn in full.
    Sure,
    /// Until the decision is sure, or the last sample: its estimate decides.
    Likely,
    /// As [`Until::Likely`], but a load of at most 1 is estimated from the last sample, because it is
    /// compared with others.
    Rejected,
    /// To the last sample: all loads are compared.
    Compared,
}

impl Until {
    /// Standard deviations on each side of an estimate.
    fn deviations(self) -> f64 {
        match self {
            Until::Sure => 3.0,
            Until::Likely | Until::Rejected | Until::Compared => 1.5,
        }
    }
}

/// What machines are compared with while they are screened.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Screening {
    /// Squared error of the reference machine per tile, of each view.
    pub reference: Vec<Vec<f64>>,
    /// Factor by which the allowed squared error is less than that of the views.
    pub stricter: f64,
    /// Number of the reference: another one has another lattice.
    pub nth: u64,
    /// How far an estimate goes.
    pub until: Until,
}

/// A machine's load, estimated from samples of all views.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Tiles that were drawn.
    pub tiles: u64,
    /// Squared error as a part of the allowed squared error.
    pub load: f64,
    /// Lower end of its interval.
    pub low: f64,
    /// Upper end of its interval.
    pub high: f64,
    /// Greatest error in the samples.
    pub max_error: f64,
}

impl Estimate {
    /// Whether the interval decides.
    fn is_sure(&self) -> bool {
        self.low > 1.0 || self.high <= 1.0
    }

    fn is_enough(&self, until: Until) -> bool {
        match until {
            Until::Sure | Until::Likely => self.is_sure(),
            Until::Rejected => self.low > 1.0,
            Until::Compared => false,
        }
    }
}

/// Squared error of each tile of a picture; empty if a value is NaN or infinite.
pub fn tile_errors(picture: &Picture, exact: &Picture) -> Vec<f64> {
    let errors = |tile| Some(tile_error(exact, tile, |pixel| picture.rgba[pixel])?.0);
    let all: Option<Vec<f64>> = (0..Grid::of(exact).tiles()).map(errors).collect();
    all.unwrap_or_default()
}

/// Squared error and greatest error of a tile; `None` if a value is NaN or infinite.
fn tile_error(
    exact: &Picture,
    tile: usize,
    rgba: impl Fn(usize) -> [f64; 4],
) -> Option<(f64, f64)> {
    Grid::of(exact)
        .pixels(tile)
        .try_fold((0.0, 0.0f64), |(squares, most), pixel| {
            let (own, greatest) = pixel_errors(&rgba(pixel), exact, pixel)?;
            Some((squares + own, most.max(greatest)))
        })
}

impl Screening {
    /// Estimates a machine's load on all views; `None` if it must be drawn in full.
    ///
    /// # Errors
    /// If the machine cannot hold a view.
    pub fn estimate(
        &self,
        views: &[View],
        elaborated: &Elaborated,
        max_error: Option<f64>,
    ) -> Result<Option<Estimate>> {
        let order = hardest_first(views.iter().map(|view| view.allowed), &self.reference);
        let mut all = Estimate {
            tiles: 0,
            load: 0.0,
            low: 0.0,
            high: 0.0,
            max_error: 0.0,
        };
        for nth in order {
            let (view, errors) = (&views[nth], &self.reference[nth]);
            let Some(own) = self.on(view, errors, elaborated, max_error)? else {
                return Ok(None);
            };
            all = Estimate {
                tiles: all.tiles + own.tiles,
                load: all.load.max(own.load),
                low: all.low.max(own.low),
                high: all.high.max(own.high),
                max_error: all.max_error.max(own.max_error),
            };
            if all.low > 1.0 && self.until != Until::Compared {
                break;
            }
        }
        let is_enough = all.is_sure() || (self.until != Until::Sure && max_error.is_none());
        Ok(is_enough.then_some(all))
    }

    /// Estimates a machine's load on a view.
    fn on(
        &self,
        view: &View,
        reference: &[f64],
        elaborated: &Elaborated,
        max_error: Option<f64>,
    ) -> Result<Option<Estimate>> {
        let grid = Grid::of(view.exact);
        if reference.len() != grid.tiles() {
            return Ok(None);
        }
        let limits = Limits {
            allowed: view.allowed / self.stricter,
            max_error,
        };
        let draw = |tiles: &[usize]| draw(view, tiles, elaborated);
        self.sampled(reference, grid.columns(), &limits, draw)
    }

    /// Estimates a load on a picture with so many columns of tiles; `draw` returns the squared and the
    /// greatest error of each tile that it is given, or `None` if a value is NaN or infinite.
    fn sampled(
        &self,
        reference: &[f64],
        columns: usize,
        limits: &Limits,
        mut draw: impl FnMut(&[usize]) -> Result<Option<Vec<(f64, f64)>>>,
    ) -> Result<Option<Estimate>> {
        let quarter = reference.len() / LAST;
        let [first, last] = match self.until {
            Until::Likely => [FIRST, MOST / 2],
            Until::Rejected => [FIRST, MOST],
            Until::Compared => [MOST; 2],
            // The deviation of few tiles with heavy tails is known too badly for a sure decision.
            Until::Sure => [MOST, quarter],
        }
        .map(|tiles| tiles.min(quarter));
        let sizes = sizes(reference);
        let order = order(&sizes, columns, self.nth);
        let mut sample: Vec<Sampled> = Vec::new();
        let mut max_error = 0.0f64;
        loop {
            let end = (2 * sample.len()).max(first).min(last);
            let tiles = &order[sample.len()..end];
            let Some(errors) = draw(tiles)? else {
                return Ok(None);
            };
            for (&tile, (squares, most)) in tiles.iter().zip(errors) {
                max_error = max_error.max(most);
                sample.push(Sampled {
                    squares,
                    reference: reference[tile],
                    size: sizes[tile],
                });
            }
            let by_most = limits
                .max_error
                .map_or(0.0, |most| max_error / most * (max_error / most));
            let Interval { value, low, high } =
                interval(&sample, &sizes, reference, self.until.deviations());
            let estimate = Estimate {
                tiles: sample.len() as u64,
                load: (value / limits.allowed).max(by_most),
                low: (low / limits.allowed).max(by_most),
                high: match limits.max_error {
                    Some(_) => f64::INFINITY,
                    None => high / limits.allowed,
                },
                max_error,
            };
            if !estimate.load.is_finite() {
                return Ok(None);
            }
            if estimate.is_enough(self.until) || sample.len() == last {
                return Ok(Some(estimate));
            }
        }
    }
}

/// Errors at which a load is 1.
struct Limits {
    /// Squared error of the whole picture.
    allowed: f64,
    max_error: Option<f64>,
}

/// Draws some tiles of a view; returns the squared and the greatest error of each.
fn draw(view: &View, tiles: &[usize], elaborated: &Elaborated) -> Result<Option<Vec<(f64, f64)>>> {
    let mut drawn = vec![false; Grid::of(view.exact).tiles()];
    tiles.iter().for_each(|tile| drawn[*tile] = true);
    let own = tiles
        .iter()
        .flat_map(|tile| view.splats.tile(*tile))
        .copied();
    let part = view.part.with(own.collect());
    let quantised = quantise_part(view.scene, &part, &elaborated.machine)?;
    let drawing = fixed::draw_tiles(elaborated, &quantised, &drawn);
    let format = elaborated.machine.resolve.frame.format;
    let rgba = |pixel: usize| drawing.frame[pixel].map(|word| format.value(i64::from(word)));
    let error = |tile: &usize| tile_error(view.exact, *tile, rgba);
    Ok(tiles.iter().map(error).collect())
}

/// A drawn tile.
struct Sampled {
    squares: f64,
    reference: f64,
    size: f64,
}

/// Sizes of tiles, which add up to 1.
fn sizes(reference: &[f64]) -> Vec<f64> {
    let roots: Vec<f64> = reference.iter().map(|squares| squares.sqrt()).collect();
    let sum: f64 = roots.iter().sum();
    let even = 1.0 / reference.len() as f64;
    let size = |root: f64| {
        if sum > 0.0 {
            (1.0 - FLOOR) * root / sum + FLOOR * even
        } else {
            even
        }
    };
    roots.into_iter().map(size).collect()
}

/// Tiles in the order in which they join a sample.
fn order(sizes: &[f64], columns: usize, nth: u64) -> Vec<usize> {
    let first = (0.5 + LATTICE_SHIFT * nth as f64).fract();
    let key = |tile: usize| {
        let [x, y] = [tile % columns, tile / columns].map(|at| at as f64);
        let u = (first + LATTICE[0] * x + LATTICE[1] * y).fract();
        u / sizes[tile]
    };
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    order.sort_by(|a, b| key(*a).total_cmp(&key(*b)).then(a.cmp(b)));
    order
}

/// λ with Σ min(1, λ·p_t) = count.
fn scale(sizes: &[f64], count: usize) -> f64 {
    let mut sorted = sizes.to_vec();
    sorted.sort_by(|a, b| b.total_cmp(a));
    let mut rest: f64 = sorted.iter().sum();
    for (certain, size) in sorted.iter().enumerate().take(count) {
        let scale = (count - certain) as f64 / rest;
        if scale * size <= 1.0 {
            return scale;
        }
        rest -= size;
    }
    f64::INFINITY
}

/// An estimated sum and its interval.
struct Interval {
    value: f64,
    low: f64,
    high: f64,
}

/// The sum over all tiles, from a sample.
fn interval(sample: &[Sampled], sizes: &[f64], reference: &[f64], deviations: f64) -> Interval {
    let drawn: f64 = sample.iter().map(|tile| tile.squares).sum();
    let count = sample.len() as f64;
    if sample.len() == sizes.len() {
        return Interval {
            value: drawn,
            low: drawn,
            high: drawn,
        };
    }
    let scale = scale(sizes, sample.len());
    let included = |tile: &Sampled| (scale * tile.size).min(1.0);
    let [own, of_reference] = [
        (|tile: &Sampled| tile.squares) as fn(&Sampled) -> f64,
        |tile: &Sampled| tile.reference,
    ]
    .map(|squares| {
        sample
            .iter()
            .map(|tile| squares(tile) / included(tile))
            .sum::<f64>()
    });
    let whole: f64 = reference.iter().sum();
    let (value, factor) = if of_reference > 0.0 {
        (own / of_reference * whole, own / of_reference)
    } else {
        (own, 0.0)
    };
    let residuals: Vec<(f64, f64)> = sample
        .iter()
        .map(|tile| {
            let included = included(tile);
            (
                1.0 - included,
                (tile.squares - factor * tile.reference) / included,
            )
        })
        .collect();
    let weights: f64 = residuals.iter().map(|(weight, _)| weight).sum();
    let mean = if weights > 0.0 {
        residuals.iter().map(|(w, e)| w * e).sum::<f64>() / weights
    } else {
        0.0
    };
    let variance = count / (count - 1.0).max(1.0)
        * residuals
            .iter()
            .map(|(weight, e)| weight * (e - mean) * (e - mean))
            .sum::<f64>();
    let least = LEAST_DEVIATION * value / count.sqrt();
    let deviation = variance.sqrt().max(least);
    Interval {
        value: value.max(drawn),
        low: (value - deviations * deviation).max(drawn),
        high: value + deviations * deviation,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::golden;
    use crate::hardware::machines;
    use crate::scene::Overrides;
    use crate::scene::digest::mixed;
    use rtl_model::Machine;
    use rtl_model::num::Format;
    use serde_json::Value;

    /// A scene with the picture that machines are compared with, and the splats of its tiles.
    fn view(name: &str, base: &Elaborated) -> (Scene, Picture, TileSplats) {
        let overrides = Overrides {
            size: Some((192, 160)),
        };
        let mut scene = Scene::load(name, &overrides).unwrap();
        let stride = scene.splats.len().div_ceil(4000);
        scene.splats = scene.splats.into_iter().step_by(stride).collect();
        scene
            .splats
            .iter_mut()
            .for_each(|splat| splat.radius *= (stride as f64).sqrt());
        let golden = golden::render(&scene, &fixed::rules(&base.machine)).picture;
        let splats = TileSplats::of(&scene, &golden, base).unwrap();
        (scene, golden, splats)
    }

    /// Squared error of each tile on a machine; `None` if it cannot hold the scene.
    fn tiles_on(elaborated: &Elaborated, scene: &Scene, exact: &Picture) -> Option<Vec<f64>> {
        let quantised = quantise(scene, &elaborated.machine).ok()?;
        let drawing = fixed::draw(elaborated, &quantised);
        Some(tile_errors(&fixed::picture(elaborated, &drawing), exact))
    }

    /// The base with fewer fraction bits in some words.
    fn narrower(base: &Machine, seed: u64) -> Option<Elaborated> {
        let least = 3 + mixed(seed) % 8;
        let change = |(nth, (path, format)): (usize, (String, Format))| {
            let random = mixed(seed.wrapping_mul(1000) + nth as u64);
            let bits = (least + random % 3) as i32;
            let format = format.finer(-bits);
            (random % 7 < 3 && format.width() > 3).then(|| (path, Value::from(format.to_string())))
        };
        let changes: Vec<_> = machines::words(base)
            .into_iter()
            .enumerate()
            .filter_map(change)
            .collect();
        machines::with(base, &changes, "").ok()?.elaborate().ok()
    }

    #[test]
    fn a_tile_of_a_sample_is_that_of_the_picture() {
        let base = Machine::named("reference").unwrap();
        for name in ["torus-knot", "glass-spheres"] {
            let elaborated = base.elaborate().unwrap();
            let (scene, exact, splats) = view(name, &elaborated);
            let part = Part::of(&scene);
            let view = View {
                scene: &scene,
                exact: &exact,
                allowed: allowed(&exact, 50.0),
                splats: &splats,
                part: &part,
            };
            let machines: Vec<Elaborated> =
                (0..40).filter_map(|seed| narrower(&base, seed)).collect();
            for elaborated in machines.iter().take(4).chain([&elaborated]) {
                let Some(whole) = tiles_on(elaborated, &scene, &exact) else {
                    continue;
                };
                for first in 0..3 {
                    let tiles: Vec<usize> = (first..whole.len()).step_by(3).collect();
                    let errors = draw(&view, &tiles, elaborated).unwrap().unwrap();
                    let own: Vec<f64> = errors.into_iter().map(|(squares, _)| squares).collect();
                    let expected: Vec<f64> = tiles.iter().map(|tile| whole[*tile]).collect();
                    assert_eq!(own, expected, "{name}");
                }
            }
        }
    }

    #[test]
    fn sure_decisions_are_seldom_wrong() {
        let base = Machine::named("reference").unwrap();
        let [mut sure, mut wrong, mut all] = [0u32; 3];
        for name in ["torus-knot", "glass-spheres"] {
            let (scene, exact, _) = view(name, &base.elaborate().unwrap());
            let errors: Vec<Vec<f64>> = (100..700)
                .filter_map(|seed| tiles_on(&narrower(&base, seed)?, &scene, &exact))
                .filter(|tiles| tiles.iter().sum::<f64>() > 0.0)
                .collect();
            assert!(errors.len() > 30, "{}", errors.len());
            for (nth, own) in errors.iter().enumerate() {
                for seed in 0..20u64 {
                    let random = mixed(seed + 1000 * nth as u64);
                    let reference = &errors[random as usize % errors.len()];
                    let squares: f64 = own.iter().sum();
                    // Loads from 1/3 to 3.
                    let part = mixed(random) as f64 / u64::MAX as f64;
                    let load = libm::pow(9.0, part - 0.5);
                    let screening = Screening {
                        reference: vec![reference.clone()],
                        stricter: 1.0,
                        nth: seed,
                        until: Until::Sure,
                    };
                    let limits = Limits {
                        allowed: squares / load,
                        max_error: None,
                    };
                    let draw = |tiles: &[usize]| {
                        Ok(Some(tiles.iter().map(|tile| (own[*tile], 0.0)).collect()))
                    };
                    let estimate = screening
                        .sampled(reference, Grid::of(&exact).columns(), &limits, draw)
                        .unwrap()
                        .unwrap();
                    all += 1;
                    if estimate.is_sure() {
                        sure += 1;
                        wrong += u32::from((estimate.low > 1.0) != (load > 1.0));
                    }
                }
            }
        }
        eprintln!("{wrong} of {sure} sure decisions of {all} are wrong");
        // Enough of them are sure for the share to mean something.
        assert!(sure > all / 10, "{sure} of {all}");
        assert!(
            f64::from(wrong) <= WRONG * f64::from(sure),
            "{wrong} of {sure}"
        );
    }

    #[test]
    fn a_sample_of_all_tiles_is_exact() {
        let reference: Vec<f64> = (0..64).map(|tile| f64::from(tile % 7)).collect();
        let sizes = sizes(&reference);
        let sample: Vec<Sampled> = order(&sizes, 8, 3)
            .into_iter()
            .map(|tile| Sampled {
                squares: tile as f64,
                reference: reference[tile],
                size: sizes[tile],
            })
            .collect();
        let whole = interval(&sample, &sizes, &reference, 3.0);
        assert_eq!([whole.value, whole.low, whole.high], [2016.0; 3]);
        // A machine with twice the error of the reference everywhere is estimated without error.
        let half: Vec<Sampled> = sample[..32]
            .iter()
            .map(|tile| Sampled {
                squares: 2.0 * tile.reference,
                ..*tile
            })
            .collect();
        let double = interval(&half, &sizes, &reference, 3.0);
        let expected = 2.0 * reference.iter().sum::<f64>();
        assert!(
            (double.value - expected).abs() < 1e-9 * expected,
            "{}",
            double.value
        );
    }

    #[test]
    fn probabilities_add_up_to_the_size_of_the_sample() {
        let sizes = sizes(
            &(0..100)
                .map(|tile| if tile == 3 { 1e6 } else { f64::from(tile % 5) })
                .collect::<Vec<_>>(),
        );
        assert!((sizes.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        for count in [1, 8, 50, 99] {
            let scale = scale(&sizes, count);
            let sum: f64 = sizes.iter().map(|size| (scale * size).min(1.0)).sum();
            assert!((sum - count as f64).abs() < 1e-9, "{sum} for {count}");
        }
    }
}

//! Summary: figures of a frame in lockstep, and two pictures.

use super::{CheckedTiles, Flips, KINDS, Lockstep, TILE_PX};
use crate::accuracy::metrics::{is_zero, metrics};
use crate::output::chart::{Axis, Mark, Panel, Series};
use crate::output::picture::Picture;
use schemars::JsonSchema;
use serde::Serialize;
use std::borrow::Cow;

/// Bounds below this are informative: a few steps of an 8-bit display.
const TELLING: f64 = 4.0 / 255.0;

/// The machine against `golden` led by its own decisions (docs/book/bounds.md).
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Summary {
    /// Peak 1, all pixels and channels; none for equal pictures.
    pub psnr_db: Option<f64>,
    /// Greatest absolute difference.
    pub max_error: f64,
    /// Pixels with a NaN or infinite value in either picture. Should be 0.
    #[serde(skip_serializing_if = "is_zero")]
    pub not_finite: u64,
    /// Pixels that differ by more than their bound. Should be 0.
    pub bound_violations: u64,
    /// Decisions that `golden` would take differently.
    pub decision_flips: u64,
    /// Pixels that were checked in lockstep, if not all (`run --check sampled`). All other figures
    /// here cover only these pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sampled_pixels: Option<u64>,
    /// Flips by kind.
    pub flips: Flips,
    /// Bounds of the covered pixels.
    pub bound: BoundSummary,
}

/// Tightness of the bounds, over the covered pixels.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct BoundSummary {
    /// Half of the pixels have at most this bound; none if nothing is covered.
    pub median: Option<f64>,
    /// Nine in ten pixels have at most this bound; none if it is infinite.
    pub nine_in_ten: Option<f64>,
    /// Share of the pixels whose bound is under 4/255.
    pub share_under_4_255: f64,
    /// Share of the pixels whose bound is over 1 and therefore means nothing.
    pub share_over_1: f64,
    /// Median of error/bound.
    pub median_ratio: Option<f64>,
    /// Greatest error/bound.
    pub max_ratio: f64,
}

impl Lockstep {
    /// The figures; `fixed` is the machine's picture.
    pub fn summary(&self, fixed: &Picture) -> Summary {
        let metrics = metrics(&self.checked_part(fixed), &self.checked_part(&self.led));
        Summary {
            psnr_db: metrics.psnr_db,
            max_error: metrics.max_error,
            not_finite: metrics.not_finite,
            // A pixel that is not finite counts even if the machine did not resolve it and no bound
            // was checked.
            bound_violations: self.violations.max(metrics.not_finite),
            decision_flips: self.flips.total(),
            flips: self.flips,
            sampled_pixels: (self.tiles != CheckedTiles::All)
                .then(|| (0..self.bound.len()).filter(|&i| self.holds(i)).count() as u64),
            bound: self.bound_summary(),
        }
    }

    /// Whether a pixel was checked.
    fn holds(&self, pixel: usize) -> bool {
        let [x, y] = [pixel % self.led.width, pixel / self.led.width];
        self.tiles.has(x / TILE_PX, y / TILE_PX)
    }

    /// The checked pixels of a picture, in one row if these are not all.
    fn checked_part<'p>(&self, picture: &'p Picture) -> Cow<'p, Picture> {
        if self.tiles == CheckedTiles::All {
            return Cow::Borrowed(picture);
        }
        let checked: Vec<usize> = (0..picture.rgba.len())
            .filter(|&pixel| self.holds(pixel))
            .collect();
        let rgba = checked.iter().map(|&pixel| picture.rgba[pixel]).collect();
        let covered = checked
            .iter()
            .map(|&pixel| picture.covered[pixel])
            .collect();
        Cow::Owned(Picture {
            width: checked.len(),
            height: 1,
            rgba,
            covered,
        })
    }

    /// Bound and error of each covered pixel that was checked.
    fn covered(&self) -> impl Iterator<Item = [f64; 2]> {
        (0..self.bound.len())
            .filter(|&i| self.led.covered[i] && self.holds(i))
            .map(|i| [self.bound[i], self.error[i]])
    }

    fn bound_summary(&self) -> BoundSummary {
        let sorted = |values: &mut dyn Iterator<Item = f64>| {
            let mut values: Vec<f64> = values.collect();
            values.sort_unstable_by(f64::total_cmp);
            values
        };
        let bounds = sorted(&mut self.covered().map(|[bound, _]| bound));
        let ratios = sorted(
            &mut self
                .covered()
                .map(|[bound, error]| if error > 0.0 { error / bound } else { 0.0 }),
        );
        let at = |values: &[f64], part: f64| {
            values
                .get((part * values.len() as f64) as usize)
                .copied()
                .filter(|value| value.is_finite())
        };
        let share = |holds: &dyn Fn(&&f64) -> bool| {
            bounds.iter().filter(holds).count() as f64 / bounds.len().max(1) as f64
        };
        BoundSummary {
            median: at(&bounds, 0.5),
            nine_in_ten: at(&bounds, 0.9),
            share_under_4_255: share(&|bound| **bound < TELLING),
            share_over_1: share(&|bound| **bound > 1.0),
            median_ratio: at(&ratios, 0.5),
            max_ratio: ratios.last().copied().unwrap_or(0.0),
        }
    }

    /// Positions of flips: one colour per kind, over a grey version of `led`; black where nothing
    /// was checked.
    pub fn flip_picture(&self) -> Picture {
        const COLOURS: [[f64; 3]; KINDS.len()] = [
            [1.0, 1.0, 1.0],
            [0.0, 0.45, 1.0],
            [1.0, 0.1, 0.0],
            [1.0, 0.75, 0.0],
            [0.9, 0.1, 0.9],
            [0.0, 0.8, 0.2],
            [0.4, 0.9, 0.9],
            [0.6, 0.4, 0.2],
            [1.0, 0.6, 0.7],
            [0.5, 0.5, 1.0],
            [0.7, 1.0, 0.4],
        ];
        let pixel = |(number, (rgba, kinds)): (usize, (&[f64; 4], &u16))| {
            if !self.holds(number) {
                return [0.0, 0.0, 0.0, 1.0];
            }
            // The rarest kind of a pixel wins.
            let kind = (0..KINDS.len()).rev().find(|kind| kinds >> kind & 1 == 1);
            let grey = 0.15 * (0.2 * rgba[0] + 0.7 * rgba[1] + 0.1 * rgba[2]).clamp(0.0, 1.0);
            let [r, g, b] = kind.map_or([grey; 3], |kind| COLOURS[kind]);
            [r, g, b, 1.0]
        };
        Picture {
            rgba: self
                .led
                .rgba
                .iter()
                .zip(&self.flipped)
                .enumerate()
                .map(pixel)
                .collect(),
            ..self.led.clone()
        }
    }

    /// Error over bound at every covered pixel; no point may be above the line.
    pub fn bound_chart(&self) -> Panel {
        // Zeros are drawn at the bottom, because a log axis has no 0.
        const LEAST: f64 = 1e-7;
        let point = |[bound, error]: [f64; 2]| [bound.min(10.0), error.max(LEAST)];
        // Two thousand pixels show the cloud; more would only hide it.
        let every = (self.covered().count() / 2000).max(1);
        let points = self.covered().step_by(every).map(point).collect();
        let series = |name: &str, points, mark, colour| Series {
            name: name.into(),
            points,
            mark,
            colour,
        };
        Panel {
            title: "|fixed − golden in lockstep| against its bound, pixel by pixel".into(),
            x: Axis::log("bound, linear light (all beyond 10 at 10)"),
            y: Axis::log("error, linear light"),
            series: vec![
                series("pixels", points, Mark::Dots, 0),
                series(
                    "error = bound",
                    vec![[1e-5, 1e-5], [1.0, 1.0]],
                    Mark::Line,
                    1,
                ),
            ],
            limits: vec![
                (TELLING, "4/255".into(), 6),
                (1.0, "no information".into(), 6),
            ],
            ..Panel::default()
        }
    }
}

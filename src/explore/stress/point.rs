//! Point: runs one case at one value on one machine, and checks that every failure is reported.

use super::FAILS;
use crate::accuracy::flicker;
use crate::accuracy::flicker::{Flicker, Pictures};
use crate::accuracy::ranges::Overflows;
use crate::accuracy::{Distance, Flips, Lockstep, distance, is_finite, pixel_error};
use crate::output::picture::Picture;
use crate::run::evaluation::{Evaluation, Observed};
use crate::run::report::CulledReport;
use crate::scene::Scene;
use rtl_model::Machine;
use schemars::JsonSchema;
use serde::Serialize;

/// One value on one machine: results, or why the machine refuses the scene.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PointOutcome {
    /// The machine cannot hold the scene; the reason.
    Refused(String),
    /// Results.
    Drawn(Box<PointFindings>),
}

/// Results of a machine that drew.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct PointFindings {
    /// Pixels touched by a splat, in `fixed` or in `golden`.
    pub covered_pixels: u64,
    /// Error of the method.
    pub golden_vs_ideal: Distance,
    /// Error of the arithmetic, including flips.
    pub fixed_vs_golden: Distance,
    /// Error of the arithmetic without flips, and its bound.
    pub lockstep: BoundedErrors,
    /// Pixels at which fixed and `golden` differ by more than 8/255.
    pub beyond: Beyond,
    /// Change of the errors since the previous frame; only for a case that is a sequence.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flicker: Option<Flicker>,
    /// Splats that were not drawn.
    pub culled: CulledReport,
    /// Results outside their word's range that were saturated, not counting the declared clamps.
    pub saturated: u64,
    /// Results that wrapped.
    pub wrapped: u64,
    /// Signals that saturated or wrapped.
    pub overflowed: Vec<String>,
}

/// Lockstep: errors and bounds in a few numbers.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct BoundedErrors {
    /// Greatest |fixed − led|.
    pub max_error: f64,
    /// Greatest bound of a covered pixel among those that are at most 1; null if there is no such
    /// pixel.
    pub max_bound: Option<f64>,
    /// Share of the covered pixels whose bound exceeds 1, and is thus useless.
    pub share_over_1: f64,
    /// Pixels that exceed their bound.
    pub violations: u64,
    /// Decisions that `golden` would have taken differently.
    pub flips: Flips,
}

/// Pixels at which fixed and `golden` differ by more than 8/255, each counted by the first report
/// of it.
#[derive(Clone, Copy, Debug, Default, Serialize, JsonSchema)]
pub struct Beyond {
    /// All of them.
    pub pixels: u64,
    /// A decision flipped at the pixel.
    pub flipped: u64,
    /// The bound there is at least the difference, and at most 1.
    pub within_bound: u64,
    /// The bound there exceeds 1.
    pub bound_over_1: u64,
    /// No report. Should be 0.
    pub silent: u64,
}

/// Results of a point, with pictures unless the machine refused the scene.
pub struct PointMeasurement {
    pub outcome: PointOutcome,
    pub pictures: Option<Pictures>,
}

/// Draws a scene on a machine and in exact arithmetic, and compares. Also compares with the
/// previous frame and its ideal picture, if given.
pub fn measure(
    scene: &Scene,
    ideal: &Picture,
    machine: &Machine,
    before: Option<&(Picture, Scene)>,
) -> PointMeasurement {
    let before = before
        .map(|(ideal, scene)| {
            Ok::<_, crate::error::Error>((ideal, Evaluation::new(scene, machine)?))
        })
        .transpose();
    match Evaluation::new(scene, machine).and_then(|evaluation| Ok((evaluation, before?))) {
        Ok((evaluation, before)) => draw(ideal, &evaluation, before.as_ref()),
        Err(error) => PointMeasurement {
            outcome: PointOutcome::Refused(error.to_string()),
            pictures: None,
        },
    }
}

fn draw(
    ideal: &Picture,
    evaluation: &Evaluation,
    before: Option<&(&Picture, Evaluation)>,
) -> PointMeasurement {
    let observed = evaluation.observe();
    let golden = evaluation.golden().picture;
    let led = evaluation.lockstep();
    let Overflows {
        saturated,
        wrapped,
        signals,
    } = observed.overflows();
    let Observed {
        drawing,
        picture: fixed,
        ..
    } = observed;
    let pictures = Pictures {
        ideal: ideal.clone(),
        golden,
        fixed,
    };
    let flicker = before.map(|(ideal, evaluation)| {
        let (fixed, golden) = (
            evaluation.picture(&evaluation.draw()),
            evaluation.golden().picture,
        );
        flicker::FlickerSums::new([&fixed, &golden, *ideal], pictures.all()).flicker()
    });
    let Pictures { golden, fixed, .. } = &pictures;
    let found = PointFindings {
        covered_pixels: covered(fixed, golden).count() as u64,
        golden_vs_ideal: distance(golden, ideal),
        fixed_vs_golden: distance(fixed, golden),
        lockstep: bounded(&led, covered(fixed, golden)),
        beyond: beyond(fixed, golden, &led),
        flicker,
        culled: drawing.culled.into(),
        saturated,
        wrapped,
        overflowed: signals,
    };
    PointMeasurement {
        outcome: PointOutcome::Drawn(Box::new(found)),
        pictures: Some(pictures),
    }
}

/// Pixels touched by a splat in either picture.
fn covered<'a>(a: &'a Picture, b: &'a Picture) -> impl Iterator<Item = usize> + 'a {
    (0..a.covered.len()).filter(|&pixel| a.covered[pixel] || b.covered[pixel])
}

fn bounded(led: &Lockstep, covered: impl Iterator<Item = usize>) -> BoundedErrors {
    let (mut all, mut over_1, mut max_bound) = (0_u64, 0_u64, None);
    for bound in covered.map(|pixel| led.bound[pixel]) {
        all += 1;
        // A bound of NaN is as useless as an infinite one.
        if bound > 1.0 || bound.is_nan() {
            over_1 += 1;
        } else {
            max_bound = Some(max_bound.map_or(bound, |most: f64| most.max(bound)));
        }
    }
    BoundedErrors {
        max_error: led.error.iter().copied().fold(0.0, f64::max),
        max_bound,
        share_over_1: over_1 as f64 / all.max(1) as f64,
        violations: led.violations,
        flips: led.flips,
    }
}

fn beyond(fixed: &Picture, golden: &Picture, led: &Lockstep) -> Beyond {
    let mut beyond = Beyond::default();
    for pixel in 0..fixed.rgba.len() {
        let error = pixel_error(fixed, golden, pixel);
        if error <= FAILS {
            continue;
        }
        beyond.pixels += 1;
        let is_number = is_finite(fixed, pixel) && is_finite(golden, pixel);
        let count = if !is_number {
            // No report covers it.
            &mut beyond.silent
        } else if led.flipped[pixel] != 0 {
            &mut beyond.flipped
        } else if led.bound[pixel] > 1.0 {
            &mut beyond.bound_over_1
        } else if led.bound[pixel] >= error {
            &mut beyond.within_bound
        } else {
            &mut beyond.silent
        };
        *count += 1;
    }
    beyond
}

impl PointFindings {
    /// Number of faults: pixels beyond their bound, unexplained flips, silent failures, NaN pixels.
    pub fn faults(&self) -> u64 {
        self.lockstep.violations
            + self.lockstep.flips.unexplained
            + self.beyond.silent
            + self.not_finite()
    }

    /// Pixels that are NaN or infinite in some picture.
    pub fn not_finite(&self) -> u64 {
        self.golden_vs_ideal
            .not_finite
            .max(self.fixed_vs_golden.not_finite)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accuracy::CheckedTiles;

    fn grey(values: &[f64]) -> Picture {
        let rgba = values
            .iter()
            .map(|value| [*value, *value, *value, 1.0])
            .collect();
        Picture {
            width: values.len(),
            height: 1,
            rgba,
            covered: vec![true; values.len()],
        }
    }

    fn lockstep(bound: f64, flipped: u16) -> Lockstep {
        let flips = Flips::default();
        Lockstep {
            tiles: CheckedTiles::All,
            led: grey(&[0.5]),
            bound: vec![bound],
            error: vec![0.0],
            flipped: vec![flipped],
            violations: 0,
            flips,
        }
    }

    #[test]
    fn a_large_error_without_flip_or_bound_is_silent() {
        let (fixed, golden) = (grey(&[0.5]), grey(&[0.6]));
        let counts = |bound, flipped| {
            let b = beyond(&fixed, &golden, &lockstep(bound, flipped));
            assert_eq!(
                b.pixels,
                b.flipped + b.within_bound + b.bound_over_1 + b.silent
            );
            [b.flipped, b.within_bound, b.bound_over_1, b.silent]
        };
        assert_eq!(counts(0.05, 0), [0, 0, 0, 1]);
        assert_eq!(counts(0.05, 4), [1, 0, 0, 0]);
        assert_eq!(counts(0.2, 0), [0, 1, 0, 0]);
        assert_eq!(counts(f64::INFINITY, 0), [0, 0, 1, 0]);
    }

    #[test]
    fn a_nan_is_a_silent_failure_despite_flips_and_bounds() {
        for wrong in [f64::NAN, f64::INFINITY] {
            for (fixed, golden) in [(wrong, 0.5), (0.5, wrong), (wrong, wrong)] {
                for led in [
                    lockstep(0.0, 0),
                    lockstep(f64::INFINITY, 0),
                    lockstep(0.0, 4),
                ] {
                    let found = beyond(&grey(&[fixed]), &grey(&[golden]), &led);
                    assert_eq!((found.pixels, found.silent), (1, 1), "{fixed} {golden}");
                }
            }
        }
        let mut led = lockstep(0.0, 0);
        led.bound = vec![f64::NAN, 0.25];
        let b = bounded(&led, [0, 1].into_iter());
        assert_eq!((b.max_bound, b.share_over_1), (Some(0.25), 0.5));
    }

    #[test]
    fn a_small_error_is_not_counted() {
        assert_eq!(
            beyond(
                &grey(&[0.5]),
                &grey(&[0.5 + 7.9 / 255.0]),
                &lockstep(0.0, 0)
            )
            .pixels,
            0
        );
    }

    #[test]
    fn bounds_over_1_are_counted_separately() {
        let mut led = lockstep(0.0, 0);
        led.bound = vec![0.25, 3.0, f64::INFINITY, 0.125];
        let b = bounded(&led, [0, 1, 3].into_iter());
        assert_eq!((b.max_bound, b.share_over_1), (Some(0.25), 1.0 / 3.0));
        assert_eq!(bounded(&led, [2].into_iter()).max_bound, None);
        assert_eq!(bounded(&led, std::iter::empty()).share_over_1, 0.0);
    }
}

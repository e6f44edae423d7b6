//! Flicker: how an error changes from frame to frame at pixels where the picture itself does not
//! change (docs/book/paths.md).
//!
//! ```text
//! ideal of both frames ─► still: changes by less than 0.5/255 ─┐
//! a − b of the frame ──┬─► |change| per pixel ─────────────────┴─► mean, share of jumps over 4/255
//! a − b of the last ───┘
//! ```
//! Colours are those that [`metrics`](super::metrics()) compares: linear, premultiplied, clamped to
//! [0, 1]. A pixel counts if a splat touches it in any of the three pictures of either frame, so an
//! empty background does not lower the figures. A pixel is still if no colour channel of `ideal`
//! changes by half a 255th or more. Without still pixels there is no figure. A single NaN or
//! infinite value makes all figures the worst possible: a change of 1 at every still pixel.
//!
//! Laws: `without_still_pixels_there_is_no_figure`, `a_nan_makes_flicker_the_worst_possible`,
//! `an_error_that_stays_does_not_flicker`.

use super::metrics::is_finite;
use crate::output::picture::Picture;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

/// A pixel is still if every channel of `ideal` changes by less than this.
pub const STILL: f64 = 0.5 / 255.0;
/// A greater change is a jump: a step that is visible in an 8-bit film.
pub const JUMP: f64 = 4.0 / 255.0;

/// The three pictures of a frame.
#[derive(Clone, Debug)]
pub struct Pictures {
    /// Picture of the hardware.
    pub fixed: Picture,
    /// Picture of exact arithmetic by the same rules.
    pub golden: Picture,
    /// Picture with every surface kept.
    pub ideal: Picture,
}

impl Pictures {
    /// The pictures in the order of [`FlickerSums::new`].
    pub fn all(&self) -> [&Picture; 3] {
        [&self.fixed, &self.golden, &self.ideal]
    }
}

/// Change of an error from frame to frame at still pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
#[schemars(rename = "Change")]
pub struct FlickerChange {
    /// Mean of |change| over still pixels and colour channels; none without still pixels.
    pub mean: Option<f64>,
    /// Share of the still pixels with a channel that changes by more than 4/255; none without still
    /// pixels.
    pub jumps: Option<f64>,
}

/// Flicker of two consecutive frames, or of all such pairs of a sequence together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Flicker {
    /// Pixels that a splat touches.
    pub covered_pixels: u64,
    /// Covered pixels that do not change in `ideal`.
    pub still_pixels: u64,
    /// Flicker of the arithmetic's error.
    pub fixed_vs_golden: FlickerChange,
    /// Flicker of the method's error.
    pub golden_vs_ideal: FlickerChange,
    /// Flicker of the whole error.
    pub fixed_vs_ideal: FlickerChange,
    /// Pixels with a channel that is NaN or infinite in any picture. Should be 0.
    #[serde(skip_serializing_if = "super::metrics::is_zero")]
    pub not_finite: u64,
}

/// Sums that flicker is computed from; those of several pairs of frames can be added.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FlickerSums {
    covered: u64,
    still: u64,
    not_finite: u64,
    /// fixed − golden, golden − ideal, fixed − ideal.
    changes: [ChangeSum; 3],
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct ChangeSum {
    all: f64,
    jumps: u64,
}

impl FlickerSums {
    /// Sums of a frame and the frame before it, which comes first. Each frame is `fixed`, `golden`
    /// and `ideal`, in the order of [`Pictures::all`].
    ///
    /// # Panics
    /// If sizes differ: the pictures of a sequence have one size.
    pub fn new(
        [fixed_0, golden_0, ideal_0]: [&Picture; 3],
        [fixed, golden, ideal]: [&Picture; 3],
    ) -> FlickerSums {
        let (width, height) = (ideal.width, ideal.height);
        let all = [fixed_0, golden_0, ideal_0, fixed, golden, ideal];
        assert!(
            all.iter()
                .all(|picture| (picture.width, picture.height) == (width, height)),
            "pictures of a sequence have one size"
        );
        // Rows are added from the top, so that the result does not depend on the number of threads.
        let row = |y: usize| {
            (y * width..(y + 1) * width).fold(FlickerSums::default(), |sums, index| {
                sums.and(&FlickerSums::of_pixel(&all, index))
            })
        };
        let rows: Vec<FlickerSums> = (0..height).into_par_iter().map(row).collect();
        rows.iter()
            .fold(FlickerSums::default(), |sums, row| sums.and(row))
    }

    fn of_pixel(pictures: &[&Picture; 6], index: usize) -> FlickerSums {
        let mut sums = FlickerSums::default();
        if !pictures.iter().all(|picture| is_finite(picture, index)) {
            sums.not_finite = 1;
            return sums;
        }
        if !pictures.iter().any(|picture| picture.covered[index]) {
            return sums;
        }
        sums.covered = 1;
        let [fixed_0, golden_0, ideal_0, fixed, golden, ideal] = pictures.map(|picture| {
            let [r, g, b, _] = picture.rgba[index];
            [r, g, b].map(|channel| channel.clamp(0.0, 1.0))
        });
        let change = |[a, b, c, d]: [&[f64; 3]; 4]| -> [f64; 3] {
            std::array::from_fn(|i| ((a[i] - b[i]) - (c[i] - d[i])).abs())
        };
        let most = |change: &[f64; 3]| change.iter().copied().fold(0.0, f64::max);
        let moved: [f64; 3] = std::array::from_fn(|i| (ideal[i] - ideal_0[i]).abs());
        if most(&moved) >= STILL {
            return sums;
        }
        sums.still = 1;
        let pairs = [
            [&fixed, &golden, &fixed_0, &golden_0],
            [&golden, &ideal, &golden_0, &ideal_0],
            [&fixed, &ideal, &fixed_0, &ideal_0],
        ];
        sums.changes = pairs.map(change).map(|change| ChangeSum {
            all: change.iter().sum(),
            jumps: u64::from(most(&change) > JUMP),
        });
        sums
    }

    /// Sum of both.
    pub fn and(self, next: &FlickerSums) -> FlickerSums {
        let changes = std::array::from_fn(|i| {
            let (a, b) = (self.changes[i], next.changes[i]);
            ChangeSum {
                all: a.all + b.all,
                jumps: a.jumps + b.jumps,
            }
        });
        FlickerSums {
            covered: self.covered + next.covered,
            still: self.still + next.still,
            not_finite: self.not_finite + next.not_finite,
            changes,
        }
    }

    /// The figures of these sums.
    pub fn flicker(&self) -> Flicker {
        let change = |sum: &ChangeSum| {
            if self.not_finite > 0 {
                return FlickerChange {
                    mean: Some(1.0),
                    jumps: Some(1.0),
                };
            }
            let of_still = |part: f64| (self.still > 0).then(|| part / self.still as f64);
            FlickerChange {
                mean: of_still(sum.all / 3.0),
                jumps: of_still(sum.jumps as f64),
            }
        };
        let [fixed_vs_golden, golden_vs_ideal, fixed_vs_ideal] =
            self.changes.each_ref().map(change);
        let FlickerSums {
            covered: covered_pixels,
            still: still_pixels,
            not_finite,
            ..
        } = *self;
        Flicker {
            covered_pixels,
            still_pixels,
            fixed_vs_golden,
            golden_vs_ideal,
            fixed_vs_ideal,
            not_finite,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(colours: &[f64]) -> Picture {
        let rgba = colours
            .iter()
            .map(|value| [*value, 0.5, 0.25, 1.0])
            .collect();
        Picture {
            width: colours.len(),
            height: 1,
            rgba,
            covered: vec![true; colours.len()],
        }
    }

    fn frame(fixed: &[f64], golden: &[f64], ideal: &[f64]) -> Pictures {
        Pictures {
            fixed: picture(fixed),
            golden: picture(golden),
            ideal: picture(ideal),
        }
    }

    fn close(found: Option<f64>, expected: f64) -> bool {
        (found.unwrap() - expected).abs() < 1e-15
    }

    /// Worked out by hand, for four pixels: one moves and does not count, one has a jump of 5/255
    /// in its arithmetic, one of 6/255 in its method, and one does not change.
    #[test]
    fn changes_and_jumps_are_those_worked_out_by_hand() {
        let s = 1.0 / 255.0;
        let before = frame(&[0.2, 0.2, 0.2, 0.7], &[0.2; 4], &[0.2; 4]);
        let now = frame(
            &[0.9, 0.2 + 5.0 * s, 0.2 + 6.0 * s, 0.7],
            &[0.9, 0.2, 0.2 + 6.0 * s, 0.2],
            &[0.9, 0.2 + 0.4 * s, 0.2, 0.2],
        );
        let found = FlickerSums::new(before.all(), now.all()).flicker();
        assert_eq!(
            (found.covered_pixels, found.still_pixels, found.not_finite),
            (4, 3, 0)
        );
        assert!(
            close(found.fixed_vs_golden.jumps, 1.0 / 3.0)
                && close(found.fixed_vs_golden.mean, 5.0 * s / 9.0),
            "{found:?}"
        );
        assert!(
            close(found.golden_vs_ideal.jumps, 1.0 / 3.0)
                && close(found.golden_vs_ideal.mean, 6.4 * s / 9.0),
            "{found:?}"
        );
        assert!(
            close(found.fixed_vs_ideal.jumps, 2.0 / 3.0)
                && close(found.fixed_vs_ideal.mean, 10.6 * s / 9.0),
            "{found:?}"
        );
    }

    #[test]
    fn an_error_that_stays_does_not_flicker() {
        let wrong = frame(&[1.0, 0.0], &[0.5, 0.9], &[0.1, 0.2]);
        let found = FlickerSums::new(wrong.all(), wrong.all()).flicker();
        assert_eq!(
            found.fixed_vs_golden,
            FlickerChange {
                mean: Some(0.0),
                jumps: Some(0.0)
            }
        );
        assert_eq!(found.golden_vs_ideal, found.fixed_vs_golden);
    }

    #[test]
    fn without_still_pixels_there_is_no_figure() {
        let (before, now) = (
            frame(&[0.1], &[0.1], &[0.0]),
            frame(&[0.2], &[0.2], &[STILL]),
        );
        let found = FlickerSums::new(before.all(), now.all()).flicker();
        assert_eq!((found.covered_pixels, found.still_pixels), (1, 0));
        assert_eq!(
            found.fixed_vs_golden,
            FlickerChange {
                mean: None,
                jumps: None
            }
        );
    }

    #[test]
    fn uncovered_pixels_are_not_counted() {
        let mut frames = [
            frame(&[0.1; 3], &[0.1; 3], &[0.1; 3]),
            frame(&[0.1, 0.1, 0.3], &[0.1; 3], &[0.1; 3]),
        ];
        for frame in &mut frames {
            for picture in [&mut frame.fixed, &mut frame.golden, &mut frame.ideal] {
                picture.covered = vec![false, false, true];
            }
        }
        let found = FlickerSums::new(frames[0].all(), frames[1].all()).flicker();
        assert_eq!(
            (
                found.covered_pixels,
                found.still_pixels,
                found.fixed_vs_golden.jumps
            ),
            (1, 1, Some(1.0))
        );
        // One covered picture of one frame is enough.
        frames[0].fixed.covered[0] = true;
        assert_eq!(
            FlickerSums::new(frames[0].all(), frames[1].all())
                .flicker()
                .covered_pixels,
            2
        );
    }

    #[test]
    fn a_nan_makes_flicker_the_worst_possible() {
        let still = frame(&[0.1; 4], &[0.1; 4], &[0.1; 4]);
        for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for which in 0..3 {
                for channel in 0..4 {
                    let mut broken = still.clone();
                    [&mut broken.fixed, &mut broken.golden, &mut broken.ideal][which].rgba[2]
                        [channel] = wrong;
                    for found in [
                        FlickerSums::new(still.all(), broken.all()).flicker(),
                        FlickerSums::new(broken.all(), still.all()).flicker(),
                    ] {
                        assert_eq!((found.not_finite, found.still_pixels), (1, 3));
                        for change in [
                            found.fixed_vs_golden,
                            found.golden_vs_ideal,
                            found.fixed_vs_ideal,
                        ] {
                            assert_eq!(
                                change,
                                FlickerChange {
                                    mean: Some(1.0),
                                    jumps: Some(1.0)
                                }
                            );
                        }
                    }
                }
            }
        }
    }

    /// Pairs with more still pixels weigh more.
    #[test]
    fn pairs_of_frames_add_up_by_their_pixels() {
        let quiet = FlickerSums {
            covered: 9,
            still: 9,
            ..FlickerSums::default()
        };
        let jumpy = FlickerSums {
            covered: 5,
            still: 1,
            changes: [ChangeSum { all: 0.3, jumps: 1 }; 3],
            ..FlickerSums::default()
        };
        let found = quiet.and(&jumpy).flicker();
        assert!(
            close(found.fixed_vs_ideal.jumps, 0.1) && close(found.fixed_vs_ideal.mean, 0.01),
            "{found:?}"
        );
        assert_eq!((found.covered_pixels, found.still_pixels), (14, 10));
    }
}

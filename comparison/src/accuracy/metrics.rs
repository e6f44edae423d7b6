//! Metrics: the distance between two pictures of one scene (docs/book/accuracy.md).
//!
//! A NaN or infinite value is at the greatest distance from any other value, and a picture that
//! contains one is at the greatest distance from any other picture: 0 dB, error 1. Therefore no
//! comparison can take it for equal or good.
//!
//! Law: `nan_is_never_equal`.

mod flip;
mod ssim;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use crate::output::picture::Picture;
pub use flip::PIXELS_PER_DEGREE;

/// Distance of two pictures: over the colour channels, linear and premultiplied, clamped to [0, 1].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Metrics {
    /// Peak 1, all pixels and channels; none for equal pictures.
    pub psnr_db: Option<f64>,
    /// The same over the pixels that a splat touches in either picture.
    pub psnr_covered_db: Option<f64>,
    /// Structural similarity, 1 for equal pictures; mean of the channels.
    pub ssim: f64,
    /// Greatest absolute difference.
    pub max_error: f64,
    /// Mean absolute difference over all pixels and channels.
    pub mean_error: f64,
    /// Pixels with a channel that differs by more than 1/255.
    pub pixels_over_1_255: u64,
    /// Pixels with a channel that is NaN or infinite in either picture. Should be 0.
    #[serde(skip_serializing_if = "is_zero")]
    pub not_finite: u64,
}

/// Compares two pictures.
///
/// # Panics
/// If their sizes differ: pictures of one scene have one size.
pub fn metrics(a: &Picture, b: &Picture) -> Metrics {
    assert_eq!(
        (a.width, a.height),
        (b.width, b.height),
        "pictures of one scene have one size"
    );
    let sums = ErrorSums::new(a, b);
    let pixels = (a.width * a.height) as f64;
    if sums.not_finite > 0 {
        return Metrics {
            psnr_db: Some(0.0),
            psnr_covered_db: Some(0.0),
            ssim: 0.0,
            max_error: 1.0,
            mean_error: 1.0,
            pixels_over_1_255: sums.pixels_over,
            not_finite: sums.not_finite,
        };
    }
    Metrics {
        psnr_db: psnr_db(sums.squares, 3.0 * pixels),
        psnr_covered_db: psnr_db(sums.covered_squares, 3.0 * sums.covered_pixels as f64),
        ssim: ssim::ssim(a, b),
        max_error: sums.max,
        mean_error: sums.errors / (3.0 * pixels),
        pixels_over_1_255: sums.pixels_over,
        not_finite: 0,
    }
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde calls it with a reference"
)]
pub(super) fn is_zero(count: &u64) -> bool {
    *count == 0
}

/// Decibels for a summary: `equal` for equal pictures, `NaN` if a pixel is not finite.
pub fn db_text(db: Option<f64>, not_finite: u64, show: impl Fn(f64) -> String) -> String {
    match db {
        _ if not_finite > 0 => "NaN".into(),
        None => "equal".into(),
        Some(db) => show(db),
    }
}

/// The colour of a pixel as it is compared.
fn clamped(picture: &Picture, index: usize) -> [f64; 3] {
    let [r, g, b, _] = picture.rgba[index];
    [r, g, b].map(|channel| channel.clamp(0.0, 1.0))
}

/// Distance of two pictures pixel by pixel, which is quick to compute.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Distance {
    /// As [`Metrics::psnr_db`].
    pub psnr_db: Option<f64>,
    /// As [`Metrics::psnr_covered_db`].
    pub psnr_covered_db: Option<f64>,
    /// Mean absolute difference over the pixels that a splat touches in either picture, and the
    /// colour channels.
    pub mean_covered_error: f64,
    /// As [`Metrics::max_error`].
    pub max_error: f64,
    /// As [`Metrics::not_finite`].
    #[serde(skip_serializing_if = "is_zero")]
    pub not_finite: u64,
}

/// Compares two pictures without their structural similarity.
///
/// # Panics
/// If their sizes differ.
pub fn distance(a: &Picture, b: &Picture) -> Distance {
    assert_eq!(
        (a.width, a.height),
        (b.width, b.height),
        "pictures of one scene have one size"
    );
    let sums = ErrorSums::new(a, b);
    let values = 3.0 * sums.covered_pixels as f64;
    if sums.not_finite > 0 {
        let not_finite = sums.not_finite;
        return Distance {
            psnr_db: Some(0.0),
            psnr_covered_db: Some(0.0),
            mean_covered_error: 1.0,
            max_error: 1.0,
            not_finite,
        };
    }
    Distance {
        psnr_db: psnr_db(sums.squares, 3.0 * (a.width * a.height) as f64),
        psnr_covered_db: psnr_db(sums.covered_squares, values),
        mean_covered_error: if values > 0.0 {
            sums.covered_errors / values
        } else {
            0.0
        },
        max_error: sums.max,
        not_finite: 0,
    }
}

/// How close a drawn picture comes to a given one, as papers on splatting measure it: over the
/// colour channels, of values as files store them (sRGB code values from 0 to 1, not linear light).
/// Means over several pictures are means of these figures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Fidelity {
    /// Peak 1, all pixels and channels; none for equal pictures (it is infinite). A mean is none if
    /// that of one frame is.
    pub psnr_db: Option<f64>,
    /// Structural similarity, 1 for equal pictures; mean of the channels. Gaussian window of 11×11
    /// pixels, σ 1.5, at positions where it is inside the picture.
    pub ssim: f64,
    /// FLIP, mean over the pixels: how large the difference looks, 0 (none) to 1, at 67.02 pixels
    /// per degree.
    pub flip: f64,
    /// Pixels of the drawn picture with a channel that is NaN or infinite; the figures are then 0
    /// dB, 0 and 1. Should be 0.
    #[serde(skip_serializing_if = "is_zero")]
    pub not_finite: u64,
}

/// Compares a drawn picture with a given one, both of sRGB code values.
///
/// # Panics
/// If their sizes differ.
pub fn fidelity(drawn: &Picture, given: &Picture) -> Fidelity {
    assert_eq!(
        (drawn.width, drawn.height),
        (given.width, given.height),
        "pictures that are compared have one size"
    );
    let sums = ErrorSums::new(drawn, given);
    if sums.not_finite > 0 {
        return Fidelity {
            psnr_db: Some(0.0),
            ssim: 0.0,
            flip: 1.0,
            not_finite: sums.not_finite,
        };
    }
    Fidelity {
        psnr_db: psnr_db(sums.squares, 3.0 * (drawn.width * drawn.height) as f64),
        ssim: ssim::ssim(drawn, given),
        flip: flip::flip(given, drawn),
        not_finite: 0,
    }
}

/// Greatest absolute difference of two pictures at one pixel, of the colour channels.
pub fn pixel_error(a: &Picture, b: &Picture, index: usize) -> f64 {
    difference(a, b, index).into_iter().fold(0.0, f64::max)
}

/// Squared error and greatest error of a pixel's values, over the colour channels, as [`distance`]
/// adds them up; `None` if a value is NaN or infinite.
pub fn pixel_errors(rgba: &[f64; 4], exact: &Picture, index: usize) -> Option<(f64, f64)> {
    let is_finite = rgba.iter().all(|value| value.is_finite()) && is_finite(exact, index);
    let [r, g, b, _] = *rgba;
    let own = [r, g, b].map(|channel| channel.clamp(0.0, 1.0));
    let exact = clamped(exact, index);
    let errors: [f64; 3] = std::array::from_fn(|channel| (own[channel] - exact[channel]).abs());
    is_finite.then(|| {
        (
            errors.iter().map(|error| error * error).sum(),
            errors.into_iter().fold(0.0, f64::max),
        )
    })
}

/// Absolute difference of two pictures at one pixel; 1 if either value is NaN or infinite.
pub(super) fn difference(a: &Picture, b: &Picture, index: usize) -> [f64; 3] {
    if !is_finite(a, index) || !is_finite(b, index) {
        return [1.0; 3];
    }
    let (a, b) = (clamped(a, index), clamped(b, index));
    std::array::from_fn(|channel| (a[channel] - b[channel]).abs())
}

/// Whether all four values of a pixel are finite.
pub fn is_finite(picture: &Picture, index: usize) -> bool {
    picture.rgba[index]
        .iter()
        .all(|channel| channel.is_finite())
}

/// Sums of one row; rows are added from the top, so that the result does not depend on the number
/// of threads.
#[derive(Clone, Copy, Default)]
struct ErrorSums {
    squares: f64,
    covered_squares: f64,
    covered_errors: f64,
    covered_pixels: u64,
    errors: f64,
    max: f64,
    pixels_over: u64,
    not_finite: u64,
}

impl ErrorSums {
    fn new(a: &Picture, b: &Picture) -> ErrorSums {
        let rows: Vec<ErrorSums> = (0..a.height)
            .into_par_iter()
            .map(|y| ErrorSums::of_row(a, b, y))
            .collect();
        rows.into_iter().fold(ErrorSums::default(), ErrorSums::and)
    }

    fn of_row(a: &Picture, b: &Picture, y: usize) -> ErrorSums {
        let mut sums = ErrorSums::default();
        for index in y * a.width..(y + 1) * a.width {
            let error = difference(a, b, index);
            let squares = error.iter().map(|e| e * e).sum::<f64>();
            sums.squares += squares;
            if a.covered[index] || b.covered[index] {
                sums.covered_squares += squares;
                sums.covered_errors += error.iter().sum::<f64>();
                sums.covered_pixels += 1;
            }
            sums.errors += error.iter().sum::<f64>();
            let worst = error.into_iter().fold(0.0, f64::max);
            sums.max = sums.max.max(worst);
            sums.pixels_over += u64::from(worst > 1.0 / 255.0);
            sums.not_finite += u64::from(!is_finite(a, index) || !is_finite(b, index));
        }
        sums
    }

    fn and(self, next: ErrorSums) -> ErrorSums {
        ErrorSums {
            squares: self.squares + next.squares,
            covered_squares: self.covered_squares + next.covered_squares,
            covered_errors: self.covered_errors + next.covered_errors,
            covered_pixels: self.covered_pixels + next.covered_pixels,
            errors: self.errors + next.errors,
            max: self.max.max(next.max),
            pixels_over: self.pixels_over + next.pixels_over,
            not_finite: self.not_finite + next.not_finite,
        }
    }
}

/// `10·log10(1 / mean square)`.
fn psnr_db(squares: f64, values: f64) -> Option<f64> {
    (squares > 0.0).then(|| -10.0 * libm::log10(squares / values))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Colours that both this program and the one that computed the expected numbers can produce:
    /// with numpy's `y, x, c = mgrid[0:h, 0:w, 0:3]`, `a = (7x + 13y + 5c) % 32 / 31`,
    /// `b = clip(a + ((3x + 5y + c) % 8 − 4) / 64, 0, 1)`. The left half of `a` is covered, nothing
    /// of `b`.
    fn pair(width: usize, height: usize) -> (Picture, Picture) {
        let pixel = |index: usize| {
            let (x, y) = (index % width, index / width);
            let a: [f64; 3] =
                std::array::from_fn(|c| ((7 * x + 13 * y + 5 * c) % 32) as f64 / 31.0);
            let shift = |c: usize| (((3 * x + 5 * y + c) % 8) as f64 - 4.0) / 64.0;
            (
                a,
                std::array::from_fn(|c| (a[c] + shift(c)).clamp(0.0, 1.0)),
            )
        };
        let (a, b): (Vec<[f64; 3]>, Vec<[f64; 3]>) = (0..width * height).map(pixel).unzip();
        let picture = |colours: Vec<[f64; 3]>, covered: &dyn Fn(usize) -> bool| Picture {
            width,
            height,
            rgba: colours
                .into_iter()
                .map(|[r, g, b]| [r, g, b, 1.0])
                .collect(),
            covered: (0..width * height).map(covered).collect(),
        };
        (
            picture(a, &|index| index % width < width / 2),
            picture(b, &|_| false),
        )
    }

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-12
    }

    /// From numpy: `d = abs(a − b)`, `−10·log10((d·d).mean())` and so on.
    #[test]
    fn distances_equal_those_of_numpy() {
        let (a, b) = pair(24, 20);
        let metrics = metrics(&a, &b);
        assert!(
            close(metrics.psnr_db.unwrap(), 29.104267601378865),
            "{metrics:?}"
        );
        assert!(
            close(metrics.psnr_covered_db.unwrap(), 29.10007602797664),
            "{metrics:?}"
        );
        assert!(
            close(metrics.max_error, 0.0625) && close(metrics.mean_error, 0.029324526769713262),
            "{metrics:?}"
        );
        assert_eq!(metrics.pixels_over_1_255, 480);
        let distance = distance(&a, &b);
        assert_eq!(
            (distance.psnr_covered_db, distance.max_error),
            (metrics.psnr_covered_db, metrics.max_error)
        );
        assert_eq!(distance.psnr_db, metrics.psnr_db);
        assert!(
            close(distance.mean_covered_error, 0.02933537746415771),
            "{distance:?}"
        );
    }

    /// From scikit-image: `structural_similarity(a, b, gaussian_weights=True, sigma=1.5,
    /// use_sample_covariance=False, data_range=1, channel_axis=2)`.
    #[test]
    fn ssim_equals_that_of_scikit_image() {
        let (a, b) = pair(24, 20);
        assert!(close(metrics(&a, &b).ssim, 0.9932441143041267));
        let (a, b) = pair(11, 11);
        assert!(close(metrics(&a, &b).ssim, 0.9927437188116529));
    }

    /// From numpy, with a matrix of renormalised window weights for each side.
    #[test]
    fn ssim_cuts_its_window_at_a_narrower_picture() {
        for (width, height, expected) in [(7, 20, 0.9930814245918298), (3, 2, 0.9921228786918073)] {
            let (a, b) = pair(width, height);
            assert!(close(metrics(&a, &b).ssim, expected), "{width}×{height}");
        }
    }

    /// Whole numbers of 8 bits: with numpy's `a = (x² + y² + 37cx) // (5 + c) % 256`,
    /// `b = clip(a + (x//6·(c + 1) + y//6) % 7·9 − 20, 0, 255)`.
    fn rings(width: usize, height: usize) -> (Picture, Picture) {
        let code = |x: usize, y: usize, c: usize| (x * x + y * y + 37 * c * x) / (5 + c) % 256;
        let other = |x: usize, y: usize, c: usize| {
            let shift = ((x / 6 * (c + 1) + y / 6) % 7 * 9) as i64 - 20;
            (code(x, y, c) as i64 + shift).clamp(0, 255) as usize
        };
        let picture = |code: &dyn Fn(usize, usize, usize) -> usize| {
            let pixel = |index: usize| {
                let [r, g, b] =
                    [0, 1, 2].map(|c| code(index % width, index / width, c) as f64 / 255.0);
                [r, g, b, 1.0]
            };
            Picture {
                width,
                height,
                rgba: (0..width * height).map(pixel).collect(),
                covered: vec![true; width * height],
            }
        };
        (picture(&code), picture(&other))
    }

    fn plain(width: usize, height: usize, [r, g, b]: [f64; 3]) -> Picture {
        Picture {
            width,
            height,
            rgba: vec![[r, g, b, 1.0]; width * height],
            covered: vec![true; width * height],
        }
    }

    /// From the authors' program: `flip_evaluator.evaluate(a, b, "LDR", applyMagma=False)` of
    /// flip-evaluator 1.7 (PyPI), mean of its map in numpy's float64. The program computes in 32
    /// bits: rounding leaves edges of 3e-9 in a plain picture, and their root is a feature of 5e-5.
    #[test]
    fn flip_equals_that_of_its_authors_program() {
        let of = |(a, b): (Picture, Picture)| (fidelity(&b, &a).flip, fidelity(&a, &b).flip);
        for (pictures, expected) in [
            (pair(24, 20), 0.08018433192046359),
            (pair(3, 2), 0.11727192625403404),
            (pair(64, 48), 0.07379628599179948),
            (rings(40, 30), 0.3666589738273372),
            // More rows than a band.
            (rings(96, 80), 0.32718445034261096),
            (
                (plain(5, 4, [0.0, 1.0, 0.0]), plain(5, 4, [0.0, 0.0, 1.0])),
                1.0,
            ),
            (
                (plain(5, 4, [0.5; 3]), plain(5, 4, [0.6, 0.5, 0.4])),
                0.3260801434516907,
            ),
            (
                (plain(5, 4, [0.0; 3]), plain(5, 4, [1.0; 3])),
                0.9673883318901062,
            ),
        ] {
            let size = (pictures.0.width, pictures.0.height);
            let (one, other) = of(pictures);
            let most = if size == (5, 4) { 5e-5 } else { 2e-6 };
            assert!(
                (one - expected).abs() < most,
                "{size:?}: {one} and not {expected}"
            );
            assert!((one - other).abs() < 1e-15, "{size:?}: {one} and {other}");
        }
    }

    /// Worked out by hand: a mean square of (0.1² + 0² + 0.2²)/3 is 17.782 dB; without variance
    /// only the luminance term of SSIM remains.
    #[test]
    fn fidelity_of_two_plain_pictures_equals_that_worked_out_by_hand() {
        let (a, b) = (
            plain(13, 12, [0.5, 0.25, 0.8]),
            plain(13, 12, [0.6, 0.25, 0.6]),
        );
        let found = fidelity(&a, &b);
        assert!(
            close(found.psnr_db.unwrap(), 17.781512503836435),
            "{found:?}"
        );
        let luminance = |p: f64, q: f64| (2.0 * p * q + 1e-4) / (p * p + q * q + 1e-4);
        let expected = (luminance(0.5, 0.6) + 1.0 + luminance(0.8, 0.6)) / 3.0;
        assert!(
            (found.ssim - expected).abs() < 1e-10,
            "{found:?} and not {expected}"
        );
        assert_eq!(
            fidelity(&a, &a),
            Fidelity {
                psnr_db: None,
                ssim: 1.0,
                flip: 0.0,
                not_finite: 0
            }
        );
        let mut broken = a.clone();
        broken.rgba[77][1] = f64::NAN;
        assert_eq!(
            fidelity(&broken, &a),
            Fidelity {
                psnr_db: Some(0.0),
                ssim: 0.0,
                flip: 1.0,
                not_finite: 1
            }
        );
    }

    #[test]
    fn one_pixel_can_be_compared() {
        let pixel = |value: f64| Picture {
            width: 1,
            height: 1,
            rgba: vec![[value, value, value, 1.0]],
            covered: vec![true],
        };
        let metrics = metrics(&pixel(0.5), &pixel(0.25));
        // A mean square of 1/16; without variance only the luminance term of SSIM remains.
        assert!(close(metrics.psnr_db.unwrap(), 12.041199826559248));
        assert!(close(metrics.ssim, (2.0 * 0.125 + 1e-4) / (0.3125 + 1e-4)));
        assert_eq!(
            (
                metrics.max_error,
                metrics.mean_error,
                metrics.pixels_over_1_255
            ),
            (0.25, 0.25, 1)
        );
    }

    #[test]
    fn equal_or_uncovered_pictures_have_no_psnr() {
        let (a, b) = pair(24, 20);
        let same = metrics(&a, &a);
        assert_eq!(
            (same.psnr_db, same.psnr_covered_db, same.ssim),
            (None, None, 1.0)
        );
        let nothing_covered = Picture {
            covered: vec![false; a.covered.len()],
            ..a
        };
        assert_eq!(metrics(&nothing_covered, &b).psnr_covered_db, None);
    }

    #[test]
    fn one_255th_is_not_over_one_255th() {
        let picture = |value: f64| Picture {
            width: 1,
            height: 1,
            rgba: vec![[value, 0.0, 0.0, 1.0]],
            covered: vec![true],
        };
        assert_eq!(
            metrics(&picture(0.0), &picture(1.0 / 255.0)).pixels_over_1_255,
            0
        );
        assert_eq!(
            metrics(&picture(0.0), &picture(1.001 / 255.0)).pixels_over_1_255,
            1
        );
    }

    #[test]
    fn values_out_of_range_are_clamped_before_comparison() {
        let picture = |value: f64| Picture {
            width: 1,
            height: 1,
            rgba: vec![[value; 4]],
            covered: vec![true],
        };
        assert_eq!(metrics(&picture(1.0), &picture(7.0)).psnr_db, None);
    }

    #[test]
    fn nan_is_never_equal() {
        let black = Picture {
            width: 40,
            height: 40,
            rgba: vec![[0.0; 4]; 1600],
            covered: vec![true; 1600],
        };
        for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for channel in 0..4 {
                let mut other = black.clone();
                other.rgba[7][channel] = wrong;
                // Against a finite one in both orders, and against itself.
                for (a, b) in [(&black, &other), (&other, &black), (&other, &other)] {
                    let (m, d) = (metrics(a, b), distance(a, b));
                    assert_eq!(
                        (m.not_finite, m.psnr_db, m.psnr_covered_db, m.max_error),
                        (1, Some(0.0), Some(0.0), 1.0),
                        "{wrong}"
                    );
                    assert_eq!(
                        (d.not_finite, d.psnr_db, d.psnr_covered_db, d.max_error),
                        (1, Some(0.0), Some(0.0), 1.0),
                        "{wrong}"
                    );
                    assert_eq!(
                        (m.pixels_over_1_255, m.ssim, d.mean_covered_error),
                        (1, 0.0, 1.0),
                        "{wrong}"
                    );
                    assert_eq!(pixel_error(a, b, 7), 1.0);
                    assert_eq!(db_text(m.psnr_db, m.not_finite, |db| db.to_string()), "NaN");
                }
            }
        }
    }
}

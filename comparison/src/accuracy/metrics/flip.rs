//! FLIP: how large the difference of two pictures looks to a viewer who flips between them, 0 to 1
//! (Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild: *FLIP: A Difference Evaluator
//! for Alternating Images*, HPG 2020), mean over the pixels, of sRGB code values.
//!
//! ```text
//! sRGB ─► Y Cx Cz ─┬─► contrast sensitivity ─► linear RGB, clamped ─► L*a*b*, Hunt ─► HyAB ─► remapped ─► colour ─┐
//!                  └─► grey ─► edges, points ──────────────────────────────────────────────────────────► feature ─┴─► colour^(1 − feature)
//! ```
//! All filters are separable; beyond the border the outermost pixels of a picture are repeated.
//! Checked against the authors' `flip-evaluator` 1.7.

use std::ops::Range;
use std::sync::LazyLock;

use rayon::prelude::*;

use crate::output::colour::srgb_decode;
use crate::output::picture::Picture;

/// Pixels per degree of the viewer's field of view: a picture on a screen of 3840 pixels, 0.7 m
/// wide, seen from 0.7 m (the paper's default).
pub const PIXELS_PER_DEGREE: f64 = 3840.0 * std::f64::consts::PI / 180.0;

/// Sums of Gaussians that model the contrast sensitivity of Y, Cx and Cz: amplitude and width,
/// degree² (the paper's table 1).
const SENSITIVITY_Y: [f64; 2] = [1.0, 0.0047];
const SENSITIVITY_CX: [f64; 2] = [1.0, 0.0053];
const SENSITIVITY_CZ: [[f64; 2]; 2] = [[34.1, 0.04], [13.5, 0.025]];
/// Width of the detected features, degrees.
const FEATURE_DEGREES: f64 = 0.082;
/// Exponents of the colour difference and of the feature difference, and the bend of the colour
/// difference: this part of the greatest maps to that value.
const COLOUR_EXPONENT: f64 = 0.7;
const FEATURE_EXPONENT: f64 = 0.5;
const BEND: [f64; 2] = [0.4, 0.95];

/// D65, to which Y Cx Cz and L*a*b* refer.
const WHITE: [f64; 3] = [0.950_428_545, 1.0, 1.088_900_371];
/// Rows that a thread filters at a time.
const BAND: usize = 64;

/// Filter weights at one position: Y, Cx, the two Gaussians of Cz, and for features a Gaussian and
/// its first and second derivative.
type Tap = [f64; 7];

struct Filters {
    radius: usize,
    /// Positions from −radius to radius.
    taps: Vec<Tap>,
    /// Greatest difference of colours: that of green and blue.
    most: f64,
}

static FILTERS: LazyLock<Filters> = LazyLock::new(Filters::new);

impl Filters {
    fn new() -> Self {
        let widest = SENSITIVITY_CZ[0][1];
        let sigma_px = 0.5 * FEATURE_DEGREES * PIXELS_PER_DEGREE;
        let pi = std::f64::consts::PI;
        let radius = (3.0 * (widest / (2.0 * pi * pi)).sqrt() * PIXELS_PER_DEGREE).ceil();
        let feature_radius = (3.0 * sigma_px).ceil();
        let radius = radius.max(feature_radius) as usize;
        let tap = |at: usize| {
            let x = at as f64 - radius as f64;
            let degrees = x / PIXELS_PER_DEGREE;
            let bell = |width: f64| libm::exp(-pi * pi * degrees * degrees / width);
            // A sum of two Gaussians is not separable. Each is filtered separately along both axes,
            // with the root of its amplitude.
            let cz = |[amplitude, width]: [f64; 2]| {
                (amplitude * (pi / width).sqrt()).sqrt() * bell(width)
            };
            let smooth = if x.abs() <= feature_radius {
                libm::exp(-x * x / (2.0 * sigma_px * sigma_px))
            } else {
                0.0
            };
            let (edge, point) = (-x * smooth, (x * x / (sigma_px * sigma_px) - 1.0) * smooth);
            [
                bell(SENSITIVITY_Y[1]),
                bell(SENSITIVITY_CX[1]),
                cz(SENSITIVITY_CZ[0]),
                cz(SENSITIVITY_CZ[1]),
                smooth,
                edge,
                point,
            ]
        };
        let taps: Vec<Tap> = (0..=2 * radius).map(tap).collect();
        let sum = |nth: usize| taps.iter().map(|tap| tap[nth]).sum::<f64>();
        let positive = |nth: usize| taps.iter().map(|tap| tap[nth].max(0.0)).sum::<f64>();
        let negative = |nth: usize| taps.iter().map(|tap| (-tap[nth]).max(0.0)).sum::<f64>();
        let cz = (sum(2) * sum(2) + sum(3) * sum(3)).sqrt();
        // Positive and negative weights of a derivative sum to 1 each.
        let derivative = |value: f64, nth: usize| {
            value
                / if value > 0.0 {
                    positive(nth)
                } else {
                    negative(nth)
                }
        };
        let normal = |[y, cx, one, other, smooth, edge, point]: &Tap| {
            [
                y / sum(0),
                cx / sum(1),
                one / cz,
                other / cz,
                smooth / sum(4),
                derivative(*edge, 5),
                derivative(*point, 6),
            ]
        };
        let most = hyab(hunt(lab([0.0, 1.0, 0.0])), hunt(lab([0.0, 0.0, 1.0])));
        Filters {
            radius,
            taps: taps.iter().map(normal).collect(),
            most: libm::pow(most, COLOUR_EXPONENT),
        }
    }

    /// Difference of two filtered colours, remapped to 0 to 1.
    fn colour(&self, a: &Filtered, b: &Filtered) -> f64 {
        let seen =
            |of: &Filtered| hunt(lab(linear_of(of.colour).map(|light| light.clamp(0.0, 1.0))));
        let difference = libm::pow(hyab(seen(a), seen(b)), COLOUR_EXPONENT);
        let ([part, value], most) = (BEND, self.most);
        let bend = part * most;
        if difference < bend {
            difference * value / bend
        } else {
            value + (difference - bend) / (most - bend) * (1.0 - value)
        }
    }
}

/// Filtered values of a pixel.
#[derive(Clone, Copy, Default)]
struct Filtered {
    /// Y, Cx, Cz.
    colour: [f64; 3],
    /// First derivatives of grey across and down, and the second ones.
    edge: [f64; 2],
    point: [f64; 2],
}

/// Mean FLIP of two pictures of one size, of sRGB code values.
pub(super) fn flip(reference: &Picture, test: &Picture) -> f64 {
    let bands: Vec<usize> = (0..reference.height).step_by(BAND).collect();
    let sums: Vec<f64> = bands
        .into_par_iter()
        .map(|first| band_sum(reference, test, first..(first + BAND).min(reference.height)))
        .collect();
    sums.iter().sum::<f64>() / (reference.width * reference.height) as f64
}

fn band_sum(reference: &Picture, test: &Picture, rows: Range<usize>) -> f64 {
    let filters = &*FILTERS;
    let [a, b] = [reference, test].map(|picture| filtered(picture, rows.clone(), filters));
    a.iter()
        .zip(&b)
        .map(|(a, b)| libm::pow(filters.colour(a, b), 1.0 - feature(a, b)))
        .sum()
}

/// Rows of a picture, filtered: along each row first, then down the columns.
fn filtered(picture: &Picture, rows: Range<usize>, filters: &Filters) -> Vec<Filtered> {
    let Filters { radius, taps, .. } = filters;
    let needed = rows.start.saturating_sub(*radius)..(rows.end + radius).min(picture.height);
    // Positions start at −radius; those outside the picture read the outermost pixel.
    let pixel = |place: usize, size: usize| place.saturating_sub(*radius).min(size - 1);
    let along = |y: usize| {
        let row: Vec<[f64; 3]> = (0..picture.width)
            .map(|x| opponent(picture.rgba[y * picture.width + x]))
            .collect();
        let at = |x: usize| {
            let mut sums = Tap::default();
            for (nth, tap) in taps.iter().enumerate() {
                let [luma, cx, cz] = row[pixel(x + nth, picture.width)];
                let grey = (luma + 16.0) / 116.0;
                let values = [luma, cx, cz, cz, grey, grey, grey];
                (0..7).for_each(|i| sums[i] += tap[i] * values[i]);
            }
            sums
        };
        (0..picture.width).map(at).collect::<Vec<Tap>>()
    };
    let sums: Vec<Vec<Tap>> = needed.clone().map(along).collect();
    let mut all = vec![Filtered::default(); rows.len() * picture.width];
    for (row, y) in all.chunks_mut(picture.width).zip(rows) {
        for (nth, [of_y, of_cx, one, other, smooth, edge, point]) in taps.iter().enumerate() {
            for (pixel, sums) in row
                .iter_mut()
                .zip(&sums[pixel(y + nth, picture.height) - needed.start])
            {
                pixel.colour[0] += of_y * sums[0];
                pixel.colour[1] += of_cx * sums[1];
                pixel.colour[2] += one * sums[2] + other * sums[3];
                pixel.edge[0] += smooth * sums[5];
                pixel.edge[1] += edge * sums[4];
                pixel.point[0] += smooth * sums[6];
                pixel.point[1] += point * sums[4];
            }
        }
    }
    all
}

/// Difference of edges or points, whichever is larger, 0 to 1.
fn feature(a: &Filtered, b: &Filtered) -> f64 {
    let length = |[x, y]: [f64; 2]| (x * x + y * y).sqrt();
    let [edge, point] =
        [(a.edge, b.edge), (a.point, b.point)].map(|(a, b)| (length(a) - length(b)).abs());
    libm::pow(
        edge.max(point) * std::f64::consts::FRAC_1_SQRT_2,
        FEATURE_EXPONENT,
    )
}

// ---- colours ----

/// Linear RGB → XYZ relative to white (the constants of the authors' program).
fn to_xyz([r, g, b]: [f64; 3]) -> [f64; 3] {
    let rows = [
        [
            10_135_552.0 / 24_577_794.0,
            8_788_810.0 / 24_577_794.0,
            4_435_075.0 / 24_577_794.0,
        ],
        [
            2_613_072.0 / 12_288_897.0,
            8_788_810.0 / 12_288_897.0,
            887_015.0 / 12_288_897.0,
        ],
        [
            1_425_312.0 / 73_733_382.0,
            8_788_810.0 / 73_733_382.0,
            70_074_185.0 / 73_733_382.0,
        ],
    ];
    std::array::from_fn(|i| (rows[i][0] * r + rows[i][1] * g + rows[i][2] * b) / WHITE[i])
}

/// The inverse of [`to_xyz`], from Y Cx Cz on.
fn linear_of([luma, cx, cz]: [f64; 3]) -> [f64; 3] {
    let y = (luma + 16.0) / 116.0;
    let [x, y, z] = [
        (y + cx / 500.0) * WHITE[0],
        y * WHITE[1],
        (y - cz / 200.0) * WHITE[2],
    ];
    let rows = [
        [3.241_003_275, -1.537_398_934, -0.498_615_861],
        [-0.969_224_334, 1.875_930_071, 0.041_554_224],
        [0.055_639_423, -0.204_011_202, 1.057_148_933],
    ];
    rows.map(|[a, b, c]| a * x + b * y + c * z)
}

/// sRGB code values → Y Cx Cz, in which contrast is filtered: L*a*b* without its roots.
fn opponent([r, g, b, _]: [f64; 4]) -> [f64; 3] {
    let [x, y, z] = to_xyz([r, g, b].map(srgb_decode));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn lab(linear: [f64; 3]) -> [f64; 3] {
    const DELTA: f64 = 6.0 / 29.0;
    let root = |value: f64| {
        if value > DELTA * DELTA * DELTA {
            libm::cbrt(value)
        } else {
            value / (3.0 * DELTA * DELTA) + 4.0 / 29.0
        }
    };
    let [x, y, z] = to_xyz(linear).map(root);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Colours look weaker in the dark.
fn hunt([l, a, b]: [f64; 3]) -> [f64; 3] {
    [l, 0.01 * l * a, 0.01 * l * b]
}

/// Distance for large differences of colour.
fn hyab(a: [f64; 3], b: [f64; 3]) -> f64 {
    let [l, x, y] = std::array::from_fn(|i| a[i] - b[i]);
    l.abs() + (x * x + y * y).sqrt()
}

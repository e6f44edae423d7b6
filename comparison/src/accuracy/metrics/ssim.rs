//! SSIM: structural similarity in a Gaussian window, 11×11 and σ 1.5 (Wang, Bovik, Sheikh,
//! Simoncelli: *Image Quality Assessment*, IEEE TIP 2004), K₁ 0.01, K₂ 0.03, range 1, per channel
//! on the linear clamped picture.
//!
//! Borders: only windows that are entirely inside the picture count, as in the authors' own
//! program. Along a side shorter than the window every pixel counts; its window is cut at the
//! border, and the weights are scaled to sum to 1.

use std::ops::Range;

use rayon::prelude::*;

use super::clamped;
use crate::output::picture::Picture;

const RADIUS: usize = 5;
const SIGMA: f64 = 1.5;
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// Window means of a, b, a², b² and ab, for three channels.
type Moments = [[f64; 3]; 5];

/// Rows of windows that a thread processes at a time: the products of each pixel are computed once
/// for all of them.
const BAND: usize = 16;

/// Mean structural similarity over all windows and channels.
pub(super) fn ssim(a: &Picture, b: &Picture) -> f64 {
    let (columns, rows) = (SideWindows::along(a.width), SideWindows::along(a.height));
    let sums: Vec<Vec<f64>> = rows
        .places
        .par_chunks(BAND)
        .map(|band| row_sums(a, b, &columns, band))
        .collect();
    sums.as_slice().concat().iter().sum::<f64>()
        / (3 * rows.places.len() * columns.places.len()) as f64
}

/// The windows along one side of the picture.
struct SideWindows {
    places: Vec<WindowPosition>,
}

/// One window position: the pixels under it, and their weights, which sum to 1.
struct WindowPosition {
    covered: Range<usize>,
    weights: Vec<f64>,
}

impl SideWindows {
    fn along(size: usize) -> Self {
        let margin = if size > 2 * RADIUS { RADIUS } else { 0 };
        let tap = |distance: usize| {
            let distance = distance as f64 / SIGMA;
            libm::exp(-0.5 * distance * distance)
        };
        let place = |centre: usize| {
            let covered = centre.saturating_sub(RADIUS)..(centre + RADIUS + 1).min(size);
            let taps: Vec<f64> = covered.clone().map(|at| tap(at.abs_diff(centre))).collect();
            let total: f64 = taps.iter().sum();
            WindowPosition {
                covered,
                weights: taps.iter().map(|tap| tap / total).collect(),
            }
        };
        SideWindows {
            places: (margin..size - margin).map(place).collect(),
        }
    }
}

impl WindowPosition {
    fn weighted(&self) -> impl Iterator<Item = (usize, f64)> {
        self.covered.clone().zip(self.weights.iter().copied())
    }
}

/// Sums of the similarity over rows of windows. The window is separable: columns first, then along
/// the row.
fn row_sums(a: &Picture, b: &Picture, columns: &SideWindows, band: &[WindowPosition]) -> Vec<f64> {
    let (Some(first), Some(last)) = (band.first(), band.last()) else {
        return Vec::new();
    };
    let pixels = first.covered.start * a.width..last.covered.end * a.width;
    let products: Vec<Moments> = pixels
        .map(|index| products(clamped(a, index), clamped(b, index)))
        .collect();
    let row_sum = |row: &WindowPosition| {
        let mut vertical = vec![Moments::default(); a.width];
        for (y, weight) in row.weighted() {
            let products = &products[(y - first.covered.start) * a.width..][..a.width];
            vertical
                .iter_mut()
                .zip(products)
                .for_each(|(moments, products)| add(moments, products, weight));
        }
        let similarity = |column: &WindowPosition| {
            let mut moments = Moments::default();
            column
                .weighted()
                .for_each(|(x, weight)| add(&mut moments, &vertical[x], weight));
            (0..3)
                .map(|channel| of_window(moments.map(|moment| moment[channel])))
                .sum::<f64>()
        };
        columns.places.iter().map(similarity).sum()
    };
    band.iter().map(row_sum).collect()
}

fn products(a: [f64; 3], b: [f64; 3]) -> Moments {
    let times = |p: [f64; 3], q: [f64; 3]| std::array::from_fn(|channel| p[channel] * q[channel]);
    [a, b, times(a, a), times(b, b), times(a, b)]
}

fn add(sum: &mut Moments, moments: &Moments, weight: f64) {
    for (sum, moment) in sum
        .as_flattened_mut()
        .iter_mut()
        .zip(moments.as_flattened())
    {
        *sum += weight * moment;
    }
}

/// Similarity in one window of one channel.
fn of_window([mean_a, mean_b, square_a, square_b, product]: [f64; 5]) -> f64 {
    let variances = square_a - mean_a * mean_a + square_b - mean_b * mean_b;
    let covariance = product - mean_a * mean_b;
    let luminance = (2.0 * mean_a * mean_b + C1) / (mean_a * mean_a + mean_b * mean_b + C1);
    luminance * (2.0 * covariance + C2) / (variances + C2)
}

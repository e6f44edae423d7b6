//! SSIM: structural similarity in a Gaussian window, 11×11 and σ 1.5 (Wang, Bovik, Sheikh, Simoncelli: *Image Quality
//! Assessment*, IEEE TIP 2004), K₁ 0.01, K₂ 0.03, range 1, per channel on the linear clamped picture.
//!
//! Borders: only windows that lie wholly inside the picture count, as in the authors' own program. Along a side shorter than
//! the window every pixel counts, its window cut at the border and its weights made to sum to 1 again.

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

/// Mean structural similarity over all windows and channels.
pub(super) fn ssim(a: &Picture, b: &Picture) -> f64 {
    let (columns, rows) = (Window::along(a.width), Window::along(a.height));
    let sums: Vec<f64> = rows.centres.clone().into_par_iter().map(|y| row_sum(a, b, &columns, &rows, y)).collect();
    sums.iter().sum::<f64>() / (3 * rows.centres.len() * columns.centres.len()) as f64
}

/// The window along one side of the picture.
struct Window {
    size: usize,
    /// Pixels that have a window.
    centres: Range<usize>,
    taps: [f64; 2 * RADIUS + 1],
}

impl Window {
    fn along(size: usize) -> Self {
        let margin = if size > 2 * RADIUS { RADIUS } else { 0 };
        let taps = std::array::from_fn(|tap| {
            let distance = (tap as f64 - RADIUS as f64) / SIGMA;
            libm::exp(-0.5 * distance * distance)
        });
        Window { size, centres: margin..size - margin, taps }
    }

    /// Positions under the window and their weights, which sum to 1.
    fn weights(&self, centre: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let covered = centre.saturating_sub(RADIUS)..(centre + RADIUS + 1).min(self.size);
        let tap = move |at: usize| self.taps[at + RADIUS - centre];
        let total: f64 = covered.clone().map(tap).sum();
        covered.map(move |at| (at, tap(at) / total))
    }
}

/// Sum of the similarity over one row of windows: the window is separable, so columns first, then along the row.
fn row_sum(a: &Picture, b: &Picture, columns: &Window, rows: &Window, y: usize) -> f64 {
    let mut vertical = vec![Moments::default(); a.width];
    for (row, weight) in rows.weights(y) {
        for (x, moments) in vertical.iter_mut().enumerate() {
            let index = row * a.width + x;
            add(moments, &products(clamped(a, index), clamped(b, index)), weight);
        }
    }
    let similarity = |x| {
        let mut moments = Moments::default();
        columns.weights(x).for_each(|(column, weight)| add(&mut moments, &vertical[column], weight));
        (0..3).map(|channel| of_window(moments.map(|moment| moment[channel]))).sum::<f64>()
    };
    columns.centres.clone().map(similarity).sum()
}

fn products(a: [f64; 3], b: [f64; 3]) -> Moments {
    let times = |p: [f64; 3], q: [f64; 3]| std::array::from_fn(|channel| p[channel] * q[channel]);
    [a, b, times(a, a), times(b, b), times(a, b)]
}

fn add(sum: &mut Moments, moments: &Moments, weight: f64) {
    for (sum, moment) in sum.as_flattened_mut().iter_mut().zip(moments.as_flattened()) {
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

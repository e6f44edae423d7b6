//! Solve: colours whose kernels together come closest to a picture, R w = c (SS Appendix A), by
//! conjugate gradients.
//!
//! The method is implemented here in thirty lines. Crates that contain it (`faer`) are complete
//! linear-algebra libraries, which would double the build time. Smaller ones (`sprs`) only have
//! methods for asymmetric matrices.

use super::cells::Cells;
use super::gaussian::inner_of_round;
use glam::DVec3;
use rayon::prelude::*;

/// Two kernels whose inner product, over that of a kernel with itself, is less than this are
/// treated as independent.
const LEAST_PRODUCT: f64 = 1e-3;
/// Weight of the damping towards the averages, over the mean sum of a row, so that frequencies
/// beyond the kernels' resolution are not amplified. It must exceed [`LEAST_PRODUCT`], the omitted
/// share of a row, or the matrix might have eigenvalues below 0. For 10,000 points with 10×10 and
/// 25×25 checks this value gives the closest picture, or is within 0.1 dB of it. With 0.001 colours
/// exceed [0, 1] by 5.8 instead of 1.3, and the picture is up to 1.6 dB farther.
const STAY: f64 = 0.03;
/// Residual, over the right side, at which the iteration ends: a tenth of a step of 16 bits.
const GOOD: f64 = 1e-6;
/// Greatest number of steps.
const MOST_STEPS: usize = 500;
/// Greatest number of entries per row: a surface with twenty coincident layers.
const MOST_IN_ROW: usize = 2000;
/// Points whose sums are computed sequentially, so that the result does not depend on the number of
/// threads.
const CHUNK: usize = 4096;

/// Residuals of a solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// ‖c − R w‖ / ‖c‖, of the worst channel: the residual of the undamped equations.
    pub residual: f64,
    /// ‖c′ − (R + s) w‖ / ‖c′‖ of the solved system, c′ = c + s e, of the worst channel.
    pub damped_residual: f64,
    /// Steps of conjugate gradients.
    pub steps: usize,
    /// Non-zero entries of R.
    pub entries: usize,
}

type Rgb = [f64; 3];

/// R, symmetric: its rows, without the damping [`STAY`] on the diagonal.
pub(super) struct Matrix {
    rows: Vec<Box<[(u32, f32)]>>,
    sums: Vec<f64>,
    stay: f64,
}

impl Matrix {
    /// Inner products of the kernels at these positions with these radii, in units of πσ² for their
    /// root mean square radius σ. The product of kernels on opposite sides is 0.
    pub fn of(places: &[DVec3], faces: &[DVec3], radii: &[f64]) -> Result<Matrix, String> {
        let most = radii.iter().copied().fold(0.0, f64::max);
        let reach_of_radius = (2.0 * -libm::log(LEAST_PRODUCT)).sqrt();
        let cells = Cells::new(places, reach_of_radius * std::f64::consts::SQRT_2 * most);
        let unit =
            std::f64::consts::PI * radii.iter().map(|r| r * r).sum::<f64>() / radii.len() as f64;
        let row = |k: usize| {
            let mut row = Vec::new();
            cells.around(places[k], |j| {
                let (squared, sum) = (
                    places[k].distance_squared(places[j]),
                    radii[k] * radii[k] + radii[j] * radii[j],
                );
                if squared <= reach_of_radius * reach_of_radius * sum
                    && faces[k].dot(faces[j]) > 0.0
                    && row.len() <= MOST_IN_ROW
                {
                    row.push((
                        j as u32,
                        (inner_of_round(radii[k], radii[j], squared) / unit) as f32,
                    ));
                }
            });
            row.into_boxed_slice()
        };
        let rows: Vec<Box<[(u32, f32)]>> = (0..places.len()).into_par_iter().map(row).collect();
        if rows.iter().any(|row| row.len() > MOST_IN_ROW) {
            return Err(format!(
                "has so many coincident layers that a point would have more than {MOST_IN_ROW} neighbours"
            ));
        }
        let sums: Vec<f64> = rows
            .iter()
            .map(|row| row.iter().map(|&(_, value)| value as f64).sum())
            .collect();
        let stay = STAY * sums.iter().sum::<f64>() / sums.len() as f64;
        Ok(Matrix { rows, sums, stay })
    }

    /// R w.
    fn times(&self, w: &[Rgb]) -> Vec<Rgb> {
        let row = |row: &[(u32, f32)]| {
            let mut sum = [0.0; 3];
            for &(j, value) in row {
                let (value, w) = (value as f64, &w[j as usize]);
                (0..3).for_each(|c| sum[c] += value * w[c]);
            }
            sum
        };
        self.rows.par_iter().map(|entries| row(entries)).collect()
    }

    /// Right sides. For a point with an average of a picture under its kernel: that average times
    /// the sum of all weights at the point, because the renderer divides by this sum. For any other
    /// point: the value for which its own colour is the solution.
    pub fn right_sides(&self, averages: &[Rgb], is_averaged: &[bool]) -> Vec<Rgb> {
        let held = self.times(averages);
        let one = |k: usize| {
            if is_averaged[k] {
                averages[k].map(|a| a * self.sums[k])
            } else {
                held[k]
            }
        };
        (0..averages.len()).map(one).collect()
    }

    /// Solves R w = c, starting at the averages e and damped towards them: (R + s) w = c + s e.
    pub fn solve(&self, right: &[Rgb], averages: &[Rgb]) -> (Vec<Rgb>, Solution) {
        let applied = |w: &[Rgb]| {
            let mut product = self.times(w);
            product
                .par_iter_mut()
                .zip(w)
                .for_each(|(p, w)| (0..3).for_each(|c| p[c] += self.stay * w[c]));
            product
        };
        let undamped = right;
        let right: Vec<Rgb> = right
            .iter()
            .zip(averages)
            .map(|(c, e)| std::array::from_fn(|i| c[i] + self.stay * e[i]))
            .collect();
        let mut w = averages.to_vec();
        let mut residual: Vec<Rgb> = right
            .iter()
            .zip(applied(&w))
            .map(|(c, p)| std::array::from_fn(|i| c[i] - p[i]))
            .collect();
        let mut direction = residual.clone();
        let mut squares = dot(&residual, &residual);
        let over = |norm: Rgb, squares: &Rgb| {
            (0..3)
                .map(|c| {
                    if norm[c] > 0.0 {
                        (squares[c] / norm[c]).sqrt()
                    } else {
                        0.0
                    }
                })
                .fold(0.0, f64::max)
        };
        let norm = dot(&right, &right);
        let relative = |squares: &Rgb| over(norm, squares);
        let mut steps = 0;
        while steps < MOST_STEPS && relative(&squares) > GOOD {
            let product = applied(&direction);
            let curvature = dot(&direction, &product);
            let step: Rgb = std::array::from_fn(|c| {
                if curvature[c] > 0.0 {
                    squares[c] / curvature[c]
                } else {
                    0.0
                }
            });
            add(&mut w, &direction, step);
            add(&mut residual, &product, step.map(|s| -s));
            let next = dot(&residual, &residual);
            let turn: Rgb = std::array::from_fn(|c| {
                if squares[c] > 0.0 {
                    next[c] / squares[c]
                } else {
                    0.0
                }
            });
            direction
                .par_iter_mut()
                .zip(&residual)
                .for_each(|(d, r)| (0..3).for_each(|c| d[c] = r[c] + turn[c] * d[c]));
            squares = next;
            steps += 1;
        }
        let entries = self.rows.iter().map(|row| row.len()).sum();
        let left: Vec<Rgb> = undamped
            .iter()
            .zip(self.times(&w))
            .map(|(c, p)| std::array::from_fn(|i| c[i] - p[i]))
            .collect();
        let undamped_residual = over(dot(undamped, undamped), &dot(&left, &left));
        (
            w,
            Solution {
                residual: undamped_residual,
                damped_residual: relative(&squares),
                steps,
                entries,
            },
        )
    }
}

fn add(to: &mut [Rgb], what: &[Rgb], times: Rgb) {
    to.par_iter_mut()
        .zip(what)
        .for_each(|(to, what)| (0..3).for_each(|c| to[c] += times[c] * what[c]));
}

/// Scalar products of each channel, summed in an order that does not depend on threads.
fn dot(a: &[Rgb], b: &[Rgb]) -> Rgb {
    let of_chunk = |(a, b): (&[Rgb], &[Rgb])| {
        let mut sum = [0.0; 3];
        a.iter()
            .zip(b)
            .for_each(|(a, b)| (0..3).for_each(|c| sum[c] += a[c] * b[c]));
        sum
    };
    let sums: Vec<Rgb> = a
        .par_chunks(CHUNK)
        .zip(b.par_chunks(CHUNK))
        .map(of_chunk)
        .collect();
    sums.into_iter().fold([0.0; 3], |sum, part| {
        std::array::from_fn(|c| sum[c] + part[c])
    })
}

//! Neighbours: fits missing radii and normals of splats to the points around them.
//!
//! - Radius: the mean distance to the 6 nearest neighbours (EWA §6.3), at most 4 × the median of
//!   these means; otherwise one stray point of a scan could cover a fifth of the picture. Points at
//!   the same place are neighbours at distance 0; if all 6 are, the radius is the median of the
//!   nonzero ones. If there are none (a single point, for example) it is [`lone_radius`].
//! - Normal: the direction of least variance of the point and its 6 nearest neighbours at other
//!   places, oriented towards the eye. If that is ambiguous (points on a line, a single point), it
//!   is as close to the direction of the eye as possible.
//!
//! Both depend only on the points and the eye, not on the number of threads.

use super::{Splat, unit};
use glam::{DMat3, DVec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZero;

/// Neighbours for a radius and a normal.
const NEIGHBOURS: usize = 6;
/// Index that stands for no point.
pub(super) const NONE: u32 = u32::MAX;
/// Most of a fitted radius, as a multiple of the median.
const LARGEST_OF_MEDIAN: f64 = 4.0;
/// Variances with a greater ratio than this count as 0 relative to the larger one: squared f64
/// rounding with a margin.
const NO_VARIANCE: f64 = 1e-12;

/// Radius of a point without neighbours: 1, or a millionth of its distance from the origin if that
/// is more, so that the radius is not lost in the rounding of the coordinates.
pub(super) fn lone_radius(position: DVec3) -> f64 {
    (position.length() * 1e-6).max(1.0)
}

/// Fits radii and normals that are zero.
pub(super) fn fit(splats: &mut [Splat], eye: DVec3) {
    if splats
        .iter()
        .all(|s| s.radius > 0.0 && s.normal != DVec3::ZERO)
    {
        return;
    }
    let places = DistinctPlaces::of(splats.len(), |i| splats[i].position);
    let fits = places.fit();
    let radius = Spacings::of(&places, &fits, |fit| fit.spacing);
    splats
        .par_iter_mut()
        .zip(&places.place_of_splat)
        .for_each(|(splat, &place)| {
            let fit = &fits[place as usize];
            if splat.radius == 0.0 {
                splat.radius = radius.at(fit.spacing, splat.position);
            }
            if splat.normal == DVec3::ZERO {
                splat.normal =
                    least_variance(&places.variance(place as usize, fit), eye - splat.position);
            }
        });
}

/// Neighbourhood of a point.
#[derive(Clone, Debug)]
pub(super) struct PointSurroundings {
    /// Mean distance to [`PointSurroundings::nearest`], within the bounds of a fitted radius; above
    /// 0. Copies of the point are not counted: samples at one place would have almost no volume.
    pub spacing: f64,
    /// Indices of the nearest points at other places: one per place, and [`NONE`] if there are
    /// fewer.
    pub nearest: [u32; NEIGHBOURS],
}

/// Neighbourhood of each of the points, which must be finite.
pub(super) fn surroundings(points: &[DVec3]) -> Vec<PointSurroundings> {
    let places = DistinctPlaces::of(points.len(), |i| points[i]);
    let fits = places.fit();
    let radius = Spacings::of(&places, &fits, |fit| fit.apart);
    let mut first = vec![NONE; places.points.len()];
    places
        .place_of_splat
        .iter()
        .zip(0..)
        .for_each(|(&place, i)| first[place as usize] = first[place as usize].min(i));
    let of_point = |(point, &place): (&DVec3, &u32)| {
        let fit = &fits[place as usize];
        PointSurroundings {
            spacing: radius.at(fit.apart, *point),
            nearest: fit
                .nearest
                .map(|other| first.get(other as usize).copied().unwrap_or(NONE)),
        }
    };
    points
        .par_iter()
        .zip(&places.place_of_splat)
        .map(of_point)
        .collect()
}

/// Bounds on the radii of a cloud.
struct Spacings {
    typical: f64,
    largest: f64,
}

impl Spacings {
    fn of(
        places: &DistinctPlaces,
        fits: &[NeighbourFit],
        spacing: impl Fn(&NeighbourFit) -> f64 + Sync,
    ) -> Spacings {
        let spacings = places
            .place_of_splat
            .par_iter()
            .map(|&place| spacing(&fits[place as usize]));
        match median(spacings.filter(|&spacing| spacing > 0.0).collect()) {
            Some(median) => Spacings {
                typical: median,
                largest: median * LARGEST_OF_MEDIAN,
            },
            None => Spacings {
                typical: 0.0,
                largest: f64::INFINITY,
            },
        }
    }

    fn at(&self, spacing: f64, position: DVec3) -> f64 {
        let radius = if spacing > 0.0 {
            spacing.min(self.largest)
        } else {
            self.typical
        };
        if radius > 0.0 {
            radius
        } else {
            lone_radius(position)
        }
    }
}

/// The median, or the mean of the two middle values; None if there are no values.
pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let half = values.len() / 2;
    let even = values.len().is_multiple_of(2);
    let (below, &mut upper, _) = values.select_nth_unstable_by(half, f64::total_cmp);
    let lower = if even {
        below.iter().copied().fold(f64::MIN, f64::max)
    } else {
        upper
    };
    Some((lower + upper) / 2.0)
}

/// A curve through a cube that keeps near points close together (Morton's Z): queries in its order
/// hit the host's cache.
struct Curve {
    least: DVec3,
    /// Steps of the curve per unit of length; there are 2^21 along each axis.
    steps: f64,
}

impl Curve {
    fn new(least: DVec3, most: DVec3) -> Curve {
        // The cloud may be a single point, or larger than the range of a number.
        let steps = ((1 << 21) - 1) as f64 / (most - least).max_element();
        Curve {
            least,
            steps: if steps.is_finite() { steps } else { 0.0 },
        }
    }

    /// Position of a point on the curve: the interleaved bits of its three coordinates.
    fn place(&self, point: DVec3) -> u64 {
        let spread = |step: f64| {
            let mut bits = step as u64;
            for (by, kept) in [
                (32, 0x001f_0000_0000_ffff),
                (16, 0x001f_0000_ff00_00ff),
                (8, 0x100f_00f0_0f00_f00f),
                (4, 0x10c3_0c30_c30c_30c3),
                (2, 0x1249_2492_4924_9249),
            ] {
                bits = (bits | bits << by) & kept;
            }
            bits
        };
        let [x, y, z] = ((point - self.least) * self.steps).to_array().map(spread);
        x | y << 1 | z << 2
    }
}

/// The distinct positions of a cloud. A k-d tree cannot split equal positions, and would search all
/// of them for each query.
struct DistinctPlaces {
    /// Each position once, in the order of a [`Curve`].
    points: Vec<[f64; 3]>,
    /// Number of splats at each.
    copies: Vec<u32>,
    place_of_splat: Vec<u32>,
}

/// Neighbourhood of a place.
struct NeighbourFit {
    /// Mean distance to the nearest splats; 0 if all of them are at this place.
    spacing: f64,
    /// Mean distance to the nearest other places, each counted once; 0 if there are none.
    apart: f64,
    /// Distance to the last of these.
    reach: f64,
    /// Indices of these places; [`NONE`] if there are fewer.
    nearest: [u32; NEIGHBOURS],
}

impl DistinctPlaces {
    fn of(count: usize, position: impl Fn(usize) -> DVec3 + Sync) -> DistinctPlaces {
        // −0 is the same place as 0.
        let position = |i: u32| position(i as usize) + DVec3::ZERO;
        let numbers = || (0..count as u32).into_par_iter();
        let least = numbers()
            .map(position)
            .reduce(|| DVec3::INFINITY, DVec3::min);
        let most = numbers()
            .map(position)
            .reduce(|| DVec3::NEG_INFINITY, DVec3::max);
        let curve = Curve::new(least, most);
        let mut sorted: Vec<(u64, u32)> =
            numbers().map(|i| (curve.place(position(i)), i)).collect();
        let order = |a: [f64; 3], b: [f64; 3]| {
            a.into_iter()
                .zip(b)
                .map(|(a, b)| a.total_cmp(&b))
                .find(|order| order.is_ne())
        };
        sorted.par_sort_unstable_by(|(a, i), (b, j)| {
            a.cmp(b).then_with(|| {
                order(position(*i).to_array(), position(*j).to_array()).unwrap_or(i.cmp(j))
            })
        });
        let mut points: Vec<[f64; 3]> = sorted
            .par_iter()
            .map(|(_, i)| position(*i).to_array())
            .collect();
        let (mut copies, mut place_of_splat): (Vec<u32>, _) =
            (Vec::with_capacity(count), vec![0; count]);
        for (at, (_, i)) in sorted.into_iter().enumerate() {
            let places = copies.len();
            match copies.last_mut() {
                Some(here) if points[places - 1] == points[at] => *here += 1,
                _ => {
                    points[places] = points[at];
                    copies.push(1);
                }
            }
            place_of_splat[i as usize] = copies.len() as u32 - 1;
        }
        points.truncate(copies.len());
        DistinctPlaces {
            points,
            copies,
            place_of_splat,
        }
    }

    fn fit(&self) -> Vec<NeighbourFit> {
        let tree = ImmutableKdTree::<f64, 3>::new_from_slice(&self.points)
            .expect("the points are finite and fewer than 2^32");
        let found = NonZero::new(NEIGHBOURS + 1).expect("more than 0");
        let fit_at = |place: usize| {
            let near = tree
                .query(&self.points[place])
                .nearest_n::<SquaredEuclidean<f64>>(found)
                .execute();
            let (mut nearest, mut distances, mut count) =
                ([NONE; NEIGHBOURS], [0.0; NEIGHBOURS], 0);
            for other in near
                .iter()
                .filter(|other| other.item as usize != place)
                .take(NEIGHBOURS)
            {
                (nearest[count], distances[count]) = (other.item, other.distance.sqrt());
                count += 1;
            }
            let (nearest_ones, distances) = (&nearest[..count], &distances[..count]);
            let apart = distances.iter().sum::<f64>() / count.max(1) as f64;
            let reach = distances.last().copied().unwrap_or(0.0);
            NeighbourFit {
                spacing: self.spacing(place, nearest_ones, distances),
                apart,
                reach,
                nearest,
            }
        };
        (0..self.points.len()).into_par_iter().map(fit_at).collect()
    }

    /// Mean distance to the nearest [`NEIGHBOURS`] splats, or to all others if there are fewer.
    fn spacing(&self, place: usize, others: &[u32], distances: &[f64]) -> f64 {
        let here = (self.copies[place] as usize - 1).min(NEIGHBOURS);
        let (mut count, mut sum) = (here, 0.0);
        for (other, distance) in others.iter().zip(distances) {
            let copies = (self.copies[*other as usize] as usize).min(NEIGHBOURS - count);
            count += copies;
            sum += copies as f64 * distance;
        }
        if count == 0 { 0.0 } else { sum / count as f64 }
    }

    /// Covariance of a place and the nearest others, up to a factor.
    fn variance(&self, place: usize, fit: &NeighbourFit) -> DMat3 {
        let others = fit.nearest.iter().filter(|other| **other != NONE);
        let here = DVec3::from_array(self.points[place]);
        // Offsets from the place itself, scaled to about 1: squares neither overflow nor underflow.
        let offsets = || {
            others
                .clone()
                .map(|other| (DVec3::from_array(self.points[*other as usize]) - here) / fit.reach)
        };
        let mean = offsets().sum::<DVec3>() / (others.clone().count() + 1) as f64;
        let outer = |d: DVec3| DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        let sum = offsets()
            .map(|d| outer(d - mean))
            .fold(outer(-mean), |sum, square| sum + square);
        if sum.is_finite() { sum } else { DMat3::ZERO }
    }
}

/// The unit vector of least variance, on the side of `towards`; if several are equal, the nearest
/// to `towards`.
fn least_variance(variance: &DMat3, towards: DVec3) -> DVec3 {
    let towards = unit(towards).unwrap_or(DVec3::Z);
    let [least, middle, most] = eigen(variance);
    let normal = if most.0 <= 0.0 {
        Some(towards)
    } else if middle.0 <= NO_VARIANCE * most.0 {
        unit(towards - most.1 * towards.dot(most.1))
    } else {
        Some(least.1)
    };
    let normal = normal.unwrap_or_else(|| most.1.any_orthonormal_vector());
    if normal.dot(towards) < 0.0 {
        -normal
    } else {
        normal
    }
}

/// Eigenvalues and unit eigenvectors of a symmetric matrix, ascending, by Jacobi rotations.
fn eigen(matrix: &DMat3) -> [(f64, DVec3); 3] {
    let mut m = matrix.to_cols_array_2d();
    let mut vectors = [DVec3::X, DVec3::Y, DVec3::Z];
    // Convergence is quadratic: five sweeps reach the rounding from any matrix.
    for _ in 0..6 {
        let most = (0..3).map(|i| m[i][i].abs()).fold(0.0, f64::max);
        if [m[0][1], m[0][2], m[1][2]]
            .iter()
            .all(|off| off.abs() <= f64::EPSILON * f64::EPSILON * most)
        {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            rotate(&mut m, &mut vectors, p, q);
        }
    }
    let mut pairs = [0, 1, 2].map(|i| (m[i][i], vectors[i].normalize()));
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    pairs
}

/// Rotates in the plane of axes p and q so that m[p][q] is zero.
fn rotate(m: &mut [[f64; 3]; 3], vectors: &mut [DVec3; 3], p: usize, q: usize) {
    let off = m[p][q];
    if off == 0.0 {
        return;
    }
    let theta = (m[q][q] - m[p][p]) / (2.0 * off);
    let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
    let c = 1.0 / (t * t + 1.0).sqrt();
    let s = t * c;
    let other = 3 - p - q;
    let [to_p, to_q] = [m[other][p], m[other][q]];
    (m[p][p], m[q][q]) = (m[p][p] - t * off, m[q][q] + t * off);
    for (axis, value) in [(p, c * to_p - s * to_q), (q, s * to_p + c * to_q)] {
        (m[other][axis], m[axis][other]) = (value, value);
    }
    (m[p][q], m[q][p]) = (0.0, 0.0);
    (vectors[p], vectors[q]) = (
        vectors[p] * c - vectors[q] * s,
        vectors[p] * s + vectors[q] * c,
    );
}

#[cfg(test)]
mod tests;

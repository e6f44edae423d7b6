//! Neighbours: gives a splat the radius and the normal that its file does not have, from the points around it.
//!
//! - Radius: the mean distance to the 6 nearest neighbours (EWA §6.3), at most 4 × the median of these means, or one
//!   stray point of a scan would cover a fifth of the picture. Points at one and the same place are each other's
//!   neighbours at distance 0; where all 6 are, the radius is the median of those that have one. Where no point has
//!   one (a single point, say) it is [`lone_radius`].
//! - Normal: the direction of least variance of the point and its 6 nearest neighbours at other places, turned towards
//!   the eye. Where that leaves a choice (points on a line, a lone point), it faces the eye as much as it can.
//!
//! Both depend on nothing but the points and the eye: the number of threads cannot show.

use super::{Splat, unit};
use glam::{DMat3, DVec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZero;

/// How many neighbours make a radius and a normal.
const NEIGHBOURS: usize = 6;
/// The number of no point.
pub(super) const NONE: u32 = u32::MAX;
/// A fitted radius is at most this many times the median one.
const LARGEST_OF_MEDIAN: f64 = 4.0;
/// Variances further apart than this (as a ratio) count as "none" beside the larger: rounding of f64, squared, with room.
const NO_VARIANCE: f64 = 1e-12;

/// Radius of a point that has nothing around it: 1, or a millionth of its distance from the origin if that is more, so
/// that the point's own coordinates can still tell its two sides apart.
pub(super) fn lone_radius(position: DVec3) -> f64 {
    (position.length() * 1e-6).max(1.0)
}

/// Fills in radii and normals that are zero.
pub(super) fn fit(splats: &mut [Splat], eye: DVec3) {
    if splats.iter().all(|s| s.radius > 0.0 && s.normal != DVec3::ZERO) {
        return;
    }
    let places = Places::of(splats.len(), |i| splats[i].position);
    let fits = places.fit();
    let radius = Spacings::of(&places, &fits, |fit| fit.spacing);
    splats.par_iter_mut().zip(&places.place_of_splat).for_each(|(splat, &place)| {
        let fit = &fits[place as usize];
        if splat.radius == 0.0 {
            splat.radius = radius.at(fit.spacing, splat.position);
        }
        if splat.normal == DVec3::ZERO {
            splat.normal = least_variance(&fit.variance, eye - splat.position);
        }
    });
}

/// What lies around a point.
#[derive(Clone, Debug)]
pub(super) struct Surroundings {
    /// Mean distance to [`Surroundings::nearest`], within the bounds of a fitted radius; above 0. Copies of a point are none of its
    /// neighbours here: samples at one place would have next to no volume.
    pub spacing: f64,
    /// The nearest points at other places, by number: one of each place, and [`NONE`] where there are fewer.
    pub nearest: [u32; NEIGHBOURS],
}

/// What lies around each of the points, which are finite.
pub(super) fn surroundings(points: &[DVec3]) -> Vec<Surroundings> {
    let places = Places::of(points.len(), |i| points[i]);
    let fits = places.fit();
    let radius = Spacings::of(&places, &fits, |fit| fit.apart);
    let mut first = vec![NONE; places.points.len()];
    places.place_of_splat.iter().zip(0..).for_each(|(&place, i)| first[place as usize] = first[place as usize].min(i));
    let of_point = |(point, &place): (&DVec3, &u32)| {
        let fit = &fits[place as usize];
        Surroundings {
            spacing: radius.at(fit.apart, *point),
            nearest: fit.nearest.map(|other| first.get(other as usize).copied().unwrap_or(NONE)),
        }
    };
    points.par_iter().zip(&places.place_of_splat).map(of_point).collect()
}

/// Bounds on the radii of a cloud.
struct Spacings {
    typical: f64,
    largest: f64,
}

impl Spacings {
    fn of(places: &Places, fits: &[Fit], spacing: impl Fn(&Fit) -> f64) -> Spacings {
        let spacings = places.place_of_splat.iter().map(|&place| spacing(&fits[place as usize]));
        match median(spacings.filter(|&spacing| spacing > 0.0).collect()) {
            Some(median) => Spacings { typical: median, largest: median * LARGEST_OF_MEDIAN },
            None => Spacings { typical: 0.0, largest: f64::INFINITY },
        }
    }

    fn at(&self, spacing: f64, position: DVec3) -> f64 {
        let radius = if spacing > 0.0 { spacing.min(self.largest) } else { self.typical };
        if radius > 0.0 { radius } else { lone_radius(position) }
    }
}

/// The middle of the values, or the mean of the two middle ones; none of none.
pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let half = values.len() / 2;
    let even = values.len().is_multiple_of(2);
    let (below, &mut upper, _) = values.select_nth_unstable_by(half, f64::total_cmp);
    let lower = if even { below.iter().copied().fold(f64::MIN, f64::max) } else { upper };
    Some((lower + upper) / 2.0)
}

/// The cloud with equal positions made one: a k-d tree cannot split a pile of points, and would search all of it for each.
struct Places {
    /// Each position once, in ascending order.
    points: Vec<[f64; 3]>,
    /// How many splats are there.
    copies: Vec<u32>,
    place_of_splat: Vec<u32>,
}

/// What the points around a place say about it.
struct Fit {
    /// Mean distance to the nearest splats, 0 if all of them are at this place.
    spacing: f64,
    /// Mean distance to the nearest other places, each counted once; 0 if there are none.
    apart: f64,
    /// Covariance of the place and its neighbours, up to a factor.
    variance: DMat3,
    /// Places of those, and [`NONE`] where there are fewer.
    nearest: [u32; NEIGHBOURS],
}

impl Places {
    fn of(count: usize, position: impl Fn(usize) -> DVec3 + Sync) -> Places {
        let at = |i: u32| position(i as usize).to_array();
        let order = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| a.total_cmp(b)).find(|o| o.is_ne());
        let mut sorted: Vec<u32> = (0..count as u32).collect();
        sorted.par_sort_unstable_by(|&i, &j| order(&at(i), &at(j)).unwrap_or(i.cmp(&j)));
        let mut places = Places { points: Vec::new(), copies: Vec::new(), place_of_splat: vec![0; count] };
        for i in sorted {
            if places.points.last() != Some(&at(i)) {
                places.points.push(at(i));
                places.copies.push(0);
            }
            places.place_of_splat[i as usize] = places.points.len() as u32 - 1;
            *places.copies.last_mut().expect("a place was just pushed") += 1;
        }
        places
    }

    fn fit(&self) -> Vec<Fit> {
        let tree = ImmutableKdTree::<f64, 3>::new_from_slice(&self.points).expect("the points are finite and fewer than 2^32");
        let found = NonZero::new(NEIGHBOURS + 1).expect("more than 0");
        let fit_at = |place: usize| {
            let near = tree.query(&self.points[place]).nearest_n::<SquaredEuclidean<f64>>(found).execute();
            let others: Vec<(usize, f64)> =
                near.iter().map(|n| (n.item as usize, n.distance)).filter(|n| n.0 != place).take(NEIGHBOURS).collect();
            let nearest = std::array::from_fn(|i| others.get(i).map_or(NONE, |(other, _)| *other as u32));
            let apart = others.iter().map(|(_, squared)| squared.sqrt()).sum::<f64>() / others.len().max(1) as f64;
            Fit { spacing: self.spacing(place, &others), apart, variance: self.variance(place, &others), nearest }
        };
        (0..self.points.len()).into_par_iter().map(fit_at).collect()
    }

    /// Mean distance to the nearest [`NEIGHBOURS`] splats, or to all others if there are fewer.
    fn spacing(&self, place: usize, others: &[(usize, f64)]) -> f64 {
        let here = (self.copies[place] as usize - 1).min(NEIGHBOURS);
        let (mut count, mut sum) = (here, 0.0);
        for &(other, squared) in others {
            let copies = (self.copies[other] as usize).min(NEIGHBOURS - count);
            count += copies;
            sum += copies as f64 * squared.sqrt();
        }
        if count == 0 { 0.0 } else { sum / count as f64 }
    }

    fn variance(&self, place: usize, others: &[(usize, f64)]) -> DMat3 {
        // Offsets from the place itself, scaled to about 1: squares can neither overflow nor vanish.
        let scale = others.last().map_or(1.0, |(_, squared)| squared.sqrt());
        let here = DVec3::from_array(self.points[place]);
        let offsets = || others.iter().map(|&(other, _)| (DVec3::from_array(self.points[other]) - here) / scale);
        let mean = offsets().sum::<DVec3>() / (others.len() + 1) as f64;
        let outer = |d: DVec3| DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        let sum = offsets().map(|d| outer(d - mean)).fold(outer(-mean), |sum, square| sum + square);
        if sum.is_finite() { sum } else { DMat3::ZERO }
    }
}

/// The unit vector along which a symmetric matrix is least, on the side of `towards`; where several are equally good,
/// the one nearest to it.
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
    if normal.dot(towards) < 0.0 { -normal } else { normal }
}

/// Eigenvalues and unit eigenvectors of a symmetric matrix, ascending, by Jacobi rotations.
fn eigen(matrix: &DMat3) -> [(f64, DVec3); 3] {
    let (mut m, mut vectors) = (*matrix, DMat3::IDENTITY);
    // Convergence is quadratic: five sweeps reach rounding from anywhere.
    for _ in 0..6 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let rotation = jacobi(&m, p, q);
            m = rotation.transpose() * m * rotation;
            vectors *= rotation;
        }
    }
    let mut pairs = [0, 1, 2].map(|i| (m.col(i)[i], vectors.col(i).normalize()));
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    pairs
}

/// The rotation in the plane of axes p and q that makes m[p][q] zero.
fn jacobi(m: &DMat3, p: usize, q: usize) -> DMat3 {
    let mut rotation = DMat3::IDENTITY;
    let off = m.col(q)[p];
    if off != 0.0 {
        let theta = (m.col(q)[q] - m.col(p)[p]) / (2.0 * off);
        let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
        let c = 1.0 / (t * t + 1.0).sqrt();
        let s = t * c;
        (rotation.col_mut(p)[p], rotation.col_mut(q)[q]) = (c, c);
        (rotation.col_mut(q)[p], rotation.col_mut(p)[q]) = (s, -s);
    }
    rotation
}

#[cfg(test)]
mod tests;

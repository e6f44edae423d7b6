//! Radii: computes the radius of each point from its neighbours.

use crate::scene::Splat;
use glam::DVec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZero;

/// Neighbours that define a radius (EWA §6.3).
const NEIGHBOURS: usize = 6;
/// Neighbours searched to find those: of two sides close together, half are on the wrong one.
const LOOKED_AT: usize = 16;
/// Least and largest mean distance, in roots of a point's area. Points at a border, and on parts
/// smaller than that area, have distant neighbours or none.
const LEAST: f64 = 0.75;
const MOST: f64 = 2.0;

/// The mean distance to the nearest neighbours on faces with the same orientation, between bounds,
/// times a factor.
pub(super) fn from_neighbours(splats: &mut [Splat], faces: &[DVec3], typical: f64, factor: f64) {
    let points: Vec<[f64; 3]> = splats
        .iter()
        .map(|splat| splat.position.to_array())
        .collect();
    let tree = ImmutableKdTree::<f64, 3>::new_from_slice(&points)
        .expect("the points are finite and fewer than 2^32");
    let found = NonZero::new(LOOKED_AT + 1).expect("more than 0");
    splats.par_iter_mut().enumerate().for_each(|(i, splat)| {
        let near = tree
            .query(&points[i])
            .nearest_n::<SquaredEuclidean<f64>>(found)
            .execute();
        let same_side = near
            .iter()
            .filter(|n| n.item as usize != i && faces[n.item as usize].dot(faces[i]) > 0.0)
            .take(NEIGHBOURS);
        let (count, sum) = same_side.fold((0, 0.0), |(count, sum), n| {
            (count + 1, sum + n.distance.sqrt())
        });
        let mean = if count == 0 {
            typical
        } else {
            sum / count as f64
        };
        splat.radius = factor * mean.clamp(LEAST * typical, MOST * typical);
    });
}

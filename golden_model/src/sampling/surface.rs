//! Surface: maps a number to a position on a mesh, so that equal intervals are equal areas.

use crate::scene::Splat;
use crate::scene::mesh::{Mesh, Triangle};
use glam::DVec3;

/// Base-4 digits of a position in a triangle: two bits each, as many as f64 has.
const DIGITS: usize = 26;

/// A mesh with its triangles laid end to end by area.
pub(super) struct Surface<'a> {
    mesh: &'a Mesh,
    /// Area up to and including each triangle.
    upto: Vec<f64>,
}

/// A position on a mesh.
#[derive(Clone, Copy, Debug)]
pub(super) struct Site {
    pub triangle: u32,
    /// Barycentric, ≥ 0, of sum 1.
    pub weights: [f64; 3],
}

impl<'a> Surface<'a> {
    pub fn of(mesh: &'a Mesh) -> Self {
        let mut sum = 0.0;
        let upto = mesh.triangles.iter().map(|triangle| {
            sum += triangle.twice_area().length() / 2.0;
            sum
        });
        Surface {
            mesh,
            upto: upto.collect(),
        }
    }

    pub fn area(&self) -> f64 {
        *self.upto.last().expect("a mesh has a triangle")
    }

    /// The largest coordinate of a corner.
    pub fn farthest(&self) -> f64 {
        self.mesh
            .triangles
            .iter()
            .flat_map(|t| t.corners)
            .map(|corner| corner.abs().max_element())
            .fold(0.0, f64::max)
    }

    /// The position at a share of the area, in [0, 1).
    pub fn at(&self, share: f64) -> Site {
        let area = share * self.area();
        let triangle = self
            .upto
            .partition_point(|&upto| upto <= area)
            .min(self.upto.len() - 1);
        let before = if triangle == 0 {
            0.0
        } else {
            self.upto[triangle - 1]
        };
        let within = (area - before) / (self.upto[triangle] - before);
        Site {
            triangle: triangle as u32,
            weights: in_triangle(within.clamp(0.0, 1.0 - f64::EPSILON)),
        }
    }

    pub fn position(&self, site: &Site) -> DVec3 {
        let [a, b, c] = self.mesh.triangles[site.triangle as usize].corners;
        let [_, v, w] = site.weights;
        a + (b - a) * v + (c - a) * w
    }

    /// The unit normal of the triangle.
    pub fn face(&self, site: &Site) -> DVec3 {
        self.mesh.triangles[site.triangle as usize].face()
    }

    /// A splat with position and normal, but without radius and colour.
    pub fn splat(&self, site: &Site) -> Splat {
        let triangle = &self.mesh.triangles[site.triangle as usize];
        Splat {
            position: self.position(site),
            normal: normal(triangle, site),
            radius: 0.0,
            rgb: [0.0; 3],
            opacity: 1.0,
            material: 0,
        }
    }
}

fn normal(triangle: &Triangle, site: &Site) -> DVec3 {
    let [a, b, c] = triangle
        .normals
        .map(|normal| DVec3::from_array(normal.map(f64::from)));
    let [_, v, w] = site.weights;
    (a + (b - a) * v + (c - a) * w)
        .try_normalize()
        .unwrap_or_else(|| triangle.face())
}

/// The position of a number in [0, 1): its base-4 digits select one of the four similar parts of a
/// triangle, recursively. Therefore an interval is a connected part of the triangle (Basu and Owen
/// 2015, *Low discrepancy constructions in the triangle*).
fn in_triangle(share: f64) -> [f64; 3] {
    let mut corners = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let middle =
        |a: [f64; 3], b: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| (a[i] + b[i]) / 2.0) };
    let mut rest = share;
    for _ in 0..DIGITS {
        let [a, b, c] = corners;
        let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
        let digit = (rest * 4.0).floor();
        rest = rest * 4.0 - digit;
        corners = match digit as u8 {
            0 => [bc, ca, ab],
            1 => [a, ab, ca],
            2 => [ab, b, bc],
            _ => [ca, bc, c],
        };
    }
    let [_, v, w]: [f64; 3] =
        std::array::from_fn(|i| (corners[0][i] + corners[1][i] + corners[2][i]) / 3.0);
    [1.0 - v - w, v, w]
}

//! Reflection: the light that a mirror reflects from the surroundings (Surface Splatting §4,
//! docs/book/reflection.md): looked up exactly, or in the octahedral map of a machine.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::scene::{Environment, Mirror, Scene};
use std::sync::Arc;

/// How a machine mirrors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reflection {
    /// The map has 2^this texels per side.
    pub index_bits: u32,
    /// Each pixel's own ray is mirrored; otherwise the viewing axis for all.
    pub by_ray: bool,
}

/// The octahedral map of surroundings in the camera space that `rotation` leads to: 2^`index_bits`
/// texels per side, row by row. Its middle faces the viewer (−z), its corners face away. A texel is
/// the mean over its part of the map.
pub fn octahedral(environment: &Environment, rotation: DMat3, index_bits: u32) -> Vec<[f64; 3]> {
    let side = 1usize << index_bits;
    let steps = (side - 1) as f64;
    // A quarter of the map's side is 90 degrees, as is half of the picture's height.
    let samples = (environment.height() / side).max(1);
    let texel = |column: usize, row: usize| {
        let mut sum = [0.0; 3];
        for nth in 0..samples * samples {
            let within = |nth: usize| (nth as f64 + 0.5) / samples as f64 - 0.5;
            let at = [
                (column as f64 + within(nth % samples)) / steps,
                (row as f64 + within(nth / samples)) / steps,
            ];
            let light = environment.light(rotation.transpose() * of_place(at));
            (0..3).for_each(|i| sum[i] += light[i]);
        }
        sum.map(|sum| sum / (samples * samples) as f64)
    };
    (0..side * side)
        .into_par_iter()
        .map(|at| texel(at % side, at / side))
        .collect()
}

/// The direction at a position of the map, which is mirrored beyond its sides.
fn of_place([u, v]: [f64; 2]) -> DVec3 {
    let (mut x, mut y) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    if x.abs() > 1.0 {
        (x, y) = (x.signum() * 2.0 - x, -y);
    }
    if y.abs() > 1.0 {
        (x, y) = (-x, y.signum() * 2.0 - y);
    }
    let z = x.abs() + y.abs() - 1.0;
    if z > 0.0 {
        (x, y) = ((1.0 - y.abs()) * x.signum(), (1.0 - x.abs()) * y.signum());
    }
    DVec3::new(x, y, z)
}

/// Position of a direction in the map, 0 to 1.
fn place(direction: DVec3) -> [f64; 2] {
    let flat = direction / (direction.x.abs() + direction.y.abs() + direction.z.abs());
    let (mut x, mut y) = (flat.x, flat.y);
    if flat.z > 0.0 {
        (x, y) = (
            (1.0 - flat.y.abs()) * flat.x.signum(),
            (1.0 - flat.x.abs()) * flat.y.signum(),
        );
    }
    [(x + 1.0) / 2.0, (y + 1.0) / 2.0]
}

/// The mirror image of the ray (a, b, 1) at a unit normal, of the same length.
fn reflected(ray: DVec3, normal: DVec3) -> DVec3 {
    ray - 2.0 * ray.dot(normal) * normal
}

/// Surroundings as they appear in a camera's mirrors.
pub(crate) struct Surroundings {
    environment: Arc<Environment>,
    /// World → camera.
    rotation: DMat3,
    focal_px: [f64; 2],
    /// The principal point relative to the picture's middle, pixels.
    centre_px: [f64; 2],
    /// A machine's map.
    map: Option<(Reflection, Vec<[f64; 3]>)>,
}

impl Surroundings {
    /// Surroundings of a scene, and how a machine mirrors them; none if nothing is mirrored.
    pub fn new(scene: &Scene, way: Option<Reflection>) -> Option<Self> {
        let environment = scene.environment.clone()?;
        let view = scene.view();
        let map = way.map(|way| (way, octahedral(&environment, view.rotation, way.index_bits)));
        Some(Surroundings {
            environment,
            rotation: view.rotation,
            focal_px: view.focal_px,
            centre_px: view.off_middle_px(),
            map,
        })
    }

    /// The reflected colour of a material with this colour and this unit normal in camera space;
    /// `at` is the pixel's centre relative to the middle of the picture.
    pub fn mirrored(&self, material: u32, at: [f64; 2], normal: DVec3, colour: DVec3) -> DVec3 {
        let Mirror { reflect, tint } = self.environment.mirrors[material as usize];
        if reflect == 0.0 {
            return colour;
        }
        let light = DVec3::from_array(self.light(at, normal));
        (colour * (1.0 - reflect) + light * DVec3::from_array(tint) * reflect).min(DVec3::ONE)
    }

    fn light(&self, at: [f64; 2], normal: DVec3) -> [f64; 3] {
        let (_, direction) = self.direction(at, normal);
        match &self.map {
            None => self
                .environment
                .light(self.rotation.transpose() * direction),
            Some((way, texels)) => between(texels, 1 << way.index_bits, place(direction)),
        }
    }

    /// The ray that is mirrored, and its mirror image.
    fn direction(&self, at: [f64; 2], normal: DVec3) -> (DVec3, DVec3) {
        let along_axis = self.map.as_ref().is_some_and(|(way, _)| !way.by_ray);
        let slope = |axis: usize| (at[axis] - self.centre_px[axis]) / self.focal_px[axis];
        let ray = if along_axis {
            DVec3::Z
        } else {
            DVec3::new(slope(0), slope(1), 1.0)
        };
        (ray, reflected(ray, normal))
    }

    /// The light in a mirror of a material; none if it mirrors nothing.
    pub fn seen(&self, material: u32, at: [f64; 2], normal: DVec3) -> Option<Reflected> {
        let Mirror { reflect, tint } = self.environment.mirrors[material as usize];
        let (ray, direction) = self.direction(at, normal);
        let side = self.map.as_ref().map_or(2, |(way, _)| 1 << way.index_bits);
        (reflect != 0.0).then(|| Reflected {
            slopes: [ray.x, ray.y],
            direction: direction.to_array(),
            texel: texel(side, place(direction)),
            light: self.light(at, normal),
            share: tint.map(|tint| reflect * tint),
        })
    }
}

/// Light that a mirror reflects at a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflected {
    /// a and b of the ray (a, b, 1) that is mirrored.
    pub slopes: [f64; 2],
    /// Its mirror image, of the same length.
    pub direction: [f64; 3],
    /// Column and row of the first of the map's four texels.
    pub texel: [usize; 2],
    /// Light interpolated between them.
    pub light: [f64; 3],
    /// Share of this light in the reflected colour: reflect times tint.
    pub share: [f64; 3],
}

/// The first of four texels around a position.
fn texel(side: usize, at: [f64; 2]) -> [usize; 2] {
    at.map(|at| ((at * (side - 1) as f64).floor() as usize).min(side - 2))
}

/// Light interpolated between four texels.
fn between(texels: &[[f64; 3]], side: usize, at: [f64; 2]) -> [f64; 3] {
    let [x, y] = at.map(|at| at * (side - 1) as f64);
    let [left, above] = texel(side, at);
    let parts = [
        [1.0 - (x - left as f64), x - left as f64],
        [1.0 - (y - above as f64), y - above as f64],
    ];
    let mut light = [0.0; 3];
    for (down, part) in parts[1].into_iter().enumerate() {
        for (right, share) in parts[0].into_iter().enumerate() {
            let texel = texels[(above + down) * side + left + right];
            (0..3).for_each(|i| light[i] += texel[i] * share * part);
        }
    }
    light
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector() -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-1.0..1.0)
            .prop_map(DVec3::from_array)
            .prop_filter("has a direction", |v| v.length() > 0.1)
    }

    proptest! {
        /// Length and angle are preserved, and the result is in the plane of ray and normal: the
        /// law of reflection by its definition.
        #[test]
        fn a_reflected_ray_keeps_length_and_angle(ray in vector(), normal in vector()) {
            let normal = normal.normalize();
            let mirrored = reflected(ray, normal);
            prop_assert!((mirrored.length() - ray.length()).abs() < 1e-12);
            prop_assert!((mirrored.dot(normal) + ray.dot(normal)).abs() < 1e-12);
            prop_assert!(mirrored.cross(normal).abs_diff_eq(ray.cross(normal), 1e-12));
        }

        #[test]
        fn a_direction_is_restored_from_its_map_position(direction in vector()) {
            let found = of_place(place(direction));
            prop_assert!(found.normalize().abs_diff_eq(direction.normalize(), 1e-9), "{found} of {direction}");
        }

        /// Beyond a side the map continues with the directions on the other side of it.
        #[test]
        fn the_map_is_continuous_across_its_sides(along in 0.0..1.0f64) {
            for side in [0.0, 1.0] {
                let out = if side == 0.0 { -1e-7 } else { 1e-7 };
                for (inside, outside) in [([side - out, along], [side + out, along]), ([along, side - out], [along, side + out])] {
                    let [inside, outside] = [inside, outside].map(|at| of_place(at).normalize());
                    prop_assert!(inside.abs_diff_eq(outside, 1e-5), "{inside} and {outside}");
                }
            }
        }
    }
}

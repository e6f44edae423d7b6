//! Footprint: turns a splat into the ellipse that it covers on screen (docs/book/algorithm.md §3),
//! and the ellipse into contributions (§4, §5).

use std::f64::consts::TAU;
use std::ops::Range;

use glam::{DMat3, DVec3};

use super::{BlockTest, Rules};
use crate::scene::{Amplitude, Filter, Orientation, Scene, Sheet, View};

/// A splat on screen, in pixels; depths and normals are in camera space.
#[derive(Clone, Debug)]
pub struct Footprint {
    /// Index of the splat in the scene.
    pub splat: u32,
    /// Pixel columns whose centres are in the box, clipped to the picture.
    pub columns: Range<u32>,
    /// Pixel rows whose centres are in the box, clipped to the picture.
    pub rows: Range<u32>,
    /// Linear colour of the splat.
    pub rgb: DVec3,
    /// Opacity of the splat.
    pub opacity: f64,
    /// Unit normal of the splat.
    pub normal: DVec3,
    /// Index of the splat's material.
    pub material: u32,
    /// The projected centre, pixels.
    pub centre: [f64; 2],
    /// `Q00, Q01, Q11`.
    conic: [f64; 3],
    amplitude: f64,
    z: f64,
    /// Change of z per pixel to the right, and down.
    slope: [f64; 2],
    /// The disc extends no further than this from its centre in z.
    z_reach: f64,
    cutoff: f64,
    /// The radial index up to which the weights of its opacity count, if that is less.
    counts_within: f64,
    /// How blocks of pixels are tested, if they are.
    pub blocks: Option<BlockTest>,
    /// Smaller weights make no fragment.
    pub least_weight: f64,
    /// Sheet of the splat, if splats are grouped by sheets.
    pub sheet: u32,
    /// The disc in space, if its filter is computed there.
    disc: Option<Disc>,
}

/// A disc on whose plane pixels are filtered (Heckbert's source-space EWA).
#[derive(Clone, Debug)]
struct Disc {
    /// Centre and normal, camera space.
    position: DVec3,
    normal: DVec3,
    /// The disc extends no further than this from its centre in z.
    z_reach: f64,
    /// Variance of the splat.
    variance: f64,
    /// Variance of the low-pass filter, pixel².
    low_pass: f64,
    /// The view that it is seen from.
    view: View,
}

impl Disc {
    /// Its contribution to the pixel with this centre. The ray meets the plane at x = s·d, where ∂x
    /// is the size of a pixel. The filter of variance r² + v·∂x ∂xᵀ has a peak inverse to its area.
    fn contribution(&self, pixel: [f64; 2]) -> Option<Contribution> {
        let [a, b] = self.view.slopes(pixel);
        let ray = DVec3::new(a, b, 1.0);
        let along = self.normal.dot(ray);
        let depth = self.normal.dot(self.position) / along;
        // Behind the eye, or parallel to the plane.
        if !(depth > 0.0 && depth.is_finite()) {
            return None;
        }
        let offset = depth * ray - self.position;
        let (u, v) = self.normal.any_orthonormal_pair();
        // ∂x/∂px: s also changes as the ray turns, because x stays on the plane.
        let step = |axis: DVec3, focal_px: f64| {
            depth / focal_px * (axis - ray * (self.normal.dot(axis) / along))
        };
        let [fx, fy] = self.view.focal_px;
        let [right, down] =
            [step(DVec3::X, fx), step(DVec3::Y, fy)].map(|step| [step.dot(u), step.dot(v)]);
        let term = |i: usize, j: usize| self.low_pass * (right[i] * right[j] + down[i] * down[j]);
        let [v00, v01, v11] = [
            self.variance + term(0, 0),
            term(0, 1),
            self.variance + term(1, 1),
        ];
        // v·|∂x|² and the term it adds to the square of r²: not a difference of products.
        let area = self.low_pass * (right[0] * down[1] - right[1] * down[0]);
        let determinant =
            self.variance * self.variance + self.variance * (term(0, 0) + term(1, 1)) + area * area;
        let [a, b] = [offset.dot(u), offset.dot(v)];
        let radial_index = (v11 * a * a - 2.0 * v01 * a * b + v00 * b * b) / determinant;
        let amplitude = self.variance / determinant.sqrt() / TAU;
        // The plane continues beyond the disc's rim, the disc does not.
        let z = depth
            .max(self.position.z - self.z_reach)
            .min(self.position.z + self.z_reach);
        radial_index.is_finite().then(|| Contribution {
            radial_index,
            weight: amplitude * libm::exp(-0.5 * radial_index),
            z,
        })
    }

    /// Half sides of a box around the disc's centre on screen that contains everything its filter
    /// reaches, except near the horizon. The whole picture if the disc comes near the eye's plane.
    fn reach(&self, cutoff: f64) -> [f64; 2] {
        let radius = (cutoff * self.variance).sqrt();
        let nearest = self.position.z - radius;
        if nearest <= 0.1 * self.position.z {
            return [f64::INFINITY; 2];
        }
        let filter = (cutoff * self.low_pass).sqrt();
        [
            (self.position.x, self.view.focal_px[0]),
            (self.position.y, self.view.focal_px[1]),
        ]
        .map(|(side, focal_px)| {
            let of_disc = focal_px * radius * (1.0 + side.abs() / self.position.z) / nearest;
            // Towards the horizon a pixel's filter extends farther than at the disc itself.
            of_disc + 4.0 * filter + 1.0
        })
    }
}

impl BlockTest {
    /// Leader pixels of a pixel's block; those of a diagonal twice.
    pub(crate) fn leaders(&self, at: [u32; 2]) -> [[u32; 2]; 4] {
        let [left, top] = self.first(at);
        let [right, bottom] = [left, top].map(|first| first + self.side_px - 1);
        let (first, last) = ([left, top], [right, bottom]);
        if self.diagonal {
            [first, last, first, last]
        } else {
            [first, [right, top], [left, bottom], last]
        }
    }

    /// First pixel of a pixel's block.
    pub fn first(&self, at: [u32; 2]) -> [u32; 2] {
        at.map(|at| at - at % self.side_px)
    }
}

/// Why a splat leaves no footprint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cull {
    /// Its centre is not beyond the near plane.
    Near,
    /// Its box contains no pixel, or it is too far to the side for the affine approximation.
    Outside,
    /// Its opacity is too small for any weight to count.
    Transparent,
    /// It faces away from the eye.
    Backface,
    /// It has no ellipse or no weight.
    Faint,
}

/// Contribution of one footprint to one pixel.
#[derive(Clone, Copy, Debug)]
pub struct Contribution {
    /// Radial index r at the pixel centre.
    pub radial_index: f64,
    /// Amplitude times exp(−r/2).
    pub weight: f64,
    /// Depth of the splat at the pixel centre.
    pub z: f64,
}

/// A variance on screen with its determinant, which is never computed as a difference of two
/// products, because that would cancel.
#[derive(Clone, Copy)]
struct Variance {
    /// `V00, V01, V11`, pixel².
    entries: [f64; 3],
    determinant: f64,
}

impl Variance {
    /// `V_r = K ([1+a², ab; ab, 1+b²] − g gᵀ) K` and `det V_r = (k_x k_y c_n)²`, where `K` is the
    /// diagonal matrix of the radius in pixels along x and y; `ray` is `(a, b, 1)`.
    fn of_disc([kx, ky]: [f64; 2], ray: DVec3, normal: DVec3) -> Self {
        let g = [normal.x - ray.x * normal.z, normal.y - ray.y * normal.z];
        let c_n = normal.dot(ray);
        Variance {
            entries: [
                // Seen edge-on, rounding may make the diagonal negative.
                (kx * kx * (1.0 + ray.x * ray.x - g[0] * g[0])).max(0.0),
                kx * ky * (ray.x * ray.y - g[0] * g[1]),
                (ky * ky * (1.0 + ray.y * ray.y - g[1] * g[1])).max(0.0),
            ],
            determinant: (kx * ky * c_n) * (kx * ky * c_n),
        }
    }

    /// `J V Jᵀ` of an ellipsoid with these half-axes, for a plane at distance 1 times `kx` and
    /// `ky`; `ray` is `(a, b, 1)`.
    fn of_ellipsoid([kx, ky]: [f64; 2], ray: DVec3, half_axes: DMat3) -> Self {
        let (across, down) = (
            DVec3::new(1.0, 0.0, -ray.x) * kx,
            DVec3::new(0.0, 1.0, -ray.y) * ky,
        );
        let covariance = half_axes * half_axes.transpose();
        // Half-axes are columns. The area that two of them span on the screen is their cross
        // product along the ray.
        let [x, y, z] = [half_axes.x_axis, half_axes.y_axis, half_axes.z_axis];
        let spans =
            [y.cross(z), z.cross(x), x.cross(y)].map(|span| (kx * ky * span.dot(ray)).powi(2));
        Variance {
            entries: [
                across.dot(covariance * across).max(0.0),
                across.dot(covariance * down),
                down.dot(covariance * down).max(0.0),
            ],
            determinant: spans.iter().sum(),
        }
    }

    /// A circle as wide as the major axis.
    fn of_major_axis(self) -> Self {
        let [v00, v01, v11] = self.entries;
        let major = (v00 + v11) / 2.0 + ((v00 - v11) / 2.0).hypot(v01);
        Variance {
            entries: [major, 0.0, major],
            determinant: major * major,
        }
    }

    /// `V = V_r + v·I`, with its determinant as three non-negative terms.
    fn low_passed(self, v: f64) -> Self {
        let [v00, v01, v11] = self.entries;
        let determinant = self.determinant + v * (v00 + v11) + v * v;
        Variance {
            entries: [v00 + v, v01, v11 + v],
            determinant,
        }
    }

    /// `V⁻¹`, as `Q00, Q01, Q11`.
    fn inverse(&self) -> [f64; 3] {
        let [v00, v01, v11] = self.entries;
        [
            v11 / self.determinant,
            -v01 / self.determinant,
            v00 / self.determinant,
        ]
    }
}

/// Which weights make a fragment, and whether they fall with depth.
#[derive(Clone, Copy, Debug, Default)]
pub struct Weights {
    /// Smaller weights make no fragment.
    pub least: f64,
    /// Depth from which weights are 0; `None` where they do not depend on depth.
    pub distance: Option<f64>,
}

impl Weights {
    /// Weights of a scene by the rules of a machine.
    pub fn of(scene: &Scene, rules: &Rules) -> Self {
        Weights {
            least: scene.least_weight(),
            distance: (rules.weights_fall_with_depth)
                .then(|| scene.weight_distance())
                .flatten(),
        }
    }

    /// Weights that do not depend on depth.
    pub fn at_least(least: f64) -> Self {
        Weights {
            least,
            distance: None,
        }
    }
}

/// Sets up the `index`-th splat, with smaller weights ignored, or returns why it is culled.
pub(crate) fn set_up(
    scene: &Scene,
    view: &View,
    index: usize,
    weights: Weights,
) -> Result<Footprint, Cull> {
    let (footprint, cull) = set_up_with_cull(scene, view, index, weights);
    cull.map_or(Ok(footprint), Err)
}

/// Sets up the `index`-th splat, and returns why it is culled if it is; its footprint may then be
/// meaningless. The tests are in the order in which culled splats are counted.
pub fn set_up_with_cull(
    scene: &Scene,
    view: &View,
    index: usize,
    weights: Weights,
) -> (Footprint, Option<Cull>) {
    let least_weight = weights.least;
    let splat = &scene.splats[index];
    let cutoff = scene.kernel.cutoff;
    let t = view.rotation * (splat.position - view.eye);
    let ray = DVec3::new(t.x / t.z, t.y / t.z, 1.0);
    let mut normal = view.rotation * splat.normal;
    // The plane that defines depth.
    let mut plane = normal;
    let k = view.focal_px.map(|focal_px| focal_px * splat.radius / t.z);
    let reconstruction = match &scene.ellipsoids {
        None => Variance::of_disc(k, ray, normal),
        Some(ellipsoids) => {
            let Orientation { rotation, scales } = *ellipsoids.orientation(index);
            let axes = view.rotation * DMat3::from_quat(rotation);
            plane = axes.z_axis;
            if ellipsoids.amplitude == Amplitude::Disc {
                normal = plane;
            }
            Variance::of_ellipsoid(
                k,
                clamped(ray, scene, view),
                axes * DMat3::from_diagonal(scales),
            )
        }
    };
    let reconstruction = if scene.kernel.filter == Filter::Circular {
        reconstruction.of_major_axis()
    } else {
        reconstruction
    };
    let c_n = plane.dot(ray);
    let disc = (scene.kernel.filter == Filter::SourceEwa).then_some(Disc {
        position: t,
        normal,
        z_reach: splat.radius * cutoff.sqrt(),
        variance: splat.radius * splat.radius,
        low_pass: scene.kernel.low_pass,
        view: *view,
    });
    let variance = reconstruction.low_passed(scene.kernel.low_pass);
    let centre = [0, 1].map(|axis| view.focal_px[axis] * ray[axis] + view.centre_px[axis]);
    let is_peak = scene
        .ellipsoids
        .as_ref()
        .is_some_and(|ellipsoids| ellipsoids.amplitude == Amplitude::Peak);
    let box_cutoff = if is_peak {
        cutoff.min(counts_within(splat.opacity, least_weight))
    } else {
        cutoff
    };
    let reach = [variance.entries[0], variance.entries[2]].map(|entry| (box_cutoff * entry).sqrt());
    let reach = disc.as_ref().map_or(reach, |disc| disc.reach(cutoff));
    let columns = pixels(centre[0], reach[0], scene.image.width);
    let rows = pixels(centre[1], reach[1], scene.image.height);
    let amplitude = match &scene.ellipsoids {
        None => (reconstruction.determinant / variance.determinant).sqrt() / TAU,
        Some(ellipsoids) => {
            let ray = clamped(ray, scene, view);
            match ellipsoids.amplitude {
                Amplitude::Disc => {
                    let scales = ellipsoids.orientation(index).scales;
                    k[0] * k[1] * (scales.x * scales.y * plane.dot(ray)).abs()
                        / variance.determinant.sqrt()
                        / TAU
                }
                // |J| over the root of the area that the filter leaves of the footprint (EWA (33)).
                Amplitude::LineIntegral => {
                    splat.opacity * k[0] * k[1] * ray.length() / variance.determinant.sqrt()
                }
                Amplitude::Peak if scene.compensates() => {
                    splat.opacity * (reconstruction.determinant / variance.determinant).sqrt()
                }
                Amplitude::Peak => splat.opacity,
            }
        }
    };
    let amplitude = weights.distance.map_or(amplitude, |distance| {
        amplitude * (1.0 - t.z / distance).max(0.0)
    });
    // Squares that left the range of f64 leave no ellipse: its weights would be NaN, and nothing is
    // drawn.
    let conic = variance.inverse();
    let is_ellipse = amplitude.is_finite() && conic.iter().all(|entry| entry.is_finite());
    let (amplitude, conic) = if is_ellipse {
        (amplitude, conic)
    } else {
        (0.0, [0.0; 3])
    };
    let is_flat = scene
        .ellipsoids
        .as_ref()
        .is_none_or(|ellipsoids| ellipsoids.amplitude == Amplitude::Disc);
    let beyond = |axis: usize| ray[axis].abs() > view.slope(axis, scene.kernel.guard);
    // Coordinates near the end of their range overflow to NaN.
    let cull = if t.z <= scene.camera.near || t.z.is_nan() {
        Some(Cull::Near)
    } else if beyond(0) || beyond(1) {
        // Too far to the side for the affine approximation.
        Some(Cull::Outside)
    } else if is_peak && splat.opacity < least_weight {
        Some(Cull::Transparent)
    } else if columns.is_none() || rows.is_none() {
        Some(Cull::Outside)
    } else if scene.surface.cull_backfaces && normal.dot(t) > 0.0 {
        Some(Cull::Backface)
    } else if amplitude == 0.0 {
        // Zero if c_n is zero; 0/0, and therefore no ellipse, if there is no low-pass filter
        // either.
        Some(Cull::Faint)
    } else {
        None
    };
    let footprint = Footprint {
        splat: index as u32,
        columns: columns.unwrap_or_default(),
        rows: rows.unwrap_or_default(),
        rgb: DVec3::from_array(splat.rgb),
        opacity: splat.opacity,
        normal,
        material: splat.material,
        centre,
        conic,
        amplitude,
        z: t.z,
        slope: if is_flat {
            [0, 1].map(|axis| -t.z * plane[axis] / (c_n * view.focal_px[axis]))
        } else {
            [0.0; 2]
        },
        z_reach: if is_flat {
            splat.radius * cutoff.sqrt()
        } else {
            0.0
        },
        cutoff,
        counts_within: box_cutoff,
        blocks: None,
        least_weight,
        sheet: match scene.sheets.as_ref().map(|sheets| &sheets.of) {
            Some(Sheet::Slice(numbers)) => numbers[index],
            Some(Sheet::Splat) => index as u32,
            Some(Sheet::Sum) | None => 0,
        },
        disc,
    };
    (footprint, cull)
}

/// The radial index beyond which no weight counts of a splat whose amplitude is its opacity, plus a
/// margin, because a pixel on the rim can round to either side.
fn counts_within(opacity: f64, least_weight: f64) -> f64 {
    if least_weight > 0.0 {
        2.0 * libm::log(opacity / least_weight).max(0.0) * (1.0 + 1e-6)
    } else {
        f64::INFINITY
    }
}

/// The ray as it enters the Jacobian.
fn clamped(ray: DVec3, scene: &Scene, view: &View) -> DVec3 {
    let limit = [0, 1].map(|axis| view.slope(axis, scene.kernel.jacobian));
    DVec3::new(
        ray.x.clamp(-limit[0], limit[0]),
        ray.y.clamp(-limit[1], limit[1]),
        1.0,
    )
}

/// Pixels whose centres lie within `reach` of `centre`, clipped to the picture; none if the
/// interval misses the picture.
pub fn pixels(centre: f64, reach: f64, size: usize) -> Option<Range<u32>> {
    if !(centre + reach >= 0.0 && centre - reach <= size as f64) {
        return None;
    }
    let clip = |edge: f64| edge.clamp(0.0, size as f64) as u32;
    let first = clip((centre - reach - 0.5).ceil());
    Some(first..clip((centre + reach - 0.5).floor() + 1.0).max(first))
}

impl Footprint {
    /// Turns the normal towards the viewer.
    pub fn turn_normal(&mut self) {
        if self.faces_away() {
            self.normal = -self.normal;
        }
    }

    /// Whether the normal points away from the viewer.
    pub fn faces_away(&self) -> bool {
        self.normal.z > 0.0
    }

    /// Depth of its centre.
    pub fn z(&self) -> f64 {
        self.z
    }

    /// Number of pixels that it contributes to: in each row those between the roots of r − r₀.
    pub fn area(&self) -> u64 {
        if self.disc.is_some() {
            let row = |y: u32| {
                self.columns
                    .clone()
                    .filter(|x| self.row(y).at(*x).is_some())
                    .count() as u64
            };
            return self.rows.clone().map(row).sum();
        }
        let least = if self.least_weight > 0.0 {
            2.0 * libm::log(self.amplitude / self.least_weight)
        } else {
            f64::INFINITY
        };
        let limit = self.cutoff.min(least);
        let row = |y: u32| {
            let FootprintRow {
                linear, constant, ..
            } = self.row(y);
            let [square, middle] = [self.conic[0], -linear / (2.0 * self.conic[0])];
            let half = ((linear * linear - 4.0 * square * (constant - limit))
                / (4.0 * square * square))
                .sqrt();
            // NaN if no pixel of the row is within the limit.
            let inside = pixels(self.centre[0] + middle, half, self.columns.end as usize)
                .unwrap_or_default();
            u64::from(
                inside
                    .end
                    .saturating_sub(inside.start.max(self.columns.start)),
            )
        };
        self.rows.clone().map(row).sum()
    }

    /// The radial index below which a leader keeps its block.
    pub fn leader_cutoff(&self, test: &BlockTest) -> f64 {
        if test.by_opacity {
            self.counts_within
        } else {
            self.cutoff
        }
    }

    /// r at the leaders of a pixel's block.
    pub fn leaders(&self, test: &BlockTest, at: [u32; 2]) -> [f64; 4] {
        test.leaders(at).map(|[x, y]| self.row(y).radial_index(x).1)
    }

    /// Whether the block of a pixel is kept, or none is tested.
    pub fn keeps_block(&self, at: [u32; 2]) -> bool {
        self.blocks.is_none_or(|test| {
            let cutoff = self.leader_cutoff(&test);
            self.leaders(&test, at)
                .iter()
                .any(|radial| *radial < cutoff)
        })
    }

    /// The footprint along one row of pixels.
    pub fn row(&self, y: u32) -> FootprintRow<'_> {
        let dy = f64::from(y) + 0.5 - self.centre[1];
        let [_, q01, q11] = self.conic;
        let z = self.z + self.slope[1] * dy;
        FootprintRow {
            footprint: self,
            middle: f64::from(y) + 0.5,
            linear: 2.0 * q01 * dy,
            constant: q11 * dy * dy,
            z,
        }
    }
}

/// One row of a footprint: `r = Q00·dx² + linear·dx + constant`.
pub struct FootprintRow<'a> {
    footprint: &'a Footprint,
    /// The row's centre in x, pixels.
    middle: f64,
    linear: f64,
    constant: f64,
    z: f64,
}

impl FootprintRow<'_> {
    /// Contribution of the footprint to the pixel in column `x`, if it reaches the pixel.
    #[inline]
    pub fn at(&self, x: u32) -> Option<Contribution> {
        if let Some(disc) = &self.footprint.disc {
            let contribution = disc.contribution([f64::from(x) + 0.5, self.middle])?;
            return (contribution.radial_index < self.footprint.cutoff).then_some(contribution);
        }
        let (dx, radial_index) = self.radial_index(x);
        if radial_index >= self.footprint.cutoff {
            return None;
        }
        let contribution = self.contribution(dx, radial_index);
        let is_drawn = contribution.weight >= self.footprint.least_weight
            && self.footprint.keeps_block([x, self.middle as u32]);
        is_drawn.then_some(contribution)
    }

    /// Whether the footprint reaches the pixel in column `x`, given its contribution there; blocks
    /// are not tested.
    pub fn reaches(&self, x: u32, beyond: &Contribution) -> bool {
        let Footprint {
            cutoff,
            least_weight,
            disc,
            ..
        } = self.footprint;
        if disc.is_some() {
            self.at(x).is_some()
        } else {
            beyond.radial_index < *cutoff && beyond.weight >= *least_weight
        }
    }

    /// Contribution of the footprint to the pixel in column `x`, whether or not it reaches the
    /// pixel.
    pub fn beyond(&self, x: u32) -> Contribution {
        let (dx, radial_index) = self.radial_index(x);
        self.contribution(dx, radial_index)
    }

    #[inline]
    fn radial_index(&self, x: u32) -> (f64, f64) {
        let footprint = self.footprint;
        let dx = f64::from(x) + 0.5 - footprint.centre[0];
        (
            dx,
            (footprint.conic[0] * dx + self.linear) * dx + self.constant,
        )
    }

    #[inline]
    fn contribution(&self, dx: f64, radial_index: f64) -> Contribution {
        let footprint = self.footprint;
        Contribution {
            radial_index,
            // A needle's conic may round to one that is not positive; its weight must still not
            // exceed its amplitude.
            weight: footprint.amplitude * libm::exp(-0.5 * radial_index.max(0.0)),
            // max and min instead of clamp: they limit an infinite slope times zero to a bound.
            z: (self.z + footprint.slope[0] * dx)
                .max(footprint.z - footprint.z_reach)
                .min(footprint.z + footprint.z_reach),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    prop_compose! {
        fn unit()(z in -1.0_f64..1.0, turn in 0.0..TAU) -> DVec3 {
            let ring = (1.0 - z * z).sqrt();
            DVec3::new(ring * libm::cos(turn), ring * libm::sin(turn), z)
        }
    }

    proptest! {
        /// `V00·V11 − V01²` against `k⁴c_n² + v·tr V_r + v²`, in a range where the first does not
        /// cancel: the low-pass filter bounds the aspect of an ellipse by its size.
        #[test]
        fn both_routes_to_the_determinant_agree(k in 0.01_f64..100.0, ratio in 0.5_f64..2.0, a in -1.5_f64..1.5, b in -1.5_f64..1.5, normal in unit(), v in 0.5_f64..2.0) {
            let variance = Variance::of_disc([k, ratio * k], DVec3::new(a, b, 1.0), normal).low_passed(v);
            let [v00, v01, v11] = variance.entries;
            let difference = v00 * v11 - v01 * v01;
            prop_assert!((variance.determinant / difference - 1.0).abs() < 1e-9);
        }

        /// The disc's own determinant, at most 80 degrees from the front.
        #[test]
        fn the_determinant_of_a_disc_is_a_square(k in 0.01_f64..100.0, ratio in 0.5_f64..2.0, a in -1.5_f64..1.5, b in -1.5_f64..1.5, normal in unit()) {
            let ray = DVec3::new(a, b, 1.0);
            prop_assume!(normal.dot(ray).abs() > 0.17);
            let variance = Variance::of_disc([k, ratio * k], ray, normal);
            let [v00, v01, v11] = variance.entries;
            prop_assert!(((v00 * v11 - v01 * v01) / variance.determinant - 1.0).abs() < 1e-9);
        }
    }

    /// The same variance by the formula of SS: with a tangent basis and the Jacobian of the
    /// projection.
    #[test]
    fn the_variance_is_that_of_two_projected_tangents() {
        let (k, ray, normal) = (
            [3.0, 2.5],
            DVec3::new(0.4, -0.7, 1.0),
            DVec3::new(2.0, -1.0, -2.0) / 3.0,
        );
        let (u, v) = normal.any_orthonormal_pair();
        let project = |tangent: DVec3| {
            [
                k[0] * (tangent.x - ray.x * tangent.z),
                k[1] * (tangent.y - ray.y * tangent.z),
            ]
        };
        let (u, v) = (project(u), project(v));
        let expected = [
            u[0] * u[0] + v[0] * v[0],
            u[0] * u[1] + v[0] * v[1],
            u[1] * u[1] + v[1] * v[1],
        ];
        for (entry, expected) in Variance::of_disc(k, ray, normal)
            .entries
            .iter()
            .zip(expected)
        {
            assert!((entry - expected).abs() < 1e-12, "{entry} {expected}");
        }
    }

    #[test]
    fn the_conic_is_the_inverse_of_the_variance() {
        let variance = Variance {
            entries: [5.0, -1.5, 2.0],
            determinant: 7.75,
        };
        let ([v00, v01, v11], [q00, q01, q11]) = (variance.entries, variance.inverse());
        let product = [
            v00 * q00 + v01 * q01,
            v00 * q01 + v01 * q11,
            v01 * q00 + v11 * q01,
            v01 * q01 + v11 * q11,
        ];
        for (entry, expected) in product.into_iter().zip([1.0, 0.0, 0.0, 1.0]) {
            assert!((entry - expected).abs() < 1e-15);
        }
    }

    #[test]
    fn a_box_holds_the_centres_that_it_covers() {
        assert_eq!(pixels(10.0, 1.4, 100), Some(9..11));
        assert_eq!(pixels(10.0, 1.6, 100), Some(8..12));
        assert_eq!(pixels(-1.0, 0.5, 100), None);
        assert_eq!(pixels(-1.0, 1.2, 100), Some(0..0));
        assert_eq!(pixels(0.0, f64::INFINITY, 100), Some(0..100));
        assert_eq!(pixels(f64::NAN, 1.0, 100), None);
    }
}

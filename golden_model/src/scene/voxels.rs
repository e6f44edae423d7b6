//! Voxels: converts a scalar field to splats, by a transfer function or as an isosurface (EWA §6,
//! docs/book/algorithm-resolve.md §9).
//!
//! ```text
//! samples ─►[ transfer: value → rgb, opacity ]─►(× gradient's factor)─► visible voxels ─►[ slices along the view ]─► sheets
//!       └─►[ isovalue: moved along the gradient to the surface, flattened there ]─► surface splats
//! ```
//! An invisible voxel does not become a splat. A transfer function's opacity α is that of a layer
//! one step thick, where a step is the shortest spacing: its optical depth is −ln(1 − α), and the
//! extinction g is that divided by the step. A kernel of standard deviations σᵢ represents one cell
//! of volume V_c. Its optical depth through the centre is g·V_c/(2πσ²), that of a ball with the
//! largest σ: this is the splat's opacity, which setup converts to the view. A footprint ends at
//! the cutoff c of the radial index and lacks e^(−c/2) of the whole one; the depth is increased to
//! compensate.
//!
//! A grid may be sheared: its kernels have the principal axes of the cell that its three steps
//! span, as in [`super::cells`], and its slices are the planes of two of its axes.
//!
//! Law: `a_slab_is_as_opaque_as_it_says` (tests/regressions_promises.rs).

use super::cells::Cell;
use super::placement::Placement;
use super::volume::Volume;
use super::{Ellipsoids, Orientation, Scene, Sheet, Splat, View};
use glam::{DMat3, DQuat, DVec3};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Colour and optical depth of a value; linear between two values, constant beyond the first and
/// the last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransferPoint {
    /// Value of the field.
    pub value: f64,
    /// Linear light.
    pub rgb: [f64; 3],
    /// Of a layer one step thick, corrected for the cutoff of its kernels ([`depth_of_layer`]).
    pub depth: f64,
}

/// Greatest opacity: an opaque layer would have infinite depth, and no frame word of 16 bits can
/// distinguish the two.
pub(super) const MOST_OPACITY: f64 = 1.0 - 1.0 / 65536.0;

/// Total optical depth of a layer's kernels with which the layer has this opacity if they end at a
/// cutoff.
pub fn depth_of_layer(opacity: f64, cutoff: f64) -> f64 {
    let left = -libm::expm1(-cutoff / 2.0);
    -libm::log1p(-opacity.min(MOST_OPACITY)) / left
}

/// Opacity at the upper end of the default ramp: with the default cutoff of 4 an optical depth of
/// 0.2.
const USUAL_OPACITY: f64 = 0.158_805_979_395_819_03;

/// Classification of a field into splats.
#[derive(Clone, Debug, PartialEq)]
pub struct Classification {
    /// In the order of values; never empty.
    pub transfer: Vec<TransferPoint>,
    /// Factor on optical depth by gradient magnitude, in the order of magnitudes; empty: 1.
    pub gradient: Vec<[f64; 2]>,
    /// σ along each axis, in steps along it.
    pub radius: f64,
    /// Index into the scene's materials.
    pub material: u32,
}

/// The samples of a grid that became splats: needed to sort those for a view.
#[derive(Clone, Debug)]
pub struct Voxels {
    /// The sample of each splat.
    at: Vec<[u32; 3]>,
    axes: Axes,
    origin: DVec3,
}

fn vector(of: [f64; 3]) -> DVec3 {
    DVec3::from_array(of)
}

/// Cosine of the greatest deviation that counts as a right angle: headers round their numbers.
const RIGHT_ANGLE: f64 = 1e-3;

/// The three steps of a grid.
#[derive(Clone, Copy, Debug)]
struct Axes {
    steps: [DVec3; 3],
    /// Normals of the planes of the other two; the steps themselves if all are at right angles.
    normals: [DVec3; 3],
    /// Principal axes of a cell.
    principal: [DVec3; 3],
}

impl Axes {
    fn new(steps: [DVec3; 3]) -> Self {
        let [x, y, z] = steps;
        let is_right = |a: DVec3, b: DVec3| a.dot(b).abs() <= RIGHT_ANGLE * a.length() * b.length();
        if is_right(x, y) && is_right(x, z) && is_right(y, z) {
            return Axes {
                steps,
                normals: steps,
                principal: steps,
            };
        }
        let units = steps.map(DVec3::normalize);
        let normals = [0, 1, 2].map(|axis| units[(axis + 1) % 3].cross(units[(axis + 2) % 3]));
        Axes {
            steps,
            normals,
            principal: Cell::new(DMat3::from_cols(x, y, z)).principal(),
        }
    }

    /// Lengths of a cell along its principal axes.
    fn lengths(&self) -> [f64; 3] {
        self.principal.map(DVec3::length)
    }

    /// Index along an axis of a position relative to the first sample.
    fn index(&self, axis: usize, way: DVec3) -> f64 {
        way.dot(self.normals[axis]) / self.normals[axis].dot(self.steps[axis])
    }
}

/// A field with its geometry.
struct FieldGeometry<'a> {
    volume: &'a Volume,
    axes: Axes,
}

impl<'a> FieldGeometry<'a> {
    fn new(volume: &'a Volume) -> Self {
        FieldGeometry {
            volume,
            axes: Axes::new(volume.axes.map(vector)),
        }
    }

    fn value(&self, [x, y, z]: [usize; 3]) -> f64 {
        let [width, height, _] = self.volume.size;
        f64::from(self.volume.values[(z * height + y) * width + x])
    }

    fn position(&self, at: [usize; 3]) -> DVec3 {
        (0..3).fold(vector(self.volume.origin), |position, axis| {
            position + self.axes.steps[axis] * at[axis] as f64
        })
    }

    /// Central differences; one-sided at the border and next to a NaN sample.
    fn gradient(&self, at: [usize; 3]) -> DVec3 {
        let along = |axis: usize| {
            let step = |to: usize| {
                let mut there = at;
                there[axis] = to;
                self.value(there)
            };
            let known = |to: usize| if step(to).is_nan() { at[axis] } else { to };
            let (low, high) = (
                known(at[axis].saturating_sub(1)),
                known((at[axis] + 1).min(self.volume.size[axis] - 1)),
            );
            if low == high {
                return DVec3::ZERO;
            }
            let normal = self.axes.normals[axis];
            normal
                * ((step(high) - step(low))
                    / ((high - low) as f64 * normal.dot(self.axes.steps[axis])))
        };
        along(0) + along(1) + along(2)
    }

    fn steps(&self) -> [f64; 3] {
        self.axes.lengths()
    }

    fn longest_step(&self) -> f64 {
        self.steps().into_iter().fold(0.0, f64::max)
    }

    /// The surface's normal and its distance along that from a sample; None if other samples are
    /// nearer to it.
    fn surface(&self, at: [usize; 3], isovalue: f64) -> Option<(DVec3, f64)> {
        let gradient = self.gradient(at);
        let away = (isovalue - self.value(at)) / gradient.length();
        // Samples on both sides find the same surface: those within half a step close it.
        if away.is_nan() || away.abs() > 0.5 * self.longest_step() {
            return None;
        }
        Some((super::unit(gradient)?, away))
    }

    /// Every sample of a slice along z.
    fn slice(&self, z: usize) -> impl Iterator<Item = [usize; 3]> {
        let [width, height, _] = self.volume.size;
        (0..height).flat_map(move |y| (0..width).map(move |x| [x, y, z]))
    }
}

/// Linear between points in ascending order; constant beyond the ends.
fn piecewise<const N: usize>(points: impl Iterator<Item = (f64, [f64; N])>, at: f64) -> [f64; N] {
    let mut before: Option<(f64, [f64; N])> = None;
    for (place, point) in points {
        match before {
            _ if at > place => before = Some((place, point)),
            Some((from, start)) if place > from => {
                let part = (at - from) / (place - from);
                return std::array::from_fn(|i| start[i] + (point[i] - start[i]) * part);
            }
            _ => return point,
        }
    }
    before.map_or([0.0; N], |(_, point)| point)
}

impl Classification {
    /// A ramp over a field's upper three quarters, for kernels that end at a cutoff.
    pub fn usual(values: &[f32], cutoff: f64) -> Vec<TransferPoint> {
        let (low, high) = values
            .iter()
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), v| {
                (low.min(*v), high.max(*v))
            });
        let (low, high) = (f64::from(low), f64::from(high));
        let at = |part: f64, opacity| TransferPoint {
            value: low + (high - low) * part,
            rgb: [1.0; 3],
            depth: depth_of_layer(opacity, cutoff),
        };
        vec![at(0.25, 0.0), at(1.0, USUAL_OPACITY)]
    }

    /// Colour and depth of a value; NaN, a missing sample, is invisible.
    pub(super) fn colour(&self, value: f64) -> ([f64; 3], f64) {
        if value.is_nan() {
            return ([0.0; 3], 0.0);
        }
        let points = self
            .transfer
            .iter()
            .map(|p| (p.value, [p.rgb[0], p.rgb[1], p.rgb[2], p.depth]));
        let [r, g, b, depth] = piecewise(points, value);
        ([r, g, b], depth)
    }

    pub(super) fn factor(&self, magnitude: f64) -> f64 {
        if self.gradient.is_empty() {
            return 1.0;
        }
        piecewise(
            self.gradient.iter().map(|[at, factor]| (*at, [*factor])),
            magnitude,
        )[0]
    }

    /// Counts the samples that the transfer function shows, without the gradient's factor.
    pub fn seen(&self, values: &[f32]) -> u64 {
        values
            .par_iter()
            .filter(|value| self.colour(f64::from(**value)).1 > 0.0)
            .count() as u64
    }

    /// Counts the splats of an isosurface.
    pub fn on_surface(volume: &Volume, isovalue: f64) -> u64 {
        let field = FieldGeometry::new(volume);
        let of_slice = |z| {
            field
                .slice(z)
                .filter(|at| field.surface(*at, isovalue).is_some())
                .count() as u64
        };
        (0..volume.size[2]).into_par_iter().map(of_slice).sum()
    }

    /// The largest standard deviation of a kernel, world units.
    pub fn sigma(&self, volume: &Volume) -> f64 {
        self.radius * FieldGeometry::new(volume).longest_step()
    }

    /// Every visible voxel, in the order of the samples. A layer is `layer` world units thick, or
    /// the shortest step.
    pub fn voxels(&self, volume: &Volume, layer: Option<f64>) -> (Vec<Splat>, Voxels) {
        let field = FieldGeometry::new(volume);
        let steps = field.steps();
        let step = layer.unwrap_or(steps.into_iter().fold(f64::INFINITY, f64::min));
        let sigma = self.sigma(volume);
        // Optical depth of a layer relative to that through a ball of radius σ.
        let through = steps.iter().product::<f64>() / (step * TAU * sigma * sigma);
        let voxel = |at: [usize; 3]| {
            let (rgb, depth) = self.colour(field.value(at));
            // Most of a volume is transparent.
            if depth <= 0.0 {
                return None;
            }
            let gradient = field.gradient(at);
            let depth = depth * self.factor(gradient.length());
            let splat = Splat {
                position: field.position(at),
                normal: super::unit(gradient).unwrap_or(DVec3::ZERO),
                radius: sigma,
                rgb,
                opacity: depth * through,
                material: self.material,
            };
            (depth > 0.0).then_some((splat, at.map(|index| index as u32)))
        };
        let slices: Vec<Vec<(Splat, [u32; 3])>> = (0..volume.size[2])
            .into_par_iter()
            .map(|z| field.slice(z).filter_map(voxel).collect())
            .collect();
        let (splats, at) = slices.into_iter().flatten().unzip();
        (
            splats,
            Voxels {
                at,
                axes: field.axes,
                origin: vector(volume.origin),
            },
        )
    }

    /// Splats on the surface at which the field has this value, their axes, and the area that each
    /// represents: σ is `radius` of the longest step, and `flatten` times less along the gradient
    /// (EWA §6.4).
    pub fn isosurface(
        &self,
        volume: &Volume,
        isovalue: f64,
        flatten: f64,
    ) -> (Vec<Splat>, Vec<Orientation>, f64) {
        let field = FieldGeometry::new(volume);
        let longest = field.longest_step();
        let rgb = self.colour(isovalue).0;
        let splat = |at: [usize; 3]| {
            let (normal, away) = field.surface(at, isovalue)?;
            let splat = Splat {
                position: field.position(at) + normal * away,
                normal,
                radius: self.radius * longest,
                rgb,
                opacity: 1.0,
                material: self.material,
            };
            let rotation = DQuat::from_rotation_arc(DVec3::Z, normal);
            Some((
                splat,
                Orientation {
                    rotation,
                    scales: DVec3::new(1.0, 1.0, 1.0 / flatten),
                },
            ))
        };
        let slices: Vec<Vec<(Splat, Orientation)>> = (0..volume.size[2])
            .into_par_iter()
            .map(|z| field.slice(z).filter_map(splat).collect())
            .collect();
        let (splats, orientations) = slices.into_iter().flatten().unzip();
        // Samples within half of the longest step on both sides: a layer of cells of that
        // thickness.
        (
            splats,
            orientations,
            field.steps().iter().product::<f64>() / longest,
        )
    }
}

/// The rank of each slice by distance from the eye, nearest first or last.
pub(super) fn ranks(slices: u32, distance: impl Fn(u32) -> f64, back_to_front: bool) -> Vec<u32> {
    let mut order: Vec<u32> = (0..slices).collect();
    order.sort_by(|a, b| distance(*a).total_cmp(&distance(*b)));
    if back_to_front {
        order.reverse();
    }
    let mut rank = vec![0; slices as usize];
    order
        .iter()
        .zip(0..)
        .for_each(|(slice, nth)| rank[*slice as usize] = nth);
    rank
}

impl Voxels {
    /// Moves the grid to another place.
    pub(super) fn put(&mut self, place: &Placement) {
        self.axes = Axes::new(self.axes.steps.map(|axis| place.vector(axis)));
        self.origin = place.point(self.origin);
    }

    /// The kernel of all voxels.
    pub(super) fn orientation(&self) -> Orientation {
        let longest = self.axes.lengths().into_iter().fold(0.0, f64::max);
        let [x, y, z] = self.axes.principal.map(DVec3::normalize);
        // A kernel is symmetric: a mirrored grid has the same kernel.
        let z = if x.cross(y).dot(z) < 0.0 { -z } else { z };
        Orientation {
            rotation: DQuat::from_mat3(&DMat3::from_cols(x, y, z)),
            scales: DVec3::from_array(self.axes.lengths().map(|length| length / longest)),
        }
    }

    /// Sorts the splats for a view: slice by slice along the axis nearest to the view direction,
    /// those nearest to the eye first, or last. The number of a slice is its sheet.
    pub fn ordered(
        self,
        splats: Vec<Splat>,
        view: &View,
        back_to_front: bool,
    ) -> (Vec<Splat>, Orientation, Sheet) {
        let forward = view.rotation.row(2);
        let across = |axis: &usize| self.axes.normals[*axis].normalize().dot(forward).abs();
        let axis = (0..3)
            .max_by(|a, b| across(a).total_cmp(&across(b)))
            .unwrap_or(0);
        let eye = self.axes.index(axis, view.eye - self.origin);
        let slices = self.at.iter().map(|at| at[axis] + 1).max().unwrap_or(0);
        let rank = ranks(
            slices,
            |slice| (f64::from(slice) - eye).abs(),
            back_to_front,
        );
        let orientation = self.orientation();
        let mut ranked: Vec<(u32, Splat)> = self
            .at
            .iter()
            .zip(splats)
            .map(|(at, splat)| (rank[at[axis] as usize], splat))
            .collect();
        ranked.sort_by_key(|(rank, _)| *rank);
        let (numbers, splats) = ranked.into_iter().unzip();
        (splats, orientation, Sheet::Slice(numbers))
    }
}

impl Ellipsoids {
    /// Ellipsoids of a medium that emits: all with the same kernel, or each with its own.
    pub(super) fn of_volume(orientations: Vec<Orientation>, sorted: bool) -> Self {
        Ellipsoids {
            orientations,
            amplitude: super::Amplitude::LineIntegral,
            preshaded: true,
            sorted,
            harmonics: None,
        }
    }
}

impl Scene {
    /// Enlarges kernels, equally in all directions, until the thinnest axis of each is as wide on
    /// the screen as the low-pass filter, and removes the filter (Swan et al., *An Anti-Aliasing
    /// Technique for Splatting*, 1997). The total emission of a kernel does not change.
    pub(super) fn scale_kernels(&mut self) {
        let (view, filter) = (self.view(), self.kernel.low_pass.sqrt());
        let Some(ellipsoids) = &self.ellipsoids else {
            return;
        };
        for (index, splat) in self.splats.iter_mut().enumerate() {
            let depth = view.rotation.row(2).dot(splat.position - view.eye);
            let thinnest_px = view.focal_px[0].min(view.focal_px[1])
                * splat.radius
                * ellipsoids.orientation(index).scales.min_element()
                / depth;
            // Splats behind the eye are not drawn.
            let factor = if thinnest_px > 0.0 {
                (filter / thinnest_px).max(1.0)
            } else {
                1.0
            };
            splat.radius *= factor;
            splat.opacity /= factor * factor;
        }
        self.kernel.low_pass = 0.0;
    }
}

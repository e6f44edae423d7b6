//! Cells: converts samples on an irregular grid, or at points, to splats with individual kernels
//! (EWA §6).
//!
//! ```text
//! positions ─►[ steps to the neighbours ]─► J, a cell ─►[ principal axes ]─► σ, axes, scales
//! values ─►[ transfer ]─►(× gradient's factor)─► optical depth of a layer ─►(× |det J| over that of a ball)─► opacity
//! ```
//! A sample represents a cell spanned by three steps, the columns of J. Its kernel has the variance
//! radius²·J·Jᵀ, and represents the volume |det J|. On a grid a step is half the vector from the
//! previous to the next neighbour, and at the border the vector to the only neighbour: for a
//! curvilinear grid J is thus the Jacobian. A point has a step as long as its spacing in all
//! directions, or J·Jᵀ = V/radius² if its variance V is given. An even grid thus has the kernels of
//! a volume (`an_even_grid_is_the_volume_that_it_is`).
//!
//! Extinction as in [`super::voxels`]: a transfer function's opacity is that of a layer. Its
//! thickness is given, or the median of the samples' shortest steps.

use super::neighbours::{self, PointSurroundings};
use super::placement::Placement;
use super::volume::{Irregular, SamplePlaces};
use super::voxels::{Classification, ranks};
use super::{Orientation, Splat, View};
use glam::{DMat3, DQuat, DVec3};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Axes thinner than this part of the thickest get this thickness: no word can distinguish them
/// from 0.
const THINNEST: f64 = 1e-6;
/// Points are in a plane if the determinant of their squares is less than this part of the cube of
/// the trace.
const FLAT: f64 = 1e-9;

/// A field with the neighbours of each sample.
pub struct Cells<'a> {
    field: &'a Irregular,
    /// Scattered points only.
    around: Vec<PointSurroundings>,
    /// σ in steps.
    radius: f64,
}

/// Splats of samples.
pub struct Sampled {
    /// In the order of the samples.
    pub splats: Vec<Splat>,
    /// One for each splat.
    pub orientations: Vec<Orientation>,
    /// Indices on the grid and the grid's coordinates, if it is rectilinear: its slices are sheets.
    pub slices: Option<Slices>,
}

/// Slices of a rectilinear grid.
#[derive(Clone, Debug)]
pub struct Slices {
    /// Index of each splat on the grid.
    at: Vec<[u32; 3]>,
    coordinates: [Vec<f64>; 3],
    /// Placement applied since.
    place: Placement,
}

/// A cell by its principal axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    steps: DMat3,
    /// Unit vectors, right-handed, and the lengths of the cell along them.
    axes: DMat3,
    lengths: DVec3,
}

impl Cell {
    /// The cell of three steps.
    pub(super) fn new(steps: DMat3) -> Self {
        let (axes, lengths) = principal_axes(steps);
        Cell {
            steps,
            axes,
            lengths,
        }
    }

    /// Its principal axes, as long as the cell along them.
    pub(super) fn principal(&self) -> [DVec3; 3] {
        [
            self.axes.x_axis * self.lengths.x,
            self.axes.y_axis * self.lengths.y,
            self.axes.z_axis * self.lengths.z,
        ]
    }

    fn volume(&self) -> f64 {
        self.lengths.element_product()
    }

    fn has_volume(&self) -> bool {
        self.volume() > 0.0 && self.volume().is_finite() && self.axes.is_finite()
    }

    /// Gradient of a field that grows by `growth` along the steps.
    fn gradient(&self, growth: DVec3) -> DVec3 {
        let gradient = self.steps.transpose().inverse() * growth;
        if gradient.is_finite() {
            gradient
        } else {
            DVec3::ZERO
        }
    }
}

/// Principal axes (unit vectors, right-handed) and lengths of the cell spanned by three steps.
/// One-sided rotations (Hestenes 1958) make the steps orthogonal without changing J·Jᵀ. An axis of
/// length 0 is not finite.
pub(super) fn principal_axes(steps: DMat3) -> (DMat3, DVec3) {
    let largest = steps
        .to_cols_array()
        .iter()
        .fold(0.0_f64, |largest, entry| largest.max(entry.abs()));
    // Scaled to about 1: squares neither overflow nor underflow.
    let scale = if largest > 0.0 && largest.is_finite() {
        largest
    } else {
        1.0
    };
    let mut columns = [steps.x_axis, steps.y_axis, steps.z_axis].map(|column| column / scale);
    // Convergence is quadratic: six sweeps reach the rounding from any matrix.
    for (p, q) in [(0, 1), (0, 2), (1, 2)].into_iter().cycle().take(18) {
        let (a, b) = (columns[p], columns[q]);
        let off = a.dot(b);
        if off != 0.0 {
            let theta = (b.length_squared() - a.length_squared()) / (2.0 * off);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            (columns[p], columns[q]) = (a * c - b * (t * c), a * (t * c) + b * c);
        }
    }
    let lengths = columns.map(DVec3::length);
    let [x, y, z] = [0, 1, 2].map(|i| columns[i] / lengths[i]);
    // A kernel is symmetric.
    let z = if x.cross(y).dot(z) < 0.0 { -z } else { z };
    (
        DMat3::from_cols(x, y, z),
        DVec3::from_array(lengths) * scale,
    )
}

/// Completes the steps of a grid with a single sample along some axes: there they are orthogonal to
/// the others, with their mean length.
fn completed(steps: [Option<DVec3>; 3], lone: f64) -> DMat3 {
    let mut steps = steps;
    if steps == [None; 3] {
        steps[0] = Some(DVec3::X * lone);
    }
    if let (Some(i), 1) = (
        steps.iter().position(Option::is_some),
        steps.iter().flatten().count(),
    ) {
        let along = steps[i].unwrap_or_default();
        steps[(i + 1) % 3] = super::unit(along)
            .map(|unit| unit.any_orthonormal_vector() * along.length())
            .or(Some(DVec3::ZERO));
    }
    if let Some(i) = steps.iter().position(Option::is_none) {
        let [a, b] = [1, 2].map(|next| steps[(i + next) % 3].unwrap_or_default());
        steps[i] = super::unit(a.cross(b))
            .map(|unit| unit * (a.length() * b.length()).sqrt())
            .or(Some(DVec3::ZERO));
    }
    let [x, y, z] = steps.map(Option::unwrap_or_default);
    DMat3::from_cols(x, y, z)
}

/// A matrix L with L·Lᵀ = V, for a positive definite V: xx, yy, zz, xy, yz, xz.
fn root([xx, yy, zz, xy, yz, xz]: [f64; 6]) -> DMat3 {
    let a = xx.sqrt();
    let (b, d) = (xy / a, xz / a);
    let c = (yy - b * b).max(0.0).sqrt();
    let e = if c > 0.0 { (yz - d * b) / c } else { 0.0 };
    let f = (zz - d * d - e * e).max(0.0).sqrt();
    DMat3::from_cols(
        DVec3::new(a, b, d),
        DVec3::new(0.0, c, e),
        DVec3::new(0.0, 0.0, f),
    )
}

impl<'a> Cells<'a> {
    /// For kernels of this σ, in steps.
    pub fn new(field: &'a Irregular, radius: f64) -> Self {
        let around = match &field.places {
            SamplePlaces::Scattered(points, _) => neighbours::surroundings(points),
            _ => Vec::new(),
        };
        Cells {
            field,
            around,
            radius,
        }
    }

    fn size(&self) -> [usize; 3] {
        match &self.field.places {
            SamplePlaces::Rectilinear(coordinates) => coordinates.each_ref().map(Vec::len),
            SamplePlaces::Curvilinear(size, _) => *size,
            SamplePlaces::Scattered(points, _) => [points.len(), 1, 1],
        }
    }

    fn at(&self, index: usize) -> [usize; 3] {
        let [width, height, _] = self.size();
        [
            index % width,
            index / width % height,
            index / width / height,
        ]
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        let [width, height, _] = self.size();
        (z * height + y) * width + x
    }

    fn value(&self, index: usize) -> f64 {
        f64::from(self.field.values[index])
    }

    fn position(&self, index: usize) -> DVec3 {
        match &self.field.places {
            SamplePlaces::Rectilinear(coordinates) => {
                let at = self.at(index);
                DVec3::from_array([0, 1, 2].map(|axis| coordinates[axis][at[axis]]))
            }
            SamplePlaces::Curvilinear(_, points) | SamplePlaces::Scattered(points, _) => {
                points[index]
            }
        }
    }

    /// The neighbours along an axis of a grid: the sample itself at its border; None if the axis
    /// has a single sample.
    fn neighbours(&self, index: usize, axis: usize) -> Option<([usize; 2], f64)> {
        let at = self.at(index);
        let (low, high) = (
            at[axis].saturating_sub(1),
            (at[axis] + 1).min(self.size()[axis] - 1),
        );
        let there = |to: usize| {
            let mut there = at;
            there[axis] = to;
            self.index(there)
        };
        (low < high).then(|| ([there(low), there(high)], (high - low) as f64))
    }

    fn cell(&self, index: usize) -> Cell {
        let steps = match &self.field.places {
            SamplePlaces::Scattered(_, Some(variances)) => {
                root(variances[index]) * (1.0 / self.radius)
            }
            SamplePlaces::Scattered(_, None) => {
                DMat3::from_diagonal(DVec3::splat(self.around[index].spacing))
            }
            _ => {
                let step = |axis| {
                    self.neighbours(index, axis).map(|([low, high], ways)| {
                        (self.position(high) - self.position(low)) / ways
                    })
                };
                completed(
                    [step(0), step(1), step(2)],
                    neighbours::lone_radius(self.position(index)),
                )
            }
        };
        Cell::new(steps)
    }

    /// Gradient: for a grid by differences along it; for points by least squares over the nearest
    /// ones.
    fn gradient(&self, index: usize, cell: &Cell) -> DVec3 {
        let SamplePlaces::Scattered(points, _) = &self.field.places else {
            let neighbours = [0, 1, 2].map(|axis| self.neighbours(index, axis));
            if neighbours
                .iter()
                .flatten()
                .flat_map(|(ends, _)| ends)
                .any(|end| self.value(*end).is_nan())
            {
                return self.one_sided_gradient(
                    index,
                    neighbours.map(|neighbours| neighbours.map(|(ends, _)| ends)),
                );
            }
            let growth = |axis: usize| {
                neighbours[axis].map_or(0.0, |([low, high], ways)| {
                    (self.value(high) - self.value(low)) / ways
                })
            };
            return cell.gradient(DVec3::new(growth(0), growth(1), growth(2)));
        };
        let around = &self.around[index];
        let nearest = around
            .nearest
            .iter()
            .filter(|other| **other != neighbours::NONE)
            .map(|other| *other as usize);
        let nearest = nearest.filter(|other| !self.value(*other).is_nan());
        let (mut squares, mut growth) = (DMat3::ZERO, DVec3::ZERO);
        for other in nearest {
            let way = (points[other] - points[index]) / around.spacing;
            squares += DMat3::from_cols(way * way.x, way * way.y, way * way.z);
            growth += way * (self.value(other) - self.value(index));
        }
        // Points in a plane have no gradient across it.
        let trace = squares.x_axis.x + squares.y_axis.y + squares.z_axis.z;
        if squares.determinant() <= FLAT * trace.powi(3) {
            return DVec3::ZERO;
        }
        let gradient = squares.inverse() * growth / around.spacing;
        if gradient.is_finite() {
            gradient
        } else {
            DVec3::ZERO
        }
    }

    /// Gradient of a grid next to NaN samples, which are replaced by the sample itself.
    fn one_sided_gradient(&self, index: usize, neighbours: [Option<[usize; 2]>; 3]) -> DVec3 {
        let known = |to: usize| if self.value(to).is_nan() { index } else { to };
        let ends = neighbours.map(|ends| {
            ends.map(|ends| ends.map(known))
                .filter(|[low, high]| low != high)
        });
        let steps =
            ends.map(|ends| ends.map(|[low, high]| self.position(high) - self.position(low)));
        let growth =
            ends.map(|ends| ends.map_or(0.0, |[low, high]| self.value(high) - self.value(low)));
        Cell::new(completed(
            steps,
            neighbours::lone_radius(self.position(index)),
        ))
        .gradient(DVec3::from_array(growth))
    }

    fn count(&self) -> usize {
        self.field.values.len()
    }

    /// Median of the samples' shortest steps; None if no sample has a cell.
    pub fn default_layer(&self) -> Option<f64> {
        let shortest = |index| {
            Some(self.cell(index))
                .filter(Cell::has_volume)
                .map(|cell| cell.lengths.min_element())
        };
        neighbours::median(
            (0..self.count())
                .into_par_iter()
                .filter_map(shortest)
                .collect(),
        )
    }

    /// Every visible sample, and the number of samples that are left out only because their cell
    /// has no volume. A layer is `layer` world units thick.
    pub fn samples(&self, classification: &Classification, layer: f64) -> (Sampled, usize) {
        let sample = |index: usize| {
            let (rgb, depth) = classification.colour(self.value(index));
            if depth <= 0.0 {
                return None;
            }
            let cell = self.cell(index);
            if !cell.has_volume() {
                return Some(None);
            }
            let gradient = self.gradient(index, &cell);
            let depth = depth * classification.factor(gradient.length());
            let (longest, sigma) = (
                cell.lengths.max_element(),
                self.radius * cell.lengths.max_element(),
            );
            // Optical depth of a layer relative to that through a ball of radius σ.
            let through = cell.volume() / (layer * TAU * sigma * sigma);
            let splat = Splat {
                position: self.position(index),
                normal: super::unit(gradient).unwrap_or(DVec3::ZERO),
                radius: sigma,
                rgb,
                opacity: depth * through,
                material: classification.material,
            };
            let scales = (cell.lengths / longest).max(DVec3::splat(THINNEST));
            let orientation = Orientation {
                rotation: DQuat::from_mat3(&cell.axes),
                scales,
            };
            (depth > 0.0).then_some(Some((splat, orientation, index)))
        };
        let found: Vec<_> = (0..self.count())
            .into_par_iter()
            .filter_map(sample)
            .collect();
        let flat = found.iter().filter(|sample| sample.is_none()).count();
        let (mut splats, mut orientations, mut at) = (Vec::new(), Vec::new(), Vec::new());
        for (splat, orientation, index) in found.into_iter().flatten() {
            splats.push(splat);
            orientations.push(orientation);
            at.push(self.at(index).map(|index| index as u32));
        }
        let slices = match &self.field.places {
            SamplePlaces::Rectilinear(coordinates) => Some(Slices {
                at,
                coordinates: coordinates.clone(),
                place: Placement::NONE,
            }),
            _ => None,
        };
        (
            Sampled {
                splats,
                orientations,
                slices,
            },
            flat,
        )
    }
}

impl Slices {
    /// Moves the grid to another place.
    pub fn put(&mut self, place: &Placement) {
        self.place = place.after(&self.place);
    }

    /// Sorts the splats for a view: slice by slice along the axis nearest to the view direction, as
    /// for a volume. Returns their numbers and the sheet of each in that order.
    pub fn ordered(&self, view: &View, back_to_front: bool) -> (Vec<u32>, Vec<u32>) {
        let back = self.place.turn.conjugate();
        let (forward, eye) = (
            back * view.rotation.row(2),
            back * (view.eye - self.place.way) / self.place.scale,
        );
        let axis = (0..3)
            .max_by(|a, b| forward[*a].abs().total_cmp(&forward[*b].abs()))
            .unwrap_or(0);
        let along = &self.coordinates[axis];
        let rank = ranks(
            along.len() as u32,
            |slice| (along[slice as usize] - eye[axis]).abs(),
            back_to_front,
        );
        let mut order: Vec<u32> = (0..self.at.len() as u32).collect();
        let rank_of = |splat: &u32| rank[self.at[*splat as usize][axis] as usize];
        order.sort_by_key(rank_of);
        let numbers = order.iter().map(rank_of).collect();
        (order, numbers)
    }
}

#[cfg(test)]
mod tests;

//! GlTF: reads Gaussians from glTF 2.0 with the extension `KHR_gaussian_splatting` (Khronos, kernel
//! `ellipse`).
//! ```text
//! POSITION, ROTATION (x y z w), SCALE (linear), OPACITY, SH_DEGREE_l_COEF_n ─► transform of the node ─► half a turn about x ─► Gaussians
//! ```
//! - Numbers may be of any type that the extension allows; integers are scaled if the file says so.
//! - Axes are right, up, back, as in `.spz`, and rotated in the same way.
//! - A node may rotate, move and scale. Nodes that shear or mirror are refused, because harmonics
//!   cannot follow.
//! - Harmonics follow the rotation exactly: their products with rotated ones are integrated over a
//!   sphere ([`Turned`]).

use super::{Gaussian, Gaussians, Intake, Parsed, coefficients, harmonics};
use crate::scene::cells::principal_axes;
use crate::scene::gltf::{File, Own};
use ::gltf::Semantic;
use ::gltf::accessor::Dimensions;
use glam::{DMat3, DMat4, DQuat, DVec3};
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// Tolerance for right angles: cosine between two columns of a transform.
const SKEW: f64 = 1e-4;
/// Under a scaling node, axes thinner than this part of the thickest get this thickness.
const THINNEST: f64 = 1e-9;

/// Reads the bytes of a glTF or GLB file and the files that it names.
pub(in crate::scene) fn parse(bytes: &[u8], folder: &Path) -> Parsed<Gaussians> {
    let file = File::parse(bytes, folder)?;
    let mut notes = file.notes.clone();
    let (mut sets, mut others) = (Vec::new(), 0);
    for (node, transform) in file.nodes()? {
        let Some(mesh) = node.mesh() else { continue };
        for primitive in mesh.primitives() {
            match file.own(mesh.index(), primitive.index()) {
                Some(own) if file.is_gaussians(mesh.index(), primitive.index()) => {
                    sets.push(
                        GaussianSet::read(&file, &primitive, own, transform)
                            .map_err(|e| format!("node {}: {e}", node.index()))?,
                    );
                }
                _ => others += 1,
            }
        }
    }
    if sets.is_empty() {
        return Err(
            "holds no Gaussians (KHR_gaussian_splatting); `splatsim sample` makes points from a mesh"
                .into(),
        );
    }
    if others > 0 {
        notes.push(format!(
            "{others} sets of triangles, lines or points are not Gaussians and were left out"
        ));
    }
    let degree = sets.iter().map(|set| set.degree).max().unwrap_or(0);
    let count = sets.iter().map(|set| set.positions.len()).sum();
    let mut intake = Intake::new(degree, count, Vec::new());
    for set in &sets {
        notes.extend(
            set.notes
                .iter()
                .filter(|note| !notes.contains(note))
                .cloned()
                .collect::<Vec<_>>(),
        );
        set.give(degree, &mut intake);
    }
    intake.gaussians.notes = notes;
    intake.finish()
}

/// Gaussians of one primitive under one node.
struct GaussianSet {
    positions: Vec<[f64; 3]>,
    rotations: Vec<[f64; 4]>,
    scales: Vec<[f64; 3]>,
    opacities: Vec<[f64; 1]>,
    /// For each coefficient the rows of all Gaussians.
    harmonics: Vec<Vec<[f64; 3]>>,
    degree: usize,
    place: NodeTransform,
    notes: Vec<String>,
}

/// A node's transform after half a turn about x.
struct NodeTransform {
    all: DMat4,
    linear: DMat3,
    /// Its scale, if it is the same along all axes.
    scale: Option<f64>,
    turn: DQuat,
}

impl NodeTransform {
    fn of(transform: DMat4) -> Parsed<NodeTransform> {
        let all = DMat4::from_rotation_x(PI) * transform;
        let linear = DMat3::from_mat4(all);
        let columns = [linear.x_axis, linear.y_axis, linear.z_axis];
        let lengths = columns.map(DVec3::length);
        let [x, y, z] = [0, 1, 2].map(|i| columns[i] / lengths[i]);
        let skew = x.dot(y).abs().max(y.dot(z).abs()).max(z.dot(x).abs());
        // A skew of NaN is refused too.
        let is_turn = skew <= SKEW && x.cross(y).dot(z) > 0.0;
        if !is_turn || !all.is_finite() {
            return Err("its transform shears, mirrors or flattens; Gaussians can be turned, moved and scaled".into());
        }
        let longest = lengths.into_iter().fold(0.0, f64::max);
        let is_even = lengths
            .iter()
            .all(|length| (longest - length) <= 1e-6 * longest);
        Ok(NodeTransform {
            all,
            linear,
            scale: is_even.then_some(longest),
            turn: DQuat::from_mat3(&DMat3::from_cols(x, y, z)).normalize(),
        })
    }

    /// Rotation and scales of a transformed Gaussian.
    fn axes(&self, rotation: DQuat, scale: DVec3) -> (DQuat, DVec3) {
        if let Some(factor) = self.scale {
            return (self.turn * rotation, scale * factor);
        }
        let scale = scale.max(DVec3::splat(scale.max_element() * THINNEST));
        let (axes, lengths) =
            principal_axes(self.linear * DMat3::from_quat(rotation) * DMat3::from_diagonal(scale));
        (DQuat::from_mat3(&axes), lengths)
    }
}

impl GaussianSet {
    fn read(
        file: &File,
        primitive: &::gltf::Primitive,
        own: &Own,
        transform: DMat4,
    ) -> Parsed<GaussianSet> {
        let positions = primitive
            .get(&Semantic::Positions)
            .filter(|accessor| accessor.dimensions() == Dimensions::Vec3);
        let positions = positions.ok_or("Gaussians have no positions")?;
        let count = positions.count();
        let need = |name: &str| {
            own.of_gaussians(name)
                .ok_or_else(|| format!("Gaussians have no attribute KHR_gaussian_splatting:{name}"))
        };
        let mut all = Vec::new();
        let mut degree = 0;
        for l in 0..=3 {
            let names = (0..2 * l + 1).map(|n| format!("SH_DEGREE_{l}_COEF_{n}"));
            let places: Vec<Option<usize>> = names.map(|name| own.of_gaussians(&name)).collect();
            if l > 0 && places.iter().all(Option::is_none) {
                break;
            }
            for (n, place) in places.iter().enumerate() {
                let place = place.map_or_else(|| need(&format!("SH_DEGREE_{l}_COEF_{n}")), Ok)?;
                all.push(file.numbered(place, count, Dimensions::Vec3)?);
            }
            degree = l;
        }
        Ok(GaussianSet {
            positions: file.rows(&positions)?,
            rotations: file.numbered(need("ROTATION")?, count, Dimensions::Vec4)?,
            scales: file.numbered(need("SCALE")?, count, Dimensions::Vec3)?,
            opacities: file.numbered(need("OPACITY")?, count, Dimensions::Scalar)?,
            harmonics: all,
            degree,
            place: NodeTransform::of(transform)?,
            notes: notes(own),
        })
    }

    /// Passes all Gaussians on, with harmonics of this degree.
    fn give(&self, degree: usize, intake: &mut Intake) {
        let turned = Turned::by(self.place.turn, self.degree);
        let clamped = |opacity: f64| {
            if opacity.is_nan() {
                opacity
            } else {
                opacity.clamp(0.0, 1.0)
            }
        };
        for i in 0..self.positions.len() {
            let rotation = super::unit(DQuat::from_array(self.rotations[i]));
            let scale = DVec3::from_array(self.scales[i]);
            // Gaussians without rotation or scale are left out and counted.
            let (rotation, scale) =
                match rotation.filter(|_| scale.is_finite() && scale.min_element() >= 0.0) {
                    Some(rotation) if scale.max_element() > 0.0 => self.place.axes(rotation, scale),
                    Some(rotation) => (rotation, scale),
                    None => (DQuat::from_array(self.rotations[i]), scale),
                };
            let raw = Gaussian {
                position: self
                    .place
                    .all
                    .transform_point3(DVec3::from_array(self.positions[i])),
                rotation,
                scale,
                opacity: clamped(self.opacities[i][0]),
            };
            let own: Vec<[f64; 3]> = self.harmonics.iter().map(|rows| rows[i]).collect();
            let none = std::iter::repeat_n([0.0; 3], coefficients(degree) - own.len());
            let all = turned.of(&own).into_iter().chain(none);
            intake.push(raw, all.map(|rgb| rgb.map(|c| c as f32)));
        }
    }
}

/// Notes on properties of the extension that are not drawn.
fn notes(own: &Own) -> Vec<String> {
    let property = |field: &str| {
        own.gaussians
            .as_ref()
            .and_then(|object| object.get(field)?.as_str())
    };
    let mut notes = Vec::new();
    if property("colorSpace").is_some_and(|space| space != "srgb_rec709_display") {
        let space = crate::output::text::clipped(property("colorSpace").unwrap_or_default());
        notes.push(format!("has the colour space {space}; its colours are blended as they are, and PNGs hold them unchanged"));
    }
    for (field, read) in [
        ("kernel", "ellipse"),
        ("projection", "perspective"),
        ("sortingMethod", "cameraDistance"),
    ] {
        if let Some(other) = property(field).filter(|value| *value != read) {
            notes.push(format!(
                "has the {field} {}, which is not read; it is drawn as {read}",
                crate::output::text::clipped(other)
            ));
        }
    }
    notes
}

/// Rotation of harmonics, as sums over the original ones: `matrix[j][k]` is the mean of
/// 4π·Y_j(d)·Y_k(R⁻¹d) over all directions d.
struct Turned {
    matrix: Vec<Vec<f64>>,
}

/// Heights of the rows of directions, and directions per row: with Gauss's four heights, products
/// of two harmonics of degree 3 are integrated exactly.
const HEIGHTS: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
    (-0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
];
const AROUND: usize = 8;

impl Turned {
    fn by(turn: DQuat, degree: usize) -> Turned {
        let count = coefficients(degree);
        let mut matrix = vec![vec![0.0; count]; count];
        for (height, weight) in HEIGHTS {
            for step in 0..AROUND {
                let (sin, cos) = libm::sincos(TAU * step as f64 / AROUND as f64);
                let ring = (1.0 - height * height).sqrt();
                let direction = DVec3::new(ring * cos, ring * sin, height);
                let (here, before) = (
                    harmonics::basis(direction),
                    harmonics::basis(turn.conjugate() * direction),
                );
                let area = weight * TAU / AROUND as f64;
                for (j, row) in matrix.iter_mut().enumerate() {
                    row.iter_mut()
                        .enumerate()
                        .for_each(|(k, sum)| *sum += area * here[j] * before[k]);
                }
            }
        }
        Turned { matrix }
    }

    fn of(&self, coefficients: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let sum = |row: &Vec<f64>, channel: usize| {
            row.iter()
                .zip(coefficients)
                .map(|(factor, rgb)| factor * rgb[channel])
                .sum()
        };
        self.matrix
            .iter()
            .map(|row| [0, 1, 2].map(|channel| sum(row, channel)))
            .collect()
    }
}

//! Gaussians: reads trained 3D Gaussians from a file and applies their activations.
//! ```text
//! .ply, floats          log scale, logit opacity ─► [float_ply]  ─┐
//! .ply, SuperSplat's    chunks of 256, 16 bytes each ─► [packed_ply] ─┤
//! .splat                32 bytes each ───────────────► [splat]     ─┼─► [Intake] ─► Gaussians
//! .spz                  packed, up to 65 bytes each ─► [spz]       ─┤
//! .gltf, .glb           one accessor per parameter ─► [gltf]      ─┘
//! ```
//! - Axes are as in the file: right, down, forward as for cameras in files of training programs and
//!   in `.splat`; right, up, back in `.spz` and glTF, which are rotated by half a turn about x
//!   (`three_formats_of_the_same_three_gaussians_agree`).
//! - Gaussians that cannot be drawn are left out and counted in a note: see `FLAWS`.
//! - Memory is reserved only up to what the file's length supports.

mod bouquet;
mod city;
mod float_ply;
pub(super) mod gltf;
mod harmonics;
mod packed_ply;
pub(super) mod splat;
pub(super) mod spz;

pub use bouquet::bouquet;
pub use city::city;
pub use harmonics::{MachineHarmonics, colour};

use super::ply;
use glam::{DQuat, DVec3, DVec4};

type Parsed<T> = Result<T, String>;

/// One trained Gaussian with its activations applied. Its colour is in [`Gaussians::harmonics`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    /// Centre, world units.
    pub position: DVec3,
    /// Unit quaternion; the columns of its matrix are the Gaussian's axes.
    pub rotation: DQuat,
    /// Standard deviations along the axes, world units, in [[`SMALLEST_SCALE`], 1e30].
    pub scale: DVec3,
    /// α in [0, 1].
    pub opacity: f64,
}

/// Gaussians of a file.
#[derive(Clone, Debug, Default)]
pub struct Gaussians {
    /// In the file's order; never empty.
    pub all: Vec<Gaussian>,
    /// Degree of the spherical harmonics, 0 to 3.
    pub degree: usize,
    /// The file states that its opacities are compensated for the low-pass filter (Yu et al. 2024,
    /// Mip-Splatting).
    pub compensated: bool,
    /// Notes on omissions and oddities, one sentence each.
    pub notes: Vec<String>,
    /// `(degree + 1)²` coefficients for each Gaussian in turn, as f32, which is the precision of
    /// all formats.
    harmonics: Vec<[f32; 3]>,
}

/// Thinner Gaussians get this thickness; squares and products of scales then fit f64.
pub const SMALLEST_SCALE: f64 = super::LEAST_RADIUS;

impl Gaussians {
    /// All coefficients, and their degree; `None` where colours are the same from all directions.
    pub(super) fn into_harmonics(self) -> Option<(u8, Vec<[f32; 3]>)> {
        (self.degree > 0).then_some((self.degree as u8, self.harmonics))
    }

    /// Coefficients of red, green and blue of a Gaussian, for [`colour`]: 1, 4, 9 or 16 by degree.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn harmonics(&self, index: usize) -> &[[f32; 3]] {
        let each = coefficients(self.degree);
        &self.harmonics[index * each..][..each]
    }
}

/// Whether the bytes are a PLY file of trained Gaussians, by its header; [`parse_ply`] reads those.
pub(super) fn is_trained_ply(bytes: &[u8]) -> bool {
    ply::read_header(bytes)
        .is_ok_and(|(header, _)| packed_ply::is_packed(&header) || float_ply::is_trained(&header))
}

/// Reads a PLY file of trained Gaussians.
pub(super) fn parse_ply(bytes: &[u8]) -> Parsed<Gaussians> {
    let (header, body) = ply::read_header(bytes)?;
    let parsed = if packed_ply::is_packed(&header) {
        packed_ply::parse(&header, body)
    } else {
        float_ply::parse(&header, body)
    };
    let compensated = header
        .comments
        .iter()
        .any(|comment| requests_compensation(comment));
    parsed.map(|gaussians| Gaussians {
        compensated,
        ..gaussians
    })
}

/// Whether a comment is `SplatRenderMode: mip`, in any case, with or without the blank.
fn requests_compensation(comment: &str) -> bool {
    let (name, mode) = comment.split_once(':').unwrap_or_default();
    name.trim().eq_ignore_ascii_case("SplatRenderMode") && mode.trim().eq_ignore_ascii_case("mip")
}

/// Coefficients per channel.
fn coefficients(degree: usize) -> usize {
    (degree + 1) * (degree + 1)
}

/// Why a Gaussian is left out, as in the note.
const FLAWS: [&str; 5] = [
    "no finite position",
    "a rotation that is zero or not finite",
    "a scale that is negative or not finite",
    "an opacity that is NaN",
    "a colour that is not finite",
];

/// Collects Gaussians, and leaves out those that cannot be drawn.
struct Intake {
    gaussians: Gaussians,
    count: usize,
    left_out: [usize; FLAWS.len()],
}

impl Intake {
    /// Reserves memory up to what the file's length supports.
    fn new(degree: usize, room: usize, notes: Vec<String>) -> Self {
        let harmonics = Vec::with_capacity(room.saturating_mul(coefficients(degree)));
        Intake {
            gaussians: Gaussians {
                all: Vec::with_capacity(room),
                degree,
                compensated: false,
                notes,
                harmonics,
            },
            count: 0,
            left_out: [0; FLAWS.len()],
        }
    }

    /// Adds a Gaussian, whose rotation may have any length, with its `(degree + 1)²` coefficients.
    fn push(&mut self, raw: Gaussian, harmonics: impl IntoIterator<Item = [f32; 3]>) {
        let Gaussians {
            all,
            harmonics: store,
            ..
        } = &mut self.gaussians;
        let before = store.len();
        store.extend(harmonics);
        let rotation = unit(raw.rotation);
        let flaws = [
            !raw.position
                .to_array()
                .iter()
                .all(|c| c.abs() <= ply::FARTHEST),
            rotation.is_none(),
            !raw.scale
                .to_array()
                .iter()
                .all(|s| (0.0..=ply::FARTHEST).contains(s)),
            raw.opacity.is_nan(),
            !store[before..].as_flattened().iter().all(|c| c.is_finite()),
        ];
        self.count += 1;
        match flaws.iter().position(|&flawed| flawed) {
            Some(flaw) => {
                self.left_out[flaw] += 1;
                store.truncate(before);
            }
            None => all.push(Gaussian {
                rotation: rotation.unwrap_or_default(),
                scale: raw.scale.max(DVec3::splat(SMALLEST_SCALE)),
                ..raw
            }),
        }
    }

    fn finish(mut self) -> Parsed<Gaussians> {
        let count = self.count;
        let left_out = self
            .left_out
            .iter()
            .zip(FLAWS)
            .filter(|(number, _)| **number > 0);
        let notes: Vec<String> = left_out
            .map(|(number, flaw)| {
                format!("{number} of {count} Gaussians have {flaw} and were left out")
            })
            .collect();
        if count == 0 {
            return Err("holds no Gaussians".into());
        }
        if self.gaussians.all.is_empty() {
            return Err(format!(
                "holds no Gaussian that can be drawn: {}",
                notes.join("; ")
            ));
        }
        self.gaussians.notes.extend(notes);
        Ok(self.gaussians)
    }
}

/// The unit quaternion; None if the quaternion is zero or not finite.
fn unit(rotation: DQuat) -> Option<DQuat> {
    let longest = DVec4::from(rotation).abs().max_element();
    // Divided first: squares of very long or very short quaternions do not fit f64.
    (rotation.is_finite() && longest > 0.0).then(|| (rotation * (1.0 / longest)).normalize())
}

/// Opacity of a logit: 1 / (1 + e^−logit); ±∞ give 1 and 0.
fn sigmoid(logit: f64) -> f64 {
    1.0 / (1.0 + libm::exp(-logit))
}

/// Scales from the logarithms in a file.
fn exp(log_scale: DVec3) -> DVec3 {
    log_scale.map(libm::exp)
}

/// A byte as a part of 255.
fn part(code: u8) -> f64 {
    f64::from(code) / 255.0
}

/// The constant coefficients of a colour that is the same from all directions.
fn harmonics_of(rgb: [f64; 3]) -> [f32; 3] {
    rgb.map(|c| ((c - 0.5) / harmonics::CONSTANT) as f32)
}

#[cfg(test)]
mod tests;

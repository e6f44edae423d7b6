//! Harmonics: computes a Gaussian's colour from its coefficients and the view direction, with the
//! usual conventions.
//!
//! Real spherical harmonics of degree 0 to 3 with the Condon-Shortley phase, in the order of
//! degree, then of order −l to l (Kerbl et al. 2023, `eval_sh` of their program).

use glam::{DQuat, DVec3};
use std::f64::consts::TAU;

/// `√(1/4π)`: the constant harmonic.
pub(super) const CONSTANT: f64 = 0.282_094_791_773_878_14;

/// Colour seen along `direction` (unit, from the eye to the Gaussian's centre): `0.5 + Σ
/// coefficient · harmonic`, at least 0. `harmonics` has 1, 4, 9 or 16 coefficients of red, green
/// and blue.
pub fn colour(harmonics: &[[f32; 3]], direction: DVec3) -> [f64; 3] {
    let basis = basis(direction);
    std::array::from_fn(|channel| {
        let sum: f64 = harmonics
            .iter()
            .zip(basis)
            .map(|(rgb, harmonic)| f64::from(rgb[channel]) * harmonic)
            .sum();
        (0.5 + sum).max(0.0)
    })
}

/// The 16 harmonics of degree 0 to 3.
pub(super) fn basis(DVec3 { x, y, z }: DVec3) -> [f64; 16] {
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        CONSTANT,
        -0.488_602_511_902_919_9 * y,
        0.488_602_511_902_919_9 * z,
        -0.488_602_511_902_919_9 * x,
        1.092_548_430_592_079_2 * x * y,
        -1.092_548_430_592_079_2 * y * z,
        0.315_391_565_252_520_05 * (2.0 * zz - xx - yy),
        -1.092_548_430_592_079_2 * x * z,
        0.546_274_215_296_039_6 * (xx - yy),
        -0.590_043_589_926_643_5 * y * (3.0 * xx - yy),
        2.890_611_442_640_554 * x * y * z,
        -0.457_045_799_464_465_8 * y * (4.0 * zz - xx - yy),
        0.373_176_332_590_115_4 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -0.457_045_799_464_465_8 * x * (4.0 * zz - xx - yy),
        1.445_305_721_320_277 * z * (xx - yy),
        -0.590_043_589_926_643_5 * x * (xx - 3.0 * yy),
    ]
}

/// Coefficients of all degrees from 1 on for the Gaussian of a number in a built-in scene: colours
/// that change with the direction, less in higher degrees.
pub(super) fn sheen(number: usize, degree: u8) -> impl Iterator<Item = [f32; 3]> {
    /// No two places are close.
    const GOLDEN: f64 = 0.618_033_988_749_895;
    (1..=usize::from(degree)).flat_map(move |l| {
        (0..2 * l + 1).map(move |order| {
            let turn = (number as f64 * GOLDEN * (l * l + order) as f64).fract();
            let most = 0.3 / (l * l) as f64;
            [0.0, 0.07, 0.14].map(|hue| (most * libm::cos(TAU * (turn + hue))) as f32)
        })
    })
}

/// Constants of the 16 polynomials of [`basis`]: a machine evaluates the polynomials alone, with
/// coefficients that contain these.
const CONSTANTS: [f64; 16] = [
    CONSTANT,
    -0.488_602_511_902_919_9,
    0.488_602_511_902_919_9,
    -0.488_602_511_902_919_9,
    1.092_548_430_592_079_2,
    -1.092_548_430_592_079_2,
    0.315_391_565_252_520_05,
    -1.092_548_430_592_079_2,
    0.546_274_215_296_039_6,
    -0.590_043_589_926_643_5,
    2.890_611_442_640_554,
    -0.457_045_799_464_465_8,
    0.373_176_332_590_115_4,
    -0.457_045_799_464_465_8,
    1.445_305_721_320_277,
    -0.590_043_589_926_643_5,
];

/// Converts coefficients into those of a machine: for directions in the world, and each times the
/// constant of its polynomial.
#[derive(Clone, Debug, PartialEq)]
pub struct MachineHarmonics {
    count: usize,
    /// Rows for the coefficients in the world, where the axes of the harmonics are others.
    matrix: Option<Box<[[f64; 16]; 16]>>,
}

impl MachineHarmonics {
    /// Of harmonics of a degree from 0 to 3 whose axes are turned by `turn` in the world.
    pub fn new(degree: u8, turn: DQuat) -> Self {
        MachineHarmonics {
            count: (usize::from(degree) + 1).pow(2),
            matrix: (turn != DQuat::IDENTITY).then(|| Box::new(turning(turn))),
        }
    }

    /// The coefficients of one splat.
    ///
    /// # Panics
    /// If there are fewer coefficients than the degree has.
    pub fn of(&self, given: &[[f32; 3]]) -> impl Iterator<Item = [f64; 3]> {
        (0..self.count).map(move |nth| {
            [0, 1, 2].map(|channel| {
                let turned = match &self.matrix {
                    None => f64::from(given[nth][channel]),
                    Some(matrix) => (matrix[nth].iter().zip(given))
                        .map(|(part, from)| part * f64::from(from[channel]))
                        .sum(),
                };
                turned * CONSTANTS[nth]
            })
        })
    }
}

/// Coefficients in the world from coefficients in turned axes: `M_jk = ∫ Y_j(d) Y_k(turn⁻¹ d) dΩ`,
/// because harmonics are orthonormal.
///
/// The integrand has degree 6: four Gauss-Legendre nodes in z and eight azimuths integrate it
/// exactly.
fn turning(turn: DQuat) -> [[f64; 16]; 16] {
    const NODES: [[f64; 2]; 4] = [
        [-0.861_136_311_594_052_6, 0.347_854_845_137_453_85],
        [-0.339_981_043_584_856_26, 0.652_145_154_862_546_1],
        [0.339_981_043_584_856_26, 0.652_145_154_862_546_1],
        [0.861_136_311_594_052_6, 0.347_854_845_137_453_85],
    ];
    const AZIMUTHS: u32 = 8;
    let mut matrix = [[0.0; 16]; 16];
    for [z, weight] in NODES {
        let radius = (1.0 - z * z).sqrt();
        for nth in 0..AZIMUTHS {
            let azimuth = TAU * f64::from(nth) / f64::from(AZIMUTHS);
            let direction = DVec3::new(radius * libm::cos(azimuth), radius * libm::sin(azimuth), z);
            let (here, there) = (basis(direction), basis(turn.conjugate() * direction));
            for (row, own) in matrix.iter_mut().zip(here) {
                for (sum, other) in row.iter_mut().zip(there) {
                    *sum += own * other * weight * TAU / f64::from(AZIMUTHS);
                }
            }
        }
    }
    matrix
}

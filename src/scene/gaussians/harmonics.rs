//! Harmonics: computes a Gaussian's colour from its coefficients and the view direction, with the
//! usual conventions.
//!
//! Real spherical harmonics of degree 0 to 3 with the Condon-Shortley phase, in the order of
//! degree, then of order −l to l (Kerbl et al. 2023, `eval_sh` of their program).

use glam::DVec3;

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

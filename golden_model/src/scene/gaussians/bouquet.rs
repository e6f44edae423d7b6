//! Bouquet: generates flowers of Gaussians from formulas: flat petals, thin stems, and a haze
//! behind them.

use super::harmonics::sheen;
use super::{Gaussian, Gaussians, Intake, harmonics_of};
use glam::{DMat3, DQuat, DVec3};
use libm::{cos, sin};
use std::f64::consts::{PI, TAU};

/// Stalks, each with a blossom.
const STALKS: usize = 13;
/// Petals of a blossom.
const PETALS: usize = 8;
/// Of sixteen Gaussians, this many are stalk and this many haze; the rest are petals.
const STALK_SHARE: usize = 4;
const HAZE_SHARE: usize = 1;
/// Rotation from one place to the next, as a part of a circle: no two come close.
const GOLDEN: f64 = 0.618_033_988_749_895;

/// A bouquet of `count` Gaussians, whose colours are harmonics of a degree from 0 to 3.
pub fn bouquet(count: usize, degree: u8) -> Gaussians {
    let mut intake = Intake::new(degree.into(), count, Vec::new());
    for i in 0..count {
        let (turn, of) = (i % 16, i / 16);
        let (gaussian, rgb) = match turn {
            _ if turn < HAZE_SHARE => haze(of),
            _ if turn < HAZE_SHARE + STALK_SHARE => stalk(of * STALK_SHARE + turn, count),
            _ => petal(of * 16 + turn, count),
        };
        let constant = std::iter::once(harmonics_of(rgb));
        intake.push(gaussian, constant.chain(sheen(i, degree)));
    }
    intake.gaussians
}

/// Fractional part of a multiple of `step`.
fn part(number: usize, step: f64) -> f64 {
    (number as f64 * step).fract()
}

/// A point on a stalk, from the ground (0) to its blossom (1).
fn along(stalk: usize, height: f64) -> DVec3 {
    let turn = TAU * part(stalk, GOLDEN);
    let out = 0.15 + 0.75 * (stalk as f64 / STALKS as f64).sqrt();
    let lean = out * (0.25 + 0.75 * height * height);
    DVec3::new(
        lean * cos(turn),
        (1.7 - 0.5 * out) * height - 0.9,
        lean * sin(turn),
    )
}

/// The rotation whose third axis is this direction.
fn facing(direction: DVec3) -> DQuat {
    DQuat::from_rotation_arc(DVec3::Z, direction.normalize())
}

fn stalk(i: usize, count: usize) -> (Gaussian, [f64; 3]) {
    let stalk = i % STALKS;
    let height = part(i, GOLDEN * GOLDEN);
    let [below, here, above] = [-0.01, 0.0, 0.01].map(|by| along(stalk, 0.93 * height + by));
    let length = 0.6 / (count as f64 / 1000.0).max(1.0).sqrt();
    let scale = DVec3::new(0.012, 0.012, length.clamp(0.02, 0.2));
    let shade = 0.25 + 0.3 * height;
    (
        Gaussian {
            position: here,
            rotation: facing(above - below),
            scale,
            opacity: 0.85,
        },
        [0.1, shade, 0.12],
    )
}

fn petal(i: usize, count: usize) -> (Gaussian, [f64; 3]) {
    let (stalk, petal) = (i % STALKS, (i / STALKS) % PETALS);
    let centre = along(stalk, 1.0);
    let up = (centre - along(stalk, 0.97)).normalize();
    let side = up.any_orthonormal_vector();
    let out = part(i, GOLDEN * GOLDEN * 7.0).sqrt();
    // Petals are widest at two thirds of their length.
    let wide = 0.85 * sin(PI * out.powi(2)).max(0.15);
    let turn = TAU * (petal as f64 + wide * (part(i, GOLDEN) - 0.5)) / PETALS as f64;
    let radial = side * cos(turn) + up.cross(side) * sin(turn);
    let size = 0.22 + 0.1 * part(stalk, GOLDEN * 3.0);
    let position = centre + radial * (size * out) + up * (0.12 * size * sin(PI * out) + 0.02);
    let normal = (up + radial * (0.6 * cos(PI * out))).normalize();
    let along = (radial - normal * radial.dot(normal)).normalize();
    let rotation = DQuat::from_mat3(&DMat3::from_cols(along, normal.cross(along), normal));
    let coarse = 1.0 / (count as f64 / 16_000.0).max(0.05).cbrt();
    let scale = DVec3::new(0.02, 0.008, 0.0015) * coarse;
    let hue = TAU * part(stalk, GOLDEN);
    let tint = [hue, hue - TAU / 3.0, hue + TAU / 3.0].map(|phase| 0.55 + 0.42 * cos(phase));
    let rgb =
        tint.map(|channel| channel * (0.45 + 0.55 * out) + if out < 0.25 { 0.35 } else { 0.0 });
    (
        Gaussian {
            position,
            rotation,
            scale,
            opacity: 0.3 + 0.5 * out,
        },
        rgb,
    )
}

fn haze(i: usize) -> (Gaussian, [f64; 3]) {
    let turn = TAU * part(i, GOLDEN);
    let out = 0.3 + 1.2 * part(i, GOLDEN * GOLDEN);
    let position = DVec3::new(
        out * cos(turn),
        0.5 * part(i, GOLDEN * 5.0) - 0.9,
        out * sin(turn),
    );
    let scale = DVec3::new(0.25, 0.05, 0.25);
    (
        Gaussian {
            position,
            rotation: DQuat::IDENTITY,
            scale,
            opacity: 0.02,
        },
        [0.75, 0.8, 0.9],
    )
}

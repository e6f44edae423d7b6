//! City: generates a street between houses and trees with the statistics of trained scenes.
//!
//! | statistic | trained scenes, as published | here |
//! |---|---|---|
//! | projected Gaussians whose axes have a ratio below 3 | 43 % | 43 % of those in front of the default camera, without the low-pass filter |
//! | entries of a tile of 16×16 pixels at 1920×1080 | 0 to 2,500 | 0 to 600 with 300,000 Gaussians, 0 to 2,200 with 2 million |
//!
//! As in a trained scene, Gaussians are dense and small where a camera is near: their sizes grow with
//! the distance from the default camera, and as many are within any octave of distances.
//!
//! Laws: `axes_have_the_published_ratios`, `lists_are_as_long_as_stated`.

use super::harmonics::sheen;
use super::{Gaussian, Gaussians, Intake, harmonics_of};
use glam::{DMat3, DQuat, DVec3};
use libm::{cos, exp, log, sin, sqrt};
use std::f64::consts::{PI, TAU};

/// The default camera.
const EYE: DVec3 = DVec3::new(0.0, 0.3, 3.95);
/// Distances from the eye along the ground.
const NEAREST: f64 = 0.12;
const FARTHEST: f64 = 8.0;
/// Houses fill this part of a square of side 1, streets the rest.
const NEAR_WALL: f64 = 0.2;
const FAR_WALL: f64 = 0.8;
/// Radius of a tree's crown, and the height of its centre.
const CROWN: f64 = 0.07;
const CROWN_HEIGHT: f64 = 0.2;
/// Mean logarithm of the ratio of a Gaussian's longer axes.
const MEAN_LOG_RATIO: f64 = 1.55;
/// Greatest ratio.
const MOST_RATIO: f64 = 30.0;
/// Mean geometric size at distance 1, of one Gaussian.
const SIZE: f64 = 1.5;

/// What a Gaussian is a part of.
#[derive(Clone, Copy, PartialEq)]
enum Part {
    Wall,
    Ground,
    Tree,
    Cloud,
}

impl Part {
    fn of(number: f64) -> Part {
        match number {
            ..0.55 => Part::Wall,
            ..0.87 => Part::Ground,
            ..0.97 => Part::Tree,
            _ => Part::Cloud,
        }
    }
}

/// Random numbers in [0, 1) from a Gaussian's number (SplitMix64).
fn random(number: u64, nth: u64) -> f64 {
    let mut x = number
        .wrapping_mul(0x9e37_79b9_7f4a_7c15)
        .wrapping_add(nth.wrapping_mul(0xd1b5_4a32_d192_ed03));
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// A city of `count` Gaussians, whose colours are harmonics of a degree from 0 to 3.
pub fn city(count: usize, degree: u8) -> Gaussians {
    let mut intake = Intake::new(degree.into(), count, Vec::new());
    for number in 0..count {
        let (gaussian, rgb) = one(number as u64, count as f64);
        let constant = std::iter::once(harmonics_of(rgb));
        intake.push(gaussian, constant.chain(sheen(number, degree)));
    }
    intake.gaussians
}

fn one(number: u64, count: f64) -> (Gaussian, [f64; 3]) {
    let u = |nth| random(number, nth);
    let part = Part::of(u(0));
    let (away, turn) = (
        NEAREST * exp(u(1) * log(FARTHEST / NEAREST)),
        (u(2) - 0.5) * PI,
    );
    let ground = DVec3::new(EYE.x + away * sin(turn), 0.0, EYE.z - away * cos(turn));
    let corner = ground.floor();
    let (position, normal, rgb) = match part {
        Part::Wall => wall(corner, u(3) < 0.5, [u(4), u(5)]),
        Part::Ground => (ground, DVec3::Y, [0.25 + 0.1 * u(12); 3]),
        Part::Tree => {
            let (turn, up) = (TAU * u(4), 2.0 * u(5) - 1.0);
            let flat = sqrt(1.0 - up * up);
            let out = DVec3::new(flat * cos(turn), up, flat * sin(turn));
            let side = if ground.x - corner.x < 0.5 {
                0.13
            } else {
                0.87
            };
            let along = (4.0 * u(3)).floor() / 4.0 + 0.12;
            let centre = corner + DVec3::new(side, CROWN_HEIGHT, along);
            let green = 0.25 + 0.3 * u(12);
            let at = centre + out * CROWN * libm::cbrt(u(6));
            (at, out, [0.3 * green, green, 0.2 * green])
        }
        Part::Cloud => {
            let at = DVec3::new((u(3) - 0.5) * 30.0, 3.0 + 3.0 * u(4), -10.0 - 8.0 * u(5));
            (at, DVec3::Z, [0.92; 3])
        }
    };
    // A logarithmic normal distribution of sizes.
    let spread = sqrt(-2.0 * log(1.0 - u(9))) * cos(TAU * u(10));
    let size = SIZE * position.distance(EYE) / sqrt(count) * exp(0.6 * spread);
    let ratio = if part == Part::Cloud {
        1.5
    } else {
        exp(-MEAN_LOG_RATIO * log(1.0 - u(11))).min(MOST_RATIO)
    };
    let [long, short] = [size * sqrt(ratio), size / sqrt(ratio)];
    let thin = if part == Part::Tree {
        short
    } else {
        0.1 * short
    };
    // Most of what is on a wall or on the ground lies along its edges.
    let is_aligned = matches!(part, Part::Wall | Part::Ground) && u(8) < 0.6;
    let turn = if is_aligned { 0.0 } else { TAU * u(7) };
    let up = if normal.y.abs() > 0.9 {
        DVec3::X
    } else {
        DVec3::Y
    };
    let across = normal.cross(up).normalize();
    let first = across * cos(turn) + normal.cross(across) * sin(turn);
    let axes = DMat3::from_cols(first, normal.cross(first), normal);
    let opacity = match part {
        Part::Cloud => 0.3,
        Part::Tree => 0.2 + 0.7 * u(13),
        _ => 0.99 - 0.85 * u(13) * u(13),
    };
    let gaussian = Gaussian {
        position,
        rotation: DQuat::from_mat3(&axes),
        scale: DVec3::new(long, short, thin),
        opacity,
    };
    (gaussian, rgb)
}

/// A point of one of the two walls of a house that face the eye, with windows.
fn wall(corner: DVec3, is_across: bool, [along, up]: [f64; 2]) -> (DVec3, DVec3, [f64; 3]) {
    let house = ((corner.x + 64.0) * 1000.0 + corner.z + 64.0) as u64;
    let height = 0.35 + 1.3 * random(house, 77) * random(house, 77);
    let facing = |eye: f64, corner: f64| {
        if eye < corner + 0.5 {
            NEAR_WALL
        } else {
            FAR_WALL
        }
    };
    let reach = NEAR_WALL + (FAR_WALL - NEAR_WALL) * along;
    let ([x, z], normal) = if is_across {
        ([facing(EYE.x, corner.x), reach], DVec3::X)
    } else {
        ([reach, facing(EYE.z, corner.z)], DVec3::Z)
    };
    let height_here = up * height;
    let is_window = (along * 6.0).fract() > 0.45 && (height_here * 12.0).fract() > 0.5;
    let paint = [78, 79, 80].map(|nth| 0.45 + 0.4 * random(house, nth));
    let rgb = if is_window { [0.15, 0.2, 0.3] } else { paint };
    (corner + DVec3::new(x, height_here, z), normal, rgb)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From the default camera of the built-in scene, at 1920×1080: standard deviations along the
    /// axes of each projected Gaussian, without the low-pass filter, its box at three of them, and
    /// its place.
    fn projected(count: usize) -> Vec<([f64; 2], [f64; 2], [f64; 2])> {
        let (eye, target) = (EYE, DVec3::new(0.0, 0.32, 0.0));
        let forward = (target - eye).normalize();
        let right = forward.cross(DVec3::Y).normalize();
        let world = DMat3::from_cols(right, forward.cross(right), forward).transpose();
        let focal = 540.0 / 25f64.to_radians().tan();
        let one = |gaussian: &Gaussian| {
            let t = world * (gaussian.position - eye);
            let [a, b] = [t.x / t.z, t.y / t.z];
            let at = [960.0 + focal * a, 540.0 + focal * b];
            let outside = |at: f64, size: f64| !(-200.0..size + 200.0).contains(&at);
            if t.z <= 0.05 || outside(at[0], 1920.0) || outside(at[1], 1080.0) {
                return None;
            }
            let axes = world * DMat3::from_quat(gaussian.rotation);
            let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
            for (axis, scale) in [axes.x_axis, axes.y_axis, axes.z_axis]
                .into_iter()
                .zip(gaussian.scale.to_array())
            {
                let [x, y] =
                    [axis.x - a * axis.z, axis.y - b * axis.z].map(|c| c * scale * focal / t.z);
                (xx, xy, yy) = (xx + x * x, xy + x * y, yy + y * y);
            }
            let middle = (xx + yy) / 2.0;
            let half = (((xx - yy) / 2.0).powi(2) + xy * xy).sqrt();
            let box_of = [xx, yy].map(|v| 3.0 * (v + 0.3).sqrt());
            Some((
                [middle + half, (middle - half).max(1e-12)].map(f64::sqrt),
                box_of,
                at,
            ))
        };
        city(count, 0).all.iter().filter_map(one).collect()
    }

    #[test]
    fn axes_have_the_published_ratios() {
        let all = projected(60_000);
        let below = all
            .iter()
            .filter(|([long, short], ..)| long < &(3.0 * short))
            .count();
        let share = below as f64 / all.len() as f64;
        assert!((0.41..0.45).contains(&share), "{share} of {}", all.len());
    }

    #[test]
    fn lists_are_as_long_as_stated() {
        let mut entries = vec![0u32; 120 * 68];
        for (_, reach, at) in projected(300_000) {
            let tiles = |axis: usize, most: f64| {
                let [from, to] =
                    [-1.0, 1.0].map(|way| ((at[axis] + way * reach[axis]) / 16.0).floor());
                from.clamp(0.0, most) as usize..(to + 1.0).clamp(0.0, most) as usize
            };
            for row in tiles(1, 68.0) {
                tiles(0, 120.0).for_each(|column| entries[120 * row + column] += 1);
            }
        }
        entries.sort_unstable();
        let [least, middle, most] = [0, entries.len() / 2, entries.len() - 1].map(|at| entries[at]);
        assert!(
            least < 2 && (80..150).contains(&middle) && (500..700).contains(&most),
            "{least} {middle} {most}"
        );
    }
}

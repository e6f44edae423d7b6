//! Built-in clouds: generates splats from formulas, any number of them, identical on every
//! computer.
//!
//! Each cloud has its own scene file in the folder `builtin`, with a good view; the name alone
//! selects that scene. A cloud has exactly the requested number of splats, and σ is the spacing of
//! its samples.

use super::{Material, Splat};
use glam::{DVec2, DVec3};
use libm::{cos, sin};
use schemars::JsonSchema;
use serde::Deserialize;
use std::f64::consts::{PI, TAU};

/// The built-in clouds.
#[derive(Deserialize, JsonSchema, Clone, Copy, Debug, PartialEq)]
#[serde(rename_all = "kebab-case")]
pub enum Builtin {
    /// Two glass spheres and an opaque one over a checkerboard floor
    /// (docs/book/algorithm-resolve.md §10).
    GlassSpheres,
    /// A checkerboard to the horizon: magnified near the eye, minified far away.
    Checkerboard,
    /// A shiny tube tied into a trefoil, coloured along its length.
    TorusKnot,
    /// Fractal mountains, coloured by height and slope.
    Terrain,
}

/// Built-in scenes that are not clouds: volumes and Gaussians.
const MEDIA: [(&str, &str); 5] = [
    (
        "marschner-lobb",
        include_str!("builtin/marschner-lobb.json"),
    ),
    ("nested-shells", include_str!("builtin/nested-shells.json")),
    ("fuzzy-clouds", include_str!("builtin/fuzzy-clouds.json")),
    ("bouquet", include_str!("builtin/bouquet.json")),
    ("city", include_str!("builtin/city.json")),
];

/// The scene of a name without further fields.
pub(super) fn scene(name: &str) -> Option<&'static str> {
    let cloud = Builtin::ALL
        .into_iter()
        .find(|builtin| builtin.name() == name)
        .map(Builtin::scene);
    cloud.or_else(|| {
        MEDIA
            .into_iter()
            .find(|(own, _)| *own == name)
            .map(|(_, text)| text)
    })
}

/// Names of all built-in scenes.
pub fn names() -> impl Iterator<Item = &'static str> {
    Builtin::ALL
        .into_iter()
        .map(Builtin::name)
        .chain(MEDIA.into_iter().map(|(name, _)| name))
}

/// Order of the splats: neighbours in sequence, or shuffled.
#[derive(Deserialize, JsonSchema, Default, Clone, Copy, PartialEq)]
#[serde(rename_all = "lowercase")]
#[schemars(rename = "Order")]
pub(super) enum SplatOrder {
    #[default]
    Surface,
    Random,
}

const UNLIT: u32 = 0;
const LIT: u32 = 1;
/// Phyllotaxis: each sample is rotated by this part of a circle (modulo 1) relative to the one
/// before.
const GOLDEN: f64 = 1.618_033_988_749_895;

impl Builtin {
    /// All of them, in the order in which they are listed.
    pub const ALL: [Builtin; 4] = [
        Builtin::GlassSpheres,
        Builtin::Checkerboard,
        Builtin::TorusKnot,
        Builtin::Terrain,
    ];

    /// The name that scenes and the command line use.
    pub fn name(self) -> &'static str {
        match self {
            Builtin::GlassSpheres => "glass-spheres",
            Builtin::Checkerboard => "checkerboard",
            Builtin::TorusKnot => "torus-knot",
            Builtin::Terrain => "terrain",
        }
    }

    /// The scene of the name without further fields.
    pub(super) fn scene(self) -> &'static str {
        match self {
            Builtin::GlassSpheres => include_str!("builtin/glass-spheres.json"),
            Builtin::Checkerboard => include_str!("builtin/checkerboard.json"),
            Builtin::TorusKnot => include_str!("builtin/torus-knot.json"),
            Builtin::Terrain => include_str!("builtin/terrain.json"),
        }
    }

    /// The materials of its splats, by index.
    pub(super) fn materials(self) -> Vec<Material> {
        let lit = |ambient, diffuse, specular, shininess| Material::BlinnPhong {
            ambient,
            diffuse,
            specular,
            shininess,
        };
        match self {
            Builtin::GlassSpheres => vec![Material::Unlit, lit(0.15, 0.8, 0.3, 32.0)],
            Builtin::Checkerboard => vec![Material::Unlit],
            Builtin::TorusKnot => vec![lit(0.1, 0.75, 0.6, 60.0)],
            Builtin::Terrain => vec![lit(0.25, 0.9, 0.0, 1.0)],
        }
    }

    /// `count` splats in surface order; by default the number that closes its surface at 512×512.
    pub fn splats(self, count: Option<usize>) -> Vec<Splat> {
        match self {
            Builtin::GlassSpheres => glass_spheres(count.unwrap_or(280_000)),
            Builtin::Checkerboard => checkerboard(count.unwrap_or(200_000)),
            Builtin::TorusKnot => torus_knot(count.unwrap_or(200_000)),
            Builtin::Terrain => terrain(count.unwrap_or(250_000)),
        }
    }
}

/// Shuffles by Fisher and Yates with splitmix64: a seed always gives the same order.
pub(super) fn shuffle(splats: &mut [Splat], seed: u64) {
    let mut state = seed;
    for i in (1..splats.len()).rev() {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        splats.swap(i, ((mix(state) as u128 * (i as u128 + 1)) >> 64) as usize);
    }
}

/// The output function of splitmix64: every bit of the result depends on every bit of the input.
fn mix(z: u64) -> u64 {
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Part i of `parts` parts of `count`: they differ by at most 1 and sum to `count`.
fn share(count: usize, parts: usize, i: usize) -> usize {
    let upto = |i: usize| (count as u128 * i as u128 / parts as u128) as usize;
    upto(i + 1) - upto(i)
}

// ---- glass-spheres ----

/// Four sevenths of the splats are floor (a square grid, so slightly fewer), the rest spheres in
/// the ratio 3 : 2 : 1.
fn glass_spheres(count: usize) -> Vec<Splat> {
    let side = (count * 4 / 7).isqrt();
    let round = count - side * side;
    let (red, green) = (round / 2, round / 3);
    let mut splats = Vec::with_capacity(count);
    splats.extend((0..side * side).map(|i| floor_splat(i, side)));
    sphere(&mut splats, red, DVec3::ZERO, 1.0, [0.9, 0.2, 0.1], 0.5);
    sphere(
        &mut splats,
        green,
        DVec3::new(0.7, 0.2, 0.5),
        0.8,
        [0.1, 0.8, 0.2],
        0.5,
    );
    sphere(
        &mut splats,
        round - red - green,
        DVec3::new(-0.9, -0.3, 0.8),
        0.6,
        [0.2, 0.3, 0.9],
        1.0,
    );
    splats
}

fn floor_splat(i: usize, side: usize) -> Splat {
    let spacing = 8.0 / side as f64;
    let [x, z] = [i % side, i / side].map(|cell| -4.0 + (cell as f64 + 0.5) * spacing);
    let odd = ((2.0 * x).floor() + (2.0 * z).floor()).rem_euclid(2.0) == 1.0;
    Splat {
        position: DVec3::new(x, -1.0, z),
        normal: DVec3::Y,
        radius: spacing,
        rgb: if odd {
            [0.9, 0.9, 0.9]
        } else {
            [0.1, 0.1, 0.3]
        },
        opacity: 1.0,
        material: UNLIT,
    }
}

/// A Fibonacci lattice around the z axis.
fn sphere(
    splats: &mut Vec<Splat>,
    count: usize,
    centre: DVec3,
    radius: f64,
    rgb: [f64; 3],
    opacity: f64,
) {
    let spacing = radius * (4.0 * PI / count as f64).sqrt();
    splats.extend((0..count).map(|i| {
        let i = i as f64 + 0.5;
        let polar = libm::acos(1.0 - 2.0 * i / count as f64);
        let azimuth = PI * (1.0 + 5f64.sqrt()) * i;
        let normal = DVec3::new(
            sin(polar) * cos(azimuth),
            sin(polar) * sin(azimuth),
            cos(polar),
        );
        Splat {
            position: centre + radius * normal,
            normal,
            radius: spacing,
            rgb,
            opacity,
            material: LIT,
        }
    }));
}

// ---- checkerboard ----

/// Near and far edge of the plane, in heights of the eye; at depth d it is d wide.
const NEAR_EDGE: f64 = 1.2;
const FAR_EDGE: f64 = 200.0;

/// Rows from near to far. Spacing grows with the square root of depth: splats are many pixels wide
/// near the eye and much less than one at the horizon. They are never wider than half a check;
/// otherwise the pattern itself would be undersampled.
fn checkerboard(count: usize) -> Vec<Splat> {
    // With spacing c·√d, a strip of depth dd has d·dd/(c²d) splats: the same number per unit of
    // depth.
    let c = ((FAR_EDGE - NEAR_EDGE) / count as f64).sqrt();
    let rows = ((2.0 * (FAR_EDGE.sqrt() - NEAR_EDGE.sqrt()) / c).round() as usize).clamp(1, count);
    let edge = |row: usize| {
        let root =
            NEAR_EDGE.sqrt() + (FAR_EDGE.sqrt() - NEAR_EDGE.sqrt()) * row as f64 / rows as f64;
        root * root
    };
    let upto = |row: usize| {
        ((edge(row) - NEAR_EDGE) / (FAR_EDGE - NEAR_EDGE) * count as f64).round() as usize
    };
    let row = |row: usize| {
        let (near, far, columns) = (edge(row), edge(row + 1), upto(row + 1) - upto(row));
        let depth = (near + far) / 2.0;
        let radius = (depth * (far - near) / columns as f64).sqrt();
        (0..columns).map(move |i| {
            plane_splat(
                depth * ((i as f64 + 0.5) / columns as f64 - 0.5),
                -depth,
                radius,
            )
        })
    };
    (0..rows).flat_map(row).collect()
}

fn plane_splat(x: f64, z: f64, radius: f64) -> Splat {
    let odd = (x.floor() + z.floor()).rem_euclid(2.0) == 1.0;
    Splat {
        position: DVec3::new(x, 0.0, z),
        normal: DVec3::Y,
        radius,
        rgb: if odd { [0.9; 3] } else { [0.02; 3] },
        opacity: 1.0,
        material: 0,
    }
}

// ---- torus-knot ----

/// Less than half the smallest distance between two parts of the knot.
const TUBE: f64 = 0.4;
/// Segments for measuring the knot's length; halving them moves no splat by a thousandth of its
/// radius.
const PIECES: usize = 4096;

/// A phyllotaxis on the tube around a (2, 3) torus knot.
fn torus_knot(count: usize) -> Vec<Splat> {
    let length_upto = knot_lengths();
    let length = length_upto[PIECES];
    let radius = (length * TAU * TUBE / count as f64).sqrt();
    let splat = |i: usize| {
        let along = (i as f64 + 0.5) / count as f64;
        let piece = length_upto.partition_point(|&l| l <= along * length) - 1;
        let inside =
            (along * length - length_upto[piece]) / (length_upto[piece + 1] - length_upto[piece]);
        let angle = TAU * (piece as f64 + inside) / PIECES as f64;
        let (centre, across, above) = knot_frame(angle);
        let around = TAU * (i as f64 * GOLDEN).fract();
        let normal = cos(around) * across + sin(around) * above;
        let rgb = [0.0, 1.0 / 3.0, 2.0 / 3.0].map(|phase| 0.5 + 0.45 * cos(TAU * (along + phase)));
        Splat {
            position: centre + TUBE * normal,
            normal,
            radius,
            rgb,
            opacity: 1.0,
            material: 0,
        }
    };
    (0..count).map(splat).collect()
}

/// Length of the knot from its start to the end of each segment.
fn knot_lengths() -> Vec<f64> {
    let point = |i: usize| knot_frame(TAU * i as f64 / PIECES as f64).0;
    let mut lengths = vec![0.0];
    for i in 0..PIECES {
        lengths.push(lengths[i] + (point(i + 1) - point(i)).length());
    }
    lengths
}

/// Point of the knot's centre line, and two unit vectors that span the plane across it.
fn knot_frame(angle: f64) -> (DVec3, DVec3, DVec3) {
    let (s2, c2, s3, c3) = (
        sin(2.0 * angle),
        cos(2.0 * angle),
        sin(3.0 * angle),
        cos(3.0 * angle),
    );
    let from_axis = 2.0 + c3;
    let centre = DVec3::new(from_axis * c2, from_axis * s2, s3);
    let tangent = DVec3::new(
        -3.0 * s3 * c2 - 2.0 * from_axis * s2,
        -3.0 * s3 * s2 + 2.0 * from_axis * c2,
        3.0 * c3,
    );
    // Outwards from the torus that the knot is on: never along the knot.
    let across = DVec3::new(c3 * c2, c3 * s2, s3);
    (centre, across, tangent.normalize().cross(across))
}

// ---- terrain ----

/// Half the side of the terrain's square; the highest peaks are about a quarter of the side.
const HALF_SIDE: f64 = 4.0;

/// Rows of a near-square grid, z from far to near, x from left to right.
fn terrain(count: usize) -> Vec<Splat> {
    let rows = count.isqrt();
    let spacing = 2.0 * HALF_SIDE / (count as f64).sqrt();
    let row = move |row: usize| {
        let columns = share(count, rows, row);
        let cell =
            move |i: usize, of: usize| ((i as f64 + 0.5) / of as f64 * 2.0 - 1.0) * HALF_SIDE;
        (0..columns).map(move |column| {
            terrain_splat(DVec2::new(cell(column, columns), cell(row, rows)), spacing)
        })
    };
    (0..rows).flat_map(row).collect()
}

fn terrain_splat(at: DVec2, spacing: f64) -> Splat {
    let step = spacing / 2.0;
    let slope = |axis: DVec2| (height(at + step * axis) - height(at - step * axis)) / (2.0 * step);
    let y = height(at);
    let normal = DVec3::new(-slope(DVec2::X), 1.0, -slope(DVec2::Y)).normalize();
    Splat {
        position: DVec3::new(at.x, y, at.y),
        normal,
        // On steep ground a cell of the grid covers more area.
        radius: spacing / normal.y.sqrt(),
        rgb: ground(y, normal.y, noise(at * 9.0, 77)),
        opacity: 1.0,
        material: 0,
    }
}

/// Ridges on large hills, and smaller and smaller ridges on those; water level is 0.
fn height(at: DVec2) -> f64 {
    let octave = |i: u32| {
        let scale = f64::from(1u32 << i);
        let ridge = 1.0 - (2.0 * noise(at * 0.45 * scale, u64::from(i)) - 1.0).abs();
        ridge * ridge / scale
    };
    let hills = noise(at * 0.3, 99);
    (hills * (0..7).map(octave).sum::<f64>() * 1.1 - 0.25).max(0.0)
}

/// Linear light of water, grass, rock and snow, by height, steepness (the normal's y) and a random
/// number.
fn ground(height: f64, up: f64, chance: f64) -> [f64; 3] {
    const WATER: DVec3 = DVec3::new(0.02, 0.09, 0.16);
    const GRASS: DVec3 = DVec3::new(0.09, 0.17, 0.03);
    const ROCK: DVec3 = DVec3::new(0.22, 0.17, 0.13);
    const SNOW: DVec3 = DVec3::new(0.88, 0.9, 0.95);
    if height == 0.0 {
        return WATER.to_array();
    }
    let flat = smooth((up - 0.55) / 0.25);
    let low = GRASS * (0.6 + 0.8 * chance);
    let rock = ROCK * (0.7 + 0.6 * chance);
    let snow = smooth((height + 0.3 * chance - 0.85) / 0.25) * smooth((up - 0.4) / 0.2);
    rock.lerp(low, flat * (1.0 - smooth((height - 0.35) / 0.35)))
        .lerp(SNOW, snow)
        .to_array()
}

/// 0 below 0, 1 above 1, smooth between.
fn smooth(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Value noise in [0, 1): hashed values at integer coordinates, smooth between them.
fn noise(at: DVec2, seed: u64) -> f64 {
    let cell = at.floor();
    let part = at - cell;
    let corner = |dx: f64, dy: f64| {
        let [x, y] = [cell.x + dx, cell.y + dy].map(|c| c as i64 as u64);
        let hash = mix(mix(mix(seed).wrapping_add(x)).wrapping_add(y));
        (hash >> 11) as f64 / (1u64 << 53) as f64
    };
    let (u, v) = (smooth(part.x), smooth(part.y));
    let lerp = |a: f64, b: f64, t: f64| a + (b - a) * t;
    lerp(
        lerp(corner(0.0, 0.0), corner(1.0, 0.0), u),
        lerp(corner(0.0, 1.0), corner(1.0, 1.0), u),
        v,
    )
}

#[cfg(test)]
mod tests;

//! Built-in fields: volumes from formulas.

use super::volume::Volume;
use glam::DVec3;
use libm::{cos, exp, sin};
use schemars::JsonSchema;
use serde::Deserialize;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// The built-in fields, over a cube of edge 2 around the origin.
#[derive(Deserialize, JsonSchema, Clone, Copy, Debug, PartialEq)]
#[serde(rename_all = "kebab-case")]
#[schemars(rename = "Field")]
pub enum BuiltinFieldName {
    /// Waves near the sampling limit of a grid (Marschner and Lobb, *An Evaluation of
    /// Reconstruction Filters*, 1994), in [0, 1].
    MarschnerLobb,
    /// Four shells around each other, with values 0.25, 0.5, 0.75 and 1; 0 elsewhere.
    NestedShells,
    /// Clouds of soft balls, in [0, 1].
    FuzzyClouds,
}

impl BuiltinFieldName {
    /// The field with this number of points along each axis.
    pub fn volume(self, samples: usize) -> Volume {
        let step = 2.0 / (samples - 1) as f64;
        let place = |i: usize| i as f64 * step - 1.0;
        let mut values = Vec::with_capacity(samples * samples * samples);
        for z in 0..samples {
            for y in 0..samples {
                values.extend(
                    (0..samples).map(|x| self.at(DVec3::new(place(x), place(y), place(z))) as f32),
                );
            }
        }
        let axes = [[step, 0.0, 0.0], [0.0, step, 0.0], [0.0, 0.0, step]];
        Volume {
            size: [samples; 3],
            axes,
            origin: [-1.0; 3],
            values,
            notes: vec![],
        }
    }

    fn at(self, p: DVec3) -> f64 {
        match self {
            BuiltinFieldName::MarschnerLobb => marschner_lobb(p),
            BuiltinFieldName::NestedShells => nested_shells(p),
            BuiltinFieldName::FuzzyClouds => fuzzy_clouds(p),
        }
    }
}

/// With the paper's f_M = 6 and α = 0.25; z is the axis of the waves.
fn marschner_lobb(p: DVec3) -> f64 {
    let (frequency, depth) = (6.0, 0.25);
    let waves = cos(TAU * frequency * cos(FRAC_PI_2 * p.x.hypot(p.y)));
    (1.0 - sin(FRAC_PI_2 * p.z) + depth * (1.0 + waves)) / (2.0 * (1.0 + depth))
}

/// Shells of radius 0.2, 0.4, 0.6 and 0.8 with soft edges of 0.025; an octant is cut away to show
/// the inside.
fn nested_shells(p: DVec3) -> f64 {
    if p.x > 0.0 && p.y > 0.0 && p.z > 0.0 {
        return 0.0;
    }
    let shell = |n: u32| {
        let radius = f64::from(n) * 0.2;
        let away = (p.length() - radius) / 0.025;
        // The innermost is the densest.
        f64::from(5 - n) * 0.25 * exp(-0.5 * away * away)
    };
    (1..=4).map(shell).fold(0.0, f64::max)
}

/// Sixty-four balls on a spiral, each thinner than the one before.
fn fuzzy_clouds(p: DVec3) -> f64 {
    let ball = |i: u32| {
        let part = (f64::from(i) + 0.5) / 64.0;
        let (turn, height) = (f64::from(i) * PI * (3.0 - 5.0_f64.sqrt()), 1.2 * part - 0.6);
        let ring = 0.75 * (1.0 - (2.0 * part - 1.0) * (2.0 * part - 1.0)).sqrt();
        let centre = DVec3::new(ring * cos(turn), height, ring * sin(turn));
        let away = (p - centre).length_squared() / (0.02 * (1.2 - part));
        0.5 * exp(-0.5 * away)
    };
    (0..64).map(ball).sum::<f64>().min(1.0)
}

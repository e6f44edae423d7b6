//! How far a table may be from its function.

use super::Table;
use crate::machine::Interpolation;
use crate::num::Fit;

/// Greatest distance of a table of unrounded words from a function of at most this |f'| and |f''|.
///
/// Nearest: half a step of slope. Straight lines: h²/8 of curvature.
pub fn between(interpolation: Interpolation, step: f64, slope: f64, curvature: f64) -> f64 {
    match interpolation {
        Interpolation::Nearest => slope * step / 2.0,
        Interpolation::Linear => curvature * step * step / 8.0,
    }
}

/// Greatest distance of a table, before its result is fitted, from a function of at most this |f'| and |f''|.
///
/// To [`between`] comes half a place by which a word is rounded: a point between two words is off by no more than the worse of them.
pub fn error(fit: &Fit, interpolation: Interpolation, step: f64, slope: f64, curvature: f64) -> f64 {
    let place = (-f64::from(fit.word.format.frac_bits)).exp2();
    between(interpolation, step, slope, curvature) + place / 2.0
}

impl Table {
    /// The width of a step, as a part of the table's whole range.
    pub fn step(&self) -> f64 {
        1.0 / self.values.len() as f64
    }
}

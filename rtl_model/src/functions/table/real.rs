//! How far a table may be from its function.

use super::Table;
use crate::machine::Interpolation;
use crate::num::Fit;
use crate::num::real::{loss, power_of_two};

/// Greatest distance of a table of unrounded words from a function of at most this |f'| and |f''|.
///
/// Nearest: half a step of slope. Straight lines: h²/8 of curvature.
pub fn between(interpolation: Interpolation, step: f64, slope: f64, curvature: f64) -> f64 {
    match interpolation {
        Interpolation::Nearest => slope * step / 2.0,
        Interpolation::Linear => curvature * step * step / 8.0,
    }
}

/// Greatest distance of a table, before its result is fitted, from a function of at most this |f'|
/// and |f''|.
///
/// To [`between`] comes half a place by which a word is rounded: a point between two words is off
/// by no more than the worse of them.
pub fn error(
    fit: &Fit,
    interpolation: Interpolation,
    step: f64,
    slope: f64,
    curvature: f64,
) -> f64 {
    let place = power_of_two(-fit.word.format.frac_bits);
    between(interpolation, step, slope, curvature) + place / 2.0
}

impl Table {
    /// Value in the table at a part of its range, from 0 to below 1, that may be no argument's:
    /// before the result is fitted.
    pub fn at(&self, part: f64) -> f64 {
        let steps = self.words.len() as f64;
        let position = (part * steps).clamp(0.0, steps);
        let address = (position as usize).min(self.words.len() - 1);
        let [value, delta] = self.words[address].map(|word| word as f64);
        (value + delta * (position - address as f64))
            * power_of_two(-self.fit.word.format.frac_bits)
    }

    /// The width of a step, as a part of the table's whole range.
    pub fn step(&self) -> f64 {
        1.0 / self.words.len() as f64
    }
}

/// A table of x^exponent over [0, 1], and how far each of its steps is from that.
#[derive(Clone, Debug)]
pub struct Power {
    table: Table,
    exponent: f64,
    /// Of each step, the result's fit included.
    errors: Vec<f64>,
}

impl Power {
    /// From the words that the machine holds, once a frame.
    ///
    /// Over a step the table is a line (a level one where nearest) and x^s is convex, or concave
    /// where s < 1: they are farthest apart at the step's ends or where x^s has the line's slope,
    /// at x = (slope/s)^(1/(s − 1)). That counts the words' rounding too; the fit of the result
    /// adds its own, where there is anything between words to round.
    pub fn new(table: Table, exponent: f64) -> Self {
        let place = power_of_two(-table.fit.word.format.frac_bits);
        let is_line = table.fraction_bits > 0 && table.words.iter().any(|[_, delta]| *delta != 0);
        let [down, up] = if is_line {
            loss(table.fit.word.round)
        } else {
            [0.0; 2]
        };
        let width = table.step();
        let error = |i: usize| {
            let [word, rise] = table.words[i].map(|word| word as f64 * place);
            let start = i as f64 * width;
            let steepest = (rise / width / exponent).powf((exponent - 1.0).recip());
            // No number where the function is constant or straight: then it is farthest from the
            // line at an end, which `max` keeps.
            let points = [start, start + width, steepest.max(start).min(start + width)];
            let apart = |x: f64| (x.powf(exponent) - (word + rise * (x - start) / width)).abs();
            points.map(apart).into_iter().fold(0.0, f64::max) + down.max(up) * place
        };
        let errors = (0..table.words.len()).map(error).collect();
        Power {
            table,
            exponent,
            errors,
        }
    }

    /// The table.
    pub fn table(&self) -> &Table {
        &self.table
    }

    /// x^exponent, of the end that is nearer where x lies outside [0, 1].
    pub fn exact(&self, x: f64) -> f64 {
        x.clamp(0.0, 1.0).powf(self.exponent)
    }

    /// y = s·d/x: within d of x, x^s changes by at most itself times e^y − 1. Infinite where s is
    /// below 1 or x not above 0, of which that is not true.
    pub fn growth(&self, x: f64, distance: f64) -> f64 {
        if self.exponent >= 1.0 && x > 0.0 {
            self.exponent * distance / x
        } else {
            f64::INFINITY
        }
    }

    /// Greatest distance of the table's word from the function, between two arguments.
    pub fn error(&self, low: f64, high: f64) -> f64 {
        let steps = self.errors.len();
        let step = |x: f64| ((x * steps as f64) as usize).min(steps - 1);
        self.errors[step(low)..=step(high)]
            .iter()
            .copied()
            .fold(0.0, f64::max)
    }
}

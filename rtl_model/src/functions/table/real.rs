//! Bounds of the error of a table.

use super::Table;
use crate::machine::Interpolation;
use crate::num::Fit;
use crate::num::real::power_of_two;

/// Greatest distance between a table of unrounded words and a function with |f'| and |f''| up to
/// these limits.
///
/// Nearest: half a step times the slope. Linear: h²/8 times the curvature.
pub fn between(interpolation: Interpolation, step: f64, slope: f64, curvature: f64) -> f64 {
    match interpolation {
        Interpolation::Nearest => slope * step / 2.0,
        Interpolation::Linear => curvature * step * step / 8.0,
    }
}

/// Greatest distance between a table, before its result is fitted, and a function with |f'| and
/// |f''| up to these limits.
///
/// The rounding of a word adds half an ulp of the greatest word to [`between`]: an interpolated
/// point is off by at most the larger error of its two words.
pub fn error(
    fit: &Fit,
    interpolation: Interpolation,
    step: f64,
    slope: f64,
    curvature: f64,
) -> f64 {
    let format = fit.word.format;
    let place = format.ulp_at(f64::INFINITY) * power_of_two(-format.frac_bits);
    between(interpolation, step, slope, curvature) + place / 2.0
}

impl Table {
    /// Value of the table at a position in [0, 1) of its range, which need not be an argument;
    /// before the result is fitted.
    pub fn at(&self, part: f64) -> f64 {
        let steps = self.words.len() as f64;
        let position = (part * steps).clamp(0.0, steps);
        let address = (position as usize).min(self.words.len() - 1);
        let [value, delta] = self.words[address].map(|word| word as f64);
        (value + delta * (position - address as f64))
            * power_of_two(-self.fit.word.format.frac_bits)
    }

    /// The width of a step, as a share of the table's whole range.
    pub fn step(&self) -> f64 {
        1.0 / self.words.len() as f64
    }
}

/// A table of x^exponent over [0, 1], and the error of each of its steps.
#[derive(Clone, Debug)]
pub struct Power {
    table: Table,
    exponent: f64,
    /// Per step, including the fit of the result.
    errors: Vec<f64>,
}

impl Power {
    /// From the words of the machine, once per frame.
    ///
    /// Over a step the table is a line (a constant one for nearest) and x^s is convex, or concave
    /// if s < 1. They are farthest apart at the ends of the step or where x^s has the slope of the
    /// line, at x = (slope/s)^(1/(s − 1)). This includes the rounding of the words. The fit of the
    /// result adds its own rounding if the table interpolates.
    pub fn new(table: Table, exponent: f64) -> Self {
        let place = power_of_two(-table.fit.word.format.frac_bits);
        let is_line = table.fraction_bits > 0 && table.words.iter().any(|[_, delta]| *delta != 0);
        let [down, up] = if is_line {
            table.fit.word.loss()
        } else {
            [0.0; 2]
        };
        let width = table.step();
        let error = |i: usize| {
            let [word, rise] = table.words[i].map(|word| word as f64 * place);
            let start = i as f64 * width;
            let steepest = (rise / width / exponent).powf((exponent - 1.0).recip());
            // NaN if the function is constant or a line. Then the distance is greatest at an end,
            // and `max` discards the NaN.
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

    /// x^exponent, with x limited to [0, 1].
    pub fn exact(&self, x: f64) -> f64 {
        x.clamp(0.0, 1.0).powf(self.exponent)
    }

    /// With y = s·d/x: within d of x, x^s changes by at most x^s·(e^y − 1). Infinite where this
    /// does not hold: if s < 1 or x ≤ 0.
    pub fn growth(&self, x: f64, distance: f64) -> f64 {
        if self.exponent >= 1.0 && x > 0.0 {
            self.exponent * distance / x
        } else {
            f64::INFINITY
        }
    }

    /// Greatest distance between the table's word and the function, between two arguments.
    pub fn error(&self, low: f64, high: f64) -> f64 {
        let steps = self.errors.len();
        let step = |x: f64| ((x * steps as f64) as usize).min(steps - 1);
        self.errors[step(low)..=step(high)]
            .iter()
            .copied()
            .fold(0.0, f64::max)
    }
}

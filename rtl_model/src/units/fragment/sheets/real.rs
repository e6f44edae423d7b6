//! Sheets over the reals: bounds the distance of an optical depth, and of its opacity, from the
//! exact ones.
//!
//! A sum adds half an ulp per contribution. The ratio adds its table's error times x. Both are
//! multiplied by the transmittance of the sheets before, which the blend's bounds include
//! ([`super::Fragment::real_blend`]).

use super::{Fragment, SheetRegisters};
use crate::functions::Table;
use crate::functions::table::real::error;
use crate::real::{Real, Scale, power_of_two};

/// The ratio α/x as a function, for bounds.
#[derive(Clone, Copy, Debug)]
pub struct Ratio {
    /// ρ, monotone.
    pub exact: fn(f64) -> f64,
    /// Greatest |ρ'| from an argument on, and greatest |ρ''| except at kinks at the ends of table
    /// steps.
    pub curves: fn(f64) -> [f64; 2],
}

impl Fragment {
    /// Range of optical depths that the table spans.
    pub fn ratio_range(&self) -> f64 {
        self.sheets
            .as_ref()
            .map_or(1.0, |own| power_of_two(own.index.word.format.int_bits))
    }

    /// Premultiplied colour and opacity of a closed sheet, from Σw and Σw·rgb.
    pub fn real_close<R: Real>(
        &self,
        weight: R,
        rgb: [R; 3],
        registers: &SheetRegisters,
        ratio: &Ratio,
    ) -> [R; 4] {
        let Some(own) = &self.sheets else {
            return [R::constant(0.0); 4];
        };
        let one = R::constant(1.0);
        let scaled = |table: &Table| {
            let range = self.ratio_range();
            let step = table.step() * range;
            // From the beginning of the step that the argument is in.
            let table_error = |argument: f64| {
                let [slope, curvature] = (ratio.curves)((argument - step).max(0.0));
                error(table.fit(), table.interpolation(), step, slope, curvature)
            };
            weight
                .fit(&own.index, Scale::ONE)
                .table(table, range, ratio.exact, table_error)
                .fit(table.fit(), Scale::ONE)
        };
        let Some(table) = &registers.ratio else {
            let [of_weight, of_colour] = &own.plain;
            let [r, g, b] = rgb.map(|channel| channel.fit(of_colour, Scale::ONE));
            return [r, g, b, weight.fit(of_weight, Scale::ONE).min(one)];
        };
        let scale = scaled(table);
        let [of_weight, of_colour] = &own.closed;
        let [r, g, b] = rgb.map(|channel| (channel * scale).fit(of_colour, Scale::ONE));
        [
            r,
            g,
            b,
            (weight * scale).fit(of_weight, Scale::ONE).min(one),
        ]
    }
}

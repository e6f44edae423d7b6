//! Gauss: turns a radial index into a weight, `amplitude · exp(−r/2)`, from one table (EWA §7.1).
//!
//! ```text
//! radial_index ─►[table]─► falloff ─►(×)─► weight
//! amplitude ─────────────────────────┘
//! ```
//! Losses: `radial_index` is cut to the table's reach; `falloff` and `weight` are rounded to nearest: weights are summed many
//! times, and a cut would bias coverage (colours survive it: they are divided by the same sum).
//!
//! Law: `a_weight_never_exceeds_its_amplitude`.

use crate::elaboration::latency::Path;
use crate::elaboration::{Elaboration, Operator};
use crate::functions::{Table, table};
use crate::machine::Machine;
use crate::num::fit;
use crate::num::{Exacts, Fit, Lanes, Words};
use crate::probe::{Probe, Tap};
use crate::records::unit;

const UNIT: &str = unit::GAUSS;

/// Longest way: table, product.
pub fn path(machine: &Machine) -> Path {
    let m = &machine.gauss;
    let [index, falloff, weight, amplitude] =
        [m.radial_index, m.falloff, m.weight, machine.ellipse.amplitude].map(|word| word.format.width());
    Path::default().fit(index).then(table::path(m.table, falloff)).product(amplitude, falloff).fit(weight)
}

/// The elaborated unit.
#[derive(Clone, Debug)]
pub struct Gauss {
    radial_index: Fit,
    table: Table,
    weight: Fit,
    /// Whether 32 bits hold every radial index below the cutoff, and every weight, before they are limited.
    is_natural: bool,
    /// Whether [`Gauss::short`] may be asked, for r below 2^30.
    is_narrow: bool,
}

/// The unit in words of 32 bits: see [`Gauss::short`].
#[derive(Clone, Copy, Debug)]
pub struct Short<'a, W: Words> {
    radial_index: fit::Natural<W>,
    table: table::Natural<'a, W>,
    half: W::Exact,
    places: u32,
    max: W,
}

impl<W: Words> Short<'_, W> {
    /// Weight of eight fragments whose r is neither negative nor above 2^30.
    #[inline(always)]
    pub fn weight(&self, radial: W, amplitude: W) -> W {
        let falloff = self.table.words(self.radial_index.words(radial));
        (amplitude * falloff + self.half).cut(self.places).min(self.max)
    }
}

impl Gauss {
    /// Elaborates the unit.
    pub fn new(e: &mut Elaboration, machine: &Machine) -> Self {
        let m = &machine.gauss;
        for (name, word) in [("radial_index", m.radial_index), ("falloff", m.falloff), ("weight", m.weight)] {
            e.port(UNIT, name, word);
            e.signedness(UNIT, name, word, false);
        }
        e.holds_one(UNIT, "falloff", m.falloff);
        let argument = m.radial_index.format;
        e.require(argument.int_bits <= 5, || {
            format!("gauss.radial_index is {}: the table spans at most 32, U5F{}", m.radial_index, argument.frac_bits)
        });
        let shape = table::shape(e, UNIT, "table", m.table, argument.width());
        let words = table::gaussian_words(
            shape.index_bits,
            argument.int_bits.min(5),
            shape.interpolation,
            m.falloff.format.frac_bits.min(31) as u32,
        );
        e.part(UNIT, Operator::Rom([words.len() as i32, m.falloff.format.width()]));
        let fraction_bits = Table::fraction_bits(shape.index_bits, argument.width() as u32);
        table::interpolator(e, UNIT, shape, m.falloff, fraction_bits);
        let falloff = e.fit(UNIT, "falloff", m.falloff, table::interpolated(m.falloff, fraction_bits));
        let weighed = e.times(UNIT, machine.ellipse.amplitude, m.falloff);
        let radial_index = e.fit(UNIT, "radial_index", m.radial_index, machine.raster.radial.into());
        let weight = e.fit(UNIT, "weight", m.weight, weighed);
        let table = Table::new(falloff, shape.index_bits, argument.width() as u32, shape.interpolation, &words);
        let short = |fit: &Fit| fit.is_simple() && fit.places() < 31 && fit.word.format.width() < 32;
        let [falloff_max, amplitude_max] = [m.falloff, machine.ellipse.amplitude].map(|word| i128::from(word.format.max()));
        let most = falloff_max * amplitude_max + i128::from(weight.half());
        let room = 1i128 << (31 + weight.places().clamp(0, 62));
        Gauss {
            is_narrow: [radial_index, weight].iter().all(short) && falloff_max < 1 << 31 && most < room && table.is_short(),
            radial_index,
            table,
            weight,
            is_natural: radial_index.is_natural(machine.raster.cutoff.format.int_bits) && weight.is_natural(weighed.int_bits),
        }
    }

    /// e^(−r/2) from a radial index.
    pub fn table(&self) -> &Table {
        &self.table
    }

    /// The weight of one fragment at a radial index that has been cut to the table's reach.
    pub fn weight_at(&self, radial_index: i64, amplitude: i64) -> i64 {
        self.weight.one(amplitude * self.table.fit().one(self.table.exact(radial_index)))
    }

    /// Whether all of its fits are plain.
    pub fn is_simple(&self) -> bool {
        self.is_natural && self.table.fit().is_simple()
    }

    /// Whether [`Gauss::short`] may be asked, for r below 2^30.
    pub fn is_narrow(&self) -> bool {
        self.is_narrow
    }

    /// [`Gauss::lanes`] in words of 32 bits, with its constants on all lanes.
    #[inline(always)]
    pub fn short<W: Words>(&self) -> Short<'_, W> {
        Short {
            radial_index: self.radial_index.natural(),
            table: self.table.natural(),
            half: W::Exact::splat(self.weight.half()),
            places: self.weight.places() as u32,
            max: W::splat(self.weight.limits()[1]),
        }
    }

    /// Radial index and weight of eight fragments of one splat, whose r is not negative.
    #[inline(always)]
    pub fn lanes<const SIMPLE_FITS: bool, L: Lanes, P: Probe>(&self, radial: L, amplitude: i64, tap: &mut Tap<P>) -> [L; 2] {
        let radial_index = tap.fit_unsigned::<SIMPLE_FITS, L>(&self.radial_index, radial);
        // Between two words of the table lies nothing beyond them.
        let falloff = tap.fit_within::<SIMPLE_FITS, L>(self.table.fit(), self.table.exact_lanes(radial_index));
        [radial_index, tap.fit_unsigned::<SIMPLE_FITS, L>(&self.weight, L::splat(amplitude) * falloff)]
    }
}

pub mod real;

#[cfg(test)]
mod tests;

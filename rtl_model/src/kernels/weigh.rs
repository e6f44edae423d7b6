//! Weigh: the function of gauss in registers, between the walk of the rasteriser and a tile's
//! fragments.
//!
//! The graph of `gauss` defines a weight. In a batch of the graph each operator reads and writes a
//! row in memory; here the walk, the table and the queue are one loop in registers.
//!
//! Laws (tests of gauss, against its graph): `a_weight_never_exceeds_its_amplitude`,
//! `words_of_32_bits_weigh_as_wide_ones_do`.

use crate::functions::{Table, table};
use crate::num::{Exacts, Fit, Lanes, Words, fit};
use crate::probe::{Probe, Tap};

/// Gauss, with properties of its fits.
#[derive(Clone, Debug)]
pub struct Weigh {
    radial_index: Fit,
    table: Table,
    weight: Fit,
    /// Whether 32 bits hold every radial index below the cutoff, and every weight, before they are
    /// limited.
    is_natural: bool,
    /// Whether [`Weigh::short`] may be used, for r below 2^30.
    is_narrow: bool,
}

/// Ranges of the inputs and outputs of gauss; the first two are bits before the binary point.
#[derive(Clone, Copy, Debug)]
pub struct WeighShape {
    /// r below the cutoff.
    pub radial: i32,
    /// An amplitude times a falloff.
    pub weighed: i32,
    /// The greatest amplitude.
    pub amplitude: i64,
}

/// The unit in words of 32 bits: see [`Weigh::short`].
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
        (amplitude * falloff + self.half)
            .cut(self.places)
            .min(self.max)
    }
}

impl Weigh {
    /// For a unit with this table and these fits.
    pub fn new([radial_index, weight]: [Fit; 2], table: &Table, shape: WeighShape) -> Self {
        let short =
            |fit: &Fit| fit.is_simple() && fit.places() < 31 && fit.word.format.width() < 32;
        let falloff_max = i128::from(table.fit().word.format.max());
        let most = falloff_max * i128::from(shape.amplitude) + i128::from(weight.half());
        let room = 1i128 << (31 + weight.places().clamp(0, 62));
        Weigh {
            is_narrow: [radial_index, weight].iter().all(short)
                && falloff_max < 1 << 31
                && most < room
                && table.is_short(),
            is_natural: radial_index.is_natural(shape.radial) && weight.is_natural(shape.weighed),
            radial_index,
            table: table.clone(),
            weight,
        }
    }

    /// Whether all of its fits are simple.
    pub fn is_simple(&self) -> bool {
        self.is_natural && self.table.fit().is_simple()
    }

    /// Whether [`Weigh::short`] may be used, for r below 2^30.
    pub fn is_narrow(&self) -> bool {
        self.is_narrow
    }

    /// [`Weigh::lanes`] in words of 32 bits, with its constants on all lanes.
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

    /// Radial index and weight of eight fragments of one splat with r ≥ 0.
    #[inline(always)]
    pub fn lanes<const SIMPLE_FITS: bool, L: Lanes, P: Probe>(
        &self,
        radial: L,
        amplitude: i64,
        tap: &mut Tap<P>,
    ) -> [L; 2] {
        let radial_index = tap.fit_unsigned::<SIMPLE_FITS, L>(&self.radial_index, radial);
        // Interpolated values do not exceed the entries of the table.
        let falloff = tap
            .fit_within::<SIMPLE_FITS, L>(self.table.fit(), self.table.exact_lanes(radial_index));
        [
            radial_index,
            tap.fit_unsigned::<SIMPLE_FITS, L>(&self.weight, L::splat(amplitude) * falloff),
        ]
    }
}

//! Map: colours over a square, bilinearly interpolated from a table of 2^k × 2^k texels.
//!
//! The table is on the chip, or in memory behind a cache of its lines.
//!
//! ```text
//! u, v ─►(× 2^k − 1)─►[ index | fraction ]─► four texels ─►(interpolate along u)─► two ─►(interpolate along v)─► light
//! ```
//! The first and the last texel of a row are on the edges of the square, so addresses do not wrap:
//! 2^k texels are 2^k − 1 steps.
//!
//! Losses: `fraction` is rounded; each interpolation is rounded to the word of the texels.
//!
//! Laws: `corners_are_texels`, `light_lies_among_its_texels`.

use crate::elaboration::latency::Path;
use crate::elaboration::{Elaboration, Operator};
use crate::num::{Exact, Fit, Format, Word, three};
use crate::probe::{NoProbe, Probe, Tap};

/// An elaborated map.
#[derive(Clone, Debug)]
pub struct Map {
    index_bits: u32,
    /// Fraction bits of a coordinate on the square.
    place_bits: u32,
    fraction: Fit,
    light: Fit,
    /// 1 as a fraction.
    one: i64,
}

/// Bits of a line's tag: address, and time of last use.
const TAG_BITS: i32 = 32;

/// Words of a map.
#[derive(Clone, Copy, Debug)]
pub struct Words {
    /// Side of the map: 2^this texels.
    pub index_bits: u32,
    /// Fraction bits of a coordinate from 0 to 1.
    pub place_bits: i32,
    /// Position between two texels.
    pub fraction: Word,
    /// A texel.
    pub light: Word,
    /// Lines per set, if a cache holds the texels; none if a table holds all of them.
    pub cached: Option<u32>,
}

/// Critical path from a coordinate to its light.
pub fn path(words: &Words) -> Path {
    let [fraction, light] = [words.fraction, words.light].map(|word| word.format.width());
    let line = Path::default()
        .sum(light)
        .product(light + 1, fraction)
        .sum(light + fraction)
        .fit(light);
    let index_bits = words.index_bits.min(64) as i32;
    let placed = Path::default()
        .sum(words.place_bits + index_bits)
        .fit(fraction);
    let read = match words.cached {
        None => placed.table(2 * index_bits),
        // Tags, then a multiplexer over the set.
        Some(ways) => placed
            .memory()
            .sum(2 * index_bits)
            .choose(ways.clamp(1, 64)),
    };
    read.then(line.times(2))
}

impl Map {
    /// Elaborates a unit's map. Its fraction and texels are the unit's words `fraction` and
    /// `light`.
    pub fn new(e: &mut Elaboration, unit: &'static str, words: Words) -> Self {
        let Words {
            index_bits,
            place_bits,
            fraction,
            light,
            cached,
        } = words;
        let place_bits = place_bits.clamp(0, 40) as u32;
        // u·2^k − u, per axis.
        e.adders(unit, 2, place_bits as i32 + index_bits as i32);
        // The last step includes the last texel.
        e.copies(2, |e| e.limit(unit, index_bits as i32));
        // Four texels are read in parallel, one from each of four tables: even and odd columns and
        // rows.
        let texels = 1 << (2 * index_bits - 2);
        // The lines of a cache are counted as storage; only read multiplexers and tag comparators
        // are counted here.
        let kept = if cached.is_some() { 0 } else { texels };
        e.copies(4, |e| {
            e.part(unit, Operator::Rom([kept, 3 * light.format.width()]))
        });
        if let Some(ways) = cached {
            let ways = ways.clamp(1, 64);
            e.copies(4, |e| {
                e.adders(unit, ways, TAG_BITS);
                e.choice(unit, ways, 3 * light.format.width());
            });
        }
        e.copies(2, |e| e.choice(unit, 4, 3 * light.format.width()));
        // Two interpolations along u and one along v, for three channels: a difference times a
        // fraction, plus the start.
        let line = e.copies(9, |e| {
            e.part(unit, Operator::Adder(light.format.width() + 1));
            let step = Format {
                signed: true,
                int_bits: light.format.int_bits + 1,
                ..light.format
            };
            let rise = e.times(unit, step, fraction);
            e.part(unit, Operator::Adder(rise.bits()));
            Exact {
                int_bits: light.format.int_bits,
                ..rise
            }
        });
        e.copies(2, |e| e.limit(unit, fraction.format.width()));
        let between = Exact {
            int_bits: 1,
            frac_bits: place_bits as i32,
        };
        Map {
            index_bits,
            place_bits,
            fraction: e.copies(2, |e| e.fit(unit, "fraction", fraction, between)),
            light: e.copies(9, |e| e.fit(unit, "light", light, line)),
            one: fraction.format.one(),
        }
    }

    /// Side of the map, texels.
    pub fn side(&self) -> usize {
        1 << self.index_bits
    }

    /// The step that contains a coordinate, and the fraction within it.
    fn step<P: Probe>(&self, place: i64, tap: &mut Tap<P>) -> (usize, i64) {
        let steps = (1 << self.index_bits) - 1;
        let exact = place * steps;
        let index = (exact >> self.place_bits).min(steps - 1);
        let fraction = tap
            .fit_one(&self.fraction, exact - (index << self.place_bits))
            .min(self.one);
        (index as usize, fraction)
    }

    /// Column and row of the first of the four texels around a point.
    pub fn texel(&self, place: [i64; 2]) -> [usize; 2] {
        place.map(|place| self.step(place, &mut Tap::new(&mut NoProbe)).0)
    }

    /// Interpolates between two texels.
    fn line<P: Probe>(
        &self,
        from: [i64; 3],
        to: [i64; 3],
        fraction: i64,
        tap: &mut Tap<P>,
    ) -> [i64; 3] {
        tap.fit_three(
            &self.light,
            three!(i => from[i] * self.one + (to[i] - from[i]) * fraction),
        )
    }

    /// Light at a point, whose coordinates go from 0 to 1 with the elaborated fraction bits.
    /// `texels` are row by row.
    pub fn light<P: Probe>(
        &self,
        texels: &[[i64; 3]],
        [u, v]: [i64; 2],
        tap: &mut Tap<P>,
    ) -> [i64; 3] {
        let ((column, right), (row, down)) = (self.step(u, tap), self.step(v, tap));
        if P::WORK {
            tap.probe.looked_up([column, row].map(|at| at as u8));
        }
        let above = (row << self.index_bits) + column;
        let below = above + self.side();
        let upper = self.line(texels[above], texels[above + 1], right, tap);
        let lower = self.line(texels[below], texels[below + 1], right, tap);
        self.line(upper, lower, down, tap)
    }
}

pub mod real;

#[cfg(test)]
mod tests;

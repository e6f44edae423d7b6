//! Map over the reals: exact texels next to the machine's, and a bound of the light's error between
//! them.
//!
//! ```text
//! coordinate off by d   light moves by at most d·(2^k − 1) times the greatest step between neighbouring texels in reach
//! fraction              its rounding and its limit move the coordinate by that fraction of a step
//! light                 texels: the error of their words; each interpolation: its rounding
//! ```
//! At any point, light is between the least and the greatest texel in reach. The smaller of both
//! bounds is used.

use super::Map;
use crate::num::Fit;
use crate::num::real::power_of_two;

/// A map, and the exact values of its texels.
#[derive(Clone, Debug)]
pub struct RealMap {
    map: Map,
    exact: Vec<[f64; 3]>,
    held: Vec<[f64; 3]>,
}

/// The first and the last step that can contain a coordinate.
type Steps = [usize; 2];

impl RealMap {
    /// From exact texels and their words, row by row.
    pub fn new(map: &Map, exact: Vec<[f64; 3]>, words: &[[i64; 3]]) -> Self {
        let value = |word: i64| map.light.word.format.value(word);
        RealMap {
            map: map.clone(),
            exact,
            held: words.iter().map(|texel| texel.map(value)).collect(),
        }
    }

    /// The fit of a fraction.
    pub fn fraction(&self) -> &Fit {
        &self.map.fraction
    }

    /// The fit of an interpolation.
    pub fn light(&self) -> &Fit {
        &self.map.light
    }

    /// The step that contains a coordinate from 0 to 1, and the fraction within it.
    pub fn step(&self, place: f64) -> (usize, f64) {
        let steps = (self.map.side() - 1) as f64;
        let exact = place.clamp(0.0, 1.0) * steps;
        let index = exact.floor().min(steps - 1.0);
        (index as usize, exact - index)
    }

    /// A texel, exact or as the machine's word.
    pub fn texel(&self, held: bool, column: usize, row: usize) -> [f64; 3] {
        (if held { &self.held } else { &self.exact })[(row << self.map.index_bits) + column]
    }

    /// Exact light at a point.
    pub fn exact(&self, [u, v]: [f64; 2]) -> [f64; 3] {
        let ((column, right), (row, down)) = (self.step(u), self.step(v));
        std::array::from_fn(|i| {
            let line = |row: usize| {
                let [from, to] =
                    [column, column + 1].map(|column| self.texel(false, column, row)[i]);
                from + (to - from) * right
            };
            let (upper, lower) = (line(row), line(row + 1));
            upper + (lower - upper) * down
        })
    }

    /// Bound of the error of the machine's light, if its point is within these limits.
    pub fn error(&self, at: [f64; 2], low: [f64; 2], high: [f64; 2]) -> [f64; 3] {
        let steps = (self.map.side() - 1) as f64;
        let places = [0, 1].map(|axis| [self.step(low[axis]).0, self.step(high[axis]).0]);
        let [down, up] = self.map.fraction.word.loss();
        let place = power_of_two(-self.map.fraction.word.format.frac_bits);
        // In steps. A fraction that is rounded up is at most 1.
        let moved = [0, 1].map(|axis| {
            let off = (at[axis].clamp(0.0, 1.0) - low[axis].clamp(0.0, 1.0))
                .max(high[axis].clamp(0.0, 1.0) - at[axis].clamp(0.0, 1.0));
            off.max(0.0) * steps + down.max(up) * place
        });
        let [less, more] = self.map.light.word.loss();
        let rounding = less.max(more) * power_of_two(-self.map.light.word.format.frac_bits);
        let exact = self.exact(at);
        let Met {
            least,
            most,
            slope,
            lost,
        } = self.met(places);
        std::array::from_fn(|i| {
            let slid = slope[0][i] * moved[0] + slope[1][i] * moved[1];
            let range = (most[i] - exact[i]).max(exact[i] - least[i]).max(0.0);
            // Two interpolations; the second scales the error of the first by at most 1.
            slid.min(range) + lost[i] + 2.0 * rounding + 1e-12 * most[i].abs()
        })
    }

    /// Texels in reach of these steps.
    fn met(&self, [columns, rows]: [Steps; 2]) -> Met {
        let mut met = Met {
            least: [f64::INFINITY; 3],
            most: [f64::NEG_INFINITY; 3],
            slope: [[0.0; 3]; 2],
            lost: [0.0; 3],
        };
        let [last_column, last_row] = [columns[1] + 1, rows[1] + 1];
        for row in rows[0]..=last_row {
            for column in columns[0]..=last_column {
                let (here, held) = (
                    self.texel(false, column, row),
                    self.texel(true, column, row),
                );
                let right = (column < last_column).then(|| self.texel(false, column + 1, row));
                let below = (row < last_row).then(|| self.texel(false, column, row + 1));
                for i in 0..3 {
                    met.least[i] = met.least[i].min(here[i]);
                    met.most[i] = met.most[i].max(here[i]);
                    met.lost[i] = met.lost[i].max((held[i] - here[i]).abs());
                    for (axis, next) in [right, below].into_iter().enumerate() {
                        met.slope[axis][i] = met.slope[axis][i]
                            .max(next.map_or(0.0, |next| (next[i] - here[i]).abs()));
                    }
                }
            }
        }
        met
    }
}

/// Extremes of the texels in reach.
struct Met {
    least: [f64; 3],
    most: [f64; 3],
    /// Greatest step between neighbours, along each axis.
    slope: [[f64; 3]; 2],
    /// Greatest error of a word.
    lost: [f64; 3],
}

//! Raster over the reals: bounds the distance of r and z at a pixel from the exact ones.
//!
//! The adds are exact. r at (i, j) columns and rows from the seed is therefore dᵀQd of the
//! machine's own Q and d, plus the rounding errors of its seed and its differences
//! (docs/book/algorithm.md §4):
//! ```text
//! |Δr| ≤ |d|ᵀ ΔQ |d| + 2·|Q d|·Δd + Δdᵀ |Q| Δd                                      other words than the exact ones
//!      + e₀ + (i + j)·e₁ + (C(i,2) + C(j,2) + i·j)·e₂                               rounded seed and differences
//! e₀ = (|d_x| + |d_y|)·u_gradient/2 + u_radial/2 at the seed,  e₁ = u_first/2,  e₂ = u_second/2
//! ```
//! A register whose range r exceeds, or a saturated difference, may hold anything.
//!
//! [`Rows::Direct`] rounds three squares instead, each by at most s: the last line is
//! (|Q00| + 2·|Q01| + |Q11|)·s + u_radial/2.

use super::{Raster, Rows, square};
use crate::machine::Machine;
use crate::num::{Fit, Word, two};
use crate::real::{MixedPrecision, Near, Real, Scale, power_of_two};
use std::ops::Range;

/// Input port.
#[derive(Clone, Copy, Debug)]
pub struct Input<R> {
    /// Centre from the picture's middle, pixels.
    pub pixel: [R; 2],
    /// Q00, Q01, Q11.
    pub conic: [R; 3],
    /// t_z, machine units.
    pub depth: R,
    /// z_x, z_y.
    pub depth_slope: [R; 2],
    /// Half-width of the depth clamp.
    pub depth_range: R,
}

/// Greatest loss by fitting a result of a magnitude up to `most` to a word in range; 0 where no
/// places are dropped.
fn loss(fit: &Fit, most: f64) -> f64 {
    let format = fit.word.format;
    if fit.places() <= 0 && !format.is_float() {
        return 0.0;
    }
    let [down, up] = fit.word.loss();
    down.max(up) * format.ulp_at(most) * power_of_two(-format.frac_bits)
}

/// Whether a number may be outside a word's range.
fn outruns(fit: &Fit, most: f64) -> bool {
    let format = fit.word.format;
    // NaN counts as outside.
    most.partial_cmp(&format.value(format.max()))
        .is_none_or(std::cmp::Ordering::is_gt)
}

/// Sum of rounding errors of differences on the way: e₁ per step, e₂ per pair of steps. Rows that
/// are seeded again take no steps.
fn stepped(rows: Rows, [columns, lines]: [f64; 2], first: f64, second: f64) -> f64 {
    let [i, j] = match rows {
        Rows::Direct => return 0.0,
        Rows::Seeded => [columns, 0.0],
        Rows::Differenced => [columns, lines],
    };
    let pairs = |n: f64| n * (n - 1.0).max(0.0) / 2.0;
    (i + j) * first + (pairs(i) + pairs(j) + i * j) * second
}

/// Errors of a splat's differences, computed once for all of its pixels.
#[derive(Clone, Copy, Debug)]
pub struct Walk {
    input: Input<Near>,
    /// Error of pixel and offset together.
    offset_error: [f64; 2],
    /// e₀.
    seed: f64,
    /// From the seed's pixel to the centre, pixels.
    seed_at: [f64; 2],
    /// e₁, e₂.
    steps: [f64; 2],
    /// Whether every difference is in its word's range.
    sound: bool,
    /// Greatest r that the register holds.
    most: f64,
}

impl Raster {
    /// Whether a pixel with this r makes a fragment.
    pub fn keeps(&self, radial: f64, cutoff: f64) -> bool {
        radial < cutoff && (self.rows != Rows::Direct || radial >= 0.0)
    }

    /// Whether each pixel has offsets of its own.
    pub fn is_direct(&self) -> bool {
        self.rows == Rows::Direct
    }

    /// Enters a box whose first pixel is within `reach` pixels of the centre; all its pixels are,
    /// with [`Rows::Direct`].
    pub fn near(&self, input: &Input<Near>, reach: [f64; 2]) -> Walk {
        let offset_error = two!(axis => {
            let error = input.pixel[axis].error;
            error + loss(&self.offset, reach[axis] + error)
        });
        let [xx, xy, yy] = [0, 1, 2].map(|i| input.conic[i].most());
        let [x, y] = two!(axis => reach[axis] + offset_error[axis]);
        let radial = loss(&self.radial, f64::INFINITY);
        let most = self.radial.word.format.value(self.radial.word.format.max());
        if let Some(square) = &self.square {
            let greatest = x.max(y) * x.max(y);
            let lost = loss(square, greatest);
            return Walk {
                input: *input,
                offset_error,
                seed: (xx + 2.0 * xy + yy) * lost + radial,
                seed_at: reach,
                steps: [0.0; 2],
                sound: !outruns(&self.offset, x.max(y)) && !outruns(square, greatest + lost),
                most,
            };
        }
        let steepest = (xx * x + 2.0 * xy * y).max(yy * y);
        let gradient = loss(&self.gradient, steepest);
        let [first, second] = [&self.first, &self.second].map(|fit| loss(fit, f64::INFINITY));
        let sound = !outruns(&self.offset, x.max(y))
            && !outruns(&self.gradient, steepest + gradient)
            && !outruns(
                &self.first,
                (2.0 * xx * x + xx + 2.0 * xy * y).max(2.0 * yy * y + yy + 2.0 * xy * x) + first,
            )
            && !outruns(&self.second, 2.0 * xx.max(yy).max(xy) + second);
        Walk {
            input: *input,
            offset_error,
            seed: (x + y) * gradient + radial,
            seed_at: reach,
            steps: [first, second],
            sound,
            most,
        }
    }

    /// r at a pixel centre, relative to the picture's middle.
    pub fn near_radial(&self, walk: &Walk, at: [f64; 2]) -> Near {
        let d = two!(axis => at[axis] - walk.input.pixel[axis].value);
        let [ex, ey] = walk.offset_error;
        let [xx, xy, yy] = walk.input.conic;
        let along = [
            xx.value * d[0] + xy.value * d[1],
            xy.value * d[0] + yy.value * d[1],
        ];
        let value = along[0] * d[0] + along[1] * d[1];
        if !walk.sound {
            return Near {
                value,
                error: f64::INFINITY,
            };
        }
        let [x, y] = [d[0].abs() + ex, d[1].abs() + ey];
        let conic = xx.error * x * x + 2.0 * xy.error * x * y + yy.error * y * y;
        let moved = 2.0 * (along[0].abs() * ex + along[1].abs() * ey)
            + xx.value.abs() * ex * ex
            + 2.0 * xy.value.abs() * ex * ey
            + yy.value.abs() * ey * ey;
        // Rounding of the f64 sum above: the terms of a needle cancel.
        let rounding = 8.0
            * f64::EPSILON
            * (xx.value.abs() * x * x + 2.0 * xy.value.abs() * x * y + yy.value.abs() * y * y);
        let radial = Near::within(value, conic + moved + rounding + self.walked(walk, d));
        // NaN counts as out of range.
        if radial.most() <= walk.most {
            radial
        } else {
            Near {
                value,
                error: f64::INFINITY,
            }
        }
    }

    /// Sum of the rounding errors of seed and differences at a pixel.
    fn walked(&self, walk: &Walk, d: [f64; 2]) -> f64 {
        let steps =
            two!(axis => (d[axis] + walk.seed_at[axis] + walk.offset_error[axis] + 1.0).max(0.0));
        let [first, second] = walk.steps;
        walk.seed + stepped(self.rows, steps, first, second)
    }

    /// z at a pixel centre, clamped to the disc's depth range.
    pub fn near_depth(&self, walk: &Walk, at: [f64; 2]) -> Near {
        let input = &walk.input;
        let d =
            two!(axis => Near::within(at[axis] - input.pixel[axis].value, walk.offset_error[axis]));
        let plane = input.depth + input.depth_slope[0] * d[0] + input.depth_slope[1] * d[1];
        let held = plane.off_by(loss(&self.depth, f64::INFINITY));
        let held = if outruns(&self.depth, held.most()) {
            Near {
                error: f64::INFINITY,
                ..held
            }
        } else {
            held
        };
        held.max(input.depth - input.depth_range)
            .min(input.depth + input.depth_range)
    }
}

/// Registers at the first pixel of a row of the box, and their differences.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a> {
    /// Where each pixel is evaluated: Q, the centre's column from the row's first pixel, and dy.
    direct: Option<[MixedPrecision<'a>; 5]>,
    radial: MixedPrecision<'a>,
    first: MixedPrecision<'a>,
    second: MixedPrecision<'a>,
    depth: MixedPrecision<'a>,
    depth_step: MixedPrecision<'a>,
    /// The depth clamp.
    limits: [MixedPrecision<'a>; 2],
}

impl Raster {
    /// Registers at the first pixels of `rows` rows of a box. `[left, top]` is the box's first pixel
    /// relative to the picture's middle.
    pub fn mixed_precision_rows<'a>(
        &self,
        input: &Input<MixedPrecision<'a>>,
        [left, top]: [f64; 2],
        rows: Range<u32>,
    ) -> impl Iterator<Item = Row<'a>> {
        let [xx, xy, yy] = input.conic;
        let [by_x, by_y] = input.depth_slope;
        let limits = [
            input.depth - input.depth_range,
            input.depth + input.depth_range,
        ];
        let second = xx.times(2.0).fit(&self.second, Scale::ONE);
        let seed = move |down: f64| {
            let [x, y] = [(0, left), (1, top + down)]
                .map(|(axis, at)| (-input.pixel[axis]).plus(at).fit(&self.offset, Scale::ONE));
            let gradient = [
                (xx * x + (xy * y).times(2.0)).fit(&self.gradient, Scale::ONE),
                (yy * y).fit(&self.gradient, Scale::ONE),
            ];
            let row = Row {
                direct: (self.rows == Rows::Direct)
                    .then(|| [xx, xy, yy, input.pixel[0].plus(-left), y]),
                radial: (x * gradient[0] + y * gradient[1]).fit(&self.radial, Scale::ONE),
                first: ((xx * x + xy * y).times(2.0) + xx).fit(&self.first, Scale::ONE),
                second,
                depth: (by_x * x + by_y * y + input.depth).fit(&self.depth, Scale::ONE),
                depth_step: by_x,
                limits,
            };
            (
                row,
                ((yy * y + xy * x).times(2.0) + yy).fit(&self.first, Scale::ONE),
            )
        };
        let (at_box, by_row) = seed(0.0);
        let [by_row_twice, by_both] =
            [yy, xy].map(|conic| conic.times(2.0).fit(&self.second, Scale::ONE));
        rows.map(f64::from).map(move |down| match self.rows {
            Rows::Seeded | Rows::Direct => seed(down).0,
            Rows::Differenced => Row {
                radial: at_box.radial
                    + by_row.times(down)
                    + by_row_twice.times(down * (down - 1.0) / 2.0),
                first: at_box.first + by_both.times(down),
                depth: at_box.depth + by_y.times(down),
                ..at_box
            },
        })
    }

    /// r and z at some columns from the first pixel of a row. r may be below 0; z is clamped to the
    /// disc's depth range.
    pub fn mixed_precision_pixel<'a>(
        &self,
        row: &Row<'a>,
        columns: f64,
    ) -> [MixedPrecision<'a>; 2] {
        let radial = match (&self.square, row.direct) {
            (Some(square), Some([xx, xy, yy, centre, y])) => {
                let x = (-centre).plus(columns).fit(&self.offset, Scale::ONE);
                let [of_x, of_both, of_y] =
                    [x * x, x * y, y * y].map(|product| product.fit(square, Scale::ONE));
                (xx * of_x + (xy * of_both).times(2.0) + yy * of_y).fit(&self.radial, Scale::ONE)
            }
            _ => (row.radial
                + row.first.times(columns)
                + row.second.times(columns * (columns - 1.0) / 2.0))
            .wrapped(&self.radial),
        };
        let depth = (row.depth + row.depth_step.times(columns)).wrapped(&self.depth);
        let [nearest, deepest] = row.limits;
        [radial, depth.max(nearest).min(deepest)]
    }
}

/// Greatest distance of `raster.radial` from r = Q00·x² + 2·Q01·xy + Q11·y², in r, at `columns` and
/// `rows` steps from its seed. The conic and the offset are exact words, and |x| and |y| at the
/// seed are at most `reach_px`.
///
/// Adds are exact, so only the rounding of the added words remains (docs/book/algorithm.md §4).
/// Each word counts as often as it is added:
/// - `radial`, once, and the gradients at the seed, weighted by x and y;
/// - `first`, once per step;
/// - `second`, once per pair of steps: n(n−1)/2 along a row or a column, and, for steps in both
///   directions, their product.
///
/// A word that holds all places of its exact result loses nothing; twice a conic needs one place
/// less. Where each row is seeded again, steps between rows do not count. The bound is modulo the
/// register's range, and holds only where none of `gradient`, `first` and `second` saturates.
///
/// With [`Rows::Direct`], three squares and r are rounded, for any conic that its words hold.
pub fn steps_error(machine: &Machine, reach_px: f64, [columns, rows]: [u32; 2]) -> f64 {
    let m = &machine.raster;
    let conic = machine.ellipse.conic.format.frac_bits;
    let loss = |word: Word, exact_frac_bits: i32| {
        let format = word.format;
        if exact_frac_bits <= format.frac_bits && !format.is_float() {
            return 0.0;
        }
        let [down, up] = word.loss();
        down.max(up) * format.ulp_at(f64::INFINITY) * power_of_two(-format.frac_bits)
    };
    let offset = m.offset.format.frac_bits;
    if m.rows == Rows::Direct {
        let square = square(machine);
        let [along, across] = [machine.ellipse.conic, machine.ellipse.conic_cross].map(|word| {
            let format = word.format;
            format.value(format.max().max(-format.min()))
        });
        return 2.0 * (along + across) * loss(square, 2 * offset)
            + loss(m.radial, conic + square.format.frac_bits);
    }
    let gradient = loss(m.gradient, conic + offset);
    let seed = loss(m.radial, offset + m.gradient.format.frac_bits) + 2.0 * reach_px * gradient;
    let first = loss(m.first, conic + offset);
    let second = loss(m.second, conic - 1);
    seed + stepped(m.rows, [columns, rows].map(f64::from), first, second)
}

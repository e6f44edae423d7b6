//! Windows over the reals: bounds the errors of contributions blended into a closed slot, and of
//! what is seen through other slots.
//!
//! ```text
//! quotient  n/d: the share of n that goes with d normalised ½p(share), 1/d: ε, the fit: ½p(part); anything from 0 to 1 where d may be 0
//! late      C + (col − C)·β over the front, C + col·β·(1 − A) under the back
//! inside    C·(1 − a) + C_x·F, a = A_x·(F − T)/A; opacity 1 − (1 − A)·(1 − A_x)
//! T         a product of what windows and closed slots let through: ½p(through) each
//! ```
//! Depths are compared exactly: callers need no bound on them.
//!
//! Law of the whole: `no_pixel_of_a_machine_of_windows_exceeds_its_bound` (tests/windows.rs).

use super::{Fragment, WindowDatapath, WindowRegisters};
use crate::functions::Table;
use crate::machine::Interpolation;
use crate::num::Fit;
use crate::num::real::power_of_two;
use crate::real::{Real, Scale};
use crate::records::WEIGHT;

/// A closed slot.
#[derive(Clone, Copy, Debug)]
pub struct Closed<R> {
    /// Premultiplied colour and opacity, as kept in the slot.
    pub light: [R; 4],
    /// Wl and Wh.
    pub weights: [R; 2],
    /// TF and TB.
    pub through: [R; 2],
}

/// A contribution by itself.
#[derive(Clone, Copy, Debug)]
pub struct Single<R> {
    /// w.
    pub weight: R,
    /// α.
    pub opacity: R,
    /// The splat's own colour under the lights.
    pub light: [R; 3],
}

/// The functions in a frame's tables, and the errors of the tables.
#[derive(Clone, Debug)]
pub struct Tables {
    /// −2·ln(1 − min(α, 0.95)).
    pub density: fn(f64) -> f64,
    /// Error of each step of the density table, before the result is fitted.
    density_errors: Vec<f64>,
}

impl Tables {
    /// Tables for a density that is a nondecreasing function.
    pub fn new(registers: &WindowRegisters, range: f64, density: fn(f64) -> f64) -> Self {
        Tables {
            density,
            density_errors: errors(&registers.density, range, density),
        }
    }

    /// Greatest error for an argument that may be one step off.
    fn density_error(&self, part: f64) -> f64 {
        let steps = self.density_errors.len();
        let at = ((part * steps as f64).max(0.0) as usize).min(steps - 1);
        self.density_errors[at.saturating_sub(1)..=(at + 1).min(steps - 1)]
            .iter()
            .copied()
            .fold(0.0, f64::max)
    }
}

/// Greatest distance of a table from a nondecreasing function, per step: the function's rise in the
/// step, and half an ulp of the table's words.
fn errors(table: &Table, range: f64, function: fn(f64) -> f64) -> Vec<f64> {
    let (width, place) = (
        table.step() * range,
        power_of_two(-table.fit().word.format.frac_bits),
    );
    let steps = (1.0 / table.step()).round() as usize;
    let error = |step: usize| {
        let [low, middle, high] =
            [0.0, 0.5, 1.0].map(|part| function((step as f64 + part) * width));
        let most = table.fit().word.format.value(table.fit().word.format.max());
        // A saturated word is off by the excess.
        let beyond = (high - most).max(0.0);
        let apart = match table.interpolation() {
            Interpolation::Nearest => (middle - low).max(high - middle),
            Interpolation::Linear => high - low,
        };
        apart + place / 2.0 + beyond
    };
    (0..steps).map(error).collect()
}

impl WindowDatapath {
    /// A quotient of non-negative numbers, at most 1.
    fn real_quotient<R: Real>(&self, numerator: R, denominator: R, share: &Fit) -> R {
        let zero = numerator.constant_like(0.0);
        let divide = || {
            let quotient = numerator
                .divided_by(denominator)
                .share(share, denominator)
                .restored(&self.reciprocal, denominator);
            [quotient
                .fit(&self.part, Scale::ONE)
                .at_most(1.0)
                .at_least(0.0)]
        };
        let [quotient] = (-numerator).branch(zero, || [zero], divide);
        quotient
    }
}

impl Fragment {
    fn real_windows(&self) -> &WindowDatapath {
        self.windows
            .as_ref()
            .expect("fragments that are grouped by windows")
    }

    /// Opacity of sums: Σw·α/max(W, τ).
    pub fn real_window_opacity<R: Real>(&self, weight: R, opacity: R, coverage_threshold: R) -> R {
        let own = self.real_windows();
        own.real_quotient(opacity, weight.max(coverage_threshold), &own.shares[0])
    }

    /// Transmittance behind a window of this opacity.
    pub fn real_through_window<R: Real>(&self, through: R, opacity: R) -> R {
        (through * (through.constant_like(1.0) - opacity))
            .fit(&self.real_windows().through[0], Scale::ONE)
    }

    /// Transmittance behind a closed slot too, or within it.
    pub fn real_through_closed<R: Real>(&self, through: R, behind: R) -> R {
        (through * behind).fit(&self.real_windows().through[1], Scale::ONE)
    }

    /// 1 − A of a shaded opacity, in the format of TF.
    pub fn real_rest<R: Real>(&self, opacity: R) -> R {
        (opacity.constant_like(1.0) - opacity)
            .refit(
                self.premultiplied_frac_bits as i32,
                &self.real_windows().rest,
            )
            .at_least(0.0)
    }

    /// Σw of a closed slot's part after one more contribution.
    fn real_weight_after<R: Real>(&self, weight: R, more: R) -> R {
        self.real_accumulated(WEIGHT, weight, more, more.constant_like(1.0))
    }

    /// Σw·z after one more contribution.
    pub fn real_depth_sum<R: Real>(&self, sum: R, weight: R, depth: R) -> R {
        (sum + weight * depth).fit(&self.real_windows().depth_sum, Scale::ONE)
    }

    /// A sum of two slots.
    pub fn real_two<R: Real>(&self, lane: usize, sum: R) -> R {
        sum.fit(&self.real_windows().sums[lane], Scale::ONE)
    }

    /// Σw·z of two slots.
    pub fn real_depth_of_two<R: Real>(&self, sum: R) -> R {
        sum.fit(&self.real_windows().depth_of_two, Scale::ONE)
    }

    /// The fit of Σw·z.
    pub fn depth_sum_fit(&self) -> &Fit {
        &self.real_windows().depth_sum
    }

    /// A slot that was shaded and closes, from shade's result.
    pub fn real_closed<R: Real>(&self, shaded: [R; 4], weight: R) -> Closed<R> {
        let through = [self.real_rest(shaded[3]), weight.constant_like(1.0)];
        Closed {
            light: self.real_stored_words(shaded),
            weights: [weight; 2],
            through,
        }
    }

    /// Words of a shaded fragment in a slot.
    fn real_stored_words<R: Real>(&self, [r, g, b, opacity]: [R; 4]) -> [R; 4] {
        let [of_colour, of_opacity] = &self.store;
        let places = self.premultiplied_frac_bits as i32;
        let [r, g, b] = [r, g, b].map(|channel| channel.refit(places, of_colour));
        [r, g, b, opacity.refit(places, of_opacity)]
    }

    /// Merges another closed slot behind this one; `is_farther` if its back is the farther one.
    pub fn real_put_behind<R: Real>(
        &self,
        front: &mut Closed<R>,
        back: &Closed<R>,
        is_farther: bool,
    ) {
        let (over, under) = (self.real_read(front.light), self.real_read(back.light));
        if is_farther {
            let through = (over[3].constant_like(1.0) - over[3]).at_least(0.0);
            front.through[1] =
                (back.through[1] * through).fit(&self.real_windows().dimmed[1], Scale::ONE);
            front.weights[1] = back.weights[1];
        }
        front.light = self.real_blend(over, under);
    }

    /// Blends x between a slot's front and its back, `nearer_the_back` or not.
    pub fn real_put_inside<R: Real>(&self, slot: &mut Closed<R>, x: [R; 4], nearer_the_back: bool) {
        let own = self.real_windows();
        let light = self.real_read(slot.light);
        let one = light[3].constant_like(1.0);
        let through = self.real_rest(light[3]);
        let mut seen = slot.through[0].max(through);
        if nearer_the_back {
            seen = slot.through[1].max(through).min(seen);
        }
        let lost = own.real_quotient(x[3] * (seen - through), light[3], &own.shares[2]);
        let behind = (one - x[3]).at_least(0.0);
        let [r, g, b] = [0, 1, 2]
            .map(|i| (light[i] - light[i] * lost + x[i] * seen).fit(&own.within[0], Scale::ONE));
        let opacity = one - (one - light[3]).at_least(0.0) * behind;
        slot.light = [r, g, b, opacity.fit(&own.within[1], Scale::ONE)];
        slot.through[1] = (slot.through[1] * behind).fit(&own.dimmed[1], Scale::ONE);
    }

    /// A contribution by itself, as a layer inside a closed slot; `opacity` is α of the scene.
    pub fn real_splat_inside<R: Real>(
        &self,
        single: &Single<R>,
        opacity: f64,
        registers: &WindowRegisters,
        tables: &Tables,
    ) -> [R; 4] {
        let own = self.real_windows();
        let range = power_of_two(own.opacity_range);
        let error = tables.density_error(opacity / range);
        let density = single
            .opacity
            .table(&registers.density, range, tables.density, |_| error)
            .fit(&own.density, Scale::ONE);
        let x = (single.weight * density).fit(&own.index, Scale::ONE);
        let range = power_of_two(own.index.word.format.int_bits);
        let hidden = &registers.hidden;
        // 1 − e^(−x) and its derivatives are at most 1.
        let error = crate::functions::table::real::error(
            hidden.fit(),
            hidden.interpolation(),
            hidden.step() * range,
            1.0,
            1.0,
        );
        let hidden = x
            .table(hidden, range, |x| -(-x).exp_m1(), |_| error)
            .fit(&own.hidden, Scale::ONE);
        let opacity = hidden
            .refit(own.hidden.word.format.frac_bits, &own.splat[0])
            .at_most(1.0);
        let [r, g, b] = single
            .light
            .map(|channel| (channel * opacity).fit(&own.splat[1], Scale::ONE));
        [r, g, b, opacity]
    }

    /// A late contribution, to the front (0) or the back (1) of a closed slot.
    pub fn real_late<R: Real>(
        &self,
        slot: &mut Closed<R>,
        side: usize,
        single: &Single<R>,
        coverage_threshold: R,
    ) {
        let own = self.real_windows();
        let had = slot.weights[side];
        let (zero, one) = (had.constant_like(0.0), had.constant_like(1.0));
        let weighs = self.real_weight_after(zero, single.weight);
        slot.weights[side] = self.real_weight_after(had, single.weight);
        let adds = single.opacity * weighs.min((coverage_threshold - had).max(zero));
        let room = coverage_threshold - single.opacity * had.min(coverage_threshold);
        let share = own.real_quotient(adds, room, &own.shares[1]);
        let light = self.real_read(slot.light);
        let colour = |share: R, behind: bool, fit: &Fit| {
            [0, 1, 2].map(|i| {
                let own = if behind {
                    single.light[i]
                } else {
                    single.light[i] - light[i]
                };
                (light[i] + own * share).fit(fit, Scale::ONE)
            })
        };
        let (colour, opacity) = if side == 0 {
            for kept in &mut slot.through {
                *kept = (*kept * (one - share)).fit(&own.dimmed[0], Scale::ONE);
            }
            (
                colour(share, false, &own.over[0]),
                (one - (one - light[3]) * (one - share)).fit(&own.over[1], Scale::ONE),
            )
        } else {
            let seen = (share * (one - light[3]).at_least(0.0))
                .fit(&own.under, Scale::ONE)
                .at_most(1.0);
            (
                colour(seen, true, &own.beneath[0]),
                (light[3] + seen).fit(&own.beneath[1], Scale::ONE),
            )
        };
        let [r, g, b] = colour;
        slot.light = [r, g, b, opacity];
    }
}

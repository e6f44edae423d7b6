//! Mixed precision: a machine in which some signals are words, and the others are f64.
//!
//! ```text
//! units over the reals ─►[ fit: is this signal on? ]─┬─ yes ─► the machine's word
//!                                                    └─ no ──► the number, unchanged
//! ```
//! With all signals off it is the exact pipeline. With all on it is the machine, except for
//! products of more than 53 bits, which f64 rounds. Combinations in between attribute an error:
//! only one unit in words, or all words except its own.
//!
//! Laws: `all_on_a_fit_is_the_machines`, `all_on_a_function_is_the_units`,
//! `all_off_nothing_is_lost`; for whole frames, tests/attribution.rs.

use super::{Direction, Real, Scale, floor_log2, norm, power_of_two};
use crate::functions::map::real::RealMap;
use crate::functions::table::real::Power;
use crate::functions::{Reciprocal, ReciprocalRoot, Table};
use crate::num::{Fit, Overflow, Word};
use std::ops::{Add, Mul, Neg, Sub};

/// The signals that are words, by their index in the elaborated machine's list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Switches(pub Vec<bool>);

/// A number of such a machine.
#[derive(Clone, Copy, Debug)]
pub struct MixedPrecision<'a> {
    /// Its value.
    pub value: f64,
    /// None for a constant.
    switches: Option<&'a Switches>,
}

/// A number in ulp as a word.
fn in_word(word: Word, places: f64) -> f64 {
    let rounded = word.rounded_real(places);
    let (least, most) = (word.format.min() as f64, word.format.max() as f64);
    match word.overflow {
        Overflow::Saturate => rounded.clamp(least, most),
        Overflow::Wrap => {
            // Numbers far outside the range would lose their low bits in an addition.
            let values = most - least + 1.0;
            let wrapped = rounded.rem_euclid(values);
            if wrapped > most {
                wrapped - values
            } else {
                wrapped
            }
        }
    }
}

impl<'a> MixedPrecision<'a> {
    /// A number of a machine with these switches.
    pub fn new(value: f64, switches: &'a Switches) -> Self {
        MixedPrecision {
            value,
            switches: Some(switches),
        }
    }

    /// Whether a fit's signal is on.
    pub fn is_on(self, fit: &Fit) -> bool {
        self.switches.is_some_and(|switches| switches.0[fit.signal])
    }

    /// Whether a function unit with this result is on, and accepts the number. Splats behind the
    /// eye, which are culled, also reach this point.
    fn is_taken(self, result: &Fit) -> bool {
        self.is_on(result) && self.value.is_normal() && self.value > 0.0
    }

    /// The number modulo the range of a register, if the register is on.
    pub fn wrapped(self, fit: &Fit) -> Self {
        if !self.is_on(fit) {
            return self;
        }
        let format = fit.word.format;
        let (least, reach) = (
            format.value(format.min()),
            power_of_two(format.width() - format.frac_bits),
        );
        if (least..least + reach).contains(&self.value) {
            return self;
        }
        // A register that follows a word that is off has bits below its LSB.
        self.with(least + (self.value - least).rem_euclid(reach))
    }

    fn with(self, value: f64) -> Self {
        MixedPrecision { value, ..self }
    }

    fn and(self, other: MixedPrecision<'a>, value: f64) -> Self {
        MixedPrecision {
            value,
            switches: self.switches.or(other.switches),
        }
    }
}

impl<'a> Add for MixedPrecision<'a> {
    type Output = MixedPrecision<'a>;
    fn add(self, other: MixedPrecision<'a>) -> MixedPrecision<'a> {
        self.and(other, self.value + other.value)
    }
}

impl<'a> Sub for MixedPrecision<'a> {
    type Output = MixedPrecision<'a>;
    fn sub(self, other: MixedPrecision<'a>) -> MixedPrecision<'a> {
        self.and(other, self.value - other.value)
    }
}

impl<'a> Mul for MixedPrecision<'a> {
    type Output = MixedPrecision<'a>;
    fn mul(self, other: MixedPrecision<'a>) -> MixedPrecision<'a> {
        self.and(other, self.value * other.value)
    }
}

impl<'a> Neg for MixedPrecision<'a> {
    type Output = MixedPrecision<'a>;
    fn neg(self) -> MixedPrecision<'a> {
        self.with(-self.value)
    }
}

/// A product without the last bits. They can be wrong after a division and a multiplication in f64,
/// and would break ties.
fn without_noise(product: f64) -> f64 {
    if product == 0.0 {
        return 0.0;
    }
    let places = 46 - floor_log2(product.abs());
    (product * power_of_two(places)).round() * power_of_two(-places)
}

impl Real for MixedPrecision<'_> {
    fn constant(value: f64) -> Self {
        MixedPrecision {
            value,
            switches: None,
        }
    }

    fn constant_like(self, value: f64) -> Self {
        self.with(value)
    }

    fn plus(self, constant: f64) -> Self {
        self.with(self.value + constant)
    }

    fn times(self, constant: f64) -> Self {
        self.with(self.value * constant)
    }

    fn fit(self, fit: &Fit, scale: Scale) -> Self {
        if !self.is_on(fit) {
            return self;
        }
        let places = fit.word.format.frac_bits - scale.low;
        self.with(in_word(fit.word, self.value * power_of_two(places)) * power_of_two(-places))
    }

    fn refit(self, _frac_bits: i32, fit: &Fit) -> Self {
        self.fit(fit, Scale::ONE)
    }

    fn divided_by(self, whole: Self) -> Self {
        let value = if whole.value == 0.0 {
            0.0
        } else {
            self.value / whole.value
        };
        self.and(whole, value)
    }

    fn share(self, fit: &Fit, whole: Self) -> Self {
        if !whole.is_on(fit) {
            return whole.with(self.value);
        }
        let mantissa = whole.value * power_of_two(-floor_log2(whole.value));
        let place = power_of_two(-fit.word.format.frac_bits);
        let places = without_noise(self.value * mantissa) / place;
        whole.with(in_word(fit.word, places) * place / mantissa)
    }

    fn restored(self, unit: &Reciprocal, whole: Self) -> Self {
        let restored = self * whole * whole.reciprocal(unit);
        if whole.is_on(unit.result()) {
            restored.with(without_noise(restored.value))
        } else {
            restored
        }
    }

    fn leading(self) -> Scale {
        let exponent = floor_log2(self.value.abs());
        Scale {
            low: exponent,
            high: exponent,
        }
    }

    fn abs(self) -> Self {
        self.with(self.value.abs())
    }

    fn max(self, other: Self) -> Self {
        self.and(other, self.value.max(other.value))
    }

    fn min(self, other: Self) -> Self {
        self.and(other, self.value.min(other.value))
    }

    fn at_least(self, limit: f64) -> Self {
        self.with(self.value.max(limit))
    }

    fn at_most(self, limit: f64) -> Self {
        self.with(self.value.min(limit))
    }

    fn below_one(self, fit: &Fit) -> Self {
        if self.is_on(fit) {
            self.at_most(1.0 - power_of_two(-fit.word.format.frac_bits))
        } else {
            self
        }
    }

    fn at_least_an_ulp(self, fit: &Fit, scale: Scale) -> Self {
        if self.is_on(fit) {
            self.at_least(power_of_two(scale.low - fit.word.format.frac_bits))
        } else {
            self
        }
    }

    fn an_ulp_more(self, fit: &Fit) -> Self {
        if self.is_on(fit) {
            self.plus(power_of_two(-fit.word.format.frac_bits))
        } else {
            self
        }
    }

    fn branch<const N: usize>(
        self,
        limit: Self,
        at_least: impl FnOnce() -> [Self; N],
        below: impl FnOnce() -> [Self; N],
    ) -> [Self; N] {
        if self.value >= limit.value {
            at_least()
        } else {
            below()
        }
    }

    fn reciprocal(self, unit: &Reciprocal) -> Self {
        self.with(if self.is_taken(unit.result()) {
            unit.of(self.value)
        } else {
            1.0 / self.value
        })
    }

    fn inverse_root(self, unit: &ReciprocalRoot) -> Self {
        self.with(if self.is_taken(unit.result()) {
            unit.of(self.value)
        } else {
            1.0 / self.value.sqrt()
        })
    }

    fn root(self, unit: &ReciprocalRoot) -> Self {
        self.with(if self.is_taken(unit.result()) {
            unit.root_of(self.value)
        } else {
            self.value.sqrt()
        })
    }

    fn with_sign_of(self, other: Self) -> Self {
        self.and(other, self.value.abs().copysign(other.value))
    }

    fn table(
        self,
        table: &Table,
        range: f64,
        exact: impl Fn(f64) -> f64,
        _error: impl Fn(f64) -> f64,
    ) -> Self {
        self.with(if self.is_on(table.fit()) {
            table.at(self.value / range)
        } else {
            exact(self.value)
        })
    }

    fn falloff(self, table: &Table, range: f64, error: f64) -> Self {
        self.table(table, range, super::falloff, |_| error)
    }

    fn power(self, table: &Power) -> Self {
        let words = table.table();
        self.with(if self.is_on(words.fit()) {
            words.at(self.value)
        } else {
            table.exact(self.value)
        })
        .fit(words.fit(), Scale::ONE)
    }

    fn look_up(place: [Self; 2], map: &RealMap) -> [Self; 3] {
        let held = place[0].is_on(map.light());
        let step = |place: Self| {
            let (index, fraction) = map.step(place.value);
            (
                index,
                place
                    .with(fraction)
                    .fit(map.fraction(), Scale::ONE)
                    .at_most(1.0)
                    .value,
            )
        };
        let ((column, right), (row, down)) = (step(place[0]), step(place[1]));
        let line = |from: f64, to: f64, fraction: f64| {
            place[0]
                .with(from + (to - from) * fraction)
                .fit(map.light(), Scale::ONE)
                .value
        };
        std::array::from_fn(|i| {
            let texel = |column: usize, row: usize| map.texel(held, column, row)[i];
            let [upper, lower] =
                [row, row + 1].map(|row| line(texel(column, row), texel(column + 1, row), right));
            place[0].with(line(upper, lower, down))
        })
    }

    fn length(v: [Self; 3]) -> Self {
        v[0].with(norm(v.map(|part| part.value)))
    }

    /// The unit's operands are the words of the shares, scaled as its normaliser scales `whole`.
    fn direction(v: [Self; 3], whole: Self, unit: &ReciprocalRoot) -> Direction<Self> {
        let mantissa = whole.value * power_of_two(-floor_log2(whole.value));
        let held = v.map(|part| part.with(without_noise(part.value * mantissa)));
        let [x, y, z] = held;
        let inverse = (x * x + y * y + z * z).inverse_root(unit);
        Direction {
            parts: held.map(|part| part * inverse),
            turn: 0.0,
        }
    }

    fn dot(direction: &Direction<Self>, v: [Self; 3]) -> Self {
        let [x, y, z] = [0, 1, 2].map(|i| direction.parts[i] * v[i]);
        x + y + z
    }
}

#[cfg(test)]
mod tests;

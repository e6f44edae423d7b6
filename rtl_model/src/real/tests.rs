//! Near, checked against numbers from its intervals; and shared parts of the units' tests: random
//! numbers, and random machines.

use super::*;
use crate::Machine;
use crate::elaboration::Elaboration;
use crate::functions::table::Table;
use crate::machine::{FunctionUnit, Interpolation};
use crate::num::tests::also_floating;
use crate::num::{Exact, Format, Rounding};
use serde_json::{Value, json};
use std::fmt::Debug;

/// Random numbers: xorshift.
pub struct Rng(u64);

impl Rng {
    pub fn new(seed: u64) -> Self {
        Rng(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11
    }

    /// From 0 to 1.
    pub fn part(&mut self) -> f64 {
        self.next() as f64 / (1u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.part()
    }

    /// 0 to `count` − 1.
    pub fn below(&mut self, count: u64) -> u64 {
        self.next() % count
    }

    pub fn one_of<T: Clone>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len() as u64) as usize].clone()
    }

    /// From 0 to 1, with the ends.
    pub fn channel(&mut self) -> f64 {
        match self.below(4) {
            0 => self.one_of(&[0.0, 1.0]),
            _ => self.part(),
        }
    }

    pub fn vector(&mut self) -> [f64; 3] {
        [0; 3].map(|_| self.between(-1.0, 1.0))
    }

    pub fn unit_vector(&mut self) -> [f64; 3] {
        loop {
            let v = self.vector();
            let length = norm(v);
            if length > 0.1 {
                return v.map(|x| x / length);
            }
        }
    }

    /// A named machine in which some words, tables and function units of sums, shading and blending
    /// are changed.
    pub fn machine(&mut self) -> Machine {
        let mut machine = Machine::named(self.one_of(&Machine::NAMES)).unwrap();
        for _ in 0..self.below(12) {
            let mut value = serde_json::to_value(&machine).unwrap();
            let unit = self.one_of(&["shade", "shade", "shade", "resolve", "fragment"]);
            let fields: Vec<String> = value[unit].as_object().unwrap().keys().cloned().collect();
            let field = self.one_of(&fields);
            if unit != "fragment" || field.ends_with("_sum") {
                self.change(&mut value[unit][&field]);
                let changed: Machine = serde_json::from_value(value).unwrap();
                machine = if changed.elaborate().is_ok() {
                    changed
                } else {
                    machine
                };
            }
        }
        machine
    }

    fn change(&mut self, leaf: &mut Value) {
        if leaf.get("table_bits").is_some() {
            *leaf = json!({ "table_bits": 1 + self.below(8), "newton_steps": self.below(3), "bits": 8 + self.below(18) });
        } else if leaf.get("index_bits").is_some() {
            let index_bits = 1 + self.below(9);
            *leaf = json!({ "index_bits": index_bits, "interpolation": self.one_of(&["nearest", "linear"]) });
        } else {
            let word: Word = serde_json::from_value(leaf.clone()).unwrap();
            let frac_bits = (word.format.frac_bits + self.below(16) as i32 - 10).max(0);
            let int_bits = word.format.int_bits + self.below(4) as i32 - 1;
            let format = Format {
                int_bits: int_bits.max(1 - frac_bits),
                frac_bits,
                significant_bits: 0,
                ..word.format
            };
            let format = also_floating(format, self.below(90) as u32);
            let round =
                self.one_of(&[Rounding::Truncate, Rounding::Nearest, Rounding::NearestEven]);
            let overflow = self.one_of(&[
                Overflow::Saturate,
                Overflow::Saturate,
                Overflow::Saturate,
                Overflow::Wrap,
            ]);
            let overflow = saturating_if_float(format, overflow);
            *leaf = serde_json::to_value(Word {
                format,
                round,
                overflow,
            })
            .unwrap();
        }
    }

    /// A possible number of the machine for an exact one; often the farthest.
    pub fn pick(&mut self, near: Near) -> f64 {
        let inside = self.between(-1.0, 1.0);
        near.value + near.error * self.one_of(&[-1.0, 1.0, 0.0, inside])
    }
}

/// A register as the bench loads it.
pub fn quantised(word: Word, value: f64) -> i64 {
    let format = word.format;
    let places = value * power_of_two(format.frac_bits);
    let rounded = if format.is_float() {
        word.rounded_real(places)
    } else {
        places.round()
    };
    (rounded as i64).clamp(format.min(), format.max())
}

/// A register: its word, and its exact and machine value.
pub fn held(word: Word, value: f64) -> (i64, Near) {
    let word_held = quantised(word, value);
    (word_held, Near::held(value, word, word_held))
}

/// Share of a bound that the machine's number uses. The bound must be around the exact number, and
/// hold.
pub fn used(own: f64, exact: f64, bound: Near, what: &impl Debug) -> f64 {
    assert!(
        (bound.value - exact).abs() <= 1e-12,
        "{what:?}: {bound:?} of {exact}"
    );
    let error = (own - exact).abs();
    assert!(
        error <= bound.around(exact).error,
        "{what:?}: {own}, exactly {exact}, {bound:?}"
    );
    // Rounding errors of f64 are not the machine's.
    if bound.error > 1e-12 {
        error / bound.error
    } else {
        0.0
    }
}

/// The greatest and the total share of a bound over many inputs.
#[derive(Clone, Copy, Debug, Default)]
pub struct Use {
    worst: f64,
    sum: f64,
    count: f64,
}

impl Use {
    pub fn add(&mut self, used: f64) {
        *self = Use {
            worst: self.worst.max(used),
            sum: self.sum + used,
            count: self.count + 1.0,
        };
    }

    /// Whether some input uses more than `worst` of the bound, and the mean is more than `mean`.
    pub fn is_tight(&self, worst: f64, mean: f64) -> bool {
        self.worst > worst && self.sum > mean * self.count
    }
}

/// An exact number with its bound, and a possible number of the machine.
#[derive(Clone, Copy, Debug)]
struct NearPair {
    near: Near,
    machine: f64,
}

impl NearPair {
    /// `fitted` rounds to 2^−30 first.
    fn holds(self) -> bool {
        (self.machine - self.near.value).abs() <= self.near.error + 1e-9
    }
}

fn saturating_if_float(format: Format, overflow: Overflow) -> Overflow {
    if format.is_float() {
        Overflow::Saturate
    } else {
        overflow
    }
}

fn some_fit(rng: &mut Rng) -> Fit {
    let format = Format::fixed_point(true, 2 + rng.below(5) as i32, rng.below(12) as i32);
    let format = also_floating(format, rng.below(90) as u32);
    let round = rng.one_of(&[Rounding::Truncate, Rounding::Nearest, Rounding::NearestEven]);
    let overflow = rng.one_of(&[Overflow::Saturate, Overflow::Saturate, Overflow::Wrap]);
    let overflow = saturating_if_float(format, overflow);
    Fit::new(
        0,
        Word {
            format,
            round,
            overflow,
        },
        Exact {
            int_bits: 10,
            frac_bits: rng.below(20) as i32,
        },
    )
}

/// The value of the word that a fit makes of a real number.
fn fitted(fit: &Fit, x: f64) -> f64 {
    let places = 30;
    let wide = Fit::new(
        0,
        fit.word,
        Exact {
            int_bits: 20,
            frac_bits: places,
        },
    );
    fit.word
        .format
        .value(wide.one((x * power_of_two(places)).round() as i64))
}

/// A further number, computed from others in the pool.
fn step(rng: &mut Rng, pool: &[NearPair]) -> NearPair {
    let [a, b] = [rng.one_of(pool), rng.one_of(pool)];
    let constant = rng.between(-2.0, 2.0);
    let pair = |near: Near, machine: f64| NearPair { near, machine };
    match rng.below(15) {
        0 => pair(a.near + b.near, a.machine + b.machine),
        1 => pair(a.near - b.near, a.machine - b.machine),
        2 => pair(a.near * b.near, a.machine * b.machine),
        3 => pair(a.near.abs(), a.machine.abs()),
        4 => pair(a.near.max(b.near), a.machine.max(b.machine)),
        5 => pair(a.near.min(b.near), a.machine.min(b.machine)),
        6 => pair(a.near.at_least(constant), a.machine.max(constant)),
        7 => pair(a.near.at_most(constant), a.machine.min(constant)),
        8 => pair(a.near.plus(constant), a.machine + constant),
        9 => pair(a.near.times(constant), a.machine * constant),
        10 => pair(
            a.near.function(|x| x.powi(3), 0.25),
            a.machine.powi(3) + rng.one_of(&[-0.25, 0.25]),
        ),
        11 => {
            let fit = some_fit(rng);
            pair(a.near.fit(&fit, Scale::ONE), fitted(&fit, a.machine))
        }
        12 => {
            let [near] = a.near.branch(b.near, || [a.near], || [b.near * b.near]);
            pair(
                near,
                if a.machine >= b.machine {
                    a.machine
                } else {
                    b.machine * b.machine
                },
            )
        }
        13 => pair(
            a.near.falling(0.25),
            falloff(a.machine) + rng.one_of(&[-0.25, 0.25]),
        ),
        _ => {
            let [u, v] = [0; 2].map(|_| [0; 3].map(|_| rng.one_of(pool)));
            let length = norm(u.map(|p| p.machine));
            if rng.below(2) == 0 {
                return pair(Near::length(u.map(|p| p.near)), length);
            }
            let root = ReciprocalRoot::new(
                &mut Elaboration::default(),
                "test",
                "root",
                FunctionUnit {
                    table_bits: 4,
                    newton_steps: 1,
                    bits: 12,
                },
                10,
            );
            let direction = Near::direction(u.map(|p| p.near), Near::exact(1.0), &root);
            let off = 1.0 + root.relative_error() * rng.between(-1.0, 1.0);
            let parts = u.map(|p| {
                if length > 0.0 {
                    p.machine / length * off
                } else {
                    0.0
                }
            });
            let dot = (0..3).map(|i| parts[i] * v[i].machine).sum();
            pair(Near::dot(&direction, v.map(|p| p.near)), dot)
        }
    }
}

#[test]
fn near_holds_every_outcome() {
    for seed in 0..20_000 {
        let rng = &mut Rng::new(seed);
        let mut pool: Vec<NearPair> = Vec::new();
        for _ in 0..4 {
            let error = rng.one_of(&[0.0, 1e-6, 1e-2, 0.5]) * rng.part();
            let value = rng.between(-2.0, 2.0);
            let near = Near::within(rng.one_of(&[0.0, 1.0, value, value]), error);
            pool.push(NearPair {
                near,
                machine: rng.pick(near),
            });
        }
        for _ in 0..12 {
            let next = step(rng, &pool);
            assert!(next.holds(), "seed {seed}: {next:?} from {pool:?}");
            if next.near.most() < 100.0 {
                pool.push(next);
            }
        }
    }
}

/// All exact results of a few bits in all small words, at every shift: the bound holds for all of
/// them, and is tight.
#[test]
fn a_fit_is_within_its_bound() {
    for format in [
        "U1F3", "I3F2", "I2F0", "I1F8", "U0F4", "I3F6S3", "U1F8S4", "I4F2S2", "I3F6S3N", "U1F8S4N",
        "I4F2S2N",
    ] {
        for round in [Rounding::Truncate, Rounding::Nearest, Rounding::NearestEven] {
            for overflow in [Overflow::Saturate, Overflow::Wrap] {
                let word = Word {
                    format: format.parse().unwrap(),
                    round,
                    overflow,
                };
                if word.format.is_float() && overflow == Overflow::Wrap {
                    continue;
                }
                let fit = Fit::new(
                    0,
                    word,
                    Exact {
                        int_bits: 4,
                        frac_bits: 6,
                    },
                );
                for exponent in -3..3 {
                    let mut worst: f64 = 0.0;
                    for exact in -1023..=1023 {
                        // The exact result is scaled by 2^−exponent: it has `exponent` more
                        // fraction bits, and the word is scaled back.
                        let value = exact as f64 * power_of_two(-6);
                        let machine = word
                            .format
                            .value(fit.one_shifted(exact, i64::from(exponent)))
                            * power_of_two(exponent);
                        let near = Near::exact(value).fit(
                            &fit,
                            Scale {
                                low: exponent,
                                high: exponent,
                            },
                        );
                        assert!(
                            (machine - value).abs() <= near.error,
                            "{word:?}: {exact}/64 is {machine}, {near:?}"
                        );
                        // A floating-point word that loses nothing is bounded by half its ulp too.
                        if near.error.is_finite()
                            && near.error > 0.0
                            && fit.places() + i64::from(exponent) > 1
                        {
                            worst = worst.max((machine - value).abs() / near.error);
                        }
                        if exponent == 0 {
                            let near = Near::exact(value).refit(6, &fit);
                            assert!(
                                (machine - value).abs() <= near.error,
                                "{word:?}: {exact}/64 is {machine}, {near:?}"
                            );
                        }
                    }
                    assert!(
                        worst > 0.74 || fit.places() + i64::from(exponent) <= 1,
                        "{word:?}, exponent {exponent}: {worst}"
                    );
                }
            }
        }
    }
}

/// Words of a share and its whole, checked against their quotient: shares of wholes from 2^−9 to
/// 2^4.
#[test]
fn a_share_is_within_its_bound() {
    let mut worst: f64 = 0.0;
    for seed in 0..20_000 {
        let rng = &mut Rng::new(seed);
        let bits = rng.below(13);
        let whole = 1 + rng.below(1 << bits) as i64;
        let part = rng.below(2 * whole as u64) as i64;
        let word = Word::new(Format::unsigned(
            1 + rng.below(2) as i32,
            4 + rng.below(8) as i32,
        ));
        let word = word.rounded(rng.one_of(&[Rounding::Truncate, Rounding::Nearest]));
        let fit = Fit::new(
            0,
            word,
            Exact {
                int_bits: 5,
                frac_bits: 8,
            },
        );
        let exponent = i64::from(whole.ilog2()) - 8;
        let share =
            word.format.value(fit.one_shifted(part, exponent)) * power_of_two(exponent as i32);
        let (whole, part) = (whole as f64 / 256.0, part as f64 / 256.0);
        let drift = rng.one_of(&[0.0, 0.01, 0.6]) * whole;
        let near = Near::exact(part / whole).share(
            &fit,
            Near::within(whole + rng.between(-drift, drift), drift),
        );
        let error = (share / whole - part / whole).abs();
        assert!(
            error <= near.error + 1e-15,
            "seed {seed}: off by {error}, bound {}",
            near.error
        );
        worst = if near.error > 0.0 && drift == 0.0 {
            worst.max(error / near.error)
        } else {
            worst
        };
    }
    assert!(worst > 0.95, "{worst}");
}

/// Every argument of small tables; the bound is tight.
#[test]
fn a_power_is_within_its_bound() {
    for (interpolation, steps) in [
        (Interpolation::Nearest, 16.0),
        (Interpolation::Linear, 16.0),
        (Interpolation::Linear, 1024.0),
    ] {
        for exponent in [0.0, 0.3, 0.5, 1.0, 1.5, 2.0, 8.0, 40.0] {
            for round in [Rounding::Truncate, Rounding::Nearest] {
                let index_bits = f64::log2(steps) as u32;
                let word = Word::new(Format::unsigned(1, 9)).rounded(round);
                let middle = if interpolation == Interpolation::Nearest {
                    0.5
                } else {
                    0.0
                };
                let words: Vec<i64> = (0..=steps as i64)
                    .map(|i| quantised(word, ((i as f64 + middle) / steps).powf(exponent)))
                    .collect();
                let argument = Format::unsigned(0, 12);
                let fit = Fit::new(
                    0,
                    word,
                    Exact {
                        int_bits: 1,
                        frac_bits: 9 + Table::fraction_bits(index_bits, 12) as i32,
                    },
                );
                let power = Power::new(
                    Table::new(fit, index_bits, 12, interpolation, &words),
                    exponent,
                );
                let mut worst: f64 = 0.0;
                for x in 0..=argument.max() {
                    let value = word.format.value(fit.one(power.table().exact(x)));
                    let near = Near::exact(argument.value(x)).power(&power);
                    let error = (value - near.value).abs();
                    assert!(
                        error <= near.error,
                        "{interpolation:?} {x}^{exponent}: off by {error}, bound {}",
                        near.error
                    );
                    worst = if near.error > 1e-12 {
                        worst.max(error / near.error)
                    } else {
                        worst
                    };
                    // The same word for another exact number.
                    for off in [-0.2, -0.01, 1e-4, 0.03, 0.5] {
                        let near = Near::within(argument.value(x) + off, off).power(&power);
                        assert!(
                            (value - near.value).abs() <= near.error,
                            "{x}^{exponent}, {off} off: {value}, {near:?}"
                        );
                    }
                }
                assert!(
                    worst > 0.3 || exponent == 0.0,
                    "{interpolation:?}, {steps} steps, exponent {exponent}, {round:?}: {worst}"
                );
            }
        }
    }
}

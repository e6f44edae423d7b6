//! Colour: checked against spherical harmonics from associated Legendre functions of angles, in
//! f64.

use super::*;
use crate::num::{Format, Word};
use crate::probe::{NoProbe, Tap};
use crate::real::Near;
use proptest::prelude::*;
use std::f64::consts::PI;

/// The real harmonic of degree l and order m, with the Condon-Shortley phase, in the direction with
/// polar angle θ from z and azimuth φ from x.
fn harmonic(l: i32, m: i32, cos_theta: f64, phi: f64) -> f64 {
    let order = m.abs();
    // P_m^m = (−1)^m (2m − 1)!! sin^m θ, then upwards in l.
    let sin_theta = (1.0 - cos_theta * cos_theta).max(0.0).sqrt();
    let first = (1..=order).fold(1.0, |p, k| -p * f64::from(2 * k - 1) * sin_theta);
    let (mut before, mut legendre) = (0.0, first);
    for k in order + 1..=l {
        let next = (f64::from(2 * k - 1) * cos_theta * legendre
            - f64::from(k + order - 1) * before)
            / f64::from(k - order);
        (before, legendre) = (legendre, next);
    }
    let factorial = |n: i32| (1..=n).map(f64::from).product::<f64>();
    let norm =
        (f64::from(2 * l + 1) / (4.0 * PI) * factorial(l - order) / factorial(l + order)).sqrt();
    let turn = f64::from(order) * phi;
    match m.signum() {
        0 => norm * legendre,
        1 => 2f64.sqrt() * norm * legendre * turn.cos(),
        _ => 2f64.sqrt() * norm * legendre * turn.sin(),
    }
}

/// Constants of the polynomials in this unit's order: each harmonic at a direction where its
/// polynomial is known.
fn constants() -> Vec<f64> {
    // √(1/4π), √(3/4π), √(15/4π), √(5/16π), √(15/16π), √(35/32π), √(105/4π), √(21/32π), √(7/16π),
    // √(105/16π).
    let root = |x: f64| (x / PI).sqrt();
    let [a, b, c, d, e] = [1.0 / 4.0, 3.0 / 4.0, 15.0 / 4.0, 5.0 / 16.0, 15.0 / 16.0].map(root);
    let [f, g, h, i, j] = [
        35.0 / 32.0,
        105.0 / 4.0,
        21.0 / 32.0,
        7.0 / 16.0,
        105.0 / 16.0,
    ]
    .map(root);
    vec![a, -b, b, -b, c, -c, d, -c, e, -f, g, -h, i, -h, j, -f]
}

fn word(
    width: std::ops::Range<i32>,
    int_bits: std::ops::Range<i32>,
) -> impl Strategy<Value = Word> {
    (width, int_bits)
        .prop_map(|(width, int_bits)| Word::new(Format::signed(int_bits, width - int_bits)))
}

/// A machine with random words of the unit, absurd ones included.
fn machine() -> impl Strategy<Value = Machine> {
    (
        (1..=3u32, 1..=12u32, 0..=2u32, 4..=26u32),
        (word(2..28, 1..5), word(2..28, 1..2), word(2..28, 1..3)),
        (word(2..28, 1..3), word(2..28, 1..4)),
    )
        .prop_map(
            |((degree, table_bits, newton_steps, bits), (a, b, c), (d, e))| Machine {
                colour: Some(machine::Colour {
                    degree,
                    coefficient: a,
                    relative: b,
                    root: machine::FunctionUnit {
                        table_bits: table_bits.min(bits),
                        newton_steps,
                        bits,
                    },
                    direction: c,
                    monomial: d,
                    basis: e,
                }),
                ..Machine::named("gaussian").unwrap()
            },
        )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn a_colour_is_within_its_bound(
        machine in machine(),
        position in prop::array::uniform3(-0.9..0.9), eye in prop::array::uniform3(-2.0..2.0),
        seeds in prop::collection::vec(-1.0..1.0, 48), of_range in 0.01..1.0,
    ) {
        let words = machine.colour.unwrap();
        let e = &mut Elaboration::default();
        let unit = Colour::new(e, &machine).unwrap();
        prop_assert!(e.errors.is_empty(), "{:?}", e.errors);
        let held = |word: Word, value: f64| {
            let format = word.format;
            ((value * f64::from(format.frac_bits).exp2()).round() as i64).clamp(format.min(), format.max())
        };
        let count = coefficients(words.degree);
        let most = words.coefficient.format.value(words.coefficient.format.max());
        let given: Vec<i64> = seeds[..3 * count].iter().map(|seed| held(words.coefficient, seed * most * of_range)).collect();
        let (at, from) = (position.map(|x| held(machine.splat.position, x)), eye.map(|x| held(machine.project.eye, x)));
        let inputs: Vec<i64> = at.into_iter().chain(from).chain(given.iter().copied()).collect();
        let rgb = unit.graph().one(&inputs, &mut Tap::new(&mut NoProbe));

        let value = |word: Word, held: i64| word.format.value(held);
        let way: [f64; 3] = std::array::from_fn(|i| value(machine.splat.position, at[i]) - value(machine.project.eye, from[i]));
        let length = way.map(|x| x * x).iter().sum::<f64>().sqrt();
        prop_assume!(length > 0.0);
        let [x, y, z] = way.map(|x| x / length);
        let orders = (0..=words.degree as i32).flat_map(|l| (-l..=l).map(move |m| (l, m)));
        let polynomials: Vec<f64> = orders
            .zip(constants())
            .map(|((l, m), constant)| harmonic(l, m, z, y.atan2(x)) / constant)
            .collect();
        let near = unit.real(
            std::array::from_fn(|i| Near::exact(value(machine.splat.position, at[i]))),
            std::array::from_fn(|i| Near::exact(value(machine.project.eye, from[i]))),
            given.chunks(3).map(|rgb| std::array::from_fn(|i| Near::exact(value(words.coefficient, rgb[i])))),
        );
        for (channel, (word, near)) in rgb.into_iter().zip(near).enumerate() {
            let sum: f64 = polynomials
                .iter()
                .zip(given.chunks(3))
                .map(|(polynomial, rgb)| polynomial * value(words.coefficient, rgb[channel]))
                .sum();
            let exact = (0.5 + sum).max(0.0);
            prop_assert!((near.value - exact).abs() <= 1e-9 * (1.0 + most), "channel {channel} is {} over the reals, exactly {exact}", near.value);
            let own = value(machine.splat.rgb, word);
            // A bound says nothing where a word saturates.
            prop_assert!((own - exact).abs() <= near.error + 1e-9, "channel {channel} is {own}, exactly {exact}, bound {}", near.error);
        }
    }
}

/// Errors of the default words: a bound that is infinite would pass the law above.
#[test]
fn the_default_words_have_a_useful_bound() {
    let machine = Machine::named("gaussian").unwrap();
    let unit = machine.elaborate().unwrap().colour.unwrap();
    let near = unit.real(
        [0.3, -0.2, 0.4].map(Near::exact),
        [0.1, 0.5, -1.7].map(Near::exact),
        (0..16).map(|nth| [0.3, -0.2, 0.1].map(|part| Near::exact(part / f64::from(1 + nth)))),
    );
    for channel in near {
        assert!(channel.error < 1e-3, "{channel:?}");
    }
}

/// Counted by hand from the formulas: x, y, z; xy, yz, xz, xx, yy, zz; and seven of the third
/// degree.
#[test]
fn a_degree_takes_the_products_of_its_formulas() {
    let machine = Machine::named("gaussian").unwrap();
    let words = machine::Colour::default();
    assert_eq!(
        [0, 1, 2, 3].map(|degree| products(&words, degree)),
        [0, 9 + 9, 9 + 6 + 24, 9 + 13 + 45]
    );
    for degree in 1..=MOST_DEGREE {
        let words = machine::Colour { degree, ..words };
        let of_degree = Machine {
            colour: Some(words),
            ..machine.clone()
        };
        let graph = Colour::new(&mut Elaboration::default(), &of_degree).unwrap();
        assert_eq!(graph.graph().products(), products(&words, degree));
        assert!(
            degree == MOST_DEGREE
                || path(&machine, &words, degree).cycles
                    < path(&machine, &words, degree + 1).cycles
        );
    }
}

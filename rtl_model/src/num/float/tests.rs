//! Floating-point words beside the crate `half` and beside lists of every value.

use super::*;
use crate::elaboration::Elaboration;
use crate::graph::{Builder, Graph, Wire};
use crate::machine::Operators;
use crate::num::{Exact, Fit, Overflow, Rounding, Word};
use crate::probe::{NoProbe, Tap};
use half::f16;
use proptest::prelude::*;

/// Pairs of 16 bits.
const PAIRS: u32 = 10_000_000;

/// A format of the notation.
fn format(text: &str) -> Format {
    text.parse().unwrap()
}

/// Every number of a format, worked out from the fields of its stored words.
fn values(exponent_bits: i32, fraction_bits: i32, least_exponent: i32, greatest: f64) -> Vec<f64> {
    let mut values = Vec::new();
    for exponent in 0..1 << exponent_bits {
        for fraction in 0..1 << fraction_bits {
            let part = f64::from(fraction) / f64::from(1 << fraction_bits);
            let value = if exponent == 0 {
                part * 2f64.powi(least_exponent)
            } else {
                (1.0 + part) * 2f64.powi(least_exponent + exponent - 1)
            };
            if value <= greatest {
                values.push(value);
            }
        }
    }
    values
}

/// A number; 0 below the least normal one.
fn flushed(value: f64, least_exponent: i32) -> f64 {
    if value.abs() < 2f64.powi(least_exponent) {
        0.0
    } else {
        value
    }
}

/// The nearest of some numbers in ascending order from 0 on, which have alternating last bits.
fn nearest(values: &[f64], of: f64) -> f64 {
    let magnitude = of.abs();
    let above = values.partition_point(|value| *value < magnitude);
    let place = match (above.checked_sub(1), values.get(above)) {
        (None, _) => 0,
        (Some(below), None) => below,
        (Some(below), Some(next)) => match (magnitude - values[below], next - magnitude) {
            (down, up) if down < up => below,
            (down, up) if down > up => above,
            _ if below % 2 == 0 => below,
            _ => above,
        },
    };
    values[place].copysign(of)
}

#[test]
fn named_formats_have_the_fields_and_limits_of_their_standards() {
    let fields = |text| {
        let format = format(text);
        (
            format.stored_bits(),
            format.exponent_bits(),
            format.value(format.max()),
            format.value(1),
        )
    };
    assert_eq!(fields("FP16"), (16, 5, 65504.0, 2f64.powi(-24)));
    assert_eq!(fields("FP8(E4M3)"), (8, 4, 448.0, 2f64.powi(-9)));
    assert_eq!(fields("FP8(E5M2)"), (8, 5, 57344.0, 2f64.powi(-16)));
    assert_eq!(format("I17F24S11").to_string(), "FP16");
    assert_eq!(format("U1F24S11").to_string(), "U1F24S11");
    assert_eq!(fields("FP16N"), fields("FP16"));
    for text in ["FP16N", "FP8(E4M3)N", "U1F24S11N"] {
        assert_eq!(format(text).to_string(), text);
    }
    assert_eq!(format("I17F24S11N").to_string(), "FP16N");
    // 25 magnitude bits, 15 exponents and the code of subnormal numbers: 4 + 10 bits.
    assert_eq!(format("U1F24S11").stored_bits(), 14);
}

/// An operator on two wires.
type Operator = fn(&mut Builder<'_>, Wire, Wire) -> Wire;
const TIMES: Operator = |g, a, b| g.times(a, b);
const PLUS: Operator = |g, a, b| g.plus(a, b);

/// The rounded result of two words, as a graph that elaborates.
fn rounded(operator: Operator, factors: [Format; 2], result: Format) -> Graph<1> {
    let mut e = Elaboration::default();
    let g = &mut Builder::new(&mut e, "unit");
    let [a, b] = factors.map(|format| g.input(Word::new(format)));
    let exact = operator(g, a, b);
    let fitted = g.fit("result", Word::new(result), exact);
    let graph = g.build([fitted]);
    assert_eq!(e.errors, [""; 0], "{factors:?}");
    graph
}

/// The value that a graph makes of two values.
fn made(graph: &Graph<1>, formats: [Format; 2], values: [f64; 2], result: Format) -> f64 {
    let words = [0, 1].map(|nth| {
        let word = values[nth] * 2f64.powi(formats[nth].frac_bits);
        assert_eq!(word, word.trunc());
        word as i64
    });
    let [word] = graph.one(&words, &mut Tap::new(&mut NoProbe));
    result.value(word)
}

/// Formats in which every number of FP8 (E5M2) is one of two, so that products have 62 bits.
const HALVES: [&str; 2] = ["I16F16S3", "I17F15S3"];

#[test]
fn every_product_and_sum_of_8_bits_is_the_nearest_word() {
    let e4m3 = values(4, 3, -6, 448.0);
    let e5m2 = values(5, 2, -14, 57344.0);
    for (numbers, name, factors, least_exponent) in [
        (e4m3, "FP8(E4M3)", ["FP8(E4M3)"; 2], -6),
        (e5m2, "FP8(E5M2)", HALVES, -14),
    ] {
        let (result, flushing) = (format(name), format(&format!("{name}N")));
        let factors = factors.map(format);
        let least = factors.map(|format| format.value(1));
        // The first format holds small numbers, the second large ones.
        let half = |value: f64| usize::from(value.abs() > factors[0].value(factors[0].max()));
        let graphs = [0, 1].map(|a| {
            [0, 1].map(|b| {
                [TIMES, PLUS].map(|each| {
                    [result, flushing].map(|result| rounded(each, [factors[a], factors[b]], result))
                })
            })
        });
        let signed: Vec<f64> = numbers.iter().flat_map(|value| [*value, -value]).collect();
        for a in &signed {
            for b in &signed {
                let halves = [half(*a), half(*b)];
                let formats = halves.map(|half| factors[half]);
                assert!(
                    [a, b]
                        .into_iter()
                        .zip(halves)
                        .all(|(x, half)| x % least[half] == 0.0)
                );
                for (graphs, exact) in graphs[halves[0]][halves[1]].iter().zip([a * b, a + b]) {
                    let [kept, normal] = graphs
                        .each_ref()
                        .map(|graph| made(graph, formats, [*a, *b], result));
                    let expected = nearest(&numbers, exact);
                    assert_eq!(kept, expected, "{a} and {b}: {exact}");
                    let expected = flushed(expected, least_exponent);
                    assert_eq!(normal, expected, "{a} and {b}, without subnormals: {exact}");
                }
            }
        }
    }
}

/// Formats in which products of many numbers of FP16 have 62 bits: below 64, and multiples of
/// 2^−14.
const RANGES: [&str; 2] = ["I7F24S11", "I17F14S11"];

#[test]
fn products_and_sums_of_16_bits_are_those_of_the_crate_half() {
    let result = format("FP16");
    let most = f16::MAX.to_f64();
    let mut state = 1u64;
    let (mut pairs, mut flushes) = ([0; 3], 0);
    let ranges = RANGES.map(format);
    let products = [0, 1].map(|a| [0, 1].map(|b| rounded(TIMES, [ranges[a], ranges[b]], result)));
    let sum = rounded(PLUS, [result; 2], result);
    let normal_sum = rounded(PLUS, [result; 2], format("FP16N"));
    let least_exponent = f16::MIN_POSITIVE.to_f64().log2() as i32;
    // The crate rounds f64 to FP16 once.
    let expected = |exact: f64| f16::from_f64(exact).to_f64().clamp(-most, most);
    for _ in 0..PAIRS {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        let numbers = [state >> 48, state >> 32].map(|bits| f16::from_bits(bits as u16));
        if !numbers.iter().all(|number| number.is_finite()) {
            continue;
        }
        let [a, b] = numbers.map(f16::to_f64);
        let made_sum = made(&sum, [result; 2], [a, b], result);
        assert_eq!(made_sum, expected(a + b), "{a} + {b}");
        let normal = made(&normal_sum, [result; 2], [a, b], result);
        let expected_normal = flushed(expected(a + b), least_exponent);
        assert_eq!(normal, expected_normal, "{a} + {b}, without subnormals");
        flushes += u32::from(made_sum != normal);
        pairs[2] += 1;
        let range = [a, b].map(|x| {
            ranges.iter().position(|format| {
                x.abs() <= format.value(format.max()) && x % format.value(1) == 0.0
            })
        });
        let [Some(of_a), Some(of_b)] = range else {
            continue;
        };
        let graph = &products[of_a][of_b];
        let made = made(graph, [ranges[of_a], ranges[of_b]], [a, b], result);
        assert_eq!(made, expected(a * b), "{a} · {b}");
        pairs[usize::from(of_a + of_b > 0)] += 1;
    }
    assert!(pairs.iter().all(|count| *count > PAIRS / 10), "{pairs:?}");
    assert!(flushes > 10_000, "{flushes}");
}

#[test]
fn stored_words_are_those_of_the_crate_half() {
    let format = format("FP16");
    for stored in 0..=u16::MAX {
        let half = f16::from_bits(stored);
        if !half.is_finite() {
            continue;
        }
        let word = format.restored(stored.into());
        assert_eq!(format.value(word), half.to_f64(), "{stored:#x}");
        if stored != 0x8000 {
            assert_eq!(format.stored(word), u64::from(stored));
        }
    }
}

#[test]
fn every_stored_word_of_8_bits_reads_back() {
    for (text, numbers) in [
        ("FP8(E4M3)", values(4, 3, -6, 448.0)),
        ("FP8(E5M2)", values(5, 2, -14, 57344.0)),
    ] {
        let format = format(text);
        for (stored, value) in numbers.into_iter().enumerate() {
            for (sign, factor) in [(0, 1.0), (0x80, -1.0)] {
                let word = format.restored(stored as u64 | sign);
                assert_eq!(format.value(word), factor * value);
                if word != 0 {
                    assert_eq!(format.stored(word), stored as u64 | sign);
                }
            }
        }
    }
}

#[test]
fn a_word_has_a_representable_one_on_each_side() {
    // Without the 7 subnormal numbers.
    for (text, numbers) in [("FP8(E4M3)", 127), ("FP8(E4M3)N", 120)] {
        let format = format(text);
        let is_kept = |word: &i64| !format.flushes || *word == 0 || *word >= 8;
        let words: Vec<i64> = (0..=format.max())
            .filter(|word| format.restored(format.stored(*word)) == *word)
            .filter(is_kept)
            .collect();
        assert_eq!(words.len(), numbers);
        for word in 0..=format.max() {
            let below = words.iter().rfind(|other| **other <= word).copied();
            let from = words.iter().find(|other| **other >= word).copied();
            assert_eq!(Some(format.representable(word)), below);
            assert_eq!(Some(format.representable(-word)), below.map(|word| -word));
            assert_eq!(Some(format.representable_from(word)), from, "{word}");
        }
    }
}

#[test]
fn a_word_that_is_flushed_is_inexact() {
    let format = format("FP8(E4M3)N");
    let exact_shape = Exact {
        int_bits: 9,
        frac_bits: 12,
    };
    let fit = Fit::new(0, Word::new(format), exact_shape);
    for exact in -256..=256 {
        let is_kept = format.value(fit.one(exact)) * 4096.0 == exact as f64;
        assert_eq!(fit.loss(exact, 0).inexact, !is_kept, "{exact}");
    }
}

#[test]
fn floating_point_words_that_cannot_be_modelled_are_refused() {
    let refusal = |text: &str| text.parse::<Format>().expect_err(text);
    assert_eq!(
        refusal("I8F24S1"),
        "`I8F24S1` keeps 1 significant bits of 31: 2 to 24 can be modelled"
    );
    assert_eq!(
        refusal("U1F3S4"),
        "`U1F3S4` keeps 4 significant bits of 4: 2 to 3 can be modelled"
    );
    assert_eq!(
        refusal("U1F1S2"),
        "`U1F1S2` has 2 bits of magnitude: floating point needs at least 3"
    );
    assert!(refusal("I8F24S-3").contains("significant bits"));
    assert!(refusal("I8F24S").contains("is not a format"));
    assert!(refusal("I8F24S0").contains("significant bits"));
    assert!(refusal("FP8").contains("FP8(E4M3)"));
    for fixed in ["I8F24N", "N", "FP16NN", "I8F24NS11"] {
        assert!(refusal(fixed).contains("is not a format"), "{fixed}");
    }
    assert_eq!(
        refusal("I17F3S11N"),
        "`I17F3S11N` would flush 1 to zero: 4 significant bits or 10 fraction bits keep it"
    );
    let wraps = serde_json::from_str::<Word>(r#"{"format": "FP16", "overflow": "wrap"}"#);
    assert!(wraps.unwrap_err().to_string().contains("can only saturate"));
}

#[test]
fn a_word_is_rounded_to_nearest_even_if_the_description_leaves_it_out() {
    let read = |text: &str| serde_json::from_str::<Word>(text).unwrap();
    for text in [r#""FP16""#, r#"{"format": "FP16"}"#] {
        assert_eq!(read(text).round, Rounding::NearestEven);
        assert_eq!(serde_json::to_string(&read(text)).unwrap(), r#""FP16""#);
    }
    let truncated = r#"{"format":"I8F24S11","round":"truncate","overflow":"saturate"}"#;
    assert_eq!(serde_json::to_string(&read(truncated)).unwrap(), truncated);
}

/// A number rounded to nearest even to 11 significant bits, as FP16 without limits of its exponent.
fn half_of(exact: f64) -> f64 {
    // 42 of 53 bits go: adding and taking away a multiple rounds them (Veltkamp's splitting).
    let far = exact * f64::from(1u32 << 21) * f64::from(1u32 << 21);
    (exact + far) - far
}

/// A sum of two products less a third number.
fn sum_of_products(operators: Operators, numbers: Format) -> Graph<1> {
    let mut e = Elaboration::new(operators);
    let g = &mut Builder::new(&mut e, "unit");
    let [a, b, c, d, rest] = [(); 5].map(|()| g.input(Word::new(numbers)));
    let (first, second) = (g.times(a, b), g.times(c, d));
    let sum = g.plus(first, second);
    let difference = g.minus(sum, rest);
    let graph = g.build([difference]);
    assert_eq!(e.errors, [""; 0]);
    graph
}

#[test]
fn operators_that_round_give_the_results_of_the_crate_half() {
    // Numbers below 64 that are multiples of 2^−20: results of FP16 that is not subnormal, and of
    // smaller numbers too.
    let numbers = format("I7F20S11");
    let [graph, exact] =
        [Operators::Rounded, Operators::Exact].map(|operators| sum_of_products(operators, numbers));
    let mut state = 1u64;
    let (mut different, mut of_half) = (0, 0);
    for _ in 0..200_000 {
        let values = [numbers; 5].map(|format| {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            // Any exponent, any significand.
            let magnitude = (1024 + ((state >> 40) & 1023)) << ((state >> 32) % 16);
            let word = magnitude as i64 * (1 - 2 * (state >> 63) as i64);
            format.value(format.representable(word))
        });
        let words = values.map(|value| (value * 2f64.powi(20)) as i64);
        let [a, b, c, d, rest] = values;
        let value = |graph: &Graph<1>| {
            let [word] = graph.one(&words, &mut Tap::new(&mut NoProbe));
            word as f64 * 2f64.powi(-40)
        };
        let steps = [half_of(a * b), half_of(c * d)];
        let sum = half_of(steps[0] + steps[1]);
        let expected = half_of(sum - rest);
        assert_eq!(value(&graph), expected, "{values:?}");
        different += u32::from(half_of(value(&exact)) != expected);
        // The crate has no numbers beyond 65504, and fewer bits below 2^−14.
        let [a, b, c, d, rest] = values.map(f16::from_f64);
        let by_crate = [a * b, c * d, a * b + c * d, a * b + c * d - rest];
        if by_crate
            .iter()
            .all(|number| number.is_normal() && number.is_finite())
        {
            assert_eq!(expected, by_crate[3].to_f64(), "{values:?}");
            of_half += 1;
        }
    }
    // Many results differ from those of exact operators, and most are numbers of FP16.
    assert!(
        different > 40_000 && of_half > 100_000,
        "{different}, {of_half}"
    );
}

proptest! {
    /// Every rounding of any result, beside the list of every number of the format.
    #[test]
    fn a_word_is_one_of_the_two_numbers_beside_the_result(
        exact in -(1i64 << 40)..1 << 40,
        frac_bits in 0..=40i32,
        name in prop::sample::select(vec!["FP8(E4M3)", "FP8(E5M2)"]),
        flushes in any::<bool>(),
        more in -20..20i64,
    ) {
        let (numbers, least_exponent) = match name {
            "FP8(E4M3)" => (values(4, 3, -6, 448.0), -6),
            _ => (values(5, 2, -14, 57344.0), -14),
        };
        let format = Format { flushes, ..format(name) };
        let value = exact as f64 * 2f64.powi(-frac_bits - more as i32);
        let below = numbers.partition_point(|number| *number <= value.abs()).saturating_sub(1);
        let expected = [
            (Rounding::Truncate, numbers[below].copysign(value)),
            (Rounding::NearestEven, nearest(&numbers, value)),
        ];
        for (round, expected) in expected {
            let expected = if flushes { flushed(expected, least_exponent) } else { expected };
            let word = Word { format, round, overflow: Overflow::Saturate };
            let fit = Fit::new(0, word, Exact { int_bits: 40 - frac_bits, frac_bits });
            let made = fit.one_shifted(exact, more);
            prop_assert_eq!(format.value(made), expected, "{} {}", value, round.code());
            let loss = fit.loss(exact, more);
            // Beyond the range a result can be rounded to it or be limited by it.
            if value.abs() <= format.value(format.max()) {
                prop_assert_eq!(loss.inexact, format.value(made) != value);
                prop_assert!(!loss.saturated_low && !loss.saturated_high);
                prop_assert_eq!(fit.one_shifted_within(exact, more), Some(made));
                prop_assert!(fit.is_within(exact, more, made));
            }
        }
    }
}

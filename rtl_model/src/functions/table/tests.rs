//! Tables, checked against a second computation of the exponential and against the bounds of
//! interpolation.

use super::*;
use crate::elaboration::Elaboration;
use crate::machine::Machine;
use crate::num::Rounding;

/// The high half of the product of two fractions of 128 bits.
fn fraction_product(a: u128, b: u128) -> u128 {
    let low = (1u128 << 64) - 1;
    let [a1, a0, b1, b0] = [a >> 64, a & low, b >> 64, b & low];
    let middle = ((a0 * b0) >> 64) + ((a1 * b0) & low) + ((a0 * b1) & low);
    a1 * b1 + ((a1 * b0) >> 64) + ((a0 * b1) >> 64) + (middle >> 64)
}

/// e^(−numerator / 2^shift) with 128 fraction bits, accurate to about 2^−115: the alternating
/// series at 1/256 of the argument, squared eight times.
fn exponential(numerator: u64, shift: u32) -> u128 {
    assert!(numerator > 0);
    let x = u128::from(numerator) << (120 - shift);
    let (mut term, mut negative) = (x, true);
    let mut sum = 0u128;
    for n in 2u128.. {
        sum = if negative {
            sum.wrapping_sub(term)
        } else {
            sum.wrapping_add(term)
        };
        term = fraction_product(term, x) / n;
        negative = !negative;
        if term == 0 {
            break;
        }
    }
    (0..8).fold(sum, |power, _| fraction_product(power, power))
}

#[test]
fn the_exponential_is_right_to_two_to_the_minus_54() {
    assert_eq!(exp_minus(0, 3), 1 << EXP_FRAC_BITS);
    for shift in [0, 1, 5, 9, 13] {
        for numerator in (1..32u64 << shift).step_by(1 + (32 << shift) / 700) {
            let exact = (exponential(numerator, shift) >> (128 - EXP_FRAC_BITS)) as u64;
            assert!(
                exp_minus(numerator, shift).abs_diff(exact) <= 1 << (EXP_FRAC_BITS - 54),
                "e^(−{numerator}/2^{shift})"
            );
        }
    }
}

/// Half an ulp, and 2^−50 for the errors of the oracle and of the series.
#[test]
fn the_exponential_table_is_right_within_half_an_ulp() {
    for (interpolation, index_bits, range_bits) in [
        (Interpolation::Nearest, 8, 2),
        (Interpolation::Linear, 8, 2),
        (Interpolation::Linear, 3, 5),
        (Interpolation::Nearest, 12, -3),
    ] {
        for frac_bits in [8, 14, 20, 30] {
            let words = gaussian_words(index_bits, range_bits, interpolation, 1 << frac_bits);
            let middle = if interpolation == Interpolation::Nearest {
                0.5
            } else {
                0.0
            };
            assert_eq!(
                words.len(),
                (1 << index_bits) + usize::from(interpolation == Interpolation::Linear)
            );
            for (i, word) in words.into_iter().enumerate() {
                let r = (i as f64 + middle) * f64::from(range_bits - index_bits as i32).exp2();
                let exact = (-r / 2.0).exp() * f64::from(frac_bits).exp2();
                assert!(
                    (word as f64 - exact).abs() <= 0.5 + 1e-6,
                    "e^(−{r}/2) with {frac_bits} bits is {word}"
                );
            }
        }
    }
}

/// Nearest: half a step times a slope of at most ½. Linear: h²/8 times a curvature of at most ¼.
/// Words and result are rounded by half an ulp each.
#[test]
fn a_table_is_within_its_bound() {
    for (interpolation, index_bits, argument, frac_bits) in [
        (Interpolation::Nearest, 5, Format::unsigned(2, 6), 8),
        (Interpolation::Nearest, 8, Format::unsigned(2, 6), 14),
        (Interpolation::Nearest, 9, Format::unsigned(3, 12), 20),
        (Interpolation::Linear, 6, Format::unsigned(2, 12), 14),
        (Interpolation::Linear, 8, Format::unsigned(2, 13), 20),
        (Interpolation::Linear, 1, Format::unsigned(1, 9), 24),
        (Interpolation::Linear, 12, Format::unsigned(0, 12), 24),
    ] {
        let table = table(interpolation, index_bits, argument, frac_bits);
        let step = f64::from(argument.int_bits - index_bits as i32).exp2();
        let place = f64::from(frac_bits).exp2().recip();
        let bound = match interpolation {
            Interpolation::Nearest => step / 4.0 + place / 2.0,
            Interpolation::Linear => step * step / 32.0 + place,
        };
        for word in 0..=argument.max() {
            let value = table.fit().one(table.exact(word)) as f64 * place;
            let error = (value - (-argument.value(word) / 2.0).exp()).abs();
            assert!(
                error <= bound,
                "e^(−{}/2): off by {error}, bound {bound}",
                argument.value(word)
            );
        }
    }
}

/// e^(−numerator / 2^shift) for any argument; 1 is one ulp less.
fn exponential_or_one(numerator: u64, shift: u32) -> u128 {
    if numerator == 0 {
        u128::MAX
    } else {
        exponential(numerator, shift)
    }
}

/// The assumptions of the proofs about the table (`splatsim machine prove`), for every possible
/// argument. The exponential at the ends or middles of the steps is [`gaussian_words`] of 60 bits,
/// within 2^−54. Within a step it is below the chord, or off the middle, by at most
/// `real::between`.
#[test]
fn the_exponential_is_where_the_proofs_assume_it() {
    for name in Machine::NAMES {
        let gauss = Machine::named(name).unwrap().gauss;
        let (
            argument,
            TableShape {
                index_bits,
                interpolation,
            },
        ) = (gauss.radial_index.format, gauss.table);
        let step = f64::from(argument.int_bits - index_bits as i32).exp2();
        let limit = real::between(interpolation, step, 0.5, 0.25);
        // r/2 = half-steps / 2^shift.
        let shift = (index_bits as i32 + 2 - argument.int_bits) as u32;
        let middle = u64::from(interpolation == Interpolation::Nearest);
        let ends_or_middles: Vec<u128> = (0..=1u64 << index_bits)
            .map(|i| exponential_or_one(2 * i + middle, shift))
            .collect();
        for (word, exact) in gaussian_words(
            index_bits,
            argument.int_bits,
            interpolation,
            1 << EXP_FRAC_BITS,
        )
        .into_iter()
        .zip(&ends_or_middles)
        {
            assert!(
                (word as u64).abs_diff((exact >> (128 - EXP_FRAC_BITS)) as u64)
                    <= 1 << (EXP_FRAC_BITS - 54),
                "{name}: {word}"
            );
        }
        let fraction_bits = Table::fraction_bits(index_bits, argument.width() as u32);
        for r in 0..=argument.max() as u64 {
            let (address, fraction) = (
                (r >> fraction_bits) as usize,
                u128::from(r) & ((1 << fraction_bits) - 1),
            );
            let exact = exponential_or_one(r, argument.frac_bits as u32 + 1);
            let (from, to) = (ends_or_middles[address], ends_or_middles[address + 1]);
            let chord = from - ((from - to) >> fraction_bits) * fraction;
            // The shift and the errors of the oracle are below 2^−100.
            let above = (chord.wrapping_sub(exact) as i128) as f64 * f64::from(-128).exp2();
            let aside = (from.wrapping_sub(exact) as i128) as f64 * f64::from(-128).exp2();
            let slack = f64::from(-100).exp2();
            match interpolation {
                Interpolation::Linear => assert!(
                    (-slack..=limit + slack).contains(&above),
                    "{name}: {above} at {r}"
                ),
                Interpolation::Nearest => {
                    assert!(aside.abs() <= limit + slack, "{name}: {aside} at {r}")
                }
            }
        }
    }
}

fn table(interpolation: Interpolation, index_bits: u32, argument: Format, frac_bits: i32) -> Table {
    let word = Word::new(Format::unsigned(1, frac_bits)).rounded(Rounding::Nearest);
    let width = argument.width() as u32;
    let fit = Fit::new(
        0,
        word,
        interpolated(word, Table::fraction_bits(index_bits, width)),
    );
    Table::new(
        fit,
        index_bits,
        width,
        interpolation,
        &gaussian_words(index_bits, argument.int_bits, interpolation, 1 << frac_bits),
    )
}

#[test]
fn a_farther_point_never_weighs_more_on_a_named_machine() {
    for name in Machine::NAMES {
        let gauss = Machine::named(name).unwrap().gauss;
        let argument = gauss.radial_index.format;
        let table = table(
            gauss.table.interpolation,
            gauss.table.index_bits,
            argument,
            gauss.falloff.format.frac_bits,
        );
        let mut before = i64::MAX;
        for word in 0..=argument.max() {
            let falloff = table.fit().one(table.exact(word));
            assert!(falloff <= before, "{name}: {word}");
            before = falloff;
        }
    }
}

#[test]
fn a_table_that_cannot_be_built_is_refused() {
    let e = &mut Elaboration::default();
    let requested = TableShape {
        index_bits: 13,
        interpolation: Interpolation::Linear,
    };
    assert_eq!(shape(e, "gauss", "table", requested, 20).index_bits, 12);
    assert_eq!(
        shape(
            e,
            "gauss",
            "table",
            TableShape {
                index_bits: 9,
                ..requested
            },
            8
        )
        .index_bits,
        8
    );
    assert_eq!(
        e.errors,
        [
            "gauss.table.index_bits is 13: 1 to 12 can be built",
            "gauss.table.index_bits is 9: 1 to 8 can be built"
        ]
    );
}

//! The reciprocal, checked by its product with x, which must be 1.

use super::*;
use crate::num::lanes::Plain;
use crate::probe::NoProbe;
use proptest::prelude::*;

fn unit(table_bits: u32, newton_steps: u32, bits: u32, operand_frac_bits: i32) -> Reciprocal {
    let e = &mut Elaboration::default();
    let unit = Reciprocal::new(
        e,
        "test",
        "reciprocal",
        FunctionUnit {
            table_bits,
            newton_steps,
            bits,
        },
        operand_frac_bits,
    );
    assert_eq!(e.errors, [""; 0]);
    unit
}

fn one(unit: &Reciprocal, x: i64) -> (i64, i64) {
    unit.one(x, &mut Tap::new(&mut NoProbe))
}

/// |1 − x·y·2^exponent|.
fn error(x: i64, (y, exponent): (i64, i64), bits: u32, operand_frac_bits: i32) -> f64 {
    // x·y < 2^79; both powers of two are exact in f64.
    let product = i128::from(x) * i128::from(y);
    let one = i64::from(bits) + i64::from(operand_frac_bits) - exponent;
    assert!((0..120).contains(&one), "x · y is nowhere near 2^{one}");
    ((1i128 << one) - product) as f64 / (one as f64).exp2()
}

fn holds(unit: &Reciprocal, x: i64, worst: &mut f64) {
    let Reciprocal {
        table_bits,
        newton_steps,
        bits,
        operand_frac_bits,
        ..
    } = *unit;
    let result = one(unit, x);
    let bound = unit.relative_error();
    let error = error(x, result, bits, operand_frac_bits as i32).abs();
    assert!(
        error <= bound,
        "1/{x}: off by {error}, bound {bound} (table {table_bits}, steps {newton_steps}, bits {bits})"
    );
    let least = (1.0 - bound) * f64::from(bits - 1).exp2();
    assert!(
        result.0 as f64 >= least && (1..=1 << bits).contains(&result.0),
        "1/{x} has mantissa {} of {bits} bits",
        result.0
    );
    *worst = worst.max(error / bound);
}

/// Every mantissa, and one with a tail that is truncated. The bound is tight: some errors come
/// within a factor of two of it.
#[test]
fn a_reciprocal_is_within_its_bound() {
    for bits in 4..=12 {
        for (table_bits, newton_steps) in [(1, 0), (1, 1), (2, 2), (3, 1), (4, 0), (4, 1), (4, 3)] {
            let unit = unit(table_bits, newton_steps, bits, 7);
            let mut worst = 0.0;
            for mantissa in 1i64 << bits..2 << bits {
                holds(&unit, mantissa, &mut worst);
                holds(&unit, (mantissa << 9) | 511, &mut worst);
            }
            assert!(
                worst > 0.3,
                "the bound is {} times too wide (table {table_bits}, steps {newton_steps}, bits {bits})",
                1.0 / worst
            );
        }
    }
}

#[test]
fn a_power_of_two_inverts_to_the_last_bit_after_enough_steps() {
    let unit = unit(8, 2, 26, 10);
    for places in 0..48 {
        let (mantissa, exponent) = one(&unit, 1 << places);
        assert!(
            ((1 << 26) - 1..=1 << 26).contains(&mantissa),
            "1/2^{places} is {mantissa}"
        );
        assert_eq!(exponent, 10 - i64::from(places));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn a_reciprocal_of_any_operand_is_within_its_bound(
        table_bits in 1..=12u32, newton_steps in 0..=3u32, bits in 12..=30u32, frac_bits in 0..=62i32, x in any::<u64>(), unused in 2..64u32,
    ) {
        let unit = unit(table_bits, newton_steps, bits, frac_bits);
        holds(&unit, ((x >> unused) as i64).max(1), &mut 0.0);
    }

    #[test]
    fn eight_reciprocals_equal_one(
        table_bits in 1..=4u32, newton_steps in 0..=3u32, bits in 4..=30u32, frac_bits in 0..=62i32, x in prop::array::uniform8(1..1i64 << 48),
    ) {
        let unit = unit(table_bits, newton_steps, bits, frac_bits);
        let all = unit.lanes(Plain(x), &mut Tap::new(&mut NoProbe));
        for (lane, x) in x.into_iter().enumerate() {
            prop_assert_eq!((all.mantissa.0[lane].into(), all.exponent.0[lane].into()), one(&unit, x));
        }
    }

    /// The resulting exponent, inverted, brings the leading one of the operand to bit 61: m ∈ [1,
    /// 2), and x loses no bit.
    #[test]
    fn normalisation_restores_the_operand(x in 1..1i64 << 62, frac_bits in 0..=62i32) {
        let (_, exponent) = one(&unit(4, 1, 12, frac_bits), x);
        let lead = exponent - i64::from(frac_bits) + i64::from(NORMALISED_FRAC_BITS);
        prop_assert!((0..62).contains(&lead));
        prop_assert_eq!((x << lead) >> NORMALISED_FRAC_BITS, 1);
        prop_assert_eq!((x << lead) >> lead, x);
    }
}

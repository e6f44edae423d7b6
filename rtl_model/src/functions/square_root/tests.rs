//! The reciprocal root, checked against f64, which is exact enough for 20 bits.

use super::*;
use crate::num::LANES;
use crate::num::lanes::Plain;
use crate::probe::NoProbe;
use proptest::prelude::*;

fn unit(table_bits: u32, newton_steps: u32, bits: u32, operand_frac_bits: i32) -> ReciprocalRoot {
    let e = &mut Elaboration::default();
    let unit = ReciprocalRoot::new(
        e,
        "test",
        "root",
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

fn one(unit: &ReciprocalRoot, x: i64) -> (i64, i64) {
    unit.one(x, &mut Tap::new(&mut NoProbe))
}

fn holds(unit: &ReciprocalRoot, x: i64, worst: &mut f64) {
    let ReciprocalRoot {
        table_bits,
        newton_steps,
        bits,
        operand_frac_bits,
        ..
    } = *unit;
    let (y, exponent) = one(unit, x);
    let bound = unit.relative_error();
    let value = x as f64 * (-operand_frac_bits as f64).exp2();
    let error = (1.0 - y as f64 * (exponent as f64 - f64::from(bits)).exp2() * value.sqrt()).abs();
    assert!(
        error <= bound,
        "1/√{x}: off by {error}, bound {bound} (table {table_bits}, steps {newton_steps}, bits {bits})"
    );
    assert!(
        (1..=1 << bits).contains(&y),
        "1/√{x} has mantissa {y} of {bits} bits"
    );
    let (root, power) = unit.root_lanes(Plain([x; LANES]), &mut Tap::new(&mut NoProbe));
    let root = root.0[0] as f64 * (f64::from(power.0[0]) - f64::from(2 * bits - 1)).exp2();
    assert!(
        (1.0 - root / value.sqrt()).abs() <= bound,
        "√{x}: {root} instead of {}",
        value.sqrt()
    );
    *worst = worst.max(error / bound);
}

/// Every mantissa in both octaves, and one with a tail that is truncated.
#[test]
fn a_reciprocal_root_is_within_its_bound() {
    for bits in 4..=11 {
        for (table_bits, newton_steps) in [(1, 0), (1, 1), (2, 2), (3, 1), (4, 0), (4, 1), (4, 3)] {
            let unit = unit(table_bits, newton_steps, bits, 6);
            let mut worst = 0.0;
            for mantissa in 1i64 << bits..4 << bits {
                holds(&unit, mantissa, &mut worst);
                holds(&unit, (mantissa << 8) | 255, &mut worst);
            }
            assert!(
                worst > 0.25,
                "the bound is {} times too wide (table {table_bits}, steps {newton_steps}, bits {bits})",
                1.0 / worst
            );
        }
    }
}

#[test]
fn an_even_power_of_two_has_its_root_to_the_last_bits() {
    let unit = unit(8, 2, 26, 10);
    for places in (0..48).step_by(2) {
        let (mantissa, exponent) = one(&unit, 1 << places);
        assert!(
            ((1 << 26) - 2..=1 << 26).contains(&mantissa),
            "1/√2^{places} is {mantissa}"
        );
        assert_eq!(exponent, 5 - i64::from(places / 2));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn a_reciprocal_root_of_any_operand_is_within_its_bound(
        table_bits in 1..=12u32, newton_steps in 0..=3u32, bits in 12..=30u32, frac_bits in 0..=62i32, x in any::<u64>(), unused in 3..64u32,
    ) {
        let unit = unit(table_bits, newton_steps, bits, frac_bits);
        holds(&unit, ((x >> unused) as i64).max(1), &mut 0.0);
    }

    #[test]
    fn eight_reciprocal_roots_equal_one(
        table_bits in 1..=4u32, newton_steps in 0..=3u32, bits in 4..=30u32, frac_bits in 0..=62i32, x in prop::array::uniform8(1..1i64 << 48),
    ) {
        let unit = unit(table_bits, newton_steps, bits, frac_bits);
        let all = unit.lanes(Plain(x), &mut Tap::new(&mut NoProbe));
        for (lane, x) in x.into_iter().enumerate() {
            prop_assert_eq!((all.mantissa.0[lane].into(), all.exponent.0[lane].into()), one(&unit, x));
        }
    }
}

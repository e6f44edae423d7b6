//! MixedPrecision, checked against the machine's own fits and function units, word by word.

use super::*;
use crate::elaboration::Elaboration;
use crate::machine::FunctionUnit;
use crate::num::tests::also_floating;
use crate::num::{Exact, Format, Rounding};
use crate::probe::{NoProbe, Tap};
use proptest::prelude::*;

const ON: fn() -> Switches = || Switches(vec![true; 8]);
const OFF: fn() -> Switches = || Switches(vec![false; 8]);

fn words() -> impl Strategy<Value = Word> {
    let round = prop::sample::select(vec![
        Rounding::Truncate,
        Rounding::Nearest,
        Rounding::NearestEven,
    ]);
    let overflow = prop::sample::select(vec![Overflow::Saturate, Overflow::Wrap]);
    (any::<bool>(), 0..24, 2..24, round, overflow, any::<u32>()).prop_map(
        |(signed, frac_bits, width, round, overflow, pick)| {
            let format = Format::fixed_point(signed, width - frac_bits, frac_bits);
            let format = match overflow {
                Overflow::Saturate => also_floating(format, pick),
                Overflow::Wrap => format,
            };
            Word {
                format,
                round,
                overflow,
            }
        },
    )
}

fn units() -> impl Strategy<Value = (FunctionUnit, i32)> {
    (1..=8u32, 0..=3u32, 8..=26u32, 0..40).prop_map(
        |(table_bits, newton_steps, bits, operand_frac_bits)| {
            (
                FunctionUnit {
                    table_bits,
                    newton_steps,
                    bits,
                },
                operand_frac_bits,
            )
        },
    )
}

/// 1, 2, 3 … and numbers of up to 50 bits.
fn operands() -> impl Strategy<Value = i64> {
    (1..1i64 << 50, 0..50u32).prop_map(|(operand, places): (i64, u32)| (operand >> places).max(1))
}

proptest! {
    /// An exact result of up to 50 bits, from far below the LSB to far above the range.
    #[test]
    fn all_on_a_fit_is_the_machines(word in words(), exact in -(1i64 << 50)..1 << 50, shift in 0..50, frac_bits in 0..40, exponent in -9..9) {
        let (exact, switches) = (exact >> shift, ON());
        let fit = Fit::new(3, word, Exact { int_bits: 50 - frac_bits, frac_bits });
        let value = exact as f64 * power_of_two(exponent - frac_bits);
        let fitted = MixedPrecision::new(value, &switches).fit(&fit, Scale { low: exponent, high: exponent });
        prop_assert_eq!(fitted.value, word.format.value(fit.one(exact)) * power_of_two(exponent));
        prop_assert_eq!(MixedPrecision::new(value, &OFF()).fit(&fit, Scale::ONE).value, value);
    }

    /// Reciprocals and roots of words equal those of the units.
    #[test]
    fn all_on_a_function_is_the_units((config, operand_frac_bits) in units(), x in operands()) {
        let e = &mut Elaboration::default();
        let reciprocal = Reciprocal::new(e, "test", "reciprocal", config, operand_frac_bits);
        let root = ReciprocalRoot::new(e, "test", "root", config, operand_frac_bits);
        let probe = &mut NoProbe;
        let tap = &mut Tap::new(probe);
        let (value, bits, switches) = (x as f64 * power_of_two(-operand_frac_bits), config.bits as i32, ON());
        let mixed = MixedPrecision::new(value, &switches);
        let scientific = |(mantissa, exponent): (i64, i64)| mantissa as f64 * power_of_two(exponent as i32 - bits);
        prop_assert_eq!(mixed.reciprocal(&reciprocal).value, scientific(reciprocal.one(x, tap)));
        prop_assert_eq!(mixed.inverse_root(&root).value, scientific(root.one(x, tap)));
        // √x from the unit's words: its mantissa times its inverse root.
        let error = mixed.root(&root).value / value.sqrt() - 1.0;
        prop_assert!(error.abs() <= root.relative_error(), "{error}");
    }

    #[test]
    fn all_off_nothing_is_lost((config, operand_frac_bits) in units(), x in 1e-9..1e9f64) {
        let e = &mut Elaboration::default();
        let reciprocal = Reciprocal::new(e, "test", "reciprocal", config, operand_frac_bits);
        let root = ReciprocalRoot::new(e, "test", "root", config, operand_frac_bits);
        let off = OFF();
        let mixed = MixedPrecision::new(x, &off);
        prop_assert_eq!(mixed.reciprocal(&reciprocal).value, 1.0 / x);
        prop_assert_eq!([mixed.root(&root).value, mixed.inverse_root(&root).value], [x.sqrt(), 1.0 / x.sqrt()]);
        let whole = MixedPrecision::new(3.0, &off);
        let share = Fit::new(3, Word::new(Format::unsigned(1, 4)), Exact { int_bits: 4, frac_bits: 12 });
        prop_assert_eq!(mixed.share(&share, whole).value, x);
        prop_assert_eq!([mixed.at_least_an_ulp(&share, Scale::ONE).value, mixed.an_ulp_more(&share).value], [x; 2]);
    }
}

#[test]
fn a_register_keeps_its_value_modulo_its_range() {
    let on = ON();
    let register = Fit::new(
        3,
        Word::new(Format::signed(3, 2)),
        Exact {
            int_bits: 8,
            frac_bits: 2,
        },
    );
    let wrapped = |value: f64| MixedPrecision::new(value, &on).wrapped(&register).value;
    assert_eq!(
        [
            wrapped(3.75),
            wrapped(4.0),
            wrapped(-4.25),
            wrapped(8.5),
            wrapped(0.1)
        ],
        [3.75, -4.0, 3.75, 0.5, 0.1]
    );
}

//! Fit, checked against exact rationals computed here, and against the crate `fixed`.

use super::*;
use crate::num::Format;
use crate::num::lanes::Plain;
use crate::num::tests::formats;
use crate::num::words::PlainWords;
use fixed::types::extra::{U0, U4, U12, U16, U20, U24, U30};
use fixed::{FixedI8, FixedI16, FixedI32, FixedI64, FixedU8, FixedU16, FixedU32};
use proptest::prelude::*;

const ROUNDINGS: [Rounding; 3] = [Rounding::Truncate, Rounding::Nearest, Rounding::NearestEven];
const OVERFLOWS: [Overflow; 2] = [Overflow::Saturate, Overflow::Wrap];

/// `exact / 2^places` as a word, by division with remainder and by counting modulo 2^width.
fn oracle(exact: i64, places: i64, word: Word) -> (i64, Loss) {
    let exact = i128::from(exact);
    let (rounded, inexact) = if places <= 0 {
        (exact << -places, false)
    } else {
        let divisor = 1i128 << places;
        let (quotient, rest) = (exact.div_euclid(divisor), exact.rem_euclid(divisor));
        let up = match word.round {
            Rounding::Truncate => false,
            Rounding::Nearest => 2 * rest >= divisor,
            Rounding::NearestEven => {
                2 * rest > divisor || (2 * rest == divisor && quotient.rem_euclid(2) == 1)
            }
        };
        (quotient + i128::from(up), rest != 0)
    };
    let values = 1i128 << (word.format.int_bits + word.format.frac_bits);
    let (least, most) = if word.format.signed {
        (-(values / 2), values / 2 - 1)
    } else {
        (0, values - 1)
    };
    let (low, high) = (rounded < least, rounded > most);
    let wrap = word.overflow == Overflow::Wrap;
    let result = match (low, high, wrap) {
        (false, false, _) => rounded,
        (_, _, true) => (rounded - least).rem_euclid(values) + least,
        (true, ..) => least,
        _ => most,
    };
    (
        result as i64,
        Loss {
            inexact,
            saturated_low: low && !wrap,
            saturated_high: high && !wrap,
            wrapped: (low || high) && wrap,
        },
    )
}

fn shape(frac_bits: i32) -> Exact {
    Exact {
        int_bits: 62 - frac_bits,
        frac_bits,
    }
}

/// Every function that accepts `exact` for this word agrees with the rational.
fn agrees(fit: &Fit, exact: i64, more: i64) {
    let (word, loss) = oracle(exact, fit.places() + more, fit.word);
    assert_eq!(
        fit.one_shifted(exact, more),
        word,
        "{exact} / 2^{} as {:?}",
        fit.places() + more,
        fit.word
    );
    assert_eq!(
        fit.loss(exact, more),
        loss,
        "{exact} / 2^{} as {:?}",
        fit.places() + more,
        fit.word
    );
    if more == 0 {
        assert_eq!(fit.one(exact), word);
        assert_eq!(
            fit.lanes(Plain([exact; LANES])).0[0],
            word,
            "{exact} / 2^{} as {:?}, a lane",
            fit.places(),
            fit.word
        );
        let frac_bits = fit.word.format.frac_bits + fit.places() as i32;
        if exact >= 0 && fit.is_natural(64 - exact.leading_zeros() as i32 - frac_bits) {
            let exact = Plain([exact; LANES]);
            assert_eq!(
                fit.lanes_unsigned::<true, _>(exact).0[0],
                word,
                "{exact:?} / 2^{} as {:?}, a natural",
                fit.places(),
                fit.word
            );
            let within = fit.lanes_within::<true, _>(exact).0[0];
            assert!(
                loss.saturated_high || within == word,
                "{exact:?} / 2^{} as {:?}, within",
                fit.places(),
                fit.word
            );
        }
    }
}

/// All words up to eight bits, all modes, right shifts from −4 to 8, all results of 11 bits.
#[test]
fn fit_agrees_with_exact_rationals() {
    for width in 1..=8 {
        for (signed, int_bits) in [false, true]
            .into_iter()
            .flat_map(|signed| [-4, 0, 1, 3, width].map(|int_bits| (signed, int_bits)))
        {
            let frac_bits = width - int_bits;
            if frac_bits < 0 {
                continue;
            }
            let format = Format::fixed_point(signed, int_bits, frac_bits);
            for (round, overflow) in ROUNDINGS
                .into_iter()
                .flat_map(|round| OVERFLOWS.map(|overflow| (round, overflow)))
            {
                for places in -4..=8 {
                    let fit = Fit::new(
                        0,
                        Word {
                            format,
                            round,
                            overflow,
                        },
                        shape(frac_bits + places),
                    );
                    for exact in -1024..1024 {
                        agrees(&fit, exact, 0);
                    }
                    for first in (-1024..1024).step_by(LANES) {
                        let exact: [i64; LANES] = std::array::from_fn(|lane| first + lane as i64);
                        assert_eq!(fit.lanes(Plain(exact)).0, exact.map(|exact| fit.one(exact)));
                    }
                }
            }
        }
    }
}

const LANES: usize = crate::num::LANES;

fn words(width: std::ops::RangeInclusive<i32>) -> impl Strategy<Value = Word> {
    (
        formats(width),
        prop::sample::select(ROUNDINGS.to_vec()),
        prop::sample::select(OVERFLOWS.to_vec()),
    )
        .prop_map(|(format, round, overflow)| Word {
            format,
            round,
            overflow,
        })
}

/// Exact results of up to 62 bits: short ones as often as long ones, and ties.
fn exacts() -> impl Strategy<Value = i64> {
    (any::<i64>(), 1..64u32, 0..62u32).prop_map(|(bits, unused, zeros)| {
        let long = bits >> unused;
        if bits & 1 == 0 {
            long
        } else {
            (long >> zeros) << zeros
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    #[test]
    fn wide_fits_agree_with_exact_rationals(word in words(1..=48), exact in exacts(), places in -31..=62i32, more in -60..=100i64) {
        let fit = Fit::new(0, word, shape(word.format.frac_bits + places));
        agrees(&fit, exact, 0);
        agrees(&fit, exact, more.clamp(-60 - i64::from(places), 120 - i64::from(places)));
    }

    #[test]
    fn eight_lanes_equal_one(
        word in words(1..=48), exact in prop::array::uniform8(exacts()), places in -31..=62i32, more in prop::array::uniform8(-60..=100i64),
    ) {
        let fit = Fit::new(0, word, shape(word.format.frac_bits + places));
        let shifted = |more: [i64; LANES]| -> [i64; LANES] { std::array::from_fn(|lane| fit.one_shifted(exact[lane], more[lane])) };
        let one = exact.map(|exact| fit.one(exact));
        prop_assert_eq!(fit.lanes(Plain(exact)).0, one);
        prop_assert_eq!(fit.wide(Plain(exact)).0, one);
        if word.format.max() <= i64::from(i32::MAX) {
            prop_assert_eq!(fit.words_shifted(Plain(exact), PlainWords(more.map(|more| more as i32))).0.map(i64::from), shifted(more));
            prop_assert_eq!(fit.words_shifted(Plain(exact), PlainWords([more[0] as i32; LANES])).0.map(i64::from), shifted([more[0]; LANES]));
        }
    }

    /// Results of every shape, up to 2^bits.
    #[test]
    fn eight_narrow_words_equal_one(
        word in words(1..=31), bits in 1..=62i32, places in -31..=62i32, exact in prop::array::uniform8(exacts()), more in -20..=20i64,
    ) {
        let frac_bits = word.format.frac_bits + places;
        let fit = Fit::new(0, word, Exact { int_bits: bits - frac_bits, frac_bits });
        let exact = exact.map(|exact| (exact >> (62 - bits)).clamp(-1 << bits, 1 << bits));
        let one = exact.map(|exact| fit.one(exact));
        prop_assert_eq!(fit.words(Plain(exact)).0.map(i64::from), one);
        prop_assert_eq!(fit.top(Plain(exact)).0.map(i64::from), one);
        let shifted = exact.map(|exact| fit.one_shifted(exact, more));
        prop_assert_eq!(fit.words_shifted(Plain(exact), PlainWords([more as i32; LANES])).0.map(i64::from), shifted);
        let extreme = [1i64 << bits, -1 << bits].map(|exact| Plain([exact; LANES]));
        for exact in extreme {
            prop_assert_eq!(i64::from(fit.words(exact).0[0]), fit.one(exact.0[0]));
            prop_assert_eq!(i64::from(fit.top(exact).0[0]), fit.one(exact.0[0]));
        }
    }

    #[test]
    fn loss_is_reported_exactly(word in words(1..=48), exact in exacts(), places in -31..=62i32) {
        let fit = Fit::new(0, word, shape(word.format.frac_bits + places));
        let (fitted, loss) = (fit.one(exact), fit.loss(exact, 0));
        // There is no loss exactly if the word has the value of the rational.
        let same = if places >= 0 { i128::from(fitted) << places == i128::from(exact) } else { i128::from(exact) << -places == i128::from(fitted) };
        prop_assert_eq!(loss == Loss::default(), same);
        prop_assert!(!loss.saturated_low || fitted == word.format.min());
        prop_assert!(!loss.saturated_high || fitted == word.format.max());
    }

    #[test]
    fn fit_agrees_with_the_crate_fixed(bits in exacts()) {
        let source = FixedI64::<U20>::from_bits(bits);
        macro_rules! agrees {
            ($($target:ty, $signed:expr, $int_bits:expr, $frac_bits:expr;)*) => {$(
                let word = Word::new(Format::fixed_point($signed, $int_bits, $frac_bits)).rounded(Rounding::Truncate);
                let fit = |overflow| Fit::new(0, word.overflowing(overflow), shape(20)).one(bits);
                prop_assert_eq!(fit(Overflow::Wrap), i64::from(<$target>::wrapping_from_num(source).to_bits()));
                prop_assert_eq!(fit(Overflow::Saturate), i64::from(<$target>::saturating_from_num(source).to_bits()));
            )*};
        }
        agrees! {
            FixedI8<U0>, true, 8, 0; FixedI8<U4>, true, 4, 4; FixedU8<U4>, false, 4, 4; FixedU8<U0>, false, 8, 0;
            FixedI16<U12>, true, 4, 12; FixedI16<U4>, true, 12, 4; FixedU16<U12>, false, 4, 12; FixedU16<U16>, false, 0, 16;
            FixedI32<U16>, true, 16, 16; FixedI32<U30>, true, 2, 30; FixedI32<U0>, true, 32, 0;
            FixedU32<U24>, false, 8, 24; FixedU32<U20>, false, 12, 20; FixedU32<U0>, false, 32, 0;
        }
    }

    #[test]
    fn rounding_agrees_with_the_crate_fixed(bits in exacts()) {
        let source = FixedI64::<U20>::from_bits(bits);
        let whole = |round| Fit::new(0, Word::new(Format::signed(48, 0)).rounded(round), shape(20)).one(bits);
        let most = |v: FixedI64<U20>| v.to_num::<i64>();
        prop_assert_eq!(whole(Rounding::Truncate), most(source.floor()));
        prop_assert_eq!(whole(Rounding::NearestEven), most(source.round_ties_even()));
        // The crate rounds ties away from zero, the machine rounds them up: they differ only at
        // negative ties.
        let tie = bits < 0 && source.frac() == FixedI64::<U20>::from_num(0.5);
        prop_assert_eq!(whole(Rounding::Nearest), most(source.round()) + i64::from(tie));
    }

    #[test]
    fn products_and_sums_agree_with_the_crate_fixed(a in any::<i32>(), b in any::<i32>()) {
        let (x, y) = (FixedI32::<U16>::from_bits(a), FixedI32::<U24>::from_bits(b));
        let shape = Exact::from(Format::signed(16, 16)).times(Format::signed(8, 24));
        prop_assert_eq!(shape.frac_bits, 40);
        prop_assert_eq!(i64::from(a) * i64::from(b), x.wide_mul(y).to_bits());
        let back = Fit::new(0, Word::new(Format::signed(16, 16)).rounded(Rounding::Truncate), shape).one(i64::from(a) * i64::from(b));
        prop_assert_eq!(back, i64::from(x.wide_mul(y).saturating_to_num::<FixedI32<U16>>().to_bits()));
        let sum = Exact::from(Format::signed(16, 16)).plus(Format::signed(16, 16));
        let z = FixedI32::<U16>::from_bits(b);
        let fitted = |exact: i64, overflow| Fit::new(0, Word::new(Format::signed(16, 16)).overflowing(overflow), sum).one(exact);
        prop_assert_eq!(fitted(i64::from(a) + i64::from(b), Overflow::Saturate), i64::from(x.saturating_add(z).to_bits()));
        prop_assert_eq!(fitted(i64::from(a) - i64::from(b), Overflow::Wrap), i64::from(x.wrapping_sub(z).to_bits()));
    }
}

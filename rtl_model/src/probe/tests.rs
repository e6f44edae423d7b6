//! Meters, checked against ranges, which count one by one; ranges, checked against words and exact
//! results; narrowest formats, checked against every other format.

use super::*;
use crate::num::{Exact, Format, Overflow, Rounding, Word};
use proptest::prelude::*;

/// Exact results of 16 fraction bits, with their additional fraction bits, which become words of
/// signal 0.
fn results() -> impl Strategy<Value = Vec<(i64, i64)>> {
    prop::collection::vec(
        (
            prop_oneof![-1i64 << 30..1 << 30, -300..300i64, Just(0)],
            prop_oneof![Just(0i64), 0..6i64],
        ),
        0..40,
    )
}

fn words() -> impl Strategy<Value = Word> {
    let rounding = prop_oneof![
        Just(Rounding::Truncate),
        Just(Rounding::Nearest),
        Just(Rounding::NearestEven)
    ];
    let overflow = prop_oneof![Just(Overflow::Saturate), Just(Overflow::Wrap)];
    (any::<bool>(), -4..14i32, 6..20i32, rounding, overflow).prop_map(
        |(signed, int_bits, frac_bits, round, overflow)| Word {
            format: Format::fixed_point(signed, int_bits, frac_bits),
            round,
            overflow,
        },
    )
}

fn range_of(fit: &Fit, results: &[(i64, i64)]) -> Range {
    let mut ranges = Ranges::new(1);
    for &(exact, more) in results {
        ranges.word(fit, exact, more, fit.one_shifted(exact, more));
    }
    ranges.0[0]
}

/// Whether a format represents a number of ulp of `of`.
fn holds(format: Format, of: Format, ulps: i64) -> bool {
    let places = of.frac_bits - format.frac_bits;
    let word = ulps / (1 << places);
    word * (1 << places) == ulps && (format.min()..=format.max()).contains(&word)
}

proptest! {
    #[test]
    fn ranges_are_the_same_in_any_order_of_absorption(word in words(), parts in prop::collection::vec(results(), 3)) {
        let fit = Fit::new(0, word, Exact { int_bits: 30, frac_bits: 16 });
        let together = |order: &[&[usize]]| {
            order.iter().map(|group| {
                let all: Vec<_> = group.iter().flat_map(|part| parts[*part].clone()).collect();
                range_of(&fit, &all)
            }).fold(Range::default(), |mut whole, part| {
                whole.absorb(&part);
                whole
            })
        };
        let whole = together(&[&[0, 1, 2]]);
        prop_assert_eq!(whole, together(&[&[0], &[1], &[2]]));
        prop_assert_eq!(whole, together(&[&[2], &[0, 1]]));
        prop_assert_eq!(whole, together(&[&[1], &[2], &[0]]));
        prop_assert_eq!(whole.bins.iter().sum::<u64>(), whole.words);
    }

    #[test]
    fn the_narrowest_format_holds_every_result_and_no_narrower_one_does(word in words(), results in results()) {
        let fit = Fit::new(0, word, Exact { int_bits: 30, frac_bits: 16 });
        let (range, format) = (range_of(&fit, &results), word.format);
        let Some(narrowest) = range.narrowest(format) else {
            prop_assert!(results.is_empty());
            return Ok(());
        };
        let wide = Fit::new(0, Word { format: Format { int_bits: 28, signed: true, ..format }, ..word }, Exact { int_bits: 30, frac_bits: 16 });
        let all: Vec<i64> = results.iter().map(|(exact, more)| wide.before_limits(*exact, *more)).filter(|v| format.signed || *v >= 0).collect();
        prop_assert!(narrowest.signed == format.signed && narrowest.width() >= 1);
        prop_assert!(all.iter().all(|v| holds(narrowest, format, *v)), "{} of {:?}", narrowest, all);
        for less in [Format { int_bits: narrowest.int_bits - 1, ..narrowest }, Format { frac_bits: narrowest.frac_bits - 1, ..narrowest }] {
            let possible = less.width() >= 1 && less.frac_bits >= 0;
            // Bits of results below 0 count as used, although there is no word for them.
            let below = all.len() < results.len() || word.overflow == Overflow::Wrap || range.saturated_low + range.saturated_high > 0;
            prop_assert!(!possible || below || !all.iter().all(|v| holds(less, format, *v)), "{} of {:?}", less, all);
        }
    }
}

#[test]
fn a_range_counts_its_words() {
    let word = Word::new(Format::signed(2, 4));
    let fit = Fit::new(
        0,
        word,
        Exact {
            int_bits: 4,
            frac_bits: 6,
        },
    );
    // 1 ulp, 1½ ulp, −2 ulp, 0, and far too much.
    let range = range_of(&fit, &[(4, 0), (6, 0), (-8, 0), (0, 0), (400, 0), (16, 1)]);
    assert_eq!(
        [
            range.words,
            range.inexact,
            range.saturated_high,
            range.saturated_low,
            range.wrapped
        ],
        [6, 1, 1, 0, 0]
    );
    assert_eq!(
        [range.min, range.max, range.least, range.greatest],
        [-2, 31, -2, 100]
    );
    assert_eq!(
        (&range.bins[..7], range.any & 127),
        (&[1, 1, 3, 0, 0, 1, 0][..], 127)
    );
    assert_eq!(range.narrowest(word.format).unwrap().to_string(), "I4F4");
    assert_eq!(
        range_of(&fit, &[(0, 0)])
            .narrowest(word.format)
            .unwrap()
            .to_string(),
        "I1F0"
    );
    assert_eq!(Range::default().narrowest(word.format), None);
}

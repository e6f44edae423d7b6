use super::*;
use rtl_model::num::{Exact, Fit, Format, Overflow, Word};
use rtl_model::probe::{Probe, Ranges};

fn reported(word: Word, exact: &[i64]) -> SignalReport {
    let fit = Fit::new(
        0,
        word,
        Exact {
            int_bits: 8,
            frac_bits: 8,
        },
    );
    let mut ranges = Ranges::new(1);
    exact
        .iter()
        .for_each(|exact| ranges.word(&fit, *exact, 0, fit.one(*exact)));
    SignalReport::new(
        &Signal {
            unit: "ellipse",
            name: "slope_reciprocal.correction".into(),
            word,
        },
        &ranges.0[0],
    )
}

/// 256ths into I6F6: ¼, 1½, −1, 0, 3½, and one that is rounded.
#[test]
fn a_report_contains_the_extremes_of_a_range() {
    let report = reported(
        Word::new(Format::signed(6, 6)),
        &[64, 384, -256, 0, 896, 65],
    );
    assert_eq!(
        report.histogram,
        Histogram {
            zeros: 1,
            first_log2: -2,
            counts: vec![2, 0, 2, 1]
        }
    );
    assert_eq!(
        (
            report.narrowest.as_deref(),
            report.unused_high_bits,
            report.unused_low_bits
        ),
        (Some("I3F2"), Some(3), Some(4))
    );
    assert_eq!(
        (report.min, report.max, report.inexact_share, report.inexact),
        (Some(-1.0), Some(3.5), Some(1.0 / 6.0), 1)
    );
    assert_eq!(
        report.extent().parts,
        [(-2, 2.0 / 6.0), (-1, 0.0), (0, 2.0 / 6.0), (1, 1.0 / 6.0)]
    );
    let none = reported(Word::new(Format::signed(6, 6)), &[]);
    assert_eq!(
        (none.narrowest, none.inexact_share, none.histogram),
        (None, None, Histogram::default())
    );
}

#[test]
fn saturated_or_wrapped_results_need_a_wider_format() {
    for overflow in [Overflow::Saturate, Overflow::Wrap] {
        let report = reported(
            Word::new(Format::unsigned(2, 6)).overflowing(overflow),
            &[5000, 128],
        );
        assert_eq!(
            (
                report.narrowest.as_deref(),
                report.unused_high_bits,
                report.overflows()
            ),
            (Some("U5F5"), Some(-3), 1)
        );
        assert_eq!(report.extent().beyond, 3);
    }
}

#[test]
fn a_table_has_at_most_eighty_columns() {
    let signal = |word, exact: &[i64]| reported(word, exact);
    let wide = signal(Word::new(Format::signed(17, 14)), &[-30_001, 29_999]);
    let far = signal(Word::new(Format::unsigned(-2, 24)), &vec![5000; 100_000]);
    let text = table(&[wide, far, signal(Word::new(Format::signed(4, 4)), &[])]);
    assert!(
        text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
    assert!(text.contains("100k") && text.contains("-117.2"), "{text}");
}

#[test]
fn numbers_are_short_and_shares_are_not_rounded_to_all_or_nothing() {
    assert_eq!(
        [0.0, -12.5, 0.012, 1234.56, -65536.0, 1e-7].map(few_digits),
        ["0", "-12.5", "0.012", "1234.6", "-6.6e4", "1.0e-7"]
    );
    let parts = [(0, 9), (1, 1_000_000_000), (1, 2), (9999, 10_000), (7, 7)]
        .map(|(part, whole)| share(part, whole));
    assert_eq!(parts, ["–", "< 1%", "50%", "99%", "100%"]);
    assert_eq!(
        [9_999, 10_000, 999_999, 12_345_678].map(few_characters),
        ["9999", "10k", "999k", "12M"]
    );
}

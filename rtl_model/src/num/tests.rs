//! Formats as text, and exact shapes.

use super::*;
use proptest::prelude::*;

/// Every format up to `width` bits, with points inside and well outside the word.
pub fn formats(width: std::ops::RangeInclusive<i32>) -> impl Strategy<Value = Format> {
    (any::<bool>(), width, 0..=MAX_FRACTION_BITS).prop_map(|(signed, width, frac_bits)| {
        Format::fixed_point(signed, width - frac_bits, frac_bits)
    })
}

/// A third of the formats as floating point, with at least 2 significant bits. Some flush subnormal
/// numbers.
pub fn also_floating(format: Format, pick: u32) -> Format {
    let most = (format.magnitude_bits() - 1).min(float::MAX_SIGNIFICANT_BITS);
    let significant_bits = if pick.is_multiple_of(3) && most >= 2 {
        2 + (pick / 3) as i32 % (most - 1)
    } else {
        0
    };
    let is_one_normal = significant_bits <= format.frac_bits + 1;
    Format {
        significant_bits,
        flushes: significant_bits > 0 && is_one_normal && pick.is_multiple_of(2),
        ..format
    }
}

/// A word of a format; its extremes are as frequent as all other words.
pub fn word_of(format: Format, pick: u64) -> i64 {
    let any = ((pick >> 3) as i64).rem_euclid(1 << format.width()) + format.min();
    match pick & 7 {
        0 => format.min(),
        1 => format.max(),
        2 => 0,
        _ => any,
    }
}

fn refusal(text: &str) -> String {
    text.parse::<Format>().expect_err(text)
}

#[test]
fn every_valid_format_reads_back_what_it_writes() {
    for frac_bits in 0..=MAX_FRACTION_BITS {
        for width in 1..=MAX_WIDTH_BITS {
            for signed in [false, true] {
                let format = Format::fixed_point(signed, width - frac_bits, frac_bits);
                assert_eq!(format.to_string().parse(), Ok(format));
            }
        }
    }
}

#[test]
fn negative_integer_bits_omit_the_first_fraction_bits() {
    let format: Format = "U-2F14".parse().unwrap();
    assert_eq!((format.width(), format.min(), format.max()), (12, 0, 4095));
    assert_eq!(format.value(4096), 0.25);
    let format: Format = "I-1F9".parse().unwrap();
    assert_eq!((format.width(), format.min(), format.max()), (8, -128, 127));
}

#[test]
fn formats_that_cannot_be_built_are_refused_in_a_sentence() {
    assert_eq!(
        refusal("U0F0"),
        "`U0F0` is 0 bits wide: 1 to 48 can be modelled"
    );
    assert_eq!(
        refusal("I0F0"),
        "`I0F0` is 0 bits wide: 1 to 48 can be modelled"
    );
    assert_eq!(
        refusal("I99F3"),
        "`I99F3` is 102 bits wide: 1 to 48 can be modelled"
    );
    assert_eq!(
        refusal("U33F16"),
        "`U33F16` is 49 bits wide: 1 to 48 can be modelled"
    );
    assert_eq!(
        refusal("U-20F63"),
        "`U-20F63` has 63 fraction bits: 0 to 62 can be modelled"
    );
    assert_eq!(
        refusal("U-5F5"),
        "`U-5F5` is 0 bits wide: 1 to 48 can be modelled"
    );
    assert_eq!(
        refusal("U3F-1"),
        "`U3F-1` has -1 fraction bits: 0 to 62 can be modelled"
    );
}

#[test]
fn text_that_is_not_a_format_is_refused_with_an_example() {
    for text in [
        "", "I1", "F3", "U3", "u3f13", "u3F13", "i3F13", "U3f13", "i10F6", "3F13", "UF", "U3F",
        "UF3", "Ü3F1", "U３F1", "U3F1é", "€", " U3F13", "U3F13 ",
    ] {
        let sentence = refusal(text);
        assert!(
            sentence.starts_with(&format!("`{text}` is not a format")),
            "{sentence}"
        );
        assert!(sentence.contains("U3F13"), "{sentence}");
    }
    for text in [
        "U99999999999999999999F3",
        "I3F99999999999999999999",
        "U40000F1",
        "U+3F13",
        "U3F+13",
        "U3.0F2",
        "U3F1F1",
        "U--2F14",
    ] {
        assert!(refusal(text).contains("is not a format"), "{text}");
    }
}

#[test]
fn a_word_reads_back_in_both_of_its_spellings() {
    let plain: Word = serde_json::from_str("\"I10F6\"").unwrap();
    assert_eq!(plain, Word::new(Format::signed(10, 6)));
    assert_eq!(serde_json::to_string(&plain).unwrap(), "\"I10F6\"");
    let long: Word =
        serde_json::from_str(r#"{"format": "U3F13", "round": "nearest-even", "overflow": "wrap"}"#)
            .unwrap();
    assert_eq!(
        long,
        Word {
            format: Format::unsigned(3, 13),
            round: Rounding::NearestEven,
            overflow: Overflow::Wrap
        }
    );
    assert_eq!(
        serde_json::from_str::<Word>(&serde_json::to_string(&long).unwrap()).unwrap(),
        long
    );
    assert!(
        serde_json::from_str::<Word>("\"U0F0\"")
            .unwrap_err()
            .to_string()
            .contains("0 bits wide")
    );
}

/// `value · 2^(frac_bits)` of a word with fewer fraction bits.
fn aligned(word: i64, from: i32, to: i32) -> i128 {
    i128::from(word) << (to - from)
}

proptest! {
    #[test]
    fn no_text_makes_a_format_panic(text in "[UIui]?-?[0-9]{0,6}F?-?[0-9]{0,6}\\PC{0,2}") {
        let _ = text.parse::<Format>();
    }

    /// Magnitudes up to and including 2^bits, which the least signed word reaches.
    #[test]
    fn an_exact_shape_holds_every_result(a in formats(1..=31), b in formats(1..=31), picks in any::<[u64; 2]>()) {
        let [x, y] = [word_of(a, picks[0]), word_of(b, picks[1])];
        let holds = |shape: Exact, value: i128| value.unsigned_abs() <= 1 << shape.bits();
        let (own, other) = (Exact::from(a), Exact::from(b));
        let product = own.times(b);
        prop_assert!(holds(product, i128::from(x) * i128::from(y)));
        prop_assert_eq!(product.frac_bits, a.frac_bits + b.frac_bits);
        let sum = own.plus(other);
        let [p, q] = [aligned(x, a.frac_bits, sum.frac_bits), aligned(y, b.frac_bits, sum.frac_bits)];
        prop_assert!(holds(sum, p + q) && holds(sum, p - q));
        prop_assert!(holds(own.doubled(), 2 * i128::from(x)));
        prop_assert_eq!(own.scaled(5).bits(), own.bits());
    }

    #[test]
    fn terms_meet_at_the_finest_point(bits in prop::array::uniform3(0..60i32)) {
        let finest = bits.into_iter().max().unwrap();
        for (shift, bits) in align(bits).into_iter().zip(bits) {
            prop_assert_eq!(shift as i32 + bits, finest);
        }
    }
}

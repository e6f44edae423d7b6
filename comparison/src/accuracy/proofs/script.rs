//! Script: a proof in Gappa's language, and numbers in its notation.
//!
//! ```text
//! definitions      m = fixed<-26,dn>(x);
//! { hypotheses ->  { x in [1,2] ->
//!   goals }          x - m in [0,1b-26] }
//! rewritings       x*y - 1 -> (m*y - 1) + (x - m)*y;
//! ```
//! Gappa reasons about intervals; a rewriting gives it a form of an expression that keeps an
//! interval narrow. It checks that both forms are equal as polynomials, and warns if they are not.
//! Two habits keep proofs in seconds instead of minutes. First, intervals are of plain expressions,
//! without absolute values and without several implications. Second, statements per step of a table
//! contain only constants, with one lemma for everything that follows. `fixed<…>` is written around
//! an expression, never as `name fixed<…>= …`, which would round each operation in it.

use std::fmt::Write;

/// A proof under construction.
#[derive(Clone, Debug, Default)]
pub struct Script {
    /// Claim, subject and grounds.
    pub comments: Vec<String>,
    /// `name = expression`.
    pub definitions: Vec<String>,
    /// `expression in interval`, all assumed together.
    pub hypotheses: Vec<String>,
    /// `expression in interval`, all to be proved together.
    pub goals: Vec<String>,
    /// `expression -> equivalent expression`.
    pub rewritings: Vec<String>,
}

impl Script {
    /// The file's text.
    pub fn text(&self) -> String {
        let mut text = String::new();
        let mut lines = |all: &[String], before: &str, after: &str| {
            all.iter().for_each(|line| {
                // Writing to a string cannot fail.
                let _ = writeln!(text, "{before}{line}{after}");
            });
        };
        lines(&self.comments, "# ", "");
        lines(&self.definitions, "", ";");
        lines(
            &[
                "{".into(),
                self.hypotheses.join(" /\\\n"),
                "->".into(),
                self.goals.join(" /\\\n"),
                "}".into(),
            ],
            "",
            "",
        );
        lines(&self.rewritings, "", ";");
        text
    }
}

/// A number, exactly: `3b-2` is ¾.
pub fn number(value: f64) -> String {
    let bits = value.to_bits();
    let (exponent, fraction) = ((bits >> 52 & 0x7ff) as i32, bits & ((1 << 52) - 1));
    let significand = if exponent == 0 {
        fraction
    } else {
        fraction | 1 << 52
    };
    let zeros = significand.trailing_zeros().min(63);
    let sign = if value < 0.0 { "-" } else { "" };
    match significand {
        0 => "0".into(),
        _ => format!(
            "{sign}{}b{}",
            significand >> zeros,
            exponent.max(1) - 1075 + zeros as i32
        ),
    }
}

/// A word with this many fraction bits, as a number.
pub fn word(word: i64, frac_bits: i32) -> String {
    format!("{word}b{}", -frac_bits)
}

/// `[low,high]` of two words.
pub fn words(low: i64, high: i64, frac_bits: i32) -> String {
    format!("[{},{}]", word(low, frac_bits), word(high, frac_bits))
}

/// `[1−most,1+most]`, for a `most` from 2^−60 to 1.
pub fn near_one(most: f64) -> String {
    const FRAC_BITS: i32 = 113;
    let one = 1i128 << FRAC_BITS;
    // A number this small has no bit below 2^−113.
    let most = (most * f64::from(FRAC_BITS).exp2()) as i128;
    format!("[{}b-{FRAC_BITS},{}b-{FRAC_BITS}]", one - most, one + most)
}

/// `[−most,most]`.
pub fn within(most: f64) -> String {
    format!("[{},{}]", number(-most), number(most))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_written_exactly() {
        let read = |text: &str| {
            let (digits, exponent) = text.split_once('b').unwrap();
            digits.parse::<i64>().unwrap() as f64
                * f64::from(exponent.parse::<i32>().unwrap()).exp2()
        };
        for value in [
            1.0,
            -1.0,
            0.1,
            -0.3,
            1e-9,
            3.5e7,
            2.0,
            f64::MIN_POSITIVE,
            f64::EPSILON,
            1.0 - f64::EPSILON,
        ] {
            assert_eq!(read(&number(value)), value, "{}", number(value));
        }
        assert_eq!([0.75, -6.0, 0.0].map(number), ["3b-2", "-3b1", "0"]);
        assert_eq!(
            near_one(0.5),
            format!("[{}b-113,{}b-113]", 1i128 << 112, 3i128 << 112)
        );
        assert_eq!(
            (words(-1, 5, 3), within(0.5)),
            ("[-1b-3,5b-3]".into(), "[-1b-1,1b-1]".into())
        );
    }

    #[test]
    fn a_script_has_its_parts_in_order() {
        let all = |lines: &[&str]| lines.iter().map(|line| line.to_string()).collect();
        let script = Script {
            comments: all(&["x"]),
            definitions: all(&["m = x*x"]),
            hypotheses: all(&["x in [0,1]", "y in [0,1]"]),
            goals: all(&["m in [0,1]"]),
            rewritings: all(&["m -> x*x"]),
        };
        assert_eq!(
            script.text(),
            "# x\nm = x*x;\n{\nx in [0,1] /\\\ny in [0,1]\n->\nm in [0,1]\n}\nm -> x*x;\n"
        );
    }
}

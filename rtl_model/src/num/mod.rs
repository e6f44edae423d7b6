//! Num: numbers as hardware stores them: words of bits with a binary point.
//!
//! A format is two numbers; the rest is derived. Sums, differences and products are exact and grow.
//! Only one operation, [`Fit`], loses bits, at a named signal. A search for `fit` lists every place
//! where the machine loses bits.
//!
//! ```text
//! I10F6   iiiiiiiiii.ffffff    signed, the sign is one of the ten            −512 … 512 − 2⁻⁶
//! U3F13          iii.fffffffffffff                                              0 … 8 − 2⁻¹³
//! U-2F14            .00ffffffffffff    14 fraction bits, the first two always 0: 0 … ¼ − 2⁻¹⁴
//! ```
//! The notation is that of the crate `fixed`, which is used only as an oracle in tests.
//!
//! A floating-point word keeps only the most significant bits of such a format ([`float`]).

pub mod fit;
pub mod float;
pub mod lanes;
pub mod real;
pub mod register;
pub mod words;

pub use fit::{Fit, LimitedWords, Loss};
pub use lanes::{LANES, Lanes};
pub(crate) use lanes::{three, two};
pub use register::Register;
pub use words::{Exacts, Words};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Widest word that the model can hold, bits.
pub const MAX_WIDTH_BITS: i32 = 48;
/// Greatest number of fraction bits of a format.
pub const MAX_FRACTION_BITS: i32 = 62;

/// A fixed-point format: `value = word · 2^−frac_bits`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Format {
    /// Two's complement if set; the sign bit counts as one of `int_bits`.
    pub signed: bool,
    /// Bits before the binary point; negative if the first bits after it are always 0.
    pub int_bits: i32,
    /// Bits after the binary point, 0 to [`MAX_FRACTION_BITS`].
    pub frac_bits: i32,
    /// Significant bits that a floating-point word keeps, the leading one included; 0 for fixed
    /// point, which keeps all.
    pub significant_bits: i32,
    /// Whether the subnormal numbers of a floating-point word are flushed to zero.
    pub flushes: bool,
}

impl Format {
    /// A signed format `I{int}F{frac}`.
    pub const fn signed(int_bits: i32, frac_bits: i32) -> Self {
        Format::fixed_point(true, int_bits, frac_bits)
    }

    /// An unsigned format `U{int}F{frac}`.
    pub const fn unsigned(int_bits: i32, frac_bits: i32) -> Self {
        Format::fixed_point(false, int_bits, frac_bits)
    }

    /// A fixed-point format.
    pub const fn fixed_point(signed: bool, int_bits: i32, frac_bits: i32) -> Self {
        Format {
            signed,
            int_bits,
            frac_bits,
            significant_bits: 0,
            flushes: false,
        }
    }

    /// The fixed-point format that a floating-point word is based on.
    pub const fn in_fixed_point(self) -> Self {
        Format {
            significant_bits: 0,
            flushes: false,
            ..self
        }
    }

    /// Bits from the sign or the first integer bit to the last fraction bit. A floating-point word
    /// is stored in fewer: [`Format::stored_bits`].
    pub const fn width(self) -> i32 {
        self.int_bits + self.frac_bits
    }

    /// Smallest word.
    #[inline]
    pub const fn min(self) -> i64 {
        match (self.signed, self.is_float()) {
            (true, false) => -(1 << (self.width() - 1)),
            (true, true) => -self.max(),
            (false, _) => 0,
        }
    }

    /// Greatest word.
    #[inline]
    pub const fn max(self) -> i64 {
        let all = (1 << self.magnitude_bits()) - 1;
        if self.is_float() {
            self.greatest_float(all)
        } else {
            all
        }
    }

    /// Bits of the greatest magnitude, which a factor adds to the width of a product.
    pub const fn magnitude_bits(self) -> i32 {
        if self.signed {
            self.width() - 1
        } else {
            self.width()
        }
    }

    /// The closest format with these fraction bits and at most `most` bits: the suggestion of an
    /// elaboration error.
    pub fn within(self, most: i32) -> Format {
        let frac_bits = self.frac_bits.clamp(0, MAX_FRACTION_BITS);
        Format {
            int_bits: self.int_bits.clamp(1 - frac_bits, most - frac_bits),
            frac_bits,
            ..self
        }
    }

    /// With more fraction bits, or fewer. A floating-point word then keeps as many more significant
    /// bits, and the same exponents.
    pub fn finer(self, bits: i32) -> Format {
        let significant_bits = if self.is_float() {
            self.significant_bits.saturating_add(bits)
        } else {
            0
        };
        Format {
            frac_bits: self.frac_bits.saturating_add(bits),
            significant_bits,
            ..self
        }
    }

    /// The word that represents 1, if the format has one.
    pub const fn one(self) -> i64 {
        1 << self.frac_bits
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kept = Format {
            flushes: false,
            ..*self
        };
        if let Some((name, _)) = float::NAMED.iter().find(|(_, format)| *format == kept) {
            f.write_str(name)?;
        } else {
            let sign = if self.signed { 'I' } else { 'U' };
            write!(f, "{sign}{}F{}", self.int_bits, self.frac_bits)?;
            if self.is_float() {
                write!(f, "S{}", self.significant_bits)?;
            }
        }
        f.write_str(if self.flushes { "N" } else { "" })
    }
}

impl FromStr for Format {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (kept, flushes) = match text.strip_suffix('N') {
            Some(kept) => (kept, true),
            None => (text, false),
        };
        if let Some((_, format)) = float::NAMED.iter().find(|(name, _)| *name == kept) {
            return Ok(Format { flushes, ..*format });
        }
        let shape = || {
            format!(
                "`{text}` is not a format: write U or I, integer bits, F, fraction bits, as in U3F13 or I10F6; for floating point FP16, FP8(E4M3), FP8(E5M2), or S and significant bits, as in I8F24S11; N behind floating point flushes subnormal numbers to zero"
            )
        };
        let signed = match text.chars().next() {
            Some('I') => true,
            Some('U') => false,
            _ => return Err(shape()),
        };
        let (int_bits, frac_bits) = kept[1..].split_once('F').ok_or_else(shape)?;
        let number = |digits: &str| match digits.parse::<i16>() {
            Ok(number) if !digits.starts_with('+') => Ok(i32::from(number)),
            _ => Err(shape()),
        };
        let (frac_bits, significant_bits) = match frac_bits.split_once('S') {
            Some((frac_bits, significant)) => (frac_bits, Some(number(significant)?)),
            None => (frac_bits, None),
        };
        let format = Format {
            signed,
            int_bits: number(int_bits)?,
            frac_bits: number(frac_bits)?,
            significant_bits: significant_bits.unwrap_or(0),
            flushes,
        };
        format.check(text)?;
        match significant_bits {
            Some(_) => format.check_float(text)?,
            None if flushes => return Err(shape()),
            None => {}
        }
        Ok(format)
    }
}

impl Format {
    fn check(self, text: &str) -> Result<(), String> {
        if !(0..=MAX_FRACTION_BITS).contains(&self.frac_bits) {
            return Err(format!(
                "`{text}` has {} fraction bits: 0 to {MAX_FRACTION_BITS} can be modelled",
                self.frac_bits
            ));
        }
        if !(1..=MAX_WIDTH_BITS).contains(&self.width()) {
            return Err(format!(
                "`{text}` is {} bits wide: 1 to {MAX_WIDTH_BITS} can be modelled",
                self.width()
            ));
        }
        Ok(())
    }
}

/// The shape of an exact result: its bits above and below the binary point. Operations widen it and
/// never lose bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exact {
    /// Bits that the magnitude needs before the binary point (may be negative).
    pub int_bits: i32,
    /// Bits after the binary point.
    pub frac_bits: i32,
}

impl Exact {
    /// The shape of a product.
    pub fn times(self, other: impl Into<Exact>) -> Exact {
        let other = other.into();
        Exact {
            int_bits: self.int_bits + other.int_bits,
            frac_bits: self.frac_bits + other.frac_bits,
        }
    }

    /// The shape of a sum or difference.
    pub fn plus(self, other: impl Into<Exact>) -> Exact {
        let other = other.into();
        Exact {
            int_bits: self.int_bits.max(other.int_bits) + 1,
            frac_bits: self.frac_bits.max(other.frac_bits),
        }
    }

    /// The shape of twice the value, with the same bits.
    pub fn doubled(self) -> Exact {
        Exact {
            int_bits: self.int_bits + 1,
            ..self
        }
    }

    /// The shape of the value times 2^`places`, by wiring only.
    pub fn scaled(self, places: i32) -> Exact {
        Exact {
            int_bits: self.int_bits + places,
            frac_bits: self.frac_bits - places,
        }
    }

    /// Bits of the magnitude.
    pub fn bits(self) -> i32 {
        self.int_bits + self.frac_bits
    }
}

impl From<Format> for Exact {
    fn from(format: Format) -> Exact {
        Exact {
            int_bits: format.magnitude_bits() - format.frac_bits,
            frac_bits: format.frac_bits,
        }
    }
}

impl From<Word> for Exact {
    fn from(word: Word) -> Exact {
        word.format.into()
    }
}

/// Left shifts that bring terms with these fraction bits to a common binary point.
pub fn align<const N: usize>(frac_bits: [i32; N]) -> [u32; N] {
    let finest = frac_bits.into_iter().max().unwrap_or(0);
    frac_bits.map(|bits| (finest - bits).clamp(0, 62) as u32)
}

/// Rounding: treatment of the bits below a format's LSB.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Rounding {
    /// Dropped: towards minus infinity; in floating point towards zero.
    Truncate,
    /// To the nearest; ties go up, in floating point away from zero.
    #[default]
    Nearest,
    /// To the nearest; ties go to the even word.
    NearestEven,
}

impl Rounding {
    /// The value of the parameter ROUND of SystemVerilog modules.
    pub fn code(self) -> u8 {
        match self {
            Rounding::Truncate => 0,
            Rounding::Nearest => 1,
            Rounding::NearestEven => 2,
        }
    }
}

/// Overflow: treatment of a value outside a format's range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Overflow {
    /// The nearest word in range.
    #[default]
    Saturate,
    /// The low bits, as in an adder without guard bits.
    Wrap,
}

/// A signal's word: its format, rounding and overflow.
///
/// In JSON either `"U3F13"` or `{"format": "U3F13", "round": "truncate", "overflow": "wrap"}`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Word {
    /// Position of the bits.
    pub format: Format,
    /// Treatment below the LSB.
    pub round: Rounding,
    /// Treatment beyond the range.
    pub overflow: Overflow,
}

impl Word {
    /// A word with the default rounding and overflow: nearest, in floating point nearest even;
    /// saturate.
    pub const fn new(format: Format) -> Self {
        Word {
            format,
            round: Word::default_rounding(format),
            overflow: Overflow::Saturate,
        }
    }

    const fn default_rounding(format: Format) -> Rounding {
        if format.is_float() {
            Rounding::NearestEven
        } else {
            Rounding::Nearest
        }
    }

    /// The same word with another rounding.
    pub const fn rounded(self, round: Rounding) -> Self {
        Word { round, ..self }
    }

    /// The same word with another overflow.
    pub const fn overflowing(self, overflow: Overflow) -> Self {
        Word { overflow, ..self }
    }
}

impl fmt::Display for Word {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.format.fmt(f)
    }
}

/// A word in JSON: its format, or an object with format, rounding and overflow. A format is `U`
/// (unsigned) or `I` (signed) with the number of integer bits, which includes the sign bit, and `F`
/// with the number of fraction bits: `I4F22` has 26 bits; `U-2F16` has 14 bits, and its values are
/// from 0 to below 0.25. In floating point `S` and the number of significant bits follow:
/// `I8F24S11` has 11, from −128 to 128, and is 0 below 2^−25. `FP16` is `I17F24S11`, `FP8(E4M3)`
/// `I10F9S4`, and `FP8(E5M2)` `I17F16S3`. An `N` behind a floating-point format (only normal
/// numbers) flushes subnormal numbers to zero: `FP16N` is 0 below 2^−14.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
enum WordText {
    /// A format with the default rounding (nearest) and overflow (saturate), such as `U3F13`,
    /// `I10F6`, `U-2F14`.
    Short(
        #[schemars(regex(pattern = r"^([UI]-?\d+F\d+(S\d+N?)?|FP16N?|FP8\((E4M3|E5M2)\)N?)$"))]
        String,
    ),
    /// A format with its rounding and overflow.
    Long {
        #[schemars(regex(pattern = r"^([UI]-?\d+F\d+(S\d+N?)?|FP16N?|FP8\((E4M3|E5M2)\)N?)$"))]
        format: String,
        /// Left out, `nearest`; in floating point `nearest-even`.
        #[serde(default)]
        round: Option<Rounding>,
        #[serde(default)]
        overflow: Overflow,
    },
}

impl Serialize for Word {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let format = self.format.to_string();
        let text = if *self == Word::new(self.format) {
            WordText::Short(format)
        } else {
            WordText::Long {
                format,
                round: Some(self.round),
                overflow: self.overflow,
            }
        };
        text.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Word {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (format, round, overflow) = match WordText::deserialize(deserializer)? {
            WordText::Short(format) => (format, None, Overflow::default()),
            WordText::Long {
                format,
                round,
                overflow,
            } => (format, round, overflow),
        };
        let format: Format = format.parse().map_err(serde::de::Error::custom)?;
        if format.is_float() && overflow == Overflow::Wrap {
            return Err(serde::de::Error::custom(format!(
                "{format} wraps, but a floating-point word can only saturate"
            )));
        }
        Ok(Word {
            format,
            round: round.unwrap_or(Word::default_rounding(format)),
            overflow,
        })
    }
}

impl JsonSchema for Word {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Word".into()
    }

    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        WordText::json_schema(generator)
    }
}

#[cfg(test)]
pub(crate) mod tests;

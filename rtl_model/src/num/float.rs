//! Float: floating-point words.
//!
//! Such a word is a fixed-point word that keeps only its most significant bits, from the leading
//! one on. All operations on fixed-point words hold for it; only [`Fit`](super::Fit) drops more
//! bits, and only storage needs fewer. The position of the leading one is the exponent:
//!
//! ```text
//! I8F24S11   siiiiiii.ffffffffffffffffffffffff      the arithmetic's word, 32 bits
//!              └── 11 of them ──┘
//!            s eeeee ffffffffff                     the stored word: sign, exponent, fraction
//! ```
//! A format of m magnitude bits of which s are significant has m − s + 1 exponents. Numbers below
//! the least of them are subnormal, as in IEEE 754, unless the format flushes them to zero. Where
//! the exponents and the code of subnormal numbers fill the exponent field, the greatest code is
//! kept for NaN, as in FP8 (E4M3), and the largest number is one step lower. There are no
//! infinities: a word saturates.
//!
//! Laws: `stored_words_are_those_of_the_crate_half`,
//! `every_product_and_sum_of_8_bits_is_the_nearest_word`,
//! `products_and_sums_of_16_bits_are_those_of_the_crate_half`.

use super::Format;

/// Greatest number of significant bits: two factors of them have an exact product in 64 bits.
pub const MAX_SIGNIFICANT_BITS: i32 = 24;

/// Least number of significant bits: the leading one, and one fraction bit.
pub const LEAST_SIGNIFICANT_BITS: i32 = 2;

/// Formats that have names: IEEE 754 half precision, and the two of 8 bits of the Open Compute
/// Project (OCP OFP8).
pub const NAMED: [(&str, Format); 3] = [
    ("FP16", float(17, 24, 11)),
    ("FP8(E4M3)", float(10, 9, 4)),
    ("FP8(E5M2)", float(17, 16, 3)),
];

const fn float(int_bits: i32, frac_bits: i32, significant_bits: i32) -> Format {
    Format {
        significant_bits,
        ..Format::signed(int_bits, frac_bits)
    }
}

/// Right shift that leaves `significant_bits` bits of a magnitude, and at least `right`.
#[inline]
pub fn significant_shift(magnitude: u128, significant_bits: i32, right: u32) -> u32 {
    let bits = u128::BITS - magnitude.leading_zeros();
    right.max(bits.saturating_sub(significant_bits as u32))
}

impl Format {
    /// Whether it is floating point.
    #[inline]
    pub const fn is_float(self) -> bool {
        self.significant_bits > 0
    }

    /// Bits from a word's leading one on that can be other than 0.
    pub const fn kept_bits(self) -> i32 {
        if self.is_float() {
            self.significant_bits
        } else {
            self.magnitude_bits()
        }
    }

    /// Bits of the factor that a multiplier reads. The sign of a floating-point word is apart.
    pub const fn factor_bits(self) -> i32 {
        if self.is_float() {
            self.significant_bits
        } else {
            self.width()
        }
    }

    /// The least magnitude of a word other than 0.
    #[inline]
    pub const fn least_magnitude(self) -> i64 {
        if self.flushes {
            1 << (self.significant_bits - 1)
        } else {
            1
        }
    }

    /// Exponents of normal numbers.
    const fn exponents(self) -> i32 {
        self.magnitude_bits() - self.significant_bits + 1
    }

    /// Bits of the exponent field, which has a code for subnormal numbers too; 0 in fixed point.
    pub const fn exponent_bits(self) -> i32 {
        if self.is_float() {
            // The codes are 0 to the number of exponents.
            (u32::BITS - (self.exponents() as u32).leading_zeros()) as i32
        } else {
            0
        }
    }

    /// Bits of the stored word.
    pub const fn stored_bits(self) -> i32 {
        if self.is_float() {
            self.signed as i32 + self.exponent_bits() + self.significant_bits - 1
        } else {
            self.width()
        }
    }

    /// The greatest word, of a magnitude with `all` its bits set.
    pub(super) const fn greatest_float(self, all: i64) -> i64 {
        let place = 1 << (self.magnitude_bits() - self.significant_bits);
        let greatest = all - (place - 1);
        if self.exponents() + 1 == 1 << self.exponent_bits() {
            greatest - place
        } else {
            greatest
        }
    }

    /// The stored word of a word of the format: sign, exponent and fraction of a floating-point
    /// word, two's complement in fixed point.
    pub fn stored(self, word: i64) -> u64 {
        let mask = u64::MAX >> (64 - self.stored_bits());
        if !self.is_float() {
            return word as u64 & mask;
        }
        let fraction_bits = (self.significant_bits - 1) as u32;
        let magnitude = word.unsigned_abs();
        let shift = significant_shift(magnitude.into(), self.significant_bits, 0);
        // The leading one of a normal number adds 1 to the exponent code.
        let code = (u64::from(shift) << fraction_bits) + (magnitude >> shift);
        let sign = u64::from(word < 0) << (self.stored_bits() - 1);
        sign | code
    }

    /// The word of a stored word. The code for NaN reads as the next larger number.
    pub fn restored(self, stored: u64) -> i64 {
        if !self.is_float() {
            let unused = 64 - self.width() as u32;
            let top = (stored << unused) as i64;
            return if self.signed {
                top >> unused
            } else {
                (top as u64 >> unused) as i64
            };
        }
        let fraction_bits = (self.significant_bits - 1) as u32;
        let is_negative = self.signed && stored >> (self.stored_bits() - 1) & 1 == 1;
        let code = stored & (u64::MAX >> (64 - self.stored_bits() + i32::from(self.signed)));
        let (exponent, fraction) = (code >> fraction_bits, code & ((1 << fraction_bits) - 1));
        let magnitude = match exponent {
            0 => fraction,
            // A field can have codes beyond those of the format.
            _ => {
                ((1 << fraction_bits) + fraction)
                    << (exponent - 1).min(62 - u64::from(fraction_bits))
            }
        } as i64;
        if is_negative { -magnitude } else { magnitude }
    }

    /// Integer bits without which too few exponents are left, in floating point, or fewer than two
    /// bits.
    pub const fn least_int_bits(self) -> i32 {
        let least = if self.is_float() {
            self.significant_bits + 1 + self.signed as i32
        } else {
            2
        };
        least - self.frac_bits
    }

    /// The next representable word towards 0.
    pub fn representable(self, word: i64) -> i64 {
        if !self.is_float() {
            return word;
        }
        if word.abs() < self.least_magnitude() {
            return 0;
        }
        let shift = significant_shift(word.unsigned_abs().into(), self.significant_bits, 0);
        word.signum() * (word.abs() >> shift << shift)
    }

    /// The least representable word that is not below a word from 0 on.
    pub fn representable_from(self, word: i64) -> i64 {
        if !self.is_float() {
            return word;
        }
        if (1..self.least_magnitude()).contains(&word) {
            return self.least_magnitude();
        }
        let shift = significant_shift(word.unsigned_abs().into(), self.significant_bits, 0);
        self.representable(word + (1 << shift) - 1)
    }

    pub(super) fn check_float(self, text: &str) -> Result<(), String> {
        let most = MAX_SIGNIFICANT_BITS.min(self.magnitude_bits() - 1);
        if most < LEAST_SIGNIFICANT_BITS {
            return Err(format!(
                "`{text}` has {} bits of magnitude: floating point needs at least {}",
                self.magnitude_bits(),
                LEAST_SIGNIFICANT_BITS + 1
            ));
        }
        if self.flushes && self.significant_bits > self.frac_bits + 1 {
            return Err(format!(
                "`{text}` would flush 1 to zero: {} significant bits or {} fraction bits keep it",
                self.frac_bits + 1,
                self.significant_bits - 1
            ));
        }
        if (LEAST_SIGNIFICANT_BITS..=most).contains(&self.significant_bits) {
            return Ok(());
        }
        Err(format!(
            "`{text}` keeps {} significant bits of {}: {LEAST_SIGNIFICANT_BITS} to {most} can be modelled",
            self.significant_bits,
            self.magnitude_bits()
        ))
    }
}

#[cfg(test)]
mod tests;

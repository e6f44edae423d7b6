//! Record: converts words to one hexadecimal number of constant width, and back.
//!
//! The first field is in the most significant bits. Bits that fill up the top digit are 0.

use rtl_model::num::Format;
use rtl_model::pipeline::ports::Stream;

/// Layout of a stream's records.
#[derive(Clone, Debug)]
pub struct RecordLayout {
    /// Format of each field, from the top.
    formats: Vec<Format>,
    /// For each field, the indices of the flag fields that make it unused, and 0.
    unless: Vec<Vec<usize>>,
    /// Bits of a record.
    pub width: u32,
}

/// Why a line is not a record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Malformed {
    /// Number of digits found, and required.
    Digits(usize, usize),
    /// Not a hexadecimal digit.
    Digit(char),
    /// Bits above the record's width are set.
    TooWide,
}

/// A line without Verilog's comments and surrounding blanks; None if nothing else is on it.
/// `is_inside` is true inside an open `/*`.
pub fn without_comment(line: &str, is_inside: &mut bool) -> Option<String> {
    let (mut rest, mut kept, mut has_comment) = (line, String::new(), *is_inside);
    while !rest.is_empty() {
        if *is_inside {
            let Some((_, behind)) = rest.split_once("*/") else {
                break;
            };
            (rest, *is_inside) = (behind, false);
            continue;
        }
        let at = ["//", "/*"]
            .iter()
            .filter_map(|mark| rest.find(mark))
            .min()
            .unwrap_or(rest.len());
        kept.push_str(&rest[..at]);
        has_comment |= at < rest.len();
        *is_inside = rest[at..].starts_with("/*");
        rest = if *is_inside { &rest[at + 2..] } else { "" };
    }
    let kept = kept.trim();
    (!has_comment || !kept.is_empty()).then(|| kept.to_owned())
}

const DIGITS: &[u8; 16] = b"0123456789abcdef";

impl RecordLayout {
    /// The layout of a stream.
    pub fn new(stream: &Stream) -> Self {
        let place = |name: &str| stream.fields.iter().position(|field| field.name == name);
        RecordLayout {
            formats: stream
                .fields
                .iter()
                .map(|field| field.word.format)
                .collect(),
            unless: stream
                .fields
                .iter()
                .map(|field| field.unless.iter().filter_map(|flag| place(flag)).collect())
                .collect(),
            width: stream.width(),
        }
    }

    /// A layout of fields of these formats. Some are 0 if another field, given by its index, is not
    /// 0.
    pub fn of(formats: Vec<Format>, unless: Vec<Vec<usize>>) -> Self {
        RecordLayout {
            width: formats
                .iter()
                .map(|format| format.stored_bits() as u32)
                .sum(),
            formats,
            unless,
        }
    }

    /// The layout of unsigned fields of these widths.
    pub fn of_naturals(widths: &[u32]) -> Self {
        let formats = widths
            .iter()
            .map(|width| Format::unsigned(*width as i32, 0))
            .collect();
        RecordLayout::of(formats, vec![Vec::new(); widths.len()])
    }

    /// Hexadecimal digits of a record.
    pub fn digits(&self) -> usize {
        self.width.div_ceil(4) as usize
    }

    /// Sets unused fields of this record to 0.
    pub fn mask(&self, words: &mut [i64]) {
        for (field, flags) in self.unless.iter().enumerate() {
            if flags.iter().any(|flag| words[*flag] != 0) {
                words[field] = 0;
            }
        }
    }

    /// Appends a record's digits and a newline.
    pub fn write(&self, words: &[i64], text: &mut Vec<u8>) {
        debug_assert_eq!(words.len(), self.formats.len(), "as many words as fields");
        // At most a word of 63 bits and three bits left over.
        let (mut held, mut bits) = (0u128, self.digits() as u32 * 4 - self.width);
        for (&word, format) in words.iter().zip(&self.formats) {
            debug_assert_eq!(word, format.representable(word), "{format}");
            let width = format.stored_bits() as u32;
            held = held << width | u128::from(format.stored(word));
            bits += width;
            while bits >= 4 {
                bits -= 4;
                text.push(DIGITS[(held >> bits) as usize & 15]);
            }
            held &= (1 << bits) - 1;
        }
        text.push(b'\n');
    }

    /// The words of a line.
    ///
    /// # Errors
    /// Why the line is not a record.
    pub fn read(&self, line: &str) -> Result<Vec<i64>, Malformed> {
        if let Some(odd) = line.chars().find(|c| !c.is_ascii_hexdigit()) {
            return Err(Malformed::Digit(odd));
        }
        if line.len() != self.digits() {
            return Err(Malformed::Digits(line.len(), self.digits()));
        }
        let mut digits = line
            .bytes()
            .map(|digit| u128::from((digit as char).to_digit(16).unwrap_or(0)));
        let unused = self.digits() as u32 * 4 - self.width;
        let (mut held, mut bits) = (digits.next().unwrap_or(0), 4 - unused);
        if held >> bits != 0 {
            return Err(Malformed::TooWide);
        }
        let words = self.formats.iter().map(|format| {
            let width = format.stored_bits() as u32;
            while bits < width {
                held = held << 4 | digits.next().unwrap_or(0);
                bits += 4;
            }
            bits -= width;
            let stored = (held >> bits) as u64;
            held &= (1 << bits) - 1;
            format.restored(stored)
        });
        Ok(words.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_record_is_read_as_it_was_written(fields in prop::collection::vec((1u32..=63, any::<bool>(), any::<i64>()), 1..20)) {
            let formats = fields.iter().map(|&(width, signed, _)| Format {
                signed,
                ..Format::unsigned(width as i32, 0)
            });
            let layout = RecordLayout::of(formats.collect(), vec![Vec::new(); fields.len()]);
            let words: Vec<i64> = fields.iter().map(|&(width, signed, word)| {
                let top = word << (64 - width);
                if signed { top >> (64 - width) } else { (top as u64 >> (64 - width)) as i64 }
            }).collect();
            let mut text = Vec::new();
            layout.write(&words, &mut text);
            let line = String::from_utf8(text).unwrap();
            // Oracle: concatenates the bits and cuts them into fours.
            let bits: String = fields.iter().zip(&words)
                .flat_map(|(&(width, ..), word)| (0..width).rev().map(move |bit| if word >> bit & 1 == 1 { '1' } else { '0' }))
                .collect();
            let padded = format!("{}{bits}", "0".repeat(layout.digits() * 4 - bits.len()));
            let expected: String = padded.as_bytes().chunks(4)
                .map(|four| format!("{:x}", u8::from_str_radix(std::str::from_utf8(four).unwrap(), 2).unwrap()))
                .collect();
            prop_assert_eq!(line.trim_end(), expected);
            prop_assert_eq!(layout.read(line.trim_end()), Ok(words));
        }
    }

    #[test]
    fn comments_are_not_records_and_an_empty_line_is_none() {
        let mut is_inside = false;
        let mut kept = |line: &str| without_comment(line, &mut is_inside);
        assert_eq!(
            [kept("// 0x00000000"), kept("  // 1f"), kept("/* 1f */")],
            [None, None, None]
        );
        assert_eq!(
            [kept(" 1f // a"), kept("1/* x */f"), kept("")],
            [Some("1f".into()), Some("1f".into()), Some(String::new())]
        );
        assert_eq!(
            [kept("1f /* a"), kept("1f"), kept(""), kept("b */ 1e")],
            [Some("1f".into()), None, None, Some("1e".into())]
        );
    }

    #[test]
    fn each_kind_of_malformed_line_is_distinguished() {
        let layout = RecordLayout::of_naturals(&[3, 2]);
        assert_eq!(layout.read("1f"), Ok(vec![7, 3]));
        assert_eq!(layout.read("3f"), Err(Malformed::TooWide));
        assert_eq!(layout.read("f"), Err(Malformed::Digits(1, 2)));
        assert_eq!(layout.read("00f"), Err(Malformed::Digits(3, 2)));
        assert_eq!(layout.read("1x"), Err(Malformed::Digit('x')));
    }
}

//! Lines: reads the records of a file, as a simulator or `trace` wrote it, and checks each line.
//!
//! Comments and addresses of Verilog's `$writememh` are accepted: `// 0x00000000`, `@0`, `/* … */`.
//! An address must be that of the next record.

use super::Zeros;
use crate::cosim::trace::{Malformed, RecordLayout, without_comment};
use crate::error::{Error, Result};
use std::path::Path;

/// The records of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecordLines {
    /// Records, one per line.
    pub records: Vec<Vec<i64>>,
    /// Line of each record, from 1.
    pub numbers: Vec<u32>,
}

/// Text of a file.
pub fn read(path: &Path) -> Result<String> {
    let bytes = crate::input::read(path)
        .map_err(|e| Error::input(format!("{}: cannot be read: {e}", path.display())))?;
    String::from_utf8(bytes).map_err(|_| {
        Error::input(format!(
            "{}: is not a text; one record per line is needed, in hexadecimal",
            path.display()
        ))
    })
}

/// Reads the records of a file. Each line must be a record or a comment.
pub fn records(
    path: &Path,
    text: &str,
    layout: &RecordLayout,
    zeros: Zeros,
) -> Result<RecordLines> {
    let mut lines = RecordLines::default();
    let mut is_inside = false;
    for (number, line) in (1u32..).zip(text.lines()) {
        let fault =
            |what: String| Error::input(format!("{}: line {number} {what}", path.display()));
        let Some(line) = without_comment(line, &mut is_inside) else {
            continue;
        };
        if let Some(address) = line.strip_prefix('@') {
            let next = lines.records.len();
            if usize::from_str_radix(address.trim(), 16).ok() != Some(next) {
                return Err(fault(format!(
                    "is the address {line}, and the next record is {next:x} (hexadecimal): records have no gaps"
                )));
            }
            continue;
        }
        let mut words = layout
            .read(&line)
            .map_err(|malformed| fault(message(malformed, layout)))?;
        if zeros == Zeros::Ignored {
            layout.mask(&mut words);
        }
        lines.records.push(words);
        lines.numbers.push(number);
    }
    Ok(lines)
}

fn message(malformed: Malformed, layout: &RecordLayout) -> String {
    match malformed {
        Malformed::Digits(0, needed) => format!("is empty; {needed} digits are needed"),
        Malformed::Digits(found, needed) => {
            format!("has {found} digits, and a record has {needed}")
        }
        Malformed::Digit(digit) if "xXzZ".contains(digit) => {
            format!("has `{digit}` in it: bits that the simulator does not know")
        }
        Malformed::Digit(digit) => format!(
            "has `{}` in it, which is not a hexadecimal digit",
            digit.escape_default()
        ),
        Malformed::TooWide => format!("has bits above the {} of a record", layout.width),
    }
}

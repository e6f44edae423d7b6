//! Text: tables and lines for a terminal of 80 columns.

use comfy_table::{CellAlignment, Table, presets};

/// Columns of the terminal for which summaries are formatted.
const COLUMNS: usize = 80;

/// An integer with thousands separators.
pub fn thousands(number: u64) -> String {
    let digits = number.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

/// Bytes in decimal gigabytes.
pub fn gigabytes(bytes: u64) -> String {
    format!("{:.1} GB", bytes as f64 / 1e9)
}

/// Seconds in words, rounded.
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 1.0 => format!("{s:.1} s"),
        s if s < 100.0 => format!("{s:.0} s"),
        s => format!("{:.0} minutes", s / 60.0),
    }
}

/// A part of a whole in per cent: 100 % only if exact, and a dash for nothing.
pub fn share(part: u64, whole: u64) -> String {
    match part {
        0 => "–".into(),
        _ if part == whole => "100%".into(),
        _ if part * 100 < whole => "< 1%".into(),
        _ => format!("{}%", part * 100 / whole),
    }
}

/// A number and the word behind it: `1 field`, `2 fields`.
pub fn counted(count: u64, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

/// Breaks a line that is longer than a terminal's between words, with indented continuation lines.
pub fn wrapped(line: &str) -> String {
    let mut out = String::new();
    let mut column = 0;
    for word in line.split_inclusive(' ') {
        let length = word.trim_end().chars().count();
        if column > 4 && column + length > COLUMNS {
            out.truncate(out.trim_end().len());
            out.push_str("\n    ");
            column = 4;
        }
        out.push_str(word);
        column += word.chars().count();
    }
    out
}

/// A table without lines.
pub fn plain_table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(header);
    table
}

/// A value of JSON; a string without its quotes.
pub fn plain(value: &serde_json::Value) -> String {
    value
        .as_str()
        .map_or_else(|| value.to_string(), str::to_owned)
}

/// All columns but the first right-aligned and close together.
pub fn aligned(mut table: Table) -> Table {
    let columns = table.column_count();
    for (i, column) in table.column_iter_mut().enumerate() {
        let last = i + 1 == columns;
        column.set_padding((0, if last { 0 } else { 2 }));
        if i > 0 {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

/// The beginning of a word on one line; the word may have megabytes of arbitrary characters.
pub fn clipped(word: &str) -> String {
    const MOST: usize = 40;
    let mut clipped: String = word
        .chars()
        .take(MOST)
        .flat_map(char::escape_debug)
        .collect();
    if word.chars().nth(MOST).is_some() {
        clipped.push('…');
    }
    clipped
}

/// JSON inside a `script` element of a page, without any text that ends the element or begins a
/// comment.
pub fn json_in_html(value: &serde_json::Value) -> String {
    value.to_string().replace('<', "\\u003c")
}

/// Greatest number of sentences in a list of faults; the others are counted.
const MOST_LISTED: usize = 8;

/// Joins half sentences; of a long list the first ones and the number of the others.
pub fn listed(sentences: &[String]) -> String {
    let (first, rest) = sentences.split_at(sentences.len().min(MOST_LISTED));
    let rest = if rest.is_empty() {
        String::new()
    } else {
        format!("; and {} more", rest.len())
    };
    first.join("; ") + &rest
}

/// Whether a character would end a line or control a terminal.
pub fn is_unprintable(letter: char) -> bool {
    letter.is_control() || matches!(letter, '\u{2028}' | '\u{2029}')
}

/// A name as one line of text, with `_` for unprintable characters.
pub fn one_line(name: &str) -> String {
    name.replace(is_unprintable, "_")
}

/// A word of a command line, quoted if a shell would interpret it.
pub fn quoted_for_shell(word: &str) -> String {
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "_-./=:,+@%".contains(letter);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

/// Bytes as hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_line_is_broken_between_words_and_a_long_word_is_not() {
        assert_eq!(wrapped("  short  as it is"), "  short  as it is");
        let long = wrapped(&"word ".repeat(40));
        assert!(
            long.lines().count() == 3
                && long
                    .lines()
                    .all(|line| line.len() <= 80 && line.trim_end() == line
                        || line.ends_with("word ")),
            "{long}"
        );
        assert!(
            long.lines()
                .skip(1)
                .all(|line| line.starts_with("    word"))
        );
        let path = "/".repeat(100);
        assert_eq!(
            wrapped(&format!("note: {path} is long")),
            format!("note:\n    {path}\n    is long")
        );
    }

    #[test]
    fn a_long_list_is_cut_and_counted() {
        let all: Vec<String> = (1..=68).map(|number| number.to_string()).collect();
        assert_eq!(listed(&all[..2]), "1; 2");
        assert_eq!(listed(&all[..8]), "1; 2; 3; 4; 5; 6; 7; 8");
        assert_eq!(listed(&all), "1; 2; 3; 4; 5; 6; 7; 8; and 60 more");
    }

    #[test]
    fn a_name_is_one_line() {
        assert_eq!(one_line("a\nb\u{2028}c\u{1b}[1m é"), "a_b_c_[1m é");
        assert_eq!(
            clipped(&format!("{}\n", "x".repeat(40))),
            format!("{}…", "x".repeat(40))
        );
    }

    #[test]
    fn json_in_a_page_is_unchanged_and_has_no_markup() {
        let value = serde_json::json!({"</script>": "<!--<script>", "é": [1, "<"]});
        let text = json_in_html(&value);
        assert!(!text.contains('<') && text.contains("\\u003c!--"), "{text}");
        assert_eq!(
            serde_json::from_str::<serde_json::Value>(&text).unwrap(),
            value
        );
    }

    #[test]
    fn thousands_are_separated() {
        assert_eq!(
            [0, 999, 1000, 1_234_567].map(thousands),
            ["0", "999", "1,000", "1,234,567"]
        );
    }
}

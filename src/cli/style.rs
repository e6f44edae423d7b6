//! Style: colours on a terminal unless NO_COLOR is set; plain text everywhere else.

use std::io::IsTerminal;

const BOLD: &str = "\x1b[1m";
const RED: &str = "\x1b[1;31m";
const PLAIN: &str = "\x1b[0m";

/// Whether a stream is a terminal that supports colours, and NO_COLOR is not set (no-color.org).
pub(super) fn use_colour(stream: &impl IsTerminal) -> bool {
    let no_color = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    allows(
        stream.is_terminal(),
        no_color,
        std::env::var_os("TERM").is_some_and(|name| name == "dumb"),
    )
}

fn allows(is_terminal: bool, no_color: bool, is_dumb: bool) -> bool {
    is_terminal && !no_color && !is_dumb
}

/// Formats the head of an error.
pub(super) fn alarm(text: &str) -> String {
    format!("{RED}{text}{PLAIN}")
}

/// Makes table heads bold: the first line of a block, if its columns are separated by two spaces.
pub(super) fn with_headings(text: &str) -> String {
    let mut is_first = true;
    let mut line = |line: &str| {
        let is_head = is_first && line.trim_start().contains("  ");
        is_first = line.trim().is_empty();
        if is_head {
            format!("{BOLD}{line}{PLAIN}")
        } else {
            line.to_owned()
        }
    };
    text.split('\n')
        .map(&mut line)
        .collect::<Vec<_>>()
        .join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_of_tables_are_bold_and_nothing_else() {
        let text = "  unit  cycles\nraster      12\n\none sentence\nand another  one";
        assert_eq!(
            with_headings(text),
            "\x1b[1m  unit  cycles\x1b[0m\nraster      12\n\none sentence\nand another  one"
        );
    }

    #[test]
    fn only_a_terminal_without_no_color_has_colours() {
        assert!(allows(true, false, false));
        assert!(
            !allows(false, false, false)
                && !allows(true, true, false)
                && !allows(true, false, true)
        );
    }
}

//! Style: colours on a terminal, where NO_COLOR does not forbid them; plain text everywhere else.

use std::io::IsTerminal;

const BOLD: &str = "\x1b[1m";
const RED: &str = "\x1b[1;31m";
const PLAIN: &str = "\x1b[0m";

/// Whether a stream takes colours: a terminal does, but for those that ask not to (no-color.org).
pub(super) fn takes_colour(stream: &impl IsTerminal) -> bool {
    let says_no = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    allows(
        stream.is_terminal(),
        says_no,
        std::env::var_os("TERM").is_some_and(|name| name == "dumb"),
    )
}

fn allows(is_terminal: bool, says_no: bool, is_dumb: bool) -> bool {
    is_terminal && !says_no && !is_dumb
}

/// The head of an error.
pub(super) fn alarm(text: &str) -> String {
    format!("{RED}{text}{PLAIN}")
}

/// The text with the heads of its tables in bold: first lines of blocks, whose columns lie apart.
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
    fn only_a_terminal_that_does_not_say_no_has_colours() {
        assert!(allows(true, false, false));
        assert!(
            !allows(false, false, false)
                && !allows(true, true, false)
                && !allows(true, false, true)
        );
    }
}

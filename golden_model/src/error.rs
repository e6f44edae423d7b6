//! Error: describes a failure in one sentence, with the exit status that separates bad input from a
//! failed job.

use rayon::prelude::*;
use std::borrow::Cow;

/// One sentence for the user, and the kind of failure.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The command line or an input file is wrong: exit status 2.
    #[error("{0}")]
    Input(String),
    /// The job itself failed (for example because a disk is full): exit status 1.
    #[error("{0}")]
    Job(String),
}

impl Error {
    /// An error of the input, in one sentence: which file, which field or line, the fault, and a
    /// correct value.
    pub fn input(sentence: impl Into<String>) -> Self {
        Error::Input(one_line(sentence.into()))
    }

    /// An error of the job, in one sentence.
    pub fn job(sentence: impl Into<String>) -> Self {
        Error::Job(one_line(sentence.into()))
    }

    /// Exit status of the process: 1 or 2.
    pub fn exit_status(&self) -> u8 {
        match self {
            Error::Job(_) => 1,
            Error::Input(_) => 2,
        }
    }
}

/// Greatest number of characters of a word in a sentence, and of a sentence. Paths have up to 4096
/// bytes, and names in files can have megabytes; longer ones are shortened to beginning and end.
const LONGEST_WORD: usize = 320;
const LONGEST: usize = 1_600;

/// The sentence on one line and with a readable length, whatever names and paths it quotes.
fn one_line(sentence: String) -> String {
    let escaped = |letter: char| {
        if letter.is_control() {
            letter.escape_default().to_string()
        } else {
            letter.to_string()
        }
    };
    let sentence = if sentence.contains(char::is_control) {
        sentence.chars().map(escaped).collect()
    } else {
        sentence
    };
    if sentence.len() <= LONGEST_WORD {
        return sentence;
    }
    let words: Vec<Cow<str>> = sentence
        .split(' ')
        .map(|word| shortened(word, LONGEST_WORD))
        .collect();
    shortened(&words.join(" "), LONGEST).into_owned()
}

/// The beginning and the end of a text with more than `most` characters.
fn shortened(text: &str, most: usize) -> Cow<'_, str> {
    let place = |letter: usize| text.char_indices().nth(letter).map(|(at, _)| at);
    if text.len() <= most || place(most).is_none() {
        return text.into();
    }
    let end = text
        .char_indices()
        .rev()
        .nth(most / 4)
        .map_or(0, |(at, _)| at);
    format!(
        "{}…{}",
        &text[..place(most * 3 / 4 - 2).unwrap_or(0)],
        &text[end..]
    )
    .into()
}

/// Result of a step of the bench.
pub type Result<T> = std::result::Result<T, Error>;

/// The results of several threads, or the first error in their order. rayon's own `collect` returns
/// the error that occurs first in time.
///
/// # Errors
/// The first error.
pub fn in_order<T: Send>(results: impl ParallelIterator<Item = Result<T>>) -> Result<Vec<T>> {
    results.collect::<Vec<_>>().into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_sentence_is_short_and_shows_beginning_and_end_of_long_quotations() {
        let long = "é".repeat(1 << 20);
        let message = Error::input(format!("scene.json: a{long}z is not a file")).to_string();
        assert!(
            message.starts_with("scene.json: aé")
                && message.ends_with("éz is not a file")
                && message.contains('…'),
            "{message}"
        );
        assert!(message.chars().count() < 360, "{message}");
        let message =
            Error::job(format!("begins {} ends", "word and ".repeat(1 << 20))).to_string();
        assert!(
            message.starts_with("begins word")
                && message.ends_with("and  ends")
                && message.chars().count() == LONGEST,
            "{}",
            message.len()
        );
        assert_eq!(
            Error::input("\n".repeat(1 << 20))
                .to_string()
                .chars()
                .count(),
            LONGEST_WORD
        );
        let path = format!("/{}", "x".repeat(LONGEST_WORD - 1));
        assert_eq!(Error::input(path.clone()).to_string(), path);
    }

    #[test]
    fn the_first_error_in_order_is_returned_although_another_occurs_earlier() {
        let step = |number: u32| match number {
            0 => {
                std::thread::sleep(Duration::from_millis(50));
                Err(Error::input("the first"))
            }
            99 => Err(Error::input("the last")),
            number => Ok(number),
        };
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(4)
            .build()
            .unwrap();
        let message = pool
            .install(|| in_order((0..100).into_par_iter().map(step)))
            .unwrap_err();
        assert_eq!(message.to_string(), "the first");
        assert_eq!(
            pool.install(|| in_order((1..9).into_par_iter().map(step)))
                .unwrap(),
            [1, 2, 3, 4, 5, 6, 7, 8]
        );
    }
}

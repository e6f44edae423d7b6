//! Error: names what went wrong in one sentence, and the exit status that says whose fault it was.

use rayon::prelude::*;

/// One sentence for the user, and whose fault it was.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The command line or an input file is wrong: exit status 2.
    #[error("{0}")]
    Input(String),
    /// The job itself failed (a disk is full, say): exit status 1.
    #[error("{0}")]
    Job(String),
}

impl Error {
    /// Blames the input, in one sentence: which file, which field or line, what is wrong, what would be right.
    pub fn input(sentence: impl Into<String>) -> Self {
        Error::Input(one_line(sentence.into()))
    }

    /// Blames the job, in one sentence.
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

/// The sentence on one line, whatever names and paths it quotes.
fn one_line(sentence: String) -> String {
    let escaped = |letter: char| if letter.is_control() { letter.escape_default().to_string() } else { letter.to_string() };
    if sentence.contains(char::is_control) { sentence.chars().map(escaped).collect() } else { sentence }
}

/// Result of a step of the bench.
pub type Result<T> = std::result::Result<T, Error>;

/// All that several threads make, or the first error in its order: rayon's own `collect` gives that of whichever thread has one first.
///
/// # Errors
/// The first of them.
pub fn in_order<T: Send>(results: impl ParallelIterator<Item = Result<T>>) -> Result<Vec<T>> {
    results.collect::<Vec<_>>().into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn the_first_error_is_told_though_another_comes_sooner() {
        let step = |number: u32| match number {
            0 => {
                std::thread::sleep(Duration::from_millis(50));
                Err(Error::input("the first"))
            }
            99 => Err(Error::input("the last")),
            number => Ok(number),
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(4).build().unwrap();
        let told = pool.install(|| in_order((0..100).into_par_iter().map(step))).unwrap_err();
        assert_eq!(told.to_string(), "the first");
        assert_eq!(pool.install(|| in_order((1..9).into_par_iter().map(step))).unwrap(), [1, 2, 3, 4, 5, 6, 7, 8]);
    }
}

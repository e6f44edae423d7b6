//! Error: names what went wrong in one sentence, and the exit status that says whose fault it was.

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

//! What can go wrong, and the exit status that says so.

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
    /// A fault of the input, told in one sentence: which file, which field or line, what is wrong, what would be right.
    pub fn input(sentence: impl Into<String>) -> Self {
        Error::Input(sentence.into())
    }

    /// A failure of the job, told in one sentence.
    pub fn job(sentence: impl Into<String>) -> Self {
        Error::Job(sentence.into())
    }

    /// Exit status of the process: 1 or 2.
    pub fn exit_status(&self) -> u8 {
        match self {
            Error::Job(_) => 1,
            Error::Input(_) => 2,
        }
    }
}

/// What a step of the bench returns.
pub type Result<T> = std::result::Result<T, Error>;

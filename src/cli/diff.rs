//! Diff: compares a device's output with a trace, and names the first mismatch.

use super::arguments::pretty;
use crate::cosim::diff::{self, Zeros};
use crate::error::{Error, Result};
use clap::Args;
use std::ffi::OsString;
use std::path::PathBuf;

/// End of the help text.
pub(super) const HELP: &str = "Streams whose order counts at each pixel only may come in another.\n\
    What means nothing in a record, as the pixel of a culled splat, must be 0:\n\
    --strict compares it.\n\
    Exit status 0 where all is equal, 1 where it is not, 2 where a file is malformed";

#[derive(Args, Debug)]
pub(super) struct Typed {
    /// The folder that `trace` wrote
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// A stream, as raster.out, and a file of records
    #[arg(required = true, num_args = 2.., value_names = ["STREAM", "FILE"])]
    outputs: Vec<OsString>,
    /// Compare fields that must be 0 too
    #[arg(long)]
    strict: bool,
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
}

/// A comparison that can be made.
pub(super) struct Job {
    folder: PathBuf,
    /// Streams, and a device's records of each.
    outputs: Vec<(String, PathBuf)>,
    zeros: Zeros,
    json: bool,
}

impl Typed {
    pub fn check(self) -> Result<Job> {
        let (pairs, rest) = self.outputs.as_chunks::<2>();
        if let [alone] = rest {
            return Err(Error::input(format!("{}: a stream needs the file of a device's records behind it", alone.display())));
        }
        let outputs = pairs.iter().map(|[stream, file]| (stream.to_string_lossy().into_owned(), file.into())).collect();
        let zeros = if self.strict { Zeros::Compared } else { Zeros::Ignored };
        Ok(Job { folder: self.folder, outputs, zeros, json: self.json })
    }
}

impl Job {
    pub fn run(self) -> Result<String> {
        let outcome = diff::diff(&self.folder, &self.outputs, self.zeros)?;
        let text = if self.json { pretty(&outcome.json)? } else { outcome.text };
        if outcome.equal {
            return Ok(text);
        }
        // What is different is a result, and goes where results go; the status says that the device failed.
        super::print(&text)?;
        Err(Error::job(format!("{} is not what the trace has", outcome.json["stream"].as_str().unwrap_or("a stream"))))
    }
}

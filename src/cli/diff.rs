//! Diff: compares a device's output with a trace, and names the first mismatch.

use super::arguments::pretty;
use crate::cosim::diff::{self, DiffOptions, RequiredOrder, Zeros};
use crate::error::{Error, Result};
use clap::Args;
use std::ffi::OsString;
use std::path::PathBuf;

#[derive(Args, Debug)]
pub(super) struct DiffArgs {
    /// Folder of `trace`
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Pairs: a stream, as gauss.out, and the file of its records
    #[arg(required = true, num_args = 2.., value_names = ["STREAM", "FILE"])]
    outputs: Vec<OsString>,
    /// Also compare unused fields, which must be 0
    #[arg(long)]
    strict: bool,
    /// Expect `trace`, `tiles` or `any` order
    #[arg(long, value_name = "ORDER", value_enum, hide_possible_values = true)]
    order: Option<OrderFlag>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// `--order`.
#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum OrderFlag {
    /// As the trace has them
    Trace,
    /// Tile by tile, as a binned design gives them
    Tiles,
    /// Any: by tag and pixel
    Any,
}

/// Checked arguments.
pub(super) struct DiffJob {
    folder: PathBuf,
    /// Streams, each with the file of a device's records.
    outputs: Vec<(String, PathBuf)>,
    how: DiffOptions,
    json: bool,
}

impl DiffArgs {
    pub fn check(self) -> Result<DiffJob> {
        let (pairs, rest) = self.outputs.as_chunks::<2>();
        if let [unpaired] = rest {
            return Err(Error::input(format!(
                "{}: a stream needs the file of a device's records after it",
                unpaired.display()
            )));
        }
        let outputs = pairs
            .iter()
            .map(|[stream, file]| (stream.to_string_lossy().into_owned(), file.into()))
            .collect();
        let zeros = if self.strict {
            Zeros::Compared
        } else {
            Zeros::Ignored
        };
        let order = self.order.map_or(RequiredOrder::Auto, |order| match order {
            OrderFlag::Trace => RequiredOrder::Trace,
            OrderFlag::Tiles => RequiredOrder::Tiles,
            OrderFlag::Any => RequiredOrder::Any,
        });
        Ok(DiffJob {
            folder: self.folder,
            outputs,
            how: DiffOptions { zeros, order },
            json: self.json,
        })
    }
}

impl DiffJob {
    pub fn run(self) -> Result<String> {
        let outcome = diff::diff(&self.folder, &self.outputs, self.how)?;
        let text = if self.json {
            pretty(&outcome.json)?
        } else {
            outcome.text
        };
        if outcome.equal {
            return Ok(text);
        }
        // A difference is a result and is printed to standard output; the exit status reports
        // failure.
        super::print(&text)?;
        Err(Error::job(format!(
            "{} differs from the trace",
            outcome.json["stream"].as_str().unwrap_or("a stream")
        )))
    }
}

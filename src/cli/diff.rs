//! Diff: compares a device's output with a trace, and names the first mismatch.

use super::arguments::pretty;
use crate::cosim::diff::{self, How, Order, Zeros};
use crate::error::{Error, Result};
use clap::Args;
use std::ffi::OsString;
use std::path::PathBuf;

#[derive(Args, Debug)]
pub(super) struct Typed {
    /// Folder of `trace`
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Stream, as raster.out, and a file of records
    #[arg(required = true, num_args = 2.., value_names = ["STREAM", "FILE"])]
    outputs: Vec<OsString>,
    /// Also compare unused fields, which must be 0
    #[arg(long)]
    strict: bool,
    /// Expect `trace`, `tiles` or `any` order
    #[arg(long, value_name = "ORDER", value_enum, hide_possible_values = true)]
    order: Option<Typable>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// An order, as it is typed.
#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum Typable {
    /// As the trace has them
    Trace,
    /// Tile by tile, as a binned design gives them
    Tiles,
    /// Any: by tag and pixel
    Any,
}

/// A comparison that can be made.
pub(super) struct Job {
    folder: PathBuf,
    /// Streams, and a device's records of each.
    outputs: Vec<(String, PathBuf)>,
    how: How,
    json: bool,
}

impl Typed {
    pub fn check(self) -> Result<Job> {
        let (pairs, rest) = self.outputs.as_chunks::<2>();
        if let [alone] = rest {
            return Err(Error::input(format!(
                "{}: a stream needs the file of a device's records behind it",
                alone.display()
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
        let order = self.order.map_or(Order::Auto, |order| match order {
            Typable::Trace => Order::Trace,
            Typable::Tiles => Order::Tiles,
            Typable::Any => Order::Any,
        });
        Ok(Job {
            folder: self.folder,
            outputs,
            how: How { zeros, order },
            json: self.json,
        })
    }
}

impl Job {
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
        // What is different is a result, and goes where results go; the status says that the device
        // failed.
        super::print(&text)?;
        Err(Error::job(format!(
            "{} is not what the trace has",
            outcome.json["stream"].as_str().unwrap_or("a stream")
        )))
    }
}

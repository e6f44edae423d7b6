//! Diff: compares a device's output with a trace, and names the first mismatch.

use super::arguments::pretty;
use crate::cosim::diff::{self, How, Order, Zeros};
use crate::error::{Error, Result};
use clap::Args;
use std::ffi::OsString;
use std::path::PathBuf;

/// End of the help text.
pub(super) const HELP: &str = "Streams whose order counts at each pixel only may come in another. A file in\n\
    the order of tiles is compared in it, and a sentence says so; --order decides.\n\
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
    /// Order of records [default: trace, or tiles where they are in that]
    #[arg(long, value_name = "ORDER", value_enum)]
    order: Option<Typable>,
    /// Print JSON instead of text
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
            return Err(Error::input(format!("{}: a stream needs the file of a device's records behind it", alone.display())));
        }
        let outputs = pairs.iter().map(|[stream, file]| (stream.to_string_lossy().into_owned(), file.into())).collect();
        let zeros = if self.strict { Zeros::Compared } else { Zeros::Ignored };
        let order = self.order.map_or(Order::Auto, |order| match order {
            Typable::Trace => Order::Trace,
            Typable::Tiles => Order::Tiles,
            Typable::Any => Order::Any,
        });
        Ok(Job { folder: self.folder, outputs, how: How { zeros, order }, json: self.json })
    }
}

impl Job {
    pub fn run(self) -> Result<String> {
        let outcome = diff::diff(&self.folder, &self.outputs, self.how)?;
        let text = if self.json { pretty(&outcome.json)? } else { outcome.text };
        if outcome.equal {
            return Ok(text);
        }
        // What is different is a result, and goes where results go; the status says that the device failed.
        super::print(&text)?;
        Err(Error::job(format!("{} is not what the trace has", outcome.json["stream"].as_str().unwrap_or("a stream"))))
    }
}

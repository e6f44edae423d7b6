//! Replay: computes the cycles of a frame that `run --record` recorded.

use super::arguments::{Threads, written};
use super::help;
use crate::error::Result;
use crate::hardware::fixed;
use crate::output::files::Folder;
use crate::performance::cost::Prices;
use crate::performance::recording::Recording;
use crate::performance::timings::Axes;
use clap::Args;
use std::path::PathBuf;

#[derive(Args, Debug)]
pub(super) struct ReplayArgs {
    /// File from `run --record`
    #[arg(value_name = "FILE")]
    record: PathBuf,
    /// Set a field: timing.raster.fifo=4; may repeat
    #[arg(long = "set", value_name = "PATH=VALUE", long_help = help::SET_TIMING_LONG)]
    settings: Vec<String>,
    #[arg(long, value_name = "PATH=A,…", help = help::EACH, long_help = help::EACH_LONG)]
    timing: Vec<Axes>,
    /// List the timing fields that make it faster
    #[arg(long = "what-if", alias = "answers")]
    answers: bool,
    /// Read unit costs [default: `machine unit-costs`]
    #[arg(long = "unit-costs", alias = "prices", value_name = "FILE")]
    prices: Option<PathBuf>,
    /// Write cycles.json, tables and charts into DIR
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Also write every memory request
    #[arg(long, requires = "out")]
    requests: bool,
    #[command(flatten)]
    pub threads: Threads,
    /// Do not print the table
    #[arg(long)]
    quiet: bool,
}

/// Checked arguments.
pub(super) struct ReplayJob {
    recording: Recording,
    timing: Vec<Axes>,
    /// Whether to try settings that may be faster.
    answers: bool,
    prices: Prices,
    requests: bool,
    out: Option<(PathBuf, Folder)>,
    quiet: bool,
}

impl ReplayArgs {
    pub fn check(self) -> Result<ReplayJob> {
        let mut recording = Recording::read(&self.record)?;
        self.settings
            .iter()
            .try_for_each(|setting| recording.set(setting))?;
        fixed::elaborate(&recording.machine)?;
        recording.check(&self.timing)?;
        let prices = Prices::load_or_default(self.prices.as_deref())?;
        let out = self
            .out
            .map(|folder| Folder::open(&folder).map(|open| (folder, open)))
            .transpose()?;
        Ok(ReplayJob {
            recording,
            timing: self.timing,
            answers: self.answers,
            prices,
            requests: self.requests,
            out,
            quiet: self.quiet,
        })
    }
}

impl ReplayJob {
    pub fn run(self) -> Result<String> {
        let replayed = self.recording.replay_priced(
            &self.timing,
            self.requests,
            self.answers,
            &self.prices,
        )?;
        let end = match &self.out {
            Some((folder, _)) => written(folder, &replayed.write(folder)?),
            None => "nothing written: --out DIR writes tables and charts".into(),
        };
        Ok(if self.quiet {
            String::new()
        } else {
            format!("{}\n\n{end}", replayed.summary(&self.recording))
        })
    }
}

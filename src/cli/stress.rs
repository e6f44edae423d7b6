//! Stress: runs small scenes in which methods or machines fail.

use super::arguments::{Threads, written};
use crate::error::Result;
use crate::explore::stress;
use crate::explore::stress::{CASES, Case};
use crate::hardware::machines;
use crate::output::files::Folder;
use crate::output::progress::Progress;
use clap::Args;
use rtl_model::Machine;
use std::ffi::OsString;
use std::path::PathBuf;

#[derive(Args, Debug)]
pub(super) struct StressArgs {
    /// Run only this case; may repeat [default: all]
    #[arg(long = "case", value_name = "NAME")]
    cases: Vec<String>,
    /// Add a machine to the named ones; may repeat
    #[arg(long = "machine", value_name = "NAME|FILE")]
    machines: Vec<OsString>,
    /// Write tables and pictures into DIR
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    pub threads: Threads,
    /// Do not print the table
    #[arg(long)]
    quiet: bool,
}

/// Checked arguments.
pub(super) struct StressJob {
    cases: Vec<&'static Case>,
    machines: Vec<Machine>,
    out: Option<(PathBuf, Folder)>,
    quiet: bool,
}

impl StressArgs {
    pub fn check(self) -> Result<StressJob> {
        let named: Vec<&Case> = self
            .cases
            .iter()
            .map(|name| stress::find(name))
            .collect::<Result<_>>()?;
        let cases = if named.is_empty() {
            CASES.iter().collect()
        } else {
            named
        };
        let machines = self
            .machines
            .iter()
            .map(|name| machines::load(name, &[]))
            .collect::<Result<_>>()?;
        let out = self
            .out
            .map(|folder| Folder::open(&folder).map(|open| (folder, open)))
            .transpose()?;
        Ok(StressJob {
            cases,
            machines,
            out,
            quiet: self.quiet,
        })
    }
}

impl StressJob {
    pub fn run(self) -> Result<String> {
        let progress = Progress::of_messages(!self.quiet);
        progress.set_message(format!("{} cases are being driven", self.cases.len()));
        let catalogue = stress::run(&self.cases, &self.machines)?;
        drop(progress);
        let end = match &self.out {
            Some((folder, _)) => written(folder, &catalogue.write(folder)?),
            None => "nothing written: --out DIR writes the tables, a chart and a gallery".into(),
        };
        catalogue.check()?;
        Ok(if self.quiet {
            String::new()
        } else {
            format!("{}\n{end}", catalogue.table())
        })
    }
}

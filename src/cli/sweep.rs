//! Sweep: draws scenes on many machines and writes one row per point.

use super::arguments::{AgainstFlag, Threads, folder_for, positive, written};
use crate::error::Result;
use crate::explore::sweep;
use crate::explore::sweep::plan::{PlanScreen, Points};
use crate::explore::sweep::{Shard, SweepOptions};
use crate::hardware::searched::Against;
use crate::output::text::{one_line, wrapped};
use crate::performance::cost::Prices;
use clap::Args;
use std::ffi::OsString;
use std::path::PathBuf;

#[derive(Args, Debug)]
pub(super) struct SweepArgs {
    /// Plan: a JSON file or the name of a built-in plan
    plan: OsString,
    /// Write rows here, or resume [default: PLAN-sweep]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Draw part I of N, into the same folder
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Refuse plans of more points
    #[arg(long, value_name = "POINTS", default_value_t = sweep::MOST_POINTS)]
    most: u64,
    /// Do not draw machines that surely have a lower PSNR
    #[arg(long, value_name = "DB", value_parser = positive)]
    screen: Option<f64>,
    /// Screen against `golden` (default) or `ideal`
    #[arg(
        long,
        value_name = "WHAT",
        value_enum,
        hide_possible_values = true,
        requires = "screen"
    )]
    against: Option<AgainstFlag>,
    /// Read unit costs [default: `machine unit-costs`]
    #[arg(long = "unit-costs", alias = "prices", value_name = "FILE")]
    prices: Option<PathBuf>,
    #[command(flatten)]
    pub threads: Threads,
    /// Do not print progress or results
    #[arg(long)]
    quiet: bool,
}

/// Checked arguments.
pub(super) struct SweepJob {
    points: Points,
    folder: PathBuf,
    options: SweepOptions,
    quiet: bool,
}

impl SweepArgs {
    pub fn check(self) -> Result<SweepJob> {
        let mut points = Points::load(&self.plan)?;
        let screen = self.screen.map(|psnr_db| PlanScreen {
            psnr_db,
            against: self.against.map_or(Against::default(), AgainstFlag::into),
        });
        points.plan.screen = screen.or(points.plan.screen);
        let prices = Prices::load_or_default(self.prices.as_deref())?;
        let folder = self.out.unwrap_or_else(|| folder_for(&self.plan, "-sweep"));
        let options = SweepOptions {
            shard: self.shard,
            most: self.most,
            prices,
            progress: !self.quiet,
        };
        Ok(SweepJob {
            points,
            folder,
            options,
            quiet: self.quiet,
        })
    }
}

impl SweepJob {
    pub fn run(self) -> Result<String> {
        let outcome = sweep::run(&self.points, &self.folder, &self.options)?;
        let folder = one_line(&self.folder.to_string_lossy());
        let end = match &outcome.files[..] {
            [] => wrapped(&format!(
                "rows are in {folder}; other parts are being drawn, and the last writes the table of all"
            )),
            files => written(&self.folder, files),
        };
        let text = if self.quiet {
            String::new()
        } else {
            format!("{}\n\n{end}", outcome.summary().trim_end())
        };
        let Err(error) = outcome.check() else {
            return Ok(text);
        };
        // The rows were written, and the summary is printed first.
        super::print(&text)?;
        Err(error)
    }
}

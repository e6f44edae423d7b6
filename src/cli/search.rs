//! Search: finds the narrowest machine that meets a target on a scene.

use super::arguments::{Common, folder_for, positive, written};
use crate::error::Result;
use crate::explore::search;
use crate::explore::search::{Options, Target, over_fragment};
use crate::hardware::{machines, searched};
use crate::performance::cost::Prices;
use crate::scene::Scene;
use clap::{Args, ValueEnum};
use rtl_model::Machine;
use std::ffi::OsString;
use std::path::PathBuf;

#[derive(Args, Debug)]
pub(super) struct Typed {
    /// Scenes, clouds, volumes or built-in names; all must do
    #[arg(required = true, value_name = "SCENE")]
    scenes: Vec<OsString>,
    /// At least so many dB over all pixels
    #[arg(long, value_name = "DB", value_parser = positive, required_unless_present = "max_error")]
    target_psnr: Option<f64>,
    /// No pixel further off, linear light in [0, 1]
    #[arg(long, value_name = "ERROR", value_parser = positive)]
    max_error: Option<f64>,
    /// Both against golden or ideal
    #[arg(long, value_name = "WHAT", value_enum, hide_possible_values = true, default_value_t = Against::Golden)]
    against: Against,
    /// Rules and layers instead of words: `fragment`
    #[arg(long, value_name = "UNIT", value_enum, hide_possible_values = true, requires = "target_psnr",
        conflicts_with_all = ["max_error", "against", "no_saturation", "views", "only", "tries", "seed"])]
    over: Option<Over>,
    /// Least `area` (default) or `bytes` a pixel
    #[arg(long, value_name = "WHAT", value_enum, hide_possible_values = true, requires = "over")]
    by: Option<By>,
    /// No word may leave its range
    #[arg(long)]
    no_saturation: bool,
    /// Unseen cameras where it must hold too
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u8).range(0..=100))]
    views: u8,
    /// Only this unit, word or size; may be given again
    #[arg(long, value_name = "PATH")]
    only: Vec<String>,
    /// Machines that annealing draws
    #[arg(long, value_name = "N", default_value_t = 300)]
    tries: u32,
    /// Another seed, another annealing
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    pub common: Common,
    /// What a bit costs [default: machine prices]
    #[arg(long, value_name = "FILE")]
    prices: Option<PathBuf>,
    /// Write here, or go on [default: SCENE-search]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print nothing
    #[arg(long)]
    quiet: bool,
}

/// [`searched::Against`] as typed.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Against {
    Golden,
    Ideal,
}

/// What is searched instead of words.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Over {
    Fragment,
}

/// [`over_fragment::By`] as typed.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum By {
    Area,
    Bytes,
}

/// A search that can be done.
pub(super) struct Job {
    /// What is to be least, where rules are searched and not words.
    over_fragment: Option<over_fragment::By>,
    scenes: Vec<Scene>,
    machine: Machine,
    folder: PathBuf,
    options: Options,
    quiet: bool,
}

impl Typed {
    pub fn check(self) -> Result<Job> {
        let scenes: Vec<Scene> = self.scenes.iter().map(|name| self.common.scene(name)).collect::<Result<_>>()?;
        let mut machine = self.common.machine(&scenes[0])?;
        machines::pay(&mut machine, scenes.iter().any(|scene| scene.detail.is_some()));
        let against = match self.against {
            Against::Golden => searched::Against::Golden,
            Against::Ideal => searched::Against::Ideal,
        };
        let target = Target { psnr_db: self.target_psnr, max_error: self.max_error, no_saturation: self.no_saturation, against };
        let options = Options {
            target,
            views: self.views.into(),
            seed: self.seed,
            tries: self.tries.into(),
            only: self.only,
            prices: Prices::load_or_default(self.prices.as_deref())?,
            progress: !self.quiet,
        };
        let folder = self.out.unwrap_or_else(|| folder_for(&self.scenes[0], "-search"));
        let by = match self.by {
            Some(By::Bytes) => over_fragment::By::Bytes,
            _ => over_fragment::By::Area,
        };
        let over_fragment = self.over.map(|Over::Fragment| by);
        Ok(Job { over_fragment, scenes, machine, folder, options, quiet: self.quiet })
    }
}

impl Job {
    pub fn run(self) -> Result<String> {
        if let (Some(by), Some(target)) = (self.over_fragment, self.options.target.psnr_db) {
            let Options { prices, progress, .. } = &self.options;
            let outcome = over_fragment::run(&self.scenes, &self.machine, &self.folder, target, by, prices, *progress)?;
            let end = written(&self.folder, &outcome.files);
            return Ok(if self.quiet { String::new() } else { format!("{}\n\n{end}", outcome.summary()) });
        }
        let outcome = search::run(&self.scenes, &self.machine, &self.folder, &self.options)?;
        let end = written(&self.folder, &outcome.files);
        Ok(if self.quiet { String::new() } else { format!("{}\n\n{end}", outcome.summary()) })
    }
}

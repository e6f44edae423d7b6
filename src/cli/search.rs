//! Search: finds the cheapest machine that meets a target on a scene.

use super::arguments::{AgainstFlag, CommonArgs, FactorRange, folder_for, positive, written};
use super::help;
use crate::error::{Error, Result};
use crate::explore::search;
use crate::explore::search::{Claim, Domain, SearchOptions, Target, over_fragment, over_timing};
use crate::hardware::{machines, searched};
use crate::output::text::{quoted_for_shell, wrapped};
use crate::performance::cost::Prices;
use crate::scene::{CameraFile, Overrides, Scene, Sequence, memory};
use clap::{Args, ValueEnum};
use rtl_model::Machine;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::time::Duration;

#[derive(Args, Debug)]
pub(super) struct SearchArgs {
    /// Scenes; the target must hold on each
    #[arg(required = true, value_name = "SCENE")]
    scenes: Vec<OsString>,
    /// Require this PSNR over all pixels, dB
    #[arg(long, value_name = "DB", value_parser = positive)]
    target_psnr: Option<f64>,
    /// Limit the error of each pixel (linear, 0 to 1)
    #[arg(long, value_name = "ERROR", value_parser = positive)]
    max_error: Option<f64>,
    /// Require this frame rate; search fields of timing
    #[arg(long, value_name = "N", value_parser = positive, conflicts_with = "over")]
    min_fps: Option<f64>,
    /// Minimise area (default), gates, energy or cycles
    #[arg(
        long,
        value_name = "WHAT",
        value_enum,
        hide_possible_values = true,
        requires = "min_fps"
    )]
    minimise: Option<MinimiseFlag>,
    /// Read timing fields and values [default: usual ones]
    #[arg(long, value_name = "FILE", requires = "min_fps")]
    fields: Option<PathBuf>,
    #[arg(long, value_name = "FILE|DIR", conflicts_with = "frame", help = help::CAMERAS, long_help = help::CAMERAS_LONG)]
    cameras: Option<PathBuf>,
    /// Scale camera distances within this range: 0.25..2
    #[arg(long, value_name = "A..B")]
    distance: Option<FactorRange>,
    /// Take the worst of N near cameras
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=64))]
    robust: u8,
    /// Use `psnr`, or `lockstep`: no flips
    #[arg(long, value_name = "WHAT", value_enum, hide_possible_values = true, default_value_t = MetricFlag::Psnr)]
    metric: MetricFlag,
    /// Compare with `golden` or `ideal`
    #[arg(long, value_name = "WHAT", value_enum, hide_possible_values = true, default_value_t = AgainstFlag::Golden)]
    against: AgainstFlag,
    /// Search merge rules and layers: `fragment`
    #[arg(long, value_name = "UNIT", value_enum, hide_possible_values = true, requires = "target_psnr",
        conflicts_with_all = ["max_error", "against", "no_saturation", "views", "only", "tries", "seed", "cameras", "distance", "robust", "metric"])]
    over: Option<OverFlag>,
    /// Minimise `area` (default) or `bytes` per pixel
    #[arg(
        long,
        value_name = "WHAT",
        value_enum,
        hide_possible_values = true,
        requires = "over"
    )]
    by: Option<ByFlag>,
    /// Require that no word saturates or wraps
    #[arg(long)]
    no_saturation: bool,
    /// Verify on N unseen cameras
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u8).range(0..=100))]
    views: u8,
    /// Draw samples of tiles: `on` or `off`
    #[arg(long, value_name = "WHAT", value_enum, hide_possible_values = true, default_value_t = ScreenFlag::On, conflicts_with = "over")]
    screen: ScreenFlag,
    /// End after this time, with the best machine: 10m
    #[arg(long, value_name = "TIME", value_parser = time, conflicts_with_all = ["over", "min_fps"])]
    budget: Option<Duration>,
    /// Search only this: gauss, gauss.weight; may repeat
    #[arg(long, value_name = "PATH")]
    only: Vec<String>,
    /// Draw N machines while annealing
    #[arg(long, value_name = "N", default_value_t = 300)]
    tries: u32,
    /// Set the seed of annealing
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    pub common: CommonArgs,
    /// Read unit costs [default: `machine unit-costs`]
    #[arg(long = "unit-costs", alias = "prices", value_name = "FILE")]
    prices: Option<PathBuf>,
    /// Write here, or resume [default: SCENE-search]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Do not print progress or results
    #[arg(long)]
    quiet: bool,
}

/// One shell command, continued with `\` so that lines stay within 80 columns.
fn continued(parts: &[String]) -> String {
    let mut text = String::from("   ");
    let mut columns = 3;
    for part in parts {
        let more = part.chars().count() + 1;
        if columns > 3 && columns + more > 78 {
            text.push_str(" \\\n       ");
            columns = 7;
        }
        text.push(' ');
        text.push_str(part);
        columns += more;
    }
    text
}

/// Scene and size of each domain, as arguments of `run`.
fn run_arguments(scenes: &[OsString], common: &CommonArgs) -> Vec<String> {
    let size = |overrides: &Overrides| {
        overrides.size.map_or(String::new(), |(width, height)| {
            format!(" --size {width}x{height}")
        })
    };
    let of = |scene: &OsString| {
        common
            .each_overrides()
            .iter()
            .map(|each| quoted_for_shell(&scene.to_string_lossy()) + &size(each))
            .collect::<Vec<_>>()
    };
    scenes.iter().flat_map(of).collect()
}

/// `--screen`.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
enum ScreenFlag {
    On,
    Off,
}

/// A time such as 90s, 10m or 2h, at least a second and at most 1000 hours.
fn time(text: &str) -> std::result::Result<Duration, String> {
    let seconds = [("s", 1.0), ("m", 60.0), ("h", 3600.0)]
        .into_iter()
        .find_map(|(unit, seconds)| Some(positive(text.strip_suffix(unit)?).ok()? * seconds))
        .filter(|seconds| (1.0..=3.6e6).contains(seconds));
    seconds
        .map(Duration::from_secs_f64)
        .ok_or_else(|| "a time from 1s to 1000h is needed, such as 90s, 10m or 2h".into())
}

/// `--metric`.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
enum MetricFlag {
    Psnr,
    Lockstep,
}

/// `--over`: the subject of a search that is not over words.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum OverFlag {
    Fragment,
}

/// `--by`.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum ByFlag {
    Area,
    Bytes,
}

/// `--minimise`.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum MinimiseFlag {
    Area,
    Gates,
    Energy,
    Cycles,
}

/// Arguments of the `run` commands that reproduce a figure.
struct RunArguments {
    scenes: Vec<String>,
    prices: String,
}

/// Checked arguments.
pub(super) struct SearchJob {
    run_arguments: RunArguments,
    /// Set by `--min-fps`: search fields of timing.
    over_timing: Option<over_timing::TimingOptions>,
    /// Set by `--over fragment`: the quantity to minimise.
    over_fragment: Option<over_fragment::LeastOf>,
    domains: Vec<Domain>,
    machine: Machine,
    folder: PathBuf,
    options: SearchOptions,
    quiet: bool,
}

impl SearchArgs {
    pub fn check(self) -> Result<SearchJob> {
        let has_target = self.target_psnr.or(self.max_error).or(self.min_fps);
        if has_target.is_none() {
            return Err(Error::input(
                "a target is missing: --target-psnr, --max-error or --min-fps (--over needs --target-psnr)",
            ));
        }
        let domains = self.domains()?;
        domains
            .iter()
            .try_for_each(|domain| memory::check_frame(domain.scene()))?;
        let mut machine = self.common.machine(domains[0].scene())?;
        machines::draws_alone(&machine, "a search draws each of its views alone")?;
        machines::pay(
            &mut machine,
            domains.iter().any(|domain| domain.scene().detail.is_some()),
        );
        let target = self.target()?;
        let options = SearchOptions {
            target,
            views: self.views.into(),
            robust: self.robust.into(),
            seed: self.seed,
            tries: self.tries.into(),
            only: self.only,
            prices: Prices::load_or_default(self.prices.as_deref())?,
            screen: self.screen == ScreenFlag::On,
            budget: self.budget,
            progress: !self.quiet,
        };
        let prices_flag = self.prices.as_deref().map_or(String::new(), |path| {
            format!(
                " --unit-costs {}",
                quoted_for_shell(&path.to_string_lossy())
            )
        });
        let run_arguments = RunArguments {
            scenes: run_arguments(&self.scenes, &self.common),
            prices: prices_flag,
        };
        let folder = self
            .out
            .unwrap_or_else(|| folder_for(&self.scenes[0], "-search"));
        let by = match self.by {
            Some(ByFlag::Bytes) => over_fragment::LeastOf::Bytes,
            _ => over_fragment::LeastOf::Area,
        };
        let over_fragment = self.over.map(|OverFlag::Fragment| by);
        let minimise = match self.minimise {
            None | Some(MinimiseFlag::Area) => over_timing::Minimise::Area,
            Some(MinimiseFlag::Gates) => over_timing::Minimise::Gates,
            Some(MinimiseFlag::Energy) => over_timing::Minimise::Energy,
            Some(MinimiseFlag::Cycles) => over_timing::Minimise::Cycles,
        };
        let fields = self
            .fields
            .as_deref()
            .map(over_timing::read)
            .transpose()?
            .unwrap_or_default();
        let SearchOptions {
            views,
            prices,
            progress,
            ..
        } = options.clone();
        let memory = Some(over_timing::GivenMemory::of(&machine));
        let over_timing = self.min_fps.map(|min_fps| over_timing::TimingOptions {
            min_fps,
            minimise,
            fields,
            memory,
            views,
            prices,
            progress,
        });
        Ok(SearchJob {
            run_arguments,
            over_timing,
            over_fragment,
            domains,
            machine,
            folder,
            options,
            quiet: self.quiet,
        })
    }

    /// Each scene at each size.
    fn domains(&self) -> Result<Vec<Domain>> {
        let cameras = self.cameras.as_deref().map(CameraFile::read).transpose()?;
        let distance = self
            .distance
            .map_or([1.0; 2], |FactorRange(distance)| distance);
        let mut domains = Vec::new();
        for name in &self.scenes {
            for overrides in self.common.each_overrides() {
                let load = |name: &OsStr| Sequence::load(name, &overrides, cameras.clone());
                domains.push(Domain::load(name, load, self.common.frame)?.from_distances(distance));
            }
        }
        Domain::label_all(&mut domains);
        Ok(domains)
    }

    fn target(&self) -> Result<Target> {
        let against = self.against.into();
        let metric = match self.metric {
            MetricFlag::Psnr => searched::Metric::Psnr,
            MetricFlag::Lockstep if against == searched::Against::Ideal => {
                return Err(Error::input(
                    "--metric lockstep: the decisions of golden can be forced to the machine's, those of ideal cannot: use --against golden",
                ));
            }
            MetricFlag::Lockstep => searched::Metric::Lockstep,
        };
        Ok(Target {
            psnr_db: self.target_psnr,
            max_error: self.max_error,
            no_saturation: self.no_saturation,
            against,
            metric,
            frames_per_second: self.min_fps,
        })
    }
}

impl SearchJob {
    pub fn run(self) -> Result<String> {
        if let (Some(by), Some(target)) = (self.over_fragment, self.options.target.psnr_db) {
            let SearchOptions {
                prices, progress, ..
            } = &self.options;
            let scenes: Vec<Scene> = self
                .domains
                .iter()
                .map(|domain| domain.scene().clone())
                .collect();
            let outcome = over_fragment::run(
                &scenes,
                &self.machine,
                &self.folder,
                target,
                by,
                prices,
                *progress,
            )?;
            return Ok(self.text(&[outcome.summary()], &outcome.files));
        }
        if let Some(options) = &self.over_timing {
            return self.over_timing(options);
        }
        let outcome = search::run_on(&self.domains, &self.machine, &self.folder, &self.options)?;
        Ok(self.text(
            &[
                outcome.summary(),
                self.reproduction(&outcome.claims, &self.folder),
            ],
            &outcome.files,
        ))
    }

    /// Searches timing only; or timing, then words, then timing of the machine with these words.
    fn over_timing(&self, options: &over_timing::TimingOptions) -> Result<String> {
        let Target {
            psnr_db,
            max_error,
            no_saturation,
            ..
        } = self.options.target;
        let (domains, folder) = (&self.domains, &self.folder);
        if psnr_db.is_none() && max_error.is_none() && !no_saturation {
            let outcome = over_timing::run(domains, &self.machine, None, folder, options)?;
            return Ok(self.text(
                &[
                    outcome.summary(),
                    self.reproduction(&outcome.claims, folder),
                ],
                &outcome.files,
            ));
        }
        // Fails before anything is written.
        search::check(domains, &self.machine, &self.options)?;
        let fast = over_timing::run(
            domains,
            &self.machine,
            None,
            &folder.join("timing"),
            options,
        )?;
        let words = search::run_on(domains, &fast.machine, &folder.join("words"), &self.options)?;
        let last = over_timing::run(
            domains,
            &words.machine,
            Some(&words.searched),
            folder,
            options,
        )?;
        // Timing does not change the picture: the figures of `words` hold for the last machine too.
        let again = [
            self.reproduction_with(&words.claims, &folder.join("words"), folder),
            self.reproduction(&last.claims, folder),
        ]
        .join("\n");
        Ok(self.text(
            &[fast.summary(), words.summary(), last.summary(), again],
            &last.files,
        ))
    }

    /// The commands that reproduce each figure.
    fn reproduction(&self, claims: &[Claim], folder: &Path) -> String {
        self.reproduction_with(claims, folder, folder)
    }

    fn reproduction_with(&self, claims: &[Claim], cameras: &Path, machine: &Path) -> String {
        let path =
            |folder: &Path, name: &str| quoted_for_shell(&folder.join(name).to_string_lossy());
        let command = |Claim {
                           figure,
                           view,
                           scene,
                           cameras: file,
                           frame,
                       }: &Claim| {
            let (machine, file) = (path(machine, "machine.json"), path(cameras, file));
            // A figure may end in the difference that it measures: "46.5 dB, fixed − golden".
            let (value, condition) = match figure.split_once(", ") {
                Some((value, difference)) => (value, format!("{difference}, {view}")),
                None => (figure.as_str(), view.clone()),
            };
            let command = [
                format!("splatsim run {}", self.run_arguments.scenes[*scene]),
                format!("--machine {machine}"),
                format!("--cameras {file}"),
                format!("--frame {frame}{}", self.run_arguments.prices),
            ];
            format!(
                "{}\n{}",
                wrapped(&format!("to reproduce {value} ({condition}):")),
                continued(&command)
            )
        };
        claims.iter().map(command).collect::<Vec<_>>().join("\n")
    }

    fn text(&self, summaries: &[String], files: &[PathBuf]) -> String {
        if self.quiet {
            String::new()
        } else {
            format!(
                "{}\n\n{}",
                summaries.join("\n\n"),
                written(&self.folder, files)
            )
        }
    }
}

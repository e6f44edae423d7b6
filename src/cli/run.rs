//! Run: draws a scene on a machine and in exact arithmetic, and compares.

mod sequence;

use super::arguments::{CommonArgs, SearchedMachine, written};
use super::help;
use crate::accuracy::ranges;
use crate::error::{Error, Result};
use crate::hardware::fixed;
use crate::hardware::quantise::quantise;
use crate::output::files::Folder;
use crate::output::progress::Progress;
use crate::output::text::{one_line, wrapped};
use crate::performance::cost::Prices;
use crate::performance::recording::Recording;
use crate::performance::timings::{Axes, Variants};
use crate::run;
use crate::run::against::Photographs;
use crate::run::detail::bounded;
use crate::run::preview;
use crate::run::preview::Preview;
use crate::run::{Check, Options, RunResult, timed};
use crate::scene::{CameraFile, Scene, Sequence, memory};
use clap::{Args, ValueEnum};
use rtl_model::Machine;
use std::ffi::OsString;
use std::path::PathBuf;

#[derive(Args, Debug)]
pub(super) struct RunArgs {
    /// Scene, point cloud, volume or built-in name
    #[arg(default_value = "glass-spheres")]
    scene: OsString,
    #[command(flatten)]
    pub common: CommonArgs,
    #[arg(long, value_name = "FILE|DIR", help = help::CAMERAS, long_help = help::CAMERAS_LONG)]
    cameras: Option<PathBuf>,
    /// Compare with photographs: PSNR, SSIM, FLIP
    #[arg(long, value_name = "IMAGE|DIR", conflicts_with = "preview", long_help = help::AGAINST_LONG)]
    against: Option<PathBuf>,
    /// Also write the pictures as a YUV4MPEG2 video
    #[arg(long, value_name = "FILE")]
    y4m: Option<PathBuf>,
    /// Write pictures and report.json into DIR
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Draw only a 16th of the pixels
    #[arg(long)]
    preview: bool,
    /// Also write OpenEXR pictures (float32, linear)
    #[arg(long, requires = "out")]
    exr: bool,
    /// Also write every memory request
    #[arg(long, requires = "out")]
    requests: bool,
    /// Record the work in FILE, for `replay`
    #[arg(long, value_name = "FILE", conflicts_with = "preview")]
    record: Option<PathBuf>,
    /// Use lockstep: `full` (default), `sampled`, `none`
    #[arg(long, value_name = "HOW", value_enum, hide_default_value = true, hide_possible_values = true, default_value_t = CheckFlag::Full)]
    check: CheckFlag,
    /// Attribute the error to words (draws 170 frames)
    #[arg(long)]
    attribute: bool,
    #[arg(long, value_name = "PATH=A,…", help = help::EACH, long_help = help::EACH_LONG)]
    timing: Vec<Axes>,
    /// List the timing fields that make it faster
    #[arg(long = "what-if", alias = "answers", conflicts_with = "preview")]
    answers: bool,
    /// Read unit costs [default: `machine unit-costs`]
    #[arg(long = "unit-costs", alias = "prices", value_name = "FILE")]
    prices: Option<PathBuf>,
    /// Also print the range of each signal
    #[arg(long)]
    ranges: bool,
    /// Do not print the summary
    #[arg(long)]
    quiet: bool,
}

/// `--check`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum CheckFlag {
    Full,
    Sampled,
    None,
}

impl From<CheckFlag> for Check {
    fn from(checked: CheckFlag) -> Check {
        match checked {
            CheckFlag::Full => Check::Full,
            CheckFlag::Sampled => Check::Sampled,
            CheckFlag::None => Check::None,
        }
    }
}

/// Checked arguments.
pub(super) enum RunJob {
    Frame(Box<FrameJob>),
    Sequence(Box<sequence::SequenceJob>),
}

/// A run of one frame.
pub(super) struct FrameJob {
    scene: Scene,
    /// The reduced scene that a preview draws.
    small: Option<Scene>,
    machine: Machine,
    /// How the scene differs from those that the machine was searched on.
    warning: Option<String>,
    load_seconds: f64,
    options: Options,
    out: Option<(PathBuf, Folder)>,
    exr: bool,
    record: Option<PathBuf>,
    ranges: bool,
    quiet: bool,
}

impl RunArgs {
    pub fn check(self) -> Result<RunJob> {
        let prices = Prices::load_or_default(self.prices.as_deref())?;
        let cameras = self.cameras.as_deref().map(CameraFile::read).transpose()?;
        let (sequence, load_seconds) =
            timed(|| Sequence::load(&self.scene, &self.common.overrides(), cameras));
        let mut sequence = sequence?;
        if sequence.is_sequence() && self.common.frame.is_none() {
            return self
                .check_sequence(sequence, load_seconds)
                .map(|job| RunJob::Sequence(Box::new(job)));
        }
        if let Some(path) = &self.y4m {
            return Err(Error::input(format!(
                "--y4m {}: one frame is not a video; a scene with `cameras` or `camera_path` is needed",
                path.display()
            )));
        }
        let number = self.common.frame.unwrap_or(0);
        sequence.frame(number)?;
        let photographs = |path| {
            memory::check_frame(sequence.scene())
                .and_then(|()| Photographs::open(path, &sequence, Some(number)))
        };
        let against = self.against.as_deref().map(photographs).transpose()?;
        let frame = sequence.is_sequence().then_some(number as u64);
        let scene = sequence.into_scene();
        let SearchedMachine {
            machine,
            outside: outside_of_search,
            warning,
        } = self.common.searched_machine(&scene)?;
        let elaborated = fixed::elaborate(&machine)?;
        let budget = scene.detail.as_ref().map(|detail| detail.rules.budget);
        if budget.is_some_and(|budget| budget.bytes.or(budget.cycles).is_some())
            && (self.answers || !self.timing.is_empty())
        {
            let flag = if self.answers {
                "--what-if"
            } else {
                "--timing"
            };
            return Err(Error::input(format!(
                "{flag}: {} has a budget of bytes or cycles, so its splats depend on the machine: use `run --set` instead",
                scene.name
            )));
        }
        let timings = Variants::new(&machine, &self.timing)?;
        let small = self.preview.then(|| preview::scene(&scene)).transpose()?;
        // The cut of a budget is computed once.
        let (scene, small) = match small {
            Some(small) => (scene, Some(bounded(small, &elaborated)?)),
            None => (bounded(scene, &elaborated)?, None),
        };
        let drawn = small.as_ref().unwrap_or(&scene);
        memory::check_frame(drawn)?;
        quantise(drawn, &machine)?;
        if let Some(timings) = &timings {
            timings.check_scene(drawn)?;
        }
        let options = Options {
            attribution: self.attribute,
            check: self.check.into(),
            timings,
            answers: self.answers,
            requests: self.requests,
            record: self.record.is_some(),
            prices,
            outside_of_search,
            frame,
            scene_file: std::path::absolute(&self.scene)
                .ok()
                .filter(|path| path.exists()),
            against,
        };
        // Last: nothing is written if an argument is wrong.
        let out = self
            .out
            .map(|folder| Folder::open(&folder).map(|open| (folder, open)))
            .transpose()?;
        self.record
            .as_deref()
            .map_or(Ok(()), Recording::may_be_written)?;
        let RunArgs {
            exr,
            record,
            ranges,
            quiet,
            ..
        } = self;
        let frame = FrameJob {
            scene,
            small,
            machine,
            warning,
            load_seconds,
            options,
            out,
            exr,
            record,
            ranges,
            quiet,
        };
        Ok(RunJob::Frame(Box::new(frame)))
    }
}

impl RunJob {
    pub fn run(self) -> Result<String> {
        match self {
            RunJob::Frame(frame) => frame.run(),
            RunJob::Sequence(sequence) => sequence.run(),
        }
    }
}

impl FrameJob {
    fn run(self) -> Result<String> {
        if let Some(sentence) = &self.warning {
            super::warn(sentence);
        }
        let mut outcome = self.draw()?;
        let mut end = match &self.out {
            Some((folder, _)) => {
                let files = outcome.write(folder, self.exr)?;
                let (place, scale) = (
                    one_line(&folder.to_string_lossy()),
                    outcome.report.error_scale,
                );
                let next = format!(
                    "open fixed.png and error.png (|fixed − golden| × {scale}), or all in a browser: splatsim view {place}"
                );
                format!("{}\n{}", written(folder, &files), wrapped(&next))
            }
            None => "no pictures written: --out DIR writes them and report.json".into(),
        };
        if let (Some(path), Some(work)) = (self.record, outcome.work.take()) {
            Recording {
                scene: self.scene.name,
                machine: self.machine,
                work,
            }
            .write(&path)?;
            end += &format!("\nwork recorded in {}", path.display());
        }
        let ranges = if self.ranges {
            format!("\n{}", ranges::table(&outcome.report.signals))
        } else {
            String::new()
        };
        Ok(if self.quiet {
            String::new()
        } else {
            format!("{}\n{ranges}{end}", outcome.report.summary())
        })
    }

    fn draw(&self) -> Result<RunResult> {
        let (scene, machine) = (&self.scene, &self.machine);
        let Some(small) = &self.small else {
            let _progress = self.announce();
            return run::run(scene, machine, self.load_seconds, &self.options);
        };
        let (outcome, seconds) =
            timed(|| run::run(small, machine, self.load_seconds, &self.options));
        let mut outcome = outcome?;
        let preview = Preview::new(scene, machine, outcome.report.figures())?;
        outcome.report.host.whole_seconds = Some(seconds * preview.growth(scene.splats.len()));
        outcome.report.preview = Some(preview);
        Ok(outcome)
    }

    /// Prints how long a long run will take. Progress is shown until the result is dropped.
    fn announce(&self) -> Option<Progress> {
        let announced = if self.quiet {
            None
        } else {
            preview::announcement(&self.scene, &self.machine)
        };
        announced.map(|(sentence, seconds)| {
            eprintln!("{sentence}");
            Progress::of_seconds(true, seconds)
        })
    }
}

//! Compare: compares two machines, or two frames that `run` drew.

use super::arguments::{Threads, TwoNumbers, pretty, written};
use super::help;
use crate::error::{Error, Result};
use crate::hardware::{fixed, machines};
use crate::output::files::Folder;
use crate::output::text::one_line;
use crate::performance::cost::Prices;
use crate::performance::recording::Recording;
use crate::run::compare::{Comparison, ComparisonSide, Workload};
use crate::scene::{Overrides, Scene};
use clap::Args;
use rtl_model::Machine;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

#[derive(Args, Debug)]
pub(super) struct CompareArgs {
    /// Machine, result folder or report.json
    #[arg(value_name = "A")]
    a: OsString,
    /// Machine, result folder or report.json to compare
    #[arg(value_name = "B")]
    b: OsString,
    /// Set a field of both: gauss.falloff=U1F12; may repeat
    #[arg(long = "set", value_name = "PATH=VALUE", long_help = help::SET_BOTH_LONG)]
    both: Vec<String>,
    /// Set a field of machine A; may repeat
    #[arg(long, value_name = "PATH=VALUE")]
    set_a: Vec<String>,
    /// Set a field of machine B; may repeat
    #[arg(long, value_name = "PATH=VALUE")]
    set_b: Vec<String>,
    /// Draw this scene on both machines
    #[arg(long, value_name = "SCENE", conflicts_with = "replay")]
    scene: Option<OsString>,
    /// Set the size of the picture, in pixels
    #[arg(long, value_name = "WxH", requires = "scene")]
    size: Option<TwoNumbers<'x'>>,
    /// Replay this record on both machines
    #[arg(long, value_name = "FILE")]
    replay: Option<PathBuf>,
    /// Read unit costs [default: `machine unit-costs`]
    #[arg(long = "unit-costs", alias = "prices", value_name = "FILE")]
    prices: Option<PathBuf>,
    /// Write compare.json and pictures into DIR
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// List all fields that differ
    #[arg(long)]
    all: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    pub threads: Threads,
}

/// Checked arguments.
pub(super) struct CompareJob {
    sides: [Operand; 2],
    frame: Option<SharedFrame>,
    prices: Prices,
    out: Option<(PathBuf, Folder)>,
    all: bool,
    json: bool,
}

/// A or B.
enum Operand {
    Machine(String, Box<Machine>),
    Frame(Box<ComparisonSide>),
}

/// The frame that both machines draw or replay.
enum SharedFrame {
    Scene(Box<Scene>),
    Recording(Box<Recording>),
}

impl CompareArgs {
    pub fn check(self) -> Result<CompareJob> {
        let prices = Prices::load_or_default(self.prices.as_deref())?;
        let settings = |flag: &'static str, own: &[String]| -> Vec<(&'static str, String)> {
            let both = self.both.iter().map(|setting| ("--set", setting.clone()));
            both.chain(own.iter().map(|setting| (flag, setting.clone())))
                .collect()
        };
        let sides = [
            operand(&self.a, &settings("--set-a", &self.set_a))?,
            operand(&self.b, &settings("--set-b", &self.set_b))?,
        ];
        let has_frame = self.scene.is_some() || self.replay.is_some();
        match &sides {
            [Operand::Machine(..), Operand::Machine(..)] => {}
            [Operand::Frame(_), Operand::Frame(_)] if has_frame => {
                let sentence = "--scene and --replay are for two machines; A and B are frames that were drawn already";
                return Err(Error::input(sentence));
            }
            [Operand::Frame(_), Operand::Frame(_)] => {}
            _ => {
                let [machine, frame] = if matches!(sides[0], Operand::Machine(..)) {
                    [&self.a, &self.b]
                } else {
                    [&self.b, &self.a]
                };
                let [machine, frame] =
                    [machine, frame].map(|name| one_line(&name.to_string_lossy()));
                let sentence = format!(
                    "{machine} is a machine and {frame} a frame that was drawn: two machines (with --scene both draw it) or two frames are needed"
                );
                return Err(Error::input(sentence));
            }
        }
        let frame = match (&self.scene, &self.replay) {
            (Some(scene), _) => {
                let size = self.size.map(|TwoNumbers(width, height)| (width, height));
                Some(SharedFrame::Scene(Box::new(Scene::load(
                    scene,
                    &Overrides { size },
                )?)))
            }
            (None, Some(path)) => Some(SharedFrame::Recording(Box::new(Recording::read(path)?))),
            (None, None) => None,
        };
        if let Some(SharedFrame::Scene(scene)) = &frame
            && scene.is_of_sequence()
        {
            sides.iter().try_for_each(|side| match side {
                Operand::Machine(_, machine) => {
                    machines::draws_alone(machine, "compare draws the first frame alone")
                }
                Operand::Frame(_) => Ok(()),
            })?;
        }
        // Last: nothing is written if an argument is wrong.
        let out = self
            .out
            .map(|folder| Folder::open(&folder).map(|open| (folder, open)))
            .transpose()?;
        Ok(CompareJob {
            sides,
            frame,
            prices,
            out,
            all: self.all,
            json: self.json,
        })
    }
}

/// Reads A or B and applies `settings`.
fn operand(name: &OsStr, settings: &[(&'static str, String)]) -> Result<Operand> {
    let (path, shown) = (Path::new(name), one_line(&name.to_string_lossy()));
    // A result folder may have the name of a machine.
    let is_named =
        !path.is_file() && !path.join("report.json").exists() && Machine::named(&shown).is_some();
    if !is_named
        && path.exists()
        && let Some(side) = ComparisonSide::read(path)?
    {
        if let Some((flag, setting)) = settings.first() {
            let flag = machines::flag(flag, setting);
            return Err(Error::input(format!(
                "{flag}: {shown} is a frame that was drawn: only a machine can be changed"
            )));
        }
        return Ok(Operand::Frame(Box::new(side)));
    }
    let mut machine = machines::load(name, &[])?;
    for (flag, setting) in settings {
        machine = machines::changed(&machine, setting, &machines::flag(flag, setting))?;
    }
    fixed::elaborate(&machine).map_err(|error| Error::input(format!("{shown}: {error}")))?;
    let all: Vec<&str> = std::iter::once(shown.as_str())
        .chain(settings.iter().map(|(_, setting)| setting.as_str()))
        .collect();
    Ok(Operand::Machine(
        one_line(&all.join(" ")),
        Box::new(machine),
    ))
}

impl CompareJob {
    pub fn run(self) -> Result<String> {
        let frame = self.frame.as_ref().map(|drawn| match drawn {
            SharedFrame::Scene(scene) => Workload::Scene(scene),
            SharedFrame::Recording(recording) => Workload::Recording(recording),
        });
        let side = |one: Operand| match (one, &frame) {
            (Operand::Frame(side), _) => Ok(*side),
            (Operand::Machine(name, machine), Some(frame)) => {
                ComparisonSide::of_frame(&name, &machine, frame, &self.prices)
            }
            (Operand::Machine(name, machine), None) => {
                ComparisonSide::of_machine(&name, &machine, &self.prices)
            }
        };
        let [a, b] = self.sides;
        let (a, b) = (side(a)?, side(b)?);
        let comparison = Comparison::new(&a, &b)?;
        let files = self
            .out
            .as_ref()
            .map(|(folder, _)| {
                comparison
                    .write(&a, &b, folder)
                    .map(|files| written(folder, &files))
            })
            .transpose()?;
        if self.json {
            return pretty(&comparison);
        }
        let end = files.map_or_else(String::new, |files| format!("\n\n{files}"));
        let scale = comparison.difference_scale.filter(|_| !end.is_empty());
        let scale = scale.map_or_else(String::new, |scale| {
            format!("\ndifference.png shows |fixed of A − fixed of B| × {scale}")
        });
        Ok(format!("{}{end}{scale}", comparison.summary(self.all)))
    }
}

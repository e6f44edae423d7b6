//! Arguments: flags shared by several commands, and parsers of their values.

use super::help;
use crate::error::{Error, Result};
use crate::hardware::machines;
use crate::hardware::machines::File;
use crate::hardware::searched::Against;
use crate::output::text::{listed, one_line, wrapped};
use crate::scene::{Overrides, Scene};
use clap::{ArgAction, Args, ValueEnum};
use rtl_model::Machine;
use serde_json::Value;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Flags of the commands that draw: machine, picture and threads.
#[derive(Args, Debug)]
pub(super) struct CommonArgs {
    /// Use this machine or file [default: by the scene]
    #[arg(long, value_name = "NAME|FILE")]
    machine: Option<OsString>,
    #[arg(long = "set", value_name = "PATH=VALUE", help = help::SET, long_help = help::SET_LONG)]
    settings: Vec<String>,
    /// Set the size of the picture, in pixels
    #[arg(long, value_name = "WxH", action = ArgAction::Append)]
    size: Vec<TwoNumbers<'x'>>,
    /// Draw frame N of a sequence [default: 0]
    #[arg(long, value_name = "N")]
    pub frame: Option<usize>,
    #[command(flatten)]
    pub threads: Threads,
}

impl CommonArgs {
    /// The machine of `--machine`, or the default one for a scene.
    pub fn machine(&self, scene: &Scene) -> Result<Machine> {
        self.machine_file(scene).map(|file| file.machine)
    }

    fn machine_file(&self, scene: &Scene) -> Result<File> {
        let file = machines::load_file(
            self.machine
                .as_deref()
                .unwrap_or_else(|| OsStr::new(machines::usual(scene))),
            &self.settings,
        )?;
        Ok(file.on(scene))
    }

    /// The machine. If it is the result of a search, also how the scene differs from the searched
    /// ones.
    pub fn searched_machine(&self, scene: &Scene) -> Result<SearchedMachine> {
        let file = self.machine_file(scene)?;
        let is_changed = self
            .settings
            .iter()
            .any(|setting| machines::changes_picture(setting));
        let outside = file.outside(scene, is_changed);
        let File { machine, searched } = file;
        let (Some(record), Some(mut outside)) = (searched, outside) else {
            return Ok(SearchedMachine {
                machine,
                outside: None,
                warning: None,
            });
        };
        if record.target.frames_per_second.is_some()
            && self
                .settings
                .iter()
                .any(|setting| !machines::changes_picture(setting))
        {
            outside.push("a field of timing that --set changed".into());
        }
        let (name, scenes, target) = (&machine.name, record.scene_names(), record.target_text());
        let here = listed(&outside);
        let warning = format!(
            "machine {name} was searched on {scenes} for {target}, and may miss that here: {here}"
        );
        Ok(SearchedMachine {
            machine,
            warning: (!outside.is_empty()).then_some(warning),
            outside: Some(outside),
        })
    }

    /// The scene. In a sequence: frame `--frame`, or the first.
    pub fn scene(&self, name_or_path: &OsStr) -> Result<Scene> {
        Scene::load_frame(name_or_path, &self.overrides(), self.frame.unwrap_or(0))
    }

    /// Values that override the scene's own.
    pub fn overrides(&self) -> Overrides {
        self.each_overrides()[0]
    }

    /// One [`Overrides`] per `--size`; never empty.
    pub fn each_overrides(&self) -> Vec<Overrides> {
        let mut all: Vec<Overrides> = self
            .size
            .iter()
            .map(|TwoNumbers(width, height)| Overrides {
                size: Some((*width, *height)),
            })
            .collect();
        all.dedup();
        if all.is_empty() {
            vec![Overrides::default()]
        } else {
            all
        }
    }

    /// Refuses several sizes in a command that draws one picture.
    pub fn of_one_size(&self) -> Result<Threads> {
        match self.size.as_slice() {
            [] | [_] => Ok(self.threads),
            all => Err(Error::input(format!(
                "--size: {} sizes are given, and one picture is drawn; only `search` takes several",
                all.len()
            ))),
        }
    }
}

/// A machine, and whether it is used within the limits of its search.
#[derive(Debug)]
pub(super) struct SearchedMachine {
    pub machine: Machine,
    /// How the scene differs from those of the search; None for a machine that was not searched.
    pub outside: Option<Vec<String>>,
    /// `outside` in a sentence; None if it is empty.
    pub warning: Option<String>,
}

#[derive(Args, Clone, Copy, Debug)]
pub(super) struct Threads {
    /// Use N threads; same results [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

impl Threads {
    /// Runs `work` on `--threads` threads.
    pub fn run<T: Send>(self, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
        let Some(threads) = self.threads else {
            return work();
        };
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.into())
            .build();
        pool.map_err(|e| Error::job(format!("--threads {threads}: {e}")))?
            .install(work)
    }
}

/// Two whole numbers with a separator between them.
#[derive(Clone, Copy, Debug)]
pub(super) struct TwoNumbers<const SEPARATOR: char>(pub usize, pub usize);

impl<const SEPARATOR: char> FromStr for TwoNumbers<SEPARATOR> {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let pair = text
            .split_once(SEPARATOR)
            .and_then(|(a, b)| Some(TwoNumbers(a.parse().ok()?, b.parse().ok()?)));
        pair.ok_or_else(|| format!("two whole numbers with `{SEPARATOR}` between them are needed"))
    }
}

/// A range of whole numbers, A..B.
#[derive(Clone, Copy, Debug)]
pub(super) struct NumberRange(pub [u32; 2]);

impl FromStr for NumberRange {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let span = text
            .split_once("..")
            .and_then(|(a, b)| Some(NumberRange([a.parse().ok()?, b.parse().ok()?])));
        span.ok_or_else(|| "two whole numbers with `..` between them are needed".into())
    }
}

/// A range of factors, A..B, above 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct FactorRange(pub [f64; 2]);

impl FromStr for FactorRange {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parts = text
            .split_once("..")
            .and_then(|(a, b)| Some([positive(a).ok()?, positive(b).ok()?]));
        let is_range =
            |[a, b]: &[f64; 2]| a <= b && (1e-3..=1e3).contains(a) && (1e-3..=1e3).contains(b);
        parts.filter(is_range).map(FactorRange).ok_or_else(|| {
            "two numbers from 0.001 to 1000 with `..` between them are needed, the lesser first"
                .into()
        })
    }
}

/// Two corners of a rectangle of pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corners(pub [u32; 4]);

impl FromStr for Corners {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let numbers: Option<Vec<u32>> = text.split(',').map(|number| number.parse().ok()).collect();
        let corners = numbers
            .and_then(|numbers| numbers.try_into().ok())
            .map(Corners);
        corners.ok_or_else(|| "four whole numbers with commas between them are needed".into())
    }
}

/// `--against`.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum AgainstFlag {
    Golden,
    Ideal,
}

impl From<AgainstFlag> for Against {
    fn from(flag: AgainstFlag) -> Self {
        match flag {
            AgainstFlag::Golden => Against::Golden,
            AgainstFlag::Ideal => Against::Ideal,
        }
    }
}

/// Parses a number above 0.
pub(super) fn positive(text: &str) -> std::result::Result<f64, String> {
    let number = text
        .parse::<f64>()
        .ok()
        .filter(|number| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| "a number above 0 is needed".into())
}

/// The default output folder of a command: `terrain-sweep`.
pub(super) fn folder_for(name_or_path: &OsStr, job: &str) -> PathBuf {
    let mut name = Path::new(name_or_path)
        .file_stem()
        .unwrap_or_default()
        .to_os_string();
    name.push(job);
    name.into()
}

/// Names the files that were written into a folder.
pub(super) fn written(folder: &Path, files: &[PathBuf]) -> String {
    let names: Vec<_> = files
        .iter()
        .filter_map(|path| path.file_name()?.to_str())
        .collect();
    wrapped(&format!(
        "written to {}: {}",
        one_line(&folder.to_string_lossy()),
        names.join(" ")
    ))
}

/// A schema with descriptions in one line each, and without rustdoc's brackets of links.
pub(super) fn readable(mut schema: Value) -> Value {
    fn visit(value: &mut Value) {
        match value {
            Value::Object(fields) => fields.iter_mut().for_each(|(name, field)| match field {
                Value::String(text) if name == "description" => {
                    let line: Vec<&str> = text.split_whitespace().collect();
                    *text = line.join(" ").replace("[`", "`").replace("`]", "`");
                }
                _ => visit(field),
            }),
            Value::Array(items) => items.iter_mut().for_each(visit),
            _ => {}
        }
    }
    visit(&mut schema);
    schema
}

/// A value as JSON.
pub(super) fn pretty(value: &impl serde::Serialize) -> Result<String> {
    serde_json::to_string_pretty(value).map_err(|e| Error::job(e.to_string()))
}

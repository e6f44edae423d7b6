//! Arguments: those that several commands have, and texts that become numbers.

use crate::error::{Error, Result};
use crate::hardware::machines;
use crate::hardware::machines::File;
use crate::output::text::{listed, one_line, wrapped};
use crate::scene::{Overrides, Scene};
use clap::{ArgAction, Args};
use rtl_model::Machine;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Machine and picture of whatever draws.
#[derive(Args, Debug)]
pub(super) struct Common {
    /// Use this machine or file [default: by the scene]
    #[arg(long, value_name = "NAME|FILE")]
    machine: Option<OsString>,
    /// Set a field: gauss.weight=U-2F16
    #[arg(long = "set", value_name = "PATH=VALUE")]
    settings: Vec<String>,
    /// Set the size of the picture, in pixels
    #[arg(long, value_name = "WxH", action = ArgAction::Append)]
    size: Vec<Pair<'x'>>,
    /// Draw frame N [default: 0; `run`: all]
    #[arg(long, value_name = "N")]
    pub frame: Option<usize>,
    #[command(flatten)]
    pub threads: Threads,
}

impl Common {
    /// The machine that is asked for, or the usual one for a scene.
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

    /// The same, and where it was searched, how the scene lies outside of that.
    pub fn machine_within(&self, scene: &Scene) -> Result<Within> {
        let file = self.machine_file(scene)?;
        let is_changed = self
            .settings
            .iter()
            .any(|setting| machines::changes_picture(setting));
        let outside = file.outside(scene, is_changed);
        let File { machine, searched } = file;
        let (Some(record), Some(mut outside)) = (searched, outside) else {
            return Ok(Within {
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
        Ok(Within {
            machine,
            warning: (!outside.is_empty()).then_some(warning),
            outside: Some(outside),
        })
    }

    /// The scene; of a sequence the frame that is asked for, else the first.
    pub fn scene(&self, name_or_path: &OsStr) -> Result<Scene> {
        Scene::load_frame(name_or_path, &self.overrides(), self.frame.unwrap_or(0))
    }

    /// Values that go before the scene's own.
    pub fn overrides(&self) -> Overrides {
        self.each_overrides()[0]
    }

    /// The same for each of several sizes; never empty.
    pub fn each_overrides(&self) -> Vec<Overrides> {
        let mut all: Vec<Overrides> = self
            .size
            .iter()
            .map(|Pair(width, height)| Overrides {
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

    /// Refuses several sizes, for a job that draws one picture.
    pub fn of_one_size(&self) -> Result<Threads> {
        match self.size.as_slice() {
            [] | [_] => Ok(self.threads),
            all => Err(Error::input(format!(
                "--size: {} sizes are there, and one picture is drawn; search takes several",
                all.len()
            ))),
        }
    }
}

/// A machine, and whether it is known what it does to a scene.
#[derive(Debug)]
pub(super) struct Within {
    pub machine: Machine,
    /// How the scene lies outside of what the machine was searched for; none where nobody searched
    /// it.
    pub outside: Option<Vec<String>>,
    /// That in a sentence, if it does.
    pub warning: Option<String>,
}

#[derive(Args, Clone, Copy, Debug)]
pub(super) struct Threads {
    /// Use N threads; same results [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

impl Threads {
    /// Runs `work` on as many threads as asked for.
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
pub(super) struct Pair<const SEPARATOR: char>(pub usize, pub usize);

impl<const SEPARATOR: char> FromStr for Pair<SEPARATOR> {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let pair = text
            .split_once(SEPARATOR)
            .and_then(|(a, b)| Some(Pair(a.parse().ok()?, b.parse().ok()?)));
        pair.ok_or_else(|| format!("two whole numbers with `{SEPARATOR}` between them are needed"))
    }
}

/// A range of whole numbers, A..B.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span(pub [u32; 2]);

impl FromStr for Span {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let span = text
            .split_once("..")
            .and_then(|(a, b)| Some(Span([a.parse().ok()?, b.parse().ok()?])));
        span.ok_or_else(|| "two whole numbers with `..` between them are needed".into())
    }
}

/// A range of parts, A..B, above 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parts(pub [f64; 2]);

impl FromStr for Parts {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parts = text
            .split_once("..")
            .and_then(|(a, b)| Some([positive(a).ok()?, positive(b).ok()?]));
        let is_range =
            |[a, b]: &[f64; 2]| a <= b && (1e-3..=1e3).contains(a) && (1e-3..=1e3).contains(b);
        parts.filter(is_range).map(Parts).ok_or_else(|| {
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

/// A number above 0.
pub(super) fn positive(text: &str) -> std::result::Result<f64, String> {
    let number = text
        .parse::<f64>()
        .ok()
        .filter(|number| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| "a number above 0 is needed".into())
}

/// The folder of a job on a file where none is named: `terrain-sweep`.
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

/// A value as JSON.
pub(super) fn pretty(value: &impl serde::Serialize) -> Result<String> {
    serde_json::to_string_pretty(value).map_err(|e| Error::job(e.to_string()))
}

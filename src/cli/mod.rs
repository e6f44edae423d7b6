//! Cli: flags as typed → a checked run (docs/book/getting-started.md).

use crate::accuracy::{proofs, ranges};
use crate::cosim::{diff, trace};
use crate::error::{Error, Result};
use crate::explore::search::{self, Target};
use crate::explore::stress;
use crate::explore::sweep::plan::Points;
use crate::explore::sweep::{self, Shard, charts};
use crate::hardware::{fixed, machines};
use crate::output::files::open_folder;
use crate::output::text::{aligned, plain_table, wrapped};
use crate::performance::cost::{self, Cost, Prices};
use crate::performance::recording::Recording;
use crate::performance::timings::{Axes, Variants};
use crate::run::explain::explain;
use crate::run::preview::{self, Preview};
use crate::run::report::MachineReport;
use crate::run::{self, Asked, timed};
use crate::scene::{self, Overrides, Scene};
use clap::error::ErrorKind;
use clap::{Args, Parser, Subcommand};
use comfy_table::CellAlignment;
use rtl_model::Machine;
use std::ffi::OsString;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Simulates splatting hardware bit by bit, beside exact arithmetic
#[derive(Parser, Debug)]
#[command(name = "splatsim", version)]
struct Typed {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Draw a scene on a machine and in exact arithmetic; compare
    #[command(after_help = NAMES)]
    Run(Run),
    /// Time a frame again that `run --record` recorded
    Replay(Replay),
    /// Drive small scenes into trouble: where methods fail, and machines
    #[command(after_help = STRESS)]
    Stress(Stress),
    /// Try many machines on one or many scenes, a row each
    #[command(after_help = SWEEP)]
    Sweep(Sweep),
    /// Find the narrowest machine that meets a target on a scene
    #[command(after_help = NAMES)]
    Search(Search),
    /// Draw charts of what a sweep or a search found, and a page of them
    Chart(Chart),
    /// Dump what crosses the wires between units, to check hardware
    #[command(after_help = TRACE)]
    Trace(Trace),
    /// Compare a device's output with a trace; name the first mismatch
    #[command(after_help = DIFF)]
    Diff(Diff),
    /// Tell one pixel's whole story, the machine beside golden
    #[command(after_help = NAMES)]
    Explain(Explain),
    /// Show machines
    #[command(subcommand)]
    Machine(MachineCommand),
    /// Show what a scene file may hold
    #[command(subcommand)]
    Scene(SceneCommand),
}

#[derive(Args, Debug)]
struct Run {
    /// A scene, cloud, volume or built-in name
    #[arg(default_value = "glass-spheres")]
    scene: String,
    #[command(flatten)]
    common: Common,
    /// Write pictures and report.json into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Draw a 16th of the pixels; say what that leaves out
    #[arg(long)]
    preview: bool,
    /// Write OpenEXR pictures too (float32, linear)
    #[arg(long, requires = "out")]
    exr: bool,
    /// Write the requests to memory too
    #[arg(long, requires = "out")]
    requests: bool,
    /// Write what happened into this file, for `replay`
    #[arg(long, value_name = "FILE", conflicts_with = "preview")]
    record: Option<PathBuf>,
    /// Tell which words make the error (draws 170 frames)
    #[arg(long)]
    attribute: bool,
    /// Replay with every value: timing.raster.fifo=1,2,4
    #[arg(long, value_name = "PATH=A,…")]
    timing: Option<Axes>,
    /// What a bit costs [default: machine prices]
    #[arg(long, value_name = "FILE")]
    prices: Option<PathBuf>,
    /// Print every signal's range too
    #[arg(long)]
    ranges: bool,
    /// Print no summary
    #[arg(long)]
    quiet: bool,
}

#[derive(Args, Debug)]
struct Replay {
    /// The file that `run --record` wrote
    #[arg(value_name = "FILE")]
    record: PathBuf,
    /// Change a field, as in timing.raster.fifo=4
    #[arg(long = "set", value_name = "PATH=VALUE")]
    settings: Vec<String>,
    /// Replay with every value: timing.raster.fifo=1,2,4
    #[arg(long, value_name = "PATH=A,…")]
    timing: Option<Axes>,
    /// Write cycles.json, tables and charts into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write the requests to memory too
    #[arg(long, requires = "out")]
    requests: bool,
    #[command(flatten)]
    threads: Threads,
    /// Print no table
    #[arg(long)]
    quiet: bool,
}

#[derive(Args, Debug)]
struct Stress {
    /// Only this case; may be given again [default: all]
    #[arg(long = "case", value_name = "NAME")]
    cases: Vec<String>,
    /// Another machine beside the named ones; may be given again
    #[arg(long = "machine", value_name = "NAME|FILE")]
    machines: Vec<String>,
    /// Write stress.json, stress.csv, stress.png and gallery.png into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    threads: Threads,
    /// Print no table
    #[arg(long)]
    quiet: bool,
}

#[derive(Args, Debug)]
struct Sweep {
    /// A .json plan or the name of a ready one
    plan: String,
    /// Write rows here, or go on [default: PLAN-sweep]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Draw part I of N alone, into the same folder
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Draw as many points
    #[arg(long, value_name = "POINTS", default_value_t = sweep::MOST_POINTS)]
    most: u64,
    /// What a bit costs [default: machine prices]
    #[arg(long, value_name = "FILE")]
    prices: Option<PathBuf>,
    #[command(flatten)]
    threads: Threads,
    /// Print nothing
    #[arg(long)]
    quiet: bool,
}

#[derive(Args, Debug)]
struct Search {
    /// .json scenes, .ply clouds or built-in names; all must do
    #[arg(required = true, value_name = "SCENE")]
    scenes: Vec<String>,
    /// At least so many dB, fixed − golden over all pixels
    #[arg(long, value_name = "DB", value_parser = positive, required_unless_present = "max_error")]
    target_psnr: Option<f64>,
    /// No pixel further off, linear light in [0, 1]
    #[arg(long, value_name = "ERROR", value_parser = positive)]
    max_error: Option<f64>,
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
    common: Common,
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

#[derive(Args, Debug)]
struct Chart {
    /// The folder that a sweep or a search wrote; charts go there too
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Print nothing
    #[arg(long)]
    quiet: bool,
}

#[derive(Args, Debug)]
struct Trace {
    /// A .json scene, .ply cloud or built-in name
    scene: String,
    /// Only ports of these units
    #[arg(long, value_name = "UNIT,…", value_delimiter = ',')]
    units: Vec<String>,
    /// Only these splats, from A to the one before B
    #[arg(long, value_name = "A..B")]
    splats: Option<Span>,
    /// Only these pixels, the last ones among them
    #[arg(long, value_name = "X0,Y0,X1,Y1")]
    pixels: Option<Corners>,
    /// Only one in N splats and pixels
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    sample: Option<u32>,
    /// Instead, corners and N random cases a unit
    #[arg(long, value_name = "N", conflicts_with_all = ["splats", "pixels", "sample"])]
    stimulus: Option<u32>,
    /// Waves of these cycles too, as VCD and FST
    #[arg(long, value_name = "A..B", conflicts_with = "stimulus")]
    waves: Option<Span>,
    /// Other samples, other random cases
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    common: Common,
    /// Write the trace into this folder
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print no table
    #[arg(long)]
    quiet: bool,
}

#[derive(Args, Debug)]
struct Diff {
    /// The folder that `trace` wrote
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// A stream, as raster.out, and a file of records
    #[arg(required = true, num_args = 2.., value_names = ["STREAM", "FILE"])]
    outputs: Vec<String>,
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
}

#[derive(Args, Debug)]
struct Explain {
    /// A .json scene, .ply cloud or built-in name
    scene: String,
    /// The pixel; 0,0 is top left
    #[arg(long, value_name = "X,Y")]
    pixel: Pair<','>,
    #[command(flatten)]
    common: Common,
}

#[derive(Args, Debug)]
struct Common {
    /// Named machine or file [default: by the scene]
    #[arg(long, value_name = "NAME|FILE")]
    machine: Option<String>,
    /// Change a field, as in gauss.weight=U-2F16
    #[arg(long = "set", value_name = "PATH=VALUE")]
    settings: Vec<String>,
    /// Size of the picture instead of the scene's own
    #[arg(long, value_name = "WxH")]
    size: Option<Pair<'x'>>,
    #[command(flatten)]
    threads: Threads,
}

#[derive(Args, Debug)]
struct Threads {
    /// Threads; no result depends on them [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

#[derive(Subcommand, Debug)]
enum MachineCommand {
    /// The named machines
    List,
    /// A machine as JSON
    Show {
        /// Named machine or machine file
        #[arg(value_name = "NAME|FILE")]
        machine: String,
        /// Change a field of the machine
        #[arg(long = "set", value_name = "PATH=VALUE")]
        settings: Vec<String>,
    },
    /// A machine's timing as JSON, with all that follows from its formats
    Timing {
        /// Named machine or machine file
        #[arg(value_name = "NAME|FILE")]
        machine: String,
        /// Change a field of the machine
        #[arg(long = "set", value_name = "PATH=VALUE")]
        settings: Vec<String>,
    },
    /// What a machine takes in area, unit by unit
    Cost {
        /// Named machine or machine file
        #[arg(value_name = "NAME|FILE")]
        machine: String,
        /// Change a field of the machine
        #[arg(long = "set", value_name = "PATH=VALUE")]
        settings: Vec<String>,
        /// What a bit costs [default: machine prices]
        #[arg(long, value_name = "FILE")]
        prices: Option<PathBuf>,
    },
    /// What a bit of each kind costs, as JSON
    Prices,
    /// Write proofs of a machine's error bounds, for Gappa to check
    Prove {
        /// Named machine or machine file
        #[arg(value_name = "NAME|FILE")]
        machine: String,
        /// Change a field of the machine
        #[arg(long = "set", value_name = "PATH=VALUE")]
        settings: Vec<String>,
        /// Write the proofs into this folder
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
    /// The JSON Schema of a machine file
    Schema,
}

#[derive(Subcommand, Debug)]
enum SceneCommand {
    /// The JSON Schema of a scene file
    Schema,
    /// The JSON Schema of a plan of `sweep`
    PlanSchema,
}

/// What the help texts end with.
const NAMES: &str = "Built-in scenes: glass-spheres, checkerboard, torus-knot, terrain;\n\
    volumes nested-shells, marschner-lobb, fuzzy-clouds; Gaussians bouquet\n\
    Named machines: reference, lean, tiny; volume; gaussian";

/// What the help text of `stress` ends with.
const STRESS: &str = "Exit status 1 where a pixel exceeds its bound, a flip has no explanation or a failure is silent";

/// What the help text of `trace` ends with.
const TRACE: &str = "Units: pipeline, project, ellipse, raster, gauss, fragment, shade, resolve\n\
    Built-in scenes: glass-spheres, checkerboard, torus-knot, terrain\nNamed machines: reference, lean, tiny";

/// What the help text of `diff` ends with.
const DIFF: &str = "Streams whose order counts at each pixel only may come in another.\n\
    Exit status 0 where all is equal, 1 where it is not, 2 where a file is malformed";

/// What the help text of `sweep` ends with.
const SWEEP: &str =
    "Ready plans: precision, precision-in-lockstep, curves, architecture, layers\n`scene plan-schema` says what a plan may hold";

/// Two whole numbers with a separator between them.
#[derive(Clone, Copy, Debug)]
struct Pair<const SEPARATOR: char>(usize, usize);

impl<const SEPARATOR: char> FromStr for Pair<SEPARATOR> {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let pair = text.split_once(SEPARATOR).and_then(|(a, b)| Some(Pair(a.parse().ok()?, b.parse().ok()?)));
        pair.ok_or_else(|| format!("two whole numbers with `{SEPARATOR}` between them are needed"))
    }
}

/// A range of whole numbers, A..B.
#[derive(Clone, Copy, Debug)]
struct Span([u32; 2]);

impl FromStr for Span {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let span = text.split_once("..").and_then(|(a, b)| Some(Span([a.parse().ok()?, b.parse().ok()?])));
        span.ok_or_else(|| "two whole numbers with `..` between them are needed".into())
    }
}

/// Two corners of a rectangle of pixels.
#[derive(Clone, Copy, Debug)]
struct Corners([u32; 4]);

impl FromStr for Corners {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let numbers: Option<Vec<u32>> = text.split(',').map(|number| number.parse().ok()).collect();
        let corners = numbers.and_then(|numbers| numbers.try_into().ok()).map(Corners);
        corners.ok_or_else(|| "four whole numbers with commas between them are needed".into())
    }
}

/// A number above 0.
fn positive(text: &str) -> std::result::Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| "a number above 0 is needed".into())
}

impl Common {
    /// The machine that is asked for, or the usual one for a scene.
    fn machine(&self, scene: &Scene) -> Result<Machine> {
        machines::load(self.machine.as_deref().unwrap_or_else(|| machines::usual(scene)), &self.settings)
    }

    fn scene(&self, name_or_path: &str) -> Result<Scene> {
        Scene::load(name_or_path, &Overrides { size: self.size.map(|Pair(width, height)| (width, height)) })
    }
}

impl Threads {
    /// Runs `work` on as many threads as asked for.
    fn run<T: Send>(&self, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
        let Some(threads) = self.threads else { return work() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build();
        pool.map_err(|e| Error::job(format!("--threads {threads}: {e}")))?.install(work)
    }
}

/// Does what the arguments say.
///
/// # Errors
/// [`Error::Input`] where they, or a file that they name, are wrong; [`Error::Job`] where the work failed.
pub fn run_typed(arguments: impl IntoIterator<Item = OsString>) -> Result<String> {
    let typed = match Typed::try_parse_from(arguments) {
        Ok(typed) => typed,
        Err(error) => return told(&error),
    };
    match typed.command {
        Command::Run(arguments) => arguments.common.threads.run(|| arguments.run()),
        Command::Replay(arguments) => arguments.threads.run(|| arguments.run()),
        Command::Stress(arguments) => arguments.threads.run(|| arguments.run()),
        Command::Sweep(arguments) => arguments.threads.run(|| arguments.run()),
        Command::Search(arguments) => arguments.common.threads.run(|| arguments.run()),
        Command::Chart(arguments) => arguments.run(),
        Command::Trace(arguments) => arguments.common.threads.run(|| arguments.run()),
        Command::Diff(arguments) => arguments.run(),
        Command::Explain(arguments) => arguments.common.threads.run(|| arguments.explain()),
        Command::Machine(MachineCommand::List) => list(),
        Command::Machine(MachineCommand::Show { machine, settings }) => show(&machine, &settings),
        Command::Machine(MachineCommand::Timing { machine, settings }) => timing(&machine, &settings),
        Command::Machine(MachineCommand::Cost { machine, settings, prices }) => cost(&machine, &settings, prices.as_deref()),
        Command::Machine(MachineCommand::Prices) => pretty(&cost::DEFAULT),
        Command::Machine(MachineCommand::Prove { machine, settings, out }) => write_proofs(&machine, &settings, &out),
        Command::Machine(MachineCommand::Schema) => pretty(&machines::schema()),
        Command::Scene(SceneCommand::Schema) => pretty(&scene::schema()),
        Command::Scene(SceneCommand::PlanSchema) => pretty(&sweep::plan::schema()),
    }
}

/// Does what the arguments say and prints what comes of it.
///
/// # Errors
/// As [`run_typed`]. A reader that stops listening is no error.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> Result<()> {
    print(&run_typed(arguments)?)
}

/// Prints a text, if there is one.
fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    let written = if text.is_empty() { Ok(()) } else { writeln!(out, "{}", text.trim_end()).and_then(|()| out.flush()) };
    match written {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(Error::job(format!("standard output: {e}"))),
        _ => Ok(()),
    }
}

/// What clap says: help and version as text, a fault as one sentence.
fn told(error: &clap::Error) -> Result<String> {
    let text = error.to_string();
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => Ok(text),
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            let listed = text.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
            let names: Vec<&str> = listed.filter_map(|line| line.split_whitespace().next()).filter(|name| *name != "help").collect();
            Err(Error::input(format!("a command is missing: {} (see --help)", names.join(", "))))
        }
        _ => {
            let lines = text.lines().map(str::trim).take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more"));
            let sentence: Vec<&str> = lines.filter(|line| !line.is_empty()).collect();
            Err(Error::input(sentence.join(" ").trim_start_matches("error: ").replace(" tip: ", "; ")))
        }
    }
}

impl Run {
    fn run(&self) -> Result<String> {
        let prices = Prices::load_or_default(self.prices.as_deref())?;
        let (scene, load_seconds) = timed(|| self.common.scene(&self.scene));
        let scene = scene?;
        let machine = self.common.machine(&scene)?;
        fixed::elaborate(&machine)?;
        let timings = self.timing.as_ref().map(|axes| Variants::new(&machine, axes)).transpose()?;
        let small = self.preview.then(|| preview::scene(&scene)).transpose()?;
        if let Some(folder) = &self.out {
            open_folder(folder)?;
        }
        self.record.as_deref().map_or(Ok(()), Recording::may_be_written)?;
        let asked = Asked { attribution: self.attribute, timings, requests: self.requests, record: self.record.is_some(), prices };
        if !self.quiet && !self.preview && std::io::stderr().is_terminal() {
            preview::announcement(&scene, &machine)?.iter().for_each(|told| eprintln!("{told}"));
        }
        let (outcome, seconds) = timed(|| run::run(small.as_ref().unwrap_or(&scene), &machine, load_seconds, &asked));
        let mut outcome = outcome?;
        if small.is_some() {
            let preview = Preview::new(&scene, &machine, outcome.report.figures())?;
            outcome.report.host.whole_seconds = Some(seconds * preview.growth(scene.splats.len()));
            outcome.report.preview = Some(preview);
        }
        let end = match &self.out {
            Some(folder) => {
                let written = outcome.write(folder, self.exr)?;
                let names: Vec<_> = written.iter().filter_map(|path| path.file_name()?.to_str()).collect();
                let told = wrapped(&format!("written to {}: {}", folder.display(), names.join(" ")));
                format!("{told}\nerror.png shows |fixed − golden| × {}", outcome.report.error_scale)
            }
            None => "no pictures written: --out DIR writes them and report.json".into(),
        };
        let end = match (&self.record, outcome.work.take()) {
            (Some(path), Some(work)) => {
                Recording { scene: scene.name.clone(), machine, work }.write(path)?;
                format!("{end}\nwork recorded in {}", path.display())
            }
            _ => end,
        };
        let ranges = if self.ranges { format!("\n{}", ranges::table(&outcome.report.signals)) } else { String::new() };
        let text = format!("{}\n{ranges}{end}", outcome.report.summary());
        Ok(if self.quiet { String::new() } else { text })
    }
}

impl Replay {
    fn run(&self) -> Result<String> {
        let mut recording = Recording::read(&self.record)?;
        self.settings.iter().try_for_each(|setting| recording.set(setting))?;
        if let Some(folder) = &self.out {
            open_folder(folder)?;
        }
        let replayed = recording.replay(self.timing.as_ref(), self.requests)?;
        let end = match &self.out {
            Some(folder) => {
                let written = replayed.write(folder)?;
                let names: Vec<_> = written.iter().filter_map(|path| path.file_name()?.to_str()).collect();
                wrapped(&format!("written to {}: {}", folder.display(), names.join(" ")))
            }
            None => "nothing written: --out DIR writes tables and charts".into(),
        };
        Ok(if self.quiet { String::new() } else { format!("{}\n\n{end}", replayed.summary(&recording)) })
    }
}

impl Stress {
    fn run(&self) -> Result<String> {
        let named: Vec<&stress::Case> = self.cases.iter().map(|name| stress::find(name)).collect::<Result<_>>()?;
        let cases = if named.is_empty() { stress::CASES.iter().collect() } else { named };
        let machines: Vec<Machine> = self.machines.iter().map(|name| machines::load(name, &[])).collect::<Result<_>>()?;
        if let Some(folder) = &self.out {
            open_folder(folder)?;
        }
        let catalogue = stress::run(&cases, &machines)?;
        let end = match &self.out {
            Some(folder) => {
                let written = catalogue.write(folder)?;
                let names: Vec<_> = written.iter().filter_map(|path| path.file_name()?.to_str()).collect();
                wrapped(&format!("written to {}: {}", folder.display(), names.join(" ")))
            }
            None => "nothing written: --out DIR writes the tables, a chart and a gallery".into(),
        };
        catalogue.check()?;
        Ok(if self.quiet { String::new() } else { format!("{}\n{end}", catalogue.table()) })
    }
}

impl Sweep {
    fn run(&self) -> Result<String> {
        let points = Points::load(&self.plan)?;
        let prices = Prices::load_or_default(self.prices.as_deref())?;
        let stem = Path::new(&self.plan).file_stem().unwrap_or_default().to_string_lossy();
        let folder = self.out.clone().unwrap_or_else(|| format!("{stem}-sweep").into());
        let progress = !self.quiet && std::io::stderr().is_terminal();
        let asked = sweep::Asked { shard: self.shard, most: self.most, prices, progress };
        let outcome = sweep::run(&points, &folder, &asked)?;
        let names: Vec<_> = outcome.files.iter().filter_map(|path| path.file_name()?.to_str()).collect();
        let told = wrapped(&format!("written to {}: {}", folder.display(), names.join(" ")));
        Ok(if self.quiet { String::new() } else { format!("{}\n\n{told}", outcome.summary()) })
    }
}

impl Search {
    fn run(&self) -> Result<String> {
        let scenes: Vec<Scene> = self.scenes.iter().map(|name| self.common.scene(name)).collect::<Result<_>>()?;
        let machine = self.common.machine(&scenes[0])?;
        let target = Target { psnr_db: self.target_psnr, max_error: self.max_error, no_saturation: self.no_saturation };
        let asked = search::Asked {
            target,
            views: self.views.into(),
            seed: self.seed,
            tries: self.tries.into(),
            only: self.only.clone(),
            prices: Prices::load_or_default(self.prices.as_deref())?,
            progress: !self.quiet && std::io::stderr().is_terminal(),
        };
        let stem = Path::new(&self.scenes[0]).file_stem().unwrap_or_default().to_string_lossy();
        let folder = self.out.clone().unwrap_or_else(|| format!("{stem}-search").into());
        let outcome = search::run(&scenes, &machine, &folder, &asked)?;
        let names: Vec<_> = outcome.files.iter().filter_map(|path| path.file_name()?.to_str()).collect();
        let told = wrapped(&format!("written to {}: {}", folder.display(), names.join(" ")));
        Ok(if self.quiet { String::new() } else { format!("{}\n\n{told}", outcome.summary()) })
    }
}

impl Chart {
    fn run(&self) -> Result<String> {
        let charts = charts::write(&self.folder)?;
        let names: Vec<_> = charts.files.iter().filter_map(|path| path.file_name()?.to_str()).collect();
        let told = wrapped(&format!("written to {}: {}", self.folder.display(), names.join(" ")));
        let text = [charts.summary(), &told].into_iter().filter(|text| !text.is_empty()).collect::<Vec<_>>().join("\n\n");
        Ok(if self.quiet { String::new() } else { text })
    }
}

impl Trace {
    fn run(&self) -> Result<String> {
        let scene = self.common.scene(&self.scene)?;
        let machine = self.common.machine(&scene)?;
        let text = Scene::text(&self.scene);
        let window = trace::Window {
            units: self.units.clone(),
            splats: self.splats.map(|Span(splats)| splats),
            pixels: self.pixels.map(|Corners(pixels)| pixels),
            sample: self.sample,
            stimulus: self.stimulus,
            waves: self.waves.map(|Span(cycles)| cycles.map(u64::from)),
            seed: self.seed,
        };
        let written = trace::trace(&scene, text.as_deref(), &machine, &window, &self.out)?;
        let told = wrapped(&format!("written to {}; README.md there says what each file is", self.out.display()));
        Ok(if self.quiet { String::new() } else { format!("{}\n\n{told}", written.table()) })
    }
}

impl Diff {
    fn run(&self) -> Result<String> {
        let (pairs, rest) = self.outputs.as_chunks::<2>();
        if let [alone] = rest {
            return Err(Error::input(format!("{alone}: a stream needs the file of a device's records behind it")));
        }
        let pairs: Vec<(String, PathBuf)> = pairs.iter().map(|[stream, file]| (stream.clone(), file.into())).collect();
        let outcome = diff::diff(&self.folder, &pairs)?;
        let text = if self.json { pretty(&outcome.json)? } else { outcome.text };
        if outcome.equal {
            return Ok(text);
        }
        // What is different is a result, and goes where results go; the status says that the device failed.
        print(&text)?;
        Err(Error::job(format!("{} is not what the trace has", outcome.json["stream"].as_str().unwrap_or("a stream"))))
    }
}

impl Explain {
    fn explain(&self) -> Result<String> {
        let scene = self.common.scene(&self.scene)?;
        let machine = self.common.machine(&scene)?;
        let Pair(x, y) = self.pixel;
        explain(&scene, &machine, [x, y])
    }
}

fn list() -> Result<String> {
    let says = [
        "its picture counts as exact; the default",
        "the cheapest whose picture is still good",
        "coarse and quick, to see errors",
        "draws ellipsoids too, sheet by sheet",
        "the same, sorted: trained Gaussians",
    ];
    let mut table = plain_table(&["machine", "widest operand", "fragment", ""]);
    for (machine, says) in Machine::names().filter_map(Machine::named).zip(says) {
        let report = MachineReport::new(&fixed::elaborate(&machine)?);
        let [operand, fragment] = [report.widest_operand_bits, report.fragment_bits].map(|bits| format!("{bits} bits"));
        table.add_row([machine.name, operand, fragment, format!("  {says}")]);
    }
    let mut table = aligned(table);
    if let Some(last) = table.column_mut(3) {
        last.set_cell_alignment(CellAlignment::Left);
    }
    Ok(table.trim_fmt())
}

fn show(machine: &str, settings: &[String]) -> Result<String> {
    let machine = machines::load(machine, settings)?;
    fixed::elaborate(&machine)?;
    pretty(&machine)
}

fn timing(machine: &str, settings: &[String]) -> Result<String> {
    pretty(&fixed::elaborate(&machines::load(machine, settings)?)?.timing)
}

fn cost(machine: &str, settings: &[String], prices: Option<&Path>) -> Result<String> {
    let elaborated = fixed::elaborate(&machines::load(machine, settings)?)?;
    Ok(Cost::new(&elaborated, &Prices::load_or_default(prices)?).table())
}

fn write_proofs(machine: &str, settings: &[String], out: &Path) -> Result<String> {
    let proofs = proofs::proofs(&fixed::elaborate(&machines::load(machine, settings)?)?);
    open_folder(out)?;
    proofs::write(&proofs, out)?;
    let first = out.join("project.reciprocal.g");
    Ok(format!("{}\n\ngappa says nothing of a proof that holds:\n  gappa {}", proofs::table(&proofs), first.display()))
}

fn pretty(value: &impl serde::Serialize) -> Result<String> {
    serde_json::to_string_pretty(value).map_err(|e| Error::job(e.to_string()))
}

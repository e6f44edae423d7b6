//! Cli: command line → arguments → checked job → text (docs/book/getting-started.md). One file per
//! command.

mod arguments;
mod chart;
mod compare;
mod diff;
mod explain;
mod help;
mod machine;
mod replay;
mod run;
mod sample;
mod scene;
mod search;
mod shell;
mod stress;
mod style;
mod sweep;
mod trace;
mod tree;
mod unit;
mod view;

use crate::error::{Error, Result};
use crate::output::text::one_line;
use clap::error::ErrorKind;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use std::ffi::OsString;
use std::io::Write;

/// Simulates splatting hardware bit by bit, and in exact arithmetic
#[derive(Parser, Debug)]
#[command(name = "splatsim", version, after_help = help::EXAMPLES)]
struct CommandLine {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Draw a scene on a machine; compare with golden; count cycles
    ///
    /// The summary and report.json have errors, bounds, cycles, area and energy.
    #[command(
        verbatim_doc_comment,
        after_help = help::run(),
        after_long_help = help::with_example(&help::run(), "splatsim run torus-knot --machine lean --out out"),
        mut_arg("frame", |frame| frame.help("Draw only frame N [default: all]"))
    )]
    Run(run::RunArgs),
    /// Recompute cycles of a recorded frame with other timing
    ///
    /// The frame is not drawn again: its recorded work is replayed, so that a field of
    /// `timing` can be tried in a fraction of a second.
    #[command(verbatim_doc_comment, after_long_help = help::with_example("", "splatsim replay out/frame.work --timing timing.memory.bytes_per_cycle=16,32"))]
    Replay(replay::ReplayArgs),
    /// Compare two machines, or two results
    #[command(after_help = help::COMPARE, after_long_help = help::with_example(help::COMPARE, "splatsim compare reference window --scene glass-spheres --out compared"))]
    Compare(compare::CompareArgs),
    /// Print each contribution to a pixel, machine and golden
    #[command(after_help = help::NAMES, after_long_help = help::with_example(help::NAMES, "splatsim explain glass-spheres --pixel 200,180"))]
    Explain(explain::ExplainArgs),
    /// Run built-in cases in which methods or machines fail
    ///
    /// Each case is a small scene that drives a method or a machine to its limit. The
    /// table says which failures were reported by the machine itself.
    #[command(verbatim_doc_comment, after_help = help::STRESS, after_long_help = help::with_example(help::STRESS, "splatsim stress --case grazing --out stress"))]
    Stress(stress::StressArgs),
    /// Draw scenes on many machines; write a row for each
    ///
    /// A plan names scenes, a machine, fields and their values. Rows are written to a
    /// journal; the same command resumes a sweep that was stopped.
    #[command(verbatim_doc_comment, after_help = help::SWEEP, after_long_help = help::sweep())]
    Sweep(sweep::SweepArgs),
    /// Find the smallest machine that meets a target
    ///
    /// Searches word lengths for --target-psnr or --max-error, fields of timing for
    /// --min-fps, or merge rules with --over. The result is verified on unseen views.
    #[command(verbatim_doc_comment, after_help = help::search(), after_long_help = help::with_example(&help::search(), "splatsim search torus-knot --target-psnr 45 --only gauss --out found"))]
    Search(search::SearchArgs),
    /// Draw charts of the rows of a sweep or a search
    ///
    /// Writes PNG, SVG and charts.html, which works without a network.
    #[command(verbatim_doc_comment, after_help = help::CHART, after_long_help = help::with_example(help::CHART, "splatsim chart rows"))]
    Chart(chart::ChartArgs),
    /// Show a result folder in a browser
    #[command(after_help = help::VIEW, after_long_help = help::with_example(help::VIEW, "splatsim view out"))]
    View(view::ViewArgs),
    /// Write test vectors and a SystemVerilog package, to verify RTL
    ///
    /// Writes each record that enters or leaves a unit, a SystemVerilog package with
    /// formats and constants, and the tables as memory files.
    #[command(verbatim_doc_comment, after_help = help::TRACE, after_long_help = help::with_example(help::TRACE, "splatsim trace terrain --size 64x64 --units gauss --sample 10 --out trace"))]
    Trace(trace::TraceArgs),
    /// Compare the output of your RTL with a trace
    #[command(override_usage = "splatsim diff [OPTIONS] <DIR> <STREAM> <FILE> [<STREAM> <FILE>]...", after_help = help::DIFF, after_long_help = help::with_example(help::DIFF, "splatsim diff trace gauss.out device.hex"))]
    Diff(diff::DiffArgs),
    /// Compute the output records of one unit
    #[command(after_help = help::UNIT, after_long_help = help::with_example(help::UNIT, "splatsim unit gauss --machine lean < trace/gauss.in.hex"))]
    Unit(unit::UnitArgs),
    /// Print named machines, their areas and clocks, and the schema
    #[command(subcommand, after_help = help::MACHINE, after_long_help = help::with_example(help::MACHINE, "splatsim machine cost reference"))]
    Machine(machine::MachineCommand),
    /// Print the schemas of scene files and plans
    #[command(subcommand, after_long_help = help::with_example("", "splatsim scene schema"))]
    Scene(scene::SceneCommand),
    /// Sample a mesh into a point cloud
    ///
    /// The cloud is a PLY file that scenes and `run` read.
    #[command(verbatim_doc_comment, after_help = help::SAMPLE, after_long_help = help::with_example(help::SAMPLE, "splatsim sample plane --points 20000 --checkerboard 8 --out floor.ply"))]
    Sample(sample::SampleArgs),
    /// Build a level-of-detail tree of splats
    ///
    /// The tree is a file that `run` draws like a scene.
    #[command(verbatim_doc_comment, after_long_help = help::with_example("", "splatsim tree torus-knot --out knot.tree"))]
    Tree(tree::TreeArgs),
    /// Print a completion script for a shell
    #[command(after_long_help = help::with_example("", "splatsim completions bash > splatsim.bash"))]
    Completions(shell::CompletionsArgs),
    /// Write man pages
    #[command(after_long_help = help::with_example("", "splatsim man man1"))]
    Man(shell::ManArgs),
}

impl Command {
    fn run(self) -> Result<String> {
        match self {
            Command::Run(args) => args.common.of_one_size()?.run(|| args.check()?.run()),
            Command::Replay(args) => args.threads.run(|| args.check()?.run()),
            Command::Compare(args) => args.threads.run(|| args.check()?.run()),
            Command::Stress(args) => args.threads.run(|| args.check()?.run()),
            Command::Sweep(args) => args.threads.run(|| args.check()?.run()),
            Command::Search(args) => args.common.threads.run(|| args.check()?.run()),
            Command::Chart(args) => args.run(),
            Command::View(args) => args.run(),
            Command::Trace(args) => args.common.of_one_size()?.run(|| args.check()?.run()),
            Command::Diff(args) => args.check()?.run(),
            Command::Unit(args) => args.common.of_one_size()?.run(|| args.check()?.run()),
            Command::Explain(args) => args.common.of_one_size()?.run(|| args.run()),
            Command::Machine(args) => args.run(),
            Command::Scene(args) => args.run(),
            Command::Sample(args) => args.threads.run(|| args.check()?.run()),
            Command::Tree(args) => args.threads.run(|| args.check()?.run()),
            Command::Completions(args) => args.run(CommandLine::command()),
            Command::Man(args) => args.run(CommandLine::command()),
        }
    }
}

/// Runs the command and prints its result.
///
/// # Errors
/// [`Error::Input`] if the arguments, or a file that they name, are wrong; [`Error::Job`] if the
/// work failed. A closed standard output is not an error.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> Result<()> {
    let colour = style::use_colour(&std::io::stdout());
    let command = help::in_groups(CommandLine::command());
    let parsed = command
        .try_get_matches_from(arguments)
        .and_then(|matches| CommandLine::from_arg_matches(&matches));
    match parsed {
        Ok(args) => print(&args.command.run()?),
        Err(error) if is_help(&error) && colour => write(&error.render().ansi().to_string()),
        Err(error) if is_help(&error) => write(&error.to_string()),
        Err(error) => Err(input_error(&error)),
    }
}

/// Prints an error to standard error.
pub fn complain(error: &Error) {
    let head = "splatsim:";
    let head = if style::use_colour(&std::io::stderr()) {
        style::alarm(head)
    } else {
        head.into()
    };
    eprintln!("{head} {error}");
}

/// Prints a warning to standard error.
fn warn(sentence: &str) {
    // Quotes from files are shortened as in errors.
    eprintln!("splatsim: warning: {}", Error::input(one_line(sentence)));
}

/// Prints a text, unless it is empty.
fn print(text: &str) -> Result<()> {
    if style::use_colour(&std::io::stdout()) {
        write(&style::with_headings(text))
    } else {
        write(text)
    }
}

fn write(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    let written = if text.is_empty() {
        Ok(())
    } else {
        writeln!(out, "{}", text.trim_end()).and_then(|()| out.flush())
    };
    match written {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::job(format!("standard output: {e}")))
        }
        _ => Ok(()),
    }
}

/// Whether it is a help text or the version, and not an error.
fn is_help(error: &clap::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion
    )
}

/// An error of the command line in one sentence.
fn input_error(error: &clap::Error) -> Error {
    let text = error.to_string();
    if error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        let listed = text
            .lines()
            .take_while(|line| *line != "Options:")
            .filter_map(|line| line.strip_prefix("  "));
        let names: Vec<&str> = listed
            .filter_map(|line| line.split_whitespace().next())
            .filter(|name| *name != "help")
            .collect();
        return Error::input(format!(
            "a command is missing: {} (see --help)",
            names.join(", ")
        ));
    }
    let lines = text
        .lines()
        .map(str::trim)
        .take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more"));
    let sentence: Vec<&str> = lines.filter(|line| !line.is_empty()).collect();
    Error::input(
        sentence
            .join(" ")
            .trim_start_matches("error: ")
            .replace(" tip: ", "; "),
    )
}

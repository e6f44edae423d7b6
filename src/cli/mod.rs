//! Cli: flags as typed → a checked job → its text (docs/book/getting-started.md). A file each command.

mod arguments;
mod chart;
mod compare;
mod diff;
mod explain;
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
use arguments::NAMES;
use clap::error::ErrorKind;
use clap::{CommandFactory, Parser, Subcommand};
use std::ffi::OsString;
use std::io::Write;

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
    Run(run::Typed),
    /// Time a frame again that `run --record` recorded
    Replay(replay::Typed),
    /// Put two machines or two runs side by side
    #[command(after_help = compare::HELP)]
    Compare(compare::Typed),
    /// Drive small scenes into trouble: where methods fail, and machines
    #[command(after_help = stress::HELP)]
    Stress(stress::Typed),
    /// Try many machines on one or many scenes, a row each
    #[command(after_help = sweep::HELP)]
    Sweep(sweep::Typed),
    /// Find the narrowest machine that meets a target on a scene
    #[command(after_help = NAMES)]
    Search(search::Typed),
    /// Draw charts of what a sweep or a search found, and a page of them
    Chart(chart::Typed),
    /// Show a folder's pictures, pixels, machine and rows in a browser
    #[command(after_help = view::HELP)]
    View(view::Typed),
    /// Dump what crosses the wires between units, to check hardware
    #[command(after_help = trace::HELP)]
    Trace(trace::Typed),
    /// Compare a device's output with a trace; name the first mismatch
    #[command(after_help = diff::HELP)]
    Diff(diff::Typed),
    /// Answer records of one unit, line by line, as its twin would
    #[command(after_help = unit::HELP)]
    Unit(unit::Typed),
    /// Tell one pixel's whole story, the machine beside golden
    #[command(after_help = NAMES)]
    Explain(explain::Typed),
    /// Show machines
    #[command(subcommand)]
    Machine(machine::Typed),
    /// Show what a scene file may hold
    #[command(subcommand)]
    Scene(scene::Typed),
    /// Make points of a mesh, as a cloud that scenes are read from
    #[command(after_help = sample::HELP)]
    Sample(sample::Typed),
    /// Build a tree of splats, for level of detail
    Tree(tree::Typed),
    /// Print a script that completes commands and flags in a shell
    Completions(shell::Completions),
    /// Write man pages
    Man(shell::Pages),
}

impl Command {
    fn run(self) -> Result<String> {
        match self {
            Command::Run(typed) => typed.common.of_one_size()?.run(|| typed.check()?.run()),
            Command::Replay(typed) => typed.threads.run(|| typed.check()?.run()),
            Command::Compare(typed) => typed.threads.run(|| typed.check()?.run()),
            Command::Stress(typed) => typed.threads.run(|| typed.check()?.run()),
            Command::Sweep(typed) => typed.threads.run(|| typed.check()?.run()),
            Command::Search(typed) => typed.common.threads.run(|| typed.check()?.run()),
            Command::Chart(typed) => typed.run(),
            Command::View(typed) => typed.run(),
            Command::Trace(typed) => typed.common.of_one_size()?.run(|| typed.check()?.run()),
            Command::Diff(typed) => typed.check()?.run(),
            Command::Unit(typed) => typed.common.of_one_size()?.run(|| typed.check()?.run()),
            Command::Explain(typed) => typed.common.of_one_size()?.run(|| typed.run()),
            Command::Machine(typed) => typed.run(),
            Command::Scene(typed) => typed.run(),
            Command::Sample(typed) => typed.threads.run(|| typed.check()?.run()),
            Command::Tree(typed) => typed.threads.run(|| typed.check()?.run()),
            Command::Completions(typed) => typed.run(Typed::command()),
            Command::Man(typed) => typed.run(Typed::command()),
        }
    }
}

/// Does what the arguments say and prints what comes of it.
///
/// # Errors
/// [`Error::Input`] where they, or a file that they name, are wrong; [`Error::Job`] where the work failed. A reader that stops listening
/// is no error.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> Result<()> {
    let colour = style::takes_colour(&std::io::stdout());
    match Typed::try_parse_from(arguments) {
        Ok(typed) => print(&typed.command.run()?),
        Err(error) if is_help(&error) && colour => write(&error.render().ansi().to_string()),
        Err(error) if is_help(&error) => write(&error.to_string()),
        Err(error) => Err(input_error(&error)),
    }
}

/// Prints an error's sentence to standard error.
pub fn complain(error: &Error) {
    let head = "splatsim:";
    let head = if style::takes_colour(&std::io::stderr()) { style::alarm(head) } else { head.into() };
    eprintln!("{head} {error}");
}

/// Prints a warning's sentence to standard error.
fn warn(sentence: &str) {
    // Quotes are cut as those of errors are.
    eprintln!("splatsim: warning: {}", Error::input(one_line(sentence)));
}

/// Prints a text, if there is one.
fn print(text: &str) -> Result<()> {
    if style::takes_colour(&std::io::stdout()) { write(&style::with_headings(text)) } else { write(text) }
}

fn write(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    let written = if text.is_empty() { Ok(()) } else { writeln!(out, "{}", text.trim_end()).and_then(|()| out.flush()) };
    match written {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(Error::job(format!("standard output: {e}"))),
        _ => Ok(()),
    }
}

/// Whether it is no error but a help text or the version, which somebody asked for.
fn is_help(error: &clap::Error) -> bool {
    matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion)
}

/// A fault of the command line as one sentence.
fn input_error(error: &clap::Error) -> Error {
    let text = error.to_string();
    if error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        let listed = text.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
        let names: Vec<&str> = listed.filter_map(|line| line.split_whitespace().next()).filter(|name| *name != "help").collect();
        return Error::input(format!("a command is missing: {} (see --help)", names.join(", ")));
    }
    let lines = text.lines().map(str::trim).take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more"));
    let sentence: Vec<&str> = lines.filter(|line| !line.is_empty()).collect();
    Error::input(sentence.join(" ").trim_start_matches("error: ").replace(" tip: ", "; "))
}

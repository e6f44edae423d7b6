//! Machine: prints machines, values derived from their formats, their costs, and proofs of their
//! bounds.

use super::arguments::{pretty, readable};
use super::help;
use crate::accuracy::proofs;
use crate::cosim::trace::rtl;
use crate::error::Result;
use crate::hardware::datapath::Layout;
use crate::hardware::machines::File;
use crate::hardware::{fixed, machines};
use crate::output::files::{Folder, Unwritten, write_as_one, write_beside};
use crate::output::text::{aligned, one_line, plain_table};
use crate::performance::clock;
use crate::performance::cost;
use crate::performance::cost::{Cost, Prices};
use crate::run::report::MachineReport;
use crate::scene::{Overrides, Scene};
use clap::{Args, Subcommand};
use comfy_table::CellAlignment;
use rtl_model::Machine;
use rtl_model::pipeline::rtl::words;
use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};

#[derive(Subcommand, Debug)]
pub(super) enum MachineCommand {
    /// List the named machines
    List,
    /// Print a machine as JSON
    #[command(after_help = help::SHOW)]
    Show(MachineArgs),
    /// Print the timing of a machine, derived values included
    #[command(after_help = help::TIMING)]
    Timing(MachineArgs),
    /// Print the critical path of each unit and the highest clock
    Clock(MachineArgs),
    /// Print the area of each unit, in LUT equivalents
    #[command(after_help = help::COST)]
    Cost {
        #[command(flatten)]
        which: MachineArgs,
        /// Read unit costs [default: `machine unit-costs`]
        #[arg(long = "unit-costs", alias = "prices", value_name = "FILE")]
        prices: Option<PathBuf>,
    },
    /// Print the unit costs as JSON
    #[command(name = "unit-costs", alias = "prices")]
    Prices,
    /// Write proofs of the error bounds, for Gappa
    Prove {
        #[command(flatten)]
        which: MachineArgs,
        /// Write the proofs into DIR
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
    /// Write units of a machine as SystemVerilog
    #[command(after_help = help::RTL)]
    Rtl {
        #[command(flatten)]
        which: MachineArgs,
        /// Write units for splats as in this scene [default: by the machine]
        #[arg(long, value_name = "SCENE")]
        scene: Option<OsString>,
        /// Write the files into DIR
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
    /// Draw the datapath of each unit that is a graph, as SVG
    #[command(after_help = help::DATAPATH)]
    Datapath {
        #[command(flatten)]
        which: MachineArgs,
        /// Write the pictures into DIR
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
    /// Print the JSON Schema of machine files
    Schema,
}

#[derive(Args, Debug)]
pub(super) struct MachineArgs {
    /// Named machine or machine file
    #[arg(value_name = "NAME|FILE")]
    machine: OsString,
    #[arg(long = "set", value_name = "PATH=VALUE", help = help::SET, long_help = help::SET_LONG)]
    settings: Vec<String>,
}

impl MachineArgs {
    fn load(&self) -> Result<Machine> {
        self.load_file().map(|file| file.machine)
    }

    /// The whole file. `searched` is dropped if a setting changes the picture.
    fn load_file(&self) -> Result<File> {
        let file = machines::load_file(&self.machine, &self.settings)?;
        let is_changed = self
            .settings
            .iter()
            .any(|setting| machines::changes_picture(setting));
        Ok(File {
            searched: file.searched.filter(|_| !is_changed),
            ..file
        })
    }
}

impl MachineCommand {
    pub fn run(self) -> Result<String> {
        match self {
            MachineCommand::List => list(),
            MachineCommand::Show(which) => show(&which.load_file()?),
            MachineCommand::Timing(which) => pretty(&fixed::elaborate(&which.load()?)?.timing),
            MachineCommand::Clock(which) => Ok(clock::table(&fixed::elaborate(&which.load()?)?)),
            MachineCommand::Cost { which, prices } => {
                let elaborated = fixed::elaborate(&which.load()?)?;
                Ok(Cost::new(&elaborated, &Prices::load_or_default(prices.as_deref())?).table())
            }
            MachineCommand::Prices => pretty(&cost::DEFAULT),
            MachineCommand::Prove { which, out } => prove(&which.load()?, &out),
            MachineCommand::Rtl { which, scene, out } => {
                let machine = which.load()?;
                let scene = match scene {
                    Some(scene) => Scene::load(scene, &Overrides::default())?,
                    None => rtl::usual_scene(&machine)?,
                };
                let table = rtl::write(&scene, &machine, &out)?;
                Ok(format!(
                    "{table}\n\nwritten to {}",
                    one_line(&out.to_string_lossy())
                ))
            }
            MachineCommand::Datapath { which, out } => datapath(&which.load()?, &out),
            MachineCommand::Schema => pretty(&readable(machines::schema())),
        }
    }
}

fn list() -> Result<String> {
    let mut table = plain_table(&["machine", "widest operand", "fragment", ""]);
    for machine in Machine::names().filter_map(Machine::named) {
        let report = MachineReport::new(&fixed::elaborate(&machine)?);
        let [operand, fragment] =
            [report.widest_operand_bits, report.fragment_bits].map(|bits| format!("{bits} bits"));
        let description = format!("  {}", description(&machine.name));
        table.add_row([machine.name, operand, fragment, description]);
    }
    let mut table = aligned(table);
    if let Some(last) = table.column_mut(3) {
        last.set_cell_alignment(CellAlignment::Left);
    }
    Ok(table.trim_fmt())
}

fn description(machine: &str) -> &'static str {
    match machine {
        "reference" => "counts as exact; the default for discs",
        "lean" => "the cheapest whose picture is still good",
        "tiny" => "coarse and quick, to see errors",
        "window" => "four small slots, grouped late",
        "volume" => "draws ellipsoids too, sheet by sheet",
        "gaussian" => "the same, sorted: trained Gaussians",
        "fp16" => "the same in half precision",
        "mixed" => "the same, with a contribution test",
        "weighted" => "sums Gaussians, without a sort",
        "gscore" => "after GSCore (ASPLOS 2024)",
        "neo" => "after Neo (ASPLOS 2026)",
        "flicker" => "after FLICKER (DATE 2026)",
        "nycu" => "after NYCU's chip (TVCG 2026)",
        "cubed" => "an open renderer for an FPGA: Gaussians",
        _ => "",
    }
}

fn show(file: &File) -> Result<String> {
    fixed::elaborate(&file.machine)?;
    pretty(file)
}

fn prove(machine: &Machine, out: &Path) -> Result<String> {
    let proofs = proofs::proofs(&fixed::elaborate(machine)?);
    let _open = Folder::open(out)?;
    proofs::write(&proofs, out)?;
    let first = out.join("project.reciprocal.g");
    Ok(format!(
        "{}\n\ngappa prints nothing for a proof that holds:\n  gappa {}",
        proofs::table(&proofs),
        first.display()
    ))
}

/// Pictures that only some machines have.
const OPTIONAL: [&str; 4] = [
    "colour.svg",
    "bin_splat.svg",
    "bin_tile.svg",
    "contribution.svg",
];

fn datapath(machine: &Machine, out: &Path) -> Result<String> {
    let graphs = words(&fixed::elaborate(machine)?);
    let _open = Folder::open(out)?;
    let mut table = plain_table(&["picture", "words", "wires"]);
    let mut files: Vec<Unwritten> = Vec::new();
    for graph in &graphs {
        let layout = Layout::new(&graph.words);
        let wires: usize = layout.words.iter().map(|placed| placed.word.wires).sum();
        let name = format!("{}.svg", graph.name);
        table.add_row([
            name.clone(),
            layout.words.len().to_string(),
            wires.to_string(),
        ]);
        let svg = layout.svg(graph.unit, &graph.name);
        files.push((
            out.join(name),
            Box::new(move |path| {
                write_beside(path, |file| {
                    file.write_all(svg.as_bytes())
                        .map_err(|error| error.to_string())
                })
            }),
        ));
    }
    // Pictures of an earlier machine.
    write_as_one(out, files, &OPTIONAL)?;
    Ok(format!(
        "{}\n\nwritten to {}",
        aligned(table).trim_fmt(),
        one_line(&out.to_string_lossy())
    ))
}

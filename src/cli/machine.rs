//! Machine: shows machines, what follows from their formats, what they cost, and proofs of their
//! bounds.

use super::arguments::pretty;
use crate::accuracy::proofs;
use crate::error::Result;
use crate::hardware::machines::File;
use crate::hardware::{fixed, machines};
use crate::output::files::Folder;
use crate::output::text::{aligned, plain_table};
use crate::performance::clock;
use crate::performance::cost;
use crate::performance::cost::{Cost, Prices};
use crate::run::report::MachineReport;
use clap::{Args, Subcommand};
use comfy_table::CellAlignment;
use rtl_model::Machine;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

#[derive(Subcommand, Debug)]
pub(super) enum Typed {
    /// List the named machines
    List,
    /// Print a machine as JSON
    Show(Which),
    /// Print the timing of a machine, derived values included
    Timing(Which),
    /// Print the critical path of each unit and the highest clock
    Clock(Which),
    /// Print the area of each unit
    Cost {
        #[command(flatten)]
        which: Which,
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
        which: Which,
        /// Write the proofs into DIR
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
    /// Print the JSON Schema of machine files
    Schema,
}

#[derive(Args, Debug)]
pub(super) struct Which {
    /// Named machine or machine file
    #[arg(value_name = "NAME|FILE")]
    machine: OsString,
    /// Set a field: gauss.weight=U-2F16
    #[arg(long = "set", value_name = "PATH=VALUE")]
    settings: Vec<String>,
}

impl Which {
    fn load(&self) -> Result<Machine> {
        self.load_file().map(|file| file.machine)
    }

    /// With what its file says besides: of a machine whose words were changed that is no longer so.
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

impl Typed {
    pub fn run(self) -> Result<String> {
        match self {
            Typed::List => list(),
            Typed::Show(which) => show(&which.load_file()?),
            Typed::Timing(which) => pretty(&fixed::elaborate(&which.load()?)?.timing),
            Typed::Clock(which) => Ok(clock::table(&fixed::elaborate(&which.load()?)?)),
            Typed::Cost { which, prices } => {
                let elaborated = fixed::elaborate(&which.load()?)?;
                Ok(Cost::new(&elaborated, &Prices::load_or_default(prices.as_deref())?).table())
            }
            Typed::Prices => pretty(&cost::DEFAULT),
            Typed::Prove { which, out } => prove(&which.load()?, &out),
            Typed::Schema => pretty(&machines::schema()),
        }
    }
}

fn list() -> Result<String> {
    let says = [
        "counts as exact; the default for discs",
        "the cheapest whose picture is still good",
        "coarse and quick, to see errors",
        "four small slots, grouped late",
        "draws ellipsoids too, sheet by sheet",
        "the same, sorted: trained Gaussians",
    ];
    let mut table = plain_table(&["machine", "widest operand", "fragment", ""]);
    for (machine, says) in Machine::names().filter_map(Machine::named).zip(says) {
        let report = MachineReport::new(&fixed::elaborate(&machine)?);
        let [operand, fragment] =
            [report.widest_operand_bits, report.fragment_bits].map(|bits| format!("{bits} bits"));
        table.add_row([machine.name, operand, fragment, format!("  {says}")]);
    }
    let mut table = aligned(table);
    if let Some(last) = table.column_mut(3) {
        last.set_cell_alignment(CellAlignment::Left);
    }
    Ok(table.trim_fmt())
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
        "{}\n\ngappa says nothing of a proof that holds:\n  gappa {}",
        proofs::table(&proofs),
        first.display()
    ))
}

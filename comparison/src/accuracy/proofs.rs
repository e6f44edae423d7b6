//! Prove: writes proofs of a machine's error bounds, to be checked by Gappa.
//!
//! ```text
//! machine ─► [ elaborate ] ─► table words, formats, bounds ─► [ a script per claim ] ─► gappa: proved, or not
//! ```
//! Tests try some operands; a proof covers all of them. A script restates the unit with real
//! numbers and Gappa's own roundings, and reads the ROM's words from the elaborated unit. It claims
//! exactly the bound that the unit's `real.rs` returns.
//!
//! Not proved: that a register does not wrap, and that the script computes the same as the unit
//! (`tests/proofs.rs` compares the two).

use crate::error::Result;
use crate::output::files::write_beside;
use crate::output::text::{aligned, plain_table};
use rtl_model::num::{Rounding, Word};
use rtl_model::pipeline::Elaborated;
use script::Script;
use std::io::Write;
use std::path::Path;

mod function_unit;
mod gauss;
mod raster;
pub mod script;

/// Steps of forward differencing that are proved: a row of a tile, and a large splat.
const STEPS: [u32; 2] = [16, 64];

/// One claim and its proof.
#[derive(Clone, Debug)]
pub struct Proof {
    /// The signal, and a suffix that distinguishes several proofs about it.
    pub name: String,
    /// The quantity that is bounded.
    pub claim: String,
    /// The word whose LSB is the unit of `places`.
    pub word: Word,
    /// Greatest error.
    pub bound: f64,
    /// The proof.
    pub script: Script,
}

impl Proof {
    /// The name of its file.
    pub fn file_name(&self) -> String {
        format!("{}.g", self.name)
    }

    /// The bound in ulp of the word.
    pub fn places(&self) -> f64 {
        self.bound / self.word.format.value(1)
    }

    /// Adds comments that state the claim and its grounds.
    fn explained(mut self, machine: &str, what: &str, formats: &str, grounds: &[&str]) -> Proof {
        let (bound, places) = (script::number(self.bound), self.places());
        let claim = format!(
            "Claimed: {} <= {bound}, about {:.2e}, {places:.2} ulp of {}.",
            self.claim, self.bound, self.word
        );
        let head = [
            format!("{} of machine {machine}: {what}", self.name),
            formats.into(),
            claim,
        ];
        self.script.comments = head
            .into_iter()
            .chain(grounds.iter().map(|line| (*line).to_owned()))
            .collect();
        self
    }
}

/// All proofs about a machine.
pub fn proofs(machine: &Elaborated) -> Vec<Proof> {
    let name = &machine.machine.name;
    let reciprocals = machine
        .reciprocals()
        .map(|(signal, unit)| function_unit::reciprocal(name, signal, unit));
    let roots = machine
        .roots()
        .map(|(signal, unit)| function_unit::root(name, signal, unit));
    let steps = STEPS.map(|steps| raster::radial(&machine.machine, steps));
    reciprocals
        .into_iter()
        .chain(roots)
        .chain([gauss::table(machine)])
        .chain(steps)
        .collect()
}

/// Writes each proof into a file in a folder.
///
/// # Errors
/// [`crate::error::Error::Job`] if a file cannot be written; no file is left half-written.
pub fn write(proofs: &[Proof], folder: &Path) -> Result<()> {
    proofs.iter().try_for_each(|proof| {
        let text = proof.script.text();
        write_beside(&folder.join(proof.file_name()), |file| {
            file.write_all(text.as_bytes()).map_err(|e| e.to_string())
        })
    })
}

/// Table of the claims and their bounds.
pub fn table(proofs: &[Proof]) -> String {
    let mut table = plain_table(&["proof", "claim", "at most", "places", "of"]);
    for proof in proofs {
        let [bound, places] = [
            format!("{:.2e}", proof.bound),
            format!("{:.2}", proof.places()),
        ];
        table.add_row([
            proof.file_name(),
            proof.claim.clone(),
            bound,
            places,
            proof.word.to_string(),
        ]);
    }
    aligned(table).trim_fmt()
}

/// The rounding into a word, in Gappa's notation. It has no range limits: that none is reached is a
/// separate goal or a stated condition.
fn rounding(word: Word) -> String {
    let direction = match word.round {
        Rounding::Truncate => "dn",
        Rounding::Nearest => "nu",
        Rounding::NearestEven => "ne",
    };
    format!("fixed<{},{direction}>", -word.format.frac_bits)
}

/// The range of a word, as an interval.
fn range(word: Word) -> String {
    script::words(word.format.min(), word.format.max(), word.format.frac_bits)
}

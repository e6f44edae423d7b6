//! Waves: when each unit took its items, as the timing model has it, for wave viewers: VCD and FST.
//!
//! A cycle is a nanosecond. In each unit's scope `taken` is 1 in a cycle in which it takes an item (valid and ready), and `item` counts
//! them; where its items are the records of a stream, the record's words are there too, with binary points in their ranges: `[4:-11]` has
//! eleven fraction bits.

use super::record::Layout;
use super::transfers::Source;
use crate::error::{Error, Result};
use crate::output::files::write_beside;
use fst_writer::{FstFileType, FstInfo, FstScopeType, FstSignalType, FstVarDirection, FstVarType, open_fst};
use rtl_model::machine::timing::Organisation;
use rtl_model::pipeline::Elaborated;
use rtl_model::pipeline::ports::{self, Kind, Stream};
use rtl_model::timing::UnitCycles;
use std::path::Path;
use vcd::{IdCode, ReferenceIndex, TimescaleUnit, Value, VarType};

/// A wire of a unit.
struct Wire {
    unit: &'static str,
    name: String,
    width: u32,
    /// The first and the last bit's power of two, where it is a word.
    range: Option<[i32; 2]>,
}

/// Wires, and what becomes of them: cycle, wire, word.
#[derive(Default)]
pub struct Waves {
    wires: Vec<Wire>,
    changes: Vec<(u64, usize, i64)>,
    end: u64,
}

/// Bits of an item's number.
const ITEM_BITS: u32 = 32;

/// The stream whose records a unit's items are, if they are, in the same order.
fn stream_of<'a>(machine: &Elaborated, streams: &'a [Stream], unit: &str) -> Option<&'a Stream> {
    let t = &machine.timing.timing;
    // Splats always come in their order. Slots of one pixel come in that of a trace where the machine takes splat after splat.
    let splat_by_splat = t.organisation == Organisation::Immediate && t.raster.lanes == [1, 1];
    let is_known = ["project", "ellipse"].contains(&unit) || splat_by_splat && ["gauss", "fragment"].contains(&unit);
    streams.iter().find(|stream| is_known && stream.name == format!("{unit}.in"))
}

impl Waves {
    /// The waves of these units from cycle `first` to the one before `end`.
    pub fn new(machine: &Elaborated, kind: Kind, units: &[UnitCycles], sources: &[Source], [first, end]: [u64; 2]) -> Self {
        let streams = ports::streams(machine, kind);
        let mut waves = Waves { end, ..Waves::default() };
        for unit in units.iter().filter(|unit| unit.index == 0) {
            let stream = stream_of(machine, &streams, unit.name);
            let records = stream.and_then(|stream| {
                let source = sources.iter().find(|source| source.name == stream.name)?;
                (source.records == unit.log.len()).then_some((stream, source))
            });
            waves.unit(unit, records, [first, end]);
        }
        waves.changes.sort_unstable();
        waves
    }

    fn unit(&mut self, unit: &UnitCycles, records: Option<(&Stream, &Source)>, [first, end]: [u64; 2]) {
        let taken = self.wires.len();
        let wire = |name: &str, width, range| Wire { unit: unit.name, name: name.to_owned(), width, range };
        self.wires.extend([wire("taken", 1, None), wire("item", ITEM_BITS, None)]);
        let fields = records.map_or(&[][..], |(stream, _)| &stream.fields);
        self.wires.extend(fields.iter().map(|field| {
            let format = field.word.format;
            wire(&field.name, field.width(), Some([format.int_bits - 1, -format.frac_bits]))
        }));
        let layout = records.map(|(stream, _)| Layout::new(stream));
        let mut words = Vec::new();
        self.changes.push((first, taken, 0));
        let items = unit.log.partition_point(|cycle| *cycle < first)..unit.log.partition_point(|cycle| *cycle < end);
        for item in items {
            let now = unit.log[item];
            // Taken in the cycle before, too: it stays 1.
            self.changes.pop_if(|last| *last == (now, taken, 0));
            self.changes.push((now, taken, 1));
            self.changes.push((now, taken + 1, item as i64));
            if let (Some((_, source)), Some(layout)) = (records, &layout) {
                words.clear();
                (source.at)(item, &mut words);
                layout.mask(&mut words);
                self.changes.extend(words.iter().enumerate().map(|(field, word)| (now, taken + 2 + field, *word)));
            }
            self.changes.push((now + 1, taken, 0));
        }
    }

    /// Writes both files.
    ///
    /// # Errors
    /// [`Error::Job`] where one cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        write_beside(&folder.join("waves.vcd"), |file| self.vcd(file).map_err(|e| e.to_string()))?;
        let (part, path) = (folder.join("waves.fst.part"), folder.join("waves.fst"));
        let written = self.fst(&part).map_err(|e| e.to_string()).and_then(|()| std::fs::rename(&part, &path).map_err(|e| e.to_string()));
        written.map_err(|e| {
            // It may never have come to be; then there is nothing to remove.
            let _ = std::fs::remove_file(&part);
            Error::job(format!("{}: cannot be written: {e}", path.display()))
        })
    }

    /// Wires unit by unit, each with its place.
    fn scopes(&self) -> impl Iterator<Item = (&'static str, Vec<usize>)> {
        let mut scopes: Vec<(&'static str, Vec<usize>)> = Vec::new();
        for (place, wire) in self.wires.iter().enumerate() {
            match scopes.last_mut().filter(|(unit, _)| *unit == wire.unit) {
                Some((_, wires)) => wires.push(place),
                None => scopes.push((wire.unit, vec![place])),
            }
        }
        scopes.into_iter()
    }

    fn vcd(&self, file: &mut impl std::io::Write) -> std::io::Result<()> {
        let mut out = vcd::Writer::new(file);
        out.timescale(1, TimescaleUnit::NS)?;
        let mut ids: Vec<IdCode> = Vec::new();
        out.add_module("machine")?;
        for (unit, wires) in self.scopes() {
            out.add_module(unit)?;
            for wire in wires.into_iter().map(|place| &self.wires[place]) {
                let range = wire.range.map(|[first, last]| ReferenceIndex::Range(first, last));
                ids.push(out.add_var(VarType::Wire, wire.width, &wire.name, range)?);
            }
            out.upscope()?;
        }
        out.upscope()?;
        out.enddefinitions()?;
        let mut now = None;
        for &(cycle, wire, word) in &self.changes {
            if now.replace(cycle) != Some(cycle) {
                out.timestamp(cycle)?;
            }
            let width = self.wires[wire].width;
            let bits = (0..width).rev().map(|bit| if word >> bit & 1 == 1 { Value::V1 } else { Value::V0 });
            if width == 1 { out.change_scalar(ids[wire], Value::from(word == 1))? } else { out.change_vector(ids[wire], bits)? }
        }
        out.timestamp(self.end)
    }

    fn fst(&self, path: &Path) -> std::result::Result<(), fst_writer::FstWriteError> {
        let info = FstInfo {
            start_time: self.changes.first().map_or(0, |change| change.0),
            timescale_exponent: -9,
            version: format!("splatsim {}", env!("CARGO_PKG_VERSION")),
            // The same trace is the same bytes on any day.
            date: String::new(),
            file_type: FstFileType::Verilog,
        };
        let mut head = open_fst(path, &info)?;
        let mut ids = Vec::new();
        head.scope("machine", "", FstScopeType::Module)?;
        for (unit, wires) in self.scopes() {
            head.scope(unit, "", FstScopeType::Module)?;
            for wire in wires.into_iter().map(|place| &self.wires[place]) {
                let name = wire.range.map_or_else(|| wire.name.clone(), |[first, last]| format!("{} [{first}:{last}]", wire.name));
                ids.push(head.var(name, FstSignalType::bit_vec(wire.width), FstVarType::Wire, FstVarDirection::Implicit, None)?);
            }
            head.up_scope()?;
        }
        head.up_scope()?;
        let mut out = head.finish()?;
        let mut now = None;
        for &(cycle, wire, word) in &self.changes {
            if now.replace(cycle) != Some(cycle) {
                out.time_change(cycle)?;
            }
            let bits: Vec<u8> = (0..self.wires[wire].width).rev().map(|bit| b'0' + (word >> bit & 1) as u8).collect();
            out.signal_change(ids[wire], &bits)?;
        }
        out.time_change(self.end)?;
        out.finish().map(|_| ())
    }
}

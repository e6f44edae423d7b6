//! Waves: when each unit took its items, as the timing model has it, for wave viewers: VCD and FST.
//!
//! A cycle is a nanosecond. In each unit's scope `taken` is 1 in a cycle in which it takes an item
//! (valid and ready), and `item` counts them. The words of what it takes are there too, with binary
//! points in their ranges: `[4:-11]` has eleven fraction bits. A stamp has a scope for each of the
//! rasteriser's lanes, by columns, then rows; one of a single lane has its words in the unit's.
//! Words are unknown (x) where a lane has no pixel, and where the trace's window has no such
//! record.

mod items;

use super::record::Layout;
use super::transfers::Source;
use crate::error::{Error, Result};
use crate::output::files::{Unfinished, write_beside};
use fst_writer::{
    FstFileType, FstInfo, FstScopeType, FstSignalType, FstVarDirection, FstVarType, open_fst,
};
use items::{Shown, Walk, stream_of};
use rtl_model::pipeline::Elaborated;
use rtl_model::pipeline::ports::{self, Kind, Stream};
use rtl_model::timing::UnitCycles;
use rtl_model::work::Work;
use std::path::Path;
use vcd::{IdCode, ReferenceIndex, TimescaleUnit, Value, VarType};

/// A wire of a unit, or of one of its lanes.
struct Wire {
    unit: &'static str,
    lane: Option<u32>,
    name: String,
    width: u32,
    /// The first and the last bit's power of two, where it is a word.
    range: Option<[i32; 2]>,
}

/// The wires of a record, side by side.
struct Port<'a> {
    first: usize,
    wires: usize,
    source: &'a Source<'a>,
    layout: Layout,
}

/// What a wire, or a port's wires, become.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Change {
    Word(usize, i64),
    /// A port's record; none where it is unknown.
    Record(usize, Option<u32>),
}

/// Wires, and what becomes of them in which cycle.
#[derive(Default)]
pub struct Waves<'a> {
    wires: Vec<Wire>,
    ports: Vec<Port<'a>>,
    changes: Vec<(u64, Change)>,
    start: u64,
    end: u64,
}

/// Bits of an item's number.
const ITEM_BITS: u32 = 32;

/// A frame that was traced and timed.
pub struct Timed<'a> {
    pub machine: &'a Elaborated,
    pub kind: Kind,
    pub work: &'a Work,
    /// What the trace calls the frame's splats.
    pub splats: &'a [u32],
    pub units: &'a [UnitCycles],
    pub sources: &'a [Source<'a>],
}

impl<'a> Waves<'a> {
    /// The waves of a frame from cycle `first` to the one before `end`.
    pub fn new(timed: &Timed<'a>, [first, end]: [u64; 2]) -> Self {
        let Timed {
            machine,
            kind,
            work,
            splats,
            units,
            sources,
        } = *timed;
        let streams = ports::streams(machine, kind);
        let mut shown = Walk::new(machine, work, splats, units, sources, [first, end]).shown();
        let mut waves = Waves {
            start: first,
            end,
            ..Waves::default()
        };
        let [columns, rows] = machine.timing.timing.raster.lanes;
        for unit in units.iter().filter(|unit| unit.index == 0) {
            waves.taken(unit, [first, end]);
            let Some((name, is_stamp)) = stream_of(unit.name) else {
                continue;
            };
            let stream = streams.iter().find(|stream| stream.name == name);
            let source = sources.iter().find(|source| source.name == name);
            let (Some(stream), Some(source), Some(shown)) =
                (stream, source, shown.remove(unit.name))
            else {
                continue;
            };
            waves.words(
                unit.name,
                (stream, source),
                if is_stamp { columns * rows } else { 1 },
                shown,
            );
        }
        // Those of a cycle stay in their order.
        waves.changes.sort_by_key(|(cycle, _)| *cycle);
        waves
    }

    /// Whether no unit takes anything in these cycles.
    pub fn is_empty(&self) -> bool {
        !self
            .changes
            .iter()
            .any(|(_, change)| matches!(change, Change::Word(_, 1)))
    }

    /// When a unit takes items.
    fn taken(&mut self, unit: &UnitCycles, [first, end]: [u64; 2]) {
        let taken = self.wires.len();
        let wire = |name: &str, width| Wire {
            unit: unit.name,
            lane: None,
            name: name.to_owned(),
            width,
            range: None,
        };
        self.wires
            .extend([wire("taken", 1), wire("item", ITEM_BITS)]);
        self.changes.push((first, Change::Word(taken, 0)));
        let items = unit.log.partition_point(|cycle| *cycle < first)
            ..unit.log.partition_point(|cycle| *cycle < end);
        for item in items {
            let now = unit.log[item];
            // Taken in the cycle before, too: it stays 1.
            self.changes
                .pop_if(|last| *last == (now, Change::Word(taken, 0)));
            self.changes
                .push((now, Change::Word(taken + 1, item as i64)));
            self.changes.push((now, Change::Word(taken, 1)));
            self.changes.push((now + 1, Change::Word(taken, 0)));
        }
    }

    /// The words of what it takes, in so many lanes.
    fn words(
        &mut self,
        unit: &'static str,
        (stream, source): (&Stream, &'a Source<'a>),
        lanes: u32,
        shown: Vec<Shown>,
    ) {
        let port = self.ports.len();
        for lane in 0..lanes {
            let first = self.wires.len();
            self.wires.extend(stream.fields.iter().map(|field| {
                let format = field.word.format;
                let range = Some([format.int_bits - 1, -format.frac_bits]);
                Wire {
                    unit,
                    lane: (lanes > 1).then_some(lane),
                    name: field.name.clone(),
                    width: field.width(),
                    range,
                }
            }));
            self.ports.push(Port {
                first,
                wires: stream.fields.len(),
                source,
                layout: Layout::new(stream),
            });
        }
        self.changes.extend(
            shown
                .into_iter()
                .map(|(cycle, lane, record)| (cycle, Change::Record(port + lane as usize, record))),
        );
    }

    /// Every change of a wire: cycle, wire, word; none where the word is unknown.
    fn each<E>(
        &self,
        mut changed: impl FnMut(u64, usize, Option<i64>) -> std::result::Result<(), E>,
    ) -> std::result::Result<(), E> {
        let mut now: Vec<Option<i64>> = vec![None; self.wires.len()];
        let mut words = Vec::new();
        for (cycle, change) in &self.changes {
            let mut become_word = |wire: usize, word: Option<i64>| {
                let before = std::mem::replace(&mut now[wire], word);
                if before == word {
                    Ok(())
                } else {
                    changed(*cycle, wire, word)
                }
            };
            match *change {
                Change::Word(wire, word) => become_word(wire, Some(word))?,
                Change::Record(port, record) => {
                    let Port {
                        first,
                        wires,
                        source,
                        layout,
                    } = &self.ports[port];
                    words.clear();
                    if let Some(record) = record {
                        (source.at)(record as usize, &mut words);
                        layout.mask(&mut words);
                    }
                    for field in 0..*wires {
                        become_word(first + field, words.get(field).copied())?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Writes both files.
    ///
    /// # Errors
    /// [`Error::Job`] where one cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        write_beside(&folder.join("waves.vcd"), |file| {
            self.vcd(file).map_err(|e| e.to_string())
        })?;
        let path = folder.join("waves.fst");
        let part = Unfinished::beside(&path);
        let written = self
            .fst(part.path())
            .map_err(|e| e.to_string())
            .and_then(|()| part.finish(&path).map_err(|e| e.to_string()));
        written.map_err(|e| Error::job(format!("{}: cannot be written: {e}", path.display())))
    }

    /// Wires scope by scope, each with its place: a unit's own, then those of its lanes.
    fn scopes(&self) -> impl Iterator<Item = (&'static str, Option<u32>, Vec<usize>)> {
        let mut scopes: Vec<(&'static str, Option<u32>, Vec<usize>)> = Vec::new();
        for (place, wire) in self.wires.iter().enumerate() {
            match scopes
                .last_mut()
                .filter(|(unit, lane, _)| (*unit, *lane) == (wire.unit, wire.lane))
            {
                Some((_, _, wires)) => wires.push(place),
                None => scopes.push((wire.unit, wire.lane, vec![place])),
            }
        }
        scopes.into_iter()
    }

    fn vcd(&self, file: &mut impl std::io::Write) -> std::io::Result<()> {
        let mut out = vcd::Writer::new(file);
        out.timescale(1, TimescaleUnit::NS)?;
        let mut ids: Vec<IdCode> = Vec::new();
        out.add_module("machine")?;
        let mut open = "";
        for (unit, lane, wires) in self.scopes() {
            if unit != open {
                if !open.is_empty() {
                    out.upscope()?;
                }
                out.add_module(unit)?;
                open = unit;
            }
            if let Some(lane) = lane {
                out.add_module(&format!("lane{lane}"))?;
            }
            for wire in wires.into_iter().map(|place| &self.wires[place]) {
                let range = wire
                    .range
                    .map(|[first, last]| ReferenceIndex::Range(first, last));
                ids.push(out.add_var(VarType::Wire, wire.width, &wire.name, range)?);
            }
            if lane.is_some() {
                out.upscope()?;
            }
        }
        if !open.is_empty() {
            out.upscope()?;
        }
        out.upscope()?;
        out.enddefinitions()?;
        let mut now = None;
        self.each(|cycle, wire, word| {
            if now.replace(cycle) != Some(cycle) {
                out.timestamp(cycle)?;
            }
            let width = self.wires[wire].width;
            let value = |bit: u32| {
                word.map_or(Value::X, |word| {
                    if word >> bit & 1 == 1 {
                        Value::V1
                    } else {
                        Value::V0
                    }
                })
            };
            if width == 1 {
                out.change_scalar(ids[wire], value(0))
            } else {
                out.change_vector(ids[wire], (0..width).rev().map(value))
            }
        })?;
        out.timestamp(self.end)
    }

    fn fst(&self, path: &Path) -> std::result::Result<(), fst_writer::FstWriteError> {
        let info = FstInfo {
            start_time: self.start,
            timescale_exponent: -9,
            version: format!("splatsim {}", env!("CARGO_PKG_VERSION")),
            // The same trace is the same bytes on any day.
            date: String::new(),
            file_type: FstFileType::Verilog,
        };
        let mut head = open_fst(path, &info)?;
        let mut ids = Vec::new();
        head.scope("machine", "", FstScopeType::Module)?;
        let mut open = "";
        for (unit, lane, wires) in self.scopes() {
            if unit != open {
                if !open.is_empty() {
                    head.up_scope()?;
                }
                head.scope(unit, "", FstScopeType::Module)?;
                open = unit;
            }
            if let Some(lane) = lane {
                head.scope(format!("lane{lane}"), "", FstScopeType::Module)?;
            }
            for wire in wires.into_iter().map(|place| &self.wires[place]) {
                let name = wire.range.map_or_else(
                    || wire.name.clone(),
                    |[first, last]| format!("{} [{first}:{last}]", wire.name),
                );
                ids.push(head.var(
                    name,
                    FstSignalType::bit_vec(wire.width),
                    FstVarType::Wire,
                    FstVarDirection::Implicit,
                    None,
                )?);
            }
            if lane.is_some() {
                head.up_scope()?;
            }
        }
        if !open.is_empty() {
            head.up_scope()?;
        }
        head.up_scope()?;
        let mut out = head.finish()?;
        let mut now = None;
        self.each(|cycle, wire, word| {
            if now.replace(cycle) != Some(cycle) {
                out.time_change(cycle)?;
            }
            let bit = |bit: u32| word.map_or(b'x', |word| b'0' + (word >> bit & 1) as u8);
            let bits: Vec<u8> = (0..self.wires[wire].width).rev().map(bit).collect();
            out.signal_change(ids[wire], &bits)
        })?;
        out.time_change(self.end)?;
        out.finish().map(|_| ())
    }
}

//! Waves: writes the cycles in which each unit takes its items, from the timing model, as VCD and
//! FST.
//!
//! One cycle is 1 ns. In each unit's scope `taken` is 1 in a cycle in which the unit takes an item
//! (valid and ready), and `item` counts the items. The words of the item are there too, with binary
//! points in their ranges: `[4:-11]` has eleven fraction bits. A stamp has one scope per lane of
//! the rasteriser, by columns, then rows; with a single lane the words are in the unit's scope.
//! Words are unknown (x) if a lane has no pixel, or if the record is outside the trace's window.

mod items;

use super::record::RecordLayout;
use super::transfers::RecordSource;
use crate::error::{Error, Result};
use crate::output::files::{Unfinished, write_beside};
use fst_writer::{
    FstFileType, FstInfo, FstScopeType, FstSignalType, FstVarDirection, FstVarType, open_fst,
};
use items::{FrameWalk, Shown, stream_of};
use rtl_model::pipeline::Elaborated;
use rtl_model::pipeline::ports::{self, Kind, Stream};
use rtl_model::timing::UnitCycles;
use rtl_model::work::Work;
use std::path::Path;
use vcd::{IdCode, ReferenceIndex, TimescaleUnit, Value, VarType};

/// A wire of a unit, or of one of its lanes.
struct WaveWire {
    unit: &'static str,
    lane: Option<u32>,
    name: String,
    width: u32,
    /// For a word: powers of two of the MSB and the LSB.
    range: Option<[i32; 2]>,
}

/// The wires of a record.
struct RecordWires<'a> {
    first: usize,
    wires: usize,
    source: &'a RecordSource<'a>,
    layout: RecordLayout,
}

/// New value of a wire, or of all wires of a record.
#[derive(Clone, Copy, PartialEq, Eq)]
enum WireChange {
    Word(usize, i64),
    /// A record; None if it is unknown.
    Record(usize, Option<u32>),
}

/// Wires and their changes by cycle.
#[derive(Default)]
pub struct Waves<'a> {
    wires: Vec<WaveWire>,
    ports: Vec<RecordWires<'a>>,
    changes: Vec<(u64, WireChange)>,
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
    /// Indices of the frame's splats in the trace.
    pub splats: &'a [u32],
    pub units: &'a [UnitCycles],
    pub sources: &'a [RecordSource<'a>],
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
        let mut shown = FrameWalk::new(machine, work, splats, units, sources, [first, end]).shown();
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
        // A stable sort: changes in one cycle keep their order.
        waves.changes.sort_by_key(|(cycle, _)| *cycle);
        waves
    }

    /// Whether no unit takes an item in these cycles.
    pub fn is_empty(&self) -> bool {
        !self
            .changes
            .iter()
            .any(|(_, change)| matches!(change, WireChange::Word(_, 1)))
    }

    /// Adds the cycles in which a unit takes items.
    fn taken(&mut self, unit: &UnitCycles, [first, end]: [u64; 2]) {
        let taken = self.wires.len();
        let wire = |name: &str, width| WaveWire {
            unit: unit.name,
            lane: None,
            name: name.to_owned(),
            width,
            range: None,
        };
        self.wires
            .extend([wire("taken", 1), wire("item", ITEM_BITS)]);
        self.changes.push((first, WireChange::Word(taken, 0)));
        let items = unit.log.partition_point(|cycle| *cycle < first)
            ..unit.log.partition_point(|cycle| *cycle < end);
        for item in items {
            let now = unit.log[item];
            // Also taken in the previous cycle: it stays 1.
            self.changes
                .pop_if(|last| *last == (now, WireChange::Word(taken, 0)));
            self.changes
                .push((now, WireChange::Word(taken + 1, item as i64)));
            self.changes.push((now, WireChange::Word(taken, 1)));
            self.changes.push((now + 1, WireChange::Word(taken, 0)));
        }
    }

    /// Adds the words of a unit's items, in N lanes.
    fn words(
        &mut self,
        unit: &'static str,
        (stream, source): (&Stream, &'a RecordSource<'a>),
        lanes: u32,
        shown: Vec<Shown>,
    ) {
        let port = self.ports.len();
        for lane in 0..lanes {
            let first = self.wires.len();
            self.wires.extend(stream.fields.iter().map(|field| {
                let format = field.word.format;
                // The bits of a stored floating-point word have no places.
                let range =
                    (!format.is_float()).then_some([format.int_bits - 1, -format.frac_bits]);
                WaveWire {
                    unit,
                    lane: (lanes > 1).then_some(lane),
                    name: field.name.clone(),
                    width: field.width(),
                    range,
                }
            }));
            self.ports.push(RecordWires {
                first,
                wires: stream.fields.len(),
                source,
                layout: RecordLayout::new(stream),
            });
        }
        self.changes
            .extend(shown.into_iter().map(|(cycle, lane, record)| {
                (cycle, WireChange::Record(port + lane as usize, record))
            }));
    }

    /// Visits every change of a wire: cycle, wire, word; None if the word is unknown.
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
                WireChange::Word(wire, word) => become_word(wire, Some(word))?,
                WireChange::Record(port, record) => {
                    let RecordWires {
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
    /// [`Error::Job`] if one cannot be written.
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

    /// Wires scope by scope, each with its index: a unit's own, then those of its lanes.
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
            // No date: the same trace always gives the same bytes.
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

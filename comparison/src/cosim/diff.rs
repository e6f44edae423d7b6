//! Diff: compares records of a device with a trace, and names the first difference.
//!
//! ```text
//! trace ─► expected records ─┐
//!                            ├─►( order )─►( align )─► missing, surplus, moved, different ─► the first one, with the records it was made from
//! device ─► lines, checked ──┘
//! ```
//! Records that have a tag or a pixel are paired by it, others by an edit script (`align`). If the
//! order of pixels does not matter, or the device works tile by tile, the expected records are
//! first sorted into the device's order (`order`).
//!
//! Laws: `a_flipped_bit_is_named`, `a_lost_doubled_or_swapped_record_is_named`,
//! `a_fault_at_a_pixel_is_named`, `runs_of_missing_and_surplus_records_are_counted_separately`,
//! `a_file_in_the_order_of_tiles_is_equal_and_a_fault_in_it_is_named`,
//! `what_must_be_zero_counts_where_it_is_asked_for` (tests/diff.rs).

mod align;
mod lines;
mod order;
mod replay;

pub use order::RequiredOrder;

use crate::cosim::trace::{Key, RecordLayout, flag};
use crate::cosim::words;
use crate::error::{Error, Result};
use crate::input;
use crate::output::text::hex;
use align::{Mismatch, Name};
use lines::RecordLines;
use order::{Ordered, Permutation};
use rtl_model::num::Format;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Name and number format of a field.
#[derive(Clone, Debug)]
struct TraceField {
    name: String,
    format: Format,
    /// It is a word, and not an index or a count.
    is_word: bool,
}

/// A stream of a trace.
#[derive(Clone, Debug)]
struct TraceStream {
    name: String,
    unit: String,
    file: String,
    key_file: String,
    sha256: String,
    parent: Option<String>,
    per_pixel: bool,
    fields: Vec<TraceField>,
    layout: RecordLayout,
}

/// Fields that are unused in a record, and 0 in the trace: what a device may have there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Zeros {
    /// Any value.
    Ignored,
    /// 0.
    Compared,
}

/// How a device's records are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DiffOptions {
    /// Contents of unused fields.
    pub zeros: Zeros,
    /// Order of records.
    pub order: RequiredOrder,
}

impl Default for DiffOptions {
    fn default() -> Self {
        DiffOptions {
            zeros: Zeros::Ignored,
            order: RequiredOrder::Auto,
        }
    }
}

/// Result of a comparison.
#[derive(Clone, Debug)]
pub struct DiffOutcome {
    /// Report as text.
    pub text: String,
    /// Report as JSON.
    pub json: Value,
    /// No difference was found.
    pub equal: bool,
    /// The first difference, in a sentence.
    pub sentence: String,
}

/// A trace's folder.
struct TraceFolder {
    folder: PathBuf,
    manifest: Value,
}

/// Records, one per line.
type Records = Vec<Vec<i64>>;

impl TraceFolder {
    fn open(folder: &Path) -> Result<TraceFolder> {
        let path = folder.join("manifest.json");
        let input_error = |what: String| Error::input(format!("{}: {what}", path.display()));
        let text = input::read_text(&path).map_err(|e| {
            input_error(format!(
                "cannot be read: {e}; a folder that `trace` wrote is needed"
            ))
        })?;
        let manifest: Value = serde_json::from_str(&text)
            .map_err(|e| input_error(format!("is not a manifest: {e}")))?;
        if manifest["format"] != "splatsim-trace-1" {
            return Err(input_error(format!(
                "its format is {}, and splatsim-trace-1 is needed",
                manifest["format"]
            )));
        }
        Ok(TraceFolder {
            folder: folder.to_owned(),
            manifest,
        })
    }

    fn stream(&self, name: &str) -> Result<TraceStream> {
        let all = self.manifest["streams"]
            .as_array()
            .map(Vec::as_slice)
            .unwrap_or_default();
        let found = all.iter().find(|stream| stream["name"] == name);
        let found = found.ok_or_else(|| {
            let names: Vec<&str> = all
                .iter()
                .filter_map(|stream| stream["name"].as_str())
                .collect();
            Error::input(format!(
                "{name}: no such stream in {}; there are {}",
                self.folder.display(),
                names.join(", ")
            ))
        })?;
        self.described(found).ok_or_else(|| {
            Error::input(format!(
                "{}: the description of the stream {name} is incomplete",
                self.folder.join("manifest.json").display()
            ))
        })
    }

    /// Whether the records are stimulus, and not of a scene.
    fn is_stimulus(&self) -> bool {
        !self.manifest["window"]["stimulus"].is_null()
    }

    fn described(&self, stream: &Value) -> Option<TraceStream> {
        let text = |value: &Value| value.as_str().map(str::to_owned);
        let fields = stream["fields"].as_array()?;
        let (mut described, mut unless) = (Vec::new(), Vec::new());
        for field in fields {
            let format = format_of(field)?;
            described.push(TraceField {
                name: text(&field["name"])?,
                format,
                is_word: format.frac_bits != 0 || !field["signal"].is_null(),
            });
            let flags = field["zero_where"]
                .as_array()
                .map(Vec::as_slice)
                .unwrap_or_default();
            let place = |flag: &Value| fields.iter().position(|field| field["name"] == *flag);
            unless.push(flags.iter().map(place).collect::<Option<Vec<_>>>()?);
        }
        let formats = described.iter().map(|field| field.format).collect();
        Some(TraceStream {
            name: text(&stream["name"])?,
            unit: text(&stream["unit"])?,
            file: text(&stream["file"])?,
            key_file: text(&stream["keys"]["file"])?,
            sha256: text(&stream["sha256"])?,
            parent: text(&stream["parent"]),
            per_pixel: stream["order"] == "per-pixel",
            fields: described,
            layout: RecordLayout::of(formats, unless),
        })
    }

    /// The trace's records. Fails if the file was changed.
    fn expected(&self, stream: &TraceStream) -> Result<Records> {
        let path = self.folder.join(&stream.file);
        let text = lines::read(&path)?;
        if hex(&Sha256::digest(&text)) != stream.sha256 {
            return Err(Error::input(format!(
                "{}: is not what `trace` wrote there: its digest is another",
                path.display()
            )));
        }
        Ok(lines::records(&path, &text, &stream.layout, Zeros::Compared)?.records)
    }

    fn keys(&self, stream: &TraceStream) -> Result<Records> {
        let path = self.folder.join(&stream.key_file);
        let layout = RecordLayout::of_naturals(&Key::PARTS.map(|(_, bits)| bits));
        Ok(lines::records(&path, &lines::read(&path)?, &layout, Zeros::Compared)?.records)
    }
}

/// The format of a field of a stream.
fn format_of(field: &Value) -> Option<Format> {
    let number = |name: &str, range: [i64; 2]| {
        let number = field[name].as_i64()?;
        (range[0]..=range[1])
            .contains(&number)
            .then_some(number as i32)
    };
    let width = number("width", [1, 63])?;
    let frac_bits = number("frac_bits", [-64, 64])?;
    let signed = field["signed"].as_bool()?;
    if field["significant_bits"].is_null() {
        return Some(Format {
            signed,
            ..Format::unsigned(width - frac_bits, frac_bits)
        });
    }
    let sign = if signed { 'I' } else { 'U' };
    let [int_bits, significant_bits] = [
        number("int_bits", [-64, 64])?,
        number("significant_bits", [1, 64])?,
    ];
    let flushes = if field["flushes_subnormals"] == true {
        "N"
    } else {
        ""
    };
    let format: Format = format!("{sign}{int_bits}F{frac_bits}S{significant_bits}{flushes}")
        .parse()
        .ok()?;
    (format.stored_bits() == width).then_some(format)
}

impl TraceStream {
    /// Indices of the fields that identify a record: tag, x, y; None for one that the stream lacks.
    fn naming(&self) -> [Option<usize>; 3] {
        ["tag", "x", "y"].map(|name| self.fields.iter().position(|field| field.name == name))
    }

    /// Identifier of each record; None if the stream has no identifying field.
    fn names(&self, records: &[Vec<i64>]) -> Option<Vec<Name>> {
        let naming = self.naming();
        let name = |record: &Vec<i64>| naming.map(|place| place.map_or(0, |place| record[place]));
        naming
            .iter()
            .any(Option::is_some)
            .then(|| records.iter().map(name).collect())
    }
}

/// Compares files of a device with streams of a trace. If several streams differ, the earliest one
/// in the pipeline is reported.
///
/// # Errors
/// [`Error::Input`] if the folder is not a trace, lacks the stream or was changed, or if a device's
/// file is malformed.
pub fn diff(folder: &Path, outputs: &[(String, PathBuf)], how: DiffOptions) -> Result<DiffOutcome> {
    let trace = TraceFolder::open(folder)?;
    let mut streams: Vec<(TraceStream, &Path)> = outputs
        .iter()
        .map(|(name, file)| Ok((trace.stream(name)?, file.as_path())))
        .collect::<Result<_>>()?;
    let all = trace.manifest["streams"]
        .as_array()
        .map(Vec::as_slice)
        .unwrap_or_default();
    streams.sort_by_key(|(stream, _)| {
        all.iter()
            .position(|other| other["name"] == stream.name.as_str())
    });
    let mut equal = Vec::new();
    let mut rastered: Option<Permutation> = None;
    for (stream, file) in &streams {
        let expected = trace.expected(stream)?;
        let got = lines::records(file, &lines::read(file)?, &stream.layout, how.zeros)?;
        let sides = Sides {
            trace: &trace,
            stream,
            expected: &expected,
            got: &got,
        };
        let ordered = sides.ordered(how.order, rastered.as_ref())?;
        if let Some(first) = ordered.found.first() {
            return sides.outcome(first, &ordered);
        }
        equal.push(json!({"stream": stream.name, "records": expected.len(), "order": ordered.order.name(), "note": ordered.order.note()}));
        if stream.name == "raster.out" {
            rastered = ordered.permutation;
        }
    }
    let line = |stream: &Value| {
        let note = stream["note"]
            .as_str()
            .map_or(String::new(), |note| format!("; {note}"));
        format!(
            "{}: {} records equal{note}",
            stream["stream"].as_str().unwrap_or_default(),
            stream["records"]
        )
    };
    let text = equal.iter().map(line).collect::<Vec<_>>().join("\n");
    Ok(DiffOutcome {
        sentence: text.clone(),
        text,
        json: json!({"equal": true, "streams": equal}),
        equal: true,
    })
}

/// The first field that differs.
fn other_field(expected: &[i64], got: &[i64]) -> Option<usize> {
    expected
        .iter()
        .zip(got)
        .position(|(expected, got)| expected != got)
}

/// Expected records of a stream, and the device's.
struct Sides<'a> {
    trace: &'a TraceFolder,
    stream: &'a TraceStream,
    expected: &'a [Vec<i64>],
    got: &'a RecordLines,
}

/// A part of a key, if it is a natural number.
fn part(key: &[i64], place: usize) -> Option<i64> {
    let (_, bits) = Key::PARTS[place];
    key.get(place)
        .copied()
        .filter(|&part| part != (1 << bits) - 1)
}

/// Indices of the parts of a key.
const SPLAT: usize = 0;
const X: usize = 1;
const Y: usize = 2;
const SLOT: usize = 3;
const PARENT: usize = 4;
const FLAGS: usize = 5;

impl Sides<'_> {
    fn outcome(&self, first: &Mismatch, ordered: &Ordered) -> Result<DiffOutcome> {
        let keys = self.trace.keys(self.stream)?;
        let record = first.record();
        // A surplus record has no key: the key of the expected record that follows it shows the
        // place.
        let key = keys
            .get(record.min(keys.len().saturating_sub(1)))
            .cloned()
            .unwrap_or_default();
        let (kind, line) = match *first {
            Mismatch::Different { line, .. } => ("field", Some(line)),
            Mismatch::Missing { .. } => ("missing", None),
            Mismatch::Surplus { line, .. } => ("surplus", Some(line)),
            Mismatch::Moved {
                line,
                swapped: true,
                ..
            } => ("swapped", Some(line)),
            Mismatch::Moved { line, .. } => ("moved", Some(line)),
        };
        let got = line.map(|line| &self.got.records[line]);
        let flags: Vec<&str> = {
            let bits = key.get(FLAGS).copied().unwrap_or(0);
            flag::NAMES
                .iter()
                .enumerate()
                .filter(|(bit, _)| bits >> bit & 1 == 1)
                .map(|(_, name)| *name)
                .collect()
        };
        let counts = Counts::of(&ordered.found);
        let run = ordered.run();
        let mut mismatch = json!({
            "equal": false, "stream": self.stream.name, "unit": self.stream.unit, "kind": kind, "sequence": record, "run": run,
            "line": line.map(|line| self.got.numbers[line]), "expected_records": self.expected.len(), "records": self.got.records.len(),
            "mismatches": ordered.found.len(), "counts": counts.json(), "order": ordered.order.name(), "note": ordered.order.note(),
            "flags": flags,
        });
        for (place, name) in [(SPLAT, "splat"), (X, "x"), (Y, "y"), (SLOT, "slot")] {
            if let Some(part) = part(&key, place) {
                mismatch[name] = part.into();
            }
        }
        let mut field_name = None;
        if let (Mismatch::Different { .. }, Some(got)) = (first, got)
            && let Some(field) = other_field(&self.expected[record], got)
        {
            field_name = Some(self.stream.fields[field].name.as_str());
            mismatch["field"] = self.field(field, self.expected[record][field], got[field]);
        }
        mismatch["expected"] = self
            .expected
            .get(record)
            .map_or(Value::Null, |words| self.words(self.stream, words));
        mismatch["got"] = got.map_or(Value::Null, |words| self.words(self.stream, words));
        mismatch["inputs"] = self.inputs(&key)?;
        mismatch["stimulus"] = self.stimulus(record, &key).map_or(Value::Null, Value::from);
        let (intermediate, why_none) = match words::of_record(
            &self.trace.folder,
            &self.trace.manifest,
            self.replayed(record, &key)?,
        ) {
            Ok(words) => (words, None),
            Err(why) => (Vec::new(), Some(why)),
        };
        mismatch["intermediate"] = intermediate.iter().map(words::Word::json).collect();
        mismatch["intermediate_absent"] = why_none.into();
        mismatch["replay"] = replay::command(
            &self.trace.folder,
            &self.trace.manifest,
            &self.stream.unit,
            &key,
        )
        .into();
        let sentence = self.sentence(first, run, field_name, &counts);
        Ok(DiffOutcome {
            text: self.text(&mismatch, &sentence, &intermediate),
            json: mismatch,
            equal: false,
            sentence,
        })
    }

    fn sentence(
        &self,
        first: &Mismatch,
        run: usize,
        field: Option<&str>,
        counts: &Counts,
    ) -> String {
        let name = &self.stream.name;
        let line_of = |line: usize| self.got.numbers[line];
        let what = match *first {
            Mismatch::Different { record, .. } => format!(
                "record {record}, field {}, is different",
                field.unwrap_or_default()
            ),
            Mismatch::Missing { record } if run > 1 => {
                format!("records {record} to {} are missing", record + run - 1)
            }
            Mismatch::Missing { record } => format!("record {record} is missing"),
            Mismatch::Surplus { line, before } => {
                let place = if before < self.expected.len() {
                    format!("before record {before}")
                } else {
                    "behind the last record".into()
                };
                match run {
                    1 => format!("line {} is surplus, {place}", line_of(line)),
                    _ => format!(
                        "lines {} to {} are surplus, {place}",
                        line_of(line),
                        line_of(line + run - 1)
                    ),
                }
            }
            Mismatch::Moved {
                record,
                swapped: true,
                ..
            } => format!("records {record} and {} are swapped", record + 1),
            Mismatch::Moved { record, line, .. } => format!(
                "record {record} is at another place, line {}",
                line_of(line)
            ),
        };
        let more = if counts.all() == run {
            "nothing else is different".to_owned()
        } else {
            format!("in all {counts}")
        };
        format!("{name}: {what}; {more}")
    }

    /// Name of the stimulus class of a record, as in the manifest.
    fn stimulus(&self, record: usize, key: &[i64]) -> Option<String> {
        let tags = self.trace.manifest["tags"].as_array()?;
        let is_in = |stream: &str, record: i64| {
            tags.iter().find(|tag| {
                let first = tag["first"].as_i64().unwrap_or(i64::MAX);
                tag["stream"] == stream
                    && first <= record
                    && record - first < tag["records"].as_i64().unwrap_or(0)
            })
        };
        let (mut stream, mut record, mut key) = (self.stream.clone(), record as i64, key.to_vec());
        // An output record has the class of the input record that it was made from.
        for _ in 0..tags.len() + 8 {
            if let Some(tag) = is_in(&stream.name, record) {
                return Some(format!(
                    "{}, record {record} of {}",
                    tag["tag"].as_str()?,
                    stream.name
                ));
            }
            record = part(&key, PARENT)?;
            stream = self.trace.stream(stream.parent.as_deref()?).ok()?;
            key = self.trace.keys(&stream).ok()?.get(record as usize)?.clone();
        }
        None
    }

    /// The input records that make the unit produce this record again.
    fn replayed(&self, record: usize, key: &[i64]) -> Result<words::ReplayInputs> {
        let unit = self.stream.unit.clone();
        let (Some(parent), Some(number)) = (&self.stream.parent, part(key, PARENT)) else {
            return Ok(words::ReplayInputs::nothing(unit));
        };
        let Some(expected) = self.expected.get(record) else {
            return Ok(words::ReplayInputs::nothing(unit));
        };
        if *parent != format!("{unit}.in") || self.stream.name != format!("{unit}.out") {
            return Ok(words::ReplayInputs::nothing(unit));
        }
        let Ok(input) = self.trace.stream(parent) else {
            return Ok(words::ReplayInputs::nothing(unit));
        };
        let (records, keys) = (self.trace.expected(&input)?, self.trace.keys(&input)?);
        let number = number as usize;
        let of_pixel = |key: &Vec<i64>| part(key, X).zip(part(key, Y));
        let Some(own) = keys.get(number) else {
            return Ok(words::ReplayInputs::nothing(unit));
        };
        let inputs: Vec<usize> = match unit.as_str() {
            "fragment" => (0..=number)
                .filter(|&other| of_pixel(&keys[other]) == of_pixel(own))
                .collect(),
            "resolve" => {
                let last = input.fields.iter().position(|field| field.name == "last");
                let ends = |record: &usize| last.is_none_or(|last| records[*record][last] == 1);
                let end = (number..records.len()).find(ends).unwrap_or(number);
                (number..=end).collect()
            }
            _ => vec![number],
        };
        let answers = if unit == "fragment" {
            self.answers(&inputs)?
        } else {
            Vec::new()
        };
        let begins_empty = unit != "fragment"
            || self.trace.manifest["window"]["splats"][0] == 0
            || self.trace.is_stimulus();
        Ok(words::ReplayInputs {
            unit,
            inputs: inputs
                .into_iter()
                .map(|record| records[record].clone())
                .collect(),
            answers,
            made: expected.clone(),
            begins_empty,
        })
    }

    /// Answers of shade to the requests of these records of `fragment.in`.
    fn answers(&self, inputs: &[usize]) -> Result<Vec<Vec<i64>>> {
        let (Ok(requests), Ok(answers)) = (
            self.trace.stream("fragment.request"),
            self.trace.stream("fragment.answer"),
        ) else {
            return Ok(Vec::new());
        };
        let (request_keys, keys) = (self.trace.keys(&requests)?, self.trace.keys(&answers)?);
        let made_from = |key: &Vec<i64>| {
            part(key, PARENT).and_then(|request| part(request_keys.get(request as usize)?, PARENT))
        };
        let records = self.trace.expected(&answers)?.into_iter().zip(&keys);
        Ok(records
            .filter(|(_, key)| made_from(key).is_some_and(|from| inputs.contains(&(from as usize))))
            .map(|(words, _)| words)
            .collect())
    }

    fn field(&self, field: usize, expected: i64, got: i64) -> Value {
        let TraceField {
            name,
            format,
            is_word,
        } = &self.stream.fields[field];
        json!({
            "name": name, "expected_hex": words::hex(*format, expected), "got_hex": words::hex(*format, got),
            "expected": words::value(*format, expected), "got": words::value(*format, got),
            "difference_ulp": is_word.then_some(got - expected),
        })
    }

    fn words(&self, stream: &TraceStream, words: &[i64]) -> Value {
        let word = |(field, &word): (&TraceField, &i64)| {
            (
                field.name.clone(),
                json!({"hex": words::hex(field.format, word), "value": words::value(field.format, word)}),
            )
        };
        Value::Object(stream.fields.iter().zip(words).map(word).collect())
    }

    /// The records that this one was made from, back to the start of the trace, the nearest first.
    /// For several layers: all of them, then the records that the first was made from.
    fn inputs(&self, key: &[i64]) -> Result<Value> {
        let mut inputs = Vec::new();
        let (mut parent, mut number) = (self.stream.parent.clone(), part(key, 4));
        while let (Some(name), Some(record)) = (parent, number) {
            let Ok(stream) = self.trace.stream(&name) else {
                break;
            };
            let (records, keys) = (self.trace.expected(&stream)?, self.trace.keys(&stream)?);
            let (Some(from), Some(key)) =
                (records.get(record as usize..), keys.get(record as usize))
            else {
                break;
            };
            let last = stream.fields.iter().position(|field| field.name == "last");
            let is_last = |words: &Vec<i64>| last.is_none_or(|last| words[last] == 1);
            let count = from
                .iter()
                .position(is_last)
                .map_or(from.len(), |last| last + 1);
            inputs.extend(
                (record..)
                    .zip(&from[..count])
                    .map(|(record, words)| json!({"stream": stream.name, "sequence": record, "fields": self.words(&stream, words)})),
            );
            (parent, number) = (stream.parent.clone(), part(key, PARENT));
        }
        Ok(inputs.into())
    }

    fn text(&self, mismatch: &Value, sentence: &str, intermediate: &[words::Word]) -> String {
        let mut text = format!("{sentence}\n\n");
        let mut line = |name: &str, value: String| {
            let _ = writeln!(text, "  {name:<10} {value}");
        };
        let number = |name: &str| mismatch[name].as_i64();
        if let Some(splat) = number("splat") {
            line("splat", splat.to_string());
        }
        if let (Some(x), Some(y)) = (number("x"), number("y")) {
            line("pixel", format!("{x},{y}"));
        }
        if let Some(slot) = number("slot") {
            line("slot", slot.to_string());
        }
        if let Some(at) = number("line") {
            line("line", at.to_string());
        }
        line(
            "records",
            format!(
                "{} expected, {} found",
                self.expected.len(),
                self.got.records.len()
            ),
        );
        if let Some(note) = mismatch["note"].as_str() {
            line("order", note.to_owned());
        }
        if let Some(class) = mismatch["stimulus"].as_str() {
            line("stimulus", class.to_owned());
        }
        let field = &mismatch["field"];
        if !field.is_null() {
            let side = |name: &str| {
                format!(
                    "{} = {}",
                    field[format!("{name}_hex")].as_str().unwrap_or_default(),
                    field[name]
                )
            };
            line(
                "field",
                field["name"].as_str().unwrap_or_default().to_owned(),
            );
            line("expected", side("expected"));
            line("got", side("got"));
            if !field["difference_ulp"].is_null() {
                line("difference", format!("{} ulp", field["difference_ulp"]));
            }
        }
        let flags: Vec<&str> = mismatch["flags"]
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(Value::as_str)
            .collect();
        if !flags.is_empty() {
            line("words", flags.join(", "));
        }
        let fields = |record: &Value| {
            let each = |(name, word): (&String, &Value)| {
                format!(
                    "{name} {} = {}",
                    word["hex"].as_str().unwrap_or_default(),
                    word["value"]
                )
            };
            record
                .as_object()
                .into_iter()
                .flatten()
                .map(each)
                .collect::<Vec<_>>()
        };
        let mut block = |title: String, record: &Value| {
            if !record.is_null() {
                let _ = write!(text, "\n  {title}\n    {}\n", fields(record).join("\n    "));
            }
        };
        block(
            format!(
                "expected, {} record {}",
                self.stream.name, mismatch["sequence"]
            ),
            &mismatch["expected"],
        );
        block("got".into(), &mismatch["got"]);
        let inputs = mismatch["inputs"].as_array().into_iter().flatten();
        for input in inputs.take_while(|input| input["stream"] == mismatch["inputs"][0]["stream"]) {
            block(
                format!(
                    "made from, {} record {}",
                    input["stream"].as_str().unwrap_or_default(),
                    input["sequence"]
                ),
                &input["fields"],
            );
        }
        if !intermediate.is_empty() {
            let of = self.stream.parent.as_deref().unwrap_or_default();
            let lines: Vec<String> = intermediate.iter().map(words::Word::to_string).collect();
            let _ = write!(
                text,
                "\n  words of {} that the machine makes of {of}\n    {}\n",
                self.stream.unit,
                lines.join("\n    ")
            );
        }
        let _ = write!(
            text,
            "\n  replay     {}",
            mismatch["replay"].as_str().unwrap_or_default()
        );
        text
    }
}

/// Number of records of each kind of mismatch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Counts {
    missing: usize,
    surplus: usize,
    moved: usize,
    different: usize,
}

impl Counts {
    fn of(found: &[Mismatch]) -> Self {
        let mut counts = Counts::default();
        for mismatch in found {
            *match mismatch {
                Mismatch::Different { .. } => &mut counts.different,
                Mismatch::Missing { .. } => &mut counts.missing,
                Mismatch::Surplus { .. } => &mut counts.surplus,
                Mismatch::Moved { .. } => &mut counts.moved,
            } += 1;
        }
        counts
    }

    fn all(&self) -> usize {
        self.missing + self.surplus + self.moved + self.different
    }

    fn json(&self) -> Value {
        json!({"missing": self.missing, "surplus": self.surplus, "moved": self.moved, "different": self.different})
    }
}

impl std::fmt::Display for Counts {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let all = [
            (self.missing, "missing"),
            (self.surplus, "surplus"),
            (self.moved, "moved"),
            (self.different, "different"),
        ];
        let counted: Vec<String> = all
            .iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, what)| format!("{count} {what}"))
            .collect();
        f.write_str(&counted.join(", "))
    }
}

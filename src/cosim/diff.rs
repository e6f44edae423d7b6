//! Diff: compares what a device gave with a trace, and names the first thing that is different.
//!
//! ```text
//! trace ─► expected records ─┐
//!                            ├─► pairs by the stream's order ─► first mismatch, field by field, with what led to it; how many more
//! device ─► lines, checked ──┘
//! ```
//! A stream whose order counts is compared record by record, and brought into step again behind a record that is missing, surplus or
//! swapped with its neighbour; one whose order counts at each pixel only, pixel by pixel.
//!
//! Laws: `a_flipped_bit_is_named`, `a_lost_doubled_or_swapped_record_is_named`, `a_fault_at_a_pixel_is_named`,
//! `what_must_be_zero_counts_where_it_is_asked_for` (tests/diff.rs).

use crate::cosim::trace::{Key, Layout, Malformed, flag};
use crate::error::{Error, Result};
use crate::input;
use crate::output::text::hex;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// What a field is called and what its words stand for.
#[derive(Clone, Debug)]
struct Field {
    name: String,
    width: u32,
    frac_bits: i32,
}

/// A stream of a trace.
#[derive(Clone, Debug)]
struct Stream {
    name: String,
    unit: String,
    file: String,
    key_file: String,
    sha256: String,
    parent: Option<String>,
    per_pixel: bool,
    fields: Vec<Field>,
    layout: Layout,
}

/// Fields that mean nothing in a record, and are 0 in the trace: what a device has there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Zeros {
    /// Anything will do.
    Ignored,
    /// It must be 0 too.
    Compared,
}

/// What is different.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Mismatch {
    /// An expected record has another content: the first field that does, and its word.
    Field { record: usize, line: usize, field: usize, expected: i64, got: i64 },
    /// An expected record is not there.
    Missing { record: usize },
    /// A line that no expected record is left for, behind so many of them.
    Surplus { line: usize, before: usize },
    /// Two expected records stand in the other order.
    Swapped { record: usize, line: usize },
}

impl Mismatch {
    /// Where in the trace it is.
    fn record(&self) -> usize {
        match self {
            Mismatch::Field { record, .. } | Mismatch::Missing { record } | Mismatch::Swapped { record, .. } => *record,
            Mismatch::Surplus { before, .. } => *before,
        }
    }
}

/// A comparison.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Text for people.
    pub text: String,
    /// The same for programs.
    pub json: Value,
    /// Nothing is different.
    pub equal: bool,
    /// Finding, in a sentence.
    pub sentence: String,
}

/// A trace's folder.
struct Trace {
    folder: PathBuf,
    manifest: Value,
}

/// Records, a line each.
type Records = Vec<Vec<i64>>;

impl Trace {
    fn open(folder: &Path) -> Result<Trace> {
        let path = folder.join("manifest.json");
        let input_error = |what: String| Error::input(format!("{}: {what}", path.display()));
        let text =
            input::read_text(&path).map_err(|e| input_error(format!("cannot be read: {e}; a folder that `trace` wrote is needed")))?;
        let manifest: Value = serde_json::from_str(&text).map_err(|e| input_error(format!("is no manifest: {e}")))?;
        if manifest["format"] != "splatsim-trace-1" {
            return Err(input_error(format!("its format is {}, and splatsim-trace-1 is needed", manifest["format"])));
        }
        Ok(Trace { folder: folder.to_owned(), manifest })
    }

    fn stream(&self, name: &str) -> Result<Stream> {
        let all = self.manifest["streams"].as_array().map(Vec::as_slice).unwrap_or_default();
        let found = all.iter().find(|stream| stream["name"] == name);
        let found = found.ok_or_else(|| {
            let names: Vec<&str> = all.iter().filter_map(|stream| stream["name"].as_str()).collect();
            Error::input(format!("{name}: no such stream in {}; there are {}", self.folder.display(), names.join(", ")))
        })?;
        self.described(found).ok_or_else(|| {
            Error::input(format!("{}: what it says of the stream {name} is incomplete", self.folder.join("manifest.json").display()))
        })
    }

    fn described(&self, stream: &Value) -> Option<Stream> {
        let text = |value: &Value| value.as_str().map(str::to_owned);
        let fields = stream["fields"].as_array()?;
        let number = |field: &Value, name: &str| field[name].as_i64();
        let mut described = Vec::new();
        let (mut widths, mut signed, mut unless) = (Vec::new(), Vec::new(), Vec::new());
        for field in fields {
            let width = u32::try_from(number(field, "width")?).ok().filter(|width| (1..=63).contains(width))?;
            described.push(Field { name: text(&field["name"])?, width, frac_bits: number(field, "frac_bits")? as i32 });
            widths.push(width);
            signed.push(field["signed"].as_bool()?);
            let flags = field["zero_where"].as_array().map(Vec::as_slice).unwrap_or_default();
            let place = |flag: &Value| fields.iter().position(|field| field["name"] == *flag);
            unless.push(flags.iter().map(place).collect::<Option<Vec<_>>>()?);
        }
        Some(Stream {
            name: text(&stream["name"])?,
            unit: text(&stream["unit"])?,
            file: text(&stream["file"])?,
            key_file: text(&stream["keys"]["file"])?,
            sha256: text(&stream["sha256"])?,
            parent: text(&stream["parent"]),
            per_pixel: stream["order"] == "per-pixel",
            fields: described,
            layout: Layout::of(widths, signed, unless),
        })
    }

    /// The trace's own records, which must be as they were written.
    fn expected(&self, stream: &Stream) -> Result<Records> {
        let path = self.folder.join(&stream.file);
        let text = read(&path)?;
        if hex(&Sha256::digest(&text)) != stream.sha256 {
            return Err(Error::input(format!("{}: is not what `trace` wrote there: its digest is another", path.display())));
        }
        records(&path, &text, &stream.layout, Zeros::Compared)
    }

    fn keys(&self, stream: &Stream) -> Result<Records> {
        let path = self.folder.join(&stream.key_file);
        records(&path, &read(&path)?, &Layout::of_naturals(&Key::PARTS.map(|(_, bits)| bits)), Zeros::Compared)
    }
}

fn read(path: &Path) -> Result<String> {
    let bytes = input::read(path).map_err(|e| Error::input(format!("{}: cannot be read: {e}", path.display())))?;
    String::from_utf8(bytes).map_err(|_| Error::input(format!("{}: is no text; a record a line is needed, in hexadecimal", path.display())))
}

/// The records of a file, every line of which must be one.
fn records(path: &Path, text: &str, layout: &Layout, zeros: Zeros) -> Result<Records> {
    let malformed_line = |(line, malformed): (usize, Malformed)| {
        let what = match malformed {
            Malformed::Digits(0, needed) => format!("is empty; {needed} digits are needed"),
            Malformed::Digits(found, needed) => format!("has {found} digits, and a record has {needed}"),
            Malformed::Digit(digit) if "xXzZ".contains(digit) => format!("has `{digit}` in it: bits that the simulator does not know"),
            Malformed::Digit(digit) => format!("has `{digit}` in it, which is no hexadecimal digit"),
            Malformed::TooWide => format!("has bits above the {} of a record", layout.width),
        };
        Error::input(format!("{}: line {} {what}", path.display(), line + 1))
    };
    let lines = text.lines().enumerate().map(|(line, record)| {
        let mut words = layout.read(record).map_err(|malformed| malformed_line((line, malformed)))?;
        if zeros == Zeros::Ignored {
            layout.mask(&mut words);
        }
        Ok(words)
    });
    lines.collect()
}

/// Compares devices' outputs with a trace: of several streams, the earliest that is different tells what went wrong.
///
/// # Errors
/// [`Error::Input`] where the folder is no trace, has no such stream, was changed, or where a device's file is malformed.
pub fn diff(folder: &Path, outputs: &[(String, PathBuf)], zeros: Zeros) -> Result<Outcome> {
    let trace = Trace::open(folder)?;
    let mut streams: Vec<(Stream, &Path)> =
        outputs.iter().map(|(name, file)| Ok((trace.stream(name)?, file.as_path()))).collect::<Result<_>>()?;
    let all = trace.manifest["streams"].as_array().map(Vec::as_slice).unwrap_or_default();
    streams.sort_by_key(|(stream, _)| all.iter().position(|other| other["name"] == stream.name.as_str()));
    let mut equal = Vec::new();
    for (stream, file) in &streams {
        let expected = trace.expected(stream)?;
        let got = records(file, &read(file)?, &stream.layout, zeros)?;
        let found = if stream.per_pixel { by_pixel(stream, &expected, &got) } else { in_order(&expected, &got) };
        if let Some(first) = found.first() {
            let compared = Compared { trace: &trace, stream, expected: &expected, got: &got };
            return compared.outcome(first, &found);
        }
        equal.push(json!({"stream": stream.name, "records": expected.len()}));
    }
    let line = |stream: &Value| format!("{}: {} records equal", stream["stream"].as_str().unwrap_or_default(), stream["records"]);
    let text = equal.iter().map(line).collect::<Vec<_>>().join("\n");
    Ok(Outcome { sentence: text.clone(), text, json: json!({"equal": true, "streams": equal}), equal: true })
}

/// The first field that is different.
fn other_field(expected: &[i64], got: &[i64]) -> Option<usize> {
    expected.iter().zip(got).position(|(expected, got)| expected != got)
}

fn differing(record: usize, line: usize, expected: &[i64], got: &[i64]) -> Option<Mismatch> {
    let field = other_field(expected, got)?;
    Some(Mismatch::Field { record, line, field, expected: expected[field], got: got[field] })
}

/// Records in step again: so many that agree behind a fault.
const IN_STEP: usize = 4;

/// Whether records agree from here on, for a while or to the end of both.
fn agree(expected: &[Vec<i64>], got: &[Vec<i64>]) -> bool {
    let (left, right) = (expected.len().min(IN_STEP), got.len().min(IN_STEP));
    left.min(right) == left.max(right).min(expected.len()).min(got.len()) && expected.iter().zip(got).take(IN_STEP).all(|(a, b)| a == b)
}

/// Compares records whose order counts.
fn in_order(expected: &[Vec<i64>], got: &[Vec<i64>]) -> Vec<Mismatch> {
    let (mut found, mut e, mut g) = (Vec::new(), 0, 0);
    while e < expected.len() && g < got.len() {
        if expected[e] == got[g] {
            (e, g) = (e + 1, g + 1);
            continue;
        }
        let behind = |skip_expected: usize, skip_got: usize| match (expected.get(e + skip_expected..), got.get(g + skip_got..)) {
            (Some(expected), Some(got)) => agree(expected, got),
            _ => false,
        };
        let swapped = e + 1 < expected.len() && g + 1 < got.len() && expected[e] == got[g + 1] && expected[e + 1] == got[g];
        if swapped && behind(2, 2) {
            found.push(Mismatch::Swapped { record: e, line: g });
            (e, g) = (e + 2, g + 2);
        } else if behind(1, 1) {
            found.extend(differing(e, g, &expected[e], &got[g]));
            (e, g) = (e + 1, g + 1);
        } else if behind(1, 0) {
            found.push(Mismatch::Missing { record: e });
            e += 1;
        } else if behind(0, 1) {
            found.push(Mismatch::Surplus { line: g, before: e });
            g += 1;
        } else {
            found.extend(differing(e, g, &expected[e], &got[g]));
            (e, g) = (e + 1, g + 1);
        }
    }
    found.extend((e..expected.len()).map(|record| Mismatch::Missing { record }));
    found.extend((g..got.len()).map(|line| Mismatch::Surplus { line, before: expected.len() }));
    found
}

/// Compares records whose order counts at each pixel.
fn by_pixel(stream: &Stream, expected: &[Vec<i64>], got: &[Vec<i64>]) -> Vec<Mismatch> {
    let place = |name: &str| stream.fields.iter().position(|field| field.name == name).unwrap_or(0);
    let (x, y) = (place("x"), place("y"));
    let pixels = |records: &[Vec<i64>]| {
        let mut pixels: BTreeMap<(i64, i64), Vec<usize>> = BTreeMap::new();
        for (number, record) in records.iter().enumerate() {
            pixels.entry((record[y], record[x])).or_default().push(number);
        }
        pixels
    };
    let (ours, mut theirs) = (pixels(expected), pixels(got));
    let mut found = Vec::new();
    for (pixel, numbers) in &ours {
        let lines = theirs.remove(pixel).unwrap_or_default();
        let of = |all: &[Vec<i64>], numbers: &[usize]| numbers.iter().map(|&number| all[number].clone()).collect::<Vec<_>>();
        found.extend(in_order(&of(expected, numbers), &of(got, &lines)).into_iter().map(|mismatch| match mismatch {
            Mismatch::Field { record, line, field, expected, got } => {
                Mismatch::Field { record: numbers[record], line: lines[line], field, expected, got }
            }
            Mismatch::Missing { record } => Mismatch::Missing { record: numbers[record] },
            Mismatch::Swapped { record, line } => Mismatch::Swapped { record: numbers[record], line: lines[line] },
            Mismatch::Surplus { line, before } => {
                let last = numbers.last().map_or(0, |last| last + 1);
                Mismatch::Surplus { line: lines[line], before: numbers.get(before).copied().unwrap_or(last) }
            }
        }));
    }
    let strangers = theirs.into_values().flatten();
    found.extend(strangers.map(|line| Mismatch::Surplus { line, before: line.min(expected.len()) }));
    found.sort_by_key(Mismatch::record);
    found
}

/// A stream of which something is different.
struct Compared<'a> {
    trace: &'a Trace,
    stream: &'a Stream,
    expected: &'a [Vec<i64>],
    got: &'a [Vec<i64>],
}

/// A natural number of a key's part, if there is one.
fn part(key: &[i64], place: usize) -> Option<i64> {
    let (_, bits) = Key::PARTS[place];
    key.get(place).copied().filter(|&part| part != (1 << bits) - 1)
}

impl Compared<'_> {
    fn outcome(&self, first: &Mismatch, all: &[Mismatch]) -> Result<Outcome> {
        let keys = self.trace.keys(self.stream)?;
        let record = first.record();
        // A surplus record has no key: that of the one that it stands before tells where the device was.
        let key = keys.get(record.min(keys.len().saturating_sub(1))).cloned().unwrap_or_default();
        let (kind, line) = match first {
            Mismatch::Field { line, .. } => ("field", Some(*line)),
            Mismatch::Missing { .. } => ("missing", None),
            Mismatch::Surplus { line, .. } => ("surplus", Some(*line)),
            Mismatch::Swapped { line, .. } => ("swapped", Some(*line)),
        };
        let place = |mut mismatch: Value| {
            for (place, name) in [(0, "splat"), (1, "x"), (2, "y"), (3, "slot")] {
                if let Some(part) = part(&key, place) {
                    mismatch[name] = part.into();
                }
            }
            mismatch
        };
        let flags: Vec<&str> = {
            let bits = key.get(5).copied().unwrap_or(0);
            flag::NAMES.iter().enumerate().filter(|(bit, _)| bits >> bit & 1 == 1).map(|(_, name)| *name).collect()
        };
        let mut mismatch = place(json!({
            "equal": false, "stream": self.stream.name, "unit": self.stream.unit, "kind": kind, "sequence": record,
            "line": line.map(|line| line + 1), "expected_records": self.expected.len(), "records": self.got.len(),
            "mismatches": all.len(), "flags": flags,
        }));
        if let Mismatch::Field { field, expected, got, .. } = first {
            mismatch["field"] = self.field(*field, *expected, *got);
        }
        mismatch["expected"] = self.expected.get(record).map_or(Value::Null, |words| self.words(self.stream, words));
        mismatch["got"] = line.map_or(Value::Null, |line| self.words(self.stream, &self.got[line]));
        let inputs = self.inputs(&key)?;
        mismatch["inputs"] = inputs;
        mismatch["replay"] = self.replay(&key).into();
        let sentence = self.sentence(first, all.len());
        Ok(Outcome { text: self.text(&mismatch, &sentence), json: mismatch, equal: false, sentence })
    }

    fn sentence(&self, first: &Mismatch, count: usize) -> String {
        let name = &self.stream.name;
        let what = match first {
            Mismatch::Field { record, field, .. } => format!("record {record}, field {}, is different", self.stream.fields[*field].name),
            Mismatch::Missing { record } => format!("record {record} is missing"),
            Mismatch::Surplus { line, before } if *before < self.expected.len() => {
                format!("line {} is one too many, before record {before}", line + 1)
            }
            Mismatch::Surplus { line, .. } => format!("line {} is one too many, behind the last record", line + 1),
            Mismatch::Swapped { record, .. } => format!("records {record} and {} are swapped", record + 1),
        };
        let more = match count - 1 {
            0 => "and nothing else of it is".to_owned(),
            1 => "and one more difference follows".to_owned(),
            more => format!("and {more} more differences follow"),
        };
        format!("{name}: {what}, {more}")
    }

    fn field(&self, field: usize, expected: i64, got: i64) -> Value {
        let Field { name, width, frac_bits } = &self.stream.fields[field];
        json!({
            "name": name, "expected_hex": digits(expected, *width), "got_hex": digits(got, *width),
            "expected": value(expected, *frac_bits), "got": value(got, *frac_bits), "difference_ulp": got - expected,
        })
    }

    fn words(&self, stream: &Stream, words: &[i64]) -> Value {
        let word = |(field, &word): (&Field, &i64)| {
            (field.name.clone(), json!({"hex": digits(word, field.width), "value": value(word, field.frac_bits)}))
        };
        Value::Object(stream.fields.iter().zip(words).map(word).collect())
    }

    /// What the record was made from, back to the start of the trace: the nearest record first. Of several layers all, then what the first
    /// was made from.
    fn inputs(&self, key: &[i64]) -> Result<Value> {
        let mut inputs = Vec::new();
        let (mut parent, mut number) = (self.stream.parent.clone(), part(key, 4));
        while let (Some(name), Some(record)) = (parent, number) {
            let Ok(stream) = self.trace.stream(&name) else { break };
            let (records, keys) = (self.trace.expected(&stream)?, self.trace.keys(&stream)?);
            let (Some(from), Some(key)) = (records.get(record as usize..), keys.get(record as usize)) else { break };
            let last = stream.fields.iter().position(|field| field.name == "last");
            let is_last = |words: &Vec<i64>| last.is_none_or(|last| words[last] == 1);
            let count = from.iter().position(is_last).map_or(from.len(), |last| last + 1);
            inputs.extend(
                (record..)
                    .zip(&from[..count])
                    .map(|(record, words)| json!({"stream": stream.name, "sequence": record, "fields": self.words(&stream, words)})),
            );
            (parent, number) = (stream.parent.clone(), part(key, 4));
        }
        Ok(inputs.into())
    }

    /// A command that traces what led there, and nothing else.
    fn replay(&self, key: &[i64]) -> String {
        let m = &self.trace.manifest;
        let scene = match m["scene"]["complete"].as_bool() {
            Some(true) => self.trace.folder.join("scene.json").display().to_string(),
            _ => m["scene"]["name"].as_str().unwrap_or_default().to_owned(),
        };
        let (width, height) = (&m["scene"]["width"], &m["scene"]["height"]);
        let machine = self.trace.folder.join("machine.json");
        let mut command =
            format!("splatsim trace {scene} --size {width}x{height} --machine {} --units {}", machine.display(), self.stream.unit);
        if let (Some(splat), false) = (part(key, 0), ["fragment", "resolve"].contains(&self.stream.unit.as_str())) {
            let _ = write!(command, " --splats {splat}..{}", splat + 1);
        }
        if let (Some(x), Some(y), true) = (part(key, 1), part(key, 2), self.stream.unit != "raster") {
            let _ = write!(command, " --pixels {x},{y},{x},{y}");
        }
        command + " --out replay"
    }

    fn text(&self, mismatch: &Value, sentence: &str) -> String {
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
        line("records", format!("{} expected, {} found", self.expected.len(), self.got.len()));
        let field = &mismatch["field"];
        if !field.is_null() {
            let side = |name: &str| format!("{} = {}", field[format!("{name}_hex")].as_str().unwrap_or_default(), field[name]);
            line("field", field["name"].as_str().unwrap_or_default().to_owned());
            line("expected", side("expected"));
            line("got", side("got"));
            line("difference", format!("{} × the last place", field["difference_ulp"]));
        }
        let flags: Vec<&str> = mismatch["flags"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        if !flags.is_empty() {
            line("words", flags.join(", "));
        }
        let fields = |record: &Value| {
            let each = |(name, word): (&String, &Value)| format!("{name} {} = {}", word["hex"].as_str().unwrap_or_default(), word["value"]);
            record.as_object().into_iter().flatten().map(each).collect::<Vec<_>>()
        };
        let mut block = |title: String, record: &Value| {
            if !record.is_null() {
                let _ = write!(text, "\n  {title}\n    {}\n", fields(record).join("\n    "));
            }
        };
        block(format!("expected, {} record {}", self.stream.name, mismatch["sequence"]), &mismatch["expected"]);
        block("got".into(), &mismatch["got"]);
        let inputs = mismatch["inputs"].as_array().into_iter().flatten();
        for input in inputs.take_while(|input| input["stream"] == mismatch["inputs"][0]["stream"]) {
            block(format!("made from, {} record {}", input["stream"].as_str().unwrap_or_default(), input["sequence"]), &input["fields"]);
        }
        let _ = write!(text, "\n  replay     {}", mismatch["replay"].as_str().unwrap_or_default());
        text
    }
}

/// What a word stands for: a whole number where it has no fraction.
fn value(word: i64, frac_bits: i32) -> Value {
    if frac_bits == 0 { word.into() } else { (word as f64 * f64::from(-frac_bits).exp2()).into() }
}

/// A word's bits.
fn digits(word: i64, width: u32) -> String {
    format!("{:0digits$x}", word as u64 & ((1 << width) - 1), digits = width.div_ceil(4) as usize)
}

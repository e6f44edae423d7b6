//! Unit: a filter. Reads input records of a unit from standard input and prints its output records,
//! one per line.

use super::arguments::CommonArgs;
use crate::cosim::live::{Constants, Port, Record, Refused, Unit};
use crate::cosim::trace::without_comment;
use crate::cosim::words::{self, Word};
use crate::error::{Error, Result};
use crate::input;
use crate::output::text::one_line;
use clap::Args;
use std::ffi::OsString;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};

/// Most bytes per input line.
const LONGEST: u64 = 1 << 16;

#[derive(Args, Debug)]
pub(super) struct UnitArgs {
    /// Unit
    name: String,
    /// Read constants from it [default: glass-spheres]
    #[arg(
        long,
        value_name = "SCENE",
        default_value = "glass-spheres",
        hide_default_value = true
    )]
    scene: OsString,
    /// Read and print JSON objects, one per line
    #[arg(long)]
    json: bool,
    /// Print an empty line after each record
    #[arg(long)]
    groups: bool,
    /// Read shade outputs from FILE [default: the model]
    #[arg(long, value_name = "FILE")]
    answers: Option<PathBuf>,
    /// Write the requests of fragment to shade
    #[arg(long, value_name = "FILE")]
    requests: Option<PathBuf>,
    /// Write the final fragments of each pixel
    #[arg(long, value_name = "FILE")]
    held: Option<PathBuf>,
    /// Write all intermediate words of each record
    #[arg(long, value_name = "FILE")]
    words: Option<PathBuf>,
    #[command(flatten)]
    pub common: CommonArgs,
}

/// Checked arguments.
pub(super) struct UnitJob {
    name: String,
    constants: Constants,
    form: RecordFormat,
    groups: bool,
    answers: Option<PathBuf>,
    requests: Option<PathBuf>,
    held: Option<PathBuf>,
    words: Option<PathBuf>,
}

/// Format of records.
#[derive(Clone, Copy, Debug)]
enum RecordFormat {
    Hex,
    Json,
}

/// Reads a text with one record per line; `name` is its path.
struct RecordReader<R> {
    name: String,
    form: RecordFormat,
    text: R,
    /// Number of the last line read, from 1.
    number: u64,
    /// Records read.
    records: u64,
    /// Inside a comment of several lines.
    is_inside: bool,
}

/// Writes a file with one record per line, flushed as it grows. The old content is kept until the
/// first record, or until the end if there is none.
struct RecordWriter {
    form: RecordFormat,
    name: String,
    file: File,
    is_begun: bool,
}

impl UnitArgs {
    pub fn check(self) -> Result<UnitJob> {
        let scene = self.common.scene(&self.scene)?;
        let constants = Constants::new(&scene, &self.common.machine(&scene)?)?;
        let unit = Unit::new(&constants, &self.name)?;
        let shade = unit.shade.is_some();
        for (flag, file, has) in [
            ("--answers", &self.answers, shade),
            ("--requests", &self.requests, shade),
            ("--held", &self.held, unit.held.is_some()),
        ] {
            if file.is_some() && !has {
                let name = &self.name;
                return Err(Error::input(format!(
                    "{flag}: {name} has no such port in this frame"
                )));
            }
        }
        let form = if self.json {
            RecordFormat::Json
        } else {
            RecordFormat::Hex
        };
        let UnitArgs {
            name,
            groups,
            answers,
            requests,
            held,
            words,
            ..
        } = self;
        Ok(UnitJob {
            name,
            constants,
            form,
            groups,
            answers,
            requests,
            held,
            words,
        })
    }
}

impl RecordFormat {
    fn write(self, port: &Port, words: &[i64], text: &mut Vec<u8>) {
        match self {
            RecordFormat::Hex => port.write(words, text),
            RecordFormat::Json => port.write_json(words, text),
        }
    }
}

impl<R: BufRead> RecordReader<R> {
    fn refuse(&self, refused: &Refused) -> Error {
        Error::input(format!("{}: line {}: {refused}", self.name, self.number))
    }

    /// The next line without its end; None at the end of the text. Comments and addresses of
    /// `$writememh` are skipped.
    fn next(&mut self) -> Result<Option<String>> {
        while let Some(line) = self.next_line()? {
            let line = match self.form {
                RecordFormat::Hex => without_comment(&line, &mut self.is_inside),
                RecordFormat::Json => Some(line),
            };
            match line {
                Some(line) if self.is_address(&line)? => {}
                Some(line) => {
                    self.records += u64::from(!line.is_empty());
                    return Ok(Some(line));
                }
                None => {}
            }
        }
        Ok(None)
    }

    /// Whether a line is the address of the next record, as `@1f`.
    fn is_address(&self, line: &str) -> Result<bool> {
        let Some(address) = line.strip_prefix('@') else {
            return Ok(false);
        };
        if u64::from_str_radix(address.trim(), 16).ok() == Some(self.records) {
            return Ok(true);
        }
        let sentence = format!(
            "the address is {line}, and the next record is {:x} (hexadecimal)",
            self.records
        );
        Err(self.refuse(&Refused {
            field: None,
            sentence,
        }))
    }

    fn next_line(&mut self) -> Result<Option<String>> {
        let mut line = Vec::new();
        let read = self
            .text
            .by_ref()
            .take(LONGEST)
            .read_until(b'\n', &mut line);
        let read = read.map_err(|e| Error::input(format!("{}: cannot be read: {e}", self.name)))?;
        if read == 0 {
            return Ok(None);
        }
        self.number += 1;
        let (name, number) = (&self.name, self.number);
        if read as u64 == LONGEST && line.last() != Some(&b'\n') {
            return Err(Error::input(format!(
                "{name}: line {number}: more than {LONGEST} characters, and no record is so long"
            )));
        }
        let text = String::from_utf8(line)
            .map_err(|_| Error::input(format!("{name}: line {number}: this is not text")))?;
        Ok(Some(text.trim_end_matches(['\n', '\r']).to_owned()))
    }

    fn record(&self, port: &Port, line: &str) -> Result<Record> {
        let read = match self.form {
            RecordFormat::Hex => port.read(line),
            RecordFormat::Json => port.read_json(line),
        };
        read.map_err(|refused| self.refuse(&refused))
    }
}

impl RecordReader<BufReader<File>> {
    fn open(path: &Path, form: RecordFormat) -> Result<Self> {
        let name = one_line(&path.to_string_lossy());
        let file =
            input::open(path).map_err(|e| Error::input(format!("{name}: cannot be read: {e}")))?;
        Ok(RecordReader {
            name,
            form,
            text: BufReader::new(file),
            number: 0,
            records: 0,
            is_inside: false,
        })
    }
}

impl RecordWriter {
    fn open(path: &Path, form: RecordFormat) -> Result<Self> {
        let name = one_line(&path.to_string_lossy());
        let file = File::options()
            .write(true)
            .create(true)
            .truncate(false)
            .open(path);
        let file = file.map_err(|e| Error::job(format!("{name}: cannot be written: {e}")))?;
        Ok(RecordWriter {
            form,
            name,
            file,
            is_begun: false,
        })
    }

    /// Truncates the file.
    fn begin(&mut self) -> Result<()> {
        // A pipe cannot be truncated.
        let is_file = self
            .file
            .metadata()
            .is_ok_and(|metadata| metadata.is_file());
        if is_file && !std::mem::replace(&mut self.is_begun, true) {
            self.file
                .set_len(0)
                .map_err(|e| Error::job(format!("{}: cannot be written: {e}", self.name)))?;
        }
        Ok(())
    }

    fn write(&mut self, port: &Port, records: &[Record]) -> Result<()> {
        let mut text = Vec::new();
        records
            .iter()
            .for_each(|words| self.form.write(port, words, &mut text));
        self.write_text(&text)
    }

    fn write_text(&mut self, text: &[u8]) -> Result<()> {
        self.begin()?;
        self.file
            .write_all(text)
            .map_err(|e| Error::job(format!("{}: cannot be written: {e}", self.name)))
    }

    /// Writes one line per word of a record: record, signal, bits, value, loss.
    fn write_words(&mut self, record: u64, words: &[Word]) -> Result<()> {
        let mut text = String::new();
        for word in words {
            let _ = writeln!(
                text,
                "{record},{},{},{},{}",
                word.signal,
                word.hex(),
                word.value(),
                word.events.join(" ")
            );
        }
        self.write_text(text.as_bytes())
    }
}

/// Stands in for shade: returns the model's words or those of `--answers`, and writes requests to
/// `--requests`.
struct Shading<'a> {
    constants: &'a Constants,
    ports: Option<[Port; 2]>,
    answers: Option<RecordReader<BufReader<File>>>,
    requests: Option<RecordWriter>,
    request_count: u64,
    /// The first error.
    fault: Option<Error>,
}

impl Shading<'_> {
    fn shade(&mut self, request: &[i64]) -> [i64; 4] {
        if self.fault.is_some() {
            return [0; 4];
        }
        self.request_count += 1;
        self.try_shade(request).unwrap_or_else(|fault| {
            self.fault = Some(fault);
            [0; 4]
        })
    }

    fn try_shade(&mut self, request: &[i64]) -> Result<[i64; 4]> {
        let Some([request_port, answer_port]) = &self.ports else {
            return Ok([0; 4]);
        };
        if let Some(requests) = &mut self.requests {
            requests.write(request_port, &[request.to_vec()])?;
        }
        let Some(answers) = &mut self.answers else {
            return Ok(self.constants.light(request));
        };
        let Some(line) = answers.next()? else {
            return Err(Error::input(format!(
                "{}: there is no answer to request {}",
                answers.name, self.request_count
            )));
        };
        let words = answers.record(answer_port, &line)?;
        answer_port
            .hold(&words)
            .map_err(|refused| answers.refuse(&refused))?;
        words.try_into().map_err(|_| {
            Error::input(format!(
                "{}: line {}: four words are needed",
                answers.name, answers.number
            ))
        })
    }

    fn check(&mut self) -> Result<()> {
        self.fault.take().map_or(Ok(()), Err)
    }
}

impl UnitJob {
    /// Runs until the input ends or standard output is closed.
    pub fn run(self) -> Result<String> {
        let mut unit = Unit::new(&self.constants, &self.name)?;
        // Pipes are opened in a fixed order, so that the process at the other end can open them in
        // the same order.
        let requests = self
            .requests
            .as_deref()
            .map(|path| RecordWriter::open(path, self.form))
            .transpose()?;
        let answers = self
            .answers
            .as_deref()
            .map(|path| RecordReader::open(path, self.form))
            .transpose()?;
        let mut held = self
            .held
            .as_deref()
            .map(|path| RecordWriter::open(path, self.form))
            .transpose()?;
        let mut noted = self
            .words
            .as_deref()
            .map(|path| RecordWriter::open(path, self.form))
            .transpose()?;
        if let Some(noted) = &mut noted {
            noted.write_text(b"record,signal,bits,value,lost\n")?;
        }
        let mut shading = Shading {
            constants: &self.constants,
            ports: unit.shade.clone(),
            answers,
            requests,
            request_count: 0,
            fault: None,
        };
        let mut input = RecordReader {
            name: "standard input".into(),
            form: self.form,
            text: std::io::stdin().lock(),
            number: 0,
            records: 0,
            is_inside: false,
        };
        let mut is_open = true;
        while is_open {
            let line = input.next()?;
            is_open = line.is_some();
            let out = match line {
                Some(line) if !line.is_empty() || !unit.has_state() => {
                    let record = input.record(&unit.input, &line)?;
                    let mut shade = |request: &[i64]| shading.shade(request);
                    match &mut noted {
                        None => unit
                            .step(&record, &mut shade)
                            .map_err(|refused| input.refuse(&refused))?,
                        Some(noted) => {
                            let (out, made) = words::step(&mut unit, &record, &mut shade)
                                .map_err(|refused| input.refuse(&refused))?;
                            noted.write_words(input.records - 1, &made)?;
                            out
                        }
                    }
                }
                _ => {
                    let end = unit
                        .end(&mut |request| shading.shade(request))
                        .map_err(|refused| input.refuse(&refused))?;
                    if let (Some(held), Some(port)) = (&mut held, &unit.held) {
                        held.write(port, &end.held)?;
                    }
                    end.out
                }
            };
            shading.check()?;
            if !self.print(&unit.output, &out, is_open)? {
                break;
            }
        }
        for written in held.iter_mut().chain(&mut shading.requests) {
            written.begin()?;
        }
        Ok(String::new())
    }

    /// Prints records and flushes; false if standard output is closed.
    fn print(&self, port: &Port, records: &[Record], is_open: bool) -> Result<bool> {
        let mut text = Vec::new();
        records
            .iter()
            .for_each(|words| self.form.write(port, words, &mut text));
        if self.groups && is_open {
            text.push(b'\n');
        }
        let mut out = std::io::stdout().lock();
        match out.write_all(&text).and_then(|()| out.flush()) {
            Ok(()) => Ok(true),
            Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(false),
            Err(e) => Err(Error::job(format!("standard output: {e}"))),
        }
    }
}

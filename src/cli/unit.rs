//! Unit: a filter: records of a unit on standard input, its answers on standard output, line by
//! line.

use super::arguments::Common;
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

/// The longest line that is read, bytes.
const LONGEST: u64 = 1 << 16;

#[derive(Args, Debug)]
pub(super) struct Typed {
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
    pub common: Common,
}

/// A filter that can run.
pub(super) struct Job {
    name: String,
    constants: Constants,
    form: Form,
    groups: bool,
    answers: Option<PathBuf>,
    requests: Option<PathBuf>,
    held: Option<PathBuf>,
    words: Option<PathBuf>,
}

/// What records look like.
#[derive(Clone, Copy, Debug)]
enum Form {
    Hex,
    Json,
}

/// A text with a record a line, and what it is called.
struct Lines<R> {
    name: String,
    form: Form,
    text: R,
    /// Number of the line that was read last, from 1.
    number: u64,
    /// Records that were read.
    records: u64,
    /// A comment of several lines is open.
    is_inside: bool,
}

/// A file with a record a line that is written as it grows. What was in it stays until there is
/// something to write, or nothing was wrong.
struct Written {
    form: Form,
    name: String,
    file: File,
    is_begun: bool,
}

impl Typed {
    pub fn check(self) -> Result<Job> {
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
        let form = if self.json { Form::Json } else { Form::Hex };
        let Typed {
            name,
            groups,
            answers,
            requests,
            held,
            words,
            ..
        } = self;
        Ok(Job {
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

impl Form {
    fn write(self, port: &Port, words: &[i64], text: &mut Vec<u8>) {
        match self {
            Form::Hex => port.write(words, text),
            Form::Json => port.write_json(words, text),
        }
    }
}

impl<R: BufRead> Lines<R> {
    fn refuse(&self, refused: &Refused) -> Error {
        Error::input(format!("{}: line {}: {refused}", self.name, self.number))
    }

    /// The next line without its end; none where there is no more. Comments and addresses of
    /// `$writememh` are passed over.
    fn next(&mut self) -> Result<Option<String>> {
        while let Some(line) = self.next_line()? {
            let line = match self.form {
                Form::Hex => without_comment(&line, &mut self.is_inside),
                Form::Json => Some(line),
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
            .map_err(|_| Error::input(format!("{name}: line {number}: this is no text")))?;
        Ok(Some(text.trim_end_matches(['\n', '\r']).to_owned()))
    }

    fn record(&self, port: &Port, line: &str) -> Result<Record> {
        let read = match self.form {
            Form::Hex => port.read(line),
            Form::Json => port.read_json(line),
        };
        read.map_err(|refused| self.refuse(&refused))
    }
}

impl Lines<BufReader<File>> {
    fn open(path: &Path, form: Form) -> Result<Self> {
        let name = one_line(&path.to_string_lossy());
        let file =
            input::open(path).map_err(|e| Error::input(format!("{name}: cannot be read: {e}")))?;
        Ok(Lines {
            name,
            form,
            text: BufReader::new(file),
            number: 0,
            records: 0,
            is_inside: false,
        })
    }
}

impl Written {
    fn open(path: &Path, form: Form) -> Result<Self> {
        let name = one_line(&path.to_string_lossy());
        let file = File::options()
            .write(true)
            .create(true)
            .truncate(false)
            .open(path);
        let file = file.map_err(|e| Error::job(format!("{name}: cannot be written: {e}")))?;
        Ok(Written {
            form,
            name,
            file,
            is_begun: false,
        })
    }

    /// Nothing of what was in it stays.
    fn begin(&mut self) -> Result<()> {
        // A pipe has nothing.
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

    /// Writes a line for each word that a record made: which record, the signal, its bits, its
    /// value, what was lost.
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

/// What stands in for shade: the model's, or a file's answers; and where requests are written down.
struct Shading<'a> {
    constants: &'a Constants,
    ports: Option<[Port; 2]>,
    answers: Option<Lines<BufReader<File>>>,
    requests: Option<Written>,
    /// Number of requests.
    asked: u64,
    /// What went wrong first.
    fault: Option<Error>,
}

impl Shading<'_> {
    fn answer(&mut self, request: &[i64]) -> [i64; 4] {
        if self.fault.is_some() {
            return [0; 4];
        }
        self.asked += 1;
        self.try_answer(request).unwrap_or_else(|fault| {
            self.fault = Some(fault);
            [0; 4]
        })
    }

    fn try_answer(&mut self, request: &[i64]) -> Result<[i64; 4]> {
        let Some([asks, says]) = &self.ports else {
            return Ok([0; 4]);
        };
        if let Some(requests) = &mut self.requests {
            requests.write(asks, &[request.to_vec()])?;
        }
        let Some(answers) = &mut self.answers else {
            return Ok(self.constants.light(request));
        };
        let Some(line) = answers.next()? else {
            return Err(Error::input(format!(
                "{}: there is no answer to request {}",
                answers.name, self.asked
            )));
        };
        let words = answers.record(says, &line)?;
        says.hold(&words)
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

impl Job {
    /// Answers until the input ends, or nobody reads the answers.
    pub fn run(self) -> Result<String> {
        let mut unit = Unit::new(&self.constants, &self.name)?;
        // In the order in which pipes are opened by whoever has them at the other end.
        let requests = self
            .requests
            .as_deref()
            .map(|path| Written::open(path, self.form))
            .transpose()?;
        let answers = self
            .answers
            .as_deref()
            .map(|path| Lines::open(path, self.form))
            .transpose()?;
        let mut held = self
            .held
            .as_deref()
            .map(|path| Written::open(path, self.form))
            .transpose()?;
        let mut noted = self
            .words
            .as_deref()
            .map(|path| Written::open(path, self.form))
            .transpose()?;
        if let Some(noted) = &mut noted {
            noted.write_text(b"record,signal,bits,value,lost\n")?;
        }
        let mut shading = Shading {
            constants: &self.constants,
            ports: unit.shade.clone(),
            answers,
            requests,
            asked: 0,
            fault: None,
        };
        let mut input = Lines {
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
                    let mut shade = |request: &[i64]| shading.answer(request);
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
                        .end(&mut |request| shading.answer(request))
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

    /// Prints answers at once; false where nobody reads them.
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

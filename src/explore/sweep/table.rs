//! Table: stores rows in a journal that survives the process, and writes all of them as CSV and
//! Parquet.
//!
//! ```text
//! points.jsonl          one line of columns, then one line per row: [digest, [cells]]   appended; incomplete lines are ignored
//! points-2-of-5.jsonl   the same for one part
//! points/17.parquet     rows from other processes, the first of point 17         written as a temporary file, then renamed
//! sweep.csv, sweep.parquet   every row, sorted by point                         written as a temporary file, then renamed
//! ```
//! An incomplete last line is removed; a line that was changed is an error.

mod batch;

pub use batch::packed;

use super::columns::{MISFIT, SAMPLED_TILES};
use crate::error::{Error, Result};
use crate::input;
use crate::output::files::write_beside;
use crate::output::progress::check_not_stopped;
use crate::scene::digest::digest;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Kind of a column's cells; cells may be empty.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellKind {
    /// Text.
    Text,
    /// An integer.
    Whole,
    /// A number.
    Number,
}

/// A column's name and kind.
pub type Column = (String, CellKind);

/// Columns by name and kind.
pub fn named(columns: &[(&str, CellKind)]) -> Vec<Column> {
    columns
        .iter()
        .map(|(name, kind)| ((*name).to_owned(), *kind))
        .collect()
}

/// A row's cells, in the order of the columns: text, numbers or null.
pub type Row = Vec<Value>;

/// Rows, and the columns of their cells.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// Columns of the cells.
    pub columns: Vec<Column>,
    /// Sorted by point.
    pub rows: Vec<Row>,
}

impl Table {
    /// Reads all rows of a folder.
    ///
    /// # Errors
    /// [`Error::Input`] if it has none, or if one was changed.
    pub fn read(folder: &Path) -> Result<Self> {
        let cannot =
            |e: std::io::Error| Error::input(format!("{}: cannot be read: {e}", folder.display()));
        let paths = journals(folder).map_err(cannot)?;
        let input_error = |what: &str| Error::input(format!("{}: {what}", folder.display()));
        let first = paths.first().ok_or_else(|| {
            input_error("has no points.jsonl: it is not a folder of `sweep` or `search`")
        })?;
        let text = input::read_text(first).map_err(cannot)?;
        let header = text.lines().next().unwrap_or_default();
        let columns = columns(header)
            .ok_or_else(|| Error::input(format!("{}: line 1: has no columns", first.display())))?;
        let mut rows = BTreeMap::new();
        for path in &paths {
            let text = input::read(path).map_err(cannot)?;
            read(path, whole_lines(&text), header, "", &mut rows)?;
        }
        batch::read_all(folder, &columns, &mut rows)?;
        if rows.is_empty() {
            Err(input_error("has no rows yet"))
        } else {
            Ok(Table {
                columns,
                rows: rows.into_values().collect(),
            })
        }
    }

    /// Whether the machine of a row could be built and was drawn in full, and the row thus has
    /// figures.
    pub fn is_drawn(&self, row: &Row) -> bool {
        self.text(row, MISFIT).is_empty() && self.number(row, SAMPLED_TILES).is_none()
    }

    /// Whether any row was drawn.
    pub fn has_drawn(&self) -> bool {
        self.rows.iter().any(|row| self.is_drawn(row))
    }

    /// The first reason why a row was not drawn.
    pub fn first_misfit(&self) -> Option<&str> {
        self.rows
            .iter()
            .map(|row| self.text(row, MISFIT))
            .find(|reason| !reason.is_empty())
    }

    /// Index of a column.
    pub fn at(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|(other, _)| other == name)
    }

    /// The value of a numeric cell.
    pub fn number(&self, row: &Row, name: &str) -> Option<f64> {
        row[self.at(name)?].as_f64()
    }

    /// A cell as it is printed.
    pub fn shown(&self, row: &Row, name: &str) -> String {
        match self.at(name).map(|at| &row[at]) {
            None | Some(Value::Null) => String::new(),
            Some(Value::String(text)) => text.clone(),
            Some(number) => number.to_string(),
        }
    }

    /// The text of a cell; empty if it is not text.
    pub fn text<'a>(&self, row: &'a Row, name: &str) -> &'a str {
        self.at(name)
            .and_then(|at| row[at].as_str())
            .unwrap_or_default()
    }
}

/// The complete lines.
fn whole_lines(text: &[u8]) -> &[u8] {
    &text[..text
        .iter()
        .rposition(|byte| *byte == b'\n')
        .map_or(0, |end| end + 1)]
}

/// The existing rows of a folder, and new ones.
#[derive(Debug)]
pub struct Journal {
    columns: Vec<Column>,
    file: File,
    /// By point.
    rows: BTreeMap<u64, Row>,
    /// Path of the journal if it is new and still empty.
    unused: Option<PathBuf>,
}

impl Drop for Journal {
    fn drop(&mut self) {
        // A journal without rows is removed.
        self.unused
            .take()
            .into_iter()
            .for_each(|path| _ = fs::remove_file(path));
    }
}

impl Journal {
    /// Opens the journal of a part, and reads those of all other parts.
    ///
    /// # Errors
    /// [`Error::Input`] if a journal has other columns, was changed, or is being written by another
    /// process.
    pub fn open(folder: &Path, part: &str, columns: Vec<Column>) -> Result<Self> {
        let own = folder.join(format!("points{part}.jsonl"));
        let cannot = |path: &Path, e: std::io::Error| {
            Error::input(format!("{}: cannot be read: {e}", path.display()))
        };
        let is_new = !own.exists();
        let file = OpenOptions::new()
            .read(true)
            .append(true)
            .create(true)
            .open(&own)
            .map_err(|e| cannot(&own, e))?;
        file.try_lock().map_err(|_| {
            Error::input(format!("{}: another sweep is writing there", own.display()))
        })?;
        let header = header(&columns);
        let mut journal = Journal {
            columns,
            file,
            rows: BTreeMap::new(),
            unused: is_new.then(|| own.clone()),
        };
        for path in journals(folder).map_err(|e| cannot(folder, e))? {
            let text = input::read(&path).map_err(|e| cannot(&path, e))?;
            let whole = whole_lines(&text);
            read(&path, whole, &header, REMEDY, &mut journal.rows)?;
            if path == own && whole.len() < text.len() {
                // Removes an incomplete last line.
                journal
                    .file
                    .set_len(whole.len() as u64)
                    .map_err(|e| cannot(&own, e))?;
            }
        }
        batch::remove_parts(folder);
        batch::read_all(folder, &journal.columns, &mut journal.rows)?;
        if journal.file.metadata().map_err(|e| cannot(&own, e))?.len() == 0 {
            journal
                .file
                .write_all(format!("{header}\n").as_bytes())
                .map_err(|e| written(&own, e))?;
        }
        Ok(journal)
    }

    /// Releases its file; returns whether no other process is writing.
    ///
    /// # Errors
    /// [`Error::Input`] if the folder cannot be read.
    pub fn ends(&self, folder: &Path) -> Result<bool> {
        // All processes unlock before they check, so that of several that end together the last one
        // finds no other.
        let _ = self.file.unlock();
        let all = journals(folder)
            .map_err(|e| Error::input(format!("{}: cannot be read: {e}", folder.display())))?;
        let is_written = |path: &PathBuf| {
            File::open(path)
                .is_ok_and(|file| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)))
        };
        Ok(!all.iter().any(is_written))
    }

    /// Reads the rows that other processes have written.
    ///
    /// # Errors
    /// [`Error::Input`] if a journal has other columns, or was changed.
    pub fn read_others(&mut self, folder: &Path) -> Result<()> {
        let cannot = |path: &Path, e: std::io::Error| {
            Error::input(format!("{}: cannot be read: {e}", path.display()))
        };
        let header = header(&self.columns);
        for path in journals(folder).map_err(|e| cannot(folder, e))? {
            let text = input::read(&path).map_err(|e| cannot(&path, e))?;
            read(&path, whole_lines(&text), &header, REMEDY, &mut self.rows)?;
        }
        batch::read_all(folder, &self.columns, &mut self.rows)
    }

    /// Keeps the journal's file even if it has no rows.
    pub fn keep(&mut self) {
        self.unused = None;
    }

    /// The row of a point.
    pub fn get(&self, point: u64) -> Option<&Row> {
        self.rows.get(&point)
    }

    /// Points that have a row.
    pub fn points(&self) -> impl DoubleEndedIterator<Item = u64> {
        self.rows.keys().copied()
    }

    /// All rows, sorted by point.
    pub fn rows(&self) -> impl DoubleEndedIterator<Item = &Row> {
        self.rows.values()
    }

    /// The same as a table.
    pub fn table(&self) -> Table {
        Table {
            columns: self.columns.clone(),
            rows: self.rows().cloned().collect(),
        }
    }

    /// Adds a row, and writes it before returning.
    ///
    /// # Errors
    /// [`Error::Job`] if it cannot be written, or the sweep was cancelled.
    pub fn push(&mut self, point: u64, row: Row) -> Result<()> {
        check_not_stopped()?;
        let cells = Value::from(row.clone()).to_string();
        let line = format!("[\"{}\",{cells}]\n", digest(cells.as_bytes()));
        self.file
            .write_all(line.as_bytes())
            .map_err(|e| Error::job(format!("the journal cannot be written: {e}")))?;
        self.rows.insert(point, row);
        Ok(())
    }

    /// Adds rows of these points from another process, and writes them as a separate file before
    /// returning.
    ///
    /// # Errors
    /// [`Error::Job`] if they are of other points, exist already, or cannot be written; or the
    /// sweep was cancelled.
    pub fn push_batch(&mut self, folder: &Path, points: &[u64], bytes: &[u8]) -> Result<()> {
        check_not_stopped()?;
        let rows = batch::unpacked(bytes, &self.columns)
            .map_err(|what| Error::job(format!("a batch of rows {what}")))?;
        let are_asked_for =
            rows.iter().map(|(point, _)| point).eq(points) && points.is_sorted_by(|a, b| a < b);
        if !are_asked_for || points.iter().any(|point| self.rows.contains_key(point)) {
            return Err(Error::job("a batch of rows is not of the requested points"));
        }
        if let Some(first) = points.first() {
            batch::write(folder, *first, bytes)?;
        }
        self.rows.extend(rows);
        Ok(())
    }

    /// Writes all rows as `stem`.csv and as Parquet.
    ///
    /// # Errors
    /// [`Error::Job`] if they cannot be written.
    pub fn write(&self, folder: &Path, stem: &str) -> Result<Vec<PathBuf>> {
        let [csv, parquet] =
            ["csv", "parquet"].map(|extension| folder.join(stem).with_extension(extension));
        let text = self.csv();
        write_beside(&csv, |file| {
            file.write_all(text.as_bytes()).map_err(|e| e.to_string())
        })?;
        let bytes = batch::parquet(&self.columns, self.rows(), None)
            .map_err(|e| Error::job(format!("{}: {e}", parquet.display())))?;
        write_beside(&parquet, |file| {
            file.write_all(&bytes).map_err(|e| e.to_string())
        })?;
        Ok(vec![csv, parquet])
    }

    /// The rows as CSV (RFC 4180, but lines end in a line feed).
    pub fn csv(&self) -> String {
        let quoted = |text: &str| {
            if text.contains([',', '"', '\n']) {
                format!("\"{}\"", text.replace('"', "\"\""))
            } else {
                text.to_owned()
            }
        };
        let cell = |cell: &Value| match cell {
            Value::Null => String::new(),
            Value::String(text) => quoted(text),
            number => number.to_string(),
        };
        let mut text = self
            .columns
            .iter()
            .map(|(name, _)| quoted(name))
            .collect::<Vec<_>>()
            .join(",")
            + "\n";
        for row in self.rows() {
            text += &(row.iter().map(cell).collect::<Vec<_>>().join(",") + "\n");
        }
        text
    }
}

fn written(path: &Path, e: std::io::Error) -> Error {
    Error::job(format!("{}: cannot be written: {e}", path.display()))
}

fn header(columns: &[Column]) -> String {
    Value::from(
        columns
            .iter()
            .map(|(name, kind)| Value::from(format!("{name}: {kind:?}")))
            .collect::<Vec<_>>(),
    )
    .to_string()
}

fn columns(header: &str) -> Option<Vec<Column>> {
    let names: Vec<String> = serde_json::from_str(header).ok()?;
    let column = |text: &String| {
        let (name, kind) = text.rsplit_once(": ")?;
        let kind = [CellKind::Text, CellKind::Whole, CellKind::Number]
            .into_iter()
            .find(|other| format!("{other:?}") == kind)?;
        Some((name.to_owned(), kind))
    };
    names.iter().map(column).collect()
}

/// Every journal of a folder, sorted by name.
fn journals(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut paths: Vec<PathBuf> = fs::read_dir(folder)?
        .map(|entry| Ok(entry?.path()))
        .collect::<std::io::Result<_>>()?;
    let is_journal = |path: &PathBuf| {
        let name = path
            .file_name()
            .and_then(|name| name.to_str())
            .unwrap_or_default();
        name.starts_with("points") && name.ends_with(".jsonl") && path.is_file()
    };
    paths.retain(is_journal);
    paths.sort();
    Ok(paths)
}

/// End of an error: what to do if the rows of a folder are of another plan.
const REMEDY: &str = "; choose another folder (--out)";

fn read(
    path: &Path,
    text: &[u8],
    header: &str,
    remedy: &str,
    rows: &mut BTreeMap<u64, Row>,
) -> Result<()> {
    let input_error = |line: usize, what: &str| {
        Error::input(format!("{}: line {}: {what}", path.display(), line + 1))
    };
    let header_cells = columns(header).map_or(0, |columns| columns.len());
    for (nth, line) in text
        .split(|byte| *byte == b'\n')
        .enumerate()
        .filter(|(_, line)| !line.is_empty())
    {
        if nth == 0 {
            if line != header.as_bytes() {
                let what = format!(
                    "has other columns: it is of another plan, or of another version{remedy}"
                );
                return Err(input_error(0, &what));
            }
            continue;
        }
        let changed = || {
            input_error(
                nth,
                "is not as it was written: take the line out, and its point will be drawn again",
            )
        };
        let (stored_digest, row): (String, Value) =
            serde_json::from_slice(line).map_err(|_| changed())?;
        let Value::Array(row) = row else {
            return Err(changed());
        };
        let point = row.first().and_then(Value::as_u64).ok_or_else(changed)?;
        if stored_digest != digest(Value::from(row.clone()).to_string().as_bytes())
            || row.len() != header_cells
        {
            return Err(changed());
        }
        rows.insert(point, row);
    }
    Ok(())
}

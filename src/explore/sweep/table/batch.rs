//! Batch: converts rows to Parquet and back, and stores files of rows from other processes.
//!
//! ```text
//! rows ─► Parquet, with a digest of all cells ─► points/FIRST.parquet ─► rows
//! ```
//! No point is in two files. A file is named after its first point, so no file is written twice.

use super::{CellKind, Column, Row};
use crate::error::{Error, Result};
use crate::input;
use crate::output::files::write_beside;
use crate::scene::digest::digest;
use bytes::Bytes;
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::{ParquetError, Result as Parquet};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::reader::{FileReader, RowGroupReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Folder of the files.
const FOLDER: &str = "points";
/// Name of the digest in a file.
const DIGEST: &str = "splatsim_digest";

/// Rows as bytes of a Parquet file.
///
/// # Errors
/// [`Error::Job`] if they cannot be encoded.
pub fn packed(columns: &[Column], rows: &BTreeMap<u64, Row>) -> Result<Vec<u8>> {
    let digest = digest_of(rows.values());
    parquet(columns, rows.values(), Some(digest))
        .map_err(|e| Error::job(format!("rows cannot be packed: {e}")))
}

/// The rows in these bytes, in their order; or what is wrong with them.
pub(super) fn unpacked(
    bytes: &[u8],
    columns: &[Column],
) -> std::result::Result<Vec<(u64, Row)>, String> {
    let file = SerializedFileReader::new(Bytes::copy_from_slice(bytes)).map_err(damaged)?;
    let schema = file.metadata().file_metadata().schema_descr();
    let names = schema
        .columns()
        .iter()
        .map(|column| (column.name(), column.physical_type()));
    if !names.eq(columns
        .iter()
        .map(|(name, kind)| (name.as_str(), physical(*kind))))
    {
        return Err("has other columns: it is of another plan, or of another version".into());
    }
    let rows = rows(&file).map_err(damaged)?;
    let metadata = file
        .metadata()
        .file_metadata()
        .key_value_metadata()
        .into_iter()
        .flatten()
        .find(|pair| pair.key == DIGEST);
    if metadata.and_then(|pair| pair.value.as_ref()) != Some(&digest_of(rows.iter())) {
        return Err("is not as it was written".into());
    }
    let numbered = |row: Row| {
        row.first()
            .and_then(Value::as_u64)
            .map(|point| (point, row))
    };
    rows.into_iter()
        .map(numbered)
        .collect::<Option<_>>()
        .ok_or_else(|| "has a row without a point".into())
}

fn damaged(error: ParquetError) -> String {
    format!("is damaged: {error}")
}

/// Every row of a folder's files.
///
/// # Errors
/// [`Error::Input`] if a file cannot be read or is damaged.
pub(super) fn read_all(
    folder: &Path,
    columns: &[Column],
    rows: &mut BTreeMap<u64, Row>,
) -> Result<()> {
    for path in files(folder, "parquet") {
        let input_error = |what: &str| Error::input(format!("{}: {what}", path.display()));
        let bytes = input::read(&path).map_err(|e| input_error(&format!("cannot be read: {e}")))?;
        let found = unpacked(&bytes, columns).map_err(|what| {
            input_error(&format!(
                "{what}: take the file away, and its points will be drawn again"
            ))
        })?;
        rows.extend(found);
    }
    Ok(())
}

/// Writes a file of rows; `first` is the point of the first row.
pub(super) fn write(folder: &Path, first: u64, bytes: &[u8]) -> Result<()> {
    let folder = folder.join(FOLDER);
    fs::create_dir_all(&folder)
        .map_err(|e| Error::job(format!("{}: cannot be written: {e}", folder.display())))?;
    write_beside(&folder.join(format!("{first}.parquet")), |file| {
        file.write_all(bytes).map_err(|e| e.to_string())
    })
}

/// Removes incomplete files of killed processes; no other process may be writing there.
pub(super) fn remove_parts(folder: &Path) {
    // Errors are ignored: a leftover file does not affect rows.
    files(folder, "part")
        .iter()
        .for_each(|path| _ = fs::remove_file(path));
}

/// Files with an extension, sorted by name.
fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder.join(FOLDER))
        .into_iter()
        .flatten()
        .flatten();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    paths.retain(|path| path.extension().is_some_and(|other| other == extension));
    paths.sort();
    paths
}

/// Digest of every cell.
fn digest_of<'a>(rows: impl Iterator<Item = &'a Row>) -> String {
    let lines: String = rows
        .map(|row| Value::from(row.clone()).to_string() + "\n")
        .collect();
    digest(lines.as_bytes())
}

/// The rows of a file.
fn rows(file: &SerializedFileReader<Bytes>) -> Parquet<Vec<Row>> {
    let mut rows = Vec::new();
    for group in 0..file.num_row_groups() {
        let group = file.get_row_group(group)?;
        let cells = (0..group.num_columns())
            .map(|nth| Ok(column(&*group, nth)?.into_iter()))
            .collect::<Parquet<Vec<_>>>();
        let mut cells = cells?;
        let row_count = group.metadata().num_rows().max(0);
        rows.extend((0..row_count).map(|_| {
            cells
                .iter_mut()
                .map(|column| column.next().unwrap_or_default())
                .collect::<Row>()
        }));
    }
    Ok(rows)
}

/// The cells of a column.
fn column(group: &dyn RowGroupReader, nth: usize) -> Parquet<Vec<Value>> {
    let rows = group.metadata().num_rows().max(0) as usize;
    Ok(match group.get_column_reader(nth)? {
        ColumnReader::ByteArrayColumnReader(reader) => values(reader, rows)?
            .into_iter()
            .map(|text| {
                text.and_then(|text| Some(text.as_utf8().ok()?.to_owned()))
                    .into()
            })
            .collect(),
        ColumnReader::Int64ColumnReader(reader) => {
            values(reader, rows)?.into_iter().map(Value::from).collect()
        }
        ColumnReader::DoubleColumnReader(reader) => {
            values(reader, rows)?.into_iter().map(Value::from).collect()
        }
        _ => Vec::new(),
    })
}

/// A column's values by row.
fn values<T: DataType>(mut reader: ColumnReaderImpl<T>, rows: usize) -> Parquet<Vec<Option<T::T>>> {
    let (mut there, mut values) = (Vec::new(), Vec::new());
    while there.len() < rows {
        let (read, ..) =
            reader.read_records(rows - there.len(), Some(&mut there), None, &mut values)?;
        if read == 0 {
            break;
        }
    }
    let mut values = values.into_iter();
    Ok(there
        .into_iter()
        .map(|is_there| if is_there > 0 { values.next() } else { None })
        .collect())
}

fn physical(kind: CellKind) -> Physical {
    match kind {
        CellKind::Text => Physical::BYTE_ARRAY,
        CellKind::Whole => Physical::INT64,
        CellKind::Number => Physical::DOUBLE,
    }
}

/// Rows as a Parquet file, with a digest if one is given.
pub(super) fn parquet<'a>(
    columns: &[Column],
    rows: impl Iterator<Item = &'a Row>,
    digest: Option<String>,
) -> Parquet<Vec<u8>> {
    let field = |(name, kind): &Column| {
        let text = (*kind == CellKind::Text).then_some(LogicalType::String);
        let field = Type::primitive_type_builder(name, physical(*kind))
            .with_repetition(Repetition::OPTIONAL);
        field.with_logical_type(text).build().map(Arc::new)
    };
    let fields = columns.iter().map(field).collect::<Parquet<Vec<_>>>()?;
    let schema = Arc::new(
        Type::group_type_builder("sweep")
            .with_fields(fields)
            .build()?,
    );
    let metadata = digest.map(|digest| vec![KeyValue::new(DIGEST.into(), digest)]);
    let properties = WriterProperties::builder().set_compression(Compression::UNCOMPRESSED);
    // A batch has few rows: indices for partial reads would be most of the file.
    let properties = if metadata.is_some() {
        properties
            .set_statistics_enabled(EnabledStatistics::None)
            .set_dictionary_enabled(false)
            .set_offset_index_disabled(true)
    } else {
        properties
    };
    let properties = properties.set_key_value_metadata(metadata).build();
    let mut bytes = Vec::new();
    let mut file = SerializedFileWriter::new(&mut bytes, schema, Arc::new(properties))?;
    let mut group = file.next_row_group()?;
    let rows: Vec<&Row> = rows.collect();
    for (nth, (_, kind)) in columns.iter().enumerate() {
        let Some(mut column) = group.next_column()? else {
            break;
        };
        let cells: Vec<&Value> = rows.iter().map(|row| &row[nth]).collect();
        let there: Vec<i16> = cells
            .iter()
            .map(|cell| i16::from(!cell.is_null()))
            .collect();
        match kind {
            CellKind::Text => {
                let words: Vec<ByteArray> = cells
                    .iter()
                    .filter_map(|cell| cell.as_str())
                    .map(ByteArray::from)
                    .collect();
                column
                    .typed::<ByteArrayType>()
                    .write_batch(&words, Some(&there), None)?;
            }
            CellKind::Whole => {
                let numbers: Vec<i64> = cells.iter().filter_map(|cell| cell.as_i64()).collect();
                column
                    .typed::<Int64Type>()
                    .write_batch(&numbers, Some(&there), None)?;
            }
            CellKind::Number => {
                let numbers: Vec<f64> = cells.iter().filter_map(|cell| cell.as_f64()).collect();
                column
                    .typed::<DoubleType>()
                    .write_batch(&numbers, Some(&there), None)?;
            }
        }
        column.close()?;
    }
    group.close()?;
    file.close()?;
    Ok(bytes)
}

//! Folder: what `run`, `replay`, `sweep`, `search` or `stress` left in a folder, as one value that a page is made of.
//!
//! ```text
//! report.json, fixed.png …     ─► run      (frame, machine)
//! cycles.json                  ─► cycles   (machine)
//! points.jsonl, plan.json      ─┐
//! choices.json, stress.json    ─┴► tables  (rows, their machine)
//! other PNGs                   ─► charts
//! ```
//! Files are listed once, by name; what is asked for later is looked up in that list, so no name that is asked for is ever a path.

use crate::error::{Error, Result};
use crate::explore::sweep::table::Table;
use crate::hardware::{fixed, machines};
use rtl_model::Machine;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Pictures of a frame, in the order of their keys.
pub const PICTURES: [&str; 5] = ["fixed", "golden", "ideal", "error", "flips"];
/// Charts that are shown, at most.
const MOST_CHARTS: usize = 64;
/// Bytes of a JSON file, at most: a report of the largest machine has a thousandth.
const MOST_JSON_BYTES: u64 = 256 << 20;

/// A folder that can be shown.
#[derive(Debug)]
pub struct Folder {
    /// All that the page needs to know.
    pub told: Value,
    /// Files that may be asked for, by name.
    pub files: BTreeMap<String, PathBuf>,
    /// The frame that can be drawn again; none where there is none.
    pub run: Option<Run>,
}

/// What `run` drew.
#[derive(Clone, Debug)]
pub struct Run {
    /// The scene's file, or a built-in name.
    pub scene: String,
    /// Columns and rows of the picture.
    pub size: [usize; 2],
    /// Columns and rows of the whole, where the picture is a preview of it.
    pub preview_of: Option<[usize; 2]>,
    /// The machine.
    pub machine: Machine,
    /// The camera, as the report has it.
    pub camera: Value,
    /// Splats, and contributions of the machine.
    pub counts: [u64; 2],
}

impl Folder {
    /// Reads what a folder holds.
    ///
    /// # Errors
    /// [`Error::Input`], one sentence naming the file, where it holds nothing that can be shown, or a file is broken or of something else.
    pub fn read(folder: &Path) -> Result<Self> {
        let cannot = |e: std::io::Error| Error::input(format!("{}: cannot be read: {e}", folder.display()));
        if folder.is_file() {
            return Err(Error::input(format!(
                "{}: is a file; view takes a folder that run, sweep, search or stress wrote",
                folder.display()
            )));
        }
        let root = folder.canonicalize().map_err(cannot)?;
        let mut files = BTreeMap::new();
        for entry in fs::read_dir(&root).map_err(cannot)? {
            let entry = entry.map_err(cannot)?;
            // Links are followed nowhere: they may lead out of the folder.
            let is_plain = entry.file_type().is_ok_and(|kind| kind.is_file());
            if let (true, Ok(name)) = (is_plain, entry.file_name().into_string()) {
                files.insert(name, entry.path());
            }
        }
        let shown = |name: &str| folder.join(name).display().to_string();
        let value = |name: &str| files.get(name).map(|path| read_json(path, &shown(name))).transpose();
        let report = value("report.json")?;
        let run = report.as_ref().map(|report| Run::new(report, &shown("report.json"))).transpose()?;
        let pictures = run.as_ref().map_or(Ok(Vec::new()), |run| pictures(&files, run.size, &shown))?;
        let cycles = value("cycles.json")?;
        if cycles.as_ref().is_some_and(|cycles| !cycles["units"].is_array() || !cycles["total"].is_u64()) {
            return Err(Error::input(format!("{}: is no account of cycles, as `replay` writes it", shown("cycles.json"))));
        }
        let mut tables = Vec::new();
        if files.keys().any(|name| name.starts_with("points") && name.ends_with(".jsonl")) {
            let plan = value("plan.json")?.ok_or_else(|| Error::input(format!("{}: is missing beside the rows", shown("plan.json"))))?;
            tables.push(points(&Table::read(folder)?, &plan, &shown("plan.json"))?);
        }
        for (name, title, path) in
            [("choices.json", "rules for fragments", &["choices"][..]), ("stress.json", "stress cases", &["cases", "machines", "points"])]
        {
            if let Some(value) = value(name)? {
                let rows = rows_of(&value, path).filter(|rows| !rows.is_empty());
                let rows = rows.ok_or_else(|| Error::input(format!("{}: has no {}, as splatsim writes them", shown(name), path[0])))?;
                tables.push(table_of(title, rows));
            }
        }
        let is_chart = |name: &&String| {
            let stem = name.strip_suffix(".png");
            stem.is_some_and(|stem| !PICTURES.contains(&stem))
        };
        let charts: Vec<&String> = files.keys().filter(is_chart).take(MOST_CHARTS).collect();
        if run.is_none() && cycles.is_none() && tables.is_empty() {
            let told = "holds nothing that view shows: no report.json, points.jsonl, choices.json, stress.json or cycles.json";
            return Err(Error::input(format!("{}: {told}", folder.display())));
        }
        let name = root.file_name().map_or_else(|| "/".into(), |name| name.to_string_lossy().into_owned());
        let told = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "name": name,
            "run": run.as_ref().map(|run| json!({
                "report": report, "pictures": pictures, "scene": run.scene, "machine_name": run.machine_flag(), "preview_of": run.preview_of,
            })),
            "cycles": cycles,
            "tables": tables,
            "charts": charts,
        });
        files.retain(|name, _| [".png", ".csv", ".json"].iter().any(|end| name.ends_with(end)));
        Ok(Folder { told, files, run })
    }

    /// A file's bytes, if it is one of those that were there and still is a file in the folder.
    pub fn file(&self, name: &str) -> Option<Vec<u8>> {
        let path = self.files.get(name)?;
        let is_plain = fs::symlink_metadata(path).is_ok_and(|kind| kind.is_file());
        is_plain.then(|| fs::read(path).ok())?
    }
}

impl Run {
    fn new(report: &Value, whose: &str) -> Result<Self> {
        let lacks = |what: &str| Error::input(format!("{whose}: has no {what}: it is no report of `run`"));
        let count = |path: &str| report.pointer(path).and_then(Value::as_u64).ok_or_else(|| lacks(&path[1..].replace('/', ".")));
        let scene = report.pointer("/scene/name").and_then(Value::as_str).ok_or_else(|| lacks("scene.name"))?;
        let described = report.pointer("/machine/description").ok_or_else(|| lacks("machine.description"))?;
        let machine = machines::from_value(described, &format!("{whose}: machine.description"))?;
        fixed::elaborate(&machine).map_err(|error| Error::input(format!("{whose}: {error}")))?;
        for part in ["/accuracy/fixed_vs_golden", "/cycles/units", "/cost/units", "/signals", "/fragments", "/scene/camera"] {
            report.pointer(part).ok_or_else(|| lacks(&part[1..].replace('/', ".")))?;
        }
        let pair = |value: &Value| Some([value[0].as_u64()? as usize, value[1].as_u64()? as usize]);
        Ok(Run {
            scene: report.pointer("/host/scene_file").and_then(Value::as_str).unwrap_or(scene).into(),
            size: [count("/scene/width")? as usize, count("/scene/height")? as usize],
            preview_of: report.pointer("/preview/of").and_then(pair),
            machine,
            camera: report["scene"]["camera"].clone(),
            counts: [count("/scene/splats")?, count("/scene/fragments")?],
        })
    }

    /// The name by which `--machine` finds the machine; none of one that a file must describe.
    pub fn machine_flag(&self) -> Option<&str> {
        let name = &self.machine.name;
        Machine::named(name).filter(|named| *named == self.machine).map(|_| name.as_str())
    }
}

/// A JSON file that somebody else may have written.
fn read_json(path: &Path, whose: &str) -> Result<Value> {
    let input_error = |what: String| Error::input(format!("{whose}: {what}"));
    let length = fs::metadata(path).map_err(|e| input_error(format!("cannot be read: {e}")))?.len();
    if length > MOST_JSON_BYTES {
        return Err(input_error(format!("has {} MB; no file of splatsim has more than {}", length >> 20, MOST_JSON_BYTES >> 20)));
    }
    let text = fs::read_to_string(path).map_err(|e| input_error(format!("cannot be read: {e}")))?;
    serde_json::from_str(&text).map_err(|e| input_error(format!("is no JSON that splatsim wrote: {e}")))
}

/// Names of the pictures that are there, all of one size.
fn pictures(files: &BTreeMap<String, PathBuf>, size: [usize; 2], shown: &dyn Fn(&str) -> String) -> Result<Vec<&'static str>> {
    let mut found = Vec::new();
    for name in PICTURES {
        let file = format!("{name}.png");
        let Some(path) = files.get(&file) else { continue };
        let opened = image::ImageReader::open(path).map_err(|e| e.to_string()).and_then(|file| {
            let is_png = file.with_guessed_format().map_err(|e| e.to_string())?;
            is_png.into_dimensions().map_err(|e| e.to_string())
        });
        let (width, height) = opened.map_err(|e| Error::input(format!("{}: is no picture: {e}", shown(&file))))?;
        if [width as usize, height as usize] != size {
            let [columns, rows] = size;
            let told = format!("is {width}×{height}, and report.json is of {columns}×{rows}");
            return Err(Error::input(format!("{}: {told}: it is of another run", shown(&file))));
        }
        found.push(name);
    }
    Ok(found)
}

/// The rows of `sweep` and `search`, and the machine that they change.
fn points(table: &Table, plan: &Value, whose: &str) -> Result<Value> {
    let machine = plan.get("machine").ok_or_else(|| Error::input(format!("{whose}: has no machine: it is no plan of `sweep`")))?;
    machines::from_value(machine, &format!("{whose}: machine"))?;
    let columns =
        table.columns.iter().enumerate().map(|(at, (name, _))| (name.clone(), table.rows.iter().map(|row| row[at].clone()).collect()));
    let title = if plan.get("search").is_some() { "search" } else { "sweep" };
    Ok(json!({"title": title, "machine": machine, "columns": columns.map(column).collect::<Vec<_>>()}))
}

/// Objects down a path of lists, each with the scalars of those above it.
fn rows_of(value: &Value, path: &[&str]) -> Option<Vec<Map<String, Value>>> {
    let Some((list, rest)) = path.split_first() else {
        let mut row = Map::new();
        flatten(value, "", &mut row);
        return value.is_object().then_some(vec![row]);
    };
    let mut own = Map::new();
    let scalars = value.as_object()?.iter().filter(|(_, value)| !value.is_array() && !value.is_object());
    scalars.filter(|(name, _)| *name != "version").for_each(|(name, value)| _ = own.insert(name.clone(), value.clone()));
    let mut rows = Vec::new();
    for item in value.get(list)?.as_array()? {
        for row in rows_of(item, rest)? {
            let mut all = own.clone();
            all.extend(row);
            rows.push(all);
        }
    }
    Some(rows)
}

/// Objects become names with dots, lists of numbers one column a place, other lists text.
fn flatten(value: &Value, name: &str, row: &mut Map<String, Value>) {
    let below = |part: &str| if name.is_empty() { part.to_owned() } else { format!("{name}.{part}") };
    match value {
        Value::Object(fields) => fields.iter().for_each(|(part, value)| flatten(value, &below(part), row)),
        Value::Array(items) if items.len() == 1 => flatten(&items[0], name, row),
        Value::Array(items) if items.iter().any(Value::is_string) => {
            let texts: Vec<String> = items.iter().map(|item| item.as_str().map_or_else(|| item.to_string(), str::to_owned)).collect();
            row.insert(name.into(), Value::from(texts.join(" ")));
        }
        Value::Array(items) => items.iter().enumerate().for_each(|(at, value)| flatten(value, &below(&at.to_string()), row)),
        scalar => _ = row.insert(name.into(), scalar.clone()),
    }
}

fn table_of(title: &str, rows: Vec<Map<String, Value>>) -> Value {
    let mut known = BTreeSet::new();
    let names: Vec<&String> = rows.iter().flat_map(Map::keys).filter(|name| known.insert(*name)).collect();
    let columns = names.into_iter().map(|name| {
        let values = rows.iter().map(|row| row.get(name).cloned().unwrap_or(Value::Null)).collect();
        column((name.clone(), values))
    });
    json!({"title": title, "machine": null, "columns": columns.collect::<Vec<_>>()})
}

/// A column: all of its values, or the one that all rows have.
fn column((name, values): (String, Vec<Value>)) -> Value {
    let is_number = values.iter().all(|value| value.is_number() || value.is_null());
    let kind = if is_number && values.iter().any(Value::is_number) { "number" } else { "text" };
    let is_same = values.windows(2).all(|pair| pair[0] == pair[1]);
    let rows = values.len();
    if is_same {
        json!({"name": name, "kind": kind, "rows": rows, "same": values.first()})
    } else {
        json!({"name": name, "kind": kind, "values": values})
    }
}

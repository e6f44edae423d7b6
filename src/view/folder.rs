//! Folder: reads what `run`, `replay`, `sweep`, `search` or `stress` wrote into a folder, as one
//! value from which the page is built.
//!
//! ```text
//! report.json, fixed.png …     ─► run      (frame, machine)
//! report.json, frame_0000_…    ─► sequence (frames, rows)
//! cycles.json                  ─► cycles   (machine)
//! tiles.csv                    ─► tiles    (frame, machine)
//! compare.json, a.png …        ─► compare
//! points.jsonl, plan.json      ─┐
//! choices.json, stress.json    ─┴► tables  (rows, their machine)
//! other PNGs                   ─► charts
//! ```
//! Files are listed once, by name. Later requests are looked up in that list, so a requested name
//! is never used as a path.

use crate::error::{Error, Result};
use crate::explore::sweep::table::Table;
use crate::hardware::datapath::{Layout, Placed};
use crate::hardware::{fixed, machines};
use crate::input;
use crate::output::text::plain;
use rtl_model::Machine;
use rtl_model::pipeline::rtl::{self, Words};
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Pictures of a frame, in the order of their keys.
pub const PICTURES: [&str; 5] = ["fixed", "golden", "ideal", "error", "flips"];
/// Greatest number of charts.
const MOST_CHARTS: usize = 64;
/// Greatest number of bytes of a file: a report of the largest machine has a thousandth.
const MOST_BYTES: u64 = 256 << 20;
/// Greatest number of cells of a table; every 64 bytes of a name or text count as one more cell.
const MOST_CELLS: usize = 10_000_000;
/// Greatest length of a text that is repeated in each row below it; longer texts are left out.
const MOST_REPEATED_BYTES: usize = 1 << 10;

/// A folder that can be shown.
#[derive(Debug)]
pub struct ResultFolder {
    /// All data for the page.
    pub contents: Value,
    /// Files that can be requested, by name.
    pub files: BTreeMap<String, Listed>,
    /// The frame that can be redrawn, if any.
    pub run: Option<DrawnRun>,
}

/// A file in its state when the folder was read.
#[derive(Clone, Debug)]
pub struct Listed {
    path: PathBuf,
    length: u64,
    modified: Option<SystemTime>,
}

impl Listed {
    fn new(path: PathBuf) -> std::io::Result<Self> {
        let metadata = fs::symlink_metadata(&path)?;
        Ok(Listed {
            path,
            length: metadata.len(),
            modified: metadata.modified().ok(),
        })
    }

    /// Its bytes; or a status, and the rest of a sentence after the file's name.
    fn read(&self) -> std::result::Result<Vec<u8>, (u16, String)> {
        if self.length > MOST_BYTES {
            let what = format!(
                "has {} MB; a file of splatsim has at most {}",
                self.length >> 20,
                MOST_BYTES >> 20
            );
            return Err((413, what));
        }
        let changed = || {
            (
                409,
                "has changed since view read the folder: restart view".to_owned(),
            )
        };
        let is_same = |metadata: &fs::Metadata| {
            metadata.is_file()
                && metadata.len() == self.length
                && metadata.modified().ok() == self.modified
        };
        // A link or a pipe in its place is not opened.
        fs::symlink_metadata(&self.path)
            .ok()
            .filter(is_same)
            .ok_or_else(changed)?;
        let cannot = |e: std::io::Error| (404, format!("cannot be read: {e}"));
        let file = File::open(&self.path).map_err(cannot)?;
        let mut bytes = Vec::new();
        (&file)
            .take(self.length + 1)
            .read_to_end(&mut bytes)
            .map_err(cannot)?;
        let is_whole = bytes.len() as u64 == self.length
            && file.metadata().is_ok_and(|metadata| is_same(&metadata));
        if is_whole { Ok(bytes) } else { Err(changed()) }
    }
}

/// A frame drawn by `run`.
#[derive(Clone, Debug)]
pub struct DrawnRun {
    /// The scene's file, or a built-in name.
    pub scene: String,
    /// Frame number in a sequence.
    pub frame: usize,
    /// Columns and rows of the picture.
    pub size: [usize; 2],
    /// Columns and rows of the whole picture, if this is a preview.
    pub preview_of: Option<[usize; 2]>,
    /// The machine.
    pub machine: Machine,
    /// The camera in the report.
    pub camera: Value,
    /// Splats, and contributions of the machine.
    pub counts: [u64; 2],
    /// Metrics of fixed against golden, and of golden against ideal, in the report.
    pub accuracy: [Value; 2],
}

impl ResultFolder {
    /// Reads a folder.
    ///
    /// # Errors
    /// [`Error::Input`], one sentence that names the file, if the folder contains nothing that can
    /// be shown, or a file is broken or of another kind.
    pub fn read(folder: &Path) -> Result<Self> {
        let cannot =
            |e: std::io::Error| Error::input(format!("{}: cannot be read: {e}", folder.display()));
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
            // Links are never followed: they may lead out of the folder.
            let is_plain = entry.file_type().is_ok_and(|kind| kind.is_file());
            let Ok(name) = entry.file_name().into_string() else {
                continue;
            };
            let listed = Listed::new(entry.path()).map_err(cannot)?;
            if is_journal(&name) {
                // The reader of rows opens every file with such a name.
                let refused = |what: &str| {
                    Err(Error::input(format!(
                        "{}: {what}",
                        folder.join(&name).display()
                    )))
                };
                if !is_plain {
                    return refused("is a link or not a file: rows are read from plain files");
                }
                if listed.length > MOST_BYTES {
                    return refused(&format!(
                        "has {} MB; view shows rows of at most {}",
                        listed.length >> 20,
                        MOST_BYTES >> 20
                    ));
                }
            }
            if is_plain {
                files.insert(name, listed);
            }
        }
        let shown = |name: &str| folder.join(name).display().to_string();
        let value = |name: &str| {
            files
                .get(name)
                .map(|listed| read_json(listed, &shown(name)))
                .transpose()
        };
        let report = value("report.json")?;
        let (sequences, reports): (Option<&Value>, Option<&Value>) = match &report {
            Some(report) if report.get("frames").is_some_and(Value::is_array) => {
                (Some(report), None)
            }
            other => (None, other.as_ref()),
        };
        let run = reports
            .map(|report| DrawnRun::new(report, &shown("report.json")))
            .transpose()?;
        let sequence = sequences
            .map(|report| sequence(report, &files, &shown))
            .transpose()?;
        let pictures = run
            .as_ref()
            .map_or(Ok(Vec::new()), |run| pictures(&files, run.size, &shown))?;
        let cycles = value("cycles.json")?;
        if cycles
            .as_ref()
            .is_some_and(|cycles| !cycles["units"].is_array() || !cycles["total"].is_u64())
        {
            return Err(Error::input(format!(
                "{}: is not an account of cycles as `replay` writes it",
                shown("cycles.json")
            )));
        }
        let compare = value("compare.json")?;
        if compare
            .as_ref()
            .is_some_and(|compare| !compare["figures"].is_array() || !compare["a"].is_object())
        {
            return Err(Error::input(format!(
                "{}: is not a comparison as `compare --out` writes it",
                shown("compare.json")
            )));
        }
        let mut tables = Vec::new();
        if files.keys().any(|name| is_journal(name)) {
            let plan = value("plan.json")?.ok_or_else(|| {
                Error::input(format!(
                    "{}: is missing next to the rows",
                    shown("plan.json")
                ))
            })?;
            tables.push(points(&Table::read(folder)?, &plan, &shown("plan.json"))?);
        }
        for (name, title, path) in [
            ("choices.json", "rules for fragments", &["choices"][..]),
            (
                "stress.json",
                "stress cases",
                &["cases", "machines", "points"],
            ),
        ] {
            if let Some(value) = value(name)? {
                let too_many = || {
                    Error::input(format!(
                        "{}: has more than 10,000,000 cells, which view cannot show",
                        shown(name)
                    ))
                };
                let mut left = CellBudget(MOST_CELLS);
                let rows = rows_of(&value, path, &mut left)
                    .map_err(|_| too_many())?
                    .filter(|rows| !rows.is_empty());
                let rows = rows.ok_or_else(|| {
                    Error::input(format!(
                        "{}: has no {}, as splatsim writes them",
                        shown(name),
                        path[0]
                    ))
                })?;
                tables.push(table_of(title, rows).map_err(|_| too_many())?);
            }
        }
        if let Some(report) = sequences {
            let too_many = || {
                Error::input(format!(
                    "{}: has more than 10,000,000 cells, which view cannot show",
                    shown("report.json")
                ))
            };
            let rows = report["frames"]
                .as_array()
                .into_iter()
                .flatten()
                .map(|frame| {
                    let mut row = Map::new();
                    flatten(frame, "", &mut row, &mut CellBudget(MOST_CELLS)).map(|()| row)
                });
            let rows = rows
                .collect::<std::result::Result<Vec<_>, _>>()
                .map_err(|_| too_many())?;
            tables.push(table_of("frames", rows).map_err(|_| too_many())?);
        }
        let is_chart = |name: &&String| {
            let stem = name
                .strip_suffix(".png")
                .filter(|stem| !is_of_sequence(stem));
            stem.is_some_and(|stem| !PICTURES.contains(&stem))
        };
        let charts: Vec<&String> = files.keys().filter(is_chart).take(MOST_CHARTS).collect();
        if run.is_none()
            && sequence.is_none()
            && cycles.is_none()
            && compare.is_none()
            && tables.is_empty()
        {
            let is_picture = |name: &String| {
                PICTURES.contains(&name.strip_suffix(".png").unwrap_or(name))
                    || is_of_sequence(name.trim_end_matches(".png"))
            };
            if files.keys().any(is_picture) {
                let reason = "has pictures of a run and no report.json, which is written last: the run was interrupted or is still running";
                return Err(Error::input(format!("{}: {reason}", folder.display())));
            }
            let reason = "holds nothing that view shows: no report.json, points.jsonl, choices.json, stress.json, cycles.json or compare.json";
            return Err(Error::input(format!("{}: {reason}", folder.display())));
        }
        // Files of an earlier run on a binned machine do not belong to this frame.
        let units = reports
            .map(|report| &report["cycles"]["units"])
            .or(cycles.as_ref().map(|cycles| &cycles["units"]));
        let has_tiles = units
            .and_then(Value::as_array)
            .is_some_and(|units| units.iter().any(|unit| unit["name"] == "list"));
        let name = root
            .file_name()
            .map_or_else(|| "/".into(), |name| name.to_string_lossy().into_owned());
        let contents = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "name": name,
            "run": run.as_ref().map(|run| json!({
                "report": report, "pictures": pictures, "scene": run.scene, "machine_name": run.machine_flag(), "preview_of": run.preview_of,
                "datapaths": datapaths(&run.machine),
            })),
            "sequence": sequence,
            "cycles": cycles,
            "tiles": has_tiles && files.contains_key("tiles.csv"),
            "compare": compare,
            "tables": tables,
            "charts": charts,
        });
        files.retain(|name, _| {
            [".png", ".csv", ".json"]
                .iter()
                .any(|end| name.ends_with(end))
        });
        Ok(ResultFolder {
            contents,
            files,
            run,
        })
    }

    /// Bytes of a file, if it was listed and has not changed.
    ///
    /// # Errors
    /// A status of HTTP and a sentence: 404 if it is not listed, 409 if it has changed, 413 if it
    /// is too large.
    pub fn file(&self, name: &str) -> std::result::Result<Vec<u8>, (u16, String)> {
        let listed = self
            .files
            .get(name)
            .ok_or((404, format!("{name}: not found")))?;
        listed
            .read()
            .map_err(|(status, what)| (status, format!("{name}: {what}")))
    }

    /// Name of the folder.
    pub fn name(&self) -> &str {
        self.contents["name"].as_str().unwrap_or_default()
    }

    /// Files of the pictures that the page shows.
    pub fn pictures(&self) -> Vec<String> {
        let names = |value: &Value| {
            value
                .as_array()
                .into_iter()
                .flatten()
                .filter_map(Value::as_str)
                .map(str::to_owned)
                .collect::<Vec<_>>()
        };
        if let Some(sequence) = self
            .contents
            .get("sequence")
            .filter(|sequence| sequence.is_object())
        {
            let frames = sequence["report"]["frames"].as_array().map_or(0, Vec::len);
            let kinds = sequence["kinds"]
                .as_array()
                .into_iter()
                .flatten()
                .filter_map(Value::as_str);
            let kinds: Vec<&str> = kinds.collect();
            return (0..frames)
                .flat_map(|frame| kinds.iter().map(move |kind| frame_name(frame, kind)))
                .chain(names(&self.contents["charts"]))
                .collect();
        }
        let of_run = names(&self.contents["run"]["pictures"])
            .into_iter()
            .map(|name| format!("{name}.png"));
        of_run.chain(names(&self.contents["charts"])).collect()
    }
}

/// The words of each graph, with their places in its picture.
fn datapaths(machine: &Machine) -> Value {
    let Ok(elaborated) = fixed::elaborate(machine) else {
        return json!([]);
    };
    let of = |graph: &Words| {
        let layout = Layout::new(&graph.words);
        let word = |Placed { word, x, y }: &Placed| json!({"name": word.name, "format": word.format, "wires": word.wires, "from": word.from, "x": x, "y": y});
        json!({
            "unit": graph.unit, "name": graph.name, "size_px": layout.size_px,
            "words": layout.words.iter().map(word).collect::<Vec<_>>(),
        })
    };
    rtl::words(&elaborated).iter().map(of).collect()
}

impl DrawnRun {
    fn new(report: &Value, whose: &str) -> Result<Self> {
        let lacks = |what: &str| {
            Error::input(format!(
                "{whose}: has no {what}: it is not a report of `run`"
            ))
        };
        let count = |path: &str| {
            report
                .pointer(path)
                .and_then(Value::as_u64)
                .ok_or_else(|| lacks(&path[1..].replace('/', ".")))
        };
        let scene = report
            .pointer("/scene/name")
            .and_then(Value::as_str)
            .ok_or_else(|| lacks("scene.name"))?;
        let described = report
            .pointer("/machine/description")
            .ok_or_else(|| lacks("machine.description"))?;
        let machine = machines::from_value(described, &format!("{whose}: machine.description"))?;
        fixed::elaborate(&machine).map_err(|error| Error::input(format!("{whose}: {error}")))?;
        for part in [
            "/accuracy/fixed_vs_golden",
            "/cycles/units",
            "/cost/units",
            "/signals",
            "/fragments",
            "/scene/camera",
        ] {
            report
                .pointer(part)
                .ok_or_else(|| lacks(&part[1..].replace('/', ".")))?;
        }
        let pair = |value: &Value| Some([value[0].as_u64()? as usize, value[1].as_u64()? as usize]);
        Ok(DrawnRun {
            scene: report
                .pointer("/host/scene_file")
                .and_then(Value::as_str)
                .unwrap_or(scene)
                .into(),
            frame: report
                .pointer("/scene/frame")
                .and_then(Value::as_u64)
                .unwrap_or(0) as usize,
            size: [
                count("/scene/width")? as usize,
                count("/scene/height")? as usize,
            ],
            preview_of: report.pointer("/preview/of").and_then(pair),
            machine,
            camera: report["scene"]["camera"].clone(),
            counts: [count("/scene/splats")?, count("/scene/fragments")?],
            accuracy: ["fixed_vs_golden", "golden_vs_ideal"]
                .map(|pair| report["accuracy"][pair].clone()),
        })
    }

    /// The name by which `--machine` finds the machine; none if it needs a machine file.
    pub fn machine_flag(&self) -> Option<&str> {
        let name = &self.machine.name;
        Machine::named(name)
            .filter(|named| *named == self.machine)
            .map(|_| name.as_str())
    }
}

/// File name of a picture of a frame, as written by `run`.
fn frame_name(frame: usize, kind: &str) -> String {
    format!("frame_{frame:04}_{kind}.png")
}

/// Whether the name of a picture, without extension, is that of a frame.
fn is_of_sequence(stem: &str) -> bool {
    let parts = stem
        .strip_prefix("frame_")
        .and_then(|rest| rest.split_once('_'));
    parts.is_some_and(|(number, kind)| {
        number.bytes().all(|digit| digit.is_ascii_digit()) && PICTURES.contains(&kind)
    })
}

/// A sequence drawn by `run`: its report, and the kinds of pictures that every frame has.
fn sequence(
    report: &Value,
    files: &BTreeMap<String, Listed>,
    shown: &dyn Fn(&str) -> String,
) -> Result<Value> {
    let whose = shown("report.json");
    let lacks = |what: &str| {
        Error::input(format!(
            "{whose}: has no {what}: it is not a report of `run` on a sequence"
        ))
    };
    for part in [
        "/scene/width",
        "/scene/height",
        "/machine/description/name",
        "/spreads/frames_per_second",
    ] {
        report
            .pointer(part)
            .ok_or_else(|| lacks(&part[1..].replace('/', ".")))?;
    }
    let frames = report["frames"]
        .as_array()
        .filter(|frames| !frames.is_empty())
        .ok_or_else(|| lacks("frames"))?;
    for frame in frames {
        for part in [
            "/cycles",
            "/frames_per_second",
            "/accuracy/fixed_vs_golden",
            "/accuracy/golden_vs_ideal",
        ] {
            frame
                .pointer(part)
                .ok_or_else(|| lacks(&format!("frames[].{}", part[1..].replace('/', "."))))?;
        }
    }
    let is_whole =
        |kind: &&str| (0..frames.len()).all(|frame| files.contains_key(&frame_name(frame, kind)));
    let kinds: Vec<&str> = PICTURES.into_iter().filter(is_whole).collect();
    Ok(json!({"report": report, "kinds": kinds}))
}

/// Reads a JSON file, which another program may have written.
fn read_json(listed: &Listed, whose: &str) -> Result<Value> {
    let input_error = |what: String| Error::input(format!("{whose}: {what}"));
    let bytes = listed.read().map_err(|(_, what)| input_error(what))?;
    let text = String::from_utf8(bytes).map_err(|e| input_error(format!("cannot be read: {e}")))?;
    serde_json::from_str(input::without_mark(&text))
        .map_err(|e| input_error(format!("is not JSON that splatsim wrote: {e}")))
}

/// Whether a file contains rows, by its name.
fn is_journal(name: &str) -> bool {
    name.starts_with("points") && name.ends_with(".jsonl")
}

/// Names of the existing pictures, which have the same size.
fn pictures(
    files: &BTreeMap<String, Listed>,
    size: [usize; 2],
    shown: &dyn Fn(&str) -> String,
) -> Result<Vec<&'static str>> {
    let mut found = Vec::new();
    for name in PICTURES {
        let file = format!("{name}.png");
        let Some(listed) = files.get(&file) else {
            continue;
        };
        let opened = image::ImageReader::open(&listed.path)
            .map_err(|e| e.to_string())
            .and_then(|file| {
                let is_png = file.with_guessed_format().map_err(|e| e.to_string())?;
                is_png.into_dimensions().map_err(|e| e.to_string())
            });
        let (width, height) =
            opened.map_err(|e| Error::input(format!("{}: is not a picture: {e}", shown(&file))))?;
        if [width as usize, height as usize] != size {
            let [columns, rows] = size;
            let sizes = format!("is {width}×{height}, and report.json is of {columns}×{rows}");
            return Err(Error::input(format!(
                "{}: {sizes}: it is of another run",
                shown(&file)
            )));
        }
        found.push(name);
    }
    Ok(found)
}

/// The rows of `sweep` and `search`, and the machine that they modify.
fn points(table: &Table, plan: &Value, whose: &str) -> Result<Value> {
    let machine = plan.get("machine").ok_or_else(|| {
        Error::input(format!(
            "{whose}: has no machine: it is not a plan of `sweep`"
        ))
    })?;
    machines::from_value(machine, &format!("{whose}: machine"))?;
    let columns = table.columns.iter().enumerate().map(|(at, (name, _))| {
        (
            name.clone(),
            table.rows.iter().map(|row| row[at].clone()).collect(),
        )
    });
    let title = if ["search", "search_over_timing"]
        .iter()
        .any(|name| plan.get(name).is_some())
    {
        "search"
    } else {
        "sweep"
    };
    Ok(
        json!({"title": title, "machine": machine, "columns": columns.map(column).collect::<Vec<_>>()}),
    )
}

/// Number of further cells that a table may have.
struct CellBudget(usize);

/// A table has too many cells.
struct TooMany;

impl CellBudget {
    fn take(&mut self, name: &str, value: &Value) -> std::result::Result<(), TooMany> {
        let bytes = name.len() + value.as_str().map_or(0, str::len);
        self.0 = self.0.checked_sub(1 + bytes / 64).ok_or(TooMany)?;
        Ok(())
    }
}

/// Objects at a path of lists, each with the scalars of its ancestors; none if they are absent.
fn rows_of(
    value: &Value,
    path: &[&str],
    left: &mut CellBudget,
) -> std::result::Result<Option<Vec<Map<String, Value>>>, TooMany> {
    let Some((list, rest)) = path.split_first() else {
        let mut row = Map::new();
        flatten(value, "", &mut row, left)?;
        return Ok(value.is_object().then_some(vec![row]));
    };
    let Some((fields, items)) = value
        .as_object()
        .zip(value.get(list).and_then(Value::as_array))
    else {
        return Ok(None);
    };
    let is_repeated = |name: &str, value: &Value| {
        let length = name.len() + value.as_str().map_or(0, str::len);
        name != "version"
            && !value.is_array()
            && !value.is_object()
            && length <= MOST_REPEATED_BYTES
    };
    let own = fields
        .iter()
        .filter(|(name, value)| is_repeated(name, value))
        .map(|(name, value)| (name.clone(), value.clone()));
    let own: Map<String, Value> = own.collect();
    let mut rows = Vec::new();
    for item in items {
        let Some(below) = rows_of(item, rest, left)? else {
            return Ok(None);
        };
        for row in below {
            own.iter()
                .try_for_each(|(name, value)| left.take(name, value))?;
            let mut all = own.clone();
            all.extend(row);
            rows.push(all);
        }
    }
    Ok(Some(rows))
}

/// Flattens objects to names with dots, lists of numbers to one column per position, and other
/// lists to text.
fn flatten(
    value: &Value,
    name: &str,
    row: &mut Map<String, Value>,
    left: &mut CellBudget,
) -> std::result::Result<(), TooMany> {
    let below = |part: &str| {
        if name.is_empty() {
            part.to_owned()
        } else {
            format!("{name}.{part}")
        }
    };
    // Names grow with the depth of the tree, so they also count where they are created.
    left.take(name, &Value::Null)?;
    let scalar = match value {
        Value::Object(fields) => {
            return fields
                .iter()
                .try_for_each(|(part, value)| flatten(value, &below(part), row, left));
        }
        Value::Array(items) if items.len() == 1 => return flatten(&items[0], name, row, left),
        Value::Array(items) if items.iter().any(Value::is_string) => {
            let texts: Vec<String> = items.iter().map(plain).collect();
            Value::from(texts.join(" "))
        }
        Value::Array(items) => {
            return items
                .iter()
                .enumerate()
                .try_for_each(|(at, value)| flatten(value, &below(&at.to_string()), row, left));
        }
        scalar => scalar.clone(),
    };
    row.insert(name.into(), scalar);
    Ok(())
}

fn table_of(title: &str, rows: Vec<Map<String, Value>>) -> std::result::Result<Value, TooMany> {
    let mut known = BTreeSet::new();
    let names: Vec<&String> = rows
        .iter()
        .flat_map(Map::keys)
        .filter(|name| known.insert(*name))
        .collect();
    if rows.len().saturating_mul(names.len()) > MOST_CELLS {
        return Err(TooMany);
    }
    let columns = names.into_iter().map(|name| {
        let values = rows
            .iter()
            .map(|row| row.get(name).cloned().unwrap_or(Value::Null))
            .collect();
        column((name.clone(), values))
    });
    Ok(json!({"title": title, "machine": null, "columns": columns.collect::<Vec<_>>()}))
}

/// A column: all of its values, or a single one if all rows have the same.
fn column((name, values): (String, Vec<Value>)) -> Value {
    let is_number = values
        .iter()
        .all(|value| value.is_number() || value.is_null());
    let kind = if is_number && values.iter().any(Value::is_number) {
        "number"
    } else {
        "text"
    };
    let is_same = values.windows(2).all(|pair| pair[0] == pair[1]);
    let rows = values.len();
    if is_same {
        json!({"name": name, "kind": kind, "rows": rows, "same": values.first()})
    } else {
        json!({"name": name, "kind": kind, "values": values})
    }
}

//! Machines: finds a machine by name or file, applies changes, and publishes the schema that it is
//! checked against.

use crate::error::{Error, Result};
use crate::hardware::searched::SearchRecord;
use crate::output::text::{clipped, is_unprintable, one_line};
use crate::scene::{Scene, strict_json, validate};
use rtl_model::Machine;
use rtl_model::machine::timing::Memory;
use rtl_model::num::Format;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::{Map, Value};
use std::ffi::OsStr;
use std::path::Path;
use std::sync::LazyLock;

/// Limit on the steps of a path, a few times what any field of a machine needs. Much deeper values
/// would exhaust the stack.
const MOST_STEPS: usize = 16;

/// A machine file: the machine, and its search record.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct File {
    /// The machine.
    #[serde(flatten)]
    pub machine: Machine,
    /// Target and scenes of the search; absent for a machine that was not searched.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub searched: Option<SearchRecord>,
}

/// Fields of a machine file outside the machine. No drawing depends on them.
#[derive(JsonSchema)]
#[expect(dead_code, reason = "only its schema is used")]
struct Besides {
    /// Target and scenes of the search: `search` writes it, and `run` warns where the machine is
    /// used outside of them.
    searched: Option<SearchRecord>,
}

impl File {
    /// The machine for drawing a scene: a walker is added if the scene has a tree.
    pub fn on(mut self, scene: &Scene) -> Self {
        pay(&mut self.machine, scene.detail.is_some());
        self
    }

    /// How a scene differs from those that the machine was searched for; `None` for a machine
    /// without a search record. `is_changed`: a setting changed the picture.
    pub fn outside(&self, scene: &Scene, is_changed: bool) -> Option<Vec<String>> {
        let mut outside = self.searched.as_ref()?.outside(scene);
        outside.extend(is_changed.then(|| "a word that --set changed".to_owned()));
        Some(outside)
    }
}

/// Adds the default walker to a machine without one that walks a tree, so that its area is counted.
pub fn pay(machine: &mut Machine, is_walked: bool) {
    if is_walked {
        machine.timing.walk.get_or_insert_default();
    }
}

/// Loads the machine `spec` (a name, or the path of a JSON file), and applies `--set PATH=VALUE`
/// changes in order.
///
/// # Errors
/// [`Error::Input`], one sentence naming the file or the setting, the field, the fault, and a valid
/// value.
pub fn load(spec: impl AsRef<OsStr>, settings: &[String]) -> Result<Machine> {
    load_file(spec, settings).map(|file| file.machine)
}

/// Loads a machine with its search record, which settings do not change.
///
/// # Errors
/// As [`load`].
pub fn load_file(spec: impl AsRef<OsStr>, settings: &[String]) -> Result<File> {
    let path = Path::new(spec.as_ref());
    let name = &*path.to_string_lossy();
    let (mut value, searched) = match Machine::named(name) {
        Some(machine) if !path.is_file() => (value(&machine), None),
        _ => read(path)?,
    };
    let mut machine = checked(&value, name)?;
    for setting in settings {
        set(&mut value, setting, &flag("--set", setting))?;
    }
    if !settings.is_empty() {
        machine = checked(&value, name)?;
    }
    Ok(File { machine, searched })
}

/// Whether a setting changes the picture, not only time.
pub fn changes_picture(setting: &str) -> bool {
    !is_below(
        setting.split('=').next().unwrap_or_default().trim(),
        "timing",
    )
}

/// A flag and its argument, for the beginning of an error.
pub fn flag(flag: &str, setting: &str) -> String {
    const LONGEST: usize = 200;
    format!(
        "{flag} {}",
        if setting.len() <= LONGEST {
            setting.into()
        } else {
            clipped(setting)
        }
    )
}

/// Name of the default machine for a scene.
pub fn usual(scene: &Scene) -> &'static str {
    match (&scene.ellipsoids, &scene.sheets) {
        (Some(ellipsoids), _) if ellipsoids.sorted => "gaussian",
        (None, None) => Machine::NAMES[0],
        _ => "volume",
    }
}

/// A machine with one field changed by `flag`.
///
/// # Errors
/// As [`load`].
pub fn changed(machine: &Machine, setting: &str, flag: &str) -> Result<Machine> {
    set(&mut value(machine), setting, flag)
}

/// A machine with fields changed, each as PATH and a JSON value.
///
/// # Errors
/// [`Error::Input`], beginning with `whose`, for an unknown field or an invalid value.
pub fn with(machine: &Machine, changes: &[(String, Value)], whose: &str) -> Result<Machine> {
    let mut value = value(machine);
    for (path, leaf) in changes {
        check_depth(path, whose)?;
        lay(&mut value, path, leaf.clone());
    }
    checked(&value, whose)
}

/// Refuses a machine whose pictures depend on the frames before them, where frames of a sequence are
/// drawn alone. `what` draws them.
///
/// # Errors
/// [`Error::Input`] with what would be right.
pub fn draws_alone(machine: &Machine, what: &str) -> Result<()> {
    if machine.keeps_lists().is_none() {
        return Ok(());
    }
    Err(Error::input(format!(
        "machine {} keeps lists from frame to frame (sort.kind incremental), and {what}: draw the sequence with `run`, or let sort.kind be tile",
        machine.name
    )))
}

/// A machine that is part of a file.
///
/// # Errors
/// [`Error::Input`], beginning with `whose`, where the value is not a machine.
pub fn from_value(value: &Value, whose: &str) -> Result<Machine> {
    checked(value, whose)
}

/// Every word of a machine that can be set, as PATH and format.
pub fn words(machine: &Machine) -> Vec<(String, Format)> {
    let mut words = Vec::new();
    gather(&value(machine), "", &mut words);
    words
}

fn gather(value: &Value, path: &str, words: &mut Vec<(String, Format)>) {
    let Value::Object(fields) = value else { return };
    for (name, field) in fields {
        let path = format!("{path}{name}");
        let format = field
            .get("format")
            .unwrap_or(field)
            .as_str()
            .and_then(|text| text.parse().ok());
        match format {
            Some(format) => words.push((path, format)),
            None => gather(field, &format!("{path}."), words),
        }
    }
}

/// The JSON pointer of a field: `/gauss/weight` of `gauss.weight`.
pub fn pointer(path: &str) -> String {
    format!("/{}", path.replace('.', "/"))
}

/// Sets one field of a machine, unchecked. The path must be one of a machine.
pub fn lay(fields: &mut Value, path: &str, leaf: Value) {
    lay_over(fields, nested(path, whole(leaf)));
}

/// Sets fields of a machine. A preset of memory replaces earlier values of the fields that it
/// fills.
fn lay_over(fields: &mut Value, changes: Value) {
    let has_preset = changes
        .pointer("/timing/memory/preset")
        .is_some_and(Value::is_string);
    if let (true, Some(Value::Object(memory))) = (has_preset, fields.pointer_mut("/timing/memory"))
    {
        Memory::FILLED
            .iter()
            .for_each(|field| drop(memory.remove(*field)));
    }
    merge(fields, changes);
}

/// Refuses a path with too many steps, before a value of that depth is made.
fn check_depth(path: &str, whose: &str) -> Result<()> {
    let steps = path.split('.').count();
    if steps <= MOST_STEPS {
        return Ok(());
    }
    let sentence = format!(
        "{whose}: the path {} has {steps} steps; no field of a machine lies deeper than {MOST_STEPS}",
        clipped(path)
    );
    Err(Error::input(sentence))
}

/// The value with integers in place of integral numbers that are written with a point or an
/// exponent, such as 1e9.
pub fn whole(value: Value) -> Value {
    // Every integer up to this one is exact in f64.
    const LARGEST: f64 = 9_007_199_254_740_992.0;
    match value {
        Value::Number(number) => {
            let real = number
                .as_f64()
                .filter(|real| number.is_f64() && real.fract() == 0.0 && real.abs() <= LARGEST);
            real.map_or(Value::Number(number), |real| Value::from(real as i64))
        }
        Value::Array(items) => items.into_iter().map(whole).collect(),
        Value::Object(fields) => Value::Object(
            fields
                .into_iter()
                .map(|(name, field)| (name, whole(field)))
                .collect(),
        ),
        other => other,
    }
}

/// Whether `path` is `name` or a field of it: `gauss.weight` is below `gauss`.
pub fn is_below(path: &str, name: &str) -> bool {
    path.strip_prefix(name)
        .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

fn nested(path: &str, leaf: Value) -> Value {
    path.rsplit('.').fold(leaf, |inner, step| {
        Value::Object(Map::from_iter([(step.to_owned(), inner)]))
    })
}

fn set(value: &mut Value, setting: &str, flag: &str) -> Result<Machine> {
    let (path, leaf) = parse_setting(setting).ok_or_else(|| {
        Error::input(format!(
            "{flag}: write PATH=VALUE, as in gauss.falloff=U1F12"
        ))
    })?;
    check_depth(path, flag)?;
    lay(value, path, leaf);
    checked(value, flag)
}

/// The JSON Schema of a machine file.
pub fn schema() -> Value {
    let mut schema = schema_of_machine();
    let mut besides = schemars::schema_for!(Besides).to_value();
    for part in ["properties", "$defs"] {
        if let (Some(all), Some(more)) =
            (schema[part].as_object_mut(), besides[part].as_object_mut())
        {
            all.append(more);
        }
    }
    schema
}

fn schema_of_machine() -> Value {
    schemars::schema_for!(Machine).to_value()
}

/// A machine as JSON.
pub fn value(machine: &Machine) -> Value {
    serde_json::to_value(machine).unwrap_or_default()
}

/// Fields of a machine file, and its search record.
fn read(path: &Path) -> Result<(Value, Option<SearchRecord>)> {
    let name = &*path.to_string_lossy();
    let input_error = |sentence: String| Error::input(format!("{name}: {sentence}"));
    let named: Vec<&str> = Machine::names().collect();
    let names = named.join(", ");
    if !path.exists() {
        let nearest = validate::in_brackets(name, &named);
        return Err(input_error(format!(
            "no such file, and no named machine either; named are {names}{nearest}"
        )));
    }
    let value = strict_json::read(path).map_err(input_error)?;
    described(
        value,
        name,
        &one_line(&path.file_stem().unwrap_or_default().to_string_lossy()),
    )
}

/// A machine from a file's value, which may be a difference from a base. `whose` begins every
/// error; `usual_name` is its name where it has a base and no name.
///
/// # Errors
/// As [`load`].
pub fn from_description(value: Value, whose: &str, usual_name: &str) -> Result<File> {
    let (value, searched) = described(value, whose, usual_name)?;
    Ok(File {
        machine: checked(&value, whose)?,
        searched,
    })
}

fn described(value: Value, whose: &str, usual_name: &str) -> Result<(Value, Option<SearchRecord>)> {
    let input_error = |sentence: String| Error::input(format!("{whose}: {sentence}"));
    let Value::Object(mut fields) = whole(value) else {
        return Err(input_error("a machine is a JSON object".into()));
    };
    let searched = fields
        .remove("searched")
        .map(read_record)
        .transpose()
        .map_err(input_error)?;
    let Some(base) = fields.remove("base") else {
        return Ok((Value::Object(fields), searched));
    };
    let names = Machine::names().collect::<Vec<_>>().join(", ");
    let base = base
        .as_str()
        .and_then(Machine::named)
        .ok_or_else(|| input_error(format!("base must be one of {names}, but is {base}")))?;
    let mut value = self::value(&base);
    fields.entry("name").or_insert_with(|| usual_name.into());
    lay_over(&mut value, Value::Object(fields));
    Ok((value, searched))
}

/// Reads a search record; the error is a sentence.
fn read_record(value: Value) -> std::result::Result<SearchRecord, String> {
    validate::check(&value, &schemars::schema_for!(SearchRecord).to_value())
        .map_err(|error| format!("searched: {error}"))?;
    serde_path_to_error::deserialize(&value)
        .map_err(|e| format!("searched: {}: {}", e.path(), e.inner()))
}

fn checked(value: &Value, whose: &str) -> Result<Machine> {
    // A sweep checks thousands of machines.
    static SCHEMA: LazyLock<Value> = LazyLock::new(schema_of_machine);
    let input_error = |sentence: String| Error::input(format!("{whose}: {sentence}"));
    validate::check(value, &SCHEMA).map_err(|error| input_error(error.to_string()))?;
    let machine: Machine = serde_path_to_error::deserialize(value)
        .map_err(|e| input_error(format!("{}: {}", e.path(), e.inner())))?;
    // The name is copied into line comments of generated files.
    if machine.name.contains(is_unprintable) {
        return Err(input_error(format!(
            "name is `{}`; it must have no line breaks or other control characters",
            clipped(&machine.name)
        )));
    }
    Ok(machine)
}

/// Path and value of `a.b=c`; a value that is not JSON is text.
fn parse_setting(setting: &str) -> Option<(&str, Value)> {
    let (path, text) = setting.split_once('=')?;
    let leaf = strict_json::parse(text).unwrap_or_else(|_| Value::from(text));
    (!path.is_empty()).then_some((path, leaf))
}

/// Merges `change` into `value`, object by object. A word in short form is expanded where a part of
/// it changes. A word in long form keeps its rounding where only its format changes.
fn merge(value: &mut Value, change: Value) {
    match change {
        Value::String(format) if value.get("format").is_some() => value["format"] = format.into(),
        Value::Object(change) => {
            if let Value::String(format) = value {
                *value = Value::Object(Map::from_iter([(
                    "format".to_owned(),
                    Value::from(format.as_str()),
                )]));
            }
            if !value.is_object() {
                *value = Value::Object(Map::new());
            }
            let Value::Object(fields) = value else { return };
            for (name, change) in change {
                merge(fields.entry(name).or_insert(Value::Null), change);
            }
        }
        change => *value = change,
    }
}

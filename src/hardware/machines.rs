//! Machines: finds a machine by name or file, changes it as asked, and publishes the schema that it is held against.

use crate::error::{Error, Result};
use crate::scene::{Scene, validate};
use rtl_model::Machine;
use rtl_model::num::Format;
use serde_json::{Map, Value};
use std::path::Path;
use std::sync::LazyLock;

/// The machine called `spec` (a name, or the path of a JSON file), with `--set PATH=VALUE` changes applied in order.
///
/// # Errors
/// [`Error::Input`], one sentence naming the file or the setting, the field, what is wrong and what would be right.
pub fn load(spec: &str, settings: &[String]) -> Result<Machine> {
    let mut value = match Machine::named(spec) {
        Some(machine) if !Path::new(spec).exists() => value(&machine),
        _ => read(spec)?,
    };
    checked(&value, spec)?;
    for setting in settings {
        set(&mut value, setting, &format!("--set {setting}"))?;
    }
    checked(&value, spec)
}

/// The name of the machine that draws a scene where none is asked for.
pub fn usual(scene: &Scene) -> &'static str {
    match (&scene.ellipsoids, &scene.sheets) {
        (Some(ellipsoids), _) if ellipsoids.sorted => "gaussian",
        (None, None) => Machine::NAMES[0],
        _ => "volume",
    }
}

/// A machine with one field changed, as by `told`.
///
/// # Errors
/// As [`load`].
pub fn changed(machine: &Machine, setting: &str, told: &str) -> Result<Machine> {
    set(&mut value(machine), setting, told)
}

/// A machine with fields changed, each as PATH and a JSON value.
///
/// # Errors
/// [`Error::Input`], beginning with `told`, where it has no such field or the field no such value.
pub fn with(machine: &Machine, changes: &[(String, Value)], told: &str) -> Result<Machine> {
    let mut value = value(machine);
    for (path, leaf) in changes {
        lay(&mut value, path, leaf.clone());
    }
    checked(&value, told)
}

/// A machine that is part of a file.
///
/// # Errors
/// [`Error::Input`], beginning with `told`, where it is none.
pub fn from_value(value: &Value, told: &str) -> Result<Machine> {
    checked(value, told)
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
        let format = field.get("format").unwrap_or(field).as_str().and_then(|text| text.parse().ok());
        match format {
            Some(format) => words.push((path, format)),
            None => gather(field, &format!("{path}."), words),
        }
    }
}

/// Lays one change over a machine's fields, unchecked.
pub fn lay(fields: &mut Value, path: &str, leaf: Value) {
    merge(fields, nested(path, leaf));
}

/// Whether a path is another one, or leads there and further: `gauss.weight` is below `gauss`.
pub fn is_below(path: &str, name: &str) -> bool {
    path.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

fn nested(path: &str, leaf: Value) -> Value {
    path.rsplit('.').fold(leaf, |inner, step| Value::Object(Map::from_iter([(step.to_owned(), inner)])))
}

fn set(value: &mut Value, setting: &str, told: &str) -> Result<Machine> {
    let change = parse_setting(setting).ok_or_else(|| Error::input(format!("{told}: write PATH=VALUE, as in gauss.weight=U-2F16")))?;
    merge(value, change);
    checked(value, told)
}

/// The JSON Schema of a machine file.
pub fn schema() -> Value {
    schemars::schema_for!(Machine).to_value()
}

/// A machine as JSON.
pub fn value(machine: &Machine) -> Value {
    serde_json::to_value(machine).unwrap_or_default()
}

fn read(spec: &str) -> Result<Value> {
    let told = |sentence: String| Error::input(format!("{spec}: {sentence}"));
    let names = Machine::names().collect::<Vec<_>>().join(", ");
    if !Path::new(spec).exists() {
        return Err(told(format!("no such file, and no named machine either; named are {names}")));
    }
    let text = std::fs::read_to_string(spec).map_err(|e| told(format!("cannot be read: {e}")))?;
    let value: Value = serde_json::from_str(&text).map_err(|e| told(format!("not JSON: {e}")))?;
    let Value::Object(mut fields) = value else { return Err(told("a machine is a JSON object".into())) };
    let Some(base) = fields.remove("base") else { return Ok(Value::Object(fields)) };
    let base = base.as_str().and_then(Machine::named).ok_or_else(|| told(format!("base must be one of {names}, but is {base}")))?;
    let mut value = self::value(&base);
    fields.entry("name").or_insert_with(|| Path::new(spec).file_stem().unwrap_or_default().to_string_lossy().into());
    merge(&mut value, Value::Object(fields));
    Ok(value)
}

fn checked(value: &Value, told: &str) -> Result<Machine> {
    // A sweep asks a thousand times.
    static SCHEMA: LazyLock<Value> = LazyLock::new(schema);
    validate::check(value, &SCHEMA).map_err(|misfit| Error::input(format!("{told}: {misfit}")))?;
    serde_path_to_error::deserialize(value).map_err(|e| Error::input(format!("{told}: {}: {}", e.path(), e.inner())))
}

/// `a.b=c` as `{"a": {"b": c}}`; what is not JSON is text.
fn parse_setting(setting: &str) -> Option<Value> {
    let (path, text) = setting.split_once('=')?;
    let leaf = serde_json::from_str(text).unwrap_or_else(|_| Value::from(text));
    (!path.is_empty()).then(|| nested(path, leaf))
}

/// Lays `change` over `value`, object by object. A word in short form opens up where a part of it is changed; one in long form keeps its
/// rounding where its format alone is.
fn merge(value: &mut Value, change: Value) {
    match change {
        Value::String(format) if value.get("format").is_some() => value["format"] = format.into(),
        Value::Object(change) => {
            if let Value::String(format) = value {
                *value = Value::Object(Map::from_iter([("format".to_owned(), Value::from(format.as_str()))]));
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

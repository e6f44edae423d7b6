//! Validate: checks a JSON value against a JSON Schema, and reports the first violation in one
//! sentence.
//!
//! The schema is derived from the types that the value is read into, so published schema, check and
//! reader agree. Only the keywords of such schemas are implemented; all others are annotations.

use crate::output::text::clipped;
use serde_json::{Map, Value};

/// A violation: the path of the field, as in `lights[0].rgb`, and what is wrong.
#[derive(Debug)]
pub struct Violation {
    path: String,
    wrong: String,
}

impl std::fmt::Display for Violation {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self.path.trim_start_matches('.') {
            "" => write!(f, "{}", self.wrong),
            path => write!(f, "{path} {}", self.wrong),
        }
    }
}

impl Violation {
    fn here(wrong: impl Into<String>) -> Violation {
        Violation {
            path: String::new(),
            wrong: wrong.into(),
        }
    }

    fn inside(mut self, step: String) -> Violation {
        self.path.insert_str(0, &step);
        self
    }
}

type Fits = Result<(), Violation>;

/// Checks `value` against `schema`.
pub fn check(value: &Value, schema: &Value) -> Fits {
    Law { root: schema }.check(value, schema)
}

struct Law<'s> {
    root: &'s Value,
}

impl<'s> Law<'s> {
    fn check(&self, value: &Value, schema: &'s Value) -> Fits {
        let schema = self.resolve(schema);
        if let Some(options) = options(schema) {
            return self.check_options(value, options);
        }
        check_type(value, schema)?;
        match value {
            Value::Number(number) => check_range(number.as_f64().unwrap_or(f64::NAN), schema),
            Value::String(text) => check_words(text, schema),
            Value::Array(items) => self.check_items(items, schema),
            Value::Object(fields) => self.check_fields(fields, schema),
            _ => Ok(()),
        }
    }

    fn resolve(&self, schema: &'s Value) -> &'s Value {
        match schema["$ref"]
            .as_str()
            .and_then(|path| self.root.pointer(path.trim_start_matches('#')))
        {
            Some(target) => self.resolve(target),
            None => schema,
        }
    }

    fn check_items(&self, items: &[Value], schema: &'s Value) -> Fits {
        let (least, most) = (
            schema["minItems"].as_u64().unwrap_or(0),
            schema["maxItems"].as_u64().unwrap_or(u64::MAX),
        );
        let count = items.len() as u64;
        if count < least || count > most {
            let right = match () {
                () if least == most => format!("exactly {least}"),
                () if count > most => format!("at most {most}"),
                () => format!("at least {least}"),
            };
            return Err(Violation::here(format!(
                "has {count} entries; it must have {right}"
            )));
        }
        items.iter().enumerate().try_for_each(|(i, item)| {
            self.check(item, &schema["items"])
                .map_err(|violation| violation.inside(format!("[{i}]")))
        })
    }

    fn check_fields(&self, fields: &Map<String, Value>, schema: &'s Value) -> Fits {
        if schema.get("properties").is_none() && types(schema).is_empty() {
            // Any value is allowed.
            return Ok(());
        }
        let known = field_names(schema);
        check_known(fields, &known)?;
        if let Some(missing) = required(schema).find(|name| !fields.contains_key(*name)) {
            return Err(Violation::here(format!("lacks the field `{missing}`")));
        }
        fields.iter().try_for_each(|(name, value)| {
            self.check(value, &schema["properties"][name])
                .map_err(|violation| violation.inside(format!(".{name}")))
        })
    }

    /// Of several schemas, the one that matches the value's kind and fields is used.
    fn check_options(&self, value: &Value, options: &'s [Value]) -> Fits {
        let options: Vec<&Value> = options.iter().map(|option| self.resolve(option)).collect();
        // A null field counts as left out.
        if value.is_null() && options.iter().any(|option| option["type"] == "null") {
            return Ok(());
        }
        let words: Vec<&str> = options
            .iter()
            .filter_map(|option| option["const"].as_str())
            .collect();
        if let (Value::String(text), false) = (value, words.is_empty()) {
            return check_word(text, &words);
        }
        let alike: Vec<&Value> = options
            .iter()
            .copied()
            .filter(|option| check_type(value, option).is_ok())
            .collect();
        match (alike.as_slice(), value) {
            ([], _) => Err(wrong_type(
                value,
                options.iter().flat_map(|option| types(option)).collect(),
            )),
            ([only], _) => self.check(value, only),
            (several, Value::Object(fields)) => {
                self.check_fields_of_options(value, fields, several)
            }
            (several, _) => self.check(value, several[0]),
        }
    }

    fn check_fields_of_options(
        &self,
        value: &Value,
        fields: &Map<String, Value>,
        options: &[&'s Value],
    ) -> Fits {
        if let Some(meant) = options
            .iter()
            .find(|option| required(option).all(|name| fields.contains_key(name)))
        {
            return self.check(value, meant);
        }
        check_known(
            fields,
            &options
                .iter()
                .flat_map(|option| field_names(option))
                .collect::<Vec<_>>(),
        )?;
        let needed: Vec<String> = options
            .iter()
            .flat_map(|option| required(option))
            .map(|name| format!("`{name}`"))
            .collect();
        Err(Violation::here(format!(
            "must have one of the fields {}",
            needed.join(", ")
        )))
    }
}

fn options(schema: &Value) -> Option<&[Value]> {
    let several = schema.get("anyOf").or(schema.get("oneOf"))?;
    several.as_array().map(Vec::as_slice)
}

fn required(schema: &Value) -> impl Iterator<Item = &str> {
    schema["required"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(Value::as_str)
}

fn field_names(schema: &Value) -> Vec<&str> {
    schema["properties"]
        .as_object()
        .into_iter()
        .flat_map(Map::keys)
        .map(String::as_str)
        .collect()
}

fn types(schema: &Value) -> Vec<&str> {
    match &schema["type"] {
        Value::String(one) => vec![one],
        Value::Array(several) => several.iter().filter_map(Value::as_str).collect(),
        _ => vec![],
    }
}

fn check_type(value: &Value, schema: &Value) -> Fits {
    let types = types(schema);
    let is = |name: &str| match name {
        "integer" => value.is_u64() || value.is_i64(),
        name => name == type_name(value),
    };
    if types.is_empty() || types.iter().any(|name| is(name)) {
        Ok(())
    } else {
        Err(wrong_type(value, types))
    }
}

fn wrong_type(value: &Value, mut types: Vec<&str>) -> Violation {
    types.retain(|name| *name != "null");
    types.dedup();
    let wanted: Vec<&str> = types.into_iter().map(with_article).collect();
    let found = if value.is_f64() {
        value.to_string()
    } else {
        with_article(type_name(value)).into()
    };
    Violation::here(format!("is {found}; it must be {}", wanted.join(" or ")))
}

fn type_name(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "boolean",
        Value::Number(_) => "number",
        Value::String(_) => "string",
        Value::Array(_) => "array",
        Value::Object(_) => "object",
    }
}

fn with_article(name: &str) -> &'static str {
    match name {
        "boolean" => "true or false",
        "number" => "a number",
        "integer" => "a whole number",
        "string" => "a text",
        "array" => "an array",
        "object" => "an object",
        _ => "null",
    }
}

fn check_range(value: f64, schema: &Value) -> Fits {
    type Holds = fn(&f64, &f64) -> bool;
    let laws: [(&str, &str, Holds); 4] = [
        ("minimum", "at least", f64::ge),
        ("exclusiveMinimum", "more than", f64::gt),
        ("maximum", "at most", f64::le),
        ("exclusiveMaximum", "less than", f64::lt),
    ];
    let limits = laws
        .iter()
        .filter_map(|(key, word, holds)| Some((word, limit(schema, key)?, holds)));
    let limits: Vec<_> = limits.collect();
    if limits.iter().all(|(_, limit, holds)| holds(&value, limit)) {
        return Ok(());
    }
    let right: Vec<String> = limits
        .iter()
        .map(|(word, limit, _)| format!("{word} {}", short(*limit)))
        .collect();
    Err(Violation::here(format!(
        "is {}; it must be {}",
        short(value),
        right.join(" and ")
    )))
}

/// A limit of a number: the schema's, or that of its type.
fn limit(schema: &Value, key: &str) -> Option<f64> {
    let of_type = || match (schema["format"].as_str()?, key) {
        ("uint8", "maximum") => Some(f64::from(u8::MAX)),
        ("uint16", "maximum") => Some(f64::from(u16::MAX)),
        ("uint32", "maximum") => Some(f64::from(u32::MAX)),
        ("int32", "minimum") => Some(f64::from(i32::MIN)),
        ("int32", "maximum") => Some(f64::from(i32::MAX)),
        _ => None,
    };
    schema[key].as_f64().or_else(of_type)
}

/// A number in short form, without rows of zeros.
fn short(value: f64) -> String {
    if value != 0.0 && !(1e-4..1e10).contains(&value.abs()) {
        format!("{value:e}")
    } else {
        value.to_string()
    }
}

fn check_words(text: &str, schema: &Value) -> Fits {
    match schema["enum"].as_array() {
        Some(words) => check_word(
            text,
            &words.iter().filter_map(Value::as_str).collect::<Vec<_>>(),
        ),
        None => Ok(()),
    }
}

fn check_word(text: &str, words: &[&str]) -> Fits {
    if words.contains(&text) {
        return Ok(());
    }
    Err(Violation::here(format!(
        "is `{}`; it must be one of {}{}",
        clipped(text),
        list(words),
        in_brackets(text, words)
    )))
}

fn check_known(fields: &Map<String, Value>, known: &[&str]) -> Fits {
    match fields.keys().find(|name| !known.contains(&name.as_str())) {
        None => Ok(()),
        Some(stray) => {
            let nearest = nearest(stray, known)
                .map_or(String::new(), |name| format!("; the nearest is `{name}`"));
            Err(Violation::here(format!(
                "is not a known field{nearest} (known are {})",
                list(known)
            ))
            .inside(format!(".{}", clipped(stray))))
        }
    }
}

fn list(words: &[&str]) -> String {
    let mut distinct: Vec<&str> = Vec::new();
    words.iter().for_each(|word| {
        if !distinct.contains(word) {
            distinct.push(word)
        }
    });
    distinct.join(", ")
}

/// Least similarity of a word to the one that may be meant, by Jaro and Winkler: 1 is equal. Words
/// with a missing, wrong or swapped letter are above 0.85, unrelated ones mostly below 0.7 (`nono`
/// and `precision-in-lockstep`: 0.52); `wait` and `weight` have 0.78.
const LIKE: f64 = 0.76;

/// The known word most similar to `text`, if it is similar enough.
pub fn nearest<'a>(text: &str, known: &[&'a str]) -> Option<&'a str> {
    // A text that is much longer matches none, and may have megabytes.
    if text.len() > 4 * known.iter().map(|word| word.len()).max().unwrap_or(0) {
        return None;
    }
    // In short words a swap of letters leaves little agreement, although it is a single error.
    let one_slip = |word: &str| text.len() > 2 && strsim::osa_distance(text, word) == 1;
    let likeness =
        |word: &str| strsim::jaro_winkler(text, word).max(if one_slip(word) { LIKE } else { 0.0 });
    let best = known
        .iter()
        .copied()
        .max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
    best.filter(|word| likeness(word) >= LIKE)
}

/// That word in brackets, for the end of a sentence; empty if there is none.
pub fn in_brackets(text: &str, known: &[&str]) -> String {
    nearest(text, known).map_or(String::new(), |name| format!(" (nearest: `{name}`)"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: [&str; 6] = [
        "precision",
        "precision-in-lockstep",
        "curves",
        "architecture",
        "layers",
        "clock",
    ];

    #[test]
    fn a_name_of_megabytes_is_compared_with_none() {
        let start = std::time::Instant::now();
        assert_eq!(nearest(&"precision".repeat(1 << 20), &NAMES), None);
        assert!(start.elapsed().as_secs_f64() < 1.0, "{:?}", start.elapsed());
    }

    #[test]
    fn a_misspelt_name_has_a_nearest_one_and_a_strange_one_has_none() {
        let meant = [
            "precison",
            "Precision",
            "curvs",
            "layer",
            "architektur",
            "lyaers",
        ]
        .map(|text| nearest(text, &NAMES));
        assert_eq!(
            meant,
            [
                "precision",
                "precision",
                "curves",
                "layers",
                "architecture",
                "layers"
            ]
            .map(Some)
        );
        for strange in ["nono", "", "x", "plan.json", "found/rows", "torus-knot"] {
            assert_eq!(
                (nearest(strange, &NAMES), in_brackets(strange, &NAMES)),
                (None, String::new()),
                "{strange}"
            );
        }
        assert_eq!(nearest("any", &[]), None);
        assert_eq!(nearest("rbg", &["direction", "rgb"]), Some("rgb"));
    }
}

//! Reference: writes the book's pages of every JSON field, from the schemas that the program
//! publishes and checks input against.
//!
//! `cargo run --release --example reference` writes them into `docs/book/reference`;
//! `tests/readme.rs` compares them.

use serde_json::{Map, Value};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// A page: its file in `docs/book/reference`, and its text.
pub struct Page {
    /// Its name, such as `machine.md`.
    pub file: &'static str,
    /// All of it.
    pub text: String,
}

/// All pages that are made from schemas.
#[must_use]
pub fn pages() -> Vec<Page> {
    linked(vec![
        page(
            "machine.md",
            "Machine",
            MACHINE,
            &splatsim::hardware::machines::schema(),
        ),
        page("scene.md", "Scene", SCENE, &splatsim::scene::schema()),
        page(
            "plan.md",
            "Sweep plan",
            PLAN,
            &splatsim::explore::sweep::plan::schema(),
        ),
        page(
            "prices.md",
            "Prices",
            PRICES,
            &schemars::schema_for!(splatsim::performance::cost::Prices).to_value(),
        ),
        page(
            "report.md",
            "Report",
            REPORT,
            &of::<splatsim::run::report::Report>(),
        ),
        page(
            "compare.md",
            "Comparison",
            COMPARE,
            &of::<splatsim::run::compare::Comparison>(),
        ),
        page(
            "sequence.md",
            "Sequence report",
            SEQUENCE,
            &of::<splatsim::run::sequence::Report>(),
        ),
        page(
            "stress.md",
            "Stress catalogue",
            STRESS,
            &of::<splatsim::explore::stress::Catalogue>(),
        ),
        page(
            "search.md",
            "Search",
            SEARCH,
            &of::<splatsim::explore::search::SearchOutcome>(),
        ),
        page(
            "search-over-timing.md",
            "Search over timing",
            OVER_TIMING,
            &of::<splatsim::explore::search::over_timing::TimingOutcome>(),
        ),
    ])
}

/// Pages of the program's output: types that several of them share are in [`TYPES`].
const WRITTEN: [&str; 6] = [
    "report.md",
    "compare.md",
    "sequence.md",
    "stress.md",
    "search.md",
    "search-over-timing.md",
];
const TYPES: &str = "types.md";

/// A page before shared types are moved.
struct Draft {
    file: &'static str,
    head: String,
    /// The page's own object, followed by the types that it refers to: name and text.
    sections: Vec<(String, String)>,
}

/// A type that several pages describe in the same words is on one page; the others link to it.
fn linked(drafts: Vec<Draft>) -> Vec<Page> {
    let homes = homes(&drafts);
    let mut pages: Vec<Page> = Vec::new();
    let mut types = format!("# Types\n\n{TYPES_OF_SEVERAL}\n\n{MADE_BY}");
    let mut written = BTreeSet::new();
    for Draft {
        file,
        head,
        sections,
    } in &drafts
    {
        let mut text = head.clone();
        for section in sections {
            match homes.get(section) {
                Some(home) if *home == TYPES => {
                    if written.insert(section) {
                        types += &with_links(&section.1, TYPES, sections, &homes);
                    }
                }
                Some(home) if home != file => {}
                _ => text += &with_links(&section.1, file, sections, &homes),
            }
        }
        pages.push(Page { file, text });
    }
    pages.push(Page {
        file: TYPES,
        text: types,
    });
    pages
}

/// The page of each shared type, by its name and text.
fn homes(drafts: &[Draft]) -> BTreeMap<(String, String), &'static str> {
    let mut pages: BTreeMap<&(String, String), Vec<&'static str>> = BTreeMap::new();
    for draft in drafts {
        draft
            .sections
            .iter()
            .skip(1)
            .for_each(|section| pages.entry(section).or_default().push(draft.file));
    }
    pages.retain(|_, files| files.len() > 1);
    // If a name has several texts, the text of most pages: a name occurs once on a page.
    let most = |(name, text): &(String, String)| {
        let same = pages.iter().filter(|((other, _), _)| other == name);
        same.max_by_key(|(_, files)| files.len())
            .is_some_and(|((_, most), _)| most == text)
    };
    let mut shared: BTreeMap<(String, String), &'static str> =
        (pages.iter().filter(|(section, _)| most(section)))
            .map(|(section, files)| {
                (
                    (*section).clone(),
                    if WRITTEN.contains(&files[0]) {
                        TYPES
                    } else {
                        files[0]
                    },
                )
            })
            .collect();
    // A text that refers to a type that is not shared has a different meaning on each page.
    loop {
        let names: BTreeSet<String> = shared.keys().map(|(name, _)| name.to_lowercase()).collect();
        let before = shared.len();
        shared.retain(|(_, text), _| links(text).all(|name| names.contains(name)));
        if shared.len() == before {
            return shared;
        }
    }
}

/// Names of a page's own headings that a text links to.
fn links(text: &str) -> impl Iterator<Item = &str> {
    text.split("](#")
        .skip(1)
        .filter_map(|rest| rest.split_once(')').map(|(name, _)| name))
}

/// A section as it is written on the page `here`.
fn with_links(
    text: &str,
    here: &str,
    sections: &[(String, String)],
    homes: &BTreeMap<(String, String), &'static str>,
) -> String {
    let mut linked = text.to_owned();
    for section in sections {
        if let Some(home) = homes.get(section).filter(|home| **home != here) {
            let name = section.0.to_lowercase();
            linked = linked.replace(&format!("](#{name})"), &format!("]({home}#{name})"));
        }
    }
    linked
}

const MADE_BY: &str = "<!-- made by: cargo run --release --example reference -->\n";
const TYPES_OF_SEVERAL: &str = "Types that are used in several of splatsim's output files: reports, results of searches and others.";

/// The schema of the program's output.
fn of<T: schemars::JsonSchema>() -> Value {
    schemars::SchemaGenerator::new(schemars::generate::SchemaSettings::default().for_serialize())
        .into_root_schema_for::<T>()
        .to_value()
}

const REPORT: &str = "Fields of `report.json`, which `run --out DIR` writes. All fields except `host` are the same for the same input on every \
    computer, with any number of threads. A field is left out if it was not requested.";
const COMPARE: &str =
    "Fields of `compare.json`, which `compare --out DIR` writes and `compare --json` prints.";
const STRESS: &str = "Fields of `stress.json`, which `stress --out DIR` writes.";
const SEARCH: &str =
    "Fields of `search.json`, which `search` writes into the folder of the found machine.";
const OVER_TIMING: &str = "Fields of `search.json` of a `search --min-fps`.";
const MACHINE: &str = "Fields of a machine file, for `--machine FILE`. `machine schema` prints them as a JSON Schema, and `machine show NAME` prints a whole file. \
    A file with a field `base`, the name of a machine, needs only the fields that differ from it. The command line changes one field with `--set PATH=VALUE`, \
    for example `--set gauss.weight=U-2F10`.";
const SCENE: &str = "Fields of a scene file. `scene schema` prints them as a JSON Schema. Only `splats` is required. Numbers are in world units, colours in \
    linear light.";
const SEQUENCE: &str = "Fields of `report.json` if `run` draws a sequence ([Camera paths](../paths.md)). All fields except `host` are the same for the same input on \
     every computer, with any number of threads.";
const PLAN: &str =
    "Fields of a plan for `sweep`. `scene plan-schema` prints them as a JSON Schema.";
const PRICES: &str = "Fields of a file of unit costs, for `machine cost NAME --unit-costs FILE` and other commands that report cost. `machine unit-costs` prints the \
    default file.";

fn main() -> std::io::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/book/reference");
    pages()
        .into_iter()
        .try_for_each(|page| std::fs::write(folder.join(page.file), page.text))
}

fn page(file: &'static str, title: &str, intro: &str, schema: &Value) -> Draft {
    let head = format!("# {title}\n\n{intro}\n\n{MADE_BY}");
    let own = (
        String::new(),
        section(schema, &format!("The {}", title.to_lowercase()), schema),
    );
    let below = named_below(schema, schema).into_iter().map(|name| {
        (
            name.to_owned(),
            section(schema, name, &schema["$defs"][name]),
        )
    });
    Draft {
        file,
        head,
        sections: std::iter::once(own).chain(below).collect(),
    }
}

/// The named schemas that a schema refers to, in the order of the page.
fn named_below<'s>(root: &'s Value, schema: &'s Value) -> Vec<&'s str> {
    let mut names = Vec::new();
    collect(root, schema, &mut names, &mut BTreeSet::new());
    names
}

fn collect<'s>(
    root: &'s Value,
    schema: &'s Value,
    names: &mut Vec<&'s str>,
    seen: &mut BTreeSet<&'s str>,
) {
    match schema {
        Value::Object(fields) => {
            fields
                .iter()
                .filter(|(key, _)| *key != "$defs")
                .for_each(|(key, value)| match value.as_str() {
                    Some(path) if key == "$ref" => {
                        let name = name_of(path);
                        if seen.insert(name) {
                            names.push(name);
                            collect(root, &root["$defs"][name], names, seen);
                        }
                    }
                    _ => collect(root, value, names, seen),
                })
        }
        Value::Array(values) => values
            .iter()
            .for_each(|value| collect(root, value, names, seen)),
        _ => {}
    }
}

fn name_of(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or(path)
}

/// A heading, the description of the schema, and the table of its fields or of its alternatives.
fn section(root: &Value, name: &str, schema: &Value) -> String {
    let mut text = format!("\n## {name}\n");
    if let Some(described) = schema["description"].as_str() {
        text += &format!("\n{}\n", one_line(described));
    }
    match (schema["properties"].as_object(), options(schema)) {
        (Some(fields), _) => text + &fields_table(root, schema, fields),
        (None, Some(options)) => text + &options_table(root, options),
        (None, None) => text + &format!("\nIt is {}.\n", kind(schema)),
    }
}

fn fields_table(root: &Value, schema: &Value, fields: &Map<String, Value>) -> String {
    let required = |name: &String| {
        schema["required"]
            .as_array()
            .is_some_and(|all| all.iter().any(|one| one == name))
    };
    let row = |(name, field): (&String, &Value)| {
        let default = match field.get("default") {
            Some(value) if !value.is_null() => format!("`{value}`"),
            _ if required(name) => "required".into(),
            _ => String::new(),
        };
        format!(
            "| `{name}` | {} | {default} | {} |\n",
            cell(&kind(field)),
            cell(meaning(root, field))
        )
    };
    format!(
        "\n| field | value | default | meaning |\n|---|---|---|---|\n{}",
        fields.iter().map(row).collect::<String>()
    )
}

fn options_table(root: &Value, options: &[Value]) -> String {
    let row = |option: &Value| {
        format!(
            "| {} | {} |\n",
            cell(&kind(option)),
            cell(meaning(root, option))
        )
    };
    let of_fields = options
        .iter()
        .filter(|option| option.get("properties").is_some());
    let table = format!(
        "\n| one of | meaning |\n|---|---|\n{}",
        options.iter().map(row).collect::<String>()
    );
    of_fields.fold(table, |text, option| {
        text + &fields_table(
            root,
            option,
            option["properties"].as_object().unwrap_or(&Map::new()),
        )
    })
}

fn options(schema: &Value) -> Option<&Vec<Value>> {
    schema
        .get("oneOf")
        .or(schema.get("anyOf"))
        .and_then(Value::as_array)
}

/// The description of a schema, otherwise of the schema that it names.
fn meaning<'s>(root: &'s Value, schema: &'s Value) -> &'s str {
    let named = || {
        schema["$ref"]
            .as_str()
            .map(|path| &root["$defs"][name_of(path)])
            .and_then(|named| named["description"].as_str())
    };
    schema["description"]
        .as_str()
        .or_else(named)
        .unwrap_or_default()
}

/// The type of a value in words: its kind, its limits, or a link to its description.
fn kind(schema: &Value) -> String {
    if let Some(path) = schema["$ref"].as_str() {
        let name = name_of(path);
        return format!("[{name}](#{})", name.to_lowercase());
    }
    if let Some(value) = schema.get("const") {
        return format!("`{value}`");
    }
    if let Some(values) = schema["enum"].as_array() {
        return values
            .iter()
            .map(|value| format!("`{value}`"))
            .collect::<Vec<_>>()
            .join(", ");
    }
    if let Some(options) = options(schema) {
        return options
            .iter()
            .filter(|option| option["type"] != "null")
            .map(kind)
            .collect::<Vec<_>>()
            .join(" or ");
    }
    let types: Vec<&str> = match &schema["type"] {
        Value::Array(several) => several
            .iter()
            .filter_map(Value::as_str)
            .filter(|name| *name != "null")
            .collect(),
        one => one.as_str().into_iter().collect(),
    };
    let kinds: Vec<String> = types
        .into_iter()
        .map(|name| kind_of_type(name, schema))
        .collect();
    if kinds.is_empty() {
        "any value".into()
    } else {
        kinds.join(" or ")
    }
}

fn kind_of_type(name: &str, schema: &Value) -> String {
    match name {
        "array" => list(schema),
        "object" => "an object".into(),
        "boolean" => "`true` or `false`".into(),
        "string" => schema["pattern"]
            .as_str()
            .map_or("text".into(), |pattern| format!("text like `{pattern}`")),
        number => number.to_owned() + &range(schema),
    }
}

fn list(schema: &Value) -> String {
    let (least, most) = (schema["minItems"].as_u64(), schema["maxItems"].as_u64());
    let number = match (least, most) {
        (Some(least), Some(most)) if least == most => format!("list of {least}"),
        (Some(least), Some(most)) => format!("list of {least} to {most}"),
        (Some(least), None) if least > 0 => format!("list of {least} or more"),
        (None, Some(most)) => format!("list of at most {most}"),
        _ => "list".into(),
    };
    if schema["items"].is_object() {
        format!("{number}: {}", kind(&schema["items"]))
    } else {
        number
    }
}

/// The limits of a number, without those that only are the range of its type.
fn range(schema: &Value) -> String {
    let told = |key: &str, sign: &str| {
        let limit = schema.get(key)?;
        let is_type = limit.as_f64().is_some_and(|limit| {
            [
                u32::MAX.into(),
                i32::MAX.into(),
                i32::MIN.into(),
                1e30,
                -1e30,
            ]
            .contains(&limit)
        });
        (!is_type).then(|| format!(", {sign} {limit}"))
    };
    [
        ("exclusiveMinimum", ">"),
        ("minimum", "≥"),
        ("exclusiveMaximum", "<"),
        ("maximum", "≤"),
    ]
    .iter()
    .filter_map(|(key, sign)| told(key, sign))
    .collect()
}

/// A description without line breaks, and without rustdoc's brackets of links.
fn one_line(text: &str) -> String {
    text.split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
        .replace("[`", "`")
        .replace("`]", "`")
}

/// A text that is valid in a table.
fn cell(text: &str) -> String {
    one_line(text).replace('|', "\\|")
}

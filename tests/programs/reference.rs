//! Reference: writes the book's pages of every JSON field, from the schemas that the program
//! publishes and checks against.
//!
//! `cargo run --release --example reference` writes them into `docs/book/reference`;
//! `tests/readme.rs` compares.

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

/// Pages of what the program writes: types of theirs that several have lie in [`TYPES`].
const WRITTEN: [&str; 6] = [
    "report.md",
    "compare.md",
    "sequence.md",
    "stress.md",
    "search.md",
    "search-over-timing.md",
];
const TYPES: &str = "types.md";

/// A page before its types are brought together.
struct Draft {
    file: &'static str,
    head: String,
    /// The page's own object, then the types that it leads to: name and text.
    sections: Vec<(String, String)>,
}

/// Each type that several pages describe in the same words has one home, which the others link to.
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

/// The page of each type that several pages share, by its name and text.
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
    // Of a name with several texts the one of most pages: a page has a name once.
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
    // What leads to a type that is not shared has another meaning on each page.
    loop {
        let names: BTreeSet<String> = shared.keys().map(|(name, _)| name.to_lowercase()).collect();
        let before = shared.len();
        shared.retain(|(_, text), _| links(text).all(|name| names.contains(name)));
        if shared.len() == before {
            return shared;
        }
    }
}

/// Names below a page's own headings that a text links to.
fn links(text: &str) -> impl Iterator<Item = &str> {
    text.split("](#")
        .skip(1)
        .filter_map(|rest| rest.split_once(')').map(|(name, _)| name))
}

/// A section of some page's sections, as it stands on the page `here`.
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
const TYPES_OF_SEVERAL: &str = "Types that more than one of the files contains that splatsim writes: reports, results of searches and others.";

/// The schema of what the program writes.
fn of<T: schemars::JsonSchema>() -> Value {
    schemars::SchemaGenerator::new(schemars::generate::SchemaSettings::default().for_serialize())
        .into_root_schema_for::<T>()
        .to_value()
}

const REPORT: &str = "What `report.json` says, which `run --out DIR` writes. All but `host` is the same for the same input on every computer, at any \
    number of threads. A field that is left out was not asked for.";
const COMPARE: &str =
    "What `compare.json` says, which `compare --out DIR` writes and `compare --json` prints.";
const STRESS: &str = "What `stress.json` says, which `stress --out DIR` writes.";
const SEARCH: &str =
    "What `search.json` says, which `search` writes beside the machine that it found.";
const OVER_TIMING: &str = "What `search.json` says where `search --min-fps` wrote it.";
const MACHINE: &str = "What a machine file may say: `--machine FILE`; `machine schema` prints this as a JSON Schema, `machine show NAME` a whole file. \
    A file with a field `base`, the name of a machine, need only say what differs from it. The command line changes one field with `--set PATH=VALUE`, as \
    `--set gauss.weight=U-2F10`.";
const SCENE: &str = "What a scene file may say; `scene schema` prints this as a JSON Schema. Only `splats` is required. Numbers are in world units, \
    colours in linear light.";
const SEQUENCE: &str = "Fields of `report.json` where `run` draws a sequence ([Camera paths](../paths.md)). All but `host` is the same for the same input \
     on every computer, at any number of threads.";
const PLAN: &str =
    "What a plan of `sweep` may say; `scene plan-schema` prints this as a JSON Schema.";
const PRICES: &str = "What a file of prices may say: `machine cost NAME --prices FILE`, and likewise of other commands that tell of cost. `machine prices` prints the \
    default ones.";

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

/// The named schemas that one leads to, in the order in which a reader meets them.
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

/// A heading, what the schema describes, and the table of its fields or of what may stand in its
/// place.
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

/// What is said of a schema itself, else of the one that it names.
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

/// What a value is, in words: its kind, its limits, or a link to where it is described.
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

/// The limits of a number; not those that are the end of its type, which nobody means.
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

/// A description without line breaks, and without the brackets that link it within rustdoc.
fn one_line(text: &str) -> String {
    text.split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
        .replace("[`", "`")
        .replace("`]", "`")
}

/// A text that may stand in a table.
fn cell(text: &str) -> String {
    one_line(text).replace('|', "\\|")
}

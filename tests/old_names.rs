//! Does the book list every old name that is accepted? The aliases in the source's attributes are
//! compared with the table of docs/book/old-names.md.

use crate::book;
use std::collections::BTreeSet;
use std::path::Path;

/// A new name and an old one.
type Names = (String, String);

/// The text of each attribute, `#[…]`, up to its closing bracket, and the text that follows it.
fn attributes(source: &str) -> Vec<(&str, &str)> {
    let starts = source.match_indices("#[").map(|(at, _)| &source[at..]);
    starts.map(|rest| rest.split_at(closing(rest))).collect()
}

/// The end of an attribute: brackets within strings do not count.
fn closing(text: &str) -> usize {
    let (mut depth, mut is_quoted) = (0, false);
    let mut characters = text.char_indices();
    while let Some((at, character)) = characters.next() {
        match character {
            '\\' if is_quoted => {
                characters.next();
            }
            '"' => is_quoted = !is_quoted,
            '[' if !is_quoted => depth += 1,
            ']' if !is_quoted => {
                depth -= 1;
                if depth == 0 {
                    return at + 1;
                }
            }
            _ => {}
        }
    }
    text.len()
}

/// The strings that an attribute gives to a key: `key = "one"`, `key("one")` and
/// `keys = ["one", "two"]`.
fn strings(attribute: &str, is_key: impl Fn(&str) -> bool) -> Vec<String> {
    let mut pieces = attribute.split('"');
    let mut code = pieces.next().unwrap_or_default().to_owned();
    let mut found = Vec::new();
    while let Some(string) = pieces.next() {
        let key = code
            .trim_end_matches(|c: char| !c.is_alphanumeric())
            .rsplit(|c: char| !c.is_alphanumeric() && c != '_')
            .next()
            .unwrap_or_default();
        if is_key(key) {
            found.push(string.to_owned());
        }
        let next = pieces.next().unwrap_or_default();
        // Further strings of a list belong to its key.
        if next.trim() != "," || !code.contains('[') {
            code = next.to_owned();
        }
    }
    found
}

fn is_alias(key: &str) -> bool {
    [
        "alias",
        "aliases",
        "visible_alias",
        "visible_aliases",
        "short_alias",
        "short_aliases",
        "visible_short_alias",
        "visible_short_aliases",
    ]
    .contains(&key)
}

/// The name of the field or variant that follows an attribute.
fn item(rest: &str) -> String {
    let lines = rest
        .lines()
        .map(|line| line.trim().trim_start_matches(']'))
        .filter(|line| !line.is_empty() && !line.starts_with('#') && !line.starts_with("//"));
    let words = lines.flat_map(|line| line.split(|c: char| !c.is_alphanumeric() && c != '_'));
    words
        .filter(|word| !["", "pub", "crate", "super", "r"].contains(word))
        .map(str::to_owned)
        .next()
        .unwrap_or_default()
}

/// The old names in a source, each with the new one: the name in the same attribute, else that of
/// the field or variant below it.
fn aliases(source: &str) -> Vec<Names> {
    let of = |(attribute, rest): (&str, &str)| {
        let name = strings(attribute, |key| ["long", "name", "rename"].contains(&key))
            .pop()
            .unwrap_or_else(|| item(rest));
        strings(attribute, is_alias)
            .into_iter()
            .map(|old| (name.clone(), old))
            .collect::<Vec<_>>()
    };
    attributes(source).into_iter().flat_map(of).collect()
}

fn listed() -> BTreeSet<Names> {
    let page = book::page("docs/book/old-names.md");
    let rows = book::table(&page.text, "<!-- old names -->");
    rows.into_iter()
        .map(|row| (row[0].clone(), row[1].clone()))
        .collect()
}

#[test]
fn the_table_of_old_names_has_those_of_the_source_and_no_others() {
    let mut sources = Vec::new();
    for folder in ["src", "rtl_model/src", "bindings"] {
        book::walk(Path::new(folder), "rs", &mut sources);
    }
    assert!(sources.len() > 100, "{sources:?}");
    let read = |path: &Path| std::fs::read_to_string(book::root().join(path)).unwrap();
    let accepted: BTreeSet<Names> = sources
        .iter()
        .flat_map(|path| aliases(&read(path)))
        .collect();
    assert_eq!(accepted, listed());
}

#[test]
fn the_glossary_leads_to_the_old_names() {
    let glossary = book::page("docs/book/glossary.md").text;
    assert!(book::links(&glossary).contains(&"old-names.md".to_owned()));
}

#[test]
fn aliases_are_found_however_they_are_written() {
    let source = r#"
        /// alias = "no"
        #[arg(long = "new", alias = "old", value_name = "[A]")]
        flag: bool,
        #[serde(default, alias = "once", alias = "twice")]
        /// A field.
        pub(crate) field: u64,
        #[command(
            name = "command",
            visible_aliases = ["a", "b"]
        )]
        Command,
        #[serde(rename = "key", alias("c"))]
        other: u64,
        #[doc = "alias"]
        last: u64,
    "#;
    let pairs = [
        ("new", "old"),
        ("field", "once"),
        ("field", "twice"),
        ("command", "a"),
        ("command", "b"),
        ("key", "c"),
    ];
    let expected: Vec<Names> = pairs.map(|(new, old)| (new.into(), old.into())).into();
    assert_eq!(aliases(source), expected);
}

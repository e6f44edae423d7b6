//! Book: reads fenced blocks, marks, tables, links and headings of README and of the pages in
//! `docs/book`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

/// A file of Markdown, with its path relative to the repository.
#[derive(Debug)]
pub struct Page {
    pub path: PathBuf,
    pub text: String,
}

pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

pub fn page(path: &str) -> Page {
    Page {
        path: path.into(),
        text: std::fs::read_to_string(root().join(path)).unwrap(),
    }
}

/// README first, then the other pages of the top folder, then the book.
pub fn pages() -> Vec<Page> {
    let mut paths = Vec::new();
    walk(Path::new("docs/book"), "md", &mut paths);
    paths.sort();
    let beside = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"].map(PathBuf::from);
    beside
        .into_iter()
        .chain(paths)
        .map(|path| page(path.to_str().unwrap()))
        .collect()
}

/// The files with an extension, in a folder and its subfolders, without build outputs.
pub fn walk(folder: &Path, extension: &str, paths: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(root().join(folder)).unwrap() {
        let path = folder.join(entry.unwrap().file_name());
        if root().join(&path).is_dir() {
            if !path.ends_with("target") {
                walk(&path, extension, paths);
            }
        } else if path.extension().is_some_and(|end| end == extension) {
            paths.push(path);
        }
    }
}

/// The only page with a mark or a heading.
pub fn page_with(mark: &str) -> Page {
    let mut found: Vec<Page> = pages()
        .into_iter()
        .filter(|page| page.text.contains(mark))
        .collect();
    assert_eq!(
        found.len(),
        1,
        "{mark} is in {:?}",
        found.iter().map(|page| &page.path).collect::<Vec<_>>()
    );
    found.remove(0)
}

/// The lines of every fenced block of a language.
pub fn fenced(text: &str, language: &str) -> Vec<String> {
    blocks(text, language).into_iter().flatten().collect()
}

/// Every fenced block of a language, line by line.
pub fn blocks(text: &str, language: &str) -> Vec<Vec<String>> {
    let mut blocks = Vec::new();
    let mut inside = None;
    for line in text.lines() {
        match (line.strip_prefix("```"), inside) {
            (Some(_), Some(_)) => inside = None,
            (Some(opened), None) => {
                inside = Some(opened == language);
                if opened == language {
                    blocks.push(Vec::new());
                }
            }
            (None, Some(true)) => blocks.last_mut().unwrap().push(line.to_owned()),
            _ => {}
        }
    }
    blocks
}

/// The text after a heading or a mark, up to the next heading.
pub fn after<'t>(text: &'t str, mark: &str) -> &'t str {
    let start = text
        .find(mark)
        .unwrap_or_else(|| panic!("{mark} is absent"))
        + mark.len();
    let length = text[start..].find("\n#").unwrap_or(text.len() - start);
    &text[start..start + length]
}

/// The cells of the rows of the first table after a mark, without its heading.
pub fn table(text: &str, mark: &str) -> Vec<Vec<String>> {
    let lines = after(text, mark)
        .lines()
        .skip_while(|line| !line.starts_with('|'))
        .take_while(|line| line.starts_with('|'));
    let cells = |line: &str| {
        line.trim_matches('|')
            .split('|')
            .map(|cell| cell.trim().trim_matches('`').to_owned())
            .collect()
    };
    lines.skip(2).map(cells).collect()
}

/// A block of text that a command prints, according to a mark above it.
#[derive(Debug)]
pub struct Sample {
    pub path: PathBuf,
    pub arguments: String,
    pub lines: Vec<String>,
}

pub fn samples(page: &Page) -> Vec<Sample> {
    let of = |rest: &str| {
        let (arguments, rest) = rest.split_once(" -->\n").expect("a mark ends its line");
        let lines = blocks(rest, "text")
            .into_iter()
            .next()
            .filter(|_| rest.starts_with("```text\n"))
            .expect("a mark stands above its sample");
        Sample {
            path: page.path.clone(),
            arguments: arguments.to_owned(),
            lines,
        }
    };
    // Marks that a page only mentions are quoted.
    page.text.split("\n<!-- prints: ").skip(1).map(of).collect()
}

/// The text without fenced blocks and without quoted code.
fn prose(text: &str) -> String {
    let mut fence = false;
    let mut kept = String::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            fence = !fence;
        } else if !fence {
            kept += line;
            kept.push('\n');
        }
    }
    kept.split('`').step_by(2).collect::<Vec<_>>().join("`")
}

/// Targets of a page's links and pictures.
pub fn links(text: &str) -> Vec<String> {
    prose(text)
        .split("](")
        .skip(1)
        .map(|rest| rest.split(')').next().unwrap().to_owned())
        .collect()
}

/// Text in backticks.
pub fn quoted(text: &str) -> Vec<&str> {
    text.split('`').skip(1).step_by(2).collect()
}

/// Anchors of a page's headings, as GitHub and the built book define them, without the anchors of
/// headings that occur twice, which are ambiguous.
pub fn anchors(text: &str) -> BTreeSet<String> {
    let mut fence = false;
    let mut times = BTreeMap::new();
    for line in text.lines() {
        fence ^= line.trim_start().starts_with("```");
        let heading = line.trim_start_matches('#');
        if !fence && heading.len() < line.len() && heading.starts_with(' ') {
            let kept = heading
                .trim()
                .to_lowercase()
                .chars()
                .filter(|c| c.is_alphanumeric() || " -_".contains(*c))
                .collect::<String>();
            *times.entry(kept.replace(' ', "-")).or_insert(0) += 1;
        }
    }
    times
        .into_iter()
        .filter(|(_, times)| *times == 1)
        .map(|(name, _)| name)
        .collect()
}

/// Links whose target does not exist: the page and the target.
pub fn dead_links(pages: &[Page], exists: impl Fn(&Path) -> bool) -> Vec<(PathBuf, String)> {
    let anchors: BTreeMap<&Path, BTreeSet<String>> = pages
        .iter()
        .map(|page| (page.path.as_path(), anchors(&page.text)))
        .collect();
    let leads = |page: &Page, link: &str| {
        let (file, anchor) = link
            .split_once('#')
            .map_or((link, None), |(file, anchor)| (file, Some(anchor)));
        let to = if file.is_empty() {
            page.path.clone()
        } else {
            plain(&page.path.parent().unwrap().join(file))
        };
        exists(&to)
            && anchor.is_none_or(|anchor| {
                anchors
                    .get(to.as_path())
                    .is_some_and(|known| known.contains(anchor))
            })
    };
    let dead = |page: &Page| {
        let links = links(&page.text)
            .into_iter()
            .filter(|link| !link.starts_with("https://"));
        links
            .filter(|link| !leads(page, link))
            .map(|link| (page.path.clone(), link))
            .collect::<Vec<_>>()
    };
    pages.iter().flat_map(dead).collect()
}

/// A path without `..`.
fn plain(path: &Path) -> PathBuf {
    path.components().fold(PathBuf::new(), |mut to, part| {
        match part {
            Component::ParentDir => assert!(to.pop(), "{} leaves the repository", path.display()),
            part => to.push(part),
        }
        to
    })
}

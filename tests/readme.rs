//! Are README and the book correct? Their commands are run, and their tables and samples are
//! compared with the program.
//!
//! If a figure has changed for a good reason, the failure prints the new lines for the page. A
//! command runs once, also if several pages have it.

use crate::program;
use crate::tier::{self, Tier};
use crate::{book, merge_rules, reference, shared_input};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use book::{
    Page, Sample, blocks, dead_links, fenced, page, page_with, pages, quoted, root, samples, table,
};
use rtl_model::Machine;
use splatsim::accuracy::metrics;
use splatsim::golden::{ideal, render};
use splatsim::hardware::{fixed, quantise};
use splatsim::run::report::MachineReport;
use splatsim::scene::{Overrides, Scene};

/// Path of a table's scene: built in, in the folder of programs, or in the input data; none if it
/// is absent.
fn find(name: &str) -> Option<PathBuf> {
    match name {
        _ if !name.contains('.') => Some(name.into()),
        "glass-spheres-random.json" => Some(root().join("tests/programs").join(name)),
        "dragon.json" => shared_input::find("scenes/dragon.json"),
        "igea.ply" | "bun_zipper.ply" => shared_input::find(&format!("scans/{name}")),
        _ => shared_input::find(name),
    }
}

fn load(path: &Path) -> Scene {
    Scene::load(path.to_str().unwrap(), &Overrides::default()).unwrap()
}

fn one_place(db: Option<f64>) -> String {
    db.map_or("equal".into(), |db| format!("{db:.1}"))
}

// ---- Commands and samples ----

const PROGRAM: &str = "cargo run --release -- ";
const EXAMPLE: &str = "cargo run --release --example ";

/// Long commands, with the tier that runs them: searches and the commands that read their machine,
/// the stress catalogue, sweeps and their charts, larger pictures.
const LONG: [(&str, Tier); 20] = [
    ("run --attribute --out out", Tier::Full),
    ("sweep layers ", Tier::Full),
    ("chart rows", Tier::Full),
    ("search torus-knot --size 64x64 ", Tier::Full),
    ("run torus-knot --size 64x64 --machine found/", Tier::Full),
    ("stress --out out", Tier::Full),
    (
        "search torus-knot --size 96x96 --over fragment ",
        Tier::Full,
    ),
    ("search torus-knot --size 32x32 --distance ", Tier::Full),
    ("run bouquet --size 256x256", Tier::Ci),
    ("run nested-shells --size 256x256 --out out", Tier::Ci),
    ("sweep clock ", Tier::Full),
    ("chart clocks", Tier::Full),
    ("run checkerboard --machine lean ", Tier::Ci),
    ("run torus-knot --size 320x200 ", Tier::Ci),
    ("run terrain --threads 1 ", Tier::Full),
    ("run glass-spheres --size 1024x1024 ", Tier::Full),
    ("run --ranges ", Tier::Full),
    ("run --size 128x128 --what-if", Tier::Full),
    ("trace glass-spheres --size 64x64 ", Tier::Full),
    ("diff raster-trace ", Tier::Full),
];

/// Whether a command is run in this tier.
fn is_run(arguments: &str) -> bool {
    LONG.iter()
        .all(|(start, tier)| !arguments.starts_with(start) || tier::tier() >= *tier)
}

/// Commands of other programs, which CI runs, or which prepare what CI runs.
const OTHERS: [&str; 9] = [
    "cargo test --workspace",
    "cargo test -p unit_rtl_model units::gauss",
    "cargo fmt --all --check",
    "cargo clippy --workspace --all-targets -- -D warnings",
    ".ci/run",
    "python3 tests/programs/table_2.py target/release/splatsim ../shared/data",
    "pip install -r docs/requirements.txt",
    "mkdocs build --strict --config-file docs/mkdocs.yml",
    "fusesoc --cores-root rtl_model/rtl --cores-root traces/knot run --target lint splatsim:rtl:twins",
];

/// Output of a command, or the reason of its failure.
type Printed = Result<String, String>;

/// The commands of the program in all pages without their common prefix, each once, in the order of
/// the pages.
fn commands() -> Vec<String> {
    let mut seen = BTreeSet::new();
    let all = pages()
        .into_iter()
        .flat_map(|page| fenced(&page.text, "sh"));
    let of_program = all.filter_map(|line| line.strip_prefix(PROGRAM).map(str::to_owned));
    of_program
        .filter(|arguments| seen.insert(arguments.clone()))
        .collect()
}

/// A `run` that draws 64×64 pixels instead of a large picture.
fn reduced(arguments: &str) -> String {
    const LARGE_PX: u32 = 128;
    if !arguments.starts_with("run ") {
        return arguments.to_owned();
    }
    let words: Vec<&str> = arguments.split(' ').collect();
    let size = words.iter().position(|word| *word == "--size");
    let Some(size) = size.and_then(|at| words.get(at + 1)) else {
        return format!("{arguments} --size 64x64");
    };
    let is_large = |side: &str| side.parse().is_ok_and(|side: u32| side > LARGE_PX);
    if size.split('x').any(is_large) {
        arguments.replace(&format!("--size {size}"), "--size 64x64")
    } else {
        arguments.to_owned()
    }
}

/// Output of all commands of this tier, each run once. Except in the tier `full`, commands without a
/// sample of their output draw small pictures. Some read files that others wrote: these run
/// one after the other, beside the others.
static PRINTED: LazyLock<BTreeMap<String, Printed>> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let mine = commands().into_iter().filter(|arguments| is_run(arguments));
    let samples: BTreeSet<String> = (all_samples().into_iter())
        .map(|sample| sample.arguments)
        .collect();
    let all: Vec<String> = mine.collect();
    let shared = written(&all);
    let (chain, free): (Vec<String>, Vec<String>) = all
        .into_iter()
        .partition(|arguments| names(arguments).any(|name| shared.contains(name)));
    let run = |commands: Vec<String>| -> Vec<(String, Printed)> {
        let of = |arguments: String| {
            let is_whole = tier::tier() == Tier::Full || samples.contains(&arguments);
            let printed = if is_whole {
                splatsim(folder.path(), &arguments)
            } else {
                splatsim(folder.path(), &reduced(&arguments))
            };
            (arguments, printed)
        };
        commands.into_iter().map(of).collect()
    };
    std::thread::scope(|scope| {
        let beside = scope.spawn(|| run(free));
        let mut printed = run(chain);
        printed.extend(beside.join().unwrap());
        printed.into_iter().collect()
    })
});

/// First parts of the paths in a command, and its other words.
fn names(arguments: &str) -> impl Iterator<Item = &str> {
    let words = arguments.split(' ');
    words.filter_map(|word| word.split('/').next())
}

/// Files and folders that some of the commands write.
fn written(commands: &[String]) -> BTreeSet<String> {
    let mut all = BTreeSet::new();
    for arguments in commands {
        let words: Vec<&str> = arguments.split(' ').collect();
        let writes = words.windows(2).filter(|pair| pair[0].starts_with("--"));
        let paths = writes.filter(|pair| ["--out", "--record", "--export"].contains(&pair[0]));
        all.extend(paths.filter_map(|pair| names(pair[1]).next().map(str::to_owned)));
    }
    all
}

#[test]
fn only_large_pictures_are_reduced() {
    assert_eq!(
        reduced("run city --size 256x96 --quiet"),
        "run city --size 64x64 --quiet"
    );
    assert_eq!(reduced("run --ranges"), "run --ranges --size 64x64");
    assert_eq!(reduced("run knot --size 96x96"), "run knot --size 96x96");
    assert_eq!(reduced("sweep rows"), "sweep rows");
}

#[test]
fn commands_that_share_files_run_one_after_the_other() {
    let commands = [
        "run --out out --record out/w",
        "replay out/w",
        "run knot",
        "chart rows/a",
    ];
    let commands = commands.map(str::to_owned);
    let shared = written(&commands);
    let is_shared = |at: usize| names(&commands[at]).any(|name| shared.contains(name));
    assert_eq!([0, 1, 2, 3].map(is_shared), [true, true, false, false]);
}

fn splatsim(folder: &Path, arguments: &str) -> Printed {
    let mut command = assert_cmd::Command::new(program::PROGRAM.as_str());
    let output = command
        .args(arguments.split(' '))
        .current_dir(folder)
        .output()
        .unwrap();
    match output.status.code() {
        Some(0) => Ok(String::from_utf8(output.stdout).unwrap()),
        code => Err(format!(
            "{code:?}: {}",
            String::from_utf8_lossy(&output.stderr)
        )),
    }
}

#[test]
fn the_first_two_commands_are_the_main_job_and_the_tests() {
    let commands = fenced(&page("README.md").text, "sh");
    assert_eq!(
        commands,
        [
            "cargo run --release -- run --out out",
            "cargo test --workspace"
        ]
    );
    let script = std::fs::read_to_string(root().join(".ci/run")).unwrap();
    assert!(commands.iter().all(|line| script.contains(line.as_str())));
}

#[test]
fn every_command_exists_and_those_of_the_program_run() {
    assert!(commands().len() >= 30, "{:?}", commands());
    let failed: Vec<_> = PRINTED
        .iter()
        .filter(|(_, printed)| printed.is_err())
        .collect();
    assert!(failed.is_empty(), "{failed:#?}");
    for line in pages()
        .into_iter()
        .flat_map(|page| fenced(&page.text, "sh"))
        .filter(|line| !line.starts_with(PROGRAM))
    {
        if let Some(example) = line.strip_prefix(EXAMPLE) {
            let name = example.split(' ').next().unwrap();
            assert!(
                root().join(format!("tests/programs/{name}.rs")).exists(),
                "{line}"
            );
        } else {
            assert!(OTHERS.contains(&line.as_str()), "no test runs {line}");
        }
    }
}

/// Lines of a sample or of an output, without those about the computer.
fn lines<'l>(text: impl IntoIterator<Item = &'l str>) -> Vec<&'l str> {
    text.into_iter()
        .filter(|line| !line.starts_with("host:") && !line.starts_with("      fixed makes"))
        .collect()
}

/// Whether a sample is part of the output. On two pages it must be the whole output.
fn is_printed(sample: &Sample, printed: &str) -> bool {
    let told = lines(sample.lines.iter().map(String::as_str));
    let now = lines(printed.trim_end().lines());
    let is_all = [
        ("report.md", "run --out out"),
        ("cost.md", "machine cost reference"),
    ]
    .iter()
    .any(|(page, arguments)| sample.path.ends_with(page) && sample.arguments == *arguments);
    told.len() > 4
        && if is_all {
            told == now
        } else {
            now.windows(told.len()).any(|some| some == told)
        }
}

fn all_samples() -> Vec<Sample> {
    pages().iter().flat_map(samples).collect()
}

#[test]
fn every_sample_is_printed_by_its_command() {
    let all = commands();
    assert!(
        LONG.iter()
            .all(|(start, _)| all.iter().any(|arguments| arguments.starts_with(start)))
    );
    for sample in all_samples()
        .iter()
        .filter(|sample| is_run(&sample.arguments))
    {
        let printed = PRINTED
            .get(&sample.arguments)
            .unwrap_or_else(|| panic!("no page has the command {}", sample.arguments));
        let printed = printed
            .as_ref()
            .unwrap_or_else(|why| panic!("{}: {why}", sample.arguments));
        assert!(
            is_printed(sample, printed),
            "{} should have:\n{printed}",
            sample.path.display()
        );
    }
}

#[test]
fn the_samples_of_the_main_commands_are_still_compared() {
    let arguments: BTreeSet<String> = all_samples()
        .into_iter()
        .map(|sample| sample.arguments)
        .collect();
    let has = |start: &str| {
        arguments
            .iter()
            .any(|arguments| arguments.starts_with(start))
    };
    let all = [
        "run --out out",
        "run --attribute --out out",
        "run --timing timing.memory.bytes_per_cycle=",
        "machine cost reference",
        "search torus-knot --size 64x64 ",
    ];
    assert!(all.into_iter().all(has), "{arguments:?}");
}

#[test]
fn the_sample_plan_can_be_carried_out() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("plan.json"),
        fenced(&page("docs/book/sweeps.md").text, "json").join("\n"),
    )
    .unwrap();
    let told = splatsim(folder.path(), "sweep plan.json --most 1").unwrap_err();
    assert!(
        told.contains("the plan has 64 points, more than 1"),
        "{told}"
    );
}

#[test]
fn every_sample_of_json_is_json() {
    for page in pages() {
        for block in blocks(&page.text, "json") {
            let parsed = serde_json::from_str::<serde_json::Value>(&block.join("\n"));
            assert!(parsed.is_ok(), "{}: {parsed:?}", page.path.display());
        }
    }
}

// ---- Tables ----

#[test]
fn the_table_of_machines_has_their_figures() {
    let rows = table(&page_with("## Named machines").text, "## Named machines");
    let now = Machine::names().map(|name| {
        let report = MachineReport::new(&fixed::elaborate(&Machine::named(name).unwrap()).unwrap());
        [
            name.to_owned(),
            format!("{} bits", report.widest_operand_bits),
            format!("{} bits", report.fragment_bits),
        ]
    });
    let now: Vec<_> = now.collect();
    assert_eq!(
        rows.iter().map(|row| &row[..3]).collect::<Vec<_>>(),
        now.iter().map(|row| &row[..]).collect::<Vec<_>>()
    );
}

#[test]
fn the_table_of_accuracies_has_those_of_the_machines() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let mut wrong = Vec::new();
    for row in tier::some(
        [12, 12],
        table(&page_with("<!-- accuracy -->").text, "<!-- accuracy -->"),
    ) {
        let Some(path) = find(&row[0]) else { continue };
        let scene = load(&path);
        let mut now = vec![row[0].clone()];
        for name in ["reference", "lean", "window"] {
            let machine = Machine::named(name).unwrap();
            let elaborated = fixed::elaborate(&machine).unwrap();
            let drawing = fixed::draw(&elaborated, &quantise::quantise(&scene, &machine).unwrap());
            let m = metrics(
                &fixed::picture(&elaborated, &drawing),
                &render(&scene, &fixed::rules(&machine)).picture,
            );
            now.extend([one_place(m.psnr_db), one_place(m.psnr_covered_db)]);
        }
        if now != row {
            wrong.push(format!("| {} |", now.join(" | ")));
        }
    }
    assert!(
        wrong.is_empty(),
        "the book should have:\n{}",
        wrong.join("\n")
    );
}

/// The rows with three layers; `tests/golden_match.rs` and `tests/golden_window.rs` check more.
#[test]
fn the_table_of_merge_rules_has_their_results() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let page = page_with("<!-- merge rules -->").text;
    let rows = table(&page, "<!-- merge rules -->");
    let heads: Vec<&str> = page
        .lines()
        .find(|line| line.starts_with("| scene | l | nearest-pair"))
        .unwrap()
        .trim_matches('|')
        .split('|')
        .collect();
    assert!(
        heads[2..]
            .iter()
            .map(|head| head.trim())
            .eq(merge_rules::names()),
        "{heads:?}"
    );
    assert!(rows.len() >= 25 && rows.len().is_multiple_of(5));
    for row in tier::some([12, 12], rows.into_iter().filter(|row| row[1] == "3")) {
        // Generated scenes have no file, and a translucent one is checked by its own row.
        let scene = match row[0].as_str() {
            name if name.starts_with("translucent:") => continue,
            name @ ("random-shells" | "lone-splats") => merge_rules::scene(name).unwrap(),
            name => {
                let Some(path) = find(name) else { continue };
                load(&path)
            }
        };
        let cells = merge_rules::cells(&scene, &ideal(&scene), 3);
        assert_eq!(row[2..], cells, "{}", row[0]);
    }
}

// ---- The reference ----

/// A type that several pages describe in the same words is described on one of them, unless the
/// types that it refers to differ.
#[test]
fn a_type_of_several_pages_is_described_once() {
    let pages = reference::pages();
    let sections = |text: &str| {
        text.split("\n## ")
            .skip(2)
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    let mut all: Vec<String> = pages.iter().flat_map(|page| sections(&page.text)).collect();
    let count = all.len();
    all.sort();
    all.dedup();
    assert!(
        count > 100 && count - all.len() <= 3,
        "{} of {count} sections are repeats",
        count - all.len()
    );
}

#[test]
fn the_reference_agrees_with_the_schemas() {
    for made in reference::pages() {
        let committed = page(&format!("docs/book/reference/{}", made.file));
        assert!(
            committed.text == made.text,
            "{} is another: cargo run --release --example reference",
            made.file
        );
    }
}

// ---- Files and links ----

#[test]
fn every_file_that_is_named_exists() {
    let own = [
        "tests/",
        "src/",
        "comparison/",
        "golden_model/",
        "rtl_model/",
        "traces/",
        "docs/",
        ".ci/",
        "LICENSE",
    ];
    let pages = pages();
    let names = pages
        .iter()
        .flat_map(|page| quoted(&page.text))
        .filter(|name| own.iter().any(|start| name.starts_with(start)));
    let plain = names.filter(|name| !name.contains("NAME"));
    let (there, absent): (BTreeSet<_>, BTreeSet<_>) =
        plain.partition(|name| root().join(name).exists());
    assert!(absent.is_empty(), "{absent:?}");
    assert!(there.len() >= 30, "{there:?}");
}

/// Pages that the program contains are in the published crate, which does not build without them.
#[test]
fn every_page_in_the_program_is_published() {
    let read = |path: &str| std::fs::read_to_string(root().join(path)).unwrap();
    let (source, manifest) = (read("src/cosim/trace.rs"), read("Cargo.toml"));
    let pages: Vec<&str> = source
        .split("chapter!(\"")
        .skip(1)
        .filter_map(|rest| rest.split('"').next())
        .collect();
    assert!(pages.len() >= 6, "{pages:?}");
    for page in pages {
        assert!(
            manifest.contains(&format!("\"/docs/book/{page}\"")),
            "`include` in Cargo.toml lacks {page}"
        );
    }
}

#[test]
fn no_link_is_dead() {
    let dead = dead_links(&pages(), |path| root().join(path).exists());
    assert!(dead.is_empty(), "{dead:#?}");
}

/// The pages that a source cites, with the section if one is given.
fn cited(text: &str) -> Vec<(String, Option<String>)> {
    let of = |rest: &str| {
        let name: String = rest
            .chars()
            .take_while(|c| c.is_alphanumeric() || "-/.".contains(*c))
            .collect();
        let section = rest[name.len()..].strip_prefix(" §").map(|rest| {
            rest.chars()
                .take_while(char::is_ascii_digit)
                .collect::<String>()
        });
        (name.trim_end_matches('.').to_owned(), section)
    };
    text.split("docs/book/")
        .skip(1)
        .map(of)
        .filter(|(name, _)| name.ends_with(".md"))
        .collect()
}

/// The fault of a citation.
fn misses((name, section): &(String, Option<String>)) -> Option<String> {
    let Ok(text) = std::fs::read_to_string(root().join("docs/book").join(name)) else {
        return Some(format!("{name} is absent"));
    };
    let section = section.as_ref()?;
    (!text.contains(&format!("\n## {section}. ")))
        .then(|| format!("{name} has no section {section}"))
}

#[test]
fn cited_pages_and_sections_exist() {
    let mut sources = Vec::new();
    ["src", "comparison", "golden_model", "rtl_model", "tests"]
        .iter()
        .for_each(|folder| book::walk(Path::new(folder), "rs", &mut sources));
    assert!(sources.len() > 100, "{sources:?}");
    // This file has wrong citations on purpose.
    for path in sources
        .iter()
        .filter(|path| !path.ends_with(Path::new(file!()).file_name().unwrap()))
    {
        let wrong: Vec<String> = cited(&std::fs::read_to_string(root().join(path)).unwrap())
            .iter()
            .filter_map(misses)
            .collect();
        assert!(wrong.is_empty(), "{}: {wrong:?}", path.display());
    }
}

#[test]
fn wrong_citations_are_found() {
    let found = cited(
        "as docs/book/algorithm.md §6 has it (docs/book/algorithm.md §66, docs/book/none.md). In docs/book too.",
    );
    let wrong: Vec<String> = found.iter().filter_map(misses).collect();
    assert_eq!(
        wrong,
        ["algorithm.md has no section 66", "none.md is absent"]
    );
    assert_eq!(found.len(), 3);
}

#[test]
fn every_page_is_in_the_contents() {
    let contents = std::fs::read_to_string(root().join("docs/mkdocs.yml")).unwrap();
    for page in pages() {
        if let Ok(name) = page.path.strip_prefix("docs/book") {
            assert!(
                contents.contains(&format!(": {}\n", name.to_str().unwrap())),
                "docs/mkdocs.yml lacks {}",
                name.display()
            );
        }
    }
}

#[test]
fn the_glossary_has_every_term_once() {
    let text = page("docs/book/glossary.md").text;
    let rows = text
        .lines()
        .filter(|line| line.starts_with("| ") && !line.starts_with("| term "));
    let cells = rows.map(|line| {
        line.split('|')
            .nth(1)
            .unwrap()
            .trim()
            .split(", ")
            .collect::<Vec<_>>()
    });
    let terms: Vec<&str> = cells.flatten().collect();
    let distinct: BTreeSet<&str> = terms.iter().copied().collect();
    assert_eq!(terms.len(), distinct.len(), "{terms:?}");
    let ours = [
        "splat",
        "contribution",
        "fragment",
        "stamp",
        "slot",
        "lockstep",
        "flip",
        "declared clamp",
        "setup record",
        "partial precision",
    ];
    assert!(
        ours.iter().all(|term| distinct.contains(term)),
        "{distinct:?}"
    );
}

#[test]
fn readme_is_short() {
    let length = page("README.md").text.len();
    assert!(length <= 6_000, "{length} bytes");
}

/// Beginnings of sentences, and words, that are hard to understand at first reading.
const BEGINNINGS: [&str; 5] = ["Who ", "Whoever ", "Nobody ", "Of a ", "Of the "];
const WORDS: [&str; 4] = ["anew", "is no number", "abreast", "so many"];

/// Patterns in a text outside its blocks of code.
fn twisted(text: &str) -> Vec<String> {
    let mut is_code = false;
    let mut found = Vec::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            is_code = !is_code;
        }
        if is_code {
            continue;
        }
        let begins = |start: &&&str| {
            let at = |(at, _): (usize, &str)| {
                line[..at]
                    .trim_end_matches(['#', '*', '|', '-', ' '])
                    .ends_with(['.', '!', '?', ':'])
            };
            line.trim_start_matches(['#', '*', '|', '-', ' '])
                .starts_with(**start)
                || line.match_indices(**start).any(at)
        };
        let has = |word: &&&str| {
            line.split(|c: char| !c.is_alphanumeric())
                .collect::<Vec<_>>()
                .join(" ")
                .contains(**word)
        };
        let all = BEGINNINGS
            .iter()
            .filter(begins)
            .chain(WORDS.iter().filter(has));
        found.extend(all.map(|pattern| format!("`{}` in: {line}", pattern.trim_end())));
    }
    found
}

#[test]
fn pages_are_plain() {
    for page in pages() {
        assert_eq!(twisted(&page.text), [""; 0], "{}", page.path.display());
    }
}

/// Longer pages have several subjects; pages of the reference are lists of fields.
#[test]
fn a_page_has_at_most_12_kilobytes() {
    let written = pages()
        .into_iter()
        .filter(|page| !page.path.starts_with("docs/book/reference"));
    let long: Vec<_> = written
        .filter(|page| page.text.len() > 12 * 1024)
        .map(|page| (page.path, page.text.len()))
        .collect();
    assert!(long.is_empty(), "{long:?}");
}

// ---- Tests of the reader itself ----

#[test]
fn twisted_sentences_are_found() {
    for line in [
        "Who draws waits.",
        "- Of a splat is known. It goes.",
        "It ends. Nobody knows.",
        "The unit begins anew.",
        "**Of the two**: one.",
    ] {
        assert_eq!(twisted(line).len(), 1, "{line}");
    }
    assert_eq!(
        twisted("The splat of a scene, whose renewal is known.\n```text\nWho\n```\n"),
        [""; 0]
    );
}

#[test]
fn blocks_and_tables_are_found() {
    let text = "# A\n```sh\nfirst\n```\n```text\nno\n```\n<!-- x -->\n| h | i |\n|---|---|\n| `a` | 1 |\n| b | 2 |\n\n| c | 3 |\n# B\n| d | 4 |\n```sh\nsecond\n```\n";
    assert_eq!(fenced(text, "sh"), ["first", "second"]);
    assert_eq!(table(text, "<!-- x -->"), [["a", "1"], ["b", "2"]]);
}

#[test]
fn samples_that_are_not_printed_are_found_out() {
    let text = "\n<!-- prints: machine list -->\n```text\n1\n2\n3\n4\n5\n```\n";
    let sample = &samples(&Page {
        path: "a.md".into(),
        text: text.into(),
    })[0];
    assert_eq!(sample.arguments, "machine list");
    assert!(is_printed(sample, "0\n1\n2\n3\n4\nhost: 9 s\n5\n6\n"));
    assert!(!is_printed(sample, "0\n1\n2\n3\n4\n4\n5\n6\n"));
}

#[test]
fn dead_links_are_found() {
    let first = "# A word\n[b](b.md#two--three) [a](#a-word) `[x](y)`\n[c](../c.png) [d](d.md) [e](b.md#four) [f](#b)\n";
    let made = |path: &str, text: &str| Page {
        path: path.into(),
        text: text.into(),
    };
    let pages = [
        made("docs/a.md", first),
        made("docs/b.md", "## Two & three\n```sh\n# four\n```\n"),
    ];
    let exists = |path: &Path| {
        ["docs/a.md", "docs/b.md", "c.png"]
            .map(Path::new)
            .contains(&path)
    };
    let dead: Vec<String> = dead_links(&pages, exists)
        .into_iter()
        .map(|(_, link)| link)
        .collect();
    assert_eq!(dead, ["d.md", "b.md#four", "#b"]);
}

//! Is what README says so? Its commands are run, its tables and its sample summary compared with what the code says today.
//!
//! Where a figure has changed for a good reason, the failure prints the line that README should have.

mod shared_input;

use std::path::{Path, PathBuf};

use rtl_model::Machine;
use splatsim::accuracy::metrics;
use splatsim::golden::{FragmentDepth, Merge, Rules, ideal, render};
use splatsim::hardware::{fixed, quantise};
use splatsim::run::report::MachineReport;
use splatsim::scene::{Overrides, Scene};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn readme() -> String {
    std::fs::read_to_string(root().join("README.md")).unwrap()
}

/// The lines of every fenced block of a language.
fn fenced(text: &str, language: &str) -> Vec<String> {
    let mut lines = Vec::new();
    let mut inside = None;
    for line in text.lines() {
        match (line.strip_prefix("```"), inside) {
            (Some(_), Some(_)) => inside = None,
            (Some(opened), None) => inside = Some(opened == language),
            (None, Some(true)) => lines.push(line.to_owned()),
            _ => {}
        }
    }
    lines
}

/// What follows a heading or a mark, up to the next heading.
fn after<'t>(text: &'t str, mark: &str) -> &'t str {
    let start = text.find(mark).unwrap_or_else(|| panic!("README lacks {mark}")) + mark.len();
    let length = text[start..].find("\n#").unwrap_or(text.len() - start);
    &text[start..start + length]
}

/// The cells of the rows of the first table after a mark, without its head.
fn table(text: &str, mark: &str) -> Vec<Vec<String>> {
    let lines = after(text, mark).lines().skip_while(|line| !line.starts_with('|')).take_while(|line| line.starts_with('|'));
    let cells = |line: &str| line.trim_matches('|').split('|').map(|cell| cell.trim().trim_matches('`').to_owned()).collect();
    lines.skip(2).map(cells).collect()
}

/// Where a scene of a table is: built in, beside the programs, or in the input data; none where that is absent.
fn find(name: &str) -> Option<PathBuf> {
    match name {
        _ if !name.contains('.') => Some(name.into()),
        "glass-spheres-random.json" => Some(root().join("tests/programs").join(name)),
        "dragon.json" => shared_input::find("scenes/dragon.json"),
        _ => shared_input::find(name),
    }
}

fn load(path: &Path) -> Scene {
    Scene::load(path.to_str().unwrap(), &Overrides::default()).unwrap()
}

fn one_place(db: Option<f64>) -> String {
    db.map_or("equal".into(), |db| format!("{db:.1}"))
}

/// Runs the arguments of a README command in a folder of its own; what it prints.
fn splatsim(arguments: &str) -> String {
    splatsim_in(tempfile::tempdir().unwrap().path(), arguments)
}

fn splatsim_in(folder: &Path, arguments: &str) -> String {
    let mut command = assert_cmd::Command::new(env!("CARGO_BIN_EXE_splatsim"));
    let output = command.args(arguments.split(' ')).current_dir(folder).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn the_first_two_commands_are_the_main_job_and_the_tests() {
    assert_eq!(fenced(&readme(), "sh")[..2], ["cargo run --release -- run --out out", "cargo test --workspace"]);
    let script = std::fs::read_to_string(root().join(".ci/run")).unwrap();
    assert!(fenced(&readme(), "sh")[..2].iter().all(|line| script.contains(line.as_str())));
}

#[test]
fn every_command_exists_and_those_of_the_program_run() {
    let commands = fenced(&readme(), "sh");
    assert!(commands.len() >= 10, "{commands:?}");
    // Some read what others wrote.
    let folder = tempfile::tempdir().unwrap();
    assert!(commands.iter().any(|line| line.contains("-- search ")), "the sample search is compared with what it prints");
    for line in commands {
        // Takes minutes: `the_sample_attribution_is_what_its_command_prints` runs it.
        if line == ATTRIBUTION {
            continue;
        }
        if let Some(arguments) = line.strip_prefix("cargo run --release -- ") {
            let printed = splatsim_in(folder.path(), arguments);
            if arguments.starts_with("search ") {
                let text = readme();
                let sample = fenced(after(&text, "<!-- search -->"), "text").join("\n");
                assert!(sample.lines().count() > 15 && printed.contains(&sample), "README should have:\n{printed}");
            }
        } else if let Some(example) = line.strip_prefix("cargo run --release --example ") {
            let name = example.split(' ').next().unwrap();
            assert!(root().join(format!("tests/programs/{name}.rs")).exists(), "{line}");
        } else {
            assert_eq!(line, "cargo test --workspace");
        }
    }
}

#[test]
fn the_sample_summary_is_what_the_first_command_prints() {
    let text = readme();
    let is_host = |line: &&str| line.starts_with("host:") || line.starts_with("      fixed makes");
    let sample = fenced(after(&text, "<!-- summary -->"), "text");
    let sample: Vec<&str> = sample.iter().map(String::as_str).filter(|line| !is_host(line)).collect();
    let printed = splatsim("run --out out");
    let now: Vec<&str> = printed.lines().filter(|line| !is_host(line)).collect();
    assert!(sample == now, "README should have:\n{printed}");
}

#[test]
fn the_sample_timings_are_what_their_command_prints() {
    let text = readme();
    let command = fenced(&text, "sh").into_iter().find(|line| line.contains("--timing")).unwrap();
    let sample = fenced(after(&text, "<!-- timings -->"), "text").join("\n");
    let printed = splatsim(command.trim_start_matches("cargo run --release -- "));
    assert!(sample.lines().count() > 4 && printed.contains(&sample), "README should have:\n{printed}");
}

#[test]
fn the_sample_costs_are_what_their_command_prints() {
    let text = readme();
    let command = fenced(&text, "sh").into_iter().find(|line| line.contains("machine cost")).unwrap();
    let sample = fenced(after(&text, "<!-- cost -->"), "text").join("\n");
    let printed = splatsim(command.trim_start_matches("cargo run --release -- "));
    assert_eq!(sample, printed.trim_end(), "README should have:\n{printed}");
}

#[test]
fn the_sample_plan_can_be_carried_out() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("plan.json"), fenced(after(&readme(), "## Sweeps"), "json").join("\n")).unwrap();
    let mut command = assert_cmd::Command::new(env!("CARGO_BIN_EXE_splatsim"));
    let output = command.args(["sweep", "plan.json", "--most", "1"]).current_dir(folder.path()).output().unwrap();
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(told.contains("the plan has 64 points, more than 1"), "{told}");
}

const ATTRIBUTION: &str = "cargo run --release -- run --attribute --out out";

#[test]
#[ignore = "takes minutes"]
fn the_sample_attribution_is_what_its_command_prints() {
    let text = readme();
    assert!(fenced(&text, "sh").iter().any(|line| line == ATTRIBUTION));
    let sample = fenced(after(&text, "<!-- attribution -->"), "text").join("\n");
    let printed = splatsim(ATTRIBUTION.trim_start_matches("cargo run --release -- "));
    assert!(sample.lines().count() > 20 && printed.contains(&sample), "README should have:\n{printed}");
}

#[test]
fn the_table_of_machines_says_what_they_are() {
    let rows = table(&readme(), "### Named machines");
    let now = Machine::names().map(|name| {
        let report = MachineReport::new(&fixed::elaborate(&Machine::named(name).unwrap()).unwrap());
        [name.to_owned(), format!("{} bits", report.widest_operand_bits), format!("{} bits", report.fragment_bits)]
    });
    let now: Vec<_> = now.collect();
    assert_eq!(rows.iter().map(|row| &row[..3]).collect::<Vec<_>>(), now.iter().map(|row| &row[..]).collect::<Vec<_>>());
}

#[test]
fn the_table_of_accuracies_says_what_the_machines_reach() {
    let mut wrong = Vec::new();
    for row in table(&readme(), "<!-- accuracy -->") {
        let Some(path) = find(&row[0]) else { continue };
        let scene = load(&path);
        let mut now = vec![row[0].clone()];
        for name in ["reference", "lean"] {
            let machine = Machine::named(name).unwrap();
            let elaborated = fixed::elaborate(&machine).unwrap();
            let drawing = fixed::draw(&elaborated, &quantise::quantise(&scene, &machine).unwrap());
            let m = metrics(&fixed::picture(&elaborated, &drawing), &render(&scene, &fixed::rules(&machine)).picture);
            now.extend([one_place(m.psnr_db), one_place(m.psnr_covered_db)]);
        }
        if now != row {
            wrong.push(format!("| {} |", now.join(" | ")));
        }
    }
    assert!(wrong.is_empty(), "README should have:\n{}", wrong.join("\n"));
}

/// The rows of three layers; `tests/golden_match.rs` has more.
#[test]
fn the_table_of_merge_rules_says_what_they_do() {
    let rows = table(&readme(), "<!-- merge rules -->");
    assert_eq!(rows.len(), 12);
    for row in rows.into_iter().filter(|row| row[1] == "3") {
        let Some(path) = find(&row[0]) else { continue };
        let scene = load(&path);
        let ideal = ideal(&scene);
        let cells =
            [(Merge::NearestPair, false), (Merge::FarthestPair, false), (Merge::FarthestPair, true)].map(|(merge, evict_hidden)| {
                let rules = Rules { layers: 3, merge, evict_hidden, opaque: 0.999, fragment_depth: FragmentDepth::First };
                let golden = render(&scene, &rules);
                format!("{} ({})", one_place(metrics(&golden.picture, &ideal.picture).psnr_db), golden.outcomes.merged / 1000)
            });
        assert_eq!(row[2..], cells, "{}", row[0]);
    }
}

#[test]
fn every_file_that_is_named_exists() {
    let text = readme();
    let linked = text.split("](").skip(1).map(|rest| rest.split(')').next().unwrap());
    let quoted = text.split('`').skip(1).step_by(2).filter(|name| name.contains('/') || name.starts_with("LICENSE"));
    let own = ["tests/", "src/", "rtl_model/", "traces/", ".ci/", "LICENSE"];
    let mut seen = 0;
    for name in linked.chain(quoted).filter(|name| own.iter().any(|start| name.starts_with(start))) {
        assert!(root().join(name).exists(), "{name}");
        seen += 1;
    }
    assert!(seen >= 10, "{seen}");
}

#[test]
fn blocks_and_tables_are_found() {
    let text = "# A\n```sh\nfirst\n```\n```text\nno\n```\n<!-- x -->\n| h | i |\n|---|---|\n| `a` | 1 |\n| b | 2 |\n\n| c | 3 |\n# B\n| d | 4 |\n```sh\nsecond\n```\n";
    assert_eq!(fenced(text, "sh"), ["first", "second"]);
    assert_eq!(table(text, "<!-- x -->"), [["a", "1"], ["b", "2"]]);
}

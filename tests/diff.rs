//! Does the checker catch what a device may get wrong, and name it?

use crate::traced::{Traced, cloud, machine, traced};
use proptest::prelude::*;
use serde_json::Value;
use splatsim::cosim::diff::{Outcome, diff};
use splatsim::cosim::trace::Window;
use splatsim::error::Error;
use std::sync::OnceLock;

fn trace() -> &'static Traced {
    static TRACE: OnceLock<Traced> = OnceLock::new();
    TRACE.get_or_init(|| traced(&cloud(400, 24), &machine("reference", &[]), &Window::default()))
}

fn compared(stream: &str, lines: &[String]) -> Result<Outcome, Error> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("device.hex");
    std::fs::write(&file, lines.iter().map(|line| format!("{line}\n")).collect::<String>()).unwrap();
    diff(&trace().folder, &[(stream.to_owned(), file)])
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

/// A bit of a record's word, from the bottom, flipped.
fn flipped(line: &str, bit: u32) -> String {
    let place = line.len() - 1 - bit as usize / 4;
    let digit = line[place..=place].chars().next().unwrap().to_digit(16).unwrap() ^ 1 << (bit % 4);
    format!("{}{digit:x}{}", &line[..place], &line[place + 1..])
}

#[test]
fn what_is_equal_is_equal() {
    for stream in trace().manifest["streams"].as_array().unwrap() {
        let name = stream["name"].as_str().unwrap();
        assert!(compared(name, &trace().lines(name)).unwrap().equal, "{name}");
    }
}

#[test]
fn pixels_may_come_in_any_order_where_only_theirs_counts() {
    let mut lines = trace().lines("resolve.out");
    lines.reverse();
    assert!(compared("resolve.out", &lines).unwrap().equal);
    let mut lines = trace().lines("gauss.out");
    lines.reverse();
    assert!(!compared("gauss.out", &lines).unwrap().equal);
}

/// A record that differs from its neighbours in each stream, so that a fault cannot pass for another.
fn distinct(lines: &[String], at: usize) -> Option<usize> {
    let near = |i: usize| lines[i.saturating_sub(6)..lines.len().min(i + 7)].iter().filter(|line| **line == lines[i]).count() == 1;
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
        // A flag of a record says which of its fields count: none is flipped here, nor what does not count.
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
        let ulp = told["field"]["difference_ulp"].as_i64().unwrap().unsigned_abs();
        prop_assert_eq!(ulp, 1 << (u64::from(bit) - field["lsb"].as_u64().unwrap()));
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
        // Of two equal records either may be the one too many.
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
            // Beyond the picture.
            _ => lines[at] = flipped(&lines[at], 20),
        }
        let told = told("fragment.out", &lines);
        let sequence = told["sequence"].as_u64().unwrap() as usize;
        if how < 2 {
            prop_assert_eq!([&told["x"], &told["y"]].map(|part| part.as_i64().unwrap()), [keys[at][1], keys[at][2]]);
        }
        if how == 0 {
            // Of equal records at a pixel any may be the one that is missing, and where more of them follow it looks like another fault.
            prop_assert!(told["kind"] == "field" || trace.lines("fragment.out")[sequence] == trace.lines("fragment.out")[at]);
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
    assert_eq!([&told["kind"], &told["sequence"], &told["mismatches"]], [&Value::from("missing"), &(all - 3).into(), &3.into()]);
}

#[test]
fn a_malformed_line_is_an_error_of_its_own() {
    let lines = trace().lines("raster.out");
    let with = |line: String| [&lines[..4], &[line], &lines[5..]].concat();
    for (line, says) in [
        (format!("0{}", lines[4]), "line 5 has 21 digits"),
        (lines[4][1..].to_owned(), "line 5 has"),
        (String::new(), "line 5 is empty"),
        (format!("x{}", &lines[4][1..]), "line 5 has `x` in it: bits that the simulator does not know"),
        (format!("g{}", &lines[4][1..]), "line 5 has `g` in it"),
    ] {
        let sentence = refused("raster.out", &with(line.clone()));
        let wanted = says.replace("21", &(lines[4].len() + 1).to_string());
        assert!(sentence.contains(&wanted), "{sentence}");
    }
    // A record whose width is no multiple of four has bits above it.
    let stream = trace().manifest["streams"].as_array().unwrap().iter().find(|stream| stream["width"].as_u64().unwrap() % 4 != 0).unwrap();
    let name = stream["name"].as_str().unwrap();
    let mut lines = trace().lines(name);
    lines[0] = format!("f{}", &lines[0][1..]);
    assert!(refused(name, &lines).contains("has bits above the"));
}

#[test]
fn a_mismatch_tells_what_led_there() {
    let trace = trace();
    let mut lines = trace.lines("gauss.out");
    lines[100] = flipped(&lines[100], 0);
    let told = told("gauss.out", &lines);
    let inputs: Vec<&str> = told["inputs"].as_array().unwrap().iter().map(|input| input["stream"].as_str().unwrap()).collect();
    let chain = ["gauss.in", "raster.out", "raster.in", "ellipse.out", "ellipse.in", "project.out", "project.in", "pipeline.in"];
    assert_eq!(inputs, chain);
    let radial = &told["inputs"][0]["fields"]["radial"]["hex"];
    let raster = &told["inputs"][1]["fields"]["radial"]["hex"];
    assert_eq!(radial, raster);
    let replay = told["replay"].as_str().unwrap();
    let splat = trace.keys("gauss.out")[100][0];
    assert!(replay.contains(&format!("--splats {splat}..{}", splat + 1)) && replay.contains("--units gauss"), "{replay}");
}

#[test]
fn a_mismatch_of_a_pixel_tells_all_of_its_layers() {
    let trace = trace();
    let last = trace.field("resolve.in", "last");
    let layers = trace.records("resolve.in");
    let ends: Vec<usize> = (0..layers.len()).filter(|&layer| layers[layer][last] == 1).collect();
    // The first pixel that has at least three.
    let (pixel, end) = (1..ends.len()).map(|pixel| (pixel, ends[pixel])).find(|&(pixel, end)| end - ends[pixel - 1] >= 3).unwrap();
    let mut lines = trace.lines("resolve.out");
    lines[pixel] = flipped(&lines[pixel], 0);
    let told = told("resolve.out", &lines);
    let inputs = told["inputs"].as_array().unwrap();
    let numbers: Vec<u64> =
        inputs.iter().filter(|input| input["stream"] == "resolve.in").map(|input| input["sequence"].as_u64().unwrap()).collect();
    let all: Vec<u64> = (ends[pixel - 1] as u64 + 1..=end as u64).collect();
    assert_eq!(numbers, all);
    assert_eq!(inputs[all.len()]["stream"], "fragment.held");
    let text = compared("resolve.out", &lines).unwrap().text;
    assert!(
        all.iter().all(|layer| text.contains(&format!("made from, resolve.in record {layer}\n"))) && !text.contains("fragment.held"),
        "{text}"
    );
}

#[test]
fn the_earliest_stream_tells() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| {
        let mut lines = trace().lines(name);
        lines[3] = flipped(&lines[3], 1);
        let path = folder.path().join(name);
        std::fs::write(&path, lines.join("\n")).unwrap();
        (name.to_owned(), path)
    };
    let outcome = diff(&trace().folder, &[file("resolve.out"), file("raster.out"), file("gauss.out")]).unwrap();
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
    let told = |stream: &str| match diff(&trace.folder, &[(stream.to_owned(), device.clone())]) {
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

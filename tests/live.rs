//! Does a unit that is driven record by record return the trace's records, refuse impossible
//! inputs, and respond immediately?

use crate::program::PROGRAM;
use crate::traced::{Traced, bouquet, cloud, harmonics, machine, shells, traced};
use assert_cmd::Command;
use proptest::prelude::*;
use rtl_model::Machine;
use serde_json::{Value, json};
use splatsim::cosim::live::{Constants, Port, Record, Unit};
use splatsim::cosim::scoreboard::{PortSide, Scoreboard};
use splatsim::cosim::trace::Window;
use splatsim::scene::{Overrides, Scene};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};
use std::sync::LazyLock;
use std::time::Duration;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The constants of a scene's text.
fn constants(text: &str, machine: &Machine) -> Constants {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.json");
    std::fs::write(&path, text).unwrap();
    Constants::new(
        &Scene::load(path.to_str().unwrap(), &Overrides::default()).unwrap(),
        machine,
    )
    .unwrap()
}

/// The lines of a port.
fn lines(port: Option<&Port>, records: &[Record]) -> Vec<String> {
    let mut text = Vec::new();
    records
        .iter()
        .for_each(|words| port.unwrap().write(words, &mut text));
    String::from_utf8(text)
        .unwrap()
        .lines()
        .map(str::to_owned)
        .collect()
}

/// Drives all units of a trace with its inputs. Requests of fragment get the trace's responses if
/// they differ from shade's.
fn answers_as_traced(trace: &Traced, constants: &Constants, shades: bool) {
    for name in constants.units() {
        let mut unit = Unit::new(constants, name).unwrap();
        let mut requests = Vec::new();
        let mut told = if unit.shade.is_some() {
            trace.records("fragment.answer")
        } else {
            Vec::new()
        }
        .into_iter();
        let mut shade = |request: &[i64]| {
            requests.push(request.to_vec());
            let told: [i64; 4] = told
                .next()
                .expect("a request that the trace has not")
                .try_into()
                .unwrap();
            if shades {
                assert_eq!(constants.light(request), told);
            }
            told
        };
        let mut out = Vec::new();
        for line in trace.lines(&format!("{name}.in")) {
            let words = unit.input.read(&line).unwrap();
            out.extend(unit.step(&words, &mut shade).unwrap());
        }
        let end = unit.end(&mut shade).unwrap();
        out.extend(end.out);
        // Gaussians have their own colours.
        assert!(
            out.len() > 9 || name == "shade" && trace.lines("shade.in").is_empty(),
            "{name} has next to nothing to do"
        );
        assert_eq!(
            lines(Some(&unit.output), &out),
            trace.lines(&format!("{name}.out")),
            "{name}"
        );
        if name == "fragment" {
            assert_eq!(
                lines(unit.held.as_ref(), &end.held),
                trace.lines("fragment.held")
            );
            if let Some([asks, _]) = &unit.shade {
                assert_eq!(
                    lines(Some(asks), &requests),
                    trace.lines("fragment.request")
                );
                assert!(!requests.is_empty());
            }
        }
        // No records are left.
        assert_eq!(
            unit.end(&mut |_| [0; 4]).unwrap(),
            splatsim::cosim::live::End::default()
        );
    }
}

#[test]
fn a_unit_answers_as_the_trace_says() {
    let text = cloud(500, 32);
    for name in ["tiny", "reference", "window"] {
        let machine = machine(name, &[]);
        let constants = constants(&text, &machine);
        answers_as_traced(
            &traced(&text, &machine, &Window::default()),
            &constants,
            true,
        );
        let made_up = Window {
            stimulus: Some(100),
            ..Window::default()
        };
        answers_as_traced(&traced(&text, &machine, &made_up), &constants, false);
    }
    for (text, name) in [
        (bouquet(200, 24, &json!({"stop": 0.2})), "gaussian"),
        (harmonics(200, 24, 3), "gaussian"),
        (shells(10, 16, &json!({"stop": 0.6})), "volume"),
    ] {
        let machine = machine(name, &[]);
        answers_as_traced(
            &traced(&text, &machine, &Window::default()),
            &constants(&text, &machine),
            true,
        );
    }
    // If mirrors are seen along rays, requests begin with their pixel.
    let text = r#"{"splats": {"builtin": "glass-spheres", "count": 800}, "image": {"width": 24, "height": 24},
        "materials": [{"unlit": true, "reflect": 0.25}, {"diffuse": 0.8, "reflect": 0.9}], "environment": {"builtin": "sky"}}"#;
    let machine =
        splatsim::hardware::machines::load(root().join("docs/book/reflection/mirror.json"), &[])
            .unwrap();
    let constants = constants(text, &machine);
    let drawn = traced(text, &machine, &Window::default());
    assert!(
        ["fragment.request", "shade.in"]
            .iter()
            .all(|stream| drawn.field(stream, "x") == 0 && drawn.field(stream, "y") == 1)
    );
    answers_as_traced(&drawn, &constants, true);
    answers_as_traced(
        &traced(
            text,
            &machine,
            &Window {
                stimulus: Some(100),
                ..Window::default()
            },
        ),
        &constants,
        false,
    );
}

#[test]
fn a_scoreboard_takes_what_a_trace_has_and_names_what_it_has_not() {
    let text = cloud(300, 32);
    let machine = machine("tiny", &[]);
    let (trace, constants) = (
        traced(&text, &machine, &Window::default()),
        constants(&text, &machine),
    );
    let mut board = Scoreboard::new(&constants, "fragment", 1).unwrap();
    for words in trace.records("fragment.in") {
        board.step(&words).unwrap();
    }
    board.end().unwrap();
    let sides = [
        (PortSide::Out, "fragment.out"),
        (PortSide::Request, "fragment.request"),
        (PortSide::Held, "fragment.held"),
    ];
    for (side, stream) in sides {
        let mut records = trace.records(stream);
        assert!(records.len() > 20 && board.waiting(side) == records.len());
        // Pixels in another order; the records of each pixel in their own order.
        if board.port(side).unwrap().is_per_pixel() {
            records.sort_by_key(|words| [words[0], words[1]]);
        }
        records
            .iter()
            .for_each(|words| board.compare(side, words).unwrap());
        let surplus = board.compare(side, &records[0]).unwrap_err();
        assert!(
            surplus.starts_with(stream) && surplus.contains("one too many"),
            "{surplus}"
        );
    }
    let mut gauss = Scoreboard::new(&constants, "gauss", 1).unwrap();
    gauss.step(&trace.records("gauss.in")[0]).unwrap();
    let weight = trace.records("gauss.out")[0][0];
    let sentence = gauss.compare(PortSide::Out, &[weight + 1]).unwrap_err();
    let given = &trace.records("gauss.in")[0];
    let from = format!(
        "made from record 0 of gauss.in: radial {}, amplitude {}",
        given[0], given[1]
    );
    assert_eq!(
        sentence,
        format!(
            "gauss.out: record 0: field weight is {}, and the model's is {weight}; {from}",
            weight + 1
        )
    );
    // Among many records the exact one; for a surplus record the last one that was given.
    for words in trace.records("gauss.in").iter().take(30) {
        gauss.step(words).unwrap();
    }
    let outs = trace.records("gauss.out");
    (0..20).for_each(|at| gauss.compare(PortSide::Out, &outs[at]).unwrap());
    assert!(
        gauss
            .compare(PortSide::Out, &[outs[20][0] + 1])
            .unwrap_err()
            .contains("made from record 21 of gauss.in: ")
    );
    (21..30).for_each(|at| gauss.compare(PortSide::Out, &outs[at]).unwrap());
    assert!(
        gauss
            .compare(PortSide::Out, &outs[0])
            .unwrap_err()
            .contains("the last record that it took is record 30 of gauss.in: ")
    );
    // Fields without a meaning are not compared.
    let mut ellipse = Scoreboard::new(&constants, "ellipse", 1).unwrap();
    let (inputs, outputs) = (trace.records("ellipse.in"), trace.records("ellipse.out"));
    let (input, mut output) = inputs
        .into_iter()
        .zip(outputs)
        .find(|(_, out)| out[0] == 1)
        .unwrap();
    ellipse.step(&input).unwrap();
    *output.last_mut().unwrap() += 1;
    assert_eq!(ellipse.compare(PortSide::Out, &output), Ok(()));
}

#[test]
fn made_up_records_are_such_as_the_unit_takes_and_others_for_each_seed() {
    for (constants, units) in [
        (&FRAMES[0], FRAMES[0].units()),
        (&FRAMES[5], vec!["ellipse", "sort", "fragment"]),
    ] {
        for name in units {
            let mut board = Scoreboard::new(constants, name, 7).unwrap();
            let records: Vec<Record> = (0..200).map(|_| board.made_up()).collect();
            records.iter().for_each(|words| board.step(words).unwrap());
            // Everything except the corners differs.
            let mut other = Scoreboard::new(constants, name, 8).unwrap();
            assert!(
                records.iter().any(|words| *words != other.made_up()),
                "{name}"
            );
        }
    }
}

#[test]
fn seeds_beside_each_other_share_no_records() {
    let constants = &FRAMES[0];
    // The number of records that are generated at a time.
    let batch = constants.made_up("gauss", 2000, 7).len();
    let mut boards = [7, 8].map(|seed| Scoreboard::new(constants, "gauss", seed).unwrap());
    let [first, others] = boards.each_mut().map(|board| {
        (0..2 * batch)
            .map(|_| board.made_up())
            .collect::<Vec<Record>>()
    });
    assert!(first[..batch] != others[..batch] && first[batch..] != others[..batch]);
}

// ---- The command ----

fn knot(file: &str) -> PathBuf {
    root().join("traces/knot").join(file)
}

fn text_of(file: &str) -> String {
    std::fs::read_to_string(knot(file)).unwrap()
}

/// Arguments for a unit of the committed trace.
fn of_knot(unit: &str, more: &[&str]) -> Vec<String> {
    of_trace(&knot(""), unit, more)
}

fn of_trace(folder: &Path, unit: &str, more: &[&str]) -> Vec<String> {
    let [machine, scene] =
        ["machine.json", "scene.json"].map(|file| folder.join(file).to_str().unwrap().to_owned());
    let arguments = ["unit", unit, "--machine", &machine, "--scene", &scene].map(str::to_owned);
    arguments
        .into_iter()
        .chain(more.iter().map(|argument| (*argument).to_owned()))
        .collect()
}

fn filtered(unit: &str, more: &[&str], input: impl Into<Vec<u8>>) -> Output {
    Command::new(PROGRAM.as_str())
        .args(of_knot(unit, more))
        .write_stdin(input.into())
        .output()
        .unwrap()
}

fn says(output: &Output) -> &str {
    assert_eq!(
        (
            output.status.code(),
            String::from_utf8_lossy(&output.stderr).as_ref()
        ),
        (Some(0), "")
    );
    std::str::from_utf8(&output.stdout).unwrap()
}

/// `cubed` draws the farthest Gaussian first: its sort, alone and in a record that has keys.
#[test]
fn the_sort_of_cubed_is_that_of_its_trace_and_its_record() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let scene = path("city.json");
    let text = r#"{"splats": {"gaussians": "city", "count": 900}, "camera": {"eye": [0, 0.3, 3.95], "target": [0, 0.32, 0]}}"#;
    std::fs::write(&scene, text).unwrap();
    let common = ["--machine", "cubed", "--size", "16x12"];
    let run = |arguments: &[&str], input: Vec<u8>| {
        let output = Command::new(PROGRAM.as_str())
            .args(arguments)
            .args(common)
            .write_stdin(input)
            .output()
            .unwrap();
        says(&output).to_owned()
    };
    let out = path("trace");
    run(
        &["trace", &scene, "--units", "sort", "--out", &out],
        Vec::new(),
    );
    let depths = std::fs::read(path("trace/sort.in.hex")).unwrap();
    let sorted = std::fs::read_to_string(path("trace/sort.out.hex")).unwrap();
    assert!(sorted.lines().count() > 100, "{sorted}");
    let alone = run(&["unit", "sort", "--scene", &scene], depths);
    assert_eq!(alone, sorted);
    let record = path("c.work");
    run(
        &["run", &scene, "--quiet", "--what-if", "--record", &record],
        Vec::new(),
    );
    let replayed = Command::new(PROGRAM.as_str())
        .args(["replay", &record])
        .output()
        .unwrap();
    assert!(says(&replayed).contains("cycles at"));
}

#[test]
fn the_filter_turns_each_input_of_the_committed_trace_into_its_output() {
    for unit in [
        "project", "ellipse", "raster", "gauss", "fragment", "shade", "resolve",
    ] {
        assert_eq!(
            says(&filtered(unit, &[], text_of(&format!("{unit}.in.hex")))),
            text_of(&format!("{unit}.out.hex")),
            "{unit}"
        );
    }
}

#[test]
fn fragment_reads_responses_and_writes_its_requests_and_contents() {
    // Responses that shade would never return.
    let trace = traced(
        &cloud(20, 24),
        &machine("tiny", &[]),
        &Window {
            stimulus: Some(20),
            units: vec!["fragment".into()],
            ..Window::default()
        },
    );
    let [requests, held] = ["asked", "kept"].map(|name| trace.path(name));
    let text = |file: &Path| std::fs::read_to_string(file).unwrap();
    let answers = trace.path("fragment.answer.hex");
    let files = [&answers, &requests, &held].map(|file| file.to_str().unwrap());
    let more = [
        "--answers",
        files[0],
        "--requests",
        files[1],
        "--held",
        files[2],
    ];
    let output = Command::new(PROGRAM.as_str())
        .args(of_trace(&trace.folder, "fragment", &more))
        .write_stdin(text(&trace.path("fragment.in.hex")))
        .output()
        .unwrap();
    assert_eq!(says(&output), text(&trace.path("fragment.out.hex")));
    for (file, expected) in [
        (&requests, "fragment.request.hex"),
        (&held, "fragment.held.hex"),
    ] {
        assert!(text(file).len() > 100);
        assert_eq!(text(file), text(&trace.path(expected)));
    }
}

/// The records of a file of the committed trace as objects.
fn objects(stream: &str) -> Vec<Value> {
    let manifest: Value = serde_json::from_str(&text_of("manifest.json")).unwrap();
    let described = manifest["streams"]
        .as_array()
        .unwrap()
        .iter()
        .find(|other| other["name"] == stream)
        .unwrap()
        .clone();
    let of = |line: &str| {
        let bits: Vec<char> = line
            .chars()
            .flat_map(|digit| {
                format!("{:04b}", digit.to_digit(16).unwrap())
                    .chars()
                    .collect::<Vec<_>>()
            })
            .collect();
        let field = |field: &Value| {
            let [lsb, width] = ["lsb", "width"].map(|name| field[name].as_u64().unwrap() as usize);
            let digits: String = bits[bits.len() - lsb - width..bits.len() - lsb]
                .iter()
                .collect();
            let natural = i64::from_str_radix(&digits, 2).unwrap();
            let word = if field["signed"] == true && digits.starts_with('1') {
                natural - (1 << width)
            } else {
                natural
            };
            (
                field["name"].as_str().unwrap().to_owned(),
                Value::from(word),
            )
        };
        Value::Object(
            described["fields"]
                .as_array()
                .unwrap()
                .iter()
                .map(field)
                .collect(),
        )
    };
    text_of(&format!("{stream}.hex")).lines().map(of).collect()
}

#[test]
fn records_may_be_objects_and_the_outputs_of_each_a_group() {
    let inputs: String = objects("raster.in")
        .iter()
        .map(|object| format!("{object}\n"))
        .collect();
    let output = filtered("raster", &["--json", "--groups"], inputs);
    let groups: Vec<Vec<Value>> = says(&output)
        .split_terminator("\n\n")
        .map(|group| {
            group
                .lines()
                .map(|line| serde_json::from_str(line).unwrap())
                .collect()
        })
        .collect();
    assert_eq!(groups.concat(), objects("raster.out"));
    for (group, input) in groups.iter().zip(objects("raster.in")) {
        assert!(group.iter().all(|fragment| fragment["tag"] == input["tag"]));
    }
}

#[test]
fn a_response_comes_before_the_next_record_is_read() {
    let mut filter = std::process::Command::new(PROGRAM.as_str());
    let mut filter = filter
        .args(of_knot("gauss", &[]))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let (mut input, output) = (
        filter.stdin.take().unwrap(),
        BufReader::new(filter.stdout.take().unwrap()),
    );
    let (told, answers) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        output
            .lines()
            .map_while(Result::ok)
            .all(|line| told.send(line).is_ok())
    });
    for (given, expected) in text_of("gauss.in.hex")
        .lines()
        .zip(text_of("gauss.out.hex").lines())
        .take(20)
    {
        writeln!(input, "{given}").unwrap();
        // A unit that needs more input would never respond: the time limit only ends the test.
        let answer = answers.recv_timeout(Duration::from_secs(60));
        if answer.is_err() {
            filter.kill().unwrap();
        }
        assert_eq!(answer.as_deref(), Ok(expected));
    }
    drop(input);
    assert!(filter.wait().unwrap().success());
}

#[test]
fn an_empty_line_ends_a_frame() {
    let folder = tempfile::tempdir().unwrap();
    let held = folder.path().join("held");
    let once = text_of("fragment.in.hex");
    let output = filtered(
        "fragment",
        &["--held", held.to_str().unwrap()],
        format!("{once}\n{once}"),
    );
    assert_eq!(says(&output), text_of("fragment.out.hex").repeat(2));
    assert_eq!(
        std::fs::read_to_string(held).unwrap(),
        text_of("fragment.held.hex").repeat(2)
    );
}

#[test]
fn a_bad_record_is_refused_by_its_field() {
    let first = |stream: &str| {
        text_of(&format!("{stream}.hex"))
            .lines()
            .next()
            .unwrap()
            .to_owned()
    };
    let (gauss, raster, fragment) = (
        first("gauss.in"),
        first("raster.in"),
        objects("fragment.in").remove(0),
    );
    let with = |object: &Value, field: &str, value: Value| {
        let mut object = object.clone();
        object[field] = value;
        object.to_string()
    };
    let mut without = fragment.clone();
    without.as_object_mut().unwrap().remove("depth");
    let box_of_raster = objects("raster.in").remove(0);
    let layer_at = |x: u8, y: u8| {
        json!({"x": x, "y": y, "last": 0, "empty": 0, "colour_r": 0, "colour_g": 0, "colour_b": 0, "opacity": 0}).to_string()
    };
    let [layer, beside, below] = [layer_at(0, 0), layer_at(1, 0), layer_at(0, 1)];
    let short = &gauss[1..];
    let (unknown, blurred) = (
        format!("{}x", &gauss[..gauss.len() - 1]),
        format!("g{}", &gauss[1..]),
    );
    let cases: Vec<(&str, &[&str], Vec<u8>, &str)> = vec![
        (
            "gauss",
            &[],
            format!("{gauss}\n{short}\n").into(),
            "line 2: 6 digits, and a record of gauss.in has 7",
        ),
        ("gauss", &[], "\n".into(), "line 1: the line is empty"),
        (
            "gauss",
            &[],
            format!("{gauss}\n{gauss}\n{unknown}\n").into(),
            "line 3: field amplitude: `x` is not a hexadecimal digit",
        ),
        (
            "gauss",
            &[],
            blurred.into(),
            "line 1: field radial: `g` is not a hexadecimal digit",
        ),
        (
            "raster",
            &[],
            format!("f{}\n", &raster[1..]).into(),
            "line 1: bits above the",
        ),
        ("gauss", &[], vec![0xff, b'\n'], "line 1: this is not text"),
        (
            "gauss",
            &[],
            vec![b'0'; 70_000],
            "line 1: more than 65536 characters",
        ),
        (
            "gauss",
            &["--json"],
            "{".into(),
            "line 1: not a JSON object",
        ),
        (
            "gauss",
            &["--json"],
            "[1]".into(),
            "line 1: not a JSON object",
        ),
        (
            "gauss",
            &["--json"],
            r#"{"radial": 1, "amplitude": 1, "weight": 1}"#.into(),
            "line 1: field weight: gauss.in has no such field",
        ),
        (
            "gauss",
            &["--json"],
            r#"{"radial": 1.5, "amplitude": 1}"#.into(),
            "line 1: field radial: 1.5, and a whole number is needed",
        ),
        (
            "gauss",
            &["--json"],
            r#"{"radial": -1, "amplitude": 1}"#.into(),
            "line 1: field radial: -1, and 0 to",
        ),
        (
            "gauss",
            &["--json"],
            r#"{"radial": 1, "amplitude": 99999999999}"#.into(),
            "line 1: field amplitude: 99999999999, and 0 to",
        ),
        (
            "fragment",
            &["--json"],
            without.to_string().into(),
            "line 1: field depth: it is missing",
        ),
        (
            "fragment",
            &["--json"],
            with(&fragment, "x", 16.into()).into(),
            "line 1: field x: 16, and 0 to 15",
        ),
        (
            "fragment",
            &["--json"],
            with(&fragment, "y", 16.into()).into(),
            "line 1: field y: 16, and 0 to 15",
        ),
        (
            "fragment",
            &["--json"],
            with(&fragment, "weight", 0.into()).into(),
            "line 1: field weight: 0, and 1 to",
        ),
        (
            "fragment",
            &["--json"],
            with(&fragment, "material", 200.into()).into(),
            "line 1: field material: 200, and 0 to",
        ),
        (
            "raster",
            &["--json"],
            with(&box_of_raster, "last_row", 16.into()).into(),
            "line 1: field last_row: 16, and",
        ),
        (
            "raster",
            &["--json"],
            with(&with_all(&box_of_raster, 9), "last_column", 8.into()).into(),
            "line 1: field last_column: 8, and 9 to 15",
        ),
        (
            "resolve",
            &["--json"],
            format!("{layer}\n").repeat(9).into(),
            "field last: a pixel has at most",
        ),
        (
            "resolve",
            &["--json"],
            format!("{layer}\n{beside}\n").into(),
            "line 2: field x: 1, and the last layer of pixel (0, 0) is missing",
        ),
        (
            "resolve",
            &["--json"],
            format!("{layer}\n{below}\n").into(),
            "line 2: field y: 1, and the last layer of pixel (0, 0) is missing",
        ),
        (
            "resolve",
            &["--json"],
            layer.into(),
            "line 1: field last: the last pixel has no record in which it is 1",
        ),
    ];
    for (unit, more, input, sentence) in cases {
        let output = filtered(unit, more, input);
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{told}");
        assert!(
            told.starts_with("splatsim: standard input: line ")
                && told.contains(sentence)
                && told.lines().count() == 1,
            "{told}"
        );
    }
}

/// A box that begins in this column.
fn with_all(record: &Value, first: i64) -> Value {
    let mut record = record.clone();
    record["first_column"] = first.into();
    record
}

#[test]
fn flags_of_fragment_are_for_fragment_and_responses_are_checked() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("answers");
    std::fs::write(&file, "").unwrap();
    let path = file.to_str().unwrap();
    for (unit, more, sentence) in [
        (
            "gauss",
            &["--answers", path][..],
            "--answers: gauss has no such port",
        ),
        ("shade", &["--held", path], "--held: shade has no such port"),
        (
            "pipeline",
            &[],
            "pipeline: no such unit; there are project, ellipse, raster",
        ),
        (
            "fragment",
            &["--answers", path],
            "there is no answer to request 1",
        ),
        (
            "fragment",
            &["--answers", "nowhere"],
            "nowhere: cannot be read",
        ),
    ] {
        // With one layer, the second surface must merge.
        let output = filtered(
            unit,
            &[more, &["--set", "fragment.layers=1"]].concat(),
            text_of("fragment.in.hex"),
        );
        let told = String::from_utf8(output.stderr).unwrap();
        assert!(
            output.status.code() == Some(2) && told.contains(sentence),
            "{told}"
        );
    }
    std::fs::write(&file, "0\n").unwrap();
    let output = filtered(
        "fragment",
        &["--answers", path, "--set", "fragment.layers=1"],
        text_of("fragment.in.hex"),
    );
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(told.contains("answers: line 1: 1 digits"), "{told}");
}

// ---- Any record ----

/// Frames of every kind.
static FRAMES: LazyLock<Vec<Constants>> = LazyLock::new(|| {
    let discs = cloud(20, 40);
    let few_bits = [
        "fragment.depth=U1F12",
        "fragment.window.through=U1F5",
        "fragment.layers=2",
    ];
    let seeded = ["raster.rows=seeded", "fragment.merge=nearest-pair"];
    vec![
        constants(&discs, &machine("tiny", &[])),
        constants(&discs, &machine("reference", &[])),
        constants(&discs, &machine("lean", &seeded)),
        constants(&discs, &machine("window", &[])),
        constants(&discs, &machine("window", &few_bits)),
        constants(
            &bouquet(20, 24, &json!({"stop": 0.2})),
            &machine("gaussian", &[]),
        ),
        constants(
            &shells(10, 16, &json!({"stop": 0.6})),
            &machine("volume", &[]),
        ),
    ]
});

/// Drives a unit with words that fit into their fields, most of them valid for the unit.
fn survives(constants: &Constants, name: &str, seeds: &[u64]) -> usize {
    let mut unit = Unit::new(constants, name).unwrap();
    let formats: Vec<_> = unit
        .input
        .stream
        .fields
        .iter()
        .map(|field| (field.name.clone(), field.word.format))
        .collect();
    let mut shade = |request: &[i64]| constants.light(request);
    let is_resolve = name == "resolve";
    let mut taken = 0;
    for record in seeds.chunks_exact(formats.len()) {
        let word = |(seed, (name, format)): (&u64, &(String, rtl_model::num::Format))| {
            let any = (*seed >> 8) as i64;
            // Some have any position.
            let likely = !(seed >> 3).is_multiple_of(16);
            let range = i128::from(format.max()) - i128::from(format.min()) + 1;
            let anywhere = (i128::from(any) % range + i128::from(format.min())) as i64;
            match seed % 8 {
                // The layers of a pixel are consecutive.
                _ if likely && is_resolve && ["x", "y"].contains(&name.as_str()) => 5,
                _ if likely && ["x", "y", "first_column", "first_row"].contains(&name.as_str()) => {
                    any % 16
                }
                _ if likely && ["last_column", "last_row"].contains(&name.as_str()) => 15,
                _ if likely && name == "material" => any % 2,
                0 => format.min(),
                1 => format.max(),
                2 => 0,
                3 => anywhere >> (seed % 60),
                _ => anywhere,
            }
        };
        let words: Vec<i64> = record.iter().zip(&formats).map(word).collect();
        match unit.step(&words, &mut shade) {
            Ok(_) => taken += 1,
            // A pixel that cannot become complete is abandoned.
            Err(_) if is_resolve => drop(unit.end(&mut shade)),
            Err(_) => {}
        }
    }
    let end = unit.end(&mut shade);
    assert!(is_resolve || end.is_ok());
    taken
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]
    #[test]
    fn no_record_makes_a_unit_fail(seeds in prop::collection::vec(any::<u64>(), 600)) {
        for constants in FRAMES.iter() {
            for name in constants.units() {
                survives(constants, name, &seeds);
            }
        }
    }

    #[test]
    fn no_line_makes_the_reader_fail(line in ".{0,80}", digits in "[0-9a-f]{20,60}") {
        for name in FRAMES[0].units() {
            let unit = Unit::new(&FRAMES[0], name).unwrap();
            for text in [&line, &digits] {
                let _ = unit.input.read(text);
                let _ = unit.input.read_json(text);
            }
        }
    }

    #[test]
    fn a_record_lies_in_words_of_32_bits_as_in_digits(halves in prop::collection::vec(any::<u32>(), 12)) {
        for name in FRAMES[3].units() {
            let port = Unit::new(&FRAMES[3], name).unwrap().input;
            let count = port.width().div_ceil(32) as usize;
            prop_assume!(count <= halves.len());
            let mut given = halves[..count].to_vec();
            if !port.width().is_multiple_of(32) {
                given[count - 1] &= (1 << (port.width() % 32)) - 1;
            }
            let words = port.unpack(&given).unwrap();
            let digits: String = given.iter().rev().map(|half| format!("{half:08x}")).collect();
            let mut text = Vec::new();
            port.write(&words, &mut text);
            let line = String::from_utf8(text).unwrap();
            prop_assert_eq!(line.trim_end().trim_start_matches('0'), digits.trim_start_matches('0'));
            let mut packed = vec![u32::MAX; count + 1];
            port.pack(&words, &mut packed);
            prop_assert_eq!((&packed[..count], packed[count]), (&given[..], 0));
            prop_assert!(port.unpack(&halves[..count - 1]).is_err());
            prop_assert!(port.unpack(&[&given[..], &[1]].concat()).is_err());
        }
    }
}

#[test]
fn random_records_are_mostly_taken() {
    let mut state = 1u64;
    let mut seeds = Vec::new();
    for _ in 0..2000 {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        seeds.push(state ^ state >> 29);
    }
    for constants in FRAMES.iter() {
        for name in constants.units() {
            assert!(survives(constants, name, &seeds) > 10, "{name}");
        }
    }
}

#[test]
fn the_filter_skips_the_comments_and_addresses_of_writememh() {
    let lines: Vec<String> = text_of("gauss.in.hex")
        .lines()
        .take(20)
        .map(str::to_owned)
        .collect();
    let plain = filtered("gauss", &[], lines.join("\n") + "\n");
    let commented = format!(
        "// 0x00000000\n@0\n{}\n/* 10:\n1f */\n@a\n{} // end\n",
        lines[..10].join("\n"),
        lines[10..].join("\n")
    );
    let again = filtered("gauss", &[], commented);
    assert!(
        again.status.success() && again.stdout == plain.stdout,
        "{}",
        String::from_utf8_lossy(&again.stderr)
    );
    let gap = filtered("gauss", &[], format!("{}\n@7\n", lines[0]));
    assert_eq!(gap.status.code(), Some(2));
    assert!(
        String::from_utf8_lossy(&gap.stderr)
            .contains("line 2: the address is @7, and the next record is 1")
    );
}

#[test]
fn the_words_of_a_record_are_those_that_the_machine_rounds() {
    let folder = tempfile::tempdir().unwrap();
    for unit in [
        "project", "ellipse", "raster", "gauss", "shade", "resolve", "fragment",
    ] {
        let file = folder.path().join(format!("{unit}.csv"));
        let output = filtered(
            unit,
            &["--words", file.to_str().unwrap()],
            text_of(&format!("{unit}.in.hex")),
        );
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        // The responses are the same as without it.
        assert_eq!(says(&output), text_of(&format!("{unit}.out.hex")), "{unit}");
        let text = std::fs::read_to_string(&file).unwrap();
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("record,signal,bits,value,lost"));
        let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
        // A normal leaves ellipse in the word that fragment sums.
        let is_own = |signal: &str| {
            signal.starts_with(&format!("{unit}."))
                || unit == "ellipse" && signal == "fragment.normal"
        };
        assert!(
            rows.iter().all(|row| row.len() == 5 && is_own(row[1])),
            "{unit}"
        );
        let records: std::collections::BTreeSet<usize> =
            rows.iter().map(|row| row[0].parse().unwrap()).collect();
        if unit != "fragment" && unit != "resolve" {
            assert_eq!(
                records.len(),
                text_of(&format!("{unit}.in.hex")).lines().count(),
                "{unit}"
            );
        }
        if unit == "gauss" {
            // The last word of each record is the output of the unit.
            let out = text_of("gauss.out.hex");
            let last = |record: usize| {
                rows.iter()
                    .rfind(|row| row[0] == record.to_string() && row[1] == "gauss.weight")
                    .unwrap()[2]
            };
            assert!(
                out.lines()
                    .enumerate()
                    .all(|(record, line)| last(record) == line)
            );
        }
        if unit == "raster" {
            // Rows of `tiny` are seeded separately: each has an offset and a gradient in each
            // direction.
            let first = &objects("raster.in")[0];
            let seeds = 2
                * (first["last_row"].as_i64().unwrap() - first["first_row"].as_i64().unwrap() + 1);
            for signal in ["raster.offset", "raster.gradient"] {
                let made = rows
                    .iter()
                    .filter(|row| row[0] == "0" && row[1] == signal)
                    .count();
                assert_eq!(made as i64, seeds, "{signal}");
            }
        }
    }
}

/// A subnormal word of an input is not read as zero, nor as itself.
#[test]
fn a_subnormal_word_is_refused_by_a_format_without_them() {
    let text = bouquet(20, 16, &json!({}));
    for (format, refused) in [
        ("U3F22S11", None),
        (
            "U3F22S11N",
            Some("field amplitude: 1023, and U3F22S11N has no subnormal numbers"),
        ),
    ] {
        let machine = machine("fp16", &[&format!("ellipse.amplitude={format}")]);
        let constants = constants(&text, &machine);
        let unit = Unit::new(&constants, "gauss").unwrap();
        let check = |amplitude: i64| {
            let word = |name: &str| i64::from(name == "amplitude") * amplitude;
            let fields = unit.input.stream.fields.iter();
            let words: Vec<i64> = fields.map(|field| word(&field.name)).collect();
            unit.check(&words).map_err(|refused| refused.to_string())
        };
        assert!(check(1024).is_ok() && check(0).is_ok(), "{format}");
        let answer = check(1023).err();
        assert_eq!(answer.as_deref(), refused, "{format}");
    }
}

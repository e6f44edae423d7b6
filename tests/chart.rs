//! Do charts show all rows of a folder, and nothing else?

use crate::program::PROGRAM;
use assert_cmd::Command;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

fn splatsim(arguments: &[&str]) -> Output {
    Command::new(PROGRAM.as_str())
        .args(arguments)
        .output()
        .unwrap()
}

fn ok(output: &Output) -> String {
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn refused(output: &Output) -> String {
    let told = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!(
        (output.status.code(), told.trim_end().lines().count()),
        (Some(2), 1),
        "{told}"
    );
    told
}

/// Carries out a plan with small pictures; returns the folder of rows.
fn swept(folder: &Path, machine: &str, axes: &Value, order: &str, lockstep: bool) -> PathBuf {
    let scene = json!({"splats": {"builtin": "torus-knot", "count": 2000}});
    fs::write(folder.join("knot.json"), scene.to_string()).unwrap();
    let plan = json!({"scenes": ["knot.json"], "size": [32, 24], "machine": machine, "order": order, "axes": axes, "lockstep": lockstep});
    let path = folder.join("plan.json");
    fs::write(&path, plan.to_string()).unwrap();
    let out = folder.join("rows");
    ok(&splatsim(&[
        "sweep",
        path.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
    ]));
    out
}

fn names(folder: &Path, extension: &str) -> Vec<String> {
    let paths = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let of_kind = paths.filter(|path| path.extension().is_some_and(|other| other == extension));
    let mut names: Vec<String> = of_kind
        .map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned())
        .collect();
    names.sort();
    names
}

fn number(row: &Value, columns: &[String], name: &str) -> Option<f64> {
    row[columns.iter().position(|column| column == name).unwrap()].as_f64()
}

/// The data in the page: columns and rows.
fn page_rows(page: &str) -> (Vec<String>, Vec<Value>) {
    let start = page.find("id=\"rows\">").unwrap() + "id=\"rows\">".len();
    let text = &page[start..start + page[start..].find("</script>").unwrap()];
    let all: Value = serde_json::from_str(text).unwrap();
    let columns = all["columns"]
        .as_array()
        .unwrap()
        .iter()
        .map(|name| name.as_str().unwrap().to_owned())
        .collect();
    (columns, all["rows"].as_array().unwrap().clone())
}

#[test]
fn figures_are_of_what_varies() {
    let folder = tempfile::tempdir().unwrap();
    let bits = |field: &str| json!({"field": field, "add_frac_bits": [-2, -1]});
    let words = json!([
        bits("splat.rgb"),
        bits("gauss.weight"),
        bits("resolve.frame"),
        bits("project.pixel"),
        bits("fragment.depth")
    ]);
    let rows = swept(folder.path(), "tiny", &words, "one-at-a-time", true);
    ok(&splatsim(&["chart", rows.to_str().unwrap()]));
    let expected = [
        "accuracy-area",
        "accuracy-speed",
        "host-speed",
        "sensitivity",
        "speed-area",
    ];
    assert_eq!(
        (names(&rows, "png"), names(&rows, "svg")),
        (
            expected.map(String::from).to_vec(),
            expected.map(String::from).to_vec()
        )
    );
    let svg = fs::read_to_string(rows.join("sensitivity.svg")).unwrap();
    for word in [
        "splat.rgb",
        "gauss.weight",
        "resolve.frame",
        "project.pixel",
        "fragment.depth",
        "−2 bits",
        "as it is",
        "dB per bit",
    ] {
        assert!(svg.contains(word), "{word}");
    }
    // Three drawings: with flips, without flips, and their slopes.
    assert_eq!(
        image::open(rows.join("sensitivity.png")).unwrap().width(),
        3 * 640
    );

    let many: Vec<i32> = (-9..3).filter(|bits| *bits != 0).collect();
    let axes = json!([{"field": "splat.rgb", "add_frac_bits": many, "add_int_bits": [1]}]);
    let rows = swept(
        tempfile::tempdir().unwrap().keep().as_path(),
        "lean",
        &axes,
        "one-at-a-time",
        true,
    );
    ok(&splatsim(&["chart", rows.to_str().unwrap()]));
    assert!(names(&rows, "svg").contains(&"curves".to_owned()));
    let svg = fs::read_to_string(rows.join("curves.svg")).unwrap();
    assert!(
        svg.contains("in lockstep")
            && svg.contains("6 dB per bit")
            && svg.contains("fraction bits more than lean has")
    );
    fs::remove_dir_all(rows.parent().unwrap()).unwrap();

    let axes = json!([{"field": "timing.raster.lanes", "values": [[1, 1], [4, 1]]}, {"field": "fragment.layers", "values": [1, 2, 4]}]);
    let rows = swept(
        tempfile::tempdir().unwrap().keep().as_path(),
        "tiny",
        &axes,
        "grid",
        false,
    );
    ok(&splatsim(&["chart", rows.to_str().unwrap()]));
    let svgs = names(&rows, "svg");
    assert!(
        svgs.contains(&"cycles".to_owned()) && svgs.contains(&"layers".to_owned()),
        "{svgs:?}"
    );
    let svg = fs::read_to_string(rows.join("cycles.svg")).unwrap();
    // One picture per unit, one bar per value, one colour per state.
    for unit in [
        "fetch", "project", "ellipse", "raster", "gauss", "fragment", "shade", "resolve",
    ] {
        assert!(svg.contains(&format!(": {unit}")), "{unit}");
    }
    assert!(
        [
            "raster.lanes [4,1], point ",
            "busy",
            "starved",
            "blocked",
            "memory",
            "(limits)"
        ]
        .iter()
        .all(|word| svg.contains(word)),
        "{svg}"
    );
    fs::remove_dir_all(rows.parent().unwrap()).unwrap();
}

/// A text without line breaks.
fn wrapped_once(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn all_three_fronts_are_printed_and_drawn_with_the_parts_of_the_error() {
    let folder = tempfile::tempdir().unwrap();
    let axes = json!([
        {"field": "gauss.weight", "add_frac_bits": [-3, 0]},
        {"field": "fragment.layers", "values": [1, 3]},
        {"field": "timing.raster.lanes", "values": [[1, 1], [4, 1]]},
    ]);
    let rows = swept(folder.path(), "tiny", &axes, "grid", false);
    let told = wrapped_once(&ok(&splatsim(&["chart", rows.to_str().unwrap()])));
    for front in [
        "area and fixed − ideal, dB",
        "frames/s and fixed − ideal, dB",
        "area and frames/s",
    ] {
        assert!(
            told.contains(&format!("beaten by none in {front}")),
            "{front} in {told}"
        );
    }
    // The whole error first, then its parts.
    let svg = fs::read_to_string(rows.join("accuracy-area.svg")).unwrap();
    let at = [
        "the whole error",
        "the error of arithmetic",
        "the error of method",
    ]
    .map(|title| svg.find(title).unwrap_or_else(|| panic!("{title}")));
    assert!(at.is_sorted());
    assert_eq!(
        image::open(rows.join("accuracy-area.png")).unwrap().width(),
        3 * 760
    );

    // If the method's error is the same for all, it is a line.
    let rows = swept(
        tempfile::tempdir().unwrap().keep().as_path(),
        "tiny",
        &json!([{"field": "gauss.weight", "add_frac_bits": [-3, 0]}]),
        "grid",
        false,
    );
    ok(&splatsim(&["chart", rows.to_str().unwrap()]));
    let svg = fs::read_to_string(rows.join("accuracy-area.svg")).unwrap();
    assert!(svg.contains("golden − ideal, ") && !svg.contains("the error of method"));
    assert_eq!(
        image::open(rows.join("accuracy-area.png")).unwrap().width(),
        2 * 760
    );
    fs::remove_dir_all(rows.parent().unwrap()).unwrap();
}

#[test]
fn the_chart_of_a_search_marks_start_target_and_result() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("knot.json");
    fs::write(
        &scene,
        json!({"splats": {"builtin": "torus-knot", "count": 2000}}).to_string(),
    )
    .unwrap();
    for (against, target) in [("golden", "30"), ("ideal", "20")] {
        let out = folder.path().join(against);
        let common = [
            "search",
            scene.to_str().unwrap(),
            "--size",
            "24x20",
            "--machine",
            "lean",
            "--views",
            "0",
            "--tries",
            "5",
            "--only",
            "gauss",
        ];
        ok(&splatsim(
            &[
                &common[..],
                &[
                    "--target-psnr",
                    target,
                    "--against",
                    against,
                    "--out",
                    out.to_str().unwrap(),
                ],
            ]
            .concat(),
        ));
        ok(&splatsim(&["chart", out.to_str().unwrap()]));
        let svg = fs::read_to_string(out.join("accuracy-area.svg")).unwrap();
        for word in ["start", "found", &format!("target, {target} dB"), "lean"] {
            assert!(svg.contains(word), "{against}: {word}");
        }
    }
}

/// The front by comparing all rows of the page with each other.
#[test]
fn the_front_of_a_folder_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let bits = |field: &str| json!({"field": field, "add_frac_bits": [-3, -2, -1, 0]});
    let rows = swept(
        folder.path(),
        "tiny",
        &json!([
            bits("splat.rgb"),
            bits("gauss.weight"),
            bits("raster.offset")
        ]),
        "grid",
        false,
    );
    let told = ok(&splatsim(&["chart", rows.to_str().unwrap()]));
    let (columns, all) = page_rows(&fs::read_to_string(rows.join("charts.html")).unwrap());
    let points: Vec<[f64; 3]> = (all.iter())
        .filter_map(|row| {
            Some([
                number(row, &columns, "area")?,
                number(row, &columns, "fixed_vs_ideal_psnr_db")?,
                number(row, &columns, "point")?,
            ])
        })
        .collect();
    assert_eq!(points.len(), 64);
    let beats =
        |a: &[f64; 3], b: &[f64; 3]| a[0] <= b[0] && a[1] >= b[1] && (a[0] < b[0] || a[1] > b[1]);
    let front: Vec<&[f64; 3]> = points
        .iter()
        .filter(|point| !points.iter().any(|other| beats(other, point)))
        .collect();
    assert!(front.len() > 3 && front.len() < 20, "{front:?}");
    let mut places: Vec<[f64; 2]> = front.iter().map(|point| [point[0], point[1]]).collect();
    places.sort_by(|a, b| a[0].total_cmp(&b[0]));
    places.dedup();
    let said = wrapped_once(&told);
    assert!(
        said.contains(&format!(
            "of 64 machines {} are beaten by none in area and fixed − ideal, dB",
            places.len()
        )),
        "{told}"
    );
    // Common properties of all machines of a front are named once.
    let (_, of_speed) = said
        .split_once("in frames/s and fixed − ideal, dB; ")
        .expect("the second front");
    let of_speed = of_speed.split("knot.json: ").next().unwrap();
    assert!(
        of_speed.starts_with("all with splat.rgb −3 ")
            && of_speed.matches("splat.rgb").count() == 1,
        "{told}"
    );
    let table = told.split("\n\n").next().unwrap();
    assert!(
        table
            .lines()
            .any(|line| line.contains("fixed − ideal dB") && line.contains("fixed − golden dB")),
        "{told}"
    );
    // Each place once, by its first point, followed by the changed fields.
    let listed: Vec<&str> = table
        .lines()
        .filter(|line| {
            line.split_whitespace()
                .next()
                .is_some_and(|word| word.parse::<u64>().is_ok())
        })
        .collect();
    assert_eq!(listed.len(), places.len(), "{told}");
    for place in &places {
        let first = front
            .iter()
            .filter(|point| point[..2] == place[..])
            .map(|point| point[2])
            .fold(f64::INFINITY, f64::min);
        let at = table
            .lines()
            .position(|line| line.split_whitespace().next() == Some(&first.to_string()));
        let changes = table
            .lines()
            .nth(at.unwrap_or_else(|| panic!("{first} in\n{table}")) + 1)
            .unwrap();
        assert!(
            changes.starts_with("    ") && changes.contains('−'),
            "{changes}"
        );
    }
    assert!(
        told.lines().all(|line| line.chars().count() <= 80),
        "{told}"
    );
    // The ends of the front are named in the chart: by their changed fields, or by their number.
    let svg = fs::read_to_string(rows.join("accuracy-area.svg")).unwrap();
    assert!(
        svg.contains("tiny") && svg.contains("splat.rgb −3"),
        "the base machine and the cheapest one"
    );
}

#[test]
fn the_page_needs_nothing_else_and_holds_every_row() {
    let folder = tempfile::tempdir().unwrap();
    let rows = swept(
        folder.path(),
        "tiny",
        &json!([{"field": "fragment.layers", "values": [1, 2, 3]}, {"field": "project.camera", "values": ["U2F8", "I2F12"]}]),
        "grid",
        false,
    );
    ok(&splatsim(&["chart", rows.to_str().unwrap(), "--quiet"]));
    let page = fs::read_to_string(rows.join("charts.html")).unwrap();
    // The name space of SVG is an address, but is not requested.
    let asked = page.replace("http://www.w3.org/2000/svg", "");
    assert!(!asked.contains("http") && !asked.contains("src=") && !asked.contains("@import"));
    for name in names(&rows, "svg") {
        assert!(page.contains(&format!("id=\"{name}\"")), "{name}");
    }
    let (columns, all) = page_rows(&page);
    assert_eq!(all.len(), 6);
    assert!(
        columns.contains(&"psnr_db".to_owned())
            && columns.contains(&"misfit".to_owned())
            && !columns.contains(&"host_seconds".to_owned())
    );
    assert!(
        page.contains("scene = knot.json"),
        "common fields of all rows are printed once"
    );
}

#[test]
fn charts_are_the_same_bytes_every_time() {
    let folder = tempfile::tempdir().unwrap();
    let rows = swept(
        folder.path(),
        "tiny",
        &json!([{"field": "fragment.layers", "values": [1, 2, 4]}]),
        "grid",
        false,
    );
    let read = || {
        ok(&splatsim(&["chart", rows.to_str().unwrap()]));
        let all = ["png", "svg"].map(|extension| {
            names(&rows, extension)
                .into_iter()
                .map(|name| (rows.join(name).with_extension(extension), extension))
                .collect::<Vec<_>>()
        });
        all.concat()
            .into_iter()
            .map(|(path, _)| (path.clone(), fs::read(path).unwrap()))
            .collect::<Vec<_>>()
    };
    let first = read();
    assert!(first.len() > 6);
    assert_eq!(first, read());
}

#[test]
fn a_folder_without_rows_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let rows = swept(
        folder.path(),
        "tiny",
        &json!([{"field": "fragment.layers", "values": [1, 2]}]),
        "grid",
        false,
    );
    let chart = |path: &Path| refused(&splatsim(&["chart", path.to_str().unwrap()]));
    assert!(chart(&folder.path().join("nowhere")).contains("cannot be read"));
    let empty = folder.path().join("empty");
    fs::create_dir(&empty).unwrap();
    assert!(chart(&empty).contains("not a folder of `sweep` or `search`"));
    let plan = fs::read_to_string(rows.join("plan.json")).unwrap();
    fs::write(rows.join("plan.json"), plan.replace("\"U1F", "\"X1F")).unwrap();
    assert!(chart(&rows).contains("plan.json: machine: "));
    fs::write(rows.join("plan.json"), "{").unwrap();
    assert!(chart(&rows).contains("not JSON"));
    fs::remove_file(rows.join("plan.json")).unwrap();
    assert!(chart(&rows).contains("plan.json: cannot be read"));
    fs::write(rows.join("plan.json"), plan).unwrap();
    let journal = fs::read_to_string(rows.join("points.jsonl")).unwrap();
    fs::write(
        rows.join("points.jsonl"),
        journal.replace("knot.json", "knot.JSON"),
    )
    .unwrap();
    assert!(chart(&rows).contains("line 2: is not as it was written"));
    fs::write(
        rows.join("points.jsonl"),
        journal.lines().next().unwrap().to_owned() + "\n",
    )
    .unwrap();
    assert!(chart(&rows).contains("has no rows yet"));
    fs::write(rows.join("points.jsonl"), "{}\n").unwrap();
    assert!(chart(&rows).contains("line 1: has no columns"));
    assert!(names(&rows, "png").is_empty());
}

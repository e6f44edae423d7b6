//! Does a search find a machine that cannot be narrowed further, and that also meets the target
//! from unseen cameras?

use crate::handmade::glass;
use crate::program::PROGRAM;
use crate::tier::{self, Tier};
use assert_cmd::Command;
use rayon::prelude::*;
use rtl_model::Machine;
use rtl_model::num::Format;
use rtl_model::pipeline::Elaborated;
use rtl_model::timing::{self, Detail};
use serde_json::{Value, json};
use splatsim::explore::search::{Domain, over_fragment, over_timing};
use splatsim::hardware::{fixed, machines};
use splatsim::performance::cost::{Cost, Prices};
use splatsim::run::evaluation::Evaluation;
use std::collections::HashSet;
use std::ffi::OsStr;
use std::fs;
use std::path::Path;
use std::process::{Output, Stdio};
use std::time::Duration;

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

fn refused(arguments: &[&str], says: &str) {
    let output = splatsim(arguments);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(
        (output.status.code(), told.trim_end().lines().count()),
        (Some(2), 1),
        "{told}"
    );
    assert!(told.contains(says), "{told}");
}

fn read(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

fn scene(folder: &Path, name: &str, more: &Value) -> String {
    let mut scene = json!({"splats": {"builtin": "torus-knot", "count": 2000}, "lights": [{"direction": [0.4, 0.8, 0.5], "rgb": [1, 1, 1]}]});
    scene
        .as_object_mut()
        .unwrap()
        .extend(more.as_object().unwrap().clone());
    let path = folder.join(name);
    fs::write(&path, scene.to_string()).unwrap();
    path.to_str().unwrap().to_owned()
}

/// A quarter of the splats, for searches that draw thousands of machines.
fn few_splats() -> Value {
    json!({"splats": {"builtin": "torus-knot", "count": 500}})
}

/// PSNR and area of a machine on a scene, as `run` reports them.
fn ran(folder: &Path, scene: &str, machine: &str, size: &str) -> (f64, f64) {
    let out = folder.join("run");
    ok(&splatsim(&[
        "run",
        scene,
        "--machine",
        machine,
        "--size",
        size,
        "--out",
        out.to_str().unwrap(),
        "--quiet",
    ]));
    let report = read(&out.join("report.json"));
    (
        report["accuracy"]["fixed_vs_golden"]["psnr_db"]
            .as_f64()
            .unwrap(),
        report["cost"]["area"].as_f64().unwrap(),
    )
}

#[test]
fn a_machine_is_found_that_meets_the_target_elsewhere_too() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = scene(folder.path(), "knot.json", &few_splats());
    let out = folder.path().join("out");
    let dir = out.to_str().unwrap();
    let told = ok(&splatsim(&[
        "search",
        &path,
        "--size",
        "32x24",
        "--target-psnr",
        "35",
        "--views",
        "3",
        "--tries",
        "30",
        "--out",
        dir,
    ]));
    assert!(
        told.lines().all(|line| line.chars().count() <= 80),
        "{told}"
    );
    assert!(
        told.contains("holds on 3 unseen views")
            && told.contains("less than reference")
            && told.contains("critical word lengths"),
        "{told}"
    );
    let machine = out.join("machine.json");
    let found = read(&out.join("search.json"));
    let (psnr, area) = ran(folder.path(), &path, machine.to_str().unwrap(), "32x24");
    let last = found["path"].as_array().unwrap().last().unwrap();
    // The file has the worst of all views used by the search.
    assert!(
        last["psnr_db"].as_f64().unwrap() <= psnr && last["area"].as_f64() == Some(area),
        "{last}: {psnr} dB, {area}"
    );
    let (whole_psnr, whole) = ran(folder.path(), &path, "reference", "32x24");
    let first = &found["path"][0];
    assert_eq!(
        (first["psnr_db"].as_f64(), first["area"].as_f64()),
        (Some(whole_psnr), Some(whole))
    );
    assert!(
        psnr >= 35.0 && area < 0.6 * whole,
        "{psnr} dB, {area} of {whole}"
    );
    // The unseen views are listed in the file, and meet the target.
    let views = found["views"].as_array().unwrap();
    assert_eq!(views.len(), 3);
    let framed = read_camera(&path);
    for view in views {
        let mut camera = framed.clone();
        camera["eye"] = view["eye"].clone();
        let mut more = few_splats();
        more["camera"] = camera;
        let seen = scene(folder.path(), "view.json", &more);
        let (psnr, _) = ran(folder.path(), &seen, machine.to_str().unwrap(), "32x24");
        assert!(psnr >= 35.0, "{view}: {psnr}");
        assert!(
            (view["psnr_db"].as_f64().unwrap() - psnr).abs() < 1e-6,
            "{view}: {psnr}"
        );
    }
    // A row for every machine that was drawn, and charts of them.
    let rows = fs::read_to_string(out.join("points.jsonl"))
        .unwrap()
        .lines()
        .count() as u64
        - 1;
    let drawn = last["drawn"].as_u64().unwrap();
    assert!(
        (drawn..drawn + 100).contains(&rows),
        "{rows}, and {drawn} before it was asked what is tight"
    );
    ok(&splatsim(&["chart", dir]));
    assert!(out.join("accuracy-area.png").exists());
    // A repeated search draws nothing, and finds the same machine.
    let before = fs::read(&machine).unwrap();
    ok(&splatsim(&[
        "search",
        &path,
        "--size",
        "32x24",
        "--target-psnr",
        "35",
        "--views",
        "3",
        "--tries",
        "30",
        "--out",
        dir,
        "--threads",
        "1",
    ]));
    assert_eq!(fs::read(&machine).unwrap(), before);
    assert_eq!(
        fs::read_to_string(out.join("points.jsonl"))
            .unwrap()
            .lines()
            .count() as u64
            - 1,
        rows
    );
}

/// The default camera of the scene. Lights and the z threshold depend on it too, so the scene is
/// read.
fn read_camera(path: &str) -> Value {
    let scene = splatsim::scene::Scene::load(
        path,
        &splatsim::scene::Overrides {
            size: Some((32, 24)),
        },
    )
    .unwrap();
    let camera = scene.camera;
    json!({"eye": camera.eye.to_array(), "target": camera.target.to_array(), "up": camera.up.to_array(),
        "fov_y_degrees": camera.fov_y_degrees, "near": camera.near})
}

/// All machines of four words, drawn by `sweep`, compared with a search that draws few of them.
#[test]
fn it_is_close_to_the_best_of_all() {
    if !tier::runs(Tier::Full) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = scene(folder.path(), "knot.json", &json!({}));
    let words = [
        ("splat.rgb", 6),
        ("gauss.weight", 7),
        ("fragment.normal", 6),
        ("raster.offset", 5),
    ];
    let axes: Vec<Value> =
        words.iter().map(|(field, most)| json!({"field": field, "add_frac_bits": (-most..=0).collect::<Vec<i32>>()})).collect();
    let plan = folder.path().join("plan.json");
    let text = json!({"scenes": [path], "size": [24, 20], "machine": "lean", "axes": axes, "lockstep": false});
    fs::write(&plan, text.to_string()).unwrap();
    let all = folder.path().join("all");
    ok(&splatsim(&[
        "sweep",
        plan.to_str().unwrap(),
        "--out",
        all.to_str().unwrap(),
    ]));
    let text = fs::read_to_string(all.join("points.jsonl")).unwrap();
    let columns: Vec<String> = serde_json::from_str(text.lines().next().unwrap()).unwrap();
    let at = |name: &str| {
        columns
            .iter()
            .position(|column| column.starts_with(&format!("{name}:")))
            .unwrap()
    };
    let rows: Vec<Value> = text
        .lines()
        .skip(1)
        .map(|line| serde_json::from_str::<Value>(line).unwrap()[1].clone())
        .collect();
    assert_eq!(rows.len(), 7 * 8 * 7 * 6);
    let (psnr, area) = (at("psnr_db"), at("area"));
    for target in tier::some([12, 12], [30.0, 34.0, 37.0]) {
        let well = rows
            .iter()
            .filter(|row| row[psnr].as_f64().is_some_and(|db| db >= target));
        let best = well
            .filter_map(|row| row[area].as_f64())
            .fold(f64::INFINITY, f64::min);
        let whole = rows
            .iter()
            .filter_map(|row| row[area].as_f64())
            .fold(0.0, f64::max);
        assert!(
            best < 0.995 * whole,
            "there is nothing to find: {best} of {whole}"
        );
        let out = folder.path().join(format!("out-{target}"));
        let target = target.to_string();
        let mut arguments = vec![
            "search",
            &path,
            "--size",
            "24x20",
            "--machine",
            "lean",
            "--target-psnr",
            &target,
            "--views",
            "0",
            "--out",
        ];
        arguments.push(out.to_str().unwrap());
        words
            .iter()
            .for_each(|(word, _)| arguments.extend(["--only", *word]));
        ok(&splatsim(&arguments));
        let found = read(&out.join("search.json"));
        let last = found["path"].as_array().unwrap().last().unwrap();
        let area = last["area"].as_f64().unwrap();
        // Relative to the area of these words, not of the whole machine, most of which does not
        // depend on them.
        assert!(
            area - best <= 0.05 * (whole - best) && area <= 1.05 * best,
            "{target} dB: {area}, where {best} can be had of {whole}"
        );
        assert!(last["drawn"].as_u64().unwrap() < 700, "{last}");
    }
}

/// Starts the program and kills it after `wait_ms`, at any point.
fn start_and_kill(wait_ms: u64, arguments: impl IntoIterator<Item = impl AsRef<OsStr>>) {
    let mut command = std::process::Command::new(PROGRAM.as_str());
    let mut child = command
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_millis(wait_ms));
    let _ = child.kill();
    child.wait().unwrap();
}

#[test]
fn a_search_that_is_killed_goes_on() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = scene(folder.path(), "knot.json", &few_splats());
    let arguments = |out: &str| {
        let all = [
            "search",
            &path,
            "--size",
            "24x20",
            "--machine",
            "tiny",
            "--target-psnr",
            "24",
            "--views",
            "2",
            "--tries",
            "40",
            "--out",
            out,
        ];
        all.map(str::to_owned)
    };
    let [whole, killed] = ["whole", "killed"].map(|name| folder.path().join(name));
    let run = |out: &Path| {
        ok(&Command::new(PROGRAM.as_str())
            .args(arguments(out.to_str().unwrap()))
            .output()
            .unwrap())
    };
    run(&whole);
    for wait_ms in [30, 200, 90, 400, 260, 150] {
        start_and_kill(wait_ms, arguments(killed.to_str().unwrap()));
    }
    run(&killed);
    assert_eq!(
        fs::read(whole.join("machine.json")).unwrap(),
        fs::read(killed.join("machine.json")).unwrap()
    );
    let keys = |out: &Path| -> Vec<Value> {
        let text = fs::read_to_string(out.join("points.jsonl")).unwrap();
        text.lines()
            .skip(1)
            .map(|line| serde_json::from_str::<Value>(line).unwrap()[1][1].clone())
            .collect()
    };
    let found = keys(&killed);
    assert_eq!(
        found
            .iter()
            .map(Value::to_string)
            .collect::<HashSet<_>>()
            .len(),
        found.len(),
        "a machine was drawn twice"
    );
    assert_eq!(found, keys(&whole), "other machines, or in another order");
}

/// Arguments of a search of two units on a scene that is large enough for samples of tiles.
fn sampled<'a>(scene: &'a str, target: &'a str, out: &'a str) -> Vec<&'a str> {
    let mut arguments = vec![
        "search",
        scene,
        "--size",
        "128x128",
        "--target-psnr",
        target,
    ];
    arguments.extend([
        "--only",
        "gauss",
        "--only",
        "raster",
        "--only",
        "fragment.depth",
    ]);
    arguments.extend(["--views", "0", "--tries", "10", "--out", out]);
    arguments
}

/// Rows of a search: keys, and tiles if only a sample was drawn.
fn rows(out: &Path) -> Vec<(String, Option<u64>)> {
    let text = fs::read_to_string(out.join("points.jsonl")).unwrap();
    let row = |line: &str| {
        let row = serde_json::from_str::<Value>(line).unwrap()[1].clone();
        // An estimate is not given as a figure of the picture.
        let is_sampled = row.get(14).is_some_and(Value::is_u64);
        assert!(!is_sampled || row[6].is_null() && row[15].is_f64(), "{row}");
        (row[1].to_string(), row.get(14).and_then(Value::as_u64))
    };
    text.lines().skip(1).map(row).collect()
}

#[test]
fn screening_finds_machines_as_small_as_full_drawings_do() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let builtin = |name: &str| json!({"splats": {"builtin": name, "count": 3000}});
    let searches = [
        ("torus-knot", "45"),
        ("glass-spheres", "45"),
        ("terrain", "40"),
        ("checkerboard", "45"),
    ];
    for (name, target) in searches {
        let path = folder.path().join(format!("{name}.json"));
        fs::write(&path, builtin(name).to_string()).unwrap();
        let path = path.to_str().unwrap();
        let found = |screen: &str| {
            let out = folder.path().join(format!("{name}-{screen}"));
            let mut arguments = sampled(path, target, out.to_str().unwrap());
            arguments.extend(["--screen", screen, "--quiet"]);
            ok(&splatsim(&arguments));
            let machine = out.join("machine.json");
            let (psnr_db, area) = ran(folder.path(), path, machine.to_str().unwrap(), "128x128");
            (psnr_db, area, rows(&out))
        };
        let (psnr_db, area, drawn) = found("on");
        let (_, least, all) = found("off");
        let wanted: f64 = target.parse().unwrap();
        assert!(psnr_db >= wanted, "{name}: {psnr_db} dB");
        assert!(
            area <= 1.02 * least,
            "{name}: {area} LUT equivalents instead of {least}"
        );
        let samples = drawn.iter().filter(|(_, tiles)| tiles.is_some()).count();
        assert!(
            2 * samples > drawn.len(),
            "{name}: {samples} samples in {} rows",
            drawn.len()
        );
        assert!(all.iter().all(|(_, tiles)| tiles.is_none()), "{name}");
    }
}

/// With one step less, critical words miss the target on a searched view, and have its PSNR.
#[test]
fn critical_words_have_the_psnr_of_a_view_that_misses_the_target() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, target) = (folder.path(), 45.0);
    let scenes = ["torus-knot", "glass-spheres"].map(|name| {
        let path = folder.join(format!("{name}.json"));
        let scene = json!({"splats": {"builtin": name, "count": 3000}});
        fs::write(&path, scene.to_string()).unwrap();
        path.to_str().unwrap().to_owned()
    });
    let out = folder.join("out");
    let mut arguments = sampled(&scenes[0], "45", out.to_str().unwrap());
    arguments.extend([&scenes[1], "--quiet"]);
    ok(&splatsim(&arguments));
    let (found, machine) = (
        read(&out.join("search.json")),
        read(&out.join("machine.json")),
    );
    let words = found["tight"].as_array().unwrap().iter();
    let bits = words.filter_map(|word| {
        let mut parts = ["integer-bit", "fraction-bit"].into_iter();
        Some((word, parts.find(|part| word["part"] == *part)?))
    });
    let critical: Vec<(&Value, &str)> = bits.step_by(3).collect();
    assert!(!critical.is_empty(), "{}", found["tight"]);
    for (word, part) in critical {
        let bit = (word["path"].as_str().unwrap().to_owned(), part);
        let less = folder.join("less.json");
        fs::write(&less, without(&machine, &[bit]).to_string()).unwrap();
        let stated = word["psnr_db"].as_f64().unwrap();
        assert!(stated < target, "{word}");
        let on_views = scenes
            .each_ref()
            .map(|scene| ran(folder, scene, less.to_str().unwrap(), "128x128").0);
        assert!(
            on_views.iter().any(|psnr| (psnr - stated).abs() < 1e-6),
            "{on_views:?}: {word}"
        );
    }
}

#[test]
fn a_screened_search_that_is_killed_goes_on() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = scene(folder.path(), "knot.json", &json!({}));
    let [whole, killed] = ["whole", "killed"].map(|name| folder.path().join(name));
    let arguments = |out: &Path| -> Vec<String> {
        let arguments = sampled(&path, "45", out.to_str().unwrap());
        arguments.into_iter().map(str::to_owned).collect()
    };
    let run = |out: &Path| {
        ok(&Command::new(PROGRAM.as_str())
            .args(arguments(out))
            .output()
            .unwrap())
    };
    run(&whole);
    for wait_ms in [700, 900, 1100, 800] {
        start_and_kill(wait_ms, arguments(&killed));
    }
    run(&killed);
    let [expected, found] = [&whole, &killed].map(|out| rows(out));
    assert!(
        expected.iter().any(|(_, tiles)| tiles.is_some()),
        "no samples"
    );
    assert_eq!(
        found, expected,
        "other machines or samples, or in another order"
    );
    let machine = |out: &Path| fs::read(out.join("machine.json")).unwrap();
    assert_eq!(machine(&whole), machine(&killed));
}

#[test]
fn a_budget_ends_a_search_with_a_machine_that_meets_the_target() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = scene(folder.path(), "knot.json", &json!({}));
    let out = folder.path().join("out");
    let told = ok(&splatsim(&[
        "search",
        &path,
        "--size",
        "128x128",
        "--target-psnr",
        "40",
        "--budget",
        "3s",
        "--out",
        out.to_str().unwrap(),
    ]));
    assert!(
        told.contains("the budget of 3 s ended in round 1"),
        "{told}"
    );
    let report = read(&out.join("search.json"));
    let not_tried = report["stopped"]["not_tried"].as_array().unwrap();
    assert_eq!(not_tried.last().unwrap(), "unseen views", "{report}");
    assert_eq!(report["tight"], json!([]));
    let machine = out.join("machine.json");
    let (psnr_db, _) = ran(folder.path(), &path, machine.to_str().unwrap(), "128x128");
    assert!(psnr_db >= 40.0, "{psnr_db}");
}

#[test]
fn words_that_no_scene_uses_are_left_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let path = scene(folder.path(), "knot.json", &json!({}));
    let out = folder.path().join("out");
    let mut arguments = vec!["search", &path, "--size", "24x20", "--target-psnr", "30"];
    arguments.extend([
        "--only",
        "gauss.weight",
        "--only",
        "colour",
        "--views",
        "0",
        "--machine",
        "gaussian",
    ]);
    arguments.extend(["--tries", "5", "--out", out.to_str().unwrap()]);
    let told = ok(&splatsim(&arguments));
    assert!(told.contains("no searched scene uses colour"), "{told}");
    let found = read(&out.join("machine.json"));
    let reference: Value = serde_json::to_value(Machine::named("gaussian").unwrap()).unwrap();
    assert_eq!(found["colour"], reference["colour"]);
    assert_eq!(read(&out.join("search.json"))["unused"], json!(["colour"]));
}

fn complained(output: &Output) -> String {
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stderr.clone()).unwrap()
}

#[test]
fn a_machine_that_was_searched_warns_outside_of_that() {
    let folder = tempfile::tempdir().unwrap();
    let path = scene(folder.path(), "knot.json", &json!({}));
    let out = folder.path().join("out");
    let quick = [
        "--target-psnr",
        "30",
        "--views",
        "2",
        "--tries",
        "5",
        "--only",
        "gauss",
    ];
    ok(&splatsim(
        &[
            &[
                "search",
                &path,
                "--size",
                "32x24",
                "--out",
                out.to_str().unwrap(),
            ],
            &quick[..],
        ]
        .concat(),
    ));
    let machine = out.join("machine.json");
    let file = machine.to_str().unwrap();
    let record = read(&machine)["searched"].clone();
    assert_eq!(
        record["target"],
        json!({"psnr_db": 30.0, "max_error": null, "no_saturation": false, "against": "golden"})
    );
    let own = &record["scenes"][0];
    assert_eq!(
        [&own["name"], &own["width"], &own["height"]],
        [&json!("knot.json"), &json!(32), &json!(24)]
    );
    let [searched, unseen] = [
        &read(&out.join("search.json"))["cameras"],
        &read(&out.join("search.json"))["views"],
    ]
    .map(|views| {
        views
            .as_array()
            .unwrap()
            .iter()
            .map(|view| view["camera"].clone())
            .collect::<Vec<_>>()
    });
    assert_eq!(
        own["cameras"].as_array().unwrap()[..],
        [searched, unseen].concat()
    );

    // Inside the domain there is no warning, and the report has an empty list. The same for an
    // unseen side at the same distance.
    let report = folder.path().join("run");
    let run = |more: &[&str]| {
        let output = splatsim(
            &[
                &[
                    "run",
                    "--machine",
                    file,
                    "--out",
                    report.to_str().unwrap(),
                    "--quiet",
                ],
                more,
            ]
            .concat(),
        );
        (
            complained(&output),
            read(&report.join("report.json"))["machine"]["outside_of_search"].clone(),
        )
    };
    assert_eq!(run(&[&path, "--size", "32x24"]), (String::new(), json!([])));
    assert_eq!(
        run(&[&path, "--size", "32x24", "--set", "timing.raster.fifo=4"]).1,
        json!([])
    );
    let framed = read_camera(&path);
    let turned = |eye: [f64; 3]| {
        let mut camera = framed.clone();
        camera["eye"] = json!(eye);
        scene(folder.path(), "turned.json", &json!({"camera": camera}))
    };
    let numbers =
        |name: &str| -> [f64; 3] { serde_json::from_value(framed[name].clone()).unwrap() };
    let (eye, target) = (numbers("eye"), numbers("target"));
    let moved = |factor: f64| -> [f64; 3] {
        std::array::from_fn(|axis| target[axis] + factor * (eye[axis] - target[axis]))
    };
    assert_eq!(run(&[&turned(moved(-1.0)), "--size", "32x24"]).1, json!([]));

    // Outside: one sentence, and an entry in the report.
    let terrain = folder.path().join("terrain.json");
    fs::write(
        &terrain,
        json!({"splats": {"builtin": "terrain", "count": 500}}).to_string(),
    )
    .unwrap();
    let near = turned(moved(0.5));
    for (arguments, says) in [
        (
            vec![path.as_str(), "--size", "64x48"],
            "64×48 pixels instead of 32×24",
        ),
        (
            vec![near.as_str(), "--size", "32x24"],
            "from its target instead of",
        ),
        (
            vec![terrain.to_str().unwrap(), "--size", "32x24"],
            "the scene terrain.json instead of knot.json",
        ),
        (
            vec![
                path.as_str(),
                "--size",
                "32x24",
                "--set",
                "fragment.layers=2",
            ],
            "a word that --set changed",
        ),
    ] {
        let (told, outside) = run(&arguments);
        assert_eq!(told.trim_end().lines().count(), 1, "{told}");
        assert!(
            told.starts_with(
                "splatsim: warning: machine knot-30dB was searched on knot.json for at least 30 dB"
            ) && told.contains(says),
            "{told}"
        );
        let outside = outside.as_array().unwrap();
        assert!(
            outside.len() == 1 && outside[0].as_str().unwrap().contains(says),
            "{outside:?}"
        );
    }
    // A machine without a search has no such entry.
    ok(&splatsim(&[
        "run",
        &path,
        "--size",
        "8x8",
        "--machine",
        "tiny",
        "--out",
        report.to_str().unwrap(),
        "--quiet",
    ]));
    assert_eq!(
        read(&report.join("report.json"))["machine"].get("outside_of_search"),
        None
    );

    // The record stays in the file until a word changes.
    let show = |more: &[&str]| {
        serde_json::from_str::<Value>(&ok(&splatsim(&[&["machine", "show", file], more].concat())))
            .unwrap()
    };
    assert_eq!(show(&[]), read(&machine));
    assert_eq!(show(&["--set", "timing.raster.fifo=4"])["searched"], record);
    assert_eq!(show(&["--set", "fragment.layers=2"]).get("searched"), None);

    // Rows do not depend on it.
    let mut bare = read(&machine);
    bare.as_object_mut().unwrap().remove("searched");
    fs::write(folder.path().join("bare.json"), bare.to_string()).unwrap();
    let keys = |name: &str| {
        let plan = folder.path().join("plan.json");
        let text = json!({"scenes": ["knot.json"], "size": [8, 8], "machine": name, "axes": [], "lockstep": false});
        fs::write(&plan, text.to_string()).unwrap();
        let rows = tempfile::tempdir().unwrap();
        ok(&splatsim(&[
            "sweep",
            plan.to_str().unwrap(),
            "--out",
            rows.path().to_str().unwrap(),
        ]));
        let text = fs::read_to_string(rows.path().join("points.jsonl")).unwrap();
        serde_json::from_str::<Value>(text.lines().nth(1).unwrap()).unwrap()[1][1].clone()
    };
    assert_eq!(keys("out/machine.json"), keys("bare.json"));

    // It is read as strictly as other fields.
    let wrong = |change: &dyn Fn(&mut Value), says: &str| {
        let mut changed = read(&machine);
        change(&mut changed["searched"]);
        let path = folder.path().join("wrong.json");
        fs::write(&path, changed.to_string()).unwrap();
        refused(&["machine", "show", path.to_str().unwrap()], says);
    };
    wrong(
        &|record| record["scenes"][0]["widht"] = json!(3),
        "searched: scenes[0].widht is not a known field; the nearest is `width`",
    );
    wrong(
        &|record| record["target"]["psnr_db"] = json!("many"),
        "searched: target.psnr_db is a text; it must be a number",
    );
    wrong(
        &|record| record["target"]["against"] = json!("truth"),
        "searched: target.against is `truth`",
    );
    wrong(
        &|record| record["scenes"][0]["cameras"][0]["eye"] = json!([1, 2]),
        "searched: scenes[0].cameras[0].eye has 2 entries",
    );
    wrong(
        &|record| *record = json!(null),
        "searched: is null; it must be an object",
    );
    refused(
        &["machine", "show", file, "--set", "searched.scenes=[]"],
        "searched is not a known field",
    );
}

#[test]
fn a_search_can_aim_at_the_whole_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = scene(folder.path(), "knot.json", &json!({}));
    let search = |against: &str, target: &str, out: &Path| {
        let arguments = [
            "search",
            &path,
            "--size",
            "24x20",
            "--target-psnr",
            target,
            "--against",
            against,
            "--views",
            "1",
            "--tries",
            "5",
        ];
        splatsim(
            &[
                &arguments[..],
                &[
                    "--only",
                    "gauss",
                    "--only",
                    "raster",
                    "--out",
                    out.to_str().unwrap(),
                ],
            ]
            .concat(),
        )
    };
    let run = folder.path().join("run");
    ok(&splatsim(&[
        "run",
        &path,
        "--size",
        "24x20",
        "--out",
        run.to_str().unwrap(),
        "--quiet",
    ]));
    let accuracy = read(&run.join("report.json"))["accuracy"].clone();
    let method = accuracy["golden_vs_ideal"]["psnr_db"].as_f64().unwrap();
    // Half a decibel less than the method's error alone: words may use this margin, but against
    // golden they may not.
    let out = folder.path().join("ideal");
    let told = ok(&search("ideal", &format!("{:.2}", method - 0.5), &out));
    assert!(
        told.contains("dB, fixed − ideal") && told.lines().all(|line| line.chars().count() <= 80),
        "{told}"
    );
    let found = read(&out.join("search.json"));
    let path_of = |found: &Value| found["path"].as_array().unwrap().clone();
    assert_eq!(
        path_of(&found)[0]["fixed_vs_ideal_psnr_db"],
        accuracy["fixed_vs_ideal"]["psnr_db"]
    );
    assert_eq!(
        path_of(&found)[0]["psnr_db"],
        accuracy["fixed_vs_golden"]["psnr_db"]
    );
    let last = path_of(&found).last().unwrap().clone();
    assert!(
        last["fixed_vs_ideal_psnr_db"].as_f64().unwrap() >= method - 0.5,
        "{last}"
    );
    assert!(
        last["area"].as_f64() < path_of(&found)[0]["area"].as_f64(),
        "{last}"
    );
    // No word can reach what the method alone does not.
    let output = search(
        "ideal",
        &format!("{:.2}", method + 3.0),
        &folder.path().join("out"),
    );
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{told}");
    assert!(
        told.contains(&format!(
            "golden − ideal alone is {method:.1} dB, and no word changes that"
        )),
        "{told}"
    );
    // The default is golden.
    let output = search(
        "golden",
        &format!("{:.2}", method + 3.0),
        &folder.path().join("golden"),
    );
    ok(&output);
    assert_eq!(
        read(&folder.path().join("golden/search.json"))["target"]["against"],
        "golden"
    );
}

#[test]
fn no_word_saturates_if_the_search_excludes_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = scene(folder.path(), "knot.json", &json!({}));
    let out = folder.path().join("out");
    let arguments = [
        "search",
        &path,
        "--size",
        "24x20",
        "--max-error",
        "0.05",
        "--no-saturation",
        "--views",
        "0",
        "--tries",
        "10",
        "--only",
        "fragment",
    ];
    ok(&splatsim(
        &[
            &arguments[..],
            &["--only", "raster", "--out", out.to_str().unwrap()],
        ]
        .concat(),
    ));
    let found = read(&out.join("search.json"));
    let last = found["path"].as_array().unwrap().last().unwrap();
    assert!(
        last["max_error"].as_f64().unwrap() <= 0.05 && last["saturated"] == 0,
        "{last}"
    );
    let run = folder.path().join("run");
    let machine = out.join("machine.json");
    ok(&splatsim(&[
        "run",
        &path,
        "--machine",
        machine.to_str().unwrap(),
        "--size",
        "24x20",
        "--out",
        run.to_str().unwrap(),
    ]));
    let report = read(&run.join("report.json"));
    for signal in report["signals"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|signal| signal.get("declared_clamp").is_none())
    {
        let over = ["saturated_low", "saturated_high", "wrapped"]
            .map(|what| signal[what].as_u64().unwrap());
        assert_eq!(over, [0; 3], "{signal}");
    }
    // Only the named fields have changed.
    let [reference, found] = [
        splatsim(&["machine", "show", "reference"]).stdout,
        fs::read(&machine).unwrap(),
    ]
    .map(|text| serde_json::from_slice::<Value>(&text).unwrap());
    for unit in [
        "splat", "project", "ellipse", "gauss", "shade", "resolve", "timing",
    ] {
        assert_eq!(reference[unit], found[unit], "{unit}");
    }
    assert!(reference["fragment"] != found["fragment"] && reference["raster"] != found["raster"]);
}

#[test]
fn impossible_searches_are_refused_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let path = scene(folder.path(), "knot.json", &json!({}));
    let out = folder.path().join("out");
    let dir = out.to_str().unwrap();
    refused(
        &["search", &path],
        "a target is missing: --target-psnr, --max-error or --min-fps",
    );
    refused(&["search", &path, "--over", "fragment"], "--target-psnr");
    refused(&["search", "--target-psnr", "50"], "<SCENE>");
    for wrong in ["0", "-3", "nan", "many", "inf"] {
        refused(
            &[
                "search",
                &path,
                &format!("--target-psnr={wrong}"),
                "--out",
                dir,
            ],
            "a number above 0 is needed",
        );
    }
    refused(
        &["search", "no-such.ply", "--target-psnr", "50", "--out", dir],
        "no-such.ply",
    );
    refused(
        &[
            "search",
            &path,
            "--target-psnr",
            "50",
            "--only",
            "gauss.wait",
            "--out",
            dir,
        ],
        "--only gauss.wait: machine reference has no such",
    );
    assert!(!out.exists(), "what is refused leaves no folder");
    refused(
        &[
            "search",
            &path,
            "--size",
            "16x16",
            "--machine",
            "tiny",
            "--target-psnr",
            "90",
            "--out",
            dir,
        ],
        "the target is out of reach: on ",
    );
    for wrong in ["10", "0s", "-3m", "5x", "nanh", "9999h", ""] {
        refused(
            &[
                "search",
                &path,
                "--target-psnr",
                "30",
                &format!("--budget={wrong}"),
                "--out",
                dir,
            ],
            "a time from 1s to 1000h is needed",
        );
    }
    refused(
        &[
            "search",
            &path,
            "--target-psnr",
            "30",
            "--screen",
            "maybe",
            "--out",
            dir,
        ],
        "'maybe'",
    );
    refused(
        &[
            "search",
            &path,
            "--target-psnr",
            "30",
            "--machine",
            "gaussian",
            "--only",
            "colour",
            "--out",
            dir,
        ],
        "--only colour: no searched scene uses it",
    );
    assert!(!out.exists(), "what is refused leaves no folder");
    // A folder with other contents.
    let plan = folder.path().join("plan.json");
    fs::write(
        &plan,
        json!({"scenes": [path], "size": [8, 8], "machine": "tiny", "axes": [], "lockstep": false})
            .to_string(),
    )
    .unwrap();
    let rows = folder.path().join("rows");
    ok(&splatsim(&[
        "sweep",
        plan.to_str().unwrap(),
        "--out",
        rows.to_str().unwrap(),
    ]));
    refused(
        &[
            "search",
            &path,
            "--size",
            "8x8",
            "--target-psnr",
            "20",
            "--out",
            rows.to_str().unwrap(),
        ],
        "has other columns",
    );
}

/// By brute force: of all rules and layers whose golden meets the target, the one with the least
/// area, or bytes.
#[test]
fn the_cheapest_rule_is_found() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let scene = glass(5, 4);
    let base = Machine::named("reference").unwrap();
    let target = 60.0;
    for by in [over_fragment::LeastOf::Area, over_fragment::LeastOf::Bytes] {
        let scenes = std::slice::from_ref(&scene);
        let found = over_fragment::run(
            scenes,
            &base,
            folder.path(),
            target,
            by,
            &Prices::default(),
            false,
        )
        .unwrap();
        let told = read(&folder.path().join("choices.json"));
        let choices = told["choices"].as_array().unwrap();
        assert_eq!(choices.len(), 40);
        let cost = |choice: &Value| {
            choice[if by == over_fragment::LeastOf::Area {
                "area"
            } else {
                "pixel_bytes"
            }]
            .as_f64()
            .unwrap()
        };
        let reaching = choices
            .iter()
            .filter(|choice| choice["psnr_db"][0].as_f64().is_none_or(|db| db >= target));
        let least = reaching.clone().map(cost).fold(f64::INFINITY, f64::min);
        let best = &choices[told["found_for_all"].as_u64().unwrap() as usize];
        assert!(
            cost(best) == least && (1..40).contains(&reaching.count()),
            "{}",
            found.summary()
        );
        // Its figure is that of the written machine.
        let machine =
            machines::load(folder.path().join("machine.json").to_str().unwrap(), &[]).unwrap();
        assert_eq!(
            machine.fragment.layers,
            best["layers"].as_u64().unwrap() as u32
        );
        let drawn = splatsim::golden::render(&scene, &fixed::rules(&machine));
        let db =
            splatsim::accuracy::metrics(&drawn.picture, &splatsim::golden::ideal(&scene).picture)
                .psnr_db;
        assert_eq!(db, best["psnr_db"][0].as_f64());
        // Its frames/s are too, for any rule.
        let evaluation = Evaluation::new(&scene, &machine).unwrap();
        let cycles = timing::replay(
            &evaluation.machine.timing,
            &evaluation.observe().work,
            Detail::Histograms,
        )
        .total;
        let seconds = cycles as f64 / machine.timing.clock_hz as f64;
        let frames = 1.0 / seconds;
        assert_eq!(Some(frames), best["frames_per_second"][0].as_f64());
        let picture = image::open(folder.path().join("rules.png"))
            .unwrap()
            .into_rgb8();
        assert_eq!(picture.dimensions(), (1920, 400));
    }
    // A word that is too narrow for a rule is refused before anything is written.
    let mut wide = scene.clone();
    wide.kernel.cutoff = 5.0;
    let nowhere = folder.path().join("nowhere");
    let wide = std::slice::from_ref(&wide);
    let refused = over_fragment::run(
        wide,
        &base,
        &nowhere,
        target,
        over_fragment::LeastOf::Area,
        &Prices::default(),
        false,
    );
    assert!(
        refused
            .unwrap_err()
            .to_string()
            .contains("gauss.radial_index")
            && !nowhere.exists()
    );
    // For any rule of the base machine: each rule's figures are those of the same machine.
    let choices = |base: &str| {
        let base = Machine::named(base).unwrap();
        over_fragment::run(
            std::slice::from_ref(&scene),
            &base,
            folder.path(),
            target,
            over_fragment::LeastOf::Area,
            &Prices::default(),
            false,
        )
        .unwrap();
        read(&folder.path().join("choices.json"))["choices"].clone()
    };
    assert_eq!(choices("reference"), choices("window"));
    let refused = over_fragment::run(
        std::slice::from_ref(&scene),
        &base,
        folder.path(),
        400.0,
        over_fragment::LeastOf::Area,
        &Prices::default(),
        false,
    );
    assert!(
        refused
            .unwrap_err()
            .to_string()
            .contains("no rule with up to 8 layers reaches 400 dB")
    );
}

// ---- Over timing ----

/// 2,592 machines; the clock is one of their fields.
fn grid() -> Vec<over_timing::SearchedField> {
    let field = |field: &str, values: Value| over_timing::SearchedField {
        field: field.into(),
        values: values.as_array().unwrap().clone(),
    };
    vec![
        field(
            "timing.clock_hz",
            json!([200_000_000, 300_000_000, 400_000_000, 500_000_000]),
        ),
        field(
            "timing.raster.lanes",
            json!([[1, 1], [2, 2], [4, 1], [4, 4]]),
        ),
        field("timing.raster.fifo", json!([2, 8, 16])),
        field("timing.fragment.hazard", json!([null, 1, 2])),
        field("timing.tile.side_px", json!([16, 32])),
        field("timing.ellipse.multipliers", json!([null, 4, 16])),
        field("timing.memory.outstanding", json!([2, 8, 16])),
    ]
}

/// Frames per second, area, gates and changes of every machine of some fields, with the same memory
/// speed at every clock.
fn all_machines(
    base: &Machine,
    fields: &[over_timing::SearchedField],
    work: &rtl_model::work::Work,
) -> Vec<(f64, [f64; 2], String)> {
    let count: usize = fields.iter().map(|field| field.values.len()).product();
    let of = |number: usize| {
        let mut left = number;
        let mut changes = Vec::new();
        for over_timing::SearchedField { field, values } in fields {
            changes.push((field.clone(), values[left % values.len()].clone()));
            left /= values.len();
        }
        let clock_hz = changes[0].1.as_u64().unwrap();
        changes.push((
            "timing.memory.bytes_per_cycle".into(),
            json!(6_400_000_000 / clock_hz),
        ));
        changes.push((
            "timing.memory.hit_latency".into(),
            json!((20 * clock_hz).div_ceil(400_000_000)),
        ));
        changes.push((
            "timing.memory.miss_latency".into(),
            json!((50 * clock_hz).div_ceil(400_000_000)),
        ));
        let built = fixed::elaborate(&machines::with(base, &changes, "").unwrap()).ok()?;
        let cycles = timing::replay(&built.timing, work, Detail::Accounts).total;
        let told = changes
            .iter()
            .map(|(field, value)| format!("{field}={value}"))
            .collect::<Vec<_>>()
            .join(" ");
        Some((clock_hz as f64 / cycles as f64, sizes(&built), told))
    };
    (0..count).into_par_iter().filter_map(of).collect()
}

/// Area and gates of a machine.
fn sizes(built: &Elaborated) -> [f64; 2] {
    let cost = Cost::new(built, &Prices::default());
    [cost.area, cost.gates.total]
}

/// Options without progress output.
fn at_least(min_fps: f64, fields: Vec<over_timing::SearchedField>) -> over_timing::TimingOptions {
    let minimise = over_timing::Minimise::Area;
    over_timing::TimingOptions {
        min_fps,
        minimise,
        fields,
        memory: None,
        views: 0,
        prices: Prices::default(),
        progress: false,
    }
}

#[test]
fn the_cheapest_machine_that_is_fast_enough_is_found() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let scene = glass(5, 4);
    let base = Machine::named("lean").unwrap();
    let evaluation = Evaluation::new(&scene, &base).unwrap();
    let all = all_machines(&base, &grid(), &evaluation.observe().work);
    assert!(all.len() > 2000, "{}", all.len());
    let fastest = all.iter().map(|(fps, ..)| *fps).fold(0.0, f64::max);
    let (by_area, by_gates) = (
        (over_timing::Minimise::Area, 0),
        (over_timing::Minimise::Gates, 1),
    );
    let aims = [0.3, 0.6, 0.8, 0.95, 0.999]
        .map(|part| (part, by_area))
        .into_iter()
        .chain([0.6, 0.95].map(|part| (part, by_gates)));
    for (part, (minimise, nth)) in aims {
        let [least, most] = [f64::min, f64::max].map(|of| {
            all.iter()
                .map(|(_, sizes, _)| sizes[nth])
                .reduce(of)
                .unwrap()
        });
        let min_fps = part * fastest;
        let fast_enough = all
            .iter()
            .filter(|(fps, ..)| *fps >= min_fps)
            .map(|(_, sizes, told)| (sizes[nth], told));
        let (best, best_changes) = fast_enough.min_by(|(a, _), (b, _)| a.total_cmp(b)).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let options = over_timing::TimingOptions {
            minimise,
            ..at_least(min_fps, grid())
        };
        let found = over_timing::run(
            &[Domain::around(scene.clone())],
            &base,
            None,
            folder.path(),
            &options,
        )
        .unwrap();
        let machine = read(&folder.path().join("machine.json"));
        let built =
            fixed::elaborate(&machines::load(folder.path().join("machine.json"), &[]).unwrap())
                .unwrap();
        assert_eq!(
            machine["timing"]["clock_hz"],
            json!(built.timing.timing.clock_hz)
        );
        let cycles =
            timing::replay(&built.timing, &evaluation.observe().work, Detail::Accounts).total;
        let (fps, size) = (
            built.timing.timing.clock_hz as f64 / cycles as f64,
            sizes(&built)[nth],
        );
        assert!(fps >= min_fps, "{part}: {fps} of {min_fps}");
        // Relative to the area of these fields, not of the whole machine.
        assert!(
            size - best <= 0.05 * (most - least) && size <= 1.05 * best,
            "{minimise:?} {part}: {size} by {:?}, where {best} of {least} to {most} can be had by {best_changes}",
            found.changes
        );
        assert!(
            found.path.last().unwrap().tried < all.len() as u64,
            "{part}: everything was tried"
        );
    }
}

fn written_fields(folder: &Path, fields: &Value) -> String {
    let path = folder.join("fields.json");
    fs::write(&path, fields.to_string()).unwrap();
    path.to_str().unwrap().to_owned()
}

/// A few fields, quick to search.
fn few(folder: &Path) -> String {
    written_fields(folder, &json!(grid()[1..4]))
}

/// Two states can be one machine: a field that is left out, and the same value given. Each row has
/// the results of its own machine, whatever else cannot be built.
#[test]
fn rows_of_a_search_over_lists_belong_to_their_machines() {
    let folder = tempfile::tempdir().unwrap();
    let city = json!({"splats": {"gaussians": "city", "count": 800}, "camera": {"eye": [0, 0.3, 3.95], "target": [0, 0.32, 0]}});
    let path = folder.path().join("city.json");
    std::fs::write(&path, city.to_string()).unwrap();
    let fields = json!([
        {"field": "bin.test", "values": ["box", "oriented-box", "ellipse"]},
        {"field": "bin.subtile_px", "values": [null, 4, 8]},
        {"field": "bin.masks", "values": [null, "bin", "list"]},
        {"field": "sort.kind", "values": ["radix", "tile", "hierarchical"]},
        {"field": "timing.sort.overlap", "values": [false, true]},
        {"field": "timing.sort.units", "values": [1, 2, 4]},
    ]);
    let file = folder.path().join("fields.json");
    std::fs::write(&file, fields.to_string()).unwrap();
    let out = folder.path().join("out");
    let output = splatsim(&[
        "search",
        path.to_str().unwrap(),
        "--machine",
        "gaussian",
        "--size",
        "48x32",
        "--min-fps",
        "1e9",
        "--views",
        "0",
        "--fields",
        file.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
    ]);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.contains("the nearest draws "), "{told}");
    let rows = std::fs::read_to_string(out.join("points.jsonl")).unwrap();
    let mut without = 0;
    for line in rows.lines() {
        let row: Value = serde_json::from_str(line).unwrap();
        // The base machine has no changes.
        let [changes, misfit] = [3, 4].map(|at| &row[1][at]);
        let has_bin = changes.as_str().unwrap_or_default().contains("bin.");
        assert!(has_bin || !misfit.to_string().contains("bin."), "{line}");
        without += u32::from(!has_bin);
    }
    assert!(without > 5, "{rows}");
}

#[test]
fn a_machine_that_cannot_be_fast_enough_says_what_is_nearest() {
    let folder = tempfile::tempdir().unwrap();
    let path = scene(folder.path(), "knot.json", &json!({}));
    let out = folder.path().join("out");
    let arguments = [
        "search",
        &path,
        "--size",
        "24x18",
        "--machine",
        "lean",
        "--min-fps",
        "1e9",
        "--fields",
        &few(folder.path()),
    ];
    let output = splatsim(
        &[
            &arguments[..],
            &["--views", "0", "--out", out.to_str().unwrap()],
        ]
        .concat(),
    );
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(
        (output.status.code(), told.trim_end().lines().count()),
        (Some(1), 1),
        "{told}"
    );
    assert!(
        told.contains(
            "no machine that was tried draws 1000000000 frames/s of knot.json; the nearest draws "
        ),
        "{told}"
    );
    // No evaluated machine is nearer.
    let nearest: f64 = told
        .split("the nearest draws ")
        .nth(1)
        .unwrap()
        .split(' ')
        .next()
        .unwrap()
        .parse()
        .unwrap();
    let text = fs::read_to_string(out.join("points.jsonl")).unwrap();
    let fps = text
        .lines()
        .skip(1)
        .filter_map(|line| serde_json::from_str::<Value>(line).unwrap()[1][5].as_f64());
    let fastest = fps.fold(0.0, f64::max);
    assert!(
        (nearest - fastest).abs() <= 0.051 && fastest > 0.0,
        "{nearest}, and {fastest} was tried"
    );
    assert!(!out.join("machine.json").exists());
}

#[test]
fn a_search_over_timing_goes_on_and_finds_the_same_at_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let path = scene(folder.path(), "knot.json", &json!({}));
    let fields = few(folder.path());
    let run = [
        "run",
        &path,
        "--size",
        "24x18",
        "--machine",
        "lean",
        "--quiet",
        "--out",
        folder.path().join("run").to_str().unwrap(),
    ]
    .map(str::to_owned);
    ok(&Command::new(PROGRAM.as_str()).args(run).output().unwrap());
    let fps = read(&folder.path().join("run/report.json"))["cycles"]["frames_per_second"]
        .as_f64()
        .unwrap();
    let target = format!("{:.0}", 0.7 * fps);
    let search = |out: &Path, threads: &str| {
        let all = [
            "search",
            &path,
            "--size",
            "24x18",
            "--machine",
            "lean",
            "--min-fps",
            &target,
            "--fields",
            &fields,
            "--views",
            "3",
        ];
        [
            &all[..],
            &["--threads", threads, "--out", out.to_str().unwrap()],
        ]
        .concat()
        .into_iter()
        .map(str::to_owned)
        .collect::<Vec<_>>()
    };
    let [whole, killed] = ["whole", "killed"].map(|name| folder.path().join(name));
    let told = ok(&Command::new(PROGRAM.as_str())
        .args(search(&whole, "1"))
        .output()
        .unwrap());
    assert!(
        told.lines().all(|line| line.chars().count() <= 80)
            && told.contains("fast enough on 3 unseen views"),
        "{told}"
    );
    for wait_ms in [60, 120] {
        start_and_kill(wait_ms, search(&killed, "2"));
    }
    ok(&Command::new(PROGRAM.as_str())
        .args(search(&killed, "2"))
        .output()
        .unwrap());
    for name in ["machine.json", "search.json", "search.csv", "points.jsonl"] {
        assert_eq!(
            fs::read(whole.join(name)).unwrap(),
            fs::read(killed.join(name)).unwrap(),
            "{name}"
        );
    }
    // Each of the first views is a row, so that a search resumes from any of them.
    let journal = fs::read_to_string(whole.join("points.jsonl")).unwrap();
    let row = |line: &str| serde_json::from_str::<Value>(line).unwrap()[1].clone();
    let first: Vec<Value> = journal.lines().skip(1).take(4).map(row).collect();
    let views: HashSet<&str> = first.iter().map(|row| row[2].as_str().unwrap()).collect();
    assert!(
        views.len() == 4 && first.iter().all(|row| row[3] == ""),
        "{first:?}"
    );
    for rows in [0, 1, 3, 5] {
        let cut = folder.path().join(format!("cut-{rows}"));
        fs::create_dir(&cut).unwrap();
        fs::write(
            cut.join("points.jsonl"),
            journal
                .split_inclusive('\n')
                .take(1 + rows)
                .collect::<String>(),
        )
        .unwrap();
        ok(&Command::new(PROGRAM.as_str())
            .args(search(&cut, "2"))
            .output()
            .unwrap());
        for name in ["machine.json", "search.json", "points.jsonl"] {
            assert_eq!(
                fs::read(whole.join(name)).unwrap(),
                fs::read(cut.join(name)).unwrap(),
                "{name} from row {rows}"
            );
        }
    }
    // Its figures are those of `run`, with unchanged words, and on unseen cameras too.
    let found = read(&whole.join("search.json"));
    let machine = whole.join("machine.json");
    let ran = |scene: &str| {
        let out = folder.path().join("found");
        ok(&splatsim(&[
            "run",
            scene,
            "--size",
            "24x18",
            "--machine",
            machine.to_str().unwrap(),
            "--out",
            out.to_str().unwrap(),
            "--quiet",
        ]));
        read(&out.join("report.json"))
    };
    let report = ran(&path);
    let last = found["path"].as_array().unwrap().last().unwrap();
    assert!(report["cycles"]["frames_per_second"].as_f64().unwrap() >= 0.7 * fps - 0.5);
    assert_eq!(report["cost"]["area"], last["area"]);
    for view in found["views"].as_array().unwrap() {
        let report = ran(&scene(
            folder.path(),
            "view.json",
            &json!({"camera": view["camera"]}),
        ));
        assert_eq!(
            report["cycles"]["frames_per_second"],
            view["frames_per_second"]
        );
    }
    assert_eq!(report["machine"]["outside_of_search"], json!([]));
    assert_eq!(
        read(&machine)["searched"]["target"]["frames_per_second"],
        json!(target.parse::<f64>().unwrap())
    );
    ok(&splatsim(&["chart", whole.to_str().unwrap()]));
}

#[test]
fn a_machine_is_found_that_is_fast_and_good_enough() {
    let folder = tempfile::tempdir().unwrap();
    let path = scene(folder.path(), "knot.json", &json!({}));
    let out = folder.path().join("out");
    let (fields, dir) = (few(folder.path()), out.to_str().unwrap());
    let both = |fps: &str, db: &str| {
        let all = [
            "search",
            &path,
            "--size",
            "24x18",
            "--min-fps",
            fps,
            "--target-psnr",
            db,
            "--fields",
            &fields,
            "--views",
            "2",
        ];
        splatsim(
            &[
                &all[..],
                &[
                    "--only", "gauss", "--only", "raster", "--tries", "5", "--out", dir,
                ],
            ]
            .concat(),
        )
    };
    // A target that words cannot reach is reported before anything is written.
    let output = both("100", "200");
    assert_eq!(
        output.status.code(),
        Some(2),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(!out.exists());
    let (_, whole) = ran(folder.path(), &path, "reference", "24x18");
    let fps = read(&folder.path().join("run/report.json"))["cycles"]["frames_per_second"]
        .as_f64()
        .unwrap();
    let aim = format!("{:.0}", 0.7 * fps);
    let told = ok(&both(&aim, "32"));
    assert!(
        told.contains("at least 32 dB") && told.contains("frames/s, least area"),
        "{told}"
    );
    let machine = out.join("machine.json");
    let (psnr, area) = ran(folder.path(), &path, machine.to_str().unwrap(), "24x18");
    let report = read(&folder.path().join("run/report.json"));
    assert!(
        psnr >= 32.0 && area < 0.95 * whole,
        "{psnr} dB, {area} of {whole}"
    );
    let aim: f64 = aim.parse().unwrap();
    assert!(report["cycles"]["frames_per_second"].as_f64().unwrap() >= aim);
    assert_eq!(report["machine"]["outside_of_search"], json!([]));
    let target = &read(&machine)["searched"]["target"];
    assert_eq!(
        (&target["psnr_db"], target["frames_per_second"].as_f64()),
        (&json!(32.0), Some(aim))
    );
}

#[test]
fn a_field_without_a_unit_cost_cannot_be_searched() {
    let folder = tempfile::tempdir().unwrap();
    let path = scene(folder.path(), "knot.json", &json!({}));
    let out = folder.path().join("out");
    let with = |fields: Value, says: &str| {
        let file = written_fields(folder.path(), &fields);
        refused(
            &[
                "search",
                &path,
                "--size",
                "8x8",
                "--min-fps",
                "60",
                "--fields",
                &file,
                "--out",
                out.to_str().unwrap(),
            ],
            says,
        );
        assert!(!out.exists());
    };
    with(
        json!([{"field": "timing.memory.bytes_per_cycle", "values": [64]}]),
        "is given, and can be set with --set: memory is bought",
    );
    for (field, values) in [
        ("preset", json!(["hbm2"])),
        ("channels", json!([4])),
        ("refresh_cycles", json!([1])),
        ("row_cycles", json!([1])),
    ] {
        with(
            json!([{"field": format!("timing.memory.{field}"), "values": values}]),
            "is given, and can be set with --set: memory is bought",
        );
    }
    with(
        json!([{"field": "timing.cache.ways", "values": [64]}]),
        "is given",
    );
    with(
        json!([{"field": "gauss.weight", "values": ["U0F8"]}]),
        "is not a field of timing; --target-psnr searches words",
    );
    with(
        json!([{"field": "timing.raster.fofi", "values": [4]}]),
        "timing.raster.fofi is not a known field",
    );
    with(
        json!([{"field": "timing.raster.fifo", "values": ["many"]}]),
        "--fields: ",
    );
    with(
        json!([{"field": "timing.raster.fifo", "values": []}]),
        "has no values",
    );
    with(json!([]), "has no field");
    with(
        json!({"field": "timing.raster.fifo"}),
        "is not a list of fields and values",
    );
    refused(
        &["search", &path, "--minimise", "area", "--target-psnr", "30"],
        "--min-fps",
    );
    refused(
        &["search", &path, "--min-fps", "nan"],
        "a number above 0 is needed",
    );
    refused(
        &["search", &path, "--min-fps", "60", "--over", "fragment"],
        "cannot be used with",
    );
}

// ---- Domains ----

#[test]
fn a_machine_holds_on_the_whole_domain() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = scene(folder.path(), "knot.json", &json!({}));
    let out = folder.path().join("out");
    let quick = [
        "--target-psnr",
        "30",
        "--views",
        "5",
        "--tries",
        "5",
        "--only",
        "gauss",
        "--only",
        "project",
    ];
    let sizes = ["--size", "24x18", "--size", "48x36", "--distance", "0.5..2"];
    ok(&splatsim(
        &[
            &["search", &path, "--out", out.to_str().unwrap()],
            &quick[..],
            &sizes[..],
        ]
        .concat(),
    ));
    let machine = out.join("machine.json");
    let scenes = read(&machine)["searched"]["scenes"].clone();
    let sizes: Vec<_> = scenes
        .as_array()
        .unwrap()
        .iter()
        .map(|scene| scene["width"].as_u64().unwrap())
        .collect();
    assert_eq!(sizes, [24, 48]);
    assert_eq!(scenes[0]["domain"]["distance"], json!([0.5, 2.0]));
    // Unseen cameras are at all distances, and `run` confirms the machine there.
    let framed = read_camera(&path);
    let far = |camera: &Value| -> f64 {
        let [eye, target] = ["eye", "target"]
            .map(|name| serde_json::from_value::<[f64; 3]>(camera[name].clone()).unwrap());
        (0..3)
            .map(|axis| (eye[axis] - target[axis]).powi(2))
            .sum::<f64>()
            .sqrt()
    };
    let own = far(&framed);
    let found = read(&out.join("search.json"));
    let views = found["views"].as_array().unwrap();
    assert_eq!(views.len(), 10, "five of each size");
    let parts: Vec<f64> = views
        .iter()
        .take(5)
        .map(|view| far(&view["camera"]) / own)
        .collect();
    assert!(
        parts.iter().all(|part| (0.499..=2.001).contains(part))
            && parts.iter().any(|part| *part < 0.8)
            && parts.iter().any(|part| *part > 1.3)
    );
    for (nth, view) in views.iter().enumerate().step_by(3) {
        let seen = scene(
            folder.path(),
            "view.json",
            &json!({"camera": view["camera"]}),
        );
        let (psnr, _) = ran(
            folder.path(),
            &seen,
            machine.to_str().unwrap(),
            if nth < 5 { "24x18" } else { "48x36" },
        );
        assert!(
            psnr >= 30.0 && (view["psnr_db"].as_f64().unwrap() - psnr).abs() < 1e-6,
            "{view}: {psnr}"
        );
        assert_eq!(
            read(&folder.path().join("run/report.json"))["machine"]["outside_of_search"],
            json!([]),
            "{view}"
        );
    }
    // A camera nearer than the domain is outside it.
    let mut near = framed.clone();
    let [eye, target] = ["eye", "target"]
        .map(|name| serde_json::from_value::<[f64; 3]>(framed[name].clone()).unwrap());
    near["eye"] = json!([0, 1, 2].map(|axis| target[axis] + 0.3 * (eye[axis] - target[axis])));
    ran(
        folder.path(),
        &scene(folder.path(), "near.json", &json!({"camera": near})),
        machine.to_str().unwrap(),
        "24x18",
    );
    let outside =
        read(&folder.path().join("run/report.json"))["machine"]["outside_of_search"].clone();
    assert!(
        outside[0]
            .as_str()
            .unwrap()
            .contains("from its target instead of"),
        "{outside}"
    );
}

#[test]
fn cameras_of_a_list_are_a_domain() {
    let folder = tempfile::tempdir().unwrap();
    let framed = read_camera(&scene(folder.path(), "knot.json", &json!({})));
    let cameras: Vec<Value> = (0..4)
        .map(|nth| {
            let mut camera = framed.clone();
            camera["eye"][0] = json!(framed["eye"][0].as_f64().unwrap() + 0.4 * f64::from(nth));
            camera
        })
        .collect();
    let path = scene(folder.path(), "list.json", &json!({"cameras": cameras}));
    let out = folder.path().join("out");
    let quick = [
        "--size",
        "24x18",
        "--target-psnr",
        "30",
        "--views",
        "9",
        "--tries",
        "5",
        "--only",
        "gauss",
        "--out",
        out.to_str().unwrap(),
    ];
    let told = ok(&splatsim(&[&["search", &path], &quick[..]].concat()));
    let found = read(&out.join("search.json"));
    let [searched, unseen] = ["cameras", "views"].map(|name| found[name].as_array().unwrap().len());
    assert_eq!(
        searched + unseen,
        4,
        "each camera is searched on, or held out, once: {told}"
    );
    let machine = out.join("machine.json");
    let domain = read(&machine)["searched"]["scenes"][0]["domain"].clone();
    assert_eq!(
        (
            domain["cameras"].as_array().unwrap().len(),
            &domain["around"]
        ),
        (4, &json!(false))
    );
    let outside = |camera: &Value| {
        ran(
            folder.path(),
            &scene(folder.path(), "seen.json", &json!({"camera": camera})),
            machine.to_str().unwrap(),
            "24x18",
        );
        read(&folder.path().join("run/report.json"))["machine"]["outside_of_search"].clone()
    };
    assert_eq!(outside(&cameras[2]), json!([]));
    let mut other = framed.clone();
    other["eye"] =
        json!([-1.0, 0.0, 2.0].map(|part: f64| part * framed["eye"][2].as_f64().unwrap()));
    assert_ne!(outside(&other), json!([]));
    // The same for a file, and over timing too.
    let matrix = json!([[1, 0, 0, 0.1], [0, 1, 0, 0.2], [0, 0, 1, 5], [0, 0, 0, 1]]);
    let frames = json!({"camera_angle_x": 0.9, "w": 24, "h": 18, "frames": [{"transform_matrix": matrix}, {"transform_matrix": matrix}]});
    let file = folder.path().join("transforms.json");
    fs::write(&file, frames.to_string()).unwrap();
    let out = folder.path().join("timed");
    let knot = scene(folder.path(), "knot.json", &json!({}));
    let arguments = [
        "search",
        &knot,
        "--cameras",
        file.to_str().unwrap(),
        "--machine",
        "lean",
        "--min-fps",
        "10",
        "--fields",
        &few(folder.path()),
    ];
    ok(&splatsim(
        &[&arguments[..], &["--out", out.to_str().unwrap()]].concat(),
    ));
    assert_eq!(
        read(&out.join("machine.json"))["searched"]["scenes"][0]["domain"]["cameras"]
            .as_array()
            .unwrap()
            .len(),
        2
    );
    refused(
        &["search", &knot, "--target-psnr", "30", "--distance", "2..1"],
        "the lesser first",
    );
    refused(
        &[
            "search",
            &knot,
            "--target-psnr",
            "30",
            "--cameras",
            "no-such.json",
        ],
        "no-such.json",
    );
    refused(
        &["run", &knot, "--size", "8x8", "--size", "9x9"],
        "only `search` takes several",
    );
}

#[test]
fn flips_do_not_count_in_lockstep_and_luck_does_not_where_it_must_be_robust() {
    let folder = tempfile::tempdir().unwrap();
    let path = scene(folder.path(), "knot.json", &json!({}));
    let search = |out: &Path, more: &[&str]| {
        let quick = [
            "search",
            &path,
            "--size",
            "24x18",
            "--target-psnr",
            "40",
            "--views",
            "2",
            "--tries",
            "5",
            "--only",
            "raster",
        ];
        let told = ok(&splatsim(
            &[&quick[..], &["--out", out.to_str().unwrap()], more].concat(),
        ));
        (told, read(&out.join("search.json")))
    };
    let out = folder.path().join("lockstep");
    let (told, found) = search(&out, &["--metric", "lockstep"]);
    assert!(
        told.contains("fixed − golden in lockstep") && told.contains("lockstep dB"),
        "{told}"
    );
    assert_eq!(
        read(&out.join("machine.json"))["searched"]["target"]["metric"],
        "lockstep"
    );
    let machine = out.join("machine.json");
    ran(folder.path(), &path, machine.to_str().unwrap(), "24x18");
    let accuracy = read(&folder.path().join("run/report.json"))["accuracy"].clone();
    assert!(
        accuracy["lockstep"]["psnr_db"].as_f64().unwrap() >= 40.0,
        "{accuracy}"
    );
    let views = found["views"].as_array().unwrap();
    assert!(
        views
            .iter()
            .all(|view| view["lockstep"]["psnr_db"].as_f64().unwrap() >= 40.0),
        "{views:?}"
    );
    // A repeated search draws nothing.
    let rows = fs::read(out.join("points.jsonl")).unwrap();
    search(&out, &["--metric", "lockstep"]);
    assert_eq!(rows, fs::read(out.join("points.jsonl")).unwrap());
    refused(
        &[
            "search",
            &path,
            "--target-psnr",
            "30",
            "--metric",
            "lockstep",
            "--against",
            "ideal",
        ],
        "those of ideal cannot",
    );

    // The worst of three: each meets the target, and all are used by the search.
    let out = folder.path().join("robust");
    let (_, found) = search(&out, &["--robust", "3"]);
    let cameras = found["cameras"].as_array().unwrap();
    assert!(
        cameras.len() >= 3 && cameras.len() % 3 == 0 && cameras[1]["name"] == "knot.json, nudged 1",
        "{cameras:?}"
    );
    for camera in &cameras[..3] {
        let seen = scene(
            folder.path(),
            "seen.json",
            &json!({"camera": camera["camera"]}),
        );
        let (psnr, _) = ran(
            folder.path(),
            &seen,
            out.join("machine.json").to_str().unwrap(),
            "24x18",
        );
        assert!(psnr >= 40.0, "{camera}: {psnr}");
    }
}

// ---- Margins and claims ----

/// Least PSNR against golden of a machine on a scene from some cameras, computed without the
/// search; none if it cannot be built.
fn worst_db(machine: &Value, scene: &splatsim::scene::Scene, cameras: &[Value]) -> Option<f64> {
    let machine: Machine = serde_json::from_value(machine.clone()).ok()?;
    let mut worst = f64::INFINITY;
    for camera in cameras {
        let seen = splatsim::scene::Scene {
            camera: serde_json::from_value(camera.clone()).unwrap(),
            ..scene.clone()
        };
        let evaluation = Evaluation::new(&seen, &machine).ok()?;
        let (fixed, golden) = (
            evaluation.picture(&evaluation.draw()),
            evaluation.golden().picture,
        );
        let db = splatsim::accuracy::metrics(&fixed, &golden)
            .psnr_db
            .unwrap_or(f64::INFINITY);
        assert!(!db.is_nan());
        worst = worst.min(db);
    }
    Some(worst)
}

/// A word of a machine file, and the removed bit, with the names of `tight`.
type Bit = (String, &'static str);

/// The format of a word, which may be in a separate field.
fn format_of<'m>(machine: &'m mut Value, path: &str) -> &'m mut Value {
    let word = machine
        .pointer_mut(&format!("/{}", path.replace('.', "/")))
        .unwrap();
    if word.is_object() {
        &mut word["format"]
    } else {
        word
    }
}

/// Bits that words of some units can lose: each word keeps at least one.
fn bits(machine: &Value, units: &[&str]) -> Vec<Bit> {
    let machine = &mut machine.clone();
    let mut all = Vec::new();
    for unit in units {
        let names: Vec<String> = machine[unit].as_object().unwrap().keys().cloned().collect();
        for path in names.iter().map(|name| format!("{unit}.{name}")) {
            let Ok(format) = format_of(machine, &path)
                .as_str()
                .unwrap_or_default()
                .parse::<Format>()
            else {
                continue;
            };
            if format.width() > 1 {
                all.extend(["fraction-bit", "integer-bit"].map(|part| (path.clone(), part)));
            }
        }
    }
    all
}

/// The machine without some bits.
fn without(machine: &Value, bits: &[Bit]) -> Value {
    let mut machine = machine.clone();
    for (path, part) in bits {
        let field = format_of(&mut machine, path);
        let mut format: Format = field.as_str().unwrap().parse().unwrap();
        *(if *part == "integer-bit" {
            &mut format.int_bits
        } else {
            &mut format.frac_bits
        }) -= 1;
        *field = json!(format.to_string());
    }
    machine.as_object_mut().unwrap().remove("searched");
    machine
}

fn area_of(machine: &Value) -> f64 {
    let machine: Machine = serde_json::from_value(machine.clone()).unwrap();
    Cost::new(&fixed::elaborate(&machine).unwrap(), &Prices::default()).area
}

#[test]
fn no_word_of_a_found_machine_can_lose_a_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = scene(folder.path(), "knot.json", &json!({}));
    let out = folder.path().join("out");
    let target = 33.0;
    let options = [
        "--size",
        "24x20",
        "--machine",
        "lean",
        "--target-psnr",
        "33",
        "--only",
        "gauss",
        "--only",
        "raster",
    ];
    let told = ok(&splatsim(
        &[
            &[
                "search",
                &path,
                "--views",
                "3",
                "--tries",
                "5",
                "--out",
                out.to_str().unwrap(),
            ],
            &options[..],
        ]
        .concat(),
    ));
    assert!(
        told.lines().all(|line| line.chars().count() <= 80),
        "{told}"
    );
    let (found, machine) = (
        read(&out.join("search.json")),
        read(&out.join("machine.json")),
    );
    let size = splatsim::scene::Overrides {
        size: Some((24, 20)),
    };
    let drawn = splatsim::scene::Scene::load(&path, &size).unwrap();
    let cameras_of = |list: &str| {
        found[list]
            .as_array()
            .unwrap()
            .iter()
            .map(|view| view["camera"].clone())
            .collect::<Vec<_>>()
    };
    let (searched, unseen) = (cameras_of("cameras"), cameras_of("views"));
    assert_eq!(unseen.len(), 3);
    let own = without(&machine, &[]);
    let aim = target + found["margin"]["aim_db"].as_f64().unwrap();
    assert!(
        worst_db(&own, &drawn, &searched).unwrap() >= aim
            && worst_db(&own, &drawn, &unseen).unwrap() >= target
    );
    // Bits one by one, and all bits together that the target alone allows to remove.
    let (mut critical, mut spare) = (HashSet::new(), Vec::new());
    for bit in bits(&machine, &["gauss", "raster"]) {
        let less = without(&machine, std::slice::from_ref(&bit));
        let Some(db) = worst_db(&less, &drawn, &searched) else {
            continue;
        };
        if area_of(&less) > area_of(&own) {
            continue;
        }
        assert!(db < aim, "{bit:?} can go: {db} dB of {aim}");
        if db < target {
            critical.insert(bit);
        } else {
            spare.push(bit);
        }
    }
    if spare.len() > 1 {
        assert!(
            worst_db(&without(&machine, &spare), &drawn, &searched).is_none_or(|db| db < aim),
            "{spare:?}"
        );
    }
    let of = |part: &str| critical.iter().filter(|(_, other)| *other == part).count();
    assert!(
        of("fraction-bit") > 3 && of("integer-bit") > 3,
        "{critical:?}"
    );
    // Words reported as critical are critical for the target, and no others are.
    let is_told = |(path, part): &Bit| {
        found["tight"]
            .as_array()
            .unwrap()
            .iter()
            .any(|told| told["path"] == **path && told["part"] == *part)
    };
    assert!(
        critical.iter().all(is_told),
        "{critical:?}, and told {}",
        found["tight"]
    );
    for bit in bits(&machine, &["gauss", "raster"])
        .into_iter()
        .filter(is_told)
    {
        let db = worst_db(
            &without(&machine, std::slice::from_ref(&bit)),
            &drawn,
            &searched,
        );
        assert!(
            db.is_some_and(|db| db < target),
            "{bit:?} is told to be critical: {db:?}"
        );
    }
    // The cost of the margin.
    let margin = &found["margin"];
    let [alone, more] = ["target_alone_area", "area"].map(|name| margin[name].as_f64().unwrap());
    assert!(
        (alone + more - area_of(&own)).abs() < 1e-6 && alone > 0.0,
        "{margin}"
    );
    let first = worst_db(&own, &drawn, &searched[..1]).unwrap();
    assert!(
        (margin["db"].as_f64().unwrap() - (first - target)).abs() < 1e-9,
        "{margin}: {first}"
    );
}

/// Figures with the commands that reproduce them, as printed by a search.
fn commands(told: &str) -> Vec<(String, Vec<String>)> {
    let all = told.split("to reproduce ").skip(1).map(|rest| {
        let (sentence, command) = rest.split_once("):").unwrap();
        let command = command.split("\n\n").next().unwrap().replace("\\\n", " ");
        let words = command
            .split_whitespace()
            .skip(1)
            .map(|word| word.trim_matches('\'').to_owned());
        (
            sentence.split_whitespace().collect::<Vec<_>>().join(" "),
            words.collect(),
        )
    });
    all.collect()
}

#[test]
fn each_claimed_figure_is_shown_again_by_the_command_that_is_printed() {
    let folder = tempfile::tempdir().unwrap();
    let path = scene(folder.path(), "knot.json", &json!({}));
    let (out, run) = (folder.path().join("out"), folder.path().join("run"));
    let again = |command: &[String]| {
        let more = ["--out", run.to_str().unwrap(), "--quiet"].map(str::to_owned);
        ok(&Command::new(PROGRAM.as_str())
            .args(command)
            .args(more)
            .output()
            .unwrap());
        read(&run.join("report.json"))
    };
    let arguments = [
        "search",
        &path,
        "--size",
        "24x20",
        "--target-psnr",
        "33",
        "--only",
        "gauss",
        "--distance",
        "0.5..2",
    ];
    let told = ok(&splatsim(
        &[
            &arguments[..],
            &[
                "--views",
                "2",
                "--tries",
                "5",
                "--out",
                out.to_str().unwrap(),
            ],
        ]
        .concat(),
    ));
    let shown = commands(&told);
    assert_eq!(shown.len(), 2, "{told}");
    for (sentence, command) in &shown {
        let db = again(command)["accuracy"]["fixed_vs_golden"]["psnr_db"]
            .as_f64()
            .unwrap();
        assert!(
            sentence.starts_with(&format!("{db:.1} dB (fixed − golden, ")),
            "{sentence}: {db}"
        );
    }
    // The worst of all views, not just any of them.
    let worst = read(&out.join("search.json"))["views"]
        .as_array()
        .unwrap()
        .iter()
        .map(|view| view["psnr_db"].as_f64().unwrap())
        .fold(1e9, f64::min);
    assert!(
        shown[1].0.starts_with(&format!("{worst:.1} dB")),
        "{shown:?}"
    );

    let (out, fields) = (folder.path().join("timing"), few(folder.path()));
    let arguments = [
        "search",
        &path,
        "--size",
        "24x18",
        "--machine",
        "lean",
        "--min-fps",
        "3000",
        "--fields",
        &fields,
    ];
    let told = ok(&splatsim(
        &[
            &arguments[..],
            &["--views", "3", "--out", out.to_str().unwrap()],
        ]
        .concat(),
    ));
    let shown = commands(&told);
    assert_eq!(shown.len(), 2, "{told}");
    for (sentence, command) in &shown {
        let fps = again(command)["cycles"]["frames_per_second"]
            .as_f64()
            .unwrap();
        assert!(
            sentence.starts_with(&format!("{fps:.1} frames/s (")),
            "{sentence}: {fps}"
        );
    }
    // The deciding camera is in the lists of the search and of the machine, and is the slowest of
    // them.
    let found = read(&out.join("search.json"));
    let decided = found["cameras"].as_array().unwrap();
    let fps = |view: &Value| view["frames_per_second"].as_f64().unwrap();
    assert!(
        told.contains(&format!(
            "decided by {}",
            decided[0]["name"].as_str().unwrap()
        )),
        "{told}"
    );
    assert!(
        decided
            .iter()
            .all(|view| fps(view) >= fps(&decided[0]) && fps(view) >= 3000.0)
    );
    let cameras = read(&out.join("machine.json"))["searched"]["scenes"][0]["cameras"].clone();
    assert!(
        decided
            .iter()
            .all(|view| cameras.as_array().unwrap().contains(&view["camera"])),
        "{cameras}"
    );
    // A damaged file of cameras is refused in a sentence.
    let file = out.join("cameras.json");
    let whole = read(&file);
    for (field, value, told) in [
        ("near", json!(-1), "near is -1; it must be more than 0"),
        ("near", json!(1e300), "near is 1e300; "),
        ("fov_y_degrees", json!(1e-300), "fov_y_degrees is 1e-300; "),
        ("focal_px", json!([0, 0]), "focal_px[0] is 0; "),
        (
            "focal_px",
            json!([50, 50]),
            "has focal_px or centre_px without picture_px",
        ),
        ("eye", json!([0, 0, 1e40]), "eye[2] is 1e40; "),
        ("eys", json!([0, 0, 1]), "eys is not a known field"),
    ] {
        let mut cameras = whole.clone();
        cameras["splatsim_cameras"][1]["camera"][field] = value;
        fs::write(&file, cameras.to_string()).unwrap();
        refused(
            &[
                "run",
                &path,
                "--cameras",
                file.to_str().unwrap(),
                "--frame",
                "1",
            ],
            &format!("splatsim_cameras[1].camera: {told}"),
        );
    }
}

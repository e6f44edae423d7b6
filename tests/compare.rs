//! Does `compare` report all differences and nothing else, does it refuse what cannot be compared,
//! and do what-if results equal the runs that they name (docs/book/compare.md,
//! docs/book/timing-explore.md)?

use crate::program::PROGRAM;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::LazyLock;

fn splatsim(arguments: &[&str]) -> Output {
    Command::new(PROGRAM.as_str())
        .args(arguments)
        .output()
        .unwrap()
}

/// Standard output of a successful command.
fn says(arguments: &[&str]) -> String {
    let output = splatsim(arguments);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(
        (output.status.code(), told.as_str()),
        (Some(0), ""),
        "{arguments:?}"
    );
    String::from_utf8(output.stdout).unwrap()
}

/// The command ends with status 2 and one sentence that contains all of these words.
fn refused(arguments: &[&str], parts: &[&str]) {
    let output = splatsim(arguments);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(
        (
            output.status.code(),
            told.lines().count(),
            output.stdout.len()
        ),
        (Some(2), 1, 0),
        "{arguments:?}: {told}"
    );
    assert!(
        parts.iter().all(|part| told.contains(part)),
        "{arguments:?}: {told}"
    );
}

fn json_of(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

fn compared(arguments: &[&str]) -> Value {
    serde_json::from_str(&says(&[&["compare", "--json"], arguments].concat())).unwrap()
}

/// A changed field of `timing` and one of the datapath, in B.
const CHANGES: [&str; 2] = ["timing.ellipse.interval=9", "gauss.weight=U-2F6"];

/// Three small runs: `a`; `b`, with changed fields; `c`, with another size. Also a scene, and a
/// record of `a`.
struct ThreeRuns {
    folder: tempfile::TempDir,
}

impl ThreeRuns {
    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).to_str().unwrap().to_owned()
    }
}

static MADE: LazyLock<ThreeRuns> = LazyLock::new(|| {
    let made = ThreeRuns {
        folder: tempfile::tempdir().unwrap(),
    };
    let scene = made.text("few.json");
    // Few splats, because the program may be a debug build.
    std::fs::write(
        &scene,
        r#"{"splats": {"builtin": "glass-spheres", "count": 3000}}"#,
    )
    .unwrap();
    let run = |name: &str, more: &[&str]| {
        let out = made.text(name);
        let usual = ["run", &scene, "--machine", "tiny", "--quiet", "--out", &out];
        assert_eq!(says(&[&usual[..], more].concat()), "");
    };
    let changed = CHANGES.map(|change| ["--set", change]);
    run(
        "a",
        &[
            "--size",
            "40x32",
            "--record",
            &made.text("frame.work"),
            "--what-if",
        ],
    );
    run(
        "b",
        &[&["--size", "40x32"], changed.as_flattened()].concat(),
    );
    run("c", &["--size", "32x32"]);
    made
});

/// A folder like `a`, with a changed report.
fn damaged(name: &str, change: impl FnOnce(&mut Value)) -> String {
    let folder = MADE.path(name);
    std::fs::create_dir(&folder).unwrap();
    for picture in ["fixed.png", "golden.png", "ideal.png"] {
        std::fs::copy(MADE.path("a").join(picture), folder.join(picture)).unwrap();
    }
    let mut report = json_of(&MADE.path("a/report.json"));
    change(&mut report);
    std::fs::write(folder.join("report.json"), report.to_string()).unwrap();
    MADE.text(name)
}

// ---- compare ----

#[test]
fn what_is_compared_with_itself_does_not_differ() {
    let a = MADE.text("a");
    let own = compared(&[&a, &a]);
    assert_eq!(
        (
            &own["equal"],
            &own["machine"],
            &own["scene"],
            &own["elsewhere"]
        ),
        (&json!(true), &json!([]), &json!([]), &json!([]))
    );
    for pair in own["pictures"].as_array().unwrap() {
        assert_eq!(
            (&pair["psnr_db"], &pair["pixels_that_differ"]),
            (&Value::Null, &json!(0))
        );
    }
    assert_eq!(own["pictures"].as_array().unwrap().len(), 3);
    assert!(
        own["figures"]
            .as_array()
            .unwrap()
            .iter()
            .all(|figure| figure["a"] == figure["b"])
    );
    assert!(says(&["compare", &a, &a]).ends_with("\n\nnothing differs, nor does any pixel\n"));
    // The host's run time is not compared either.
    let later = damaged("later", |report| {
        report["host"]["golden_seconds"] = json!(99.0)
    });
    assert_eq!(compared(&[&a, &later])["equal"], json!(true));
    assert!(says(&["compare", "tiny", "tiny"]).ends_with("\n\nnothing differs\n"));
    // Differences that are in no table are named.
    let odd = damaged("odd", |report| {
        report["signals"][0]["inexact"] = json!(123_456)
    });
    let odd = compared(&[&a, &odd]);
    assert_eq!(
        (&odd["equal"], &odd["elsewhere"]),
        (&json!(false), &json!(["signals"]))
    );
}

#[test]
fn every_figure_is_the_one_of_its_report() {
    let both = compared(&[&MADE.text("a"), &MADE.text("b")]);
    let [a, b] = ["a", "b"].map(|name| json_of(&MADE.path(name).join("report.json")));
    let figures = both["figures"].as_array().unwrap();
    let paths: Vec<&str> = figures
        .iter()
        .map(|figure| figure["path"].as_str().unwrap())
        .collect();
    for wanted in [
        "cycles.total",
        "cycles.frames_per_second",
        "cost.area",
        "cost.energy.total",
        "accuracy.fixed_vs_golden.psnr_db",
    ] {
        assert!(paths.contains(&wanted), "{paths:?}");
    }
    for figure in figures {
        let pointer = format!("/{}", figure["path"].as_str().unwrap().replace('.', "/"));
        let [own, other] = [&a, &b].map(|report| report.pointer(&pointer).unwrap());
        assert_eq!((&figure["a"], &figure["b"]), (own, other), "{pointer}");
        if let (Some(own), Some(other)) = (own.as_f64(), other.as_f64()) {
            assert_eq!(figure["difference"], json!(other - own), "{pointer}");
            let relative = (own != 0.0 && !pointer.ends_with("_db")).then(|| (other - own) / own);
            assert_eq!(
                figure.get("relative").and_then(Value::as_f64),
                relative,
                "{pointer}"
            );
        }
    }
    for unit in both["units"].as_array().unwrap() {
        for (side, report) in [("a", &a), ("b", &b)] {
            let own = report["cycles"]["units"]
                .as_array()
                .unwrap()
                .iter()
                .find(|own| own["name"] == unit["name"]);
            let counts = own.map(|own| {
                ["busy", "starved", "blocked", "memory"]
                    .map(|state| own[state].clone())
                    .to_vec()
            });
            assert_eq!(
                unit[side].get("cycles"),
                counts.map(Value::from).as_ref(),
                "{unit}"
            );
        }
    }
}

#[test]
fn all_changes_are_reported_and_nothing_else() {
    let both = compared(&[&MADE.text("a"), &MADE.text("b")]);
    let fields = |both: &Value| -> Vec<(String, Value, Value)> {
        let all = both["machine"].as_array().unwrap().iter();
        all.map(|field| {
            (
                field["field"].as_str().unwrap().to_owned(),
                field["a"].clone(),
                field["b"].clone(),
            )
        })
        .collect()
    };
    let mut told = fields(&both);
    told.sort_by(|one, other| one.0.cmp(&other.0));
    // The interval is omitted, and therefore changes too.
    let follows =
        json_of(&MADE.path("a/report.json"))["machine"]["timing"]["ellipse"]["interval"].clone();
    let before =
        json_of(&MADE.path("a/report.json"))["machine"]["description"]["gauss"]["weight"].clone();
    let expected = [
        ("gauss.weight", before, json!("U-2F6")),
        ("timing.ellipse.interval", follows, json!(9)),
    ];
    assert_eq!(told, expected.map(|(field, a, b)| (field.to_owned(), a, b)));
    assert_eq!(both["scene"], json!([]));
    let left_out = both["machine"]
        .as_array()
        .unwrap()
        .iter()
        .find(|field| field["field"] == "timing.ellipse.interval")
        .unwrap();
    assert_eq!(left_out["left_out"], json!(["a"]));
    let text = says(&["compare", &MADE.text("a"), &MADE.text("b")]);
    assert!(
        text.contains("(left out)") && text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
    // The same for two machines: their fields and areas, and no frame.
    let alone = compared(&["tiny", "tiny", "--set-b", CHANGES[0], "--set-b", CHANGES[1]]);
    assert_eq!(fields(&alone), fields(&both));
    assert_eq!(alone["pictures"], json!([]));
    let changed = |pair: &[&str]| compared(pair)["machine"].as_array().unwrap().len();
    assert_eq!(changed(&["tiny", "tiny", "--set", "fragment.layers=2"]), 0);
    assert!(changed(&["tiny", "lean"]) > 30);
    let many = says(&["compare", "tiny", "lean"]);
    assert!(
        many.contains("more fields of the machine: --all lists them")
            && many.lines().all(|line| line.chars().count() <= 80),
        "{many}"
    );
    assert!(says(&["compare", "tiny", "lean", "--all"]).contains("\nresolve.frame "));
    // The rounding differs, but not the format.
    let rounded = compared(&["tiny", "tiny", "--set-b", "gauss.weight.round=truncate"]);
    assert_eq!(
        rounded["machine"],
        json!([{"field": "gauss.weight", "a": "U-2F10", "b": "U-2F10 truncate"}])
    );
}

#[test]
fn two_machines_draw_a_scene_as_two_runs_do() {
    let (scene, a, b) = (MADE.text("few.json"), MADE.text("a"), MADE.text("b"));
    let out = MADE.text("drawn");
    let set: Vec<&str> = CHANGES
        .iter()
        .flat_map(|change| ["--set-b", change])
        .collect();
    let drawn = compared(
        &[
            &[
                "tiny", "tiny", "--scene", &scene, "--size", "40x32", "--out", &out,
            ][..],
            &set,
        ]
        .concat(),
    );
    let read = compared(&[&a, &b]);
    for part in ["figures", "units", "machine", "scene"] {
        assert_eq!(drawn[part], read[part], "{part}");
    }
    // Files have 8 bits, so errors below their steps differ.
    let psnr = |both: &Value| both["pictures"][0]["psnr_db"].as_f64().unwrap();
    assert!(
        (psnr(&drawn) - psnr(&read)).abs() < 0.5,
        "{} and {}",
        psnr(&drawn),
        psnr(&read)
    );
    // The pictures are those of the runs, and the difference is computed from them.
    let picture = |folder: &str, name: &str| {
        image::open(MADE.path(folder).join(name))
            .unwrap()
            .into_rgba8()
    };
    assert_eq!(
        (picture("drawn", "a.png"), picture("drawn", "b.png")),
        (picture("a", "fixed.png"), picture("b", "fixed.png"))
    );
    let difference = picture("drawn", "difference.png");
    let [one, other] = ["a", "b"].map(|folder| picture(folder, "fixed.png"));
    // Only visible pixels: in the dark, a difference of a few codes may be less than one code of
    // the difference picture.
    let seen = |at: usize| {
        [&one, &other]
            .iter()
            .all(|picture| picture.as_raw()[4 * at + 3] > 128)
    };
    let far = |at: usize| {
        (4 * at..4 * at + 3).any(|byte| one.as_raw()[byte].abs_diff(other.as_raw()[byte]) > 32)
    };
    let empty = |at: usize| {
        [&one, &other]
            .iter()
            .all(|picture| picture.as_raw()[4 * at + 3] == 0)
    };
    let lit = |at: usize| difference.as_raw()[4 * at..4 * at + 3] != [0, 0, 0];
    let pixels = 40 * 32;
    assert!((0..pixels).any(|at| seen(at) && far(at)));
    let wrong: Vec<usize> = (0..pixels)
        .filter(|at| seen(*at) && far(*at) && !lit(*at) || empty(*at) && lit(*at))
        .collect();
    assert!(wrong.is_empty(), "{wrong:?}");
    assert_eq!(json_of(&MADE.path("drawn/compare.json")), drawn);
    // `view` shows the folder.
    let view = splatsim::view::View::new(&MADE.path("drawn"), None).unwrap();
    assert_eq!(view.folder().contents["compare"], drawn);
    assert_eq!(
        view.folder().pictures(),
        ["a.png", "b.png", "difference.png"]
    );
}

#[test]
fn a_record_is_replayed_on_both_machines() {
    let record = MADE.text("frame.work");
    let replayed = compared(&["tiny", "tiny", "--set-b", CHANGES[0], "--replay", &record]);
    let figure = |both: &Value, path: &str| {
        both["figures"]
            .as_array()
            .unwrap()
            .iter()
            .find(|figure| figure["path"] == path)
            .unwrap()
            .clone()
    };
    let a = json_of(&MADE.path("a/report.json"));
    assert_eq!(figure(&replayed, "cycles.total")["a"], a["cycles"]["total"]);
    assert_eq!(
        figure(&replayed, "cost.energy.total")["a"],
        a["cost"]["energy"]["total"]
    );
    assert!(
        figure(&replayed, "cycles.total")["relative"]
            .as_f64()
            .unwrap()
            > 0.0
    );
    refused(
        &["compare", "tiny", "lean", "--replay", &record],
        &["lean", "outside `timing`", "--scene"],
    );
}

#[test]
fn fields_of_lists_can_differ_in_a_replay() {
    let (scene, record) = (MADE.text("bouquet.json"), MADE.text("bouquet.work"));
    std::fs::write(
        &scene,
        r#"{"splats": {"gaussians": "bouquet", "count": 2000}}"#,
    )
    .unwrap();
    let drawn = ["run", &scene, "--machine", "gaussian", "--size", "48x32"];
    let unchecked = ["--check", "none", "--quiet", "--record", &record];
    assert_eq!(says(&[&drawn[..], &unchecked].concat()), "");
    let field = "sort.kind=tile";
    let sides = ["gaussian", "gaussian", "--replay", &record, "--set-b"];
    let both = compared(&[&sides[..], &[field]].concat());
    let alone = MADE.text("tile");
    says(&["replay", &record, "--set", field, "--out", &alone]);
    let alone = json_of(&MADE.path("tile/cycles.json"));
    let figures = both["figures"].as_array().unwrap();
    let cycles = figures
        .iter()
        .find(|figure| figure["path"] == "cycles.total");
    let cycles = cycles.unwrap();
    assert_eq!(cycles["b"], alone["total"]);
    assert_ne!(cycles["a"], cycles["b"]);
    refused(
        &[&["compare"], &sides[..], &["sort.kind=none"]].concat(),
        &["sort.kind=none", "different pictures"],
    );
    refused(
        &[&["compare"], &sides[..], &["sort.key=U1F9"]].concat(),
        &["sort.key=U1F9", "--scene"],
    );
}

#[test]
fn equal_pictures_and_pixels_of_nan_have_no_decibels() {
    let (equal, broken) = (
        json!({"psnr_db": null}),
        json!({"psnr_db": 0.0, "not_finite": 3}),
    );
    let with = |name: &str, pair: &Value| {
        damaged(name, |report| {
            report["accuracy"]["fixed_vs_golden"]
                .as_object_mut()
                .unwrap()
                .extend(pair.as_object().unwrap().clone())
        })
    };
    let both = compared(&[&with("equal", &equal), &with("broken", &broken)]);
    let figure = both["figures"]
        .as_array()
        .unwrap()
        .iter()
        .find(|figure| figure["path"] == "accuracy.fixed_vs_golden.psnr_db")
        .unwrap();
    assert_eq!(
        (&figure["a"], &figure["b"], figure.get("difference")),
        (&json!("equal"), &json!("NaN"), None)
    );
}

#[test]
fn results_that_cannot_be_compared_are_refused_in_a_sentence() {
    let (a, c) = (MADE.text("a"), MADE.text("c"));
    let nothing = MADE.path("nothing");
    std::fs::create_dir(&nothing).unwrap();
    let empty = nothing.to_str().unwrap();
    refused(&["compare", &a, empty], &["nothing: has no report.json"]);
    refused(
        &["compare", &a, &c],
        &["40×32", "32×32", "pictures of the same size"],
    );
    let [a_report, c_report] = [&a, &c].map(|folder| format!("{folder}/report.json"));
    assert_eq!(
        compared(&[&a_report, &c_report])["scene"]
            .as_array()
            .unwrap()[0]["field"],
        "width"
    );
    refused(
        &["compare", &a, "tiny"],
        &["tiny is a machine", "a frame that was drawn"],
    );
    refused(
        &["compare", &a, &a, "--scene", "terrain"],
        &["are for two machines"],
    );
    refused(
        &["compare", &a, &a, "--set-b", CHANGES[0]],
        &[
            "--set-b timing.ellipse.interval=9",
            "only a machine can be changed",
        ],
    );
    refused(
        &["compare", "tiny", "leen"],
        &["leen", "named are reference"],
    );
    refused(
        &["compare", "tiny", "tiny", "--set-b", "gauss.wieght=U0F8"],
        &["the nearest is `weight`"],
    );
    refused(
        &["compare", "tiny", "tiny", "--set", "fragment.layers=9"],
        &["1 to 8 can be built"],
    );
    refused(&["compare", "tiny"], &["<B>"]);
    for (name, change, part) in [
        (
            "old",
            (|report: &mut Value| report["version"] = json!("0.0.1")) as fn(&mut Value),
            "is of splatsim 0.0.1",
        ),
        (
            "unversioned",
            |report| _ = report.as_object_mut().unwrap().remove("version"),
            "has no version",
        ),
        (
            "timeless",
            |report| report["cycles"]["total"] = json!("many"),
            "has no cycles.total",
        ),
        (
            "unmeasured",
            |report| {
                _ = report["accuracy"]
                    .as_object_mut()
                    .unwrap()
                    .remove("fixed_vs_ideal")
            },
            "accuracy.fixed_vs_ideal.psnr_db",
        ),
        (
            "unitless",
            |report| report["cycles"]["units"][0]["busy"] = json!(-1),
            "has no cycles.units.busy",
        ),
        (
            "machineless",
            |report| report["machine"]["description"] = json!({}),
            "machine.description",
        ),
        (
            "larger",
            |report| report["scene"]["width"] = json!(41),
            "fixed.png: is 40×32, and report.json is of 41×32",
        ),
    ] {
        refused(&["compare", &a, &damaged(name, change)], &[name, part]);
    }
    for (name, bytes) in [("cut", Some(&b"\x89PNG\r\n\x1a\n"[..])), ("gone", None)] {
        let folder = damaged(name, |_| {});
        let picture = Path::new(&folder).join("golden.png");
        bytes
            .map_or_else(
                || std::fs::remove_file(&picture),
                |bytes| std::fs::write(&picture, bytes),
            )
            .unwrap();
        refused(
            &["compare", &folder, &a, "--out", &MADE.text("never")],
            &["golden.png"],
        );
        assert!(!MADE.path("never").exists());
    }
    let broken = MADE.text("broken.json");
    std::fs::write(&broken, "{").unwrap();
    refused(&["compare", &broken, "tiny"], &["broken.json", "not JSON"]);
}

// ---- what-if ----

#[test]
fn an_answer_is_what_the_run_with_it_says() {
    let report = json_of(&MADE.path("a/report.json"));
    let best = report["answers"]["best"].as_array().unwrap();
    assert!((1..=5).contains(&best.len()), "{best:?}");
    let gains: Vec<f64> = best
        .iter()
        .map(|answer| answer["faster"].as_f64().unwrap())
        .collect();
    assert!(
        gains.is_sorted_by(|one, next| one >= next) && gains.iter().all(|gain| *gain >= 0.001),
        "{gains:?}"
    );
    let (scene, out) = (MADE.text("few.json"), MADE.text("answered"));
    for answer in best {
        let setting = format!("{}={}", answer["field"].as_str().unwrap(), answer["to"]);
        says(&[
            "run",
            &scene,
            "--machine",
            "tiny",
            "--size",
            "40x32",
            "--quiet",
            "--out",
            &out,
            "--set",
            &setting,
        ]);
        let run = json_of(&MADE.path("answered/report.json"));
        let told = ["cycles", "frames_per_second", "bytes", "area", "energy"]
            .map(|figure| &answer[figure]);
        let measured = [
            "/cycles/total",
            "/cycles/frames_per_second",
            "/cycles/memory/bytes",
            "/cost/area",
            "/cost/energy/total",
        ];
        assert_eq!(
            told,
            measured.map(|pointer| run.pointer(pointer).unwrap()),
            "{setting}"
        );
        let more = |pointer: &str| {
            run.pointer(pointer).unwrap().as_f64().unwrap()
                / report.pointer(pointer).unwrap().as_f64().unwrap()
                - 1.0
        };
        assert!(
            (more("/cycles/frames_per_second") - answer["faster"].as_f64().unwrap()).abs() < 1e-9,
            "{setting}"
        );
        assert!(
            (more("/cost/area") - answer["larger"].as_f64().unwrap()).abs() < 1e-9,
            "{setting}"
        );
    }
}

/// A frame that is recorded for `--what-if` has what other tests of tiles and other sorts need:
/// the result for each is that of a run with it.
#[test]
fn an_answer_about_lists_is_what_the_run_with_it_says() {
    let (scene, out) = (MADE.text("city.json"), MADE.text("lists"));
    let text = json!({"splats": {"gaussians": "city", "count": 20000}, "camera": {"eye": [0, 0.3, 3.95], "target": [0, 0.32, 0]}});
    std::fs::write(&scene, text.to_string()).unwrap();
    let run = |more: &[&str]| {
        let common = [
            "run",
            &scene,
            "--machine",
            "gaussian",
            "--size",
            "96x64",
            "--check",
            "none",
            "--quiet",
            "--out",
            &out,
        ];
        says(&[&common, more].concat());
        json_of(&MADE.path("lists/report.json"))
    };
    // Memory and drawing take no time, so lists are what counts.
    let fast = [
        "--set",
        "timing.memory.bytes_per_cycle=4",
        "--set",
        "timing.raster.lanes=[8, 8]",
        "--set",
        "timing.sort.units=2",
        "--set",
        "sort.kind=tile",
    ];
    let answered = run(&[&fast[..], &["--what-if"]].concat());
    let answers = &answered["answers"];
    let best = answers["best"].as_array().unwrap();
    let of_lists: Vec<&Value> = (best.iter())
        .filter(|answer| {
            let field = answer["field"].as_str().unwrap();
            field.starts_with("bin.")
                || field.starts_with("sort.")
                || field == "timing.sort.overlap"
        })
        .collect();
    assert!(!of_lists.is_empty(), "{best:?}");
    for answer in of_lists {
        let setting = format!("{}={}", answer["field"].as_str().unwrap(), answer["to"]);
        let alone = run(&[&fast[..], &["--set", &setting]].concat());
        for (figure, pointer) in [
            ("cycles", "/cycles/total"),
            ("bytes", "/cycles/memory/bytes"),
            ("area", "/cost/area"),
            ("energy", "/cost/energy/total"),
        ] {
            assert_eq!(
                &answer[figure],
                alone.pointer(pointer).unwrap(),
                "{setting}"
            );
        }
    }
}

/// Bandwidth and bursts have no unit cost. The frame is faster with them, and each such result is
/// marked.
#[test]
fn a_gain_without_a_unit_cost_is_marked_as_given() {
    let answers = json_of(&MADE.path("a/report.json"))["answers"].clone();
    let fields = |list: &str| -> Vec<String> {
        answers[list]
            .as_array()
            .unwrap()
            .iter()
            .map(|answer| answer["field"].as_str().unwrap().to_owned())
            .collect()
    };
    let (priced, given) = (fields("best"), fields("given"));
    assert!(
        given.contains(&"timing.memory.bytes_per_cycle".to_owned()),
        "{given:?}"
    );
    let is_given = |field: &String| {
        ["bytes_per_cycle", "burst_bytes", "ways"]
            .iter()
            .any(|name| field.ends_with(name))
    };
    assert!(
        given.iter().all(is_given) && !priced.iter().any(is_given),
        "{priced:?} {given:?}"
    );
    for answer in answers["given"].as_array().unwrap() {
        assert!(
            answer["given"].as_str().unwrap().contains("unit cost")
                && answer["faster"].as_f64().unwrap() > 0.0,
            "{answer}"
        );
    }
    let table = says(&["replay", &MADE.text("frame.work"), "--what-if"]);
    assert!(
        table.contains("timing.memory.bytes_per_cycle *") && table.contains("* given: memory"),
        "{table}"
    );
    let timings = says(&[
        "replay",
        &MADE.text("frame.work"),
        "--timing",
        "timing.clock_hz=2e8,4e8",
    ]);
    assert!(
        timings.contains("given, at no cost: timing.clock_hz (memory keeps its bytes per cycle"),
        "{timings}"
    );
}

#[test]
fn a_replay_finds_what_the_run_finds_and_prints_no_report_again() {
    let record = MADE.text("frame.work");
    let answers = says(&["replay", &record, "--what-if"]);
    // The old name of the flag.
    assert_eq!(says(&["replay", &record, "--answers"]), answers);
    let table = answers.split("\n\n").nth(1).unwrap();
    assert!(
        table.starts_with("answers, ") && table.contains("timing.") && !answers.contains("starved"),
        "{answers}"
    );
    let scene = MADE.text("few.json");
    assert!(
        says(&[
            "run",
            &scene,
            "--machine",
            "tiny",
            "--size",
            "40x32",
            "--answers"
        ])
        .contains(table),
        "{table}"
    );
    assert!(
        answers.lines().all(|line| line.chars().count() <= 80),
        "{answers}"
    );
    assert!(says(&["replay", &record]).contains("starved"));
}

// ---- a grid of fields ----

#[test]
fn several_fields_are_a_grid_of_machines() {
    let record = MADE.text("frame.work");
    let grid = [
        "--timing",
        "timing.raster.lanes=[1,1],[4,1]",
        "--timing",
        "timing.ellipse.interval=1,9,20",
    ];
    let text = says(&[&["replay", &record][..], &grid].concat());
    let rows: Vec<Vec<&str>> = text
        .lines()
        .skip(3)
        .take(6)
        .map(|line| line.split_whitespace().collect())
        .collect();
    let values: Vec<[&str; 2]> = rows.iter().map(|row| [row[0], row[1]]).collect();
    let expected =
        ["[1,1]", "[4,1]"].map(|lanes| ["1", "9", "20"].map(|interval| [lanes, interval]));
    assert_eq!(values, expected.as_flattened(), "{text}");
    // Each row equals the machine with both settings.
    let one = says(&[
        "replay",
        &record,
        "--set",
        "timing.raster.lanes=[1,1]",
        "--timing",
        "timing.ellipse.interval=9",
    ]);
    let cycles = one
        .lines()
        .nth(3)
        .unwrap()
        .split_whitespace()
        .nth(1)
        .unwrap();
    assert_eq!(rows[1][2], cycles, "{text}{one}");
    let many = |count: usize| {
        (1..=count)
            .map(|value| value.to_string())
            .collect::<Vec<_>>()
            .join(",")
    };
    let [intervals, fifos] = [
        format!("timing.ellipse.interval={}", many(40)),
        format!("timing.raster.fifo={}", many(26)),
    ];
    refused(
        &[
            "replay", &record, "--timing", &intervals, "--timing", &fifos,
        ],
        &["40×26 values are 1040 machines", "at most 1000"],
    );
    refused(
        &[
            "replay",
            &record,
            "--timing",
            "timing.raster.fifo=1",
            "--timing",
            "timing.raster.fifo=2",
        ],
        &["timing.raster.fifo", "named twice"],
    );
    let odd = [
        "--timing",
        "timing.raster.fifo=1,0",
        "--timing",
        "timing.gauss.fifo=4",
    ];
    refused(
        &[&["replay", &record][..], &odd].concat(),
        &["--timing timing.raster.fifo=0 --timing timing.gauss.fifo=4"],
    );
}

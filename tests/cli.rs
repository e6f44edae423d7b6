//! Does the binary behave as docs/book/getting-started.md describes: its files, its report, its
//! messages, its exit status, and a quick end on bad input?

use crate::program::PROGRAM;
use crate::shared_input;
use crate::tier::{self, Tier};
use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::LazyLock;
use std::time::Duration;

use assert_cmd::Command;
use serde_json::{Value, json};

/// Machine and size of runs whose picture does not matter.
const SMALL: [&str; 4] = ["--size", "48x40", "--machine", "tiny"];

/// The default scene with a hundredth of its splats: loading all of them would dominate a small
/// run.
static FEW: LazyLock<String> = LazyLock::new(|| few("glass-spheres", 3000));

/// A kept file with a generated scene of `count` splats.
fn few(scene: &str, count: u32) -> String {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let file = tempfile::NamedTempFile::new_in(folder).unwrap();
    std::fs::write(
        file.path(),
        json!({"splats": {"builtin": scene, "count": count}}).to_string(),
    )
    .unwrap();
    // Another process that does this at the same time writes the same bytes.
    let path = folder.join(format!("{scene}-{count}.json"));
    file.persist(&path).unwrap();
    path.to_str().unwrap().to_owned()
}

/// A run whose picture does not matter.
fn small() -> Vec<&'static str> {
    [&[FEW.as_str()], &SMALL[..]].concat()
}

fn splatsim(arguments: &[&str]) -> Output {
    Command::new(PROGRAM.as_str())
        .args(arguments)
        .timeout(Duration::from_secs(120))
        .output()
        .unwrap()
}

/// Standard output of a successful run; standard error is empty.
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

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

fn write(folder: &tempfile::TempDir, name: &str, text: &str) -> String {
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

fn names_in(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// Runs with `--out` into a new folder; the folder and the report.
fn run(arguments: &[&str]) -> (tempfile::TempDir, Value) {
    let out = folder();
    let mut all = vec!["run"];
    all.extend(arguments);
    all.extend(["--out", out.path().to_str().unwrap()]);
    says(&all);
    let report =
        serde_json::from_str(&std::fs::read_to_string(out.path().join("report.json")).unwrap())
            .unwrap();
    (out, report)
}

// ---- run ----

/// The files of a run.
const WRITTEN: [&str; 13] = [
    "bounds.png",
    "cycles.csv",
    "cycles.png",
    "error.png",
    "fixed.png",
    "flips.png",
    "golden.png",
    "ideal.png",
    "ranges.png",
    "report.json",
    "roofline.png",
    "roofline.svg",
    "tiles.csv",
];

#[test]
fn run_writes_five_pictures_a_chart_and_a_report_and_nothing_else() {
    let (out, _) = run(&small());
    assert_eq!(names_in(out.path()), WRITTEN);
    for name in [
        "error.png",
        "fixed.png",
        "flips.png",
        "golden.png",
        "ideal.png",
    ] {
        let picture = image::open(out.path().join(name)).unwrap();
        assert_eq!((picture.width(), picture.height()), (48, 40), "{name}");
        assert!(
            matches!(
                picture,
                image::DynamicImage::ImageRgba8(_) | image::DynamicImage::ImageRgb8(_)
            ),
            "{name} has 8 bits a channel"
        );
    }
}

#[test]
fn exr_pictures_come_on_request_and_not_without_a_folder() {
    let (out, _) = run(&[&small()[..], &["--exr"]].concat());
    let mut expected = [&WRITTEN[..], &["fixed.exr", "golden.exr", "ideal.exr"]].concat();
    expected.sort_unstable();
    assert_eq!(names_in(out.path()), expected);
    refused(&["run", "--exr"], "--out");
}

#[test]
fn the_error_is_attributed_on_request() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let folder = folder();
    let scene = write(
        &folder,
        "few.json",
        r#"{"splats": {"builtin": "checkerboard", "count": 3000}}"#,
    );
    let arguments = [&[scene.as_str()], &SMALL[..], &["--attribute"]].concat();
    let (out, report) = run(&arguments);
    let mut expected = [&WRITTEN[..], &["attribution.png"]].concat();
    expected.sort_unstable();
    assert_eq!(names_in(out.path()), expected);
    let attribution = &report["attribution"];
    assert_eq!(
        attribution["all"]["psnr_covered_db"],
        report["accuracy"]["fixed_vs_golden"]["psnr_covered_db"]
    );
    assert_eq!(attribution["units"].as_array().unwrap().len(), 8);
    assert!(
        attribution["words"]
            .as_array()
            .unwrap()
            .iter()
            .any(|word| word["name"] == "raster.offset")
    );
    assert!(report["host"]["attribution_seconds"].is_number());
    let (_, other) = run(&[&arguments[..], &["--threads", "1"]].concat());
    assert_eq!(other["attribution"], *attribution);
    // It is absent if it was not requested.
    let (_, plain) = run(&small());
    assert_eq!(
        [
            plain.get("attribution"),
            plain["host"].get("attribution_seconds")
        ],
        [None; 2]
    );
    let text = says(&[&["run"], &arguments[..]].concat());
    assert!(
        text.contains("raster.offset") && text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
}

#[test]
fn a_preview_is_a_smaller_run_that_reports_what_it_leaves_out() {
    let terrain = few("terrain", 20_000);
    let (_, small) = run(&[&terrain, "--size", "40x32", "--machine", "tiny"]);
    let arguments = [
        terrain.as_str(),
        "--size",
        "160x128",
        "--machine",
        "tiny",
        "--preview",
    ];
    let (out, preview) = run(&arguments);
    assert_eq!(names_in(out.path()), WRITTEN);
    for part in ["scene", "accuracy", "cycles", "cost", "fragments"] {
        assert_eq!(small[part], preview[part], "{part}");
    }
    let (_, whole) = run(&arguments[..5]);
    let [about, off, is] = [
        &preview["preview"]["contributions"],
        &preview["preview"]["off"],
        &whole["scene"]["fragments"],
    ]
    .map(|n| n.as_f64().unwrap());
    assert!(
        (about / is - 1.0).abs() <= off,
        "{about} is said, {off} of it, and {is} it is"
    );
    assert_eq!(
        (preview["preview"]["of"].clone(), small.get("preview")),
        (json!([160, 128]), None)
    );
    assert!(preview["host"]["whole_seconds"].as_f64().unwrap() > 0.0);
    let text = says(&[&["run"], &arguments[..]].concat());
    assert!(
        text.contains("preview of 160×128: 15 of 16 pixels left out, no splat")
            && text.contains("do not scale"),
        "{text}"
    );
    assert!(
        text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
    let none = folder();
    let path = none.path().join("out");
    refused(
        &[
            "run",
            "--size",
            "100x100",
            "--preview",
            "--out",
            path.to_str().unwrap(),
        ],
        "are few",
    );
    assert!(!path.exists());
}

#[test]
fn fewer_tiles_are_checked_in_lockstep_on_request_and_the_report_states_it() {
    let out = folder();
    let run = |check: &str| {
        let all = [
            &["run"],
            &small()[..],
            &["--out", out.path().to_str().unwrap(), "--check", check],
        ]
        .concat();
        let text = says(&all);
        let report: Value =
            serde_json::from_slice(&std::fs::read(out.path().join("report.json")).unwrap())
                .unwrap();
        (text, report)
    };
    let [
        (_, mut full),
        (sampled_text, mut sampled),
        (none_text, mut none),
    ] = ["full", "sampled", "none"].map(run);
    assert_eq!(sampled["accuracy"]["lockstep"]["sampled_pixels"], 384);
    assert!(
        full["accuracy"]["lockstep"].get("sampled_pixels").is_none()
            && none["accuracy"].get("lockstep").is_none()
    );
    assert!(
        sampled_text.contains("in lockstep at 384 of 1,920 pixels, golden"),
        "{sampled_text}"
    );
    assert!(
        none_text.contains("not run in lockstep, so no bound was checked"),
        "{none_text}"
    );
    assert!(
        none_text
            .lines()
            .chain(sampled_text.lines())
            .all(|line| line.chars().count() <= 80),
        "{none_text}"
    );
    // Pictures of the previous run are removed.
    let left = WRITTEN
        .into_iter()
        .filter(|name| !["bounds.png", "flips.png"].contains(name));
    assert_eq!(names_in(out.path()), left.collect::<Vec<_>>());
    // Everything else is unchanged.
    for report in [&mut full, &mut sampled, &mut none] {
        report.as_object_mut().unwrap().remove("host");
        report["accuracy"]
            .as_object_mut()
            .unwrap()
            .remove("lockstep");
    }
    assert!(full == sampled && full == none);
    refused(&["run", "--check", "some"], "full, sampled, none");
}

#[test]
fn a_run_replaces_the_files_of_the_last_one_and_makes_its_folder() {
    let out = folder();
    let deep = out.path().join("a/b");
    for size in ["20x10", "10x20"] {
        says(&[
            "run",
            &FEW,
            "--machine",
            "tiny",
            "--size",
            size,
            "--out",
            deep.to_str().unwrap(),
        ]);
    }
    assert_eq!(
        image::image_dimensions(deep.join("fixed.png")).unwrap(),
        (10, 20)
    );
    assert_eq!(names_in(&deep), WRITTEN);
}

/// The fields that docs/book/reference/report.md promises, by path, with the kind of each value.
fn promised_fields() -> Vec<(String, &'static str)> {
    let mut fields: Vec<(String, &str)> = Vec::new();
    let mut all = |prefix: &str, names: &[&str], kind: &'static str| {
        fields.extend(names.iter().map(|n| (format!("{prefix}/{n}"), kind)))
    };
    all(
        "/scene",
        &[
            "splats",
            "fragments",
            "culled/near",
            "culled/outside",
            "culled/faint",
            "culled/backface",
        ],
        "count",
    );
    for pair in [
        "/accuracy/fixed_vs_golden",
        "/accuracy/golden_vs_ideal",
        "/accuracy/fixed_vs_ideal",
    ] {
        all(pair, &["psnr_db", "psnr_covered_db"], "number or null");
        all(pair, &["ssim", "max_error", "mean_error"], "number");
        all(pair, &["pixels_over_1_255"], "count");
    }
    all("/accuracy/lockstep", &["psnr_db"], "number or null");
    all("/accuracy/lockstep", &["max_error"], "number");
    all(
        "/accuracy/lockstep",
        &["bound_violations", "decision_flips"],
        "count",
    );
    all(
        "/fragments",
        &[
            "accumulated",
            "inserted",
            "merged",
            "evicted",
            "replaced",
            "dropped",
            "most_in_a_pixel",
        ],
        "count",
    );
    all("/signals/0", &["unit", "name", "format"], "text");
    all("/signals/0", &["min", "max"], "number or null");
    all(
        "/signals/0",
        &["saturated_low", "saturated_high", "wrapped", "inexact"],
        "count",
    );
    all(
        "/host",
        &["fixed_seconds", "golden_seconds", "fragments_per_second"],
        "number",
    );
    fields
}

#[test]
fn the_report_has_the_promised_fields_with_the_promised_kinds() {
    let (_out, report) = run(&small());
    for (path, kind) in promised_fields() {
        let value = report
            .pointer(&path)
            .unwrap_or_else(|| panic!("{path} is absent"));
        let fits = match kind {
            "count" => value.is_u64(),
            "number" => value.is_number(),
            "text" => value.is_string(),
            _ => value.is_number() || value.is_null(),
        };
        assert!(fits, "{path} is {value}, not {kind}");
    }
    let sum: u64 = report["fragments"]
        .as_object()
        .unwrap()
        .iter()
        .filter(|(n, _)| *n != "most_in_a_pixel")
        .map(|(_, v)| v.as_u64().unwrap())
        .sum();
    assert_eq!(report["scene"]["fragments"], sum);
    assert!(sum > 1000, "{sum}");
}

/// A section that is not built yet is absent, never filled with zeros.
#[test]
fn every_units_cycles_sum_to_the_frames() {
    for organisation in ["binned", "immediate"] {
        let setting = format!("timing.organisation={organisation}");
        let (out, report) = run(&[
            &small()[..],
            &["--set", &setting, "--set", "timing.ellipse.units=2"],
        ]
        .concat());
        let cycles = &report["cycles"];
        let total = cycles["total"].as_u64().unwrap();
        let count = |unit: &Value, name: &str| {
            unit[name]
                .as_u64()
                .unwrap_or_else(|| panic!("{name} of {unit}"))
        };
        let units = cycles["units"].as_array().unwrap();
        for unit in units {
            assert_eq!(
                ["busy", "starved", "blocked", "memory"]
                    .map(|name| count(unit, name))
                    .iter()
                    .sum::<u64>(),
                total,
                "{unit}"
            );
        }
        let names: Vec<&str> = units
            .iter()
            .map(|unit| unit["name"].as_str().unwrap())
            .collect();
        assert!(
            names.contains(&"ellipse.0")
                && names.contains(&"ellipse.1")
                && names.contains(&"fragment"),
            "{names:?}"
        );
        let seconds = total as f64 / cycles["clock_hz"].as_f64().unwrap();
        assert!((cycles["frames_per_second"].as_f64().unwrap() * seconds - 1.0).abs() < 1e-12);
        let bottleneck = cycles["bottleneck"].as_str().unwrap();
        assert!(
            bottleneck == "memory" || names.contains(&bottleneck),
            "{bottleneck}"
        );
        let csv = std::fs::read_to_string(out.path().join("cycles.csv")).unwrap();
        assert_eq!(
            (csv.lines().count(), csv.lines().next()),
            (
                names.len() + 1,
                Some("unit,items,busy,starved,blocked,memory,total")
            )
        );
        // The cycles of a binned machine's tiles sum to those of its units.
        let tiles = std::fs::read_to_string(out.path().join("tiles.csv"));
        assert_eq!(tiles.is_ok(), organisation == "binned");
        let Ok(tiles) = tiles else { continue };
        let mut lines = tiles
            .lines()
            .map(|line| line.split(',').collect::<Vec<_>>());
        let heads = lines.next().unwrap();
        let of = |line: &[&str], name: &str| {
            line[heads.iter().position(|head| *head == name).unwrap()]
                .parse::<u64>()
                .unwrap()
        };
        let lines: Vec<Vec<&str>> = lines.collect();
        let sum = |name: &str| lines.iter().map(|line| of(line, name)).sum::<u64>();
        for (unit, what) in [
            ("raster", "busy"),
            ("gauss", "blocked"),
            ("fragment", "busy"),
            ("fragment", "blocked"),
            ("list", "memory"),
        ] {
            let whole = units
                .iter()
                .find(|one| one["name"] == unit)
                .unwrap_or_else(|| panic!("{unit}"));
            assert_eq!(
                sum(&format!("{unit}_{what}")),
                count(whole, what),
                "{unit} {what}"
            );
        }
        let end = lines.iter().map(|line| of(line, "done")).max().unwrap();
        assert_eq!(of(&lines[0], "from") + sum("cycles"), end);
        assert!(end <= total);
    }
}

#[test]
fn a_frame_is_replayed_with_every_value_of_a_field() {
    let (out, report) = run(&[
        &small()[..],
        &["--timing", "timing.raster.lanes=[1,1],[4,1]"],
    ]
    .concat());
    let rows = report["timings"]["rows"].as_array().unwrap();
    let totals: Vec<u64> = rows
        .iter()
        .map(|row| row["cycles"]["total"].as_u64().unwrap())
        .collect();
    assert!(
        rows.len() == 2
            && totals[0] > totals[1]
            && totals[1] == report["cycles"]["total"].as_u64().unwrap(),
        "{totals:?}"
    );
    assert!(out.path().join("timings.png").exists());
    run_refused(
        &["--timing", "timing.raster.fifo=1,0"],
        "--timing timing.raster.fifo=0: machine reference cannot be built: timing.raster.fifo",
    );
    run_refused(&["--timing", "gauss.weight=1"], "timing.raster.fifo=1,2,4");
    run_refused(
        &["--timing", "timing.memry.banks=1"],
        "the nearest is `memory`",
    );
    run_refused(&["--set", "timing.clock_hz=0"], "timing.clock_hz is 0");
    run_refused(
        &["--timing", "timing.raster.fifo=99999999999"],
        "timing.raster.fifo is 9.9999999999e10; it must be at least 0 and at most 4294967295",
    );
}

/// A machine that keeps lists from frame to frame draws sequences. What draws frames alone says so.
#[test]
fn a_machine_that_keeps_lists_is_refused_where_frames_are_drawn_alone() {
    let folder = folder();
    let path = json!({
        "splats": {"gaussians": "bouquet", "count": 50},
        "camera_path": {"pan_pixels": 2, "frames": 3},
        "image": {"width": 16, "height": 16},
    });
    let scene = write(&folder, "path.json", &path.to_string());
    let out = folder.path().join("out");
    let out = out.to_str().unwrap();
    let search = [
        "search",
        &scene,
        "--machine",
        "neo",
        "--target-psnr",
        "20",
        "--out",
        out,
    ];
    refused(&search, "a search draws each of its views alone");
    let kind = "sort.kind=incremental";
    let compared = [
        "compare", "gaussian", "gaussian", "--set-b", kind, "--scene", &scene,
    ];
    refused(&compared, "compare draws the first frame alone");
    let axis = json!({"field": "sort.kind", "values": ["tile", "incremental"]});
    let plan = json!({"machine": "gaussian", "scenes": [scene], "lockstep": false, "axes": [axis]});
    let plan = write(&folder, "plan.json", &plan.to_string());
    says(&["sweep", &plan, "--out", out, "--quiet"]);
    let rows = std::fs::read_to_string(Path::new(out).join("sweep.csv")).unwrap();
    let alone = rows
        .lines()
        .filter(|row| row.contains("a sweep draws the first frame alone"));
    assert_eq!(alone.count(), 1, "{rows}");
}

/// Fields of lists change no picture, so that a frame is replayed with them too; each row is that
/// of the run with the field set.
#[test]
fn a_frame_is_replayed_with_other_lists() {
    let folder = folder();
    let bouquet = json!({"splats": {"gaussians": "bouquet", "count": 2000}}).to_string();
    let scene = write(&folder, "bouquet.json", &bouquet);
    let gaussians = [
        &scene,
        "--size",
        "96x96",
        "--machine",
        "gaussian",
        "--check",
        "none",
    ];
    let (_out, report) = run(&[
        &gaussians[..],
        &[
            "--timing",
            "sort.kind=radix,hierarchical",
            "--timing",
            "bin.test=box,ellipse",
        ],
    ]
    .concat());
    let rows = report["timings"]["rows"].as_array().unwrap();
    let total = |report: &Value| report["cycles"]["total"].as_u64().unwrap();
    let totals: Vec<u64> = rows.iter().map(total).collect();
    assert_eq!(totals[0], total(&report));
    let (_out, set) = run(&[
        &gaussians[..],
        &[
            "--set",
            "sort.kind=hierarchical",
            "--set",
            "bin.test=ellipse",
        ],
    ]
    .concat());
    assert_eq!(totals[3], total(&set), "{totals:?}");
    assert!(
        totals.iter().all(|cycles| *cycles > 0) && totals[0] != totals[3],
        "{totals:?}"
    );
    let refused = |flags: &[&str], part: &str| {
        run_refused(&[&gaussians[..], flags].concat(), part);
    };
    refused(
        &["--timing", "sort.kind=radix,none"],
        "--timing sort.kind=none: Gaussians are summed with sort.kind none",
    );
    refused(
        &[
            "--set",
            "sort.tile_bits=6",
            "--timing",
            "timing.tile.side_px=16,4",
        ],
        "--timing timing.tile.side_px=4: sort.tile_bits is 6, and the picture has 576 tiles",
    );
}

#[test]
fn requests_are_written_in_the_order_of_cycles_and_hold_all_traffic() {
    let (out, report) = run(&[&small()[..], &["--requests"]].concat());
    let [ramulator, dramsim] = ["requests.ramulator2", "requests.dramsim3"]
        .map(|name| std::fs::read_to_string(out.path().join(name)).unwrap());
    let clients = report["cycles"]["memory"]["clients"].as_array().unwrap();
    let bursts: u64 = clients
        .iter()
        .map(|client| client["requests"].as_u64().unwrap())
        .sum();
    assert_eq!(
        [ramulator.lines().count(), dramsim.lines().count()],
        [bursts as usize; 2]
    );
    let cycles: Vec<u64> = dramsim
        .lines()
        .map(|line| line.split(' ').nth(2).unwrap().parse().unwrap())
        .collect();
    assert!(cycles.is_sorted() && cycles[0] == 0);
    // The map has every address, and they fit into a small device.
    let map: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(out.path().join("requests.json")).unwrap())
            .unwrap();
    let number = |value: &serde_json::Value, name: &str| {
        value[name]
            .as_u64()
            .unwrap_or_else(|| panic!("{name}: {value}"))
    };
    let regions = map["regions"].as_array().unwrap();
    let addresses: Vec<u64> = dramsim
        .lines()
        .map(|line| u64::from_str_radix(line[2..].split(' ').next().unwrap(), 16).unwrap())
        .collect();
    let is_in = |at: u64| {
        regions.iter().any(|region| {
            (number(region, "base")..number(region, "base") + number(region, "bytes")).contains(&at)
        })
    };
    assert!(addresses.iter().all(|at| is_in(*at)));
    assert_eq!(
        (number(&map, "bursts"), number(&map, "clock_hz")),
        (bursts, report["cycles"]["clock_hz"].as_u64().unwrap())
    );
    let end = addresses.iter().max().unwrap() + number(&map, "burst_bytes");
    assert!(
        end <= number(&map, "address_bytes")
            && number(&map, "address_bytes") <= number(&map, "device_bytes")
    );
    // At most the bytes that the traffic can touch, in whole rows.
    assert!(number(&map, "device_bytes") < 1 << 26, "{map}");
    assert!(
        regions
            .windows(2)
            .all(|pair| number(&pair[0], "base") + number(&pair[0], "bytes")
                == number(&pair[1], "base")),
        "{map}"
    );
    for (load, read) in ramulator.lines().zip(dramsim.lines()) {
        let (load, read) = (
            load.split_once(' ').unwrap(),
            read.split(' ').collect::<Vec<_>>(),
        );
        assert_eq!((load.1, load.0 == "LD"), (read[0], read[1] == "READ"));
    }
}

#[test]
fn all_but_the_hosts_figures_is_the_same_at_one_thread_and_at_two() {
    let both = ["1", "2"].map(|threads| {
        run(&[
            &few("torus-knot", 20_000),
            "--size",
            "100x70",
            "--threads",
            threads,
        ])
    });
    let [(one, first), (two, second)] = &both;
    for name in ["fixed.png", "golden.png", "ideal.png", "error.png"] {
        assert!(
            std::fs::read(one.path().join(name)).unwrap()
                == std::fs::read(two.path().join(name)).unwrap(),
            "{name}"
        );
    }
    assert_eq!(
        (
            first["host"]["threads"].clone(),
            second["host"]["threads"].clone()
        ),
        (json!(1), json!(2))
    );
    let without_host = |folder: &Path| {
        let text = std::fs::read_to_string(folder.join("report.json")).unwrap();
        let start = text.find("\n  \"host\": {").expect("a host section");
        let end = start + text[start..].find("\n  }").unwrap();
        text[..start].to_owned() + &text[end..]
    };
    assert!(without_host(one.path()) == without_host(two.path()));
}

#[test]
fn quiet_is_quiet_and_without_a_folder_nothing_is_written() {
    let here = folder();
    let run = |more: &[&str]| {
        Command::new(PROGRAM.as_str())
            .current_dir(here.path())
            .arg("run")
            .args(small())
            .args(more)
            .output()
            .unwrap()
    };
    assert_eq!(run(&["--quiet"]).stdout, b"");
    assert!(
        String::from_utf8(run(&[]).stdout)
            .unwrap()
            .contains("no pictures written: --out DIR writes them")
    );
    assert!(names_in(here.path()).is_empty());
}

#[test]
fn the_default_is_glass_spheres_on_reference() {
    let text = says(&["run", "--size", "16x16"]);
    assert!(
        text.starts_with("glass-spheres on reference, 16×16: 280,000 splats, "),
        "{text}"
    );
}

#[test]
fn a_setting_reaches_the_machine_and_later_ones_win() {
    let set = [
        "--set",
        "fragment.layers=2",
        "--set",
        "gauss.weight=U-2F12",
        "--set",
        "gauss.weight.round=truncate",
        "--set",
        "fragment.layers=1",
    ];
    let (_out, report) = run(&[&small()[..], &set].concat());
    let machine = &report["machine"]["description"];
    assert_eq!(machine["fragment"]["layers"], 1);
    assert_eq!(
        machine["gauss"]["weight"],
        json!({"format": "U-2F12", "round": "truncate", "overflow": "saturate"})
    );
    assert!(
        report["fragments"]["inserted"].as_u64().unwrap() <= 48 * 40,
        "one layer a pixel: {}",
        report["fragments"]
    );
}

#[test]
fn no_line_of_a_summary_is_wider_than_eighty_columns() {
    let folder = folder();
    let name = format!("{}.json", "a long name ".repeat(9));
    let splats = json!([{"position": [0, 0, 0], "radius": 1e-9}, {"position": [0.1, 0, 0], "radius": 1e9}, {"position": [1e6, 0, 0], "radius": 1}]);
    let odd = write(&folder, &name, &json!({"splats": splats}).to_string());
    let out = folder.path().join("out");
    let all = ["reference", "lean", "tiny"];
    let knot = few("torus-knot", 20_000);
    // The default has some of the largest numbers, and reference the longest name.
    let of = [
        ("glass-spheres", &all[..1]),
        (FEW.as_str(), &all[1..]),
        (&knot, &all[..]),
        (&odd, &all),
    ];
    for (scene, machine) in tier::some(
        [12, 3],
        of.into_iter()
            .flat_map(|(scene, machines)| machines.iter().map(move |machine| (scene, machine))),
    ) {
        let text = says(&[
            "run",
            scene,
            "--machine",
            machine,
            "--size",
            "128x128",
            "--out",
            out.to_str().unwrap(),
        ]);
        for line in text.lines() {
            let is_one_word = !line.trim().contains(' ');
            assert!(
                line.chars().count() <= 80 || is_one_word,
                "{scene} on {machine}: {} columns: {line}",
                line.chars().count()
            );
            assert_eq!(line, line.trim_end(), "{scene} on {machine}");
        }
    }
}

#[test]
fn pictures_of_one_pixel_and_of_one_row_of_16384_are_drawn() {
    for size in ["1x1", "16384x1", "1x16384"] {
        let (out, report) = run(&[&FEW, "--size", size]);
        let (width, height) = image::image_dimensions(out.path().join("fixed.png")).unwrap();
        assert_eq!(format!("{width}x{height}"), size);
        assert!(report["scene"]["fragments"].as_u64().unwrap() > 0, "{size}");
    }
}

// ---- explain, machine, scene, help ----

#[test]
fn explain_prints_the_trace_of_a_pixel() {
    let text = says(&["explain", "glass-spheres", "--pixel", "256,300"]);
    assert!(
        text.starts_with("pixel 256,300 of glass-spheres on reference\n"),
        "{text}"
    );
    for part in [
        "open 0",
        "add to 0",
        "contributions, ",
        "fixed 0 ",
        "golden 0 ",
        "blended",
        "difference",
        "frame word (U1F16, hexadecimal): ",
    ] {
        assert!(text.contains(part), "{part} is absent from {text}");
    }
    assert!(text.lines().all(|line| line == line.trim_end()), "{text}");
    for (scene, machine, parts) in tier::some(
        [12, 12],
        [
            (
                "nested-shells",
                "volume",
                ["open ", "add to ", "All sheets together", "fixed "],
            ),
            (
                "bouquet",
                "gaussian",
                ["blend", "too late", "All sheets together", "golden "],
            ),
        ],
    ) {
        let text = says(&["explain", scene, "--pixel", "256,256"]);
        assert!(
            text.starts_with(&format!("pixel 256,256 of {scene} on {machine}\n")),
            "{text}"
        );
        assert!(parts.iter().all(|part| text.contains(part)), "{text}");
    }
    let sky = says(&["explain", "glass-spheres", "--pixel", "0,0"]);
    assert!(
        sky.contains("No splat touches this pixel.") && sky.contains("the pixel is background"),
        "{sky}"
    );
}

#[test]
fn the_listed_machines_can_be_shown_as_machine_files() {
    let list = says(&["machine", "list"]);
    assert!(
        list.lines().all(|line| line.chars().count() <= 80),
        "{list}"
    );
    // Name, two numbers with their unit, description.
    let mut rows = list.lines().skip(1);
    assert!(rows.all(|row| row.split_whitespace().count() > 5), "{list}");
    let names: Vec<&str> = list
        .lines()
        .skip(1)
        .map(|line| line.split(' ').next().unwrap())
        .collect();
    assert_eq!(
        names,
        [
            "reference",
            "lean",
            "tiny",
            "window",
            "volume",
            "gaussian",
            "fp16",
            "mixed",
            "weighted",
            "gscore",
            "neo",
            "flicker",
            "nycu",
            "cubed"
        ]
    );
    let folder = folder();
    let scene = write(
        &folder,
        "knot.json",
        r#"{"splats": {"builtin": "torus-knot", "count": 2000}}"#,
    );
    let gaussians = write(
        &folder,
        "bouquet.json",
        r#"{"splats": {"gaussians": "bouquet", "count": 500}}"#,
    );
    for name in names {
        let shown = says(&["machine", "show", name]);
        let file = write(&folder, &format!("{name}.json"), &shown);
        assert_eq!(says(&["machine", "show", &file]), shown);
        let draws_only_gaussians = ["mixed", "flicker", "cubed"].contains(&name);
        let scene = if draws_only_gaussians {
            &gaussians
        } else {
            &scene
        };
        let by_file = run(&[scene, "--size", "30x30", "--machine", &file]).1;
        let by_name = run(&[scene, "--size", "30x30", "--machine", name]).1;
        let all = |report: &Value| {
            [&report["machine"], &report["accuracy"], &report["signals"]].map(Value::clone)
        };
        assert_eq!(all(&by_file), all(&by_name));
    }
}

/// The pictures of the book are those of the program, and every graph has one.
#[test]
fn datapaths_are_drawn_as_in_the_book() {
    let folder = folder();
    let out = folder.path().join("datapaths");
    let table = says(&[
        "machine",
        "datapath",
        "gaussian",
        "--out",
        out.to_str().unwrap(),
    ]);
    let written = names_in(&out);
    assert_eq!(written.len(), 6, "{written:?}");
    assert!(
        written.iter().all(|name| table.contains(name.as_str())),
        "{table}"
    );
    let book = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/book/datapaths");
    let kept = names_in(&book);
    assert_eq!(kept, ["ellipse.svg", "gauss.svg", "project.svg"]);
    for name in kept {
        let [drawn, kept] = [&out, &book].map(|folder| std::fs::read_to_string(folder.join(&name)));
        assert!(drawn.unwrap() == kept.unwrap(), "{name} of the book is old");
    }
    let test = folder.path().join("test");
    says(&[
        "machine",
        "datapath",
        "gaussian",
        "--set",
        "bin.test=ellipse",
        "--out",
        test.to_str().unwrap(),
    ]);
    assert!(
        names_in(&test).contains(&"bin_tile.svg".to_owned()),
        "{:?}",
        names_in(&test)
    );
    refused(
        &[
            "machine",
            "datapath",
            "tiny",
            "--set",
            "gauss.weight=I4F40",
            "--out",
            out.to_str().unwrap(),
        ],
        "gauss.weight is I4F40",
    );
}

#[test]
fn a_machine_file_with_a_base_changes_only_its_own_fields() {
    let folder = folder();
    let file = write(
        &folder,
        "narrow.json",
        r#"{"base": "lean", "gauss": {"weight": {"format": "U-2F9", "round": "truncate"}}}"#,
    );
    let shown: Value = serde_json::from_str(&says(&["machine", "show", &file])).unwrap();
    let mut expected: Value = serde_json::from_str(&says(&["machine", "show", "lean"])).unwrap();
    expected["name"] = json!("narrow");
    expected["gauss"]["weight"] =
        json!({"format": "U-2F9", "round": "truncate", "overflow": "saturate"});
    assert_eq!(shown, expected);
    let by_setting = says(&[
        "machine",
        "show",
        "lean",
        "--set",
        "gauss.weight=U-2F9",
        "--set",
        "gauss.weight.round=truncate",
        "--set",
        "name=narrow",
    ]);
    assert_eq!(
        serde_json::from_str::<Value>(&by_setting).unwrap(),
        expected
    );
}

#[test]
fn prove_writes_the_proofs_that_it_lists_the_same_every_time() {
    let folders = [folder(), folder()];
    let [table, _] = folders.each_ref().map(|out| {
        says(&[
            "machine",
            "prove",
            "lean",
            "--set",
            "name=mine",
            "--out",
            out.path().to_str().unwrap(),
        ])
    });
    let names = names_in(folders[0].path());
    assert_eq!(names.len(), 9);
    for name in names {
        let [once, again] = folders
            .each_ref()
            .map(|out| std::fs::read_to_string(out.path().join(&name)).unwrap());
        assert_eq!(once, again);
        assert!(
            once.starts_with(&format!(
                "# {} of machine mine: ",
                name.trim_end_matches(".g")
            )),
            "{once}"
        );
        assert!(
            table
                .lines()
                .any(|line| line.starts_with(&format!("{name} "))),
            "{name} is not in:\n{table}"
        );
    }
    assert!(
        table
            .lines()
            .take_while(|line| !line.is_empty())
            .all(|line| line.chars().count() <= 80)
            && table.contains("gappa "),
        "{table}"
    );
}

#[test]
fn schemas_are_json_that_names_the_fields() {
    for (of, field) in [("machine", "fragment"), ("scene", "splats")] {
        let schema: Value = serde_json::from_str(&says(&[of, "schema"])).unwrap();
        assert!(schema["properties"][field].is_object(), "{of}");
    }
}

/// Names of the commands, in the help's order.
fn commands() -> Vec<String> {
    let help = says(&["--help"]);
    help.lines()
        .take_while(|line| *line != "Options:")
        .filter_map(|line| line.strip_prefix("  ")?.split_whitespace().next())
        .map(str::to_owned)
        .collect()
}

#[test]
fn help_and_version_are_no_errors_and_fit_a_terminal() {
    let below = [
        vec!["machine", "cost"],
        vec!["machine", "show"],
        vec!["machine", "timing"],
        vec!["machine", "prove"],
    ]
    .map(|names| names.into_iter().map(str::to_owned));
    let helps = commands()
        .into_iter()
        .map(|name| vec![name])
        .chain(below.map(Iterator::collect))
        .chain([vec![]]);
    for names in helps {
        for flag in ["-h", "--help"] {
            let arguments: Vec<&str> = names.iter().map(String::as_str).chain([flag]).collect();
            let text = says(&arguments);
            assert!(
                text.contains("Usage: splatsim")
                    && text.lines().all(|line| line.chars().count() <= 80),
                "{text}"
            );
        }
    }
    assert!(says(&["help"]).contains("Usage: splatsim"));
    assert_eq!(
        says(&["--version"]),
        format!("splatsim {}\n", env!("CARGO_PKG_VERSION"))
    );
}

/// The long help of a command has an example, which uses only flags of the command; the short help
/// has none.
#[test]
fn each_command_has_an_example_that_is_accepted() {
    let names = commands();
    assert!(names.len() > 15, "{names:?}");
    for name in names {
        let (short, long) = (says(&[&name, "-h"]), says(&[&name, "--help"]));
        let example = long
            .split("\nExample:\n")
            .nth(1)
            .unwrap_or_else(|| panic!("{name} has no example"))
            .trim()
            .to_owned();
        assert!(
            !short.contains("Example:") && example.starts_with(&format!("splatsim {name} ")),
            "{example}"
        );
        let words: Vec<&str> = example
            .split_whitespace()
            .skip(1)
            .take_while(|word| !["<", ">"].contains(word))
            .collect();
        // The help lists each flag, and the command line is refused only for missing files.
        assert!(
            words
                .iter()
                .filter(|word| word.starts_with("--"))
                .all(|flag| long.contains(flag)),
            "{example}"
        );
        let folder = folder();
        let output = Command::new(PROGRAM.as_str())
            .args(&words)
            .arg("--no-such-flag")
            .current_dir(folder.path())
            .output()
            .unwrap();
        let told = String::from_utf8(output.stderr).unwrap();
        assert!(
            output.status.code() == Some(2) && told.contains("'--no-such-flag'"),
            "{example}: {told}"
        );
    }
}

// ---- trace, diff ----

#[test]
fn a_trace_is_written_and_a_device_compared_with_it() {
    let out = folder();
    let inside = out.path().join("trace");
    let inside = inside.to_str().unwrap();
    let text = says(
        &[
            &[
                "trace",
                "checkerboard",
                "--units",
                "gauss,raster",
                "--splats",
                "100..4000",
                "--out",
                inside,
            ],
            &SMALL[..],
        ]
        .concat(),
    );
    assert!(
        text.contains("gauss.out")
            && !text.contains("shade.in")
            && text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
    let equal = format!("{inside}/gauss.out.hex");
    assert!(says(&["diff", inside, "gauss.out", &equal]).starts_with("gauss.out: "));
    assert!(says(&["diff", inside, "gauss.out", &equal, "--strict"]).starts_with("gauss.out: "));
    let device = write(
        &out,
        "device.hex",
        &std::fs::read_to_string(&equal)
            .unwrap()
            .replacen('0', "1", 1),
    );
    let output = splatsim(&["diff", inside, "gauss.out", &device]);
    let told = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert_one_line(&String::from_utf8(output.stderr).unwrap());
    assert!(
        told.contains("weight") && told.contains("replay") && told.contains("gauss.in record"),
        "{told}"
    );
    let output = splatsim(&["diff", inside, "gauss.out", &device, "--json"]);
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(
        (told["equal"].clone(), told["field"]["name"].clone()),
        (json!(false), json!("weight"))
    );
    // The printed command traces that splat.
    let replay = told["replay"].as_str().unwrap().replace(
        "--out replay",
        &format!("--out {}", out.path().join("replay").display()),
    );
    assert!(says(&replay.split_whitespace().skip(1).collect::<Vec<_>>()).contains("gauss.in"));
}

#[test]
fn gaussians_and_volumes_are_traced_too() {
    let out = folder();
    let [sorted, lit] = ["sorted", "lit"].map(|name| out.path().join(name).display().to_string());
    let text = says(
        &[
            &[
                "trace",
                "bouquet",
                "--units",
                "sort,raster",
                "--out",
                &sorted,
            ],
            &SMALL[..2],
        ]
        .concat(),
    );
    assert!(
        text.contains("sort.out") && text.contains("raster.out") && !text.contains("fragment"),
        "{text}"
    );
    assert!(
        says(&[
            "diff",
            &sorted,
            "sort.out",
            &format!("{sorted}/sort.out.hex")
        ])
        .starts_with("sort.out: ")
    );
    let text = says(
        &[
            &[
                "trace",
                "marschner-lobb",
                "--units",
                "ellipse,shade",
                "--out",
                &lit,
            ],
            &SMALL[..2],
        ]
        .concat(),
    );
    assert!(
        text.contains("ellipse.request") && text.contains("shade.in") && !text.contains("sort."),
        "{text}"
    );
    let alone = [
        "trace",
        "bouquet",
        "--splats",
        "5..9",
        "--units",
        "gauss,fragment",
        "--out",
        "none",
    ];
    refused(
        &[&alone, &SMALL[..2]].concat(),
        "--splats with --units fragment: these splats are sorted",
    );
    // Discs are not sorted.
    refused(
        &[
            &["trace", "checkerboard", "--units", "sort", "--out", "none"],
            &SMALL[..],
        ]
        .concat(),
        "--units sort: no such unit",
    );
}

#[test]
fn impossible_traces_and_comparisons_are_refused() {
    let out = folder();
    let inside = out.path().join("made");
    let inside = inside.to_str().unwrap();
    for (arguments, part) in [
        (
            &["--units", "gaus"][..],
            "no such unit; there are pipeline, project",
        ),
        (&["--splats", "5..5"], "the second number must be greater"),
        (&["--splats", "0..9999999"], "the scene's splats are 0.."),
        (&["--splats", "5-6"], "two whole numbers with `..`"),
        (&["--pixels", "0,0,48,3"], "the picture is 48×40"),
        (
            &["--pixels", "4,4,3,4"],
            "first column and row, last column and row",
        ),
        (&["--pixels", "1,2,3"], "four whole numbers"),
        (&["--sample", "0"], "--sample"),
        (&["--stimulus", "5", "--sample", "2"], "--sample"),
    ] {
        refused(
            &[
                &["trace", "checkerboard", "--out", inside],
                &SMALL[..],
                arguments,
            ]
            .concat(),
            part,
        );
        assert!(!Path::new(inside).exists(), "{arguments:?}");
    }
    for (arguments, part) in [
        (
            &["--waves", "0..9"][..],
            "fragments are grouped by windows, whose cycles waves do not show",
        ),
        (
            &["--splats", "5..9", "--units", "gauss,fragment"],
            "--units fragment: these fragments are grouped by windows",
        ),
    ] {
        refused(
            &[
                &[
                    "trace",
                    "checkerboard",
                    "--out",
                    inside,
                    "--machine",
                    "window",
                ],
                &SMALL[..2],
                arguments,
            ]
            .concat(),
            part,
        );
        assert!(!Path::new(inside).exists(), "{arguments:?}");
    }
    refused(&["trace", "checkerboard"], "--out");
    refused(
        &["diff", inside, "gauss.out", "x"],
        "a folder that `trace` wrote is needed",
    );
    refused(&["diff", inside, "gauss.out"], "STREAM");
    refused(
        &["diff", inside, "gauss.out", "x", "raster.out"],
        "a stream needs the file of a device's records after it",
    );
}

// ---- bad input ----

/// Status 2, one line that begins with the program's name and contains `part`, and an empty
/// standard output.
fn refused(arguments: &[&str], part: &str) {
    let output = splatsim(arguments);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {told}");
    assert_one_line(&told);
    assert!(
        told.contains(part),
        "{arguments:?}: `{part}` is absent from: {told}"
    );
    assert!(output.stdout.is_empty(), "{arguments:?}");
}

fn assert_one_line(told: &str) {
    assert!(
        told.starts_with("splatsim: ")
            && told.ends_with('\n')
            && told.lines().count() == 1
            && told.len() < 4000,
        "{told:?}"
    );
}

/// `run` with these arguments is refused, and its output folder stays empty or is not created.
fn run_refused(arguments: &[&str], part: &str) {
    let out = folder();
    let inside = out.path().join("made");
    refused(
        &[&["run"], arguments, &["--out", inside.to_str().unwrap()]].concat(),
        part,
    );
    assert!(
        !inside.exists() || names_in(&inside).is_empty(),
        "{arguments:?}: {:?}",
        names_in(&inside)
    );
}

/// `machine prove` with these arguments is refused, and does not create a folder.
fn prove_refused(machine: &str, arguments: &[&str], part: &str) {
    let out = folder();
    let inside = out.path().join("made");
    refused(
        &[
            &["machine", "prove", machine],
            arguments,
            &["--out", inside.to_str().unwrap()],
        ]
        .concat(),
        part,
    );
    assert!(!inside.exists(), "{arguments:?}");
}

#[test]
fn commands_and_flags_that_do_not_exist_are_refused() {
    refused(
        &[],
        "a command is missing: run, replay, compare, explain, stress, sweep, search, chart, view, trace, diff, unit, machine, scene, sample, tree, completions, man (see --help)",
    );
    refused(&["rnu"], "rnu");
    refused(&["sweep"], "PLAN");
    refused(&["chart"], "DIR");
    refused(&["view"], "DIR");
    refused(&["search"], "SCENE");
    refused(
        &["machine"],
        "a command is missing: list, show, timing, clock, cost, unit-costs, prove, rtl, datapath, schema (see --help)",
    );
    refused(
        &["machine", "lits"],
        "unrecognized subcommand 'lits'; a similar subcommand exists: 'list'",
    );
    run_refused(&["--sizes", "5x5"], "--size");
    run_refused(&["glass-spheres", "checkerboard"], "checkerboard");
    refused(&["explain", "glass-spheres"], "--pixel");
    refused(&["machine", "prove", "tiny"], "--out");
    refused(&["machine", "rtl", "tiny"], "--out");
    refused(&["machine", "prove", "--out", "nowhere"], "NAME|FILE");
}

#[test]
fn missing_scenes_and_machines_are_refused_with_the_existing_ones() {
    run_refused(
        &["glas-spheres"],
        "built in are glass-spheres, checkerboard, torus-knot, terrain",
    );
    run_refused(&["--machine", "leen"], "named are reference, lean, tiny");
    refused(
        &["machine", "show", "leen"],
        "named are reference, lean, tiny",
    );
    prove_refused("leen", &[], "named are reference, lean, tiny");
    refused(&["explain", "nowhere.ply", "--pixel", "1,1"], "nowhere.ply");
}

#[test]
fn impossible_sizes_pixels_and_threads_are_refused() {
    for size in [
        "0x5",
        "5x0",
        "0x0",
        "99999x1",
        "1x16385",
        "5",
        "axb",
        "5x",
        "x5",
        "5X5",
        "-5x5",
        "5x5x5",
        "18446744073709551616x1",
        "",
    ] {
        run_refused(&[&format!("--size={size}")], "size");
    }
    for threads in ["0", "-1", "many", "100000"] {
        run_refused(&[&format!("--threads={threads}")], "--threads");
    }
    for pixel in ["512,0", "0,512", "512,512"] {
        refused(
            &["explain", "glass-spheres", "--pixel", pixel],
            "512×512, so X is 0 to 511 and Y 0 to 511",
        );
    }
    for pixel in ["5", "5x5", "-1,0", "a,b", ""] {
        refused(
            &["explain", "glass-spheres", &format!("--pixel={pixel}")],
            "pixel",
        );
    }
}

#[test]
fn invalid_settings_are_refused_with_valid_ones() {
    for (setting, part) in [
        ("gauss.wieght=U0F8", "the nearest is `weight`"),
        ("guass.weight=U0F8", "the nearest is `gauss`"),
        ("gauss.weight.rounding=nearest", "`round`"),
        ("gauss.weight", "PATH=VALUE"),
        ("=3", "PATH=VALUE"),
        ("fragment.layers=three", "fragment.layers"),
        ("fragment.layers=2.5", "fragment.layers"),
        ("fragment.layers=-1", "fragment.layers"),
        (
            "fragment.layers=9",
            "fragment.layers is 9: 1 to 8 can be built",
        ),
        ("fragment.merge=nearest", "nearest-pair"),
        ("fragment.evict_hidden=yes", "fragment.evict_hidden"),
        ("gauss.weight=7", "gauss.weight"),
        ("gauss.weight=U0F0", "U0F0"),
        ("gauss.weight=I99F3", "I99F3"),
        ("gauss.weight=u0f12", "u0f12"),
        ("gauss.weight=U0F", "U0F"),
        ("gauss.weight=I0F0", "I0F0"),
        ("gauss.weight=U99999999999F1", "U99999999999F1"),
        ("gauss=5", "gauss"),
        ("gauss.weight.round=up", "nearest-even"),
        ("project.reciprocal.table_bits=40", "table_bits"),
    ] {
        run_refused(&["--set", setting], part);
        refused(&["machine", "show", "reference", "--set", setting], part);
        prove_refused("reference", &["--set", setting], part);
    }
}

#[test]
fn invalid_machine_files_are_refused_with_valid_fields() {
    let folder = folder();
    let whole: Value = serde_json::from_str(&says(&["machine", "show", "lean"])).unwrap();
    let mut lacking = whole.clone();
    lacking["gauss"].as_object_mut().unwrap().remove("falloff");
    for (name, text, part) in [
        ("empty.json", String::new(), "not JSON"),
        ("text.json", "machine".into(), "not JSON"),
        ("list.json", "[]".into(), "a machine is a JSON object"),
        ("nothing.json", "{}".into(), "name"),
        ("lacking.json", lacking.to_string(), "falloff"),
        (
            "nobase.json",
            r#"{"base": "big"}"#.into(),
            "base must be one of reference, lean, tiny",
        ),
        (
            "oddbase.json",
            r#"{"base": 5}"#.into(),
            "base must be one of reference, lean, tiny",
        ),
        (
            "misspelt.json",
            r#"{"base": "lean", "raster": {"radail": "I9F9"}}"#.into(),
            "the nearest is `radial`",
        ),
        (
            "unit.json",
            r#"{"base": "lean", "rastre": {}}"#.into(),
            "the nearest is `raster`",
        ),
        (
            "kind.json",
            r#"{"base": "lean", "fragment": {"layers": "3"}}"#.into(),
            "fragment.layers",
        ),
        (
            "format.json",
            r#"{"base": "lean", "gauss": {"weight": "i1f3"}}"#.into(),
            "i1f3",
        ),
        (
            "null.json",
            r#"{"base": "lean", "gauss": null}"#.into(),
            "gauss",
        ),
    ] {
        let file = write(&folder, name, &text);
        run_refused(&["--machine", &file], part);
        run_refused(&["--machine", &file], &format!("splatsim: {file}: "));
    }
    let latin = folder.path().join("latin.json");
    std::fs::write(&latin, b"{\"name\": \"caf\xe9\"}").unwrap();
    run_refused(&["--machine", latin.to_str().unwrap()], "cannot be read");
    run_refused(
        &["--machine", folder.path().to_str().unwrap()],
        "cannot be read",
    );
}

#[test]
fn a_machine_that_cannot_be_elaborated_is_refused_with_all_its_errors() {
    let folder = folder();
    let text = r#"{"base": "reference", "fragment": {"layers": 12}, "splat": {"rgb": "U0F8", "position": "U1F20"}, "project": {"camera": "I20F26"}}"#;
    let file = write(&folder, "misfit.json", text);
    for part in [
        "fragment.layers is 12",
        "splat.rgb is U0F8",
        "splat.position is U1F20",
        "project.camera is I20F26",
    ] {
        run_refused(&["--machine", &file], part);
    }
}

#[test]
fn squares_that_no_word_holds_are_refused() {
    for machine in ["gaussian", "reference"] {
        let wide = [
            "--set",
            "raster.rows=direct",
            "--set",
            "raster.offset=I16F16",
        ];
        let arguments = [&["--machine", machine][..], &wide].concat();
        run_refused(&arguments, "raster.square is left out, but exact squares");
    }
    run_refused(
        &[
            "bouquet",
            "--machine",
            "cubed",
            "--set",
            "raster.square=null",
            "--set",
            "raster.offset=I20F20",
        ],
        "raster.square is left out, but exact squares",
    );
}

#[test]
fn output_folders_that_cannot_be_written_are_refused() {
    let folder = folder();
    let file = write(&folder, "file", "mine");
    for out in [
        file.clone(),
        format!("{file}/below"),
        format!("{file}/below/it"),
        "/proc/nonexistent".into(),
    ] {
        refused(
            &["run", "--machine", "tiny", "--size", "16x16", "--out", &out],
            &format!("--out {out}: cannot be written"),
        );
        refused(
            &["machine", "prove", "tiny", "--out", &out],
            &format!("--out {out}: cannot be written"),
        );
    }
    assert_eq!(std::fs::read_to_string(file).unwrap(), "mine");
}

#[test]
fn invalid_scenes_are_refused_with_valid_fields() {
    let folder = folder();
    let header = "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    write(&folder, "none.ply", header);
    write(&folder, "empty.ply", "");
    for (name, text, part) in [
        ("text.json", "splats", "not JSON"),
        ("cut.json", r#"{"splats": {"builtin": "#, "not JSON"),
        ("bare.json", "{}", "splats"),
        ("list.json", "[]", "list.json"),
        (
            "field.json",
            r#"{"splats": {"builtin": "terrain"}, "camra": {}}"#,
            "the nearest is `camera`",
        ),
        (
            "deep.json",
            r#"{"splats": {"builtin": "terrain"}, "camera": {"fov_y_degree": 3}}"#,
            "the nearest is `fov_y_degrees`",
        ),
        (
            "name.json",
            r#"{"splats": {"builtin": "torus"}}"#,
            "torus-knot",
        ),
        (
            "kind.json",
            r#"{"splats": {"builtin": "terrain"}, "image": {"width": "5"}}"#,
            "image.width",
        ),
        (
            "width.json",
            r#"{"splats": {"builtin": "terrain"}, "image": {"width": 0}}"#,
            "image.width",
        ),
        (
            "radius.json",
            r#"{"splats": [{"position": [0, 0, 0], "radius": -1}]}"#,
            "radius",
        ),
        ("nosplat.json", r#"{"splats": []}"#, "splat"),
        (
            "nofile.json",
            r#"{"splats": {"file": "absent.ply"}}"#,
            "absent.ply: cannot be read",
        ),
        (
            "nopoints.json",
            r#"{"splats": {"file": "none.ply"}}"#,
            "nopoints.json: holds no splats",
        ),
    ] {
        let file = write(&folder, name, text);
        run_refused(&[&file], part);
        refused(&["explain", &file, "--pixel", "0,0"], part);
    }
    for name in ["none.ply", "empty.ply"] {
        let file = folder.path().join(name);
        run_refused(&[file.to_str().unwrap()], name);
    }
}

/// Address space allowed for an odd file, KiB. The kernel cannot limit resident memory, so
/// addresses are limited, which are always more: the program, its libraries, stacks and arenas of
/// two threads take about half of this before a file is opened.
const ADDRESSES_KIB: u32 = 400_000;

/// Processor time allowed for it, seconds. A tenth of this is enough, but a computer may be slow or
/// busy.
const SECONDS: u32 = 10;

fn run_capped(file: &Path, out: &Path) -> Output {
    let script = format!("ulimit -v {ADDRESSES_KIB}; ulimit -t {SECONDS}; exec \"$@\"");
    let mut command = Command::new("sh");
    command
        .args(["-c", &script, "sh", PROGRAM.as_str(), "run"])
        .arg(file)
        .args(["--size", "64x64", "--threads", "2", "--out"])
        .arg(out);
    command.timeout(Duration::from_secs(120)).output().unwrap()
}

#[test]
fn every_odd_or_broken_ply_ends_in_a_picture_or_a_sentence_in_little_time_and_memory() {
    // The files of the second folder have properties other than positions, so none of them is a
    // cloud.
    for (name, readable) in [("malformed/ply", 40), ("malformed/ply_plyodine", 0)] {
        let Some(input) = shared_input::find(name) else {
            return;
        };
        let mut files: Vec<PathBuf> = std::fs::read_dir(input)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .collect();
        files.sort();
        let all = files.len();
        files = files
            .into_iter()
            .enumerate()
            .filter(|(number, _)| tier::has([3, 1], *number))
            .map(|(_, file)| file)
            .collect();
        let mut drawn = 0;
        for file in &files {
            let out = folder();
            let output = run_capped(file, out.path());
            let told = String::from_utf8(output.stderr).unwrap();
            match output.status.code() {
                Some(0) => {
                    assert_eq!(
                        (told.as_str(), names_in(out.path()).len()),
                        ("", WRITTEN.len()),
                        "{file:?}"
                    );
                    drawn += 1;
                }
                Some(2) => {
                    assert_one_line(&told);
                    assert!(
                        told.contains(file.file_name().unwrap().to_str().unwrap()),
                        "{told}"
                    );
                    assert!(names_in(out.path()).is_empty(), "{file:?}");
                }
                other => panic!("{file:?}: status {other:?}: {told}"),
            }
        }
        println!("{name}: {drawn} of {} drawn", files.len());
        let least = readable * files.len() / all * 4 / 5;
        assert!(
            all >= 49 && drawn >= least && drawn < files.len(),
            "{name}: {drawn} of {}",
            files.len()
        );
    }
}

#[test]
fn every_odd_or_broken_volume_or_set_of_gaussians_ends_in_a_picture_or_a_sentence() {
    let Some(input) = shared_input::find("malformed/nrrd") else {
        return;
    };
    let mut files: Vec<PathBuf> = std::fs::read_dir(input)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    files.extend(
        ["ply", "splat", "spz"]
            .iter()
            .filter_map(|end| shared_input::find(&format!("splats3d/train_3points.{end}"))),
    );
    let mut drawn = Vec::new();
    for file in &files {
        let out = folder();
        let output = run_capped(file, out.path());
        let told = String::from_utf8(output.stderr).unwrap();
        let name = file.file_name().unwrap().to_str().unwrap();
        match output.status.code() {
            Some(0) => drawn.push(name),
            Some(2) => {
                assert_one_line(&told);
                assert!(told.contains(name), "{told}");
                assert!(names_in(out.path()).is_empty(), "{file:?}");
            }
            other => panic!("{file:?}: status {other:?}: {told}"),
        }
    }
    // Files with a three-dimensional field, and files of Gaussians.
    assert_eq!(drawn.len(), 10, "{drawn:?}");
}

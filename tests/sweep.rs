//! Does a sweep have the figures of single runs, and no row twice, however often it is killed?

use crate::program::PROGRAM;
use assert_cmd::Command;
use rtl_model::num::Format;
use serde_json::{Value, json};
use splatsim::explore::sweep::plan::Points;
use splatsim::explore::sweep::stage::Stage;
use splatsim::explore::sweep::{Shard, Sweep, SweepOptions};
use splatsim::output::files::Folder;
use splatsim::performance::cost::Prices;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Output, Stdio};
use std::time::Duration;

fn splatsim() -> Command {
    Command::new(PROGRAM.as_str())
}

fn written(folder: &Path, plan: &Value) -> String {
    for name in ["terrain", "torus-knot"] {
        let scene = json!({"splats": {"builtin": name, "count": 3000}});
        fs::write(folder.join(format!("{name}.json")), scene.to_string()).unwrap();
    }
    let path = folder.join("plan.json");
    fs::write(&path, plan.to_string()).unwrap();
    path.to_str().unwrap().to_owned()
}

/// A few machines, small pictures.
fn plan() -> Value {
    json!({"scenes": ["terrain.json", "torus-knot.json"], "size": [24, 16], "machine": "tiny", "order": "one-at-a-time", "axes": [
        {"field": "gauss.weight", "add_frac_bits": [-2, -1, 1, 2]},
        {"field": "fragment.layers", "values": [1, 2, 4]},
        {"field": "timing.raster.lanes", "values": [[1, 1], [2, 2], [8, 1]]},
        {"field": "project.camera", "values": ["U2F8"]}]})
}

fn sweep(plan: &str, out: &Path, more: &[&str]) -> Output {
    splatsim()
        .args(["sweep", plan, "--out", out.to_str().unwrap()])
        .args(more)
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
    assert_eq!(output.status.code(), Some(2), "{told}");
    assert_eq!(told.trim_end().lines().count(), 1, "{told}");
    told
}

/// Rows by column, without the host times, which differ from run to run.
fn rows(out: &Path) -> Vec<BTreeMap<String, String>> {
    let text = fs::read_to_string(out.join("sweep.csv")).unwrap();
    let mut lines = text.lines().map(cells);
    let header = lines.next().unwrap();
    lines
        .map(|line| {
            assert_eq!(line.len(), header.len());
            header
                .iter()
                .cloned()
                .zip(line)
                .filter(|(name, _)| !name.starts_with("host_"))
                .collect()
        })
        .collect()
}

fn cells(line: &str) -> Vec<String> {
    let mut cells = vec![String::new()];
    let mut quoted = false;
    for letter in line.chars() {
        match letter {
            '"' => quoted = !quoted,
            ',' if !quoted => cells.push(String::new()),
            _ => cells.last_mut().unwrap().push(letter),
        }
    }
    cells
}

/// The best row has the largest fixed − ideal of all; each figure is below its name.
fn summary_is_labelled(told: &str, rows: &[BTreeMap<String, String>]) {
    let lines: Vec<&str> = told.lines().collect();
    let head = lines
        .iter()
        .position(|line| line.contains("fixed − ideal"))
        .unwrap();
    assert_eq!(
        lines[head]
            .split("  ")
            .filter(|name| !name.trim().is_empty())
            .map(str::trim)
            .collect::<Vec<_>>()[..4],
        ["dB", "fixed − ideal", "fixed − golden", "on covered",]
    );
    let number = |row: &&BTreeMap<String, String>| {
        row["fixed_vs_ideal_psnr_db"]
            .parse::<f64>()
            .unwrap_or(f64::NEG_INFINITY)
    };
    let best = rows
        .iter()
        .max_by(|a, b| number(a).total_cmp(&number(b)))
        .unwrap();
    let shown = ["fixed_vs_ideal_psnr_db", "psnr_db", "psnr_covered_db"]
        .map(|name| format!("{:.1}", best[name].parse::<f64>().unwrap()));
    let line = lines.iter().find(|line| line.starts_with("best ")).unwrap();
    assert_eq!(
        line.split_whitespace().skip(1).take(3).collect::<Vec<_>>(),
        shown,
        "{told}"
    );
}

/// A machine that cannot be built, at the beginning of points that share a frame, does not keep the
/// others from being drawn.
#[test]
fn a_first_point_that_cannot_be_built_leaves_the_others_alone() {
    let folder = tempfile::tempdir().unwrap();
    let plan = json!({"scenes": ["torus-knot.json"], "size": [24, 16], "machine": "tiny", "axes": [
        {"field": "timing.clock_hz", "values": [1_000_000_000_000_u64, 50_000_000]}]});
    let out = folder.path().join("out");
    ok(&sweep(&written(folder.path(), &plan), &out, &[]));
    let rows = rows(&out);
    let misfits: Vec<&str> = rows.iter().map(|row| row["misfit"].as_str()).collect();
    let [first, second] = misfits[..] else {
        panic!("{misfits:?}");
    };
    assert!(
        first.contains("timing.clock_hz") && second.is_empty(),
        "{misfits:?}"
    );
    assert!(rows[1]["cycles"].parse::<u64>().unwrap() > 0, "{rows:?}");
}

/// Tests of tiles and kinds of sort do not change a picture, so their points share a frame. Each
/// has the cycles of a run of its own.
#[test]
fn points_that_differ_only_in_their_lists_share_a_frame() {
    let folder = tempfile::tempdir().unwrap();
    let scene = json!({"splats": {"gaussians": "city", "count": 800}, "camera": {"eye": [0, 0.3, 3.95], "target": [0, 0.32, 0]}});
    fs::write(folder.path().join("city.json"), scene.to_string()).unwrap();
    let changes = [
        ("bin.subtile_px", json!([8])),
        ("sort.kind", json!(["hierarchical", "tile"])),
        ("bin.test", json!(["ellipse", "oriented-box"])),
        ("timing.clock_hz", json!([1_000_000_000_000_u64])),
    ];
    let axes = changes
        .each_ref()
        .map(|(field, value)| json!({"field": field, "values": value}));
    let plan = json!({"scenes": ["city.json"], "size": [48, 32], "machine": "gaussian", "order": "one-at-a-time", "axes": axes});
    let (path, out) = (folder.path().join("plan.json"), folder.path().join("out"));
    fs::write(&path, plan.to_string()).unwrap();
    ok(&sweep(path.to_str().unwrap(), &out, &[]));
    let rows = rows(&out);
    let mut cycles = Vec::new();
    for row in &rows {
        let changed = row["changes"].as_str();
        if changed.starts_with("bin.subtile_px") || changed.starts_with("timing.clock_hz") {
            let reason = changed.split('=').next().unwrap();
            assert!(row["misfit"].contains(reason), "{row:?}");
            continue;
        }
        assert_eq!(row["misfit"], "", "{row:?}");
        let run_out = folder.path().join("run");
        let settings = (changed.split(' ').filter(|change| !change.is_empty()))
            .flat_map(|change| ["--set", change]);
        let scene = folder.path().join("city.json");
        let run = splatsim()
            .args(["run", scene.to_str().unwrap(), "--machine", "gaussian"])
            .args(["--size", "48x32", "--out", run_out.to_str().unwrap()])
            .args(settings)
            .output()
            .unwrap();
        ok(&run);
        let report = fs::read_to_string(run_out.join("report.json")).unwrap();
        let report: Value = serde_json::from_str(&report).unwrap();
        for (column, pointer) in [
            ("cycles", "/cycles/total"),
            ("memory_bytes", "/cycles/memory/bytes"),
            ("bottleneck", "/cycles/bottleneck"),
            ("area", "/cost/area"),
            ("psnr_db", "/accuracy/fixed_vs_golden/psnr_db"),
        ] {
            let said = report.pointer(pointer).unwrap();
            let said = said
                .as_str()
                .map_or_else(|| said.to_string(), str::to_owned);
            assert_eq!(row[column], said, "{column} of {changed}");
        }
        cycles.push(row["cycles"].clone());
    }
    assert_eq!(cycles.len(), 5, "{rows:?}");
    cycles.sort_unstable();
    cycles.dedup();
    assert!(
        cycles.len() >= 4,
        "the lists make no difference: {cycles:?}"
    );
}

#[test]
fn a_row_says_what_a_run_says() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let told = ok(&sweep(&written(folder.path(), &plan()), &out, &[]));
    assert!(
        told.starts_with("24 points: 24 drawn now, 0 known before; 2 cannot be built"),
        "{told}"
    );
    assert!(
        told.lines().all(|line| line.chars().count() <= 80),
        "{told}"
    );
    let rows = rows(&out);
    summary_is_labelled(&told, &rows);
    assert_eq!(
        rows.iter()
            .map(|row| row["point"].parse::<u64>().unwrap())
            .collect::<Vec<_>>(),
        (0..24).collect::<Vec<_>>()
    );
    for number in [0, 3, 6, 9, 15] {
        let row = &rows[number];
        let run_out = folder.path().join(format!("run-{number}"));
        let settings = row["changes"]
            .split(' ')
            .filter(|change| !change.is_empty())
            .flat_map(|change| ["--set", change]);
        let run = splatsim()
            .args([
                "run",
                folder.path().join(&row["scene"]).to_str().unwrap(),
                "--machine",
                "tiny",
                "--size",
                "24x16",
                "--out",
                run_out.to_str().unwrap(),
            ])
            .args(settings)
            .output()
            .unwrap();
        ok(&run);
        let report: Value =
            serde_json::from_str(&fs::read_to_string(run_out.join("report.json")).unwrap())
                .unwrap();
        for (column, pointer) in [
            ("psnr_db", "/accuracy/fixed_vs_golden/psnr_db"),
            (
                "psnr_covered_db",
                "/accuracy/fixed_vs_golden/psnr_covered_db",
            ),
            ("ssim", "/accuracy/fixed_vs_golden/ssim"),
            ("max_error", "/accuracy/fixed_vs_golden/max_error"),
            ("mean_error", "/accuracy/fixed_vs_golden/mean_error"),
            (
                "pixels_over_1_255",
                "/accuracy/fixed_vs_golden/pixels_over_1_255",
            ),
            (
                "golden_vs_ideal_psnr_db",
                "/accuracy/golden_vs_ideal/psnr_db",
            ),
            ("fixed_vs_ideal_psnr_db", "/accuracy/fixed_vs_ideal/psnr_db"),
            ("raster_busy", "/cycles/units/5/busy"),
            ("fragment_starved", "/cycles/units/7/starved"),
            ("list_memory", "/cycles/units/4/memory"),
            ("shade_blocked", "/cycles/units/8/blocked"),
            ("lockstep_psnr_db", "/accuracy/lockstep/psnr_db"),
            ("decision_flips", "/accuracy/lockstep/decision_flips"),
            ("bound_violations", "/accuracy/lockstep/bound_violations"),
            ("contributions", "/scene/fragments"),
            ("merged", "/fragments/merged"),
            ("evicted", "/fragments/evicted"),
            ("cycles", "/cycles/total"),
            ("frames_per_second", "/cycles/frames_per_second"),
            ("bottleneck", "/cycles/bottleneck"),
            ("memory_bytes", "/cycles/memory/bytes"),
            ("area", "/cost/area"),
            ("energy_j", "/cost/energy/total"),
            ("fragment_bits", "/machine/fragment_bits"),
            ("widest_operand_bits", "/machine/widest_operand_bits"),
        ] {
            let said = report
                .pointer(pointer)
                .unwrap_or_else(|| panic!("no {pointer}"));
            let said = said
                .as_str()
                .map_or_else(|| said.to_string(), str::to_owned);
            assert_eq!(
                row[column],
                if said == "null" { String::new() } else { said },
                "{column} of point {number}"
            );
        }
        let signals = report["signals"].as_array().unwrap();
        let wrapped: u64 = signals
            .iter()
            .map(|signal| signal["wrapped"].as_u64().unwrap())
            .sum();
        assert_eq!(row["wrapped"], wrapped.to_string());
    }
    // The line is wrapped.
    let words: Vec<&str> = told.split_whitespace().collect();
    assert!(
        words.join(" ").contains("the first reason: machine"),
        "{told}"
    );
    let misfit = &rows[11];
    assert!(
        misfit["misfit"].contains("project.camera")
            && misfit["psnr_db"].is_empty()
            && misfit["cycles"].is_empty(),
        "{misfit:?}"
    );
    assert_eq!(rows[5]["fragment.layers"], "1");
    assert_eq!(
        (
            rows[0]["fragment.layers"].as_str(),
            rows[10]["timing.raster.lanes"].as_str()
        ),
        ("3", "[8,1]")
    );
}

#[test]
fn parts_are_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let plan = written(folder.path(), &plan());
    let [whole, parts] = ["whole", "parts"].map(|name| folder.path().join(name));
    ok(&sweep(&plan, &whole, &["--threads", "1"]));
    for part in ["3/3", "1/3", "2/3"] {
        let told = ok(&sweep(&plan, &parts, &["--shard", part]));
        assert!(told.contains("8 of this part: 8 drawn now"), "{told}");
    }
    assert_eq!(rows(&whole), rows(&parts));
    let told = ok(&sweep(&plan, &parts, &[]));
    assert!(
        told.starts_with("24 points: 0 drawn now, 24 known before"),
        "{told}"
    );
    assert_eq!(rows(&whole), rows(&parts));
}

#[test]
fn a_sweep_that_is_killed_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let plan = written(folder.path(), &plan());
    let [whole, killed] = ["whole", "killed"].map(|name| folder.path().join(name));
    ok(&sweep(&plan, &whole, &[]));
    let journal = killed.join("points.jsonl");
    let mut wait_ms = 5;
    let mut kept = 0;
    for _ in 0..20 {
        let mut child = std::process::Command::new(PROGRAM.as_str())
            .args(["sweep", &plan, "--out", killed.to_str().unwrap()])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        // Some are killed between rows, some soon after the start; none is waited for.
        wait_ms = wait_ms * 7 % 240;
        std::thread::sleep(Duration::from_millis(wait_ms));
        let _ = child.kill();
        child.wait().unwrap();
        let text = fs::read_to_string(&journal).unwrap_or_default();
        let whole_rows = text.matches('\n').count().saturating_sub(1);
        assert!(
            whole_rows >= kept,
            "rows were lost: {kept}, then {whole_rows}"
        );
        kept = whole_rows;
    }
    ok(&sweep(&plan, &killed, &[]));
    assert_eq!(rows(&whole), rows(&killed));
    let text = fs::read_to_string(&journal).unwrap();
    assert_eq!(text.lines().count(), 1 + 24, "a row was drawn twice");
}

#[test]
fn a_line_cut_short_is_drawn_again_and_a_changed_one_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let plan_file = written(folder.path(), &plan());
    let out = folder.path().join("out");
    ok(&sweep(&plan_file, &out, &[]));
    let before = rows(&out);
    let journal = out.join("points.jsonl");
    let text = fs::read_to_string(&journal).unwrap();
    fs::write(&journal, &text[..text.len() - 10]).unwrap();
    let told = ok(&sweep(&plan_file, &out, &[]));
    assert!(
        told.starts_with("24 points: 1 drawn now, 23 known before"),
        "{told}"
    );
    assert_eq!(rows(&out), before);

    let lines: Vec<&str> = text.lines().collect();
    let changed = |line: usize, new: &str| {
        let mut lines = lines.clone();
        lines[line] = new;
        fs::write(&journal, lines.join("\n") + "\n").unwrap();
        refused(&sweep(&plan_file, &out, &[]))
    };
    assert!(changed(0, "[]").contains("another version; choose another folder"));
    assert!(changed(2, "nothing").contains("line 3: is not as it was written"));
    assert!(
        changed(2, &lines[2].replace("terrain", "terrace"))
            .contains("line 3: is not as it was written")
    );
    fs::write(&journal, &text).unwrap();

    // Another scene size, and another number of points: rows of another plan.
    let other = written(
        folder.path(),
        &json!({"size": [16, 16], "scenes": plan()["scenes"], "machine": "tiny", "order": "one-at-a-time",
        "axes": plan()["axes"]}),
    );
    assert!(refused(&sweep(&other, &out, &[])).contains("choose another folder"));
    let fewer = written(
        folder.path(),
        &json!({"size": [24, 16], "scenes": ["terrain.json"], "machine": "tiny", "order": "one-at-a-time",
        "axes": plan()["axes"]}),
    );
    assert!(refused(&sweep(&fewer, &out, &[])).contains("it is of another plan"));
}

#[test]
fn a_billion_points_are_refused_with_their_count() {
    let folder = tempfile::tempdir().unwrap();
    let range = |field: &str| json!({"field": field, "range": [1, 1000, 1]});
    let plan = json!({"scenes": ["terrain"], "axes": [
        range("timing.raster.fifo"), range("timing.gauss.fifo"), range("timing.fetch.fifo")]});
    let told = refused(&sweep(
        &written(folder.path(), &plan),
        &folder.path().join("out"),
        &[],
    ));
    assert!(
        told.contains("1,000,000,000 points") && told.contains("--most 1000000000"),
        "{told}"
    );
    assert!(
        !folder.path().join("out").exists(),
        "a refused plan leaves a folder"
    );
    for (arguments, says) in [
        (
            vec!["sweep", "no-such-plan"],
            "built-in are precision, precision-in-lockstep, curves, architecture, layers, clock",
        ),
        (
            vec!["sweep", "precision", "--shard", "3/2"],
            "I from 1 to N",
        ),
        (
            vec!["sweep", "precision", "--shard", "0/2"],
            "I from 1 to N",
        ),
    ] {
        let told = refused(
            &splatsim()
                .args(&arguments)
                .current_dir(folder.path())
                .output()
                .unwrap(),
        );
        assert!(told.contains(says), "{told}");
    }
}

/// A pan of three frames, written into a folder.
fn pan(folder: &Path, pan_pixels: f64) -> String {
    let camera = json!({"eye": [0.0, 0.0, 4.5], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 45, "near": 0.05});
    let scene = json!({"splats": {"builtin": "torus-knot", "count": 20_000}, "image": {"width": 40, "height": 30},
        "camera_path": {"pan_pixels": pan_pixels, "frames": 3, "camera": camera}});
    let path = folder.join("pan.json");
    fs::write(&path, scene.to_string()).unwrap();
    path.to_str().unwrap().to_owned()
}

/// Of machines, and of one with mixed precision against golden; only consecutive cameras are
/// compared.
#[test]
fn a_row_flickers_as_the_run_does() {
    let folder = tempfile::tempdir().unwrap();
    let scene = pan(folder.path(), 0.0625);
    let axes = json!([{"field": "gauss.weight", "add_frac_bits": [-2, 2]}, {"field": "exact", "values": [["gauss"]]}]);
    let plan = json!({"scenes": ["pan.json"], "machine": "tiny", "order": "one-at-a-time", "lockstep": false, "flicker": 3, "axes": axes});
    let (plan, out) = (written(folder.path(), &plan), folder.path().join("out"));
    ok(&sweep(&plan, &out, &[]));
    let rows = rows(&out);
    assert_eq!(rows.len(), 4);
    for row in &rows[..3] {
        let run_out = folder.path().join(format!("run-{}", row["point"]));
        let settings = row["changes"]
            .split(' ')
            .filter(|change| !change.is_empty())
            .flat_map(|change| ["--set", change]);
        let arguments = [
            "run",
            &scene,
            "--machine",
            "tiny",
            "--out",
            run_out.to_str().unwrap(),
        ];
        ok(&splatsim()
            .args(arguments.into_iter().chain(settings))
            .output()
            .unwrap());
        let report: Value =
            serde_json::from_str(&fs::read_to_string(run_out.join("report.json")).unwrap())
                .unwrap();
        let flicker = &report["flicker"];
        assert!(
            flicker["fixed_vs_golden"]["jumps"].as_f64().unwrap() > 0.0,
            "{flicker}"
        );
        for (column, part) in [
            ("", "fixed_vs_golden"),
            ("golden_vs_ideal_", "golden_vs_ideal"),
            ("fixed_vs_ideal_", "fixed_vs_ideal"),
        ] {
            for figure in ["mean", "jumps"] {
                assert_eq!(
                    row[&format!("{column}flicker_{figure}")],
                    flicker[part][figure].to_string(),
                    "{column} {figure} of {row:?}"
                );
            }
        }
    }
    let mean = |row: &BTreeMap<String, String>| row["flicker_mean"].parse::<f64>().unwrap();
    assert!(
        mean(&rows[3]) != mean(&rows[0]) && mean(&rows[3]) > 0.0 && rows[3]["cycles"].is_empty(),
        "{:?}",
        rows[3]
    );

    pan(folder.path(), 0.125);
    let told = refused(&sweep(&plan, &out, &[]));
    assert!(
        told.contains("was drawn from something else than now"),
        "{told}"
    );
    for (scene, frames, says) in [
        (
            "pan.json",
            4,
            "flicker: pan.json: 4 frames are asked for, and it has 3",
        ),
        (
            "terrain",
            2,
            "flicker: terrain: 2 frames are asked for, and it has 1",
        ),
        (
            "nested-shells",
            2,
            "flicker: nested-shells: frames of volumes, Gaussians and trees are not swept",
        ),
        ("pan.json", 1, "flicker is 1; it must be at least 2"),
        (
            "pan.json",
            33,
            "flicker is 33; it must be at least 2 and at most 32",
        ),
    ] {
        let plan = json!({"scenes": [scene], "size": [24, 16], "axes": [], "flicker": frames});
        let told = refused(&sweep(
            &written(folder.path(), &plan),
            &folder.path().join("none"),
            &[],
        ));
        assert!(
            told.contains(says) && !folder.path().join("none").exists(),
            "{told}"
        );
    }
}

/// With nothing exact it is the machine, with everything exact it is golden; in between it has the
/// figures of `run --attribute`.
#[test]
fn units_and_words_can_be_exact() {
    let folder = tempfile::tempdir().unwrap();
    let units = json!([
        "splat", "project", "ellipse", "raster", "gauss", "fragment", "shade", "resolve"
    ]);
    let axes = json!([{"field": "exact", "values": [[], units, ["raster"], ["splat.rgb"]]}]);
    let plan = json!({"scenes": ["terrain.json"], "size": [24, 16], "machine": "tiny", "axes": axes, "lockstep": false});
    let out = folder.path().join("out");
    ok(&sweep(&written(folder.path(), &plan), &out, &[]));
    let rows = rows(&out);
    let run_out = folder.path().join("run");
    let scene = folder.path().join("terrain.json");
    let arguments = [
        "run",
        scene.to_str().unwrap(),
        "--machine",
        "tiny",
        "--size",
        "24x16",
        "--attribute",
        "--out",
        run_out.to_str().unwrap(),
    ];
    ok(&splatsim().args(arguments).output().unwrap());
    let report: Value =
        serde_json::from_str(&fs::read_to_string(run_out.join("report.json")).unwrap()).unwrap();
    assert_eq!(
        rows[0]["psnr_db"],
        report["accuracy"]["fixed_vs_golden"]["psnr_db"].to_string()
    );
    assert_eq!(rows[0]["cycles"], report["cycles"]["total"].to_string());
    let golden = &rows[1]["psnr_db"];
    assert!(
        golden.is_empty() || golden.parse::<f64>().unwrap() > 200.0,
        "{golden}"
    );
    let without = |part: &str, name: &str| {
        let all = report["attribution"][part].as_array().unwrap();
        let found = all.iter().find(|other| other["name"] == name).unwrap();
        found["without"]["psnr_covered_db"].to_string()
    };
    assert_eq!(rows[2]["psnr_covered_db"], without("units", "raster"));
    assert_eq!(rows[3]["psnr_covered_db"], without("words", "splat.rgb"));
    assert!(
        rows[1..].iter().all(|row| row["cycles"].is_empty()
            && row["area"].is_empty()
            && row["misfit"].is_empty())
    );
}

#[test]
fn the_columnar_file_equals_the_csv() {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let plan = json!({"scenes": ["terrain.json"], "size": [24, 16], "lockstep": false, "axes": [
        {"field": "timing.raster.fifo", "values": [4, 16]}, {"field": "timing.raster.lanes", "values": [[1, 1], [4, 1]]},
        {"field": "timing.project.multipliers", "values": [8, null]}, {"field": "gauss.weight", "values": ["U0F8"]}]});
    ok(&sweep(&written(folder.path(), &plan), &out, &[]));
    let reader =
        SerializedFileReader::new(fs::File::open(out.join("sweep.parquet")).unwrap()).unwrap();
    let columnar: Vec<_> = reader
        .get_row_iter(None)
        .unwrap()
        .map(Result::unwrap)
        .collect();
    let rows = rows(&out);
    assert_eq!(columnar.len(), rows.len());
    for (columnar, row) in columnar.iter().zip(&rows) {
        let columnar: BTreeMap<&String, &Field> = columnar.get_column_iter().collect();
        assert_eq!(
            columnar.len(),
            row.len() + 4,
            "host times are left out of the rows alone"
        );
        for (name, cell) in row {
            match columnar[name] {
                Field::Null => assert_eq!(cell, "", "{name}"),
                Field::Str(text) => assert_eq!(cell, text, "{name}"),
                Field::Long(number) => assert_eq!(cell, &number.to_string(), "{name}"),
                Field::Double(number) => {
                    assert_eq!(cell.parse::<f64>().unwrap(), *number, "{name}")
                }
                other => panic!("{name}: {other:?}"),
            }
        }
        // Swept numbers are numbers in the file.
        let [fifo, lanes, multipliers, weight] = [
            "timing.raster.fifo",
            "timing.raster.lanes",
            "timing.project.multipliers",
            "gauss.weight",
        ]
        .map(|name| columnar[&name.to_owned()]);
        assert!(
            matches!(fifo, Field::Long(4 | 16))
                && matches!(multipliers, Field::Long(8) | Field::Null),
            "{fifo} {multipliers}"
        );
        assert!(
            matches!((lanes, weight), (Field::Str(_), Field::Str(_))),
            "{lanes} {weight}"
        );
    }
}

/// Two words change together, each by its own bits; the first that loses a decibel is reported.
#[test]
fn words_can_change_together_and_the_first_that_loses_a_decibel_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let bits = json!([-12, -11, -10, -9, -8, -7, -6, -5, -4, -3, -2, -1]);
    let plan = json!({"scenes": ["terrain.json"], "size": [24, 16], "machine": "reference", "order": "one-at-a-time", "lockstep": false, "axes": [
        {"fields": ["ellipse.conic", "ellipse.conic_cross"], "add_frac_bits": bits}, {"field": "gauss.weight", "add_frac_bits": [-3, -1]}]});
    let out = folder.path().join("out");
    let told = ok(&sweep(&written(folder.path(), &plan), &out, &[]));
    let rows = rows(&out);
    assert_eq!(rows.len(), 15);
    let base = rtl_model::Machine::named("reference").unwrap().ellipse;
    for (row, less) in rows[1..13].iter().zip((1..=12).rev()) {
        let [conic, cross] = [base.conic, base.conic_cross].map(|word| {
            Format {
                frac_bits: word.format.frac_bits - less,
                ..word.format
            }
            .to_string()
        });
        assert_eq!(
            row["changes"],
            format!("ellipse.conic={conic} ellipse.conic_cross={cross}")
        );
        assert_eq!(
            [&row["ellipse.conic"], &row["ellipse.conic_cross"]],
            [&conic, &cross]
        );
    }
    // Worked out by hand: the fewest removed bits that lose a decibel.
    let db =
        |row: &BTreeMap<String, String>| row["psnr_db"].parse::<f64>().unwrap_or(f64::INFINITY);
    let whole = db(&rows[0]);
    let together = (1..=12)
        .filter(|less| whole - db(&rows[13 - less]) >= 1.0)
        .min();
    let weight = [(3, 13), (1, 14)]
        .into_iter()
        .filter(|(_, row)| whole - db(&rows[*row]) >= 1.0)
        .map(|(less, _)| less)
        .min();
    let least = together
        .into_iter()
        .chain(weight)
        .min()
        .expect("twelve bits are lost without a decibel");
    let line = told.replace("\n    ", " ");
    let bits = if least == 1 {
        "1 bit less".to_owned()
    } else {
        format!("{least} bits less")
    };
    assert!(
        line.contains(&format!("with {bits}, ")) && line.contains("first to lose 1 dB: "),
        "{least}: {told}"
    );
    assert!(
        told.lines().all(|line| line.chars().count() <= 80),
        "{told}"
    );
    let both = |more: Value| {
        let mut plan = plan.clone();
        plan["axes"] = json!([more]);
        refused(&sweep(
            &written(folder.path(), &plan),
            &folder.path().join("none"),
            &[],
        ))
    };
    assert!(
        both(json!({"field": "gauss.weight", "fields": ["gauss.weight"], "add_frac_bits": [1]}))
            .contains("has `field` and `fields`")
    );
    assert!(
        both(json!({"fields": ["gauss.weight", "gauss.weight"], "add_frac_bits": [1]}))
            .contains("fields has gauss.weight twice")
    );
    assert!(
        both(json!({"fields": ["gauss.wait"], "add_frac_bits": [1]})).contains("is not a word")
    );
    assert!(
        both(json!({"fields": ["*"], "add_frac_bits": [1]}))
            .contains("change with nothing together")
    );
    assert!(both(json!({"add_frac_bits": [1]})).contains("needs a `field`"));
}

/// A folder keeps rows of one plan on unchanged scenes, also if shards drew them.
#[test]
fn parts_of_two_plans_do_not_become_one_table() {
    let folder = tempfile::tempdir().unwrap();
    let axis = |values: &[u32]| json!({"field": "timing.raster.fifo", "values": values});
    let plan = |values: &[u32]| json!({"scenes": ["terrain.json"], "size": [8, 6], "machine": "tiny", "lockstep": false, "axes": [axis(values)]});
    let out = folder.path().join("out");
    let first = written(folder.path(), &plan(&[1, 2, 3, 4]));
    ok(&sweep(&first, &out, &["--shard", "1/2"]));
    let other = written(folder.path(), &plan(&[10, 20, 30, 40]));
    let before = fs::read(out.join("plan.json")).unwrap();
    assert!(
        refused(&sweep(&other, &out, &["--shard", "2/2"]))
            .contains("was drawn from something else")
    );
    assert!(fs::read(out.join("plan.json")).unwrap() == before);
    // The same plan, after its scene has changed.
    let first = written(folder.path(), &plan(&[1, 2, 3, 4]));
    fs::write(
        folder.path().join("terrain.json"),
        json!({"splats": {"builtin": "terrain", "count": 2000}}).to_string(),
    )
    .unwrap();
    assert!(
        refused(&sweep(&first, &out, &["--shard", "2/2"]))
            .contains("was drawn from something else")
    );
    assert_eq!(rows(&out).len(), 2);
}

/// The shard that ends last writes the rows of both.
#[test]
fn a_part_that_began_before_another_ended_keeps_its_rows_in_the_table() {
    let folder = tempfile::tempdir().unwrap();
    let axis = json!({"field": "timing.raster.fifo", "values": [1, 2, 3, 4]});
    let plan = json!({"scenes": ["terrain.json"], "size": [8, 6], "machine": "tiny", "lockstep": false, "axes": [axis]});
    let points = Points::load(written(folder.path(), &plan)).unwrap();
    let out = folder.path().join("out");
    let options = |index| SweepOptions {
        shard: Some(Shard { index, of: 2 }),
        most: 100,
        prices: Prices::default(),
        progress: false,
    };
    let open = |index| Sweep::open(points.clone(), &out, &options(index), Folder::shared).unwrap();
    let (mut one, mut two) = (open(1), open(2));
    let stage = Stage::new(&points, &Prices::default(), 0, one.scene(0).unwrap());
    for sweep in [&mut one, &mut two] {
        let missing = sweep.missing(0);
        stage
            .draw(&missing, |number, row| sweep.push(number, row))
            .unwrap();
    }
    two.finish().unwrap();
    // The rows that existed when the other one began.
    assert_eq!(rows(&out).len(), 2);
    one.finish().unwrap();
    assert_eq!(rows(&out).len(), 4);
}

#[test]
fn a_machine_that_cannot_be_built_has_no_rank_in_frames_per_second() {
    let folder = tempfile::tempdir().unwrap();
    let axis = json!({"field": "exact", "values": [["raster"], [], ["gauss.weight"]]});
    let plan = json!({"scenes": ["terrain.json"], "size": [8, 6], "machine": "tiny", "lockstep": false, "axes": [axis]});
    let told = ok(&sweep(
        &written(folder.path(), &plan),
        &folder.path().join("out"),
        &[],
    ));
    assert!(!told.contains("inf") && !told.contains("18,446"), "{told}");
    let lines: Vec<&str> = told.lines().collect();
    let fastest = lines
        .iter()
        .position(|line| line.starts_with("fastest"))
        .unwrap();
    assert!(
        lines[fastest + 1].trim_end().ends_with("exact=[]"),
        "{told}"
    );
}

#[test]
fn a_value_may_be_a_word_with_its_rounding() {
    let folder = tempfile::tempdir().unwrap();
    let axis = json!({"field": "gauss.weight", "values": ["U0F8", {"format": "U0F8", "round": "truncate"}]});
    let plan = json!({"scenes": ["terrain.json"], "size": [24, 16], "machine": "tiny", "lockstep": false, "axes": [axis]});
    let out = folder.path().join("out");
    ok(&sweep(&written(folder.path(), &plan), &out, &[]));
    let rows = rows(&out);
    assert!(rows.iter().all(|row| row["misfit"].is_empty()), "{rows:?}");
    assert_ne!(rows[0]["psnr_db"], rows[1]["psnr_db"]);
}

#[test]
fn a_sweep_that_draws_no_point_fails_with_the_first_reason_and_has_no_charts() {
    let folder = tempfile::tempdir().unwrap();
    let axis = json!({"field": "gauss.weight", "add_frac_bits": [0, -2]});
    let plan = json!({"scenes": ["nested-shells"], "size": [8, 6], "axes": [axis]});
    let (path, out) = (written(folder.path(), &plan), folder.path().join("out"));
    let reason = "machine reference cannot draw nested-shells: it draws only discs";
    // The second sweep draws nothing, and fails in the same way.
    for _ in 0..2 {
        let output = sweep(&path, &out, &["--quiet"]);
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!(
            (output.status.code(), told.trim_end().lines().count()),
            (Some(1), 1),
            "{told}"
        );
        let expected = format!("no point was drawn (the plan's machine is reference): {reason}");
        assert!(told.contains(&expected), "{told}");
        assert_eq!(rows(&out).len(), 2);
    }
    let output = splatsim().arg("chart").arg(&out).output().unwrap();
    let expected = format!("no row was drawn: {reason}");
    assert!(refused(&output).contains(&expected), "{output:?}");
    assert!(!out.join("charts.html").exists());
}

/// What is screened out misses the PSNR when it is drawn in full, and all other rows are the same.
#[test]
fn only_machines_that_miss_the_psnr_are_screened_out() {
    let folder = tempfile::tempdir().unwrap();
    let plan = written(
        folder.path(),
        &json!({"scenes": ["terrain.json", "torus-knot.json"], "size": [160, 128], "machine": "lean", "lockstep": false, "axes": [
            {"field": "gauss.weight", "add_frac_bits": [-6, -4, 0]},
            {"field": "splat.rgb", "add_frac_bits": [-7, -5, -3, 0]},
            {"field": "timing.raster.lanes", "values": [[2, 2], [4, 1]]}]}),
    );
    let [whole, screened, other] =
        ["whole", "screened", "other"].map(|name| folder.path().join(name));
    ok(&sweep(&plan, &whole, &[]));
    let all = rows(&whole);
    let psnr =
        |row: &BTreeMap<String, String>| row["fixed_vs_ideal_psnr_db"].parse::<f64>().unwrap();
    let mut ranked: Vec<f64> = all.iter().map(psnr).collect();
    ranked.sort_by(f64::total_cmp);
    let least_db = ranked[ranked.len() * 2 / 3];
    let limit = least_db.to_string();

    let told = ok(&sweep(
        &plan,
        &screened,
        &["--screen", &limit, "--against", "ideal", "--threads", "1"],
    ));
    let kept = rows(&screened);
    let is_screened = |row: &&BTreeMap<String, String>| !row["tiles"].is_empty();
    let dropped = kept.iter().filter(is_screened).count();
    let below = ranked.iter().filter(|db| **db < least_db).count();
    assert!(
        2 * dropped > below,
        "{dropped} of {below} were screened out"
    );
    assert!(
        told.replace("\n    ", " ")
            .contains(&format!("only a sample of tiles was drawn: {dropped}\n")),
        "{told}"
    );
    assert_eq!(kept.len(), all.len());
    for (row, full) in kept.iter().zip(&all) {
        if is_screened(&row) {
            assert!(psnr(full) < least_db, "{full:?}");
            let high: f64 = row["sampled_psnr_high_db"].parse().unwrap();
            let estimate: f64 = row["sampled_psnr_db"].parse().unwrap();
            assert!(estimate <= high && high < least_db, "{row:?}");
            for empty in [
                "misfit",
                "psnr_db",
                "fixed_vs_ideal_psnr_db",
                "cycles",
                "area",
            ] {
                assert_eq!(row[empty], "", "{empty}");
            }
            continue;
        }
        for (name, cell) in full.iter().filter(|(name, _)| *name != "key") {
            assert_eq!(&row[name], cell, "{name}");
        }
    }

    // In parts, on several threads; the plan states the PSNR.
    let mut stated: Value = serde_json::from_str(&fs::read_to_string(&plan).unwrap()).unwrap();
    stated["screen"] = json!({"psnr_db": least_db, "against": "ideal"});
    let plan = written(folder.path(), &stated);
    for part in ["1/2", "2/2"] {
        ok(&sweep(&plan, &other, &["--shard", part, "--threads", "3"]));
    }
    assert_eq!(rows(&other), kept);
}

#[test]
fn a_sweep_whose_machines_are_all_screened_out_has_no_charts() {
    let folder = tempfile::tempdir().unwrap();
    let plan = written(
        folder.path(),
        &json!({"scenes": ["terrain.json"], "size": [128, 128], "machine": "tiny", "axes": []}),
    );
    let out = folder.path().join("out");
    for limit in ["0", "-3", "nan", "inf"] {
        let told = refused(&sweep(&plan, &out, &[&format!("--screen={limit}")]));
        assert!(told.contains("a number above 0 is needed"), "{told}");
    }
    let told = ok(&sweep(&plan, &out, &["--screen", "90"]));
    assert!(told.contains("surely below 90 dB (fixed −"), "{told}");
    let told = refused(
        &splatsim()
            .args(["chart", out.to_str().unwrap()])
            .output()
            .unwrap(),
    );
    assert!(
        told.contains("of every machine only a sample of the tiles was drawn"),
        "{told}"
    );
    // The rows do not belong to the sweep of all machines.
    refused(&sweep(&plan, &out, &[]));
    refused(&sweep(&plan, &out, &["--screen", "80"]));
}

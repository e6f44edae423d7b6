//! Does a result folder contain exactly one run, whatever happens while it is written, and does
//! every input result in output or in one sentence?

use crate::program::PROGRAM;
use crate::shared_input;
use serde_json::{Value, json};
use std::ffi::OsStr;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// One disc in the middle of a small picture.
const DISC: &str = r#"{"splats": [{"position": [0, 0, 0], "normal": [0, 0, 1], "radius": 0.5}],
    "camera": {"eye": [0, 0, 4], "target": [0, 0, 0]}, "image": {"width": 16, "height": 12}, "surface": {"z_threshold": 0.5}}"#;

fn started(arguments: &[impl AsRef<OsStr>]) -> Child {
    let mut command = Command::new(PROGRAM.as_str());
    command
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn splatsim(arguments: &[impl AsRef<OsStr>]) -> Output {
    started(arguments).wait_with_output().unwrap()
}

/// The single sentence of a refusal.
#[track_caller]
fn refused(arguments: &[impl AsRef<OsStr>]) -> String {
    let output = splatsim(arguments);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(
        (output.status.code(), output.stdout.len()),
        (Some(2), 0),
        "{:.2000}",
        told
    );
    assert!(
        told.trim_end().lines().count() == 1 && told.chars().count() < 1700,
        "{} bytes: {:.2000}",
        told.len(),
        told
    );
    told
}

#[track_caller]
fn done(arguments: &[impl AsRef<OsStr>]) {
    let output = splatsim(arguments);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

fn write(folder: &Path, name: &str, text: impl AsRef<[u8]>) -> String {
    let path = folder.join(name);
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

// ---- result folders ----

/// Of two simultaneous runs into a new folder one is refused, and the other one has all of its
/// files.
#[test]
fn of_two_runs_into_a_new_folder_one_is_refused_and_the_other_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let scene = write(folder.path(), "disc.json", DISC);
    let mut refusals = 0;
    for turn in 0..12 {
        let out = folder.path().join(format!("new-{turn}/out"));
        let arguments = [
            "run",
            &scene,
            "--machine",
            "tiny",
            "--check",
            "none",
            "--threads",
            "1",
            "--quiet",
            "--out",
            out.to_str().unwrap(),
        ];
        let ends = [started(&arguments), started(&arguments)]
            .map(|child| child.wait_with_output().unwrap());
        let mut codes = ends.each_ref().map(|end| end.status.code().unwrap());
        codes.sort_unstable();
        // They may also run one after the other.
        assert!(codes == [0, 0] || codes == [0, 2], "{ends:?}");
        refusals += usize::from(codes == [0, 2]);
        let names = names_in(&out);
        assert!(
            ["report.json", "fixed.png", "roofline.svg"]
                .iter()
                .all(|name| names.iter().any(|other| other == name)),
            "{names:?}"
        );
        assert!(names.iter().all(|name| !name.contains("part")), "{names:?}");
    }
    assert!(refusals > 0, "no two of them met");
}

/// The machines of the folder's report and pictures; none for each that is missing.
fn sizes(out: &Path) -> [Option<[u64; 2]>; 2] {
    let report = std::fs::read_to_string(out.join("report.json"))
        .ok()
        .map(|text| {
            let report: Value = serde_json::from_str(&text).unwrap();
            ["width", "height"].map(|side| report["scene"][side].as_u64().unwrap())
        });
    let picture = image::image_dimensions(out.join("fixed.png"))
        .ok()
        .map(|(width, height)| [u64::from(width), u64::from(height)]);
    [report, picture]
}

#[cfg(unix)]
#[test]
fn a_run_that_a_signal_ends_leaves_the_old_result_or_none_and_the_next_one_clears_up() {
    let folder = tempfile::tempdir().unwrap();
    let scene = write(folder.path(), "disc.json", DISC);
    let out = folder.path().join("out");
    let to = out.to_str().unwrap();
    let run = |size: &'static str| {
        [
            "run",
            &scene,
            "--machine",
            "tiny",
            "--check",
            "none",
            "--quiet",
            "--size",
            size,
            "--out",
            to,
        ]
    };
    let plain = {
        done(&run("64x64"));
        names_in(&out)
    };
    let start = Instant::now();
    done(&run("320x240"));
    let whole = start.elapsed();
    done(&run("64x64"));
    for turn in 0..9 {
        let child = started(&run("320x240"));
        std::thread::sleep(whole * (turn + 2) / 10);
        let signal = ["KILL", "INT", "TERM"][turn as usize % 3];
        // It may have ended already.
        Command::new("kill")
            .args(["-s", signal, &child.id().to_string()])
            .stderr(Stdio::null())
            .status()
            .unwrap();
        let end = child.wait_with_output().unwrap();
        let [report, picture] = sizes(&out);
        assert!(
            report.is_none() || report == picture,
            "{signal}: {report:?} {picture:?}"
        );
        if signal != "KILL" && !end.status.success() {
            let left: Vec<String> = names_in(&out)
                .into_iter()
                .filter(|name| name.contains("part"))
                .collect();
            assert_eq!(left, [""; 0], "{signal}: {end:?}");
        }
        if report.is_none() {
            assert!(refused(&["view", to, "--export", "none.html"]).contains("no report.json"));
        }
    }
    done(&run("64x64"));
    assert_eq!(names_in(&out), plain);
}

#[test]
fn a_result_that_cannot_be_written_leaves_the_one_before_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let scene = write(folder.path(), "disc.json", DISC);
    let out = folder.path().join("out");
    let to = out.to_str().unwrap();
    let run = |size: &'static str| {
        [
            "run",
            &scene,
            "--machine",
            "tiny",
            "--check",
            "none",
            "--quiet",
            "--size",
            size,
            "--out",
            to,
        ]
    };
    done(&run("64x64"));
    let all = || {
        names_in(&out)
            .into_iter()
            .map(|name| std::fs::read(out.join(name)).unwrap())
            .collect::<Vec<_>>()
    };
    std::fs::remove_file(out.join("error.png")).unwrap();
    let before = all();
    // A file cannot have the name of a folder.
    std::fs::create_dir(out.join("error.png")).unwrap();
    let end = splatsim(&run("32x32"));
    let told = String::from_utf8(end.stderr).unwrap();
    assert_eq!(
        (end.status.code(), told.lines().count()),
        (Some(1), 1),
        "{told}"
    );
    assert!(told.contains("error.png: cannot be written"), "{told}");
    std::fs::remove_dir(out.join("error.png")).unwrap();
    assert!(all() == before);
}

/// From the first frame on there is no older report, and there are no files of a single frame next
/// to the frames.
#[test]
fn a_sequence_replaces_the_previous_result_in_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    let scene = write(folder.path(), "disc.json", DISC);
    let film = |frames: u32| {
        let camera = r#""camera": {"eye": [0, 0, 4], "target": [0, 0, 0]}"#;
        write(
            folder.path(),
            "film.json",
            DISC.replace(
                camera,
                &format!(r#""camera_path": {{"pan_pixels": 1.0, "frames": {frames}}}"#),
            ),
        )
    };
    let out = folder.path().join("out");
    let to = out.to_str().unwrap();
    done(&[
        "run",
        &scene,
        "--machine",
        "tiny",
        "--quiet",
        "--exr",
        "--attribute",
        "--requests",
        "--timing",
        "timing.raster.fifo=1,2",
        "--out",
        to,
    ]);
    done(&[
        "run",
        &film(4),
        "--machine",
        "tiny",
        "--quiet",
        "--exr",
        "--out",
        to,
    ]);
    done(&["run", &film(2), "--machine", "tiny", "--quiet", "--out", to]);
    let frames = [0, 1].into_iter().flat_map(|frame| {
        ["fixed", "golden", "ideal"].map(|name| format!("frame_{frame:04}_{name}.png"))
    });
    assert_eq!(
        names_in(&out),
        frames.chain(["report.json".into()]).collect::<Vec<_>>()
    );
}

/// Text that a browser would parse as the beginning of a script within a script stays text.
#[test]
fn no_value_of_a_row_ends_the_page_of_charts() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "disc.json", DISC);
    let plan = json!({"scenes": ["disc.json"], "size": [16, 12], "machine": "tiny", "lockstep": false,
        "axes": [{"field": "name", "values": ["<!--<script>", "b</script>"]}, {"field": "fragment.layers", "range": [1, 2, 1]}]});
    let plan = write(folder.path(), "plan.json", plan.to_string());
    let out = folder.path().join("rows");
    done(&["sweep", &plan, "--quiet", "--out", out.to_str().unwrap()]);
    done(&["chart", out.to_str().unwrap()]);
    let page = std::fs::read_to_string(out.join("charts.html")).unwrap();
    let rows = page
        .split(r#"<script type="application/json" id="rows">"#)
        .nth(1)
        .unwrap()
        .split("</script>")
        .next()
        .unwrap();
    assert!(!rows.contains('<'), "{rows}");
    let rows: Value = serde_json::from_str(rows).unwrap();
    let text = rows.to_string();
    assert!(
        text.contains("<!--<script>") && text.contains("b</script>"),
        "{text}"
    );
    assert!(!page.contains("<!--<script>") && page.trim_end().ends_with("</html>"));
}

// ---- names in error messages ----

#[test]
fn names_of_megabytes_end_in_a_short_sentence_quickly() {
    let folder = tempfile::tempdir().unwrap();
    let long = "abc".repeat(2 << 20);
    let spaced = "ab c".repeat(1 << 20);
    let splat = json!([{"position": [0, 0, 0], "radius": 1}]);
    for long in [&long, &spaced] {
        let scenes = [
            json!({"splats": splat, long: 1}),
            json!({"splats": {"file": long}}),
            json!({"splats": {"file": format!("{long}.ply")}}),
            json!({"splats": {"volume": format!("{long}.vti")}}),
            json!({"splats": {"volume": {"file": long, "size": [2, 2, 2], "type": "u8"}}}),
            json!({"splats": {"builtin": long}}),
            json!({"splats": [{"position": [0, 0, 0], long: 1}]}),
            json!({"splats": splat, "environment": {"file": long}}),
            json!({"splats": splat, "kernel": {"filter": long}}),
            json!({"splats": splat, "camera": long}),
        ];
        for (nth, scene) in scenes.iter().enumerate() {
            let scene = write(folder.path(), "scene.json", scene.to_string());
            let start = Instant::now();
            let told = refused(&["run", &scene]);
            assert!(
                start.elapsed() < Duration::from_secs(20),
                "{nth}: {:?}: {told}",
                start.elapsed()
            );
        }
        for machine in [
            json!({"base": "tiny", long: 1}),
            json!({"base": long}),
            json!({"base": "tiny", "gauss": {"weight": long}}),
        ] {
            let machine = write(folder.path(), "machine.json", machine.to_string());
            refused(&["run", "--machine", &machine]);
        }
        for plan in [
            json!({"scenes": [long], "machine": "tiny", "axes": []}),
            json!({"scenes": ["terrain"], "machine": long, "axes": []}),
        ] {
            let plan = write(folder.path(), "plan.json", plan.to_string());
            refused(&[
                "sweep",
                &plan,
                "--out",
                folder.path().join("rows").to_str().unwrap(),
            ]);
        }
    }
}

// ---- inputs without an end ----

#[cfg(unix)]
#[test]
fn devices_folders_and_pipes_without_a_writer_are_refused_by_every_reader() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let scene = write(folder.path(), "disc.json", DISC);
    for name in [
        "zero.json",
        "zero.ply",
        "zero.obj",
        "zero.nrrd",
        "zero.vtu",
        "zero.work",
    ] {
        std::os::unix::fs::symlink("/dev/zero", at(name)).unwrap();
    }
    assert!(
        Command::new("mkfifo")
            .args([at("pipe.json"), at("pipe.ply")])
            .status()
            .unwrap()
            .success()
    );
    std::fs::create_dir(at("folder.json")).unwrap();
    let splats = |file: &str| {
        write(
            folder.path(),
            "scene.json",
            json!({"splats": {"file": file}}).to_string(),
        )
    };
    let [out, cases, rows] = ["out.ply", "cases", "rows"].map(at);
    for arguments in [
        vec!["run", &at("zero.json")],
        vec!["run", &at("zero.ply")],
        vec!["run", &at("zero.nrrd")],
        vec!["run", &at("zero.vtu")],
        vec!["run", "/dev/zero"],
        vec!["run", &splats("/dev/zero")],
        vec!["run", &scene, "--machine", "/dev/zero"],
        vec!["run", &scene, "--unit-costs", "/dev/zero"],
        vec!["run", &scene, "--cameras", &at("zero.json")],
        vec!["sample", &at("zero.obj"), "--points", "10", "--out", &out],
        vec![
            "sample",
            "plane",
            "--points",
            "10",
            "--texture-image",
            "/dev/zero",
            "--out",
            &out,
        ],
        vec!["replay", &at("zero.work")],
        vec!["sweep", "/dev/zero", "--out", &rows],
        vec!["trace", &at("zero.json"), "--out", &cases],
        vec!["run", &at("folder.json")],
        vec!["run", &scene, "--machine", &at("folder.json")],
        vec!["run", &at("pipe.json")],
        vec!["run", &scene, "--machine", &at("pipe.json")],
        vec!["run", &at("pipe.ply")],
    ] {
        let start = Instant::now();
        let told = refused(&arguments);
        assert!(
            start.elapsed() < Duration::from_secs(30),
            "{arguments:?} took {:?}: {told}",
            start.elapsed()
        );
    }
    // A pipe that ends is a valid input, like a file.
    let machine = write(folder.path(), "machine.json", r#"{"base": "tiny"}"#);
    let script = r#"cat "$1" > "$2" & exec "$0" machine show "$2""#;
    let output = Command::new("sh")
        .args(["-c", script, PROGRAM.as_str(), &machine, &at("pipe.json")])
        .output();
    assert_eq!(output.unwrap().status.code(), Some(0));
}

#[test]
fn an_export_is_not_written_over_another_file() {
    let folder = tempfile::tempdir().unwrap();
    let scene = write(folder.path(), "disc.json", DISC);
    let out = folder.path().join("out");
    let to = out.to_str().unwrap();
    done(&["run", &scene, "--machine", "tiny", "--quiet", "--out", to]);
    for precious in ["precious", "<!doctype html><title>another page</title>"] {
        let precious = write(folder.path(), "page.html", precious);
        assert!(
            refused(&["view", to, "--export", &precious])
                .contains("is not a page that --export wrote")
        );
    }
    let page = write(folder.path(), "page.html", "");
    done(&["view", to, "--export", &page]);
    let first = std::fs::read(&page).unwrap();
    done(&["view", to, "--export", &page]);
    assert!(first.len() > 10_000 && std::fs::read(&page).unwrap() == first);
}

// ---- memory ----

/// The largest picture of one splat, with less memory than it needs: it is refused before drawing
/// begins.
#[cfg(target_os = "linux")]
#[test]
fn a_frame_that_memory_has_no_room_for_is_refused_before_it_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let scene = write(folder.path(), "disc.json", DISC);
    let out = folder.path().join("out");
    let limited = |arguments: &[&str], kilobytes: u32| {
        let start = Instant::now();
        let script = format!("ulimit -v {kilobytes}; exec \"$0\" \"$@\"");
        let output = Command::new("sh")
            .arg("-c")
            .arg(script)
            .arg(PROGRAM.as_str())
            .args(arguments)
            .output()
            .unwrap();
        (
            output.status.code(),
            String::from_utf8(output.stderr).unwrap(),
            start.elapsed(),
        )
    };
    let to = out.to_str().unwrap();
    let (code, told, took) = limited(
        &[
            "run",
            &scene,
            "--size",
            "8192x4096",
            "--machine",
            "tiny",
            "--threads",
            "1",
            "--out",
            to,
        ],
        2_000_000,
    );
    assert_eq!((code, told.lines().count()), (Some(2), 1), "{told}");
    assert!(
        told.contains("a frame of 8192×4096 pixels and 1 splats is too large here: it needs ")
            && told.contains("GB are free"),
        "{told}"
    );
    assert!(took < Duration::from_secs(30) && !out.exists(), "{took:?}");
    let (code, told, _) = limited(
        &[
            "run",
            &scene,
            "--machine",
            "tiny",
            "--threads",
            "1",
            "--quiet",
        ],
        2_000_000,
    );
    assert_eq!(code, Some(0), "{told}");
}

// ---- the inputs that were reported ----

#[test]
fn gaussians_beside_discs_mirror_nothing_on_a_machine_that_reflects() {
    let Some(folder) = shared_input::find("outside/robust/01-reflect-gaussians-panic") else {
        return;
    };
    done(&[
        "run",
        folder.join("scene.json").to_str().unwrap(),
        "--machine",
        folder.join("reflect.json").to_str().unwrap(),
        "--quiet",
    ]);
}

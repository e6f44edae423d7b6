//! Invalid inputs that were found by fuzzing and by users: each is refused in one sentence, with
//! status 2, and leaves no files.

use crate::program::PROGRAM;
use std::ffi::{OsStr, OsString};
use std::path::Path;
use std::process::Output;
use std::time::Duration;

use assert_cmd::Command;
use rtl_model::Machine;
use rtl_model::work::Work;
use serde_json::{Value, json};
use splatsim::output::files::Folder;
use splatsim::performance::recording::Recording;
use splatsim::scene::{Overrides, Scene};

/// One disc in the middle of a small picture.
const DISC: &str = r#"{"splats": [{"position": [0, 0, 0], "normal": [0, 0, 1], "radius": 0.5}],
    "camera": {"eye": [0, 0, 4], "target": [0, 0, 0]}, "image": {"width": 16, "height": 12}, "surface": {"z_threshold": 0.5}}"#;

fn splatsim(arguments: &[impl AsRef<OsStr>]) -> Output {
    Command::new(PROGRAM.as_str())
        .args(arguments)
        .timeout(Duration::from_secs(300))
        .output()
        .unwrap()
}

/// The single sentence of a refusal.
#[track_caller]
fn refused(arguments: &[impl AsRef<OsStr> + std::fmt::Debug]) -> String {
    let output = splatsim(arguments);
    let sentence = String::from_utf8_lossy(&output.stderr).into_owned();
    let arguments = format!("{:.300}", format!("{arguments:?}"));
    assert_eq!(
        (output.status.code(), output.stdout.len()),
        (Some(2), 0),
        "{arguments}: {sentence}"
    );
    assert!(
        sentence.trim_end().lines().count() == 1 && sentence.len() < 1200,
        "{arguments}: {} bytes: {sentence}",
        sentence.len()
    );
    sentence.trim_end().to_owned()
}

#[track_caller]
fn done(arguments: &[impl AsRef<OsStr> + std::fmt::Debug]) -> String {
    let output = splatsim(arguments);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{arguments:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).unwrap()
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

fn write(folder: &tempfile::TempDir, name: impl AsRef<Path>, text: impl AsRef<[u8]>) -> String {
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    path.to_string_lossy().into_owned()
}

fn names_in(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

fn read_json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn plan(scenes: &[&str], axis: &Value) -> String {
    json!({"scenes": scenes, "size": [16, 12], "machine": "tiny", "lockstep": false, "axes": [axis]}).to_string()
}

// ---- promises of bounds ----

#[test]
fn a_path_of_forty_thousand_steps_is_refused_and_not_followed() {
    let folder = folder();
    let scene = write(&folder, "disc.json", DISC);
    let deep = format!("timing{}", ".a".repeat(40_000));
    for arguments in [
        vec!["run", &scene, "--set", &format!("{deep}=1")],
        vec!["run", &scene, "--timing", &format!("{deep}=1,2")],
        vec![
            "machine",
            "show",
            "lean",
            "--set",
            &format!("{deep}={{\"b\": 1}}"),
        ],
    ] {
        let sentence = refused(&arguments);
        assert!(
            sentence.contains("has 40001 steps; no field of a machine lies deeper than 16"),
            "{sentence}"
        );
    }
    let out = folder.path().join("out").to_string_lossy().into_owned();
    let plan = write(
        &folder,
        "plan.json",
        plan(&[&scene], &json!({"field": deep, "values": [1]})),
    );
    assert!(refused(&["sweep", &plan, "--out", &out]).contains("has 40001 steps"));
}

#[test]
fn a_cache_compares_at_most_64_lines_in_a_cycle() {
    let ways = |ways: u32| {
        [
            format!("timing.cache.ways={ways}"),
            "timing.cache.lines=1048576".to_owned(),
        ]
    };
    let with = |ways: &[String; 2]| {
        [
            "machine", "timing", "lean", "--set", &ways[1], "--set", &ways[0],
        ]
        .map(OsString::from)
    };
    assert!(
        refused(&with(&ways(128)))
            .contains("timing.cache.ways is 128: at most 64 are compared in a cycle")
    );
    done(&with(&ways(64)));
}

#[test]
fn a_record_claims_no_more_pixels_than_run_draws() {
    let folder = folder();
    let path = folder.path().join("claims.work");
    let record = |width, height| {
        let work = Work {
            width,
            height,
            ..Work::default()
        };
        Recording {
            scene: "few".into(),
            machine: Machine::named("tiny").unwrap(),
            work,
        }
        .write(&path)
        .unwrap();
    };
    record(16_384, 16_384);
    let sentence = refused(&[OsStr::new("replay"), path.as_os_str()]);
    assert!(
        sentence.ends_with(
            "its picture has 16384×16384 pixels; at most 33554432 are drawn and replayed"
        ),
        "{sentence}"
    );
    record(64, 48);
    done(&[OsStr::new("replay"), path.as_os_str()]);
}

#[test]
fn inputs_too_large_for_memory_are_refused_before_allocation() {
    let folder = folder();
    // The schema allows each source; together they need terabytes.
    let sources = vec![json!({"builtin": "terrain", "count": 67_108_864}); 60];
    let scene = write(&folder, "huge.json", json!({"splats": sources}).to_string());
    let out = folder.path().join("out").to_string_lossy().into_owned();
    let sentence = refused(&["run", &scene, "--out", &out]);
    assert!(
        sentence.contains(
            "huge.json: splats: 4,026,531,840 splats would take about 4550.0 GB of memory, and "
        ),
        "{sentence}"
    );
    // Gaussians, and splats drawn together with them, each have an orientation, anywhere in the
    // scene.
    let gaussians = json!({"gaussians": "bouquet", "count": 67_108_864});
    let placed =
        json!({"splats": [{"builtin": "terrain", "count": 67_108_864}, gaussians], "place": {}});
    let scene = write(
        &folder,
        "huge.json",
        json!({"splats": vec![placed; 30]}).to_string(),
    );
    let sentence = refused(&["run", &scene, "--out", &out]);
    assert!(
        sentence.contains(
            "huge.json: splats: 4,026,531,840 splats would take about 6684.0 GB of memory, and "
        ),
        "{sentence}"
    );
    assert_eq!(names_in(folder.path()), ["huge.json"]);
}

// ---- nothing is left behind ----

#[test]
fn where_the_input_is_wrong_nothing_is_written() {
    let folder = folder();
    let scene = write(&folder, "disc.json", DISC);
    let axis = json!({"field": "fragment.layers", "values": [1, 2]});
    let missing = write(&folder, "missing.json", plan(&[&scene, "gone.json"], &axis));
    let out = folder.path().join("a/b");
    let out = out.to_str().unwrap();
    let nowhere = folder
        .path()
        .join("gone/frame.work")
        .to_string_lossy()
        .into_owned();
    let before = names_in(folder.path());
    for (arguments, sentence) in [
        (
            vec!["sweep", &missing, "--out", out],
            "gone.json: no such file",
        ),
        (
            vec![
                "search",
                &scene,
                "--machine",
                "tiny",
                "--target-psnr",
                "500",
                "--out",
                out,
            ],
            "the target is out of reach: on disc.json tiny",
        ),
        (
            vec!["run", &scene, "--set", "project.focal=U1F4", "--out", out],
            "project.focal U1F4 holds 0 to",
        ),
        (
            vec![
                "run",
                &scene,
                "--machine",
                "tiny",
                "--out",
                out,
                "--record",
                &nowhere,
            ],
            "there is no folder",
        ),
        (vec!["replay", &scene, "--out", out], "is not a record"),
        (
            vec!["trace", &scene, "--splats", "5..9", "--out", out],
            "--splats 5..9",
        ),
    ] {
        assert!(
            refused(&arguments).contains(sentence),
            "{arguments:?}: {}",
            refused(&arguments)
        );
        assert_eq!(names_in(folder.path()), before, "{arguments:?}");
    }
}

#[test]
fn a_sweep_of_another_scene_leaves_the_folder_as_it_was() {
    let folder = folder();
    let scene = write(&folder, "disc.json", DISC);
    let path = write(
        &folder,
        "plan.json",
        plan(
            &[&scene],
            &json!({"field": "fragment.layers", "values": [1, 2]}),
        ),
    );
    let out = folder.path().join("out");
    let sweep = ["sweep", &path, "--quiet", "--out", out.to_str().unwrap()];
    done(&sweep);
    let files = || {
        names_in(&out)
            .into_iter()
            .map(|name| std::fs::read(out.join(name)).unwrap())
            .collect::<Vec<_>>()
    };
    let before = (names_in(&out), files());
    write(&folder, "disc.json", DISC.replace("0.5}]", "0.25}]"));
    assert!(refused(&sweep).contains("point 0 was drawn from something else than now"));
    // A separate shard does not begin a journal either.
    assert!(
        refused(&[&sweep[..], &["--shard", "1/2"]].concat())
            .contains("point 0 was drawn from something else than now")
    );
    assert_eq!((names_in(&out), files()), before);
}

#[test]
fn a_folder_has_one_writer_at_a_time_and_keeps_other_files() {
    let folder = folder();
    let scene = write(&folder, "disc.json", DISC);
    let out = folder.path().join("out");
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("notes.txt"), "mine").unwrap();
    let run = [
        "run",
        &scene,
        "--machine",
        "tiny",
        "--quiet",
        "--out",
        out.to_str().unwrap(),
    ];
    let writing = Folder::open(&out).unwrap();
    assert!(refused(&run).ends_with("cannot be written: another process is writing there"));
    assert_eq!(names_in(&out), ["notes.txt"]);
    drop(writing);
    done(&run);
    let names = names_in(&out);
    assert!(
        names.contains(&"report.json".into()) && names.contains(&"notes.txt".into()),
        "{names:?}"
    );
    assert!(names.iter().all(|name| !name.starts_with('.')), "{names:?}");
}

#[cfg(unix)]
#[test]
fn a_writer_that_was_killed_does_not_block_the_next_one() {
    let folder = folder();
    let (out, scene) = (folder.path().join("out"), write(&folder, "disc.json", DISC));
    let long = [
        "run",
        "--attribute",
        "--quiet",
        "--out",
        out.to_str().unwrap(),
    ];
    let mut first = std::process::Command::new(PROGRAM.as_str())
        .args(long)
        .spawn()
        .unwrap();
    for _ in 0..3000 {
        if !out.exists() {
            std::thread::sleep(Duration::from_millis(20));
        }
    }
    // The new writer locks the files that it made.
    std::thread::sleep(Duration::from_millis(200));
    let held = Folder::open(&out).unwrap_err().to_string();
    first.kill().unwrap();
    first.wait().unwrap();
    assert!(held.ends_with("another process is writing there"), "{held}");
    done(&[
        "run",
        &scene,
        "--machine",
        "tiny",
        "--quiet",
        "--out",
        out.to_str().unwrap(),
    ]);
}

// ---- texts and names ----

#[test]
fn a_field_that_is_there_twice_is_refused_with_its_place() {
    let folder = folder();
    let scene = write(
        &folder,
        "scene.json",
        DISC.replace("\"radius\": 0.5", "\"radius\": 0.5,\n\"radius\": 9"),
    );
    assert!(
        refused(&["run", &scene])
            .contains("scene.json: the field `radius` is there twice at line 2 column ")
    );
    let machine = write(
        &folder,
        "machine.json",
        r#"{"base": "lean", "fragment": {"layers": 2, "layers": 3}}"#,
    );
    assert!(
        refused(&["machine", "show", &machine])
            .contains("machine.json: the field `layers` is there twice at line 1 column ")
    );
    let plan = write(
        &folder,
        "plan.json",
        r#"{"scenes": ["terrain"], "axes": [], "seed": 1, "seed": 2}"#,
    );
    assert!(
        refused(&["sweep", &plan])
            .contains("plan.json: the field `seed` is there twice at line 1 column ")
    );
    let prices = write(&folder, "prices.json", r#"{"logic": 1, "logic": 2}"#);
    assert!(
        refused(&["machine", "cost", "lean", "--unit-costs", &prices])
            .contains("the field `logic` is there twice")
    );
}

#[test]
fn rows_that_the_header_does_not_promise_are_refused_with_their_line() {
    let folder = folder();
    let head = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n";
    let normals = "property float nx\nproperty float ny\nproperty float nz\n";
    let refused = |name: &str, text: &str| {
        let path = write(&folder, name, text);
        Scene::load(&path, &Overrides::default())
            .err()
            .map(|error| error.to_string().replace(&path, "FILE"))
    };
    let surplus = "FILE: line 10: `7 8 9` is one row more than the header promises";
    assert_eq!(
        refused("a.ply", &format!("{head}end_header\n0 0 0\n1 1 1\n7 8 9\n")).as_deref(),
        Some(surplus)
    );
    assert_eq!(
        refused("b.ply", &format!("{head}end_header\n0 0 0\n1 1 1\n\n \n")),
        None
    );
    // The rows of faces must be present, also if they are not needed for normals.
    let faces = format!(
        "{head}{normals}element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 0 0 1\n1 1 1 0 0 1\n"
    );
    assert_eq!(refused("c.ply", &format!("{faces}3 0 1 0\n")), None);
    assert_eq!(refused("d.ply", &faces), None);
    let surplus = "FILE: line 16: `3 0 0 0` is one row more than the header promises";
    assert_eq!(
        refused("e.ply", &format!("{faces}3 0 1 0\n3 0 0 0\n")).as_deref(),
        Some(surplus)
    );
    let names = [
        "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1",
        "rot_2", "rot_3",
    ];
    let trained = head.to_owned()
        + &names
            .map(|name| format!("property float {name}\n"))
            .concat()
        + "end_header\n";
    let row = "0 0 0 0 0 0 1 -2 -2 -2 1 0 0 0\n";
    assert_eq!(refused("f.ply", &(trained.clone() + row + row)), None);
    assert!(
        refused("g.ply", &(trained + row + row + row))
            .unwrap()
            .contains("line 21: `0 0 0 0 0 0 1")
    );
}

#[cfg(unix)]
#[test]
fn paths_that_are_no_unicode_are_paths() {
    use std::os::unix::ffi::OsStrExt;
    let folder = folder();
    let odd = |name: &[u8]| folder.path().join(OsStr::from_bytes(name)).into_os_string();
    let [scene, cloud, machine, plan, out] = [
        &b"sc\xffene.json"[..],
        b"cl\xfeoud.ply",
        b"mach\xffine.json",
        b"pl\xffan.json",
        b"out\xff",
    ]
    .map(odd);
    std::fs::write(&scene, DISC).unwrap();
    std::fs::write(folder.path().join("disc.json"), DISC).unwrap();
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n1 0 0\n0 1 0\n";
    std::fs::write(&cloud, ply).unwrap();
    std::fs::write(&machine, r#"{"base": "tiny"}"#).unwrap();
    let axis = json!({"field": "fragment.layers", "values": [1, 2]});
    std::fs::write(
        &plan,
        json!({"scenes": ["disc.json"], "size": [8, 8], "lockstep": false, "axes": [axis]})
            .to_string(),
    )
    .unwrap();
    let of = |words: &[&OsStr]| {
        words
            .iter()
            .map(|word| (*word).to_owned())
            .collect::<Vec<OsString>>()
    };
    let [run, size, small, with, to, quiet] =
        ["run", "--size", "16x12", "--machine", "--out", "--quiet"].map(OsStr::new);
    done(&of(&[
        run, &scene, size, small, with, &machine, to, &out, quiet,
    ]));
    assert!(Path::new(&out).join("report.json").exists());
    done(&of(&[run, &cloud, size, small, quiet]));
    let swept = folder.path().join("swept");
    done(&of(&[
        OsStr::new("sweep"),
        &plan,
        to,
        swept.as_os_str(),
        quiet,
    ]));
    assert!(swept.join("sweep.csv").exists());
}

#[test]
fn a_whole_number_may_have_an_exponent() {
    let folder = folder();
    let with = |setting: &str| {
        let arguments = ["machine", "show", "reference", "--set", setting];
        serde_json::from_str::<Value>(&done(&arguments)).unwrap()["timing"]["clock_hz"].clone()
    };
    assert_eq!(
        [with("timing.clock_hz=5e8"), with("timing.clock_hz=2.5e8")],
        [json!(500_000_000), json!(250_000_000)]
    );
    let machine = write(
        &folder,
        "fast.json",
        r#"{"base": "lean", "timing": {"clock_hz": 4.5e8}}"#,
    );
    assert!(done(&["machine", "show", &machine]).contains("\"clock_hz\": 450000000"));
    assert!(
        refused(&["machine", "show", "lean", "--set", "timing.clock_hz=1.5"])
            .contains("is 1.5; it must be a whole number")
    );
}

#[test]
fn a_name_that_is_not_known_gets_the_nearest() {
    let folder = folder();
    let plan_of = |name: &str, axis: Value| write(&folder, name, plan(&["terrain"], &axis));
    let wrong_field = plan_of(
        "field.json",
        json!({"field": "gauss.wieght", "values": ["U0F8"]}),
    );
    let wrong_word = plan_of(
        "word.json",
        json!({"field": "gauss.wieght", "add_frac_bits": [1]}),
    );
    let wrong_exact = plan_of(
        "exact.json",
        json!({"field": "exact", "values": [["rastr"]]}),
    );
    for (arguments, nearest) in [
        (vec!["run", "glass-sphere"], "(nearest: `glass-spheres`)"),
        (vec!["run", "--machine", "leen"], "(nearest: `lean`)"),
        (vec!["sweep", "precison"], "(nearest: `precision`)"),
        (
            vec!["sweep", wrong_field.as_str()],
            "the nearest is `weight`",
        ),
        (
            vec!["sweep", wrong_word.as_str()],
            "(nearest: `gauss.weight`)",
        ),
        (vec!["sweep", wrong_exact.as_str()], "(nearest: `raster`)"),
    ] {
        let sentence = refused(&arguments);
        assert!(sentence.contains(nearest), "{sentence}");
    }
}

#[test]
fn a_name_that_is_like_none_gets_no_nearest() {
    let folder = folder();
    let plan_of = |name: &str, axis: Value| write(&folder, name, plan(&["terrain"], &axis));
    let word = plan_of("word.json", json!({"field": "zzz", "add_frac_bits": [1]}));
    let exact = plan_of("exact.json", json!({"field": "exact", "values": [["zzz"]]}));
    for arguments in [
        vec!["sweep", "nono"],
        vec!["run", "nono"],
        vec!["run", "--machine", "nono"],
        vec!["run", "--set", "zzz=1"],
        vec!["run", "--set", "gauss.weight.round=zzz"],
        vec!["stress", "--case", "zzz"],
        vec!["sweep", word.as_str()],
        vec!["sweep", exact.as_str()],
    ] {
        let sentence = refused(&arguments);
        assert!(
            !sentence.contains("nearest:") && !sentence.contains("the nearest is"),
            "{sentence}"
        );
    }
}

#[test]
fn a_register_is_named_once_however_many_values_it_cannot_hold() {
    let folder = folder();
    let lights = vec![json!({"direction": [0, 0, 1], "rgb": [900, 1000, 800]}); 21];
    let mut scene: Value = serde_json::from_str(DISC).unwrap();
    scene["lights"] = json!(lights);
    let scene = write(&folder, "bright.json", scene.to_string());
    let sentence = refused(&["run", &scene]);
    assert_eq!(
        sentence.matches("shade.reflectance").count(),
        1,
        "{sentence}"
    );
    // 21 lights × 3 channels × 2 factors; the largest excess is reported.
    assert!(
        sentence.contains("but the scene needs 800:")
            && sentence.contains("(125 more values do not fit either)"),
        "{sentence}"
    );
}

#[cfg(unix)]
#[test]
fn a_line_break_in_a_name_reaches_no_file() {
    let folder = folder();
    let scene = write(&folder, "disc\nmodule evil;.json", DISC);
    let machine = write(&folder, "tin\nmodule evil;.json", r#"{"base": "tiny"}"#);
    let out = folder.path().join("out\nmodule evil;");
    let output = done(&[
        "trace",
        &scene,
        "--machine",
        &machine,
        "--out",
        out.to_str().unwrap(),
    ]);
    assert!(!output.contains("\nmodule evil;"), "{output}");
    let mut texts = 0;
    for entry in std::fs::read_dir(&out).unwrap() {
        let path = entry.unwrap().path();
        let Ok(text) = std::fs::read_to_string(&path) else {
            continue;
        };
        assert!(!text.contains("\nmodule evil;"), "{path:?}");
        texts += 1;
    }
    assert!(texts > 10, "{texts} texts");
    let named = write(
        &folder,
        "named.json",
        r#"{"base": "tiny", "name": "tiny\nmodule evil;"}"#,
    );
    assert!(
        refused(&["machine", "show", &named])
            .contains(r"name is `tiny\nmodule evil;`; it must have no line breaks")
    );
    // A line break does not break an error's single line either.
    assert!(refused(&["run", "gone\nfile.json"]).contains(r"gone\nfile.json: no such file"));
}

// ---- output for users ----

#[test]
fn a_reported_camera_draws_the_same_picture_again() {
    let folder = folder();
    let scene = write(
        &folder,
        "free.json",
        r#"{"splats": {"builtin": "torus-knot", "count": 2000}, "image": {"width": 40, "height": 32}}"#,
    );
    let run = |scene: &str, name: &str| {
        let out = folder.path().join(name);
        done(&[
            "run",
            scene,
            "--machine",
            "tiny",
            "--quiet",
            "--out",
            out.to_str().unwrap(),
        ]);
        (
            read_json(&out.join("report.json")),
            std::fs::read(out.join("golden.png")).unwrap(),
        )
    };
    let (report, picture) = run(&scene, "first");
    let mut again = read_json(Path::new(&scene));
    again["camera"] = report["scene"]["camera"].clone();
    assert_eq!(again["camera"].as_object().unwrap().len(), 5, "{again}");
    let (second, same) = run(&write(&folder, "again.json", again.to_string()), "second");
    assert_eq!(
        (&second["accuracy"], &same),
        (&report["accuracy"], &picture)
    );
}

#[test]
fn every_view_of_a_search_has_its_whole_camera() {
    let folder = folder();
    let scene = write(&folder, "disc.json", DISC);
    let out = folder.path().join("found");
    let search = [
        "search",
        &scene,
        "--target-psnr",
        "25",
        "--machine",
        "tiny",
        "--only",
        "splat.rgb",
        "--tries",
        "0",
        "--views",
        "2",
    ];
    done(&[&search[..], &["--quiet", "--out", out.to_str().unwrap()]].concat());
    let found = read_json(&out.join("search.json"));
    let camera = &found["cameras"][0]["camera"];
    assert_eq!(
        (&found["cameras"][0]["name"], &camera["eye"]),
        (&json!("disc.json"), &json!([0.0, 0.0, 4.0]))
    );
    let views = found["views"].as_array().unwrap();
    assert_eq!(views.len(), 2);
    for view in views {
        let mut again: Value = serde_json::from_str(DISC).unwrap();
        again["camera"] = view["camera"].clone();
        let path = write(&folder, "view.json", again.to_string());
        let camera = Scene::load(&path, &Overrides::default()).unwrap().camera;
        assert_eq!(
            (serde_json::to_value(camera).unwrap(), &view["eye"]),
            (view["camera"].clone(), &view["camera"]["eye"])
        );
    }
}

#[test]
fn shells_complete_every_command_and_every_command_has_a_page() {
    let folder = folder();
    let help = done(&["--help"]);
    let commands: Vec<&str> = help
        .lines()
        .take_while(|line| *line != "Options:")
        .filter_map(|line| line.strip_prefix("  ")?.split_whitespace().next())
        .collect();
    assert!(commands.len() >= 13, "{commands:?}");
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = done(&["completions", shell]);
        assert!(
            commands.iter().all(|command| script.contains(command))
                && script.contains("target-psnr"),
            "{shell}"
        );
    }
    let pages = folder.path().join("pages");
    done(&["man", pages.to_str().unwrap()]);
    let names = names_in(&pages);
    for command in commands {
        assert!(
            names.contains(&format!("splatsim-{command}.1")),
            "{command}: {names:?}"
        );
    }
    assert!(
        names.contains(&"splatsim-machine-show.1".into()),
        "{names:?}"
    );
    let page = std::fs::read_to_string(pages.join("splatsim-run.1")).unwrap();
    assert!(
        page.contains(".TH splatsim-run 1") && page.contains("preview"),
        "{page}"
    );
}

#[test]
fn colours_are_printed_only_on_a_terminal() {
    for arguments in [
        vec!["--help"],
        vec!["run", "--help"],
        vec!["machine", "list"],
        vec!["run", "gone"],
    ] {
        let output = splatsim(&arguments);
        assert!(
            ![output.stdout, output.stderr].concat().contains(&0x1b),
            "{arguments:?}"
        );
    }
}

// ---- names, paths and existing files ----

/// A scene of one splat and a picture of a few pixels: a minimal run.
fn small_run<'a>(scene: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [
        &[
            "run",
            scene,
            "--machine",
            "tiny",
            "--size",
            "16x12",
            "--quiet",
        ],
        more,
    ]
    .concat()
}

#[test]
fn an_output_folder_does_not_replace_an_input_with_its_name() {
    let folder = folder();
    let splatsim = |arguments: &[&str]| {
        let output = Command::new(PROGRAM.as_str())
            .args(arguments)
            .current_dir(folder.path())
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{arguments:?}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
    };
    write(&folder, "disc.json", DISC);
    for _ in 0..2 {
        splatsim(&small_run("disc.json", &["--out", "tiny"]));
        splatsim(&[
            "run",
            "nested-shells",
            "--size",
            "8x6",
            "--check",
            "none",
            "--quiet",
            "--out",
            "nested-shells",
        ]);
    }
    splatsim(&["machine", "show", "tiny"]);
    // The run in it can still be compared.
    splatsim(&["compare", "tiny", "tiny", "--json"]);
    // Nor that of a plan, which is refused for another reason.
    std::fs::create_dir(folder.path().join("layers")).unwrap();
    let refused = Command::new(PROGRAM.as_str())
        .args(["sweep", "layers", "--most", "1"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(told.contains("more than 1"), "{told}");
}

#[test]
fn files_other_than_recordings_are_not_overwritten() {
    let folder = folder();
    let scene = write(&folder, "disc.json", DISC);
    let before = std::fs::read(&scene).unwrap();
    assert!(
        refused(&small_run(&scene, &["--record", &scene]))
            .contains("it exists and is not a recording")
    );
    assert!(std::fs::read(&scene).unwrap() == before);
    let record = folder.path().join("disc.work");
    for _ in 0..2 {
        done(&small_run(&scene, &["--record", record.to_str().unwrap()]));
    }
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let mesh = write(&folder, "mesh.ply", ply);
    assert!(
        refused(&["sample", &mesh, "--points", "10", "--out", &mesh])
            .contains("it is the mesh itself")
    );
    assert_eq!(std::fs::read_to_string(&mesh).unwrap(), ply);
}

#[cfg(unix)]
#[test]
fn links_are_followed_and_pipes_are_left_alone() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let scene = write(&folder, "disc.json", DISC);
    std::os::unix::fs::symlink(at("target.work"), at("link.work")).unwrap();
    write(&folder, "target.work", "");
    done(&small_run(&scene, &["--record", &at("link.work")]));
    assert!(
        std::fs::symlink_metadata(at("link.work"))
            .unwrap()
            .is_symlink()
    );
    assert!(std::fs::metadata(at("target.work")).unwrap().len() > 100);

    let made = std::process::Command::new("mkfifo")
        .arg(at("pipe"))
        .status()
        .unwrap();
    assert!(made.success());
    assert!(refused(&small_run(&scene, &["--record", &at("pipe")])).contains("not a recording"));
    let film = DISC.replacen(
        r#""camera": {"eye": [0, 0, 4], "target": [0, 0, 0]}"#,
        r#""camera_path": {"pan_pixels": 1.0, "frames": 2}"#,
        1,
    );
    let film = write(&folder, "film.json", film);
    assert!(refused(&small_run(&film, &["--y4m", &at("pipe")])).contains("is not a file"));
    assert!(!std::fs::metadata(at("pipe")).unwrap().is_file());
}

#[test]
fn a_refused_unit_command_empties_no_file() {
    let folder = folder();
    let scene = write(&folder, "disc.json", DISC);
    let held = write(&folder, "held.hex", "precious\n");
    let unit = |input: &str| {
        let arguments = ["unit", "fragment", "--scene", &scene, "--held", &held];
        Command::new(PROGRAM.as_str())
            .args(arguments)
            .write_stdin(input)
            .output()
            .unwrap()
    };
    assert_eq!(unit("zzz\n").status.code(), Some(2));
    assert_eq!(std::fs::read_to_string(&held).unwrap(), "precious\n");
    assert_eq!(unit("").status.code(), Some(0));
    assert!(!std::fs::read_to_string(&held).unwrap().contains("precious"));
}

#[test]
fn files_of_an_earlier_run_do_not_lie_beside_the_new_ones() {
    let folder = folder();
    let scene = write(&folder, "disc.json", DISC);
    let out = folder.path().join("out");
    let to = ["--out", out.to_str().unwrap()];
    done(&small_run(
        &scene,
        &[
            &to[..],
            &[
                "--attribute",
                "--requests",
                "--exr",
                "--timing",
                "timing.raster.fifo=1,2",
            ],
        ]
        .concat(),
    ));
    let all = names_in(&out);
    assert!(
        [
            "attribution.png",
            "timings.png",
            "fixed.exr",
            "requests.dramsim3"
        ]
        .iter()
        .all(|name| all.iter().any(|other| other == name))
    );
    done(&small_run(
        &scene,
        &[&to[..], &["--check", "none"]].concat(),
    ));
    let plain = names_in(&out);
    let again = folder.path().join("again");
    done(&small_run(
        &scene,
        &["--out", again.to_str().unwrap(), "--check", "none"],
    ));
    assert_eq!(plain, names_in(&again));
}

#[test]
fn more_cases_than_memory_holds_are_refused() {
    let folder = folder();
    let scene = write(&folder, "disc.json", DISC);
    let out = folder.path().join("trace");
    let arguments = [
        "trace",
        &scene,
        "--stimulus",
        "4294967295",
        "--units",
        "gauss",
        "--out",
        out.to_str().unwrap(),
    ];
    assert!(refused(&arguments).contains("at most 5000000 cases per unit"));
    assert!(!out.exists());
}

#[test]
fn a_run_without_lockstep_states_why_it_cannot_be_compared() {
    let folder = folder();
    let scene = write(&folder, "disc.json", DISC);
    let out = folder.path().join("out").to_string_lossy().into_owned();
    done(&small_run(&scene, &["--out", &out, "--check", "none"]));
    assert!(refused(&["compare", &out, &out]).contains("--check none"));
}

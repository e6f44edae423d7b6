//! Recorded work in a file: read as it was written, replayed with the results of the run, and
//! refused if it is damaged.

use crate::program::PROGRAM;
use crate::tier::{self, Tier};
use rtl_model::Machine;
use rtl_model::timing::{self, Detail};
use rtl_model::work::Work;
use serde_json::Value;
use splatsim::hardware::{fixed, machines, quantise};
use splatsim::performance::recording::Recording;
use splatsim::scene::{Overrides, Scene};
use std::path::PathBuf;
use std::process::{Command, Output};

/// A surface, a volume and Gaussians.
const SCENES: [&str; 3] = ["torus-knot", "nested-shells", "bouquet"];

fn recorded(scene: &str, size: (usize, usize)) -> Recording {
    let scene = Scene::load(scene, &Overrides { size: Some(size) }).unwrap();
    let machine = Machine::named(machines::usual(&scene)).unwrap();
    let quantised = quantise::quantise(&scene, &machine).unwrap();
    let (_, _, work) = fixed::draw_measured(&fixed::elaborate(&machine).unwrap(), &quantised);
    Recording {
        scene: scene.name,
        machine,
        work,
    }
}

fn splatsim(arguments: &[&str]) -> Output {
    Command::new(PROGRAM.as_str())
        .args(arguments)
        .output()
        .unwrap()
}

#[test]
fn a_record_that_is_read_is_the_one_that_was_written() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for scene in SCENES {
        let path = folder.path().join(scene);
        let recording = recorded(scene, (70, 45));
        recording.clone().write(&path).unwrap();
        assert_eq!(Recording::read(&path).unwrap(), recording, "{scene}");
    }
}

#[test]
fn a_replay_takes_the_cycles_of_the_run() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let json =
        |path: String| -> Value { serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap() };
    let (out, record, replayed) = (path("run"), path("frame.work"), path("replay"));
    let timing = "timing.raster.fifo=1,4";
    let run = splatsim(&[
        "run",
        "checkerboard",
        "--size",
        "64x64",
        "--out",
        &out,
        "--record",
        &record,
        "--timing",
        timing,
    ]);
    assert!(
        run.status.success() && String::from_utf8_lossy(&run.stdout).contains("work recorded in "),
        "{run:?}"
    );
    let replay = splatsim(&[
        "replay",
        &record,
        "--out",
        &replayed,
        "--timing",
        timing,
        "--requests",
    ]);
    assert!(replay.status.success(), "{replay:?}");
    assert_eq!(
        json(path("run/report.json"))["cycles"],
        json(path("replay/cycles.json"))
    );
    for name in ["cycles.png", "cycles.csv", "timings.png"] {
        let [run, replay] = ["run", "replay"]
            .map(|folder| std::fs::read(path(&format!("{folder}/{name}"))).unwrap());
        assert!(run == replay, "{name}");
    }
    let text = String::from_utf8_lossy(&replay.stdout).into_owned();
    assert!(text.starts_with("checkerboard on reference: "), "{text}");
    assert!(
        text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );

    // Another timing, compared with a run with this timing.
    let slow = splatsim(&[
        "replay",
        &record,
        "--set",
        "timing.ellipse.interval=40",
        "--out",
        &replayed,
        "--quiet",
    ]);
    assert!(slow.status.success() && slow.stdout.is_empty(), "{slow:?}");
    let set = ["--set", "timing.ellipse.interval=40"];
    let run = splatsim(
        &[
            &["run", "checkerboard", "--size", "64x64", "--out", &out][..],
            &set,
        ]
        .concat(),
    );
    assert!(run.status.success());
    assert_eq!(
        json(path("run/report.json"))["cycles"],
        json(path("replay/cycles.json"))
    );
}

#[test]
fn a_replay_has_the_area_and_energy_of_the_run_at_any_digit_of_the_sort() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let json =
        |path: String| -> Value { serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap() };
    let (out, record, replayed) = (path("run"), path("frame.work"), path("replay"));
    let scene = ["bouquet", "--size", "32x24"];
    assert!(
        splatsim(&[&["run"], &scene[..], &["--record", &record]].concat())
            .status
            .success()
    );
    let mut areas = Vec::new();
    for digit in ["4", "8", "12"] {
        let set = format!("sort.digit_bits={digit}");
        let run = splatsim(
            &[
                &["run"],
                &scene[..],
                &["--set", &set, "--out", &out, "--quiet"],
            ]
            .concat(),
        );
        let replay = splatsim(&["replay", &record, "--set", &set, "--out", &replayed]);
        assert!(
            run.status.success() && replay.status.success(),
            "{replay:?}"
        );
        let report = json(path("run/report.json"));
        assert_eq!(
            (&report["cycles"], &report["cost"]),
            (
                &json(path("replay/cycles.json")),
                &json(path("replay/cost.json"))
            ),
            "{digit}"
        );
        let told = String::from_utf8(replay.stdout).unwrap();
        let millijoules = format!(
            "energy: {:.2} mJ a frame",
            report["cost"]["energy"]["total"].as_f64().unwrap() * 1e3
        );
        assert!(
            told.contains("\narea: ") && told.contains(&millijoules),
            "{told}"
        );
        areas.push(report["cost"]["area"].as_f64().unwrap());
    }
    assert!(areas[0] < areas[2], "{areas:?}");
}

/// Tests of tiles give the same picture, and have the same cycles in a replay as in a run; they need
/// a record with the words of splats.
#[test]
fn a_replay_has_the_cycles_of_the_run_with_any_test_of_tiles() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let json =
        |path: String| -> Value { serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap() };
    let scene = ["run", "bouquet", "--size", "32x24", "--quiet"];
    let (record, with_words, replayed) = (path("frame.work"), path("words.work"), path("replay"));
    let (mut pictures, mut entries) = (Vec::new(), Vec::new());
    let masks = [
        ["bin.subtile_px=4", "bin.mask_tests=3"],
        ["bin.subtile_px=8", "bin.masks=list"],
        ["timing.tile.side_px=12", "timing.engines=2"],
    ];
    for (test, record, masks) in [
        ("ellipse", &with_words, None),
        ("oriented-box", &with_words, None),
        ("box", &record, None),
        ("ellipse", &with_words, Some(masks[0])),
        ("oriented-box", &with_words, Some(masks[1])),
        ("ellipse", &with_words, Some(masks[2])),
    ] {
        let (out, set) = (path("run"), format!("bin.test={test}"));
        let mut set = vec!["--set", &set];
        set.extend(masks.iter().flatten().flat_map(|set| ["--set", *set]));
        let run = splatsim(&[&scene[..], &set, &["--out", &out]].concat());
        assert!(run.status.success(), "{run:?}");
        if test != "oriented-box" && masks.is_none() {
            let recorded = splatsim(&[&scene[..], &set, &["--record", record]].concat());
            assert!(recorded.status.success(), "{recorded:?}");
        }
        let replay = splatsim(
            &[
                &["replay", &with_words],
                &set[..],
                &["--out", &replayed, "--quiet"],
            ]
            .concat(),
        );
        assert!(replay.status.success(), "{replay:?}");
        let report = json(path("run/report.json"));
        assert_eq!(
            (&report["cycles"], &report["cost"]),
            (
                &json(path("replay/cycles.json")),
                &json(path("replay/cost.json"))
            ),
            "{test} {masks:?}"
        );
        pictures.push(std::fs::read(path("run/fixed.png")).unwrap());
        let tests = &report["cycles"]["tile_tests"];
        entries.push(["entries", "tiles"].map(|count| tests[count].as_u64()));
        assert_eq!(tests.is_null(), test == "box");
        let has_masks = masks.is_some_and(|masks| masks[0].contains("subtile"));
        assert_eq!(tests["masks"]["subtiles_tested"].is_u64(), has_masks);
    }
    assert!(pictures.windows(2).all(|pair| pair[0] == pair[1]));
    let [ellipse, oriented] = [entries[0], entries[1]];
    assert!(
        ellipse[0] <= oriented[0] && ellipse[0] < ellipse[1] && ellipse[1] == oriented[1],
        "{entries:?}"
    );
    // Records without tests have not changed.
    let begins = |path: &str| std::fs::read(path).unwrap()[..16].to_vec();
    assert_eq!(
        [begins(&record), begins(&with_words)],
        [b"splatsim-work-5\n".to_vec(), b"splatsim-work-7\n".to_vec()]
    );
    let refused = splatsim(&[
        "replay",
        &record,
        "--set",
        "bin.test=ellipse",
        "--out",
        &replayed,
    ]);
    let told = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(
        refused.status.code() == Some(2)
            && told.contains("the record lacks the words of its splats")
            && told.lines().count() == 1,
        "{told}"
    );
    // A file that is cut off or has other words is damaged.
    let bytes = std::fs::read(&with_words).unwrap();
    let broken = path("broken.work");
    std::fs::write(&broken, &bytes[..bytes.len() - 9]).unwrap();
    let refused = splatsim(&["replay", &broken, "--out", &replayed]);
    assert_eq!(refused.status.code(), Some(2), "{refused:?}");
}

/// Other kinds of the sort have the same cycles in a replay as in a run; buckets need a record with
/// keys.
#[test]
fn a_replay_has_the_cycles_of_the_run_with_any_kind_of_sort() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let json =
        |path: String| -> Value { serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap() };
    let scene = [
        "run", "bouquet", "--size", "32x24", "--check", "none", "--quiet",
    ];
    let sizes = [
        "--set",
        "timing.sort={\"units\": 2, \"buffer_entries\": 8, \"network\": 4}",
    ];
    let (record, with_keys, replayed) = (path("frame.work"), path("keys.work"), path("replay"));
    assert!(
        splatsim(&[&scene[..], &["--record", &record]].concat())
            .status
            .success()
    );
    let radix = path("radix");
    assert!(
        splatsim(&[&scene[..], &["--out", &radix]].concat())
            .status
            .success()
    );
    let mut pictures = vec![std::fs::read(path("radix/fixed.png")).ok()];
    for (kind, from) in [
        ("sort.kind=tile", &record),
        ("sort.kind=hierarchical", &with_keys),
        ("sort.kind=tile", &with_keys),
    ] {
        let out = path("run");
        let set = [&["--set", kind][..], &sizes].concat();
        let run = splatsim(&[&scene[..], &set, &["--out", &out]].concat());
        assert!(run.status.success(), "{run:?}");
        pictures.push(std::fs::read(path("run/fixed.png")).ok());
        if kind.ends_with("hierarchical") {
            assert!(
                splatsim(&[&scene[..], &set, &["--record", &with_keys]].concat())
                    .status
                    .success()
            );
        }
        let replay = splatsim(
            &[
                &["replay", from],
                &set[..],
                &["--out", &replayed, "--what-if", "--quiet"],
            ]
            .concat(),
        );
        assert!(replay.status.success(), "{replay:?}");
        let report = json(path("run/report.json"));
        assert_eq!(
            (&report["cycles"], &report["cost"]),
            (
                &json(path("replay/cycles.json")),
                &json(path("replay/cost.json"))
            ),
            "{kind}"
        );
    }
    assert!(
        pictures
            .windows(2)
            .all(|pair| pair[0].is_some() && pair[0] == pair[1])
    );
    // Records without buckets have not changed.
    let begins = |path: &str| std::fs::read(path).unwrap()[..16].to_vec();
    assert_eq!(
        [begins(&record), begins(&with_keys)],
        [b"splatsim-work-5\n".to_vec(), b"splatsim-work-6\n".to_vec()]
    );
    for (set, sentence) in [
        (
            "sort.kind=hierarchical",
            "the record lacks the keys of its splats, which buckets depend on: record the frame with sort.kind=hierarchical",
        ),
        (
            "sort.tile_bits=1",
            "sort.tile_bits is 1, and the picture has 4 tiles of 16×16 pixels: 2 bits are needed",
        ),
        (
            "sort.key=U1F12",
            "only fields below `timing` can change, and sort.kind, sort.tile_bits, sort.digit_bits, bin.test, bin.tiles_per_cycle, bin.subtile_px, bin.masks and bin.mask_tests",
        ),
    ] {
        let refused = splatsim(&["replay", &record, "--set", set, "--out", &replayed]);
        let told = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(
            refused.status.code() == Some(2)
                && told.contains(sentence)
                && told.lines().count() == 1,
            "{set}: {told}"
        );
    }
    let refused = splatsim(
        &[
            &scene[..],
            &["--set", "sort.tile_bits=1", "--out", &replayed],
        ]
        .concat(),
    );
    let told = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(
        refused.status.code() == Some(2) && told.contains("2 bits are needed"),
        "{told}"
    );
    // Keys that end too early, keys of another order, and keys that were not written by a run.
    let whole = std::fs::read(&with_keys).unwrap();
    assert!(
        refusal(&whole[..whole.len() - 1])
            .unwrap()
            .contains("its keys are truncated")
    );
    let splats = Recording::read(with_keys.as_ref())
        .unwrap()
        .work
        .order
        .len();
    let mut other = whole.clone();
    let end = other.len();
    other[end - splats..].fill(0);
    assert!(refusal(&other).is_some());
    let mut without = Recording::read(with_keys.as_ref()).unwrap();
    without.work.keys.clear();
    assert!(
        refusal(&bytes(without))
            .unwrap()
            .contains("its machine has buckets, but it has no keys")
    );
}

fn refusal(bytes: &[u8]) -> Option<String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.work");
    std::fs::write(&path, bytes).unwrap();
    Recording::read(&path).err().map(|error| error.to_string())
}

fn bytes(recording: Recording) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.work");
    recording.write(&path).unwrap();
    std::fs::read(path).unwrap()
}

/// Truncated files, and files with a thousand different flipped bits: each is refused or can be
/// replayed.
#[test]
fn no_damage_is_taken_for_a_record() {
    let small = bytes(Recording {
        scene: "x".into(),
        ..recorded("bouquet", (40, 24))
    });
    let shorts = (0..small.len()).step_by(small.len() / 300);
    for short in tier::some([12, 6], shorts) {
        assert!(refusal(&small[..short]).is_some(), "{short} bytes");
    }
    let more = [&small[..], b"x"].concat();
    assert!(
        refusal(&more)
            .unwrap()
            .contains("it has data after its end")
    );
    let mut rng = 1_u64;
    let mut roll = |below: usize| {
        rng = rng
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (rng >> 33) as usize % below
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.work");
    let (mut refused, mut replayed) = (0, 0);
    for number in 0..400 {
        let mut damaged = small.clone();
        let at = roll(damaged.len());
        damaged[at] ^= 1 << roll(8);
        if !tier::has([12, 6], number) {
            continue;
        }
        std::fs::write(&path, &damaged).unwrap();
        match Recording::read(&path) {
            Err(error) => {
                assert!(
                    error.to_string().starts_with(path.to_str().unwrap()),
                    "{error}"
                );
                refused += 1;
            }
            Ok(recording) => {
                recording.replay(&[], false, None).unwrap();
                replayed += 1;
            }
        }
    }
    // Some contents, such as the kept pixels, cannot be validated.
    assert!(
        refused > tier::of([12, 6], 120) && replayed > tier::of([12, 6], 20),
        "{refused} {replayed}"
    );
}

/// A short file that requests a large allocation.
#[test]
fn a_record_of_boxes_without_end_takes_no_memory() {
    let Recording {
        scene,
        machine,
        work,
    } = recorded("torus-knot", (40, 24));
    let large = |change: &dyn Fn(&mut Work)| {
        let mut work = work.clone();
        (work.width, work.height) = (8192, 4096);
        change(&mut work);
        refusal(&bytes(Recording {
            scene: scene.clone(),
            machine: machine.clone(),
            work,
        }))
        .unwrap()
    };
    let all = |work: &mut Work| {
        work.footprints
            .iter_mut()
            .for_each(|f| (f.columns, f.rows) = ([0, 8191], [0, 4095]))
    };
    assert!(large(&all).contains("its tiles are not those of its splats"));
    assert!(
        large(&|work| work.footprints[0].rows = [9, 3])
            .contains("a box lies outside of the picture")
    );
    assert!(large(&|work| work.width = u32::MAX).contains("pixels; at most"));
    assert!(
        large(&|work| work.order = vec![0; work.footprints.len()])
            .contains("its order leaves splats out")
    );
    assert!(
        large(&|work| work.cull_reasons.truncate(1))
            .contains("its boxes are not those of its splats")
    );
}

#[test]
fn files_without_a_record_and_changes_of_the_picture_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| -> PathBuf { folder.path().join(name) };
    recorded("checkerboard", (32, 32))
        .write(&path("frame.work"))
        .unwrap();
    std::fs::write(path("other"), "splats").unwrap();
    let record = path("frame.work").to_str().unwrap().to_owned();
    let told = |arguments: &[&str], part: &str| {
        let output = splatsim(arguments);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(
            output.status.code() == Some(2) && error.contains(part) && error.lines().count() == 1,
            "{arguments:?}: {error}"
        );
    };
    told(
        &["replay", path("other").to_str().unwrap()],
        "is not a record of a frame's work",
    );
    told(
        &["replay", path("nowhere").to_str().unwrap()],
        "cannot be read",
    );
    told(
        &["run", "--record", path("gone/frame.work").to_str().unwrap()],
        "there is no folder",
    );
    told(
        &["run", "--record", folder.path().to_str().unwrap()],
        "it is a folder, and a file is needed",
    );
    told(
        &["replay", &record, "--set", "gauss.weight=U1F3"],
        "only fields below `timing` can change",
    );
    told(
        &["replay", &record, "--set", "timing.raster.lanes=[0,1]"],
        "lanes",
    );
    told(
        &["replay", &record, "--timing", "timing.nothing=1"],
        "nothing",
    );
}

/// The basic law: the replay of a record equals the replay of its work.
#[test]
fn the_cycles_are_those_of_the_work() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    for scene in SCENES {
        let recording = recorded(scene, (70, 45));
        let elaborated = fixed::elaborate(&recording.machine).unwrap();
        assert_eq!(
            recording.replay(&[], false, None).unwrap().cycles.total,
            timing::replay(&elaborated.timing, &recording.work, Detail::Accounts).total
        );
    }
}

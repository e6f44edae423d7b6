//! Does a machine with a memory preset have the memory of the data sheet, and do explicit fields
//! override it?

use crate::program::PROGRAM;
use rtl_model::machine::timing::{Memory, Preset};
use rtl_model::timing::{Detail, replay};
use serde_json::json;
use splatsim::hardware::{fixed, machines};
use splatsim::run::evaluation::Evaluation;
use splatsim::scene::{Overrides, Scene};
use std::process::{Command, Output};

fn splatsim(arguments: &[&str]) -> Output {
    Command::new(PROGRAM.as_str())
        .args(arguments)
        .output()
        .unwrap()
}

/// Memory of the reference machine with these settings, with all fields filled in.
fn memory(settings: &[&str]) -> Memory {
    let settings: Vec<String> = settings
        .iter()
        .map(|setting| (*setting).to_owned())
        .collect();
    fixed::elaborate(&machines::load("reference", &settings).unwrap())
        .unwrap()
        .timing
        .timing
        .memory
}

#[test]
fn a_preset_replaces_the_memory_of_a_machine_and_later_settings_change_it() {
    // 32 GB/s per channel, 8 channels, at 400 MHz.
    let hbm2 = memory(&["timing.memory.preset=hbm2"]);
    assert_eq!(
        (
            hbm2.bytes_per_cycle,
            hbm2.channels(),
            hbm2.burst_bytes,
            hbm2.outstanding
        ),
        (80, 8, 64, 16)
    );
    let changed = memory(&[
        "timing.memory.preset=hbm2",
        "timing.memory.channels=2",
        "timing.memory.bytes_per_cycle=16",
    ]);
    assert_eq!(
        changed,
        Memory {
            channels: Some(2),
            bytes_per_cycle: 16,
            ..hbm2
        }
    );
    // Fields that were set before the preset are replaced by it.
    assert_eq!(
        memory(&["timing.memory.channels=2", "timing.memory.preset=hbm2"]),
        hbm2
    );
    let other = memory(&[
        "timing.memory.preset=hbm2",
        "timing.memory.preset=ddr5-4800",
    ]);
    assert_eq!((other.preset, other.channels()), (Some(Preset::Ddr5), 2));
}

#[test]
fn every_field_that_a_preset_fills_is_one_that_it_replaces() {
    let filled = serde_json::to_value(memory(&["timing.memory.preset=hbm2"])).unwrap();
    let filled: Vec<&String> = filled
        .as_object()
        .unwrap()
        .keys()
        .filter(|name| !["preset", "ideal", "outstanding"].contains(&name.as_str()))
        .collect();
    let mut replaced = Memory::FILLED.to_vec();
    replaced.sort_unstable();
    let mut filled: Vec<&str> = filled.iter().map(|name| name.as_str()).collect();
    filled.sort_unstable();
    assert_eq!(filled, replaced);
}

#[test]
fn a_machine_file_with_a_preset_needs_no_other_number_of_memory() {
    let folder = tempfile::tempdir().unwrap();
    let load = |description: serde_json::Value| {
        let path = folder.path().join("machine.json");
        std::fs::write(&path, description.to_string()).unwrap();
        machines::load(&path, &[]).unwrap()
    };
    let mut whole = machines::value(&machines::load("reference", &[]).unwrap());
    whole["timing"]["memory"] = json!({"preset": "ddr5-4800", "outstanding": 16, "ranks": 2});
    let based =
        json!({"base": "reference", "timing": {"memory": {"preset": "ddr5-4800", "ranks": 2}}});
    let [whole, based] = [whole, based].map(|description| {
        fixed::elaborate(&load(description))
            .unwrap()
            .timing
            .timing
            .memory
    });
    assert_eq!(whole, based);
    assert_eq!(
        whole,
        Memory {
            ranks: Some(2),
            ..memory(&["timing.memory.preset=ddr5-4800"])
        }
    );
}

#[test]
fn an_unknown_memory_preset_is_refused_with_the_known_ones() {
    for (setting, says) in [
        (
            "timing.memory.preset=ddr6",
            "must be one of lpddr4-3200-x4, lpddr5-6400-x4, ddr5-4800, hbm2",
        ),
        (
            "timing.memory.channels=3",
            "timing.memory.channels is 3: it must be a power of two up to 64",
        ),
        ("timing.memory.channels=0", "timing.memory.channels is 0"),
        (
            "timing.memory.interleave_bytes=16",
            "timing.memory.interleave_bytes is 16: a burst of 64 bytes",
        ),
    ] {
        let output = splatsim(&["machine", "show", "reference", "--set", setting]);
        let output = if output.status.success() {
            splatsim(&["machine", "timing", "reference", "--set", setting])
        } else {
            output
        };
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!(
            (output.status.code(), told.trim_end().lines().count()),
            (Some(2), 1),
            "{told}"
        );
        assert!(told.contains(says), "{told}");
    }
}

/// Frames of a built-in scene: with twice the channels they are never slower, and the bytes are the
/// same.
#[test]
fn a_frame_is_no_slower_with_more_channels() {
    let scene = Scene::load(
        "glass-spheres",
        &Overrides {
            size: Some((64, 48)),
        },
    )
    .unwrap();
    let machine = |channels: u32| {
        let settings = [
            "timing.memory.preset=lpddr4-3200-x4".to_owned(),
            format!("timing.memory.channels={channels}"),
        ];
        fixed::elaborate(&machines::load("reference", &settings).unwrap()).unwrap()
    };
    let work = Evaluation::on(&scene, &machine(1)).unwrap().observe().work;
    let cycles =
        [1, 2, 4, 8].map(|channels| replay(&machine(channels).timing, &work, Detail::Accounts));
    for pair in cycles.windows(2) {
        assert!(
            pair[1].total <= pair[0].total,
            "{} and {} cycles",
            pair[0].total,
            pair[1].total
        );
        assert_eq!(pair[0].memory.bytes, pair[1].memory.bytes);
        assert!(
            pair[1].memory.busy <= pair[0].memory.busy.div_ceil(2),
            "{} and {} busy",
            pair[0].memory.busy,
            pair[1].memory.busy
        );
    }
}

//! Does each RTL implementation agree with the live model, over DPI-C, on random records that are
//! in no trace?

use crate::tier::{self, Tier};
use crate::traced::{Traced, bouquet, cloud, machine, shells, traced};
use crate::{is_installed, libraries, root, run};
use serde_json::json;
use splatsim::cosim::trace::Window;
use std::path::{Path, PathBuf};
use std::process::Command;

/// An RTL implementation that the bench can drive.
#[derive(Clone, Copy, Debug)]
struct RtlUnit {
    module: &'static str,
    unit: &'static str,
    machine: &'static str,
    macros: &'static [&'static str],
}

const fn of(unit: &'static str, macros: &'static [&'static str]) -> RtlUnit {
    RtlUnit {
        module: unit,
        unit,
        machine: "reference",
        macros,
    }
}

const HOLDS: [&str; 3] = ["HAS_FRAME", "HAS_DRAIN", "HAS_HELD"];
const REQUESTS: [&str; 4] = ["HAS_FRAME", "HAS_DRAIN", "HAS_HELD", "HAS_SHADE"];

const RTL_UNITS: [RtlUnit; 11] = [
    of("project", &["HAS_FRAME"]),
    of("ellipse", &["HAS_FRAME"]),
    of("raster", &["HAS_FRAME", "HAS_CORNER"]),
    of("gauss", &["HAS_LEAST"]),
    of("fragment", &REQUESTS),
    of("shade", &["HAS_FRAME", "HAS_LIGHTING"]),
    of("resolve", &["HAS_FRAME"]),
    RtlUnit {
        module: "ellipsoid",
        unit: "ellipse",
        machine: "gaussian",
        macros: &["HAS_FRAME"],
    },
    RtlUnit {
        module: "sheets",
        unit: "fragment",
        machine: "gaussian",
        macros: &HOLDS,
    },
    RtlUnit {
        module: "sheets",
        unit: "fragment",
        machine: "volume",
        macros: &HOLDS,
    },
    RtlUnit {
        module: "windows",
        unit: "fragment",
        machine: "window",
        macros: &REQUESTS,
    },
];

/// A trace for its package, its tables and its constants; it has almost no records.
fn package(rtl_unit: RtlUnit) -> Traced {
    let text = match rtl_unit.machine {
        "gaussian" => bouquet(20, 16, &json!({"stop": 0.2})),
        "volume" => shells(10, 16, &json!({"stop": 0.6})),
        _ => cloud(4, 16),
    };
    traced(
        &text,
        &machine(rtl_unit.machine, &["timing.raster.lanes=[1,1]"]),
        &Window {
            units: vec!["gauss".into()],
            ..Window::default()
        },
    )
}

fn rtl() -> PathBuf {
    root().join("../../rtl_model/rtl").canonicalize().unwrap()
}

/// The RTL implementation and the bench, linked with the library.
fn simulation(rtl_unit: RtlUnit, trace: &Traced) -> PathBuf {
    let folder = trace.path(&format!("live-{}", rtl_unit.module));
    let upper = rtl_unit.unit.to_uppercase();
    let libraries = libraries();
    let mut verilator = Command::new("verilator");
    if Command::new("ccache").arg("--version").output().is_ok() {
        verilator.env("OBJCACHE", "ccache");
    }
    let mut defines = vec![
        format!("-DDUT={}", rtl_unit.module),
        format!("-DUNIT=\"{}\"", rtl_unit.unit),
        format!("-DIN_W=machine_pkg::{upper}_IN_W"),
        format!("-DOUT_W=machine_pkg::{upper}_OUT_W"),
    ];
    defines.extend(rtl_unit.macros.iter().map(|name| format!("-D{name}")));
    if rtl_unit.macros.contains(&"HAS_DRAIN") {
        defines.push("-DDUT_PARAMETERS=.WIDTH(16),.HEIGHT(16)".into());
    }
    run(verilator
        .args([
            "--binary",
            "--timing",
            "--assert",
            "-O3",
            "-j",
            "2",
            "-Wno-fatal",
            "--top-module",
            "live",
            "-MAKEFLAGS",
            "OPT_FAST=-O2",
        ])
        .arg("--Mdir")
        .arg(&folder)
        .args(defines)
        .arg("-LDFLAGS")
        .arg(format!(
            "-L{0} -lsplatsim_c -Wl,-rpath,{0}",
            libraries.display()
        ))
        .arg("-y")
        .arg(rtl())
        .args([
            trace.path("machine_pkg.sv"),
            trace.path("splatsim_dpi.sv"),
            rtl().join("bench/live.sv"),
        ]));
    folder.join("Vlive")
}

/// The bench's last line, in a folder with the machine and the scene of the model, and the tables
/// of the RTL implementation.
fn last_line(simulation: &Path, folder: &Path, records: u32, stall: u32) -> String {
    // A stalled run uses other records.
    let source = 1 + stall;
    let output = Command::new(simulation)
        .current_dir(folder)
        .args([
            format!("+records={records}"),
            format!("+stall={stall}"),
            format!("+source={source}"),
        ])
        .output()
        .unwrap();
    let text = [&output.stdout[..], &output.stderr[..]]
        .map(String::from_utf8_lossy)
        .concat();
    text.lines()
        .filter(|line| line.contains("splatsim: ") || line.contains("live: "))
        .collect::<Vec<_>>()
        .join("\n")
}

fn compared(line: &str) -> u32 {
    let (_, count) = line
        .split_once("compared=")
        .unwrap_or_else(|| panic!("{line}"));
    assert!(line.starts_with("live: done"), "{line}");
    count.trim().parse().unwrap()
}

#[test]
fn the_live_model_agrees_with_an_rtl_unit_and_names_a_difference() {
    if !is_installed("verilator") {
        return;
    }
    let gauss = RTL_UNITS[3];
    let trace = package(gauss);
    let simulation = simulation(gauss, &trace);
    assert!(compared(&last_line(&simulation, &trace.folder, 20_000, 30)) >= 20_000);
    // The same RTL implementation with a model of another machine.
    let other = machine(
        "reference",
        &[
            "timing.raster.lanes=[1,1]",
            "gauss.table.interpolation=nearest",
        ],
    );
    std::fs::write(
        trace.path("machine.json"),
        serde_json::to_string(&other).unwrap(),
    )
    .unwrap();
    let line = last_line(&simulation, &trace.folder, 20_000, 0);
    assert!(
        line.contains("field weight is") && line.contains("live: FAILED: record"),
        "{line}"
    );
    // The fault names the time and the input record.
    let fault = line
        .lines()
        .find(|line| line.contains("field weight is"))
        .unwrap();
    let time: u64 = fault
        .split_once("splatsim: at ")
        .unwrap()
        .1
        .split_once(" ns: ")
        .unwrap()
        .0
        .parse()
        .unwrap();
    assert!(
        time > 0 && fault.contains("made from record") && fault.contains("of gauss.in: radial "),
        "{fault}"
    );
}

#[test]
fn the_bench_may_stop_inside_a_pixel_of_resolve() {
    if !is_installed("verilator") {
        return;
    }
    let trace = package(RTL_UNITS[6]);
    let simulation = simulation(RTL_UNITS[6], &trace);
    // Some of these counts end inside a pixel.
    for records in 100..110 {
        assert!(compared(&last_line(&simulation, &trace.folder, records, 0)) >= records);
    }
}

#[test]
fn every_rtl_unit_agrees_with_the_live_model_on_a_million_random_records() {
    if !tier::runs(Tier::Full) {
        return;
    }
    if !is_installed("verilator") {
        return;
    }
    // Two in parallel: a compiler keeps one core busy.
    let mine: Vec<RtlUnit> = tier::some([12, 12], RTL_UNITS).collect();
    for pair in mine.chunks(2) {
        std::thread::scope(|scope| {
            pair.iter()
                .for_each(|rtl_unit| drop(scope.spawn(|| a_million(*rtl_unit))))
        });
    }
}

fn a_million(rtl_unit: RtlUnit) {
    let trace = package(rtl_unit);
    let simulation = simulation(rtl_unit, &trace);
    // Half of the records with stalls, half without.
    for stall in [0, 25] {
        let line = last_line(&simulation, &trace.folder, 500_000, stall);
        println!("{} of {}: {line}", rtl_unit.module, rtl_unit.machine);
        assert!(compared(&line) >= 500_000);
    }
}

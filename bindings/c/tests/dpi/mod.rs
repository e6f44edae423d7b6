//! Does each twin say what the live model says, over DPI-C, of random records that no trace has?

use crate::tier::{self, Tier};
use crate::traced::{Traced, bouquet, cloud, machine, shells, traced};
use crate::{have, libraries, root, run};
use serde_json::json;
use splatsim::cosim::trace::Window;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A twin that the bench can drive.
#[derive(Clone, Copy, Debug)]
struct Twin {
    module: &'static str,
    unit: &'static str,
    machine: &'static str,
    macros: &'static [&'static str],
}

const fn of(unit: &'static str, macros: &'static [&'static str]) -> Twin {
    Twin {
        module: unit,
        unit,
        machine: "reference",
        macros,
    }
}

const HOLDS: [&str; 3] = ["HAS_FRAME", "HAS_DRAIN", "HAS_HELD"];
const ASKS: [&str; 4] = ["HAS_FRAME", "HAS_DRAIN", "HAS_HELD", "HAS_SHADE"];

const TWINS: [Twin; 11] = [
    of("project", &["HAS_FRAME"]),
    of("ellipse", &["HAS_FRAME"]),
    of("raster", &["HAS_FRAME", "HAS_CORNER"]),
    of("gauss", &["HAS_LEAST"]),
    of("fragment", &ASKS),
    of("shade", &["HAS_FRAME", "HAS_LIGHTING"]),
    of("resolve", &["HAS_FRAME"]),
    Twin {
        module: "ellipsoid",
        unit: "ellipse",
        machine: "gaussian",
        macros: &["HAS_FRAME"],
    },
    Twin {
        module: "sheets",
        unit: "fragment",
        machine: "gaussian",
        macros: &HOLDS,
    },
    Twin {
        module: "sheets",
        unit: "fragment",
        machine: "volume",
        macros: &HOLDS,
    },
    Twin {
        module: "windows",
        unit: "fragment",
        machine: "window",
        macros: &ASKS,
    },
];

/// A trace for its package, its tables and its constants: of records it has next to none.
fn package(twin: Twin) -> Traced {
    let text = match twin.machine {
        "gaussian" => bouquet(20, 16, &json!({"stop": 0.2})),
        "volume" => shells(10, 16, &json!({"stop": 0.6})),
        _ => cloud(4, 16),
    };
    traced(
        &text,
        &machine(twin.machine, &["timing.raster.lanes=[1,1]"]),
        &Window {
            units: vec!["gauss".into()],
            ..Window::default()
        },
    )
}

fn rtl() -> PathBuf {
    root().join("../../rtl_model/rtl").canonicalize().unwrap()
}

/// The twin and the bench, linked with the library.
fn simulation(twin: Twin, trace: &Traced) -> PathBuf {
    let folder = trace.path(&format!("live-{}", twin.module));
    let upper = twin.unit.to_uppercase();
    let libraries = libraries();
    let mut verilator = Command::new("verilator");
    if Command::new("ccache").arg("--version").output().is_ok() {
        verilator.env("OBJCACHE", "ccache");
    }
    let mut defines = vec![
        format!("-DDUT={}", twin.module),
        format!("-DUNIT=\"{}\"", twin.unit),
        format!("-DIN_W=machine_pkg::{upper}_IN_W"),
        format!("-DOUT_W=machine_pkg::{upper}_OUT_W"),
    ];
    defines.extend(twin.macros.iter().map(|name| format!("-D{name}")));
    if twin.macros.contains(&"HAS_DRAIN") {
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
/// of the twin.
fn told(simulation: &Path, folder: &Path, records: u32, stall: u32) -> String {
    // Other records where it is stalled.
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

fn compared(told: &str) -> u32 {
    let (_, count) = told
        .split_once("compared=")
        .unwrap_or_else(|| panic!("{told}"));
    assert!(told.starts_with("live: done"), "{told}");
    count.trim().parse().unwrap()
}

#[test]
fn the_live_model_agrees_with_a_twin_and_names_what_is_different() {
    if !have("verilator") {
        return;
    }
    let gauss = TWINS[3];
    let trace = package(gauss);
    let simulation = simulation(gauss, &trace);
    assert!(compared(&told(&simulation, &trace.folder, 20_000, 30)) >= 20_000);
    // The same twin beside another machine.
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
    let told = told(&simulation, &trace.folder, 20_000, 0);
    assert!(
        told.contains("field weight is") && told.contains("live: FAILED: record"),
        "{told}"
    );
    // When, and what it was made from.
    let fault = told
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
fn the_bench_may_stop_inside_of_a_pixel_of_resolve() {
    if !have("verilator") {
        return;
    }
    let trace = package(TWINS[6]);
    let simulation = simulation(TWINS[6], &trace);
    // Of so many counts some lie inside.
    for records in 100..110 {
        assert!(compared(&told(&simulation, &trace.folder, records, 0)) >= records);
    }
}

#[test]
fn every_twin_agrees_with_the_live_model_on_a_million_random_records() {
    if !tier::runs(Tier::Full) {
        return;
    }
    if !have("verilator") {
        return;
    }
    // Two at a time: a compiler keeps one core busy.
    let mine: Vec<Twin> = tier::some([12, 12], TWINS).collect();
    for pair in mine.chunks(2) {
        std::thread::scope(|scope| {
            pair.iter()
                .for_each(|twin| drop(scope.spawn(|| a_million(*twin))))
        });
    }
}

fn a_million(twin: Twin) {
    let trace = package(twin);
    let simulation = simulation(twin, &trace);
    // Stalled and not: half of the records each.
    for stall in [0, 25] {
        let told = told(&simulation, &trace.folder, 500_000, stall);
        println!("{} of {}: {told}", twin.module, twin.machine);
        assert!(compared(&told) >= 500_000);
    }
}

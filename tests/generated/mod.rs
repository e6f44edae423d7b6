//! Does SystemVerilog that is written for a machine give the machine's records, in place of the
//! units written by hand?

use crate::cosimulation::{
    Device, OF_ELLIPSOIDS, OF_HARMONICS, PIPELINE, Simulator, Unit, have, run, sources,
};
use crate::front_ends::{fault_in_slang, read_differently, slang};
use crate::tier::{Tier, runs};
use crate::traced::{Traced, bouquet, cloud, harmonics, isosurface, machine, shells, traced};
use crate::{
    STALLS, as_drawn, coloured, copied, expected, fault, lenses, nearest_even, times, unit,
};
use rayon::prelude::*;
use rtl_model::Machine;
use rtl_model::elaboration::microarchitecture::BinWords;
use rtl_model::graph::Graph;
use rtl_model::graph::verilog::Port;
use rtl_model::machine::{Interpolation, Operators};
use rtl_model::pipeline::rtl::Datapath;
use rtl_model::probe::{NoProbe, Tap};
use rtl_model::units::bin;
use serde_json::json;
use splatsim::cosim::trace::{Window, rtl};
use splatsim::scene::{Overrides, Scene};
use std::collections::HashSet;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

/// The units by hand, with those for a trace's machine and scene in their place.
fn written(trace: &Traced) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    copied(folder.path());
    write(trace, folder.path());
    folder
}

/// Writes the units for a trace's machine and scene.
fn write(trace: &Traced, folder: &Path) {
    let [scene, file] = ["scene.json", "machine.json"].map(|name| trace.path(name));
    let scene = Scene::load(&scene, &Overrides::default()).unwrap();
    let machine = splatsim::hardware::machines::load(&file, &[]).unwrap();
    rtl::write(&scene, &machine, folder).unwrap();
}

const ONE_LANE: &str = "timing.raster.lanes=[1,1]";

fn made_up(text: &str, machine: &Machine, units: &[&str]) -> Traced {
    with_stimulus(Some(60), text, machine, units)
}

/// A trace of the frame alone.
fn of_frame(text: &str, machine: &Machine, units: &[&str]) -> Traced {
    with_stimulus(None, text, machine, units)
}

fn with_stimulus(stimulus: Option<u32>, text: &str, machine: &Machine, units: &[&str]) -> Traced {
    let window = Window {
        stimulus,
        units: units.iter().map(|&unit| unit.to_owned()).collect(),
        ..Window::default()
    };
    traced(text, machine, &window)
}

/// Words of few bits, and with few places.
fn absurd() -> Machine {
    machine(
        "tiny",
        &[
            ONE_LANE,
            "project.relative=I1F1",
            "project.rotation=I2F1",
            "project.camera=I2F2",
            "project.slope=I2F1",
            r#"project.reciprocal={"table_bits":1,"newton_steps":0,"bits":4}"#,
            "ellipse.normal=I2F1",
            "ellipse.tilt=I2F0",
            "ellipse.facing=I2F1",
            "ellipse.size=U1F1",
            "ellipse.shape=I2F1",
            "ellipse.amplitude=U1F1",
            "gauss.radial_index=U3F1",
            "gauss.table.index_bits=3",
        ],
    )
}

/// Floating-point words of each rounding, of 2 significant bits and more, among fixed-point ones.
fn floating() -> Machine {
    machine(
        "reference",
        &[
            ONE_LANE,
            "splat.position=I1F26S8",
            "project.slope=I4F22S6N",
            r#"project.camera={"format":"I2F25S9","round":"truncate"}"#,
            "project.focal=U15F12S24",
            r#"ellipse.normal={"format":"I2F22S3","round":"nearest"}"#,
            r#"ellipse.conic={"format":"U2F25S5","round":"nearest"}"#,
            "ellipse.conic_cross=I2F25S5N",
            "ellipse.determinant=U8F40S12",
            "ellipse.amplitude=U-2F24S2",
            "gauss.falloff=U1F20S3N",
            r#"gauss.weight={"format":"U1F20S4N","round":"truncate"}"#,
        ],
    )
}

/// Each case has a trace, and the units whose records are compared.
fn cases() -> Vec<(&'static str, Traced, Vec<Unit>)> {
    let discs = || vec![unit("project"), unit("ellipse"), unit("gauss")];
    let ellipsoids = || vec![unit("project"), OF_ELLIPSOIDS[0], unit("gauss")];
    let names = ["project", "ellipse", "gauss"];
    let of = |name: &'static str, text: &str, machine: &Machine, units| {
        (name, made_up(text, machine, &names), units)
    };
    let named = |name: &str| machine(name, &[ONE_LANE]);
    let mut cases = vec![
        of("tiny", &cloud(60, 16), &named("tiny"), discs()),
        of("reference", &cloud(60, 16), &named("reference"), discs()),
        of("few bits", &cloud(60, 16), &absurd(), discs()),
        of(
            "nearest-even",
            &cloud(60, 16),
            &nearest_even(&named("tiny")),
            discs(),
        ),
        of(
            "a volume",
            &shells(8, 16, &json!({})),
            &named("volume"),
            ellipsoids(),
        ),
        of(
            "a surface",
            &isosurface(8, 16),
            &named("volume"),
            ellipsoids(),
        ),
        of(
            "gaussians",
            &bouquet(60, 16, &json!({"stop": 0.3})),
            &nearest_even(&named("gaussian")),
            ellipsoids(),
        ),
    ];
    let floating = floating();
    cases.push(of("floating point", &cloud(60, 16), &floating, discs()));
    let mut nearest = floating.clone();
    nearest.gauss.table.interpolation = Interpolation::Nearest;
    cases.push((
        "a table of floating point",
        made_up(&cloud(60, 16), &nearest, &["gauss"]),
        vec![unit("gauss")],
    ));
    cases.push(of(
        "half precision",
        &bouquet(60, 16, &json!({"stop": 0.3})),
        &named("fp16"),
        ellipsoids(),
    ));
    // Wide floating-point words are slow to simulate: only the last tier has their corners twice.
    let again = runs(Tier::Full).then_some(60);
    let rounded = |name, text: &str, machine: &Machine, units| {
        let machine = Machine {
            operators: Operators::Rounded,
            ..machine.clone()
        };
        (name, with_stimulus(again, text, &machine, &names), units)
    };
    cases.push(rounded(
        "half precision, operators rounded",
        &bouquet(16, 16, &json!({"stop": 0.3})),
        &named("fp16"),
        ellipsoids(),
    ));
    cases.push(rounded(
        "floating point, operators rounded",
        &cloud(16, 16),
        &floating,
        discs(),
    ));
    let weights = r#"sort.depth_weight={"share": "U1F16S9", "weight": "U1F16S7"}"#;
    cases.push((
        "half-precision weights",
        with_stimulus(
            again,
            &bouquet(20, 16, &json!({"weight_distance": 3.2})),
            &machine("fp16", &[ONE_LANE, "sort.kind=none", weights]),
            &names,
        ),
        ellipsoids(),
    ));
    let harmonic = |machine: &Machine| {
        let degree = machine.colour.unwrap().degree as u8;
        let text = harmonics(60, 16, degree);
        // The corners of all fields are some thousand records, each of which takes many cycles.
        if degree == 1 || runs(Tier::Full) {
            return made_up(&text, machine, &["colour"]);
        }
        of_frame(&text, machine, &["colour"])
    };
    for (name, degree) in [
        ("half-precision harmonics", 3),
        ("half-precision harmonics of degree 1", 1),
    ] {
        let degree = format!("colour.degree={degree}");
        let machine = machine("fp16", &[ONE_LANE, &degree]);
        cases.push((name, harmonic(&machine), vec![OF_HARMONICS]));
    }
    cases.extend(lenses().into_iter().filter(|(name, ..)| *name != "mirrors"));
    for (nth, machine) in coloured().iter().enumerate() {
        let name = ["degree 3", "coarse harmonics", "fine harmonics", "degree 1"][nth];
        cases.push((name, harmonic(machine), vec![OF_HARMONICS]));
    }
    cases
}

#[test]
fn generated_rtl_gives_the_records_of_the_machine() {
    if !have(&["iverilog"], "generated RTL") {
        return;
    }
    cases().par_iter().for_each(|(name, trace, units)| {
        let folder = written(trace);
        for &unit in units {
            let device = Device::new(Simulator::Icarus, folder.path(), &trace.folder, unit, 16);
            let given = device.drive(None, expected(trace, unit), &[]);
            let fault = fault(trace, unit, &given);
            assert_eq!(fault, None, "{name}: {}", unit.name);
        }
    });
}

/// The test above can fail: another operator or another number of places is found.
#[test]
fn wrong_generated_rtl_is_found_out() {
    if !runs(Tier::Ci) || !have(&["iverilog"], "mutants of generated RTL") {
        return;
    }
    let trace = made_up(
        &bouquet(60, 16, &json!({})),
        &machine("gaussian", &[ONE_LANE]),
        &["project", "ellipse", "gauss"],
    );
    let folder = written(&trace);
    for (unit, find, put) in [
        (unit("project"), " * ", " + "),
        (unit("project"), "<<< n", ">>> n"),
        (OF_ELLIPSOIDS[0], ".PLACES(", ".PLACES(1 + "),
        (OF_ELLIPSOIDS[0], " - ", " + "),
        (unit("gauss"), " * ", " + "),
    ] {
        let file = folder.path().join(format!("{}_datapath.sv", unit.name));
        let text = std::fs::read_to_string(&file).unwrap();
        assert!(text.contains(find), "{}: {find}", unit.name);
        std::fs::write(&file, text.replacen(find, put, 1)).unwrap();
        let device = Device::new(Simulator::Icarus, folder.path(), &trace.folder, unit, 16);
        let given = device.drive(None, expected(&trace, unit), &[]);
        assert!(
            fault(&trace, unit, &given).is_some(),
            "{}: {put} instead of {find} gives the same",
            unit.name
        );
        std::fs::write(&file, text).unwrap();
    }
}

/// A fit to a floating-point word (parameters of fit_float.sv): bits of the exact result, fraction
/// bits that are dropped, bits of the word, 1 if signed, significant bits, rounding (0 truncate, 1
/// nearest, 2 nearest-even), 1 if subnormal words are flushed to zero.
type FloatFit = [i32; 7];

/// Formats with and without a reserved code, shifts in both directions, and all roundings.
const FLOAT_FITS: [FloatFit; 11] = [
    [11, 2, 9, 1, 3, 2, 0],
    [11, 2, 9, 1, 3, 1, 0],
    [11, 2, 9, 1, 3, 0, 0],
    [11, 0, 8, 0, 4, 2, 0],
    [10, -2, 9, 1, 2, 2, 0],
    [11, 4, 7, 0, 2, 1, 0],
    [12, 1, 10, 1, 5, 2, 0],
    [9, 6, 6, 1, 3, 2, 0],
    [11, 2, 9, 1, 3, 2, 1],
    [10, -2, 9, 1, 4, 0, 1],
    [11, 4, 7, 0, 2, 1, 1],
];

/// The words of all exact results, from the least, by the rules of docs/book/numbers.md.
fn exact_words([bits, places, width, signed, kept, rounding, flush]: FloatFit) -> Vec<i64> {
    let magnitude_bits = width - signed;
    let is_reserved = (magnitude_bits - kept + 2).count_ones() == 1;
    let most = ((1i64 << kept) - 1 - i64::from(is_reserved)) << (magnitude_bits - kept);
    let word = |exact: i64| {
        let (number, unit) = (exact.abs() << (-places).max(0), 1i64 << places.max(0));
        let leading = (0..40).rev().find(|place| number >= unit << place);
        let step = unit << leading.map_or(0, |place| (place - kept + 1).max(0));
        let (whole, rest) = (number / step, number % step);
        let goes_up = match rounding {
            0 => false,
            1 => 2 * rest >= step,
            _ => 2 * rest > step || 2 * rest == step && whole % 2 == 1,
        };
        let mut magnitude = ((whole + i64::from(goes_up)) * (step / unit)).min(most);
        if flush == 1 && magnitude < 1 << (kept - 1) {
            magnitude = 0;
        }
        match (exact < 0, signed) {
            (false, _) => magnitude,
            (true, 1) => -magnitude,
            (true, _) => 0,
        }
    };
    (-(1i64 << (bits - 1))..1i64 << (bits - 1))
        .map(word)
        .collect()
}

/// The words that this text of fit_float.sv gives for all exact results.
fn words_by_rtl(text: &str, fit: FloatFit) -> Vec<i64> {
    let [bits, places, width, signed, kept, rounding, flush] = fit;
    let folder = tempfile::tempdir().unwrap();
    let bench = format!(
        "module bench;\n\
         logic signed [{bits}-1:0] exact;\n\
         wire [{width}-1:0] word;\n\
         fit_float #(.IN_W({bits}), .PLACES({places}), .W({width}), .S({signed}), .P({kept}), .ROUND({rounding}), .FLUSH({flush})) fit (.exact(exact), .word(word));\n\
         initial for (int i = -(1 << ({bits} - 1)); i < 1 << ({bits} - 1); i++) begin\n\
         exact = i; #1; $display(\"%0d\", word);\n\
         end\n\
         endmodule\n"
    );
    std::fs::write(folder.path().join("bench.sv"), bench).unwrap();
    std::fs::write(folder.path().join("fit_float.sv"), text).unwrap();
    let arguments = [
        "-g2012",
        "-s",
        "bench",
        "-o",
        "bench",
        "bench.sv",
        "fit_float.sv",
    ];
    run(Command::new("iverilog")
        .current_dir(folder.path())
        .args(arguments));
    let given = run(Command::new("vvp").current_dir(folder.path()).arg("bench"));
    let word = |line: &str| {
        let word: i64 = line.parse().unwrap();
        if signed == 1 && word >> (width - 1) == 1 {
            word - (1 << width)
        } else {
            word
        }
    };
    String::from_utf8(given.stdout)
        .unwrap()
        .lines()
        .map(word)
        .collect()
}

/// Every exact result of some formats has the word of the rules, and each fault is found.
#[test]
fn a_fit_to_floating_point_follows_its_rules() {
    if !have(&["iverilog"], "a fit to floating point") {
        return;
    }
    let text = std::fs::read_to_string(sources().join("fit_float.sv")).unwrap();
    for fit in FLOAT_FITS {
        assert_eq!(words_by_rtl(&text, fit), exact_words(fit), "{fit:?}");
    }
    for (find, put) in FAULTS_OF_FLOATS {
        assert_eq!(text.matches(find).count(), 1, "{find}");
        let fault = text.replace(find, put);
        let is_found = |fit: &FloatFit| words_by_rtl(&fault, *fit) != exact_words(*fit);
        assert!(FLOAT_FITS.iter().any(is_found), "`{put}` for `{find}`");
    }
}

/// Faults of a fit to a floating-point word: text, and what replaces it.
const FAULTS_OF_FLOATS: [(&str, &str); 10] = [
    ("FLUSH != 0 && ~|(rounded", "~|(rounded"),
    ("(rounded >> (P - 1))", "(rounded >> P)"),
    ("negative ? -exact : exact", "exact"),
    ("DROPPED_W'(place - P + 1)", "DROPPED_W'(place - P)"),
    ("place = RIGHT + P; place", "place = RIGHT + P + 1; place"),
    ("rest > half || ", "rest >= half || "),
    ("(ROUND == 1 || kept[0])", "ROUND == 1"),
    ("<< (dropped - DROPPED_W'(RIGHT))", "<< dropped"),
    ("rounded > MAX ? W'(MAX) : W'(rounded)", "W'(rounded)"),
    ("S != 0 ? -limited", "S != 0 ? limited"),
];

/// The wired pipeline, which was written for units by hand, draws a frame with generated ones.
#[test]
fn generated_units_draw_a_frame_in_the_wired_pipeline() {
    if !have(&["iverilog"], "generated RTL in the wired pipeline") {
        return;
    }
    let trace = traced(
        &cloud(60, 16),
        &machine("tiny", &[ONE_LANE]),
        &Window::default(),
    );
    let splats: Vec<String> = {
        let lines = trace.lines("pipeline.in");
        as_drawn(&trace)
            .into_iter()
            .map(|splat| lines[splat].clone())
            .collect()
    };
    let cycles = |folder: &Path| {
        let device = Device::new(Simulator::Icarus, folder, &trace.folder, PIPELINE, 16);
        let given = device.drive(Some(&splats), expected(&trace, PIPELINE), &STALLS);
        assert_eq!(fault(&trace, PIPELINE, &given), None);
        times(&given)
    };
    assert_eq!(cycles(written(&trace).path()), cycles(&sources()));
}

#[test]
fn generated_rtl_is_clean_and_can_be_synthesised() {
    if !have(&["verilator", "yosys"], "lint of generated RTL") {
        return;
    }
    let one =
        |text: &str, name: &str| traced(text, &machine(name, &[ONE_LANE]), &Window::default());
    let discs = [unit("project"), unit("ellipse"), unit("gauss")];
    let of_ellipsoids = [unit("project"), OF_ELLIPSOIDS[0], unit("gauss")];
    let cases = [
        (one(&cloud(20, 16), "reference"), &discs[..]),
        (
            traced(&cloud(20, 16), &floating(), &Window::default()),
            &discs,
        ),
        (
            traced(&cloud(20, 16), &absurd(), &Window::default()),
            &discs,
        ),
        (one(&shells(8, 16, &json!({})), "volume"), &of_ellipsoids),
        (one(&isosurface(8, 16), "volume"), &of_ellipsoids),
        (one(&harmonics(20, 16, 3), "gaussian"), &of_ellipsoids),
        (one(&harmonics(20, 16, 3), "gaussian"), &[OF_HARMONICS]),
    ];
    for (nth, (trace, units)) in cases.iter().enumerate() {
        // Without the units by hand: all modules that are used must be written.
        let folder = tempfile::tempdir().unwrap();
        write(trace, folder.path());
        for unit in *units {
            let file = |name: &str| folder.path().join(name);
            let [package, top] = ["machine_pkg".into(), unit.name.to_owned()]
                .map(|name: String| file(&format!("{name}.sv")));
            let lint = run(Command::new("verilator")
                .args(["--lint-only", "-Wall", "--top-module", unit.name, "-y"])
                .arg(folder.path())
                .args([&package, &top]));
            assert!(
                lint.stderr.is_empty(),
                "{}: {}",
                unit.name,
                String::from_utf8_lossy(&lint.stderr)
            );
            for file in [&top, &file(&format!("{}_datapath.sv", unit.name))] {
                let text = std::fs::read_to_string(file).unwrap();
                assert_eq!(read_differently(&text), Vec::<String>::new());
            }
            if let Some(python) = slang() {
                let path = |path: &Path| path.display().to_string();
                let arguments = [
                    path(&package),
                    path(&top),
                    "-y".into(),
                    path(folder.path()),
                    "--libext".into(),
                    ".sv".into(),
                    "--top".into(),
                    unit.name.into(),
                ];
                assert_eq!(fault_in_slang(&python, &arguments), None, "{}", unit.name);
            }
            // Yosys takes longer than all simulators together.
            let is_short = ["colour", "gauss"].contains(&unit.name);
            if nth > 0 && !is_short {
                continue;
            }
            let used = rtl_model::pipeline::rtl::library();
            let list: Vec<String> = used
                .iter()
                .map(|used| used.name.clone())
                .chain(
                    ["".into(), "_datapath".into()]
                        .map(|end: String| format!("{}{end}.sv", unit.name)),
                )
                .collect();
            let script = format!(
                "read_verilog -sv machine_pkg.sv; read_verilog -sv -defer {}; hierarchy -top {}; proc; check -assert",
                list.join(" "),
                unit.name
            );
            run(Command::new("yosys")
                .current_dir(folder.path())
                .args(["-q", "-p", &script]));
        }
    }
}

/// Words of several bits each, the first in the most significant bits.
fn line(words: &[i64], ports: &[Port]) -> String {
    let bits = |(word, port): (&i64, &Port)| -> String {
        (0..port.bits)
            .rev()
            .map(|bit| if word >> bit & 1 == 1 { '1' } else { '0' })
            .collect()
    };
    words.iter().zip(ports).map(bits).collect()
}

/// Results of a datapath for each of these inputs, on Icarus.
fn results(folder: &Path, datapath: &Datapath, items: &[Vec<i64>]) -> Vec<String> {
    let Datapath { module, name, .. } = datapath;
    let width = |ports: &[Port]| ports.iter().map(|port| port.bits).sum::<i32>();
    let (inputs, outputs) = (&module.inputs, &module.outputs);
    let list = |ports: &[Port]| {
        let names: Vec<&str> = ports.iter().map(|port| &port.name[..]).collect();
        names.join(", ")
    };
    let declared = |kind: &str, ports: &[Port]| -> String {
        ports
            .iter()
            .map(|port| format!("{kind} signed [{}:0] {};\n", port.bits - 1, port.name))
            .collect()
    };
    let bench = format!(
        "`timescale 1ns / 1ps\nmodule bench;\nreg [{}:0] items[0:{}];\n{}{}{name} dut (.*);\ninteger i;\ninitial begin\n$readmemb(\"items\", items);\n\
         for (i = 0; i < {}; i = i + 1) begin\n{{{}}} = items[i];\n#1 $display(\"%b\", {{{}}});\nend\nend\nendmodule\n",
        width(inputs) - 1,
        items.len() - 1,
        declared("reg", inputs),
        declared("wire", outputs),
        items.len(),
        list(inputs),
        list(outputs),
    );
    std::fs::write(folder.join("bench.sv"), bench).unwrap();
    let lines: Vec<String> = items.iter().map(|item| line(item, inputs)).collect();
    std::fs::write(folder.join("items"), lines.join("\n")).unwrap();
    run(Command::new("iverilog").current_dir(folder).args([
        "-g2012", "-s", "bench", "-o", "device", "-y", ".", "-Y", ".sv", "bench.sv",
    ]));
    let output = run(Command::new("vvp").current_dir(folder).arg("device"));
    let text = String::from_utf8(output.stdout).unwrap();
    text.lines().map(str::to_owned).collect()
}

/// The first item for which a datapath does not give what its graph does.
fn differs<const N: usize>(
    folder: &Path,
    datapath: &Datapath,
    graph: &Graph<N>,
    items: &[Vec<i64>],
) -> Option<String> {
    let results = results(folder, datapath, items);
    assert_eq!(results.len(), items.len());
    let different: HashSet<&String> = results.iter().collect();
    assert!(different.len() > 1, "{}: results differ", datapath.name);
    items.iter().zip(&results).find_map(|(item, result)| {
        let made = graph.one(item, &mut Tap::new(&mut NoProbe));
        let expected = line(&made, &datapath.module.outputs);
        (&expected != result).then(|| format!("{}: {item:?}", datapath.name))
    })
}

/// Graphs without records: layers of pixels, and the tests of tiles.
#[test]
fn datapaths_without_records_give_the_results_of_their_graphs() {
    if !have(&["iverilog"], "datapaths without records") {
        return;
    }
    for (nth, test) in ["oriented-box", "ellipse"].into_iter().enumerate() {
        let settings = [ONE_LANE, &format!("bin.test={test}")];
        let tiny = machine("tiny", &settings);
        let machine = if nth == 0 { tiny } else { nearest_even(&tiny) };
        let trace = traced(&cloud(200, 32), &machine, &Window::default());
        let folder = written(&trace);
        let elaborated = splatsim::hardware::fixed::elaborate(&machine).unwrap();
        let datapaths = rtl_model::pipeline::rtl::datapaths(&elaborated);
        let [layer, frame, splat, tile] = &datapaths[..] else {
            panic!("four datapaths")
        };

        let [step, end] = elaborated.resolve.graphs();
        let mut state = elaborated.resolve.clear();
        let (mut layers, mut pixels) = (Vec::new(), Vec::new());
        let background = &trace.records("frame")[0];
        let place = trace.field("frame", "background_r");
        for record in trace.records("resolve.in") {
            let [_, _, last, empty, colour @ ..] = &record[..] else {
                panic!("a layer")
            };
            if *empty == 0 {
                let item = [&state, colour].concat();
                state = step.one(&item, &mut Tap::new(&mut NoProbe));
                layers.push(item);
            }
            if *last == 1 {
                pixels.push([&state, &background[place..][..4]].concat());
                state = elaborated.resolve.clear();
            }
        }
        assert_eq!(differs(folder.path(), layer, step, &layers), None);
        assert_eq!(differs(folder.path(), frame, end, &pixels), None);

        let words = BinWords::of(&machine).unwrap();
        let (of_splat, of_tile) = (words.splat(), words.tile());
        let registers = bin::registers(background[trace.field("frame", "cutoff")], [32, 32]);
        let record = |record: &[i64], name: &str| record[trace.field("raster.in", name)];
        let (mut splats, mut tiles) = (Vec::new(), Vec::new());
        for of in trace.records("raster.in") {
            let conic = ["conic_xx", "conic_xy", "conic_yy"].map(|name| record(&of, name));
            let sides = ["first_column", "last_column", "first_row", "last_row"]
                .map(|name| record(&of, name));
            let pixel = ["pixel_x", "pixel_y"].map(|name| record(&of, name));
            let item = [&pixel[..], &conic, &sides, &registers].concat();
            let bounds = of_splat.one(&item, &mut Tap::new(&mut NoProbe));
            splats.push(item);
            let [left, right, top, bottom] = sides;
            for corner in 0..64 {
                // Tiles of 4 × 4 pixels.
                let [x, y] = [corner % 8 * 4, corner / 8 * 4];
                let part = [
                    left.max(x) - left,
                    right.min(x + 3) - left,
                    top.max(y) - top,
                    bottom.min(y + 3) - top,
                ];
                if part[0] <= part[1] && part[2] <= part[3] {
                    tiles.push([&conic[..], &bounds, &part].concat());
                }
            }
        }
        assert_eq!(differs(folder.path(), splat, &of_splat, &splats), None);
        assert_eq!(differs(folder.path(), tile, &of_tile, &tiles), None);
        // The comparison can fail.
        let file = folder.path().join("bin_tile_datapath.sv");
        let text = std::fs::read_to_string(&file).unwrap();
        std::fs::write(&file, text.replacen(" * ", " + ", 1)).unwrap();
        assert!(differs(folder.path(), tile, &of_tile, &tiles).is_some());
    }
}

/// A test of blocks, in fixed and in floating point.
#[test]
fn a_contribution_test_gives_the_results_of_its_graph() {
    if !have(&["iverilog"], "a contribution test") {
        return;
    }
    let published = json!(Machine::named("flicker").unwrap().contribution);
    let fixed = json!({
        "block_px": 8, "leaders": "diagonal", "offset": "I15F6", "square": "U20F4",
        "product": "I18F4", "conic": "U2F14", "conic_cross": "I3F14", "radial": "U8F6"
    });
    for words in [published, fixed] {
        let machine = machine("gaussian", &[ONE_LANE, &format!("contribution={words}")]);
        let elaborated = splatsim::hardware::fixed::elaborate(&machine).unwrap();
        let unit = elaborated.contribution().unwrap();
        let folder = tempfile::tempdir().unwrap();
        copied(folder.path());
        let scene = rtl::usual_scene(&machine).unwrap();
        rtl::write(&scene, &machine, folder.path()).unwrap();
        let datapaths = rtl_model::pipeline::rtl::datapaths(&elaborated);
        let datapath = datapaths.last().unwrap();
        assert_eq!(datapath.name, "contribution_datapath");
        let far = i64::from(unit.block_px()) - 1;
        let one = |word: rtl_model::num::Word| word.format.one();
        let (pixel, conic) = (machine.project.pixel, machine.ellipse.conic);
        let items: Vec<Vec<i64>> = (0..600i64)
            .map(|nth| {
                let part =
                    |salt: i64, most: i64| (nth * 7919 + salt * 104_729) % 9973 * most / 9973;
                let [left, top] = [part(1, 40), part(2, 40)].map(|at| at * (far + 1));
                let near = |at: i64, salt: i64| {
                    (at + far - 60) * one(pixel) + part(salt, 24 * one(pixel)) - 12 * one(pixel)
                };
                let [xx, yy] = [
                    part(5, 2 * one(conic)) >> (nth % 9),
                    part(6, one(conic)) >> (nth % 7),
                ];
                vec![
                    near(left, 3),
                    near(top, 4),
                    xx,
                    part(7, xx.min(yy) + 1) / 2,
                    yy,
                    part(8, 9 * one(machine.raster.cutoff)),
                    left,
                    left + far,
                    top,
                    top + far,
                    119,
                    119,
                ]
            })
            .collect();
        assert_eq!(differs(folder.path(), datapath, unit.graph(), &items), None);
    }
}

/// A folder has the units of one machine, and what others put there.
#[test]
fn units_of_an_earlier_machine_are_removed() {
    let folder = tempfile::tempdir().unwrap();
    let mine = folder.path().join("mine.sv");
    std::fs::write(&mine, "module mine; endmodule\n").unwrap();
    let names = |name: &str| {
        let machine = machine(name, &[]);
        let scene = rtl::usual_scene(&machine).unwrap();
        rtl::write(&scene, &machine, folder.path()).unwrap();
        let all = std::fs::read_dir(folder.path()).unwrap();
        let mut names: Vec<String> = all
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .filter(|name| name.contains("ellips") || name.contains("colour"))
            .collect();
        names.sort();
        names
    };
    let ellipsoids = [
        "colour.sv",
        "colour_datapath.sv",
        "ellipsoid.sv",
        "ellipsoid_datapath.sv",
    ];
    assert_eq!(names("gaussian"), ellipsoids);
    assert_eq!(names("tiny"), ["ellipse.sv", "ellipse_datapath.sv"]);
    assert!(mine.exists());
}

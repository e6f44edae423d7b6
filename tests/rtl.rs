//! Do the RTL implementations return every record of the machine on two simulators, and are
//! mistakes in them caught?

mod cosimulation;
mod front_ends;
mod generated;
mod netlists;
mod tier;
mod traced;

use cosimulation::{
    Device, Given, OF_ELLIPSOIDS, OF_HARMONICS, OF_ONE_ENGINE, OF_THREE_ENGINES, OF_WINDOWS,
    PIPELINE, PIPELINE_OF_TILES, PIPELINES_OF_ELLIPSOIDS, Simulator, UNITS, Unit, have, run,
    sources, verilator,
};
use rayon::prelude::*;
use rtl_model::frame::Frame;
use rtl_model::timing::{self, Detail};
use rtl_model::{Machine, pipeline};
use serde_json::json;

use splatsim::cosim::diff::{DiffOptions, RequiredOrder, Zeros, diff};
use splatsim::cosim::trace::Window;
use splatsim::hardware::fixed;
use splatsim::hardware::machines::changed;
use splatsim::hardware::quantise::quantise;
use splatsim::scene::{Overrides, Scene};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::process::Command;
use tier::Tier;
use traced::{Traced, bouquet, cloud, harmonics, isosurface, machine, shells, traced};

/// One lane, as in the RTL implementations; the named machines, and rules that none of them has.
fn machines() -> Vec<(&'static str, rtl_model::Machine)> {
    let one_lane = "timing.raster.lanes=[1,1]";
    vec![
        ("tiny", machine("tiny", &[one_lane])),
        ("lean", machine("lean", &[one_lane])),
        ("reference", machine("reference", &[one_lane])),
    ]
}

/// Weights that fall with depth, whose words all round.
const FALLING: &str =
    r#"sort.depth_weight={"share": "U1F9", "weight": {"format": "U1F6", "round": "nearest-even"}}"#;

/// Scenes of ellipsoids and their machines: line integrals, peaks and discs; sheets in either
/// order, of many splats or of one, with and without a table of lines, with and without early
/// termination.
fn media(size: u32, side: u32) -> Vec<(String, rtl_model::Machine)> {
    let one_lane = "timing.raster.lanes=[1,1]";
    let nearest = [
        "fragment.sheets.table.index_bits=5",
        "fragment.sheets.table.interpolation=nearest",
        one_lane,
    ];
    let stops = [
        "fragment.layers=2",
        "timing.technology=ideal",
        "timing.fragment.hazard=1",
        "timing.fragment.merge=3",
        one_lane,
    ];
    vec![
        (
            shells(size, side, &json!({"stop": 0.6})),
            machine("volume", &[one_lane]),
        ),
        (
            shells(
                size,
                side,
                &json!({"order": "back-to-front", "opacity": "linear"}),
            ),
            machine("volume", &nearest),
        ),
        (
            shells(size, side, &json!({"stop": 0.6, "keep_last": false})),
            machine("gaussian", &stops),
        ),
        (
            bouquet(size * size, side, &json!({"stop": 0.3})),
            machine("gaussian", &[one_lane]),
        ),
        (
            bouquet(
                size * size,
                side,
                &json!({"stop": 0.3, "keep_last": true, "most_weight": 0.4}),
            ),
            machine("gaussian", &stops),
        ),
        (
            bouquet(size * size, side, &json!({"weight_distance": 3.2})),
            machine("weighted", &[FALLING, one_lane]),
        ),
        (
            isosurface(size, side),
            machine("volume", &["fragment.layers=2", one_lane]),
        ),
    ]
}

fn unit(name: &str) -> Unit {
    *UNITS
        .iter()
        .chain(&OF_ELLIPSOIDS)
        .chain([&OF_WINDOWS])
        .find(|unit| unit.name == name)
        .unwrap()
}

/// Whether a stream's records have a field.
fn has(trace: &Traced, stream: &str, field: &str) -> bool {
    trace.stream(stream)["fields"]
        .as_array()
        .unwrap()
        .iter()
        .any(|other| other["name"] == field)
}

/// The pipeline that draws a trace's frame.
fn wired(trace: &Traced) -> Unit {
    let [by_depth, by_sheets] = PIPELINES_OF_ELLIPSOIDS;
    match ["quaternion_w", "sheet"].map(|field| has(trace, "pipeline.in", field)) {
        [false, _] => PIPELINE,
        [true, false] => by_depth,
        [true, true] => by_sheets,
    }
}

/// The RTL implementations for which a trace has streams.
fn twins(trace: &Traced) -> Vec<Unit> {
    let [ellipsoids, sheets] = [
        has(trace, "ellipse.in", "quaternion_w"),
        has(trace, "fragment.in", "sheet"),
    ];
    let windows = has(trace, "fragment.in", "density");
    let replaced = |unit: &Unit| match unit.name {
        "ellipse" if ellipsoids => OF_ELLIPSOIDS[0],
        "fragment" if sheets => OF_ELLIPSOIDS[1],
        "fragment" if windows => OF_WINDOWS,
        _ => *unit,
    };
    UNITS.iter().map(replaced).collect()
}

/// The streams of a unit's outputs, each with the file of its records.
fn outputs(unit: Unit, given: &Given) -> Vec<(String, PathBuf)> {
    let mut outputs = vec![(format!("{}.out", unit.stream), given.out.clone())];
    if ["fragment", "windows"].contains(&unit.name) {
        outputs.push(("fragment.request".into(), given.requests.clone()));
    }
    if unit.stream == "fragment" {
        outputs.push(("fragment.held".into(), given.held.clone()));
    }
    outputs
}

/// The fault of a unit's outputs; none if there is none.
fn fault(trace: &Traced, unit: Unit, given: &Given) -> Option<String> {
    if !given.last.starts_with("bench: done") {
        return Some(given.last.clone());
    }
    match diff(
        &trace.folder,
        &outputs(unit, given),
        DiffOptions {
            zeros: Zeros::Compared,
            order: RequiredOrder::Trace,
        },
    ) {
        Ok(outcome) if outcome.equal => None,
        Ok(outcome) => Some(outcome.sentence),
        Err(error) => Some(error.to_string()),
    }
}

fn expected(trace: &Traced, unit: Unit) -> usize {
    trace.stream(&format!("{}.out", unit.stream))["records"]
        .as_u64()
        .unwrap() as usize
}

/// Drives a unit with all of its records in a trace; returns the number of output records.
fn drive(simulator: Simulator, trace: &Traced, unit: Unit, side: u32, arguments: &[&str]) -> usize {
    let device = Device::new(simulator, &sources(), &trace.folder, unit, side);
    let records = expected(trace, unit);
    let given = device.drive(None, records, arguments);
    if let Some(fault) = fault(trace, unit, &given) {
        panic!("{} on {simulator:?}: {fault}", unit.name);
    }
    records
}

/// The number of splats in the memory of `pipeline_tiles`.
const TILES: &str = r#"{"splats": {"builtin": "glass-spheres", "count": 30000}, "image": {"width": 64, "height": 64}}"#;

const GLASS_SPHERES: &str =
    r#"{"splats": {"builtin": "glass-spheres"}, "image": {"width": 64, "height": 64}}"#;

/// Spheres under a sky: one mirrors it fully, one partly, and the floor does not mirror.
const MIRRORS: &str = r#"{"splats": {"builtin": "glass-spheres", "count": 1500}, "image": {"width": 32, "height": 32},
    "materials": [{"unlit": true, "reflect": 0.25}, {"diffuse": 0.8, "reflect": 0.9, "tint": [1, 0.8, 0.3]}], "environment": {"builtin": "sky"}}"#;

/// The book's machine, and two machines with unusual words.
fn mirrors(sight: &str) -> [rtl_model::Machine; 3] {
    let usual = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/docs/book/reflection/mirror.json"
    );
    let sight = format!("reflect.sight={sight}");
    let settings = |more: &[&str]| {
        ["timing.raster.lanes=[1,1]", &sight]
            .iter()
            .chain(more)
            .map(|one| (*one).to_owned())
            .collect::<Vec<_>>()
    };
    let coarse = [
        "reflect.slope=I2F4",
        "reflect.facing=I2F2",
        "reflect.direction=I2F3",
        "reflect.coordinate=U1F2",
        "reflect.fraction=U1F5",
        "reflect.light=U2F3",
        "reflect.reflectance=U1F2",
        "reflect.index_bits=1",
        r#"reflect.reciprocal={"table_bits":2,"newton_steps":0,"bits":5}"#,
    ];
    let fine = [
        r#"reflect.slope={"format":"I2F18","round":"truncate"}"#,
        r#"reflect.facing={"format":"I3F20","round":"truncate"}"#,
        r#"reflect.direction={"format":"I2F22","round":"nearest-even"}"#,
        r#"reflect.coordinate={"format":"U2F20","round":"truncate"}"#,
        r#"reflect.fraction={"format":"U1F0","round":"nearest-even"}"#,
        r#"reflect.light={"format":"U1F16","round":"truncate"}"#,
        "reflect.reflectance=U2F14",
        "reflect.index_bits=3",
    ];
    [vec![], coarse.to_vec(), fine.to_vec()]
        .map(|more| splatsim::hardware::machines::load(usual, &settings(&more)).unwrap())
}

/// Machines that evaluate harmonics: the ready-made one, lower degrees, and unusual words.
fn coloured() -> Vec<rtl_model::Machine> {
    let coarse = [
        "colour.coefficient=I3F2",
        r#"colour.relative={"format":"I1F4","round":"nearest"}"#,
        r#"colour.root={"table_bits":3,"newton_steps":0,"bits":5}"#,
        r#"colour.direction={"format":"I1F3","round":"truncate"}"#,
        "colour.monomial=I1F2",
        r#"colour.basis={"format":"I2F2","round":"nearest-even"}"#,
        "splat.rgb=U1F3",
    ];
    let fine = [
        "colour.degree=2",
        r#"colour.coefficient={"format":"I4F22","round":"truncate"}"#,
        r#"colour.relative={"format":"I2F24","round":"nearest-even"}"#,
        r#"colour.root={"table_bits":9,"newton_steps":2,"bits":26}"#,
        r#"colour.direction={"format":"I3F9","round":"nearest-even"}"#,
        r#"colour.monomial={"format":"I2F24","round":"truncate"}"#,
        "timing.colour.multipliers=3",
    ];
    [
        vec![],
        coarse.to_vec(),
        fine.to_vec(),
        vec!["colour.degree=1"],
    ]
    .map(|more| {
        machine(
            "gaussian",
            &[&["timing.raster.lanes=[1,1]"], &more[..]].concat(),
        )
    })
    .to_vec()
}

#[test]
fn harmonics_give_the_records_of_the_machine() {
    if !have(
        &["iverilog", "verilator"],
        "the RTL implementation of colour",
    ) {
        return;
    }
    for (nth, machine) in coloured().iter().enumerate() {
        let most = machine.colour.unwrap().degree;
        let simulator = if nth % 2 == 0 {
            Simulator::Verilator
        } else {
            Simulator::Icarus
        };
        for degree in [1, most as u8] {
            let scene = harmonics(200, 32, degree);
            let drawn = traced(&scene, machine, &Window::default());
            assert!(drive(simulator, &drawn, OF_HARMONICS, 32, &STALLS) > 50);
        }
        let made_up = Window {
            stimulus: Some(100),
            units: vec!["colour".into()],
            ..Window::default()
        };
        let made_up = traced(&harmonics(20, 32, most as u8), machine, &made_up);
        assert!(drive(simulator, &made_up, OF_HARMONICS, 32, &[]) > 300);
    }
}

#[test]
fn a_raster_without_differences_gives_the_records_of_the_machine() {
    if !have(
        &["iverilog", "verilator"],
        "the RTL implementation of raster",
    ) {
        return;
    }
    let machine = machine("tiny", &["timing.raster.lanes=[1,1]", "raster.rows=direct"]);
    let raster = *UNITS.iter().find(|unit| unit.name == "raster").unwrap();
    let made_up = Window {
        stimulus: Some(60),
        units: vec!["raster".into()],
        ..Window::default()
    };
    for (simulator, window) in [
        (Simulator::Verilator, Window::default()),
        (Simulator::Icarus, made_up),
    ] {
        let trace = traced(&cloud(60, 32), &machine, &window);
        assert!(drive(simulator, &trace, raster, 32, &STALLS) > 200);
        if simulator == Simulator::Icarus {
            for (find, put) in FAULTS_OF_PRODUCTS {
                is_found_out(&trace, raster, ("raster.sv", find, put));
            }
        }
    }
}

/// Faults of a raster without differences: text, and what replaces it.
const FAULTS_OF_PRODUCTS: [(&str, &str); 9] = [
    ("MIDDLE_W'({x, 1'b1})", "MIDDLE_W'({first_column, 1'b1})"),
    ("MIDDLE_W'({y, 1'b1})", "MIDDLE_W'({first_row, 1'b1})"),
    ("exact_both = px * py", "exact_both = px * px"),
    ("exact_y = py * py", "exact_y = py * px"),
    ("SUM_W'(xx) * square_x + ", ""),
    (
        "(1 + machine_pkg::ELLIPSE_CONIC_F - ",
        "(machine_pkg::ELLIPSE_CONIC_F - ",
    ),
    (
        "!radial_here[RADIAL_W-1] && radial_here < limit",
        "radial_here < limit",
    ),
    ("&& radial_here < limit", "&& radial_here <= limit"),
    ("z_here = x == left ? part_z : z;", "z_here = part_z;"),
];

#[test]
fn a_composite_gives_the_records_of_the_machine() {
    if !have(
        &["iverilog", "verilator"],
        "the RTL implementation of sheets",
    ) {
        return;
    }
    let cubed = machine("cubed", &[]);
    let trace = traced(&bouquet(300, 32, &json!({})), &cubed, &Window::default());
    let [_, sheets] = OF_ELLIPSOIDS;
    for simulator in [Simulator::Verilator, Simulator::Icarus] {
        assert!(drive(simulator, &trace, sheets, 32, &STALLS) > 200);
    }
    let faults = [
        (
            "HELD_ROUND = machine_pkg::FRAGMENT_COMPOSITE_ROUND",
            "HELD_ROUND = 1",
        ),
        (
            "HELD_F = machine_pkg::FRAGMENT_COMPOSITE_F",
            "HELD_F = machine_pkg::FRAGMENT_COMPOSITE_F - 1",
        ),
        ("HELD_S = machine_pkg::FRAGMENT_COMPOSITE_S", "HELD_S = 1"),
        ("THICK_F = HELD_F", "THICK_F = HELD_F - 1"),
        ("THICK_ROUND = HELD_ROUND", "THICK_ROUND = 1"),
    ];
    for (find, put) in faults {
        is_found_out(&trace, sheets, ("sheets.sv", find, put));
    }
}

/// Frames of a machine that passes over blocks of pixels have the records of all units but raster.
#[test]
fn records_of_kept_blocks_are_those_of_the_units() {
    if !have(
        &["iverilog"],
        "the RTL implementations behind a test of blocks",
    ) {
        return;
    }
    let gaussian = machine("gaussian", &["timing.raster.lanes=[1,1]"]);
    let testing = Machine {
        contribution: Machine::named("flicker").unwrap().contribution,
        ..gaussian.clone()
    };
    let text = bouquet(60, 24, &json!({}));
    let traces = [&gaussian, &testing].map(|machine| traced(&text, machine, &Window::default()));
    let pixels = |trace: &Traced| trace.lines("gauss.in").len();
    assert!(
        pixels(&traces[1]) < pixels(&traces[0]),
        "blocks are left out"
    );
    let [_, without_raster] = &traces;
    assert!(!without_raster.path("raster.out.hex").exists());
    // Sorted splats have the records of their own units; the others are left out, as on any machine.
    let window = Window {
        splats: Some([0, 20]),
        ..Window::default()
    };
    let of_splats = traced(&text, &testing, &window);
    assert!(!of_splats.lines("gauss.in").is_empty());
    let [_, sheets] = OF_ELLIPSOIDS;
    for unit in [unit("gauss"), sheets] {
        assert!(drive(Simulator::Icarus, without_raster, unit, 24, &STALLS) > 200);
    }
}

/// The test above can fail: a wrong product, sum, shift or rounding is found.
#[test]
fn wrong_harmonics_are_found_out() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    if !have(&["iverilog"], "mutants of colour") {
        return;
    }
    let machine = &coloured()[0];
    // Stimuli have some thousand records, and each takes many cycles.
    let window = Window {
        units: vec!["colour".into()],
        ..Window::default()
    };
    let trace = traced(&harmonics(60, 32, 3), machine, &window);
    let mutants = [
        ("difference <<< lead", "difference <<< (lead - 8'sd1)"),
        (
            ".exact(scaled), .more(more)",
            ".exact(scaled), .more(-more)",
        ),
        ("{x, y, x, z, y, x}", "{x, y, x, z, x, x}"),
        ("rest = (zz <<< 1) - xx - yy", "rest = (zz <<< 1) - xx"),
        ("over = (zz <<< 2) - xx - yy", "over = (zz <<< 1) - xx - yy"),
        (
            "{to_x, skew, over, to_z, over, yz, to_y}",
            "{to_x, skew, over, to_z, over, xz, to_y}",
        ),
        ("COLOUR_MONOMIAL_ROUND", "COLOUR_RELATIVE_WRAP"),
        ("(WHOLE_W'(1) <<< (WHOLE_F - 1))", "WHOLE_W'(0)"),
        ("(COUNT-1-nth)*3+channel", "(COUNT-1-nth)*3+2-channel"),
    ];
    for (find, put) in mutants {
        is_found_out(&trace, OF_HARMONICS, ("colour.sv", find, put));
    }
}

#[test]
fn mirrors_give_the_records_of_the_machine() {
    if !tier::runs(Tier::Full) {
        return;
    }
    if !have(&["iverilog", "verilator", "yosys"], "the twin of reflect") {
        return;
    }
    let [axis, ray] = ["axis", "ray"].map(mirrors);
    for (nth, machine) in tier::some([12, 12], axis.iter().chain(&ray).enumerate()) {
        let made_up = traced(
            MIRRORS,
            machine,
            &Window {
                stimulus: Some(1),
                ..Window::default()
            },
        );
        let simulator = if nth % 3 == 0 {
            Simulator::Verilator
        } else {
            Simulator::Icarus
        };
        assert!(drive(simulator, &made_up, unit("shade"), 32, &STALLS) > 100);
    }
    for sight in tier::some([12, 12], ["axis", "ray"]) {
        let drawn = traced(MIRRORS, &mirrors(sight)[0], &Window::default());
        assert!(drive(Simulator::Icarus, &drawn, unit("shade"), 32, &[]) > 100);
        assert!(drive(Simulator::Icarus, &drawn, unit("fragment"), 32, &[]) > 100);
        drive(Simulator::Icarus, &drawn, PIPELINE, 32, &[]);
        is_sound(&drawn);
    }
}

/// Verilator and Yosys have no warnings for a shade unit that mirrors.
fn is_sound(drawn: &Traced) {
    let lint = run(Command::new("verilator")
        .args(["--lint-only", "-Wall", "--top-module", "shade", "-y"])
        .arg(sources())
        .arg(drawn.path("machine_pkg.sv"))
        .arg(sources().join("shade.sv")));
    assert!(
        lint.stderr.is_empty(),
        "{}",
        String::from_utf8_lossy(&lint.stderr)
    );
    let list: Vec<String> = rtl_files()
        .iter()
        .map(|file| file.display().to_string())
        .collect();
    let script = format!(
        "read_verilog -sv {}; read_verilog -sv -defer {}; hierarchy -top shade; proc; check -assert",
        drawn.path("machine_pkg.sv").display(),
        list.join(" ")
    );
    run(Command::new("yosys")
        .current_dir(&drawn.folder)
        .args(["-q", "-p", &script]));
}

/// The test above can fail: a wrong fold, a wrong corner and a wrong share are found.
#[test]
fn wrong_mirrors_are_found_out() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    if !have(&["iverilog"], "mutants of reflect") {
        return;
    }
    let [along_axis, along_rays] =
        ["axis", "ray"].map(|sight| traced(MIRRORS, &mirrors(sight)[0], &Window::default()));
    let of_axis = [
        (
            "reflect.sv",
            "COORDINATE_ONE - g_coordinate[1].near",
            "COORDINATE_ONE - g_coordinate[0].near",
        ),
        (
            "reflect.sv",
            "(MIRRORED_W'(product) <<< 1)",
            "MIRRORED_W'(product)",
        ),
        (
            "reflect.sv",
            "texels[{next_row, next_column}]",
            "texels[{next_row, column}]",
        ),
        (
            "reflect.sv",
            "(own << (MORE_F - COLOUR_F)) + (seen",
            "(seen",
        ),
        (
            "reflect_step.sv",
            "less ? ONE - PLACE_W'(coordinate)",
            "less ? ONE + PLACE_W'(coordinate)",
        ),
        ("reflect_step.sv", "- EXACT_W'(place);", "- EXACT_W'(0);"),
        ("reflect_line.sv", "finish - start", "start - finish"),
        ("shade.sv", "faces ? mirrored : lit", "lit"),
    ];
    let of_rays = [
        (
            "reflect.sv",
            "size[(1-axis)*SIZE_W+:SIZE_W]});",
            "size[0+:SIZE_W]}) + OFFSET_W'(2);",
        ),
        (
            "reflect.sv",
            "place[(1-axis)*SIZE_W+:SIZE_W]",
            "place[0+:SIZE_W]",
        ),
        ("reflect.sv", ".more(inverse_focal_places)", ".more(8'sd0)"),
        (
            "reflect.sv",
            "+ (MIRRORED_W'(sight) <<<",
            "- (MIRRORED_W'(sight) <<<",
        ),
        (
            "reflect.sv",
            "TOWARDS_W'(part) * TOWARDS_W'(sight)",
            "(axis == 2 ? TOWARDS_W'(part) * TOWARDS_W'(sight) : '0)",
        ),
        (
            "shade.sv",
            ".x(s_data[machine_pkg::SHADE_IN_X_LSB+:X_W])",
            ".x(s_data[machine_pkg::SHADE_IN_Y_LSB+:X_W])",
        ),
    ];
    let with = |trace| move |mutant| (trace, mutant);
    let mutants = of_axis
        .map(with(&along_axis))
        .into_iter()
        .chain(of_rays.map(with(&along_rays)));
    for (trace, mutant) in tier::some([3, 3], mutants) {
        is_found_out(trace, unit("shade"), mutant);
    }
}

/// Copies the RTL implementations and the bench.
fn copied(folder: &Path) {
    for entry in rtl_files() {
        std::fs::copy(&entry, folder.join(entry.file_name().unwrap())).unwrap();
    }
    // Other files that the bench needs are in the same folder.
    let bench = folder.join("bench");
    std::fs::create_dir(&bench).unwrap();
    for entry in std::fs::read_dir(sources().join("bench"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
    {
        std::fs::copy(&entry, bench.join(entry.file_name().unwrap())).unwrap();
    }
}

/// A unit with one string of a file replaced gives other records than those of a trace.
fn is_found_out(trace: &Traced, unit: Unit, (file, find, put): (&str, &str, &str)) {
    let folder = tempfile::tempdir().unwrap();
    copied(folder.path());
    let text = std::fs::read_to_string(folder.path().join(file)).unwrap();
    assert_eq!(text.matches(find).count(), 1, "{file}: {find}");
    std::fs::write(folder.path().join(file), text.replace(find, put)).unwrap();
    let device = Device::new(Simulator::Icarus, folder.path(), &trace.folder, unit, 32);
    let given = device.drive(None, expected(trace, unit), &[]);
    assert!(
        fault(trace, unit, &given).is_some(),
        "{file} without `{find}` gives the same"
    );
}

const STALLS: [&str; 5] = [
    "+stall_in=30",
    "+stall_out=30",
    "+stall_shade=30",
    "+stall_held=30",
    "+seed=5",
];

/// All files of the RTL implementations.
fn rtl_files() -> Vec<PathBuf> {
    let files = std::fs::read_dir(sources())
        .unwrap()
        .map(|entry| entry.unwrap().path());
    files
        .filter(|path| path.extension().is_some_and(|end| end == "sv"))
        .collect()
}

#[test]
fn rtl_is_clean_and_can_be_synthesised() {
    if !have(
        &["verilator", "iverilog", "yosys"],
        "lint and synthesis of the twins",
    ) {
        return;
    }
    let (_, lean) = &machines()[1];
    let trace = traced(
        &cloud(20, 16),
        lean,
        &Window {
            stimulus: Some(1),
            ..Window::default()
        },
    );
    let files = rtl_files();
    let one_lane = machine("volume", &["timing.raster.lanes=[1,1]"]);
    let volume = traced(&shells(12, 16, &json!({})), &one_lane, &Window::default());
    let surface = traced(&isosurface(8, 16), &one_lane, &Window::default());
    let windows = traced(
        &cloud(20, 16),
        &machine("window", &["timing.raster.lanes=[1,1]"]),
        &Window {
            stimulus: Some(1),
            ..Window::default()
        },
    );
    let coloured = traced(
        &harmonics(20, 16, 3),
        &machine("gaussian", &["timing.raster.lanes=[1,1]"]),
        &Window::default(),
    );
    let all = UNITS
        .iter()
        .chain([&PIPELINE, &PIPELINE_OF_TILES])
        .chain(&OF_ELLIPSOIDS)
        .chain(&PIPELINES_OF_ELLIPSOIDS)
        .chain([&OF_WINDOWS, &OF_HARMONICS]);
    // Simulators read all of them in every run. Yosys, which takes as long as everything else
    // together, reads a part of them that depends on the tier.
    let in_yosys: HashSet<&str> = tier::some([12, 12], all.clone().map(|unit| unit.name)).collect();
    for unit in all {
        let trace = match unit.name {
            "windows" => &windows,
            "colour" => &coloured,
            "pipeline_ellipsoids" => &surface,
            "ellipsoid" | "sheets" | "pipeline_sheets" => &volume,
            _ => &trace,
        };
        let package = trace.path("machine_pkg.sv");
        let file = sources().join(unit.name).with_extension("sv");
        let lint = run(Command::new("verilator")
            .args(["--lint-only", "-Wall", "--top-module", unit.name, "-y"])
            .arg(sources())
            .arg(&package)
            .arg(&file));
        assert!(
            lint.stderr.is_empty(),
            "{}: {}",
            unit.name,
            String::from_utf8_lossy(&lint.stderr)
        );
        run(Command::new("iverilog")
            .args(["-g2012", "-t", "null", "-s", unit.name, "-y"])
            .arg(sources())
            .args(["-Y", ".sv"])
            .arg(&package)
            .arg(&file));
        if !in_yosys.contains(unit.name) {
            continue;
        }
        let list: Vec<String> = files
            .iter()
            .map(|file| file.display().to_string())
            .collect();
        let script = format!(
            "read_verilog -sv {}; read_verilog -sv -defer {}; hierarchy -top {}; proc; check -assert",
            package.display(),
            list.join(" "),
            unit.name
        );
        run(Command::new("yosys")
            .current_dir(&trace.folder)
            .args(["-q", "-p", &script]));
    }
}

#[test]
fn a_rule_that_the_rtl_does_not_have_is_an_elaboration_error() {
    if !have(&["iverilog", "verilator"], "an unknown rule of merging") {
        return;
    }
    let trace = traced(
        &cloud(20, 16),
        &machines()[0].1,
        &Window {
            stimulus: Some(1),
            ..Window::default()
        },
    );
    let package = trace.path("machine_pkg.sv");
    let text = std::fs::read_to_string(&package).unwrap();
    assert_eq!(text.matches("FRAGMENT_MERGE = 1;").count(), 1);
    for (rule, is_known) in [("1", true), ("7", false)] {
        std::fs::write(
            &package,
            text.replace("FRAGMENT_MERGE = 1;", &format!("FRAGMENT_MERGE = {rule};")),
        )
        .unwrap();
        let mut icarus = Command::new("iverilog");
        icarus.args(["-g2012", "-t", "null", "-s", "fragment", "-Y", ".sv"]);
        let mut verilator = Command::new("verilator");
        verilator.args(["--lint-only", "--top-module", "fragment"]);
        for simulator in [&mut icarus, &mut verilator] {
            let output = simulator
                .arg("-y")
                .arg(sources())
                .arg(&package)
                .arg(sources().join("fragment.sv"))
                .output()
                .unwrap();
            let told = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.success(), is_known, "{told}");
            assert!(
                is_known
                    || told
                        .replace('_', " ")
                        .contains("fragment has no such rule of merging"),
                "{told}"
            );
        }
    }
}

#[test]
fn the_least_testbench_runs_in_one_command() {
    if !have(&["iverilog"], "traces/testbench.sh") {
        return;
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let kept = tempfile::tempdir().unwrap();
    let file = kept.path().join("raster.out.hex");
    let output = run(Command::new("sh")
        .arg(root.join("traces/testbench.sh"))
        .arg(&file));
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        told.contains("615 records equal\n")
            && told.contains(&format!(
                "splatsim diff traces/knot raster.out {}",
                file.display()
            ))
    );
    // Its output is a file for `diff`.
    let compared = diff(
        &root.join("traces/knot"),
        &[("raster.out".to_owned(), file)],
        DiffOptions {
            order: RequiredOrder::Trace,
            ..DiffOptions::default()
        },
    );
    assert!(compared.unwrap().equal);
}

/// The blocks of the page *Check your RTL in ten minutes*, by the comments at their beginnings.
fn blocks_of_ten_minutes() -> Vec<(String, String)> {
    let page = include_str!("../docs/book/check-rtl.md");
    let blocks = page
        .split("```bash\n# ")
        .skip(1)
        .map(|rest| rest.split_once("\n```").unwrap().0);
    blocks
        .map(|block| {
            (
                block.split([':', '\n']).next().unwrap().to_owned(),
                format!("# {block}\n"),
            )
        })
        .collect()
}

#[test]
fn the_page_of_ten_minutes_leads_from_a_trace_to_the_first_difference() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = Path::new(env!("CARGO_BIN_EXE_splatsim")).parent().unwrap();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
    let here = tempfile::tempdir().unwrap();
    for folder in ["traces", "rtl_model"] {
        std::os::unix::fs::symlink(root.join(folder), here.path().join(folder)).unwrap();
    }
    let blocks = blocks_of_ten_minutes();
    let told = |name: &str| {
        let (_, block) = blocks
            .iter()
            .find(|(other, _)| other == name)
            .unwrap_or_else(|| panic!("no block {name}"));
        let output = run(Command::new("bash")
            .args(["-euo", "pipefail", "-c", block])
            .env("PATH", &path)
            .current_dir(here.path()));
        String::from_utf8(output.stdout).unwrap()
    };
    assert_eq!(told("trace"), "");
    // The block of cocotb is run by test_cocotb.py.
    for (tool, tools) in [
        ("Icarus", &["iverilog"][..]),
        ("Verilator", &["verilator"]),
        ("Yosys", &["yosys", "iverilog"]),
    ] {
        if !have(tools, &format!("{tool} in the page of ten minutes")) {
            continue;
        }
        let _ = std::fs::remove_file(here.path().join("device.hex"));
        told(tool);
        assert_eq!(told("diff"), "raster.out: 615 records equal\n", "{tool}");
        let fault = told("a fault");
        let page = include_str!("../docs/book/check-rtl.md");
        assert!(
            page.contains(&format!("```text\n{}\n```", fault.lines().next().unwrap())),
            "{fault}"
        );
        for part in [
            "raster.offset",
            "raster.gradient",
            "made from, raster.in record",
            "splatsim trace",
        ] {
            assert!(fault.contains(part), "{part}: {fault}");
        }
    }
}

#[test]
fn headers_compile() {
    if !have(&["verilator", "cc"], "compiling the headers of a trace") {
        return;
    }
    let trace = traced(
        &cloud(20, 16),
        &machine("reference", &[]),
        &Window::default(),
    );
    let header = trace.path("check.c");
    let program = "#include \"records.h\"\nint main(void) { raster_out_record r = {0}; splatsim_outcome o = SPLATSIM_OUTCOME_DROPPED; \
        return (int)r.depth + RASTER_OUT_FIELDS * 0 + (o != 5); }\n";
    std::fs::write(&header, program).unwrap();
    run(Command::new("cc")
        .args(["-Wall", "-Werror", "-Wno-unused-const-variable", "-o"])
        .arg(trace.path("check"))
        .arg(&header));
    run(&mut Command::new(trace.path("check")));
    let module = trace.path("check.sv");
    let widths: Vec<String> = ["raster.in", "fragment.held", "frame", "ellipse.out"]
        .iter()
        .map(|name| {
            let (lower, upper) = (
                name.replace('.', "_"),
                name.replace('.', "_").to_uppercase(),
            );
            format!("if ($bits({lower}_t) != machine_pkg::{upper}_W) $fatal(1, \"{name}\");")
        })
        .collect();
    let codes = "machine_pkg::outcome_t outcome; machine_pkg::merge_t rule;
        initial begin outcome = machine_pkg::OUTCOME_DROPPED; rule = machine_pkg::merge_t'(machine_pkg::FRAGMENT_MERGE);
        if (outcome != 5 || $bits(outcome) != machine_pkg::FRAGMENT_OUT_OUTCOME_W || rule != machine_pkg::MERGE_FARTHEST_PAIR) $fatal; end";
    let text = format!(
        "module check;\n`include \"records.svh\"\n{codes}\ninitial begin #1 {} $finish; end\nendmodule\n",
        widths.join(" ")
    );
    std::fs::write(&module, text).unwrap();
    let folder = trace.path("check_dir");
    run(verilator()
        .args([
            "--binary",
            "--timing",
            "-Wno-fatal",
            "--top-module",
            "check",
            "--Mdir",
        ])
        .arg(&folder)
        .arg(format!("-I{}", trace.folder.display()))
        .arg(trace.path("machine_pkg.sv"))
        .arg(&module));
    run(&mut Command::new(folder.join("Vcheck")));
}

#[test]
fn every_rtl_unit_gives_every_record_on_icarus() {
    if !have(&["iverilog"], "co-simulation on Icarus") {
        return;
    }
    let trace = traced(&cloud(60, 16), &machines()[0].1, &Window::default());
    let made_up = traced(
        &cloud(20, 16),
        &machines()[0].1,
        &Window {
            stimulus: Some(50),
            ..Window::default()
        },
    );
    for unit in UNITS {
        drive(Simulator::Icarus, &trace, unit, 16, &[]);
        drive(Simulator::Icarus, &made_up, unit, 16, &STALLS);
    }
}

#[test]
fn the_rtl_of_ellipsoids_gives_every_record_on_icarus() {
    if !have(&["iverilog"], "co-simulation on Icarus") {
        return;
    }
    for (number, (text, machine)) in tier::some([12, 12], media(12, 16).into_iter().enumerate()) {
        let trace = traced(&text, &machine, &Window::default());
        let made_up = traced(
            &text,
            &machine,
            &Window {
                stimulus: Some(100),
                ..Window::default()
            },
        );
        let given: Vec<usize> = twins(&trace)
            .into_iter()
            .filter(|unit| unit.name != unit.stream || unit.name == "project")
            .map(|unit| {
                drive(Simulator::Icarus, &trace, unit, 16, &STALLS)
                    + drive(Simulator::Icarus, &made_up, unit, 16, &[])
            })
            .collect();
        println!("scene {number}: {given:?} records");
        assert!(given.iter().all(|records| *records > 100), "{given:?}");
    }
}

/// Scenes with a lens whose axis is off the middle and whose pixels are not square, with their
/// machines and the affected units: discs, on a machine with the registers and on one without;
/// Gaussians with compensated opacities; mirrors along rays.
fn lenses() -> Vec<(&'static str, Traced, Vec<Unit>)> {
    let one_lane = "timing.raster.lanes=[1,1]";
    let with = |text: &str, camera: serde_json::Value| {
        let mut scene: serde_json::Value = serde_json::from_str(text).unwrap();
        scene["camera"]
            .as_object_mut()
            .map(|camera| camera.remove("fov_y_degrees"));
        for (name, value) in camera.as_object().unwrap() {
            scene["camera"][name] = value.clone();
        }
        scene
    };
    let wide = json!({"focal_px": [17, 23.5], "centre_px": [6.25, 9.5]});
    let high = json!({"focal_px": [31, 24], "centre_px": [9.125, 7]});
    let mut fainter = with(&bouquet(144, 16, &json!({"stop": 0.3})), high.clone());
    fainter["kernel"] = json!({"compensate_opacity": true});
    let mirrored = with(
        MIRRORS,
        json!({"focal_px": [30, 41], "centre_px": [13, 18.5]}),
    );
    let square = with(&cloud(60, 16), json!({"centre_px": [6.25, 9.5]}));
    let discs = || vec![unit("project"), unit("ellipse")];
    let ellipsoids = || vec![unit("project"), OF_ELLIPSOIDS[0]];
    [
        (
            "wide pixels",
            with(&cloud(60, 16), wide),
            machine("reference", &[one_lane]),
            discs(),
        ),
        (
            "high pixels",
            with(&cloud(60, 16), high.clone()),
            machine("tiny", &[one_lane, "ellipse.aspect=U1F7"]),
            discs(),
        ),
        (
            "square pixels",
            square,
            machine("tiny", &[one_lane]),
            discs(),
        ),
        (
            "compensated",
            fainter,
            machine("gaussian", &[one_lane]),
            ellipsoids(),
        ),
        (
            "falling weights",
            with(
                &bouquet(144, 16, &json!({"weight_distance": 3.2})),
                high.clone(),
            ),
            machine("weighted", &[FALLING, one_lane]),
            ellipsoids(),
        ),
        (
            "a volume",
            with(&shells(12, 16, &json!({"stop": 0.6})), high),
            machine("volume", &[one_lane]),
            ellipsoids(),
        ),
        // So wide that rays are more than twice as long as their depth.
        (
            "a wide volume",
            with(
                &shells(12, 16, &json!({})),
                json!({"focal_px": [4, 5], "eye": [0.3, 0.2, 0.9], "near": 0.05}),
            ),
            machine("volume", &[one_lane]),
            ellipsoids(),
        ),
        (
            "mirrors",
            mirrored,
            mirrors("ray").into_iter().next().unwrap(),
            vec![unit("shade")],
        ),
    ]
    .into_iter()
    .map(|(name, scene, machine, units)| {
        (
            name,
            traced(&scene.to_string(), &machine, &Window::default()),
            units,
        )
    })
    .collect()
}

#[test]
fn any_lens_gives_every_record_and_wrong_ones_are_found_out() {
    if !have(&["iverilog"], "lenses on Icarus") {
        return;
    }
    let lenses = lenses();
    let side = |name: &str| if name == "mirrors" { 32 } else { 16 };
    let jobs: Vec<_> = lenses
        .iter()
        .flat_map(|(name, trace, units)| units.iter().map(move |unit| (*name, trace, *unit)))
        .collect();
    jobs.par_iter().for_each(|(name, trace, unit)| {
        let records = drive(Simulator::Icarus, trace, *unit, side(name), &STALLS);
        assert!(records > 30, "{name}: {records} records of {}", unit.name);
    });
    let with = |scene, unit, file, find, put| {
        (
            scene,
            Mutant {
                unit,
                file,
                find,
                put,
            },
        )
    };
    let wrong = [
        with(
            "wide pixels",
            "project",
            "project.sv",
            "+ (PLACED_W'(centre) <<< CENTRE_LEFT)",
            "- (PLACED_W'(centre) <<< CENTRE_LEFT)",
        ),
        with(
            "wide pixels",
            "project",
            "project.sv",
            "VIEW_FOCAL_Y_LSB : machine_pkg::VIEW_FOCAL_X_LSB",
            "VIEW_FOCAL_X_LSB : machine_pkg::VIEW_FOCAL_Y_LSB",
        ),
        with(
            "square pixels",
            "project",
            "project.sv",
            "FRAME_CENTRE_Y_LSB+i*PIXEL_W",
            "FRAME_CENTRE_Y_LSB",
        ),
        with(
            "high pixels",
            "ellipse",
            "ellipse_size.sv",
            "VIEW_ASPECT_YY_LSB+i*ASPECT_W",
            "VIEW_ASPECT_YY_LSB+(2-i)*ASPECT_W",
        ),
        with(
            "wide pixels",
            "ellipse",
            "ellipse_plane.sv",
            "VIEW_INVERSE_FOCAL_Y_LSB : ",
            "VIEW_INVERSE_FOCAL_X_LSB : ",
        ),
        with(
            "wide pixels",
            "ellipse",
            "ellipse_footprint.sv",
            "sizes_squared[SIZE_SQUARED_W+:SIZE_SQUARED_W]}) * facing",
            "sizes_squared[0+:SIZE_SQUARED_W]}) * facing",
        ),
        with(
            "compensated",
            "ellipsoid",
            "ellipsoid.sv",
            "square_0 + square_1 + square_2",
            "square_0 + square_1",
        ),
        with(
            "compensated",
            "ellipsoid",
            "ellipsoid.sv",
            "kind == 2'd3 ? spanned : along",
            "along",
        ),
        with(
            "falling weights",
            "ellipsoid",
            "ellipsoid.sv",
            "9'(places) - 9'(point_exponent)",
            "9'(places)",
        ),
        with(
            "falling weights",
            "ellipsoid",
            "ellipsoid.sv",
            "{1'b0, share} > WHOLE ? '0 : WHOLE",
            "WHOLE",
        ),
        with(
            "a volume",
            "ellipsoid",
            "ellipsoid.sv",
            "sizes_squared[SIZE_SQUARED_W+:SIZE_SQUARED_W]}) * $signed({1'b0, ray})",
            "sizes_squared[0+:SIZE_SQUARED_W]}) * $signed({1'b0, ray})",
        ),
        with(
            "a wide volume",
            "ellipsoid",
            "ellipsoid.sv",
            ".more(9'(ray_exponent))",
            ".more(-(9'(ray_exponent)))",
        ),
        with(
            "mirrors",
            "shade",
            "reflect.sv",
            "- OFFSET_W'(centre)",
            "+ OFFSET_W'(centre)",
        ),
        with(
            "mirrors",
            "shade",
            "reflect.sv",
            "VIEW_INVERSE_FOCAL_Y_LSB)",
            "VIEW_INVERSE_FOCAL_X_LSB)",
        ),
    ];
    let survives = |(scene, mutant): &&(&str, Mutant)| {
        let (_, trace, _) = lenses.iter().find(|(name, ..)| name == scene).unwrap();
        let folder = tempfile::tempdir().unwrap();
        mutated(mutant, folder.path());
        let device = Device::new(
            Simulator::Icarus,
            folder.path(),
            &trace.folder,
            unit(mutant.unit),
            side(scene),
        );
        fault(
            trace,
            unit(mutant.unit),
            &device.drive(None, expected(trace, unit(mutant.unit)), &[]),
        )
        .is_none()
    };
    let survivors: Vec<&str> = wrong
        .par_iter()
        .filter(survives)
        .map(|(_, mutant)| mutant.put)
        .collect();
    assert!(survivors.is_empty(), "{survivors:#?}");
}

/// Machines that group by windows: the named one, one of intervals, one with few bits, one whose
/// splats join from afar but whose closed slots accept none, one layer, eight, and one whose closed
/// slots accept none and may be evicted.
fn windows() -> Vec<Machine> {
    let words = [
        "depth=U1F10",
        "weight_sum=U3F10",
        "colour_sum=U2F8",
        "opacity_sum=U3F9",
        "normal_sum=I4F6",
        "window.depth_sum=U4F10",
        "window.through=U1F5",
        "window.share=U2F8",
        "window.part=U1F7",
        "window.density=U3F5",
        "window.exponent=U1F6",
        "window.hidden=U1F6",
        "window.hidden_table.index_bits=4",
        "window.hidden_table.interpolation=nearest",
        "window.reciprocal.bits=8",
        "window.reciprocal.table_bits=4",
        "layers=3",
    ];
    let narrow: Vec<String> = words
        .iter()
        .map(|word| format!("fragment.{word}"))
        .collect();
    let afar = [
        "fragment.layers=3",
        "fragment.window.join_permille=300",
        "fragment.window.late=false",
        "fragment.window.inside=false",
        "fragment.evict_hidden=false",
        "timing.fragment.hazard=1",
    ];
    let of = |more: &[&str]| machine("window", &[&["timing.raster.lanes=[1,1]"], more].concat());
    vec![
        of(&[]),
        of(&["fragment.group=interval", "fragment.layers=3"]),
        of(&narrow.iter().map(String::as_str).collect::<Vec<_>>()),
        of(&afar),
        of(&["fragment.layers=1"]),
        of(&["fragment.layers=8", "timing.fragment.merge=24"]),
        of(&[
            "fragment.layers=3",
            "fragment.window.late=false",
            "fragment.window.inside=false",
        ]),
    ]
}

#[test]
fn the_rtl_of_windows_gives_every_record_on_icarus() {
    if !have(&["iverilog"], "co-simulation of windows on Icarus") {
        return;
    }
    for (_, machine) in tier::some([12, 12], windows().into_iter().take(4).enumerate()) {
        let trace = traced(&cloud(200, 16), &machine, &Window::default());
        let units = vec!["fragment".to_owned()];
        let made_up = traced(
            &cloud(20, 16),
            &machine,
            &Window {
                stimulus: Some(100),
                units,
                ..Window::default()
            },
        );
        let given = [(&trace, &STALLS[..]), (&made_up, &[])]
            .map(|(trace, stalls)| drive(Simulator::Icarus, trace, OF_WINDOWS, 16, stalls));
        println!(
            "{:?}, {} layers: {given:?} records",
            machine.fragment.group, machine.fragment.layers
        );
        assert!(given[0] > 500 && given[1] > 1000, "{given:?}");
    }
}

#[test]
fn the_rtl_of_windows_gives_every_record_on_both_simulators() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    if !have(&["iverilog", "verilator"], "co-simulation of windows") {
        return;
    }
    tier::some([12, 12], windows().into_iter().enumerate())
        .collect::<Vec<_>>()
        .into_par_iter()
        .for_each(|(number, machine)| {
            let of = |stimulus: Option<u32>| Window {
                stimulus,
                units: vec!["fragment".into()],
                ..Window::default()
            };
            let trace = traced(&cloud(600, 24), &machine, &of(None));
            let made_up = traced(&cloud(20, 24), &machine, &of(Some(20_000)));
            let seen = drive(Simulator::Icarus, &trace, OF_WINDOWS, 24, &STALLS);
            let given = drive(Simulator::Verilator, &trace, OF_WINDOWS, 24, &STALLS)
                + drive(Simulator::Verilator, &made_up, OF_WINDOWS, 24, &[]);
            println!("machine {number}: {seen} records on Icarus, {given} on Verilator");
            assert!(given > 20_000, "{given}");
        });
}

#[test]
fn every_rtl_unit_gives_every_record_of_ellipsoids_on_both_simulators() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    if !have(&["iverilog", "verilator"], "co-simulation of ellipsoids") {
        return;
    }
    for (number, (text, machine)) in tier::some([12, 12], media(16, 24).into_iter().enumerate()) {
        let trace = traced(&text, &machine, &Window::default());
        let made_up = traced(
            &text,
            &machine,
            &Window {
                stimulus: Some(20_000),
                ..Window::default()
            },
        );
        let drive = |unit: Unit| {
            let seen = drive(Simulator::Icarus, &trace, unit, 24, &[]);
            // The other units are the same as for discs, which are tested with more records.
            if unit.name == unit.stream {
                return seen;
            }
            let made_up = drive(Simulator::Verilator, &made_up, unit, 24, &STALLS);
            assert!(made_up > 10_000, "{}: {made_up} made-up cases", unit.name);
            seen + drive(Simulator::Verilator, &trace, unit, 24, &STALLS) + made_up
        };
        let given: Vec<usize> = twins(&trace).into_par_iter().map(drive).collect();
        println!("scene {number}: {given:?} records");
    }
}

/// Factor of a unit's random cases, per hundred, so that all units have about as many records: a
/// box of the raster has many pixels, some have as many additional corners, resolve has none.
fn percent(unit: &str) -> u32 {
    match unit {
        "raster" => 6,
        "sheets" => 10,
        "project" | "shade" => 53,
        "ellipse" => 64,
        "ellipsoid" => 95,
        "fragment" => 80,
        _ => 110,
    }
}

/// Factor by which a unit has fewer generated records than in the last tier.
const FEWER: usize = 50;

/// The number of generated records in this tier.
fn of_tier(records: usize) -> usize {
    tier::of([FEWER, FEWER], records)
}

#[test]
fn every_rtl_unit_gives_fifty_thousand_records_on_icarus() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    if !have(&["iverilog"], "co-simulation on Icarus") {
        return;
    }
    // In the last tier for every named machine, and for every kind of frame of ellipsoids. The words
    // of `tiny` are the fastest to simulate.
    let discs: Vec<_> = tier::some([3, 3], machines().into_iter().zip([36_000, 6000, 4000]))
        .map(|((_, machine), cases)| (cloud(60, 24), machine, cases))
        .collect();
    let media: Vec<_> = media(16, 24)
        .into_iter()
        .map(|(text, machine)| (text, machine, 6000))
        .collect();
    let [ellipsoid, sheets] = OF_ELLIPSOIDS;
    // The last of them are grouped by depth.
    let of_ellipsoids = tier::some([4, 4], media.iter().map(|of| (ellipsoid, of)))
        .chain(tier::some([4, 4], media[..6].iter().map(|of| (sheets, of))));
    let jobs: Vec<_> = of_ellipsoids
        .chain(discs.iter().flat_map(|of| UNITS.map(|unit| (unit, of))))
        .collect();
    let given = jobs.par_iter().map(|(unit, (text, machine, cases))| {
        let seen = Window {
            units: vec![unit.stream.into()],
            ..Window::default()
        };
        let made_up = Window {
            stimulus: Some(of_tier((cases * percent(unit.name) / 100) as usize) as u32),
            ..seen.clone()
        };
        let drive = |window: &Window, stalls: &[&str]| {
            drive(
                Simulator::Icarus,
                &traced(text, machine, window),
                *unit,
                24,
                stalls,
            )
        };
        (unit.name, drive(&seen, &STALLS) + drive(&made_up, &[]))
    });
    let mut records: HashMap<&str, usize> = HashMap::new();
    given
        .collect::<Vec<_>>()
        .into_iter()
        .for_each(|(unit, given)| *records.entry(unit).or_default() += given);
    println!("{records:?} records");
    let are_enough = |records: &usize| *records >= of_tier(50_000);
    assert!(
        records.len() == 9 && records.values().all(are_enough),
        "{records:?}"
    );
}

/// Pixel contents from before the window come from splats that the device did not receive: they
/// must be loaded.
#[test]
fn windows_of_splats_drive_fragment_and_sheets_alone() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    if !have(&["iverilog"], "windows on Icarus") {
        return;
    }
    let rules = machine("tiny", &["timing.raster.lanes=[1,1]", "fragment.layers=3"]);
    let discs = [(cloud(150, 16), rules, [70, 150], "fragment")];
    let media = media(12, 16)
        .into_iter()
        .take(3)
        .map(|(text, machine)| (text, machine, [80, 160], "sheets"));
    for (text, machine, splats, name) in discs.into_iter().chain(media) {
        for pixels in [None, Some([2, 3, 12, 9])] {
            let trace = traced(
                &text,
                &machine,
                &Window {
                    splats: Some(splats),
                    pixels,
                    ..Window::default()
                },
            );
            let [start, records] =
                ["fragment.start", "fragment.in"].map(|stream| trace.lines(stream).len());
            println!("{name}, {pixels:?}: {start} records at the start, {records} come");
            assert!(
                start > 50 && records > 50,
                "{start} at the start, {records} come"
            );
            drive(Simulator::Icarus, &trace, unit(name), 16, &[]);
            drive(Simulator::Icarus, &trace, unit(name), 16, &STALLS);
        }
    }
}

#[test]
fn every_rtl_unit_gives_a_million_records_on_verilator() {
    if !tier::runs(Tier::Full) {
        return;
    }
    if !have(&["verilator"], "co-simulation on Verilator") {
        return;
    }
    let (_, machine) = &machines()[2];
    // A whole frame has a million records for these three units.
    let of_a_frame = ["raster", "gauss", "fragment"];
    let least = of_tier(1_000_000) as u32;
    // Building takes most of the time.
    for unit in tier::some([3, 3], UNITS) {
        // A box of the raster has many pixels; in the other two units not every case gives a
        // record.
        let cases = match unit.name {
            "raster" => least / 10,
            name if of_a_frame.contains(&name) => least * 6 / 5,
            _ => least,
        };
        let made_up = (least < 1_000_000 || !of_a_frame.contains(&unit.name)).then_some(cases);
        // Generated records do not depend on the scene.
        let scene = if made_up.is_some() {
            cloud(60, 64)
        } else {
            GLASS_SPHERES.to_owned()
        };
        let trace = traced(
            &scene,
            machine,
            &Window {
                units: vec![unit.name.into()],
                stimulus: made_up,
                ..Window::default()
            },
        );
        let records = drive(Simulator::Verilator, &trace, unit, 64, &[]);
        println!("{}: {records} records", unit.name);
        assert!(records >= least as usize, "{}: {records}", unit.name);
    }
}

/// A frame's splats, by their indices in the scene, in the input order of the pipeline: sorted if
/// the machine sorts, with the culled splats last.
fn as_drawn(trace: &Traced) -> Vec<usize> {
    let all = 0..trace.lines("pipeline.in").len();
    let is_sorted = trace.manifest["streams"]
        .as_array()
        .unwrap()
        .iter()
        .any(|stream| stream["name"] == "sort.out");
    if !is_sorted {
        return all.collect();
    }
    let drawn: Vec<usize> = trace
        .keys("sort.out")
        .iter()
        .map(|key| key[0] as usize)
        .collect();
    let mut culled = vec![true; all.len()];
    drawn.iter().for_each(|splat| culled[*splat] = false);
    drawn
        .into_iter()
        .chain(all.filter(|splat| culled[*splat]))
        .collect()
}

/// Draws a trace's frame on the pipeline once for each of these stalls; returns the cycles up to
/// the last pixel.
fn draw(simulator: Simulator, trace: &Traced, side: u32, stalls: &[&[&str]]) -> Vec<u64> {
    let unit = wired(trace);
    let device = Device::new(simulator, &sources(), &trace.folder, unit, side);
    let lines = trace.lines("pipeline.in");
    let splats: Vec<String> = as_drawn(trace)
        .into_iter()
        .map(|splat| lines[splat].clone())
        .collect();
    let cycles = |stalls: &&[&str]| {
        let given = device.drive(Some(&splats), expected(trace, unit), stalls);
        assert_eq!(
            fault(trace, unit, &given),
            None,
            "{} on {simulator:?}, {stalls:?}",
            unit.name
        );
        let [taken, pixels] = times(&given);
        assert_eq!(
            [taken.len(), pixels.len()],
            [splats.len(), (side * side) as usize]
        );
        pixels[pixels.len() - 1] + 1
    };
    stalls.iter().map(cycles).collect()
}

/// Stalls of the whole pipeline: none, some on both sides, and many.
const OF_ALL: [&[&str]; 3] = [&[], &STALLS, &["+stall_in=80", "+stall_out=80", "+seed=23"]];

/// Minimum number of colours of a frame: it must be more than a background with a spot.
fn colours(trace: &Traced) -> usize {
    trace
        .records("pipeline.out")
        .into_iter()
        .map(|pixel| pixel[2..].to_vec())
        .collect::<HashSet<_>>()
        .len()
}

#[test]
fn the_wired_datapaths_draw_small_frames_with_any_stalls() {
    if !have(&["iverilog"], "the wired datapaths on Icarus") {
        return;
    }
    let (_, tiny) = machines().swap_remove(0);
    let scenes: Vec<(String, Machine)> = tier::some(
        [12, 12],
        [(cloud(60, 16), tiny)].into_iter().chain(media(12, 16)),
    )
    .collect();
    scenes.par_iter().for_each(|(text, machine)| {
        let trace = traced(text, machine, &Window::default());
        let cycles = draw(Simulator::Icarus, &trace, 16, &OF_ALL);
        println!(
            "{}: {} splats, {} colours, {cycles:?} cycles",
            wired(&trace).name,
            trace.lines("pipeline.in").len(),
            colours(&trace)
        );
        assert!(colours(&trace) > 60 && cycles.is_sorted(), "{cycles:?}");
    });
}

/// A frame drawn by the pipeline, with and without stalls; checks that it takes the cycles of the
/// timing model.
fn draws_in_time(text: &str, machine: &Machine, window: &Window, side: u32) {
    // One of the cycles is the model's look-up of lines.
    let machine = &changed(machine, "timing.gauss.latency=6", "timing.gauss.latency=6").unwrap();
    let trace = traced(text, machine, window);
    let unit = wired(&trace);
    let [wired, stalled] = draw(Simulator::Verilator, &trace, side, &OF_ALL[..2])[..] else {
        panic!("drawn twice")
    };
    let modelled = cycles_of_a_wired_frame(&trace, text, machine);
    let off = wired as f64 / modelled as f64 - 1.0;
    let splats = trace.lines("pipeline.in").len();
    println!(
        "{}, {splats} splats: {wired} cycles wired, {modelled} modelled: {:+.3} %; stalled {stalled}",
        unit.name,
        100.0 * off
    );
    assert!(
        off.abs() <= tolerance(unit.name),
        "{wired} cycles wired, {modelled} modelled"
    );
}

#[test]
fn the_wired_datapath_draws_the_frame_in_the_cycles_of_the_timing_model() {
    if !have(&["verilator"], "the wired datapath") {
        return;
    }
    if !tier::runs(Tier::Ci) {
        return;
    }
    // `tiny` has all units of the other machines, and a third of their words to simulate.
    draws_in_time(
        GLASS_SPHERES,
        &machines()[0].1,
        &Window {
            units: vec!["pipeline".into()],
            ..Window::default()
        },
        64,
    );
}

#[test]
fn the_wired_datapaths_of_ellipsoids_draw_frames_in_the_cycles_of_the_timing_model() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    if !have(&["verilator"], "the wired datapaths of ellipsoids") {
        return;
    }
    for (text, machine) in tier::some([12, 12], media(32, 64)) {
        draws_in_time(&text, &machine, &Window::default(), 64);
    }
}

/// The tiles of a frame in the order of their last pixels: column and row of each, and the number
/// of pixels before that one. Outputs are sorted by rows, like the model's pixels.
fn sort_by_rows(trace: &Traced, given: &Given) -> Vec<([u32; 2], usize)> {
    let text = std::fs::read_to_string(&given.out).unwrap();
    let [x, y] = ["X", "Y"].map(|axis| {
        ["LSB", "W"].map(|name| constant(trace, &format!("PIPELINE_OUT_{axis}_{name}")))
    });
    let place = |line: &str| {
        let word = u128::from_str_radix(line, 16).unwrap();
        [y, x].map(|[lsb, width]| (word >> lsb & ((1 << width) - 1)) as u32)
    };
    let mut lines: Vec<&str> = text.lines().collect();
    let mut came: HashMap<[u32; 2], u32> = HashMap::new();
    let mut done = Vec::new();
    for (nth, [row, column]) in lines.iter().map(|line| place(line)).enumerate() {
        let tile = [column / 16, row / 16];
        let pixels = came.entry(tile).or_default();
        *pixels += 1;
        done.extend((*pixels == 16 * 16).then_some((tile, nth)));
    }
    lines.sort_by_key(|line| place(line));
    std::fs::write(
        &given.out,
        lines
            .iter()
            .map(|line| format!("{line}\n"))
            .collect::<String>(),
    )
    .unwrap();
    done
}

/// Cycles without a transfer in which two engines draw a tile of a small frame.
const PATIENCE_OF_TILES: &str = "+patience=20000";

/// The fault of two engines that draw a frame twice without a reset, and the number of tiles that
/// they drew in each.
fn drawn_twice(sources: &Path, trace: &Traced, stalls: &[&str]) -> (Option<String>, Vec<usize>) {
    let device = Device::new(
        Simulator::Icarus,
        sources,
        &trace.folder,
        PIPELINE_OF_TILES,
        32,
    );
    let given = device.drive(
        None,
        expected(trace, PIPELINE_OF_TILES),
        &[&["+frames=2", PATIENCE_OF_TILES], stalls].concat(),
    );
    if !given.last.starts_with("bench: done") {
        return (Some(given.last), Vec::new());
    }
    let folder = tempfile::tempdir().unwrap();
    let Some(frames) = given.frames(2, folder.path()) else {
        return (
            Some("frames have unlike numbers of records".into()),
            Vec::new(),
        );
    };
    let tiles = frames
        .iter()
        .map(|frame| sort_by_rows(trace, frame).len())
        .collect();
    (
        frames
            .iter()
            .find_map(|frame| fault(trace, PIPELINE_OF_TILES, frame)),
        tiles,
    )
}

/// With one layer, so that mirrors merge.
fn one_layer_of_mirrors() -> Machine {
    let [mirror, ..] = mirrors("ray");
    changed(&mirror, "fragment.layers=1", "fragment.layers=1").unwrap()
}

/// Frames of four tiles with splats across their borders: for a machine that seeds each row, one
/// with tiles that no splat touches, one that differences rows, and one that mirrors along rays.
fn frames_of_tiles() -> [Traced; 4] {
    let close = cloud(60, 32).replace("\"fov_y_degrees\": 45", "\"fov_y_degrees\": 20");
    let aside = cloud(40, 32).replace("\"target\": [0, 0, 0]", "\"target\": [1.6, 1.4, 0]");
    let named = |name: &str| machine(name, &["timing.raster.lanes=[1,1]"]);
    let all = [
        (&*close, named("tiny")),
        (&aside, named("tiny")),
        (&close, named("reference")),
        (&MIRRORS.replace("1500", "300"), one_layer_of_mirrors()),
    ];
    all.map(|(text, machine)| {
        traced(
            text,
            &machine,
            &Window {
                units: vec!["pipeline".into()],
                ..Window::default()
            },
        )
    })
}

/// Each frame without stalls, and the first one also with each of these stalls.
fn stalled<'a>(frames: &'a [Traced], stalls: &[&'a [&'a str]]) -> Vec<(&'a Traced, &'a [&'a str])> {
    let first = stalls.iter().map(|stalls| (&frames[0], *stalls));
    first
        .chain(frames[1..].iter().map(|trace| (trace, OF_ALL[0])))
        .collect()
}

#[test]
fn two_engines_draw_small_frames_with_any_stalls_and_restart_without_a_reset() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    if !have(&["iverilog"], "two engines on Icarus") {
        return;
    }
    let frames = frames_of_tiles();
    // The last one takes minutes on Icarus, so it is drawn on Verilator.
    let jobs: Vec<(&Traced, &[&str])> = stalled(&frames[..3], &OF_ALL);
    jobs.par_iter().for_each(|(trace, stalls)| {
        let (fault, tiles) = drawn_twice(&sources(), trace, stalls);
        println!("{stalls:?}: {} colours", colours(trace));
        assert_eq!(fault, None, "{stalls:?}");
        assert_eq!(tiles, [4, 4]);
    });
}

/// A frame drawn by engines: checks that the cycles of the whole frame, and until each tile is
/// done, are those of the timing model.
fn engines_draw_in_time(text: &str, side: u32, wired: &Machine, unit: Unit) {
    let engines: u32 = unit.parameters.first().map_or(2, |one| {
        one.trim_matches(|char: char| !char.is_ascii_digit())
            .parse()
            .unwrap()
    });
    let trace = traced(
        text,
        wired,
        &Window {
            units: vec!["pipeline".into()],
            ..Window::default()
        },
    );
    let device = Device::new(Simulator::Verilator, &sources(), &trace.folder, unit, side);
    let [(done, cycles), (_, stalled)] = [&[][..], &STALLS].map(|stalls| {
        let given = device.drive(None, expected(&trace, unit), stalls);
        let tiles = sort_by_rows(&trace, &given);
        assert_eq!(
            fault(&trace, unit, &given),
            None,
            "{engines} engines, {stalls:?}"
        );
        let [_, pixels] = times(&given);
        let done: HashMap<[u32; 2], u64> = tiles
            .into_iter()
            .map(|(tile, last)| (tile, pixels[last] + 1))
            .collect();
        (done, pixels[pixels.len() - 1] + 1)
    });
    let modelled = modelled(
        &trace,
        text,
        wired,
        &[
            "timing.organisation=binned",
            &format!("timing.engines={engines}"),
        ],
    );
    let tiles = modelled.tiles.unwrap().tiles;
    let each: Vec<usize> = (0..engines)
        .map(|engine| tiles.iter().filter(|tile| tile.engine == engine).count())
        .collect();
    let farthest = tiles
        .iter()
        .map(|tile| done[&tile.at].abs_diff(tile.done))
        .max()
        .unwrap();
    let off = cycles as f64 / modelled.total as f64 - 1.0;
    println!(
        "{}: {engines} engines, {} splats: {cycles} cycles wired, {} modelled: {:+.3} %; stalled {stalled}; {each:?} tiles, farthest {farthest}",
        trace.manifest["machine"]["name"],
        trace.lines("pipeline.in").len(),
        modelled.total,
        100.0 * off
    );
    assert!(
        off.abs() <= tolerance(unit.name),
        "{cycles} cycles wired, {} modelled",
        modelled.total
    );
    // All engines share one output port.
    let room = tolerance(unit.name) * modelled.total as f64 + f64::from(16 * 16 * (engines - 1));
    assert!(
        farthest as f64 <= room,
        "a tile is done {farthest} cycles off"
    );
    assert!(
        each.iter().all(|tiles| *tiles > 0),
        "an engine draws nothing"
    );
}

#[test]
fn engines_draw_the_tiles_of_frames_in_the_cycles_of_the_timing_model() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    if !have(&["verilator"], "tile engines") {
        return;
    }
    let named = |nth: usize| machines().swap_remove(nth).1;
    let fewer = TILES.replace("30000", "8000");
    // Tiles have at least 16 pixels per side, so many tiles need a larger picture.
    let larger = TILES.replace("64", "128");
    let frames = [
        (TILES, 64, named(0), PIPELINE_OF_TILES),
        (&fewer, 64, named(0), OF_ONE_ENGINE),
        (&larger, 128, named(1), OF_THREE_ENGINES),
        (&fewer, 64, named(2), PIPELINE_OF_TILES),
        (
            &MIRRORS.replace("32", "64"),
            64,
            one_layer_of_mirrors(),
            PIPELINE_OF_TILES,
        ),
    ];
    for (text, side, machine, unit) in tier::some([12, 12], frames) {
        engines_draw_in_time(text, side, &machine, unit);
    }
}

/// The scene that a text describes.
fn scene_of(text: &str) -> Scene {
    let kept = tempfile::tempdir().unwrap();
    let file = kept.path().join("scene.json");
    std::fs::write(&file, text).unwrap();
    Scene::load(file.to_str().unwrap(), &Overrides::default()).unwrap()
}

/// A frame whose splats come in this order, so that no sorting is needed.
fn ordered(mut frame: Frame, order: &[usize]) -> Frame {
    frame.splats = order.iter().map(|splat| frame.splats[*splat]).collect();
    if let Some(ellipsoids) = frame
        .ellipsoids
        .as_mut()
        .filter(|ellipsoids| ellipsoids.sorted)
    {
        ellipsoids.own = order.iter().map(|splat| ellipsoids.own[*splat]).collect();
        ellipsoids.sorted = false;
    }
    frame
}

/// The timing model's cycles of a frame for the wiring of the RTL implementations: all fragments on
/// the chip, no stalls by memory, splats in drawing order. The pipeline has no look-up of lines:
/// one cycle of gauss's latency and one of its places are the look-up's here, so that the number of
/// places between raster and fragment is the same.
fn cycles_of_a_wired_frame(trace: &Traced, scene: &str, wired: &Machine) -> u64 {
    let gauss = wired.elaborate().unwrap().timing.gauss;
    let [latency, fifo] = [("latency", gauss.latency), ("fifo", gauss.fifo)]
        .map(|(name, all)| format!("timing.gauss.{name}={}", all - 1));
    let settings = [
        "timing.organisation=immediate",
        "timing.cache.latency=1",
        "timing.cache.fifo=1",
        // One line per 4×4 pixels of 64×64, and sets that are large enough for all of their lines.
        "timing.cache.lines=256",
        "timing.cache.misses=256",
        &latency,
        &fifo,
    ];
    modelled(trace, scene, wired, &settings).total
}

/// The timing model's cycles of a frame on a machine with these settings, with memory that never
/// stalls.
fn modelled(trace: &Traced, scene: &str, wired: &Machine, settings: &[&str]) -> timing::Cycles {
    let memory = [
        "timing.memory.bytes_per_cycle=1048576",
        "timing.memory.hit_latency=1",
        "timing.memory.miss_latency=1",
        "timing.memory.outstanding=1048576",
    ];
    let machine = settings
        .iter()
        .chain(&memory)
        .fold(wired.clone(), |machine, setting| {
            changed(&machine, setting, setting).unwrap()
        });
    let elaborated = fixed::elaborate(&Machine {
        sort: None,
        ..machine
    })
    .unwrap();
    let frame = quantise(&scene_of(scene), wired).unwrap().frame;
    let drawn = pipeline::draw_unobserved(&fixed::elaborate(wired).unwrap(), &frame).frame;
    let (drawing, _, work) =
        pipeline::draw_measured(&elaborated, &ordered(frame, &as_drawn(trace)));
    assert_eq!(
        drawing.frame, drawn,
        "in the order of the sort it is another frame"
    );
    let cycles = timing::replay(&elaborated.timing, &work, Detail::Histograms);
    assert_eq!(
        cycles.memory.bytes[timing::Requester::FrameRead as usize],
        [0, 0],
        "a line came back from memory"
    );
    cycles
}

/// Possible last splats of a frame, in discs: a disc at pixel (0, 0) alone, which is inserted; one
/// there that merges; a needle across the picture, with more cycles between its fragments than any
/// unit's latency.
fn last_records(side: u32) -> [String; 3] {
    let disc = |position: [f64; 3], normal: [f64; 3], radius: f64| json!({"position": position, "normal": normal, "radius": radius, "rgb": [0.9, 0.5, 0.2], "opacity": 0.7, "material": 1});
    let facing = [0.0, 0.0, 1.0];
    let wide = disc([0.0, 0.0, 0.0], facing, 0.1);
    // Centred outside the picture, it reaches no other pixel.
    let [near, middle, far] = [0.24, 0.12, 0.06].map(|z| {
        disc(
            [-0.463 * (1.0 - z / 4.0), 0.463 * (1.0 - z / 4.0), z],
            facing,
            0.05,
        )
    });
    let needle = disc([0.0, 0.0, -0.12], [0.7, 0.7, 0.14], 0.3);
    [vec![&wide, &far], vec![&near, &middle, &far], vec![&wide, &needle]].map(|splats| {
        let scene = json!({
            "splats": splats,
            "camera": {"eye": [0, 0, 4], "target": [0, 0, 0], "fov_y_degrees": 11.4, "near": 0.1},
            "image": {"width": side, "height": side, "background": [0.2, 0.4, 0.6, 0.5]},
            "surface": {"z_threshold": 0.02},
            "kernel": {"cutoff": 3.9},
            "materials": [{"unlit": true}, {"ambient": 0.15, "diffuse": 0.8, "specular": 0.3, "shininess": 32}],
            "lights": [{"direction": [0.4, 0.8, 0.5], "rgb": [1, 1, 1]}],
        });
        scene.to_string()
    })
}

/// Frames whose last record shows whether a unit still observes records in flight; their tables are
/// in a folder of another name.
fn ends() -> Vec<Traced> {
    let settings = |more: &[&str]| {
        let of_all = [
            "timing.raster.lanes=[1,1]",
            "timing.project.latency=4",
            "timing.ellipse.latency=6",
            "timing.raster.latency=6",
            "timing.gauss.latency=6",
            "timing.fragment.hazard=5",
            "timing.fragment.merge=3",
        ];
        [&of_all[..], more]
            .concat()
            .into_iter()
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    let with = |name: &str, more: &[&str]| {
        machine(
            name,
            &settings(more)
                .iter()
                .map(String::as_str)
                .collect::<Vec<_>>(),
        )
    };
    let discs = with("tiny", &["fragment.layers=2", "timing.shade.latency=5"]);
    // The slowest unit here is shade, which voxels pass on their way.
    let voxels = with("volume", &["timing.shade.latency=7"]);
    let media =
        [shells(8, 4, &json!({})), isosurface(6, 4)].map(|text| (text, voxels.clone(), None));
    // All records, and so the last one, belong to one pixel.
    let alone = (shells(8, 4, &json!({})), voxels, Some([0; 4]));
    let all = last_records(16)
        .into_iter()
        .map(|text| (text, discs.clone(), None))
        .chain(media)
        .chain([alone]);
    let moved = |(text, machine, pixels): (String, Machine, Option<[u32; 4]>)| {
        let trace = traced(
            &text,
            &machine,
            &Window {
                pixels,
                ..Window::default()
            },
        );
        std::fs::rename(trace.path("rom"), trace.path(TABLES)).unwrap();
        trace
    };
    all.map(moved).collect()
}

const TABLES: &str = "tables";

/// Visible splats, in drawing order.
fn seen_as_drawn(trace: &Traced) -> Vec<String> {
    let lines = trace.lines("pipeline.in");
    let seen: HashSet<i64> = trace.keys("fragment.in").iter().map(|key| key[0]).collect();
    as_drawn(trace)
        .into_iter()
        .filter(|splat| seen.contains(&(*splat as i64)))
        .map(|splat| lines[splat].clone())
        .collect()
}

/// Maximum cycles in which all splats of a frame of `ends` are drawn: one per pixel of a box, the
/// cycles of merges, and shading one by one.
fn most_cycles(trace: &Traced) -> i64 {
    let [left, right, top, bottom] = ["first_column", "last_column", "first_row", "last_row"]
        .map(|name| trace.field("raster.in", name));
    let boxes = trace
        .records("raster.in")
        .into_iter()
        .map(|splat| (splat[right] - splat[left] + 1) * (splat[bottom] - splat[top] + 1));
    let merges = trace
        .records("fragment.out")
        .iter()
        .filter(|decision| decision[2] == 2)
        .count();
    let asks = if has(trace, "fragment.in", "sheet") {
        0
    } else {
        trace.lines("fragment.request").len()
    };
    boxes.sum::<i64>() + 5 * merges as i64 + 10 * asks as i64
}

/// The fault of a device that draws a frame three times without a reset, each time with its last
/// record alone.
fn fault_at_the_end(sources: &Path, trace: &Traced, unit: Unit) -> Option<String> {
    let side = trace.records("frame")[0][trace.field("frame", "width")] as u32;
    let device = Device::with(
        Simulator::Icarus,
        sources,
        &trace.folder,
        unit,
        side,
        Some(&format!("{TABLES}/")),
    );
    let expected = expected(trace, unit);
    let patience = "+patience=4000";
    let faults = |inputs: Option<&[String]>, arguments: &[&str]| {
        let given = device.drive(
            inputs,
            expected,
            &[&["+frames=3", patience], arguments].concat(),
        );
        if !given.last.starts_with("bench: done") {
            return Some(given.last);
        }
        let folder = tempfile::tempdir().unwrap();
        let Some(frames) = given.frames(3, folder.path()) else {
            return Some("frames have unlike numbers of records".into());
        };
        frames.iter().find_map(|frame| fault(trace, unit, frame))
    };
    if unit.stream == "pipeline" {
        // The last splat comes alone, when none of the others is in flight.
        let splats = seen_as_drawn(trace);
        let apart = format!("+apart={}", 100 + most_cycles(trace));
        return faults(
            Some(&splats),
            &[&apart, &format!("+apart_from={}", splats.len() - 1)],
        );
    }
    faults(None, &[]).or_else(|| faults(None, &["+stall_out=80", "+seed=3"]))
}

/// The RTL implementations that depend on the end of a frame; a part of a frame has no end.
fn enders(trace: &Traced) -> Vec<Unit> {
    let is_whole = trace.path("pipeline.in.hex").exists();
    let all = is_whole.then(|| wired(trace));
    twins(trace)
        .into_iter()
        .filter(|unit| unit.stream == "fragment")
        .chain(all)
        .collect()
}

#[test]
fn frames_end_with_their_last_record_and_restart_without_a_reset() {
    if !tier::runs(Tier::Full) {
        return;
    }
    if !have(&["iverilog"], "ends of frames on Icarus") {
        return;
    }
    let ends = ends();
    let last = |trace: &Traced| trace.records("fragment.out").pop().unwrap();
    let [alone, merges] = [0, 1].map(|trace| last(&ends[trace]));
    assert_eq!(
        [&alone[..3], &merges[..3]],
        [&[0, 0, 1], &[0, 0, 2]],
        "inserted, and merged, at pixel (0, 0)"
    );
    let jobs: Vec<(&Traced, Unit)> = ends
        .iter()
        .flat_map(|trace| enders(trace).into_iter().map(move |unit| (trace, unit)))
        .collect();
    jobs.par_iter().for_each(|(trace, unit)| {
        assert_eq!(
            fault_at_the_end(&sources(), trace, *unit),
            None,
            "{}",
            unit.name
        )
    });
}

/// A machine with all words rounded to nearest-even.
fn nearest_even(machine: &Machine) -> Machine {
    fn rounded(value: &mut serde_json::Value) {
        match value {
            serde_json::Value::Object(fields) if fields.contains_key("format") => {
                fields.insert("round".into(), "nearest-even".into());
            }
            serde_json::Value::Object(fields) => fields.values_mut().for_each(rounded),
            serde_json::Value::String(format)
                if format.parse::<rtl_model::num::Format>().is_ok() =>
            {
                *value = json!({"format": format, "round": "nearest-even"});
            }
            _ => {}
        }
    }
    let mut described = serde_json::to_value(machine).unwrap();
    rounded(&mut described);
    serde_json::from_value(described).unwrap()
}

/// Rules that no named machine or scene has: a name, a scene, a machine, and the affected units.
fn rules() -> Vec<(&'static str, String, Machine, Vec<Unit>)> {
    let tiny = |more: &[&str]| machine("tiny", &[&["timing.raster.lanes=[1,1]"], more].concat());
    let dull = cloud(60, 16).replace("\"shininess\": 32", "\"shininess\": 0");
    let voxels = nearest_even(&machine("volume", &["timing.raster.lanes=[1,1]"]));
    vec![
        (
            "replace",
            cloud(60, 16),
            tiny(&["fragment.layers=1", "fragment.merge=replace"]),
            vec![unit("fragment")],
        ),
        (
            "nearest depth",
            cloud(60, 16),
            tiny(&["fragment.fragment_depth=nearest"]),
            vec![unit("fragment")],
        ),
        (
            "nearest-even",
            cloud(60, 16),
            nearest_even(&tiny(&[])),
            UNITS.to_vec(),
        ),
        (
            "nearest-even of ellipsoids",
            shells(8, 16, &json!({"stop": 0.6})),
            voxels,
            OF_ELLIPSOIDS.to_vec(),
        ),
        ("shininess 0", dull, tiny(&[]), vec![unit("shade")]),
    ]
}

/// Stimuli for each rule.
fn ruled() -> Vec<(&'static str, Traced, Vec<Unit>)> {
    let of = |(name, text, machine, units): (&'static str, String, Machine, Vec<Unit>)| {
        // Normals that cancel are rare in stimuli.
        let cases = if name == "shininess 0" { 400 } else { 50 };
        let window = Window {
            stimulus: Some(cases),
            units: units.iter().map(|unit| unit.stream.to_owned()).collect(),
            ..Window::default()
        };
        (name, traced(&text, &machine, &window), units)
    };
    rules().into_iter().map(of).collect()
}

#[test]
fn rules_that_no_named_machine_has_are_kept() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    if !have(&["iverilog"], "rules on Icarus") {
        return;
    }
    let ruled = ruled();
    let [replace, _, even, _, dull] = &ruled[..] else {
        panic!("five rules")
    };
    let outcomes: HashSet<i64> = replace
        .1
        .records("fragment.out")
        .iter()
        .map(|record| record[2])
        .collect();
    assert_eq!(
        outcomes,
        [0, 1, 4, 5].into(),
        "accumulated, inserted, replaced, dropped"
    );
    assert!(dull.1.manifest["machine"]["name"] == "tiny" && !dull.1.lines("shade.out").is_empty());
    let highlights = std::fs::read_to_string(dull.1.path("rom/shade.highlights.hex")).unwrap();
    assert!(
        highlights.lines().any(|line| line == "40000"),
        "a power of 0 is 1 from the first word on: {highlights}"
    );
    let coverage = std::fs::read_to_string(even.1.path("coverage.csv")).unwrap();
    let ties: Vec<&str> = coverage
        .lines()
        .filter(|line| line.contains("\"tie\""))
        .collect();
    let met = ties.iter().filter(|line| !line.ends_with(",0")).count();
    println!("nearest-even: {met} of {} words met a tie", ties.len());
    assert!(met * 4 > ties.len() * 3, "{ties:#?}");
    let jobs: Vec<(&Traced, Unit)> = ruled
        .iter()
        .flat_map(|(_, trace, units)| units.iter().map(move |unit| (trace, *unit)))
        .collect();
    jobs.par_iter().for_each(|(trace, unit)| {
        drive(Simulator::Icarus, trace, *unit, 16, &[]);
    });
}

/// A culled splat's record has only flags, and the comparison checks this.
#[test]
fn fields_without_a_meaning_are_zero() {
    if !have(&["iverilog"], "culled splats on Icarus") {
        return;
    }
    let trace = traced(&cloud(60, 16), &machines()[0].1, &Window::default());
    assert!(
        trace
            .records("ellipse.out")
            .iter()
            .any(|record| record[0] == 1),
        "a backface"
    );
    let mutant = Mutant {
        unit: "ellipse",
        file: "ellipse.sv",
        find: "backface || faint || outside ? '0",
        put: "faint || outside ? '0",
    };
    let folder = tempfile::tempdir().unwrap();
    mutated(&mutant, folder.path());
    let device = Device::new(
        Simulator::Icarus,
        folder.path(),
        &trace.folder,
        unit("ellipse"),
        16,
    );
    let given = device.drive(None, expected(&trace, unit("ellipse")), &[]);
    let compared = |zeros| {
        diff(
            &trace.folder,
            &outputs(unit("ellipse"), &given),
            DiffOptions {
                zeros,
                order: RequiredOrder::Trace,
            },
        )
        .unwrap()
    };
    assert!(compared(Zeros::Ignored).equal);
    assert!(!compared(Zeros::Compared).equal);
}

#[test]
fn an_offer_that_changes_fails_an_assertion() {
    if !have(&["verilator"], "assertions on Verilator") {
        return;
    }
    let trace = traced(
        &cloud(60, 16),
        &machines()[0].1,
        &Window {
            units: vec!["gauss".into()],
            ..Window::default()
        },
    );
    let put = "m_data = arrive ? arrived : fifo[head]";
    let mutant = Mutant {
        unit: "gauss",
        file: "pipe.sv",
        find: "m_data = fifo[head]",
        put,
    };
    let folder = tempfile::tempdir().unwrap();
    mutated(&mutant, folder.path());
    let device = Device::new(
        Simulator::Verilator,
        folder.path(),
        &trace.folder,
        unit("gauss"),
        16,
    );
    let given = device.drive(None, expected(&trace, unit("gauss")), &STALLS);
    assert!(
        given
            .last
            .contains("handshake: an offer that was not taken has changed"),
        "{}",
        given.last
    );
}

/// A small mistake in an RTL implementation: the file, the correct text, and its replacement.
struct Mutant {
    unit: &'static str,
    file: &'static str,
    find: &'static str,
    put: &'static str,
}

include!("cosimulation/mutants.rs");

/// A copy of the RTL implementations with a mistake in it.
fn mutated(mutant: &Mutant, folder: &Path) {
    std::fs::create_dir_all(folder.join("bench")).unwrap();
    for path in [sources(), sources().join("bench")] {
        for entry in std::fs::read_dir(&path)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.is_file())
        {
            std::fs::copy(&entry, folder.join(entry.strip_prefix(sources()).unwrap())).unwrap();
        }
    }
    let path = folder.join(mutant.file);
    let text = std::fs::read_to_string(&path).unwrap();
    assert_eq!(
        text.matches(mutant.find).count(),
        1,
        "{}: `{}` must be there, once",
        mutant.file,
        mutant.find
    );
    std::fs::write(&path, text.replace(mutant.find, mutant.put)).unwrap();
}

#[test]
fn every_mutant_is_caught() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    if !have(&["iverilog"], "mutants of the twins") {
        return;
    }
    // Several layers, and words so short that most of them round.
    let machine = machine(
        "tiny",
        &[
            "timing.raster.lanes=[1,1]",
            "fragment.layers=3",
            "fragment.merge=nearest-pair",
            "fragment.evict_hidden=true",
        ],
    );
    let seen = traced(&cloud(150, 16), &machine, &Window::default());
    let made_up = traced(
        &cloud(20, 16),
        &machine,
        &Window {
            stimulus: Some(400),
            ..Window::default()
        },
    );
    // For splats a single contribution of which may hide everything behind it.
    let covering = cloud(150, 16).replace(
        "\"z_threshold\"",
        "\"coverage_threshold\": 0.05, \"z_threshold\"",
    );
    let covering = traced(&covering, &machine, &Window::default());
    // Ellipsoids with all features of a frame; stimuli lack the features of their own transfer
    // functions.
    let of_ellipsoids: Vec<Traced> = media(8, 16)
        .into_iter()
        .map(|(text, machine)| {
            traced(
                &text,
                &machine,
                &Window {
                    stimulus: Some(400),
                    ..Window::default()
                },
            )
        })
        .collect();
    all_are_caught(MUTANTS, |mutant, sources| {
        let unit = unit(mutant.unit);
        let of_discs = [&made_up, &seen]
            .into_iter()
            .chain((unit.name == "fragment").then_some(&covering))
            .filter(|_| unit.name == unit.stream);
        // Project is the same as for discs, and also culls ellipsoids by opacity.
        let of_ellipsoids = of_ellipsoids
            .iter()
            .filter(|_| unit.name != unit.stream || unit.name == "project");
        of_discs
            .chain(of_ellipsoids)
            .filter(|trace| twins(trace).iter().any(|twin| twin.name == unit.name))
            .any(|trace| {
                let device = Device::new(Simulator::Icarus, sources, &trace.folder, unit, 16);
                fault(
                    trace,
                    unit,
                    &device.drive(None, expected(trace, unit), &STALLS),
                )
                .is_some()
            })
    });
}

#[test]
fn every_mutant_of_windows_is_caught() {
    if !tier::runs(Tier::Full) {
        return;
    }
    if !have(&["iverilog"], "mutants of the twin of windows") {
        return;
    }
    let of = |machine: Machine| {
        let window = Window {
            stimulus: Some(600),
            units: vec!["fragment".into()],
            ..Window::default()
        };
        [
            traced(&cloud(200, 16), &machine, &Window::default()),
            traced(&cloud(20, 16), &machine, &window),
        ]
    };
    let traces: Vec<Traced> = windows().into_iter().flat_map(of).collect();
    all_are_caught(WINDOWS, |_, sources| {
        traces.iter().any(|trace| {
            let device = Device::new(Simulator::Icarus, sources, &trace.folder, OF_WINDOWS, 16);
            fault(
                trace,
                OF_WINDOWS,
                &device.drive(None, expected(trace, OF_WINDOWS), &STALLS),
            )
            .is_some()
        })
    });
}

#[test]
fn every_mutant_of_a_frame_s_end_is_caught() {
    if !tier::runs(Tier::Full) {
        return;
    }
    if !have(&["iverilog"], "mutants of the twins") {
        return;
    }
    let ends = ends();
    all_are_caught(FRAME_ENDS, |mutant, sources| {
        let of = |trace: &Traced| {
            enders(trace)
                .into_iter()
                .find(|unit| unit.name == mutant.unit)
        };
        ends.iter()
            .filter_map(|trace| Some((trace, of(trace)?)))
            .any(|(trace, unit)| fault_at_the_end(sources, trace, unit).is_some())
    });
}

#[test]
fn every_mutant_of_a_rule_is_caught() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    if !have(&["iverilog"], "mutants of the twins") {
        return;
    }
    let ruled = ruled();
    all_are_caught(RULES, |mutant, sources| {
        let (of_it, rule) = (unit(mutant.unit), |units: &[Unit]| {
            units.iter().any(|unit| unit.name == mutant.unit)
        });
        ruled
            .iter()
            .filter(|(_, _, units)| rule(units))
            .any(|(_, trace, _)| {
                let device = Device::new(Simulator::Icarus, sources, &trace.folder, of_it, 16);
                fault(
                    trace,
                    of_it,
                    &device.drive(None, expected(trace, of_it), &[]),
                )
                .is_some()
            })
    });
}

#[test]
fn every_mutant_of_tiles_is_caught() {
    if !tier::runs(Tier::Full) {
        return;
    }
    if !have(&["iverilog"], "mutants of the twins") {
        return;
    }
    let frames = frames_of_tiles();
    all_are_caught(TILES_APART, |_, sources| {
        stalled(&frames, &OF_ALL[..2])
            .iter()
            .any(|(trace, stalls)| drawn_twice(sources, trace, stalls).0.is_some())
    });
}

/// Whether each of these mutants, or of those in this tier, is caught. A closure judges a copy of
/// the RTL implementations with the mutant.
fn all_are_caught(mutants: &[Mutant], catches: impl Fn(&Mutant, &Path) -> bool + Sync) {
    let survives = |mutant: &&Mutant| {
        let folder = tempfile::tempdir().unwrap();
        mutated(mutant, folder.path());
        !catches(mutant, folder.path())
    };
    let told = |mutant: &Mutant| format!("{}: `{}` for `{}`", mutant.file, mutant.put, mutant.find);
    let (all, mutants) = (mutants, some_of(mutants));
    println!("{} of {} mutants", mutants.len(), all.len());
    let survivors: Vec<String> = mutants
        .par_iter()
        .copied()
        .filter(survives)
        .map(told)
        .collect();
    assert!(
        survivors.is_empty(),
        "{} of {} were not caught:\n{}",
        survivors.len(),
        mutants.len(),
        survivors.join("\n")
    );
}

/// The first two tiers run one of this number of mutants of a unit.
const MUTANTS_ONE_IN: [usize; 2] = [12, 12];

/// Mutants in this tier, at least one per unit.
fn some_of(mutants: &[Mutant]) -> Vec<&Mutant> {
    let mut seen: HashMap<&str, usize> = HashMap::new();
    let mut is_run = |mutant: &&Mutant| {
        let number = seen.entry(mutant.unit).or_default();
        *number += 1;
        tier::has(MUTANTS_ONE_IN, *number - 1)
    };
    mutants.iter().filter(|mutant| is_run(mutant)).collect()
}

/// Cycles of input and of output records.
fn times(given: &Given) -> [Vec<u64>; 2] {
    let text = std::fs::read_to_string(&given.times).unwrap();
    ["s ", "m "].map(|side| {
        text.lines()
            .filter_map(|line| line.strip_prefix(side))
            .map(|cycle| cycle.parse().unwrap())
            .collect()
    })
}

/// A constant of a trace's package.
fn constant(trace: &Traced, name: &str) -> u64 {
    let package = std::fs::read_to_string(trace.path("machine_pkg.sv")).unwrap();
    let start = format!("localparam int {name} = ");
    package
        .split(&start)
        .nth(1)
        .and_then(|rest| rest.split(';').next())
        .unwrap()
        .parse()
        .unwrap()
}

/// The timing model's recurrence (the book, Timing): an item is taken as soon as it is present, the
/// unit is free, and there is room behind it.
struct Recurrence {
    latency: u64,
    interval: u64,
    room: usize,
    free: u64,
    /// Items that were taken and occupy a place behind the unit.
    held: usize,
}

impl Recurrence {
    fn new(trace: &Traced, unit: &str) -> Recurrence {
        let of = |name: &str| constant(trace, &format!("{}_{name}", unit.to_uppercase()));
        Recurrence {
            latency: of("LATENCY"),
            interval: of("INTERVAL"),
            room: of("ROOM") as usize,
            free: 0,
            held: 0,
        }
    }

    /// The cycle in which the next item, present at the given cycle, is taken and occupies the unit
    /// for so long; earlier items were taken by the next unit in the given cycles.
    fn take(&mut self, here: u64, cycles: u64, behind: &[u64], keeps: bool) -> u64 {
        let room = if keeps && self.held >= self.room {
            behind[self.held - self.room] + 1
        } else {
            0
        };
        let now = self.free.max(here).max(room);
        self.free = now + cycles;
        self.held += usize::from(keeps);
        now
    }
}

/// The timing model's cycles for a unit whose input never starves.
#[derive(Default)]
struct ModelledCycles {
    /// Cycles in which records are taken.
    taken: Vec<u64>,
    /// Cycles in which results are due.
    due: Vec<u64>,
    /// For `fragment`, `sheets` and `windows`: the number of stalls by a pixel's hazard, and the
    /// numbers of merges that shade none, one or two fragments.
    waits: usize,
    merges: [usize; 3],
}

/// The model's cycles if earlier results were taken by the next unit in these cycles.
fn modelled_cycles(trace: &Traced, unit: Unit, behind: &[u64]) -> ModelledCycles {
    let recurrence = Recurrence::new(trace, unit.stream);
    match unit.stream {
        "raster" => walk(trace, recurrence, behind),
        "fragment" => contribute(trace, recurrence),
        "resolve" => blend(trace, recurrence, behind),
        stream => one_by_one(
            trace.lines(&format!("{stream}.in")).len(),
            recurrence,
            behind,
        ),
    }
}

fn one_by_one(records: usize, mut recurrence: Recurrence, behind: &[u64]) -> ModelledCycles {
    let taken: Vec<u64> = (0..records)
        .map(|_| recurrence.take(0, recurrence.interval, behind, true))
        .collect();
    ModelledCycles {
        due: taken.iter().map(|now| now + recurrence.latency).collect(),
        taken,
        ..ModelledCycles::default()
    }
}

/// The raster takes one cycle per pixel of a box, and each pixel needs a place behind it: a kept
/// pixel until it is taken, a dropped pixel until this is decided.
fn walk(trace: &Traced, recurrence: Recurrence, behind: &[u64]) -> ModelledCycles {
    let mut modelled = ModelledCycles::default();
    // Cycles from which each occupied place is free again, the first one first.
    let mut given: Vec<u64> = Vec::new();
    let mut free = 0;
    let [left, right, top, bottom] = ["first_column", "last_column", "first_row", "last_row"]
        .map(|name| trace.field("raster.in", name));
    let mut kept = trace.records("raster.out").into_iter().peekable();
    for splat in trace.records("raster.in") {
        let mut first = None;
        for y in splat[top]..=splat[bottom] {
            for x in splat[left]..=splat[right] {
                let is_kept = kept
                    .next_if(|fragment| fragment[..3] == [splat[0], x, y])
                    .is_some();
                let room = given
                    .len()
                    .checked_sub(recurrence.room)
                    .map_or(0, |nth| given[nth]);
                let now = u64::max(free, room);
                free = now + recurrence.interval;
                first = first.or(Some(now));
                let again = if is_kept {
                    behind[modelled.due.len()] + 1
                } else {
                    now + recurrence.latency
                };
                given.insert(given.partition_point(|other| *other <= again), again);
                if is_kept {
                    modelled.due.push(now + recurrence.latency);
                }
            }
        }
        modelled.taken.extend(first);
    }
    modelled
}

/// A merge takes longer, by the shading of its fragments, and a taken pixel is in flight for some
/// cycles.
fn contribute(trace: &Traced, mut recurrence: Recurrence) -> ModelledCycles {
    const MERGED: i64 = 2;
    /// Outcomes of evictions in windows; the first outcome that only windows have, and the first
    /// one of windows that are formed.
    const EVICTED: i64 = 3;
    const DROPPED: i64 = 5;
    const LATE: i64 = 6;
    const SUMMED: i64 = 9;
    const PARENT: usize = 4;
    let [hazard, merge, light, next_light] = [
        "FRAGMENT_HAZARD",
        "FRAGMENT_MERGE_CYCLES",
        "SHADE_LATENCY",
        "SHADE_INTERVAL",
    ]
    .map(|name| constant(trace, name));
    let outcome = trace.field("fragment.out", "outcome");
    let decisions = trace.records("fragment.out");
    let mut shades = vec![0; decisions.len()];
    let is_sheets = trace.stream("fragment.in")["fields"]
        .as_array()
        .unwrap()
        .iter()
        .any(|field| field["name"] == "sheet");
    let is_windows = has(trace, "fragment.in", "density");
    if !is_sheets {
        // At the end, windows that no contribution formed are requested too.
        let asked = trace
            .keys("fragment.request")
            .into_iter()
            .map(|key| key[PARENT] as usize);
        asked
            .filter(|record| *record < decisions.len())
            .for_each(|record| shades[record] += 1);
    }
    // Windows are formed at one slot per cycle, and compared, before a decision: these are the
    // first cycles of a merge. The remaining ones go to a quotient, twice, to three steps in
    // between, and to the blend.
    let layers = constant(trace, "FRAGMENT_LAYERS");
    let spare = merge.saturating_sub(layers + 5);
    let forms = layers + 3 + spare / 4 + 3 * ((spare - spare / 4 * 2) / 4);
    // A splat that is a sheet of its own is blended as fast as it would be added.
    let blends_at_once =
        is_sheets && trace.records("frame")[0][trace.field("frame", "each_splat")] == 1;
    let mut modelled = ModelledCycles::default();
    let mut under_way: HashMap<[i64; 2], u64> = HashMap::new();
    let mut stopped: HashSet<[i64; 2]> = HashSet::new();
    for (decision, shades) in decisions.iter().zip(shades) {
        let evicts = is_windows && decision[outcome] == EVICTED;
        // The first dropped contribution made the sheet blend that stops its pixel.
        let stops =
            is_sheets && decision[outcome] == DROPPED && stopped.insert([decision[0], decision[1]]);
        let blends = !blends_at_once && (decision[outcome] == MERGED || stops);
        let merges = if is_windows {
            evicts || decision[outcome] >= LATE
        } else {
            blends
        };
        let forms = if evicts || is_windows && decision[outcome] >= SUMMED {
            forms
        } else {
            0
        };
        let merge = if merges { merge } else { 0 };
        let cycles = 1
            + merge
            + if shades > 0 {
                light + (shades - 1) * next_light
            } else {
                0
            };
        let pixel = under_way.entry([decision[0], decision[1]]).or_default();
        modelled.waits += usize::from(*pixel > recurrence.free);
        modelled.merges[shades as usize] += usize::from(merges);
        // There is no unit behind it, so there is always room.
        let now = recurrence.take(*pixel, cycles, &[], false);
        *pixel = now + cycles - 1 + hazard;
        modelled.taken.push(now);
        // The steps of a merge after its shading come after the decision. A decision is made in one
        // cycle and reported in the next.
        modelled
            .due
            .push(now + cycles - 1 - merge + forms + recurrence.latency.max(2));
    }
    modelled
}

/// Resolve takes one cycle per layer. A pixel counts as taken with its last layer, which needs the
/// place behind.
fn blend(trace: &Traced, mut recurrence: Recurrence, behind: &[u64]) -> ModelledCycles {
    let mut modelled = ModelledCycles::default();
    let last = trace.field("resolve.in", "last");
    let mut here = 0;
    for layer in trace.records("resolve.in") {
        let now = if layer[last] == 1 {
            recurrence.take(here, recurrence.interval, behind, true)
        } else {
            here
        };
        here = now + 1;
        modelled.taken.push(now);
        if layer[last] == 1 {
            modelled.due.push(now + recurrence.latency);
        }
    }
    modelled
}

/// Tolerance of accept times against the timing model, as a share of them: the table is in the
/// book, Accept times.
fn tolerance(unit: &str) -> f64 {
    let page = std::fs::read_to_string(
        Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/book/accept-times.md"),
    )
    .unwrap();
    let row = page
        .split("<!-- accept times -->")
        .nth(1)
        .and_then(|table| {
            table
                .lines()
                .find(|line| line.contains(&format!("`{unit}`")))
        });
    let row = row.unwrap_or_else(|| panic!("the table of accept times lacks {unit}"));
    match row.split('|').nth(3).unwrap().trim() {
        "exact" => 0.0,
        share => share.strip_suffix(" %").unwrap().parse::<f64>().unwrap() / 100.0,
    }
}

/// Checks that a unit takes its records in the cycles of the timing model, and that no result is
/// early; returns the model's cycles without stalls.
fn accepts_in_time(trace: &Traced, unit: Unit, side: u32, stalls: &[&str]) -> ModelledCycles {
    let name = unit.name;
    let device = Device::new(Simulator::Icarus, &sources(), &trace.folder, unit, side);
    let tolerance = tolerance(name);
    let in_time = |stall: &str| {
        let given = device.drive(None, expected(trace, unit), &[stall]);
        assert_eq!(fault(trace, unit, &given), None);
        let [taken, behind] = times(&given);
        let modelled = modelled_cycles(trace, unit, &behind);
        assert_eq!(taken.len(), modelled.taken.len(), "{name} {stall}");
        for (record, (taken, modelled)) in taken.iter().zip(&modelled.taken).enumerate() {
            let off = taken.abs_diff(*modelled) as f64;
            assert!(
                off <= tolerance * *modelled as f64,
                "{name} {stall}: record {record} was taken in cycle {taken}, the model has {modelled}"
            );
        }
        assert!(
            behind
                .iter()
                .zip(&modelled.due)
                .all(|(given, due)| given >= due),
            "{name} {stall}: a record came too early"
        );
        (modelled, behind)
    };
    for stall in stalls {
        in_time(stall);
    }
    let (modelled, given) = in_time("+stall_out=0");
    assert_eq!(given, modelled.due, "{name}");
    modelled
}

const STALLED: [&str; 2] = ["+stall_out=60", "+stall_out=90"];

#[test]
fn accept_times_are_those_of_the_timing_model() {
    if !have(&["iverilog"], "accept times of the twins") {
        return;
    }
    let one_lane = "timing.raster.lanes=[1,1]";
    let intervals = [
        "timing.ellipse.interval=3",
        "timing.gauss.fifo=1",
        "timing.shade.interval=2",
        "timing.resolve.interval=2",
    ];
    let trace = traced(
        &cloud(60, 16),
        &machine("tiny", &[&intervals[..], &[one_lane]].concat()),
        &Window::default(),
    );
    for name in ["project", "ellipse", "gauss", "shade", "raster", "resolve"] {
        accepts_in_time(&trace, unit(name), 16, &STALLED);
    }
    let media = media(12, 16);
    let axes = traced(
        &media[0].0,
        &machine("volume", &[&intervals[..], &[one_lane]].concat()),
        &Window::default(),
    );
    accepts_in_time(&axes, unit("ellipsoid"), 16, &STALLED);
}

#[test]
fn hazards_and_merges_take_the_cycles_of_the_timing_model() {
    if !tier::runs(Tier::Full) {
        return;
    }
    if !have(&["iverilog"], "accept times of fragment and sheets") {
        return;
    }
    let (seen, made_up) = (
        Window::default(),
        Window {
            stimulus: Some(200),
            ..Window::default()
        },
    );
    let rules = |more: &[&str]| {
        machine(
            "tiny",
            &[&["timing.raster.lanes=[1,1]", "fragment.layers=3"], more].concat(),
        )
    };
    let long = [
        "timing.fragment.merge=3",
        "timing.shade.interval=2",
        "fragment.merge=nearest-pair",
    ];
    let short = [
        "timing.technology=ideal",
        "timing.fragment.merge=0",
        "timing.fragment.hazard=1",
        "timing.fragment.latency=1",
        "timing.shade.latency=1",
    ];
    let mut merges = [0; 3];
    for more in [&long[..], &short, &[]] {
        for window in [&seen, &made_up] {
            let told = accepts_in_time(
                &traced(&cloud(60, 16), &rules(more), window),
                unit("fragment"),
                16,
                &[],
            );
            println!(
                "fragment {more:?}: {} waits, {:?} merges",
                told.waits, told.merges
            );
            assert_eq!(told.waits > 0, more != short);
            told.merges
                .iter()
                .zip(&mut merges)
                .for_each(|(more, merges)| *merges += more);
        }
    }
    assert!(
        merges.iter().all(|merges| *merges > 0),
        "of none, one and two to be shaded: {merges:?}"
    );
    // Sheets in either order, with a hazard of 1 and longer blends, and splats that are blended at
    // once.
    let sheets: Vec<_> =
        tier::some([12, 12], media(12, 16).into_iter().take(4).enumerate()).collect();
    sheets.par_iter().for_each(|(number, (text, machine))| {
        for window in [&seen, &made_up] {
            let told = accepts_in_time(&traced(text, machine, window), unit("sheets"), 16, &[]);
            println!(
                "sheets of scene {number}: {} waits, {:?} merges",
                told.waits, told.merges
            );
            assert_eq!(told.merges[0] > 0, *number < 3);
        }
    });
}

#[test]
fn blends_of_windows_take_the_cycles_of_the_timing_model() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    if !have(&["iverilog"], "accept times of windows") {
        return;
    }
    let one_lane = [
        "timing.raster.lanes=[1,1]",
        "fragment.layers=2",
        "timing.shade.interval=2",
    ];
    let mut merges = [0; 3];
    for more in [
        &["timing.fragment.hazard=1"][..],
        &["timing.fragment.merge=31"],
    ] {
        let machine = machine("window", &[&one_lane[..], more].concat());
        let units = vec!["fragment".to_owned()];
        for window in [
            Window::default(),
            Window {
                stimulus: Some(1),
                units,
                ..Window::default()
            },
        ] {
            let told = accepts_in_time(
                &traced(&cloud(100, 16), &machine, &window),
                OF_WINDOWS,
                16,
                &[],
            );
            println!(
                "windows {more:?}: {} waits, {:?} merges",
                told.waits, told.merges
            );
            told.merges
                .iter()
                .zip(&mut merges)
                .for_each(|(more, merges)| *merges += more);
        }
    }
    assert!(
        merges.iter().all(|merges| *merges > 0),
        "of none, one and two to be shaded: {merges:?}"
    );
}

/// One layer after the other, whether it was merged, and so shaded, earlier or not; a pixel takes
/// at least one cycle.
#[test]
fn resolve_takes_every_layer_in_a_cycle_as_the_timing_model_has_it() {
    if !have(&["iverilog"], "cycles of resolve") {
        return;
    }
    let (text, (_, machine)) = (cloud(150, 16), &machines()[0]);
    let trace = traced(&text, machine, &Window::default());
    let taken = accepts_in_time(&trace, unit("resolve"), 16, &[]).taken;
    let elaborated = fixed::elaborate(machine).unwrap();
    let (_, _, work) =
        fixed::draw_measured(&elaborated, &quantise(&scene_of(&text), machine).unwrap());
    let merged = work
        .held()
        .into_iter()
        .filter(|[fragments, left]| left < fragments)
        .count();
    let modelled = timing::replay(&elaborated.timing, &work, Detail::Accounts)
        .units
        .iter()
        .find(|unit| unit.name == "resolve")
        .unwrap()
        .account
        .busy;
    println!("resolve: {modelled} cycles, {merged} pixels with a fragment that was merged");
    assert_eq!((taken[taken.len() - 1] + 1, merged > 0), (modelled, true));
}

//! Does the cost model agree with synthesis of the units? The fit is in the book, on the page Cost.
//! Its LUTs are Yosys's; all other figures are computed again.

use crate::cosimulation::{have, run};
use crate::program::PROGRAM;
use crate::tier::{self, Tier};
use rtl_model::elaboration::latency::Path;
use rtl_model::elaboration::{Elaboration, Operator, Part};
use rtl_model::graph::{Builder, Wire};
use rtl_model::machine::Operators;
use rtl_model::num::Word;
use serde_json::{Value, json};
use splatsim::hardware::{fixed, machines};
use splatsim::performance::cost::{Cost, DEFAULT, UnitCost};
use splatsim::performance::given;
use splatsim::scene::{Overrides, Scene};
use std::process::Command;

/// A row of the output of `area.sh` or `gates.sh`: machine, unit, LUTs or gates of logic, and the
/// model's figure.
#[derive(Debug)]
struct SynthesisRow {
    machine: String,
    unit: String,
    mapped: f64,
    model: f64,
}

/// The rows of a printed table, and geometric mean, least and largest ratio of its last line.
fn read(printed: &str) -> (Vec<SynthesisRow>, [f64; 3]) {
    let mut lines: Vec<Vec<&str>> = printed
        .lines()
        .map(|line| line.split_whitespace().collect())
        .collect();
    let last = lines.pop().unwrap();
    let number = |word: &str| word.trim_end_matches(',').parse().unwrap();
    let row = |words: &Vec<&str>| SynthesisRow {
        machine: words[0].to_owned(),
        unit: words[1].to_owned(),
        mapped: number(words[3]),
        model: number(words[4]),
    };
    let rows = lines[1..].iter().map(row).collect();
    (
        rows,
        [5, last.len() - 3, last.len() - 1].map(|at| number(last[at])),
    )
}

/// The table below a mark of the book.
fn fit(mark: &str) -> (Vec<SynthesisRow>, [f64; 3]) {
    let text = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/book/cost.md"));
    let block = text
        .split(&format!("<!-- {mark} -->\n```text\n"))
        .nth(1)
        .expect("the book lacks the fit");
    read(block.split("\n```").next().unwrap())
}

/// Whether the standard cells are installed; they are in CI.
fn have_cells() -> bool {
    let cells = "/usr/share/qflow/tech/osu018/osu018_stdcells.lib";
    let are_there = std::path::Path::new(cells).exists();
    if !are_there {
        assert!(std::env::var_os("CI").is_none(), "{cells} is missing");
        println!("skipped: {cells} is missing (apt-get install qflow-tech-osu018)");
    }
    are_there
}

/// Delays of operators, and of a unit that is not part of the fit, are within a quarter of the
/// standard cells' by the model.
#[test]
fn delays_of_operators_are_within_a_quarter_of_the_model() {
    if !tier::runs(Tier::Full) {
        return;
    }
    if !have(&["yosys"], "delays of operators") {
        return;
    }
    if !have_cells() {
        return;
    }
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/programs/delays.sh");
    let output = run(Command::new("sh").args([
        script,
        "--splatsim",
        &PROGRAM,
        "--units",
        "gauss,raster,fragment",
        "tiny",
    ]));
    let printed = String::from_utf8(output.stdout).unwrap();
    let ratios: Vec<f64> = (printed.lines())
        .filter_map(|line| {
            Some((
                line.split_whitespace().nth(2)?.parse::<f64>().ok()?,
                line.split_whitespace().last()?.parse().ok()?,
            ))
        })
        .map(|(_, ratio)| ratio)
        .collect();
    assert_eq!(ratios.len(), 16, "{printed}");
    // The script repeats the formulas: they must be those of the crate.
    for line in printed.lines().skip(1).take_while(|line| !line.is_empty()) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let bits: Vec<i32> = words[1]
            .split('x')
            .map(|bits| bits.parse().unwrap())
            .collect();
        let (first, last, path) = (bits[0], bits[bits.len() - 1], Path::default());
        let path = match words[0] {
            "adder" => path.sum(first),
            "multiplier" => path.product(first, last),
            "shifter" => path.shift(first),
            "table" => path.table(first),
            other => panic!("the model has no {other}"),
        };
        let model: f64 = words[4].parse().unwrap();
        // Delays are truncated to tenths, twice in a product.
        assert!(
            (model - f64::from(path.delay) / 10.0).abs() < 0.25,
            "{line}: {path:?}"
        );
    }
    assert!(
        ratios.iter().all(|ratio| (0.75..1.25).contains(ratio)),
        "{printed}"
    );
    let text = include_str!(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/docs/book/clock-cells.md"
    ));
    let told = text
        .split("<!-- delays -->\n```text\n")
        .nth(1)
        .expect("the book's table of delays")
        .split("\n```")
        .next()
        .unwrap();
    for line in printed.lines() {
        assert!(
            told.lines().any(|of_book| of_book == line),
            "the book's table has no line {line:?}"
        );
    }
}

/// Machine and unit of a row of the output of `depths.sh`, and its gates, cycles, gates per stage,
/// gates of the loop, and gates from an input to s_ready.
fn depths(printed: &str) -> Vec<([String; 2], [f64; 5])> {
    let row = |line: &str| {
        let words: Vec<&str> = line.split_whitespace().collect();
        (
            [0, 1].map(|at| words[at].to_owned()),
            [2, 3, 4, 5, 6].map(|at| words[at].parse().unwrap()),
        )
    };
    printed.lines().skip(1).map(row).collect()
}

/// No loop has more than forty gates of two inputs per register, for every unit of every machine in
/// the book's table. The smallest units are counted again.
#[test]
fn no_loop_of_the_twins_is_deeper_than_forty_gates() {
    let text = include_str!(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/docs/book/clock-cells.md"
    ));
    let table = |mark: &str| {
        let rest = text
            .split(&format!("<!-- {mark} -->\n```text\n"))
            .nth(1)
            .expect("the book's table of depths");
        depths(rest.split("\n```").next().unwrap())
    };
    let (told, of_groups) = (table("depths"), table("depths of groups"));
    assert_eq!([told.len(), of_groups.len()], [12, 3]);
    for (of, [.., loop_gates, _]) in told.iter().chain(&of_groups) {
        assert!((1.0..=40.0).contains(loop_gates), "{of:?}: {loop_gates}");
    }
    if !tier::runs(Tier::Ci) || !have(&["yosys", "python3"], "depths of the twins") {
        return;
    }
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/programs/depths.sh");
    let units: Vec<&str> = tier::some([3, 3], ["gauss", "resolve", "raster"]).collect();
    let output = run(Command::new("sh").args([
        script,
        "--gates",
        "--splatsim",
        &PROGRAM,
        "--units",
        &units.join(","),
        "tiny",
    ]));
    let counted = depths(&String::from_utf8(output.stdout).unwrap());
    assert_eq!(counted.len(), units.len());
    for row in &counted {
        assert!(told.contains(row), "the book's table lacks {row:?}");
    }
}

/// Each row of a table of the book has the model's figure for a unit without its registers, and the
/// last line matches the rows.
fn checked_table(mark: &str, settings: &[&str], model: fn(&UnitCost) -> f64) -> Vec<SynthesisRow> {
    let (rows, told) = fit(mark);
    assert_eq!(rows.len(), 21);
    for row in &rows {
        // The table is for square pixels.
        let settings: Vec<String> = ["timing.raster.lanes=[1,1]", "ellipse.aspect=null"]
            .iter()
            .chain(settings)
            .map(|setting| (*setting).to_owned())
            .collect();
        let machine = fixed::elaborate(&machines::load(&row.machine, &settings).unwrap()).unwrap();
        let cost = Cost::new(&machine, &DEFAULT);
        let model = model(
            cost.units
                .iter()
                .find(|unit| unit.name == row.unit)
                .unwrap(),
        );
        // The script subtracts from an area that `machine cost` truncates to a whole LUT, and
        // rounds.
        assert!((model - row.model).abs() <= 1.5, "{row:?}: {model:.0}");
    }
    let logarithms: Vec<f64> = rows
        .iter()
        .map(|row| (row.mapped / row.model).ln())
        .collect();
    let mean = logarithms.iter().sum::<f64>() / 21.0;
    let [least, most] =
        [f64::min, f64::max].map(|of| logarithms.iter().copied().reduce(of).unwrap());
    assert_eq!(
        [mean, least, most].map(|logarithm| format!("{:.2}", logarithm.exp())),
        told.map(|ratio| format!("{ratio:.2}"))
    );
    rows
}

#[test]
fn the_fit_is_that_of_the_book() {
    checked_table("area", &["fragment.turn_normals=false"], |unit| {
        unit.area - unit.bits.register as f64 * DEFAULT.area.register
    });
}

/// The gates of each unit of these machines are within a tenth of the model's, except `gauss` of
/// `reference`, which the book mentions.
#[test]
fn the_gates_are_those_of_the_book() {
    let rows = checked_table("gates", &[], |unit| {
        unit.gates - unit.bits.register as f64 * DEFAULT.gates.register
    });
    let is_near = |row: &SynthesisRow| (0.9..=1.1).contains(&(row.mapped / row.model));
    let far: Vec<&SynthesisRow> = rows.iter().filter(|row| !is_near(row)).collect();
    let [gauss] = far[..] else { panic!("{far:?}") };
    assert!(
        gauss.machine == "reference" && gauss.unit == "gauss" && gauss.mapped / gauss.model > 0.85,
        "{gauss:?}"
    );
}

/// Areas of published machines, with the square micrometres of `tests/programs/published.rs`: within
/// 15 % of what their authors report.
#[test]
fn areas_of_published_machines_are_near_the_published_ones() {
    let gates = |name: &str| {
        let machine = machines::load(name, &[]).unwrap();
        Cost::new(&fixed::elaborate(&machine).unwrap(), &DEFAULT).gates
    };
    for (name, square_mm) in [("gscore", 3.9), ("flicker", 3.47)] {
        let gates = gates(name);
        let model = ((gates.logic + gates.flip_flops) * 0.5 + gates.sram_kbit * 1e3 * 0.3) / 1e6;
        assert!(
            (0.85..1.15).contains(&(model / square_mm)),
            "{name}: {model} mm²"
        );
    }
    let nycu = gates("nycu");
    let ratio = (nycu.logic + nycu.flip_flops) / 1.1438e6;
    assert!((0.85..1.15).contains(&ratio), "{ratio}");
}

/// Maps the smallest units again: their ratios are in the range of the book's table.
fn small_units_are_in_the_range(script: &str, mark: &str, more: &[&str]) {
    if !have(&["yosys"], "synthesis of small units") {
        return;
    }
    let script = format!("{}/tests/programs/{script}", env!("CARGO_MANIFEST_DIR"));
    let units: Vec<&str> = tier::some([3, 3], ["gauss", "resolve", "raster"]).collect();
    let given = [
        script.as_str(),
        "--splatsim",
        PROGRAM.as_str(),
        "--seconds",
        "600",
        "--units",
        &units.join(","),
    ]
    .map(str::to_owned);
    let output = run(Command::new("sh").args(given).args(more).arg("tiny"));
    let printed = String::from_utf8(output.stdout).unwrap();
    let (rows, _) = read(&printed);
    let (_, [_, least, most]) = fit(mark);
    println!("{printed}");
    assert_eq!(rows.len(), units.len());
    // To a hundredth, as printed.
    let holds =
        |row: &SynthesisRow| (least - 0.005..=most + 0.005).contains(&(row.mapped / row.model));
    assert!(rows.iter().all(holds), "{least} to {most}, but\n{printed}");
}

#[test]
fn gates_of_small_units_are_in_the_range_of_the_table() {
    if tier::runs(Tier::Ci) && have_cells() {
        small_units_are_in_the_range("gates.sh", "gates", &[]);
    }
}

#[test]
fn luts_of_small_units_are_in_the_range_of_the_table() {
    if tier::runs(Tier::Full) {
        small_units_are_in_the_range("area.sh", "area", &["--without-dsps"]);
    }
}

// ---- Nothing for nothing ----

/// The machine with every omitted latency as short as its clock allows: longer ones would gain by
/// being shortened.
fn with_least_latencies(name: &str, settings: &[&str]) -> rtl_model::Machine {
    let settings: Vec<String> = settings
        .iter()
        .map(|setting| (*setting).to_owned())
        .collect();
    let machine = machines::load(name, &settings).unwrap();
    let ways = splatsim::performance::clock::critical_paths(&fixed::elaborate(&machine).unwrap());
    let units = [
        "project", "ellipse", "raster", "gauss", "fragment", "shade", "resolve",
    ];
    let of = |unit: &&str| {
        ways.iter()
            .find(|way| *way.name == **unit)
            .map(|way| (format!("timing.{unit}.latency"), json!(way.least)))
    };
    machines::with(
        &machine,
        &units.iter().filter_map(of).collect::<Vec<_>>(),
        "",
    )
    .unwrap()
}

/// Other values of every number below `timing`, of every number of a pair, and of omitted fields.
fn changes(timing: &Value) -> Vec<(String, Value)> {
    let others = |number: u64| {
        [2 * number, number / 2, number + 1, number.saturating_sub(1)]
            .into_iter()
            .filter(move |other| *other != number)
    };
    let left_out = json!({"engines": 2, "queue": "longest", "project": {"multipliers": 4}, "ellipse": {"multipliers": 16},
        "fragment": {"units": 2, "merges_in_flight": 2, "hazard": 1}, "shade": {"units": 2}, "resolve": {"units": 2},
        "memory": {"channels": 2, "ranks": 2, "interleave_bytes": 256, "write_batch": 4, "bytes_per_cycle_permille": 500}});
    let mut all = Vec::new();
    for (nth, tree) in [timing, &left_out].into_iter().enumerate() {
        for (unit, fields) in tree.as_object().unwrap() {
            let leaves: Vec<(String, &Value)> = match fields.as_object() {
                Some(fields) => fields
                    .iter()
                    .map(|(name, value)| (format!("timing.{unit}.{name}"), value))
                    .collect(),
                None => vec![(format!("timing.{unit}"), fields)],
            };
            for (field, value) in leaves {
                match value {
                    other if nth == 1 => all.push((field, other.clone())),
                    Value::Number(number) => all.extend(
                        others(number.as_u64().unwrap()).map(|other| (field.clone(), json!(other))),
                    ),
                    Value::Array(pair) => {
                        let [a, b] = [0, 1].map(|at| pair[at].as_u64().unwrap());
                        all.extend(
                            [[2 * a, b], [a, 2 * b]].map(|pair| (field.clone(), json!(pair))),
                        );
                    }
                    _ => {}
                }
            }
        }
    }
    all
}

/// A built-in scene of 2000 splats and few pixels, so that a replay takes milliseconds.
fn few(name: &str) -> Scene {
    let kind = if name == "bouquet" {
        "gaussians"
    } else {
        "builtin"
    };
    let text = json!({"splats": {kind: name, "count": 2000}, "image": {"width": 24, "height": 16}});
    let nothing = &Overrides::default();
    Scene::from_text(
        &text.to_string(),
        name,
        std::path::Path::new(""),
        nothing,
        0,
    )
    .unwrap()
}

#[test]
fn no_field_of_timing_gains_for_nothing_unless_it_is_marked_as_given() {
    let bought = [
        "timing.memory.channels=2",
        "timing.memory.refresh_interval_cycles=400",
        "timing.memory.refresh_cycles=30",
        "timing.memory.turnaround_cycles=10",
        "timing.memory.write_batch=2",
        "timing.memory.row_cycles=20",
        "timing.memory.four_rows_cycles=30",
    ];
    let machines = [
        ("tiny", &[][..], "glass-spheres"),
        ("lean", &["timing.organisation=immediate"], "torus-knot"),
        ("gaussian", &[], "bouquet"),
        ("tiny", &bought, "torus-knot"),
        (
            "gaussian",
            &["bin.test=ellipse", "bin.tiles_per_cycle=2"],
            "bouquet",
        ),
        ("mixed", &["timing.contribution.blocks=2"], "bouquet"),
        ("weighted", &[], "bouquet"),
        ("weighted", &["sort.depth_weight={}"], "bouquet"),
        (
            "gaussian",
            &["bin.test=ellipse", "bin.subtile_px=8", "bin.masks=list"],
            "bouquet",
        ),
        (
            "gaussian",
            &[
                "sort.kind=tile",
                "timing.sort={\"units\": 2, \"buffer_entries\": 16, \"network\": 4}",
            ],
            "bouquet",
        ),
        (
            "gaussian",
            &[
                "sort.kind=hierarchical",
                "timing.sort={\"buffer_entries\": 64, \"network\": 8, \"bucket_bits\": 4}",
            ],
            "bouquet",
        ),
    ];
    let (mut tried, mut marked) = (0, 0);
    for (name, settings, scene) in machines {
        let base = with_least_latencies(name, settings);
        let scene = few(scene);
        let work = splatsim::run::evaluation::Evaluation::new(&scene, &base)
            .unwrap()
            .observe()
            .work;
        // Seconds, area, joules.
        let measured = |machine: &rtl_model::Machine| -> Option<[f64; 3]> {
            let built = fixed::elaborate(machine).ok()?;
            let cycles = rtl_model::timing::replay(
                &built.timing,
                &work,
                rtl_model::timing::Detail::Accounts,
            );
            let cost = splatsim::performance::cost::CostReport::new(&built, &cycles, &DEFAULT);
            Some([
                cycles.total as f64 / machine.timing.clock_hz as f64,
                cost.cost.area,
                cost.energy.total,
            ])
        };
        let before = measured(&base).unwrap();
        for (field, value) in changes(&machines::value(&base)["timing"]) {
            let Some(machine) = machines::with(&base, &[(field.clone(), value.clone())], "").ok()
            else {
                continue;
            };
            let Some(after) = measured(&machine) else {
                continue;
            };
            assert!(
                after.iter().all(|figure| figure.is_finite()),
                "{field}={value}: {after:?}"
            );
            tried += 1;
            let is_faster = after[0] < 0.999 * before[0];
            if is_faster && after[1] <= before[1] && after[2] <= before[2] {
                assert!(
                    given::reason_alone(&field).is_some(),
                    "{name}: {field}={value} is for nothing: {before:?} to {after:?}"
                );
                marked += 1;
            }
        }
    }
    assert!(tried > 150 && marked > 3, "{tried} tried, {marked} given");
}

/// Area of a machine with other settings.
fn area_with(name: &str, settings: &[&str]) -> f64 {
    let settings: Vec<String> = settings
        .iter()
        .map(|setting| (*setting).to_owned())
        .collect();
    Cost::new(
        &fixed::elaborate(&machines::load(name, &settings).unwrap()).unwrap(),
        &DEFAULT,
    )
    .area
}

#[test]
fn rounding_to_even_takes_more_than_rounding_up_and_a_wider_key_no_less() {
    for word in [
        "gauss.weight",
        "project.slope",
        "fragment.colour_sum",
        "shade.rgb",
    ] {
        let show = machines::value(&machines::load("lean", &[]).unwrap());
        let format = show
            .pointer(&format!("/{}", word.replace('.', "/")))
            .unwrap()
            .as_str()
            .unwrap()
            .to_owned();
        let even = format!("{word}={{\"format\":\"{format}\",\"round\":\"nearest-even\"}}");
        assert!(
            area_with("lean", &[&even]) > area_with("lean", &[]),
            "{word}"
        );
    }
    // Widths at which the key is rounded like that of its neighbour.
    let key = |bits: i32| area_with("gaussian", &[&format!("sort.key=U1F{bits}")]);
    assert!(
        (12..25).all(|bits| key(bits) < key(bits + 1)),
        "{:?}",
        (12..26).map(key).collect::<Vec<_>>()
    );
}

/// NAND2 of `fit.sv` behind a multiplier of `bits` bits, by Yosys and ABC.
fn gates_of_a_product(bits: i32, round: i32) -> f64 {
    gates_of(&format!(
        "module top(input signed [{0}:0] a, b, output [{0}:0] y); wire signed [{1}:0] p = a * b;
         fit #(.IN_W({2}), .PLACES({0}), .W({bits}), .S(1), .ROUND({round}), .WRAP(1)) fit(.exact(p), .word(y)); endmodule",
        bits - 1,
        2 * bits - 1,
        2 * bits
    ))
}

#[test]
fn rounding_to_even_costs_what_synthesis_finds() {
    if !have(&["yosys"], "rounding to even") || !have_cells() {
        return;
    }
    let bits = 8;
    let mapped = gates_of_a_product(bits, 2) - gates_of_a_product(bits, 1);
    let model = DEFAULT.gates.adder * f64::from(bits);
    assert!(
        (0.6..1.6).contains(&(mapped / model)),
        "{mapped} gates more, by the model {model}"
    );
}

/// A product of FP16, from stored bits to stored bits: significands are multiplied, the leading one
/// goes to the front unless the result is subnormal, and ties are rounded to even.
const PRODUCT_OF_FP16: &str = "
module top(input [15:0] a, b, output [15:0] y);
  wire [10:0] m = {|a[14:10], a[9:0]}, n = {|b[14:10], b[9:0]};
  wire [21:0] p = m * n;
  // The exponent of a leading one in the top bit.
  wire signed [7:0] e = $signed({3'b0, a[14:10]}) + $signed({7'b0, ~|a[14:10]}) + $signed({3'b0, b[14:10]}) + $signed({7'b0, ~|b[14:10]}) - 8'sd14;
  reg [4:0] lead;
  integer i;
  always @* begin
    lead = 22;
    for (i = 0; i < 22; i = i + 1) if (p[i]) lead = 21 - i;
  end
  wire signed [7:0] least = e - 8'sd1;
  wire is_subnormal = $signed({3'b0, lead}) > least;
  wire signed [7:0] left = is_subnormal ? least : $signed({3'b0, lead});
  wire [44:0] shifted = {23'b0, p} << (left + 8'sd23);
  wire [10:0] kept = shifted[44:34];
  wire up = shifted[33] && (|shifted[32:0] || kept[0]);
  wire signed [7:0] code = is_subnormal ? 8'sd0 : e - left;
  wire [17:0] rounded = {code, kept[9:0]} + 18'(up);
  assign y = {a[15] ^ b[15], rounded > 18'h7bff ? 15'h7bff : rounded[14:0]};
endmodule";

/// A sum of FP16, from stored bits to stored bits: the term with the lesser exponent is shifted, the
/// leading one goes to the front unless the result is subnormal, and ties are rounded to even.
const SUM_OF_FP16: &str = "
module top(input [15:0] a, b, output [15:0] y);
  wire a_less = a[14:0] < b[14:0];
  wire [15:0] x = a_less ? b : a, z = a_less ? a : b;
  wire [4:0] ex = x[14:10] | 5'(~|x[14:10]), ez = z[14:10] | 5'(~|z[14:10]);
  wire [10:0] m = {|x[14:10], x[9:0]}, n = {|z[14:10], z[9:0]};
  wire [4:0] apart = ex - ez;
  // Guard and round bits; what is shifted out beyond them sets the sticky bit.
  wire [24:0] moved = {n, 14'd0} >> (apart > 5'd13 ? 5'd13 : apart);
  wire [13:0] term = {moved[24:12], |moved[11:0]};
  wire differs = x[15] ^ z[15];
  wire [14:0] sum = {1'b0, m, 3'd0} + ({15{differs}} ^ {1'b0, term}) + 15'(differs);
  reg [3:0] lead;
  integer i;
  always @* begin
    lead = 15;
    for (i = 0; i < 15; i = i + 1) if (sum[i]) lead = 4'(14 - i);
  end
  // A leading one in bit 14 has the exponent ex + 1.
  wire is_subnormal = {1'b0, lead} > ex || ~|sum;
  wire [4:0] left = is_subnormal ? ex : {1'b0, lead};
  wire [14:0] shifted = sum << left;
  wire up = shifted[3] && (|shifted[2:0] || shifted[4]);
  wire [5:0] code = is_subnormal ? 6'd0 : {1'b0, ex} + 6'd1 - {1'b0, left};
  wire [16:0] rounded = {1'b0, code, shifted[13:4]} + 17'(up);
  assign y = {x[15], rounded > 17'h7bff ? 15'h7bff : rounded[14:0]};
endmodule";

/// NAND2 of a module called `top`, by Yosys and ABC.
fn gates_of(text: &str) -> f64 {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("top.sv");
    std::fs::write(&path, text).unwrap();
    let (cells, here) = (
        "/usr/share/qflow/tech/osu018/osu018_stdcells.lib",
        env!("CARGO_MANIFEST_DIR"),
    );
    let script = format!(
        "read_verilog -sv {here}/rtl_model/rtl/fit.sv {}; synth -flatten -top top; abc -liberty {cells} -script {here}/tests/programs/smallest.abc; \
         opt_clean; stat -liberty {cells}",
        path.display()
    );
    let printed =
        String::from_utf8(run(Command::new("yosys").args(["-p", &script])).stdout).unwrap();
    let area = printed
        .lines()
        .rfind(|line| line.contains("Chip area"))
        .and_then(|line| line.split_whitespace().last()?.parse::<f64>().ok());
    area.expect("yosys says an area") / 24.0
}

#[test]
fn a_product_in_floating_point_costs_what_synthesis_finds() {
    if !have(&["yosys"], "a product of FP16") || !have_cells() {
        return;
    }
    let model = model_of(|g, a, b| g.times(a, b));
    let mapped = gates_of(PRODUCT_OF_FP16);
    assert!(
        (0.75..1.33).contains(&(mapped / model)),
        "{mapped} gates, by the model {model}"
    );
}

#[test]
fn a_sum_in_floating_point_costs_what_synthesis_finds() {
    if !have(&["yosys"], "a sum of FP16") || !have_cells() {
        return;
    }
    let model = model_of(|g, a, b| g.plus(a, b));
    let mapped = gates_of(SUM_OF_FP16);
    assert!(
        (0.75..1.33).contains(&(mapped / model)),
        "{mapped} gates, by the model {model}"
    );
}

/// NAND2 of an operator on two words of FP16 that rounds its result, by the model.
fn model_of(operator: impl Fn(&mut Builder, Wire, Wire) -> Wire) -> f64 {
    let half = Word::new("FP16".parse().unwrap());
    let mut e = Elaboration::new(Operators::Rounded);
    let g = &mut Builder::new(&mut e, "unit");
    let [a, b] = [(); 2].map(|()| g.input(half));
    let result = operator(g, a, b);
    g.fit("result", half, result);
    let unit = DEFAULT.gates;
    let gates = |part: &Part| match part.operator {
        // docs/book/unit-costs.md.
        Operator::Multiplier([a, b]) => {
            unit.multiplier * f64::from((a - 1) * (b - 1)) + 4.0 / 3.0 * f64::from(a + b - 1)
        }
        Operator::Adder(bits) => unit.adder * f64::from(bits),
        Operator::Multiplexer(bits) => unit.multiplexer * f64::from(bits),
        // Both are without registers.
        Operator::Register(_) => 0.0,
        other => panic!("{other:?} is no part of an operator"),
    };
    (e.parts.iter())
        .map(|part| f64::from(part.copies) * gates(part))
        .sum()
}

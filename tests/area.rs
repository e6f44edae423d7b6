//! Does the cost model say what synthesis makes of the units? The book, Cost, has the fit; its LUTs are Yosys', all else is computed anew.

use crate::cosimulation::{have, run};
use crate::program::PROGRAM;
use crate::tier::{self, Tier};
use rtl_model::elaboration::latency::Path;
use splatsim::hardware::{fixed, machines};
use splatsim::performance::cost::{Cost, DEFAULT, UnitCost};
use std::process::Command;

/// A row of what `area.sh` or `gates.sh` prints: machine, unit, LUTs or gates of logic, and what the model says of them.
#[derive(Debug)]
struct Row {
    machine: String,
    unit: String,
    mapped: f64,
    model: f64,
}

/// Its rows, and geometric mean, least and most of its last line.
fn read(printed: &str) -> (Vec<Row>, [f64; 3]) {
    let mut lines: Vec<Vec<&str>> = printed.lines().map(|line| line.split_whitespace().collect()).collect();
    let last = lines.pop().unwrap();
    let number = |word: &str| word.trim_end_matches(',').parse().unwrap();
    let row = |words: &Vec<&str>| Row {
        machine: words[0].to_owned(),
        unit: words[1].to_owned(),
        mapped: number(words[3]),
        model: number(words[4]),
    };
    let rows = lines[1..].iter().map(row).collect();
    (rows, [5, last.len() - 3, last.len() - 1].map(|at| number(last[at])))
}

/// What the book has of it below a mark.
fn fit(mark: &str) -> (Vec<Row>, [f64; 3]) {
    let text = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/book/cost.md"));
    let block = text.split(&format!("<!-- {mark} -->\n```text\n")).nth(1).expect("the book lacks the fit");
    read(block.split("\n```").next().unwrap())
}

/// Whether the standard cells are there; CI has them.
fn have_cells() -> bool {
    let cells = "/usr/share/qflow/tech/osu018/osu018_stdcells.lib";
    let are_there = std::path::Path::new(cells).exists();
    if !are_there {
        assert!(std::env::var_os("CI").is_none(), "{cells} is missing");
        println!("skipped: {cells} is missing (apt-get install qflow-tech-osu018)");
    }
    are_there
}

/// Delays of operators by the model are within a quarter of what the standard cells take, and those of a unit that is no part of the fit.
#[test]
fn operators_take_as_long_as_the_model_of_the_clock_says() {
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
    let output = run(Command::new("sh").args([script, "--splatsim", &PROGRAM, "--units", "gauss,raster,fragment", "tiny"]));
    let printed = String::from_utf8(output.stdout).unwrap();
    let ratios: Vec<f64> = (printed.lines())
        .filter_map(|line| Some((line.split_whitespace().nth(2)?.parse::<f64>().ok()?, line.split_whitespace().last()?.parse().ok()?)))
        .map(|(_, ratio)| ratio)
        .collect();
    assert_eq!(ratios.len(), 16, "{printed}");
    // The script has the formulas once more: they are those of the crate.
    for line in printed.lines().skip(1).take_while(|line| !line.is_empty()) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let bits: Vec<i32> = words[1].split('x').map(|bits| bits.parse().unwrap()).collect();
        let (first, last, path) = (bits[0], bits[bits.len() - 1], Path::default());
        let path = match words[0] {
            "adder" => path.sum(first),
            "multiplier" => path.product(first, last),
            "shifter" => path.shift(first),
            "table" => path.table(first),
            other => panic!("the model has no {other}"),
        };
        let model: f64 = words[4].parse().unwrap();
        // Delays are cut to tenths, twice in a product.
        assert!((model - f64::from(path.delay) / 10.0).abs() < 0.25, "{line}: {path:?}");
    }
    assert!(ratios.iter().all(|ratio| (0.75..1.25).contains(ratio)), "{printed}");
    let text = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/book/clock.md"));
    let told = text.split("<!-- delays -->\n```text\n").nth(1).expect("the book's table of delays").split("\n```").next().unwrap();
    for line in printed.lines() {
        assert!(told.lines().any(|of_book| of_book == line), "the book's table has no line {line:?}");
    }
}

/// Machine and unit of a row of what `depths.sh` prints, and its gates, cycles, gates of a stage, of the loop, and from an input to s_ready.
fn depths(printed: &str) -> Vec<([String; 2], [f64; 5])> {
    let row = |line: &str| {
        let words: Vec<&str> = line.split_whitespace().collect();
        ([0, 1].map(|at| words[at].to_owned()), [2, 3, 4, 5, 6].map(|at| words[at].parse().unwrap()))
    };
    printed.lines().skip(1).map(row).collect()
}

/// Whatever waits for itself does so for forty gates of two inputs at most, of every unit of every machine in the book's table; of the smallest
/// units it is counted anew.
#[test]
fn no_loop_of_the_twins_is_deeper_than_forty_gates() {
    let text = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/book/clock.md"));
    let table = |mark: &str| {
        let rest = text.split(&format!("<!-- {mark} -->\n```text\n")).nth(1).expect("the book's table of depths");
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
    let output = run(Command::new("sh").args([script, "--gates", "--splatsim", &PROGRAM, "--units", &units.join(","), "tiny"]));
    let counted = depths(&String::from_utf8(output.stdout).unwrap());
    assert_eq!(counted.len(), units.len());
    for row in &counted {
        assert!(told.contains(row), "the book's table lacks {row:?}");
    }
}

/// A table of the book says what the model does, of a unit without its registers, and sums its own rows up.
fn holds_in_the_book(mark: &str, settings: &[&str], model: fn(&UnitCost) -> f64) -> Vec<Row> {
    let (rows, told) = fit(mark);
    assert_eq!(rows.len(), 21);
    for row in &rows {
        // The table is of square pixels.
        let settings: Vec<String> =
            ["timing.raster.lanes=[1,1]", "ellipse.aspect=null"].iter().chain(settings).map(|setting| (*setting).to_owned()).collect();
        let machine = fixed::elaborate(&machines::load(&row.machine, &settings).unwrap()).unwrap();
        let cost = Cost::new(&machine, &DEFAULT);
        let model = model(cost.units.iter().find(|unit| unit.name == row.unit).unwrap());
        // The script subtracts from an area that `machine cost` cuts to a whole LUT, and rounds.
        assert!((model - row.model).abs() <= 1.5, "{row:?}: {model:.0}");
    }
    let logarithms: Vec<f64> = rows.iter().map(|row| (row.mapped / row.model).ln()).collect();
    let mean = logarithms.iter().sum::<f64>() / 21.0;
    let [least, most] = [f64::min, f64::max].map(|of| logarithms.iter().copied().reduce(of).unwrap());
    assert_eq!([mean, least, most].map(|logarithm| format!("{:.2}", logarithm.exp())), told.map(|ratio| format!("{ratio:.2}")));
    rows
}

#[test]
fn the_fit_is_what_the_book_says() {
    holds_in_the_book("area", &["fragment.turn_normals=false"], |unit| unit.area - unit.bits.register as f64 * DEFAULT.area.register);
}

/// And no unit of these machines takes a tenth more or less than the model's gates, but `gauss` of `reference`, of which the book says so.
#[test]
fn the_gates_are_what_the_book_says() {
    let rows = holds_in_the_book("gates", &[], |unit| unit.gates - unit.bits.register as f64 * DEFAULT.gates.register);
    let is_near = |row: &Row| (0.9..=1.1).contains(&(row.mapped / row.model));
    let far: Vec<&Row> = rows.iter().filter(|row| !is_near(row)).collect();
    let [gauss] = far[..] else { panic!("{far:?}") };
    assert!(gauss.machine == "reference" && gauss.unit == "gauss" && gauss.mapped / gauss.model > 0.85, "{gauss:?}");
}

/// Maps the smallest units anew, and finds them in the range of the book's table.
fn small_units_are_in_the_range(script: &str, mark: &str, more: &[&str]) {
    if !have(&["yosys"], "synthesis of small units") {
        return;
    }
    let script = format!("{}/tests/programs/{script}", env!("CARGO_MANIFEST_DIR"));
    let units: Vec<&str> = tier::some([3, 3], ["gauss", "resolve", "raster"]).collect();
    let given = [script.as_str(), "--splatsim", PROGRAM.as_str(), "--seconds", "600", "--units", &units.join(",")].map(str::to_owned);
    let output = run(Command::new("sh").args(given).args(more).arg("tiny"));
    let printed = String::from_utf8(output.stdout).unwrap();
    let (rows, _) = read(&printed);
    let (_, [_, least, most]) = fit(mark);
    println!("{printed}");
    assert_eq!(rows.len(), units.len());
    // As it is printed: to a hundredth.
    let holds = |row: &Row| (least - 0.005..=most + 0.005).contains(&(row.mapped / row.model));
    assert!(rows.iter().all(holds), "{least} to {most}, but\n{printed}");
}

#[test]
fn small_units_take_the_gates_that_the_model_says() {
    if tier::runs(Tier::Ci) && have_cells() {
        small_units_are_in_the_range("gates.sh", "gates", &[]);
    }
}

#[test]
fn small_units_take_what_the_model_says() {
    if tier::runs(Tier::Full) {
        small_units_are_in_the_range("area.sh", "area", &["--without-dsps"]);
    }
}

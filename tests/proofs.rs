//! Are the proofs valid, and do they describe the machine? Gappa checks them; the arithmetic of the
//! scripts is compared with the units'.
//!
//! Gappa is run only if it is installed (`apt-get install gappa`); if `CI` is set, it must be
//! installed.

use crate::tier::{self, Tier};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use rtl_model::elaboration::Elaboration;
use rtl_model::functions::ReciprocalRoot;
use rtl_model::machine::{self, FunctionUnit, Interpolation, Machine, Rows};
use rtl_model::num::lanes::Plain;
use rtl_model::num::{Format, LANES, Rounding, Word};
use rtl_model::pipeline::Elaborated;
use rtl_model::probe::{NoProbe, Tap};
use rtl_model::units::raster::{self, Raster, Span};
use splatsim::accuracy::proofs::script::{number, within};
use splatsim::accuracy::proofs::{Proof, proofs, write};

fn elaborated(name: &str) -> Elaborated {
    Machine::named(name).unwrap().elaborate().unwrap()
}

fn all() -> Vec<(&'static str, Proof)> {
    Machine::NAMES
        .into_iter()
        .flat_map(|name| {
            proofs(&elaborated(name))
                .into_iter()
                .map(move |proof| (name, proof))
        })
        .collect()
}

fn proof(machine: &Elaborated, name: &str) -> Proof {
    proofs(machine)
        .into_iter()
        .find(|proof| proof.name == name)
        .unwrap()
}

// ---- Gappa's verdict ----

/// Gappa's output for a file: empty if everything is proved, without even a warning that a
/// rewriting is not an identity.
fn gappa(file: &Path) -> Result<(), String> {
    // A proof takes about a second; a failed search may take longer.
    let output = assert_cmd::Command::new("gappa")
        .arg(file)
        .timeout(Duration::from_secs(100))
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stdout).into_owned()
        + &String::from_utf8_lossy(&output.stderr);
    if output.status.success() && told.is_empty() {
        Ok(())
    } else {
        Err(told)
    }
}

fn is_installed() -> bool {
    let installed = Command::new("gappa")
        .arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok();
    assert!(
        installed || std::env::var_os("CI").is_none(),
        "gappa is not installed: apt-get install gappa"
    );
    if !installed {
        println!("skipped: gappa is not installed");
    }
    installed
}

#[test]
fn gappa_accepts_every_proof_of_the_named_machines() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    if !is_installed() {
        return;
    }
    for name in Machine::NAMES {
        let folder = tempfile::tempdir().unwrap();
        let proofs = proofs(&elaborated(name));
        write(&proofs, folder.path()).unwrap();
        assert_eq!(proofs.len(), 9);
        for proof in proofs {
            let verdict = gappa(&folder.path().join(proof.file_name()));
            assert_eq!(verdict, Ok(()), "{name}: {}", proof.name);
        }
    }
}

/// Unusual designs too: no Newton step, the smallest tables and words, differenced rows with coarse
/// words, other roundings.
#[test]
fn gappa_accepts_the_proofs_of_odd_machines() {
    if !is_installed() {
        return;
    }
    for (table_bits, newton_steps, bits) in [
        (1, 0, 4),
        (1, 3, 12),
        (2, 1, 4),
        (4, 0, 4),
        (4, 3, 30),
        (7, 2, 16),
    ] {
        let mut machine = Machine::named("tiny").unwrap();
        let unit = FunctionUnit {
            table_bits,
            newton_steps,
            bits,
        };
        (machine.project.reciprocal, machine.ellipse.extent_root) = (unit, unit);
        machine.raster.rows = Rows::Differenced;
        machine.raster.second = machine.raster.second.rounded(Rounding::Truncate);
        machine.raster.second.format.frac_bits = 5;
        machine.raster.first = machine.raster.first.rounded(Rounding::NearestEven);
        machine.gauss.table.interpolation = Interpolation::Linear;
        machine.gauss.falloff = machine.gauss.falloff.rounded(Rounding::Truncate);
        let direct = Machine {
            raster: machine::Raster {
                rows: Rows::Direct,
                ..machine.raster
            },
            ..machine.clone()
        };
        let [machine, direct] = [machine, direct].map(|machine| machine.elaborate().unwrap());
        let folder = tempfile::tempdir().unwrap();
        for (machine, name) in [
            (&machine, "project.reciprocal"),
            (&machine, "ellipse.extent_root"),
            (&machine, "gauss.table"),
            (&machine, "raster.radial.16"),
            (&direct, "raster.radial.16"),
        ] {
            let proof = proof(machine, name);
            write(std::slice::from_ref(&proof), folder.path()).unwrap();
            assert_eq!(
                gappa(&folder.path().join(proof.file_name())),
                Ok(()),
                "{name}: {unit:?}"
            );
        }
    }
}

/// A bound that is too small, a ROM with a wrong word and a wrong rewriting are found.
#[test]
fn gappa_rejects_wrong_proofs() {
    if !is_installed() {
        return;
    }
    let machine = elaborated("tiny");
    let folder = tempfile::tempdir().unwrap();
    let rejected = |proof: &Proof, text: String, part: &str| {
        assert_ne!(
            text,
            proof.script.text(),
            "{}: nothing is changed",
            proof.name
        );
        let file = folder.path().join(proof.file_name());
        std::fs::write(&file, text).unwrap();
        let told = gappa(&file).expect_err(&proof.name);
        assert!(told.contains(part), "{}: {told}", proof.name);
    };
    for name in [
        "project.reciprocal",
        "ellipse.root",
        "gauss.table",
        "raster.radial.16",
    ] {
        let proof = proof(&machine, name);
        rejected(
            &proof,
            proof
                .script
                .text()
                .replace(&within(proof.bound), &within(proof.bound / 4.0)),
            "Error: ",
        );
    }
    let reciprocal = proof(&machine, "project.reciprocal");
    let rom = machine.reciprocals()[0].1.guesses();
    rejected(
        &reciprocal,
        reciprocal.script.text().replace(
            &format!("m7*{}b-9 ", rom[7]),
            &format!("m7*{}b-9 ", rom[7] + 20),
        ),
        "Error: ",
    );
    let raster = proof(&machine, "raster.radial.16");
    rejected(
        &raster,
        raster.script.text().replace("+ 16*(F0", "+ 17*(F0"),
        "not trivially equal",
    );
}

// ---- The scripts agree with the units ----

/// A number `mantissa · 2^exponent`, exactly.
#[derive(Clone, Copy, Debug)]
struct Dyadic(i128, i32);

impl Dyadic {
    fn aligned(self, other: Dyadic) -> (i128, i128, i32) {
        let exponent = self.1.min(other.1);
        let at = |Dyadic(mantissa, own): Dyadic| {
            let places = (own - exponent) as u32;
            assert!(
                mantissa.unsigned_abs().leading_zeros() > places + 1 || mantissa == 0,
                "the number is too long"
            );
            mantissa << places
        };
        (at(self), at(other), exponent)
    }

    fn plus(self, other: Dyadic) -> Dyadic {
        let (a, b, exponent) = self.aligned(other);
        Dyadic(a + b, exponent)
    }

    fn times(self, other: Dyadic) -> Dyadic {
        Dyadic(self.0.checked_mul(other.0).unwrap(), self.1 + other.1)
    }

    /// The nearest multiple of 2^`place` in one of Gappa's rounding directions.
    fn rounded(self, place: i32, direction: &str) -> Dyadic {
        let places = place - self.1;
        if places <= 0 {
            return self;
        }
        let (down, unit) = (self.0 >> places, 1i128 << places);
        let twice_left = 2 * (self.0 - (down << places));
        let up = match direction {
            "dn" => false,
            "nu" => twice_left >= unit,
            "ne" => twice_left > unit || twice_left == unit && down & 1 == 1,
            _ => panic!("{direction}"),
        };
        Dyadic(down + i128::from(up), place)
    }

    fn equals(self, other: Dyadic) -> bool {
        let (a, b, _) = self.aligned(other);
        a == b
    }

    fn at_most(self, other: Dyadic) -> bool {
        let (a, b, _) = self.aligned(other);
        a <= b
    }
}

/// Reads and evaluates the expressions of definitions: sums, products, brackets, roundings, numbers
/// and names.
struct Reader<'a> {
    rest: &'a str,
    known: &'a BTreeMap<String, Dyadic>,
}

impl<'a> Reader<'a> {
    fn value(text: &'a str, known: &'a BTreeMap<String, Dyadic>) -> Dyadic {
        let mut reader = Reader { rest: text, known };
        let value = reader.sum();
        assert_eq!(reader.rest, "", "{text}");
        value
    }

    fn takes(&mut self, sign: &str) -> bool {
        let found = self.rest.trim_start().strip_prefix(sign);
        self.rest = found.unwrap_or(self.rest);
        found.is_some()
    }

    fn sum(&mut self) -> Dyadic {
        let mut sum = self.product();
        loop {
            if self.takes("+") {
                sum = sum.plus(self.product());
            } else if self.takes("-") {
                sum = sum.plus(self.product().times(Dyadic(-1, 0)));
            } else {
                return sum;
            }
        }
    }

    fn product(&mut self) -> Dyadic {
        let mut product = self.factor();
        while self.takes("*") {
            product = product.times(self.factor());
        }
        product
    }

    fn factor(&mut self) -> Dyadic {
        if self.takes("-") {
            return self.factor().times(Dyadic(-1, 0));
        }
        if self.takes("fixed<") {
            let (format, rest) = self.rest.split_once('>').unwrap();
            let (place, direction) = format.split_once(',').unwrap();
            self.rest = rest;
            return self.factor().rounded(place.parse().unwrap(), direction);
        }
        if self.takes("(") {
            let sum = self.sum();
            assert!(self.takes(")"), "{}", self.rest);
            return sum;
        }
        let text = self.rest.trim_start();
        // A number's exponent may have a sign: 3b-2.
        let is_number = text.starts_with(|c: char| c.is_ascii_digit());
        let ends = |(at, c): (usize, char)| {
            !(c.is_alphanumeric() || is_number && c == '-' && text[..at].ends_with('b'))
        };
        let end = text
            .char_indices()
            .find(|at| ends(*at))
            .map_or(text.len(), |(at, _)| at);
        let (word, rest) = text.split_at(end);
        self.rest = rest;
        if !is_number {
            return *self
                .known
                .get(word)
                .unwrap_or_else(|| panic!("{word} is not defined"));
        }
        let (mantissa, exponent) = word.split_once('b').unwrap_or((word, "0"));
        Dyadic(mantissa.parse().unwrap(), exponent.parse().unwrap())
    }
}

/// All values that a script defines, from the known ones.
fn defined(proof: &Proof, known: &[(&str, Dyadic)]) -> BTreeMap<String, Dyadic> {
    let mut all: BTreeMap<String, Dyadic> = known
        .iter()
        .map(|(name, value)| (name.to_string(), *value))
        .collect();
    for definition in &proof.script.definitions {
        let (name, expression) = definition.split_once(" = ").unwrap();
        if !all.contains_key(name) {
            let value = Reader::value(expression, &all);
            all.insert(name.to_owned(), value);
        }
    }
    all
}

/// The ends of the interval in a line `what in [low,high]`.
fn interval<'l>(lines: &'l [String], what: &str) -> Option<[Dyadic; 2]> {
    let line: &'l str = lines
        .iter()
        .find_map(|line| line.strip_prefix(what)?.strip_prefix(" in ["))?;
    let (low, high) = line.trim_end_matches(']').split_once(',')?;
    Some([low, high].map(|text| Reader::value(text, &BTreeMap::new())))
}

/// The ROM word of the script for mantissa `m`: the constant of the goal for the step that contains
/// it.
fn guess(proof: &Proof, m: Dyadic) -> Dyadic {
    let step = (0..4096).rev().find(|i| {
        let step = interval(&proof.script.hypotheses, &format!("m{i}"));
        step.is_some_and(|[low, high]| low.at_most(m) && m.at_most(high))
    });
    let step = step.unwrap();
    let goal = proof.script.goals.iter().find_map(|goal| {
        let rest = goal
            .strip_prefix(&format!("m{step}*"))
            .or_else(|| goal.strip_prefix(&format!("sqrt(m{step})*")));
        rest?.split_once(" in ")
    });
    Reader::value(goal.unwrap().0, &BTreeMap::new())
}

/// Mantissas from the least to the greatest, not only multiples of some number.
fn mantissas(bits: u32, octaves: u32) -> impl Iterator<Item = i64> {
    let (first, end) = (1i64 << bits, 1i64 << (bits + octaves));
    let step = ((end - first) / 150).max(1) | 1;
    (first..end).step_by(step as usize).chain([end - 1])
}

#[test]
fn a_reciprocals_script_agrees_with_the_unit() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    for name in Machine::NAMES {
        let machine = elaborated(name);
        for (signal, unit) in machine.reciprocals() {
            let (proof, shape) = (proof(&machine, signal), unit.shape());
            for mantissa in mantissas(shape.bits, 1) {
                let x = Dyadic((i128::from(mantissa) << 9) + 400, -(shape.bits as i32) - 9);
                let m = x.rounded(-(shape.bits as i32), "dn");
                let all = defined(&proof, &[("x", x), ("y0", guess(&proof, m))]);
                let (y, _) = unit.one((mantissa << 9) + 400, &mut Tap::new(&mut NoProbe));
                let script = all[&format!("y{}", shape.newton_steps)];
                assert!(
                    script.equals(Dyadic(y.into(), -(shape.bits as i32))),
                    "{name}: {signal} of {mantissa}: {y}, {script:?}"
                );
                assert!(m.equals(all["m"]));
            }
        }
    }
}

#[test]
fn a_reciprocal_roots_script_agrees_with_the_unit() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    for name in Machine::NAMES {
        let machine = elaborated(name);
        for (signal, elaborated) in machine.roots() {
            let (proof, shape) = (proof(&machine, signal), elaborated.shape());
            // The same unit for integer operands, whose number of bits left of the mantissa's point
            // must be even.
            let unit = ReciprocalRoot::new(&mut Elaboration::default(), "test", "root", shape, 0);
            assert_eq!(unit.guesses(), elaborated.guesses());
            let bits = shape.bits as i32;
            for mantissa in mantissas(shape.bits - 1, 2) {
                let operand = mantissa << (8 + (bits - 1) % 2);
                let m = Dyadic(mantissa.into(), 1 - bits);
                // Roots are irrational: only the values that follow from them are computed.
                let zero = Dyadic(0, 0);
                let all = defined(
                    &proof,
                    &[
                        ("m", m),
                        ("x", m),
                        ("v", m),
                        ("s", zero),
                        ("t", zero),
                        ("y0", guess(&proof, m)),
                    ],
                );
                let (y, _) = unit.one(operand, &mut Tap::new(&mut NoProbe));
                let script = all[&format!("y{}", shape.newton_steps)];
                assert!(
                    script.equals(Dyadic(y.into(), -bits)),
                    "{name}: {signal} of {mantissa}: {y}, {script:?}"
                );
                assert!(all["cut"].equals(m));
            }
        }
    }
}

/// The words are the centres of the goals' intervals, which are half an LSB to each side.
#[test]
fn the_gaussian_tables_script_agrees_with_the_unit() {
    for name in Machine::NAMES {
        let machine = elaborated(name);
        let (proof, gauss, table) = (
            proof(&machine, "gauss.table"),
            &machine.machine.gauss,
            machine.gaussian(),
        );
        let frac_bits = gauss.falloff.format.frac_bits;
        let rom = |i: i64| -> Dyadic {
            let [low, high] = interval(&proof.script.goals, &format!("e{i}")).unwrap();
            low.plus(high).times(Dyadic(1, -1))
        };
        let fraction_bits = gauss.radial_index.format.width() - gauss.table.index_bits as i32;
        for r in (0..=gauss.radial_index.format.max())
            .step_by(1 + (gauss.radial_index.format.max() / 3000) as usize)
        {
            let (i, fraction) = (r >> fraction_bits, r & ((1 << fraction_bits) - 1));
            let v = rom(i);
            let d = match gauss.table.interpolation {
                Interpolation::Linear => rom(i + 1).plus(v.times(Dyadic(-1, 0))),
                Interpolation::Nearest => Dyadic(0, 0),
            };
            let f = Dyadic(fraction.into(), -fraction_bits);
            let zero = Dyadic(0, 0);
            let all = defined(
                &proof,
                &[("v", v), ("d", d), ("f", f), ("a", zero), ("b", zero)],
            );
            let word = table.fit().one(table.exact(r));
            assert!(
                all["w"].equals(Dyadic(word.into(), -frac_bits)),
                "{name}: e^(−{r}/2) is {word}, {:?}",
                all["w"]
            );
        }
    }
}

#[test]
fn the_rasters_script_agrees_with_the_unit() {
    let direct = |name: &str| {
        let mut machine = Machine::named(name).unwrap();
        machine.raster.rows = Rows::Direct;
        let square = Word::new(Format::signed(20, 10)).rounded(Rounding::Truncate);
        machine.raster.square = Some(square);
        machine.elaborate().unwrap()
    };
    let machines = Machine::NAMES.into_iter();
    for (name, machine) in
        machines.flat_map(|name| [(name, elaborated(name)), (name, direct(name))])
    {
        let m = &machine.machine;
        let is_direct = m.raster.rows == Rows::Direct;
        let (proof, unit) = (
            proof(&machine, "raster.radial.16"),
            Raster::new(&mut Elaboration::default(), m),
        );
        let (radial, offset) = (m.raster.radial.format, m.raster.offset.format.frac_bits);
        let conic = m.ellipse.conic.format.frac_bits;
        let pixel = m.project.pixel.format.frac_bits;
        for seed in 0..200i64 {
            // Conics up to ¼, and a centre within 16 pixels of the first pixel of the box.
            let odd = |k: i64| (seed * 2_654_435_761 + k * 40_503) % 100_003;
            let words =
                [odd(1), odd(2) - 50_000, odd(3)].map(|part| ((part << conic) / 400_012) as i32);
            let at =
                [odd(4), odd(5)].map(|part| (((part - 50_000) << (pixel + 4)) / 50_001) as i32);
            let input = raster::Input {
                pixel: at,
                conic: words,
                columns: [256, 300],
                rows: [256, 300],
                ..Default::default()
            };
            let rows = if m.raster.rows == Rows::Differenced {
                16
            } else {
                0
            };
            let mut probe = NoProbe;
            let tap = &mut Tap::new(&mut probe);
            let size_px = [512, 512];
            let column = if is_direct { 256 } else { 256 + 16 };
            let walks =
                unit.enter::<Plain, _>(size_px, [column, 256 + rows], &[&input; LANES], tap);
            let mut span = Span::default();
            unit.span::<Plain, _>(size_px, &walks, 0, &input, i64::MAX, &mut span, tap);
            let [lanes, _] = unit.fragments::<Plain>(&walks, 0, &span, [0; LANES]);
            let word = lanes.0[0];
            // With direct evaluation, an r below 0 makes no fragment.
            let is_first = span.fragments() > 0 && span.places(0)[0] == 0;
            // The centre of the box's first pixel, relative to the splat's centre.
            let [x, y] = at.map(|at| {
                Dyadic((1i128 << (pixel - 1)) - i128::from(at), -pixel).rounded(-offset, "nu")
            });
            let [xx, xy, yy] = words.map(|word| Dyadic(word.into(), -conic));
            let all = defined(
                &proof,
                &[("x", x), ("y", y), ("xx", xx), ("xy", xy), ("yy", yy)],
            );
            let script = if is_direct {
                all["R"]
            } else {
                all[&format!("R{}", 16 + rows)]
            };
            // The following steps replace an r below 0 by 0.
            let below = script.0 < 0;
            assert_eq!(
                is_first,
                !is_direct || !below,
                "{name}: {script:?}, {input:?}"
            );
            assert!(
                below && word == 0 || script.equals(Dyadic(word.into(), -radial.frac_bits)),
                "{name}: {word}, {script:?}, {input:?}"
            );
        }
    }
}

// ---- The files ----

#[test]
fn a_script_states_its_claim_and_is_the_same_every_time() {
    for ((name, once), (_, again)) in all().into_iter().zip(all()) {
        let text = once.script.text();
        assert_eq!(text, again.script.text());
        assert!(
            text.is_ascii() && text.starts_with(&format!("# {} of machine {name}: ", once.name)),
            "{text}"
        );
        assert!(
            text.contains(&format!(
                "# Claimed: {} <= {}, about",
                once.claim,
                number(once.bound)
            )),
            "{text}"
        );
        assert!(text.contains(&within(once.bound)), "{}", once.name);
    }
}

#[test]
fn the_bounds_are_those_of_the_units() {
    for name in Machine::NAMES {
        let machine = elaborated(name);
        for (signal, unit) in machine.reciprocals() {
            assert_eq!(proof(&machine, signal).bound, unit.relative_error());
        }
        for (signal, unit) in machine.roots() {
            assert_eq!(proof(&machine, signal).bound, unit.relative_error());
        }
    }
}

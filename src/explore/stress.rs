//! Stress: runs the stability catalogue: small scenes, each with one parameter driven to its limit,
//! on every machine.
//!
//! ```text
//! case, value ─► scene ─┬─► ideal, golden ─┐
//!                       └─► machine ───────┴─► lockstep ─► where the method fails, where the arithmetic fails,
//!                                                          and whether every failure is reported
//! ```
//! *The method fails* if golden − ideal exceeds 8/255 anywhere. *The arithmetic fails* if fixed −
//! led does, or if the bound exceeds 1, and is thus useless, on more than 1 % of the covered
//! pixels. Flips are decisions, not arithmetic, and are counted separately. A failure is *silent*
//! if fixed − golden exceeds 8/255 and is reported neither by a flip at that pixel nor by its
//! bound.
//!
//! Laws (tests/stress.rs): `no_failure_is_silent`, `no_pixel_exceeds_its_bound`,
//! `every_flip_is_explained`.

mod cases;
mod pictures;
mod point;

pub use crate::accuracy::flicker::Pictures;
pub use cases::{CASES, Case, CaseVariant, FOCAL_PX};
pub use point::{Beyond, BoundedErrors, PointFindings, PointOutcome};

use crate::accuracy::Flips;
use crate::error::{Error, Result, in_order};
use crate::golden;
use crate::hardware::machines;
use crate::output::files::{Unwritten, write_as_one, write_beside};
use crate::output::text::{aligned, plain_table};
use crate::scene::{Scene, validate};
use rayon::prelude::*;
use rtl_model::Machine;
use schemars::JsonSchema;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// A difference of at least this is a failure.
pub const FAILS: f64 = 8.0 / 255.0;
/// Largest share of the covered pixels with a bound above 1.
pub const SHARE_FAILS: f64 = 0.01;

/// Results of the catalogue.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Catalogue {
    /// Version of this program.
    pub version: &'static str,
    /// Each case that was run.
    pub cases: Vec<CaseReport>,
    #[serde(skip)]
    gallery: Vec<Exhibit>,
}

/// One case.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct CaseReport {
    /// Its name.
    pub name: &'static str,
    /// Difficulty of the case.
    pub trouble: &'static str,
    /// Parameter that is driven.
    pub parameter: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// One report per machine.
    pub machines: Vec<MachineReport>,
}

/// One case on one machine.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct MachineReport {
    /// Its name.
    pub machine: String,
    /// First value at which the method fails.
    pub method_fails_at: Option<f64>,
    /// First value at which the arithmetic fails.
    pub arithmetic_fails_at: Option<f64>,
    /// Kind of the arithmetic's failure.
    pub arithmetic_fails_by: Option<Failure>,
    /// First value at which fixed − golden exceeds 8/255 at a pixel where a decision flipped.
    pub flips_show_at: Option<f64>,
    /// Each value, in the case's order.
    pub points: Vec<Point>,
}

/// One value of the parameter.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Point {
    /// The parameter.
    pub value: f64,
    /// Result.
    #[serde(flatten)]
    pub outcome: PointOutcome,
}

/// Failure of the arithmetic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Failure {
    /// fixed − led exceeds 8/255.
    Error,
    /// The bound exceeds 1 on more than 1 % of the covered pixels.
    Bound,
    /// The machine refuses the scene.
    Refused,
}

/// A picture of a case for the gallery.
#[derive(Clone, Debug)]
struct Exhibit {
    case: &'static Case,
    machine: String,
    value: f64,
    pictures: Pictures,
}

/// The case of this name.
///
/// # Errors
/// [`Error::Input`] with the nearest name, if one is near.
pub fn find(name: &str) -> Result<&'static Case> {
    let names = CASES.each_ref().map(|case| case.name);
    let nearest = validate::nearest(name, &names)
        .map_or(String::new(), |name| format!("; the nearest is `{name}`"));
    let input_error = || {
        Error::input(format!(
            "--case {name}: no such case{nearest} (known are {})",
            names.join(", ")
        ))
    };
    CASES
        .iter()
        .find(|case| case.name == name)
        .ok_or_else(input_error)
}

/// Runs cases on the named machines that can draw them, on their own variants and on `others`.
///
/// # Errors
/// [`Error::Input`] if a machine cannot be built.
pub fn run(cases: &[&'static Case], others: &[Machine]) -> Result<Catalogue> {
    for machine in others {
        crate::hardware::fixed::elaborate(machine)?;
    }
    let jobs: Vec<(usize, f64)> = cases
        .iter()
        .enumerate()
        .flat_map(|(i, case)| case.values.iter().map(move |value| (i, *value)))
        .collect();
    let done = in_order(
        jobs.par_iter()
            .map(|&(i, value)| run_point(cases[i], value, others)),
    )?;
    let mut catalogue = Catalogue {
        version: env!("CARGO_PKG_VERSION"),
        cases: Vec::new(),
        gallery: Vec::new(),
    };
    let mut done = done.into_iter();
    for case in cases {
        let mut machines: Vec<(String, Vec<Point>)> = Vec::new();
        for (&value, row) in case.values.iter().zip(done.by_ref()) {
            for (i, (machine, measured)) in row.into_iter().enumerate() {
                if let (true, Some(pictures)) =
                    (case.telling == (value, machine.as_str()), measured.pictures)
                {
                    catalogue.gallery.push(Exhibit {
                        case,
                        machine: machine.clone(),
                        value,
                        pictures,
                    });
                }
                if machines.len() <= i {
                    machines.push((machine, Vec::new()));
                }
                machines[i].1.push(Point {
                    value,
                    outcome: measured.outcome,
                });
            }
        }
        let Case {
            name,
            trouble,
            parameter,
            unit,
            ..
        } = **case;
        let machines = machines
            .into_iter()
            .map(|(machine, points)| MachineReport::new(machine, points))
            .collect();
        catalogue.cases.push(CaseReport {
            name,
            trouble,
            parameter,
            unit,
            machines,
        });
    }
    Ok(catalogue)
}

/// The named machines that can draw a scene; a case's variant changes the first.
fn names(scene: &Scene) -> Vec<&'static str> {
    if scene.ellipsoids.is_some() {
        vec![machines::usual(scene)]
    } else {
        surface_names().collect()
    }
}

/// The named machines that can draw surfaces.
fn surface_names() -> impl Iterator<Item = &'static str> {
    Machine::NAMES.into_iter().chain(Machine::WINDOW_NAMES)
}

/// A case at one value on all machines.
fn run_point(
    case: &Case,
    value: f64,
    others: &[Machine],
) -> Result<Vec<(String, point::PointMeasurement)>> {
    let scene = (case.scene)(value);
    let ideal = golden::ideal(&scene).picture;
    let before = cases::before(case, value).map(|scene| (golden::ideal(&scene).picture, scene));
    let named = names(&scene);
    let mut machines: Vec<Machine> = named.iter().copied().filter_map(Machine::named).collect();
    if let Some(variant) = case.variant {
        let mut machine = machines::load(named[0], &(variant.settings)(value))?;
        machine.name = variant.name.into();
        machines.push(machine);
    }
    machines.extend_from_slice(others);
    Ok(machines
        .into_iter()
        .map(|machine| {
            (
                machine.name.clone(),
                point::measure(&scene, &ideal, &machine, before.as_ref()),
            )
        })
        .collect())
}

impl Point {
    /// Results, if the machine drew.
    pub fn found(&self) -> Option<&PointFindings> {
        match &self.outcome {
            PointOutcome::Drawn(found) => Some(found),
            PointOutcome::Refused(_) => None,
        }
    }

    /// Failure of the arithmetic, if it fails.
    pub fn failure(&self) -> Option<Failure> {
        match self.found() {
            None => Some(Failure::Refused),
            Some(found) if found.lockstep.max_error > FAILS => Some(Failure::Error),
            Some(found) if found.lockstep.share_over_1 > SHARE_FAILS => Some(Failure::Bound),
            Some(_) => None,
        }
    }
}

impl MachineReport {
    fn new(machine: String, points: Vec<Point>) -> Self {
        let first = |fails: &dyn Fn(&PointFindings) -> bool| {
            points
                .iter()
                .find(|point| point.found().is_some_and(fails))
                .map(|point| point.value)
        };
        let arithmetic = points
            .iter()
            .find_map(|point| Some((point.value, point.failure()?)));
        MachineReport {
            machine,
            method_fails_at: first(&|found| found.golden_vs_ideal.max_error > FAILS),
            arithmetic_fails_at: arithmetic.map(|(value, _)| value),
            arithmetic_fails_by: arithmetic.map(|(_, by)| by),
            flips_show_at: first(&|found| found.beyond.flipped > 0),
            points,
        }
    }

    fn found(&self) -> impl Iterator<Item = &PointFindings> {
        self.points.iter().filter_map(Point::found)
    }

    fn most(&self, of: impl Fn(&PointFindings) -> f64) -> f64 {
        self.found().map(of).fold(0.0, f64::max)
    }

    fn total(&self, of: impl Fn(&PointFindings) -> u64) -> u64 {
        self.found().map(of).sum()
    }
}

/// A parameter's value in short form.
fn short(value: f64) -> String {
    let small = value != 0.0 && !(1e-3..1e4).contains(&value.abs());
    if small {
        format!("{value:e}")
    } else {
        value.to_string()
    }
}

/// A value at which something fails, or a dash.
fn first(value: Option<f64>) -> String {
    value.map_or_else(|| "–".into(), short)
}

/// A machine's name, shortened for the table.
fn cut(name: &str) -> String {
    const ROOM: usize = 10;
    if name.chars().count() <= ROOM {
        name.into()
    } else {
        name.chars().take(ROOM - 1).chain(['…']).collect()
    }
}

impl Catalogue {
    /// Number of faults over all points: 0 in a sound simulator.
    pub fn faults(&self) -> u64 {
        self.machines()
            .map(|(_, machine)| machine.total(PointFindings::faults))
            .sum()
    }

    /// The first fault in one sentence, for exit status 1.
    ///
    /// # Errors
    /// [`Error::Job`] if a pixel exceeds its bound, a flip has no explanation or a failure is
    /// silent.
    pub fn check(&self) -> Result<()> {
        let faulty = |(case, machine): (&CaseReport, &MachineReport)| {
            let point = machine
                .points
                .iter()
                .find(|point| point.found().is_some_and(|found| found.faults() > 0))?;
            let found = point.found()?;
            Some(format!(
                "{} at {} on {}: {} pixels exceed their bound, {} flips are unexplained, {} failures are silent{}",
                case.name,
                short(point.value),
                machine.machine,
                found.lockstep.violations,
                found.lockstep.flips.unexplained,
                found.beyond.silent,
                if found.not_finite() > 0 {
                    format!(", {} pixels are NaN", found.not_finite())
                } else {
                    String::new()
                }
            ))
        };
        match self.machines().find_map(faulty) {
            Some(sentence) => Err(Error::job(format!(
                "{} faults in the catalogue, the first in {sentence}",
                self.faults()
            ))),
            None => Ok(()),
        }
    }

    fn machines(&self) -> impl Iterator<Item = (&CaseReport, &MachineReport)> {
        self.cases
            .iter()
            .flat_map(|case| case.machines.iter().map(move |machine| (case, machine)))
    }

    /// The table for a terminal, at most 80 columns wide.
    pub fn table(&self) -> String {
        let mut table = plain_table(&[
            "case",
            "machine",
            "method",
            "arithmetic",
            "flips",
            "error",
            "bound > 1",
            "flipped",
        ]);
        let cases = self.cases.iter().flat_map(|case| {
            case.machines
                .iter()
                .enumerate()
                .map(move |(nth, machine)| (nth, case, machine))
        });
        for (nth, case, machine) in cases {
            let by = match machine.arithmetic_fails_by {
                Some(Failure::Bound) => " b",
                Some(Failure::Refused) => " r",
                Some(Failure::Error) => " e",
                None => "",
            };
            let shown = if nth == 0 { case.name } else { "" };
            table.add_row([
                shown.to_owned(),
                cut(&machine.machine),
                first(machine.method_fails_at),
                format!("{}{by}", first(machine.arithmetic_fails_at)),
                first(machine.flips_show_at),
                format!("{:.4}", machine.most(|found| found.lockstep.max_error)),
                format!(
                    "{:.1} %",
                    100.0 * machine.most(|found| found.lockstep.share_over_1)
                ),
                machine
                    .total(|found| found.lockstep.flips.total())
                    .to_string(),
            ]);
        }
        let points: usize = self
            .machines()
            .map(|(_, machine)| machine.points.len())
            .sum();
        let total = |of: fn(&PointFindings) -> u64| {
            self.machines()
                .map(|(_, machine)| machine.total(of))
                .sum::<u64>()
        };
        format!(
            "{}\n\n{LEGEND}\n\n{points} points: {} pixels exceed their bound, {} flips are unexplained, {} failures\nare silent",
            aligned(table).trim_fmt(),
            total(|found| found.lockstep.violations),
            total(|found| found.lockstep.flips.unexplained),
            total(|found| found.beyond.silent),
        )
    }

    /// Writes tables and pictures into a folder; returns the files.
    ///
    /// # Errors
    /// [`Error::Job`] if a file cannot be written; no file is left incomplete.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>> {
        let csv = |path: &Path| {
            write_beside(path, |file| {
                std::io::Write::write_all(file, self.csv().as_bytes()).map_err(|e| e.to_string())
            })
        };
        let json = |path: &Path| {
            write_beside(path, |file| {
                serde_json::to_writer_pretty(file, self).map_err(|e| e.to_string())
            })
        };
        let files: Vec<Unwritten> = vec![
            (folder.join("stress.csv"), Box::new(csv)),
            (
                folder.join("stress.png"),
                Box::new(|path| pictures::write_chart(self, path)),
            ),
            (
                folder.join("gallery.png"),
                Box::new(|path| pictures::write_gallery(&self.gallery, path)),
            ),
            (folder.join("stress.json"), Box::new(json)),
        ];
        let mut written = write_as_one(folder, files, &[])?;
        written.rotate_right(1);
        Ok(written)
    }

    /// One line per point.
    fn csv(&self) -> String {
        let columns = columns();
        let mut text = columns.join(",") + "\n";
        for (case, machine) in self.machines() {
            for point in &machine.points {
                let mut cells = vec![
                    case.name.to_owned(),
                    machine.machine.clone(),
                    point.value.to_string(),
                ];
                cells.extend(match &point.outcome {
                    PointOutcome::Refused(sentence) => {
                        let mut cells = vec![String::new(); columns.len() - 4];
                        cells.push(format!("\"{}\"", sentence.replace('"', "\"\"")));
                        cells
                    }
                    PointOutcome::Drawn(found) => found.cells(),
                });
                text += &(cells.join(",") + "\n");
            }
        }
        text
    }
}

const LEGEND: &str = "\
method      first value at which golden − ideal exceeds 8/255
arithmetic  first value at which fixed − led exceeds 8/255 (e), or its bound
            exceeds 1 on more than 1 % of the covered pixels (b), or the machine
            refuses the scene (r)
flips       first value at which a flipped decision makes more than 8/255
error       greatest |fixed − led|
bound > 1   greatest share of the covered pixels whose bound exceeds 1
flipped     decisions that golden takes otherwise, over all values";

/// Columns of the CSV file.
fn columns() -> Vec<String> {
    let before = [
        "case",
        "machine",
        "value",
        "golden_ideal_max",
        "golden_ideal_db",
        "fixed_golden_max",
        "fixed_golden_db",
        "fixed_led_max",
        "bound_max",
        "bound_share_over_1",
        "violations",
    ];
    let kinds = Flips::default()
        .by_kind()
        .map(|(kind, _)| format!("flips_{kind}"));
    let after = [
        "flips_unexplained",
        "silent",
        "covered_pixels",
        "saturated",
        "wrapped",
    ];
    let flicker = [
        "flicker_fixed_golden_jumps",
        "flicker_golden_ideal_jumps",
        "refused",
    ];
    before
        .map(String::from)
        .into_iter()
        .chain(kinds)
        .chain(after.map(String::from))
        .chain(flicker.map(String::from))
        .collect()
}

impl PointFindings {
    fn cells(&self) -> Vec<String> {
        let number = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
        let (l, f) = (&self.lockstep, &self.lockstep.flips);
        let mut cells = vec![
            self.golden_vs_ideal.max_error.to_string(),
            number(self.golden_vs_ideal.psnr_covered_db),
            self.fixed_vs_golden.max_error.to_string(),
            number(self.fixed_vs_golden.psnr_covered_db),
            l.max_error.to_string(),
            number(l.max_bound),
            l.share_over_1.to_string(),
        ];
        let flips = f.by_kind().map(|(_, count)| count);
        let counts = [
            f.unexplained,
            self.beyond.silent,
            self.covered_pixels,
            self.saturated,
            self.wrapped,
        ];
        cells.extend(
            [l.violations]
                .iter()
                .chain(&flips)
                .chain(&counts)
                .map(u64::to_string),
        );
        let changes = self.flicker.map_or([None; 2], |flicker| {
            [flicker.fixed_vs_golden.jumps, flicker.golden_vs_ideal.jumps]
        });
        cells.extend(changes.map(number));
        cells.push(String::new());
        cells
    }
}

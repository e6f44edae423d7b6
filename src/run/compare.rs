//! Compare: two machines, or two frames that `run` drew, side by side (docs/book/compare.md).
//!
//! ```text
//! machine ──────────────► description, area ──┐
//! machine ─► run, replay ─► the same, a frame ┼─► side ─┐
//! report.json, pictures ──────────────────────┘         ├─► comparison ─┬─► text, 80 columns
//!                                                  side ─┘               └─► compare.json, a.png, b.png, difference.png
//! ```
//! Both sides are reports in JSON. The report of a machine without a frame contains only its
//! description and its area.
//!
//! Laws (tests/compare.rs): `what_is_compared_with_itself_does_not_differ`,
//! `every_figure_is_the_one_of_its_report`.

mod fields;
mod side;
mod text;

pub use side::{ComparisonSide, Workload};

use crate::accuracy::{error_picture, metrics};
use crate::error::Result;
use crate::output::files::{Unwritten, write_as_one, write_beside};
use crate::output::picture::Picture;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Two sides, and all differences.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Comparison {
    /// Version of this program.
    pub version: &'static str,
    /// The first side, by the name given by the user.
    pub a: Named,
    /// The second side.
    pub b: Named,
    /// Nothing differs except `host`: the computer and its times.
    pub equal: bool,
    /// Figures that both have, in the order of a report.
    pub figures: Vec<ComparedFigure>,
    /// Cycles and area of every unit that either side has; empty without a frame if no area
    /// differs.
    pub units: Vec<ComparedUnit>,
    /// Fields of the machine's description that differ, in the order of a machine file.
    pub machine: Vec<Difference>,
    /// Fields of the scene that differ.
    pub scene: Vec<Difference>,
    /// Other parts of `report.json` that differ, by name.
    pub elsewhere: Vec<String>,
    /// Pictures of the same name against each other, if both sides have them.
    pub pictures: Vec<Pictures>,
    /// Factor of `difference.png`, |fixed of A − fixed of B|; none without pictures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub difference_scale: Option<f64>,
}

/// Pictures that a comparison of two frames writes.
const FILES: [&str; 3] = ["a.png", "b.png", "difference.png"];

/// One side of a comparison.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Named {
    /// Name on the command line.
    pub name: String,
    /// The machine's name.
    pub machine: String,
    /// The scene's name; none without a frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scene: Option<String>,
    /// Columns and rows; none without a frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<[u64; 2]>,
}

/// A figure of both sides.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[schemars(rename = "Figure")]
pub struct ComparedFigure {
    /// Name of the figure, with the unit of the text.
    pub name: &'static str,
    /// Path in `report.json`.
    pub path: String,
    /// Value of the first side: a number in the report's unit, or a text. Decibels are `equal` for
    /// equal pictures, and `NaN` for pictures with a NaN or infinite pixel.
    pub a: Value,
    /// Value of the second side.
    pub b: Value,
    /// Factor from the report's unit to that of the name, if they differ.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// b − a, for numbers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub difference: Option<f64>,
    /// (b − a) / a, for numbers that are not decibels, if a is not 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relative: Option<f64>,
}

/// A unit of both sides.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[schemars(rename = "Unit")]
pub struct ComparedUnit {
    /// Its name.
    pub name: String,
    /// Figures of the first side; empty if it has no such unit.
    pub a: UnitSide,
    /// Figures of the second side.
    pub b: UnitSide,
}

/// A unit of one side.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct UnitSide {
    /// Cycles busy, starved, blocked, stalled by memory; none without a frame, or without such a
    /// unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cycles: Option<[u64; 4]>,
    /// The cause that blocked it longest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blocked_by: Option<String>,
    /// LUT equivalents; none for a unit that is not part of the total area.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub area: Option<f64>,
}

/// A field that differs.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Difference {
    /// Its path, as `--set` takes it.
    pub field: String,
    /// Value of the first side.
    pub a: Option<Value>,
    /// Value of the second side.
    pub b: Option<Value>,
    /// Sides that leave the field out, `a` or `b`: their value is the default, or follows from
    /// formats and clock; none if there is no value.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<&'static str>,
}

/// Two pictures of the same name.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Pictures {
    /// `fixed`, `golden` or `ideal`.
    pub name: &'static str,
    /// PSNR between the two, linear light, peak 1; none if they are equal.
    pub psnr_db: Option<f64>,
    /// Structural similarity.
    pub ssim: f64,
    /// Greatest absolute difference.
    pub max_error: f64,
    /// Mean absolute difference.
    pub mean_error: f64,
    /// Pixels with a channel that differs by more than 1/255.
    pub pixels_over_1_255: u64,
    /// Pixels with any difference, including opacity.
    pub pixels_that_differ: u64,
}

impl Comparison {
    /// Compares two sides.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] if the sizes of their pictures differ.
    pub fn new(a: &ComparisonSide, b: &ComparisonSide) -> Result<Self> {
        side::check_sizes(a, b)?;
        let figures = fields::figures(&a.report, &b.report);
        let units = fields::units(&a.report, &b.report);
        let machine = fields::machine(&a.report, &b.report);
        let scene = fields::scene(&a.report, &b.report);
        let pictures: Vec<Pictures> = pairs(a, b)
            .map(|(name, one, other)| Pictures::new(name, one, other))
            .collect();
        let is_shown = figures.iter().any(|figure| figure.a != figure.b)
            || units.iter().any(|unit| unit.a != unit.b)
            || !machine.is_empty()
            || !scene.is_empty();
        let elsewhere = elsewhere(&a.report, &b.report, is_shown);
        let equal = !is_shown
            && elsewhere.is_empty()
            && pictures.iter().all(|pair| pair.pixels_that_differ == 0);
        let difference_scale = fixed(a, b).map(|[one, other]| error_picture(one, other).scale);
        Ok(Comparison {
            version: env!("CARGO_PKG_VERSION"),
            a: a.named(),
            b: b.named(),
            equal,
            figures,
            units,
            machine,
            scene,
            elsewhere,
            pictures,
            difference_scale,
        })
    }

    /// Writes `compare.json`, and the pictures if there are any; returns the paths.
    ///
    /// # Errors
    /// [`crate::error::Error::Job`] if a file cannot be written; no file is left half-written.
    pub fn write(
        &self,
        a: &ComparisonSide,
        b: &ComparisonSide,
        folder: &Path,
    ) -> Result<Vec<PathBuf>> {
        let shown = fixed(a, b).map(|[one, other]| {
            [
                one.clone(),
                other.clone(),
                error_picture(one, other).picture,
            ]
        });
        let mut files: Vec<Unwritten> = Vec::new();
        for (name, picture) in FILES.into_iter().zip(shown.iter().flatten()) {
            files.push((folder.join(name), Box::new(|path| picture.write_png(path))));
        }
        let json = |path: &Path| {
            write_beside(path, |file| {
                serde_json::to_writer_pretty(file, self).map_err(|e| e.to_string())
            })
        };
        files.push((folder.join("compare.json"), Box::new(json)));
        write_as_one(folder, files, &FILES)
    }
}

/// Pictures that both sides have.
fn pairs<'s>(
    a: &'s ComparisonSide,
    b: &'s ComparisonSide,
) -> impl Iterator<Item = (&'static str, &'s Picture, &'s Picture)> {
    let other = |wanted: &str| {
        b.pictures
            .iter()
            .find(|(name, _)| *name == wanted)
            .map(|(_, picture)| picture)
    };
    a.pictures
        .iter()
        .filter_map(move |(name, picture)| Some((*name, picture, other(name)?)))
}

fn fixed<'s>(a: &'s ComparisonSide, b: &'s ComparisonSide) -> Option<[&'s Picture; 2]> {
    pairs(a, b)
        .find(|(name, ..)| *name == "fixed")
        .map(|(_, one, other)| [one, other])
}

impl Pictures {
    fn new(name: &'static str, a: &Picture, b: &Picture) -> Self {
        let m = metrics(a, b);
        let differ = |(one, other): &(&[f64; 4], &[f64; 4])| one != other;
        Pictures {
            name,
            psnr_db: m.psnr_db,
            ssim: m.ssim,
            max_error: m.max_error,
            mean_error: m.mean_error,
            pixels_over_1_255: m.pixels_over_1_255,
            pixels_that_differ: a.rgba.iter().zip(&b.rgba).filter(differ).count() as u64,
        }
    }
}

/// Parts that differ and are not compared field by field, and parts that are compared so without a
/// difference in any field.
fn elsewhere(a: &Value, b: &Value, is_shown: bool) -> Vec<String> {
    const COMPARED: [&str; 6] = [
        "scene",
        "machine",
        "accuracy",
        "fragments",
        "cycles",
        "cost",
    ];
    // The scale of error.png follows from the pictures.
    const NOT_COMPARED: [&str; 3] = ["host", "version", "error_scale"];
    let names: BTreeSet<&String> = [a, b]
        .into_iter()
        .filter_map(Value::as_object)
        .flat_map(|fields| fields.keys())
        .collect();
    let is_compared =
        |name: &str| NOT_COMPARED.contains(&name) || is_shown && COMPARED.contains(&name);
    names
        .into_iter()
        .filter(|name| !is_compared(name) && a.get(*name) != b.get(*name))
        .cloned()
        .collect()
}

//! Compare: two machines, or two frames that `run` drew, side by side (docs/book/compare.md).
//!
//! ```text
//! machine ──────────────► description, area ──┐
//! machine ─► run, replay ─► the same, a frame ┼─► side ─┐
//! report.json, pictures ──────────────────────┘         ├─► comparison ─┬─► text, 80 columns
//!                                                  side ─┘               └─► compare.json, a.png, b.png, difference.png
//! ```
//! Both sides are reports, in JSON: of a machine alone one with its description and its area, and
//! nothing else.
//!
//! Laws (tests/compare.rs): `what_is_compared_with_itself_does_not_differ`,
//! `every_figure_is_the_one_of_its_report`.

mod fields;
mod side;
mod text;

pub use side::{Frame, Side};

use crate::accuracy::{error_picture, metrics};
use crate::error::Result;
use crate::output::files::{Unwritten, write_as_one, write_beside};
use crate::output::picture::Picture;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Two sides, and all that differs.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Comparison {
    /// Version of this program.
    pub version: &'static str,
    /// The first, as it was named.
    pub a: Named,
    /// The second.
    pub b: Named,
    /// Nothing differs but `host`: what the computer was, and how long it took.
    pub equal: bool,
    /// Figures that both have, in the order of a report.
    pub figures: Vec<Figure>,
    /// Cycles and area of every unit that either has; empty where there is no frame and no area
    /// differs.
    pub units: Vec<Unit>,
    /// Fields of the machine's description that differ, in the order of a machine file.
    pub machine: Vec<Difference>,
    /// Fields of the scene that differ.
    pub scene: Vec<Difference>,
    /// Other parts of `report.json` that differ, by name.
    pub elsewhere: Vec<String>,
    /// Pictures of one name against each other, where both sides have them.
    pub pictures: Vec<Pictures>,
    /// Factor of `difference.png`, |fixed of A − fixed of B|; none without pictures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub difference_scale: Option<f64>,
}

/// Pictures that a comparison of two frames writes.
const FILES: [&str; 3] = ["a.png", "b.png", "difference.png"];

/// One of the two.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Named {
    /// As the command line has it.
    pub name: String,
    /// The machine's name.
    pub machine: String,
    /// The scene's name; none of a machine alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scene: Option<String>,
    /// Columns and rows; none of a machine alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<[u64; 2]>,
}

/// A figure of both.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Figure {
    /// In words, with the unit of the text.
    pub name: &'static str,
    /// Where it stands in `report.json`.
    pub path: String,
    /// Of the first: a number in the report's unit, or a text. Decibels of equal pictures are
    /// `equal`, of pictures with a pixel that has no number `no number`.
    pub a: Value,
    /// Of the second.
    pub b: Value,
    /// Factor from the report's unit to that of the name, where they are not the same.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// b − a, of numbers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub difference: Option<f64>,
    /// (b − a) / a, of numbers that are no decibels, where a is not 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relative: Option<f64>,
}

/// A unit of both.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Unit {
    /// Its name.
    pub name: String,
    /// Of the first; none where it has no such unit.
    pub a: UnitSide,
    /// Of the second.
    pub b: UnitSide,
}

/// A unit of one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct UnitSide {
    /// Cycles busy, starved, blocked, waiting for memory; none where there is no frame, or no such
    /// unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cycles: Option<[u64; 4]>,
    /// What blocked it longest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blocked_by: Option<String>,
    /// LUT equivalents; none of a unit that is part of no other area.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub area: Option<f64>,
}

/// A field that differs.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Difference {
    /// Its path, as `--set` takes it.
    pub field: String,
    /// Of the first.
    pub a: Option<Value>,
    /// Of the second.
    pub b: Option<Value>,
    /// Sides that leave it out, `a` or `b`: the value there is the default, or follows from formats
    /// and clock; none where there is none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<&'static str>,
}

/// Two pictures of one name.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Pictures {
    /// `fixed`, `golden` or `ideal`.
    pub name: &'static str,
    /// Of the one against the other, linear light, peak 1; none where they are equal.
    pub psnr_db: Option<f64>,
    /// Structural similarity.
    pub ssim: f64,
    /// Greatest absolute difference.
    pub max_error: f64,
    /// Mean absolute difference.
    pub mean_error: f64,
    /// Pixels of which a channel is off by more than 1/255.
    pub pixels_over_1_255: u64,
    /// Pixels of which anything differs, opacity too.
    pub pixels_that_differ: u64,
}

impl Comparison {
    /// Puts two sides beside each other.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] where their pictures have two sizes.
    pub fn new(a: &Side, b: &Side) -> Result<Self> {
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

    /// Writes `compare.json`, and the pictures where there are some; returns what was written.
    ///
    /// # Errors
    /// [`crate::error::Error::Job`] where a file cannot be written; none is left half-written.
    pub fn write(&self, a: &Side, b: &Side, folder: &Path) -> Result<Vec<PathBuf>> {
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

/// Pictures that both have.
fn pairs<'s>(
    a: &'s Side,
    b: &'s Side,
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

fn fixed<'s>(a: &'s Side, b: &'s Side) -> Option<[&'s Picture; 2]> {
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

/// Parts that differ and are not told field by field; those that are, where no such field differs.
fn elsewhere(a: &Value, b: &Value, is_shown: bool) -> Vec<String> {
    const TOLD: [&str; 6] = [
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
    let is_told = |name: &str| NOT_COMPARED.contains(&name) || is_shown && TOLD.contains(&name);
    names
        .into_iter()
        .filter(|name| !is_told(name) && a.get(*name) != b.get(*name))
        .cloned()
        .collect()
}

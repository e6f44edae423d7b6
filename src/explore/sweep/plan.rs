//! Plan: which machines are tried on which scenes.
//!
//! ```text
//! axes ─►( grid, one at a time, sample )─► changes of the base machine ─┐
//! scenes ───────────────────────────────────────────────────────────────┴─► points, numbered
//! ```

use super::table::{Column, Kind};
use crate::accuracy::partial::UNITS;
use crate::error::{Error, Result};
use crate::hardware::machines;
use crate::input;
use crate::output::text::{clipped, thousands};
use crate::scene::digest::mixed;
use crate::scene::{Camera, Overrides, Scene, Sequence, memory, strict_json, validate};
use rtl_model::Machine;
use rtl_model::num::Format;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::HashMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Plan of a sweep, as its file has it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Built-in names, or files beside the plan.
    pub scenes: Vec<String>,
    /// Columns and rows of all pictures, instead of the scenes' own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<[usize; 2]>,
    /// The machine that is changed: a name, or a file beside the plan.
    #[serde(default = "reference")]
    pub machine: String,
    /// Axes: the fields that are changed.
    pub axes: Vec<Axis>,
    /// Combination of the axes.
    #[serde(default)]
    pub order: Order,
    /// Points of a sample.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<u64>,
    /// Another seed, another sample.
    #[serde(default)]
    pub seed: u64,
    /// Hold each machine to its golden twin in lockstep too, which takes most of a point's time.
    #[serde(default = "yes")]
    pub lockstep: bool,
    /// Draw this many frames of scenes with several cameras, from the first on, and measure how
    /// errors change from frame to frame. All other figures are those of the first frame. Only for
    /// surfaces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 2, max = 32))]
    pub flicker: Option<usize>,
}

fn reference() -> String {
    "reference".into()
}

fn yes() -> bool {
    true
}

/// A field, or several together, and what it is to be: values, a range, or other bits.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// A field of the machine, as `gauss.weight` or `timing.raster.lanes`; `*` is every word that
    /// can be so, one at a time; `exact` lists units and words that are f64 instead, as
    /// `["raster", "splat.rgb"]`: of such a machine only errors are known.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub field: String,
    /// Instead of one field, several that change together, such as
    /// `["ellipse.conic", "ellipse.conic_cross"]`. Each gets the value, or as many additional bits
    /// as the value says.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fields: Vec<String>,
    /// These values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub values: Option<Vec<Value>>,
    /// Whole numbers: first, last, step.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range: Option<[i64; 3]>,
    /// So many fraction bits more than the base machine's; fewer where negative. Of words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub add_frac_bits: Option<Vec<i32>>,
    /// So many integer bits more than the base machine's; fewer where negative. Of words; beside
    /// `add_frac_bits`, one after the other.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub add_int_bits: Option<Vec<i32>>,
}

/// Combination of the axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// Every value with every other axis' values.
    #[default]
    Grid,
    /// The base machine; then every value of every axis, all others as in the base.
    OneAtATime,
    /// So many `points` that each axis' values come equally often (a Latin hypercube).
    Sample,
}

/// A change of the base machine.
pub type Change = (String, Value);

/// The field that is none of the machine.
const EXACT: &str = "exact";

/// A machine with these changes, but for those that make it exact.
///
/// # Errors
/// As [`machines::with`].
pub fn machine_of(base: &Machine, changes: &[Change], name: &str) -> Result<Machine> {
    let own: Vec<Change> = changes
        .iter()
        .filter(|(field, _)| field != EXACT)
        .cloned()
        .collect();
    machines::with(base, &own, name)
}

/// Units and words that changes make exact.
pub fn exact_of(changes: &[Change]) -> Vec<String> {
    let lists = changes
        .iter()
        .filter(|(field, _)| field == EXACT)
        .filter_map(|(_, value)| value.as_array());
    lists
        .flatten()
        .filter_map(|name| name.as_str().map(str::to_owned))
        .collect()
}

/// Refuses what names no units or words.
fn check_exact(value: &Value, words: &[(String, Format)]) -> Result<()> {
    let input_error = |what: String| Error::input(format!("axes: {EXACT}: {what}"));
    let names = value.as_array().ok_or_else(|| {
        input_error(format!(
            "{value} is no list, as [\"raster\", \"splat.rgb\"] is"
        ))
    })?;
    let is_known = |name: &str| UNITS.contains(&name) || words.iter().any(|(word, _)| word == name);
    match names
        .iter()
        .find(|name| !name.as_str().is_some_and(is_known))
    {
        Some(name) => {
            let known: Vec<&str> = UNITS
                .into_iter()
                .chain(words.iter().map(|(word, _)| word.as_str()))
                .collect();
            let nearest = validate::in_brackets(name.as_str().unwrap_or_default(), &known);
            Err(input_error(format!(
                "{name} is no unit and no word; units are {}{nearest}",
                UNITS.join(", ")
            )))
        }
        None => Ok(()),
    }
}

/// A plan that can be carried out.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Points {
    /// The plan.
    pub plan: Plan,
    /// The machine that is changed.
    pub base: Machine,
    /// Where relative paths begin.
    folder: PathBuf,
    /// What is tried, in the order of the plan, on each scene: of each axis its steps.
    axes: Vec<Vec<Vec<Change>>>,
    /// Machines a scene.
    machines: u64,
    /// Of each scene the cameras whose frames are compared with those before them; none where that
    /// is not asked for.
    cameras: Vec<Vec<Camera>>,
}

/// Plans that need no file.
pub const READY: [(&str, &str); 6] = [
    (
        "precision",
        r#"{"scenes": ["glass-spheres"], "axes": [{"field": "*", "add_frac_bits": [-4, -2, 2]}], "order": "one-at-a-time",
            "lockstep": false}"#,
    ),
    (
        "precision-in-lockstep",
        r#"{"scenes": ["glass-spheres"], "axes": [{"field": "*", "add_frac_bits": [-4, -2, 2]}], "order": "one-at-a-time"}"#,
    ),
    (
        "curves",
        r#"{"scenes": ["glass-spheres"], "size": [256, 256], "order": "one-at-a-time", "axes": [
            {"field": "splat.rgb", "add_frac_bits": [-8, -7, -6, -5, -4, -3, -2, -1, 1, 2, 3, 4]},
            {"field": "raster.offset", "add_frac_bits": [-8, -7, -6, -5, -4, -3, -2, -1, 1, 2, 3, 4]},
            {"field": "gauss.weight", "add_frac_bits": [-12, -11, -10, -9, -8, -7, -6, -5, -4, -3, -2, -1, 1, 2]},
            {"field": "project.camera", "add_int_bits": [-3, -2, -1, 1, 2, 3]}]}"#,
    ),
    (
        "architecture",
        r#"{"scenes": ["glass-spheres"], "lockstep": false, "axes": [
            {"field": "timing.raster.lanes", "values": [[1, 1], [2, 2], [4, 1], [8, 1], [4, 4]]},
            {"field": "timing.raster.fifo", "values": [1, 4, 16, 64]},
            {"field": "timing.tile.side_px", "values": [16, 32]},
            {"field": "timing.shade.latency", "values": [3, 10, 20, 30, 40]}]}"#,
    ),
    (
        "layers",
        r#"{"scenes": ["glass-spheres"], "size": [256, 256], "lockstep": false, "axes": [
            {"field": "fragment.merge", "values": ["nearest-pair", "farthest-pair"]},
            {"field": "fragment.layers", "values": [1, 2, 3, 4, 6, 8]}]}"#,
    ),
    (
        "clock",
        r#"{"scenes": ["glass-spheres"], "size": [32, 32], "lockstep": false, "axes": [
            {"field": "timing.clock_hz", "values": [1e8, 2e8, 3e8, 4e8, 6e8, 8e8, 1e9, 1.2e9, 1.5e9]},
            {"fields": ["timing.project.latency", "timing.ellipse.latency", "timing.shade.latency"],
                "values": [1, 2, 3, 4, 6, 8, 11, 15]}]}"#,
    ),
];

/// Most values of an axis: each is tried on the machine before anything is drawn.
const MOST_VALUES: usize = 10_000;

impl Points {
    /// Reads a plan: the name of a ready one, or a file.
    ///
    /// # Errors
    /// [`Error::Input`] naming the file, the field and what is wrong there.
    pub fn load(name_or_path: impl AsRef<OsStr>) -> Result<Self> {
        let path = Path::new(name_or_path.as_ref());
        let name = &*path.to_string_lossy();
        let input_error = |sentence: String| Error::input(format!("{name}: {sentence}"));
        let ready = READY
            .iter()
            .find(|(ready, _)| *ready == name && !path.is_file());
        let text = match ready {
            Some((_, text)) => (*text).to_owned(),
            None if !path.exists() => {
                let names = READY.map(|(name, _)| name);
                let nearest = validate::in_brackets(name, &names);
                let sentence = format!(
                    "no such file, and no ready plan either; ready are {}{nearest}",
                    names.join(", ")
                );
                return Err(input_error(sentence));
            }
            None => {
                input::read_text(path).map_err(|e| input_error(format!("cannot be read: {e}")))?
            }
        };
        Points::from_text(&text, name, path.parent().unwrap_or(Path::new("")))
    }

    /// Reads a plan's text; files that it names lie beside each other in `folder`, and `name`
    /// begins every error.
    ///
    /// # Errors
    /// As [`Points::load`].
    pub fn from_text(text: &str, name: &str, folder: &Path) -> Result<Self> {
        let input_error = |sentence: String| Error::input(format!("{name}: {sentence}"));
        let value = strict_json::parse(text).map_err(input_error)?;
        validate::check(&value, &schema()).map_err(|misfit| input_error(misfit.to_string()))?;
        let plan: Plan = serde_path_to_error::deserialize(&value)
            .map_err(|e| input_error(format!("{}: {}", e.path(), e.inner())))?;
        let folder = folder.to_owned();
        Points::new(plan, folder).map_err(|error| match error {
            Error::Input(sentence) => input_error(sentence),
            other => other,
        })
    }

    fn new(plan: Plan, folder: PathBuf) -> Result<Self> {
        if plan.scenes.is_empty() {
            return Err(Error::input("scenes is empty: at least one is needed"));
        }
        let base = machines::load(beside(&folder, &plan.machine), &[])?;
        let words = machines::words(&base);
        let mut axes = Vec::new();
        for (nth, axis) in plan.axes.iter().enumerate() {
            let input_error = |sentence: String| Error::input(format!("axes[{nth}]: {sentence}"));
            let named = axis.named().map_err(input_error)?;
            if axis.field != "*" {
                axes.push(axis.steps(&named, &words).map_err(input_error)?);
                continue;
            }
            if plan.order != Order::OneAtATime {
                return Err(input_error("`*` needs \"order\": \"one-at-a-time\"".into()));
            }
            for (field, _) in &words {
                let axis = Axis {
                    field: field.clone(),
                    ..axis.clone()
                };
                let mut steps = axis.steps(&[field], &words).map_err(input_error)?;
                // Some words have no bit more to give, or none less.
                steps.retain(|changes| machines::with(&base, changes, "").is_ok());
                axes.push(steps);
            }
        }
        let mut seen: Vec<&str> = Vec::new();
        for steps in &axes {
            for (field, _) in steps.first().into_iter().flatten() {
                if seen.contains(&field.as_str()) {
                    return Err(Error::input(format!("axes has {field} twice")));
                }
                seen.push(field);
            }
            for changes in steps {
                changes
                    .iter()
                    .filter(|(field, _)| field == EXACT)
                    .try_for_each(|(_, value)| check_exact(value, &words))?;
                machine_of(&base, changes, "axes")?;
            }
        }
        let counts = axes.iter().map(|steps| steps.len() as u64);
        let machines = match plan.order {
            Order::Grid => counts.fold(1, u64::saturating_mul),
            Order::OneAtATime => 1 + counts.sum::<u64>(),
            Order::Sample => plan
                .points
                .filter(|points| *points > 0)
                .ok_or_else(|| Error::input("a sample needs `points`, one at least"))?,
        };
        if plan.order != Order::Sample && plan.points.is_some() {
            return Err(Error::input("points belongs to \"order\": \"sample\""));
        }
        let mut points = Points {
            plan,
            base,
            folder,
            axes,
            machines,
            cameras: Vec::new(),
        };
        if let Some(frames) = points.plan.flicker {
            points.cameras = (0..points.plan.scenes.len())
                .map(|nth| points.film(nth, frames))
                .collect::<Result<_>>()?;
        }
        Ok(points)
    }

    /// The first cameras of a scene.
    fn film(&self, nth: usize, frames: usize) -> Result<Vec<Camera>> {
        let (name, overrides) = self.named(nth);
        let sequence = Sequence::load(name, &overrides, None)?;
        let input_error = |what: String| {
            Err(Error::input(format!(
                "flicker: {}: {what}",
                sequence.scene().name
            )))
        };
        if !sequence.shares_splats() {
            return input_error("frames of volumes, Gaussians and trees are not swept; `run` draws all frames of one machine".into());
        }
        match sequence.cameras().get(..frames) {
            Some(cameras) => Ok(cameras.to_vec()),
            None => input_error(format!(
                "{frames} frames are asked for, and it has {}",
                thousands(sequence.cameras().len() as u64)
            )),
        }
    }

    /// The cameras of a scene that flicker is told of; none where it is not.
    pub fn cameras(&self, nth: usize) -> &[Camera] {
        self.cameras.get(nth).map_or(&[], Vec::as_slice)
    }

    /// Count.
    pub fn count(&self) -> u64 {
        self.machines.saturating_mul(self.plan.scenes.len() as u64)
    }

    /// Which scene a point is on, and what it changes.
    pub fn point(&self, number: u64) -> (usize, Vec<Change>) {
        (
            (number / self.machines) as usize,
            self.changes(number % self.machines),
        )
    }

    /// Points in the order of the plan, those that may share a frame, for they differ in timing
    /// alone, together.
    pub fn together(&self, numbers: &[u64]) -> Vec<Vec<u64>> {
        let mut groups: Vec<Vec<u64>> = Vec::new();
        let mut places = HashMap::new();
        for number in numbers {
            let (scene, changes) = self.point(*number);
            let drawn: Vec<Change> = changes
                .into_iter()
                .filter(|(field, _)| machines::changes_picture(field))
                .collect();
            let place = *places
                .entry((scene, Value::from_iter(drawn).to_string()))
                .or_insert(groups.len());
            if place == groups.len() {
                groups.push(Vec::new());
            }
            groups[place].push(*number);
        }
        groups
    }

    fn changes(&self, number: u64) -> Vec<Change> {
        let step = |axis: usize, nth: u64| self.axes[axis][nth as usize].clone();
        let count = |axis: usize| self.axes[axis].len() as u64;
        match self.plan.order {
            Order::Grid => {
                // The last axis changes fastest.
                let mut left = number;
                let mut steps: Vec<Vec<Change>> = Vec::new();
                for axis in (0..self.axes.len()).rev() {
                    steps.push(step(axis, left % count(axis)));
                    left /= count(axis);
                }
                steps.into_iter().rev().flatten().collect()
            }
            Order::OneAtATime => {
                let Some(mut left) = number.checked_sub(1) else {
                    return Vec::new();
                };
                for axis in 0..self.axes.len() {
                    if left < count(axis) {
                        return step(axis, left);
                    }
                    left -= count(axis);
                }
                Vec::new()
            }
            Order::Sample => {
                let place = |axis: usize| {
                    shuffled(
                        number,
                        self.machines,
                        self.plan.seed.wrapping_add(axis as u64),
                    )
                };
                (0..self.axes.len())
                    .flat_map(|axis| {
                        step(
                            axis,
                            (u128::from(place(axis)) * u128::from(count(axis))
                                / u128::from(self.machines)) as u64,
                        )
                    })
                    .collect()
            }
        }
    }

    /// Fields that an axis names, in the order of the plan; `*` is none.
    pub fn fields(&self) -> Vec<String> {
        self.plan
            .axes
            .iter()
            .flat_map(|axis| axis.named().unwrap_or_default())
            .filter(|field| *field != "*")
            .cloned()
            .collect()
    }

    /// The columns of these fields: of numbers where all values are, the base machine's too.
    pub fn columns(&self) -> Vec<Column> {
        let base = machines::value(&self.base);
        let kind = |field: &String| {
            let all = self
                .axes
                .iter()
                .flatten()
                .flatten()
                .filter(|(other, _)| other == field)
                .map(|(_, value)| value);
            let numbers = all
                .chain(base.pointer(&machines::pointer(field)))
                .filter(|value| !value.is_null());
            numbers.map(kind_of).reduce(|a, b| match (a, b) {
                (a, b) if a == b => a,
                (Kind::Text, _) | (_, Kind::Text) => Kind::Text,
                _ => Kind::Number,
            })
        };
        self.fields()
            .into_iter()
            .map(|field| (field.clone(), kind(&field).unwrap_or(Kind::Text)))
            .collect()
    }

    /// Loads a scene of the plan.
    ///
    /// # Errors
    /// [`Error::Input`] as [`Scene::load`].
    pub fn scene(&self, nth: usize) -> Result<Scene> {
        let (name, overrides) = self.named(nth);
        let scene = Scene::load(name, &overrides)?;
        memory::check_frame(&scene)?;
        Ok(scene)
    }

    /// What a scene is loaded by.
    fn named(&self, nth: usize) -> (PathBuf, Overrides) {
        let size = self.plan.size.map(|[width, height]| (width, height));
        (
            beside(&self.folder, &self.plan.scenes[nth]),
            Overrides { size },
        )
    }
}

/// The column that a value fits into.
fn kind_of(value: &Value) -> Kind {
    match machines::whole(value.clone()) {
        value if value.is_i64() => Kind::Whole,
        value if value.is_number() => Kind::Number,
        _ => Kind::Text,
    }
}

/// A name, or a file that lies beside the plan.
fn beside(folder: &Path, name: &str) -> PathBuf {
    let path = folder.join(name);
    // A folder of that name is where somebody put what came out.
    if path.is_file() { path } else { name.into() }
}

/// The JSON Schema of a plan.
pub fn schema() -> Value {
    schemars::schema_for!(Plan).to_value()
}

impl Axis {
    /// Its field, or its fields.
    fn named(&self) -> std::result::Result<Vec<&String>, String> {
        match (self.field.as_str(), self.fields.as_slice()) {
            ("", []) => Err("needs a `field`, or `fields` that change together".into()),
            (_, []) => Ok(vec![&self.field]),
            ("", fields) if fields.iter().any(|field| field == "*" || field == EXACT) => Err(
                format!("fields: `*` and `{EXACT}` change with nothing together"),
            ),
            ("", fields) => match fields
                .iter()
                .enumerate()
                .find(|(nth, field)| fields[..*nth].contains(field))
            {
                Some((_, field)) => Err(format!("fields has {} twice", clipped(field))),
                None => Ok(fields.iter().collect()),
            },
            _ => Err("has `field` and `fields`; one of both is right".into()),
        }
    }

    /// What is changed, step by step: all of its fields in each.
    fn steps(
        &self,
        named: &[&String],
        words: &[(String, Format)],
    ) -> std::result::Result<Vec<Vec<Change>>, String> {
        let of_each: Vec<Vec<Value>> = named
            .iter()
            .map(|field| {
                Axis {
                    field: (*field).clone(),
                    fields: Vec::new(),
                    ..self.clone()
                }
                .values(words)
            })
            .collect::<std::result::Result<_, _>>()?;
        let step = |nth: usize| {
            named
                .iter()
                .zip(&of_each)
                .map(|(field, values)| ((*field).clone(), values[nth].clone()))
                .collect()
        };
        Ok((0..of_each[0].len()).map(step).collect())
    }

    fn values(&self, words: &[(String, Format)]) -> std::result::Result<Vec<Value>, String> {
        let no_bits = self.add_frac_bits.is_none() && self.add_int_bits.is_none();
        let values = match (&self.values, self.range) {
            (Some(values), None) if no_bits && values.len() > MOST_VALUES => {
                return Err(format!(
                    "{} has {} values: {MOST_VALUES} is the most",
                    self.field,
                    values.len()
                ));
            }
            (Some(values), None) if no_bits => values.clone(),
            (None, Some([first, last, step])) if no_bits => {
                let falls = (step > 0) != (last >= first) && first != last;
                let count = if step == 0 || falls {
                    0
                } else {
                    (i128::from(last) - i128::from(first)) / i128::from(step) + 1
                };
                if count > MOST_VALUES as i128 {
                    return Err(format!(
                        "range {first} to {last} by {step} has {count} values: {MOST_VALUES} is the most"
                    ));
                }
                (0..count as i64)
                    .map(|nth| Value::from(first + nth * step))
                    .collect()
            }
            (None, None) if !no_bits => {
                let word = words.iter().find(|(field, _)| *field == self.field);
                let Some((_, format)) = word else {
                    let known: Vec<&str> = words.iter().map(|(field, _)| field.as_str()).collect();
                    let nearest = validate::in_brackets(&self.field, &known);
                    let field = clipped(&self.field);
                    return Err(format!(
                        "{field} is no word, which add_frac_bits and add_int_bits need{nearest}"
                    ));
                };
                let [finer, wider] = [&self.add_frac_bits, &self.add_int_bits]
                    .map(|more| more.iter().flatten().copied());
                let finer = finer.map(|more| Format {
                    frac_bits: format.frac_bits.saturating_add(more),
                    ..*format
                });
                let wider = wider.map(|more| Format {
                    int_bits: format.int_bits.saturating_add(more),
                    ..*format
                });
                finer
                    .chain(wider)
                    .map(|format| Value::from(format.to_string()))
                    .collect()
            }
            _ => {
                return Err(format!(
                    "{} needs one of values, range and bits to add",
                    self.field
                ));
            }
        };
        if values.is_empty() {
            Err(format!("{} has no values", self.field))
        } else {
            Ok(values)
        }
    }
}

/// Where a number of 0 to `count` − 1 comes to lie when all are shuffled: a permutation by four
/// Feistel rounds, walked until it is in range.
fn shuffled(number: u64, count: u64, seed: u64) -> u64 {
    let half = (64 - (count.max(2) - 1).leading_zeros()).div_ceil(2);
    let mask = (1u64 << half) - 1;
    let mut place = number;
    loop {
        let [mut left, mut right] = [place >> half, place & mask];
        for round in 0..4 {
            (left, right) = (
                right,
                left ^ (mixed(right ^ mixed(seed ^ mixed(round))) & mask),
            );
        }
        place = left << half | right;
        if place < count {
            return place;
        }
    }
}

#[cfg(test)]
mod tests;

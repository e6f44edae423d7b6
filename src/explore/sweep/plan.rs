//! Plan: selects the machines and scenes of a sweep.
//!
//! ```text
//! axes ─►( grid, one at a time, sample )─► changes of the base machine ─┐
//! scenes ───────────────────────────────────────────────────────────────┴─► points, numbered
//! ```

use super::table::{CellKind, Column};
use crate::accuracy::partial::UNITS;
use crate::error::{Error, Result};
use crate::hardware::machines;
use crate::hardware::searched::Against;
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

/// Plan of a sweep, as in its file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Built-in names, or files relative to the plan.
    pub scenes: Vec<String>,
    /// Columns and rows of all pictures, instead of the scenes' own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<[usize; 2]>,
    /// The base machine: a name, or a file relative to the plan.
    #[serde(default = "reference")]
    pub machine: String,
    /// Axes: the fields that are changed.
    pub axes: Vec<Axis>,
    /// Combination of the axes.
    #[serde(default)]
    pub order: PlanOrder,
    /// Points of a sample.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<u64>,
    /// Seed of the sample.
    #[serde(default)]
    pub seed: u64,
    /// Also compare each machine with golden in lockstep, which takes most of a point's time.
    #[serde(default = "yes")]
    pub lockstep: bool,
    /// Do not draw machines that surely miss a PSNR.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub screen: Option<PlanScreen>,
    /// Draw this many frames of scenes with several cameras, from the first on, and measure how
    /// errors change from frame to frame. All other figures are of the first frame. Surfaces only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 2, max = 32))]
    pub flicker: Option<usize>,
}

/// The PSNR that a machine must reach to be drawn in full. A sample of the picture's tiles decides
/// whether it surely misses it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Screen")]
pub struct PlanScreen {
    /// Least PSNR, dB.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub psnr_db: f64,
    /// The picture that the machine's is compared with.
    #[serde(default)]
    pub against: Against,
}

fn reference() -> String {
    "reference".into()
}

fn yes() -> bool {
    true
}

/// A field, or several together, and its values: a list, a range, or additional bits.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// A field of the machine, as `gauss.weight` or `timing.raster.lanes`; `*` is every word that
    /// the values suit, one at a time; `exact` takes lists of units and words that are computed in
    /// f64, as `["raster", "splat.rgb"]`: for such a machine only errors are measured.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub field: String,
    /// Instead of one field, several that change together, such as `["ellipse.conic",
    /// "ellipse.conic_cross"]`. Each gets the value, or the additional bits.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fields: Vec<String>,
    /// List of values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub values: Option<Vec<Value>>,
    /// Integers: first, last, step.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range: Option<[i64; 3]>,
    /// Fraction bits in addition to the base machine's; fewer if negative. Words only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub add_frac_bits: Option<Vec<i32>>,
    /// Integer bits in addition to the base machine's; fewer if negative. Words only; with
    /// `add_frac_bits`, one after the other.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub add_int_bits: Option<Vec<i32>>,
}

/// Combination of the axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(rename = "Order")]
pub enum PlanOrder {
    /// Every combination of values.
    #[default]
    Grid,
    /// The base machine; then every value of every axis, with all others as in the base.
    OneAtATime,
    /// `points` points in which each value of an axis occurs equally often (a Latin hypercube).
    Sample,
}

/// A change of the base machine.
pub type MachineChange = (String, Value);

/// The field that is not of the machine.
const EXACT: &str = "exact";

/// The base machine with these changes, except those of `exact`.
///
/// # Errors
/// As [`machines::with`].
pub fn machine_of(base: &Machine, changes: &[MachineChange], name: &str) -> Result<Machine> {
    let own: Vec<MachineChange> = changes
        .iter()
        .filter(|(field, _)| field != EXACT)
        .cloned()
        .collect();
    machines::with(base, &own, name)
}

/// Units and words that changes compute in f64.
pub fn exact_of(changes: &[MachineChange]) -> Vec<String> {
    let lists = changes
        .iter()
        .filter(|(field, _)| field == EXACT)
        .filter_map(|(_, value)| value.as_array());
    lists
        .flatten()
        .filter_map(|name| name.as_str().map(str::to_owned))
        .collect()
}

/// Refuses anything except names of units and words.
fn check_exact(value: &Value, words: &[(String, Format)]) -> Result<()> {
    let input_error = |what: String| Error::input(format!("axes: {EXACT}: {what}"));
    let names = value.as_array().ok_or_else(|| {
        input_error(format!(
            "{value} is not a list, as [\"raster\", \"splat.rgb\"] is"
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
                "{name} is neither a unit nor a word; units are {}{nearest}",
                UNITS.join(", ")
            )))
        }
        None => Ok(()),
    }
}

/// A checked plan.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Points {
    /// The plan.
    pub plan: Plan,
    /// The base machine.
    pub base: Machine,
    /// Folder for relative paths.
    folder: PathBuf,
    /// Steps of each axis, in the order of the plan.
    axes: Vec<Vec<Vec<MachineChange>>>,
    /// Number of machines per scene.
    machines: u64,
    /// For each scene the cameras of the compared frames; None without `flicker`.
    cameras: Vec<Vec<Camera>>,
}

/// Built-in plans.
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

/// Most values per axis: each is tried on the machine before anything is drawn.
const MOST_VALUES: usize = 10_000;

impl Points {
    /// Reads a plan: the name of a built-in one, or a file.
    ///
    /// # Errors
    /// [`Error::Input`] with the file, the field and the problem.
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
                    "no such file or built-in plan; built-in are {}{nearest}",
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

    /// Reads a plan's text. Its files are relative to `folder`, and `name` begins every error.
    ///
    /// # Errors
    /// As [`Points::load`].
    pub fn from_text(text: &str, name: &str, folder: &Path) -> Result<Self> {
        let input_error = |sentence: String| Error::input(format!("{name}: {sentence}"));
        let value = strict_json::parse(text).map_err(input_error)?;
        validate::check(&value, &schema())
            .map_err(|violation| input_error(violation.to_string()))?;
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
        let base = machines::load(relative(&folder, &plan.machine), &[])?;
        let words = machines::words(&base);
        let mut axes = Vec::new();
        for (nth, axis) in plan.axes.iter().enumerate() {
            let input_error = |sentence: String| Error::input(format!("axes[{nth}]: {sentence}"));
            let named = axis.named().map_err(input_error)?;
            if axis.field != "*" {
                axes.push(axis.steps(&named, &words).map_err(input_error)?);
                continue;
            }
            if plan.order != PlanOrder::OneAtATime {
                return Err(input_error("`*` needs \"order\": \"one-at-a-time\"".into()));
            }
            for (field, _) in &words {
                let axis = Axis {
                    field: field.clone(),
                    ..axis.clone()
                };
                let mut steps = axis.steps(&[field], &words).map_err(input_error)?;
                // Words without another bit to add or remove are skipped.
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
            PlanOrder::Grid => counts.fold(1, u64::saturating_mul),
            PlanOrder::OneAtATime => 1 + counts.sum::<u64>(),
            PlanOrder::Sample => plan
                .points
                .filter(|points| *points > 0)
                .ok_or_else(|| Error::input("a sample needs `points`, one at least"))?,
        };
        if plan.order != PlanOrder::Sample && plan.points.is_some() {
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

    /// The cameras of a scene for `flicker`; empty without it.
    pub fn cameras(&self, nth: usize) -> &[Camera] {
        self.cameras.get(nth).map_or(&[], Vec::as_slice)
    }

    /// Number of points.
    pub fn count(&self) -> u64 {
        self.machines.saturating_mul(self.plan.scenes.len() as u64)
    }

    /// Index of a point's scene, and its changes.
    pub fn point(&self, number: u64) -> (usize, Vec<MachineChange>) {
        (
            (number / self.machines) as usize,
            self.changes(number % self.machines),
        )
    }

    /// Groups points in the order of the plan: those that differ only in timing share a frame.
    pub fn together(&self, numbers: &[u64]) -> Vec<Vec<u64>> {
        let mut groups: Vec<Vec<u64>> = Vec::new();
        let mut places = HashMap::new();
        for number in numbers {
            let (scene, changes) = self.point(*number);
            let drawn: Vec<MachineChange> = changes
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

    fn changes(&self, number: u64) -> Vec<MachineChange> {
        let step = |axis: usize, nth: u64| self.axes[axis][nth as usize].clone();
        let count = |axis: usize| self.axes[axis].len() as u64;
        match self.plan.order {
            PlanOrder::Grid => {
                // The last axis changes fastest.
                let mut left = number;
                let mut steps: Vec<Vec<MachineChange>> = Vec::new();
                for axis in (0..self.axes.len()).rev() {
                    steps.push(step(axis, left % count(axis)));
                    left /= count(axis);
                }
                steps.into_iter().rev().flatten().collect()
            }
            PlanOrder::OneAtATime => {
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
            PlanOrder::Sample => {
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

    /// Fields of the axes, in the order of the plan; `*` is not a field.
    pub fn fields(&self) -> Vec<String> {
        self.plan
            .axes
            .iter()
            .flat_map(|axis| axis.named().unwrap_or_default())
            .filter(|field| *field != "*")
            .cloned()
            .collect()
    }

    /// The columns of these fields; numeric if all values are numbers, including the base
    /// machine's.
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
                (CellKind::Text, _) | (_, CellKind::Text) => CellKind::Text,
                _ => CellKind::Number,
            })
        };
        self.fields()
            .into_iter()
            .map(|field| (field.clone(), kind(&field).unwrap_or(CellKind::Text)))
            .collect()
    }

    /// Loads a scene of the plan.
    ///
    /// # Errors
    /// [`Error::Input`] as for [`Scene::load`].
    pub fn scene(&self, nth: usize) -> Result<Scene> {
        let (name, overrides) = self.named(nth);
        let scene = Scene::load(name, &overrides)?;
        memory::check_frame(&scene)?;
        Ok(scene)
    }

    /// Path and overrides by which a scene is loaded.
    fn named(&self, nth: usize) -> (PathBuf, Overrides) {
        let size = self.plan.size.map(|[width, height]| (width, height));
        (
            relative(&self.folder, &self.plan.scenes[nth]),
            Overrides { size },
        )
    }
}

/// Kind of the column for a value.
fn kind_of(value: &Value) -> CellKind {
    match machines::whole(value.clone()) {
        value if value.is_i64() => CellKind::Whole,
        value if value.is_number() => CellKind::Number,
        _ => CellKind::Text,
    }
}

/// A name, or a file relative to the plan.
fn relative(folder: &Path, name: &str) -> PathBuf {
    let path = folder.join(name);
    // A folder of that name may contain results.
    if path.is_file() { path } else { name.into() }
}

/// The JSON Schema of a plan.
pub fn schema() -> Value {
    schemars::schema_for!(Plan).to_value()
}

impl Axis {
    /// Its field or fields.
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

    /// The steps of an axis: each changes all of its fields.
    fn steps(
        &self,
        named: &[&String],
        words: &[(String, Format)],
    ) -> std::result::Result<Vec<Vec<MachineChange>>, String> {
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
                        "{field} is not a word, which add_frac_bits and add_int_bits need{nearest}"
                    ));
                };
                let [finer, wider] = [&self.add_frac_bits, &self.add_int_bits]
                    .map(|more| more.iter().flatten().copied());
                let finer = finer.map(|more| format.finer(more));
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

/// Index of `number` in a random permutation of 0 to `count` − 1: four Feistel rounds, repeated
/// until the result is in range.
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

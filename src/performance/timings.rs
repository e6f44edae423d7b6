//! Timings: one frame's work on many microarchitectures, as part of `report.json`, as a table and
//! as a chart.
//!
//! ```text
//! work, recorded once ─┬─► timing.raster.fifo = 1 ─► cycles ─┐
//!                      ├─► timing.raster.fifo = 2 ─► cycles ─┼─► table, timings.png
//!                      └─► …                                 ┘
//! ```

use crate::error::{Error, Result};
use crate::hardware::quantise::lacks_tile_bits;
use crate::hardware::{fixed, machines};
use crate::output::chart::{Axis, Bars};
use crate::output::text::{aligned, plain_table, thousands, wrapped};
use crate::performance::cycles::CyclesReport;
use crate::performance::given;
use crate::scene::Scene;
use rayon::prelude::*;
use rtl_model::Machine;
use rtl_model::elaboration::microarchitecture::Microarchitecture;
use rtl_model::machine::timing::Walk;
use rtl_model::timing::{Cycles, Detail, RecordedFrame};
use schemars::JsonSchema;
use serde::Serialize;
use std::str::FromStr;

/// Greatest number of machines on which a frame is replayed, and of values of one field.
const MOST: usize = 1000;

/// Fields outside of `timing` that change no picture: how the order is computed, not which it is;
/// and which tiles and subtiles are tested for having no pixel.
pub const OF_LISTS: [&str; 8] = [
    "sort.kind",
    "sort.tile_bits",
    "sort.digit_bits",
    "bin.test",
    "bin.tiles_per_cycle",
    "bin.subtile_px",
    "bin.masks",
    "bin.mask_tests",
];

/// Whether a recorded frame can be replayed with another value of this field.
pub fn can_be_replayed(path: &str) -> bool {
    path.starts_with("timing.") || OF_LISTS.contains(&path)
}

/// Whether a machine with another value of this field, which may be a section, can differ in
/// [`OF_LISTS`].
pub fn changes_lists(path: &str) -> bool {
    OF_LISTS.iter().any(|field| machines::is_below(field, path))
}

/// [`OF_LISTS`] as a part of a sentence.
pub fn fields_of_lists() -> String {
    let [others @ .., last] = &OF_LISTS;
    format!("{} and {last}", others.join(", "))
}

/// Checks that a machine draws the same picture as another one whose `OF_LISTS` differ.
///
/// # Errors
/// A sentence.
pub fn draws_as(machine: &Machine, other: &Machine) -> std::result::Result<(), String> {
    if machine.sums_gaussians() != other.sums_gaussians() {
        return Err("Gaussians are summed with sort.kind none and blended with the other kinds, which are different pictures: draw the frame again".into());
    }
    if machine.keeps_lists() != other.keeps_lists() {
        return Err("lists are kept from frame to frame with sort.kind incremental and sorted completely with the other kinds, which are different pictures: draw the frame again".into());
    }
    Ok(())
}

/// A field that changes no picture, and its values.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Axes {
    path: String,
    values: Vec<String>,
}

impl FromStr for Axes {
    type Err = String;

    /// `timing.raster.fifo=1,2,4`: commas inside brackets do not separate values.
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let sentence = || {
            format!(
                "write PATH=VALUE,VALUE,…, as in timing.raster.fifo=1,2,4; PATH can be any field below timing, and {}",
                fields_of_lists()
            )
        };
        let (path, values) = text
            .split_once('=')
            .filter(|(path, _)| can_be_replayed(path))
            .ok_or_else(sentence)?;
        let mut all = vec![String::new()];
        let mut depth = 0;
        for letter in values.chars() {
            depth +=
                i32::from(matches!(letter, '[' | '{')) - i32::from(matches!(letter, ']' | '}'));
            match all.last_mut() {
                Some(last) if letter != ',' || depth > 0 => last.push(letter),
                _ => all.push(String::new()),
            }
        }
        if all.iter().any(|value| value.trim().is_empty()) {
            return Err(sentence());
        }
        if all.len() > MOST {
            return Err(format!("{} values are more than {MOST}", all.len()));
        }
        Ok(Axes {
            path: path.into(),
            values: all.iter().map(|value| value.trim().into()).collect(),
        })
    }
}

/// Fields, and a microarchitecture for each combination of their values.
#[derive(Clone, Debug)]
pub struct Variants {
    paths: Vec<String>,
    /// Values in the order of the fields; the last one changes fastest.
    machines: Vec<Variant>,
}

/// A machine with these values.
#[derive(Clone, Debug)]
struct Variant {
    values: Vec<String>,
    machine: Machine,
    timing: Microarchitecture,
}

impl Variants {
    /// Variants of a machine; `None` without a field.
    ///
    /// # Errors
    /// [`Error::Input`] naming the first invalid value, a field that is named twice, or the number
    /// of machines if there are too many.
    pub fn new(machine: &Machine, axes: &[Axes]) -> Result<Option<Self>> {
        let count = axes.iter().fold(1_usize, |count, axis| {
            count.saturating_mul(axis.values.len())
        });
        if count > MOST {
            let product: Vec<String> = axes
                .iter()
                .map(|axis| axis.values.len().to_string())
                .collect();
            return Err(Error::input(format!(
                "--timing: {} values are {count} machines; at most {MOST} are replayed",
                product.join("×")
            )));
        }
        let paths: Vec<String> = axes.iter().map(|axis| axis.path.clone()).collect();
        if let Some((_, twice)) = paths
            .iter()
            .enumerate()
            .find(|(at, path)| paths[..*at].contains(path))
        {
            return Err(Error::input(format!(
                "--timing {twice}: is named twice; name each field once, with all of its values"
            )));
        }
        let is_below = |one: &str, other: &str| {
            one.strip_prefix(other)
                .is_some_and(|rest| rest.starts_with('.'))
        };
        for (at, one) in paths.iter().enumerate() {
            if let Some(other) = paths[..at]
                .iter()
                .find(|other| is_below(one, other) || is_below(other, one))
            {
                return Err(Error::input(format!(
                    "--timing {one}: overlaps with {other}: one is part of the other"
                )));
            }
        }
        let mut all = vec![(Vec::new(), machine.clone())];
        for axis in axes {
            let with = |(values, machine): &(Vec<String>, Machine)| {
                let one = |value: &String| {
                    let setting = format!("{}={value}", axis.path);
                    let other = machines::changed(
                        machine,
                        &setting,
                        &machines::flag("--timing", &setting),
                    )?;
                    Ok((
                        [values.as_slice(), std::slice::from_ref(value)].concat(),
                        other,
                    ))
                };
                axis.values.iter().map(one).collect::<Result<Vec<_>>>()
            };
            all = all.iter().map(with).collect::<Result<Vec<_>>>()?.concat();
        }
        let base = machine;
        let built = |(values, machine): (Vec<String>, Machine)| {
            let sentence = |what| Error::input(format!("{}: {what}", flag(&paths, &values)));
            let elaborated =
                fixed::elaborate(&machine).map_err(|error| sentence(error.to_string()))?;
            draws_as(&machine, base).map_err(sentence)?;
            Ok(Variant {
                values,
                machine,
                timing: elaborated.timing,
            })
        };
        let machines = if axes.is_empty() {
            Vec::new()
        } else {
            all.into_iter().map(built).collect::<Result<_>>()?
        };
        Ok((!axes.is_empty()).then_some(Variants { paths, machines }))
    }

    /// Whether a field of the lists of tiles differs, so that the frame must be recorded with the
    /// keys and words that these depend on.
    pub fn changes_lists(&self) -> bool {
        self.paths.iter().any(|path| changes_lists(path))
    }

    /// Checks that each machine can be timed with a record of a scene: stack for its walk, and bits
    /// of keys for its tiles.
    ///
    /// # Errors
    /// [`Error::Input`] naming the first machine that cannot, and what it needs.
    pub fn check_scene(&self, scene: &Scene) -> Result<()> {
        let size = [scene.image.width, scene.image.height];
        self.check(|machine| {
            if let Some(detail) = &scene.detail {
                holds_stack(machine.timing.walk, detail.cut.deepest as u64)?;
            }
            lacks_tile_bits(machine, size)
                .filter(|_| scene.is_sorted())
                .map_or(Ok(()), Err)
        })
    }

    /// Checks each machine; the error of the check is a sentence.
    ///
    /// # Errors
    /// [`Error::Input`] naming the first machine that fails, and the sentence.
    pub fn check(&self, check: impl Fn(&Machine) -> std::result::Result<(), String>) -> Result<()> {
        self.machines.iter().try_for_each(|variant| {
            check(&variant.machine).map_err(|what| {
                Error::input(format!("{}: {what}", flag(&self.paths, &variant.values)))
            })
        })
    }
}

/// The flags that select these values.
fn flag(paths: &[String], values: &[String]) -> String {
    let settings = paths.iter().zip(values);
    let settings: Vec<String> = settings
        .map(|(path, value)| format!("{path}={value}"))
        .collect();
    machines::flag("--timing", &settings.join(" --timing "))
}

/// Checks that a walker has enough stack for this number of nodes; the error is a sentence with the
/// stack that is needed. A machine without a walker has the default one.
pub(super) fn holds_stack(walk: Option<Walk>, deepest: u64) -> std::result::Result<(), String> {
    let stack = walk.unwrap_or_default().stack;
    if deepest > u64::from(stack) {
        return Err(format!(
            "timing.walk.stack is {stack}, but the frame's walk stores up to {deepest} nodes on it: {deepest} would do"
        ));
    }
    Ok(())
}

/// RecordedFrame times by value.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Timings {
    /// The field; several are separated by commas.
    pub path: String,
    /// One row per value; with several fields one per combination, the last field changing fastest.
    pub rows: Vec<TimingRow>,
}

/// A frame's time with one value.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct TimingRow {
    /// The value; with several fields one each, separated by commas.
    pub value: String,
    /// The values one by one, in the order of the fields.
    pub values: Vec<String>,
    /// Time of the frame with it.
    pub cycles: CyclesReport,
}

impl Timings {
    /// Replays a frame on all variants.
    pub fn new(variants: &Variants, frame: &RecordedFrame) -> Self {
        let replayed: Vec<Cycles> = variants
            .machines
            .par_iter()
            .map(|variant| frame.replay(&variant.timing, Detail::Histograms))
            .collect();
        let frames: Vec<_> = variants
            .machines
            .iter()
            .map(|variant| &variant.timing)
            .zip(&replayed)
            .collect();
        let values = variants
            .machines
            .iter()
            .map(|variant| variant.values.clone());
        let row = |(values, cycles): (Vec<String>, CyclesReport)| TimingRow {
            value: values.join(", "),
            values,
            cycles,
        };
        Timings {
            path: variants.paths.join(", "),
            rows: values
                .zip(CyclesReport::all(&frames, frame))
                .map(row)
                .collect(),
        }
    }

    /// The table, at most 80 columns wide.
    pub fn table(&self) -> String {
        let fields = self
            .path
            .split(", ")
            .map(|path| path.trim_start_matches("timing."));
        let head: Vec<&str> = fields
            .chain(["cycles", "frames/s", "of best", "limited by", "memory MB"])
            .collect();
        let mut table = plain_table(&head);
        let best = self
            .rows
            .iter()
            .map(|row| row.cycles.frames_per_second)
            .fold(0.0, f64::max);
        for TimingRow { values, cycles, .. } in &self.rows {
            let figures = [
                thousands(cycles.total),
                format!("{:.1}", cycles.frames_per_second),
                format!("{:.1}%", 100.0 * cycles.frames_per_second / best),
                cycles.limited_by(),
                format!("{:.1}", cycles.memory.bytes as f64 / 1e6),
            ];
            table.add_row(values.iter().cloned().chain(figures));
        }
        let note = given::note(self.path.split(", "))
            .map_or(String::new(), |note| format!("\n{}", wrapped(&note)));
        format!("{}{note}", aligned(table).trim_fmt())
    }

    /// Frames per second by value.
    pub fn chart(&self) -> Bars {
        let most = self
            .rows
            .iter()
            .map(|row| row.cycles.frames_per_second)
            .fold(0.0, f64::max);
        Bars {
            title: format!("Frames a second by {}", self.path),
            axis: Axis::linear("frames/s").within(0.0, 1.05 * most),
            legend: vec![String::new()],
            rows: self
                .rows
                .iter()
                .map(|row| (row.value.clone(), vec![row.cycles.frames_per_second]))
                .collect(),
            ..Bars::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_separated_by_commas_outside_brackets() {
        let axes: Axes = "timing.raster.lanes=[1,1], [2,2],[4,1]".parse().unwrap();
        assert_eq!(
            (axes.path.as_str(), axes.values),
            (
                "timing.raster.lanes",
                ["[1,1]", "[2,2]", "[4,1]"].map(String::from).to_vec()
            )
        );
        for wrong in [
            "",
            "raster.fifo=1",
            "timing.fifo",
            "timing.fifo=",
            "timing.fifo=1,,2",
        ] {
            assert!(
                wrong
                    .parse::<Axes>()
                    .unwrap_err()
                    .contains("timing.raster.fifo=1,2,4"),
                "{wrong}"
            );
        }
    }
}

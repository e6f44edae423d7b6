//! Timings: one frame's work on many microarchitectures, as part of `report.json`, as a table and as a chart.
//!
//! ```text
//! work, recorded once ─┬─► timing.raster.fifo = 1 ─► cycles ─┐
//!                      ├─► timing.raster.fifo = 2 ─► cycles ─┼─► table, timings.png
//!                      └─► …                                 ┘
//! ```

use crate::error::{Error, Result};
use crate::hardware::{fixed, machines};
use crate::output::chart::{Axis, Bars};
use crate::output::text::{aligned, plain_table, thousands};
use crate::performance::cycles::CyclesReport;
use rayon::prelude::*;
use rtl_model::Machine;
use rtl_model::elaboration::microarchitecture::Microarchitecture;
use rtl_model::timing::{self, Detail};
use rtl_model::work::Work;
use schemars::JsonSchema;
use serde::Serialize;
use std::str::FromStr;

/// Most values of one field.
const MOST: usize = 1000;

/// A field of a machine's timing, and the values that it is to take.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Axes {
    path: String,
    values: Vec<String>,
}

impl FromStr for Axes {
    type Err = String;

    /// `timing.raster.fifo=1,2,4`: commas inside of brackets part nothing.
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let sentence = "write PATH=VALUE,VALUE,… of a field below timing, as in timing.raster.fifo=1,2,4";
        let (path, values) = text.split_once('=').filter(|(path, _)| path.starts_with("timing.")).ok_or(sentence)?;
        let mut all = vec![String::new()];
        let mut depth = 0;
        for letter in values.chars() {
            depth += i32::from(letter == '[') - i32::from(letter == ']');
            match all.last_mut() {
                Some(last) if letter != ',' || depth > 0 => last.push(letter),
                _ => all.push(String::new()),
            }
        }
        if all.iter().any(|value| value.trim().is_empty()) {
            return Err(sentence.into());
        }
        if all.len() > MOST {
            return Err(format!("{} values are more than {MOST}", all.len()));
        }
        Ok(Axes { path: path.into(), values: all.iter().map(|value| value.trim().into()).collect() })
    }
}

/// A field, and a microarchitecture for each value.
#[derive(Clone, Debug)]
pub struct Variants {
    axes: Axes,
    machines: Vec<Microarchitecture>,
}

impl Variants {
    /// Of a machine.
    ///
    /// # Errors
    /// [`Error::Input`] naming the first value that no machine can have.
    pub fn new(machine: &Machine, axes: &Axes) -> Result<Self> {
        let one = |value: &String| {
            let setting = format!("{}={value}", axes.path);
            let flag = machines::flag("--timing", &setting);
            let other = machines::changed(machine, &setting, &flag)?;
            let elaborated = fixed::elaborate(&other).map_err(|error| Error::input(format!("{flag}: {error}")))?;
            Ok(elaborated.timing)
        };
        Ok(Variants { axes: axes.clone(), machines: axes.values.iter().map(one).collect::<Result<_>>()? })
    }
}

/// Frame times by value.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Timings {
    /// The field.
    pub path: String,
    /// Value by value.
    pub rows: Vec<Row>,
}

/// A frame's time with one value.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Row {
    /// The value.
    pub value: String,
    /// Time of the frame with it.
    pub cycles: CyclesReport,
}

impl Timings {
    /// Replays a frame's work on all of them.
    pub fn new(variants: &Variants, work: &Work) -> Self {
        let Variants { axes, machines } = variants;
        let row = |(value, machine): (&String, &Microarchitecture)| Row {
            value: value.clone(),
            cycles: CyclesReport::new(machine, work, &timing::replay(machine, work, Detail::Histograms)),
        };
        Timings { path: axes.path.clone(), rows: axes.values.par_iter().zip(machines).map(row).collect() }
    }

    /// At most 80 columns.
    pub fn table(&self) -> String {
        let mut table = plain_table(&[self.path.trim_start_matches("timing."), "cycles", "frames/s", "of best", "limited by", "memory MB"]);
        let best = self.rows.iter().map(|row| row.cycles.frames_per_second).fold(0.0, f64::max);
        for Row { value, cycles } in &self.rows {
            table.add_row([
                value.clone(),
                thousands(cycles.total),
                format!("{:.1}", cycles.frames_per_second),
                format!("{:.1}%", 100.0 * cycles.frames_per_second / best),
                cycles.limited_by(),
                format!("{:.1}", cycles.memory.bytes as f64 / 1e6),
            ]);
        }
        aligned(table).trim_fmt()
    }

    /// Frames a second by value.
    pub fn chart(&self) -> Bars {
        let most = self.rows.iter().map(|row| row.cycles.frames_per_second).fold(0.0, f64::max);
        Bars {
            title: format!("Frames a second by {}", self.path),
            axis: Axis::linear("frames/s").within(0.0, 1.05 * most),
            legend: vec![String::new()],
            rows: self.rows.iter().map(|row| (row.value.clone(), vec![row.cycles.frames_per_second])).collect(),
            ..Bars::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_parted_by_commas_outside_of_brackets() {
        let axes: Axes = "timing.raster.lanes=[1,1], [2,2],[4,1]".parse().unwrap();
        assert_eq!((axes.path.as_str(), axes.values), ("timing.raster.lanes", ["[1,1]", "[2,2]", "[4,1]"].map(String::from).to_vec()));
        for wrong in ["", "raster.fifo=1", "timing.fifo", "timing.fifo=", "timing.fifo=1,,2"] {
            assert!(wrong.parse::<Axes>().unwrap_err().contains("timing.raster.fifo=1,2,4"), "{wrong}");
        }
    }
}

//! Roofline: bytes per frame against its cycles, with the lower limits set by memory and the
//! busiest units (docs/book/timing-explore.md).
//!
//! ```text
//! cycles ▲ ╱ memory: bytes / bytes per cycle
//!        │   ✕   ╱     the frame: its height above the lines is lost to stalls
//!        │──────╱── fragment: the cycles that it is busy
//!        │─────╱─── raster
//!        └────────────► bytes
//! ```
//! The roofs of Williams, Waterman and Patterson ("Roofline", CACM 2009) upside down: cycles of one
//! frame, not work per second, because all points are the same frame.

use crate::output::chart::{Axis, Mark, Panel, Series};
use crate::output::text::thousands;
use crate::performance::answers::Answers;
use crate::performance::cycles::CyclesReport;
use crate::performance::timings::Timings;

/// Number of lines of units: the busiest ones.
const MOST_UNITS: usize = 4;
/// Greatest number of other machines with a name at their point.
const MOST_NAMED: usize = 12;

/// The chart of a frame, and of the same frame on other microarchitectures.
pub fn chart(cycles: &CyclesReport, timings: Option<&Timings>, answers: Option<&Answers>) -> Panel {
    let point = |bytes: u64, cycles: u64| [bytes as f64 / 1e6, cycles as f64 / 1e6];
    let frame = point(cycles.memory.bytes, cycles.total);
    let varied: Vec<([f64; 2], String)> = timings.map_or_else(Vec::new, |timings| {
        timings
            .rows
            .iter()
            .map(|row| {
                (
                    point(row.cycles.memory.bytes, row.cycles.total),
                    row.value.clone(),
                )
            })
            .collect()
    });
    let answered: Vec<([f64; 2], String)> = answers.map_or_else(Vec::new, |answers| {
        let short_name = |field: &str| field.trim_start_matches("timing.").to_owned();
        answers
            .best
            .iter()
            .map(|best| {
                (
                    point(best.bytes, best.cycles),
                    format!("{} {}", short_name(&best.field), best.to),
                )
            })
            .collect()
    });
    let points =
        || std::iter::once(frame).chain(varied.iter().chain(&answered).map(|(point, _)| *point));
    let least = |at: usize| {
        points()
            .map(|point| point[at])
            .filter(|value| *value > 0.0)
            .fold(f64::INFINITY, f64::min)
    };
    let most = |at: usize| points().map(|point| point[at]).fold(0.0, f64::max);
    // A frame without traffic or cycles has no place on logarithmic axes.
    let [x, y] = [[least(0) / 3.0, most(0) * 3.0], [least(1), most(1) * 1.6]]
        .map(|[low, high]| if low < high { [low, high] } else { [0.1, 10.0] });

    let mut series = Vec::new();
    let mut lowest = y[0];
    if let (Some(peak), true) = (cycles.memory.peak_bytes_per_second, cycles.clock_hz > 0) {
        let bytes_a_cycle = peak / cycles.clock_hz as f64;
        let roof = |megabytes: f64| [megabytes, megabytes / bytes_a_cycle];
        lowest = lowest.min(frame[0] / bytes_a_cycle);
        series.push(Series {
            name: format!("memory, {bytes_a_cycle} bytes a cycle"),
            points: x.map(roof).to_vec(),
            mark: Mark::Line,
            colour: 0,
        });
    }
    let mut units: Vec<_> = cycles.units.iter().filter(|unit| unit.busy > 0).collect();
    // The sort is stable: among equals, the first in the diagram comes first.
    units.sort_by_key(|unit| std::cmp::Reverse(unit.busy));
    for (nth, unit) in units.into_iter().take(MOST_UNITS).enumerate() {
        let busy = unit.busy as f64 / 1e6;
        lowest = lowest.min(busy);
        let points = x.map(|x| [x, busy]).to_vec();
        series.push(Series {
            name: format!("{}, busy", unit.name),
            points,
            mark: Mark::Dashed,
            colour: 1 + nth,
        });
    }
    if !varied.is_empty() {
        let name = timings.map_or_else(String::new, |timings| timings.path.replace("timing.", ""));
        series.push(Series {
            name,
            points: varied.iter().map(|(point, _)| *point).collect(),
            mark: Mark::Rings,
            colour: 5,
        });
    }
    if !answered.is_empty() {
        series.push(Series {
            name: "one field changed".into(),
            points: answered.iter().map(|(point, _)| *point).collect(),
            mark: Mark::Triangles,
            colour: 6,
        });
    }
    series.push(Series {
        name: "the frame".into(),
        points: vec![frame],
        mark: Mark::Crosses,
        colour: 6,
    });
    let named = varied
        .into_iter()
        .take(MOST_NAMED)
        .chain(answered)
        .filter(|(point, _)| *point != frame);
    Panel {
        title: format!(
            "{} cycles: limited by {}",
            thousands(cycles.total),
            cycles.limited_by()
        ),
        x: Axis::log("MB to and from memory, a frame").within(x[0], x[1]),
        y: Axis::log("million cycles a frame").within(lowest / 1.6, y[1]),
        series,
        notes: named.collect(),
        ..Panel::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hardware::fixed;
    use rtl_model::Machine;
    use rtl_model::timing::{Detail, replay};
    use rtl_model::work::Work;

    fn drawn(ideal: bool, side: u32) -> (CyclesReport, Panel) {
        let mut machine = Machine::named("tiny").unwrap();
        machine.timing.memory.ideal = ideal;
        let timing = fixed::elaborate(&machine).unwrap().timing;
        let work = Work {
            width: side,
            height: side,
            ..Work::default()
        };
        let mut cycles =
            CyclesReport::new(&timing, &work, &replay(&timing, &work, Detail::Histograms));
        // Without splats every unit is idle.
        cycles.units[0].busy = cycles.total / 2;
        let panel = chart(&cycles, None, None);
        (cycles, panel)
    }

    #[test]
    fn no_frame_is_below_a_roof_and_ideal_memory_has_none() {
        let (cycles, panel) = drawn(false, 64);
        let [frame] = panel.series.last().unwrap().points[..] else {
            panic!()
        };
        assert_eq!(
            frame,
            [cycles.memory.bytes as f64 / 1e6, cycles.total as f64 / 1e6]
        );
        let memory = &panel.series[0];
        assert!(
            memory.name == "memory, 16 bytes a cycle"
                && memory
                    .points
                    .iter()
                    .all(|[x, y]| (x / 16.0 - y).abs() < 1e-12),
            "{memory:?}"
        );
        assert!(frame[0] / 16.0 <= frame[1]);
        let units: Vec<&Series> = panel
            .series
            .iter()
            .filter(|series| series.name.ends_with(", busy"))
            .collect();
        assert!(
            !units.is_empty()
                && units
                    .iter()
                    .all(|unit| unit.points[0][1] <= frame[1]
                        && unit.points[0][1] == unit.points[1][1])
        );
        assert!(
            drawn(true, 64)
                .1
                .series
                .iter()
                .all(|series| !series.name.starts_with("memory"))
        );
    }
}

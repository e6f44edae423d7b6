//! Answers: what-if analysis of a frame. Which fields of `timing`, or of the lists of tiles, each
//! changed alone, make the drawn frame faster (docs/book/timing-explore.md)?
//!
//! ```text
//! timing with all defaults filled in ─► every field doubled, or halved ─► elaborates? ─► replay ─► frames/s, area, energy ─► the best
//! ```
//! Each result is a replay of the recorded work on a machine that differs in one field. It has the
//! same numbers as `run --set FIELD=VALUE`.
//!
//! Laws: `no_field_of_timing_is_forgotten`; tests/compare.rs:
//! `an_answer_is_what_the_run_with_it_says`.

use crate::hardware::quantise::lacks_tile_bits;
use crate::hardware::{fixed, machines};
use crate::output::text::{aligned, counted, plain, plain_table, wrapped};
use crate::performance::clock;
use crate::performance::cost::{CostReport, Prices};
use crate::performance::cycles::frames_per_second;
use crate::performance::given;
use rayon::prelude::*;
use rtl_model::Machine;
use rtl_model::elaboration::masks::MOST_TILES_PER_CYCLE;
use rtl_model::elaboration::sorter::SorterShape;
use rtl_model::machine::timing::{Colour, Contribution, Organisation, Queue, Sorter, Timing};
use rtl_model::machine::{BinTest, MaskMaker, SortKind};
use rtl_model::pipeline::Elaborated;
use rtl_model::timing::{Cycles, Detail, RecordedFrame};
use rtl_model::work::Work;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::{Value, json};

/// Greatest number of results that are reported.
const MOST: usize = 5;

/// Every order of tiles.
const QUEUES: [Queue; 2] = [Queue::Order, Queue::Longest];

/// Legend of the mark behind a field.
const GIVEN: &str = "* given: memory, or a cache's ways and look-up, has no unit cost, so area and energy do not include it";

/// Least gain that is reported, as a fraction of the frame rate.
const LEAST_GAIN: f64 = 0.001;

/// What-if results: number of tried changes, and the best.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Answers {
    /// Machines that the frame was replayed on.
    pub tried: u64,
    /// Machines that do not elaborate, for example because the clock is too fast.
    pub refused: u64,
    /// Best change of each field whose cost is counted; at most five, highest frame rate first.
    pub best: Vec<Answer>,
    /// Best change of each field without a unit cost, likewise. Such a gain comes from another
    /// memory, for example, and its area and energy are incomplete.
    pub given: Vec<Answer>,
}

/// One field with another value.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Answer {
    /// The field, as in `--set`.
    pub field: String,
    /// Value of the machine, or the default if it is left out.
    pub from: Value,
    /// The other value.
    pub to: Value,
    /// Cycles of the frame with it.
    pub cycles: u64,
    /// Frames per second with it.
    pub frames_per_second: f64,
    /// Gain in frames per second, as a fraction of the rate without it.
    pub faster: f64,
    /// Bytes to and from memory with it.
    pub bytes: u64,
    /// LUT equivalents with it.
    pub area: f64,
    /// Additional area, as a fraction of the area without it.
    pub larger: f64,
    /// Joules per frame with it.
    pub energy: f64,
    /// Why its cost is not counted; left out where it is counted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub given: Option<&'static str>,
}

impl Answers {
    /// Results for a machine that took these cycles for this work.
    pub fn new(
        machine: &Elaborated,
        frame: &RecordedFrame,
        cycles: &Cycles,
        prices: &Prices,
    ) -> Self {
        let mut all = candidates(machine);
        all.extend(candidates_of_lists(&machine.machine, frame.work));
        let before = CostReport::new(machine, cycles, prices).cost.area;
        let built: Vec<(&Candidate, Elaborated)> = all
            .par_iter()
            .filter_map(|candidate| {
                Some((candidate, candidate.built(&machine.machine, frame.work)?))
            })
            .collect();
        let timings: Vec<_> = built.iter().map(|(_, built)| &built.timing).collect();
        let answer = |((Candidate { field, from, to }, built), taken): (
            &(&Candidate, Elaborated),
            Cycles,
        )| {
            let cost = CostReport::new(built, &taken, prices);
            Answer {
                field: field.clone(),
                from: from.clone(),
                to: to.clone(),
                cycles: taken.total,
                frames_per_second: frames_per_second(&built.timing, &taken),
                faster: if taken.total == 0 {
                    0.0
                } else {
                    cycles.total as f64 / taken.total as f64 - 1.0
                },
                bytes: taken.memory.total_bytes(),
                area: cost.cost.area,
                larger: if before > 0.0 {
                    cost.cost.area / before - 1.0
                } else {
                    0.0
                },
                energy: cost.energy.total,
                given: given::reason_alone(field),
            }
        };
        let mut answers: Vec<Answer> = built
            .iter()
            .zip(frame.replay_all(&timings, Detail::Accounts))
            .map(answer)
            .collect();
        let tried = answers.len() as u64;
        // The sort is stable: among equals, the first in the description comes first.
        answers.sort_by(|one, other| {
            one.cycles
                .cmp(&other.cycles)
                .then(one.area.total_cmp(&other.area))
        });
        let [mut best, mut given] = [const { Vec::<Answer>::new() }; 2];
        for answer in answers {
            let reported = if answer.given.is_some() {
                &mut given
            } else {
                &mut best
            };
            if reported.len() < MOST
                && answer.faster >= LEAST_GAIN
                && reported.iter().all(|better| better.field != answer.field)
            {
                reported.push(answer);
            }
        }
        Answers {
            tried,
            refused: all.len() as u64 - tried,
            best,
            given,
        }
    }

    /// The table, at most 80 columns wide.
    pub fn table(&self) -> String {
        let tried = counted(self.tried, "change", "changes");
        let refused = if self.refused == 0 {
            String::new()
        } else {
            format!(", {} more cannot be built", self.refused)
        };
        if self.best.is_empty() && self.given.is_empty() {
            return wrapped(&format!(
                "answers: none of {tried} of one field makes the frame faster by 0.1%{refused}"
            ));
        }
        let header = [
            "one field changed",
            "from",
            "to",
            "faster",
            "area",
            "frames/s",
            "mJ",
        ];
        let mut rows = Vec::new();
        for Answer {
            field,
            from,
            to,
            frames_per_second,
            faster,
            larger,
            energy,
            given,
            ..
        } in self.best.iter().chain(&self.given)
        {
            let field = if given.is_some() {
                format!("{field} *")
            } else {
                field.clone()
            };
            rows.push([
                field,
                plain(from),
                plain(to),
                percent(*faster),
                percent(*larger),
                format!("{frames_per_second:.1}"),
                format!("{:.2}", energy * 1e3),
            ]);
        }
        // With long values, the last columns have no room; the report has their figures.
        let of = |columns: usize| {
            let mut table = plain_table(&header[..columns]);
            for row in &rows {
                table.add_row(&row[..columns]);
            }
            aligned(table).trim_fmt()
        };
        let fits = |table: &String| table.lines().all(|line| line.chars().count() <= 80);
        let table = [7, 6, 5].map(of).into_iter().find(fits);
        let table = table.unwrap_or_else(|| of(5));
        let head = wrapped(&format!(
            "answers, each the same frame replayed: the best of {tried}{refused}"
        ));
        let mark = if self.given.is_empty() {
            String::new()
        } else {
            format!("\n{}", wrapped(GIVEN))
        };
        format!("{head}\n{table}{mark}")
    }
}

fn percent(part: f64) -> String {
    match 100.0 * part {
        0.0 => "=".into(),
        small if small.abs() < 0.05 => if small > 0.0 {
            "+ < 0.1%"
        } else {
            "− < 0.1%"
        }
        .into(),
        percent => format!("{percent:+.1}%").replace('-', "−"),
    }
}

/// A change to try.
struct Candidate {
    field: String,
    from: Value,
    to: Value,
}

impl Candidate {
    /// The machine with the change; `None` where it does not elaborate, or its keys are too narrow
    /// for the frame.
    fn built(&self, machine: &Machine, work: &Work) -> Option<Elaborated> {
        let other =
            machines::with(machine, &[(self.field.clone(), self.to.clone())], "answers").ok()?;
        let size = [work.width, work.height].map(|side| side as usize);
        if !work.order.is_empty() && lacks_tile_bits(&other, size).is_some() {
            return None;
        }
        fixed::elaborate(&other).ok()
    }
}

/// Kind of change tried on a field of timing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Trial {
    /// More may be faster: doubled.
    More,
    /// Less may be faster: halved, or the minimum.
    Less,
    /// Either may be faster: doubled, and halved.
    Both,
    /// Every other value.
    Other,
    /// Not tried: another clock, technology or memory chip is not another design.
    Given,
}

/// Kind of change for a field name, in any unit; `None` for an unknown name.
fn trial(name: &str) -> Option<Trial> {
    Some(match name {
        "fifo" | "units" | "multipliers" | "buffers" | "lines" | "ways" | "misses"
        | "bytes_per_cycle" | "outstanding" | "lanes" | "engines" | "merges_in_flight"
        | "channels" | "write_batch" | "buffer_entries" | "network" | "blocks" | "splats" => {
            Trial::More
        }
        "latency" | "interval" | "hazard" | "merge" => Trial::Less,
        "side_px" | "line_px" | "burst_bytes" | "bucket_bits" => Trial::Both,
        "queue" | "overlap" => Trial::Other,
        "clock_hz" | "technology" | "organisation" | "ideal" | "hit_latency" | "miss_latency"
        | "row_bytes" | "banks" => Trial::Given,
        "preset"
        | "bytes_per_cycle_permille"
        | "interleave_bytes"
        | "ranks"
        | "rank_switch_cycles" => Trial::Given,
        "refresh_interval_cycles"
        | "refresh_cycles"
        | "turnaround_cycles"
        | "row_cycles"
        | "four_rows_cycles" => Trial::Given,
        _ => return None,
    })
}

/// Every change that is tried, in the order of the description.
fn candidates(machine: &Elaborated) -> Vec<Candidate> {
    let mut timing = json!(filled(machine));
    timing["queue"] = json!(machine.timing.timing.queue);
    if timing["sort"].is_object() {
        timing["sort"]["overlap"] = json!(machine.timing.overlaps_sort());
    }
    let unused: &[&str] = match machine.timing.timing.organisation {
        Organisation::Binned => &["cache"],
        Organisation::Immediate => &["tile", "engines", "queue"],
    };
    let paths = clock::critical_paths(machine);
    let mut all = Vec::new();
    for (unit, fields) in timing
        .as_object()
        .into_iter()
        .flatten()
        .filter(|(unit, _)| !unused.contains(&unit.as_str()))
    {
        // A field outside the units is handled alone.
        let own = [(unit, fields)]
            .into_iter()
            .filter(|(_, value)| !value.is_object());
        for (name, from) in fields.as_object().into_iter().flatten().chain(own) {
            let field = if fields.is_object() {
                format!("timing.{unit}.{name}")
            } else {
                format!("timing.{name}")
            };
            let least = match name.as_str() {
                "latency" => paths
                    .iter()
                    .find(|path| path.name == unit)
                    .map_or(1, |path| path.least),
                "merge" => 0,
                _ => 1,
            };
            let values = match trial(name).unwrap_or(Trial::Given) {
                Trial::Other => other_choices(name, from),
                trial => others(trial, from, u64::from(least)),
            };
            all.extend(values.into_iter().map(|to| Candidate {
                field: field.clone(),
                from: from.clone(),
                to,
            }));
        }
    }
    all
}

/// Every change of the test of tiles, of masks and of the sort that a record has the words for.
fn candidates_of_lists(machine: &Machine, work: &Work) -> Vec<Candidate> {
    if machine.timing.organisation != Organisation::Binned {
        return Vec::new();
    }
    let candidate = |field: &str, from: Value, to: Value| Candidate {
        field: field.to_owned(),
        from,
        to,
    };
    let mut all = Vec::new();
    let mut choices = |field: &str, from: Value, choices: &[Value]| {
        let others = choices.iter().filter(|to| **to != from);
        all.extend(others.map(|to| candidate(field, from.clone(), to.clone())));
    };
    let bin = machine.bin.unwrap_or_default();
    let tiles = bin.tiles_per_cycle.unwrap_or(1);
    choices(
        "bin.tiles_per_cycle",
        json!(tiles),
        &[json!(tiles.saturating_mul(2).min(MOST_TILES_PER_CYCLE))],
    );
    if !work.tested.is_empty() {
        let tests = [BinTest::Box, BinTest::OrientedBox, BinTest::Ellipse];
        choices("bin.test", json!(bin.test), &tests.map(|test| json!(test)));
        if bin.test != BinTest::Box && machine.contribution.is_none() {
            let sides = [Value::Null, json!(4), json!(8), json!(16)];
            choices("bin.subtile_px", json!(bin.subtile_px), &sides);
        }
        if bin.subtile_px.is_some() {
            let makers = [MaskMaker::Bin, MaskMaker::List].map(|made| json!(made));
            choices("bin.masks", json!(bin.masks.unwrap_or_default()), &makers);
            let tests = bin.mask_tests.unwrap_or(1);
            let twice = json!(tests.saturating_mul(2));
            choices("bin.mask_tests", json!(tests), &[twice]);
        }
    }
    // Kept lists have an order of their own.
    let sort = machine.sort.filter(|_| machine.keeps_lists().is_none());
    if let Some(sort) = sort.filter(|_| !work.order.is_empty()) {
        let mut kinds = vec![json!(SortKind::Radix), json!(SortKind::Tile)];
        if work.keys.len() == work.order.len() {
            kinds.push(json!(SortKind::Hierarchical));
        }
        choices("sort.kind", json!(sort.kind), &kinds);
    }
    all
}

/// Every other value of a field with a few values.
fn other_choices(name: &str, from: &Value) -> Vec<Value> {
    let all = match name {
        "queue" => QUEUES.map(|queue| json!(queue)),
        _ => [json!(false), json!(true)],
    };
    all.into_iter().filter(|value| value != from).collect()
}

/// Other values of a number, or of each number of a pair.
fn others(trial: Trial, from: &Value, least: u64) -> Vec<Value> {
    if let Some(pair) = from.as_array() {
        let with = &|at: usize, value: Value| {
            let mut pair = pair.clone();
            pair[at] = value;
            Value::Array(pair)
        };
        return (0..pair.len())
            .flat_map(|at| {
                others(trial, &pair[at], least)
                    .into_iter()
                    .map(move |value| with(at, value))
            })
            .collect();
    }
    let Some(number) = from.as_u64() else {
        return Vec::new();
    };
    let (twice, half) = (number.saturating_mul(2), (number / 2).max(least));
    let mut values = match trial {
        Trial::More => vec![twice],
        Trial::Less => vec![half, least],
        Trial::Both => vec![twice, half],
        Trial::Other | Trial::Given => Vec::new(),
    };
    values.retain(|value| *value != number && (trial != Trial::Less || *value < number));
    values.dedup();
    values.into_iter().map(Value::from).collect()
}

/// The timing of a machine with all defaults filled in, except multipliers: by default every
/// product has its own.
fn filled(machine: &Elaborated) -> Timing {
    let built = &machine.timing;
    let mut timing = built.timing;
    timing.fetch.splats = Some(built.fetch.units);
    for (setup, pace) in [
        (&mut timing.project, built.project),
        (&mut timing.ellipse, built.ellipse),
    ] {
        setup.latency = Some(pace.latency);
        setup.interval = Some(pace.interval);
    }
    if let Some(most) = built.colour.last() {
        let colour = timing.colour.unwrap_or_default();
        let latency = Some(most.pace.latency);
        timing.colour = Some(Colour {
            latency,
            interval: Some(most.pace.interval),
            ..colour
        });
    }
    if let Some(SorterShape {
        units,
        buffer_entries,
        network,
        bucket_bits,
        overlap,
        ..
    }) = built.sort.and_then(|sort| sort.sorter)
    {
        timing.sort = Some(Sorter {
            units,
            buffer_entries,
            network,
            bucket_bits,
            overlap,
        });
    }
    if let Some(blocks) = built.contribution {
        timing.contribution = Some(Contribution {
            latency: Some(blocks.latency),
            ..timing.contribution.unwrap_or_default()
        });
    }
    timing.engines = Some(built.engines);
    timing.fragment.units = Some(built.fragment.units);
    timing.fragment.merges_in_flight = Some(built.merges_in_flight);
    timing.shade.units = Some(built.shade.units);
    timing.resolve.units = Some(built.resolve.units);
    timing.raster.latency = Some(built.raster.latency);
    timing.gauss.latency = Some(built.gauss.latency);
    timing.fragment.latency = Some(built.fragment.latency);
    timing.fragment.hazard = Some(built.hazard);
    timing.shade.latency = Some(built.shade.latency);
    timing.resolve.latency = Some(built.resolve.latency);
    timing
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_field_of_timing_is_forgotten() {
        let mut names = Vec::new();
        let hierarchical =
            machines::load("gaussian", &["sort.kind=hierarchical".to_owned()]).unwrap();
        for machine in [Machine::named("tiny").unwrap(), hierarchical] {
            let timing = json!(filled(&fixed::elaborate(&machine).unwrap()));
            for (name, value) in timing.as_object().unwrap() {
                match value.as_object() {
                    Some(fields) => names.extend(fields.keys().cloned()),
                    None => names.push(name.clone()),
                }
            }
        }
        assert!(
            ["buffer_entries", "network", "bucket_bits"]
                .iter()
                .all(|name| names.contains(&(*name).to_owned())),
            "{names:?}"
        );
        let new: Vec<&String> = names.iter().filter(|name| trial(name).is_none()).collect();
        assert!(
            names.len() > 30 && new.is_empty(),
            "{new:?}: its kind of change is missing"
        );
    }

    #[test]
    fn a_number_is_doubled_or_halved_and_a_pair_one_by_one() {
        let values = |trial, from: Value, least| Value::Array(others(trial, &from, least));
        assert_eq!(values(Trial::More, json!(4), 1), json!([8]));
        assert_eq!(
            values(Trial::More, json!([4, 1]), 1),
            json!([[8, 1], [4, 2]])
        );
        assert_eq!(values(Trial::Less, json!(37), 3), json!([18, 3]));
        assert_eq!(values(Trial::Less, json!(6), 4), json!([4]));
        assert_eq!(values(Trial::Less, json!(6), 6), json!([]));
        assert_eq!(values(Trial::Less, json!(1), 0), json!([0]));
        assert_eq!(values(Trial::Both, json!(16), 1), json!([32, 8]));
        assert_eq!(values(Trial::Given, json!(16), 1), json!([]));
    }
}

//! Over fragment: finds the cheapest merge rule and number of layers for a target. `golden` draws
//! each rule with 1 to 8 layers. The result is given for each scene and for all; of equally cheap
//! ones the fastest.
//!
//! ```text
//! scenes ─► ideal ─┐
//! rules × layers ─► golden ─► golden − ideal ─► the least area, or bytes per pixel, at the target
//!               └─► machine ─► frames/s, for information
//! ```
//! The error of the method does not depend on words, but a scene must fit the words. Costs are for
//! the base's words, or for those of the named machine if the base has none for a rule. `search`
//! without `--over` then finds the words.
//!
//! Law (tests/search.rs): `the_cheapest_rule_is_found`.

use crate::accuracy::distance;
use crate::error::{Error, Result};
use crate::golden;
use crate::hardware::quantise::quantise;
use crate::hardware::{fixed, machines};
use crate::output::chart::{Axis, Chart, Mark, Panel, Series, write_png};
use crate::output::files::{Folder, write_beside};
use crate::output::picture::Picture;
use crate::output::progress::Progress;
use crate::output::text::{aligned, plain_table, thousands, wrapped};
use crate::performance::cost::{Cost, Prices};
use crate::performance::cycles::frames_per_second;
use crate::run::evaluation::Evaluation;
use crate::scene::Scene;
use rtl_model::Machine;
use rtl_model::elaboration::unit;
use rtl_model::machine::{Group, Merge};
use rtl_model::timing::{self, Detail};
use rtl_model::units::fragment::MAX_LAYERS;
use rtl_model::units::fragment::window::overflow_cycles;
use serde::Serialize;
use serde_json::json;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Quantity to minimise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LeastOf {
    /// LUT equivalents of the whole machine.
    Area,
    /// Bytes per pixel for its fragments.
    Bytes,
}

/// Size of a panel of the chart, pixels.
const CELL_PX: [u32; 2] = [480, 400];

/// A merge rule.
#[derive(Clone, Copy, Debug)]
struct MergeRule {
    name: &'static str,
    group: Group,
    merge: Merge,
    /// `fragment.window.join_permille`, for windows.
    join_permille: u32,
}

const fn rule(name: &'static str, group: Group, merge: Merge, join_permille: u32) -> MergeRule {
    MergeRule {
        name,
        group,
        merge,
        join_permille,
    }
}

const RULES: [MergeRule; 5] = [
    rule("nearest-pair", Group::First, Merge::NearestPair, 0),
    rule("farthest-pair", Group::First, Merge::FarthestPair, 0),
    rule("interval", Group::Interval, Merge::Window, 0),
    rule("window", Group::Window, Merge::Window, 0),
    rule("window-join-0.1", Group::Window, Merge::Window, 100),
];

/// A rule with a number of layers.
#[derive(Clone, Debug, Serialize)]
pub struct Choice {
    /// Its name.
    pub rule: &'static str,
    /// Layers per pixel.
    pub layers: u32,
    /// Bytes per pixel for its fragments.
    pub pixel_bytes: u32,
    /// Area of the machine with this rule, LUT equivalents.
    pub area: f64,
    /// Area of its units `fragment` and `shade`, LUT equivalents. Some rules have two of each,
    /// others one.
    pub fragment_and_shade_area: f64,
    /// PSNR golden − ideal of each scene, dB; null if the pictures are equal.
    pub psnr_db: Vec<Option<f64>>,
    /// Whether each scene reaches the target.
    pub reaches: Vec<bool>,
    /// Fragments that `golden` composites at overflows, per scene.
    pub merged: Vec<u64>,
    /// Pairs that `golden` sums there, per scene.
    pub summed: Vec<u64>,
    /// Frames per second of the machine, per scene.
    pub frames_per_second: Vec<f64>,
}

impl Choice {
    fn costs(&self, by: LeastOf) -> f64 {
        match by {
            LeastOf::Area => self.area,
            LeastOf::Bytes => self.pixel_bytes.into(),
        }
    }

    /// Frames per second of the slowest scene.
    fn slowest(&self) -> f64 {
        self.frames_per_second
            .iter()
            .copied()
            .fold(f64::INFINITY, f64::min)
    }
}

/// Result of the search.
#[derive(Debug)]
pub struct FragmentOutcome {
    scenes: Vec<String>,
    target_db: f64,
    by: LeastOf,
    choices: Vec<Choice>,
    /// Index of the cheapest choice for each scene, and for all; None if no choice reaches the
    /// target.
    found: Vec<Option<usize>>,
    found_for_all: Option<usize>,
    /// Files written.
    pub files: Vec<PathBuf>,
}

/// The machine with another fragment unit: with its own words if it has them, else with those of
/// the named machine for the rule.
fn with_rule(base: &Machine, rule: MergeRule, layers: u32) -> Option<Machine> {
    let is_first = |machine: &Machine| machine.fragment.group == Group::First;
    let named = Machine::named(if rule.group == Group::First {
        "reference"
    } else {
        "window"
    })?;
    let from = if is_first(base) == (rule.group == Group::First) {
        base
    } else {
        &named
    };
    let mut machine = Machine {
        fragment: from.fragment,
        ..base.clone()
    };
    (
        machine.fragment.group,
        machine.fragment.merge,
        machine.fragment.layers,
    ) = (rule.group, rule.merge, layers);
    if let Some(window) = &mut machine.fragment.window {
        window.join_permille = rule.join_permille;
    }
    // The overflow cycles of the new fragment unit, whatever the base's rule was.
    machine.timing.fragment.merge = from.timing.fragment.merge.max(overflow_cycles(&machine));
    Some(machine)
}

/// Frames per second of the machine, by replaying the frame.
fn replayed(evaluation: &Evaluation) -> f64 {
    let (_, _, work) = fixed::draw_measured(&evaluation.machine, &evaluation.quantised);
    let machine = &evaluation.machine.timing;
    frames_per_second(machine, &timing::replay(machine, &work, Detail::Total))
}

/// Tries all rules, and writes `machine.json` (the cheapest for all scenes), `choices.json` and the
/// chart `rules.png`.
///
/// # Errors
/// [`Error::Input`] if a scene is of sheets, whose merge rule is fixed, or a machine cannot be
/// built or cannot hold a scene: nothing is written then. [`Error::Job`] if no rule reaches the
/// target on all scenes: `choices.json` is still written.
pub fn run(
    scenes: &[Scene],
    base: &Machine,
    folder: &Path,
    target_db: f64,
    by: LeastOf,
    prices: &Prices,
    show: bool,
) -> Result<FragmentOutcome> {
    if let Some(scene) = scenes.iter().find(|scene| scene.sheets.is_some()) {
        return Err(Error::input(format!(
            "{}: sheets are blended one after the other, and have no rule to search for",
            scene.name
        )));
    }
    // First: nothing may be written if a scene does not fit. The number of layers does not change
    // words.
    for machine in RULES
        .into_iter()
        .filter_map(|rule| with_rule(base, rule, 1))
    {
        scenes
            .iter()
            .try_for_each(|scene| quantise(scene, &machine).map(drop))?;
    }
    let _open = Folder::open(folder)?;
    let choices: Vec<_> = RULES
        .into_iter()
        .flat_map(|rule| (1..=MAX_LAYERS as u32).map(move |layers| (rule, layers)))
        .collect();
    let progress = Progress::of_steps(show, (choices.len() * scenes.len()) as u64, "rules");
    let ideals: Vec<Picture> = scenes
        .iter()
        .map(|scene| golden::ideal(scene).picture)
        .collect();
    let mut tried = Vec::new();
    let mut built = Vec::new();
    for (rule, layers) in choices {
        let Some(machine) = with_rule(base, rule, layers) else {
            continue;
        };
        let elaborated = fixed::elaborate(&machine)?;
        let cost = Cost::new(&elaborated, prices);
        let of_rule = cost
            .units
            .iter()
            .filter(|unit| [unit::FRAGMENT, unit::SHADE].contains(&unit.name));
        let mut choice = Choice {
            rule: rule.name,
            layers,
            pixel_bytes: elaborated.timing.fragment_bytes * layers,
            area: cost.area,
            fragment_and_shade_area: of_rule.map(|unit| unit.area).sum(),
            psnr_db: Vec::new(),
            reaches: Vec::new(),
            merged: Vec::new(),
            summed: Vec::new(),
            frames_per_second: Vec::new(),
        };
        for (scene, ideal) in scenes.iter().zip(&ideals) {
            let evaluation = Evaluation::on(scene, &elaborated)?;
            let (golden, frames) = rayon::join(|| evaluation.golden(), || replayed(&evaluation));
            let apart = distance(&golden.picture, ideal);
            // NaN does not reach the target.
            let db = if apart.not_finite > 0 {
                Some(f64::NEG_INFINITY)
            } else {
                apart.psnr_db
            };
            choice.psnr_db.push(db);
            choice.reaches.push(db.is_none_or(|db| db >= target_db));
            choice.merged.push(golden.outcomes.merged);
            choice.summed.push(golden.outcomes.summed);
            choice.frames_per_second.push(frames);
            progress.step();
        }
        tried.push(choice);
        built.push(machine);
    }
    drop(progress);
    let cheapest = |reaches: &dyn Fn(&Choice) -> bool| {
        let reaching = tried
            .iter()
            .enumerate()
            .filter(|(_, choice)| reaches(choice));
        let better = |a: &Choice, b: &Choice| {
            a.costs(by)
                .total_cmp(&b.costs(by))
                .then(b.slowest().total_cmp(&a.slowest()))
        };
        reaching
            .min_by(|(_, a), (_, b)| better(a, b))
            .map(|(nth, _)| nth)
    };
    let found = (0..scenes.len())
        .map(|scene| cheapest(&|choice| choice.reaches[scene]))
        .collect();
    let found_for_all = cheapest(&|choice| choice.reaches.iter().all(|reaches| *reaches));
    let names: Vec<String> = scenes.iter().map(|scene| scene.name.clone()).collect();
    let mut outcome = FragmentOutcome {
        scenes: names,
        target_db,
        by,
        choices: tried,
        found,
        found_for_all,
        files: Vec::new(),
    };
    let path = folder.join("choices.json");
    let message = json!({"scenes": outcome.scenes, "target_psnr_db": target_db, "by": by, "choices": outcome.choices,
        "found": outcome.found, "found_for_all": found_for_all});
    write_beside(&path, |file| {
        serde_json::to_writer_pretty(file, &message).map_err(|e| e.to_string())
    })?;
    outcome.files.push(path);
    let path = folder.join("rules.png");
    outcome.write_chart(&path)?;
    outcome.files.push(path);
    let Some(nth) = found_for_all else {
        return Err(Error::job(outcome.without_end()));
    };
    let name = format!(
        "{}-{}",
        outcome.choices[nth].rule, outcome.choices[nth].layers
    );
    let machine = machines::File {
        machine: Machine {
            name,
            ..built[nth].clone()
        },
        searched: None,
    };
    let path = folder.join("machine.json");
    write_beside(&path, |file| {
        serde_json::to_writer_pretty(file, &machine).map_err(|e| e.to_string())
    })?;
    outcome.files.insert(0, path);
    Ok(outcome)
}

impl FragmentOutcome {
    fn cost(&self, nth: usize) -> String {
        let choice = &self.choices[nth];
        let Choice {
            rule,
            layers,
            pixel_bytes,
            area,
            ..
        } = choice;
        let s = if *layers == 1 { "" } else { "s" };
        format!(
            "{rule} with {layers} layer{s}: {pixel_bytes} bytes a pixel, {} LUT equivalents",
            thousands(*area as u64)
        )
    }

    /// The nearest choice, if no choice reaches the target on all scenes.
    fn without_end(&self) -> String {
        let worst = |choice: &Choice| {
            choice
                .psnr_db
                .iter()
                .map(|db| db.unwrap_or(f64::INFINITY))
                .fold(f64::INFINITY, f64::min)
        };
        let best = (0..self.choices.len())
            .max_by(|a, b| worst(&self.choices[*a]).total_cmp(&worst(&self.choices[*b])));
        let nearest = best.map_or(String::new(), |nth| {
            format!(
                "; the nearest, {}, has {:.1} dB",
                self.cost(nth),
                worst(&self.choices[nth])
            )
        });
        format!(
            "no rule with up to {MAX_LAYERS} layers reaches {} dB, golden − ideal, on every scene{nearest}",
            self.target_db
        )
    }

    /// All choices and the cheapest; at most 80 columns wide for few scenes.
    pub fn summary(&self) -> String {
        let what = if self.by == LeastOf::Area {
            "area"
        } else {
            "bytes a pixel"
        };
        let head = format!(
            "{}: at least {} dB, golden − ideal, by {what}",
            self.scenes.join(", "),
            self.target_db
        );
        let mut heads = vec!["rule", "l", "bytes a pixel", "area"];
        heads.extend(self.scenes.iter().map(String::as_str));
        heads.push(if self.scenes.len() > 1 {
            "least frames/s"
        } else {
            "frames/s"
        });
        let mut table = plain_table(&heads);
        for choice in &self.choices {
            let cells = choice
                .psnr_db
                .iter()
                .zip(&choice.reaches)
                .map(|(db, reaches)| {
                    let db = db.map_or("equal".into(), |db| format!("{db:.1}"));
                    if *reaches {
                        format!("{db} *")
                    } else {
                        format!("{db}  ")
                    }
                });
            let own = [
                choice.rule.to_owned(),
                choice.layers.to_string(),
                choice.pixel_bytes.to_string(),
                thousands(choice.area as u64),
            ];
            table.add_row(
                own.into_iter()
                    .chain(cells)
                    .chain([format!("{:.1}", choice.slowest())]),
            );
        }
        let mut text = format!(
            "{}\n\n{}\n* reaches the target\n",
            wrapped(&head),
            aligned(table).trim_fmt()
        );
        if self.scenes.len() > 1 {
            for (name, found) in self.scenes.iter().zip(&self.found) {
                let _ = write!(
                    text,
                    "\n{}",
                    wrapped(&format!(
                        "{name}: {}",
                        found.map_or("none".into(), |nth| self.cost(nth))
                    ))
                );
            }
        }
        if let Some(nth) = self.found_for_all {
            let whose = if self.scenes.len() > 1 { "all: " } else { "" };
            let _ = write!(text, "\n{}", wrapped(&format!("{whose}{}", self.cost(nth))));
        }
        text
    }

    /// golden − ideal of each scene against the costs of layers and rules: one row of four panels
    /// per scene.
    fn write_chart(&self, path: &Path) -> Result<()> {
        let panels: Vec<Panel> = (0..self.scenes.len())
            .flat_map(|scene| self.panels(scene))
            .collect();
        let charts: Vec<&dyn Chart> = panels.iter().map(|panel| panel as &dyn Chart).collect();
        write_png(&charts, 4, CELL_PX, path)
    }

    fn panels(&self, scene: usize) -> [Panel; 4] {
        type Figure = fn(&Choice, usize) -> f64;
        // A logarithmic axis needs at least one merge.
        let axes: [(Axis, Figure); 4] = [
            (Axis::linear("bytes per pixel"), |choice, _| {
                choice.pixel_bytes.into()
            }),
            (Axis::log("merges, at least 1"), |choice, scene| {
                choice.merged[scene].max(1) as f64
            }),
            (
                Axis::linear("area of fragment and shade, LUT equivalents"),
                |choice, _| choice.fragment_and_shade_area,
            ),
            (Axis::linear("frames/s"), |choice, scene| {
                choice.frames_per_second[scene]
            }),
        ];
        axes.map(|(x, figure)| {
            let of_rule = |name: &'static str| {
                self.choices
                    .iter()
                    .filter(move |choice| choice.rule == name)
            };
            // A picture that equals ideal has no point.
            let point = |choice: &Choice| {
                Some([
                    figure(choice, scene),
                    choice.psnr_db[scene].filter(|db| db.is_finite())?,
                ])
            };
            let series = RULES.iter().enumerate().map(|(colour, rule)| Series {
                name: rule.name.into(),
                points: of_rule(rule.name).filter_map(point).collect(),
                mark: Mark::Rings,
                colour,
            });
            let notes = RULES.iter().flat_map(|rule| of_rule(rule.name));
            let notes =
                notes.filter_map(|choice| Some((point(choice)?, choice.layers.to_string())));
            Panel {
                title: self.scenes[scene].clone(),
                x,
                y: Axis::linear("golden − ideal, dB"),
                series: series.collect(),
                notes: notes.collect(),
                ..Panel::default()
            }
        })
    }
}

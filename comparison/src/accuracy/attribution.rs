//! Attribute: how much of the error each unit and each word causes.
//!
//! ```text
//! each unit, each word ─┬─► it in words, the rest in f64 ──┬─► distance from golden
//!                       └─► it in f64, the rest in words ──┘
//! ```
//! The two need not agree. Where errors cancel, or one hides behind a greater one, each distance
//! shows only half. The names that lead both lists are those where one more bit helps most. The
//! lists are ordered by mean error, because a decision that flips at a single pixel dominates the
//! mean square.

use crate::accuracy::partial::{ChosenWords, DrawnFootprints, MixedDrawing, UNITS, words};
use crate::accuracy::{Distance, db_text, distance};
use crate::hardware::quantise::Quantised;
use crate::output::chart::{Axis, Bars};
use crate::output::picture::Picture;
use crate::output::text::{aligned, plain_table};
use crate::scene::Scene;
use comfy_table::Table;
use rtl_model::pipeline::Elaborated;
use rtl_model::records::unit;
use schemars::JsonSchema;
use serde::Serialize;

/// Share of the error that each part of a machine causes. All distances are from `golden`.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Attribution {
    /// All words quantised: the machine itself.
    pub all: Distance,
    /// Unit by unit, and the splat's record.
    pub units: Vec<Share>,
    /// Word by word.
    pub words: Vec<Share>,
}

/// Error that one part of a machine causes.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Share {
    /// Unit, or `unit.word`.
    pub name: String,
    /// The part in words, the rest in f64.
    pub alone: Distance,
    /// The part in f64, the rest in words.
    pub without: Distance,
}

/// Words that setup reads in addition to those of its own units.
const ALSO_IN_SETUP: [&str; 2] = ["raster.cutoff", "fragment.normal"];
/// Units that setup uses if splats are lit before they are drawn.
const TO_LIGHT: [&str; 3] = [unit::FRAGMENT, unit::SHADE, unit::REFLECT];

fn unit_of(word: &str) -> &str {
    word.split('.').next().unwrap_or_default()
}

fn is_in_setup(word: &str, preshaded: bool) -> bool {
    let mut of_setup = UNITS.iter().take_while(|unit| **unit != unit::RASTER);
    of_setup.any(|unit| *unit == unit_of(word))
        || ALSO_IN_SETUP.contains(&word)
        || preshaded && TO_LIGHT.contains(&unit_of(word))
}

/// Draws the scene twice per part of the machine: once with only this part in words, and once with
/// everything else in words.
pub fn attribute(
    scene: &Scene,
    machine: &Elaborated,
    quantised: &Quantised,
    golden: &Picture,
) -> Attribution {
    let stage = MixedDrawing::new(scene, machine, quantised);
    let bases = [false, true].map(|chosen| stage.set_up(&ChosenWords::new(machine, |_| chosen)));
    let words = words(machine);
    let preshaded = scene
        .ellipsoids
        .as_ref()
        .is_some_and(|ellipsoids| ellipsoids.preshaded)
        || quantised.frame.window.is_some();
    // If `alone`, only words of the part are quantised; otherwise all others.
    let measure = |alone: bool, is_part: &dyn Fn(&str) -> bool| {
        let choice = ChosenWords::new(machine, |word| is_part(word) == alone);
        let in_setup = words
            .iter()
            .any(|word| is_in_setup(word, preshaded) && is_part(word));
        let own: DrawnFootprints;
        let footprints = if in_setup {
            own = stage.set_up(&choice);
            &own
        } else {
            &bases[usize::from(!alone)]
        };
        distance(&stage.fill(&choice, footprints), golden)
    };
    let share = |name: &str, is_part: &dyn Fn(&str) -> bool| Share {
        name: name.to_owned(),
        alone: measure(true, is_part),
        without: measure(false, is_part),
    };
    Attribution {
        all: measure(true, &|_| true),
        units: units(&words)
            .map(|unit| share(unit, &|word| unit_of(word) == unit))
            .collect(),
        words: words
            .iter()
            .map(|name| share(name, &|word| word == name))
            .collect(),
    }
}

/// The units that have any of these words, in the order of the diagram.
fn units(words: &[String]) -> impl Iterator<Item = &'static str> {
    UNITS
        .into_iter()
        .filter(|unit| words.iter().any(|word| unit_of(word) == *unit))
}

/// Words that are shown.
const SHOWN: usize = 16;

impl Attribution {
    /// The words that cause the greatest errors alone, the greatest first.
    fn greatest(&self) -> Vec<&Share> {
        let error = |word: &Share| word.alone.mean_covered_error;
        let mut words: Vec<&Share> = self.words.iter().filter(|word| error(word) > 0.0).collect();
        words.sort_by(|a, b| error(b).total_cmp(&error(a)));
        words.truncate(SHOWN);
        words
    }

    /// The units, and the words that cause the greatest errors, at most 80 columns wide.
    pub fn summary(&self) -> String {
        let mut table = plain_table(&[
            "",
            "alone dB",
            "mean error",
            "max error",
            "without",
            "error gone",
        ]);
        let db = |distance: &Distance| {
            db_text(distance.psnr_covered_db, distance.not_finite, |db| {
                format!("{db:.1}")
            })
        };
        let small = |error: f64| format!("{error:.1e}");
        let alone = |name: &str, d: &Distance| {
            [
                name.to_owned(),
                db(d),
                small(d.mean_covered_error),
                small(d.max_error),
            ]
        };
        let all = self.all.mean_covered_error;
        let row = |table: &mut Table, share: &Share| {
            let without = share.without.mean_covered_error;
            let gone = if all > 0.0 { 1.0 - without / all } else { 0.0 };
            // No minus before a zero.
            let gone = (1000.0 * gone).round() / 10.0 + 0.0;
            table.add_row(
                alone(&share.name, &share.alone)
                    .into_iter()
                    .chain([small(without), format!("{gone:.1} %")]),
            );
        };
        table.add_row(alone("all in words", &self.all));
        table.add_row([""]);
        self.units.iter().for_each(|unit| row(&mut table, unit));
        table.add_row([""]);
        self.greatest()
            .into_iter()
            .for_each(|word| row(&mut table, word));
        let table = aligned(table).to_string();
        let lines: Vec<&str> = table.lines().map(str::trim_end).collect();
        format!(
            "fixed − golden at covered pixels\n\
             alone: only this part in words; without: all parts except this one in words\n\n{}",
            lines.join("\n")
        )
    }

    /// The same as bars: a chart of units and a chart of words.
    pub fn charts(&self) -> [Bars; 2] {
        let row = |share: &Share| {
            (
                share.name.clone(),
                vec![
                    share.alone.mean_covered_error,
                    share.without.mean_covered_error,
                ],
            )
        };
        let legend = || {
            vec![
                "only this part in words".to_owned(),
                "all parts except this one in words".to_owned(),
            ]
        };
        let axis = || Axis::log("mean error at covered pixels, linear light");
        [
            Bars {
                title: "Error of each unit".into(),
                axis: axis(),
                legend: legend(),
                rows: std::iter::once(("all".to_owned(), vec![self.all.mean_covered_error]))
                    .chain(self.units.iter().map(row))
                    .collect(),
                ..Bars::default()
            },
            Bars {
                title: format!("Error of each word, the greatest {SHOWN}"),
                axis: axis(),
                legend: legend(),
                rows: self.greatest().into_iter().map(row).collect(),
                ..Bars::default()
            },
        ]
    }
}

//! Sweep: many machines over one or many scenes, a row each; what they have in common is done once.
//!
//! ```text
//! plan ─► points ─┬─ scene A ─┬─ machine, formats alone ─► frame, work, ranges, errors ─┬─ timing ─► cycles, energy ─► row
//!                 │  ideal    │  golden, by its rules                                   └─ timing ─► …
//!                 └─ scene B  └─ …
//! ```
//! A point has a key: a digest of all that determines its row. A folder knows its rows by their keys, so that a sweep that was cut off
//! goes on, and that no row comes from anything else than the plan says.
//!
//! `plan.json` in the folder says what the rows are of.
//!
//! Laws (tests/sweep.rs): `a_row_says_what_a_run_says`, `a_sweep_that_is_killed_goes_on`, `parts_are_the_whole`.

pub mod charts;
mod page;
pub mod plan;
pub mod table;

use crate::accuracy::ranges::SignalReport;
use crate::accuracy::{distance, lockstep, metrics, partial};
use crate::error::{Error, Result};
use crate::golden::{self, Rules};
use crate::hardware::quantise::quantise;
use crate::hardware::{fixed, machines};
use crate::output::files::{open_folder, write_beside};
use crate::output::picture::Picture;
use crate::output::text::{thousands, wrapped};
use crate::performance::cost::{CostReport, Prices};
use crate::performance::cycles::CyclesReport;
use crate::run::report::MachineReport;
use crate::run::timed;
use crate::scene::Scene;
use crate::scene::digest::{digest, digest_of};
use indicatif::{ProgressBar, ProgressStyle};
use plan::{Change, Points};
use rayon::prelude::*;
use rtl_model::Machine;
use rtl_model::timing::{self, Detail};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use table::{Column, Journal, Kind, Row, Table, named};

/// Most points, if nobody asks for more.
pub const MOST_POINTS: u64 = 100_000;

/// What comes before the plan's own fields.
const POINT: [(&str, Kind); 4] = [("point", Kind::Whole), ("key", Kind::Text), ("scene", Kind::Text), ("changes", Kind::Text)];

/// What comes after them. Empty where the machine cannot be built, which `misfit` says; a PSNR also where pictures are equal.
const FOUND: [(&str, Kind); 30] = [
    ("misfit", Kind::Text),
    ("psnr_db", Kind::Number),
    ("psnr_covered_db", Kind::Number),
    ("ssim", Kind::Number),
    ("max_error", Kind::Number),
    ("mean_error", Kind::Number),
    ("pixels_over_1_255", Kind::Whole),
    ("golden_vs_ideal_psnr_db", Kind::Number),
    ("fixed_vs_ideal_psnr_db", Kind::Number),
    ("lockstep_psnr_db", Kind::Number),
    ("lockstep_max_error", Kind::Number),
    ("bound_violations", Kind::Whole),
    ("decision_flips", Kind::Whole),
    ("saturated", Kind::Whole),
    ("wrapped", Kind::Whole),
    ("contributions", Kind::Whole),
    ("merged", Kind::Whole),
    ("evicted", Kind::Whole),
    ("cycles", Kind::Whole),
    ("frames_per_second", Kind::Number),
    ("bottleneck", Kind::Text),
    ("memory_bytes", Kind::Whole),
    ("area", Kind::Number),
    ("multiplier_blocks_18", Kind::Whole),
    ("fifo_bits", Kind::Whole),
    ("memory_bits", Kind::Whole),
    ("frame_bits_per_pixel", Kind::Whole),
    ("fragment_bits", Kind::Whole),
    ("widest_operand_bits", Kind::Whole),
    ("energy_j", Kind::Number),
];

/// Units with an account of their cycles each, those of several side by side together; empty where a machine has none.
pub const UNITS: [&str; 11] = ["fetch", "project", "ellipse", "bin", "list", "raster", "gauss", "cache", "fragment", "shade", "resolve"];

/// What a unit does in a cycle.
pub const ACCOUNTS: [&str; 4] = ["busy", "starved", "blocked", "memory"];

/// Seconds on this computer: a point with all that was done for it, and a frame of each renderer.
const HOST: [&str; 4] = ["host_seconds", "host_fixed_seconds", "host_golden_seconds", "host_ideal_seconds"];

/// Part `index` of `of`, from 1 on: every `of`-th machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which.
    pub index: u64,
    /// Of how many.
    pub of: u64,
}

impl std::str::FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let numbers = text.split_once('/').and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
        let (index, of) = numbers.filter(|(index, of)| (1..=*of).contains(index)).ok_or("write I/N, as in 2/5, with I from 1 to N")?;
        Ok(Shard { index, of })
    }
}

/// How a plan is carried out.
#[derive(Clone, Copy, Debug)]
pub struct Asked {
    /// A part of it.
    pub shard: Option<Shard>,
    /// At most so many points.
    pub most: u64,
    /// What bits cost.
    pub prices: Prices,
    /// Show how far it is.
    pub progress: bool,
}

/// What became of a plan.
#[derive(Debug)]
pub struct Outcome {
    /// Points of the plan, of this part, and those that were drawn now.
    pub counts: [u64; 3],
    /// What was written.
    pub files: Vec<PathBuf>,
    table: Table,
}

/// A machine of the plan on a scene.
struct Point {
    number: u64,
    changes: Vec<Change>,
    machine: Machine,
    key: String,
}

/// Carries a plan out; what the folder has already is not done again.
///
/// # Errors
/// [`Error::Input`] where plan or folder are wrong, [`Error::Job`] where a row cannot be written.
pub fn run(points: &Points, folder: &Path, asked: &Asked) -> Result<Outcome> {
    let count = points.count();
    if count > asked.most {
        let sentence =
            format!("the plan has {} points, more than {}: --most {count} draws them all", thousands(count), thousands(asked.most));
        return Err(Error::input(sentence));
    }
    open_folder(folder)?;
    let fields = points.fields();
    let told = json!({"splatsim": env!("CARGO_PKG_VERSION"), "plan": points.plan, "machine": points.base, "prices": asked.prices});
    let own = fields.iter().map(|field| (field.clone(), Kind::Text));
    let columns: Vec<Column> = named(&POINT).into_iter().chain(own).chain(named(&FOUND)).chain(measured()).collect();
    let part = asked.shard.map_or(String::new(), |Shard { index, of }| format!("-{index}-of-{of}"));
    let mut journal = Journal::open(folder, &part, columns)?;
    let is_mine = |number: u64| asked.shard.is_none_or(|Shard { index, of }| number % of == index - 1);
    let mine = (0..count).filter(|number| is_mine(*number)).count() as u64;
    if let Some((last, _)) = journal.rows().filter_map(|row| Some((row[0].as_u64()?, row))).max_by_key(|(point, _)| *point)
        && last >= count
    {
        return Err(Error::input(format!("{} has point {last}, and the plan {count} points: it is of another plan", folder.display())));
    }
    write_plan(folder, &told)?;
    let bar = if asked.progress { ProgressBar::new(mine) } else { ProgressBar::hidden() };
    if let Ok(style) = ProgressStyle::with_template("{wide_bar} {pos}/{len} points, {eta} left") {
        bar.set_style(style);
    }
    let mut drawn = 0;
    for nth in 0..points.plan.scenes.len() {
        let on_scene: Vec<(u64, Vec<Change>)> = (0..count)
            .filter(|number| is_mine(*number))
            .filter_map(|number| {
                let (scene, changes) = points.point(number);
                (scene == nth).then_some((number, changes))
            })
            .collect();
        if on_scene.is_empty() {
            continue;
        }
        let mut stage = Stage::new(points, nth, asked)?;
        let mut groups: Vec<Vec<Point>> = Vec::new();
        let mut places = BTreeMap::new();
        for (number, changes) in on_scene {
            let point = stage.point(number, changes)?;
            if let Some(row) = journal.get(number) {
                if row[1].as_str() != Some(&point.key) {
                    let told = format!("{}: point {number} was drawn from something else than now", folder.display());
                    return Err(Error::input(format!("{told}: scene, machine, prices or splatsim have changed; choose another folder")));
                }
                bar.inc(1);
                continue;
            }
            let formats = Machine { timing: points.base.timing, ..point.machine.clone() };
            let formats = json!([formats, plan::exact_of(&point.changes)]).to_string();
            let place = *places.entry(formats).or_insert(groups.len());
            if place == groups.len() {
                groups.push(Vec::new());
            }
            groups[place].push(point);
        }
        for group in groups {
            for (number, row) in stage.rows(&group, &fields) {
                journal.push(number, row)?;
                drawn += 1;
                bar.inc(1);
            }
        }
    }
    bar.finish_and_clear();
    let files = journal.write(folder, "sweep")?;
    Ok(Outcome { counts: [count, mine, drawn], files, table: journal.table() })
}

/// The columns that come last.
fn measured() -> Vec<Column> {
    let accounts = UNITS.iter().flat_map(|unit| ACCOUNTS.map(|account| (format!("{unit}_{account}"), Kind::Whole)));
    accounts.chain(HOST.map(|name| (name.to_owned(), Kind::Number))).collect()
}

/// Says in a folder what its rows are of: of what machine, with `machine`.
///
/// # Errors
/// [`Error::Job`] where it cannot be written.
pub fn write_plan(folder: &Path, told: &Value) -> Result<()> {
    write_beside(&folder.join("plan.json"), |file| serde_json::to_writer_pretty(file, told).map_err(|e| e.to_string()))
}

/// What all points on a scene have in common.
struct Stage<'a> {
    points: &'a Points,
    asked: &'a Asked,
    scene: Scene,
    digest: String,
    ideal: Picture,
    ideal_seconds: f64,
    /// What golden makes by the rules that were needed last.
    goldens: Vec<Golden>,
}

/// What golden makes by some rules.
struct Golden {
    rules: Rules,
    picture: Picture,
    /// Against ideal.
    psnr_db: Option<f64>,
    seconds: f64,
}

/// Golden pictures that are kept.
const GOLDENS: usize = 16;

impl<'a> Stage<'a> {
    fn new(points: &'a Points, nth: usize, asked: &'a Asked) -> Result<Self> {
        let scene = points.scene(nth)?;
        let digest = digest_of(&scene);
        let (ideal, ideal_seconds) = timed(|| golden::ideal(&scene).picture);
        Ok(Stage { points, asked, scene, digest, ideal, ideal_seconds, goldens: Vec::new() })
    }

    fn point(&self, number: u64, changes: Vec<Change>) -> Result<Point> {
        let machine = plan::machine_of(&self.points.base, &changes, &format!("point {number}"))?;
        let prices = json!(self.asked.prices);
        let all = json!([
            env!("CARGO_PKG_VERSION"),
            self.digest,
            Machine { name: String::new(), ..machine.clone() },
            prices,
            self.points.plan.lockstep,
            plan::exact_of(&changes),
        ]);
        Ok(Point { number, changes, machine, key: digest(all.to_string().as_bytes()) })
    }

    fn golden(&mut self, rules: &Rules) -> &Golden {
        let known = self.goldens.iter().position(|golden| golden.rules == *rules);
        let at = known.unwrap_or_else(|| {
            let (picture, seconds) = timed(|| golden::render(&self.scene, rules).picture);
            let psnr_db = distance(&picture, &self.ideal).psnr_db;
            self.goldens.truncate(GOLDENS - 1);
            self.goldens.insert(0, Golden { rules: *rules, picture, psnr_db, seconds });
            0
        });
        &self.goldens[at]
    }

    /// The rows of points whose machines differ in timing alone.
    fn rows(&mut self, group: &[Point], fields: &[String]) -> Vec<(u64, Row)> {
        let exact = plan::exact_of(&group[0].changes);
        let (drawn, seconds) =
            timed(|| if exact.is_empty() { self.drawn(&group[0].machine) } else { self.mixed(&group[0].machine, &exact) });
        let base = machines::value(&self.points.base);
        let row = |point: &Point| {
            let (found, own_seconds) = timed(|| match &drawn {
                Ok(drawn) => drawn.on(&point.machine, &self.asked.prices),
                Err(sentence) => Err(sentence.clone()),
            });
            let found = found.unwrap_or_else(|sentence| Map::from_iter([("misfit".to_owned(), json!(sentence))]));
            let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            let changes: Vec<String> = point.changes.iter().map(|(field, value)| format!("{field}={}", text(value))).collect();
            let own = fields.iter().map(|field| {
                let changed = point.changes.iter().find(|(other, _)| other == field).map(|(_, value)| value);
                changed.or_else(|| base.pointer(&format!("/{}", field.replace('.', "/")))).map_or(Value::Null, |value| json!(text(value)))
            });
            let head = [json!(point.number), json!(point.key), json!(self.scene.name), json!(changes.join(" "))];
            let seconds = seconds / group.len() as f64 + own_seconds;
            let names = FOUND.iter().map(|(name, _)| (*name).to_owned()).chain(measured().into_iter().map(|(name, _)| name));
            let found = names.map(|name| match name.as_str() {
                "host_seconds" => json!(seconds),
                name => found.get(name).cloned().unwrap_or(Value::Null),
            });
            (point.number, head.into_iter().chain(own).chain(found).collect())
        };
        group.par_iter().map(row).collect()
    }

    /// What does not depend on timing; or why the machine cannot draw.
    fn drawn(&mut self, machine: &Machine) -> std::result::Result<Drawn, String> {
        let elaborated = fixed::elaborate(machine).map_err(|error| error.to_string())?;
        let quantised = quantise(&self.scene, machine).map_err(|error| error.to_string())?;
        let ((drawing, work), fixed_seconds) = timed(|| fixed::draw_recorded(&elaborated, &quantised));
        let (_, ranges) = fixed::draw_ranged(&elaborated, &quantised);
        let picture = fixed::picture(&elaborated, &drawing);
        let mut found = self.errors(&picture, machine)?;
        let signals = elaborated.signals.iter().zip(&ranges.0).map(|(signal, range)| SignalReport::new(signal, range));
        let (saturated, wrapped) = signals.fold((0, 0), |(saturated, wrapped), signal| {
            let over = if signal.is_declared_clamp() { 0 } else { signal.overflows() - signal.wrapped() };
            (saturated + over, wrapped + signal.wrapped())
        });
        let outcomes = drawing.outcomes;
        let own = [
            ("saturated", json!(saturated)),
            ("wrapped", json!(wrapped)),
            ("contributions", json!(outcomes.total())),
            ("merged", json!(outcomes.merged)),
            ("evicted", json!(outcomes.evicted)),
            ("host_fixed_seconds", json!(fixed_seconds)),
            ("host_ideal_seconds", json!(self.ideal_seconds)),
        ];
        found.extend(own.map(|(name, value)| (name.to_owned(), value)));
        if self.points.plan.lockstep {
            let lockstep = lockstep(&self.scene, &elaborated, &quantised).summary(&picture);
            let own = [
                ("lockstep_psnr_db", json!(lockstep.psnr_db)),
                ("lockstep_max_error", json!(lockstep.max_error)),
                ("bound_violations", json!(lockstep.bound_violations)),
                ("decision_flips", json!(lockstep.decision_flips)),
            ];
            found.extend(own.map(|(name, value)| (name.to_owned(), value)));
        }
        Ok(Drawn { found, work: Some(work) })
    }

    /// The same with some units or words in f64: errors alone, for no hardware does that.
    fn mixed(&mut self, machine: &Machine, exact: &[String]) -> std::result::Result<Drawn, String> {
        let elaborated = fixed::elaborate(machine).map_err(|error| error.to_string())?;
        let quantised = quantise(&self.scene, machine).map_err(|error| error.to_string())?;
        let is_exact = |word: &str| exact.iter().any(|name| machines::is_below(word, name));
        let choice = partial::Choice::new(&elaborated, |word| !is_exact(word));
        let stage = partial::Stage::new(&self.scene, &elaborated, &quantised);
        let picture = stage.fill(&choice, &stage.set_up(&choice));
        let found = self.errors(&picture, machine)?;
        Ok(Drawn { found, work: None })
    }

    /// How far a picture is off; a sentence where a pixel of any of them has no finite number.
    fn errors(&mut self, picture: &Picture, machine: &Machine) -> std::result::Result<Map<String, Value>, String> {
        let of_ideal = distance(picture, &self.ideal);
        let golden = self.golden(&fixed::rules(machine));
        let m = metrics(picture, &golden.picture);
        let not_finite = m.not_finite.max(of_ideal.not_finite);
        if not_finite > 0 {
            return Err(format!("{not_finite} pixels have no finite number, and cannot be compared"));
        }
        let found = json!({
            "psnr_db": m.psnr_db,
            "psnr_covered_db": m.psnr_covered_db,
            "ssim": m.ssim,
            "max_error": m.max_error,
            "mean_error": m.mean_error,
            "pixels_over_1_255": m.pixels_over_1_255,
            "golden_vs_ideal_psnr_db": golden.psnr_db,
            "fixed_vs_ideal_psnr_db": of_ideal.psnr_db,
            "host_golden_seconds": golden.seconds,
        });
        Ok(found.as_object().cloned().unwrap_or_default())
    }
}

/// A frame, all but its time.
struct Drawn {
    found: Map<String, Value>,
    /// None where it was drawn in f64.
    work: Option<rtl_model::work::Work>,
}

impl Drawn {
    /// With the time that it takes on a machine.
    fn on(&self, machine: &Machine, prices: &Prices) -> std::result::Result<Map<String, Value>, String> {
        let Some(work) = &self.work else { return Ok(self.found.clone()) };
        let elaborated = fixed::elaborate(machine).map_err(|error| error.to_string())?;
        let replayed = timing::replay(&elaborated.timing, work, Detail::Accounts);
        let cycles = CyclesReport::new(&elaborated.timing, work, &replayed);
        let CostReport { cost, energy } = CostReport::new(&elaborated, &replayed, prices);
        let described = MachineReport::new(&elaborated);
        let mut found = self.found.clone();
        let blocks: u64 = cost.units.iter().map(|unit| unit.bits.blocks_18).sum();
        for (name, value) in [
            ("cycles", json!(cycles.total)),
            ("frames_per_second", json!(cycles.frames_per_second)),
            ("bottleneck", json!(cycles.bottleneck)),
            ("memory_bytes", json!(cycles.memory.bytes)),
            ("area", json!(cost.area)),
            ("multiplier_blocks_18", json!(blocks)),
            ("fifo_bits", json!(cost.fifo_bits)),
            ("memory_bits", json!(cost.memory_bits)),
            ("frame_bits_per_pixel", json!(cost.frame_bits_per_pixel)),
            ("fragment_bits", json!(described.fragment_bits)),
            ("widest_operand_bits", json!(described.widest_operand_bits)),
            ("energy_j", json!(energy.total)),
        ] {
            found.insert(name.to_owned(), value);
        }
        for unit in UNITS.into_iter().filter(|unit| replayed.units.iter().any(|other| other.name == *unit)) {
            let of = |count: fn(&timing::Account) -> u64| {
                replayed.units.iter().filter(|other| other.name == unit).map(|other| count(&other.account)).sum::<u64>()
            };
            let counts = [of(|a| a.busy), of(|a| a.starved), of(|a| a.blocked), of(|a| a.memory)];
            for (account, count) in ACCOUNTS.iter().zip(counts) {
                found.insert(format!("{unit}_{account}"), json!(count));
            }
        }
        Ok(found)
    }
}

impl Outcome {
    /// What was done, and the best and the worst, at most 80 columns wide.
    pub fn summary(&self) -> String {
        let [count, mine, drawn] = self.counts;
        let rows = self.table.rows.len() as u64;
        let mut text = format!("{} points", thousands(count));
        if mine < count {
            let _ = write!(text, ", {} of this part", thousands(mine));
        }
        let _ = write!(text, ": {} drawn now, {} known before", thousands(drawn), thousands(mine - drawn));
        if rows < count {
            let _ = write!(text, "; the table has {} of them", thousands(rows));
        }
        let is_built = |row: &&Row| self.table.text(row, "misfit").is_empty();
        let misfits = self.table.rows.iter().filter(|row| !is_built(row)).count() as u64;
        if misfits > 0 {
            let _ = write!(text, "; {} cannot be built, the column `misfit` says why", thousands(misfits));
        }
        let mut text = wrapped(&text) + "\n";
        let mut built: Vec<&Row> = self.table.rows.iter().filter(is_built).collect();
        let number = |row: &Row, name: &str| self.table.number(row, name).unwrap_or(f64::INFINITY);
        let mut told = |what: &str, row: Option<&Row>| {
            let Some(row) = row else { return };
            let psnr = number(row, "psnr_covered_db");
            let psnr = if psnr.is_finite() { format!("{psnr:.1} dB") } else { "equal pictures".into() };
            let (rate, area) = (number(row, "frames_per_second"), thousands(number(row, "area") as u64));
            let changes = Some(self.table.text(row, "changes")).filter(|changes| !changes.is_empty()).unwrap_or("as it is");
            let scene = self.table.text(row, "scene");
            let _ = write!(text, "\n{what:<11} {psnr:>8}, {rate:>6.1} frames/s, area {area:>9}  {scene}");
            let _ = write!(text, "\n{}", wrapped(&format!("    {changes}")));
        };
        let mut by = |name: &'static str| {
            built.sort_by(|a, b| number(a, name).total_cmp(&number(b, name)));
            [built.first().copied(), built.last().copied()]
        };
        let ([worst, best], [least, _], [_, fastest]) = (by("psnr_covered_db"), by("area"), by("frames_per_second"));
        for (what, row) in [("worst", worst), ("best", best), ("least area", least), ("fastest", fastest)] {
            told(what, row);
        }
        text
    }
}

#[cfg(test)]
mod tests;

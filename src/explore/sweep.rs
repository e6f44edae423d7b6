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
pub mod columns;
mod loss;
mod page;
pub mod plan;
pub mod table;

use crate::accuracy::{distance, metrics, partial};
use crate::error::{Error, Result};
use crate::golden;
use crate::golden::Rules;
use crate::hardware::{fixed, machines};
use crate::output::files::{Folder, write_beside};
use crate::output::picture::Picture;
use crate::output::progress::Progress;
use crate::output::text::{thousands, wrapped};
use crate::performance::cost::{CostReport, Prices};
use crate::performance::cycles::CyclesReport;
use crate::run::evaluation::Evaluation;
use crate::run::report::MachineReport;
use crate::run::timed;
use crate::scene::Scene;
use crate::scene::digest::{digest, digest_of};
use columns::{Errors, Findings, Frame, Replay};
use plan::{Change, Points};
use rayon::prelude::*;
use rtl_model::Machine;
use rtl_model::timing::{self, Detail};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use table::{Journal, Row, Table};

/// Most points, if nobody asks for more.
pub const MOST_POINTS: u64 = 100_000;

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

/// Options of a sweep.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// A part of it.
    pub shard: Option<Shard>,
    /// At most so many points.
    pub most: u64,
    /// Prices of bits.
    pub prices: Prices,
    /// Show how far it is.
    pub progress: bool,
}

/// Outcome of a plan.
#[derive(Debug)]
pub struct Outcome {
    /// Points of the plan, of this part, and those that were drawn now.
    pub counts: [u64; 3],
    /// Files that were written.
    pub files: Vec<PathBuf>,
    table: Table,
    /// What loses a decibel first, if bits were taken away.
    loss: Option<String>,
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
pub fn run(points: &Points, folder: &Path, options: &Options) -> Result<Outcome> {
    let count = points.count();
    if count > options.most {
        let sentence =
            format!("the plan has {} points, more than {}: --most {count} draws them all", thousands(count), thousands(options.most));
        return Err(Error::input(sentence));
    }
    let mut scenes = Scenes::check(points)?;
    let _open = Folder::shared(folder)?;
    let fields = points.fields();
    let told = json!({"splatsim": env!("CARGO_PKG_VERSION"), "plan": points.plan, "machine": points.base, "prices": options.prices});
    let part = options.shard.map_or(String::new(), |Shard { index, of }| format!("-{index}-of-{of}"));
    let mut journal = Journal::open(folder, &part, columns::all(&fields))?;
    let is_mine = |number: u64| options.shard.is_none_or(|Shard { index, of }| number % of == index - 1);
    let mine = (0..count).filter(|number| is_mine(*number)).count() as u64;
    if let Some((last, _)) = journal.rows().filter_map(|row| Some((row[0].as_u64()?, row))).max_by_key(|(point, _)| *point)
        && last >= count
    {
        return Err(Error::input(format!("{} has point {last}, and the plan {count} points: it is of another plan", folder.display())));
    }
    let known: Vec<u64> = journal.rows().filter_map(|row| row[0].as_u64()).filter(|number| is_mine(*number)).collect();
    for number in &known {
        let (scene, changes) = points.point(*number);
        let point = Point::new(points, options, &scenes.heads[scene], *number, changes)?;
        if journal.get(*number).and_then(|row| row[1].as_str()) != Some(&point.key) {
            let told = format!("{}: point {number} was drawn from something else than now", folder.display());
            return Err(Error::input(format!("{told}: scene, machine, prices or splatsim have changed; choose another folder")));
        }
    }
    journal.keep();
    write_plan(folder, &told)?;
    let progress = Progress::of_steps(options.progress, mine - known.len() as u64, "points");
    let mut drawn = 0;
    for nth in 0..points.plan.scenes.len() {
        let on_scene: Vec<(u64, Vec<Change>)> = (0..count)
            .filter(|number| is_mine(*number) && journal.get(*number).is_none())
            .filter_map(|number| {
                let (scene, changes) = points.point(number);
                (scene == nth).then_some((number, changes))
            })
            .collect();
        if on_scene.is_empty() {
            continue;
        }
        let mut stage = Stage::new(points, scenes.take(nth)?, options);
        let mut groups: Vec<Vec<Point>> = Vec::new();
        let mut places = BTreeMap::new();
        for (number, changes) in on_scene {
            let point = Point::new(points, options, &stage.head, number, changes)?;
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
                progress.step();
            }
        }
    }
    drop(progress);
    let files = journal.write(folder, "sweep")?;
    let table = journal.table();
    Ok(Outcome { counts: [count, mine, drawn], files, loss: loss::first(&table, &points.base), table })
}

/// Scenes of a plan, each of which can be loaded.
struct Scenes<'a> {
    points: &'a Points,
    heads: Vec<Head>,
    /// The last one that was loaded, and which it is: most plans have one, which is loaded once.
    last: Option<(usize, Scene)>,
}

/// What a point is told of its scene.
#[derive(Clone)]
struct Head {
    digest: String,
    /// Whether a tree is walked, for which every machine pays.
    has_tree: bool,
}

impl<'a> Scenes<'a> {
    /// Loads every scene, before anything is written; they need not fit into memory together.
    fn check(points: &'a Points) -> Result<Self> {
        let mut scenes = Scenes { points, heads: Vec::new(), last: None };
        for nth in 0..points.plan.scenes.len() {
            scenes.last = None;
            let scene = points.scene(nth)?;
            scenes.heads.push(Head { digest: digest_of(&scene), has_tree: scene.detail.is_some() });
            scenes.last = Some((nth, scene));
        }
        Ok(scenes)
    }

    fn take(&mut self, nth: usize) -> Result<(Scene, Head)> {
        let scene = match self.last.take() {
            Some((last, scene)) if last == nth => scene,
            _ => self.points.scene(nth)?,
        };
        Ok((scene, self.heads[nth].clone()))
    }
}

impl Point {
    fn new(points: &Points, options: &Options, scene: &Head, number: u64, changes: Vec<Change>) -> Result<Self> {
        let mut machine = plan::machine_of(&points.base, &changes, &format!("point {number}"))?;
        machines::pay(&mut machine, scene.has_tree);
        let prices = json!(options.prices);
        let all = json!([
            env!("CARGO_PKG_VERSION"),
            scene.digest,
            Machine { name: String::new(), ..machine.clone() },
            prices,
            points.plan.lockstep,
            plan::exact_of(&changes),
        ]);
        Ok(Point { number, changes, machine, key: digest(all.to_string().as_bytes()) })
    }
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
    options: &'a Options,
    scene: Arc<Scene>,
    head: Head,
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
    fn new(points: &'a Points, (scene, head): (Scene, Head), options: &'a Options) -> Self {
        let (ideal, ideal_seconds) = timed(|| golden::ideal(&scene).picture);
        Stage { points, options, scene: Arc::new(scene), head, ideal, ideal_seconds, goldens: Vec::new() }
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
            timed(|| if exact.is_empty() { self.drawn(&group[0].machine) } else { self.partial(&group[0].machine, &exact) });
        let base = machines::value(&self.points.base);
        let row = |point: &Point| {
            let (found, own_seconds) = timed(|| match &drawn {
                Ok(drawn) => drawn.on(&point.machine, &self.options.prices),
                Err(sentence) => Err(sentence.clone()),
            });
            let mut found = found.unwrap_or_else(|sentence| Findings { misfit: Some(sentence), ..Findings::default() });
            found.host_seconds = seconds / group.len() as f64 + own_seconds;
            let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            let changes: Vec<String> = point.changes.iter().map(|(field, value)| format!("{field}={}", text(value))).collect();
            let own = fields.iter().map(|field| {
                let changed = point.changes.iter().find(|(other, _)| other == field).map(|(_, value)| value);
                changed.or_else(|| base.pointer(&format!("/{}", field.replace('.', "/")))).map_or(Value::Null, |value| json!(text(value)))
            });
            let head = [json!(point.number), json!(point.key), json!(self.scene.name), json!(changes.join(" "))];
            (point.number, head.into_iter().chain(own).chain(columns::cells(&found)).collect())
        };
        group.par_iter().map(row).collect()
    }

    /// All that does not depend on timing; or why the machine cannot draw.
    fn drawn(&mut self, machine: &Machine) -> std::result::Result<Drawn, String> {
        let scene = Arc::clone(&self.scene);
        let evaluation = Evaluation::new(&scene, machine).map_err(|error| error.to_string())?;
        let (observed, fixed_seconds) = timed(|| evaluation.observe());
        let frame = Frame {
            overflows: observed.overflows(),
            outcomes: observed.drawing.outcomes,
            fixed_seconds,
            ideal_seconds: self.ideal_seconds,
        };
        let lockstep = self.points.plan.lockstep.then(|| evaluation.lockstep().summary(&observed.picture));
        let errors = Some(self.errors(&observed.picture, &evaluation.rules())?);
        Ok(Drawn { found: Findings { errors, frame: Some(frame), lockstep, ..Findings::default() }, work: Some(observed.work) })
    }

    /// The same in partial precision, some units or words in f64: errors alone, for no hardware does that.
    fn partial(&mut self, machine: &Machine, exact: &[String]) -> std::result::Result<Drawn, String> {
        let scene = Arc::clone(&self.scene);
        let evaluation = Evaluation::new(&scene, machine).map_err(|error| error.to_string())?;
        let is_exact = |word: &str| exact.iter().any(|name| machines::is_below(word, name));
        let choice = partial::Choice::new(&evaluation.machine, |word| !is_exact(word));
        let stage = partial::Stage::new(&scene, &evaluation.machine, &evaluation.quantised);
        let picture = stage.fill(&choice, &stage.set_up(&choice));
        let errors = Some(self.errors(&picture, &evaluation.rules())?);
        Ok(Drawn { found: Findings { errors, ..Findings::default() }, work: None })
    }

    /// How far a picture is off; a sentence where a pixel of any of them has no finite number.
    fn errors(&mut self, picture: &Picture, rules: &Rules) -> std::result::Result<Errors, String> {
        let of_ideal = distance(picture, &self.ideal);
        let golden = self.golden(rules);
        let fixed_vs_golden = metrics(picture, &golden.picture);
        let not_finite = fixed_vs_golden.not_finite.max(of_ideal.not_finite);
        if not_finite > 0 {
            return Err(format!("{not_finite} pixels have no finite number, and cannot be compared"));
        }
        Ok(Errors {
            fixed_vs_golden,
            golden_vs_ideal_psnr_db: golden.psnr_db,
            fixed_vs_ideal_psnr_db: of_ideal.psnr_db,
            golden_seconds: golden.seconds,
        })
    }
}

/// A frame, all but its time.
struct Drawn {
    found: Findings,
    /// None where it was drawn in partial precision.
    work: Option<rtl_model::work::Work>,
}

impl Drawn {
    /// With the time that it takes on a machine.
    fn on(&self, machine: &Machine, prices: &Prices) -> std::result::Result<Findings, String> {
        let Some(work) = &self.work else { return Ok(self.found.clone()) };
        let elaborated = fixed::elaborate(machine).map_err(|error| error.to_string())?;
        let units = timing::replay(&elaborated.timing, work, Detail::Accounts);
        let replay = Replay {
            cycles: CyclesReport::new(&elaborated.timing, work, &units),
            cost: CostReport::new(&elaborated, &units, prices),
            machine: MachineReport::new(&elaborated),
            units,
        };
        Ok(Findings { replay: Some(replay), ..self.found.clone() })
    }
}

impl Outcome {
    /// Summary: the points that were drawn, the best and the worst, at most 80 columns wide.
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
        let is_built = |row: &&Row| self.table.text(row, columns::MISFIT).is_empty();
        let misfits = self.table.rows.iter().filter(|row| !is_built(row)).count() as u64;
        if misfits > 0 {
            let _ = write!(text, "; {} cannot be built, the column `misfit` says why", thousands(misfits));
        }
        let mut text = wrapped(&text) + "\n";
        let mut built: Vec<&Row> = self.table.rows.iter().filter(is_built).collect();
        let number = |row: &Row, name: &str| self.table.number(row, name).unwrap_or(f64::INFINITY);
        if !built.is_empty() {
            let heads = ["fixed − ideal", "fixed − golden", "on covered", "frames/s"].join("  ");
            let _ = write!(text, "\n{:10} {heads}  {:>9}", "dB", "area");
        }
        let mut told = |what: &str, row: Option<&Row>| {
            let Some(row) = row else { return };
            let db = |name: &str| Some(number(row, name)).filter(|db| db.is_finite()).map_or("equal".into(), |db| format!("{db:.1}"));
            let [whole, arithmetic, covered] = [columns::FIXED_VS_IDEAL_PSNR_DB, columns::PSNR_DB, columns::PSNR_COVERED_DB].map(db);
            let (rate, area) = (number(row, columns::FRAMES_PER_SECOND), thousands(number(row, columns::AREA) as u64));
            let changes = Some(self.table.text(row, columns::CHANGES)).filter(|changes| !changes.is_empty()).unwrap_or("as it is");
            let scene = self.table.text(row, columns::SCENE);
            let errors = format!("{whole:>13}  {arithmetic:>14}  {covered:>10}");
            let _ = write!(text, "\n{what:<10} {errors}  {rate:>8.1}  {area:>9}");
            let _ = write!(text, "\n{}", wrapped(&format!("    {scene}: {changes}")));
        };
        let mut by = |name: &'static str| {
            built.sort_by(|a, b| number(a, name).total_cmp(&number(b, name)));
            [built.first().copied(), built.last().copied()]
        };
        let ([worst, best], [least, _], [_, fastest]) =
            (by(columns::FIXED_VS_IDEAL_PSNR_DB), by(columns::AREA), by(columns::FRAMES_PER_SECOND));
        for (what, row) in [("worst", worst), ("best", best), ("least area", least), ("fastest", fastest)] {
            told(what, row);
        }
        if let Some(loss) = &self.loss {
            let _ = write!(text, "\n\n{}", wrapped(loss));
        }
        text
    }
}

#[cfg(test)]
mod tests;

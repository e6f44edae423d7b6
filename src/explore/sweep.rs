//! Sweep: runs many machines on one or many scenes, one row each; common work is done once.
//!
//! ```text
//! plan ─► points ─┬─ scene A ─► stage ─► rows ─┬─► journal ─► sweep.csv, sweep.parquet
//!                 └─ scene B ─► …              │
//!                    other processes ─► batch ─┘
//! ```
//! Each point has a key: a digest of everything that determines its row. Rows in a folder are
//! identified by their keys. A sweep that was stopped can thus be resumed, and a row from another
//! plan is refused.
//!
//! `plan.json` in the folder describes the rows.
//!
//! Laws (tests/sweep.rs): `a_row_says_what_a_run_says`, `a_sweep_that_is_killed_goes_on`,
//! `parts_are_the_whole`.

pub mod charts;
pub mod columns;
mod loss;
mod page;
pub mod plan;
pub mod stage;
pub mod table;

use crate::error::{Error, Result};
use crate::output::files::{Folder, write_beside};
use crate::output::progress::Progress;
use crate::output::text::{thousands, wrapped};
use crate::performance::cost::Prices;
use crate::performance::given;
use crate::scene::Scene;
use plan::{PlanScreen, Points};
use rayon::prelude::*;
use serde_json::{Value, json};
use stage::{Head, Point, Stage};
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use table::{Journal, Row, Table};

/// Most rows of other shards whose keys are checked: there may be a million.
const MOST_CHECKED_OF_OTHERS: usize = 1000;

/// Most points by default.
pub const MOST_POINTS: u64 = 100_000;

/// Part `index` of `of`, counted from 1: every `of`-th machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Index of the part.
    pub index: u64,
    /// Number of parts.
    pub of: u64,
}

impl std::str::FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let numbers = text
            .split_once('/')
            .and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
        let (index, of) = numbers
            .filter(|(index, of)| (1..=*of).contains(index))
            .ok_or("write I/N, as in 2/5, with I from 1 to N")?;
        Ok(Shard { index, of })
    }
}

/// Options of a sweep.
#[derive(Clone, Copy, Debug)]
pub struct SweepOptions {
    /// A part of the plan.
    pub shard: Option<Shard>,
    /// Most points.
    pub most: u64,
    /// Prices of bits.
    pub prices: Prices,
    /// Show progress.
    pub progress: bool,
}

/// Result of a sweep.
#[derive(Debug)]
pub struct SweepOutcome {
    /// Number of points of the plan, of this part, and of those drawn now.
    pub counts: [u64; 3],
    /// Files that were written.
    pub files: Vec<PathBuf>,
    table: Table,
    /// PSNR below which machines are not drawn.
    screen: Option<PlanScreen>,
    /// Name of the base machine.
    machine: String,
    /// The word that loses a decibel first, if the plan reduces bits.
    loss: Option<String>,
}

/// Runs a plan; rows that the folder has are not drawn again.
///
/// # Errors
/// [`Error::Input`] if plan or folder are wrong, [`Error::Job`] if a row cannot be written.
pub fn run(points: &Points, folder: &Path, options: &SweepOptions) -> Result<SweepOutcome> {
    let mut sweep = Sweep::open(points.clone(), folder, options, Folder::shared)?;
    for nth in 0..points.plan.scenes.len() {
        let missing = sweep.missing(nth);
        if !missing.is_empty() {
            let stage = Stage::new(points, &options.prices, nth, sweep.scene(nth)?);
            stage.draw(&missing, |number, row| sweep.push(number, row))?;
        }
    }
    sweep.finish()
}

/// A plan that is run into a folder, in this process or in others: existing rows and missing
/// points.
pub struct Sweep {
    points: Points,
    options: SweepOptions,
    scenes: Scenes,
    folder: PathBuf,
    /// Keeps the folder locked.
    _open: Folder,
    journal: Journal,
    progress: Progress,
    drawn: u64,
}

impl Sweep {
    /// Opens a folder, by [`Folder::shared`] if other processes draw parts of the same plan into
    /// it, and checks its rows against the plan.
    ///
    /// # Errors
    /// [`Error::Input`] if plan or folder are wrong, [`Error::Job`] if the folder cannot be
    /// written.
    pub fn open(
        points: Points,
        folder: &Path,
        options: &SweepOptions,
        lock: fn(&Path) -> Result<Folder>,
    ) -> Result<Self> {
        let count = points.count();
        if count > options.most {
            let sentence = format!(
                "the plan has {} points, more than {}: --most {count} draws them all",
                thousands(count),
                thousands(options.most)
            );
            return Err(Error::input(sentence));
        }
        let scenes = Scenes::check(&points)?;
        let open = lock(folder)?;
        let part = options.shard.map_or(String::new(), |Shard { index, of }| {
            format!("-{index}-of-{of}")
        });
        let mut journal = Journal::open(folder, &part, columns::all(&points))?;
        check_keys(&points, &scenes.heads, &journal, folder, options)?;
        journal.keep();
        let description = json!({"splatsim": env!("CARGO_PKG_VERSION"), "plan": points.plan, "machine": points.base, "prices": options.prices});
        write_plan(folder, &description)?;
        let left = options
            .mine(count)
            .filter(|number| journal.get(*number).is_none())
            .count() as u64;
        let progress = Progress::of_steps(options.progress, left, "points");
        Ok(Sweep {
            points,
            options: *options,
            scenes,
            folder: folder.to_owned(),
            _open: open,
            journal,
            progress,
            drawn: 0,
        })
    }

    /// The plan.
    pub fn points(&self) -> &Points {
        &self.points
    }

    /// Prices of bits.
    pub fn prices(&self) -> Prices {
        self.options.prices
    }

    /// Points of this part on scene `nth` that the folder does not have.
    pub fn missing(&self, nth: usize) -> Vec<u64> {
        self.options
            .mine(self.points.count())
            .filter(|number| {
                self.points.point(*number).0 == nth && self.journal.get(*number).is_none()
            })
            .collect()
    }

    /// Scene `nth`.
    ///
    /// # Errors
    /// [`Error::Input`] if it can no longer be read.
    pub fn scene(&mut self, nth: usize) -> Result<Scene> {
        self.scenes.take(&self.points, nth)
    }

    /// Adds a row, and writes it before returning.
    ///
    /// # Errors
    /// [`Error::Job`] if it cannot be written, or the sweep was cancelled.
    pub fn push(&mut self, number: u64, row: Row) -> Result<()> {
        self.journal.push(number, row)?;
        self.drawn += 1;
        self.progress.step();
        Ok(())
    }

    /// Adds rows from another process, as [`table::packed`] returns them, and writes them as a
    /// separate file before returning.
    ///
    /// # Errors
    /// [`Error::Job`] if they are not those of `numbers`, exist already, or cannot be written.
    pub fn push_batch(&mut self, numbers: &[u64], batch: &[u8]) -> Result<()> {
        self.journal.push_batch(&self.folder, numbers, batch)?;
        self.drawn += numbers.len() as u64;
        numbers.iter().for_each(|_| self.progress.step());
        Ok(())
    }

    /// Writes the table of all existing rows.
    ///
    /// # Errors
    /// [`Error::Job`] if it cannot be written.
    pub fn finish(mut self) -> Result<SweepOutcome> {
        drop(self.progress);
        // Other processes may draw their parts at the same time. The last one to finish reads all
        // rows; until then an existing table is not changed.
        let is_last = self.journal.ends(&self.folder)?;
        if is_last {
            self.journal.read_others(&self.folder)?;
            check_keys(
                &self.points,
                &self.scenes.heads,
                &self.journal,
                &self.folder,
                &self.options,
            )?;
        }
        let is_there = self.folder.join("sweep.csv").exists();
        let files = if is_last || !is_there {
            self.journal.write(&self.folder, "sweep")?
        } else {
            Vec::new()
        };
        let count = self.points.count();
        let mine = self.options.mine(count).count() as u64;
        let table = self.journal.table();
        Ok(SweepOutcome {
            counts: [count, mine, self.drawn],
            files,
            loss: loss::first(&table, &self.points.base),
            screen: self.points.plan.screen,
            machine: self.points.base.name,
            table,
        })
    }
}

/// Refuses a folder whose rows are of another plan: checks all rows of this part, and some of other
/// parts.
fn check_keys(
    points: &Points,
    scenes: &[Head],
    journal: &Journal,
    folder: &Path,
    options: &SweepOptions,
) -> Result<()> {
    if let Some(last) = journal
        .points()
        .next_back()
        .filter(|last| *last >= points.count())
    {
        let message = format!(
            "{} has point {last}, and the plan {} points: it is of another plan; choose another folder (--out)",
            folder.display(),
            points.count()
        );
        return Err(Error::input(message));
    }
    let mine: BTreeSet<u64> = options.mine(points.count()).collect();
    let (mut known, others): (Vec<u64>, Vec<u64>) =
        journal.points().partition(|number| mine.contains(number));
    known.extend(
        others
            .iter()
            .step_by(others.len() / MOST_CHECKED_OF_OTHERS + 1),
    );
    let check = |number: &u64| {
        let point = Point::new(
            points,
            &options.prices,
            &scenes[points.point(*number).0],
            *number,
        )?;
        if journal.get(*number).and_then(|row| row[1].as_str()) == Some(&point.key) {
            return Ok(());
        }
        let message = format!(
            "{}: point {number} was drawn from something else than now",
            folder.display()
        );
        Err(Error::input(format!(
            "{message}: scene, machine, prices or splatsim have changed; choose another folder (--out)"
        )))
    };
    // Of the refused rows the first, independent of thread timing.
    known
        .par_iter()
        .map(check)
        .find_first(Result::is_err)
        .unwrap_or(Ok(()))
}

impl SweepOptions {
    /// Numbers of this part's points.
    fn mine(&self, count: u64) -> impl Iterator<Item = u64> + use<> {
        let shard = self.shard;
        (0..count)
            .filter(move |number| shard.is_none_or(|Shard { index, of }| number % of == index - 1))
    }
}

/// Scenes of a plan; all of them were loaded once.
struct Scenes {
    heads: Vec<Head>,
    /// The last loaded scene and its index: most plans have only one.
    last: Option<(usize, Scene)>,
}

impl Scenes {
    /// Loads every scene before anything is written. They need not fit into memory together.
    fn check(points: &Points) -> Result<Self> {
        let mut scenes = Scenes {
            heads: Vec::new(),
            last: None,
        };
        for nth in 0..points.plan.scenes.len() {
            scenes.last = None;
            let scene = points.scene(nth)?;
            scenes.heads.push(Head::of(&scene));
            scenes.last = Some((nth, scene));
        }
        Ok(scenes)
    }

    fn take(&mut self, points: &Points, nth: usize) -> Result<Scene> {
        match self.last.take() {
            Some((last, scene)) if last == nth => Ok(scene),
            _ => points.scene(nth),
        }
    }
}

/// Writes what the rows of a folder are of; `machine` is their base machine.
///
/// # Errors
/// [`Error::Job`] if it cannot be written.
pub fn write_plan(folder: &Path, description: &Value) -> Result<()> {
    write_beside(&folder.join("plan.json"), |file| {
        serde_json::to_writer_pretty(file, description).map_err(|e| e.to_string())
    })
}

impl SweepOutcome {
    /// Checks that at least one point was drawn, if all rows of the plan exist.
    ///
    /// # Errors
    /// [`Error::Job`] with the first reason.
    pub fn check(&self) -> Result<()> {
        let is_whole = self.table.rows.len() as u64 == self.counts[0];
        match self.table.first_misfit() {
            Some(reason) if is_whole && !self.table.has_drawn() => Err(Error::job(format!(
                "no point was drawn (the plan's machine is {}): {reason}",
                self.machine
            ))),
            _ => Ok(()),
        }
    }

    /// Number of points, the best and the worst; at most 80 columns wide.
    pub fn summary(&self) -> String {
        let [count, mine, drawn] = self.counts;
        let rows = self.table.rows.len() as u64;
        let mut text = format!("{} points", thousands(count));
        if mine < count {
            let _ = write!(text, ", {} of this part", thousands(mine));
        }
        let _ = write!(
            text,
            ": {} drawn now, {} known before",
            thousands(drawn),
            thousands(mine - drawn)
        );
        if rows < count {
            let _ = write!(text, "; the table has {} of them", thousands(rows));
        }
        let count_of = |has_it: fn(&Table, &Row) -> bool| {
            self.table
                .rows
                .iter()
                .filter(|row| has_it(&self.table, row))
                .count() as u64
        };
        let unbuildable = count_of(|table, row| !table.text(row, columns::MISFIT).is_empty());
        let screened = count_of(|table, row| table.number(row, columns::SAMPLED_TILES).is_some());
        if let Some(PlanScreen { psnr_db, against }) = self.screen {
            let _ = write!(
                text,
                "; surely below {psnr_db} dB ({}), so that only a sample of tiles was drawn: {}",
                against.difference(),
                thousands(screened)
            );
        }
        if unbuildable > 0 {
            let _ = write!(
                text,
                "; {} cannot be built, the column `misfit` has the reasons",
                thousands(unbuildable)
            );
        }
        let mut text = wrapped(&text) + "\n";
        if let Some(reason) = self.table.first_misfit().filter(|_| unbuildable < rows) {
            let _ = writeln!(text, "{}", wrapped(&format!("the first reason: {reason}")));
        }
        let mut built: Vec<&Row> = (self.table.rows.iter())
            .filter(|row| self.table.is_drawn(row))
            .collect();
        let number = |row: &Row, name: &str| self.table.number(row, name).unwrap_or(f64::INFINITY);
        if !built.is_empty() {
            let heads = ["fixed − ideal", "fixed − golden", "on covered", "frames/s"].join("  ");
            let _ = write!(text, "\n{:10} {heads}  {:>9}", "dB", "area");
        }
        let mut add_row = |what: &str, row: Option<&Row>| {
            let Some(row) = row else { return };
            let db = |name: &str| {
                Some(number(row, name))
                    .filter(|db| db.is_finite())
                    .map_or("equal".into(), |db| format!("{db:.1}"))
            };
            let [whole, arithmetic, covered] = [
                columns::FIXED_VS_IDEAL_PSNR_DB,
                columns::PSNR_DB,
                columns::PSNR_COVERED_DB,
            ]
            .map(db);
            // Mixed precision is not a machine, and has neither.
            let rate = self
                .table
                .number(row, columns::FRAMES_PER_SECOND)
                .map_or("–".into(), |rate| format!("{rate:.1}"));
            let area = self
                .table
                .number(row, columns::AREA)
                .map_or("–".into(), |area| thousands(area as u64));
            let changes = Some(self.table.text(row, columns::CHANGES))
                .filter(|changes| !changes.is_empty())
                .unwrap_or("as it is");
            let scene = self.table.text(row, columns::SCENE);
            let errors = format!("{whole:>13}  {arithmetic:>14}  {covered:>10}");
            let _ = write!(text, "\n{what:<10} {errors}  {rate:>8}  {area:>9}");
            let _ = write!(text, "\n{}", wrapped(&format!("    {scene}: {changes}")));
        };
        let mut by = |name: &'static str| {
            built.sort_by(|a, b| number(a, name).total_cmp(&number(b, name)));
            let has_it = |row: &&Row| {
                name == columns::FIXED_VS_IDEAL_PSNR_DB || self.table.number(row, name).is_some()
            };
            let mut ranked = built.iter().copied().filter(has_it);
            let first = ranked.next();
            [first, ranked.next_back().or(first)]
        };
        let ([worst, best], [least, _], [_, fastest]) = (
            by(columns::FIXED_VS_IDEAL_PSNR_DB),
            by(columns::AREA),
            by(columns::FRAMES_PER_SECOND),
        );
        for (what, row) in [
            ("worst", worst),
            ("best", best),
            ("least area", least),
            ("fastest", fastest),
        ] {
            add_row(what, row);
        }
        if let Some(note) = given::note(self.table.columns.iter().map(|(name, _)| name.as_str())) {
            let _ = write!(text, "\n{}", wrapped(&note));
        }
        if let Some(loss) = &self.loss {
            let _ = write!(text, "\n\n{}", wrapped(loss));
        }
        text
    }
}

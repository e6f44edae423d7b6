//! Search: finds the cheapest machine that meets a target on scenes, and verifies it on cameras
//! that were not searched.
//!
//! ```text
//! scenes ─► ranges ─► integer bits cut ─► fraction bits, tables ─( min+1, max−1, annealing )─► machine ─► unseen views
//!             ▲                                                                                              │ one fails
//!             └──────────────────────────── that view is added to the search ◄───────────────────────────────┘
//! ```
//! Each drawn machine is a row of a journal, as in `sweep`: an interrupted search is resumed, and
//! `chart` draws its machines. The result depends only on the inputs and the seed.
//!
//! Laws (tests/search.rs): `a_machine_is_found_that_meets_the_target_elsewhere_too`,
//! `it_is_close_to_the_best_of_all`, `a_search_that_is_killed_goes_on`.

mod claims;
pub mod crew;
mod descent;
mod domain;
mod knobs;
pub mod over_fragment;
pub mod over_timing;

use crate::accuracy::distance;
use crate::error::{Error, Result};
use crate::explore::sweep::columns;
use crate::explore::sweep::table::{CellKind, Column, Journal, Row, named};
use crate::explore::sweep::write_plan;
use crate::golden;
use crate::hardware::quantise::quantise;
pub use crate::hardware::searched::{Against, Metric, Target};
use crate::hardware::searched::{SceneRecord, SearchRecord};
use crate::hardware::{fixed, machines};
use crate::output::files::{Folder, write_beside};
use crate::output::picture::Picture;
use crate::output::progress::Progress;
use crate::output::text::{aligned, plain_table, thousands, wrapped};
use crate::performance::cost::{Cost, Prices};
use crate::run::evaluation::Evaluation;
use crate::scene::digest::{digest, digest_of};
use crate::scene::{Camera, Scene};
pub use claims::Claim;
use claims::Decided;
use crew::{Measurement, Prefetch};
use descent::{Problem, Settled};
pub use domain::{Domain, Member};
use knobs::{Knob, KnobPart};
use rtl_model::Machine;
use rtl_model::num::Format;
use rtl_model::pipeline::Elaborated;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::borrow::Cow;
use std::cmp::Ordering;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Options of a search over words.
#[derive(Clone, Debug)]
pub struct SearchOptions {
    /// Target.
    pub target: Target,
    /// Number of unseen cameras on which the target must hold too.
    pub views: usize,
    /// Each view counts as the worst of N cameras less than a pixel apart, because single flips are
    /// random.
    pub robust: usize,
    /// Seed of annealing.
    pub seed: u64,
    /// Number of machines drawn by annealing.
    pub tries: u64,
    /// Only these units, words or sizes; all if empty.
    pub only: Vec<String>,
    /// Prices of bits.
    pub prices: Prices,
    /// Show progress.
    pub progress: bool,
}

/// Most rounds; each adds one view.
const ROUNDS: usize = 12;
/// Extra cameras per scene for ranges: a word that overflows on one camera corrupts the whole
/// picture.
const RANGE_VIEWS: usize = 16;
/// Index of the first of them, far above those of unseen views.
const FIRST_RANGE_VIEW: usize = 1_000_000;
/// The first views that fail are only added to the search. Later ones raise the aim too.
const PATIENCE: usize = 3;
/// Most by which a failing view raises the aim, as a factor on the squared error: 3 dB.
const MOST_STRICTER: f64 = 2.0;

const COLUMNS: [(&str, CellKind); 14] = [
    ("point", CellKind::Whole),
    ("key", CellKind::Text),
    ("scene", CellKind::Text),
    ("changes", CellKind::Text),
    ("method", CellKind::Text),
    ("misfit", CellKind::Text),
    ("psnr_db", CellKind::Number),
    ("max_error", CellKind::Number),
    ("golden_vs_ideal_psnr_db", CellKind::Number),
    ("fixed_vs_ideal_psnr_db", CellKind::Number),
    ("fixed_vs_ideal_max_error", CellKind::Number),
    ("saturated", CellKind::Whole),
    ("area", CellKind::Number),
    ("host_seconds", CellKind::Number),
];

/// Additional columns of a search in lockstep.
const LOCKSTEP_COLUMNS: [(&str, CellKind); 2] = [
    (columns::LOCKSTEP_PSNR_DB, CellKind::Number),
    (columns::LOCKSTEP_MAX_ERROR, CellKind::Number),
];

fn columns_of(target: &Target) -> Vec<Column> {
    let more: &[_] = if target.metric == Metric::Lockstep {
        &LOCKSTEP_COLUMNS
    } else {
        &[]
    };
    named(&[&COLUMNS, more].concat())
}

/// A scene from one camera.
#[derive(Serialize, Deserialize)]
struct View {
    /// Index of the domain.
    of: usize,
    name: String,
    scene: Scene,
    golden: Picture,
    ideal: Picture,
    /// Error of the method, which does not depend on words.
    golden_vs_ideal_psnr_db: Option<f64>,
    digest: String,
}

impl View {
    fn new(of: usize, Member { name, scene }: Member, machine: &Machine) -> Self {
        let golden = golden::render(&scene, &fixed::rules(machine)).picture;
        let ideal = golden::ideal(&scene).picture;
        let golden_vs_ideal_psnr_db = distance(&golden, &ideal).psnr_db;
        View {
            of,
            name,
            digest: digest_of(&scene),
            scene,
            golden,
            ideal,
            golden_vs_ideal_psnr_db,
        }
    }

    /// The name without the scene.
    fn short_name(&self) -> &str {
        self.name.rsplit(" from ").next().unwrap_or_default()
    }
}

/// Errors of a machine: the worst over the views.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SearchErrors {
    /// Least PSNR, fixed − golden; null if the pictures are equal.
    pub psnr_db: Option<f64>,
    /// Greatest error, fixed − golden.
    pub max_error: f64,
    /// Least PSNR, fixed − ideal; null if the pictures are equal.
    pub fixed_vs_ideal_psnr_db: Option<f64>,
    /// Greatest error, fixed − ideal.
    pub fixed_vs_ideal_max_error: f64,
    /// Number of words that left their range; null if not counted.
    pub saturated: Option<u64>,
    /// Error in lockstep, against golden with every decision forced to the machine's; null if not
    /// measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lockstep: Option<InLockstep>,
}

/// Error from rounding only, without flips.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct InLockstep {
    /// Least PSNR; null if the pictures are equal.
    pub psnr_db: Option<f64>,
    /// Greatest error.
    pub max_error: f64,
}

impl InLockstep {
    fn and(self, other: InLockstep) -> InLockstep {
        InLockstep {
            psnr_db: least(self.psnr_db, other.psnr_db),
            max_error: self.max_error.max(other.max_error),
        }
    }
}

impl SearchErrors {
    fn and(self, other: SearchErrors) -> SearchErrors {
        SearchErrors {
            fixed_vs_ideal_psnr_db: least(
                self.fixed_vs_ideal_psnr_db,
                other.fixed_vs_ideal_psnr_db,
            ),
            fixed_vs_ideal_max_error: self
                .fixed_vs_ideal_max_error
                .max(other.fixed_vs_ideal_max_error),
            psnr_db: least(self.psnr_db, other.psnr_db),
            max_error: self.max_error.max(other.max_error),
            saturated: self.saturated.zip(other.saturated).map(|(a, b)| a + b),
            lockstep: self.lockstep.zip(other.lockstep).map(|(a, b)| a.and(b)),
        }
    }

    /// PSNR by the metric of the target; None if the pictures are equal.
    fn psnr_db_of(&self, target: &Target) -> Option<f64> {
        match (target.metric, target.against) {
            (Metric::Lockstep, _) => self
                .lockstep
                .map_or(Some(f64::NEG_INFINITY), |lockstep| lockstep.psnr_db),
            (Metric::Psnr, Against::Golden) => self.psnr_db,
            (Metric::Psnr, Against::Ideal) => self.fixed_vs_ideal_psnr_db,
        }
    }

    fn max_error_of(&self, target: &Target) -> f64 {
        match (target.metric, target.against) {
            (Metric::Lockstep, _) => self
                .lockstep
                .map_or(f64::INFINITY, |lockstep| lockstep.max_error),
            (Metric::Psnr, Against::Golden) => self.max_error,
            (Metric::Psnr, Against::Ideal) => self.fixed_vs_ideal_max_error,
        }
    }
}

fn decibels(psnr_db: Option<f64>) -> String {
    match psnr_db {
        None => "equal".into(),
        Some(db) if db.is_finite() => format!("{db:.1}"),
        Some(_) => "no".into(),
    }
}

/// The lower of two PSNRs; None stands for equal pictures.
fn least(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
    }
}

/// Error of the method on the worst view.
fn method_psnr_db(views: &[View]) -> Option<f64> {
    views
        .iter()
        .map(|view| view.golden_vs_ideal_psnr_db)
        .fold(None, least)
}

/// Errors of a machine over some views.
fn found_on<'v>(
    views: impl IntoIterator<Item = &'v View>,
    drawn: impl Fn(&View) -> Result<SearchErrors>,
) -> Result<SearchErrors> {
    Ok(worst_of(
        &views
            .into_iter()
            .map(drawn)
            .collect::<Result<Vec<SearchErrors>>>()?,
    ))
}

/// The worst of each figure.
fn worst_of(found: &[SearchErrors]) -> SearchErrors {
    found
        .iter()
        .copied()
        .reduce(SearchErrors::and)
        .unwrap_or_default()
}

impl Target {
    /// Returns an error that states by how much the unchanged machine misses the target.
    fn check_reach(
        &self,
        found: &SearchErrors,
        views: &[View],
        machine: &str,
    ) -> std::result::Result<(), String> {
        if self.load(found) <= 1.0 {
            return Ok(());
        }
        let names = views
            .iter()
            .map(|view| view.name.as_str())
            .collect::<Vec<_>>()
            .join(", ");
        let lost = found
            .saturated
            .filter(|count| *count > 0)
            .map_or(String::new(), |count| {
                format!(", {count} words out of range")
            });
        let (psnr, error) = (decibels(found.psnr_db_of(self)), found.max_error_of(self));
        let reached = format!(
            "{machine} reaches {psnr} dB, {}, at most {error:.4} off{lost}",
            self.difference()
        );
        let method = method_psnr_db(views).filter(|_| self.against == Against::Ideal);
        let method = method.map_or(String::new(), |db| {
            format!("; golden − ideal alone is {db:.1} dB, and no word changes that")
        });
        Err(format!(
            "the target is out of reach: on {names} {reached}{method}"
        ))
    }

    /// Index of the view with the greatest load, the first one if several are equal; None without
    /// views.
    fn deciding(&self, found: &[SearchErrors]) -> Option<usize> {
        let load = |nth: &usize| self.load(&found[*nth]);
        (0..found.len()).max_by(|a, b| load(a).total_cmp(&load(b)).then(b.cmp(a)))
    }

    /// Squared error as a part of the allowed squared error: at most 1 meets the target.
    fn load(&self, found: &SearchErrors) -> f64 {
        let (psnr_db, error) = (found.psnr_db_of(self), found.max_error_of(self));
        let by_psnr = self
            .psnr_db
            .zip(psnr_db)
            .map_or(0.0, |(wanted, db)| libm::pow(10.0, (wanted - db) / 10.0));
        let by_error = self
            .max_error
            .map_or(0.0, |most| error / most * (error / most));
        let lost = if self.no_saturation && found.saturated.unwrap_or(0) > 0 {
            f64::INFINITY
        } else {
            0.0
        };
        by_psnr.max(by_error).max(lost)
    }
}

/// One step of the search.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct SearchStep {
    /// Method.
    pub method: String,
    /// Area after the step, LUT equivalents.
    pub area: f64,
    #[serde(flatten)]
    found: SearchErrors,
    /// Different machines requested so far, each drawn once.
    pub drawn: u64,
}

/// Result of a search.
#[derive(Debug, Serialize, JsonSchema)]
pub struct SearchOutcome {
    /// The scenes.
    pub scenes: Vec<String>,
    /// Target that was given.
    pub target: Target,
    /// The machine from which the search started.
    pub base: String,
    /// Steps of the search.
    pub path: Vec<SearchStep>,
    /// Unseen views.
    pub views: Vec<Unseen>,
    /// Views that failed and were added to the search.
    pub learnt: Vec<String>,
    /// Searched cameras: those of the scenes, then those of `learnt`.
    pub cameras: Vec<Searched>,
    /// Words that are critical for the target: with one step less, a searched view misses it. The
    /// worst first.
    pub tight: Vec<CriticalWord>,
    /// Stated figures, and the cameras that decide them.
    pub claims: Vec<Claim>,
    /// Cost of the unseen views.
    pub margin: Margin,
    /// Steps that were measured on the final machine; each of them misses the aim.
    pub checked: CheckedSteps,
    /// The machine that was found.
    pub machine: Machine,
    /// Target and scenes of the search, as in the machine's file.
    pub searched: SearchRecord,
    /// Files that were written.
    #[serde(skip)]
    pub files: Vec<PathBuf>,
}

/// Cost of unseen views: the final machine, compared with the narrowest one that meets the target
/// on the first views.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Margin {
    /// Decibels above the target that each searched view had to reach; 0 if the aim is the target.
    pub aim_db: f64,
    /// Least PSNR of the final machine on the first views, dB; null if the pictures are equal.
    pub first_psnr_db: Option<f64>,
    /// `first_psnr_db` minus the target; null if the target has no PSNR, or the pictures are equal.
    pub db: Option<f64>,
    /// Area of the narrowest machine that meets the target on the first views, LUT equivalents.
    pub target_alone_area: f64,
    /// Additional area of the final machine, LUT equivalents.
    pub area: f64,
    /// Words that got integer bits back because they saturated on a failing view.
    pub widened: Vec<String>,
}

/// Steps that cannot be taken from the final machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct CheckedSteps {
    /// Words and sizes that were drawn with one step less: each misses the aim.
    pub alone: usize,
    /// Joint steps of words that are not critical for the target: each misses the aim.
    pub together: usize,
    /// Words and sizes for which one step less takes more area.
    pub costly: usize,
}

/// An unseen view.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Unseen {
    /// Index of the domain.
    #[serde(skip)]
    of: usize,
    /// Scene and number.
    pub name: String,
    /// Position of the eye.
    pub eye: [f64; 3],
    /// The whole camera, as in a scene file.
    pub camera: Camera,
    #[serde(flatten)]
    found: SearchErrors,
}

/// A searched view.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Searched {
    /// Scene, or scene and number.
    pub name: String,
    /// The whole camera, as in a scene file.
    pub camera: Camera,
}

/// A step that cannot be taken.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct CriticalWord {
    /// Path of the field.
    pub path: String,
    /// Value.
    pub value: Value,
    /// The part that a step reduces.
    pub part: KnobPart,
    /// PSNR with one step less, dB, against the reference of the target; null if the pictures are
    /// equal or the machine cannot be built.
    pub psnr_db: Option<f64>,
}

/// Searches scenes; unseen cameras are around the scene, at the distance of its own camera.
///
/// # Errors
/// As [`run_on`].
pub fn run(
    scenes: &[Scene],
    machine: &Machine,
    folder: &Path,
    options: &SearchOptions,
) -> Result<SearchOutcome> {
    let domains: Vec<Domain> = scenes.iter().cloned().map(Domain::around).collect();
    run_on(&domains, machine, folder, options)
}

/// The views that are searched first, each with its nearby cameras.
fn first_views(
    domains: &[Domain],
    machine: &Machine,
    options: &SearchOptions,
) -> Result<Vec<View>> {
    let mut views = Vec::new();
    for (of, domain) in domains.iter().enumerate() {
        for member in domain.first() {
            quantise(&member.scene, machine)?;
            views.extend(
                member
                    .and_nearby(options.robust)
                    .into_iter()
                    .map(|member| View::new(of, member, machine)),
            );
        }
    }
    Ok(views)
}

/// Refuses a target that the unchanged machine misses on the first views.
///
/// # Errors
/// [`Error::Input`] if it misses the target.
pub fn check(domains: &[Domain], machine: &Machine, options: &SearchOptions) -> Result<()> {
    checked(domains, machine, options).map(drop)
}

fn checked(domains: &[Domain], machine: &Machine, options: &SearchOptions) -> Result<Vec<View>> {
    let elaborated = fixed::elaborate(machine)?;
    let views = first_views(domains, machine, options)?;
    let found = found_on(&views, |view| drawn(&elaborated, view, &options.target))?;
    options
        .target
        .check_reach(&found, &views, &machine.name)
        .map_err(Error::input)?;
    Ok(views)
}

/// Runs the search.
///
/// # Errors
/// [`Error::Input`] if the unchanged machine misses the target, or the folder belongs to something
/// else; [`Error::Job`] if results cannot be written, or the target holds on no unseen view.
pub fn run_on(
    domains: &[Domain],
    machine: &Machine,
    folder: &Path,
    options: &SearchOptions,
) -> Result<SearchOutcome> {
    let knobs = knobs::all(machine, &options.only);
    if let Some(name) = options.only.iter().find(|name| {
        !knobs
            .iter()
            .any(|knob| machines::is_below(&knob.path, name))
    }) {
        return Err(Error::input(format!(
            "--only {name}: machine {} has no such unit, word or size",
            machine.name
        )));
    }
    // Fails before anything is written.
    let views = checked(domains, machine, options)?;
    let _open = Folder::open(folder)?;
    let mut journal = Journal::open(folder, "", columns_of(&options.target))?;
    journal.keep();
    let names: Vec<String> = domains.iter().map(|domain| domain.label.clone()).collect();
    write_plan(
        folder,
        &json!({"splatsim": env!("CARGO_PKG_VERSION"), "search": options.target, "scenes": names, "machine": machine}),
    )?;
    let mut search = WordSearch::new(machine, knobs, domains, views, journal, options);
    let first_views = search.views.len();
    let none = vec![0; search.knobs.len()];
    search.check_reach()?;
    let mut path = vec![search.step(&machine.name, &none)?];
    let mut learnt: Vec<String> = Vec::new();
    let mut next_view = 1;
    let mut steps: Option<Vec<u32>> = None;
    let mut target_alone_area = None;
    loop {
        let best = search.round(steps.as_deref(), &mut path)?;
        // Integer bits take long. Unseen views are checked first, except in the first round, which
        // gives the area for the target only.
        let early = match target_alone_area {
            Some(_) => search.verified(&best, &mut next_view)?.1,
            None => None,
        };
        let is_early = early.is_some();
        let (tried, (found, views)) = match early {
            Some(failed) => (best.clone(), failed),
            None => {
                let Settled {
                    steps: last,
                    alone,
                    together,
                    costly,
                } = search.last_steps(&best, &mut path)?;
                let area = search.area(&last).unwrap_or(f64::INFINITY);
                let target_alone_area = *target_alone_area.get_or_insert(area);
                let (held, failed) = search.verified(&last, &mut next_view)?;
                let Some(failed) = failed else {
                    let searched = search.drawn_again(&last)?;
                    let margin =
                        search.margin(&last, &searched[..first_views], [target_alone_area, area]);
                    let claims = search.claims(&searched, &held);
                    let checked = CheckedSteps {
                        alone,
                        together,
                        costly,
                    };
                    let outcome = search.outcome(
                        names,
                        path,
                        held,
                        learnt,
                        &last,
                        (margin, claims, checked),
                    )?;
                    return search.write(outcome, folder);
                };
                (last, failed)
            }
        };
        let worst = &views[0];
        if learnt.len() + 1 == ROUNDS {
            return Err(Error::job(format!(
                "after {ROUNDS} rounds {} still misses the target: aim lower",
                worst.name
            )));
        }
        let (name, from) = (worst.name.clone(), worst.short_name().to_owned());
        let stricter = search.stricter;
        let mut widened = false;
        // A view that fails only after the last steps is added to the search.
        if is_early {
            let load;
            (widened, load) = search.widened(&tried, &views, options.target.load(&found))?;
            if learnt.len() >= PATIENCE && load > 1.0 && load.is_finite() {
                search.stricter *= load.min(MOST_STRICTER);
            }
        }
        let step = search.step("", &tried)?;
        search.learn(views);
        search.check_reach()?;
        let method = match (widened, search.aim_db()) {
            (true, _) => format!("{from} saturates"),
            (false, db) if search.stricter > stricter => format!("{from}: aim +{db:.1} dB"),
            _ => format!("{from} fails"),
        };
        learnt.push(name);
        path.push(SearchStep {
            method,
            found,
            ..step
        });
        steps = Some(best);
    }
}

/// Unseen views with their errors, and the worst failing one with its nearby cameras.
type Verdict = (Vec<Unseen>, Option<(SearchErrors, Vec<View>)>);

/// State of a search.
struct WordSearch<'a> {
    domains: &'a [Domain],
    options: &'a SearchOptions,
    base: Machine,
    /// The base with fewer integer bits.
    cut: Machine,
    fields: Value,
    knobs: Vec<Knob>,
    /// Integer bits. Their steps follow those of the knobs, and are taken only in the last steps.
    integers: Vec<Knob>,
    is_last: bool,
    views: Vec<View>,
    journal: Journal,
    /// Points of the rows by key.
    known: HashMap<String, u64>,
    areas: HashMap<Vec<u32>, Option<f64>>,
    method: &'static str,
    /// Requested machines, whether drawn now or earlier.
    requested: HashSet<String>,
    prefetch: Prefetch,
    /// Factor by which the allowed squared error is less than the target's.
    stricter: f64,
    /// Least integer bits of words that saturated on a failing view.
    least_int_bits: BTreeMap<String, i32>,
    progress: Progress,
}

impl<'a> WordSearch<'a> {
    fn new(
        machine: &Machine,
        knobs: Vec<Knob>,
        domains: &'a [Domain],
        views: Vec<View>,
        journal: Journal,
        options: &'a SearchOptions,
    ) -> Self {
        let known = journal
            .rows()
            .filter_map(|row| Some((row[1].as_str()?.to_owned(), row[0].as_u64()?)))
            .collect();
        let progress = Progress::of_messages(options.progress);
        let (base, cut, fields) = (machine.clone(), machine.clone(), machines::value(machine));
        WordSearch {
            domains,
            options,
            base,
            cut,
            fields,
            integers: knobs::integers(machine, &options.only),
            is_last: false,
            knobs,
            views,
            journal,
            known,
            areas: HashMap::new(),
            method: "",
            requested: HashSet::new(),
            prefetch: Prefetch::new(),
            stricter: 1.0,
            least_int_bits: BTreeMap::new(),
            progress,
        }
    }

    /// Adds a view with its nearby cameras.
    fn learn(&mut self, views: Vec<View>) {
        self.views.extend(views);
        self.areas.clear();
    }

    /// Checks that the base meets the target on all views. Limits the aim to what the base reaches.
    fn check_reach(&mut self) -> Result<()> {
        self.cut = self.base.clone();
        self.take_fields();
        let found = self.found(&vec![0; self.knobs.len()])?;
        let load = self.options.target.load(&found);
        // The scenes were checked before. A failure on a later view is an error of the job, not of
        // the input.
        self.options
            .target
            .check_reach(&found, &self.views, &self.base.name)
            .map_err(Error::job)?;
        self.stricter = self.stricter.min(1.0 / load.max(f64::MIN_POSITIVE));
        Ok(())
    }

    /// All knobs, including those of the last steps.
    fn all_knobs(&self) -> impl Iterator<Item = &Knob> {
        self.knobs.iter().chain(&self.integers)
    }

    fn machine(&self, steps: &[u32]) -> Option<Machine> {
        let mut fields = self.fields.clone();
        for (knob, steps) in self.all_knobs().zip(steps).filter(|(_, steps)| **steps > 0) {
            knob.take(&mut fields, *steps);
        }
        serde_json::from_value(fields).ok()
    }

    fn area_of(&self, machine: &Machine) -> Option<f64> {
        Some(Cost::new(&machine.elaborate().ok()?, &self.options.prices).area)
    }

    /// Differences from the base, as `sweep` writes them.
    fn changes(&self, machine: &Machine) -> String {
        let [base, now] = [&self.base, machine].map(machines::value);
        let mut changes = Vec::new();
        differences(&base, &now, "", &mut changes);
        changes.join(" ")
    }

    /// A machine and the key of its row; None if it cannot be built.
    fn keyed(&self, steps: &[u32]) -> Option<(String, Machine, Elaborated)> {
        let machine = self.machine(steps)?;
        let elaborated = machine.elaborate().ok()?;
        let views: Vec<&str> = self.views.iter().map(|view| view.digest.as_str()).collect();
        let nameless = Machine {
            name: String::new(),
            ..machine.clone()
        };
        let all = json!([
            env!("CARGO_PKG_VERSION"),
            views,
            nameless,
            self.options.target.no_saturation,
            self.options.prices
        ]);
        Some((digest(all.to_string().as_bytes()), machine, elaborated))
    }

    /// Errors of a machine according to its row.
    fn known(&self, key: &str) -> Option<SearchErrors> {
        let row = self
            .known
            .get(key)
            .and_then(|point| self.journal.get(*point))?;
        let saturated = row[11].as_u64();
        let is_hopeless = !row[5].is_null();
        Some(if is_hopeless {
            UNUSABLE
        } else {
            SearchErrors {
                psnr_db: row[6].as_f64(),
                max_error: row[7].as_f64().unwrap_or(0.0),
                fixed_vs_ideal_psnr_db: row[9].as_f64(),
                fixed_vs_ideal_max_error: row[10].as_f64().unwrap_or(0.0),
                saturated,
                lockstep: (row.len() > COLUMNS.len()).then(|| InLockstep {
                    psnr_db: row[14].as_f64(),
                    max_error: row[15].as_f64().unwrap_or(f64::INFINITY),
                }),
            }
        })
    }

    /// Errors of a machine on all views; draws it if it has no row.
    fn found(&mut self, steps: &[u32]) -> Result<SearchErrors> {
        let Some((key, machine, elaborated)) = self.keyed(steps) else {
            return Ok(UNUSABLE);
        };
        self.requested.insert(key.clone());
        if let Some(found) = self.known(&key) {
            return Ok(found);
        }
        let Measurement { found, seconds } = self.prefetch.taken(
            &self.views,
            &self.options.target,
            (&key, &machine),
            &elaborated,
        )?;
        let misfit = found.as_ref().err().cloned();
        let found = found.unwrap_or(UNUSABLE);
        let area = Cost::new(&elaborated, &self.options.prices).area;
        let point = self
            .journal
            .rows()
            .filter_map(|row| row[0].as_u64())
            .next_back()
            .map_or(0, |last| last + 1);
        let scene = self
            .views
            .iter()
            .map(|view| view.name.as_str())
            .collect::<Vec<_>>()
            .join(", ");
        let seen = misfit.is_none();
        let mut row: Row = vec![
            json!(point),
            json!(key),
            json!(scene),
            json!(self.changes(&machine)),
            json!(self.method),
            json!(misfit),
            json!(found.psnr_db.filter(|_| seen)),
            json!(seen.then_some(found.max_error)),
            json!(method_psnr_db(&self.views)),
            json!(found.fixed_vs_ideal_psnr_db.filter(|_| seen)),
            json!(seen.then_some(found.fixed_vs_ideal_max_error)),
            json!(found.saturated),
            json!(area),
            json!(seconds),
        ];
        if self.options.target.metric == Metric::Lockstep {
            row.extend([
                json!(found.lockstep.and_then(|of| of.psnr_db)),
                json!(found.lockstep.map(|of| of.max_error)),
            ]);
        }
        self.journal.push(point, row)?;
        self.known.insert(key, point);
        // Before the first step there is no method.
        let method = if self.method.is_empty() {
            "start"
        } else {
            self.method
        };
        let message = format!(
            "{method}: machine {} drawn, {} LUT equivalents, {} dB",
            self.requested.len(),
            thousands(area as u64),
            decibels(found.psnr_db_of(&self.options.target))
        );
        self.progress.set_message(message);
        Ok(found)
    }

    /// Squared error of a machine as a part of the allowed squared error.
    fn load_of(&self, found: &SearchErrors) -> f64 {
        if *found == UNUSABLE {
            f64::INFINITY
        } else {
            self.options.target.load(found) * self.stricter
        }
    }

    fn step(&mut self, method: &str, steps: &[u32]) -> Result<SearchStep> {
        let area = self.area(steps).unwrap_or(f64::INFINITY);
        Ok(SearchStep {
            method: method.to_owned(),
            area,
            found: self.found(steps)?,
            drawn: self.requested.len() as u64,
        })
    }

    /// Reduces integer bits to those that the views and the cameras around need.
    fn cut(&mut self) -> Result<()> {
        let elaborated = fixed::elaborate(&self.base)?;
        let mut needed: HashMap<String, i32> = HashMap::new();
        let range = FIRST_RANGE_VIEW..FIRST_RANGE_VIEW + RANGE_VIEWS;
        let around = self.domains.iter().flat_map(|domain| {
            range
                .clone()
                .map(|nth| domain.nth(nth).map(|member| Cow::Owned(member.scene)))
        });
        let all = self
            .views
            .iter()
            .map(|view| Ok(Cow::Borrowed(&view.scene)))
            .chain(around);
        for scene in all {
            let scene = scene?;
            let Ok(quantised) = quantise(&scene, &self.base) else {
                continue;
            };
            let (_, ranges, _) = fixed::draw_measured(&elaborated, &quantised);
            for (signal, range) in elaborated.signals.iter().zip(&ranges.0) {
                if let Some(narrowest) = range.narrowest(signal.word.format) {
                    let bits = needed
                        .entry(format!("{}.{}", signal.unit, signal.name))
                        .or_insert(i32::MIN);
                    *bits = (*bits).max(narrowest.int_bits);
                }
            }
        }
        for (word, bits) in &self.least_int_bits {
            needed
                .entry(word.clone())
                .and_modify(|needed| *needed = (*needed).max(*bits));
        }
        self.cut = self.base.clone();
        self.take_fields();
        let words = machines::words(&self.base)
            .into_iter()
            .filter(|(path, _)| knobs::is_selected(path, &self.options.only));
        let less = |(path, format): (String, Format)| {
            let int_bits = (*needed.get(&path)?).max(2 - format.frac_bits);
            (int_bits < format.int_bits)
                .then(|| (path, Value::from(Format { int_bits, ..format }.to_string())))
        };
        // Not all can be reduced: the span of a table is the range of its index.
        let mut changes: Vec<(String, Value)> = words.filter_map(less).collect();
        changes.retain(|change| self.try_cut(change).is_some());
        let none = vec![0; self.knobs.len()];
        if self.load(&none)? <= 1.0 {
            return Ok(());
        }
        // A word holds values that do not show in pictures: a constant of the scene, or a harmless
        // wrap. Finds it word by word.
        self.cut = self.base.clone();
        self.take_fields();
        for change in changes {
            let Some(before) = self.try_cut(&change) else {
                continue;
            };
            if self.load(&none)? > 1.0 {
                self.cut = before;
                self.take_fields();
            }
        }
        Ok(())
    }

    /// Reduces one word if the machine can then be built; returns the machine before.
    fn try_cut(&mut self, change: &(String, Value)) -> Option<Machine> {
        let machine = machines::with(&self.cut, std::slice::from_ref(change), "")
            .ok()
            .filter(|machine| machine.elaborate().is_ok())?;
        let before = std::mem::replace(&mut self.cut, machine);
        self.take_fields();
        Some(before)
    }

    /// Updates the fields from which steps are taken.
    fn take_fields(&mut self) {
        self.fields = machines::value(&self.cut);
        let only = &self.options.only;
        self.knobs = knobs::all(&self.cut, only);
        self.integers = knobs::integers(&self.cut, only);
        self.areas.clear();
    }

    /// One round: from the ranges to a machine that meets the target on all views. Fraction bits
    /// start from the previous round.
    fn round(&mut self, before: Option<&[u32]>, path: &mut Vec<SearchStep>) -> Result<Vec<u32>> {
        let none = vec![0; self.knobs.len()];
        self.method = "ranges";
        self.cut()?;
        path.push(self.step("integer bits by ranges", &none)?);
        let (well, ill) = match before {
            Some(before) => (
                None,
                before
                    .iter()
                    .zip(&self.knobs)
                    .map(|(steps, knob)| (*steps).min(knob.most))
                    .collect(),
            ),
            None => {
                self.method = "alone";
                let limits = descent::limits(self)?;
                let (well, ill) = descent::starts(self, &limits)?;
                (Some(well), ill)
            }
        };
        self.method = "min+1";
        let back = descent::given_back(self, &ill)?;
        path.push(self.step("min+1", &back)?);
        self.method = "max−1";
        let is_back_well = self.load(&back)? <= 1.0;
        let Some(well) = well else {
            // A round for an additional view.
            let down = descent::taken_away(self, if is_back_well { &back } else { &none })?;
            path.push(self.step("max−1", &down)?);
            return Ok(down);
        };
        let down = descent::taken_away(self, &well)?;
        path.push(self.step("max−1", &down)?);
        let best = if is_back_well && self.area(&back) < self.area(&down) {
            back
        } else {
            down
        };
        self.method = "annealing";
        let cold = descent::annealed(self, &best, self.options.seed, self.options.tries)?;
        path.push(self.step("annealing", &cold)?);
        descent::taken_away(self, &cold)
    }

    /// Takes single and joint steps until none is left, including integer bits.
    fn last_steps(&mut self, from: &[u32], path: &mut Vec<SearchStep>) -> Result<Settled> {
        self.method = "last steps";
        self.is_last = true;
        let from: Vec<u32> = from
            .iter()
            .copied()
            .chain(self.integers.iter().map(|_| 0))
            .collect();
        let settled = descent::settled(self, &from);
        self.is_last = false;
        let settled = settled?;
        path.push(self.step("last steps", &settled.steps)?);
        Ok(settled)
    }

    /// Gives integer bits back to words that saturate on failing views, if that improves the views.
    /// Returns whether it does, and the new load.
    fn widened(&mut self, steps: &[u32], views: &[View], load: f64) -> Result<(bool, f64)> {
        let Some(machine) = self.machine(steps) else {
            return Ok((false, load));
        };
        let elaborated = fixed::elaborate(&machine)?;
        let mut needed: BTreeMap<String, i32> = BTreeMap::new();
        for view in views {
            let Ok(quantised) = quantise(&view.scene, &machine) else {
                continue;
            };
            let (_, ranges, _) = fixed::draw_measured(&elaborated, &quantised);
            for (signal, range) in elaborated.signals.iter().zip(&ranges.0) {
                let format = signal.word.format;
                let narrowest = range
                    .narrowest(format)
                    .filter(|narrowest| narrowest.int_bits > format.int_bits);
                if let Some(narrowest) = narrowest {
                    let bits = needed
                        .entry(format!("{}.{}", signal.unit, signal.name))
                        .or_insert(i32::MIN);
                    *bits = (*bits).max(narrowest.int_bits);
                }
            }
        }
        let of_base: HashMap<String, Format> = machines::words(&self.base).into_iter().collect();
        let [now, mut wider] = [&machine, &machine].map(machines::value);
        let mut widened = BTreeMap::new();
        for (path, format) in machines::words(&machine) {
            let Some((bits, of_base)) = needed.get(&path).zip(of_base.get(&path)) else {
                continue;
            };
            let int_bits = (*bits).min(of_base.int_bits);
            if int_bits > format.int_bits {
                machines::lay(
                    &mut wider,
                    &path,
                    Value::from(Format { int_bits, ..format }.to_string()),
                );
                widened.insert(path, int_bits);
            }
        }
        let built = serde_json::from_value::<Machine>(wider.clone())
            .ok()
            .and_then(|machine| fixed::elaborate(&machine).ok());
        let Some(built) = built.filter(|_| wider != now) else {
            return Ok((false, load));
        };
        let found =
            found_on(views, |view| drawn(&built, view, &self.options.target)).unwrap_or(UNUSABLE);
        let then = self.options.target.load(&found);
        // Also if a load is NaN.
        if then.partial_cmp(&load) != Some(Ordering::Less) {
            return Ok((false, load));
        }
        self.least_int_bits.extend(widened);
        Ok((true, then))
    }

    /// Decibels of the aim above the target.
    fn aim_db(&self) -> f64 {
        10.0 * libm::log10(self.stricter)
    }

    /// Errors of a machine on each searched view.
    fn drawn_again(&self, steps: &[u32]) -> Result<Vec<SearchErrors>> {
        let machine = self.machine(steps).unwrap_or_else(|| self.base.clone());
        let elaborated = fixed::elaborate(&machine)?;
        self.views
            .iter()
            .map(|view| drawn(&elaborated, view, &self.options.target))
            .collect()
    }

    /// Cost of the unseen views; `areas` are those for the target only, and of the final machine.
    fn margin(&self, steps: &[u32], on_first: &[SearchErrors], [alone, found]: [f64; 2]) -> Margin {
        let target = &self.options.target;
        let formats: HashMap<String, Format> = self
            .machine(steps)
            .iter()
            .flat_map(machines::words)
            .collect();
        // The last steps may have removed some of them again.
        let is_kept = |(word, bits): &(&String, &i32)| {
            formats
                .get(*word)
                .is_some_and(|format| format.int_bits >= **bits)
        };
        let first_psnr_db = worst_of(on_first).psnr_db_of(target);
        Margin {
            aim_db: self.aim_db().max(0.0),
            first_psnr_db,
            db: first_psnr_db
                .zip(target.psnr_db)
                .map(|(reached, wanted)| reached - wanted),
            target_alone_area: alone,
            area: found - alone,
            widened: self
                .least_int_bits
                .iter()
                .filter(is_kept)
                .map(|(word, _)| word.clone())
                .collect(),
        }
    }

    /// Draws the next unseen views; returns their errors and the worst that fails.
    fn verified(&mut self, steps: &[u32], next: &mut usize) -> Result<Verdict> {
        let from = *next;
        *next += self.options.views;
        let Some(machine) = self.machine(steps) else {
            return Ok((Vec::new(), None));
        };
        let elaborated = fixed::elaborate(&machine)?;
        let target = &self.options.target;
        let mut held: Vec<Unseen> = Vec::new();
        let mut taken: Vec<(usize, Camera)> = Vec::new();
        let mut worst: Option<(f64, (SearchErrors, Vec<View>))> = None;
        for (of, domain) in self.domains.iter().enumerate() {
            for nth in from..from + self.options.views {
                let member = domain.nth(nth)?;
                let (name, camera) = (member.name.clone(), member.scene.camera);
                let searched = self.views.iter().map(|view| (view.of, view.scene.camera));
                // A short list of cameras repeats.
                if searched
                    .chain(taken.iter().copied())
                    .any(|seen| seen == (of, camera))
                {
                    continue;
                }
                let views: Vec<View> = member
                    .and_nearby(self.options.robust)
                    .into_iter()
                    .map(|member| View::new(of, member, &machine))
                    .collect();
                let each: Vec<SearchErrors> = views
                    .iter()
                    .map(|view| drawn(&elaborated, view, target).unwrap_or(UNUSABLE))
                    .collect();
                let found = worst_of(&each);
                let load = target.load(&found);
                self.progress
                    .set_message(format!("{name}: {} dB", decibels(found.psnr_db_of(target))));
                taken.push((of, camera));
                // The deciding one of the nearby cameras is recorded, with its errors.
                let decides = target.deciding(&each).unwrap_or(0);
                let (name, camera) = (views[decides].name.clone(), views[decides].scene.camera);
                held.push(Unseen {
                    of,
                    name,
                    eye: camera.eye.to_array(),
                    camera,
                    found: each[decides],
                });
                if load > 1.0 && worst.as_ref().is_none_or(|(most, _)| load > *most) {
                    worst = Some((load, (found, views)));
                }
            }
        }
        Ok((held, worst.map(|(_, failed)| failed)))
    }

    fn outcome(
        &mut self,
        scenes: Vec<String>,
        path: Vec<SearchStep>,
        views: Vec<Unseen>,
        learnt: Vec<String>,
        steps: &[u32],
        (margin, claims, checked): (Margin, Vec<Claim>, CheckedSteps),
    ) -> Result<SearchOutcome> {
        let mut tight = Vec::new();
        let lesser = |knob: usize| {
            let mut next = steps.to_vec();
            next[knob] += 1;
            next
        };
        let knobs: Vec<Knob> = self.all_knobs().cloned().collect();
        let open: Vec<usize> = (0..knobs.len())
            .filter(|knob| steps[*knob] < knobs[*knob].most)
            .collect();
        let fields = self
            .machine(steps)
            .map_or(Value::Null, |machine| machines::value(&machine));
        let all: Vec<Vec<u32>> = open.iter().copied().map(lesser).collect();
        self.prefetch(&all)?;
        for knob in open {
            let found = self.found(&lesser(knob))?;
            if found == UNUSABLE || self.options.target.load(&found) <= 1.0 {
                continue;
            }
            let knob = &knobs[knob];
            tight.push(CriticalWord {
                path: knob.path.clone(),
                value: knob.value(&fields),
                part: knob.part,
                psnr_db: found.psnr_db_of(&self.options.target),
            });
        }
        let worth = |tight: &CriticalWord| tight.psnr_db.unwrap_or(f64::INFINITY);
        tight.sort_by(|a, b| worth(a).total_cmp(&worth(b)));
        let aim = match (self.options.target.psnr_db, self.options.target.max_error) {
            (Some(db), _) => format!("{db}dB"),
            (None, most) => format!("{}", most.unwrap_or(0.0)),
        };
        let stem = |domain: &Domain| {
            Path::new(&domain.scene().name)
                .file_stem()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned()
        };
        let mut stems: Vec<String> = self.domains.iter().map(stem).collect();
        stems.dedup();
        let name = format!("{}-{aim}", stems.join("-"));
        let machine = Machine {
            name,
            ..self.machine(steps).unwrap_or_else(|| self.base.clone())
        };
        let (target, base) = (self.options.target, self.base.name.clone());
        let cameras = self
            .views
            .iter()
            .map(|view| Searched {
                name: view.name.clone(),
                camera: view.scene.camera,
            })
            .collect();
        let searched = SearchRecord {
            target,
            scenes: self.scene_records(&views),
        };
        Ok(SearchOutcome {
            scenes,
            target,
            base,
            path,
            views,
            learnt,
            cameras,
            tight,
            claims,
            margin,
            checked,
            machine,
            searched,
            files: Vec::new(),
        })
    }

    /// Views that decided the search: the searched ones, then the unseen ones.
    fn decided<'o>(&'o self, unseen: &'o [Unseen]) -> Vec<Decided<'o>> {
        let searched = self.views.iter().map(|view| Decided {
            name: &view.name,
            of: view.of,
            camera: &view.scene.camera,
        });
        searched
            .chain(unseen.iter().map(|view| Decided {
                name: &view.name,
                of: view.of,
                camera: &view.camera,
            }))
            .collect()
    }

    /// Figures of the worst searched view and of the worst unseen view.
    fn claims(&self, searched: &[SearchErrors], views: &[Unseen]) -> Vec<Claim> {
        let target = &self.options.target;
        let unseen: Vec<SearchErrors> = views.iter().map(|view| view.found).collect();
        let worst = |found: &[SearchErrors], from: usize| {
            let nth = target.deciding(found)?;
            let figure = match target.psnr_db {
                Some(_) => format!(
                    "{} dB, {}",
                    decibels(found[nth].psnr_db_of(target)),
                    target.difference()
                ),
                None => format!(
                    "{:.4} at most, {}",
                    found[nth].max_error_of(target),
                    target.difference()
                ),
            };
            Some((figure, from + nth))
        };
        let figures = [worst(searched, 0), worst(&unseen, searched.len())]
            .into_iter()
            .flatten()
            .collect();
        claims::claims(self.domains, &self.decided(views), figures)
    }

    /// Each scene with the searched cameras, then those of unseen views.
    fn scene_records(&self, unseen: &[Unseen]) -> Vec<SceneRecord> {
        let record = |(of, domain): (usize, &Domain)| {
            let searched = self
                .views
                .iter()
                .filter(|view| view.of == of)
                .map(|view| view.scene.camera);
            domain.record(
                searched
                    .chain(
                        unseen
                            .iter()
                            .filter(|view| view.of == of)
                            .map(|view| view.camera),
                    )
                    .collect(),
            )
        };
        self.domains.iter().enumerate().map(record).collect()
    }

    fn write(self, outcome: SearchOutcome, folder: &Path) -> Result<SearchOutcome> {
        let cameras = claims::write_cameras(folder, self.domains, &self.decided(&outcome.views))?;
        drop(self.progress);
        let mut files = self.journal.write(folder, "search")?;
        files.extend(cameras);
        let machine = machines::File {
            machine: outcome.machine.clone(),
            searched: Some(outcome.searched.clone()),
        };
        for (name, value) in [
            ("machine.json", json!(machine)),
            ("search.json", json!(outcome)),
        ] {
            let path = folder.join(name);
            write_beside(&path, |file| {
                serde_json::to_writer_pretty(file, &value).map_err(|e| e.to_string())
            })?;
            files.insert(0, path);
        }
        Ok(SearchOutcome { files, ..outcome })
    }
}

impl Problem for WordSearch<'_> {
    fn most(&self) -> Vec<u32> {
        let integers = self.integers.iter().filter(|_| self.is_last);
        self.knobs
            .iter()
            .chain(integers)
            .map(|knob| knob.most)
            .collect()
    }

    fn area(&mut self, steps: &[u32]) -> Option<f64> {
        if let Some(area) = self.areas.get(steps) {
            return *area;
        }
        let area = self
            .machine(steps)
            .and_then(|machine| self.area_of(&machine));
        self.areas.insert(steps.to_vec(), area);
        area
    }

    fn load(&mut self, steps: &[u32]) -> Result<f64> {
        let found = self.found(steps)?;
        Ok(self.load_of(&found))
    }

    fn load_without_margin(&mut self, steps: &[u32]) -> Result<f64> {
        let found = self.found(steps)?;
        Ok(if found == UNUSABLE {
            f64::INFINITY
        } else {
            self.options.target.load(&found)
        })
    }

    fn width(&self) -> usize {
        self.prefetch.width()
    }

    fn prefetch(&mut self, steps: &[Vec<u32>]) -> Result<()> {
        if self.width() == 1 {
            return Ok(());
        }
        let mut machines: Vec<(String, Machine)> = Vec::new();
        for (key, machine, _) in steps.iter().filter_map(|steps| self.keyed(steps)) {
            if !self.known.contains_key(&key) && !machines.iter().any(|(other, _)| *other == key) {
                machines.push((key, machine));
            }
        }
        self.prefetch
            .measure(&self.views, &self.options.target, &machines)
    }

    fn prefetched(&self, steps: &[u32]) -> Option<f64> {
        let Some((key, ..)) = self.keyed(steps) else {
            return Some(f64::INFINITY);
        };
        let measured = || {
            self.prefetch
                .get(&key)
                .map(|measured| measured.found.clone().unwrap_or(UNUSABLE))
        };
        self.known(&key)
            .or_else(measured)
            .map(|found| self.load_of(&found))
    }
}

/// Errors of a machine that cannot be built, or cannot hold the scene.
const UNUSABLE: SearchErrors = SearchErrors {
    psnr_db: Some(f64::NEG_INFINITY),
    max_error: f64::INFINITY,
    fixed_vs_ideal_psnr_db: Some(f64::NEG_INFINITY),
    fixed_vs_ideal_max_error: f64::INFINITY,
    saturated: None,
    lockstep: None,
};

/// Draws a view and compares.
fn drawn(elaborated: &Elaborated, view: &View, target: &Target) -> Result<SearchErrors> {
    let evaluation = Evaluation::on(&view.scene, elaborated)?;
    let (picture, saturated) = if target.no_saturation {
        let observed = evaluation.observe();
        let lost = observed.overflows().total();
        (observed.picture, Some(lost))
    } else {
        (evaluation.picture(&evaluation.draw()), None)
    };
    let [apart, whole] = [&view.golden, &view.ideal].map(|other| distance(&picture, other));
    let led = (target.metric == Metric::Lockstep).then(|| evaluation.lockstep().summary(&picture));
    let not_finite = apart
        .not_finite
        .max(whole.not_finite)
        .max(led.map_or(0, |led| led.not_finite));
    if not_finite > 0 {
        return Err(Error::job(format!(
            "{}: {not_finite} pixels have no finite number, and meet no target",
            view.name
        )));
    }
    Ok(SearchErrors {
        psnr_db: apart.psnr_db,
        max_error: apart.max_error,
        fixed_vs_ideal_psnr_db: whole.psnr_db,
        fixed_vs_ideal_max_error: whole.max_error,
        saturated,
        lockstep: led.map(|led| InLockstep {
            psnr_db: led.psnr_db,
            max_error: led.max_error,
        }),
    })
}

/// Leaves that differ, as PATH=VALUE.
fn differences(base: &Value, now: &Value, path: &str, changes: &mut Vec<String>) {
    match (base, now) {
        (Value::Object(base), Value::Object(now)) => {
            for (name, now) in now {
                let below = if path.is_empty() {
                    name.clone()
                } else {
                    format!("{path}.{name}")
                };
                // As in a plan, a word with a rounding is named without `.format`.
                let below = if name == "format" {
                    path.to_owned()
                } else {
                    below
                };
                differences(base.get(name).unwrap_or(&Value::Null), now, &below, changes);
            }
        }
        _ if base != now => changes.push(format!(
            "{path}={}",
            now.as_str().map_or_else(|| now.to_string(), str::to_owned)
        )),
        _ => {}
    }
}

/// Most critical words in the summary.
const MOST_CRITICAL: usize = 8;

impl SearchOutcome {
    /// Steps and result, at most 80 columns wide.
    pub fn summary(&self) -> String {
        let (first, last) = (&self.path[0], &self.path[self.path.len() - 1]);
        let is_led = self.target.metric == Metric::Lockstep;
        let head = format!(
            "{}, from {}: {}",
            self.scenes.join(", "),
            self.base,
            self.target.aims().join(", ")
        );
        let mut table = plain_table(&[
            "",
            "area",
            "",
            if is_led { "lockstep dB" } else { "golden dB" },
            "ideal dB",
            "max error",
            "drawn",
        ]);
        for SearchStep {
            method,
            area,
            found,
            drawn,
        } in &self.path
        {
            let part = format!("{:.1}%", 100.0 * area / first.area);
            table.add_row([
                method.clone(),
                thousands(*area as u64),
                part,
                decibels(if is_led {
                    found.psnr_db_of(&self.target)
                } else {
                    found.psnr_db
                }),
                decibels(found.fixed_vs_ideal_psnr_db),
                format!("{:.4}", found.max_error_of(&self.target)),
                thousands(*drawn),
            ]);
        }
        let mut text = format!("{}\n\n{}\n", wrapped(&head), aligned(table).trim_fmt());
        let saved = 100.0 * (1.0 - last.area / first.area);
        let mut size = format!(
            "{}: {} LUT equivalents, {saved:.1}% less than {}",
            self.machine.name,
            thousands(last.area as u64),
            self.base
        );
        let reference = Machine::named("reference").and_then(|machine| machine.elaborate().ok());
        if let Some(reference) = reference.filter(|_| self.base != "reference") {
            let whole = Cost::new(&reference, &Prices::default()).area;
            let _ = write!(
                size,
                ", {:.1}% less than reference",
                100.0 * (1.0 - last.area / whole)
            );
        }
        let _ = write!(text, "\n{}", wrapped(&size));
        let worst = self
            .views
            .iter()
            .filter_map(|view| view.found.psnr_db_of(&self.target))
            .fold(f64::INFINITY, f64::min);
        let worst = if worst.is_finite() {
            format!(", the worst with {worst:.1} dB")
        } else {
            String::new()
        };
        let views = match self.views.len() {
            0 => "no unseen view was tried".to_owned(),
            count => format!("holds on {count} unseen views{worst}"),
        };
        let _ = write!(text, "\n{}", wrapped(&views));
        for sentence in self.margin_text() {
            let _ = write!(text, "\n{}", wrapped(&sentence));
        }
        let _ = write!(text, "\n{}", wrapped(&self.checked_text()));
        let tight = self.tight.iter().take(MOST_CRITICAL).map(|tight| {
            let value = tight
                .value
                .as_str()
                .map_or_else(|| tight.value.to_string(), str::to_owned);
            let bit = if tight.part == KnobPart::IntegerBit {
                "integer bit: "
            } else {
                ""
            };
            format!(
                "{} {value} ({bit}{})",
                tight.path,
                tight
                    .psnr_db
                    .map_or("equal".into(), |db| format!("{db:.1} dB"))
            )
        });
        let tight: Vec<String> = tight.collect();
        if !tight.is_empty() {
            let critical = match self.tight.len() {
                count if count > MOST_CRITICAL => {
                    format!(
                        "{MOST_CRITICAL} of {count} critical word lengths (search.json lists all; "
                    )
                }
                _ => "critical word lengths (".to_owned(),
            };
            let _ = write!(
                text,
                "\n{}",
                wrapped(&format!(
                    "{critical}in parentheses: PSNR with one step less): {}",
                    tight.join(", ")
                ))
            );
        }
        text
    }

    /// Cost of unseen views, one sentence per line.
    fn margin_text(&self) -> Vec<String> {
        let Margin {
            aim_db,
            first_psnr_db,
            db,
            target_alone_area,
            area,
            widened,
        } = &self.margin;
        if self.learnt.is_empty() {
            return vec!["no unseen view failed, so no area was added for unseen views".into()];
        }
        let part = 100.0 * area / target_alone_area;
        let more = if part < 0.0 { "less" } else { "more" };
        let mut cost = format!(
            "holding on unseen views takes {:.1}% {more} area",
            part.abs()
        );
        if let Some(db) = db {
            let _ = write!(
                cost,
                "; the worst of the first views then has {} dB, {db:.1} dB above the target",
                decibels(*first_psnr_db)
            );
        }
        let mut searched = match self.learnt.len() {
            1 => "1 failed view was added to the search".to_owned(),
            count => format!("{count} failed views were added to the search"),
        };
        if *aim_db > 0.0 {
            let _ = write!(
                searched,
                ", and every searched view must be {aim_db:.1} dB above the target"
            );
        }
        let mut sentences = vec![
            format!(
                "{} LUT equivalents would meet the target on the first views only",
                thousands(*target_alone_area as u64)
            ),
            cost,
            searched,
        ];
        if !widened.is_empty() {
            sentences.push(format!(
                "words that got integer bits back: {}",
                widened.join(", ")
            ));
        }
        sentences
    }

    /// Which further steps were measured, in one sentence.
    fn checked_text(&self) -> String {
        let CheckedSteps {
            alone,
            together,
            costly,
        } = self.checked;
        let aim = if self.margin.aim_db > 0.0 {
            "aim"
        } else {
            "target"
        };
        let counted = |count: usize, kind: &str| match count {
            1 => format!("1 {kind} step"),
            _ => format!("{count} {kind} steps"),
        };
        let tried: Vec<String> = [(alone, "single"), (together, "joint")]
            .into_iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, kind)| counted(count, kind))
            .collect();
        let mut text = match alone + together {
            0 => "checked: there is no single step to try".to_owned(),
            1 => format!("checked: {} misses the {aim}", tried.join(" and ")),
            _ => format!("checked: {} miss the {aim}", tried.join(" and ")),
        };
        if costly > 0 {
            let _ = write!(
                text,
                "; {} would take more area or cannot be built",
                counted(costly, "further single")
            );
        }
        text
    }
}

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
use crate::accuracy::screen::{self, Screening, TileSplats, Until};
use crate::error::{Error, Result};
use crate::explore::sweep::columns;
use crate::explore::sweep::table::{CellKind, Column, Journal, Row, named};
use crate::explore::sweep::write_plan;
use crate::golden;
use crate::hardware::quantise::{Part, quantise};
pub use crate::hardware::searched::{Against, Metric, Target};
use crate::hardware::searched::{SceneRecord, SearchRecord};
use crate::hardware::{fixed, machines};
use crate::output::files::{Folder, write_beside};
use crate::output::picture::Picture;
use crate::output::progress::Progress;
use crate::output::text::{aligned, counted, duration, plain, plain_table, thousands, wrapped};
use crate::performance::cost::{Cost, Prices};
use crate::run::evaluation::Evaluation;
use crate::run::timed;
use crate::scene::digest::{digest, digest_of};
use crate::scene::{Camera, Scene};
pub use claims::Claim;
use claims::Decided;
use crew::{InTurn, Measurement, Prefetch, Request};
use descent::{Problem, Settled};
pub use domain::{Domain, Member};
use knobs::{Knob, KnobPart, Selection};
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
use std::sync::OnceLock;
use std::time::{Duration, Instant};

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
    /// Draw only a sample of the tiles where that decides.
    pub screen: bool,
    /// End after this time, with the best machine found so far.
    pub budget: Option<Duration>,
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
/// Greatest load of a view that fails after the last steps and raises the aim: 1 dB.
const LATE: f64 = 1.26;

/// States that a descent takes by samples, per state that is drawn in full as the next reference.
const STATES_PER_REFERENCE: u32 = 6;
/// Passes of max−1 by samples, at most: a sample may reject a step that the next one does not.
const PASSES: usize = 2;
/// Loads of references: machines near the target.
const REFERENCE_LOADS: [f64; 2] = [0.5, 2.0];
/// Rounds of giving steps back from a machine that meets the aim only by its samples, before samples
/// no longer count.
const REPAIRS: usize = 8;
/// Factor on the aim per such round.
const REPAIR: f64 = 1.03;

/// Stage in which unseen views are drawn.
const UNSEEN: &str = "unseen views";
/// The same before the last steps.
const EARLY: &str = "early test of unseen views";
/// Stages of the first round.
const STAGES: [&str; 7] = [
    "ranges",
    "alone",
    "min+1",
    "max−1",
    "annealing",
    "last steps",
    UNSEEN,
];
/// Stages of later rounds; unseen views are also drawn before the last steps.
const LATER_STAGES: [&str; 6] = ["ranges", "min+1", "max−1", EARLY, "last steps", UNSEEN];
/// Number of machines after which the time is forecast.
const FORECAST_AFTER: usize = 50;

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

/// Additional column of a search that screens: tiles of the samples; empty if the machine was drawn
/// in full.
const SCREENED_COLUMNS: [(&str, CellKind); 4] = [
    (columns::SAMPLED_TILES, CellKind::Whole),
    ("load", CellKind::Number),
    ("load_low", CellKind::Number),
    ("load_high", CellKind::Number),
];

fn columns_of(options: &SearchOptions) -> Vec<Column> {
    let more: &[_] = if options.target.metric == Metric::Lockstep {
        &LOCKSTEP_COLUMNS
    } else if options.screens() {
        &SCREENED_COLUMNS
    } else {
        &[]
    };
    named(&[&COLUMNS, more].concat())
}

impl SearchOptions {
    /// Whether machines are screened.
    fn screens(&self) -> bool {
        self.screen && screen::is_possible(&self.target)
    }
}

/// A scene from one camera.
#[derive(Serialize, Deserialize)]
struct View {
    /// Index of the domain.
    of: usize,
    name: String,
    scene: Scene,
    golden: Picture,
    /// Drawn when it is needed.
    ideal: Option<Picture>,
    /// Error of the method, which does not depend on words.
    golden_vs_ideal_psnr_db: Option<f64>,
    digest: String,
    /// Splats of each tile, for samples of tiles.
    splats: Option<TileSplats>,
    #[serde(skip)]
    part: OnceLock<Part>,
}

impl View {
    fn new(of: usize, Member { name, scene }: Member, machine: &Machine) -> Self {
        let golden = golden::render(&scene, &fixed::rules(machine)).picture;
        View {
            of,
            name,
            digest: digest_of(&scene),
            scene,
            golden,
            ideal: None,
            golden_vs_ideal_psnr_db: None,
            splats: None,
            part: OnceLock::new(),
        }
    }

    /// With the picture of the method without limits.
    fn with_ideal(mut self) -> Self {
        if self.ideal.is_none() {
            let ideal = golden::ideal(&self.scene).picture;
            self.golden_vs_ideal_psnr_db = distance(&self.golden, &ideal).psnr_db;
            self.ideal = Some(ideal);
        }
        self
    }

    /// The picture that the target compares with.
    fn exact(&self, target: &Target) -> Option<&Picture> {
        match target.against {
            Against::Golden => Some(&self.golden),
            Against::Ideal => self.ideal.as_ref(),
        }
    }

    /// Squared error at which the load is 1.
    fn allowed(&self, target: &Target) -> f64 {
        screen::allowed(&self.golden, target.psnr_db.unwrap_or(0.0))
    }

    /// The view as it is sampled; `None` if machines must be drawn on it in full.
    fn sampled(&self, target: &Target) -> Option<screen::View<'_>> {
        Some(screen::View {
            scene: &self.scene,
            exact: self.exact(target)?,
            allowed: self.allowed(target),
            splats: self.splats.as_ref()?,
            part: self.part.get_or_init(|| Part::of(&self.scene)),
        })
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

    /// Squared error as a part of the allowed squared error: at most 1 meets the target.
    fn load_of(&self, target: &Target) -> f64 {
        let (psnr_db, error) = (self.psnr_db_of(target), self.max_error_of(target));
        let by_psnr = target
            .psnr_db
            .zip(psnr_db)
            .map_or(0.0, |(wanted, db)| libm::pow(10.0, (wanted - db) / 10.0));
        let by_error = target
            .max_error
            .map_or(0.0, |most| error / most * (error / most));
        let lost = if target.no_saturation && self.saturated.unwrap_or(0) > 0 {
            f64::INFINITY
        } else {
            0.0
        };
        by_psnr.max(by_error).max(lost)
    }

    /// Returns an error that states by how much the unchanged machine misses the target.
    fn check_reach(
        &self,
        target: &Target,
        views: &[View],
        machine: &str,
    ) -> std::result::Result<(), String> {
        if self.load_of(target) <= 1.0 {
            return Ok(());
        }
        let names = views
            .iter()
            .map(|view| view.name.as_str())
            .collect::<Vec<_>>()
            .join(", ");
        let lost = self
            .saturated
            .filter(|count| *count > 0)
            .map_or(String::new(), |count| {
                format!(", {count} words out of range")
            });
        let (psnr, error) = (decibels(self.psnr_db_of(target)), self.max_error_of(target));
        let reached = format!(
            "{machine} reaches {psnr} dB, {}, at most {error:.4} off{lost}",
            target.difference()
        );
        let method = method_psnr_db(views).filter(|_| target.against == Against::Ideal);
        let method = method.map_or(String::new(), |db| {
            format!("; golden − ideal alone is {db:.1} dB, and no word changes that")
        });
        Err(format!(
            "the target is out of reach: on {names} {reached}{method}"
        ))
    }
}

fn decibels(psnr_db: Option<f64>) -> String {
    match psnr_db {
        None => "equal".into(),
        Some(db) if db.is_finite() => format!("{db:.1}"),
        Some(_) => "no".into(),
    }
}

/// An area beside another one: `12.3% less`, `4.0% more`.
fn compared_area(area: f64, other: f64) -> String {
    let part = 100.0 * (area / other - 1.0);
    let than = if part > 0.0 { "more" } else { "less" };
    format!("{:.1}% {than}", part.abs())
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

/// Index of the view with the greatest load, the first one if several are equal; None without views.
fn deciding(found: &[SearchErrors], target: &Target) -> Option<usize> {
    let load = |nth: &usize| found[*nth].load_of(target);
    (0..found.len()).max_by(|a, b| load(a).total_cmp(&load(b)).then(b.cmp(a)))
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
    /// Different machines tried so far.
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
    /// Parts that no searched scene uses, and that were left as they are.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unused: Vec<String>,
    /// What was not tried because the time of `--budget` ended; left out if the search was finished.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stopped: Option<Stopped>,
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

/// End of a search by its budget of time.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Stopped {
    /// The budget, seconds.
    pub budget_seconds: f64,
    /// Round in which the search ended, from 1.
    pub round: usize,
    /// Stage in which it ended, unfinished.
    pub stage: String,
    /// Stages of this round that were not begun. A round after it may have been necessary too.
    pub not_tried: Vec<String>,
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
    /// equal or the machine cannot be built. With screening, the searched view on which it is
    /// measured misses the target, but need not be the worst.
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
                    .map(|member| View::new(of, member, machine).with_ideal()),
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
    let found = found_on(&views, |view| {
        Ok(drawn(&elaborated, view, &options.target)?.found)
    })?;
    found
        .check_reach(&options.target, &views, &machine.name)
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
    let selection = Selection::new(&options.only, domains.iter().map(Domain::scene));
    let named = knobs::all(
        machine,
        &Selection {
            unused: Vec::new(),
            ..selection.clone()
        },
    );
    if let Some(name) = options.only.iter().find(|name| {
        !named
            .iter()
            .any(|knob| machines::is_below(&knob.path, name))
    }) {
        return Err(Error::input(format!(
            "--only {name}: machine {} has no such unit, word or size",
            machine.name
        )));
    }
    let knobs = knobs::all(machine, &selection);
    if knobs.is_empty() && !named.is_empty() {
        return Err(Error::input(format!(
            "--only {}: no searched scene uses it, so that no picture would show that it is too narrow",
            options.only.join(", ")
        )));
    }
    let end = options.budget.map(|budget| Instant::now() + budget);
    // Fails before anything is written.
    let views = checked(domains, machine, options)?;
    let _open = Folder::open(folder)?;
    let mut journal = Journal::open(folder, "", columns_of(options))?;
    journal.keep();
    let names: Vec<String> = domains.iter().map(|domain| domain.label.clone()).collect();
    write_plan(
        folder,
        &json!({"splatsim": env!("CARGO_PKG_VERSION"), "search": options.target, "scenes": names, "machine": machine}),
    )?;
    let mut search = WordSearch::new(
        machine,
        (knobs, selection),
        domains,
        views,
        journal,
        options,
    );
    search.end = end;
    search.forecast();
    let mut so_far = SoFar {
        first_views: search.views.len(),
        ..SoFar::default()
    };
    let outcome = match rounds(&mut search, &mut so_far, names.clone()) {
        Err(_) if search.is_over => search.stopped(so_far, names)?,
        outcome => outcome?,
    };
    search.report_spent();
    search.write(outcome, folder)
}

/// What a search has found so far.
#[derive(Default)]
struct SoFar {
    first_views: usize,
    path: Vec<SearchStep>,
    learnt: Vec<String>,
    target_alone_area: Option<f64>,
}

/// Rounds until the target holds on unseen views.
fn rounds(
    search: &mut WordSearch,
    so_far: &mut SoFar,
    names: Vec<String>,
) -> Result<SearchOutcome> {
    let SoFar {
        first_views,
        path,
        learnt,
        target_alone_area,
    } = so_far;
    let options = search.options;
    search.find_splats();
    let none = vec![0; search.knobs.len()];
    search.check_reach()?;
    path.push(search.step(&search.base.name.clone(), &none)?);
    let mut next_view = 1;
    let mut steps: Option<Vec<u32>> = None;
    let mut failed_late: Option<(Vec<u32>, Machine)> = None;
    loop {
        search.round = learnt.len() + 1;
        let regained = match failed_late.take() {
            Some((steps, cut)) => search.regained(steps, cut, path)?,
            None => None,
        };
        let best = match regained {
            Some(regained) => regained,
            None => {
                let best = search.round(steps.as_deref(), path)?;
                steps = Some(best.clone());
                best
            }
        };
        // Integer bits take long. Unseen views are checked first, except in the first round, which
        // gives the area for the target only.
        let early = match target_alone_area {
            Some(_) => search.verified(&best, &mut next_view, EARLY)?.1,
            None => None,
        };
        let is_early = early.is_some();
        let (tried, (found, views)) = match early {
            Some(failed) => (best.clone(), failed),
            None => {
                let mut settled = search.last_steps(&best, path)?;
                let area = search.area(&settled.steps).unwrap_or(f64::INFINITY);
                let target_alone_area = *target_alone_area.get_or_insert(area);
                let (held, failed) = loop {
                    let verdict = search.verified(&settled.steps, &mut next_view, UNSEEN)?;
                    if verdict.1.is_some() {
                        break verdict;
                    }
                    match search.settled_again(&settled.steps, path)? {
                        Some(again) => settled = again,
                        None => break verdict,
                    }
                };
                let Settled {
                    steps: last,
                    alone,
                    together,
                    costly,
                } = settled;
                let area = search.area(&last).unwrap_or(f64::INFINITY);
                let Some(failed) = failed else {
                    let searched = search.drawn_again(&last)?;
                    let margin =
                        search.margin(&last, &searched[..*first_views], [target_alone_area, area]);
                    let claims = search.claims(&searched, &held);
                    let checked = CheckedSteps {
                        alone,
                        together,
                        costly,
                    };
                    let tight = search.critical(&last)?;
                    let machine = search.machine(&last);
                    return Ok(search.outcome(
                        names,
                        (std::mem::take(path), std::mem::take(learnt)),
                        held,
                        tight,
                        machine.unwrap_or_else(|| search.base.clone()),
                        (margin, claims, checked),
                    ));
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
        let mut load = found.load_of(&options.target);
        let mut widened = false;
        if is_early {
            (widened, load) = search.widened(&tried, &views, load)?;
        }
        // After the last steps, a view that fails by much shows what the others do not show: it is
        // only added to the search.
        let is_raised = is_early || load <= LATE;
        if learnt.len() >= PATIENCE && is_raised && load > 1.0 && load.is_finite() {
            search.stricter *= load.min(MOST_STRICTER);
        }
        let step = search.step("", &tried)?;
        // With its integer bits: the last steps were taken.
        if tried.len() > search.knobs.len() {
            failed_late = Some((tried.clone(), search.cut.clone()));
        }
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
    }
}

/// Unseen views with their errors, and the worst failing one with its nearby cameras.
type Verdict = (Vec<Unseen>, Option<(SearchErrors, Vec<View>)>);

/// A machine that was drawn in full, with which screened machines are compared.
struct Reference {
    key: String,
    load: f64,
    /// Number of views on which it was drawn.
    views: usize,
    machine: Machine,
    /// Squared error per tile of each view; empty if its row was written by an earlier process.
    tiles: Vec<Vec<f64>>,
}

/// How the load of a machine is found while machines are screened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
enum Way {
    /// [`Until::Likely`].
    #[default]
    Likely,
    /// [`Until::Rejected`].
    Rejected,
    /// [`Until::Compared`].
    Compared,
    /// [`Until::Sure`], and if that does not decide, as [`Way::InTurn`].
    Decided,
    /// The views in full, one after another, up to the first that misses the aim.
    InTurn,
}

impl Way {
    fn until(self) -> Option<Until> {
        match self {
            Way::Likely => Some(Until::Likely),
            Way::Rejected => Some(Until::Rejected),
            Way::Compared => Some(Until::Compared),
            Way::Decided => Some(Until::Sure),
            Way::InTurn => None,
        }
    }

    /// Whether views are drawn in full if no sample decides.
    fn is_exact(self) -> bool {
        matches!(self, Way::Decided | Way::InTurn)
    }
}

/// State of screening. It depends only on the requests so far, so that a search that goes on takes
/// the same decisions.
#[derive(Default)]
struct Screens {
    reference: Option<Reference>,
    /// Number of references so far.
    nth: u64,
    /// Keys of machines that were drawn in full.
    in_full: HashSet<String>,
    /// States taken by samples since the last reference.
    states: u32,
    way: Way,
    /// Rounds of giving steps back so far.
    repair: u32,
    /// Whether machines are drawn in full for now.
    is_off: bool,
}

/// Where the time went, seconds.
#[derive(Default)]
struct Spent {
    drawing: f64,
    screening: f64,
    comparing: f64,
    exact: f64,
}

/// State of a search.
struct WordSearch<'a> {
    domains: &'a [Domain],
    options: &'a SearchOptions,
    base: Machine,
    /// The base with fewer integer bits.
    cut: Machine,
    fields: Value,
    selection: Selection,
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
    screens: Screens,
    spent: Spent,
    prefetch: Prefetch,
    /// Factor by which the allowed squared error is less than the target's.
    stricter: f64,
    /// Least integer bits of words that saturated on a failing view.
    least_int_bits: BTreeMap<String, i32>,
    /// Integer bits that words of the base need on the cameras around and the first `measured` views.
    needed: BTreeMap<String, i32>,
    measured: usize,
    /// When the search began, and when it must end.
    start: Instant,
    end: Option<Instant>,
    /// Whether it had to end.
    is_over: bool,
    /// Round, from 1, and its stage.
    round: usize,
    stage: &'static str,
    /// The smallest machine that was drawn in full and meets the target on all searched views, and
    /// its area.
    best: Option<(Machine, f64)>,
    progress: Progress,
}

impl<'a> WordSearch<'a> {
    fn new(
        machine: &Machine,
        (knobs, selection): (Vec<Knob>, Selection),
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
            integers: knobs::integers(machine, &selection),
            selection,
            is_last: false,
            knobs,
            views,
            journal,
            known,
            areas: HashMap::new(),
            method: "",
            requested: HashSet::new(),
            screens: Screens::default(),
            spent: Spent::default(),
            prefetch: Prefetch::new(),
            stricter: 1.0,
            least_int_bits: BTreeMap::new(),
            needed: BTreeMap::new(),
            measured: 0,
            start: Instant::now(),
            end: None,
            is_over: false,
            round: 0,
            stage: STAGES[0],
            best: None,
            progress,
        }
    }

    /// Adds a view with its nearby cameras.
    fn learn(&mut self, views: Vec<View>) {
        self.views.extend(views);
        self.areas.clear();
        self.best = None;
        self.find_splats();
    }

    /// Finds the splats of each view's tiles, for samples.
    fn find_splats(&mut self) {
        let Ok(elaborated) = self.base.elaborate() else {
            return;
        };
        if !self.options.screens() {
            return;
        }
        for view in &mut self.views {
            if view.splats.is_none() {
                view.splats = TileSplats::of(&view.scene, &view.golden, &elaborated);
            }
        }
    }

    /// Checks that the base meets the target on all views. Limits the aim to what the base reaches.
    fn check_reach(&mut self) -> Result<()> {
        self.cut = self.base.clone();
        self.take_fields();
        let found = self.found(&vec![0; self.knobs.len()])?;
        let load = found.load_of(&self.options.target);
        // The scenes were checked before. A failure on a later view is an error of the job, not of
        // the input.
        found
            .check_reach(&self.options.target, &self.views, &self.base.name)
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
                lockstep: (self.options.target.metric == Metric::Lockstep).then(|| InLockstep {
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
            self.keep_drawn(key, found, &machine, Vec::new());
            return Ok(found);
        }
        self.check_time()?;
        let request = Request {
            target: self.options.target,
            screening: None,
            in_turn: None,
        };
        let measurement =
            self.prefetch
                .taken(&self.views, &request, (&key, &machine), &elaborated)?;
        self.drawn_in_full(key, &machine, &elaborated, measurement)
    }

    /// Adds the row of a machine that was drawn on all views; returns its errors.
    fn drawn_in_full(
        &mut self,
        key: String,
        machine: &Machine,
        elaborated: &Elaborated,
        measurement: Measurement,
    ) -> Result<SearchErrors> {
        self.spend(&measurement);
        let Measurement {
            found,
            tiles,
            seconds,
            ..
        } = measurement;
        let found = found.unwrap_or_else(|| Err("it was not measured".into()));
        let misfit = found.as_ref().err().cloned();
        let found = found.unwrap_or(UNUSABLE);
        self.keep_drawn(key.clone(), found, machine, tiles);
        let area = Cost::new(elaborated, &self.options.prices).area;
        let (point, scene) = (self.next_point(), self.view_names());
        let seen = misfit.is_none();
        let mut row: Row = vec![
            json!(point),
            json!(key),
            json!(scene),
            json!(self.changes(machine)),
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
        if self.options.screens() {
            row.extend([Value::Null, Value::Null, Value::Null, Value::Null]);
        }
        if self.options.target.metric == Metric::Lockstep {
            row.extend([
                json!(found.lockstep.and_then(|of| of.psnr_db)),
                json!(found.lockstep.map(|of| of.max_error)),
            ]);
        }
        self.store(key, row)?;
        self.report(area, found.psnr_db_of(&self.options.target));
        Ok(found)
    }

    fn spend(&mut self, measurement: &Measurement) {
        let Measurement {
            seconds,
            sampling,
            comparing,
            ..
        } = measurement;
        self.spent.drawing += seconds - sampling - comparing;
        self.spent.screening += sampling;
        self.spent.comparing += comparing;
    }

    /// Adds a row to the journal.
    fn store(&mut self, key: String, row: Row) -> Result<()> {
        let point = self.next_point();
        self.journal.push(point, row)?;
        self.known.insert(key, point);
        Ok(())
    }

    fn next_point(&self) -> u64 {
        let mut points = self.journal.rows().filter_map(|row| row[0].as_u64());
        points.next_back().map_or(0, |last| last + 1)
    }

    fn view_names(&self) -> String {
        let names: Vec<&str> = self.views.iter().map(|view| view.name.as_str()).collect();
        names.join(", ")
    }

    fn report(&mut self, area: f64, psnr_db: Option<f64>) {
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
            decibels(psnr_db)
        );
        self.progress.set_message(message);
        self.forecast_time();
    }

    /// Whether machines are screened now.
    fn screens(&self) -> bool {
        self.options.screens()
            && !self.screens.is_off
            && self.views.iter().all(|view| view.splats.is_some())
    }

    /// Keeps a machine that was drawn in full on all views. The next machines are compared with one
    /// near the target.
    fn keep_drawn(
        &mut self,
        key: String,
        found: SearchErrors,
        machine: &Machine,
        tiles: Vec<Vec<f64>>,
    ) {
        let load = self.load_of(&found);
        if found != UNUSABLE && found.load_of(&self.options.target) <= 1.0 {
            let area = self.area_of(machine).unwrap_or(f64::INFINITY);
            if self.best.as_ref().is_none_or(|(_, best)| area < *best) {
                self.best = Some((machine.clone(), area));
            }
        }
        self.screens.in_full.insert(key.clone());
        let [least, most] = REFERENCE_LOADS;
        let is_better = match &self.screens.reference {
            Some(reference) if reference.views == self.views.len() => {
                let distance = |load: f64| libm::log(load.max(f64::MIN_POSITIVE)).abs();
                reference.key != key
                    && ((least..=most).contains(&load) || distance(load) < distance(reference.load))
            }
            _ => load.is_finite(),
        };
        if is_better && load.is_finite() {
            self.screens.nth += 1;
            self.screens.states = 0;
            self.screens.reference = Some(Reference {
                key,
                load,
                views: self.views.len(),
                machine: machine.clone(),
                tiles,
            });
        }
    }

    /// What is measured of a machine that is screened; `None` if there is no reference to compare it
    /// with yet.
    fn request(&mut self, way: Way) -> Result<Option<Request>> {
        let stricter = self.stricter_by_samples();
        let nth = self.screens.nth;
        let target = self.options.target;
        let Some(reference) = &mut self.screens.reference else {
            return Ok(None);
        };
        if reference.tiles.is_empty() {
            // Its row was written by an earlier process.
            let elaborated = fixed::elaborate(&reference.machine)?;
            for view in &self.views {
                let drawn = drawn(&elaborated, view, &target)?;
                reference.tiles.push(drawn.tiles);
            }
        }
        let is_usable = reference.views == self.views.len()
            && reference.tiles.iter().all(|tiles| !tiles.is_empty());
        if !is_usable {
            return Ok(None);
        }
        let in_turn = || {
            let allowed = self.views.iter().map(|view| view.allowed(&target));
            InTurn {
                order: screen::hardest_first(allowed, &reference.tiles),
                stricter,
            }
        };
        Ok(Some(Request {
            target,
            screening: way.until().map(|until| Screening {
                reference: reference.tiles.clone(),
                stricter,
                nth,
                until,
            }),
            in_turn: way.is_exact().then(in_turn),
        }))
    }

    /// Key of a screened machine's row.
    fn screened_key(&self, key: &str) -> Option<String> {
        let reference = self.screens.reference.as_ref()?;
        let all = json!([
            key,
            reference.key,
            self.screens.nth,
            self.stricter_by_samples(),
            self.screens.way,
            self.options.target
        ]);
        Some(digest(all.to_string().as_bytes()))
    }

    /// The factor on the aim for estimates.
    fn stricter_by_samples(&self) -> f64 {
        self.stricter * libm::pow(REPAIR, f64::from(self.screens.repair))
    }

    /// A load, if the machine can be screened and was not drawn on all views. If it must be, it is.
    fn screened(&mut self, steps: &[u32]) -> Result<Option<f64>> {
        if !self.screens() {
            return Ok(None);
        }
        let Some((key, machine, elaborated)) = self.keyed(steps) else {
            return Ok(None);
        };
        let Some(own) = self.screened_key(&key) else {
            return Ok(None);
        };
        if self.screens.in_full.contains(&key) {
            return Ok(None);
        }
        let way = self.screens.way;
        let load = match self.known_load(&own) {
            Some(load) => load,
            // An earlier process drew it on all views, because samples did not decide.
            None if way.is_exact() && self.known.contains_key(&key) => return Ok(None),
            None => {
                self.check_time()?;
                let Some(request) = self.request(way)? else {
                    return Ok(None);
                };
                let measurement =
                    self.prefetch
                        .taken(&self.views, &request, (&own, &machine), &elaborated)?;
                if measurement.found.is_some() {
                    self.requested.insert(key.clone());
                    self.drawn_in_full(key, &machine, &elaborated, measurement)?;
                    return Ok(None);
                }
                self.spend(&measurement);
                let Measurement {
                    estimate, seconds, ..
                } = measurement;
                let Some(estimate) = estimate else {
                    return Ok(None);
                };
                let area = Cost::new(&elaborated, &self.options.prices).area;
                let psnr_db = self.psnr_db_at(estimate.load);
                let row: Row = vec![
                    json!(self.next_point()),
                    json!(own),
                    json!(self.view_names()),
                    json!(self.changes(&machine)),
                    json!(self.method),
                    Value::Null,
                    // An estimate is not a figure of the picture: it is in the last columns.
                    Value::Null,
                    Value::Null,
                    json!(method_psnr_db(&self.views)),
                    Value::Null,
                    Value::Null,
                    Value::Null,
                    json!(area),
                    json!(seconds),
                    json!(estimate.tiles),
                    json!(estimate.load),
                    json!(estimate.low),
                    json!(Some(estimate.high).filter(|high| high.is_finite())),
                ];
                self.store(own, row)?;
                self.requested.insert(key);
                self.report(area, psnr_db);
                estimate.load
            }
        };
        Ok(Some(load))
    }

    /// PSNR at a load; `None` if pictures are equal.
    fn psnr_db_at(&self, load: f64) -> Option<f64> {
        let wanted = self.options.target.psnr_db.filter(|_| load > 0.0)?;
        Some(wanted - 10.0 * libm::log10(load / self.stricter_by_samples()))
    }

    /// A screened machine's load according to its row.
    fn known_load(&self, key: &str) -> Option<f64> {
        let row = self.journal.get(*self.known.get(key)?)?;
        row.get(COLUMNS.len() + 1)?.as_f64()
    }

    /// A machine that meets the aim when it is drawn in full, from one that meets it by samples.
    fn met(&mut self, steps: Vec<u32>) -> Result<Vec<u32>> {
        if !self.screens() {
            return Ok(steps);
        }
        let (steps, is_met) = self.given_back_until_met(steps)?;
        if is_met {
            return Ok(steps);
        }
        self.screens.is_off = true;
        let met = descent::given_back(self, &steps);
        self.screens.is_off = false;
        met
    }

    fn by<T>(&mut self, way: Way, work: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        let before = std::mem::replace(&mut self.screens.way, way);
        let done = work(self);
        self.screens.way = before;
        done
    }

    fn given_back(&mut self, steps: &[u32]) -> Result<Vec<u32>> {
        self.by(Way::Compared, |search| descent::given_back(search, steps))
    }

    /// Takes steps away until each fails; by samples, in several passes.
    fn taken_away(&mut self, steps: &[u32]) -> Result<Vec<u32>> {
        if !self.screens() {
            return descent::taken_away(self, steps);
        }
        let mut steps = steps.to_vec();
        for _ in 0..PASSES {
            let down = self.by(Way::Rejected, |search| descent::taken_away(search, &steps))?;
            let down = self.met(down)?;
            if self.area(&down) >= self.area(&steps) {
                break;
            }
            steps = down;
        }
        Ok(steps)
    }

    /// Squared error of a machine as a part of the allowed squared error.
    fn load_of(&self, found: &SearchErrors) -> f64 {
        if *found == UNUSABLE {
            f64::INFINITY
        } else {
            found.load_of(&self.options.target) * self.stricter
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
        let mut needed = std::mem::take(&mut self.needed);
        let range = FIRST_RANGE_VIEW..FIRST_RANGE_VIEW + RANGE_VIEWS;
        let around = self.domains.iter().flat_map(|domain| {
            range
                .clone()
                .map(|nth| domain.nth(nth).map(|member| Cow::Owned(member.scene)))
        });
        // Ranges on the base do not change: only new views are measured.
        let is_first = self.measured == 0;
        let all = self.views[self.measured..]
            .iter()
            .map(|view| Ok(Cow::Borrowed(&view.scene)))
            .chain(around.filter(|_| is_first));
        for scene in all {
            if self.end.is_some_and(|end| Instant::now() >= end) {
                self.is_over = true;
                return Err(Error::job("the budget of time is over"));
            }
            let scene = scene?;
            needed_bits(&elaborated, &scene, &mut needed);
        }
        self.measured = self.views.len();
        self.needed.clone_from(&needed);
        for (word, bits) in &self.least_int_bits {
            needed
                .entry(word.clone())
                .and_modify(|needed| *needed = (*needed).max(*bits));
        }
        self.cut = self.base.clone();
        self.take_fields();
        let words = machines::words(&self.base)
            .into_iter()
            .filter(|(path, _)| self.selection.has(path));
        let less = |(path, format): (String, Format)| {
            let int_bits = (*needed.get(&path)?).max(format.least_int_bits());
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
        self.knobs = knobs::all(&self.cut, &self.selection);
        self.integers = knobs::integers(&self.cut, &self.selection);
        self.areas.clear();
    }

    /// One round: from the ranges to a machine that meets the target on all views. Fraction bits
    /// start from the previous round.
    fn round(&mut self, before: Option<&[u32]>, path: &mut Vec<SearchStep>) -> Result<Vec<u32>> {
        let none = vec![0; self.knobs.len()];
        self.begin("ranges");
        self.cut()?;
        path.push(self.step("integer bits by ranges", &none)?);
        let (well, ill) = match before {
            Some(before) => {
                let steps = before
                    .iter()
                    .zip(&self.knobs)
                    .map(|(steps, knob)| (*steps).min(knob.most));
                let steps: Vec<u32> = steps.collect();
                if self.screens() {
                    self.found(&steps)?;
                }
                (None, steps)
            }
            None => {
                self.begin("alone");
                self.find_reference()?;
                let limits = descent::limits(self)?;
                let (mut well, ill) = descent::starts(self, &limits)?;
                while self.screens() && well.iter().any(|steps| *steps > 0) {
                    let found = self.found(&well)?;
                    if self.load_of(&found) <= 1.0 {
                        break;
                    }
                    // It met the target only by a sample.
                    well.iter_mut()
                        .for_each(|steps| *steps = steps.saturating_sub(1));
                }
                (Some(well), ill)
            }
        };
        self.begin("min+1");
        let back = self.given_back(&ill)?;
        let back = self.met(back)?;
        path.push(self.step("min+1", &back)?);
        self.begin("max−1");
        let is_back_well = self.load(&back)? <= 1.0;
        let Some(well) = well else {
            // A round for an additional view.
            let down = self.taken_away(if is_back_well { &back } else { &none })?;
            path.push(self.step("max−1", &down)?);
            return Ok(down);
        };
        let down = self.taken_away(&well)?;
        path.push(self.step("max−1", &down)?);
        let best = if is_back_well && self.area(&back) < self.area(&down) {
            back
        } else {
            down
        };
        self.begin("annealing");
        let cold = descent::annealed(self, &best, self.options.seed, self.options.tries)?;
        let mut cold = self.met(cold)?;
        if self.area(&cold) > self.area(&best) {
            cold = best;
        }
        path.push(self.step("annealing", &cold)?);
        self.taken_away(&cold)
    }

    fn begin(&mut self, stage: &'static str) {
        (self.method, self.stage) = (stage, stage);
    }

    /// Draws a machine near the target in full, as the first reference: all words equally narrower.
    fn find_reference(&mut self) -> Result<()> {
        if !self.screens() {
            return Ok(());
        }
        let most: Vec<u32> = self.knobs.iter().map(|knob| knob.most).collect();
        let narrower =
            |steps: u32| -> Vec<u32> { most.iter().map(|most| steps.min(*most)).collect() };
        let [mut well, mut ill] = [0, most.iter().copied().max().unwrap_or(0) + 1];
        while ill - well > 1 {
            let middle = u32::midpoint(well, ill);
            *(if self.load(&narrower(middle))? <= 1.0 {
                &mut well
            } else {
                &mut ill
            }) = middle;
        }
        self.found(&narrower(well)).map(drop)
    }

    /// After a view has failed on a machine of the last steps, which were taken from `cut`: gives
    /// steps back until it meets the aim on that view too. Returns `None` if samples do not show
    /// which steps help, or none does.
    fn regained(
        &mut self,
        steps: Vec<u32>,
        cut: Machine,
        path: &mut Vec<SearchStep>,
    ) -> Result<Option<Vec<u32>>> {
        if !self.screens() {
            return Ok(None);
        }
        self.begin("min+1");
        self.cut = cut;
        self.take_fields();
        self.is_last = true;
        let regained = self.given_back_until_met(steps);
        self.is_last = false;
        let (regained, is_met) = regained?;
        if !is_met {
            return Ok(None);
        }
        path.push(self.step("min+1", &regained)?);
        Ok(Some(regained))
    }

    /// Gives steps back by samples until the machine meets the aim when it is drawn in full. Returns
    /// whether it does.
    fn given_back_until_met(&mut self, mut steps: Vec<u32>) -> Result<(Vec<u32>, bool)> {
        for repair in 0..REPAIRS {
            let found = self.found(&steps)?;
            if self.load_of(&found) <= 1.0 {
                return Ok((steps, true));
            }
            self.screens.repair = repair as u32;
            let back = self.given_back(&steps);
            self.screens.repair = 0;
            steps = back?;
        }
        Ok((steps, false))
    }

    /// Takes single and joint steps until none is left, including integer bits.
    fn last_steps(&mut self, from: &[u32], path: &mut Vec<SearchStep>) -> Result<Settled> {
        self.begin("last steps");
        self.is_last = true;
        let mut from = from.to_vec();
        from.resize(self.knobs.len() + self.integers.len(), 0);
        let settled = self.settled(from);
        self.is_last = false;
        let settled = settled?;
        path.push(self.step("last steps", &settled.steps)?);
        Ok(settled)
    }

    /// Removes the integer bits that no value on the searched views needs: their pictures stay the
    /// same.
    fn without_spare_bits(&mut self, from: Vec<u32>) -> Result<Vec<u32>> {
        let Some(machine) = self.machine(&from) else {
            return Ok(from);
        };
        self.check_time()?;
        let elaborated = fixed::elaborate(&machine)?;
        let mut needed = BTreeMap::new();
        for view in &self.views {
            needed_bits(&elaborated, &view.scene, &mut needed);
        }
        let formats: HashMap<String, Format> = machines::words(&machine).into_iter().collect();
        let spare = |knob: &Knob| -> Option<u32> {
            let bits = formats.get(&knob.path)?.int_bits - needed.get(&knob.path)?;
            u32::try_from(bits).ok()
        };
        let spare: Vec<(usize, u32)> = (self.knobs.len()..)
            .zip(&self.integers)
            .filter_map(|(place, knob)| Some((place, spare(knob)?.min(knob.most - from[place]))))
            .collect();
        let mut steps = from;
        // A word may hold values that do not show in ranges, such as a constant of the scene.
        let mut groups = vec![spare];
        while let Some(mut group) = groups.pop() {
            let mut next = steps.clone();
            for (place, bits) in &group {
                for _ in 0..*bits {
                    let mut less = next.clone();
                    less[*place] += 1;
                    if !descent::is_no_larger(self, &next, &less) {
                        break;
                    }
                    next = less;
                }
            }
            if next == steps {
                continue;
            }
            if self.by(Way::Decided, |search| search.load(&next))? <= 1.0 {
                steps = next;
            } else if group.len() > 1 {
                groups.push(group.split_off(group.len() / 2));
                groups.push(group);
            }
        }
        Ok(steps)
    }

    /// Takes steps together first, if samples tell how much harm each does; then settles.
    fn settled(&mut self, from: Vec<u32>) -> Result<Settled> {
        let mut from = self.without_spare_bits(from)?;
        if self.screens() {
            from = self.by(Way::Decided, |search| {
                descent::taken_together(search, &from)
            })?;
        }
        self.settled_exactly(&from)
    }

    fn settled_exactly(&mut self, from: &[u32]) -> Result<Settled> {
        self.by(Way::Decided, |search| descent::settled(search, from))
    }

    /// Draws each single step in full, on one view after another until one misses the aim. Takes
    /// those that meet the aim, although a sample rejected them. Returns `None` if there is none.
    fn settled_again(
        &mut self,
        steps: &[u32],
        path: &mut Vec<SearchStep>,
    ) -> Result<Option<Settled>> {
        if !self.screens() {
            return Ok(None);
        }
        let area = self.area(steps).unwrap_or(f64::INFINITY);
        let most: Vec<u32> = self.all_knobs().map(|knob| knob.most).collect();
        let mut single: Vec<Vec<u32>> = Vec::new();
        for knob in (0..most.len()).filter(|knob| steps[*knob] < most[*knob]) {
            let mut next = steps.to_vec();
            next[knob] += 1;
            if self.area(&next).is_some_and(|after| after <= area) {
                single.push(next);
            }
        }
        let loads = self.by(Way::InTurn, |search| descent::loads(search, &single))?;
        if !loads.iter().any(|load| *load <= 1.0) {
            return Ok(None);
        }
        self.is_last = true;
        let settled = self.settled_exactly(steps);
        self.is_last = false;
        let settled = settled?;
        path.push(self.step("last steps", &settled.steps)?);
        Ok(Some(settled))
    }

    /// Gives integer bits back to words that saturate on failing views, if that improves the views.
    /// Returns whether it does, and the new load.
    fn widened(&mut self, steps: &[u32], views: &[View], load: f64) -> Result<(bool, f64)> {
        let Some(machine) = self.machine(steps) else {
            return Ok((false, load));
        };
        let elaborated = fixed::elaborate(&machine)?;
        let mut needed = BTreeMap::new();
        for view in views {
            needed_bits(&elaborated, &view.scene, &mut needed);
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
        let found = found_on(views, |view| {
            Ok(drawn(&built, view, &self.options.target)?.found)
        })
        .unwrap_or(UNUSABLE);
        let then = found.load_of(&self.options.target);
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
        self.drawn_on_views(&self.machine(steps).unwrap_or_else(|| self.base.clone()))
    }

    fn drawn_on_views(&self, machine: &Machine) -> Result<Vec<SearchErrors>> {
        let elaborated = fixed::elaborate(machine)?;
        self.views
            .iter()
            .map(|view| Ok(drawn(&elaborated, view, &self.options.target)?.found))
            .collect()
    }

    /// Cost of the unseen views; `areas` are those for the target only, and of the final machine.
    fn margin(&self, steps: &[u32], on_first: &[SearchErrors], areas: [f64; 2]) -> Margin {
        let machine = self.machine(steps).unwrap_or_else(|| self.base.clone());
        self.margin_of(&machine, on_first, areas)
    }

    fn margin_of(
        &self,
        machine: &Machine,
        on_first: &[SearchErrors],
        [alone, found]: [f64; 2],
    ) -> Margin {
        let target = &self.options.target;
        let formats: HashMap<String, Format> = machines::words(machine).into_iter().collect();
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
    fn verified(
        &mut self,
        steps: &[u32],
        next: &mut usize,
        stage: &'static str,
    ) -> Result<Verdict> {
        self.stage = stage;
        let from = *next;
        *next += self.options.views;
        let Some(machine) = self.machine(steps) else {
            return Ok((Vec::new(), None));
        };
        let elaborated = fixed::elaborate(&machine)?;
        let target = &self.options.target;
        let mut held: Vec<Unseen> = Vec::new();
        let mut taken: Vec<(usize, Camera)> = Vec::new();
        let mut worst: Option<(f64, Vec<Option<Drawn>>, Vec<View>)> = None;
        let mut pictures: Vec<(usize, usize, usize, Option<Picture>)> = Vec::new();
        for (of, domain) in self.domains.iter().enumerate() {
            for nth in from..from + self.options.views {
                let member = domain.nth(nth)?;
                self.check_time()?;
                let (name, camera) = (member.name.clone(), member.scene.camera);
                let searched = self.views.iter().map(|view| (view.of, view.scene.camera));
                // A short list of cameras repeats.
                if searched
                    .chain(taken.iter().copied())
                    .any(|seen| seen == (of, camera))
                {
                    continue;
                }
                // The picture of `ideal` is drawn only if its figures are reported.
                let view = |member: Member| match target.against {
                    Against::Golden => View::new(of, member, &machine),
                    Against::Ideal => View::new(of, member, &machine).with_ideal(),
                };
                let (views, seconds) = timed(|| -> Vec<View> {
                    let near = member.and_nearby(self.options.robust);
                    near.into_iter().map(view).collect()
                });
                self.spent.exact += seconds;
                let mut all: Vec<Option<Drawn>> = views
                    .iter()
                    .map(|view| drawn(&elaborated, view, target).ok())
                    .collect();
                let errors = |drawn: &Option<Drawn>| drawn.as_ref().map_or(UNUSABLE, |d| d.found);
                let each: Vec<SearchErrors> = all.iter().map(errors).collect();
                let found = worst_of(&each);
                let load = found.load_of(target);
                self.progress
                    .set_message(format!("{name}: {} dB", decibels(found.psnr_db_of(target))));
                taken.push((of, camera));
                // The deciding one of the nearby cameras is recorded, with its errors.
                let decides = deciding(&each, target).unwrap_or(0);
                let (name, camera) = (views[decides].name.clone(), views[decides].scene.camera);
                held.push(Unseen {
                    of,
                    name,
                    eye: camera.eye.to_array(),
                    camera,
                    found: each[decides],
                });
                if load > 1.0 && worst.as_ref().is_none_or(|(most, ..)| load > *most) {
                    worst = Some((load, all, views));
                } else {
                    let picture = all.swap_remove(decides).map(|drawn| drawn.picture);
                    pictures.push((of, nth, decides, picture));
                }
            }
        }
        if let Some((_, all, views)) = worst {
            let views: Vec<View> = views.into_iter().map(View::with_ideal).collect();
            let compared = |(drawn, view): (Option<Drawn>, &View)| {
                let drawn = drawn.and_then(|drawn| drawn.compared(view, target).ok());
                drawn.map_or(UNUSABLE, |drawn| drawn.found)
            };
            let found: Vec<SearchErrors> = all.into_iter().zip(&views).map(compared).collect();
            return Ok((held, Some((worst_of(&found), views))));
        }
        let is_missing = target.against == Against::Golden;
        for (unseen, (of, nth, decides, picture)) in held.iter_mut().zip(pictures) {
            let Some(picture) = picture.filter(|_| is_missing) else {
                continue;
            };
            let near = self.domains[of].nth(nth)?.and_nearby(self.options.robust);
            let (ideal, seconds) = timed(|| golden::ideal(&near[decides].scene).picture);
            self.spent.exact += seconds;
            let whole = distance(&picture, &ideal);
            unseen.found.fixed_vs_ideal_psnr_db = whole.psnr_db;
            unseen.found.fixed_vs_ideal_max_error = whole.max_error;
        }
        Ok((held, None))
    }

    /// Words and sizes that are critical for the target.
    fn critical(&mut self, steps: &[u32]) -> Result<Vec<CriticalWord>> {
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
        self.by(Way::InTurn, |search| search.prefetch(&all))?;
        for knob in open {
            let Some(psnr_db) = self.psnr_db_that_fails(&lesser(knob))? else {
                continue;
            };
            let knob = &knobs[knob];
            tight.push(CriticalWord {
                path: knob.path.clone(),
                value: knob.value(&fields),
                part: knob.part,
                psnr_db,
            });
        }
        let worth = |tight: &CriticalWord| tight.psnr_db.unwrap_or(f64::INFINITY);
        tight.sort_by(|a, b| worth(a).total_cmp(&worth(b)));
        Ok(tight)
    }

    /// PSNR of a machine that misses the target: on the first view that misses it in turn, else on
    /// the worst. `None` if the machine meets the target, or cannot be built.
    fn psnr_db_that_fails(&mut self, steps: &[u32]) -> Result<Option<Option<f64>>> {
        let target = self.options.target;
        // Else the load does not tell the PSNR.
        if target.max_error.is_none() {
            let load = self.by(Way::InTurn, |search| search.screened(steps))?;
            if let Some(load) = load.filter(|load| *load > self.stricter) {
                return Ok(Some(self.psnr_db_at(load)));
            }
        }
        let found = self.found(steps)?;
        let fails = found != UNUSABLE && found.load_of(&target) > 1.0;
        Ok(fails.then(|| found.psnr_db_of(&target)))
    }

    fn outcome(
        &self,
        scenes: Vec<String>,
        (path, learnt): (Vec<SearchStep>, Vec<String>),
        views: Vec<Unseen>,
        tight: Vec<CriticalWord>,
        machine: Machine,
        (margin, claims, checked): (Margin, Vec<Claim>, CheckedSteps),
    ) -> SearchOutcome {
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
        let machine = Machine { name, ..machine };
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
        SearchOutcome {
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
            unused: self.selection.left_out(&self.base),
            stopped: None,
            machine,
            searched,
            files: Vec::new(),
        }
    }

    /// The outcome of a search whose time is over: the best machine so far that was drawn in full on
    /// the searched views.
    fn stopped(&mut self, so_far: SoFar, scenes: Vec<String>) -> Result<SearchOutcome> {
        // The rest takes one drawing per view.
        self.end = None;
        let (machine, area) = match self.best.take() {
            Some(best) => best,
            None => (
                self.base.clone(),
                self.area_of(&self.base).unwrap_or(f64::INFINITY),
            ),
        };
        let searched = self.drawn_on_views(&machine)?;
        let SoFar {
            first_views,
            mut path,
            learnt,
            target_alone_area,
        } = so_far;
        path.push(SearchStep {
            method: "best so far".into(),
            area,
            found: worst_of(&searched),
            drawn: self.requested.len() as u64,
        });
        let alone = target_alone_area.unwrap_or(area);
        let margin = self.margin_of(&machine, &searched[..first_views], [alone, area]);
        let claims = self.claims(&searched, &[]);
        let stages = match self.round {
            0 | 1 => STAGES.to_vec(),
            _ => LATER_STAGES.to_vec(),
        };
        let at = stages.iter().position(|stage| *stage == self.stage);
        let stopped = Stopped {
            budget_seconds: self
                .options
                .budget
                .map_or(0.0, |budget| budget.as_secs_f64()),
            round: self.round.max(1),
            stage: self.stage.into(),
            not_tried: stages[at.map_or(0, |at| at + 1)..]
                .iter()
                .map(|stage| (*stage).to_owned())
                .collect(),
        };
        let outcome = self.outcome(
            scenes,
            (path, learnt),
            Vec::new(),
            Vec::new(),
            machine,
            (margin, claims, CheckedSteps::default()),
        );
        Ok(SearchOutcome {
            stopped: Some(stopped),
            ..outcome
        })
    }

    /// Fails if the time of the budget is over.
    fn check_time(&mut self) -> Result<()> {
        if self.end.is_some_and(|end| Instant::now() >= end) {
            self.is_over = true;
            return Err(Error::job("the budget of time is over"));
        }
        Ok(())
    }

    /// Machines that the first round is expected to try: about twice the bits of every word and size
    /// by bisection, and each word a few times in the other stages.
    fn expected(&self) -> u64 {
        let halvings: u32 = self
            .knobs
            .iter()
            .map(|knob| (knob.most + 1).ilog2() + 1)
            .sum();
        let knobs = self.knobs.len() as u64;
        u64::from(halvings) + 6 * knobs + self.options.tries + 3 * self.integers.len() as u64
    }

    fn forecast(&self) {
        let per_view = 3 * self.knobs.len() as u64;
        self.progress.note(&format!(
            "about {} machines in the first round; about {} more per unseen view that fails",
            thousands(self.expected()),
            thousands(per_view)
        ));
    }

    /// Prints how long the first round will take, once a few machines were tried.
    fn forecast_time(&mut self) {
        if self.requested.len() == FORECAST_AFTER {
            let each = self.start.elapsed().as_secs_f64() / FORECAST_AFTER as f64;
            self.progress.note(&format!(
                "{FORECAST_AFTER} machines took {}; the first round takes about {}",
                duration(self.start.elapsed().as_secs_f64()),
                duration(each * self.expected() as f64)
            ));
        }
    }

    fn report_spent(&self) {
        let Spent {
            drawing,
            screening,
            comparing,
            exact,
        } = self.spent;
        let other = self.start.elapsed().as_secs_f64() - drawing - screening - comparing - exact;
        self.progress.note(&format!(
            "time: {} for drawings in full, {} for samples, {} for comparisons, {} for exact pictures \
             of unseen views, {} for the rest",
            duration(drawing),
            duration(screening),
            duration(comparing),
            duration(exact),
            duration(other.max(0.0))
        ));
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
            let nth = deciding(found, target)?;
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
        if let Some(load) = self.screened(steps)? {
            return Ok(load);
        }
        let found = self.found(steps)?;
        Ok(self.load_of(&found))
    }

    fn load_without_margin(&mut self, steps: &[u32]) -> Result<f64> {
        if let Some(load) = self.screened(steps)? {
            return Ok(load / self.stricter_by_samples());
        }
        let found = self.found(steps)?;
        Ok(if found == UNUSABLE {
            f64::INFINITY
        } else {
            found.load_of(&self.options.target)
        })
    }

    fn is_gradual(&self, knob: usize) -> bool {
        knob < self.knobs.len()
    }

    fn compared(&mut self, all: &[Vec<u32>]) -> Result<Vec<f64>> {
        self.by(Way::Compared, |search| descent::loads(search, all))
    }

    fn took(&mut self, steps: &[u32]) -> Result<Option<f64>> {
        if !self.screens() {
            return Ok(None);
        }
        self.screens.states += 1;
        // The last steps end in the machine that is reported: a sample only rejects there.
        if self.screens.states < STATES_PER_REFERENCE && self.screens.way != Way::Decided {
            return Ok(None);
        }
        self.screens.states = 0;
        let found = self.found(steps)?;
        Ok(Some(self.load_of(&found)))
    }

    fn width(&self) -> usize {
        self.prefetch.width()
    }

    fn prefetch(&mut self, steps: &[Vec<u32>]) -> Result<()> {
        if self.width() == 1 {
            return Ok(());
        }
        let request = match self.screens() {
            true => self.request(self.screens.way)?,
            false => None,
        };
        let is_screened = request.is_some();
        let mut machines: Vec<(String, Machine)> = Vec::new();
        for (key, machine, _) in steps.iter().filter_map(|steps| self.keyed(steps)) {
            if self.screens.in_full.contains(&key) {
                continue;
            }
            let key = match self.screened_key(&key) {
                Some(own) if is_screened => own,
                _ => key,
            };
            if !self.known.contains_key(&key) && !machines.iter().any(|(other, _)| *other == key) {
                machines.push((key, machine));
            }
        }
        let request = request.unwrap_or(Request {
            target: self.options.target,
            screening: None,
            in_turn: None,
        });
        self.prefetch.measure(&self.views, &request, &machines)
    }

    fn prefetched(&self, steps: &[u32]) -> Option<f64> {
        let Some((key, ..)) = self.keyed(steps) else {
            return Some(f64::INFINITY);
        };
        let measured = |key: &str| {
            let measured = self.prefetch.get(key)?.found.as_ref()?;
            Some(self.load_of(&measured.clone().unwrap_or(UNUSABLE)))
        };
        if self.screens()
            && !self.screens.in_full.contains(&key)
            && let Some(own) = self.screened_key(&key)
        {
            let estimate = || Some(self.prefetch.get(&own)?.estimate?.load);
            let known = self.known_load(&own).or_else(estimate);
            return known.or_else(|| measured(&own));
        }
        let known = self.known(&key).map(|found| self.load_of(&found));
        known.or_else(|| measured(&key))
    }
}

/// Integer bits that words of a machine need on a scene, so that none leaves its range; the most over
/// all calls. Nothing if it cannot hold the scene.
fn needed_bits(elaborated: &Elaborated, scene: &Scene, needed: &mut BTreeMap<String, i32>) {
    let Ok(quantised) = quantise(scene, &elaborated.machine) else {
        return;
    };
    let (_, ranges, _) = fixed::draw_measured(elaborated, &quantised);
    for (signal, range) in elaborated.signals.iter().zip(&ranges.0) {
        if let Some(narrowest) = range.narrowest(signal.word.format) {
            let bits = needed
                .entry(format!("{}.{}", signal.unit, signal.name))
                .or_insert(i32::MIN);
            *bits = (*bits).max(narrowest.int_bits);
        }
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

/// A view that was drawn and compared.
struct Drawn {
    found: SearchErrors,
    /// Squared error per tile.
    tiles: Vec<f64>,
    picture: Picture,
    saturated: Option<u64>,
    lockstep: Option<InLockstep>,
    /// Seconds for comparisons.
    comparing: f64,
}

impl Drawn {
    /// Compares again, if the view has its ideal picture only now.
    fn compared(self, view: &View, target: &Target) -> Result<Drawn> {
        let Drawn {
            picture,
            saturated,
            lockstep,
            ..
        } = self;
        compared(picture, view, target, saturated, lockstep)
    }
}

/// Draws a view and compares.
fn drawn(elaborated: &Elaborated, view: &View, target: &Target) -> Result<Drawn> {
    let evaluation = Evaluation::on(&view.scene, elaborated)?;
    let (picture, saturated) = if target.no_saturation {
        let observed = evaluation.observe();
        let lost = observed.overflows().total();
        (observed.picture, Some(lost))
    } else {
        (evaluation.picture(&evaluation.draw()), None)
    };
    let led = (target.metric == Metric::Lockstep).then(|| evaluation.lockstep().summary(&picture));
    if led.is_some_and(|led| led.not_finite > 0) {
        return Err(not_finite(view, led.map_or(0, |led| led.not_finite)));
    }
    let lockstep = led.map(|led| InLockstep {
        psnr_db: led.psnr_db,
        max_error: led.max_error,
    });
    compared(picture, view, target, saturated, lockstep)
}

fn not_finite(view: &View, pixels: u64) -> Error {
    Error::job(format!(
        "{}: {pixels} pixels have no finite number, and meet no target",
        view.name
    ))
}

fn compared(
    picture: Picture,
    view: &View,
    target: &Target,
    saturated: Option<u64>,
    lockstep: Option<InLockstep>,
) -> Result<Drawn> {
    let ((apart, whole, tiles), comparing) = timed(|| {
        (
            distance(&picture, &view.golden),
            view.ideal.as_ref().map(|ideal| distance(&picture, ideal)),
            (view.exact(target)).map_or(Vec::new(), |exact| screen::tile_errors(&picture, exact)),
        )
    });
    let pixels = apart
        .not_finite
        .max(whole.map_or(0, |whole| whole.not_finite));
    if pixels > 0 {
        return Err(not_finite(view, pixels));
    }
    Ok(Drawn {
        found: SearchErrors {
            psnr_db: apart.psnr_db,
            max_error: apart.max_error,
            fixed_vs_ideal_psnr_db: whole.and_then(|whole| whole.psnr_db),
            fixed_vs_ideal_max_error: whole.map_or(0.0, |whole| whole.max_error),
            saturated,
            lockstep,
        },
        tiles,
        picture,
        saturated,
        lockstep,
        comparing,
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
        _ if base != now => changes.push(format!("{path}={}", plain(now))),
        _ => {}
    }
}

/// Most critical words in the summary.
const MOST_CRITICAL: usize = 8;

impl Stopped {
    fn text(&self) -> String {
        let Stopped {
            budget_seconds,
            round,
            stage,
            not_tried,
        } = self;
        let mut text = format!(
            "the budget of {} ended in round {round}, during {stage}: the machine is the best so far that was drawn in full",
            duration(*budget_seconds)
        );
        if !not_tried.is_empty() {
            let _ = write!(text, "; not tried: {}", not_tried.join(", "));
        }
        text
    }
}

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
        let mut size = format!(
            "{}: {} LUT equivalents, {} than {}",
            self.machine.name,
            thousands(last.area as u64),
            compared_area(last.area, first.area),
            self.base
        );
        let reference = Machine::named("reference").and_then(|machine| machine.elaborate().ok());
        if let Some(reference) = reference.filter(|_| self.base != "reference") {
            let whole = Cost::new(&reference, &Prices::default()).area;
            let _ = write!(size, ", {} than reference", compared_area(last.area, whole));
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
            count => format!(
                "holds on {}{worst}",
                counted(count as u64, "unseen view", "unseen views")
            ),
        };
        let _ = write!(text, "\n{}", wrapped(&views));
        if !self.unused.is_empty() {
            let unused = format!(
                "no searched scene uses {}: its words and sizes were left as they are",
                self.unused.join(", ")
            );
            let _ = write!(text, "\n{}", wrapped(&unused));
        }
        if let Some(stopped) = &self.stopped {
            let _ = write!(text, "\n{}", wrapped(&stopped.text()));
        }
        for sentence in self.margin_text() {
            let _ = write!(text, "\n{}", wrapped(&sentence));
        }
        if self.stopped.is_none() {
            let _ = write!(text, "\n{}", wrapped(&self.checked_text()));
        }
        let tight = self.tight.iter().take(MOST_CRITICAL).map(|tight| {
            let value = plain(&tight.value);
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
        if self.stopped.is_some() {
            return Vec::new();
        }
        if self.learnt.is_empty() {
            return vec!["no unseen view failed, so no area was added for unseen views".into()];
        }
        let part = compared_area(target_alone_area + area, *target_alone_area);
        let mut cost = format!("holding on unseen views takes {part} area");
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

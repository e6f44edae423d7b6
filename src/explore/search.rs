//! Search: the narrowest machine that meets a target on a scene, and on cameras that it was not
//! made for.
//!
//! ```text
//! scenes ─► ranges ─► integer bits cut ─► fraction bits, tables ─( min+1, max−1, annealing )─► machine ─► unseen views
//!             ▲                                                                                              │ one fails
//!             └──────────────────────────── that view is looked at from now on ◄─────────────────────────────┘
//! ```
//! Every machine that is drawn is a row of a journal, as in `sweep`: a search that is cut off goes
//! on where it was, and `chart` draws what it met. What it finds depends on the seed alone.
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
use crate::explore::sweep::table::{Column, Journal, Kind, Row, named};
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
use crew::{Foresight, Measured};
use descent::{Problem, Settled};
pub use domain::{Domain, Member};
use knobs::{Knob, Part};
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

/// Options of a search.
#[derive(Clone, Debug)]
pub struct Options {
    /// Target.
    pub target: Target,
    /// Unseen cameras that must hold too.
    pub views: usize,
    /// Every view counts as the worst of so many cameras less than a pixel apart: a flip is luck.
    pub robust: usize,
    /// Another seed, another annealing.
    pub seed: u64,
    /// Machines that annealing draws.
    pub tries: u64,
    /// Only these units, words or sizes; all where empty.
    pub only: Vec<String>,
    /// Prices of bits.
    pub prices: Prices,
    /// Show how far it is.
    pub progress: bool,
}

/// Rounds, each with another view, before it is given up.
const ROUNDS: usize = 12;
/// Cameras beside the views that ranges are read from, a scene: a word that overflows on another
/// camera spoils its whole picture.
const RANGE_VIEWS: usize = 16;
/// The first of them; unseen views come long before.
const FIRST_RANGE_VIEW: usize = 1_000_000;
/// Views that fail and raise no aim: they are searched on from then on, and later ones raise the
/// aim too.
const PATIENCE: usize = 3;
/// By how much a view that fails makes the aim higher, squared error, at most: 3 dB.
const MOST_STRICTER: f64 = 2.0;

const COLUMNS: [(&str, Kind); 14] = [
    ("point", Kind::Whole),
    ("key", Kind::Text),
    ("scene", Kind::Text),
    ("changes", Kind::Text),
    ("method", Kind::Text),
    ("misfit", Kind::Text),
    ("psnr_db", Kind::Number),
    ("max_error", Kind::Number),
    ("golden_vs_ideal_psnr_db", Kind::Number),
    ("fixed_vs_ideal_psnr_db", Kind::Number),
    ("fixed_vs_ideal_max_error", Kind::Number),
    ("saturated", Kind::Whole),
    ("area", Kind::Number),
    ("host_seconds", Kind::Number),
];

/// Columns of a search in lockstep, behind those.
const LOCKSTEP_COLUMNS: [(&str, Kind); 2] = [
    (columns::LOCKSTEP_PSNR_DB, Kind::Number),
    (columns::LOCKSTEP_MAX_ERROR, Kind::Number),
];

fn columns_of(target: &Target) -> Vec<Column> {
    let more: &[_] = if target.metric == Metric::Lockstep {
        &LOCKSTEP_COLUMNS
    } else {
        &[]
    };
    named(&[&COLUMNS, more].concat())
}

/// A scene as one camera sees it.
#[derive(Serialize, Deserialize)]
struct View {
    /// Which domain it is of.
    of: usize,
    name: String,
    scene: Scene,
    golden: Picture,
    ideal: Picture,
    /// The method's error, which no word changes.
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

    /// Without the scene.
    fn short_name(&self) -> &str {
        self.name.rsplit(" from ").next().unwrap_or_default()
    }
}

/// Distance of a machine from the target.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Found {
    /// Least, fixed − golden; none where pictures are equal.
    pub psnr_db: Option<f64>,
    /// Greatest, fixed − golden.
    pub max_error: f64,
    /// Least, fixed − ideal; none where pictures are equal.
    pub fixed_vs_ideal_psnr_db: Option<f64>,
    /// Greatest, fixed − ideal.
    pub fixed_vs_ideal_max_error: f64,
    /// Words that left their range; none where nobody looked.
    pub saturated: Option<u64>,
    /// Against golden that the machine's decisions lead; none where nobody looked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lockstep: Option<InLockstep>,
}

/// Rounding alone, without flips.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct InLockstep {
    /// Least; none where pictures are equal.
    pub psnr_db: Option<f64>,
    /// Greatest.
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

impl Found {
    fn and(self, other: Found) -> Found {
        Found {
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

    /// Decibels as a target measures them; none where pictures are equal.
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

/// The lesser of two PSNRs; none is that of equal pictures.
fn least(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
    }
}

/// The method's error on the worst of some views.
fn method_psnr_db(views: &[View]) -> Option<f64> {
    views
        .iter()
        .map(|view| view.golden_vs_ideal_psnr_db)
        .fold(None, least)
}

/// How far a machine is off on all of some views.
fn found_on<'v>(
    views: impl IntoIterator<Item = &'v View>,
    drawn: impl Fn(&View) -> Result<Found>,
) -> Result<Found> {
    Ok(worst_of(
        &views
            .into_iter()
            .map(drawn)
            .collect::<Result<Vec<Found>>>()?,
    ))
}

/// The worst of each figure.
fn worst_of(found: &[Found]) -> Found {
    found.iter().copied().reduce(Found::and).unwrap_or_default()
}

impl Target {
    /// Says where a machine misses the target as it is.
    fn check_reach(
        &self,
        found: &Found,
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

    /// The view with the greatest load, the first of equals; none of none.
    fn deciding(&self, found: &[Found]) -> Option<usize> {
        let load = |nth: &usize| self.load(&found[*nth]);
        (0..found.len()).max_by(|a, b| load(a).total_cmp(&load(b)).then(b.cmp(a)))
    }

    /// Part of what is allowed, squared: at most 1 is well.
    fn load(&self, found: &Found) -> f64 {
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

/// A step of the way.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Step {
    /// Method.
    pub method: String,
    /// Area that came of it, LUT equivalents.
    pub area: f64,
    #[serde(flatten)]
    found: Found,
    /// Different machines asked for until then, each drawn once.
    pub drawn: u64,
}

/// Findings.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Outcome {
    /// The scenes.
    pub scenes: Vec<String>,
    /// Target that was given.
    pub target: Target,
    /// The machine that was narrowed.
    pub base: String,
    /// The way.
    pub path: Vec<Step>,
    /// Unseen views.
    pub views: Vec<Unseen>,
    /// Views that failed, and were looked at from then on.
    pub learnt: Vec<String>,
    /// Cameras that were searched on: the scenes' own, then those of `learnt`.
    pub cameras: Vec<Searched>,
    /// Words that are critical for the target: with a step less some view that was searched on
    /// misses it. The worst first.
    pub tight: Vec<CriticalWord>,
    /// Figures that are stated, and the cameras that decide them.
    pub claims: Vec<Claim>,
    /// What unseen views cost.
    pub margin: Margin,
    /// Steps that were measured on the machine that was found, all of which miss the aim.
    pub checked: Checked,
    /// The machine.
    pub machine: Machine,
    /// For what it was searched, as its file says.
    pub searched: SearchRecord,
    /// Files that were written.
    #[serde(skip)]
    pub files: Vec<PathBuf>,
}

/// What unseen views cost: the machine that was found, against the narrowest one that meets the
/// target on the views that were searched on at first.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Margin {
    /// Decibels above the target that every view that was searched on had to reach; 0 where the aim
    /// is the target.
    pub aim_db: f64,
    /// Least decibels of the machine on the views that were searched on at first; none where
    /// pictures are equal.
    pub first_psnr_db: Option<f64>,
    /// Those decibels above the target's; none where the target has none, or pictures are equal.
    pub db: Option<f64>,
    /// Area of the narrowest machine that meets the target on those views, LUT equivalents.
    pub target_alone_area: f64,
    /// Area that the found machine takes more, LUT equivalents.
    pub area: f64,
    /// Words that got integer bits back because they saturated on a view that failed.
    pub widened: Vec<String>,
}

/// Steps that cannot be taken from the machine that was found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Checked {
    /// Words and sizes of which a step less was drawn: each misses the aim.
    pub alone: usize,
    /// Joint steps of words that are not critical for the target: each misses the aim.
    pub together: usize,
    /// Words and sizes of which a step less takes more area.
    pub costly: usize,
}

/// A view that was not searched on.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Unseen {
    /// Which domain it is of.
    #[serde(skip)]
    of: usize,
    /// Scene and number.
    pub name: String,
    /// Where its eye is.
    pub eye: [f64; 3],
    /// The whole camera, as a scene file has it.
    pub camera: Camera,
    #[serde(flatten)]
    found: Found,
}

/// A view that was searched on.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Searched {
    /// Scene, or scene and number.
    pub name: String,
    /// The whole camera, as a scene file has it.
    pub camera: Camera,
}

/// A step that cannot be taken.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct CriticalWord {
    /// Where.
    pub path: String,
    /// Value.
    pub value: Value,
    /// What a step takes away.
    pub part: Part,
    /// Decibels with a step less, against what the target names; none where the pictures are equal
    /// or it cannot be built.
    pub psnr_db: Option<f64>,
}

/// Searches on scenes from all around, each from the distance of its own camera.
///
/// # Errors
/// As [`run_on`].
pub fn run(
    scenes: &[Scene],
    machine: &Machine,
    folder: &Path,
    options: &Options,
) -> Result<Outcome> {
    let domains: Vec<Domain> = scenes.iter().cloned().map(Domain::around).collect();
    run_on(&domains, machine, folder, options)
}

/// What is searched on at first, with the cameras beside each.
fn first_views(domains: &[Domain], machine: &Machine, options: &Options) -> Result<Vec<View>> {
    let mut views = Vec::new();
    for (of, domain) in domains.iter().enumerate() {
        for member in domain.first() {
            quantise(&member.scene, machine)?;
            views.extend(
                member
                    .and_beside(options.robust)
                    .into_iter()
                    .map(|member| View::new(of, member, machine)),
            );
        }
    }
    Ok(views)
}

/// Refuses a target that the machine as it is misses on what is searched on at first.
///
/// # Errors
/// [`Error::Input`] where it does.
pub fn check(domains: &[Domain], machine: &Machine, options: &Options) -> Result<()> {
    checked(domains, machine, options).map(drop)
}

fn checked(domains: &[Domain], machine: &Machine, options: &Options) -> Result<Vec<View>> {
    let elaborated = fixed::elaborate(machine)?;
    let views = first_views(domains, machine, options)?;
    let found = found_on(&views, |view| drawn(&elaborated, view, &options.target))?;
    options
        .target
        .check_reach(&found, &views, &machine.name)
        .map_err(Error::input)?;
    Ok(views)
}

/// Searches.
///
/// # Errors
/// [`Error::Input`] where the target cannot be met by the machine as it is, or the folder is of
/// something else; [`Error::Job`] where what is found cannot be written, or holds on no unseen
/// view.
pub fn run_on(
    domains: &[Domain],
    machine: &Machine,
    folder: &Path,
    options: &Options,
) -> Result<Outcome> {
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
    // Before anything is written.
    let views = checked(domains, machine, options)?;
    let _open = Folder::open(folder)?;
    let mut journal = Journal::open(folder, "", columns_of(&options.target))?;
    journal.keep();
    let names: Vec<String> = domains.iter().map(|domain| domain.label.clone()).collect();
    write_plan(
        folder,
        &json!({"splatsim": env!("CARGO_PKG_VERSION"), "search": options.target, "scenes": names, "machine": machine}),
    )?;
    let mut search = Search::new(machine, knobs, domains, views, journal, options);
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
        // Integer bits take long: unseen views come before them, but for the first round, which
        // tells what the target alone takes.
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
                    let checked = Checked {
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
        // What fails only after the last steps is mended by searching on the view too.
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
        path.push(Step {
            method,
            found,
            ..step
        });
        steps = Some(best);
    }
}

/// Views with what was found there, and the worst that fails with the cameras beside it.
type Verdict = (Vec<Unseen>, Option<(Found, Vec<View>)>);

/// What is known.
struct Search<'a> {
    domains: &'a [Domain],
    options: &'a Options,
    base: Machine,
    /// The base with integer bits cut.
    cut: Machine,
    fields: Value,
    knobs: Vec<Knob>,
    /// Integer bits, whose steps stand after those of the knobs, and whether they may be taken: at
    /// last.
    integers: Vec<Knob>,
    is_last: bool,
    views: Vec<View>,
    journal: Journal,
    /// Rows by their keys.
    known: HashMap<String, u64>,
    areas: HashMap<Vec<u32>, Option<f64>>,
    method: &'static str,
    /// Machines that were asked for, drawn now or before.
    asked_for: HashSet<String>,
    foresight: Foresight,
    /// The error allowed, squared, is so many times less than the target's.
    stricter: f64,
    /// Integer bits that a word needs at least, because it saturated on a view that failed.
    least_int_bits: BTreeMap<String, i32>,
    progress: Progress,
}

impl<'a> Search<'a> {
    fn new(
        machine: &Machine,
        knobs: Vec<Knob>,
        domains: &'a [Domain],
        views: Vec<View>,
        journal: Journal,
        options: &'a Options,
    ) -> Self {
        let known = journal
            .rows()
            .filter_map(|row| Some((row[1].as_str()?.to_owned(), row[0].as_u64()?)))
            .collect();
        let progress = Progress::of_messages(options.progress);
        let (base, cut, fields) = (machine.clone(), machine.clone(), machines::value(machine));
        Search {
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
            asked_for: HashSet::new(),
            foresight: Foresight::new(),
            stricter: 1.0,
            least_int_bits: BTreeMap::new(),
            progress,
        }
    }

    /// One more view to look at, with the cameras beside it.
    fn learn(&mut self, views: Vec<View>) {
        self.views.extend(views);
        self.areas.clear();
    }

    /// Whether the base meets the target on all views; there it makes the aim no higher than it can
    /// reach itself.
    fn check_reach(&mut self) -> Result<()> {
        self.cut = self.base.clone();
        self.take_fields();
        let found = self.found(&vec![0; self.knobs.len()])?;
        let load = self.options.target.load(&found);
        // On the scenes themselves it was tried before; what a view shows later is the job's fault,
        // not the input's.
        self.options
            .target
            .check_reach(&found, &self.views, &self.base.name)
            .map_err(Error::job)?;
        self.stricter = self.stricter.min(1.0 / load.max(f64::MIN_POSITIVE));
        Ok(())
    }

    /// Those whose steps may be taken at last.
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

    /// What differs from the base, as `sweep` writes it.
    fn changes(&self, machine: &Machine) -> String {
        let [base, now] = [&self.base, machine].map(machines::value);
        let mut changes = Vec::new();
        differences(&base, &now, "", &mut changes);
        changes.join(" ")
    }

    /// A machine, and the key of its row; none where it cannot be built.
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

    /// What a row says of how far its machine is off.
    fn known(&self, key: &str) -> Option<Found> {
        let row = self
            .known
            .get(key)
            .and_then(|point| self.journal.get(*point))?;
        let saturated = row[11].as_u64();
        let is_hopeless = !row[5].is_null();
        Some(if is_hopeless {
            HOPELESS
        } else {
            Found {
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

    /// How far a machine is off on all views; drawn if it never was.
    fn found(&mut self, steps: &[u32]) -> Result<Found> {
        let Some((key, machine, elaborated)) = self.keyed(steps) else {
            return Ok(HOPELESS);
        };
        self.asked_for.insert(key.clone());
        if let Some(found) = self.known(&key) {
            return Ok(found);
        }
        let Measured { found, seconds } = self.foresight.taken(
            &self.views,
            &self.options.target,
            (&key, &machine),
            &elaborated,
        )?;
        let misfit = found.as_ref().err().cloned();
        let found = found.unwrap_or(HOPELESS);
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
        let told = format!(
            "{}: {} machines drawn, this one {} LUT equivalents, {} dB",
            self.method,
            self.asked_for.len(),
            thousands(area as u64),
            decibels(found.psnr_db_of(&self.options.target))
        );
        self.progress.set_message(told);
        Ok(found)
    }

    /// The part of what is allowed, squared, that a machine takes.
    fn load_of(&self, found: &Found) -> f64 {
        if *found == HOPELESS {
            f64::INFINITY
        } else {
            self.options.target.load(found) * self.stricter
        }
    }

    fn step(&mut self, method: &str, steps: &[u32]) -> Result<Step> {
        let area = self.area(steps).unwrap_or(f64::INFINITY);
        Ok(Step {
            method: method.to_owned(),
            area,
            found: self.found(steps)?,
            drawn: self.asked_for.len() as u64,
        })
    }

    /// Cuts integer bits down to what the views need, and cameras all around.
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
            .filter(|(path, _)| knobs::is_asked(path, &self.options.only));
        let less = |(path, format): (String, Format)| {
            let int_bits = (*needed.get(&path)?).max(2 - format.frac_bits);
            (int_bits < format.int_bits)
                .then(|| (path, Value::from(Format { int_bits, ..format }.to_string())))
        };
        // Not all can be: a table's span is its index' range.
        let mut changes: Vec<(String, Value)> = words.filter_map(less).collect();
        changes.retain(|change| self.try_cut(change).is_some());
        let none = vec![0; self.knobs.len()];
        if self.load(&none)? <= 1.0 {
            return Ok(());
        }
        // Some word holds what no picture shows: a constant of the scene, or a wrap that would not
        // have mattered. Which?
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

    /// Cuts one word, if the machine can be built then; what it was before.
    fn try_cut(&mut self, change: &(String, Value)) -> Option<Machine> {
        let machine = machines::with(&self.cut, std::slice::from_ref(change), "")
            .ok()
            .filter(|machine| machine.elaborate().is_ok())?;
        let before = std::mem::replace(&mut self.cut, machine);
        self.take_fields();
        Some(before)
    }

    /// The machine that steps are taken from is another one.
    fn take_fields(&mut self) {
        self.fields = machines::value(&self.cut);
        let only = &self.options.only;
        self.knobs = knobs::all(&self.cut, only);
        self.integers = knobs::integers(&self.cut, only);
        self.areas.clear();
    }

    /// From the ranges to a machine that meets the target on all views. Fraction bits begin where
    /// the round before ended.
    fn round(&mut self, before: Option<&[u32]>, path: &mut Vec<Step>) -> Result<Vec<u32>> {
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
            // A round for another view.
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

    /// Steps that are left one by one, and together, integer bits among them.
    fn last_steps(&mut self, from: &[u32], path: &mut Vec<Step>) -> Result<Settled> {
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

    /// Gives integer bits to the words that saturate on views that failed, where that makes the
    /// views better; whether it does, and the load of the views then.
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
            found_on(views, |view| drawn(&built, view, &self.options.target)).unwrap_or(HOPELESS);
        let then = self.options.target.load(&found);
        // Also where a load is no number.
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

    /// How far a machine is off on each view that was searched on.
    fn drawn_again(&self, steps: &[u32]) -> Result<Vec<Found>> {
        let machine = self.machine(steps).unwrap_or_else(|| self.base.clone());
        let elaborated = fixed::elaborate(&machine)?;
        self.views
            .iter()
            .map(|view| drawn(&elaborated, view, &self.options.target))
            .collect()
    }

    /// What unseen views cost; areas are those of the target alone and of what was found.
    fn margin(&self, steps: &[u32], on_first: &[Found], [alone, found]: [f64; 2]) -> Margin {
        let target = &self.options.target;
        let formats: HashMap<String, Format> = self
            .machine(steps)
            .iter()
            .flat_map(machines::words)
            .collect();
        // The last steps may have taken some of them again.
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

    /// How the machine does on the next unseen views, and the worst that fails.
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
        let mut worst: Option<(f64, (Found, Vec<View>))> = None;
        for (of, domain) in self.domains.iter().enumerate() {
            for nth in from..from + self.options.views {
                let member = domain.nth(nth)?;
                let (name, camera) = (member.name.clone(), member.scene.camera);
                let searched = self.views.iter().map(|view| (view.of, view.scene.camera));
                // A short list comes round again.
                if searched
                    .chain(taken.iter().copied())
                    .any(|seen| seen == (of, camera))
                {
                    continue;
                }
                let views: Vec<View> = member
                    .and_beside(self.options.robust)
                    .into_iter()
                    .map(|member| View::new(of, member, &machine))
                    .collect();
                let each: Vec<Found> = views
                    .iter()
                    .map(|view| drawn(&elaborated, view, target).unwrap_or(HOPELESS))
                    .collect();
                let found = worst_of(&each);
                let load = target.load(&found);
                self.progress
                    .set_message(format!("{name}: {} dB", decibels(found.psnr_db_of(target))));
                taken.push((of, camera));
                // The camera that decides is recorded, with what is found there.
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
        path: Vec<Step>,
        views: Vec<Unseen>,
        learnt: Vec<String>,
        steps: &[u32],
        (margin, claims, checked): (Margin, Vec<Claim>, Checked),
    ) -> Result<Outcome> {
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
        self.foresee(&all)?;
        for knob in open {
            let found = self.found(&lesser(knob))?;
            if found == HOPELESS || self.options.target.load(&found) <= 1.0 {
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
        Ok(Outcome {
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

    /// Views that the search was decided on: those that were searched on, then the unseen ones.
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

    /// The worst of the views that were searched on, and the worst of the unseen ones.
    fn claims(&self, searched: &[Found], views: &[Unseen]) -> Vec<Claim> {
        let target = &self.options.target;
        let unseen: Vec<Found> = views.iter().map(|view| view.found).collect();
        let worst = |found: &[Found], from: usize| {
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

    /// Each scene with the cameras that were searched on, then those of unseen views.
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

    fn write(self, outcome: Outcome, folder: &Path) -> Result<Outcome> {
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
        Ok(Outcome { files, ..outcome })
    }
}

impl Problem for Search<'_> {
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
        Ok(if found == HOPELESS {
            f64::INFINITY
        } else {
            self.options.target.load(&found)
        })
    }

    fn width(&self) -> usize {
        self.foresight.width()
    }

    fn foresee(&mut self, steps: &[Vec<u32>]) -> Result<()> {
        if self.width() == 1 {
            return Ok(());
        }
        let mut machines: Vec<(String, Machine)> = Vec::new();
        for (key, machine, _) in steps.iter().filter_map(|steps| self.keyed(steps)) {
            if !self.known.contains_key(&key) && !machines.iter().any(|(other, _)| *other == key) {
                machines.push((key, machine));
            }
        }
        self.foresight
            .measure(&self.views, &self.options.target, &machines)
    }

    fn foreseen(&self, steps: &[u32]) -> Option<f64> {
        let Some((key, ..)) = self.keyed(steps) else {
            return Some(f64::INFINITY);
        };
        let measured = || {
            self.foresight
                .get(&key)
                .map(|measured| measured.found.clone().unwrap_or(HOPELESS))
        };
        self.known(&key)
            .or_else(measured)
            .map(|found| self.load_of(&found))
    }
}

/// Of a machine that cannot be built, or cannot hold the scene.
const HOPELESS: Found = Found {
    psnr_db: Some(f64::NEG_INFINITY),
    max_error: f64::INFINITY,
    fixed_vs_ideal_psnr_db: Some(f64::NEG_INFINITY),
    fixed_vs_ideal_max_error: f64::INFINITY,
    saturated: None,
    lockstep: None,
};

/// Draws a view and compares.
fn drawn(elaborated: &Elaborated, view: &View, target: &Target) -> Result<Found> {
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
    Ok(Found {
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
                // A word that has a rounding is named without `.format`, as in a plan.
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

/// CriticalWord steps that are told.
const TOLD: usize = 8;

impl Outcome {
    /// The way and what it led to, at most 80 columns wide.
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
        for Step {
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
        let _ = write!(text, "\n{}", wrapped(&self.margin_text()));
        let _ = write!(text, "\n{}", wrapped(&self.checked_text()));
        let tight = self.tight.iter().take(TOLD).map(|tight| {
            let value = tight
                .value
                .as_str()
                .map_or_else(|| tight.value.to_string(), str::to_owned);
            let bit = if tight.part == Part::IntegerBit {
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
                count if count > TOLD => {
                    format!("{TOLD} of {count} critical word lengths (search.json lists all)")
                }
                _ => "critical word lengths".to_owned(),
            };
            let _ = write!(
                text,
                "\n{}",
                wrapped(&format!(
                    "{critical}, and what a step less would make of each: {}",
                    tight.join(", ")
                ))
            );
        }
        text
    }

    /// What unseen views cost, a sentence or two.
    fn margin_text(&self) -> String {
        let Margin {
            aim_db,
            first_psnr_db,
            db,
            target_alone_area,
            area,
            widened,
        } = &self.margin;
        if self.learnt.is_empty() {
            return "unseen views need no margin: the target alone takes the same area".into();
        }
        let count = self.learnt.len();
        let views = if count == 1 {
            "1 view that failed is".to_owned()
        } else {
            format!("{count} views that failed are")
        };
        let mut text = format!(
            "the target alone takes {} LUT equivalents; unseen views need {:+.1}% of area",
            thousands(*target_alone_area as u64),
            100.0 * area / target_alone_area
        );
        match db {
            Some(db) => {
                let _ = write!(
                    text,
                    " and {db:+.1} dB on the first view ({} dB)",
                    decibels(*first_psnr_db)
                );
            }
            None => text.push_str(", and no dB is stated for the first view"),
        }
        let _ = write!(text, ": {views} searched on");
        if *aim_db > 0.0 {
            let _ = write!(
                text,
                ", and the aim on every searched view is {aim_db:.1} dB above the target"
            );
        }
        if !widened.is_empty() {
            let _ = write!(text, "; integer bits given back to {}", widened.join(", "));
        }
        text
    }

    /// How it was made sure that no word can lose a bit.
    fn checked_text(&self) -> String {
        let Checked {
            alone,
            together,
            costly,
        } = self.checked;
        let aim = if self.margin.aim_db > 0.0 {
            "aim"
        } else {
            "target"
        };
        let mut text = match alone {
            0 => "no word or size can lose a step".to_owned(),
            1 => format!("a step less of the one word or size that can lose one misses the {aim}"),
            _ => format!("a step less of each of {alone} words and sizes misses the {aim}"),
        };
        match together {
            0 => {}
            1 => text.push_str(", and so does 1 joint step"),
            _ => _ = write!(text, ", and so do {together} joint steps"),
        }
        if costly > 0 {
            let _ = write!(text, "; {costly} would take more area");
        }
        text
    }
}

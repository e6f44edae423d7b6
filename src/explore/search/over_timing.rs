//! Over timing: finds the cheapest microarchitecture that draws N frames per second.
//!
//! ```text
//! scenes ─► drawn once each ─► work ──┐
//! fields ─► machine ─► valid? ─► replay ─► frames/s, cost ─► grown until it is fast enough ─► cheaper, by one field, then by two
//!                                                                  ▲                                          │
//!                                                                  └──── a view that is too slow is added   ◄─┘
//! ```
//! Words are not changed, so pictures do not change: a scene is drawn once, and every machine
//! replays the recorded work. A machine with a unit that misses its clock is not a candidate. Every
//! machine that was tried is a row of a journal, as in `sweep`.
//!
//! Laws (tests/search.rs): `the_cheapest_machine_that_is_fast_enough_is_found`,
//! `a_machine_that_cannot_be_fast_enough_says_what_is_nearest`.

mod climb;
mod fields;

use super::claims::{self, Claim, Decided};
use super::{Domain, Member};
use crate::error::{Error, Result};
use crate::explore::sweep::columns;
use crate::explore::sweep::table::CellKind;
use crate::explore::sweep::write_plan;
use crate::hardware::quantise::quantise;
use crate::hardware::searched::{SearchRecord, Target};
use crate::hardware::{fixed, machines};
use crate::output::files::{Folder, write_beside};
use crate::output::text::{aligned, counted, plain_table, thousands, wrapped};
use crate::performance::cost::Prices;
use crate::performance::cycles::frames_per_second;
use crate::run::evaluation::Evaluation;
use crate::scene::digest::digest_of;
use crate::scene::{Camera, Scene};
use climb::{Climb, State};
pub use fields::{GivenMemory, SearchedField, read};
use rtl_model::Machine;
use rtl_model::timing::{self, Detail};
use rtl_model::work::Work;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::json;
use std::borrow::Cow;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Quantity to minimise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Minimise {
    /// Area of the machine, in the unit of the cost model.
    Area,
    /// Gate equivalents of the machine; stored bits at their cost in gates.
    Gates,
    /// Joules per frame, of the scene with the most.
    Energy,
    /// Cycles per frame, of the scene with the most, at the machine's own clock.
    Cycles,
}

/// Options of a search over timing.
#[derive(Clone, Debug)]
pub struct TimingOptions {
    /// Frames per second that every scene must reach.
    pub min_fps: f64,
    /// Quantity to minimise.
    pub minimise: Minimise,
    /// Fields and values; the default ones if empty.
    pub fields: Vec<SearchedField>,
    /// The memory, which is given; None for that of the machine.
    pub memory: Option<GivenMemory>,
    /// Number of unseen cameras of each scene that must be fast enough too.
    pub views: usize,
    /// Unit costs of bits.
    pub prices: Prices,
    /// Show progress.
    pub progress: bool,
}

/// Figures of a machine: the worst over all scenes and views.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct TimingFigures {
    /// Frames per second of the slowest.
    pub frames_per_second: f64,
    /// Area in the unit of the cost model.
    pub area: f64,
    /// Gate equivalents.
    pub gates: f64,
    /// Joules per frame.
    pub energy: f64,
    /// Cycles per frame.
    pub cycles: u64,
}

impl Minimise {
    /// Whether the quantity is known without a replay.
    fn is_known_at_once(self) -> bool {
        matches!(self, Minimise::Area | Minimise::Gates)
    }
}

impl TimingFigures {
    fn of(&self, minimise: Minimise) -> f64 {
        match minimise {
            Minimise::Area => self.area,
            Minimise::Gates => self.gates,
            Minimise::Energy => self.energy,
            Minimise::Cycles => self.cycles as f64,
        }
    }

    /// The worst of two frames on one machine.
    fn and(self, other: TimingFigures) -> TimingFigures {
        TimingFigures {
            frames_per_second: self.frames_per_second.min(other.frames_per_second),
            area: self.area,
            gates: self.gates,
            energy: self.energy.max(other.energy),
            cycles: self.cycles.max(other.cycles),
        }
    }
}

/// A frame with its recorded work.
struct Recorded {
    name: String,
    camera: Camera,
    digest: String,
    work: Work,
}

impl Recorded {
    fn new(member: &Member, machine: &Machine) -> Result<Self> {
        let Member { name, scene } = member;
        let mut elaborated = fixed::elaborate(machine)?;
        elaborated.records_choices = true;
        let evaluation = Evaluation::on(scene, &elaborated)?;
        let (_, _, work) = fixed::draw_measured(&evaluation.machine, &evaluation.quantised);
        Ok(Recorded {
            name: name.clone(),
            camera: scene.camera,
            digest: digest_of(scene),
            work,
        })
    }
}

/// One step of the search.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct TimingStep {
    /// Method.
    pub method: String,
    #[serde(flatten)]
    found: TimingFigures,
    /// Different machines tried so far.
    pub tried: u64,
}

/// An unseen view.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Unseen {
    /// Index of the domain.
    #[serde(skip)]
    of: usize,
    /// Scene and number.
    pub name: String,
    /// The whole camera, as in a scene file.
    pub camera: Camera,
    /// Frames per second.
    pub frames_per_second: f64,
}

/// A view that decided the search.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Deciding {
    /// Index of the domain.
    #[serde(skip)]
    of: usize,
    /// Scene, or scene and number.
    pub name: String,
    /// The whole camera, as in a scene file.
    pub camera: Camera,
    /// Frames per second of the machine that was found.
    pub frames_per_second: f64,
}

/// Result of a search.
#[derive(Debug, Serialize, JsonSchema)]
pub struct TimingOutcome {
    /// The scenes.
    pub scenes: Vec<String>,
    /// Frames per second that every scene must reach.
    pub min_fps: f64,
    /// Quantity to minimise.
    pub minimise: Minimise,
    /// The machine from which the search started.
    pub base: String,
    /// Fields that may be changed.
    pub fields: Vec<SearchedField>,
    /// Steps of the search.
    pub path: Vec<TimingStep>,
    /// Unseen views and their frames per second.
    pub views: Vec<Unseen>,
    /// Views that were too slow and were added to the search.
    pub learnt: Vec<String>,
    /// Views that decided the search: the replayed ones, those on which every machine is checked
    /// first, and those that were too slow.
    pub cameras: Vec<Deciding>,
    /// Stated figures, and the cameras that decide them.
    pub claims: Vec<Claim>,
    /// Fields that differ from the base's, as PATH=VALUE.
    pub changes: Vec<String>,
    /// What limits the slowest scene.
    pub limited_by: String,
    /// The machine that was found.
    pub machine: Machine,
    /// Files that were written.
    #[serde(skip)]
    pub files: Vec<PathBuf>,
}

/// Most rounds; each adds one view.
const ROUNDS: usize = 12;
/// Index of the first camera among which the slowest is chosen, far above those of unseen views.
const FIRST_LOOK: usize = 1_000_000;
/// Margin by which the aim exceeds the need of a view, and its upper limit, as a part.
const MARGIN: f64 = 0.002;
const MOST_ABOVE: f64 = 1.25;

const COLUMNS: [(&str, CellKind); 10] = [
    (columns::POINT, CellKind::Whole),
    (columns::KEY, CellKind::Text),
    (columns::SCENE, CellKind::Text),
    (columns::CHANGES, CellKind::Text),
    (columns::MISFIT, CellKind::Text),
    (columns::FRAMES_PER_SECOND, CellKind::Number),
    (columns::AREA, CellKind::Number),
    (columns::ENERGY_J, CellKind::Number),
    (columns::CYCLES, CellKind::Whole),
    (columns::GATES, CellKind::Number),
];

/// The searched fields. If none are given and cycles are minimised, the clock is not changed.
fn fields_of(base: &Machine, options: &TimingOptions) -> Vec<SearchedField> {
    if !options.fields.is_empty() {
        return options.fields.clone();
    }
    let is_told = |field: &SearchedField| {
        options.minimise != Minimise::Cycles || field.field != fields::CLOCK
    };
    fields::default_fields(base)
        .into_iter()
        .filter(is_told)
        .collect()
}

/// Refuses scenes whose picture depends on timing.
fn check_scenes<'a>(scenes: impl Iterator<Item = &'a Scene>, base: &Machine) -> Result<()> {
    for scene in scenes {
        let budget = scene.detail.as_ref().map(|detail| detail.rules.budget);
        if budget.is_some_and(|budget| budget.bytes.or(budget.cycles).is_some()) {
            let why = "has a budget of bytes or cycles, so its splats depend on the machine";
            return Err(Error::input(format!("--min-fps: {} {why}", scene.name)));
        }
        quantise(scene, base)?;
    }
    Ok(())
}

/// Runs the search, and writes `machine.json`, `search.json`, `search.csv` and `search.parquet`.
/// `searched` is the record of an earlier search over words; it is written into the machine's file.
///
/// # Errors
/// [`Error::Input`] if a scene does not fit the machine, or a field or value is invalid: nothing is
/// written then. [`Error::Job`] if no machine that was tried is fast enough: the rows are kept.
pub fn run(
    domains: &[Domain],
    base: &Machine,
    searched: Option<&SearchRecord>,
    folder: &Path,
    options: &TimingOptions,
) -> Result<TimingOutcome> {
    let fields = fields_of(base, options);
    let knobs = fields::knobs(base, &fields)?;
    fixed::elaborate(base)?;
    let mut members: Vec<Member> = domains.iter().flat_map(Domain::first).collect();
    check_scenes(members.iter().map(|member| &member.scene), base)?;
    around(domains, options.views)
        .try_for_each(|member| check_scenes([&member?.scene].into_iter(), base))?;
    let _open = Folder::open(folder)?;
    let mut search = Climb::new(options, base, knobs, folder)?;
    let names: Vec<String> = domains.iter().map(|domain| domain.label.clone()).collect();
    let aim = json!({"min_fps": options.min_fps, "minimise": options.minimise, "fields": fields, "prices": options.prices});
    write_plan(
        folder,
        &json!({"splatsim": env!("CARGO_PKG_VERSION"), "search_over_timing": aim, "scenes": names, "machine": base}),
    )?;
    let count = members.len() + domains.len() * options.views;
    let looked = members.iter().map(|member| Ok(Cow::Borrowed(member)));
    let first = slowest(
        &mut search,
        looked.chain(around(domains, options.views).map(|member| member.map(Cow::Owned))),
        count,
        base,
    )?;
    search.frames.push(first);
    let mut path = Vec::new();
    let mut best = search.first();
    search.step(&mut path, &base.name, &best)?;
    let mut next_view = 1;
    let mut learnt: Vec<String> = Vec::new();
    let mut rounds = 0;
    let mut slow_frames = Vec::new();
    let (views, mut cameras) = loop {
        best = match search.round(&best, &mut path)? {
            Some(best) => best,
            None if search.aim > options.min_fps => {
                // The raised aim stood for other views; now these are searched themselves.
                search.aim = options.min_fps;
                slow_frames.drain(..).for_each(|frame| search.learn(frame));
                continue;
            }
            None => return Err(Error::job(search.out_of_reach()?)),
        };
        let slow = unseen(&mut search, domains, &members, &best, next_view, options)?;
        next_view += options.views;
        let (fps, frame, member) = match slow {
            UnseenResult::Fast(views, looked) => break (views, looked),
            UnseenResult::Slow(fps, frame, member) => (fps, *frame, member),
        };
        if rounds + 1 == ROUNDS {
            return Err(Error::job(format!(
                "after {ROUNDS} rounds {} is still too slow: aim lower",
                frame.name
            )));
        }
        let method = frame
            .name
            .rsplit(" from ")
            .next()
            .map_or(String::new(), |from| format!("{from} is too slow"));
        if !learnt.contains(&frame.name) {
            learnt.push(frame.name.clone());
        }
        rounds += 1;
        // A higher aim keeps the replays; only beyond its limit is a slow view itself added.
        let aim = search.aim * (1.0 + MARGIN) * options.min_fps / fps;
        if aim <= options.min_fps * MOST_ABOVE {
            search.aim = aim;
            slow_frames.push(frame);
        } else {
            search.learn(frame);
        }
        // It must be fast enough from now on.
        members.push(*member);
        search.step(&mut path, &method, &best)?;
    };
    let machine = Machine {
        name: format!("{}-{}fps", base.name, options.min_fps),
        ..search.machine(&best)?
    };
    let built = fixed::elaborate(&machine)?;
    for frame in search.frames.iter().chain(&slow_frames) {
        if cameras.iter().all(|other| other.name != frame.name) {
            let fps = frames_per_second(
                &built.timing,
                &timing::replay(&built.timing, &frame.work, Detail::Total),
            );
            let of = claims::domain_of(domains, &frame.name);
            cameras.push(Deciding {
                of,
                name: frame.name.clone(),
                camera: frame.camera,
                frames_per_second: fps,
            });
        }
    }
    cameras.sort_by(|a, b| a.frames_per_second.total_cmp(&b.frames_per_second));
    let decided: Vec<Decided<'_>> = (cameras.iter().map(|view| Decided {
        name: &view.name,
        of: view.of,
        camera: &view.camera,
    }))
    .chain(views.iter().map(|view| Decided {
        name: &view.name,
        of: view.of,
        camera: &view.camera,
    }))
    .collect();
    let figure = |fps: f64| format!("{fps:.1} frames/s");
    let slowest_unseen = (0..views.len()).min_by(|a, b| {
        views[*a]
            .frames_per_second
            .total_cmp(&views[*b].frames_per_second)
    });
    let figures = (cameras
        .first()
        .map(|view| (figure(view.frames_per_second), 0))
        .into_iter())
    .chain(slowest_unseen.map(|nth| (figure(views[nth].frames_per_second), cameras.len() + nth)))
    .collect();
    let claims = claims::claims(domains, &decided, figures);
    let camera_files = claims::write_cameras(folder, domains, &decided)?;
    let (changes, limited_by) = (search.changes(&best), search.limited_by(&best)?);
    let mut files = search.write(folder)?;
    files.extend(camera_files);
    let searched = Some(
        searched
            .cloned()
            .unwrap_or_else(|| record(domains, (&cameras, &views), options.min_fps)),
    );
    let file = machines::File {
        machine: machine.clone(),
        searched,
    };
    let (min_fps, minimise, base) = (options.min_fps, options.minimise, base.name.clone());
    let outcome = TimingOutcome {
        scenes: names,
        min_fps,
        minimise,
        base,
        fields,
        path,
        views,
        learnt,
        cameras,
        claims,
        changes,
        limited_by,
        machine,
        files: Vec::new(),
    };
    for (name, value) in [
        ("search.json", json!(outcome)),
        ("machine.json", json!(file)),
    ] {
        let path = folder.join(name);
        write_beside(&path, |file| {
            serde_json::to_writer_pretty(file, &value).map_err(|e| e.to_string())
        })?;
        files.insert(0, path);
    }
    Ok(TimingOutcome { files, ..outcome })
}

/// The record of a machine whose words were not searched.
fn record(
    domains: &[Domain],
    (decided, views): (&[Deciding], &[Unseen]),
    min_fps: f64,
) -> SearchRecord {
    let of = |(nth, domain): (usize, &Domain)| {
        let mut cameras: Vec<Camera> = domain
            .first()
            .into_iter()
            .map(|member| member.scene.camera)
            .collect();
        let decided = decided
            .iter()
            .filter(|view| view.of == nth)
            .map(|view| view.camera);
        for camera in decided.chain(
            views
                .iter()
                .filter(|view| view.of == nth)
                .map(|view| view.camera),
        ) {
            if !cameras.contains(&camera) {
                cameras.push(camera);
            }
        }
        domain.record(cameras)
    };
    let target = Target {
        frames_per_second: Some(min_fps),
        ..Target::default()
    };
    SearchRecord {
        target,
        scenes: domains.iter().enumerate().map(of).collect(),
    }
}

/// Views among which the slowest is chosen, in addition to the first.
fn around(domains: &[Domain], views: usize) -> impl Iterator<Item = Result<Member>> {
    domains
        .iter()
        .flat_map(move |domain| (0..views).map(move |nth| domain.nth(FIRST_LOOK + nth)))
}

/// The searched frame: of N views the slowest on the base, the first one if several are equal.
fn slowest<'m>(
    search: &mut Climb,
    views: impl Iterator<Item = Result<Cow<'m, Member>>>,
    count: usize,
    base: &Machine,
) -> Result<Recorded> {
    let mut slowest: Option<(u64, Cow<'m, Member>, Option<Recorded>)> = None;
    for (nth, member) in views.enumerate() {
        let member = member?;
        search.report_view("recording view", nth + 1, count, &member.name);
        let (found, frame) = search.measure_view(base, "", &member)?;
        if slowest
            .as_ref()
            .is_none_or(|(most, ..)| found.cycles > *most)
        {
            slowest = Some((found.cycles, member, frame));
        }
    }
    let (_, member, frame) = slowest.ok_or_else(|| Error::job("there is no scene"))?;
    frame.map_or_else(|| Recorded::new(&member, base), Ok)
}

/// Result of the unseen views.
enum UnseenResult {
    /// All are fast enough: the unseen ones, and those on which every machine is checked first.
    Fast(Vec<Unseen>, Vec<Deciding>),
    /// The slowest is too slow; its frames per second.
    Slow(f64, Box<Recorded>, Box<Member>),
}

/// Frames per second of the views that are checked first, and of unseen views.
fn unseen(
    search: &mut Climb,
    domains: &[Domain],
    members: &[Member],
    state: &State,
    first: usize,
    options: &TimingOptions,
) -> Result<UnseenResult> {
    let machine = search.machine(state)?;
    let changes = search.changes(state).join(" ");
    let mut views: Vec<Unseen> = Vec::new();
    let mut slowest: Option<(f64, Option<Recorded>, Box<Member>)> = None;
    let most = members.len() + domains.len() * options.views;
    let mut count = 0;
    let mut look = |search: &mut Climb, member: &Member| -> Result<f64> {
        count += 1;
        search.report_view("unseen view", count, most, &member.name);
        let (found, frame) = search.measure_view(&machine, &changes, member)?;
        let fps = found.frames_per_second;
        if fps < options.min_fps && slowest.as_ref().is_none_or(|(least, ..)| fps < *least) {
            slowest = Some((fps, frame, Box::new(member.clone())));
        }
        Ok(fps)
    };
    let searched: Vec<String> = search
        .frames
        .iter()
        .map(|frame| frame.name.clone())
        .collect();
    let is_searched = |member: &Member| searched.contains(&member.name);
    let mut looked = Vec::new();
    for member in members.iter().filter(|member| !is_searched(member)) {
        let frames_per_second = look(search, member)?;
        let (of, name) = (
            claims::domain_of(domains, &member.name),
            member.name.clone(),
        );
        looked.push(Deciding {
            of,
            name,
            camera: member.scene.camera,
            frames_per_second,
        });
    }
    for (of, domain) in domains.iter().enumerate() {
        for nth in first..first + options.views {
            let member = domain.nth(nth)?;
            let camera = member.scene.camera;
            // A short list of cameras repeats.
            let is_known =
                is_searched(&member) || members.iter().any(|other| other.name == member.name);
            if is_known
                || views
                    .iter()
                    .any(|view| (view.of, view.camera) == (of, camera))
            {
                continue;
            }
            let frames_per_second = look(search, &member)?;
            views.push(Unseen {
                of,
                name: member.name,
                camera,
                frames_per_second,
            });
        }
    }
    let Some((fps, frame, member)) = slowest else {
        return Ok(UnseenResult::Fast(views, looked));
    };
    let frame = frame.map_or_else(|| Recorded::new(&member, &machine), Ok)?;
    Ok(UnseenResult::Slow(fps, Box::new(frame), member))
}

impl TimingOutcome {
    /// Steps and result, at most 80 columns wide.
    pub fn summary(&self) -> String {
        let what = match self.minimise {
            Minimise::Area => "area",
            Minimise::Gates => "gates",
            Minimise::Energy => "energy",
            Minimise::Cycles => "cycles",
        };
        let head = format!(
            "{}, from {}: at least {} frames/s, least {what}",
            self.scenes.join(", "),
            self.base,
            self.min_fps
        );
        // Of area and gates, the one that is minimised.
        let (size, size_of): (_, fn(&TimingFigures) -> f64) = match self.minimise {
            Minimise::Gates => ("gates", |found| found.gates),
            _ => ("area", |found| found.area),
        };
        let mut table = plain_table(&["", size, "frames/s", "energy mJ", "cycles", "tried"]);
        for TimingStep {
            method,
            found,
            tried,
        } in &self.path
        {
            table.add_row([
                method.clone(),
                thousands(size_of(found) as u64),
                format!("{:.1}", found.frames_per_second),
                format!("{:.2}", found.energy * 1e3),
                thousands(found.cycles),
                thousands(*tried),
            ]);
        }
        let mut text = format!("{}\n\n{}\n", wrapped(&head), aligned(table).trim_fmt());
        let changes = if self.changes.is_empty() {
            "nothing: it is the machine as it was".into()
        } else {
            self.changes.join(" ")
        };
        let _ = write!(
            text,
            "\n{}",
            wrapped(&format!("{}: {changes}", self.machine.name))
        );
        let _ = write!(
            text,
            "\n{}",
            wrapped(&format!("limited by {}", self.limited_by))
        );
        let slowest = self
            .views
            .iter()
            .map(|view| view.frames_per_second)
            .fold(f64::INFINITY, f64::min);
        let views = match self.views.len() {
            0 => "no unseen view was tried".to_owned(),
            count => format!(
                "fast enough on {}, the slowest with {slowest:.1} frames/s",
                counted(count as u64, "unseen view", "unseen views")
            ),
        };
        let _ = write!(text, "\n{}", wrapped(&views));
        if let Some(first) = self.cameras.first() {
            let _ = write!(
                text,
                "\n{}",
                wrapped(&format!(
                    "decided by {}: {:.1} frames/s",
                    first.name, first.frames_per_second
                ))
            );
        }
        text
    }
}

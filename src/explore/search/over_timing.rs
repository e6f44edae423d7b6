//! Over timing: the cheapest microarchitecture that draws so many frames a second.
//!
//! ```text
//! scenes ─► drawn once each ─► work ─┐
//! domain ─► machine ─► built? ─► replay ─► frames/s, cost ─► grown until it is fast enough ─► cheaper, by one field, then by two
//!                                                                  ▲                                          │
//!                                                                  └──── a view that is too slow counts too ◄─┘
//! ```
//! Words stay as they are, so that no picture changes: a scene is drawn once, and every machine replays what was recorded. A machine whose
//! unit cannot keep its clock is not built, and is no candidate. Every machine that was tried is a row of a journal, as in `sweep`.
//!
//! Laws (tests/search.rs): `the_cheapest_machine_that_is_fast_enough_is_found`, `a_machine_that_cannot_be_fast_enough_says_what_is_nearest`.

use crate::error::{Error, Result};
use crate::explore::sweep::columns;
use crate::explore::sweep::table::{Journal, Kind, named};
use crate::explore::sweep::write_plan;
use crate::hardware::{fixed, machines, searched::SearchRecord};
use crate::output::files::{Folder, write_beside};
use crate::output::progress::Progress;
use crate::output::text::{aligned, plain_table, thousands, wrapped};
use crate::performance::cost::{CostReport, Prices};
use crate::performance::cycles::CyclesReport;
use crate::run::evaluation::Evaluation;
use crate::scene::Scene;
use crate::scene::digest::{digest, digest_of};
use rayon::prelude::*;
use rtl_model::Machine;
use rtl_model::timing::{self, Detail};
use rtl_model::work::Work;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// What is to be least.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Minimise {
    /// Area of the machine, in the unit of the prices.
    Area,
    /// Joules a frame, of the scene that takes most.
    Energy,
    /// Cycles a frame, of the scene that takes most.
    Cycles,
}

/// A field of the machine, and the values that it may have.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Field {
    /// As `timing.raster.lanes`.
    pub field: String,
    /// Values that are tried besides the machine's own.
    pub values: Vec<Value>,
}

/// Options of a search over timing.
#[derive(Clone, Debug)]
pub struct Options {
    /// Frames a second that every scene must reach.
    pub min_fps: f64,
    /// What is to be least.
    pub minimise: Minimise,
    /// Fields and values; those of [`domain`] where empty.
    pub domain: Vec<Field>,
    /// Unseen cameras of each scene that must be fast enough too.
    pub views: usize,
    /// What a bit costs.
    pub prices: Prices,
    /// Show how far it is.
    pub progress: bool,
}

/// What may be changed unless somebody says otherwise. Each costs area where it makes a frame faster. What memory is bought is given, as are
/// the technology and what a unit does in a cycle.
const DOMAIN: [(&str, &str); 25] = [
    ("timing.clock_hz", "[50e6, 100e6, 150e6, 200e6, 250e6, 300e6, 400e6, 500e6, 600e6, 800e6, 1000e6, 1200e6, 1500e6, 2000e6]"),
    ("timing.fetch.fifo", "[1, 2, 4, 8, 16, 32]"),
    ("timing.project.units", "[1, 2, 4]"),
    ("timing.project.multipliers", "[null, 1, 2, 4, 8, 16]"),
    ("timing.project.fifo", "[1, 2, 4, 8, 16]"),
    ("timing.ellipse.units", "[1, 2, 4]"),
    ("timing.ellipse.multipliers", "[null, 1, 2, 4, 8, 16]"),
    ("timing.ellipse.fifo", "[1, 2, 4, 8, 16, 32]"),
    ("timing.colour.units", "[1, 2, 4]"),
    ("timing.colour.multipliers", "[1, 2, 4, 8, 16]"),
    ("timing.raster.lanes", "[[1, 1], [2, 1], [4, 1], [2, 2], [8, 1], [4, 2], [8, 2], [4, 4], [8, 4], [8, 8]]"),
    ("timing.raster.fifo", "[1, 2, 4, 8, 16, 32]"),
    ("timing.gauss.fifo", "[1, 2, 4, 8, 16]"),
    ("timing.cache.line_px", "[[4, 1], [2, 2], [4, 4], [8, 4], [8, 8]]"),
    ("timing.cache.lines", "[16, 32, 64, 128, 256, 512, 1024, 2048]"),
    ("timing.cache.ways", "[1, 2, 4, 8]"),
    ("timing.cache.misses", "[1, 2, 4, 8, 16]"),
    ("timing.cache.fifo", "[1, 2, 4, 8, 16, 32, 64]"),
    ("timing.tile.side_px", "[16, 32, 48, 64]"),
    ("timing.tile.buffers", "[1, 2]"),
    ("timing.fragment.hazard", "[null, 1, 2, 3, 4]"),
    ("timing.shade.interval", "[1, 2, 4]"),
    ("timing.resolve.interval", "[1, 2, 4]"),
    ("timing.memory.outstanding", "[1, 2, 4, 8, 16, 32, 64]"),
    ("timing.walk.stack", "[256, 512, 1024]"),
];

/// The fields that a machine has of those above, with their values.
pub fn domain(machine: &Machine) -> Vec<Field> {
    use rtl_model::machine::timing::Organisation;
    let value = machines::value(machine);
    let unused = match machine.timing.organisation {
        Organisation::Binned => "timing.cache",
        Organisation::Immediate => "timing.tile",
    };
    let has = |field: &str| {
        let unit = field.rsplit_once('.').map_or("", |(unit, _)| unit);
        unit != unused && value.pointer(&pointer(unit)).is_some_and(Value::is_object)
    };
    let whole = |value: Value| value.as_f64().filter(|number| *number >= 1e6).map_or(value.clone(), |number| json!(number as u64));
    let values = |text: &str| serde_json::from_str::<Vec<Value>>(text).unwrap_or_default().into_iter().map(whole).collect();
    DOMAIN.iter().filter(|(field, _)| has(field)).map(|(field, text)| Field { field: (*field).to_owned(), values: values(text) }).collect()
}

fn pointer(path: &str) -> String {
    format!("/{}", path.replace('.', "/"))
}

/// A domain from a file: a JSON array of fields and values.
///
/// # Errors
/// [`Error::Input`] where it cannot be read, or is something else.
pub fn read_domain(path: &Path) -> Result<Vec<Field>> {
    let input_error = |what: String| Error::input(format!("{}: {what}", path.display()));
    let text = std::fs::read(path).map_err(|e| input_error(format!("cannot be read: {e}")))?;
    let domain: Vec<Field> = serde_json::from_slice(&text).map_err(|e| input_error(format!("is no array of fields and values: {e}")))?;
    if domain.is_empty() {
        return Err(input_error("has no field".into()));
    }
    if let Some((_, field)) = domain.iter().enumerate().find(|(nth, field)| domain[..*nth].iter().any(|other| other.field == field.field)) {
        return Err(input_error(format!("{} is there twice", field.field)));
    }
    Ok(domain)
}

/// Values of a field, the machine's own the first.
#[derive(Clone, Debug)]
struct Knob {
    field: String,
    values: Vec<Value>,
}

/// What a machine takes, the most of all scenes and views.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Measured {
    /// Frames a second of the slowest.
    pub frames_per_second: f64,
    /// Area in the unit of the prices.
    pub area: f64,
    /// Joules a frame.
    pub energy: f64,
    /// Cycles a frame.
    pub cycles: u64,
}

impl Measured {
    fn of(&self, minimise: Minimise) -> f64 {
        match minimise {
            Minimise::Area => self.area,
            Minimise::Energy => self.energy,
            Minimise::Cycles => self.cycles as f64,
        }
    }

    /// Of two frames on one machine.
    fn and(self, other: Measured) -> Measured {
        Measured {
            frames_per_second: self.frames_per_second.min(other.frames_per_second),
            area: self.area,
            energy: self.energy.max(other.energy),
            cycles: self.cycles.max(other.cycles),
        }
    }
}

/// A frame that machines replay.
struct Recorded {
    name: String,
    digest: String,
    work: Work,
}

impl Recorded {
    fn new(scene: &Scene, name: String, machine: &Machine) -> Result<Self> {
        let evaluation = Evaluation::new(scene, machine)?;
        let (_, _, work) = fixed::draw_measured(&evaluation.machine, &evaluation.quantised);
        Ok(Recorded { name, digest: digest_of(scene), work })
    }
}

/// A step of the way.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Step {
    /// What was done.
    pub method: String,
    #[serde(flatten)]
    found: Measured,
    /// Different machines tried until then.
    pub tried: u64,
}

/// What was found.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Outcome {
    /// The scenes.
    pub scenes: Vec<String>,
    /// Frames a second that every one must reach.
    pub min_fps: f64,
    /// What was to be least.
    pub minimise: Minimise,
    /// The machine that it began with.
    pub base: String,
    /// What might be changed.
    pub domain: Vec<Field>,
    /// The way.
    pub path: Vec<Step>,
    /// Unseen views and their frames a second.
    pub views: Vec<(String, f64)>,
    /// Views that were too slow, and counted from then on.
    pub learnt: Vec<String>,
    /// Fields that differ from the base's.
    pub changes: Vec<String>,
    /// What limits the slowest scene.
    pub limited_by: String,
    /// The machine.
    pub machine: Machine,
    /// Files that were written.
    #[serde(skip)]
    pub files: Vec<PathBuf>,
}

/// Rounds, each with another view, before it is given up.
const ROUNDS: usize = 12;
/// Machines of a batch that are replayed side by side, after which the journal has them.
const BATCH: usize = 64;
/// Pairs of changes that are replayed at a time, those first that single changes say most of.
const PAIRS: usize = 256;
/// By so much a pair may seem too slow and is tried all the same.
const DOUBT: f64 = 1.05;

const COLUMNS: [(&str, Kind); 9] = [
    (columns::POINT, Kind::Whole),
    (columns::KEY, Kind::Text),
    (columns::SCENE, Kind::Text),
    (columns::CHANGES, Kind::Text),
    (columns::MISFIT, Kind::Text),
    (columns::FRAMES_PER_SECOND, Kind::Number),
    (columns::AREA, Kind::Number),
    (columns::ENERGY_J, Kind::Number),
    (columns::CYCLES, Kind::Whole),
];

/// A machine of the domain: the value of each field by its number.
type State = Vec<usize>;

/// What was measured of a state; none where it cannot be built.
type Taken = Option<Measured>;

struct Search<'a> {
    options: &'a Options,
    base: Machine,
    knobs: Vec<Knob>,
    frames: Vec<Recorded>,
    journal: Journal,
    /// Rows by their keys.
    known: HashMap<String, u64>,
    taken: HashMap<State, Taken>,
    tried: u64,
    progress: Progress,
}

/// Searches, and writes `machine.json`, `search.json`, `search.csv` and `search.parquet`. `searched` goes into the machine's file.
///
/// # Errors
/// [`Error::Input`] where a scene does not fit the machine, or a field or value of the domain is none of it: nothing is written then.
/// [`Error::Job`] where nothing in the domain is fast enough: rows of what was tried are left.
pub fn run(scenes: &[Scene], base: &Machine, searched: Option<&SearchRecord>, folder: &Path, options: &Options) -> Result<Outcome> {
    let fields = if options.domain.is_empty() { domain(base) } else { options.domain.clone() };
    let value = machines::value(base);
    let mut knobs = Vec::new();
    for Field { field, values } in &fields {
        if field != "timing" && !field.starts_with("timing.") {
            return Err(Error::input(format!("{field}: is no field of timing: words are searched by --target-psnr")));
        }
        let own = value.pointer(&pointer(field)).cloned().unwrap_or(Value::Null);
        let mut knob = Knob { field: field.clone(), values: vec![own.clone()] };
        for value in values {
            machines::with(base, &[(field.clone(), value.clone())], "the domain")?;
            if !knob.values.contains(value) {
                knob.values.push(value.clone());
            }
        }
        knobs.push(knob);
    }
    fixed::elaborate(base)?;
    let frames = scenes.iter().map(|scene| Recorded::new(scene, scene.name.clone(), base)).collect::<Result<Vec<_>>>()?;
    let _open = Folder::open(folder)?;
    let mut journal = Journal::open(folder, "", named(&COLUMNS))?;
    journal.keep();
    let names: Vec<String> = scenes.iter().map(|scene| scene.name.clone()).collect();
    let aim = json!({"min_fps": options.min_fps, "minimise": options.minimise, "domain": fields, "prices": options.prices});
    write_plan(folder, &json!({"splatsim": env!("CARGO_PKG_VERSION"), "search_over_timing": aim, "scenes": names, "machine": base}))?;
    let known = journal.rows().filter_map(|row| Some((row[1].as_str()?.to_owned(), row[0].as_u64()?))).collect();
    let progress = Progress::of_messages(options.progress);
    let mut search = Search { options, base: base.clone(), knobs, frames, journal, known, taken: HashMap::new(), tried: 0, progress };
    let mut path = Vec::new();
    let first = vec![0; search.knobs.len()];
    let mut best = first.clone();
    let mut next_view = 1;
    let mut learnt: Vec<String> = Vec::new();
    let views = loop {
        let method = if path.is_empty() { &base.name } else { "a view is too slow" };
        search.step(&mut path, method, &best)?;
        best = search.round(&best, &mut path)?;
        let (views, failed) = search.unseen(scenes, &best, next_view)?;
        next_view += options.views;
        let Some(frame) = failed else { break views };
        if learnt.len() + 1 == ROUNDS {
            return Err(Error::job(format!("after {ROUNDS} rounds {} is still too slow: aim lower", frame.name)));
        }
        learnt.push(frame.name.clone());
        search.frames.push(frame);
        search.taken.clear();
    };
    let machine = Machine { name: format!("{}-{}fps", base.name, options.min_fps), ..search.machine(&best)? };
    let changes = search.changes(&best);
    let limited_by = search.limited_by(&best)?;
    drop(search.progress);
    let mut files = search.journal.write(folder, "search")?;
    let mut outcome = Outcome {
        scenes: names,
        min_fps: options.min_fps,
        minimise: options.minimise,
        base: base.name.clone(),
        domain: fields,
        path,
        views,
        learnt,
        changes,
        limited_by,
        machine: machine.clone(),
        files: Vec::new(),
    };
    let machine = machines::File { machine, searched: searched.cloned() };
    for (name, value) in [("search.json", json!(outcome)), ("machine.json", json!(machine))] {
        let path = folder.join(name);
        write_beside(&path, |file| serde_json::to_writer_pretty(file, &value).map_err(|e| e.to_string()))?;
        files.insert(0, path);
    }
    outcome.files = files;
    Ok(outcome)
}

impl Search<'_> {
    fn machine(&self, state: &State) -> Result<Machine> {
        let of = |(knob, at): (&Knob, &usize)| (knob.field.clone(), knob.values[*at].clone());
        let changes: Vec<(String, Value)> = self.knobs.iter().zip(state).filter(|(_, at)| **at > 0).map(of).collect();
        machines::with(&self.base, &changes, "the search")
    }

    /// Fields that a state changes, as PATH=VALUE.
    fn changes(&self, state: &State) -> Vec<String> {
        let of = |(knob, at): (&Knob, &usize)| format!("{}={}", knob.field, knob.values[*at]);
        self.knobs.iter().zip(state).filter(|(_, at)| **at > 0).map(of).collect()
    }

    fn measure(&self, machine: &Machine) -> std::result::Result<Measured, String> {
        let elaborated = fixed::elaborate(machine).map_err(|e| e.to_string())?;
        let mut all: Option<Measured> = None;
        for Recorded { work, .. } in &self.frames {
            let cycles = timing::replay(&elaborated.timing, work, Detail::Accounts);
            let cost = CostReport::new(&elaborated, &cycles, &self.options.prices);
            let frames_per_second = CyclesReport::new(&elaborated.timing, work, &cycles).frames_per_second;
            let found = Measured { frames_per_second, area: cost.cost.area, energy: cost.energy.total, cycles: cycles.total };
            if ![found.frames_per_second, found.area, found.energy].iter().all(|figure| figure.is_finite()) {
                return Err("has a figure that is no number".into());
            }
            all = Some(all.map_or(found, |all| all.and(found)));
        }
        all.ok_or_else(|| "there is no scene".into())
    }

    /// Measures states that are not known yet, each once.
    fn measure_all(&mut self, states: &[State]) -> Result<()> {
        let mut new: Vec<&State> = Vec::new();
        for state in states.iter().filter(|state| !self.taken.contains_key(*state)) {
            if !new.contains(&state) {
                new.push(state);
            }
        }
        let digests: Vec<&str> = self.frames.iter().map(|frame| frame.digest.as_str()).collect();
        let names = self.frames.iter().map(|frame| frame.name.as_str()).collect::<Vec<_>>().join(", ");
        for batch in new.chunks(BATCH) {
            let one = |state: &&State| -> Result<(String, Option<std::result::Result<Measured, String>>)> {
                let machine = self.machine(state)?;
                let nameless = Machine { name: String::new(), ..machine.clone() };
                let all = json!([env!("CARGO_PKG_VERSION"), digests, nameless, self.options.prices]);
                let key = digest(all.to_string().as_bytes());
                let measured = (!self.known.contains_key(&key)).then(|| self.measure(&machine));
                Ok((key, measured))
            };
            let measured: Vec<_> = batch.par_iter().map(one).collect::<Result<_>>()?;
            for (state, (key, measured)) in batch.iter().zip(measured) {
                if let Some(measured) = measured {
                    let point = self.journal.rows().next_back().and_then(|row| row[0].as_u64()).map_or(0, |last| last + 1);
                    let (misfit, cells) = match measured {
                        Ok(Measured { frames_per_second, area, energy, cycles }) => {
                            (json!(""), [json!(frames_per_second), json!(area), json!(energy), json!(cycles)])
                        }
                        Err(sentence) => (json!(sentence), [const { Value::Null }; 4]),
                    };
                    let head = [json!(point), json!(key), json!(names), json!(self.changes(state).join(" ")), misfit];
                    self.journal.push(point, head.into_iter().chain(cells).collect())?;
                    self.known.insert(key.clone(), point);
                }
                let row = self.known.get(&key).and_then(|point| self.journal.get(*point));
                let taken = row.and_then(|row| {
                    let [frames_per_second, area, energy] = [row[5].as_f64()?, row[6].as_f64()?, row[7].as_f64()?];
                    Some(Measured { frames_per_second, area, energy, cycles: row[8].as_u64()? })
                });
                self.taken.insert((*state).clone(), taken);
                self.tried += 1;
            }
        }
        Ok(())
    }

    fn taken(&mut self, state: &State) -> Result<Taken> {
        self.measure_all(std::slice::from_ref(state))?;
        Ok(self.taken.get(state).copied().flatten())
    }

    fn step(&mut self, path: &mut Vec<Step>, method: &str, state: &State) -> Result<()> {
        let Some(found) = self.taken(state)? else { return Ok(()) };
        self.progress.say(format!("{method}: {:.1} frames/s, {} machines tried", found.frames_per_second, self.tried));
        path.push(Step { method: method.to_owned(), found, tried: self.tried });
        Ok(())
    }

    fn is_fast(&self, found: &Measured) -> bool {
        found.frames_per_second >= self.options.min_fps
    }

    fn cost(&self, found: &Measured) -> f64 {
        found.of(self.options.minimise)
    }

    /// Every state that differs in one field, and what it takes; of those that cannot be built, nothing.
    fn singles(&mut self, from: &State) -> Result<Vec<(usize, usize, Taken)>> {
        let mut changes = Vec::new();
        for (knob, of) in self.knobs.iter().enumerate() {
            changes.extend((0..of.values.len()).filter(|at| *at != from[knob]).map(|at| (knob, at)));
        }
        let states: Vec<State> = changes.iter().map(|change| with(from, &[*change])).collect();
        self.measure_all(&states)?;
        Ok(changes.into_iter().zip(&states).map(|((knob, at), state)| (knob, at, self.taken.get(state).copied().flatten())).collect())
    }

    /// States that differ in two fields, those first that are best by what each change does alone: `wanted` gives a place in the order
    /// from frames/s and cost as they seem, or none.
    fn pairs(&mut self, from: &State, wanted: impl Fn(f64, f64) -> Option<f64>) -> Result<Vec<State>> {
        let Some(now) = self.taken(from)? else { return Ok(Vec::new()) };
        let cost = self.cost(&now);
        let singles = self.singles(from)?;
        // A change that cannot be built alone may be with another; nothing is known of it then.
        let alone =
            |taken: &Taken| taken.map_or((1.0, 1.0), |found| (found.frames_per_second / now.frames_per_second, self.cost(&found) / cost));
        let mut pairs = Vec::new();
        for (nth, (knob, at, taken)) in singles.iter().enumerate() {
            for (other, other_at, other_taken) in singles[nth + 1..].iter().filter(|(other, ..)| other != knob) {
                let ((fps, costs), (other_fps, other_costs)) = (alone(taken), alone(other_taken));
                if let Some(place) = wanted(now.frames_per_second * fps * other_fps, cost * costs * other_costs) {
                    pairs.push((place, with(from, &[(*knob, *at), (*other, *other_at)])));
                }
            }
        }
        pairs.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        let pairs: Vec<State> = pairs.into_iter().take(PAIRS).map(|(_, state)| state).collect();
        self.measure_all(&pairs)?;
        Ok(pairs)
    }

    /// Of some states that are built the one with the least place; the first of equals.
    fn least(&self, states: impl IntoIterator<Item = State>, place: impl Fn(&Measured) -> Option<f64>) -> Option<State> {
        let places = states.into_iter().filter_map(|state| {
            let found = self.taken.get(&state).copied().flatten()?;
            Some((place(&found)?, state))
        });
        places.min_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, state)| state)
    }

    /// Changes fields, one at a time and two where one does not help, until the machine is fast enough; as far as it goes where it never
    /// is. Of what helps, that which costs least for its gain; with `at_any_cost` that which gains most, even beyond.
    fn grown(&mut self, from: &State, at_any_cost: bool) -> Result<State> {
        let mut state = from.clone();
        loop {
            let now = self.taken(&state)?;
            if !at_any_cost && now.is_some_and(|found| self.is_fast(&found)) {
                return Ok(state);
            }
            let singles = self.singles(&state)?.into_iter().map(|(knob, at, _)| with(&state, &[(knob, at)])).collect::<Vec<_>>();
            // A base that cannot be built has no figures: anything that can is better.
            let (fps, cost) = now.map_or((0.0, 0.0), |found| (found.frames_per_second, self.cost(&found)));
            let place = |found: &Measured| {
                let gain = libm::log(found.frames_per_second / fps.max(f64::MIN_POSITIVE));
                let paid = self.cost(found) - cost;
                let price = if paid <= 0.0 { -gain } else { paid / gain };
                (gain > LEAST_GAIN).then_some(if at_any_cost { -gain } else { price })
            };
            let next = match self.least(singles, place) {
                Some(next) => Some(next),
                None => {
                    let pairs = self.pairs(&state, |fps, _| Some(-fps))?;
                    self.least(pairs, |found| (found.frames_per_second > fps * (1.0 + LEAST_GAIN)).then_some(-found.frames_per_second))
                }
            };
            match next {
                Some(next) => state = next,
                None => return Ok(state),
            }
        }
    }

    /// From a machine that is fast enough: changes what makes it cheaper, while it stays so. By what is saved, or by what is saved for
    /// the time that it takes.
    fn cheaper(&mut self, from: &State, by_time: bool) -> Result<State> {
        let mut state = from.clone();
        while let Some(now) = self.taken(&state)? {
            let cost = self.cost(&now);
            let states = self.singles(&state)?.into_iter().map(|(knob, at, _)| with(&state, &[(knob, at)])).collect::<Vec<_>>();
            let place = |found: &Measured| {
                let saved = cost - self.cost(found);
                let slower = libm::log(now.frames_per_second / found.frames_per_second).max(LEAST_GAIN);
                (saved > 0.0 && self.is_fast(found)).then_some(if by_time { -saved / slower } else { -saved })
            };
            match self.least(states, place) {
                Some(next) => state = next,
                None => break,
            }
        }
        Ok(state)
    }

    /// The cheapest that is met from a machine on.
    fn round(&mut self, from: &State, path: &mut Vec<Step>) -> Result<State> {
        let grown = self.grown(from, false)?;
        let mut starts = vec![grown.clone()];
        if !self.taken(&grown)?.is_some_and(|found| self.is_fast(&found)) {
            let fastest = self.grown(&grown, true)?;
            if !self.taken(&fastest)?.is_some_and(|found| self.is_fast(&found)) {
                return Err(Error::job(self.without_end(&fastest)?));
            }
            starts = vec![fastest];
        } else if grown != *from {
            starts.push(self.grown(from, true)?);
        }
        self.step(path, "fast enough", &starts[0])?;
        let mut ends = Vec::new();
        for start in starts {
            for by_time in [true, false] {
                ends.push(self.cheaper(&start, by_time)?);
            }
        }
        let cost = |found: &Measured| self.is_fast(found).then_some(self.cost(found));
        let mut best = self.least(ends, cost).unwrap_or(grown);
        self.step(path, "one field at a time", &best)?;
        while let Some(now) = self.taken(&best)? {
            let (least_fps, now) = (self.options.min_fps / DOUBT, self.cost(&now));
            let pairs = self.pairs(&best, |fps, cost| (fps >= least_fps && cost < now).then_some(cost))?;
            let next = self.least(pairs, |found| (self.is_fast(found) && self.cost(found) < now).then_some(self.cost(found)));
            match next {
                Some(next) => best = self.cheaper(&next, false)?,
                None => break,
            }
        }
        self.step(path, "two fields at a time", &best)?;
        Ok(best)
    }

    /// Frames/s of unseen views, and the slowest where it is too slow.
    fn unseen(&self, scenes: &[Scene], state: &State, first: usize) -> Result<(Vec<(String, f64)>, Option<Recorded>)> {
        let machine = self.machine(state)?;
        let elaborated = fixed::elaborate(&machine)?;
        let mut views = Vec::new();
        let mut slowest: Option<(f64, Recorded)> = None;
        for nth in first..first + self.options.views {
            for scene in scenes {
                let turned = Scene { camera: scene.camera.turned(nth), ..scene.clone() }.cut();
                let frame = Recorded::new(&turned, format!("{} from view {nth}", scene.name), &machine)?;
                let cycles = timing::replay(&elaborated.timing, &frame.work, Detail::Accounts);
                let fps = CyclesReport::new(&elaborated.timing, &frame.work, &cycles).frames_per_second;
                views.push((frame.name.clone(), fps));
                if !(fps >= self.options.min_fps) && slowest.as_ref().is_none_or(|(least, _)| fps < *least) {
                    slowest = Some((fps, frame));
                }
            }
        }
        Ok((views, slowest.map(|(_, frame)| frame)))
    }

    /// What limits the slowest frame.
    fn limited_by(&self, state: &State) -> Result<String> {
        let elaborated = fixed::elaborate(&self.machine(state)?)?;
        let reports = self.frames.iter().map(|Recorded { work, .. }| {
            CyclesReport::new(&elaborated.timing, work, &timing::replay(&elaborated.timing, work, Detail::Accounts))
        });
        let slowest = reports.min_by(|a, b| a.frames_per_second.total_cmp(&b.frames_per_second));
        Ok(slowest.map_or(String::new(), |report| report.limited_by()))
    }

    /// Says what comes nearest.
    fn without_end(&mut self, state: &State) -> Result<String> {
        let Options { min_fps, .. } = self.options;
        let Some(found) = self.taken(state)? else { return Ok("no machine of the domain can be built".into()) };
        let changes = self.changes(state).join(" ");
        let changes = if changes.is_empty() { "the machine as it is".into() } else { changes };
        let limited = self.limited_by(state)?;
        let (fps, area) = (found.frames_per_second, thousands(found.area as u64));
        let of = self.frames.iter().map(|frame| frame.name.as_str()).collect::<Vec<_>>().join(", ");
        Ok(format!(
            "no machine that was tried draws {min_fps} frames/s of {of}; the nearest draws {fps:.1} at {area} of area, limited by {limited}: {changes}"
        ))
    }
}

/// What is gained by less counts as nothing, as a part.
const LEAST_GAIN: f64 = 1e-4;

fn with(state: &State, changes: &[(usize, usize)]) -> State {
    let mut state = state.clone();
    changes.iter().for_each(|(knob, at)| state[*knob] = *at);
    state
}

impl Outcome {
    /// The way and what it led to, at most 80 columns wide.
    pub fn summary(&self) -> String {
        let what = match self.minimise {
            Minimise::Area => "area",
            Minimise::Energy => "energy",
            Minimise::Cycles => "cycles",
        };
        let head = format!("{}, from {}: at least {} frames/s, least {what}", self.scenes.join(", "), self.base, self.min_fps);
        let mut table = plain_table(&["", "area", "frames/s", "energy mJ", "cycles", "tried"]);
        for Step { method, found, tried } in &self.path {
            table.add_row([
                method.clone(),
                thousands(found.area as u64),
                format!("{:.1}", found.frames_per_second),
                format!("{:.2}", found.energy * 1e3),
                thousands(found.cycles),
                thousands(*tried),
            ]);
        }
        let mut text = format!("{}\n\n{}\n", wrapped(&head), aligned(table).trim_fmt());
        let changes = if self.changes.is_empty() { "nothing: it is the machine as it was".into() } else { self.changes.join(" ") };
        let _ = write!(text, "\n{}", wrapped(&format!("{}: {changes}", self.machine.name)));
        let _ = write!(text, "\n{}", wrapped(&format!("limited by {}", self.limited_by)));
        let slowest = self.views.iter().map(|(_, fps)| *fps).fold(f64::INFINITY, f64::min);
        let views = match self.views.len() {
            0 => "no unseen view was tried".to_owned(),
            count => format!("fast enough on {count} unseen views, the slowest with {slowest:.1} frames/s"),
        };
        let _ = write!(text, "\n{}", wrapped(&views));
        text
    }
}

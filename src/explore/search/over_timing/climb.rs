//! Climb: finds the cheapest machine that is fast enough, changing one field at a time, then
//! several.
//!
//! ```text
//! base ─( most gain per cost )─► fast enough ─( most saved per time )─► ─( most saved )─► ─( two or three fields at a time )─► the cheapest
//! ```
//! Replays dominate the run time, so few are made. Area and gates of a machine are known without a
//! replay: if one of them is minimised, only smaller machines are replayed. The effect of each
//! change is remembered and orders the changes of the next step. Only the best few are replayed;
//! the rest only if none of these helps.

use super::fields::{GivenMemory, Knob};
use super::{COLUMNS, Member, Minimise, Recorded, TimingFigures, TimingOptions, TimingStep};
use crate::error::{Error, Result, in_order};
use crate::explore::sweep::table::{Journal, named};
use crate::hardware::{fixed, machines};
use crate::output::progress::Progress;
use crate::output::text::thousands;
use crate::performance::cost::{Cost, CostReport, Prices};
use crate::performance::cycles::{CyclesReport, frames_per_second};
use crate::scene::digest::{digest, digest_of};
use rayon::prelude::*;
use rtl_model::Machine;
use rtl_model::pipeline::Elaborated;
use rtl_model::timing::{self, Cycles, Detail};
use serde_json::{Value, json};
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// Machines replayed in parallel before the journal is written.
const BATCH: usize = 32;
/// Number of most promising changes replayed at a time.
const FEW: usize = 8;
/// Pairs and triples of changes whose size is computed, the cheapest or fastest ones first.
const TOGETHER: usize = 512;
/// Number of these that are replayed.
const REPLAYED_TOGETHER: usize = 96;
/// Number of fields changed together, and the factor by which the estimate may miss the aim:
/// effects of fields depend on each other. A FIFO can compensate for a slow unit after it, for
/// example.
const SEVERAL: [(usize, f64); 3] = [(2, 1.05), (3, 1.05), (2, 1.3)];
/// Least gain in speed that counts, as a part.
const LEAST_GAIN: f64 = 1e-3;

/// A machine: for each field the index of its value.
pub(super) type State = Vec<usize>;

/// Index of a field and of its new value.
type FieldChange = (usize, usize);

/// Figures of a state; None if the machine cannot be built.
type StateFigures = Option<TimingFigures>;

/// Relative frames per second and cost of a single change, when it was last measured.
#[derive(Clone, Copy, Debug)]
struct SingleEffect {
    fps: f64,
    cost: f64,
}

/// State of a search.
pub(super) struct Climb<'a> {
    options: &'a TimingOptions,
    base: Machine,
    bought: GivenMemory,
    knobs: Vec<Knob>,
    pub frames: Vec<Recorded>,
    journal: Journal,
    /// Points of the rows by key.
    known: HashMap<String, u64>,
    /// Area or gates, whichever is minimised, by state; None if the machine cannot be built.
    sizes: HashMap<State, Option<f64>>,
    figures: HashMap<State, StateFigures>,
    /// Effects of single changes.
    alone: HashMap<FieldChange, SingleEffect>,
    /// Required frames per second of the replayed frames: more than the target if other views are
    /// slower.
    pub aim: f64,
    pub tried: u64,
    /// The nearest state if none is fast enough.
    nearest: State,
    progress: Progress,
}

/// Figures of a machine, the worst over some frames; or why it cannot be built.
fn measured(
    machines: &[Machine],
    frames: &[Recorded],
    prices: &Prices,
) -> Vec<std::result::Result<TimingFigures, String>> {
    let built: Vec<_> = machines
        .par_iter()
        .map(|machine| fixed::elaborate(machine).map_err(|e| e.to_string()))
        .collect();
    let timings: Vec<_> = built.iter().flatten().map(|built| &built.timing).collect();
    let of_frame =
        |frame: &Recorded| timing::replay_all(&timings, &frame.work, Detail::Accounts).into_iter();
    let mut replayed: Vec<_> = frames.par_iter().map(of_frame).collect();
    let of_machine = |built: std::result::Result<Elaborated, String>| {
        let built = built?;
        let of_frame = |cycles: Cycles| {
            let cost = CostReport::new(&built, &cycles, prices);
            TimingFigures {
                frames_per_second: frames_per_second(&built.timing, &cycles),
                area: cost.cost.area,
                gates: cost.cost.gates.total,
                energy: cost.energy.total,
                cycles: cycles.total,
            }
        };
        let all = replayed
            .iter_mut()
            .filter_map(Iterator::next)
            .map(of_frame)
            .reduce(TimingFigures::and)
            .ok_or("there is no scene")?;
        let is_finite = [all.frames_per_second, all.area, all.gates, all.energy]
            .iter()
            .all(|figure| figure.is_finite());
        if is_finite {
            Ok(all)
        } else {
            Err("has a figure that is NaN".into())
        }
    };
    built.into_iter().map(of_machine).collect()
}

/// The key of a machine's row: a digest of everything that determines it.
fn key(machine: &Machine, digests: &[String], prices: &Prices) -> String {
    let nameless = Machine {
        name: String::new(),
        ..machine.clone()
    };
    digest(
        json!([env!("CARGO_PKG_VERSION"), digests, nameless, prices])
            .to_string()
            .as_bytes(),
    )
}

fn with(state: &State, changes: &[FieldChange]) -> State {
    let mut state = state.clone();
    changes.iter().for_each(|(knob, at)| state[*knob] = *at);
    state
}

impl<'a> Climb<'a> {
    /// Opens the journal of a folder, and resumes from it.
    ///
    /// # Errors
    /// [`Error::Input`] if it belongs to something else.
    pub fn new(
        options: &'a TimingOptions,
        base: &Machine,
        knobs: Vec<Knob>,
        folder: &Path,
    ) -> Result<Self> {
        let mut journal = Journal::open(folder, "", named(&COLUMNS))?;
        journal.keep();
        let known = journal
            .rows()
            .filter_map(|row| Some((row[1].as_str()?.to_owned(), row[0].as_u64()?)))
            .collect();
        Ok(Climb {
            options,
            base: base.clone(),
            bought: options.memory.unwrap_or_else(|| GivenMemory::of(base)),
            knobs,
            frames: Vec::new(),
            journal,
            known,
            sizes: HashMap::new(),
            figures: HashMap::new(),
            alone: HashMap::new(),
            aim: options.min_fps,
            tried: 0,
            nearest: Vec::new(),
            progress: Progress::of_messages(options.progress),
        })
    }

    /// The base as a state.
    pub fn first(&self) -> State {
        vec![0; self.knobs.len()]
    }

    /// Adds a frame that must be fast enough.
    pub fn learn(&mut self, frame: Recorded) {
        self.frames.push(frame);
        self.figures.clear();
        self.alone.clear();
    }

    /// Ends the search: writes its rows.
    pub fn write(self, folder: &Path) -> Result<Vec<std::path::PathBuf>> {
        self.journal.write(folder, "search")
    }

    /// Fields that a state changes, with the memory fields that follow from another clock.
    fn settings(&self, state: &State) -> Vec<(String, Value)> {
        let of = |(knob, at): (&Knob, &usize)| (knob.field.clone(), knob.values[*at].clone());
        let mut settings: Vec<(String, Value)> = self
            .knobs
            .iter()
            .zip(state)
            .filter(|(_, at)| **at > 0)
            .map(of)
            .collect();
        settings.extend(self.bought.fields_at(&settings));
        settings
    }

    pub fn machine(&self, state: &State) -> Result<Machine> {
        machines::with(&self.base, &self.settings(state), "the search")
    }

    /// Fields that a state changes, as PATH=VALUE.
    pub fn changes(&self, state: &State) -> Vec<String> {
        self.settings(state)
            .into_iter()
            .map(|(field, value)| format!("{field}={value}"))
            .collect()
    }

    /// Computes the sizes of states without replays.
    fn with_size(&mut self, states: &[State]) -> Result<()> {
        let new: Vec<&State> = states
            .iter()
            .filter(|state| !self.sizes.contains_key(*state))
            .collect();
        let size = |state: &&State| -> Result<Option<f64>> {
            let built = fixed::elaborate(&self.machine(state)?).ok();
            let cost = built.map(|built| Cost::new(&built, &self.options.prices));
            Ok(cost.map(|cost| {
                if self.options.minimise == Minimise::Gates {
                    cost.gates.total
                } else {
                    cost.area
                }
            }))
        };
        let sizes = in_order(new.par_iter().map(size))?;
        let new: Vec<(State, Option<f64>)> = new.into_iter().cloned().zip(sizes).collect();
        self.sizes.extend(new);
        Ok(())
    }

    /// Measures each state that was not measured yet.
    fn measure_all(&mut self, states: &[State]) -> Result<()> {
        let mut seen = HashSet::new();
        let new: Vec<&State> = states
            .iter()
            .filter(|state| !self.figures.contains_key(*state) && seen.insert(*state))
            .collect();
        let digests: Vec<String> = self
            .frames
            .iter()
            .map(|frame| frame.digest.clone())
            .collect();
        let names = self
            .frames
            .iter()
            .map(|frame| frame.name.as_str())
            .collect::<Vec<_>>()
            .join(", ");
        for batch in new.chunks(BATCH) {
            let built = in_order(batch.par_iter().map(|state| self.machine(state)))?;
            let key = |machine: &Machine| key(machine, &digests, &self.options.prices);
            let keys: Vec<String> = built.par_iter().map(key).collect();
            // Two states can be the same machine: one gives a field the value that another leaves
            // out.
            let mut new_keys = HashSet::new();
            let mut is_new =
                |key: &String| !self.known.contains_key(key) && new_keys.insert(key.clone());
            let machines: Vec<Machine> = built
                .into_iter()
                .zip(&keys)
                .filter(|(_, key)| is_new(key))
                .map(|(machine, _)| machine)
                .collect();
            let mut found = measured(&machines, &self.frames, &self.options.prices).into_iter();
            for (state, key) in batch.iter().zip(keys) {
                if !self.known.contains_key(&key)
                    && let Some(found) = found.next()
                {
                    self.keep(&key, &names, &self.changes(state).join(" "), found)?;
                }
                let figures = self.of_row(&key);
                self.figures.insert((*state).clone(), figures);
                self.tried += 1;
            }
        }
        Ok(())
    }

    /// Figures in the row of a key; None if there is no row, or the machine cannot be built.
    fn of_row(&self, key: &str) -> StateFigures {
        let row = self
            .known
            .get(key)
            .and_then(|point| self.journal.get(*point))?;
        let number = |at: usize| row[at].as_f64();
        let (cycles, gates) = (row[8].as_u64()?, number(9)?);
        Some(TimingFigures {
            frames_per_second: number(5)?,
            area: number(6)?,
            gates,
            energy: number(7)?,
            cycles,
        })
    }

    /// Figures of a machine with these changes on one view: from the journal, or drawn now and
    /// returned with the frame.
    pub fn measure_view(
        &mut self,
        machine: &Machine,
        changes: &str,
        member: &Member,
    ) -> Result<(TimingFigures, Option<Recorded>)> {
        let key = key(machine, &[digest_of(&member.scene)], &self.options.prices);
        if let Some(known) = self.of_row(&key) {
            return Ok((known, None));
        }
        let frames = [Recorded::new(member, machine)?];
        let found = measured(std::slice::from_ref(machine), &frames, &self.options.prices).pop();
        let found = found.unwrap_or_else(|| Err("there is no machine".into()));
        self.keep(&key, &member.name, changes, found.clone())?;
        let [frame] = frames;
        Ok((found.map_err(Error::job)?, Some(frame)))
    }

    /// Prints which view is drawn.
    pub fn report_view(&self, what: &str, nth: usize, count: usize, name: &str) {
        self.progress
            .set_message(format!("{what} {nth} of {count}: {name}"));
    }

    /// Adds a row to the journal.
    fn keep(
        &mut self,
        key: &str,
        scenes: &str,
        changes: &str,
        found: std::result::Result<TimingFigures, String>,
    ) -> Result<()> {
        let point = self
            .journal
            .rows()
            .next_back()
            .and_then(|row| row[0].as_u64())
            .map_or(0, |last| last + 1);
        let (misfit, cells) = match found {
            Ok(TimingFigures {
                frames_per_second,
                area,
                gates,
                energy,
                cycles,
            }) => (
                Value::Null,
                [
                    json!(frames_per_second),
                    json!(area),
                    json!(energy),
                    json!(cycles),
                    json!(gates),
                ],
            ),
            Err(sentence) => (json!(sentence), [const { Value::Null }; 5]),
        };
        let head = [
            json!(point),
            json!(key),
            json!(scenes),
            json!(changes),
            misfit,
        ];
        self.journal
            .push(point, head.into_iter().chain(cells).collect())?;
        self.known.insert(key.to_owned(), point);
        Ok(())
    }

    pub fn figures(&mut self, state: &State) -> Result<StateFigures> {
        self.measure_all(std::slice::from_ref(state))?;
        Ok(self.known_of(state))
    }

    fn known_of(&self, state: &State) -> StateFigures {
        self.figures.get(state).copied().flatten()
    }

    /// Adds a step to the path, if the machine can be built.
    pub fn step(&mut self, path: &mut Vec<TimingStep>, method: &str, state: &State) -> Result<()> {
        let Some(found) = self.figures(state)? else {
            return Ok(());
        };
        self.say(method, &found);
        path.push(TimingStep {
            method: method.to_owned(),
            found,
            tried: self.tried,
        });
        Ok(())
    }

    fn say(&self, method: &str, found: &TimingFigures) {
        let (fps, area) = (found.frames_per_second, thousands(found.area as u64));
        self.progress.set_message(format!(
            "{method}: {fps:.1} frames/s, area {area}, {} machines tried",
            self.tried
        ));
    }

    fn is_fast(&self, found: &TimingFigures) -> bool {
        found.frames_per_second >= self.aim
    }

    fn is_fast_state(&self, state: &State) -> bool {
        self.known_of(state)
            .is_some_and(|found| self.is_fast(&found))
    }

    fn cost(&self, found: &TimingFigures) -> f64 {
        found.of(self.options.minimise)
    }

    /// Every change of one field.
    fn changes_of_one(&self, from: &State) -> Vec<FieldChange> {
        let of_knob = |(knob, of): (usize, &Knob)| {
            (0..of.values.len())
                .filter(|at| *at != from[knob])
                .map(move |at| (knob, at))
                .collect()
        };
        self.knobs
            .iter()
            .enumerate()
            .flat_map::<Vec<FieldChange>, _>(of_knob)
            .collect()
    }

    /// Measures changes of a state and remembers their effects; returns the figures of those that
    /// can be built.
    fn measure_changes(
        &mut self,
        from: &State,
        changes: &[FieldChange],
    ) -> Result<Vec<(FieldChange, TimingFigures)>> {
        let states: Vec<State> = changes
            .iter()
            .map(|change| with(from, &[*change]))
            .collect();
        self.measure_all(&states)?;
        let measured: Vec<(FieldChange, TimingFigures)> = changes
            .iter()
            .zip(&states)
            .filter_map(|(change, state)| Some((*change, self.known_of(state)?)))
            .collect();
        if let Some(now) = self.known_of(from) {
            for (change, found) in &measured {
                let [fps, cost] = [
                    found.frames_per_second / now.frames_per_second,
                    self.cost(found) / self.cost(&now),
                ];
                self.alone.insert(*change, SingleEffect { fps, cost });
            }
        }
        Ok(measured)
    }

    /// Cost of each change of a state: exact if area or gates are minimised, else estimated from
    /// its last effect. Changes that cannot be built or have no estimate are left out.
    fn with_cost(
        &mut self,
        from: &State,
        now: &TimingFigures,
        changes: Vec<FieldChange>,
    ) -> Result<Vec<(f64, FieldChange)>> {
        if !self.options.minimise.is_known_at_once() {
            let cost = |change: FieldChange| {
                Some((self.alone.get(&change)?.cost * self.cost(now), change))
            };
            return Ok(changes.into_iter().filter_map(cost).collect());
        }
        let states: Vec<State> = changes
            .iter()
            .map(|change| with(from, &[*change]))
            .collect();
        self.with_size(&states)?;
        let size = |state: &State| self.sizes.get(state).copied().flatten();
        Ok(changes
            .into_iter()
            .zip(&states)
            .filter_map(|(change, state)| Some((size(state)?, change)))
            .collect())
    }

    /// The state with the least rank; the first one if several are equal.
    fn least(
        &self,
        states: impl IntoIterator<Item = State>,
        place: impl Fn(&TimingFigures) -> Option<f64>,
    ) -> Option<State> {
        let places = states
            .into_iter()
            .filter_map(|state| Some((place(&self.known_of(&state)?)?, state)));
        places
            .min_by(|(a, _), (b, _)| a.total_cmp(b))
            .map(|(_, state)| state)
    }

    /// Rating of a change that makes a frame faster: cost per gain, least is best. None if there is
    /// no gain.
    fn rating(fps_part: f64, paid: f64) -> Option<f64> {
        let gain = libm::log(fps_part);
        (gain > LEAST_GAIN).then_some(if paid <= 0.0 { -gain } else { paid / gain })
    }

    /// Changes fields, one at a time, or two if no single one helps, until the machine is fast
    /// enough or nothing helps.
    fn grown(&mut self, from: &State) -> Result<State> {
        let mut state = from.clone();
        let mut has_looked = false;
        while let Some(now) = self.figures(&state)? {
            if self.is_fast(&now) {
                break;
            }
            self.say("growing", &now);
            let mut changes = self.changes_of_one(&state);
            if has_looked {
                let gains = |change: &FieldChange| {
                    self.alone
                        .get(change)
                        .is_some_and(|alone| libm::log(alone.fps) > LEAST_GAIN)
                };
                changes.retain(gains);
                let mut costs = self.with_cost(&state, &now, changes)?;
                let rating = |(cost, change): &(f64, FieldChange)| {
                    Self::rating(self.alone[change].fps, cost - self.cost(&now))
                        .unwrap_or(f64::INFINITY)
                };
                costs.sort_by(|a, b| rating(a).total_cmp(&rating(b)));
                changes = costs
                    .into_iter()
                    .take(FEW)
                    .map(|(_, change)| change)
                    .collect();
            }
            let measured = self.measure_changes(&state, &changes)?;
            let place = |found: &TimingFigures| {
                Self::rating(
                    found.frames_per_second / now.frames_per_second,
                    self.cost(found) - self.cost(&now),
                )
            };
            let next = self.least(
                measured
                    .into_iter()
                    .map(|(change, _)| with(&state, &[change])),
                place,
            );
            state = match next {
                Some(next) => {
                    has_looked = true;
                    next
                }
                None if has_looked => {
                    has_looked = false;
                    continue;
                }
                None => match self.faster_pair(&state, &now)? {
                    Some(next) => next,
                    None => break,
                },
            };
        }
        Ok(state)
    }

    /// The pair of changes with the most gain, if no single change helps.
    fn faster_pair(&mut self, state: &State, now: &TimingFigures) -> Result<Option<State>> {
        let mut pairs = self.together(2, state, now, |alone| Some(-alone.fps));
        pairs.truncate(REPLAYED_TOGETHER);
        self.measure_all(&pairs)?;
        let least = now.frames_per_second * (1.0 + LEAST_GAIN);
        Ok(self.least(pairs, |found| {
            (found.frames_per_second > least).then_some(-found.frames_per_second)
        }))
    }

    /// States that differ in `fields` fields, sorted by the combined effects of the single changes.
    /// `place` rates them, or leaves them out.
    fn together(
        &self,
        fields: usize,
        from: &State,
        now: &TimingFigures,
        place: impl Fn(SingleEffect) -> Option<f64>,
    ) -> Vec<State> {
        // A change that cannot be built alone may be possible with another one; its effect is then
        // unknown.
        let alone = |change: &FieldChange| {
            self.alone.get(change).copied().unwrap_or(SingleEffect {
                fps: 1.0,
                cost: 1.0,
            })
        };
        let changes: Vec<(FieldChange, SingleEffect)> = self
            .changes_of_one(from)
            .into_iter()
            .map(|change| (change, alone(&change)))
            .collect();
        // For each: next index after its last change, its changes, and their combined effect.
        let mut all = vec![(
            0,
            Vec::new(),
            SingleEffect {
                fps: now.frames_per_second,
                cost: self.cost(now),
            },
        )];
        for _ in 0..fields {
            let one_more = |(behind, those, by_those): &(usize, Vec<FieldChange>, SingleEffect)| {
                let is_other = |change: &FieldChange| those.iter().all(|other| other.0 != change.0);
                let with = |(number, (change, by_one)): (usize, &(FieldChange, SingleEffect))| {
                    let both = SingleEffect {
                        fps: by_those.fps * by_one.fps,
                        cost: by_those.cost * by_one.cost,
                    };
                    is_other(change).then(|| (number + 1, [&those[..], &[*change]].concat(), both))
                };
                changes
                    .iter()
                    .enumerate()
                    .skip(*behind)
                    .filter_map(with)
                    .collect::<Vec<_>>()
            };
            all = all.iter().flat_map(one_more).collect();
        }
        let mut all: Vec<(f64, Vec<FieldChange>)> = all
            .into_iter()
            .filter_map(|(_, those, alone)| Some((place(alone)?, those)))
            .collect();
        all.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        all.into_iter()
            .take(TOGETHER)
            .map(|(_, those)| with(from, &those))
            .collect()
    }

    /// From a machine that is fast enough: takes the change with the most saving per time while the
    /// machine stays fast enough. Changes that also make it faster are taken first, because they
    /// create slack. A change that failed is not tried again.
    fn cheaper(&mut self, from: &State) -> Result<State> {
        let mut state = from.clone();
        let mut barred: HashSet<FieldChange> = HashSet::new();
        while let Some(now) = self.figures(&state)? {
            self.say("cheaper", &now);
            let changes: Vec<FieldChange> = self
                .changes_of_one(&state)
                .into_iter()
                .filter(|change| !barred.contains(change))
                .collect();
            if !self.options.minimise.is_known_at_once() {
                let new: Vec<FieldChange> = changes
                    .iter()
                    .copied()
                    .filter(|change| !self.alone.contains_key(change))
                    .collect();
                self.measure_changes(&state, &new)?;
            }
            let mut costs = self.with_cost(&state, &now, changes)?;
            costs.retain(|(cost, _)| *cost <= self.cost(&now));
            // Measures changes without a known effect.
            let new: Vec<FieldChange> = costs
                .iter()
                .map(|(_, change)| *change)
                .filter(|change| !self.alone.contains_key(change))
                .collect();
            self.measure_changes(&state, &new)?;
            let own_cost = self.cost(&now);
            let worth = |fps_part: f64, cost: f64| {
                let (gain, saved) = (libm::log(fps_part), own_cost - cost);
                if gain > LEAST_GAIN {
                    -(saved + gain * own_cost) / LEAST_GAIN
                } else {
                    -saved / (-gain).max(LEAST_GAIN)
                }
            };
            costs.retain(|(_, change)| self.alone.contains_key(change));
            costs.sort_by(|(cost, change), (other_cost, other)| {
                worth(self.alone[change].fps, *cost)
                    .total_cmp(&worth(self.alone[other].fps, *other_cost))
            });
            let few: Vec<FieldChange> = costs
                .into_iter()
                .take(FEW)
                .map(|(_, change)| change)
                .collect();
            let measured = self.measure_changes(&state, &few)?;
            let is_known = |change: &FieldChange| measured.iter().any(|(other, _)| other == change);
            let is_faster = |found: &TimingFigures| {
                found.frames_per_second > now.frames_per_second * (1.0 + LEAST_GAIN)
            };
            let is_better = |found: &TimingFigures| {
                self.cost(found) < own_cost || self.cost(found) <= own_cost && is_faster(found)
            };
            let is_barred = |found: &TimingFigures| !self.is_fast(found) || !is_better(found);
            barred.extend(few.iter().filter(|change| !is_known(change)));
            barred.extend(
                measured
                    .iter()
                    .filter(|(_, found)| is_barred(found))
                    .map(|(change, _)| *change),
            );
            let place = |found: &TimingFigures| {
                (!is_barred(found)).then(|| {
                    worth(
                        found.frames_per_second / now.frames_per_second,
                        self.cost(found),
                    )
                })
            };
            match self.least(
                measured.iter().map(|(change, _)| with(&state, &[*change])),
                place,
            ) {
                Some(next) => state = next,
                None if few.is_empty() => break,
                None => {}
            }
        }
        Ok(state)
    }

    /// The cheapest state that is fast enough and costs less than `now`. If size is minimised, the
    /// smallest are replayed first, and the search stops at the first success. At most `most`
    /// states are replayed.
    fn cheapest(
        &mut self,
        mut states: Vec<State>,
        now: &TimingFigures,
        most: usize,
    ) -> Result<Option<State>> {
        let by_size = self.options.minimise.is_known_at_once();
        if by_size {
            self.with_size(&states)?;
            let size = |state: &State| {
                self.sizes
                    .get(state)
                    .copied()
                    .flatten()
                    .unwrap_or(f64::INFINITY)
            };
            states.retain(|state| size(state) < self.cost(now));
            states.sort_by(|a, b| size(a).total_cmp(&size(b)));
        }
        states.truncate(most);
        for batch in states.chunks(if by_size { FEW } else { states.len().max(1) }) {
            self.measure_all(batch)?;
            let place = |found: &TimingFigures| {
                (self.is_fast(found) && self.cost(found) < self.cost(now))
                    .then_some(self.cost(found))
            };
            if let Some(least) = self.least(batch.iter().cloned(), place) {
                return Ok(Some(least));
            }
        }
        Ok(None)
    }

    /// From a machine that is fast enough: takes the change with the most saving, one field at a
    /// time.
    fn last_steps(&mut self, from: &State) -> Result<State> {
        let mut state = from.clone();
        while let Some(now) = self.figures(&state)? {
            self.say("last steps", &now);
            let states = self
                .changes_of_one(&state)
                .iter()
                .map(|change| with(&state, &[*change]))
                .collect();
            match self.cheapest(states, &now, usize::MAX)? {
                Some(next) => state = next,
                None => break,
            }
        }
        Ok(state)
    }

    /// The cheapest machine reached from a state; None if none of them is fast enough.
    pub fn round(&mut self, from: &State, path: &mut Vec<TimingStep>) -> Result<Option<State>> {
        let fast = self.grown(from)?;
        if !self.is_fast_state(&fast) {
            self.nearest = fast;
            return Ok(None);
        }
        self.step(path, "fast enough", &fast)?;
        let cheaper = self.cheaper(&fast)?;
        let mut best = self.last_steps(&cheaper)?;
        self.step(path, "one field at a time", &best)?;
        while let Some(now) = self.figures(&best)? {
            self.say("several fields", &now);
            let cost = self.cost(&now);
            let mut next = None;
            for (fields, doubt) in SEVERAL {
                if next.is_none() {
                    let least_fps = self.aim / doubt;
                    let place = |alone: SingleEffect| {
                        (alone.fps >= least_fps && alone.cost < cost).then_some(alone.cost)
                    };
                    let several = self.together(fields, &best, &now, place);
                    next = self.cheapest(several, &now, REPLAYED_TOGETHER)?;
                }
            }
            match next {
                Some(next) => best = self.last_steps(&next)?,
                None => break,
            }
        }
        self.step(path, "several fields at a time", &best)?;
        Ok(Some(best))
    }

    /// What limits the slowest frame.
    pub fn limited_by(&self, state: &State) -> Result<String> {
        let built = fixed::elaborate(&self.machine(state)?)?;
        let cycles = self.frames.iter().map(|frame| {
            (
                frame,
                timing::replay(&built.timing, &frame.work, Detail::Accounts),
            )
        });
        let slowest = cycles.max_by_key(|(_, cycles)| cycles.total);
        Ok(slowest.map_or(String::new(), |(frame, cycles)| {
            CyclesReport::new(&built.timing, &frame.work, &cycles).limited_by()
        }))
    }

    /// A sentence about the nearest machine.
    pub fn out_of_reach(&mut self) -> Result<String> {
        let (min_fps, state) = (self.options.min_fps, &self.nearest.clone());
        let Some(found) = self.figures(state)? else {
            return Ok("no machine of these fields and values can be built".into());
        };
        let changes = self.changes(state).join(" ");
        let changes = if changes.is_empty() {
            "the machine as it is".into()
        } else {
            changes
        };
        let limited = self.limited_by(state)?;
        let (fps, area) = (found.frames_per_second, thousands(found.area as u64));
        // Enough digits to distinguish it from the target.
        let digits = (1..9)
            .find(|digits| {
                format!("{fps:.digits$}")
                    .parse::<f64>()
                    .is_ok_and(|shown| shown < min_fps)
            })
            .unwrap_or(9);
        let of = self
            .frames
            .iter()
            .map(|frame| frame.name.as_str())
            .collect::<Vec<_>>()
            .join(", ");
        Ok(format!(
            "no machine that was tried draws {min_fps} frames/s of {of}; the nearest draws {fps:.digits$} with an area of {area}, limited by {limited}: {changes}"
        ))
    }
}

//! Climb: from a machine to the cheapest that is fast enough, by one field at a time, then by
//! several.
//!
//! ```text
//! base ─( most gain for its cost )─► fast enough ─( most saved for its time )─► ─( most saved )─► ─( two or three fields at a time )─► the cheapest
//! ```
//! A replay is what takes time, so few are made. A machine's area and its gates are known without
//! one: where these are what counts only machines of less are replayed. And what a change does is
//! remembered: it orders the next step's changes, of which the best few are replayed, all of them
//! only when none of those helps.

use super::fields::{Bought, Knob};
use super::{COLUMNS, Measured, Member, Minimise, Options, Recorded, Step};
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

/// Machines that are replayed side by side, after which the journal has them.
const BATCH: usize = 32;
/// Of the changes that seem best so many are replayed at a time.
const FEW: usize = 8;
/// Pairs and triples of changes whose size is looked at, those first that seem cheapest or fastest.
const TOGETHER: usize = 512;
/// Of them those that are replayed.
const REPLAYED_TOGETHER: usize = 96;
/// Of so many fields at a time changes are tried, though they seem too slow by such a part: what a
/// field does depends on others. A FIFO makes up for a slow unit behind it, say.
const SEVERAL: [(usize, f64); 3] = [(2, 1.05), (3, 1.05), (2, 1.3)];
/// What makes a frame faster by less gains nothing, as a part.
const LEAST_GAIN: f64 = 1e-3;

/// A machine of the search: the value of each field by its number.
pub(super) type State = Vec<usize>;

/// A field and the number of its value.
type Change = (usize, usize);

/// What was measured of a state; none where it cannot be built.
type Taken = Option<Measured>;

/// Frames a second and cost with a change, as a part of those without it, when it was last tried
/// alone.
#[derive(Clone, Copy, Debug)]
struct Alone {
    fps: f64,
    cost: f64,
}

/// A search under way.
pub(super) struct Search<'a> {
    options: &'a Options,
    base: Machine,
    bought: Bought,
    knobs: Vec<Knob>,
    pub frames: Vec<Recorded>,
    journal: Journal,
    /// Rows by their keys.
    known: HashMap<String, u64>,
    /// Area or gates, whichever counts, by state; none where it cannot be built.
    sizes: HashMap<State, Option<f64>>,
    taken: HashMap<State, Taken>,
    /// What changes did alone.
    alone: HashMap<Change, Alone>,
    /// Frames a second of the frames that are replayed: more than are asked for, where others are
    /// slower than these.
    pub aim: f64,
    pub tried: u64,
    /// What came nearest where nothing was fast enough.
    nearest: State,
    progress: Progress,
}

/// What machines take for the most demanding of some frames, or why one cannot be built.
fn measured(
    machines: &[Machine],
    frames: &[Recorded],
    prices: &Prices,
) -> Vec<std::result::Result<Measured, String>> {
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
            Measured {
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
            .reduce(Measured::and)
            .ok_or("there is no scene")?;
        let is_finite = [all.frames_per_second, all.area, all.gates, all.energy]
            .iter()
            .all(|figure| figure.is_finite());
        if is_finite {
            Ok(all)
        } else {
            Err("has a figure that is no number".into())
        }
    };
    built.into_iter().map(of_machine).collect()
}

/// The key of a machine's row: of all that determines it.
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

fn with(state: &State, changes: &[Change]) -> State {
    let mut state = state.clone();
    changes.iter().for_each(|(knob, at)| state[*knob] = *at);
    state
}

impl<'a> Search<'a> {
    /// Goes on where the folder's journal is.
    ///
    /// # Errors
    /// [`Error::Input`] where that is of something else.
    pub fn new(
        options: &'a Options,
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
        Ok(Search {
            options,
            base: base.clone(),
            bought: options.memory.unwrap_or_else(|| Bought::of(base)),
            knobs,
            frames: Vec::new(),
            journal,
            known,
            sizes: HashMap::new(),
            taken: HashMap::new(),
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

    /// One more frame that must be fast enough.
    pub fn learn(&mut self, frame: Recorded) {
        self.frames.push(frame);
        self.taken.clear();
        self.alone.clear();
    }

    /// Ends it: writes its rows.
    pub fn write(self, folder: &Path) -> Result<Vec<std::path::PathBuf>> {
        self.journal.write(folder, "search")
    }

    /// Fields that a state changes, with what memory makes of another clock.
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

    /// Knows the sizes of states; nothing is replayed for them.
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

    /// Measures states that are not known yet, each once.
    fn measure_all(&mut self, states: &[State]) -> Result<()> {
        let mut seen = HashSet::new();
        let new: Vec<&State> = states
            .iter()
            .filter(|state| !self.taken.contains_key(*state) && seen.insert(*state))
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
            let unknown = |key: &String| !self.known.contains_key(key);
            let machines: Vec<Machine> = built
                .into_iter()
                .zip(&keys)
                .filter(|(_, key)| unknown(key))
                .map(|(machine, _)| machine)
                .collect();
            let mut found = measured(&machines, &self.frames, &self.options.prices).into_iter();
            for (state, key) in batch.iter().zip(keys) {
                if !self.known.contains_key(&key)
                    && let Some(found) = found.next()
                {
                    self.keep(&key, &names, &self.changes(state).join(" "), found)?;
                }
                let taken = self.of_row(&key);
                self.taken.insert((*state).clone(), taken);
                self.tried += 1;
            }
        }
        Ok(())
    }

    /// What the row of a key says; none where there is none, or the machine cannot be built.
    fn of_row(&self, key: &str) -> Taken {
        let row = self
            .known
            .get(key)
            .and_then(|point| self.journal.get(*point))?;
        let number = |at: usize| row[at].as_f64();
        let (cycles, gates) = (row[8].as_u64()?, number(9)?);
        Some(Measured {
            frames_per_second: number(5)?,
            area: number(6)?,
            gates,
            energy: number(7)?,
            cycles,
        })
    }

    /// What a machine with these changes takes for one view, from the journal or drawn now: then
    /// with its frame.
    pub fn look_at(
        &mut self,
        machine: &Machine,
        changes: &str,
        member: &Member,
    ) -> Result<(Measured, Option<Recorded>)> {
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

    /// Says which of some views is drawn.
    pub fn say_view(&self, what: &str, nth: usize, count: usize, name: &str) {
        self.progress
            .set_message(format!("{what} {nth} of {count}: {name}"));
    }

    /// A row of the journal.
    fn keep(
        &mut self,
        key: &str,
        scenes: &str,
        changes: &str,
        found: std::result::Result<Measured, String>,
    ) -> Result<()> {
        let point = self
            .journal
            .rows()
            .next_back()
            .and_then(|row| row[0].as_u64())
            .map_or(0, |last| last + 1);
        let (misfit, cells) = match found {
            Ok(Measured {
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

    pub fn taken(&mut self, state: &State) -> Result<Taken> {
        self.measure_all(std::slice::from_ref(state))?;
        Ok(self.known_of(state))
    }

    fn known_of(&self, state: &State) -> Taken {
        self.taken.get(state).copied().flatten()
    }

    /// A step of the way, if the state can be built.
    pub fn step(&mut self, path: &mut Vec<Step>, method: &str, state: &State) -> Result<()> {
        let Some(found) = self.taken(state)? else {
            return Ok(());
        };
        self.say(method, &found);
        path.push(Step {
            method: method.to_owned(),
            found,
            tried: self.tried,
        });
        Ok(())
    }

    fn say(&self, method: &str, found: &Measured) {
        let (fps, area) = (found.frames_per_second, thousands(found.area as u64));
        self.progress.set_message(format!(
            "{method}: {fps:.1} frames/s, area {area}, {} machines tried",
            self.tried
        ));
    }

    fn is_fast(&self, found: &Measured) -> bool {
        found.frames_per_second >= self.aim
    }

    fn is_fast_state(&self, state: &State) -> bool {
        self.known_of(state)
            .is_some_and(|found| self.is_fast(&found))
    }

    fn cost(&self, found: &Measured) -> f64 {
        found.of(self.options.minimise)
    }

    /// Every change of one field.
    fn changes_of_one(&self, from: &State) -> Vec<Change> {
        let of_knob = |(knob, of): (usize, &Knob)| {
            (0..of.values.len())
                .filter(|at| *at != from[knob])
                .map(move |at| (knob, at))
                .collect()
        };
        self.knobs
            .iter()
            .enumerate()
            .flat_map::<Vec<Change>, _>(of_knob)
            .collect()
    }

    /// Measures changes of a state, and remembers what they do; of those that can be built, what
    /// each is measured.
    fn look(&mut self, from: &State, changes: &[Change]) -> Result<Vec<(Change, Measured)>> {
        let states: Vec<State> = changes
            .iter()
            .map(|change| with(from, &[*change]))
            .collect();
        self.measure_all(&states)?;
        let measured: Vec<(Change, Measured)> = changes
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
                self.alone.insert(*change, Alone { fps, cost });
            }
        }
        Ok(measured)
    }

    /// Changes of a state with what each would cost: exactly where that is area or gates, else as
    /// it seemed when it was tried. Those that cannot be built, or were never tried, are left out.
    fn with_cost(
        &mut self,
        from: &State,
        now: &Measured,
        changes: Vec<Change>,
    ) -> Result<Vec<(f64, Change)>> {
        if !self.options.minimise.is_known_at_once() {
            let cost =
                |change: Change| Some((self.alone.get(&change)?.cost * self.cost(now), change));
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

    /// Of some states that were measured the one with the least place; the first of equals.
    fn least(
        &self,
        states: impl IntoIterator<Item = State>,
        place: impl Fn(&Measured) -> Option<f64>,
    ) -> Option<State> {
        let places = states
            .into_iter()
            .filter_map(|state| Some((place(&self.known_of(&state)?)?, state)));
        places
            .min_by(|(a, _), (b, _)| a.total_cmp(b))
            .map(|(_, state)| state)
    }

    /// What a change is worth that makes a frame faster: what it costs for its gain, the least the
    /// best; none where it gains nothing.
    fn price(fps_part: f64, paid: f64) -> Option<f64> {
        let gain = libm::log(fps_part);
        (gain > LEAST_GAIN).then_some(if paid <= 0.0 { -gain } else { paid / gain })
    }

    /// Changes fields, one at a time and two where one does not help, until the machine is fast
    /// enough; as far as it goes where it never is.
    fn grown(&mut self, from: &State) -> Result<State> {
        let mut state = from.clone();
        let mut has_looked = false;
        while let Some(now) = self.taken(&state)? {
            if self.is_fast(&now) {
                break;
            }
            self.say("growing", &now);
            let mut changes = self.changes_of_one(&state);
            if has_looked {
                let gains = |change: &Change| {
                    self.alone
                        .get(change)
                        .is_some_and(|alone| libm::log(alone.fps) > LEAST_GAIN)
                };
                changes.retain(gains);
                let mut costs = self.with_cost(&state, &now, changes)?;
                let price = |(cost, change): &(f64, Change)| {
                    Self::price(self.alone[change].fps, cost - self.cost(&now))
                        .unwrap_or(f64::INFINITY)
                };
                costs.sort_by(|a, b| price(a).total_cmp(&price(b)));
                changes = costs
                    .into_iter()
                    .take(FEW)
                    .map(|(_, change)| change)
                    .collect();
            }
            let measured = self.look(&state, &changes)?;
            let place = |found: &Measured| {
                Self::price(
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

    /// Two changes that make it faster where none does alone: the most.
    fn faster_pair(&mut self, state: &State, now: &Measured) -> Result<Option<State>> {
        let mut pairs = self.together(2, state, now, |alone| Some(-alone.fps));
        pairs.truncate(REPLAYED_TOGETHER);
        self.measure_all(&pairs)?;
        let least = now.frames_per_second * (1.0 + LEAST_GAIN);
        Ok(self.least(pairs, |found| {
            (found.frames_per_second > least).then_some(-found.frames_per_second)
        }))
    }

    /// States that differ in so many fields, those first that are best by what each change did
    /// alone: `place` orders them by that, or leaves them out.
    fn together(
        &self,
        fields: usize,
        from: &State,
        now: &Measured,
        place: impl Fn(Alone) -> Option<f64>,
    ) -> Vec<State> {
        // A change that cannot be built alone may be with another; nothing is known of it then.
        let alone = |change: &Change| {
            self.alone.get(change).copied().unwrap_or(Alone {
                fps: 1.0,
                cost: 1.0,
            })
        };
        let changes: Vec<(Change, Alone)> = self
            .changes_of_one(from)
            .into_iter()
            .map(|change| (change, alone(&change)))
            .collect();
        // Of each the number behind its last change, its changes, and what they make together.
        let mut all = vec![(
            0,
            Vec::new(),
            Alone {
                fps: now.frames_per_second,
                cost: self.cost(now),
            },
        )];
        for _ in 0..fields {
            let one_more = |(behind, those, by_those): &(usize, Vec<Change>, Alone)| {
                let is_other = |change: &Change| those.iter().all(|other| other.0 != change.0);
                let with = |(number, (change, by_one)): (usize, &(Change, Alone))| {
                    let both = Alone {
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
        let mut all: Vec<(f64, Vec<Change>)> = all
            .into_iter()
            .filter_map(|(_, those, alone)| Some((place(alone)?, those)))
            .collect();
        all.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        all.into_iter()
            .take(TOGETHER)
            .map(|(_, those)| with(from, &those))
            .collect()
    }

    /// From a machine that is fast enough: changes what saves most for the time that it takes,
    /// while it stays so; what makes it faster for nothing goes first, for that is time to spend.
    /// What was no use once is not asked again.
    fn cheaper(&mut self, from: &State) -> Result<State> {
        let mut state = from.clone();
        let mut barred: HashSet<Change> = HashSet::new();
        while let Some(now) = self.taken(&state)? {
            self.say("cheaper", &now);
            let changes: Vec<Change> = self
                .changes_of_one(&state)
                .into_iter()
                .filter(|change| !barred.contains(change))
                .collect();
            if !self.options.minimise.is_known_at_once() {
                let new: Vec<Change> = changes
                    .iter()
                    .copied()
                    .filter(|change| !self.alone.contains_key(change))
                    .collect();
                self.look(&state, &new)?;
            }
            let mut costs = self.with_cost(&state, &now, changes)?;
            costs.retain(|(cost, _)| *cost <= self.cost(&now));
            // What was never tried is tried now.
            let new: Vec<Change> = costs
                .iter()
                .map(|(_, change)| *change)
                .filter(|change| !self.alone.contains_key(change))
                .collect();
            self.look(&state, &new)?;
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
            let few: Vec<Change> = costs
                .into_iter()
                .take(FEW)
                .map(|(_, change)| change)
                .collect();
            let measured = self.look(&state, &few)?;
            let is_known = |change: &Change| measured.iter().any(|(other, _)| other == change);
            let is_faster = |found: &Measured| {
                found.frames_per_second > now.frames_per_second * (1.0 + LEAST_GAIN)
            };
            let is_better = |found: &Measured| {
                self.cost(found) < own_cost || self.cost(found) <= own_cost && is_faster(found)
            };
            let is_barred = |found: &Measured| !self.is_fast(found) || !is_better(found);
            barred.extend(few.iter().filter(|change| !is_known(change)));
            barred.extend(
                measured
                    .iter()
                    .filter(|(_, found)| is_barred(found))
                    .map(|(change, _)| *change),
            );
            let place = |found: &Measured| {
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

    /// The cheapest of some states that is fast enough and costs less than `now`: the smallest are
    /// replayed first, where size is what counts, the rest not at all; at most so many.
    fn cheapest(
        &mut self,
        mut states: Vec<State>,
        now: &Measured,
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
            let place = |found: &Measured| {
                (self.is_fast(found) && self.cost(found) < self.cost(now))
                    .then_some(self.cost(found))
            };
            if let Some(least) = self.least(batch.iter().cloned(), place) {
                return Ok(Some(least));
            }
        }
        Ok(None)
    }

    /// From a machine that is fast enough: what saves most is changed, one field at a time.
    fn last_steps(&mut self, from: &State) -> Result<State> {
        let mut state = from.clone();
        while let Some(now) = self.taken(&state)? {
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

    /// The cheapest that is met from a machine on; none where none that was met is fast enough.
    pub fn round(&mut self, from: &State, path: &mut Vec<Step>) -> Result<Option<State>> {
        let fast = self.grown(from)?;
        if !self.is_fast_state(&fast) {
            self.nearest = fast;
            return Ok(None);
        }
        self.step(path, "fast enough", &fast)?;
        let cheaper = self.cheaper(&fast)?;
        let mut best = self.last_steps(&cheaper)?;
        self.step(path, "one field at a time", &best)?;
        while let Some(now) = self.taken(&best)? {
            self.say("several fields", &now);
            let cost = self.cost(&now);
            let mut next = None;
            for (fields, doubt) in SEVERAL {
                if next.is_none() {
                    let least_fps = self.aim / doubt;
                    let place = |alone: Alone| {
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

    /// Says what comes nearest.
    pub fn out_of_reach(&mut self) -> Result<String> {
        let (min_fps, state) = (self.options.min_fps, &self.nearest.clone());
        let Some(found) = self.taken(state)? else {
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
        // As many digits as tell it from what is wanted.
        let digits = (1..9)
            .find(|digits| {
                format!("{fps:.digits$}")
                    .parse::<f64>()
                    .is_ok_and(|told| told < min_fps)
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

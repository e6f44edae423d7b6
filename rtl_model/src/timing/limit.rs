//! Limit: names what limits a frame, by replaying it with each limit lifted: what gains most does.
//!
//! ```text
//! unit infinitely fast ─┐
//! hazard of one cycle ──┼─► replay ─► cycles less than before: the most of them
//! ideal memory ─────────┘
//! ```
//! Who is busiest need not limit: it may work beside something slower that is blocked, by a pixel
//! under way say, most of the time.
//!
//! A frame is the longest way through what waits for what, and a way has each cycle of a unit at
//! most once: it becomes shorter by no more than the unit is busy, or blocked by itself; without
//! the time that shade takes by no more than others wait for it. With ideal memory it still takes
//! what the busiest unit of each pass does. So what could gain most is tried first, and what cannot
//! gain more than was found is not tried. Where units share memory, a replay may gain a little
//! more, by another order of requests: that is not what the unit takes, and does not count.
//!
//! Laws: `no_limit_costs_more_than_its_bound_without_a_replay`,
//! `lifting_the_limit_gains_most`,
//! `a_hazard_that_blocks_is_the_limit_not_a_busy_memory`.

use super::{Cycles, Detail, UnitCycles, Wait, replay, replay_all};
use crate::elaboration::microarchitecture::Microarchitecture;
use crate::elaboration::unit;
use crate::work::Work;

/// Why something limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Limited {
    /// A unit's own cycles.
    Work,
    /// A unit may not take a pixel that is still under way in it.
    Hazard,
    /// Bytes move no faster.
    Memory,
}

/// Limit of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limit {
    /// A unit, or `memory`.
    pub name: &'static str,
    /// Kind of limit.
    pub by: Limited,
    /// Cycles of the frame without this limit.
    pub without: u64,
}

/// What a frame that took these cycles is limited by. Of equals the first in the order of the
/// diagram, then hazards, then memory; where nothing alone gains anything, what is busiest.
pub fn limit(timing: &Microarchitecture, work: &Work, cycles: &Cycles) -> Limit {
    let mut search = Search::new(timing, work, cycles);
    while let Some(lifted) = search.next() {
        search.tried(replay(&lifted, work, Detail::Total).total);
    }
    search.found()
}

/// The same of several machines, whose replays go abreast.
pub fn limits(frames: &[(&Microarchitecture, &Cycles)], work: &Work) -> Vec<Limit> {
    let mut searches: Vec<Search> = frames
        .iter()
        .map(|(timing, cycles)| Search::new(timing, work, cycles))
        .collect();
    loop {
        let (mut tried, mut lifted) = (Vec::new(), Vec::new());
        for search in &mut searches {
            let next = search.next();
            tried.extend(next.is_some().then_some(search));
            lifted.extend(next);
        }
        if lifted.is_empty() {
            return searches.iter().map(Search::found).collect();
        }
        let totals = replay_all(&lifted.iter().collect::<Vec<_>>(), work, Detail::Total);
        tried
            .into_iter()
            .zip(totals)
            .for_each(|(search, cycles)| search.tried(cycles.total));
    }
}

/// What limits a machine, as far as it is known.
struct Search<'a> {
    timing: &'a Microarchitecture,
    cycles: &'a Cycles,
    /// What is not tried yet, that which could gain least first.
    left: Vec<Candidate>,
    /// What is tried now, and what gained most so far, with its place.
    now: Option<Candidate>,
    best: Option<(Limit, usize)>,
}

impl<'a> Search<'a> {
    fn new(timing: &'a Microarchitecture, work: &Work, cycles: &'a Cycles) -> Self {
        let mut left = candidates(timing, work, cycles);
        // Stable: equals stay in order.
        left.sort_by_key(|(at_most, ..)| std::cmp::Reverse(*at_most));
        left.reverse();
        Search {
            timing,
            cycles,
            left,
            now: None,
            best: None,
        }
    }

    fn gained(&self) -> u64 {
        self.best
            .map_or(0, |(limit, _)| self.cycles.total - limit.without)
    }

    /// The machine without what comes next, if that may gain more than what was tried.
    fn next(&mut self) -> Option<Microarchitecture> {
        let gained = self.gained();
        self.now = self
            .left
            .pop()
            .filter(|(at_most, ..)| *at_most >= gained && *at_most > 0);
        if self.now.is_none() {
            self.left.clear();
        }
        self.now
            .map(|(_, _, name, by)| lifted(self.timing, name, by))
    }

    /// Without that it takes so many cycles.
    fn tried(&mut self, without: u64) {
        let Some((at_most, place, name, by)) = self.now.take() else {
            return;
        };
        let (total, gained) = (self.cycles.total, self.gained());
        let without = without.max(total.saturating_sub(at_most)).min(total);
        let gain = total - without;
        if gain > gained
            || gain == gained && gain > 0 && self.best.is_some_and(|(_, before)| place < before)
        {
            self.best = Some((Limit { name, by, without }, place));
        }
    }

    fn found(&self) -> Limit {
        self.best
            .map_or_else(|| busiest(self.cycles), |(limit, _)| limit)
    }
}

/// How many cycles a frame that took these could gain at most without each of its limits, by
/// itself, as far as that is known without a replay.
pub fn most_gained(
    timing: &Microarchitecture,
    work: &Work,
    cycles: &Cycles,
) -> Vec<(&'static str, Limited, u64)> {
    candidates(timing, work, cycles)
        .into_iter()
        .map(|(at_most, _, name, by)| (name, by, at_most))
        .collect()
}

type Candidate = (u64, usize, &'static str, Limited);

/// How many cycles each limit could cost at most, and its place among equals.
fn candidates(timing: &Microarchitecture, work: &Work, cycles: &Cycles) -> Vec<Candidate> {
    let mut all: Vec<Candidate> = Vec::new();
    for unit in &cycles.units {
        // Whoever asks shade waits for its latency, too.
        let waits = if unit.name.ends_with("shade") {
            unit.items * u64::from(timing.shade.latency)
        } else {
            0
        };
        match all.iter_mut().find(|(_, _, name, _)| *name == unit.name) {
            Some((at_most, ..)) => *at_most += unit.account.busy + waits,
            None => all.push((
                unit.account.busy + waits,
                all.len(),
                unit.name,
                Limited::Work,
            )),
        }
    }
    // Look-ups stand still while too many lines are on their way.
    let held = |unit: &UnitCycles| {
        if unit.name == "cache" {
            unit.account.memory
        } else {
            0
        }
    };
    let held: u64 = cycles.units.iter().map(held).sum();
    all.iter_mut()
        .filter(|(_, _, name, _)| *name == "cache")
        .for_each(|(at_most, ..)| *at_most += held);
    let hazard = |unit: &UnitCycles| {
        unit.blocked_by
            .iter()
            .filter(|(wait, _)| *wait == Wait::Hazard)
            .map(|(_, cycles)| cycles)
            .sum::<u64>()
    };
    all.push((
        cycles.units.iter().map(hazard).sum(),
        all.len(),
        "fragment",
        Limited::Hazard,
    ));
    if !timing.timing.memory.ideal {
        // Who waits for what memory holds up is not known: it may be all.
        all.push((cycles.total, all.len(), "memory", Limited::Memory));
    }
    // Where pixels stop, whatever is faster may leave more out than it is itself busy with. Of
    // several side by side a way may go through one while the others are busy, or merges under way.
    if work.stops() || !timing.is_single() || timing.sorters() > 1 {
        all.iter_mut()
            .filter(|(at_most, ..)| *at_most > 0)
            .for_each(|(at_most, ..)| *at_most = cycles.total);
        return all;
    }
    // What mirrors waits for its surroundings, from memory perhaps.
    if !work.mirrors {
        for (at_most, _, name, by) in &mut all {
            match (*name, *by) {
                (unit::SHADE, Limited::Work) if !work.preshaded => *at_most = cycles.light,
                (_, Limited::Memory) => {
                    *at_most = cycles.total.saturating_sub(without_memory(cycles))
                }
                _ => {}
            }
        }
    }
    all
}

fn of<'a>(cycles: &'a Cycles, name: &'a str) -> impl Iterator<Item = &'a UnitCycles> {
    cycles.units.iter().filter(move |unit| unit.name == name)
}

/// What a frame takes at least with ideal memory. Its second pass begins when every entry is
/// written, and sorted. Shade is free whenever one fragment unit asks it, so that merges take as
/// long.
fn without_memory(cycles: &Cycles) -> u64 {
    let busy = |name: &str| of(cycles, name).map(|unit| unit.account.busy).sum::<u64>();
    let units = [
        unit::RASTER,
        unit::GAUSS,
        "cache",
        unit::FRAGMENT,
        unit::RESOLVE,
    ];
    busy("bin") + busy(unit::SORT) + units.into_iter().map(busy).max().unwrap_or(0)
}

/// The same microarchitecture without a limit.
fn lifted(timing: &Microarchitecture, name: &'static str, by: Limited) -> Microarchitecture {
    let mut other = timing.clone();
    match by {
        Limited::Work => other.lifted = Some(name),
        Limited::Hazard => other.hazard = 1,
        Limited::Memory => other.timing.memory.ideal = true,
    }
    other
}

fn busiest(cycles: &Cycles) -> Limit {
    let without = cycles.total;
    match cycles.units.iter().max_by_key(|unit| unit.account.busy) {
        Some(unit) if unit.account.busy >= cycles.memory.busy => Limit {
            name: unit.name,
            by: Limited::Work,
            without,
        },
        _ => Limit {
            name: "memory",
            by: Limited::Memory,
            without,
        },
    }
}

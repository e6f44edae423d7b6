//! Limit: finds the limit of a frame by replays with each limit lifted: the one with the greatest
//! gain.
//!
//! ```text
//! unit infinitely fast ─┐
//! hazard of one cycle ──┼─► replay ─► cycles saved: the greatest number of them
//! ideal memory ─────────┘
//! ```
//! The busiest unit need not be the limit: it can run in parallel with something slower that is
//! blocked most of the time, for example by a pixel in flight.
//!
//! A frame takes the longest path through all dependencies, and a path contains each cycle of a
//! unit at most once. So a lifted unit saves at most the cycles in which it is busy or blocked by
//! itself; lifted shade saves at most the cycles for which others stall for it. The frame still
//! takes the busy cycles of every other unit of the pass, and those in which memory moves bytes.
//! With ideal memory, it takes the cycles of the busiest unit of each pass. So candidates are tried
//! in the order of these bounds, and those that cannot save more than the best one so far are not
//! tried. If units share memory, a replay can save a little more because requests change their
//! order. This is not due to the unit, and is not counted.
//!
//! Laws: `no_limit_costs_more_than_its_bound_without_a_replay`,
//! `lifting_the_limit_gains_most`,
//! `a_hazard_that_blocks_is_the_limit_not_a_busy_memory`.

use super::binned::Listed;
use super::binned::batched::replay_frame;
use super::{Cycles, Detail, RecordedFrame, UnitCycles, Wait, replay_on};
use crate::elaboration::microarchitecture::Microarchitecture;
use crate::elaboration::unit;
use crate::machine::timing::Organisation;
use crate::work::Work;

/// Kind of a limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Limited {
    /// Cycles of the unit.
    Work,
    /// The unit stalls for a pixel that is in flight in it.
    Hazard,
    /// Bandwidth and latency of memory.
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

/// The limit of a frame with these cycles. For equal gains, the first in the order of the diagram,
/// then hazards, then memory; if no single limit gains anything, the busiest unit.
pub fn limit(timing: &Microarchitecture, work: &Work, cycles: &Cycles) -> Limit {
    limit_on(timing, &RecordedFrame::new(work), cycles)
}

/// [`limit`], with what the replays of a frame share.
pub(super) fn limit_on(
    timing: &Microarchitecture,
    frame: &RecordedFrame,
    cycles: &Cycles,
) -> Limit {
    let work = frame.work;
    let mut search = LimitSearch::new(timing, work, cycles);
    // The first pass and the sort, for units behind them.
    let mut listed = None;
    while let Some(lifted) = search.next() {
        let detail = Detail::Total;
        let is_behind = timing.timing.organisation == Organisation::Binned
            && timing.same_lists_as(&lifted, work.preshaded);
        let cycles = if is_behind {
            let lists = frame.lists(timing);
            let listed = listed.get_or_insert_with(|| Listed::new(timing, work, &lists, detail));
            listed.clone().draw(&lifted, frame, &lists, detail)
        } else {
            replay_on(&lifted, frame, detail)
        };
        search.tried(cycles.total);
    }
    search.found()
}

/// [`limit`] for several machines, with batched replays.
pub fn limits(frames: &[(&Microarchitecture, &Cycles)], work: &Work) -> Vec<Limit> {
    limits_on(frames, &RecordedFrame::new(work))
}

/// [`limits`], with what the replays of a frame share.
pub(super) fn limits_on(
    frames: &[(&Microarchitecture, &Cycles)],
    frame: &RecordedFrame,
) -> Vec<Limit> {
    let mut searches: Vec<LimitSearch> = frames
        .iter()
        .map(|(timing, cycles)| LimitSearch::new(timing, frame.work, cycles))
        .collect();
    loop {
        let (mut tried, mut lifted) = (Vec::new(), Vec::new());
        for search in &mut searches {
            let next = search.next();
            tried.extend(next.is_some().then_some(search));
            lifted.extend(next);
        }
        if lifted.is_empty() {
            return searches.iter().map(LimitSearch::found).collect();
        }
        let totals = replay_frame(&lifted.iter().collect::<Vec<_>>(), frame, Detail::Total);
        tried
            .into_iter()
            .zip(totals)
            .for_each(|(search, cycles)| search.tried(cycles.total));
    }
}

/// Search for the limit of a machine.
struct LimitSearch<'a> {
    timing: &'a Microarchitecture,
    cycles: &'a Cycles,
    /// Candidates that are not tried yet, the one with the smallest bound first.
    left: Vec<Candidate>,
    /// The current candidate, and the best one so far with its rank.
    now: Option<Candidate>,
    best: Option<(Limit, usize)>,
}

impl<'a> LimitSearch<'a> {
    fn new(timing: &'a Microarchitecture, work: &Work, cycles: &'a Cycles) -> Self {
        let mut left = candidates(timing, work, cycles);
        // A stable sort: equal bounds stay in order.
        left.sort_by_key(|(at_most, ..)| std::cmp::Reverse(*at_most));
        left.reverse();
        LimitSearch {
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

    /// The machine without the next candidate, if that can gain more than the best one so far.
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

    /// Records the cycles without the current candidate.
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

/// Bounds of the cycles that a frame can save by lifting each of its limits, without replays.
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

/// The bound of each limit, and its rank among equal ones.
fn candidates(timing: &Microarchitecture, work: &Work, cycles: &Cycles) -> Vec<Candidate> {
    let mut all: Vec<Candidate> = Vec::new();
    for unit in &cycles.units {
        // Requesters of shade stall for its latency.
        let stalls = if unit.name.ends_with("shade") {
            unit.items * u64::from(timing.shade.latency)
        } else {
            0
        };
        match all.iter_mut().find(|(_, _, name, _)| *name == unit.name) {
            Some((at_most, ..)) => *at_most += unit.account.busy + stalls,
            None => all.push((
                unit.account.busy + stalls,
                all.len(),
                unit.name,
                Limited::Work,
            )),
        }
    }
    // Look-ups stall while too many lines are in flight.
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
        // Stalls for memory are not attributed to their causes: all cycles can be due to it.
        all.push((cycles.total, all.len(), "memory", Limited::Memory));
    }
    // If `list` makes masks, it is also what the entries that have arrived stall for.
    if timing.masks_of_list().is_some() {
        all.iter_mut()
            .filter(|(_, _, name, _)| *name == unit::LIST)
            .for_each(|(at_most, ..)| *at_most = cycles.total);
    }
    // If pixels stop, a faster unit can skip more work than its own. With parallel units, the
    // longest path can go through one of them while the others are busy, or while merges are in
    // flight. Lists that are kept are written by the second pass.
    let is_simple = timing.is_single() && timing.sorters() < 2 && !timing.overlaps_sort();
    if work.stops() || !is_simple || timing.keeps_lists() {
        all.iter_mut()
            .filter(|(at_most, ..)| *at_most > 0)
            .for_each(|(at_most, _, name, by)| *at_most = of_pass(timing, cycles, name, *by));
        return all;
    }
    // Reflections stall for texels, possibly from memory.
    if !work.mirrors {
        save_at_most_the_rest(cycles, &mut all);
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

/// Limits what units of the second pass save: without one of them, the pass still takes the busy
/// cycles of any other one, and all bytes of the frame still pass through memory.
fn save_at_most_the_rest(cycles: &Cycles, all: &mut [Candidate]) {
    let Some([_, from]) = cycles.passes else {
        return;
    };
    const SECOND: [&str; 5] = [
        unit::LIST,
        unit::RASTER,
        unit::GAUSS,
        unit::FRAGMENT,
        unit::RESOLVE,
    ];
    for (at_most, _, name, by) in all {
        if *by == Limited::Memory || !SECOND.contains(name) {
            continue;
        }
        let others = [unit::RASTER, unit::GAUSS, unit::FRAGMENT]
            .into_iter()
            .filter(|other| other != name || *by == Limited::Hazard);
        let least = others
            .map(|other| from + busy(cycles, other))
            .chain([cycles.memory.busy])
            .max()
            .unwrap_or(0);
        *at_most = (*at_most).min(cycles.total.saturating_sub(least));
    }
}

/// Cycles of the pass that a unit belongs to, or of the sort. They are consecutive, so a unit of
/// one of them saves nothing in another. Memory works in all of them.
fn of_pass(timing: &Microarchitecture, cycles: &Cycles, name: &str, by: Limited) -> u64 {
    let Some([listed, from]) = cycles.passes.filter(|_| by != Limited::Memory) else {
        return cycles.total;
    };
    let first = [
        "fetch",
        unit::PROJECT,
        unit::ELLIPSE,
        unit::COLOUR,
        super::SETUP_SHADE,
        "bin",
    ];
    // The shade unit of an engine may also light splats in the first pass.
    match name {
        name if first.contains(&name) => listed,
        unit::SORT if !timing.overlaps_sort() => from - listed,
        unit::SHADE => cycles.total,
        _ => cycles.total - from,
    }
}

/// Busy cycles of the units with a name.
fn busy(cycles: &Cycles, name: &str) -> u64 {
    let units = cycles.units.iter().filter(|unit| unit.name == name);
    units.map(|unit| unit.account.busy).sum()
}

/// Least cycles of a frame with ideal memory. Its second pass begins when every entry is written
/// and sorted. Shade is free whenever the only fragment unit requests it, so merges take the same
/// time.
fn without_memory(cycles: &Cycles) -> u64 {
    let busy = |name| busy(cycles, name);
    let units = [
        unit::RASTER,
        unit::GAUSS,
        "cache",
        unit::FRAGMENT,
        unit::RESOLVE,
    ];
    busy("bin") + busy(unit::SORT) + units.into_iter().map(busy).max().unwrap_or(0)
}

/// The microarchitecture without a limit.
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

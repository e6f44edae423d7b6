//! Descent: finds the least area at which a load stays at most 1, over the number of steps taken
//! from each knob.
//!
//! ```text
//! limit of each knob alone ─► all at their limits, less d ─┬─ d too small: steps given back, best relief per area  (min+1)
//!                                                          ├─ d large enough: steps taken, most area per harm      (max−1)
//!                                                          └─ from the better one: random exchanges, cooling       (annealing)
//! ```
//! Both greedy searches are lazy: the effect of a step is only measured again when the step comes
//! up, because it changes little in between. Source of min+1 and max−1: Cantin, Savaria, Lavoie, *A
//! comparison of automatic word length optimization procedures* (ISCAS 2002).
//!
//! Laws: `what_is_found_is_close_to_the_best_there_is`, `no_single_step_is_left`.

use crate::error::Result;
use crate::scene::digest::mixed;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// A problem for a descent.
pub trait Problem {
    /// Number of steps of each knob.
    fn most(&self) -> Vec<u32>;

    /// Area; None if the machine cannot be built.
    fn area(&mut self, steps: &[u32]) -> Option<f64>;

    /// Squared error as a part of the greatest allowed squared error. At most 1 meets the target;
    /// infinite if the machine cannot be built.
    ///
    /// # Errors
    /// If a result cannot be stored.
    fn load(&mut self, steps: &[u32]) -> Result<f64>;

    /// The load without the margin that [`Problem::load`] includes; equal if there is no margin.
    ///
    /// # Errors
    /// As [`Problem::load`].
    fn load_without_margin(&mut self, steps: &[u32]) -> Result<f64> {
        self.load(steps)
    }

    /// Whether a step of the knob does harm everywhere alike, so that loads which are only compared
    /// show it.
    fn is_gradual(&self, _knob: usize) -> bool {
        true
    }

    /// Loads that are only compared with each other: they may be less exact than [`Problem::load`].
    ///
    /// # Errors
    /// As [`Problem::load`].
    fn compared(&mut self, all: &[Vec<u32>]) -> Result<Vec<f64>> {
        loads(self, all)
    }

    /// Learns the state that a descent is in now. Returns its load if that was measured again, more
    /// exactly than before.
    ///
    /// # Errors
    /// As [`Problem::load`].
    fn took(&mut self, _steps: &[u32]) -> Result<Option<f64>> {
        Ok(None)
    }

    /// Number of loads that can be measured at once; 1 if there is no gain.
    fn width(&self) -> usize {
        1
    }

    /// Measures loads in advance. Results do not depend on it.
    ///
    /// # Errors
    /// If a measurement fails.
    fn prefetch(&mut self, _steps: &[Vec<u32>]) -> Result<()> {
        Ok(())
    }

    /// A load that was measured before.
    fn prefetched(&self, _steps: &[u32]) -> Option<f64> {
        None
    }
}

/// Replaces an infinite load.
const LARGEST_LOAD: f64 = 1e12;
/// A step with a greater load fails clearly.
const CLEARLY: f64 = 1.02;
/// Less harm than this counts as none.
const LEAST_HARM: f64 = 1e-3;
/// Rise as a part of the area that annealing accepts in two of five cases, at the start and at the
/// end.
const HOT: f64 = 0.004;
const COLD: f64 = 0.0001;
/// Candidate exchanges per exchange that is measured.
const CANDIDATES: u64 = 40;

fn with(steps: &[u32], knob: usize, value: u32) -> Vec<u32> {
    let mut steps = steps.to_vec();
    steps[knob] = value;
    steps
}

fn load(problem: &mut impl Problem, steps: &[u32]) -> Result<f64> {
    Ok(problem.load(steps)?.min(LARGEST_LOAD))
}

/// The load of a state that a descent takes.
fn took(problem: &mut impl Problem, steps: &[u32]) -> Result<f64> {
    let load = problem.load(steps)?;
    Ok(problem.took(steps)?.unwrap_or(load).min(LARGEST_LOAD))
}

/// Whether a state meets the target, also when it is taken.
fn is_met(problem: &mut impl Problem, steps: &[u32]) -> Result<bool> {
    Ok(problem.load(steps)? <= 1.0 && took(problem, steps)? <= 1.0)
}

/// Loads that may be measured at once.
pub fn loads(problem: &mut (impl Problem + ?Sized), all: &[Vec<u32>]) -> Result<Vec<f64>> {
    problem.prefetch(all)?;
    all.iter().map(|steps| problem.load(steps)).collect()
}

/// A load. If it was not measured before, loads that may be requested after it are measured too.
fn load_ahead<P: Problem>(
    problem: &mut P,
    steps: &[u32],
    others: impl FnOnce(&mut P, usize) -> Vec<Vec<u32>>,
) -> Result<f64> {
    let width = problem.width();
    if width > 1 && problem.prefetched(steps).is_none() {
        let mut all = others(problem, width - 1);
        all.insert(0, steps.to_vec());
        problem.prefetch(&all)?;
    }
    problem.load(steps)
}

/// Measures the loads that bisection will request, for all knobs in parallel.
fn prefetch_limits(problem: &mut impl Problem, none: &[u32]) -> Result<()> {
    let mut halves: Vec<[u32; 2]> = problem.most().iter().map(|most| [0, most + 1]).collect();
    let middle = |[well, ill]: &[u32; 2]| (ill - well > 1).then(|| u32::midpoint(*well, *ill));
    while problem.width() > 1 {
        let requests: Vec<(usize, u32)> = halves
            .iter()
            .enumerate()
            .filter_map(|(knob, half)| Some((knob, middle(half)?)))
            .collect();
        if requests.is_empty() {
            break;
        }
        let steps: Vec<Vec<u32>> = requests
            .iter()
            .map(|(knob, middle)| with(none, *knob, *middle))
            .collect();
        problem.prefetch(&steps)?;
        for ((knob, middle), steps) in requests.iter().zip(&steps) {
            let is_well = problem.prefetched(steps).is_some_and(|load| load <= 1.0);
            halves[*knob][usize::from(!is_well)] = *middle;
        }
    }
    Ok(())
}

/// Most steps of each knob while the others have none.
pub fn limits(problem: &mut impl Problem) -> Result<Vec<u32>> {
    let most = problem.most();
    let none = vec![0; most.len()];
    prefetch_limits(problem, &none)?;
    let mut limits = none.clone();
    for knob in 0..most.len() {
        let [mut well, mut ill] = [0, most[knob] + 1];
        while ill - well > 1 {
            let middle = u32::midpoint(well, ill);
            if problem.load(&with(&none, knob, middle))? <= 1.0 {
                well = middle
            } else {
                ill = middle
            }
        }
        limits[knob] = well;
    }
    Ok(limits)
}

/// All knobs at their limits, less the fewest steps at which the target is met; and the same with
/// one step fewer.
pub fn starts(problem: &mut impl Problem, limits: &[u32]) -> Result<(Vec<u32>, Vec<u32>)> {
    let mut ill = limits.to_vec();
    for back in 0.. {
        let less = |back: u32| -> Vec<u32> {
            limits
                .iter()
                .map(|limit| limit.saturating_sub(back))
                .collect()
        };
        let steps = less(back);
        if load_ahead(problem, &steps, |_, width| {
            (back + 1..).take(width).map(less).collect()
        })? <= 1.0
            || steps.iter().all(|step| *step == 0)
        {
            return Ok((steps, ill));
        }
        ill = steps;
    }
    Ok((limits.to_vec(), ill))
}

/// A candidate step, and its rating when it was last measured.
struct Candidate {
    score: f64,
    knob: usize,
    /// Number of the state in which it was measured.
    at: u64,
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Candidate {}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        self.score
            .total_cmp(&other.score)
            .then(other.knob.cmp(&self.knob))
    }
}

/// One step of each knob, with the best possible rating until it is measured.
fn unmeasured(knobs: usize) -> BinaryHeap<Candidate> {
    (0..knobs)
        .map(|knob| Candidate {
            score: f64::INFINITY,
            knob,
            at: 0,
        })
        .collect()
}

/// The candidates that come up next, as known so far: one step more or less of a knob.
fn next_candidates(
    candidates: &BinaryHeap<Candidate>,
    steps: &[u32],
    most: &[u32],
    more: i32,
    count: usize,
) -> Vec<Vec<u32>> {
    let mut best: Vec<&Candidate> = candidates.iter().collect();
    best.sort_by(|a, b| b.cmp(a));
    let step = |candidate: &Candidate| {
        let value = steps[candidate.knob]
            .checked_add_signed(more)
            .filter(|value| *value <= most[candidate.knob])?;
        Some(with(steps, candidate.knob, value))
    };
    best.into_iter().filter_map(step).take(count).collect()
}

/// From a state that misses the target: gives steps back, one by one, until it is met.
pub fn given_back(problem: &mut impl Problem, from: &[u32]) -> Result<Vec<u32>> {
    let most = problem.most();
    let mut steps = from.to_vec();
    let mut now = load(problem, &steps)?;
    let mut state = 1;
    let mut candidates = unmeasured(steps.len());
    while now > 1.0 {
        let Some(candidate) = candidates.pop() else {
            // No single step helps: all knobs give one back.
            if steps.iter().all(|step| *step == 0) {
                break;
            }
            steps
                .iter_mut()
                .for_each(|step| *step = step.saturating_sub(1));
            now = load(problem, &steps)?;
            state += 1;
            candidates = unmeasured(steps.len());
            continue;
        };
        let knob = candidate.knob;
        if steps[knob] == 0 {
            continue;
        }
        let next = with(&steps, knob, steps[knob] - 1);
        if candidate.at == state {
            now = took(problem, &next)?;
            steps = next;
            state += 1;
            candidates.push(Candidate { at: 0, ..candidate });
            continue;
        }
        let then = load_ahead(problem, &next, |_, width| {
            next_candidates(&candidates, &steps, &most, -1, width)
        })?;
        let relief = now - then.min(LARGEST_LOAD);
        if relief > 0.0 {
            let price = match (problem.area(&steps), problem.area(&next)) {
                (Some(before), Some(after)) => (after - before).max(f64::MIN_POSITIVE),
                // A machine that cannot be built has no area; any improvement is taken.
                _ => 1.0,
            };
            candidates.push(Candidate {
                score: relief / price,
                knob,
                at: state,
            });
        }
    }
    Ok(steps)
}

/// From a state that meets the target: takes steps, one by one, while it does. A step that failed
/// is not tried again, because further steps do not reduce the error, except by chance.
pub fn taken_away(problem: &mut impl Problem, from: &[u32]) -> Result<Vec<u32>> {
    let most = problem.most();
    let mut steps = from.to_vec();
    let mut now = load(problem, &steps)?;
    let mut state = 1;
    let mut candidates = unmeasured(steps.len());
    while let Some(candidate) = candidates.pop() {
        let knob = candidate.knob;
        if steps[knob] == most[knob] {
            continue;
        }
        let next = with(&steps, knob, steps[knob] + 1);
        let (Some(before), Some(after)) = (problem.area(&steps), problem.area(&next)) else {
            continue;
        };
        if after >= before {
            continue;
        }
        let then = load_ahead(problem, &next, |_, width| {
            next_candidates(&candidates, &steps, &most, 1, width)
        })?
        .min(LARGEST_LOAD);
        if then > 1.0 {
            continue;
        }
        if candidate.at == state {
            now = problem.took(&next)?.unwrap_or(then);
            steps = next;
            if now > 1.0 {
                // The state only seemed to meet the target.
                break;
            }
            state += 1;
            candidates.push(Candidate { at: 0, ..candidate });
        } else {
            let harm = (then - now).max(LEAST_HARM);
            candidates.push(Candidate {
                score: (before - after) / harm,
                knob,
                at: state,
            });
        }
    }
    Ok(steps)
}

/// From a state that meets the target: compares a step of each knob, and takes at once those that
/// together should still meet the target, most area per harm first; half as many if they miss it.
/// Repeats this until no step is taken.
pub fn taken_together(problem: &mut impl Problem, from: &[u32]) -> Result<Vec<u32>> {
    let most = problem.most();
    let mut steps = from.to_vec();
    loop {
        let exact = took(problem, &steps)?;
        let Some(area) = problem.area(&steps) else {
            return Ok(steps);
        };
        let mut open = open_steps(problem, &steps, &most);
        open.retain(|knob| problem.is_gradual(*knob));
        let mut all: Vec<Vec<u32>> = open
            .iter()
            .map(|knob| with(&steps, *knob, steps[*knob] + 1))
            .collect();
        all.push(steps.clone());
        let loads = problem.compared(&all)?;
        let now = loads[open.len()].min(LARGEST_LOAD);
        let mut rated: Vec<(f64, f64, usize)> = Vec::new();
        for ((knob, next), load) in open.iter().zip(&all).zip(&loads) {
            let harm = (load.min(LARGEST_LOAD) - now).max(0.0);
            let saved = problem.area(next).map_or(0.0, |after| area - after);
            rated.push((saved / harm.max(LEAST_HARM), harm, *knob));
        }
        rated.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.2.cmp(&b.2)));
        let mut left = 1.0 - exact;
        let together: Vec<usize> = rated
            .into_iter()
            .filter(|(_, harm, _)| {
                let fits = *harm <= left;
                left -= if fits { *harm } else { 0.0 };
                fits
            })
            .map(|(.., knob)| knob)
            .collect();
        let mut count = together.len();
        let taken = loop {
            if count == 0 {
                return Ok(steps);
            }
            let mut next = steps.clone();
            together[..count].iter().for_each(|knob| next[*knob] += 1);
            if is_no_larger(problem, &steps, &next) && is_met(problem, &next)? {
                break next;
            }
            count /= 2;
        };
        steps = taken;
    }
}

/// Knobs from which no step can be taken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settled {
    /// Steps taken from each knob.
    pub steps: Vec<u32>,
    /// Single steps that were measured and fail.
    pub alone: usize,
    /// Joint steps that were measured and fail.
    pub together: usize,
    /// Single steps that take more area, and were not measured.
    pub costly: usize,
}

/// From a state that meets the target: takes every step that still meets it and takes no more area,
/// until each single step fails, and each joint step fails of the knobs that could take a step
/// without the margin.
pub fn settled(problem: &mut impl Problem, from: &[u32]) -> Result<Settled> {
    let most = problem.most();
    let mut steps = from.to_vec();
    // The loads of steps when they were last measured. Those that failed clearly are tried again
    // only after all others fail.
    let mut loads = vec![0.0f64; most.len()];
    let mut is_all = true;
    loop {
        let open = open_steps(problem, &steps, &most);
        let costly = (0..most.len())
            .filter(|knob| steps[*knob] < most[*knob])
            .count()
            - open.len();
        let before = steps.clone();
        let tried: Vec<usize> = (open.iter().copied())
            .filter(|knob| is_all || loads[*knob] <= CLEARLY)
            .collect();
        for (at, knob) in tried.iter().enumerate() {
            let next = with(&steps, *knob, steps[*knob] + 1);
            let others = |_: &mut _, width: usize| {
                tried[at + 1..]
                    .iter()
                    .take(width)
                    .map(|knob| with(&steps, *knob, steps[*knob] + 1))
                    .collect()
            };
            loads[*knob] = load_ahead(problem, &next, others)?;
            let is_well = loads[*knob] <= 1.0 && took(problem, &next)? <= 1.0;
            if !is_well {
                continue;
            }
            steps = next;
            // More steps may follow: twice as many at a time until they fail, then half as many.
            let (mut jump, mut is_growing) = (2, true);
            while jump > 0 {
                let value = steps[*knob] + jump;
                let next = with(&steps, *knob, value);
                if value <= most[*knob]
                    && is_no_larger(problem, &steps, &next)
                    && is_met(problem, &next)?
                {
                    steps = next;
                    jump *= if is_growing { 2 } else { 1 };
                } else {
                    is_growing = false;
                    jump /= 2;
                }
            }
        }
        let is_changed = steps != before;
        if is_changed || !is_all {
            is_all = !is_changed;
            continue;
        }
        let joint = joint_steps(problem, &steps, &open)?;
        let mut taken = None;
        for next in &joint {
            if is_no_larger(problem, &steps, next) && is_met(problem, next)? {
                taken = Some(next.clone());
                break;
            }
        }
        match taken {
            Some(next) => (steps, is_all) = (next, false),
            None => {
                return Ok(Settled {
                    steps,
                    alone: open.len(),
                    together: joint.len(),
                    costly,
                });
            }
        }
    }
}

pub fn is_no_larger(problem: &mut impl Problem, steps: &[u32], next: &[u32]) -> bool {
    matches!((problem.area(steps), problem.area(next)), (Some(area), Some(after)) if after <= area)
}

/// Knobs with a remaining step that takes no more area, sorted by saving.
fn open_steps(problem: &mut impl Problem, steps: &[u32], most: &[u32]) -> Vec<usize> {
    let Some(area) = problem.area(steps) else {
        return Vec::new();
    };
    let mut open: Vec<(f64, usize)> = Vec::new();
    for knob in (0..most.len()).filter(|knob| steps[*knob] < most[*knob]) {
        let after = problem.area(&with(steps, knob, steps[knob] + 1));
        open.extend(
            after
                .filter(|after| *after <= area)
                .map(|after| (area - after, knob)),
        );
    }
    open.sort_by(|(a, first), (b, second)| b.total_cmp(a).then(first.cmp(second)));
    open.into_iter().map(|(_, knob)| knob).collect()
}

/// Joint steps of the knobs whose step fails only because of the margin: all of them, then half as
/// many, and so on; the least harmful are kept longest.
fn joint_steps(problem: &mut impl Problem, steps: &[u32], open: &[usize]) -> Result<Vec<Vec<u32>>> {
    let mut spare: Vec<(f64, usize)> = Vec::new();
    for knob in open {
        let load = problem.load_without_margin(&with(steps, *knob, steps[*knob] + 1))?;
        spare.extend((load <= 1.0).then_some((load, *knob)));
    }
    spare.sort_by(|(a, first), (b, second)| a.total_cmp(b).then(first.cmp(second)));
    let counts = std::iter::successors(Some(spare.len()), |count| Some(count / 2))
        .take_while(|count| *count > 1);
    let joint = |count: usize| {
        let mut steps = steps.to_vec();
        spare[..count]
            .iter()
            .for_each(|(_, knob)| steps[*knob] += 1);
        steps
    };
    Ok(counts.map(joint).collect())
}

/// Simulated annealing by random exchanges.
#[derive(Clone)]
struct Annealing {
    steps: Vec<u32>,
    area: f64,
    /// Area at the start.
    first: f64,
    drawn: u64,
    candidate: u64,
    tried: u64,
    tries: u64,
}

impl Annealing {
    fn below(&mut self, count: u64) -> u64 {
        self.drawn = self.drawn.wrapping_add(1);
        mixed(mixed(self.drawn)) % count.max(1)
    }

    /// A state a few exchanges away.
    fn exchanged(&mut self, most: &[u32]) -> Vec<u32> {
        let mut next = self.steps.clone();
        for _ in 0..1 + self.below(2) {
            let knob = self.below(most.len() as u64) as usize;
            next[knob] = (next[knob] + 1 + self.below(2) as u32).min(most[knob]);
        }
        for _ in 0..self.below(3) {
            let knob = self.below(most.len() as u64) as usize;
            next[knob] = next[knob].saturating_sub(1 + self.below(2) as u32);
        }
        next
    }

    /// The next state to measure, and its area.
    fn next(&mut self, problem: &mut impl Problem, most: &[u32]) -> Option<(Vec<u32>, f64)> {
        while self.tried < self.tries && self.candidate < self.tries * CANDIDATES {
            let [by_tries, by_thoughts] = [
                self.tried as f64 / self.tries as f64,
                self.candidate as f64 / (self.tries * CANDIDATES) as f64,
            ];
            let heat = self.first * HOT * libm::pow(COLD / HOT, by_tries.max(by_thoughts));
            self.candidate += 1;
            let next = self.exchanged(most);
            let chance = self.below(1 << 32) as f64 / (1u64 << 32) as f64;
            let Some(area) = problem.area(&next).filter(|_| next != self.steps) else {
                continue;
            };
            if area > self.area && libm::exp((self.area - area) / heat) < chance {
                continue;
            }
            self.tried += 1;
            return Some((next, area));
        }
        None
    }
}

/// From a state that meets the target: simulated annealing; returns the best state. Requests
/// `tries` loads.
pub fn annealed(
    problem: &mut impl Problem,
    from: &[u32],
    seed: u64,
    tries: u64,
) -> Result<Vec<u32>> {
    let most = problem.most();
    let Some(first) = problem
        .area(from)
        .filter(|_| most.iter().any(|most| *most > 0))
    else {
        return Ok(from.to_vec());
    };
    let mut annealing = Annealing {
        steps: from.to_vec(),
        area: first,
        first,
        drawn: seed,
        candidate: 0,
        tried: 0,
        tries,
    };
    let (mut best, mut best_area) = (from.to_vec(), first);
    while let Some((next, next_area)) = annealing.next(problem, &most) {
        // As if none of them were accepted.
        let ahead = annealing.clone();
        let load = load_ahead(problem, &next, |problem, width| {
            let mut ahead = ahead;
            std::iter::from_fn(|| Some(ahead.next(problem, &most)?.0))
                .take(width)
                .collect()
        })?;
        if load <= 1.0 && took(problem, &next)? <= 1.0 {
            (annealing.steps, annealing.area) = (next, next_area);
            if annealing.area < best_area {
                (best, best_area) = (annealing.steps.clone(), annealing.area);
            }
        }
    }
    Ok(best)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::HashMap;

    /// Errors that add up, each four times as large per step; the area falls by the unit cost of a
    /// word per step.
    #[derive(Clone, Debug)]
    struct Sum {
        noise: Vec<f64>,
        price: Vec<f64>,
        most: u32,
        loads: u64,
    }

    impl Sum {
        fn allowed(&self, steps: &[u32]) -> f64 {
            self.noise
                .iter()
                .zip(steps)
                .map(|(noise, steps)| noise * libm::pow(4.0, f64::from(*steps)))
                .sum()
        }

        fn takes(&self, steps: &[u32]) -> f64 {
            100.0
                + self
                    .price
                    .iter()
                    .zip(steps)
                    .map(|(price, steps)| price * f64::from(self.most - steps))
                    .sum::<f64>()
        }
    }

    impl Problem for Sum {
        fn most(&self) -> Vec<u32> {
            vec![self.most; self.noise.len()]
        }

        fn area(&mut self, steps: &[u32]) -> Option<f64> {
            Some(self.takes(steps))
        }

        fn load(&mut self, steps: &[u32]) -> Result<f64> {
            self.loads += 1;
            Ok(self.allowed(steps))
        }
    }

    fn least(sum: &Sum) -> f64 {
        let count = u64::from(sum.most + 1).pow(sum.noise.len() as u32);
        let steps = |number: u64| -> Vec<u32> {
            (0..sum.noise.len() as u32)
                .map(|knob| {
                    (number / u64::from(sum.most + 1).pow(knob) % u64::from(sum.most + 1)) as u32
                })
                .collect()
        };
        (0..count)
            .map(steps)
            .filter(|steps| sum.allowed(steps) <= 1.0)
            .map(|steps| sum.takes(&steps))
            .fold(f64::INFINITY, f64::min)
    }

    fn sums() -> impl Strategy<Value = Sum> {
        let knobs = prop::collection::vec((1e-5..0.2f64, 1.0..200.0f64), 4);
        knobs.prop_map(|knobs| {
            let (noise, price) = knobs.into_iter().unzip();
            Sum {
                noise,
                price,
                most: 7,
                loads: 0,
            }
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn what_is_found_is_close_to_the_best_there_is(mut sum in sums(), seed in any::<u64>()) {
            let limits = limits(&mut sum).unwrap();
            let (well, ill) = starts(&mut sum, &limits).unwrap();
            let back = given_back(&mut sum, &ill).unwrap();
            let down = taken_away(&mut sum, &well).unwrap();
            let better = if sum.takes(&back) < sum.takes(&down) { &back } else { &down };
            let cold = annealed(&mut sum, better, seed, 300).unwrap();
            let found = taken_away(&mut sum, &cold).unwrap();
            prop_assert!([&well, &back, &down, &cold, &found].iter().all(|steps| sum.allowed(steps) <= 1.0));
            let (best, found) = (least(&sum), sum.takes(&found));
            prop_assert!(found <= 1.05 * best, "{found} where the least is {best}");
            prop_assert!(sum.takes(&down) <= 1.25 * best && sum.takes(&back) <= 1.4 * best, "{} {} {best}", sum.takes(&down), sum.takes(&back));
        }

        #[test]
        fn no_single_step_is_left(mut sum in sums()) {
            let steps = taken_away(&mut sum, &[0; 4]).unwrap();
            for knob in 0..4 {
                prop_assert!(steps[knob] == sum.most || sum.allowed(&with(&steps, knob, steps[knob] + 1)) > 1.0);
            }
        }
    }

    /// Two knobs: a single step of each fails because of the margin, a joint step does not.
    struct Lucky;

    impl Problem for Lucky {
        fn most(&self) -> Vec<u32> {
            vec![1, 1, 1]
        }

        fn area(&mut self, steps: &[u32]) -> Option<f64> {
            // A step of the last knob takes more area.
            Some(f64::from(10 + 5 * steps[2] - 2 * steps[0] - steps[1]))
        }

        fn load(&mut self, steps: &[u32]) -> Result<f64> {
            Ok(if steps[0] == steps[1] { 0.9 } else { 1.5 })
        }

        fn load_without_margin(&mut self, steps: &[u32]) -> Result<f64> {
            Ok(self.load(steps)? / 2.0)
        }
    }

    #[test]
    fn a_joint_step_is_taken_where_no_single_step_can_be() {
        let settled = settled(&mut Lucky, &[0, 0, 0]).unwrap();
        assert_eq!(
            settled,
            Settled {
                steps: vec![1, 1, 0],
                alone: 0,
                together: 0,
                costly: 1
            }
        );
        assert_eq!(taken_away(&mut Lucky, &[0, 0, 0]).unwrap(), [0, 0, 0]);
    }

    proptest! {
        #[test]
        fn every_single_step_of_a_settled_machine_fails(mut sum in sums()) {
            let Settled { steps, alone, .. } = settled(&mut sum, &[0; 4]).unwrap();
            let open: Vec<usize> = (0..4).filter(|knob| steps[*knob] < sum.most).collect();
            prop_assert_eq!(alone, open.len());
            prop_assert!(open.iter().all(|knob| sum.allowed(&with(&steps, *knob, steps[*knob] + 1)) > 1.0), "{:?}", steps);
        }
    }

    /// Comparisons show only a part of the harm that steps do.
    struct Optimistic(Sum);

    impl Problem for Optimistic {
        fn most(&self) -> Vec<u32> {
            self.0.most()
        }

        fn area(&mut self, steps: &[u32]) -> Option<f64> {
            self.0.area(steps)
        }

        fn load(&mut self, steps: &[u32]) -> Result<f64> {
            self.0.load(steps)
        }

        fn compared(&mut self, all: &[Vec<u32>]) -> Result<Vec<f64>> {
            Ok(all
                .iter()
                .map(|steps| 0.2 * self.0.allowed(steps))
                .collect())
        }
    }

    proptest! {
        #[test]
        fn steps_taken_together_meet_the_target_and_save_area(mut sum in sums()) {
            let none = [0; 4];
            let steps = taken_together(&mut sum, &none).unwrap();
            prop_assert!(sum.allowed(&steps) <= 1.0 || steps == none, "{:?}", steps);
            // As long as a step does little harm, it is taken.
            let can_be_taken = |knob: usize| {
                let next = with(&steps, knob, steps[knob] + 1);
                let left = 1.0 - sum.allowed(&steps);
                steps[knob] < sum.most && 4.0 * (sum.allowed(&next) - sum.allowed(&steps)) < left
            };
            prop_assert!(sum.allowed(&none) > 1.0 || !(0..4).any(can_be_taken), "{:?}", steps);
            // The result is measured, whatever comparisons promise.
            let steps = taken_together(&mut Optimistic(sum.clone()), &none).unwrap();
            prop_assert!(sum.allowed(&steps) <= 1.0 || steps == none, "{:?}", steps);
        }
    }

    /// Words without any use, all of whose steps do no harm.
    fn useless(knobs: usize) -> Sum {
        Sum {
            noise: vec![0.0; knobs],
            price: vec![1.0; knobs],
            most: 15,
            loads: 0,
        }
    }

    #[test]
    fn harmless_steps_are_taken_many_at_a_time() {
        let mut sum = useless(20);
        assert_eq!(taken_together(&mut sum, &[0; 20]).unwrap(), [15; 20]);
        // Each pass compares a step of each word, and measures the joint step.
        assert!(sum.loads <= 15 * 25 + 5, "{}", sum.loads);
        let mut sum = useless(20);
        assert_eq!(settled(&mut sum, &[0; 20]).unwrap().steps, [15; 20]);
        // One step, then 2, 4 and 8 more; 300 if they were taken one by one.
        assert!(sum.loads < 20 * 2 * 5, "{}", sum.loads);
    }

    #[test]
    fn a_step_with_a_load_that_is_no_number_is_not_taken() {
        let mut sum = useless(3);
        sum.noise[1] = f64::NAN;
        assert_eq!(settled(&mut sum, &[0; 3]).unwrap().steps, [0; 3]);
        assert_eq!(taken_together(&mut sum, &[0; 3]).unwrap(), [0; 3]);
    }

    /// The same problem with measurement in advance. Counts requests, and those that were not
    /// measured in advance.
    struct Prefetching {
        sum: Sum,
        width: usize,
        known: HashMap<Vec<u32>, f64>,
        requests: Vec<Vec<u32>>,
        surprises: usize,
    }

    impl Problem for Prefetching {
        fn most(&self) -> Vec<u32> {
            self.sum.most()
        }

        fn area(&mut self, steps: &[u32]) -> Option<f64> {
            self.sum.area(steps)
        }

        fn load(&mut self, steps: &[u32]) -> Result<f64> {
            self.requests.push(steps.to_vec());
            self.surprises += usize::from(!self.known.contains_key(steps));
            self.sum.load(steps)
        }

        fn width(&self) -> usize {
            self.width
        }

        fn prefetch(&mut self, steps: &[Vec<u32>]) -> Result<()> {
            self.known.extend(
                steps
                    .iter()
                    .map(|steps| (steps.clone(), self.sum.allowed(steps))),
            );
            Ok(())
        }

        fn prefetched(&self, steps: &[u32]) -> Option<f64> {
            self.known.get(steps).copied()
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn measuring_ahead_changes_no_request(sum in sums(), seed in any::<u64>()) {
            let way = |width: usize| {
                let mut problem = Prefetching { sum: sum.clone(), width, known: HashMap::new(), requests: Vec::new(), surprises: 0 };
                let limits = limits(&mut problem).unwrap();
                let (well, ill) = starts(&mut problem, &limits).unwrap();
                let back = given_back(&mut problem, &ill).unwrap();
                let down = taken_away(&mut problem, &well).unwrap();
                let cold = annealed(&mut problem, &down, seed, 50).unwrap();
                let last = taken_away(&mut problem, &cold).unwrap();
                (vec![limits, well, ill, back, down, cold, last], problem.requests, problem.surprises)
            };
            let (found, requests, _) = way(1);
            let (found_ahead, asked_ahead, surprises) = way(4);
            prop_assert_eq!(found, found_ahead);
            prop_assert_eq!(&requests, &asked_ahead);
            // Except for the first request of each phase, and after accepted steps, loads are known
            // in advance.
            prop_assert!(surprises <= 4 + requests.len() / 3, "{surprises} of {}", requests.len());
        }
    }

    #[test]
    fn limits_are_found_by_halving() {
        let mut sum = Sum {
            noise: vec![1e-9, 0.9, 4.0, 1e-3],
            price: vec![1.0; 4],
            most: 9,
            loads: 0,
        };
        sum.noise[2] = 0.2;
        assert_eq!(
            limits(&mut sum).unwrap(),
            [0, 0, 0, 0],
            "no step is taken from a state that misses the target"
        );
        sum.noise = vec![1e-9, 0.3, 0.2, 1e-3];
        // Others leave half of what is allowed.
        assert_eq!(limits(&mut sum).unwrap(), [9, 0, 0, 4]);
        assert!(sum.loads < 40, "{}", sum.loads);
    }
}

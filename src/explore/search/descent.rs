//! Descent: the least area at which a load stays below 1, over whole numbers of steps taken away
//! from each knob.
//!
//! ```text
//! each knob alone, as far as it goes ─► all that far, less d ─┬─ d too small: steps given back, best relief for its area  (min+1)
//!                                                            ├─ d large enough: steps taken, most area for its harm     (max−1)
//!                                                            └─ from the better one: random exchanges, ever colder      (annealing)
//! ```
//! Both greedy ways are lazy: what a step does is measured again only when it comes up, for it
//! changes little in between. Sources: Cantin, Savaria, Lavoie, *A comparison of automatic word
//! length optimization procedures* (ISCAS 2002), for min+1 and max−1.
//!
//! Laws: `what_is_found_is_close_to_the_best_there_is`, `no_single_step_is_left`.

use crate::error::Result;
use crate::scene::digest::mixed;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Problem that a descent searches.
pub trait Problem {
    /// Steps that each knob has.
    fn most(&self) -> Vec<u32>;

    /// What it takes; none where it cannot be built.
    fn area(&mut self, steps: &[u32]) -> Option<f64>;

    /// What it does, as a part of what is allowed: the error, squared, over the greatest error
    /// allowed, squared. At most 1 is well. Infinite where it cannot be built.
    ///
    /// # Errors
    /// Where it cannot be kept what was found.
    fn load(&mut self, steps: &[u32]) -> Result<f64>;

    /// The load without the margin that [`Problem::load`] adds to what is wanted; the same where
    /// there is no margin.
    ///
    /// # Errors
    /// As [`Problem::load`].
    fn load_without_margin(&mut self, steps: &[u32]) -> Result<f64> {
        self.load(steps)
    }

    /// Loads that can be measured at once: 1 where nothing is gained by that.
    fn width(&self) -> usize {
        1
    }

    /// Measures loads that may be asked for, at once. Nothing that is found depends on it.
    ///
    /// # Errors
    /// Where whoever measures fails.
    fn foresee(&mut self, _steps: &[Vec<u32>]) -> Result<()> {
        Ok(())
    }

    /// A load that was measured or asked for before.
    fn foreseen(&self, _steps: &[u32]) -> Option<f64> {
        None
    }
}

/// Stands for a load without limit.
const ENDLESS: f64 = 1e12;
/// Harm below this is none.
const LEAST_HARM: f64 = 1e-3;
/// Of the area: a rise that annealing takes in two of five cases, at first and at last.
const HOT: f64 = 0.004;
const COLD: f64 = 0.0001;
/// Exchanges that are thought of for each that is tried.
const THOUGHTS: u64 = 40;

fn with(steps: &[u32], knob: usize, value: u32) -> Vec<u32> {
    let mut steps = steps.to_vec();
    steps[knob] = value;
    steps
}

fn load(problem: &mut impl Problem, steps: &[u32]) -> Result<f64> {
    Ok(problem.load(steps)?.min(ENDLESS))
}

/// A load; where it was never measured, others that may be asked for after it are measured beside
/// it.
fn load_ahead<P: Problem>(
    problem: &mut P,
    steps: &[u32],
    others: impl FnOnce(&mut P, usize) -> Vec<Vec<u32>>,
) -> Result<f64> {
    let width = problem.width();
    if width > 1 && problem.foreseen(steps).is_none() {
        let mut all = others(problem, width - 1);
        all.insert(0, steps.to_vec());
        problem.foresee(&all)?;
    }
    problem.load(steps)
}

/// Measures what halving will ask for, all knobs side by side.
fn foresee_limits(problem: &mut impl Problem, none: &[u32]) -> Result<()> {
    let mut halves: Vec<[u32; 2]> = problem.most().iter().map(|most| [0, most + 1]).collect();
    let middle = |[well, ill]: &[u32; 2]| (ill - well > 1).then(|| u32::midpoint(*well, *ill));
    while problem.width() > 1 {
        let asked: Vec<(usize, u32)> = halves
            .iter()
            .enumerate()
            .filter_map(|(knob, half)| Some((knob, middle(half)?)))
            .collect();
        if asked.is_empty() {
            break;
        }
        let steps: Vec<Vec<u32>> = asked
            .iter()
            .map(|(knob, middle)| with(none, *knob, *middle))
            .collect();
        problem.foresee(&steps)?;
        for ((knob, middle), steps) in asked.iter().zip(&steps) {
            let is_well = problem.foreseen(steps).is_some_and(|load| load <= 1.0);
            halves[*knob][usize::from(!is_well)] = *middle;
        }
    }
    Ok(())
}

/// Steps that each knob can go alone, all others as they are.
pub fn limits(problem: &mut impl Problem) -> Result<Vec<u32>> {
    let most = problem.most();
    let none = vec![0; most.len()];
    foresee_limits(problem, &none)?;
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

/// All knobs as far as they go alone, less the fewest steps with which all is well; and less one
/// step fewer.
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

/// A step that is thought of, and how good it seemed when it was last measured.
struct Thought {
    score: f64,
    knob: usize,
    /// The state that it was measured at.
    at: u64,
}

impl PartialEq for Thought {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Thought {}

impl PartialOrd for Thought {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Thought {
    fn cmp(&self, other: &Self) -> Ordering {
        self.score
            .total_cmp(&other.score)
            .then(other.knob.cmp(&self.knob))
    }
}

/// A step of every knob, each as good as can be until it is measured.
fn unmeasured(knobs: usize) -> BinaryHeap<Thought> {
    (0..knobs)
        .map(|knob| Thought {
            score: f64::INFINITY,
            knob,
            at: 0,
        })
        .collect()
}

/// The steps that come up next, as far as is known now: each one `more` or less of a knob.
fn next_thoughts(
    thoughts: &BinaryHeap<Thought>,
    steps: &[u32],
    most: &[u32],
    more: i32,
    count: usize,
) -> Vec<Vec<u32>> {
    let mut best: Vec<&Thought> = thoughts.iter().collect();
    best.sort_by(|a, b| b.cmp(a));
    let step = |thought: &Thought| {
        let value = steps[thought.knob]
            .checked_add_signed(more)
            .filter(|value| *value <= most[thought.knob])?;
        Some(with(steps, thought.knob, value))
    };
    best.into_iter().filter_map(step).take(count).collect()
}

/// From where all is not well: gives steps back, one after the other, until it is.
pub fn given_back(problem: &mut impl Problem, from: &[u32]) -> Result<Vec<u32>> {
    let most = problem.most();
    let mut steps = from.to_vec();
    let mut now = load(problem, &steps)?;
    let mut state = 1;
    let mut thoughts = unmeasured(steps.len());
    while now > 1.0 {
        let Some(thought) = thoughts.pop() else {
            // Nothing helps alone: all give one back.
            if steps.iter().all(|step| *step == 0) {
                break;
            }
            steps
                .iter_mut()
                .for_each(|step| *step = step.saturating_sub(1));
            now = load(problem, &steps)?;
            state += 1;
            thoughts = unmeasured(steps.len());
            continue;
        };
        let knob = thought.knob;
        if steps[knob] == 0 {
            continue;
        }
        let next = with(&steps, knob, steps[knob] - 1);
        if thought.at == state {
            now = load(problem, &next)?;
            steps = next;
            state += 1;
            thoughts.push(Thought { at: 0, ..thought });
            continue;
        }
        let then = load_ahead(problem, &next, |_, width| {
            next_thoughts(&thoughts, &steps, &most, -1, width)
        })?;
        let relief = now - then.min(ENDLESS);
        if relief > 0.0 {
            let price = match (problem.area(&steps), problem.area(&next)) {
                (Some(before), Some(after)) => (after - before).max(f64::MIN_POSITIVE),
                // What cannot be built has no price; whatever makes it better is welcome.
                _ => 1.0,
            };
            thoughts.push(Thought {
                score: relief / price,
                knob,
                at: state,
            });
        }
    }
    Ok(steps)
}

/// From where all is well: takes steps away, one after the other, while it stays so. One that did
/// not do is not tried again: what else is taken away meanwhile makes nothing better, but for luck.
pub fn taken_away(problem: &mut impl Problem, from: &[u32]) -> Result<Vec<u32>> {
    let most = problem.most();
    let mut steps = from.to_vec();
    let mut now = load(problem, &steps)?;
    let mut state = 1;
    let mut thoughts = unmeasured(steps.len());
    while let Some(thought) = thoughts.pop() {
        let knob = thought.knob;
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
            next_thoughts(&thoughts, &steps, &most, 1, width)
        })?
        .min(ENDLESS);
        if then > 1.0 {
            continue;
        }
        if thought.at == state {
            (steps, now) = (next, then);
            state += 1;
            thoughts.push(Thought { at: 0, ..thought });
        } else {
            let harm = (then - now).max(LEAST_HARM);
            thoughts.push(Thought {
                score: (before - after) / harm,
                knob,
                at: state,
            });
        }
    }
    Ok(steps)
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
    /// Single steps that were not measured, because they take more area.
    pub costly: usize,
}

/// From where all is well: takes every step that leaves it well and takes no more area, until every
/// single step fails and every joint step of those knobs fails that have a step to spare without
/// the margin.
pub fn settled(problem: &mut impl Problem, from: &[u32]) -> Result<Settled> {
    let most = problem.most();
    let mut steps = from.to_vec();
    loop {
        let open = open_steps(problem, &steps, &most);
        let costly = (0..most.len())
            .filter(|knob| steps[*knob] < most[*knob])
            .count()
            - open.len();
        let before = steps.clone();
        for (at, knob) in open.iter().enumerate() {
            let next = with(&steps, *knob, steps[*knob] + 1);
            let others = |_: &mut _, width: usize| {
                open[at + 1..]
                    .iter()
                    .take(width)
                    .map(|knob| with(&steps, *knob, steps[*knob] + 1))
                    .collect()
            };
            let mut is_well = load_ahead(problem, &next, others)? <= 1.0;
            let mut next = next;
            // Where one step can go, more may.
            while is_well {
                steps = next;
                next = with(&steps, *knob, steps[*knob] + 1);
                is_well = steps[*knob] < most[*knob]
                    && is_no_larger(problem, &steps, &next)
                    && problem.load(&next)? <= 1.0;
            }
        }
        if steps != before {
            continue;
        }
        let joint = joint_steps(problem, &steps, &open)?;
        let mut taken = None;
        for next in &joint {
            if is_no_larger(problem, &steps, next) && problem.load(next)? <= 1.0 {
                taken = Some(next.clone());
                break;
            }
        }
        match taken {
            Some(next) => steps = next,
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

fn is_no_larger(problem: &mut impl Problem, steps: &[u32], next: &[u32]) -> bool {
    matches!((problem.area(steps), problem.area(next)), (Some(area), Some(after)) if after <= area)
}

/// Knobs that have a step left which takes no more area, those that save most in front.
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

/// Joint steps of the knobs whose step fails for the margin only: all of them, then half as many,
/// and so on, the least harmful kept longest.
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

/// A walk of random exchanges, ever colder.
#[derive(Clone)]
struct Walk {
    steps: Vec<u32>,
    area: f64,
    /// The area that it began at.
    first: f64,
    drawn: u64,
    thought: u64,
    tried: u64,
    tries: u64,
}

impl Walk {
    fn below(&mut self, count: u64) -> u64 {
        self.drawn = self.drawn.wrapping_add(1);
        mixed(mixed(self.drawn)) % count.max(1)
    }

    /// Steps that are a few exchanges away.
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

    /// The steps that are tried next, and their area.
    fn next(&mut self, problem: &mut impl Problem, most: &[u32]) -> Option<(Vec<u32>, f64)> {
        while self.tried < self.tries && self.thought < self.tries * THOUGHTS {
            let [by_tries, by_thoughts] = [
                self.tried as f64 / self.tries as f64,
                self.thought as f64 / (self.tries * THOUGHTS) as f64,
            ];
            let heat = self.first * HOT * libm::pow(COLD / HOT, by_tries.max(by_thoughts));
            self.thought += 1;
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

/// From where all is well: exchanges steps at random, ever colder; the best that was met. `tries`
/// loads are asked for.
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
    let mut walk = Walk {
        steps: from.to_vec(),
        area: first,
        first,
        drawn: seed,
        thought: 0,
        tried: 0,
        tries,
    };
    let (mut best, mut best_area) = (from.to_vec(), first);
    while let Some((next, next_area)) = walk.next(problem, &most) {
        // As if none of them were taken.
        let ahead = walk.clone();
        let load = load_ahead(problem, &next, |problem, width| {
            let mut ahead = ahead;
            std::iter::from_fn(|| Some(ahead.next(problem, &most)?.0))
                .take(width)
                .collect()
        })?;
        if load <= 1.0 {
            (walk.steps, walk.area) = (next, next_area);
            if walk.area < best_area {
                (best, best_area) = (walk.steps.clone(), walk.area);
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

    /// Errors that add up, each four times as great a step; area that falls by a word's price a
    /// step.
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
            prop_assert!(found <= 1.05 * best, "{found} where {best} is the least");
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

    /// Two knobs: a step of each fails by the margin, both together do not.
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

    /// The same, measured some at a time: what was asked for, and how often nothing was known of
    /// it.
    struct Crewed {
        sum: Sum,
        width: usize,
        known: HashMap<Vec<u32>, f64>,
        asked: Vec<Vec<u32>>,
        surprises: usize,
    }

    impl Problem for Crewed {
        fn most(&self) -> Vec<u32> {
            self.sum.most()
        }

        fn area(&mut self, steps: &[u32]) -> Option<f64> {
            self.sum.area(steps)
        }

        fn load(&mut self, steps: &[u32]) -> Result<f64> {
            self.asked.push(steps.to_vec());
            self.surprises += usize::from(!self.known.contains_key(steps));
            self.sum.load(steps)
        }

        fn width(&self) -> usize {
            self.width
        }

        fn foresee(&mut self, steps: &[Vec<u32>]) -> Result<()> {
            self.known.extend(
                steps
                    .iter()
                    .map(|steps| (steps.clone(), self.sum.allowed(steps))),
            );
            Ok(())
        }

        fn foreseen(&self, steps: &[u32]) -> Option<f64> {
            self.known.get(steps).copied()
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn who_measures_ahead_asks_for_the_same(sum in sums(), seed in any::<u64>()) {
            let way = |width: usize| {
                let mut problem = Crewed { sum: sum.clone(), width, known: HashMap::new(), asked: Vec::new(), surprises: 0 };
                let limits = limits(&mut problem).unwrap();
                let (well, ill) = starts(&mut problem, &limits).unwrap();
                let back = given_back(&mut problem, &ill).unwrap();
                let down = taken_away(&mut problem, &well).unwrap();
                let cold = annealed(&mut problem, &down, seed, 50).unwrap();
                let last = taken_away(&mut problem, &cold).unwrap();
                (vec![limits, well, ill, back, down, cold, last], problem.asked, problem.surprises)
            };
            let (found, asked, _) = way(1);
            let (found_ahead, asked_ahead, surprises) = way(4);
            prop_assert_eq!(found, found_ahead);
            prop_assert_eq!(&asked, &asked_ahead);
            // But for the first of a way, and of what is taken, all is known before it is asked
            // for.
            prop_assert!(surprises <= 4 + asked.len() / 3, "{surprises} of {}", asked.len());
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
            "what is not well at first goes nowhere"
        );
        sum.noise = vec![1e-9, 0.3, 0.2, 1e-3];
        // Others leave half of what is allowed.
        assert_eq!(limits(&mut sum).unwrap(), [9, 0, 0, 4]);
        assert!(sum.loads < 40, "{}", sum.loads);
    }
}

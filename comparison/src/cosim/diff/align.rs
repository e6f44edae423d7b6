//! Align: pairs a device's records with those of a trace, and counts missing, surplus, moved and
//! different ones separately.
//!
//! ```text
//! records with a name (tag, x, y) ─► groups of equal names ─► an edit script for each group ─► those out of order: moved
//! records without one             ─► one edit script
//! ```
//! An edit script pairs records in order. Where two records differ, a window of [`WINDOW`] records
//! is searched for the nearest place at which both sides are in step again, then runs of records
//! that each side has once. Between the two places the cheapest pairing is used. If a fault has
//! several descriptions, the shortest is used.
//!
//! Laws: `runs_of_missing_and_surplus_records_are_counted_separately`,
//! `a_moved_record_is_not_a_different_one` (tests/diff.rs); `a_script_explains_all_records`
//! (below).

use std::collections::HashMap;

/// One difference. Indices count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mismatch {
    /// An expected record has other contents.
    Different { record: usize, line: usize },
    /// An expected record is absent.
    Missing { record: usize },
    /// A line without an expected record; `before` is the expected record that follows it.
    Surplus { line: usize, before: usize },
    /// An expected record is at another place; `swapped` if it was only exchanged with the next
    /// one.
    Moved {
        record: usize,
        line: usize,
        swapped: bool,
    },
}

impl Mismatch {
    /// Index of the expected record.
    pub fn record(&self) -> usize {
        match *self {
            Mismatch::Different { record, .. }
            | Mismatch::Missing { record }
            | Mismatch::Moved { record, .. } => record,
            Mismatch::Surplus { before, .. } => before,
        }
    }

    /// The mismatch with indices mapped to those of the whole stream.
    fn renumbered(
        self,
        record_of: impl Fn(usize) -> usize,
        line_of: impl Fn(usize) -> usize,
        before_of: impl Fn(usize) -> usize,
    ) -> Self {
        match self {
            Mismatch::Different { record, line } => Mismatch::Different {
                record: record_of(record),
                line: line_of(line),
            },
            Mismatch::Missing { record } => Mismatch::Missing {
                record: record_of(record),
            },
            Mismatch::Surplus { line, before } => Mismatch::Surplus {
                line: line_of(line),
                before: before_of(before),
            },
            Mismatch::Moved {
                record,
                line,
                swapped,
            } => Mismatch::Moved {
                record: record_of(record),
                line: line_of(line),
                swapped,
            },
        }
    }
}

/// A record's identifiers; 0 for one that the stream lacks.
pub type Name = [i64; 3];

/// Whether the order of records matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sequence {
    /// It matters.
    Total,
    /// It matters only among records of one name.
    ByName,
}

/// Distance up to which a record at another place is `Moved`.
const NEAR: usize = 8;
/// Records of each side that are searched for a place at which both are in step again.
const WINDOW: usize = 64;
/// Equal records in a row that identify a place.
const RUN: usize = 8;
/// Information in equal records that identifies a place: more than the number of places in a
/// window.
const SURE_BITS: u32 = 36;
/// Most equal records that are examined.
const MOST_EQUAL: usize = 1 << 10;
/// Most cells of a cost table.
const MOST_CELLS: usize = 1 << 16;

/// Records of both sides as numbers; equal records have equal numbers.
#[derive(Clone, Debug)]
pub struct Numbered {
    pub expected: Vec<u32>,
    pub got: Vec<u32>,
}

impl Numbered {
    /// Numbers the records.
    pub fn new(expected: &[Vec<i64>], got: &[Vec<i64>]) -> Self {
        let mut numbers: HashMap<&[i64], u32> = HashMap::new();
        let mut all = Vec::with_capacity(expected.len() + got.len());
        for record in expected.iter().chain(got) {
            let next = numbers.len() as u32;
            all.push(*numbers.entry(record).or_insert(next));
        }
        let got = all.split_off(expected.len());
        Numbered { expected: all, got }
    }

    /// Differences of records without names.
    pub fn in_order(&self) -> Vec<Mismatch> {
        let script = script(&self.expected, &self.got);
        shorter(script, self.by_place())
    }

    /// Compares records index by index, if both sides have the same number.
    fn by_place(&self) -> Option<Vec<Mismatch>> {
        (self.expected.len() == self.got.len()).then(|| {
            let pairs = self.expected.iter().zip(&self.got).enumerate();
            pairs
                .filter(|(_, (a, b))| a != b)
                .map(|(place, _)| Mismatch::Different {
                    record: place,
                    line: place,
                })
                .collect()
        })
    }

    /// Differences of records with names.
    pub fn by_name(&self, expected: &[Name], got: &[Name], sequence: Sequence) -> Vec<Mismatch> {
        let mut paired = Paired::default();
        for (records, lines) in groups(expected, got) {
            let of = |all: &[u32], places: &[u32]| {
                places
                    .iter()
                    .map(|&place| all[place as usize])
                    .collect::<Vec<_>>()
            };
            let (ours, theirs) = (of(&self.expected, &records), of(&self.got, &lines));
            paired.take(&records, &lines, &ours, &theirs, self.expected.len());
        }
        if sequence == Sequence::ByName {
            paired.found.sort_by_key(Mismatch::record);
            return paired.found;
        }
        let by_name = paired.in_sequence(self.expected.len(), self.got.len());
        shorter(
            shorter(by_name, self.by_place()),
            Some(script(&self.expected, &self.got)),
        )
    }

    /// Records that one side has more often than the other, in any order.
    pub fn as_a_set(&self) -> Vec<Mismatch> {
        let mut places: HashMap<u32, Vec<usize>> = HashMap::new();
        for (line, &number) in self.got.iter().enumerate().rev() {
            places.entry(number).or_default().push(line);
        }
        let is_missing =
            |(_, number): &(usize, &u32)| places.get_mut(number).and_then(Vec::pop).is_none();
        let mut found: Vec<Mismatch> = self
            .expected
            .iter()
            .enumerate()
            .filter(is_missing)
            .map(|(record, _)| Mismatch::Missing { record })
            .collect();
        let mut lines: Vec<usize> = places.into_values().flatten().collect();
        lines.sort_unstable();
        found.extend(lines.into_iter().map(|line| Mismatch::Surplus {
            line,
            before: line.min(self.expected.len()),
        }));
        found.sort_by_key(Mismatch::record);
        found
    }
}

/// The shorter of two descriptions; the first if they are equally long.
fn shorter(first: Vec<Mismatch>, second: Option<Vec<Mismatch>>) -> Vec<Mismatch> {
    match second {
        Some(second) if second.len() < first.len() => second,
        _ => first,
    }
}

/// Indices of the records and lines of each name.
fn groups(expected: &[Name], got: &[Name]) -> Vec<(Vec<u32>, Vec<u32>)> {
    let sorted = |names: &[Name]| {
        let mut places: Vec<u32> = (0..names.len() as u32).collect();
        places.sort_by_key(|&place| names[place as usize]);
        places
    };
    let (ours, theirs) = (sorted(expected), sorted(got));
    let (mut ours, mut theirs) = (&ours[..], &theirs[..]);
    let mut all = Vec::new();
    let first = |places: &[u32], names: &[Name]| places.first().map(|&place| names[place as usize]);
    while let Some(name) = first(ours, expected)
        .into_iter()
        .chain(first(theirs, got))
        .min()
    {
        let (records, more) =
            ours.split_at(ours.partition_point(|&place| expected[place as usize] == name));
        let (lines, rest) =
            theirs.split_at(theirs.partition_point(|&place| got[place as usize] == name));
        all.push((records.to_vec(), lines.to_vec()));
        (ours, theirs) = (more, rest);
    }
    all
}

/// Pairs of records and lines, and those without a partner.
#[derive(Default)]
struct Paired {
    pairs: Vec<(u32, u32)>,
    found: Vec<Mismatch>,
}

impl Paired {
    /// Adds the records and lines of one name.
    fn take(&mut self, records: &[u32], lines: &[u32], ours: &[u32], theirs: &[u32], all: usize) {
        let steps = steps(ours, theirs);
        self.pairs
            .extend(steps.iter().filter_map(|step| match *step {
                EditStep::Pair(record, line) => Some((records[record], lines[line])),
                _ => None,
            }));
        let before = |before: usize| match (records.get(before), records.last()) {
            (Some(&record), _) => record as usize,
            (None, Some(&last)) => last as usize + 1,
            // No expected record has this name: its index in the file is used.
            (None, None) => lines.first().map_or(all, |&line| (line as usize).min(all)),
        };
        let found = mismatches(&steps, ours, theirs);
        let numbered = |found: Mismatch| {
            found.renumbered(
                |record| records[record] as usize,
                |line| lines[line] as usize,
                before,
            )
        };
        self.found.extend(found.into_iter().map(numbered));
    }

    /// Marks pairs that are out of order as moved, and sorts surplus lines in.
    fn in_sequence(mut self, records: usize, lines: usize) -> Vec<Mismatch> {
        self.pairs.sort_unstable();
        let in_order = longest_increasing(&self.pairs);
        let mut line_of = vec![usize::MAX; records];
        self.pairs
            .iter()
            .for_each(|&(record, line)| line_of[record as usize] = line as usize);
        // For each line, the expected record after it.
        let mut next = vec![records; lines + 1];
        for (&(record, line), in_order) in self.pairs.iter().zip(&in_order).rev() {
            if *in_order {
                next[line as usize] = record as usize;
            }
        }
        for line in (0..lines).rev() {
            next[line] = next[line].min(next[line + 1]);
        }
        for found in &mut self.found {
            if let Mismatch::Surplus { line, before } = found {
                *before = next[*line];
            }
        }
        for (&(record, line), _) in self
            .pairs
            .iter()
            .zip(&in_order)
            .filter(|(_, in_order)| !**in_order)
        {
            let (record, line) = (record as usize, line as usize);
            let behind = line_of.get(record + 1).copied();
            let ahead = record.checked_sub(1).map(|before| line_of[before]);
            let moved = match (ahead, behind) {
                (_, Some(next)) if next.checked_add(1) == Some(line) => Mismatch::Moved {
                    record,
                    line: next,
                    swapped: true,
                },
                (Some(last), _) if last == line + 1 => Mismatch::Moved {
                    record: record - 1,
                    line,
                    swapped: true,
                },
                _ => Mismatch::Moved {
                    record,
                    line,
                    swapped: false,
                },
            };
            self.found.push(moved);
        }
        self.found.sort_by_key(Mismatch::record);
        self.found
    }
}

/// Which pairs, sorted by record, belong to a longest run of increasing lines.
fn longest_increasing(pairs: &[(u32, u32)]) -> Vec<bool> {
    // For each length, the last pair of a run; for each pair, its predecessor.
    let (mut ends, mut before): (Vec<usize>, Vec<usize>) =
        (Vec::new(), vec![usize::MAX; pairs.len()]);
    for (place, &(_, line)) in pairs.iter().enumerate() {
        let length = ends.partition_point(|&end| pairs[end].1 < line);
        before[place] = if length == 0 {
            usize::MAX
        } else {
            ends[length - 1]
        };
        if length == ends.len() {
            ends.push(place);
        } else {
            ends[length] = place;
        }
    }
    let mut chosen = vec![false; pairs.len()];
    let mut place = ends.last().copied().unwrap_or(usize::MAX);
    while place != usize::MAX {
        chosen[place] = true;
        place = before[place];
    }
    chosen
}

/// One step of an edit script.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum EditStep {
    Pair(usize, usize),
    Missing(usize),
    Surplus(usize),
}

/// Differences of two sequences.
fn script(expected: &[u32], got: &[u32]) -> Vec<Mismatch> {
    mismatches(&steps(expected, got), expected, got)
}

/// Converts steps to mismatches. A record that is missing and surplus nearby is `Moved`.
fn mismatches(steps: &[EditStep], expected: &[u32], got: &[u32]) -> Vec<Mismatch> {
    let (mut missing, mut surplus, mut found) = (Vec::new(), Vec::new(), Vec::new());
    let mut before = 0;
    for step in steps {
        match *step {
            EditStep::Pair(record, line) => {
                before = record + 1;
                if expected[record] != got[line] {
                    found.push(Mismatch::Different { record, line });
                }
            }
            EditStep::Missing(record) => {
                before = record + 1;
                missing.push(record);
            }
            EditStep::Surplus(line) => surplus.push((line, before)),
        }
    }
    for (line, before) in surplus {
        let near = missing.partition_point(|&record| record + NEAR < before);
        let is_it = |&record: &usize| expected[record] == got[line];
        let at = missing[near..]
            .iter()
            .take_while(|&&record| record <= before + NEAR)
            .position(is_it);
        found.push(match at {
            Some(at) => {
                let record = missing.remove(near + at);
                // Exchanged with the next record or with the previous one.
                match (before as i64) - (record as i64) {
                    2 => Mismatch::Moved {
                        record,
                        line: line - 1,
                        swapped: true,
                    },
                    -1 => Mismatch::Moved {
                        record: record - 1,
                        line,
                        swapped: true,
                    },
                    _ => Mismatch::Moved {
                        record,
                        line,
                        swapped: false,
                    },
                }
            }
            None => Mismatch::Surplus { line, before },
        });
    }
    found.extend(
        missing
            .into_iter()
            .map(|record| Mismatch::Missing { record }),
    );
    found.sort_by_key(Mismatch::record);
    found
}

/// Pairs two sequences in order.
fn steps(expected: &[u32], got: &[u32]) -> Vec<EditStep> {
    let mut script = EditScript {
        expected,
        got,
        at: [0, 0],
        steps: Vec::new(),
        bits: None,
        anchors: None,
        searched: None,
    };
    while script.at[0] < expected.len() && script.at[1] < got.len() {
        let [record, line] = script.at;
        if expected[record] == got[line] {
            script.pair();
        } else {
            script.step_over();
        }
    }
    let [record, line] = script.at;
    let mut steps = script.steps;
    steps.extend((record..expected.len()).map(EditStep::Missing));
    steps.extend((line..got.len()).map(EditStep::Surplus));
    steps
}

struct EditScript<'a> {
    expected: &'a [u32],
    got: &'a [u32],
    /// Number of records and lines that are paired or skipped so far.
    at: [usize; 2],
    steps: Vec<EditStep>,
    /// Information of each expected record in bits, by its number: rare records have more.
    bits: Option<HashMap<u32, u32>>,
    /// Runs that both sides have once: line and record, sorted by line.
    anchors: Option<(Vec<(usize, usize)>, usize)>,
    /// Start of the last window in which the sides were not in step.
    searched: Option<[usize; 2]>,
}

/// Cost of skipping `records` and `lines`: 8 per pair, plus one gap, whose length adds little.
fn cost(records: usize, lines: usize) -> usize {
    8 * records.min(lines) + gap(records.abs_diff(lines))
}

/// Cost of a run of `length` that only one side has.
fn gap(length: usize) -> usize {
    if length == 0 { 0 } else { 16 + length }
}

/// Bits of information in each record of a sequence.
fn information(records: &[u32]) -> HashMap<u32, u32> {
    let mut counts: HashMap<u32, u32> = HashMap::new();
    records
        .iter()
        .for_each(|record| *counts.entry(*record).or_default() += 1);
    let all = records.len() as u32;
    counts
        .into_iter()
        .map(|(record, count)| (record, (all / count).max(1).ilog2()))
        .collect()
}

/// Cost of continuing from here, in addition to the cost of the skip, if the sequences are in step:
/// they agree long enough to identify the place, or to the end of one sequence, and the rest of the
/// other is a gap. After one or two different records a few equal ones are enough, but an
/// identified place is always cheaper.
fn in_step(
    bits: &HashMap<u32, u32>,
    expected: &[u32],
    got: &[u32],
    skipped: [usize; 2],
) -> Option<usize> {
    let is_short = skipped[0] == skipped[1] && skipped[0] <= 2;
    let (mut equal, mut sure) = (0, 0);
    loop {
        if equal >= RUN / 2 && sure >= SURE_BITS || equal >= MOST_EQUAL {
            return Some(0);
        }
        match (expected.get(equal), got.get(equal)) {
            (Some(a), Some(b)) if a == b => {
                sure += bits.get(a).copied().unwrap_or(0);
                equal += 1;
            }
            (Some(_), Some(_)) => return (is_short && equal >= RUN / 2).then_some(gap(WINDOW)),
            (None, None) => return Some(0),
            _ => return (equal > 0).then(|| gap(expected.len().abs_diff(got.len()))),
        }
    }
}

impl EditScript<'_> {
    fn pair(&mut self) {
        let [record, line] = self.at;
        self.steps.push(EditStep::Pair(record, line));
        self.at = [record + 1, line + 1];
    }

    /// Skips to the next place at which both sides are in step, or past one pair if there is none.
    fn step_over(&mut self) {
        let [record, line] = self.at;
        let (expected, got) = (&self.expected[record..], &self.got[line..]);
        let is_swap =
            expected.len() > 1 && got.len() > 1 && expected[0] == got[1] && expected[1] == got[0];
        let bits = self.bits.get_or_insert_with(|| information(self.expected));
        if is_swap && in_step(bits, &expected[2..], &got[2..], [2, 2]).is_some() {
            // The edit script: the first is missing here, the second is equal, then the first is
            // surplus.
            self.steps.extend([
                EditStep::Missing(record),
                EditStep::Pair(record + 1, line),
                EditStep::Surplus(line + 1),
            ]);
            self.at = [record + 2, line + 2];
            return;
        }
        match self.nearest().or_else(|| self.anchored()) {
            Some(skipped) => self.skip(skipped),
            None => self.pair(),
        }
    }

    /// The cheapest place in the window at which both sides are in step.
    fn nearest(&mut self) -> Option<[usize; 2]> {
        let [record, line] = self.at;
        let (expected, got) = (&self.expected[record..], &self.got[line..]);
        let bits = self.bits.get_or_insert_with(|| information(self.expected));
        // A window that started one pair earlier contained all places except the last row and
        // column.
        let is_next = self.searched == Some([record.wrapping_sub(1), line.wrapping_sub(1)])
            && record > 0
            && line > 0;
        let (most, least) = (
            [expected.len().min(WINDOW), got.len().min(WINDOW)],
            if is_next { WINDOW } else { 0 },
        );
        let mut best: Option<(usize, [usize; 2])> = None;
        for records in 0..=most[0] {
            for lines in 0..=most[1] {
                if records.max(lines) < least || records + lines == 0 {
                    continue;
                }
                let cost = cost(records, lines);
                let is_lower = |cost: usize| best.is_none_or(|(lowest, _)| cost < lowest);
                if !is_lower(cost) {
                    continue;
                }
                let Some(more) =
                    in_step(bits, &expected[records..], &got[lines..], [records, lines])
                else {
                    continue;
                };
                if is_lower(cost + more) {
                    best = Some((cost + more, [records, lines]));
                }
            }
        }
        self.searched = best.is_none().then_some(self.at);
        best.map(|(_, skipped)| skipped)
    }

    /// The cheapest of the next places with a run of records that both sides have once.
    fn anchored(&mut self) -> Option<[usize; 2]> {
        let [record, line] = self.at;
        let (anchors, next) = self
            .anchors
            .get_or_insert_with(|| (anchors(self.expected, self.got), 0));
        *next += anchors[*next..]
            .iter()
            .take_while(|anchor| anchor.0 < line || anchor.1 < record)
            .count();
        let ahead = anchors[*next..]
            .iter()
            .filter(|anchor| anchor.0 >= line && anchor.1 >= record)
            .take(WINDOW);
        ahead
            .map(|&(lines, records)| [records - record, lines - line])
            .min_by_key(|&[records, lines]| cost(records, lines))
    }

    /// Explains `records` and `lines` at the least cost.
    fn skip(&mut self, [records, lines]: [usize; 2]) {
        let [record, line] = self.at;
        self.at = [record + records, line + lines];
        if (records + 1).saturating_mul(lines + 1) > MOST_CELLS {
            let pairs = records.min(lines);
            self.steps
                .extend((0..pairs).map(|place| EditStep::Pair(record + place, line + place)));
            self.steps
                .extend((pairs..records).map(|place| EditStep::Missing(record + place)));
            self.steps
                .extend((pairs..lines).map(|place| EditStep::Surplus(line + place)));
            return;
        }
        let (expected, got) = (
            &self.expected[record..record + records],
            &self.got[line..line + lines],
        );
        // Costs from each place to the end: 2 for a missing, a surplus or a different record. A
        // different pair is thus cheaper than a missing and a surplus record.
        let width = lines + 1;
        let mut costs = vec![0u32; (records + 1) * width];
        let pair = |i: usize, j: usize| if expected[i] == got[j] { 0 } else { 2 };
        for i in (0..=records).rev() {
            for j in (0..=lines).rev() {
                let mut least = u32::MAX;
                if i < records && j < lines {
                    least = costs[(i + 1) * width + j + 1] + pair(i, j);
                }
                if i < records {
                    least = least.min(costs[(i + 1) * width + j] + 2);
                }
                if j < lines {
                    least = least.min(costs[i * width + j + 1] + 2);
                }
                costs[i * width + j] = if i == records && j == lines { 0 } else { least };
            }
        }
        let (mut i, mut j) = (0, 0);
        while i < records || j < lines {
            let here = costs[i * width + j];
            if i < records && j < lines && here == costs[(i + 1) * width + j + 1] + pair(i, j) {
                self.steps.push(EditStep::Pair(record + i, line + j));
                (i, j) = (i + 1, j + 1);
            } else if i < records && here == costs[(i + 1) * width + j] + 2 {
                self.steps.push(EditStep::Missing(record + i));
                i += 1;
            } else {
                self.steps.push(EditStep::Surplus(line + j));
                j += 1;
            }
        }
    }
}

/// Places at which both sides have the same run of [`RUN`] records, each side once: line and
/// record, sorted by line.
fn anchors(expected: &[u32], got: &[u32]) -> Vec<(usize, usize)> {
    let once = |side: &[u32]| {
        let mut runs: HashMap<[u32; RUN], Option<usize>> = HashMap::new();
        for (place, run) in side.windows(RUN).enumerate() {
            let run = std::array::from_fn(|at| run[at]);
            runs.entry(run)
                .and_modify(|place| *place = None)
                .or_insert(Some(place));
        }
        runs
    };
    let ours = once(expected);
    let mut all: Vec<(usize, usize)> = once(got)
        .into_iter()
        .filter_map(|(run, line)| Some((line?, ours.get(&run).copied().flatten()?)))
        .collect();
    all.sort_unstable();
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Every record and line is used once, in order, and no equal pair is reported as
        /// different.
        #[test]
        fn a_script_explains_all_records(expected in prop::collection::vec(0u32..6, 0..200), got in prop::collection::vec(0u32..6, 0..200)) {
            let steps = steps(&expected, &got);
            let records: Vec<usize> = steps.iter().filter_map(|step| match step {
                EditStep::Pair(record, _) | EditStep::Missing(record) => Some(*record),
                EditStep::Surplus(_) => None,
            }).collect();
            let lines: Vec<usize> = steps.iter().filter_map(|step| match step {
                EditStep::Pair(_, line) | EditStep::Surplus(line) => Some(*line),
                EditStep::Missing(_) => None,
            }).collect();
            prop_assert_eq!(records, (0..expected.len()).collect::<Vec<_>>());
            prop_assert_eq!(lines, (0..got.len()).collect::<Vec<_>>());
        }

        #[test]
        fn a_run_that_is_cut_out_is_missing_and_nothing_else(all in prop::collection::vec(any::<u32>(), 60..600), at in any::<prop::sample::Index>(), long in 1usize..300) {
            let first = at.index(all.len() - 20);
            let last = (first + long).min(all.len() - 10);
            let got = [&all[..first], &all[last..]].concat();
            let found = script(&all, &got);
            prop_assert_eq!(found, (first..last).map(|record| Mismatch::Missing { record }).collect::<Vec<_>>());
            let found = script(&got, &all);
            prop_assert_eq!(found, (first..last).map(|line| Mismatch::Surplus { line, before: first }).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_longest_rising_run_is_found() {
        let pairs: Vec<(u32, u32)> = [3, 0, 1, 4, 2, 5]
            .into_iter()
            .enumerate()
            .map(|(record, line)| (record as u32, line))
            .collect();
        assert_eq!(
            longest_increasing(&pairs)
                .iter()
                .filter(|chosen| **chosen)
                .count(),
            4
        );
        assert_eq!(longest_increasing(&[]), [false; 0]);
    }
}

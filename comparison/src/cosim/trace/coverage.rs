//! Coverage: counts the cases that a trace's records met: each rounding and limit of each signal,
//! and each decision of the units.

use rtl_model::num::{Fit, Rounding};
use rtl_model::pipeline::Elaborated;
use rtl_model::probe::Observer;
use std::any::Any;
use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Cases of a word that is quantised: exact; the lost part is below, at or above half an LSB;
/// saturated at a limit.
const WORD_CASES: [&str; 6] = [
    "exact",
    "below half",
    "tie",
    "above half",
    "low limit",
    "high limit",
];

/// Count of each case.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Coverage {
    /// Names of signals, and the count of each of [`WORD_CASES`].
    signals: Vec<(String, [u64; 6])>,
    /// Whether exact results of a signal had bits below the LSB and were rounded other than by
    /// truncation. Otherwise these cases cannot occur.
    loses: Vec<bool>,
    /// Decisions of units.
    cases: BTreeMap<(&'static str, String), u64>,
}

impl Coverage {
    /// All counts 0.
    pub fn new(machine: &Elaborated) -> Self {
        let signals: Vec<_> = machine
            .signals
            .iter()
            .map(|signal| (format!("{}.{}", signal.unit, signal.name), [0; 6]))
            .collect();
        Coverage {
            loses: vec![false; signals.len()],
            signals,
            cases: BTreeMap::new(),
        }
    }

    /// Counts a case of a unit.
    pub fn count(&mut self, unit: &'static str, case: &str) {
        *self.cases.entry((unit, case.to_owned())).or_default() += 1;
    }

    /// Counts a case if `holds`; otherwise adds the case with its count unchanged.
    pub fn count_if(&mut self, holds: bool, unit: &'static str, case: &str) {
        *self.cases.entry((unit, case.to_owned())).or_default() += u64::from(holds);
    }

    /// Every case: its unit or signal, its name, its count.
    pub fn rows(&self) -> Vec<(String, String, u64)> {
        let mut rows = Vec::new();
        for ((signal, met), loses) in self.signals.iter().zip(&self.loses) {
            let possible = WORD_CASES
                .iter()
                .zip(met)
                .enumerate()
                .filter(|(i, (_, count))| **count > 0 || *loses || *i == 0 || *i > 3);
            rows.extend(
                possible.map(|(_, (case, count))| (signal.clone(), (*case).to_owned(), *count)),
            );
        }
        rows.extend(
            self.cases
                .iter()
                .map(|((unit, case), count)| ((*unit).to_owned(), case.clone(), *count)),
        );
        rows
    }

    /// The rows as CSV.
    pub fn csv(&self) -> String {
        let mut text = String::from("where,case,met\n");
        for (place, case, met) in self.rows() {
            let _ = writeln!(text, "{place},\"{case}\",{met}");
        }
        text
    }

    /// Number of cases that occurred, and of all cases.
    pub fn counts(&self) -> [usize; 2] {
        let rows = self.rows();
        [rows.iter().filter(|row| row.2 > 0).count(), rows.len()]
    }

    /// Adds the counts of another part.
    pub fn merge(&mut self, other: Coverage) {
        if self.signals.is_empty() {
            *self = other;
            return;
        }
        for (own, other) in self.signals.iter_mut().zip(&other.signals) {
            own.1
                .iter_mut()
                .zip(other.1)
                .for_each(|(own, other)| *own += other);
        }
        self.loses
            .iter_mut()
            .zip(other.loses)
            .for_each(|(own, other)| *own |= other);
        for (case, count) in other.cases {
            *self.cases.entry(case).or_default() += count;
        }
    }

    /// All counts 0, for the same machine.
    pub fn of_another_part(&self) -> Coverage {
        Coverage {
            signals: self
                .signals
                .iter()
                .map(|(name, _)| (name.clone(), [0; 6]))
                .collect(),
            loses: vec![false; self.loses.len()],
            cases: BTreeMap::new(),
        }
    }

    /// Counts the quantisation of an exact result.
    pub fn fitted(&mut self, fit: &Fit, exact: i64, more: i64) {
        let places = (fit.places() + more).clamp(0, 63) as u32;
        let loss = fit.loss(exact, more);
        let Some((_, met)) = self.signals.get_mut(fit.signal) else {
            return;
        };
        self.loses[fit.signal] |= places > 0 && fit.word.round != Rounding::Truncate;
        let below = exact & ((1i64 << places.min(62)) - 1);
        let half = if places == 0 {
            0
        } else {
            1i64 << (places.min(62) - 1)
        };
        let case = match below.cmp(&half) {
            _ if !loss.inexact => 0,
            Ordering::Less => 1,
            Ordering::Equal => 2,
            Ordering::Greater => 3,
        };
        met[if fit.word.round == Rounding::Truncate && case > 0 {
            1
        } else {
            case
        }] += 1;
        met[4] += u64::from(loss.saturated_low);
        met[5] += u64::from(loss.saturated_high);
    }
}

impl Observer<'static> for Coverage {
    fn fork(&self) -> Box<dyn Observer<'static>> {
        Box::new(self.of_another_part())
    }

    fn hand_over(self: Box<Self>) -> Box<dyn Any + Send> {
        self
    }

    fn take_over(&mut self, seen: Box<dyn Any + Send>) {
        if let Ok(fork) = seen.downcast::<Coverage>() {
            self.merge(*fork);
        }
    }

    fn word(&mut self, fit: &Fit, exact: i64, more: i64, _word: i64) {
        self.fitted(fit, exact, more);
    }
}

//! Coverage: which cases a trace's records met, and how often: every rounding and limit of every
//! signal, and what units decide by.

use rtl_model::num::{Fit, Rounding};
use rtl_model::pipeline::Elaborated;
use rtl_model::probe::Observer;
use std::any::Any;
use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::fmt::Write;

/// What can happen to a word that loses bits: nothing; less than half of its last place, half, more
/// than half; its limits.
const FITS: [&str; 6] = [
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
    /// Names of signals, and how often each met which of [`FITS`].
    signals: Vec<(String, [u64; 6])>,
    /// Whether some exact result of a signal had places to lose, and was rounded by more than a
    /// cut: else there is nothing to meet there.
    loses: Vec<bool>,
    /// What units decide by.
    cases: BTreeMap<(&'static str, String), u64>,
}

impl Coverage {
    /// Nothing met yet.
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

    /// Counts a case where it holds; else it is known, and maybe never met.
    pub fn count_if(&mut self, holds: bool, unit: &'static str, case: &str) {
        *self.cases.entry((unit, case.to_owned())).or_default() += u64::from(holds);
    }

    /// Every case that can be told apart: its unit or signal, what it is, how often it was met.
    pub fn rows(&self) -> Vec<(String, String, u64)> {
        let mut rows = Vec::new();
        for ((signal, met), loses) in self.signals.iter().zip(&self.loses) {
            let possible = FITS
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

    /// Cases that were met, and all of them.
    pub fn counts(&self) -> [usize; 2] {
        let rows = self.rows();
        [rows.iter().filter(|row| row.2 > 0).count(), rows.len()]
    }

    /// Takes over what another part met.
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

    /// Nothing met yet, of the same machine.
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

    /// Notes what becomes of an exact result.
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

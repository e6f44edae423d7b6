//! Ranges: the observed words of every signal, as part of `report.json`, as a table and as a chart.
//!
//! ```text
//! signals, ranges ─► [report: format, extremes, unused bits, narrowest format, histogram] ─┬─► report.json
//!                                                                                          ├─► table, 80 columns
//!                                                                                          └─► ranges.png
//! ```
//! Extremes and results out of range count all words. Histograms and inexact results count a
//! sample, which is the same every time (`rtl_model::probe::Meters`). For a register that is
//! incremented pixel by pixel (`raster.radial`, `raster.depth`) the words are its seeds; the values
//! that it reaches count for the narrowest format.
//!
//! Laws: `a_report_contains_the_extremes_of_a_range`,
//! `a_machine_of_narrowest_formats_draws_the_same_picture`.

use crate::accuracy::partial::UNITS;
use crate::output::chart::{Extent, Extents};
use crate::output::text::share;
use rtl_model::elaboration::Signal;
use rtl_model::num::Format;
use rtl_model::probe::Range;
use schemars::JsonSchema;
use serde::Serialize;
use std::fmt::Write;

/// Signals that may saturate without a loss, and the reason.
const DECLARED_CLAMPS: [(&str, &str, &str); 2] = [
    (
        "ellipse",
        "depth_slope",
        "a grazing plane's slope has no limit; the depth clamp rules there",
    ),
    (
        "ellipse",
        "edge",
        "a box's side far outside the picture is clipped to it anyway",
    ),
];

/// One signal's range.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct SignalReport {
    /// Unit of the signal.
    pub unit: &'static str,
    /// Name of the signal in its unit.
    pub name: String,
    /// Its format.
    pub format: String,
    round: rtl_model::num::Rounding,
    overflow: rtl_model::num::Overflow,
    /// Words of the sample; of every item of work if there are few.
    pub words: u64,
    /// Least and greatest observed value; none if there was no word.
    min: Option<f64>,
    max: Option<f64>,
    saturated_low: u64,
    saturated_high: u64,
    wrapped: u64,
    /// Words of the sample that lost bits below the LSB.
    inexact: u64,
    /// Share of inexact words in the sample; none for an empty sample.
    inexact_share: Option<f64>,
    /// The narrowest format, signed like this one, that holds every result; none if there was no
    /// word.
    narrowest: Option<String>,
    /// Integer bits that the narrowest format saves; below 0 if results were out of range.
    unused_high_bits: Option<i32>,
    /// Fraction bits that the narrowest format saves: they were 0 in every word.
    unused_low_bits: Option<i32>,
    histogram: Histogram,
    /// Why saturation is not a loss here.
    #[serde(skip_serializing_if = "Option::is_none")]
    declared_clamp: Option<&'static str>,
    /// Powers of two of the LSB and of the least power that no magnitude reaches.
    #[serde(skip)]
    extent: [i32; 2],
    /// If results were out of range: a format with the same number of bits that holds every result.
    #[serde(skip)]
    as_wide: Option<String>,
}

/// Words by magnitude.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Histogram {
    /// Words that are 0.
    pub zeros: u64,
    /// k of the first count.
    pub first_log2: i32,
    /// Number of words with 2^k ≤ |value| < 2^(k+1), with k increasing by one per count. Empty if
    /// all words are 0.
    pub counts: Vec<u64>,
}

impl Histogram {
    fn new(range: &Range, frac_bits: i32) -> Self {
        let zeros = range.bins[0];
        let (Some(first), Some(last)) = (
            (1..range.bins.len()).find(|bin| range.bins[*bin] > 0),
            (1..range.bins.len()).rfind(|bin| range.bins[*bin] > 0),
        ) else {
            return Histogram {
                zeros,
                ..Histogram::default()
            };
        };
        Histogram {
            zeros,
            first_log2: first as i32 - 1 - frac_bits,
            counts: range.bins[first..=last].to_vec(),
        }
    }
}

/// Results out of their format's range, over all signals, if that is a loss.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Overflows {
    /// Saturated results, without those of declared clamps.
    pub saturated: u64,
    /// Results that wrapped.
    pub wrapped: u64,
    /// The signals of both, as `unit.name`.
    pub signals: Vec<String>,
}

impl Overflows {
    /// Sums the reports of signals. No declared clamp wraps.
    pub fn of(signals: &[SignalReport]) -> Self {
        let mut all = Overflows::default();
        for signal in signals
            .iter()
            .filter(|signal| !signal.is_declared_clamp() && signal.overflows() > 0)
        {
            all.saturated += signal.saturated();
            all.wrapped += signal.wrapped();
            all.signals.push(format!("{}.{}", signal.unit, signal.name));
        }
        all
    }

    /// Saturated and wrapped results.
    pub fn total(&self) -> u64 {
        self.saturated + self.wrapped
    }
}

impl SignalReport {
    /// Report of an observed signal.
    pub fn new(signal: &Signal, range: &Range) -> Self {
        let format = signal.word.format;
        let value = |word: i64| range.has_words().then(|| format.value(word));
        let narrowest = range.narrowest(format);
        let declared = DECLARED_CLAMPS
            .iter()
            .find(|(unit, name, _)| (*unit, *name) == (signal.unit, signal.name.as_str()));
        SignalReport {
            unit: signal.unit,
            name: signal.name.clone(),
            format: format.to_string(),
            round: signal.word.round,
            overflow: signal.word.overflow,
            words: range.words,
            min: value(range.min),
            max: value(range.max),
            saturated_low: range.saturated_low,
            saturated_high: range.saturated_high,
            wrapped: range.wrapped,
            inexact: range.inexact,
            inexact_share: (range.words > 0).then(|| range.inexact as f64 / range.words as f64),
            narrowest: narrowest.map(|narrowest| narrowest.to_string()),
            unused_high_bits: narrowest.map(|narrowest| format.int_bits - narrowest.int_bits),
            unused_low_bits: narrowest.map(|narrowest| format.frac_bits - narrowest.frac_bits),
            histogram: Histogram::new(range, format.frac_bits),
            declared_clamp: declared.map(|(_, _, why)| *why),
            as_wide: narrowest
                .map(|narrowest| narrowest.int_bits - format.int_bits)
                .filter(|lacking| (1..=format.frac_bits).contains(lacking))
                .map(|lacking| {
                    Format {
                        int_bits: format.int_bits + lacking,
                        frac_bits: format.frac_bits - lacking,
                        ..format
                    }
                    .to_string()
                }),
            extent: [
                -format.frac_bits,
                format.magnitude_bits() - format.frac_bits,
            ],
        }
    }

    /// Results that were saturated.
    pub fn saturated(&self) -> u64 {
        self.saturated_low + self.saturated_high
    }

    /// Results that wrapped.
    pub fn wrapped(&self) -> u64 {
        self.wrapped
    }

    /// Whether saturation is not a loss here.
    pub fn is_declared_clamp(&self) -> bool {
        self.declared_clamp.is_some()
    }

    /// Results out of the format's range.
    pub fn overflows(&self) -> u64 {
        self.saturated() + self.wrapped
    }

    /// The setting that avoids an unnecessary saturation. Kernels of points can be seen along their
    /// length, and no single format suits all of them.
    pub fn remedy(&self) -> Option<String> {
        let is_depth_of_kernels =
            (self.unit, self.name.as_str()) == ("ellipse", "visibility") && self.saturated() > 0;
        self.as_wide
            .as_ref()
            .filter(|_| is_depth_of_kernels)
            .map(|format| format!("--set ellipse.visibility={format}"))
    }

    /// A row of the table; empty cells for a signal without words.
    fn row(&self) -> String {
        let [min, max] = [self.min, self.max].map(|value| value.map_or(String::new(), few_digits));
        let [high, low] = [self.unused_high_bits, self.unused_low_bits]
            .map(|bits| bits.map_or(String::new(), |bits| bits.to_string()));
        let needs = self.narrowest.clone().unwrap_or_default();
        let limited = if self.overflows() > 0 {
            few_characters(self.overflows())
        } else {
            String::new()
        };
        let inexact = if self.words > 0 {
            share(self.inexact, self.words)
        } else {
            String::new()
        };
        row([
            &self.name,
            &self.format,
            &min,
            &max,
            &high,
            &low,
            &needs,
            &limited,
            &inexact,
        ])
    }

    fn extent(&self) -> Extent {
        let part = |count: &u64| *count as f64 / self.words.max(1) as f64;
        let Histogram {
            zeros,
            first_log2,
            counts,
        } = &self.histogram;
        let top = self.extent[1];
        Extent {
            name: self.name.clone(),
            columns: [
                self.format.clone(),
                self.narrowest.clone().unwrap_or_default(),
                share(*zeros, self.words),
            ],
            places: self.extent,
            // The least word of a signed format has the magnitude that the others stay below.
            parts: counts
                .iter()
                .zip(*first_log2..)
                .map(|(count, log2)| (log2.min(top - 1), part(count)))
                .collect(),
            beyond: if self.overflows() > 0 {
                self.unused_high_bits.map_or(1, |bits| (-bits).max(1))
            } else {
                0
            },
        }
    }
}

/// The signals of each unit, unit by unit.
fn by_unit(signals: &[SignalReport]) -> impl Iterator<Item = (&'static str, Vec<&SignalReport>)> {
    // The splat's record has words but no signals, and not every machine sorts.
    let of = |unit| {
        (
            unit,
            signals
                .iter()
                .filter(|signal| signal.unit == unit)
                .collect::<Vec<_>>(),
        )
    };
    UNITS
        .into_iter()
        .map(of)
        .filter(|(_, signals)| !signals.is_empty())
}

/// All ranges as a table of at most 80 columns.
pub fn table(signals: &[SignalReport]) -> String {
    let mut text = row([
        "", "format", "least", "most", "top", "end", "needs", "over", "inexact",
    ]);
    for (unit, signals) in by_unit(signals) {
        let _ = write!(
            text,
            "{unit}\n{}",
            signals
                .iter()
                .map(|signal| signal.row())
                .collect::<String>()
        );
    }
    text + "top, end: unneeded bits. needs: the narrowest format. over: left the range.\n\n"
}

fn row([name, format, min, max, high, low, needs, limited, inexact]: [&str; 9]) -> String {
    let line = format!(
        "  {name:<27}{format:>7}{min:>8}{max:>8}{high:>4}{low:>4}{needs:>7}{limited:>5}{inexact:>8}"
    );
    line.trim_end().to_owned() + "\n"
}

/// A value in at most seven characters, if its power of ten has one digit.
fn few_digits(value: f64) -> String {
    let text = match value.abs() {
        0.0 => return "0".into(),
        0.01..100.0 => format!("{value:.3}"),
        100.0..10_000.0 => format!("{value:.1}"),
        _ => format!("{value:.1e}"),
    };
    let is_plain = text.contains('.') && !text.contains('e');
    if is_plain {
        text.trim_end_matches('0').trim_end_matches('.').into()
    } else {
        text
    }
}

/// A count in at most four characters.
fn few_characters(count: u64) -> String {
    let [thousands, millions] = [count / 1000, count / 1_000_000];
    match count {
        0..10_000 => count.to_string(),
        10_000..1_000_000 => format!("{thousands}k"),
        _ => format!("{millions}M"),
    }
}

/// The chart of all ranges of a scene on a machine.
pub fn chart(scene: &str, machine: &str, signals: &[SignalReport]) -> Extents {
    Extents {
        title: format!("{scene} on {machine}: words by magnitude, in their formats"),
        heads: ["format", "narrowest", "zeros"].map(String::from),
        groups: by_unit(signals)
            .map(|(unit, signals)| {
                (
                    unit.to_owned(),
                    signals.into_iter().map(SignalReport::extent).collect(),
                )
            })
            .collect(),
    }
}

#[cfg(test)]
mod tests;

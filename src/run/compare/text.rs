//! Text: a comparison for a terminal of 80 columns.

use super::fields::{FIGURES, Notation};
use super::{ComparedFigure, ComparedUnit, Comparison, Difference, Named, Pictures, UnitSide};
use crate::output::text::{aligned, clipped, counted, one_line, plain_table, thousands, wrapped};
use rtl_model::num::Format;
use serde_json::Value;

/// Greatest number of fields of the machine in the text, unless all are requested.
const MOST_FIELDS: usize = 24;

impl Comparison {
    /// The text, at most 80 columns wide; with many fields that differ only the first ones, unless
    /// `all`.
    pub fn summary(&self, all: bool) -> String {
        let head = format!("{}\n{}", headline("A", &self.a), headline("B", &self.b));
        if self.equal {
            let what = if self.pictures.is_empty() {
                ""
            } else {
                ", nor does any pixel"
            };
            return format!("{head}\n\nnothing differs{what}");
        }
        let same_frame = if self.scene.is_empty() {
            None
        } else {
            Some(wrapped(
                "the scenes differ: the figures are of two different frames",
            ))
        };
        let parts = [
            same_frame,
            fields(&self.scene, "scene", true),
            Some(self.figure_table()).filter(|_| !self.figures.is_empty()),
            self.cycle_table(),
            self.area_table(),
            self.picture_table(),
            fields(&self.machine, "machine", all)
                .or_else(|| Some("no field of the machine differs".into())),
            (!self.elsewhere.is_empty()).then(|| {
                wrapped(&format!(
                    "other differences in report.json: {}",
                    self.elsewhere
                        .iter()
                        .map(|path| one_line(path))
                        .collect::<Vec<_>>()
                        .join(", ")
                ))
            }),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        format!("{head}\n\n{}", parts.join("\n\n"))
    }

    fn figure_table(&self) -> String {
        let mut table = plain_table(&["", "A", "B", "B against A"]);
        for figure in &self.figures {
            let notation = notation(figure);
            table.add_row([
                figure.name.into(),
                number(&figure.a, notation),
                number(&figure.b, notation),
                step(figure, notation),
            ]);
        }
        aligned(table).trim_fmt()
    }

    /// Units whose cycles differ.
    fn cycle_table(&self) -> Option<String> {
        let differ: Vec<&ComparedUnit> = self
            .units
            .iter()
            .filter(|unit| unit.a.cycles != unit.b.cycles)
            .collect();
        let mut table = plain_table(&[
            "",
            "busy A",
            "B",
            "starved A",
            "B",
            "blocked A",
            "B",
            "memory A",
            "B",
        ]);
        for ComparedUnit { name, a, b } in &differ {
            let cell = |side: &UnitSide, state: usize| {
                side.cycles
                    .map_or("–".into(), |cycles| short(cycles[state]))
            };
            let states = (0..4).flat_map(|state| [cell(a, state), cell(b, state)]);
            table.add_row(std::iter::once(one_line(name)).chain(states));
        }
        (!differ.is_empty()).then(|| aligned(table).trim_fmt())
    }

    fn area_table(&self) -> Option<String> {
        let differ: Vec<&ComparedUnit> = self
            .units
            .iter()
            .filter(|unit| unit.a.area != unit.b.area)
            .collect();
        let mut table = plain_table(&["area", "A", "B", "B against A"]);
        for ComparedUnit { name, a, b } in &differ {
            let cell = |area: Option<f64>| area.map_or("–".into(), |area| thousands(area as u64));
            let change = a
                .area
                .zip(b.area)
                .map_or(String::new(), |(a, b)| relative(a, b));
            table.add_row([one_line(name), cell(a.area), cell(b.area), change]);
        }
        (!differ.is_empty()).then(|| aligned(table).trim_fmt())
    }

    fn picture_table(&self) -> Option<String> {
        let mut table = plain_table(&[
            "A − B",
            "PSNR dB",
            "SSIM",
            "max error",
            "mean error",
            "px > 1/255",
            "px that differ",
        ]);
        for pair in &self.pictures {
            let Pictures {
                name,
                psnr_db,
                ssim,
                max_error,
                mean_error,
                pixels_over_1_255,
                pixels_that_differ,
            } = pair;
            table.add_row([
                (*name).to_owned(),
                psnr_db.map_or("equal".into(), |db| format!("{db:.1}")),
                format!("{ssim:.5}"),
                format!("{max_error:.4}"),
                if *mean_error == 0.0 {
                    "0".into()
                } else {
                    format!("{mean_error:.1e}")
                },
                thousands(*pixels_over_1_255),
                thousands(*pixels_that_differ),
            ]);
        }
        (!self.pictures.is_empty()).then(|| aligned(table).trim_fmt())
    }
}

fn headline(
    letter: &str,
    Named {
        name,
        machine,
        scene,
        size,
    }: &Named,
) -> String {
    let frame = match (scene, size) {
        (Some(scene), Some([width, height])) => {
            format!(" on {}, {width}×{height}", one_line(scene))
        }
        _ => String::new(),
    };
    let [name, machine] = [name, machine].map(|text| one_line(text));
    let of = if name.split(' ').next() == Some(&machine) {
        name
    } else {
        format!("{name}: {machine}")
    };
    wrapped(&format!("{letter}: {of}{frame}"))
}

/// Fields that differ: numbers and rules before words, which are many.
fn fields(differences: &[Difference], head: &str, all: bool) -> Option<String> {
    let is_word = |difference: &&Difference| {
        let value = difference
            .a
            .as_ref()
            .or(difference.b.as_ref())
            .and_then(Value::as_str);
        value
            .and_then(|text| text.split(' ').next()?.parse::<Format>().ok())
            .is_some()
    };
    let (words, others): (Vec<&Difference>, Vec<&Difference>) =
        differences.iter().partition(is_word);
    let most = if all { differences.len() } else { MOST_FIELDS };
    let mut table = plain_table(&[head, "A", "B"]);
    for Difference {
        field,
        a,
        b,
        left_out,
    } in others.into_iter().chain(words).take(most)
    {
        let cell = |side: &str, value: &Option<Value>| match (value, left_out.contains(&side)) {
            (Some(value), false) => plain(value),
            (Some(value), true) => format!("{} (left out)", plain(value)),
            (None, _) => "left out".into(),
        };
        table.add_row([one_line(field), cell("a", a), cell("b", b)]);
    }
    let rest = differences.len().saturating_sub(most);
    let rest = if rest > 0 {
        let fields = if rest == 1 { "field" } else { "fields" };
        format!("\nand {rest} more {fields} of the {head}: --all lists them")
    } else {
        String::new()
    };
    (!differences.is_empty()).then(|| aligned(table).trim_fmt() + &rest)
}

/// A value of a field; for an object its number of fields.
fn plain(value: &Value) -> String {
    match value {
        Value::Object(fields) => counted(fields.len() as u64, "field", "fields"),
        Value::String(text) => clipped(text),
        other => clipped(&other.to_string()),
    }
}

fn notation(figure: &ComparedFigure) -> Notation {
    FIGURES
        .iter()
        .find(|(name, ..)| *name == figure.name)
        .map_or(Notation::Name, |(_, _, notation, _)| *notation)
}

fn number(value: &Value, notation: Notation) -> String {
    let Some(number) = value.as_f64() else {
        return value.as_str().map_or("–".into(), clipped);
    };
    match notation {
        Notation::Count => thousands(number as u64),
        Notation::Tenths | Notation::Decibels => format!("{number:.1}"),
        Notation::Scaled(factor) => format!("{:.2}", number * factor),
        Notation::Similarity => format!("{number:.5}"),
        Notation::Name => value.to_string(),
    }
}

fn step(figure: &ComparedFigure, notation: Notation) -> String {
    match (figure.a.as_f64(), figure.b.as_f64()) {
        _ if figure.a == figure.b => "=".into(),
        (Some(a), Some(b)) => match notation {
            Notation::Decibels => signed(b - a, " dB"),
            Notation::Similarity => format!("{:+.5}", b - a).replace('-', "−"),
            _ => relative(a, b),
        },
        _ => String::new(),
    }
}

/// The relative difference in per cent, or as a factor from tenfold on.
fn relative(a: f64, b: f64) -> String {
    if a == b {
        "=".into()
    } else if a == 0.0 || a.signum() != b.signum() && b != 0.0 {
        String::new()
    } else if b / a >= 10.0 {
        format!("×{:.1}", b / a)
    } else {
        signed(100.0 * (b - a) / a.abs(), "%")
    }
}

/// A difference with its sign; never displayed as zero unless it is zero.
fn signed(step: f64, unit: &str) -> String {
    match step {
        step if step.abs() >= 0.05 => format!("{step:+.1}{unit}").replace('-', "−"),
        step if step > 0.0 => format!("+ < 0.1{unit}"),
        _ => format!("− < 0.1{unit}"),
    }
}

/// Cycles in at most six characters.
fn short(cycles: u64) -> String {
    match cycles {
        0 => "–".into(),
        1..10_000 => thousands(cycles),
        10_000..1_000_000 => format!("{} k", cycles / 1000),
        _ => format!("{:.2} M", cycles as f64 / 1e6),
    }
}

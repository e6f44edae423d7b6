//! Fields: which figures and fields of two reports are compared, and how they differ.

use super::{ComparedFigure, ComparedUnit, Difference, UnitSide};
use crate::hardware::machines;
use serde_json::{Map, Value, json};

/// Notation of a figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Notation {
    /// An integer.
    Count,
    /// One decimal place.
    Tenths,
    /// Multiplied by this factor, with two decimal places.
    Scaled(f64),
    /// Decibels of two pictures.
    Decibels,
    /// Five decimal places.
    Similarity,
    /// A name.
    Name,
}

/// A figure: its name, its path in the report, its notation, and whether it is listed if both sides
/// are equal.
pub(super) const FIGURES: [(&str, &str, Notation, bool); 41] = [
    ("cycles", "/cycles/total", Notation::Count, true),
    (
        "clock, MHz",
        "/cycles/clock_hz",
        Notation::Scaled(1e-6),
        false,
    ),
    (
        "frames/s",
        "/cycles/frames_per_second",
        Notation::Tenths,
        true,
    ),
    ("limited by", "/cycles/bottleneck", Notation::Name, true),
    ("limit", "/cycles/limit/by", Notation::Name, false),
    (
        "memory, MB per frame",
        "/cycles/memory/bytes",
        Notation::Scaled(1e-6),
        true,
    ),
    (
        "memory, GB/s",
        "/cycles/memory/bytes_per_second",
        Notation::Scaled(1e-9),
        false,
    ),
    (
        "memory at most, GB/s",
        "/cycles/memory/peak_bytes_per_second",
        Notation::Scaled(1e-9),
        false,
    ),
    (
        "cache look-ups",
        "/cycles/lookups/0",
        Notation::Count,
        false,
    ),
    ("cache hits", "/cycles/lookups/1", Notation::Count, false),
    ("texel look-ups", "/cycles/texels/0", Notation::Count, false),
    ("texel hits", "/cycles/texels/1", Notation::Count, false),
    ("stamps tested", "/cycles/slots/0", Notation::Count, false),
    ("area, LUT equivalents", "/cost/area", Notation::Count, true),
    ("gates, NAND2", "/cost/gates/total", Notation::Count, true),
    (
        "SRAM, kbit",
        "/cost/gates/sram_kbit",
        Notation::Tenths,
        false,
    ),
    ("FIFOs, bits", "/cost/fifo_bits", Notation::Count, false),
    (
        "tiles, cache, bits",
        "/cost/memory_bits",
        Notation::Count,
        false,
    ),
    (
        "fragment, bits",
        "/machine/fragment_bits",
        Notation::Count,
        false,
    ),
    (
        "pixel, bits",
        "/cost/frame_bits_per_pixel",
        Notation::Count,
        false,
    ),
    (
        "widest operand, bits",
        "/machine/widest_operand_bits",
        Notation::Count,
        false,
    ),
    (
        "energy, mJ per frame",
        "/cost/energy/total",
        Notation::Scaled(1e3),
        true,
    ),
    (
        "fixed − golden, dB",
        "/accuracy/fixed_vs_golden/psnr_db",
        Notation::Decibels,
        true,
    ),
    (
        "golden − ideal, dB",
        "/accuracy/golden_vs_ideal/psnr_db",
        Notation::Decibels,
        true,
    ),
    (
        "fixed − ideal, dB",
        "/accuracy/fixed_vs_ideal/psnr_db",
        Notation::Decibels,
        true,
    ),
    (
        "in lockstep, dB",
        "/accuracy/lockstep/psnr_db",
        Notation::Decibels,
        true,
    ),
    (
        "fixed − ideal, SSIM",
        "/accuracy/fixed_vs_ideal/ssim",
        Notation::Similarity,
        false,
    ),
    (
        "fixed − golden, pixels > 1/255",
        "/accuracy/fixed_vs_golden/pixels_over_1_255",
        Notation::Count,
        false,
    ),
    (
        "decisions that flipped",
        "/accuracy/lockstep/decision_flips",
        Notation::Count,
        false,
    ),
    (
        "bound exceeded, pixels",
        "/accuracy/lockstep/bound_violations",
        Notation::Count,
        false,
    ),
    ("splats", "/scene/splats", Notation::Count, false),
    ("contributions", "/scene/fragments", Notation::Count, false),
    (
        "accumulated",
        "/fragments/accumulated",
        Notation::Count,
        false,
    ),
    ("inserted", "/fragments/inserted", Notation::Count, false),
    ("merged", "/fragments/merged", Notation::Count, false),
    ("evicted", "/fragments/evicted", Notation::Count, false),
    ("replaced", "/fragments/replaced", Notation::Count, false),
    ("dropped", "/fragments/dropped", Notation::Count, false),
    ("late", "/fragments/late", Notation::Count, false),
    ("inside", "/fragments/inside", Notation::Count, false),
    ("summed", "/fragments/summed", Notation::Count, false),
];

/// Figures that either report has, and that differ or are always listed.
pub(super) fn figures(a: &Value, b: &Value) -> Vec<ComparedFigure> {
    let figure = |(name, pointer, notation, always): (&'static str, &str, Notation, bool)| {
        let [one, other] = [a, b].map(|report| value_of(report, pointer, notation));
        let is_there = !one.is_null() || !other.is_null();
        let difference = one
            .as_f64()
            .zip(other.as_f64())
            .map(|(one, other)| other - one);
        let base = one
            .as_f64()
            .filter(|base| *base != 0.0 && notation != Notation::Decibels);
        let relative = difference.zip(base).map(|(step, base)| step / base);
        let scale = match notation {
            Notation::Scaled(scale) => Some(scale),
            _ => None,
        };
        let path = pointer[1..].replace('/', ".");
        (is_there && (always || one != other)).then_some(ComparedFigure {
            name,
            path,
            a: one,
            b: other,
            scale,
            difference,
            relative,
        })
    };
    FIGURES.into_iter().filter_map(figure).collect()
}

/// Value of a figure in a report; null if it is absent.
fn value_of(report: &Value, pointer: &str, notation: Notation) -> Value {
    let value = report.pointer(pointer).cloned().unwrap_or_default();
    if notation != Notation::Decibels {
        return value;
    }
    let Some(pair) = pointer
        .rsplit_once('/')
        .and_then(|(above, _)| report.pointer(above))
    else {
        return Value::Null;
    };
    match value {
        _ if pair["not_finite"].as_u64().is_some_and(|pixels| pixels > 0) => "NaN".into(),
        Value::Null if pair.is_object() => "equal".into(),
        value => value,
    }
}

/// Units of both: cycles if there is a frame, area if it differs.
pub(super) fn units(a: &Value, b: &Value) -> Vec<ComparedUnit> {
    let mut names: Vec<String> = Vec::new();
    for (report, list) in [
        (a, "/cycles/units"),
        (b, "/cycles/units"),
        (a, "/cost/units"),
        (b, "/cost/units"),
    ] {
        let all = report
            .pointer(list)
            .and_then(Value::as_array)
            .into_iter()
            .flatten()
            .filter_map(|unit| unit["name"].as_str());
        for name in all {
            if !names.iter().any(|known| known == name) {
                names.push(name.into());
            }
        }
    }
    let unit = |name: String| ComparedUnit {
        a: unit_of(a, &name),
        b: unit_of(b, &name),
        name,
    };
    names
        .into_iter()
        .map(unit)
        .filter(|unit| {
            unit.a.cycles.is_some() || unit.b.cycles.is_some() || unit.a.area != unit.b.area
        })
        .collect()
}

fn unit_of(report: &Value, name: &str) -> UnitSide {
    let find = |list: &str| {
        let all = report.pointer(list).and_then(Value::as_array);
        all.and_then(|all| all.iter().find(|unit| unit["name"] == name))
    };
    let cycles = find("/cycles/units");
    let counts = cycles.map(|unit| {
        ["busy", "starved", "blocked", "memory"].map(|state| unit[state].as_u64().unwrap_or(0))
    });
    let longest = cycles.and_then(|unit| {
        unit["blocked_by"]
            .as_array()?
            .iter()
            .max_by_key(|by| by["cycles"].as_u64())
    });
    UnitSide {
        cycles: counts,
        blocked_by: longest.and_then(|by| by["by"].as_str()).map(str::to_owned),
        area: find("/cost/units").and_then(|unit| unit["area"].as_f64()),
    }
}

/// Fields of two descriptions that differ, without the name.
pub(super) fn machine(a: &Value, b: &Value) -> Vec<Difference> {
    let described = |report: &Value| {
        report
            .pointer("/machine/description")
            .cloned()
            .unwrap_or_default()
    };
    let [one, other] = [a, b].map(described);
    let schema = machines::schema();
    let follows = |report: &Value, field: &str| {
        following(report, field).or_else(|| default_of(&schema, field))
    };
    let mut all = Vec::new();
    differences(&one, &other, "", &mut all);
    all.retain(|difference| difference.field != "name");
    for difference in &mut all {
        for (side, report) in [("a", a), ("b", b)] {
            let value = if side == "a" {
                &mut difference.a
            } else {
                &mut difference.b
            };
            if value.is_none() {
                *value = follows(report, &difference.field);
                difference.left_out.push(side);
            }
        }
    }
    all
}

/// Fields of two scenes that differ, without those that depend on the machine.
pub(super) fn scene(a: &Value, b: &Value) -> Vec<Difference> {
    let own = |report: &Value| {
        let fields = report["scene"].as_object().cloned().unwrap_or_default();
        let is_own = |name: &str| ["name", "width", "height", "splats", "camera"].contains(&name);
        Value::Object(
            fields
                .into_iter()
                .filter(|(name, _)| is_own(name))
                .collect(),
        )
    };
    let mut all = Vec::new();
    differences(&own(a), &own(b), "", &mut all);
    for difference in &mut all {
        difference.left_out = [("a", &difference.a), ("b", &difference.b)]
            .into_iter()
            .filter(|(_, value)| value.is_none())
            .map(|(side, _)| side)
            .collect();
    }
    all
}

/// Objects are compared field by field. A word, a list, and a value that only one side has, are one
/// field.
fn differences(a: &Value, b: &Value, path: &str, all: &mut Vec<Difference>) {
    let (one, other) = (word(a), word(b));
    if one == other {
        return;
    }
    let (Value::Object(fields), Value::Object(others)) = (&one, &other) else {
        all.push(Difference {
            field: path.into(),
            a: Some(one),
            b: Some(other),
            left_out: Vec::new(),
        });
        return;
    };
    let below = |name: &str| {
        if path.is_empty() {
            name.to_owned()
        } else {
            format!("{path}.{name}")
        }
    };
    let alone = |name: &String, [a, b]: [Option<&Value>; 2]| Difference {
        field: below(name),
        a: a.map(word),
        b: b.map(word),
        left_out: Vec::new(),
    };
    for (name, value) in fields {
        match others.get(name) {
            Some(other) => differences(value, other, &below(name), all),
            None => all.push(alone(name, [Some(value), None])),
        }
    }
    all.extend(
        others
            .iter()
            .filter(|(name, _)| !fields.contains_key(*name))
            .map(|(name, value)| alone(name, [None, Some(value)])),
    );
}

/// A word in its long form as text without defaults, for example `U0F12 truncate`; other values
/// unchanged.
fn word(value: &Value) -> Value {
    let part = |name: &str| value.get(name).and_then(Value::as_str);
    let (Some(format), Some(round), Some(overflow)) =
        (part("format"), part("round"), part("overflow"))
    else {
        return value.clone();
    };
    let [round, overflow] = [(round, "nearest"), (overflow, "saturate")]
        .map(|(part, usual)| (part != usual).then_some(part));
    json!(
        [Some(format), round, overflow]
            .into_iter()
            .flatten()
            .collect::<Vec<_>>()
            .join(" ")
    )
}

/// Value of a unit for a field of `timing` that its machine leaves out.
fn following(report: &Value, field: &str) -> Option<Value> {
    let rest = field.strip_prefix("timing.")?;
    let place = if rest == "fragment.hazard" {
        "hazard".into()
    } else {
        rest.replace('.', "/")
    };
    report
        .pointer(&format!("/machine/timing/{place}"))
        .filter(|value| value.is_number())
        .cloned()
}

/// The default of a field, by the schema.
fn default_of(schema: &Value, field: &str) -> Option<Value> {
    let mut at = schema;
    let mut found = None;
    for name in field.split('.') {
        let property = properties(schema, at)?.get(name)?;
        found = property
            .get("default")
            .filter(|value| !value.is_null() && !value.is_object())
            .cloned();
        at = property;
    }
    found
}

/// The fields of an object, behind references and options.
fn properties<'s>(schema: &'s Value, at: &'s Value) -> Option<&'s Map<String, Value>> {
    if let Some(path) = at["$ref"].as_str() {
        return properties(schema, schema.pointer(path.strip_prefix('#')?)?);
    }
    if let Some(options) = at["anyOf"].as_array() {
        return options.iter().find_map(|option| properties(schema, option));
    }
    at["properties"].as_object()
}

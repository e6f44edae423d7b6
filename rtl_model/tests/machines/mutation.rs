//! Implausible machines: named ones with words, counts and rules changed at random, through their
//! JSON.

use proptest::prelude::*;
use rtl_model::Machine;
use rtl_model::num::float::{LEAST_SIGNIFICANT_BITS, MAX_SIGNIFICANT_BITS};
use rtl_model::num::{Format, MAX_FRACTION_BITS, MAX_WIDTH_BITS};
use serde_json::{Value, json};

/// One change to one field.
#[derive(Clone, Copy, Debug)]
pub struct Mutation {
    field: prop::sample::Index,
    kind: u8,
    first: i32,
    second: i32,
}

pub fn mutations(count: std::ops::Range<usize>) -> impl Strategy<Value = Vec<Mutation>> {
    let one = (any::<prop::sample::Index>(), 0u8..9, -64..64i32, -64..64i32);
    prop::collection::vec(
        one.prop_map(|(field, kind, first, second)| Mutation {
            field,
            kind,
            first,
            second,
        }),
        count,
    )
}

pub fn named() -> impl Strategy<Value = &'static str> {
    prop::sample::select([&Machine::NAMES[..], &Machine::WINDOW_NAMES].concat())
}

/// Fields in which a machine differs from the machine that it is named after, for messages of
/// failures.
pub fn differences(machine: &Machine) -> Vec<String> {
    let [own, base] = [machine, &Machine::named(&machine.name).unwrap()]
        .map(|machine| serde_json::to_value(machine).unwrap());
    let mut fields = Vec::new();
    leaves(&base, "", &mut fields);
    fields
        .iter()
        .filter(|field| own.pointer(field) != base.pointer(field))
        .map(|f| format!("{f} {}", own.pointer(f).unwrap()))
        .collect()
}

/// The machine with one change.
pub fn mutated(machine: &Machine, mutation: &Mutation) -> Machine {
    let mut value = serde_json::to_value(machine).unwrap();
    let mut fields = Vec::new();
    leaves(&value, "", &mut fields);
    let pointer = &fields[mutation.field.index(fields.len())];
    let leaf = value.pointer_mut(pointer).unwrap();
    *leaf = change(leaf, pointer, mutation);
    serde_json::from_value(value).unwrap_or_else(|error| panic!("{pointer}: {error}"))
}

/// The machine with another format for one word.
pub fn with_format(machine: &Machine, signal: &str, format: Format) -> Machine {
    let mut value = serde_json::to_value(machine).unwrap();
    let pointer = format!("/{}", signal.replace('.', "/"));
    let leaf = value
        .pointer_mut(&pointer)
        .unwrap_or_else(|| panic!("no field {signal}"));
    match leaf {
        Value::Object(word) => drop(word.insert("format".into(), json!(format.to_string()))),
        other => *other = json!(format.to_string()),
    }
    serde_json::from_value(value).unwrap()
}

pub fn with_field(machine: &Machine, field: &str, to: Value) -> Machine {
    let mut value = serde_json::to_value(machine).unwrap();
    *value
        .pointer_mut(&format!("/{}", field.replace('.', "/")))
        .unwrap() = to;
    serde_json::from_value(value).unwrap()
}

fn leaves(value: &Value, pointer: &str, out: &mut Vec<String>) {
    match value {
        // It changes no picture: `timing.rs` covers it.
        Value::Object(_) if pointer == "/timing" => {}
        Value::Object(fields) if !fields.contains_key("format") => {
            fields
                .iter()
                .for_each(|(name, field)| leaves(field, &format!("{pointer}/{name}"), out));
        }
        _ if pointer == "/name" => {}
        _ => out.push(pointer.to_owned()),
    }
}

fn change(leaf: &Value, pointer: &str, m: &Mutation) -> Value {
    let choice = |names: &[&str]| json!(names[m.first.unsigned_abs() as usize % names.len()]);
    match leaf {
        Value::Bool(flag) => json!(!flag),
        Value::Number(number) if m.kind < 6 => {
            json!((number.as_i64().unwrap() + i64::from(m.first % 4)).max(0))
        }
        Value::Number(_) => json!(m.first.unsigned_abs() * 20),
        Value::String(_) if pointer.ends_with("/rows") => choice(&["seeded", "differenced"]),
        Value::String(_) if pointer == "/operators" => choice(&["exact", "rounded"]),
        Value::String(_) if pointer == "/sort/kind" => {
            choice(&["radix", "tile", "hierarchical", "none"])
        }
        Value::String(_) if pointer == "/bin/test" => choice(&["box", "oriented-box", "ellipse"]),
        Value::String(_) if pointer == "/bin/masks" => choice(&["bin", "list"]),
        Value::String(_) if pointer.ends_with("/leaders") => choice(&["corners", "diagonal"]),
        Value::String(_) if pointer.ends_with("/merge") => {
            choice(&["nearest-pair", "farthest-pair", "replace", "window"])
        }
        Value::String(_) if pointer.ends_with("/group") => choice(&["first", "interval", "window"]),
        Value::String(_) if pointer.ends_with("/fragment_depth") => choice(&["first", "nearest"]),
        Value::String(_) if pointer.ends_with("/interpolation") => choice(&["nearest", "linear"]),
        Value::String(_) if pointer.ends_with("/sight") => choice(&["axis", "ray"]),
        Value::String(text) => word(text.parse().unwrap(), None, m),
        Value::Object(long) => word(
            long["format"].as_str().unwrap().parse().unwrap(),
            Some(leaf),
            m,
        ),
        other => panic!("{pointer} is {other}"),
    }
}

/// Another format, or another rounding or overflow.
fn word(format: Format, long: Option<&Value>, m: &Mutation) -> Value {
    let format = match m.kind {
        0 => wide(format.signed, m),
        1 => anything(m),
        2 => valid(
            format.signed,
            format.int_bits + m.first % 16,
            format.frac_bits - m.first % 16,
        ),
        3..=5 => valid(
            format.signed,
            format.int_bits + m.first % 4,
            format.frac_bits + m.second % 8,
        ),
        6 => floating(format, m),
        _ => {
            let round =
                ["truncate", "nearest", "nearest-even"][m.first.unsigned_abs() as usize % 3];
            let overflow = if format.is_float() {
                "saturate"
            } else {
                ["saturate", "saturate", "saturate", "wrap"][m.second.unsigned_abs() as usize % 4]
            };
            return json!({ "format": format.to_string(), "round": round, "overflow": overflow });
        }
    };
    let text = format.to_string();
    match long {
        Some(Value::Object(fields)) => {
            let mut fields = fields.clone();
            fields.insert("format".into(), json!(text));
            if format.is_float() {
                fields.insert("overflow".into(), json!("saturate"));
            }
            Value::Object(fields)
        }
        _ => json!(text),
    }
}

/// A word as wide as a port can be, with the binary point anywhere.
fn wide(signed: bool, m: &Mutation) -> Format {
    let frac_bits = m.second.rem_euclid(MAX_FRACTION_BITS + 1);
    Format::fixed_point(signed, 29 + m.first.rem_euclid(4) - frac_bits, frac_bits)
}

fn anything(m: &Mutation) -> Format {
    let width = m.first.rem_euclid(MAX_WIDTH_BITS) + 1;
    let frac_bits = m.second.rem_euclid(MAX_FRACTION_BITS + 1);
    Format::fixed_point(m.first % 2 == 0, width - frac_bits, frac_bits)
}

/// The same word with fewer significant bits; unchanged where it is too narrow.
fn floating(format: Format, m: &Mutation) -> Format {
    let most = (format.magnitude_bits() - 1).min(MAX_SIGNIFICANT_BITS);
    let span = most - LEAST_SIGNIFICANT_BITS + 1;
    if span <= 0 {
        return format;
    }
    let significant_bits = LEAST_SIGNIFICANT_BITS + m.second.rem_euclid(span);
    Format {
        significant_bits,
        flushes: m.first % 2 == 0 && significant_bits <= format.frac_bits + 1,
        ..format
    }
}

/// The nearest format that can be modelled.
fn valid(signed: bool, int_bits: i32, frac_bits: i32) -> Format {
    let frac_bits = frac_bits.clamp(0, MAX_FRACTION_BITS);
    Format::fixed_point(
        signed,
        int_bits.clamp(1 - frac_bits, MAX_WIDTH_BITS - frac_bits),
        frac_bits,
    )
}

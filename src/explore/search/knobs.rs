//! Knobs: the parts of a machine that a search can reduce step by step: bits of words, and sizes of
//! tables and function units.

use crate::hardware::machines;
use rtl_model::Machine;
use rtl_model::num::Format;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

/// Fields of tables and function units that count bits or steps, and their least values.
const SIZES: [(&str, i64); 4] = [
    ("bits", 4),
    ("newton_steps", 0),
    ("table_bits", 2),
    ("index_bits", 2),
];
/// Least bits of a word.
const LEAST_WIDTH: i32 = 1;

/// A part that can be reduced.
#[derive(Clone, Debug, PartialEq)]
pub struct Knob {
    /// Path in the machine.
    pub path: String,
    /// Kind of the part.
    pub part: KnobPart,
    /// Steps that can be taken.
    pub most: u32,
}

/// Kind of a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum KnobPart {
    /// A bit after the binary point.
    FractionBit,
    /// A bit before the binary point.
    IntegerBit,
    /// A bit or a step of a table or a function unit.
    Size,
}

/// Fraction bits and sizes of a machine, or those whose path begins with one of `only`.
pub fn all(machine: &Machine, only: &[String]) -> Vec<Knob> {
    let mut knobs = of_words(machine, KnobPart::FractionBit);
    sizes(&machines::value(machine), "", &mut knobs);
    knobs.retain(|knob| is_selected(&knob.path, only));
    knobs
}

/// Integer bits of a machine, or those whose path begins with one of `only`.
pub fn integers(machine: &Machine, only: &[String]) -> Vec<Knob> {
    let mut knobs = of_words(machine, KnobPart::IntegerBit);
    knobs.retain(|knob| is_selected(&knob.path, only));
    knobs
}

/// Whether a path begins with one of `only`, or `only` is empty.
pub fn is_selected(path: &str, only: &[String]) -> bool {
    only.is_empty() || only.iter().any(|name| machines::is_below(path, name))
}

fn of_words(machine: &Machine, part: KnobPart) -> Vec<Knob> {
    let knob = |(path, format): (String, Format)| Knob {
        path,
        part,
        most: (format.width() - LEAST_WIDTH).max(0) as u32,
    };
    machines::words(machine).into_iter().map(knob).collect()
}

fn sizes(value: &Value, path: &str, knobs: &mut Vec<Knob>) {
    let Value::Object(fields) = value else { return };
    // Timing does not change accuracy.
    for (name, field) in fields.iter().filter(|(name, _)| *name != "timing") {
        let below = format!("{path}{name}");
        match (SIZES.iter().find(|(size, _)| size == name), field.as_i64()) {
            (Some((_, least)), Some(top)) => knobs.push(Knob {
                path: below,
                part: KnobPart::Size,
                most: (top - least).max(0) as u32,
            }),
            _ => sizes(field, &format!("{below}."), knobs),
        }
    }
}

impl Knob {
    /// The field's value. For a word: its format, which may be in a field of its own.
    pub fn value(&self, fields: &Value) -> Value {
        let field = fields
            .pointer(&machines::pointer(&self.path))
            .unwrap_or(&Value::Null);
        field.get("format").unwrap_or(field).clone()
    }

    /// Takes `steps` steps from the field, which the machine must have.
    pub fn take(&self, fields: &mut Value, steps: u32) {
        let Some(field) = fields.pointer_mut(&machines::pointer(&self.path)) else {
            return;
        };
        let field = if field.is_object() {
            &mut field["format"]
        } else {
            field
        };
        let bits = steps as i32;
        let less = match (
            self.part,
            field.as_str().and_then(|text| text.parse::<Format>().ok()),
        ) {
            (KnobPart::FractionBit, Some(format)) => Format {
                frac_bits: format.frac_bits - bits,
                ..format
            }
            .to_string()
            .into(),
            (KnobPart::IntegerBit, Some(format)) => Format {
                int_bits: format.int_bits - bits,
                ..format
            }
            .to_string()
            .into(),
            _ => Value::from(field.as_i64().unwrap_or(0) - i64::from(steps)),
        };
        *field = less;
    }
}

//! Knobs: what a search may take away from a machine, a step at a time: fraction bits of words, and the sizes of tables and function units.

use crate::hardware::machines;
use rtl_model::Machine;
use rtl_model::num::Format;
use serde_json::Value;

/// Fields of tables and function units that are numbers of bits or of steps, and the least that each may be.
const SIZES: [(&str, i64); 4] = [("bits", 4), ("newton_steps", 0), ("table_bits", 2), ("index_bits", 2)];
/// Bits that a word keeps at least.
const LEAST_WIDTH: i32 = 2;

/// One of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Knob {
    /// Where it is in the machine.
    pub path: String,
    top: Top,
    /// Steps that can be taken away.
    pub most: u32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Top {
    Word(Format),
    Size(i64),
}

/// All of a machine, or those whose path begins with one of `only`.
pub fn all(machine: &Machine, only: &[String]) -> Vec<Knob> {
    let word = |(path, format): (String, Format)| Knob { path, top: Top::Word(format), most: (format.width() - LEAST_WIDTH).max(0) as u32 };
    let mut knobs: Vec<Knob> = machines::words(machine).into_iter().map(word).collect();
    sizes(&machines::value(machine), "", &mut knobs);
    knobs.retain(|knob| only.is_empty() || only.iter().any(|name| machines::is_below(&knob.path, name)));
    knobs
}

fn sizes(value: &Value, path: &str, knobs: &mut Vec<Knob>) {
    let Value::Object(fields) = value else { return };
    // Timing has no accuracy.
    for (name, field) in fields.iter().filter(|(name, _)| *name != "timing") {
        let below = format!("{path}{name}");
        match (SIZES.iter().find(|(size, _)| size == name), field.as_i64()) {
            (Some((_, least)), Some(top)) => knobs.push(Knob { path: below, top: Top::Size(top), most: (top - least).max(0) as u32 }),
            _ => sizes(field, &format!("{below}."), knobs),
        }
    }
}

impl Knob {
    /// Value of the field with so many steps taken away.
    pub fn value(&self, steps: u32) -> Value {
        match self.top {
            Top::Word(format) => Value::from(Format { frac_bits: format.frac_bits - steps as i32, ..format }.to_string()),
            Top::Size(top) => Value::from(top - i64::from(steps)),
        }
    }
}

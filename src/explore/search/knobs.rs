//! Knobs: the parts of a machine that a search can reduce step by step: bits of words, and sizes of
//! tables and function units.

use crate::hardware::machines;
use crate::scene::Scene;
use rtl_model::Machine;
use rtl_model::num::Format;
use rtl_model::num::float::LEAST_SIGNIFICANT_BITS;
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

/// Whether a scene uses a part of a machine.
type Use = fn(&Scene) -> bool;

/// Parts of a machine that a search may reduce.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// Beginnings of paths; all if empty.
    pub only: Vec<String>,
    /// Beginnings of paths that no searched scene uses. No picture would show that they are too narrow.
    pub unused: Vec<&'static str>,
}

impl Selection {
    /// Parts below `only` that scenes use.
    pub fn new<'s>(only: &[String], scenes: impl Iterator<Item = &'s Scene> + Clone) -> Self {
        let is_used = |uses: Use| scenes.clone().any(uses);
        let uses: [(&str, Use); 5] = [
            ("colour", |scene| {
                let ellipsoids = scene.ellipsoids.as_ref();
                ellipsoids.is_some_and(|ellipsoids| ellipsoids.harmonics.is_some())
            }),
            ("ellipse.ellipsoid", |scene| scene.ellipsoids.is_some()),
            ("fragment.sheets", |scene| scene.sheets.is_some()),
            ("reflect", |scene| scene.environment.is_some()),
            ("sort", |scene| {
                let ellipsoids = scene.ellipsoids.as_ref();
                ellipsoids.is_some_and(|ellipsoids| ellipsoids.sorted)
            }),
        ];
        let unused = uses.into_iter().filter(|(_, uses)| !is_used(*uses));
        Selection {
            only: only.to_vec(),
            unused: unused.map(|(path, _)| path).collect(),
        }
    }

    /// Whether a part may be reduced.
    pub fn has(&self, path: &str) -> bool {
        is_selected(path, &self.only) && self.unused_of(path).is_none()
    }

    fn unused_of(&self, path: &str) -> Option<&'static str> {
        let mut unused = self.unused.iter().copied();
        unused.find(|unused| machines::is_below(path, unused))
    }

    /// Unused parts that the machine has and that would be reduced otherwise.
    pub fn left_out(&self, machine: &Machine) -> Vec<String> {
        let everything = Selection {
            unused: Vec::new(),
            ..self.clone()
        };
        let knobs = all(machine, &everything);
        let is_had = |unused: &&&str| {
            knobs
                .iter()
                .any(|knob| machines::is_below(&knob.path, unused))
        };
        let had = self.unused.iter().filter(is_had);
        had.map(|unused| (*unused).to_owned()).collect()
    }
}

/// Fraction bits and sizes of a machine that may be reduced.
pub fn all(machine: &Machine, selection: &Selection) -> Vec<Knob> {
    let mut knobs = of_words(machine, KnobPart::FractionBit);
    sizes(&machines::value(machine), "", &mut knobs);
    knobs.retain(|knob| selection.has(&knob.path));
    knobs
}

/// Integer bits of a machine that may be reduced.
pub fn integers(machine: &Machine, selection: &Selection) -> Vec<Knob> {
    let mut knobs = of_words(machine, KnobPart::IntegerBit);
    knobs.retain(|knob| selection.has(&knob.path));
    knobs
}

/// Whether a path begins with one of `only`, or `only` is empty.
fn is_selected(path: &str, only: &[String]) -> bool {
    only.is_empty() || only.iter().any(|name| machines::is_below(path, name))
}

fn of_words(machine: &Machine, part: KnobPart) -> Vec<Knob> {
    let knob = |(path, format): (String, Format)| {
        let most = match part {
            _ if !format.is_float() => format.width() - LEAST_WIDTH,
            KnobPart::FractionBit => format.significant_bits - LEAST_SIGNIFICANT_BITS,
            _ => format.int_bits - format.least_int_bits(),
        };
        Knob {
            path,
            part,
            most: most.max(0) as u32,
        }
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
            (KnobPart::FractionBit, Some(format)) => format.finer(-bits).to_string().into(),
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

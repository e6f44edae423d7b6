//! Words: all intermediate words of a unit for one record, signal by signal, in the order in which
//! they are rounded.
//!
//! ```text
//! record ─►( unit )─► every quantisation: signal, word, loss
//! ```
//! Laws: `the_words_of_a_record_are_those_that_the_machine_rounds`,
//! `a_difference_comes_with_the_words_of_its_record` (tests/live.rs, tests/diff.rs).

use crate::cosim::live::{Constants, Record, Refused, Shade, Unit};
use crate::cosim::trace::flag;
use crate::error::{Error, Result};
use crate::hardware::machines;
use crate::scene::{Overrides, Scene};
use rtl_model::num::{Fit, Format};
use rtl_model::probe::Observer;
use rtl_model::records::unit;
use serde_json::{Value, json};
use std::any::Any;
use std::fmt;
use std::path::Path;

/// An intermediate word of a unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Word {
    /// Such as `raster.offset`.
    pub signal: String,
    /// The word.
    pub word: i64,
    /// Its format.
    pub format: Format,
    /// Losses: `inexact`, `saturated_low` and so on.
    pub events: Vec<&'static str>,
}

impl Word {
    /// Its bits in hexadecimal.
    pub fn hex(&self) -> String {
        hex(self.format, self.word)
    }

    /// Its value.
    pub fn value(&self) -> Value {
        value(self.format, self.word)
    }

    /// The word as JSON.
    pub fn json(&self) -> Value {
        json!({"signal": self.signal, "hex": self.hex(), "word": self.word, "value": self.value(), "events": self.events})
    }
}

/// Stored bits of a word in hexadecimal.
pub fn hex(format: Format, word: i64) -> String {
    let digits = (format.stored_bits() as u32).div_ceil(4) as usize;
    format!("{:0digits$x}", format.stored(word))
}

/// Value of a word: an integer if it has no fraction bits.
pub fn value(format: Format, word: i64) -> Value {
    if format.frac_bits == 0 {
        word.into()
    } else {
        format.value(word).into()
    }
}

impl fmt::Display for Word {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {} = {}", self.signal, self.hex(), self.value())?;
        if self.events.is_empty() {
            Ok(())
        } else {
            write!(f, " ({})", self.events.join(", "))
        }
    }
}

/// Logs every quantisation.
#[derive(Clone, Debug, Default)]
struct WordLog(Vec<(usize, i64, Format, u8)>);

impl Observer<'static> for WordLog {
    fn fork(&self) -> Box<dyn Observer<'static>> {
        Box::new(WordLog::default())
    }

    fn hand_over(self: Box<Self>) -> Box<dyn Any + Send> {
        self
    }

    fn take_over(&mut self, seen: Box<dyn Any + Send>) {
        if let Ok(fork) = seen.downcast::<WordLog>() {
            self.0.extend(fork.0);
        }
    }

    fn word(&mut self, fit: &Fit, exact: i64, more: i64, word: i64) {
        self.0.push((
            fit.signal,
            word,
            fit.word.format,
            flag::of(fit, exact, more),
        ));
    }
}

impl WordLog {
    fn words(self, constants: &Constants) -> Vec<Word> {
        let word = |(signal, word, format, flags): (usize, i64, Format, u8)| Word {
            signal: constants.signal(signal),
            word,
            format,
            events: flag::names(flags),
        };
        self.0.into_iter().map(word).collect()
    }
}

/// Passes a record to a unit; returns the output records and every intermediate word.
///
/// # Errors
/// As [`Unit::step`].
pub fn step(
    unit: &mut Unit,
    words: &[i64],
    shade: &mut Shade,
) -> std::result::Result<(Vec<Record>, Vec<Word>), Refused> {
    let mut noted = WordLog::default();
    let out = unit.step_observed(words, shade, &mut noted)?;
    if unit.name == unit::RASTER {
        // The box is seeded once per tile that it overlaps, with the same words.
        let half = (1..noted.0.len()).find(|&size| {
            noted.0.len().is_multiple_of(size)
                && noted.0.chunks(size).all(|part| *part == noted.0[..size])
        });
        noted.0.truncate(half.unwrap_or(usize::MAX));
    }
    Ok((out, noted.words(unit.constants())))
}

/// Input records that make a unit produce a record again.
#[derive(Clone, Debug, Default)]
pub struct ReplayInputs {
    /// The unit's name.
    pub unit: String,
    /// Input records; the last one produces the record.
    pub inputs: Vec<Record>,
    /// Answers of shade; if empty, the model computes them.
    pub answers: Vec<Record>,
    /// The record that is produced.
    pub made: Record,
    /// The unit was empty before.
    pub begins_empty: bool,
}

impl ReplayInputs {
    /// A record that is not made from others.
    pub fn nothing(unit: String) -> Self {
        ReplayInputs {
            unit,
            begins_empty: true,
            ..ReplayInputs::default()
        }
    }
}

/// All intermediate words of a unit for a record of a trace.
///
/// # Errors
/// Why they cannot be computed, in a sentence.
pub fn of_record(
    folder: &Path,
    manifest: &Value,
    replayed: ReplayInputs,
) -> std::result::Result<Vec<Word>, String> {
    let Some((last, before)) = replayed.inputs.split_last() else {
        return Ok(Vec::new());
    };
    if !replayed.begins_empty {
        return Err("they depend on what the pixel held before the trace's window".into());
    }
    let constants = constants(folder, manifest).map_err(|error| error.to_string())?;
    let mut unit = Unit::new(&constants, &replayed.unit).map_err(|error| error.to_string())?;
    let mut answers = replayed.answers.into_iter();
    let mut shade = |request: &[i64]| {
        let answer = answers.next().and_then(|words| words.try_into().ok());
        answer.unwrap_or_else(|| constants.light(request))
    };
    for words in before {
        unit.step(words, &mut shade)
            .map_err(|refused| refused.to_string())?;
    }
    let (mut out, mut words) =
        step(&mut unit, last, &mut shade).map_err(|refused| refused.to_string())?;
    if unit.name == unit::SORT {
        let mut noted = WordLog::default();
        out = unit
            .end_observed(&mut shade, &mut noted)
            .map_err(|refused| refused.to_string())?
            .out;
        words = noted.words(&constants);
    }
    // A scene or a machine that has changed produces other records.
    if out.contains(&replayed.made) {
        Ok(words)
    } else {
        Err("machine.json and the scene no longer make this record".into())
    }
}

/// The machine and the constants of a trace.
fn constants(folder: &Path, manifest: &Value) -> Result<Constants> {
    let scene = &manifest["scene"];
    let side = |name: &str| {
        scene[name]
            .as_u64()
            .and_then(|side| usize::try_from(side).ok())
    };
    let overrides = Overrides {
        size: side("width").zip(side("height")),
    };
    let own = folder.join("scene.json");
    let frame = scene["frame"]
        .as_u64()
        .and_then(|frame| usize::try_from(frame).ok())
        .unwrap_or(0);
    let scene = match (
        scene["complete"].as_bool(),
        scene["source"].as_str().or(scene["name"].as_str()),
    ) {
        (Some(true), _) => Scene::load(&own, &overrides)?,
        (_, Some(source)) => Scene::load_frame(source, &overrides, frame)?,
        _ => return Err(Error::input("the manifest does not name a scene")),
    };
    let machine = machines::load(folder.join("machine.json"), &[])?;
    Constants::new(&scene, &machine)
}

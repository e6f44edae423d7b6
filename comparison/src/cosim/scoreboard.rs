//! Scoreboard: compares a device's streams with a live unit. Output records of the unit are queued
//! until the device gives them too.
//!
//! ```text
//! record ─►( unit )─► pending records, port by port ─►( = )◄─ a device's record
//! ```
//! In a stream whose order matters only per pixel, records are found by their pixel.
//!
//! Laws: `a_scoreboard_takes_what_a_trace_has_and_names_what_it_has_not` (tests/live.rs).

use crate::cosim::live::{Constants, End, Port, Record, Refused, Unit};
use crate::error::Result;
use std::collections::VecDeque;
use std::fmt::Write;
use std::sync::Arc;

/// Port of a unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PortSide {
    /// Input records.
    In,
    /// Output records.
    Out,
    /// Requests of `fragment` to shade.
    Request,
    /// Answers of shade.
    Answer,
    /// Fragments held at the end of a frame.
    Held,
}

impl PortSide {
    /// All of them, in the order of their numbers in C.
    pub const ALL: [PortSide; 5] = [
        PortSide::In,
        PortSide::Out,
        PortSide::Request,
        PortSide::Answer,
        PortSide::Held,
    ];
}

/// An input record.
#[derive(Clone, Debug)]
struct InputRecord {
    number: u64,
    words: Record,
}

/// An output record, and the input record that it was made from; None for records at the end of a
/// frame.
#[derive(Clone, Debug)]
struct PendingRecord {
    words: Record,
    from: Option<Arc<InputRecord>>,
}

/// A unit with the output records that were not yet compared or read.
pub struct Scoreboard<'a> {
    of: &'a Constants,
    unit: Unit<'a>,
    /// Pending records, by number of the port.
    waiting: [VecDeque<PendingRecord>; 5],
    /// The last input record, and the number of input records.
    last: Option<Arc<InputRecord>>,
    given: u64,
    /// Number of compared records.
    compared: [u64; 5],
    made_up: VecDeque<Record>,
    seed: u64,
}

/// Random cases per batch of made-up records, after the corner cases.
const CASES: u32 = 2000;

impl<'a> Scoreboard<'a> {
    /// For a unit of this name. The seed selects the made-up records.
    ///
    /// # Errors
    /// As [`Unit::new`].
    pub fn new(of: &'a Constants, name: &str, seed: u64) -> Result<Self> {
        let unit = Unit::new(of, name)?;
        Ok(Scoreboard {
            of,
            unit,
            waiting: Default::default(),
            last: None,
            given: 0,
            compared: [0; 5],
            made_up: VecDeque::new(),
            seed,
        })
    }

    /// The unit's name.
    pub fn name(&self) -> &'static str {
        self.unit.name
    }

    /// A port, if the unit has it.
    pub fn port(&self, side: PortSide) -> Option<&Port> {
        let shade = self.unit.shade.as_ref();
        match side {
            PortSide::In => Some(&self.unit.input),
            PortSide::Out => Some(&self.unit.output),
            PortSide::Request => shade.map(|[request, _]| request),
            PortSide::Answer => shade.map(|[_, answer]| answer),
            PortSide::Held => self.unit.held.as_ref(),
        }
    }

    /// Takes an input record and queues the output records.
    ///
    /// # Errors
    /// As [`Unit::step`].
    pub fn step(&mut self, words: &[i64]) -> std::result::Result<(), Refused> {
        let [_, out, requests, answers, _] = &mut self.waiting;
        let from = Some(Arc::new(InputRecord {
            number: self.given,
            words: words.to_vec(),
        }));
        let given = self.unit.step(words, &mut |request| {
            logged(self.of, request, from.as_ref(), requests, answers)
        })?;
        out.extend(given.into_iter().map(|words| PendingRecord {
            words,
            from: from.clone(),
        }));
        self.given += 1;
        self.last = from;
        Ok(())
    }

    /// Ends a frame and queues the records at its end.
    ///
    /// # Errors
    /// As [`Unit::end`].
    pub fn end(&mut self) -> std::result::Result<(), Refused> {
        let [_, out, requests, answers, held] = &mut self.waiting;
        let end = self
            .unit
            .end(&mut |request| logged(self.of, request, None, requests, answers))?;
        let End {
            out: more,
            held: holds,
        } = end;
        let of_none = |words: Record| PendingRecord { words, from: None };
        out.extend(more.into_iter().map(of_none));
        held.extend(holds.into_iter().map(of_none));
        Ok(())
    }

    /// Number of pending records at a port.
    pub fn waiting(&self, side: PortSide) -> usize {
        self.waiting[side as usize].len()
    }

    /// Removes and returns the oldest pending record.
    pub fn next(&mut self, side: PortSide) -> Option<Record> {
        self.waiting[side as usize]
            .pop_front()
            .map(|waiting| waiting.words)
    }

    /// Compares a device's record with the oldest pending one (of its pixel, if order matters only
    /// per pixel), and removes that.
    ///
    /// # Errors
    /// The difference, in a sentence.
    pub fn compare(&mut self, side: PortSide, given: &[i64]) -> std::result::Result<(), String> {
        let number = self.compared[side as usize];
        self.compared[side as usize] += 1;
        let Some(port) = self.port(side) else {
            return Err(format!("{} has no such port", self.unit.name));
        };
        let (name, fields, is_per_pixel) = (port.stream.name, port.fields(), port.is_per_pixel());
        if given.len() != fields {
            return Err(format!(
                "{name}: record {number} has {} words, and such a record has {fields}",
                given.len()
            ));
        }
        let mut masked = given.to_vec();
        port.mask(&mut masked);
        let waiting = &mut self.waiting[side as usize];
        let at = waiting
            .iter()
            .position(|expected| !is_per_pixel || expected.words[..2] == given[..2]);
        let Some(expected) = at.and_then(|at| waiting.remove(at)) else {
            let whose = if is_per_pixel {
                format!(" at pixel ({}, {})", given[0], given[1])
            } else {
                String::new()
            };
            let last = self.last.as_ref().map_or(String::new(), |last| {
                format!("; the last record that it took is {}", self.described(last))
            });
            return Err(format!(
                "{name}: record {number} is one too many: the model gave no more{whose}{last}"
            ));
        };
        let PendingRecord {
            words: expected,
            from,
        } = expected;
        let Some(field) = (0..fields).find(|field| masked[*field] != expected[*field]) else {
            return Ok(());
        };
        let names = self
            .port(side)
            .map(|port| port.stream.fields[field].name.clone())
            .unwrap_or_default();
        let mut sentence = format!(
            "{name}: record {number}: field {names} is {}, and the model's is {}",
            masked[field], expected[field]
        );
        if is_per_pixel {
            let _ = write!(sentence, ", at pixel ({}, {})", given[0], given[1]);
        }
        if let Some(from) = &from {
            let _ = write!(sentence, "; made from {}", self.described(from));
        }
        Err(sentence)
    }

    /// An input record and its words, as text.
    fn described(&self, given: &InputRecord) -> String {
        let stream = &self.unit.input.stream;
        let words: Vec<String> = stream
            .fields
            .iter()
            .zip(&given.words)
            .map(|(field, word)| format!("{} {word}", field.name))
            .collect();
        format!(
            "record {} of {}: {}",
            given.number,
            stream.name,
            words.join(", ")
        )
    }

    /// The next made-up input record: corners and thresholds, then random ones, without end.
    pub fn made_up(&mut self) -> Record {
        if self.made_up.is_empty() {
            self.made_up
                .extend(self.of.made_up(self.unit.name, CASES, self.seed));
            // A seed far from its neighbours, so that their records differ.
            self.seed = self
                .seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
        }
        self.made_up.pop_front().unwrap_or_default()
    }
}

fn logged(
    of: &Constants,
    request: &[i64],
    from: Option<&Arc<InputRecord>>,
    requests: &mut VecDeque<PendingRecord>,
    answers: &mut VecDeque<PendingRecord>,
) -> [i64; 4] {
    let answer = of.light(request);
    requests.push_back(PendingRecord {
        words: request.to_vec(),
        from: from.cloned(),
    });
    answers.push_back(PendingRecord {
        words: answer.to_vec(),
        from: from.cloned(),
    });
    answer
}

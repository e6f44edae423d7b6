//! Scoreboard: holds a device's streams against a live unit: what the unit gave waits until the
//! device gives it too.
//!
//! ```text
//! record ─►( unit )─► waiting records, port by port ─►( = )◄─ a device's record
//! ```
//! Records of a stream whose order counts at each pixel only are looked for by their pixel.
//!
//! Laws: `a_scoreboard_takes_what_a_trace_has_and_names_what_it_has_not` (tests/live.rs).

use crate::cosim::live::{Constants, End, Port, Record, Refused, Unit};
use crate::error::Result;
use std::collections::VecDeque;
use std::fmt::Write;
use std::sync::Arc;

/// Port of a unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// What it takes.
    In,
    /// What it gives for that.
    Out,
    /// What `fragment` asks shade.
    Request,
    /// What that says.
    Answer,
    /// What `fragment` holds in the end.
    Held,
}

impl Side {
    /// All of them, in the order of their numbers in C.
    pub const ALL: [Side; 5] = [Side::In, Side::Out, Side::Request, Side::Answer, Side::Held];
}

/// A record that a unit was given.
#[derive(Clone, Debug)]
struct Given {
    number: u64,
    words: Record,
}

/// A record that a unit gave, and the one that it made it of; none of what it holds in the end.
#[derive(Clone, Debug)]
struct Waiting {
    words: Record,
    from: Option<Arc<Given>>,
}

/// A unit, and what it gave that nobody has taken.
pub struct Scoreboard<'a> {
    of: &'a Constants,
    unit: Unit<'a>,
    /// By the numbers of sides.
    waiting: [VecDeque<Waiting>; 5],
    /// What was given last, and how many records were.
    last: Option<Arc<Given>>,
    given: u64,
    /// Records that were compared.
    compared: [u64; 5],
    made_up: VecDeque<Record>,
    seed: u64,
}

/// Random cases that are made at a time, behind those on purpose.
const CASES: u32 = 2000;

impl<'a> Scoreboard<'a> {
    /// For a unit of this name; made-up records depend on the seed.
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
    pub fn port(&self, side: Side) -> Option<&Port> {
        let shade = self.unit.shade.as_ref();
        match side {
            Side::In => Some(&self.unit.input),
            Side::Out => Some(&self.unit.output),
            Side::Request => shade.map(|[request, _]| request),
            Side::Answer => shade.map(|[_, answer]| answer),
            Side::Held => self.unit.held.as_ref(),
        }
    }

    /// Takes a record. What it gives waits.
    ///
    /// # Errors
    /// As [`Unit::step`].
    pub fn step(&mut self, words: &[i64]) -> std::result::Result<(), Refused> {
        let [_, out, requests, answers, _] = &mut self.waiting;
        let from = Some(Arc::new(Given {
            number: self.given,
            words: words.to_vec(),
        }));
        let given = self.unit.step(words, &mut |request| {
            told(self.of, request, from.as_ref(), requests, answers)
        })?;
        out.extend(given.into_iter().map(|words| Waiting {
            words,
            from: from.clone(),
        }));
        self.given += 1;
        self.last = from;
        Ok(())
    }

    /// Ends a frame. What it gives in the end waits.
    ///
    /// # Errors
    /// As [`Unit::end`].
    pub fn end(&mut self) -> std::result::Result<(), Refused> {
        let [_, out, requests, answers, held] = &mut self.waiting;
        let end = self
            .unit
            .end(&mut |request| told(self.of, request, None, requests, answers))?;
        let End {
            out: more,
            held: holds,
        } = end;
        let of_none = |words: Record| Waiting { words, from: None };
        out.extend(more.into_iter().map(of_none));
        held.extend(holds.into_iter().map(of_none));
        Ok(())
    }

    /// Number of records that wait at a port.
    pub fn waiting(&self, side: Side) -> usize {
        self.waiting[side as usize].len()
    }

    /// Takes the record that has waited longest.
    pub fn next(&mut self, side: Side) -> Option<Record> {
        self.waiting[side as usize]
            .pop_front()
            .map(|waiting| waiting.words)
    }

    /// Compares a device's record with the one that has waited longest, where order counts at each
    /// pixel only with that of its pixel, and takes that away.
    ///
    /// # Errors
    /// What is different, in a sentence.
    pub fn compare(&mut self, side: Side, given: &[i64]) -> std::result::Result<(), String> {
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
        let Waiting {
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

    /// A record that the unit was given, with its words.
    fn described(&self, given: &Given) -> String {
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

    /// The next made-up record of the input: corners and thresholds, then random ones, for ever.
    pub fn made_up(&mut self) -> Record {
        if self.made_up.is_empty() {
            self.made_up
                .extend(self.of.made_up(self.unit.name, CASES, self.seed));
            // Far from the seeds beside this one: their records are others.
            self.seed = self
                .seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
        }
        self.made_up.pop_front().unwrap_or_default()
    }
}

fn told(
    of: &Constants,
    request: &[i64],
    from: Option<&Arc<Given>>,
    requests: &mut VecDeque<Waiting>,
    answers: &mut VecDeque<Waiting>,
) -> [i64; 4] {
    let answer = of.light(request);
    requests.push_back(Waiting {
        words: request.to_vec(),
        from: from.cloned(),
    });
    answers.push_back(Waiting {
        words: answer.to_vec(),
        from: from.cloned(),
    });
    answer
}

//! Cache: lines of the frame buffer, set-associative, written back, the line used longest ago going first.
//!
//! A line that was never written needs not be read: a bit for each says so, as a fast clear does.
//!
//! Laws: `a_frame_ticks_as_it_is_replayed`, `more_of_anything_is_never_slower_if_lines_come_and_go`.

use super::memory::{Client, Direction, LINES, Memory, Outstanding};
use crate::machine::timing::{Cache as Description, Elaborated};
use std::ops::Range;

/// Nothing is there.
const EMPTY: u32 = u32::MAX;

/// A place for a line.
#[derive(Clone, Copy, Debug)]
struct Place {
    line: u32,
    /// The look-up that used it last.
    used: u64,
    /// When its pixels are all written.
    written: u64,
    /// When its bytes are here.
    here: u64,
}

/// The cache, and which lines memory has.
#[derive(Clone, Debug)]
pub struct Cache {
    description: Description,
    line_bytes: u64,
    sets: u32,
    places: Box<[Place]>,
    in_memory: Box<[bool]>,
    touched: Box<[bool]>,
    clock: u64,
    outstanding: Outstanding,
    pub lookups: [u64; 2],
}

impl Cache {
    /// For a frame of so many lines.
    pub fn new(timing: &Elaborated, lines: usize) -> Self {
        let description = timing.timing.cache;
        let empty = Place { line: EMPTY, used: 0, written: 0, here: 0 };
        Cache {
            description,
            line_bytes: timing.line_bytes.into(),
            sets: description.lines / description.ways,
            places: vec![empty; description.lines as usize].into(),
            in_memory: vec![false; lines].into(),
            touched: vec![false; lines].into(),
            clock: 0,
            outstanding: Outstanding::new(description.misses),
            lookups: [0; 2],
        }
    }

    /// The places in which a line can be.
    #[inline(always)]
    fn set(&self, line: u32) -> Range<usize> {
        let ways = self.description.ways as usize;
        let first = (line & (self.sets - 1)) as usize * ways;
        first..first + ways
    }

    /// Looks a line up; says when it is here, and in which cycle the look-up was over: it waits where too many are on their way.
    pub fn look_up(&mut self, now: u64, line: u32, memory: &mut Memory) -> [u64; 2] {
        self.clock += 1;
        self.lookups[0] += 1;
        self.touched[line as usize] = true;
        let set = self.set(line);
        let set = &mut self.places[set];
        if let Some(place) = set.iter_mut().find(|place| place.line == line) {
            self.lookups[1] += 1;
            place.used = self.clock;
            return [place.here.max(now), now];
        }
        let Some(place) = set.iter_mut().min_by_key(|place| place.used) else { return [now; 2] };
        if place.line != EMPTY {
            let address = LINES + u64::from(place.line) * self.line_bytes;
            memory.write_later(place.written.max(now), Client::FrameWrite, address, self.line_bytes);
            self.in_memory[place.line as usize] = true;
        }
        let mut over = now;
        let here = if self.in_memory[line as usize] {
            over = now.max(self.outstanding.free());
            let here = memory.request(
                over.max(place.written),
                Client::FrameRead,
                Direction::Read,
                LINES + u64::from(line) * self.line_bytes,
                self.line_bytes,
            );
            self.outstanding.push(here);
            here
        } else {
            now
        };
        *place = Place { line, used: self.clock, written: 0, here };
        [here, over]
    }

    /// A pixel of a line, if it is still there, is written in this cycle.
    pub fn written(&mut self, line: u32, when: u64) {
        let set = self.set(line);
        if let Some(place) = self.places[set].iter_mut().find(|place| place.line == line) {
            place.written = place.written.max(when);
        }
    }

    /// Whether a line is here, whether anything was ever written to it.
    pub fn holds(&self, line: u32) -> [bool; 2] {
        [self.places[self.set(line)].iter().any(|place| place.line == line), self.touched[line as usize]]
    }
}

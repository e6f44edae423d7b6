//! Cache: lines of the frame buffer, set-associative, write-back, least recently used.
//!
//! A line that was never written is not read: one bit per line records this, as in a fast clear.
//!
//! Laws: `a_frame_ticks_as_it_is_replayed`,
//! `more_of_anything_is_never_slower_if_lines_come_and_go`.

use super::memory::{Direction, LINES, Memory, Outstanding, Requester};
use crate::elaboration::microarchitecture::Microarchitecture;
use crate::machine::timing::Cache as Description;

/// Tag of an empty place.
pub const EMPTY: u32 = u32::MAX;

/// The first place of the set of a line, and the index of the place that holds the line.
#[inline(always)]
pub fn find(lines: &[u32], [sets, ways]: [u32; 2], line: u32) -> (usize, Option<usize>) {
    let ways = ways as usize;
    let first = (line & (sets - 1)) as usize * ways;
    // All ways are compared, because a loop with an early exit would be mispredicted too often.
    let at = lines[first..first + ways]
        .iter()
        .zip(first..)
        .fold(
            None,
            |at, (other, place)| if *other == line { Some(place) } else { at },
        );
    (first, at)
}

/// State of a line in the cache.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    /// Index of the look-up that used it last.
    used: u64,
    /// Cycle in which all of its pixels are written.
    written: u64,
    /// Cycle in which its bytes have arrived.
    here: u64,
}

/// Result of a look-up.
#[derive(Clone, Copy, Debug)]
pub struct LookUp {
    /// Place of the line.
    pub place: usize,
    /// Cycle in which the line has arrived.
    pub here: u64,
    /// Cycle in which the look-up ended. It stalls if too many lines are in flight.
    pub over: u64,
}

/// The cache, and the lines that are in memory.
#[derive(Clone, Debug)]
pub struct Cache {
    description: Description,
    line_bytes: u64,
    sets: u32,
    /// Tag of each place, set by set, and the state of its line.
    lines: Box<[u32]>,
    places: Box<[Line]>,
    /// For each line in memory, the cycle in which its pixels were written.
    in_memory: Box<[Option<u64>]>,
    touched: Box<[bool]>,
    clock: u64,
    outstanding: Outstanding,
    pub lookups: [u64; 2],
}

impl Cache {
    /// For a frame of `lines` lines.
    pub fn new(timing: &Microarchitecture, lines: usize) -> Self {
        let description = timing.timing.cache;
        Cache {
            description,
            line_bytes: timing.line_bytes.into(),
            sets: description.lines / description.ways,
            lines: vec![EMPTY; description.lines as usize].into(),
            places: vec![Line::default(); description.lines as usize].into(),
            in_memory: vec![None; lines].into(),
            touched: vec![false; lines].into(),
            clock: 0,
            outstanding: Outstanding::new(description.misses),
            lookups: [0; 2],
        }
    }

    #[inline(always)]
    fn find(&self, line: u32) -> (usize, Option<usize>) {
        find(&self.lines, [self.sets, self.description.ways], line)
    }

    /// Looks up a line.
    #[inline(always)]
    pub fn look_up(&mut self, now: u64, line: u32, memory: &mut Memory) -> LookUp {
        self.clock += 1;
        self.lookups[0] += 1;
        self.touched[line as usize] = true;
        let (first, found) = self.find(line);
        let Some(place) = found else {
            return self.miss(now, line, first, memory);
        };
        self.lookups[1] += 1;
        let found = &mut self.places[place];
        found.used = self.clock;
        LookUp {
            place,
            here: found.here.max(now),
            over: now,
        }
    }

    /// Replaces the least recently used line of the set.
    #[inline(never)]
    fn miss(&mut self, now: u64, line: u32, first: usize, memory: &mut Memory) -> LookUp {
        let set = first..first + self.description.ways as usize;
        let place = set
            .min_by_key(|place| self.places[*place].used)
            .unwrap_or(first);
        let (before, Line { written, .. }) = (self.lines[place], self.places[place]);
        if before != EMPTY {
            let address = LINES + u64::from(before) * self.line_bytes;
            memory.post_write(
                written.max(now),
                Requester::FrameWrite,
                address,
                self.line_bytes,
            );
            self.in_memory[before as usize] = Some(written);
        }
        let (mut here, mut over) = (now, now);
        if let Some(left) = self.in_memory[line as usize] {
            over = now.max(self.outstanding.free());
            let address = LINES + u64::from(line) * self.line_bytes;
            here = memory.request(
                over.max(written).max(left),
                Requester::FrameRead,
                Direction::Read,
                address,
                self.line_bytes,
            );
            self.outstanding.push(here);
        }
        self.lines[place] = line;
        self.places[place] = Line {
            used: self.clock,
            written: 0,
            here,
        };
        LookUp { place, here, over }
    }

    /// Writes a pixel of a line in this cycle, if the line is still in its place.
    #[inline(always)]
    pub fn written(&mut self, line: u32, place: usize, when: u64) {
        if self.lines[place] == line {
            let written = &mut self.places[place].written;
            *written = when.max(*written);
        }
    }

    /// Whether a line is in the cache, and whether it was ever written.
    pub fn holds(&self, line: u32) -> [bool; 2] {
        [self.find(line).1.is_some(), self.touched[line as usize]]
    }
}

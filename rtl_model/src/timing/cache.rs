//! Cache: lines of the frame buffer, set-associative, written back, the line used longest ago going
//! first.
//!
//! A line that was never written needs not be read: a bit for each says so, as a fast clear does.
//!
//! Laws: `a_frame_ticks_as_it_is_replayed`,
//! `more_of_anything_is_never_slower_if_lines_come_and_go`.

use super::memory::{Client, Direction, LINES, Memory, Outstanding};
use crate::elaboration::microarchitecture::Microarchitecture;
use crate::machine::timing::Cache as Description;

/// Nothing is there.
pub const EMPTY: u32 = u32::MAX;

/// The first of the places in which a line can be, of so many sets of so many, and which of them
/// has it.
#[inline(always)]
pub fn find(lines: &[u32], [sets, ways]: [u32; 2], line: u32) -> (usize, Option<usize>) {
    let ways = ways as usize;
    let first = (line & (sets - 1)) as usize * ways;
    // All are looked at: a loop that ends where the line is would be guessed wrong too often.
    let at = lines[first..first + ways]
        .iter()
        .zip(first..)
        .fold(
            None,
            |at, (other, place)| if *other == line { Some(place) } else { at },
        );
    (first, at)
}

/// What is known of a line that is here.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    /// The look-up that used it last.
    used: u64,
    /// When its pixels are all written.
    written: u64,
    /// When its bytes are here.
    here: u64,
}

/// Result of a look-up.
#[derive(Clone, Copy, Debug)]
pub struct LookUp {
    /// Where the line lies.
    pub place: usize,
    /// When it is here.
    pub here: u64,
    /// In which cycle the look-up was over: it waits where too many lines are on their way.
    pub over: u64,
}

/// The cache, and which lines memory has.
#[derive(Clone, Debug)]
pub struct Cache {
    description: Description,
    line_bytes: u64,
    sets: u32,
    /// Which line each place has, set by set, and what is known of it.
    lines: Box<[u32]>,
    places: Box<[Line]>,
    /// When the pixels of each line that memory has were all written.
    in_memory: Box<[Option<u64>]>,
    touched: Box<[bool]>,
    clock: u64,
    outstanding: Outstanding,
    pub lookups: [u64; 2],
}

impl Cache {
    /// For a frame of so many lines.
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

    /// Looks a line up.
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

    /// A line takes the place of the one of its set that was used longest ago.
    #[inline(never)]
    fn miss(&mut self, now: u64, line: u32, first: usize, memory: &mut Memory) -> LookUp {
        let set = first..first + self.description.ways as usize;
        let place = set
            .min_by_key(|place| self.places[*place].used)
            .unwrap_or(first);
        let (before, Line { written, .. }) = (self.lines[place], self.places[place]);
        if before != EMPTY {
            let address = LINES + u64::from(before) * self.line_bytes;
            memory.write_later(
                written.max(now),
                Client::FrameWrite,
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
                Client::FrameRead,
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

    /// A pixel of a line, if that is still in its place, is written in this cycle.
    #[inline(always)]
    pub fn written(&mut self, line: u32, place: usize, when: u64) {
        if self.lines[place] == line {
            let written = &mut self.places[place].written;
            *written = when.max(*written);
        }
    }

    /// Whether a line is here, whether anything was ever written to it.
    pub fn holds(&self, line: u32) -> [bool; 2] {
        [self.find(line).1.is_some(), self.touched[line as usize]]
    }
}

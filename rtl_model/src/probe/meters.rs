//! Meters: what [`Ranges`] counts word by word, counted eight words at a time.
//!
//! ```text
//! words, inexact, live ─►[ of signal n ]─┬─► min, max, any    lane by lane
//!                                        ├─► bins             one counter for all lanes
//! sums of a fragment ──►[ its own ]──────┘    ─► one for each lane: there each is a signal of its own
//! ```
//! What saturated, wrapped or has no room in 32 bits goes the long way, one by one.
//!
//! Law: `meters_read_what_ranges_count`.

use super::ranges::{BINS, Range, Ranges, bin};
use super::{Probe, Seen};
use crate::machine::Elaborated;
use crate::num::{Fit, LANES, Words};

/// Extremes of eight lanes, and every bit that was set.
#[derive(Clone, Copy, Debug)]
struct Extremes {
    min: [i32; LANES],
    max: [i32; LANES],
    any: [i32; LANES],
}

impl Default for Extremes {
    fn default() -> Self {
        Extremes { min: [i32::MAX; LANES], max: [i32::MIN; LANES], any: [0; LANES] }
    }
}

impl Extremes {
    #[inline(always)]
    fn see<W: Words>(&mut self, words: W) {
        self.min = W::from_array(self.min).min(words).to_array();
        self.max = W::from_array(self.max).max(words).to_array();
        self.any = (W::from_array(self.any) | words).to_array();
    }

    fn absorb(&mut self, other: &Extremes) {
        for lane in 0..LANES {
            self.min[lane] = self.min[lane].min(other.min[lane]);
            self.max[lane] = self.max[lane].max(other.max[lane]);
            self.any[lane] |= other.any[lane];
        }
    }

    /// Tells a range what a lane saw.
    fn tell(&self, lane: usize, range: &mut Range) {
        // A lane that saw nothing has its least above its greatest.
        if self.min[lane] <= self.max[lane] {
            let [min, max] = [self.min[lane], self.max[lane]].map(i64::from);
            range.min = range.min.min(min);
            range.max = range.max.max(max);
            range.reach(min);
            range.reach(max);
            range.any |= i64::from(self.any[lane]);
        }
    }
}

/// One signal's.
#[derive(Clone, Debug)]
struct Meter {
    bins: [u64; BINS],
    extremes: Extremes,
    inexact: u64,
    /// Words that came alone: least, greatest, and every bit that was set.
    alone: [i64; 3],
    /// What went the long way.
    rest: Range,
}

impl Default for Meter {
    fn default() -> Self {
        Meter { bins: [0; BINS], extremes: Extremes::default(), inexact: 0, alone: [i64::MAX, i64::MIN, 0], rest: Range::default() }
    }
}

impl Meter {
    fn absorb(&mut self, other: &Meter) {
        add(&mut self.bins, &other.bins);
        self.extremes.absorb(&other.extremes);
        self.inexact += other.inexact;
        let ([min, max, any], other_alone) = (&mut self.alone, other.alone);
        (*min, *max, *any) = ((*min).min(other_alone[0]), (*max).max(other_alone[1]), *any | other_alone[2]);
        self.rest.absorb(&other.rest);
    }

    #[inline(always)]
    fn one(&mut self, word: i64, inexact: bool) {
        let [min, max, any] = &mut self.alone;
        // Both become rare.
        if word < *min {
            *min = word;
        }
        if word > *max {
            *max = word;
        }
        *any |= word;
        self.inexact += u64::from(inexact);
        self.bins[bin(word)] += 1;
    }

    fn range(&self) -> Range {
        let mut range = self.rest;
        range.words += self.bins.iter().sum::<u64>();
        range.inexact += self.inexact;
        add(&mut range.bins, &self.bins);
        for lane in 0..LANES {
            self.extremes.tell(lane, &mut range);
        }
        let [min, max, any] = self.alone;
        if min <= max {
            range.min = range.min.min(min);
            range.max = range.max.max(max);
            range.reach(min);
            range.reach(max);
            range.any |= any;
        }
        range
    }
}

/// The sums of a fragment: every lane is a signal of its own.
#[derive(Clone, Debug)]
struct Sums {
    bins: [[u64; BINS]; LANES],
    extremes: Extremes,
    /// How often which lanes were inexact, a lane a bit.
    inexact: [u64; 256],
}

impl Default for Sums {
    fn default() -> Self {
        Sums { bins: [[0; BINS]; LANES], extremes: Extremes::default(), inexact: [0; 256] }
    }
}

impl Sums {
    fn absorb(&mut self, other: &Sums) {
        add(self.bins.as_flattened_mut(), other.bins.as_flattened());
        self.extremes.absorb(&other.extremes);
        add(&mut self.inexact, &other.inexact);
    }

    fn tell(&self, lane: usize, range: &mut Range) {
        range.words += self.bins[lane].iter().sum::<u64>();
        let inexact = self.inexact.iter().enumerate().filter(|(lanes, _)| lanes & (1 << lane) != 0);
        range.inexact += inexact.map(|(_, count)| count).sum::<u64>();
        add(&mut range.bins, &self.bins[lane]);
        self.extremes.tell(lane, range);
    }
}

fn add(own: &mut [u64], other: &[u64]) {
    for (own, other) in own.iter_mut().zip(other) {
        *own += other;
    }
}

/// For each set of live lanes, which lane each of the eight is to take its word from: itself, or the first that is live.
const STAND_IN: [[i32; LANES]; 256] = {
    let mut all = [[0; LANES]; 256];
    let mut live = 1;
    while live < 256_usize {
        let mut lane = 0;
        while lane < LANES {
            all[live][lane] = if live & (1 << lane) != 0 { lane as i32 } else { live.trailing_zeros() as i32 };
            lane += 1;
        }
        live += 1;
    }
    all
};

/// Watches the range of every signal.
#[derive(Clone, Debug)]
pub struct Meters {
    meters: Vec<Meter>,
    sums: Box<Sums>,
    /// Signals of the lanes of `sums`.
    sum_signals: [usize; LANES],
}

impl Meters {
    /// For a machine.
    pub fn new(machine: &Elaborated) -> Self {
        Meters::of(machine.signals.len(), machine.fragment.sum_signals())
    }

    fn of(signals: usize, sum_signals: [usize; LANES]) -> Self {
        Meters { meters: vec![Meter::default(); signals], sums: Box::default(), sum_signals }
    }

    /// What they read.
    pub fn ranges(&self) -> Ranges {
        let mut ranges = Ranges(self.meters.iter().map(Meter::range).collect());
        for (lane, signal) in self.sum_signals.into_iter().enumerate() {
            self.sums.tell(lane, &mut ranges.0[signal]);
        }
        ranges
    }

    /// Of a copy, as in `num::fit`.
    #[cold]
    #[inline(never)]
    fn long_way(&mut self, fit: Fit, exact: i64, more: i64, word: i64) {
        self.meters[fit.signal].rest.see(&fit, exact, more, word);
    }
}

impl Probe for Meters {
    const WORDS: bool = true;
    const EIGHT: bool = true;
    const QUICK: bool = true;
    const DECISIONS: bool = false;

    fn fork(&self) -> Self {
        Meters::of(self.meters.len(), self.sum_signals)
    }

    fn absorb(&mut self, fork: Self) {
        for (own, other) in self.meters.iter_mut().zip(&fork.meters) {
            own.absorb(other);
        }
        self.sums.absorb(&fork.sums);
    }

    #[inline(always)]
    fn word(&mut self, fit: &Fit, exact: i64, more: i64, word: i64) {
        match fit.seen_one(exact, more, word) {
            Some(inexact) => self.meters[fit.signal].one(word, inexact),
            None => self.long_way(*fit, exact, more, word),
        }
    }

    #[inline(always)]
    fn one(&mut self, signal: usize, word: i64, inexact: bool) {
        self.meters[signal].one(word, inexact);
    }

    #[inline(always)]
    fn eight<W: Words>(&mut self, signal: usize, seen: Seen<W>, live: u8) {
        let meter = &mut self.meters[signal];
        let words = seen.words.pick(W::from_array(STAND_IN[usize::from(live)]));
        meter.extremes.see(words);
        meter.inexact += u64::from((seen.inexact & live).count_ones());
        words.tally(live, &mut meter.bins);
    }

    #[inline(always)]
    fn sums<W: Words>(&mut self, seen: Seen<W>) {
        self.sums.extremes.see(seen.words);
        self.sums.inexact[usize::from(seen.inexact)] += 1;
        seen.words.tally_each(&mut self.sums.bins);
    }

    fn wrapped(&mut self, signal: usize) {
        self.meters[signal].rest.wrapped += 1;
    }

    #[inline(always)]
    fn reached(&mut self, signal: usize, [low, high]: [i64; 2]) {
        let rest = &mut self.meters[signal].rest;
        rest.reach(low);
        rest.reach(high);
    }
}

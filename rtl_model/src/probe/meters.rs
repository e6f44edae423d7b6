//! Meters: what [`Ranges`] say, with all words measured eight at a time and a sample of them counted one by one.
//!
//! ```text
//! all words ─►[ least, greatest, every bit set ]──────────────┐
//!     └► some met a limit ──┬─►( the item of work again )─►[ Ranges ]─► saturated, wrapped
//! every n-th item of work ──┘                           └─►[ Ranges ]─► words, inexact, bins
//! ```
//! An item of work is eight splats in setup, a tile in what follows. Extremes and limits are those of all words; counts are those of a
//! sample that does not depend on threads: all items where they are few, one in [`MOST_APART`] where they are many.
//!
//! Laws: `meters_read_what_ranges_count`, `a_sample_is_spread_evenly`.

use super::ranges::{Range, Ranges};
use super::{Probe, Seen};
use crate::machine::Elaborated;
use crate::num::{Fit, LANES, Words};

/// Items in the sample, if there are as many and not too many more.
const FEW: usize = 12;
/// The sample is no thinner than one item in this many.
pub const MOST_APART: usize = 256;

/// Whether an item, of so many, belongs to the sample: every n-th, but by steps of the golden ratio, which no width of a picture divides.
fn is_sampled(item: usize, of: usize) -> bool {
    let apart = (of / FEW).clamp(1, MOST_APART) as u32;
    (item as u32).wrapping_mul(0x9E37_79B9) <= u32::MAX / apart
}

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
        Alone { min: self.min[lane].into(), max: self.max[lane].into(), any: self.any[lane].into() }.tell(range);
    }
}

/// The same of words that came alone.
#[derive(Clone, Copy, Debug)]
struct Alone {
    min: i64,
    max: i64,
    any: i64,
}

impl Default for Alone {
    fn default() -> Self {
        Alone { min: i64::MAX, max: i64::MIN, any: 0 }
    }
}

impl Alone {
    #[inline(always)]
    fn see(&mut self, word: i64) {
        // Both become rare.
        if word < self.min {
            self.min = word;
        }
        if word > self.max {
            self.max = word;
        }
        self.any |= word;
    }

    fn absorb(&mut self, other: &Alone) {
        *self = Alone { min: self.min.min(other.min), max: self.max.max(other.max), any: self.any | other.any };
    }

    /// What saw nothing has its least above its greatest.
    fn tell(&self, range: &mut Range) {
        if self.min <= self.max {
            range.min = range.min.min(self.min);
            range.max = range.max.max(self.max);
            range.reach(self.min);
            range.reach(self.max);
            range.any |= self.any;
        }
    }
}

/// The same of eight lanes of more than 32 bits.
#[derive(Clone, Debug)]
struct Wide {
    min: [i64; LANES],
    max: [i64; LANES],
    any: [i64; LANES],
}

impl Default for Wide {
    fn default() -> Self {
        Wide { min: [i64::MAX; LANES], max: [i64::MIN; LANES], any: [0; LANES] }
    }
}

impl Wide {
    #[inline(always)]
    fn see(&mut self, words: [i64; LANES]) {
        for (lane, word) in words.into_iter().enumerate() {
            self.min[lane] = self.min[lane].min(word);
            self.max[lane] = self.max[lane].max(word);
            self.any[lane] |= word;
        }
    }

    fn lanes(&self) -> impl Iterator<Item = Alone> {
        (0..LANES).map(|lane| Alone { min: self.min[lane], max: self.max[lane], any: self.any[lane] })
    }
}

/// One signal's.
#[derive(Clone, Debug, Default)]
struct Meter {
    together: Extremes,
    wide: Wide,
    alone: Alone,
    /// What registers were to hold on their way.
    way: Alone,
}

/// Watches the range of every signal.
#[derive(Clone, Debug)]
pub struct Meters {
    meters: Vec<Meter>,
    /// The sums of a fragment: every lane is a signal of its own.
    sums: Extremes,
    /// Signals of the lanes of `sums`.
    sum_signals: [usize; LANES],
    /// Whether a word of this item met a limit.
    is_limited: bool,
    /// Items of the sample, word by word, and other items where a word met a limit.
    heard: [Ranges; 2],
}

impl Meters {
    /// For a machine.
    pub fn new(machine: &Elaborated) -> Self {
        Meters::of(machine.signals.len(), machine.fragment.sum_signals())
    }

    fn of(signals: usize, sum_signals: [usize; LANES]) -> Self {
        Meters {
            meters: vec![Meter::default(); signals],
            sums: Extremes::default(),
            sum_signals,
            is_limited: false,
            heard: [Ranges::new(signals), Ranges::new(signals)],
        }
    }

    /// What they read.
    pub fn ranges(&self) -> Ranges {
        let [sample, limited] = &self.heard;
        let mut ranges = sample.clone();
        for ((range, limited), meter) in ranges.0.iter_mut().zip(&limited.0).zip(&self.meters) {
            range.absorb(&Range { words: 0, inexact: 0, bins: Range::default().bins, ..*limited });
            (0..LANES).for_each(|lane| meter.together.tell(lane, range));
            meter.wide.lanes().for_each(|lane| lane.tell(range));
            meter.alone.tell(range);
            if meter.way.min <= meter.way.max {
                range.reach(meter.way.min);
                range.reach(meter.way.max);
                range.any |= meter.way.any;
            }
        }
        for (lane, signal) in self.sum_signals.into_iter().enumerate() {
            self.sums.tell(lane, &mut ranges.0[signal]);
        }
        ranges
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
            own.together.absorb(&other.together);
            other.wide.lanes().for_each(|lane| own.alone.absorb(&lane));
            own.alone.absorb(&other.alone);
            own.way.absorb(&other.way);
        }
        self.sums.absorb(&fork.sums);
        for (own, other) in self.heard.iter_mut().zip(fork.heard) {
            own.absorb(other);
        }
    }

    #[inline(always)]
    fn word(&mut self, fit: &Fit, exact: i64, more: i64, word: i64) {
        if fit.is_within(exact, more, word) {
            self.meters[fit.signal].alone.see(word);
        } else {
            self.is_limited = true;
        }
    }

    #[inline(always)]
    fn one(&mut self, signal: usize, word: i64) {
        self.meters[signal].alone.see(word);
    }

    #[inline(always)]
    fn eight<W: Words>(&mut self, signal: usize, seen: Seen<W>, live: u8) {
        if live == 0 {
            return;
        }
        // What met a limit is heard again, and with it all that came with it.
        if seen.limited & live != 0 {
            self.is_limited = true;
            return;
        }
        self.meters[signal].together.see(seen.words.pick(W::from_array(STAND_IN[usize::from(live)])));
    }

    #[inline(always)]
    fn wide(&mut self, signal: usize, words: [i64; LANES], limited: u8, live: u8) {
        let meter = &mut self.meters[signal];
        if limited & live != 0 {
            self.is_limited = true;
        } else if live == u8::MAX {
            meter.wide.see(words);
        } else {
            (0..LANES).filter(|lane| live & (1 << lane) != 0).for_each(|lane| meter.alone.see(words[lane]));
        }
    }

    #[inline(always)]
    fn three(&mut self, signal: usize, [a, b, c]: [i64; 3]) {
        let alone = &mut self.meters[signal].alone;
        let (least, greatest) = (a.min(b).min(c), a.max(b).max(c));
        if least < alone.min {
            alone.min = least;
        }
        if greatest > alone.max {
            alone.max = greatest;
        }
        alone.any |= a | b | c;
    }

    #[inline(always)]
    fn sums<W: Words>(&mut self, seen: Seen<W>) {
        if seen.limited != 0 {
            self.is_limited = true;
            return;
        }
        self.sums.see(seen.words);
    }

    fn wrapped(&mut self, _signal: usize) {
        self.is_limited = true;
    }

    #[inline(always)]
    fn reached(&mut self, signal: usize, [low, high]: [i64; 2]) {
        let way = &mut self.meters[signal].way;
        way.see(low);
        way.see(high);
    }

    #[inline(always)]
    fn again(&mut self, item: usize, of: usize) -> Option<&mut Ranges> {
        let [sample, limited] = &mut self.heard;
        match (is_sampled(item, of), std::mem::take(&mut self.is_limited)) {
            (true, _) => Some(sample),
            (false, true) => Some(limited),
            (false, false) => None,
        }
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

#[cfg(test)]
mod tests;

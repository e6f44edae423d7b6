//! Texels: lines of the map of surroundings, which is in memory, and stalls for them.
//!
//! ```text
//! fragment ─►( shade is free )─►( four texels: their lines )─┬─ all hit ─► shade takes it
//!                                                             └─ else they are read, and shade stalls for the last one
//! ```
//! A hit costs only the cycle of its look-up. The part of shade's latency before the address is
//! counted after the look-up. This moves every look-up by the same number of cycles, and does not
//! change the distances between them.
//!
//! Law: `a_frame_with_reflections_ticks_as_it_is_replayed`.

use super::account::{Ready, Unit};
use super::cache::{EMPTY, find};
use super::memory::{Direction, MAP, Memory, Requester};
use crate::elaboration::microarchitecture::{MapShape, Microarchitecture};
use crate::machine::timing::Environment;
use crate::work::{NO_TEXEL, Work};

/// Cache of one shade unit.
#[derive(Clone, Debug)]
pub struct Texels {
    shape: MapShape,
    cache: Environment,
    /// Tag of each place, set by set, and the look-up that used it last.
    lines: Box<[u32]>,
    used: Box<[u64]>,
    clock: u64,
    /// Lines looked up, and the hits among them.
    pub lookups: [u64; 2],
}

impl Texels {
    /// None if nothing is reflected, or if the whole map is on the chip.
    pub fn new(timing: &Microarchitecture, work: &Work) -> Option<Self> {
        let shape = timing.map.filter(|_| work.mirrors)?;
        let cache = shape.cache?;
        let (lines, used) = (
            vec![EMPTY; cache.lines as usize].into(),
            vec![0; cache.lines as usize].into(),
        );
        Some(Texels {
            shape,
            cache,
            lines,
            used,
            clock: 0,
            lookups: [0; 2],
        })
    }

    /// Looks up the texel of a fragment that shade could take in this cycle; returns the arrival of
    /// its lines.
    fn look_up(&mut self, now: u64, texel: u16, memory: &mut Memory) -> u64 {
        if texel == NO_TEXEL {
            return now;
        }
        let [row, column] = texel.to_be_bytes().map(u32::from);
        let [across, down] = self.cache.line_texels;
        let columns = (1 << self.shape.index_bits) / across;
        let corners = [
            [row, column],
            [row, column + 1],
            [row + 1, column],
            [row + 1, column + 1],
        ];
        let mut looked_up = [EMPTY; 4];
        let mut here = now;
        for nth in 0..4 {
            let [row, column] = corners[nth];
            let line = row / down * columns + column / across;
            if !looked_up[..nth].contains(&line) {
                here = here.max(self.line(now, line, memory));
            }
            looked_up[nth] = line;
        }
        here
    }

    fn line(&mut self, now: u64, line: u32, memory: &mut Memory) -> u64 {
        self.clock += 1;
        self.lookups[0] += 1;
        let ways = self.cache.ways;
        let (first, found) = find(&self.lines, [self.cache.lines / ways, ways], line);
        if let Some(place) = found {
            self.used[place] = self.clock;
            self.lookups[1] += 1;
            return now;
        }
        let place = (first..first + ways as usize)
            .min_by_key(|place| self.used[*place])
            .unwrap_or(first);
        (self.lines[place], self.used[place]) = (line, self.clock);
        let bytes = u64::from(self.shape.line_bytes());
        memory.request(
            now,
            Requester::Environment,
            Direction::Read,
            MAP + u64::from(line) * bytes,
            bytes,
        )
    }

    /// Shade takes a fragment that arrived at `here`, when its texels have arrived; returns the
    /// cycle, and the cycles of the stall for texels.
    pub fn shade(
        &mut self,
        shade: &mut Unit,
        ready: Ready,
        interval: u64,
        texel: u16,
        memory: &mut Memory,
    ) -> [u64; 2] {
        let start = shade.free().max(ready.here);
        let here = self.look_up(start, texel, memory);
        let now = shade.take(
            Ready {
                memory: here,
                ..ready
            },
            interval,
        );
        [now, here - start]
    }
}

/// The cycle in which the whole map is loaded, if the chip holds it: nothing begins before.
pub fn load(timing: &Microarchitecture, work: &Work, memory: &mut Memory) -> u64 {
    let loaded = timing
        .map
        .filter(|shape| work.mirrors && shape.cache.is_none());
    loaded.map_or(0, |shape| {
        memory.request(
            0,
            Requester::Environment,
            Direction::Read,
            MAP,
            shape.bytes().into(),
        )
    })
}

/// Look-ups of several caches, and the hits among them.
pub fn lookups<const N: usize>(caches: [&Option<Texels>; N]) -> [u64; 2] {
    caches.into_iter().flatten().fold([0; 2], |all, cache| {
        [0, 1].map(|i| all[i] + cache.lookups[i])
    })
}

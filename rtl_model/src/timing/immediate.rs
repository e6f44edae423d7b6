//! Immediate: splats in input order, fragments in memory behind a cache.
//!
//! ```text
//! memory ─► fetch ─► project ─► ellipse ─► raster ─► gauss ─► cache ─► fragment      then: resolve ─► memory
//!           records                                           ▲ lines ▼                      ▲ lines
//! ```
//! When the last splat is through, resolve goes through the frame, line by line.

use super::account::{Ready, Unit};
use super::cache::Cache;
use super::memory::{Client, Direction, Memory, Outstanding};
use super::slots::{Readers, Slot, Slots};
use super::{Cycles, UnitCycles};
use crate::machine::timing::Elaborated;
use crate::work::{Fate, Work};

/// Fetch, project and ellipse: one splat each.
pub struct SetUp<'a> {
    timing: &'a Elaborated,
    pub fetch: Unit,
    pub project: Unit,
    pub ellipse: Unit,
    outstanding: Outstanding,
    /// Bursts fetched so far, and when the last of them was here.
    bursts: u64,
    burst_here: u64,
}

impl<'a> SetUp<'a> {
    pub fn new(timing: &'a Elaborated, behind: &'static str, logged: bool) -> Self {
        SetUp {
            timing,
            fetch: Unit::new("fetch", timing.fetch, None, Some("project"), logged),
            project: Unit::new("project", timing.project, Some("fetch"), Some("ellipse"), logged),
            ellipse: Unit::new("ellipse", timing.ellipse, Some("project"), Some(behind), logged),
            outstanding: Outstanding::new(timing.timing.memory.outstanding),
            bursts: 0,
            burst_here: 0,
        }
    }

    /// A splat goes through; says when it is done, if it goes on.
    #[inline(always)]
    pub fn splat(&mut self, index: u64, fate: Fate, memory: &mut Memory) -> Option<u64> {
        let t = self.timing;
        let burst = u64::from(t.timing.memory.burst_bytes);
        let needed = ((index + 1) * u64::from(t.splat_bytes)).div_ceil(burst);
        let mut ready = Ready { room: self.fetch.behind.free(), ..Ready::default() };
        if needed > self.bursts {
            ready.memory = self.outstanding.free();
        }
        let now = self.fetch.take(ready, 1);
        self.fetch.behind.take(now);
        while self.bursts < needed {
            self.burst_here = memory.request(now, Client::Splats, Direction::Read, self.bursts * burst, burst);
            self.outstanding.push(self.burst_here);
            self.bursts += 1;
        }

        let goes_on = !matches!(fate, Fate::Near | Fate::Outside);
        let room = if goes_on { self.project.behind.free() } else { 0 };
        let here = now + u64::from(t.fetch.latency);
        let now = self.project.take(Ready { here, memory: self.burst_here, room, ..Ready::default() }, t.project.interval.into());
        self.fetch.behind.give(now);
        if !goes_on {
            return None;
        }
        self.project.behind.take(now);

        let goes_on = fate == Fate::Drawn;
        let room = if goes_on { self.ellipse.behind.free() } else { 0 };
        let here = now + u64::from(t.project.latency);
        let now = self.ellipse.take(Ready { here, room, ..Ready::default() }, t.ellipse.interval.into());
        self.project.behind.give(now);
        if !goes_on {
            return None;
        }
        self.ellipse.behind.take(now);
        Some(now + u64::from(t.ellipse.latency))
    }
}

/// Raster and gauss: one footprint, slot by slot.
pub struct Fill<'a> {
    timing: &'a Elaborated,
    pub raster: Unit,
    pub gauss: Unit,
    pub slots: [u64; 2],
}

impl<'a> Fill<'a> {
    pub fn new(timing: &'a Elaborated, before: &'static str, behind: &'static str, logged: bool) -> Self {
        Fill {
            timing,
            raster: Unit::new("raster", timing.raster, Some(before), Some("gauss"), logged),
            gauss: Unit::new("gauss", timing.gauss, Some("raster"), Some(behind), logged),
            slots: [0; 2],
        }
    }

    /// A footprint is here, or comes from memory; `give` is told when the raster takes it, `next` takes each slot that has a weight, with
    /// the first cycle in which gauss has it, and says when.
    #[inline(always)]
    pub fn footprint(
        &mut self,
        here: u64,
        memory: u64,
        slots: &[Slot],
        mut give: impl FnMut(u64),
        mut next: impl FnMut(&Slot, usize, u64) -> u64,
    ) {
        let t = self.timing;
        let mut first = true;
        let mut empty = 0;
        let mut before = 0;
        self.slots[0] += slots.len() as u64;
        for slot in slots {
            let from = std::mem::replace(&mut before, slot.end as usize);
            if slot.kept == 0 {
                empty += 1;
                continue;
            }
            self.slots[1] += 1;
            // Slots that keep nothing wait for no room.
            if empty > 0 {
                let now = self.raster.take_run(Ready { here, memory, ..Ready::default() }, std::mem::take(&mut empty));
                if std::mem::take(&mut first) {
                    give(now);
                }
            }
            let room = self.raster.behind.free();
            let now = self.raster.take(Ready { here, memory, room, ..Ready::default() }, 1);
            if std::mem::take(&mut first) {
                give(now);
            }
            self.raster.behind.take(now);
            let goes_on = slot.kept > slot.faint;
            let room = if goes_on { self.gauss.behind.free() } else { 0 };
            let here = now + u64::from(t.raster.latency);
            let now = self.gauss.take(Ready { here, room, ..Ready::default() }, 1);
            self.raster.behind.give(now);
            if goes_on {
                self.gauss.behind.take(now);
                let taken = next(slot, from, now + u64::from(t.gauss.latency));
                self.gauss.behind.give(taken);
            }
        }
        if empty > 0 {
            let now = self.raster.take_run(Ready { here, memory, ..Ready::default() }, empty);
            if first {
                give(now);
            }
        }
    }
}

/// Fragments: slots come, merges take longer, and no pixel is taken twice at a time.
pub struct Merge<'a> {
    timing: &'a Elaborated,
    pub fragment: Unit,
    pub shade: Unit,
    width: usize,
    /// When each pixel can be taken again.
    pixels: Vec<u64>,
    /// When all that was taken is written.
    pub written: u64,
}

impl<'a> Merge<'a> {
    pub fn new(timing: &'a Elaborated, work: &Work, before: &'static str, behind: Option<&'static str>, logged: bool) -> Self {
        Merge {
            timing,
            fragment: Unit::new("fragment", timing.fragment, Some(before), behind, logged),
            shade: Unit::new("shade", timing.shade, Some("fragment"), None, logged),
            width: work.width as usize,
            pixels: vec![0; work.width as usize * work.height as usize],
            written: 0,
        }
    }

    /// Takes a slot; says when, and when it is written.
    #[inline(always)]
    pub fn slot(&mut self, slot: &Slot, pixels: &[[u16; 2]], ready: Ready) -> [u64; 2] {
        let t = self.timing;
        let at = |[x, y]: [u16; 2], width: usize| usize::from(y) * width + usize::from(x);
        let hazard = pixels.iter().map(|pixel| self.pixels[at(*pixel, self.width)]).max().unwrap_or(0);
        let mut cycles = 1 + u64::from(slot.merges) * u64::from(t.timing.fragment.merge);
        if slot.shades > 0 {
            cycles += u64::from(t.shade.latency) + u64::from(slot.shades - 1) * u64::from(t.shade.interval);
        }
        let now = self.fragment.take(Ready { hazard, ..ready }, cycles);
        for _ in 0..slot.shades {
            self.shade.take(Ready { here: now + 1, ..Ready::default() }, t.shade.interval.into());
        }
        for pixel in pixels {
            self.pixels[at(*pixel, self.width)] = now + cycles - 1 + u64::from(t.hazard);
        }
        let written = now + cycles - 1 + u64::from(t.fragment.latency);
        self.written = self.written.max(written);
        [now, written]
    }
}

/// Cycles of resolve for a pixel with so many fragments left to shade.
pub fn resolve_cycles(timing: &Elaborated, shades: u8) -> u64 {
    (u64::from(shades) * u64::from(timing.shade.interval)).max(timing.resolve.interval.into())
}

/// Where the frame's lines lie.
struct Lines {
    log: [u32; 2],
    across: u32,
    down: u32,
}

impl Lines {
    fn new(timing: &Elaborated, work: &Work) -> Self {
        let [columns, rows] = timing.timing.cache.line_px;
        Lines { log: [columns.ilog2(), rows.ilog2()], across: work.width.div_ceil(columns), down: work.height.div_ceil(rows) }
    }

    #[inline(always)]
    fn of(&self, [x, y]: [u16; 2]) -> u32 {
        let [columns, rows] = self.log.map(|log| 1u32 << log);
        u32::from(y) / rows * self.across + u32::from(x) / columns
    }
}

/// Replays a frame.
pub fn replay(timing: &Elaborated, work: &Work, logged: bool) -> Cycles {
    let t = timing;
    let mut memory = Memory::new(t.timing.memory, logged);
    let mut setup = SetUp::new(t, "raster", logged);
    let mut fill = Fill::new(t, "ellipse", "cache", logged);
    let mut lookup = Unit::new("cache", t.cache, Some("gauss"), Some("fragment"), logged);
    let lines = Lines::new(t, work);
    let mut cache = Cache::new(t, (lines.across * lines.down) as usize);
    let mut merge = Merge::new(t, work, "cache", None, logged);
    let mut readers = Readers::new(work);
    let mut slots = Slots::default();
    let mut touched: Vec<u32> = Vec::new();
    let mut footprints = work.footprints.iter();
    for (index, fate) in work.fates.iter().enumerate() {
        let Some(here) = setup.splat(index as u64, *fate, &mut memory) else { continue };
        let Some(footprint) = footprints.next() else { break };
        readers.next(footprint, [0, 0], u32::from(u16::MAX), t.timing.raster.lanes, &mut slots);
        let pixels = &slots.pixels;
        let ellipse = &mut setup.ellipse;
        fill.footprint(
            here,
            0,
            &slots.slots,
            |taken| ellipse.behind.give(taken),
            |slot, from, here| {
                let pixels = &pixels[from..slot.end as usize];
                touched.clear();
                for pixel in pixels {
                    let line = lines.of(*pixel);
                    if !touched.contains(&line) {
                        touched.push(line);
                    }
                }
                let ready = Ready { here, room: lookup.behind.free(), ..Ready::default() };
                // What it waits for along the way holds it: the first look-up begins when it takes the slot.
                let start = lookup.free().max(ready.here).max(ready.room);
                let (mut over, mut lines_here) = (start, start);
                for (nth, line) in touched.iter().enumerate() {
                    let [line_here, when] = cache.look_up(over + u64::from(nth > 0), *line, &mut memory);
                    over = when;
                    lines_here = lines_here.max(line_here);
                }
                let taken = lookup.take_with_memory(ready, touched.len() as u64, over + 1 - start);
                lookup.behind.take(taken);
                let here = over + u64::from(t.cache.latency);
                let [now, written] = merge.slot(slot, pixels, Ready { here, memory: lines_here, ..Ready::default() });
                lookup.behind.give(now);
                touched.iter().for_each(|line| cache.written(*line, written));
                taken
            },
        );
    }
    let mut resolve = Unit::new("resolve", t.resolve, Some("fragment"), None, logged);
    let end = resolve_frame(t, work, &lines, &cache, &mut merge, &mut resolve, &mut memory);
    let lookups = cache.lookups;
    let units = [setup.fetch, setup.project, setup.ellipse, fill.raster, fill.gauss, lookup, merge.fragment, merge.shade, resolve];
    let total = units.iter().map(Unit::done).max().unwrap_or(0).max(end);
    let units: Vec<UnitCycles> = units.into_iter().flat_map(|unit| unit.cycles(total)).collect();
    let (memory, requests) = memory.finish();
    Cycles { total, units, memory, requests, lookups, slots: fill.slots }
}

/// Line by line: what was touched is read, if the cache has it not; every word is written. Says when the last one is.
fn resolve_frame(
    t: &Elaborated,
    work: &Work,
    lines: &Lines,
    cache: &Cache,
    merge: &mut Merge,
    resolve: &mut Unit,
    memory: &mut Memory,
) -> u64 {
    let left_to_shade = work.left_to_shade();
    let start = merge.written;
    let mut outstanding = Outstanding::new(t.timing.memory.outstanding);
    let frame_base = u64::from(t.line_bytes) * u64::from(lines.across * lines.down);
    let mut end = start;
    let [columns, rows] = t.timing.cache.line_px;
    for line in 0..lines.across * lines.down {
        let [here, touched] = cache.holds(line);
        let read = if touched && !here {
            let from = start.max(outstanding.free());
            let done =
                memory.request(from, Client::FrameRead, Direction::Read, u64::from(line) * u64::from(t.line_bytes), t.line_bytes.into());
            outstanding.push(done);
            done
        } else {
            start
        };
        let [left, top] = [line % lines.across * columns, line / lines.across * rows];
        let (mut cycles, mut shades, mut pixels) = (0, 0, 0u64);
        for y in top..(top + rows).min(work.height) {
            for x in left..(left + columns).min(work.width) {
                let left = left_to_shade[(y * work.width + x) as usize];
                cycles += resolve_cycles(t, left);
                shades += u64::from(left);
                pixels += 1;
            }
        }
        let now = resolve.take(Ready { here: start, memory: read, ..Ready::default() }, cycles);
        if shades > 0 {
            merge.shade.take(Ready { here: now, ..Ready::default() }, shades * u64::from(t.shade.interval));
        }
        let latency = u64::from(t.resolve.latency) + if shades > 0 { u64::from(t.shade.latency) } else { 0 };
        let bytes = pixels * u64::from(t.frame_bytes);
        let address = frame_base + u64::from(line) * u64::from(columns * rows * t.frame_bytes);
        end = end.max(memory.request(now + cycles + latency, Client::FrameWrite, Direction::Write, address, bytes));
    }
    end
}

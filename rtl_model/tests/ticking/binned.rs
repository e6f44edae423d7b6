//! What does the binned machine do in each cycle? Two passes: lists are written, then tile after tile is drawn on the chip.
//!
//! `bin` writes a record, then an entry a cycle; a burst goes when it is full, all that are begun go when the last word is written. `list`
//! reads entries, and what they point to; fragments wait for a buffer; a tile is resolved when the last of its slots is written.

use crate::parts::{Act, Fill, Link, Merge, Reads, SetUp, Slot, Ticked, Unit, places, resolve_cycles, slots_of, turn};
use crate::scene::Scene;
use rtl_model::machine::timing::{Elaborated, Pace};
use rtl_model::work::Fate;
use std::collections::VecDeque;

/// Bytes of a list's entry.
const ENTRY_BYTES: u64 = 4;

/// A splat in a tile.
struct Entry {
    slots: VecDeque<Slot>,
    /// Its place in its tile's list; its number among all.
    nth: u64,
    number: usize,
}

/// A tile to be drawn: those without an entry are none.
struct Tile {
    corner: [usize; 2],
    /// Slots before the first that comes after it.
    end: usize,
}

struct Machine<'a> {
    timing: &'a Elaborated,
    scene: &'a Scene,
    latency: u64,
    now: u64,
    /// First pass.
    setup: SetUp<'a>,
    /// For each splat the tiles that it touches; how many splats do.
    touched: Vec<Vec<usize>>,
    drawn: usize,
    bin: Unit,
    writes: Reads,
    record_bytes: u64,
    list_bytes: Vec<u64>,
    binned: u64,
    /// When all lists are in memory.
    sorted: Option<u64>,
    /// Second pass.
    entries: Vec<Entry>,
    tiles: Vec<Tile>,
    has_empty_tiles: bool,
    list: Unit,
    reads: Reads,
    /// The burst of its list that the last entry is in; records that are read when that has come; the record's read of every entry.
    burst: usize,
    waiting: VecDeque<[usize; 2]>,
    record_reads: Vec<usize>,
    listed: Link<usize>,
    fill: Fill,
    merge: Merge,
    /// When each slot is written.
    written: Vec<u64>,
    resolve: Unit,
    /// When each tile has left its buffer.
    resolved: Vec<u64>,
    lit: Unit,
    to_light: VecDeque<(u64, u64)>,
    end: u64,
}

impl<'a> Machine<'a> {
    fn new(timing: &'a Elaborated, scene: &'a Scene) -> Self {
        let t = &timing.timing;
        let side = t.tile.side_px as usize;
        let across = (scene.width as usize).div_ceil(side);
        let down = (scene.height as usize).div_ceil(side);
        let mut touched = vec![Vec::new(); scene.splats.len()];
        let (mut entries, mut tiles) = (Vec::new(), Vec::new());
        let mut end = 0;
        for tile in 0..across * down {
            let corner = [tile % across * side, tile / across * side];
            let mut nth = 0;
            for (place, splat) in scene.splats.iter().enumerate().filter(|(_, splat)| splat.fate == Fate::Drawn) {
                let meets = |[first, last]: [u16; 2], from: usize| usize::from(first) < from + side && usize::from(last) >= from;
                if !meets(splat.columns, corner[0]) || !meets(splat.rows, corner[1]) {
                    continue;
                }
                touched[place].push(tile);
                let slots = slots_of(timing, scene, place, [corner, corner.map(|at| at + side - 1)]);
                end += slots.iter().filter(|slot| !slot.pixels.is_empty()).count();
                entries.push(Entry { slots, nth, number: entries.len() });
                nth += 1;
            }
            if nth > 0 {
                tiles.push(Tile { corner, end });
            }
        }
        Machine {
            timing,
            scene,
            latency: t.memory.hit_latency.into(),
            now: 0,
            setup: SetUp::new(timing, scene),
            drawn: touched.iter().filter(|tiles| !tiles.is_empty()).count(),
            touched,
            bin: Unit::new("bin", 1),
            writes: Reads::new(t.memory.outstanding),
            record_bytes: 0,
            list_bytes: vec![0; across * down],
            binned: 0,
            sorted: None,
            has_empty_tiles: tiles.len() < across * down,
            entries,
            tiles,
            list: Unit::new("list", 1),
            reads: Reads::new(t.memory.outstanding),
            burst: 0,
            waiting: VecDeque::new(),
            record_reads: Vec::new(),
            listed: Link::new(places(Pace { units: 1, latency: 1, interval: 1, fifo: t.fetch.fifo })),
            fill: Fill::new(timing),
            merge: Merge::new(timing, scene),
            written: Vec::new(),
            resolve: Unit::new("resolve", 1),
            resolved: Vec::new(),
            lit: Unit::new("resolve-shade", 1),
            to_light: VecDeque::new(),
            end: 0,
        }
    }

    fn write(&mut self, when: u64) {
        let done = when + 1 + self.latency;
        self.writes.here.push(Some(done));
        self.binned = self.binned.max(done);
    }

    fn bin(&mut self) -> Act {
        let Some(&splat) = self.setup.ellipses.front(self.now) else { return Act::Starve };
        if !self.writes.is_free(self.now) {
            return Act::Wait;
        }
        self.setup.ellipses.pop();
        let burst = u64::from(self.timing.timing.memory.burst_bytes);
        self.record_bytes += u64::from(self.timing.prepared_bytes);
        while self.record_bytes >= burst {
            self.record_bytes -= burst;
            self.write(self.now);
        }
        let mut when = self.now;
        for tile in self.touched[splat].clone() {
            when += 1;
            self.list_bytes[tile] += ENTRY_BYTES;
            if self.list_bytes[tile] == burst {
                self.list_bytes[tile] = 0;
                self.write(when);
            }
        }
        self.binned = self.binned.max(when + 1);
        Act::Take(when + 1 - self.now)
    }

    /// Between the passes.
    fn sort(&mut self) {
        if self.sorted.is_some() || self.bin.log.len() < self.drawn || self.binned > self.now {
            return;
        }
        let begun = self.record_bytes > 0 || self.list_bytes.iter().any(|bytes| *bytes > 0);
        self.sorted = Some(if begun { self.now + 1 + self.latency } else { self.now });
    }

    fn list(&mut self) -> Act {
        let number = self.list.log.len();
        if number == self.entries.len() || self.sorted.is_none_or(|sorted| sorted > self.now) {
            return Act::Starve;
        }
        if !self.reads.is_free(self.now) {
            return Act::Wait;
        }
        if !self.listed.has_room() {
            return Act::Block;
        }
        let burst = u64::from(self.timing.timing.memory.burst_bytes);
        let nth = self.entries[number].nth;
        if nth == 0 || (nth * ENTRY_BYTES).is_multiple_of(burst) {
            self.burst = self.reads.here.len();
            self.reads.here.push(Some(self.now + 1 + self.latency));
        }
        self.waiting.push_back([self.burst, self.reads.here.len()]);
        self.record_reads.push(self.reads.here.len());
        self.reads.here.push(None);
        self.listed.push(self.now + 1, number);
        Act::Take(1)
    }

    /// Records are read when it is known which.
    fn read_records(&mut self) {
        while let Some(&[burst, read]) = self.waiting.front()
            && self.reads.has_come(burst, self.now)
        {
            self.reads.here[read] = Some(self.now + 1 + self.latency);
            self.waiting.pop_front();
        }
    }

    fn raster(&mut self) -> Act {
        let (now, reads, entries, record_reads) = (self.now, &self.reads, &self.entries, &self.record_reads);
        self.fill.raster(now, &mut self.listed, |number| {
            let entry = &entries[*number];
            reads.has_come(record_reads[entry.number], now).then(|| entry.slots.clone())
        })
    }

    fn gauss(&mut self) -> Act {
        self.fill.gauss(self.now)
    }

    fn fragment(&mut self) -> Act {
        let Some(slot) = self.fill.weighted.front(self.now) else { return Act::Starve };
        let tile = self.tiles.iter().position(|tile| slot.number < tile.end).expect("a tile");
        let buffers = self.timing.timing.tile.buffers as usize;
        let has_buffer = tile < buffers || self.resolved.get(tile - buffers).is_some_and(|at| *at <= self.now);
        if !has_buffer || !self.merge.may_take(self.now, slot) {
            return Act::Block;
        }
        let slot = self.fill.weighted.pop();
        let [cycles, written] = self.merge.take(self.now, &slot);
        self.written.push(written);
        Act::Take(cycles)
    }

    fn resolve(&mut self) -> Act {
        let Some(Tile { corner, end }) = self.tiles.get(self.resolved.len()) else { return Act::Starve };
        let is_written = self.written.len() >= *end && (*end == 0 || self.written[*end - 1] <= self.now);
        if !is_written || self.sorted.is_none_or(|sorted| sorted > self.now) {
            return Act::Starve;
        }
        let [cycles, shades] = resolve_cycles(self.timing, self.scene, *corner, [self.timing.timing.tile.side_px as usize; 2]);
        let mut done = self.now + cycles + u64::from(self.timing.resolve.latency);
        if shades > 0 {
            let work = (self.now, shades * u64::from(self.timing.shade.interval));
            if self.timing.timing.tile.buffers == 2 {
                self.to_light.push_back(work)
            } else {
                self.merge.to_shade.push_back(work)
            }
            done += u64::from(self.timing.shade.latency);
        }
        self.resolved.push(done);
        self.end = self.end.max(done + 1 + self.latency);
        Act::Take(cycles)
    }

    fn shade(&mut self) -> Act {
        self.merge.shade(self.now)
    }

    fn light(&mut self) -> Act {
        match self.to_light.front() {
            Some(&(here, cycles)) if here <= self.now => {
                self.to_light.pop_front();
                Act::Take(cycles)
            }
            _ => Act::Starve,
        }
    }

    fn tick(&mut self) {
        let now = self.now;
        self.setup.tick();
        turn(self, now, |m| &mut m.bin, Self::bin);
        self.sort();
        turn(self, now, |m| &mut m.list, Self::list);
        self.read_records();
        turn(self, now, |m| &mut m.fill.raster, Self::raster);
        turn(self, now, |m| &mut m.fill.gauss, Self::gauss);
        turn(self, now, |m| &mut m.merge.fragment, Self::fragment);
        turn(self, now, |m| &mut m.resolve, Self::resolve);
        turn(self, now, |m| &mut m.merge.shade, Self::shade);
        turn(self, now, |m| &mut m.lit, Self::light);
        self.setup.end_tick();
        self.listed.tick();
        self.fill.end_tick();
        self.now += 1;
    }

    fn is_done(&self) -> bool {
        let background = self.sorted.map(|sorted| if self.has_empty_tiles { sorted + 1 + self.latency } else { sorted });
        background.is_some_and(|at| at <= self.now)
            && self.setup.is_done()
            && self.list.log.len() == self.entries.len()
            && self.listed.items.is_empty()
            && self.fill.is_done(self.now)
            && self.merge.is_done(self.now)
            && self.resolved.len() == self.tiles.len()
            && self.to_light.is_empty()
            && [&self.bin, &self.list, &self.resolve, &self.lit].iter().all(|unit| unit.is_idle(self.now))
            && self.end <= self.now
    }
}

/// Draws a scene, cycle by cycle.
pub fn draw(timing: &Elaborated, scene: &Scene) -> Ticked {
    let mut machine = Machine::new(timing, scene);
    while !machine.is_done() {
        machine.tick();
        assert!(machine.now < 10_000_000, "it is stuck");
    }
    let Machine { setup, bin, list, listed, fill, merge, resolve, lit, now, .. } = machine;
    let slots = [&fill.raster, &fill.gauss].map(|unit| unit.log.len() as u64);
    let mut units = vec![
        setup.fetch.before(setup.records),
        setup.project.before(setup.projected),
        setup.ellipse.before(setup.ellipses),
        bin,
        list.before(listed),
        fill.raster.before(fill.slots),
        fill.gauss.before(fill.weighted),
        merge.fragment,
        merge.shade,
    ];
    if timing.timing.tile.buffers == 2 {
        units.push(lit);
    }
    units.push(resolve);
    Ticked { total: now, units, lookups: [0; 2], slots }
}

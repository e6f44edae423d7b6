//! What does the binned machine do in each cycle? Two passes: lists are written, then tile after tile is drawn on the chip.
//!
//! Between them a machine that sorts goes through all entries once for each digit of their depths: an entry a cycle, and a cycle for each
//! value of the digit. It moves them in parts of 4096 bytes: a part is read when the one before is written, but not before the turn of its
//! first entry, and written when it is here. A pass is over when it has no more to do and the last part is written.
//!
//! `bin` writes a record, then an entry a cycle; a burst goes when it is full, all that are begun go when the last word is written. `list`
//! reads entries, and what they point to; fragments wait for a buffer; a tile is resolved when the last of its stamps is written, or left
//! out; one that has stopped, when nothing of it is under way.
//!
//! A pixel that stops is left out by raster from the cycle on in which the stamp that stopped it is written. When all pixels of a tile have
//! stopped, list passes over what is left of it, in no time, and raster drops what has come, an entry a cycle. Stamps of which every pixel
//! has stopped raster passes over in no time; where none is left, that takes it a cycle.

use super::memory::{Done, LIST_BYTES, LISTS, Memory, RECORDS, Requests, WORDS};
use super::parts::{
    Act, Fill, HELD, Link, Merge, Mirror, SetUp, Stamp, Ticked, Unit, places, resolve_cycles, resolve_texels, run, stamps_of,
    texels_looked_up, turn,
};
use super::scene::Scene;
use rtl_model::elaboration::microarchitecture::{Microarchitecture, Pace, SortShape};
use rtl_model::timing::{Client, Direction};
use std::collections::{BTreeMap, VecDeque};

/// Bytes of a list's entry.
const ENTRY_BYTES: u64 = 4;
/// Bytes that are sorted at a time, and where: from the one half to the other.
const PART_BYTES: u64 = 4096;
const HALVES: [u64; 2] = [1 << 60, (1 << 60) + (1 << 40)];

/// A splat in a tile.
struct Entry {
    splat: usize,
    /// How many splats are drawn before it.
    record: u64,
    corner: [usize; 2],
    /// Its tile's place in the picture, and its own place in the tile's list.
    tile: u64,
    nth: u64,
    /// Its tile among those that have an entry, and how many stamps with a weight it has there.
    drawn: usize,
    stamps: usize,
}

/// A tile to be drawn: those without an entry are none.
struct Tile {
    corner: [usize; 2],
    place: u64,
    /// Stamps with a weight that are neither written nor left out, and when the last of the others was.
    left: usize,
    last: u64,
    /// Stamps with a weight between raster and fragment.
    under_way: usize,
    /// Its pixels.
    pixels: Vec<usize>,
}

struct Machine<'a> {
    timing: &'a Microarchitecture,
    scene: &'a Scene,
    memory: Memory,
    now: u64,
    /// First pass.
    setup: SetUp<'a>,
    /// For each splat the tiles that it touches; how many splats do.
    touched: Vec<Vec<usize>>,
    drawn: usize,
    bin: Unit,
    writes: Requests,
    record_bytes: u64,
    list_bytes: Vec<u64>,
    /// When the last entry's cycle is over.
    binned: u64,
    /// What is left of records and lists goes; all lists are in memory, and in the order in which splats are drawn.
    flushed: bool,
    listed_all: bool,
    sorted: bool,
    sort: Unit,
    /// Passes begun, when the last was, bytes that it has moved, and the part on its way, to be read or written.
    passes: u32,
    begun: u64,
    moved: u64,
    part: Option<(Done, Direction)>,
    /// Second pass.
    entries: Vec<Entry>,
    /// The first of them that list has not taken, and the one that raster looks at.
    next: usize,
    looked_at: usize,
    tiles: Vec<Tile>,
    /// Those without an entry: how many that have one come before, and the place in the picture.
    empty: Vec<(usize, u64)>,
    list: Unit,
    reads: Requests,
    /// The burst of its list that the last entry is in; entries whose records are read when that has come; every entry's record.
    burst: Done,
    waiting: VecDeque<(Done, usize)>,
    records: BTreeMap<usize, Done>,
    listed: Link<usize>,
    fill: Fill,
    merge: Merge,
    resolve: Unit,
    /// When each tile has left its buffer.
    resolved: Vec<u64>,
    lit: Unit,
    to_light: VecDeque<(u64, u64)>,
    /// What mirrors, of that; and the tile that resolve waits with for its light: its place, when it was taken, and for how long and until when
    /// it is done if it waits for nothing.
    mirror: Option<Mirror>,
    unwritten: Option<(u64, [u64; 3])>,
    words: Requests,
}

impl<'a> Machine<'a> {
    fn new(timing: &'a Microarchitecture, scene: &'a Scene) -> Self {
        let t = &timing.timing;
        let side = t.tile.side_px as usize;
        let across = (scene.width as usize).div_ceil(side);
        let down = (scene.height as usize).div_ceil(side);
        let mut touched = vec![Vec::new(); scene.splats.len()];
        let in_order = scene.in_order();
        let (mut entries, mut tiles, mut empty) = (Vec::new(), Vec::new(), Vec::new());
        for tile in 0..across * down {
            let corner = [tile % across * side, tile / across * side];
            let (mut nth, mut left) = (0, 0);
            for &(record, place) in &in_order {
                let splat = &scene.splats[place];
                let meets = |[first, last]: [u16; 2], from: usize| usize::from(first) < from + side && usize::from(last) >= from;
                if !meets(splat.columns, corner[0]) || !meets(splat.rows, corner[1]) {
                    continue;
                }
                touched[place].push(tile);
                let stamps = stamps_of(timing, scene, place, [corner, corner.map(|at| at + side - 1)]);
                let stamps = stamps.iter().filter(|stamp| !stamp.pixels.is_empty()).count();
                let drawn = tiles.len();
                entries.push(Entry { splat: place, record: record as u64, corner, tile: tile as u64, nth, drawn, stamps });
                left += stamps;
                nth += 1;
            }
            match nth {
                0 => empty.push((tiles.len(), tile as u64)),
                _ => {
                    let [width, height] = [scene.width, scene.height].map(|size| size as usize);
                    let rows = corner[1]..height.min(corner[1] + side);
                    let pixels = rows.flat_map(|y| (corner[0]..width.min(corner[0] + side)).map(move |x| y * width + x)).collect();
                    tiles.push(Tile { corner, place: tile as u64, left, last: 0, under_way: 0, pixels });
                }
            }
        }
        Machine {
            timing,
            scene,
            memory: Memory::new(t.memory),
            now: 0,
            setup: SetUp::new(timing, scene),
            drawn: touched.iter().filter(|tiles| !tiles.is_empty()).count(),
            touched,
            bin: Unit::new("bin", 1),
            writes: Requests::new(t.memory.outstanding),
            record_bytes: 0,
            list_bytes: vec![0; across * down],
            binned: 0,
            flushed: false,
            listed_all: false,
            sorted: false,
            sort: Unit::new("sort", 1),
            passes: 0,
            begun: 0,
            moved: 0,
            part: None,
            entries,
            next: 0,
            looked_at: 0,
            tiles,
            empty,
            list: Unit::new("list", 1),
            reads: Requests::new(t.memory.outstanding),
            burst: Done::default(),
            waiting: VecDeque::new(),
            records: BTreeMap::new(),
            listed: Link::new(places(Pace { units: 1, latency: 1, interval: 1, fifo: t.fetch.fifo })),
            fill: Fill::new(timing).leaving_out((scene.width * scene.height) as usize),
            merge: Merge::new(timing, scene),
            resolve: Unit::new("resolve", 1),
            resolved: Vec::new(),
            lit: Unit::new("resolve-shade", 1),
            to_light: VecDeque::new(),
            mirror: Mirror::new(timing, scene),
            unwritten: None,
            words: Requests::new(u32::MAX),
        }
    }

    fn burst(&self) -> u64 {
        self.timing.timing.memory.burst_bytes.into()
    }

    /// Writes the burst that ends here, or would if it were full.
    fn write(&mut self, when: u64, region: u64, end: u64) {
        let end = region + end.next_multiple_of(self.burst());
        self.memory.ask(when, Client::Lists, Direction::Write, end - self.burst()..end, &self.writes.next());
    }

    fn bin(&mut self) -> Act {
        let Some(&splat) = self.setup.done().front(self.now) else { return Act::Starve };
        if !self.writes.is_free(self.now) {
            return Act::Wait;
        }
        self.setup.done().pop();
        let burst = self.burst();
        let before = self.record_bytes / burst;
        self.record_bytes += u64::from(self.timing.prepared_bytes);
        (before + 1..=self.record_bytes / burst).for_each(|full| self.write(self.now, RECORDS, full * burst));
        let mut when = self.now;
        for tile in self.touched[splat].clone() {
            when += 1;
            self.list_bytes[tile] += ENTRY_BYTES;
            if self.list_bytes[tile].is_multiple_of(burst) {
                self.write(when, LISTS + tile as u64 * LIST_BYTES, self.list_bytes[tile]);
            }
        }
        self.binned = when + 1;
        Act::Take(when + 1 - self.now)
    }

    /// When all splats have been binned.
    fn flush(&mut self) {
        if self.listed_all || self.bin.log.len() < self.drawn || self.binned > self.now || !self.writes.have_all_come(self.now) {
            return;
        }
        if !std::mem::replace(&mut self.flushed, true) {
            let lists = self.list_bytes.clone().into_iter().enumerate().map(|(tile, bytes)| (LISTS + tile as u64 * LIST_BYTES, bytes));
            for (region, bytes) in [(RECORDS, self.record_bytes)].into_iter().chain(lists) {
                if !bytes.is_multiple_of(self.burst()) {
                    self.write(self.now, region, bytes);
                }
            }
        }
        self.listed_all = self.writes.have_all_come(self.now);
        if self.listed_all && !self.sorts() {
            self.sorted = true;
            self.leave_out(self.now);
        }
    }

    fn sorts(&self) -> bool {
        !self.scene.order.is_empty()
    }

    fn shape(&self) -> SortShape {
        self.timing.sort.expect("a machine that sorts")
    }

    /// Bytes of all entries that are sorted.
    fn sorted_bytes(&self) -> u64 {
        self.entries.len() as u64 * u64::from(self.shape().entry_bytes)
    }

    fn sort(&mut self) -> Act {
        if !self.sorts() || !self.listed_all || self.sorted {
            return Act::Starve;
        }
        let shape = self.shape();
        if self.passes > 0 && (self.part.is_some() || self.moved < self.sorted_bytes()) {
            return Act::Wait;
        }
        if self.passes == shape.passes {
            self.sorted = true;
            self.leave_out(self.now);
            return Act::Starve;
        }
        self.passes += 1;
        (self.begun, self.moved) = (self.now, 0);
        Act::Take(self.entries.len() as u64 + (1 << shape.digit_bits))
    }

    /// The part on its way goes on, or the next one is read.
    fn move_part(&mut self) {
        if self.passes == 0 || self.sorted {
            return;
        }
        let bytes = PART_BYTES.min(self.sorted_bytes() - self.moved);
        let direction = match &self.part {
            Some((done, _)) if !done.has_come(self.now) => return,
            Some((_, Direction::Read)) => Direction::Write,
            Some((_, Direction::Write)) => {
                self.part = None;
                self.moved += bytes;
                return self.move_part();
            }
            None if bytes == 0 || self.now < self.begun + self.moved / u64::from(self.shape().entry_bytes) => return,
            None => Direction::Read,
        };
        let half = (self.passes as usize + usize::from(direction == Direction::Read)) % 2;
        let done = Done::default();
        self.memory.ask(self.now, Client::Lists, direction, HALVES[half] + self.moved..HALVES[half] + self.moved + bytes, &done);
        self.part = Some((done, direction));
    }

    fn buffers(&self) -> usize {
        self.timing.timing.tile.buffers as usize
    }

    /// Tiles without an entry are written behind the one before, which is resolved then.
    fn leave_out(&mut self, when: u64) {
        let tiles = self.resolved.len();
        let empty: Vec<u64> = self.empty.iter().filter(|(before, _)| *before == tiles).map(|(_, place)| *place).collect();
        empty.into_iter().for_each(|place| self.write_words(when, place));
    }

    fn write_words(&mut self, when: u64, place: u64) {
        let side = u64::from(self.timing.timing.tile.side_px);
        let [width, height] = [self.scene.width, self.scene.height].map(u64::from);
        let across = width.div_ceil(side);
        let size = [(place % across, width), (place / across, height)].map(|(at, size)| side.min(size - at * side));
        let [from, bytes] = [place * side * side, size[0] * size[1]].map(|words| words * u64::from(self.timing.frame_bytes));
        self.memory.ask(when, Client::FrameWrite, Direction::Write, WORDS + from..WORDS + from + bytes, &self.words.next());
    }

    fn list(&mut self) -> Act {
        if !self.sorted {
            return Act::Starve;
        }
        while self.entries.get(self.next).is_some_and(|entry| self.has_stopped(entry.drawn)) {
            self.leave_out_stamps(self.entries[self.next].drawn, self.entries[self.next].stamps);
            self.next += 1;
        }
        let number = self.next;
        if number == self.entries.len() {
            return Act::Starve;
        }
        if !self.reads.is_free(self.now) {
            return Act::Wait;
        }
        if !self.listed.has_room() {
            return Act::Block;
        }
        let Entry { nth, tile, .. } = self.entries[number];
        if (nth * ENTRY_BYTES).is_multiple_of(self.burst()) {
            self.burst = self.reads.next();
            let from = LISTS + tile * LIST_BYTES + nth * ENTRY_BYTES;
            self.memory.ask(self.now, Client::Lists, Direction::Read, from..from + self.burst(), &self.burst);
        }
        self.waiting.push_back((self.burst.clone(), number));
        self.records.insert(number, self.reads.next());
        self.listed.push(self.now + 1, number);
        self.next += 1;
        Act::Take(1)
    }

    /// Whether every pixel of a tile has stopped.
    fn has_stopped(&self, tile: usize) -> bool {
        self.tiles[tile].pixels.iter().all(|pixel| self.fill.stopped[*pixel] <= self.now)
    }

    /// So many stamps of a tile come no more.
    fn leave_out_stamps(&mut self, tile: usize, stamps: usize) {
        self.tiles[tile].left -= stamps;
        // A tile that has stopped waits for nobody but those under way.
        if !self.has_stopped(tile) {
            self.tiles[tile].last = self.tiles[tile].last.max(self.now);
        }
    }

    /// Records are read when it is known which.
    fn read_records(&mut self) {
        let bytes = u64::from(self.timing.prepared_bytes);
        self.waiting.retain(|(burst, number)| {
            let is_known = burst.has_come(self.now);
            if is_known {
                let from = RECORDS + self.entries[*number].record * bytes;
                self.memory.ask(self.now, Client::Lists, Direction::Read, from..from + bytes, &self.records[number]);
            }
            !is_known
        });
    }

    fn raster(&mut self) -> Act {
        self.pass_over();
        if !self.fill.begun
            && let Some(&number) = self.listed.front(self.now)
        {
            self.looked_at = number;
            let Entry { drawn, stamps, .. } = self.entries[number];
            if self.has_stopped(drawn) {
                self.listed.pop();
                self.fill.left.clear();
                self.leave_out_stamps(drawn, stamps);
                self.fill.dropped += 1;
                return Act::Take(1);
            }
        }
        let act = self.fill.raster(self.now, &mut self.listed, |number| {
            let Entry { splat, corner, drawn, .. } = self.entries[*number];
            let last = corner.map(|at| at + self.timing.timing.tile.side_px as usize - 1);
            self.records[number].has_come(self.now).then(|| {
                let mut stamps = stamps_of(self.timing, self.scene, splat, [corner, last]);
                stamps.iter_mut().for_each(|stamp| stamp.tile = drawn);
                stamps
            })
        });
        self.count_stamps();
        act
    }

    /// What is left of a footprint that was begun is passed over in no time, if all of it has stopped.
    fn pass_over(&mut self) {
        if self.fill.begun {
            self.fill.pass_over(self.now);
            self.fill.begun = !self.fill.left.is_empty();
            self.count_stamps();
        }
    }

    /// Those of the footprint that raster looks at.
    fn count_stamps(&mut self) {
        let [passed, left_out] = std::mem::take(&mut self.fill.decided);
        let tile = self.entries.get(self.looked_at).map_or(0, |entry| entry.drawn);
        if left_out > 0 {
            self.leave_out_stamps(tile, left_out);
        }
        if passed > 0 {
            self.tiles[tile].under_way += passed;
        }
    }

    fn gauss(&mut self) -> Act {
        self.fill.gauss(self.now)
    }

    fn fragment(&mut self) -> Act {
        let Some(stamp) = self.fill.weighted.front(self.now) else { return Act::Starve };
        let before = stamp.tile.checked_sub(self.buffers());
        let has_buffer = before.is_none_or(|tile| self.resolved.get(tile).is_some_and(|at| *at <= self.now));
        if !has_buffer || !self.merge.may_take(self.now, stamp) {
            return Act::Block;
        }
        let stamp = self.fill.weighted.pop();
        let (cycles, written) = self.merge.take(self.now, &stamp);
        if let Some(written) = written {
            self.wrote(&stamp, written);
        }
        Act::Take(cycles)
    }

    fn wrote(&mut self, stamp: &Stamp, written: u64) {
        let tile = &mut self.tiles[stamp.tile];
        tile.left -= 1;
        tile.under_way -= 1;
        tile.last = tile.last.max(written);
        for pixel in stamp.stops.iter().filter(|pixel| stamp.pixels.contains(pixel)) {
            self.fill.stopped[*pixel] = self.fill.stopped[*pixel].min(written);
        }
    }

    fn resolve(&mut self) -> Act {
        let tile = self.resolved.len();
        let Some(&Tile { corner, place, left, last, under_way, .. }) = self.tiles.get(tile) else { return Act::Starve };
        let is_through = left == 0 || self.has_stopped(tile);
        if !is_through || under_way > 0 || last > self.now || !self.sorted {
            return Act::Starve;
        }
        let [cycles, shades] = resolve_cycles(self.timing, self.scene, corner, [self.timing.timing.tile.side_px as usize; 2]);
        let mut done = self.now + cycles + u64::from(self.timing.resolve.latency);
        let mirror = if self.buffers() == 2 { &mut self.mirror } else { &mut self.merge.mirror };
        if let (Some(mirror), true) = (mirror, shades > 0) {
            // Known when the last texels are here.
            mirror.ask(self.now, resolve_texels(self.scene, corner, [self.timing.timing.tile.side_px as usize; 2]));
            self.unwritten = Some((place, [self.now, cycles, done + u64::from(self.timing.shade.latency)]));
            return Act::Take(HELD);
        }
        if shades > 0 {
            let work = (self.now, shades * u64::from(self.timing.shade.interval));
            if self.buffers() == 2 {
                self.to_light.push_back(work)
            } else {
                self.merge.to_shade.push_back(work)
            }
            done += u64::from(self.timing.shade.latency);
        }
        self.hand_out(place, done);
        Act::Take(cycles)
    }

    /// A tile is resolved.
    fn hand_out(&mut self, place: u64, done: u64) {
        self.resolved.push(done);
        self.write_words(done, place);
        self.leave_out(done);
    }

    /// The tile that resolve waited with has its light, after so many cycles in which texels were waited for.
    fn end_wait(&mut self, waited: u64) {
        if let Some((place, [begun, cycles, done])) = self.unwritten.take() {
            self.resolve.sides[0].until = begun + cycles + waited;
            self.hand_out(place, done + waited);
        }
    }

    fn shade(&mut self) -> Act {
        if self.merge.mirror.is_none() {
            return self.merge.shade(self.now);
        }
        let (act, stamp, waited) = self.merge.mirror(self.now, &mut self.memory);
        if let Some((stamp, written)) = stamp {
            self.wrote(&stamp, written);
        }
        if let Some(waited) = waited {
            self.end_wait(waited);
        }
        act
    }

    fn light(&mut self) -> Act {
        if let Some(mirror) = &mut self.mirror {
            let (act, is_last) = mirror.shade(self.now, self.timing.shade.interval.into(), &mut self.memory);
            if is_last {
                let waited = std::mem::take(&mut mirror.waited);
                self.end_wait(waited);
            }
            return act;
        }
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
        self.setup.tick(&mut self.memory);
        turn(self, now, |m| &mut m.bin, Self::bin);
        self.flush();
        self.move_part();
        turn(self, now, |m| &mut m.sort, Self::sort);
        self.move_part();
        turn(self, now, |m| &mut m.list, Self::list);
        self.read_records();
        turn(self, now, |m| &mut m.fill.raster, Self::raster);
        turn(self, now, |m| &mut m.fill.gauss, Self::gauss);
        turn(self, now, |m| &mut m.merge.fragment, Self::fragment);
        turn(self, now, |m| &mut m.resolve, Self::resolve);
        turn(self, now, |m| &mut m.merge.shade, Self::shade);
        turn(self, now, |m| &mut m.lit, Self::light);
        self.memory.tick(now);
        self.setup.end_tick();
        self.listed.tick();
        self.fill.end_tick();
        self.now += 1;
    }

    fn is_done(&mut self) -> bool {
        self.pass_over();
        self.sorted
            && self.setup.is_done()
            && self.next == self.entries.len()
            && self.listed.items.is_empty()
            && self.fill.is_done(self.now)
            && self.merge.is_done(self.now)
            && self.resolved.len() == self.tiles.len()
            && self.to_light.is_empty()
            && self.mirror.as_ref().is_none_or(|mirror| mirror.queue.is_empty())
            && [&self.bin, &self.list, &self.resolve, &self.lit].iter().all(|unit| unit.is_idle(self.now))
            && self.words.have_all_come(self.now)
    }
}

/// Draws a scene, cycle by cycle.
pub fn draw(timing: &Microarchitecture, scene: &Scene) -> Ticked {
    let mut machine = Machine::new(timing, scene);
    let total = run(&mut machine, Machine::tick, Machine::is_done);
    let sort = if machine.sorts() { vec![machine.sort.clone()] } else { Vec::new() };
    let Machine { memory, setup, bin, list, listed, fill, merge, resolve, lit, mirror, .. } = machine;
    let stamps = fill.taken();
    let texels = [&merge.mirror, &mirror].map(|mirror| mirror.as_ref().map(|mirror| &mirror.texels));
    let texels = texels_looked_up([setup.texels.as_ref(), texels[0], texels[1]]);
    let lit = if timing.timing.tile.buffers == 2 { vec![lit] } else { Vec::new() };
    let (setup, shade) = setup.units();
    let second = [fill.units(), vec![merge.fragment, shade.unwrap_or(merge.shade)], lit, vec![resolve]].concat();
    let units = [setup, vec![bin], sort, vec![list.before(listed)], second].concat();
    Ticked { total, units, lookups: [0; 2], texels, stamps, traffic: memory.traffic }
}

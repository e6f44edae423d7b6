//! What does the immediate machine do in each cycle? It ticks: every unit looks, in every cycle, at the item that it would take next.
//!
//! Nothing that happens in a cycle is seen in the same cycle by another unit (but shading by its unit, which goes last), so their order
//! within a cycle does not matter.

use crate::scene::Scene;
use rtl_model::machine::timing::Elaborated;
use rtl_model::timing::Account;
use rtl_model::work::{Event, Fate};
use std::collections::{BTreeSet, VecDeque};

/// One of several side by side.
#[derive(Clone, Debug, Default)]
pub struct Side {
    pub items: u64,
    pub account: Account,
    /// The first cycle in which nothing holds it.
    until: u64,
}

/// A unit.
#[derive(Clone, Debug)]
pub struct Unit {
    pub name: &'static str,
    pub sides: Vec<Side>,
    pub log: Vec<u64>,
}

/// What happened.
#[derive(Clone, Debug)]
pub struct Ticked {
    pub total: u64,
    pub units: Vec<Unit>,
    /// How full it was behind the units from the first on.
    pub occupancies: Vec<Vec<u64>>,
    pub lookups: [u64; 2],
    /// All that the raster took, and those that kept a pixel.
    pub slots: [u64; 2],
}

/// What a free unit does in a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Act {
    Starve,
    Wait,
    Block,
    /// Takes an item that holds it for so many cycles.
    Take(u64),
}

impl Unit {
    fn new(name: &'static str, sides: u32) -> Self {
        Unit { name, sides: vec![Side::default(); sides as usize], log: Vec::new() }
    }

    /// Whose turn it is.
    fn turn(&self) -> usize {
        self.log.len() % self.sides.len()
    }

    fn is_free(&self, now: u64) -> bool {
        self.sides[self.turn()].until <= now
    }

    fn take(&mut self, now: u64, cycles: u64) {
        let turn = self.turn();
        self.sides[turn].until = now + cycles;
        self.sides[turn].items += 1;
        self.log.push(now);
    }

    /// Counts the cycle. The side whose turn it is would have taken an item but for a reason.
    fn count(&mut self, now: u64, reason: Act) {
        let turn = self.turn();
        for (place, side) in self.sides.iter_mut().enumerate() {
            match reason {
                _ if side.until > now => side.account.busy += 1,
                Act::Wait if place == turn => side.account.memory += 1,
                Act::Block if place == turn => side.account.blocked += 1,
                _ => side.account.starved += 1,
            }
        }
    }
}

/// A FIFO and the pipeline before it: items with the cycle in which they are here. Places are credits.
struct Link<T> {
    items: VecDeque<(u64, T)>,
    credits: u32,
    /// Given back in this cycle.
    returned: u32,
    /// How often so many places were taken when another one was, with that.
    occupancy: Vec<u64>,
}

impl<T> Link<T> {
    fn new(places: u32) -> Self {
        Link { items: VecDeque::new(), credits: places, returned: 0, occupancy: vec![0; places as usize + 1] }
    }

    fn has_room(&self) -> bool {
        self.credits > 0
    }

    fn reserve(&mut self) {
        self.credits = self.credits.checked_sub(1).expect("a place");
        let taken = self.occupancy.len() - 1 - self.credits as usize;
        self.occupancy[taken] += 1;
    }

    fn push(&mut self, here: u64, item: T) {
        self.reserve();
        self.items.push_back((here, item));
    }

    fn front(&self, now: u64) -> Option<&T> {
        self.items.front().filter(|(here, _)| *here <= now).map(|(_, item)| item)
    }

    fn pop(&mut self) -> T {
        self.returned += 1;
        self.items.pop_front().expect("an item").1
    }

    fn tick(&mut self) {
        self.credits += std::mem::take(&mut self.returned);
    }
}

/// The pixels of a slot.
#[derive(Clone, Debug, Default)]
struct Slot {
    kept: bool,
    /// Its pixels that are not faint, as places in the picture.
    pixels: Vec<usize>,
    merges: u64,
    shades: Vec<u64>,
    /// Lines in the order in which pixels meet them.
    lines: Vec<usize>,
    /// Among those that reach the fragment unit.
    number: usize,
}

/// Reads on their way, in the order of asking, at most so many at a time.
struct Reads {
    limit: usize,
    /// When the data is here, if it was asked for.
    here: Vec<Option<u64>>,
}

impl Reads {
    fn new(limit: u32) -> Self {
        Reads { limit: limit as usize, here: Vec::new() }
    }

    fn is_free(&self, now: u64) -> bool {
        match self.here.len().checked_sub(self.limit) {
            Some(before) => self.has_come(before, now),
            None => true,
        }
    }

    fn has_come(&self, read: usize, now: u64) -> bool {
        self.here[read].is_some_and(|here| here <= now)
    }
}

/// A line in the cache.
struct Way {
    line: usize,
    used: u64,
    /// The slots that looked it up.
    users: Vec<usize>,
    read: Option<usize>,
}

/// What the cache holds.
struct Lines {
    sets: Vec<Vec<Way>>,
    ways: usize,
    clock: u64,
    written_back: BTreeSet<usize>,
    touched: BTreeSet<usize>,
    reads: Reads,
    /// Reads that wait for these slots to be written.
    held_up: Vec<(usize, Vec<usize>)>,
    lookups: [u64; 2],
}

impl Lines {
    /// Looks a line up for a slot: whether that is over in this cycle, and for which read the slot has to wait.
    fn look_up(&mut self, now: u64, line: usize, slot: usize) -> Option<Option<usize>> {
        let of = line % self.sets.len();
        let set = &mut self.sets[of];
        let found = set.iter().position(|way| way.line == line);
        let must_read = found.is_none() && self.written_back.contains(&line);
        if must_read && !self.reads.is_free(now) {
            return None;
        }
        self.clock += 1;
        self.lookups[0] += 1;
        self.touched.insert(line);
        if let Some(found) = found {
            self.lookups[1] += 1;
            let way = &mut set[found];
            way.used = self.clock;
            if way.users.last() != Some(&slot) {
                way.users.push(slot);
            }
            return Some(way.read);
        }
        let mut before = Vec::new();
        if set.len() == self.ways {
            let oldest = (0..set.len()).min_by_key(|way| set[*way].used).expect("a way");
            let victim = set.swap_remove(oldest);
            self.written_back.insert(victim.line);
            // A slot cannot wait for itself.
            before = victim.users.into_iter().filter(|user| *user != slot).collect();
        }
        let read = must_read.then(|| {
            self.reads.here.push(None);
            self.held_up.push((self.reads.here.len() - 1, before));
            self.reads.here.len() - 1
        });
        set.push(Way { line, used: self.clock, users: vec![slot], read });
        Some(read)
    }

    /// Sends the reads whose victims are written.
    fn send(&mut self, now: u64, latency: u64, written: &[Option<u64>]) {
        let reads = &mut self.reads;
        self.held_up.retain(|(read, slots)| {
            let all = slots.iter().all(|slot| written[*slot].is_some_and(|at| at <= now));
            if all {
                reads.here[*read] = Some(now + 1 + latency);
            }
            !all
        });
    }

    fn holds(&self, line: usize) -> bool {
        self.sets[line % self.sets.len()].iter().any(|way| way.line == line)
    }
}

/// A slot in the cache unit.
struct Looking {
    slot: Slot,
    next: usize,
    reads: Vec<usize>,
}

/// The machine.
struct Machine<'a> {
    timing: &'a Elaborated,
    scene: &'a Scene,
    latency: u64,
    now: u64,

    fetch: Unit,
    requests: Reads,
    records: Link<usize>,
    project: Unit,
    projected: Link<usize>,
    ellipse: Unit,
    ellipses: Link<usize>,
    raster: Unit,
    /// The slots of every splat, and whose the raster is at.
    footprints: Vec<VecDeque<Slot>>,
    rastering: Option<usize>,
    slots: Link<Slot>,
    gauss: Unit,
    weighted: Link<Slot>,
    cache: Unit,
    lines: Lines,
    looking: Option<Looking>,
    looked_up: Link<(Slot, Vec<usize>)>,
    fragment: Unit,
    /// From when on each pixel can be taken again.
    pixel_free: Vec<u64>,
    /// When each slot is written.
    written: Vec<Option<u64>>,
    /// When those that were taken are.
    all_written: u64,
    shade: Unit,
    to_shade: VecDeque<(u64, u64)>,
    resolve: Unit,
    /// Slots that will reach the fragment unit, and those among them that the raster took.
    expected: usize,
    numbered: usize,
    line_reads: Reads,
    /// For each line of the picture its read, if it has one; known when resolve begins.
    resolve_reads: Option<Vec<Option<usize>>>,
    /// All words are in memory.
    end: u64,
}

/// The slots of a splat.
fn slots_of(timing: &Elaborated, scene: &Scene, splat: usize) -> VecDeque<Slot> {
    let splat = &scene.splats[splat];
    if splat.fate != Fate::Drawn {
        return VecDeque::new();
    }
    let [columns, rows] = splat.size();
    let lanes = timing.timing.raster.lanes.map(|lanes| lanes as usize);
    let [line_width, line_height] = timing.timing.cache.line_px.map(|size| size as usize);
    let lines_across = (scene.width as usize).div_ceil(line_width);
    let mut slots = VecDeque::new();
    for top in (0..rows).step_by(lanes[1]) {
        for left in (0..columns).step_by(lanes[0]) {
            let mut slot = Slot::default();
            for row in top..rows.min(top + lanes[1]) {
                for column in left..columns.min(left + lanes[0]) {
                    let Some(event) = splat.pixel(column, row) else { continue };
                    slot.kept = true;
                    if event == Event::Faint {
                        continue;
                    }
                    let [x, y] = [usize::from(splat.columns[0]) + column, usize::from(splat.rows[0]) + row];
                    slot.pixels.push(y * scene.width as usize + x);
                    if let Event::Merged(shades) = event {
                        slot.merges += 1;
                        slot.shades.push(u64::from(shades));
                    }
                    let line = y / line_height * lines_across + x / line_width;
                    if !slot.lines.contains(&line) {
                        slot.lines.push(line);
                    }
                }
            }
            slots.push_back(slot);
        }
    }
    slots
}

impl<'a> Machine<'a> {
    fn new(timing: &'a Elaborated, scene: &'a Scene) -> Self {
        let t = &timing.timing;
        let places = |fifo: u32, latency: u32, interval: u32, units: u32| (fifo + latency.div_ceil(interval)) * units;
        let [project, ellipse] = [t.project, t.ellipse];
        let footprints: Vec<_> = (0..scene.splats.len()).map(|splat| slots_of(timing, scene, splat)).collect();
        let expected = footprints.iter().flatten().filter(|slot| !slot.pixels.is_empty()).count();
        Machine {
            timing,
            scene,
            latency: u64::from(t.memory.hit_latency),
            now: 0,
            fetch: Unit::new("fetch", 1),
            requests: Reads::new(t.memory.outstanding),
            records: Link::new(places(t.fetch.fifo, 1, 1, 1)),
            project: Unit::new("project", project.units),
            projected: Link::new(places(project.fifo, timing.project.latency, timing.project.interval, project.units)),
            ellipse: Unit::new("ellipse", ellipse.units),
            ellipses: Link::new(places(ellipse.fifo, timing.ellipse.latency, timing.ellipse.interval, ellipse.units)),
            raster: Unit::new("raster", 1),
            footprints,
            rastering: None,
            slots: Link::new(places(t.raster.fifo, timing.raster.latency, 1, 1)),
            gauss: Unit::new("gauss", 1),
            weighted: Link::new(places(t.gauss.fifo, timing.gauss.latency, 1, 1)),
            cache: Unit::new("cache", 1),
            lines: Lines {
                sets: (0..t.cache.lines / t.cache.ways).map(|_| Vec::new()).collect(),
                ways: t.cache.ways as usize,
                clock: 0,
                written_back: BTreeSet::new(),
                touched: BTreeSet::new(),
                reads: Reads::new(t.cache.misses),
                held_up: Vec::new(),
                lookups: [0; 2],
            },
            looking: None,
            looked_up: Link::new(places(t.cache.fifo, timing.cache.latency, 1, 1)),
            fragment: Unit::new("fragment", 1),
            pixel_free: vec![0; (scene.width * scene.height) as usize],
            written: vec![None; expected],
            all_written: 0,
            shade: Unit::new("shade", 1),
            to_shade: VecDeque::new(),
            resolve: Unit::new("resolve", 1),
            expected,
            numbered: 0,
            line_reads: Reads::new(t.memory.outstanding),
            resolve_reads: None,
            end: 0,
        }
    }

    fn fetch(&mut self) -> Act {
        let record = self.fetch.log.len();
        if record == self.scene.splats.len() {
            return Act::Starve;
        }
        let bytes = (record + 1) * self.timing.splat_bytes as usize;
        let needed = bytes.div_ceil(self.timing.timing.memory.burst_bytes as usize);
        if needed > self.requests.here.len() && !self.requests.is_free(self.now) {
            return Act::Wait;
        }
        if !self.records.has_room() {
            return Act::Block;
        }
        // All bursts of a record go in one cycle, so that more can be on their way than may be, if a record has more.
        let asked = needed.max(self.requests.here.len());
        self.requests.here.resize(asked, Some(self.now + 1 + self.latency));
        self.records.push(self.now + 1, record);
        Act::Take(1)
    }

    fn project(&mut self) -> Act {
        let Some(&record) = self.records.front(self.now) else { return Act::Starve };
        let bytes = (record + 1) * self.timing.splat_bytes as usize;
        let last = bytes.div_ceil(self.timing.timing.memory.burst_bytes as usize) - 1;
        if !self.requests.has_come(last, self.now) {
            return Act::Wait;
        }
        let ends = matches!(self.scene.splats[record].fate, Fate::Near | Fate::Outside);
        if !ends && !self.projected.has_room() {
            return Act::Block;
        }
        self.records.pop();
        if !ends {
            self.projected.push(self.now + u64::from(self.timing.project.latency), record);
        }
        Act::Take(self.timing.project.interval.into())
    }

    fn ellipse(&mut self) -> Act {
        let Some(&record) = self.projected.front(self.now) else { return Act::Starve };
        let ends = self.scene.splats[record].fate != Fate::Drawn;
        if !ends && !self.ellipses.has_room() {
            return Act::Block;
        }
        self.projected.pop();
        if !ends {
            self.ellipses.push(self.now + u64::from(self.timing.ellipse.latency), record);
        }
        Act::Take(self.timing.ellipse.interval.into())
    }

    fn raster(&mut self) -> Act {
        let Some(splat) = self.rastering.or_else(|| self.ellipses.front(self.now).copied()) else { return Act::Starve };
        let slots = &mut self.footprints[splat];
        if slots[0].kept && !self.slots.has_room() {
            return Act::Block;
        }
        if self.rastering.is_none() {
            self.ellipses.pop();
        }
        let mut slot = slots.pop_front().expect("a slot");
        self.rastering = (!slots.is_empty()).then_some(splat);
        if slot.kept {
            slot.number = self.numbered;
            self.numbered += usize::from(!slot.pixels.is_empty());
            self.slots.push(self.now + u64::from(self.timing.raster.latency), slot);
        }
        Act::Take(1)
    }

    fn gauss(&mut self) -> Act {
        let Some(slot) = self.slots.front(self.now) else { return Act::Starve };
        let ends = slot.pixels.is_empty();
        if !ends && !self.weighted.has_room() {
            return Act::Block;
        }
        let slot = self.slots.pop();
        if !ends {
            self.weighted.push(self.now + u64::from(self.timing.gauss.latency), slot);
        }
        Act::Take(1)
    }

    /// Counts its cycles itself: looking a line up is work, waiting for a read to come is not.
    fn cache(&mut self) {
        let account = &mut self.cache.sides[0].account;
        if self.looking.is_none() {
            if self.weighted.front(self.now).is_none() {
                account.starved += 1;
                return;
            }
            if !self.looked_up.has_room() {
                account.blocked += 1;
                return;
            }
            self.looked_up.reserve();
            self.looking = Some(Looking { slot: self.weighted.pop(), next: 0, reads: Vec::new() });
            self.cache.sides[0].items += 1;
            self.cache.log.push(self.now);
        }
        let account = &mut self.cache.sides[0].account;
        let looking = self.looking.as_mut().expect("a slot");
        let line = looking.slot.lines[looking.next];
        let Some(read) = self.lines.look_up(self.now, line, looking.slot.number) else {
            account.memory += 1;
            return;
        };
        account.busy += 1;
        looking.reads.extend(read);
        looking.next += 1;
        if looking.next == looking.slot.lines.len() {
            let Looking { slot, reads, .. } = self.looking.take().expect("a slot");
            self.looked_up.items.push_back((self.now + u64::from(self.timing.cache.latency), (slot, reads)));
        }
    }

    fn fragment(&mut self) -> Act {
        let Some((slot, reads)) = self.looked_up.front(self.now) else { return Act::Starve };
        if !reads.iter().all(|read| self.lines.reads.has_come(*read, self.now)) {
            return Act::Wait;
        }
        if slot.pixels.iter().any(|pixel| self.pixel_free[*pixel] > self.now) {
            return Act::Block;
        }
        let (slot, _) = self.looked_up.pop();
        let shades: u64 = slot.shades.iter().sum();
        let shade = self.timing.shade;
        let mut cycles = 1 + slot.merges * u64::from(self.timing.timing.fragment.merge);
        if shades > 0 {
            cycles += u64::from(shade.latency) + (shades - 1) * u64::from(shade.interval);
        }
        let last = self.now + cycles - 1;
        slot.pixels.iter().for_each(|pixel| self.pixel_free[*pixel] = last + u64::from(self.timing.hazard));
        self.all_written = last + u64::from(self.timing.fragment.latency);
        self.written[slot.number] = Some(self.all_written);
        self.to_shade.extend((0..shades).map(|_| (self.now + 1, u64::from(shade.interval))));
        Act::Take(cycles)
    }

    fn lines_across_and_down(&self) -> [usize; 2] {
        let [columns, rows] = self.timing.timing.cache.line_px;
        [self.scene.width.div_ceil(columns) as usize, self.scene.height.div_ceil(rows) as usize]
    }

    /// Once the last slot is written, what resolve needs is read, whatever it does itself.
    fn read_lines(&mut self) {
        if self.fragment.log.len() < self.expected || self.all_written > self.now {
            return;
        }
        let [across, down] = self.lines_across_and_down();
        let reads = self.resolve_reads.get_or_insert_with(|| {
            let mut reads = 0..;
            let is_read = |line: &usize| self.lines.touched.contains(line) && !self.lines.holds(*line);
            (0..across * down).map(|line| if is_read(&line) { reads.next() } else { None }).collect()
        });
        while self.line_reads.here.len() < reads.iter().flatten().count() && self.line_reads.is_free(self.now) {
            self.line_reads.here.push(Some(self.now + 1 + self.latency));
        }
    }

    fn resolve(&mut self) -> Act {
        let line = self.resolve.log.len();
        let [across, down] = self.lines_across_and_down();
        let Some(reads) = &self.resolve_reads else { return Act::Starve };
        if line == across * down {
            return Act::Starve;
        }
        if let Some(read) = reads[line]
            && !(read < self.line_reads.here.len() && self.line_reads.has_come(read, self.now))
        {
            return Act::Wait;
        }
        let [line_width, line_height] = self.timing.timing.cache.line_px.map(|size| size as usize);
        let [width, height] = [self.scene.width, self.scene.height].map(|size| size as usize);
        let [left, top] = [line % across * line_width, line / across * line_height];
        let [shade, pace] = [self.timing.shade, self.timing.resolve];
        let [mut cycles, mut shades] = [0; 2];
        for y in top..height.min(top + line_height) {
            for x in left..width.min(left + line_width) {
                let left = u64::from(self.scene.left[y * width + x]);
                cycles += (left * u64::from(shade.interval)).max(pace.interval.into());
                shades += left;
            }
        }
        let mut written = self.now + cycles + u64::from(pace.latency);
        if shades > 0 {
            self.to_shade.push_back((self.now, shades * u64::from(shade.interval)));
            written += u64::from(shade.latency);
        }
        self.end = self.end.max(written + 1 + self.latency);
        Act::Take(cycles)
    }

    fn shade(&mut self) -> Act {
        match self.to_shade.front() {
            Some(&(here, cycles)) if here <= self.now => {
                self.to_shade.pop_front();
                Act::Take(cycles)
            }
            _ => Act::Starve,
        }
    }

    /// Every side of a unit gets its chance.
    fn turn(&mut self, unit: fn(&mut Self) -> &mut Unit, act: fn(&mut Self) -> Act) {
        let now = self.now;
        let mut reason = Act::Starve;
        for _ in 0..unit(self).sides.len() {
            if !unit(self).is_free(now) {
                break;
            }
            reason = act(self);
            let Act::Take(cycles) = reason else { break };
            unit(self).take(now, cycles);
        }
        unit(self).count(now, reason);
    }

    fn tick(&mut self) {
        self.turn(|m| &mut m.fetch, Self::fetch);
        self.turn(|m| &mut m.project, Self::project);
        self.turn(|m| &mut m.ellipse, Self::ellipse);
        self.turn(|m| &mut m.raster, Self::raster);
        self.turn(|m| &mut m.gauss, Self::gauss);
        self.cache();
        self.lines.send(self.now, self.latency, &self.written);
        self.turn(|m| &mut m.fragment, Self::fragment);
        self.read_lines();
        self.turn(|m| &mut m.resolve, Self::resolve);
        self.turn(|m| &mut m.shade, Self::shade);
        self.records.tick();
        self.projected.tick();
        self.ellipses.tick();
        self.slots.tick();
        self.weighted.tick();
        self.looked_up.tick();
        self.now += 1;
    }

    fn is_done(&self) -> bool {
        let splats = self.scene.splats.len();
        let [across, down] = self.lines_across_and_down();
        let units = [&self.fetch, &self.project, &self.ellipse, &self.raster, &self.gauss, &self.fragment, &self.shade, &self.resolve];
        let waiting = [self.records.items.len(), self.projected.items.len(), self.ellipses.items.len()];
        let slots = [self.slots.items.len(), self.weighted.items.len(), self.looked_up.items.len(), self.to_shade.len()];
        self.resolve.log.len() == across * down
            && self.fetch.log.len() == splats
            && waiting == [0; 3]
            && slots == [0; 4]
            && self.rastering.is_none()
            && self.looking.is_none()
            && self.fragment.log.len() == self.expected
            && units.iter().all(|unit| unit.sides.iter().all(|side| side.until <= self.now))
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
    let Machine { fetch, project, ellipse, raster, gauss, cache, fragment, shade, resolve, .. } = machine;
    let Machine { records, projected, ellipses, slots, weighted, looked_up, lines, now, .. } = machine;
    let counts = [&raster, &gauss].map(|unit| unit.log.len() as u64);
    Ticked {
        total: now,
        units: vec![fetch, project, ellipse, raster, gauss, cache, fragment, shade, resolve],
        occupancies: vec![
            records.occupancy,
            projected.occupancy,
            ellipses.occupancy,
            slots.occupancy,
            weighted.occupancy,
            looked_up.occupancy,
        ],
        lookups: lines.lookups,
        slots: counts,
    }
}

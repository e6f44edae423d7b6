//! What does the immediate machine do in each cycle? It ticks: every unit looks, in every cycle, at the item that it would take next.
//!
//! Nothing that happens in a cycle is seen in the same cycle by another unit (but shading by its unit, which goes last), so their order
//! within a cycle does not matter.

use crate::parts::{Act, Fill, Link, Merge, Reads, SetUp, Slot, Ticked, Unit, places, resolve_cycles, slots_of, turn};
use crate::scene::Scene;
use rtl_model::machine::timing::Elaborated;
use std::collections::{BTreeSet, VecDeque};

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
    setup: SetUp<'a>,
    /// The slots of every splat, and how many of them will reach the fragment unit.
    footprints: Vec<VecDeque<Slot>>,
    expected: usize,
    fill: Fill,
    cache: Unit,
    lines: Lines,
    looking: Option<Looking>,
    looked_up: Link<(Slot, Vec<usize>)>,
    merge: Merge,
    /// When each slot is written, and when those that were taken all are.
    written: Vec<Option<u64>>,
    all_written: u64,
    resolve: Unit,
    line_reads: Reads,
    /// For each line of the picture its read, if it has one; known when resolve begins.
    resolve_reads: Option<Vec<Option<usize>>>,
    /// All words are in memory.
    end: u64,
}

impl<'a> Machine<'a> {
    fn new(timing: &'a Elaborated, scene: &'a Scene) -> Self {
        let t = &timing.timing;
        let all = [[0; 2], [usize::MAX; 2]];
        let footprints: Vec<_> = (0..scene.splats.len()).map(|splat| slots_of(timing, scene, splat, all)).collect();
        let expected = footprints.iter().flatten().filter(|slot| !slot.pixels.is_empty()).count();
        Machine {
            timing,
            scene,
            latency: t.memory.hit_latency.into(),
            now: 0,
            setup: SetUp::new(timing, scene),
            footprints,
            expected,
            fill: Fill::new(timing),
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
            looked_up: Link::new(places(timing.cache)),
            merge: Merge::new(timing, scene),
            written: vec![None; expected],
            all_written: 0,
            resolve: Unit::new("resolve", 1),
            line_reads: Reads::new(t.memory.outstanding),
            resolve_reads: None,
            end: 0,
        }
    }

    fn raster(&mut self) -> Act {
        self.fill.raster(self.now, &mut self.setup.ellipses, |splat| Some(self.footprints[*splat].clone()))
    }

    fn gauss(&mut self) -> Act {
        self.fill.gauss(self.now)
    }

    /// Counts its cycles itself: looking a line up is work, waiting for a read to come is not.
    fn cache(&mut self) {
        let account = &mut self.cache.sides[0].account;
        if self.looking.is_none() {
            if self.fill.weighted.front(self.now).is_none() {
                account.starved += 1;
                return;
            }
            if !self.looked_up.has_room() {
                account.blocked += 1;
                return;
            }
            self.looked_up.reserve();
            self.looking = Some(Looking { slot: self.fill.weighted.pop(), next: 0, reads: Vec::new() });
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
        if !self.merge.may_take(self.now, slot) {
            return Act::Block;
        }
        let (slot, _) = self.looked_up.pop();
        let [cycles, written] = self.merge.take(self.now, &slot);
        self.all_written = written;
        self.written[slot.number] = Some(written);
        Act::Take(cycles)
    }

    fn lines_across_and_down(&self) -> [usize; 2] {
        let [columns, rows] = self.timing.timing.cache.line_px;
        [self.scene.width.div_ceil(columns) as usize, self.scene.height.div_ceil(rows) as usize]
    }

    /// Once the last slot is written, what resolve needs is read, whatever it does itself.
    fn read_lines(&mut self) {
        if self.merge.fragment.log.len() < self.expected || self.all_written > self.now {
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
        let lines = self.timing.timing.cache.line_px.map(|size| size as usize);
        let [cycles, shades] = resolve_cycles(self.timing, self.scene, [line % across * lines[0], line / across * lines[1]], lines);
        let mut written = self.now + cycles + u64::from(self.timing.resolve.latency);
        if shades > 0 {
            self.merge.to_shade.push_back((self.now, shades * u64::from(self.timing.shade.interval)));
            written += u64::from(self.timing.shade.latency);
        }
        self.end = self.end.max(written + 1 + self.latency);
        Act::Take(cycles)
    }

    fn shade(&mut self) -> Act {
        self.merge.shade(self.now)
    }

    fn tick(&mut self) {
        let now = self.now;
        self.setup.tick();
        turn(self, now, |m| &mut m.fill.raster, Self::raster);
        turn(self, now, |m| &mut m.fill.gauss, Self::gauss);
        self.cache();
        self.lines.send(now, self.latency, &self.written);
        turn(self, now, |m| &mut m.merge.fragment, Self::fragment);
        self.read_lines();
        turn(self, now, |m| &mut m.resolve, Self::resolve);
        turn(self, now, |m| &mut m.merge.shade, Self::shade);
        self.setup.end_tick();
        self.fill.end_tick();
        self.looked_up.tick();
        self.now += 1;
    }

    fn is_done(&self) -> bool {
        let [across, down] = self.lines_across_and_down();
        self.resolve.log.len() == across * down
            && self.setup.is_done()
            && self.fill.is_done(self.now)
            && self.looking.is_none()
            && self.looked_up.items.is_empty()
            && self.merge.is_done(self.now)
            && self.merge.fragment.log.len() == self.expected
            && self.resolve.is_idle(self.now)
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
    let Machine { setup, fill, cache, lines, looked_up, merge, resolve, now, .. } = machine;
    Ticked {
        total: now,
        lookups: lines.lookups,
        slots: [&fill.raster, &fill.gauss].map(|unit| unit.log.len() as u64),
        units: vec![
            setup.fetch.before(setup.records),
            setup.project.before(setup.projected),
            setup.ellipse.before(setup.ellipses),
            fill.raster.before(fill.slots),
            fill.gauss.before(fill.weighted),
            cache.before(looked_up),
            merge.fragment,
            merge.shade,
            resolve,
        ],
    }
}

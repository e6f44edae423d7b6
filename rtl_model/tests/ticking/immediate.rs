//! What does the immediate machine do in each cycle? It is ticked: in every cycle every unit tests
//! the item that it would take next.
//!
//! An event in a cycle is visible to other units in the next cycle, so their order within a cycle
//! does not matter. The exception is shading by its unit, which is ticked last.

use super::memory::{Done, LINES, Memory, Requests, WORDS};
use super::parts::{
    Act, Fill, HELD, Link, Merge, SetupUnits, Stamp, Ticked, TickedUnit, light, places, resolve,
    resolve_cycles, resolve_texels, run, stamps_of, texels_looked_up, turn,
};
use super::scene::Scene;
use rtl_model::elaboration::microarchitecture::Microarchitecture;
use rtl_model::timing::{Direction, Requester};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::ops::Range;

/// A line in the cache.
struct CacheLine {
    line: usize,
    used: u64,
    /// The stamps that looked it up.
    users: Vec<usize>,
    read: Option<Done>,
}

/// A line that is evicted, or one that is read in its place, held up until the stamps that used the
/// evicted line are written.
struct HeldUp {
    client: Requester,
    line: usize,
    stamps: Vec<usize>,
    done: Done,
}

/// State of the cache.
struct CacheState {
    sets: Vec<Vec<CacheLine>>,
    ways: usize,
    line_bytes: u64,
    clock: u64,
    /// Evicted lines, and the stamps that had used each.
    written_back: BTreeMap<usize, Vec<usize>>,
    touched: BTreeSet<usize>,
    reads: Requests,
    /// Stamps that used the line evicted for the look-up in progress.
    before: Vec<usize>,
    held_up: Vec<HeldUp>,
    lookups: [u64; 2],
}

impl CacheState {
    /// Looks a line up for a stamp. Returns whether the look-up ends in this cycle, and the read on
    /// which the stamp depends.
    fn look_up(&mut self, now: u64, line: usize, stamp: usize) -> Option<Option<Done>> {
        let of = line % self.sets.len();
        let set = &mut self.sets[of];
        let found = set.iter().position(|way| way.line == line);
        // The least recently used line is evicted, even if the new line is delayed.
        if found.is_none() && set.len() == self.ways {
            let oldest = (0..set.len())
                .min_by_key(|way| set[*way].used)
                .expect("a way");
            let victim = set.swap_remove(oldest);
            // A stamp cannot depend on itself.
            self.before = victim
                .users
                .into_iter()
                .filter(|user| *user != stamp)
                .collect();
            self.written_back.insert(victim.line, self.before.clone());
            let stamps = self.before.clone();
            self.held_up.push(HeldUp {
                client: Requester::FrameWrite,
                line: victim.line,
                stamps,
                done: Done::default(),
            });
        }
        let must_read = found.is_none() && self.written_back.contains_key(&line);
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
            if way.users.last() != Some(&stamp) {
                way.users.push(stamp);
            }
            return Some(way.read.clone());
        }
        let mut stamps = std::mem::take(&mut self.before);
        // A line that is still to be written back cannot be read.
        stamps.extend(self.written_back.get(&line).into_iter().flatten());
        let read = must_read.then(|| {
            let done = self.reads.next();
            self.held_up.push(HeldUp {
                client: Requester::FrameRead,
                line,
                stamps,
                done: done.clone(),
            });
            done
        });
        set.push(CacheLine {
            line,
            used: self.clock,
            users: vec![stamp],
            read: read.clone(),
        });
        Some(read)
    }

    /// The bytes of a line.
    fn bytes(&self, line: usize) -> Range<u64> {
        let from = LINES + line as u64 * self.line_bytes;
        from..from + self.line_bytes
    }

    /// Issues the requests that are no longer held up.
    fn send(&mut self, now: u64, memory: &mut Memory, written: &[Option<u64>]) {
        let is_held_up = |of: &HeldUp| {
            !of.stamps
                .iter()
                .all(|stamp| written[*stamp].is_some_and(|at| at <= now))
        };
        for HeldUp {
            client, line, done, ..
        } in self
            .held_up
            .extract_if(.., |of| !is_held_up(of))
            .collect::<Vec<_>>()
        {
            let direction = if client == Requester::FrameRead {
                Direction::Read
            } else {
                Direction::Write
            };
            memory.request(now, client, direction, self.bytes(line), &done);
        }
    }

    fn holds(&self, line: usize) -> bool {
        self.sets[line % self.sets.len()]
            .iter()
            .any(|way| way.line == line)
    }
}

/// A stamp in the cache unit.
struct Looking {
    stamp: Stamp,
    next: usize,
    reads: Vec<Done>,
}

/// The machine.
struct ImmediateMachine<'a> {
    timing: &'a Microarchitecture,
    scene: &'a Scene,
    memory: Memory,
    now: u64,
    setup: SetupUnits<'a>,
    /// Number of stamps that will reach the fragment unit.
    expected: usize,
    fill: Fill,
    cache: TickedUnit,
    lines: CacheState,
    looking: Option<Looking>,
    looked_up: Link<(Stamp, Vec<Done>)>,
    merge: Merge,
    /// Cycle in which each stamp is written, and the cycle in which all taken stamps are.
    written: Vec<Option<u64>>,
    taken: usize,
    all_written: u64,
    resolve: Vec<TickedUnit>,
    /// Line for whose light resolve stalls: when it will be written without further stalls.
    unwritten: Option<(u64, Range<u64>)>,
    /// Cycle in which resolve took it, and its duration without stalls.
    resolve_begun: [u64; 2],
    /// Read of each line of the picture, if it has one; known when resolve begins. Then the reads
    /// that are still to be issued.
    line_reads: Option<Vec<Option<Done>>>,
    to_read: VecDeque<usize>,
    reads: Requests,
    words: Requests,
}

/// A whole splat.
const ALL: [[usize; 2]; 2] = [[0; 2], [usize::MAX; 2]];

impl<'a> ImmediateMachine<'a> {
    fn new(timing: &'a Microarchitecture, scene: &'a Scene) -> Self {
        let t = &timing.timing;
        let stamps = (0..scene.splats.len()).flat_map(|splat| stamps_of(timing, scene, splat, ALL));
        let expected = stamps.filter(|stamp| !stamp.pixels.is_empty()).count();
        ImmediateMachine {
            timing,
            scene,
            memory: Memory::new(t.memory),
            now: 0,
            setup: SetupUnits::new(timing, scene),
            expected,
            fill: Fill::new(timing),
            cache: TickedUnit::new("cache", 1),
            lines: CacheState {
                sets: (0..t.cache.lines / t.cache.ways)
                    .map(|_| Vec::new())
                    .collect(),
                ways: t.cache.ways as usize,
                line_bytes: timing.line_bytes.into(),
                clock: 0,
                written_back: BTreeMap::new(),
                touched: BTreeSet::new(),
                reads: Requests::new(t.cache.misses),
                before: Vec::new(),
                held_up: Vec::new(),
                lookups: [0; 2],
            },
            looking: None,
            looked_up: Link::new(places(timing.cache)),
            merge: Merge::new(timing, scene),
            written: vec![None; expected],
            taken: 0,
            all_written: 0,
            resolve: TickedUnit::each("resolve", timing.resolve.units),
            unwritten: None,
            resolve_begun: [0; 2],
            line_reads: None,
            to_read: VecDeque::new(),
            reads: Requests::new(t.memory.outstanding),
            words: Requests::new(u32::MAX),
        }
    }

    fn raster(&mut self) -> Act {
        self.fill.raster(self.now, self.setup.done(), |splat| {
            Some(stamps_of(self.timing, self.scene, *splat, ALL))
        })
    }

    fn gauss(&mut self) -> Act {
        self.fill.gauss(self.now)
    }

    /// Counts its own cycles: looking up a line is work, waiting for a read is a stall.
    fn cache(&mut self) {
        let account = &mut self.cache.instances[0].account;
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
            self.looking = Some(Looking {
                stamp: self.fill.weighted.pop(),
                next: 0,
                reads: Vec::new(),
            });
            self.cache.instances[0].items += 1;
            self.cache.log.push(self.now);
        }
        let account = &mut self.cache.instances[0].account;
        let looking = self.looking.as_mut().expect("a stamp");
        let line = looking.stamp.lines[looking.next];
        let Some(read) = self.lines.look_up(self.now, line, looking.stamp.number) else {
            account.memory += 1;
            return;
        };
        account.busy += 1;
        looking.reads.extend(read);
        looking.next += 1;
        if looking.next == looking.stamp.lines.len() {
            let Looking { stamp, reads, .. } = self.looking.take().expect("a stamp");
            self.looked_up.items.push_back((
                self.now + u64::from(self.timing.cache.latency),
                (stamp, reads),
            ));
        }
    }

    fn fragment(&mut self) {
        let first = self.looked_up.front(self.now);
        let reason = match first {
            None => Act::Starve,
            Some((_, reads)) if !reads.iter().all(|read| read.is_done(self.now)) => {
                Act::StallOnMemory
            }
            Some(_) => Act::Take(1),
        };
        if self
            .merge
            .fragment(self.now, first.map(|(stamp, _)| stamp), reason)
        {
            self.looked_up.pop();
            self.taken += 1;
        }
        self.note_written();
    }

    fn note_written(&mut self) {
        for (stamp, written) in self.merge.written.drain(..) {
            self.all_written = self.all_written.max(written);
            self.written[stamp.number] = Some(written);
        }
    }

    fn lines_across_and_down(&self) -> [usize; 2] {
        let [columns, rows] = self.timing.timing.cache.line_px;
        [
            self.scene.width.div_ceil(columns) as usize,
            self.scene.height.div_ceil(rows) as usize,
        ]
    }

    /// Issues resolve's reads once the last stamp is written, in parallel with resolve itself.
    fn read_lines(&mut self) {
        if self.taken < self.expected || self.merge.is_waiting() || self.all_written > self.now {
            return;
        }
        let [across, down] = self.lines_across_and_down();
        let reads = self.line_reads.get_or_insert_with(|| {
            self.to_read = (0..across * down)
                .filter(|line| self.lines.touched.contains(line) && !self.lines.holds(*line))
                .collect();
            let mut reads = vec![None; across * down];
            self.to_read
                .iter()
                .for_each(|line| reads[*line] = Some(Done::default()));
            reads
        });
        while self.reads.is_free(self.now)
            && let Some(line) = self.to_read.pop_front()
        {
            let done = self.reads.next();
            self.memory.request(
                self.now,
                Requester::FrameRead,
                Direction::Read,
                self.lines.bytes(line),
                &done,
            );
            reads[line] = Some(done);
        }
    }

    fn resolve_reason(&self, line: usize) -> Act {
        let [across, down] = self.lines_across_and_down();
        match &self.line_reads {
            None => Act::Starve,
            Some(_) if line == across * down => Act::Starve,
            Some(reads)
                if reads[line]
                    .as_ref()
                    .is_some_and(|read| !read.is_done(self.now)) =>
            {
                Act::StallOnMemory
            }
            Some(_) => Act::Take(1),
        }
    }

    fn resolve(&mut self) {
        let line = self.resolve[0].log.len();
        let [across, _] = self.lines_across_and_down();
        let size = self.timing.timing.cache.line_px.map(|size| size as usize);
        let corner = [line % across * size[0], line / across * size[1]];
        let reason = self.resolve_reason(line);
        let (cycles, shades) = if reason == Act::Take(1) {
            resolve_cycles(self.timing, self.scene, corner, size)
        } else {
            (Vec::new(), 0)
        };
        let mirror = self.merge.mirror.as_mut().filter(|_| shades > 0);
        let is_held = mirror.is_some();
        let held: Vec<u64> = if is_held { vec![HELD] } else { cycles.clone() };
        if !resolve(&mut self.resolve, self.now, reason, &held) {
            return;
        }
        let mut written = self.now
            + cycles.iter().max().expect("a unit")
            + u64::from(self.timing.resolve.latency);
        match mirror {
            Some(mirror) => {
                mirror.queue_resolve(self.now, resolve_texels(self.scene, corner, size))
            }
            None => self
                .merge
                .to_shade
                .extend(light(self.timing, self.now, shades)),
        }
        if shades > 0 {
            written += u64::from(self.timing.shade.latency);
        }
        let [width, height] = [self.scene.width, self.scene.height].map(|size| size as usize);
        let inside = size[0].min(width - corner[0]) * size[1].min(height - corner[1]);
        let [from, bytes] = [line * size[0] * size[1], inside]
            .map(|words| words as u64 * u64::from(self.timing.frame_bytes));
        let words = WORDS + from..WORDS + from + bytes;
        if is_held {
            // Known when the last texels have arrived.
            self.resolve_begun = [self.now, cycles[0]];
            self.unwritten = Some((written, words));
            return;
        }
        self.memory.request(
            written,
            Requester::FrameWrite,
            Direction::Write,
            words,
            &self.words.next(),
        );
    }

    fn shade(&mut self) -> Act {
        if self.merge.mirror.is_none() {
            return self.merge.shade(self.now);
        }
        let (act, waited) = self.merge.mirror(self.now, &mut self.memory);
        if let Some(waited) = waited
            && let Some((written, words)) = self.unwritten.take()
        {
            let [begun, cycles] = self.resolve_begun;
            self.resolve[0].instances[0].until = begun + cycles + waited;
            self.memory.request(
                written + waited,
                Requester::FrameWrite,
                Direction::Write,
                words,
                &self.words.next(),
            );
        }
        act
    }

    fn tick(&mut self) {
        let now = self.now;
        self.merge.begin_tick(now);
        self.note_written();
        self.setup.tick(&mut self.memory);
        turn(self, now, |m| &mut m.fill.raster, Self::raster);
        turn(self, now, |m| &mut m.fill.gauss, Self::gauss);
        self.cache();
        self.lines.send(now, &mut self.memory, &self.written);
        self.fragment();
        self.read_lines();
        self.resolve();
        turn(self, now, |m| &mut m.merge.shade, Self::shade);
        self.memory.tick(now);
        self.setup.end_tick();
        self.fill.end_tick();
        self.looked_up.tick();
        self.now += 1;
    }

    fn is_done(&mut self) -> bool {
        let [across, down] = self.lines_across_and_down();
        self.resolve[0].log.len() == across * down
            && self.setup.is_done()
            && self.fill.is_done(self.now)
            && self.looking.is_none()
            && self.looked_up.items.is_empty()
            && self.merge.is_done(self.now)
            && self.taken == self.expected
            && self.resolve.iter().all(|unit| unit.is_idle(self.now))
            && self.words.are_all_done(self.now)
    }
}

/// Draws a scene, cycle by cycle.
pub fn draw(timing: &Microarchitecture, scene: &Scene) -> Ticked {
    let mut machine = ImmediateMachine::new(timing, scene);
    let total = run(
        &mut machine,
        ImmediateMachine::tick,
        ImmediateMachine::is_done,
    );
    let ImmediateMachine {
        memory,
        setup,
        fill,
        cache,
        lines,
        looked_up,
        merge,
        resolve,
        ..
    } = machine;
    let stamps = fill.taken();
    let texels = texels_looked_up([
        setup.texels.as_ref(),
        merge.mirror.as_ref().map(|mirror| &mirror.texels),
    ]);
    let (setup, shade) = setup.units();
    let (fragment, of_fragments) = merge.units();
    let units = [
        setup,
        fill.units(),
        vec![cache.before(looked_up)],
        fragment,
        vec![shade.unwrap_or(of_fragments)],
        resolve,
    ]
    .concat();
    Ticked {
        total,
        units,
        lookups: lines.lookups,
        texels,
        stamps,
        traffic: memory.traffic,
    }
}

//! What is a ticking machine made of? Units, FIFOs with credits, stamps; and the units that both
//! organisations have.

use super::memory::{Done, MAP, Memory, Requests, SPLATS, Traffic};
use super::scene::{Asks, Scene};
use rtl_model::elaboration::microarchitecture::{Microarchitecture, Pace};
use rtl_model::timing::{Account, Direction, Requester};
use rtl_model::work::{Event, Fate};
use std::collections::{BTreeMap, VecDeque};
use std::ops::RangeInclusive;

/// One of several side by side.
#[derive(Clone, Debug, Default)]
pub struct Side {
    pub items: u64,
    pub account: Account,
    /// The first cycle in which nothing holds it.
    pub until: u64,
}

/// A unit.
#[derive(Clone, Debug)]
pub struct Unit {
    pub name: &'static str,
    /// How many of the same name come before its sides.
    pub others: u32,
    pub sides: Vec<Side>,
    pub log: Vec<u64>,
    /// How full it was behind it.
    pub occupancy: Vec<u64>,
}

/// What happened.
#[derive(Clone, Debug)]
pub struct Ticked {
    pub total: u64,
    pub units: Vec<Unit>,
    pub lookups: [u64; 2],
    /// Of the caches of the map of surroundings.
    pub texels: [u64; 2],
    /// All that the raster took, and those that kept a pixel.
    pub stamps: [u64; 2],
    pub traffic: Traffic,
}

/// What a free unit does in a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Act {
    Starve,
    Wait,
    Block,
    /// Takes an item that holds it for so many cycles.
    Take(u64),
}

impl Unit {
    pub fn new(name: &'static str, sides: u32) -> Self {
        Unit {
            name,
            others: 0,
            sides: vec![Side::default(); sides as usize],
            log: Vec::new(),
            occupancy: Vec::new(),
        }
    }

    /// So many of them, each of one side.
    pub fn each(name: &'static str, count: u32) -> Vec<Unit> {
        (0..count)
            .map(|others| Unit {
                others,
                ..Unit::new(name, 1)
            })
            .collect()
    }

    /// That of an engine, each of which has as many.
    pub fn of_engine(self, engine: u32, each: u32) -> Self {
        Unit {
            others: engine * each + self.others,
            ..self
        }
    }

    /// In the end it takes over what its FIFO counted.
    pub fn before<T>(self, link: Link<T>) -> Self {
        Unit {
            occupancy: link.occupancy,
            ..self
        }
    }

    /// Whose turn it is.
    pub fn turn(&self) -> usize {
        self.log.len() % self.sides.len()
    }

    pub fn is_idle(&self, now: u64) -> bool {
        self.sides.iter().all(|side| side.until <= now)
    }

    pub fn is_free(&self, now: u64) -> bool {
        self.sides[self.turn()].until <= now
    }

    pub fn take(&mut self, now: u64, cycles: u64) {
        let turn = self.turn();
        self.sides[turn].until = now + cycles;
        self.sides[turn].items += 1;
        self.log.push(now);
    }

    /// Counts the cycle. The side whose turn it is would have taken an item but for a reason.
    pub fn count(&mut self, now: u64, reason: Act) {
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

/// A FIFO and the pipeline before it: items with the cycle in which they are here. Places are
/// credits.
pub struct Link<T> {
    pub items: VecDeque<(u64, T)>,
    pub credits: u32,
    /// Given back in this cycle.
    pub returned: u32,
    /// From when on each place is free again that has an item which does not come out.
    pub vanishing: VecDeque<u64>,
    /// How often so many places were taken when another one was, with that.
    pub occupancy: Vec<u64>,
}

impl<T> Link<T> {
    pub fn new(places: u32) -> Self {
        Link {
            items: VecDeque::new(),
            credits: places,
            returned: 0,
            vanishing: VecDeque::new(),
            occupancy: vec![0; places as usize + 1],
        }
    }

    pub fn has_room(&self) -> bool {
        self.credits > 0
    }

    pub fn reserve(&mut self) {
        self.credits = self.credits.checked_sub(1).expect("a place");
        let taken = self.occupancy.len() - 1 - self.credits as usize - self.vanishing.len();
        self.occupancy[taken] += 1;
    }

    /// What does not come out has a place until then.
    pub fn vanish(&mut self, free_again: u64) {
        self.credits = self.credits.checked_sub(1).expect("a place");
        self.vanishing.push_back(free_again);
    }

    /// Before anything happens in a cycle.
    pub fn begin_tick(&mut self, now: u64) {
        while self
            .vanishing
            .front()
            .is_some_and(|free_again| *free_again <= now)
        {
            self.vanishing.pop_front();
            self.credits += 1;
        }
    }

    pub fn push(&mut self, here: u64, item: T) {
        self.reserve();
        self.items.push_back((here, item));
    }

    pub fn front(&self, now: u64) -> Option<&T> {
        self.items
            .front()
            .filter(|(here, _)| *here <= now)
            .map(|(_, item)| item)
    }

    pub fn pop(&mut self) -> T {
        self.returned += 1;
        self.items.pop_front().expect("an item").1
    }

    pub fn tick(&mut self) {
        self.credits += std::mem::take(&mut self.returned);
    }
}

/// The pixels of a stamp.
#[derive(Clone, Debug, Default)]
pub struct Stamp {
    /// Its pixels that are not faint, as places in the picture.
    pub pixels: Vec<usize>,
    /// Those that are.
    pub faint: Vec<usize>,
    /// All that it tests.
    pub tested: Vec<usize>,
    /// Those that stop with it.
    pub stops: Vec<usize>,
    /// Those in which fragments merge, and how many are shaded for that.
    pub merged: Vec<(usize, u64)>,
    /// What they look up, one after the other.
    pub texels: Vec<Option<[usize; 2]>>,
    /// Lines in the order in which pixels meet them.
    pub lines: Vec<usize>,
    /// Among those that reach the fragment unit.
    pub number: usize,
    /// Of a binned machine's tiles, those without an entry left out.
    pub tile: usize,
}

/// The stamps of a splat's part from one pixel to another.
pub fn stamps_of(
    timing: &Microarchitecture,
    scene: &Scene,
    splat: usize,
    [first, last]: [[usize; 2]; 2],
) -> VecDeque<Stamp> {
    let place = splat;
    let splat = &scene.splats[splat];
    if splat.fate != Fate::Drawn {
        return VecDeque::new();
    }
    let from = [splat.columns[0], splat.rows[0]].map(usize::from);
    let to = [splat.columns[1], splat.rows[1]].map(usize::from);
    let [left_most, top_most] = [0, 1].map(|axis| first[axis].max(from[axis]));
    let [right_most, bottom_most] = [0, 1].map(|axis| last[axis].min(to[axis]));
    let lanes = timing.timing.raster.lanes.map(|lanes| lanes as usize);
    let [line_width, line_height] = timing.timing.cache.line_px.map(|size| size as usize);
    let lines_across = (scene.width as usize).div_ceil(line_width);
    let mut stamps = VecDeque::new();
    for top in (top_most..=bottom_most).step_by(lanes[1]) {
        for left in (left_most..=right_most).step_by(lanes[0]) {
            let mut stamp = Stamp::default();
            for y in top..(bottom_most + 1).min(top + lanes[1]) {
                for x in left..(right_most + 1).min(left + lanes[0]) {
                    stamp.tested.push(y * scene.width as usize + x);
                    let Some(event) = splat.pixel(x - from[0], y - from[1]) else {
                        continue;
                    };
                    let pixel = y * scene.width as usize + x;
                    if event == Event::Faint {
                        stamp.faint.push(pixel);
                        continue;
                    }
                    stamp.pixels.push(pixel);
                    if event == Event::Stopped || event == Event::MergedAndStopped {
                        stamp.stops.push(pixel);
                    }
                    if event == Event::MergedAndStopped {
                        stamp.merged.push((pixel, 0));
                    }
                    if let Event::Merged(shades) = event {
                        stamp.merged.push((pixel, u64::from(shades)));
                        stamp.texels.extend(
                            (0..shades.into())
                                .map(|nth| scene.texel(Asks::Merge(place, pixel), nth)),
                        );
                    }
                    let line = y / line_height * lines_across + x / line_width;
                    if !stamp.lines.contains(&line) {
                        stamp.lines.push(line);
                    }
                }
            }
            stamps.push_back(stamp);
        }
    }
    stamps
}

/// Places behind a unit.
pub fn places(pace: Pace) -> u32 {
    (pace.fifo + pace.latency.div_ceil(pace.interval)) * pace.units
}

/// What colours take; anything where splats have none to work out.
fn colour_pace(timing: &Microarchitecture, scene: &Scene) -> Pace {
    timing
        .colour
        .get(usize::from(scene.harmonics.max(1)) - 1)
        .map_or(timing.ellipse, |colour| colour.pace)
}

/// Ticks a machine until it is done; says for how many cycles.
pub fn run<M>(machine: &mut M, tick: fn(&mut M), is_done: fn(&mut M) -> bool) -> u64 {
    let mut cycles = 0;
    while !is_done(machine) {
        tick(machine);
        cycles += 1;
        assert!(cycles < 1_000_000_000, "it is stuck");
    }
    cycles
}

/// Every side of a unit gets its chance.
pub fn turn<M>(
    machine: &mut M,
    now: u64,
    unit: impl Fn(&mut M) -> &mut Unit,
    mut act: impl FnMut(&mut M) -> Act,
) {
    let mut reason = Act::Starve;
    for _ in 0..unit(machine).sides.len() {
        if !unit(machine).is_free(now) {
            break;
        }
        reason = act(machine);
        let Act::Take(cycles) = reason else { break };
        unit(machine).take(now, cycles);
    }
    unit(machine).count(now, reason);
}

/// The cache of a map of surroundings, where it has one: sets of lines, the one used longest ago
/// first.
pub struct Texels {
    sets: Vec<Vec<usize>>,
    ways: usize,
    line_texels: [usize; 2],
    side: usize,
    line_bytes: u64,
    pub lookups: [u64; 2],
    /// What the fragment waits for that shade would take next, once it has looked up.
    awaited: Option<Vec<Done>>,
}

impl Texels {
    pub fn new(timing: &Microarchitecture, scene: &Scene) -> Option<Self> {
        let (shape, side) = (timing.map?, scene.mirrored?);
        let cache = shape.cache?;
        Some(Texels {
            sets: (0..cache.lines / cache.ways).map(|_| Vec::new()).collect(),
            ways: cache.ways as usize,
            line_texels: cache.line_texels.map(|texels| texels as usize),
            side,
            line_bytes: u64::from(cache.line_texels[0] * cache.line_texels[1] * shape.texel_bytes),
            lookups: [0; 2],
            awaited: None,
        })
    }

    /// Whether the fragment that shade looks at in this cycle has its texels; it looks them up when
    /// it is looked at first.
    fn are_here(&mut self, now: u64, texel: Option<[usize; 2]>, memory: &mut Memory) -> bool {
        if self.awaited.is_none() {
            let mut lines = Vec::new();
            for [column, row] in texel
                .iter()
                .flat_map(|[x, y]| [[*x, *y], [x + 1, *y], [*x, y + 1], [x + 1, y + 1]])
            {
                let line = row / self.line_texels[1] * (self.side / self.line_texels[0])
                    + column / self.line_texels[0];
                if !lines.contains(&line) {
                    lines.push(line);
                }
            }
            self.awaited = Some(
                lines
                    .into_iter()
                    .filter_map(|line| self.look_up(now, line, memory))
                    .collect(),
            );
        }
        self.awaited.iter().flatten().all(|done| done.has_come(now))
    }

    fn look_up(&mut self, now: u64, line: usize, memory: &mut Memory) -> Option<Done> {
        let of = line % self.sets.len();
        let set = &mut self.sets[of];
        self.lookups[0] += 1;
        if let Some(found) = set.iter().position(|other| *other == line) {
            let line = set.remove(found);
            set.push(line);
            self.lookups[1] += 1;
            return None;
        }
        if set.len() == self.ways {
            set.remove(0);
        }
        set.push(line);
        let (done, from) = (Done::default(), MAP + line as u64 * self.line_bytes);
        memory.ask(
            now,
            Requester::Environment,
            Direction::Read,
            from..from + self.line_bytes,
            &done,
        );
        Some(done)
    }
}

/// Fetch, project and ellipse; and shade where splats are lit before they are drawn.
pub struct SetUp<'a> {
    timing: &'a Microarchitecture,
    scene: &'a Scene,
    now: u64,
    fetch: Unit,
    requests: Requests,
    records: Link<usize>,
    project: Unit,
    projected: Link<usize>,
    ellipse: Unit,
    ellipses: Link<usize>,
    colour: Unit,
    coloured: Link<usize>,
    shade: Unit,
    lit: Link<usize>,
    pub texels: Option<Texels>,
    /// The map that the chip has all of, once it is asked for.
    map: Option<Done>,
}

impl<'a> SetUp<'a> {
    pub fn new(timing: &'a Microarchitecture, scene: &'a Scene) -> Self {
        SetUp {
            timing,
            scene,
            now: 0,
            fetch: Unit::new("fetch", 1),
            requests: Requests::new(timing.timing.memory.outstanding),
            records: Link::new(places(timing.fetch)),
            project: Unit::new("project", timing.project.units),
            projected: Link::new(places(timing.project)),
            ellipse: Unit::new("ellipse", timing.ellipse.units),
            ellipses: Link::new(places(timing.ellipse)),
            colour: Unit::new("colour", colour_pace(timing, scene).units),
            coloured: Link::new(places(colour_pace(timing, scene))),
            shade: Unit::new(
                if timing.lights_setup {
                    "setup-shade"
                } else {
                    "shade"
                },
                timing.shade.units,
            ),
            lit: Link::new(places(timing.shade)),
            texels: Texels::new(timing, scene),
            map: None,
        }
    }

    /// Whether the chip has the map, if it is to have all of it.
    fn has_map(&mut self, memory: &mut Memory) -> bool {
        let Some(side) = self
            .scene
            .mirrored
            .filter(|_| self.timing.map.unwrap().cache.is_none())
        else {
            return true;
        };
        let now = self.now;
        let done = self.map.get_or_insert_with(|| {
            let done = Done::default();
            let bytes = (side * side) as u64 * u64::from(self.timing.map.unwrap().texel_bytes);
            memory.ask(
                now,
                Requester::Environment,
                Direction::Read,
                MAP..MAP + bytes,
                &done,
            );
            done
        });
        done.has_come(now)
    }

    /// The bursts that a record lies in.
    fn bursts(&self, record: usize) -> RangeInclusive<usize> {
        let of_splat = match (self.scene.shared_axes, self.colours()) {
            (true, _) => self.timing.voxel_bytes.unwrap(),
            (false, true) => self.timing.colour[usize::from(self.scene.harmonics) - 1].splat_bytes,
            (false, false) => self.timing.splat_bytes,
        };
        let [bytes, burst] =
            [of_splat, self.timing.timing.memory.burst_bytes].map(|bytes| bytes as usize);
        record * bytes / burst..=((record + 1) * bytes - 1) / burst
    }

    fn fetch(&mut self, memory: &mut Memory) -> Act {
        let (record, has_map) = (self.fetch.log.len(), self.has_map(memory));
        if record == self.scene.splats.len() {
            return Act::Starve;
        }
        if !has_map {
            return Act::Wait;
        }
        let last = *self.bursts(record).end();
        if last >= self.requests.asked.len() && !self.requests.is_free(self.now) {
            return Act::Wait;
        }
        if !self.records.has_room() {
            return Act::Block;
        }
        // All bursts of a record go in one cycle, so that more can be on their way than may be, if
        // a record has more.
        let burst = u64::from(self.timing.timing.memory.burst_bytes);
        for nth in self.requests.asked.len()..=last {
            let from = SPLATS + nth as u64 * burst;
            memory.ask(
                self.now,
                Requester::Splats,
                Direction::Read,
                from..from + burst,
                &self.requests.next(),
            );
        }
        self.records.push(self.now + 1, record);
        Act::Take(1)
    }

    fn project(&mut self) -> Act {
        let Some(&record) = self.records.front(self.now) else {
            return Act::Starve;
        };
        if !self.requests.asked[self.bursts(record)]
            .iter()
            .all(|burst| burst.has_come(self.now))
        {
            return Act::Wait;
        }
        let ends = matches!(
            self.scene.splats[record].fate,
            Fate::Near | Fate::Outside | Fate::Transparent
        );
        if !ends && !self.projected.has_room() {
            return Act::Block;
        }
        self.records.pop();
        if !ends {
            self.projected
                .push(self.now + u64::from(self.timing.project.latency), record);
        }
        Act::Take(self.timing.project.interval.into())
    }

    fn ellipse(&mut self) -> Act {
        let Some(&record) = self.projected.front(self.now) else {
            return Act::Starve;
        };
        let ends = self.scene.splats[record].fate != Fate::Drawn;
        if !ends && !self.ellipses.has_room() {
            return Act::Block;
        }
        self.projected.pop();
        if !ends {
            self.ellipses
                .push(self.now + u64::from(self.timing.ellipse.latency), record);
        }
        Act::Take(self.timing.ellipse.interval.into())
    }

    /// Whether splats have harmonics, and the machine works their colours out.
    fn colours(&self) -> bool {
        self.scene.harmonics > 0 && !self.timing.colour.is_empty()
    }

    fn colour(&mut self) -> Act {
        let Some(&record) = self.ellipses.front(self.now) else {
            return Act::Starve;
        };
        if !self.coloured.has_room() {
            return Act::Block;
        }
        self.ellipses.pop();
        let pace = colour_pace(self.timing, self.scene);
        self.coloured
            .push(self.now + u64::from(pace.latency), record);
        Act::Take(pace.interval.into())
    }

    fn shade(&mut self, memory: &mut Memory) -> Act {
        let from = if self.colours() {
            &mut self.coloured
        } else {
            &mut self.ellipses
        };
        let Some(&record) = from.front(self.now) else {
            return Act::Starve;
        };
        if let Some(texels) = &mut self.texels
            && !texels.are_here(self.now, self.scene.texel(Asks::Splat(record), 0), memory)
        {
            return Act::Wait;
        }
        if !self.lit.has_room() {
            return Act::Block;
        }
        from.pop();
        self.texels
            .iter_mut()
            .for_each(|texels| texels.awaited = None);
        self.lit
            .push(self.now + u64::from(self.timing.shade.latency), record);
        Act::Take(self.timing.shade.interval.into())
    }

    /// What the next unit takes from.
    pub fn done(&mut self) -> &mut Link<usize> {
        match (self.scene.preshaded, self.colours()) {
            (true, _) => &mut self.lit,
            (false, true) => &mut self.coloured,
            (false, false) => &mut self.ellipses,
        }
    }

    pub fn tick(&mut self, memory: &mut Memory) {
        let now = self.now;
        turn(self, now, |m| &mut m.fetch, |m| m.fetch(memory));
        turn(self, now, |m| &mut m.project, Self::project);
        turn(self, now, |m| &mut m.ellipse, Self::ellipse);
        if self.colours() {
            turn(self, now, |m| &mut m.colour, Self::colour);
        }
        if self.scene.preshaded {
            turn(self, now, |m| &mut m.shade, |m| m.shade(memory));
        }
    }

    /// After all that happens in a cycle.
    pub fn end_tick(&mut self) {
        self.records.tick();
        self.projected.tick();
        self.ellipses.tick();
        self.coloured.tick();
        self.lit.tick();
        self.now += 1;
    }

    pub fn is_done(&self) -> bool {
        let waiting = [
            &self.records,
            &self.projected,
            &self.ellipses,
            &self.coloured,
            &self.lit,
        ]
        .map(|link| link.items.len());
        self.fetch.log.len() == self.scene.splats.len()
            && waiting == [0; 5]
            && [
                &self.fetch,
                &self.project,
                &self.ellipse,
                &self.colour,
                &self.shade,
            ]
            .iter()
            .all(|unit| unit.is_idle(self.now))
    }

    /// Fetch, project and ellipse, colour, if splats have any to be worked out, and a shade of its
    /// own; and shade, if it is the only one.
    pub fn units(self) -> (Vec<Unit>, Option<Unit>) {
        let colours = self.colours();
        let mut units = vec![
            self.fetch.before(self.records),
            self.project.before(self.projected),
            self.ellipse.before(self.ellipses),
        ];
        units.extend(colours.then(|| self.colour.before(self.coloured)));
        let shade = self.scene.preshaded.then(|| self.shade.before(self.lit));
        if self.timing.lights_setup {
            units.extend(shade);
            return (units, None);
        }
        (units, shade)
    }
}

/// Raster and gauss.
pub struct Fill {
    latencies: [u64; 2],
    pub raster: Unit,
    /// What is left of the footprint that the raster looks at, and whether it took any of it.
    pub left: VecDeque<Stamp>,
    pub begun: bool,
    /// From which cycle on each pixel is left out; where pixels never are, none.
    pub stopped: Vec<u64>,
    /// Footprints of which nothing was left.
    pub dropped: u64,
    /// Stamps so far that go on to the fragment unit.
    numbered: usize,
    /// Stamps with a weight: those that kept some of it, and those that did not, since this was
    /// asked last.
    pub decided: [usize; 2],
    stamps: Link<Stamp>,
    pub gauss: Unit,
    pub weighted: Link<Stamp>,
}

impl Fill {
    pub fn new(timing: &Microarchitecture) -> Self {
        Fill {
            latencies: [timing.raster.latency.into(), timing.gauss.latency.into()],
            raster: Unit::new("raster", 1),
            left: VecDeque::new(),
            begun: false,
            stopped: Vec::new(),
            dropped: 0,
            numbered: 0,
            decided: [0; 2],
            stamps: Link::new(places(timing.raster)),
            gauss: Unit::new("gauss", 1),
            weighted: Link::new(places(timing.gauss)),
        }
    }

    /// The same for a picture of so many pixels, which is told when each of them is left out.
    pub fn leaving_out(self, pixels: usize) -> Self {
        Fill {
            stopped: vec![u64::MAX; pixels],
            ..self
        }
    }

    /// Passes over stamps of which every pixel has stopped.
    pub fn pass_over(&mut self, now: u64) {
        let is_left = |pixel: &usize| self.stopped.get(*pixel).is_none_or(|from| *from > now);
        while self
            .left
            .front()
            .is_some_and(|stamp| !stamp.tested.iter().any(is_left))
        {
            let stamp = self.left.pop_front().expect("a stamp");
            self.decided[1] += usize::from(!stamp.pixels.is_empty());
        }
    }

    /// Looks at a footprint, of which `stamps` says which it has, unless they are on their way.
    pub fn raster<T>(
        &mut self,
        now: u64,
        from: &mut Link<T>,
        stamps: impl FnOnce(&T) -> Option<VecDeque<Stamp>>,
    ) -> Act {
        self.stamps.begin_tick(now);
        if self.left.is_empty() {
            self.begun = false;
            let Some(item) = from.front(now) else {
                return Act::Starve;
            };
            let Some(stamps) = stamps(item) else {
                return Act::Wait;
            };
            self.left = stamps;
        }
        self.pass_over(now);
        if self.left.is_empty() {
            // Nothing of it is left.
            from.pop();
            self.dropped += 1;
            return Act::Take(1);
        }
        let is_left = |pixel: &usize| self.stopped.get(*pixel).is_none_or(|from| *from > now);
        let is_kept = self.left[0]
            .pixels
            .iter()
            .chain(&self.left[0].faint)
            .any(is_left);
        if !self.stamps.has_room() {
            return Act::Block;
        }
        if !std::mem::replace(&mut self.begun, true) {
            from.pop();
        }
        let mut stamp = self.left.pop_front().expect("a stamp");
        let had_weight = !stamp.pixels.is_empty();
        stamp.pixels.retain(is_left);
        stamp.faint.retain(is_left);
        if had_weight {
            self.decided[usize::from(stamp.pixels.is_empty())] += 1;
        }
        if is_kept {
            stamp.number = self.numbered;
            self.numbered += usize::from(!stamp.pixels.is_empty());
            self.stamps.push(now + self.latencies[0], stamp);
        } else {
            self.stamps.vanish(now + self.latencies[0]);
        }
        Act::Take(1)
    }

    pub fn gauss(&mut self, now: u64) -> Act {
        let Some(stamp) = self.stamps.front(now) else {
            return Act::Starve;
        };
        let ends = stamp.pixels.is_empty();
        if !ends && !self.weighted.has_room() {
            return Act::Block;
        }
        let stamp = self.stamps.pop();
        if !ends {
            self.weighted.push(now + self.latencies[1], stamp);
        }
        Act::Take(1)
    }

    pub fn end_tick(&mut self) {
        self.stamps.tick();
        self.weighted.tick();
    }

    pub fn is_done(&self, now: u64) -> bool {
        let waiting = [
            self.left.len(),
            self.stamps.items.len(),
            self.weighted.items.len(),
        ];
        waiting == [0; 3] && self.raster.is_idle(now) && self.gauss.is_idle(now)
    }

    /// Stamps that the raster took, and those that kept a pixel.
    pub fn taken(&self) -> [u64; 2] {
        [
            self.raster.log.len() as u64 - self.dropped,
            self.gauss.log.len() as u64,
        ]
    }

    pub fn units(self) -> Vec<Unit> {
        vec![
            self.raster.before(self.stamps),
            self.gauss.before(self.weighted),
        ]
    }
}

/// A stamp that merges in a unit: those of its pixels that are this unit's.
struct Merging {
    number: usize,
    pixels: Vec<usize>,
    merges: u64,
    /// Fragments that shade has not taken yet, and when the last that it took is lit.
    left: u64,
    lit: u64,
}

/// A fragment unit, with what is merged beside it, the oldest first, and when that one is through:
/// known once it is lit.
struct OfPixels {
    unit: Unit,
    merging: VecDeque<Merging>,
    through: Option<u64>,
}

/// Fragment units, and the light for their merges.
pub struct Merge {
    fragment_latency: u64,
    shade_pace: Pace,
    merge: u64,
    in_flight: usize,
    hazard: u64,
    width: usize,
    columns: usize,
    units: Vec<OfPixels>,
    /// From when on each pixel can be taken again.
    pixel_free: Vec<u64>,
    pub shade: Unit,
    /// What mirrors, of shade: then fragments are shaded one by one. A machine that has it has one
    /// of each unit.
    pub mirror: Option<Mirror>,
    /// Work for shade units: from which cycle on, for how long, and for which fragment unit.
    pub to_shade: VecDeque<(u64, u64, Option<usize>)>,
    /// By number: stamps that are not written yet, for how many units they wait, and when the
    /// others have written them.
    waiting: BTreeMap<usize, (Stamp, usize, u64)>,
    /// Those that all units are through with since this was asked last, and when they are written.
    pub written: Vec<(Stamp, u64)>,
}

/// Who waits for the light of a fragment: a merge, or resolve, if it is the last that it waits for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Asked {
    Merge,
    Resolve { is_last: bool },
}

/// A shade unit that mirrors: its cache, and what it is to shade, from which cycle on, and for
/// whom.
pub struct Mirror {
    pub texels: Texels,
    pub queue: VecDeque<(u64, Option<[usize; 2]>, Asked)>,
    /// Cycles that fragments waited for texels since the last of something.
    pub waited: u64,
}

impl Mirror {
    pub fn new(timing: &Microarchitecture, scene: &Scene) -> Option<Self> {
        Texels::new(timing, scene).map(|texels| Mirror {
            texels,
            queue: VecDeque::new(),
            waited: 0,
        })
    }

    /// What resolve is to have shaded together, from a cycle on.
    pub fn ask(&mut self, here: u64, texels: Vec<Option<[usize; 2]>>) {
        let last = texels.len() - 1;
        self.queue
            .extend(texels.into_iter().enumerate().map(|(nth, texel)| {
                (
                    here,
                    texel,
                    Asked::Resolve {
                        is_last: nth == last,
                    },
                )
            }));
    }

    /// Looks at the next fragment; and for whom it is taken.
    pub fn shade(&mut self, now: u64, interval: u64, memory: &mut Memory) -> (Act, Option<Asked>) {
        let Some(&(here, texel, asked)) = self.queue.front() else {
            return (Act::Starve, None);
        };
        if here > now {
            return (Act::Starve, None);
        }
        if !self.texels.are_here(now, texel, memory) {
            self.waited += 1;
            return (Act::Wait, None);
        }
        self.texels.awaited = None;
        self.queue.pop_front();
        if asked == Asked::Merge {
            // Nobody counts these cycles.
            self.waited = 0;
        }
        (Act::Take(interval), Some(asked))
    }

    /// If the last fragment is taken that resolve waits for: for how many cycles texels were waited
    /// for.
    pub fn waited(&mut self, asked: Option<Asked>) -> Option<u64> {
        (asked == Some(Asked::Resolve { is_last: true })).then(|| std::mem::take(&mut self.waited))
    }
}

/// For ever, until somebody says otherwise.
pub const HELD: u64 = 1 << 40;

impl Merge {
    pub fn new(timing: &Microarchitecture, scene: &Scene) -> Self {
        let units = Unit::each("fragment", timing.fragment.units).into_iter();
        Merge {
            fragment_latency: timing.fragment.latency.into(),
            shade_pace: timing.shade,
            merge: timing.timing.fragment.merge.into(),
            in_flight: timing.timing.fragment.merges_in_flight.unwrap_or(1) as usize,
            hazard: timing.hazard.into(),
            width: scene.width as usize,
            columns: timing.timing.raster.lanes[0] as usize,
            units: units
                .map(|unit| OfPixels {
                    unit,
                    merging: VecDeque::new(),
                    through: None,
                })
                .collect(),
            pixel_free: vec![0; (scene.width * scene.height) as usize],
            shade: Unit::new("shade", timing.shade.units),
            to_shade: VecDeque::new(),
            mirror: Mirror::new(timing, scene),
            waiting: BTreeMap::new(),
            written: Vec::new(),
        }
    }

    /// Whose a pixel is.
    fn owner(&self, pixel: usize) -> usize {
        (pixel % self.width + pixel / self.width * self.columns) % self.units.len()
    }

    /// Before anything else happens in a cycle: what is lit is merged, in its turn.
    pub fn begin_tick(&mut self, now: u64) {
        for of in 0..self.units.len() {
            loop {
                let merge = self.merge;
                let OfPixels {
                    unit,
                    merging,
                    through,
                } = &mut self.units[of];
                let Some(first) = merging
                    .front()
                    .filter(|first| first.left == 0 && first.lit <= now)
                else {
                    break;
                };
                if *through.get_or_insert(now + first.merges * merge) > now {
                    break;
                }
                *through = None;
                let first = merging.pop_front().expect("the first");
                debug_assert!(unit.sides.len() == 1);
                first
                    .pixels
                    .iter()
                    .for_each(|pixel| self.pixel_free[*pixel] = now - 1 + self.hazard);
                self.part_written(first.number, now - 1 + self.fragment_latency);
            }
            let OfPixels { unit, merging, .. } = &mut self.units[of];
            if merging.len() >= self.in_flight {
                unit.sides[0].until = unit.sides[0].until.max(now + 1);
            }
        }
    }

    fn part_written(&mut self, number: usize, when: u64) {
        let (_, left, last) = self.waiting.get_mut(&number).expect("a stamp");
        *left -= 1;
        *last = when.max(*last);
        if *left == 0 {
            let (stamp, _, last) = self.waiting.remove(&number).expect("a stamp");
            self.written.push((stamp, last));
        }
    }

    /// Looks at the first stamp that waits, if one is here, and takes it if nothing but the units
    /// and its pixels stands in the way.
    pub fn fragment(&mut self, now: u64, stamp: Option<&Stamp>, reason: Act) -> bool {
        let has = |of: usize| {
            let pixels = |stamp: &Stamp| {
                stamp
                    .pixels
                    .iter()
                    .copied()
                    .chain(stamp.merged.iter().map(|(pixel, _)| *pixel))
                    .collect::<Vec<_>>()
            };
            stamp.is_some_and(|stamp| {
                pixels(stamp)
                    .into_iter()
                    .any(|pixel| self.owner(pixel) == of)
            })
        };
        let mut owners: Vec<usize> = (0..self.units.len()).filter(|of| has(*of)).collect();
        // The even ones first, of these those that four divides, and so on.
        owners.sort_by_key(|of| [1, 2, 4, 8].map(|bit| of & bit));
        let can = |stamp: &Stamp| {
            owners.iter().all(|of| self.units[*of].unit.is_free(now))
                && stamp
                    .pixels
                    .iter()
                    .all(|pixel| self.pixel_free[*pixel] <= now)
        };
        let taken = matches!(reason, Act::Take(_)) && stamp.is_some_and(can);
        let reason = if matches!(reason, Act::Take(_)) {
            Act::Block
        } else {
            reason
        };
        if taken {
            self.take(now, stamp.expect("a stamp"), &owners);
        }
        for (of, unit) in self.units.iter_mut().enumerate() {
            unit.unit.count(
                now,
                if owners.contains(&of) {
                    reason
                } else {
                    Act::Starve
                },
            );
        }
        taken
    }

    fn take(&mut self, now: u64, stamp: &Stamp, owners: &[usize]) {
        self.waiting
            .insert(stamp.number, (stamp.clone(), owners.len(), 0));
        for of in owners.iter().copied() {
            let pixels: Vec<usize> = stamp
                .pixels
                .iter()
                .copied()
                .filter(|pixel| self.owner(*pixel) == of)
                .collect();
            let merged: Vec<u64> = stamp
                .merged
                .iter()
                .filter(|(pixel, _)| self.owner(*pixel) == of)
                .map(|(_, shades)| *shades)
                .collect();
            self.units[of].unit.take(now, 1);
            if merged.is_empty() {
                pixels
                    .iter()
                    .for_each(|pixel| self.pixel_free[*pixel] = now + self.hazard);
                self.part_written(stamp.number, now + self.fragment_latency);
                continue;
            }
            let (left, merges) = (merged.iter().sum(), merged.len() as u64);
            pixels
                .iter()
                .for_each(|pixel| self.pixel_free[*pixel] = u64::MAX);
            match &mut self.mirror {
                Some(mirror) => mirror.queue.extend(
                    stamp
                        .texels
                        .iter()
                        .map(|texel| (now + 1, *texel, Asked::Merge)),
                ),
                None => self.to_shade.extend(
                    (0..left).map(|_| (now + 1, self.shade_pace.interval.into(), Some(of))),
                ),
            }
            self.units[of].merging.push_back(Merging {
                number: stamp.number,
                pixels,
                merges,
                left,
                lit: now + 1,
            });
        }
    }

    pub fn shade(&mut self, now: u64) -> Act {
        match self.to_shade.front() {
            Some(&(here, cycles, owner)) if here <= now => {
                self.to_shade.pop_front();
                if let Some(owner) = owner {
                    self.light(owner, now);
                }
                Act::Take(cycles)
            }
            _ => Act::Starve,
        }
    }

    /// A fragment is taken to be shaded for one of a unit's merges.
    fn light(&mut self, owner: usize, now: u64) {
        let of = self.units[owner]
            .merging
            .iter_mut()
            .find(|merging| merging.left > 0)
            .expect("who waits for light");
        (of.left, of.lit) = (of.left - 1, now + u64::from(self.shade_pace.latency));
    }

    /// Shades with texels; if that was the last that resolve waits for: for how many cycles texels
    /// were waited for.
    pub fn mirror(&mut self, now: u64, memory: &mut Memory) -> (Act, Option<u64>) {
        let Some(mirror) = &mut self.mirror else {
            return (Act::Starve, None);
        };
        let (act, asked) = mirror.shade(now, self.shade_pace.interval.into(), memory);
        let waited = mirror.waited(asked);
        if asked == Some(Asked::Merge) {
            self.light(0, now);
        }
        (act, waited)
    }

    pub fn is_done(&self, now: u64) -> bool {
        let are_idle = self
            .units
            .iter()
            .all(|of| of.merging.is_empty() && of.unit.is_idle(now));
        self.to_shade.is_empty()
            && self
                .mirror
                .as_ref()
                .is_none_or(|mirror| mirror.queue.is_empty())
            && are_idle
            && self.written.is_empty()
            && self.shade.is_idle(now)
    }

    /// Stamps that were taken and that all units are not through with.
    pub fn is_waiting(&self) -> bool {
        !self.waiting.is_empty()
    }

    pub fn units(self) -> (Vec<Unit>, Unit) {
        (
            self.units.into_iter().map(|of| of.unit).collect(),
            self.shade,
        )
    }
}

/// Shares so many fragments out among the shade units, of a resolve that begins now.
pub fn light(timing: &Microarchitecture, now: u64, shades: u64) -> Vec<(u64, u64, Option<usize>)> {
    let mut shares = vec![0; timing.shade.units as usize];
    (0..shades as usize).for_each(|nth| {
        shares[nth % timing.shade.units as usize] += u64::from(timing.shade.interval)
    });
    shares
        .into_iter()
        .filter(|share| *share > 0)
        .map(|share| (now, share, None))
        .collect()
}

/// For how long pixels hold each resolve unit, and how many fragments are shaded for that.
pub fn resolve_cycles(
    timing: &Microarchitecture,
    scene: &Scene,
    [left, top]: [usize; 2],
    [columns, rows]: [usize; 2],
) -> (Vec<u64>, u64) {
    let [width, height] = [scene.width, scene.height].map(|size| size as usize);
    let mut held = vec![0; timing.resolve.units as usize];
    let mut shades = 0;
    let shaders = u64::from(timing.shade.units);
    // So many at a time.
    let light = |fragments: u64| fragments.div_ceil(shaders) * u64::from(timing.shade.interval);
    for y in top..height.min(top + rows) {
        for x in left..width.min(left + columns) {
            let end = scene.ends[y * width + x];
            let [lit, unlit] = [end.lit, end.unlit].map(u64::from);
            // All come through one port, one after the other; light comes in its own time. Whoever
            // is free first takes the pixel.
            let first = (0..held.len())
                .min_by_key(|unit| held[*unit])
                .expect("a unit");
            held[first] += [lit + unlit, light(unlit), timing.resolve.interval.into()]
                .into_iter()
                .max()
                .expect("three");
            shades += unlit;
        }
    }
    // Who gets none looks, too.
    held.iter_mut()
        .for_each(|cycles| *cycles = light(shades).max(*cycles).max(1));
    (held, shades)
}

/// What all resolve units do in a cycle, who take what they take together.
pub fn resolve(units: &mut [Unit], now: u64, reason: Act, cycles: &[u64]) -> bool {
    let taken = matches!(reason, Act::Take(_)) && units.iter().all(|unit| unit.is_free(now));
    if taken {
        units
            .iter_mut()
            .zip(cycles)
            .for_each(|(unit, cycles)| unit.take(now, *cycles));
    }
    let reason = if matches!(reason, Act::Take(_)) {
        Act::Block
    } else {
        reason
    };
    units.iter_mut().for_each(|unit| unit.count(now, reason));
    taken
}

/// What is looked up for these pixels in the end, one after the other.
pub fn resolve_texels(
    scene: &Scene,
    [left, top]: [usize; 2],
    [columns, rows]: [usize; 2],
) -> Vec<Option<[usize; 2]>> {
    let [width, height] = [scene.width, scene.height].map(|size| size as usize);
    let rows = top..height.min(top + rows);
    let pixels = rows.flat_map(|y| (left..width.min(left + columns)).map(move |x| y * width + x));
    pixels
        .flat_map(|pixel| {
            (0..scene.ends[pixel].unlit.into()).map(move |nth| scene.texel(Asks::End(pixel), nth))
        })
        .collect()
}

/// Look-ups of several caches, and those among them that had their line.
pub fn texels_looked_up<const N: usize>(caches: [Option<&Texels>; N]) -> [u64; 2] {
    caches.into_iter().flatten().fold([0; 2], |all, cache| {
        [0, 1].map(|i| all[i] + cache.lookups[i])
    })
}

//! What is a ticked machine made of? Units, FIFOs with credits, stamps; and the units that both
//! organisations have.

use super::memory::{Done, MAP, Memory, Requests, SPLATS, Traffic};
use super::scene::{LitFragment, Scene};
use rtl_model::elaboration::microarchitecture::{Microarchitecture, Pace};
use rtl_model::timing::{Account, Direction, Requester};
use rtl_model::work::{CullReason, Event};
use std::collections::{BTreeMap, VecDeque};
use std::ops::RangeInclusive;

/// One of several parallel instances of a unit.
#[derive(Clone, Debug, Default)]
pub struct UnitInstance {
    pub items: u64,
    pub account: Account,
    /// First cycle in which it is free.
    pub until: u64,
}

/// A unit.
#[derive(Clone, Debug)]
pub struct TickedUnit {
    pub name: &'static str,
    /// Number of units of the same name before its first instance.
    pub others: u32,
    pub instances: Vec<UnitInstance>,
    pub log: Vec<u64>,
    /// Occupancy of the FIFO behind it.
    pub occupancy: Vec<u64>,
}

/// Result of a ticked frame.
#[derive(Clone, Debug)]
pub struct Ticked {
    pub total: u64,
    pub units: Vec<TickedUnit>,
    pub lookups: [u64; 2],
    /// Look-ups and hits of the caches of the map of surroundings.
    pub texels: [u64; 2],
    /// All stamps that the raster took, and those that kept a pixel.
    pub stamps: [u64; 2],
    pub traffic: Traffic,
}

/// Action of a free unit in a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Act {
    Starve,
    StallOnMemory,
    Block,
    /// Takes an item that holds it for this many cycles.
    Take(u64),
}

impl TickedUnit {
    pub fn new(name: &'static str, instances: u32) -> Self {
        TickedUnit {
            name,
            others: 0,
            instances: vec![UnitInstance::default(); instances as usize],
            log: Vec::new(),
            occupancy: Vec::new(),
        }
    }

    /// `count` units of one instance each.
    pub fn each(name: &'static str, count: u32) -> Vec<TickedUnit> {
        (0..count)
            .map(|others| TickedUnit {
                others,
                ..TickedUnit::new(name, 1)
            })
            .collect()
    }

    /// Unit of an engine; every engine has `each` of them.
    pub fn of_engine(self, engine: u32, each: u32) -> Self {
        TickedUnit {
            others: engine * each + self.others,
            ..self
        }
    }

    /// Finally takes the occupancy counts of its FIFO.
    pub fn before<T>(self, link: Link<T>) -> Self {
        TickedUnit {
            occupancy: link.occupancy,
            ..self
        }
    }

    /// Instance that takes the next item.
    pub fn turn(&self) -> usize {
        self.log.len() % self.instances.len()
    }

    pub fn is_idle(&self, now: u64) -> bool {
        self.instances.iter().all(|instance| instance.until <= now)
    }

    pub fn is_free(&self, now: u64) -> bool {
        self.instances[self.turn()].until <= now
    }

    pub fn take(&mut self, now: u64, cycles: u64) {
        let turn = self.turn();
        self.instances[turn].until = now + cycles;
        self.instances[turn].items += 1;
        self.log.push(now);
    }

    /// Counts the cycle. `reason` is why the instance whose turn it is did not take an item.
    pub fn count(&mut self, now: u64, reason: Act) {
        let turn = self.turn();
        for (place, instance) in self.instances.iter_mut().enumerate() {
            match reason {
                _ if instance.until > now => instance.account.busy += 1,
                Act::StallOnMemory if place == turn => instance.account.memory += 1,
                Act::Block if place == turn => instance.account.blocked += 1,
                _ => instance.account.starved += 1,
            }
        }
    }
}

/// A FIFO and the pipeline before it: items with the cycle in which they arrive. Places are counted
/// as credits.
pub struct Link<T> {
    pub items: VecDeque<(u64, T)>,
    pub credits: u32,
    /// Credits returned in this cycle.
    pub returned: u32,
    /// Cycle in which each place becomes free whose item does not come out.
    pub vanishing: VecDeque<u64>,
    /// Histogram of the number of occupied places, taken when an item enters and including it.
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

    /// Occupies a place until this cycle, for an item that does not come out.
    pub fn vanish(&mut self, free_again: u64) {
        self.credits = self.credits.checked_sub(1).expect("a place");
        self.vanishing.push_back(free_again);
    }

    /// Called before all other events of a cycle.
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

/// A stamp and its pixels.
#[derive(Clone, Debug, Default)]
pub struct Stamp {
    /// Pixels that are not faint, as places in the picture.
    pub pixels: Vec<usize>,
    /// Faint pixels.
    pub faint: Vec<usize>,
    /// All tested pixels.
    pub tested: Vec<usize>,
    /// Pixels that stop with this stamp.
    pub stops: Vec<usize>,
    /// Pixels in which fragments merge, and the number of fragments shaded for each.
    pub merged: Vec<(usize, u64)>,
    /// Look-ups of the pixels, one after the other.
    pub texels: Vec<Option<[usize; 2]>>,
    /// Lines in the order in which the pixels touch them.
    pub lines: Vec<usize>,
    /// Number among the stamps that reach the fragment unit.
    pub number: usize,
    /// Number of its tile among a binned machine's tiles with entries.
    pub tile: usize,
    /// It is no stamp, but the seed of the stamps behind it, which test the same pixels.
    pub is_seed: bool,
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
    if splat.cull_reason != CullReason::Drawn {
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
        let end = (bottom_most + 1).min(top + lanes[1]);
        for _ in 0..timing.timing.raster.row_cycles.unwrap_or(0) {
            stamps.push_back(Stamp {
                is_seed: true,
                tested: (top..end)
                    .flat_map(|y| {
                        (left_most..=right_most).map(move |x| y * scene.width as usize + x)
                    })
                    .collect(),
                ..Stamp::default()
            });
        }
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
                                .map(|nth| scene.texel(LitFragment::Merge(place, pixel), nth)),
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
    if right_most < left_most {
        stamps.clear();
    }
    stamps
}

/// Places behind a unit.
pub fn places(pace: Pace) -> u32 {
    (pace.fifo + pace.latency.div_ceil(pace.interval)) * pace.units
}

/// Places behind fetch: a bank for each record that it reads in a cycle, which divide those of the
/// FIFO, and a register in front of each bank.
fn record_places(timing: &Microarchitecture) -> u32 {
    let fetch = timing.timing.fetch;
    let banks = fetch.splats.unwrap_or(1);
    fetch.fifo.div_ceil(banks) * banks + banks
}

/// Pace of colours; any value where splats have no harmonics.
fn colour_pace(timing: &Microarchitecture, scene: &Scene) -> Pace {
    timing
        .colour
        .get(usize::from(scene.harmonics.max(1)) - 1)
        .map_or(timing.ellipse, |colour| colour.pace)
}

/// Ticks a machine until it is done; returns the number of cycles.
pub fn run<M>(machine: &mut M, tick: fn(&mut M), is_done: fn(&mut M) -> bool) -> u64 {
    let mut cycles = 0;
    while !is_done(machine) {
        tick(machine);
        cycles += 1;
        assert!(cycles < 1_000_000_000, "the machine is deadlocked");
    }
    cycles
}

/// Ticks a unit: each of its instances may take an item.
pub fn turn<M>(
    machine: &mut M,
    now: u64,
    unit: impl Fn(&mut M) -> &mut TickedUnit,
    mut act: impl FnMut(&mut M) -> Act,
) {
    let mut reason = Act::Starve;
    for _ in 0..unit(machine).instances.len() {
        if !unit(machine).is_free(now) {
            break;
        }
        reason = act(machine);
        let Act::Take(cycles) = reason else { break };
        unit(machine).take(now, cycles);
    }
    unit(machine).count(now, reason);
}

/// The cache of a map of surroundings, where there is one: sets of lines, least recently used
/// first.
pub struct Texels {
    sets: Vec<Vec<usize>>,
    ways: usize,
    line_texels: [usize; 2],
    side: usize,
    line_bytes: u64,
    pub lookups: [u64; 2],
    /// Reads for the fragment that shade takes next, after its look-up.
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

    /// Whether the next fragment of shade has its texels. The first call for a fragment looks them
    /// up.
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
        self.awaited.iter().flatten().all(|done| done.is_done(now))
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
        memory.request(
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
pub struct SetupUnits<'a> {
    timing: &'a Microarchitecture,
    scene: &'a Scene,
    now: u64,
    fetch: TickedUnit,
    requests: Requests,
    records: Link<usize>,
    project: TickedUnit,
    projected: Link<usize>,
    ellipse: TickedUnit,
    ellipses: Link<usize>,
    colour: TickedUnit,
    coloured: Link<usize>,
    shade: TickedUnit,
    lit: Link<usize>,
    pub texels: Option<Texels>,
    /// Read of the whole map, for a machine that stores all of it on chip.
    map: Option<Done>,
}

impl<'a> SetupUnits<'a> {
    pub fn new(timing: &'a Microarchitecture, scene: &'a Scene) -> Self {
        SetupUnits {
            timing,
            scene,
            now: 0,
            fetch: TickedUnit::new("fetch", timing.timing.fetch.splats.unwrap_or(1)),
            requests: Requests::new(timing.timing.memory.outstanding),
            records: Link::new(record_places(timing)),
            project: TickedUnit::new("project", timing.project.units),
            projected: Link::new(places(timing.project)),
            ellipse: TickedUnit::new("ellipse", timing.ellipse.units),
            ellipses: Link::new(places(timing.ellipse)),
            colour: TickedUnit::new("colour", colour_pace(timing, scene).units),
            coloured: Link::new(places(colour_pace(timing, scene))),
            shade: TickedUnit::new(
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

    /// Whether the map is on chip, for a machine that stores all of it there.
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
            memory.request(
                now,
                Requester::Environment,
                Direction::Read,
                MAP..MAP + bytes,
                &done,
            );
            done
        });
        done.is_done(now)
    }

    /// Bursts that contain a record.
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
            return Act::StallOnMemory;
        }
        let last = *self.bursts(record).end();
        if last >= self.requests.issued.len() && !self.requests.is_free(self.now) {
            return Act::StallOnMemory;
        }
        if !self.records.has_room() {
            return Act::Block;
        }
        // All bursts of a record are issued in one cycle, so a record of several bursts may exceed
        // the limit of outstanding requests.
        let burst = u64::from(self.timing.timing.memory.burst_bytes);
        for nth in self.requests.issued.len()..=last {
            let from = SPLATS + nth as u64 * burst;
            memory.request(
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
        if !self.requests.issued[self.bursts(record)]
            .iter()
            .all(|burst| burst.is_done(self.now))
        {
            return Act::StallOnMemory;
        }
        let ends = matches!(
            self.scene.splats[record].cull_reason,
            CullReason::Near | CullReason::Outside | CullReason::Transparent
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
        let ends = self.scene.splats[record].cull_reason != CullReason::Drawn;
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

    /// Whether the machine computes colours from the harmonics of the splats.
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
            && !texels.are_here(
                self.now,
                self.scene.texel(LitFragment::Splat(record), 0),
                memory,
            )
        {
            return Act::StallOnMemory;
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

    /// Output of setup.
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

    /// Called after all events of a cycle.
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

    /// Fetch, project and ellipse; colour, if splats have harmonics, and setup's own shade; and
    /// separately the shade unit, if it is the only one.
    pub fn units(self) -> (Vec<TickedUnit>, Option<TickedUnit>) {
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
    pub raster: TickedUnit,
    /// Remaining stamps of the current footprint, and whether any of it was taken.
    pub left: VecDeque<Stamp>,
    pub begun: bool,
    /// First cycle in which each pixel is skipped; empty where pixels never stop.
    pub stopped: Vec<u64>,
    /// Footprints without a remaining stamp, and seeds.
    pub dropped: u64,
    pub seeds: u64,
    /// Number of stamps so far that go on to the fragment unit.
    numbered: usize,
    /// Stamps with a weight since the last reset: those that kept a pixel, and those that did not.
    pub decided: [usize; 2],
    stamps: Link<Stamp>,
    pub gauss: TickedUnit,
    pub weighted: Link<Stamp>,
}

impl Fill {
    pub fn new(timing: &Microarchitecture) -> Self {
        Fill {
            latencies: [timing.raster.latency.into(), timing.gauss.latency.into()],
            raster: TickedUnit::new("raster", 1),
            left: VecDeque::new(),
            begun: false,
            stopped: Vec::new(),
            dropped: 0,
            seeds: 0,
            numbered: 0,
            decided: [0; 2],
            stamps: Link::new(places(timing.raster)),
            gauss: TickedUnit::new("gauss", 1),
            weighted: Link::new(places(timing.gauss)),
        }
    }

    /// A raster that skips stopped pixels, in a picture with this many pixels.
    pub fn leaving_out(self, pixels: usize) -> Self {
        Fill {
            stopped: vec![u64::MAX; pixels],
            ..self
        }
    }

    /// Skips stamps of which every pixel has stopped.
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

    /// Ticks the raster. `stamps` returns an item's stamps, or `None` while its data is in flight.
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
                return Act::StallOnMemory;
            };
            self.left = stamps;
        }
        self.pass_over(now);
        if self.left.is_empty() {
            // Every stamp has stopped.
            from.pop();
            self.dropped += 1;
            return Act::Take(1);
        }
        if self.left[0].is_seed {
            if !std::mem::replace(&mut self.begun, true) {
                from.pop();
            }
            self.left.pop_front();
            self.seeds += 1;
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
            self.raster.log.len() as u64 - self.dropped - self.seeds,
            self.gauss.log.len() as u64,
        ]
    }

    pub fn units(self) -> Vec<TickedUnit> {
        vec![
            self.raster.before(self.stamps),
            self.gauss.before(self.weighted),
        ]
    }
}

/// A merging stamp in one unit, with the pixels of that unit.
struct Merging {
    number: usize,
    pixels: Vec<usize>,
    merges: u64,
    /// Fragments that shade has not taken yet, and the cycle in which the last taken one is lit.
    left: u64,
    lit: u64,
}

/// A fragment unit, with the merges in flight, oldest first, and the cycle in which the oldest
/// ends, known once it is lit.
struct FragmentUnit {
    unit: TickedUnit,
    merging: VecDeque<Merging>,
    through: Option<u64>,
}

/// Fragment units, and the shading of their merges.
pub struct Merge {
    fragment_latency: u64,
    shade_pace: Pace,
    merge: u64,
    in_flight: usize,
    hazard: u64,
    width: usize,
    columns: usize,
    units: Vec<FragmentUnit>,
    /// Cycle from which each pixel can be taken again.
    pixel_free: Vec<u64>,
    pub shade: TickedUnit,
    /// Reflecting shade unit: fragments are then shaded one by one. Such a machine has one of each
    /// unit.
    pub mirror: Option<TexelShade>,
    /// Work for shade units: first cycle, duration, and fragment unit.
    pub to_shade: VecDeque<(u64, u64, Option<usize>)>,
    /// Unwritten stamps by number: for how many units they wait, and when the other units have
    /// written them.
    waiting: BTreeMap<usize, (Stamp, usize, u64)>,
    /// Stamps completed by all units since the last call, and when they are written.
    pub written: Vec<(Stamp, u64)>,
}

/// Consumer of a fragment's light: a merge, or resolve, with a flag for its last fragment.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum LightConsumer {
    Merge,
    Resolve { is_last: bool },
}

/// A shade unit that reflects surroundings: its cache, and its queue: first cycle, texel, consumer.
pub struct TexelShade {
    pub texels: Texels,
    pub queue: VecDeque<(u64, Option<[usize; 2]>, LightConsumer)>,
    /// Stall cycles of fragments for texels since the last reset.
    pub waited: u64,
}

impl TexelShade {
    pub fn new(timing: &Microarchitecture, scene: &Scene) -> Option<Self> {
        Texels::new(timing, scene).map(|texels| TexelShade {
            texels,
            queue: VecDeque::new(),
            waited: 0,
        })
    }

    /// Queues fragments that resolve shades together, from a cycle on.
    pub fn queue_resolve(&mut self, here: u64, texels: Vec<Option<[usize; 2]>>) {
        let last = texels.len() - 1;
        self.queue
            .extend(texels.into_iter().enumerate().map(|(nth, texel)| {
                (
                    here,
                    texel,
                    LightConsumer::Resolve {
                        is_last: nth == last,
                    },
                )
            }));
    }

    /// Ticks the unit for its next fragment; also returns the consumer of a taken fragment.
    pub fn shade(
        &mut self,
        now: u64,
        interval: u64,
        memory: &mut Memory,
    ) -> (Act, Option<LightConsumer>) {
        let Some(&(here, texel, consumer)) = self.queue.front() else {
            return (Act::Starve, None);
        };
        if here > now {
            return (Act::Starve, None);
        }
        if !self.texels.are_here(now, texel, memory) {
            self.waited += 1;
            return (Act::StallOnMemory, None);
        }
        self.texels.awaited = None;
        self.queue.pop_front();
        if consumer == LightConsumer::Merge {
            // Stalls of merges are not reported.
            self.waited = 0;
        }
        (Act::Take(interval), Some(consumer))
    }

    /// Stall cycles for texels, once the last fragment of a resolve is taken.
    pub fn waited(&mut self, consumer: Option<LightConsumer>) -> Option<u64> {
        (consumer == Some(LightConsumer::Resolve { is_last: true }))
            .then(|| std::mem::take(&mut self.waited))
    }
}

/// Held until further notice.
pub const HELD: u64 = 1 << 40;

impl Merge {
    pub fn new(timing: &Microarchitecture, scene: &Scene) -> Self {
        let units = TickedUnit::each("fragment", timing.fragment.units).into_iter();
        Merge {
            fragment_latency: timing.fragment.latency.into(),
            shade_pace: timing.shade,
            merge: timing.timing.fragment.merge.into(),
            in_flight: timing.timing.fragment.merges_in_flight.unwrap_or(1) as usize,
            hazard: timing.hazard.into(),
            width: scene.width as usize,
            columns: timing.timing.raster.lanes[0] as usize,
            units: units
                .map(|unit| FragmentUnit {
                    unit,
                    merging: VecDeque::new(),
                    through: None,
                })
                .collect(),
            pixel_free: vec![0; (scene.width * scene.height) as usize],
            shade: TickedUnit::new("shade", timing.shade.units),
            to_shade: VecDeque::new(),
            mirror: TexelShade::new(timing, scene),
            waiting: BTreeMap::new(),
            written: Vec::new(),
        }
    }

    /// Fragment unit of a pixel.
    fn owner(&self, pixel: usize) -> usize {
        (pixel % self.width + pixel / self.width * self.columns) % self.units.len()
    }

    /// Called before all other events of a cycle: merges lit fragments, in order.
    pub fn begin_tick(&mut self, now: u64) {
        for of in 0..self.units.len() {
            loop {
                let merge = self.merge;
                let FragmentUnit {
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
                debug_assert!(unit.instances.len() == 1);
                first
                    .pixels
                    .iter()
                    .for_each(|pixel| self.pixel_free[*pixel] = now - 1 + self.hazard);
                self.part_written(first.number, now - 1 + self.fragment_latency);
            }
            let FragmentUnit { unit, merging, .. } = &mut self.units[of];
            if merging.len() >= self.in_flight {
                unit.instances[0].until = unit.instances[0].until.max(now + 1);
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

    /// Ticks the fragment units. The first stamp is taken if its units and its pixels are free.
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
        // Even units first, among these the multiples of four, and so on.
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
                        .map(|texel| (now + 1, *texel, LightConsumer::Merge)),
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

    /// Records that a fragment is taken to be shaded for one of a unit's merges.
    fn light(&mut self, owner: usize, now: u64) {
        let of = self.units[owner]
            .merging
            .iter_mut()
            .find(|merging| merging.left > 0)
            .expect("a merge to be lit");
        (of.left, of.lit) = (of.left - 1, now + u64::from(self.shade_pace.latency));
    }

    /// Ticks the reflecting shade unit; also returns resolve's stall cycles for texels, once its
    /// last fragment is taken.
    pub fn mirror(&mut self, now: u64, memory: &mut Memory) -> (Act, Option<u64>) {
        let Some(mirror) = &mut self.mirror else {
            return (Act::Starve, None);
        };
        let (act, consumer) = mirror.shade(now, self.shade_pace.interval.into(), memory);
        let waited = mirror.waited(consumer);
        if consumer == Some(LightConsumer::Merge) {
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

    /// Whether stamps were taken that some unit has not completed.
    pub fn is_waiting(&self) -> bool {
        !self.waiting.is_empty()
    }

    pub fn units(self) -> (Vec<TickedUnit>, TickedUnit) {
        (
            self.units.into_iter().map(|of| of.unit).collect(),
            self.shade,
        )
    }
}

/// Distributes this many fragments over the shade units, for a resolve that begins now.
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

/// Cycles that pixels hold each resolve unit, and the number of fragments shaded for them.
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
    // `shaders` fragments at a time.
    let light = |fragments: u64| fragments.div_ceil(shaders) * u64::from(timing.shade.interval);
    for y in top..height.min(top + rows) {
        for x in left..width.min(left + columns) {
            let end = scene.ends[y * width + x];
            let [lit, unlit] = [end.lit, end.unlit].map(u64::from);
            // All pixels come through one port, one after the other; light arrives independently.
            // The first free unit takes the pixel.
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
    // A unit without a pixel takes a cycle too.
    held.iter_mut()
        .for_each(|cycles| *cycles = light(shades).max(*cycles).max(1));
    (held, shades)
}

/// Ticks all resolve units. They take their work at the same time.
pub fn resolve(units: &mut [TickedUnit], now: u64, reason: Act, cycles: &[u64]) -> bool {
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

/// Final look-ups of these pixels, one after the other.
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
            (0..scene.ends[pixel].unlit.into())
                .map(move |nth| scene.texel(LitFragment::End(pixel), nth))
        })
        .collect()
}

/// Look-ups and hits of several caches.
pub fn texels_looked_up<const N: usize>(caches: [Option<&Texels>; N]) -> [u64; 2] {
    caches.into_iter().flatten().fold([0; 2], |all, cache| {
        [0, 1].map(|i| all[i] + cache.lookups[i])
    })
}

//! Stages: the units that both organisations have, as far as they are wired alike.
//!
//! ```text
//! SetUp: fetch ─► project ─► ellipse [─► colour] [─► shade]    Fill: raster ─► gauss    Merge: fragment ◄─► shade    Resolve: resolve ◄─► shade
//! ```
//! Each goes through what it is given, one item after the other, and says when the next unit has it.

use super::account::{Detail, Ready, Unit};
use super::hazards::Hazards;
use super::memory::{Client, Direction, Memory, Outstanding};
use super::stamps::{Piece, Stamps};
use super::stops::Stops;
use super::texels;
use super::texels::Texels;
use super::walk::Walk;
use crate::elaboration::microarchitecture::{Microarchitecture, Pace};
use crate::elaboration::unit;
use crate::work::{Fate, Footprint, NO_TEXEL, Work};
use std::ops::Range;

/// Fetch, project and ellipse, colour where harmonics become one, and shade where splats are lit before they are drawn: one splat each.
pub struct SetUp<'a> {
    timing: &'a Microarchitecture,
    pub fetch: Unit,
    pub project: Unit,
    pub ellipse: Unit,
    /// None where splats have colours.
    pub colour: Option<Unit>,
    /// None where splats are not lit yet.
    pub shade: Option<Unit>,
    /// That of `colour`.
    colour_pace: Pace,
    outstanding: Outstanding,
    /// Where splats are found in a tree.
    walk: Option<Walk<'a>>,
    /// What mirrors, of shade, and what each drawn splat looks up.
    pub texels: Option<Texels>,
    looked_up: std::slice::Iter<'a, u16>,
    /// When the map of surroundings is on the chip.
    loaded: u64,
    splat_bytes: u64,
    /// When the last splat was fetched.
    pub fetched: u64,
    /// Bursts fetched so far, and when all of them are here.
    bursts: u64,
    burst_here: u64,
}

impl<'a> SetUp<'a> {
    pub fn new(timing: &'a Microarchitecture, work: &'a Work, behind: &'static str, memory: &mut Memory, detail: Detail) -> Self {
        let loaded = texels::load(timing, work, memory);
        let shaded = work.preshaded.then_some(SetUp::shade_name(timing));
        let pace = timing.colour_of(work.harmonics).map(|colour| colour.pace);
        let coloured = pace.map(|_| unit::COLOUR);
        let after_ellipse = coloured.or(shaded).unwrap_or(behind);
        let before_shade = coloured.unwrap_or(unit::ELLIPSE);
        SetUp {
            timing,
            fetch: Unit::new("fetch", timing.fetch, [None, Some(unit::PROJECT)], detail, timing.lifted),
            project: Unit::new(unit::PROJECT, timing.project, [Some("fetch"), Some(unit::ELLIPSE)], detail, timing.lifted),
            ellipse: Unit::new(unit::ELLIPSE, timing.ellipse, [Some(unit::PROJECT), Some(after_ellipse)], detail, timing.lifted),
            colour: pace.map(|pace| {
                let neighbours = [Some(unit::ELLIPSE), Some(shaded.unwrap_or(behind))];
                Unit::new(unit::COLOUR, pace, neighbours, detail, timing.lifted)
            }),
            colour_pace: pace.unwrap_or(timing.ellipse),
            shade: shaded.map(|name| Unit::new(name, timing.shade, [Some(before_shade), Some(behind)], detail, timing.lifted)),
            outstanding: Outstanding::new(timing.timing.memory.outstanding),
            walk: Walk::new(timing, work, loaded),
            texels: Texels::new(timing, work).filter(|_| work.preshaded),
            looked_up: work.texels.iter(),
            loaded,
            splat_bytes: timing.record_bytes(work.shared_axes, work.harmonics).into(),
            fetched: 0,
            bursts: 0,
            burst_here: 0,
        }
    }

    /// Up to which burst a splat lies, and when it can be fetched.
    #[inline(always)]
    fn ready(&self, index: u64) -> (u64, Ready) {
        if self.walk.is_some() {
            return (0, Ready { room: self.fetch.behind.free(), ..Ready::default() });
        }
        let burst = u64::from(self.timing.timing.memory.burst_bytes);
        let needed = ((index + 1) * self.splat_bytes).div_ceil(burst);
        let memory = if needed > self.bursts { self.outstanding.free().max(self.loaded) } else { 0 };
        (needed, Ready { room: self.fetch.behind.free(), memory, ..Ready::default() })
    }

    /// When a splat, the next one, will be fetched.
    pub fn when(&self, index: u64) -> u64 {
        let (_, Ready { room, memory, .. }) = self.ready(index);
        self.fetch.free().max(room).max(memory)
    }

    /// A splat goes through; says when it is done, if it goes on.
    #[inline(always)]
    pub fn splat(&mut self, index: u64, fate: Fate, memory: &mut Memory) -> Option<u64> {
        let t = self.timing;
        let burst = u64::from(t.timing.memory.burst_bytes);
        let (needed, ready) = self.ready(index);
        let now = match &mut self.walk {
            None => self.fetch.take(ready, 1),
            Some(walk) => walk.next(&mut self.fetch, &mut self.outstanding, memory),
        };
        self.fetch.behind.take(now);
        self.fetched = now;
        while self.bursts < needed {
            let here = memory.request(now, Client::Splats, Direction::Read, self.bursts * burst, burst);
            self.outstanding.push(here);
            self.burst_here = self.burst_here.max(here);
            self.bursts += 1;
        }

        let goes_on = fate.leaves_project();
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
        let (mut now, mut here) = (now, now + u64::from(t.ellipse.latency));
        let mut last = &mut self.ellipse;
        for (unit, pace, texels) in [(&mut self.colour, self.colour_pace, &mut None), (&mut self.shade, t.shade, &mut self.texels)] {
            let Some(unit) = unit else { continue };
            last.behind.take(now);
            let ready = Ready { here, room: unit.behind.free(), ..Ready::default() };
            now = match texels {
                None => unit.take(ready, pace.interval.into()),
                Some(texels) => {
                    let texel = self.looked_up.next().copied().unwrap_or(NO_TEXEL);
                    texels.shade(unit, ready, pace.interval.into(), texel, memory)[0]
                }
            };
            last.behind.give(now);
            here = now + u64::from(pace.latency);
            last = unit;
        }
        last.behind.claim();
        Some(here)
    }

    /// All splats are through: reads what is left of a tree.
    pub fn end(&mut self, memory: &mut Memory) {
        if let Some(walk) = &mut self.walk {
            walk.end(&mut self.fetch, &mut self.outstanding, memory);
        }
    }

    /// The name of its shade unit: the only one, or, of windows, beside that of fragments.
    fn shade_name(timing: &Microarchitecture) -> &'static str {
        if timing.lights_setup { super::SETUP_SHADE } else { unit::SHADE }
    }

    /// Its units, and that which shades fragments where it has none of its own.
    pub fn units(self, of_fragments: Unit) -> (Vec<Unit>, Unit) {
        let mut units = vec![self.fetch, self.project, self.ellipse];
        units.extend(self.colour);
        if self.timing.lights_setup {
            units.extend(self.shade);
            return (units, of_fragments);
        }
        // Of sheets nothing is shaded any more.
        (units, self.shade.unwrap_or(of_fragments))
    }

    /// The name of its last unit.
    pub fn last_name(timing: &Microarchitecture, work: &Work) -> &'static str {
        let coloured = timing.colour_of(work.harmonics).map(|_| unit::COLOUR);
        let shaded = work.preshaded.then_some(SetUp::shade_name(timing));
        shaded.or(coloured).unwrap_or(unit::ELLIPSE)
    }

    /// Its last unit, and the cycles from a splat to its result there.
    fn last(&mut self) -> (&mut Unit, u32) {
        match (&mut self.shade, &mut self.colour) {
            (Some(shade), _) => (shade, self.timing.shade.latency),
            (None, Some(colour)) => (colour, self.colour_pace.latency),
            (None, None) => (&mut self.ellipse, self.timing.ellipse.latency),
        }
    }

    /// Whether it is known when another splat has room behind the last unit.
    pub fn is_known(&self) -> bool {
        self.shade.as_ref().or(self.colour.as_ref()).unwrap_or(&self.ellipse).behind.is_known()
    }

    /// The next splat, which was here then, goes to the unit behind in this cycle.
    #[inline(always)]
    pub fn give(&mut self, here: u64, now: u64) {
        let (last, latency) = self.last();
        last.behind.count(here - u64::from(latency));
        last.behind.give(now);
    }
}

/// Raster and gauss: one footprint, stamp by stamp.
pub struct Fill<'a> {
    timing: &'a Microarchitecture,
    pub raster: Unit,
    pub gauss: Unit,
    walk: Stamps<'a>,
    /// Stamps, and those among them that kept a pixel.
    pub stamps: [u64; 2],
    /// What pixels that have stopped leave of a stamp.
    kept: Vec<Piece>,
}

impl<'a> Fill<'a> {
    pub fn new(timing: &'a Microarchitecture, work: &'a Work, before: &'static str, behind: &'static str, detail: Detail) -> Self {
        Fill {
            timing,
            raster: Unit::new(unit::RASTER, timing.raster, [Some(before), Some(unit::GAUSS)], detail, timing.lifted),
            gauss: Unit::new(unit::GAUSS, timing.gauss, [Some(unit::RASTER), Some(behind)], detail, timing.lifted),
            walk: Stamps::new(work, timing.timing.raster.lanes),
            stamps: [0; 2],
            kept: Vec::new(),
        }
    }

    /// The next footprint of a part of the picture, a corner and a side, is here, or comes from memory; `next` takes each stamp that has a
    /// weight, with the first cycle in which gauss has it, and says when. Says when the raster takes it, and whether it has such a stamp.
    #[inline(always)]
    pub fn footprint(
        &mut self,
        footprint: &Footprint,
        (corner, side): ([u16; 2], u32),
        (here, memory): (u64, u64),
        mut next: impl FnMut(Stamp, u64) -> u64,
    ) -> (u64, bool) {
        let t = self.timing;
        let ready = Ready { here, memory, ..Ready::default() };
        let stamps = self.walk.footprint(footprint, corner, side);
        let (mut first_taken, mut gone_through, mut is_seen) = (u64::MAX, 0, false);
        for stamp in self.walk.kept() {
            self.stamps[1] += 1;
            // Stamps that keep nothing wait for no room.
            let empty = stamp[0].stamp - gone_through;
            gone_through = stamp[0].stamp + 1;
            if empty > 0 {
                first_taken = first_taken.min(self.raster.take_run(ready, empty.into()));
            }
            let now = self.raster.take(Ready { room: self.raster.behind.free(), ..ready }, 1);
            first_taken = first_taken.min(now);
            self.raster.behind.take(now);
            let goes_on = stamp.iter().fold(0, |all, piece| all | piece.pixels) != 0;
            let room = if goes_on { self.gauss.behind.free() } else { 0 };
            let here = now + u64::from(t.raster.latency);
            let now = self.gauss.take(Ready { here, room, ..Ready::default() }, 1);
            self.raster.behind.give(now);
            if goes_on {
                is_seen = true;
                self.gauss.behind.take(now);
                let taken = next(Stamp { pieces: stamp, texels: self.walk.texels() }, now + u64::from(t.gauss.latency));
                self.gauss.behind.give(taken);
            }
        }
        self.stamps[0] += u64::from(stamps);
        if gone_through < stamps {
            first_taken = first_taken.min(self.raster.take_run(ready, (stamps - gone_through).into()));
        }
        (first_taken, is_seen)
    }

    /// The same where pixels stop, and with the cycle in which each stamp is written. Stamps of which every pixel has stopped are passed over;
    /// a footprint of which none is left is dropped in a cycle: before its record has come, if the whole tile has stopped.
    pub fn footprint_of_stops(
        &mut self,
        footprint: &Footprint,
        (corner, side): ([u16; 2], u32),
        (here, memory): (u64, u64),
        stops: &mut Stops,
        mut next: impl FnMut(&[Piece], u64) -> [u64; 2],
    ) -> u64 {
        let t = self.timing;
        let ready = Ready { here, memory, ..Ready::default() };
        let stamps = self.walk.footprint(footprint, corner, side);
        let free = self.raster.free().max(here);
        if stops.all() <= free.max(memory) {
            return self.raster.take_run(Ready { memory: memory.min(free.max(stops.all())), ..ready }, 1);
        }
        let mut first_taken = u64::MAX;
        let mut pieces = self.walk.kept().peekable();
        for nth in 0..stamps {
            let stamp = pieces.next_if(|stamp| stamp[0].stamp == nth).unwrap_or_default();
            let now = self.raster.free().max(here).max(memory);
            let stopped = stops.area(self.walk.area(nth));
            let has_weight = stamp.iter().any(|piece| piece.pixels != 0);
            let whole = stops.whole(stamp);
            let room = if stamp.is_empty() { 0 } else { self.raster.behind.free() };
            // The stamp is looked at until it has room, or needs none.
            let looked = if whole <= now.max(room) { now.max(whole) } else { now.max(room) };
            let waited = Ready { room: looked, ..ready };
            if stopped <= looked {
                self.raster.wait(waited);
                if has_weight {
                    stops.leave_out(looked);
                }
                continue;
            }
            self.stamps[0] += 1;
            if whole <= looked {
                first_taken = first_taken.min(self.raster.take(waited, 1));
                if has_weight {
                    stops.leave_out(looked);
                }
                continue;
            }
            self.stamps[1] += 1;
            let now = self.raster.take(waited, 1);
            first_taken = first_taken.min(now);
            self.raster.behind.take(now);
            stops.kept(stamp, now, &mut self.kept);
            let goes_on = self.kept.iter().any(|piece| piece.pixels != 0);
            if has_weight && !goes_on {
                stops.leave_out(now);
            }
            let room = if goes_on { self.gauss.behind.free() } else { 0 };
            let here = now + u64::from(t.raster.latency);
            let now = self.gauss.take(Ready { here, room, ..Ready::default() }, 1);
            self.raster.behind.give(now);
            if goes_on {
                self.gauss.behind.take(now);
                let [taken, written] = next(&self.kept, now + u64::from(t.gauss.latency));
                self.gauss.behind.give(taken);
                stops.written(footprint.splat, &self.kept, written);
            }
        }
        if first_taken == u64::MAX { self.raster.take(ready, 1) } else { first_taken }
    }
}

/// A stamp that has a weight: its pieces, and what fragments of the footprint look up.
#[derive(Clone, Copy, Debug)]
pub struct Stamp<'a> {
    pub pieces: &'a [Piece],
    pub texels: &'a [u16],
}

/// Fragments: stamps come, merges take longer, and no pixel is taken twice at a time.
pub struct Merge<'a> {
    timing: &'a Microarchitecture,
    pub fragment: Unit,
    pub shade: Unit,
    hazards: Hazards,
    /// What mirrors, of shade.
    pub texels: Option<Texels>,
    /// When all that was taken is written.
    pub written: u64,
}

impl<'a> Merge<'a> {
    pub fn new(timing: &'a Microarchitecture, work: &Work, before: &'static str, behind: Option<&'static str>, detail: Detail) -> Self {
        Merge {
            timing,
            fragment: Unit::new(unit::FRAGMENT, timing.fragment, [Some(before), behind], detail, timing.lifted),
            shade: Unit::new(unit::SHADE, timing.shade, [Some(unit::FRAGMENT), None], detail, timing.lifted),
            hazards: Hazards::new(timing, work),
            texels: Texels::new(timing, work),
            written: 0,
        }
    }

    /// Takes a stamp; says when, and when it is written.
    #[inline(always)]
    pub fn stamp(&mut self, Stamp { pieces: stamp, texels }: Stamp, ready: Ready, memory: &mut Memory) -> [u64; 2] {
        let t = self.timing;
        let hazard = self.hazards.until(stamp, ready.here.max(self.fragment.free()));
        let [merges, shades] = match stamp {
            // Mostly.
            [piece] => [piece.merges, piece.shades].map(u64::from),
            _ => stamp.iter().fold([0; 2], |[merges, shades], piece| [merges + u64::from(piece.merges), shades + u64::from(piece.shades)]),
        };
        let mut cycles = 1 + merges * u64::from(t.timing.fragment.merge);
        if shades > 0 && !self.shade.is_lifted() {
            cycles += u64::from(t.shade.latency) + (shades - 1) * u64::from(t.shade.interval);
        }
        let ready = Ready { hazard, ..ready };
        if let (Some(cache), true) = (&mut self.texels, shades > 0) {
            // Light comes a latency after the last one is taken, when its texels are here.
            let here = self.fragment.when(ready) + 1;
            let looked_up = stamp.iter().flat_map(|piece| &texels[piece.texels as usize..][..usize::from(piece.shades)]);
            let interval = t.shade.interval.into();
            let mut last = here;
            for texel in looked_up {
                [last, _] = cache.shade(&mut self.shade, Ready { here, ..Ready::default() }, interval, *texel, memory);
            }
            let latency = if self.shade.is_lifted() { 0 } else { u64::from(t.shade.latency) };
            cycles = last - here + 1 + latency + merges * u64::from(t.timing.fragment.merge);
        }
        let now = self.fragment.take(ready, cycles);
        if self.texels.is_none() {
            for _ in 0..shades {
                self.shade.take(Ready { here: now + 1, ..Ready::default() }, t.shade.interval.into());
            }
        }
        // Infinitely fast, it still forwards nothing: what is under way stays so.
        let more = if self.fragment.is_lifted() { 0 } else { cycles - 1 };
        self.hazards.take(stamp, now + more + u64::from(t.hazard));
        let written = now + more + u64::from(t.fragment.latency);
        self.written = self.written.max(written);
        [now, written]
    }
}

/// Resolve: pixels that lie together, a line or a tile. It takes a pixel's fragments one a cycle, whether merged, and so lit, or left to shade.
pub struct Resolve<'a> {
    timing: &'a Microarchitecture,
    pub unit: Unit,
    /// What each pixel holds: fragments, and how many of them are left to shade.
    held: Vec<[u8; 2]>,
    width: u32,
    /// Of a frame that mirrors, what fragments look up that are left to shade, pixel by pixel, and where those of each pixel begin.
    texels: Vec<u16>,
    first_texels: Vec<u32>,
}

impl<'a> Resolve<'a> {
    pub fn new(timing: &'a Microarchitecture, work: &Work, detail: Detail) -> Self {
        let (texels, first_texels) = if work.mirrors { work.texels_of_pixels() } else { (Vec::new(), Vec::new()) };
        Resolve {
            texels,
            first_texels,
            timing,
            unit: Unit::new(unit::RESOLVE, timing.resolve, [Some(unit::FRAGMENT), None], detail, timing.lifted),
            held: work.held(),
            width: work.width,
        }
    }

    /// Takes these columns and rows of the picture, shading in a unit; says when the last of their words is there.
    pub fn pixels(
        &mut self,
        columns: Range<u32>,
        rows: Range<u32>,
        ready: Ready,
        (shade, texels): (&mut Unit, &mut Option<Texels>),
        memory: &mut Memory,
    ) -> u64 {
        let t = self.timing;
        let interval = if shade.is_lifted() { 0 } else { u64::from(t.shade.interval) };
        let (mut cycles, mut shades) = (0, 0);
        for row in rows.clone() {
            let at = |column: u32| (row * self.width + column) as usize;
            for [fragments, left] in &self.held[at(columns.start)..at(columns.end)] {
                cycles += (u64::from(*left) * interval).max((*fragments).into()).max(t.resolve.interval.into());
                shades += u64::from(*left);
            }
        }
        if let Some(cache) = texels {
            let here = self.unit.when(ready);
            for row in rows {
                let at = |column: u32| (row * self.width + column) as usize;
                for pixel in at(columns.start)..at(columns.end) {
                    for texel in &self.texels[self.first_texels[pixel] as usize..][..usize::from(self.held[pixel][1])] {
                        let [_, waited] = cache.shade(shade, Ready { here, ..Ready::default() }, interval, *texel, memory);
                        cycles += waited;
                    }
                }
            }
        }
        let now = self.unit.take(ready, cycles);
        let done = now + if self.unit.is_lifted() { 0 } else { cycles } + u64::from(t.resolve.latency);
        if shades == 0 {
            return done;
        }
        if texels.is_some() {
            return done + if shade.is_lifted() { 0 } else { u64::from(t.shade.latency) };
        }
        shade.take(Ready { here: now, ..Ready::default() }, shades * interval);
        done + if shade.is_lifted() { 0 } else { u64::from(t.shade.latency) }
    }
}

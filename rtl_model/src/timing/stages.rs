//! Stages: the units that both organisations share, with their common wiring.
//!
//! ```text
//! SetUp: fetch ─► project ─► ellipse [─► colour] [─► shade]    Fill: raster ─► gauss    Merge: fragment ◄─► shade    Resolve: resolve ◄─► shade
//! ```
//! Each replays its items one by one, and returns the cycle in which the next unit can take the
//! result.

use super::account::{Detail, Ready, Unit};
use super::hazards::Hazards;
use super::memory::{Direction, Memory, Outstanding, Requester};
use super::stamps::{Piece, Stamps};
use super::stops::StopMap;
use super::texels;
use super::texels::Texels;
use super::walk::TreeWalk;
use crate::elaboration::microarchitecture::{Microarchitecture, Pace};
use crate::elaboration::unit;
use crate::work::{CullReason, Footprint, NO_TEXEL, TILE_PX, Work};
use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;

/// Fetch, project and ellipse; colour, if records have harmonics; shade, if splats are lit before
/// they are drawn. An item is a splat.
#[derive(Clone)]
pub struct SetUp<'a> {
    timing: &'a Microarchitecture,
    pub fetch: Unit,
    pub project: Unit,
    pub ellipse: Unit,
    /// None if records have colours.
    pub colour: Option<Unit>,
    /// None if splats are lit later.
    pub shade: Option<Unit>,
    /// Pace of `colour`.
    colour_pace: Pace,
    outstanding: Outstanding,
    /// Walk of the tree, if splats are in one.
    walk: Option<TreeWalk<'a>>,
    /// Shade's cache of texels, and the texels of each drawn splat.
    pub texels: Option<Texels>,
    looked_up: std::slice::Iter<'a, u16>,
    /// Cycle in which the map of surroundings is on the chip.
    loaded: u64,
    splat_bytes: u64,
    /// Cycle in which the last splat was fetched.
    pub fetched: u64,
    /// Bursts fetched so far, and the arrival of all of them.
    bursts: u64,
    burst_here: u64,
}

impl<'a> SetUp<'a> {
    pub fn new(
        timing: &'a Microarchitecture,
        work: &'a Work,
        behind: &'static str,
        memory: &mut Memory,
        detail: Detail,
    ) -> Self {
        let loaded = texels::load(timing, work, memory);
        let shaded = work.preshaded.then_some(SetUp::shade_name(timing));
        let pace = timing.colour_of(work.harmonics).map(|colour| colour.pace);
        let coloured = pace.map(|_| unit::COLOUR);
        let after_ellipse = coloured.or(shaded).unwrap_or(behind);
        let before_shade = coloured.unwrap_or(unit::ELLIPSE);
        // The walker of a tree tests one node per cycle.
        let fetch = if work.walk.is_empty() {
            timing.fetch
        } else {
            Pace {
                units: 1,
                fifo: timing.timing.fetch.fifo,
                ..timing.fetch
            }
        };
        SetUp {
            timing,
            fetch: Unit::new(
                "fetch",
                fetch,
                [None, Some(unit::PROJECT)],
                detail,
                timing.lifted,
            ),
            project: Unit::new(
                unit::PROJECT,
                timing.project,
                [Some("fetch"), Some(unit::ELLIPSE)],
                detail,
                timing.lifted,
            ),
            ellipse: Unit::new(
                unit::ELLIPSE,
                timing.ellipse,
                [Some(unit::PROJECT), Some(after_ellipse)],
                detail,
                timing.lifted,
            ),
            colour: pace.map(|pace| {
                let neighbours = [Some(unit::ELLIPSE), Some(shaded.unwrap_or(behind))];
                Unit::new(unit::COLOUR, pace, neighbours, detail, timing.lifted)
            }),
            colour_pace: pace.unwrap_or(timing.ellipse),
            shade: shaded.map(|name| {
                Unit::new(
                    name,
                    timing.shade,
                    [Some(before_shade), Some(behind)],
                    detail,
                    timing.lifted,
                )
            }),
            outstanding: Outstanding::new(timing.timing.memory.outstanding),
            walk: TreeWalk::new(timing, work, loaded),
            texels: Texels::new(timing, work).filter(|_| work.preshaded),
            looked_up: work.texels.iter(),
            loaded,
            splat_bytes: timing.record_bytes(work.shared_axes, work.harmonics).into(),
            fetched: 0,
            bursts: 0,
            burst_here: 0,
        }
    }

    /// The last burst of a splat, and the cycle from which it can be fetched.
    #[inline(always)]
    fn ready(&self, index: u64) -> (u64, Ready) {
        if self.walk.is_some() {
            return (
                0,
                Ready {
                    room: self.fetch.behind.free(),
                    ..Ready::default()
                },
            );
        }
        let burst = u64::from(self.timing.timing.memory.burst_bytes);
        let needed = ((index + 1) * self.splat_bytes).div_ceil(burst);
        let memory = if needed > self.bursts {
            self.outstanding.free().max(self.loaded)
        } else {
            0
        };
        (
            needed,
            Ready {
                room: self.fetch.behind.free(),
                memory,
                ..Ready::default()
            },
        )
    }

    /// The cycle in which the next splat will be fetched.
    pub fn when(&self, index: u64) -> u64 {
        let (_, Ready { room, memory, .. }) = self.ready(index);
        self.fetch.free().max(room).max(memory)
    }

    /// Replays a splat; returns the cycle in which it is done, if it is not culled.
    #[inline(always)]
    pub fn splat(
        &mut self,
        index: u64,
        cull_reason: CullReason,
        memory: &mut Memory,
    ) -> Option<u64> {
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
            let here = memory.request(
                now,
                Requester::Splats,
                Direction::Read,
                self.bursts * burst,
                burst,
            );
            self.outstanding.push(here);
            self.burst_here = self.burst_here.max(here);
            self.bursts += 1;
        }

        let goes_on = cull_reason.leaves_project();
        let room = if goes_on {
            self.project.behind.free()
        } else {
            0
        };
        let here = now + u64::from(t.fetch.latency);
        let now = self.project.take(
            Ready {
                here,
                memory: self.burst_here,
                room,
                ..Ready::default()
            },
            t.project.interval.into(),
        );
        self.fetch.behind.give(now);
        if !goes_on {
            return None;
        }
        self.project.behind.take(now);

        let goes_on = cull_reason == CullReason::Drawn;
        let room = if goes_on {
            self.ellipse.behind.free()
        } else {
            0
        };
        let here = now + u64::from(t.project.latency);
        let now = self.ellipse.take(
            Ready {
                here,
                room,
                ..Ready::default()
            },
            t.ellipse.interval.into(),
        );
        self.project.behind.give(now);
        if !goes_on {
            return None;
        }
        let (mut now, mut here) = (now, now + u64::from(t.ellipse.latency));
        let mut last = &mut self.ellipse;
        for (unit, pace, texels) in [
            (&mut self.colour, self.colour_pace, &mut None),
            (&mut self.shade, t.shade, &mut self.texels),
        ] {
            let Some(unit) = unit else { continue };
            last.behind.take(now);
            let ready = Ready {
                here,
                room: unit.behind.free(),
                ..Ready::default()
            };
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

    /// Reads the rest of a tree, after the last splat.
    pub fn end(&mut self, memory: &mut Memory) {
        if let Some(walk) = &mut self.walk {
            walk.end(&mut self.fetch, &mut self.outstanding, memory);
        }
    }

    /// The name of its shade unit: the only one, or with windows a second one besides that of
    /// fragments.
    fn shade_name(timing: &Microarchitecture) -> &'static str {
        if timing.lights_setup {
            super::SETUP_SHADE
        } else {
            unit::SHADE
        }
    }

    /// Its units, and the shade units of fragments, which are its own if fragments have none.
    pub fn units(self, of_fragments: Vec<Unit>) -> (Vec<Unit>, Vec<Unit>) {
        let mut units = vec![self.fetch, self.project, self.ellipse];
        units.extend(self.colour);
        if self.timing.lights_setup {
            units.extend(self.shade);
            return (units, of_fragments);
        }
        // Sheets are not shaded later.
        (units, self.shade.map_or(of_fragments, |shade| vec![shade]))
    }

    /// The name of its last unit.
    pub fn last_name(timing: &Microarchitecture, work: &Work) -> &'static str {
        let coloured = timing.colour_of(work.harmonics).map(|_| unit::COLOUR);
        let shaded = work.preshaded.then_some(SetUp::shade_name(timing));
        shaded.or(coloured).unwrap_or(unit::ELLIPSE)
    }

    /// Its last unit, and the latency of that unit.
    fn last(&mut self) -> (&mut Unit, u32) {
        match (&mut self.shade, &mut self.colour) {
            (Some(shade), _) => (shade, self.timing.shade.latency),
            (None, Some(colour)) => (colour, self.colour_pace.latency),
            (None, None) => (&mut self.ellipse, self.timing.ellipse.latency),
        }
    }

    /// Whether the cycle in which the last unit has room for another splat is known.
    pub fn is_scheduled(&self) -> bool {
        self.shade
            .as_ref()
            .or(self.colour.as_ref())
            .unwrap_or(&self.ellipse)
            .behind
            .is_scheduled()
    }

    /// The next unit takes the next splat, which arrived at `here`, in this cycle.
    #[inline(always)]
    pub fn give(&mut self, here: u64, now: u64) {
        let (last, latency) = self.last();
        last.behind.count(here - u64::from(latency));
        last.behind.give(now);
    }
}

/// Raster and gauss. An item is a footprint, replayed stamp by stamp.
pub struct Fill<'a> {
    timing: &'a Microarchitecture,
    pub raster: Unit,
    pub gauss: Unit,
    /// Stamps, and those with a kept pixel.
    pub stamps: [u64; 2],
    /// Seeds of runs.
    pub seeds: u64,
    /// The pixels of a stamp without those that have stopped.
    kept: Vec<Piece>,
}

impl<'a> Fill<'a> {
    /// For engine `nth`.
    pub fn new(
        timing: &'a Microarchitecture,
        before: &'static str,
        behind: &'static str,
        detail: Detail,
        nth: u32,
    ) -> Self {
        let unit = |name, pace, neighbours| {
            Unit::new(name, pace, neighbours, detail, timing.lifted).behind_others(nth)
        };
        Fill {
            timing,
            raster: unit(
                unit::RASTER,
                timing.raster,
                [Some(before), Some(unit::GAUSS)],
            ),
            gauss: unit(
                unit::GAUSS,
                timing.gauss,
                [Some(unit::RASTER), Some(behind)],
            ),
            stamps: [0; 2],
            seeds: 0,
            kept: Vec::new(),
        }
    }

    /// Replays the part of the next footprint in an area of the picture, given by corner and side;
    /// it arrives at `here`, its record at `memory`. `next` takes each stamp with a weight, with
    /// the first cycle in which gauss can take it, and returns the cycle. Returns the cycle in
    /// which raster takes the footprint, and whether it has such a stamp.
    #[inline(always)]
    pub fn footprint(
        &mut self,
        walk: &mut Stamps,
        footprint: &Footprint,
        (corner, side): ([u16; 2], u32),
        (here, memory): (u64, u64),
        mut next: impl FnMut(Stamp, u64) -> u64,
    ) -> (u64, bool) {
        let ready = Ready {
            here,
            memory,
            ..Ready::default()
        };
        let stamps = walk.footprint(footprint, corner, side);
        let mut so_far = FootprintProgress {
            first_taken: u64::MAX,
            gone_through: 0,
            is_seen: false,
        };
        if walk.runs().is_some_and(|runs| runs.len() != 1) {
            self.footprint_of_runs(walk, ready, &mut so_far, &mut next);
        } else if self.row_cycles() > 0 {
            self.footprint_of_rows(walk, stamps, ready, &mut so_far, &mut next);
        } else if let Some(pieces) = walk.single() {
            for piece in pieces {
                self.stamp(
                    walk,
                    std::slice::from_ref(piece),
                    ready,
                    &mut so_far,
                    &mut next,
                );
            }
        } else {
            for stamp in walk.kept() {
                self.stamp(walk, stamp, ready, &mut so_far, &mut next);
            }
        }
        self.stamps[0] += u64::from(stamps);
        let FootprintProgress {
            mut first_taken,
            gone_through,
            is_seen,
        } = so_far;
        if gone_through < stamps {
            first_taken = first_taken.min(self.empty_stamps(ready, (stamps - gone_through).into()));
        }
        (first_taken, is_seen)
    }

    /// The stamps of several runs: raster takes a cycle to seed each but the first. A footprint
    /// without a run is dropped in one cycle.
    #[inline(never)]
    fn footprint_of_runs(
        &mut self,
        walk: &Stamps,
        ready: Ready,
        so_far: &mut FootprintProgress,
        next: &mut impl FnMut(Stamp, u64) -> u64,
    ) {
        let runs = walk.runs().unwrap_or_default();
        if runs.is_empty() {
            so_far.first_taken = self.raster.take_run(ready, 1);
        }
        let mut kept = walk.kept().peekable();
        for (nth, run) in runs.iter().enumerate() {
            if nth > 0 {
                self.seeds += 1;
                let now = self.raster.take_run(ready, 1);
                so_far.first_taken = so_far.first_taken.min(now);
            }
            while let Some(stamp) = kept.next_if(|stamp| stamp[0].stamp < run.stamps[1]) {
                self.stamp(walk, stamp, ready, so_far, next);
            }
            let empty = run.stamps[1] - so_far.gone_through;
            if empty > 0 {
                so_far.gone_through = run.stamps[1];
                let now = self.empty_stamps(ready, empty.into());
                so_far.first_taken = so_far.first_taken.min(now);
            }
        }
    }

    /// Drops an entry of a kept list whose splat has departed, in one cycle; before its record
    /// arrives if the whole tile has stopped. Returns the cycle.
    pub fn drop_entry(&mut self, (here, memory): (u64, u64), stops: Option<&StopMap>) -> u64 {
        let stopped = stops.map_or(u64::MAX, StopMap::all);
        let from = self.raster.free().max(here).max(stopped);
        let ready = Ready {
            here,
            memory: memory.min(from),
            ..Ready::default()
        };
        self.raster.take_run(ready, 1)
    }

    /// Cycles in which a row of stamps is set up.
    #[inline(always)]
    fn row_cycles(&self) -> u64 {
        self.timing.timing.raster.row_cycles.unwrap_or(0).into()
    }

    /// Stamps of a machine that sets up each row of them.
    #[inline(never)]
    fn footprint_of_rows(
        &mut self,
        walk: &Stamps,
        stamps: u32,
        ready: Ready,
        so_far: &mut FootprintProgress,
        next: &mut impl FnMut(Stamp, u64) -> u64,
    ) {
        let mut kept = walk.kept().peekable();
        for row in (0..stamps).step_by(walk.across() as usize) {
            let now = self.raster.take_run(ready, self.row_cycles());
            so_far.first_taken = so_far.first_taken.min(now);
            let end = row + walk.across();
            while let Some(stamp) = kept.next_if(|stamp| stamp[0].stamp < end) {
                self.stamp(walk, stamp, ready, so_far, next);
            }
            let empty = end - so_far.gone_through;
            if empty > 0 {
                so_far.gone_through = end;
                self.empty_stamps(ready, empty.into());
            }
        }
    }

    /// The next stamp with a kept pixel, after those without one.
    #[inline(always)]
    fn stamp(
        &mut self,
        walk: &Stamps,
        stamp: &[Piece],
        ready: Ready,
        so_far: &mut FootprintProgress,
        next: &mut impl FnMut(Stamp, u64) -> u64,
    ) {
        let t = self.timing;
        self.stamps[1] += 1;
        let empty = stamp[0].stamp - so_far.gone_through;
        so_far.gone_through = stamp[0].stamp + 1;
        if empty > 0 {
            so_far.first_taken = so_far
                .first_taken
                .min(self.empty_stamps(ready, empty.into()));
        }
        let room = self.raster.behind.free_from(self.raster.when(ready));
        let now = self.raster.take(Ready { room, ..ready }, 1);
        so_far.first_taken = so_far.first_taken.min(now);
        self.raster.behind.take(now);
        let goes_on = stamp.iter().any(|piece| piece.pixels != 0);
        let room = if goes_on { self.gauss.behind.free() } else { 0 };
        let here = now + u64::from(t.raster.latency);
        let now = self.gauss.take(
            Ready {
                here,
                room,
                ..Ready::default()
            },
            1,
        );
        self.raster.behind.give(now);
        if goes_on {
            so_far.is_seen = true;
            self.gauss.behind.take(now);
            let taken = next(
                Stamp {
                    pieces: stamp,
                    texels: walk.texels(),
                },
                now + u64::from(t.gauss.latency),
            );
            self.gauss.behind.give(taken);
        }
    }

    /// Stamps without a kept pixel: each has a place until raster has tested it. Returns the cycle
    /// of the first one.
    #[inline(always)]
    fn empty_stamps(&mut self, ready: Ready, stamps: u64) -> u64 {
        // An infinitely fast unit tests them at once.
        if self.raster.is_lifted() {
            return self.raster.take_run(ready, stamps);
        }
        if self
            .raster
            .behind
            .has_run(self.raster.when(ready), self.timing.raster.latency)
        {
            let first = self.raster.take_run(ready, stamps);
            self.raster
                .behind
                .vanish(first + u64::from(self.timing.raster.latency), stamps);
            return first;
        }
        self.blocked_stamps(ready, stamps)
    }

    /// [`Self::empty_stamps`] without room in every cycle.
    #[inline(never)]
    fn blocked_stamps(&mut self, ready: Ready, stamps: u64) -> u64 {
        let latency = u64::from(self.timing.raster.latency);
        let mut first_taken = u64::MAX;
        for _ in 0..stamps {
            let room = self.raster.behind.free_from(self.raster.when(ready));
            let now = self.raster.take(Ready { room, ..ready }, 1);
            self.raster.behind.vanish(now + latency, 1);
            first_taken = first_taken.min(now);
        }
        first_taken
    }

    /// [`Self::footprint`] for frames in which pixels stop; also returns the cycle in which each
    /// stamp is written. Stamps with only stopped pixels are skipped. A footprint with only such
    /// stamps is dropped in one cycle, before its record arrives if the whole tile has stopped.
    pub fn footprint_of_stops(
        &mut self,
        walk: &mut Stamps,
        footprint: &Footprint,
        (corner, side): ([u16; 2], u32),
        (here, memory): (u64, u64),
        stops: &mut StopMap,
        mut next: impl FnMut(&[Piece], u64) -> [u64; 2],
    ) -> u64 {
        let t = self.timing;
        let ready = Ready {
            here,
            memory,
            ..Ready::default()
        };
        let stamps = walk.footprint(footprint, corner, side);
        let free = self.raster.free().max(here);
        if stops.all() <= free.max(memory) {
            return self.raster.take_run(
                Ready {
                    memory: memory.min(free.max(stops.all())),
                    ..ready
                },
                1,
            );
        }
        let mut first_taken = u64::MAX;
        let mut pieces = walk.kept().peekable();
        let mut runs = walk.runs().unwrap_or_default().iter().skip(1).peekable();
        for nth in 0..stamps {
            // The seed of a run, unless all of its pixels have stopped.
            if let Some(run) = runs.next_if(|run| run.stamps[0] == nth) {
                let now = self.raster.free().max(here).max(memory);
                let stopped = stops.area(|| {
                    let sides = run.sides.map(|side| side.map(usize::from));
                    sides.map(|[first, last]| first..last + 1)
                });
                if stopped > now {
                    self.seeds += 1;
                    first_taken = first_taken.min(self.raster.take_run(ready, 1));
                }
            }
            // A row is set up, as long as some of its pixels have not stopped.
            if self.row_cycles() > 0 && nth % walk.across() == 0 {
                let stopped = stops.area(|| walk.row(nth));
                for _ in 0..self.row_cycles() {
                    let now = self.raster.free().max(here).max(memory);
                    if stopped > now {
                        first_taken = first_taken.min(self.raster.take_run(ready, 1));
                    }
                }
            }
            let stamp = pieces
                .next_if(|stamp| stamp[0].stamp == nth)
                .unwrap_or_default();
            let now = self.raster.free().max(here).max(memory);
            let stopped = stops.area(|| walk.area(nth));
            let has_weight = stamp.iter().any(|piece| piece.pixels != 0);
            let whole = stops.whole(stamp);
            let room = if self.raster.is_lifted() && stamp.is_empty() {
                now
            } else {
                self.raster.behind.free_from(now)
            };
            // The stamp is tested until it has room, or until all of its pixels have stopped.
            let tested = if stopped <= room {
                now.max(stopped)
            } else {
                room
            };
            let tested_ready = Ready {
                room: tested,
                ..ready
            };
            if stopped <= tested {
                self.raster.stall(tested_ready);
                if has_weight {
                    stops.leave_out(tested);
                }
                continue;
            }
            self.stamps[0] += 1;
            if whole <= tested {
                let now = self.raster.take(tested_ready, 1);
                first_taken = first_taken.min(now);
                if !self.raster.is_lifted() {
                    self.raster
                        .behind
                        .vanish(now + u64::from(t.raster.latency), 1);
                }
                if has_weight {
                    stops.leave_out(tested);
                }
                continue;
            }
            self.stamps[1] += 1;
            let now = self.raster.take(tested_ready, 1);
            first_taken = first_taken.min(now);
            self.raster.behind.take(now);
            stops.kept(stamp, now, &mut self.kept);
            let goes_on = self.kept.iter().any(|piece| piece.pixels != 0);
            if has_weight && !goes_on {
                stops.leave_out(now);
            }
            let room = if goes_on { self.gauss.behind.free() } else { 0 };
            let here = now + u64::from(t.raster.latency);
            let now = self.gauss.take(
                Ready {
                    here,
                    room,
                    ..Ready::default()
                },
                1,
            );
            self.raster.behind.give(now);
            if goes_on {
                self.gauss.behind.take(now);
                let [taken, written] = next(&self.kept, now + u64::from(t.gauss.latency));
                self.gauss.behind.give(taken);
                stops.written(footprint.splat, &self.kept, written);
            }
        }
        if first_taken == u64::MAX {
            self.raster.take(ready, 1)
        } else {
            first_taken
        }
    }
}

/// State of a footprint in raster.
struct FootprintProgress {
    /// The cycle in which raster took its first stamp.
    first_taken: u64,
    /// Stamps that were tested.
    gone_through: u32,
    /// Whether a stamp had a weight.
    is_seen: bool,
}

/// A stamp with a weight: its pieces, and the texels of the footprint's fragments.
#[derive(Clone, Copy, Debug)]
pub struct Stamp<'a> {
    pub pieces: &'a [Piece],
    pub texels: &'a [u16],
}

/// Fragments: takes stamps, takes longer for merges, and stalls for pixels in flight.
///
/// ```text
/// stamp ─► its pixels, unit by unit ─┬─► taken, and written a latency later
///                                    └─► merges: shade, the first that is free ─► one after the other ─► written
/// ```
pub struct Merge<'a> {
    timing: &'a Microarchitecture,
    units: Vec<FragmentUnit>,
    /// Order of units in which the fragments of a stamp are shaded: by bit-reversed index, so that
    /// a doubled number of units keeps the order.
    order: Vec<usize>,
    pub shade: Unit,
    hazards: Hazards,
    /// Shade's cache of texels.
    pub texels: Option<Texels>,
    /// Cycle in which all taken stamps are written.
    pub written: u64,
    /// Cycles for which merges stalled for light without reflections.
    pub light: u64,
    /// Cycle from which the next stamp is the first in the FIFO.
    first_from: u64,
    /// The units' shares of the current stamp.
    parts: Vec<UnitShare>,
}

/// A fragment unit with its share of the pixels.
struct FragmentUnit {
    unit: Unit,
    /// Ends of the last merges, as many as can be in flight.
    in_flight: VecDeque<u64>,
    /// The end of the last merge.
    merged: u64,
}

/// A unit's share of a stamp: merges, and fragments that are shaded for them.
struct UnitShare {
    unit: usize,
    merges: u64,
    shades: u64,
}

impl<'a> Merge<'a> {
    /// For engine `nth`.
    pub fn new(
        timing: &'a Microarchitecture,
        work: &Work,
        before: &'static str,
        behind: Option<&'static str>,
        detail: Detail,
        nth: u32,
    ) -> Self {
        let pace = timing.fragment;
        let unit = |of: u32| {
            let unit = Unit::new(
                unit::FRAGMENT,
                Pace { units: 1, ..pace },
                [Some(before), behind],
                detail,
                timing.lifted,
            );
            FragmentUnit {
                unit: unit.behind_others(nth * pace.units + of),
                in_flight: VecDeque::new(),
                merged: 0,
            }
        };
        let shade = Unit::new(
            unit::SHADE,
            timing.shade,
            [Some(unit::FRAGMENT), None],
            detail,
            timing.lifted,
        );
        Merge {
            timing,
            units: (0..pace.units).map(unit).collect(),
            order: (0..pace.units)
                .map(|of| (of.reverse_bits() as u64 * u64::from(pace.units) / (1 << 32)) as usize)
                .collect(),
            shade: shade.behind_others(nth * timing.shade.units),
            hazards: Hazards::new(timing, work),
            texels: Texels::new(timing, work),
            written: 0,
            light: 0,
            first_from: 0,
            parts: Vec::new(),
        }
    }

    /// Takes a stamp; returns the cycle, and the cycle in which it is written.
    #[inline(always)]
    pub fn stamp(&mut self, stamp: Stamp, ready: Ready, memory: &mut Memory) -> [u64; 2] {
        let is_one = self.units.len() == 1;
        let [now, written] = if is_one {
            self.stamp_of_one(stamp, ready, memory)
        } else {
            self.stamp_of_several(stamp.pieces, ready)
        };
        self.written = self.written.max(written);
        [now, written]
    }

    /// One unit has all pixels.
    #[inline(always)]
    fn stamp_of_one(
        &mut self,
        Stamp {
            pieces: stamp,
            texels,
        }: Stamp,
        ready: Ready,
        memory: &mut Memory,
    ) -> [u64; 2] {
        let hazard = self
            .hazards
            .until(stamp, ready.here.max(self.units[0].unit.free()));
        let ready = Ready { hazard, ..ready };
        let now = self.units[0].unit.when(ready);
        let [merges, shades] = match stamp {
            // Common case.
            [piece] => piece.merges(u16::MAX),
            _ => merges_of(stamp, |_| u16::MAX),
        };
        let part = UnitShare {
            unit: 0,
            merges,
            shades,
        };
        let written = if shades > 0 && self.texels.is_some() {
            let lit = self.mirrored(stamp, texels, now, memory);
            self.merge(part, ready, now, lit)
        } else {
            self.take(part, ready, now)
        };
        let under_way =
            written - u64::from(self.timing.fragment.latency) + u64::from(self.timing.hazard);
        if merges == 0 || self.timing.merges_in_flight == 1 {
            self.hazards.take(stamp, under_way);
        } else {
            self.hazards.take_merges(stamp, |_| u16::MAX, under_way);
        }
        [now, written]
    }

    /// Several units share the pixels. All units with a pixel take the stamp in the same cycle, and
    /// continue independently.
    #[inline(never)]
    fn stamp_of_several(&mut self, stamp: &[Piece], ready: Ready) -> [u64; 2] {
        let t = self.timing;
        // One stamp leaves the FIFO per cycle.
        let here = ready.here.max(self.first_from);
        let mut parts = std::mem::take(&mut self.parts);
        parts.clear();
        parts.extend(
            self.order
                .iter()
                .copied()
                .filter(|unit| has_part(t, stamp, *unit))
                .map(|unit| {
                    let [merges, shades] = merges_of(stamp, |piece| of_unit(t, unit, piece));
                    UnitShare {
                        unit,
                        merges,
                        shades,
                    }
                }),
        );
        // Free units stall for the others.
        let free = parts
            .iter()
            .map(|part| self.units[part.unit].unit.free())
            .max()
            .unwrap_or(0);
        let hazard = self.hazards.until(stamp, here).max(free);
        let ready = Ready {
            here,
            hazard,
            ..ready
        };
        let now = here.max(ready.memory).max(hazard).max(ready.room);
        self.first_from = now + 1;
        let mut written = 0;
        let under_way = u64::from(t.hazard);
        for UnitShare {
            unit,
            merges,
            shades,
        } in parts.drain(..)
        {
            let of_unit = |piece: &Piece| of_unit(t, unit, piece);
            let part_written = self.take(
                UnitShare {
                    unit,
                    merges,
                    shades,
                },
                ready,
                now,
            );
            written = written.max(part_written);
            if merges > 0 {
                self.hazards.take_merges(
                    stamp,
                    of_unit,
                    part_written - u64::from(t.fragment.latency) + under_way,
                );
            }
        }
        self.parts = parts;
        // Merged pixels are in flight for longer; that is recorded above.
        self.hazards.take(stamp, now + under_way);
        [now, written]
    }

    /// A unit takes its share of a stamp in this cycle, which must be possible; returns the cycle
    /// in which it is written.
    #[inline(always)]
    fn take(&mut self, part: UnitShare, ready: Ready, now: u64) -> u64 {
        let t = self.timing;
        if part.merges == 0 {
            self.units[part.unit].unit.take(ready, 1);
            return now + u64::from(t.fragment.latency);
        }
        let requested = now + 1;
        let lit = light(&mut self.shade, t, requested, part.shades);
        self.light += lit - requested;
        self.merge(part, ready, now, lit)
    }

    /// Shades the fragments of a stamp's merges, with texels from memory, from the next cycle on;
    /// returns the cycle of the last light.
    fn mirrored(&mut self, stamp: &[Piece], texels: &[u16], now: u64, memory: &mut Memory) -> u64 {
        let shade = self.timing.shade;
        let mut last = now + 1;
        let Some(cache) = &mut self.texels else {
            return last;
        };
        for texel in stamp.iter().flat_map(|piece| {
            &texels[piece.texels as usize..][..piece.merges(u16::MAX)[1] as usize]
        }) {
            let ready = Ready {
                here: now + 1,
                ..Ready::default()
            };
            [last, _] = cache.shade(
                &mut self.shade,
                ready,
                shade.interval.into(),
                *texel,
                memory,
            );
        }
        last + if self.shade.is_lifted() {
            0
        } else {
            u64::from(shade.latency)
        }
    }

    /// A unit merges its share of a stamp, which it takes now, when light has arrived; returns the
    /// cycle in which it is written.
    #[inline(always)]
    fn merge(
        &mut self,
        UnitShare { unit, merges, .. }: UnitShare,
        ready: Ready,
        now: u64,
        lit: u64,
    ) -> u64 {
        let t = self.timing;
        let latency = u64::from(t.fragment.latency);
        let of = &mut self.units[unit];
        // An infinitely fast unit does not forward: its pixels remain in flight.
        if of.unit.is_lifted() {
            of.unit.take(ready, 1);
            return now + latency;
        }
        of.merged = lit.max(of.merged) + merges * u64::from(t.timing.fragment.merge);
        let most = t.merges_in_flight as usize;
        if of.in_flight.len() == most {
            of.in_flight.pop_front();
        }
        of.in_flight.push_back(of.merged);
        // At the greatest number of merges in flight, it takes nothing until the first of them
        // ends.
        let first = of
            .in_flight
            .front()
            .copied()
            .filter(|_| of.in_flight.len() == most)
            .unwrap_or(0);
        of.unit.take(ready, first.saturating_sub(now).max(1));
        of.merged - 1 + latency
    }

    /// The first of its fragment units.
    pub fn first_unit(&mut self) -> &mut Unit {
        &mut self.units[0].unit
    }

    /// The cycle in which a fragment unit is free for the next stamp.
    pub fn free(&self) -> u64 {
        self.units
            .iter()
            .map(|of| of.unit.free())
            .min()
            .unwrap_or(0)
    }

    /// Its units: fragment and shade.
    pub fn all(&self) -> impl Iterator<Item = &Unit> {
        self.units.iter().map(|of| &of.unit).chain([&self.shade])
    }

    /// Its fragment units, and shade.
    pub fn units(self) -> (impl Iterator<Item = Unit>, Unit) {
        (self.units.into_iter().map(|of| of.unit), self.shade)
    }
}

/// Shades `fragments` fragments that are requested in this cycle; returns the cycle of the last
/// light.
pub fn light(shade: &mut Unit, timing: &Microarchitecture, requested: u64, fragments: u64) -> u64 {
    let mut last = requested;
    for _ in 0..fragments {
        last = shade.take(
            Ready {
                here: requested,
                ..Ready::default()
            },
            timing.shade.interval.into(),
        );
    }
    if fragments == 0 || shade.is_lifted() {
        requested
    } else {
        last + u64::from(timing.shade.latency)
    }
}

/// Merges of a stamp in the given pixels of each piece, and fragments shaded for them.
#[inline(always)]
pub fn merges_of(stamp: &[Piece], of: impl Fn(&Piece) -> u16) -> [u64; 2] {
    stamp.iter().fold([0; 2], |[merges, shades], piece| {
        let [more, more_shades] = piece.merges(of(piece));
        [merges + more, shades + more_shades]
    })
}

/// Pixels of a piece's strip that belong to a fragment unit: (column + row · columns of a stamp)
/// mod units, where units divide a strip.
fn of_unit(timing: &Microarchitecture, unit: usize, piece: &Piece) -> u16 {
    let units = timing.fragment.units as usize;
    let first = usize::from(piece.corner[0])
        + usize::from(piece.corner[1]) * timing.timing.raster.lanes[0] as usize;
    let column = (unit + first.wrapping_neg() % units) % units;
    (column..TILE_PX)
        .step_by(units)
        .fold(0, |all, column| all | 1 << column)
}

/// Whether a unit has a pixel of a stamp.
fn has_part(timing: &Microarchitecture, stamp: &[Piece], unit: usize) -> bool {
    stamp
        .iter()
        .any(|piece| (piece.pixels | piece.merged) & of_unit(timing, unit, piece) != 0)
}

/// Resolve: the pixels of a line or a tile. It takes one fragment per cycle, merged (and so shaded)
/// or not. Several units share the pixels: the next pixel goes to the first free unit. All begin at
/// the same time.
pub struct Resolve<'a> {
    timing: &'a Microarchitecture,
    units: Vec<Unit>,
    held: Arc<FinalPixels>,
    /// Cycles for which each unit is occupied by its pixels.
    cycles: Vec<u64>,
    /// Cycles for which the only unit stalled for light, of pixels without reflections: occupied
    /// beyond its own cycles, until the last light arrived.
    pub light: u64,
}

/// Final contents of each pixel: fragments, and the number of them that are not shaded yet.
pub struct FinalPixels {
    pixels: Vec<[u8; 2]>,
    width: u32,
    /// For a frame with reflections, the texels of fragments that are shaded in resolve, pixel by
    /// pixel, and the index of each pixel's first one.
    texels: Vec<u16>,
    first_texels: Vec<u32>,
}

impl FinalPixels {
    pub fn new(work: &Work) -> Self {
        let (texels, first_texels) = if work.mirrors {
            work.texels_of_pixels()
        } else {
            (Vec::new(), Vec::new())
        };
        FinalPixels {
            pixels: work.held(),
            width: work.width,
            texels,
            first_texels,
        }
    }

    /// Pixels in these columns and rows of the picture.
    fn of(&self, columns: Range<u32>, rows: Range<u32>) -> impl Iterator<Item = &[u8; 2]> {
        let at = |row: u32, column: u32| (row * self.width + column) as usize;
        rows.flat_map(move |row| &self.pixels[at(row, columns.start)..at(row, columns.end)])
    }

    /// Texels of their fragments that are shaded in resolve.
    fn texels_of(&self, columns: Range<u32>, rows: Range<u32>) -> impl Iterator<Item = &u16> {
        let at = |row: u32, column: u32| (row * self.width + column) as usize;
        let pixels = rows.flat_map(move |row| at(row, columns.start)..at(row, columns.end));
        pixels.flat_map(|pixel| {
            &self.texels[self.first_texels[pixel] as usize..][..usize::from(self.pixels[pixel][1])]
        })
    }
}

impl<'a> Resolve<'a> {
    /// For engine `nth`.
    pub fn new(
        timing: &'a Microarchitecture,
        held: Arc<FinalPixels>,
        detail: Detail,
        nth: u32,
    ) -> Self {
        let pace = timing.resolve;
        let blocked_by = (pace.units > 1).then_some(unit::RESOLVE);
        let unit = |of: u32| {
            let unit = Unit::new(
                unit::RESOLVE,
                Pace { units: 1, ..pace },
                [Some(unit::FRAGMENT), blocked_by],
                detail,
                timing.lifted,
            );
            unit.behind_others(nth * pace.units + of)
        };
        Resolve {
            timing,
            units: (0..pace.units).map(unit).collect(),
            held,
            cycles: vec![0; pace.units as usize],
            light: 0,
        }
    }

    /// Resolves these columns and rows of the picture; returns the cycle of the last word.
    pub fn pixels(
        &mut self,
        columns: Range<u32>,
        rows: Range<u32>,
        ready: Ready,
        (shade, texels): (&mut Unit, &mut Option<Texels>),
        memory: &mut Memory,
    ) -> u64 {
        let t = self.timing;
        let interval = if shade.is_lifted() {
            0
        } else {
            u64::from(t.shade.interval)
        };
        let shaders = u64::from(t.shade.units);
        let cycles = &mut self.cycles;
        cycles.fill(0);
        let (mut shades, mut own) = (0, 0);
        for [fragments, left] in self.held.of(columns.clone(), rows.clone()) {
            let left = u64::from(*left);
            let alone = u64::from(*fragments).max(t.resolve.interval.into());
            let held = (left.div_ceil(shaders) * interval).max(alone);
            own += alone;
            if let Some(first) = cycles.iter_mut().min() {
                *first += held;
            }
            shades += left;
        }
        // Light arrives at most at the rate of all shade units together. Units without a pixel also
        // check this.
        let light = (shades.div_ceil(shaders) * interval).max(1);
        cycles
            .iter_mut()
            .for_each(|cycles| *cycles = light.max(*cycles));
        let free = self.units.iter().map(Unit::free).max().unwrap_or(0);
        let ready = Ready {
            room: if self.units.len() > 1 {
                ready.room.max(free)
            } else {
                ready.room
            },
            ..ready
        };
        if let Some(cache) = texels {
            // There is only one unit in this case.
            let here = ready.here.max(free).max(ready.memory).max(ready.room);
            for texel in self.held.texels_of(columns, rows) {
                let [_, stalled] = cache.shade(
                    shade,
                    Ready {
                        here,
                        ..Ready::default()
                    },
                    interval,
                    *texel,
                    memory,
                );
                cycles[0] += stalled;
            }
        }
        let mut now = 0;
        for (unit, cycles) in self.units.iter_mut().zip(&*cycles) {
            now = unit.take(ready, *cycles);
        }
        let is_lifted = self.units.iter().all(Unit::is_lifted);
        let most = cycles.iter().copied().max().unwrap_or(0);
        let done = now + if is_lifted { 0 } else { most } + u64::from(t.resolve.latency);
        if shades == 0 {
            return done;
        }
        self.light += most.saturating_sub(own) + u64::from(t.shade.latency);
        for nth in 0..if texels.is_some() {
            0
        } else {
            shaders.min(shades)
        } {
            let share = (shades - nth).div_ceil(shaders);
            shade.take(
                Ready {
                    here: now,
                    ..Ready::default()
                },
                share * interval,
            );
        }
        done + if shade.is_lifted() {
            0
        } else {
            u64::from(t.shade.latency)
        }
    }

    /// The cycle in which one of its units is free.
    pub fn free(&self) -> u64 {
        self.units.iter().map(Unit::free).min().unwrap_or(0)
    }

    /// Its units.
    pub fn all(&self) -> impl Iterator<Item = &Unit> {
        self.units.iter()
    }

    /// Its units.
    pub fn units(self) -> Vec<Unit> {
        self.units
    }
}

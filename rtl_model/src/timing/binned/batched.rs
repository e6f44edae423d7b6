//! Batched: up to eight machines replay the same tiles, one machine per lane.
//!
//! ```text
//! each machine separately ─► arrival of an entry ──┐                                  ┌─► list: its place is free again
//!                the entry's stamps, read once ────┴─► raster ─► gauss ─► fragment ───┴─► tile done ─► resolve
//!                                                         eight machines at a time
//! ```
//! The machines can differ in everything that does not change the order of their stamps: latencies,
//! FIFOs, memory, infinitely fast units. Lists, memory, shade and resolve are those of [`super`].
//! Raster, gauss and fragment take a stamp on eight machines at once, by the same rules as the
//! units of `stages.rs`. This is not hardware, but lets the simulator use the host's vector units.
//!
//! Law: `a_batched_replay_equals_single_replays`.

use super::super::account::{Account, Detail, Unit};
use super::super::stages::{light, merges_of};
use super::super::stamps::{Piece, Stamps, cuts};
use super::{DrawnTile, Engine, Listed, Lists, SecondPass};
use crate::elaboration::microarchitecture::Microarchitecture;
use crate::elaboration::unit;
use crate::kernels::host::{Kernel, vectorised};
use crate::machine::Machine;
use crate::machine::timing::{Organisation, Timing};
use crate::num::lanes::{LANES, Lanes};
use crate::timing::frame::RecordedFrame;
use crate::timing::{Cycles, replay_on};
use crate::work::{Footprint, TILE_PX, Work};
use rayon::prelude::*;
use std::array;
use std::collections::VecDeque;
use std::fmt::Debug;

/// Whether two machines have the same stamps in the same order, one tile at a time.
fn are_alike(one: &Microarchitecture, other: &Microarchitecture) -> bool {
    let words = |t: &Microarchitecture| t.bin.map(|bin| bin.words);
    of_timing(&one.timing) == of_timing(&other.timing) && words(one) == words(other)
}

/// Fields of timing that decide the order of stamps.
fn of_timing(t: &Timing) -> impl PartialEq + Debug {
    (t.organisation, t.tile.side_px, t.queue, t.raster.lanes)
}

/// Machines whose values differ are never in one batch ([`replay_all`]). It contains the fields
/// that decide the order of stamps.
pub fn stamp_order(machine: &Machine) -> impl PartialEq + Debug {
    (of_timing(&machine.timing), machine.bin)
}

/// Whether a machine can be batched, for a frame without reflections and stops.
fn can_be_batched(timing: &Microarchitecture) -> bool {
    let t = &timing.timing;
    let is_plain = t.raster.row_cycles.is_none() && t.tile.clear_cycles.is_none();
    t.organisation == Organisation::Binned
        && timing.is_single()
        && !timing.overlaps_sort()
        && !timing.keeps_lists()
        && !cuts(timing)
        && is_plain
}

/// Most machines of a batch.
pub const MOST_OF_A_BATCH: usize = LANES;
/// Smaller batches are not faster than single replays.
const FEWEST: usize = 4;

/// Replays a frame on several machines. The cycles of each are those of a single replay.
pub fn replay_all(timings: &[&Microarchitecture], work: &Work, detail: Detail) -> Vec<Cycles> {
    replay_frame(timings, &RecordedFrame::new(work), detail)
}

/// [`replay_all`], with what the replays of a frame share.
pub fn replay_frame(
    timings: &[&Microarchitecture],
    frame: &RecordedFrame,
    detail: Detail,
) -> Vec<Cycles> {
    let batches: Vec<Vec<usize>> = batches(timings, frame.work, detail);
    let of_batch = |batch: &Vec<usize>| -> Vec<(usize, Cycles)> {
        let machines: Vec<&Microarchitecture> = batch.iter().map(|nth| timings[*nth]).collect();
        let cycles = match machines[..] {
            [one] => vec![replay_on(one, frame, detail)],
            _ => replay_batch(&machines, frame, detail),
        };
        batch.iter().copied().zip(cycles).collect()
    };
    let mut all: Vec<(usize, Cycles)> = batches.par_iter().flat_map_iter(of_batch).collect();
    all.sort_unstable_by_key(|(nth, _)| *nth);
    all.into_iter().map(|(_, cycles)| cycles).collect()
}

/// Groups of machines for batches and for single replays.
fn batches(timings: &[&Microarchitecture], work: &Work, detail: Detail) -> Vec<Vec<usize>> {
    let (mut batches, mut alone, mut left): (Vec<_>, Vec<usize>, Vec<usize>) = Default::default();
    let is_plain =
        timings.len() >= FEWEST && detail <= Detail::Accounts && !work.mirrors && !work.stops();
    for (nth, timing) in timings.iter().enumerate() {
        if is_plain && can_be_batched(timing) {
            left.push(nth)
        } else {
            alone.push(nth)
        }
    }
    while let Some(first) = left.first().copied() {
        let (batch, others): (Vec<usize>, Vec<usize>) = left
            .into_iter()
            .partition(|nth| are_alike(timings[first], timings[*nth]));
        for batch in batch.chunks(LANES) {
            if batch.len() < FEWEST {
                alone.extend(batch)
            } else {
                batches.push(batch.to_vec())
            }
        }
        left = others;
    }
    batches.extend(alone.into_iter().map(|nth| vec![nth]));
    batches
}

/// Replays a batch of at most eight machines.
fn replay_batch(
    timings: &[&Microarchitecture],
    frame: &RecordedFrame,
    detail: Detail,
) -> Vec<Cycles> {
    let (work, lists, held) = (frame.work, frame.lists(timings[0]), frame.held());
    let mut machines: Vec<BatchedMachine> = Vec::new();
    for t in timings {
        let written = machines
            .iter()
            .find(|machine| machine.pass.t.same_lists_as(t, work.preshaded));
        let listed = written.map_or_else(
            || Listed::new(t, work, &lists, detail),
            |machine| machine.listed.clone(),
        );
        let engine = Engine::new(t, work, &held, listed.from, detail, 0);
        let pass = SecondPass::new(t, work, &lists, listed.from);
        machines.push(BatchedMachine {
            listed,
            pass,
            engine,
        });
    }
    let stamps = vectorised(BatchedTiles {
        machines: &mut machines,
        work,
        lists: &lists,
    });
    let cycles = |machine: BatchedMachine| {
        machine
            .listed
            .cycles(vec![machine.engine], stamps, None, detail)
    };
    machines
        .into_iter()
        .map(cycles)
        .map(|cycles| Cycles {
            harmonics: work.harmonics,
            ..cycles
        })
        .collect()
}

/// A machine of the batch.
struct BatchedMachine<'a> {
    listed: Listed<'a>,
    pass: SecondPass<'a>,
    engine: Engine<'a>,
}

impl BatchedMachine<'_> {
    /// The engine takes the next tile, and begins to draw it.
    fn begin(&mut self) -> DrawnTile {
        let taken = self.pass.begin(&mut self.engine);
        self.pass.begin_drawing(&mut self.engine, taken, None)
    }

    /// Reads the next entry of a tile, and its record: the cycles from which raster can take it, and
    /// in which the record arrives.
    #[inline(always)]
    fn read(&mut self, tile: &mut DrawnTile) -> [u64; 2] {
        let memory = &mut self.listed.memory;
        let read = self.pass.read(&mut self.engine, None, u64::MAX, memory);
        let cycles = read.map_or([0; 2], |read| {
            let here = self.pass.read_record(&mut self.engine, tile, read, memory);
            [read.now + 1, here]
        });
        tile.nth += 1;
        cycles
    }
}

/// Replays all tiles; returns the number of stamps, and of those with a kept pixel.
struct BatchedTiles<'m, 'a> {
    machines: &'m mut [BatchedMachine<'a>],
    work: &'a Work,
    lists: &'a Lists,
}

impl Kernel for BatchedTiles<'_, '_> {
    type Output = [u64; 2];

    #[inline(always)]
    fn run<L: Lanes>(self) -> [u64; 2] {
        let BatchedTiles {
            machines,
            work,
            lists,
        } = self;
        let timings: Vec<&Microarchitecture> =
            machines.iter().map(|machine| machine.pass.t).collect();
        let mut fill = BatchedFill::<L>::new(&timings, work);
        let t = timings[0];
        let side = t.timing.tile.side_px;
        let mut walk = Stamps::new(work, t.timing.raster.lanes);
        for machine in &mut *machines {
            machine
                .pass
                .write_empty(0, machine.pass.from, &mut machine.listed.memory);
        }
        let turns: Vec<usize> = machines[0]
            .pass
            .queue
            .iter()
            .map(|(_, place)| *place)
            .collect();
        let mut footprints = Vec::new();
        for place in turns {
            let mut tiles: Vec<DrawnTile> =
                machines.iter_mut().map(BatchedMachine::begin).collect();
            fill.begin(
                &of_lanes(&tiles, |tile| tile.buffer_free),
                &of_lanes(machines, |machine| machine.engine.merge.written),
            );
            let corner = tiles[0].corner.map(|at| at as u16);
            work.look_up(lists.of(place), &mut footprints);
            let mut boxed = 0;
            for (footprint, entry) in footprints.iter().zip(lists.of(place)) {
                boxed = lists.skip(&mut walk, work, (place, corner), boxed, *entry);
                let (mut from, mut here) = ([0; LANES], [0; LANES]);
                for (nth, (machine, tile)) in machines.iter_mut().zip(&mut tiles).enumerate() {
                    [from[nth], here[nth]] = machine.read(tile).map(|cycle| cycle as i64);
                }
                repeat(&mut from, machines.len());
                repeat(&mut here, machines.len());
                let ready = [L::from_array(from), L::from_array(here)];
                let taken = fill.footprint(&mut walk, footprint, (corner, side), ready, machines);
                for (machine, taken) in machines.iter_mut().zip(taken.to_array()) {
                    machine.engine.list.behind.give(taken as u64);
                }
            }
            for (nth, (machine, tile)) in machines.iter_mut().zip(&tiles).enumerate() {
                machine.engine.merge.written = fill.written.to_array()[nth] as u64;
                let memory = &mut machine.listed.memory;
                machine
                    .pass
                    .resolve(&mut machine.engine, tile, None, memory);
            }
        }
        for (nth, BatchedMachine { engine, .. }) in machines.iter_mut().enumerate() {
            fill.raster.set_state(nth, &mut engine.fill.raster);
            fill.gauss.set_state(nth, &mut engine.fill.gauss);
            fill.fragment.set_state(nth, engine.merge.first_unit());
            engine.merge.light += fill.light[nth];
        }
        fill.stamps
    }
}

/// One value per machine and lane. The last machine fills the remaining lanes.
fn of_lanes<T>(machines: &[T], of: impl Fn(&T) -> u64) -> [i64; LANES] {
    array::from_fn(|lane| of(&machines[lane.min(machines.len() - 1)]) as i64)
}

/// Fills the remaining lanes with the time of the last machine.
fn repeat(of_lanes: &mut [i64; LANES], machines: usize) {
    let last = of_lanes[machines - 1];
    of_lanes[machines..].fill(last);
}

/// A unit of each machine, and its cycles.
struct BatchedUnit<L> {
    /// Mask of cycles: 0 for a unit that is infinitely fast.
    held: L,
    free: L,
    busy: L,
    blocked: L,
    memory: L,
    hazard: L,
    items: u64,
}

impl<L: Lanes> BatchedUnit<L> {
    fn new(timings: &[&Microarchitecture], name: &'static str) -> Self {
        let held = of_lanes(
            timings,
            |t| if t.lifted == Some(name) { 0 } else { u64::MAX },
        );
        let none = L::splat(0);
        BatchedUnit {
            held: L::from_array(held),
            free: none,
            busy: none,
            blocked: none,
            memory: none,
            hazard: none,
            items: 0,
        }
    }

    /// Takes an item by the cycle in which it has arrived, its data has, its hazard has ended, and
    /// there is room, each the maximum so far. The item occupies the unit for `cycles`.
    #[inline(always)]
    fn hold(&mut self, [here, with_memory, unblocked, now]: [L; 4], items: u64, cycles: L) {
        let cycles = cycles & self.held;
        self.memory = self.memory + (with_memory - here);
        self.hazard = self.hazard + (unblocked - with_memory);
        self.blocked = self.blocked + (now - with_memory);
        self.busy = self.busy + cycles;
        self.free = now + cycles;
        self.items += items;
    }

    /// Sets the state of a unit of one machine.
    fn set_state(&self, lane: usize, unit: &mut Unit) {
        let of = |lanes: L| lanes.to_array()[lane] as u64;
        let account = Account {
            busy: of(self.busy),
            starved: 0,
            blocked: of(self.blocked),
            memory: of(self.memory),
        };
        unit.set_state(of(self.free), self.items, account, of(self.hazard));
    }
}

/// The places behind a unit of each machine, like
/// [`UnitPlaces`](super::super::account::UnitPlaces).
struct BatchedPlaces<L> {
    /// By item index and machine, the cycle from which its place is free again.
    free: Vec<[i64; LANES]>,
    mask: usize,
    /// Number of places, and the offset from an item's first word to that of the item `room` items
    /// earlier.
    room: [i64; LANES],
    back: L,
    /// Number of places, if all machines have the same.
    even: Option<usize>,
    claimed: usize,
    given: usize,
    /// Per machine, items without a result that stalled: the cycles from which their places are
    /// free again, and their number.
    vanishing: [VecDeque<i64>; LANES],
    vanishing_items: [i64; LANES],
}

impl<L: Lanes> BatchedPlaces<L> {
    fn new(room: [i64; LANES]) -> Self {
        let most = room.into_iter().fold(1, i64::max) as usize;
        let size = most.next_power_of_two();
        BatchedPlaces {
            free: vec![[0; LANES]; size],
            mask: size - 1,
            room,
            back: L::from_array(array::from_fn(|lane| {
                lane as i64 - LANES as i64 * room[lane]
            })),
            even: room
                .iter()
                .all(|other| *other == room[0])
                .then_some(room[0] as usize),
            claimed: 0,
            given: 0,
            vanishing: Default::default(),
            vanishing_items: [0; LANES],
        }
    }

    /// The first cycle in which a place is free besides those of items that vanish.
    #[inline(always)]
    fn free_except(&self, vanishing: L) -> L {
        let first = L::splat((self.claimed * LANES) as i64) + self.back;
        (first + vanishing.left(LANES.ilog2())).look_up(self.free.as_flattened())
    }

    #[inline(always)]
    fn free(&self) -> L {
        match self.even {
            Some(room) => L::from_array(self.free[self.claimed.wrapping_sub(room) & self.mask]),
            None => self.free_except(L::splat(0)),
        }
    }

    /// Where a place is free besides those of items that vanish.
    #[inline(always)]
    fn are_free(&self, now: L, vanishing: L) -> L {
        let late = self.free_except(vanishing).above(now);
        let some = L::from_array(self.room).above(vanishing);
        some - (some & late)
    }

    /// The first cycle from `now` on in which a place is free.
    #[inline(always)]
    fn free_from(&mut self, now: L) -> L {
        let taken = L::splat(-1) - self.are_free(now, L::from_array(self.vanishing_items));
        if taken.signs() == 0 {
            return now;
        }
        let mut free = now.max(self.free()).to_array();
        self.free_late(&now.to_array(), &mut free, taken.signs());
        L::from_array(free)
    }

    /// [`Self::free_from`] if on some machines it matters which items have vanished by now. `free`
    /// has the cycles for the case that all have.
    #[inline(never)]
    fn free_late(&mut self, now: &[i64; LANES], free: &mut [i64; LANES], mut taken: u8) {
        while taken != 0 {
            let lane = taken.trailing_zeros() as usize;
            taken &= taken - 1;
            self.forget_vanished(lane, now[lane]);
            if self.vanishing_items[lane] > 0 {
                free[lane] = self.free_except_left(lane, now[lane]);
            }
        }
    }

    /// Removes the items of a machine that have vanished by now.
    #[inline(always)]
    fn forget_vanished(&mut self, lane: usize, now: i64) {
        let left = &mut self.vanishing_items[lane];
        while self.vanishing[lane]
            .pop_front_if(|from| *from <= now)
            .is_some()
        {
            *left -= 1;
        }
    }

    /// The first cycle from `now` on in which a place is free on a machine, besides those of items
    /// that have not vanished, as in
    /// [`UnitPlaces::free_from`](super::super::account::UnitPlaces::free_from).
    fn free_except_left(&self, lane: usize, now: i64) -> i64 {
        let (mut at, mut left) = (now, self.vanishing_items[lane]);
        if self.given_except(lane, left) <= now {
            return now;
        }
        for again in &self.vanishing[lane] {
            let given = self.given_except(lane, left).max(at);
            if given <= *again {
                return given;
            }
            (at, left) = (*again, left - 1);
        }
        self.given_except(lane, left).max(at)
    }

    fn given_except(&self, lane: usize, vanishing: i64) -> i64 {
        let places = self.room[lane] - vanishing;
        if places <= 0 {
            i64::MAX
        } else {
            self.free[self.claimed.wrapping_sub(places as usize) & self.mask][lane]
        }
    }

    /// Records an item that vanishes on a machine. Its place is free again from `from` on.
    fn vanish(&mut self, lane: usize, from: i64) {
        self.vanishing[lane].push_back(from);
        self.vanishing_items[lane] += 1;
    }

    #[inline(always)]
    fn take(&mut self) {
        self.claimed += 1;
    }

    #[inline(always)]
    fn give(&mut self, now: L) {
        self.free[self.given & self.mask] = (now + L::splat(1)).to_array();
        self.given += 1;
    }
}

/// A piece in flight: its end on each machine, its pixels, and the index of the previous piece of
/// its strip.
#[derive(Clone, Copy, Default)]
struct BatchedPiece {
    until: [i64; LANES],
    before: u32,
    pixels: u16,
}

/// Pixels in flight, like [`Hazards`](super::super::hazards::Hazards).
struct BatchedHazards {
    last: Vec<BatchedPiece>,
    before: Vec<BatchedPiece>,
    turn: usize,
}

impl BatchedHazards {
    fn new(timings: &[&Microarchitecture], work: &Work) -> Self {
        let columns = (work.width as usize).div_ceil(TILE_PX);
        let under_way = timings
            .iter()
            .map(|t| super::super::hazards::most_under_way(t))
            .max()
            .unwrap_or(1);
        let last = vec![BatchedPiece::default(); columns * work.height as usize];
        BatchedHazards {
            last,
            before: vec![BatchedPiece::default(); under_way],
            turn: 0,
        }
    }

    /// While a piece is in flight on any machine, the pieces before it are kept.
    #[inline(always)]
    fn until<L: Lanes>(&self, stamp: &[Piece], now: L) -> L {
        let mut until = now;
        for piece in stamp {
            let mut taken = &self.last[piece.strip as usize];
            loop {
                let of_taken = L::from_array(taken.until);
                if of_taken.above(until).signs() == 0 {
                    break;
                }
                if taken.pixels & piece.pixels != 0 {
                    until = until.max(of_taken);
                }
                taken = &self.before[taken.before as usize];
            }
        }
        until
    }

    #[inline(always)]
    fn take<L: Lanes>(&mut self, stamp: &[Piece], until: L) {
        for piece in stamp {
            let last = &mut self.last[piece.strip as usize];
            self.before[self.turn] = *last;
            *last = BatchedPiece {
                until: until.to_array(),
                before: self.turn as u32,
                pixels: piece.pixels,
            };
            self.turn = if self.turn + 1 == self.before.len() {
                0
            } else {
                self.turn + 1
            };
        }
    }
}

/// Raster, gauss and fragment of all machines.
struct BatchedFill<'a, L> {
    timings: Vec<&'a Microarchitecture>,
    raster: BatchedUnit<L>,
    gauss: BatchedUnit<L>,
    fragment: BatchedUnit<L>,
    behind_raster: BatchedPlaces<L>,
    behind_gauss: BatchedPlaces<L>,
    hazards: BatchedHazards,
    /// Latencies, and the cycles for which a pixel is in flight.
    latencies: [L; 3],
    hazard: L,
    /// The cycle from which the buffer of the tile is free.
    room: L,
    /// The cycle in which all taken stamps are written.
    written: L,
    /// Cycles for which the merges of each machine stalled for light.
    light: [u64; LANES],
    stamps: [u64; 2],
}

/// Cycles of an entry.
struct BatchedEntry<L> {
    here: L,
    memory: L,
}

impl<'a, L: Lanes> BatchedFill<'a, L> {
    fn new(timings: &[&'a Microarchitecture], work: &Work) -> Self {
        let latency =
            |of: fn(&Microarchitecture) -> u32| L::from_array(of_lanes(timings, |t| of(t).into()));
        BatchedFill {
            timings: timings.to_vec(),
            raster: BatchedUnit::new(timings, unit::RASTER),
            gauss: BatchedUnit::new(timings, unit::GAUSS),
            fragment: BatchedUnit::new(timings, unit::FRAGMENT),
            behind_raster: BatchedPlaces::new(of_lanes(timings, |t| t.raster.room() as u64)),
            behind_gauss: BatchedPlaces::new(of_lanes(timings, |t| t.gauss.room() as u64)),
            hazards: BatchedHazards::new(timings, work),
            latencies: [
                latency(|t| t.raster.latency),
                latency(|t| t.gauss.latency),
                latency(|t| t.fragment.latency),
            ],
            hazard: latency(|t| t.hazard),
            room: L::splat(0),
            written: L::splat(0),
            light: [0; LANES],
            stamps: [0; 2],
        }
    }

    /// Begins a tile.
    fn begin(&mut self, room: &[i64; LANES], written: &[i64; LANES]) {
        (self.room, self.written) = (L::from_array(*room), L::from_array(*written));
    }

    /// The part of a footprint in a tile; returns the cycle in which raster takes it.
    #[inline(always)]
    fn footprint(
        &mut self,
        walk: &mut Stamps,
        footprint: &Footprint,
        (corner, side): ([u16; 2], u32),
        [here, memory]: [L; 2],
        machines: &mut [BatchedMachine],
    ) -> L {
        let stamps = walk.footprint(footprint, corner, side);
        let entry = BatchedEntry { here, memory };
        let mut first_taken = L::splat(i64::MAX);
        let mut gone_through = 0;
        for stamp in walk.kept() {
            self.stamps[1] += 1;
            let empty = stamp[0].stamp - gone_through;
            gone_through = stamp[0].stamp + 1;
            if empty > 0 {
                first_taken = first_taken.min(self.empty_stamps(&entry, empty.into()));
            }
            first_taken = first_taken.min(self.stamp(stamp, &entry, machines));
        }
        self.stamps[0] += u64::from(stamps);
        if gone_through < stamps {
            first_taken =
                first_taken.min(self.empty_stamps(&entry, (stamps - gone_through).into()));
        }
        first_taken
    }

    /// A stamp with a kept pixel; returns the cycle in which raster takes it.
    #[inline(always)]
    fn stamp(
        &mut self,
        stamp: &[Piece],
        entry: &BatchedEntry<L>,
        machines: &mut [BatchedMachine],
    ) -> L {
        let one = L::splat(1);
        let here = self.raster.free.max(entry.here);
        let with_memory = here.max(entry.memory);
        let taken = self.behind_raster.free_from(with_memory);
        self.raster
            .hold([here, with_memory, with_memory, taken], 1, one);
        self.behind_raster.take();

        let goes_on = stamp.iter().any(|piece| piece.pixels != 0);
        let here = self.gauss.free.max(taken + self.latencies[0]);
        let now = if goes_on {
            here.max(self.behind_gauss.free())
        } else {
            here
        };
        self.gauss.hold([here, here, here, now], 1, one);
        self.behind_raster.give(now);
        if goes_on {
            self.behind_gauss.take();
            let now = self.merge(stamp, now + self.latencies[1], machines);
            self.behind_gauss.give(now);
        }
        taken
    }

    /// Fragment takes a stamp that arrives at `here`; returns the cycle.
    #[inline(always)]
    fn merge(&mut self, stamp: &[Piece], here: L, machines: &mut [BatchedMachine]) -> L {
        let here = self.fragment.free.max(here);
        let unblocked = self.hazards.until(stamp, here);
        let now = unblocked.max(self.room);
        let [merges, lit] = merges_of(stamp, |_| u16::MAX);
        let mut cycles = L::splat(1);
        let mut written = now + self.latencies[2];
        if merges > 0 {
            let (mut of_each, mut written_by) = ([1; LANES], now.to_array());
            self.merges(&mut of_each, &mut written_by, [merges, lit], machines);
            (cycles, written) = (L::from_array(of_each), L::from_array(written_by));
        }
        self.fragment.hold([here, here, unblocked, now], 1, cycles);
        self.hazards
            .take(stamp, written - self.latencies[2] + self.hazard);
        self.written = self.written.max(written);
        now
    }

    /// Merges of a stamp with fragments to shade, machine by machine: the cycles for which each is
    /// occupied, and the cycle in which its merges are written.
    #[inline(never)]
    fn merges(
        &mut self,
        cycles: &mut [i64; LANES],
        written: &mut [i64; LANES],
        [merges, lit]: [u64; 2],
        machines: &mut [BatchedMachine],
    ) {
        for (lane, t) in self.timings.iter().enumerate() {
            let latency = u64::from(t.fragment.latency);
            let now = written[lane] as u64;
            let requested = now + 1;
            let light = light(&mut machines[lane].engine.merge.shade, t, requested, lit);
            self.light[lane] += light - requested;
            if t.lifted == Some(unit::FRAGMENT) {
                written[lane] = (now + latency) as i64;
                continue;
            }
            // It takes nothing until the previous merges have ended.
            let merged = light + merges * u64::from(t.timing.fragment.merge);
            cycles[lane] = (merged - now).max(1) as i64;
            written[lane] = (merged - 1 + latency) as i64;
        }
        repeat(cycles, self.timings.len());
        repeat(written, self.timings.len());
    }

    /// Stamps without a kept pixel; returns the cycle in which raster takes the first.
    #[inline(always)]
    fn empty_stamps(&mut self, entry: &BatchedEntry<L>, stamps: u64) -> L {
        let here = self.raster.free.max(entry.here);
        let with_memory = here.max(entry.memory);
        // If this many have room, a run never stalls: one of them vanishes and at most one arrives
        // per cycle.
        let has_run = self
            .behind_raster
            .are_free(with_memory, self.latencies[0] - L::splat(1));
        let stalled = (self.raster.held - (self.raster.held & has_run)).signs();
        let cycles = L::splat(stamps as i64) & self.raster.held;
        let (mut first, mut end) = (with_memory, with_memory + cycles);
        if stalled != 0 {
            let (mut first_of, mut end_of) = (first.to_array(), end.to_array());
            self.stalled_stamps(&mut first_of, &mut end_of, stamps, stalled);
            (first, end) = (L::from_array(first_of), L::from_array(end_of));
        }
        self.raster.hold(
            [here, with_memory, with_memory, end - cycles],
            stamps,
            cycles,
        );
        first
    }

    /// [`Self::empty_stamps`] on machines without room in every cycle: returns the cycle in which
    /// raster takes the first, and the one in which it is free.
    #[inline(never)]
    fn stalled_stamps(
        &mut self,
        first: &mut [i64; LANES],
        end: &mut [i64; LANES],
        stamps: u64,
        stalled: u8,
    ) {
        let places = &mut self.behind_raster;
        let waiting = self
            .timings
            .iter()
            .enumerate()
            .filter(|(lane, _)| stalled & (1 << lane) != 0);
        for (lane, t) in waiting {
            end[lane] = first[lane];
            for nth in 0..stamps {
                places.forget_vanished(lane, end[lane]);
                let now = places.free_except_left(lane, end[lane]);
                places.vanish(lane, now + i64::from(t.raster.latency));
                first[lane] = if nth == 0 { now } else { first[lane] };
                end[lane] = now + 1;
            }
        }
        repeat(first, self.timings.len());
        repeat(end, self.timings.len());
    }
}

//! Account: each cycle of a unit is busy, starved, blocked or spent on memory.
//!
//! Laws: `every_cycle_of_the_default_machines_is_accounted_for`, `a_frame_ticks_as_it_is_replayed`.

use crate::elaboration::microarchitecture::Pace;
use std::collections::VecDeque;

/// Cycles of a unit. Their sum is the number of cycles of the frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Account {
    /// Occupied by an item.
    pub busy: u64,
    /// No item has arrived.
    pub starved: u64,
    /// An item has arrived, but must stall.
    pub blocked: u64,
    /// An item has arrived, but data from memory has not.
    pub memory: u64,
}

/// Cause of a stall other than memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wait {
    /// The unit before it or behind it.
    Unit(&'static str),
    /// The unit itself: the same pixel is still in flight.
    Hazard,
}

/// Detail in which a frame's time is reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Detail {
    /// Only the cycles of the frame.
    Total,
    /// Also the cycles of each unit, and the causes of its stalls.
    Accounts,
    /// Also the occupancy of the places behind each unit, and its timeline.
    Histograms,
    /// Also every item and every request to memory.
    Log,
}

/// A unit's cycles, and the causes of its stalls.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnitCycles {
    /// Its name.
    pub name: &'static str,
    /// Index among parallel units.
    pub index: u32,
    /// Items taken.
    pub items: u64,
    /// Its cycles.
    pub account: Account,
    /// Cycles in which this unit and those parallel to it took each item; only for [`Detail::Log`].
    pub log: Vec<u64>,
    /// Cycles with an item over time; for [`Detail::Histograms`] and above.
    pub timeline: Option<Timeline>,
    /// The unit that starves it; none for the first unit.
    pub starved_by: Option<&'static str>,
    /// Units that blocked it, with cycles.
    pub blocked_by: Vec<(Wait, u64)>,
    /// Number of items that it took at each occupancy of the places behind it, FIFO and pipeline;
    /// for [`Detail::Histograms`] and above.
    pub occupancy: Vec<u64>,
}

/// Cycles with an item over time, window by window.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Timeline {
    /// Cycles of a window.
    pub window: u64,
    /// Cycles with an item in each window; for the cache, also those in which a look-up stalls for
    /// memory.
    pub busy: Vec<u64>,
    /// End of the last window, and its cycles that are not added yet.
    end: u64,
    now: u64,
}

/// Greatest number of windows; when it is exceeded, pairs of windows are joined.
const WINDOWS: usize = 256;

impl Default for Timeline {
    fn default() -> Self {
        Timeline {
            window: 256,
            busy: vec![0],
            end: 256,
            now: 0,
        }
    }
}

impl Timeline {
    fn new(detail: Detail) -> Self {
        let end = if detail >= Detail::Histograms {
            256
        } else {
            u64::MAX
        };
        Timeline {
            end,
            ..Timeline::default()
        }
    }

    /// Adds cycles from `from` on, which is not before the previous ones.
    #[inline(always)]
    fn add(&mut self, from: u64, mut cycles: u64) {
        if from + cycles > self.end {
            cycles = self.fill(from, cycles);
        }
        self.now += cycles;
    }

    /// Fills all windows except the one in which the cycles end; returns the cycles of that one.
    #[cold]
    fn fill(&mut self, mut from: u64, mut cycles: u64) -> u64 {
        while from + cycles > self.end {
            if from < self.end {
                let here = self.end - from;
                self.now += here;
                (from, cycles) = (self.end, cycles - here);
            }
            self.close();
            if self.busy.len() == WINDOWS {
                self.busy = self.busy.chunks(2).map(|pair| pair.iter().sum()).collect();
                self.window *= 2;
            }
            self.busy.push(0);
            self.end += self.window;
        }
        cycles
    }

    /// Adds the remaining cycles to the last window.
    fn close(&mut self) {
        if let Some(last) = self.busy.last_mut() {
            *last += std::mem::take(&mut self.now);
        }
    }
}

/// The places behind a unit, used in rotation: an item uses the place of the item that came `room`
/// items earlier.
#[derive(Clone, Debug)]
pub struct UnitPlaces {
    /// By item index, the cycle from which its place is free again. As many entries as places,
    /// rounded up to a power of two.
    free: Box<[u64]>,
    /// Items that have a place so far, that were given a cycle, and whose place was given back.
    claimed: usize,
    counted: usize,
    given: usize,
    /// Items that had left when the last one was counted.
    left: usize,
    room: usize,
    mask: usize,
    /// Items without a result, in runs of one per cycle: the cycle from which the first place of a
    /// run is free again, and the length of the run; in order of time.
    vanishing: VecDeque<(u64, u64)>,
    /// Their total. Those that have already vanished are removed when it matters.
    vanishing_items: u64,
    /// Whether occupancies are counted.
    is_counted: bool,
    occupancy: Box<[u64]>,
}

impl UnitPlaces {
    pub fn new(room: usize, is_counted: bool) -> Self {
        let size = room.next_power_of_two();
        let (free, occupancy) = (vec![0; size].into(), vec![0; room + 1].into());
        let vanishing = VecDeque::new();
        UnitPlaces {
            free,
            claimed: 0,
            counted: 0,
            given: 0,
            left: 0,
            room,
            mask: size - 1,
            vanishing,
            vanishing_items: 0,
            is_counted,
            occupancy,
        }
    }

    #[inline(always)]
    fn at(&self, item: usize) -> usize {
        item & self.mask
    }

    /// Whether the cycle in which a place is free is known.
    pub fn is_scheduled(&self) -> bool {
        self.claimed - self.given < self.room
    }

    /// The first cycle in which a place is free.
    #[inline(always)]
    pub fn free(&self) -> u64 {
        // The entries before the first item are 0.
        self.free[self.at(self.claimed.wrapping_sub(self.room))]
    }

    /// The first cycle from `now` on in which a place is free, including the places of items that
    /// vanish.
    #[inline(always)]
    pub fn free_from(&mut self, now: u64) -> u64 {
        if self.are_free(now, self.vanishing_items) {
            now
        } else {
            self.free_late(now)
        }
    }

    /// Whether a place is free if `vanishing` items without a result occupy places.
    #[inline(always)]
    fn are_free(&self, now: u64, vanishing: u64) -> bool {
        let places = self.room.saturating_sub(vanishing as usize);
        places > 0 && self.free[self.at(self.claimed.wrapping_sub(places))] <= now
    }

    /// [`Self::free_from`] where it matters which items have vanished by now. The caller can have
    /// another reason to take an item earlier, so only items that have vanished by now are removed.
    #[inline(never)]
    fn free_late(&mut self, now: u64) -> u64 {
        while let Some((first, count)) = self
            .vanishing
            .front_mut()
            .filter(|(first, _)| *first <= now)
        {
            let vanished = (*count).min(now + 1 - *first);
            (*first, *count) = (*first + vanished, *count - vanished);
            self.vanishing_items -= vanished;
            if *count == 0 {
                self.vanishing.pop_front();
            }
        }
        if self.are_free(now, self.vanishing_items) {
            return now;
        }
        let (mut at, mut left) = (now, self.vanishing_items);
        for (first, count) in &self.vanishing {
            for end in *first..first + count {
                // Until then `left` items remain, and a place can be given back earlier.
                let given = self.given_except(left).max(at);
                if given <= end {
                    return given;
                }
                (at, left) = (end, left - 1);
            }
        }
        self.given_except(left).max(at)
    }

    /// The cycle from which a place is free if `vanishing` items without a result occupy places.
    fn given_except(&self, vanishing: u64) -> u64 {
        let places = self.room.saturating_sub(vanishing as usize);
        if places == 0 {
            u64::MAX
        } else {
            self.free[self.at(self.claimed.wrapping_sub(places))]
        }
    }

    /// Whether a run of items that vanish, one per cycle from `now` on, never stalls. Each has its
    /// place for `latency` cycles, so at most `latency` − 1 of them occupy places besides the items
    /// before.
    #[inline(always)]
    pub fn has_run(&self, now: u64, latency: u32) -> bool {
        self.are_free(now, u64::from(latency) - 1)
    }

    /// Records a run of items that vanish, one per cycle. The place of the first is free again from
    /// `from` on.
    #[inline(always)]
    pub fn vanish(&mut self, from: u64, items: u64) {
        let last = items.min(self.room as u64);
        self.vanishing.push_back((from + items - last, last));
        self.vanishing_items += last;
    }

    /// Takes a place in a cycle in which one is free.
    #[inline(always)]
    pub fn take(&mut self, now: u64) {
        self.claim();
        self.count(now);
    }

    /// Takes a place; [`count`](Self::count) adds the cycle when it is known.
    #[inline(always)]
    pub fn claim(&mut self) {
        self.claimed += 1;
    }

    /// The cycle of the next item that claimed a place. It is given before its place is given back.
    #[inline(always)]
    pub fn count(&mut self, now: u64) {
        if !self.is_counted {
            return;
        }
        while self.left < self.counted && self.free[self.at(self.left)] <= now {
            self.left += 1;
        }
        self.counted += 1;
        self.occupancy[self.counted - self.left] += 1;
    }

    /// Gives back the place that was taken first.
    #[inline(always)]
    pub fn give(&mut self, now: u64) {
        let at = self.at(self.given);
        self.free[at] = now + 1;
        self.given += 1;
    }
}

/// A unit during a replay.
#[derive(Clone, Debug)]
pub struct Unit {
    name: &'static str,
    starved_by: Option<&'static str>,
    blocked_by: Option<&'static str>,
    /// State of the current one of the parallel units. Its entry in `states` is stale.
    state: UnitState,
    states: Box<[UnitState]>,
    /// Timeline of the current unit. Its entry in `timelines` is stale.
    timeline: Timeline,
    timelines: Box<[Timeline]>,
    /// Mask of cycles: 0 for a unit that is infinitely fast, to measure its cost.
    held: u64,
    /// Whether cycles are accounted.
    is_accounted: bool,
    /// Cycles in which it took its items.
    log: Option<Vec<u64>>,
    /// Whether there are parallel units, a timeline or a log.
    is_rare: bool,
    /// Number of units of this kind before these parallel ones.
    others: u32,
    pub behind: UnitPlaces,
}

#[derive(Clone, Copy, Debug, Default)]
struct UnitState {
    index: u32,
    /// The first cycle in which it can take an item. Not before the cycle of the previous unit's
    /// last item.
    free: u64,
    items: u64,
    /// All cycles except the starved ones, which are the rest.
    account: Account,
    /// Cycles blocked by the unit itself.
    hazard: u64,
}

/// Cycles from which an item can be taken.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ready {
    /// The unit before has finished it.
    pub here: u64,
    /// Its data has arrived from memory.
    pub memory: u64,
    /// None of its pixels is in flight.
    pub hazard: u64,
    /// There is room behind, if it needs any.
    pub room: u64,
}

impl Unit {
    pub fn new(
        name: &'static str,
        pace: Pace,
        [starved_by, blocked_by]: [Option<&'static str>; 2],
        detail: Detail,
        lifted: Option<&'static str>,
    ) -> Self {
        let logged = detail == Detail::Log;
        Unit {
            name,
            starved_by,
            blocked_by,
            state: UnitState::default(),
            states: (0..pace.units)
                .map(|index| UnitState {
                    index,
                    ..UnitState::default()
                })
                .collect(),
            timeline: Timeline::new(detail),
            timelines: (0..pace.units).map(|_| Timeline::new(detail)).collect(),
            held: if lifted == Some(name) { 0 } else { u64::MAX },
            is_accounted: detail > Detail::Total || pace.units > 1,
            log: logged.then(Vec::new),
            is_rare: detail >= Detail::Histograms || pace.units > 1,
            others: 0,
            behind: UnitPlaces::new(pace.room(), detail >= Detail::Histograms),
        }
    }

    /// Index of the first of these units, after `others` units of the same kind with their own
    /// items.
    pub fn behind_others(self, others: u32) -> Self {
        Unit { others, ..self }
    }

    /// The cycle in which it would take an item.
    #[inline(always)]
    pub fn when(&self, ready: Ready) -> u64 {
        self.state
            .free
            .max(ready.here)
            .max(ready.memory)
            .max(ready.hazard)
            .max(ready.room)
    }

    /// Takes the next item, which occupies it for `cycles`; returns the cycle.
    #[inline(always)]
    pub fn take(&mut self, ready: Ready, cycles: u64) -> u64 {
        self.hold(ready, 1, cycles, cycles)
    }

    /// Takes the next item, which occupies it for `cycles`: `busy` cycles of work, and a stall for
    /// memory in the others.
    #[inline(always)]
    pub fn take_with_memory(&mut self, ready: Ready, busy: u64, cycles: u64) -> u64 {
        self.hold(ready, 1, busy.min(cycles), cycles)
    }

    /// Takes `items` items, one per cycle, that need no room; returns the cycle of the first.
    #[inline(always)]
    pub fn take_run(&mut self, ready: Ready, items: u64) -> u64 {
        self.hold(ready, items, items, items)
    }

    /// Stalls as for an item, without taking one.
    pub fn stall(&mut self, ready: Ready) {
        self.hold(ready, 0, 0, 0);
    }

    #[inline(always)]
    fn hold(&mut self, ready: Ready, items: u64, busy: u64, cycles: u64) -> u64 {
        let (busy, cycles) = (busy & self.held, cycles & self.held);
        let state = &mut self.state;
        let here = state.free.max(ready.here);
        let with_memory = here.max(ready.memory);
        let unblocked = with_memory.max(ready.hazard);
        let now = unblocked.max(ready.room);
        state.free = now + cycles;
        if !self.is_accounted {
            return now;
        }
        state.account.memory += with_memory - here + cycles - busy;
        state.hazard += unblocked - with_memory;
        state.account.blocked += now - with_memory;
        state.account.busy += busy;
        state.items += items;
        if self.is_rare {
            self.rotate(now, items, cycles);
        }
        now
    }

    /// Records the cycles of items that were taken one per cycle, and selects the next parallel
    /// unit. Units take items in order, so never before the previous item.
    #[inline(never)]
    fn rotate(&mut self, now: u64, items: u64, cycles: u64) {
        self.timeline.add(now, cycles);
        if let Some(log) = &mut self.log {
            log.extend(now..now + items);
        }
        let index = self.state.index as usize;
        if self.states.len() == 1 {
            return;
        }
        let next = if index + 1 == self.states.len() {
            0
        } else {
            index + 1
        };
        self.states[index] = self.state;
        self.state = self.states[next];
        std::mem::swap(&mut self.timeline, &mut self.timelines[index]);
        std::mem::swap(&mut self.timeline, &mut self.timelines[next]);
        self.state.free = self.state.free.max(now);
    }

    /// Sets the state that a batched replay computed: when it is free, items, cycles, and cycles
    /// blocked by itself.
    pub fn set_state(&mut self, free: u64, items: u64, account: Account, hazard: u64) {
        self.state = UnitState {
            free,
            items,
            account,
            hazard,
            ..self.state
        };
    }

    /// Whether it is infinitely fast.
    pub fn is_lifted(&self) -> bool {
        self.held == 0
    }

    /// The cycle from which the current unit is free.
    #[inline(always)]
    pub fn free(&self) -> u64 {
        self.state.free
    }

    /// For each parallel unit, the cycle from which it is free, and its account until then without
    /// starved cycles.
    pub fn so_far(&self) -> impl Iterator<Item = (u64, Account)> {
        let now = |state: &UnitState| {
            if state.index == self.state.index {
                self.state
            } else {
                *state
            }
        };
        self.states
            .iter()
            .map(now)
            .map(|state| (state.free, state.account))
    }

    /// Its name.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// The cycle in which the last of its items is done.
    pub fn done(&self) -> u64 {
        self.states
            .iter()
            .fold(self.state.free, |done, state| done.max(state.free))
    }

    /// Its cycles in a frame of `total` cycles. The remaining ones are starved.
    pub fn cycles(self, total: u64) -> Vec<UnitCycles> {
        let Unit {
            name,
            starved_by,
            blocked_by,
            state,
            mut states,
            behind,
            log,
            timeline,
            mut timelines,
            others,
            ..
        } = self;
        let mut log = log.unwrap_or_default();
        states[state.index as usize] = state;
        timelines[state.index as usize] = timeline;
        timelines.iter_mut().for_each(Timeline::close);
        let mut of = |state: UnitState| {
            let (
                index,
                Account {
                    busy,
                    blocked,
                    memory,
                    ..
                },
            ) = (state.index, state.account);
            let by_unit = blocked_by.map(|unit| (Wait::Unit(unit), blocked - state.hazard));
            UnitCycles {
                name,
                index: others + index,
                items: state.items,
                log: std::mem::take(&mut log),
                timeline: behind.is_counted.then(|| timelines[index as usize].clone()),
                account: Account {
                    busy,
                    starved: total - busy - blocked - memory,
                    blocked,
                    memory,
                },
                starved_by,
                blocked_by: by_unit
                    .into_iter()
                    .chain([(Wait::Hazard, state.hazard)])
                    .filter(|(_, cycles)| *cycles > 0)
                    .collect(),
                occupancy: if behind.is_counted && index == 0 {
                    behind.occupancy.to_vec()
                } else {
                    Vec::new()
                },
            }
        };
        states.into_iter().map(&mut of).collect()
    }
}

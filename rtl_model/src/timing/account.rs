//! Account: each cycle of a unit is busy, starved, blocked or memory's.
//!
//! Laws: `every_cycle_of_the_default_machines_is_accounted_for`, `a_frame_ticks_as_it_is_replayed`.

use crate::elaboration::microarchitecture::Pace;
use std::collections::VecDeque;

/// Cycles of a unit. They sum to the frame's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Account {
    /// An item holds it.
    pub busy: u64,
    /// No item is here.
    pub starved: u64,
    /// An item is here, but may not be taken.
    pub blocked: u64,
    /// Waiting for memory: what the item needs is on its way.
    pub memory: u64,
}

/// Cause of a wait besides items and room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wait {
    /// A unit before it or behind it.
    Unit(&'static str),
    /// Itself: the same pixel is still under way.
    Hazard,
}

/// Detail in which a frame's time is reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Detail {
    /// The frame's cycles, and nothing of its units.
    Total,
    /// Each unit's cycles, and who made it wait.
    Accounts,
    /// Occupancy of the places behind it, too, and when it was used.
    Histograms,
    /// Every item and every request to memory, too.
    Log,
}

/// A unit's cycles, and who made it wait.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnitCycles {
    /// Its name.
    pub name: &'static str,
    /// Which of several side by side.
    pub index: u32,
    /// Items taken.
    pub items: u64,
    /// Its cycles.
    pub account: Account,
    /// When it, and those beside it, took each item; only of [`Detail::Log`].
    pub log: Vec<u64>,
    /// When it had items; of [`Detail::Histograms`] and above.
    pub timeline: Option<Timeline>,
    /// Unit that starved it; nobody starves the first.
    pub starved_by: Option<&'static str>,
    /// Units that blocked it, with cycles.
    pub blocked_by: Vec<(Wait, u64)>,
    /// Count of items that it took while so many waited behind it, in the FIFO or under way; of
    /// [`Detail::Histograms`] and above.
    pub occupancy: Vec<u64>,
}

/// Cycles with an item over time, window by window.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Timeline {
    /// Cycles of a window.
    pub window: u64,
    /// Such cycles in each; of the cache those too in which a look-up waits for memory.
    pub busy: Vec<u64>,
    /// Where the last window ends, and what belongs into it but is not there yet.
    end: u64,
    now: u64,
}

/// Most windows; then two become one.
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

    /// Cycles from this one on, which is not before the last one's.
    #[inline(always)]
    fn add(&mut self, from: u64, mut cycles: u64) {
        if from + cycles > self.end {
            cycles = self.fill(from, cycles);
        }
        self.now += cycles;
    }

    /// Fills all windows but the one in which they end; says how many of the cycles are left for
    /// that.
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

    /// Puts into the last window what belongs there.
    fn close(&mut self) {
        if let Some(last) = self.busy.last_mut() {
            *last += std::mem::take(&mut self.now);
        }
    }
}

/// The places behind a unit, which take turns: an item has the place of the one that came so many
/// before it as there are places.
#[derive(Clone, Debug)]
pub struct Places {
    /// From when on the place of an item is free again, by the item's number: as many as there are
    /// places, rounded up to a power of two.
    free: Box<[u64]>,
    /// Items that had so many places so far, that were given a cycle, and that were given back.
    claimed: usize,
    counted: usize,
    given: usize,
    /// Items that had left when one was counted last.
    left: usize,
    room: usize,
    mask: usize,
    /// Items that nothing comes of: from when on the place of the first of some is free again, and
    /// how many there are, a cycle apart. The first of them come first.
    vanishing: VecDeque<(u64, u64)>,
    /// How many these are: those among them that have vanished are found out when it matters.
    vanishing_items: u64,
    /// Whether it is asked how many are taken, and how often so many were.
    is_counted: bool,
    occupancy: Box<[u64]>,
}

impl Places {
    pub fn new(room: usize, is_counted: bool) -> Self {
        let size = room.next_power_of_two();
        let (free, occupancy) = (vec![0; size].into(), vec![0; room + 1].into());
        let vanishing = VecDeque::new();
        Places {
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

    /// Whether it is known when one is free.
    pub fn is_known(&self) -> bool {
        self.claimed - self.given < self.room
    }

    /// The first cycle in which one is free.
    #[inline(always)]
    pub fn free(&self) -> u64 {
        // Before the first item lie cycles that nobody has written yet.
        self.free[self.at(self.claimed.wrapping_sub(self.room))]
    }

    /// The first cycle from this one on in which one is free, where some are taken by items that
    /// vanish.
    #[inline(always)]
    pub fn free_from(&mut self, now: u64) -> u64 {
        if self.are_free(now, self.vanishing_items) {
            now
        } else {
            self.free_late(now)
        }
    }

    /// Whether one is free beside so many that items which vanish have.
    #[inline(always)]
    fn are_free(&self, now: u64, vanishing: u64) -> bool {
        let places = self.room.saturating_sub(vanishing as usize);
        places > 0 && self.free[self.at(self.claimed.wrapping_sub(places))] <= now
    }

    /// The same where it matters which have vanished by now. Who asks may still find another reason
    /// to take it sooner, so that only what has vanished by now is forgotten.
    #[inline(never)]
    fn free_late(&mut self, now: u64) -> u64 {
        while let Some((first, count)) = self
            .vanishing
            .front_mut()
            .filter(|(first, _)| *first <= now)
        {
            let gone = (*count).min(now + 1 - *first);
            (*first, *count) = (*first + gone, *count - gone);
            self.vanishing_items -= gone;
            if *count == 0 {
                self.vanishing.pop_front();
            }
        }
        if self.are_free(now, self.vanishing_items) {
            return now;
        }
        let (mut at, mut left) = (now, self.vanishing_items);
        for (first, count) in &self.vanishing {
            for again in *first..first + count {
                // Until then so many are left, and what is given back may be sooner.
                let given = self.given_beside(left).max(at);
                if given <= again {
                    return given;
                }
                (at, left) = (again, left - 1);
            }
        }
        self.given_beside(left).max(at)
    }

    /// From when on one is free beside so many that items which vanish have.
    fn given_beside(&self, vanishing: u64) -> u64 {
        let places = self.room.saturating_sub(vanishing as usize);
        if places == 0 {
            u64::MAX
        } else {
            self.free[self.at(self.claimed.wrapping_sub(places))]
        }
    }

    /// Whether any number of items that vanish can be taken from this cycle on, one a cycle, each
    /// of which has its place for so many: at most one less than that have one beside those that
    /// were taken before.
    #[inline(always)]
    pub fn has_run(&self, now: u64, latency: u32) -> bool {
        self.are_free(now, u64::from(latency) - 1)
    }

    /// So many items that vanish were taken, a cycle apart; the place of the first is free again
    /// from this cycle on.
    #[inline(always)]
    pub fn vanish(&mut self, from: u64, items: u64) {
        let last = items.min(self.room as u64);
        self.vanishing.push_back((from + items - last, last));
        self.vanishing_items += last;
    }

    /// Takes one in a cycle in which one is free.
    #[inline(always)]
    pub fn take(&mut self, now: u64) {
        self.claim();
        self.count(now);
    }

    /// Takes one of which [`count`](Self::count) is told when, as soon as it is known.
    #[inline(always)]
    pub fn claim(&mut self) {
        self.claimed += 1;
    }

    /// The next one was taken in this cycle; it is said of all before it when they are given back.
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

    /// Gives the one back that was taken first.
    #[inline(always)]
    pub fn give(&mut self, now: u64) {
        let at = self.at(self.given);
        self.free[at] = now + 1;
        self.given += 1;
    }
}

/// A unit at work.
#[derive(Clone, Debug)]
pub struct Unit {
    name: &'static str,
    starved_by: Option<&'static str>,
    blocked_by: Option<&'static str>,
    /// Of those that work side by side the one whose turn it is, and the others by their place; its
    /// own holds nothing of worth.
    side: Side,
    sides: Box<[Side]>,
    /// Of the one whose turn it is, and the others by their place, as with sides.
    timeline: Timeline,
    timelines: Box<[Timeline]>,
    /// All bits: items hold it; none: it is infinitely fast, to see what it costs.
    held: u64,
    /// Whether more is asked of it than when it is free.
    is_told: bool,
    /// When it took each item, for whoever wants to know.
    log: Option<Vec<u64>>,
    /// Whether there are others, a timeline or a log.
    is_rare: bool,
    /// How many like it come before those that take turns here.
    others: u32,
    pub behind: Places,
}

#[derive(Clone, Copy, Debug, Default)]
struct Side {
    index: u32,
    /// When it can take another: not before the one before it took the last.
    free: u64,
    items: u64,
    /// All but when it is starved: that is the rest.
    account: Account,
    /// Cycles blocked by itself.
    hazard: u64,
}

/// When an item can be taken.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ready {
    /// The unit before has it done.
    pub here: u64,
    /// First cycle in which what it needs has come from memory.
    pub memory: u64,
    /// No pixel of it is under way.
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
            side: Side::default(),
            sides: (0..pace.units)
                .map(|index| Side {
                    index,
                    ..Side::default()
                })
                .collect(),
            timeline: Timeline::new(detail),
            timelines: (0..pace.units).map(|_| Timeline::new(detail)).collect(),
            held: if lifted == Some(name) { 0 } else { u64::MAX },
            is_told: detail > Detail::Total || pace.units > 1,
            log: logged.then(Vec::new),
            is_rare: detail >= Detail::Histograms || pace.units > 1,
            others: 0,
            behind: Places::new(pace.room(), detail >= Detail::Histograms),
        }
    }

    /// Behind so many like it that take items of their own.
    pub fn behind_others(self, others: u32) -> Self {
        Unit { others, ..self }
    }

    /// When it would take an item.
    #[inline(always)]
    pub fn when(&self, ready: Ready) -> u64 {
        self.side
            .free
            .max(ready.here)
            .max(ready.memory)
            .max(ready.hazard)
            .max(ready.room)
    }

    /// Takes the next item, which holds it for so many cycles; says when.
    #[inline(always)]
    pub fn take(&mut self, ready: Ready, cycles: u64) -> u64 {
        self.hold(ready, 1, cycles, cycles)
    }

    /// Takes the next item, which holds it for so many cycles, of which it works so many and waits
    /// for memory in the others.
    #[inline(always)]
    pub fn take_with_memory(&mut self, ready: Ready, busy: u64, cycles: u64) -> u64 {
        self.hold(ready, 1, busy.min(cycles), cycles)
    }

    /// Takes so many items, a cycle each, that need no room; says when it takes the first.
    #[inline(always)]
    pub fn take_run(&mut self, ready: Ready, items: u64) -> u64 {
        self.hold(ready, items, items, items)
    }

    /// Waits as if for an item, and takes none.
    pub fn wait(&mut self, ready: Ready) {
        self.hold(ready, 0, 0, 0);
    }

    #[inline(always)]
    fn hold(&mut self, ready: Ready, items: u64, busy: u64, cycles: u64) -> u64 {
        let (busy, cycles) = (busy & self.held, cycles & self.held);
        let side = &mut self.side;
        let here = side.free.max(ready.here);
        let with_memory = here.max(ready.memory);
        let unblocked = with_memory.max(ready.hazard);
        let now = unblocked.max(ready.room);
        side.free = now + cycles;
        if !self.is_told {
            return now;
        }
        side.account.memory += with_memory - here + cycles - busy;
        side.hazard += unblocked - with_memory;
        side.account.blocked += now - with_memory;
        side.account.busy += busy;
        side.items += items;
        if self.is_rare {
            self.hand_on(now, items, cycles);
        }
        now
    }

    /// Tells when items held it that were taken a cycle apart, and gives the turn to the next side:
    /// in order, so never before the item before.
    #[inline(never)]
    fn hand_on(&mut self, now: u64, items: u64, cycles: u64) {
        self.timeline.add(now, cycles);
        if let Some(log) = &mut self.log {
            log.extend(now..now + items);
        }
        let index = self.side.index as usize;
        if self.sides.len() == 1 {
            return;
        }
        let next = if index + 1 == self.sides.len() {
            0
        } else {
            index + 1
        };
        self.sides[index] = self.side;
        self.side = self.sides[next];
        std::mem::swap(&mut self.timeline, &mut self.timelines[index]);
        std::mem::swap(&mut self.timeline, &mut self.timelines[next]);
        self.side.free = self.side.free.max(now);
    }

    /// What it did by now, as somebody else found: when it is free, items, cycles, and those
    /// blocked by itself.
    pub fn put(&mut self, free: u64, items: u64, account: Account, hazard: u64) {
        self.side = Side {
            free,
            items,
            account,
            hazard,
            ..self.side
        };
    }

    /// Whether it is infinitely fast.
    pub fn is_lifted(&self) -> bool {
        self.held == 0
    }

    /// When the unit that has the next turn is free.
    #[inline(always)]
    pub fn free(&self) -> u64 {
        self.side.free
    }

    /// When each that takes turns is free, and what it did until then; starved is not told.
    pub fn so_far(&self) -> impl Iterator<Item = (u64, Account)> {
        let now = |side: &Side| {
            if side.index == self.side.index {
                self.side
            } else {
                *side
            }
        };
        self.sides
            .iter()
            .map(now)
            .map(|side| (side.free, side.account))
    }

    /// Its name.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// When all that it took is done with it.
    pub fn done(&self) -> u64 {
        self.sides
            .iter()
            .fold(self.side.free, |done, side| done.max(side.free))
    }

    /// Its cycles in a frame of so many: at the end it is starved.
    pub fn cycles(self, total: u64) -> Vec<UnitCycles> {
        let Unit {
            name,
            starved_by,
            blocked_by,
            side,
            mut sides,
            behind,
            log,
            timeline,
            mut timelines,
            others,
            ..
        } = self;
        let mut log = log.unwrap_or_default();
        sides[side.index as usize] = side;
        timelines[side.index as usize] = timeline;
        timelines.iter_mut().for_each(Timeline::close);
        let mut of = |side: Side| {
            let (
                index,
                Account {
                    busy,
                    blocked,
                    memory,
                    ..
                },
            ) = (side.index, side.account);
            let by_unit = blocked_by.map(|unit| (Wait::Unit(unit), blocked - side.hazard));
            UnitCycles {
                name,
                index: others + index,
                items: side.items,
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
                    .chain([(Wait::Hazard, side.hazard)])
                    .filter(|(_, cycles)| *cycles > 0)
                    .collect(),
                occupancy: if behind.is_counted && index == 0 {
                    behind.occupancy.to_vec()
                } else {
                    Vec::new()
                },
            }
        };
        sides.into_iter().map(&mut of).collect()
    }
}

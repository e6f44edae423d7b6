//! Account: each cycle of a unit is busy, starved, blocked or memory's.
//!
//! Laws: `every_cycle_of_the_default_machines_is_accounted_for`, `a_frame_ticks_as_it_is_replayed`.

use crate::machine::timing::Pace;

/// Cycles of a unit. They sum to the frame's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Account {
    /// An item holds it.
    pub busy: u64,
    /// No item is here.
    pub starved: u64,
    /// An item is here, but may not be taken.
    pub blocked: u64,
    /// What the item needs is on its way from memory.
    pub memory: u64,
}

/// What a unit waited for besides items and room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wait {
    /// A unit before it or behind it.
    Unit(&'static str),
    /// Itself: the same pixel is still under way.
    Hazard,
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
    /// When it, and those beside it, took each item, if that was to be logged.
    pub log: Vec<u64>,
    /// When it, and those beside it, had items.
    pub timeline: Timeline,
    /// Who starved it; nobody starves the first.
    pub starved_by: Option<&'static str>,
    /// Who blocked it, and for how long.
    pub blocked_by: Vec<(Wait, u64)>,
    /// How often so many items waited behind it when it took one: the FIFO's and those under way.
    pub occupancy: Vec<u64>,
}

/// Cycles with an item over time, window by window.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Timeline {
    /// Cycles of a window.
    pub window: u64,
    /// Such cycles in each, of several units side by side together; of the cache those too in which a look-up waits for memory.
    pub busy: Vec<u64>,
    /// Where the last window ends.
    end: u64,
}

/// Most windows; then two become one.
const WINDOWS: usize = 256;

impl Default for Timeline {
    fn default() -> Self {
        Timeline { window: 256, busy: vec![0], end: 256 }
    }
}

impl Timeline {
    /// Cycles from this one on, which is not before the last one's.
    #[inline(always)]
    fn add(&mut self, mut from: u64, mut cycles: u64) {
        while from + cycles > self.end {
            if from < self.end {
                let here = self.end - from;
                self.last(here);
                (from, cycles) = (self.end, cycles - here);
            }
            self.open();
        }
        self.last(cycles);
    }

    #[inline(always)]
    fn last(&mut self, cycles: u64) {
        let last = self.busy.len() - 1;
        self.busy[last] += cycles;
    }

    #[cold]
    fn open(&mut self) {
        if self.busy.len() == WINDOWS {
            self.busy = self.busy.chunks(2).map(|pair| pair.iter().sum()).collect();
            self.window *= 2;
        }
        self.busy.push(0);
        self.end += self.window;
    }
}

/// The places behind a unit: when each of the last was given back.
#[derive(Clone, Debug)]
pub struct Places {
    given_back: Box<[u64]>,
    room: u64,
    taken: u64,
    counted: u64,
    given: u64,
    /// The first that was not given back before the last was taken.
    oldest: u64,
    occupancy: Box<[u64]>,
}

impl Places {
    pub fn new(room: usize) -> Self {
        Places {
            given_back: vec![0; room.next_power_of_two()].into(),
            room: room as u64,
            taken: 0,
            counted: 0,
            given: 0,
            oldest: 0,
            occupancy: vec![0; room + 1].into(),
        }
    }

    #[inline(always)]
    fn at(&self, index: u64) -> usize {
        index as usize & (self.given_back.len() - 1)
    }

    /// Whether it is known when one is free.
    pub fn is_known(&self) -> bool {
        self.taken < self.given + self.room
    }

    /// The first cycle in which one is free.
    #[inline(always)]
    pub fn free(&self) -> u64 {
        if self.taken < self.room { 0 } else { self.given_back[self.at(self.taken - self.room)] + 1 }
    }

    /// Takes one in a cycle in which one is free.
    #[inline(always)]
    pub fn take(&mut self, now: u64) {
        self.claim();
        self.count(now);
    }

    /// Takes one of which [`count`](Self::count) is told when: once those before it are given back as far as they will be by then.
    #[inline(always)]
    pub fn claim(&mut self) {
        self.taken += 1;
    }

    /// The next one was taken in this cycle.
    #[inline(always)]
    pub fn count(&mut self, now: u64) {
        self.counted += 1;
        // With this one, those that were taken and not given back before this cycle.
        self.oldest = self.oldest.max(self.counted.saturating_sub(self.room));
        while self.oldest < self.given && self.given_back[self.at(self.oldest)] < now {
            self.oldest += 1;
        }
        self.occupancy[((self.counted - self.oldest) as usize).min(self.occupancy.len() - 1)] += 1;
    }

    /// Gives the oldest back.
    #[inline(always)]
    pub fn give(&mut self, now: u64) {
        let at = self.at(self.given);
        self.given_back[at] = now;
        self.given += 1;
    }
}

/// A unit at work.
#[derive(Clone, Debug)]
pub struct Unit {
    name: &'static str,
    starved_by: Option<&'static str>,
    blocked_by: Option<&'static str>,
    /// One for each that works side by side: when it is free, and its cycles.
    sides: Vec<Side>,
    turn: usize,
    last: u64,
    timeline: Timeline,
    /// When it took each item, for whoever wants to know.
    log: Option<Vec<u64>>,
    pub behind: Places,
}

#[derive(Clone, Copy, Debug, Default)]
struct Side {
    free: u64,
    items: u64,
    account: Account,
    hazard: u64,
}

/// When an item can be taken.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ready {
    /// The unit before has it done.
    pub here: u64,
    /// What it needs has come from memory.
    pub memory: u64,
    /// No pixel of it is under way.
    pub hazard: u64,
    /// There is room behind, if it needs any.
    pub room: u64,
}

impl Unit {
    /// `logged` keeps when it takes each item.
    pub fn new(name: &'static str, pace: Pace, starved_by: Option<&'static str>, blocked_by: Option<&'static str>, logged: bool) -> Self {
        Unit {
            name,
            starved_by,
            blocked_by,
            sides: vec![Side::default(); pace.units as usize],
            turn: 0,
            last: 0,
            timeline: Timeline::default(),
            log: logged.then(Vec::new),
            behind: Places::new(pace.room()),
        }
    }

    /// Takes the next item, which holds it for so many cycles; says when.
    #[inline(always)]
    pub fn take(&mut self, ready: Ready, cycles: u64) -> u64 {
        let side = &mut self.sides[self.turn];
        // In order: side by side, but never before the item before.
        let here = ready.here.max(self.last);
        let with_memory = here.max(ready.memory);
        let unblocked = with_memory.max(ready.hazard);
        let now = side.free.max(unblocked).max(ready.room);
        let gap = |from: u64, to: u64| to.saturating_sub(from.max(side.free));
        side.account.starved += gap(0, here);
        side.account.memory += gap(here, with_memory);
        side.hazard += gap(with_memory, unblocked);
        side.account.blocked += gap(with_memory, now);
        side.account.busy += cycles;
        side.items += 1;
        side.free = now + cycles;
        self.timeline.add(now, cycles);
        if let Some(log) = &mut self.log {
            log.push(now);
        }
        self.last = now;
        self.turn += 1;
        if self.turn == self.sides.len() {
            self.turn = 0;
        }
        now
    }

    /// Takes the next item, which holds it for so many cycles, of which it works so many and waits for memory in the others.
    #[inline(always)]
    pub fn take_with_memory(&mut self, ready: Ready, busy: u64, cycles: u64) -> u64 {
        let turn = self.turn;
        let now = self.take(ready, cycles);
        let account = &mut self.sides[turn].account;
        account.busy -= cycles - busy.min(cycles);
        account.memory += cycles - busy.min(cycles);
        now
    }

    /// Takes so many items, a cycle each, that need no room; says when it takes the first.
    #[inline(always)]
    pub fn take_run(&mut self, ready: Ready, items: u64) -> u64 {
        let turn = self.turn;
        let now = self.take(ready, items);
        self.sides[turn].items += items - 1;
        if let Some(log) = &mut self.log {
            log.extend(now + 1..now + items);
        }
        now
    }

    /// When the unit that has the next turn is free.
    #[inline(always)]
    pub fn free(&self) -> u64 {
        self.sides[self.turn].free
    }

    /// When all that it took is done with it.
    pub fn done(&self) -> u64 {
        self.sides.iter().map(|side| side.free).max().unwrap_or(0)
    }

    /// Its cycles in a frame of so many: at the end it is starved.
    pub fn cycles(self, total: u64) -> Vec<UnitCycles> {
        let Unit { name, starved_by, blocked_by, sides, behind, log, timeline, .. } = self;
        let mut log = log.unwrap_or_default();
        let mut of = |(index, side): (usize, Side)| {
            let Account { busy, starved, blocked, memory } = side.account;
            let by_unit = blocked_by.map(|unit| (Wait::Unit(unit), blocked - side.hazard));
            UnitCycles {
                name,
                index: index as u32,
                items: side.items,
                log: std::mem::take(&mut log),
                timeline: if index == 0 { timeline.clone() } else { Timeline::default() },
                account: Account { busy, starved: starved + total - side.free, blocked, memory },
                starved_by,
                blocked_by: by_unit.into_iter().chain([(Wait::Hazard, side.hazard)]).filter(|(_, cycles)| *cycles > 0).collect(),
                occupancy: if index == 0 { behind.occupancy.to_vec() } else { Vec::new() },
            }
        };
        sides.into_iter().enumerate().map(&mut of).collect()
    }
}

//! Walk: cycles of `fetch` to find the splats of a tree.
//!
//! ```text
//! stack ─►( children of some nodes, requested together )─► memory ─►( a node per cycle )─┬─► project, in this order
//!   ▲                                                                      │             └─► list ─► sort ─► project, the largest first
//!   └──────────────────────────────────────────────────────────────────────┘
//! ```
//! The next children are known when all previously requested ones are tested: a round takes the
//! latency of memory and the latency of the test, which is that of `project`. Within a round there
//! is one request per cycle. Nodes of one round that share a burst read it once.
//!
//! If the largest nodes come first, the walk lists the drawn nodes, with 8 bytes per node; two
//! passes sort the list; then each record is read again.
//!
//! Laws (tests/tree.rs of the bench): `a_walk_takes_a_latency_a_round`,
//! `a_walk_reads_every_node_of_its_visits`.

use super::account::{Ready, Unit};
use super::memory::{Direction, Memory, NODES, Outstanding, Requester};
use crate::elaboration::microarchitecture::{Microarchitecture, WALK_DIGIT_BITS};
use crate::work::{Found, Visit, Work};

/// Bytes of a list's entry: a size and an index of a node.
const ENTRY_BYTES: u64 = 8;
/// Passes of the sort, and values of a digit.
const PASSES: u64 = 2;
const DIGITS: u64 = 1 << WALK_DIGIT_BITS;
/// Bytes per transfer of the sort.
const PART_BYTES: u64 = 1 << 12;

/// A walk, and the sorted list after it.
#[derive(Clone, Debug)]
pub struct TreeWalk<'a> {
    visits: &'a [Visit],
    ahead: u32,
    listed: &'a [u32],
    node_bytes: u64,
    burst_bytes: u64,
    test: u64,
    /// Index of the next visit, or of the next node of the list.
    next: usize,
    next_listed: usize,
    /// The first visit of the round, its groups so far, and its earliest start.
    round: usize,
    groups: u32,
    begun: u64,
    /// The cycle of the next request, and the end of the last test.
    free: u64,
    tested: u64,
    /// The last burst that was read, and its arrival.
    held: Option<(u64, u64)>,
    /// Cycle from which the sorted list can be read.
    sorted: Option<u64>,
    list_bursts: u64,
    list_here: u64,
}

impl<'a> TreeWalk<'a> {
    /// None if splats are consecutive in memory. Nothing is read before `loaded`.
    pub fn new(timing: &Microarchitecture, work: &'a Work, loaded: u64) -> Option<Self> {
        (!work.walk.is_empty()).then(|| TreeWalk {
            visits: &work.walk,
            ahead: work.ahead.max(1),
            listed: &work.listed,
            node_bytes: timing.node_bytes.into(),
            burst_bytes: timing.timing.memory.burst_bytes.into(),
            test: timing.project.latency.into(),
            next: 0,
            next_listed: 0,
            round: 0,
            groups: 1,
            begun: 0,
            free: loaded,
            tested: 0,
            held: None,
            sorted: None,
            list_bursts: 0,
            list_here: 0,
        })
    }

    /// Finds the next splat; returns the cycle in which `fetch` takes it.
    pub fn next(
        &mut self,
        fetch: &mut Unit,
        outstanding: &mut Outstanding,
        memory: &mut Memory,
    ) -> u64 {
        if !self.listed.is_empty() {
            return self.next_of_list(fetch, outstanding, memory);
        }
        while let Some(visit) = self.visits.get(self.next) {
            let now = self.visit(*visit, fetch, outstanding, memory);
            if visit.found == Found::Drawn {
                return now;
            }
        }
        fetch.free()
    }

    /// Reads the remaining nodes, which are not drawn.
    pub fn end(&mut self, fetch: &mut Unit, outstanding: &mut Outstanding, memory: &mut Memory) {
        while let Some(visit) = self.visits.get(self.next) {
            self.visit(*visit, fetch, outstanding, memory);
        }
    }

    /// Reads a node and tests it; returns the cycle.
    fn visit(
        &mut self,
        visit: Visit,
        fetch: &mut Unit,
        outstanding: &mut Outstanding,
        memory: &mut Memory,
    ) -> u64 {
        let parent = visit.parent as usize;
        let is_new =
            self.next > 0 && self.visits[self.next - 1].parent != visit.parent || self.next == 1;
        if is_new {
            // The next group depends on the round, or the round is full.
            if parent >= self.round || self.groups == self.ahead {
                (self.round, self.groups) = (self.next, 0);
                self.begun = self.tested;
                self.held = None;
            }
            self.groups += 1;
        }
        let here = self.read(visit.node.into(), self.begun, outstanding, memory);
        // Splats of a list continue after the sort.
        let goes_on = visit.found == Found::Drawn && self.listed.is_empty();
        let room = if goes_on { fetch.behind.free() } else { 0 };
        let now = fetch.take(
            Ready {
                memory: here,
                room,
                ..Ready::default()
            },
            1,
        );
        self.tested = self.tested.max(now + self.test);
        self.next += 1;
        now
    }

    /// Reads a node's record, requested at that time or later; returns its arrival.
    fn read(
        &mut self,
        node: u64,
        from: u64,
        outstanding: &mut Outstanding,
        memory: &mut Memory,
    ) -> u64 {
        let [first, last] = [node * self.node_bytes, (node + 1) * self.node_bytes - 1]
            .map(|byte| byte / self.burst_bytes);
        for burst in first..=last {
            if self.held.is_some_and(|(held, _)| held == burst) {
                continue;
            }
            let when = from.max(self.free).max(outstanding.free());
            let before = self.held.map_or(0, |(_, here)| here);
            let here = memory.request(
                when,
                Requester::Splats,
                Direction::Read,
                burst * self.burst_bytes,
                self.burst_bytes,
            );
            outstanding.push(here);
            self.free = when + 1;
            // Records are tested in order.
            self.held = Some((burst, here.max(before)));
        }
        self.held.map_or(from, |(_, here)| here)
    }

    /// The next node of the sorted list.
    fn next_of_list(
        &mut self,
        fetch: &mut Unit,
        outstanding: &mut Outstanding,
        memory: &mut Memory,
    ) -> u64 {
        let sorted = match self.sorted {
            Some(sorted) => sorted,
            None => {
                self.end(fetch, outstanding, memory);
                self.sort(memory)
            }
        };
        let Some(node) = self.listed.get(self.next_listed) else {
            return fetch.free();
        };
        let needed = ((self.next_listed as u64 + 1) * ENTRY_BYTES).div_ceil(self.burst_bytes);
        while self.list_bursts < needed {
            let when = sorted.max(self.free).max(outstanding.free());
            let address = NODES + self.list_bursts * self.burst_bytes;
            self.list_here = memory.request(
                when,
                Requester::Splats,
                Direction::Read,
                address,
                self.burst_bytes,
            );
            outstanding.push(self.list_here);
            self.free = when + 1;
            self.list_bursts += 1;
        }
        let here = self.read(
            (*node).into(),
            self.list_here.max(sorted),
            outstanding,
            memory,
        );
        self.next_listed += 1;
        fetch.take(
            Ready {
                memory: here,
                room: fetch.behind.free(),
                ..Ready::default()
            },
            1,
        )
    }

    /// Writes the list and sorts it: one cycle per entry and pass, and one per value of a digit.
    /// Returns the end.
    fn sort(&mut self, memory: &mut Memory) -> u64 {
        let entries = self.listed.len() as u64;
        let bytes = entries * ENTRY_BYTES;
        let mut moved = |from: u64, reads: bool, half: u64| {
            let (mut done, mut moved) = (from, 0);
            while moved < bytes {
                let part = PART_BYTES.min(bytes - moved);
                let address = |half: u64| NODES + half % 2 * (1 << 38) + moved;
                if reads {
                    done = memory.request(
                        done,
                        Requester::Splats,
                        Direction::Read,
                        address(half),
                        part,
                    );
                }
                done = memory.request(
                    done,
                    Requester::Splats,
                    Direction::Write,
                    address(half + 1),
                    part,
                );
                moved += part;
            }
            done
        };
        // The list was written during the walk, except for the channel's cycles.
        let mut now =
            moved(self.tested.saturating_sub(entries), false, PASSES + 1).max(self.tested);
        for pass in 0..PASSES {
            now = moved(now, true, pass).max(now + entries + DIGITS);
        }
        self.held = None;
        self.sorted = Some(now);
        now
    }
}

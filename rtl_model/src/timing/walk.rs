//! Walk: how long `fetch` takes to find the splats of a tree.
//!
//! ```text
//! stack ─►( children of some nodes, asked for together )─► memory ─►( a node a cycle )─┬─► project, as they come
//!   ▲                                                                     │           └─► list ─► sort ─► project, the largest first
//!   └─────────────────────────────────────────────────────────────────────┘
//! ```
//! Which children are asked for next is known when all that were asked for before are tested: one
//! latency of memory, and one of the test, which is that of `project`, a round. Within a round
//! requests follow each other a cycle apart. Nodes of one round that share a burst read it once.
//!
//! Where the largest come first, the walk goes through the tree and lists what it draws, 8 bytes a
//! node; two passes sort the list; then each record is read again.
//!
//! Laws (tests/tree.rs of the bench): `a_walk_takes_a_latency_a_round`,
//! `a_walk_reads_every_node_of_its_visits`.

use super::account::{Ready, Unit};
use super::memory::{Client, Direction, Memory, NODES, Outstanding};
use crate::elaboration::microarchitecture::{Microarchitecture, WALK_DIGIT_BITS};
use crate::work::{Found, Visit, Work};

/// Bytes of a list's entry: a size and a node.
const ENTRY_BYTES: u64 = 8;
/// Passes of the sort, and values of a digit.
const PASSES: u64 = 2;
const DIGITS: u64 = 1 << WALK_DIGIT_BITS;
/// Bytes that the sort moves at a time.
const PART_BYTES: u64 = 1 << 12;

/// A walk, or what follows from it.
#[derive(Clone, Debug)]
pub struct Walk<'a> {
    visits: &'a [Visit],
    ahead: u32,
    listed: &'a [u32],
    node_bytes: u64,
    burst_bytes: u64,
    test: u64,
    /// The next visit, and of the list the next node.
    next: usize,
    next_listed: usize,
    /// The first visit of the round, its groups so far, and when it could begin.
    round: usize,
    groups: u32,
    begun: u64,
    /// When the next request can go, and the last test was through.
    free: u64,
    tested: u64,
    /// The last burst that was read, and when it was there.
    held: Option<(u64, u64)>,
    /// When the sorted list can be read.
    sorted: Option<u64>,
    list_bursts: u64,
    list_here: u64,
}

impl<'a> Walk<'a> {
    /// None where splats lie in memory one after the other. Nothing is read before something else
    /// is loaded.
    pub fn new(timing: &Microarchitecture, work: &'a Work, loaded: u64) -> Option<Self> {
        (!work.walk.is_empty()).then(|| Walk {
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

    /// Finds the next splat; says when `fetch` takes it.
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

    /// Reads the rest: what is not drawn.
    pub fn end(&mut self, fetch: &mut Unit, outstanding: &mut Outstanding, memory: &mut Memory) {
        while let Some(visit) = self.visits.get(self.next) {
            self.visit(*visit, fetch, outstanding, memory);
        }
    }

    /// Reads a node and tests it; says when.
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
            // What comes next depends on the round, or the round is full.
            if parent >= self.round || self.groups == self.ahead {
                (self.round, self.groups) = (self.next, 0);
                self.begun = self.tested;
                self.held = None;
            }
            self.groups += 1;
        }
        let here = self.read(visit.node.into(), self.begun, outstanding, memory);
        // Of a list nothing goes on yet.
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

    /// A node's record, asked for at that time or later; says when it is here.
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
                Client::Splats,
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
                Client::Splats,
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

    /// Writes the list and sorts it: an entry a cycle in each pass, and a cycle for each value of a
    /// digit. Says when it is done.
    fn sort(&mut self, memory: &mut Memory) -> u64 {
        let entries = self.listed.len() as u64;
        let bytes = entries * ENTRY_BYTES;
        let mut moved = |from: u64, reads: bool, half: u64| {
            let (mut done, mut moved) = (from, 0);
            while moved < bytes {
                let part = PART_BYTES.min(bytes - moved);
                let address = |half: u64| NODES + half % 2 * (1 << 38) + moved;
                if reads {
                    done =
                        memory.request(done, Client::Splats, Direction::Read, address(half), part);
                }
                done = memory.request(
                    done,
                    Client::Splats,
                    Direction::Write,
                    address(half + 1),
                    part,
                );
                moved += part;
            }
            done
        };
        // It was written while the walk went on, but for the channel.
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

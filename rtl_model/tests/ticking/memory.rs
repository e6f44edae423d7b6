//! What does memory do in each cycle? One channel moves the bytes of the request that came first, and opens rows as it meets them.
//!
//! Of requests of the same cycle, splats go first, then lists and what they point to, then what leaves the frame, then what comes back, then texels;
//! those of one client in the order of asking. Bytes come a latency after the channel has moved them: that of the row, open or another,
//! for all that a request has in it. A channel as wide as all that is asked for is ideal memory.

use rtl_model::machine::timing::Memory as Description;
use rtl_model::timing::{CLIENTS, Client, Direction};
use std::cell::Cell;
use std::collections::BTreeMap;
use std::ops::Range;
use std::rc::Rc;

/// Where what lies: no two of them share a row.
pub const SPLATS: u64 = 0;
pub const RECORDS: u64 = 1 << 40;
pub const LISTS: u64 = 2 << 40;
pub const LINES: u64 = 3 << 40;
pub const WORDS: u64 = 4 << 40;
pub const MAP: u64 = 6 << 40;
/// Lists lie so far apart.
pub const LIST_BYTES: u64 = 1 << 24;

/// When a request is done: known once its bytes are moved.
#[derive(Clone, Debug, Default)]
pub struct Done(Rc<Cell<Option<u64>>>);

impl Done {
    pub fn has_come(&self, now: u64) -> bool {
        self.0.get().is_some_and(|at| at <= now)
    }
}

/// Requests on their way, in the order of asking, at most so many at a time.
pub struct Requests {
    limit: usize,
    pub asked: Vec<Done>,
    /// The first so many have come.
    come: usize,
}

impl Requests {
    pub fn new(limit: u32) -> Self {
        Requests { limit: limit as usize, asked: Vec::new(), come: 0 }
    }

    /// One more, whether or not it is known yet what it asks for.
    pub fn next(&mut self) -> Done {
        self.asked.push(Done::default());
        self.asked[self.asked.len() - 1].clone()
    }

    pub fn is_free(&self, now: u64) -> bool {
        match self.asked.len().checked_sub(self.limit) {
            Some(before) => self.asked[before].has_come(now),
            None => true,
        }
    }

    pub fn have_all_come(&mut self, now: u64) -> bool {
        self.come += self.asked[self.come..].iter().take_while(|done| done.has_come(now)).count();
        self.come == self.asked.len()
    }
}

/// What was moved.
#[derive(Clone, Debug, Default)]
pub struct Traffic {
    /// Cycles in which anything was.
    pub busy: u64,
    /// By client, read and written.
    pub bytes: [[u64; 2]; CLIENTS.len()],
    pub bursts: [u64; CLIENTS.len()],
    pub row_hits: u64,
}

/// A request that waits, or part of whose bytes are moved.
struct Waiting {
    bytes: Range<u64>,
    /// Of the row whose bytes are being moved.
    latency: Option<u64>,
    /// When what is moved has come.
    here: u64,
    done: Done,
}

/// The channel.
pub struct Memory {
    description: Description,
    /// By cycle, client and order of asking.
    waiting: BTreeMap<(u64, usize, u64), Waiting>,
    asked: u64,
    open: Vec<Option<u64>>,
    pub traffic: Traffic,
}

impl Memory {
    pub fn new(description: Description) -> Self {
        let open = vec![None; description.banks as usize];
        Memory { description, waiting: BTreeMap::new(), asked: 0, open, traffic: Traffic::default() }
    }

    /// Asks, in this cycle or one to come, for whole bursts.
    pub fn ask(&mut self, when: u64, client: Client, direction: Direction, bytes: Range<u64>, done: &Done) {
        let burst = u64::from(self.description.burst_bytes);
        let bytes = bytes.start / burst * burst..bytes.end.div_ceil(burst) * burst;
        self.traffic.bytes[client as usize][direction as usize] += bytes.end - bytes.start;
        self.traffic.bursts[client as usize] += (bytes.end - bytes.start) / burst;
        let turn = match client {
            Client::Splats => 0,
            Client::Binning | Client::Sort | Client::Lists => 1,
            Client::FrameWrite => 2,
            Client::FrameRead => 3,
            Client::Environment => 4,
        };
        self.asked += 1;
        self.waiting.insert((when, turn, self.asked), Waiting { bytes, latency: None, here: 0, done: done.clone() });
    }

    /// After all that is asked in a cycle.
    pub fn tick(&mut self, now: u64) {
        let Description { bytes_per_cycle, hit_latency, miss_latency, burst_bytes, row_bytes, banks, .. } = self.description;
        let [bytes_per_cycle, burst_bytes, row_bytes, banks] = [bytes_per_cycle, burst_bytes, row_bytes, banks].map(u64::from);
        let mut left = bytes_per_cycle;
        while left > 0
            && let Some(mut first) = self.waiting.first_entry().filter(|first| first.key().0 <= now)
        {
            let request = first.get_mut();
            let row = request.bytes.start / row_bytes;
            let end = request.bytes.end.min((row + 1) * row_bytes);
            let latency = *request.latency.get_or_insert_with(|| {
                let is_open = self.open[(row % banks) as usize].replace(row) == Some(row);
                // Its first burst opens the row for the others.
                self.traffic.row_hits += (end - request.bytes.start) / burst_bytes - u64::from(!is_open);
                u64::from(if is_open { hit_latency } else { miss_latency })
            });
            let moved = left.min(end - request.bytes.start);
            left -= moved;
            request.bytes.start += moved;
            if request.bytes.start == end {
                request.here = request.here.max(now + 1 + latency);
                request.latency = None;
            }
            if request.bytes.is_empty() {
                let Waiting { here, done, .. } = first.remove();
                done.0.set(Some(here));
            }
        }
        self.traffic.busy += u64::from(left < bytes_per_cycle);
    }
}

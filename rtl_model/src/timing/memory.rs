//! Memory: one channel, rows that are open, latencies.
//!
//! ```text
//! request ─►( first free moment of the channel at or after it )─► bytes ÷ bandwidth ─►( + latency of an open or another row )─► done
//! ```
//! Items are gone through one after the other, each through all units, so that requests do not come in the order of time. The channel
//! therefore keeps a calendar: [`SPAN`] cycles a page, and how many of their bytes are given away. A request takes the first bytes left
//! from its cycle on. Rows are opened in the order of requests.

use crate::machine::timing::Memory as Description;

/// Who asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Client {
    /// Splat records.
    Splats,
    /// Tile lists and the splats that were set up.
    Lists,
    /// Fragments that come back.
    FrameRead,
    /// Fragments, or frame words, that leave.
    FrameWrite,
}

/// All of them, in the order of reports.
pub const CLIENTS: [Client; 4] = [Client::Splats, Client::Lists, Client::FrameRead, Client::FrameWrite];

/// Bins of the histogram of latencies.
pub const LATENCY_BINS: usize = 24;

/// Traffic of a frame.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MemoryCycles {
    /// Cycles in which bytes were moved, rounded up.
    pub busy: u64,
    /// Bytes read and written by each client.
    pub bytes: [[u64; 2]; CLIENTS.len()],
    /// Requests of each client.
    pub requests: [u64; CLIENTS.len()],
    /// Requests that found their row open.
    pub row_hits: u64,
    /// Reads by latency: `latencies[n]` counts those of 2^n to 2^(n+1) − 1 cycles.
    pub latencies: [u64; LATENCY_BINS],
}

impl MemoryCycles {
    /// Bytes moved.
    pub fn total_bytes(&self) -> u64 {
        self.bytes.as_flattened().iter().sum()
    }
}

/// Cycles of a page of the calendar.
const SPAN: u64 = 32;
/// Pages that are kept open for requests that come late.
const PAGES: usize = 1 << 12;

/// The channel.
#[derive(Clone, Debug)]
pub struct Memory {
    description: Description,
    /// Bytes given away on each page, page n at n modulo [`PAGES`].
    pages: Box<[u64]>,
    /// The last page that was begun.
    last: u64,
    open: Box<[u64]>,
    pub cycles: MemoryCycles,
}

/// Read or write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    Read,
    Write,
}

impl Memory {
    pub fn new(description: Description) -> Self {
        Memory {
            description,
            pages: vec![0; PAGES].into(),
            last: 0,
            open: vec![u64::MAX; description.banks as usize].into(),
            cycles: MemoryCycles::default(),
        }
    }

    /// Moves bytes from an address on, as requests of whole bursts; says when the last has come.
    pub fn request(&mut self, now: u64, client: Client, direction: Direction, address: u64, bytes: u64) -> u64 {
        let burst = u64::from(self.description.burst_bytes);
        let (first, end) = (address / burst, (address + bytes.max(1)).div_ceil(burst));
        let mut done = now;
        for burst_index in first..end {
            done = done.max(self.burst(now, client, direction, burst_index * burst));
        }
        done
    }

    fn burst(&mut self, now: u64, client: Client, direction: Direction, address: u64) -> u64 {
        let Description { burst_bytes, row_bytes, banks, hit_latency, miss_latency, .. } = self.description;
        let row = address / u64::from(row_bytes);
        let open = &mut self.open[(row % u64::from(banks)) as usize];
        let is_open = *open == row;
        *open = row;
        let moved = self.move_bytes(now, u64::from(burst_bytes));
        let done = moved + u64::from(if is_open { hit_latency } else { miss_latency });
        let cycles = &mut self.cycles;
        cycles.row_hits += u64::from(is_open);
        cycles.bytes[client as usize][direction as usize] += u64::from(burst_bytes);
        cycles.requests[client as usize] += 1;
        if direction == Direction::Read {
            cycles.latencies[((done - now).max(1).ilog2() as usize).min(LATENCY_BINS - 1)] += 1;
        }
        done
    }

    /// When the channel has moved so many bytes, from a cycle on.
    fn move_bytes(&mut self, now: u64, mut bytes: u64) -> u64 {
        let a_cycle = u64::from(self.description.bytes_per_cycle);
        let a_page = SPAN * a_cycle;
        let mut page = (now / SPAN).max((self.last + 1).saturating_sub(PAGES as u64));
        loop {
            self.begin(page);
            let given = &mut self.pages[(page % PAGES as u64) as usize];
            // What lies before this cycle on its page is gone, if nobody took it.
            let before = if page == now / SPAN { (now % SPAN) * a_cycle } else { 0 };
            let from = (*given).max(before);
            let take = bytes.min(a_page - from);
            // Those who come later may still have what was left before.
            *given += take;
            bytes -= take;
            if bytes == 0 {
                return page * SPAN + (from + take).div_ceil(a_cycle);
            }
            page += 1;
        }
    }

    /// Opens all pages up to this one.
    fn begin(&mut self, page: u64) {
        if page > self.last {
            let first = (self.last + 1).max((page + 1).saturating_sub(PAGES as u64));
            (first..=page).for_each(|page| self.pages[(page % PAGES as u64) as usize] = 0);
            self.last = page;
        }
    }

    /// The traffic, and for how long the channel was busy with it.
    pub fn finish(self) -> MemoryCycles {
        let busy = self.cycles.total_bytes().div_ceil(u64::from(self.description.bytes_per_cycle));
        MemoryCycles { busy, ..self.cycles }
    }
}

/// Requests that a client can have on their way.
#[derive(Clone, Debug)]
pub struct Outstanding {
    done: Box<[u64]>,
    next: usize,
}

impl Outstanding {
    pub fn new(most: u32) -> Self {
        Outstanding { done: vec![0; most as usize].into(), next: 0 }
    }

    /// The first cycle in which another can go.
    pub fn free(&self) -> u64 {
        self.done[self.next]
    }

    /// Another is done then.
    pub fn push(&mut self, done: u64) {
        self.done[self.next] = done;
        self.next = (self.next + 1) % self.done.len();
    }
}

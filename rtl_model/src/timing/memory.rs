//! Memory: one channel, rows that are open, latencies.
//!
//! ```text
//! request ─►( first free moment of the channel at or after it )─► bytes ÷ bandwidth ─►( + latency of an open or another row )─► done
//! ```
//! Items are gone through one after the other, each through all units, so that requests do not come in the order of time. The channel
//! therefore keeps a calendar: [`SPAN`] cycles a page, and how many of their bytes are given away. A request takes the first bytes left
//! from its cycle on. Rows are opened in the order of requests.
//!
//! Law: `a_frame_bound_by_memory_takes_its_bytes_over_the_bandwidth`.

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

impl Client {
    /// What it is called in reports.
    pub fn name(self) -> &'static str {
        match self {
            Client::Splats => "splats",
            Client::Lists => "lists",
            Client::FrameRead => "frame_read",
            Client::FrameWrite => "frame_write",
        }
    }
}

/// All of them, in the order of reports.
pub const CLIENTS: [Client; 4] = [Client::Splats, Client::Lists, Client::FrameRead, Client::FrameWrite];

/// Where what lies: regions so far apart that no two share a row. Splat records begin at 0.
const REGION: u64 = 1 << 40;
/// Splats that were set up.
pub const RECORDS: u64 = REGION;
/// Lists of tiles.
pub const LISTS: u64 = 2 * REGION;
/// Lines of fragments.
pub const LINES: u64 = 3 * REGION;
/// Frame words.
pub const WORDS: u64 = 4 * REGION;

/// Bins of the histogram of latencies.
pub const LATENCY_BINS: usize = 24;

/// Traffic of a frame.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MemoryCycles {
    /// Cycles in which bytes were moved, rounded up.
    pub busy: u64,
    /// Bytes read and written by each client.
    pub bytes: [[u64; 2]; CLIENTS.len()],
    /// Bursts of each client.
    pub requests: [u64; CLIENTS.len()],
    /// Bursts that found their row open.
    pub row_hits: u64,
    /// Reads, of however many bursts, by latency: `latencies[n]` counts those of 2^n to 2^(n+1) − 1 cycles.
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

/// A page of the calendar.
#[derive(Clone, Copy, Debug)]
struct Page {
    /// Bytes given away.
    given: u64,
    /// Where to look once it is full: no page before that one is free.
    skip: u64,
}

/// The channel.
#[derive(Clone, Debug)]
pub struct Memory {
    description: Description,
    /// Page n at n modulo [`PAGES`].
    pages: Box<[Page]>,
    /// The last page that was begun.
    last: u64,
    open: Box<[u64]>,
    cycles: MemoryCycles,
    log: Option<Vec<Request>>,
}

/// What was asked of memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Request {
    /// When.
    pub cycle: u64,
    /// The first byte, at a burst's beginning.
    pub address: u64,
    /// Whole bursts of them.
    pub bytes: u64,
    /// From memory or to it.
    pub direction: Direction,
}

/// Read or write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// From memory.
    Read,
    /// To memory.
    Write,
}

impl Memory {
    /// `logged` keeps every request.
    pub fn new(description: Description, logged: bool) -> Self {
        Memory {
            description,
            pages: vec![Page { given: 0, skip: 1 }; PAGES].into(),
            last: 0,
            open: vec![u64::MAX; description.banks as usize].into(),
            cycles: MemoryCycles::default(),
            log: logged.then(Vec::new),
        }
    }

    /// Moves bytes from an address on, in whole bursts; says when the last has come. A row is opened for each that the bytes lie in.
    pub fn request(&mut self, now: u64, client: Client, direction: Direction, address: u64, bytes: u64) -> u64 {
        let Description { burst_bytes, row_bytes, .. } = self.description;
        let [burst, row] = [burst_bytes, row_bytes].map(u64::from);
        let end = (address + bytes.max(1)).next_multiple_of(burst);
        let mut from = address / burst * burst;
        self.cycles.bytes[client as usize][direction as usize] += end - from;
        self.cycles.requests[client as usize] += (end - from) / burst;
        if let Some(log) = &mut self.log {
            log.push(Request { cycle: now, address: from, bytes: end - from, direction });
        }
        let mut done = now;
        while from < end {
            let to = end.min((from / row + 1) * row);
            done = done.max(self.in_a_row(now, from / row, to - from));
            from = to;
        }
        if direction == Direction::Read {
            self.cycles.latencies[((done - now).max(1).ilog2() as usize).min(LATENCY_BINS - 1)] += 1;
        }
        done
    }

    fn in_a_row(&mut self, now: u64, row: u64, bytes: u64) -> u64 {
        let Description { burst_bytes, banks, hit_latency, miss_latency, .. } = self.description;
        let open = &mut self.open[(row % u64::from(banks)) as usize];
        let is_open = std::mem::replace(open, row) == row;
        // After its first burst the row is open.
        self.cycles.row_hits += u64::from(is_open) + bytes / u64::from(burst_bytes) - 1;
        self.move_bytes(now, bytes) + u64::from(if is_open { hit_latency } else { miss_latency })
    }

    /// When the channel has moved so many bytes, from a cycle on.
    fn move_bytes(&mut self, now: u64, mut bytes: u64) -> u64 {
        let a_cycle = u64::from(self.description.bytes_per_cycle);
        let a_page = SPAN * a_cycle;
        let mut page = now / SPAN;
        loop {
            page = self.first_free(page);
            let given = &mut self.pages[page as usize % PAGES].given;
            // What lies before this cycle on its page is gone, if nobody took it.
            let before = if page == now / SPAN { (now % SPAN) * a_cycle } else { 0 };
            let from = (*given).max(before);
            let take = bytes.min(a_page - from);
            *given += take;
            bytes -= take;
            if bytes == 0 {
                return page * SPAN + (from + take).div_ceil(a_cycle);
            }
            page += 1;
        }
    }

    /// The first page from this one on that is not full; opens it, and all before it.
    fn first_free(&mut self, page: u64) -> u64 {
        let a_page = SPAN * u64::from(self.description.bytes_per_cycle);
        // Whoever comes so late that his page is gone takes from the first that is left.
        let page = page.max((self.last + 1).saturating_sub(PAGES as u64));
        let mut free = page;
        while free <= self.last && self.pages[free as usize % PAGES].given == a_page {
            free = self.pages[free as usize % PAGES].skip;
        }
        if free > self.last {
            let first = (self.last + 1).max((free + 1).saturating_sub(PAGES as u64));
            (first..=free).for_each(|page| self.pages[page as usize % PAGES] = Page { given: 0, skip: page + 1 });
            self.last = free;
        }
        let mut full = page.max((self.last + 1).saturating_sub(PAGES as u64));
        while full < free {
            full = std::mem::replace(&mut self.pages[full as usize % PAGES].skip, free);
        }
        free
    }

    /// The traffic, for how long the channel was busy with it, and what was logged.
    pub fn finish(self) -> (MemoryCycles, Vec<Request>) {
        let busy = self.cycles.total_bytes().div_ceil(u64::from(self.description.bytes_per_cycle));
        (MemoryCycles { busy, ..self.cycles }, self.log.unwrap_or_default())
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

//! Memory: one channel, rows that are open, latencies; what there is beyond that is in
//! `channels.rs`.
//!
//! ```text
//! request ─►( first free moment of the channel at or after it )─► bytes ÷ bandwidth ─►( + latency of an open or another row )─► done
//! ```
//! Items are gone through one after the other, each through all units, so that requests do not come
//! in the order of time. The channel therefore keeps the gaps between what it gave away. A request
//! takes the first bytes left from its cycle on. Rows are opened in the order of requests. What
//! nobody waits for is written after all that is asked for before; where the first pass of a binned
//! machine fetches and writes lists, who comes first asks first, as far as it has room. Ideal
//! memory has no channel: bytes are there a cycle and the latency of an open row after they are
//! asked for.
//!
//! A channel that serves who came first takes as long within 0.6 % on small versions of the
//! built-in scenes, within 0.63 % on themselves (terrain, binned, both times); of random frames
//! with narrow memory nine in ten are off by at most 1.5 % (immediate) and 4.5 % (binned), one of a
//! few hundred cycles by 25 %, all together by 0.3 %. The same bytes are moved in the same bursts.
//!
//! Laws: `a_frame_bound_by_memory_takes_its_bytes_over_the_bandwidth`,
//! `replayed_scenes_are_at_most_a_hundredth_off`,
//! `a_frame_with_narrow_memory_moves_the_same_bytes_in_about_the_time`.

use super::channels::Channels;
use crate::machine::timing::Memory as Description;
use std::collections::VecDeque;
use std::ops::Range;

/// Client that asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Client {
    /// Splat records.
    Splats,
    /// The first pass writes tile lists and the splats that were set up.
    Binning,
    /// Passes of the sort.
    Sort,
    /// The second pass reads tile lists and the splats that were set up.
    Lists,
    /// Fragments that come back.
    FrameRead,
    /// Fragments, or frame words, that leave.
    FrameWrite,
    /// The map of surroundings.
    Environment,
}

impl Client {
    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Client::Splats => "splats",
            Client::Binning => "binning",
            Client::Sort => "sort",
            Client::Lists => "lists",
            Client::FrameRead => "frame_read",
            Client::FrameWrite => "frame_write",
            Client::Environment => "environment",
        }
    }
}

/// All of them, in the order of reports.
pub const CLIENTS: [Client; 7] = [
    Client::Splats,
    Client::Binning,
    Client::Sort,
    Client::Lists,
    Client::FrameRead,
    Client::FrameWrite,
    Client::Environment,
];

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
/// Nodes of a tree that are drawn, by their size.
pub const NODES: u64 = 5 * REGION;
/// The map of surroundings.
pub const MAP: u64 = 6 * REGION;

/// Bins of the histogram of latencies.
pub const LATENCY_BINS: usize = 24;

/// Traffic of a frame.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MemoryCycles {
    /// Cycles in which bytes were moved, by all channels at once, rounded up; 0 of ideal memory.
    pub busy: u64,
    /// Bytes read and written by each client.
    pub bytes: [[u64; 2]; CLIENTS.len()],
    /// Bursts of each client.
    pub requests: [u64; CLIENTS.len()],
    /// Bursts that found their row open.
    pub row_hits: u64,
    /// Reads, of however many bursts, by latency: `latencies[n]` counts those of 2^n to 2^(n+1) − 1
    /// cycles.
    pub latencies: [u64; LATENCY_BINS],
}

impl MemoryCycles {
    /// Bytes moved.
    pub fn total_bytes(&self) -> u64 {
        self.bytes.as_flattened().iter().sum()
    }
}

/// A write for which nobody waits.
#[derive(Clone, Copy, Debug)]
struct Later {
    cycle: u64,
    client: Client,
    address: u64,
    bytes: u64,
}

/// What was not given away of something, since the first cycle: gaps, and all from the last of them
/// on.
#[derive(Clone, Debug, Default)]
pub struct Free {
    gaps: VecDeque<Range<u64>>,
    never_used: u64,
}

impl Free {
    /// Gives so much away from here on, the first that is left; says what follows it.
    #[inline(always)]
    pub fn take(&mut self, now: u64, amount: u64) -> u64 {
        // Mostly nothing was given away after it.
        if self.never_used <= now {
            if self.never_used < now {
                self.gaps.push_back(self.never_used..now);
            }
            self.never_used = now + amount;
            self.never_used
        } else {
            self.fill_gaps(now, amount)
        }
    }

    fn fill_gaps(&mut self, now: u64, mut amount: u64) -> u64 {
        let mut index = self.gaps.partition_point(|gap| gap.end <= now);
        loop {
            let Some(gap) = self.gaps.get_mut(index) else {
                self.never_used += amount;
                return self.never_used;
            };
            let from = now.max(gap.start);
            let to = gap.end.min(from + amount);
            amount -= to - from;
            let after = to..std::mem::replace(&mut gap.end, from);
            if from == gap.start {
                // From its beginning on: what is left of it stays.
                *gap = after;
                if gap.is_empty() {
                    self.gaps.remove(index);
                }
            } else {
                index += 1;
                if !after.is_empty() {
                    self.gaps.insert(index, after);
                }
            }
            if amount == 0 {
                return to;
            }
        }
    }

    /// Gives so much away in one piece, from here on, the first that is left; says where it begins.
    pub fn take_whole(&mut self, now: u64, amount: u64) -> u64 {
        let first = self.gaps.partition_point(|gap| gap.end <= now);
        let fits = |gap: &Range<u64>| gap.end.saturating_sub(gap.start.max(now)) >= amount;
        let from = match self.gaps.range(first..).find(|gap| fits(gap)) {
            Some(gap) => gap.start.max(now),
            None => self.never_used.max(now),
        };
        self.take(from, amount);
        from
    }

    /// Nothing will be taken before this one.
    pub fn forget(&mut self, before: u64) {
        while self.gaps.pop_front_if(|gap| gap.end <= before).is_some() {}
    }
}

/// The channel.
#[derive(Clone, Debug)]
pub struct Memory {
    description: Description,
    /// Logarithms of a burst's and a row's bytes.
    log: [u32; 2],
    /// In bytes.
    bus: Free,
    open: Box<[u64]>,
    /// In the place of these, where there is more than one channel of open rows.
    channels: Option<Box<Channels>>,
    /// What is still to be written, by cycle, and when the last that was is there.
    later: VecDeque<Later>,
    written: u64,
    cycles: MemoryCycles,
    logged: Option<Vec<Request>>,
}

/// Request to memory.
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
            log: [description.burst_bytes, description.row_bytes].map(u32::ilog2),
            bus: Free::default(),
            open: vec![u64::MAX; description.banks as usize].into(),
            channels: Channels::new(description).map(Box::new),
            later: VecDeque::new(),
            written: 0,
            cycles: MemoryCycles::default(),
            logged: logged.then(Vec::new),
        }
    }

    /// Writes bytes for which nobody waits: after all that is asked for before this cycle, whenever
    /// that is said.
    pub fn write_later(&mut self, cycle: u64, client: Client, address: u64, bytes: u64) {
        if self.description.ideal {
            let done = self.answer(cycle, client, Direction::Write, address, bytes);
            self.written = self.written.max(done);
            return;
        }
        let at = self.later.partition_point(|before| before.cycle <= cycle);
        self.later.insert(
            at,
            Later {
                cycle,
                client,
                address,
                bytes,
            },
        );
    }

    /// Moves bytes from an address on, in whole bursts; says when the last has come.
    #[inline(always)]
    pub fn request(
        &mut self,
        now: u64,
        client: Client,
        direction: Direction,
        address: u64,
        bytes: u64,
    ) -> u64 {
        if self.description.ideal {
            return self.answer(now, client, direction, address, bytes);
        }
        self.request_of_channel(now, client, direction, address, bytes)
    }

    #[inline(never)]
    fn request_of_channel(
        &mut self,
        now: u64,
        client: Client,
        direction: Direction,
        address: u64,
        bytes: u64,
    ) -> u64 {
        self.write_until(now);
        self.serve(now, client, direction, address, bytes)
    }

    /// Nobody will ask for anything before this cycle.
    #[inline(always)]
    pub fn forget(&mut self, before: u64) {
        if !self.description.ideal {
            self.forget_gaps(before);
        }
    }

    fn forget_gaps(&mut self, before: u64) {
        self.write_until(before);
        match &mut self.channels {
            Some(channels) => channels.forget(before),
            None => self
                .bus
                .forget(before * u64::from(self.description.bytes_per_cycle)),
        }
    }

    /// Writes what is to be written up to a cycle.
    fn write_until(&mut self, now: u64) {
        while let Some(Later {
            cycle,
            client,
            address,
            bytes,
        }) = self.later.pop_front_if(|later| later.cycle <= now)
        {
            let done = self.serve(cycle, client, Direction::Write, address, bytes);
            self.written = self.written.max(done);
        }
    }

    /// Ideal: every request is answered as fast.
    #[inline(always)]
    fn answer(
        &mut self,
        now: u64,
        client: Client,
        direction: Direction,
        address: u64,
        bytes: u64,
    ) -> u64 {
        self.count(now, client, direction, address, bytes);
        let done = now + 1 + u64::from(self.description.hit_latency);
        self.count_latency(direction, done - now);
        done
    }

    /// Whole bursts: from where to where.
    #[inline(always)]
    fn count(
        &mut self,
        now: u64,
        client: Client,
        direction: Direction,
        address: u64,
        bytes: u64,
    ) -> [u64; 2] {
        let burst = 1 << self.log[0];
        let [first, last] = [address, address + bytes.max(1) - 1].map(|byte| byte / burst);
        let (from, end) = (first * burst, (last + 1) * burst);
        self.cycles.bytes[client as usize][direction as usize] += end - from;
        self.cycles.requests[client as usize] += last + 1 - first;
        if let Some(logged) = &mut self.logged {
            logged.push(Request {
                cycle: now,
                address: from,
                bytes: end - from,
                direction,
            });
        }
        [from, end]
    }

    #[inline(always)]
    fn count_latency(&mut self, direction: Direction, cycles: u64) {
        if direction == Direction::Read {
            self.cycles.latencies[(cycles.max(1).ilog2() as usize).min(LATENCY_BINS - 1)] += 1;
        }
    }

    /// A row is opened for each that the bytes lie in.
    fn serve(
        &mut self,
        now: u64,
        client: Client,
        direction: Direction,
        address: u64,
        bytes: u64,
    ) -> u64 {
        let row = 1 << self.log[1];
        let [mut from, end] = self.count(now, client, direction, address, bytes);
        if let Some(channels) = &mut self.channels {
            let [done, hits] = channels.serve(now, direction, from, end);
            self.cycles.row_hits += hits;
            self.count_latency(direction, done - now);
            return done;
        }
        let mut done = now;
        while from < end {
            let nth = from / row;
            let to = end.min((nth + 1) * row);
            done = done.max(self.in_a_row(now, nth, to - from));
            from = to;
        }
        self.count_latency(direction, done - now);
        done
    }

    fn in_a_row(&mut self, now: u64, row: u64, bytes: u64) -> u64 {
        let Description {
            hit_latency,
            miss_latency,
            ..
        } = self.description;
        let bank = row as usize & (self.open.len() - 1);
        let open = &mut self.open[bank];
        let is_open = std::mem::replace(open, row) == row;
        // After its first burst the row is open.
        self.cycles.row_hits += u64::from(is_open) + bytes / (1 << self.log[0]) - 1;
        self.move_bytes(now, bytes) + u64::from(if is_open { hit_latency } else { miss_latency })
    }

    /// When the channel has moved so many bytes, from a cycle on.
    #[inline(always)]
    fn move_bytes(&mut self, now: u64, bytes: u64) -> u64 {
        let a_cycle = u64::from(self.description.bytes_per_cycle);
        self.bus.take(now * a_cycle, bytes).div_ceil(a_cycle)
    }

    /// The traffic, for how long the channel was busy with it, what was logged, and when all is
    /// written for which nobody waited.
    pub fn finish(mut self) -> (MemoryCycles, Vec<Request>, u64) {
        self.write_until(u64::MAX);
        let thousandths = self.description.bytes_per_1000_cycles();
        let busy = if self.description.ideal {
            0
        } else {
            (1000 * self.cycles.total_bytes()).div_ceil(thousandths)
        };
        (
            MemoryCycles {
                busy,
                ..self.cycles
            },
            self.logged.unwrap_or_default(),
            self.written,
        )
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
        Outstanding {
            done: vec![0; most as usize].into(),
            next: 0,
        }
    }

    /// The first cycle in which another can go.
    pub fn free(&self) -> u64 {
        self.done[self.next]
    }

    /// Another is done then.
    pub fn push(&mut self, done: u64) {
        self.done[self.next] = done;
        self.next = if self.next + 1 == self.done.len() {
            0
        } else {
            self.next + 1
        };
    }
}

/// Cycles that memory takes for requests in this order, at most `queue` of them under way, whatever
/// their own cycles are.
pub fn serve(memory: Description, requests: impl IntoIterator<Item = Request>, queue: u32) -> u64 {
    let mut served = Memory::new(memory, false);
    let mut outstanding = Outstanding::new(queue);
    let (mut asked, mut last) = (0, 0);
    for Request {
        address,
        bytes,
        direction,
        ..
    } in requests
    {
        asked = asked.max(outstanding.free());
        served.forget(asked);
        let done = served.request(asked, Client::Lists, direction, address, bytes);
        outstanding.push(done);
        last = last.max(done);
    }
    last
}

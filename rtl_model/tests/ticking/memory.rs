//! What does memory do in each cycle? Each channel moves the bytes of its oldest request and opens
//! rows as they are needed. Where it can open rows only at some times, the oldest requests open
//! theirs first, and the oldest request whose row is open is served.
//!
//! Among requests of the same cycle, splats go first, then lists and records, then writes of the
//! frame, then reads of the frame, then texels. Requests of one requester keep their order of
//! issue. Bytes arrive a latency after the channel has moved them: the latency of an open or a
//! closed row, for all bytes of a request in that row. A channel as wide as all requests together
//! is ideal memory.

use rtl_model::machine::timing::Memory as Description;
use rtl_model::timing::{Direction, REQUESTERS, Requester};
use std::cell::Cell;
use std::collections::{BTreeMap, VecDeque};
use std::ops::Range;
use std::rc::Rc;

/// Address regions; no two of them share a row.
pub const SPLATS: u64 = 0;
pub const RECORDS: u64 = 1 << 40;
pub const LISTS: u64 = 2 << 40;
pub const LINES: u64 = 3 << 40;
pub const WORDS: u64 = 4 << 40;
pub const MAP: u64 = 6 << 40;
/// Distance between two lists.
pub const LIST_BYTES: u64 = 1 << 24;

/// On memory with channels, each list begins one bank after the list before.
pub fn apart(memory: &Description, bytes: u64) -> u64 {
    let has_channels = memory.channels.unwrap_or(1) > 1
        || memory.ranks.unwrap_or(1) > 1
        || [
            memory.bytes_per_cycle_permille,
            memory.rank_switch_cycles,
            memory.turnaround_cycles,
            memory.row_cycles,
            memory.four_rows_cycles,
            memory.refresh_interval_cycles,
        ]
        .iter()
        .any(|limit| limit.is_some_and(|limit| limit > 0));
    match has_channels {
        true => bytes + u64::from(memory.row_bytes) * u64::from(memory.channels.unwrap_or(1)),
        false => bytes,
    }
}

/// Completion cycle of a request: known once its bytes are moved.
#[derive(Clone, Debug, Default)]
pub struct Done(Rc<Cell<Option<u64>>>);

impl Done {
    pub fn is_done(&self, now: u64) -> bool {
        self.0.get().is_some_and(|at| at <= now)
    }
}

/// Outstanding requests in order of issue, limited in number.
pub struct Requests {
    limit: usize,
    pub issued: Vec<Done>,
    /// Number of requests at the front that are done.
    done_count: usize,
}

impl Requests {
    pub fn new(limit: u32) -> Self {
        Requests {
            limit: limit as usize,
            issued: Vec::new(),
            done_count: 0,
        }
    }

    /// Issues a request; its address may still be unknown.
    pub fn next(&mut self) -> Done {
        self.issued.push(Done::default());
        self.issued[self.issued.len() - 1].clone()
    }

    pub fn is_free(&self, now: u64) -> bool {
        match self.issued.len().checked_sub(self.limit) {
            Some(before) => self.issued[before].is_done(now),
            None => true,
        }
    }

    pub fn are_all_done(&mut self, now: u64) -> bool {
        self.done_count += self.issued[self.done_count..]
            .iter()
            .take_while(|done| done.is_done(now))
            .count();
        self.done_count == self.issued.len()
    }
}

/// Moved data.
#[derive(Clone, Debug, Default)]
pub struct Traffic {
    /// Cycles in which any data was moved.
    pub busy: u64,
    /// By requester, read and written.
    pub bytes: [[u64; 2]; REQUESTERS.len()],
    pub bursts: [u64; REQUESTERS.len()],
    pub row_hits: u64,
}

/// A request. It is done when the last of its parts is.
struct PendingRequest {
    parts: Cell<u64>,
    here: Cell<u64>,
    done: Done,
}

/// Waiting part of a request in one channel.
struct PartialRequest {
    /// Range in the channel's own addresses.
    bytes: Range<u64>,
    is_write: bool,
    /// The row was opened for it.
    has_opened: bool,
    /// Thousandths of bytes of the current row that are still to be moved, and the latency; `None`
    /// before it starts.
    begun: Option<(u64, u64)>,
    request: Rc<PendingRequest>,
}

#[derive(Default)]
struct Channel {
    /// By cycle, requester priority and order of issue.
    waiting: BTreeMap<(u64, usize, u64), PartialRequest>,
    /// Request whose bytes are being moved.
    now: Option<(u64, usize, u64)>,
    open: Vec<Option<u64>>,
    /// Cycle in which each bank last opened a row, and the last four such cycles per rank.
    opened: Vec<Option<u64>>,
    opened_by_rank: Vec<VecDeque<u64>>,
    rank: usize,
    gathered: u64,
    has_read: bool,
}

/// All channels.
pub struct Memory {
    description: Description,
    channels: Vec<Channel>,
    issued: u64,
    pub traffic: Traffic,
}

impl Memory {
    pub fn new(description: Description) -> Self {
        let ranks = description.ranks.unwrap_or(1) as usize;
        let banks = description.banks as usize * ranks;
        let channel = || Channel {
            open: vec![None; banks],
            opened: vec![None; banks],
            opened_by_rank: vec![VecDeque::new(); ranks],
            ..Channel::default()
        };
        let channels = (0..description.channels.unwrap_or(1))
            .map(|_| channel())
            .collect();
        Memory {
            description,
            channels,
            issued: 0,
            traffic: Traffic::default(),
        }
    }

    /// Issues a request for whole bursts, in this cycle or a later one.
    pub fn request(
        &mut self,
        when: u64,
        client: Requester,
        direction: Direction,
        bytes: Range<u64>,
        done: &Done,
    ) {
        let burst = u64::from(self.description.burst_bytes);
        let bytes = bytes.start / burst * burst..bytes.end.div_ceil(burst) * burst;
        self.traffic.bytes[client as usize][direction as usize] += bytes.end - bytes.start;
        self.traffic.bursts[client as usize] += (bytes.end - bytes.start) / burst;
        let turn = match client {
            Requester::Splats => 0,
            Requester::Binning | Requester::Sort | Requester::Lists => 1,
            Requester::FrameWrite => 2,
            Requester::FrameRead => 3,
            Requester::Environment => 4,
        };
        self.issued += 1;
        // Consecutive lines go to consecutive channels; a channel's own lines are contiguous.
        let count = self.channels.len() as u64;
        let line_bytes = if count == 1 {
            1 << 60
        } else {
            u64::from(
                self.description
                    .interleave_bytes
                    .unwrap_or(self.description.burst_bytes),
            )
        };
        let mut parts: Vec<Option<Range<u64>>> = vec![None; self.channels.len()];
        let mut at = bytes.start;
        while at < bytes.end {
            let end = bytes.end.min((at / line_bytes + 1) * line_bytes);
            let own = at / line_bytes / count * line_bytes + at % line_bytes;
            let part = &mut parts[(at / line_bytes % count) as usize];
            *part = Some(part.take().map_or(own, |part| part.start)..own + (end - at));
            at = end;
        }
        let many = parts.iter().flatten().count() as u64;
        let request = Rc::new(PendingRequest {
            parts: Cell::new(many),
            here: Cell::new(0),
            done: done.clone(),
        });
        for (channel, part) in self.channels.iter_mut().zip(parts) {
            let Some(bytes) = part else { continue };
            let is_write = direction == Direction::Write;
            let part = PartialRequest {
                bytes,
                is_write,
                has_opened: false,
                begun: None,
                request: request.clone(),
            };
            channel.waiting.insert((when, turn, self.issued), part);
        }
    }

    /// Called after all requests of a cycle.
    pub fn tick(&mut self, now: u64) {
        let is_busy = self
            .channels
            .iter_mut()
            .filter_map(|channel| channel.tick(now, &self.description, &mut self.traffic.row_hits));
        self.traffic.busy += u64::from(is_busy.count() > 0);
    }
}

impl Channel {
    /// Moves one cycle's bytes; `Some` if it moved any.
    fn tick(&mut self, now: u64, d: &Description, row_hits: &mut u64) -> Option<()> {
        let [row_bytes, banks, burst] = [d.row_bytes, d.banks, d.burst_bytes].map(u64::from);
        let [interval, refresh, still, turn, row_cycles, four_rows] = [
            d.refresh_interval_cycles,
            d.refresh_cycles,
            d.rank_switch_cycles,
            d.turnaround_cycles,
            d.row_cycles,
            d.four_rows_cycles,
        ]
        .map(|cycles| u64::from(cycles.unwrap_or(0)));
        if interval > 0 {
            if now.is_multiple_of(interval) {
                self.open.fill(None);
                self.waiting
                    .values_mut()
                    .for_each(|part| part.has_opened = false);
            }
            if now % interval >= interval - refresh {
                return None;
            }
        }
        let place = |part: &PartialRequest, banks_of_all: usize| {
            let row = part.bytes.start / row_bytes;
            let bank = (row % banks_of_all as u64) as usize;
            (row, bank, bank / banks as usize)
        };
        let all = self.open.len();
        let is_limited = row_cycles > 0 || four_rows > 0;
        if is_limited {
            // The oldest request of a bank opens its row as soon as the limits allow it.
            let mut claimed = vec![false; all];
            for (_, part) in self
                .waiting
                .iter_mut()
                .take_while(|((when, ..), _)| *when <= now)
            {
                let (row, bank, rank) = place(part, all);
                if std::mem::replace(&mut claimed[bank], true) || self.open[bank] == Some(row) {
                    continue;
                }
                let last = &mut self.opened_by_rank[rank];
                let is_rank_free = last.len() < 4 || last[0] + four_rows <= now;
                if self.opened[bank].is_none_or(|at| at + row_cycles <= now) && is_rank_free {
                    (self.open[bank], self.opened[bank]) = (Some(row), Some(now));
                    part.has_opened = true;
                    last.push_back(now);
                    if last.len() > 4 {
                        last.pop_front();
                    }
                }
            }
        }
        let whole = u64::from(d.bytes_per_cycle) * 1000
            + u64::from(d.bytes_per_cycle_permille.unwrap_or(0));
        let mut left = whole;
        while left > 0 {
            let is_ready = |part: &PartialRequest| {
                let (row, bank, _) = place(part, all);
                !is_limited || self.open[bank] == Some(row)
            };
            let first = self
                .waiting
                .iter()
                .take_while(|((when, ..), _)| *when <= now)
                .find(|(_, part)| is_ready(part));
            let Some(key) = self.now.or(first.map(|(key, _)| *key)) else {
                break;
            };
            self.now = Some(key);
            let Some(part) = self.waiting.get_mut(&key) else {
                break;
            };
            let (row, bank, rank) = place(part, all);
            let end = part.bytes.end.min((row + 1) * row_bytes);
            let bursts = (end - part.bytes.start) / burst;
            let (mut rest, latency) = part.begun.unwrap_or_else(|| {
                if !is_limited {
                    part.has_opened = self.open[bank].replace(row) != Some(row);
                }
                // The first burst opens the row for the others.
                *row_hits += bursts - u64::from(part.has_opened);
                let mut nothing = 0;
                if std::mem::replace(&mut self.rank, rank) != rank {
                    nothing += still;
                }
                if part.is_write {
                    if self.gathered == 0 && std::mem::take(&mut self.has_read) {
                        nothing += turn;
                    }
                    self.gathered += bursts;
                    if self.gathered >= u64::from(d.write_batch.unwrap_or(1)) {
                        self.gathered = 0;
                    }
                } else {
                    self.has_read = true;
                }
                let latency = if part.has_opened {
                    d.miss_latency
                } else {
                    d.hit_latency
                };
                (
                    1000 * (end - part.bytes.start) + nothing * whole,
                    u64::from(latency),
                )
            });
            let moved = left.min(rest);
            (left, rest) = (left - moved, rest - moved);
            part.begun = Some((rest, latency));
            if rest > 0 {
                continue;
            }
            (part.bytes.start, part.begun, part.has_opened, self.now) = (end, None, false, None);
            let request = part.request.clone();
            request.here.set(request.here.get().max(now + 1 + latency));
            if part.bytes.is_empty() {
                self.waiting.remove(&key);
                request.parts.set(request.parts.get() - 1);
                if request.parts.get() == 0 {
                    request.done.0.set(Some(request.here.get()));
                }
            } else if !is_limited {
                // The next row belongs to the same request.
                self.now = Some(key);
            }
        }
        (left < whole).then_some(())
    }
}

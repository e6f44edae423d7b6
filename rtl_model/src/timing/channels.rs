//! Channels: memory with several channels, ranks, refresh, turnaround from reads to writes, and
//! limits of activations.
//!
//! ```text
//! request ─►( split by channel and row )─► row open? ─ no ─►( bank: one row in row_cycles ─► rank: four rows in four_rows_cycles )─┐
//!                                           └─ yes ───────────────────────────────────────────────────────────────────────────────┴─►( bus )
//! ```
//! Time is counted without refreshes, as if memory slept through them; `awake` and `asleep` convert
//! between the two times. A refresh is at the end of each interval, and closes every row. The bus
//! keeps the gaps between its used cycles, as the single channel does.
//!
//! The bytes of a request in a channel are next to each other there. Those of one row are moved
//! together, and if the row was opened for them, all of them arrive after the latency of a closed
//! row. Where rows can only be opened at some times, a bank opens its next row when the transfers of
//! the row before have ended.
//!
//! Writes are gathered: a channel turns to writes and back once per batch, if anything was read
//! since the last batch.
//!
//! Laws: `more_channels_never_take_more_cycles`, `a_refresh_takes_its_share_of_the_time`,
//! `a_frame_with_channels_moves_the_same_bytes_in_about_the_time`.

use super::memory::{Direction, Free};
use crate::machine::timing::Memory as Description;
use std::collections::VecDeque;

/// An activation: the row, the number of refreshes before it, the cycle of its request, its own
/// cycle, and the end of the transfers that it was for.
#[derive(Clone, Copy, Debug)]
struct Opened {
    row: u64,
    refreshes: u64,
    requested: u64,
    since: u64,
    served: u64,
}

/// A bank: the open row and the scheduled ones, in order of time.
#[derive(Clone, Debug, Default)]
struct Bank(VecDeque<Opened>);

/// Number of scheduled rows of a bank that are searched for a request's row.
const ROWS: usize = 32;

impl Bank {
    /// The place and the cycle in which a request finds its row open, if it does. It is served
    /// before the bank opens another row.
    fn finds(&mut self, now: u64, row: u64, refreshes: u64) -> Option<(usize, u64)> {
        let Bank(rows) = self;
        while rows.get(1).is_some_and(|next| next.since <= now) || rows.len() > ROWS {
            rows.pop_front();
        }
        let found = rows
            .iter()
            .rposition(|opened| opened.row == row && opened.refreshes == refreshes)?;
        Some((found, rows[found].since.max(now)))
    }

    /// The first cycle from `now` on in which it can open a row: `row_cycles` after the row before,
    /// whose transfers have ended, and before the row behind. Rows of later requests, which were
    /// replayed earlier, do not delay it.
    fn free(&self, now: u64, row_cycles: u64) -> u64 {
        let Bank(rows) = self;
        let mut start = now;
        for opened in rows.iter().filter(|opened| opened.requested <= now) {
            if opened.since >= start + row_cycles && opened.since > start {
                break;
            }
            start = start.max(opened.since + row_cycles).max(opened.served);
        }
        start
    }

    /// Opens a row; returns its place.
    fn opens(&mut self, opened: Opened) -> usize {
        let Bank(rows) = self;
        let at = rows.partition_point(|other| other.since <= opened.since);
        rows.insert(at, opened);
        at
    }
}

/// Cycles of the activations of a rank, in order of time.
#[derive(Clone, Debug, Default)]
struct Activations(VecDeque<u64>);

impl Activations {
    /// Adds the first activation from `now` on that leaves at most four in any `window`; returns its
    /// cycle. None is before `forgotten` any more.
    fn take(&mut self, mut now: u64, window: u64, forgotten: u64) -> u64 {
        let Activations(cycles) = self;
        while cycles
            .pop_front_if(|cycle| *cycle + window <= forgotten)
            .is_some()
        {}
        loop {
            let at = cycles.partition_point(|cycle| *cycle <= now);
            let fourth = at.checked_sub(4).map_or(0, |first| cycles[first] + window);
            if fourth > now {
                now = fourth;
                continue;
            }
            // Those that are behind it and were added before keep their distance.
            let end = cycles.len().min(at + 4);
            let is_too_near = |nth: usize| {
                let fourth = match nth.checked_sub(3) {
                    Some(first) if first < at => cycles[first],
                    Some(_) => now,
                    None => return false,
                };
                cycles[nth] < fourth + window
            };
            if (at..end).any(is_too_near) {
                now = cycles[at];
                continue;
            }
            cycles.insert(at, now);
            return now;
        }
    }
}

#[derive(Clone, Debug)]
struct Channel {
    bus: Free,
    /// Rank by rank.
    banks: Box<[Bank]>,
    /// By rank.
    opened: Box<[Activations]>,
    /// Rank of the last transfer.
    rank: usize,
    /// Bursts of the current batch of writes, and whether anything was read since it began.
    written: u64,
    has_read: bool,
}

/// All channels.
#[derive(Clone, Debug)]
pub struct Channels {
    description: Description,
    channels: Box<[Channel]>,
    /// Capacity of the bus: units per cycle, and units per byte.
    units: [u64; 2],
    /// Cycles from one refresh to the next, and the awake cycles in between; both 0 without
    /// refresh.
    interval: u64,
    awake: u64,
    forgotten: u64,
}

/// Bytes in one row.
#[derive(Clone, Copy, Debug)]
struct RowBytes {
    channel: usize,
    row: u64,
    bytes: u64,
}

impl Channels {
    /// None if there is only one channel with open rows.
    pub fn new(description: Description) -> Option<Self> {
        let d = description;
        let refresh = d.refresh_interval_cycles.unwrap_or(0);
        if !d.has_channels() {
            return None;
        }
        let ranks = d.ranks.unwrap_or(1) as usize;
        let channel = Channel {
            bus: Free::default(),
            banks: vec![Bank::default(); d.banks as usize * ranks].into(),
            opened: vec![Activations::default(); ranks].into(),
            rank: 0,
            written: 0,
            has_read: false,
        };
        let permille = u64::from(d.bytes_per_cycle_permille.unwrap_or(0));
        let whole = u64::from(d.bytes_per_cycle);
        let interval = u64::from(refresh);
        Some(Channels {
            description,
            channels: vec![channel; d.channels() as usize].into(),
            units: if permille == 0 {
                [whole, 1]
            } else {
                [whole * 1000 + permille, 1000]
            },
            interval,
            awake: interval - u64::from(d.refresh_cycles.unwrap_or(0)).min(interval),
            forgotten: 0,
        })
    }

    /// Awake cycles before a cycle.
    fn awake(&self, cycle: u64) -> u64 {
        match cycle.checked_div(self.interval) {
            None => cycle,
            Some(refreshes) => refreshes * self.awake + (cycle % self.interval).min(self.awake),
        }
    }

    /// The cycle before which memory was awake for `awake` cycles.
    fn asleep(&self, awake: u64) -> u64 {
        if self.interval == 0 {
            awake
        } else {
            awake + awake.saturating_sub(1) / self.awake * (self.interval - self.awake)
        }
    }

    /// No later request is before this cycle.
    pub fn forget(&mut self, before: u64) {
        self.forgotten = self.awake(before);
        for channel in &mut self.channels {
            channel.bus.forget(self.forgotten * self.units[0]);
        }
    }

    /// Serves whole bursts from `from` to `end`: the arrival of the last one, and the number of
    /// bursts with an open row.
    pub fn serve(&mut self, now: u64, direction: Direction, from: u64, end: u64) -> [u64; 2] {
        let row_bytes = u64::from(self.description.row_bytes);
        let channels = self.channels.len() as u64;
        // Consecutive lines are in consecutive channels.
        let line_bytes = if channels == 1 {
            1 << 63
        } else {
            u64::from(self.description.interleave_bytes())
        };
        let last = (end - 1) / line_bytes;
        let [mut done, mut hits] = [now, 0];
        for first in (from / line_bytes..=last).take(channels as usize) {
            // The lines of a request in a channel are next to each other there.
            let of_line = |line: u64| line / channels * line_bytes;
            let last_here = last - (last - first) % channels;
            let mut own = of_line(first) + from.saturating_sub(first * line_bytes);
            let own_end = of_line(last_here) + line_bytes.min(end - last_here * line_bytes);
            while own < own_end {
                let to = own_end.min((own / row_bytes + 1) * row_bytes);
                let piece = RowBytes {
                    channel: (first % channels) as usize,
                    row: own / row_bytes,
                    bytes: to - own,
                };
                let [here, hit] = self.piece(now, direction, piece);
                (done, hits) = (done.max(here), hits + hit);
                own = to;
            }
        }
        [done, hits]
    }

    fn piece(
        &mut self,
        now: u64,
        direction: Direction,
        RowBytes {
            channel,
            row,
            bytes,
        }: RowBytes,
    ) -> [u64; 2] {
        let now = self.awake(now);
        let between = if self.interval == 0 {
            0
        } else {
            now / self.awake
        };
        let (d, [a_cycle, a_byte], forgotten) = (&self.description, self.units, self.forgotten);
        let cycles = |field: Option<u32>| u64::from(field.unwrap_or(0));
        let channel = &mut self.channels[channel];
        let nth = row as usize & (channel.banks.len() - 1);
        let rank = nth / d.banks as usize;
        let bank = &mut channel.banks[nth];
        let found = bank.finds(now, row, between);
        let is_open = found.is_some();
        let [row_cycles, four_rows] = [d.row_cycles, d.four_rows_cycles].map(cycles);
        let (place, start) = found.unwrap_or_else(|| {
            let mut start = now;
            if row_cycles > 0 || four_rows > 0 {
                start = bank.free(start, row_cycles);
            }
            if four_rows > 0 {
                start = channel.opened[rank].take(start, four_rows, forgotten);
            }
            let opened = Opened {
                row,
                refreshes: between,
                requested: now,
                since: start,
                served: start,
            };
            (bank.opens(opened), start)
        });
        let bursts = bytes / u64::from(d.burst_bytes);
        let mut still = 0;
        if rank != channel.rank {
            channel.rank = rank;
            still += cycles(d.rank_switch_cycles);
        }
        match direction {
            Direction::Read => channel.has_read = true,
            Direction::Write => {
                if channel.written == 0 && channel.has_read {
                    still += cycles(d.turnaround_cycles);
                    channel.has_read = false;
                }
                channel.written += bursts;
                if channel.written >= u64::from(d.write_batch.unwrap_or(1)) {
                    channel.written = 0;
                }
            }
        }
        let moved = channel
            .bus
            .take(start * a_cycle, still * a_cycle + bytes * a_byte)
            .div_ceil(a_cycle);
        let Bank(rows) = &mut channel.banks[nth];
        rows[place].served = rows[place].served.max(moved);
        let latency = if is_open {
            d.hit_latency
        } else {
            d.miss_latency
        };
        // After the first burst the row is open.
        [
            self.asleep(moved) + u64::from(latency),
            u64::from(is_open) + bursts - 1,
        ]
    }
}

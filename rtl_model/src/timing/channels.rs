//! Channels: memory with several channels, ranks, refresh, turnaround from reads to writes, and
//! limits of activations.
//!
//! ```text
//! request ─►( split by channel and row )─► row open? ─ no ─►( bank: one row in row_cycles ─► rank: four rows in four_rows_cycles )─┐
//!                                           └─ yes ───────────────────────────────────────────────────────────────────────────────┴─►( bus )
//! ```
//! Time is counted without refreshes, as if memory slept through them; `awake` and `asleep` convert
//! between the two times. A refresh is at the end of each interval, and closes every row. Bus, bank
//! and rank keep the gaps between their used cycles, as the single channel does.
//!
//! Writes are gathered: a channel turns to writes and back once per batch, if anything was read
//! since the last batch.
//!
//! Laws: `more_channels_never_take_more_cycles`, `a_refresh_takes_its_share_of_the_time`,
//! `a_frame_with_channels_moves_the_same_bytes_in_about_the_time`.

use super::memory::{Direction, Free};
use crate::machine::timing::Memory as Description;
use std::collections::VecDeque;

/// An activation: the row, the number of refreshes before it, and the cycle.
#[derive(Clone, Copy, Debug)]
struct Opened {
    row: u64,
    refreshes: u64,
    since: u64,
}

/// A bank.
#[derive(Clone, Debug, Default)]
struct Bank {
    /// The open row and the scheduled ones, in order of time.
    rows: VecDeque<Opened>,
    /// Cycles without an activation.
    free: Free,
}

/// Number of scheduled rows of a bank that are searched for a request's row.
const ROWS: usize = 32;

impl Bank {
    /// The cycle in which a request finds its row open, if it does. It is served before the bank
    /// opens another row.
    fn finds(&mut self, now: u64, row: u64, refreshes: u64) -> Option<u64> {
        while self.rows.get(1).is_some_and(|next| next.since <= now) || self.rows.len() > ROWS {
            self.rows.pop_front();
        }
        let found = self
            .rows
            .iter()
            .rev()
            .find(|opened| opened.row == row && opened.refreshes == refreshes);
        found.map(|opened| opened.since.max(now))
    }

    fn opens(&mut self, opened: Opened) {
        let at = self
            .rows
            .partition_point(|other| other.since <= opened.since);
        self.rows.insert(at, opened);
    }
}

#[derive(Clone, Debug)]
struct Channel {
    bus: Free,
    /// Rank by rank.
    banks: Box<[Bank]>,
    /// By rank, quarters of the window in which four rows can be opened.
    opened: Box<[Free]>,
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
            opened: vec![Free::default(); ranks].into(),
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
    pub fn serve(&mut self, now: u64, direction: Direction, mut from: u64, end: u64) -> [u64; 2] {
        let interleave = u64::from(self.description.interleave_bytes());
        let row_bytes = u64::from(self.description.row_bytes);
        let channels = self.channels.len() as u64;
        let [mut done, mut hits] = [now, 0];
        while from < end {
            let (line, within) = (from / interleave, from % interleave);
            let own = line / channels * interleave + within;
            let of_line = if channels == 1 {
                u64::MAX
            } else {
                interleave - within
            };
            let bytes = (end - from).min(of_line).min(row_bytes - own % row_bytes);
            let piece = RowBytes {
                channel: (line % channels) as usize,
                row: own / row_bytes,
                bytes,
            };
            let [here, hit] = self.piece(now, direction, piece);
            (done, hits) = (done.max(here), hits + hit);
            from += bytes;
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
        let start = found.unwrap_or_else(|| {
            let mut start = now;
            if d.row_cycles.is_some_and(|cycles| cycles > 0) {
                bank.free.forget(forgotten);
                start = bank.free.take_whole(start, cycles(d.row_cycles));
            }
            if d.four_rows_cycles.is_some_and(|cycles| cycles > 0) {
                let opened = &mut channel.opened[rank];
                opened.forget(4 * forgotten);
                let quarter = opened.take_whole(4 * start, cycles(d.four_rows_cycles));
                // The next three activations can follow at once; after them, one per quarter of the
                // window.
                start = start.max(
                    quarter
                        .saturating_sub(3 * cycles(d.four_rows_cycles))
                        .div_ceil(4),
                );
            }
            bank.opens(Opened {
                row,
                refreshes: between,
                since: start,
            });
            start
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

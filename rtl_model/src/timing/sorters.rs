//! Sorters: sorts tiles' lists one by one, between the passes of a binned machine or beside the
//! second one.
//!
//! ```text
//! lists of entries with keys ─► load ─► sort, an entry per cycle ─► store ─► lists of indices
//!                            ▲                                       │
//!                            └──── chunks, buckets, in memory ◄──────┘
//! ```
//! A list is a chain of *jobs*. A job loads entries, processes them and stores them:
//!
//! - *Sort*: up to `buffer_entries` entries. The network takes `network` entries per cycle, and
//!   returns runs of that length after its latency. Each merge pass then takes one cycle per entry:
//!   ⌈log2 ⌈n/network⌉⌉ passes.
//! - *Merge*: half a buffer of entries of two sorted chunks in memory, one cycle per entry, so that
//!   the other half is loaded at the same time. A list of c chunks takes ⌈log2 c⌉ passes.
//! - *Distribute*: half a buffer of entries, one cycle per entry, to buckets in memory. Each bucket
//!   gathers a burst; the remaining ones are stored with the last entries.
//!
//! A list that is kept from frame to frame consists of stored entries and of new ones. New entries
//! are sorted as above, and stay in a buffer of their own if they have room in it. A job of a chunk
//! of stored entries is a *sort* whose last pass takes one cycle per entry, and one per new entry
//! that is merged into it.
//!
//! A job is loaded when the sorter has room: after the network has taken the previous job, or at
//! once if half a buffer is free. It begins when it is loaded and the previous job has ended. Its
//! last pass goes to the buffer that is stored, so it stalls for the previous store. A pass over
//! memory reads only what has been written before. Entries in their final order are stored
//! without their keys: 4 bytes, and the mask.
//!
//! With `timing.sort.overlap`, tiles are drawn meanwhile: an engine takes a tile when its list is
//! sorted and written. Lists are then sorted in the order in which tiles are drawn.
//!
//! Each sorter takes the next list; if several are free, the first one does. Requests are in order
//! of time; those of one cycle are in the order of sorters, stores first.
//!
//! Laws: `sorters_tick_as_they_are_replayed`, `a_list_that_fits_the_buffer_takes_its_formula`.

use super::account::{Detail, Ready, Unit};
use super::binned::{Lists, list_address};
use super::memory::{Direction, Memory, Requester};
use crate::elaboration::microarchitecture::{Microarchitecture, Pace, SortShape};
use crate::elaboration::sorter::SorterShape;
use crate::elaboration::unit;
use crate::work::{MergedLists, Work};
use std::collections::VecDeque;
use std::ops::Range;

/// Distance between lists of entries with keys, and between lists in sorted chunks.
const KEYED_BYTES: u64 = 1 << 28;
/// Address of the lists of the first pass.
pub const KEYED: u64 = 1 << 60;
/// Addresses of chunks, which alternate between the two.
const CHUNKS: [u64; 2] = [KEYED + (1 << 54), KEYED + (2 << 54)];
/// Addresses of the lists with keys that are kept from frame to frame: of the frame before, and of
/// this one.
const KEPT: [u64; 2] = [KEYED + (4 << 54), KEYED + (5 << 54)];
/// Address of the buckets.
const BUCKETS: u64 = KEYED + (3 << 54);
/// Distance between the buckets of two sorters.
const BUCKETS_BYTES: u64 = 1 << 42;

/// Address of the unsorted list of a tile.
pub fn keyed(t: &Microarchitecture, tile: usize) -> u64 {
    KEYED + tile as u64 * t.timing.memory.list_stride(KEYED_BYTES)
}

/// Address of the kept list of a tile, for the next frame.
pub fn kept(t: &Microarchitecture, tile: usize) -> u64 {
    KEPT[1] + tile as u64 * t.timing.memory.list_stride(KEYED_BYTES)
}

/// Work of a sorter between a load and a store.
#[derive(Clone, Debug)]
struct SortJob {
    /// First byte and number of bytes; and those of sorted new entries, if they are in memory.
    load: [u64; 2],
    also: [u64; 2],
    /// It loads what the previous jobs stored.
    follows: bool,
    /// Cycles from its start until the next one can be loaded.
    taken: u64,
    /// Its cycles.
    work: u64,
    /// Cycles of its last pass.
    last_pass: u64,
    stores: Vec<[u64; 2]>,
    /// The tile whose list is sorted with it.
    ends: Option<usize>,
}

/// A list, or a bucket of it, to be sorted.
#[derive(Clone, Copy)]
struct ListPart {
    /// Address of its entries.
    from: u64,
    entries: u64,
    /// Entries of the list before it.
    before: u64,
    /// It was stored by the previous jobs.
    follows: bool,
}

/// Where sorted entries are stored.
#[derive(Clone, Copy, PartialEq, Eq)]
enum SortedTo {
    /// In the list of the tile, without their keys.
    List,
    /// In memory, with their keys.
    Chunks,
    /// Nowhere: they stay on the chip.
    Buffer,
}

/// Makes jobs from lists.
struct Plan<'a> {
    t: &'a Microarchitecture,
    /// Distance between lists with keys, chunks of lists, and buckets.
    stride: u64,
    shape: SortShape,
    sorter: SorterShape,
    burst: u64,
    /// Bytes of an entry without its key.
    sorted_bytes: u64,
    work: &'a Work,
    lists: &'a Lists,
}

impl Plan<'_> {
    /// Jobs of the list of a tile, on one of the sorters.
    fn jobs(&self, tile: usize, sorter: u64) -> VecDeque<SortJob> {
        if let Some(lists) = self.work.lists.as_ref().filter(|_| self.lists.are_kept()) {
            return self.kept_jobs(tile, lists);
        }
        let list = self.lists.of(tile);
        let entries = list.len() as u64;
        let mut jobs = VecDeque::new();
        let whole = ListPart {
            from: keyed(self.t, tile),
            entries,
            before: 0,
            follows: false,
        };
        match self.sorter.bucket_bits {
            Some(bits) if entries > u64::from(self.sorter.buffer_entries) => {
                let sizes = self.distribute(tile, bits, sorter, &mut jobs);
                let mut before = 0;
                for (bucket, entries) in sizes
                    .into_iter()
                    .enumerate()
                    .filter(|(_, entries)| *entries > 0)
                {
                    let from = self.bucket(sorter, bucket);
                    self.sort(
                        tile,
                        ListPart {
                            from,
                            entries,
                            before,
                            follows: before == 0,
                        },
                        entries + before == whole.entries,
                        &mut jobs,
                    );
                    before += entries;
                }
            }
            _ => self.sort(tile, whole, true, &mut jobs),
        }
        if let Some(last) = jobs.back_mut() {
            last.ends = Some(tile);
        }
        jobs
    }

    /// Jobs of a kept list. New entries are sorted first. They stay in a buffer of their own if they
    /// have room in it; if not, they are in memory, and each chunk loads its share of them. The
    /// last pass of each chunk of stored entries is merged with the new entries that come before its
    /// end.
    fn kept_jobs(&self, tile: usize, lists: &MergedLists) -> VecDeque<SortJob> {
        let mut jobs = VecDeque::new();
        let list = &lists.tiles[tile];
        let stored = list.stored();
        let new = (list.new.len() - stored) as u64;
        let whole = ListPart {
            from: keyed(self.t, tile),
            entries: new,
            before: 0,
            follows: false,
        };
        let is_alone = stored == 0;
        let in_memory = new > u64::from(self.sorter.buffer_entries);
        if new > 0 {
            let to = if is_alone {
                SortedTo::List
            } else if in_memory {
                SortedTo::Chunks
            } else {
                SortedTo::Buffer
            };
            self.sort_to(to, tile, whole, true, &mut jobs);
        }
        let sorted_new = self.chunks(self.passes(new), tile);
        let (mut first, mut before, mut merged) = (0, 0, 0);
        let mut entries = list.new.iter();
        for chunk in lists.chunks(stored) {
            // New entries in front of the last stored entry of the chunk.
            let (mut left, mut own) = (chunk, 0);
            while left > 0 {
                match entries.next() {
                    Some(false) => left -= 1,
                    Some(true) => own += 1,
                    None => break,
                }
            }
            let is_end = first + chunk == stored;
            if is_end {
                own += entries.by_ref().filter(|new| **new).count() as u64;
            }
            let n = chunk as u64;
            let fed = n.div_ceil(self.sorter.network.into());
            let merges = u64::from(fed.next_power_of_two().ilog2());
            let last_pass = n + own;
            let base = KEPT[0] + tile as u64 * self.stride;
            jobs.push_back(SortJob {
                load: self.bytes(base, first as u64, n),
                also: if in_memory {
                    self.bytes(sorted_new, merged, own)
                } else {
                    [0; 2]
                },
                follows: in_memory && first == 0,
                taken: fed,
                work: fed
                    + u64::from(self.sorter.network_latency)
                    + merges.saturating_sub(1) * n
                    + last_pass,
                last_pass,
                stores: self
                    .full(
                        list_address(self.t, tile),
                        before,
                        last_pass,
                        self.sorted_bytes,
                        is_end,
                    )
                    .into_iter()
                    .collect(),
                ends: None,
            });
            (first, before, merged) = (first + chunk, before + last_pass, merged + own);
        }
        if let Some(last) = jobs.back_mut() {
            last.ends = Some(tile);
        }
        jobs
    }

    /// Passes that merge the sorted chunks of this number of entries.
    fn passes(&self, entries: u64) -> usize {
        let chunks = entries.div_ceil(self.sorter.buffer_entries.into());
        chunks.next_power_of_two().ilog2() as usize
    }

    /// Address of a bucket.
    fn bucket(&self, sorter: u64, bucket: usize) -> u64 {
        BUCKETS + sorter * BUCKETS_BYTES + bucket as u64 * self.stride
    }

    /// Address of the chunks of a list, before or after a pass.
    fn chunks(&self, pass: usize, tile: usize) -> u64 {
        CHUNKS[pass % 2] + tile as u64 * self.stride
    }

    /// Distributes a list to buckets; returns the number of entries of each.
    fn distribute(
        &self,
        tile: usize,
        bits: u32,
        sorter: u64,
        jobs: &mut VecDeque<SortJob>,
    ) -> Vec<u64> {
        // In input order, as written by the first pass.
        let mut list = self.lists.of(tile).to_vec();
        list.sort_unstable();
        // Number of keys per bucket.
        let of_bucket = 1 << (self.sorter.key_bits - bits);
        let of = |nth: u32| {
            self.work
                .keys
                .get(nth as usize)
                .map_or(0, |key| (u64::from(*key) / of_bucket) as usize)
        };
        let mut sizes = vec![0; 1 << bits];
        let halves = list.chunks(self.half() as usize);
        let last = halves.len() - 1;
        let mut loaded = 0;
        for (nth, half) in halves.enumerate() {
            let mut stores = Vec::new();
            for entry in half {
                let bucket = of(*entry).min(sizes.len() - 1);
                stores.extend(self.full(
                    self.bucket(sorter, bucket),
                    sizes[bucket],
                    1,
                    self.entry_bytes(),
                    false,
                ));
                sizes[bucket] += 1;
            }
            if nth == last {
                let left = |(bucket, entries): (usize, &u64)| {
                    self.full(
                        self.bucket(sorter, bucket),
                        *entries,
                        0,
                        self.entry_bytes(),
                        true,
                    )
                };
                stores.extend(sizes.iter().enumerate().flat_map(left));
            }
            let load = self.bytes(keyed(self.t, tile), loaded, half.len() as u64);
            loaded += half.len() as u64;
            jobs.push_back(SortJob::streamed(
                load,
                false,
                half.len() as u64,
                nth == last,
                stores,
            ));
        }
        sizes
    }

    /// Sorts a part of a list. If it is the last part, the rest of the last burst is stored too.
    fn sort(&self, tile: usize, part: ListPart, is_last: bool, jobs: &mut VecDeque<SortJob>) {
        self.sort_to(SortedTo::List, tile, part, is_last, jobs);
    }

    /// [`Plan::sort`], to where the sorted entries are needed.
    fn sort_to(
        &self,
        to: SortedTo,
        tile: usize,
        part: ListPart,
        is_last: bool,
        jobs: &mut VecDeque<SortJob>,
    ) {
        let sorted = list_address(self.t, tile);
        let SorterShape {
            buffer_entries,
            network,
            network_latency,
            ..
        } = self.sorter;
        let ListPart {
            from,
            entries,
            before,
            follows,
        } = part;
        let buffer = u64::from(buffer_entries);
        let passes = self.passes(entries);
        let chunk = |first: u64| buffer.min(entries - first);
        for first in (0..entries).step_by(buffer_entries as usize) {
            let n = chunk(first);
            let fed = n.div_ceil(network.into());
            let merges = u64::from(fed.next_power_of_two().ilog2());
            let is_end = first + n == entries;
            let stores = match passes {
                0 if to == SortedTo::Buffer => None,
                0 => self.full(
                    sorted,
                    before + first,
                    n,
                    self.sorted_bytes,
                    is_last && is_end,
                ),
                _ => self.full(self.chunks(0, tile), first, n, self.entry_bytes(), is_end),
            };
            jobs.push_back(SortJob {
                load: self.bytes(from, first, n),
                also: [0; 2],
                follows: follows && first == 0,
                taken: fed,
                work: fed + u64::from(network_latency) + merges * n,
                last_pass: if merges > 0 { n } else { fed },
                stores: stores.into_iter().collect(),
                ends: None,
            });
        }
        for pass in 0..passes {
            let is_last_pass = pass + 1 == passes && to == SortedTo::List;
            for first in (0..entries).step_by(self.half() as usize) {
                let n = self.half().min(entries - first);
                let is_end = first + n == entries;
                let stores = if is_last_pass {
                    self.full(
                        sorted,
                        before + first,
                        n,
                        self.sorted_bytes,
                        is_last && is_end,
                    )
                } else {
                    self.full(
                        self.chunks(pass + 1, tile),
                        first,
                        n,
                        self.entry_bytes(),
                        is_end,
                    )
                };
                let load = self.bytes(self.chunks(pass, tile), first, n);
                jobs.push_back(SortJob::streamed(
                    load,
                    first == 0,
                    n,
                    is_end,
                    stores.into_iter().collect(),
                ));
            }
        }
    }

    /// Entries that are merged or distributed at a time.
    fn half(&self) -> u64 {
        u64::from(self.sorter.buffer_entries / 2)
    }

    fn entry_bytes(&self) -> u64 {
        self.shape.entry_bytes.into()
    }

    /// First byte and number of bytes of `entries` entries from `first` on.
    fn bytes(&self, list: u64, first: u64, entries: u64) -> [u64; 2] {
        [
            list + first * self.entry_bytes(),
            entries * self.entry_bytes(),
        ]
    }

    /// Bursts of a list that are completed by `entries` entries behind others; the last ones
    /// include the rest.
    fn full(
        &self,
        list: u64,
        before: u64,
        entries: u64,
        entry_bytes: u64,
        is_end: bool,
    ) -> Option<[u64; 2]> {
        let end = (before + entries) * entry_bytes;
        let Range { start, end } = before * entry_bytes / self.burst..if is_end {
            end.div_ceil(self.burst)
        } else {
            end / self.burst
        };
        (start < end).then(|| [list + start * self.burst, (end - start) * self.burst])
    }
}

impl SortJob {
    /// A job of one entry per cycle. Half a buffer is then free for the next job, unless it is of
    /// another kind.
    fn streamed(
        load: [u64; 2],
        follows: bool,
        entries: u64,
        is_end: bool,
        stores: Vec<[u64; 2]>,
    ) -> Self {
        SortJob {
            load,
            also: [0; 2],
            follows,
            taken: if is_end { entries } else { 0 },
            work: entries,
            last_pass: entries,
            stores,
            ends: None,
        }
    }
}

/// State of a sorter.
struct Sorter {
    unit: Unit,
    /// Jobs of its list that are not loaded yet, and the cycle from which the next one can be
    /// loaded.
    jobs: VecDeque<SortJob>,
    free: u64,
    /// The loaded job, which stalls for the previous store, and its start.
    loaded: Option<(SortJob, u64)>,
    /// The current job, and the cycle of its store.
    stores: Option<(SortJob, u64)>,
    /// The end of the last job, and of all stores.
    ended: u64,
    written: u64,
}

impl Sorter {
    fn new(from: u64, nth: u32, t: &Microarchitecture, detail: Detail) -> Self {
        let one = Pace {
            units: 1,
            latency: 1,
            interval: 1,
            fifo: 1,
        };
        let unit = Unit::new(
            unit::SORT,
            one,
            [Some("bin"), Some("list")],
            detail,
            t.lifted,
        )
        .behind_others(nth);
        Sorter {
            unit,
            jobs: VecDeque::new(),
            free: from,
            loaded: None,
            stores: None,
            ended: from,
            written: from,
        }
    }

    /// The cycle of its next request, and whether that is a load; none if there is none.
    fn next(&self, are_lists_left: bool) -> Option<(u64, bool)> {
        let follows = self.jobs.front().is_some_and(|job| job.follows);
        let can_load = self.loaded.is_none()
            && (are_lists_left || !self.jobs.is_empty())
            && !(follows && self.stores.is_some());
        let load = can_load.then_some((
            if follows {
                self.free.max(self.written)
            } else {
                self.free
            },
            true,
        ));
        let store = self.stores.as_ref().map(|(_, when)| (*when, false));
        load.into_iter().chain(store).min()
    }

    /// Loads the next job.
    fn load(&mut self, now: u64, from: u64, memory: &mut Memory) {
        let Some(mut job) = self.jobs.pop_front() else {
            return;
        };
        if self.unit.is_lifted() {
            (job.taken, job.work, job.last_pass) = (0, 0, 0);
        }
        let mut here = now;
        for [address, bytes] in [job.load, job.also] {
            if bytes > 0 {
                let read = memory.request(now, Requester::Sort, Direction::Read, address, bytes);
                here = here.max(read);
            }
        }
        let before = self.stores.as_ref().map_or(self.ended, |(_, when)| *when);
        let begins = here.max(before);
        self.free = begins + job.taken;
        self.loaded = Some((job, begins));
        if self.stores.is_none() {
            self.begin(from);
        }
    }

    /// Begins the loaded job, if any.
    fn begin(&mut self, from: u64) {
        let Some((job, begins)) = self.loaded.take() else {
            return;
        };
        let ends = (begins + job.work).max(self.written + job.last_pass);
        self.unit.take_with_memory(
            Ready {
                here: from,
                memory: begins,
                ..Ready::default()
            },
            job.work,
            ends - begins,
        );
        self.stores = Some((job, ends));
    }

    /// Stores the result of the current job; returns the tile whose list is then sorted.
    fn store(&mut self, from: u64, memory: &mut Memory) -> Option<usize> {
        let (job, now) = self.stores.take()?;
        self.ended = now;
        self.written = self.written.max(now);
        for [address, bytes] in job.stores {
            self.written = self.written.max(memory.request(
                now,
                Requester::Sort,
                Direction::Write,
                address,
                bytes,
            ));
        }
        self.begin(from);
        job.ends
    }
}

/// Its cycle, whether it is a load, and the sorter that sends it.
type NextRequest = (u64, bool, usize);

/// The sorters of a machine, and the lists that they sort.
pub struct Sorters<'a> {
    plan: Plan<'a>,
    /// First cycle.
    from: u64,
    /// Tiles whose lists no sorter has taken.
    queue: VecDeque<usize>,
    sorters: Vec<Sorter>,
    /// Cycle from which the list of each tile is sorted and written.
    sorted: Vec<Option<u64>>,
}

impl<'a> Sorters<'a> {
    /// Sorters that begin in a cycle, with the lists of these tiles in this order; none if the
    /// machine has none.
    pub fn new(
        t: &'a Microarchitecture,
        work: &'a Work,
        lists: &'a Lists,
        tiles: impl Iterator<Item = usize>,
        from: u64,
        detail: Detail,
    ) -> Option<Self> {
        let shape = t.sort?;
        let sorter = shape.sorter?;
        let plan = Plan {
            t,
            stride: t.timing.memory.list_stride(KEYED_BYTES),
            shape,
            sorter,
            burst: t.timing.memory.burst_bytes.into(),
            sorted_bytes: t.entry_bytes().into(),
            work,
            lists,
        };
        Some(Sorters {
            plan,
            from,
            queue: tiles.collect(),
            sorters: (0..sorter.units)
                .map(|nth| Sorter::new(from, nth, t, detail))
                .collect(),
            sorted: vec![None; lists.tiles()],
        })
    }

    /// The next request: stores first.
    pub fn next(&self) -> Option<NextRequest> {
        let are_left = !self.queue.is_empty();
        (self.sorters.iter().enumerate())
            .filter_map(|(nth, sorter)| sorter.next(are_left).map(|(when, load)| (when, load, nth)))
            .min()
    }

    /// Sends the next request.
    pub fn step(&mut self, (now, is_load, nth): NextRequest, memory: &mut Memory) {
        let sorter = &mut self.sorters[nth];
        if !is_load {
            if let Some(tile) = sorter.store(self.from, memory) {
                self.sorted[tile] = Some(sorter.written);
            }
            return;
        }
        if sorter.jobs.is_empty() {
            let tile = self.queue.pop_front();
            sorter.jobs = tile.map_or_else(VecDeque::new, |tile| self.plan.jobs(tile, nth as u64));
        }
        sorter.load(now, self.from, memory);
    }

    /// The cycle from which the list of a tile is sorted, if its last request was sent.
    pub fn sorted(&self, tile: usize) -> Option<u64> {
        self.sorted[tile]
    }

    /// The units, and the cycle in which all lists are sorted.
    pub fn end(self) -> (Vec<Unit>, u64) {
        let written = self.sorters.iter().map(|sorter| sorter.written).max();
        let units = self.sorters.into_iter().map(|sorter| sorter.unit).collect();
        (units, written.unwrap_or(self.from))
    }
}

/// Sorts every list in the order of the picture, from a cycle on; returns the units, and the cycle
/// in which all lists are sorted.
pub fn sort_lists(
    t: &Microarchitecture,
    work: &Work,
    lists: &Lists,
    from: u64,
    memory: &mut Memory,
    detail: Detail,
) -> Option<(Vec<Unit>, u64)> {
    let tiles = (0..lists.tiles()).filter(|tile| !lists.of(*tile).is_empty());
    let mut sorters = Sorters::new(t, work, lists, tiles, from, detail)?;
    while let Some(next) = sorters.next() {
        memory.forget(next.0);
        sorters.step(next, memory);
    }
    let (units, sorted) = sorters.end();
    memory.forget(sorted);
    Some((units, sorted))
}

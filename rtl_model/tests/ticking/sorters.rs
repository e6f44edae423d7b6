//! What do sorters do in each cycle? Each sorts one tile's list after the other.
//!
//! A sorter has a buffer of entries. Its network takes `network` entries per cycle and has a
//! latency of one cycle per stage. Then runs are merged in pairs, one entry per cycle, until one
//! run is left. Longer lists are sorted one buffer after the other and merged in memory, half a
//! buffer at a time; or they are distributed to buckets first. Stored entries go through a separate
//! buffer, into which the last pass writes. The last pass stalls until everything before has been
//! written.

use super::memory::{Done, LIST_BYTES, LISTS, Memory, Requests, apart};
use super::parts::TickedUnit;
use rtl_model::elaboration::microarchitecture::SortShape;
use rtl_model::elaboration::sorter::SorterShape;
use rtl_model::machine::timing::Memory as Description;
use rtl_model::timing::{Direction, Requester};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::ops::Range;

/// Address regions: lists with keys, at this distance; then two regions for merged lists, then the
/// buckets of each sorter.
const KEYED: u64 = 1 << 60;
const APART: u64 = 1 << 28;
const PLACES: u64 = 1 << 54;
const OF_SORTER: u64 = 1 << 42;

/// First address of a tile's list.
pub fn keyed(memory: &Description, tile: u64) -> u64 {
    KEYED + apart(memory, APART) * tile
}

/// Writes consecutive entries to memory, in full bursts.
struct WriteStream {
    base: u64,
    bytes: u64,
    burst: u64,
    gone: u64,
}

impl WriteStream {
    fn new(base: u64, burst: u64) -> Self {
        WriteStream {
            base,
            bytes: 0,
            burst,
            gone: 0,
        }
    }

    fn push(&mut self, bytes: u64) {
        self.bytes += bytes;
    }

    /// Full bursts that have not been sent; finally all bytes.
    fn take(&mut self, all: bool) -> Option<Range<u64>> {
        let mut until = self.gone;
        while until + self.burst <= self.bytes || all && until < self.bytes {
            until += self.burst;
        }
        let from = std::mem::replace(&mut self.gone, until);
        (until > from).then(|| self.base + from..self.base + until)
    }
}

/// Unit of loading, sorting and storing.
struct Piece {
    load: Range<u64>,
    /// Sorted new entries in memory that are merged with the loaded ones.
    also: Range<u64>,
    /// All stores before must be written before it is loaded.
    is_stored_before: bool,
    /// Cycles until the next piece can be loaded; cycles before the last pass; cycles of the last
    /// pass.
    room_after: u64,
    before: u64,
    last: u64,
    stores: Vec<Range<u64>>,
    /// The tile whose list it completes.
    completes: Option<u64>,
}

struct Sorter {
    pieces: VecDeque<Piece>,
    /// First cycle with room to load, and the piece in flight or loaded.
    room: u64,
    loaded: Option<([Done; 2], Piece)>,
    working: Option<Piece>,
    stored: Requests,
    /// The tile whose list is complete once everything is stored.
    completing: Option<u64>,
}

/// All sorters, and the lists that none has taken: each a tile and its keys in the order in which
/// they were written.
pub struct Sorters {
    shape: SortShape,
    sorter: SorterShape,
    burst: u64,
    memory: Description,
    /// Bytes of an entry without its key.
    stored_bytes: u64,
    sorters: Vec<Sorter>,
    pub units: Vec<TickedUnit>,
    lists: VecDeque<(u64, Vec<u32>)>,
    begun: bool,
    /// Tiles whose lists are in memory.
    pub complete: BTreeSet<u64>,
    /// Whether each entry of a tile's list is new, and whether the first chunk of the others is half
    /// as long; none if lists are not kept.
    pub kept: Option<(bool, BTreeMap<u64, Vec<bool>>)>,
}

/// First address of a tile's list that was kept from the frame before, and of the one for the next
/// frame.
pub fn kept(memory: &Description, tile: u64, is_next: bool) -> u64 {
    KEYED + (4 + u64::from(is_next)) * PLACES + apart(memory, APART) * tile
}

impl Sorters {
    pub fn new(
        shape: SortShape,
        memory: Description,
        stored_bytes: u64,
        lists: Vec<(u64, Vec<u32>)>,
    ) -> Option<Self> {
        let sorter = shape.sorter?;
        let one = || Sorter {
            pieces: VecDeque::new(),
            room: 0,
            loaded: None,
            working: None,
            stored: Requests::new(u32::MAX),
            completing: None,
        };
        Some(Sorters {
            shape,
            sorter,
            burst: memory.burst_bytes.into(),
            memory,
            stored_bytes,
            sorters: (0..sorter.units).map(|_| one()).collect(),
            units: TickedUnit::each("sort", sorter.units),
            lists: lists.into(),
            begun: false,
            complete: BTreeSet::new(),
            kept: None,
        })
    }

    /// Whether tiles are drawn meanwhile.
    pub fn overlap(&self) -> bool {
        self.sorter.overlap
    }

    /// A cycle before all lists are written.
    pub fn idle(&mut self, now: u64) {
        self.units
            .iter_mut()
            .for_each(|unit| unit.count(now, super::parts::Act::Starve));
    }

    /// A later cycle; returns whether all lists are sorted.
    pub fn tick(&mut self, now: u64, memory: &mut Memory) -> bool {
        if !std::mem::replace(&mut self.begun, true) {
            self.sorters.iter_mut().for_each(|sorter| sorter.room = now);
        }
        for sorter in &mut self.sorters {
            if let Some(piece) = sorter
                .working
                .take_if(|piece| piece.before + piece.last == 0)
            {
                sorter.completing = piece.completes.or(sorter.completing);
                for bytes in piece.stores {
                    memory.request(
                        now,
                        Requester::Sort,
                        Direction::Write,
                        bytes,
                        &sorter.stored.next(),
                    );
                }
            }
        }
        for nth in 0..self.sorters.len() {
            self.begin(nth, now);
            self.load(nth, now, memory);
            self.work(nth, now);
        }
        // The last pass of the next list waits until these are written.
        for sorter in &mut self.sorters {
            if sorter.completing.is_some() && sorter.stored.are_all_done(now) {
                self.complete.extend(sorter.completing.take());
            }
        }
        self.lists.is_empty() && self.sorters.iter_mut().all(|sorter| sorter.is_done(now))
    }

    fn begin(&mut self, nth: usize, now: u64) {
        let (sorter, unit) = (&mut self.sorters[nth], &mut self.units[nth]);
        if sorter.working.is_some() {
            return;
        }
        if let Some((_, piece)) = sorter
            .loaded
            .take_if(|(here, _)| here.iter().all(|here| here.is_done(now)))
        {
            sorter.room = now + piece.room_after;
            sorter.working = Some(piece);
            unit.instances[0].items += 1;
            unit.log.push(now);
        }
    }

    fn load(&mut self, nth: usize, now: u64, memory: &mut Memory) {
        if self.sorters[nth].loaded.is_some() || self.sorters[nth].room > now {
            return;
        }
        if self.sorters[nth].pieces.is_empty()
            && let Some((tile, keys)) = self.lists.pop_front()
        {
            self.sorters[nth].pieces = self.plan(tile, &keys, nth as u64);
        }
        let sorter = &mut self.sorters[nth];
        let may_load = |piece: &Piece, is_quiet: bool| !piece.is_stored_before || is_quiet;
        let is_quiet = sorter.working.is_none() && sorter.stored.are_all_done(now);
        if let Some(piece) = sorter
            .pieces
            .pop_front_if(|piece| may_load(piece, is_quiet))
        {
            sorter.loaded = Some((read(now, &piece, memory), piece));
        }
    }

    fn work(&mut self, nth: usize, now: u64) {
        let sorter = &mut self.sorters[nth];
        let account = &mut self.units[nth].instances[0].account;
        let has_more = sorter.loaded.is_some() || !sorter.pieces.is_empty();
        let Some(piece) = &mut sorter.working else {
            if has_more {
                account.memory += 1;
            } else {
                account.starved += 1;
            }
            return;
        };
        // Once the last pass has begun nothing else is stored.
        if piece.before > 0 {
            piece.before -= 1;
        } else if sorter.stored.are_all_done(now) {
            piece.last -= 1;
        } else {
            account.memory += 1;
            return;
        }
        account.busy += 1;
    }

    fn entry(&self) -> u64 {
        self.shape.entry_bytes.into()
    }

    fn plan(&self, tile: u64, keys: &[u32], sorter: u64) -> VecDeque<Piece> {
        if let Some((is_odd, lists)) = &self.kept {
            return self.plan_kept(tile, &lists[&tile], *is_odd);
        }
        let mut pieces = VecDeque::new();
        let mut numbers =
            WriteStream::new(LISTS + apart(&self.memory, LIST_BYTES) * tile, self.burst);
        let limit = self.sorter.buffer_entries as usize;
        match self.sorter.bucket_bits {
            Some(bits) if keys.len() > limit => {
                let place = |bucket: u64| {
                    KEYED + 3 * PLACES + OF_SORTER * sorter + apart(&self.memory, APART) * bucket
                };
                let mut buckets: Vec<WriteStream> = (0..1 << bits)
                    .map(|bucket| WriteStream::new(place(bucket), self.burst))
                    .collect();
                let mut loaded = keyed(&self.memory, tile);
                for (nth, some) in keys.chunks(limit / 2).enumerate() {
                    let is_last = nth == (keys.len() - 1) / (limit / 2);
                    let mut stores = Vec::new();
                    for key in some {
                        let bucket = &mut buckets[(key >> (self.sorter.key_bits - bits)) as usize];
                        bucket.push(self.entry());
                        stores.extend(bucket.take(false));
                    }
                    if is_last {
                        stores.extend(buckets.iter_mut().filter_map(|bucket| bucket.take(true)));
                    }
                    let to = loaded + some.len() as u64 * self.entry();
                    pieces.push_back(streaming(loaded..to, some.len(), is_last, stores));
                    loaded = to;
                }
                let full: Vec<WriteStream> = buckets
                    .into_iter()
                    .filter(|bucket| bucket.bytes > 0)
                    .collect();
                for (nth, bucket) in full.iter().enumerate() {
                    let first = pieces.len();
                    self.sort(
                        tile,
                        bucket.base,
                        (bucket.bytes / self.entry()) as usize,
                        &mut numbers,
                        nth + 1 == full.len(),
                        &mut pieces,
                    );
                    pieces[first].is_stored_before = nth == 0;
                }
            }
            _ => self.sort(
                tile,
                keyed(&self.memory, tile),
                keys.len(),
                &mut numbers,
                true,
                &mut pieces,
            ),
        }
        if let Some(piece) = pieces.back_mut() {
            piece.completes = Some(tile);
        }
        pieces
    }

    /// Sorts the new entries of a kept list, and then its stored entries chunk by chunk. Each chunk's
    /// last pass has a cycle for each of its entries, and for each new entry that comes before the
    /// end of the chunk.
    fn plan_kept(&self, tile: u64, list: &[bool], is_odd: bool) -> VecDeque<Piece> {
        let mut pieces = VecDeque::new();
        let mut numbers =
            WriteStream::new(LISTS + apart(&self.memory, LIST_BYTES) * tile, self.burst);
        let limit = self.sorter.buffer_entries as usize;
        let new = list.iter().filter(|new| **new).count();
        let is_first = new == list.len();
        let base = keyed(&self.memory, tile);
        if new > 0 {
            self.sort(tile, base, new, &mut numbers, true, &mut pieces);
        }
        let is_long = new > limit;
        let mut merged = 0;
        if !is_first {
            // The result of the last round has keys, or stays on the chip.
            let mut rounds = 0;
            while limit << rounds < new {
                rounds += 1;
            }
            let region = KEYED + (1 + rounds % 2) * PLACES + apart(&self.memory, APART) * tile;
            let mut result = WriteStream::new(region, self.burst);
            let first = pieces.len()
                - if is_long {
                    new.div_ceil(limit / 2)
                } else {
                    pieces.len()
                };
            let last = pieces.len();
            for (nth, piece) in pieces.iter_mut().enumerate().skip(first) {
                piece.stores.clear();
                if is_long {
                    let some = (limit / 2).min(new - (nth - first) * (limit / 2));
                    result.push(some as u64 * self.entry());
                    piece.stores.extend(result.take(nth + 1 == last));
                }
            }
            merged = region;
            numbers = WriteStream::new(LISTS + apart(&self.memory, LIST_BYTES) * tile, self.burst);
        }
        // The places of stored entries, chunk by chunk.
        let stored: Vec<usize> = (0..list.len()).filter(|place| !list[*place]).collect();
        let (mut from, mut place, mut loaded) = (0, 0, kept(&self.memory, tile, false));
        while from < stored.len() {
            let own = if from == 0 && is_odd {
                limit / 2
            } else {
                limit
            };
            let to = (from + own).min(stored.len());
            let is_last = to == stored.len();
            let end = if is_last {
                list.len()
            } else {
                stored[to - 1] + 1
            };
            let entries = to - from;
            let with_new = end - place;
            let cycles = entries.div_ceil(self.sorter.network as usize);
            let (mut runs, mut passes) = (cycles, 0);
            while runs > 1 {
                (runs, passes) = (runs.div_ceil(2), passes + 1);
            }
            let before = if passes > 1 {
                (passes - 1) * entries
            } else {
                0
            };
            numbers.push(self.stored_bytes * with_new as u64);
            let bytes = entries as u64 * self.entry();
            let new_bytes = (with_new - entries) as u64 * self.entry();
            pieces.push_back(Piece {
                load: loaded..loaded + bytes,
                also: if is_long {
                    merged..merged + new_bytes
                } else {
                    0..0
                },
                is_stored_before: is_long && from == 0,
                room_after: cycles as u64,
                before: (cycles + before) as u64 + u64::from(self.sorter.network_latency),
                last: with_new as u64,
                stores: numbers.take(is_last).into_iter().collect(),
                completes: None,
            });
            loaded += bytes;
            if is_long {
                merged += new_bytes;
            }
            (from, place) = (to, end);
        }
        if let Some(piece) = pieces.back_mut() {
            piece.completes = Some(tile);
        }
        pieces
    }

    /// Sorts this many entries; their numbers are appended to those before.
    fn sort(
        &self,
        tile: u64,
        base: u64,
        entries: usize,
        numbers: &mut WriteStream,
        is_end: bool,
        pieces: &mut VecDeque<Piece>,
    ) {
        let limit = self.sorter.buffer_entries as usize;
        let sizes: Vec<usize> = (0..entries)
            .step_by(limit)
            .map(|first| limit.min(entries - first))
            .collect();
        let mut rounds = 0;
        while 1 << rounds < sizes.len() {
            rounds += 1;
        }
        let place =
            |round: u64| KEYED + (1 + round % 2) * PLACES + apart(&self.memory, APART) * tile;
        let mut chunks = WriteStream::new(place(0), self.burst);
        let mut loaded = base;
        for (nth, size) in sizes.iter().enumerate() {
            let is_last = nth + 1 == sizes.len();
            let to = loaded + *size as u64 * self.entry();
            let cycles = size.div_ceil(self.sorter.network as usize) as u64;
            // Pairs of runs, first of the network's length, become one.
            let (mut runs, mut merging) = (cycles, 0);
            while runs > 1 {
                (runs, merging) = (runs.div_ceil(2), merging + *size as u64);
            }
            let last = if merging > 0 { *size as u64 } else { cycles };
            let stores = if rounds == 0 {
                numbers.push(self.stored_bytes * *size as u64);
                numbers.take(is_last && is_end)
            } else {
                chunks.push(*size as u64 * self.entry());
                chunks.take(is_last)
            };
            let before = cycles + u64::from(self.sorter.network_latency) + merging - last;
            let stores = stores.into_iter().collect();
            pieces.push_back(Piece {
                load: loaded..to,
                also: 0..0,
                is_stored_before: false,
                room_after: cycles,
                before,
                last,
                stores,
                completes: None,
            });
            loaded = to;
        }
        for round in 0..rounds {
            let mut merged = WriteStream::new(place(round + 1), self.burst);
            let mut first = 0;
            while first < entries {
                let some = (limit / 2).min(entries - first);
                let is_last = first + some == entries;
                let stores = if round + 1 == rounds {
                    numbers.push(self.stored_bytes * some as u64);
                    numbers.take(is_last && is_end)
                } else {
                    merged.push(some as u64 * self.entry());
                    merged.take(is_last)
                };
                let [from, to] =
                    [first, first + some].map(|entry| place(round) + entry as u64 * self.entry());
                let piece = streaming(from..to, some, is_last, stores.into_iter().collect());
                pieces.push_back(Piece {
                    is_stored_before: first == 0,
                    ..piece
                });
                first += some;
            }
        }
    }
}

/// Reads what a piece loads.
fn read(now: u64, piece: &Piece, memory: &mut Memory) -> [Done; 2] {
    let load = |bytes: &Range<u64>| {
        let here = Done::default();
        memory.request(now, Requester::Sort, Direction::Read, bytes.clone(), &here);
        here
    };
    let mut load = load;
    let first = load(&piece.load);
    let other = match piece.also.is_empty() {
        true => first.clone(),
        false => load(&piece.also),
    };
    [first, other]
}

/// A piece of one entry per cycle. The other half of the buffer is free, but not more than that.
fn streaming(load: Range<u64>, entries: usize, is_last: bool, stores: Vec<Range<u64>>) -> Piece {
    let entries = entries as u64;
    Piece {
        load,
        also: 0..0,
        is_stored_before: false,
        room_after: if is_last { entries } else { 0 },
        before: 0,
        last: entries,
        stores,
        completes: None,
    }
}

impl Sorter {
    fn is_done(&mut self, now: u64) -> bool {
        self.pieces.is_empty()
            && self.loaded.is_none()
            && self.working.is_none()
            && self.stored.are_all_done(now)
    }
}

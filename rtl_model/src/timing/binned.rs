//! Binned: a list for each tile first; then tile after tile on the chip.
//!
//! ```text
//! memory ─► fetch ─► project ─► ellipse [─► colour] [─► shade] ─► bin ─► memory   every splat once: its record, an entry for each tile of its box
//! memory ◄─► sort                                                      every entry, once a digit of its depth, if splats are sorted
//! memory ─► list ─► raster ─► gauss ─► fragment ─► resolve ─► memory  every entry of every tile; the tile's words
//! ```
//! The second pass begins when the first, and the sort, is through. Tiles follow each other by rows; those without an entry are only
//! written. Of a tile in which every pixel has stopped, nothing more is read.
//!
//! Laws: `a_binned_frame_ticks_as_it_is_replayed`, `a_crowd_that_is_sorted_ticks_as_it_is_replayed`.

use super::Cycles;
use super::account::{Detail, Ready, Unit};
use super::memory::{Client, Direction, LISTS, Memory, Outstanding, RECORDS, WORDS};
use super::stages::{Fill, Merge, Resolve, SetUp, Stamp};
use super::stops::Stops;
use super::texels;
use super::texels::Texels;
use super::tiles::Tiles;
use crate::elaboration::microarchitecture;
use crate::elaboration::microarchitecture::{Microarchitecture, Pace};
use crate::elaboration::unit;
use crate::work::{Bins, Work, each_tile};
use std::collections::VecDeque;

/// Bytes of a list's entry: which splat.
const ENTRY_BYTES: u64 = microarchitecture::ENTRY_BYTES as u64;
/// Lists lie so far apart.
const LIST_BYTES: u64 = 1 << 24;

/// Replays a frame.
pub fn replay(timing: &Microarchitecture, work: &Work, detail: Detail) -> Cycles {
    let t = timing;
    let side = t.timing.tile.side_px;
    let burst = u64::from(t.timing.memory.burst_bytes);
    let mut memory = Memory::new(t.timing.memory, detail == Detail::Log);
    let lists = work.bins(side as usize);
    let (setup, bin, listed) = first_pass(t, work, &lists, &mut memory, detail);
    let one = Pace { units: 1, latency: 1, interval: 1, fifo: 1 };
    let mut sort = Unit::new(unit::SORT, one, [Some("bin"), Some("list")], detail, t.lifted);
    let sorted = if work.order.is_empty() { listed } else { sort_lists(t, lists.entries() as u64, &mut sort, listed, &mut memory) };

    let one = Pace { units: 1, latency: 1, interval: 1, fifo: t.timing.fetch.fifo };
    let mut list = Unit::new("list", one, [Some("bin"), Some(unit::RASTER)], detail, t.lifted);
    let mut fill = Fill::new(t, work, "list", unit::FRAGMENT, detail);
    let mut merge = Merge::new(t, work, unit::GAUSS, Some(unit::RESOLVE), detail);
    let mut resolve = Resolve::new(t, work, detail);
    let mut lit = Unit::new(super::RESOLVE_SHADE, t.shade, [Some(unit::RESOLVE), None], detail, t.lifted);
    let mut lit_texels = Texels::new(t, work);
    let mut outstanding = Outstanding::new(t.timing.memory.outstanding);
    // When the buffers of the tiles before are free again, the one before last first.
    let mut buffers = [sorted; 2];
    let mut stops = Stops::new(work);
    let mut list_from = sorted;
    let mut tiles = None;
    for tile in 0..lists.tiles() {
        let corner = [tile % lists.columns, tile / lists.columns].map(|at| at as u32 * side);
        let corner_16 = corner.map(|at| at as u16);
        let entries = lists.of(tile);
        let buffer_free = if t.timing.tile.buffers == 2 { buffers[0] } else { buffers[1] };
        let (mut bursts, mut burst_here) = (0, 0);
        merge.written = sorted;
        if let Some(stops) = &mut stops {
            stops.tile(corner, side);
        }
        for (nth, entry) in entries.iter().enumerate() {
            let footprint = &work.footprints[*entry as usize];
            let needed = ((nth as u64 + 1) * ENTRY_BYTES).div_ceil(burst);
            let ready = Ready { here: list_from, memory: outstanding.free(), room: list.behind.free(), ..Ready::default() };
            if let Some(stops) = &mut stops
                && stops.all() <= list.free().max(ready.here).max(ready.memory).max(ready.room)
            {
                // The rest of the tile.
                list_from = list.free().max(ready.here).max(stops.all());
                list.wait(Ready { memory: ready.memory.min(list_from), room: ready.room.min(list_from), ..ready });
                break;
            }
            let now = list.take(ready, 1);
            list.behind.take(now);
            // Who waits for texels is behind list: resolve may ask for those of a tile that nothing was written to.
            let asked_from = match merge.texels {
                None => now,
                Some(_) => merge.fragment.free().min(resolve.unit.free()),
            };
            memory.forget(now.min(asked_from));
            if needed > bursts {
                let address = LISTS + tile as u64 * LIST_BYTES + bursts * burst;
                burst_here = memory.request(now, Client::Lists, Direction::Read, address, burst);
                outstanding.push(burst_here);
                bursts = needed;
            }
            let address = RECORDS + u64::from(*entry) * u64::from(t.prepared_bytes);
            let here = memory.request(now.max(burst_here), Client::Lists, Direction::Read, address, t.prepared_bytes.into());
            outstanding.push(here);

            // The tile before is still in the buffer.
            let mut next = |stamp: Stamp, here| merge.stamp(stamp, Ready { here, room: buffer_free, ..Ready::default() }, &mut memory);
            let taken = match &mut stops {
                None => fill.footprint(footprint, (corner_16, side), (now + 1, here), |stamp, here| next(stamp, here)[0]).0,
                // Of sheets nothing is shaded here.
                Some(stops) => fill.footprint_of_stops(footprint, (corner_16, side), (now + 1, here), stops, |pieces, here| {
                    next(Stamp { pieces, texels: &[] }, here)
                }),
            };
            list.behind.give(taken);
        }
        // Words of the tile; of one without entries they are the background, written behind the tile before.
        let [across, down] = [(corner[0], work.width), (corner[1], work.height)].map(|(from, size)| from..size.min(from + side));
        let bytes = u64::from(across.end - across.start) * u64::from(down.end - down.start) * u64::from(t.frame_bytes);
        let mut done = buffers[1];
        if !entries.is_empty() {
            if let Some(stops) = &stops {
                merge.written = merge.written.max(stops.known());
            }
            let shade = match t.timing.tile.buffers {
                2 => (&mut lit, &mut lit_texels),
                _ => (&mut merge.shade, &mut merge.texels),
            };
            done = resolve.pixels(across, down, Ready { here: merge.written, ..Ready::default() }, shade, &mut memory);
            buffers = [buffers[1], done];
            if detail >= Detail::Histograms {
                let lit = Some(&lit).filter(|_| t.timing.tile.buffers == 2);
                let units = [Some(&list), Some(&fill.raster), Some(&fill.gauss), Some(&merge.fragment), Some(&merge.shade), lit];
                let units: Vec<&Unit> = units.into_iter().flatten().chain([&resolve.unit]).collect();
                let at = corner.map(|at| at / side);
                tiles.get_or_insert_with(|| Tiles::new(side, sorted, &units)).push(at, entries.len() as u32, done, &units);
            }
        }
        let address = WORDS + tile as u64 * u64::from(side * side * t.frame_bytes);
        memory.write_later(done, Client::FrameWrite, address, bytes);
    }
    let texels = texels::lookups([&setup.texels, &merge.texels, &lit_texels]);
    let (mut units, shade) = setup.units(merge.shade);
    units.push(bin);
    units.extend((!work.order.is_empty()).then_some(sort));
    units.extend([list, fill.raster, fill.gauss, merge.fragment, shade]);
    if t.timing.tile.buffers == 2 {
        units.push(lit);
    }
    units.push(resolve.unit);
    Cycles { stamps: fill.stamps, tiles, texels, ..Cycles::of(units, memory) }
}

/// Sets all splats up and writes the lists; says when they are written.
fn first_pass<'a>(t: &'a Microarchitecture, work: &'a Work, lists: &Bins, memory: &mut Memory, detail: Detail) -> (SetUp<'a>, Unit, u64) {
    let side = t.timing.tile.side_px as usize;
    let burst = u64::from(t.timing.memory.burst_bytes);
    let mut setup = SetUp::new(t, work, "bin", memory, detail);
    let one = Pace { units: 1, latency: 1, interval: 1, fifo: 1 };
    let mut bin = Unit::new("bin", one, [Some(SetUp::last_name(t, work)), None], detail, t.lifted);
    let each = u64::from(!bin.is_lifted());
    let mut outstanding = Outstanding::new(t.timing.memory.outstanding);
    let mut lengths = vec![0u64; lists.tiles()];
    let mut fates = work.fates.iter().zip(0..).peekable();
    // Splats that were set up: when bin has them.
    let mut ahead = VecDeque::new();
    let (mut record_bursts, mut end) = (0, 0);
    for (nth, footprint) in work.footprints.iter().enumerate() {
        // What is fetched before bin takes the next splat asks before it, as far as there is room.
        while let Some((fate, index)) = fates.next_if(|(_, index)| match ahead.front() {
            Some(here) => setup.is_known() && setup.when(*index) <= bin.free().max(outstanding.free()).max(*here),
            None => true,
        }) {
            if let Some(here) = setup.splat(index, *fate, memory) {
                ahead.push_back(here);
                memory.forget(setup.fetched);
            }
        }
        let Some(here) = ahead.pop_front() else { break };
        let mut entries = 0;
        each_tile(footprint.sides(), side, lists.columns, |_| entries += 1);
        // A record, then an entry a cycle; what is written waits for its turn.
        let now = bin.take(Ready { here, memory: outstanding.free(), ..Ready::default() }, 1 + entries);
        setup.give(here, now);
        let mut write = |when: u64, address: u64| {
            let done = memory.request(when, Client::Lists, Direction::Write, address, burst);
            outstanding.push(done);
            end = end.max(done);
        };
        // Records lie side by side: a burst goes when it is full.
        let full = (nth as u64 + 1) * u64::from(t.prepared_bytes) / burst;
        (record_bursts..full).for_each(|full| write(now, RECORDS + full * burst));
        record_bursts = full;
        let mut when = now;
        each_tile(footprint.sides(), side, lists.columns, |tile| {
            when += each;
            lengths[tile] += 1;
            if (lengths[tile] * ENTRY_BYTES).is_multiple_of(burst) {
                write(when, LISTS + tile as u64 * LIST_BYTES + lengths[tile] * ENTRY_BYTES - burst);
            }
        });
        end = end.max(when + 1);
    }
    for (fate, index) in fates {
        setup.splat(index, *fate, memory);
    }
    setup.end(memory);
    // What is left of the last records and of every list.
    let last = end;
    if !(work.footprints.len() as u64 * u64::from(t.prepared_bytes)).is_multiple_of(burst) {
        end = end.max(memory.request(last, Client::Lists, Direction::Write, RECORDS + record_bursts * burst, burst));
    }
    for (tile, length) in lengths.into_iter().enumerate().filter(|(_, length)| !(length * ENTRY_BYTES).is_multiple_of(burst)) {
        let address = LISTS + tile as u64 * LIST_BYTES + length * ENTRY_BYTES / burst * burst;
        end = end.max(memory.request(last, Client::Lists, Direction::Write, address, burst));
    }
    (setup, bin, end)
}

/// Bytes that the sort reads at a time.
const SORT_BYTES: u64 = 1 << 12;
/// Where the sort keeps its entries, behind all lists.
const SORTED: u64 = 1 << 60;

/// Radix sort of all lists' entries by depth: a pass for each digit of the key reads every entry and writes it to where it belongs, an entry
/// a cycle, after a cycle for each value of the digit to sum the counts up. Says when it is done.
fn sort_lists(t: &Microarchitecture, entries: u64, sort: &mut Unit, from: u64, memory: &mut Memory) -> u64 {
    let Some(shape) = t.sort else { return from };
    let mut now = from;
    for pass in 0..u64::from(shape.passes) {
        let busy = if sort.is_lifted() { 0 } else { entries + (1 << shape.digit_bits) };
        let bytes = entries * u64::from(shape.entry_bytes);
        let [source, target] = [pass % 2, (pass + 1) % 2].map(|half| SORTED + half * (1 << 40));
        let (mut done, mut moved) = (now, 0);
        while moved < bytes {
            let part = SORT_BYTES.min(bytes - moved);
            let asked = done.max(now + if sort.is_lifted() { 0 } else { moved / u64::from(shape.entry_bytes) });
            let here = memory.request(asked, Client::Lists, Direction::Read, source + moved, part);
            done = memory.request(here, Client::Lists, Direction::Write, target + moved, part);
            moved += part;
        }
        let cycles = busy.max(done - now);
        sort.take_with_memory(Ready { here: now, ..Ready::default() }, busy, cycles);
        now += cycles;
        memory.forget(now);
    }
    now
}

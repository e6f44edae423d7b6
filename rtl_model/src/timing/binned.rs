//! Binned: writes a list for each tile, then draws tile after tile on the chip.
//!
//! ```text
//! memory ─► fetch ─► project ─► ellipse [─► colour] [─► shade] ─► bin ─► memory   every splat once: its record, an entry per tile of its box
//! memory ◄─► sort                                                      if splats are sorted: every entry, once per digit of its depth;
//!                                                                      or list by list (`sorters.rs`)
//! memory ─► list ─► raster ─► gauss ─► fragment ─► resolve ─► memory  every entry of every tile; the tile's words
//! ```
//! The second pass begins when the first pass and the sort have ended. Sorters of lists may also
//! overlap with it. Tiles are drawn row by row, or the longest lists first. Tiles without an entry
//! are only written, after the previous tile of the picture. The pass has one or more engines,
//! which share only memory and the queue: the next tile goes to the engine whose list unit is free
//! first. If the pass has several engines, or sorters overlap with it, the reads of lists, the reads
//! of records and the requests of sorters are replayed in order of time. An engine's list can then
//! be ahead of the records that it waits for. When every pixel of a tile has stopped, the rest of
//! its list is not read.
//!
//! Laws: `a_binned_frame_ticks_as_it_is_replayed`,
//! `a_crowd_that_is_sorted_ticks_as_it_is_replayed`.

pub mod batched;
mod lists;

pub use lists::{Lists, MaskCounts, TileTests};

use super::Cycles;
use super::account::{Account, Detail, Ready, Unit};
use super::frame::RecordedFrame;
use super::memory::{
    BOXES, Direction, LISTS, Memory, Outstanding, RECORDS, Requester, Reserved, WORDS,
};
use super::sorters::{self, Sorters};
use super::stages::{Fill, FinalPixels, Merge, Resolve, SetUp, Stamp};
use super::stamps::{Stamps, are_whole};
use super::stops::{self, EarlyTermination, StopMap};
use super::texels;
use super::texels::Texels;
use super::tiles::{Shares, TileCycles, Tiles, names};
use crate::elaboration::masks::Masks;
use crate::elaboration::microarchitecture::{LENGTH_VALUES, Microarchitecture, Pace};
use crate::elaboration::sorter::BOX_BYTES;
use crate::elaboration::unit;
use crate::machine::timing::Queue;
use crate::work::{DEPARTED, Footprint, Work};
use std::collections::VecDeque;
use std::iter;
use std::ops::Range;
use std::sync::Arc;

/// Distance between lists.
const LIST_BYTES: u64 = 1 << 24;

/// Address of the list of a tile.
pub fn list_address(t: &Microarchitecture, tile: usize) -> u64 {
    LISTS + tile as u64 * t.timing.memory.list_stride(LIST_BYTES)
}

/// Replays a frame.
pub fn replay(timing: &Microarchitecture, frame: &RecordedFrame, detail: Detail) -> Cycles {
    let lists = frame.lists(timing);
    Listed::new(timing, frame.work, &lists, detail).draw(timing, frame, &lists, detail)
}

/// A frame with written and sorted lists.
#[derive(Clone)]
pub struct Listed<'a> {
    memory: Memory,
    setup: SetUp<'a>,
    bin: Unit,
    sort: Vec<Unit>,
    /// Cycle in which all lists are written, and the first cycle of the second pass.
    listed: u64,
    from: u64,
    tests: Option<TileTests>,
}

impl<'a> Listed<'a> {
    /// Replays the first pass and the sort.
    pub fn new(t: &'a Microarchitecture, work: &'a Work, lists: &Lists, detail: Detail) -> Self {
        let mut memory = Memory::new(t.timing.memory, detail == Detail::Log);
        let (setup, bin, listed) = first_pass(t, work, lists, &mut memory, detail);
        // Sorters that overlap with drawing belong to the second pass.
        let (sort, sorted) = match !work.is_sorted() || t.overlaps_sort() {
            true => (Vec::new(), listed),
            false => sorters::sort_lists(t, work, lists, listed, &mut memory, detail)
                .unwrap_or_else(|| {
                    sort_entries(t, lists.entries() as u64, listed, &mut memory, detail)
                }),
        };
        let from = if t.timing.queue == Queue::Longest {
            sorted + queue_cycles(lists)
        } else {
            sorted
        };
        Listed {
            memory,
            setup,
            bin,
            sort,
            listed,
            from,
            tests: lists.tests(),
        }
    }

    /// Replays the second pass, on a machine with the same first pass and sort.
    pub fn draw(
        mut self,
        t: &'a Microarchitecture,
        frame: &RecordedFrame<'a>,
        lists: &Lists,
        detail: Detail,
    ) -> Cycles {
        let mut pass = SecondPass::new(t, frame.work, lists, self.from);
        if t.overlaps_sort() && frame.work.is_sorted() {
            let tiles = pass.queue.iter().map(|(_, tile)| *tile);
            pass.sorters = Sorters::new(t, frame.work, lists, tiles, self.listed, detail);
        }
        let (engines, stamps, tiles, saved) =
            pass.run(frame, &mut self.memory, detail, &mut self.sort);
        Cycles {
            early_termination: saved,
            ..self.cycles(engines, stamps, tiles, detail)
        }
    }

    /// Cycles of the frame, after the engines have drawn it.
    fn cycles(
        self,
        engines: Vec<Engine>,
        stamps: [u64; 2],
        tiles: Option<Tiles>,
        detail: Detail,
    ) -> Cycles {
        let Listed {
            memory,
            setup,
            bin,
            sort,
            listed,
            from,
            tests,
        } = self;
        let of_engine = engines
            .iter()
            .map(|engine| texels::lookups([&engine.merge.texels, &engine.lit_texels]));
        let texels = of_engine.fold(
            texels::lookups([&setup.texels]),
            |[all, had], [more, more_had]| [all + more, had + more_had],
        );
        let light = engines
            .iter()
            .map(|engine| engine.merge.light + engine.resolve.light)
            .sum();
        let tests = tests.map(|tests| TileTests {
            masks: tests.masks.map(|masks| masks_of(masks, &engines)),
            ..tests
        });
        let mut each: [Vec<Unit>; 7] = Default::default();
        for Engine {
            list,
            fill,
            merge,
            resolve,
            lit,
            ..
        } in engines
        {
            let (fragment, shade) = merge.units();
            let of_engine = [
                vec![list],
                vec![fill.raster],
                vec![fill.gauss],
                fragment.collect(),
                vec![shade],
                lit.into_iter().collect(),
                resolve.units(),
            ];
            each.iter_mut()
                .zip(of_engine)
                .for_each(|(all, of_engine)| all.extend(of_engine));
        }
        let [list, raster, gauss, fragment, shade, lit, resolve] = each;
        let (mut units, shade) = setup.units(shade);
        units.push(bin);
        units.extend(sort);
        units.extend(
            [list, raster, gauss, fragment, shade, lit, resolve]
                .into_iter()
                .flatten(),
        );
        Cycles {
            stamps,
            tiles,
            texels,
            light,
            tile_tests: tests,
            passes: Some([listed, from]),
            ..Cycles::of(units, memory, detail)
        }
    }
}

/// Adds the counts of the engines to those of masks.
fn masks_of(masks: MaskCounts, engines: &[Engine]) -> MaskCounts {
    let of_list = |of: fn(&ListMasks) -> u64| {
        let engines = engines.iter().filter_map(|engine| engine.masks.as_ref());
        engines.map(of).sum::<u64>()
    };
    MaskCounts {
        tested: masks.tested + of_list(|masks| masks.tested),
        set: masks.set + of_list(|masks| masks.set),
        list_cycles: of_list(|masks| masks.cycles),
        seeds: engines.iter().map(|engine| engine.fill.seeds).sum(),
    }
}

/// Cycles of sorting the queue by the lengths of lists, between the passes, digit by digit: one per
/// tile with an entry, and one per value of the digit.
fn queue_cycles(lists: &Lists) -> u64 {
    let tiles = (0..lists.tiles())
        .filter(|tile| !lists.of(*tile).is_empty())
        .count() as u64;
    2 * (tiles + LENGTH_VALUES)
}

/// A step of an engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Step {
    /// List takes a tile, or reads or leaves its list.
    List,
    /// A record is requested, and its splat drawn.
    Record,
}

/// Draws the tiles of the queue.
struct SecondPass<'a> {
    t: &'a Microarchitecture,
    work: &'a Work,
    lists: &'a Lists,
    /// Its first cycle.
    from: u64,
    /// Tiles with an entry, and their positions in the queue.
    queue: VecDeque<(usize, usize)>,
    /// The cycle in which the last tile was taken: the next one is behind it.
    taken: u64,
    /// Reads of lists and of records are replayed in order of time; otherwise each entry is, with
    /// its record. Then only texels are requested at other times.
    is_in_order: bool,
    /// List leaves a tile whose pixels have all stopped. It does not if lists are kept, because the
    /// key of each entry is needed in the next frame.
    leaves_stopped: bool,
    /// Sorters that work meanwhile.
    sorters: Option<Sorters<'a>>,
}

/// The units behind the lists.
struct Engine<'a> {
    list: Unit,
    fill: Fill<'a>,
    merge: Merge<'a>,
    resolve: Resolve<'a>,
    /// Shade unit of resolve, if tiles have two buffers.
    lit: Option<Unit>,
    /// Its cache of texels.
    lit_texels: Option<Texels>,
    /// Makes masks, if `bin` does not.
    masks: Option<ListMasks>,
    outstanding: Outstanding,
    /// The cycles from which the buffers of the last tiles are free again, the earlier tile first.
    buffers: [u64; 2],
    /// Last cycle in which a fragment of the previous tile is written.
    written: u64,
    list_from: u64,
    /// The tile whose list is read, and the tile that is drawn.
    listed: Option<ListedTile>,
    drawn: Option<DrawnTile>,
    /// What list has read, until raster takes it.
    ahead: VecDeque<Ahead>,
    /// Footprints of the list of the drawn tile.
    footprints: Vec<Footprint>,
}

/// Makes the masks of the entries that `list` has read, in order. An item is an entry whose record
/// has arrived. Its place in the FIFO in front of raster holds the mask.
struct ListMasks {
    shape: Masks,
    latency: u64,
    /// Cycle from which the next entry can be tested.
    free: u64,
    tested: u64,
    set: u64,
    cycles: u64,
}

impl ListMasks {
    fn new(t: &Microarchitecture) -> Option<Self> {
        let (shape, latency) = t.masks_of_list()?;
        Some(ListMasks {
            shape,
            latency: latency.into(),
            free: 0,
            tested: 0,
            set: 0,
            cycles: 0,
        })
    }

    /// Tests this number of subtiles of an entry from this cycle on, with this mask as the result;
    /// returns the cycle in which raster can take it.
    fn test(&mut self, here: u64, (subtiles, mask): (u64, u64), is_lifted: bool) -> u64 {
        let cycles = if is_lifted {
            0
        } else {
            self.shape.cycles(subtiles)
        };
        let now = here.max(self.free);
        self.free = now + cycles;
        self.tested += subtiles;
        self.set += u64::from(mask.count_ones());
        self.cycles += cycles;
        now + cycles.saturating_sub(1) + self.latency
    }
}

/// A tile whose list is read.
struct ListedTile {
    place: usize,
    /// Index of the next entry of its list.
    nth: usize,
    /// Bursts of its list that were requested, and the arrival of the last one.
    bursts: u64,
    burst_here: u64,
}

/// A tile that is drawn.
struct DrawnTile {
    place: usize,
    turn: usize,
    corner: [u32; 2],
    /// Index of the next entry of its list, and its place among the boxes that touch the tile.
    nth: usize,
    boxed: usize,
    buffer_free: u64,
    stops: stops::TileStops,
    back: WriteBack,
}

/// A tile that an engine has taken.
#[derive(Clone, Copy)]
struct TakenTile {
    place: usize,
    turn: usize,
    /// The cycle from which its list can be read.
    from: u64,
}

/// What list has read and raster has not taken, in order.
#[derive(Clone, Copy)]
enum Ahead {
    /// The first entry of a tile follows.
    Tile(TakenTile),
    Entry(ReadEntry),
    /// The last entry of a tile that is read is before this. With the state of list.
    End((u64, Account)),
}

/// An entry that list has read.
#[derive(Clone, Copy)]
struct ReadEntry {
    /// The cycle in which list took it.
    now: u64,
    /// The cycle of the request for its record: the burst with the entry has arrived.
    record_from: u64,
    /// The record's place among the outstanding requests.
    request: Reserved,
}

/// A kept list that is written for the next frame, entry by entry, in order.
#[derive(Clone, Copy, Debug, Default)]
struct WriteBack {
    /// Bytes so far, and the cycle of the last entry.
    bytes: u64,
    when: u64,
}

impl WriteBack {
    /// Writes an entry whose record, and so its key, has arrived.
    fn push(&mut self, here: u64, entry_bytes: u64, burst: u64, list: u64, memory: &mut Memory) {
        self.when = self.when.max(here);
        let full = self.bytes / burst;
        self.bytes += entry_bytes;
        if self.bytes / burst > full {
            memory.post_write(self.when, Requester::Lists, list + full * burst, burst);
        }
    }

    /// Writes the rest of the last burst, when the record of the last entry has arrived.
    fn end(self, here: u64, burst: u64, list: u64, memory: &mut Memory) {
        if !self.bytes.is_multiple_of(burst) {
            let address = list + self.bytes / burst * burst;
            memory.post_write(self.when.max(here), Requester::Lists, address, burst);
        }
    }
}

impl<'a> Engine<'a> {
    fn new(
        t: &'a Microarchitecture,
        work: &Work,
        held: &Arc<FinalPixels>,
        from: u64,
        detail: Detail,
        nth: u32,
    ) -> Self {
        let one = Pace {
            units: 1,
            latency: 1,
            interval: 1,
            fifo: t.timing.fetch.fifo,
        };
        let list = Unit::new(
            "list",
            one,
            [Some("bin"), Some(unit::RASTER)],
            detail,
            t.lifted,
        );
        let lit = || {
            Unit::new(
                super::RESOLVE_SHADE,
                t.shade,
                [Some(unit::RESOLVE), None],
                detail,
                t.lifted,
            )
        };
        Engine {
            list: list.behind_others(nth),
            fill: Fill::new(t, "list", unit::FRAGMENT, detail, nth),
            merge: Merge::new(t, work, unit::GAUSS, Some(unit::RESOLVE), detail, nth),
            resolve: Resolve::new(t, Arc::clone(held), detail, nth),
            lit: (t.timing.tile.buffers == 2).then(|| lit().behind_others(nth * t.shade.units)),
            lit_texels: Texels::new(t, work).filter(|_| t.timing.tile.buffers == 2),
            masks: ListMasks::new(t),
            outstanding: Outstanding::new(t.timing.memory.outstanding),
            buffers: [from; 2],
            written: from,
            list_from: from,
            listed: None,
            drawn: None,
            ahead: VecDeque::new(),
            footprints: Vec::new(),
        }
    }

    /// The cycle from which its list unit is free for the next entry or tile.
    fn free(&self) -> u64 {
        self.list.free().max(self.list_from)
    }

    /// What list waits for before it takes an entry; none if a cycle is not known yet.
    fn ready(&self) -> Ready {
        let known = self
            .list
            .behind
            .is_scheduled()
            .then(|| self.list.behind.free());
        Ready {
            here: self.list_from,
            memory: self.outstanding.free(),
            room: known.unwrap_or(u64::MAX),
            ..Ready::default()
        }
    }

    /// Every unit, in the order of the diagram.
    fn all(&self) -> impl Iterator<Item = &Unit> {
        let before = [&self.list, &self.fill.raster, &self.fill.gauss];
        before
            .into_iter()
            .chain(self.merge.all())
            .chain(&self.lit)
            .chain(self.resolve.all())
    }
}

impl<'a> SecondPass<'a> {
    fn new(t: &'a Microarchitecture, work: &'a Work, lists: &'a Lists, from: u64) -> Self {
        let mut queue: Vec<usize> = (0..lists.tiles())
            .filter(|tile| !lists.of(*tile).is_empty())
            .collect();
        if t.timing.queue == Queue::Longest {
            // Lengths beyond two digits are limited.
            queue.sort_by_key(|tile| {
                std::cmp::Reverse(
                    (lists.of(*tile).len() as u64).min(LENGTH_VALUES * LENGTH_VALUES - 1),
                )
            });
        }
        SecondPass {
            t,
            work,
            lists,
            from,
            queue: queue.into_iter().enumerate().collect(),
            taken: from,
            is_in_order: (t.engines > 1 || t.overlaps_sort()) && !work.mirrors,
            leaves_stopped: work.stops() && !lists.are_kept(),
            sorters: None,
        }
    }

    /// Returns the engines' cycles, the number of stamps and of those with a kept pixel, and each
    /// tile's cycles. Appends the sorters that worked meanwhile to `sort`.
    fn run(
        mut self,
        frame: &RecordedFrame<'a>,
        memory: &mut Memory,
        detail: Detail,
        sort: &mut Vec<Unit>,
    ) -> (
        Vec<Engine<'a>>,
        [u64; 2],
        Option<Tiles>,
        Option<EarlyTermination>,
    ) {
        let (t, held) = (self.t, frame.held());
        let mut engines: Vec<Engine> = (0..t.engines)
            .map(|nth| Engine::new(t, self.work, &held, self.from, detail, nth))
            .collect();
        // Each recorded tile is read in order by one engine, or again for each tile.
        let walks = if are_whole(t) { 1 } else { engines.len() };
        let mut walks: Vec<Stamps> = (0..walks).map(|_| Stamps::of_tiles(t, self.work)).collect();
        let mut stops = frame.stops();
        let mut shares = vec![Shares::new(self.from); engines.len()];
        let mut turns = Vec::new();
        self.write_empty(0, self.from, memory);
        loop {
            let next = self.next(&engines);
            let sorts = self.sorters.as_ref().and_then(Sorters::next);
            if let (Some(sorters), Some(first)) = (&mut self.sorters, sorts)
                && next.is_none_or(|(from, ..)| first.0 <= from)
            {
                sorters.step(first, memory);
                continue;
            }
            let Some((from, step, nth)) = next else { break };
            if self.is_in_order {
                memory.forget(from);
            }
            if step == Step::List && engines[nth].listed.is_none() {
                let taken = self.begin(&mut engines[nth]);
                engines[nth].ahead.push_back(Ahead::Tile(taken));
            } else if step == Step::List {
                let others_from = if self.is_in_order {
                    from
                } else {
                    let others = (engines.iter().enumerate())
                        .filter(|(other, engine)| *other != nth && self.is_at_work(engine));
                    let free = others.map(|(_, engine)| engine.free());
                    let all = free.chain(sorts.map(|(at, ..)| at));
                    all.min().unwrap_or(u64::MAX)
                };
                let engine = &mut engines[nth];
                let read = self.read(engine, stops.as_mut(), others_from, memory);
                engine.ahead.extend(read.map(Ahead::Entry));
                if engine.listed.is_none() {
                    engine.ahead.extend(engine.list.so_far().map(Ahead::End));
                }
            }
            // Tiles begin and end in no time.
            let engine = &mut engines[nth];
            let mut draws = !self.is_in_order || step == Step::Record;
            let own = nth % walks.len();
            while let Some(ahead) = engine
                .ahead
                .pop_front_if(|ahead| draws || !matches!(ahead, Ahead::Entry(_)))
            {
                draws = !self.is_in_order;
                let Some((tile, list, done)) =
                    self.draw(engine, ahead, &mut walks[own], stops.as_mut(), memory)
                else {
                    continue;
                };
                if detail >= Detail::Histograms {
                    let (at, entries) = (
                        tile.corner.map(|at| at / t.timing.tile.side_px),
                        self.lists.of(tile.place).len() as u32,
                    );
                    let others = engine.all().skip(1).flat_map(Unit::so_far);
                    let shares = shares[nth].of(iter::once(list).chain(others));
                    turns.push((
                        tile.turn,
                        TileCycles {
                            at,
                            engine: nth as u32,
                            entries,
                            done,
                            cycles: 0,
                            shares,
                        },
                    ));
                }
            }
        }
        sort.extend(self.sorters.into_iter().flat_map(|sorters| sorters.end().0));
        let stamps = [0, 1].map(|kept| engines.iter().map(|engine| engine.fill.stamps[kept]).sum());
        let names = engines
            .first()
            .map_or_else(Vec::new, |engine| names(engine.all()));
        let tiles =
            (!turns.is_empty()).then(|| Tiles::new(t.timing.tile.side_px, self.from, names, turns));
        (engines, stamps, tiles, stops.map(|stops| stops.saved))
    }

    /// Whether an engine has, or will have, a list to read.
    fn is_at_work(&self, engine: &Engine) -> bool {
        engine.listed.is_some() || !self.queue.is_empty()
    }

    /// The cycle from which list leaves its tile because all pixels have stopped, by the stamps that
    /// were taken so far.
    fn stopped(&self, engine: &Engine, listed: &ListedTile) -> u64 {
        match &engine.drawn {
            Some(drawn) if self.leaves_stopped && drawn.place == listed.place => drawn.stops.all(),
            _ => u64::MAX,
        }
    }

    /// The engine with the first step, its cycle, and the step. Cycles that are not known yet depend
    /// on steps before.
    fn next(&self, engines: &[Engine]) -> Option<(u64, Step, usize)> {
        let list_from = |engine: &Engine| match &engine.listed {
            Some(listed) if self.is_in_order => {
                let (ready, stopped) = (engine.ready(), self.stopped(engine, listed));
                let taken = engine.list.when(ready);
                let from = taken.min(engine.free().max(stopped));
                (from < u64::MAX).then_some(from)
            }
            Some(_) => Some(engine.free()),
            None => {
                let (_, tile) = self.queue.front()?;
                Some(engine.free().max(self.sorted(*tile)?).max(self.taken))
            }
        };
        let steps = |(nth, engine): (usize, &Engine)| {
            let record = match engine.ahead.front() {
                Some(Ahead::Entry(read)) => Some((read.record_from, Step::Record, nth)),
                _ => None,
            };
            let list = list_from(engine).map(|from| (from, Step::List, nth));
            list.into_iter().chain(record).min()
        };
        engines.iter().enumerate().filter_map(steps).min()
    }

    /// The cycle from which the list of a tile can be read; none as long as it is not sorted.
    fn sorted(&self, tile: usize) -> Option<u64> {
        self.sorters
            .as_ref()
            .map_or(Some(self.from), |sorters| sorters.sorted(tile))
    }

    /// An engine takes the next tile.
    fn begin(&mut self, engine: &mut Engine) -> TakenTile {
        let (turn, place) = self.queue.pop_front().unwrap_or_default();
        let sorted = self.sorted(place).unwrap_or(0);
        engine.list_from = engine.list_from.max(sorted).max(self.taken);
        self.taken = engine.free();
        engine.listed = Some(ListedTile {
            place,
            nth: 0,
            bursts: 0,
            burst_here: 0,
        });
        let from = engine.free();
        TakenTile { place, turn, from }
    }

    /// An engine begins to draw a tile.
    fn begin_drawing(
        &self,
        engine: &mut Engine,
        TakenTile { place, turn, from }: TakenTile,
        stops: Option<&mut StopMap>,
    ) -> DrawnTile {
        let t = &self.t.timing;
        let corner = [place % self.lists.columns, place / self.lists.columns]
            .map(|at| at as u32 * t.tile.side_px);
        // The only engine can resolve a tile without stamps before its list is read.
        engine.merge.written = if self.t.engines == 1 { self.from } else { from };
        let stops = stops.map_or_else(stops::TileStops::default, |stops| {
            stops.begin(corner, t.tile.side_px);
            stops.tile
        });
        let mut buffer_free = engine.buffers[if t.tile.buffers == 2 { 0 } else { 1 }];
        if let Some(cycles) = t.tile.clear_cycles.filter(|cycles| *cycles > 0) {
            buffer_free = buffer_free.max(engine.written) + u64::from(cycles);
        }
        DrawnTile {
            place,
            turn,
            corner,
            nth: 0,
            boxed: 0,
            buffer_free,
            stops,
            back: WriteBack::default(),
        }
    }

    /// Draws what list has read; returns a tile that is done, the state of list behind it, and the
    /// cycle of its last word.
    #[inline(always)]
    fn draw(
        &self,
        engine: &mut Engine,
        ahead: Ahead,
        walk: &mut Stamps,
        mut stops: Option<&mut StopMap>,
        memory: &mut Memory,
    ) -> Option<(DrawnTile, (u64, Account), u64)> {
        if let (Some(stops), Some(tile)) = (&mut stops, &engine.drawn) {
            stops.tile = tile.stops;
        }
        match ahead {
            Ahead::Tile(taken) => {
                let tile = self.begin_drawing(engine, taken, stops);
                walk.begin(tile.corner.map(|at| at as u16));
                let footprints = &mut engine.footprints;
                self.work.look_up(self.lists.of(taken.place), footprints);
                engine.drawn = Some(tile);
                None
            }
            Ahead::Entry(read) => {
                let mut tile = engine.drawn.take()?;
                self.entry(engine, &mut tile, read, walk, stops.as_deref_mut(), memory);
                tile.stops = stops.map_or(tile.stops, |stops| stops.tile);
                engine.drawn = Some(tile);
                None
            }
            Ahead::End(list) => {
                let tile = engine.drawn.take()?;
                let done = self.resolve(engine, &tile, stops.as_deref(), memory);
                Some((tile, list, done))
            }
        }
    }

    /// Draws an entry of a tile that was read.
    #[inline(always)]
    fn entry(
        &self,
        engine: &mut Engine,
        tile: &mut DrawnTile,
        read: ReadEntry,
        walk: &mut Stamps,
        stops: Option<&mut StopMap>,
        memory: &mut Memory,
    ) {
        let entries = self.lists.of(tile.place);
        let record = self.read_record(engine, tile, read, memory);
        let mut from = (read.now + 1, record);
        let Engine {
            list,
            fill,
            merge,
            footprints,
            masks,
            ..
        } = engine;
        let is_last = tile.nth + 1 == entries.len();
        let has_departed = entries[tile.nth] == DEPARTED;
        if self.lists.are_kept() {
            let burst = u64::from(self.t.timing.memory.burst_bytes);
            let entry_bytes = self.t.sort.map_or(0, |sort| sort.entry_bytes.into());
            let list = sorters::kept(self.t, tile.place);
            let [here, record] = [from.0, from.1];
            if !has_departed {
                tile.back
                    .push(here.max(record), entry_bytes, burst, list, memory);
            }
            if is_last {
                tile.back.end(here.max(record), burst, list, memory);
            }
        }
        if has_departed {
            if let Some(masks) = masks {
                from = (masks.test(from.0.max(from.1), (0, 0), list.is_lifted()), 0);
            }
            let taken = fill.drop_entry(from, stops.as_deref());
            list.behind.give(taken);
            tile.nth += 1;
            return;
        }
        let footprint = &footprints[tile.nth];
        if let Some(masks) = masks {
            let subtiles = self.lists.subtiles(&masks.shape, footprint, tile.place);
            let made = (subtiles, self.lists.mask(tile.place, tile.nth));
            let here = masks.test(from.0.max(from.1), made, list.is_lifted());
            from = (here, 0);
        }
        // The buffer still holds the previous tile.
        let room = tile.buffer_free;
        let mut next = |stamp: Stamp, here| {
            merge.stamp(
                stamp,
                Ready {
                    here,
                    room,
                    ..Ready::default()
                },
                memory,
            )
        };
        let corner = tile.corner.map(|at| at as u16);
        let area = (corner, self.t.timing.tile.side_px);
        let entry = entries[tile.nth];
        tile.boxed = (self.lists).skip(walk, self.work, (tile.place, corner), tile.boxed, entry);
        walk.select(entry, self.lists.mask(tile.place, tile.nth));
        let taken = match stops {
            None => {
                fill.footprint(walk, footprint, area, from, |stamp, here| {
                    next(stamp, here)[0]
                })
                .0
            }
            // Sheets are not shaded here.
            Some(stops) => {
                fill.footprint_of_stops(walk, footprint, area, from, stops, |pieces, here| {
                    next(
                        Stamp {
                            pieces,
                            texels: &[],
                        },
                        here,
                    )
                })
            }
        };
        list.behind.give(taken);
        tile.nth += 1;
    }

    /// List reads the next entry of its tile; or leaves the tile because all its pixels have
    /// stopped, and returns none. No other engine sends a request before `others_from`.
    #[inline(always)]
    fn read(
        &self,
        engine: &mut Engine,
        stops: Option<&mut StopMap>,
        others_from: u64,
        memory: &mut Memory,
    ) -> Option<ReadEntry> {
        let t = self.t;
        let mut listed = engine.listed.take()?;
        let entries = self.lists.of(listed.place).len();
        let (ready, stopped) = (engine.ready(), self.stopped(engine, &listed));
        let Engine {
            list,
            merge,
            resolve,
            outstanding,
            list_from,
            ..
        } = engine;
        let mut read = None;
        if self.leaves_stopped && stopped <= list.when(ready) {
            // The rest of the tile.
            *list_from = list.free().max(ready.here).max(stopped);
            list.stall(Ready {
                memory: ready.memory.min(*list_from),
                room: ready.room.min(*list_from),
                ..ready
            });
        } else {
            let burst = u64::from(t.timing.memory.burst_bytes);
            let needed = ((listed.nth as u64 + 1) * u64::from(t.entry_bytes())).div_ceil(burst);
            let now = list.take(ready, 1);
            list.behind.claim();
            // A unit that stalls for texels is behind list: resolve can request texels of a tile
            // without entries.
            let requested_from = if merge.texels.is_none() {
                now
            } else {
                merge.free().min(resolve.free())
            };
            memory.forget(now.min(others_from).min(requested_from));
            if needed > listed.bursts {
                let address = list_address(t, listed.place) + listed.bursts * burst;
                listed.burst_here =
                    memory.request(now, Requester::Lists, Direction::Read, address, burst);
                outstanding.push(listed.burst_here);
                listed.bursts = needed;
            }
            listed.nth += 1;
            read = Some(ReadEntry {
                now,
                record_from: now.max(listed.burst_here),
                request: outstanding.reserve(),
            });
        }
        if read.is_some() && listed.nth < entries {
            engine.listed = Some(listed);
        } else if let Some(stops) = stops {
            stops.end(entries, listed.nth);
        }
        read
    }

    /// Reads the record of an entry; returns the cycle of its arrival.
    #[inline(always)]
    fn read_record(
        &self,
        engine: &mut Engine,
        tile: &DrawnTile,
        read: ReadEntry,
        memory: &mut Memory,
    ) -> u64 {
        engine.list.behind.count(read.now);
        // Entries of kept lists are numbers of splats in the scene.
        let record = match (&self.work.lists, self.lists.are_kept()) {
            (Some(lists), true) => lists.tiles[tile.place].splats[tile.nth],
            _ => self.lists.of(tile.place)[tile.nth],
        };
        let bytes = u64::from(self.t.prepared_bytes);
        let here = memory.request(
            read.record_from,
            Requester::Lists,
            Direction::Read,
            RECORDS + u64::from(record) * bytes,
            bytes,
        );
        engine.outstanding.set(read.request, here);
        here
    }

    /// Resolves and writes a tile, and the following tiles without an entry; returns the cycle of
    /// its last word.
    fn resolve(
        &self,
        engine: &mut Engine,
        tile: &DrawnTile,
        stops: Option<&StopMap>,
        memory: &mut Memory,
    ) -> u64 {
        let [columns, rows] = self.area(tile.place);
        let written = engine.merge.written.max(stops.map_or(0, StopMap::known));
        engine.written = written;
        let shade = match &mut engine.lit {
            Some(lit) => (lit, &mut engine.lit_texels),
            None => (&mut engine.merge.shade, &mut engine.merge.texels),
        };
        let done = engine.resolve.pixels(
            columns,
            rows,
            Ready {
                here: written,
                ..Ready::default()
            },
            shade,
            memory,
        );
        engine.buffers = [engine.buffers[1], done];
        self.write(tile.place, done, memory);
        self.write_empty(tile.place + 1, done, memory);
        done
    }

    /// Columns and rows of a tile in the picture.
    fn area(&self, place: usize) -> [Range<u32>; 2] {
        let side = self.t.timing.tile.side_px;
        let corner =
            [place % self.lists.columns, place / self.lists.columns].map(|at| at as u32 * side);
        [(corner[0], self.work.width), (corner[1], self.work.height)]
            .map(|(from, size)| from..size.min(from + side))
    }

    /// Writes the words of a tile.
    fn write(&self, place: usize, when: u64, memory: &mut Memory) {
        let side = self.t.timing.tile.side_px;
        let [columns, rows] = self
            .area(place)
            .map(|pixels| u64::from(pixels.end - pixels.start));
        let address = WORDS + place as u64 * u64::from(side * side * self.t.frame_bytes);
        memory.post_write(
            when,
            Requester::FrameWrite,
            address,
            columns * rows * u64::from(self.t.frame_bytes),
        );
    }

    /// Tiles without entries are background. They are written after the previous tile of the
    /// picture.
    fn write_empty(&self, first: usize, when: u64, memory: &mut Memory) {
        (first..self.lists.tiles())
            .take_while(|tile| self.lists.of(*tile).is_empty())
            .for_each(|tile| self.write(tile, when, memory));
    }
}

/// Cycles of the tiles of a box, which `bin` takes in groups: a group ends with its last test, and
/// entries leave in the order of tiles.
struct Groups {
    size: u32,
    tiles: u32,
    /// Cycles of the groups before, and of this one so far.
    before: u64,
    own: u64,
}

impl Groups {
    fn new(t: &Microarchitecture) -> Self {
        Groups {
            size: t.tiles_per_cycle,
            tiles: 0,
            before: 0,
            own: 0,
        }
    }

    /// The cycle in which the next tile has been tested, by the cycles of its test.
    #[inline(always)]
    fn next(&mut self, cycles: u64) -> u64 {
        if self.tiles == self.size {
            (self.before, self.own, self.tiles) = (self.before + self.own, 0, 0);
        }
        self.tiles += 1;
        self.own = self.own.max(cycles);
        self.cycles()
    }

    /// The cycle in which all tiles so far have been tested.
    fn cycles(&self) -> u64 {
        self.before + self.own
    }
}

/// Boxes of all splats in memory, in the order of the scene: those of the frame before are read, and
/// those of this frame written for the next one. Two bursts are read ahead.
struct Boxes {
    burst: u64,
    /// Bursts of all boxes.
    all: u64,
    /// For each burst that was requested, the arrival of it and of those before it.
    here: Vec<u64>,
    /// Bursts that are written.
    gone: u64,
}

impl Boxes {
    fn new(t: &Microarchitecture, work: &Work) -> Self {
        let burst = u64::from(t.timing.memory.burst_bytes);
        let bytes = work.cull_reasons.len() as u64 * u64::from(BOX_BYTES);
        Boxes {
            burst,
            all: bytes.div_ceil(burst),
            here: Vec::new(),
            gone: 0,
        }
    }

    /// Requests bursts up to a number of them.
    fn request(&mut self, until: u64, now: u64, memory: &mut Memory) {
        for nth in self.here.len() as u64..until.min(self.all) {
            let address = BOXES[0] + nth * self.burst;
            let read = Direction::Read;
            let here = memory.request(now, Requester::Binning, read, address, self.burst);
            let before = self.here.last().copied().unwrap_or_default();
            self.here.push(here.max(before));
        }
    }

    /// `bin` can take a splat in this cycle; returns the cycle from which the box of the splat has
    /// arrived.
    fn read(&mut self, splat: u32, now: u64, memory: &mut Memory) -> u64 {
        let of = u64::from(splat) * u64::from(BOX_BYTES) / self.burst;
        self.request(of + 2, now, memory);
        self.here[of as usize]
    }

    /// Addresses of the bursts that are full with the box of a splat.
    fn written(&mut self, splat: u32) -> impl Iterator<Item = u64> + use<> {
        let (from, burst) = (self.gone, self.burst);
        self.gone = (u64::from(splat) + 1) * u64::from(BOX_BYTES) / burst;
        (from..self.gone).map(move |full| BOXES[1] + full * burst)
    }

    /// Reads and writes the rest in a cycle; returns the cycle in which this is done.
    fn end(&mut self, now: u64, memory: &mut Memory) -> u64 {
        self.request(self.all, now, memory);
        let mut done = now.max(self.here.last().copied().unwrap_or_default());
        for full in self.gone..self.all {
            let address = BOXES[1] + full * self.burst;
            done = done.max(memory.request(
                now,
                Requester::Binning,
                Direction::Write,
                address,
                self.burst,
            ));
        }
        done
    }
}

/// Sets up all splats and writes the lists; returns the cycle in which they are written.
fn first_pass<'a>(
    t: &'a Microarchitecture,
    work: &'a Work,
    lists: &Lists,
    memory: &mut Memory,
    detail: Detail,
) -> (SetUp<'a>, Unit, u64) {
    let side = t.timing.tile.side_px as usize;
    let burst = u64::from(t.timing.memory.burst_bytes);
    let mut setup = SetUp::new(t, work, "bin", memory, detail);
    let one = Pace {
        units: 1,
        latency: 1,
        interval: 1,
        fifo: 1,
    };
    let mut bin = Unit::new(
        "bin",
        one,
        [Some(SetUp::last_name(t, work)), None],
        detail,
        t.lifted,
    );
    let each = u64::from(!bin.is_lifted());
    // Records and entries leave the unit behind the test.
    let tested = t.bin.map_or(0, |bin| u64::from(bin.latency));
    // Sorters load entries with keys, from separate lists.
    let keyed_bytes = t
        .sort
        .filter(|sort| sort.sorter.is_some() && work.is_sorted())
        .map(|sort| u64::from(sort.entry_bytes));
    let entry_bytes = keyed_bytes.unwrap_or(t.entry_bytes().into());
    let list = |tile: usize| {
        if keyed_bytes.is_some() {
            sorters::keyed(t, tile)
        } else {
            list_address(t, tile)
        }
    };
    let mut outstanding = Outstanding::new(t.timing.memory.outstanding);
    let mut lengths = vec![0u64; lists.tiles()];
    let mut cull_reasons = work.cull_reasons.iter().zip(0..).peekable();
    // Splats that have left setup: the cycles in which bin can take them.
    let mut ahead = VecDeque::new();
    // Whether the next burst of records has begun.
    let (mut record_bursts, mut begun, mut end) = (0, false, 0);
    let mut boxes = lists.are_kept().then(|| Boxes::new(t, work));
    for (nth, footprint) in work.footprints.iter().enumerate() {
        // Fetches before the cycle in which bin takes the next splat send their requests first, if
        // there is room.
        while let Some((cull_reason, index)) =
            cull_reasons.next_if(|(_, index)| match ahead.front() {
                Some(here) => {
                    setup.is_scheduled()
                        && setup.when(*index) <= bin.free().max(outstanding.free()).max(*here)
                }
                None => true,
            })
        {
            if let Some(here) = setup.splat(index, *cull_reason, memory) {
                ahead.push_back(here);
                memory.forget(setup.fetched);
            }
        }
        let Some(here) = ahead.pop_front() else { break };
        let mut groups = Groups::new(t);
        lists.each(nth, footprint, side, |tile, _| {
            groups.next(lists.test_cycles(footprint, tile));
        });
        let tiles = groups.cycles();
        let boxed = boxes.as_mut().map_or(0, |boxes| {
            let from = bin.free().max(here).max(outstanding.free());
            boxes.read(footprint.splat, from, memory)
        });
        // A record, then one group of tiles per cycle: their tests, their entries. Writes are
        // queued.
        let now = bin.take(
            Ready {
                here,
                memory: outstanding.free().max(boxed),
                ..Ready::default()
            },
            1 + tiles,
        );
        setup.give(here, now);
        let mut write = |when: u64, address: u64| {
            let done = memory.request(when, Requester::Binning, Direction::Write, address, burst);
            outstanding.push(done);
            end = end.max(done);
        };
        // Records are consecutive: a burst is written when it is full. Those of kept lists have
        // the places of their splats in the scene, and gaps: the burst of the last record is
        // written before another one is begun.
        let place = match boxes {
            Some(_) => u64::from(footprint.splat),
            None => nth as u64,
        };
        let bytes = u64::from(t.prepared_bytes);
        let first = place * bytes / burst;
        if boxes.is_some() && begun && record_bursts < first {
            write(now + tested, RECORDS + record_bursts * burst);
        }
        if boxes.is_some() {
            record_bursts = record_bursts.max(first);
        }
        let full = (place + 1) * bytes / burst;
        (record_bursts..full).for_each(|full| write(now + tested, RECORDS + full * burst));
        record_bursts = full;
        begun = !((place + 1) * bytes).is_multiple_of(burst);
        if let Some(boxes) = &mut boxes {
            boxes
                .written(footprint.splat)
                .for_each(|address| write(now, address));
        }
        let mut groups = Groups::new(t);
        lists.each(nth, footprint, side, |tile, is_listed| {
            let when = now + tested + each * groups.next(lists.test_cycles(footprint, tile));
            if !is_listed {
                return;
            }
            lengths[tile] += 1;
            // An entry is not longer than a burst. A burst is therefore full if less than an entry
            // is behind it.
            let end = lengths[tile] * entry_bytes;
            let behind = end % burst;
            if behind < entry_bytes {
                write(when, list(tile) + end - behind - burst);
            }
        });
        end = end.max(now + tested + each * groups.cycles() + 1);
    }
    for (cull_reason, index) in cull_reasons {
        setup.splat(index, *cull_reason, memory);
    }
    setup.end(memory);
    // The rest of the last records and of every list.
    let last = end;
    if let Some(boxes) = &mut boxes {
        end = end.max(boxes.end(last, memory));
    }
    if begun {
        end = end.max(memory.request(
            last,
            Requester::Binning,
            Direction::Write,
            RECORDS + record_bursts * burst,
            burst,
        ));
    }
    for (tile, length) in lengths
        .into_iter()
        .enumerate()
        .filter(|(_, length)| !(length * entry_bytes).is_multiple_of(burst))
    {
        let address = list(tile) + length * entry_bytes / burst * burst;
        end = end.max(memory.request(last, Requester::Binning, Direction::Write, address, burst));
    }
    (setup, bin, end)
}

/// Bytes per read of the sort.
const SORT_BYTES: u64 = 1 << 12;
/// Address of the sort's entries, behind all lists.
const SORTED: u64 = 1 << 60;

/// Radix sort of all lists' entries by depth. A pass per digit of the key reads every entry and
/// writes it to its new address, one entry per cycle, after one cycle per value of the digit for
/// the sums of counts. Returns its unit, and the cycle in which it is done.
fn sort_entries(
    t: &Microarchitecture,
    entries: u64,
    from: u64,
    memory: &mut Memory,
    detail: Detail,
) -> (Vec<Unit>, u64) {
    let one = Pace {
        units: 1,
        latency: 1,
        interval: 1,
        fifo: 1,
    };
    let mut sort = Unit::new(
        unit::SORT,
        one,
        [Some("bin"), Some("list")],
        detail,
        t.lifted,
    );
    let Some(shape) = t.sort else {
        return (vec![sort], from);
    };
    let mut now = from;
    for pass in 0..u64::from(shape.passes) {
        let busy = if sort.is_lifted() {
            0
        } else {
            entries + (1 << shape.digit_bits)
        };
        let bytes = entries * u64::from(shape.entry_bytes);
        let [source, target] = [pass % 2, (pass + 1) % 2].map(|half| SORTED + half * (1 << 40));
        let (mut done, mut moved) = (now, 0);
        while moved < bytes {
            let part = SORT_BYTES.min(bytes - moved);
            let requested = done.max(
                now + if sort.is_lifted() {
                    0
                } else {
                    moved / u64::from(shape.entry_bytes)
                },
            );
            let here = memory.request(
                requested,
                Requester::Sort,
                Direction::Read,
                source + moved,
                part,
            );
            done = memory.request(
                here,
                Requester::Sort,
                Direction::Write,
                target + moved,
                part,
            );
            moved += part;
        }
        let cycles = busy.max(done - now);
        sort.take_with_memory(
            Ready {
                here: now,
                ..Ready::default()
            },
            busy,
            cycles,
        );
        now += cycles;
        memory.forget(now);
    }
    (vec![sort], now)
}

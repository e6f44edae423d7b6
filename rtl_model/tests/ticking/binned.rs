//! What does the binned machine do in each cycle? It has two passes: it writes lists, then it draws
//! tile after tile on chip.
//!
//! Between the passes a machine that sorts goes through all entries once per digit of their depths.
//! A pass takes one cycle per entry and one per value of the digit. It moves entries in parts of
//! 4096 bytes. A part is read after the part before is written, and not before the turn of its
//! first entry; it is written when it has arrived. A pass ends when it has no more to do and the
//! last part is written.
//!
//! Alternatively, sorters sort list after list (`sorters.rs`). Then `bin` writes entries with their
//! keys.
//!
//! `bin` writes a record, then one entry per cycle. With a test of tiles it tests one tile per
//! cycle instead, and all that it writes is later by the latency of the test. A burst is sent when it is full; after the last
//! word all partial bursts are sent. `list` reads entries and the records that they point to.
//! Fragments stall until a buffer is free. A tile is resolved when the last of its stamps is
//! written or skipped; a stopped tile when none of its stamps is in flight.
//!
//! If entries have masks, raster walks the set subtiles of an entry in rectangles: as many
//! adjacent ones of a row as are set, together with the rectangle before if that has the same columns
//! and ends directly above. Each rectangle except the first takes a cycle more, for its seed. An
//! entry without a set subtile takes raster a cycle. `bin` or `list` tests the subtiles that the box
//! touches, some of them in each cycle. `list` tests an entry when its record has arrived and the
//! entry before is tested; raster can take the entry when its mask is ready. A contribution test
//! does the same with the blocks that the box touches; its results are those of the record.
//!
//! Raster skips a stopped pixel from the cycle on in which the stamp that stopped it is written.
//! When all pixels of a tile have stopped, list skips the rest of the tile in no time, and raster
//! drops the entries that have arrived, one per cycle. Raster skips stamps of which every pixel has
//! stopped in no time; an entry without a remaining stamp takes it one cycle.

use super::memory::{Done, LIST_BYTES, LISTS, Memory, RECORDS, Requests, WORDS, apart};
use super::parts::{
    Act, Fill, HELD, Link, Merge, SetupUnits, Stamp, TexelShade, Ticked, TickedUnit, light, places,
    resolve, resolve_cycles, resolve_texels, run, stamps_of, texels_looked_up, turn,
};
use super::scene::{KeptEntry, Scene, Splat};
use super::sorters::{self, Sorters};
use rtl_model::elaboration::masks::Masks;
use rtl_model::elaboration::microarchitecture::{Microarchitecture, Pace, SortShape};
use rtl_model::machine::MaskMaker;
use rtl_model::machine::timing::Queue;
use rtl_model::timing::{Direction, Requester};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::ops::Range;

/// Bytes of a list's entry: a number, and the mask if `bin` makes it.
fn entry_bytes(timing: &Microarchitecture) -> u64 {
    let masks = timing.bin.and_then(|bin| bin.masks);
    let masks = masks.filter(|masks| masks.made == MaskMaker::Bin);
    let subtiles = masks.map_or(0, |masks| {
        (timing.timing.tile.side_px / masks.subtile_px).pow(2)
    });
    4 + u64::from(subtiles).div_ceil(8)
}

/// Columns and rows, first and last.
type Rectangle = [[usize; 2]; 2];

/// The part of a splat's box in a tile.
fn part_in(timing: &Microarchitecture, splat: &Splat, corner: [usize; 2]) -> Rectangle {
    let side = timing.timing.tile.side_px as usize;
    [splat.columns, splat.rows]
        .into_iter()
        .zip(corner)
        .map(|([first, last], corner)| {
            [
                usize::from(first).max(corner),
                usize::from(last).min(corner + side - 1),
            ]
        })
        .collect::<Vec<_>>()
        .try_into()
        .expect("two sides")
}

/// Masks of entries: of a test of tiles, or of blocks, which is in front of each engine's raster.
fn masks_of(timing: &Microarchitecture) -> Option<Masks> {
    match timing.contribution {
        Some(blocks) => blocks.masks,
        None => timing.bin.and_then(|bin| bin.masks),
    }
}

/// Cycles of the tests of a splat in a tile, if masks are made there.
fn mask_cycles(
    timing: &Microarchitecture,
    made: MaskMaker,
    splat: &Splat,
    corner: [usize; 2],
) -> Option<u64> {
    let masks = masks_of(timing).filter(|masks| masks.made == made)?;
    let side = timing.timing.tile.side_px as usize;
    let meets = |[first, last]: [u16; 2], from: usize| {
        usize::from(first) < from + side && usize::from(last) >= from
    };
    // A departed entry takes a cycle.
    if splat.pixels.is_empty() || !meets(splat.columns, corner[0]) || !meets(splat.rows, corner[1])
    {
        return Some(1);
    }
    let subtile = masks.subtile_px as usize;
    let [columns, rows] = part_in(timing, splat, corner);
    let touched: BTreeSet<[usize; 2]> = (columns[0]..=columns[1])
        .flat_map(|x| (rows[0]..=rows[1]).map(move |y| [x, y]))
        .map(|[x, y]| [(x - corner[0]) / subtile, (y - corner[1]) / subtile])
        .collect();
    Some(touched.len().div_ceil(masks.tests as usize) as u64)
}

/// Stamps of a splat in a tile, with the seeds of rectangles between them.
fn stamps_in(
    timing: &Microarchitecture,
    scene: &Scene,
    place: usize,
    (tile, corner): (usize, [usize; 2]),
) -> VecDeque<Stamp> {
    let side = timing.timing.tile.side_px as usize;
    let departed = |entry: &KeptEntry| entry.place == place && entry.has_departed;
    if (scene.kept.as_ref()).is_some_and(|kept| kept.lists[tile].iter().any(departed)) {
        return VecDeque::new();
    }
    let Some(masks) = masks_of(timing) else {
        let last = corner.map(|at| at + side - 1);
        return stamps_of(timing, scene, place, [corner, last]);
    };
    let subtile = masks.subtile_px as usize;
    let mask = scene.masks[&(place, tile)];
    let is_set = |x: usize, y: usize| {
        let [x, y] = [(x - corner[0]) / subtile, (y - corner[1]) / subtile];
        mask >> (y * (side / subtile) + x) & 1 == 1
    };
    let [columns, rows] = part_in(timing, &scene.splats[place], corner);
    // Columns of the rectangles that have a row, and rows with the same ones.
    let mut rectangles: Vec<Rectangle> = Vec::new();
    let mut y = rows[0];
    while y <= rows[1] {
        let below = (corner[1] + ((y - corner[1]) / subtile + 1) * subtile).min(rows[1] + 1);
        let set: Vec<usize> = (columns[0]..=columns[1])
            .filter(|x| is_set(*x, y))
            .collect();
        for columns in set.chunk_by(|one, next| one + 1 == *next) {
            let columns = [columns[0], *columns.last().expect("a column")];
            match rectangles.last_mut() {
                Some([above, [_, end]]) if *above == columns && *end + 1 == y => *end = below - 1,
                _ => rectangles.push([columns, [y, below - 1]]),
            }
        }
        y = below;
    }
    let width = scene.width as usize;
    let mut all = VecDeque::new();
    for (nth, [columns, rows]) in rectangles.into_iter().enumerate() {
        if nth > 0 {
            all.push_back(Stamp {
                is_seed: true,
                tested: (rows[0]..=rows[1])
                    .flat_map(|y| (columns[0]..=columns[1]).map(move |x| y * width + x))
                    .collect(),
                ..Stamp::default()
            });
        }
        let corners = [0, 1].map(|end| [columns[end], rows[end]]);
        all.extend(stamps_of(timing, scene, place, corners));
    }
    all
}
/// Bytes of a box, and the places of those of the frame before and of this one.
const BOX_BYTES: u64 = 8;
const OLD_BOXES: u64 = 7 << 40;
const NEW_BOXES: u64 = (7 << 40) + (1 << 39);
/// Bytes sorted at a time, and the two halves of memory between which they move.
const PART_BYTES: u64 = 4096;
const HALVES: [u64; 2] = [1 << 60, (1 << 60) + (1 << 40)];

/// A splat in a tile.
struct Entry {
    splat: usize,
    /// Number of splats drawn before it.
    record: u64,
    corner: [usize; 2],
    /// Place of its tile in the picture, and its own place in the tile's list.
    tile: u64,
    nth: u64,
    /// Index of its tile among tiles with entries, and the number of its stamps with a weight
    /// there.
    drawn: usize,
    stamps: usize,
    /// Its splat has departed from a kept list.
    has_departed: bool,
}

/// A tile with entries.
struct ListedTile {
    corner: [usize; 2],
    place: u64,
    entries: Range<usize>,
    /// Stamps with a weight that are neither written nor skipped, and the cycle of the last of the
    /// others.
    left: usize,
    last: u64,
    /// Stamps with a weight between raster and fragment.
    under_way: usize,
    /// Pixels of the tile.
    pixels: Vec<usize>,
}

/// Order in which tiles are drawn. Lengths beyond two digits of 256 values count as the greatest.
fn queue(timing: &Microarchitecture, tiles: &[ListedTile]) -> VecDeque<usize> {
    let mut all: Vec<usize> = (0..tiles.len()).collect();
    if timing.timing.queue == Queue::Longest {
        all.sort_by_key(|tile| {
            (
                65_535usize.saturating_sub(tiles[*tile].entries.len()),
                *tile,
            )
        });
    }
    all.into()
}

struct BinnedMachine<'a> {
    timing: &'a Microarchitecture,
    scene: &'a Scene,
    memory: Memory,
    now: u64,
    /// First pass.
    setup: SetupUnits<'a>,
    /// For each splat the tiles that it touches; the number of splats that touch any.
    touched: Vec<Vec<usize>>,
    drawn: usize,
    bin: TickedUnit,
    writes: Requests,
    record_bytes: u64,
    /// The burst of records that has begun, if records have the places of their splats.
    open_record: Option<u64>,
    /// Bursts of boxes of the frame before that were requested, and bursts of boxes of this frame
    /// that were written.
    boxes: Vec<Done>,
    boxes_gone: u64,
    list_bytes: Vec<u64>,
    /// Cycle after that of the last entry.
    binned: u64,
    /// The last bytes of records and lists are sent; all lists are in memory; they are sorted.
    flushed: bool,
    listed_all: bool,
    sorted: bool,
    /// All sorters have ended, which may be later than the beginning of the second pass.
    sorters_ended: bool,
    sort: TickedUnit,
    /// Passes begun, start of the last one, bytes that it has moved, and the part in flight, to be
    /// read or written.
    passes: u32,
    begun: u64,
    moved: u64,
    part: Option<(Done, Direction)>,
    /// Replaces all of the above.
    sorters: Option<Sorters>,
    /// Second pass: its first cycle, and all entries, tile by tile.
    from: u64,
    entries: Vec<Entry>,
    tiles: Vec<ListedTile>,
    /// Tiles without an entry: number of tiles with entries before them, and the place in the
    /// picture.
    empty: Vec<(usize, u64)>,
    /// Tiles that no engine has taken, and all tiles in the same order.
    queue: VecDeque<usize>,
    in_turn: Vec<usize>,
    engines: Vec<Engine>,
    words: Requests,
}

/// All units after the lists.
struct Engine {
    /// Tiles taken, those of them that are resolved, and when each left its buffer.
    taken: Vec<usize>,
    resolved: Vec<u64>,
    /// Entries of the tile that list has not taken, and the entry that raster processes.
    next: Range<usize>,
    looked_at: usize,
    list: TickedUnit,
    reads: Requests,
    /// Burst of the list that holds the last entry; entries whose records are read after a burst;
    /// each entry's record.
    burst: Done,
    waiting: VecDeque<(Done, usize)>,
    records: BTreeMap<usize, Done>,
    listed: Link<usize>,
    /// Entries whose mask list has not made, with the cycles in which they arrive; when it can test
    /// the next; and when each mask is ready.
    unmasked: VecDeque<(u64, usize)>,
    tests_from: u64,
    masked: BTreeMap<usize, u64>,
    /// Entries that are to be written back for the next frame, with the cycles from which they are
    /// known, and the bytes of the current list.
    returning: VecDeque<(u64, usize)>,
    returned: u64,
    fill: Fill,
    merge: Merge,
    resolve: Vec<TickedUnit>,
    lit: TickedUnit,
    to_light: VecDeque<(u64, u64, Option<usize>)>,
    /// Reflecting shade unit of resolve; and the tile for whose light resolve stalls: its index, when
    /// it was taken, how long it takes, and when it is done without stalls.
    mirror: Option<TexelShade>,
    unwritten: Option<(usize, [u64; 3])>,
}

impl Engine {
    fn new(timing: &Microarchitecture, scene: &Scene) -> Self {
        let t = &timing.timing;
        Engine {
            taken: Vec::new(),
            resolved: Vec::new(),
            next: 0..0,
            looked_at: 0,
            list: TickedUnit::new("list", 1),
            reads: Requests::new(t.memory.outstanding),
            burst: Done::default(),
            waiting: VecDeque::new(),
            records: BTreeMap::new(),
            listed: Link::new(places(Pace {
                units: 1,
                latency: 1,
                interval: 1,
                fifo: t.fetch.fifo,
            })),
            unmasked: VecDeque::new(),
            tests_from: 0,
            masked: BTreeMap::new(),
            returning: VecDeque::new(),
            returned: 0,
            fill: Fill::new(timing).leaving_out((scene.width * scene.height) as usize),
            merge: Merge::new(timing, scene),
            resolve: TickedUnit::each("resolve", timing.resolve.units),
            lit: TickedUnit::new("resolve-shade", timing.shade.units),
            to_light: VecDeque::new(),
            mirror: TexelShade::new(timing, scene),
            unwritten: None,
        }
    }

    fn is_done(&self, now: u64) -> bool {
        self.next.start == self.next.end
            && self.listed.items.is_empty()
            && self.returning.is_empty()
            && self.fill.is_done(now)
            && self.merge.is_done(now)
            && self.resolved.len() >= self.taken.len()
            && self.to_light.is_empty()
            && self
                .mirror
                .as_ref()
                .is_none_or(|mirror| mirror.queue.is_empty())
            && [&self.list, &self.lit]
                .into_iter()
                .chain(&self.resolve)
                .all(|unit| unit.is_idle(now))
    }

    /// Its units in the order of the diagram, with the numbers that they have among all engines.
    fn units(self, timing: &Microarchitecture, nth: u32) -> Vec<TickedUnit> {
        let (fragment, shade) = self.merge.units();
        let numbered = |units: Vec<TickedUnit>, each: u32| {
            units
                .into_iter()
                .map(|unit| unit.of_engine(nth, each))
                .collect::<Vec<_>>()
        };
        let lit = if timing.timing.tile.buffers == 2 {
            vec![self.lit]
        } else {
            Vec::new()
        };
        [
            numbered(vec![self.list.before(self.listed)], 1),
            numbered(self.fill.units(), 1),
            numbered(fragment, timing.fragment.units),
            numbered(vec![shade], timing.shade.units),
            numbered(lit, timing.shade.units),
            numbered(self.resolve, timing.resolve.units),
        ]
        .concat()
    }
}

impl<'a> BinnedMachine<'a> {
    fn new(timing: &'a Microarchitecture, scene: &'a Scene) -> Self {
        let t = &timing.timing;
        let side = t.tile.side_px as usize;
        let across = (scene.width as usize).div_ceil(side);
        let down = (scene.height as usize).div_ceil(side);
        let mut touched = vec![Vec::new(); scene.splats.len()];
        let in_order = scene.in_order();
        let (mut entries, mut tiles, mut empty) = (Vec::new(), Vec::new(), Vec::new());
        for tile in 0..across * down {
            let corner = [tile % across * side, tile / across * side];
            let (mut nth, mut left) = (0, 0);
            for &(record, place) in &in_order {
                let splat = &scene.splats[place];
                let meets = |[first, last]: [u16; 2], from: usize| {
                    usize::from(first) < from + side && usize::from(last) >= from
                };
                if !meets(splat.columns, corner[0]) || !meets(splat.rows, corner[1]) {
                    continue;
                }
                touched[place].push(tile);
                if scene.unlisted.contains(&(place, tile)) {
                    continue;
                }
                let stamps = stamps_in(timing, scene, place, (tile, corner));
                let stamps = stamps
                    .iter()
                    .filter(|stamp| !stamp.pixels.is_empty())
                    .count();
                let drawn = tiles.len();
                entries.push(Entry {
                    has_departed: false,
                    splat: place,
                    record: record as u64,
                    corner,
                    tile: tile as u64,
                    nth,
                    drawn,
                    stamps,
                });
                left += stamps;
                nth += 1;
            }
            // A kept list has the same splats in the same order, and those that have departed.
            if let Some(kept) = &scene.kept {
                let first = entries.len() - nth as usize;
                let mut here: VecDeque<Entry> = entries.drain(first..).collect();
                for (nth, kept) in kept.lists[tile].iter().enumerate() {
                    let (record, nth) = (kept.place as u64, nth as u64);
                    entries.push(if kept.has_departed {
                        Entry {
                            splat: kept.place,
                            record,
                            corner,
                            tile: tile as u64,
                            nth,
                            drawn: tiles.len(),
                            stamps: 0,
                            has_departed: true,
                        }
                    } else {
                        let own = here.pop_front().expect("an entry");
                        assert_eq!(own.splat, kept.place);
                        Entry { record, nth, ..own }
                    });
                }
                nth = kept.lists[tile].len() as u64;
            }
            match nth {
                0 => empty.push((tiles.len(), tile as u64)),
                _ => {
                    let [width, height] = [scene.width, scene.height].map(|size| size as usize);
                    let rows = corner[1]..height.min(corner[1] + side);
                    let pixels = rows
                        .flat_map(|y| {
                            (corner[0]..width.min(corner[0] + side)).map(move |x| y * width + x)
                        })
                        .collect();
                    let entries = entries.len() - nth as usize..entries.len();
                    tiles.push(ListedTile {
                        corner,
                        place: tile as u64,
                        entries,
                        left,
                        last: 0,
                        under_way: 0,
                        pixels,
                    });
                }
            }
        }
        // Lists in write order.
        let listed = |tile: &ListedTile| {
            let mut splats: Vec<usize> = entries[tile.entries.clone()]
                .iter()
                .map(|entry: &Entry| entry.splat)
                .collect();
            splats.sort_unstable();
            (
                tile.place,
                splats
                    .into_iter()
                    .map(|splat| scene.keys.get(splat).copied().unwrap_or(0))
                    .collect(),
            )
        };
        let sorts_ahead = timing.sort.and_then(|sort| sort.sorter);
        let lists = match sorts_ahead.is_some_and(|sorter| sorter.overlap) {
            true => (queue(timing, &tiles).iter())
                .map(|tile| listed(&tiles[*tile]))
                .collect(),
            false => tiles.iter().map(listed).collect(),
        };
        let is_sorted = !scene.order.is_empty() || scene.kept.is_some();
        let sorters = timing.sort.filter(|_| is_sorted);
        let mut sorters =
            sorters.and_then(|shape| Sorters::new(shape, t.memory, entry_bytes(timing), lists));
        if let (Some(sorters), Some(kept)) = (&mut sorters, &scene.kept) {
            let new = |list: &Vec<KeptEntry>| list.iter().map(|entry| entry.is_new).collect();
            sorters.kept = Some((kept.is_odd, (0..).zip(kept.lists.iter().map(new)).collect()));
        }
        BinnedMachine {
            sorters,
            timing,
            scene,
            memory: Memory::new(t.memory),
            now: 0,
            setup: SetupUnits::new(timing, scene),
            drawn: touched.iter().filter(|tiles| !tiles.is_empty()).count(),
            touched,
            bin: TickedUnit::new("bin", 1),
            writes: Requests::new(t.memory.outstanding),
            record_bytes: 0,
            open_record: None,
            boxes: Vec::new(),
            boxes_gone: 0,
            list_bytes: vec![0; across * down],
            binned: 0,
            flushed: false,
            listed_all: false,
            sorted: false,
            sorters_ended: false,
            sort: TickedUnit::new("sort", 1),
            passes: 0,
            begun: 0,
            moved: 0,
            part: None,
            from: u64::MAX,
            entries,
            queue: queue(timing, &tiles),
            in_turn: queue(timing, &tiles).into(),
            tiles,
            empty,
            engines: (0..timing.engines)
                .map(|_| Engine::new(timing, scene))
                .collect(),
            words: Requests::new(u32::MAX),
        }
    }

    fn burst(&self) -> u64 {
        self.timing.timing.memory.burst_bytes.into()
    }

    /// Writes the burst that ends here, full or not.
    fn write(&mut self, when: u64, region: u64, end: u64) {
        let end = region + end.next_multiple_of(self.burst());
        self.memory.request(
            when,
            Requester::Binning,
            Direction::Write,
            end - self.burst()..end,
            &self.writes.next(),
        );
    }

    fn bin(&mut self) -> Act {
        let Some(&splat) = self.setup.done().front(self.now) else {
            return Act::Starve;
        };
        if !self.writes.is_free(self.now) {
            return Act::StallOnMemory;
        }
        if self.scene.kept.is_some() {
            self.read_boxes(splat as u64 * BOX_BYTES / self.burst() + 2);
            let needed = splat as u64 * BOX_BYTES / self.burst();
            if !self.boxes[..=needed as usize]
                .iter()
                .all(|here| here.is_done(self.now))
            {
                return Act::StallOnMemory;
            }
        }
        self.setup.done().pop();
        let burst = self.burst();
        // What is written leaves the test some cycles later.
        let behind = self.timing.bin.map_or(0, |bin| u64::from(bin.latency));
        if self.scene.kept.is_some() {
            self.write_in_place(splat as u64);
        } else {
            let before = self.record_bytes / burst;
            self.record_bytes += u64::from(self.timing.prepared_bytes);
            (before + 1..=self.record_bytes / burst)
                .for_each(|full| self.write(self.now + behind, RECORDS, full * burst));
        }
        // Some tiles are tested at a time; the next ones wait for the slowest of them. Entries leave in
        // order.
        let (mut when, mut group_from) = (self.now, self.now);
        for (place, tile) in self.touched[splat].clone().into_iter().enumerate() {
            if place.is_multiple_of(self.timing.tiles_per_cycle as usize) {
                group_from = when;
            }
            let side = self.timing.timing.tile.side_px as usize;
            let across = (self.scene.width as usize).div_ceil(side);
            let corner = [tile % across * side, tile / across * side];
            let of_splat = &self.scene.splats[splat];
            let cycles = mask_cycles(self.timing, MaskMaker::Bin, of_splat, corner).unwrap_or(1);
            when = when.max(group_from + cycles);
            if self.scene.unlisted.contains(&(splat, tile)) {
                continue;
            }
            // Others are kept from the frame before.
            let is_new = |entry: &KeptEntry| entry.place == splat && entry.is_new;
            if self
                .scene
                .kept
                .as_ref()
                .is_some_and(|kept| !kept.lists[tile].iter().any(is_new))
            {
                continue;
            }
            let before = self.list_bytes[tile] / burst;
            self.list_bytes[tile] += if self.sorters.is_some() {
                self.shape().entry_bytes.into()
            } else {
                entry_bytes(self.timing)
            };
            if self.list_bytes[tile] / burst > before {
                self.write(
                    when + behind,
                    self.place_of_list(tile),
                    (before + 1) * burst,
                );
            }
        }
        self.binned = when + behind + 1;
        Act::Take(when + 1 - self.now)
    }

    /// Requests boxes of the frame before, up to this number of bursts.
    fn read_boxes(&mut self, until: u64) {
        let all = (self.scene.splats.len() as u64 * BOX_BYTES).div_ceil(self.burst());
        while (self.boxes.len() as u64) < until.min(all) {
            let here = Done::default();
            let from = OLD_BOXES + self.boxes.len() as u64 * self.burst();
            self.memory.request(
                self.now,
                Requester::Binning,
                Direction::Read,
                from..from + self.burst(),
                &here,
            );
            self.boxes.push(here);
        }
    }

    /// Writes what is complete with the record and the box of a splat. A record is at the place of
    /// its splat in the scene.
    fn write_in_place(&mut self, splat: u64) {
        let (burst, bytes) = (self.burst(), u64::from(self.timing.prepared_bytes));
        let (from, to) = (splat * bytes, (splat + 1) * bytes);
        if let Some(open) = self.open_record.take_if(|open| *open < from / burst) {
            self.write(self.now, RECORDS, (open + 1) * burst);
        }
        (from / burst..to / burst).for_each(|full| {
            self.write(self.now, RECORDS, (full + 1) * burst);
        });
        self.open_record = (to % burst > 0).then_some(to / burst);
        while (self.boxes_gone + 1) * burst <= (splat + 1) * BOX_BYTES {
            self.boxes_gone += 1;
            self.write(self.now, NEW_BOXES, self.boxes_gone * burst);
        }
    }

    fn place_of_list(&self, tile: usize) -> u64 {
        let memory = &self.timing.timing.memory;
        if self.sorters.is_some() {
            sorters::keyed(memory, tile as u64)
        } else {
            LISTS + tile as u64 * apart(memory, LIST_BYTES)
        }
    }

    /// Sends the remaining bytes when all splats have been binned.
    fn flush(&mut self) {
        if self.listed_all
            || self.bin.log.len() < self.drawn
            || self.binned > self.now
            || !self.writes.are_all_done(self.now)
        {
            return;
        }
        if !std::mem::replace(&mut self.flushed, true) {
            if self.scene.kept.is_some() {
                let before = self.boxes.len();
                self.read_boxes(u64::MAX);
                let requested = self.boxes[before..].to_vec();
                self.writes.issued.extend(requested);
                let bytes = self.scene.splats.len() as u64 * BOX_BYTES;
                while self.boxes_gone * self.burst() < bytes {
                    self.boxes_gone += 1;
                    self.write(self.now, NEW_BOXES, self.boxes_gone * self.burst());
                }
                if let Some(open) = self.open_record {
                    self.write(self.now, RECORDS, (open + 1) * self.burst());
                }
            }
            let lists = self
                .list_bytes
                .clone()
                .into_iter()
                .enumerate()
                .map(|(tile, bytes)| (self.place_of_list(tile), bytes));
            for (region, bytes) in [(RECORDS, self.record_bytes)]
                .into_iter()
                .chain(lists)
                .collect::<Vec<_>>()
            {
                if !bytes.is_multiple_of(self.burst()) {
                    self.write(self.now, region, bytes);
                }
            }
        }
        self.listed_all = self.writes.are_all_done(self.now);
        if self.listed_all && !self.sorts() {
            self.begin_second_pass();
        }
    }

    /// Begins the second pass once all lists are written. If the longest is drawn first, their
    /// lengths are sorted first: by two digits, with one cycle per tile with entries and one per
    /// value for each digit.
    fn begin_second_pass(&mut self) {
        let by_length = self.timing.timing.queue == Queue::Longest;
        self.sorted = true;
        self.from = self.now
            + if by_length {
                2 * (self.tiles.len() as u64 + 256)
            } else {
                0
            };
        self.leave_out(self.from, 0);
    }

    fn sorts(&self) -> bool {
        !self.scene.order.is_empty() || self.scene.kept.is_some()
    }

    fn shape(&self) -> SortShape {
        self.timing.sort.expect("a machine that sorts")
    }

    /// Bytes of all entries to sort.
    fn sorted_bytes(&self) -> u64 {
        self.entries.len() as u64 * u64::from(self.shape().entry_bytes)
    }

    fn sort_in_cycle(&mut self) {
        let now = self.now;
        let is_time = self.listed_all && !self.sorters_ended;
        let Some(sorters) = &mut self.sorters else {
            self.move_part();
            turn(self, now, |m| &mut m.sort, Self::sort);
            return self.move_part();
        };
        if !is_time {
            return sorters.idle(now);
        }
        let overlap = sorters.overlap();
        self.sorters_ended = sorters.tick(now, &mut self.memory);
        if !self.sorted && (overlap || self.sorters_ended) {
            self.begin_second_pass();
        }
    }

    fn sort(&mut self) -> Act {
        if !self.sorts() || !self.listed_all || self.sorted {
            return Act::Starve;
        }
        let shape = self.shape();
        if self.passes > 0 && (self.part.is_some() || self.moved < self.sorted_bytes()) {
            return Act::StallOnMemory;
        }
        if self.passes == shape.passes {
            self.begin_second_pass();
            return Act::Starve;
        }
        self.passes += 1;
        (self.begun, self.moved) = (self.now, 0);
        Act::Take(self.entries.len() as u64 + (1 << shape.digit_bits))
    }

    /// Advances the part in flight, or reads the next one.
    fn move_part(&mut self) {
        if self.passes == 0 || self.sorted {
            return;
        }
        let bytes = PART_BYTES.min(self.sorted_bytes() - self.moved);
        let direction = match &self.part {
            Some((done, _)) if !done.is_done(self.now) => return,
            Some((_, Direction::Read)) => Direction::Write,
            Some((_, Direction::Write)) => {
                self.part = None;
                self.moved += bytes;
                return self.move_part();
            }
            None if bytes == 0
                || self.now < self.begun + self.moved / u64::from(self.shape().entry_bytes) =>
            {
                return;
            }
            None => Direction::Read,
        };
        let half = (self.passes as usize + usize::from(direction == Direction::Read)) % 2;
        let done = Done::default();
        self.memory.request(
            self.now,
            Requester::Sort,
            direction,
            HALVES[half] + self.moved..HALVES[half] + self.moved + bytes,
            &done,
        );
        self.part = Some((done, direction));
    }

    fn buffers(&self) -> usize {
        self.timing.timing.tile.buffers as usize
    }

    /// Writes tiles without an entry after the tile before them. `tiles` is the number of tiles
    /// with entries before them.
    fn leave_out(&mut self, when: u64, tiles: usize) {
        let empty: Vec<u64> = self
            .empty
            .iter()
            .filter(|(before, _)| *before == tiles)
            .map(|(_, place)| *place)
            .collect();
        empty
            .into_iter()
            .for_each(|place| self.write_words(when, place));
    }

    fn write_words(&mut self, when: u64, place: u64) {
        let side = u64::from(self.timing.timing.tile.side_px);
        let [width, height] = [self.scene.width, self.scene.height].map(u64::from);
        let across = width.div_ceil(side);
        let size = [(place % across, width), (place / across, height)]
            .map(|(at, size)| side.min(size - at * side));
        let [from, bytes] = [place * side * side, size[0] * size[1]]
            .map(|words| words * u64::from(self.timing.frame_bytes));
        self.memory.request(
            when,
            Requester::FrameWrite,
            Direction::Write,
            WORDS + from..WORDS + from + bytes,
            &self.words.next(),
        );
    }

    fn list(&mut self, e: usize) -> Act {
        if self.now < self.from {
            return Act::Starve;
        }
        loop {
            let next = &mut self.engines[e].next;
            if next.start == next.end {
                let is_sorted = |tile: &mut usize| match &self.sorters {
                    Some(sorters) if sorters.overlap() => {
                        sorters.complete.contains(&self.tiles[*tile].place)
                    }
                    _ => true,
                };
                let Some(tile) = self.queue.pop_front_if(is_sorted) else {
                    return Act::Starve;
                };
                self.engines[e].taken.push(tile);
                self.engines[e].next = self.tiles[tile].entries.clone();
                continue;
            }
            let number = next.start;
            let Entry { drawn, stamps, .. } = self.entries[number];
            // Every entry of a kept list is read.
            if self.scene.kept.is_some() || !self.has_stopped(e, drawn) {
                break;
            }
            self.leave_out_stamps(e, drawn, stamps);
            self.engines[e].next.start += 1;
        }
        let burst_bytes = self.burst();
        let engine = &mut self.engines[e];
        let number = engine.next.start;
        if !engine.reads.is_free(self.now) {
            return Act::StallOnMemory;
        }
        if !engine.listed.has_room() {
            return Act::Block;
        }
        let Entry { nth, tile, .. } = self.entries[number];
        let end = (nth + 1) * entry_bytes(self.timing);
        // The burst with its last byte, unless the entry before ends there too.
        let burst_of = |end: u64| end.div_ceil(burst_bytes);
        if burst_of(end) > burst_of(end - entry_bytes(self.timing)) {
            engine.burst = engine.reads.next();
            let list = LISTS + tile * apart(&self.timing.timing.memory, LIST_BYTES);
            let from = list + (burst_of(end) - 1) * burst_bytes;
            self.memory.request(
                self.now,
                Requester::Lists,
                Direction::Read,
                from..from + burst_bytes,
                &engine.burst,
            );
        }
        engine.waiting.push_back((engine.burst.clone(), number));
        let record = engine.reads.next();
        engine.records.insert(number, record);
        engine.listed.push(self.now + 1, number);
        engine.unmasked.push_back((self.now + 1, number));
        engine.returning.push_back((self.now + 1, number));
        engine.next.start += 1;
        Act::Take(1)
    }

    /// Whether every pixel of a tile has stopped.
    fn has_stopped(&self, e: usize, tile: usize) -> bool {
        self.tiles[tile]
            .pixels
            .iter()
            .all(|pixel| self.engines[e].fill.stopped[*pixel] <= self.now)
    }

    /// Removes this many stamps from a tile.
    fn leave_out_stamps(&mut self, e: usize, tile: usize, stamps: usize) {
        self.tiles[tile].left -= stamps;
        // A stopped tile waits only for stamps in flight.
        if !self.has_stopped(e, tile) {
            self.tiles[tile].last = self.tiles[tile].last.max(self.now);
        }
    }

    /// Reads records once their list entries have arrived.
    fn read_records(&mut self, e: usize) {
        let bytes = u64::from(self.timing.prepared_bytes);
        let Engine {
            waiting, records, ..
        } = &mut self.engines[e];
        waiting.retain(|(burst, number)| {
            let is_known = burst.is_done(self.now);
            if is_known {
                let from = RECORDS + self.entries[*number].record * bytes;
                self.memory.request(
                    self.now,
                    Requester::Lists,
                    Direction::Read,
                    from..from + bytes,
                    &records[number],
                );
            }
            !is_known
        });
    }

    /// Writes the entries of a kept list for the next frame, when their keys are here.
    fn write_back(&mut self, e: usize) {
        let (now, burst) = (self.now, self.burst());
        while let Some((_, number)) = {
            let Engine {
                returning, records, ..
            } = &mut self.engines[e];
            returning.pop_front_if(|(here, number)| *here <= now && records[number].is_done(now))
        } {
            if self.scene.kept.is_none() {
                continue;
            }
            let Entry {
                tile,
                has_departed,
                nth,
                drawn,
                ..
            } = self.entries[number];
            let before = self.engines[e].returned;
            let bytes = before
                + if has_departed {
                    0
                } else {
                    u64::from(self.shape().entry_bytes)
                };
            let is_last = nth + 1 == self.tiles[drawn].entries.len() as u64;
            let list = sorters::kept(&self.timing.timing.memory, tile, true);
            let until = if is_last {
                bytes.div_ceil(burst)
            } else {
                bytes / burst
            };
            for full in before / burst..until {
                let from = list + full * burst;
                self.memory.request(
                    now,
                    Requester::Lists,
                    Direction::Write,
                    from..from + burst,
                    &self.words.next(),
                );
            }
            self.engines[e].returned = if is_last { 0 } else { bytes };
        }
    }

    /// Begins the mask of the next entry, if its record has arrived and list makes masks.
    fn make_mask(&mut self, e: usize) {
        let latency = match self.timing.contribution {
            Some(blocks) => Some(blocks.latency),
            None => self.timing.bin.and_then(|bin| bin.mask_latency),
        };
        let now = self.now;
        let engine = &mut self.engines[e];
        let Some(&(here, number)) = engine.unmasked.front() else {
            return;
        };
        let Entry { splat, corner, .. } = self.entries[number];
        let splat = &self.scene.splats[splat];
        let Some(cycles) = mask_cycles(self.timing, MaskMaker::List, splat, corner) else {
            engine.masked.insert(number, 0);
            engine.unmasked.pop_front();
            return;
        };
        if here <= now && engine.tests_from <= now && engine.records[&number].is_done(now) {
            engine.unmasked.pop_front();
            engine.tests_from = now + cycles;
            let latency = u64::from(latency.expect("a latency"));
            engine.masked.insert(number, now + cycles - 1 + latency);
        }
    }

    fn raster(&mut self, e: usize) -> Act {
        self.pass_over(e);
        let now = self.now;
        let is_masked = move |engine: &Engine, number: usize| {
            engine
                .masked
                .get(&number)
                .is_some_and(|ready| *ready <= now)
        };
        let front = self.engines[e].listed.front(now).copied();
        let front = front.filter(|number| is_masked(&self.engines[e], *number));
        if !self.engines[e].fill.begun
            && let Some(number) = front
        {
            self.engines[e].looked_at = number;
            let Entry { drawn, stamps, .. } = self.entries[number];
            if self.has_stopped(e, drawn) {
                self.engines[e].listed.pop();
                self.engines[e].fill.left.clear();
                self.leave_out_stamps(e, drawn, stamps);
                self.engines[e].fill.dropped += 1;
                return Act::Take(1);
            }
        }
        let Engine {
            fill,
            listed,
            records,
            ..
        } = &mut self.engines[e];
        let mut act = fill.raster(self.now, listed, |number| {
            let Entry {
                splat,
                corner,
                drawn,
                tile,
                ..
            } = self.entries[*number];
            (front.is_some() && records[number].is_done(self.now)).then(|| {
                let tile = (tile as usize, corner);
                let mut stamps = stamps_in(self.timing, self.scene, splat, tile);
                stamps.iter_mut().for_each(|stamp| stamp.tile = drawn);
                stamps
            })
        });
        if act == Act::StallOnMemory && front.is_none() {
            act = Act::Starve;
        }
        self.count_stamps(e);
        act
    }

    /// Skips the remaining stamps of a started footprint in no time, if all their pixels have
    /// stopped.
    fn pass_over(&mut self, e: usize) {
        let fill = &mut self.engines[e].fill;
        if fill.begun {
            fill.pass_over(self.now);
            fill.begun = !fill.left.is_empty();
            self.count_stamps(e);
        }
    }

    /// Counts the stamps of the footprint that raster processes.
    fn count_stamps(&mut self, e: usize) {
        let [passed, left_out] = std::mem::take(&mut self.engines[e].fill.decided);
        let tile = self
            .entries
            .get(self.engines[e].looked_at)
            .map_or(0, |entry| entry.drawn);
        if left_out > 0 {
            self.leave_out_stamps(e, tile, left_out);
        }
        if passed > 0 {
            self.tiles[tile].under_way += passed;
        }
    }

    fn fragment(&mut self, e: usize) {
        let (now, buffers) = (self.now, self.buffers());
        let clear = u64::from(self.timing.timing.tile.clear_cycles.unwrap_or(0));
        let (from, tiles) = (self.from, &self.tiles);
        let Engine {
            fill,
            merge,
            taken,
            resolved,
            ..
        } = &mut self.engines[e];
        let stamp = fill.weighted.front(now);
        let reason = stamp.map_or(Act::Starve, |stamp| {
            let turn = taken
                .iter()
                .position(|tile| *tile == stamp.tile)
                .expect("a tile that was taken");
            let before = turn.checked_sub(buffers);
            let buffer = before.map_or(Some(from), |turn| resolved.get(turn).copied());
            let has_buffer = if clear == 0 {
                buffer.is_some_and(|at| at <= now)
            } else {
                // Cleared behind the previous tile of the engine.
                let previous = turn.checked_sub(1).map_or(Some(from), |turn| {
                    let tile = &tiles[taken[turn]];
                    (tile.left == 0).then_some(tile.last)
                });
                let from = buffer.zip(previous).map(|(one, other)| one.max(other));
                from.is_some_and(|from| from + clear <= now)
            };
            if has_buffer { Act::Take(1) } else { Act::Block }
        });
        if merge.fragment(now, stamp, reason) {
            fill.weighted.pop();
        }
        self.note_written(e);
    }

    fn note_written(&mut self, e: usize) {
        let Engine { fill, merge, .. } = &mut self.engines[e];
        for (stamp, written) in merge.written.drain(..) {
            let tile = &mut self.tiles[stamp.tile];
            tile.left -= 1;
            tile.under_way -= 1;
            tile.last = tile.last.max(written);
            for pixel in stamp
                .stops
                .iter()
                .filter(|pixel| stamp.pixels.contains(pixel))
            {
                fill.stopped[*pixel] = fill.stopped[*pixel].min(written);
            }
        }
    }

    /// The tile that an engine resolves next. If it is the only one, possibly before its list has
    /// begun.
    fn next_resolved(&self, e: usize) -> Option<usize> {
        let Engine {
            taken, resolved, ..
        } = &self.engines[e];
        let in_turn = if self.engines.len() == 1 {
            &self.in_turn
        } else {
            taken
        };
        in_turn
            .get(resolved.len())
            .copied()
            .filter(|_| self.now >= self.from)
    }

    fn resolve_reason(&self, e: usize) -> Act {
        let Some(tile) = self.next_resolved(e) else {
            return Act::Starve;
        };
        let ListedTile {
            left,
            last,
            under_way,
            ..
        } = self.tiles[tile];
        let is_through = left == 0 || self.has_stopped(e, tile);
        if !is_through || under_way > 0 || last > self.now {
            Act::Starve
        } else {
            Act::Take(1)
        }
    }

    fn resolve(&mut self, e: usize) {
        let reason = self.resolve_reason(e);
        let (tile, mut cycles, mut shades) = (self.next_resolved(e), Vec::new(), 0);
        if reason == Act::Take(1) {
            let corner = self.tiles[tile.expect("a tile")].corner;
            (cycles, shades) = resolve_cycles(
                self.timing,
                self.scene,
                corner,
                [self.timing.timing.tile.side_px as usize; 2],
            );
        }
        let is_held = shades > 0 && self.engines[e].merge.mirror.is_some();
        let held: Vec<u64> = if is_held { vec![HELD] } else { cycles.clone() };
        if !resolve(&mut self.engines[e].resolve, self.now, reason, &held) {
            return;
        }
        let tile = tile.expect("a tile");
        let mut done = self.now
            + cycles.iter().max().expect("a unit")
            + u64::from(self.timing.resolve.latency);
        if is_held {
            // Known when the last texels have arrived.
            let texels = resolve_texels(
                self.scene,
                self.tiles[tile].corner,
                [self.timing.timing.tile.side_px as usize; 2],
            );
            let two = self.buffers() == 2;
            let Engine {
                merge,
                mirror,
                unwritten,
                ..
            } = &mut self.engines[e];
            let mirror = if two { mirror } else { &mut merge.mirror };
            mirror
                .as_mut()
                .expect("a reflecting shade unit")
                .queue_resolve(self.now, texels);
            *unwritten = Some((
                tile,
                [
                    self.now,
                    cycles[0],
                    done + u64::from(self.timing.shade.latency),
                ],
            ));
            return;
        }
        let work = light(self.timing, self.now, shades);
        if self.buffers() == 2 {
            self.engines[e].to_light.extend(work);
        } else {
            self.engines[e].merge.to_shade.extend(work);
        }
        if shades > 0 {
            done += u64::from(self.timing.shade.latency);
        }
        self.hand_out(e, tile, done);
    }

    /// Records that a tile is resolved.
    fn hand_out(&mut self, e: usize, tile: usize, done: u64) {
        self.engines[e].resolved.push(done);
        self.write_words(done, self.tiles[tile].place);
        self.leave_out(done, tile + 1);
    }

    /// Completes the tile for whose light resolve stalled; `waited` is the number of stall cycles
    /// for texels.
    fn end_wait(&mut self, e: usize, waited: u64) {
        if let Some((tile, [begun, cycles, done])) = self.engines[e].unwritten.take() {
            self.engines[e].resolve[0].instances[0].until = begun + cycles + waited;
            self.hand_out(e, tile, done + waited);
        }
    }

    fn shade(&mut self, e: usize) -> Act {
        let now = self.now;
        if self.engines[e].merge.mirror.is_none() {
            return self.engines[e].merge.shade(now);
        }
        let (act, waited) = self.engines[e].merge.mirror(now, &mut self.memory);
        waited
            .into_iter()
            .for_each(|waited| self.end_wait(e, waited));
        act
    }

    fn light(&mut self, e: usize) -> Act {
        let now = self.now;
        if let Some(mirror) = &mut self.engines[e].mirror {
            let (act, consumer) =
                mirror.shade(now, self.timing.shade.interval.into(), &mut self.memory);
            let waited = mirror.waited(consumer);
            waited
                .into_iter()
                .for_each(|waited| self.end_wait(e, waited));
            return act;
        }
        match self.engines[e]
            .to_light
            .pop_front_if(|(here, ..)| *here <= now)
        {
            Some((_, cycles, _)) => Act::Take(cycles),
            None => Act::Starve,
        }
    }

    fn tick(&mut self) {
        let now = self.now;
        for e in 0..self.engines.len() {
            self.engines[e].merge.begin_tick(now);
            self.note_written(e);
        }
        self.setup.tick(&mut self.memory);
        turn(self, now, |m| &mut m.bin, Self::bin);
        self.flush();
        self.sort_in_cycle();
        for e in 0..self.engines.len() {
            turn(self, now, |m| &mut m.engines[e].list, |m| m.list(e));
        }
        for e in 0..self.engines.len() {
            self.read_records(e);
            self.write_back(e);
            self.make_mask(e);
            turn(
                self,
                now,
                |m| &mut m.engines[e].fill.raster,
                |m| m.raster(e),
            );
            turn(
                self,
                now,
                |m| &mut m.engines[e].fill.gauss,
                |m| m.engines[e].fill.gauss(now),
            );
            self.fragment(e);
            self.resolve(e);
            turn(self, now, |m| &mut m.engines[e].merge.shade, |m| m.shade(e));
            turn(self, now, |m| &mut m.engines[e].lit, |m| m.light(e));
        }
        self.memory.tick(now);
        self.setup.end_tick();
        for engine in &mut self.engines {
            engine.listed.tick();
            engine.fill.end_tick();
        }
        self.now += 1;
    }

    fn is_done(&mut self) -> bool {
        (0..self.engines.len()).for_each(|e| self.pass_over(e));
        self.sorted
            && self.setup.is_done()
            && self.queue.is_empty()
            && self.engines.iter().all(|engine| engine.is_done(self.now))
            && self.bin.is_idle(self.now)
            && self.words.are_all_done(self.now)
    }
}

/// Draws a scene, cycle by cycle.
pub fn draw(timing: &Microarchitecture, scene: &Scene) -> Ticked {
    let mut machine = BinnedMachine::new(timing, scene);
    let total = run(&mut machine, BinnedMachine::tick, BinnedMachine::is_done);
    let sort = match &machine.sorters {
        Some(sorters) => sorters.units.clone(),
        None => Vec::from_iter(machine.sorts().then(|| machine.sort.clone())),
    };
    let BinnedMachine {
        memory,
        setup,
        bin,
        engines,
        ..
    } = machine;
    let stamps = engines
        .iter()
        .map(|engine| engine.fill.taken())
        .fold([0; 2], |[all, kept], [more, more_kept]| {
            [all + more, kept + more_kept]
        });
    let of_engines = engines
        .iter()
        .flat_map(|engine| [&engine.merge.mirror, &engine.mirror]);
    let mirrors =
        of_engines.map(|mirror| texels_looked_up([mirror.as_ref().map(|mirror| &mirror.texels)]));
    let texels = mirrors.fold(
        texels_looked_up([setup.texels.as_ref()]),
        |[all, had], [more, more_had]| [all + more, had + more_had],
    );
    let (setup, shade) = setup.units();
    let mut second: Vec<TickedUnit> = engines
        .into_iter()
        .zip(0..)
        .flat_map(|(engine, nth)| engine.units(timing, nth))
        .collect();
    if let Some(shade) = shade {
        // Only this unit ever shades.
        let at = second
            .iter()
            .position(|unit| unit.name == "shade")
            .expect("shade");
        second[at] = shade;
        second.retain(|unit| unit.name != "shade" || unit.others == 0);
    }
    let place = |unit: &TickedUnit| {
        [
            "list",
            "raster",
            "gauss",
            "fragment",
            "shade",
            "resolve-shade",
            "resolve",
        ]
        .iter()
        .position(|name| *name == unit.name)
    };
    second.sort_by_key(place);
    let units = [setup, vec![bin], sort, second].concat();
    Ticked {
        total,
        units,
        lookups: [0; 2],
        texels,
        stamps,
        traffic: memory.traffic,
    }
}

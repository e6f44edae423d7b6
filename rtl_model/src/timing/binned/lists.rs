//! Lists: which tiles have an entry of which splat: all tiles of its box, or those that the unit
//! `bin` does not reject. The masks of entries come from the same test.
//!
//! ```text
//! boxes ─► tiles of each box ─┬─►[ test ]────────────────────► lists
//!            │                └─► subtiles ─►[ test ]─► masks ──┘ entries without a set bit: none if `bin` makes masks
//!            └──────────────────► order of the record, which has every tile of every box
//! ```
//! The record of a frame does not depend on the test: a rejected tile has no pixel of the splat.
//! So a reader of the record skips rejected splats. The result of a test depends on the side of
//! tiles, which is a field of timing. Therefore this file runs the graph of the unit, on recorded
//! words; the rest of timing computes no values.
//!
//! Law: `no_test_of_tiles_or_subtiles_loses_a_pixel`.

use crate::elaboration::masks::Masks;
use crate::elaboration::microarchitecture::{BinShape, Microarchitecture};
use crate::graph::{BATCH, Batch, Program, Run};
use crate::kernels::host::vectorised;
use crate::machine::MaskMaker;
use crate::num::LANES;
use crate::probe::NoProbe;
use crate::timing::stamps::Stamps;
use crate::units::bin::{self, SPLAT_INPUTS, SPLAT_OUTPUTS, TILE_INPUTS};
use crate::work::{Bins, DEPARTED, Footprint, TILE_PX, TestedWords, Work, each_tile};
use std::ops::Deref;

/// The lists of all tiles.
pub struct Lists {
    listed: Bins,
    side_px: usize,
    tested: Option<Tested>,
    masks: Option<EntryMasks>,
    kept: Option<Kept>,
}

/// Lists that are kept from frame to frame.
struct Kept {
    /// Place of the first tile of each splat, and of the end.
    starts: Vec<usize>,
    /// By splat, and by rows of the tiles of its box: whether it is new in the list.
    new: Vec<bool>,
}

/// Tiles of boxes before the test, and its results.
struct Tested {
    boxes: Bins,
    results: Results,
}

/// By splat, and by rows of the tiles of its box: whether it is listed.
struct Results {
    starts: Vec<usize>,
    listed: Vec<bool>,
    /// The mask of each tile, if there are masks.
    masks: Vec<u64>,
    /// Number of tests.
    tests: usize,
}

/// Masks of the entries of all lists, in the order of the lists.
struct EntryMasks {
    shape: Masks,
    masks: Vec<u64>,
    /// Subtiles that `bin` tests, and bits that it sets.
    tested: u64,
    set: u64,
}

impl Deref for Lists {
    type Target = Bins;

    fn deref(&self) -> &Bins {
        &self.listed
    }
}

/// Counts of tests of tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileTests {
    /// Tiles of all boxes.
    pub tiles: u64,
    /// Entries of all lists.
    pub entries: u64,
    /// On a machine with masks.
    pub masks: Option<MaskCounts>,
}

/// Counts of the masks of entries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MaskCounts {
    /// Subtiles that were tested.
    pub tested: u64,
    /// Bits that were set.
    pub set: u64,
    /// Cycles of tests in `list`, if it makes the masks: in all engines.
    pub list_cycles: u64,
    /// Seeds of runs in raster.
    pub seeds: u64,
}

impl Lists {
    /// Lists of a frame on a machine. A record without the words for a test has an entry in every
    /// tile of a box.
    pub fn new(timing: &Microarchitecture, work: &Work) -> Self {
        let side_px = timing.timing.tile.side_px as usize;
        let shape = timing
            .bin
            .filter(|_| work.tested.len() == work.footprints.len());
        let blocks = timing.contribution.and_then(|blocks| blocks.masks);
        if let Some(listed) = work.kept_bins().filter(|_| timing.keeps_lists()) {
            return Lists {
                masks: match blocks {
                    Some(shape) => Some(EntryMasks::recorded(shape, work, &listed, side_px)),
                    None => shape.and_then(|of| EntryMasks::kept(&of, work, &listed, side_px)),
                },
                kept: Kept::new(work, &listed, side_px),
                listed,
                side_px,
                tested: None,
            };
        }
        let boxes = work.bins(side_px);
        let Some(shape) = shape else {
            return Lists {
                masks: blocks.map(|shape| EntryMasks::recorded(shape, work, &boxes, side_px)),
                listed: boxes,
                side_px,
                tested: None,
                kept: None,
            };
        };
        let results = Results::new(&shape, work, side_px);
        let mut listed = boxes.clone();
        let mut masks: Vec<u64> = Vec::new();
        listed.retain(|tile, nth| {
            let at = [tile % boxes.columns, tile / boxes.columns];
            let place = results.place(nth, &work.footprints[nth as usize], side_px, at);
            if results.listed[place] {
                masks.extend(results.masks.get(place));
            }
            results.listed[place]
        });
        let set = masks.iter().map(|mask| u64::from(mask.count_ones())).sum();
        let masks = shape.masks.map(|shape| {
            let [tested, set] = match shape.made {
                MaskMaker::Bin => [results.tests as u64, set],
                MaskMaker::List => [0; 2],
            };
            EntryMasks {
                shape,
                tested,
                set,
                masks,
            }
        });
        Lists {
            masks: masks.or_else(|| Some(EntryMasks::recorded(blocks?, work, &listed, side_px))),
            listed,
            side_px,
            tested: Some(Tested { boxes, results }),
            kept: None,
        }
    }

    /// Whether lists are kept from frame to frame.
    pub fn are_kept(&self) -> bool {
        self.kept.is_some()
    }

    /// Counts of the tests, if the machine has any; those of masks are completed by the replay.
    pub fn tests(&self) -> Option<TileTests> {
        let masks = self.masks.as_ref().map(|masks| MaskCounts {
            tested: masks.tested,
            set: masks.set,
            list_cycles: 0,
            seeds: 0,
        });
        (self.tested.is_some() || masks.is_some()).then(|| TileTests {
            tiles: match &self.kept {
                Some(kept) => kept.new.len() as u64,
                None => self.boxes().entries() as u64,
            },
            // Without those of departed splats.
            entries: self.listed.listed() as u64,
            masks,
        })
    }

    /// Bits that are set in the masks of all entries, whether `list` reads them or stops before.
    pub fn set_bits(&self) -> u64 {
        let masks = self.masks.iter().flat_map(|masks| &masks.masks);
        masks.map(|mask| u64::from(mask.count_ones())).sum()
    }

    /// The mask of an entry, by its tile and its place in the list; all bits without masks.
    #[inline(always)]
    pub fn mask(&self, tile: usize, place: usize) -> u64 {
        self.masks.as_ref().map_or(u64::MAX, |masks| {
            masks.masks[self.listed.first(tile) + place]
        })
    }

    /// Cycles of `bin` for a tile of a box.
    #[inline(always)]
    pub fn test_cycles(&self, footprint: &Footprint, tile: usize) -> u64 {
        self.masks
            .as_ref()
            .map_or(1, |masks| match masks.shape.made {
                MaskMaker::Bin => {
                    let subtiles = self.subtiles(&masks.shape, footprint, tile);
                    masks.shape.cycles(subtiles)
                }
                MaskMaker::List => 1,
            })
    }

    /// Subtiles of a tile that the box of a splat touches.
    pub fn subtiles(&self, masks: &Masks, footprint: &Footprint, tile: usize) -> u64 {
        let at = [tile % self.columns, tile / self.columns];
        let [columns, rows] = part(footprint, self.side_px, at)
            .map(|side| side.map(|pixel| pixel as u64 / u64::from(masks.subtile_px)));
        (columns[1] - columns[0] + 1) * (rows[1] - rows[0] + 1)
    }

    /// Splats by the tiles that their boxes touch, listed there or not.
    pub fn boxes(&self) -> &Bins {
        self.tested
            .as_ref()
            .map_or(&self.listed, |tested| &tested.boxes)
    }

    /// Calls `visit` with each tile of the box of the nth splat, by rows, and whether `bin` lists it
    /// there: it does not if the entry is kept from the frame before.
    #[inline(always)]
    pub fn each(
        &self,
        nth: usize,
        footprint: &Footprint,
        side_px: usize,
        mut visit: impl FnMut(usize, bool),
    ) {
        match &self.tested {
            None if let Some(kept) = &self.kept => {
                let mut new = kept.new[kept.starts[nth]..].iter();
                each_tile(footprint.sides(), side_px, self.columns, |tile| {
                    visit(tile, new.next().is_none_or(|new| *new))
                });
            }
            None => each_tile(footprint.sides(), side_px, self.columns, |tile| {
                visit(tile, true)
            }),
            Some(tested) => {
                let mut results = tested.results.listed[tested.results.starts[nth]..].iter();
                each_tile(footprint.sides(), side_px, self.columns, |tile| {
                    visit(tile, results.next().is_none_or(|listed| *listed))
                });
            }
        }
    }

    /// Moves the reader of the record past the splats that are not listed in a tile, from a place
    /// among the boxes of the tile up to an entry; returns the place after that entry.
    #[inline(always)]
    pub fn skip(
        &self,
        walk: &mut Stamps,
        work: &Work,
        (tile, corner): (usize, [u16; 2]),
        mut place: usize,
        entry: u32,
    ) -> usize {
        if walk.finds_splats() {
            return place;
        }
        if let Some(tested) = &self.tested {
            let boxes = tested.boxes.of(tile);
            while boxes[place] != entry {
                let footprint = &work.footprints[boxes[place] as usize];
                walk.skip(footprint, corner, self.side_px as u32);
                place += 1;
            }
        }
        place + 1
    }
}

impl Kept {
    fn new(work: &Work, listed: &Bins, side_px: usize) -> Option<Self> {
        let lists = work.lists.as_ref()?;
        let starts = places(work, side_px);
        let mut new = vec![false; starts.last().copied().unwrap_or_default()];
        for (tile, list) in lists.tiles.iter().enumerate().take(listed.tiles()) {
            let at = [tile % listed.columns, tile / listed.columns];
            for (nth, is_new) in listed.of(tile).iter().zip(&list.new) {
                if let Some(footprint) = work.footprints.get(*nth as usize) {
                    new[place(starts[*nth as usize], footprint, side_px, at)] = *is_new;
                }
            }
        }
        Some(Kept { starts, new })
    }
}

impl EntryMasks {
    /// Masks of the entries of kept lists, which `list` makes. Those of departed splats are empty.
    fn kept(shape: &BinShape, work: &Work, listed: &Bins, side_px: usize) -> Option<Self> {
        let results = Results::new(shape, work, side_px);
        let mut masks = Vec::with_capacity(listed.entries());
        for tile in 0..listed.tiles() {
            let at = [tile % listed.columns, tile / listed.columns];
            let of = |nth: &u32| {
                let footprint = work.footprints.get(*nth as usize)?;
                let place = results.place(*nth, footprint, side_px, at);
                Some(results.masks[place])
            };
            masks.extend(listed.of(tile).iter().map(|nth| of(nth).unwrap_or(0)));
        }
        Some(EntryMasks {
            shape: shape.masks?,
            tested: 0,
            set: 0,
            masks,
        })
    }

    /// Masks of blocks, as they were recorded by tiles of 16 pixels. A record without them has all
    /// blocks of a box.
    fn recorded(shape: Masks, work: &Work, listed: &Bins, side_px: usize) -> Self {
        let places = places(work, TILE_PX);
        let across = TILE_PX / shape.subtile_px as usize;
        let mut recorded = vec![u16::MAX; places.last().copied().unwrap_or_default()];
        let boxes = work.bins(TILE_PX);
        let tiles = (0..boxes.tiles()).filter(|tile| !boxes.of(*tile).is_empty());
        for (tile, record) in tiles.zip(&work.tiles) {
            let at = [tile % boxes.columns, tile / boxes.columns];
            for (nth, mask) in boxes.of(tile).iter().zip(record.masks()) {
                let footprint = &work.footprints[*nth as usize];
                recorded[place(places[*nth as usize], footprint, TILE_PX, at)] = *mask;
            }
        }
        let mut masks = Vec::with_capacity(listed.entries());
        for tile in 0..listed.tiles() {
            let at = [tile % listed.columns, tile / listed.columns];
            let own = shape.across() as usize;
            for nth in listed.of(tile) {
                if *nth == DEPARTED {
                    masks.push(0);
                    continue;
                }
                let footprint = &work.footprints[*nth as usize];
                let part = part(footprint, side_px, at);
                let bits = subtiles(&shape, part).filter(|(bit, _)| {
                    let bit = *bit as usize;
                    let block = [at[0] * own + bit % own, at[1] * own + bit / own];
                    let of = block.map(|block| block / across);
                    let [x, y] = block.map(|block| block % across);
                    let mask = recorded[place(places[*nth as usize], footprint, TILE_PX, of)];
                    usize::from(mask) & 1 << (y * across + x) != 0
                });
                masks.push(bits.fold(0, |mask, (bit, _)| mask | 1u64 << bit));
            }
        }
        EntryMasks {
            shape,
            tested: 0,
            set: 0,
            masks,
        }
    }
}

/// The part of a box in the tile of this column and row: first and last column and row, counted
/// from the first of the tile.
fn part(footprint: &Footprint, side_px: usize, at: [usize; 2]) -> [[usize; 2]; 2] {
    [0, 1].map(|axis| {
        let [first, last] = footprint.sides()[axis].map(usize::from);
        let corner = at[axis] * side_px;
        [
            first.max(corner) - corner,
            last.min(corner + side_px - 1) - corner,
        ]
    })
}

impl Results {
    fn new(shape: &BinShape, work: &Work, side_px: usize) -> Self {
        let splats = Splats::new(shape, work);
        let mut tests = Tiles::new(shape);
        let (mut starts, mut results) = (Vec::new(), Vec::new());
        // Place of the first test of each tile.
        let mut of_tiles = Vec::new();
        let of_bin = shape.masks.filter(|masks| masks.made == MaskMaker::Bin);
        for (footprint, (words, splat)) in
            work.footprints.iter().zip(work.tested.iter().zip(splats))
        {
            starts.push(of_tiles.len());
            let first = footprint.sides().map(|[first, _]| usize::from(first));
            let [columns, rows] = footprint
                .sides()
                .map(|side| side.map(|pixel| usize::from(pixel) / side_px));
            for row in rows[0]..rows[1] + 1 {
                for column in columns[0]..columns[1] + 1 {
                    of_tiles.push(results.len() + tests.waiting);
                    let at = [column, row];
                    let part = part(footprint, side_px, at);
                    // From the first pixel of the box.
                    let mut test = |part: [[usize; 2]; 2]| {
                        let part = [0, 1].map(|axis| {
                            part[axis].map(|pixel| at[axis] * side_px + pixel - first[axis])
                        });
                        tests.test(words, &splat, part, &mut results);
                    };
                    if of_bin.is_none() {
                        test(part);
                    }
                    for (_, subtile) in shape.masks.iter().flat_map(|of| subtiles(of, part)) {
                        test(subtile);
                    }
                }
            }
        }
        tests.run(&mut results);
        let Some(shape) = shape.masks else {
            return Results {
                starts,
                tests: results.len(),
                listed: results,
                masks: Vec::new(),
            };
        };
        // The results of subtiles become masks.
        let (mut listed, mut masks) = (Vec::new(), Vec::new());
        let mut of_tiles = of_tiles.into_iter();
        for footprint in &work.footprints {
            let [columns, rows] = footprint
                .sides()
                .map(|side| side.map(|pixel| usize::from(pixel) / side_px));
            for row in rows[0]..rows[1] + 1 {
                for column in columns[0]..columns[1] + 1 {
                    let first = of_tiles.next().unwrap_or_default();
                    let own = usize::from(of_bin.is_none());
                    let part = part(footprint, side_px, [column, row]);
                    let bits = subtiles(&shape, part).zip(&results[first + own..]);
                    let mask = bits.fold(0, |mask, ((bit, _), is_set)| {
                        mask | u64::from(*is_set) << bit
                    });
                    listed.push(match of_bin {
                        Some(_) => mask != 0,
                        None => results[first],
                    });
                    masks.push(mask);
                }
            }
        }
        Results {
            starts,
            listed,
            masks,
            tests: results.len(),
        }
    }

    /// Place of the result of the nth splat in the tile in this column and row.
    fn place(&self, nth: u32, footprint: &Footprint, side_px: usize, [x, y]: [usize; 2]) -> usize {
        place(self.starts[nth as usize], footprint, side_px, [x, y])
    }
}

/// Place of the first tile of each splat's box, and of the end.
fn places(work: &Work, side_px: usize) -> Vec<usize> {
    let mut places = vec![0];
    for footprint in &work.footprints {
        let [columns, rows] = footprint
            .sides()
            .map(|[first, last]| usize::from(last) / side_px - usize::from(first) / side_px + 1);
        places.push(places.last().copied().unwrap_or_default() + columns * rows);
    }
    places
}

/// Place of the tile in this column and row among those of a box, by rows, after those before it.
fn place(first: usize, footprint: &Footprint, side_px: usize, [x, y]: [usize; 2]) -> usize {
    let [[left, right], [top, _]] = footprint
        .sides()
        .map(|side| side.map(|pixel| usize::from(pixel) / side_px));
    first + (y - top) * (right - left + 1) + x - left
}

/// The subtiles that a part of a tile touches: the bit of each, and the part in it.
fn subtiles(
    masks: &Masks,
    [columns, rows]: [[usize; 2]; 2],
) -> impl Iterator<Item = (u32, [[usize; 2]; 2])> + use<> {
    let (side, across) = (masks.subtile_px as usize, masks.across() as usize);
    let within = move |[first, last]: [usize; 2], nth: usize| {
        [first.max(nth * side), last.min(nth * side + side - 1)]
    };
    (rows[0] / side..rows[1] / side + 1).flat_map(move |row| {
        (columns[0] / side..columns[1] / side + 1).map(move |column| {
            let bit = (row * across + column) as u32;
            (bit, [within(columns, column), within(rows, row)])
        })
    })
}

/// Results of the graph of a splat, splat by splat.
struct Splats<'a> {
    work: &'a Work,
    program: Program,
    batch: Batch,
    results: Vec<[i64; SPLAT_OUTPUTS]>,
    next: usize,
}

impl<'a> Splats<'a> {
    fn new(shape: &BinShape, work: &'a Work) -> Self {
        let program = shape.words.splat().program();
        let mut batch = program.batch();
        let registers = bin::registers(work.cutoff, [work.width, work.height]);
        for (input, register) in (SPLAT_INPUTS..).zip(registers) {
            batch.set_all(&program, input, register);
        }
        Splats {
            work,
            program,
            batch,
            results: Vec::new(),
            next: 0,
        }
    }

    fn run(&mut self) {
        let Splats {
            work,
            program,
            batch,
            results,
            next,
        } = self;
        let splats = work.footprints[*next..].iter().zip(&work.tested[*next..]);
        let inputs: Vec<[i64; SPLAT_INPUTS]> = splats
            .take(BATCH)
            .map(|(footprint, words)| {
                let ([x, y], [xx, xy, yy]) = (words.pixel, words.conic);
                let [[left, right], [top, bottom]] = footprint.sides();
                [
                    x.into(),
                    y.into(),
                    xx.into(),
                    xy.into(),
                    yy.into(),
                    left.into(),
                    right.into(),
                    top.into(),
                    bottom.into(),
                ]
            })
            .collect();
        *next += inputs.len();
        run_batch(program, batch, &inputs, results);
    }
}

impl Iterator for Splats<'_> {
    type Item = [i64; SPLAT_OUTPUTS];

    fn next(&mut self) -> Option<Self::Item> {
        if self.results.is_empty() {
            self.run();
            self.results.reverse();
        }
        self.results.pop()
    }
}

/// Tests of tiles, a batch at a time.
struct Tiles {
    program: Program,
    batch: Batch,
    inputs: Vec<[i64; TILE_INPUTS]>,
    /// Tests that are not run yet.
    waiting: usize,
}

impl Tiles {
    fn new(shape: &BinShape) -> Self {
        let program = shape.words.tile().program();
        Tiles {
            batch: program.batch(),
            program,
            inputs: Vec::with_capacity(BATCH),
            waiting: 0,
        }
    }

    /// Tests a tile that has this part of a box.
    fn test(
        &mut self,
        words: &TestedWords,
        splat: &[i64; SPLAT_OUTPUTS],
        [columns, rows]: [[usize; 2]; 2],
        listed: &mut Vec<bool>,
    ) {
        let mut inputs = [0; TILE_INPUTS];
        let (conic, rest) = inputs.split_at_mut(3);
        let (of_splat, part) = rest.split_at_mut(SPLAT_OUTPUTS);
        conic.copy_from_slice(&words.conic.map(i64::from));
        of_splat.copy_from_slice(splat);
        part[..2].copy_from_slice(&columns.map(|at| at as i64));
        part[2..].copy_from_slice(&rows.map(|at| at as i64));
        self.inputs.push(inputs);
        self.waiting += 1;
        if self.waiting == BATCH {
            self.run(listed);
        }
    }

    fn run(&mut self, listed: &mut Vec<bool>) {
        let mut results: Vec<[i64; 1]> = Vec::with_capacity(BATCH);
        run_batch(&self.program, &mut self.batch, &self.inputs, &mut results);
        listed.extend(results.iter().map(|[result]| *result != 0));
        self.inputs.clear();
        self.waiting = 0;
    }
}

/// Appends the results of up to a batch of items.
fn run_batch<const INPUTS: usize, const OUTPUTS: usize>(
    program: &Program,
    batch: &mut Batch,
    inputs: &[[i64; INPUTS]],
    results: &mut Vec<[i64; OUTPUTS]>,
) {
    let rows = inputs.len().div_ceil(LANES);
    let item = |place: usize| inputs.get(place).or(inputs.last());
    for input in 0..INPUTS {
        let words: Vec<[i64; LANES]> = (0..rows)
            .map(|row| {
                std::array::from_fn(|lane| item(row * LANES + lane).map_or(0, |of| of[input]))
            })
            .collect();
        batch.set(program, input, &words);
    }
    vectorised(Run {
        program,
        batch: &mut *batch,
        live: &[u8::MAX; BATCH / LANES][..rows],
        probe: &mut NoProbe,
    });
    for place in 0..inputs.len() {
        let (row, lane) = (place / LANES, place % LANES);
        results.push(std::array::from_fn(|output| {
            batch.result(program, output, row)[lane]
        }));
    }
}

//! Lists: which tiles have an entry of which splat: all tiles of its box, or those that the unit
//! `bin` does not reject.
//!
//! ```text
//! boxes ─► tiles of each box ─►[ test ]─► lists
//!            └──────────────────► order of the record, which has every tile of every box
//! ```
//! The record of a frame does not depend on the test: a rejected tile has no pixel of the splat.
//! So a reader of the record skips rejected splats. The result of a test depends on the side of
//! tiles, which is a field of timing. Therefore this file runs the graph of the unit, on recorded
//! words; the rest of timing computes no values.
//!
//! Law: `no_test_of_tiles_loses_a_pixel`.

use crate::elaboration::microarchitecture::{BinShape, Microarchitecture};
use crate::graph::{BATCH, Batch, Program, Run};
use crate::kernels::host::vectorised;
use crate::num::LANES;
use crate::probe::NoProbe;
use crate::timing::stamps::Stamps;
use crate::units::bin::{self, SPLAT_INPUTS, SPLAT_OUTPUTS, TILE_INPUTS};
use crate::work::{Bins, Footprint, TestedWords, Work, each_tile};
use std::ops::Deref;

/// The lists of all tiles.
pub struct Lists {
    listed: Bins,
    tested: Option<Tested>,
}

/// Tiles of boxes before the test, and its results.
struct Tested {
    boxes: Bins,
    side_px: usize,
    results: Results,
}

/// By splat, and by rows of the tiles of its box: whether it is listed.
struct Results {
    starts: Vec<usize>,
    listed: Vec<bool>,
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
}

impl Lists {
    /// Lists of a frame on a machine. A record without the words for a test has an entry in every
    /// tile of a box.
    pub fn new(timing: &Microarchitecture, work: &Work) -> Self {
        let side_px = timing.timing.tile.side_px as usize;
        let boxes = work.bins(side_px);
        let shape = timing
            .bin
            .filter(|_| work.tested.len() == work.footprints.len());
        let Some(shape) = shape else {
            return Lists {
                listed: boxes,
                tested: None,
            };
        };
        let results = Results::new(&shape, work, side_px);
        let mut listed = boxes.clone();
        listed.retain(|tile, nth| {
            let at = [tile % boxes.columns, tile / boxes.columns];
            results.of(nth, &work.footprints[nth as usize], side_px, at)
        });
        Lists {
            listed,
            tested: Some(Tested {
                boxes,
                side_px,
                results,
            }),
        }
    }

    /// Counts of the tests, if the machine has any.
    pub fn tests(&self) -> Option<TileTests> {
        self.tested.as_ref().map(|tested| TileTests {
            tiles: tested.boxes.entries() as u64,
            entries: self.entries() as u64,
        })
    }

    /// Splats by the tiles that their boxes touch, listed there or not.
    pub fn boxes(&self) -> &Bins {
        self.tested
            .as_ref()
            .map_or(&self.listed, |tested| &tested.boxes)
    }

    /// Calls `visit` with each tile of the box of the nth splat, by rows, and whether it is listed
    /// there.
    #[inline(always)]
    pub fn each(
        &self,
        nth: usize,
        footprint: &Footprint,
        side_px: usize,
        mut visit: impl FnMut(usize, bool),
    ) {
        match &self.tested {
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
        if let Some(tested) = &self.tested {
            let boxes = tested.boxes.of(tile);
            while boxes[place] != entry {
                let footprint = &work.footprints[boxes[place] as usize];
                walk.skip(footprint, corner, tested.side_px as u32);
                place += 1;
            }
        }
        place + 1
    }
}

impl Results {
    fn new(shape: &BinShape, work: &Work, side_px: usize) -> Self {
        let splats = Splats::new(shape, work);
        let mut tiles = Tiles::new(shape);
        let (mut starts, mut listed) = (Vec::new(), Vec::new());
        for (footprint, (words, splat)) in
            work.footprints.iter().zip(work.tested.iter().zip(splats))
        {
            starts.push(listed.len() + tiles.waiting);
            let [columns, rows] = footprint
                .sides()
                .map(|[first, last]| [usize::from(first), usize::from(last)]);
            for row in rows[0] / side_px..rows[1] / side_px + 1 {
                for column in columns[0] / side_px..columns[1] / side_px + 1 {
                    let part = [(columns, column), (rows, row)].map(|([first, last], tile)| {
                        let from = first.max(tile * side_px);
                        let to = last.min(tile * side_px + side_px - 1);
                        [from - first, to - first]
                    });
                    tiles.test(words, &splat, part, &mut listed);
                }
            }
        }
        tiles.run(&mut listed);
        Results { starts, listed }
    }

    /// Whether the nth splat is listed in the tile in this column and row.
    fn of(&self, nth: u32, footprint: &Footprint, side_px: usize, [x, y]: [usize; 2]) -> bool {
        let [[left, right], [top, _]] = footprint
            .sides()
            .map(|side| side.map(|pixel| usize::from(pixel) / side_px));
        self.listed[self.starts[nth as usize] + (y - top) * (right - left + 1) + x - left]
    }
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

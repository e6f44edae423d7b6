//! Blocks: the graph of the contribution test over a batch of blocks, for all splats of a tile.
//!
//! ```text
//! records of a tile ─► blocks of each box in the tile ─►[ contribution ]─► a mask per splat
//! ```
//! A mask has a bit per block of the tile of 16 × 16 pixels, by rows, the first in the LSB. It is 0
//! where the box has no part.
//!
//! Law: `kept_pixels_are_unchanged` (tests/machines).

use super::{Elaborated, SetupRecord};
use crate::frame::Frame;
use crate::graph::{BATCH, Batch, ROWS, Run};
use crate::kernels::host::Host;
use crate::num::LANES;
use crate::probe::Probe;
use crate::records::TILE_PX;
use crate::units::contribution::{Contribution, INPUTS};

/// Blocks that wait for a batch: words, and the splat and the bit of each.
struct Waiting<'a> {
    unit: &'a Contribution,
    batch: Batch,
    words: Vec<[i64; INPUTS]>,
    of: Vec<(usize, u32)>,
}

/// Masks of the splats of a tile, in their order.
#[cold]
#[inline(never)]
pub fn kept<H: Host, P: Probe>(
    host: H,
    (machine, frame): (&Elaborated, &Frame),
    records: &[&SetupRecord],
    corner: [u16; 2],
    probe: &mut P,
) -> Vec<u16> {
    let Some(unit) = machine.tests_blocks(frame) else {
        return Vec::new();
    };
    let mut masks = vec![0; records.len()];
    let mut waiting = Waiting {
        unit,
        batch: unit.program().batch(),
        words: Vec::with_capacity(BATCH),
        of: Vec::with_capacity(BATCH),
    };
    let block = unit.block_px() as i64;
    let middle = [frame.width, frame.height].map(|pixels| i64::from(pixels) - 1);
    for (nth, record) in records.iter().enumerate() {
        let raster = &record.raster;
        let cutoff = machine.contribution_cutoff(frame, record.splat as usize);
        let corner = corner.map(i64::from);
        let [columns, rows] = [raster.columns, raster.rows].map(|side| side.map(i64::from));
        // The blocks of the tile that the box touches.
        let within = |[first, last]: [i64; 2], corner: i64| {
            let end = corner + TILE_PX as i64 - 1;
            (first.max(corner) - corner) / block..(last.min(end) - corner) / block + 1
        };
        for y in within(rows, corner[1]) {
            for x in within(columns, corner[0]) {
                let [left, top] = [corner[0] + x * block, corner[1] + y * block];
                let [px, py] = raster.pixel.map(i64::from);
                let [xx, xy, yy] = raster.conic.map(i64::from);
                waiting.words.push([
                    px,
                    py,
                    xx,
                    xy,
                    yy,
                    cutoff.unwrap_or_default(),
                    left,
                    left + block - 1,
                    top,
                    top + block - 1,
                    middle[0],
                    middle[1],
                ]);
                waiting.of.push((nth, bit(unit, [x as u32, y as u32])));
                if waiting.words.len() == BATCH {
                    waiting.run(host, &mut masks, probe);
                }
            }
        }
    }
    waiting.run(host, &mut masks, probe);
    masks
}

/// The bit of a block in this column and row of blocks of the tile.
fn bit(unit: &Contribution, [x, y]: [u32; 2]) -> u32 {
    y * (TILE_PX as u32 / unit.block_px()) + x
}

/// Whether the block of a pixel of the tile, 16 · row + column, is kept.
pub fn has(machine: &Elaborated, mask: u16, pixel: u8) -> bool {
    machine.contribution.as_ref().is_none_or(|unit| {
        let at = [pixel % TILE_PX as u8, pixel / TILE_PX as u8];
        let bit = bit(unit, at.map(|at| u32::from(at) / unit.block_px()));
        u32::from(mask) & 1 << bit != 0
    })
}

impl Waiting<'_> {
    /// Tests the blocks that wait.
    fn run<H: Host, P: Probe>(&mut self, host: H, masks: &mut [u16], probe: &mut P) {
        let Waiting {
            unit,
            batch,
            words,
            of,
        } = self;
        let (program, rows) = (unit.program(), words.len().div_ceil(LANES));
        // Lanes beyond the last block repeat it; their results are not used.
        let last = words.len().saturating_sub(1);
        for input in 0..INPUTS {
            let lanes = |row: usize| {
                std::array::from_fn(|lane| {
                    let block: &[i64; INPUTS] = &words[(row * LANES + lane).min(last)];
                    block[input]
                })
            };
            let input_words: Vec<[i64; LANES]> = (0..rows).map(lanes).collect();
            batch.set(program, input, &input_words);
        }
        let live: [u8; ROWS] = std::array::from_fn(|row| {
            ((1u32 << words.len().saturating_sub(row * LANES).min(LANES)) - 1) as u8
        });
        host.run(Run {
            program,
            batch: &mut *batch,
            live: &live[..rows],
            probe,
        });
        for (place, (splat, bit)) in of.drain(..).enumerate() {
            let result = batch.result(program, 0, place / LANES)[place % LANES];
            masks[splat] |= u16::from(result != 0) << bit;
        }
        words.clear();
    }
}

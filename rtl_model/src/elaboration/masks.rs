//! Masks: the subtiles of a tile that a splat reaches, one bit each, in the entries of a list.
//!
//! ```text
//! entry: index of the splat │ mask      bits by rows of subtiles, the first in the LSB
//! ```
//! A bit is the result of the test of tiles for the part of the splat's box in the subtile. It is 0
//! where the box has no part. Where blocks of pixels are tested (`contribution`), a bit is the result
//! of this test for a block, and `list` makes the masks.
//!
//! Laws: `masks_that_cannot_be_are_refused`, `masks_are_never_free`.

use super::latency::Path;
use super::{Elaboration, microarchitecture::BinWords};
use crate::machine::timing::Organisation;
use crate::machine::{BinTest, Machine, MaskMaker};
use schemars::JsonSchema;
use serde::Serialize;

/// Greatest number of bits of a mask.
const MOST_BITS: u32 = 64;
/// Greatest number of tiles that `bin` lists per cycle.
pub const MOST_TILES_PER_CYCLE: u32 = 16;
/// Sides of subtiles, pixels.
const SIDES_PX: [u32; 3] = [4, 8, 16];
/// Greatest number of blocks that are tested per cycle: those of a tile of 16 pixels.
pub const MOST_BLOCKS: u32 = 16;

/// Masks of list entries, every value given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Masks {
    /// Side of a subtile, pixels.
    pub subtile_px: u32,
    /// Where they are made.
    pub made: MaskMaker,
    /// Subtiles that are tested per cycle.
    pub tests: u32,
    /// Subtiles of a tile: bits of a mask.
    pub bits: u32,
}

impl Masks {
    /// Those of a machine. Values out of range are limited here and refused by
    /// [`Machine::check_masks`].
    pub fn of(machine: &Machine) -> Option<Self> {
        let across = |side_px: u32| (machine.timing.tile.side_px / side_px).clamp(1, 8);
        if let Some(contribution) = machine.contribution {
            let subtile_px = contribution.block_px.clamp(1, 1 << 14);
            return Some(Masks {
                subtile_px,
                made: MaskMaker::List,
                tests: machine.contribution_blocks(),
                bits: across(subtile_px).pow(2),
            });
        }
        let bin = machine.bin?;
        let subtile_px = bin.subtile_px?.clamp(1, 1 << 14);
        Some(Masks {
            subtile_px,
            made: bin.masks.unwrap_or_default(),
            tests: bin.mask_tests.unwrap_or(1).clamp(1, MOST_BITS),
            bits: across(subtile_px).pow(2),
        })
    }

    /// Subtiles per row of a tile.
    pub fn across(&self) -> u32 {
        self.bits.isqrt()
    }

    /// Critical path: from a splat to whether any bit of its mask is set.
    pub fn path(&self, words: BinWords) -> Path {
        words.path().choose(self.bits)
    }

    /// Bits of a mask in the entries of lists in memory.
    pub fn listed_bits(&self) -> u32 {
        match self.made {
            MaskMaker::Bin => self.bits,
            MaskMaker::List => 0,
        }
    }

    /// Cycles of a mask with this number of subtiles to test.
    pub fn cycles(&self, subtiles: u64) -> u64 {
        subtiles.div_ceil(self.tests.into()).max(1)
    }
}

impl Machine {
    /// Bits of a mask in the entries of lists in memory; 0 without masks.
    pub fn listed_mask_bits(&self) -> u32 {
        Masks::of(self).map_or(0, |masks| masks.listed_bits())
    }

    /// Tiles of a splat's box that `bin` lists per cycle. Values out of range are limited here and
    /// refused by elaboration.
    pub fn tiles_per_cycle(&self) -> u32 {
        let tiles = self.bin.and_then(|bin| bin.tiles_per_cycle);
        tiles.unwrap_or(1).clamp(1, MOST_TILES_PER_CYCLE)
    }

    /// Refuses masks that cannot be.
    pub fn check_masks(&self, e: &mut Elaboration) {
        self.check_blocks(e);
        let Some(bin) = self.bin else { return };
        let Some(subtile_px) = bin.subtile_px else {
            let given = [
                ("masks", bin.masks.is_some()),
                ("mask_tests", bin.mask_tests.is_some()),
            ];
            for (name, _) in given.into_iter().filter(|(_, is_given)| *is_given) {
                e.errors.push(format!(
                    "bin.{name} describes masks of subtiles, but bin.subtile_px is left out: leave bin.{name} out, or let bin.subtile_px be 4, 8 or 16"
                ));
            }
            return;
        };
        e.require(self.contribution.is_none(), || {
            "contribution makes the masks of entries, but bin.subtile_px makes others: leave one of them out".into()
        });
        let side_px = self.timing.tile.side_px;
        let tests = bin.mask_tests.unwrap_or(1);
        e.require(bin.test != BinTest::Box, || {
            "bin.subtile_px needs a test of subtiles, but bin.test is box, and raster walks no pixel outside of the box: use oriented-box or ellipse".into()
        });
        e.require((1..=MOST_BITS).contains(&tests), || {
            format!("bin.mask_tests is {tests}: it can be 1 to {MOST_BITS}")
        });
        if !SIDES_PX.contains(&subtile_px) {
            e.errors.push(format!(
                "bin.subtile_px is {subtile_px}: it can be 4, 8 or 16"
            ));
            return;
        }
        if !side_px.is_multiple_of(subtile_px) || side_px == 0 {
            e.errors.push(format!(
                "bin.subtile_px is {subtile_px}, but a tile of timing.tile.side_px {side_px} does not consist of whole subtiles"
            ));
            return;
        }
        let across = u64::from(side_px / subtile_px);
        e.require(across * across <= u64::from(MOST_BITS), || {
            format!(
                "bin.subtile_px is {subtile_px}, but a tile of timing.tile.side_px {side_px} has {} such subtiles: a mask has at most {MOST_BITS} bits",
                across * across
            )
        });
    }

    /// Refuses tests of blocks that the microarchitecture cannot make.
    fn check_blocks(&self, e: &mut Elaboration) {
        let timing = self.timing.contribution;
        let Some(contribution) = self.contribution else {
            return e.require(timing.is_none(), || {
                "timing.contribution describes a test of blocks, but the machine has no `contribution`: leave it out".into()
            });
        };
        let blocks = timing.unwrap_or_default().blocks;
        e.require((1..=MOST_BLOCKS).contains(&blocks), || {
            format!("timing.contribution.blocks is {blocks}: it can be 1 to {MOST_BLOCKS}")
        });
        e.require(self.timing.organisation == Organisation::Binned, || {
            "timing.organisation is immediate, but contribution tests the blocks of a tile: leave `contribution` out, or use binned".into()
        });
        let (side_px, block_px) = (self.timing.tile.side_px, contribution.block_px);
        if ![4, 8].contains(&block_px) {
            return;
        }
        if !side_px.is_multiple_of(block_px) || side_px == 0 {
            e.errors.push(format!(
                "contribution.block_px is {block_px}, but a tile of timing.tile.side_px {side_px} does not consist of whole blocks"
            ));
            return;
        }
        let blocks = u64::from(side_px / block_px).pow(2);
        e.require(blocks <= u64::from(MOST_BITS), || {
            format!(
                "contribution.block_px is {block_px}, but a tile of timing.tile.side_px {side_px} has {blocks} such blocks: a mask has at most {MOST_BITS} bits"
            )
        });
    }
}

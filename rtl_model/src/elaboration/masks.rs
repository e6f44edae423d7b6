//! Masks: the subtiles of a tile that a splat reaches, one bit each, in the entries of a list.
//!
//! ```text
//! entry: index of the splat │ mask      bits by rows of subtiles, the first in the LSB
//! ```
//! A bit is the result of the test of tiles for the part of the splat's box in the subtile. It is 0
//! where the box has no part.
//!
//! Laws: `masks_that_cannot_be_are_refused`, `masks_are_never_free`.

use super::latency::Path;
use super::{Elaboration, microarchitecture::BinWords};
use crate::machine::{BinTest, Machine, MaskMaker};
use schemars::JsonSchema;
use serde::Serialize;

/// Greatest number of bits of a mask.
const MOST_BITS: u32 = 64;
/// Greatest number of tiles that `bin` lists per cycle.
pub const MOST_TILES_PER_CYCLE: u32 = 16;
/// Sides of subtiles, pixels.
const SIDES_PX: [u32; 3] = [4, 8, 16];

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
        let bin = machine.bin?;
        let subtile_px = bin.subtile_px?.clamp(1, 1 << 14);
        let across = (machine.timing.tile.side_px / subtile_px).clamp(1, 8);
        Some(Masks {
            subtile_px,
            made: bin.masks.unwrap_or_default(),
            tests: bin.mask_tests.unwrap_or(1).clamp(1, MOST_BITS),
            bits: across * across,
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
}

//! Sorter: sorts the list of one tile at a time, if `sort.kind` is not `radix`.
//!
//! ```text
//!          ┌──────────┐ network at a time ┌─────────┐ runs ┌──────────────┐ last pass ┌──────────┐
//! list ─►  │  loaded  │ ────────────────► │ network │ ───► │ merged ⇄ too │ ────────► │  stored  │ ─► memory
//!          └──────────┘                   └─────────┘      └──────────────┘  1 a cycle└──────────┘
//! ```
//! Each bordered box is a buffer of `buffer_entries`, except the network, which has registers after
//! each stage. Without merging (the network is as wide as the buffer), the two buffers in the
//! middle are not built. Without a network, runs are single entries.
//!
//! Laws: `every_part_of_a_sorter_is_counted`, `a_sorter_that_cannot_be_is_refused`.

use super::latency::Path;
use super::microarchitecture::{ENTRY_BYTES, SORT_COUNT_BITS};
use super::{Elaboration, Operator, unit};
use crate::machine::timing::Sorter;
use crate::machine::{BinTest, Incremental, Machine, MaskMaker, Sort, SortKind};
use schemars::JsonSchema;
use serde::Serialize;

/// Sorters of lists, every value given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct SorterShape {
    /// Parallel sorters.
    pub units: u32,
    /// Entries that one sorter sorts at a time.
    pub buffer_entries: u32,
    /// Entries that its network sorts at a time.
    pub network: u32,
    /// Cycles of the network.
    pub network_latency: u32,
    /// Upper bits of the key that select a bucket; none if lists are not distributed to buckets.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bucket_bits: Option<u32>,
    /// Whether lists are sorted while earlier tiles are drawn.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub overlap: bool,
    /// Tile engines that then wait for lists.
    #[serde(skip)]
    pub engines: u32,
    /// Bits of the key.
    pub key_bits: u32,
    /// Bits of the mask in an entry.
    #[serde(skip)]
    pub mask_bits: u32,
    /// Whether lists are kept from frame to frame, and merged with new entries.
    #[serde(skip)]
    pub keeps_lists: bool,
}

/// Bytes of a splat's box in memory, and bits of each of its four coordinates.
pub const BOX_BYTES: u32 = 8;
const BOX_BITS: u32 = 8 * BOX_BYTES;
const COORDINATE_BITS: i32 = 16;

/// Default of `bucket_bits`.
const BUCKET_BITS: u32 = 6;

impl SorterShape {
    /// Bits of an entry that are compared: index of the splat, and its key.
    fn compared_bits(&self) -> i32 {
        (8 * ENTRY_BYTES + self.key_bits) as i32
    }

    /// Bits of an entry, with its mask.
    fn entry_bits(&self) -> i32 {
        self.compared_bits() + self.mask_bits as i32
    }

    /// Compare-exchange elements of a network: half as many per stage as entries.
    fn exchanges(&self) -> u32 {
        self.network / 2 * self.network_latency
    }

    /// Critical path of a merger: it compares the heads of two runs and takes one; the next
    /// comparison depends on it.
    pub fn merge_path(&self) -> Path {
        Path::default().sum(self.compared_bits()).choose(2)
    }

    /// Bits of the buffers of all sorters. If lists are distributed to buckets, each bucket has a
    /// burst and a count.
    pub fn memory_bits(&self, burst_bytes: u32) -> u64 {
        let buffers = if self.network < self.buffer_entries {
            4
        } else {
            2
        };
        let buffered = buffers * u64::from(self.buffer_entries) * self.entry_bits() as u64;
        let bucket = 8 * u64::from(burst_bytes) + SORT_COUNT_BITS;
        let buckets = self.bucket_bits.map_or(0, |bits| bucket << bits);
        // Both lists of a merge are loaded at the same time: each has a buffer that is loaded.
        let merged = if self.keeps_lists {
            u64::from(self.buffer_entries) * self.entry_bits() as u64
        } else {
            0
        };
        // Bursts of boxes: two that are read, and one that is gathered; and the burst of a list
        // that each engine gathers.
        let kept = if self.keeps_lists {
            8 * u64::from(burst_bytes) * (3 + u64::from(self.engines))
        } else {
            0
        };
        u64::from(self.units) * (buffered + buckets + merged) + kept
    }

    /// Declares the parts of the sorters.
    pub fn declare(&self, e: &mut Elaboration) {
        let (bits, compared) = (self.entry_bits(), self.compared_bits());
        e.copies(self.units, |e| {
            // The index of the splat is compared after the key, so entries with equal keys stay in
            // input order.
            e.adders(unit::SORT, self.exchanges(), compared);
            e.copies(2 * self.exchanges(), |e| e.choice(unit::SORT, 2, bits));
            e.copies(self.network * self.network_latency, |e| {
                e.part(unit::SORT, Operator::Register(bits))
            });
            // Comparison of two heads, and register of the entry that leaves.
            e.adders(unit::SORT, 1, compared);
            e.choice(unit::SORT, 2, bits);
            e.copies(3, |e| e.part(unit::SORT, Operator::Register(bits)));
            // Addresses of the loaded entry, of both heads, of the stored entry, and of the end of
            // each run.
            e.adders(unit::SORT, 6, SORT_COUNT_BITS as i32);
            e.copies(6, |e| {
                e.part(unit::SORT, Operator::Register(SORT_COUNT_BITS as i32))
            });
            // Merges the stored list with the new entries: comparison of both heads, registers of
            // the heads, and their addresses and ends.
            if self.keeps_lists {
                e.adders(unit::SORT, 1, compared);
                e.choice(unit::SORT, 2, bits);
                e.copies(2, |e| e.part(unit::SORT, Operator::Register(bits)));
                e.adders(unit::SORT, 4, SORT_COUNT_BITS as i32);
                e.copies(4, |e| {
                    e.part(unit::SORT, Operator::Register(SORT_COUNT_BITS as i32))
                });
            }
            // Increments the count of a bucket.
            if self.bucket_bits.is_some() {
                e.adders(unit::SORT, 1, SORT_COUNT_BITS as i32);
            }
        });
        if self.keeps_lists {
            // The box of the frame before, and the four comparisons of it with a tile; the addresses
            // of both boxes.
            e.part(unit::BIN, Operator::Register(BOX_BITS as i32));
            e.adders(unit::BIN, 4, COORDINATE_BITS);
            e.adders(unit::BIN, 2, SORT_COUNT_BITS as i32);
            e.copies(2, |e| {
                e.part(unit::BIN, Operator::Register(SORT_COUNT_BITS as i32))
            });
            // The four comparisons of a record's box with the tile, the entry that is written back,
            // and its address.
            e.copies(self.engines, |e| {
                e.adders(unit::LIST, 4, COORDINATE_BITS);
                e.part(unit::LIST, Operator::Register(compared));
                e.adders(unit::LIST, 1, SORT_COUNT_BITS as i32);
                e.part(unit::LIST, Operator::Register(SORT_COUNT_BITS as i32));
            });
        }
        // Number of the list that each sorter works on. Each engine compares it with its own.
        if self.overlap {
            let bits = SORT_COUNT_BITS as i32;
            e.copies(self.units, |e| e.part(unit::SORT, Operator::Register(bits)));
            e.adders(unit::SORT, self.units * self.engines, bits);
        }
        // Connects the sorters to the lists and to memory.
        e.choice(unit::SORT, self.units, bits);
    }
}

impl Machine {
    /// Refuses lists that cannot be kept from frame to frame.
    fn check_kept_lists(&self, e: &mut Elaboration) {
        let Some(kept) = self.keeps_lists() else {
            let given = self.sort.and_then(|sort| sort.incremental);
            e.require(given.is_none(), || {
                "sort.incremental describes lists that are kept from frame to frame, and sort.kind is another: leave it out, or let sort.kind be incremental".into()
            });
            return;
        };
        let Incremental { tile_px, chunk } = kept;
        e.require(tile_px >= 16 && tile_px.is_multiple_of(16), || {
            format!("sort.incremental.tile_px is {tile_px}: it must be a multiple of 16")
        });
        let side_px = self.timing.tile.side_px;
        e.require(tile_px == side_px, || {
            format!("sort.incremental.tile_px is {tile_px}, and timing.tile.side_px is {side_px}: lists that are kept decide the picture, so both must be equal")
        });
        e.require(
            chunk.is_power_of_two() && (4..=65_536).contains(&chunk),
            || format!("sort.incremental.chunk is {chunk}: it must be a power of two, 4 to 65536"),
        );
        let buffer = self.timing.sort.unwrap_or_default().buffer_entries;
        e.require(chunk == buffer, || {
            format!("sort.incremental.chunk is {chunk}, and timing.sort.buffer_entries is {buffer}: chunks decide the picture, so both must be equal")
        });
        let bin = self.bin.unwrap_or_default();
        let masks = bin.subtile_px.and(bin.masks.or(Some(MaskMaker::Bin)));
        e.require(
            bin.test == BinTest::Box || masks == Some(MaskMaker::List),
            || {
                "sort.kind is incremental, which lists every tile of a box: bin.test must be box, or have masks of subtiles that list makes (bin.masks list)".into()
            },
        );
    }

    /// The sorters of a machine that sorts lists one by one. Impossible ones are refused.
    pub fn sorter_shape(&self, e: &mut Elaboration) -> Option<SorterShape> {
        self.check_kept_lists(e);
        let t = &self.timing;
        let is_radix = |sort: &Sort| sort.kind == SortKind::Radix;
        let Some(sort) = self.sorting().filter(|sort| !is_radix(sort)) else {
            e.require(t.sort.is_none(), || {
                let why = match self.sort {
                    Some(sort) if is_radix(&sort) => "sort.kind is radix, which sorts in memory",
                    Some(_) => "sort.kind is none",
                    None => "the machine has no `sort`",
                };
                format!("timing.sort describes sorters of tiles' lists, but {why}: leave it out, or let sort.kind be tile, hierarchical or incremental")
            });
            return None;
        };
        let Sorter {
            units,
            buffer_entries,
            network,
            bucket_bits,
            overlap,
        } = t.sort.unwrap_or_default();
        e.require((1..=64).contains(&units), || {
            format!("timing.sort.units is {units}: it can be 1 to 64")
        });
        let powers = [
            ("buffer_entries", buffer_entries, 4, 65_536),
            ("network", network, 1, 1024),
        ];
        for (name, value, least, most) in powers {
            e.require(value.is_power_of_two() && (least..=most).contains(&value), || {
                format!("timing.sort.{name} is {value}: it must be a power of two, {least} to {most}")
            });
        }
        let are_powers = powers.iter().all(|(_, value, least, most)| {
            value.is_power_of_two() && (least..=most).contains(&value)
        });
        e.require(network <= buffer_entries || !are_powers, || {
            format!("timing.sort.network is {network}, more than the {buffer_entries} entries of timing.sort.buffer_entries")
        });
        let key_bits = sort.key.format.width().max(1) as u32;
        let bucket_bits = match (sort.kind, bucket_bits) {
            (SortKind::Hierarchical, given) => {
                let most = key_bits.min(12);
                let bits = given.unwrap_or(BUCKET_BITS.min(most));
                e.require((1..=most).contains(&bits), || {
                    format!("timing.sort.bucket_bits is {bits}: it can be 1 to {most}, upper bits of sort.key")
                });
                Some(bits.clamp(1, most))
            }
            (_, Some(bits)) => {
                let kind = if sort.kind == SortKind::Incremental {
                    "incremental"
                } else {
                    "tile"
                };
                e.errors.push(format!(
                    "timing.sort.bucket_bits is {bits}, but sort.kind {kind} has no buckets: leave it out, or let sort.kind be hierarchical"
                ));
                None
            }
            (_, None) => None,
        };
        // Values out of range are refused already; the limits here keep elaboration safe.
        let buffer_entries = buffer_entries.clamp(4, 65_536).next_power_of_two();
        let network = network
            .clamp(1, 1024.min(buffer_entries))
            .next_power_of_two();
        let stages = network.ilog2();
        let network_latency = stages * (stages + 1) / 2;
        let shape = SorterShape {
            units: units.clamp(1, 64),
            buffer_entries,
            network,
            network_latency,
            bucket_bits,
            overlap,
            engines: t.engines.unwrap_or(1),
            key_bits,
            mask_bits: self.listed_mask_bits(),
            keeps_lists: self.keeps_lists().is_some(),
        };
        let path = shape.merge_path();
        e.require(path.least_cycles(t.technology, t.clock_hz) == Some(1), || {
            let highest = path.highest_clock(t.technology, 1).unwrap_or(u64::MAX);
            format!(
                "timing.clock_hz is {}, but a sorter takes one of two entries in a cycle: at most {} MHz in {}",
                t.clock_hz,
                highest / 1_000_000,
                t.technology.name()
            )
        });
        Some(shape)
    }
}

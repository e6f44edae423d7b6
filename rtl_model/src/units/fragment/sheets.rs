//! Sheets: sums fragments of the same sheet, and blends a sheet when the next one begins (EWA §7.1,
//! docs/book/algorithm-resolve.md §9).
//!
//! ```text
//! weight, sheet, rgb ─►[ sheet = open? ]─┬─ yes ─► accumulate: Σw, Σw·rgb
//!                                        └─ no ──► close: x = Σw ─►[ ratio ρ(x) = α/x ]─► α = x·ρ, Σw·rgb·ρ ─►[ over ]─► composite
//! ```
//! Two slots per pixel: the open sheet, and the composite of the sheets before it. The rule that
//! opens a fragment is "another sheet" instead of "|Δz| ≥ ε". Sums, their fits and the blend are
//! those of surfaces. Σw is a sheet's optical depth x. Its opacity is x itself, up to 1 (e^(−x) ≈
//! 1 − x, EWA (6)), or 1 − e^(−x). The table holds the ratio of the two, which scales colour and
//! opacity alike.
//!
//! Where every splat is its own sheet (Gaussians), nothing is summed: its weight, clamped to a
//! limit, is its opacity, and it is blended immediately.
//!
//! A pixel that lets less than `stop` through accepts no more contributions.

use super::{
    Attributes, COLOUR, Decision, Fragment, OPACITY, Premultiplied, Slot, Sums, UNIT, WEIGHT,
};
use crate::elaboration::{Elaboration, Operator};
use crate::frame::{self, Each};
use crate::functions::{Table, table};
use crate::kernels::{Accumulator, HostPath, NO_MATCH, PackedSlot, PackedSums, PackedTile};
use crate::machine::{self, Machine};
use crate::num::{Exact, Fit, three};
use crate::probe::{Probe, Tap};
pub use crate::records::Held;
use crate::records::STOPPED;
use crate::records::unit;

/// Parts of the unit that only sheets use.
#[derive(Clone, Debug)]
pub(super) struct SheetDatapath {
    index: Fit,
    ratio: Fit,
    shape: crate::machine::TableShape,
    argument_bits: u32,
    /// Σw·ρ and Σw·rgb·ρ.
    closed: [Fit; 2],
    /// Σw and Σw·rgb, unscaled.
    plain: [Fit; 2],
}

/// Input port: one contribution to a sheet.
#[derive(Clone, Copy, Debug)]
pub struct SheetInput<'a> {
    /// Number of the sheet.
    pub sheet: u32,
    /// w (`gauss.weight`).
    pub weight: i64,
    /// Attributes of the splat.
    pub attributes: &'a Attributes,
}

/// Registers of the sheets, and their table.
#[derive(Clone, Debug)]
pub struct SheetRegisters<'a> {
    /// Settings of the frame.
    pub sheets: &'a frame::Sheets,
    /// ρ.
    pub ratio: Option<Table>,
}

impl SheetDatapath {
    pub(super) fn new(e: &mut Elaboration, machine: &Machine) -> Option<Self> {
        let (m, premultiplied) = (&machine.fragment, machine.shade.premultiplied);
        let words = m.sheets.as_ref()?;
        if words.composite.is_some() {
            return Some(SheetDatapath::of_composite(e, machine, words));
        }
        for (name, word) in [("depth_index", words.depth_index), ("ratio", words.ratio)] {
            e.number(UNIT, name, word, false);
            e.fixed_point(UNIT, &format!("sheets.{name}"), word);
        }
        e.holds_one(UNIT, "ratio", words.ratio);
        // A splat that is lit before it is drawn has weight 1 and is opaque.
        e.require(m.weight_sum.format.max() >= m.weight_sum.format.one(), || {
            format!("fragment.weight_sum is {} and must hold 1: splats are lit before they are drawn", m.weight_sum)
        });
        e.require(m.opacity_sum.format.max() >= m.opacity_sum.format.one(), || {
            format!("fragment.opacity_sum is {} and must hold 1: splats are lit before they are drawn", m.opacity_sum)
        });
        e.require(m.layers >= 2, || {
            format!(
                "fragment.layers is {}, but sheets need two: the open one and those before it",
                m.layers
            )
        });
        let argument = words.depth_index.format;
        let shape = table::shape(e, UNIT, "sheets.table", words.table, argument.width());
        e.part(
            UNIT,
            Operator::Rom([1 << shape.index_bits, words.ratio.format.width()]),
        );
        let fraction_bits = Table::fraction_bits(shape.index_bits, argument.width() as u32);
        table::interpolator(e, UNIT, shape, words.ratio, fraction_bits);
        let scaled = [m.weight_sum, m.colour_sum].map(|sum| e.times(UNIT, sum, words.ratio));
        let mut fit = |from: Exact| e.fit(unit::SHADE, "premultiplied", premultiplied, from);
        let closed = scaled.map(&mut fit);
        let plain = [m.weight_sum, m.colour_sum].map(|sum| fit(sum.into()));
        Some(SheetDatapath {
            closed,
            plain,
            index: e.fit(UNIT, "depth_index", words.depth_index, m.weight_sum),
            ratio: e.fit(
                UNIT,
                "ratio",
                words.ratio,
                table::interpolated(words.ratio, fraction_bits),
            ),
            shape,
            argument_bits: argument.width() as u32,
        })
    }

    /// Of a machine that blends each Gaussian at once: it has no table.
    fn of_composite(e: &mut Elaboration, machine: &Machine, words: &machine::Sheets) -> Self {
        let (m, premultiplied) = (&machine.fragment, machine.shade.premultiplied);
        e.require(m.layers == 1, || {
            format!(
                "fragment.layers is {}, but with fragment.sheets.composite a pixel holds one composite: 1 would fit",
                m.layers
            )
        });
        e.require(
            m.opacity_sum.format.max() >= m.opacity_sum.format.one(),
            || {
                format!(
                    "fragment.opacity_sum is {} and must hold 1: a pixel's stop has this word",
                    m.opacity_sum
                )
            },
        );
        e.require(machine.sorting().is_some(), || {
            "fragment.sheets.composite needs a sort: Gaussians are drawn the farthest first".into()
        });
        let plain = [m.weight_sum, m.colour_sum]
            .map(|sum| e.per_lane(|e| e.fit(unit::SHADE, "premultiplied", premultiplied, sum)));
        // Not declared: nothing is looked up.
        let unused = |word: crate::num::Word| Fit::new(plain[0].signal, word, word.into());
        SheetDatapath {
            closed: plain,
            plain,
            index: unused(words.depth_index),
            ratio: unused(words.ratio),
            shape: words.table,
            argument_bits: words.depth_index.format.width().max(0) as u32,
        }
    }

    /// Colour times opacity, and opacity, of a closed sheet.
    fn close<P: Probe>(
        &self,
        sums: &Sums,
        ratio: Option<&Table>,
        one: i64,
        tap: &mut Tap<P>,
    ) -> Premultiplied {
        let [of_weight, of_colour] = if ratio.is_some() {
            &self.closed
        } else {
            &self.plain
        };
        let scale = ratio.map_or(1, |table| {
            let index = tap.fit_one(&self.index, sums[WEIGHT]);
            tap.fit_one(table.fit(), table.exact(index))
        });
        Premultiplied {
            colour: three!(channel => tap.fit_one(of_colour, sums[COLOUR + channel] * scale)),
            opacity: tap.fit_one(of_weight, sums[WEIGHT] * scale).min(one),
        }
    }
}

/// Whether a pixel accepts no more contributions.
#[inline(always)]
pub fn has_stopped<A: Accumulator>(tile: &PackedTile<A>, pixel: u8) -> bool {
    tile.live(pixel) > 0 && tile.key(pixel, 0) & STOPPED != 0
}

impl Fragment {
    /// A frame's registers for sheets.
    pub fn sheets<'a>(&self, sheets: &'a frame::Sheets) -> SheetRegisters<'a> {
        let table = |own: &SheetDatapath| {
            Table::new(
                own.ratio,
                own.shape.index_bits,
                own.argument_bits,
                own.shape.interpolation,
                &sheets.ratio,
            )
        };
        let ratio = self
            .sheets
            .as_ref()
            .filter(|_| !sheets.ratio.is_empty())
            .map(table);
        SheetRegisters { sheets, ratio }
    }

    /// Adds one contribution to the sheet with this number.
    #[inline(always)]
    pub fn contribute_to_sheet<H: HostPath, P: Probe>(
        &self,
        tile: &mut PackedTile<H::Accumulator>,
        pixel: u8,
        input: SheetInput,
        registers: &SheetRegisters,
        tap: &mut Tap<P>,
    ) -> Decision {
        let SheetInput {
            sheet,
            weight,
            attributes,
        } = input;
        tile.count(pixel);
        let live = tile.live(pixel);
        if has_stopped(tile, pixel) {
            return Decision::Dropped;
        }
        let each = registers.sheets.each == Each::Splat;
        let key = sheet as i32 & !NO_MATCH;
        if !each && live > 0 && tile.key(pixel, 1) == key {
            self.accumulate::<H, P>(tile.sums_mut(pixel, 1), weight, attributes, tap);
            return Decision::Accumulated(1);
        }
        let mut fresh = PackedSlot {
            sums: PackedSums::default(),
            key,
            material: 0,
        };
        let held = if each {
            weight.min(registers.sheets.most_weight)
        } else {
            weight
        };
        self.accumulate::<H, P>(&mut fresh.sums, held, attributes, tap);
        if live == 0 {
            tile.write(
                pixel,
                0,
                PackedSlot {
                    key: NO_MATCH,
                    ..PackedSlot::default()
                },
            );
            tile.set_live(pixel, 2);
        }
        if each {
            if !self.blend_sheet(tile, pixel, &fresh.sums, registers, tap) {
                return Decision::Dropped;
            }
        } else {
            if live > 0 {
                let open = *tile.sums(pixel, 1);
                self.blend_sheet(tile, pixel, &open, registers, tap);
                if has_stopped(tile, pixel) {
                    tile.set_live(pixel, 1);
                    return Decision::Dropped;
                }
            }
            tile.write(pixel, 1, fresh);
        }
        if live == 0 {
            Decision::Inserted(u8::from(!each))
        } else {
            Decision::Merged(0, 1)
        }
    }

    /// Blends a closed sheet; `false` if it is left out because it would let too little
    /// through.
    fn blend_sheet<A: Accumulator, P: Probe>(
        &self,
        tile: &mut PackedTile<A>,
        pixel: u8,
        sums: &PackedSums<A>,
        registers: &SheetRegisters,
        tap: &mut Tap<P>,
    ) -> bool {
        let frame::Sheets {
            back_to_front,
            stop,
            keeps_last,
            ..
        } = *registers.sheets;
        let composite = tile.slot(pixel, 0);
        let Some(blended) = self.blended_sheet(&composite, sums, registers, tap) else {
            return false;
        };
        let opaque =
            !back_to_front && self.sums[OPACITY].word.format.one() - blended[OPACITY] < stop;
        let key = NO_MATCH | if opaque { STOPPED } else { 0 };
        let kept = !opaque || keeps_last;
        let sums = if kept {
            PackedSums::put(&blended)
        } else {
            PackedSums::put(&composite.sums)
        };
        tile.write(
            pixel,
            0,
            PackedSlot {
                sums,
                key,
                material: 0,
            },
        );
        kept
    }

    fn blended_sheet<A: Accumulator, P: Probe>(
        &self,
        composite: &Slot,
        sums: &PackedSums<A>,
        registers: &SheetRegisters,
        tap: &mut Tap<P>,
    ) -> Option<Sums> {
        let own = self.sheets.as_ref()?;
        let sheet = own.close(
            &sums.get(),
            registers.ratio.as_ref(),
            1 << self.premultiplied_frac_bits,
            tap,
        );
        let before = self.shaded(composite, tap);
        let (over, under) = if registers.sheets.back_to_front {
            (&sheet, &before)
        } else {
            (&before, &sheet)
        };
        Some(self.blended(over, under, tap))
    }

    /// Composes a pixel's sheets; `None` where it has none.
    pub fn composite<A: Accumulator, P: Probe>(
        &self,
        tile: &PackedTile<A>,
        pixel: u8,
        registers: &SheetRegisters,
        tap: &mut Tap<P>,
    ) -> Option<Premultiplied> {
        let live = tile.live(pixel);
        if live == 0 {
            return None;
        }
        let mut composite = tile.slot(pixel, 0);
        if live == 2 && registers.sheets.each == Each::Slice {
            composite.sums = self.blended_sheet(&composite, tile.sums(pixel, 1), registers, tap)?;
        }
        Some(self.shaded(&composite, tap))
    }
}

pub mod real;

#[cfg(test)]
mod tests;

//! Sheets: the pixels of a tile whose fragments are grouped by sheets, in mixed precision.

use super::{FrameWords, MixedContribution, number};
use crate::golden::Outcomes;
use crate::golden::tiles::{PIXELS_IN_A_TILE, Painter};
use crate::hardware::registers::SheetWords;
use crate::scene::Sheet;
use rtl_model::real::MixedPrecision;

/// Σw and Σw·rgb.
type SheetSums = [f64; 4];

/// One pixel: the open sheet, and the composite of the sheets before it.
#[derive(Clone, Copy, Debug, Default)]
struct MixedSheet {
    open: Option<(u32, SheetSums)>,
    /// Colour times opacity, and opacity, as stored in a slot.
    composite: [f64; 4],
    stopped: bool,
}

/// The pixels of a tile.
pub(super) struct SheetPixels<'a> {
    frame: &'a FrameWords<'a>,
    words: &'a SheetWords<'a, MixedPrecision<'a>>,
    pixels: Vec<MixedSheet>,
}

impl<'a> SheetPixels<'a> {
    pub fn new(frame: &'a FrameWords<'a>, words: &'a SheetWords<'a, MixedPrecision<'a>>) -> Self {
        SheetPixels {
            frame,
            words,
            pixels: vec![MixedSheet::default(); PIXELS_IN_A_TILE],
        }
    }

    fn added(&self, sums: SheetSums, arrival: &MixedContribution, weight: f64) -> SheetSums {
        let [r, g, b, ..] = arrival.footprint.attributes;
        let (machine, weight) = (self.frame.stage.machine, self.frame.word(weight));
        let add = |(lane, attribute): (usize, f64)| {
            machine
                .real_accumulated(
                    lane,
                    self.frame.word(sums[lane]),
                    weight,
                    self.frame.word(attribute),
                )
                .value
        };
        [(0, 1.0), (1, r), (2, g), (3, b)].map(add)
    }

    /// The composite after one more sheet.
    fn blended(&self, composite: [f64; 4], sums: SheetSums) -> [f64; 4] {
        let machine = self.frame.stage.machine;
        let [weight, r, g, b] = sums.map(|sum| self.frame.word(sum));
        let sheet = machine.real_close(weight, [r, g, b], &self.words.registers, &self.words.ratio);
        let before = self.read(composite);
        let blended = if self.words.back_to_front {
            machine.real_merge(sheet, before)
        } else {
            machine.real_merge(before, sheet)
        };
        blended.map(number)
    }

    fn read(&self, composite: [f64; 4]) -> [MixedPrecision<'a>; 4] {
        self.frame
            .stage
            .machine
            .real_read(composite.map(|channel| self.frame.word(channel)))
    }

    /// Blends a finished sheet.
    fn close(&self, pixel: &mut MixedSheet, sums: SheetSums) {
        let blended = self.blended(pixel.composite, sums);
        pixel.stopped = !self.words.back_to_front && 1.0 - blended[3] < self.words.stop.value;
        if !pixel.stopped || self.words.sheets.keeps_last {
            pixel.composite = blended;
        }
    }
}

impl<'a> Painter for SheetPixels<'a> {
    type Contribution = MixedContribution<'a>;

    fn take(&mut self, at: usize, arrival: MixedContribution<'a>) {
        let mut pixel = self.pixels[at];
        if pixel.stopped {
            return;
        }
        match &self.words.sheets.of {
            Sheet::Splat => {
                let weight = arrival.weight.min(self.words.most_weight.value);
                let sums = self.added(SheetSums::default(), &arrival, weight);
                self.close(&mut pixel, sums);
            }
            of => {
                let sheet = match of {
                    Sheet::Slice(numbers) => numbers[arrival.footprint.splat as usize],
                    Sheet::Splat | Sheet::Sum => 0,
                };
                let before = match pixel.open.take() {
                    Some((open, sums)) if open == sheet => sums,
                    Some((_, sums)) => {
                        self.close(&mut pixel, sums);
                        SheetSums::default()
                    }
                    None => SheetSums::default(),
                };
                if !pixel.stopped {
                    pixel.open = Some((sheet, self.added(before, &arrival, arrival.weight)));
                }
            }
        }
        self.pixels[at] = pixel;
    }

    fn finish(&mut self, at: usize) -> [f64; 4] {
        let MixedSheet {
            open, composite, ..
        } = std::mem::take(&mut self.pixels[at]);
        let all = open.map_or(composite, |(_, sums)| self.blended(composite, sums));
        self.frame
            .stage
            .machine
            .real_resolve(&[self.read(all)], self.frame.background)
            .map(number)
    }

    fn outcomes(&self) -> Outcomes {
        Outcomes::default()
    }
}

//! Ellipsoids: made-up cases of axes, of the sort, and of sheets: changes of sheet, and pixels that
//! stop.

use super::super::observer::{flag, least_weight, outcome, outcomes};
use super::{CONTRIBUTIONS, Key, Maker, UNKNOWN, key, pixel_key};
use rtl_model::frame::Each;
use rtl_model::num::Format;
use rtl_model::pipeline::ports::Kind;
use rtl_model::pipeline::unit_replay::{self, Sheets};
use rtl_model::records::SHEET_BITS;
use rtl_model::units::fragment::sheets::Held;
use rtl_model::units::fragment::{OPACITY, TILE_PX, WEIGHT};
use std::collections::BTreeMap;

/// Integer quaternions with integer lengths.
const UNITS: [([i64; 4], i64); 6] = [
    ([1, 0, 0, 0], 1),
    ([1, 1, 1, 1], 2),
    ([1, 2, 2, 4], 5),
    ([1, 1, 3, 5], 6),
    ([2, 4, 5, 6], 9),
    ([0, 3, 4, 0], 5),
];

/// Sheets of the pixels, tile by tile.
struct SheetTiles<'a> {
    maker: Sheets<'a>,
    tiles: BTreeMap<[i64; 2], Sheets<'a>>,
}

impl<'a> SheetTiles<'a> {
    fn of(&mut self, [x, y]: [i64; 2]) -> (&mut Sheets<'a>, usize) {
        let side = TILE_PX as i64;
        let tile = self
            .tiles
            .entry([x / side, y / side])
            .or_insert_with(|| self.maker.clone());
        (tile, (y % side * side + x % side) as usize)
    }

    fn held(&mut self, at: [i64; 2]) -> Option<Held> {
        let (tile, pixel) = self.of(at);
        tile.held(pixel)
    }
}

impl Maker<'_> {
    /// Consistent axes, which are rotations with one scale equal to 1, for the splats with likely
    /// positions.
    pub(super) fn likely_axes(&mut self, splats: &mut [Vec<i64>]) {
        let Some(own) = &self.machine.machine.ellipse.ellipsoid else {
            return;
        };
        if self.frame.ellipsoids.is_none() {
            return;
        }
        let (format, scale) = (
            own.quaternion.format,
            own.scale.format.one().min(own.scale.format.max()),
        );
        for words in splats.iter_mut().skip(1).step_by(2) {
            let random = &mut self.random;
            let (mut parts, length) = random.among(&UNITS);
            parts.rotate_left(random.below(4) as usize);
            let signs = [(); 4].map(|()| if random.one_in(2) { -1 } else { 1 });
            for (part, sign) in parts
                .iter()
                .zip(signs)
                .enumerate()
                .map(|(i, (part, sign))| (i, part * sign))
            {
                words[7 + part] = (sign * format.one() / length).clamp(format.min(), format.max());
            }
            words[11..14]
                .iter_mut()
                .for_each(|word| *word = random.below(scale + 1));
            words[11 + random.below(3) as usize] = scale;
        }
    }

    /// Opacities around the least that is drawn, and on both sides of each change of address in the
    /// table of cutoffs, for the splats with likely positions.
    pub(super) fn at_reach(&mut self, splats: &mut [Vec<i64>]) {
        let Some(ellipsoids) = &self.frame.ellipsoids else {
            return;
        };
        let format = self.machine.machine.splat.opacity.format;
        let steps = ellipsoids.kernel.reach.len() as i64;
        for words in splats.iter_mut().step_by(3) {
            let random = &mut self.random;
            let at = if steps == 0 || random.one_in(3) {
                ellipsoids.kernel.least_opacity
            } else {
                format.one() / steps * (1 + random.below(steps))
            };
            let by = random.below(3) - 1;
            words
                .iter_mut()
                .last()
                .into_iter()
                .for_each(|opacity| *opacity = (at + by).clamp(0, format.max()));
        }
    }

    /// Slopes of a point; one in eight is moved to the limit of the Jacobian or one LSB from it.
    pub(super) fn at_limits(&mut self, slope: [i64; 2]) -> [i64; 2] {
        let Some(ellipsoids) = &self.frame.ellipsoids else {
            return slope;
        };
        let (format, limits) = (
            self.machine.machine.project.slope.format,
            ellipsoids.kernel.jacobian,
        );
        let (random, coverage) = (&mut self.random, &mut self.seen.coverage);
        let slope = [0, 1].map(|axis| {
            let by = random.below(3) - 1;
            let at = limits[axis] * if random.one_in(2) { -1 } else { 1 } + by;
            if random.one_in(8) {
                at.clamp(format.min(), format.max())
            } else {
                slope[axis]
            }
        });
        for (slope, limit) in slope.into_iter().zip(limits) {
            for (by, name) in [
                (-1, "slope one within its limit"),
                (0, "slope at its limit"),
                (1, "slope one beyond its limit"),
            ] {
                coverage.count_if(slope.abs() == limit + by, "ellipse", name);
            }
        }
        slope
    }

    /// Amplitudes that give the least weight that is drawn, and their neighbours.
    pub(super) fn near_least(&mut self) -> Vec<[i64; 2]> {
        let m = &self.machine.machine;
        let (amplitude, places) = (
            m.ellipse.amplitude.format,
            m.ellipse.amplitude.format.frac_bits - m.gauss.weight.format.frac_bits,
        );
        let least = least_weight(self.frame);
        let at = if places >= 0 {
            least << places
        } else {
            least >> -places
        };
        let step = 1i64 << places.clamp(0, 62);
        (-64..=64i64)
            .map(|by| {
                [
                    0,
                    at.saturating_add(by.saturating_mul(step) / 16)
                        .clamp(0, amplitude.max()),
                ]
            })
            .collect()
    }

    /// Depths, with ties among their keys.
    pub(super) fn sort(&mut self) {
        let Some(sort) = self
            .machine
            .machine
            .sort
            .filter(|_| self.frame.ellipsoids.as_ref().is_some_and(|e| e.sorted))
        else {
            return;
        };
        let depth = self.machine.machine.project.depth.format;
        let one_key = 1i64 << (depth.frac_bits - sort.key.format.frac_bits).clamp(0, 60);
        let mut depths: Vec<i64> = Vec::new();
        for number in 0..self.cases as i64 {
            let near = if number == 0 {
                0
            } else {
                depths[self.random.below(number) as usize]
            };
            let nearby = near + self.random.below(2 * one_key + 1) - one_key;
            let any = self.random.word(depth);
            depths.push(depth.representable(if self.random.one_in(2) {
                any
            } else {
                nearby.clamp(0, depth.max())
            }));
        }
        for (tag, depth) in (0i64..).zip(&depths) {
            self.push("sort.in", vec![tag, *depth], key(UNKNOWN));
        }
        for (nth, word) in
            unit_replay::sort(self.machine, &depths, &mut self.seen).unwrap_or_default()
        {
            self.push("sort.out", vec![nth as i64, word], key(nth));
        }
        // Records of the sort have no flags, as in a scene's trace.
        self.seen.flush();
        self.tag("sort.in", "ties and random", 0);
    }

    /// Contributions to the open sheet and to the next one, weights that stop a pixel, and weights
    /// one LSB less.
    pub(super) fn sheets(&mut self) {
        let frame = self.frame;
        let Some(registers) = &frame.sheets else {
            return;
        };
        let formats = self.formats("fragment.in");
        let mut tiles = SheetTiles {
            maker: Sheets::new(self.machine, registers),
            tiles: BTreeMap::new(),
        };
        self.fill_sheet(&mut tiles, &formats);
        let sides = [frame.width, frame.height].map(i64::from);
        let mut at = [0, 0];
        for _ in 0..self.cases + CONTRIBUTIONS {
            if !self.random.one_in(3) {
                at = sides.map(|side| self.random.below(side));
            }
            // A pixel that has stopped ignores everything: few cases are enough.
            for _ in 0..4 {
                if tiles.held(at).is_some_and(|held| held.stopped) {
                    at = sides.map(|side| self.random.below(side));
                }
            }
            let held = tiles.held(at);
            let open = held
                .and_then(|held| held.open)
                .map(|(sheet, _)| i64::from(sheet));
            let sheet = self.sheet(open, formats[3]);
            let mut words: Vec<i64> = formats
                .iter()
                .map(|format| self.random.word(*format))
                .collect();
            words[..2].copy_from_slice(&at);
            words[2] = self.weight(formats[2]);
            words[3] = sheet;
            if registers.stop > 0 && self.random.one_in(16) {
                self.up_to_stop(&mut tiles, &mut words, open);
            }
            self.add_to_sheet(&mut tiles, words);
        }
        self.tag("fragment.in", "changes of sheet, stops and random", 0);
        for y in 0..sides[1] {
            for x in 0..sides[0] {
                self.end_of_sheets(&mut tiles, [x, y]);
            }
        }
    }

    /// The number of the open sheet, one above or below it, one that differs in its first bit, or
    /// any.
    fn sheet(&mut self, open: Option<i64>, format: Format) -> i64 {
        let random = &mut self.random;
        let Some(open) = open else {
            return random.word(format);
        };
        let sheet = match random.below(8) {
            0 => open + 1,
            1 => open - 1,
            2 => open ^ (1 << (SHEET_BITS - 1)),
            3 => random.word(format),
            _ => open,
        };
        sheet.clamp(0, format.max())
    }

    /// Mostly a small weight, because a pixel that has stopped accepts no more; sometimes the
    /// least, the greatest, or a neighbour of these.
    fn weight(&mut self, format: Format) -> i64 {
        let Some(registers) = &self.frame.sheets else {
            return 1;
        };
        let least = least_weight(self.frame);
        let (most, one) = (registers.most_weight, format.one());
        let random = &mut self.random;
        let weight = match random.below(32) {
            0 => random.word(format),
            1 => most + random.below(3) - 1,
            2 => least + random.below(2),
            3 => random.below(one + 1),
            _ => least + random.below(one / 64),
        };
        let weight = weight.clamp(least, format.max());
        let cases = [
            (least, "weight at the least"),
            (most, "weight at the most"),
            (most + 1, "weight one above the most"),
        ];
        for (at, name) in cases {
            self.seen.coverage.count_if(weight == at, "fragment", name);
        }
        weight
    }

    /// The greatest contributions to one sheet: as many as its sums can hold, and two more.
    fn fill_sheet(&mut self, tiles: &mut SheetTiles, formats: &[Format]) {
        let sum = self.machine.machine.fragment.weight_sum.format;
        let by = formats[2].frac_bits - sum.frac_bits;
        let held = if by >= 0 {
            formats[2].max() >> by
        } else {
            formats[2].max() << -by
        };
        let count = (sum.max() / held.max(1) + 2).min(4096);
        let mut words = vec![0, 0, formats[2].max(), 5];
        words.extend(formats[4..].iter().map(|format| format.max()));
        for _ in 0..count {
            self.add_to_sheet(tiles, words.clone());
        }
    }

    /// The least weight that stops the pixel, or one LSB less. For slices: the words before it, and
    /// a contribution to the next sheet.
    fn up_to_stop(&mut self, tiles: &mut SheetTiles, words: &mut [i64], open: Option<i64>) {
        let Some(registers) = &self.frame.sheets else {
            return;
        };
        let at = [words[0], words[1]];
        let slices = registers.each == Each::Slice;
        if slices && open.is_none() {
            return;
        }
        let next = open.map_or(words[3], |open| (open + 1) & ((1 << SHEET_BITS) - 1));
        let with = |weight: i64, words: &[i64]| {
            let mut words: [i64; 7] = words.try_into().unwrap_or_default();
            (words[2], words[3]) = (weight, open.unwrap_or(next));
            words
        };
        let mut stops = |weight: i64| {
            let (tile, pixel) = tiles.of(at);
            let mut trial = tile.clone();
            trial.take(with(weight, words), &mut rtl_model::probe::NoProbe);
            if slices {
                let [x, y, _, _, r, g, b] = with(weight, words);
                trial.take([x, y, 1, next, r, g, b], &mut rtl_model::probe::NoProbe);
            }
            trial.held(pixel).is_some_and(|held| held.stopped)
        };
        let (mut below, mut above) = (least_weight(self.frame), registers.most_weight);
        if stops(below) || !stops(above) {
            return;
        }
        while above - below > 1 {
            let middle = (above + below) / 2;
            *(if stops(middle) {
                &mut above
            } else {
                &mut below
            }) = middle;
        }
        words[2] = if self.random.one_in(2) { above } else { below };
        self.seen.coverage.count(
            "fragment",
            if words[2] == above {
                "the least weight that stops"
            } else {
                "one less than that"
            },
        );
        if slices {
            let before = with(words[2], words);
            self.add_to_sheet(tiles, before.to_vec());
            words[3] = next;
        }
    }

    fn add_to_sheet(&mut self, tiles: &mut SheetTiles, words: Vec<i64>) {
        let words = self.held("fragment.in", words);
        let at = [words[0], words[1]];
        let input = self.push("fragment.in", words.clone(), pixel_key(at, UNKNOWN));
        let before = tiles.held(at);
        let (tile, pixel) = tiles.of(at);
        let decision = tile.take(words.clone().try_into().unwrap_or_default(), &mut self.seen);
        let flags = self.seen.flush() | flag::of_decision(decision);
        let after = tile.held(pixel).unwrap_or_default();
        let [outcome, slot, _] = outcome(decision, 0);
        self.cover_sheet(before, after, words[3], outcome);
        let key = Key {
            slot: slot.into(),
            flags,
            ..pixel_key(at, input)
        };
        self.push(
            "fragment.out",
            vec![at[0], at[1], outcome.into(), slot.into()],
            key,
        );
    }

    fn cover_sheet(&mut self, before: Option<Held>, after: Held, sheet: i64, outcome: u8) {
        let Some(registers) = &self.frame.sheets else {
            return;
        };
        let meet = &mut self.seen.coverage;
        meet.count(
            "fragment",
            outcomes(Kind::of(self.frame))[usize::from(outcome)],
        );
        let stopped = before.is_some_and(|before| before.stopped);
        meet.count_if(stopped, "fragment", "stopped before");
        meet.count_if(after.stopped && !stopped, "fragment", "stops");
        if let Some((open, sums)) = before.and_then(|before| before.open) {
            let open = i64::from(open);
            for (other, name) in [
                (open, "the same sheet"),
                (open + 1, "the sheet after"),
                (open - 1, "the sheet before"),
            ] {
                meet.count_if(sheet == other, "fragment", name);
            }
            meet.count_if(
                sheet == open ^ (1 << (SHEET_BITS - 1)),
                "fragment",
                "a sheet that differs in its first bit",
            );
            let one = self.machine.machine.fragment.weight_sum.format.one();
            meet.count_if(
                sheet != open && sums[WEIGHT] > one,
                "fragment",
                "a sheet of more than 1 is blended",
            );
        }
        if outcome == 2 && !registers.back_to_front {
            let through =
                self.machine.machine.fragment.opacity_sum.format.one() - after.composite[OPACITY];
            meet.count_if(
                through == registers.stop,
                "fragment",
                "lets through as much as it must",
            );
        }
    }

    fn end_of_sheets(&mut self, tiles: &mut SheetTiles, at: [i64; 2]) {
        let (tile, pixel) = tiles.of(at);
        let (Some(held), Some(lit)) = (tile.held(pixel), tile.lit(pixel, &mut self.seen)) else {
            return;
        };
        self.seen.flush();
        let (sheet, open) = held.open.unwrap_or_default();
        let mut words = vec![
            at[0],
            at[1],
            held.stopped.into(),
            held.open.is_none().into(),
        ];
        words.extend(&held.composite[1..=OPACITY]);
        words.push(sheet.into());
        words.extend(&open[WEIGHT..OPACITY]);
        words.extend(lit.colour);
        words.push(lit.opacity);
        self.push("fragment.held", words, pixel_key(at, UNKNOWN));
    }
}

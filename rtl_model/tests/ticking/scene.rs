//! What is drawn? A plain list of splats and their pixels, drawn at random or read from a recorded
//! frame.

use super::frames::{Rng, in_tile};
use rtl_model::elaboration::microarchitecture::Microarchitecture;
use rtl_model::timing::Lists;
use rtl_model::work::{
    CULLED, CullReason, Event, MergedList, MergedLists, Recorder, TILE_PX, TestedWords, Work,
};
use std::collections::{BTreeMap, BTreeSet};

/// A splat, with the event of every pixel of its box, row by row; `None` for pixels that it does
/// not cover.
#[derive(Clone, Debug, PartialEq)]
pub struct Splat {
    pub cull_reason: CullReason,
    pub columns: [u16; 2],
    pub rows: [u16; 2],
    pub pixels: Vec<Option<Event>>,
}

impl Splat {
    pub fn culled(cull_reason: CullReason) -> Self {
        Splat {
            cull_reason,
            columns: [0; 2],
            rows: [0; 2],
            pixels: Vec::new(),
        }
    }

    /// One pixel.
    pub fn dot([x, y]: [u16; 2], event: Event) -> Self {
        Splat {
            cull_reason: CullReason::Drawn,
            columns: [x; 2],
            rows: [y; 2],
            pixels: vec![Some(event)],
        }
    }

    pub fn size(&self) -> [usize; 2] {
        [self.columns, self.rows].map(|[first, last]| usize::from(last - first) + 1)
    }

    /// A pixel, counted from the box's first.
    pub fn pixel(&self, column: usize, row: usize) -> Option<Event> {
        self.pixels[row * self.size()[0] + column]
    }
}

/// Final state of a pixel: the number of its fragments that were lit for merges, and of those that
/// are not lit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct End {
    pub lit: u8,
    pub unlit: u8,
}

/// Place of a splat, and column and row of a block of the picture.
type KeptBlock = (usize, [usize; 2]);

/// A frame: its splats, and the final state of each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    pub width: u32,
    pub height: u32,
    pub splats: Vec<Splat>,
    pub ends: Vec<End>,
    /// Splats are lit before they are drawn.
    pub preshaded: bool,
    /// Their axes are in registers.
    pub shared_axes: bool,
    /// Degree of their harmonics.
    pub harmonics: u8,
    /// Places of the drawn splats in drawing order; empty for submission order.
    pub order: Vec<usize>,
    /// Key of 24 bits by place, which sorts splats into this order; empty without an order.
    pub keys: Vec<u32>,
    /// Places of splats, and tiles of their boxes in whose lists they have no entry.
    pub unlisted: BTreeSet<(usize, usize)>,
    /// Masks of entries, by place of the splat and tile: a bit per subtile, by rows.
    pub masks: BTreeMap<(usize, usize), u64>,
    /// Side of a block in pixels, and the blocks that each place of a splat keeps: column and row of
    /// blocks of the picture. None if blocks are not tested.
    pub blocks: Option<(usize, BTreeSet<KeptBlock>)>,
    /// Lists that are kept from frame to frame, by tile; none if every list is sorted completely.
    pub kept: Option<KeptScene>,
    /// Texels per side of the map of reflected surroundings.
    pub mirrored: Option<usize>,
}

/// Lists that are kept from frame to frame.
#[derive(Clone, Debug, PartialEq)]
pub struct KeptScene {
    pub tile_px: u32,
    pub chunk: u32,
    /// The first chunk has half as many entries.
    pub is_odd: bool,
    /// By tile.
    pub lists: Vec<Vec<KeptEntry>>,
}

/// An entry of a kept list.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeptEntry {
    /// Place of its splat.
    pub place: usize,
    pub is_new: bool,
    /// The splat is culled, or its box does not touch the tile.
    pub has_departed: bool,
}

/// Fragment to be lit: of a splat before it is drawn, of a pixel in which this splat makes
/// fragments merge, or of a pixel at the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LitFragment {
    Splat(usize),
    Merge(usize, usize),
    End(usize),
}

fn any_event(rng: &mut Rng, dull: u64) -> Event {
    if rng.below(100) < dull {
        return Event::Accumulated;
    }
    match rng.below(9) {
        0..=2 => Event::Faint,
        3 => Event::Inserted,
        4 => Event::Merged(0),
        5 => Event::Merged(1),
        6 => Event::Merged(2),
        7 => Event::Evicted,
        _ => Event::Replaced,
    }
}

fn any_splat(
    rng: &mut Rng,
    [width, height]: [u32; 2],
    largest: u64,
    [covered, dull]: [u64; 2],
) -> Splat {
    let mut interval = |size: u32| {
        let length = 1 + rng.below(largest.min(u64::from(size)));
        let first = rng.below(u64::from(size) - length + 1);
        [first as u16, (first + length - 1) as u16]
    };
    let [columns, rows] = [interval(width), interval(height)];
    let mut splat = Splat {
        cull_reason: CullReason::Drawn,
        columns,
        rows,
        pixels: Vec::new(),
    };
    let area = splat.size()[0] * splat.size()[1];
    // Some keep nothing, some only faint pixels.
    let kind = rng.below(12);
    splat.pixels = (0..area)
        .map(|_| match kind {
            0 => None,
            1 => (rng.below(100) < covered).then_some(Event::Faint),
            _ => (rng.below(100) < covered).then(|| any_event(rng, dull)),
        })
        .collect();
    splat
}

/// A scene of at most this many pixels per side and this many splats.
pub fn random(rng: &mut Rng, size: [u64; 2], splats: u64) -> Scene {
    random_of(rng, size, splats, [1, 3, 6, 20])
}

/// One whose splats have at most one of these sides.
pub fn random_of(
    rng: &mut Rng,
    [width, height]: [u64; 2],
    splats: u64,
    largest: [u64; 4],
) -> Scene {
    let [width, height] = [width, height].map(|most| 1 + rng.below(most) as u32);
    let culled = rng.below(60);
    let largest = largest[rng.below(4) as usize];
    let covering = [1 + rng.below(100), rng.below(101)];
    let splats = (0..rng.below(splats + 1))
        .map(|_| match rng.below(100) < culled {
            true => Splat::culled(CULLED[rng.below(CULLED.len() as u64) as usize]),
            false => any_splat(rng, [width, height], largest, covering),
        })
        .collect();
    let lit = rng.below(4);
    let mut some = || {
        if rng.below(4) < lit {
            rng.below(4) as u8
        } else {
            0
        }
    };
    let ends = (0..width * height)
        .map(|_| End {
            lit: some(),
            unlit: some(),
        })
        .collect();
    let mut scene = Scene {
        width,
        height,
        splats,
        ends,
        preshaded: false,
        shared_axes: false,
        harmonics: 0,
        order: Vec::new(),
        keys: Vec::new(),
        unlisted: BTreeSet::new(),
        masks: BTreeMap::new(),
        blocks: None,
        kept: None,
        mirrored: None,
    };
    scene.clear_untouched();
    scene
}

impl Scene {
    /// First column and row of the look-up of the nth fragment, if it reflects anything.
    /// Neighbouring pixels mostly look up neighbouring texels.
    pub fn texel(&self, fragment: LitFragment, nth: usize) -> Option<[usize; 2]> {
        let side = self.mirrored?;
        let ([x, y], salt) = match fragment {
            LitFragment::Splat(place) => ([3 * place, place], place),
            LitFragment::Merge(place, pixel) => (
                [pixel % self.width as usize, pixel / self.width as usize],
                place,
            ),
            LitFragment::End(pixel) => (
                [pixel % self.width as usize, pixel / self.width as usize],
                7,
            ),
        };
        let mut rng = Rng((x + 977 * y + 31 * salt + nth) as u64);
        let near = |at: usize, by: u64| (at / 3 + by as usize) % (side - 1);
        let texel = [near(x, rng.below(3)), near(y, rng.below(2))];
        (rng.below(5) > 0).then_some(texel)
    }

    fn record_texels(&self, recorder: &mut Recorder, fragment: LitFragment, fragments: u8) {
        for nth in (0..fragments.into()).filter(|_| self.mirrored.is_some()) {
            recorder.lit();
            if let Some(texel) = self.texel(fragment, nth) {
                recorder.looked_up(texel.map(|at| at as u8));
            }
        }
    }

    /// The scene with all splats lit before they are drawn, and nothing lit after.
    pub fn lit(mut self) -> Self {
        self.ends.iter_mut().for_each(|end| end.unlit = 0);
        self.splats
            .iter_mut()
            .flat_map(|splat| &mut splat.pixels)
            .for_each(|event| {
                if let Some(Event::Merged(shaded)) = event {
                    *shaded = 0;
                }
            });
        Scene {
            preshaded: true,
            ..self
        }
    }

    /// The scene with pixels that stop, most of them in some scenes. After that, the only events of
    /// such a pixel are dropped contributions.
    pub fn stopping(mut self, rng: &mut Rng) -> Self {
        let [share, later] = [
            [20, 60, 100, 100][rng.below(4) as usize],
            [1, 2, 6][rng.below(3) as usize],
        ];
        let in_order: Vec<usize> = self
            .in_order()
            .into_iter()
            .map(|(_, place)| place)
            .collect();
        for pixel in 0..(self.width * self.height) as usize {
            let [x, y] = [pixel % self.width as usize, pixel / self.width as usize];
            let mut before = if rng.below(100) < share {
                Some(rng.below(later))
            } else {
                None
            };
            let mut has_stopped = false;
            for place in &in_order {
                let splat = &mut self.splats[*place];
                let [left, top] = [splat.columns[0], splat.rows[0]].map(usize::from);
                let [columns, rows] = splat.size();
                if !(left..left + columns).contains(&x) || !(top..top + rows).contains(&y) {
                    continue;
                }
                let event = &mut splat.pixels[(y - top) * columns + x - left];
                match (*event, &mut before) {
                    (None | Some(Event::Faint), _) => {}
                    (Some(_), _) if has_stopped => *event = Some(Event::Accumulated),
                    (Some(_), Some(0)) => {
                        let merges = rng.below(2) == 0;
                        (*event, has_stopped) = (
                            Some(if merges {
                                Event::MergedAndStopped
                            } else {
                                Event::Stopped
                            }),
                            true,
                        );
                    }
                    (Some(_), Some(left)) => *left -= 1,
                    (Some(_), None) => {}
                }
            }
        }
        self
    }

    /// The scene in a random drawing order.
    pub fn sorted(self, rng: &mut Rng) -> Self {
        let mut order = self.drawn();
        for place in (1..order.len()).rev() {
            order.swap(place, rng.below(place as u64 + 1) as usize);
        }
        // Keys use separate random numbers, so that the rest does not change. Most scenes have some
        // equal keys.
        let rng = &mut Rng(rng.0 ^ 0x5047);
        let most = [1, 3, 1 << 10, (1 << 24) / (order.len() as u64 + 1)][rng.below(4) as usize];
        // A scene without drawn splats has neither order nor keys.
        let splats = if order.is_empty() {
            0
        } else {
            self.splats.len()
        };
        let mut keys = vec![0; splats];
        let mut key = rng.below(1 << 10) as u32;
        for (nth, place) in order.iter().enumerate() {
            let comes_later = nth > 0 && order[nth - 1] < *place;
            key += u32::from(nth > 0 && !comes_later) + rng.below(most) as u32;
            keys[*place] = key;
        }
        // Keys with a small range may use the upper bits.
        let up = if key < 1 << 10 {
            [0, 8, 14][rng.below(3) as usize]
        } else {
            0
        };
        keys.iter_mut().for_each(|key| *key <<= up);
        Scene {
            order,
            keys,
            ..self
        }
    }

    /// The scene on a machine that tests tiles, with an ellipse in each box: tiles that the machine
    /// rejects have no pixel of the splat, and no entry; subtiles whose bit is not set have none
    /// either. Returns the words of the ellipses and the
    /// cutoff, for the record.
    pub fn tested(
        mut self,
        rng: &mut Rng,
        timing: &Microarchitecture,
    ) -> (Self, Vec<TestedWords>, i64) {
        // Blocks are tested later.
        let timing = &Microarchitecture {
            contribution: None,
            ..timing.clone()
        };
        let words = timing.bin.expect("a test").words;
        let one = |word: rtl_model::num::Word| f64::from(word.format.frac_bits).exp2();
        let drawn = self.drawn();
        let mut ellipse = |place: &usize| {
            let splat = &self.splats[*place];
            let mut centre = |[first, last]: [u16; 2], size: u32| {
                rng.between(f64::from(first), f64::from(last) + 1.0) - f64::from(size) / 2.0
            };
            let centre = [
                centre(splat.columns, self.width),
                centre(splat.rows, self.height),
            ];
            // A line across the box, or a spot in it.
            let [thin, long] = [rng.between(0.2, 1.9), rng.between(-9.0, 1.0).exp2()];
            let (sin, cos) = rng.between(0.0, 3.2).sin_cos();
            let conic = [
                thin * sin * sin + long * cos * cos,
                (long - thin) * sin * cos,
                thin * cos * cos + long * sin * sin,
            ];
            TestedWords {
                pixel: centre.map(|at| (at * one(words.pixel)) as i32),
                conic: conic.map(|part| (part * one(words.conic)) as i32),
            }
        };
        let tested: Vec<TestedWords> = drawn.iter().map(&mut ellipse).collect();
        let cutoff = (rng.between(0.5, 9.0) * one(words.cutoff)) as i64;
        let mut work = self.record();
        (work.tested, work.cutoff) = (tested.clone(), cutoff);
        if timing.keeps_lists() {
            // Every tile of a box is listed; masks do not depend on what is kept.
            let boxes = work.bins(timing.timing.tile.side_px as usize);
            let tiles = (0..boxes.tiles()).map(|tile| MergedList {
                splats: (boxes.of(tile).iter())
                    .map(|nth| work.footprints[*nth as usize].splat)
                    .collect(),
                new: vec![true; boxes.of(tile).len()],
            });
            work.lists = Some(MergedLists {
                tile_px: timing.timing.tile.side_px,
                chunk: 4,
                is_odd: false,
                tiles: tiles.collect(),
            });
        }
        let [lists, boxes] = [timing.bin, None].map(|bin| {
            let timing = Microarchitecture {
                bin,
                ..timing.clone()
            };
            Lists::new(&timing, &work)
        });
        let side = timing.timing.tile.side_px as usize;
        let masks = timing.bin.and_then(|bin| bin.masks);
        let subtile = masks.map_or(side, |masks| masks.subtile_px as usize);
        for tile in 0..boxes.tiles() {
            for nth in boxes.of(tile) {
                let place = drawn[*nth as usize];
                let entry = lists.of(tile).iter().position(|other| other == nth);
                let mask = match entry {
                    Some(_) if masks.is_none() => continue,
                    Some(entry) => {
                        let mask = lists.mask(tile, entry);
                        self.masks.insert((place, tile), mask);
                        mask
                    }
                    None => {
                        self.unlisted.insert((place, tile));
                        0
                    }
                };
                let splat = &mut self.splats[place];
                let [columns, _] = splat.size();
                for (pixel, event) in splat.pixels.iter_mut().enumerate() {
                    let at = [
                        usize::from(splat.columns[0]) + pixel % columns,
                        usize::from(splat.rows[0]) + pixel / columns,
                    ];
                    let [x, y] = at.map(|at| at % side / subtile);
                    let is_set = mask >> (y * (side / subtile) + x) & 1 == 1;
                    if at.map(|at| at / side) == [tile % boxes.columns, tile / boxes.columns]
                        && !is_set
                    {
                        *event = None;
                    }
                }
            }
        }
        (self, tested, cutoff)
    }

    /// The scene on a machine that tests blocks: a part of the blocks of each box is kept, the
    /// others have no pixel.
    pub fn blocked(mut self, rng: &mut Rng, timing: &Microarchitecture) -> Self {
        let masks = timing
            .contribution
            .and_then(|blocks| blocks.masks)
            .expect("a test");
        let [side, tile] = [masks.subtile_px, timing.timing.tile.side_px].map(|px| px as usize);
        let (across, columns) = (tile / side, (self.width as usize).div_ceil(tile));
        let mut kept = BTreeSet::new();
        for place in self.drawn() {
            let share = [0, 30, 60, 90, 100][rng.below(5) as usize];
            let splat = &mut self.splats[place];
            let [xs, ys] = [splat.columns, splat.rows]
                .map(|[first, last]| usize::from(first) / side..=usize::from(last) / side);
            for y in ys {
                for x in xs.clone() {
                    let mask = self.masks.entry((place, y / across * columns + x / across));
                    let mask = mask.or_insert(0);
                    if rng.below(100) < share {
                        kept.insert((place, [x, y]));
                        *mask |= 1 << (y % across * across + x % across);
                    }
                }
            }
            let [width, _] = splat.size();
            for (pixel, event) in splat.pixels.iter_mut().enumerate() {
                let at = [
                    usize::from(splat.columns[0]) + pixel % width,
                    usize::from(splat.rows[0]) + pixel / width,
                ];
                if !kept.contains(&(place, at.map(|at| at / side))) {
                    *event = None;
                }
            }
        }
        Scene {
            blocks: Some((side, kept)),
            ..self
        }
    }

    /// The scene with lists from the frame before: any entries are new, and some have departed.
    pub fn keeping(self, rng: &mut Rng, timing: &Microarchitecture) -> Self {
        let side = timing.timing.tile.side_px as usize;
        let [columns, rows] = [self.width, self.height].map(|size| (size as usize).div_ceil(side));
        let share = [0, 5, 30, 100][rng.below(4) as usize];
        let list = |tile: usize| {
            let at = [tile % columns, tile / columns].map(|at| at * side);
            let meets = |[first, last]: [u16; 2], from: usize| {
                usize::from(first) < from + side && usize::from(last) >= from
            };
            let is_here = |place: usize| {
                let splat = &self.splats[place];
                splat.cull_reason == CullReason::Drawn
                    && meets(splat.columns, at[0])
                    && meets(splat.rows, at[1])
            };
            let mut list: Vec<KeptEntry> = Vec::new();
            let drawn = self.in_order().into_iter().map(|(_, place)| place);
            for place in drawn.filter(|place| is_here(*place)) {
                list.push(KeptEntry {
                    place,
                    is_new: rng.below(100) < share,
                    has_departed: false,
                });
            }
            let gone = (0..self.splats.len()).filter(|place| !is_here(*place));
            for place in gone.collect::<Vec<_>>() {
                if rng.below(4) == 0 {
                    let entry = KeptEntry {
                        place,
                        is_new: false,
                        has_departed: true,
                    };
                    list.insert(rng.below(list.len() as u64 + 1) as usize, entry);
                }
            }
            list
        };
        let lists = (0..columns * rows).map(list).collect();
        let kept = KeptScene {
            tile_px: side as u32,
            chunk: timing.sort.unwrap().sorter.unwrap().buffer_entries,
            is_odd: rng.below(2) == 1,
            lists,
        };
        Scene {
            kept: Some(kept),
            ..self
        }
    }

    /// Places of the drawn splats, in submission order.
    fn drawn(&self) -> Vec<usize> {
        (0..self.splats.len())
            .filter(|place| self.splats[*place].cull_reason == CullReason::Drawn)
            .collect()
    }

    /// Places of the drawn splats in drawing order, each with its number in submission order.
    pub fn in_order(&self) -> Vec<(usize, usize)> {
        let drawn = self.drawn();
        let order = if self.order.is_empty() {
            &drawn
        } else {
            &self.order
        };
        order
            .iter()
            .map(|place| (drawn.binary_search(place).unwrap(), *place))
            .collect()
    }

    /// Removes fragments from tiles that no box touches.
    fn clear_untouched(&mut self) {
        let touched = |tile: [u16; 2]| {
            self.splats
                .iter()
                .filter(|splat| splat.cull_reason == CullReason::Drawn)
                .any(|splat| {
                    let [columns, rows] =
                        [splat.columns, splat.rows].map(|interval| interval.map(|at| at / 16));
                    (columns[0]..=columns[1]).contains(&tile[0])
                        && (rows[0]..=rows[1]).contains(&tile[1])
                })
        };
        for (pixel, end) in self.ends.iter_mut().enumerate() {
            let [x, y] = [pixel as u32 % self.width, pixel as u32 / self.width];
            if !touched([x as u16 / 16, y as u16 / 16]) {
                *end = End::default();
            }
        }
    }

    /// Records the frame.
    pub fn record(&self) -> Work {
        let mut recorder = Recorder::default();
        for (first, splats) in self.splats.chunks(8).enumerate() {
            let lanes = CULLED.map(|cull_reason| {
                (0..splats.len())
                    .map(|lane| u8::from(splats[lane].cull_reason == cull_reason) << lane)
                    .sum()
            });
            recorder.culled(8 * first as u32, lanes);
        }
        recorder.ellipsoids(self.preshaded, self.shared_axes, self.harmonics);
        for place in self.drawn() {
            recorder.drawn(
                place as u32,
                [self.splats[place].columns, self.splats[place].rows],
            );
        }
        if self.mirrored.is_some() {
            recorder.mirrors();
        }
        let mut setup = recorder.fork();
        self.drawn()
            .into_iter()
            .filter(|_| self.preshaded)
            .for_each(|place| self.record_texels(&mut setup, LitFragment::Splat(place), 1));
        if !self.order.is_empty() {
            let keys = self
                .drawn()
                .into_iter()
                .map(|place| self.keys[place])
                .collect();
            recorder.sorted(
                self.in_order()
                    .into_iter()
                    .map(|(nth, _)| nth as u32)
                    .collect(),
                keys,
            );
        }
        if let Some(kept) = &self.kept {
            let tiles = kept.lists.iter().map(|list| MergedList {
                splats: list.iter().map(|entry| entry.place as u32).collect(),
                new: list.iter().map(|entry| entry.is_new).collect(),
            });
            recorder.merged(MergedLists {
                tile_px: kept.tile_px,
                chunk: kept.chunk,
                is_odd: kept.is_odd,
                tiles: tiles.collect(),
            });
        }
        for top in (0..self.height as u16).step_by(TILE_PX) {
            for left in (0..self.width as u16).step_by(TILE_PX) {
                let mut touched = false;
                for (_, place) in self.in_order() {
                    let splat = &self.splats[place];
                    let [columns, rows] = [in_tile(splat.columns, left), in_tile(splat.rows, top)];
                    if columns.is_empty() || rows.is_empty() {
                        continue;
                    }
                    touched = true;
                    let mut places = Vec::new();
                    let mut events = Vec::new();
                    for row in rows.clone() {
                        for column in columns.clone() {
                            let [x, y] = [usize::from(left) + column, usize::from(top) + row];
                            if let Some(event) = splat.pixel(
                                x - usize::from(splat.columns[0]),
                                y - usize::from(splat.rows[0]),
                            ) {
                                places
                                    .push((16 * (row - rows.start) + column - columns.start) as u8);
                                events.push((event, y * self.width as usize + x));
                            }
                        }
                    }
                    recorder.span(rows.len(), columns.start, &places);
                    if let Some((side, kept)) = &self.blocks {
                        let across = TILE_PX / side;
                        let first = [left, top].map(|at| usize::from(at) / side);
                        let bits = (0..across * across).filter(|bit| {
                            let block = [first[0] + bit % across, first[1] + bit / across];
                            kept.contains(&(place, block))
                        });
                        recorder.blocks(bits.map(|bit| 1u16 << bit).sum());
                    }
                    for (event, pixel) in events {
                        if let Event::Merged(shades) = event {
                            self.record_texels(
                                &mut recorder,
                                LitFragment::Merge(place, pixel),
                                shades,
                            );
                        }
                        recorder.became(event);
                    }
                }
                if !touched {
                    continue;
                }
                for pixel in 0..TILE_PX * TILE_PX {
                    let [x, y] = [
                        usize::from(left) + pixel % TILE_PX,
                        usize::from(top) + pixel / TILE_PX,
                    ];
                    let is_inside = x < self.width as usize && y < self.height as usize;
                    let End { lit, unlit } = if is_inside {
                        self.ends[y * self.width as usize + x]
                    } else {
                        End::default()
                    };
                    self.record_texels(
                        &mut recorder,
                        LitFragment::End(y * self.width as usize + x),
                        unlit,
                    );
                    recorder.pixel(lit + unlit, unlit);
                }
                recorder.tile([left, top]);
            }
        }
        recorder.absorb(setup);
        recorder.work(self.width, self.height)
    }

    /// Reads a recorded frame.
    pub fn read(work: &Work) -> Self {
        let mut splats: Vec<Splat> = work
            .cull_reasons
            .iter()
            .map(|cull_reason| Splat::culled(*cull_reason))
            .collect();
        for footprint in &work.footprints {
            let splat = &mut splats[footprint.splat as usize];
            (splat.columns, splat.rows) = (footprint.columns, footprint.rows);
            splat.pixels = vec![None; splat.size()[0] * splat.size()[1]];
        }
        let mut ends = vec![End::default(); (work.width * work.height) as usize];
        let as_they_come = (0..work.footprints.len() as u32).collect();
        let drawn = if work.order.is_empty() {
            &as_they_come
        } else {
            &work.order
        };
        for tile in &work.tiles {
            let mut reader = tile.reader();
            let [first, top] = tile.corner;
            for footprint in drawn.iter().map(|nth| &work.footprints[*nth as usize]) {
                let [columns, rows] = [
                    in_tile(footprint.columns, first),
                    in_tile(footprint.rows, top),
                ];
                if columns.is_empty() || rows.is_empty() {
                    continue;
                }
                let splat = &mut splats[footprint.splat as usize];
                let (kept, events) = reader.splat(rows.len());
                for (nth, (row, kept)) in rows.zip(kept).enumerate() {
                    for column in (0..TILE_PX).filter(|column| kept & (1 << column) != 0) {
                        let [x, y] = [usize::from(first) + column, usize::from(top) + row];
                        let pixel = (y - usize::from(splat.rows[0])) * splat.size()[0] + x
                            - usize::from(splat.columns[0]);
                        let event = events
                            .iter()
                            .find(|(place, _)| usize::from(*place) == 16 * nth + column);
                        splat.pixels[pixel] =
                            Some(event.map_or(Event::Accumulated, |(_, event)| *event));
                    }
                }
            }
            for pixel in 0..TILE_PX * TILE_PX {
                let [x, y] = [
                    usize::from(first) + pixel % TILE_PX,
                    usize::from(top) + pixel / TILE_PX,
                ];
                if x < work.width as usize && y < work.height as usize {
                    let [all, unlit] = tile.pixel(pixel);
                    ends[y * work.width as usize + x] = End {
                        lit: all - unlit,
                        unlit,
                    };
                }
            }
        }
        let order = work
            .order
            .iter()
            .map(|nth| work.footprints[*nth as usize].splat as usize)
            .collect();
        let mut keys = vec![
            0;
            if work.order.is_empty() {
                0
            } else {
                splats.len()
            }
        ];
        for (footprint, key) in work.footprints.iter().zip(&work.keys) {
            keys[footprint.splat as usize] = *key;
        }
        let Work {
            width,
            height,
            preshaded,
            shared_axes,
            harmonics,
            ..
        } = *work;
        // Look-ups are not part of the record.
        Scene {
            width,
            height,
            splats,
            ends,
            preshaded,
            shared_axes,
            harmonics,
            order,
            keys,
            unlisted: BTreeSet::new(),
            masks: BTreeMap::new(),
            blocks: None,
            kept: None,
            mirrored: None,
        }
    }
}

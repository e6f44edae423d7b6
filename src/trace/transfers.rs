//! Transfers: what was watched, as the records of each port, with the keys that tell where each comes from.

use super::stimulus::Made;
use super::watcher::{Arrival, Shaded, Watcher, flag, key, parts};
use rtl_model::frame::{Frame, Material};
use rtl_model::machine::Elaborated;
use rtl_model::units::fragment::{COLOUR, NORMAL, OPACITY, Slot, WEIGHT};
use rtl_model::units::resolve::Layer;

/// Of a key's parts: there is none.
pub const NONE: u32 = u32::MAX;

/// Where a record comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key {
    /// Its splat, by its place in the scene, or [`NONE`].
    pub splat: u32,
    /// Its pixel, or 0xffff.
    pub x: u32,
    /// Its pixel, or 0xffff.
    pub y: u32,
    /// Its slot, or 0xff.
    pub slot: u32,
    /// The record that it was made from, by its place in the stream before, or [`NONE`].
    pub parent: u32,
    /// What happened to its words ([`flag`]).
    pub flags: u8,
}

impl Key {
    /// Names of the parts, and bits of each.
    pub const PARTS: [(&str, u32); 6] = [("splat", 32), ("x", 16), ("y", 16), ("slot", 8), ("parent", 32), ("flags", 8)];

    /// Its parts.
    pub fn words(&self) -> [i64; 6] {
        [self.splat.into(), self.x.into(), self.y.into(), self.slot.into(), self.parent.into(), self.flags.into()]
    }

    fn of_splat(splat: u32, parent: u32, flags: u8) -> Key {
        Key { splat, x: 0xffff, y: 0xffff, slot: 0xff, parent, flags }
    }

    fn of_pixel([x, y]: [u32; 2], slot: u32, parent: u32, flags: u8) -> Key {
        Key { splat: NONE, x, y, slot, parent, flags }
    }
}

/// Appends the words of a record; its key.
type At<'a> = Box<dyn Fn(usize, &mut Vec<i64>) -> Key + Sync + 'a>;

/// The records of one port.
pub struct Source<'a> {
    /// The stream's name.
    pub name: &'static str,
    /// How many there are.
    pub records: usize,
    /// The words and the key of one.
    pub at: At<'a>,
}

impl<'a> Source<'a> {
    /// Made-up records.
    pub fn of(made: &'a Made) -> Source<'a> {
        source(made.name, made.records.len(), move |i, words| {
            words.extend(&made.records[i].0);
            made.records[i].1
        })
    }
}

/// Pixels from the first column and row to those before the last two.
pub type Rectangle = [u32; 4];

/// A window's transfers, in order.
pub struct Transfers<'a> {
    pub machine: &'a Elaborated,
    /// What was drawn.
    pub frame: &'a Frame,
    /// What the scene calls the frame's splats.
    pub splats: &'a [u32],
    pub watcher: Watcher,
    /// Fragments that were there before: pixel, slot and what it holds.
    pub start: Vec<([u32; 2], usize, Slot)>,
    /// Places in `watcher.set_up` of what left `project`, and of what left `ellipse`.
    projected: Vec<u32>,
    drawn: Vec<u32>,
    /// Places in `watcher.arrivals` of what lies in the rectangle, and of what of that has a weight.
    weighed: Vec<u32>,
    taken: Vec<u32>,
    /// For each splat of the frame, its record in `raster.in`.
    raster_records: Vec<u32>,
    /// Those in the rectangle.
    merged: Vec<Shaded>,
    resolved: Vec<Shaded>,
    /// Every pixel of the rectangle, with its place in `watcher.held`.
    pixels: Vec<([u32; 2], Option<u32>)>,
    /// Pixel by pixel, and front to back: the place among `pixels` and the slot.
    layers: Vec<(u32, u8)>,
    /// For each of `pixels` its first record in `resolve.in`.
    first_layers: Vec<u32>,
}

fn places<T>(all: &[T], keep: impl Fn(&T) -> bool) -> Vec<u32> {
    (0u32..).zip(all).filter(|(_, item)| keep(item)).map(|(place, _)| place).collect()
}

/// The record that one is made from.
fn nth(records: &[u32], place: u32) -> u32 {
    records.binary_search(&place).map_or(NONE, |record| record as u32)
}

impl<'a> Transfers<'a> {
    /// Brings what was watched into order.
    pub fn new(
        machine: &'a Elaborated,
        frame: &'a Frame,
        splats: &'a [u32],
        mut watcher: Watcher,
        start: Vec<([u32; 2], usize, Slot)>,
        rectangle: Rectangle,
    ) -> Self {
        watcher.sort();
        let [left, top, right, bottom] = rectangle;
        let inside = |key: u64| {
            let [_, x, y] = parts(key);
            (left..right).contains(&x) && (top..bottom).contains(&y)
        };
        let projected = places(&watcher.set_up, |splat| splat.project[..2] == [0, 0]);
        let drawn: Vec<u32> = projected.iter().copied().filter(|&place| watcher.set_up[place as usize].ellipse[..3] == [0, 0, 0]).collect();
        let mut raster_records = vec![NONE; frame.splats.len()];
        for (record, &place) in (0u32..).zip(&drawn) {
            raster_records[watcher.set_up[place as usize].splat as usize] = record;
        }
        let weighed = places(&watcher.arrivals, |arrival| inside(arrival.key));
        let taken = weighed.iter().copied().filter(|&place| watcher.arrivals[place as usize].weight > 0).collect();
        let only_inside = |all: &mut Vec<Shaded>| std::mem::take(all).into_iter().filter(|shaded| inside(shaded.key)).collect();
        let (merged, resolved) = (only_inside(&mut watcher.merged), only_inside(&mut watcher.resolved));
        let mut pixels = Vec::new();
        let mut held = (0u32..).zip(&watcher.held).peekable();
        for y in top..bottom {
            for x in left..right {
                let here = key(0, x, y);
                while held.next_if(|(_, held)| held.key < here).is_some() {}
                pixels.push(([x, y], held.next_if(|(_, held)| held.key == here).map(|(place, _)| place)));
            }
        }
        let (mut layers, mut first_layers, mut records) = (Vec::new(), Vec::new(), 0u32);
        for (pixel, (_, held)) in (0u32..).zip(&pixels) {
            let slots = held.map_or(&[][..], |place| &watcher.held[place as usize].slots[..]);
            let mut order: Vec<u8> = (0..slots.len() as u8).collect();
            order.sort_by_key(|&slot| slots[usize::from(slot)].depth);
            layers.extend(order.into_iter().map(|slot| (pixel, slot)));
            first_layers.push(records);
            records += slots.len().max(1) as u32;
        }
        Transfers {
            machine,
            frame,
            splats,
            watcher,
            start,
            projected,
            drawn,
            weighed,
            taken,
            raster_records,
            merged,
            resolved,
            pixels,
            layers,
            first_layers,
        }
    }

    /// Every stream's records, in the order of the diagram.
    pub fn sources(&self) -> Vec<Source<'_>> {
        let (set_up, w) = (&self.watcher.set_up, &self.watcher);
        let splat = |place: usize| self.splats[set_up[place].splat as usize];
        let frame_splat = move |place: usize| &self.frame.splats[set_up[place].splat as usize];
        let arrival = |place: u32| &w.arrivals[place as usize];
        let held = |pixel: u32| self.pixels[pixel as usize].1.map(|place| &w.held[place as usize]);
        vec![
            source("pipeline.in", set_up.len(), move |i, words| {
                let s = frame_splat(i);
                words.extend(
                    s.position.iter().chain(&s.normal).chain([&s.radius]).chain(&s.rgb).chain([&s.opacity]).map(|&word| i64::from(word)),
                );
                words.push(s.material.into());
                Key::of_splat(splat(i), NONE, 0)
            }),
            source("project.in", set_up.len(), move |i, words| {
                words.extend(frame_splat(i).position.map(i64::from));
                Key::of_splat(splat(i), i as u32, 0)
            }),
            source("project.out", set_up.len(), move |i, words| {
                words.extend(set_up[i].project);
                let culled = if set_up[i].project[..2] == [0, 0] { 0 } else { flag::CUT_OFF };
                Key::of_splat(splat(i), i as u32, set_up[i].flags | culled)
            }),
            source("ellipse.in", self.projected.len(), move |i, words| {
                let place = self.projected[i] as usize;
                let s = frame_splat(place);
                let [_, _, forward, exponent, _, inverse_depth, inverse_exponent, a, b, x, y] = set_up[place].project;
                words.extend(s.normal.iter().chain([&s.radius]).map(|&word| i64::from(word)));
                words.extend([forward, exponent, inverse_depth, inverse_exponent, a, b, x, y]);
                Key::of_splat(splat(place), place as u32, 0)
            }),
            source("ellipse.out", self.projected.len(), move |i, words| {
                let place = self.projected[i] as usize;
                words.extend(set_up[place].ellipse);
                let culled = if set_up[place].ellipse[..3] == [0, 0, 0] { 0 } else { flag::CUT_OFF };
                Key::of_splat(splat(place), i as u32, set_up[place].flags | culled)
            }),
            source("raster.in", self.drawn.len(), move |i, words| {
                let place = self.drawn[i] as usize;
                let [.., depth, _, _, _, _, x, y] = set_up[place].project;
                let [_, _, _, _, _, _, xx, xy, yy, _, left, right, top, bottom, z_x, z_y, range] = set_up[place].ellipse;
                let tag = splat(place);
                words.extend([tag.into(), x, y, xx, xy, yy, depth, z_x, z_y, range, left, right, top, bottom]);
                let walked = w.walked.binary_search_by_key(&set_up[place].splat, |walked| walked.0);
                Key::of_splat(tag, nth(&self.projected, place as u32), walked.map_or(0, |at| w.walked[at].1))
            }),
            source("raster.out", w.arrivals.len(), move |i, words| {
                let a = arrival(i as u32);
                let [index, x, y] = parts(a.key);
                let tag = self.splats[index as usize];
                words.extend([tag.into(), x.into(), y.into(), a.radial, a.depth]);
                Key { splat: tag, x, y, slot: 0xff, parent: self.raster_records[index as usize], flags: 0 }
            }),
            source("gauss.in", self.weighed.len(), move |i, words| {
                let a = arrival(self.weighed[i]);
                words.extend([a.radial, self.amplitude(a)]);
                self.of_arrival(a, self.weighed[i], 0)
            }),
            source("gauss.out", self.weighed.len(), move |i, words| {
                let a = arrival(self.weighed[i]);
                words.push(a.weight.into());
                self.of_arrival(a, i as u32, a.gauss_flags)
            }),
            source("fragment.in", self.taken.len(), move |i, words| {
                let a = arrival(self.taken[i]);
                let [index, x, y] = parts(a.key);
                let s = &self.frame.splats[index as usize];
                words.extend([x.into(), y.into(), a.weight.into(), a.depth]);
                words.extend(s.rgb.iter().chain([&s.opacity]).map(|&word| i64::from(word)));
                words.extend(self.normal(index));
                words.push(s.material.into());
                self.of_arrival(a, nth(&self.weighed, self.taken[i]), 0)
            }),
            source("fragment.out", self.taken.len(), move |i, words| {
                let a = arrival(self.taken[i]);
                let [_, x, y] = parts(a.key);
                words.extend([x, y, a.outcome.into(), a.slot.into()].map(i64::from));
                let key = self.of_arrival(a, i as u32, a.fragment_flags);
                Key { slot: a.slot.into(), ..key }
            }),
            source("fragment.request", self.merged.len(), move |i, words| {
                sums_of(&self.merged[i], words);
                self.of_merge(&self.merged[i], self.contribution(self.merged[i].key), 0)
            }),
            source("fragment.answer", self.merged.len(), move |i, words| {
                light_of(&self.merged[i], words);
                self.of_merge(&self.merged[i], i as u32, self.merged[i].flags)
            }),
            source("fragment.start", self.start.len(), move |i, words| {
                let (pixel, number, slot) = &self.start[i];
                slot_words(*pixel, *number, slot, words);
                Key::of_pixel(*pixel, *number as u32, NONE, 0)
            }),
            source("fragment.held", self.layers.len(), move |i, words| {
                let (pixel, number) = self.layers[i];
                let place = self.pixels[pixel as usize].0;
                if let Some(held) = held(pixel) {
                    let number = usize::from(number);
                    let (slot, layer) = (&held.slots[number], &held.layers[number]);
                    slot_words(place, number, slot, words);
                    words.extend(if slot.shaded { light(layer) } else { [0; 4] });
                }
                Key::of_pixel(place, number.into(), NONE, 0)
            }),
            source("shade.in", self.merged.len() + self.resolved.len(), move |i, words| {
                sums_of(self.shaded(i), words);
                self.of_shaded(i, NONE, 0)
            }),
            source("shade.out", self.merged.len() + self.resolved.len(), move |i, words| {
                light_of(self.shaded(i), words);
                self.of_shaded(i, i as u32, self.shaded(i).flags)
            }),
            source("resolve.in", self.resolve_records(), move |i, words| {
                let pixel = self.first_layers.partition_point(|&first| first as usize <= i) - 1;
                let (place, nth) = (self.pixels[pixel].0, i - self.first_layers[pixel] as usize);
                words.extend(place.map(i64::from));
                let Some(held) = held(pixel as u32).filter(|held| !held.slots.is_empty()) else {
                    words.extend([1, 1, 0, 0, 0, 0]);
                    return Key::of_pixel(place, 0xff, NONE, 0);
                };
                let first = self.layers.partition_point(|&(other, _)| other < pixel as u32);
                let number = self.layers[first + nth].1;
                words.extend([i64::from(nth + 1 == held.slots.len()), 0]);
                words.extend(light(&held.layers[usize::from(number)]));
                Key::of_pixel(place, number.into(), (first + nth) as u32, 0)
            }),
            source("resolve.out", self.pixels.len(), move |i, words| {
                let flags = self.frame_words(i, words);
                Key::of_pixel(self.pixels[i].0, 0xff, self.first_layers[i], flags)
            }),
            source("pipeline.out", self.pixels.len(), move |i, words| {
                let flags = self.frame_words(i, words);
                Key::of_pixel(self.pixels[i].0, 0xff, i as u32, flags)
            }),
        ]
    }

    fn amplitude(&self, arrival: &Arrival) -> i64 {
        self.set_up_of(parts(arrival.key)[0])[9]
    }

    fn normal(&self, splat: u32) -> [i64; 3] {
        let words = self.set_up_of(splat);
        [words[3], words[4], words[5]]
    }

    /// What `ellipse` made of a splat that has fragments.
    fn set_up_of(&self, splat: u32) -> &[i64] {
        let record = self.raster_records[splat as usize] as usize;
        &self.watcher.set_up[self.drawn[record] as usize].ellipse
    }

    fn of_arrival(&self, arrival: &Arrival, parent: u32, flags: u8) -> Key {
        let [index, x, y] = parts(arrival.key);
        Key { splat: self.splats[index as usize], x, y, slot: 0xff, parent, flags }
    }

    fn of_merge(&self, shaded: &Shaded, parent: u32, flags: u8) -> Key {
        let [index, x, y] = parts(shaded.key);
        Key { splat: self.splats[index as usize], x, y, slot: 0xff, parent, flags }
    }

    /// The record in `fragment.in` of a contribution.
    fn contribution(&self, key: u64) -> u32 {
        let record = self.taken.binary_search_by_key(&key, |&place| self.watcher.arrivals[place as usize].key);
        record.map_or(NONE, |record| record as u32)
    }

    fn shaded(&self, i: usize) -> &Shaded {
        self.merged.get(i).unwrap_or_else(|| &self.resolved[i - self.merged.len()])
    }

    fn of_shaded(&self, i: usize, parent: u32, flags: u8) -> Key {
        let shaded = self.shaded(i);
        if i < self.merged.len() {
            return self.of_merge(shaded, if parent == NONE { i as u32 } else { parent }, flags);
        }
        let [_, x, y] = parts(shaded.key);
        Key::of_pixel([x, y], 0xff, parent, flags)
    }

    fn resolve_records(&self) -> usize {
        let empty = self.pixels.iter().filter(|(_, held)| held.is_none_or(|place| self.watcher.held[place as usize].slots.is_empty()));
        self.layers.len() + empty.count()
    }

    fn frame_words(&self, i: usize, words: &mut Vec<i64>) -> u8 {
        let (place, held) = self.pixels[i];
        words.extend(place.map(i64::from));
        let Some(held) = held.map(|place| &self.watcher.held[place as usize]) else {
            // A pixel in a tile that no splat touches.
            let probe = &mut rtl_model::probe::Unwatched;
            words.extend(self.machine.resolve.one(&[], self.frame.background, &mut rtl_model::probe::Tap::new(probe)));
            return 0;
        };
        words.extend(held.frame);
        held.flags
    }
}

fn source<'a>(name: &'static str, records: usize, at: impl Fn(usize, &mut Vec<i64>) -> Key + Sync + 'a) -> Source<'a> {
    Source { name, records, at: Box::new(at) }
}

fn slot_words([x, y]: [u32; 2], number: usize, slot: &Slot, words: &mut Vec<i64>) {
    words.extend([x.into(), y.into(), number as i64, slot.shaded.into(), slot.depth, slot.material.into()]);
    words.extend(slot.sums);
}

fn sums_of(shaded: &Shaded, words: &mut Vec<i64>) {
    let input = &shaded.input;
    words.push(input.weight);
    words.extend(input.colour);
    words.push(input.opacity);
    words.extend(input.normal);
    words.push(input.material.into());
}

fn light_of(shaded: &Shaded, words: &mut Vec<i64>) {
    words.extend(shaded.output.colour);
    words.push(shaded.output.opacity);
}

fn light(layer: &Layer) -> [i64; 4] {
    let [r, g, b] = layer.colour;
    [r, g, b, layer.opacity]
}

const _: () = assert!(WEIGHT == 0 && COLOUR == 1 && OPACITY == 4 && NORMAL == 5, "sums lie in the order of their record");

/// The constants of a frame as records, stream by stream.
pub fn constants(frame: &Frame) -> Vec<(&'static str, Vec<Vec<i64>>)> {
    let v = &frame.view;
    let mut words = vec![i64::from(frame.width), i64::from(frame.height)];
    words.extend(v.rotation.as_flattened());
    words.extend(v.eye);
    words.push(v.near);
    words.extend(v.guard);
    words.extend([v.focal, v.inverse_focal.mantissa, v.inverse_focal.places, v.low_pass, v.cutoff, v.root_cutoff]);
    words.extend([v.cull_backfaces.into(), frame.z_threshold, frame.coverage_threshold]);
    words.extend([frame.inverse_threshold.mantissa, frame.inverse_threshold.places]);
    words.extend(frame.background);
    let lights = frame.lighting.lights.iter().map(|light| {
        let half_way = light.half_way;
        [&light.direction[..], &[half_way.is_some().into()], &half_way.unwrap_or_default()].concat()
    });
    let materials = frame.lighting.materials.iter().map(|material| match material {
        Material::Unlit => vec![1, 0],
        Material::BlinnPhong { ambient, .. } => vec![0, *ambient],
    });
    let count = frame.lighting.lights.len();
    let reflections = frame.lighting.materials.iter().flat_map(|material| {
        (0..count).map(move |light| match material {
            Material::Unlit => vec![0; 6],
            Material::BlinnPhong { diffuse, specular, .. } => [diffuse[light], specular[light]].concat(),
        })
    });
    vec![("frame", vec![words]), ("light", lights.collect()), ("material", materials.collect()), ("reflection", reflections.collect())]
}

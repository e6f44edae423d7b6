//! Transfers: converts the log of a frame to the records of each port, with keys for their origin.

mod constants;
mod slots;

pub use constants::constants;

use super::observer::{
    Emitted, FragmentTransfer, HeldFragments, Observations, SetUpTransfer, Shaded, flag, key, parts,
};
use super::stimulus::MadeStream;
use rtl_model::frame::{Each, Frame};
use rtl_model::pipeline::Elaborated;
use rtl_model::pipeline::ports::{Kind, asks_for_pixel, project_out_words};
use rtl_model::pipeline::unit_replay;
use rtl_model::units::fragment::Slot;
use rtl_model::units::fragment::window::WindowRegisters;
use slots::{light, light_of, pixel_words, slot_words, sums_of};

/// Value of a key's part that the record lacks.
pub const NONE: u32 = u32::MAX;

/// Origin of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key {
    /// Index of its splat in the scene, or [`NONE`].
    pub splat: u32,
    /// Its column, or 0xffff.
    pub x: u32,
    /// Its row, or 0xffff.
    pub y: u32,
    /// Its slot, or 0xff.
    pub slot: u32,
    /// Index in the parent stream of the record that it was made from, or [`NONE`].
    pub parent: u32,
    /// Flags of its words ([`flag`]).
    pub flags: u8,
}

impl Key {
    /// Names of the parts, and bits of each.
    pub const PARTS: [(&str, u32); 6] = [
        ("splat", 32),
        ("x", 16),
        ("y", 16),
        ("slot", 8),
        ("parent", 32),
        ("flags", 8),
    ];

    /// Values of the parts.
    pub fn words(&self) -> [i64; 6] {
        [
            self.splat.into(),
            self.x.into(),
            self.y.into(),
            self.slot.into(),
            self.parent.into(),
            self.flags.into(),
        ]
    }

    fn of_splat(splat: u32, parent: u32, flags: u8) -> Key {
        Key {
            splat,
            x: 0xffff,
            y: 0xffff,
            slot: 0xff,
            parent,
            flags,
        }
    }

    fn of_pixel([x, y]: [u32; 2], slot: u32, parent: u32, flags: u8) -> Key {
        Key {
            splat: NONE,
            x,
            y,
            slot,
            parent,
            flags,
        }
    }
}

/// Appends the words of a record; returns its key.
type At<'a> = Box<dyn Fn(usize, &mut Vec<i64>) -> Key + Sync + 'a>;

/// The records of one port.
pub struct RecordSource<'a> {
    /// The stream's name.
    pub name: &'static str,
    /// Number of records.
    pub records: usize,
    /// The words and the key of one record.
    pub at: At<'a>,
}

impl<'a> RecordSource<'a> {
    /// Made-up records.
    pub fn of(made: &'a MadeStream) -> RecordSource<'a> {
        source(made.name, made.records.len(), move |i, words| {
            words.extend(&made.records[i].0);
            made.records[i].1
        })
    }
}

/// Left, top, right and bottom; right and bottom are excluded.
pub type Rectangle = [u32; 4];

/// The transfers in a window, in order.
pub struct Transfers<'a> {
    pub machine: &'a Elaborated,
    /// The frame that was drawn.
    pub frame: &'a Frame,
    /// Indices of the frame's splats in the scene.
    pub splats: &'a [u32],
    pub observer: Observations,
    /// Features of the frame that change the records.
    kind: Kind,
    /// Windows only.
    windows: Option<WindowRegisters>,
    /// Pixels that held fragments before the window, with their slots.
    pub start: Vec<([u32; 2], Vec<Slot>)>,
    /// For each record of `start`: indices of the pixel and of the slot.
    start_records: Vec<(u32, u8)>,
    /// Indices in `observer.set_up` of the splats that left `project`, and of those that left
    /// `ellipse`; the latter also in drawing order.
    projected: Vec<u32>,
    left: Vec<u32>,
    drawn: Vec<u32>,
    /// Indices in `observer.arrivals` of the fragments in the rectangle, and of those that have a
    /// weight.
    weighed: Vec<u32>,
    taken: Vec<u32>,
    /// For each splat of the frame, its record in `raster.in`.
    raster_records: Vec<u32>,
    /// Shaded for a merge in the rectangle.
    merged: Vec<Shaded>,
    resolved: Vec<Shaded>,
    /// Every pixel of the rectangle, with its index in `observer.held`.
    pixels: Vec<([u32; 2], Option<u32>)>,
    /// Front to back, pixel by pixel: index in `pixels`, and slot.
    layers: Vec<(u32, u8)>,
    /// For each of `pixels`, its first record in `resolve.in`.
    first_layers: Vec<u32>,
}

fn places<T>(all: &[T], keep: impl Fn(&T) -> bool) -> Vec<u32> {
    (0u32..)
        .zip(all)
        .filter(|(_, item)| keep(item))
        .map(|(place, _)| place)
        .collect()
}

/// Index of the record that one is made from.
fn nth(records: &[u32], place: u32) -> u32 {
    records
        .binary_search(&place)
        .map_or(NONE, |record| record as u32)
}

impl<'a> Transfers<'a> {
    /// Sorts the log of a frame.
    pub fn new(
        machine: &'a Elaborated,
        frame: &'a Frame,
        splats: &'a [u32],
        mut observer: Observations,
        start: Vec<([u32; 2], Vec<Slot>)>,
        rectangle: Rectangle,
    ) -> Self {
        let kind = Kind::of(frame);
        let [left, top, right, bottom] = rectangle;
        let inside = |key: u64| {
            let [_, x, y] = parts(key);
            (left..right).contains(&x) && (top..bottom).contains(&y)
        };
        let projected = places(&observer.set_up, SetUpTransfer::leaves_project);
        let left_setup = |&place: &u32| observer.set_up[place as usize].ellipse[..3] == [0, 0, 0];
        let in_order: Vec<u32> = projected.iter().copied().filter(left_setup).collect();
        let drawn = if kind.sorted {
            observer
                .order
                .iter()
                .map(|&nth| in_order[nth as usize])
                .collect()
        } else {
            in_order.clone()
        };
        let mut raster_records = vec![NONE; frame.splats.len()];
        for (record, &place) in (0u32..).zip(&drawn) {
            raster_records[observer.set_up[place as usize].splat as usize] = record;
        }
        if kind.sorted {
            observer.number(&raster_records);
        }
        observer.sort();
        let weighed = places(&observer.arrivals, |arrival| inside(arrival.key));
        let taken = weighed
            .iter()
            .copied()
            .filter(|&place| observer.counts(observer.arrivals[place as usize].weight))
            .collect();
        let only_inside = |all: &mut Vec<Shaded>| {
            std::mem::take(all)
                .into_iter()
                .filter(|shaded| inside(shaded.key))
                .collect()
        };
        let (merged, resolved) = (
            only_inside(&mut observer.merged),
            only_inside(&mut observer.resolved),
        );
        let mut pixels = Vec::new();
        let mut held = (0u32..).zip(&observer.held).peekable();
        for y in top..bottom {
            for x in left..right {
                let here = key(0, x, y);
                while held.next_if(|(_, held)| held.key < here).is_some() {}
                pixels.push((
                    [x, y],
                    held.next_if(|(_, held)| held.key == here)
                        .map(|(place, _)| place),
                ));
            }
        }
        let (mut layers, mut first_layers, mut records) = (Vec::new(), Vec::new(), 0u32);
        for (pixel, (_, held)) in (0u32..).zip(&pixels) {
            let (slots, count) = held.map_or((&[][..], 0), |place| {
                let held = &observer.held[place as usize];
                (&held.slots[..], held.layers.len())
            });
            let mut order: Vec<u8> = (0..count as u8).collect();
            // Layers of windows are already in order.
            if !kind.windows {
                order.sort_by_key(|&slot| slots[usize::from(slot)].depth);
            }
            layers.extend(order.into_iter().map(|slot| (pixel, slot)));
            first_layers.push(records);
            records += count.max(1) as u32;
        }
        // Sheets have one record per pixel.
        let slots_of = |(pixel, (_, slots)): (u32, &([u32; 2], Vec<Slot>))| {
            let count = if kind.sheets {
                slots.len().min(1)
            } else {
                slots.len()
            };
            (0..count as u8).map(move |slot| (pixel, slot))
        };
        let start_records = (0..).zip(&start).flat_map(slots_of).collect();
        Transfers {
            machine,
            frame,
            splats,
            observer,
            kind,
            windows: machine.windows(frame),
            start,
            start_records,
            projected,
            left: in_order,
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

    /// The records of every stream, in the order of the diagram.
    pub fn sources(&self) -> Vec<RecordSource<'_>> {
        let (set_up, w) = (&self.observer.set_up, &self.observer);
        let splat = |place: usize| self.splats[set_up[place].splat as usize];
        let frame_splat = move |place: usize| &self.frame.splats[set_up[place].splat as usize];
        let arrival = |place: u32| &w.arrivals[place as usize];
        let held = |pixel: u32| {
            self.pixels[pixel as usize]
                .1
                .map(|place| &w.held[place as usize])
        };
        let mut all = vec![
            source("pipeline.in", set_up.len(), move |i, words| {
                let s = frame_splat(i);
                words.extend(
                    s.position
                        .iter()
                        .chain(&s.normal)
                        .chain([&s.radius])
                        .map(|&word| i64::from(word)),
                );
                self.orientation(set_up[i].splat, words);
                match self.coefficients(set_up[i].splat) {
                    [] => words.extend(s.rgb.map(i64::from)),
                    own => words.extend(own.as_flattened().iter().copied().map(i64::from)),
                }
                words.extend([i64::from(s.opacity), i64::from(s.material)]);
                if self.kind.sheets {
                    words.push(self.sheet(set_up[i].splat));
                }
                Key::of_splat(splat(i), NONE, 0)
            }),
            source("project.in", set_up.len(), move |i, words| {
                words.extend(frame_splat(i).position.map(i64::from));
                if self.kind.ellipsoids {
                    words.push(frame_splat(i).opacity.into());
                }
                Key::of_splat(splat(i), i as u32, 0)
            }),
            source("project.out", set_up.len(), move |i, words| {
                words.extend(project_out_words(self.kind, set_up[i].project));
                let culled = if set_up[i].leaves_project() {
                    0
                } else {
                    flag::CUT_OFF
                };
                Key::of_splat(splat(i), i as u32, set_up[i].flags | culled)
            }),
            source("ellipse.in", self.projected.len(), move |i, words| {
                let place = self.projected[i] as usize;
                let s = frame_splat(place);
                let [
                    _,
                    _,
                    _,
                    forward,
                    exponent,
                    _,
                    inverse_depth,
                    inverse_exponent,
                    a,
                    b,
                    x,
                    y,
                ] = set_up[place].project;
                words.extend(
                    s.normal
                        .iter()
                        .chain([&s.radius])
                        .map(|&word| i64::from(word)),
                );
                self.orientation(set_up[place].splat, words);
                if self.kind.ellipsoids {
                    words.push(s.opacity.into());
                }
                words.extend([
                    forward,
                    exponent,
                    inverse_depth,
                    inverse_exponent,
                    a,
                    b,
                    x,
                    y,
                ]);
                Key::of_splat(splat(place), place as u32, 0)
            }),
            source("ellipse.out", self.projected.len(), move |i, words| {
                let place = self.projected[i] as usize;
                words.extend(set_up[place].ellipse);
                let culled = if set_up[place].ellipse[..3] == [0, 0, 0] {
                    0
                } else {
                    flag::CUT_OFF
                };
                Key::of_splat(splat(place), i as u32, set_up[place].flags | culled)
            }),
            source("raster.in", self.drawn.len(), move |i, words| {
                let place = self.drawn[i] as usize;
                let [.., depth, _, _, _, _, x, y] = set_up[place].project;
                let [
                    _,
                    _,
                    _,
                    _,
                    _,
                    _,
                    xx,
                    xy,
                    yy,
                    _,
                    left,
                    right,
                    top,
                    bottom,
                    z_x,
                    z_y,
                    range,
                ] = set_up[place].ellipse;
                let tag = splat(place);
                words.extend([
                    tag.into(),
                    x,
                    y,
                    xx,
                    xy,
                    yy,
                    depth,
                    z_x,
                    z_y,
                    range,
                    left,
                    right,
                    top,
                    bottom,
                ]);
                let walked = w
                    .walked
                    .binary_search_by_key(&set_up[place].splat, |walked| walked.0);
                let parent = if self.kind.sorted {
                    i as u32
                } else {
                    nth(&self.projected, place as u32)
                };
                Key::of_splat(tag, parent, walked.map_or(0, |at| w.walked[at].1))
            }),
            source("raster.out", w.arrivals.len(), move |i, words| {
                let a = arrival(i as u32);
                let [index, x, y] = self.parts(a.key);
                let tag = self.splats[index as usize];
                words.extend([tag.into(), x.into(), y.into(), a.radial, a.depth]);
                Key {
                    splat: tag,
                    x,
                    y,
                    slot: 0xff,
                    parent: self.raster_records[index as usize],
                    flags: 0,
                }
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
                let [index, x, y] = self.parts(a.key);
                let s = &self.frame.splats[index as usize];
                words.extend([x, y, a.weight].map(i64::from));
                words.push(if self.kind.sheets {
                    self.sheet(index)
                } else {
                    a.depth
                });
                words.extend(self.rgb(index).map(i64::from));
                if !self.kind.sheets {
                    words.push(s.opacity.into());
                    words.extend(self.normal(index));
                    words.push(s.material.into());
                }
                if let Some(registers) = &self.windows {
                    let probe = &mut rtl_model::probe::NoProbe;
                    let density = self.machine.fragment.density(
                        s.opacity,
                        registers,
                        &mut rtl_model::probe::Tap::new(probe),
                    );
                    words.extend(self.light(index).map(i64::from));
                    words.push(density.into());
                }
                self.of_arrival(a, nth(&self.weighed, self.taken[i]), 0)
            }),
            source("fragment.out", self.taken.len(), move |i, words| {
                let a = arrival(self.taken[i]);
                let [_, x, y] = parts(a.key);
                words.extend([x, y, a.outcome.into(), a.slot.into()].map(i64::from));
                if self.kind.windows {
                    words.push(a.place.into());
                }
                let key = self.of_arrival(a, i as u32, a.fragment_flags);
                Key {
                    slot: a.slot.into(),
                    ..key
                }
            }),
        ];
        all.extend(self.of_setup());
        all.extend(match self.kind {
            Kind { sheets: true, .. } => self.of_sheets(),
            Kind { windows: true, .. } => self.of_windows(),
            _ => self.of_slots(),
        });
        all.extend([
            source("shade.in", self.shaded_records(), move |i, words| {
                self.request(self.shaded(i), words);
                self.of_shaded(i, NONE, 0)
            }),
            source("shade.out", self.shaded_records(), move |i, words| {
                light_of(self.shaded(i), words);
                self.of_shaded(i, i as u32, self.shaded(i).flags)
            }),
            source("resolve.in", self.resolve_records(), move |i, words| {
                let pixel = self
                    .first_layers
                    .partition_point(|&first| first as usize <= i)
                    - 1;
                let (place, nth) = (self.pixels[pixel].0, i - self.first_layers[pixel] as usize);
                words.extend(place.map(i64::from));
                let Some(held) = held(pixel as u32).filter(|held| !held.layers.is_empty()) else {
                    words.extend([1, 1, 0, 0, 0, 0]);
                    return Key::of_pixel(place, 0xff, NONE, 0);
                };
                let first = self
                    .layers
                    .partition_point(|&(other, _)| other < pixel as u32);
                let number = self.layers[first + nth].1;
                words.extend([i64::from(nth + 1 == held.layers.len()), 0]);
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
        ]);
        all
    }

    /// Words of a request to shade: the pixel, if it looks along rays, and the sums.
    fn request(&self, shaded: &Shaded, words: &mut Vec<i64>) {
        if asks_for_pixel(&self.machine.machine, self.kind) {
            words.extend(shaded.input.pixel);
        }
        sums_of(shaded, words);
    }

    /// Records of setup for ellipsoids: splats that are lit before they are drawn, and the sort.
    fn of_setup(&self) -> Vec<RecordSource<'_>> {
        let w = &self.observer;
        let emitted = |i: usize| -> &Emitted { &w.emitted[i] };
        let splat = |place: u32| self.splats[w.set_up[place as usize].splat as usize];
        let mut all = Vec::new();
        if let (1.., Some(unit)) = (self.kind.harmonics, self.machine.colour()) {
            // One for each splat that left setup, in the same order.
            let at = |i: usize| (w.coloured[i], self.left[i]);
            all.push(source("colour.in", w.coloured.len(), move |i, words| {
                let (coloured, place) = at(i);
                let splat_words = &self.frame.splats[coloured.splat as usize];
                words.extend(splat_words.position.map(i64::from));
                let own = self.coefficients(coloured.splat).as_flattened();
                words.extend(own.iter().copied().map(i64::from));
                let rest = 3 * unit.coefficients() - own.len();
                words.extend(std::iter::repeat_n(0, rest));
                Key::of_splat(splat(place), nth(&self.projected, place), 0)
            }));
            all.push(source("colour.out", w.coloured.len(), move |i, words| {
                let (coloured, place) = at(i);
                words.extend(coloured.rgb.map(i64::from));
                Key::of_splat(splat(place), i as u32, coloured.flags)
            }));
        }
        if self.kind.preshaded {
            all.push(source(
                "ellipse.request",
                w.emitted.len(),
                move |i, words| {
                    sums_of(&emitted(i).shaded, words);
                    // One for each splat that left setup, in the same order.
                    Key::of_splat(
                        splat(self.left[i]),
                        nth(&self.projected, self.left[i]),
                        emitted(i).flags[0],
                    )
                },
            ));
            all.push(source(
                "ellipse.answer",
                w.emitted.len(),
                move |i, words| {
                    light_of(&emitted(i).shaded, words);
                    Key::of_splat(splat(self.left[i]), i as u32, emitted(i).flags[1])
                },
            ));
        }
        if self.kind.sorted {
            let depth = |place: u32| w.set_up[place as usize].project[5];
            all.push(source("sort.in", self.left.len(), move |i, words| {
                let place = self.left[i];
                words.extend([splat(place).into(), depth(place)]);
                Key::of_splat(splat(place), nth(&self.projected, place), 0)
            }));
            all.push(source("sort.out", self.drawn.len(), move |i, words| {
                let place = self.drawn[i];
                let key = unit_replay::sort(
                    self.machine,
                    &[depth(place)],
                    &mut rtl_model::probe::NoProbe,
                );
                words.extend([splat(place).into(), key.map_or(0, |keyed| keyed[0].1)]);
                Key::of_splat(splat(place), nth(&self.left, place), 0)
            }));
        }
        all
    }

    /// Requests and held fragments of `fragment` in sheets.
    fn of_sheets(&self) -> Vec<RecordSource<'_>> {
        let start = source(
            "fragment.start",
            self.start_records.len(),
            move |i, words| {
                let (pixel, slots) = &self.start[self.start_records[i].0 as usize];
                pixel_words(*pixel, slots, words);
                Key::of_pixel(*pixel, 0, NONE, 0)
            },
        );
        let held = source("fragment.held", self.layers.len(), move |i, words| {
            let place = self.pixels[self.layers[i].0 as usize].0;
            if let Some(held) = self.held(self.layers[i].0) {
                pixel_words(place, &held.slots, words);
                words.extend(light(&held.layers[0]));
            }
            Key::of_pixel(place, 0, NONE, 0)
        });
        vec![start, held]
    }

    /// Requests and held fragments of `fragment` in windows, which are shaded pixel by pixel at the
    /// end of a frame.
    fn of_windows(&self) -> Vec<RecordSource<'_>> {
        let emitted = self.observer.emitted.len();
        let request_count = self.merged.len() + self.resolved.len();
        let key = move |i: usize, parent: u32, flags: u8| match self.merged.get(i) {
            Some(shaded) => self.of_merge(
                shaded,
                if parent == NONE {
                    self.contribution(shaded.key)
                } else {
                    parent
                },
                flags,
            ),
            None => {
                let [_, x, y] = parts(self.shaded(emitted + i).key);
                Key::of_pixel([x, y], 0xff, parent, flags)
            }
        };
        vec![
            source("fragment.request", request_count, move |i, words| {
                sums_of(self.shaded(emitted + i), words);
                key(i, NONE, 0)
            }),
            source("fragment.answer", request_count, move |i, words| {
                light_of(self.shaded(emitted + i), words);
                key(i, i as u32, self.shaded(emitted + i).flags)
            }),
            source("fragment.held", self.layers.len(), move |i, words| {
                let (pixel, number) = self.layers[i];
                let place = self.pixels[pixel as usize].0;
                let slot = self.held(pixel).map_or(0, |held| {
                    let layer = &held.layers[usize::from(number)];
                    words.extend([
                        place[0].into(),
                        place[1].into(),
                        layer.slot as i64,
                        layer.depth,
                    ]);
                    words.extend(light(layer));
                    layer.slot as u32
                });
                Key::of_pixel(place, slot, NONE, 0)
            }),
        ]
    }

    /// Requests and held fragments of `fragment` if it groups by depth.
    fn of_slots(&self) -> Vec<RecordSource<'_>> {
        vec![
            source("fragment.request", self.merged.len(), move |i, words| {
                self.request(&self.merged[i], words);
                self.of_merge(&self.merged[i], self.contribution(self.merged[i].key), 0)
            }),
            source("fragment.answer", self.merged.len(), move |i, words| {
                light_of(&self.merged[i], words);
                self.of_merge(&self.merged[i], i as u32, self.merged[i].flags)
            }),
            source(
                "fragment.start",
                self.start_records.len(),
                move |i, words| {
                    let (pixel, number) = self.start_records[i];
                    let (pixel, slots) = &self.start[pixel as usize];
                    slot_words(*pixel, number.into(), &slots[usize::from(number)], words);
                    Key::of_pixel(*pixel, number.into(), NONE, 0)
                },
            ),
            source("fragment.held", self.layers.len(), move |i, words| {
                let (pixel, number) = self.layers[i];
                let place = self.pixels[pixel as usize].0;
                if let Some(held) = self.held(pixel) {
                    let number = usize::from(number);
                    let (slot, layer) = (&held.slots[number], &held.layers[number]);
                    slot_words(place, number, slot, words);
                    words.extend(if slot.shaded { light(layer) } else { [0; 4] });
                }
                Key::of_pixel(place, number.into(), NONE, 0)
            }),
        ]
    }

    /// The splat of the frame, column and row of a key.
    fn parts(&self, key: u64) -> [u32; 3] {
        let [number, x, y] = parts(key);
        // Sorted splats are numbered in drawing order.
        let splat = if self.kind.sorted {
            self.observer.set_up[self.drawn[number as usize] as usize].splat
        } else {
            number
        };
        [splat, x, y]
    }

    /// Fragments that a pixel holds at the end.
    fn held(&self, pixel: u32) -> Option<&HeldFragments> {
        self.pixels[pixel as usize]
            .1
            .map(|place| &self.observer.held[place as usize])
    }

    /// A splat's axes and scales if it is an ellipsoid; 0 if it has those of the frame.
    fn orientation(&self, splat: u32, words: &mut Vec<i64>) {
        let Some(ellipsoids) = &self.frame.ellipsoids else {
            return;
        };
        let own = ellipsoids
            .own
            .get(splat as usize)
            .copied()
            .unwrap_or_default();
        words.extend(
            own.quaternion
                .iter()
                .chain(&own.scales)
                .map(|&word| i64::from(word)),
        );
    }

    /// The number of a splat's sheet.
    fn sheet(&self, splat: u32) -> i64 {
        let Some(sheets) = &self.frame.sheets else {
            return 0;
        };
        let number = match sheets.each {
            Each::Splat => self.splats[splat as usize],
            Each::Slice => sheets
                .numbers
                .get(splat as usize)
                .copied()
                .unwrap_or_default(),
        };
        i64::from(number) & ((1 << rtl_model::records::SHEET_BITS) - 1)
    }

    /// Coefficients of a splat's harmonics; none where it has a colour.
    fn coefficients(&self, splat: u32) -> &[[i32; 3]] {
        let ellipsoids = self.frame.ellipsoids.as_ref();
        ellipsoids.map_or(&[], |ellipsoids| {
            let each = (usize::from(ellipsoids.harmonics) + 1).pow(2);
            let from = each * splat as usize;
            ellipsoids
                .coefficients
                .get(from..from + each)
                .unwrap_or_default()
        })
    }

    /// A splat's own colour, from its record or from its harmonics.
    fn own_colour(&self, splat: u32) -> [i32; 3] {
        let coloured = &self.observer.coloured;
        match coloured.binary_search_by_key(&splat, |coloured| coloured.splat) {
            Ok(place) => coloured[place].rgb,
            Err(_) => self.frame.splats[splat as usize].rgb,
        }
    }

    /// A splat's colour as drawn: windows accumulate the unlit colour.
    fn rgb(&self, splat: u32) -> [i32; 3] {
        if self.kind.windows {
            self.own_colour(splat)
        } else {
            self.light(splat)
        }
    }

    /// A splat's own light, or its colour if it is not lit before it is drawn.
    fn light(&self, splat: u32) -> [i32; 3] {
        let lit = self
            .observer
            .emitted
            .binary_search_by_key(&splat, |emitted| emitted.splat);
        lit.map_or_else(
            |_| self.own_colour(splat),
            |place| self.observer.emitted[place].rgb,
        )
    }

    fn amplitude(&self, arrival: &FragmentTransfer) -> i64 {
        self.set_up_of(self.parts(arrival.key)[0])[9]
    }

    fn normal(&self, splat: u32) -> [i64; 3] {
        let words = self.set_up_of(splat);
        [words[3], words[4], words[5]]
    }

    /// Output of `ellipse` for a splat that has fragments.
    fn set_up_of(&self, splat: u32) -> &[i64] {
        let record = self.raster_records[splat as usize] as usize;
        &self.observer.set_up[self.drawn[record] as usize].ellipse
    }

    fn of_arrival(&self, arrival: &FragmentTransfer, parent: u32, flags: u8) -> Key {
        let [index, x, y] = self.parts(arrival.key);
        Key {
            splat: self.splats[index as usize],
            x,
            y,
            slot: 0xff,
            parent,
            flags,
        }
    }

    fn of_merge(&self, shaded: &Shaded, parent: u32, flags: u8) -> Key {
        let [index, x, y] = self.parts(shaded.key);
        Key {
            splat: self.splats[index as usize],
            x,
            y,
            slot: 0xff,
            parent,
            flags,
        }
    }

    /// Index in `fragment.in` of a contribution.
    fn contribution(&self, key: u64) -> u32 {
        let record = self
            .taken
            .binary_search_by_key(&key, |&place| self.observer.arrivals[place as usize].key);
        record.map_or(NONE, |record| record as u32)
    }

    /// Number of fragments shaded for setup, for merges, and at the end.
    fn shaded_records(&self) -> usize {
        self.observer.emitted.len() + self.merged.len() + self.resolved.len()
    }

    fn shaded(&self, i: usize) -> &Shaded {
        let Some(i) = i.checked_sub(self.observer.emitted.len()) else {
            return &self.observer.emitted[i].shaded;
        };
        self.merged
            .get(i)
            .unwrap_or_else(|| &self.resolved[i - self.merged.len()])
    }

    fn of_shaded(&self, i: usize, parent: u32, flags: u8) -> Key {
        let before = self.observer.emitted.len();
        if i < before {
            let splat = self.splats[self.observer.emitted[i].splat as usize];
            return Key::of_splat(splat, if parent == NONE { i as u32 } else { parent }, flags);
        }
        let shaded = self.shaded(i);
        if i < before + self.merged.len() {
            // If splats are lit first, records of `shade.in` are made from those requests.
            let request = if before == 0 { i as u32 } else { NONE };
            return self.of_merge(shaded, if parent == NONE { request } else { parent }, flags);
        }
        let [_, x, y] = parts(shaded.key);
        Key::of_pixel([x, y], 0xff, parent, flags)
    }

    fn resolve_records(&self) -> usize {
        let empty = self.pixels.iter().filter(|(_, held)| {
            held.is_none_or(|place| self.observer.held[place as usize].layers.is_empty())
        });
        self.layers.len() + empty.count()
    }

    fn frame_words(&self, i: usize, words: &mut Vec<i64>) -> u8 {
        let (place, held) = self.pixels[i];
        words.extend(place.map(i64::from));
        let Some(held) = held.map(|place| &self.observer.held[place as usize]) else {
            // A pixel in a tile that no splat touches.
            let probe = &mut rtl_model::probe::NoProbe;
            words.extend(self.machine.resolve.one(
                &[],
                self.frame.background,
                &mut rtl_model::probe::Tap::new(probe),
            ));
            return 0;
        };
        words.extend(held.frame);
        held.flags
    }
}

fn source<'a>(
    name: &'static str,
    records: usize,
    at: impl Fn(usize, &mut Vec<i64>) -> Key + Sync + 'a,
) -> RecordSource<'a> {
    RecordSource {
        name,
        records,
        at: Box::new(at),
    }
}

//! Items: finds the records that each unit took, item by item, from the recorded work and the keys
//! of the trace.
//!
//! ```text
//! work ─► splats ─► tiles, or the frame ─► stamps ─► items of each unit, in its order ───┐
//! sources ─► records by splat and pixel ─────────────────────────────────────────────────┴─► (cycle, unit, lane, record)
//! ```
//! The walk repeats that of `rtl_model::timing` in a simple form. It is compared with the timing
//! model's log: a unit gets no words if its number of items differs from the walk's. Neither do the
//! units of a binned machine that skip pixels that have stopped, and units behind the lists of one
//! with masks or with tiles that are not whole recorded tiles.

use super::super::transfers::{NONE, RecordSource};
use rtl_model::machine::timing::Organisation;
use rtl_model::pipeline::Elaborated;
use rtl_model::timing::{Lists, UnitCycles};
use rtl_model::work::{CullReason, Event, Footprint, Reader, TILE_PX, Work};
use std::collections::HashMap;
use std::ops::Range;

/// Units whose items are splats, or entries of a list, and the stream of their records.
const OF_SPLATS: [(&str, &str); 7] = [
    ("fetch", "pipeline.in"),
    ("project", "project.in"),
    ("ellipse", "ellipse.in"),
    ("colour", "colour.in"),
    ("bin", "raster.in"),
    ("list", "raster.in"),
    ("raster", "raster.in"),
];

/// Units whose items are stamps, with one record per pixel.
const OF_STAMPS: [(&str, &str); 3] = [
    ("gauss", "gauss.in"),
    ("cache", "fragment.in"),
    ("fragment", "fragment.in"),
];

/// Units whose items are fragments, or adjacent pixels, with one record per cycle.
const OF_PIXELS: [(&str, &str); 3] = [
    ("shade", "shade.in"),
    ("resolve-shade", "shade.in"),
    ("resolve", "resolve.in"),
];

/// The stream of a unit's records, and whether there is one per pixel of a stamp. The sort is not
/// included: it takes whole passes.
pub fn stream_of(unit: &str) -> Option<(&'static str, bool)> {
    let is_of = |(name, _): &&(&str, &'static str)| *name == unit;
    let one = OF_SPLATS
        .iter()
        .chain(&OF_PIXELS)
        .find(is_of)
        .map(|(_, stream)| (*stream, false));
    one.or_else(|| {
        OF_STAMPS
            .iter()
            .find(is_of)
            .map(|(_, stream)| (*stream, true))
    })
}

/// Start cycle, lane and record on the wires of a unit; None if the trace does not have the record.
pub type Shown = (u64, u32, Option<u32>);

/// A pixel of a stamp.
#[derive(Clone, Copy)]
struct StampPixel {
    at: [u32; 2],
    lane: u32,
    is_faint: bool,
    shades: u8,
}

/// A unit and the items that it has taken so far.
struct UnitItems<'a> {
    log: &'a [u64],
    items: usize,
    shown: Vec<Shown>,
}

/// Walks through a frame.
pub struct FrameWalk<'a> {
    machine: &'a Elaborated,
    work: &'a Work,
    /// Indices of the frame's splats in the trace.
    splats: &'a [u32],
    cycles: Range<u64>,
    takers: HashMap<&'static str, UnitItems<'a>>,
    by_splat: HashMap<&'static str, HashMap<u32, Range<u32>>>,
    /// For shade: fragments shaded for a merge, by splat and pixel, and those shaded in resolve, by
    /// pixel.
    lit: HashMap<(u32, [u32; 2]), Vec<u32>>,
    resolved: HashMap<[u32; 2], Range<u32>>,
    sources: HashMap<&'static str, &'a RecordSource<'a>>,
    readers: Vec<Reader<'a>>,
    tiles: Vec<usize>,
    held: Vec<[u8; 2]>,
}

impl<'a> FrameWalk<'a> {
    /// Walks through a frame of these splats; records of these cycles are collected.
    pub fn new(
        machine: &'a Elaborated,
        work: &'a Work,
        splats: &'a [u32],
        units: &'a [UnitCycles],
        sources: &'a [RecordSource<'a>],
        [first, end]: [u64; 2],
    ) -> Self {
        let taker = |unit: &'a UnitCycles| {
            (
                unit.name,
                UnitItems {
                    log: &unit.log,
                    items: 0,
                    shown: Vec::new(),
                },
            )
        };
        let columns = (work.width as usize).div_ceil(TILE_PX);
        let mut tiles = vec![usize::MAX; columns * (work.height as usize).div_ceil(TILE_PX)];
        for (index, tile) in work.tiles.iter().enumerate() {
            let [column, row] = tile.corner.map(|at| usize::from(at) / TILE_PX);
            tiles[row * columns + column] = index;
        }
        let mut walk = FrameWalk {
            machine,
            work,
            splats,
            cycles: first..end,
            takers: units
                .iter()
                .filter(|unit| unit.index == 0)
                .map(taker)
                .collect(),
            by_splat: HashMap::new(),
            lit: HashMap::new(),
            resolved: HashMap::new(),
            sources: sources.iter().map(|source| (source.name, source)).collect(),
            readers: work.tiles.iter().map(|tile| tile.reader()).collect(),
            tiles,
            held: work.held(),
        };
        walk.index();
        walk
    }

    /// Finds the records of each splat and pixel.
    fn index(&mut self) {
        let mut words = Vec::new();
        let mut key = |source: &RecordSource, record: usize| {
            words.clear();
            (source.at)(record, &mut words)
        };
        let one_by_one = |record: u32| record..record + 1;
        for (_, stream) in OF_SPLATS.iter().chain(&OF_STAMPS) {
            let Some(source) = self
                .sources
                .get(stream)
                .copied()
                .filter(|_| !self.by_splat.contains_key(stream))
            else {
                continue;
            };
            let mut ranges: HashMap<u32, Range<u32>> = HashMap::new();
            for record in 0..source.records {
                ranges
                    .entry(key(source, record).splat)
                    .or_insert(one_by_one(record as u32))
                    .end = record as u32 + 1;
            }
            self.by_splat.insert(stream, ranges);
        }
        if let Some(source) = self.sources.get("shade.in").copied() {
            for record in 0..source.records {
                let key = key(source, record);
                self.lit
                    .entry((key.splat, [key.x, key.y]))
                    .or_default()
                    .push(record as u32);
            }
        }
        if let Some(source) = self.sources.get("resolve.in").copied() {
            for record in 0..source.records {
                let key = key(source, record);
                self.resolved
                    .entry([key.x, key.y])
                    .or_insert(one_by_one(record as u32))
                    .end = record as u32 + 1;
            }
        }
    }

    /// Records on the wires of each unit whose items the walk reproduces.
    pub fn shown(mut self) -> HashMap<&'static str, Vec<Shown>> {
        match self.machine.timing.timing.organisation {
            Organisation::Immediate => self.immediate(),
            Organisation::Binned => self.binned(),
        }
        // The stamps that a binned machine skips depend on cycles, which this walk does not model.
        let is_timed =
            self.work.stops() && self.machine.timing.timing.organisation == Organisation::Binned;
        let is_cut = self.is_cut();
        let is_known = |unit: &str, taker: &UnitItems| {
            taker.items == taker.log.len()
                && !(is_cut && ["raster", "gauss", "fragment", "shade"].contains(&unit))
                && !(is_timed && ["list", "raster", "gauss", "fragment"].contains(&unit))
        };
        self.takers
            .into_iter()
            .filter(|(unit, taker)| is_known(unit, taker))
            .map(|(unit, taker)| (unit, taker.shown))
            .collect()
    }

    /// Whether tiles have masks, or parts of recorded tiles: this walk does not cut footprints.
    fn is_cut(&self) -> bool {
        let t = &self.machine.timing;
        let is_whole = (t.timing.tile.side_px as usize).is_multiple_of(TILE_PX);
        t.timing.organisation == Organisation::Binned && (t.masks().is_some() || !is_whole)
    }

    fn binned(&mut self) {
        let (machine, work) = (self.machine, self.work);
        let t = &machine.timing.timing;
        let side = t.tile.side_px;
        let lists = Lists::new(&machine.timing, work);
        let by_tiles = if t.tile.buffers == 2 {
            "resolve-shade"
        } else {
            "shade"
        };
        for splat in 0..self.work.cull_reasons.len() {
            if self.set_up(splat) {
                self.take_splat("bin", splat as u32);
            }
        }
        for tile in 0..lists.tiles() {
            let corner = [tile % lists.columns, tile / lists.columns].map(|at| at as u32 * side);
            let mut listed = lists.of(tile).iter().peekable();
            for entry in lists.boxes().of(tile) {
                let footprint = &work.footprints[*entry as usize];
                if self.is_cut() {
                    if listed.next_if_eq(&entry).is_some() {
                        self.take_splat("list", footprint.splat);
                    }
                    continue;
                }
                if listed.next_if_eq(&entry).is_none() {
                    // It has no pixel here.
                    self.stamps(footprint, corner, side);
                    continue;
                }
                self.take_splat("list", footprint.splat);
                self.footprint(footprint, corner, side, false);
            }
            if !lists.of(tile).is_empty() {
                let [columns, rows] = [(corner[0], work.width), (corner[1], work.height)]
                    .map(|(from, size)| from..size.min(from + side));
                self.resolve(columns, rows, by_tiles);
            }
        }
    }

    fn immediate(&mut self) {
        let mut footprints = self.work.footprints.iter();
        for splat in 0..self.work.cull_reasons.len() {
            if self.set_up(splat)
                && let Some(footprint) = footprints.next()
            {
                self.footprint(footprint, [0, 0], u16::MAX.into(), true);
            }
        }
        let [columns, rows] = self.machine.timing.timing.cache.line_px;
        let (width, height) = (self.work.width, self.work.height);
        for top in (0..height).step_by(rows as usize) {
            for left in (0..width).step_by(columns as usize) {
                self.resolve(
                    left..width.min(left + columns),
                    top..height.min(top + rows),
                    "shade",
                );
            }
        }
    }

    /// A splat passes setup; returns whether it has a footprint.
    fn set_up(&mut self, splat: usize) -> bool {
        let (cull_reason, number) = (self.work.cull_reasons[splat], splat as u32);
        self.take_splat("fetch", number);
        self.take_splat("project", number);
        if cull_reason.leaves_project() {
            self.take_splat("ellipse", number);
        }
        let is_drawn = cull_reason == CullReason::Drawn;
        if is_drawn {
            self.take_splat("colour", number);
        }
        if is_drawn && self.work.preshaded {
            let record = self
                .lit
                .get(&(self.splats[splat], [0xffff; 2]))
                .map(|records| records[0]);
            self.take("shade", |now, shown| shown.push((now, 0, record)));
        }
        is_drawn
    }

    /// A unit takes its next item; `show` is only called in the collected cycles.
    fn take(&mut self, unit: &str, show: impl FnOnce(u64, &mut Vec<Shown>)) {
        let Some(taker) = self.takers.get_mut(unit) else {
            return;
        };
        let now = taker.log.get(taker.items).copied();
        taker.items += 1;
        if let Some(now) = now.filter(|now| self.cycles.contains(now)) {
            show(now, &mut taker.shown);
        }
    }

    /// Takes an item that is a splat of the frame.
    fn take_splat(&mut self, unit: &'static str, splat: u32) {
        let record = self.records(unit, splat).map(|records| records.start);
        self.take(unit, |now, shown| shown.push((now, 0, record)));
    }

    /// The records of a splat of the frame in a unit's stream.
    fn records(&self, unit: &str, splat: u32) -> Option<Range<u32>> {
        let (stream, _) = stream_of(unit)?;
        self.by_splat
            .get(stream)?
            .get(&self.splats[splat as usize])
            .cloned()
    }

    /// Passes the part of a footprint in these pixels through raster, gauss, fragment and, for
    /// merges, shade, stamp by stamp.
    fn footprint(&mut self, footprint: &Footprint, corner: [u32; 2], side: u32, is_cached: bool) {
        let (stamps, kept) = self.stamps(footprint, corner, side);
        for _ in 0..stamps {
            self.take_splat("raster", footprint.splat);
        }
        let splat = footprint.splat;
        for pixels in kept.chunk_by(|(one, _), (next, _)| one == next) {
            let pixels: Vec<StampPixel> = pixels.iter().map(|(_, pixel)| *pixel).collect();
            self.take_stamp("gauss", splat, &pixels);
            let taken: Vec<StampPixel> =
                pixels.into_iter().filter(|pixel| !pixel.is_faint).collect();
            if taken.is_empty() {
                continue;
            }
            if is_cached {
                self.take_stamp("cache", splat, &taken);
            }
            self.take_stamp("fragment", splat, &taken);
            if self.work.preshaded {
                continue;
            }
            for pixel in &taken {
                let lit = self
                    .lit
                    .get(&(self.splats[splat as usize], pixel.at))
                    .cloned()
                    .unwrap_or_default();
                for nth in 0..usize::from(pixel.shades) {
                    let record = lit.get(nth).copied();
                    self.take("shade", |now, shown| shown.push((now, 0, record)));
                }
            }
        }
    }

    /// Takes an item that is a stamp; lanes without a pixel have no record.
    fn take_stamp(&mut self, unit: &'static str, splat: u32, pixels: &[StampPixel]) {
        let [columns, rows] = self.machine.timing.timing.raster.lanes;
        let records = self.records(unit, splat).unwrap_or(0..0);
        let source = stream_of(unit).and_then(|(stream, _)| self.sources.get(stream).copied());
        self.take(unit, |now, shown| {
            let first = shown.len();
            shown.extend((0..columns * rows).map(|lane| (now, lane, None)));
            let mut words = Vec::new();
            let mut place = |record: u32| {
                words.clear();
                source
                    .map(|source| (source.at)(record as usize, &mut words))
                    .map_or([NONE; 2], |key| [key.y, key.x])
            };
            for pixel in pixels {
                // The records of a splat are sorted row by row.
                let (mut low, mut high) = (records.start, records.end);
                let wanted = [pixel.at[1], pixel.at[0]];
                while low < high {
                    let middle = low + (high - low) / 2;
                    if place(middle) < wanted {
                        low = middle + 1
                    } else {
                        high = middle
                    }
                }
                let is_there = low < records.end && place(low) == wanted;
                shown[first + pixel.lane as usize].2 = is_there.then_some(low);
            }
        });
    }

    /// The stamps of the part of the next footprint in these pixels, and of those the pixels that
    /// remain, stamp by stamp.
    fn stamps(
        &mut self,
        footprint: &Footprint,
        corner: [u32; 2],
        side: u32,
    ) -> (u32, Vec<(u32, StampPixel)>) {
        let lanes = self.machine.timing.timing.raster.lanes;
        let within = |[first, last]: [u16; 2], corner: u32| {
            [
                u32::from(first).max(corner),
                u32::from(last).min(corner + side - 1),
            ]
        };
        let [columns, rows] = [
            within(footprint.columns, corner[0]),
            within(footprint.rows, corner[1]),
        ];
        let across = (columns[1] - columns[0] + lanes[0]) / lanes[0];
        let down = (rows[1] - rows[0] + lanes[1]) / lanes[1];
        let in_row = (self.work.width as usize).div_ceil(TILE_PX);
        let tile = |at: u32| at as usize / TILE_PX;
        let mut kept = Vec::new();
        for tile_row in tile(rows[0])..=tile(rows[1]) {
            let top = (tile_row * TILE_PX) as u32;
            let [from, to] = [rows[0].max(top), rows[1].min(top + TILE_PX as u32 - 1)];
            for tile_column in tile(columns[0])..=tile(columns[1]) {
                let Some(reader) = self
                    .readers
                    .get_mut(self.tiles[tile_row * in_row + tile_column])
                else {
                    continue;
                };
                let left = (tile_column * TILE_PX) as u32;
                let (kept_rows, events) = reader.splat((to - from) as usize + 1);
                for (row, columns_kept) in kept_rows.iter().enumerate() {
                    for column in
                        (0..TILE_PX as u32).filter(|column| columns_kept >> column & 1 == 1)
                    {
                        let place = row * TILE_PX + column as usize;
                        let happened = || {
                            events
                                .iter()
                                .filter(|(at, _)| usize::from(*at) == place)
                                .map(|(_, event)| event)
                        };
                        let shades = |event: &Event| {
                            if let Event::Merged(shades) = event {
                                *shades
                            } else {
                                0
                            }
                        };
                        let at = [left + column, from + row as u32];
                        let [x, y] = [at[0] - columns[0], at[1] - rows[0]];
                        let pixel = StampPixel {
                            at,
                            lane: x % lanes[0] + y % lanes[1] * lanes[0],
                            is_faint: happened().any(|event| *event == Event::Faint),
                            shades: happened().map(shades).sum(),
                        };
                        kept.push((x / lanes[0] + y / lanes[1] * across, pixel));
                    }
                }
            }
        }
        kept.sort_by_key(|(stamp, pixel)| (*stamp, pixel.at[1], pixel.at[0]));
        (across * down, kept)
    }

    /// Resolve takes these columns and rows of the picture, one layer per cycle, and passes the
    /// remaining fragments to shade.
    fn resolve(&mut self, columns: Range<u32>, rows: Range<u32>, shade: &'static str) {
        let t = &self.machine.timing;
        // Cycles as without stalls.
        let (shade_interval, resolve_interval) =
            (u64::from(t.shade.interval), u64::from(t.resolve.interval));
        let (mut layers, mut lights) = (Vec::new(), Vec::new());
        let mut cycle = 0;
        for at in rows.flat_map(|y| columns.clone().map(move |x| [x, y])) {
            let [fragments, left] =
                self.held[(at[1] * self.work.width + at[0]) as usize].map(u64::from);
            let records = self.resolved.get(&at).cloned();
            for nth in 0..fragments.max(1) {
                let record = records.as_ref().map(|records| records.start + nth as u32);
                layers.push((
                    cycle + nth,
                    record.filter(|record| {
                        records
                            .as_ref()
                            .is_some_and(|records| records.contains(record))
                    }),
                ));
            }
            cycle += (left * shade_interval).max(fragments).max(resolve_interval);
            let lit = self.lit.get(&(NONE, at));
            lights.extend((0..left).map(|nth| lit.and_then(|lit| lit.get(nth as usize)).copied()));
        }
        let lights: Vec<(u64, Option<u32>)> =
            (0..).map(|nth| nth * shade_interval).zip(lights).collect();
        self.take_many("resolve", &layers);
        if !(lights.is_empty() || self.work.preshaded && shade == "shade") {
            self.take_many(shade, &lights);
        }
    }

    /// Takes an item of several records, each with its delay in cycles after the item.
    fn take_many(&mut self, unit: &str, records: &[(u64, Option<u32>)]) {
        let Some(taker) = self.takers.get_mut(unit) else {
            return;
        };
        let now = taker.log.get(taker.items).copied();
        taker.items += 1;
        let Some(now) = now else { return };
        let wanted = records
            .iter()
            .map(|(after, record)| (now + after, 0, *record));
        taker
            .shown
            .extend(wanted.filter(|(cycle, ..)| self.cycles.contains(cycle)));
    }
}

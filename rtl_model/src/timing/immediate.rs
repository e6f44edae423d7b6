//! Immediate: splats in input order, fragments in memory behind a cache.
//!
//! ```text
//! memory ─► fetch ─► project ─► ellipse ─► raster ─► gauss ─► cache ─► fragment      then: resolve ─► memory
//!           records                                           ▲ lines ▼                      ▲ lines
//! ```
//! After the last splat, resolve reads the frame, line by line.

use super::Cycles;
use super::account::{Detail, Ready, Unit};
use super::cache::Cache;
use super::frame::RecordedFrame;
use super::memory::{Direction, LINES, Memory, Outstanding, Requester, WORDS};
use super::stages::{Fill, Merge, Resolve, SetUp};
use super::stamps::{Piece, Stamps, below};
use super::texels;
use crate::elaboration::microarchitecture::Microarchitecture;
use crate::elaboration::unit;
use crate::work::Work;

/// The lines of the frame.
struct FrameLines {
    log: [u32; 2],
    across: u32,
    down: u32,
}

impl FrameLines {
    fn new(timing: &Microarchitecture, work: &Work) -> Self {
        let [columns, rows] = timing.timing.cache.line_px;
        FrameLines {
            log: [columns.ilog2(), rows.ilog2()],
            across: work.width.div_ceil(columns),
            down: work.height.div_ceil(rows),
        }
    }

    /// Adds the lines of a piece, if they are new; their places in the cache are not known yet.
    #[inline(always)]
    fn touch(&self, piece: &Piece, touched: &mut Vec<(u32, usize)>) {
        let [columns, rows] = self.log.map(|log| 1u32 << log);
        let [left, y] = piece.corner.map(u32::from);
        let mut pixels = piece.pixels;
        while pixels != 0 {
            let column = (left + pixels.trailing_zeros()) / columns;
            pixels &= !below((column + 1) * columns - left);
            let line = y / rows * self.across + column;
            if touched.iter().all(|(other, _)| *other != line) {
                touched.push((line, 0));
            }
        }
    }
}

/// Replays a frame.
pub fn replay(timing: &Microarchitecture, frame: &RecordedFrame, detail: Detail) -> Cycles {
    let work = frame.work;
    let t = timing;
    let mut memory = Memory::new(t.timing.memory, detail == Detail::Log);
    let mut setup = SetUp::new(t, work, unit::RASTER, &mut memory, detail);
    let mut fill = Fill::new(t, SetUp::last_name(t, work), "cache", detail, 0);
    let mut walk = Stamps::new(work, t.timing.raster.lanes);
    let mut lookup = Unit::new(
        "cache",
        t.cache,
        [Some(unit::GAUSS), Some(unit::FRAGMENT)],
        detail,
        t.lifted,
    );
    let lines = FrameLines::new(t, work);
    let mut cache = Cache::new(t, (lines.across * lines.down) as usize);
    let mut merge = Merge::new(t, work, "cache", None, detail, 0);
    let mut touched: Vec<(u32, usize)> = Vec::new();
    let mut footprints = work.footprints.iter();
    for (index, cull_reason) in work.cull_reasons.iter().enumerate() {
        let Some(here) = setup.splat(index as u64, *cull_reason, &mut memory) else {
            continue;
        };
        let Some(footprint) = footprints.next() else {
            break;
        };
        let (taken, is_seen) = fill.footprint(
            &mut walk,
            footprint,
            ([0, 0], u16::MAX.into()),
            (here, 0),
            |stamp, here| {
                touched.clear();
                stamp
                    .pieces
                    .iter()
                    .for_each(|piece| lines.touch(piece, &mut touched));
                let ready = Ready {
                    here,
                    room: lookup.behind.free(),
                    ..Ready::default()
                };
                // Stalls along the way occupy it: the first look-up begins in the cycle in which it
                // takes the stamp.
                let start = lookup.free().max(ready.here).max(ready.room);
                let (mut over, mut lines_here) = (start, start);
                for (nth, (line, place)) in touched.iter_mut().enumerate() {
                    let found = cache.look_up(
                        over + u64::from(nth > 0 && !lookup.is_lifted()),
                        *line,
                        &mut memory,
                    );
                    (*place, over) = (found.place, found.over);
                    lines_here = lines_here.max(found.here);
                }
                let taken = lookup.take_with_memory(ready, touched.len() as u64, over + 1 - start);
                lookup.behind.take(taken);
                let here = over + u64::from(t.cache.latency);
                let [now, written] = merge.stamp(
                    stamp,
                    Ready {
                        here,
                        memory: lines_here,
                        ..Ready::default()
                    },
                    &mut memory,
                );
                lookup.behind.give(now);
                touched
                    .iter()
                    .for_each(|(line, place)| cache.written(*line, *place, written));
                taken
            },
        );
        setup.give(here, taken);
        // Resolve begins when the last pixel is written, whether fetch has ended or not.
        if is_seen {
            memory.forget(setup.fetched);
        }
    }
    setup.end(&mut memory);
    let mut resolve = Resolve::new(t, frame.held(), detail, 0);
    resolve_frame(
        t,
        work,
        &lines,
        &cache,
        &mut merge,
        &mut resolve,
        &mut memory,
    );
    let texels = texels::lookups([&setup.texels, &merge.texels]);
    let light = merge.light + resolve.light;
    let (fragment, shade) = merge.units();
    let (mut units, shade) = setup.units(vec![shade]);
    units.extend(
        [fill.raster, fill.gauss, lookup]
            .into_iter()
            .chain(fragment)
            .chain(shade)
            .chain(resolve.units()),
    );
    Cycles {
        lookups: cache.lookups,
        stamps: fill.stamps,
        texels,
        light,
        ..Cycles::of(units, memory, detail)
    }
}

/// Reads each touched line that is not in the cache, and writes every word.
fn resolve_frame(
    t: &Microarchitecture,
    work: &Work,
    lines: &FrameLines,
    cache: &Cache,
    merge: &mut Merge,
    resolve: &mut Resolve,
    memory: &mut Memory,
) {
    let start = merge.written;
    let mut outstanding = Outstanding::new(t.timing.memory.outstanding);
    let line_bytes = u64::from(t.line_bytes);
    let [columns, rows] = t.timing.cache.line_px;
    for line in 0..lines.across * lines.down {
        let [here, touched] = cache.holds(line);
        let mut ready = Ready {
            here: start,
            ..Ready::default()
        };
        if touched && !here {
            let from = start.max(outstanding.free());
            ready.memory = memory.request(
                from,
                Requester::FrameRead,
                Direction::Read,
                LINES + u64::from(line) * line_bytes,
                line_bytes,
            );
            outstanding.push(ready.memory);
        }
        let [left, top] = [line % lines.across * columns, line / lines.across * rows];
        let (across, down) = (
            left..(left + columns).min(work.width),
            top..(top + rows).min(work.height),
        );
        let pixels = u64::from(across.end - left) * u64::from(down.end - top);
        let done = resolve.pixels(
            across,
            down,
            ready,
            (&mut merge.shade, &mut merge.texels),
            memory,
        );
        let address = WORDS + u64::from(line) * u64::from(columns * rows * t.frame_bytes);
        memory.post_write(
            done,
            Requester::FrameWrite,
            address,
            pixels * u64::from(t.frame_bytes),
        );
    }
}

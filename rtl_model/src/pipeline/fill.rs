//! Fill: the second half of the pipeline, tile by tile: raster, gauss, fragment, shade and resolve.

use super::blend::Blender;
use super::blocks;
use super::merges::{Merges, Waiting};
use super::set_up::Emission;
use super::shading::{ShadeEight, input_of, layer_of, lit_layer, shade_for_merge, shade_slot};
use super::{Drawing, Elaborated, Setup, SetupRecord};
use crate::frame::{Each, Frame};
use crate::graph;
use crate::kernels::host::{Host, Kernel, Unvectorised, Vectorised, unvectorised};
use crate::kernels::{Accumulator, PackedTile, Path, Queue, Queued, Short as ShortWeigh, Weigh};
use crate::num::fit::Natural;
use crate::num::{LANES, Lanes, Words};
use crate::probe::{Probe, Ranges, Tap};
use crate::records::{
    Attributes, Contribution, Decision, Layer, MAX_LAYERS, Outcomes, Premultiplied, Slot,
    TILE_AREA, TILE_PX, Weighed,
};
use crate::units::fragment::sheets::{SheetInput, SheetRegisters, has_stopped};
use crate::units::fragment::window::{self, Cluster, Clusters, WindowRegisters};
use crate::units::fragment::{self, FragmentRegisters};
use crate::units::raster::short::{BlockShape, ShortRows, ShortWalks};
use crate::units::{raster, shade};
use crate::work::Bins;
use rayon::prelude::*;

/// Draws all tiles: raster, gauss, fragment, shade and resolve.
pub fn fill<P: Probe>(
    machine: &Elaborated,
    frame: &Frame,
    setup: &Setup,
    probe: &mut P,
) -> Drawing {
    fill_tiles(machine, frame, (setup, None), probe)
}

/// [`fill`] of some tiles, given by whether each is drawn, by rows; the others keep the background.
pub(super) fn fill_tiles<P: Probe>(
    machine: &Elaborated,
    frame: &Frame,
    setup: (&Setup, Option<&[bool]>),
    probe: &mut P,
) -> Drawing {
    let (true, Some(host)) = (P::QUICK, Vectorised::detect()) else {
        return fill_as::<false, i64, P, _>(Unvectorised, machine, frame, setup, probe);
    };
    // The common case has its own compiled path; each path is compiled once per probe. Simple
    // fits with sums of 64 bits would save probes of work and decisions only 1 %.
    let simple = machine.gauss.kernel().is_simple() && machine.fragment.is_simple();
    let narrow = machine.fragment.is_narrow();
    match (simple, narrow) {
        (true, true) => fill_as::<true, i32, P, _>(host, machine, frame, setup, probe),
        (true, false) if !P::WORK && !P::DECISIONS => {
            fill_as::<true, i64, P, _>(host, machine, frame, setup, probe)
        }
        _ => fill_as::<false, i64, P, _>(host, machine, frame, setup, probe),
    }
}

/// Runs of tiles per thread.
const RUNS_A_THREAD: usize = 8;

fn fill_as<const SIMPLE_FITS: bool, L: Accumulator, P: Probe, H: Host>(
    host: H,
    machine: &Elaborated,
    frame: &Frame,
    (setup, drawn): (&Setup, Option<&[bool]>),
    probe: &mut P,
) -> Drawing {
    let highlights = machine.shade.highlights(&frame.lighting);
    let lights = shade::LightRegisters::of(frame, &highlights);
    let registers = FragmentRegisters {
        z_threshold: frame.z_threshold,
        coverage_threshold: frame.coverage_threshold,
    };
    let sheets = frame
        .sheets
        .as_ref()
        .map(|sheets| machine.fragment.sheets(sheets));
    let windows = machine.windows(frame);
    let tests_blocks = machine.tests_blocks(frame).is_some();
    let is_short = SIMPLE_FITS
        && frame.window.is_none()
        && !tests_blocks
        && machine
            .raster
            .is_short(machine.raster.cutoff(frame.view.cutoff))
        && machine.gauss.kernel().is_narrow()
        && machine.fragment.is_depth_narrow();
    let is_lit_by_eight = H::VECTORISED
        && !P::TRANSFERS
        && sheets.is_none()
        && windows.is_none()
        && machine.fragment.is_narrow()
        && lights.surroundings.is_none();
    let bins = bins(frame, setup);
    let touched: Vec<usize> = (0..bins.tiles())
        .filter(|&tile| drawn.is_none_or(|drawn| drawn[tile]) && !bins.of(tile).is_empty())
        .collect();
    // One tile's fragments and one probe per run of tiles that a thread takes.
    let clusters = || windows.as_ref().map(|_| Clusters::default());
    let start = || Run {
        tile: Box::<PackedTile<L>>::default(),
        queue: Box::default(),
        resolve: Blender::new(&machine.resolve),
        clusters: clusters(),
        probe: probe.fork(),
        done: Vec::new(),
    };
    let draw_tile = |mut run: Run<L, P>, (nth, &index): (usize, &usize)| {
        let shared = Shared {
            machine,
            frame,
            lights: &lights,
            setup,
            registers,
            sheets: sheets.as_ref(),
            windows: windows.as_ref(),
            is_short,
            tests_blocks,
            is_lit_by_eight,
        };
        let part = TileEntries {
            splats: bins.of(index),
            corner: [
                (index % bins.columns * TILE_PX) as u16,
                (index / bins.columns * TILE_PX) as u16,
            ],
        };
        let Run {
            tile,
            queue,
            resolve,
            clusters,
            probe,
            ..
        } = &mut run;
        let (clusters, waiting) = (clusters.as_mut(), Waiting::default());
        let resolved = host.run(FillTile::<SIMPLE_FITS, _, L, P> {
            host,
            shared,
            part,
            tile,
            queue,
            resolve,
            waiting,
            clusters,
            masks: Vec::new(),
            probe,
        });
        if let Some(ranges) = run.probe.resample(nth, touched.len()) {
            resample_tile(shared, part, ranges);
        }
        if P::DECISIONS || P::WORK {
            let [x, y] = resolved.corner.map(u32::from);
            run.probe.tile(x, y);
        }
        run.done.push(resolved);
        run
    };
    let finish = |run: Run<L, P>| (run.done, run.probe);
    // Tiles differ in cost. There are several runs per thread, so that a thread that finishes finds
    // another run.
    let longest = touched
        .len()
        .div_ceil(RUNS_A_THREAD * rayon::current_num_threads());
    let tiles = touched.par_iter().enumerate().with_max_len(longest.max(1));
    let runs: Vec<(Vec<Resolved>, P)> = tiles.fold(start, draw_tile).map(finish).collect();
    let background = machine
        .resolve
        .one(&[], frame.background, &mut Tap::new(probe))
        .map(|word| word as u32);
    if let Some(ranges) = probe.resample(0, 1) {
        machine
            .resolve
            .one(&[], frame.background, &mut Tap::new(ranges));
    }
    let pixels = frame.width as usize * frame.height as usize;
    let mut drawing = Drawing {
        width: frame.width,
        height: frame.height,
        frame: vec![background; pixels],
        covered: vec![false; pixels],
        culled: setup.culled,
        outcomes: Outcomes::default(),
    };
    for (tiles, fork) in runs {
        tiles.iter().for_each(|tile| tile.write(&mut drawing));
        probe.absorb(fork);
    }
    drawing
}

/// Tiles drawn one after the other.
struct Run<L, P> {
    tile: Box<PackedTile<L>>,
    queue: Box<Queue>,
    resolve: Blender,
    /// Slots of windows.
    clusters: Option<Clusters>,
    probe: P,
    done: Vec<Resolved>,
}

/// Bins splats by tile. Not inlined, so that its instructions can be counted.
#[inline(never)]
fn bins(frame: &Frame, setup: &Setup) -> Bins {
    setup.bins([frame.width, frame.height])
}

/// A tile's part of the frame.
struct Resolved {
    corner: [u16; 2],
    frame: [[u32; 4]; TILE_AREA],
    covered: [bool; TILE_AREA],
    outcomes: Outcomes,
}

impl Resolved {
    fn write(&self, drawing: &mut Drawing) {
        drawing.outcomes.absorb(&self.outcomes);
        let [left, top] = self.corner.map(usize::from);
        let width = drawing.width as usize;
        let columns = TILE_PX.min(width - left);
        for row in 0..TILE_PX.min(drawing.height as usize - top) {
            let (to, from) = ((top + row) * width + left, row * TILE_PX);
            drawing.frame[to..to + columns].copy_from_slice(&self.frame[from..from + columns]);
            drawing.covered[to..to + columns].copy_from_slice(&self.covered[from..from + columns]);
        }
    }
}

/// State shared by all tiles.
#[derive(Clone, Copy)]
pub(super) struct Shared<'a> {
    pub machine: &'a Elaborated,
    frame: &'a Frame,
    pub lights: &'a shade::LightRegisters<'a>,
    setup: &'a Setup,
    registers: FragmentRegisters,
    sheets: Option<&'a SheetRegisters<'a>>,
    windows: Option<&'a WindowRegisters>,
    /// Whether raster, gauss and fragment may use words of 32 bits.
    is_short: bool,
    /// Whether blocks of pixels are tested.
    tests_blocks: bool,
    /// Whether fragments, including merged ones, may be shaded in batches of eight.
    pub is_lit_by_eight: bool,
}

/// A drawn splat. The words that fragment reads fill one cache line of the host.
#[repr(C, align(64))]
struct DrawnSplat<'a> {
    attributes: Attributes,
    material: u32,
    /// Index in a bin.
    entry: u32,
    record: &'a SetupRecord,
}

impl<'a> DrawnSplat<'a> {
    #[inline(always)]
    fn new(setup: &Setup, frame: &Frame, record: &'a SetupRecord, entry: u32) -> Self {
        let own = &frame.splats[record.splat as usize];
        let ([n, m, o], mut light) = (record.normal, setup.colour(entry).unwrap_or(own.rgb));
        // For windows the sums take a splat's own colour; closed slots take its light.
        if frame.window.is_none()
            && let Some(emission) = setup.emission(entry)
        {
            light = emission.light;
        }
        let [r, g, b] = light;
        DrawnSplat {
            attributes: [1, r, g, b, own.opacity, n, m, o],
            material: own.material,
            entry,
            record,
        }
    }
}

/// Raster and gauss, as used by a tile.
struct HostUnits {
    raster: raster::Raster,
    gauss: Weigh,
}

/// Raster, gauss and fragment's depth in words of 32 bits, with their constants in all lanes.
#[derive(Clone, Copy)]
struct Short<'a, W: Words> {
    cutoff: W,
    gauss: ShortWeigh<'a, W>,
    depth: Natural<W>,
    /// Greatest weight that makes no fragment.
    below: W,
}

impl<'a, W: Words> Short<'a, W> {
    #[inline(always)]
    fn new(
        units: &'a HostUnits,
        Shared {
            machine,
            frame,
            sheets,
            ..
        }: Shared,
    ) -> Self {
        Short {
            cutoff: units
                .raster
                .short_cutoff(units.raster.cutoff(frame.view.cutoff)),
            gauss: units.gauss.short(),
            depth: machine.fragment.short_depth(),
            below: W::splat(sheets.map_or(0, |registers| registers.sheets.least_weight.max(1) - 1)),
        }
    }
}

/// Pixels before they are resolved, and the layers of all pixels, in depth order per pixel.
#[derive(Default)]
struct Blends {
    /// A pixel, and the index of its first layer.
    pixels: Vec<(u8, usize)>,
    layers: Vec<Layer>,
}

impl Blends {
    fn of(&self, item: usize) -> &[Layer] {
        let end = self
            .pixels
            .get(item + 1)
            .map_or(self.layers.len(), |(_, next)| *next);
        &self.layers[self.pixels[item].1..end]
    }
}

/// A tile, and the entries that touch it.
#[derive(Clone, Copy)]
pub(super) struct TileEntries<'a> {
    splats: &'a [u32],
    corner: [u16; 2],
}

impl TileEntries<'_> {
    /// Column and row in the picture of one of the tile's pixels.
    pub fn pixel(&self, pixel: u8) -> [u32; 2] {
        let pixel = u32::from(pixel);
        [
            u32::from(self.corner[0]) + pixel % TILE_PX as u32,
            u32::from(self.corner[1]) + pixel / TILE_PX as u32,
        ]
    }
}

struct FillTile<'a, const SIMPLE_FITS: bool, H, L, P> {
    host: H,
    shared: Shared<'a>,
    part: TileEntries<'a>,
    tile: &'a mut PackedTile<L>,
    queue: &'a mut Queue,
    resolve: &'a mut Blender,
    waiting: Waiting,
    clusters: Option<&'a mut Clusters>,
    /// Of each of the next splats which blocks of the tile are kept; empty if blocks are not tested.
    masks: Vec<u16>,
    probe: &'a mut P,
}

/// Draws a tile once more, for another probe.
#[inline(never)]
fn resample_tile(shared: Shared, part: TileEntries, probe: &mut Ranges) {
    let mut clusters = shared.windows.map(|_| Clusters::default());
    let (tile, queue, clusters) = (&mut Box::default(), &mut Box::default(), clusters.as_mut());
    let resolve = &mut Blender::new(&shared.machine.resolve);
    let shared = Shared {
        is_lit_by_eight: false,
        ..shared
    };
    unvectorised(FillTile::<false, Unvectorised, i64, Ranges> {
        host: Unvectorised,
        shared,
        part,
        tile,
        queue,
        resolve,
        waiting: Waiting::default(),
        clusters,
        masks: Vec::new(),
        probe,
    });
}

impl<const SIMPLE_FITS: bool, H: Host, L: Accumulator, P: Probe> Kernel
    for FillTile<'_, SIMPLE_FITS, H, L, P>
{
    type Output = Resolved;

    #[inline(always)]
    fn run<AnyLanes: Lanes>(mut self) -> Resolved {
        self.tile.clear();
        let mut outcomes = Outcomes::default();
        let mut span = raster::Span::default();
        let mut rows = ShortRows::default();
        // Local copies, so that the compiler keeps the constants in registers.
        let machine = self.shared.machine;
        let Elaborated { raster, gauss, .. } = machine;
        let units = &HostUnits {
            raster: raster.clone(),
            gauss: gauss.kernel().clone(),
        };
        let Shared { setup, frame, .. } = self.shared;
        let entries = self.part.splats;
        let records: Vec<&SetupRecord> = entries.iter().map(|&entry| setup.splat(entry)).collect();
        if self.shared.tests_blocks {
            self.masks = blocks::kept(
                self.host,
                (machine, frame),
                &records,
                self.part.corner,
                &mut *self.probe,
            );
            if P::WORK {
                self.masks.iter().for_each(|mask| self.probe.blocks(*mask));
            }
            self.masks.reverse();
        }
        let mut later = &records[..];
        for (splats, records) in entries
            .chunks(Self::AT_A_TIME)
            .zip(records.chunks(Self::AT_A_TIME))
        {
            // Records are scattered in memory: those of the group after the next, and the next
            // one's splats, are prefetched.
            later = later.get(Self::AT_A_TIME..).unwrap_or_default();
            let (next, after) = later.split_at(later.len().min(Self::AT_A_TIME));
            for record in next {
                AnyLanes::prefetch(&frame.splats[record.splat as usize].rgb);
            }
            for &record in &after[..after.len().min(Self::AT_A_TIME)] {
                AnyLanes::prefetch(record);
            }
            self.splats::<AnyLanes>(
                units,
                splats,
                records,
                (&mut span, &mut rows),
                &mut outcomes,
            );
        }
        self.resolve(outcomes)
    }
}

impl<const SIMPLE_FITS: bool, H: Host, L: Accumulator, P: Probe>
    FillTile<'_, SIMPLE_FITS, H, L, P>
{
    /// Splats, and fragments, that are processed in parallel.
    const AT_A_TIME: usize = if P::TRANSFERS { 1 } else { LANES };
    /// Pixels that are resolved in parallel.
    const PIXELS: usize = if P::TRANSFERS { 1 } else { graph::BATCH };

    /// Raster, gauss and fragment: the parts of up to eight splats in the tile.
    #[inline(always)]
    fn splats<V: Lanes>(
        &mut self,
        units: &HostUnits,
        splats: &[u32],
        records: &[&SetupRecord],
        (span, rows): (&mut raster::Span, &mut ShortRows),
        outcomes: &mut Outcomes,
    ) {
        let Shared { frame, setup, .. } = self.shared;
        let raster = &units.raster;
        let size_px = [frame.width, frame.height];
        let cutoff = raster.cutoff(frame.view.cutoff);
        // Lanes beyond the last splat repeat it; their results are not used.
        let record: [&SetupRecord; LANES] =
            std::array::from_fn(|lane| records[lane.min(records.len() - 1)]);
        let inputs = record.map(|splat| &splat.raster);
        let tap = &mut Tap::new(&mut *self.probe).first(splats.len());
        let is_short =
            SIMPLE_FITS && !P::WORDS && !P::DECISIONS && !P::WORK && self.shared.is_short;
        let short_walks = if is_short {
            let (walks, held) =
                raster.enter_short::<V, P>(size_px, self.part.corner, &inputs, cutoff, tap);
            Some((walks, held, Short::<V::Words>::new(units, self.shared)))
        } else {
            None
        };
        let mut wide_walks = None;
        let drawn: [DrawnSplat; LANES] = std::array::from_fn(|lane| {
            DrawnSplat::new(
                setup,
                frame,
                record[lane],
                splats[lane.min(splats.len() - 1)],
            )
        });
        let mut lane = 0;
        while lane < splats.len().min(LANES) {
            // `is_short` is tested before the bit mask, so that this is not compiled where it is
            // always false.
            if is_short && let Some((walks, held, short)) = &short_walks {
                let first = lane;
                while lane < splats.len()
                    && held & 1 << lane != 0
                    && raster.short_rows::<V, P>(
                        size_px,
                        walks,
                        lane,
                        inputs[lane],
                        cutoff,
                        rows,
                        &mut Tap::new(&mut *self.probe),
                    )
                {
                    self.weigh::<V::Words>(units, short, walks, lane, rows, record[lane].amplitude);
                    lane += 1;
                }
                if lane > first {
                    self.accumulate_queued::<V>(&drawn, outcomes);
                    continue;
                }
            }
            let walks = match &mut wide_walks {
                Some(walks) => walks,
                none => {
                    let tap = &mut Tap::new(&mut *self.probe).first(splats.len());
                    none.insert(raster.enter::<V, P>(size_px, self.part.corner, &inputs, tap))
                }
            };
            let (drawn, tap) = (&drawn[lane], &mut Tap::new(&mut *self.probe));
            raster.span::<V, P>(size_px, walks, lane, inputs[lane], cutoff, span, tap);
            if let Some(mask) = self.masks.pop() {
                span.retain(walks.first_pixel(lane), |pixel| {
                    blocks::has(self.shared.machine, mask, pixel)
                });
            }
            if P::WORK {
                let (rows, left) = walks.part(lane);
                tap.probe.span(rows, left, span.all());
            }
            if P::TRANSFERS {
                tap.probe.walked(drawn.record.splat);
            }
            let mut first = 0;
            while first < span.fragments() {
                self.contribute::<V>(units, drawn, (walks, lane), span, first, outcomes);
                first += Self::AT_A_TIME;
            }
            lane += 1;
        }
    }

    /// Raster and gauss in words of 32 bits, without a probe: queues the fragments of one of eight
    /// splats.
    #[inline(always)]
    fn weigh<W: Words>(
        &mut self,
        units: &HostUnits,
        short: &Short<W>,
        walks: &ShortWalks,
        lane: usize,
        rows: &ShortRows,
        amplitude: i32,
    ) {
        let Short {
            cutoff,
            gauss,
            depth: depths,
            below,
        } = *short;
        let (amplitude, own) = (
            W::splat(amplitude.into()),
            W::splat((lane as i64) << TILE_AREA.ilog2()),
        );
        for shape in BlockShape::of(walks.columns(lane)) {
            let mut blocks = units.raster.blocks(walks, lane, rows, shape);
            loop {
                let [radial, depth] = units.raster.short_fragments(walks, lane, &blocks, cutoff);
                let weight = gauss.weight(radial, amplitude);
                let depth = depths.words(depth.max(W::splat(0)));
                self.queue.push(
                    [weight, depth, blocks.pixels() | own],
                    blocks.inside(weight.above(below)),
                );
                if !blocks.go_on() {
                    break;
                }
            }
        }
    }

    /// Fragment: all queued fragments.
    #[inline(always)]
    fn accumulate_queued<V: Lanes>(
        &mut self,
        drawn: &[DrawnSplat; LANES],
        outcomes: &mut Outcomes,
    ) {
        let Shared {
            machine,
            registers,
            sheets,
            ..
        } = self.shared;
        let merges = &mut Merges {
            host: self.host,
            shared: self.shared,
            part: self.part,
            waiting: &mut self.waiting,
        };
        let (tile, queue, tap) = (
            &mut *self.tile,
            &mut *self.queue,
            &mut Tap::new(&mut *self.probe),
        );
        if let Some(registers) = sheets {
            for nth in 0..queue.len() {
                let Queued {
                    weight,
                    pixel,
                    lane,
                    ..
                } = queue.get(nth);
                let (weight, drawn) = (weight.into(), &drawn[lane]);
                let decision = self.host.run(ToSheet::<SIMPLE_FITS, L, P> {
                    machine,
                    tile,
                    pixel,
                    weight,
                    drawn,
                    registers,
                    tap,
                });
                if !matches!(decision, Decision::Accumulated(_)) {
                    outcomes.count(decision);
                }
            }
            return queue.clear();
        }
        for nth in 0..queue.len() {
            let Queued {
                weight,
                depth,
                pixel,
                lane,
            } = queue.get(nth);
            let DrawnSplat {
                attributes,
                material,
                ..
            } = &drawn[lane];
            let input = fragment::Input {
                weight: weight.into(),
                depth: depth.into(),
                attributes,
                material,
            };
            let decision = machine.fragment.contribute::<Path<SIMPLE_FITS, V, L>, P>(
                tile, pixel, input, &registers, merges, tap,
            );
            if !matches!(decision, Decision::Accumulated(_)) {
                outcomes.count(decision);
            }
        }
        queue.clear();
    }

    /// Gauss and fragment: up to eight fragments of a span.
    #[inline(always)]
    fn contribute<V: Lanes>(
        &mut self,
        units: &HostUnits,
        drawn: &DrawnSplat,
        (walks, lane): (&raster::Walks, usize),
        span: &raster::Span,
        first: usize,
        outcomes: &mut Outcomes,
    ) {
        let Shared {
            machine,
            setup,
            lights,
            registers,
            sheets,
            windows,
            ..
        } = self.shared;
        let record = drawn.record;
        let tile = &mut *self.tile;
        let count = (span.fragments() - first).min(Self::AT_A_TIME);
        let tap = &mut Tap::new(&mut *self.probe).first(count);
        let places = span.places(first);
        let [radial, depth] = units.raster.fragments::<V>(walks, lane, span, places);
        let [radial_index, weight] =
            units
                .gauss
                .lanes::<SIMPLE_FITS, V, P>(radial, i64::from(record.amplitude), tap);
        let pixels = walks.pixels(lane, places);
        if P::TRANSFERS {
            let [x, y] = self.part.pixel(pixels[0]);
            let splat = record.splat;
            let [radial, depth, weight] = [radial, depth, weight].map(|lanes| lanes.to_array()[0]);
            tap.probe.weighed(
                x,
                y,
                &Weighed {
                    splat,
                    radial,
                    depth,
                    weight,
                },
            );
        }
        // A weight that rounds to 0 makes no fragment, and its depth is not used.
        if P::WORDS {
            tap.live &= weight.above(V::splat(0)).signs();
        }
        let least = sheets.map_or(1, |registers| registers.sheets.least_weight.max(1));
        let (radial_index, weight) = (radial_index.to_array(), weight.to_array());
        let depth = machine
            .fragment
            .depth::<SIMPLE_FITS, V, P>(depth, tap)
            .to_array();
        for lane in 0..count {
            if weight[lane] < least {
                if P::WORK {
                    tap.probe.became(None);
                }
                continue;
            }
            let pixel = pixels[lane];
            let had_stopped = P::WORK && sheets.is_some() && has_stopped(tile, pixel);
            let decision = match sheets {
                None if let (Some(registers), Some(clusters)) =
                    (windows, self.clusters.as_deref_mut()) =>
                {
                    let place = self.part.pixel(pixel);
                    let shade = move |slot: &Slot, tap: &mut Tap<P>| {
                        shade_for_merge(machine, lights, slot, place, tap)
                    };
                    let Emission { light, density } =
                        setup.emission(drawn.entry).unwrap_or_default();
                    let input = window::Input {
                        weight: weight[lane],
                        depth: depth[lane],
                        attributes: &drawn.attributes,
                        material: drawn.material,
                        light,
                        density,
                    };
                    to_window(
                        machine,
                        shade,
                        (tile, clusters.of(pixel)),
                        pixel,
                        &input,
                        registers,
                        tap,
                    )
                }
                None => {
                    let input = fragment::Input {
                        weight: weight[lane],
                        depth: depth[lane],
                        attributes: &drawn.attributes,
                        material: &drawn.material,
                    };
                    let merges = &mut Merges {
                        host: self.host,
                        shared: self.shared,
                        part: self.part,
                        waiting: &mut self.waiting,
                    };
                    machine.fragment.contribute::<Path<SIMPLE_FITS, V, L>, P>(
                        tile, pixel, input, &registers, merges, tap,
                    )
                }
                // Not inlined, so that it costs surfaces nothing.
                Some(registers) => self.host.run(ToSheet::<SIMPLE_FITS, L, P> {
                    machine,
                    tile,
                    pixel,
                    weight: weight[lane],
                    drawn,
                    registers,
                    tap,
                }),
            };
            // Most contributions are accumulated. Their number is what remains at the end.
            if !matches!(decision, Decision::Accumulated(_)) {
                outcomes.count(decision);
            }
            if P::WORK {
                // A Gaussian that is blended immediately takes as long as one that is accumulated.
                // So does a contribution that a stopped pixel drops.
                let each = sheets.is_some_and(|registers| registers.sheets.each == Each::Splat);
                if sheets.is_some() && !had_stopped && has_stopped(tile, pixel) {
                    tap.probe.stopped(!each);
                } else {
                    let plain = had_stopped || each && decision == Decision::Merged(0, 1);
                    // Windows are formed before the unit detects that the deepest is hidden, which
                    // takes as long as a sum.
                    let is_formed = windows.is_some() && matches!(decision, Decision::Evicted(_));
                    let took_as_long_as = if plain {
                        Decision::Accumulated(0)
                    } else if is_formed {
                        Decision::Summed(0, 0)
                    } else {
                        decision
                    };
                    tap.probe.became(Some(took_as_long_as));
                }
            }
            if P::DECISIONS {
                let [x, y] = self.part.pixel(pixel);
                let contribution = Contribution {
                    splat: record.splat,
                    radial_index: radial_index[lane],
                    weight: weight[lane],
                    depth: depth[lane],
                };
                tap.probe.contribution(x, y, &contribution, decision);
            }
        }
    }

    /// Shades all unshaded fragments of the tile, eight at a time, in the order of pixels and
    /// slots, where that is faster on the host. Returns nothing otherwise, and for sheets, which
    /// are not shaded here. Not inlined, so that its instructions can be counted.
    #[inline(never)]
    fn shade_side_by_side(&mut self) -> Vec<shade::Output> {
        let Shared {
            machine, lights, ..
        } = self.shared;
        if !self.shared.is_lit_by_eight {
            return Vec::new();
        }
        let mut inputs = Vec::with_capacity((0..=u8::MAX).map(|at| self.tile.live(at)).sum());
        for at in 0..=u8::MAX {
            for slot in 0..self.tile.live(at) {
                let slot = self.tile.slot(at, slot);
                if !slot.shaded {
                    inputs.push(input_of(&slot, [0; 2]));
                }
            }
        }
        let mut outputs = Vec::with_capacity(inputs.len().next_multiple_of(LANES));
        for inputs in inputs.chunks(LANES) {
            outputs.extend(self.host.run(ShadeEight {
                shade: &machine.shade,
                lights,
                inputs,
                probe: &mut *self.probe,
            }));
        }
        outputs
    }

    /// Shade and resolve: every pixel of the tile. Not inlined, so that its instructions can be
    /// counted.
    #[inline(never)]
    fn resolve(mut self, mut outcomes: Outcomes) -> Resolved {
        let (
            Shared {
                machine,
                frame,
                lights,
                sheets,
                windows,
                ..
            },
            corner,
        ) = (self.shared, self.part.corner);
        let mut resolved = Resolved {
            corner,
            frame: [[0; 4]; TILE_AREA],
            covered: [false; TILE_AREA],
            outcomes,
        };
        let probe = &mut *self.probe;
        Merges {
            host: self.host,
            shared: self.shared,
            part: self.part,
            waiting: &mut self.waiting,
        }
        .end(self.tile, probe);
        let lit = self.shade_side_by_side();
        let mut lit = lit.iter();
        let mut all = 0;
        let mut blends = Blends::default();
        let mut layers = [Layer::default(); MAX_LAYERS];
        for pixel in 0..TILE_AREA {
            let at = pixel as u8;
            let live = self.tile.live(at);
            let [x, y] = self.part.pixel(at);
            if x >= frame.width || y >= frame.height {
                if P::WORK {
                    self.probe.held(0, 0);
                }
                continue;
            }
            let tap = &mut Tap::new(&mut *self.probe);
            // For windows all slots are visited; slots inside another are shaded too.
            let mut formed = None;
            let live = match sheets {
                None if let (Some(registers), Some(clusters)) =
                    (windows, self.clusters.as_deref_mut()) =>
                {
                    let shade = |slot: &Slot, tap: &mut Tap<P>| {
                        shade_slot(machine, lights, slot, [x, y], tap)
                    };
                    let slots = &mut clusters.of(at)[..live];
                    let (count, starts, shaded) = machine.fragment.layers_of_windows(
                        slots,
                        registers,
                        &mut layers,
                        shade,
                        tap,
                    );
                    if P::DECISIONS {
                        tap.probe.windows(x, y, starts);
                    }
                    formed = Some([live as u8, shaded]);
                    count
                }
                None => {
                    for (slot, layer) in layers[..live].iter_mut().enumerate() {
                        let fragment = self.tile.slot(at, slot);
                        *layer = match if fragment.shaded { None } else { lit.next() } {
                            Some(light) => layer_of(slot, &fragment, light),
                            None => lit_layer(machine, lights, slot, &fragment, [x, y], tap),
                        };
                    }
                    live
                }
                Some(registers) => {
                    let composite = machine.fragment.composite(self.tile, at, registers, tap);
                    layers[0] =
                        composite.map_or(Layer::default(), |Premultiplied { colour, opacity }| {
                            Layer {
                                merged: true,
                                colour,
                                opacity,
                                ..Layer::default()
                            }
                        });
                    usize::from(composite.is_some())
                }
            };
            if P::WORK {
                let left = layers[..live].iter().filter(|layer| !layer.merged).count();
                let [fragments, shades] = formed.unwrap_or([live as u8, left as u8]);
                tap.probe.held(fragments, shades);
            }
            if P::TRANSFERS {
                // For sheets this includes the open one, which is not a layer yet.
                let open = sheets.is_some_and(|registers| registers.sheets.each == Each::Slice);
                let held = if open { self.tile.live(at) } else { live };
                let slots: Vec<Slot> = (0..held).map(|slot| self.tile.slot(at, slot)).collect();
                tap.probe.holds(x, y, &slots, &layers[..live]);
            }
            layers[..live].sort_by_key(|layer| layer.depth);
            blends.pixels.push((at, blends.layers.len()));
            blends.layers.extend_from_slice(&layers[..live]);
            if blends.pixels.len() == Self::PIXELS {
                self.blend(&mut blends, &mut resolved);
            }
            let contributions = u64::from(self.tile.contributions(at));
            all += contributions;
            outcomes.most_in_a_pixel = outcomes.most_in_a_pixel.max(contributions);
        }
        self.blend(&mut blends, &mut resolved);
        outcomes.accumulated = all - outcomes.total();
        Resolved {
            outcomes,
            ..resolved
        }
    }

    /// Resolve: frame words of up to a batch of pixels.
    fn blend(&mut self, blends: &mut Blends, resolved: &mut Resolved) {
        let Shared { machine, frame, .. } = self.shared;
        let mut layers: [&[Layer]; graph::BATCH] = [&[]; graph::BATCH];
        let count = blends.pixels.len();
        for (item, layers) in layers[..count].iter_mut().enumerate() {
            *layers = blends.of(item);
        }
        let words = self.resolve.blend(
            self.host,
            &machine.resolve,
            &layers[..count],
            frame.background,
            &mut *self.probe,
        );
        for (item, &(pixel, _)) in blends.pixels.iter().enumerate() {
            let layers = layers[item];
            let word =
                [0, 1, 2, 3].map(|channel| i64::from(words[channel][item / LANES][item % LANES]));
            if P::DECISIONS {
                let [x, y] = self.part.pixel(pixel);
                self.probe.resolved(x, y, layers, word);
            }
            resolved.frame[usize::from(pixel)] = word.map(|channel| channel as u32);
            resolved.covered[usize::from(pixel)] = !layers.is_empty();
        }
        blends.pixels.clear();
        blends.layers.clear();
    }
}

/// Adds one contribution to a pixel of windows. Not inlined, so that it costs other fragments
/// nothing.
#[inline(never)]
fn to_window<L: Accumulator, P: Probe>(
    machine: &Elaborated,
    shade: impl Fn(&Slot, &mut Tap<P>) -> Premultiplied,
    (tile, slots): (&mut PackedTile<L>, &mut [Cluster; MAX_LAYERS + 1]),
    pixel: u8,
    input: &window::Input,
    registers: &WindowRegisters,
    tap: &mut Tap<P>,
) -> Decision {
    tile.count(pixel);
    let live = tile.live(pixel);
    let decision = machine
        .fragment
        .contribute_to_window(slots, live, input, registers, shade, tap);
    if let Decision::Inserted(_) = decision {
        tile.set_live(pixel, live as u8 + 1);
    }
    decision
}

/// One contribution to a sheet.
struct ToSheet<'a, 'p, const SIMPLE_FITS: bool, L, P> {
    machine: &'a Elaborated,
    tile: &'a mut PackedTile<L>,
    pixel: u8,
    weight: i64,
    drawn: &'a DrawnSplat<'a>,
    registers: &'a SheetRegisters<'a>,
    tap: &'a mut Tap<'p, P>,
}

impl<const SIMPLE_FITS: bool, L: Accumulator, P: Probe> Kernel
    for ToSheet<'_, '_, SIMPLE_FITS, L, P>
{
    type Output = Decision;

    #[inline(always)]
    fn run<V: Lanes>(self) -> Decision {
        let ToSheet {
            machine,
            tile,
            pixel,
            weight,
            drawn,
            registers,
            tap,
        } = self;
        let splat = drawn.record.splat;
        let sheet = match registers.sheets.each {
            Each::Splat => splat,
            Each::Slice => registers
                .sheets
                .numbers
                .get(splat as usize)
                .copied()
                .unwrap_or_default(),
        };
        let input = SheetInput {
            sheet,
            weight,
            attributes: &drawn.attributes,
        };
        machine
            .fragment
            .contribute_to_sheet::<Path<SIMPLE_FITS, V, L>, P>(tile, pixel, input, registers, tap)
    }
}

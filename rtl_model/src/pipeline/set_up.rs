//! Set up: the first half of the pipeline, project and ellipse, eight splats at a time.

use super::shading::{emitted, emitting};
use super::{Culled, Elaborated, run};
use crate::frame::{Ellipsoids, Frame, Orientation, Splat, View};
use crate::functions::Table;
use crate::kernels::host::{Kernel, plainly};
use crate::machine::SortKind;
use crate::num::{Fit, LANES, Lanes, Part, Words, three, two};
use crate::probe::{Probe, Ranges, Tap};
use crate::records::{EllipseOut, PROJECTED, ProjectOut, SET_UP, TILE_PX};
use crate::units::ellipse::ellipsoid::Axes;
use crate::units::fragment::window::WindowRegisters;
use crate::units::{ellipse, project, raster, shade};
use crate::work::{Bins, CULLED};
use rayon::prelude::*;

/// A splat that has been set up: what setup adds to the splat's own words, and waits in memory before raster. One line of the host's cache.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C, align(64))]
pub struct SetupRecord {
    pub(super) raster: raster::Input,
    pub(super) amplitude: i32,
    pub(super) normal: [i32; 3],
    pub(super) splat: u32,
}

const _: () = assert!(size_of::<SetupRecord>() == 64);

/// What setup makes of a splat that is lit before it is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Emission {
    /// Its colour under the lights.
    pub light: [i32; 3],
    /// Of windows, how fast it hides what lies behind it.
    pub density: i32,
}

/// Splats set up, and those that fell out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Setup {
    /// In input order, block by block: joining them would copy every splat once more.
    blocks: Vec<Vec<SetupRecord>>,
    /// Their boxes, first and last column, first and last row, once more and close together: whoever bins them wants nothing else.
    boxes: Vec<Vec<[[u16; 2]; 2]>>,
    /// What they send, block by block, where splats are lit before they are drawn; else none.
    emissions: Vec<Vec<Emission>>,
    /// In which order they are drawn; empty: as they lie there.
    order: Vec<u32>,
    /// Not drawn.
    pub culled: Culled,
}

impl Setup {
    /// Brings the splats into the order of their keys, those with equal keys in that of their numbers.
    fn sort<P: Probe>(&mut self, key: &Fit, has_buckets: bool, probe: &mut P) {
        let tap = &mut Tap::new(&mut *probe);
        let keyed =
            numbered(&self.blocks).zip(0..).map(|((entry, splat), nth)| (tap.fit_one(key, i64::from(splat.raster.depth)), nth, entry));
        let mut order: Vec<(i64, u32, u32)> = keyed.collect();
        if let Some(ranges) = probe.resample(0, 1) {
            let tap = &mut Tap::new(ranges);
            for (_, splat) in numbered(&self.blocks) {
                tap.fit_one(key, i64::from(splat.raster.depth));
            }
        }
        order.sort_unstable();
        if P::WORK || P::TRANSFERS {
            // Only buckets depend on more than the order.
            let mut keys = vec![0; if has_buckets { order.len() } else { 0 }];
            order.iter().filter(|_| has_buckets).for_each(|(key, nth, _)| keys[*nth as usize] = *key as u32);
            probe.sorted(order.iter().map(|(_, nth, _)| *nth).collect(), keys);
        }
        self.order = order.into_iter().map(|(.., entry)| entry).collect();
    }

    /// Splats that are left.
    pub fn splats(&self) -> usize {
        self.blocks.iter().map(Vec::len).sum()
    }

    /// The splat of a bin's entry.
    #[inline(always)]
    pub(super) fn splat(&self, entry: u32) -> &SetupRecord {
        &self.blocks[entry as usize / BLOCK_SPLATS][entry as usize % BLOCK_SPLATS]
    }

    /// What the splat of a bin's entry sends, where splats are lit before they are drawn.
    #[inline(always)]
    pub(super) fn emission(&self, entry: u32) -> Option<Emission> {
        self.emissions.get(entry as usize / BLOCK_SPLATS)?.get(entry as usize % BLOCK_SPLATS).copied()
    }

    /// Which splats' boxes touch which tile, in the order in which they are drawn.
    pub(super) fn bins(&self, size_px: [u32; 2]) -> Bins {
        if self.order.is_empty() {
            return Bins::new(size_px, TILE_PX, numbered(&self.boxes).map(|(number, sides)| (number, *sides)));
        }
        let sides = |number: u32| self.boxes[number as usize / BLOCK_SPLATS][number as usize % BLOCK_SPLATS];
        Bins::new(size_px, TILE_PX, self.order.iter().map(|&number| (number, sides(number))))
    }
}

/// What lies in blocks, each with what a bin calls its splat.
fn numbered<T>(blocks: &[Vec<T>]) -> impl Iterator<Item = (u32, &T)> + Clone {
    blocks.iter().enumerate().flat_map(|(block, splats)| ((block * BLOCK_SPLATS) as u32..).zip(splats))
}

/// Splats that one thread sets up at a time.
const BLOCK_SPLATS: usize = 8192;

/// The first half: project and ellipse.
pub fn set_up<P: Probe>(machine: &Elaborated, frame: &Frame, probe: &mut P) -> Setup {
    let blocks: Vec<(Setup, P)> = frame
        .splats
        .par_chunks(BLOCK_SPLATS)
        .enumerate()
        .with_max_len(1)
        .map(|(block, splats)| {
            let mut fork = probe.fork();
            let (first, of) = ((block * BLOCK_SPLATS) as u32, frame.splats.len());
            let setup = match &frame.ellipsoids {
                None => run::<P, _>(SetUp { machine, frame, splats, first, of, probe: &mut fork }),
                Some(ellipsoids) => plainly(SetUpEllipsoids { machine, frame, ellipsoids, splats, first, of, probe: &mut fork }),
            };
            (setup, fork)
        })
        .collect();
    let mut whole = Setup::default();
    for (part, fork) in blocks {
        whole.blocks.extend(part.blocks);
        whole.boxes.extend(part.boxes);
        whole.emissions.extend(part.emissions);
        whole.culled.absorb(&part.culled);
        probe.absorb(fork);
    }
    let windows = frame.window.is_some();
    match &frame.ellipsoids {
        Some(ellipsoids) if P::WORK => {
            probe.ellipsoids(ellipsoids.preshaded || windows, ellipsoids.own.is_empty(), ellipsoids.harmonics);
        }
        None if P::WORK && windows => probe.ellipsoids(true, false, 0),
        _ => {}
    }
    if P::WORK && frame.surroundings.is_some() {
        probe.mirrors();
    }
    if let (Some(sort), true) = (&machine.sort, frame.ellipsoids.as_ref().is_some_and(|ellipsoids| ellipsoids.sorted)) {
        whole.sort(sort, machine.machine.sort.is_some_and(|sort| sort.kind == SortKind::Hierarchical), probe);
    }
    whole
}

struct SetUp<'a, P> {
    machine: &'a Elaborated,
    frame: &'a Frame,
    splats: &'a [Splat],
    first: u32,
    /// Splats of the frame.
    of: usize,
    probe: &'a mut P,
}

/// Sets eight splats up once more, for another to observe.
#[inline(never)]
fn resample_set_up(machine: &Elaborated, frame: &Frame, splats: &[Splat], first: u32, probe: &mut Ranges) {
    plainly(SetUp { machine, frame, splats, first, of: splats.len(), probe });
}

impl<P: Probe> Kernel for SetUp<'_, P> {
    type Output = Setup;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Setup {
        // Copies that nobody else can see: their constants are broadcast to lanes once, outside the loop.
        let (project, ellipse, view) = (self.machine.project.clone(), self.machine.ellipse.clone(), self.frame.view.clone());
        let units = Units { project: &project, ellipse: &ellipse, view: &view, size_px: [self.frame.width, self.frame.height] };
        let lit = self.frame.window.as_ref().map(|_| Lit::new(self.machine, self.frame));
        let mut out = Block::of(self.splats.len());
        if P::TRANSFERS {
            for (splat, first) in self.splats.iter().zip(self.first..) {
                units.set_up::<L::Words, P>(&[*splat; LANES], 1, first, lit.as_ref(), self.probe, &mut out);
            }
            return out.done(lit.is_some());
        }
        let (eights, rest) = self.splats.as_chunks();
        let mut last = [Splat::default(); LANES];
        last[..rest.len()].copy_from_slice(rest);
        for (group, splats) in eights.iter().chain((!rest.is_empty()).then_some(&last)).enumerate() {
            let live = LANES.min(self.splats.len() - group * LANES);
            let first = self.first + (group * LANES) as u32;
            units.set_up::<L::Words, P>(splats, live, first, lit.as_ref(), self.probe, &mut out);
            if let Some(ranges) = self.probe.resample(first as usize / LANES, self.of.div_ceil(LANES)) {
                resample_set_up(self.machine, self.frame, &splats[..live], first, ranges);
            }
        }
        out.done(lit.is_some())
    }
}

struct SetUpEllipsoids<'a, P> {
    machine: &'a Elaborated,
    frame: &'a Frame,
    ellipsoids: &'a Ellipsoids,
    splats: &'a [Splat],
    first: u32,
    /// Splats of the frame.
    of: usize,
    probe: &'a mut P,
}

impl<P: Probe> Kernel for SetUpEllipsoids<'_, P> {
    type Output = Setup;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Setup {
        let Frame { view, width, height, .. } = self.frame;
        let units = Units { project: &self.machine.project, ellipse: &self.machine.ellipse, view, size_px: [*width, *height] };
        let is_lit = self.ellipsoids.preshaded || self.frame.window.is_some();
        let lit = is_lit.then(|| Lit::new(self.machine, self.frame));
        let mut out = Block::of(self.splats.len());
        let at_a_time = if P::TRANSFERS { 1 } else { LANES };
        for (group, splats) in self.splats.chunks(at_a_time).enumerate() {
            let mut eight = [Splat::default(); LANES];
            eight[..splats.len()].copy_from_slice(splats);
            let first = self.first + (group * at_a_time) as u32;
            let mut own = [Orientation::default(); LANES];
            if let Some(some) = self.ellipsoids.own.get(first as usize..) {
                own.iter_mut().zip(some).for_each(|(own, given)| *own = *given);
            }
            units.set_up_ellipsoids::<L::Words, P>(
                (&eight, &own, self.ellipsoids),
                splats.len(),
                first,
                lit.as_ref(),
                self.probe,
                &mut out,
            );
            if let Some(ranges) = self.probe.resample(first as usize / LANES, self.of.div_ceil(LANES)) {
                resample_ellipsoids(self.machine, self.frame, self.ellipsoids, splats, first, ranges);
            }
        }
        out.done(lit.is_some())
    }
}

/// Sets eight ellipsoids up once more, for another to observe.
#[inline(never)]
fn resample_ellipsoids(machine: &Elaborated, frame: &Frame, ellipsoids: &Ellipsoids, splats: &[Splat], first: u32, probe: &mut Ranges) {
    plainly(SetUpEllipsoids { machine, frame, ellipsoids, splats, first, of: splats.len(), probe });
}

/// The lights and materials of a frame, for splats that are lit before they are drawn.
struct Lit<'a> {
    machine: &'a Elaborated,
    frame: &'a Frame,
    highlights: Vec<Option<Table>>,
    windows: Option<WindowRegisters>,
}

impl<'a> Lit<'a> {
    fn new(machine: &'a Elaborated, frame: &'a Frame) -> Self {
        Lit { machine, frame, highlights: machine.shade.highlights(&frame.lighting), windows: machine.windows(frame) }
    }

    /// Of windows, how fast a splat hides what lies behind it.
    fn density<P: Probe>(&self, splat: &Splat, probe: &mut P) -> i32 {
        let density = |registers: &WindowRegisters| self.machine.fragment.density(splat.opacity, registers, &mut Tap::new(probe));
        self.windows.as_ref().map_or(0, density)
    }

    /// The port from setup to shade: the light that one splat sends.
    #[inline(never)]
    fn emission<P: Probe>(&self, splat: &Splat, number: u32, normal: [i32; 3], probe: &mut P) -> [i32; 3] {
        let tap = &mut Tap::new(probe);
        let lights = shade::LightRegisters::of(self.frame, &self.highlights);
        let input = emitting(self.machine, splat.rgb, normal, splat.material, tap);
        if P::WORK && lights.surroundings.is_some() {
            tap.probe.lit();
        }
        if P::TRANSFERS {
            tap.probe.shade_in();
        }
        let output = self.machine.shade.one(&lights, &input, tap);
        if P::TRANSFERS {
            tap.probe.shade_out(&input, &output);
        }
        let rgb = emitted(self.machine, output.colour, tap);
        if P::TRANSFERS {
            tap.probe.emitted(number, rgb);
        }
        rgb
    }
}

/// The units that set splats up.
struct Units<'a> {
    project: &'a project::Project,
    ellipse: &'a ellipse::Ellipse,
    view: &'a View,
    size_px: [u32; 2],
}

/// A block's splats, set up.
struct Block {
    records: Vec<SetupRecord>,
    boxes: Vec<[[u16; 2]; 2]>,
    emissions: Vec<Emission>,
    culled: Culled,
}

impl Block {
    /// None yet of so many.
    fn of(splats: usize) -> Self {
        Block { records: Vec::with_capacity(splats), boxes: Vec::with_capacity(splats), emissions: Vec::new(), culled: Culled::default() }
    }

    /// All of them, without the room that was kept for those that fell out.
    fn done(mut self, is_lit: bool) -> Setup {
        self.records.shrink_to_fit();
        self.boxes.shrink_to_fit();
        let emissions = if is_lit { vec![self.emissions] } else { Vec::new() };
        Setup { blocks: vec![self.records], boxes: vec![self.boxes], emissions, order: Vec::new(), culled: self.culled }
    }
}

impl Units<'_> {
    /// Sets eight splats up, of which the first `live` are there.
    #[inline(always)]
    fn set_up<W: Words, P: Probe>(
        &self,
        splats: &[Splat; LANES],
        live: usize,
        first: u32,
        lit: Option<&Lit>,
        probe: &mut P,
        out: &mut Block,
    ) {
        let tap = &mut Tap::new(probe).first(live);
        let (point, input) = W::apart(Placed { units: self, splats, transparent: W::splat(0), tap });
        let ellipse = W::apart(Discs { units: self, input: &input, tap });
        W::apart(Kept { splats, live, first, set_up: (&point, &ellipse), lit, tap, out });
    }

    /// Sets eight ellipsoids up, of which the first `live` are there.
    #[inline(always)]
    fn set_up_ellipsoids<W: Words, P: Probe>(
        &self,
        (splats, own, ellipsoids): (&[Splat; LANES], &[Orientation; LANES], &Ellipsoids),
        live: usize,
        first: u32,
        lit: Option<&Lit>,
        probe: &mut P,
        out: &mut Block,
    ) {
        let tap = &mut Tap::new(probe).first(live);
        let word = |of: &dyn Fn(usize) -> i32| W::from_array(std::array::from_fn(of));
        let opacity = word(&|lane| splats[lane].opacity);
        let transparent = self.project.transparent(&ellipsoids.kernel, opacity);
        let (point, input) = W::apart(Placed { units: self, splats, transparent, tap });
        let axes = if ellipsoids.own.is_empty() {
            Axes::Frame
        } else {
            let [w, x, y, z] = [0, 1, 2, 3].map(|part| word(&|lane| own[lane].quaternion[part]));
            Axes::Own([w, x, y, z], three!(axis => word(&|lane| own[lane].scales[axis])))
        };
        let set_up = self.ellipse.ellipsoids(self.view, &ellipsoids.kernel, self.size_px, &input, axes, opacity, tap);
        // Elaboration has seen to it that there is one.
        if let Some(ellipse) = set_up {
            W::apart(Kept { splats, live, first, set_up: (&point, &ellipse), lit, tap, out });
        }
    }
}

/// The first half of setup, and what the second is given.
struct Placed<'a, 't, W, P> {
    units: &'a Units<'a>,
    splats: &'a [Splat; LANES],
    transparent: W,
    tap: &'a mut Tap<'t, P>,
}

impl<W: Words, P: Probe> Part for Placed<'_, '_, W, P> {
    type Output = (project::Projected<W>, ellipse::Input<W>);

    #[inline(always)]
    fn run(self) -> Self::Output {
        let Placed { units, splats, transparent, tap } = self;
        // The first eight words of each record as they lie in memory: red comes along.
        let mut records = [W::splat(0); LANES];
        for (record, splat) in records.iter_mut().zip(splats) {
            let Splat { position: [x, y, z], normal: [n, m, o], radius, rgb: [red, ..], .. } = *splat;
            *record = W::from_array([x, y, z, n, m, o, radius, red]);
        }
        let [x, y, z, n, m, o, radius, _] = W::transposed(records);
        let point = units.project.lanes(units.view, [x, y, z], transparent, tap);
        let input = ellipse::Input {
            normal: [n, m, o],
            radius,
            forward: point.camera[2],
            exponent: point.exponent,
            inverse_depth: point.inverse_depth,
            slope: point.slope,
            pixel: point.pixel,
        };
        (point, input)
    }
}

/// The second half of setup, of discs.
struct Discs<'a, 't, W, P> {
    units: &'a Units<'a>,
    input: &'a ellipse::Input<W>,
    tap: &'a mut Tap<'t, P>,
}

impl<W: Words, P: Probe> Part for Discs<'_, '_, W, P> {
    type Output = ellipse::Output<W>;

    #[inline(always)]
    fn run(self) -> ellipse::Output<W> {
        self.units.ellipse.lanes(self.units.view, self.units.size_px, self.input, self.tap)
    }
}

/// Keeps those of eight splats that are not culled.
struct Kept<'a, 't, W, P> {
    splats: &'a [Splat; LANES],
    live: usize,
    first: u32,
    set_up: (&'a project::Projected<W>, &'a ellipse::Output<W>),
    lit: Option<&'a Lit<'a>>,
    tap: &'a mut Tap<'t, P>,
    out: &'a mut Block,
}

impl<W: Words, P: Probe> Part for Kept<'_, '_, W, P> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Kept { splats, live, first, set_up: (point, ellipse), lit, tap, out } = self;
        if P::TRANSFERS {
            tap.probe.set_up(first, projected_words(point), ellipse_words(ellipse));
        }
        let mut left = ((1u32 << live) - 1) as u8;
        let culled = point.near | point.outside | point.transparent | ellipse.backface | ellipse.faint | ellipse.outside;
        if left & culled.signs() != 0 {
            // In the order in which the units find them: the first that holds is the reason.
            let reasons = [point.near, point.outside, point.transparent, ellipse.backface, ellipse.faint, ellipse.outside];
            let mut lanes = [0; CULLED.len()];
            for (lanes, reason) in lanes.iter_mut().zip(reasons) {
                *lanes = left & reason.signs();
                left &= !*lanes;
            }
            if P::WORK {
                tap.probe.culled(first, lanes);
            }
            let [near, outside, transparent, backface, faint, missing] = lanes.map(|lanes| u64::from(lanes.count_ones()));
            out.culled.absorb(&Culled { near, outside: outside + missing, faint, backface, transparent });
        }

        let ([x, y], [xx, xy, yy]) = (point.pixel, ellipse.conic);
        let ([z_x, z_y], [n, m, o]) = (ellipse.depth_slope, ellipse.normal);
        let sides = [ellipse.columns, ellipse.rows];
        let [columns, rows] = two!(axis => sides[axis][0] | sides[axis][1].left(16));
        let plane = W::transposed([x, y, xx, xy, yy, point.depth, z_x, z_y]);
        let rest = W::transposed([ellipse.depth_range, columns, rows, ellipse.amplitude, n, m, o, W::splat(0)]);
        for (lane, own) in splats.iter().enumerate() {
            if left & (1 << lane) == 0 {
                continue;
            }
            let [x, y, xx, xy, yy, depth, z_x, z_y] = plane[lane].to_array();
            let [depth_range, columns, rows, amplitude, n, m, o, _] = rest[lane].to_array();
            if let Some(lit) = lit {
                let light = lit.emission(own, first + lane as u32, [n, m, o], tap.probe);
                out.emissions.push(Emission { light, density: lit.density(own, tap.probe) });
            }
            if P::WORK {
                tap.probe.drawn(first + lane as u32, [halves(columns), halves(rows)]);
            }
            out.boxes.push([halves(columns), halves(rows)]);
            out.records.push(SetupRecord {
                raster: raster::Input {
                    pixel: [x, y],
                    conic: [xx, xy, yy],
                    depth,
                    depth_slope: [z_x, z_y],
                    depth_range,
                    columns: halves(columns),
                    rows: halves(rows),
                },
                amplitude,
                normal: [n, m, o],
                splat: first + lane as u32,
            });
        }
    }
}

/// The low and the high half of a word.
#[inline(always)]
fn halves(word: i32) -> [u16; 2] {
    let [a, b, c, d] = word.to_le_bytes();
    [u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d])]
}

/// The first lane of what `project` makes, as a record has it.
pub(super) fn projected_words<W: Words>(point: &project::Projected<W>) -> [i64; PROJECTED] {
    let ([_, _, forward], inverse) = (point.camera, point.inverse_depth);
    let ([slope_x, slope_y], [pixel_x, pixel_y]) = (point.slope.map(first), point.pixel.map(first));
    let record = ProjectOut {
        near: flag(point.near),
        outside: flag(point.outside),
        transparent: flag(point.transparent),
        forward: first(forward),
        exponent: first(point.exponent),
        depth: first(point.depth),
        inverse_depth: first(inverse.mantissa),
        inverse_depth_exponent: first(inverse.exponent),
        slope_x,
        slope_y,
        pixel_x,
        pixel_y,
    };
    record.into_words()
}

/// The first lane of what `ellipse` makes, as a record has it.
pub(super) fn ellipse_words<W: Words>(e: &ellipse::Output<W>) -> [i64; SET_UP] {
    let ([normal_x, normal_y, normal_z], [conic_xx, conic_xy, conic_yy]) = (e.normal.map(first), e.conic.map(first));
    let ([first_column, last_column], [first_row, last_row]) = (e.columns.map(first), e.rows.map(first));
    let [depth_slope_x, depth_slope_y] = e.depth_slope.map(first);
    let record = EllipseOut {
        backface: flag(e.backface),
        faint: flag(e.faint),
        outside: flag(e.outside),
        normal_x,
        normal_y,
        normal_z,
        conic_xx,
        conic_xy,
        conic_yy,
        amplitude: first(e.amplitude),
        first_column,
        last_column,
        first_row,
        last_row,
        depth_slope_x,
        depth_slope_y,
        depth_range: first(e.depth_range),
    };
    record.into_words()
}

/// The first lane of a condition, as 1 or 0.
fn flag<W: Words>(condition: W) -> i64 {
    i64::from(condition.signs() & 1)
}

/// The first lane of words.
fn first<W: Words>(words: W) -> i64 {
    i64::from(words.to_array()[0])
}

//! Pipeline: wires the units, the only file that knows their order.
//!
//! ```text
//! splats ─► project ─► ellipse ─► raster ─► gauss ─► fragment ─► resolve ─► frame
//!           └──── "setup" ────┘                        └► shade ◄┘
//! ```
//! The simulator draws tile by tile, whatever order the modelled machine has: a pixel's result depends on nothing but the
//! order of its own contributions, which is the order of the splats. Tiles and blocks of splats are shared out to threads.
//!
//! Law: `threads_and_watchers_change_no_bit`.

use crate::frame::{Each, Ellipsoids, Frame, Orientation, Splat, View};
use crate::host::{Host, Plainly, Vectorised, Work, plainly, vectorised};
use crate::machine::Elaborated;
use crate::num::{Fit, LANES, Lanes, Table, Words, three, two};
use crate::probe::told::Told;
use crate::probe::{Meters, PROJECTED, Probe, Ranges, SET_UP, Tap, Unwatched, Watcher, Weighed};
use crate::units::ellipse::ellipsoid::Axes;
use crate::units::fragment::sheets;
use crate::units::fragment::{
    self, Attributes, Contribution, Decision, Lane, NORMAL, OPACITY, Outcomes, Premultiplied, SUMS, Slot, TILE_AREA, TILE_PX, Tile, WEIGHT,
};
use crate::units::resolve::Layer;
use crate::units::{ellipse, project, raster, shade};
use crate::work::{Bins, Recorder, Work as Recorded};
use rayon::prelude::*;

/// Splats that were not drawn, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Culled {
    /// At or before the near plane.
    pub near: u64,
    /// Outside the guard band, or the box misses the picture.
    pub outside: u64,
    /// Nothing to see.
    pub faint: u64,
    /// Faces away.
    pub backface: u64,
}

impl Culled {
    fn absorb(&mut self, other: &Culled) {
        self.near += other.near;
        self.outside += other.outside;
        self.faint += other.faint;
        self.backface += other.backface;
    }
}

/// A finished frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Drawing {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// RGBA words (`resolve.frame`), row-major, row 0 on top.
    pub frame: Vec<[u32; 4]>,
    /// Whether the pixel has a fragment.
    pub covered: Vec<bool>,
    /// Splats that were not drawn.
    pub culled: Culled,
    /// What became of the contributions.
    pub outcomes: Outcomes,
}

/// A splat that has been set up: what waits in memory between setup and raster.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Prepared {
    raster: raster::Input,
    amplitude: i32,
    attributes: Attributes,
    material: u32,
    splat: u32,
}

/// Splats set up, and those that fell out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Setup {
    /// In input order, block by block: joining them would copy every splat once more.
    blocks: Vec<Vec<Prepared>>,
    /// In which order they are drawn; empty: as they lie there.
    order: Vec<u32>,
    /// Not drawn.
    pub culled: Culled,
}

/// Draws a frame.
pub fn draw<P: Probe>(machine: &Elaborated, frame: &Frame, probe: &mut P) -> Drawing {
    let setup = set_up(machine, frame, probe);
    fill(machine, frame, &setup, probe)
}

/// Draws a frame with nobody watching. Compiled here, once; what is generic is compiled again by each crate that calls it.
pub fn draw_unwatched(machine: &Elaborated, frame: &Frame) -> Drawing {
    fill_unwatched(machine, frame, &set_up_unwatched(machine, frame))
}

/// [`set_up`] with nobody watching.
pub fn set_up_unwatched(machine: &Elaborated, frame: &Frame) -> Setup {
    set_up(machine, frame, &mut Unwatched)
}

/// [`fill`] with nobody watching.
pub fn fill_unwatched(machine: &Elaborated, frame: &Frame, setup: &Setup) -> Drawing {
    fill(machine, frame, setup, &mut Unwatched)
}

/// [`set_up`], metered.
pub fn set_up_metered(machine: &Elaborated, frame: &Frame, meters: &mut Meters) -> Setup {
    set_up(machine, frame, meters)
}

/// [`fill`], metered.
pub fn fill_metered(machine: &Elaborated, frame: &Frame, setup: &Setup, meters: &mut Meters) -> Drawing {
    fill(machine, frame, setup, meters)
}

/// Draws a frame and records the work.
pub fn draw_recorded(machine: &Elaborated, frame: &Frame) -> (Drawing, Recorded) {
    let mut recorder = Recorder::default();
    let setup = set_up_recorded(machine, frame, &mut recorder);
    let drawing = fill_recorded(machine, frame, &setup, &mut recorder);
    (drawing, recorder.work(frame.width, frame.height))
}

/// [`set_up`], recorded.
pub fn set_up_recorded(machine: &Elaborated, frame: &Frame, recorder: &mut Recorder) -> Setup {
    set_up(machine, frame, recorder)
}

/// [`fill`], recorded.
pub fn fill_recorded(machine: &Elaborated, frame: &Frame, setup: &Setup, recorder: &mut Recorder) -> Drawing {
    fill(machine, frame, setup, recorder)
}

/// Draws a frame and tells a watcher every decision, tile by tile.
pub fn draw_decided<'w>(machine: &Elaborated, frame: &Frame, watcher: &mut dyn Watcher<'w>) -> Drawing {
    draw(machine, frame, &mut Told::<false>::new(watcher))
}

/// Draws a frame and tells a watcher everything, transfer by transfer.
pub fn draw_told<'w>(machine: &Elaborated, frame: &Frame, watcher: &mut dyn Watcher<'w>) -> Drawing {
    let setup = set_up_told(machine, frame, watcher);
    fill_told(machine, frame, &setup, watcher)
}

/// [`set_up`], telling a watcher everything.
pub fn set_up_told<'w>(machine: &Elaborated, frame: &Frame, watcher: &mut dyn Watcher<'w>) -> Setup {
    set_up(machine, frame, &mut Told::<true>::new(watcher))
}

/// [`fill`], telling a watcher everything.
pub fn fill_told<'w>(machine: &Elaborated, frame: &Frame, setup: &Setup, watcher: &mut dyn Watcher<'w>) -> Drawing {
    fill(machine, frame, setup, &mut Told::<true>::new(watcher))
}

/// Draws a frame and tells the range of every signal.
pub fn draw_ranged(machine: &Elaborated, frame: &Frame) -> (Drawing, Ranges) {
    let mut meters = Meters::new(machine);
    let setup = set_up_metered(machine, frame, &mut meters);
    let drawing = fill_metered(machine, frame, &setup, &mut meters);
    (drawing, meters.ranges())
}

/// Does a probe's work: the branch that is not taken is not compiled either.
fn worked<P: Probe, W: Work>(work: W) -> W::Output {
    if P::QUICK { vectorised(work) } else { plainly(work) }
}

/// Splats that one thread sets up at a time.
const BLOCK_SPLATS: usize = 8192;

/// The first half: project and ellipse.
pub fn set_up<P: Probe>(machine: &Elaborated, frame: &Frame, probe: &mut P) -> Setup {
    let blocks: Vec<(Setup, P)> = frame
        .splats
        .par_chunks(BLOCK_SPLATS)
        .enumerate()
        .map(|(block, splats)| {
            let mut fork = probe.fork();
            let (first, of) = ((block * BLOCK_SPLATS) as u32, frame.splats.len());
            let setup = match &frame.ellipsoids {
                None => worked::<P, _>(SetUp { machine, frame, splats, first, of, probe: &mut fork }),
                Some(ellipsoids) => plainly(SetUpEllipsoids { machine, frame, ellipsoids, splats, first, of, probe: &mut fork }),
            };
            (setup, fork)
        })
        .collect();
    let mut whole = Setup::default();
    for (part, fork) in blocks {
        whole.blocks.extend(part.blocks);
        whole.culled.absorb(&part.culled);
        probe.absorb(fork);
    }
    if let (true, Some(ellipsoids)) = (P::WORK, &frame.ellipsoids) {
        probe.ellipsoids(ellipsoids.preshaded, ellipsoids.own.is_empty());
    }
    if let (Some(sort), true) = (&machine.sort, frame.ellipsoids.as_ref().is_some_and(|ellipsoids| ellipsoids.sorted)) {
        whole.sort(sort, probe);
    }
    whole
}

impl Setup {
    /// Brings the splats into the order of their keys, those with equal keys in that of their numbers.
    fn sort<P: Probe>(&mut self, key: &Fit, probe: &mut P) {
        let tap = &mut Tap::new(&mut *probe);
        let keyed = self.entries().zip(0..).map(|((entry, splat), nth)| (tap.fit_one(key, i64::from(splat.raster.depth)), nth, entry));
        let mut order: Vec<(i64, u32, u32)> = keyed.collect();
        if let Some(ranges) = probe.again(0, 1) {
            let tap = &mut Tap::new(ranges);
            for (_, splat) in self.entries() {
                tap.fit_one(key, i64::from(splat.raster.depth));
            }
        }
        order.sort_unstable();
        if P::WORK || P::TRANSFERS {
            probe.sorted(order.iter().map(|(_, nth, _)| *nth).collect());
        }
        self.order = order.into_iter().map(|(.., entry)| entry).collect();
    }

    /// Splats that are left.
    pub fn splats(&self) -> usize {
        self.blocks.iter().map(Vec::len).sum()
    }

    /// The splat of a bin's entry.
    #[inline(always)]
    fn splat(&self, entry: u32) -> &Prepared {
        &self.blocks[entry as usize / BLOCK_SPLATS][entry as usize % BLOCK_SPLATS]
    }

    /// Every splat in the order in which they are drawn, with what a bin calls it.
    fn entries(&self) -> impl Iterator<Item = (u32, &Prepared)> + Clone {
        let numbered = |(block, splats): (usize, &'_ Vec<Prepared>)| (block * BLOCK_SPLATS, splats.len());
        let sorted = self.order.iter().copied();
        let blocks = if self.order.is_empty() { &self.blocks[..] } else { &[] };
        let numbers = blocks.iter().enumerate().map(numbered).flat_map(|(first, count)| first..first + count);
        sorted.chain(numbers.map(|number| number as u32)).map(|number| (number, self.splat(number)))
    }
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

/// Sets eight splats up once more, for another to hear.
#[inline(never)]
fn set_up_again(machine: &Elaborated, frame: &Frame, splats: &[Splat], first: u32, probe: &mut Ranges) {
    plainly(SetUp { machine, frame, splats, first, of: splats.len(), probe });
}

impl<P: Probe> Work for SetUp<'_, P> {
    type Output = Setup;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Setup {
        // Copies that nobody else can see: their constants are broadcast to lanes once, outside the loop.
        let (project, ellipse, view) = (self.machine.project.clone(), self.machine.ellipse.clone(), self.frame.view.clone());
        let units = Units { project: &project, ellipse: &ellipse, view: &view, size_px: [self.frame.width, self.frame.height] };
        let mut out = Block { prepared: vec![Prepared::default(); self.splats.len()], count: 0, culled: Culled::default() };
        if P::TRANSFERS {
            for (splat, first) in self.splats.iter().zip(self.first..) {
                units.set_up::<L::Words, P>(&[*splat; LANES], 1, first, self.probe, &mut out);
            }
            return out.done();
        }
        let (eights, rest) = self.splats.as_chunks();
        let mut last = [Splat::default(); LANES];
        last[..rest.len()].copy_from_slice(rest);
        for (group, splats) in eights.iter().chain((!rest.is_empty()).then_some(&last)).enumerate() {
            let live = LANES.min(self.splats.len() - group * LANES);
            let first = self.first + (group * LANES) as u32;
            units.set_up::<L::Words, P>(splats, live, first, self.probe, &mut out);
            if let Some(ranges) = self.probe.again(first as usize / LANES, self.of.div_ceil(LANES)) {
                set_up_again(self.machine, self.frame, &splats[..live], first, ranges);
            }
        }
        out.done()
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

impl<P: Probe> Work for SetUpEllipsoids<'_, P> {
    type Output = Setup;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Setup {
        let Frame { view, width, height, .. } = self.frame;
        let units = Units { project: &self.machine.project, ellipse: &self.machine.ellipse, view, size_px: [*width, *height] };
        let lit = self.ellipsoids.preshaded.then(|| Lit::new(self.machine, self.frame));
        let mut out = Block { prepared: vec![Prepared::default(); self.splats.len()], count: 0, culled: Culled::default() };
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
            if let Some(ranges) = self.probe.again(first as usize / LANES, self.of.div_ceil(LANES)) {
                set_up_ellipsoids_again(self.machine, self.frame, self.ellipsoids, splats, first, ranges);
            }
        }
        out.done()
    }
}

/// Sets eight ellipsoids up once more, for another to hear.
#[inline(never)]
fn set_up_ellipsoids_again(machine: &Elaborated, frame: &Frame, ellipsoids: &Ellipsoids, splats: &[Splat], first: u32, probe: &mut Ranges) {
    plainly(SetUpEllipsoids { machine, frame, ellipsoids, splats, first, of: splats.len(), probe });
}

/// The lights and materials of a frame, for splats that are lit before they are drawn.
struct Lit<'a> {
    machine: &'a Elaborated,
    frame: &'a Frame,
    highlights: Vec<Option<Table>>,
}

impl<'a> Lit<'a> {
    fn new(machine: &'a Elaborated, frame: &'a Frame) -> Self {
        Lit { machine, frame, highlights: machine.shade.highlights(&frame.lighting) }
    }

    /// The port from setup to shade: the light that one splat sends.
    #[inline(never)]
    fn emission<P: Probe>(&self, splat: &Splat, number: u32, normal: [i32; 3], probe: &mut P) -> [i32; 3] {
        let tap = &mut Tap::new(probe);
        let lights = shade::Registers::of(self.frame, &self.highlights);
        let input = emitting(self.machine, splat.rgb, normal, splat.material, tap);
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

/// A splat as shade is given it, where it is lit before it is drawn.
pub(crate) fn emitting<P: Probe>(machine: &Elaborated, rgb: [i32; 3], normal: [i32; 3], material: u32, tap: &mut Tap<P>) -> shade::Input {
    input_of(&machine.fragment.emitting(rgb, normal, material, tap))
}

/// The light of a splat, in the words of its colour.
pub(crate) fn emitted<P: Probe>(machine: &Elaborated, light: [i64; 3], tap: &mut Tap<P>) -> [i32; 3] {
    three!(channel => tap.fit_one(&machine.emission, light[channel]) as i32)
}

/// What sets splats up.
struct Units<'a> {
    project: &'a project::Project,
    ellipse: &'a ellipse::Ellipse,
    view: &'a View,
    size_px: [u32; 2],
}

/// A block's splats, set up: the first `count` so far.
struct Block {
    prepared: Vec<Prepared>,
    count: usize,
    culled: Culled,
}

impl Block {
    fn done(mut self) -> Setup {
        self.prepared.truncate(self.count);
        Setup { blocks: vec![self.prepared], order: Vec::new(), culled: self.culled }
    }
}

impl Units<'_> {
    /// Sets eight splats up, of which the first `live` are there.
    #[inline(always)]
    fn set_up<W: Words, P: Probe>(&self, splats: &[Splat; LANES], live: usize, first: u32, probe: &mut P, out: &mut Block) {
        let tap = &mut Tap::new(probe).first(live);

        let (point, input) = self.placed::<W, P>(splats, tap);
        let ellipse = self.ellipse.lanes(self.view, self.size_px, &input, tap);
        self.keep::<W, P>(splats, live, first, (&point, &ellipse), None, tap, out);
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
        let (point, input) = self.placed::<W, P>(splats, tap);
        let word = |of: &dyn Fn(usize) -> i32| W::from_array(std::array::from_fn(of));
        let axes = if ellipsoids.own.is_empty() {
            Axes::Frame
        } else {
            let [w, x, y, z] = [0, 1, 2, 3].map(|part| word(&|lane| own[lane].quaternion[part]));
            Axes::Own([w, x, y, z], three!(axis => word(&|lane| own[lane].scales[axis])))
        };
        let opacity = word(&|lane| splats[lane].opacity);
        let set_up = self.ellipse.ellipsoids(self.view, &ellipsoids.kernel, self.size_px, &input, axes, opacity, tap);
        // Elaboration has seen to it that there is one.
        if let Some(ellipse) = set_up {
            self.keep::<W, P>(splats, live, first, (&point, &ellipse), lit, tap, out);
        }
    }

    /// The first half of setup, and what the second is given.
    #[inline(always)]
    fn placed<W: Words, P: Probe>(&self, splats: &[Splat; LANES], tap: &mut Tap<P>) -> (project::Projected<W>, ellipse::Input<W>) {
        // The first eight words of each record as they lie in memory: red comes along.
        let mut records = [W::splat(0); LANES];
        for (record, splat) in records.iter_mut().zip(splats) {
            let Splat { position: [x, y, z], normal: [n, m, o], radius, rgb: [red, ..], .. } = *splat;
            *record = W::from_array([x, y, z, n, m, o, radius, red]);
        }
        let [x, y, z, n, m, o, radius, _] = W::transposed(records);
        let point = self.project.lanes(self.view, [x, y, z], tap);
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

    /// Keeps those of eight splats that are not culled.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "what setup knows of a splat")]
    fn keep<W: Words, P: Probe>(
        &self,
        splats: &[Splat; LANES],
        live: usize,
        first: u32,
        (point, ellipse): (&project::Projected<W>, &ellipse::Output<W>),
        lit: Option<&Lit>,
        tap: &mut Tap<P>,
        out: &mut Block,
    ) {
        if P::TRANSFERS {
            tap.probe.set_up(first, projected_words(point), ellipse_words(ellipse));
        }
        let mut left = ((1u32 << live) - 1) as u8;
        let culled = point.near | point.outside | ellipse.backface | ellipse.faint | ellipse.outside;
        if left & culled.signs() != 0 {
            // In the order in which the units find them: the first that holds is the reason.
            let reasons = [point.near, point.outside, ellipse.backface, ellipse.faint, ellipse.outside];
            let mut lanes = [0; 5];
            for (lanes, reason) in lanes.iter_mut().zip(reasons) {
                *lanes = left & reason.signs();
                left &= !*lanes;
            }
            if P::WORK {
                tap.probe.culled(first, lanes);
            }
            let [near, outside, backface, faint, missing] = lanes.map(|lanes| u64::from(lanes.count_ones()));
            out.culled.absorb(&Culled { near, outside: outside + missing, faint, backface });
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
            let [r, g, b] = lit.map_or(own.rgb, |lit| lit.emission(own, first + lane as u32, [n, m, o], tap.probe));
            if P::WORK {
                tap.probe.drawn(first + lane as u32, [halves(columns), halves(rows)]);
            }
            out.prepared[out.count] = Prepared {
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
                attributes: [1, r, g, b, own.opacity, n, m, o],
                material: own.material,
                splat: first + lane as u32,
            };
            out.count += 1;
        }
    }
}

/// The first lane of what `project` makes, as a record has it.
pub(crate) fn projected_words<W: Words>(point: &project::Projected<W>) -> [i64; PROJECTED] {
    let inverse = point.inverse_depth;
    let ([a, b], [x, y]) = (point.slope, point.pixel);
    let words = [point.camera[2], point.exponent, point.depth, inverse.mantissa, inverse.exponent, a, b, x, y];
    record([point.near, point.outside], words)
}

/// The first lane of what `ellipse` makes, as a record has it.
pub(crate) fn ellipse_words<W: Words>(e: &ellipse::Output<W>) -> [i64; SET_UP] {
    let ([n, m, o], [xx, xy, yy], [z_x, z_y]) = (e.normal, e.conic, e.depth_slope);
    let ([left, right], [top, bottom]) = (e.columns, e.rows);
    record([e.backface, e.faint, e.outside], [n, m, o, xx, xy, yy, e.amplitude, left, right, top, bottom, z_x, z_y, e.depth_range])
}

/// The first lane of conditions, as 1 or 0, and of words.
fn record<W: Words, const FLAGS: usize, const WORDS: usize, const ALL: usize>(flags: [W; FLAGS], words: [W; WORDS]) -> [i64; ALL] {
    let flags = flags.map(|flag| i64::from(flag.signs() & 1));
    let words = words.map(|word| i64::from(word.to_array()[0]));
    std::array::from_fn(|i| if i < FLAGS { flags[i] } else { words[i - FLAGS] })
}

/// The low and the high half of a word.
#[inline(always)]
fn halves(word: i32) -> [u16; 2] {
    let [a, b, c, d] = word.to_le_bytes();
    [u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d])]
}

/// The second half: raster, gauss, fragment, shade and resolve.
pub fn fill<P: Probe>(machine: &Elaborated, frame: &Frame, setup: &Setup, probe: &mut P) -> Drawing {
    let (true, Some(host)) = (P::QUICK, Vectorised::there()) else {
        return fill_as::<false, i64, P>(Plainly, machine, frame, setup, probe);
    };
    // Paths of their own for what is common: each is compiled once more for every probe.
    let plain = machine.gauss.is_plain() && machine.fragment.is_plain();
    match (plain, machine.fragment.is_narrow()) {
        (true, true) => fill_as::<true, i32, P>(host, machine, frame, setup, probe),
        (true, false) => fill_as::<true, i64, P>(host, machine, frame, setup, probe),
        (false, _) => fill_as::<false, i64, P>(host, machine, frame, setup, probe),
    }
}

fn fill_as<const PLAIN: bool, L: Lane, P: Probe>(
    host: impl Host,
    machine: &Elaborated,
    frame: &Frame,
    setup: &Setup,
    probe: &mut P,
) -> Drawing {
    let highlights = machine.shade.highlights(&frame.lighting);
    let lights = shade::Registers::of(frame, &highlights);
    let registers = fragment::Registers { z_threshold: frame.z_threshold, coverage_threshold: frame.coverage_threshold };
    let sheets = frame.sheets.as_ref().map(|sheets| machine.fragment.sheets(sheets));
    let bins = bins(frame, setup);
    let touched: Vec<usize> = (0..bins.tiles()).filter(|&tile| !bins.of(tile).is_empty()).collect();
    // One tile's fragments at a time, and one watcher, for every run of tiles that a thread takes.
    let start = || Run { tile: Box::<Tile<L>>::default(), probe: probe.fork(), done: Vec::new() };
    let draw_tile = |mut run: Run<L, P>, (nth, &index): (usize, &usize)| {
        let shared = Shared { machine, frame, lights: &lights, setup, registers, sheets: sheets.as_ref() };
        let part =
            Part { splats: bins.of(index), corner: [(index % bins.columns * TILE_PX) as u16, (index / bins.columns * TILE_PX) as u16] };
        let resolved = host.run(FillTile::<PLAIN, _, L, P> { host, shared, part, tile: &mut run.tile, probe: &mut run.probe });
        if let Some(ranges) = run.probe.again(nth, touched.len()) {
            fill_again(shared, part, ranges);
        }
        if P::DECISIONS || P::WORK {
            let [x, y] = resolved.corner.map(u32::from);
            run.probe.tile(x, y);
        }
        run.done.push(resolved);
        run
    };
    let finish = |run: Run<L, P>| (run.done, run.probe);
    let runs: Vec<(Vec<Resolved>, P)> = touched.par_iter().enumerate().fold(start, draw_tile).map(finish).collect();
    let background = machine.resolve.one(&[], frame.background, &mut Tap::new(probe)).map(|word| word as u32);
    if let Some(ranges) = probe.again(0, 1) {
        machine.resolve.one(&[], frame.background, &mut Tap::new(ranges));
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

/// Some tiles, one after the other.
struct Run<L, P> {
    tile: Box<Tile<L>>,
    probe: P,
    done: Vec<Resolved>,
}

/// Which splats touch which tile. A call of its own, so that its instructions can be counted.
#[inline(never)]
fn bins(frame: &Frame, setup: &Setup) -> Bins {
    let boxes = setup.entries().map(|(entry, splat)| (entry, [splat.raster.columns, splat.raster.rows]));
    Bins::new([frame.width, frame.height], TILE_PX, boxes)
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

/// What all tiles need.
#[derive(Clone, Copy)]
struct Shared<'a> {
    machine: &'a Elaborated,
    frame: &'a Frame,
    lights: &'a shade::Registers<'a>,
    setup: &'a Setup,
    registers: fragment::Registers,
    sheets: Option<&'a sheets::Registers<'a>>,
}

/// A tile, and the entries that touch it.
#[derive(Clone, Copy)]
struct Part<'a> {
    splats: &'a [u32],
    corner: [u16; 2],
}

impl Part<'_> {
    /// Column and row in the picture of one of the tile's pixels.
    fn pixel(&self, pixel: u8) -> [u32; 2] {
        let pixel = u32::from(pixel);
        [u32::from(self.corner[0]) + pixel % TILE_PX as u32, u32::from(self.corner[1]) + pixel / TILE_PX as u32]
    }
}

struct FillTile<'a, const PLAIN: bool, H, L, P> {
    host: H,
    shared: Shared<'a>,
    part: Part<'a>,
    tile: &'a mut Tile<L>,
    probe: &'a mut P,
}

/// Draws a tile once more, for another to hear.
#[inline(never)]
fn fill_again(shared: Shared, part: Part, probe: &mut Ranges) {
    plainly(FillTile::<false, Plainly, i64, Ranges> { host: Plainly, shared, part, tile: &mut Box::default(), probe });
}

impl<const PLAIN: bool, H: Host, L: Lane, P: Probe> Work for FillTile<'_, PLAIN, H, L, P> {
    type Output = Resolved;

    #[inline(always)]
    fn run<AnyLanes: Lanes>(mut self) -> Resolved {
        self.tile.clear();
        let mut outcomes = Outcomes::default();
        let mut span = raster::Span::default();
        for splats in self.part.splats.chunks(Self::AT_A_TIME) {
            self.splats::<AnyLanes>(splats, &mut span, &mut outcomes);
        }
        self.resolve(outcomes)
    }
}

impl<const PLAIN: bool, H: Host, L: Lane, P: Probe> FillTile<'_, PLAIN, H, L, P> {
    /// Splats, and fragments, that are worked on side by side.
    const AT_A_TIME: usize = if P::TRANSFERS { 1 } else { LANES };

    /// Raster, gauss and fragment: up to eight splats, as far as they lie in the tile.
    #[inline(always)]
    fn splats<V: Lanes>(&mut self, splats: &[u32], span: &mut raster::Span, outcomes: &mut Outcomes) {
        let Shared { machine, frame, setup, .. } = self.shared;
        let size_px = [frame.width, frame.height];
        let cutoff = machine.raster.cutoff(frame.view.cutoff);
        // Beyond the last splat, the last again: a lane that nobody looks at.
        let prepared: [&Prepared; LANES] = std::array::from_fn(|lane| setup.splat(splats[lane.min(splats.len() - 1)]));
        let inputs = prepared.map(|splat| &splat.raster);
        let tap = &mut Tap::new(&mut *self.probe).first(splats.len());
        let walks = machine.raster.enter::<V, P>(size_px, self.part.corner, &inputs, tap);
        for lane in 0..splats.len().min(LANES) {
            let tap = &mut Tap::new(&mut *self.probe);
            machine.raster.span::<V, P>(size_px, &walks, lane, inputs[lane], cutoff, span, tap);
            if P::WORK {
                let (rows, left) = walks.part(lane);
                tap.probe.span(rows, left, span.all());
            }
            if P::TRANSFERS {
                tap.probe.walked(prepared[lane].splat);
            }
            let mut first = 0;
            while first < span.fragments() {
                self.contribute::<V>(prepared[lane], (&walks, lane), span, first, outcomes);
                first += Self::AT_A_TIME;
            }
        }
    }

    /// Gauss and fragment: up to eight of a span's fragments.
    #[inline(always)]
    fn contribute<V: Lanes>(
        &mut self,
        prepared: &Prepared,
        (walks, lane): (&raster::Walks, usize),
        span: &raster::Span,
        first: usize,
        outcomes: &mut Outcomes,
    ) {
        let Shared { machine, lights, registers, sheets, .. } = self.shared;
        let tile = &mut *self.tile;
        let count = (span.fragments() - first).min(Self::AT_A_TIME);
        let tap = &mut Tap::new(&mut *self.probe).first(count);
        let places = span.places(first);
        let [radial, depth] = machine.raster.fragments::<V>(walks, lane, span, places);
        let [radial_index, weight] = machine.gauss.lanes::<PLAIN, V, P>(radial, i64::from(prepared.amplitude), tap);
        let pixels = walks.pixels(lane, places);
        if P::TRANSFERS {
            let [x, y] = self.part.pixel(pixels[0]);
            let splat = prepared.splat;
            let [radial, depth, weight] = [radial, depth, weight].map(|lanes| lanes.to_array()[0]);
            tap.probe.weighed(x, y, &Weighed { splat, radial, depth, weight });
        }
        // A weight that rounds to 0 makes no fragment: its depth is nobody's.
        if P::WORDS {
            tap.live &= weight.above(V::splat(0)).signs();
        }
        let least = sheets.map_or(1, |registers| registers.sheets.least_weight.max(1));
        let (radial_index, weight) = (radial_index.to_array(), weight.to_array());
        let depth = machine.fragment.depth::<PLAIN, V, P>(depth, tap).to_array();
        let shade = move |slot: &Slot, tap: &mut Tap<P>| shade_for_merge(machine, lights, slot, tap);
        for lane in 0..count {
            if weight[lane] < least {
                if P::WORK {
                    tap.probe.became(None);
                }
                continue;
            }
            let pixel = pixels[lane];
            let decision = match sheets {
                None => machine.fragment.contribute::<PLAIN, V, L, P>(
                    tile,
                    pixel,
                    [weight[lane], depth[lane]],
                    &prepared.attributes,
                    &prepared.material,
                    &registers,
                    &shade,
                    tap,
                ),
                // A call of its own, so that surfaces pay nothing for it.
                Some(registers) => {
                    self.host.run(ToSheet::<PLAIN, L, P> { machine, tile, pixel, weight: weight[lane], prepared, registers, tap })
                }
            };
            // Most are accumulated: those are what is left of the contributions in the end.
            if !matches!(decision, Decision::Accumulated(_)) {
                outcomes.count(decision);
            }
            if P::WORK {
                // A Gaussian that is blended at once takes no longer than one that is added.
                let at_once = sheets.is_some_and(|registers| registers.sheets.each == Each::Splat) && decision == Decision::Merged(0, 1);
                tap.probe.became(Some(if at_once { Decision::Replaced } else { decision }));
            }
            if P::DECISIONS {
                let [x, y] = self.part.pixel(pixel);
                let contribution =
                    Contribution { splat: prepared.splat, radial_index: radial_index[lane], weight: weight[lane], depth: depth[lane] };
                tap.probe.contribution(x, y, &contribution, decision);
            }
        }
    }

    /// Shade and resolve: every pixel of the tile. A call of its own, so that its instructions can be counted.
    #[inline(never)]
    fn resolve(self, mut outcomes: Outcomes) -> Resolved {
        let (Shared { machine, frame, lights, sheets, .. }, corner) = (self.shared, self.part.corner);
        let mut resolved = Resolved { corner, frame: [[0; 4]; TILE_AREA], covered: [false; TILE_AREA], outcomes };
        let tap = &mut Tap::new(&mut *self.probe);
        let mut layers = [Layer::default(); fragment::MAX_LAYERS];
        let mut all = 0;
        for pixel in 0..TILE_AREA {
            let at = pixel as u8;
            let live = self.tile.live(at);
            let [x, y] = self.part.pixel(at);
            if x >= frame.width || y >= frame.height {
                if P::WORK {
                    tap.probe.held(0, 0);
                }
                continue;
            }
            let live = match sheets {
                None => {
                    for (slot, layer) in layers[..live].iter_mut().enumerate() {
                        *layer = lit_layer(machine, lights, slot, &self.tile.slot(at, slot), tap);
                    }
                    live
                }
                Some(registers) => {
                    let composite = machine.fragment.composite(self.tile, at, registers, tap);
                    layers[0] = composite.map_or(Layer::default(), |Premultiplied { colour, opacity }| Layer {
                        merged: true,
                        colour,
                        opacity,
                        ..Layer::default()
                    });
                    usize::from(composite.is_some())
                }
            };
            if P::WORK {
                tap.probe.held(live as u8, layers[..live].iter().filter(|layer| !layer.merged).count() as u8);
            }
            if P::TRANSFERS {
                // Of sheets the open one too, which is no layer yet.
                let open = sheets.is_some_and(|registers| registers.sheets.each == Each::Slice);
                let held = if open { self.tile.live(at) } else { live };
                let slots: Vec<Slot> = (0..held).map(|slot| self.tile.slot(at, slot)).collect();
                tap.probe.holds(x, y, &slots, &layers[..live]);
            }
            layers[..live].sort_by_key(|layer| layer.depth);
            let word = machine.resolve.one(&layers[..live], frame.background, tap);
            if P::DECISIONS {
                tap.probe.resolved(x, y, &layers[..live], word);
            }
            resolved.frame[pixel] = word.map(|channel| channel as u32);
            resolved.covered[pixel] = live > 0;
            let contributions = u64::from(self.tile.contributions(at));
            all += contributions;
            outcomes.most_in_a_pixel = outcomes.most_in_a_pixel.max(contributions);
        }
        outcomes.accumulated = all - outcomes.total();
        Resolved { outcomes, ..resolved }
    }
}

/// One contribution to a sheet.
struct ToSheet<'a, 'p, const PLAIN: bool, L, P> {
    machine: &'a Elaborated,
    tile: &'a mut Tile<L>,
    pixel: u8,
    weight: i64,
    prepared: &'a Prepared,
    registers: &'a sheets::Registers<'a>,
    tap: &'a mut Tap<'p, P>,
}

impl<const PLAIN: bool, L: Lane, P: Probe> Work for ToSheet<'_, '_, PLAIN, L, P> {
    type Output = Decision;

    #[inline(always)]
    fn run<V: Lanes>(self) -> Decision {
        let ToSheet { machine, tile, pixel, weight, prepared, registers, tap } = self;
        let splat = prepared.splat;
        let sheet = match registers.sheets.each {
            Each::Splat => splat,
            Each::Slice => registers.sheets.numbers.get(splat as usize).copied().unwrap_or_default(),
        };
        machine.fragment.contribute_to_sheet::<PLAIN, V, L, P>(tile, pixel, sheet, weight, &prepared.attributes, registers, tap)
    }
}

/// The port from fragment to shade. A call of its own, so that its instructions can be told from those of fragment.
#[inline(never)]
fn shade_for_merge<P: Probe>(machine: &Elaborated, lights: &shade::Registers, slot: &Slot, tap: &mut Tap<P>) -> Premultiplied {
    if P::WORK {
        tap.probe.shaded();
    }
    shade_slot(machine, lights, slot, tap)
}

/// The port from fragment, and from resolve, to shade.
fn shade_slot<P: Probe>(machine: &Elaborated, lights: &shade::Registers, slot: &Slot, tap: &mut Tap<P>) -> Premultiplied {
    let input = input_of(slot);
    if P::TRANSFERS {
        tap.probe.shade_in();
    }
    let output = machine.shade.one(lights, &input, tap);
    if P::TRANSFERS {
        tap.probe.shade_out(&input, &output);
    }
    let shade::Output { colour, opacity } = output;
    Premultiplied { colour, opacity }
}

/// A fragment as shade is given it.
fn input_of(slot: &Slot) -> shade::Input {
    let s: &[i64; SUMS] = &slot.sums;
    shade::Input {
        weight: s[WEIGHT],
        colour: [s[1], s[2], s[3]],
        opacity: s[OPACITY],
        normal: [s[NORMAL], s[NORMAL + 1], s[NORMAL + 2]],
        material: slot.material,
    }
}

fn lit_layer<P: Probe>(machine: &Elaborated, lights: &shade::Registers, slot: usize, fragment: &Slot, tap: &mut Tap<P>) -> Layer {
    let Premultiplied { colour, opacity } =
        if fragment.shaded { machine.fragment.shaded(fragment, tap) } else { shade_slot(machine, lights, fragment, tap) };
    let weight = if fragment.shaded { 0 } else { fragment.sums[WEIGHT] };
    Layer { slot, depth: fragment.depth, weight, merged: fragment.shaded, colour, opacity }
}

pub mod real;

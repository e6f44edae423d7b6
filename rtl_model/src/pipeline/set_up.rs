//! Set up: the first half of the pipeline, the graphs of project and ellipse over batches of
//! splats.

use super::discs::Discs;
use super::lists::{Drawn, ListShape, after, merged};
use super::shading::{EmitEight, emitted, emitting};
use super::{Culled, Elaborated, run};
use crate::frame::{Ellipsoids, Frame, KeptLists, Orientation, Splat};
use crate::functions::Table;
use crate::graph::{BATCH, Batch, Program, ROWS, Run};
use crate::kernels::host::{Host, Kernel, Vectorised};
use crate::machine::SortKind;
use crate::num::{Fit, LANES, Lanes, Words, three, two};
use crate::probe::{Probe, Tap};
use crate::records::{EllipseOut, PROJECTED, ProjectOut, SET_UP, TILE_PX};
use crate::units::colour::{Colour, coefficients};
use crate::units::ellipse::Ellipse;
use crate::units::fragment::window::WindowRegisters;
use crate::units::{ellipse, project, raster, shade};
use crate::work::{Bins, CULLED, MergedLists, TestedWords};
use rayon::prelude::*;

/// A splat that has been set up: what setup adds to the splat's own words, and waits in memory
/// before raster. One line of the host's cache.
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
    /// Their boxes, first and last column, first and last row, once more and close together:
    /// whoever bins them wants nothing else.
    boxes: Vec<Vec<[[u16; 2]; 2]>>,
    /// What they send, block by block, where splats are lit before they are drawn; else none.
    emissions: Vec<Vec<Emission>>,
    /// Their colours, block by block, where the machine evaluates harmonics; else none.
    colours: Vec<Vec<[i32; 3]>>,
    /// In which order they are drawn; empty: as they lie there.
    order: Vec<u32>,
    /// The lists of tiles and the boxes behind them, on a machine that keeps lists; else none.
    /// Each list has an order of its own.
    lists: Option<Lists>,
    /// Not drawn.
    pub culled: Culled,
}

/// Lists of a frame on a machine that keeps them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Lists {
    merged: MergedLists,
    /// The drawn splats of the frame.
    drawn: Vec<Drawn>,
    /// What a bin calls each splat of the frame; [`u32::MAX`] if it was culled.
    entries: Vec<u32>,
}

impl Setup {
    /// Merges the lists of the frame before with the splats that are new in each tile.
    fn merge_lists<P: Probe>(
        &mut self,
        key: &Fit,
        (frame, shape): (&Frame, ListShape),
        probe: &mut P,
    ) {
        let mut entries = vec![u32::MAX; frame.splats.len()];
        let boxes = self.boxes.iter().flatten();
        let drawn = numbered(&self.blocks)
            .zip(boxes)
            .map(|((entry, splat), sides)| {
                entries[splat.splat as usize] = entry;
                (splat.splat, *sides, key.one(i64::from(splat.raster.depth)))
            });
        let drawn: Vec<Drawn> = drawn.collect();
        let first = KeptLists::default();
        let before = frame.lists.as_deref().unwrap_or(&first);
        let merged = merged(before, shape, [frame.width, frame.height], &drawn);
        if P::WORK {
            probe.merged(merged.clone());
        }
        self.lists = Some(Lists {
            merged,
            drawn,
            entries,
        });
    }

    /// What a machine that keeps lists has in memory after the frame, for the next one; none on
    /// other machines.
    pub fn kept_lists(&self, frame: &Frame) -> Option<KeptLists> {
        let Lists { merged, drawn, .. } = self.lists.as_ref()?;
        let first = KeptLists::default();
        let before = frame.lists.as_deref().unwrap_or(&first);
        let size_px = [frame.width, frame.height];
        Some(after(before, merged, size_px, drawn, frame.splats.len()))
    }

    /// Brings the splats into the order of their keys, the least or the greatest first; those with
    /// equal keys in the order of their numbers.
    fn sort<P: Probe>(
        &mut self,
        key: &Fit,
        (farthest_first, has_buckets): (bool, bool),
        probe: &mut P,
    ) {
        let tap = &mut Tap::new(&mut *probe);
        let keyed = numbered(&self.blocks)
            .zip(0..)
            .map(|((entry, splat), nth)| {
                (tap.fit_one(key, i64::from(splat.raster.depth)), nth, entry)
            });
        let mut order: Vec<(i64, u32, u32)> = keyed.collect();
        if let Some(ranges) = probe.resample(0, 1) {
            let tap = &mut Tap::new(ranges);
            for (_, splat) in numbered(&self.blocks) {
                tap.fit_one(key, i64::from(splat.raster.depth));
            }
        }
        if farthest_first {
            order.sort_unstable_by_key(|&(key, nth, _)| (-key, nth));
        } else {
            order.sort_unstable();
        }
        if P::WORK || P::TRANSFERS {
            // Only buckets depend on more than the order.
            let mut keys = vec![0; if has_buckets { order.len() } else { 0 }];
            order
                .iter()
                .filter(|_| has_buckets)
                .for_each(|(key, nth, _)| keys[*nth as usize] = *key as u32);
            probe.sorted(order.iter().map(|(_, nth, _)| *nth).collect(), keys);
        }
        self.order = order.into_iter().map(|(.., entry)| entry).collect();
    }

    /// Words for tests of tiles.
    fn tested(&self) -> Vec<TestedWords> {
        let splats = self.blocks.iter().flatten();
        splats
            .map(|splat| TestedWords {
                pixel: splat.raster.pixel,
                conic: splat.raster.conic,
            })
            .collect()
    }

    /// Splats that are left.
    pub fn splats(&self) -> usize {
        self.blocks.iter().map(Vec::len).sum()
    }

    /// Drawn splats by their numbers in the frame, with their boxes: first and last column, first
    /// and last row.
    pub fn boxes(&self) -> impl Iterator<Item = (u32, [[u16; 2]; 2])> {
        let splats = self.blocks.iter().flatten().map(|record| record.splat);
        splats.zip(self.boxes.iter().flatten().copied())
    }

    /// The splat of a bin's entry.
    #[inline(always)]
    pub(super) fn splat(&self, entry: u32) -> &SetupRecord {
        &self.blocks[entry as usize / BLOCK_SPLATS][entry as usize % BLOCK_SPLATS]
    }

    /// What the splat of a bin's entry sends, where splats are lit before they are drawn.
    #[inline(always)]
    pub(super) fn emission(&self, entry: u32) -> Option<Emission> {
        self.emissions
            .get(entry as usize / BLOCK_SPLATS)?
            .get(entry as usize % BLOCK_SPLATS)
            .copied()
    }

    /// The colour of a bin's splat, where the machine evaluates harmonics.
    #[inline(always)]
    pub(super) fn colour(&self, entry: u32) -> Option<[i32; 3]> {
        self.colours
            .get(entry as usize / BLOCK_SPLATS)?
            .get(entry as usize % BLOCK_SPLATS)
            .copied()
    }

    /// Which splats' boxes touch which tile, in the order in which they are drawn.
    pub(super) fn bins(&self, size_px: [u32; 2]) -> Bins {
        if let Some(lists) = &self.lists {
            let drawn = |splat: u32| {
                let entry = lists.entries[splat as usize];
                let sides = self.boxes.get(entry as usize / BLOCK_SPLATS)?;
                Some((entry, sides[entry as usize % BLOCK_SPLATS]))
            };
            return lists.merged.bins(size_px, TILE_PX, drawn);
        }
        if self.order.is_empty() {
            return Bins::new(
                size_px,
                TILE_PX,
                numbered(&self.boxes).map(|(number, sides)| (number, *sides)),
            );
        }
        let sides = |number: u32| {
            self.boxes[number as usize / BLOCK_SPLATS][number as usize % BLOCK_SPLATS]
        };
        Bins::new(
            size_px,
            TILE_PX,
            self.order.iter().map(|&number| (number, sides(number))),
        )
    }
}

/// What lies in blocks, each with what a bin calls its splat.
fn numbered<T>(blocks: &[Vec<T>]) -> impl Iterator<Item = (u32, &T)> + Clone {
    blocks
        .iter()
        .enumerate()
        .flat_map(|(block, splats)| ((block * BLOCK_SPLATS) as u32..).zip(splats))
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
            let setup = set_up_block(machine, frame, splats, (first, of), &mut fork);
            (setup, fork)
        })
        .collect();
    let mut whole = Setup::default();
    for (part, fork) in blocks {
        whole.blocks.extend(part.blocks);
        whole.boxes.extend(part.boxes);
        whole.emissions.extend(part.emissions);
        whole.colours.extend(part.colours);
        whole.culled.absorb(&part.culled);
        probe.absorb(fork);
    }
    let windows = frame.window.is_some();
    match &frame.ellipsoids {
        Some(ellipsoids) if P::WORK => {
            probe.ellipsoids(
                ellipsoids.preshaded || windows,
                ellipsoids.own.is_empty(),
                ellipsoids.harmonics,
            );
        }
        None if P::WORK && windows => probe.ellipsoids(true, false, 0),
        _ => {}
    }
    if P::WORK && frame.surroundings.is_some() {
        probe.mirrors();
    }
    if P::WORK && (machine.timing.bin.is_some() || machine.records_choices) {
        probe.tested(whole.tested(), frame.view.cutoff);
    }
    if let (Some(sort), true) = (
        &machine.sort,
        frame
            .ellipsoids
            .as_ref()
            .is_some_and(|ellipsoids| ellipsoids.sorted),
    ) {
        let has_buckets = machine.records_choices
            || (machine.machine.sort).is_some_and(|sort| {
                [SortKind::Hierarchical, SortKind::Incremental].contains(&sort.kind)
            });
        let farthest_first = (frame.sheets.as_ref()).is_some_and(|sheets| sheets.back_to_front);
        whole.sort(sort, (farthest_first, has_buckets), probe);
        if let Some(kept) = machine.machine.keeps_lists() {
            let shape = ListShape {
                tile_px: kept.tile_px,
                chunk: kept.chunk,
                farthest_first,
            };
            whole.merge_lists(sort, (frame, shape), probe);
        }
    }
    whole
}

/// Sets a block of a frame's splats up, which begins with `first`.
fn set_up_block<P: Probe>(
    machine: &Elaborated,
    frame: &Frame,
    splats: &[Splat],
    (first, of): (u32, usize),
    probe: &mut P,
) -> Setup {
    let is_lit = frame.window.is_some()
        || frame
            .ellipsoids
            .as_ref()
            .is_some_and(|ellipsoids| ellipsoids.preshaded);
    let lit = is_lit.then(|| Lit::new(machine, frame));
    let lit = lit.as_ref();
    let mut out = Block::of(splats.len());
    let is_disc = frame.ellipsoids.is_none();
    let is_coloured = has_harmonics(machine, frame);
    // What cannot be set up is not drawn.
    if !is_disc && machine.machine.ellipse.ellipsoid.is_none() {
        return out.done(is_lit, is_coloured);
    }
    if is_disc
        && !P::WORDS
        && !P::TRANSFERS
        && let (Some(discs), Some(host)) = (&machine.discs, Vectorised::detect())
    {
        host.run(SetUpDiscs {
            discs,
            frame,
            splats,
            first,
            lit,
            probe,
            out: &mut out,
        });
        return out.done(is_lit, false);
    }
    let (mut stages, mut again) = (Stages::new(machine, frame), None);
    let at_a_time = if P::TRANSFERS { 1 } else { BATCH };
    for (splats, first) in splats.chunks(at_a_time).zip((first..).step_by(at_a_time)) {
        stages.set_up(splats, first, lit, probe, &mut out);
        // Some eights once more, for another to observe.
        let item = first as usize / LANES;
        probe.resample_batch(
            item..item + splats.len().div_ceil(LANES),
            of.div_ceil(LANES),
            |nth, ranges| {
                let stages = again.get_or_insert_with(|| Stages::new(machine, frame));
                let eight =
                    &splats[(nth - item) * LANES..splats.len().min((nth - item + 1) * LANES)];
                stages.set_up(
                    eight,
                    (nth * LANES) as u32,
                    lit,
                    ranges,
                    &mut Block::of(LANES),
                );
            },
        );
    }
    out.done(is_lit, is_coloured)
}

/// Whether the machine evaluates the splats' harmonics.
fn has_harmonics(machine: &Elaborated, frame: &Frame) -> bool {
    machine.colour.is_some()
        && frame
            .ellipsoids
            .as_ref()
            .is_some_and(|ellipsoids| ellipsoids.harmonics > 0)
}

/// Sets discs up by the host's kernel, for a probe that observes none of their words.
struct SetUpDiscs<'a, 'p, P> {
    discs: &'a Discs,
    frame: &'a Frame,
    splats: &'a [Splat],
    first: u32,
    lit: Option<&'a Lit<'a>>,
    probe: &'p mut P,
    out: &'a mut Block,
}

impl<P: Probe> Kernel for SetUpDiscs<'_, '_, P> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let SetUpDiscs {
            discs,
            frame,
            splats,
            first,
            lit,
            probe,
            out,
        } = self;
        // Copies that nobody else can see: their constants are broadcast to lanes once, outside the
        // loop.
        let (discs, view, size_px) = (
            discs.clone(),
            frame.view.clone(),
            [frame.width, frame.height],
        );
        for (given, first) in splats.chunks(LANES).zip((first..).step_by(LANES)) {
            let last;
            let eight = match given.first_chunk() {
                Some(eight) => eight,
                None => {
                    last = std::array::from_fn(|lane| given.get(lane).copied().unwrap_or_default());
                    &last
                }
            };
            let made = discs.set_up::<L::Words>(&view, size_px, eight);
            let live = ((1u32 << given.len()) - 1) as u8;
            keep(&made, given, None, live, first, lit, probe, out);
        }
    }
}

/// The graphs of the units, with rows for a batch.
struct Stages<'a> {
    frame: &'a Frame,
    ellipse: &'a Ellipse,
    project: (&'a Program, Batch),
    footprint: (&'a Program, Batch),
    /// If the machine evaluates the splats' harmonics.
    colour: Option<(&'a Colour, Batch)>,
}

impl<'a> Stages<'a> {
    fn new(machine: &'a Elaborated, frame: &'a Frame) -> Self {
        let Elaborated {
            project, ellipse, ..
        } = machine;
        let variant = ellipse.variant_of(frame);
        let kernel = frame
            .ellipsoids
            .as_ref()
            .map(|ellipsoids| ellipsoids.kernel.clone())
            .unwrap_or_default();
        let mut point = (project.program(), project.program().batch());
        for (input, register) in (project::INPUTS..).zip(project::registers(&frame.view)) {
            point.1.set_all(point.0, input, register);
        }
        let program = &ellipse.datapath(variant).program;
        let mut footprint = (program, program.batch());
        let registers =
            ellipse.registers(variant, &frame.view, [frame.width, frame.height], &kernel);
        for (input, register) in (variant.inputs()..).zip(registers) {
            footprint.1.set_all(footprint.0, input, register);
        }
        let colour = machine
            .colour
            .as_ref()
            .filter(|_| has_harmonics(machine, frame));
        let colour = colour.map(|colour| {
            let program = colour.program();
            let mut batch = program.batch();
            for (input, part) in (Colour::EYE..).zip(frame.view.eye) {
                batch.set_all(program, input, part);
            }
            (colour, batch)
        });
        Stages {
            frame,
            ellipse,
            project: point,
            footprint,
            colour,
        }
    }

    /// Sets up to a batch of splats up.
    fn set_up<P: Probe>(
        &mut self,
        splats: &[Splat],
        first: u32,
        lit: Option<&Lit>,
        probe: &mut P,
        out: &mut Block,
    ) {
        let rows = splats.len().div_ceil(LANES);
        let live: [u8; ROWS] = std::array::from_fn(|row| {
            ((1u32 << splats.len().saturating_sub(row * LANES).min(LANES)) - 1) as u8
        });
        let live = &live[..rows];
        run::<P, _>(Load {
            stages: self,
            splats,
            first,
        });
        let (project, point) = &mut self.project;
        let left = run::<P, _>(Run {
            program: project,
            batch: point,
            live,
            probe,
        });
        let (program, footprint) = &mut self.footprint;
        for (result, input) in CARRIED {
            point.carry(
                project.output(result),
                rows,
                program.input(input),
                footprint,
            );
        }
        let left = run::<P, _>(Run {
            program,
            batch: footprint,
            live: &left[..rows],
            probe,
        });
        if P::TRANSFERS {
            let made = std::array::from_fn(|output| point.row(project, output, 0)[0].into());
            let ellipse = std::array::from_fn(|output| footprint.row(program, output, 0)[0].into());
            let transparent = point.input_row(project, 3, 0)[0] != 0;
            probe.set_up(
                first,
                projected_words(made, transparent),
                ellipse_words(ellipse),
            );
        }
        if let Some((colour, batch)) = &mut self.colour {
            load_harmonics(self.frame, colour, batch, splats, first);
            run::<P, _>(Run {
                program: colour.program(),
                batch,
                live: &left[..rows],
                probe,
            });
            if P::TRANSFERS && left[0] & 1 != 0 {
                let rgb = [0, 1, 2].map(|channel| batch.row(colour.program(), channel, 0)[0]);
                probe.coloured(first, rgb);
            }
        }
        run::<P, _>(Kept {
            stages: self,
            splats,
            live,
            first,
            lit,
            probe,
            out,
        });
    }
}

/// Results of `project` that are inputs of `ellipse`: exponent, t_z, 1/t_z, its exponent, slope,
/// pixel.
const CARRIED: [(usize, usize); 8] = [
    (3, 4),
    (2, 5),
    (5, 6),
    (6, 7),
    (7, 8),
    (8, 9),
    (9, 10),
    (10, 11),
];

/// Puts splats' records into the rows of both units.
struct Load<'a, 's> {
    stages: &'a Stages<'s>,
    splats: &'a [Splat],
    first: u32,
}

impl Kernel for Load<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Load {
            stages,
            splats,
            first,
        } = self;
        let ((project, point), (program, footprint)) = (&stages.project, &stages.footprint);
        for (row, given) in splats.chunks(LANES).enumerate() {
            // The first eight words of each record as they lie in memory: red comes along.
            let mut records = [L::Words::splat(0); LANES];
            for (record, splat) in records.iter_mut().zip(given) {
                let Splat {
                    position: [x, y, z],
                    normal: [n, m, o],
                    radius,
                    rgb: [red, ..],
                    ..
                } = *splat;
                *record = L::Words::from_array([x, y, z, n, m, o, radius, red]);
            }
            let words = L::Words::transposed(records).map(Words::to_array);
            (0..3).for_each(|input| point.set_row(project, input, row, words[input]));
            (0..4).for_each(|input| footprint.set_row(program, input, row, words[3 + input]));
            if let Some(ellipsoids) = &stages.frame.ellipsoids {
                stages.load_axes::<L::Words>(ellipsoids, row, given, first as usize + row * LANES);
            }
        }
    }
}

impl Stages<'_> {
    /// The rest of ellipsoids' records.
    #[inline(always)]
    fn load_axes<W: Words>(
        &self,
        ellipsoids: &Ellipsoids,
        row: usize,
        splats: &[Splat],
        first: usize,
    ) {
        let ((project, point), (program, footprint)) = (&self.project, &self.footprint);
        let [mut opacity, mut transparent, mut cutoff] = [[0; LANES]; 3];
        for (lane, splat) in splats.iter().enumerate().take(LANES) {
            opacity[lane] = splat.opacity;
            transparent[lane] =
                -i32::from(i64::from(splat.opacity) < ellipsoids.kernel.least_opacity);
            cutoff[lane] =
                self.ellipse
                    .box_cutoff(&self.frame.view, &ellipsoids.kernel, splat.opacity)
                    as i32;
        }
        point.set_row(project, 3, row, transparent);
        footprint.set_row(program, 12, row, opacity);
        footprint.set_row(program, 13, row, cutoff);
        if !ellipsoids.own.is_empty() {
            let mut records = [W::splat(0); LANES];
            for (record, own) in records
                .iter_mut()
                .zip(ellipsoids.own.iter().skip(first).take(splats.len()))
            {
                let Orientation {
                    quaternion: [w, x, y, z],
                    scales: [a, b, c],
                } = *own;
                *record = W::from_array([w, x, y, z, a, b, c, 0]);
            }
            let own = W::transposed(records).map(Words::to_array);
            (0..7).for_each(|nth| footprint.set_row(program, 14 + nth, row, own[nth]));
        }
    }

    /// What both made of eight splats.
    #[inline(always)]
    fn made<W: Words>(&self, row: usize) -> Made<W> {
        let ((project, point), (program, footprint)) = (&self.project, &self.footprint);
        let of_point = |output: usize| W::from_array(point.row(project, output, row));
        let of_ellipse = |output: usize| W::from_array(footprint.row(program, output, row));
        let transparent = W::from_array(point.input_row(project, 3, row));
        Made {
            culled: [
                of_point(11),
                of_point(12),
                transparent,
                of_ellipse(14),
                of_ellipse(15),
                of_ellipse(16),
            ],
            pixel: two!(axis => of_point(9 + axis)),
            depth: of_point(4),
            conic: three!(i => of_ellipse(3 + i)),
            depth_slope: two!(axis => of_ellipse(11 + axis)),
            depth_range: of_ellipse(13),
            sides: two!(axis => two!(end => of_ellipse(7 + 2 * axis + end))),
            amplitude: of_ellipse(6),
            normal: three!(axis => of_ellipse(axis)),
        }
    }
}

/// Puts splats' positions and coefficients into the rows of `colour`. Rows of coefficients above the
/// frame's degree keep their zeros.
fn load_harmonics(frame: &Frame, colour: &Colour, batch: &Batch, splats: &[Splat], first: u32) {
    let Some(ellipsoids) = &frame.ellipsoids else {
        return;
    };
    let (program, stride) = (
        colour.program(),
        coefficients(u32::from(ellipsoids.harmonics)),
    );
    for (row, given) in splats.chunks(LANES).enumerate() {
        for axis in 0..3 {
            let mut words = [0; LANES];
            for (word, splat) in words.iter_mut().zip(given) {
                *word = splat.position[axis];
            }
            batch.set_row(program, axis, row, words);
        }
        let at = stride * (first as usize + row * LANES);
        let own = ellipsoids.coefficients.get(at..).unwrap_or_default();
        for coefficient in 0..stride.min(colour.coefficients()) {
            for channel in 0..3 {
                let mut words = [0; LANES];
                for (word, own) in words.iter_mut().zip(own.chunks(stride)).take(given.len()) {
                    *word = own.get(coefficient).map_or(0, |rgb| rgb[channel]);
                }
                batch.set_row(program, Colour::input(coefficient, channel), row, words);
            }
        }
    }
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
        Lit {
            machine,
            frame,
            highlights: machine.shade.highlights(&frame.lighting),
            windows: machine.windows(frame),
        }
    }

    /// Of windows, how fast a splat hides what lies behind it.
    fn density<P: Probe>(&self, splat: &Splat, probe: &mut P) -> i32 {
        let density = |registers: &WindowRegisters| {
            self.machine
                .fragment
                .density(splat.opacity, registers, &mut Tap::new(probe))
        };
        self.windows.as_ref().map_or(0, density)
    }

    /// The port from setup to shade: the light that each live one of eight splats sends, red, green
    /// and blue. A call of its own, so that it is compiled once for all that set splats up.
    #[inline(never)]
    fn emissions<P: Probe>(
        &self,
        splats: &[Splat],
        rgb: [[i32; LANES]; 3],
        first: u32,
        normals: [[i32; LANES]; 3],
        live: u8,
        probe: &mut P,
    ) -> [[i32; LANES]; 3] {
        let lights = shade::LightRegisters::of(self.frame, &self.highlights);
        let is_by_eight = !P::TRANSFERS
            && lights.surroundings.is_none()
            && self.machine.fragment.has_narrow_sums();
        if is_by_eight {
            return run::<P, _>(EmitEight {
                machine: self.machine,
                lights: &lights,
                splats,
                rgb,
                normals,
                live,
                probe,
            });
        }
        let mut light = [[0; LANES]; 3];
        for (lane, splat) in splats.iter().enumerate() {
            if live & (1 << lane) != 0 {
                let [rgb, normal] = [rgb, normals].map(|part| part.map(|part| part[lane]));
                let sent = (splat.material, rgb, normal);
                let sent = self.emission(&lights, sent, first + lane as u32, probe);
                (0..3).for_each(|channel| light[channel][lane] = sent[channel]);
            }
        }
        light
    }

    /// The light that one splat sends, from its material, colour and normal.
    fn emission<P: Probe>(
        &self,
        lights: &shade::LightRegisters,
        (material, rgb, normal): (u32, [i32; 3], [i32; 3]),
        number: u32,
        probe: &mut P,
    ) -> [i32; 3] {
        let tap = &mut Tap::new(probe);
        let input = emitting(self.machine, rgb, normal, material, tap);
        if P::WORK && lights.surroundings.is_some() {
            tap.probe.lit();
        }
        if P::TRANSFERS {
            tap.probe.shade_in();
        }
        let output = self.machine.shade.one(lights, &input, tap);
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

/// A block's splats, set up.
struct Block {
    records: Vec<SetupRecord>,
    boxes: Vec<[[u16; 2]; 2]>,
    emissions: Vec<Emission>,
    colours: Vec<[i32; 3]>,
    culled: Culled,
}

impl Block {
    /// None yet of so many.
    fn of(splats: usize) -> Self {
        Block {
            records: Vec::with_capacity(splats),
            boxes: Vec::with_capacity(splats),
            emissions: Vec::new(),
            colours: Vec::new(),
            culled: Culled::default(),
        }
    }

    /// All of them, without the room that was kept for those that fell out.
    fn done(mut self, is_lit: bool, is_coloured: bool) -> Setup {
        self.records.shrink_to_fit();
        self.boxes.shrink_to_fit();
        Setup {
            blocks: vec![self.records],
            boxes: vec![self.boxes],
            emissions: is_lit.then_some(self.emissions).into_iter().collect(),
            colours: is_coloured.then_some(self.colours).into_iter().collect(),
            order: Vec::new(),
            lists: None,
            culled: self.culled,
        }
    }
}

/// Keeps those of a batch that are not culled.
struct Kept<'a, 's, 'p, P> {
    stages: &'a Stages<'s>,
    splats: &'a [Splat],
    live: &'a [u8],
    first: u32,
    lit: Option<&'a Lit<'a>>,
    probe: &'p mut P,
    out: &'a mut Block,
}

impl<P: Probe> Kernel for Kept<'_, '_, '_, P> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Kept {
            stages,
            splats,
            live,
            first,
            lit,
            probe,
            out,
        } = self;
        for (row, own) in splats.chunks(LANES).enumerate() {
            probe.item(row);
            let rgb = stages.colour.as_ref().map(|(colour, batch)| {
                [0, 1, 2].map(|channel| batch.row(colour.program(), channel, row))
            });
            keep(
                &stages.made::<L::Words>(row),
                own,
                rgb,
                live[row],
                first + (row * LANES) as u32,
                lit,
                probe,
                out,
            );
        }
    }
}

/// What both units made of eight splats, as far as the pipeline keeps it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Made<W> {
    /// In the order in which the units find them: near, outside, transparent, backface, faint, box
    /// outside.
    pub culled: [W; CULLED.len()],
    pub pixel: [W; 2],
    pub depth: W,
    pub conic: [W; 3],
    pub depth_slope: [W; 2],
    pub depth_range: W,
    /// First and last column, first and last row.
    pub sides: [[W; 2]; 2],
    pub amplitude: W,
    pub normal: [W; 3],
}

/// Keeps those of eight splats that are not culled; `rgb` are their colours, if the machine evaluates
/// harmonics.
#[inline(always)]
#[expect(
    clippy::too_many_arguments,
    reason = "one call for each way to set splats up"
)]
fn keep<W: Words, P: Probe>(
    made: &Made<W>,
    splats: &[Splat],
    rgb: Option<[[i32; LANES]; 3]>,
    live: u8,
    first: u32,
    lit: Option<&Lit>,
    probe: &mut P,
    out: &mut Block,
) {
    let mut left = live;
    let any = made
        .culled
        .into_iter()
        .fold(W::splat(0), |any, reason| any | reason);
    if left & any.signs() != 0 {
        // The first that holds is the reason.
        let mut lanes = [0; CULLED.len()];
        for (lanes, reason) in lanes.iter_mut().zip(made.culled) {
            *lanes = left & reason.signs();
            left &= !*lanes;
        }
        if P::WORK {
            probe.culled(first, lanes);
        }
        let [near, outside, transparent, backface, faint, missing] =
            lanes.map(|lanes| u64::from(lanes.count_ones()));
        out.culled.absorb(&Culled {
            near,
            outside: outside + missing,
            faint,
            backface,
            transparent,
        });
    }

    let ([x, y], [xx, xy, yy]) = (made.pixel, made.conic);
    let ([z_x, z_y], [n, m, o]) = (made.depth_slope, made.normal);
    let [columns, rows] = two!(axis => made.sides[axis][0] | made.sides[axis][1].left(16));
    let plane = W::transposed([x, y, xx, xy, yy, made.depth, z_x, z_y]);
    let rest = W::transposed([
        made.depth_range,
        columns,
        rows,
        made.amplitude,
        n,
        m,
        o,
        W::splat(0),
    ]);
    let light = match lit {
        Some(lit) if left != 0 => {
            let normals = made.normal.map(W::to_array);
            let own = || {
                let mut own = [[0; LANES]; 3];
                for (lane, splat) in splats.iter().enumerate().take(LANES) {
                    (0..3).for_each(|channel| own[channel][lane] = splat.rgb[channel]);
                }
                own
            };
            lit.emissions(splats, rgb.unwrap_or_else(own), first, normals, left, probe)
        }
        _ => [[0; LANES]; 3],
    };
    for (lane, own) in splats.iter().enumerate() {
        if left & (1 << lane) == 0 {
            continue;
        }
        let [x, y, xx, xy, yy, depth, z_x, z_y] = plane[lane].to_array();
        let [depth_range, columns, rows, amplitude, n, m, o, _] = rest[lane].to_array();
        if let Some(lit) = lit {
            out.emissions.push(Emission {
                light: light.map(|channel| channel[lane]),
                density: lit.density(own, probe),
            });
        }
        if let Some(rgb) = rgb {
            out.colours.push(rgb.map(|channel| channel[lane]));
        }
        if P::WORK {
            probe.drawn(first + lane as u32, [halves(columns), halves(rows)]);
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

/// The low and the high half of a word.
#[inline(always)]
fn halves(word: i32) -> [u16; 2] {
    let [a, b, c, d] = word.to_le_bytes();
    [u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d])]
}

/// What `project` makes, as a record has it.
pub(super) fn projected_words(
    made: [i64; project::OUTPUTS],
    transparent: bool,
) -> [i64; PROJECTED] {
    let [
        _,
        _,
        forward,
        exponent,
        depth,
        inverse_depth,
        inverse_depth_exponent,
        slope_x,
        slope_y,
        pixel_x,
        pixel_y,
        near,
        outside,
    ] = made;
    let record = ProjectOut {
        near: -near,
        outside: -outside,
        transparent: transparent.into(),
        forward,
        exponent,
        depth,
        inverse_depth,
        inverse_depth_exponent,
        slope_x,
        slope_y,
        pixel_x,
        pixel_y,
    };
    record.into_words()
}

/// What `ellipse` makes, as a record has it.
pub(super) fn ellipse_words(made: [i64; ellipse::OUTPUTS]) -> [i64; SET_UP] {
    let [
        normal_x,
        normal_y,
        normal_z,
        conic_xx,
        conic_xy,
        conic_yy,
        amplitude,
        sides @ ..,
        depth_slope_x,
        depth_slope_y,
        depth_range,
        backface,
        faint,
        outside,
    ] = made;
    let [first_column, last_column, first_row, last_row] = sides;
    let record = EllipseOut {
        backface: -backface,
        faint: -faint,
        outside: -outside,
        normal_x,
        normal_y,
        normal_z,
        conic_xx,
        conic_xy,
        conic_yy,
        amplitude,
        first_column,
        last_column,
        first_row,
        last_row,
        depth_slope_x,
        depth_slope_y,
        depth_range,
    };
    record.into_words()
}

#[cfg(test)]
mod tests;

//! Lockstep: the reference `golden` with every decision forced to the machine's, and a bound on the
//! machine's error at each pixel (docs/book/algorithm-resolve.md §8).
//!
//! ```text
//! machine ─► decisions ─►[ golden's fragments ]─► led picture ─┐
//!                  └────►[ the units' bounds ]──► bound ───────┴─► |fixed − led| ≤ bound, at every pixel
//! ```
//! The remaining difference between the two is arithmetic only, and the bounds of the units
//! (`real.rs` of each) limit it. A *flip* is a decision that `golden` alone would take differently.
//! It is real if the number that decided lies within its bound of the threshold, and *unexplained*
//! otherwise.
//!
//! The led renderer observes the machine as a probe, tile by tile. Nothing is recorded, and it
//! needs the memory of one tile.
//!
//! Laws (tests/bounds.rs): `no_pixel_exceeds_its_bound`, `every_flip_is_explained`.

mod pixel;
mod sheets;
mod summary;
mod window;

use crate::golden::Rules;
use crate::golden::footprint::{
    Contribution as Exact, Cull, Footprint, FootprintRow, Weights, set_up_with_cull,
};
use crate::golden::fragments::Fragment;
use crate::golden::shade::Shader;
use crate::hardware::fixed;
use crate::hardware::quantise::Quantised;
use crate::hardware::registers::{Bounded, Registers};
use crate::output::picture::Picture;
use crate::scene::{Scene, View};
use pixel::{ATTRIBUTES, BoundedContribution, Common, FragmentPixel, SumLimits};
use rayon::prelude::*;
use rtl_model::machine::Rows;
use rtl_model::pipeline;
use rtl_model::pipeline::Elaborated;
use rtl_model::pipeline::real::Footprint as NearFootprint;
use rtl_model::probe::Observer;
use rtl_model::real::frame as real;
use rtl_model::real::{Near, Real};
use rtl_model::units::fragment::{Contribution, Decision, TILE_AREA, TILE_PX};
use rtl_model::units::resolve::Layer;
use schemars::JsonSchema;
use serde::Serialize;
use sheets::{SheetPixel, SheetRules};
use std::any::Any;
use std::array;
use std::cell::OnceCell;
use std::collections::BTreeMap;
use window::{SplatLight, WindowPixel, WindowRules};

pub use summary::{BoundSummary, Summary};

/// Decisions that `golden` would take differently, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Flips {
    /// A splat is drawn by one and culled by the other: counts contributions that only one has.
    pub cull: u64,
    /// A pixel is inside the footprint for one and outside for the other.
    pub coverage: u64,
    /// A different fragment to add to, or none.
    pub slot: u64,
    /// A different order in depth.
    pub order: u64,
    /// A different pair to merge.
    pub pair: u64,
    /// A fragment is dropped by one and kept by the other.
    pub eviction: u64,
    /// A contribution's normal is turned by one and left by the other.
    pub turn: u64,
    /// Windows only, as the three below: late for a different surface, or for none.
    pub late: u64,
    /// Inside a closed slot or not, or nearer to its other side.
    pub inside: u64,
    /// A different window.
    pub window: u64,
    /// A different pair to sum, or none.
    pub sum: u64,
    /// Flips whose deciding number is not within its bound of the threshold. Should be 0.
    pub unexplained: u64,
    /// Kinds at the current pixel, one bit each.
    #[serde(skip)]
    here: u16,
}

/// Names of the kinds, in the order of their bits.
pub const KINDS: [&str; 11] = [
    "cull", "coverage", "slot", "order", "pair", "eviction", "turn", "late", "inside", "window",
    "sum",
];

impl Flips {
    /// Counts of the kinds, in the order of their bits.
    fn counts(&mut self) -> [&mut u64; KINDS.len()] {
        let Flips {
            cull,
            coverage,
            slot,
            order,
            pair,
            eviction,
            turn,
            late,
            inside,
            window,
            sum,
            unexplained: _,
            here: _,
        } = self;
        [
            cull, coverage, slot, order, pair, eviction, turn, late, inside, window, sum,
        ]
    }

    /// Each kind and its count.
    pub fn by_kind(&self) -> [(&'static str, u64); KINDS.len()] {
        let mut all = *self;
        let counts = all.counts();
        std::array::from_fn(|kind| (KINDS[kind], *counts[kind]))
    }

    /// Flips of all kinds.
    pub fn total(&self) -> u64 {
        self.by_kind().into_iter().map(|(_, count)| count).sum()
    }

    fn count(&mut self, kind: u8, explained: bool) {
        *self.counts()[usize::from(kind)] += 1;
        self.unexplained += u64::from(!explained);
        self.here |= 1 << kind;
    }

    fn cull(&mut self, explained: bool) {
        self.count(0, explained);
    }
    fn coverage(&mut self, explained: bool) {
        self.count(1, explained);
    }
    fn slot(&mut self, explained: bool) {
        self.count(2, explained);
    }
    fn order(&mut self, explained: bool) {
        self.count(3, explained);
    }
    fn pair(&mut self, explained: bool) {
        self.count(4, explained);
    }
    fn eviction(&mut self, explained: bool) {
        self.count(5, explained);
    }

    fn turn(&mut self, explained: bool) {
        self.count(6, explained);
    }

    fn late(&mut self, explained: bool) {
        self.count(7, explained);
    }

    fn inside(&mut self, explained: bool) {
        self.count(8, explained);
    }

    fn window(&mut self, explained: bool) {
        self.count(9, explained);
    }

    fn sum(&mut self, explained: bool) {
        self.count(10, explained);
    }

    fn absorb(&mut self, other: &Flips) {
        let mut other = *other;
        for (count, more) in self.counts().into_iter().zip(other.counts()) {
            *count += *more;
        }
        self.unexplained += other.unexplained;
    }
}

/// Which tiles of 16 × 16 pixels are checked in lockstep, which takes most of a run's time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CheckedTiles {
    /// All tiles.
    #[default]
    All,
    /// One tile in eight: one of any eight consecutive tiles in a row or a column.
    Sampled,
}

impl CheckedTiles {
    fn has(self, column: usize, row: usize) -> bool {
        match self {
            CheckedTiles::All => true,
            CheckedTiles::Sampled => (column + 3 * row).is_multiple_of(8),
        }
    }
}

/// Splats that are set up together.
const BATCH: usize = 8;
/// Splats of a tile in `golden` among which the machine's next splat is searched.
const SEARCHED: usize = 1024;

/// Result of a frame in lockstep.
#[derive(Clone, Debug)]
pub struct Lockstep {
    /// Tiles that were checked. Nothing is counted in the others.
    pub tiles: CheckedTiles,
    /// Picture of `golden` led by the machine's decisions.
    pub led: Picture,
    /// Bound on |fixed − led|, of the worst channel of each pixel; infinite where there is no
    /// bound.
    pub bound: Vec<f64>,
    /// |fixed − led|, of the worst channel of each pixel.
    pub error: Vec<f64>,
    /// Kinds of flips at each pixel, one bit each in the order of [`KINDS`].
    pub flipped: Vec<u16>,
    /// Pixels where |fixed − led| exceeds its bound in some channel. Should be 0.
    pub violations: u64,
    /// Decisions that `golden` would take differently.
    pub flips: Flips,
}

/// Draws a scene on a machine with `golden` in lockstep.
pub fn lockstep(scene: &Scene, machine: &Elaborated, quantised: &Quantised) -> Lockstep {
    lockstep_in(scene, machine, quantised, CheckedTiles::All)
}

/// Draws a scene with `golden` in lockstep in some tiles.
pub fn lockstep_in(
    scene: &Scene,
    machine: &Elaborated,
    quantised: &Quantised,
    tiles: CheckedTiles,
) -> Lockstep {
    draw_against(scene, machine, machine, quantised, tiles)
}

/// Draws a scene on one machine and checks it against the bounds of another with the same words.
fn draw_against(
    scene: &Scene,
    drawn: &Elaborated,
    claimed: &Elaborated,
    quantised: &Quantised,
    tiles: CheckedTiles,
) -> Lockstep {
    let rules = fixed::rules(&claimed.machine);
    let shader = Shader::of(scene, &rules);
    let stage = FrameContext {
        tiles,
        ..FrameContext::new(scene, claimed, quantised, &rules, &shader)
    };
    let mut probe = LockstepProbe::new(&stage);
    let drawing = pipeline::draw_with_decisions(drawn, &quantised.frame, &mut probe);
    probe.finish(drawing.covered)
}

/// Input that all tiles share.
struct FrameContext<'a> {
    scene: &'a Scene,
    tiles: CheckedTiles,
    machine: &'a Elaborated,
    quantised: &'a Quantised,
    eye: View,
    view: real::View<Near>,
    common: Common<'a>,
    /// Golden's weights.
    weights: Weights,
    /// Smaller weights make no fragment.
    least_weight: Near,
    /// Splats of less opacity are not drawn.
    least_opacity: Option<Near>,
    /// Present if fragments are grouped by sheets.
    sheets: Option<SheetRules<'a>>,
    /// Present if fragments are grouped by windows.
    windows: Option<WindowRules<'a>>,
    /// Tiles per row.
    columns: usize,
    /// The splats that reach each tile in `golden`, in its order of drawing.
    bins: Vec<Vec<u32>>,
}

impl<'a> FrameContext<'a> {
    fn new(
        scene: &'a Scene,
        machine: &'a Elaborated,
        quantised: &'a Quantised,
        rules: &'a Rules,
        shader: &'a Shader,
    ) -> Self {
        let eye = scene.view();
        let registers = Registers {
            scene,
            eye: &eye,
            machine,
            quantised,
        };
        let common = Common {
            machine,
            rules,
            shader,
            lighting: registers.lighting(&Bounded),
            z_threshold_world: scene.surface.z_threshold,
            z_threshold: registers.z_threshold(&Bounded),
            coverage_threshold: registers.coverage_threshold(&Bounded),
            background: registers.background(&Bounded, shader),
            limits: SumLimits::new(&machine.machine, registers.opaque(&Bounded, rules.opaque)),
        };
        let view = registers.view(&Bounded);
        let weights = Weights::of(scene, rules);
        let columns = scene.image.width.div_ceil(TILE_PX);
        let mut bins = vec![Vec::new(); columns * scene.image.height.div_ceil(TILE_PX)];
        let mut reached = reached(scene, &eye, weights);
        if (scene.ellipsoids.as_ref()).is_some_and(|ellipsoids| ellipsoids.sorted) {
            reached.sort_by(|a, b| a.z.total_cmp(&b.z));
        }
        for Reached { splat, tiles, .. } in reached {
            let [left, top, right, bottom] = tiles.map(usize::from);
            for row in top..bottom {
                bins[row * columns..][left..right]
                    .iter_mut()
                    .for_each(|bin| bin.push(splat));
            }
        }
        let sheets = SheetRules::new(scene, machine, quantised);
        let windows = WindowRules::new(scene, &common, quantised);
        let least_weight = sheets
            .as_ref()
            .map_or(Near::exact(0.0), SheetRules::least_weight);
        let least_opacity = registers.least_opacity(&Bounded);
        let tiles = CheckedTiles::All;
        FrameContext {
            scene,
            tiles,
            machine,
            quantised,
            view,
            eye,
            common,
            weights,
            least_weight,
            least_opacity,
            sheets,
            windows,
            columns,
            bins,
        }
    }

    /// A splat as golden has it.
    fn footprint(&self, index: u32) -> (Footprint, Option<Cull>) {
        let (mut footprint, cull) =
            set_up_with_cull(self.scene, &self.eye, index as usize, self.weights);
        let frame = &self.quantised.frame;
        footprint.blocks =
            (self.common.rules.blocks).filter(|_| self.machine.tests_blocks(frame).is_some());
        (footprint, cull)
    }

    /// A splat, exact and with the machine's bounds.
    fn splat(&self, index: u32) -> Box<BoundedSplat> {
        let [splat] = self.splats([index]);
        splat
    }

    /// Splats, exact and with the machine's bounds.
    fn splats<const ITEMS: usize>(&self, indices: [u32; ITEMS]) -> [Box<BoundedSplat>; ITEMS] {
        let registers = Registers {
            scene: self.scene,
            eye: &self.eye,
            machine: self.machine,
            quantised: self.quantised,
        };
        let frame = &self.quantised.frame;
        let records = indices.map(|index| real::Splat {
            turned: Some(self.machine.turns_normal(frame, index as usize)),
            ..registers.splat(&Bounded, index as usize)
        });
        let ellipsoids = indices.map(|index| registers.ellipsoid(&Bounded, index as usize));
        let near = NearFootprint::batch(
            self.machine,
            &self.view,
            &records,
            ellipsoids.each_ref().map(Option::as_ref),
            [frame.width, frame.height],
        );
        array::from_fn(|item| self.bounded(indices[item], &records[item], &near[item]))
    }

    /// A splat with the machine's bounds, which its record has.
    fn bounded(
        &self,
        index: u32,
        record: &real::Splat<Near>,
        near: &NearFootprint,
    ) -> Box<BoundedSplat> {
        let (mut footprint, cull) = self.footprint(index);
        let turned = record.turned == Some(true);
        let turns_differently = self.common.rules.turn_normals && turned != footprint.faces_away();
        if turned {
            footprint.normal = -footprint.normal;
        }
        // The machine's normals around golden's own.
        let normal = [0, 1, 2].map(|axis| near.ellipse.normal[axis].around(footprint.normal[axis]));
        let mut rgb = record.rgb;
        let opacity = footprint.opacity;
        let own = self.windows.as_ref().map(|_| {
            let golden = self.common.shader.emission(&footprint);
            let emission =
                self.machine
                    .real_emission(&self.common.lighting, rgb, normal, footprint.material);
            SplatLight {
                golden,
                light: [0, 1, 2].map(|channel| emission[channel].around(golden[channel])),
                opacity,
            }
        });
        if self
            .scene
            .ellipsoids
            .as_ref()
            .is_some_and(|ellipsoids| ellipsoids.preshaded)
        {
            let emission =
                self.machine
                    .real_emission(&self.common.lighting, rgb, normal, footprint.material);
            footprint.rgb = self.common.shader.emission(&footprint);
            rgb = [0, 1, 2].map(|channel| emission[channel].around(footprint.rgb[channel]));
        }
        let [r, g, b] = rgb;
        let attributes = [r, g, b, record.opacity, normal[0], normal[1], normal[2]];
        let filled = self.common.limits.filled(&attributes);
        Box::new(BoundedSplat {
            index,
            footprint,
            cull,
            near: *near,
            record: *record,
            attributes,
            filled,
            turns_differently,
            own,
        })
    }

    /// Number of a pixel's tile.
    fn tile(&self, [x, y]: [u32; 2]) -> usize {
        y as usize / TILE_PX * self.columns + x as usize / TILE_PX
    }

    /// Whether a pixel's tile is checked.
    fn is_checked(&self, x: u32, y: u32) -> bool {
        self.tiles.has(x as usize / TILE_PX, y as usize / TILE_PX)
    }

    /// A pixel's centre relative to the middle of the picture.
    fn at(&self, x: u32, y: u32) -> [f64; 2] {
        [
            f64::from(x) + 0.5 - self.eye.half_px[0],
            f64::from(y) + 0.5 - self.eye.half_px[1],
        ]
    }

    /// Whether machine and `golden` may differ about drawing the splat.
    fn may_cull(&self, splat: &BoundedSplat) -> bool {
        let (point, ellipse) = (&splat.near.point, &splat.near.ellipse);
        let zero = Near::exact(0.0);
        point.depth.may_cross(self.view.near)
            || point.inside.iter().any(|inside| inside.may_cross(zero))
            || ellipse.amplitude.low() <= 0.0
            || ellipse.facing.may_cross(zero)
            || splat.record.radius.low() <= 0.0
            || self
                .least_opacity
                .is_some_and(|least| splat.record.opacity.may_cross(least))
    }

    /// Whether the machine may leave out an r, by rules that golden does not have: its own limit of
    /// the cutoff, and none below 0.
    fn may_leave_out(&self, radial: Near, exact: f64) -> bool {
        let most = self.machine.machine.raster.most_cutoff;
        most.is_some_and(|most| exact >= f64::from(most))
            || self.machine.machine.raster.rows == Rows::Direct && exact - radial.error <= 0.0
    }

    /// Whether machine and `golden` may differ about whether the splat reaches a pixel.
    fn may_cover(&self, splat: &BoundedSplat, x: u32, y: u32) -> bool {
        let at = self.at(x, y);
        let contribution = splat.near.contribution(self.machine, at);
        let exact = splat.footprint.row(y).beyond(x);
        let outside = |axis: usize| {
            let distance = Near::within(
                at[axis] - splat.near.point.pixel[axis].value,
                splat.near.point.pixel[axis].error,
            )
            .abs();
            distance.may_cross(splat.near.ellipse.extent[axis])
        };
        contribution
            .radial
            .around(exact.radial_index)
            .may_cross(self.view.cutoff)
            || contribution.weight.around(exact.weight).low() <= self.least_weight.high()
            || self.may_leave_out(contribution.radial, exact.radial_index)
            || outside(0)
            || outside(1)
    }

    /// Whether the machine may have a contribution to a pixel that `golden` does not have. Each
    /// reason of golden's must be in doubt.
    fn explains_more(
        &self,
        splat: &BoundedSplat,
        row: &FootprintRow,
        at: [u32; 2],
        exact: &Exact,
    ) -> bool {
        let reaches = splat.reaches(row, at, exact);
        (reaches || self.may_cover(splat, at[0], at[1]))
            && (splat.footprint.keeps_block(at) || self.may_keep_otherwise(splat, at))
    }

    /// Whether machine and `golden` may differ about keeping the block of a pixel.
    fn may_keep_otherwise(&self, splat: &BoundedSplat, [x, y]: [u32; 2]) -> bool {
        let frame = &self.quantised.frame;
        let (Some(test), Some(unit), Some(held)) = (
            &splat.footprint.blocks,
            self.machine.tests_blocks(frame),
            (self.machine).contribution_cutoff(frame, splat.index as usize),
        ) else {
            return false;
        };
        let cutoff = Near::held(
            splat.footprint.leader_cutoff(test),
            self.machine.machine.raster.cutoff,
            held,
        );
        let (point, ellipse) = (&splat.near.point, &splat.near.ellipse);
        let middle = self.eye.half_px.map(|half_px| half_px - 0.5);
        let near = unit.real(point.pixel, ellipse.conic, test.first([x, y]), middle);
        let exact = splat.footprint.leaders(test, [x, y]);
        let mut radial = (near.iter().zip(&exact)).map(|(near, exact)| near.around(*exact));
        // NaN is surely neither.
        let is_inside = |radial: Near| radial.high() < cutoff.low();
        let is_outside = |radial: Near| radial.low() >= cutoff.high();
        if splat.footprint.keeps_block([x, y]) {
            !radial.any(is_inside)
        } else {
            !radial.all(is_outside)
        }
    }
}

/// A splat that `golden` draws.
struct Reached {
    splat: u32,
    z: f64,
    /// Tiles of its box: first column and row, end column and row.
    tiles: [u16; 4],
}

/// The splats that `golden` draws, in the order of the scene.
fn reached(scene: &Scene, eye: &View, weights: Weights) -> Vec<Reached> {
    let rectangle = |index: usize| {
        let (footprint, cull) = set_up_with_cull(scene, eye, index, weights);
        let z = footprint.z();
        let (columns, rows) = (footprint.columns, footprint.rows);
        let drawn = cull.is_none() && !columns.is_empty() && !rows.is_empty();
        let [first, end] = [[columns.start, rows.start], [columns.end, rows.end]];
        let [left, top] = first.map(|pixel| (pixel as usize / TILE_PX) as u16);
        let [right, bottom] = end.map(|pixel| (pixel as usize).div_ceil(TILE_PX) as u16);
        drawn.then_some(Reached {
            splat: index as u32,
            z,
            tiles: [left, top, right, bottom],
        })
    };
    (0..scene.splats.len())
        .into_par_iter()
        .filter_map(rectangle)
        .collect()
}

/// One splat, exact and with the machine's bounds.
struct BoundedSplat {
    index: u32,
    footprint: Footprint,
    cull: Option<Cull>,
    near: NearFootprint,
    record: real::Splat<Near>,
    attributes: [Near; ATTRIBUTES],
    filled: f64,
    /// The machine's decision to turn the normal differs from golden's.
    turns_differently: bool,
    /// Windows only: the splat's own appearance.
    own: Option<SplatLight>,
}

impl BoundedSplat {
    /// Whether `golden` has this contribution at a pixel of this row. `contribution` is computed as
    /// if all pixels were reached.
    fn covers(&self, row: &FootprintRow, at: [u32; 2], contribution: &Exact) -> bool {
        self.reaches(row, at, contribution) && self.footprint.keeps_block(at)
    }

    /// The same without a test of blocks.
    fn reaches(&self, row: &FootprintRow, [x, y]: [u32; 2], contribution: &Exact) -> bool {
        let Footprint { columns, rows, .. } = &self.footprint;
        self.cull.is_none()
            && columns.contains(&x)
            && rows.contains(&y)
            && row.reaches(x, contribution)
    }
}

/// Pixels of a tile, one bit each.
type Mask = [u64; TILE_AREA / 64];

/// Result of a tile.
struct TileResult {
    led: Vec<[f64; 4]>,
    bound: Vec<f64>,
    error: Vec<f64>,
    flipped: Vec<u16>,
}

impl Default for TileResult {
    fn default() -> Self {
        TileResult {
            led: vec![[0.0; 4]; TILE_AREA],
            bound: vec![0.0; TILE_AREA],
            error: vec![0.0; TILE_AREA],
            flipped: vec![0; TILE_AREA],
        }
    }
}

/// Observes the machine and makes `golden` follow its decisions.
struct LockstepProbe<'a> {
    stage: &'a FrameContext<'a>,
    /// The pixels of the current tile; empty between tiles.
    pixels: Vec<FragmentPixel>,
    /// The pixels if fragments are grouped by sheets.
    sheets: Vec<SheetPixel>,
    /// The pixels if fragments are grouped by windows.
    windows: Vec<WindowPixel>,
    /// The current splat, boxed, as all are: they are large.
    splat: Option<Box<BoundedSplat>>,
    /// Splats of the previous tile and of the current one that continue to the right, probably into
    /// the next tile. They are set up once for both.
    continued: [BTreeMap<u32, Box<BoundedSplat>>; 2],
    /// Splats of the tile in `golden` up to the last one that was set up.
    passed: usize,
    /// Pixels of the tile that the current splat reached.
    reached: Mask,
    /// Earlier splats that reached a pixel of the tile.
    touched: Vec<u32>,
    tile: TileResult,
    tiles: BTreeMap<usize, TileResult>,
    flips: Flips,
    violations: u64,
}

impl<'a> LockstepProbe<'a> {
    fn new(stage: &'a FrameContext<'a>) -> Self {
        LockstepProbe {
            stage,
            pixels: Vec::new(),
            sheets: Vec::new(),
            windows: Vec::new(),
            splat: None,
            continued: Default::default(),
            passed: 0,
            reached: Mask::default(),
            touched: Vec::new(),
            tile: TileResult::default(),
            tiles: BTreeMap::new(),
            flips: Flips::default(),
            violations: 0,
        }
    }

    /// Runs `count` and marks the kinds that it counts at a pixel of the tile.
    fn at_pixel<T>(&mut self, pixel: usize, count: impl FnOnce(&mut Self, &mut Flips) -> T) -> T {
        let mut flips = Flips::default();
        let result = count(self, &mut flips);
        if flips.here != 0 {
            self.tile.flipped[pixel] |= flips.here;
            self.flips.absorb(&flips);
        }
        result
    }

    fn take_contribution(
        &mut self,
        splat: &BoundedSplat,
        [x, y]: [u32; 2],
        on_machine: &Contribution,
        decision: Decision,
    ) {
        let stage = self.stage;
        let pixel = in_tile(x, y);
        let row = splat.footprint.row(y);
        let exact = row.beyond(x);
        let is_covered = splat.covers(&row, [x, y], &exact);
        // A stopped pixel drops every contribution; only one that `golden` does not have is still a
        // flip.
        if self.sheets.get(pixel).is_some_and(SheetPixel::is_stopped) && is_covered {
            return;
        }
        let near = splat.near.contribution(stage.machine, stage.at(x, y));
        let depth = || {
            splat
                .near
                .depth(stage.machine, stage.at(x, y))
                .around(exact.z * stage.quantised.scale.factor())
        };
        let arrival = BoundedContribution {
            golden: Fragment::new(&splat.footprint, &exact, [x, y]),
            weight: near.weight.around(exact.weight),
            attributes: &splat.attributes,
            filled: splat.filled,
            depth_word: on_machine.depth,
            depth: OnceCell::new(),
            find_depth: &depth,
        };
        self.at_pixel(pixel, |probe, flips| {
            if splat.cull.is_some() {
                flips.cull(stage.may_cull(splat) || stage.may_cover(splat, x, y));
            } else if !is_covered {
                flips.coverage(stage.explains_more(splat, &row, [x, y], &exact));
            }
            if splat.turns_differently && stage.sheets.is_none() {
                flips.turn(splat.near.ellipse.facing_viewer.may_cross(Near::exact(0.0)));
            }
            if let (Some(rules), Some(own)) = (&stage.windows, &splat.own) {
                return probe.windows[pixel].take(
                    rules,
                    &stage.common,
                    &arrival,
                    own,
                    decision,
                    flips,
                );
            }
            match &stage.sheets {
                None => probe.pixels[pixel].take(&stage.common, &arrival, decision, flips),
                Some(rules) => {
                    probe.sheets[pixel].take(rules, &stage.common, &arrival, decision, flips)
                }
            }
        });
    }

    /// Sets a splat up that reaches a pixel, together with the next ones of the tile in `golden`,
    /// which the machine probably draws next.
    fn set_up(&mut self, splat: u32, [x, y]: [u32; 2]) -> Box<BoundedSplat> {
        let stage = self.stage;
        let bin = &stage.bins[stage.tile([x, y])];
        let (mut indices, mut count) = ([splat; BATCH], 1);
        let mut near = bin[self.passed..].iter().take(SEARCHED);
        if let Some(at) = near.position(|index| *index == splat) {
            self.passed += at + 1;
            let next = bin[self.passed..].iter().copied();
            let new = next.filter(|index| !self.continued[0].contains_key(index));
            for (place, index) in indices[1..].iter_mut().zip(new) {
                *place = index;
                count += 1;
            }
        }
        if count == 1 {
            return stage.splat(splat);
        }
        let [splat, next @ ..] = stage.splats(indices);
        let next = next.into_iter().take(count - 1);
        self.continued[0].extend(next.map(|next| (next.index, next)));
        splat
    }

    /// Ends the current splat in the tile that begins at (`left`, `top`): contributions that only
    /// `golden` has are lost.
    fn end_splat(&mut self, [left, top]: [u32; 2]) {
        let Some(splat) = self.splat.take() else {
            return;
        };
        self.touched.push(splat.index);
        if splat.cull.is_none() {
            for at in self.lost(&splat.footprint, [left, top]) {
                self.count_lost(&splat, at);
            }
        }
        self.reached = Mask::default();
        if splat.footprint.columns.end > left + TILE_PX as u32 {
            self.continued[1].insert(splat.index, splat);
        }
    }

    /// Finds contributions in the tile of splats that reached none of its pixels on the machine.
    fn find_lost(&mut self, tile: usize, [left, top]: [u32; 2]) {
        let stage = self.stage;
        let mut touched = std::mem::take(&mut self.touched);
        touched.sort_unstable();
        for &index in &stage.bins[tile] {
            if touched.binary_search(&index).is_ok() {
                continue;
            }
            let (footprint, _) = stage.footprint(index);
            let lost = self.lost(&footprint, [left, top]);
            if !lost.is_empty() {
                let splat = stage.splat(index);
                lost.into_iter().for_each(|at| self.count_lost(&splat, at));
            }
        }
    }

    /// Pixels of a tile that a splat reaches in `golden` but not on the machine.
    fn lost(&self, footprint: &Footprint, [left, top]: [u32; 2]) -> Vec<[u32; 2]> {
        let side = TILE_PX as u32;
        let mut lost = Vec::new();
        for y in footprint.rows.start.max(top)..footprint.rows.end.min(top + side) {
            let row = footprint.row(y);
            for x in footprint.columns.start.max(left)..footprint.columns.end.min(left + side) {
                let pixel = in_tile(x, y);
                if self.reached[pixel / 64] >> (pixel % 64) & 1 == 0 && row.at(x).is_some() {
                    lost.push([x, y]);
                }
            }
        }
        lost
    }

    /// Counts a contribution that only `golden` has.
    fn count_lost(&mut self, splat: &BoundedSplat, [x, y]: [u32; 2]) {
        let stage = self.stage;
        let covered = stage.may_cover(splat, x, y) || stage.may_keep_otherwise(splat, [x, y]);
        let culled = stage.may_cull(splat);
        self.at_pixel(in_tile(x, y), |_, flips| {
            if culled && !covered {
                flips.cull(true)
            } else {
                flips.coverage(covered)
            }
        });
    }

    /// Adds tiles that the machine never touched, and returns the frame.
    fn finish(mut self, covered: Vec<bool>) -> Lockstep {
        let stage = self.stage;
        let (width, height) = (stage.scene.image.width, stage.scene.image.height);
        for tile in 0..stage.bins.len() {
            let is_checked = stage.tiles.has(tile % stage.columns, tile / stage.columns);
            if is_checked && !self.tiles.contains_key(&tile) && !stage.bins[tile].is_empty() {
                self.tile = TileResult::default();
                self.tile.led.fill(stage.common.shader.background());
                let [left, top] =
                    [tile % stage.columns, tile / stage.columns].map(|at| (at * TILE_PX) as u32);
                self.find_lost(tile, [left, top]);
                self.tiles.insert(tile, std::mem::take(&mut self.tile));
            }
        }
        let pixels = width * height;
        let mut frame = Lockstep {
            tiles: stage.tiles,
            led: Picture {
                width,
                height,
                rgba: vec![stage.common.shader.background(); pixels],
                covered,
            },
            bound: vec![0.0; pixels],
            error: vec![0.0; pixels],
            flipped: vec![0; pixels],
            violations: self.violations,
            flips: self.flips,
        };
        for (index, tile) in self.tiles {
            let (left, top) = (
                index % stage.columns * TILE_PX,
                index / stage.columns * TILE_PX,
            );
            for row in 0..TILE_PX.min(height - top) {
                let columns = TILE_PX.min(width - left);
                let (to, from) = ((top + row) * width + left, row * TILE_PX);
                frame.led.rgba[to..to + columns].copy_from_slice(&tile.led[from..from + columns]);
                frame.bound[to..to + columns].copy_from_slice(&tile.bound[from..from + columns]);
                frame.error[to..to + columns].copy_from_slice(&tile.error[from..from + columns]);
                frame.flipped[to..to + columns]
                    .copy_from_slice(&tile.flipped[from..from + columns]);
            }
        }
        frame
    }
}

/// Whether a channel of a pixel exceeds its bound, or its value or bound is NaN. An infinite bound
/// allows any number.
fn violates(fixed: [f64; 4], near: [Near; 4]) -> bool {
    let keeps =
        |fixed: f64, near: Near| near.value.is_finite() && (fixed - near.value).abs() <= near.error;
    !fixed
        .into_iter()
        .zip(near)
        .all(|(fixed, near)| keeps(fixed, near))
}

/// Error and bound of a pixel's worst channels; infinite for NaN.
fn worst_channels(fixed: [f64; 4], near: [Near; 4]) -> [f64; 2] {
    let number = |x: f64| if x.is_nan() { f64::INFINITY } else { x };
    let errors = fixed
        .into_iter()
        .zip(near)
        .map(|(fixed, near)| number((fixed - near.value).abs()));
    [
        errors.fold(0.0, f64::max),
        near.into_iter()
            .map(|near| number(near.error))
            .fold(0.0, f64::max),
    ]
}

/// A pixel's index in its tile.
fn in_tile(x: u32, y: u32) -> usize {
    y as usize % TILE_PX * TILE_PX + x as usize % TILE_PX
}

/// Results of a part of the frame.
struct PartialResult {
    tiles: BTreeMap<usize, TileResult>,
    flips: Flips,
    violations: u64,
}

impl<'a> Observer<'a> for LockstepProbe<'a> {
    fn fork(&self) -> Box<dyn Observer<'a> + 'a> {
        Box::new(LockstepProbe::new(self.stage))
    }

    fn hand_over(self: Box<Self>) -> Box<dyn Any + Send> {
        Box::new(PartialResult {
            tiles: self.tiles,
            flips: self.flips,
            violations: self.violations,
        })
    }

    fn take_over(&mut self, seen: Box<dyn Any + Send>) {
        if let Ok(part) = seen.downcast::<PartialResult>() {
            self.tiles.extend(part.tiles);
            self.flips.absorb(&part.flips);
            self.violations += part.violations;
        }
    }

    fn contribution(&mut self, x: u32, y: u32, contribution: &Contribution, decision: Decision) {
        if !self.stage.is_checked(x, y) {
            return;
        }
        if self.stage.sheets.is_some() && self.sheets.is_empty() {
            self.sheets = vec![SheetPixel::default(); TILE_AREA];
        }
        if self.stage.windows.is_some() && self.windows.is_empty() {
            self.windows = vec![WindowPixel::default(); TILE_AREA];
        }
        if self.stage.sheets.is_none() && self.stage.windows.is_none() && self.pixels.is_empty() {
            self.pixels = vec![FragmentPixel::default(); TILE_AREA];
        }
        let splat = match self.splat.take() {
            Some(splat) if splat.index == contribution.splat => splat,
            other => {
                self.splat = other;
                self.end_splat([x, y].map(|at| at - at % TILE_PX as u32));
                match self.continued[0].remove(&contribution.splat) {
                    Some(splat) => splat,
                    None => self.set_up(contribution.splat, [x, y]),
                }
            }
        };
        let pixel = in_tile(x, y);
        self.reached[pixel / 64] |= 1 << (pixel % 64);
        self.take_contribution(&splat, [x, y], contribution, decision);
        self.splat = Some(splat);
    }

    fn windows(&mut self, x: u32, y: u32, starts: u8) {
        if let Some(pixel) = self.windows.get_mut(in_tile(x, y)) {
            pixel.start(starts);
        }
    }

    fn resolved(&mut self, x: u32, y: u32, layers: &[Layer], frame: [i64; 4]) {
        if !self.stage.is_checked(x, y) {
            return;
        }
        let pixel = in_tile(x, y);
        let near = self.at_pixel(pixel, |probe, flips| {
            if let Some(rules) = &probe.stage.sheets {
                let nothing = SheetPixel::default();
                return probe
                    .sheets
                    .get(pixel)
                    .unwrap_or(&nothing)
                    .resolve(rules, &probe.stage.common);
            }
            if let Some(rules) = &probe.stage.windows {
                let mut window = probe
                    .windows
                    .get_mut(pixel)
                    .map(std::mem::take)
                    .unwrap_or_default();
                return window.resolve(rules, &probe.stage.common, flips);
            }
            let nothing = FragmentPixel::default();
            let fragments = probe.pixels.get(pixel).unwrap_or(&nothing);
            fragments.resolve(
                &probe.stage.common,
                layers.iter().map(|layer| layer.slot),
                flips,
            )
        });
        let format = self.stage.machine.machine.resolve.frame.format;
        let fixed = frame.map(|word| format.value(word));
        let [error, bound] = worst_channels(fixed, near);
        self.violations += u64::from(violates(fixed, near));
        self.tile.led[pixel] = near.map(|channel| channel.value);
        self.tile.bound[pixel] = bound;
        self.tile.error[pixel] = error;
    }

    fn tile(&mut self, x: u32, y: u32) {
        if !self.stage.is_checked(x, y) {
            return;
        }
        self.pixels.iter_mut().for_each(FragmentPixel::clear);
        self.sheets = Vec::new();
        self.windows = Vec::new();
        self.end_splat([x, y]);
        let index = self.stage.tile([x, y]);
        self.passed = 0;
        self.find_lost(index, [x, y]);
        self.continued.swap(0, 1);
        self.continued[1].clear();
        self.tiles.insert(index, std::mem::take(&mut self.tile));
    }
}

#[cfg(test)]
mod tests;

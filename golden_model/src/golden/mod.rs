//! Golden: draws in f64 the picture that the machine should draw (`golden`), and the best possible
//! one (`ideal`) (docs/book/algorithm-resolve.md §8).
//! ```text
//! splats ─► [footprint] ─► [tiles] ─► contributions ─┬─► [fragments]: at most l layers/pixel ───┬─► [shade] ─► picture
//!                                                    └─► [ideal]: every surface there is ───────┘
//! ```
//! `golden − ideal` is the method's error (grouping and merging); the machine adds only arithmetic
//! errors to it.
//!
//! Deliberately absent: the machine's crate. The checker shares no code with the checked.
//!
//! Laws (tests/golden_laws.rs, tests/golden_match.rs): `outcomes_sum_to_fragments`,
//! `ideal_does_not_depend_on_the_order_of_splats`, `enough_layers_make_golden_equal_ideal`,
//! `replace_is_a_z_buffer`, `two_threads_draw_what_one_draws`.

pub mod footprint;
pub mod fragments;
mod ideal;
pub(crate) mod intervals;
pub mod lists;
mod pixel_trace;
pub(crate) mod reflection;
pub mod shade;
pub mod sheets;
pub mod tiles;
pub mod window;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use crate::output::picture::Picture;
use crate::scene::{Amplitude, Kernel, Scene, Sheet, gaussian_cutoff};

use footprint::Weights;
use fragments::{Fragment, FragmentPainter};
use ideal::IdealPainter;
use intervals::Spanning;
use shade::Shader;

pub use fragments::{Decision, Merge, Side};
pub use lists::{KeptLists, ListMemory};
pub use pixel_trace::{PixelTrace, TracedContribution, TracedLayer, pixel_trace};
pub use reflection::{Reflected, Reflection, octahedral};
pub use window::density as window_density;

/// Rules of the fragment unit (docs/book/algorithm.md §6).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// `l`, 1 to 8: fragments that one pixel can hold.
    pub layers: usize,
    /// Which two fragments are merged when a pixel overflows.
    pub merge: Merge,
    /// On overflow, drop the deepest fragment if an opaque one is in front of it.
    pub evict_hidden: bool,
    /// Turn each splat's normal towards the viewer before it is summed, as [`ideal`] always does.
    pub turn_normals: bool,
    /// Opacity from which a fragment hides everything behind it.
    pub opaque: f64,
    /// The depth that contributions are compared with.
    pub fragment_depth: FragmentDepth,
    /// Which contributions are accumulated into one fragment.
    pub group: Group,
    /// Options of [`Merge::Window`].
    pub window: WindowOptions,
    /// The Gaussians of a pixel are summed, in any order.
    pub sums_gaussians: bool,
    /// Weights of summed Gaussians fall with depth ([`Scene::weight_distance`]).
    pub weights_fall_with_depth: bool,
    /// How surroundings are mirrored; none: exactly, as [`ideal`] always does.
    pub reflection: Option<Reflection>,
    /// Gaussians only: how lists are kept from frame to frame; none: every list is sorted, as
    /// [`ideal`] always does.
    pub lists: Option<KeptLists>,
    /// Gaussians only: how blocks of pixels are tested; none: every block is drawn, as [`ideal`]
    /// always does.
    pub blocks: Option<BlockTest>,
}

/// A test of blocks of pixels by r at a few of their pixels, the leaders: a Gaussian is not drawn in
/// a block if none of the leaders is inside of its footprint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockTest {
    /// Side of a block, pixels; blocks are aligned to the picture.
    pub side_px: u32,
    /// The leaders are two opposite corners, not all four.
    pub diagonal: bool,
    /// The footprint ends where no weight of the Gaussian's opacity counts, not at the cutoff of
    /// the frame.
    pub by_opacity: bool,
}

impl Default for Rules {
    /// The rules of the named machines: three layers, the two deepest merge, hidden fragments are
    /// dropped first.
    fn default() -> Self {
        Rules {
            layers: 3,
            merge: Merge::FarthestPair,
            evict_hidden: true,
            turn_normals: true,
            opaque: 0.999,
            fragment_depth: FragmentDepth::First,
            group: Group::First,
            window: WindowOptions::default(),
            sums_gaussians: false,
            weights_fall_with_depth: false,
            reflection: None,
            lists: None,
            blocks: None,
        }
    }
}

impl Rules {
    /// Whether grouping and merging are compatible: windows need fragments that store their depths
    /// ([`Group::Interval`] or [`Group::Window`]), and clusters of [`Group::Window`] need a rule
    /// that makes windows of them. If they are not, [`render`] draws by [`Merge::Window`].
    pub fn is_legal(&self) -> bool {
        match self.group {
            Group::First => self.merge != Merge::Window,
            Group::Interval => true,
            Group::Window => self.merge == Merge::Window,
        }
    }
}

/// Which contributions are accumulated into one fragment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// Contributions within ε of the fragment's depth (SS §6).
    First,
    /// Contributions whose depths together are narrower than ε.
    Interval,
    /// Small clusters, summed while they certainly belong to one window of ε; the windows are
    /// formed at the end, starting at the nearest depth.
    Window,
}

/// Options of [`Merge::Window`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WindowOptions {
    /// A contribution joins a cluster that stays narrower than this many ε. At 0 it joins only if
    /// the cluster already spans its depth. [`Group::Interval`] always joins at 1.
    pub join: f64,
    /// Closed fragments take late contributions to their front and their back.
    pub late: bool,
    /// Closed fragments take contributions between their front and their back.
    pub inside: bool,
}

impl Default for WindowOptions {
    fn default() -> Self {
        WindowOptions {
            join: 0.0,
            late: true,
            inside: true,
        }
    }
}

/// The depth of a fragment that contributions are compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FragmentDepth {
    /// Depth of its first contribution.
    First,
    /// Depth of its nearest contribution so far.
    Nearest,
}

/// [`Rendering::fragments`] of the picture by [`render`], counted row by row instead of drawn.
/// Pixels whose centres are on the rim of a footprint may differ. Weights below `least_weight` do
/// not count.
pub fn contributions(scene: &Scene, least_weight: f64) -> u64 {
    let view = scene.view();
    let weights = Weights::at_least(scene.least_weight().max(least_weight));
    let area = |index: usize| {
        footprint::set_up(scene, &view, index, weights).map_or(0, |footprint| footprint.area())
    };
    (0..scene.splats.len()).into_par_iter().map(area).sum()
}

/// A picture and the work it took.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendering {
    /// The picture over the background.
    pub picture: Picture,
    /// Splats that left no footprint, by reason.
    pub culled: Culled,
    /// Contributions: pixels touched, counted once per splat.
    pub fragments: u64,
    /// Outcomes of the contributions.
    pub outcomes: Outcomes,
}

/// Splats that left no footprint; each is counted once, by the first reason that holds in this
/// order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Culled {
    /// At or in front of the near plane.
    pub near: u64,
    /// The box misses the picture, or the centre lies too far to the side for the affine
    /// approximation.
    pub outside: u64,
    /// Opacity below the smallest weight that counts, if opacity is the splat's greatest weight.
    pub transparent: u64,
    /// Turned away from the eye, if such splats are to be culled.
    pub backface: u64,
    /// Seen edge-on, or without weight.
    pub faint: u64,
}

/// Outcomes of the contributions. Each contribution has one: all fields except the two maxima per
/// pixel sum to [`Rendering::fragments`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Outcomes {
    /// Added to a fragment (in `ideal`: to a surface).
    pub accumulated: u64,
    /// Opened a fragment (in `ideal`: a surface).
    pub inserted: u64,
    /// Overflowed the pixel: two fragments became one.
    pub merged: u64,
    /// Overflowed the pixel: a hidden fragment was dropped, possibly the new one itself.
    pub evicted: u64,
    /// Nearer than the z-buffer: replaced it.
    pub replaced: u64,
    /// Deeper than the z-buffer: lost.
    pub dropped: u64,
    /// Added to a closed fragment's front or back.
    #[serde(skip_serializing_if = "is_none")]
    pub late: u64,
    /// Blended between a closed fragment's front and back.
    #[serde(skip_serializing_if = "is_none")]
    pub inside: u64,
    /// Overflowed the pixel: two fragments of one window were summed.
    #[serde(skip_serializing_if = "is_none")]
    pub summed: u64,
    /// Contributions of the pixel with the most.
    pub most_in_a_pixel: u64,
    /// Surfaces of the pixel with the most (in `golden`: layers in use at the end).
    pub most_surfaces_in_a_pixel: u64,
}

/// Whether a count is left out: only [`Merge::Window`] has these outcomes.
#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "the signature that serde requires"
)]
fn is_none(count: &u64) -> bool {
    *count == 0
}

impl Outcomes {
    /// The contributions that these outcomes account for.
    pub fn total(&self) -> u64 {
        self.accumulated
            + self.inserted
            + self.merged
            + self.evicted
            + self.replaced
            + self.dropped
            + self.late
            + self.inside
            + self.summed
    }

    fn count(&mut self, decision: Decision) {
        *match decision {
            Decision::Accumulated { .. } => &mut self.accumulated,
            Decision::Inserted { .. } => &mut self.inserted,
            Decision::Merged { .. } | Decision::Closed { .. } => &mut self.merged,
            Decision::Late { .. } => &mut self.late,
            Decision::Inside { .. } => &mut self.inside,
            Decision::Summed { .. } => &mut self.summed,
            Decision::Evicted { .. } => &mut self.evicted,
            Decision::Replaced => &mut self.replaced,
            Decision::Dropped => &mut self.dropped,
        } += 1;
    }

    fn and(self, other: Outcomes) -> Outcomes {
        Outcomes {
            accumulated: self.accumulated + other.accumulated,
            inserted: self.inserted + other.inserted,
            merged: self.merged + other.merged,
            evicted: self.evicted + other.evicted,
            replaced: self.replaced + other.replaced,
            dropped: self.dropped + other.dropped,
            late: self.late + other.late,
            inside: self.inside + other.inside,
            summed: self.summed + other.summed,
            most_in_a_pixel: self.most_in_a_pixel.max(other.most_in_a_pixel),
            most_surfaces_in_a_pixel: self
                .most_surfaces_in_a_pixel
                .max(other.most_surfaces_in_a_pixel),
        }
    }
}

/// Renderer `golden`: the hardware's algorithm with the same rules and in the same order, in f64.
pub fn render(scene: &Scene, rules: &Rules) -> Rendering {
    render_with(scene, rules, None)
}

/// [`render`] of the frame of a sequence after those that are in `memory`, to which it is added.
pub fn render_next(scene: &Scene, rules: &Rules, memory: &mut ListMemory) -> Rendering {
    render_with(scene, rules, Some(memory))
}

fn render_with(scene: &Scene, rules: &Rules, memory: Option<&mut ListMemory>) -> Rendering {
    let shader = Shader::of(scene, rules);
    match scene.sheets_for(rules.sums_gaussians) {
        Some(sheets) if sheets.of == Sheet::Splat && rules.blocks.is_some() => {
            tiles::draw_tested(scene, &shader, (rules, memory), || {
                sheets::SheetPainter::new(&sheets, shader.background())
            })
        }
        Some(sheets) => tiles::draw(
            scene,
            &shader,
            (rules.turn_normals, rules.lists.map(|lists| (lists, memory))),
            Weights::of(scene, rules),
            || sheets::SheetPainter::new(&sheets, shader.background()),
        ),
        None => surfaces(scene, &shader, rules),
    }
}

fn surfaces(scene: &Scene, shader: &Shader, rules: &Rules) -> Rendering {
    let (turn, z_threshold) = (rules.turn_normals, scene.surface.z_threshold);
    match (rules.group, rules.merge) {
        (_, Merge::Window) | (Group::Window, _) => window::draw(scene, shader, rules),
        (Group::First, _) => tiles::draw(scene, shader, (turn, None), Weights::default(), || {
            FragmentPainter::<Fragment>::new(rules, z_threshold, shader)
        }),
        (Group::Interval, _) => {
            tiles::draw(scene, shader, (turn, None), Weights::default(), || {
                FragmentPainter::<Spanning>::new(rules, z_threshold, shader)
            })
        }
    }
}

/// Renderer `ideal`: as many fragments as there are surfaces, independent of the order of the
/// splats, with normals turned towards the viewer. Contributions of volumes and of Gaussians are
/// blended one by one in depth order. Every leaf of a tree is drawn, whatever the cut. Gaussians
/// extend at least to the limit of visibility on an 8-bit screen, whatever the scene's cutoff.
pub fn ideal(scene: &Scene) -> Rendering {
    ideal_of(scene, true)
}

/// [`ideal`], with normals turned or not: the best possible picture for a machine that does not
/// turn them.
pub fn ideal_of(scene: &Scene, turn_normals: bool) -> Rendering {
    // Level of detail is part of the method's error.
    if let Some(full) = scene.full() {
        return ideal_of(&full, turn_normals);
    }
    let least = gaussian_cutoff();
    if scene.is_of_gaussians() && scene.kernel.cutoff < least {
        let kernel = Kernel {
            cutoff: least,
            ..scene.kernel
        };
        return ideal_of(
            &Scene {
                kernel,
                ..scene.clone()
            },
            turn_normals,
        );
    }
    let shader = Shader::new(scene);
    // An ellipsoid, unlike a disc, has the depth of its centre everywhere.
    let is_in_order = (scene.ellipsoids.as_ref())
        .is_some_and(|ellipsoids| ellipsoids.sorted && ellipsoids.amplitude != Amplitude::Disc);
    match &scene.sheets {
        Some(sheets) if is_in_order => tiles::draw(
            scene,
            &shader,
            (turn_normals, None),
            Weights::default(),
            || sheets::IdealOrderedPainter::new(sheets, shader.background()),
        ),
        Some(sheets) => tiles::draw(
            scene,
            &shader,
            (turn_normals, None),
            Weights::default(),
            || sheets::IdealSheetPainter::new(sheets, shader.background()),
        ),
        None => tiles::draw(
            scene,
            &shader,
            (turn_normals, None),
            Weights::default(),
            || IdealPainter::new(scene.surface.z_threshold, &shader),
        ),
    }
}

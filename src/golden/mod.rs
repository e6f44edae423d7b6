//! Golden: draws in f64 what the machine should draw, and what no machine could draw better (docs/book/algorithm.md §8).
//! ```text
//! splats ─► [footprint] ─► [tiles] ─► contributions ─┬─► [fragments]: at most l layers a pixel ─┬─► [shade] ─► picture
//!                                                    └─► [ideal]: every surface there is ───────┘
//! ```
//! `golden − ideal` is the method's error (grouping and merging); what the machine adds to it is arithmetic.
//!
//! Absent on purpose: the machine's crate. The checker shares no code with the checked.
//!
//! Laws (tests/golden_laws.rs, tests/golden_match.rs): `outcomes_sum_to_fragments`, `ideal_does_not_depend_on_the_order_of_splats`,
//! `enough_layers_make_golden_equal_ideal`, `replace_is_a_z_buffer`, `two_threads_draw_what_one_draws`.

pub(crate) mod footprint;
pub(crate) mod fragments;
mod ideal;
pub(crate) mod shade;
pub(crate) mod sheets;
mod story;
pub(crate) mod tiles;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use crate::output::picture::Picture;
use crate::scene::{Kernel, Scene, Sheet, gaussian_cutoff};

use fragments::Golden;
use ideal::Ideal;
use shade::Shader;

pub use fragments::{Decision, Merge};
pub use story::{Arrival, Layer, Story, story};

/// Rules of the fragment unit (docs/book/algorithm.md §6).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// `l`, 1 to 8: fragments that one pixel can hold.
    pub layers: usize,
    /// Which two fragments become one when a pixel overflows.
    pub merge: Merge,
    /// On overflow, drop the deepest fragment if something opaque lies in front of it.
    pub evict_hidden: bool,
    /// Each splat's normal is turned towards the viewer before it is summed, as [`ideal`] always does.
    pub turn_normals: bool,
    /// From which opacity a fragment hides what lies behind it.
    pub opaque: f64,
    /// The depth that a fragment answers to.
    pub fragment_depth: FragmentDepth,
}

impl Default for Rules {
    /// What the named machines do: three layers, the two deepest merge, hidden fragments leave first.
    fn default() -> Self {
        Rules {
            layers: 3,
            merge: Merge::FarthestPair,
            evict_hidden: true,
            turn_normals: true,
            opaque: 0.999,
            fragment_depth: FragmentDepth::First,
        }
    }
}

/// The depth that a fragment answers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FragmentDepth {
    /// That of its first contribution.
    First,
    /// That of its nearest contribution so far.
    Nearest,
}

/// [`Rendering::fragments`] of what [`render`] would draw, counted row by row instead of drawn: to within pixels whose centres lie on
/// the rim of a footprint. Weights below `least_weight` do not count.
pub fn contributions(scene: &Scene, least_weight: f64) -> u64 {
    let view = scene.view();
    let area = |index: usize| {
        footprint::set_up(scene, &view, index, scene.least_weight().max(least_weight)).map_or(0, |footprint| footprint.area())
    };
    (0..scene.splats.len()).into_par_iter().map(area).sum()
}

/// A picture and the work that it took.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendering {
    /// Over the background.
    pub picture: Picture,
    /// Splats that left no footprint, by reason.
    pub culled: Culled,
    /// Contributions: pixels touched, once for each splat.
    pub fragments: u64,
    /// Outcomes of the contributions.
    pub outcomes: Outcomes,
}

/// Splats that left no footprint; each is counted once, by the first reason that holds in this order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Culled {
    /// At or before the near plane.
    pub near: u64,
    /// The box misses the picture, or the centre lies too far to the side for the affine approximation.
    pub outside: u64,
    /// Of less opacity than the least weight that counts, where that is its greatest.
    pub transparent: u64,
    /// Turned away from the eye, where that is asked for.
    pub backface: u64,
    /// Seen edge-on, or of no weight.
    pub faint: u64,
}

/// Outcomes of the contributions. Each has one: the first six sum to [`Rendering::fragments`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Outcomes {
    /// Added to a fragment (in `ideal`: to a surface).
    pub accumulated: u64,
    /// Opened a fragment (in `ideal`: a surface).
    pub inserted: u64,
    /// Overflowed the pixel: two fragments became one.
    pub merged: u64,
    /// Overflowed the pixel: a hidden fragment was dropped, perhaps the new one itself.
    pub evicted: u64,
    /// Nearer than the z-buffer: took its place.
    pub replaced: u64,
    /// Deeper than the z-buffer: lost.
    pub dropped: u64,
    /// Contributions of the busiest pixel.
    pub most_in_a_pixel: u64,
    /// Surfaces of the deepest pixel (in `golden`: layers that were in use at the end).
    pub most_surfaces_in_a_pixel: u64,
}

impl Outcomes {
    /// The contributions that these outcomes account for.
    pub fn total(&self) -> u64 {
        self.accumulated + self.inserted + self.merged + self.evicted + self.replaced + self.dropped
    }

    fn count(&mut self, decision: Decision) {
        *match decision {
            Decision::Accumulated { .. } => &mut self.accumulated,
            Decision::Inserted { .. } => &mut self.inserted,
            Decision::Merged { .. } => &mut self.merged,
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
            most_in_a_pixel: self.most_in_a_pixel.max(other.most_in_a_pixel),
            most_surfaces_in_a_pixel: self.most_surfaces_in_a_pixel.max(other.most_surfaces_in_a_pixel),
        }
    }
}

/// Renderer `golden`: the hardware's own algorithm, same rules and same order, in f64.
pub fn render(scene: &Scene, rules: &Rules) -> Rendering {
    let shader = Shader::new(scene);
    match &scene.sheets {
        Some(sheets) => {
            tiles::draw(scene, &shader, rules.turn_normals, sheets.least_weight, || sheets::Golden::new(sheets, shader.background()))
        }
        None => tiles::draw(scene, &shader, rules.turn_normals, 0.0, || Golden::new(rules, scene.surface.z_threshold, &shader)),
    }
}

/// Renderer `ideal`: as many fragments as there are surfaces, whatever the order of the splats, of normals turned towards the viewer; or every contribution of a volume or of
/// Gaussians by itself, in the order of depth. Gaussians reach at least as far as a screen of 8 bits shows them, whatever the scene's cutoff.
pub fn ideal(scene: &Scene) -> Rendering {
    ideal_of(scene, true)
}

/// [`ideal`], of normals turned or as they are: how far a machine that does not turn them is from what its sums could be at best.
pub fn ideal_of(scene: &Scene, turn_normals: bool) -> Rendering {
    let least = gaussian_cutoff();
    if scene.sheets.as_ref().is_some_and(|sheets| sheets.of == Sheet::Splat) && scene.kernel.cutoff < least {
        let kernel = Kernel { cutoff: least, ..scene.kernel };
        return ideal_of(&Scene { kernel, ..scene.clone() }, turn_normals);
    }
    let shader = Shader::new(scene);
    match &scene.sheets {
        Some(sheets) => tiles::draw(scene, &shader, turn_normals, 0.0, || sheets::Ideal::new(sheets, shader.background())),
        None => tiles::draw(scene, &shader, turn_normals, 0.0, || Ideal::new(scene.surface.z_threshold, &shader)),
    }
}

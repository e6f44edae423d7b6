//! Pixel trace: everything that happened at one pixel of `golden`, recorded by the code that draws
//! it.

use super::footprint::{self, Footprint, Weights};
use super::fragments::{Fragment, FragmentPainter, Slot, resolve};
use super::intervals::Spanning;
use super::lists::KeptLists;
use super::reflection::Reflected;
use super::shade::{Shader, over};
use super::sheets::{SheetOutcome, SheetState};
use super::tiles::put_in_order;
use super::window::{self, WindowPainter};
use super::{BlockTest, Decision, Group, Merge, Rules};
use crate::scene::{Scene, Sheet, Sheets};
use glam::DVec4;

/// Trace of one pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct PixelTrace {
    /// Contributions to the pixel, in drawing order.
    pub contributions: Vec<TracedContribution>,
    /// Layers at the end, front to back.
    pub layers: Vec<TracedLayer>,
    /// The pixel as in the picture: linear, premultiplied, over the background.
    pub rgba: [f64; 4],
}

/// One contribution and its outcome.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TracedContribution {
    /// Index of its splat in the scene.
    pub splat: usize,
    /// `r` at the pixel's centre.
    pub radial_index: f64,
    /// `w`.
    pub weight: f64,
    /// Depth of the splat's plane at the pixel, world units.
    pub z: f64,
    /// Decision about it, with the slot.
    pub decision: Decision,
}

/// One layer at the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TracedLayer {
    /// Its slot.
    pub slot: usize,
    /// `Σw`; for a layer that a merge shaded, that of its front.
    pub weight: f64,
    /// `Σw·rgb`; for a shaded layer its premultiplied colour.
    pub rgb: [f64; 3],
    /// `Σw·α`; for a shaded layer its α.
    pub alpha: f64,
    /// `Σw·n`, camera space; for a shaded layer that of its front.
    pub normal: [f64; 3],
    /// Its depth, world units.
    pub z: f64,
    /// Index into the scene's materials.
    pub material: u32,
    /// Whether a merge had already shaded it.
    pub shaded: bool,
    /// Its final colour, premultiplied by its coverage.
    pub colour: [f64; 3],
    /// Its final coverage α'.
    pub coverage: f64,
    /// Reflected light; none if a merge had already shaded the layer.
    pub mirrored: Option<Reflected>,
}

impl TracedLayer {
    fn new(slot: usize, fragment: &Fragment, shader: &Shader) -> Self {
        let premultiplied = shader.premultiplied(fragment);
        TracedLayer {
            slot,
            weight: fragment.weight,
            rgb: fragment.rgb.to_array(),
            alpha: fragment.alpha,
            normal: fragment.normal.to_array(),
            z: fragment.z,
            material: fragment.material,
            shaded: fragment.shaded,
            colour: premultiplied.truncate().to_array(),
            coverage: premultiplied.w,
            mirrored: shader.mirrored(fragment),
        }
    }
}

/// Traces [`super::render`] at pixel (x, y). The trace of a pixel outside the picture is empty.
///
/// If fragments are grouped by sheets, slot 1 is the open sheet and slot 0 the composite of the
/// sheets before it. Only the composite is left at the end.
pub fn pixel_trace(scene: &Scene, rules: &Rules, x: usize, y: usize) -> PixelTrace {
    let shader = Shader::of(scene, rules);
    if let Some(sheets) = scene.sheets_for(rules.sums_gaussians) {
        let blocks = rules.blocks.filter(|_| sheets.of == Sheet::Splat);
        let how = (blocks, rules.lists, Weights::of(scene, rules));
        return of_sheets(scene, &sheets, &shader, how, [x as u32, y as u32]);
    }
    let pixel = [x as u32, y as u32];
    match (rules.group, rules.merge) {
        (_, Merge::Window) | (Group::Window, _) => of_windows(scene, &shader, rules, pixel),
        (Group::First, _) => of_fragments::<Fragment>(scene, &shader, rules, pixel),
        (Group::Interval, _) => of_fragments::<Spanning>(scene, &shader, rules, pixel),
    }
}

fn of_fragments<S: Slot>(
    scene: &Scene,
    shader: &Shader,
    rules: &Rules,
    pixel: [u32; 2],
) -> PixelTrace {
    let mut golden = FragmentPainter::<S>::new(rules, scene.surface.z_threshold, shader);
    let contributions = contributions(
        scene,
        shader,
        (rules.turn_normals, None, None),
        Weights::at_least(scene.least_weight()),
        pixel,
        |_, fragment| golden.decide(0, fragment),
    );
    let slots = golden.fragments(0);
    let mut layers: Vec<TracedLayer> = slots
        .iter()
        .enumerate()
        .map(|(slot, state)| TracedLayer::new(slot, state.fragment(), shader))
        .collect();
    layers.sort_by(|a, b| a.z.total_cmp(&b.z));
    PixelTrace {
        contributions,
        layers,
        rgba: resolve(shader, slots),
    }
}

/// An open layer is reported by its sums, a closed one by its colour and the weight of its front;
/// both at their nearest depth.
fn of_windows(scene: &Scene, shader: &Shader, rules: &Rules, pixel: [u32; 2]) -> PixelTrace {
    let z_threshold = scene.surface.z_threshold;
    let mut pixels = WindowPainter::new(rules, z_threshold, shader);
    let contributions = contributions(
        scene,
        shader,
        (rules.turn_normals, None, None),
        Weights::at_least(scene.least_weight()),
        pixel,
        |footprint, sums| {
            pixels.decide(
                0,
                &window::LitContribution {
                    sums,
                    colour: shader.emission(footprint),
                    opacity: footprint.opacity,
                },
            )
        },
    );
    let slots = pixels.layers(0);
    let as_fragment = |layer: &window::Layer| match layer {
        window::Layer::Open(open) => Fragment {
            z: open.span.near,
            ..open.sums
        },
        window::Layer::Closed(closed) => Fragment {
            weight: closed.front.weight,
            rgb: closed.colour.truncate(),
            alpha: closed.colour.w,
            z: closed.near(),
            shaded: true,
            ..Fragment::default()
        },
    };
    let mut layers: Vec<TracedLayer> = slots
        .iter()
        .enumerate()
        .map(|(slot, state)| TracedLayer::new(slot, &as_fragment(state), shader))
        .collect();
    layers.sort_by(|a, b| a.z.total_cmp(&b.z));
    PixelTrace {
        contributions,
        layers,
        rgba: window::Window::new(rules, z_threshold, shader).resolve(slots),
    }
}

fn of_sheets(
    scene: &Scene,
    sheets: &Sheets,
    shader: &Shader,
    (blocks, lists, weights): (Option<BlockTest>, Option<KeptLists>, Weights),
    at: [u32; 2],
) -> PixelTrace {
    let mut pixel = SheetState::default();
    let contributions = contributions(
        scene,
        shader,
        (false, blocks, lists),
        weights,
        at,
        |_, fragment| match pixel.take(sheets, &fragment) {
            SheetOutcome::Added => Decision::Accumulated { slot: 1 },
            SheetOutcome::First => Decision::Inserted {
                slot: usize::from(sheets.of != Sheet::Splat),
            },
            SheetOutcome::Next => Decision::Merged { slot: 0, place: 1 },
            SheetOutcome::Dropped => Decision::Dropped,
        },
    );
    let colour = pixel.colour(sheets);
    let all = Fragment {
        rgb: colour.truncate(),
        alpha: colour.w,
        shaded: true,
        ..Fragment::default()
    };
    let layers = if contributions.is_empty() {
        Vec::new()
    } else {
        vec![TracedLayer::new(0, &all, shader)]
    };
    PixelTrace {
        contributions,
        layers,
        rgba: over(colour, DVec4::from_array(shader.background())).to_array(),
    }
}

/// Passes all contributions to the pixel to `take`, in drawing order.
fn contributions(
    scene: &Scene,
    shader: &Shader,
    (turn_normals, blocks, lists): (bool, Option<BlockTest>, Option<KeptLists>),
    weights: Weights,
    [x, y]: [u32; 2],
    mut decide: impl FnMut(&Footprint, Fragment) -> Decision,
) -> Vec<TracedContribution> {
    let view = scene.view();
    let footprints = (0..scene.splats.len())
        .filter_map(|index| footprint::set_up(scene, &view, index, weights).ok());
    let here =
        |footprint: &Footprint| footprint.columns.contains(&x) && footprint.rows.contains(&y);
    // The order of kept lists depends on splats elsewhere.
    let (mut touching, order): (Vec<Footprint>, _) = match lists {
        None => (footprints.filter(here).collect(), None),
        Some(lists) => {
            let all: Vec<Footprint> = footprints.collect();
            let order = lists.order(scene, (weights.least, None), &all);
            let of_tile = order
                .as_ref()
                .map(|order| order.around([x as usize, y as usize]));
            let splats: Option<Vec<u32>> =
                of_tile.map(|tile| tile.iter().map(|nth| all[*nth as usize].splat).collect());
            (all.into_iter().filter(here).collect(), splats)
        }
    };
    for footprint in &mut touching {
        footprint.blocks = blocks;
    }
    if turn_normals {
        touching.iter_mut().for_each(Footprint::turn_normal);
    }
    put_in_order(scene, shader, &mut touching);
    if let Some(order) = order {
        touching.sort_by_key(|footprint| order.iter().position(|splat| *splat == footprint.splat));
    }
    let contributions = touching.iter().filter_map(|footprint| {
        let contribution = footprint.row(y).at(x)?;
        let decision = decide(footprint, Fragment::new(footprint, &contribution, [x, y]));
        let (splat, z) = (footprint.splat as usize, contribution.z);
        Some(TracedContribution {
            splat,
            radial_index: contribution.radial_index,
            weight: contribution.weight,
            z,
            decision,
        })
    });
    contributions.collect()
}

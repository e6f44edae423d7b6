//! Story: everything that happened at one pixel of `golden`, told by the code that draws it.

use super::footprint;
use super::fragments::{Fragment, Golden};
use super::shade::Shader;
use super::{Decision, Rules};
use crate::scene::Scene;

/// One pixel's life.
#[derive(Clone, Debug, PartialEq)]
pub struct Story {
    /// What reached the pixel, in splat order.
    pub arrivals: Vec<Arrival>,
    /// What was left at the end, front to back.
    pub layers: Vec<Layer>,
    /// The pixel, as in the picture: linear, premultiplied, over the background.
    pub rgba: [f64; 4],
}

/// One contribution and what became of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// Index of its splat in the scene.
    pub splat: usize,
    /// `r` at the pixel's centre.
    pub radial_index: f64,
    /// `w`.
    pub weight: f64,
    /// Depth of the splat's plane at the pixel, world units.
    pub z: f64,
    /// What was done with it, and where.
    pub decision: Decision,
}

/// One layer at the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layer {
    /// The slot that it held.
    pub slot: usize,
    /// `Σw`; of a layer that a merge shaded, that of its front.
    pub weight: f64,
    /// `Σw·rgb`; of a shaded layer its premultiplied colour.
    pub rgb: [f64; 3],
    /// `Σw·α`; of a shaded layer its α.
    pub alpha: f64,
    /// `Σw·n`, camera space; of a shaded layer that of its front.
    pub normal: [f64; 3],
    /// The depth that it answers to, world units.
    pub z: f64,
    /// Index into the scene's materials.
    pub material: u32,
    /// Whether a merge had shaded it already.
    pub shaded: bool,
    /// Its final colour, premultiplied by its coverage.
    pub colour: [f64; 3],
    /// Its final coverage α'.
    pub coverage: f64,
}

impl Layer {
    fn new(slot: usize, fragment: &Fragment, shader: &Shader) -> Self {
        let premultiplied = shader.premultiplied(fragment);
        Layer {
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
        }
    }
}

/// Tells what [`super::render`] does at pixel (x, y). A pixel outside of the picture has an empty story.
pub fn story(scene: &Scene, rules: &Rules, x: usize, y: usize) -> Story {
    let shader = Shader::new(scene);
    let mut golden = Golden::new(rules, scene.surface.z_threshold, &shader);
    let arrivals = arrivals(scene, x as u32, y as u32, &mut golden);
    let fragments = golden.fragments(0);
    let mut layers: Vec<Layer> = fragments.iter().enumerate().map(|(slot, fragment)| Layer::new(slot, fragment, &shader)).collect();
    layers.sort_by(|a, b| a.z.total_cmp(&b.z));
    Story { arrivals, layers, rgba: shader.resolve(fragments) }
}

/// Sends everything that reaches the pixel to the painter's pixel 0.
fn arrivals(scene: &Scene, x: u32, y: u32, golden: &mut Golden) -> Vec<Arrival> {
    let view = scene.view();
    let footprints = (0..scene.splats.len()).filter_map(|index| footprint::set_up(scene, &view, index).ok());
    let touching = footprints.filter(|footprint| footprint.columns.contains(&x) && footprint.rows.contains(&y));
    let arrivals = touching.filter_map(|footprint| {
        let contribution = footprint.row(y).at(x)?;
        let decision = golden.decide(0, Fragment::new(&footprint, &contribution));
        let (splat, z) = (footprint.splat as usize, contribution.z);
        Some(Arrival { splat, radial_index: contribution.radial_index, weight: contribution.weight, z, decision })
    });
    arrivals.collect()
}

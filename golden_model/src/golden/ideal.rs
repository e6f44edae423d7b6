//! Ideal: keeps every contribution of a pixel, sorts them by z and blends surface after surface
//! (docs/book/algorithm-resolve.md §8).
//!
//! A new surface begins where `z − (the surface's first z) ≥ ε`. There are no slots and no merges,
//! and the order of arrival has no effect.

use super::Outcomes;
use super::fragments::Fragment;
use super::shade::Shader;
use super::tiles::{PIXELS_IN_A_TILE, Painter};

pub(super) struct IdealPainter<'a> {
    z_threshold: f64,
    shader: &'a Shader,
    contributions: Vec<Vec<Fragment>>,
    /// Working memory for the current pixel: depths and places of its contributions, and its
    /// surfaces.
    order: Vec<(f64, u32)>,
    surfaces: Vec<Fragment>,
    outcomes: Outcomes,
}

impl<'a> IdealPainter<'a> {
    pub fn new(z_threshold: f64, shader: &'a Shader) -> Self {
        let contributions = vec![Vec::new(); PIXELS_IN_A_TILE];
        IdealPainter {
            z_threshold,
            shader,
            contributions,
            order: Vec::new(),
            surfaces: Vec::new(),
            outcomes: Outcomes::default(),
        }
    }
}

impl Painter for IdealPainter<'_> {
    type Contribution = Fragment;

    fn take(&mut self, pixel: usize, contribution: Fragment) {
        self.contributions[pixel].push(contribution);
    }

    fn finish(&mut self, pixel: usize) -> [f64; 4] {
        let contributions = &mut self.contributions[pixel];
        sort(contributions, &mut self.order);
        group(
            contributions,
            &self.order,
            self.z_threshold,
            &mut self.surfaces,
        );
        let surfaces = self.surfaces.len();
        self.outcomes.inserted += surfaces as u64;
        self.outcomes.accumulated += (contributions.len() - surfaces) as u64;
        self.outcomes.most_surfaces_in_a_pixel =
            self.outcomes.most_surfaces_in_a_pixel.max(surfaces as u64);
        contributions.clear();
        self.shader.resolve(&mut self.surfaces)
    }

    fn outcomes(&self) -> Outcomes {
        self.outcomes
    }
}

/// Sorts indices of contributions front to back; the contributions are large and are not moved.
fn sort(contributions: &[Fragment], order: &mut Vec<(f64, u32)>) {
    order.clear();
    order.extend(
        contributions
            .iter()
            .map(|contribution| contribution.z)
            .zip(0..),
    );
    order.sort_unstable_by(|a, b| {
        // Depth alone would leave ties in the order of arrival, and the surface's material would
        // depend on it.
        let [first, second] = [a, b].map(|(_, place)| &contributions[*place as usize]);
        let by_z = a.0.total_cmp(&b.0);
        by_z.then_with(|| {
            first
                .material
                .cmp(&second.material)
                .then(first.weight.total_cmp(&second.weight))
                .then(a.1.cmp(&b.1))
        })
    });
}

/// Sums contributions in their order into surfaces, front to back.
fn group(
    contributions: &[Fragment],
    order: &[(f64, u32)],
    z_threshold: f64,
    surfaces: &mut Vec<Fragment>,
) {
    surfaces.clear();
    for (z, place) in order {
        let contribution = &contributions[*place as usize];
        if surfaces.last().is_none_or(|last| z - last.z >= z_threshold) {
            surfaces.push(*contribution);
        } else if let Some(last) = surfaces.last_mut() {
            last.add(contribution);
        }
    }
}

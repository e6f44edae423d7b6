//! Ideal: keeps every contribution of a pixel, sorts them by z and blends surface after surface (docs/book/algorithm.md §8).
//!
//! A new surface begins where `z − (the surface's first z) ≥ ε`. No slot, no merge, no order of arrival.

use super::Outcomes;
use super::fragments::Fragment;
use super::shade::Shader;
use super::tiles::{PIXELS_IN_A_TILE, Painter};

pub(super) struct Ideal<'a> {
    z_threshold: f64,
    shader: &'a Shader,
    contributions: Vec<Vec<Fragment>>,
    outcomes: Outcomes,
}

impl<'a> Ideal<'a> {
    pub fn new(z_threshold: f64, shader: &'a Shader) -> Self {
        let contributions = vec![Vec::new(); PIXELS_IN_A_TILE];
        Ideal { z_threshold, shader, contributions, outcomes: Outcomes::default() }
    }
}

impl Painter for Ideal<'_> {
    type Contribution = Fragment;

    fn take(&mut self, pixel: usize, contribution: Fragment) {
        self.contributions[pixel].push(contribution);
    }

    fn finish(&mut self, pixel: usize) -> [f64; 4] {
        let contributions = &mut self.contributions[pixel];
        let surfaces = group(contributions, self.z_threshold);
        self.outcomes.inserted += surfaces as u64;
        self.outcomes.accumulated += (contributions.len() - surfaces) as u64;
        self.outcomes.most_surfaces_in_a_pixel = self.outcomes.most_surfaces_in_a_pixel.max(surfaces as u64);
        let colour = self.shader.resolve(&mut contributions[..surfaces]);
        contributions.clear();
        colour
    }

    fn outcomes(&self) -> Outcomes {
        self.outcomes
    }
}

/// Sums contributions into surfaces, which take the first places, front to back. Returns how many there are.
fn group(contributions: &mut [Fragment], z_threshold: f64) -> usize {
    // Depth alone leaves the order of equals to the order of arrival, and with it the surface's material.
    contributions.sort_by(|a, b| {
        let by_z = a.z.total_cmp(&b.z);
        by_z.then(a.material.cmp(&b.material)).then(a.weight.total_cmp(&b.weight))
    });
    let mut last = 0;
    for index in 1..contributions.len() {
        let contribution = contributions[index];
        if contribution.z - contributions[last].z >= z_threshold {
            last += 1;
            contributions[last] = contribution;
        } else {
            contributions[last].add(&contribution);
        }
    }
    last + 1
}

//! Resolve over the reals: how far a pixel may lie from the exact one.
//!
//! With T₀ = 1, Tᵢ₊₁ = Tᵢ·(1 − αᵢ), and δ before what may be wrong:
//! ```text
//! transmittance  δTᵢ₊₁ = (1 − αᵢ)·δTᵢ + (Tᵢ + δTᵢ)·δαᵢ + ½p(transmittance)
//! frame          Σ (Cᵢ·δTᵢ + (Tᵢ + δTᵢ)·δCᵢ), the background the same as a last layer; ½p(frame)
//! ```
//! p(word) is a last place; a word that is cut loses a whole one, downwards. Both sums are exact on the machine until `frame` is fitted.
//!
//! Laws: `blending_is_within_its_bound`, `the_bound_of_blending_is_tight`.

use super::Resolve;
use crate::real::{Real, Scale};

impl Resolve {
    /// Blends premultiplied layers, front to back, over the background.
    pub fn real<R: Real>(&self, layers: &[[R; 4]], background: [R; 4]) -> [R; 4] {
        let one = R::constant(1.0);
        let mut transmittance = one;
        let mut sums = [R::constant(0.0); 3];
        for [r, g, b, opacity] in layers {
            for (sum, colour) in sums.iter_mut().zip([*r, *g, *b]) {
                *sum = *sum + transmittance * colour;
            }
            let through = (one - *opacity).max(R::constant(0.0));
            transmittance = (transmittance * through).fit(&self.transmittance, Scale::ONE);
        }
        let [r, g, b, alpha] = background;
        let [r, g, b] = [(sums[0], r), (sums[1], g), (sums[2], b)].map(|(sum, behind)| (sum + transmittance * behind).at_most(1.0));
        [r, g, b, one - transmittance * (one - alpha)].map(|channel| channel.fit(&self.frame, Scale::ONE))
    }
}

#[cfg(test)]
mod tests;

//! Resolve over the reals: bounds the distance of a pixel from the exact one.
//!
//! With T₀ = 1, Tᵢ₊₁ = Tᵢ·(1 − αᵢ), and δ for an error:
//! ```text
//! transmittance  δTᵢ₊₁ = (1 − αᵢ)·δTᵢ + (Tᵢ + δTᵢ)·δαᵢ + ½p(transmittance)
//! frame          Σ (Cᵢ·δTᵢ + (Tᵢ + δTᵢ)·δCᵢ), the background the same as a last layer; ½p(frame)
//! ```
//! p(word) is an ulp. A truncated word loses up to a whole ulp, downwards. Both sums are exact on
//! the machine until `frame` is fitted.
//!
//! Laws: `blending_is_within_its_bound`, `the_bound_of_blending_is_tight`.

use super::Resolve;
use crate::real::Real;

/// Inputs of both graphs.
fn inputs<R: Real>([a, b, c, d]: [R; 4], [e, f, g, h]: [R; 4]) -> [R; 8] {
    [a, b, c, d, e, f, g, h]
}

impl Resolve {
    /// Blends premultiplied layers, front to back, over the background.
    pub fn real<R: Real>(&self, layers: &[[R; 4]], background: [R; 4]) -> [R; 4] {
        let mut state = [
            R::constant(1.0),
            R::constant(0.0),
            R::constant(0.0),
            R::constant(0.0),
        ];
        for layer in layers {
            state = self
                .layer
                .real(&self.asked[0], inputs(state, *layer), |_, x| x);
        }
        self.frame
            .real(&self.asked[1], inputs(state, background), |_, x| x)
    }
}

#[cfg(test)]
mod tests;

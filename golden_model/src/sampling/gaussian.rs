//! Gaussian: integrals of products of Gaussians over a plane, in closed form (SS Appendix A).

use glam::{DMat2, DVec2};
use std::f64::consts::PI;

/// A Gaussian exp(−½ (x − p)ᵀ V⁻¹ (x − p)) over a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    /// p.
    pub middle: DVec2,
    /// V, symmetric and positive definite.
    pub variance: DMat2,
}

impl Gaussian {
    /// A Gaussian with the same width in all directions.
    pub fn round(middle: DVec2, radius: f64) -> Self {
        Gaussian {
            middle,
            variance: DMat2::from_diagonal(DVec2::splat(radius * radius)),
        }
    }

    /// Its value at x.
    pub fn at(&self, x: DVec2) -> f64 {
        let d = x - self.middle;
        (-0.5 * d.dot(self.variance.inverse() * d)).exp()
    }

    /// The same after an affine map x ↦ M x + t.
    pub fn mapped(&self, linear: DMat2, offset: DVec2) -> Self {
        Gaussian {
            middle: linear * self.middle + offset,
            variance: linear * self.variance * linear.transpose(),
        }
    }

    /// ⟨a, b⟩ = ∫ a b = 2π √(|V_a| |V_b| / |V_a + V_b|) exp(−½ dᵀ (V_a + V_b)⁻¹ d), where d is the
    /// vector between their middles: the product is also a Gaussian.
    pub fn inner(&self, other: &Gaussian) -> f64 {
        let sum = Gaussian {
            middle: self.middle,
            variance: self.variance + other.variance,
        };
        let determinants =
            self.variance.determinant() * other.variance.determinant() / sum.variance.determinant();
        2.0 * PI * determinants.sqrt() * sum.at(other.middle)
    }
}

/// [`Gaussian::inner`] of two round Gaussians, from their radii and the square of their distance.
pub fn inner_of_round(a: f64, b: f64, squared: f64) -> f64 {
    let sum = a * a + b * b;
    2.0 * PI * a * a * b * b / sum * (-0.5 * squared / sum).exp()
}

/// A Gaussian cut at radial index `cutoff` has the variance of a narrower one that is not cut:
/// returns the ratio of its radius to the original one, the root of 1 − (c/2)/(e^(c/2) − 1).
pub fn cut(cutoff: f64) -> f64 {
    let half = cutoff / 2.0;
    (1.0 - half / libm::expm1(half)).sqrt()
}

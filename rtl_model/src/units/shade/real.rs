//! Shade over the reals: how far a shaded fragment may lie from the exact one.
//!
//! With p(word) a last place, W = w·2^e, w in [1, 2), and ε₁, ε₂ the relative errors of 1/W and
//! 1/|n|:
//! ```text
//! mean         c = Σw·c/W   share holds c·w: ½p(share)/w, nothing where W's shift leaves all its places; 1/W: c·ε₁; the fit: ½p(rgb)
//! direction    normal_share moves n by |d|: it turns by at most asin(|d|/|n|); 1/|n|: ε₂; the fit: ½p(normal) each part
//! cosine       N·L turned by θ: |N·L|(1 − cos θ) + √(1 − (N·L)²)·sin θ; what N's and L's words lost; ½p(cosine)
//! highlight    x^s of the cosine's ends; the worst step of the table between them; its fit: ½p(highlight)
//! colour       rgb·(ambient + Σ cosine·diffuse) + Σ highlight·specular: products and sums of the above, ½p(irradiance), ½p(colour)
//! coverage     1 where W ≥ τ, else W·(1/τ): ½p(share)·2^e/τ, W/τ times what 1/τ's word lost, ½p(coverage); both where W may be either
//! premultiplied  opacity·coverage, colour·that: ½p(premultiplied) each
//! ```
//! A word that is cut loses a whole place, downwards, where this says half of one. The flip of the
//! normal towards the viewer is taken both ways where N_z may be on either side of 0; so is the
//! absence of lights where n may be 0, and of light where W may be.
//!
//! Means come in as quotients, not as sums: what makes Σw·c and W wrong is mostly the same, and
//! only the caller can see it cancel.
//!
//! Laws: `shading_is_within_its_bound`, `the_bound_of_shading_is_tight`.

use super::Shade;
use super::reflect::real::Surroundings;
use crate::functions::table::real::Power;
use crate::num::Fit;
use crate::real::{Direction, Real, Scale};

/// Input port: what one fragment's sums mean. Where W is 0 on the exact side the exact means are
/// too.
#[derive(Clone, Copy, Debug)]
pub struct Sums<R> {
    /// W = Σw.
    pub weight: R,
    /// Σw·rgb / W.
    pub rgb: [R; 3],
    /// Σw·α / W.
    pub opacity: R,
    /// Σw·n / W.
    pub normal: [R; 3],
    /// Index into the lighting's materials.
    pub material: u32,
    /// The pixel's centre from the middle of the picture.
    pub at: [f64; 2],
}

/// Registers that a frame loads.
#[derive(Clone, Debug)]
pub struct Lighting<R> {
    /// Lights, in camera space.
    pub lights: Vec<Light<R>>,
    /// Materials.
    pub materials: Vec<Material<R>>,
    /// τ.
    pub coverage_threshold: R,
    /// 1/τ.
    pub inverse_threshold: R,
    /// What is mirrored; none where nothing is.
    pub surroundings: Option<Surroundings<R>>,
}

/// A light, in camera space.
#[derive(Clone, Copy, Debug)]
pub struct Light<R> {
    /// Unit vector towards the light.
    pub direction: [R; 3],
    /// Unit vector half-way between light and viewer; none where they are opposite.
    pub half_way: Option<[R; 3]>,
}

/// A material's answer to the lights.
#[derive(Clone, Debug)]
pub enum Material<R> {
    /// The colour as it is.
    Unlit,
    /// Blinn-Phong.
    BlinnPhong {
        /// Ambient factor.
        ambient: R,
        /// Diffuse factor times light, for each light.
        diffuse: Vec<[R; 3]>,
        /// Specular factor times light, for each light.
        specular: Vec<[R; 3]>,
        /// x^shininess ([`Shade::power`]).
        highlight: Power,
    },
}

impl Shade {
    /// The highlight of a material: x^shininess, and the words that the machine has for it.
    pub fn power(&self, words: &[i64], shininess: f64) -> Power {
        Power::new(self.highlight(words), shininess)
    }

    /// Shades one fragment: colour times opacity, and opacity.
    pub fn real<R: Real>(&self, lighting: &Lighting<R>, sums: &Sums<R>) -> [R; 4] {
        let nothing = || [R::constant(0.0); 4];
        (-sums.weight).branch(R::constant(0.0), nothing, || {
            let whole = sums.weight;
            let rgb = sums
                .rgb
                .map(|channel| mean(channel, whole, &self.colour_share, self, &self.rgb));
            let opacity = mean(
                sums.opacity,
                whole,
                &self.opacity_share,
                self,
                &self.opacity,
            )
            .at_most(1.0);
            let colour = self.real_colour(lighting, sums, rgb);
            let opacity =
                (opacity * self.real_coverage(lighting, whole)).fit(&self.covered, Scale::ONE);
            let [r, g, b] =
                colour.map(|channel| (channel * opacity).fit(&self.premultiplied, Scale::ONE));
            [r, g, b, opacity]
        })
    }

    /// min(1, W/τ).
    fn real_coverage<R: Real>(&self, lighting: &Lighting<R>, weight: R) -> R {
        let one = || [R::constant(1.0)];
        let [coverage] = weight.branch(lighting.coverage_threshold, one, || {
            let share = R::constant(1.0).share(&self.weight_share, weight) * weight;
            [(share * lighting.inverse_threshold)
                .fit(&self.coverage, Scale::ONE)
                .at_most(1.0)]
        });
        coverage
    }

    /// The colour that leaves the surface, at most 1.
    fn real_colour<R: Real>(&self, lighting: &Lighting<R>, sums: &Sums<R>, rgb: [R; 3]) -> [R; 3] {
        let number = sums.material as usize;
        let material = &lighting.materials[number];
        let of = lighting
            .surroundings
            .as_ref()
            .filter(|of| !of.mirrors[number].is_dull);
        let mirror = self.reflect.as_ref().zip(of);
        let is_unlit = matches!(material, Material::Unlit);
        let as_it_is = || {
            rgb.map(|channel| {
                channel
                    .at_most(1.0)
                    .refit(self.rgb.word.format.frac_bits, &self.colour)
            })
        };
        if is_unlit && mirror.is_none() {
            return as_it_is();
        }
        let share = sums
            .normal
            .map(|n| n.share(&self.normal_share, sums.weight));
        let zero = R::constant(0.0);
        let ambient_only = || {
            if is_unlit {
                as_it_is()
            } else {
                self.real_lit(material, &[], rgb, |_| zero)
            }
        };
        (-R::length(share)).branch(zero, ambient_only, || {
            let normal = R::direction(share, sums.weight, &self.root).fit(&self.normal);
            let lit = |normal: Direction<R>| {
                let colour = if is_unlit {
                    as_it_is()
                } else {
                    self.real_lit(material, &lighting.lights, rgb, |to| {
                        self.real_cosine(&normal, to)
                    })
                };
                mirror.map_or(colour, |(unit, of)| {
                    unit.real(of, number, sums.at, &normal, colour)
                })
            };
            let to_viewer = -R::dot(&normal, [0.0, 0.0, 1.0].map(R::constant));
            to_viewer.branch(zero, || lit(normal), || lit(normal.turned_back()))
        })
    }

    /// max(0, N·direction).
    fn real_cosine<R: Real>(&self, normal: &Direction<R>, direction: [R; 3]) -> R {
        R::dot(normal, direction)
            .fit(&self.cosine, Scale::ONE)
            .max(R::constant(0.0))
    }

    /// Blinn-Phong under some lights, whose vectors have these cosines with the normal.
    fn real_lit<R: Real>(
        &self,
        material: &Material<R>,
        lights: &[Light<R>],
        rgb: [R; 3],
        cosine: impl Fn([R; 3]) -> R,
    ) -> [R; 3] {
        let Material::BlinnPhong {
            ambient,
            diffuse,
            specular,
            highlight,
        } = material
        else {
            return rgb;
        };
        let mut irradiance = [*ambient; 3];
        let mut gloss = [R::constant(0.0); 3];
        for (
            i,
            Light {
                direction,
                half_way,
            },
        ) in lights.iter().enumerate()
        {
            let towards = cosine(*direction);
            let shine = half_way.map_or(R::constant(0.0), |half_way| {
                cosine(half_way).below_one(&self.cosine).power(highlight)
            });
            for channel in 0..3 {
                irradiance[channel] = irradiance[channel] + towards * diffuse[i][channel];
                gloss[channel] = gloss[channel] + shine * specular[i][channel];
            }
        }
        std::array::from_fn(|channel| {
            let irradiance = irradiance[channel].fit(&self.irradiance, Scale::ONE);
            (rgb[channel] * irradiance + gloss[channel])
                .min(R::constant(1.0))
                .fit(&self.colour, Scale::ONE)
        })
    }
}

/// A mean Σw·c/W, from the share of the sum that goes with W normalised.
fn mean<R: Real>(exact: R, whole: R, share: &Fit, unit: &Shade, fit: &Fit) -> R {
    exact
        .share(share, whole)
        .restored(&unit.reciprocal, whole)
        .fit(fit, Scale::ONE)
}

#[cfg(test)]
mod tests;

//! Shade, eight fragments of one material side by side: the words of [`Shade::one`], step by step.
//!
//! Law: `eight_fragments_are_shaded_as_each_alone`.

use super::{Input, LightRegisters, Output, Shade};
use crate::frame::{Light, Material, Scaled};
use crate::num::{Exacts, LANES, Words, three};
use crate::probe::{Probe, Tap};
use crate::records::SUMS;

/// Inputs of eight fragments, one word per lane.
#[derive(Clone, Copy, Debug)]
pub struct Fragments<W> {
    weight: W,
    colour: [W; 3],
    opacity: W,
    normal: [W; 3],
}

/// Outputs of eight fragments, one word per lane.
#[derive(Clone, Copy, Debug)]
pub struct Shaded<W> {
    /// Colour times opacity.
    pub colour: [W; 3],
    /// Opacity.
    pub opacity: W,
}

impl<W: Words> Shaded<W> {
    /// The outputs, one per fragment.
    #[inline(always)]
    pub fn outputs(self) -> [Output; LANES] {
        let colour = self.colour.map(Words::to_array);
        let opacity = self.opacity.to_array();
        std::array::from_fn(|lane| Output {
            colour: three!(i => i64::from(colour[i][lane])),
            opacity: opacity[lane].into(),
        })
    }
}

impl<W: Words> Fragments<W> {
    /// Fragments of these sums, in the order of a slot's.
    #[inline(always)]
    pub fn of_sums([weight, r, g, b, opacity, x, y, z]: [W; SUMS]) -> Self {
        Fragments {
            weight,
            colour: [r, g, b],
            opacity,
            normal: [x, y, z],
        }
    }

    /// Fragments of these inputs.
    #[inline(always)]
    pub fn of(inputs: &[Input; LANES]) -> Self {
        macro_rules! word {
            ($($part:tt)*) => {
                W::from_array(std::array::from_fn(|lane| inputs[lane].$($part)* as i32))
            };
        }
        Fragments {
            weight: word!(weight),
            colour: three!(i => word!(colour[i])),
            opacity: word!(opacity),
            normal: three!(i => word!(normal[i])),
        }
    }
}

impl Shade {
    /// Shades eight fragments, whose sums are words of at most 32 bits, as if all were of one
    /// material.
    #[inline(always)]
    pub fn lanes<W: Words, P: Probe>(
        &self,
        registers: &LightRegisters,
        material: u32,
        mut fragments: Fragments<W>,
        tap: &mut Tap<P>,
    ) -> Shaded<W> {
        let none = fragments.weight.is_none();
        let (opacity_one, zero) = (W::splat(self.words.opacity_one), W::splat(0));
        if none.signs() != 0 {
            // Of no weight there is no colour: a fragment of nothing, which nobody looks at.
            fragments = Fragments {
                weight: W::splat(1).where_else(none, fragments.weight),
                colour: three!(i => zero.where_else(none, fragments.colour[i])),
                opacity: zero.where_else(none, fragments.opacity),
                normal: three!(i => zero.where_else(none, fragments.normal[i])),
            };
        }
        tap.drop_where(none);
        let weight = fragments.weight;
        let inverse = self.reciprocal.lanes(weight.exact(), tap);
        let exponent = inverse.exponent;
        let share = three!(i => tap.fit_shifted(&self.colour_share, fragments.colour[i].exact(), -exponent));
        let rgb = three!(i => tap.fit_words(&self.rgb, share[i] * inverse.mantissa));
        let opacity_share =
            tap.fit_shifted(&self.opacity_share, fragments.opacity.exact(), -exponent);
        let opacity = tap
            .fit_words(&self.opacity, opacity_share * inverse.mantissa)
            .min(opacity_one);

        let colour = self.lit_lanes(registers, material, fragments.normal, rgb, exponent, tap);
        let coverage = self.coverage_lanes(registers, weight, exponent, tap);
        let opacity = tap.fit_words(&self.covered, opacity * coverage);
        Shaded {
            colour: three!(i => zero.where_else(none, tap.fit_words(&self.premultiplied, colour[i] * opacity))),
            opacity: zero.where_else(none, opacity),
        }
    }

    /// min(1, W/τ).
    #[inline(always)]
    fn coverage_lanes<W: Words, P: Probe>(
        &self,
        registers: &LightRegisters,
        weight: W,
        exponent: W,
        tap: &mut Tap<P>,
    ) -> W {
        let one = W::splat(self.words.coverage_one);
        let thin = W::splat(registers.coverage_threshold).above(weight);
        if thin.signs() & tap.live == 0 {
            return one;
        }
        let live = tap.live;
        tap.live &= thin.signs();
        let share = tap.fit_shifted(&self.weight_share, weight.exact(), -exponent);
        let Scaled { mantissa, places } = registers.inverse_threshold;
        let coverage = tap
            .fit_shifted(
                &self.coverage,
                share * W::splat(mantissa),
                exponent + W::splat(places),
            )
            .min(one);
        tap.live = live;
        coverage.where_else(thin, one)
    }

    /// The colour that leaves the surface, at most 1.
    #[inline(always)]
    fn lit_lanes<W: Words, P: Probe>(
        &self,
        registers: &LightRegisters,
        material: u32,
        normal: [W; 3],
        rgb: [W; 3],
        exponent: W,
        tap: &mut Tap<P>,
    ) -> [W; 3] {
        let w = self.words;
        let colour_one = W::Exact::splat(w.colour_one);
        let (
            Material::BlinnPhong {
                ambient,
                diffuse,
                specular,
                ..
            },
            Some(table),
        ) = (
            &registers.lighting.materials[material as usize],
            &registers.highlights[material as usize],
        )
        else {
            return three!(i => tap.fit_words(&self.colour, rgb[i].exact().left(w.rgb_to_colour).min(colour_one)));
        };
        let (normal, none) = self.unit_normals(normal, exponent, tap);
        let zero = W::splat(0);
        let mut irradiance = three!(_i => W::Exact::splat(*ambient << w.ambient));
        let mut gloss = three!(_i => W::Exact::splat(0));
        let live = tap.live;
        tap.drop_where(none);
        for (
            i,
            Light {
                direction,
                half_way,
            },
        ) in registers.lighting.lights.iter().enumerate()
        {
            // Where normals cancel there is ambient light alone.
            let towards = zero.where_else(none, self.cosines(normal, *direction, tap));
            irradiance =
                three!(channel => irradiance[channel] + towards * W::splat(diffuse[i][channel]));
            if let Some(half_way) = half_way {
                let cosine = self
                    .cosines(normal, *half_way, tap)
                    .min(W::splat(w.cosine_one - 1));
                let shine =
                    zero.where_else(none, tap.fit_words(table.fit(), table.exact_words(cosine)));
                gloss = three!(channel => gloss[channel] + shine * W::splat(specular[i][channel]));
            }
        }
        tap.live = live;
        let irradiance = three!(channel => tap.fit_words(&self.irradiance, irradiance[channel]));
        three!(channel => {
            let exact = (rgb[channel] * irradiance[channel]).left(w.lit) + gloss[channel].left(w.glossy);
            tap.fit_words(&self.colour, exact.min(colour_one))
        })
    }

    /// max(0, N·direction).
    #[inline(always)]
    fn cosines<W: Words, P: Probe>(
        &self,
        normal: [W; 3],
        direction: [i64; 3],
        tap: &mut Tap<P>,
    ) -> W {
        tap.fit_words(&self.cosine, W::dot(direction, normal))
            .max(W::splat(0))
    }

    /// Unit normals, turned towards the viewer, and where the sums cancel.
    #[inline(always)]
    fn unit_normals<W: Words, P: Probe>(
        &self,
        sums: [W; 3],
        exponent: W,
        tap: &mut Tap<P>,
    ) -> ([W; 3], W) {
        let share = three!(i => tap.fit_shifted(&self.normal_share, sums[i].exact(), -exponent));
        let none = share[0].is_zero() & share[1].is_zero() & share[2].is_zero();
        let live = tap.live;
        tap.drop_where(none);
        let squared = (share[0] * share[0] + share[1] * share[1] + share[2] * share[2])
            .max(W::Exact::splat(1));
        let inverse = self.root.lanes(squared, tap);
        let normal = three!(i => tap.fit_shifted(&self.normal, share[i] * inverse.mantissa, -inverse.exponent));
        tap.live = live;
        let away = normal[2].above(W::splat(0));
        (three!(i => (-normal[i]).where_else(away, normal[i])), none)
    }
}

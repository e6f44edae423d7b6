//! Ellipse over the reals: how far a footprint may lie from the exact one.
//!
//! Every word is relative to the splat's own power of two, so that with last places u the variance is known to some u·k², its
//! determinant to u·k⁴ and, where the footprint is not thinner than the low-pass filter, the conic to a few u of itself. A needle
//! is where it breaks: there the determinant is as small as v·k² and the conic's relative error grows as u·k²/v.

use super::Ellipse;
use crate::num::{three, two};
use crate::real::frame::{Splat, View};
use crate::real::{Real, Scale, power_of_two};

/// Input port.
#[derive(Clone, Copy, Debug)]
pub struct Input<R> {
    /// The splat's record.
    pub splat: Splat<R>,
    /// t_z, machine units, at least a word.
    pub forward: R,
    /// The power of two that its word is relative to.
    pub exponent: Scale,
    /// 1/t_z.
    pub inverse_depth: R,
    /// a, b.
    pub slope: [R; 2],
}

/// Output port.
#[derive(Clone, Copy, Debug)]
pub struct Output<R> {
    /// Camera-space normal.
    pub normal: [R; 3],
    /// n_z, by which a normal is turned.
    pub facing_viewer: R,
    /// c_n.
    pub facing: R,
    /// det V, pixel⁴; the machine draws nothing where it has none left.
    pub determinant: R,
    /// Q00, Q01, Q11, pixel⁻².
    pub conic: [R; 3],
    /// A.
    pub amplitude: R,
    /// Half-extents of the box, pixels.
    pub extent: [R; 2],
    /// z_x, z_y, machine units a pixel.
    pub depth_slope: [R; 2],
    /// Half-width of the depth clamp, machine units.
    pub depth_range: R,
}

/// Footprint of both kinds of splats.
pub(super) struct Footprint<R> {
    pub determinant: R,
    pub conic: [R; 3],
    pub amplitude: R,
    pub extent: [R; 2],
}

/// The power of two whose even power normalises a number to [1, 4).
fn half(scale: Scale) -> Scale {
    Scale { low: scale.low.div_euclid(2), high: scale.high.div_euclid(2) }
}

impl Ellipse {
    /// Sets a disc up.
    pub fn real<R: Real>(&self, view: &View<R>, input: &Input<R>) -> Output<R> {
        let normal = self.real_normal(view, input.splat.normal);
        let (tilt, facing) = self.real_turn(input.slope, normal);
        let sized = self.real_size(view, input);
        let shape = self.real_disc(input.slope, tilt);
        let amplitude = |[area]: [R; 1], root: R| {
            let visibility = (area.abs() * root).fit(&self.visibility, Scale::ONE);
            (visibility * view.inverse_two_pi).fit(&self.amplitude, Scale::ONE)
        };
        let footprint = self.real_footprint(view, view.cutoff, sized, (shape, [facing]), amplitude);
        Output {
            normal: self.real_seen_normal(normal, input.splat.turned),
            facing_viewer: normal[2],
            facing,
            determinant: footprint.determinant,
            conic: footprint.conic,
            amplitude: footprint.amplitude,
            extent: footprint.extent,
            depth_slope: self.real_depth_slope(view, input, normal, facing),
            depth_range: (input.splat.radius * view.root_cutoff).fit(&self.depth_range, Scale::ONE),
        }
    }

    /// A direction in camera space.
    pub(super) fn real_normal<R: Real>(&self, view: &View<R>, [x, y, z]: [R; 3]) -> [R; 3] {
        three!(row => {
            let [a, b, c] = view.rotation[row];
            (a * x + b * y + c * z).fit(&self.normal, Scale::ONE)
        })
    }

    /// The normal that fragments sum.
    pub(super) fn real_seen_normal<R: Real>(&self, normal: [R; 3], turned: Option<bool>) -> [R; 3] {
        let (as_it_is, back) = (|| normal, || normal.map(R::neg));
        let seen = match (self.turns_normals, turned) {
            (false, _) | (true, Some(false)) => as_it_is(),
            (true, Some(true)) => back(),
            (true, None) => normal[2].beside(0.0).branch(normal[2], as_it_is, back),
        };
        seen.map(|part| part.fit(&self.fragment_normal, Scale::ONE))
    }

    /// g and c_n.
    pub(super) fn real_turn<R: Real>(&self, [a, b]: [R; 2], normal: [R; 3]) -> ([R; 2], R) {
        let tilt = [(normal[0] - a * normal[2]).fit(&self.tilt, Scale::ONE), (normal[1] - b * normal[2]).fit(&self.tilt, Scale::ONE)];
        (tilt, (a * normal[0] + b * normal[1] + normal[2]).fit(&self.facing, Scale::ONE))
    }

    /// From a shape and its faces to a conic and a box.
    pub(super) fn real_footprint<R: Real, const FACES: usize>(
        &self,
        view: &View<R>,
        cutoff: R,
        (size_squared, exponent): ([R; 3], Scale),
        (shape, faces): ([R; 3], [R; FACES]),
        amplitude: impl FnOnce([R; FACES], R) -> R,
    ) -> Footprint<R> {
        let squared = exponent.power(2);
        let low_pass = view.low_pass.fit(&self.low_pass, squared);
        let variance = self.real_variance(shape, size_squared, low_pass, squared);
        let areas = faces.map(|face| (size_squared[1] * face).fit(&self.area, squared));
        let squares = areas.iter().map(|area| *area * *area).reduce(|sum, square| sum + square).unwrap_or(R::constant(0.0));
        let exact = squares + low_pass * (variance[0] + variance[2]) - low_pass * low_pass;
        let determinant = exact.fit(&self.determinant, exponent.power(4));
        let at_least_a_place = determinant.at_least_a_place(&self.determinant, exponent.power(4));
        let root = at_least_a_place.inverse_root(&self.root);
        let inverse = (root * root).fit(&self.inverse, half(at_least_a_place.leading()).inverse().power(2));
        Footprint {
            determinant,
            conic: [
                (variance[2] * inverse).fit(&self.conic, Scale::ONE),
                (-(variance[1] * inverse)).fit(&self.conic_cross, Scale::ONE),
                (variance[0] * inverse).fit(&self.conic, Scale::ONE),
            ],
            amplitude: amplitude(areas, root),
            extent: [self.real_extent(cutoff, variance[0], squared), self.real_extent(cutoff, variance[2], squared)],
        }
    }

    /// k_x², k_x·k_y, k_y², and the power of two that k is relative to.
    pub(super) fn real_size<R: Real>(&self, view: &View<R>, input: &Input<R>) -> ([R; 3], Scale) {
        let scaled = (view.focal * input.splat.radius).at_least(power_of_two(-self.places.scaled_radius as i32));
        let leading = scaled.leading();
        let mantissa = scaled.fit(&self.scaled_radius, leading);
        let power = leading.times(input.forward.leading().inverse());
        let exponent = Scale { low: (power.low + 1).max(0), high: (power.high + 1).max(0) };
        let size = (mantissa * input.inverse_depth).fit(&self.size, exponent);
        let squared = (size * size).fit(&self.size_squared, exponent.power(2));
        let squares = match (view.aspect, &self.stretched) {
            (Some(aspect), Some(fit)) => aspect.map(|aspect| (squared * aspect).fit(fit, exponent.power(2))),
            _ => [squared; 3],
        };
        (squares, exponent)
    }

    /// [1+a² … − ggᵀ].
    fn real_disc<R: Real>(&self, [a, b]: [R; 2], tilt: [R; 2]) -> [R; 3] {
        [
            (a * a - tilt[0] * tilt[0]).plus(1.0).fit(&self.shape, Scale::ONE),
            (a * b - tilt[0] * tilt[1]).fit(&self.shape, Scale::ONE),
            (b * b - tilt[1] * tilt[1]).plus(1.0).fit(&self.shape, Scale::ONE),
        ]
    }

    /// V00, V01, V11.
    fn real_variance<R: Real>(&self, [xx, xy, yy]: [R; 3], size_squared: [R; 3], low_pass: R, scale: Scale) -> [R; 3] {
        [
            (size_squared[0] * xx + low_pass).fit(&self.variance, scale),
            (size_squared[1] * xy).fit(&self.variance_cross, scale),
            (size_squared[2] * yy + low_pass).fit(&self.variance, scale),
        ]
    }

    /// √(cutoff·V). The machine takes one place more.
    fn real_extent<R: Real>(&self, cutoff: R, variance: R, scale: Scale) -> R {
        let least = power_of_two(scale.low) * self.extent_root.least_operand();
        (cutoff * variance).at_least(least).root(&self.extent_root).fit(&self.extent, Scale::ONE).a_place_more(&self.extent)
    }

    /// z_x, z_y.
    pub(super) fn real_depth_slope<R: Real>(&self, view: &View<R>, input: &Input<R>, normal: [R; 3], facing: R) -> [R; 2] {
        let across = facing.abs().at_least_a_place(&self.facing, Scale::ONE);
        let inverse = across.reciprocal(&self.slope_reciprocal);
        two!(axis => {
            let inverse_focal = view.inverse_focals[axis];
            let scale = input.exponent.times(inverse_focal.leading().shifted(1));
            let step = (input.forward * inverse_focal).fit(&self.depth_step, scale);
            let steep = (step * inverse).fit(&self.slope_scale, scale.times(across.leading().inverse()));
            let away = -steep.with_sign_of(facing);
            (away * normal[axis]).fit(&self.depth_slope, Scale::ONE)
        })
    }
}

//! Ellipse over the reals: bounds the distance of a footprint from the exact one.
//!
//! Every word is relative to the splat's own power of two. With ulps u the error of the variance is
//! a few u·k², that of its determinant u·k⁴. Where the footprint is not thinner than the low-pass
//! filter, the relative error of the conic is a few u. A needle is the bad case: its determinant is
//! as small as v·k², and the relative error of the conic grows as u·k²/v.

use super::{Ellipse, ellipsoid};
use crate::graph::real::{Bounded, Given};
use crate::real::frame::{Ellipsoid, Orientation, Splat, View};
use crate::real::{Real, Scale};

/// Input port.
#[derive(Clone, Copy, Debug)]
pub struct Input<R> {
    /// The splat's record.
    pub splat: Splat<R>,
    /// t_z, machine units, at least one ulp.
    pub forward: R,
    /// Power of two that its word is relative to.
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
    /// n_z; its sign decides whether the normal is turned.
    pub facing_viewer: R,
    /// c_n.
    pub facing: R,
    /// det V, pixel⁴; the machine draws nothing where it is 0.
    pub determinant: R,
    /// Q00, Q01, Q11, pixel⁻².
    pub conic: [R; 3],
    /// A.
    pub amplitude: R,
    /// Half-extents of the box, pixels.
    pub extent: [R; 2],
    /// z_x, z_y, machine units per pixel.
    pub depth_slope: [R; 2],
    /// Half-width of the depth clamp, machine units.
    pub depth_range: R,
}

impl Ellipse {
    /// Sets a disc or an ellipsoid up.
    pub fn real<R: Real>(
        &self,
        view: &View<R>,
        ellipsoid: Option<&Ellipsoid<R>>,
        input: &Input<R>,
    ) -> Output<R> {
        let kind = ellipsoid.map(|of| ellipsoid::Variant {
            own: matches!(of.orientation, Orientation::Own { .. }),
            amplitude: of.amplitude,
        });
        let variant = self.variant(view.aspect.is_some(), kind);
        let ([n, m, o], [a, b]) = (input.splat.normal, input.slope);
        let (none, value) = (R::constant(0.0), Bounded::of);
        // The position of the box decides nothing here.
        let mut inputs = vec![
            value(n),
            value(m),
            value(o),
            value(input.splat.radius),
            Bounded::exponent(input.exponent),
            value(input.forward),
            value(input.inverse_depth),
            Bounded::exponent(input.forward.leading().inverse()),
            value(a),
            value(b),
            value(none),
            value(none),
        ];
        let ellipsoid = ellipsoid.filter(|_| variant.ellipsoid.is_some());
        if let Some(of) = ellipsoid {
            inputs.extend([input.splat.opacity, of.cutoff].map(value));
            if let Orientation::Own { quaternion, scales } = of.orientation {
                inputs.extend(quaternion.map(value));
                inputs.extend(scales.map(value));
            }
        }
        inputs.extend(view.rotation.as_flattened().iter().copied().map(value));
        inputs.extend(
            [
                none,
                view.focal,
                view.low_pass,
                view.root_cutoff,
                view.inverse_two_pi,
            ]
            .map(value),
        );
        if ellipsoid.is_none() {
            inputs.push(value(view.cutoff));
        }
        let steps = if variant.has_aspect { 2 } else { 1 };
        for inverse_focal in view.inverse_focals.into_iter().take(steps) {
            inputs.extend([
                Bounded::exponent(inverse_focal.leading().shifted(1)),
                value(inverse_focal),
            ]);
        }
        if let (true, Some(aspect)) = (variant.has_aspect, view.aspect) {
            inputs.extend(aspect.map(value));
        }
        inputs.extend([value(none); 4]);
        if let Some(of) = ellipsoid {
            inputs.extend(of.jacobian.map(value));
            if let Orientation::Frame { axes, scales } = of.orientation {
                inputs.extend(axes.as_flattened().iter().copied().map(value));
                inputs.extend(scales.map(value));
            }
            let weighs =
                (variant.ellipsoid).is_some_and(|own| own.depth_weight(&self.machine).is_some());
            if let (true, Some(inverse)) = (weighs, of.inverse_distance) {
                inputs.extend([
                    Bounded::exponent(inverse.leading().shifted(1)),
                    value(inverse),
                ]);
            }
        }
        let datapath = self.datapath(variant);
        let given = Given {
            inputs: &inputs,
            turned: input.splat.turned,
        };
        let results = datapath
            .graph
            .bounded(&datapath.bounds, &given, |_, x| x)
            .map(|result| result.value);
        let [
            n,
            m,
            o,
            facing_viewer,
            facing,
            determinant,
            xx,
            xy,
            yy,
            amplitude,
            width,
            height,
            slope_x,
            slope_y,
            depth_range,
        ] = results;
        Output {
            normal: [n, m, o],
            facing_viewer,
            facing,
            determinant,
            conic: [xx, xy, yy],
            amplitude,
            extent: [width, height],
            depth_slope: [slope_x, slope_y],
            depth_range,
        }
    }
}

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
use std::array;

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
    /// Sets discs or ellipsoids up: ellipsoids of the kind of `ellipsoids[0]`, if there is one.
    pub fn real<R: Real, const ITEMS: usize>(
        &self,
        view: &View<R>,
        ellipsoids: [Option<&Ellipsoid<R>>; ITEMS],
        items: &[Input<R>; ITEMS],
    ) -> [Output<R>; ITEMS] {
        let kind = ellipsoids[0].map(|of| ellipsoid::Variant {
            own: matches!(of.orientation, Orientation::Own { .. }),
            amplitude: of.amplitude,
        });
        let variant = self.variant(view.aspect.is_some(), kind);
        let none = R::constant(0.0);
        let value = |number: R| [Bounded::of(number); ITEMS];
        let each =
            |of: &dyn Fn(&Input<R>) -> R| array::from_fn(|item| Bounded::of(of(&items[item])));
        let exponents = |of: &dyn Fn(&Input<R>) -> Scale| {
            array::from_fn(|item| Bounded::exponent(of(&items[item])))
        };
        // The position of the box decides nothing here.
        let mut inputs = vec![
            each(&|item| item.splat.normal[0]),
            each(&|item| item.splat.normal[1]),
            each(&|item| item.splat.normal[2]),
            each(&|item| item.splat.radius),
            exponents(&|item| item.exponent),
            each(&|item| item.forward),
            each(&|item| item.inverse_depth),
            exponents(&|item| item.forward.leading().inverse()),
            each(&|item| item.slope[0]),
            each(&|item| item.slope[1]),
            value(none),
            value(none),
        ];
        let ellipsoid = ellipsoids[0].filter(|_| variant.ellipsoid.is_some());
        if let Some(first) = ellipsoid {
            let own = |of: &dyn Fn(&Ellipsoid<R>) -> R| {
                ellipsoids.map(|of_item| Bounded::of(of(of_item.unwrap_or(first))))
            };
            inputs.push(each(&|item| item.splat.opacity));
            inputs.push(own(&|of| of.cutoff));
            if let Orientation::Own { .. } = first.orientation {
                let part = |nth: usize| {
                    own(&|of| match of.orientation {
                        Orientation::Own { quaternion, scales } => match nth {
                            0..4 => quaternion[nth],
                            _ => scales[nth - 4],
                        },
                        Orientation::Frame { .. } => none,
                    })
                };
                inputs.extend((0..7).map(part));
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
                [Bounded::exponent(inverse_focal.leading().shifted(1)); ITEMS],
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
                    [Bounded::exponent(inverse.leading().shifted(1)); ITEMS],
                    value(inverse),
                ]);
            }
        }
        let datapath = self.datapath(variant);
        let given = Given {
            inputs: &inputs,
            turned: items.each_ref().map(|item| item.splat.turned),
        };
        let results = datapath.graph.bounded(&datapath.bounds, &given, |_, x| x);
        array::from_fn(|item| {
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
            ] = results.each_ref().map(|result| result[item].value);
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
        })
    }
}

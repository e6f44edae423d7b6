//! Ellipsoids over the reals: how far their footprints may lie from the exact ones.
//!
//! An axis is known to a few last places of itself, so V_r is known to some u·k² and each face to u·k²: what a needle loses is what a
//! needle of a disc loses. A quaternion that is off by u turns its axes by some 4u.

use super::{Ellipse, Ellipsoids, OTHERS};
use crate::frame::Amplitude;
use crate::num::{three, two};
use crate::real::frame::{Ellipsoid, Orientation, View};
use crate::real::{Real, Scale, power_of_two};
use crate::units::ellipse::real::{Input, Output};

impl Ellipsoids {
    fn real_directions<R: Real>(&self, [w, x, y, z]: [R; 4]) -> [[R; 3]; 3] {
        let twice = |sum: R| sum.times(2.0);
        let without = |sum: R| (-twice(sum)).plus(1.0);
        let columns = [
            [without(y * y + z * z), twice(x * y + w * z), twice(x * z - w * y)],
            [twice(x * y - w * z), without(x * x + z * z), twice(y * z + w * x)],
            [twice(x * z + w * y), twice(y * z - w * x), without(x * x + y * y)],
        ];
        three!(axis => three!(row => columns[axis][row].fit(&self.rotation, Scale::ONE)))
    }
}

impl Ellipse {
    /// Sets an ellipsoid up; none on a machine that draws discs alone.
    pub fn real_ellipsoid<R: Real>(&self, view: &View<R>, ellipsoid: &Ellipsoid<R>, input: &Input<R>) -> Option<Output<R>> {
        let own = self.ellipsoids.as_ref()?;
        let (axes, scales) = match ellipsoid.orientation {
            Orientation::Own { quaternion, scales } => {
                (own.real_directions(quaternion).map(|direction| self.real_normal(view, direction)), scales)
            }
            Orientation::Frame { axes, scales } => (axes, scales),
        };
        let limit = ellipsoid.jacobian;
        let slope = two!(axis => input.slope[axis].min(limit[axis]).max(-limit[axis]));
        let turned = axes.map(|axis| self.real_turn(slope, axis));
        let stretched = three!(axis => turned[axis].0.map(|tilt| (scales[axis] * tilt).fit(&own.stretch, Scale::ONE)));
        let sum = |i: usize, j: usize| {
            let [x, y, z] = stretched.map(|axis| axis[i] * axis[j]);
            (x + y + z).fit(&own.shape, Scale::ONE)
        };
        let shape = [sum(0, 0), sum(0, 1), sum(1, 1)];
        let faces = three!(axis => {
            let [j, k] = OTHERS[axis];
            let pair = (scales[j] * scales[k]).fit(&own.scales, Scale::ONE);
            (pair * turned[axis].1).fit(&own.face, Scale::ONE)
        });
        let sized = self.real_size(view, input);
        let squared = sized.1.power(2);
        let opacity = input.splat.opacity;
        let amplitude = |areas: [R; 3], root: R| {
            let shown = |area: R| (area.abs() * root).fit(&self.visibility, Scale::ONE);
            match ellipsoid.amplitude {
                Amplitude::Disc => (shown(areas[2]) * view.inverse_two_pi).fit(&self.amplitude, Scale::ONE),
                Amplitude::LineIntegral => {
                    let [a, b] = slope;
                    let ray = (a * a + b * b).plus(1.0).root(&own.ray_root).fit(&own.ray, Scale::ONE);
                    let along = (sized.0[1] * ray).fit(&own.along, squared);
                    (shown(along) * opacity).fit(&own.weighed, Scale::ONE)
                }
                Amplitude::Peak => opacity.fit(&own.peak, Scale::ONE),
                Amplitude::Compensated => own.compensation.as_ref().map_or(R::constant(0.0), |compensation| {
                    let [x, y, z] = areas.map(|area| area * area);
                    let least = power_of_two(sized.1.power(4).low) * compensation.root.least_operand();
                    let spanned = (x + y + z).at_least(least).root(&compensation.root).fit(&compensation.spanned, squared);
                    (shown(spanned) * opacity).fit(&own.weighed, Scale::ONE)
                }),
            }
        };
        let footprint = self.real_footprint(view, ellipsoid.cutoff, sized, (shape, faces), amplitude);
        let normal = self.real_normal(view, input.splat.normal);
        let flattened = ellipsoid.amplitude == Amplitude::Disc;
        let zero = R::constant(0.0);
        let facing = turned[2].1;
        Some(Output {
            normal: self.real_seen_normal(normal, input.splat.turned),
            facing_viewer: normal[2],
            facing: if flattened { facing } else { R::constant(1.0) },
            determinant: footprint.determinant,
            conic: footprint.conic,
            amplitude: footprint.amplitude,
            extent: footprint.extent,
            depth_slope: if flattened { self.real_depth_slope(view, input, axes[2], facing) } else { [zero; 2] },
            depth_range: if flattened { (input.splat.radius * view.root_cutoff).fit(&self.depth_range, Scale::ONE) } else { zero },
        })
    }
}

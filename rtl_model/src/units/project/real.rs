//! Project over the reals: bounds the distance of a projected point from the exact one.
//!
//! `relative` is truncated to an ulp of 2^(exponent − frac_bits). `camera` adds the rotation's
//! ulps and half an ulp of its own, 1/t_z its unit's relative error, `slope` and `pixel` half an
//! ulp each; `pixel` multiplies the slope's error by s. With words of equal relative precision u
//! the position on the screen is therefore off by about 4·s·u pixels. `camera` contributes most.
//! precision u the position on the screen is off by some 4·s·u pixels: `camera`'s part counts most.

use super::Project;
use crate::graph::real::{Bounded, Given};
use crate::num::two;
use crate::real::frame::View;
use crate::real::{Real, Scale};

/// Output port.
#[derive(Clone, Copy, Debug)]
pub struct Projected<R> {
    /// t, machine units.
    pub camera: [R; 3],
    /// Power of two that the words of t are relative to.
    pub exponent: Scale,
    /// t_z as compared with the near plane, machine units.
    pub depth: R,
    /// 1/t_z.
    pub inverse_depth: R,
    /// a, b.
    pub slope: [R; 2],
    /// Position from the picture's middle, pixels.
    pub pixel: [R; 2],
    /// Distance of |t_x| and |t_y| from the guard band's edge, to the inside.
    pub inside: [R; 2],
}

impl Project {
    /// Projects a point.
    pub fn real<R: Real>(&self, view: &View<R>, position: [R; 3]) -> Projected<R> {
        let ([p, q, r], [x, y, z], [[a, b, c], [d, e, f], [g, h, i]]) =
            (position, view.eye, view.rotation);
        let ([focal_x, focal_y], [guard_x, guard_y], [centre_x, centre_y]) =
            (view.focals, view.guard, view.centre);
        let is_transparent = R::constant(0.0);
        let inputs = [
            p,
            q,
            r,
            is_transparent,
            x,
            y,
            z,
            a,
            b,
            c,
            d,
            e,
            f,
            g,
            h,
            i,
            view.near,
            guard_x,
            guard_y,
            focal_x,
            focal_y,
            centre_x,
            centre_y,
        ];
        let given = Given {
            inputs: &inputs.map(Bounded::of),
            turned: None,
        };
        let [
            x,
            y,
            forward,
            exponent,
            depth,
            inverse_depth,
            slope_x,
            slope_y,
            column,
            row,
        ] = self.graph.bounded(&self.bounds, &given, |_, x| x);
        let camera = [x.value, y.value, forward.value];
        Projected {
            camera,
            exponent: exponent.scale,
            depth: depth.value,
            inverse_depth: inverse_depth.value,
            slope: [slope_x.value, slope_y.value],
            pixel: [column.value, row.value],
            inside: two!(axis => view.guard[axis] * camera[2] - camera[axis].abs()),
        }
    }
}

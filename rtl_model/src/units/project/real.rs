//! Project over the reals: bounds the distance of a projected point from the exact one.
//!
//! `relative` is truncated to an ulp of 2^(exponent − frac_bits). `camera` adds the rotation's
//! ulps and half an ulp of its own, 1/t_z its unit's relative error, `slope` and `pixel` half an
//! ulp each; `pixel` multiplies the slope's error by s. With words of equal relative precision u
//! the position on the screen is therefore off by about 4·s·u pixels. `camera` contributes most.

use super::Project;
use crate::graph::real::{Bounded, Given};
use crate::num::two;
use crate::real::frame::View;
use crate::real::{Real, Scale};
use std::array;

/// Inputs of the graph: a position, and the registers.
const INPUTS: usize = 23;

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
    /// Projects points.
    pub fn real<R: Real, const ITEMS: usize>(
        &self,
        view: &View<R>,
        positions: [[R; 3]; ITEMS],
    ) -> [Projected<R>; ITEMS] {
        let ([x, y, z], [[a, b, c], [d, e, f], [g, h, i]]) = (view.eye, view.rotation);
        let ([focal_x, focal_y], [guard_x, guard_y], [centre_x, centre_y]) =
            (view.focals, view.guard, view.centre);
        let of_item = |axis: usize| array::from_fn(|item| Bounded::of(positions[item][axis]));
        let is_transparent = R::constant(0.0);
        let registers = [
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
        ]
        .map(|register| [Bounded::of(register); ITEMS]);
        let mut inputs = [[Bounded::of(is_transparent); ITEMS]; INPUTS];
        let (of_items, of_view) = inputs.split_at_mut(3);
        of_items.copy_from_slice(&[0, 1, 2].map(of_item));
        of_view.copy_from_slice(&registers);
        let given = Given {
            inputs: &inputs,
            turned: [None; ITEMS],
        };
        let results = self.graph.bounded(&self.bounds, &given, |_, x| x);
        array::from_fn(|item| {
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
            ] = results.each_ref().map(|result| result[item]);
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
        })
    }
}

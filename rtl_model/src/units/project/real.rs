//! Project over the reals: how far a projected point may lie from the exact one.
//!
//! `relative` is cut to a last place of 2^(exponent − frac_bits), `camera` adds the rotation's own last places and half of one
//! more, 1/t_z its unit's relative error, `slope` and `pixel` half a last place each; `pixel` takes the slope's error s-fold.
//! So with words of equal relative precision u the position on the screen is off by some 4·s·u pixels: `camera`'s part counts most.

use super::Project;
use crate::num::{three, two};
use crate::real::frame::View;
use crate::real::{Real, Scale, power_of_two};

/// Output port.
#[derive(Clone, Copy, Debug)]
pub struct Projected<R> {
    /// t, machine units.
    pub camera: [R; 3],
    /// The power of two that the words of t are relative to.
    pub exponent: Scale,
    /// t_z as the near plane sees it, machine units.
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
        let difference = three!(axis => position[axis] - view.eye[axis]);
        let [x, y, z] = three!(axis => difference[axis].abs());
        let largest = x.max(y).max(z).at_least(power_of_two(-self.difference_frac_bits as i32));
        let exponent = largest.leading().shifted(1);
        let relative = three!(axis => difference[axis].fit(&self.relative, exponent));
        let [x, y, z] = relative;
        let camera = three!(row => {
            let [a, b, c] = view.rotation[row];
            (a * x + b * y + c * z).fit(&self.camera, exponent)
        });
        let forward = camera[2].at_least_a_place(&self.camera, exponent);
        let depth = camera[2].at_least(0.0).fit(&self.depth, Scale::ONE);
        let inverse_depth = forward.reciprocal(&self.reciprocal);
        let slope = two!(axis => (camera[axis] * inverse_depth).fit(&self.slope, Scale::ONE));
        Projected {
            camera: [camera[0], camera[1], forward],
            exponent,
            depth,
            inverse_depth,
            slope,
            pixel: two!(axis => (view.focals[axis] * slope[axis] + view.centre[axis]).fit(&self.pixel, Scale::ONE)),
            inside: two!(axis => view.guard[axis] * forward - camera[axis].abs()),
        }
    }
}

//! Contribution over the reals: r at the leaders of a block, as the unit has it.

use super::{Contribution, INPUTS, MOST_LEADERS};
use crate::num::two;
use crate::real::Real;

impl Contribution {
    /// r at the leaders of the block of a pixel: first column, first row. `pixel` is the centre
    /// relative to the picture's middle, `middle` (pixels − 1)/2 of both sides of the picture.
    pub fn real<R: Real>(
        &self,
        pixel: [R; 2],
        conic: [R; 3],
        first: [u32; 2],
        middle: [f64; 2],
    ) -> [R; MOST_LEADERS] {
        let constant = |value: f64| conic[0].constant_like(value);
        let last = f64::from(self.block_px() - 1);
        let [[left, right], [top, bottom]] = two!(axis => {
            let first = f64::from(first[axis]);
            [constant(first), constant(first + last)]
        });
        let inputs: [R; INPUTS] = [
            pixel[0],
            pixel[1],
            conic[0],
            conic[1],
            conic[2],
            // The cutoff is compared with the results.
            constant(0.0),
            left,
            right,
            top,
            bottom,
            constant(middle[0]),
            constant(middle[1]),
        ];
        self.graph.real(&self.asked, inputs, |_, index| index)
    }
}

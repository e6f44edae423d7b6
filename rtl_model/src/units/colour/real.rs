//! Colour over the reals: bounds the distance of a colour from the exact one.
//!
//! The bound follows from the graph: the errors of `direction` are multiplied by the gradients of
//! the polynomials and by the coefficients.

use super::Colour;
use crate::graph::real::{Bounded, Given};
use crate::real::Real;

impl Colour {
    /// The colour over the reals. Coefficients beyond those given are 0.
    pub fn real<R: Real>(
        &self,
        position: [R; 3],
        eye: [R; 3],
        coefficients: impl IntoIterator<Item = [R; 3]>,
    ) -> [R; 3] {
        let zero = position[0].constant_like(0.0);
        let inputs: Vec<[Bounded<R>; 1]> = position
            .into_iter()
            .chain(eye)
            .chain(coefficients.into_iter().flatten())
            .chain(std::iter::repeat(zero))
            .take(Colour::input(self.coefficients, 0))
            .map(|input| [Bounded::of(input)])
            .collect();
        let given = Given {
            inputs: &inputs,
            turned: [None],
        };
        self.graph
            .bounded(&self.asked, &given, |_, x| x)
            .map(|[channel]| channel.value)
    }
}

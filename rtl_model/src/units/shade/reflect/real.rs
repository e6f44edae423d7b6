//! Reflect over the reals: how far mirrored light may lie from the exact one.
//!
//! ```text
//! slope        the register 1/s, and ½p(slope)
//! facing       N·V of a normal that has turned (shade's direction), and ½p(facing)
//! direction    products and sums of these, ½p(direction)
//! coordinate   |x|·1/Σ, the reciprocal's ε, ½p(coordinate); either side of a fold or of the middle where R may be on both
//! light        the map's steps times how far the place is off (functions/map)
//! colour       the registers, ½p(colour)
//! ```

use super::Reflect;
use crate::functions::map::real::RealMap;
use crate::machine::Sight;
use crate::real::{Direction, Real, Scale};

/// What a material does with its surroundings.
#[derive(Clone, Copy, Debug)]
pub struct Mirror<R> {
    /// 1 − reflect.
    pub kept: R,
    /// Reflect times tint.
    pub mirrored: [R; 3],
    /// It reflects nothing, and colours pass as they are.
    pub is_dull: bool,
}

/// Registers that a frame loads.
#[derive(Clone, Debug)]
pub struct Surroundings<R> {
    /// One for each material.
    pub mirrors: Vec<Mirror<R>>,
    /// 1/s_x, 1/s_y.
    pub inverse_focals: [R; 2],
    /// Principal point from the picture's middle, pixels.
    pub centre: [R; 2],
    /// The map.
    pub map: RealMap,
}

impl Reflect {
    /// The map of a frame, from exact texels and its words.
    pub fn real_map(&self, exact: Vec<[f64; 3]>, words: &[[i64; 3]]) -> RealMap {
        RealMap::new(&self.map, exact, words)
    }

    /// The colour that leaves a surface, at most 1; `at` is the pixel's centre from the middle of
    /// the picture.
    pub fn real<R: Real>(
        &self,
        surroundings: &Surroundings<R>,
        material: usize,
        at: [f64; 2],
        normal: &Direction<R>,
        colour: [R; 3],
    ) -> [R; 3] {
        let mirror = &surroundings.mirrors[material];
        let place = self.real_place(self.real_direction(surroundings, at, normal));
        let light = R::look_up(place, &surroundings.map);
        let one = R::constant(1.0);
        std::array::from_fn(|i| {
            (colour[i] * mirror.kept + light[i] * mirror.mirrored[i])
                .min(one)
                .fit(&self.colour, Scale::ONE)
        })
    }

    fn real_direction<R: Real>(
        &self,
        surroundings: &Surroundings<R>,
        at: [f64; 2],
        normal: &Direction<R>,
    ) -> [R; 3] {
        let [zero, one] = [0.0, 1.0].map(R::constant);
        let [a, b] = match self.sight {
            Sight::Axis => [zero; 2],
            Sight::Ray => [0, 1].map(|axis| {
                let from_centre = (-surroundings.centre[axis]).plus(at[axis]);
                (surroundings.inverse_focals[axis] * from_centre).fit(&self.slope, Scale::ONE)
            }),
        };
        let seen = [a, b, one];
        let facing = (-R::dot(normal, seen)).fit(&self.facing, Scale::ONE);
        let axes = [[one, zero, zero], [zero, one, zero], [zero, zero, one]];
        std::array::from_fn(|i| {
            ((facing * R::dot(normal, axes[i])).times(2.0) + seen[i])
                .fit(&self.direction, Scale::ONE)
        })
    }

    fn real_place<R: Real>(&self, [x, y, z]: [R; 3]) -> [R; 2] {
        let [zero, one] = [0.0, 1.0].map(R::constant);
        let sum = (x.abs() + y.abs() + z.abs()).at_least_an_ulp(&self.direction, Scale::ONE);
        let inverse = sum.reciprocal(&self.reciprocal);
        let near = [x, y].map(|part| {
            (part.abs() * inverse)
                .fit(&self.coordinate, Scale::ONE)
                .at_most(1.0)
        });
        let [across, down] = z.branch(zero, || [one - near[1], one - near[0]], || near);
        [(x, across), (y, down)].map(|(part, coordinate)| {
            let [signed] = part.branch(zero, || [coordinate], || [-coordinate]);
            signed.plus(1.0).times(0.5)
        })
    }
}

//! Colour: turns spherical harmonics and the viewing direction into the colour of a splat (Kerbl et
//! al. 2023).
//!
//! ```text
//! position ─►(− eye)─►[ << ]─► relative ─┬─►[ Σ x² ]─►[ 1/√ ]─►(×)─► direction ─►(×)─► monomial ─►(×)─► basis
//!                                        └──────────────────────┘                  direction, monomials, basis ─┐
//! coefficients, 3·(degree + 1)² ─────────────────────────────────────────────────────────────────────►( Σ · )─┴─►(+ ½)─► at least 0 ─► rgb
//! ```
//! A coefficient is stored times the constant of its harmonic, so that the polynomials have whole
//! numbers only. In the order of the coefficients, with (x, y, z) the direction:
//!
//! | degree | polynomials |
//! |---|---|
//! | 0 | 1 |
//! | 1 | y, z, x |
//! | 2 | xy, yz, 2zz − xx − yy, xz, xx − yy |
//! | 3 | y(3xx − yy), x·yz, y(4zz − xx − yy), z(2zz − 3xx − 3yy), x(4zz − xx − yy), z(xx − yy), x(xx − 3yy) |
//!
//! Losses: `relative` is truncated by its normaliser; `direction`, `monomial`, `basis` and `rgb`
//! are rounded to nearest. The sum is exact before it is fitted to the word of a colour.
//!
//! A frame whose harmonics have a lower degree than the unit's has zeros for the other coefficients.
//!
//! Laws: `a_colour_is_within_its_bound`, `a_batch_has_the_colours_of_single_splats`.

use crate::elaboration::Elaboration;
use crate::elaboration::latency::Path;
use crate::functions::ReciprocalRoot;
use crate::graph::{Asked, Builder, Graph, Power, Program, Wire};
use crate::machine::{self, Machine};
use crate::num::{Exact, three};
use crate::records::unit;

const UNIT: &str = unit::COLOUR;

/// Greatest degree of harmonics.
pub const MOST_DEGREE: u32 = 3;

/// Inputs before the coefficients: position, eye.
const BEFORE: usize = 6;

/// Coefficients of one channel.
pub const fn coefficients(degree: u32) -> usize {
    ((degree + 1) * (degree + 1)) as usize
}

/// Degree of a description, limited to what exists.
fn degree(words: &machine::Colour) -> u32 {
    words.degree.clamp(1, MOST_DEGREE)
}

/// Products per splat of a degree: three squares, an inverse root's, three for scaling; monomials;
/// and three channels of all coefficients except the constant one, which needs no product. A colour
/// of degree 0 is the same from all directions and needs no products.
pub fn products(words: &machine::Colour, degree: u32) -> u32 {
    let monomials = match degree {
        0 => return 0,
        1 => 0,
        // Squares and products of two coordinates.
        2 => 6,
        // Each of the seven polynomials is a sum of some of these times a coordinate.
        _ => 13,
    };
    let root = 3 * words.root.newton_steps.min(3);
    3 + root + 3 + monomials + 3 * (coefficients(degree) as u32 - 1)
}

/// Bits of a splat's coefficients in memory.
pub fn bits(words: &machine::Colour, degree: u32) -> i32 {
    3 * coefficients(degree) as i32 * words.coefficient.format.stored_bits()
}

/// Critical path with harmonics of a degree.
pub fn path(machine: &Machine, words: &machine::Colour, degree: u32) -> Path {
    let e = &mut Elaboration::new(machine.operators);
    let g = &mut Builder::new(e, UNIT);
    let words = machine::Colour { degree, ..*words };
    let rgb = coloured(g, machine, &words);
    g.build(rgb).path()
}

/// Polynomials of harmonics, except the constant one, in the order of the coefficients.
fn polynomials(g: &mut Builder, words: &machine::Colour, [x, y, z]: [Wire; 3]) -> Vec<Wire> {
    let mut all = vec![y, z, x];
    let degree = degree(words);
    if degree < 2 {
        return all;
    }
    let monomial = |g: &mut Builder, a, b| {
        let product = g.times(a, b);
        g.fit("monomial", words.monomial, product)
    };
    let [xx, yy, zz] = [x, y, z].map(|axis| monomial(g, axis, axis));
    let [xy, yz, xz] = [(x, y), (y, z), (x, z)].map(|(a, b)| monomial(g, a, b));
    let across = g.plus(xx, yy);
    let along = g.scaled(zz, 1);
    let rest = g.minus(along, across);
    let skew = g.minus(xx, yy);
    all.extend([xy, yz, rest, xz, skew]);
    if degree < 3 {
        return all;
    }
    let basis = |g: &mut Builder, a, b| {
        let product = g.times(a, b);
        g.fit("basis", words.basis, product)
    };
    let ([xx_twice, yy_twice, across_twice], zz_4) = (
        [xx, yy, across].map(|wire| g.scaled(wire, 1)),
        g.scaled(zz, 2),
    );
    // 3xx − yy, 4zz − xx − yy, 2zz − 3xx − 3yy, xx − 3yy.
    let to_y = g.plus(skew, xx_twice);
    let over = g.minus(zz_4, across);
    let to_z = g.minus(rest, across_twice);
    let to_x = g.minus(skew, yy_twice);
    all.extend(
        [
            (y, to_y),
            (x, yz),
            (y, over),
            (z, to_z),
            (x, over),
            (z, skew),
            (x, to_x),
        ]
        .map(|(a, b)| basis(g, a, b)),
    );
    all
}

/// The sum of some wires, by a tree of adders.
fn sum(g: &mut Builder, mut terms: Vec<Wire>) -> Wire {
    while terms.len() > 1 {
        terms = terms
            .chunks(2)
            .map(|pair| match *pair {
                [a, b] => g.plus(a, b),
                _ => pair[0],
            })
            .collect();
    }
    terms[0]
}

/// The colour of a splat from its position, the eye, and the coefficients of red, green and blue
/// one after the other.
fn coloured(g: &mut Builder, machine: &Machine, words: &machine::Colour) -> [Wire; 3] {
    let position = three!(_i => g.input(machine.splat.position));
    let eye = three!(_i => g.input(machine.project.eye));
    let given: Vec<[Wire; 3]> = (0..coefficients(degree(words)))
        .map(|_| three!(_channel => g.input(words.coefficient)))
        .collect();

    let relative = g.relative(words.relative, position, eye);
    let squared = g.dot(relative, relative);
    let squared = g.known_natural(squared);
    let positive = g.at_least_an_ulp(squared);
    let inverse = g.inverse_root("root", words.root, positive);
    let direction = three!(axis => {
        let scaled = g.times(relative[axis], inverse);
        g.fit_to("direction", words.direction, scaled, Power::ONE)
    });
    let polynomials = polynomials(g, words, direction);
    three!(channel => {
        let terms = given[1..]
            .iter()
            .zip(&polynomials)
            .map(|(coefficient, polynomial)| g.times(coefficient[channel], *polynomial))
            .collect();
        let of_direction = sum(g, terms);
        let half = g.constant(1, HALF);
        let constant = g.plus(given[0][channel], half);
        let whole = g.plus(of_direction, constant);
        let natural = g.natural(whole);
        g.fit("rgb", machine.splat.rgb, natural)
    })
}

/// The shape of the word 1 that represents ½.
const HALF: Exact = Exact {
    int_bits: 0,
    frac_bits: 1,
};

/// Elaborated unit.
#[derive(Clone, Debug)]
pub struct Colour {
    graph: Graph<3>,
    program: Program,
    asked: Asked<3>,
    coefficients: usize,
}

impl Colour {
    /// Elaborates the unit, on a machine that has it.
    pub fn new(e: &mut Elaboration, machine: &Machine) -> Option<Self> {
        let words = machine.colour.as_ref()?;
        e.within(UNIT, "degree", words.degree, 1, MOST_DEGREE);
        for (name, word) in [
            ("coefficient", words.coefficient),
            ("relative", words.relative),
            ("direction", words.direction),
            ("monomial", words.monomial),
            ("basis", words.basis),
        ] {
            e.number(UNIT, name, word, true);
        }
        let g = &mut Builder::new(e, UNIT);
        let rgb = coloured(g, machine, words);
        let graph = g.build(rgb);
        Some(Colour {
            program: graph.program(),
            asked: graph.asked_for_results(),
            graph,
            coefficients: coefficients(degree(words)),
        })
    }

    /// Computes red, green and blue (`splat.rgb`) from position, eye and coefficients.
    pub fn graph(&self) -> &Graph<3> {
        &self.graph
    }

    /// The graph compiled for batches.
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// 1/|relative|.
    pub fn root(&self) -> &ReciprocalRoot {
        &self.graph.roots()[0]
    }

    /// Coefficients of one channel.
    pub fn coefficients(&self) -> usize {
        self.coefficients
    }

    /// The input of the eye's first coordinate.
    pub const EYE: usize = 3;

    /// The input of a coefficient of a channel.
    pub const fn input(coefficient: usize, channel: usize) -> usize {
        BEFORE + 3 * coefficient + channel
    }
}

pub mod real;

#[cfg(test)]
mod tests;

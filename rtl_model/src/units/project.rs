//! Project: transforms a splat's centre to camera space and to the screen (Surface Splatting §3,
//! first half of "setup").
//!
//! ```text
//! position ─►(− eye)─►[ << ]─► relative ─►[ W· ]─► camera t ─┬─►[ 1/t_z ]─► inverse_depth ─┐
//!                       └─► exponent ──────────────┐         ├────────────────────────────(×)─► slope (a, b) ─►(× s)─►(+ centre)─► pixel
//!                                                  └────────►[ >> ]─► depth t_z
//! ```
//! For each splat the unit chooses a power of two near the splat's distance from the eye, and t is
//! relative to that power. It cancels in the quotients a and b. Splats at a distance of 0.01 units
//! and of 100 units therefore keep the same relative precision in the same words.
//!
//! Losses: `relative` is truncated by its normaliser. `camera`, `depth`, `slope` and `pixel` are
//! rounded to nearest: a picture averages the errors of many splats, and truncation would shift it.
//! The reciprocal's inner words are described with the reciprocal.
//!
//! Culls: *near* where t_z ≤ near; *outside* where |a| or |b| exceeds the guard band. The guard
//! band is tested as |t_x| > guard·t_z, exactly and before the division, so that a quotient never
//! saturates. *Transparent* where an ellipsoid's opacity is below the least opacity whose weights
//! count.
//!
//! Law: `a_projected_point_is_within_its_ulps`.

use crate::elaboration::Elaboration;
use crate::frame::View;
use crate::functions::Reciprocal;
use crate::graph::{Asked, Builder, Graph, Power, Program, Wire};
use crate::machine::Machine;
use crate::num::{Exact, three, two};
use crate::records::unit;

const UNIT: &str = unit::PROJECT;

/// Elaborated unit.
#[derive(Clone, Debug)]
pub struct Project {
    graph: Graph<OUTPUTS>,
    program: Program,
    bounds: Asked<BOUNDS>,
}

/// Inputs: position, and whether the opacity is too low; then [`registers`].
pub const INPUTS: usize = 4;
/// Results: camera, exponent, depth, 1/t_z and its exponent, slope, pixel, near, outside.
pub const OUTPUTS: usize = 13;
/// Results that have bounds: camera, exponent, depth, 1/t_z, slope, pixel.
const BOUNDS: usize = 10;

/// Registers of a view, in the graph's input order: eye, rotation, near, guard band, focal lengths,
/// centre.
pub fn registers(view: &View) -> [i64; 19] {
    let ([x, y, z], [[a, b, c], [d, e, f], [g, h, i]]) = (view.eye, view.rotation);
    let ([focal_x, focal_y], [guard_x, guard_y], [centre_x, centre_y]) =
        (view.focals(), view.guard, view.centre);
    [
        x, y, z, a, b, c, d, e, f, g, h, i, view.near, guard_x, guard_y, focal_x, focal_y,
        centre_x, centre_y,
    ]
}

/// A splat's centre in camera space and on the screen, and its cull flags; then the wires that have
/// bounds.
fn projected(g: &mut Builder, machine: &Machine) -> ([Wire; OUTPUTS], [Wire; BOUNDS]) {
    let m = &machine.project;
    let position = three!(_i => g.input(machine.splat.position));
    let transparent = g.condition_input();
    let eye = three!(_i => g.input(m.eye));
    let rotation = three!(_row => three!(_i => g.input(m.rotation)));
    let near_plane = g.input(m.depth);
    let guard = two!(_i => g.input(m.slope));
    let focal = two!(_i => g.input(m.focal));
    let centre = two!(_i => g.input(m.pixel));

    let relative = g.relative(m.relative, position, eye);
    let camera = three!(row => {
        let turned = g.dot(rotation[row], relative);
        g.fit("camera", m.camera, turned)
    });
    let exponent = g.power(camera[2]);
    let forward = g.at_least_an_ulp(camera[2]);
    let ahead = g.not_below_0(camera[2]);
    let depth = g.fit_to("depth", m.depth, ahead, Power::ONE);
    let is_ahead = g.above(depth, near_plane);
    let near = g.not(is_ahead);
    // The most negative word's magnitude is one more than the greatest word.
    let [beyond_x, beyond_y] = two!(axis => {
        let limit = g.times(guard[axis], forward);
        let across = g.magnitude(camera[axis]);
        g.above(across, limit)
    });
    let outside = g.either(beyond_x, beyond_y);
    let off = g.either(near, outside);
    let culled = g.either(off, transparent);
    g.drop_where(culled);

    let inverse = g.reciprocal("reciprocal", m.reciprocal, forward);
    // The binary point of the quotient moves with the exponent of 1/t_z.
    let slope = two!(axis => {
        let offset = g.guarded(camera[axis], off, 0);
        let quotient = g.times(offset, inverse);
        g.fit_to("slope", m.slope, quotient, Power::ONE)
    });
    let pixel = two!(axis => {
        let screen = g.times(focal[axis], slope[axis]);
        let from_middle = g.plus(screen, centre[axis]);
        g.fit("pixel", m.pixel, from_middle)
    });
    let inverse_power = g.power(inverse);
    let (exponent_word, inverse_exponent) = (
        g.exponent_of(exponent),
        g.exponent_of(inverse_power.times(exponent)),
    );
    let ([x, y, _], [a, b], [column, row]) = (camera, slope, pixel);
    (
        [
            x,
            y,
            forward,
            exponent_word,
            depth,
            inverse,
            inverse_exponent,
            a,
            b,
            column,
            row,
            near,
            outside,
        ],
        [
            x,
            y,
            forward,
            exponent_word,
            depth,
            inverse,
            a,
            b,
            column,
            row,
        ],
    )
}

impl Project {
    /// Elaborates the unit.
    pub fn new(e: &mut Elaboration, machine: &Machine) -> Self {
        let m = &machine.project;
        for (name, word, signed) in [
            ("eye", m.eye, true),
            ("relative", m.relative, true),
            ("rotation", m.rotation, true),
            ("camera", m.camera, true),
            ("depth", m.depth, false),
            ("slope", m.slope, true),
            ("focal", m.focal, false),
            ("pixel", m.pixel, true),
        ] {
            e.number(UNIT, name, word, signed);
        }
        e.holds_one(UNIT, "rotation", m.rotation);
        e.require(m.pixel.format.frac_bits >= 1, || {
            "project.pixel needs at least one fraction bit: pixel centres lie at halves".into()
        });
        let difference = Exact::from(machine.splat.position).plus(m.eye);
        e.holds_exact(
            "the difference of splat.position and project.eye",
            difference,
        );
        // |t_x| is aligned with guard · t_z: a magnitude and a comparison, one bit wider than the
        // product.
        let beyond = Exact::from(m.camera).times(m.slope).plus(m.camera);
        e.adders(UNIT, 4, beyond.bits());
        e.limit(UNIT, m.camera.format.width());
        e.adders(UNIT, 1, m.depth.format.width());
        e.holds_exact(
            "the comparison of project.camera with the guard band project.slope",
            beyond,
        );
        // An ellipsoid's opacity is compared with the least opacity.
        if machine.ellipse.ellipsoid.is_some() {
            e.adders(UNIT, 1, machine.splat.opacity.format.width());
        }
        let g = &mut Builder::new(e, UNIT);
        let (results, bounded) = projected(g, machine);
        let graph = g.build(results);
        Project {
            program: graph.program(),
            bounds: graph.asked(bounded),
            graph,
        }
    }

    /// Computes a splat's centre on the screen from its position, the flag for too low an opacity,
    /// and a view's [`registers`].
    pub fn graph(&self) -> &Graph<OUTPUTS> {
        &self.graph
    }

    /// The graph compiled for batches.
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// 1/t_z.
    pub fn reciprocal(&self) -> &Reciprocal {
        &self.graph.reciprocals()[0]
    }
}

pub mod real;

#[cfg(test)]
mod tests;

//! Gauss: turns a radial index into a weight, `amplitude · exp(−r/2)`, from one table (EWA §7.1).
//!
//! ```text
//! radial_index ─►[table]─► falloff ─►(×)─► weight
//! amplitude ─────────────────────────┘
//! ```
//! Losses: `radial_index` is clamped to the table's range; `falloff` and `weight` are rounded to
//! nearest. Weights are summed many times, and truncation would bias coverage. Colours are divided
//! by the same sum, so a bias would cancel there.
//!
//! Law: `a_weight_never_exceeds_its_amplitude`.

use crate::elaboration::{Elaboration, Operator};
use crate::functions::{Table, table};
use crate::graph::{Asked, Builder, Graph, Wire};
use crate::kernels::{Weigh, WeighShape};
use crate::machine::Machine;
use crate::num::Exact;
use crate::records::unit;

const UNIT: &str = unit::GAUSS;

/// A·e^(−r/2) from the table's argument.
fn weight(
    g: &mut Builder,
    machine: &Machine,
    table: Table,
    radial_index: Wire,
    amplitude: Wire,
) -> Wire {
    let falloff = g.look_up("table", table, radial_index);
    let product = g.times(amplitude, falloff);
    g.fit("weight", machine.gauss.weight, product)
}

/// Table of e^(−r/2).
fn falloff(e: &mut Elaboration, machine: &Machine) -> Table {
    let (m, argument) = (&machine.gauss, machine.gauss.radial_index.format);
    let shape = table::shape(e, UNIT, "table", m.table, argument.width());
    let falloff = m.falloff.format;
    let words = table::gaussian_words(
        shape.index_bits,
        argument.int_bits.min(5),
        shape.interpolation,
        falloff.one().min(falloff.max()).clamp(0, 1 << 31) as u64,
    );
    e.part(
        UNIT,
        Operator::Rom([words.len() as i32, m.falloff.format.width()]),
    );
    let fraction_bits = Table::fraction_bits(shape.index_bits, argument.width() as u32);
    table::interpolator(e, UNIT, shape, m.falloff, fraction_bits);
    let fit = e.fit(
        UNIT,
        "falloff",
        m.falloff,
        table::interpolated(m.falloff, fraction_bits),
    );
    Table::new(
        fit,
        shape.index_bits,
        argument.width() as u32,
        shape.interpolation,
        &words,
    )
}

/// Weights from arguments of the table, without the clamp before it: inputs are `radial_index` and
/// `amplitude`.
pub fn weights(machine: &Machine) -> Graph<1> {
    let e = &mut Elaboration::new(machine.operators);
    let table = falloff(e, machine);
    let g = &mut Builder::new(e, UNIT);
    let (radial_index, amplitude) = (
        g.input(machine.gauss.radial_index),
        g.input(machine.ellipse.amplitude),
    );
    let weight = weight(g, machine, table, radial_index, amplitude);
    g.build([weight])
}

/// Elaborated unit.
#[derive(Clone, Debug)]
pub struct Gauss {
    /// Radial index and weight, from a non-negative r and the amplitude.
    graph: Graph<2>,
    asked: Asked<1>,
    kernel: Weigh,
    /// The table's arguments are below 2^`range_bits`.
    range_bits: i32,
}

impl Gauss {
    /// Elaborates the unit.
    pub fn new(e: &mut Elaboration, machine: &Machine) -> Self {
        let m = &machine.gauss;
        for (name, word) in [
            ("radial_index", m.radial_index),
            ("falloff", m.falloff),
            ("weight", m.weight),
        ] {
            e.number(UNIT, name, word, false);
        }
        e.fixed_point(UNIT, "radial_index", m.radial_index);
        // A word without integer bits holds 1 less an LSB. The table is scaled by that.
        e.holds_one_or_an_ulp_less(machine, UNIT, "falloff", m.falloff);
        let argument = m.radial_index.format;
        e.require(argument.int_bits <= 5, || {
            format!(
                "gauss.radial_index is {}: the table spans at most 32, U5F{}",
                m.radial_index, argument.frac_bits
            )
        });
        let table = falloff(e, machine);
        let g = &mut Builder::new(e, UNIT);
        let (radial, amplitude) = (
            g.state(machine.raster.radial.into(), false),
            g.input(machine.ellipse.amplitude),
        );
        let radial_index = g.fit("radial_index", m.radial_index, radial);
        let weight = weight(g, machine, table, radial_index, amplitude);
        let graph = g.build([radial_index, weight]);
        let amplitude = machine.ellipse.amplitude;
        let weighed = Exact::from(amplitude).times(m.falloff).int_bits;
        let shape = WeighShape {
            radial: machine.raster.cutoff.format.int_bits,
            weighed,
            amplitude: amplitude.format.max(),
        };
        Gauss {
            asked: graph.asked([weight]),
            kernel: Weigh::new(graph.fits(), &graph.tables()[0], shape),
            graph,
            range_bits: argument.int_bits,
        }
    }

    /// e^(−r/2) from a radial index.
    pub fn table(&self) -> &Table {
        &self.graph.tables()[0]
    }

    /// Radial index and weight of a fragment, from a non-negative `raster.radial` and
    /// `ellipse.amplitude`.
    pub fn graph(&self) -> &Graph<2> {
        &self.graph
    }

    /// The graph for the host, eight lanes wide.
    pub fn kernel(&self) -> &Weigh {
        &self.kernel
    }
}

pub mod real;

#[cfg(test)]
mod tests;

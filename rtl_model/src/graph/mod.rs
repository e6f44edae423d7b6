//! Graph: the arithmetic of a unit, stated once, as operators on wires. It is built when a machine is elaborated; what else is made of it is
//! a pass, a file each.
//!
//! ```text
//! a unit's function ─► Builder ─┬─► parts, signals, misfits          as it is built
//!                               └─► Graph ─┬─► one item at a time    mod.rs: what every operator means
//!                                          ├─► a batch of items      run.rs: the same, in the narrowest words
//!                                          └─► bounds                real.rs
//! ```
//! A wire has a shape: how far it reaches above and below the binary point. Sums and products grow; [`Builder::fit`] is the only operator that
//! loses bits, at a named signal.
//!
//! Law: `a_batch_equals_one_item_at_a_time`.

mod real;
mod run;

pub use run::{BATCH, Batch, Program, ROWS, Run};

use crate::elaboration::{self, Elaboration};
use crate::functions::Table;
use crate::num::{Exact, Fit, Word, align};
use crate::probe::{Probe, Tap};

/// The result of an operator: its place among a graph's nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wire(u16);

impl Wire {
    fn place(self) -> usize {
        usize::from(self.0)
    }
}

/// An operator.
#[derive(Clone, Copy, Debug)]
enum Operator {
    /// What the graph is applied to, by its place among the inputs.
    Input(usize),
    Constant(i64),
    Product([Wire; 2]),
    /// Terms, each shifted left to the common binary point.
    Sum([Wire; 2], [u32; 2]),
    Difference([Wire; 2], [u32; 2]),
    /// At least 0.
    Natural(Wire),
    /// At most so much, in the wire's own places.
    AtMost(Wire, i64),
    /// A table's word, by the table's place.
    Lookup(Wire, usize),
    Fit(Wire, Fit),
}

impl Operator {
    /// Wires that it reads.
    fn reads(&self) -> impl Iterator<Item = Wire> {
        let (first, second) = match *self {
            Operator::Input(_) | Operator::Constant(_) => (None, None),
            Operator::Product([a, b]) | Operator::Sum([a, b], _) | Operator::Difference([a, b], _) => (Some(a), Some(b)),
            Operator::Natural(from) | Operator::AtMost(from, _) | Operator::Lookup(from, _) | Operator::Fit(from, _) => (Some(from), None),
        };
        first.into_iter().chain(second)
    }
}

/// An operator and the shape of its result.
#[derive(Clone, Copy, Debug)]
struct Node {
    operator: Operator,
    shape: Exact,
    /// Whether it may be negative.
    signed: bool,
}

impl Node {
    /// Bits of a result, its sign included.
    fn bits(&self) -> i32 {
        self.shape.bits() + i32::from(self.signed)
    }
}

/// Builds a graph for a unit, and declares what it takes: parts, signals, misfits.
#[derive(Debug)]
pub struct Builder<'e> {
    e: &'e mut Elaboration,
    unit: &'static str,
    nodes: Vec<Node>,
    tables: Vec<Table>,
    inputs: usize,
}

impl<'e> Builder<'e> {
    /// An empty graph of a unit.
    pub fn new(e: &'e mut Elaboration, unit: &'static str) -> Self {
        Builder { e, unit, nodes: Vec::new(), tables: Vec::new(), inputs: 0 }
    }

    fn node(&mut self, operator: Operator, shape: Exact, signed: bool) -> Wire {
        self.nodes.push(Node { operator, shape, signed });
        Wire((self.nodes.len() - 1) as u16)
    }

    fn of(&self, wire: Wire) -> Node {
        self.nodes[wire.place()]
    }

    /// The next input, a word.
    pub fn input(&mut self, word: Word) -> Wire {
        self.state(word.into(), word.format.signed)
    }

    /// The next input, an exact result that is kept from one item to the next, or comes from another graph.
    pub fn state(&mut self, shape: Exact, signed: bool) -> Wire {
        self.inputs += 1;
        self.node(Operator::Input(self.inputs - 1), shape, signed)
    }

    /// 1, in the places of a word or an exact result.
    pub fn one(&mut self, places: impl Into<Exact>) -> Wire {
        let frac_bits = places.into().frac_bits;
        self.node(Operator::Constant(1 << frac_bits.clamp(0, 62)), Exact { int_bits: 1, frac_bits }, false)
    }

    /// Exact product, by a multiplier.
    pub fn times(&mut self, a: Wire, b: Wire) -> Wire {
        let [x, y] = [a, b].map(|wire| self.of(wire));
        let operator = elaboration::Operator::Multiplier([x.bits(), y.bits()]);
        self.e.part(self.unit, operator);
        self.node(Operator::Product([a, b]), x.shape.times(y.shape), x.signed || y.signed)
    }

    /// A sum that is known to have no more than a shape, by an adder as wide.
    pub fn plus_within(&mut self, a: Wire, b: Wire, shape: Exact) -> Wire {
        let [x, y] = [a, b].map(|wire| self.of(wire));
        self.e.adders(self.unit, 1, shape.bits());
        let lefts = align([x.shape.frac_bits, y.shape.frac_bits]);
        self.node(Operator::Sum([a, b], lefts), shape, x.signed || y.signed)
    }

    /// A difference that is known to have no more than a shape, by an adder as wide.
    pub fn minus_within(&mut self, a: Wire, b: Wire, shape: Exact) -> Wire {
        let lefts = align([a, b].map(|wire| self.of(wire).shape.frac_bits));
        self.e.adders(self.unit, 1, shape.bits());
        self.node(Operator::Difference([a, b], lefts), shape, true)
    }

    /// What is left of `a`, of which `b` is a part: a difference that has no more than a shape, and is not negative.
    pub fn rest(&mut self, a: Wire, b: Wire, shape: Exact) -> Wire {
        let difference = self.minus_within(a, b, shape);
        self.nodes[difference.place()].signed = false;
        difference
    }

    /// At least 0, by a choice that a difference's own sign makes.
    pub fn natural(&mut self, from: Wire) -> Wire {
        let shape = self.of(from).shape;
        self.e.choice(self.unit, 2, shape.bits());
        self.node(Operator::Natural(from), shape, false)
    }

    /// At most 1. What saturates the word that comes of it limits this too, so that it takes no part of its own.
    pub fn at_most_one(&mut self, from: Wire) -> Wire {
        let Node { shape, signed, .. } = self.of(from);
        self.node(Operator::AtMost(from, 1 << shape.frac_bits.clamp(0, 62)), shape, signed)
    }

    /// The only operator that loses bits: puts an exact result into the word called `name`.
    pub fn fit(&mut self, name: &str, word: Word, from: Wire) -> Wire {
        let fit = self.e.fit(self.unit, name, word, self.of(from).shape);
        self.node(Operator::Fit(from, fit), word.into(), word.format.signed)
    }

    /// A word of a table, which the fit of the table makes.
    pub fn look_up(&mut self, table: Table, argument: Wire) -> Wire {
        let word = table.fit().word;
        self.tables.push(table);
        self.node(Operator::Lookup(argument, self.tables.len() - 1), word.into(), word.format.signed)
    }

    /// The graph, with these results.
    pub fn build<const OUTPUTS: usize>(&mut self, outputs: [Wire; OUTPUTS]) -> Graph<OUTPUTS> {
        let (nodes, tables) = (std::mem::take(&mut self.nodes), std::mem::take(&mut self.tables));
        Graph { nodes, tables, outputs }
    }
}

/// A unit's arithmetic.
#[derive(Clone, Debug)]
pub struct Graph<const OUTPUTS: usize> {
    nodes: Vec<Node>,
    tables: Vec<Table>,
    outputs: [Wire; OUTPUTS],
}

impl<const OUTPUTS: usize> Graph<OUTPUTS> {
    /// Results of one item.
    pub fn one<P: Probe>(&self, inputs: &[i64], tap: &mut Tap<P>) -> [i64; OUTPUTS] {
        let mut results: Vec<i64> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let of = |wire: Wire| results[wire.place()];
            let result = match node.operator {
                Operator::Input(place) => inputs[place],
                Operator::Constant(value) => value,
                Operator::Product([a, b]) => of(a) * of(b),
                Operator::Sum([a, b], [p, q]) => (of(a) << p) + (of(b) << q),
                Operator::Difference([a, b], [p, q]) => (of(a) << p) - (of(b) << q),
                Operator::Natural(from) => of(from).max(0),
                Operator::AtMost(from, most) => of(from).min(most),
                Operator::Lookup(from, table) => tap.fit_one(self.tables[table].fit(), self.tables[table].exact(of(from))),
                Operator::Fit(from, ref fit) => tap.fit_one(fit, of(from)),
            };
            results.push(result);
        }
        self.outputs.map(|wire| results[wire.place()])
    }

    /// The fits of its results, which are words.
    ///
    /// # Panics
    /// Where a result is not fitted.
    pub fn fits(&self) -> [Fit; OUTPUTS] {
        self.outputs.map(|wire| match self.nodes[wire.place()].operator {
            Operator::Fit(_, fit) => fit,
            other => panic!("{other:?} is not a word"),
        })
    }

    /// Its tables, in the order in which they are looked up.
    pub fn tables(&self) -> &[Table] {
        &self.tables
    }

    /// The same arithmetic for batches.
    pub fn program(&self) -> Program {
        Program::new(&self.nodes, &self.tables, &self.outputs)
    }
}

#[cfg(test)]
mod tests;

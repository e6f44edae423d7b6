//! Delay: the longest path through a graph, from any input to any result.
//!
//! A wire is there when the last of its operands is. Operators that lie side by side take the time
//! of the slowest one.
//!
//! Law: `the_longest_path_is_that_of_the_slowest_operand`.

use super::{Body, Graph, Node, Operator, Wire};
use crate::elaboration::EXPONENT_BITS;
use crate::elaboration::latency::Path;
use crate::functions::{reciprocal, square_root, table};
use crate::machine::TableShape;

impl<const OUTPUTS: usize> Graph<OUTPUTS> {
    /// The longest path to any result.
    pub fn path(&self) -> Path {
        self.paths()
            .into_iter()
            .fold(Path::default(), Path::parallel)
    }

    /// The longest path to each result.
    pub fn paths(&self) -> [Path; OUTPUTS] {
        let arrivals = self.body.arrivals();
        self.outputs.map(|wire| arrivals[wire.place()])
    }
}

impl Body {
    /// The longest path to each node.
    fn arrivals(&self) -> Vec<Path> {
        let mut arrivals: Vec<Path> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let mut latest = Path::default();
            match node.operator {
                // Only the host waits for the condition.
                Operator::Guarded(from, ..) => latest = arrivals[from.place()],
                operator => {
                    operator.reads(|wire| latest = latest.parallel(arrivals[wire.place()]));
                }
            }
            let path = self.through(node, latest);
            arrivals.push(path);
        }
        arrivals
    }

    fn node(&self, wire: Wire) -> &Node {
        &self.nodes[wire.place()]
    }

    fn bits(&self, wire: Wire) -> i32 {
        self.node(wire).bits()
    }

    /// A path through an operator.
    fn through(&self, node: &Node, path: Path) -> Path {
        let bits = node.bits();
        let path = match node.operator {
            // An adder in floating point compares exponents, and shifts the term with the lesser
            // one.
            Operator::Sum(..) | Operator::Difference(..) if node.is_float() => path
                .compare(EXPONENT_BITS)
                .choose(2)
                .shift(node.significant_bits),
            // The bits of what has an exponent are shifted to their places.
            Operator::Sum([a, b], _)
            | Operator::Difference([a, b], _)
            | Operator::Above([a, b], _)
                if self.node(a).is_float() || self.node(b).is_float() =>
            {
                path.shift(self.bits(a).max(self.bits(b)))
            }
            _ => path,
        };
        match node.operator {
            Operator::Product([a, b]) => {
                path.product(self.node(a).factor_bits(), self.node(b).factor_bits())
            }
            Operator::Sum(..) | Operator::Difference(..) => path.sum(node.factor_bits()),
            Operator::Above([a, b], lefts) => {
                let bits = [a, b].map(|wire| self.bits(wire));
                path.compare((bits[0] + lefts[0] as i32).max(bits[1] + lefts[1] as i32))
            }
            // Its adder is there, or what reads it subtracts instead of adding.
            Operator::Magnitude(from) => path.compare(self.bits(from)),
            Operator::Largest([part, ..]) => path.compare(self.bits(part)),
            Operator::Turned(from, _) => path.compare(self.bits(from)),
            Operator::AtMost(..) | Operator::Lesser(_) | Operator::Greater(_) => path.limit(bits),
            Operator::Opposed(..) | Operator::Natural(_) | Operator::AtLeastOne(_) => {
                path.choose(2)
            }
            Operator::Fit(from, fit)
            | Operator::FitShifted(from, _, fit)
            | Operator::Rounded(from, fit) => {
                let is_float = fit.word.format.is_float();
                let path = match (node.operator, is_float) {
                    (Operator::FitShifted(..), true) => path.compare(EXPONENT_BITS),
                    (Operator::FitShifted(..), false) => path.shift(bits),
                    (_, false) if self.node(from).is_float() => path.shift(self.bits(from)),
                    _ => path,
                };
                path.fit_word(fit.word, self.node(from).factor_bits())
            }
            Operator::Lead(from) => path.count(self.bits(from)),
            Operator::Normalised(from, _) => path.shift(self.bits(from)),
            Operator::Exponents(power) if power.terms().len() > 1 => path.compare(EXPONENT_BITS),
            Operator::Reciprocal(x, unit) => path.then(reciprocal::path(
                self.functions.reciprocals[unit].shape(),
                self.bits(x),
            )),
            Operator::InverseRoot(x, unit) => path.then(square_root::path(
                self.functions.roots[unit].shape(),
                self.bits(x),
            )),
            Operator::Root(x, unit) => {
                let shape = self.functions.roots[unit].shape();
                let word = shape.bits.min(64) as i32;
                path.then(square_root::path(shape, self.bits(x)))
                    .product(word, word)
            }
            Operator::Lookup(_, nth) => {
                let table = &self.functions.tables[nth];
                let shape = TableShape {
                    index_bits: table.index_bits(),
                    interpolation: table.interpolation(),
                };
                path.then(table::path(shape, table.fit().word.format.stored_bits()))
            }
            // Wires, and single gates.
            Operator::Input(_)
            | Operator::Constant(_)
            | Operator::Negation(_)
            | Operator::AtLeast(..)
            | Operator::APlaceMore(_)
            | Operator::Guarded(..)
            | Operator::Scaled(..)
            | Operator::Exponent(_)
            | Operator::Exponents(_)
            | Operator::Either(_)
            | Operator::Both(_)
            | Operator::Not(_)
            | Operator::Drop(_) => path,
        }
    }
}

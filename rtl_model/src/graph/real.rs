//! Real: a graph over real numbers: bounds, or the losses of some words alone ([`Real`]).

use super::{Graph, Operator};
use crate::functions::Table;
use crate::num::real::power_of_two;
use crate::real::{Real, Scale};

/// Most nodes of a graph.
const MOST: usize = 32;

impl<const OUTPUTS: usize> Graph<OUTPUTS> {
    /// Results of one item; `look_up` is the function that a table stands for.
    #[inline]
    pub fn real<R: Real>(&self, inputs: &[R], look_up: impl Fn(&Table, R) -> R) -> [R; OUTPUTS] {
        let mut results = [R::constant(0.0); MOST];
        for (place, node) in self.nodes.iter().enumerate() {
            let value = |word: i64| word as f64 * power_of_two(-node.shape.frac_bits);
            results[place] = match node.operator {
                Operator::Input(place) => inputs[place],
                Operator::Constant(word) => R::constant(value(word)),
                Operator::Product([a, b]) => results[a.place()] * results[b.place()],
                Operator::Sum([a, b], _) => results[a.place()] + results[b.place()],
                Operator::Difference([a, b], _) => results[a.place()] - results[b.place()],
                Operator::Natural(from) => results[from.place()].max(R::constant(0.0)),
                Operator::AtMost(from, most) => results[from.place()].at_most(value(most)),
                Operator::Lookup(from, table) => {
                    let table = &self.tables[table];
                    look_up(table, results[from.place()]).fit(table.fit(), Scale::ONE)
                }
                Operator::Fit(from, ref fit) => results[from.place()].fit(fit, Scale::ONE),
            };
        }
        self.outputs.map(|wire| results[wire.place()])
    }
}

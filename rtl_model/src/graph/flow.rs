//! Flow: which words of a graph are made from which, for pictures of a datapath.
//!
//! Words of the same name are one: three coordinates are a word of three wires. Operators between
//! two words are left out, and so is what only decides on a shift.
//!
//! Law: `a_word_is_made_from_the_words_that_its_operators_read`.

use super::{Body, Graph, Operator, Wire};
use crate::elaboration::Signal;
use crate::num::{Exact, Fit};
use std::collections::BTreeSet;

/// A word of a graph.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Flow {
    /// Unit and signal, such as `project.camera`; of an input, the name that was given.
    pub name: String,
    /// Its format.
    pub format: String,
    /// Wires of this name.
    pub wires: usize,
    /// Names of the words that it is made from.
    pub from: Vec<String>,
}

impl<const OUTPUTS: usize> Graph<OUTPUTS> {
    /// Its words, each after those that it is made from. Inputs without a name are left out.
    ///
    /// # Panics
    /// Where there are fewer names than inputs.
    pub fn flow(&self, signals: &[Signal], inputs: &[Option<String>]) -> Vec<Flow> {
        self.body.flow(signals, inputs)
    }
}

impl Body {
    fn flow(&self, signals: &[Signal], inputs: &[Option<String>]) -> Vec<Flow> {
        let mut words: Vec<Flow> = Vec::new();
        // Of each node the words that it is made from.
        let mut sources: Vec<BTreeSet<usize>> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let mut from = BTreeSet::new();
            match node.operator {
                // Not what decides on a shift.
                Operator::Guarded(of, ..)
                | Operator::FitShifted(of, ..)
                | Operator::Normalised(of, _) => from.extend(&sources[of.place()]),
                operator => operator.reads(|wire: Wire| from.extend(&sources[wire.place()])),
            }
            let Exact {
                int_bits,
                frac_bits,
            } = node.shape;
            let shape = || {
                let sign = if node.signed { "I" } else { "U" };
                format!("{sign}{}F{frac_bits}", int_bits + i32::from(node.signed))
            };
            let [reciprocals, roots, _] = &self.functions.roms;
            let of_fit = |fit: &Fit| {
                let signal = &signals[fit.signal];
                let name = format!("{}.{}", signal.unit, signal.name);
                Some((name, fit.word.format.to_string()))
            };
            let named = match node.operator {
                Operator::Input(nth) => inputs[nth].clone().map(|name| (name, shape())),
                Operator::Fit(_, fit) | Operator::FitShifted(_, _, fit) => of_fit(&fit),
                Operator::Lookup(_, table) => of_fit(self.functions.tables[table].fit()),
                Operator::Reciprocal(_, unit) => Some((reciprocals[unit].clone(), shape())),
                Operator::InverseRoot(_, unit) | Operator::Root(_, unit) => {
                    let format = self.functions.roots[unit].shape().format();
                    Some((roots[unit].clone(), format.to_string()))
                }
                _ => None,
            };
            let Some((name, format)) = named else {
                sources.push(from);
                continue;
            };
            let place = words
                .iter()
                .position(|word| word.name == name)
                .unwrap_or_else(|| {
                    words.push(Flow {
                        name: name.clone(),
                        format,
                        wires: 0,
                        from: Vec::new(),
                    });
                    words.len() - 1
                });
            words[place].wires += 1;
            for source in from {
                let source = words[source].name.clone();
                if source != name && !words[place].from.contains(&source) {
                    words[place].from.push(source);
                }
            }
            sources.push(BTreeSet::from([place]));
        }
        words
    }
}

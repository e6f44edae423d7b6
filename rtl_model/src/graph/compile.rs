//! Compile: a graph as steps, each a loop over a batch.
//!
//! ```text
//! nodes ─►( container of each wire: 32 or 64 bits )─►( a product, a sum and a fit in one )─►( rows used again )─► steps
//! ```
//! A wire of at most 32 bits is a row of 32-bit words; of others 64 bits are kept.

use super::run::{Place, Program, Sink, Source, Step, Unary};
use super::{Functions, Node, Operator, Wire};
use crate::num::Fit;

/// A graph's nodes as steps.
pub(super) fn program(nodes: &[Node], functions: &Functions, outputs: &[Wire]) -> Program {
    let mut compiler = Compiler::new(nodes, functions, outputs);
    for place in 0..compiler.nodes.len() {
        compiler.kept(place);
    }
    for place in 0..compiler.nodes.len() {
        compiler.node(place);
    }
    let outputs = outputs
        .iter()
        .map(|wire| compiler.place(compiler.resolved(*wire)))
        .collect();
    let Compiler {
        steps,
        rows,
        constants,
        inputs,
        ..
    } = compiler;
    Program {
        steps,
        functions: functions.clone(),
        rows,
        constants,
        inputs,
        outputs,
    }
}

/// Turns nodes into steps.
struct Compiler<'n> {
    nodes: Vec<Node>,
    functions: &'n Functions,
    /// How often each wire is still to be read; results of the graph always are.
    reads: Vec<usize>,
    /// The last operator that reads each wire.
    readers: Vec<usize>,
    /// Rows of each wire, of 32 bits and of 64.
    rows_of: Vec<[Option<usize>; 2]>,
    /// Rows that nothing reads any more, of 32 bits and of 64, and how many there are.
    free: [Vec<usize>; 2],
    rows: [usize; 2],
    steps: Vec<Step>,
    constants: Vec<(Place, i64)>,
    inputs: Vec<Place>,
}

/// Kinds of rows.
pub(super) const WORD: usize = 0;
pub(super) const EXACT: usize = 1;

impl<'n> Compiler<'n> {
    fn new(nodes: &[Node], functions: &'n Functions, outputs: &[Wire]) -> Self {
        let mut compiler = Compiler {
            nodes: nodes.to_vec(),
            functions,
            reads: vec![0; nodes.len()],
            readers: vec![0; nodes.len()],
            rows_of: vec![[None; 2]; nodes.len()],
            free: Default::default(),
            rows: [0; 2],
            steps: Vec::new(),
            constants: Vec::new(),
            inputs: Vec::new(),
        };
        for (reader, node) in nodes
            .iter()
            .enumerate()
            .filter(|(_, node)| !matches!(node.operator, Operator::Scaled(..)))
        {
            node.operator.reads(|wire| {
                let place = compiler.resolved(wire).place();
                compiler.reads[place] += 1;
                compiler.readers[place] = reader;
            });
        }
        for wire in outputs {
            let place = compiler.resolved(*wire).place();
            compiler.reads[place] += 1;
        }
        compiler
    }

    /// The wire whose row a wire shares: what is scaled by wiring is the same word.
    fn resolved(&self, mut wire: Wire) -> Wire {
        while let Operator::Scaled(from, _) = self.nodes[wire.place()].operator {
            wire = from;
        }
        wire
    }

    /// Whether 32 bits hold a wire.
    fn is_word(&self, wire: Wire) -> bool {
        self.nodes[wire.place()].shape.bits() < 32
    }

    fn row(&mut self, kind: usize, wire: Wire) -> usize {
        let row = self.free[kind].pop().unwrap_or_else(|| {
            self.rows[kind] += 1;
            self.rows[kind] - 1
        });
        self.rows_of[wire.place()][kind] = Some(row);
        row
    }

    fn place(&self, wire: Wire) -> Place {
        match self.rows_of[wire.place()] {
            [Some(row), _] => Place::Word(row),
            [None, row] => Place::Exact(row.unwrap_or_default()),
        }
    }

    /// The row where a wire lies in 32 bits.
    fn word(&mut self, wire: Wire) -> usize {
        let wire = self.resolved(wire);
        if let [Some(row), _] = self.rows_of[wire.place()] {
            return row;
        }
        let source = self.source(wire);
        let to = self.row(WORD, wire);
        self.steps.push(Step::Value {
            source,
            sink: Sink::Word(to),
        });
        to
    }

    /// The row where a wire lies in 64 bits.
    fn exact(&mut self, wire: Wire) -> usize {
        let wire = self.resolved(wire);
        if let [_, Some(row)] = self.rows_of[wire.place()] {
            return row;
        }
        let source = self.source(wire);
        let to = self.row(EXACT, wire);
        self.steps.push(Step::Value {
            source,
            sink: Sink::Exact(to),
        });
        to
    }

    /// Wires were read: where nothing else will read one, its rows are free.
    fn read(&mut self, wires: &[Wire]) {
        for wire in wires {
            let place = self.resolved(*wire).place();
            self.reads[place] -= 1;
            let is_kept = matches!(
                self.nodes[place].operator,
                Operator::Input(_) | Operator::Constant(_)
            );
            if self.reads[place] == 0 && !is_kept {
                for kind in [WORD, EXACT] {
                    self.free[kind].extend(self.rows_of[place][kind].take());
                }
            }
        }
    }

    /// Whether a result goes into one operator that makes it on the way, and nowhere else.
    fn is_deferred(&self, wire: Wire) -> bool {
        if self.reads[wire.place()] != 1 || self.rows_of[wire.place()] != [None; 2] {
            return false;
        }
        let reader = self.nodes[self.readers[wire.place()]].operator;
        let is_fit = matches!(
            reader,
            Operator::Fit(..) | Operator::FitShifted(..) | Operator::Rounded(..)
        );
        match self.nodes[wire.place()].operator {
            Operator::Product(_) => {
                is_fit || matches!(reader, Operator::Sum(..) | Operator::Difference(..))
            }
            Operator::Normalised(..) => is_fit,
            Operator::Sum([a, b], _) | Operator::Difference([a, b], _) => {
                is_fit && !self.is_sum_of_words(wire, [a, b])
            }
            _ => false,
        }
    }

    fn is_sum_of_words(&self, sum: Wire, terms: [Wire; 2]) -> bool {
        self.is_word(sum)
            && terms
                .into_iter()
                .all(|term| self.is_word(self.resolved(term)))
    }

    /// Where a term of a sum lies.
    fn term(&mut self, wire: Wire) -> Place {
        let wire = self.resolved(wire);
        if self.rows_of[wire.place()] == [None; 2] {
            return Place::Exact(self.exact(wire));
        }
        self.place(wire)
    }

    /// How a wire is made where something reads it; what it is made of has been read by then.
    fn source(&mut self, wire: Wire) -> Source {
        match self.rows_of[wire.place()] {
            [_, Some(row)] => return Source::From(Place::Exact(row)),
            [Some(row), _] => return Source::From(Place::Word(row)),
            _ => {}
        }
        match self.nodes[wire.place()].operator {
            Operator::Product([a, b]) => {
                let (x, y) = (self.word(a), self.word(b));
                self.read(&[a, b]);
                Source::Product(x, y)
            }
            Operator::Normalised(from, lead) => {
                let (x, by) = (self.exact(from), self.word(lead));
                self.read(&[from, lead]);
                Source::Normalised(x, by)
            }
            Operator::Sum(terms, lefts) => self.sum(terms, lefts, false),
            Operator::Difference(terms, lefts) => self.sum(terms, lefts, true),
            // Nothing else is deferred.
            _ => Source::From(Place::Exact(0)),
        }
    }

    fn sum(&mut self, [a, b]: [Wire; 2], [p, q]: [u32; 2], is_difference: bool) -> Source {
        let [first, second] = [a, b].map(|wire| self.resolved(wire));
        let is_product = |wire: Wire| {
            matches!(self.nodes[wire.place()].operator, Operator::Product(_))
                && self.is_deferred(wire)
        };
        let [x, y] = [first, second].map(is_product);
        let (sum, product, [left, of_product]) = match () {
            () if y => (first, second, [p, q]),
            () if x && !is_difference => (second, first, [q, p]),
            () => {
                let (x, y) = (self.exact(a), self.exact(b));
                self.read(&[a, b]);
                return if is_difference {
                    Source::Difference([x, y], [p, q])
                } else {
                    Source::Sum([x, y], [p, q])
                };
            }
        };
        let Operator::Product([c, d]) = self.nodes[product.place()].operator else {
            return Source::From(Place::Exact(0));
        };
        let from = self.term(sum);
        let (x, y) = (self.word(c), self.word(d));
        self.read(&[sum, product, c, d]);
        Source::WithProduct {
            from,
            left,
            product: [x, y],
            of_product,
            is_difference,
        }
    }

    /// Inputs and constants have rows of their own, which no step writes.
    fn kept(&mut self, place: usize) {
        let wire = Wire(place as u16);
        let kind = if self.is_word(wire) { WORD } else { EXACT };
        match self.nodes[place].operator {
            Operator::Input(_) => {
                self.row(kind, wire);
                self.inputs.push(self.place(wire));
            }
            Operator::Constant(value) => {
                self.row(kind, wire);
                self.constants.push((self.place(wire), value));
            }
            _ => {}
        }
    }

    fn node(&mut self, place: usize) {
        let to = Wire(place as u16);
        match self.nodes[place].operator {
            Operator::Input(_) | Operator::Constant(_) | Operator::Scaled(..) => {}
            // Made where it is read.
            _ if self.is_deferred(to) => {}
            Operator::Sum(terms, lefts) if self.is_sum_of_words(to, terms) => {
                self.sum_of_words(terms, lefts, false, to)
            }
            Operator::Difference(terms, lefts) if self.is_sum_of_words(to, terms) => {
                self.sum_of_words(terms, lefts, true, to)
            }
            Operator::Product(_)
            | Operator::Sum(..)
            | Operator::Difference(..)
            | Operator::Normalised(..) => {
                let source = self.source(to);
                let to = self.row(EXACT, to);
                self.steps.push(Step::Value {
                    source,
                    sink: Sink::Exact(to),
                });
            }
            Operator::Negation(from) => self.unary(Unary::Negation, from, to),
            Operator::Magnitude(from) => self.unary(Unary::Magnitude, from, to),
            Operator::Natural(from) | Operator::AtLeastOne(from) => {
                self.unary(Unary::AtLeast(0), from, to)
            }
            Operator::AtLeast(from, least) => self.unary(Unary::AtLeast(least), from, to),
            Operator::Not(from) => self.unary(Unary::Not, from, to),
            Operator::AtMost(from, most) => self.unary(Unary::AtMost(most), from, to),
            Operator::APlaceMore(from) => self.unary(Unary::APlaceMore, from, to),
            Operator::Opposed(from, other) => self.words([from, other], to, |[from, other], to| {
                Step::Opposed { from, other, to }
            }),
            Operator::Turned(from, by) => self.words([from, by], to, |[from, by], to| {
                Step::Turned { from, by, to }
            }),
            Operator::Lesser([a, b]) => {
                self.words([a, b], to, |[a, b], to| Step::Lesser { a, b, to })
            }
            Operator::Greater([a, b]) => {
                self.words([a, b], to, |[a, b], to| Step::Greater { a, b, to })
            }
            Operator::Guarded(from, condition, instead) => {
                self.words([from, condition], to, |[from, condition], to| {
                    Step::Guarded {
                        from,
                        condition,
                        instead,
                        to,
                    }
                });
            }
            Operator::Above([a, b], [0, 0])
                if [a, b]
                    .into_iter()
                    .all(|wire| self.is_word(self.resolved(wire))) =>
            {
                self.words([a, b], to, |[a, b], to| Step::AboveWords { a, b, to });
            }
            Operator::Above([a, b], lefts) => {
                let (x, y) = (self.exact(a), self.exact(b));
                self.read(&[a, b]);
                let to = self.row(WORD, to);
                self.steps.push(Step::Above {
                    a: x,
                    b: y,
                    lefts,
                    to,
                });
            }
            Operator::Either([a, b]) => {
                self.words([a, b], to, |[a, b], to| Step::Either { a, b, to })
            }
            Operator::Both([a, b]) => self.words([a, b], to, |[a, b], to| Step::Both { a, b, to }),
            Operator::Drop(from) => {
                let condition = self.word(from);
                self.read(&[from]);
                self.steps.push(Step::Drop { condition });
            }
            Operator::Lookup(from, table) => {
                let short = self.functions.tables[table].is_short();
                self.words([from], to, |[from], to| Step::Lookup {
                    from,
                    table,
                    short,
                    to,
                });
            }
            Operator::Fit(from, fit) => self.fit(from, None, fit, to),
            Operator::FitShifted(from, more, fit) => self.fit(from, Some(more), fit, to),
            Operator::Rounded(from, fit) => {
                let source = self.rounding_source(from);
                let sink = Sink::Rounded(fit, self.row(EXACT, to));
                self.steps.push(Step::Value { source, sink });
            }
            Operator::Largest(parts) => {
                let rows = parts.map(|part| self.exact(part));
                self.read(&parts);
                let to = self.row(EXACT, to);
                self.steps.push(Step::Largest { parts: rows, to });
            }
            Operator::Lead(from) => {
                let row = self.exact(from);
                self.read(&[from]);
                let to = self.row(WORD, to);
                self.steps.push(Step::Lead { from: row, to });
            }
            Operator::Reciprocal(from, unit) => {
                self.function(from, to, WORD, |from, to, exponent| Step::Reciprocal {
                    from,
                    unit,
                    to,
                    exponent,
                });
            }
            Operator::InverseRoot(from, unit) => {
                self.function(from, to, WORD, |from, to, exponent| Step::InverseRoot {
                    from,
                    unit,
                    to,
                    exponent,
                });
            }
            Operator::Root(from, unit) => {
                self.function(from, to, EXACT, |from, to, exponent| Step::Root {
                    from,
                    unit,
                    to,
                    exponent,
                })
            }
            // Its row was written with the other's.
            Operator::Exponent(from) => self.read(&[from]),
            Operator::Exponents(power) => {
                let wires: Vec<Wire> = power.terms().iter().map(|(wire, _)| *wire).collect();
                let mut terms = [(0, 0); 4];
                for (term, (wire, factor)) in terms.iter_mut().zip(power.terms()) {
                    *term = (self.word(*wire), *factor);
                }
                let (constant, count) = (power.constant, wires.len());
                self.read(&wires);
                let to = self.row(WORD, to);
                self.steps.push(Step::Exponents {
                    terms,
                    count,
                    constant,
                    to,
                });
            }
        }
    }

    /// A step from words to a word.
    fn words<const N: usize>(
        &mut self,
        from: [Wire; N],
        to: Wire,
        step: impl FnOnce([usize; N], usize) -> Step,
    ) {
        let rows = from.map(|wire| self.word(wire));
        self.read(&from);
        let to = self.row(WORD, to);
        self.steps.push(step(rows, to));
    }

    fn sum_of_words(&mut self, terms: [Wire; 2], lefts: [u32; 2], is_difference: bool, to: Wire) {
        self.words(terms, to, |[a, b], to| {
            if is_difference {
                Step::DifferenceOfWords { a, b, lefts, to }
            } else {
                Step::SumOfWords { a, b, lefts, to }
            }
        });
    }

    fn unary(&mut self, unary: Unary, from: Wire, to: Wire) {
        // The magnitude of the least word of 32 bits has one more.
        let bits = self.nodes[to.place()].bits();
        let limit = match unary {
            Unary::AtLeast(limit) | Unary::AtMost(limit) => limit,
            _ => 0,
        };
        if bits < 32 && limit < 1 << 31 && self.is_word(self.resolved(from)) {
            return self.words([from], to, |[from], to| Step::UnaryWord { unary, from, to });
        }
        let row = self.exact(from);
        self.read(&[from]);
        let to = self.row(EXACT, to);
        self.steps.push(Step::Unary {
            unary,
            from: row,
            to,
        });
    }

    /// A reciprocal or a root, whose exponent is the next node.
    fn function(
        &mut self,
        from: Wire,
        to: Wire,
        kind: usize,
        step: impl FnOnce(Place, usize, usize) -> Step,
    ) {
        let row = self.term(from);
        self.read(&[from]);
        let exponent = self.row(WORD, Wire(to.0 + 1));
        let to = self.row(kind, to);
        self.steps.push(step(row, to, exponent));
    }

    /// How a result is made that is rounded there.
    fn rounding_source(&mut self, from: Wire) -> Source {
        let from = self.resolved(from);
        let is_made_here = self.is_deferred(from);
        let source = self.source(from);
        if is_made_here {
            // What it is made of was read, and it lies nowhere.
            self.reads[from.place()] -= 1;
        } else {
            self.read(&[from]);
        }
        source
    }

    fn fit(&mut self, from: Wire, more: Option<Wire>, fit: Fit, to: Wire) {
        let more_row = more.map(|more| self.word(more));
        let source = self.rounding_source(from);
        more.into_iter().for_each(|more| self.read(&[more]));
        let sink = match more_row {
            Some(more) => Sink::FitShifted(fit, more, self.row(WORD, to)),
            None if self.is_word(to) => Sink::Fit(fit, self.row(WORD, to)),
            None => Sink::FitWide(fit, self.row(EXACT, to)),
        };
        self.steps.push(Step::Value { source, sink });
    }
}

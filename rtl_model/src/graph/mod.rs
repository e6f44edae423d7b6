//! Graph: the arithmetic of a unit, stated once, as operators on wires. It is built when a machine
//! is elaborated; what else is made of it is a pass, a file each.
//!
//! ```text
//! a unit's function ─► Builder ─┬─► parts, signals, misfits          as it is built
//!                               └─► Graph ─┬─► one item at a time    mod.rs: what every operator means
//!                                          ├─► a batch of items      compile.rs, run.rs: the same, in the narrowest words
//!                                          ├─► bounds                real.rs
//!                                          ├─► critical path         delay.rs
//!                                          ├─► words and their ways  flow.rs
//!                                          └─► SystemVerilog         verilog.rs
//! ```
//! A wire has a shape, how far it reaches above and below the binary point, and may be relative to
//! a [`Power`] of two that the data decides on. Sums and products grow; [`Builder::fit`] and
//! [`Builder::fit_to`] are the only operators that lose bits, at a named signal; except on machines
//! that round every floating-point operator. A condition is a wire of words −1 (holds) and 0.
//!
//! Law: `a_batch_equals_one_item_at_a_time`.

mod builder;
mod compile;
mod delay;
pub mod flow;
mod power;
pub mod real;
mod run;
pub mod verilog;

pub use builder::Builder;
pub use power::Power;
pub use run::{BATCH, Batch, Program, ROWS, Run};

use crate::elaboration::{Operand, Signal};
use crate::functions::{Reciprocal, ReciprocalRoot, Table};
use crate::num::{Exact, Fit};
use crate::probe::{NoProbe, Probe, Tap};

/// The result of an operator: its place among a graph's nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wire(u16);

impl Wire {
    fn place(self) -> usize {
        usize::from(self.0)
    }
}

/// An operator. What it is about comes first.
#[derive(Clone, Copy, Debug)]
enum Operator {
    /// What the graph is applied to, by its place among the inputs.
    Input(usize),
    Constant(i64),
    Product([Wire; 2]),
    /// Terms, each shifted left to the common binary point.
    Sum([Wire; 2], [u32; 2]),
    Difference([Wire; 2], [u32; 2]),
    Negation(Wire),
    Magnitude(Wire),
    /// With the sign that another wire has not.
    Opposed(Wire, Wire),
    /// Negated where another wire is above 0.
    Turned(Wire, Wire),
    /// At least 0.
    Natural(Wire),
    /// At most so much, in the wire's own places.
    AtMost(Wire, i64),
    /// At least so many last places, 0 or 1, a limit that no exact number has.
    AtLeast(Wire, i64),
    /// A last place more.
    APlaceMore(Wire),
    /// Times 2^n, by wiring: the same word.
    Scaled(Wire, i32),
    Lesser([Wire; 2]),
    Greater([Wire; 2]),
    /// A word in place of what means nothing where a condition holds.
    Guarded(Wire, Wire, i64),
    /// A table's word, by the table's place.
    Lookup(Wire, usize),
    Fit(Wire, Fit),
    /// A result of a floating-point operator, rounded for the next one. No probe sees it; the fit
    /// names the word that is made from it.
    Rounded(Wire, Fit),
    /// A result that has so many more fraction bits than its shape says.
    FitShifted(Wire, Wire, Fit),
    /// All bits of three magnitudes: it has as many places as the largest.
    Largest([Wire; 3]),
    /// Places to the left that bring a positive wire's leading one to bit 61.
    Lead(Wire),
    /// Shifted left by that.
    Normalised(Wire, Wire),
    /// 1/x of a positive wire, by a reciprocal's place.
    Reciprocal(Wire, usize),
    /// 1/√x of a positive wire, by a root's place.
    InverseRoot(Wire, usize),
    /// √x of a positive wire, by a root's place.
    Root(Wire, usize),
    /// The exponent beside a reciprocal or a root.
    Exponent(Wire),
    /// A sum over exponents.
    Exponents(Power),
    /// An exponent that is at least 0.
    AtLeastOne(Wire),
    /// Where the first is greater, each shifted left to the common binary point.
    Above([Wire; 2], [u32; 2]),
    Either([Wire; 2]),
    Both([Wire; 2]),
    Not(Wire),
    /// No item in which a condition holds is observed from here on.
    Drop(Wire),
}

impl Operator {
    /// Calls `read` with each wire that it reads.
    fn reads(&self, mut read: impl FnMut(Wire)) {
        self.with_wires(|wire| {
            read(wire);
            wire
        });
    }

    /// The same operator on other wires.
    fn with_wires(self, mut of: impl FnMut(Wire) -> Wire) -> Self {
        match self {
            Operator::Input(_) | Operator::Constant(_) => self,
            Operator::Product(pair) => Operator::Product(pair.map(of)),
            Operator::Sum(pair, lefts) => Operator::Sum(pair.map(of), lefts),
            Operator::Difference(pair, lefts) => Operator::Difference(pair.map(of), lefts),
            Operator::Negation(from) => Operator::Negation(of(from)),
            Operator::Magnitude(from) => Operator::Magnitude(of(from)),
            Operator::Opposed(from, to) => Operator::Opposed(of(from), of(to)),
            Operator::Turned(from, by) => Operator::Turned(of(from), of(by)),
            Operator::Natural(from) => Operator::Natural(of(from)),
            Operator::AtMost(from, most) => Operator::AtMost(of(from), most),
            Operator::AtLeast(from, least) => Operator::AtLeast(of(from), least),
            Operator::APlaceMore(from) => Operator::APlaceMore(of(from)),
            Operator::Scaled(from, places) => Operator::Scaled(of(from), places),
            Operator::Lesser(pair) => Operator::Lesser(pair.map(of)),
            Operator::Greater(pair) => Operator::Greater(pair.map(of)),
            Operator::Guarded(from, condition, instead) => {
                Operator::Guarded(of(from), of(condition), instead)
            }
            Operator::Lookup(from, table) => Operator::Lookup(of(from), table),
            Operator::Fit(from, fit) => Operator::Fit(of(from), fit),
            Operator::Rounded(from, fit) => Operator::Rounded(of(from), fit),
            Operator::FitShifted(from, more, fit) => Operator::FitShifted(of(from), of(more), fit),
            Operator::Largest(parts) => Operator::Largest(parts.map(of)),
            Operator::Lead(from) => Operator::Lead(of(from)),
            Operator::Normalised(from, lead) => Operator::Normalised(of(from), of(lead)),
            Operator::Reciprocal(from, unit) => Operator::Reciprocal(of(from), unit),
            Operator::InverseRoot(from, unit) => Operator::InverseRoot(of(from), unit),
            Operator::Root(from, unit) => Operator::Root(of(from), unit),
            Operator::Exponent(from) => Operator::Exponent(of(from)),
            Operator::Exponents(power) => Operator::Exponents(power.with_wires(of)),
            Operator::AtLeastOne(from) => Operator::AtLeastOne(of(from)),
            Operator::Above(pair, lefts) => Operator::Above(pair.map(of), lefts),
            Operator::Either(pair) => Operator::Either(pair.map(of)),
            Operator::Both(pair) => Operator::Both(pair.map(of)),
            Operator::Not(from) => Operator::Not(of(from)),
            Operator::Drop(from) => Operator::Drop(of(from)),
        }
    }
}

/// An operator, and the shape of its result.
#[derive(Clone, Copy, Debug)]
struct Node {
    operator: Operator,
    shape: Exact,
    /// Whether it may be negative.
    signed: bool,
    /// Bits from the leading one on that a floating-point word or a product of them has; 0 where
    /// all bits of the shape may be set.
    significant_bits: i32,
    /// What it is relative to; of exponents, the power that they are.
    power: Power,
}

impl Node {
    /// Bits of a result, its sign included.
    fn bits(&self) -> i32 {
        self.shape.bits() + i32::from(self.signed)
    }

    /// Bits that a multiplier reads: the sign of a floating-point word is apart.
    fn factor_bits(&self) -> i32 {
        if self.is_float() {
            self.significant_bits
        } else {
            self.bits()
        }
    }

    /// What is rounded.
    fn result(&self) -> Operand {
        if self.is_float() {
            Operand::significant(self.shape, self.significant_bits)
        } else {
            self.shape.into()
        }
    }

    /// Whether it has a significand and an exponent, and no place before it is shifted there.
    fn is_float(&self) -> bool {
        self.significant_bits > 0
    }
}

/// What nodes refer to.
#[derive(Clone, Debug, Default)]
struct Functions {
    tables: Vec<Table>,
    reciprocals: Vec<Reciprocal>,
    roots: Vec<ReciprocalRoot>,
    /// Paths of their ROMs, such as `gauss.table`: of reciprocals, roots and tables.
    roms: [Vec<String>; 3],
}

/// A graph without its results. Passes are methods of it, so that they are compiled once for any
/// number of results; except that over reals, which takes fewer instructions inlined.
#[derive(Clone, Debug)]
struct Body {
    nodes: Vec<Node>,
    functions: Functions,
}

/// A unit's arithmetic.
#[derive(Clone, Debug)]
pub struct Graph<const OUTPUTS: usize> {
    body: Body,
    outputs: [Wire; OUTPUTS],
}

/// The part of a graph that some wires depend on, for passes over reals.
#[derive(Clone, Debug)]
pub struct Asked<const N: usize> {
    nodes: Vec<Node>,
    /// Places among those nodes.
    wires: [Wire; N],
}

/// A condition as a word.
fn word(holds: bool) -> i64 {
    -i64::from(holds)
}

impl Body {
    /// Results of all nodes for one item.
    fn one<P: Probe>(&self, inputs: &[i64], tap: &mut Tap<P>) -> Vec<i64> {
        let mut results: Vec<i64> = Vec::with_capacity(self.nodes.len());
        let mut exponents = vec![0; self.nodes.len()];
        // None once a condition has dropped the item.
        let (mut seen, probe) = (Some(tap), &mut NoProbe);
        let unseen = &mut Tap::new(probe);
        macro_rules! tapped {
            ($tap:ident => $result:expr) => {
                match seen.as_deref_mut() {
                    Some($tap) => $result,
                    None => {
                        let $tap = &mut *unseen;
                        $result
                    }
                }
            };
        }
        let Functions {
            tables,
            reciprocals,
            roots,
            ..
        } = &self.functions;
        for (place, node) in self.nodes.iter().enumerate() {
            let of = |wire: Wire| results[wire.place()];
            let result = match node.operator {
                Operator::Input(place) => inputs[place],
                Operator::Constant(value) => value,
                Operator::Product([a, b]) => of(a) * of(b),
                Operator::Sum([a, b], [p, q]) => (of(a) << p) + (of(b) << q),
                Operator::Difference([a, b], [p, q]) => (of(a) << p) - (of(b) << q),
                Operator::Negation(from) => -of(from),
                Operator::Magnitude(from) => of(from).abs(),
                Operator::Opposed(from, to) => {
                    if of(to) < 0 {
                        of(from)
                    } else {
                        -of(from)
                    }
                }
                Operator::Turned(from, by) => {
                    if of(by) > 0 {
                        -of(from)
                    } else {
                        of(from)
                    }
                }
                Operator::Natural(from) | Operator::AtLeastOne(from) => of(from).max(0),
                Operator::AtMost(from, most) => of(from).min(most),
                Operator::AtLeast(from, least) => of(from).max(least),
                Operator::APlaceMore(from) => of(from) + 1,
                Operator::Scaled(from, _) => of(from),
                Operator::Lesser([a, b]) => of(a).min(of(b)),
                Operator::Greater([a, b]) => of(a).max(of(b)),
                Operator::Guarded(from, condition, instead) => {
                    if of(condition) < 0 {
                        instead
                    } else {
                        of(from)
                    }
                }
                Operator::Lookup(from, table) => {
                    tapped!(tap => tap.fit_one(tables[table].fit(), tables[table].exact(of(from))))
                }
                Operator::Fit(from, ref fit) => tapped!(tap => tap.fit_one(fit, of(from))),
                Operator::Rounded(from, ref fit) => fit.one(of(from)),
                Operator::FitShifted(from, more, ref fit) => {
                    tapped!(tap => tap.fit_one_shifted(fit, of(from), of(more)))
                }
                Operator::Largest([a, b, c]) => of(a).abs() | of(b).abs() | of(c).abs() | 1,
                Operator::Lead(from) => i64::from(of(from).leading_zeros()) - 2,
                Operator::Normalised(from, lead) => of(from) << of(lead),
                Operator::Reciprocal(from, unit) => {
                    let (word, exponent) = tapped!(tap => reciprocals[unit].one(of(from), tap));
                    exponents[place] = exponent;
                    word
                }
                Operator::InverseRoot(from, unit) => {
                    let (word, exponent) = tapped!(tap => roots[unit].one(of(from), tap));
                    exponents[place] = exponent;
                    word
                }
                Operator::Root(from, unit) => {
                    let (word, exponent) = tapped!(tap => roots[unit].root_one(of(from), tap));
                    exponents[place] = exponent;
                    word
                }
                Operator::Exponent(from) => exponents[from.place()],
                Operator::Exponents(ref power) => power
                    .terms()
                    .iter()
                    .fold(power.constant.into(), |sum: i64, (wire, factor)| {
                        sum + of(*wire) * i64::from(*factor)
                    }),
                Operator::Above([a, b], [p, q]) => word(of(a) << p > of(b) << q),
                Operator::Either([a, b]) => of(a) | of(b),
                Operator::Both([a, b]) => of(a) & of(b),
                Operator::Not(from) => !of(from),
                Operator::Drop(from) => {
                    if P::WORDS && of(from) < 0 {
                        seen = None;
                    }
                    0
                }
            };
            results.push(result);
        }
        results
    }

    /// The nodes that some wires depend on, and of each node its place among them.
    fn asked(&self, wires: &[Wire]) -> (Vec<Node>, Vec<Wire>) {
        let mut is_needed = vec![false; self.nodes.len()];
        wires.iter().for_each(|wire| is_needed[wire.place()] = true);
        for (place, node) in self.nodes.iter().enumerate().rev() {
            if is_needed[place] {
                node.operator.reads(|wire| is_needed[wire.place()] = true);
                node.power
                    .terms()
                    .iter()
                    .for_each(|(wire, _)| is_needed[wire.place()] = true);
            }
        }
        let mut places = vec![Wire::default(); self.nodes.len()];
        let mut nodes = Vec::new();
        for (place, node) in self.nodes.iter().enumerate() {
            if is_needed[place] {
                places[place] = Wire(nodes.len() as u16);
                nodes.push(Node {
                    operator: node.operator.with_wires(|wire| places[wire.place()]),
                    power: node.power.with_wires(|wire| places[wire.place()]),
                    ..*node
                });
            }
        }
        (nodes, places)
    }

    fn fit_of_signal(&self, signals: &[Signal], unit: &str, name: &str, nth: usize) -> Option<Fit> {
        let fits = self.nodes.iter().filter_map(|node| match node.operator {
            Operator::Fit(_, fit) | Operator::FitShifted(_, _, fit) => Some(fit),
            _ => None,
        });
        let mut own = fits.filter(|fit| {
            signals
                .get(fit.signal)
                .is_some_and(|signal| signal.unit == unit && signal.name == name)
        });
        own.nth(nth)
    }
}

impl<const OUTPUTS: usize> Graph<OUTPUTS> {
    /// Results of one item.
    pub fn one<P: Probe>(&self, inputs: &[i64], tap: &mut Tap<P>) -> [i64; OUTPUTS] {
        let results = self.body.one(inputs, tap);
        self.outputs.map(|wire| results[wire.place()])
    }

    /// The nodes that some wires depend on.
    pub fn asked<const N: usize>(&self, wires: [Wire; N]) -> Asked<N> {
        let (nodes, places) = self.body.asked(&wires);
        Asked {
            nodes,
            wires: wires.map(|wire| places[wire.place()]),
        }
    }

    /// The same of its results.
    pub fn asked_for_results(&self) -> Asked<OUTPUTS> {
        self.asked(self.outputs)
    }

    /// The fits of its results, which are words.
    ///
    /// # Panics
    /// Where a result is not fitted.
    pub fn fits(&self) -> [Fit; OUTPUTS] {
        self.outputs
            .map(|wire| match self.body.nodes[wire.place()].operator {
                Operator::Fit(_, fit) | Operator::FitShifted(_, _, fit) => fit,
                other => panic!("{other:?} is not a word"),
            })
    }

    /// The n-th fit of a signal, for a kernel that does the same.
    ///
    /// # Panics
    /// Where there is none.
    pub fn fit_of_signal(&self, signals: &[Signal], unit: &str, name: &str, nth: usize) -> Fit {
        self.body
            .fit_of_signal(signals, unit, name, nth)
            .unwrap_or_else(|| panic!("{unit}.{name} is fitted"))
    }

    /// Its tables, in the order in which they are looked up.
    pub fn tables(&self) -> &[Table] {
        &self.body.functions.tables
    }

    /// Its reciprocals, in the order of its operators.
    pub fn reciprocals(&self) -> &[Reciprocal] {
        &self.body.functions.reciprocals
    }

    /// Its roots and inverse roots, in the order of its operators.
    pub fn roots(&self) -> &[ReciprocalRoot] {
        &self.body.functions.roots
    }

    /// Products of one item, those of its function units too.
    #[cfg(test)]
    pub fn products(&self) -> u32 {
        let products = |node: &Node| match node.operator {
            Operator::Product(_) => 1,
            Operator::Reciprocal(_, unit) => {
                2 * self.body.functions.reciprocals[unit].shape().newton_steps
            }
            Operator::InverseRoot(_, unit) => {
                3 * self.body.functions.roots[unit].shape().newton_steps
            }
            Operator::Root(_, unit) => 3 * self.body.functions.roots[unit].shape().newton_steps + 1,
            _ => 0,
        };
        self.body.nodes.iter().map(products).sum()
    }

    /// The same arithmetic for batches.
    pub fn program(&self) -> Program {
        compile::program(&self.body.nodes, &self.body.functions, &self.outputs)
    }
}

#[cfg(test)]
mod tests;

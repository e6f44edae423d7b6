//! Real: a graph over real numbers: bounds, or the losses of some words alone ([`Real`]).
//!
//! Every wire has its value, whatever power it is relative to; a fit's last place depends on that
//! power, which is known from the value that a normaliser, a reciprocal or a root was given. What
//! the host alone needs (`Operator::Guarded`) and conditions are not there.

use super::{Asked, Graph, Node, Operator, Power, Wire};
use crate::functions::Table;
use crate::num::Fit;
use crate::num::real::power_of_two;
use crate::real::{Real, Scale};

/// Graphs with at most this many nodes keep their results on the stack.
const FEW: usize = 12;

/// A wire's number, and the power of two that it is relative to; of a wire that holds an exponent,
/// that power.
#[derive(Clone, Copy, Debug)]
pub struct Bounded<R> {
    /// Its value.
    pub value: R,
    /// Least and greatest exponent.
    pub scale: Scale,
}

impl<R: Real> Bounded<R> {
    /// A number that is what it says.
    pub fn of(value: R) -> Self {
        Bounded {
            value,
            scale: Scale::ONE,
        }
    }

    /// An exponent.
    pub fn exponent(scale: Scale) -> Self {
        Bounded {
            value: R::constant(0.0),
            scale,
        }
    }
}

/// What a graph over reals is given.
#[derive(Clone, Copy, Debug)]
pub struct Given<'a, R> {
    /// Inputs: a number's own scale follows from the graph.
    pub inputs: &'a [Bounded<R>],
    /// Whether what a sign turns is turned, where the machine's decision is followed; else each
    /// side decides by itself.
    pub turned: Option<bool>,
}

/// The power of two whose even power normalises a number to [1, 4).
fn half(scale: Scale) -> Scale {
    Scale {
        low: scale.low.div_euclid(2),
        high: scale.high.div_euclid(2),
    }
}

/// The fit that makes a wire's word, with or without its sign.
fn fit_of(nodes: &[Node], wire: Wire) -> Option<&Fit> {
    match &nodes[wire.place()].operator {
        Operator::Fit(_, fit) | Operator::FitShifted(_, _, fit) => Some(fit),
        Operator::Magnitude(from) | Operator::Guarded(from, ..) => fit_of(nodes, *from),
        _ => None,
    }
}

impl<const OUTPUTS: usize> Graph<OUTPUTS> {
    /// Numbers of one item that are what they say; `look_up` is the function that a table stands
    /// for.
    #[inline]
    pub fn real<R: Real, const INPUTS: usize, const N: usize>(
        &self,
        asked: &Asked<N>,
        inputs: [R; INPUTS],
        look_up: impl Fn(&Table, R) -> R,
    ) -> [R; N] {
        let inputs = inputs.map(Bounded::of);
        self.bounded(
            asked,
            &Given {
                inputs: &inputs,
                turned: None,
            },
            look_up,
        )
        .map(|result| result.value)
    }

    /// Numbers of one item.
    #[inline]
    pub fn bounded<R: Real, const N: usize>(
        &self,
        asked: &Asked<N>,
        given: &Given<R>,
        look_up: impl Fn(&Table, R) -> R,
    ) -> [Bounded<R>; N] {
        let nodes = &asked.nodes;
        if nodes.len() <= FEW {
            let mut results = [Bounded::exponent(Scale::ONE); FEW];
            for place in 0..nodes.len() {
                results[place] = self.work_out(nodes, place, &results, given, &look_up);
            }
            return asked.wires.map(|wire| results[wire.place()]);
        }
        let mut results = Vec::with_capacity(nodes.len());
        for place in 0..nodes.len() {
            results.push(self.work_out(nodes, place, &results, given, &look_up));
        }
        asked.wires.map(|wire| results[wire.place()])
    }

    /// The number of a node, from those of the nodes before it.
    #[inline(always)]
    fn work_out<R: Real>(
        &self,
        nodes: &[Node],
        place: usize,
        results: &[Bounded<R>],
        given: &Given<R>,
        look_up: impl Fn(&Table, R) -> R,
    ) -> Bounded<R> {
        let node = &nodes[place];
        let of = |wire: Wire| results[wire.place()].value;
        let scale = |power: &Power| {
            let constant = Scale::ONE.shifted(power.constant);
            power.terms().iter().fold(constant, |sum, (wire, factor)| {
                let Scale { low, high } = results[wire.place()].scale;
                let (low, high) = if *factor < 0 {
                    (high, low)
                } else {
                    (low, high)
                };
                sum.times(Scale {
                    low: low * factor,
                    high: high * factor,
                })
            })
        };
        let own = || scale(&node.power);
        let last_place = |wire: Wire| {
            let Node { power, shape, .. } = &nodes[wire.place()];
            power_of_two(scale(power).low - shape.frac_bits)
        };
        let value = |word: i64| word as f64 * power_of_two(-node.shape.frac_bits);
        Bounded::of(match node.operator {
            Operator::Input(input) => return given.inputs[input],
            Operator::Constant(word) => R::constant(value(word)),
            Operator::Product([a, b]) => of(a) * of(b),
            Operator::Sum([a, b], _) => of(a) + of(b),
            Operator::Difference([a, b], _) => of(a) - of(b),
            Operator::Negation(from) => -of(from),
            Operator::Magnitude(from) => of(from).abs(),
            Operator::Opposed(from, to) => -of(from).with_sign_of(of(to)),
            Operator::Turned(from, by) => match given.turned {
                Some(true) => -of(from),
                Some(false) => of(from),
                None => {
                    let [turned] =
                        of(by)
                            .constant_like(0.0)
                            .branch(of(by), || [of(from)], || [-of(from)]);
                    turned
                }
            },
            Operator::AtLeastOne(from) => {
                let Scale { low, high } = scale(&nodes[from.place()].power);
                return Bounded::exponent(Scale {
                    low: low.max(0),
                    high: high.max(0),
                });
            }
            Operator::Natural(from) => of(from).max(R::constant(0.0)),
            Operator::AtMost(from, most) => of(from).at_most(value(most)),
            Operator::AtLeast(from, 0) => of(from).at_least(0.0),
            Operator::AtLeast(from, _) => match fit_of(nodes, from) {
                Some(fit) => of(from).at_least_an_ulp(fit, scale(&nodes[from.place()].power)),
                None => of(from).at_least(last_place(from)),
            },
            Operator::APlaceMore(from) => match fit_of(nodes, from) {
                Some(fit) => of(from).an_ulp_more(fit),
                None => of(from).plus(last_place(from)),
            },
            Operator::Scaled(from, places) => of(from).times(power_of_two(places)),
            Operator::Lesser([a, b]) => of(a).min(of(b)),
            Operator::Greater([a, b]) => of(a).max(of(b)),
            Operator::Guarded(from, ..) | Operator::Normalised(from, _) => of(from),
            Operator::Lookup(from, table) => {
                let table = &self.functions.tables[table];
                look_up(table, of(from)).fit(table.fit(), Scale::ONE)
            }
            Operator::Fit(from, ref fit) | Operator::FitShifted(from, _, ref fit) => {
                of(from).fit(fit, own())
            }
            Operator::Largest([a, b, c]) => of(a)
                .abs()
                .max(of(b).abs())
                .max(of(c).abs())
                .at_least(last_place(a)),
            Operator::Reciprocal(from, unit) => {
                of(from).reciprocal(&self.functions.reciprocals[unit])
            }
            Operator::InverseRoot(from, unit) => of(from).inverse_root(&self.functions.roots[unit]),
            Operator::Root(from, unit) => of(from).root(&self.functions.roots[unit]),
            Operator::Lead(from) => return Bounded::exponent(of(from).leading()),
            Operator::Exponent(function) => {
                return Bounded::exponent(match nodes[function.place()].operator {
                    Operator::InverseRoot(from, _) => half(of(from).leading()).inverse(),
                    Operator::Root(from, _) => half(of(from).leading()),
                    Operator::Reciprocal(from, _) => of(from).leading().inverse(),
                    _ => Scale::ONE,
                });
            }
            Operator::Exponents(_) => return Bounded::exponent(own()),
            // Conditions have no numbers.
            Operator::Above(..)
            | Operator::Either(_)
            | Operator::Both(_)
            | Operator::Not(_)
            | Operator::Drop(_) => return Bounded::exponent(Scale::ONE),
        })
    }
}

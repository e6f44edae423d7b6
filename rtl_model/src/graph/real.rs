//! Real: a graph over real numbers: bounds, or the losses of some words alone ([`Real`]).
//!
//! Every wire has its value, whatever power it is relative to; a fit's last place depends on that
//! power, which is known from the value that a normaliser, a reciprocal or a root was given. What
//! the host alone needs (`Operator::Guarded`) and conditions are not there.
//!
//! Items are worked out in batches, node by node, so that what depends only on the node is done once
//! per batch. Items do not depend on each other.
//!
//! Law: `a_batch_of_reals_has_the_results_of_its_items`.

use super::{Asked, Graph, Node, Operator, Power, Wire};
use crate::functions::Table;
use crate::num::Fit;
use crate::num::real::power_of_two;
use crate::real::{Real, Scale};
use std::array;

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

/// What a graph over reals is given for `ITEMS` items.
#[derive(Clone, Copy, Debug)]
pub struct Given<'a, R, const ITEMS: usize> {
    /// Inputs: a number's own scale follows from the graph.
    pub inputs: &'a [[Bounded<R>; ITEMS]],
    /// Whether what a sign turns is turned, where the machine's decision is followed; else each
    /// side decides by itself.
    pub turned: [Option<bool>; ITEMS],
}

/// Results of the nodes so far: of each, the values of all items and their powers of two.
struct Results<'a, R, const ITEMS: usize> {
    values: &'a mut [[R; ITEMS]],
    scales: &'a mut [[Scale; ITEMS]],
}

impl<R: Real, const ITEMS: usize> Results<'_, R, ITEMS> {
    fn of(&self, wire: Wire) -> [Bounded<R>; ITEMS] {
        let (values, scales) = (&self.values[wire.place()], &self.scales[wire.place()]);
        array::from_fn(|item| Bounded {
            value: values[item],
            scale: scales[item],
        })
    }

    /// The scales of wires that are relative to a power.
    #[inline(always)]
    fn relative_to(&self, power: &Power) -> [Scale; ITEMS] {
        let mut scales = [Scale::ONE.shifted(power.constant); ITEMS];
        for (wire, factor) in power.terms() {
            let of_wire = &self.scales[wire.place()];
            for (sum, scale) in scales.iter_mut().zip(of_wire) {
                let [low, high] = [scale.low * factor, scale.high * factor];
                *sum = sum.times(Scale {
                    low: low.min(high),
                    high: low.max(high),
                });
            }
        }
        scales
    }
}

/// Results of a node.
enum Outcome<R, const ITEMS: usize> {
    Values([R; ITEMS]),
    /// Of a wire that holds an exponent.
    Exponents([Scale; ITEMS]),
    Input(usize),
    /// Conditions have no numbers.
    Condition,
}

/// The numbers of all items. `array::from_fn` is not always inlined.
#[inline(always)]
fn per_item<R: Real, const ITEMS: usize>(of: impl Fn(usize) -> R) -> [R; ITEMS] {
    let mut numbers = [R::constant(0.0); ITEMS];
    for (item, number) in numbers.iter_mut().enumerate() {
        *number = of(item);
    }
    numbers
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
        let given = Given {
            inputs: &inputs.map(|input| [Bounded::of(input)]),
            turned: [None],
        };
        self.bounded(asked, &given, look_up)
            .map(|[result]| result.value)
    }

    /// Numbers of a batch of items.
    #[inline]
    pub fn bounded<R: Real, const N: usize, const ITEMS: usize>(
        &self,
        asked: &Asked<N>,
        given: &Given<R, ITEMS>,
        look_up: impl Fn(&Table, R) -> R,
    ) -> [[Bounded<R>; ITEMS]; N] {
        let nodes = &asked.nodes;
        let none = ([R::constant(0.0); ITEMS], [Scale::ONE; ITEMS]);
        if nodes.len() <= FEW {
            let (mut values, mut scales) = ([none.0; FEW], [none.1; FEW]);
            let mut results = Results {
                values: &mut values[..nodes.len()],
                scales: &mut scales[..nodes.len()],
            };
            self.work_out(nodes, &mut results, given, look_up);
            return asked.wires.map(|wire| results.of(wire));
        }
        let mut results = Results {
            values: &mut vec![none.0; nodes.len()],
            scales: &mut vec![none.1; nodes.len()],
        };
        self.work_out(nodes, &mut results, given, look_up);
        asked.wires.map(|wire| results.of(wire))
    }

    /// The numbers of all nodes.
    #[inline(always)]
    fn work_out<R: Real, const ITEMS: usize>(
        &self,
        nodes: &[Node],
        results: &mut Results<R, ITEMS>,
        given: &Given<R, ITEMS>,
        look_up: impl Fn(&Table, R) -> R,
    ) {
        for (place, node) in nodes.iter().enumerate() {
            match self.numbers(nodes, node, results, given, &look_up) {
                Outcome::Values(values) => results.values[place] = values,
                Outcome::Exponents(scales) => results.scales[place] = scales,
                Outcome::Input(nth) => {
                    let input = &given.inputs[nth];
                    results.values[place] = input.map(|input| input.value);
                    results.scales[place] = input.map(|input| input.scale);
                }
                Outcome::Condition => (),
            }
        }
    }

    /// The numbers of a node, from those of the nodes before it.
    #[inline(always)]
    fn numbers<R: Real, const ITEMS: usize>(
        &self,
        nodes: &[Node],
        node: &Node,
        results: &Results<R, ITEMS>,
        given: &Given<R, ITEMS>,
        look_up: impl Fn(&Table, R) -> R,
    ) -> Outcome<R, ITEMS> {
        let of = |wire: Wire| &results.values[wire.place()];
        let relative_to = |wire: Wire| results.relative_to(&nodes[wire.place()].power);
        let ulp = |wire: Wire, scale: Scale| {
            power_of_two(scale.low - nodes[wire.place()].shape.frac_bits)
        };
        let number = |word: i64| word as f64 * power_of_two(-node.shape.frac_bits);
        let exponents = |wire: Wire, of_scale: fn(Scale) -> Scale| {
            Outcome::Exponents(of(wire).map(|value| of_scale(value.leading())))
        };
        // By the number of an item, or by its numbers on some wires.
        macro_rules! by_item {
            ($item:ident => $value:expr) => {
                Outcome::Values(per_item(|$item| $value))
            };
        }
        macro_rules! each {
            ($($wire:ident),+ => $value:expr) => {{
                $(let $wire = of($wire);)+
                Outcome::Values(per_item(|item| {
                    $(let $wire = $wire[item];)+
                    $value
                }))
            }};
        }
        match node.operator {
            Operator::Input(nth) => Outcome::Input(nth),
            Operator::Constant(word) => Outcome::Values([R::constant(number(word)); ITEMS]),
            Operator::Product([a, b]) => each!(a, b => a * b),
            Operator::Sum([a, b], _) => each!(a, b => a + b),
            Operator::Difference([a, b], _) => each!(a, b => a - b),
            Operator::Negation(from) => Outcome::Values(of(from).map(R::neg)),
            Operator::Magnitude(from) => Outcome::Values(of(from).map(R::abs)),
            Operator::Opposed(from, to) => each!(from, to => -from.with_sign_of(to)),
            Operator::Turned(from, by) => by_item!(item => {
                let (from, by) = (of(from)[item], of(by)[item]);
                match given.turned[item] {
                    Some(true) => -from,
                    Some(false) => from,
                    None => {
                        let [turned] = by.constant_like(0.0).branch(by, || [from], || [-from]);
                        turned
                    }
                }
            }),
            Operator::AtLeastOne(from) => {
                Outcome::Exponents(relative_to(from).map(|Scale { low, high }| Scale {
                    low: low.max(0),
                    high: high.max(0),
                }))
            }
            Operator::Natural(from) => each!(from => from.max(R::constant(0.0))),
            Operator::AtMost(from, most) => each!(from => from.at_most(number(most))),
            Operator::AtLeast(from, 0) => each!(from => from.at_least(0.0)),
            Operator::AtLeast(from, _) => {
                let (fit, scales) = (fit_of(nodes, from), relative_to(from));
                by_item!(item => match fit {
                    Some(fit) => of(from)[item].at_least_an_ulp(fit, scales[item]),
                    None => of(from)[item].at_least(ulp(from, scales[item])),
                })
            }
            Operator::APlaceMore(from) => {
                let (fit, scales) = (fit_of(nodes, from), relative_to(from));
                by_item!(item => match fit {
                    Some(fit) => of(from)[item].an_ulp_more(fit),
                    None => of(from)[item].plus(ulp(from, scales[item])),
                })
            }
            Operator::Scaled(from, places) => each!(from => from.times(power_of_two(places))),
            Operator::Lesser([a, b]) => each!(a, b => a.min(b)),
            Operator::Greater([a, b]) => each!(a, b => a.max(b)),
            Operator::Guarded(from, ..) | Operator::Normalised(from, _) => {
                Outcome::Values(*of(from))
            }
            Operator::Lookup(from, table) => {
                let table = &self.body.functions.tables[table];
                each!(from => look_up(table, from).fit(table.fit(), Scale::ONE))
            }
            Operator::Fit(from, ref fit)
            | Operator::FitShifted(from, _, ref fit)
            | Operator::Rounded(from, ref fit) => Outcome::Values(R::fit_each(
                of(from),
                fit,
                &results.relative_to(&node.power),
            )),
            Operator::Largest([a, b, c]) => {
                let scales = relative_to(a);
                by_item!(item => {
                    let [x, y, z] = [a, b, c].map(|wire| of(wire)[item].abs());
                    x.max(y).max(z).at_least(ulp(a, scales[item]))
                })
            }
            Operator::Reciprocal(from, unit) => {
                let unit = &self.body.functions.reciprocals[unit];
                each!(from => from.reciprocal(unit))
            }
            Operator::InverseRoot(from, unit) => {
                let unit = &self.body.functions.roots[unit];
                each!(from => from.inverse_root(unit))
            }
            Operator::Root(from, unit) => {
                let unit = &self.body.functions.roots[unit];
                each!(from => from.root(unit))
            }
            Operator::Lead(from) => exponents(from, |leading| leading),
            Operator::Exponent(function) => match nodes[function.place()].operator {
                Operator::InverseRoot(from, _) => {
                    exponents(from, |leading| half(leading).inverse())
                }
                Operator::Root(from, _) => exponents(from, half),
                Operator::Reciprocal(from, _) => exponents(from, Scale::inverse),
                _ => Outcome::Exponents([Scale::ONE; ITEMS]),
            },
            Operator::Exponents(_) => Outcome::Exponents(results.relative_to(&node.power)),
            Operator::Above(..)
            | Operator::Either(_)
            | Operator::Both(_)
            | Operator::Not(_)
            | Operator::Drop(_) => Outcome::Condition,
        }
    }
}

//! Builder: makes a unit's graph, and declares what it takes: parts, signals, misfits.

use super::{Body, Functions, Graph, Node, Operator, Power, Wire};
use crate::elaboration::{EXPONENT_BITS, Elaboration};
use crate::functions::reciprocal::NORMALISED_FRAC_BITS;
use crate::functions::{Reciprocal, ReciprocalRoot, Table};
use crate::machine::FunctionUnit;
use crate::num::{Exact, Fit, Format, Overflow, Rounding, Word, align};

/// Builds a graph for a unit.
#[derive(Debug)]
pub struct Builder<'e> {
    e: &'e mut Elaboration,
    unit: &'static str,
    nodes: Vec<Node>,
    functions: Functions,
    inputs: usize,
    /// Of each wire that holds an exponent what it is a power of, and that power in words of such
    /// wires: a unit counts a power from where it begins, while a power is counted from 1.
    words: Vec<(Wire, Power)>,
    /// Results of floating-point operators that are not rounded yet, with the bits that each is
    /// rounded to, and where it is rounded.
    unrounded: Vec<Unrounded>,
}

/// A result that is rounded where the next operator reads it. A word that is made from it rounds it
/// by itself.
#[derive(Clone, Copy, Debug)]
struct Unrounded {
    wire: Wire,
    significant_bits: i32,
    rounded: Option<Wire>,
}

/// Signal of a rounding before it is known which word is made from the result.
const NO_SIGNAL: usize = usize::MAX;
/// Bits behind a significand in a floating-point adder: guard, round, sticky.
const GUARD_BITS: i32 = 3;

/// Shape of an exponent.
const EXPONENT: Exact = Exact {
    int_bits: 15,
    frac_bits: 0,
};
/// Shape of a condition.
const CONDITION: Exact = Exact {
    int_bits: 1,
    frac_bits: 0,
};

impl<'e> Builder<'e> {
    /// An empty graph of a unit.
    pub fn new(e: &'e mut Elaboration, unit: &'static str) -> Self {
        Builder {
            e,
            unit,
            nodes: Vec::new(),
            functions: Functions::default(),
            inputs: 0,
            words: Vec::new(),
            unrounded: Vec::new(),
        }
    }

    fn node(&mut self, operator: Operator, shape: Exact, signed: bool, power: Power) -> Wire {
        self.nodes.push(Node {
            operator,
            shape,
            signed,
            significant_bits: 0,
            power,
        });
        Wire((self.nodes.len() - 1) as u16)
    }

    /// The same shape from another operator.
    fn alike(&mut self, operator: Operator, from: Wire) -> Wire {
        self.nodes.push(Node {
            operator,
            ..self.of(from)
        });
        let wire = Wire((self.nodes.len() - 1) as u16);
        if let Some(known) = self.unrounded_of(from) {
            self.unrounded.push(Unrounded {
                wire,
                rounded: None,
                ..known
            });
        }
        wire
    }

    /// Says to which signal each rounding belongs: to the first word that is made from it, or to the
    /// next word if none is, as of a condition's operand.
    fn name_roundings(&mut self) {
        if !self.e.rounds_operators {
            return;
        }
        // Of each wire the first word that is made from it: its place and its signal.
        let mut words: Vec<Option<(usize, usize)>> = vec![None; self.nodes.len()];
        let mut next = None;
        for place in (0..self.nodes.len()).rev() {
            let (word, from) = match &mut self.nodes[place].operator {
                Operator::Fit(from, fit) | Operator::FitShifted(from, _, fit) => {
                    next = Some((place, fit.signal));
                    (next, Some(*from))
                }
                Operator::Rounded(_, fit) => {
                    fit.signal = words[place].or(next).map_or(0, |(_, signal)| signal);
                    (words[place], None)
                }
                _ => (words[place], None),
            };
            let mut made = |wire: Wire| {
                let known = &mut words[wire.place()];
                *known = [*known, word].into_iter().flatten().min();
            };
            match from {
                // Not what decides on its shift.
                Some(from) => made(from),
                None => self.nodes[place].operator.reads(made),
            }
        }
    }

    fn unrounded_of(&self, wire: Wire) -> Option<Unrounded> {
        self.unrounded
            .iter()
            .find(|known| known.wire == wire)
            .copied()
    }

    /// Significant bits that an operator on two wires rounds its result to; none where it is exact,
    /// as all operators are unless the machine says otherwise, and those in fixed point are.
    fn rounds_to(&self, operands: [Wire; 2]) -> Option<i32> {
        let bits_of = |wire: Wire| match (self.unrounded_of(wire), self.of(wire)) {
            (Some(known), _) => Some(known.significant_bits),
            (None, node) if node.is_float() => Some(node.significant_bits),
            // It is converted when the machine is built.
            (None, node) => matches!(node.operator, Operator::Constant(_)).then_some(0),
        };
        let [a, b] = operands.map(bits_of);
        let bits = a?.max(b?);
        (self.e.rounds_operators && bits > 0).then_some(bits)
    }

    /// What an operator reads: a result of a floating-point operator is rounded before.
    fn operand(&mut self, wire: Wire) -> Wire {
        let Some(nth) = self.unrounded.iter().position(|known| known.wire == wire) else {
            return wire;
        };
        let Unrounded {
            significant_bits,
            rounded,
            ..
        } = self.unrounded[nth];
        if let Some(rounded) = rounded {
            return rounded;
        }
        let node = self.of(wire);
        if node.shape.bits() <= significant_bits {
            return wire;
        }
        let word = Word {
            format: Format {
                signed: node.signed,
                int_bits: node.shape.int_bits + i32::from(node.signed),
                frac_bits: node.shape.frac_bits,
                significant_bits,
                flushes: false,
            },
            round: Rounding::NearestEven,
            overflow: Overflow::Saturate,
        };
        self.e.rounding(self.unit, word, node.result());
        let fit = Fit::new(NO_SIGNAL, word, node.shape);
        let rounded = self.word(Operator::Rounded(wire, fit), word, node.power);
        self.unrounded[nth].rounded = Some(rounded);
        rounded
    }

    /// A wire with so many significant bits.
    fn significant(&mut self, wire: Wire, bits: i32) -> Wire {
        self.nodes[wire.place()].significant_bits = bits;
        wire
    }

    /// A word.
    fn word(&mut self, operator: Operator, word: Word, power: Power) -> Wire {
        let Format {
            signed,
            significant_bits,
            ..
        } = word.format;
        let wire = self.node(operator, word.into(), signed, power);
        self.significant(wire, significant_bits)
    }

    /// Shifts what has an exponent to its place in the shape, where its bits are added, compared or
    /// limited.
    fn placed(&mut self, wire: Wire) {
        let node = self.of(wire);
        if node.is_float() {
            self.e.shifter(self.unit, node.shape.bits());
        }
    }

    fn condition(&mut self, operator: Operator) -> Wire {
        self.node(operator, CONDITION, true, Power::ONE)
    }

    pub(super) fn of(&self, wire: Wire) -> Node {
        self.nodes[wire.place()]
    }

    /// Declares parts and misfits that no operator does.
    pub fn elaboration(&mut self) -> &mut Elaboration {
        self.e
    }

    /// How far a wire reaches.
    pub fn shape(&self, wire: Wire) -> Exact {
        self.of(wire).shape
    }

    /// Says what an input is relative to, where that comes after it.
    pub fn relate(&mut self, input: Wire, power: Power) {
        self.nodes[input.place()].power = power;
    }

    /// What a wire is relative to.
    pub fn power(&self, wire: Wire) -> Power {
        self.of(wire).power
    }

    /// A power in the words that wires hold.
    fn in_words(&self, power: Power) -> Power {
        let word = |wire: Wire| {
            self.words
                .iter()
                .find(|(known, _)| *known == wire)
                .map_or(Power::of(wire), |(_, word)| *word)
        };
        let constant = Power::ONE.shifted(power.constant);
        power.terms().iter().fold(constant, |sum, (wire, factor)| {
            sum.times(word(*wire).power(*factor))
        })
    }

    /// A wire that holds an exponent, which counts from another power.
    fn exponent(&mut self, operator: Operator, sign: i32, from: Power) -> Power {
        let from = self.in_words(from);
        let wire = self.node(operator, EXPONENT, true, Power::ONE);
        self.words
            .push((wire, Power::of(wire).power(sign).times(from)));
        let power = Power::of(wire);
        self.nodes[wire.place()].power = power;
        power
    }

    /// The next input, a word.
    pub fn input(&mut self, word: Word) -> Wire {
        let wire = self.state(word.into(), word.format.signed);
        self.significant(wire, word.format.significant_bits)
    }

    /// The next input, a word that is relative to a power.
    pub fn input_under(&mut self, word: Word, power: Power) -> Wire {
        let wire = self.input(word);
        self.relate(wire, power);
        wire
    }

    /// The next input, an exact result that is kept from one item to the next, or comes from
    /// another graph.
    pub fn state(&mut self, shape: Exact, signed: bool) -> Wire {
        self.inputs += 1;
        self.node(Operator::Input(self.inputs - 1), shape, signed, Power::ONE)
    }

    /// The next input, an exponent that counts from a power.
    pub fn power_input(&mut self, from: Power) -> Power {
        self.inputs += 1;
        self.exponent(Operator::Input(self.inputs - 1), 1, from)
    }

    /// The next input, a condition.
    pub fn condition_input(&mut self) -> Wire {
        self.inputs += 1;
        self.condition(Operator::Input(self.inputs - 1))
    }

    /// A word that holds a power's exponent.
    pub fn exponent_of(&mut self, power: Power) -> Wire {
        let words = self.in_words(power);
        debug_assert!(
            words
                .terms()
                .iter()
                .all(|(_, factor)| factor.unsigned_abs().is_power_of_two()),
            "a batch shifts exponents"
        );
        self.node(Operator::Exponents(words), EXPONENT, true, power)
    }

    /// A power, but at least 2^0, by a choice that nothing counts.
    pub fn at_least_one(&mut self, power: Power) -> Power {
        let exponent = self.exponent_of(power);
        self.exponent(Operator::AtLeastOne(exponent), 1, Power::ONE)
    }

    /// 1, in the places of a word or an exact result.
    pub fn one(&mut self, places: impl Into<Exact>) -> Wire {
        let frac_bits = places.into().frac_bits;
        self.constant(
            1 << frac_bits.clamp(0, 62),
            Exact {
                int_bits: 1,
                frac_bits,
            },
        )
    }

    /// So many last places of a shape.
    pub fn constant(&mut self, places: i64, shape: Exact) -> Wire {
        self.node(Operator::Constant(places), shape, places < 0, Power::ONE)
    }

    /// A product, by a multiplier.
    pub fn times(&mut self, a: Wire, b: Wire) -> Wire {
        let rounds_to = self.rounds_to([a, b]);
        let [a, b] = [self.operand(a), self.operand(b)];
        let [x, y] = [a, b].map(|wire| self.of(wire));
        let bits = [x, y].map(|node| node.factor_bits());
        let is_float = x.is_float() || y.is_float();
        self.e.multiplier(self.unit, bits, is_float);
        let product = self.node(
            Operator::Product([a, b]),
            x.shape.times(y.shape),
            x.signed || y.signed,
            x.power.times(y.power),
        );
        let significant_bits = if is_float { bits[0] + bits[1] } else { 0 };
        self.significant(product, significant_bits);
        self.left_unrounded(product, rounds_to)
    }

    /// A result, which is rounded if another operator reads it.
    fn left_unrounded(&mut self, wire: Wire, significant_bits: Option<i32>) -> Wire {
        self.unrounded
            .extend(significant_bits.map(|significant_bits| Unrounded {
                wire,
                significant_bits,
                rounded: None,
            }));
        wire
    }

    /// Times 2^`places`, by wiring.
    pub fn scaled(&mut self, from: Wire, places: i32) -> Wire {
        let scaled = self.alike(Operator::Scaled(from, places), from);
        self.nodes[scaled.place()].shape = self.of(from).shape.scaled(places);
        scaled
    }

    fn aligned(&self, a: Wire, b: Wire) -> [u32; 2] {
        let [x, y] = [a, b].map(|wire| self.of(wire));
        debug_assert_eq!(
            x.power.times(y.power.inverse()),
            Power::ONE,
            "terms of a sum are relative to one power"
        );
        align([x.shape.frac_bits, y.shape.frac_bits])
    }

    /// Terms of a sum as the adder reads them, their places, and the bits that it rounds to.
    fn terms(&mut self, a: Wire, b: Wire, shape: Exact) -> ([Wire; 2], [u32; 2], Option<i32>) {
        let rounds_to = self.rounds_to([a, b]);
        let terms = [self.operand(a), self.operand(b)];
        if let Some(bits) = rounds_to {
            // The term with the lesser exponent is shifted; what leaves the guard bits only counts
            // as whether it is 0.
            self.e.adders(self.unit, 1, EXPONENT_BITS);
            self.e.copies(2, |e| e.choice(self.unit, 2, bits));
            self.e.shifter(self.unit, bits + GUARD_BITS);
            self.e.adders(self.unit, 1, bits + GUARD_BITS);
        } else {
            self.e.adders(self.unit, 1, shape.bits());
            terms.into_iter().for_each(|term| self.placed(term));
        }
        (terms, self.aligned(terms[0], terms[1]), rounds_to)
    }

    /// A sum or difference, with the bits that remain of it where it is rounded.
    fn sum(&mut self, operator: Operator, node: (Exact, bool, Power), bits: Option<i32>) -> Wire {
        let (shape, signed, power) = node;
        let sum = self.node(operator, shape, signed, power);
        self.significant(sum, bits.map_or(0, |bits| bits + GUARD_BITS));
        self.left_unrounded(sum, bits)
    }

    /// A sum that is known to have no more than a shape, by an adder as wide.
    pub fn plus_within(&mut self, a: Wire, b: Wire, shape: Exact) -> Wire {
        let (terms, lefts, rounds_to) = self.terms(a, b, shape);
        let [x, y] = terms.map(|wire| self.of(wire));
        self.sum(
            Operator::Sum(terms, lefts),
            (shape, x.signed || y.signed, x.power),
            rounds_to,
        )
    }

    /// A sum, by an adder.
    pub fn plus(&mut self, a: Wire, b: Wire) -> Wire {
        let shape = self.of(a).shape.plus(self.of(b).shape);
        self.plus_within(a, b, shape)
    }

    /// A difference that is known to have no more than a shape, by an adder as wide.
    pub fn minus_within(&mut self, a: Wire, b: Wire, shape: Exact) -> Wire {
        let (terms, lefts, rounds_to) = self.terms(a, b, shape);
        let power = self.power(a);
        self.sum(
            Operator::Difference(terms, lefts),
            (shape, true, power),
            rounds_to,
        )
    }

    /// A difference, by an adder.
    pub fn minus(&mut self, a: Wire, b: Wire) -> Wire {
        let shape = self.of(a).shape.plus(self.of(b).shape);
        self.minus_within(a, b, shape)
    }

    /// Σ aᵢ·bᵢ.
    pub fn dot(&mut self, a: [Wire; 3], b: [Wire; 3]) -> Wire {
        let [x, y, z] = [0, 1, 2].map(|i| self.times(a[i], b[i]));
        let sum = self.plus(x, y);
        self.plus(sum, z)
    }

    /// What is left of `a`, of which `b` is a part: a difference that has no more than a shape, and
    /// is not negative.
    pub fn rest(&mut self, a: Wire, b: Wire, shape: Exact) -> Wire {
        let difference = self.minus_within(a, b, shape);
        self.nodes[difference.place()].signed = false;
        difference
    }

    /// Known not to be negative.
    pub fn known_natural(&mut self, wire: Wire) -> Wire {
        self.nodes[wire.place()].signed = false;
        wire
    }

    /// The opposite, by what reads it.
    pub fn negated(&mut self, from: Wire) -> Wire {
        let negated = self.alike(Operator::Negation(from), from);
        self.nodes[negated.place()].signed = true;
        negated
    }

    /// The magnitude; the unit declares its adder, if it is one.
    pub fn magnitude(&mut self, from: Wire) -> Wire {
        self.alike(Operator::Magnitude(from), from)
    }

    /// With the sign that `of` has not, by a choice of two signs.
    pub fn opposed(&mut self, from: Wire, of: Wire) -> Wire {
        let opposed = self.alike(Operator::Opposed(from, of), from);
        self.nodes[opposed.place()].signed = true;
        opposed
    }

    /// Negated where `by` is above 0: the least word has no opposite among the words.
    pub fn turned(&mut self, from: Wire, by: Wire) -> Wire {
        let from = self.operand(from);
        self.placed(from);
        let Node { shape, power, .. } = self.of(from);
        self.e.limit(self.unit, self.of(from).bits() + 1);
        self.node(
            Operator::Turned(from, by),
            Exact {
                int_bits: shape.int_bits + 1,
                ..shape
            },
            true,
            power,
        )
    }

    /// At least 0, by a choice that a difference's own sign makes.
    pub fn natural(&mut self, from: Wire) -> Wire {
        let node = self.of(from);
        let bits = if node.is_float() {
            node.significant_bits
        } else {
            node.shape.bits()
        };
        self.e.choice(self.unit, 2, bits);
        let natural = self.alike(Operator::Natural(from), from);
        self.known_natural(natural)
    }

    /// At most 1. What saturates the word that comes of it limits this too, so that it takes no
    /// part of its own.
    pub fn at_most_one(&mut self, from: Wire) -> Wire {
        let Node { shape, .. } = self.of(from);
        self.alike(
            Operator::AtMost(from, 1 << shape.frac_bits.clamp(0, 62)),
            from,
        )
    }

    /// The lesser of two words of one format; the unit declares the gates.
    pub fn lesser(&mut self, a: Wire, b: Wire) -> Wire {
        let [a, b] = [self.operand(a), self.operand(b)];
        self.alike(Operator::Lesser([a, b]), a)
    }

    /// The greater of two words of one format; the unit declares the gates.
    pub fn greater(&mut self, a: Wire, b: Wire) -> Wire {
        let [a, b] = [self.operand(a), self.operand(b)];
        self.alike(Operator::Greater([a, b]), a)
    }

    /// At least one ulp, as a reciprocal, a root or a normaliser requires. Setting the lowest bit
    /// costs one gate.
    pub fn at_least_an_ulp(&mut self, from: Wire) -> Wire {
        self.alike(Operator::AtLeast(from, 1), from)
    }

    /// At least 0, which no exact number would need: a sign that clears a word costs a gate a bit.
    pub fn not_below_0(&mut self, from: Wire) -> Wire {
        let node = self.alike(Operator::AtLeast(from, 0), from);
        self.known_natural(node)
    }

    /// One ulp more, by the carry input of the operator that reads it.
    pub fn an_ulp_more(&mut self, from: Wire) -> Wire {
        let from = self.operand(from);
        self.placed(from);
        let node = self.alike(Operator::APlaceMore(from), from);
        self.significant(node, 0);
        self.nodes[node.place()].shape.int_bits += 1;
        node
    }

    /// A word instead of one that means nothing where a condition holds: for the host, which goes
    /// on with what hardware would drop.
    pub fn guarded(&mut self, from: Wire, condition: Wire, instead: i64) -> Wire {
        self.alike(Operator::Guarded(from, condition, instead), from)
    }

    /// The only operator that loses bits: puts an exact result into the word called `name`.
    pub fn fit(&mut self, name: &str, word: Word, from: Wire) -> Wire {
        let node = self.of(from);
        let fit = self.e.fit(self.unit, name, word, node.result());
        self.word(Operator::Fit(from, fit), word, node.power)
    }

    /// The same for a word of another unit.
    pub fn fit_of(&mut self, unit: &'static str, name: &str, word: Word, from: Wire) -> Wire {
        let unit = std::mem::replace(&mut self.unit, unit);
        let fitted = self.fit(name, word, from);
        self.unit = unit;
        fitted
    }

    /// [`Builder::fit`] under another power than the result's own: by a shifter.
    pub fn fit_to(&mut self, name: &str, word: Word, from: Wire, power: Power) -> Wire {
        let node = self.of(from);
        let fit = self.e.fit_shifted(self.unit, name, word, node.result());
        let more = self.exponent_of(power.times(node.power.inverse()));
        self.word(Operator::FitShifted(from, more, fit), word, power)
    }

    /// A word of the table called `name`, which the fit of the table makes.
    pub fn look_up(&mut self, name: &str, table: Table, argument: Wire) -> Wire {
        let argument = self.operand(argument);
        let word = table.fit().word;
        self.functions.roms[2].push(format!("{}.{name}", self.unit));
        self.functions.tables.push(table);
        let table = self.functions.tables.len() - 1;
        self.word(Operator::Lookup(argument, table), word, Power::ONE)
    }

    /// Vectors' parts, shifted left together until nothing but `int_bits` of the largest is before
    /// the binary point, relative to the power that this takes. A normaliser for each part, and
    /// where there are three what compares them.
    pub fn normalised<const N: usize>(
        &mut self,
        largest: Wire,
        parts: [Wire; N],
        int_bits: i32,
    ) -> [Wire; N] {
        let largest = self.operand(largest);
        let parts = parts.map(|part| self.operand(part));
        let Node { shape, power, .. } = self.of(largest);
        let frac_bits = NORMALISED_FRAC_BITS + 1 - int_bits;
        // A leading one at bit 61 was at 61 − lead, and is 2^(61 − lead − frac_bits).
        let leading = self.exponent(
            Operator::Lead(largest),
            -1,
            power.shifted(NORMALISED_FRAC_BITS - shape.frac_bits),
        );
        let [(lead, _)] = *leading.terms() else {
            unreachable!("it is one wire's")
        };
        parts.map(|part| {
            self.e.normaliser(self.unit, shape.bits());
            let signed = self.of(part).signed;
            self.node(
                Operator::Normalised(part, lead),
                Exact {
                    int_bits,
                    frac_bits,
                },
                signed,
                leading.shifted(1 - int_bits),
            )
        })
    }

    /// Vector from `from` to `to`, normalised by its largest part, in the word called `relative`.
    pub fn relative(&mut self, word: Word, to: [Wire; 3], from: [Wire; 3]) -> [Wire; 3] {
        let difference = [0, 1, 2].map(|axis| self.minus(to[axis], from[axis]));
        let largest = self.largest(difference);
        let normalised = self.normalised(largest, difference, 0);
        normalised.map(|part| self.fit("relative", word, part))
    }

    /// All bits of three magnitudes, and at least a last place.
    pub fn largest(&mut self, parts: [Wire; 3]) -> Wire {
        let parts = parts.map(|part| self.operand(part));
        parts.iter().for_each(|part| self.placed(*part));
        let node = self.alike(Operator::Largest(parts), parts[0]);
        self.significant(node, 0);
        let bits = self.of(node).shape.bits();
        self.e.adders(self.unit, 3, bits);
        self.known_natural(node)
    }

    /// 1/x of a positive word, by a normaliser and the reciprocal called `name`.
    pub fn reciprocal(&mut self, name: &str, config: FunctionUnit, x: Wire) -> Wire {
        let x = self.operand(x);
        let node = self.of(x);
        self.e.normaliser(self.unit, node.bits());
        self.functions.roms[0].push(format!("{}.{name}", self.unit));
        self.functions.reciprocals.push(Reciprocal::new(
            self.e,
            self.unit,
            name,
            config,
            node.shape.frac_bits,
        ));
        let operator = Operator::Reciprocal(x, self.functions.reciprocals.len() - 1);
        let inverse = self.node(operator, config.format().into(), false, Power::ONE);
        let power = self.exponent(Operator::Exponent(inverse), 1, node.power.inverse());
        self.nodes[inverse.place()].power = power;
        inverse
    }

    /// A root of a positive result, by the operator that this makes.
    fn root_by(
        &mut self,
        name: &str,
        config: FunctionUnit,
        x: Wire,
        operator: impl FnOnce(Wire, usize) -> Operator,
        shape: Exact,
    ) -> Wire {
        let x = self.operand(x);
        let node = self.of(x);
        self.e.normaliser(self.unit, node.bits());
        self.functions.roms[1].push(format!("{}.{name}", self.unit));
        self.functions.roots.push(ReciprocalRoot::new(
            self.e,
            self.unit,
            name,
            config,
            node.shape.frac_bits,
        ));
        let operator = operator(x, self.functions.roots.len() - 1);
        let is_inverse = matches!(operator, Operator::InverseRoot(..));
        let root = self.node(operator, shape, false, Power::ONE);
        let of = node.power.root();
        let from = if is_inverse { of.inverse() } else { of };
        let power = self.exponent(Operator::Exponent(root), 1, from);
        self.nodes[root.place()].power = power;
        root
    }

    /// 1/√x of a positive result, by a normaliser and the root called `name`.
    pub fn inverse_root(&mut self, name: &str, config: FunctionUnit, x: Wire) -> Wire {
        self.root_by(
            name,
            config,
            x,
            Operator::InverseRoot,
            config.format().into(),
        )
    }

    /// √x of a positive result, an exact product, by a normaliser, the root called `name` and a
    /// multiplier.
    pub fn root(&mut self, name: &str, config: FunctionUnit, x: Wire) -> Wire {
        let word = Exact::from(config.format());
        let root = self.root_by(name, config, x, Operator::Root, word.times(word).scaled(1));
        self.e.times(self.unit, config.format(), config.format());
        root
    }

    /// Where `a` is greater; the unit declares what compares them.
    pub fn above(&mut self, a: Wire, b: Wire) -> Wire {
        let [a, b] = [self.operand(a), self.operand(b)];
        self.placed(a);
        self.placed(b);
        let lefts = self.aligned(a, b);
        self.condition(Operator::Above([a, b], lefts))
    }

    /// Where a condition does not hold.
    pub fn not(&mut self, condition: Wire) -> Wire {
        self.condition(Operator::Not(condition))
    }

    /// Where one condition holds or the other.
    pub fn either(&mut self, a: Wire, b: Wire) -> Wire {
        self.condition(Operator::Either([a, b]))
    }

    /// Where both conditions hold.
    pub fn both(&mut self, a: Wire, b: Wire) -> Wire {
        self.condition(Operator::Both([a, b]))
    }

    /// Where a word is not above 0.
    pub fn is_none(&mut self, from: Wire) -> Wire {
        let Node { shape, power, .. } = self.of(from);
        let place = self.constant(1, shape);
        self.nodes[place.place()].power = power;
        self.above(place, from)
    }

    /// Items in which a condition holds are culled: none of their words counts from here on.
    pub fn drop_where(&mut self, condition: Wire) {
        self.condition(Operator::Drop(condition));
    }

    /// The graph, with these results.
    pub fn build<const OUTPUTS: usize>(&mut self, outputs: [Wire; OUTPUTS]) -> Graph<OUTPUTS> {
        let outputs = outputs.map(|wire| self.operand(wire));
        self.name_roundings();
        self.unrounded.clear();
        let (nodes, functions) = (
            std::mem::take(&mut self.nodes),
            std::mem::take(&mut self.functions),
        );
        Graph {
            body: Body { nodes, functions },
            outputs,
        }
    }
}

//! Elaboration: collects signals, parts and elaboration errors while a description is checked.
//!
//! Units declare their arithmetic, and elaboration keeps the parts that it is built of: a
//! multiplier per product, an adder per sum, a register per word.
//!
//! Laws: `setup_makes_the_products_that_it_declares`, `every_multiplier_is_declared`.

use crate::machine::{FunctionUnit, Machine, Operators};
pub mod latency;
pub mod masks;
pub mod microarchitecture;
pub mod sorter;

pub use crate::records::{Signal, unit};

use crate::num::{Exact, Fit, Format, MAX_WIDTH_BITS, Overflow, Rounding, Word};

/// Operator of a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operator {
    /// A product: bits of both operands, sign bits included.
    Multiplier([i32; 2]),
    /// A sum, a difference or a comparison: bits.
    Adder(i32),
    /// Rounds a result to a word: bits of the word.
    Rounder(i32),
    /// Multiplexer of two words: bits.
    Multiplexer(i32),
    /// Multiplexer of more than two words: how many, and bits of each.
    Choice([i32; 2]),
    /// Keeps a stored word unless enabled, bits: a multiplexer in standard cells, the clock enable
    /// of a flip-flop in an FPGA.
    Hold(i32),
    /// A word that is kept for a cycle: bits.
    Register(i32),
    /// A table: words, and bits of each.
    Rom([i32; 2]),
}

/// A part of a unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// The unit it belongs to.
    pub unit: &'static str,
    /// Its operator.
    pub operator: Operator,
    /// Number of them in a unit with an initiation interval of 1.
    pub copies: u32,
    /// Whether every lane of the rasteriser has its own copies.
    pub per_lane: bool,
}

impl Part {
    /// Products per cycle.
    pub fn products(&self) -> u32 {
        if matches!(self.operator, Operator::Multiplier(_)) {
            self.copies
        } else {
            0
        }
    }
}

/// Signals, parts and elaboration errors collected so far.
#[derive(Clone, Debug)]
pub struct Elaboration {
    /// Every signal, in the order of the diagram.
    pub signals: Vec<Signal>,
    /// All parts.
    pub parts: Vec<Part>,
    /// Every elaboration error, one sentence each.
    pub errors: Vec<String>,
    /// Whether operators on floating-point words round their results.
    pub rounds_operators: bool,
    /// Whether one of them does.
    has_roundings: bool,
    /// Copies of the parts that are being declared, and whether each lane has its own.
    copies: u32,
    per_lane: bool,
}

impl Default for Elaboration {
    fn default() -> Self {
        Elaboration::new(Operators::Exact)
    }
}

/// Widest word on a port or at a multiplier, sign included.
pub const MAX_OPERAND_BITS: i32 = 32;
/// Widest magnitude of an exact result.
const MAX_EXACT_BITS: i32 = 62;
/// Bits of an adder of exponents.
pub const EXPONENT_BITS: i32 = 8;

/// A number of bits in a sentence.
fn counted_bits(count: i32) -> String {
    match count {
        1 => "1 bit".into(),
        count => format!("{count} bits"),
    }
}

impl Elaboration {
    /// Nothing yet, of a machine with such operators.
    pub fn new(operators: Operators) -> Self {
        Elaboration {
            signals: Vec::new(),
            parts: Vec::new(),
            errors: Vec::new(),
            rounds_operators: operators == Operators::Rounded,
            has_roundings: false,
            copies: 1,
            per_lane: false,
        }
    }

    /// A word on a port or at a multiplier: at most 32 bits.
    pub fn port(&mut self, unit: &'static str, name: &str, word: Word) {
        self.carried(unit, name, word, word.format.signed);
        self.saturates(unit, name, word);
    }

    /// The same for values that are signed or never negative.
    pub fn number(&mut self, unit: &'static str, name: &str, word: Word, signed: bool) {
        if self.carried(unit, name, word, signed) {
            self.signedness(unit, name, word, signed);
        }
        self.saturates(unit, name, word);
    }

    /// Whether a port carries a word of this width. The suggestion has the sign that is needed.
    fn carried(&mut self, unit: &'static str, name: &str, word: Word, signed: bool) -> bool {
        let limit = |signed: bool| MAX_OPERAND_BITS - i32::from(!signed);
        let is_carried = word.format.width() <= limit(word.format.signed);
        self.require(is_carried, || {
            let bits = if word.format.is_float() {
                "bits from its sign to its last place"
            } else {
                "bits"
            };
            // The integer bits stay where they leave a bit, the others become fewer.
            let sign = i32::from(signed);
            let magnitude = word.format.int_bits - i32::from(word.format.signed);
            let int_bits = magnitude.clamp(1, limit(signed) - sign - 1) + sign;
            let fits = Format {
                signed,
                int_bits,
                frac_bits: limit(signed) - int_bits,
                ..word.format
            };
            format!(
                "{unit}.{name} is {word}, {} {bits} on a port that carries {}: {fits} would fit",
                word.format.width(),
                limit(word.format.signed)
            )
        });
        is_carried
    }

    /// Refuses floating-point words.
    pub fn fixed_point(&mut self, unit: &'static str, name: &str, word: Word) {
        self.require(!word.format.is_float(), || {
            let fits = word.format.in_fixed_point();
            format!("{unit}.{name} is {word}, but it must be fixed point: {fits} would fit")
        });
    }

    /// Refuses words that wrap: their values mean nothing then.
    pub fn saturates(&mut self, unit: &'static str, name: &str, word: Word) {
        self.require(word.overflow == Overflow::Saturate, || {
            format!("{unit}.{name} wraps, but only the raster's registers and the fragment's sums may: let it saturate")
        });
    }

    /// Checks the width of an exact result that is used without being fitted. `what` names it.
    pub fn holds_exact(&mut self, what: &str, exact: Exact) {
        self.require(exact.bits() <= MAX_EXACT_BITS, || {
            let over = counted_bits(exact.bits() - MAX_EXACT_BITS);
            format!("{what} needs {} bits, but {MAX_EXACT_BITS} can be held: {over} must be removed from its operands", exact.bits())
        });
    }

    /// Repeats the parts that `declare` adds.
    pub fn copies<T>(&mut self, copies: u32, declare: impl FnOnce(&mut Self) -> T) -> T {
        let before = self.copies;
        self.copies *= copies;
        let declared = declare(self);
        self.copies = before;
        declared
    }

    /// Repeats the parts that `declare` adds for every lane of the rasteriser.
    pub fn per_lane<T>(&mut self, declare: impl FnOnce(&mut Self) -> T) -> T {
        let before = std::mem::replace(&mut self.per_lane, true);
        let declared = declare(self);
        self.per_lane = before;
        declared
    }

    /// Adds a part.
    pub fn part(&mut self, unit: &'static str, operator: Operator) {
        let Elaboration {
            copies, per_lane, ..
        } = *self;
        if copies > 0 {
            self.parts.push(Part {
                unit,
                operator,
                copies,
                per_lane,
            });
        }
    }

    /// A multiplier of two words: the exact product.
    pub fn times(
        &mut self,
        unit: &'static str,
        a: impl Into<Operand>,
        b: impl Into<Operand>,
    ) -> Exact {
        let (a, b) = (a.into(), b.into());
        let product = a.exact.times(b.exact);
        let is_float = a.is_float || b.is_float;
        self.multiplier(unit, [a.bits, b.bits], is_float);
        if is_float {
            self.shifter(unit, product.bits());
        }
        product
    }

    /// A multiplier of factors of so many bits, sign bits included; in floating point their
    /// exponents are added.
    pub fn multiplier(&mut self, unit: &'static str, bits: [i32; 2], is_float: bool) {
        self.part(unit, Operator::Multiplier(bits));
        if is_float {
            self.adders(unit, 1, EXPONENT_BITS);
        }
    }

    /// An adder per term except the first; returns the exact sum (or difference).
    pub fn sum<const N: usize>(&mut self, unit: &'static str, terms: [Exact; N]) -> Exact {
        let add = |sum: Exact, term: Exact| {
            let sum = sum.plus(term);
            self.part(unit, Operator::Adder(sum.bits()));
            sum
        };
        terms.into_iter().reduce(add).unwrap_or(Exact {
            int_bits: 0,
            frac_bits: 0,
        })
    }

    /// Adds `count` adders of `bits` bits.
    pub fn adders(&mut self, unit: &'static str, count: u32, bits: i32) {
        self.copies(count, |e| e.part(unit, Operator::Adder(bits)));
    }

    /// Adds a multiplexer of `words` words.
    pub fn choice(&mut self, unit: &'static str, words: u32, bits: i32) {
        match words {
            0 | 1 => {}
            2 => self.part(unit, Operator::Multiplexer(bits)),
            _ => self.part(
                unit,
                Operator::Choice([words.min(i32::MAX as u32) as i32, bits]),
            ),
        }
    }

    /// Limits a word on one side: a comparison and a multiplexer.
    pub fn limit(&mut self, unit: &'static str, bits: i32) {
        self.adders(unit, 1, bits);
        self.choice(unit, 2, bits);
    }

    /// Shifts by any number of places: one stage of multiplexers per bit of that number.
    pub fn shifter(&mut self, unit: &'static str, bits: i32) {
        let stages = (bits.max(1) as u32).next_power_of_two().ilog2();
        self.copies(stages, |e| e.part(unit, Operator::Multiplexer(bits)));
    }

    /// Shifts the leading one to the front. Counting the zeros before it takes about as many gates
    /// as an adder.
    pub fn normaliser(&mut self, unit: &'static str, bits: i32) {
        self.part(unit, Operator::Adder(bits));
        self.shifter(unit, bits);
    }

    /// Quantises an exact result to the word called `name`.
    pub fn fit(
        &mut self,
        unit: &'static str,
        name: &str,
        word: Word,
        from: impl Into<Operand>,
    ) -> Fit {
        let operand = from.into();
        if operand.is_float && !word.format.is_float() {
            self.shifter(unit, operand.exact.bits());
        }
        self.fit_placed(unit, name, word, operand)
    }

    /// [`Elaboration::fit`] of what is already at its place.
    fn fit_placed(
        &mut self,
        unit: &'static str,
        name: &str,
        word: Word,
        Operand {
            bits,
            exact: from,
            is_float,
        }: Operand,
    ) -> Fit {
        if word.format.is_float() {
            self.saturates(unit, name, word);
        }
        let left = (word.format.frac_bits - from.frac_bits).max(0);
        if from.bits() > MAX_EXACT_BITS {
            self.errors.push(format!(
                "{unit}.{name} is made from an exact result of {} bits, but {MAX_EXACT_BITS} can be held: {} must be removed from its operands",
                from.bits(),
                counted_bits(from.bits() - MAX_EXACT_BITS)
            ));
        }
        if left > 31 {
            self.errors.push(format!(
                "{unit}.{name} is {word}, {left} fraction bits finer than the result that it is made from: {} would hold all of it",
                Format { frac_bits: from.frac_bits, ..word.format }.within(MAX_WIDTH_BITS)
            ));
        }
        let held = if is_float { bits } else { from.bits() };
        self.fit_parts(unit, word, from, held);
        Fit::new(self.signal(unit, name, word), word, from)
    }

    /// Parts that round the result of an operator for the next one.
    pub fn rounding(&mut self, unit: &'static str, word: Word, from: Operand) {
        self.has_roundings = true;
        self.fit_parts(unit, word, from.exact, from.bits);
    }

    /// Parts that round and limit a result of which only `held` bits are not 0.
    fn fit_parts(&mut self, unit: &'static str, word: Word, from: Exact, held: i32) {
        let bits = word.format.stored_bits();
        self.part(unit, Operator::Register(bits));
        if word.format.is_float() {
            // The leading one goes to the front, and its place into the exponent.
            self.normaliser(unit, held);
            self.adders(unit, 1, EXPONENT_BITS);
        }
        let is_float = word.format.is_float();
        if word.round != Rounding::Truncate && (from.frac_bits > word.format.frac_bits || is_float)
        {
            // Behind a normaliser, half an ulp is no row of a product's array, and rounding up can
            // carry into the exponent.
            self.part(
                unit,
                if is_float {
                    Operator::Adder(bits)
                } else {
                    Operator::Rounder(bits)
                },
            );
            // The tie test reads the LSB of the word, so half an ulp cannot be a row of the
            // product's array. It takes a chain of half adders along the exact result: half an
            // adder (synthesis results: docs/book/cost.md).
            if word.round == Rounding::NearestEven {
                self.part(unit, Operator::Adder((held + 1) / 2));
            }
        }
        if word.overflow == Overflow::Saturate && from.int_bits > Exact::from(word).int_bits {
            self.part(unit, Operator::Multiplexer(bits));
        }
    }

    /// [`Elaboration::fit`] of a result that is shifted first by any number of places: to the left
    /// until it always saturates, to the right until only the sign is left.
    /// The shift of a floating-point word is a sum of exponents.
    pub fn fit_shifted(
        &mut self,
        unit: &'static str,
        name: &str,
        word: Word,
        from: impl Into<Operand>,
    ) -> Fit {
        let operand = from.into();
        if word.format.is_float() {
            self.adders(unit, 1, EXPONENT_BITS);
        } else {
            self.shifter(unit, operand.exact.bits() + word.format.width());
        }
        self.fit_placed(unit, name, word, operand)
    }

    fn signal(&mut self, unit: &'static str, name: &str, word: Word) -> usize {
        if let Some(declared) = self
            .signals
            .iter()
            .position(|s| s.unit == unit && s.name == name)
        {
            return declared;
        }
        self.signals.push(Signal {
            unit,
            name: name.to_owned(),
            word,
        });
        self.signals.len() - 1
    }

    /// The shape of a function unit, moved into the legal range if it is outside, so that
    /// elaboration can go on.
    pub fn function_unit(
        &mut self,
        unit: &'static str,
        name: &str,
        config: FunctionUnit,
    ) -> FunctionUnit {
        let bits = self.within(unit, &format!("{name}.bits"), config.bits, 4, 30);
        let table_bits = self.within(
            unit,
            &format!("{name}.table_bits"),
            config.table_bits,
            1,
            12.min(bits),
        );
        let newton_steps = self.within(
            unit,
            &format!("{name}.newton_steps"),
            config.newton_steps,
            0,
            3,
        );
        FunctionUnit {
            table_bits,
            newton_steps,
            bits,
        }
    }

    /// Refuses operators that would round, if none does.
    pub fn uses_operators(&mut self) {
        self.require(!self.rounds_operators || self.has_roundings, || {
            "operators is rounded, but no operator of project, ellipse, colour, contribution, gauss or resolve reads the result of another one on floating-point words: leave it out".into()
        });
    }

    /// Checks that a number is in a range, and limits it to that range.
    pub fn within(
        &mut self,
        unit: &'static str,
        name: &str,
        value: u32,
        least: u32,
        most: u32,
    ) -> u32 {
        if !(least..=most).contains(&value) {
            self.errors.push(format!(
                "{unit}.{name} is {value}: {least} to {most} can be built"
            ));
        }
        value.clamp(least, most)
    }

    /// Adds an elaboration error unless the condition holds.
    pub fn require(&mut self, holds: bool, error: impl FnOnce() -> String) {
        if !holds {
            self.errors.push(error());
        }
    }

    /// Checks that a word on a port can represent 1.
    pub fn holds_one(&mut self, unit: &'static str, name: &str, word: Word) {
        let format = word.format;
        // One that is too wide was refused, with a suggestion that holds 1.
        let holds_one = format.max() >= format.one() || format.width() > MAX_OPERAND_BITS;
        self.require(holds_one, || {
            let frac_bits = format.frac_bits.min(MAX_OPERAND_BITS - 2);
            let fits = Format {
                int_bits: if format.signed { 2 } else { 1 },
                frac_bits,
                ..format
            };
            format!("{unit}.{name} is {word} and must hold 1: {fits} would fit")
        });
    }

    /// Checks that a word can represent 1. A machine that blends Gaussians in one word
    /// (`fragment.sheets.composite`) may lack an ulp: a word without integer bits holds 1 as its
    /// greatest value. On other machines, such a word would change the picture unnoticed.
    pub fn holds_one_or_an_ulp_less(
        &mut self,
        machine: &Machine,
        unit: &'static str,
        name: &str,
        word: Word,
    ) {
        let format = word.format;
        let lacks_an_ulp = !format.signed && format.int_bits == 0 && !format.is_float();
        if machine.fragment.composite().is_none() || !lacks_an_ulp {
            self.holds_one(unit, name, word);
        }
    }

    /// Checks that a word is unsigned (`signed` false) or signed.
    pub fn signedness(&mut self, unit: &'static str, name: &str, word: Word, signed: bool) {
        self.require(word.format.signed == signed, || {
            let fits = Format {
                signed,
                ..word.format
            };
            format!(
                "{unit}.{name} is {word}, but its values are {}: {fits} would fit",
                if signed { "signed" } else { "never negative" }
            )
        });
    }
}

/// Operand of a multiplier, or of what rounds a result.
#[derive(Clone, Copy, Debug)]
pub struct Operand {
    /// Bits that can be other than 0.
    bits: i32,
    exact: Exact,
    /// Whether they are a significand, and not at their place.
    is_float: bool,
}

impl Operand {
    /// A floating-point word, or a product of them, with so many significant bits.
    pub fn significant(exact: Exact, bits: i32) -> Self {
        Operand {
            bits,
            exact,
            is_float: true,
        }
    }
}

impl From<Exact> for Operand {
    fn from(exact: Exact) -> Self {
        Operand {
            bits: exact.bits(),
            exact,
            is_float: false,
        }
    }
}

impl From<Word> for Operand {
    fn from(word: Word) -> Self {
        word.format.into()
    }
}

impl From<Format> for Operand {
    fn from(format: Format) -> Self {
        Operand {
            bits: format.factor_bits(),
            exact: format.into(),
            is_float: format.is_float(),
        }
    }
}

#[cfg(test)]
mod tests;

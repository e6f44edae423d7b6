//! SystemVerilog: a graph as a combinational module, which has a port for each input and each
//! result.
//!
//! Every wire is signed and holds ±2^bits of its shape. Fits, tables, reciprocals, roots and
//! normalisers are instances of the modules in `rtl`; conditions are single bits. Only what a
//! result depends on is written.
//!
//! Law: `generated_rtl_gives_the_records_of_the_machine` (tests/generated of the bench).

use super::{Body, Functions, Graph, Node, Operator, Wire};
use crate::elaboration::Signal;
use crate::machine::Interpolation;
use crate::num::{Fit, Format, Overflow};
use std::collections::BTreeSet;
use std::fmt::Write;

/// A port of a module.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Port {
    /// Name.
    pub name: String,
    /// Bits of a signed word; 1 for a condition.
    pub bits: i32,
    /// Whether the word is −1 (holds) or 0, as a single bit.
    pub is_condition: bool,
}

/// A module's text, and its ports.
#[derive(Clone, Debug)]
pub struct Module {
    /// The text of its file.
    pub text: String,
    /// In the order of the graph's inputs.
    pub inputs: Vec<Port>,
    /// In the order of the graph's results.
    pub outputs: Vec<Port>,
}

/// Exponents of the records' words and of function units have 8 bits; negated ones one more.
const EXPONENT: [i64; 2] = [-128, 128];
/// Place of a normalised wire's leading one.
const LEADING: i32 = 61;

/// What is written of a node.
#[derive(Clone, Debug)]
enum Written {
    /// Nothing: no result depends on it.
    None,
    /// A signed wire.
    Word {
        name: String,
        bits: i32,
        /// Last places, all zero, that the wire leaves out.
        below: i32,
    },
    /// A single bit.
    Condition(String),
}

impl<const OUTPUTS: usize> Graph<OUTPUTS> {
    /// The module called `name`. `inputs` and `outputs` name the ports.
    ///
    /// # Panics
    /// Where there are fewer names than inputs.
    pub fn module(
        &self,
        signals: &[Signal],
        name: &str,
        inputs: &[String],
        outputs: [&str; OUTPUTS],
    ) -> Module {
        let results: Vec<(Wire, &str)> = self.outputs.into_iter().zip(outputs).collect();
        self.body.module(signals, name, inputs, &results)
    }

    /// Whether it has tables.
    pub fn has_roms(&self) -> bool {
        self.body.has_roms()
    }
}

impl Body {
    fn module(
        &self,
        signals: &[Signal],
        name: &str,
        inputs: &[String],
        results: &[(Wire, &str)],
    ) -> Module {
        let mut writer = Writer {
            nodes: &self.nodes,
            functions: &self.functions,
            signals,
            needed: self.needed(results.iter().map(|(wire, _)| *wire)),
            conditions: self.conditions(),
            written: Vec::new(),
            ranges: vec![[0; 2]; self.nodes.len()],
            inputs: Vec::new(),
            unused: Vec::new(),
            body: String::new(),
        };
        for place in 0..self.nodes.len() {
            let written = writer.node(place, inputs);
            writer.written.push(written);
        }
        let mut outputs: Vec<Port> = Vec::new();
        let mut assigned: Vec<String> = Vec::new();
        for (wire, name) in results {
            let (value, bits, is_condition) = match writer.of(*wire) {
                Written::Condition(value) => (value, 1, true),
                _ => {
                    let (value, bits) = writer.expression(*wire);
                    (value, bits, false)
                }
            };
            assigned.push(format!("assign {name} = {value};"));
            outputs.push(Port {
                name: (*name).into(),
                bits,
                is_condition,
            });
        }
        assigned.into_iter().for_each(|line| writer.line(line));
        if !writer.unused.is_empty() {
            let all = writer.unused.join(", ");
            writer.line(format!("wire unused = &{{1'b0, {all}}};"));
        }
        let ports = [("input", &writer.inputs), ("output", &outputs)].map(|(way, ports)| {
            let ports = ports.iter().map(|port| {
                let kind = if port.is_condition {
                    String::new()
                } else {
                    format!("signed [{}:0] ", port.bits - 1)
                };
                format!("    {way} wire {kind}{}", port.name)
            });
            ports.collect::<Vec<_>>().join(",\n")
        });
        let parameters = if self.has_roms() {
            " #(\n    parameter ROMS = \"rom/\" // folder of the tables, with its slash\n)"
        } else {
            ""
        };
        Module {
            text: format!(
                "`timescale 1ns / 1ps\n`default_nettype none\n\nmodule {name}{parameters} (\n{}\n);\n{}endmodule\n\n`default_nettype wire\n",
                ports.join(",\n"),
                writer.body
            ),
            inputs: writer.inputs,
            outputs,
        }
    }

    fn has_roms(&self) -> bool {
        let Functions {
            tables,
            reciprocals,
            roots,
            ..
        } = &self.functions;
        tables.len() + reciprocals.len() + roots.len() > 0
    }

    /// The nodes that a result depends on.
    fn needed(&self, results: impl Iterator<Item = Wire>) -> Vec<bool> {
        let mut needed = vec![false; self.nodes.len()];
        results.for_each(|wire| needed[wire.place()] = true);
        for (place, node) in self.nodes.iter().enumerate().rev() {
            if needed[place] {
                match node.operator {
                    Operator::Guarded(from, ..) => needed[from.place()] = true,
                    operator => operator.reads(|wire| needed[wire.place()] = true),
                }
            }
        }
        needed
    }

    /// The nodes that are conditions.
    fn conditions(&self) -> BTreeSet<usize> {
        let mut conditions = BTreeSet::new();
        for (place, node) in self.nodes.iter().enumerate() {
            let mut add = |wires: &[Wire]| {
                conditions.extend(wires.iter().map(|wire| wire.place()));
            };
            match node.operator {
                Operator::Either(pair) | Operator::Both(pair) => add(&pair),
                Operator::Not(of) | Operator::Drop(of) | Operator::Guarded(_, of, _) => add(&[of]),
                Operator::Above(..) => {}
                _ => continue,
            }
            if !matches!(node.operator, Operator::Guarded(..)) {
                conditions.insert(place);
            }
        }
        conditions
    }
}

struct Writer<'g> {
    nodes: &'g [Node],
    functions: &'g Functions,
    signals: &'g [Signal],
    needed: Vec<bool>,
    conditions: BTreeSet<usize>,
    written: Vec<Written>,
    /// Least and greatest word of each exponent.
    ranges: Vec<[i64; 2]>,
    inputs: Vec<Port>,
    /// Wires of which some bits are not read.
    unused: Vec<String>,
    body: String,
}

/// Bits of a signed word that holds a range.
fn bits_of([least, most]: [i64; 2]) -> i32 {
    let magnitude = most.max(!least).max(0);
    65 - magnitude.leading_zeros() as i32
}

fn literal(value: i64, bits: i32) -> String {
    if bits == 1 {
        // Front ends ask for two bits even for 0 if the number is signed.
        return format!("$signed(1'b{})", value & 1);
    }
    let sign = if value < 0 { "-" } else { "" };
    format!("{sign}{bits}'sd{}", value.unsigned_abs())
}

impl Writer<'_> {
    fn line(&mut self, line: String) {
        let _ = writeln!(self.body, "  {line}");
    }

    fn of(&self, wire: Wire) -> Written {
        self.written[wire.place()].clone()
    }

    /// A wire's expression with all of its places, and its bits.
    fn expression(&self, wire: Wire) -> (String, i32) {
        match self.of(wire) {
            Written::Word { name, bits, below } if below > 0 => {
                let wide = bits + below;
                (format!("({wide}'({name}) <<< {below})"), wide)
            }
            Written::Word { name, bits, .. } => (name, bits),
            other => unreachable!("a word: {other:?}"),
        }
    }

    fn condition(&self, wire: Wire) -> String {
        match self.of(wire) {
            Written::Condition(name) => name,
            other => unreachable!("a condition: {other:?}"),
        }
    }

    /// A wire in so many bits, shifted left.
    fn cast(&self, wire: Wire, bits: i32, places: u32) -> String {
        let (name, from) = self.expression(wire);
        let cast = if from == bits {
            name
        } else {
            format!("{bits}'({name})")
        };
        match places {
            0 => cast,
            places => format!("({cast} <<< {places})"),
        }
    }

    /// A wire's sign.
    fn sign(&self, wire: Wire) -> String {
        match self.of(wire) {
            Written::Word { name, bits, .. } => format!("{name}[{}]", bits - 1),
            other => unreachable!("a word: {other:?}"),
        }
    }

    /// A new signed wire.
    fn word(&mut self, name: String, bits: i32, value: &str) -> Written {
        let top = bits - 1;
        self.line(format!("wire signed [{top}:0] {name} = {value};"));
        Written::Word {
            name,
            bits,
            below: 0,
        }
    }

    /// A wire for an exponent.
    fn exponent(&mut self, place: usize, range: [i64; 2], bits: i32, value: &str) -> Written {
        self.ranges[place] = range;
        self.word(format!("n{place}"), bits, value)
    }

    fn node(&mut self, place: usize, inputs: &[String]) -> Written {
        let node = self.nodes[place];
        if let Operator::Input(nth) = node.operator {
            return self.input(place, &inputs[nth]);
        }
        if !self.needed[place] {
            return Written::None;
        }
        let name = format!("n{place}");
        // Sums and products reach ±2^bits.
        let bits = (node.shape.bits() + 2).max(2);
        match node.operator {
            Operator::Input(_) | Operator::Drop(_) => Written::None,
            Operator::Constant(value) => {
                let bits = bits_of([value.min(0), value.max(0)]);
                self.word(name, bits, &literal(value, bits))
            }
            Operator::Product([a, b]) => {
                let [(x, p), (y, q)] = [a, b].map(|wire| self.expression(wire));
                let bits = bits.max(p).max(q);
                self.word(name, bits, &format!("{x} * {y}"))
            }
            Operator::Sum([a, b], lefts) => self.sum(name, bits, [a, b], lefts, '+'),
            Operator::Difference([a, b], lefts) => self.sum(name, bits, [a, b], lefts, '-'),
            Operator::Negation(from) => {
                let x = self.cast(from, bits, 0);
                self.word(name, bits, &format!("-({x})"))
            }
            Operator::Magnitude(from) => {
                let value = self.magnitude(from, bits);
                self.word(name, bits, &value)
            }
            Operator::Opposed(from, to) => {
                let (x, sign) = (self.cast(from, bits, 0), self.sign(to));
                self.word(name, bits, &format!("{sign} ? {x} : -({x})"))
            }
            Operator::Turned(from, by) => {
                let (x, (y, _), sign) =
                    (self.cast(from, bits, 0), self.expression(by), self.sign(by));
                let value = format!("!{sign} && |{y} ? -({x}) : {x}");
                self.word(name, bits, &value)
            }
            Operator::Natural(from) => {
                let (x, sign) = (self.cast(from, bits, 0), self.sign(from));
                let value = format!("{sign} ? {} : {x}", literal(0, bits));
                self.word(name, bits, &value)
            }
            Operator::AtMost(from, most) => self.limited(name, from, '>', most),
            Operator::AtLeast(from, least) => self.limited(name, from, '<', least),
            Operator::APlaceMore(from) => {
                let x = self.cast(from, bits, 0);
                self.word(name, bits, &format!("{x} + {}", literal(1, bits)))
            }
            Operator::Scaled(from, _) => self.of(from),
            Operator::Lesser(pair) => self.choice(name, pair, '<'),
            Operator::Greater(pair) => self.choice(name, pair, '>'),
            // Only the host goes on with an item that is dropped.
            Operator::Guarded(from, ..) => self.of(from),
            Operator::Lookup(argument, table) => self.lookup(place, argument, table),
            Operator::Fit(from, fit) | Operator::Rounded(from, fit) => {
                self.fit(place, from, None, &fit)
            }
            Operator::FitShifted(from, more, fit) => self.fit(place, from, Some(more), &fit),
            Operator::Largest(parts) => {
                let parts = parts.map(|part| self.magnitude(part, bits));
                let [a, b, c] = parts.map(|part| format!("({part})"));
                let value = format!("{a} | {b} | {c} | {}", literal(1, bits));
                self.word(name, bits, &value)
            }
            Operator::Lead(from) => self.lead(place, from),
            Operator::Normalised(from, lead) => self.normalised(name, from, lead),
            Operator::Reciprocal(x, unit) => {
                let shape = self.functions.reciprocals[unit].shape();
                let rom = self.functions.roms[0][unit].clone();
                self.function(place, ("reciprocal", shape, &rom), x, false)
            }
            Operator::InverseRoot(x, unit) | Operator::Root(x, unit) => {
                let shape = self.functions.roots[unit].shape();
                let rom = self.functions.roms[1][unit].clone();
                let is_root = matches!(node.operator, Operator::Root(..));
                self.function(place, ("reciprocal_root", shape, &rom), x, is_root)
            }
            Operator::Exponent(from) => {
                let is_root = matches!(self.nodes[from.place()].operator, Operator::Root(..));
                let bits = bits_of(EXPONENT);
                let mut value = format!("{bits}'(n{}_exponent)", from.place());
                if is_root {
                    value = format!("-({value})");
                }
                self.exponent(place, EXPONENT, bits, &value)
            }
            Operator::Exponents(power) => self.exponents(place, power.constant, power.terms()),
            Operator::AtLeastOne(from) => {
                let [least, most] = self.ranges[from.place()];
                let range = [least.max(0), most.max(0)];
                let bits = bits_of(range);
                let (x, sign) = (self.cast(from, bits, 0), self.sign(from));
                let value = format!("{sign} ? {} : {x}", literal(0, bits));
                self.exponent(place, range, bits, &value)
            }
            Operator::Above([a, b], [p, q]) => {
                let [m, n] = [a, b].map(|wire| self.expression(wire).1);
                let bits = (m + p as i32).max(n + q as i32);
                let (x, y) = (self.cast(a, bits, p), self.cast(b, bits, q));
                self.bit(name, &format!("{x} > {y}"))
            }
            Operator::Either(pair) => {
                let [a, b] = pair.map(|wire| self.condition(wire));
                self.bit(name, &format!("{a} || {b}"))
            }
            Operator::Both(pair) => {
                let [a, b] = pair.map(|wire| self.condition(wire));
                self.bit(name, &format!("{a} && {b}"))
            }
            Operator::Not(of) => {
                let of = self.condition(of);
                self.bit(name, &format!("!{of}"))
            }
        }
    }

    fn bit(&mut self, name: String, value: &str) -> Written {
        self.line(format!("wire {name} = {value};"));
        Written::Condition(name)
    }

    fn input(&mut self, place: usize, name: &str) -> Written {
        let node = self.nodes[place];
        let is_exponent = node
            .power
            .terms()
            .iter()
            .any(|(wire, _)| wire.place() == place);
        let (bits, is_condition) = if self.conditions.contains(&place) {
            (1, true)
        } else if is_exponent {
            self.ranges[place] = EXPONENT;
            (bits_of(EXPONENT), false)
        } else {
            // A state reaches ±2^bits, as sums do.
            ((node.shape.bits() + 2).max(2), false)
        };
        self.inputs.push(Port {
            name: name.to_owned(),
            bits,
            is_condition,
        });
        if !self.needed[place] {
            self.unused.push(name.to_owned());
        }
        let name = name.to_owned();
        if is_condition {
            Written::Condition(name)
        } else {
            Written::Word {
                name,
                bits,
                below: 0,
            }
        }
    }

    fn sum(
        &mut self,
        name: String,
        bits: i32,
        [a, b]: [Wire; 2],
        [p, q]: [u32; 2],
        sign: char,
    ) -> Written {
        let (x, y) = (self.cast(a, bits, p), self.cast(b, bits, q));
        self.word(name, bits, &format!("{x} {sign} {y}"))
    }

    fn magnitude(&self, from: Wire, bits: i32) -> String {
        let (x, sign) = (self.cast(from, bits, 0), self.sign(from));
        format!("{sign} ? -({x}) : {x}")
    }

    /// A wire, or a limit where the comparison holds.
    fn limited(&mut self, name: String, from: Wire, comparison: char, limit: i64) -> Written {
        let bits = self
            .expression(from)
            .1
            .max(bits_of([limit.min(0), limit.max(0)]));
        let (x, limit) = (self.cast(from, bits, 0), literal(limit, bits));
        let value = format!("{x} {comparison} {limit} ? {limit} : {x}");
        self.word(name, bits, &value)
    }

    fn choice(&mut self, name: String, pair: [Wire; 2], comparison: char) -> Written {
        let [p, q] = pair.map(|wire| self.expression(wire).1);
        let bits = p.max(q);
        let [x, y] = pair.map(|wire| self.cast(wire, bits, 0));
        self.word(name, bits, &format!("{x} {comparison} {y} ? {x} : {y}"))
    }

    /// An unsigned or signed word of an instance, as a signed wire.
    fn word_of(&mut self, name: &str, bits: i32, is_signed: bool) -> Written {
        let top = bits - 1;
        if is_signed {
            self.line(format!("wire signed [{top}:0] {name};"));
            return Written::Word {
                name: name.to_owned(),
                bits,
                below: 0,
            };
        }
        self.line(format!("wire [{top}:0] {name}_word;"));
        self.word(name.to_owned(), bits + 1, &format!("{{1'b0, {name}_word}}"))
    }

    /// Name of a signal's wire.
    fn named(&self, place: usize, fit: &Fit) -> String {
        let name = self
            .signals
            .get(fit.signal)
            .map_or("word", |signal| &signal.name);
        format!("{}_n{place}", name.replace('.', "_"))
    }

    fn fit(&mut self, place: usize, from: Wire, more: Option<Wire>, fit: &Fit) -> Written {
        let Written::Word {
            name: exact,
            bits: exact_bits,
            below,
        } = self.of(from)
        else {
            unreachable!("a word")
        };
        let (word, format) = (fit.word, fit.word.format);
        let name = self.named(place, fit);
        self.line(format!("// {name}: {word}"));
        let written = self.word_of(&name, format.width(), format.signed);
        let target = if format.signed {
            name
        } else {
            format!("{name}_word")
        };
        let mut shape = format!(
            ".W({}), .S({}), .ROUND({})",
            format.width(),
            u8::from(format.signed),
            word.round.code(),
        );
        let module = if format.is_float() {
            shape += &significant(format);
            "fit_float"
        } else {
            let _ = write!(
                shape,
                ", .WRAP({})",
                u8::from(word.overflow == Overflow::Wrap)
            );
            "fit"
        };
        let places = fit.places() - i64::from(below);
        match more {
            None => self.line(format!(
                "{module} #(.IN_W({exact_bits}), .PLACES({places}), {shape}) fit_n{place} (.exact({exact}), .word({target}));"
            )),
            Some(more) => {
                let (more, more_bits) = self.expression(more);
                self.line(format!(
                    "fit_shifted #(.IN_W({exact_bits}), .PLACES({places}), .MORE_W({more_bits}), {shape}) fit_n{place} (.exact({exact}), .more({more}), .word({target}));"
                ));
            }
        }
        written
    }

    fn lookup(&mut self, place: usize, argument: Wire, nth: usize) -> Written {
        let table = &self.functions.tables[nth];
        let (fit, index_bits) = (*table.fit(), table.index_bits());
        let is_linear = table.interpolation() == Interpolation::Linear;
        let argument_bits = index_bits + table.below();
        let rom = self.functions.roms[2][nth].clone();
        let ((argument, _), name) = (self.expression(argument), self.named(place, &fit));
        self.line(format!("// {name}: {}", fit.word));
        let bits = fit.word.format.width();
        let written = self.word_of(&name, bits, false);
        let significant = significant(fit.word.format);
        self.line(format!(
            "lookup #(.ARGUMENT_W({argument_bits}), .TABLE_BITS({index_bits}), .LINEAR({}), .W({bits}), .ROUND({}){significant}, .ROM({{ROMS, \"{rom}.hex\"}})) table_n{place} (.argument({argument}[{}:0]), .word({name}_word));",
            u8::from(is_linear),
            fit.word.round.code(),
            argument_bits - 1,
        ));
        self.unused.push(argument);
        written
    }

    /// Bits of a positive wire, and those bits.
    fn positive(&mut self, wire: Wire) -> (String, i32) {
        let (name, bits) = self.expression(wire);
        // Its sign is 0.
        let bits = (self.nodes[wire.place()].shape.bits() + 1).min(bits).max(1);
        self.unused.push(name.clone());
        (format!("{name}[{}:0]", bits - 1), bits)
    }

    fn lead(&mut self, place: usize, from: Wire) -> Written {
        let (value, bits) = self.positive(from);
        let (lead, unused) = (format!("n{place}_lead"), format!("unused_n{place}"));
        self.line(format!("wire signed [7:0] {lead};"));
        self.line(format!("wire [{}:0] {unused};", bits - 1));
        self.line(format!(
            "normalise #(.W({bits})) normalise_n{place} (.value({value}), .normalised({unused}), .lead({lead}));"
        ));
        // A leading one at bit 61 of 64 bits is at the top of these.
        let more = i64::from(LEADING + 1 - bits);
        let range = [more, i64::from(LEADING)];
        let bits = bits_of([more.min(0), i64::from(LEADING)]);
        let value = format!("{bits}'({lead}) + {}", literal(more, bits));
        // Where nothing asks for the power.
        self.unused.push(format!("n{place}"));
        self.exponent(place, range, bits, &value)
    }

    fn normalised(&mut self, name: String, from: Wire, lead: Wire) -> Written {
        let (x, _) = self.expression(from);
        let Operator::Lead(of) = self.nodes[lead.place()].operator else {
            unreachable!("a normaliser's shift")
        };
        let (_, bits) = self.expression(of);
        let bits = (self.nodes[of.place()].shape.bits() + 1).min(bits).max(1);
        let value = format!("{}'({x}) <<< n{}_lead", bits + 1, lead.place());
        let Written::Word { name, bits, .. } = self.word(name, bits + 1, &value) else {
            unreachable!("a word")
        };
        Written::Word {
            name,
            bits,
            below: LEADING + 2 - bits,
        }
    }

    fn function(
        &mut self,
        place: usize,
        (module, shape, rom): (&str, crate::machine::FunctionUnit, &str),
        x: Wire,
        is_root: bool,
    ) -> Written {
        let frac_bits = self.nodes[x.place()].shape.frac_bits;
        let (value, bits) = self.positive(x);
        let name = format!("n{place}");
        let operand = if module == "reciprocal_root" {
            let operand = if is_root {
                format!("{name}_operand")
            } else {
                format!("unused_{name}")
            };
            self.line(format!("wire [{}:0] {operand};", shape.bits));
            format!(".operand({operand}), ")
        } else {
            String::new()
        };
        self.line(format!("wire [{}:0] {name}_mantissa;", shape.bits));
        self.line(format!("wire signed [7:0] {name}_exponent;"));
        self.line(format!(
            "{module} #(.IN_W({bits}), .IN_F({frac_bits}), .BITS({}), .TABLE_BITS({}), .NEWTON_STEPS({}), .ROM({{ROMS, \"{rom}.hex\"}})) {module}_n{place} (.x({value}), {operand}.mantissa({name}_mantissa), .exponent({name}_exponent));",
            shape.bits, shape.table_bits, shape.newton_steps,
        ));
        // Where nothing asks for the power.
        self.unused.push(format!("{name}_exponent"));
        let bits = shape.bits as i32 + 1;
        if is_root {
            let value =
                format!("$signed({{1'b0, {name}_operand}}) * $signed({{1'b0, {name}_mantissa}})");
            self.word(name, 2 * bits + 1, &value)
        } else {
            let value = format!("{{1'b0, {name}_mantissa}}");
            self.word(name, bits + 1, &value)
        }
    }

    fn exponents(&mut self, place: usize, constant: i32, terms: &[(Wire, i32)]) -> Written {
        let mut range = [i64::from(constant); 2];
        for (wire, factor) in terms {
            let ends = self.ranges[wire.place()].map(|end| end * i64::from(*factor));
            range[0] += ends[0].min(ends[1]);
            range[1] += ends[0].max(ends[1]);
        }
        let constant = i64::from(constant);
        let bits = bits_of([range[0].min(constant), range[1].max(constant)]);
        let mut value = if constant == 0 && !terms.is_empty() {
            String::new()
        } else {
            literal(constant, bits)
        };
        for (wire, factor) in terms {
            let places = factor.unsigned_abs().trailing_zeros();
            let sign = match (*factor < 0, value.is_empty()) {
                (true, true) => "-",
                (true, false) => " - ",
                (false, true) => "",
                (false, false) => " + ",
            };
            // A front end reads `-9'(…)` as a cast to −9 bits.
            let _ = write!(value, "{sign}({})", self.cast(*wire, bits, places));
        }
        self.exponent(place, range, bits, &value)
    }
}

/// Parameters of a floating-point word; none in fixed point.
fn significant(format: Format) -> String {
    match format.significant_bits {
        0 => String::new(),
        bits => format!(", .P({bits}), .FLUSH({})", u8::from(format.flushes)),
    }
}

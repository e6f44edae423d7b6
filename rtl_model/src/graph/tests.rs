//! Graph: laws of its passes, on random graphs.

use super::real::{Bounded, Given};
use super::*;
use crate::elaboration::Elaboration;
use crate::elaboration::latency::Path;
use crate::kernels::host::{Host, Unvectorised, Vectorised};
use crate::machine::{FunctionUnit, Operators};
use crate::num::tests::also_floating;
use crate::num::{Format, LANES, Overflow, Rounding, Word};
use crate::probe::{NoProbe, Ranges};
use crate::real::{Near, power_of_two};
use proptest::prelude::*;

/// A word of an operator's result, as random numbers.
type Choice = (u8, u16, u16, Word);

fn words() -> impl Strategy<Value = Word> {
    let format = (any::<bool>(), 1..=31i32, -4..=30i32).prop_map(|(signed, width, frac_bits)| {
        let frac_bits = frac_bits.max(0);
        Format::fixed_point(signed, width - frac_bits, frac_bits)
    });
    let round = prop::sample::select(vec![
        Rounding::Nearest,
        Rounding::Truncate,
        Rounding::NearestEven,
    ]);
    (format, any::<u32>(), round).prop_map(|(format, pick, round)| Word {
        format: also_floating(format, pick),
        round,
        overflow: Overflow::Saturate,
    })
}

/// A graph of random operators, as far as 62 bits hold what they make. Its results are its last two
/// words.
fn graph(inputs: &[Word], choices: &[Choice], operators: Operators) -> Graph<2> {
    let e = &mut Elaboration::new(operators);
    let g = &mut Builder::new(e, "unit");
    // Wires that are words, and may be multiplied, and all.
    let mut operands: Vec<Wire> = inputs.iter().map(|word| g.input(*word)).collect();
    let mut all = operands.clone();
    for (nth, (kind, a, b, word)) in choices.iter().enumerate() {
        let pick = |wires: &[Wire], which: u16| wires[usize::from(which) % wires.len()];
        let (a, b, a_word, b_word) = (
            pick(&all, *a),
            pick(&all, *b),
            pick(&operands, *a),
            pick(&operands, *b),
        );
        let [x, y] = [a, b].map(|wire| g.of(wire).shape);
        let bits = x.plus(y).bits();
        let unit = FunctionUnit {
            table_bits: 4,
            newton_steps: u32::from(kind % 3),
            bits: 12,
        };
        let name = format!("word{nth}");
        let finer = |from: Exact| word.format.frac_bits - from.frac_bits;
        let positive = |g: &mut Builder, wire: Wire| {
            let magnitude = g.magnitude(wire);
            let positive = g.at_least_an_ulp(magnitude);
            g.known_natural(positive)
        };
        match kind % 14 {
            6 if x.frac_bits <= 40 && x.int_bits <= 18 => {
                let one = g.one(x);
                let shape = g.of(one).shape.plus(x);
                all.push(g.minus_within(one, a, shape));
            }
            0 => all.push(g.times(a_word, b_word)),
            1 if bits <= 60 => all.push(g.plus_within(a, b, x.plus(y))),
            2 if bits <= 60 => all.push(g.minus_within(a, b, x.plus(y))),
            3 => all.push(g.natural(a)),
            4 if x.frac_bits <= 60 => all.push(g.at_most_one(a)),
            7 if bits <= 60 => {
                let (above, condition) = (g.above(a, b), g.above(b, a));
                let either = g.either(above, condition);
                let both = g.both(either, above);
                let not = g.not(both);
                let guarded = g.guarded(a_word, not, 0);
                operands.push(guarded);
                all.push(guarded);
                g.drop_where(condition);
            }
            8 if bits <= 60 && finer(x) <= 31 && finer(y) <= 31 => {
                let (p, q) = (g.fit(&name, *word, a), g.fit(&name, *word, b));
                let (lesser, greater) = (g.lesser(p, q), g.greater(p, q));
                operands.extend([lesser, greater]);
                all.push(g.negated(lesser));
                if word.format.width() < 31 {
                    all.extend([g.turned(greater, lesser), g.opposed(lesser, greater)]);
                    let more = g.an_ulp_more(greater);
                    all.push(g.not_below_0(more));
                }
            }
            // Vectors' parts, relative to the power of the largest.
            9 if x.bits() <= 60 => {
                let parts = [a, a, a];
                let largest = g.largest(parts);
                let [part, ..] = g.normalised(largest, parts, 0);
                let relative = g.fit(&name, *word, part);
                let squared = g.times(relative, relative);
                let squared = g.scaled(squared, 1);
                let power = g.power(squared);
                let power = g.at_least_one(power);
                let own = g.fit_to(&name, *word, squared, power);
                let product = g.times(own, relative);
                let fitted = g.fit_to(&name, *word, product, Power::ONE);
                operands.push(fitted);
                all.push(fitted);
            }
            10 if x.bits() <= 60 => {
                let x = positive(g, a);
                let inverse = g.reciprocal(&format!("{name}.reciprocal"), unit, x);
                let quotient = g.times(b_word, inverse);
                let fitted = g.fit_to(&name, *word, quotient, Power::ONE);
                operands.push(fitted);
                all.push(fitted);
            }
            11 if x.bits() <= 60 => {
                let x = positive(g, a);
                let (root, inverse) = (
                    g.root(&format!("{name}.root"), unit, x),
                    g.inverse_root(&format!("{name}.inverse_root"), unit, x),
                );
                let fitted = g.fit_to(&name, *word, root, Power::ONE);
                let quotient = g.times(fitted, inverse);
                let other = g.fit_to(&name, *word, quotient, Power::ONE);
                operands.extend([fitted, other]);
                all.extend([fitted, other]);
            }
            _ if (word.format.frac_bits - x.frac_bits) <= 31 => {
                let fitted = g.fit(&name, *word, a);
                operands.push(fitted);
                all.push(fitted);
            }
            _ => {}
        }
    }
    let last = [all[all.len() - 1], operands[operands.len() - 1]];
    g.build(last)
}

/// Runs a batch on a host.
fn run<H: Host, P: Probe>(
    host: H,
    graph: &Graph<2>,
    items: &[Vec<i64>],
    probe: &mut P,
) -> Vec<[i64; 2]> {
    let program = graph.program();
    let mut batch = program.batch();
    for (item, inputs) in items.iter().enumerate() {
        inputs
            .iter()
            .enumerate()
            .for_each(|(input, word)| batch.set_one(&program, input, item, *word));
    }
    let live: Vec<u8> = (0..items.len().div_ceil(LANES))
        .map(|row| ((1u32 << (items.len() - row * LANES).min(LANES)) - 1) as u8)
        .collect();
    host.run(Run {
        program: &program,
        batch: &mut batch,
        live: &live,
        probe,
    });
    (0..items.len())
        .map(|item| [0, 1].map(|output| batch.result(&program, output, item / LANES)[item % LANES]))
        .collect()
}

proptest! {
    #[test]
    fn a_batch_equals_one_item_at_a_time(
        inputs in prop::collection::vec(words(), 1..4),
        choices in prop::collection::vec((any::<u8>(), any::<u16>(), any::<u16>(), words()), 1..20),
        seeds in prop::collection::vec(any::<[u64; 4]>(), 1..=BATCH),
        operators in prop::sample::select(vec![Operators::Exact, Operators::Rounded]),
    ) {
        let graph = graph(&inputs, &choices, operators);
        let word = |(nth, word): (usize, &Word), seeds: &[u64; 4]| {
            let (least, most) = (word.format.min(), word.format.max());
            // The ends too, each in one of eight.
            match seeds[nth] % 8 {
                0 => least,
                1 => most,
                _ => least + (seeds[nth] / 8 % (most - least + 1) as u64) as i64,
            }
        };
        let items: Vec<Vec<i64>> = seeds.iter().map(|seeds| inputs.iter().enumerate().map(|nth| word(nth, seeds)).collect()).collect();
        let signals = 200;
        let mut seen = Ranges::new(signals);
        let expected: Vec<[i64; 2]> = items.iter().map(|inputs| graph.one(inputs, &mut Tap::new(&mut seen))).collect();
        prop_assert_eq!(&run(Unvectorised, &graph, &items, &mut NoProbe), &expected);
        let mut by_batch = Ranges::new(signals);
        prop_assert_eq!(&run(Unvectorised, &graph, &items, &mut by_batch), &expected);
        prop_assert_eq!(format!("{by_batch:?}"), format!("{seen:?}"));
        if let Some(host) = Vectorised::detect() {
            prop_assert_eq!(&run(host, &graph, &items, &mut NoProbe), &expected);
        }
    }
}

proptest! {
    #[test]
    fn a_batch_of_reals_has_the_results_of_its_items(
        inputs in prop::collection::vec(words(), 1..4),
        choices in prop::collection::vec((any::<u8>(), any::<u16>(), any::<u16>(), words()), 1..20),
        seeds in any::<[[i32; 4]; 3]>(),
        turned in any::<[Option<bool>; 3]>(),
        operators in prop::sample::select(vec![Operators::Exact, Operators::Rounded]),
    ) {
        let graph = graph(&inputs, &choices, operators);
        let asked = graph.asked_for_results();
        let of_item = |seeds: &[i32; 4], nth: usize| {
            let value = f64::from(seeds[nth]) * power_of_two(-inputs[nth].format.frac_bits);
            Bounded::of(Near::within(value, value * power_of_two(-20)))
        };
        let of_items = |nth| seeds.each_ref().map(|seeds| of_item(seeds, nth));
        let all: Vec<[Bounded<Near>; 3]> = (0..inputs.len()).map(of_items).collect();
        let together = graph.bounded(&asked, &Given { inputs: &all, turned }, |_, x| x);
        for (item, turned) in turned.into_iter().enumerate() {
            let inputs: Vec<[Bounded<Near>; 1]> = all.iter().map(|all| [all[item]]).collect();
            let given = Given { inputs: &inputs, turned: [turned] };
            let alone = graph.bounded(&asked, &given, |_, x| x).map(|[result]| result);
            // Also for NaN.
            let batched = together.map(|results| results[item]);
            prop_assert_eq!(format!("{batched:?}"), format!("{alone:?}"));
        }
    }
}

#[test]
fn the_longest_path_is_that_of_the_slowest_operand() {
    let word = |bits| Word::new(Format::signed(bits, 4));
    let e = &mut Elaboration::default();
    let g = &mut Builder::new(e, "unit");
    let [a, b, c] = [word(12), word(9), word(30)].map(|word| g.input(word));
    // A product and a fit beside a sum; then what reads both; and a result that is ready early.
    let product = g.times(a, b);
    let slow = g.fit("slow", word(16), product);
    let quick = g.plus(a, b);
    let sum = g.plus(slow, quick);
    let fitted = g.fit("fitted", word(20), sum);
    let early = g.fit("early", word(30), c);
    let condition = g.is_none(slow);
    let guarded = g.guarded(c, condition, 0);
    let graph = g.build([fitted, early, guarded]);
    let bits = |int: i32| word(int).format.width();
    let start = Path::default();
    let product = start.product(bits(12), bits(9)).fit(bits(16));
    let sum_bits = graph.body.nodes[sum.place()].bits();
    assert!(start.sum(bits(13)).delay < product.delay);
    assert_eq!(
        graph.paths(),
        [
            product.sum(sum_bits).fit(bits(20)),
            start.fit(bits(30)),
            // The host alone waits for the condition.
            start,
        ]
    );
    assert_eq!(graph.path(), product.sum(sum_bits).fit(bits(20)));
}

#[test]
fn a_word_is_made_from_the_words_that_its_operators_read() {
    let word = |bits| Word::new(Format::signed(bits, 4));
    let e = &mut Elaboration::default();
    let g = &mut Builder::new(e, "unit");
    let [a, b, c] = [12, 9, 8].map(|bits| g.input(word(bits)));
    let product = g.times(a, b);
    let first = g.fit("scaled", word(10), product);
    let square = g.times(first, first);
    // The same word again, from itself and from another input.
    let sum = g.plus(square, c);
    let second = g.fit("scaled", word(10), sum);
    let positive = g.at_least_an_ulp(second);
    let unit = FunctionUnit {
        table_bits: 4,
        newton_steps: 1,
        bits: 12,
    };
    let inverse = g.reciprocal("inverse", unit, positive);
    let dropped = g.is_none(a);
    let guarded = g.guarded(inverse, dropped, 0);
    let result = g.fit("result", word(6), guarded);
    let graph = g.build([result]);
    let names = ["a", "b", "c"].map(|name| Some(name.to_owned()));
    let flow = graph.flow(&e.signals, &names);
    let shown: Vec<(&str, usize, Vec<&str>)> = flow
        .iter()
        .map(|word| {
            let from = word.from.iter().map(String::as_str).collect();
            (&word.name[..], word.wires, from)
        })
        .collect();
    assert_eq!(
        shown,
        [
            ("a", 1, vec![]),
            ("b", 1, vec![]),
            ("c", 1, vec![]),
            ("unit.scaled", 2, vec!["a", "b", "c"]),
            ("unit.inverse", 1, vec!["unit.scaled"]),
            ("unit.result", 1, vec!["unit.inverse"]),
        ]
    );
    let formats: Vec<&str> = flow.iter().map(|word| &word.format[..]).collect();
    assert_eq!(formats[..4], ["I12F4", "I9F4", "I8F4", "I10F4"]);
}

#[test]
fn a_rounding_belongs_to_the_first_word_that_is_made_from_it() {
    let word = Word::new("I8F12S6".parse().unwrap());
    let e = &mut Elaboration::new(Operators::Rounded);
    let g = &mut Builder::new(e, "unit");
    let [a, b, c] = [(); 3].map(|()| g.input(word));
    let (ab, bc, ac) = (g.times(a, b), g.times(b, c), g.times(a, c));
    let both = g.plus(ab, bc);
    let first = g.fit("first", word, both);
    // `both` is rounded for this sum alone; a word of `ab` is already made.
    let more = g.plus(both, ab);
    let second = g.fit("second", word, more);
    // No word is made from this one.
    let condition = g.above(ac, first);
    g.drop_where(condition);
    let third = g.fit("third", word, c);
    let graph = g.build([first, second, third]);
    let named: Vec<(Wire, &str)> = graph
        .body
        .nodes
        .iter()
        .filter_map(|node| match node.operator {
            Operator::Rounded(from, fit) => Some((from, &e.signals[fit.signal].name[..])),
            _ => None,
        })
        .collect();
    assert_eq!(
        named,
        [
            (ab, "first"),
            (bc, "first"),
            (both, "second"),
            (ac, "third")
        ]
    );
}

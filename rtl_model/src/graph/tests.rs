//! Graph: laws of its passes, on random graphs.

use super::*;
use crate::kernels::host::{Host, Plainly, Vectorised};
use crate::num::{Format, LANES, Overflow, Rounding};
use crate::probe::{NoProbe, Ranges};
use proptest::prelude::*;

/// A word of an operator's result, as random numbers.
type Choice = (u8, u16, u16, Word);

fn words() -> impl Strategy<Value = Word> {
    let format = (any::<bool>(), 1..=31i32, -4..=30i32).prop_map(|(signed, width, frac_bits)| {
        let frac_bits = frac_bits.max(0);
        Format { signed, int_bits: width - frac_bits, frac_bits }
    });
    let round = prop::sample::select(vec![Rounding::Nearest, Rounding::Truncate, Rounding::NearestEven]);
    (format, round).prop_map(|(format, round)| Word { format, round, overflow: Overflow::Saturate })
}

/// A graph of random operators, as far as 62 bits hold what they make. Its results are its last two words.
fn graph(inputs: &[Word], choices: &[Choice]) -> Graph<2> {
    let e = &mut Elaboration::default();
    let g = &mut Builder::new(e, "unit");
    // Wires that are words, and may be multiplied, and all.
    let mut operands: Vec<Wire> = inputs.iter().map(|word| g.input(*word)).collect();
    let mut all = operands.clone();
    for (nth, (kind, a, b, word)) in choices.iter().enumerate() {
        let pick = |wires: &[Wire], which: u16| wires[usize::from(which) % wires.len()];
        let (a, b, a_word, b_word) = (pick(&all, *a), pick(&all, *b), pick(&operands, *a), pick(&operands, *b));
        let [x, y] = [a, b].map(|wire| g.of(wire).shape);
        let bits = x.plus(y).bits();
        match kind % 7 {
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
            _ if (word.format.frac_bits - x.frac_bits) <= 31 => {
                let fitted = g.fit(&format!("word{nth}"), *word, a);
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
fn run<H: Host, P: Probe>(host: H, graph: &Graph<2>, items: &[Vec<i64>], probe: &mut P) -> Vec<[i64; 2]> {
    let program = graph.program();
    let mut batch = program.batch();
    for (item, inputs) in items.iter().enumerate() {
        inputs.iter().enumerate().for_each(|(input, word)| batch.set_one(&program, input, item, *word));
    }
    let live: Vec<u8> = (0..items.len().div_ceil(LANES)).map(|row| ((1u32 << (items.len() - row * LANES).min(LANES)) - 1) as u8).collect();
    host.run(Run { program: &program, batch: &mut batch, live: &live, probe });
    (0..items.len()).map(|item| [0, 1].map(|output| batch.result(&program, output, item / LANES)[item % LANES])).collect()
}

proptest! {
    #[test]
    fn a_batch_equals_one_item_at_a_time(
        inputs in prop::collection::vec(words(), 1..4),
        choices in prop::collection::vec((any::<u8>(), any::<u16>(), any::<u16>(), words()), 1..20),
        seeds in prop::collection::vec(any::<[u64; 4]>(), 1..=BATCH),
    ) {
        let graph = graph(&inputs, &choices);
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
        let signals = 20;
        let mut seen = Ranges::new(signals);
        let expected: Vec<[i64; 2]> = items.iter().map(|inputs| graph.one(inputs, &mut Tap::new(&mut seen))).collect();
        prop_assert_eq!(&run(Plainly, &graph, &items, &mut NoProbe), &expected);
        let mut by_batch = Ranges::new(signals);
        prop_assert_eq!(&run(Plainly, &graph, &items, &mut by_batch), &expected);
        prop_assert_eq!(format!("{by_batch:?}"), format!("{seen:?}"));
        if let Some(host) = Vectorised::there() {
            prop_assert_eq!(&run(host, &graph, &items, &mut NoProbe), &expected);
        }
    }
}

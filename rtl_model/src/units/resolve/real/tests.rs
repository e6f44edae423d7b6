//! Resolve's bound checked against front to back in f64, and against the integer unit.

use super::super::Layer;
use crate::num::Word;
use crate::probe::{NoProbe, Tap};
use crate::real::Near;
use crate::real::tests::{Rng, Use, held, used};
use crate::{Elaborated, Machine};

/// A colour times its opacity, and its opacity: exact, and in machine words a few ulps off.
fn premultiplied(rng: &mut Rng, word: Word, off: u64) -> ([f64; 4], [i64; 4], [Near; 4]) {
    let opacity = rng.channel();
    let exact = [0; 3].map(|_| rng.channel() * opacity);
    let exact = [exact[0], exact[1], exact[2], opacity];
    let words = exact.map(|part| {
        let off = rng.below(2 * off + 1) as i64 - off as i64;
        (held(word, part).0 + off).clamp(0, word.format.one())
    });
    (
        exact,
        words,
        std::array::from_fn(|i| Near::held(exact[i], word, words[i])),
    )
}

/// Front over back, layer after layer.
fn exact(layers: &[[f64; 4]], background: [f64; 4]) -> [f64; 4] {
    let mut front = [0.0; 4];
    for behind in layers.iter().chain([&background]) {
        let through = 1.0 - front[3];
        front = std::array::from_fn(|i| front[i] + through * behind[i]);
    }
    front
}

/// The machine's frame word, the exact value, and the bound.
fn blend(rng: &mut Rng, machine: &Elaborated, layers: u64, off: u64) -> [(f64, f64, Near); 4] {
    let Elaborated {
        machine,
        resolve: unit,
        ..
    } = machine;
    let layers: Vec<_> = (0..layers)
        .map(|_| premultiplied(rng, machine.shade.premultiplied, off))
        .collect();
    let background = premultiplied(rng, machine.resolve.frame, 0);
    let words = layers.iter().map(|(_, w, _)| Layer {
        colour: [w[0], w[1], w[2]],
        opacity: w[3],
        ..Layer::default()
    });
    let own = unit.one(
        &words.collect::<Vec<_>>(),
        background.1,
        &mut Tap::new(&mut NoProbe),
    );
    let exact = exact(
        &layers.iter().map(|layer| layer.0).collect::<Vec<_>>(),
        background.0,
    );
    let bound = unit.real(
        &layers.iter().map(|layer| layer.2).collect::<Vec<_>>(),
        background.2,
    );
    std::array::from_fn(|i| {
        (
            machine.resolve.frame.format.value(own[i]),
            exact[i],
            bound[i],
        )
    })
}

#[test]
fn blending_is_within_its_bound() {
    for seed in 0..800 {
        let rng = &mut Rng::new(seed);
        let machine = rng.machine().elaborate().unwrap();
        for _ in 0..20 {
            let (layers, off) = (rng.below(9), rng.one_of(&[0, 0, 1, 30]));
            for (own, exact, bound) in blend(rng, &machine, layers, off) {
                used(own, exact, bound, &(seed, layers));
            }
        }
    }
}

/// Frame words behind one layer and four.
#[test]
fn the_bound_of_blending_is_tight() {
    for name in Machine::NAMES {
        let machine = Machine::named(name).unwrap().elaborate().unwrap();
        // A bound below an ulp was limited by 0 or 1. It is reached too easily.
        let place = machine.machine.resolve.frame.format.value(1) * (1.0 - 1e-9);
        for layers in [1, 4] {
            let mut of_frame = Use::default();
            for seed in 0..2000 {
                for (own, exact, bound) in blend(&mut Rng::new(seed), &machine, layers, 0) {
                    let used = used(own, exact, bound, &seed);
                    if bound.error >= place {
                        of_frame.add(used);
                    }
                }
            }
            assert!(
                of_frame.is_tight(0.6, 0.15),
                "{name}, {layers} layers: {of_frame:?}"
            );
        }
    }
}

//! Contribution: blocks checked against r in exact arithmetic, and against bounds of its words.

use super::*;
use crate::num::{Format, Rounding};
use crate::probe::{NoProbe, Tap};
use crate::real::Near;
use proptest::prelude::*;

const SIZE_PX: [u32; 2] = [208, 150];

/// Words of the test: very wide, as published, and absurd ones.
const WORDS: [[&str; 6]; 6] = [
    ["I15F12", "U24F6", "I24F6", "U3F20", "I4F20", "U22F8"],
    [
        "I15F12S11",
        "U20F11S4",
        "I20F12S3",
        "U2F24S4",
        "I3F23S3",
        "U6F14S4",
    ],
    [
        "I8F24S11",
        "U16F12S4",
        "FP8(E4M3)",
        "U2F20S2",
        "FP8(E4M3)",
        "U6F6S2",
    ],
    ["I1F0", "U1F0", "I1F0", "U1F0", "I1F0", "U1F0"],
    ["I3F0", "U2F1", "I2F1", "U1F1", "I1F1", "U4F0"],
    ["I8F0", "U9F0", "I9F0", "U0F3", "I1F2", "U6F0"],
];

fn machine(words: [&str; 6], block_px: u32, leaders: Leaders, round: Rounding) -> Machine {
    let mut words = words.into_iter().map(|format| {
        let format: Format = format.parse().unwrap();
        Word::new(format).rounded(round)
    });
    let mut next = || words.next().unwrap();
    Machine {
        contribution: Some(machine::Contribution {
            block_px,
            leaders,
            offset: next(),
            square: next(),
            product: next(),
            conic: next(),
            conic_cross: next(),
            radial: next(),
        }),
        ..Machine::named("gaussian").unwrap()
    }
}

/// A real number as the nearest word.
fn word(word: Word, value: f64) -> i64 {
    let format = word.format;
    ((value * f64::from(format.frac_bits).exp2()).round() as i64).clamp(format.min(), format.max())
}

proptest! {
    /// The oracle has r at each leader as a fraction of integers, from the words of the record. A
    /// block is kept if some leader is inside, wherever the bounds of the words leave no doubt. With
    /// wide words they leave little.
    #[test]
    fn a_block_is_kept_if_a_leader_is_inside(
        nth in 0..WORDS.len(),
        is_large in any::<bool>(),
        is_diagonal in any::<bool>(),
        round in prop::sample::select(vec![Rounding::Truncate, Rounding::Nearest, Rounding::NearestEven]),
        centre in [-20.0..230.0, -20.0..170.0],
        deviation in prop::array::uniform2(prop_oneof![0.55..3.0, 3.0..60.0]),
        turn in 0.0..3.2,
        cutoff in 0.2..12.0,
        block in [0u32..20, 0u32..20],
    ) {
        let leaders = if is_diagonal { Leaders::Diagonal } else { Leaders::Corners };
        let block_px = if is_large { 8 } else { 4 };
        let machine = machine(WORDS[nth], block_px, leaders, round);
        let e = &mut Elaboration::default();
        let unit = Contribution::new(e, &machine);
        prop_assert!(e.errors.is_empty(), "{:?}", e.errors);
        let unit = unit.unwrap();

        let (sin, cos) = f64::sin_cos(turn);
        let [p, q] = deviation.map(|deviation| 1.0 / (deviation * deviation));
        let m = &machine.ellipse;
        let conic = [
            word(m.conic, p * cos * cos + q * sin * sin),
            word(m.conic_cross, (p - q) * sin * cos),
            word(m.conic, p * sin * sin + q * cos * cos),
        ];
        let pixel = [0, 1].map(|axis| word(machine.project.pixel, centre[axis] - f64::from(SIZE_PX[axis]) / 2.0));
        let cutoff = word(machine.raster.cutoff, cutoff);
        let first = block.map(|at| at * block_px);
        let [left, top] = first.map(i64::from);
        let far = i64::from(block_px) - 1;
        let middle = SIZE_PX.map(|pixels| i64::from(pixels) - 1);
        let inputs: [i64; INPUTS] = [
            pixel[0], pixel[1], conic[0], conic[1], conic[2], cutoff,
            left, left + far, top, top + far, middle[0], middle[1],
        ];
        let [kept] = unit.graph().one(&inputs, &mut Tap::new(&mut NoProbe));

        // Exact: offsets with the fraction bits of pixels, one of which a middle has.
        let bits = machine.project.pixel.format.frac_bits.max(1);
        let conic_bits = m.conic.format.frac_bits.max(m.conic_cross.format.frac_bits);
        let at = |axis: usize, place: i64| -> i128 {
            let up = bits - machine.project.pixel.format.frac_bits;
            (i128::from(2 * place - middle[axis]) << (bits - 1)) - (i128::from(pixel[axis]) << up)
        };
        let placed = |word: Word, value: i64| i128::from(value) << (conic_bits - word.format.frac_bits);
        let [xx, xy, yy] = [placed(m.conic, conic[0]), placed(m.conic_cross, conic[1]), placed(m.conic, conic[2])];
        let radial = |x: i64, y: i64| {
            let (x, y) = (at(0, x), at(1, y));
            (xx * x * x + 2 * xy * x * y + yy * y * y) as f64 * f64::from(-(conic_bits + 2 * bits)).exp2()
        };
        let places = match leaders {
            Leaders::Corners => vec![[0, 0], [far, 0], [0, far], [far, far]],
            Leaders::Diagonal => vec![[0, 0], [far, far]],
        };
        let exact: Vec<f64> = places.iter().map(|[x, y]| radial(left + x, top + y)).collect();
        let value = |word: Word, bits: i64| Near::exact(word.format.value(bits));
        let bounds = unit.real(
            pixel.map(|at| value(machine.project.pixel, at)),
            [value(m.conic, conic[0]), value(m.conic_cross, conic[1]), value(m.conic, conic[2])],
            first,
            middle.map(|middle| middle as f64 / 2.0),
        );
        let limit = machine.raster.cutoff.format.value(cutoff);
        // The arithmetic of the graph is exact but for its words.
        let order = [0, 1, 2, 3].map(|nth| if is_diagonal { nth % 2 } else { nth });
        for (bound, nth) in bounds.iter().zip(order) {
            let far = bound.value.abs().max(exact[nth].abs()).max(1.0);
            prop_assert!((bound.value - exact[nth]).abs() < 1e-6 * far, "{exact:?} {bounds:?}");
        }
        let mut near = exact.iter().zip(bounds).map(|(exact, near)| near.around(*exact));
        if near.clone().any(|radial| radial.high() < limit) {
            prop_assert!(kept != 0, "a leader is inside: {exact:?} {bounds:?} {limit}");
        }
        if near.all(|radial| radial.low() >= limit) {
            prop_assert!(kept == 0, "no leader is inside: {exact:?} {bounds:?} {limit}");
        }
        if nth == 0 {
            let farthest = exact.iter().fold(0.0, |most: f64, radial| most.max(radial.abs()));
            let doubt = bounds.iter().fold(0.0, |most: f64, radial| most.max(radial.error));
            prop_assert!(doubt < 0.3 + 0.01 * farthest || farthest > 1e6, "{doubt} of {farthest}");
        }
    }
}

#[test]
fn descriptions_that_cannot_be_are_refused() {
    let base = machine(WORDS[0], 4, Leaders::Corners, Rounding::Nearest);
    let words = base.contribution.unwrap();
    let with = |contribution| Machine {
        contribution: Some(contribution),
        ..base.clone()
    };
    let six = with(machine::Contribution {
        block_px: 6,
        ..words
    });
    let unsigned = with(machine::Contribution {
        offset: words.square,
        ..words
    });
    let wide = with(machine::Contribution {
        conic: Word::new(Format::unsigned(1, 30)),
        ..words
    });
    let discs = Machine {
        contribution: base.contribution,
        ..Machine::named("reference").unwrap()
    };
    let immediate = Machine {
        contribution: base.contribution,
        ..Machine::named("volume").unwrap()
    };
    let many = {
        let mut many = base.clone();
        many.timing.contribution = Some(machine::timing::Contribution {
            blocks: 17,
            latency: None,
        });
        many
    };
    let soon = {
        let mut soon = base.clone();
        soon.timing.clock_hz = 1_000_000_000;
        soon.timing.contribution = Some(machine::timing::Contribution {
            blocks: 1,
            latency: Some(1),
        });
        soon
    };
    let masks = {
        let mut masks = base.clone();
        masks.bin = Some(machine::Bin {
            test: machine::BinTest::Ellipse,
            subtile_px: Some(4),
            ..machine::Bin::default()
        });
        masks
    };
    let unused = {
        let mut unused = Machine::named("gaussian").unwrap();
        unused.timing.contribution = Some(machine::timing::Contribution::default());
        unused
    };
    for (machine, word) in [
        (six, "block_px is 6"),
        (unsigned, "contribution.offset"),
        (wide, "contribution"),
        (discs, "draws no Gaussians"),
        (many, "blocks is 17"),
        (soon, "timing.contribution.latency"),
        (masks, "bin.subtile_px makes others"),
        (unused, "the machine has no `contribution`"),
    ] {
        let errors = machine.elaborate().err().unwrap();
        assert!(
            errors.iter().any(|error| error.contains(word)),
            "{word}: {errors:?}"
        );
    }
    let mut immediate = immediate;
    immediate.timing.organisation = crate::machine::timing::Organisation::Immediate;
    let errors = immediate.elaborate().err().unwrap();
    assert!(
        errors.iter().any(|error| error.contains("immediate")),
        "{errors:?}"
    );
    assert!(base.elaborate().is_ok(), "{:?}", base.elaborate().err());
}

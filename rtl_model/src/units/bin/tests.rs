//! Bin: tests of tiles checked against the rasteriser, pixel by pixel, and against f64.

use super::*;
use crate::machine::{Bin, Rows};
use crate::num::Overflow;
use crate::num::lanes::{LANES, Plain};
use crate::probe::{NoProbe, Tap};
use crate::units::raster::{Input, Raster, Span};
use proptest::prelude::*;

const SIZE_PX: [u32; 2] = [208, 150];

/// A real number as the nearest word.
fn word(word: Word, value: f64) -> i32 {
    let format = word.format;
    (value * f64::from(format.frac_bits).exp2())
        .round()
        .clamp(format.min() as f64, format.max() as f64) as i32
}

fn value(word: Word, bits: i64) -> f64 {
    bits as f64 * f64::from(-word.format.frac_bits).exp2()
}

/// Centre in pixels of the picture, standard deviations, direction; half-sizes of the box relative
/// to those of the ellipse.
#[derive(Clone, Copy, Debug)]
struct TestSplat {
    centre: [f64; 2],
    deviation: [f64; 2],
    turn: f64,
    cutoff: f64,
    loose: [f64; 2],
    /// Replaces the conic by any words.
    conic: Option<[i32; 3]>,
}

fn test_splats() -> impl Strategy<Value = TestSplat> {
    let deviations = prop_oneof![
        prop::array::uniform2(0.3..40.0),
        (0.3..3.0, 5.0..60.0).prop_map(|(one, other)| [one, other]),
    ];
    let loose = prop_oneof![Just([1.0, 1.0]), prop::array::uniform2(0.2..3.0)];
    let any = prop::option::weighted(0.15, prop::array::uniform3(any::<i32>()));
    (
        [-20.0..230.0, -20.0..170.0],
        deviations,
        0.0..3.2,
        0.2..9.0,
        loose,
        any,
    )
        .prop_map(
            |(centre, deviation, turn, cutoff, loose, conic)| TestSplat {
                centre,
                deviation,
                turn,
                cutoff,
                loose,
                conic,
            },
        )
}

impl TestSplat {
    /// Words of the splat; none if its box misses the picture.
    fn input(&self, machine: &Machine) -> Option<Input> {
        let e = &machine.ellipse;
        let [a, b] = self.deviation.map(|deviation| deviation.powi(-2));
        let (sin, cos) = self.turn.sin_cos();
        let [p, q] = self.deviation.map(|deviation| deviation * deviation);
        let variance = [p * cos * cos + q * sin * sin, p * sin * sin + q * cos * cos];
        let pixels: [Option<[u16; 2]>; 2] = std::array::from_fn(|axis| {
            let half = (self.cutoff * variance[axis]).sqrt() * self.loose[axis];
            let last = f64::from(SIZE_PX[axis]) - 1.0;
            let [from, to] = [
                (self.centre[axis] - half - 0.5).ceil().max(0.0),
                (self.centre[axis] + half - 0.5).floor().min(last),
            ];
            (from <= to).then_some([from as u16, to as u16])
        });
        let [columns, rows] = [pixels[0]?, pixels[1]?];
        let within = |word: Word, bits: i32| {
            let format = word.format;
            let values = format.max() - format.min() + 1;
            (i64::from(bits).rem_euclid(values) + format.min()) as i32
        };
        let conic = match self.conic {
            Some([xx, xy, yy]) => [
                within(e.conic, xx),
                within(e.conic_cross, xy),
                within(e.conic, yy),
            ],
            None => [
                word(e.conic, a * cos * cos + b * sin * sin),
                word(e.conic_cross, (a - b) * sin * cos),
                word(e.conic, a * sin * sin + b * cos * cos),
            ],
        };
        Some(Input {
            pixel: std::array::from_fn(|axis| {
                let from_middle = self.centre[axis] - f64::from(SIZE_PX[axis]) / 2.0;
                word(machine.project.pixel, from_middle)
            }),
            conic,
            columns,
            rows,
            ..Input::default()
        })
    }
}

/// A tile's part of a box: columns and rows of the picture.
type Part = [[u16; 2]; 2];

fn parts(input: &Input, side: u16) -> Vec<Part> {
    let [columns, rows] = [input.columns, input.rows];
    let of = |[first, last]: [u16; 2]| {
        (first / side..=last / side)
            .map(move |tile| [first.max(tile * side), last.min(tile * side + side - 1)])
    };
    of(rows)
        .flat_map(|rows| of(columns).map(move |columns| [columns, rows]))
        .collect()
}

/// A machine's tests, and its rasteriser.
struct Tester {
    raster: Raster,
    words: BinWords,
    splat: Graph<SPLAT_OUTPUTS>,
    tile: Graph<1>,
}

impl Tester {
    /// None if the machine is refused.
    fn new(machine: &Machine, test: BinTest) -> Option<Self> {
        let machine = Machine {
            bin: Some(Bin {
                test,
                ..Bin::default()
            }),
            ..machine.clone()
        };
        let e = &mut Elaboration::default();
        let raster = Raster::new(e, &machine);
        let words = BinWords::of(&machine).unwrap();
        if !e.errors.is_empty() {
            return None;
        }
        words.declare(None, [1, 1], e);
        e.errors.is_empty().then(|| Tester {
            raster,
            words,
            splat: words.splat(),
            tile: words.tile(),
        })
    }

    fn set_up(&self, input: &Input, cutoff: i64) -> [i64; SPLAT_OUTPUTS] {
        let mut inputs = [input.pixel.as_slice(), &input.conic]
            .concat()
            .into_iter()
            .map(i64::from)
            .collect::<Vec<_>>();
        inputs.extend(
            [input.columns, input.rows]
                .as_flattened()
                .iter()
                .map(|at| i64::from(*at)),
        );
        inputs.extend(registers(cutoff, SIZE_PX));
        self.splat.one(&inputs, &mut Tap::new(&mut NoProbe))
    }

    /// Whether the splat is listed in tiles, with each part of its box.
    fn listed(&self, input: &Input, cutoff: i64, parts: &[Part]) -> Vec<bool> {
        let splat = self.set_up(input, cutoff);
        let is_listed = |[columns, rows]: &Part| {
            let mut inputs: Vec<i64> = input.conic.iter().map(|word| i64::from(*word)).collect();
            inputs.extend(splat);
            for ([from, to], [first, _]) in [(columns, input.columns), (rows, input.rows)] {
                inputs.extend([from - first, to - first].map(i64::from));
            }
            self.tile.one(&inputs, &mut Tap::new(&mut NoProbe))[0] != 0
        };
        parts.iter().map(is_listed).collect()
    }

    /// Pixels of the picture that the rasteriser keeps: column and row.
    fn kept(&self, input: &Input, cutoff: i64) -> Vec<[u16; 2]> {
        let mut kept = Vec::new();
        let [columns, rows] = [input.columns, input.rows];
        for top in (rows[0] / 16 * 16..=rows[1]).step_by(16) {
            for left in (columns[0] / 16 * 16..=columns[1]).step_by(16) {
                let mut probe = NoProbe;
                let tap = &mut Tap::new(&mut probe);
                let inputs = [input; LANES];
                let walks = self
                    .raster
                    .enter::<Plain, _>(SIZE_PX, [left, top], &inputs, tap);
                let mut span = Span::default();
                let cutoff = self.raster.cutoff(cutoff);
                self.raster
                    .span::<Plain, _>(SIZE_PX, &walks, 0, input, cutoff, &mut span, tap);
                kept.extend(span.all().iter().map(|place| {
                    let pixel = u16::from(walks.pixels(0, [*place; LANES])[0]);
                    [left + pixel % 16, top + pixel / 16]
                }));
            }
        }
        kept
    }
}

/// Words of one to a few bits, or those of a named machine with other fractions.
#[derive(Clone, Debug)]
struct TestWords {
    name: &'static str,
    is_seeded: bool,
    /// Integer and fraction bits, added to those of the machine, or instead of them.
    words: Vec<(bool, i32, i32, u8)>,
}

fn test_words() -> impl Strategy<Value = TestWords> {
    let one = (prop::bool::weighted(0.3), -6..6i32, -8..4i32, 0..6u8);
    (
        prop::sample::select(Machine::NAMES.to_vec()),
        any::<bool>(),
        prop_oneof![
            Just(Vec::new()),
            prop::collection::vec(one.clone(), 8),
            // One narrower word, the others as they are.
            (0..8usize, 0..16i32, 0..16i32).prop_map(|(nth, int_bits, frac_bits)| {
                let mut words = vec![(false, 0, 0, 2); 8];
                words[nth] = (false, -int_bits, -frac_bits, 2);
                words
            }),
        ],
    )
        .prop_map(|(name, is_seeded, words)| TestWords {
            name,
            is_seeded,
            words,
        })
}

impl TestWords {
    fn machine(&self) -> Machine {
        let mut machine = Machine::named(self.name).unwrap();
        let Machine {
            project,
            ellipse,
            raster,
            ..
        } = &mut machine;
        raster.rows = if self.is_seeded {
            Rows::Seeded
        } else {
            Rows::Differenced
        };
        let all = [
            &mut project.pixel,
            &mut raster.cutoff,
            &mut raster.offset,
            &mut raster.gradient,
            &mut raster.radial,
            &mut raster.first,
            &mut raster.second,
            &mut ellipse.conic,
        ];
        for (word, (is_tiny, int_bits, frac_bits, rounding)) in all.into_iter().zip(&self.words) {
            let format = word.format;
            let [int_bits, frac_bits] = if *is_tiny {
                // One to three bits, and as many or more for registers.
                [1 + int_bits.rem_euclid(3), frac_bits.rem_euclid(3)]
            } else {
                [format.int_bits + int_bits, format.frac_bits + frac_bits]
            };
            let frac_bits = frac_bits.clamp(0, 40);
            word.format = Format {
                int_bits: int_bits.clamp(1 - frac_bits, 47 - frac_bits),
                frac_bits,
                ..format
            };
            word.round = [Rounding::Truncate, Rounding::NearestEven]
                .get(usize::from(*rounding))
                .copied()
                .unwrap_or_default();
        }
        // `project` refuses others.
        let pixel = &mut machine.project.pixel.format;
        pixel.frac_bits = pixel.frac_bits.max(1);
        machine.ellipse.conic_cross.format.frac_bits = machine.ellipse.conic.format.frac_bits;
        for word in [&mut machine.raster.first, &mut machine.raster.second] {
            word.overflow = Overflow::Saturate;
        }
        machine
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    /// On random words, absurd ones included, random splats and boxes.
    #[test]
    fn no_test_of_tiles_or_subtiles_loses_a_pixel(
        words in test_words(),
        splat in test_splats(),
        side in prop_oneof![Just(4u16), Just(8), Just(16), (1..33u16).prop_map(|side| 4 * side)],
    ) {
        let machine = words.machine();
        let cutoff = i64::from(word(machine.raster.cutoff, splat.cutoff));
        for test in [BinTest::OrientedBox, BinTest::Ellipse] {
            let (Some(tester), Some(input)) = (Tester::new(&machine, test), splat.input(&machine)) else {
                continue;
            };
            let parts = parts(&input, side);
            let kept = tester.kept(&input, cutoff);
            for (part, listed) in parts.iter().zip(tester.listed(&input, cutoff, &parts)) {
                let is_in = |pixel: &&[u16; 2]| (0..2).all(|axis| (part[axis][0]..=part[axis][1]).contains(&pixel[axis]));
                let lost = kept.iter().find(is_in).filter(|_| !listed);
                prop_assert_eq!(lost, None, "{:?} rejects {:?}; {:?}, {:?}", test, part, input, machine.raster);
            }
        }
    }

    /// Every tile that the box turned with the ellipse rejects, the ellipse rejects too.
    #[test]
    fn an_ellipse_never_has_more_entries_than_its_boxes(words in test_words(), splat in test_splats()) {
        let machine = words.machine();
        let testers = [BinTest::OrientedBox, BinTest::Ellipse].map(|test| Tester::new(&machine, test));
        if let ([Some(oriented), Some(ellipse)], Some(input)) = (&testers, splat.input(&machine)) {
            let cutoff = i64::from(word(machine.raster.cutoff, splat.cutoff));
            let parts = parts(&input, 16);
            let [one, other] = [oriented, ellipse].map(|test| test.listed(&input, cutoff, &parts));
            prop_assert!(one.iter().zip(&other).all(|(one, other)| *one || !other));
        }
    }
}

/// The least r in a part of a box, in f64: in the centre, or on a side.
fn least(machine: &Machine, input: &Input, [columns, rows]: &Part) -> f64 {
    let e = &machine.ellipse;
    let [xx, xy, yy] = [(e.conic, 0), (e.conic_cross, 1), (e.conic, 2)]
        .map(|(word, place)| value(word, input.conic[place].into()));
    let offset = |axis: usize, at: u16| {
        f64::from(at) + 0.5
            - f64::from(SIZE_PX[axis]) / 2.0
            - value(machine.project.pixel, input.pixel[axis].into())
    };
    let [x, y] = [columns, rows];
    let [x, y] = [(0, x), (1, y)].map(|(axis, ends)| ends.map(|at| offset(axis, at)));
    let r = |x: f64, y: f64| xx * x * x + 2.0 * xy * x * y + yy * y * y;
    if x[0] <= 0.0 && x[1] >= 0.0 && y[0] <= 0.0 && y[1] >= 0.0 {
        return 0.0;
    }
    let along_y = x.map(|x| r(x, (-xy / yy * x).clamp(y[0], y[1])));
    let along_x = y.map(|y| r((-xy / xx * y).clamp(x[0], x[1]), y));
    along_x.into_iter().chain(along_y).fold(f64::MAX, f64::min)
}

/// On `reference`, the ellipse rejects every tile that is outside by a hundredth, and the turned
/// box rejects many.
#[test]
fn tiles_outside_are_rejected() {
    let machine = Machine::named("reference").unwrap();
    let [oriented, ellipse] =
        [BinTest::OrientedBox, BinTest::Ellipse].map(|test| Tester::new(&machine, test).unwrap());
    let (mut outside, mut turned, mut all) = (0, 0, 0);
    for nth in 0..600 {
        let at = |step: f64| (f64::from(nth) * step).fract();
        let splat = TestSplat {
            centre: [208.0 * at(0.618), 150.0 * at(0.414)],
            deviation: [0.8 + 2.0 * at(0.732), 8.0 + 40.0 * at(0.236)],
            turn: 3.1 * at(0.303),
            cutoff: 9.0,
            loose: [1.0; 2],
            conic: None,
        };
        let Some(input) = splat.input(&machine) else {
            continue;
        };
        let cutoff = i64::from(word(machine.raster.cutoff, splat.cutoff));
        let parts = parts(&input, 16);
        let by_box = oriented.listed(&input, cutoff, &parts);
        let by_ellipse = ellipse.listed(&input, cutoff, &parts);
        assert_eq!(ellipse.set_up(&input, cutoff)[5], 0, "{splat:?} is whole");
        for (part, (by_box, by_ellipse)) in parts.iter().zip(by_box.into_iter().zip(by_ellipse)) {
            let least = least(&machine, &input, part);
            assert!(
                !by_ellipse || least < 9.1,
                "r is at least {least} in {part:?} of {splat:?}"
            );
            assert!(by_ellipse || least >= 9.0, "{part:?} of {splat:?} is lost");
            all += 1;
            outside += usize::from(!by_ellipse);
            turned += usize::from(!by_box);
        }
    }
    // Box 3 of 4 tiles too many, turned box close to the ellipse.
    assert!(
        3 * outside > all && 10 * turned > 9 * outside && turned < outside,
        "{all} tiles, {outside} outside, {turned} outside of turned boxes"
    );
}

/// Random machines are refused with a sentence or built; some are built.
#[test]
fn machines_that_cannot_test_are_refused() {
    let mut machine = Machine::named("reference").unwrap();
    machine.raster.second.format.frac_bits = 20;
    machine.bin = Some(Bin {
        test: BinTest::Ellipse,
        ..Bin::default()
    });
    let errors = machine.elaborate().unwrap_err();
    assert!(
        errors
            .iter()
            .any(|error| error.contains("raster.second is I4F20")),
        "{errors:?}"
    );
    machine.bin = Some(Bin::default());
    assert!(machine.elaborate().is_ok());
    machine.raster.second.format.frac_bits = 25;
    machine.bin = Some(Bin {
        test: BinTest::OrientedBox,
        ..Bin::default()
    });
    machine.timing.organisation = crate::machine::timing::Organisation::Immediate;
    let errors = machine.elaborate().unwrap_err();
    assert!(
        errors
            .iter()
            .any(|error| error.contains("bin.test tests tiles")),
        "{errors:?}"
    );
}

/// The multipliers that are declared are those of the graphs.
#[test]
fn every_multiplier_of_a_test_is_declared() {
    for (test, products) in [(BinTest::OrientedBox, 10), (BinTest::Ellipse, 16)] {
        let tester = Tester::new(&Machine::named("reference").unwrap(), test).unwrap();
        let e = &mut Elaboration::default();
        tester.words.declare(None, [1, 1], e);
        let declared: u32 = e.parts.iter().map(crate::elaboration::Part::products).sum();
        assert_eq!(tester.tile.products(), products);
        assert_eq!(declared, tester.tile.products() + tester.splat.products());
    }
}

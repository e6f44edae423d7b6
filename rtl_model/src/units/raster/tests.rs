//! Raster: registers checked against closed forms and exact rationals.

use super::*;
use crate::num::lanes::Plain;
use crate::num::words::PlainWords;
use crate::num::{Overflow, Rounding};
use crate::probe::{NoProbe, Ranges};
use proptest::prelude::*;

const SIZE_PX: [u32; 2] = [512, 384];

fn machine(name: &str, rows: Rows) -> Machine {
    let mut machine = Machine::named(name).unwrap();
    machine.raster.rows = rows;
    machine
}

fn unit(machine: &Machine) -> Raster {
    machine.elaborate().unwrap().raster
}

/// A real number as the nearest word.
fn word(word: Word, value: f64) -> i32 {
    let format = word.format;
    (value * f64::from(format.frac_bits).exp2())
        .round()
        .clamp(format.min() as f64, format.max() as f64) as i32
}

/// A splat: centre in pixels of the picture, standard deviations along the axes of a rotated
/// ellipse, depth plane, box.
#[derive(Clone, Copy, Debug)]
struct TestSplat {
    centre: [f64; 2],
    deviation: [f64; 2],
    turn: f64,
    depth_slope: [f64; 2],
    first: [u16; 2],
    size: [u16; 2],
}

/// A machine that evaluates each pixel, with squares of at most 32 bits.
fn direct(name: &str, square: Option<Word>) -> Machine {
    let mut machine = machine(name, Rows::Direct);
    let offset = machine.raster.offset.format;
    let is_narrow = offset.width() <= 16;
    machine.raster.square =
        square.or_else(|| (!is_narrow).then(|| Word::new(Format::signed(20, 12))));
    machine
}

/// Splats whose differences stay within every named machine's words: 2·|Q d| + Q, at most
/// 2·(width + height + 1)/σ², is below 120.
fn test_splats() -> impl Strategy<Value = TestSplat> {
    let centre = [0.0..512.0, 0.0..384.0];
    let slopes = prop::array::uniform2(-0.01..0.01);
    let sides = prop::array::uniform2(prop_oneof![Just(1u16), 2u16..120]);
    (
        centre,
        prop::array::uniform2(1.0..40.0),
        0.0..3.2,
        slopes,
        prop::array::uniform2(0.0..1.0),
        sides,
    )
        .prop_map(
            |(centre, deviation, turn, depth_slope, before, size): (
                [f64; 2],
                [f64; 2],
                _,
                _,
                [f64; 2],
                [u16; 2],
            )| {
                let least = (f64::from(size[0] + size[1] + 1) / 60.0).sqrt();
                let deviation = deviation.map(|deviation| deviation.max(least));
                let first = std::array::from_fn(|axis| {
                    let limit = SIZE_PX[axis] - u32::from(size[axis]);
                    (centre[axis] - before[axis] * f64::from(size[axis]))
                        .clamp(0.0, f64::from(limit)) as u16
                });
                TestSplat {
                    centre,
                    deviation,
                    turn,
                    depth_slope,
                    first,
                    size,
                }
            },
        )
}

impl TestSplat {
    fn input(&self, machine: &Machine) -> Input {
        let (e, p) = (&machine.ellipse, &machine.project);
        let [a, b] = self
            .deviation
            .map(|deviation| (deviation * deviation).recip());
        let (sin, cos) = self.turn.sin_cos();
        let last = |axis: usize| self.first[axis] + self.size[axis] - 1;
        Input {
            pixel: std::array::from_fn(|axis| {
                word(p.pixel, self.centre[axis] - f64::from(SIZE_PX[axis]) / 2.0)
            }),
            conic: [
                word(e.conic, a * cos * cos + b * sin * sin),
                word(e.conic_cross, (a - b) * sin * cos),
                word(e.conic, a * sin * sin + b * cos * cos),
            ],
            depth: word(p.depth, 0.5),
            depth_slope: self.depth_slope.map(|slope| word(e.depth_slope, slope)),
            depth_range: word(e.depth_range, 0.01),
            columns: [self.first[0], last(0)],
            rows: [self.first[1], last(1)],
        }
    }
}

/// Registers of every pixel of part of a row, for any cutoff: radial, depth.
fn registers(raster: &Raster, input: &Input, y: u16, from: u16, to: u16) -> Vec<[i64; 2]> {
    let mut all = Vec::new();
    for from in (from..=to).step_by(SIDE_PX) {
        let top = input.rows[0].max(y.saturating_sub(SIDE_PX as u16 - 1));
        // Once stepped from the rows above, once entered directly.
        let stepped = row(raster, input, [from, top], y - top);
        let entered = row(raster, input, [from, y], 0);
        assert_eq!(
            stepped, entered,
            "stepping down differs from entering in the middle"
        );
        all.extend(&entered[..entered.len().min(usize::from(to - from) + 1)]);
    }
    assert_eq!(all.len(), usize::from(to - from) + 1, "a pixel is missing");
    all
}

/// The registers of one row of the square.
fn row(raster: &Raster, input: &Input, square: [u16; 2], row: u16) -> Vec<[i64; 2]> {
    let (walks, span) = drawn(raster, input, square, i64::MAX, &mut NoProbe);
    let own = read_span(raster, &walks, &span)
        .into_iter()
        .filter(|(place, _)| usize::from(*place) / SIDE_PX == usize::from(row));
    own.map(|(_, read)| read).collect()
}

/// Lane in which [`drawn`] draws.
const LANE: usize = 5;

/// Part of the box in the square with this first pixel, drawn together with seven other splats.
fn drawn<P: Probe>(
    raster: &Raster,
    input: &Input,
    square: [u16; 2],
    cutoff: RegisterBits,
    probe: &mut P,
) -> (Walks, Span) {
    let tap = &mut Tap::new(probe);
    let walks = raster.enter::<Plain, _>(SIZE_PX, square, &beside_others(input).each_ref(), tap);
    let mut span = Span::default();
    raster.span::<Plain, _>(SIZE_PX, &walks, LANE, input, cutoff, &mut span, tap);
    (walks, span)
}

/// A splat among seven others.
fn beside_others(input: &Input) -> [Input; LANES] {
    let other = Input {
        pixel: [0; 2],
        conic: input.conic.map(|word| word / 2),
        ..*input
    };
    let mut inputs = [other; LANES];
    inputs[LANE] = *input;
    inputs
}

/// Places of a span's fragments, in order, with their registers: radial, depth.
fn read_span(raster: &Raster, walks: &Walks, span: &Span) -> Vec<(u8, [i64; 2])> {
    let unclamped = Walks {
        nearest: [i64::MIN; LANES],
        deepest: [i64::MAX; LANES],
        ..*walks
    };
    let read = |fragment: usize| {
        let place = span.places(fragment)[0];
        let [_, depth] = raster.fragments::<Plain>(&unclamped, LANE, span, [place; LANES]);
        let radial = span.radial.as_flattened().as_flattened()[usize::from(place)];
        (
            place,
            [
                raster.radial_register.read(radial),
                depth.0[0] >> raster.places.clamp[0],
            ],
        )
    };
    let mut all: Vec<_> = (0..span.fragments()).map(read).collect();
    all.sort_by_key(|(place, _)| *place);
    all
}

/// An exact multiple of 2^−`frac_bits` as a word, from the definition of its rounding.
fn quantised(exact: i128, frac_bits: i32, word: Word) -> i128 {
    let format = word.format;
    let ulp = 1i128 << (frac_bits - format.frac_bits).max(0);
    let scaled = exact << (format.frac_bits - frac_bits).max(0);
    let below = scaled.div_euclid(ulp);
    let up = match (2 * scaled.rem_euclid(ulp)).cmp(&ulp) {
        _ if word.round == Rounding::Truncate => 0,
        std::cmp::Ordering::Less => 0,
        std::cmp::Ordering::Greater => 1,
        std::cmp::Ordering::Equal if word.round == Rounding::NearestEven => below & 1,
        std::cmp::Ordering::Equal => 1,
    };
    let [least, most] = [format.min(), format.max()].map(i128::from);
    match word.overflow {
        Overflow::Saturate => (below + up).clamp(least, most),
        Overflow::Wrap => modulo(below + up, format),
    }
}

/// The low bits of a difference, as a signed number: zero where two registers differ by wraps only.
fn modulo(difference: i128, format: Format) -> i128 {
    let values = 1i128 << format.width();
    (difference + values / 2).rem_euclid(values) - values / 2
}

fn names() -> impl Strategy<Value = &'static str> {
    prop::sample::select(Machine::NAMES.to_vec())
}

/// Extra fraction bits beyond those of the terms.
const FINE: i32 = 80;

/// Exact r of a pixel for the words of the conic and the pixel, as a multiple of 2^−80.
fn exact_radial(machine: &Machine, input: &Input, x: u16, y: u16) -> i128 {
    let places = machine.project.pixel.format.frac_bits;
    let d: [i128; 2] = std::array::from_fn(|axis| {
        let from_middle = 2 * i128::from([x, y][axis]) + 1 - i128::from(SIZE_PX[axis]);
        (from_middle << (places - 1)) - i128::from(input.pixel[axis])
    });
    let [xx, xy, yy] = input.conic.map(i128::from);
    let r = xx * d[0] * d[0] + 2 * xy * d[0] * d[1] + yy * d[1] * d[1];
    r << (FINE - 2 * places - machine.ellipse.conic.format.frac_bits)
}

/// Errors of the seed, of the first differences by column and row, and of the second differences,
/// in pixels and r (docs/book/algorithm.md §4).
///
/// Each is half an ulp of its own word. The offset's half ulp is multiplied by the slope of r or of
/// its difference.
struct Errors {
    seed: f64,
    by_column: f64,
    by_row: f64,
    second: f64,
}

impl Errors {
    fn new(machine: &Machine, input: &Input, x: u16, y: u16) -> Errors {
        let half = |word: Word| f64::from(word.format.frac_bits + 1).exp2().recip();
        let m = &machine.raster;
        let conic = machine.ellipse.conic.format;
        let [xx, xy, yy] = input.conic.map(|word| conic.value(i64::from(word)));
        let d: [f64; 2] = std::array::from_fn(|axis| {
            let middle = f64::from([x, y][axis]) + 0.5 - f64::from(SIZE_PX[axis]) / 2.0;
            middle
                - machine
                    .project
                    .pixel
                    .format
                    .value(i64::from(input.pixel[axis]))
        });
        let finest = if m.offset.format.frac_bits >= machine.project.pixel.format.frac_bits {
            0.0
        } else {
            half(m.offset)
        };
        let along = [
            2.0 * (xx * d[0] + xy * d[1]).abs(),
            2.0 * (xy * d[0] + yy * d[1]).abs(),
        ];
        let curvature = xx.abs() + 2.0 * xy.abs() + yy.abs();
        let offset = finest * (along[0] + along[1]) + finest * finest * curvature;
        let gradient = half(m.gradient) * (d[0].abs() + d[1].abs() + 2.0 * finest);
        Errors {
            seed: offset + gradient + half(m.radial),
            by_column: finest * 2.0 * (xx.abs() + xy.abs()) + half(m.first),
            by_row: finest * 2.0 * (yy.abs() + xy.abs()) + half(m.first),
            second: half(m.second),
        }
    }

    fn after(&self, columns: u16, rows: u16) -> f64 {
        let [i, j] = [columns, rows].map(f64::from);
        let pairs = i * (i - 1.0) / 2.0 + j * (j - 1.0) / 2.0 + i * j;
        self.seed + i * self.by_column + j * self.by_row + pairs * self.second
    }
}

/// Distance of a register from the exact r, in r.
fn radial_error(machine: &Machine, input: &Input, radial: i64, x: u16, y: u16) -> f64 {
    let format = machine.raster.radial.format;
    let places = FINE - format.frac_bits;
    // Modulo the register's range; the fraction below its ulp stays.
    let difference = (i128::from(radial) << places) - exact_radial(machine, input, x, y);
    let reach = 1i128 << (format.width() + places);
    let wrapped = (difference + reach / 2).rem_euclid(reach) - reach / 2;
    wrapped as f64 * f64::from(-FINE).exp2()
}

proptest! {
    /// From any column the registers equal those reached by stepping from the box's first column,
    /// and both equal the closed form.
    #[test]
    fn stepping_equals_the_closed_form(name in names(), differenced in any::<bool>(), shape in test_splats(), skip in any::<prop::sample::Index>()) {
        let machine = machine(name, if differenced { Rows::Differenced } else { Rows::Seeded });
        let (raster, input) = (unit(&machine), shape.input(&machine));
        let [first, last] = input.columns;
        let y = input.rows[1];
        let walked = registers(&raster, &input, y, first, last);
        let skip = skip.index(walked.len());
        prop_assert_eq!(&registers(&raster, &input, y, first + skip as u16, last)[..], &walked[skip..]);
        let (radial, depth) = (machine.raster.radial.format, machine.raster.depth.format);
        if let [[r0, z0], [r1, z1], [r2, _], ..] = walked[..] {
            for (n, [r, z]) in walked.iter().enumerate() {
                let n = n as i128;
                let closed = i128::from(r0) + n * i128::from(r1 - r0) + n * (n - 1) / 2 * i128::from(r2 - 2 * r1 + r0);
                prop_assert_eq!(modulo(closed - i128::from(*r), radial), 0);
                prop_assert_eq!(modulo(i128::from(z0) + n * i128::from(z1 - z0) - i128::from(*z), depth), 0);
            }
        }
    }

    /// Where each row is seeded, the error grows along the row only. Where rows are differenced, it
    /// grows over the whole box. Both stay within their guard bits of the exact dᵀQd, and so of
    /// each other. In a narrow register they may differ by whole wraps, which never affect the
    /// footprint.
    #[test]
    fn seeded_and_differenced_rows_agree_within_their_guard_bits(name in names(), shape in test_splats()) {
        for rows in [Rows::Seeded, Rows::Differenced] {
            let machine = machine(name, rows);
            let (raster, input) = (unit(&machine), shape.input(&machine));
            let at_box = Errors::new(&machine, &input, input.columns[0], input.rows[0]);
            for y in (input.rows[0]..=input.rows[1]).step_by(7) {
                let at_row = Errors::new(&machine, &input, input.columns[0], y);
                for (x, [radial, _]) in (input.columns[0]..).zip(registers(&raster, &input, y, input.columns[0], input.columns[1])) {
                    let column = x - input.columns[0];
                    let bound = match rows {
                        Rows::Seeded => at_row.after(column, 0),
                        Rows::Differenced => at_box.after(column, y - input.rows[0]),
                        Rows::Direct => unreachable!(),
                    };
                    let error = radial_error(&machine, &input, radial, x, y).abs();
                    prop_assert!(error <= bound * 1.000_001, "{rows:?}: r at ({x}, {y}) is off by {error}, bound {bound}");
                }
            }
        }
    }

    /// r for exact offset words: the error of differencing alone.
    #[test]
    fn the_registers_stay_within_the_error_of_their_steps(name in names(), differenced in any::<bool>(), shape in test_splats()) {
        let machine = machine(name, if differenced { Rows::Differenced } else { Rows::Seeded });
        let (raster, input) = (unit(&machine), shape.input(&machine));
        let [left, top] = [input.columns[0], input.rows[0]];
        let at = |axis: usize, pixel: u16| {
            let from_middle = 2 * i64::from(pixel) + 1 - i64::from(SIZE_PX[axis]);
            raster.offset.one((from_middle << (raster.places.pixel - 1)) - i64::from(input.pixel[axis]))
        };
        let offset = machine.raster.offset.format;
        let (format, conic) = (machine.raster.radial.format, machine.ellipse.conic.format);
        let [xx, xy, yy] = input.conic.map(i128::from);
        let places = conic.frac_bits + 2 * offset.frac_bits;
        for y in (top..=input.rows[1]).step_by(5) {
            let [x0, y0] = [at(0, left), at(1, if differenced { top } else { y })];
            let reach_px = offset.value(x0.abs().max(y0.abs()));
            let down = if differenced { y - top } else { 0 };
            let y_word = i128::from(y0) + (i128::from(down) << offset.frac_bits);
            for (n, [radial, _]) in registers(&raster, &input, y, left, input.columns[1]).into_iter().enumerate() {
                let x_word = i128::from(x0) + ((n as i128) << offset.frac_bits);
                let exact = (xx * x_word * x_word + 2 * xy * x_word * y_word + yy * y_word * y_word) << (FINE - places);
                let reach = 1i128 << (format.width() + FINE - format.frac_bits);
                let difference = (i128::from(radial) << (FINE - format.frac_bits)) - exact;
                let error = ((difference + reach / 2).rem_euclid(reach) - reach / 2) as f64 * f64::from(-FINE).exp2();
                let bound = real::steps_error(&machine, reach_px, [n as u32, u32::from(down)]);
                prop_assert!(error.abs() <= bound, "r after {n} columns and {down} rows is off by {error}, bound {bound}");
            }
        }
    }

    /// A fragment at every pixel whose register is below the cutoff, nowhere else, in order.
    #[test]
    fn a_fragment_exists_where_the_radial_index_is_below_the_cutoff(name in names(), shape in test_splats(), cutoff in 0.1..8.0) {
        let machine = machine(name, Rows::Seeded);
        let (raster, input) = (unit(&machine), shape.input(&machine));
        let [from, last] = input.columns;
        let to = last.min(from + SIDE_PX as u16 - 1);
        let cutoff = word(machine.raster.cutoff, cutoff);
        let mut ranges = Ranges::new(machine.elaborate().unwrap().signals.len());
        let input = Input { rows: [input.rows[0]; 2], ..input };
        let (walks, span) = drawn(&raster, &input, [from, input.rows[0]], raster.cutoff(i64::from(cutoff)), &mut ranges);
        let limit = i64::from(cutoff) << (machine.raster.radial.format.frac_bits - machine.raster.cutoff.format.frac_bits);
        let all = registers(&raster, &input, input.rows[0], from, to);
        let expected: Vec<_> = (0u8..).zip(all).filter(|(_, [radial, _])| *radial < limit).collect();
        prop_assert_eq!(read_span(&raster, &walks, &span), expected);
    }

    /// Each pixel of a box is in exactly one square of 16 × 16, with its own number.
    #[test]
    fn squares_share_out_a_box(name in names(), differenced in any::<bool>(), shape in test_splats()) {
        let machine = machine(name, if differenced { Rows::Differenced } else { Rows::Seeded });
        let (raster, input) = (unit(&machine), shape.input(&machine));
        let squares = |[first, last]: [u16; 2]| (first / 16 * 16..=last).step_by(16);
        let mut all = Vec::new();
        for (y, x) in squares(input.rows).flat_map(|y| squares(input.columns).map(move |x| (y, x))) {
            let (walks, span) = drawn(&raster, &input, [x, y], i64::MAX, &mut NoProbe);
            for fragment in 0..span.fragments() {
                let pixel = u16::from(walks.pixels(LANE, span.places(fragment))[0]);
                all.push((y + pixel / 16, x + pixel % 16));
            }
        }
        all.sort();
        let [columns, rows] = [input.columns, input.rows].map(|[first, last]| first..=last);
        prop_assert!(all.into_iter().eq(rows.flat_map(|y| columns.clone().map(move |x| (y, x)))));
    }

    /// The plane of docs/book/algorithm.md §3, in ulps of the depth register: half an ulp for the
    /// seed, plus the offset's half ulp times the slope.
    #[test]
    fn depth_is_the_tangent_plane_between_its_clamps(name in names(), shape in test_splats()) {
        let machine = machine(name, Rows::Seeded);
        let (raster, input) = (unit(&machine), shape.input(&machine));
        let [e, p, depth] = [machine.ellipse.depth_slope, machine.project.depth, machine.raster.depth].map(|word| word.format);
        let [z, zx, zy] = [p.value(i64::from(input.depth)), e.value(input.depth_slope[0].into()), e.value(input.depth_slope[1].into())];
        let range = machine.ellipse.depth_range.format.value(i64::from(input.depth_range));
        let y = input.rows[1];
        let offset_error = f64::from(machine.raster.offset.format.frac_bits + 1).exp2().recip();
        let bound = depth.value(1) / 2.0 + offset_error * (zx.abs() + zy.abs()) + 1e-12;
        let clamped_frac_bits = [depth, p, machine.ellipse.depth_range.format].map(|format| format.frac_bits).into_iter().max().unwrap();
        for (x, [_, word]) in (input.columns[0]..).zip(registers(&raster, &input, y, input.columns[0], input.columns[1])) {
            let d: [f64; 2] = std::array::from_fn(|axis| {
                let middle = f64::from([x, y][axis]) + 0.5 - f64::from(SIZE_PX[axis]) / 2.0;
                middle - machine.project.pixel.format.value(i64::from(input.pixel[axis]))
            });
            let plane = z + zx * d[0] + zy * d[1];
            prop_assert!((depth.value(word) - plane).abs() <= bound, "z at ({x}, {y}) is {} instead of {plane}", depth.value(word));
            let (walks, span) = drawn(&raster, &input, [x, y], i64::MAX, &mut NoProbe);
            let [_, clamped] = raster.fragments::<Plain>(&walks, LANE, &span, [0; LANES]);
            let clamped = clamped.0[0] as f64 * f64::from(-clamped_frac_bits).exp2();
            prop_assert!((clamped - plane.clamp(z - range, z + range)).abs() <= bound);
        }
    }
}

/// Words for squares: none, coarse, fine, narrow.
fn squares() -> impl Strategy<Value = Option<Word>> {
    let rounding = prop::sample::select(vec![
        Rounding::Truncate,
        Rounding::Nearest,
        Rounding::NearestEven,
    ]);
    prop::option::of(
        (6..20i32, 0..12i32, rounding).prop_map(|(int_bits, frac_bits, round)| {
            Word::new(Format::signed(int_bits, frac_bits)).rounded(round)
        }),
    )
}

proptest! {
    /// r of each pixel is the sum of three products, whatever its box and square are. Exactly the
    /// pixels with 0 ≤ r < cutoff make a fragment.
    #[test]
    fn direct_pixels_equal_their_products(name in names(), square in squares(), finer in 0..=1, shape in test_splats(), cutoff in 0.1..8.0) {
        let mut machine = direct(name, square);
        machine.ellipse.conic_cross.format.frac_bits += finer;
        let (raster, input) = (unit(&machine), shape.input(&machine));
        let (m, pixel) = (&machine.raster, machine.project.pixel.format);
        let cutoff = i128::from(word(m.cutoff, cutoff)) << (m.radial.format.frac_bits - m.cutoff.format.frac_bits);
        let held = raster.cutoff((cutoff >> (m.radial.format.frac_bits - m.cutoff.format.frac_bits)) as i64);
        let twice = 2 * m.offset.format.frac_bits;
        let of_square = m.square.unwrap_or_else(|| Word::new(Format::signed(40, twice)));
        let [xx, xy, yy] = input.conic.map(i128::from);
        let mut inside = 0;
        for y in (input.rows[0]..=input.rows[1]).step_by(3) {
            for x in (input.columns[0]..=input.columns[1]).step_by(2) {
                let at = |axis: usize, place: u16| {
                    let from_middle = 2 * i128::from(place) + 1 - i128::from(SIZE_PX[axis]);
                    quantised((from_middle << (pixel.frac_bits - 1)) - i128::from(input.pixel[axis]), pixel.frac_bits, m.offset)
                };
                let (dx, dy) = (at(0, x), at(1, y));
                let [sx, sb, sy] = [dx * dx, dx * dy, dy * dy].map(|product| quantised(product, twice, of_square));
                let places = machine.ellipse.conic.format.frac_bits + of_square.format.frac_bits;
                let expected = quantised(((xx * sx + yy * sy) << finer) + 2 * xy * sb, places + finer, m.radial);
                let (walks, span) = drawn(&raster, &input, [x, y], held, &mut NoProbe);
                let own = read_span(&raster, &walks, &span).into_iter().find(|(place, _)| *place == 0);
                let kept = (0..cutoff).contains(&expected);
                inside += usize::from(kept);
                prop_assert_eq!(own.map(|(_, [radial, _])| i128::from(radial)), kept.then_some(expected), "({}, {})", x, y);
            }
        }
        // Some pixel of nearly every splat is in its ellipse.
        prop_assume!(inside > 0);
    }

    /// Exact offsets and conics: only squares and r are rounded.
    #[test]
    fn direct_pixels_are_within_the_error_of_their_squares(name in names(), square in squares(), shape in test_splats()) {
        let mut machine = direct(name, square.map(|word| Word { format: Format { int_bits: 20, ..word.format }, ..word }));
        machine.raster.offset = Word::new(Format::signed(12, machine.project.pixel.format.frac_bits));
        prop_assume!(machine.raster.square.is_some() || machine.raster.offset.format.width() <= 16);
        let (raster, input) = (unit(&machine), shape.input(&machine));
        let bound = real::steps_error(&machine, 512.0, [0; 2]);
        let (y, mut met) = (input.rows[1], 0);
        for x in input.columns[0]..=input.columns[1] {
            let (walks, span) = drawn(&raster, &input, [x, y], i64::MAX, &mut NoProbe);
            if let Some((0, [radial, _])) = read_span(&raster, &walks, &span).first() {
                let error = radial_error(&machine, &input, *radial, x, y).abs();
                prop_assert!(error <= bound, "r at column {x} is off by {error}, bound {bound}");
                met += 1;
            }
        }
        prop_assert!(met > 0 || input.columns[1] - input.columns[0] < 16);
    }
}

#[test]
fn a_direct_pixel_below_zero_makes_no_fragment() {
    // dx² and dy² of (3/16, −3/16) truncate to 0, and dx·dy to −1/16.
    let square = Word::new(Format::signed(20, 4)).rounded(Rounding::Truncate);
    for (cross, fragments) in [(0.5, 0), (0.0, 1), (-0.5, 1)] {
        let mut machine = direct("reference", Some(square));
        machine.raster.offset = Word::new(Format::signed(14, 4));
        let (raster, centre) = (unit(&machine), 0.5 - 3.0 / 16.0);
        let input = Input {
            pixel: [
                word(machine.project.pixel, centre),
                word(machine.project.pixel, 1.0 - centre),
            ],
            conic: [
                word(machine.ellipse.conic, 1.0),
                word(machine.ellipse.conic_cross, cross),
                word(machine.ellipse.conic, 1.0),
            ],
            columns: [256; 2],
            rows: [192; 2],
            ..Input::default()
        };
        let cutoff = raster.cutoff(1 << machine.raster.cutoff.format.frac_bits);
        let (_, span) = drawn(&raster, &input, [256, 192], cutoff, &mut NoProbe);
        assert_eq!(span.fragments(), fragments, "{cross}");
    }
}

#[test]
fn direct_words_that_cannot_hold_are_refused() {
    let errors = |change: &dyn Fn(&mut Machine)| {
        let mut machine = direct("reference", None);
        change(&mut machine);
        machine.elaborate().unwrap_err().join(" ")
    };
    let wide = errors(&|machine| machine.raster.square = None);
    assert!(
        wide.contains(
            "raster.square is left out, but exact squares of raster.offset I15F12 need 55 bits, and 48 can be held: give raster.square"
        ),
        "{wide}"
    );
    let unsigned =
        errors(&|machine| machine.raster.square = Some(Word::new(Format::unsigned(20, 10))));
    assert!(
        unsigned.contains("raster.square is U20F10, but its values are signed"),
        "{unsigned}"
    );
    let unused = errors(&|machine| machine.raster.rows = Rows::Seeded);
    assert_eq!(
        unused,
        "raster.square is given, but only raster.rows `direct` uses it"
    );
    let tested = errors(&|machine| {
        machine.bin = Some(crate::machine::Bin {
            test: crate::machine::BinTest::Ellipse,
            ..Default::default()
        });
    });
    assert!(
        tested.contains("raster.rows is direct: use bin.test `box`"),
        "{tested}"
    );
}

proptest! {
    /// The same fragments, with the same r and z; or none where words of 32 bits cannot hold them:
    /// z is steep, r grows too much, or its register wraps.
    #[test]
    fn words_of_32_bits_walk_as_wide_ones_do(
        name in names(), differenced in any::<bool>(), shape in test_splats(), steep in prop::array::uniform2(-40.0..40.0), is_steep in any::<bool>(),
        narrower in 0..20i32, deeper in 0..3i32,
    ) {
        let mut machine = machine(name, if differenced { Rows::Differenced } else { Rows::Seeded });
        let radial = &mut machine.raster.radial.format;
        radial.int_bits = (radial.int_bits - narrower).max(machine.raster.cutoff.format.int_bits + 1);
        let raster = unit(&machine);
        let shape = if is_steep { TestSplat { depth_slope: steep, ..shape } } else { shape };
        let input = shape.input(&machine);
        let cutoff = raster.cutoff(1 << (machine.raster.cutoff.format.frac_bits + deeper));
        let square = [input.columns[0] / 16 * 16, input.rows[0] / 16 * 16];
        let (walks, wide) = drawn(&raster, &input, square, cutoff, &mut NoProbe);
        let short = drawn_short(&raster, &input, square, cutoff);
        if let Some(short) = short {
            prop_assert_eq!(short, fragments(&raster, &walks, &wide));
        } else {
            // In the part r dips below its corners by at most twice its greatest value.
            let format = machine.raster.radial.format;
            let corners = input.columns.map(|x| input.rows.map(|y| exact_radial(&machine, &input, x, y)));
            let farthest = corners.into_iter().flatten().max().unwrap() as f64 * f64::from(-FINE).exp2();
            let room = f64::from(format.int_bits - 1).min(f64::from(31 - format.frac_bits)).exp2();
            let reaches_far = 2.0 * farthest + f64::from(deeper + 1).exp2() > room;
            prop_assert!(is_steep || reaches_far || !raster.is_short(cutoff), "no room for {} within {}", farthest, room);
        }
    }
}

/// Fragments that [`drawn`] draws, by pixel: radial, depth.
fn fragments(raster: &Raster, walks: &Walks, span: &Span) -> Vec<(u8, [i64; 2])> {
    let each = (0..span.fragments()).map(|first| {
        let places = span.places(first);
        let lanes = raster
            .fragments::<Plain>(walks, LANE, span, places)
            .map(|lanes| lanes.0[0]);
        (walks.pixels(LANE, places)[0], lanes)
    });
    let mut all: Vec<_> = each.collect();
    all.sort_unstable();
    all
}

/// Fragments of [`drawn`] in words of 32 bits, where they hold: pixel, radial, depth.
fn drawn_short(
    raster: &Raster,
    input: &Input,
    square: [u16; 2],
    cutoff: RegisterBits,
) -> Option<Vec<(u8, [i64; 2])>> {
    if !raster.is_short(cutoff) {
        return None;
    }
    let probe = &mut NoProbe;
    let tap = &mut Tap::new(probe);
    let (walks, held) = raster.enter_short::<Plain, _>(
        SIZE_PX,
        square,
        &beside_others(input).each_ref(),
        cutoff,
        tap,
    );
    let mut rows = super::short::ShortRows::default();
    if held & 1 << LANE == 0
        || !raster.short_rows::<Plain, _>(SIZE_PX, &walks, LANE, input, cutoff, &mut rows, tap)
    {
        return None;
    }
    let mut all = Vec::new();
    for shape in super::short::BlockShape::of(walks.columns(LANE)) {
        let mut blocks = raster.blocks::<PlainWords>(&walks, LANE, &rows, shape);
        loop {
            let words = raster.short_fragments(&walks, LANE, &blocks, raster.short_cutoff(cutoff));
            let [radial, depth] = words.map(|words| words.0.map(i64::from));
            let inside = blocks.inside(PlainWords([-1; LANES]));
            let inside = (0..LANES).filter(|lane| inside & 1 << lane != 0);
            all.extend(
                inside.map(|lane| (blocks.pixels().0[lane] as u8, [radial[lane], depth[lane]])),
            );
            if !blocks.go_on() {
                break;
            }
        }
    }
    all.sort_unstable();
    Some(all)
}

/// r of a conic that is not an ellipse falls below 0: along a row 8.5 below its centre from −13.6
/// to −14.4, and back. With a cutoff of 2 a word can hold down to −14.
#[test]
fn r_that_dips_between_corners_is_held_or_refused() {
    for rows in [Rows::Differenced, Rows::Seeded] {
        let machine = machine("reference", rows);
        let raster = unit(&machine);
        let (conic, cross) = (machine.ellipse.conic, machine.ellipse.conic_cross);
        let cutoff = raster.cutoff(2 << machine.raster.cutoff.format.frac_bits);
        let mut held = [0; 2];
        for step in 800..1200 {
            let scale = f64::from(step) / 1000.0;
            let input = Input {
                pixel: [
                    word(machine.project.pixel, 200.0 + 31.8 - 256.0),
                    word(machine.project.pixel, 152.0 - 192.0),
                ],
                conic: [word(conic, 0.0142 * scale), word(cross, 0.0532 * scale), 0],
                columns: [192, 207],
                rows: [160, 160],
                ..Input::default()
            };
            let (walks, wide) = drawn(&raster, &input, [192, 160], cutoff, &mut NoProbe);
            let short = drawn_short(&raster, &input, [192, 160], cutoff);
            held[usize::from(short.is_some())] += 1;
            assert!(
                short.is_none_or(|short| short == fragments(&raster, &walks, &wide)),
                "{rows:?}, {scale}"
            );
        }
        assert!(held[0] > 100 && held[1] > 100, "{rows:?}: {held:?}");
    }
}

/// A nearly flat splat of a few pixels is held, and a steep one is not.
#[test]
fn most_splats_are_walked_in_words_of_32_bits() {
    for name in ["reference", "lean"] {
        for rows in [Rows::Differenced, Rows::Seeded] {
            let machine = machine(name, rows);
            let raster = unit(&machine);
            let cutoff = raster.cutoff(1 << (machine.raster.cutoff.format.frac_bits + 1));
            let shape = TestSplat {
                centre: [200.3, 150.8],
                deviation: [4.0, 3.0],
                turn: 0.7,
                depth_slope: [0.01; 2],
                first: [194, 144],
                size: [13, 14],
            };
            assert!(
                drawn_short(&raster, &shape.input(&machine), [192, 144], cutoff).is_some(),
                "{name}, {rows:?}"
            );
            let steep = TestSplat {
                depth_slope: [4.0, -7.9],
                ..shape
            };
            let held = drawn_short(&raster, &steep.input(&machine), [192, 144], cutoff);
            assert!(held.is_none(), "{name}, {rows:?}");
        }
    }
}

/// Where differencing leaves r slightly below 0, or a wrapped register is negative, r is 0.
#[test]
fn a_radial_index_below_zero_is_zero() {
    let machine = machine("reference", Rows::Seeded);
    let raster = unit(&machine);
    let input = Input::default();
    let (walks, mut span) = drawn(&raster, &input, [0; 2], 1, &mut NoProbe);
    let radial = |held: RegisterBits, span: &mut Span| {
        span.radial[0][0][0] = held;
        raster.fragments::<Plain>(&walks, LANE, span, [0; LANES])[0].0[0]
    };
    let last_place = raster.radial_register.hold(Plain::splat(1)).0[0];
    let [below, at, above] = [-last_place, 0, last_place].map(|held| radial(held, &mut span));
    assert_eq!(
        [below, at, above, radial(i64::MIN, &mut span)],
        [0, 0, 1, 0]
    );
}

/// A register of ±4 wraps at the corners of a box that reaches r = 60, and is exact wherever r is
/// small.
#[test]
fn a_wrap_is_harmless_inside_the_footprint() {
    let mut machine = machine("reference", Rows::Seeded);
    machine.raster.radial.format = Format::signed(4, 28);
    machine.raster.cutoff.format = Format::unsigned(3, 16);
    let raster = unit(&machine);
    let shape = TestSplat {
        centre: [200.3, 150.8],
        deviation: [9.0, 2.0],
        turn: 0.7,
        depth_slope: [0.0; 2],
        first: [186, 137],
        size: [28, 28],
    };
    let input = shape.input(&machine);
    let (mut wrapped, mut inside) = (0, 0);
    for y in input.rows[0]..=input.rows[1] {
        for (x, [radial, _]) in (input.columns[0]..).zip(registers(
            &raster,
            &input,
            y,
            input.columns[0],
            input.columns[1],
        )) {
            let exact = exact_radial(&machine, &input, x, y) as f64 * f64::from(-FINE).exp2();
            let own = machine.raster.radial.format.value(radial);
            assert!(radial_error(&machine, &input, radial, x, y).abs() < 1e-3);
            wrapped += usize::from(exact >= 8.0);
            if exact < 4.0 {
                inside += 1;
                assert!(
                    (own - exact).abs() < 1e-3,
                    "r at ({x}, {y}) is {own} instead of {exact}"
                );
            }
        }
    }
    assert!(
        wrapped > 100 && inside > 50,
        "{wrapped} pixels wrapped, {inside} lie inside"
    );
}

//! Sheets: checked against a small model in real numbers; then each rule by itself.

use super::*;
use crate::frame;
use crate::kernels::Path;
use crate::num::lanes::Plain;
use crate::probe::NoProbe;
use proptest::prelude::*;

const WEIGHT_PLACES: f64 = 1048576.0;

/// Sheet, weight, rgb.
type SheetContribution = (u32, f64, [f64; 3]);

/// Words of α/x for a law, over [0, 8), with linear interpolation.
fn ratio(law: fn(f64) -> f64) -> Vec<i64> {
    (0..=1024)
        .map(|i| (law(f64::from(i) / 128.0) * WEIGHT_PLACES).round() as i64)
        .collect()
}

fn exponential(x: f64) -> f64 {
    if x == 0.0 {
        1.0
    } else {
        (1.0 - (-x).exp()) / x
    }
}

fn linear(x: f64) -> f64 {
    if x <= 1.0 { 1.0 } else { 1.0 / x }
}

fn rules() -> frame::Sheets {
    frame::Sheets {
        most_weight: 8 << 20,
        ratio: ratio(exponential),
        keeps_last: true,
        ..frame::Sheets::default()
    }
}

/// Decision of the unit on each contribution to one pixel, and the composite.
fn drawn(sheets: &frame::Sheets, contributions: &[SheetContribution]) -> (Vec<Decision>, [f64; 4]) {
    let machine = Machine::named("volume").unwrap().elaborate().unwrap();
    let (unit, mut tile, probe) = (
        &machine.fragment,
        Box::<PackedTile<i64>>::default(),
        &mut NoProbe,
    );
    let registers = unit.sheets(sheets);
    let tap = &mut Tap::new(probe);
    let decisions = contributions.iter().map(|(sheet, weight, rgb)| {
        let [r, g, b] = rgb.map(|channel| (channel * 4096.0).round() as i32);
        let weight = (weight * WEIGHT_PLACES).round() as i64;
        let attributes = [1, r, g, b, 0, 0, 0, 0];
        let input = SheetInput {
            sheet: *sheet,
            weight,
            attributes: &attributes,
        };
        unit.contribute_to_sheet::<Path<false, Plain, i64>, _>(&mut tile, 7, input, &registers, tap)
    });
    let decisions = decisions.collect();
    let places = f64::from(machine.machine.shade.premultiplied.format.frac_bits).exp2();
    let composite = unit
        .composite(&tile, 7, &registers, tap)
        .unwrap_or_default();
    let [r, g, b] = composite.colour.map(|channel| channel as f64 / places);
    (decisions, [r, g, b, composite.opacity as f64 / places])
}

/// Consecutive sheets, blended front to back.
fn model(law: fn(f64) -> f64, contributions: &[SheetContribution]) -> [f64; 4] {
    let mut front = [0.0; 4];
    for sheet in contributions.chunk_by(|a, b| a.0 == b.0) {
        let depth: f64 = sheet.iter().map(|(_, weight, _)| weight).sum();
        let scale = law(depth) * (1.0 - front[3]);
        for channel in 0..3 {
            front[channel] += scale
                * sheet
                    .iter()
                    .map(|(_, weight, rgb)| weight * rgb[channel])
                    .sum::<f64>();
        }
        front[3] += scale * depth;
    }
    front
}

fn close(a: [f64; 4], b: [f64; 4], by: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < by)
}

fn contributions() -> impl Strategy<Value = Vec<SheetContribution>> {
    let channel = || (0u32..=4096).prop_map(|word| f64::from(word) / 4096.0);
    let one = (0u32..3, 0.0..0.5, [channel(), channel(), channel()]);
    prop::collection::vec(one, 0..40).prop_map(|steps| {
        let mut sheet = 0;
        steps
            .into_iter()
            .map(|(step, weight, rgb)| {
                sheet += u32::from(step == 0);
                (sheet, weight, rgb)
            })
            .collect()
    })
}

proptest! {
    #[test]
    fn a_pixel_is_its_sheets_blended(contributions in contributions()) {
        for law in [linear, exponential] {
            let (_, composite) = drawn(&frame::Sheets { ratio: ratio(law), ..rules() }, &contributions);
            prop_assert!(close(composite, model(law, &contributions), 1e-4), "{composite:?} {:?}", model(law, &contributions));
        }
    }

    #[test]
    fn sheets_are_the_same_from_both_ends(contributions in contributions()) {
        let reversed: Vec<SheetContribution> = contributions.iter().rev().copied().collect();
        let behind = frame::Sheets { back_to_front: true, ..rules() };
        let (front, back) = (drawn(&rules(), &contributions).1, drawn(&behind, &reversed).1);
        prop_assert!(close(front, back, 1e-4), "{front:?} {back:?}");
    }

    /// With at most one weight per sheet, every splat is a sheet.
    #[test]
    fn a_splat_is_a_sheet_of_its_own(contributions in contributions()) {
        let each = frame::Sheets { each: Each::Splat, ratio: Vec::new(), ..rules() };
        let numbered: Vec<SheetContribution> = contributions.iter().zip(0..).map(|((_, weight, rgb), number)| (number, *weight, *rgb)).collect();
        let (_, composite) = drawn(&each, &numbered);
        prop_assert!(close(composite, model(|_| 1.0, &numbered), 1e-4), "{composite:?}");
    }
}

const RED: [f64; 3] = [1.0, 0.0, 0.0];
const BLUE: [f64; 3] = [0.0, 0.0, 1.0];

#[test]
fn decisions_have_their_names() {
    let contributions = [
        (3, 0.2, RED),
        (3, 0.1, RED),
        (4, 0.2, BLUE),
        (4, 0.2, BLUE),
        (9, 0.1, RED),
    ];
    let expected = [
        Decision::Inserted(1),
        Decision::Accumulated(1),
        Decision::Merged(0, 1),
        Decision::Accumulated(1),
        Decision::Merged(0, 1),
    ];
    assert_eq!(drawn(&rules(), &contributions).0, expected);
    let each = frame::Sheets {
        each: Each::Splat,
        ratio: Vec::new(),
        ..rules()
    };
    assert_eq!(
        drawn(&each, &contributions[..2]).0,
        [Decision::Inserted(0), Decision::Merged(0, 1)]
    );
}

#[test]
fn a_weight_is_clamped_to_its_limit() {
    let each = frame::Sheets {
        each: Each::Splat,
        ratio: Vec::new(),
        most_weight: 99 * (1 << 20) / 100,
        ..rules()
    };
    let (_, composite) = drawn(&each, &[(0, 3.0, RED)]);
    assert!(
        close(composite, [0.99, 0.0, 0.0, 0.99], 1e-5),
        "{composite:?}"
    );
}

#[test]
fn a_pixel_stops_where_it_lets_too_little_through() {
    let half = [(0, 0.5, RED), (1, 0.5, BLUE), (2, 0.5, RED), (3, 0.5, BLUE)];
    // 0.5, 0.25, 0.125: the third leaves less than 0.2.
    let stopping = |keeps_last| frame::Sheets {
        each: Each::Splat,
        ratio: Vec::new(),
        stop: (1 << 20) / 5,
        keeps_last,
        ..rules()
    };
    let (decisions, composite) = drawn(&stopping(false), &half);
    assert_eq!(decisions[2..], [Decision::Dropped; 2]);
    assert!(
        close(composite, [0.5, 0.0, 0.25, 0.75], 1e-5),
        "{composite:?}"
    );
    let (decisions, composite) = drawn(&stopping(true), &half);
    assert_eq!(decisions[2..], [Decision::Merged(0, 1), Decision::Dropped]);
    assert!(
        close(composite, [0.625, 0.0, 0.25, 0.875], 1e-5),
        "{composite:?}"
    );
    // A slice is blended when the next one begins, which is then too late.
    let slices = frame::Sheets {
        each: Each::Slice,
        ratio: ratio(linear),
        ..stopping(true)
    };
    let (decisions, composite) = drawn(&slices, &half);
    assert_eq!(decisions[3], Decision::Dropped);
    assert!(
        close(composite, [0.625, 0.0, 0.25, 0.875], 1e-5),
        "{composite:?}"
    );
}

proptest! {
    /// Each channel of a pixel is colour · w + old · (1 − w), cut to the word of the composite.
    #[test]
    fn a_composite_is_blended_in_its_own_word(
        splats in prop::collection::vec((1i64..128, [0i32..256, 0i32..256, 0i32..256]), 0..30),
    ) {
        let machine = Machine::named("cubed").unwrap().elaborate().unwrap();
        let unit = &machine.fragment;
        let sheets = frame::Sheets {
            each: Each::Splat,
            back_to_front: true,
            most_weight: 127,
            ..frame::Sheets::default()
        };
        let (registers, probe) = (unit.sheets(&sheets), &mut NoProbe);
        let (mut tile, tap) = (Box::<PackedTile<i64>>::default(), &mut Tap::new(probe));
        let mut pixel = [0; 4];
        for (nth, (weight, [r, g, b])) in splats.iter().enumerate() {
            let attributes = [1, *r, *g, *b, 0, 0, 0, 0];
            let input = SheetInput { sheet: nth as u32, weight: *weight, attributes: &attributes };
            let decision = unit.contribute_to_sheet::<Path<false, Plain, i64>, _>(&mut tile, 7, input, &registers, tap);
            prop_assert_eq!(decision, if nth == 0 { Decision::Inserted(0) } else { Decision::Merged(0, 1) });
            for (old, new) in pixel.iter_mut().zip([4 * r, 4 * g, 4 * b, 1024].map(i64::from)) {
                *old = (new * weight + *old * (128 - weight)) / 128;
            }
        }
        let composite = unit.composite(&tile, 7, &registers, tap).unwrap_or_default();
        let [r, g, b] = composite.colour;
        // Fraction bits of light are 15, and those of the composite 10.
        prop_assert_eq!([r, g, b, composite.opacity], pixel.map(|word: i64| word * 32));
    }
}

#[test]
fn a_composite_without_a_sort_or_with_slots_is_refused() {
    let refused = |change: &dyn Fn(&mut Machine)| {
        let mut machine = Machine::named("cubed").unwrap();
        change(&mut machine);
        machine.elaborate().unwrap_err()
    };
    assert_eq!(
        refused(&|machine| machine.sort = None),
        ["fragment.sheets.composite needs a sort: Gaussians are drawn the farthest first"]
    );
    assert_eq!(
        refused(&|machine| machine.fragment.layers = 2),
        [
            "fragment.layers is 2, but with fragment.sheets.composite a pixel holds one composite: 1 would fit"
        ]
    );
}

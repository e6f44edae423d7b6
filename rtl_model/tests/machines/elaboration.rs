//! Which machines elaborate, and which errors are reported for the others?

use crate::mutation::{mutated, mutations, named, with_field, with_format};
use proptest::prelude::*;
use rtl_model::Machine;
use rtl_model::elaboration::{Operator, Part};
use rtl_model::machine::timing::Organisation;
use rtl_model::machine::{DepthWeight, Merge};
use rtl_model::num::Format;
use rtl_model::pipeline::Elaborated;
use serde_json::json;

fn built(name: &str) -> Elaborated {
    Machine::named(name)
        .unwrap()
        .elaborate()
        .unwrap_or_else(|errors| panic!("{name}: {errors:#?}"))
}

#[test]
fn the_named_machines_elaborate() {
    for name in Machine::NAMES.into_iter().chain(Machine::WINDOW_NAMES) {
        let machine = built(name);
        let fragment = machine.machine.fragment;
        let rules = if name == "window" {
            (4, Merge::Window, true)
        } else {
            (3, Merge::FarthestPair, true)
        };
        assert_eq!(
            (fragment.layers, fragment.merge, fragment.evict_hidden),
            rules,
            "{name}"
        );
        assert_eq!(machine.machine.name, name);
    }
    assert!(Machine::named("nobody").is_none());
}

#[test]
fn a_named_machine_reads_back_from_its_json() {
    for name in Machine::NAMES.into_iter().chain(Machine::WINDOW_NAMES) {
        let machine = Machine::named(name).unwrap();
        let text = serde_json::to_string(&machine).unwrap();
        assert_eq!(serde_json::from_str::<Machine>(&text).unwrap(), machine);
    }
}

/// A machine that draws splats in submission order, and so cuts no box to a tile.
fn immediate(name: &str) -> Elaborated {
    let mut machine = Machine::named(name).unwrap();
    machine.timing.organisation = Organisation::Immediate;
    machine.elaborate().unwrap()
}

/// Signed operands carry their sign. An unsigned operand of n bits needs a signed multiplier of n +
/// 1 bits, which is not counted here.
#[test]
fn no_multiplier_is_wider_than_specified() {
    for (name, most) in [("reference", 27), ("lean", 18), ("tiny", 18)] {
        for part in built(name).parts {
            let Operator::Multiplier(operand_bits) = part.operator else {
                continue;
            };
            assert!(
                operand_bits.into_iter().all(|bits| bits <= most),
                "{name}: {} multiplies {operand_bits:?} bits",
                part.unit
            );
        }
    }
}

/// Slopes below 1 are added to 1 and to the normal: sums are as wide as their widest term.
#[test]
fn a_sum_is_as_wide_as_its_widest_term() {
    let slope = with_format(
        &Machine::named("lean").unwrap(),
        "project.slope",
        Format::signed(-2, 20),
    );
    assert!(slope.elaborate().is_ok());
    let errors = with_format(&slope, "ellipse.tilt", Format::signed(-5, 31))
        .elaborate()
        .unwrap_err();
    assert_eq!(
        errors,
        [
            "ellipse.shape is made from an exact result of 65 bits, but 62 can be held: 3 bits must be removed from its operands"
        ]
    );
}

/// Products per cycle, unit by unit, for units whose products the simulator cannot count itself.
#[test]
fn every_multiplier_is_declared() {
    let count = |machine: &Elaborated, unit: &str| {
        machine
            .parts
            .iter()
            .filter(|part| part.unit == unit)
            .map(Part::products)
            .sum::<u32>()
    };
    let reference = built("reference");
    // The conic along and across, squares, depth.
    assert_eq!(count(&immediate("reference"), "raster"), 2 + 2 + 2 + 2);
    // To a tile, down and along: pairs of steps; r times its first difference of 43 bits and its
    // second of 29, two first differences times their second, z times its slope of 27; all in
    // pieces of 14 bits.
    assert_eq!(
        count(&reference, "raster"),
        2 + 2 + 2 + 2 + 2 * (1 + 4 + 3 + 2 * 3 + 2)
    );
    // Interpolation between table words, amplitude.
    assert_eq!(count(&reference, "gauss"), 2);
    // Seven attributes, one of which is needed alone too; four channels of two merging fragments.
    // The opacity limit is a product with a constant: adders.
    assert_eq!(count(&reference, "fragment"), 7 + 1 + 4);
    // 1/W with one step; four shares, three squares; 1/|n| with one step; the normal; two cosines;
    // light, colour, gloss; coverage, opacity, three channels; interpolation between the words of
    // the highlight.
    assert_eq!(
        count(&reference, "shade"),
        2 + 4 + 3 + 3 + 3 + 2 * 3 + 3 * 3 + 2 + 3 + 1
    );
    // Three channels and the transmittance, for a layer and for the background.
    assert_eq!(count(&reference, "resolve"), 4 + 4);
    // The tables of the tiny machine do not interpolate, and its function units have no steps.
    let tiny = built("tiny");
    assert_eq!(count(&tiny, "gauss"), 1);
    assert_eq!(
        count(&reference, "project") - count(&tiny, "project"),
        2 * 2
    );
    // It draws only square pixels: no three products with an aspect, no second step and scale of
    // depth.
    assert_eq!(
        count(&reference, "ellipse") - count(&tiny, "ellipse"),
        2 * 3 + 2 * 3 + 2 + 3 + 2
    );
    assert_eq!(
        count(&reference, "shade") - count(&tiny, "shade"),
        2 + 3 + 1
    );
    // Weights that fall with depth: the depth's share of σ, and the opacity's product with 1 minus
    // this share.
    let mut machine = Machine::named("weighted").unwrap();
    machine.sort.as_mut().unwrap().depth_weight = Some(DepthWeight::default());
    let falling = machine.elaborate().unwrap();
    assert_eq!(
        count(&falling, "ellipse") - count(&built("weighted"), "ellipse"),
        2
    );
}

#[test]
fn a_reference_fragment_fits_the_papers_bytes() {
    assert!(Machine::named("reference").unwrap().fragment_bits() <= 38 * 8);
}

#[test]
fn no_lean_accumulator_is_wider_than_24_bits() {
    let Machine {
        fragment, raster, ..
    } = Machine::named("lean").unwrap();
    let sums = [
        fragment.weight_sum,
        fragment.colour_sum,
        fragment.opacity_sum,
        fragment.normal_sum,
    ];
    for word in sums
        .into_iter()
        .chain([raster.radial, raster.first, raster.second, raster.depth])
    {
        assert!(word.format.width() <= 24, "{word}");
    }
}

fn elaboration_errors(machine: &Machine) -> Vec<String> {
    machine.elaborate().err().unwrap_or_default()
}

/// Signal that an elaboration error names, and the format that it suggests.
fn suggestion(error: &str) -> Option<(String, Format)> {
    let signal = error.split_whitespace().next()?;
    let (before, _) = error
        .split_once(" would fit")
        .or_else(|| error.split_once(" would hold all of it"))?;
    Some((
        signal.to_owned(),
        before.split_whitespace().last()?.parse().ok()?,
    ))
}

#[test]
fn an_elaboration_error_names_the_signal_and_a_format_that_fits() {
    let reference = Machine::named("reference").unwrap();
    let format = |text: &str| text.parse::<Format>().unwrap();
    for (signal, wrong, sentence) in [
        (
            "project.camera",
            "I4F36",
            "project.camera is I4F36, 40 bits on a port that carries 32: I4F28 would fit",
        ),
        (
            "gauss.weight",
            "FP16",
            "gauss.weight is FP16, 41 bits from its sign to its last place on a port that carries 32: U16F15S11 would fit",
        ),
        (
            "shade.rgb",
            "U0F18",
            "shade.rgb is U0F18 and must hold 1: U1F18 would fit",
        ),
        (
            "splat.normal",
            "I1F20",
            "splat.normal is I1F20 and must hold 1: I2F20 would fit",
        ),
        (
            "splat.radius",
            "I1F20",
            "splat.radius is I1F20, but its values are never negative: U1F20 would fit",
        ),
        (
            "fragment.depth",
            "U1F30",
            "fragment.depth is U1F30, 31 bits: the depth comparators take at most 30",
        ),
        (
            "gauss.radial_index",
            "U6F10",
            "gauss.radial_index is U6F10: the table spans at most 32, U5F10",
        ),
        (
            "raster.first",
            "I8F40",
            "raster.first is I8F40, finer than the register raster.radial I20F27 that it meets: I8F27 would fit",
        ),
        (
            "raster.depth",
            "I4F20",
            "raster.depth is I4F20, coarser than the steps ellipse.depth_slope I3F24 that it adds: I4F24 would fit",
        ),
    ] {
        let found = elaboration_errors(&with_format(&reference, signal, format(wrong)));
        assert!(
            found.iter().any(|error| error == sentence),
            "{signal} {wrong}: {found:#?}"
        );
    }
}

#[test]
fn contradicting_rules_are_elaboration_errors() {
    let reference = Machine::named("reference").unwrap();
    for (field, value, sentence) in [
        (
            "fragment.layers",
            json!(0),
            "fragment.layers is 0: 1 to 8 can be built",
        ),
        (
            "fragment.layers",
            json!(9),
            "fragment.layers is 9: 1 to 8 can be built",
        ),
        (
            "fragment.merge",
            json!("replace"),
            "fragment.merge is replace, a z-buffer, with 3 layers: it needs fragment.layers 1",
        ),
        (
            "fragment.opaque_permille",
            json!(1001),
            "fragment.opaque_permille is 1001: 1 to 1000 can be built",
        ),
        (
            "gauss.table.index_bits",
            json!(20),
            "gauss.table.index_bits is 20: 1 to 12 can be built",
        ),
        (
            "ellipse.root.bits",
            json!(4_294_967_295u32),
            "ellipse.root.bits is 4294967295: 4 to 30 can be built",
        ),
        (
            "shade.reciprocal.newton_steps",
            json!(4),
            "shade.reciprocal.newton_steps is 4: 0 to 3 can be built",
        ),
        (
            "project.slope",
            json!({"format": "I4F22", "overflow": "wrap"}),
            "project.slope wraps, but only the raster's registers and the fragment's sums may: let it saturate",
        ),
        (
            "fragment.depth",
            json!({"format": "U1F25", "overflow": "wrap"}),
            "fragment.depth wraps, but only the raster's registers and the fragment's sums may: let it saturate",
        ),
    ] {
        let found = elaboration_errors(&with_field(&reference, field, value));
        assert!(
            found.iter().any(|error| error == sentence),
            "{field}: {found:#?}"
        );
    }
}

#[test]
fn all_elaboration_errors_are_reported_together() {
    let mut machine = Machine::named("lean").unwrap();
    for (signal, format) in [
        ("shade.opacity", "U0F14"),
        ("splat.rgb", "I2F10"),
        ("ellipse.tilt", "I20F20"),
        ("resolve.frame", "U0F12"),
    ] {
        machine = with_format(&machine, signal, format.parse().unwrap());
    }
    machine.fragment.layers = 11;
    let found = elaboration_errors(&machine);
    for signal in [
        "shade.opacity",
        "splat.rgb",
        "ellipse.tilt",
        "resolve.frame",
        "fragment.layers",
    ] {
        assert!(
            found.iter().any(|error| error.starts_with(signal)),
            "{signal}: {found:#?}"
        );
    }
}

#[test]
fn unknown_and_missing_fields_are_refused() {
    let mut value = serde_json::to_value(Machine::named("tiny").unwrap()).unwrap();
    value["raster"]["radail"] = json!("I9F8");
    assert!(
        serde_json::from_value::<Machine>(value.clone())
            .unwrap_err()
            .to_string()
            .contains("radail")
    );
    value["raster"].as_object_mut().unwrap().remove("radail");
    value["raster"].as_object_mut().unwrap().remove("radial");
    assert!(
        serde_json::from_value::<Machine>(value.clone())
            .unwrap_err()
            .to_string()
            .contains("radial")
    );
    value["raster"]["radial"] = json!("I99F3");
    assert!(
        serde_json::from_value::<Machine>(value)
            .unwrap_err()
            .to_string()
            .contains("102 bits wide")
    );
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(1500) })]

    #[test]
    fn elaboration_never_panics_and_reports_sentences(name in named(), changes in mutations(1..40)) {
        let machine = changes.iter().fold(Machine::named(name).unwrap(), |machine, change| mutated(&machine, change));
        for error in elaboration_errors(&machine) {
            prop_assert!(error.len() > 20 && !error.contains('\n') && error.contains('.'), "{error}");
        }
    }

    /// After the suggestion of an elaboration error is applied, that error is gone.
    #[test]
    fn a_suggested_format_removes_its_elaboration_error(name in named(), changes in mutations(1..6)) {
        let machine = changes.iter().fold(Machine::named(name).unwrap(), |machine, change| mutated(&machine, change));
        for error in elaboration_errors(&machine) {
            prop_assert!(suggestion(&error).is_some() || !error.contains(" would "), "{error}");
            if let Some((signal, format)) = suggestion(&error) {
                let again = elaboration_errors(&with_format(&machine, &signal, format));
                let complaint = |text: &str| text.split(": ").next().unwrap_or_default().replace(char::is_numeric, "");
                prop_assert!(!again.iter().any(|other| complaint(other) == complaint(&error)), "{error}\nthen {again:#?}");
            }
        }
    }
}

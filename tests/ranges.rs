//! Do the reported ranges of a machine's formats agree with its behaviour?

use crate::tier::{self, Tier};
use rtl_model::Machine;
use rtl_model::elaboration::Signal;
use rtl_model::num::Format;
use rtl_model::probe::Range;
use serde_json::Value;
use splatsim::hardware::fixed;
use splatsim::hardware::quantise::quantise;
use splatsim::scene::{Overrides, Scene};

fn glass_spheres() -> Scene {
    let mut scene = Scene::load(
        "glass-spheres",
        &Overrides {
            size: Some((160, 120)),
        },
    )
    .unwrap();
    scene.splats = scene.splats.into_iter().step_by(7).collect();
    scene
}

/// The machine with another format for one of its words; none if the word is not in its
/// description, if no machine can have this format, or if the scene is quantised differently with
/// it.
fn with(scene: &Scene, machine: &Machine, signal: &Signal, format: Format) -> Option<Machine> {
    let mut description = serde_json::to_value(machine).unwrap();
    let word = description.get_mut(signal.unit)?.get_mut(&signal.name)?;
    match word {
        Value::String(text) => *text = format.to_string(),
        Value::Object(word) => *word.get_mut("format")? = format.to_string().into(),
        _ => return None,
    }
    let other: Machine = serde_json::from_value(description).ok()?;
    let same = other.elaborate().is_ok()
        && quantise(scene, &other).ok()?.frame == quantise(scene, machine).ok()?.frame;
    same.then_some(other)
}

/// Unused integer bits are removed from all words that a machine can narrow: the picture does not
/// change, and nothing saturates. Removing one more bit from a fully used word changes the picture.
#[test]
fn a_machine_of_narrowest_formats_draws_the_same_picture() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let scene = glass_spheres();
    for name in tier::some([3, 3], Machine::NAMES) {
        let first = Machine::named(name).unwrap();
        let elaborated = first.elaborate().unwrap();
        let (drawing, ranges, _) =
            fixed::draw_measured(&elaborated, &quantise(&scene, &first).unwrap());
        // The range of a table's argument is part of its meaning, whatever part of it is used.
        let freed = |(signal, range): &(&Signal, &Range)| {
            let overflows = range.saturated_low + range.saturated_high + range.wrapped;
            overflows == 0 && (signal.unit, signal.name.as_str()) != ("gauss", "radial_index")
        };
        let signals: Vec<(&Signal, &Range)> = elaborated
            .signals
            .iter()
            .zip(&ranges.0)
            .filter(freed)
            .collect();
        let (mut machine, mut taken, mut bitten) = (first.clone(), 0, 0);
        for (signal, range) in &signals {
            let format = signal.word.format;
            let Some(narrowest) = range.narrowest(format) else {
                continue;
            };
            let fits = Format {
                int_bits: narrowest.int_bits.max(1 - format.frac_bits),
                ..format
            };
            if let Some(narrower) = with(&scene, &machine, signal, fits) {
                taken += format.int_bits - fits.int_bits;
                machine = narrower;
            }
            let short = Format {
                int_bits: fits.int_bits - 1,
                ..format
            };
            if let Some(too_narrow) = with(&scene, &first, signal, short) {
                let (_, ranges, _) = fixed::draw_measured(
                    &too_narrow.elaborate().unwrap(),
                    &quantise(&scene, &too_narrow).unwrap(),
                );
                let index = elaborated
                    .signals
                    .iter()
                    .position(|other| other == *signal)
                    .unwrap();
                let range = &ranges.0[index];
                assert!(
                    range.saturated_low + range.saturated_high + range.wrapped > 0,
                    "{}.{} of {name}",
                    signal.unit,
                    signal.name
                );
                bitten += 1;
            }
        }
        println!("{name}: {taken} bits taken away, {bitten} words tried with one less");
        assert!(
            taken > 10 && bitten > 10,
            "{name}: {taken} bits, {bitten} words"
        );
        let elaborated = machine.elaborate().unwrap();
        let (narrow, after, _) =
            fixed::draw_measured(&elaborated, &quantise(&scene, &machine).unwrap());
        assert_eq!(narrow.frame, drawing.frame, "{name}");
        for ((range, before), signal) in after.0.iter().zip(&ranges.0).zip(&elaborated.signals) {
            let overflows =
                |range: &Range| [range.saturated_low, range.saturated_high, range.wrapped];
            assert_eq!(
                overflows(range),
                overflows(before),
                "{}.{} of {name} as {}",
                signal.unit,
                signal.name,
                signal.word
            );
        }
    }
}

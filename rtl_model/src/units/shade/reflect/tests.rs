//! Reflect: laws of what is mirrored.

use super::*;
use crate::frame::Mirror;
use crate::machine::FunctionUnit;
use crate::num::Word;
use crate::probe::NoProbe;
use proptest::prelude::*;

/// A machine with wide words.
fn machine(sight: Sight) -> Machine {
    let word = |signed: bool, int_bits: i32, frac_bits: i32| {
        Word::new(Format::fixed_point(signed, int_bits, frac_bits))
    };
    let reflect = Description {
        sight,
        slope: Some(word(true, 2, 20)),
        facing: word(true, 2, 20),
        direction: word(true, 3, 20),
        reciprocal: FunctionUnit {
            table_bits: 8,
            newton_steps: 2,
            bits: 24,
        },
        coordinate: word(false, 1, 20),
        index_bits: 5,
        fraction: word(false, 1, 12),
        light: word(false, 1, 16),
        reflectance: word(false, 1, 16),
    };
    Machine {
        reflect: Some(reflect),
        ..Machine::named("reference").unwrap()
    }
}

fn unit(machine: &Machine) -> Reflect {
    machine
        .elaborate()
        .unwrap()
        .shade
        .reflect()
        .unwrap()
        .clone()
}

fn mirror(kept: i64, mirrored: [i64; 3]) -> Vec<Mirror> {
    vec![Mirror { kept, mirrored }]
}

prop_compose! {
    /// A unit normal that faces the viewer.
    fn facing()(x in -1.0..1.0f64, y in -1.0..1.0f64, z in 0.05..1.0f64) -> [f64; 3] {
        let length = (x * x + y * y + z * z).sqrt();
        [x / length, y / length, -z / length]
    }
}

proptest! {
    /// R·N = V·N, and R as long as V, by real numbers.
    #[test]
    fn a_mirror_turns_a_ray_about_its_normal(
        normal in facing(), pixel in prop::array::uniform2(0i64..200), by_ray in any::<bool>(), off in prop::array::uniform2(-40i64..40),
    ) {
        let machine = machine(if by_ray { Sight::Ray } else { Sight::Axis });
        let (unit, surroundings) = (unit(&machine), Surroundings::default());
        let inverse = machine.ellipse.inverse_focal.format;
        // 1/s = ¾ · 2^−7.
        let inverse_focal = Scaled { mantissa: 3 * inverse.one() / 4, places: 7 };
        // Quarters of pixels.
        let centre = off.map(|off| off * machine.project.pixel.format.one() / 4);
        let registers = Registers { surroundings: &surroundings, size_px: [200, 200], inverse_focals: [inverse_focal; 2], centre };
        let format = machine.shade.normal.format;
        let words = normal.map(|part| (part * format.one() as f64).round() as i64);
        let found = unit.direction(&registers, pixel, words, &mut Tap::new(&mut NoProbe)).map(|part| machine.reflect.unwrap().direction.format.value(part));
        let slope = |axis: usize| if by_ray { (pixel[axis] as f64 + 0.5 - 100.0 - off[axis] as f64 / 4.0) * 0.75 / 128.0 } else { 0.0 };
        let view = [-slope(0), -slope(1), -1.0];
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        prop_assert!((dot(found, normal) - dot(view, normal)).abs() < 1e-3, "{:?}", found);
        prop_assert!((dot(found, found) - dot(view, view)).abs() < 2e-3, "{:?}", found);
    }

    #[test]
    fn a_flat_sky_is_its_colour_everywhere(normal in facing(), sky in prop::array::uniform3(0i64..=65536), colour in prop::array::uniform3(0i64..=4096)) {
        let machine = machine(Sight::Axis);
        let unit = unit(&machine);
        let surroundings = Surroundings { mirrors: mirror(0, [65536; 3]), texels: vec![sky; 1024] };
        let registers = Registers { surroundings: &surroundings, size_px: [64; 2], inverse_focals: [Scaled::default(); 2], centre: [0; 2] };
        let format = machine.shade.normal.format;
        let words = normal.map(|part| (part * format.one() as f64).round() as i64);
        let found = unit.one(&registers, 0, [0; 2], words, colour, &mut Tap::new(&mut NoProbe));
        // The reference's colour is finer than the sky.
        let places = machine.shade.colour.format.frac_bits - 16;
prop_assert_eq!(found, sky.map(|light| light << places));
    }

    /// Passed by, or gone through with nothing to mirror: the same.
    #[test]
    fn nothing_mirrored_changes_nothing(normal in facing(), colour in prop::array::uniform3(0.0..1.0f64)) {
        let machine = machine(Sight::Axis);
        let unit = unit(&machine);
        let surroundings = Surroundings { mirrors: mirror(65536, [0; 3]), texels: vec![[65536; 3]; 1024] };
        let registers = Registers { surroundings: &surroundings, size_px: [64; 2], inverse_focals: [Scaled::default(); 2], centre: [0; 2] };
        let [n, c] = [machine.shade.normal, machine.shade.colour].map(|word| word.format.one() as f64);
        let (words, colour) = (normal.map(|part| (part * n).round() as i64), colour.map(|part| (part * c) as i64));
        prop_assert!(!unit.mirrors(&registers, 0));
        prop_assert_eq!(unit.one(&registers, 0, [0; 2], words, colour, &mut Tap::new(&mut NoProbe)), colour);
    }
}

/// Straight back, to the sides, and away: middle, edges and corners of the map.
#[test]
fn a_place_is_that_of_its_direction() {
    let machine = machine(Sight::Axis);
    let unit = unit(&machine);
    let (one, probe) = (1 << 20, &mut NoProbe);
    let tap = &mut Tap::new(probe);
    for (direction, place) in [
        ([0, 0, -one], [one, one]),
        ([one, 0, 0], [2 * one, one]),
        ([0, -one, 0], [one, 0]),
        ([0, 0, one], [2 * one, 2 * one]),
        ([-1, -1, one], [0, 0]),
        ([0, 0, 0], [2 * one, 2 * one]),
    ] {
        let found = unit.place(direction, tap);
        assert!(
            found
                .iter()
                .zip(place)
                .all(|(found, place)| (found - place).abs() <= 64),
            "{direction:?}: {found:?} instead of {place:?}"
        );
    }
}

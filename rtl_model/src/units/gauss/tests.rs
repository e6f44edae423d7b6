//! Gauss: laws of a weight.

use super::*;
use crate::num::LANES;
use crate::num::lanes::Plain;
use crate::num::words::PlainWords;
use crate::probe::{NoProbe, Tap};
use proptest::prelude::*;

fn gauss(name: &str) -> (Machine, Gauss) {
    let machine = Machine::named(name).unwrap();
    let gauss = machine.elaborate().unwrap().gauss;
    (machine, gauss)
}

/// Radial index and weight from the kernel of eight lanes, with and without simple fits, compared
/// with the graph. Simple fits are for fragments, which are below the cutoff.
fn one(machine: &Machine, gauss: &Gauss, radial: i64, amplitude: i64) -> [i64; 2] {
    let probe = &mut NoProbe;
    let tap = &mut Tap::new(probe);
    let words = gauss.graph().one(&[radial, amplitude], tap);
    let kernel = gauss.kernel();
    assert_eq!(
        kernel
            .lanes::<false, _, _>(Plain([radial; LANES]), amplitude, tap)
            .map(|lanes| lanes.0[0]),
        words
    );
    let reach = machine.raster.radial.format.frac_bits + machine.raster.cutoff.format.int_bits;
    if kernel.is_simple() && radial >> reach == 0 {
        assert_eq!(
            kernel
                .lanes::<true, _, _>(Plain([radial; LANES]), amplitude, tap)
                .map(|lanes| lanes.0[0]),
            words
        );
    }
    if kernel.is_narrow() && radial <= 1 << 30 {
        let [radial, amplitude] = [radial, amplitude].map(|word| PlainWords([word as i32; LANES]));
        assert_eq!(
            i64::from(kernel.short().weight(radial, amplitude).0[0]),
            words[1],
            "in words of 32 bits"
        );
    }
    words
}

/// The amplitude, rounded to the weight's fraction bits, ties up.
fn most(machine: &Machine, amplitude: i64) -> i64 {
    let places = machine.ellipse.amplitude.format.frac_bits - machine.gauss.weight.format.frac_bits;
    ((2 * amplitude + (1 << places)) >> (places + 1)).min(machine.gauss.weight.format.max())
}

proptest! {
    #[test]
    fn a_weight_never_exceeds_its_amplitude(
        name in prop::sample::select(Machine::NAMES.to_vec()), radial in any::<u64>(), amplitude in any::<u64>(),
    ) {
        let (machine, gauss) = gauss(name);
        let register = machine.raster.radial.format;
        let radial = (radial as i64).rem_euclid(register.max() + 1);
        let amplitude = (amplitude as i64).rem_euclid(machine.ellipse.amplitude.format.max() + 1);
        let [radial_index, weight] = one(&machine, &gauss, radial, amplitude);
        prop_assert!((0..=most(&machine, amplitude)).contains(&weight));
        prop_assert!((0..=machine.gauss.radial_index.format.max()).contains(&radial_index));
    }
}

/// 32-bit kernels equal wide ones, on the machines that have them: for every possible r, in steps,
/// and for the last ones.
#[test]
fn words_of_32_bits_weigh_as_wide_ones_do() {
    for name in ["reference", "lean"] {
        let (machine, gauss) = gauss(name);
        assert!(gauss.kernel().is_narrow(), "{name} has no short form");
        let below = (1i64 << (machine.raster.radial.format.frac_bits + 2)).min(1 << 30);
        for radial in (0..=below)
            .step_by(below as usize / 10_000)
            .chain(below - 3..=below)
        {
            for amplitude in [0, 1, 12_345, machine.ellipse.amplitude.format.max()] {
                one(&machine, &gauss, radial, amplitude);
            }
        }
    }
}

#[test]
fn the_middle_of_a_splat_has_its_amplitude() {
    for name in Machine::NAMES {
        let (machine, gauss) = gauss(name);
        let amplitude = machine.ellipse.amplitude.format.max();
        let [radial_index, weight] = one(&machine, &gauss, 0, amplitude);
        assert_eq!(radial_index, 0);
        // The first word of a table without interpolation is the value at its first step's middle.
        assert!(
            most(&machine, amplitude) - weight <= most(&machine, amplitude) / 16,
            "{name}: full weight is {weight}"
        );
    }
}

/// A falloff is never clamped, so its fit needs no limits.
#[test]
fn a_falloff_never_exceeds_its_word() {
    for name in Machine::NAMES {
        let (machine, gauss) = gauss(name);
        for radial_index in 0..=machine.gauss.radial_index.format.max() {
            let loss = gauss
                .table()
                .fit()
                .loss(gauss.table().exact(radial_index), 0);
            assert!(
                !loss.saturated_low && !loss.saturated_high,
                "{name}: falloff at {radial_index}"
            );
        }
    }
}

/// One ulp of the register below the cutoff, which is the table's range: the last word, not the
/// first.
#[test]
fn just_below_the_cutoff_is_the_tables_end() {
    for name in Machine::NAMES {
        let (machine, gauss) = gauss(name);
        let format = machine.gauss.radial_index.format;
        let reach = 1 << (machine.raster.radial.format.frac_bits + format.int_bits);
        let amplitude = machine.ellipse.amplitude.format.max();
        let [radial_index, weight] = one(&machine, &gauss, reach - 1, amplitude);
        assert_eq!(radial_index, format.max(), "{name}");
        let value = machine.gauss.weight.format.value(weight);
        let exact = machine.ellipse.amplitude.format.value(amplitude)
            * (-f64::from(format.int_bits).exp2() / 2.0).exp();
        assert!(
            (value / exact - 1.0).abs() < 0.07,
            "{name}: {value} instead of {exact}"
        );
    }
}

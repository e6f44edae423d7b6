//! Does a weight beyond its reach never count, and does the last one within it? Every opacity and
//! every radial index of small formats, through the units.

use rtl_model::Machine;
use rtl_model::machine::{Interpolation, TableShape};
use rtl_model::num::{Format, Rounding, Word};
use rtl_model::pipeline::{Reach, unit_replay};
use rtl_model::probe::NoProbe;

fn unsigned(int_bits: i32, frac_bits: i32) -> Word {
    Word::new(Format::unsigned(int_bits, frac_bits)).rounded(Rounding::Nearest)
}

/// Machines of Gaussians with few bits: opacities finer and coarser than amplitudes and weights,
/// tables with and without interpolation.
fn machines() -> Vec<Machine> {
    let shapes = [
        (
            unsigned(1, 8),
            unsigned(1, 10),
            unsigned(4, 5),
            unsigned(1, 8),
            unsigned(1, 8),
            Interpolation::Linear,
        ),
        (
            unsigned(2, 10),
            unsigned(1, 8),
            unsigned(4, 4),
            unsigned(1, 10),
            unsigned(1, 9),
            Interpolation::Nearest,
        ),
        (
            unsigned(1, 6),
            unsigned(1, 12),
            unsigned(4, 7),
            unsigned(1, 12),
            unsigned(1, 12),
            Interpolation::Linear,
        ),
        (
            unsigned(1, 9),
            unsigned(1, 9),
            unsigned(3, 5),
            unsigned(1, 7),
            unsigned(1, 11),
            Interpolation::Nearest,
        ),
    ];
    let named = Machine::named("gaussian").unwrap();
    let of = |(opacity, amplitude, radial_index, falloff, weight, interpolation)| {
        let mut machine = named.clone();
        machine.splat.opacity = opacity;
        machine.ellipse.amplitude = amplitude;
        machine.ellipse.ellipsoid.as_mut().unwrap().reach_bits = Some(4);
        machine.gauss = rtl_model::machine::Gauss {
            radial_index,
            table: TableShape {
                index_bits: 4,
                interpolation,
            },
            falloff,
            weight,
        };
        machine
    };
    shapes.into_iter().map(of).collect()
}

#[test]
fn no_weight_beyond_its_reach_counts() {
    let mut seen = [0; 3];
    for machine in machines() {
        let elaborated = machine.elaborate().unwrap();
        let reach = Reach::new(&machine);
        let [opacity, amplitude, radial] = [
            machine.splat.opacity,
            machine.ellipse.amplitude,
            machine.gauss.radial_index,
        ]
        .map(|word| word.format);
        let more = machine.raster.radial.format.frac_bits - radial.frac_bits;
        // Amplitude of an opacity according to the specification of `ellipse`: the nearest word,
        // ties up.
        let peak = |word: i64| {
            let places = opacity.frac_bits - amplitude.frac_bits;
            let nearest = if places > 0 {
                (word + (1 << (places - 1))) >> places
            } else {
                word << -places
            };
            nearest.min(amplitude.max())
        };
        for least in [
            1,
            2,
            machine.gauss.weight.format.one() / 255 + 1,
            machine.gauss.weight.format.one() / 8,
        ] {
            let mut faintest = None;
            for word in 0..=opacity.one() {
                let weight = |radial: i64| {
                    unit_replay::gauss(&elaborated, [radial << more, peak(word)], &mut NoProbe)
                };
                let farthest = (0..=radial.max())
                    .filter(|radial| weight(*radial) >= least)
                    .max();
                assert_eq!(
                    reach.farthest(word, least),
                    farthest,
                    "{word} of {opacity}, least {least}"
                );
                if farthest.is_some() {
                    faintest = faintest.or(Some(word));
                }
                seen[usize::from(farthest.is_some())
                    + usize::from(farthest == Some(radial.max()))] += 1;
            }
            assert_eq!(
                reach.least_opacity(least),
                faintest.unwrap_or(opacity.one() + 1),
                "least {least}"
            );
        }
    }
    assert!(seen.iter().all(|count| *count > 20), "{seen:?}");
}

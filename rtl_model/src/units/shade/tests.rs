//! Shade: laws of the light that leaves a surface.

use super::lanes::Fragments;
use super::*;
use crate::kernels::host::{Kernel, unvectorised, vectorised};
use crate::num::{LANES, Lanes, Rounding, Word};
use crate::probe::{NoProbe, Ranges};
use proptest::prelude::*;

const UNLIT: u32 = 0;
const LIT: u32 = 1;

fn quantised(word: Word, value: f64) -> i64 {
    let format = word.format;
    ((value * f64::from(format.frac_bits).exp2()).round() as i64).clamp(format.min(), format.max())
}

/// A machine, its unit, and the frame's registers: one white light from the viewer's left, τ = 0.4.
struct Bench {
    machine: Machine,
    shade: Shade,
    lighting: Lighting,
    highlights: Vec<Option<Table>>,
}

fn bench(name: &str) -> Bench {
    bench_of(Machine::named(name).unwrap())
}

fn bench_of(machine: Machine) -> Bench {
    let shade = machine.elaborate().unwrap().shade;
    let m = &machine.shade;
    let towards = |x: f64, z: f64| [quantised(m.light, x), 0, quantised(m.light, z)];
    let steps = (1 << m.highlight_table.index_bits) as f64;
    let middle = if m.highlight_table.interpolation == crate::machine::Interpolation::Nearest {
        0.5
    } else {
        0.0
    };
    let lighting = Lighting {
        lights: vec![Light {
            direction: towards(-0.6, -0.8),
            half_way: Some(towards(-0.316_227_766, -0.948_683_298)),
        }],
        materials: vec![
            Material::Unlit,
            Material::BlinnPhong {
                ambient: quantised(m.reflectance, 0.2),
                diffuse: vec![[quantised(m.reflectance, 0.7); 3]],
                specular: vec![[quantised(m.reflectance, 0.25); 3]],
                highlight: (0..=steps as usize)
                    .map(|i| quantised(m.highlight, ((i as f64 + middle) / steps).powi(4)))
                    .collect(),
            },
        ],
    };
    let highlights = shade.highlights(&lighting);
    Bench {
        machine,
        shade,
        lighting,
        highlights,
    }
}

impl Bench {
    fn registers(&self) -> LightRegisters<'_> {
        LightRegisters {
            lighting: &self.lighting,
            highlights: &self.highlights,
            coverage_threshold: quantised(self.machine.fragment.weight_sum, 0.4),
            inverse_threshold: Scaled {
                mantissa: quantised(self.machine.shade.inverse_threshold, 0.625),
                places: -2,
            },
            surroundings: None,
        }
    }

    fn one(&self, input: &Input) -> Output {
        self.shade
            .one(&self.registers(), input, &mut Tap::new(&mut NoProbe))
    }

    /// Sums of a fragment of weight W, as a clean accumulation would leave them.
    fn input(
        &self,
        weight: f64,
        rgb: [f64; 3],
        opacity: f64,
        normal: [f64; 3],
        material: u32,
    ) -> Input {
        let f = &self.machine.fragment;
        Input {
            weight: quantised(f.weight_sum, weight),
            colour: rgb.map(|channel| quantised(f.colour_sum, weight * channel)),
            opacity: quantised(f.opacity_sum, weight * opacity),
            normal: normal.map(|n| quantised(f.normal_sum, weight * n)),
            material,
            pixel: [0; 2],
        }
    }

    fn colour(&self, output: &Output) -> [f64; 4] {
        let format = self.machine.shade.premultiplied.format;
        let [r, g, b] = output.colour;
        [r, g, b, output.opacity].map(|word| format.value(word))
    }

    /// Four last places of the coarsest word on the way, and what the sums' own last places leave
    /// of a thin weight.
    fn slack(&self, weight: f64) -> f64 {
        let (s, f) = (&self.machine.shade, &self.machine.fragment);
        let coarsest = [
            s.share,
            s.rgb,
            s.normal,
            s.cosine,
            s.highlight,
            s.reflectance,
            s.irradiance,
            s.colour,
            s.coverage,
            s.premultiplied,
        ];
        let place = coarsest
            .iter()
            .map(|word| word.format.value(1))
            .fold(0.0, f64::max);
        let tables = f64::from(s.reciprocal.table_bits * (1 << s.reciprocal.newton_steps))
            .exp2()
            .recip();
        4.0 * place + 2.0 * tables + 4.0 * f.colour_sum.format.value(1) / weight
    }
}

fn names() -> impl Strategy<Value = &'static str> {
    prop::sample::select(Machine::NAMES.to_vec())
}

fn unit_vector() -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(-1.0..1.0f64).prop_filter_map("too short", |v| {
        let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        (length > 0.2).then(|| v.map(|x| x / length))
    })
}

proptest! {
    #[test]
    fn white_stays_white(name in names(), weight in 0.05..4.0, normal in unit_vector()) {
        let bench = bench(name);
        let white = bench.one(&bench.input(weight, [1.0; 3], 1.0, normal, UNLIT));
        let opacity = (weight / 0.4).min(1.0);
        for channel in bench.colour(&white) {
            prop_assert!((channel - opacity).abs() <= bench.slack(weight), "{channel} instead of {opacity}");
        }
        // No channel outgrows the opacity that it is times.
        prop_assert!(white.colour.iter().all(|channel| *channel <= white.opacity));
    }

    #[test]
    fn an_unlit_colour_ignores_the_normal_and_the_weight(name in names(), weight in 0.4..4.0, rgb in prop::array::uniform3(0.0..1.0), normal in unit_vector()) {
        let bench = bench(name);
        let own = bench.colour(&bench.one(&bench.input(weight, rgb, 1.0, normal, UNLIT)));
        for channel in 0..3 {
            prop_assert!((own[channel] - rgb[channel]).abs() <= bench.slack(weight));
        }
    }

    /// A normal across the line of sight is left out: its last place decides to which side it is
    /// turned.
    #[test]
    fn shading_ignores_the_length_of_a_normal(name in names(), normal in unit_vector().prop_filter("seen from the side", |normal| normal[2].abs() > 0.1), length in 0.3..1.0) {
        let bench = bench(name);
        let shaded = |length: f64| bench.colour(&bench.one(&bench.input(1.0, [0.8, 0.5, 0.3], 1.0, normal.map(|n| n * length), LIT)));
        let (long, short) = (shaded(1.0), shaded(length));
        for channel in 0..4 {
            prop_assert!((long[channel] - short[channel]).abs() <= 2.0 * bench.slack(0.3), "{long:?} and {short:?}");
        }
    }

    /// Blinn-Phong in real numbers, by the formula of docs/book/algorithm-resolve.md §7.
    #[test]
    fn a_lit_colour_is_blinn_and_phongs(name in names(), normal in unit_vector(), weight in 0.5..3.0, rgb in prop::array::uniform3(0.0..1.0)) {
        let bench = bench(name);
        let n = if normal[2] > 0.0 { normal.map(|n| -n) } else { normal };
        let cosine = |v: [f64; 3]| (n[0] * v[0] + n[2] * v[2]).max(0.0);
        let (towards, half_way) = (cosine([-0.6, 0.0, -0.8]), cosine([-0.316_227_766, 0.0, -0.948_683_298]));
        let own = bench.colour(&bench.one(&bench.input(weight, rgb, 1.0, normal, LIT)));
        // A normal near the screen's plane may flip either way.
        if normal[2].abs() > 0.05 {
            // The tiny machine's highlight table has 64 steps and a slope of 4.
            let table = f64::from(bench.machine.shade.highlight_table.index_bits).exp2().recip();
            let bound = 4.0 * bench.slack(weight) + if name == "tiny" { 4.0 * table * 0.25 } else { 0.0 };
            for channel in 0..3 {
                let exact = (rgb[channel] * (0.2 + 0.7 * towards) + 0.25 * half_way.powi(4)).min(1.0);
                prop_assert!((own[channel] - exact).abs() <= bound, "{} instead of {exact}, bound {bound}", own[channel]);
            }
        }
    }

    #[test]
    fn a_thin_fragment_covers_in_proportion(name in names(), weight in 0.05..0.4, opacity in 0.1..1.0) {
        let bench = bench(name);
        let own = bench.colour(&bench.one(&bench.input(weight, [0.5; 3], opacity, [0.0; 3], UNLIT)));
        let exact = opacity * weight / 0.4;
        prop_assert!((own[3] - exact).abs() <= bench.slack(weight), "{} instead of {exact}", own[3]);
        prop_assert!((own[0] - 0.5 * exact).abs() <= bench.slack(weight));
    }
}

#[test]
fn normals_that_cancel_leave_ambient_light_alone() {
    for name in Machine::NAMES {
        let bench = bench(name);
        let own = bench.colour(&bench.one(&bench.input(1.0, [1.0, 0.5, 0.0], 1.0, [0.0; 3], LIT)));
        for (own, exact) in own.into_iter().zip([0.2, 0.1, 0.0, 1.0]) {
            assert!(
                (own - exact).abs() <= bench.slack(1.0),
                "{name}: {own} instead of {exact}"
            );
        }
    }
}

#[test]
fn no_weight_is_no_light() {
    for name in Machine::NAMES {
        let bench = bench(name);
        let input = Input {
            weight: 0,
            ..bench.input(1.0, [1.0; 3], 1.0, [0.0, 0.0, -1.0], LIT)
        };
        assert_eq!(bench.one(&input), Output::default());
    }
}

/// Eight fragments on lanes, the first few of them looked at.
struct Eight<'a, P> {
    bench: &'a Bench,
    inputs: &'a [Input; LANES],
    live: u8,
    probe: &'a mut P,
}

impl<P: Probe> Kernel for Eight<'_, P> {
    type Output = [Output; LANES];

    #[inline(always)]
    fn run<L: Lanes>(self) -> [Output; LANES] {
        let tap = &mut Tap::new(self.probe);
        tap.live = self.live;
        let fragments = Fragments::<L::Words>::of(self.inputs);
        self.bench
            .shade
            .lanes(
                &self.bench.registers(),
                self.inputs[0].material,
                fragments,
                tap,
            )
            .outputs()
    }
}

/// A named machine, some of its words rounded otherwise, coarser, or as narrow as they can be.
fn oddly_worded() -> impl Strategy<Value = Machine> {
    (names(), 0..6usize, 0..14usize).prop_map(|(name, change, which)| {
        let mut machine = Machine::named(name).unwrap();
        let m = &mut machine.shade;
        let words = [
            &mut m.share,
            &mut m.normal_share,
            &mut m.rgb,
            &mut m.opacity,
            &mut m.normal,
            &mut m.light,
            &mut m.cosine,
            &mut m.highlight,
            &mut m.reflectance,
            &mut m.irradiance,
            &mut m.colour,
            &mut m.inverse_threshold,
            &mut m.coverage,
            &mut m.premultiplied,
        ];
        let word = words.into_iter().nth(which).unwrap();
        match change {
            0 => *word = word.rounded(Rounding::NearestEven),
            1 => *word = word.rounded(Rounding::Truncate),
            2 => word.format.frac_bits = 2,
            3 => word.format.frac_bits = 0,
            _ => {}
        }
        machine
    })
}

/// Sums of all sizes: of nothing, of a last place, as clean accumulations leave them, and any words
/// at all.
fn sums(machine: &Machine) -> impl Strategy<Value = Input> + use<> {
    let f = machine.fragment;
    let clean = (
        0.0..4.0f64,
        unit_vector(),
        prop::array::uniform4(0.0..1.0f64),
        0..6u32,
    );
    (clean, any::<[u32; 8]>()).prop_map(move |((weight, normal, [r, g, b, opacity], kind), any)| {
        let words = [
            f.weight_sum,
            f.colour_sum,
            f.colour_sum,
            f.colour_sum,
            f.opacity_sum,
            f.normal_sum,
            f.normal_sum,
            f.normal_sum,
        ];
        let of: [i64; 8] = match kind {
            0 => [0; 8],
            1 => std::array::from_fn(|i| i64::from(any[i] % 3)),
            2 => std::array::from_fn(|i| {
                let format = words[i].format;
                format.min() + i64::from(any[i]) % (format.max() - format.min() + 1)
            }),
            _ => {
                let [x, y, z] = if kind == 3 { [0.0; 3] } else { normal };
                let values = [1.0, r, g, b, opacity, x, y, z];
                std::array::from_fn(|i| quantised(words[i], values[i] * weight))
            }
        };
        Input {
            weight: of[0],
            colour: [of[1], of[2], of[3]],
            opacity: of[4],
            normal: [of[5], of[6], of[7]],
            material: 0,
            pixel: [0; 2],
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// What comes out, and what ranges see of it, on vectors and without.
    #[test]
    fn eight_fragments_are_shaded_as_each_alone(
        (machine, inputs, material, count) in oddly_worded().prop_flat_map(|machine| {
            let inputs = prop::array::uniform8(sums(&machine));
            (Just(machine), inputs, 0..2u32, 1..=LANES)
        })
    ) {
        let Ok(elaborated) = machine.elaborate() else { return Ok(()) };
        let narrow = elaborated.fragment.is_narrow();
        prop_assert!(narrow || machine.name != "reference");
        let bench = bench_of(machine);
        let inputs = inputs.map(|input| Input { material, ..input });
        let mut ranges = Ranges::new(elaborated.signals.len());
        let alone: Vec<Output> =
            inputs[..count].iter().map(|input| bench.shade.one(&bench.registers(), input, &mut Tap::new(&mut ranges))).collect();
        let live = (0xff_u32 >> (LANES - count)) as u8;
        let mut seen = [(); 2].map(|()| Ranges::new(elaborated.signals.len()));
        let [first, second] = &mut seen;
        let forms = [
            vectorised(Eight { bench: &bench, inputs: &inputs, live, probe: &mut NoProbe }),
            unvectorised(Eight { bench: &bench, inputs: &inputs, live, probe: &mut NoProbe }),
            vectorised(Eight { bench: &bench, inputs: &inputs, live, probe: first }),
            unvectorised(Eight { bench: &bench, inputs: &inputs, live, probe: second }),
        ];
        for (form, outputs) in forms.iter().enumerate() {
            prop_assert_eq!(&outputs[..count], &alone[..], "form {}", form);
        }
        for seen in &seen {
            prop_assert_eq!(seen, &ranges);
        }
    }
}

use super::*;
use crate::frame::{Aspect, Light, Lighting, Material, Scaled, View};
use crate::kernels::host::{unvectorised, vectorised};
use crate::machine::{self, Machine};
use crate::num::Word;
use crate::num::lanes::Plain;
use crate::probe::{NoProbe, Ranges};
use proptest::prelude::*;

/// A word of a format, often one of its ends, 0 or 1.
fn word(of: Word, seed: u64) -> i64 {
    let (least, most) = (of.format.min(), of.format.max());
    match seed % 16 {
        0 => least,
        1 => most,
        2 => 0,
        3 => of.format.one().min(most),
        // Small ones, as for splats near the middle.
        4..9 => (least + (seed / 16 % (most - least + 1) as u64) as i64) / (1 << (seed / 7 % 20)),
        _ => least + (seed / 16 % (most - least + 1) as u64) as i64,
    }
}

/// Results for eight splats: the cull reason of each, or all its words.
fn kept<W: Words>(made: Made<W>, splats: usize) -> impl Iterator<Item = Vec<i32>> {
    let Made {
        culled,
        pixel,
        depth,
        conic,
        depth_slope,
        depth_range,
        sides,
        amplitude,
        normal,
    } = made;
    let culled = culled.map(Words::to_array);
    let others = [
        &pixel[..],
        &[depth],
        &conic,
        &depth_slope,
        &[depth_range],
        sides.as_flattened(),
        &[amplitude],
        &normal,
    ]
    .concat();
    let others: Vec<[i32; LANES]> = others.into_iter().map(Words::to_array).collect();
    (0..splats).map(
        move |lane| match culled.iter().position(|reason| reason[lane] != 0) {
            Some(reason) => vec![reason as i32],
            None => others.iter().map(|words| words[lane]).collect(),
        },
    )
}

/// Results of the graphs.
fn by_graphs<P: Probe>(stages: &mut Stages, splats: &[Splat], probe: &mut P) -> Vec<Vec<i32>> {
    stages.set_up(splats, 0, None, probe, &mut Block::of(splats.len()));
    let eights = splats.chunks(LANES).enumerate();
    eights
        .flat_map(|(row, splats)| kept(stages.made::<<Plain as Lanes>::Words>(row), splats.len()))
        .collect()
}

/// Results of the host's kernel.
struct ByKernel<'a>(&'a Elaborated, &'a Frame);

impl Kernel for ByKernel<'_> {
    type Output = Vec<Vec<i32>>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Self::Output {
        let ByKernel(machine, frame) = self;
        let discs = machine.discs.as_ref().unwrap();
        let mut all = Vec::new();
        for given in frame.splats.chunks(LANES) {
            let mut eight = [Splat::default(); LANES];
            eight[..given.len()].copy_from_slice(given);
            let made = discs.set_up::<L::Words>(&frame.view, [frame.width, frame.height], &eight);
            all.extend(kept(made, given.len()));
        }
        all
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn discs_are_set_up_as_by_their_graphs(
        name in prop::sample::select(Machine::NAMES.to_vec()),
        seeds in prop::collection::vec(prop::array::uniform7(any::<u64>()), 1..=BATCH),
        registers in prop::array::uniform32(any::<u64>()),
        has_aspect: bool, cull_backfaces: bool,
    ) {
        let machine = Machine::named(name).unwrap().elaborate().unwrap();
        let (p, m, s) = (machine.machine.project, machine.machine.ellipse, machine.machine.splat);
        let mut seed = registers.into_iter();
        let mut register = |of: Word| word(of, seed.next().unwrap_or(0));
        let rotation = [[(); 3]; 3].map(|row| row.map(|()| register(p.rotation)));
        let eye = [(); 3].map(|()| register(p.eye));
        let mut natural = |of: Word| register(of).max(1);
        let scaled = |mantissa: i64| Scaled { mantissa, places: 9 };
        let view = View {
            rotation,
            eye,
            near: natural(p.depth) / 256,
            guard: [natural(p.slope), natural(p.slope)],
            focal: natural(p.focal),
            inverse_focal: scaled(natural(m.inverse_focal)),
            centre: [natural(p.pixel) / 16, natural(p.pixel) / 16],
            low_pass: natural(m.low_pass),
            cutoff: natural(machine.machine.raster.cutoff),
            root_cutoff: natural(m.root_cutoff),
            aspect: m.aspect.filter(|_| has_aspect).map(|aspect| Aspect {
                focal: [natural(p.focal), natural(p.focal)],
                squares: [natural(aspect), natural(aspect), natural(aspect)],
                inverse_focal: [scaled(natural(m.inverse_focal)), scaled(natural(m.inverse_focal))],
            }),
            cull_backfaces,
        };
        let splats: Vec<Splat> = seeds.iter().map(|seeds| {
            let [x, y, z, n, o, r, radius] = *seeds;
            Splat {
                position: [x, y, z].map(|seed| word(s.position, seed) as i32),
                normal: [n, o, r].map(|seed| word(s.normal, seed) as i32),
                radius: word(s.radius, radius) as i32,
                ..Splat::default()
            }
        }).collect();
        let frame = Frame { width: 640, height: 480, view, splats, ..Frame::default() };
        let mut stages = Stages::new(&machine, &frame);
        let expected = by_graphs(&mut stages, &frame.splats, &mut Ranges::new(machine.signals.len()));
        prop_assert_eq!(&unvectorised(ByKernel(&machine, &frame)), &expected);
        prop_assert_eq!(&vectorised(ByKernel(&machine, &frame)), &expected);
        // Unobserved, in rows that were used before.
        prop_assert_eq!(&by_graphs(&mut stages, &frame.splats, &mut NoProbe), &expected);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// Of several materials, with normals of any words, and with dead lanes.
    #[test]
    fn eight_splats_are_lit_as_each_alone(
        name in prop::sample::select([Machine::ELLIPSOID_NAMES.as_slice(), Machine::WINDOW_NAMES.as_slice()].concat()),
        seeds in prop::collection::vec(prop::array::uniform6(any::<u64>()), 1..=LANES),
        materials in prop::array::uniform8(0..3u32),
        live: u8,
        registers in prop::array::uniform32(any::<u64>()),
    ) {
        let machine = Machine::named(name).unwrap().elaborate().unwrap();
        prop_assert!(machine.fragment.has_narrow_sums(), "{} has sums of more than 32 bits", name);
        let (m, s) = (machine.machine.shade, machine.machine.splat);
        let mut seed = registers.into_iter();
        let mut register = |of: Word| word(of, seed.next().unwrap_or(0));
        let lights = [(); 2].map(|()| Light {
            direction: [(); 3].map(|()| register(m.light)),
            half_way: Some([(); 3].map(|()| register(m.light))),
        });
        let mut shining = |ambient: u64| Material::BlinnPhong {
            ambient: word(m.reflectance, ambient),
            diffuse: vec![[(); 3].map(|()| register(m.reflectance)); lights.len()],
            specular: vec![[(); 3].map(|()| register(m.reflectance)); lights.len()],
            highlight: (0..=1u64 << m.highlight_table.index_bits).map(|i| word(m.highlight, 4 + 16 * i)).collect(),
        };
        let materials_of_frame = vec![Material::Unlit, shining(3), shining(4)];
        let frame = Frame {
            lighting: Lighting { lights: lights.to_vec(), materials: materials_of_frame },
            ..Frame::default()
        };
        let splats: Vec<Splat> = seeds.iter().zip(materials).map(|(seeds, material)| Splat {
            rgb: [0, 1, 2].map(|i| word(s.rgb, seeds[i]) as i32),
            material,
            ..Splat::default()
        }).collect();
        let mut normals = [[0; LANES]; 3];
        for (lane, seeds) in seeds.iter().enumerate() {
            (0..3).for_each(|axis| normals[axis][lane] = word(machine.machine.ellipse.normal, seeds[3 + axis]) as i32);
        }
        let mut rgb = [[0; LANES]; 3];
        for (lane, splat) in splats.iter().enumerate() {
            (0..3).for_each(|channel| rgb[channel][lane] = splat.rgb[channel]);
        }
        let live = live & ((1u32 << splats.len()) - 1) as u8;
        let lit = Lit::new(&machine, &frame);
        let registers = shade::LightRegisters::of(&frame, &lit.highlights);
        let mut alone = Ranges::new(machine.signals.len());
        let mut expected = [[0; LANES]; 3];
        for (lane, splat) in splats.iter().enumerate().filter(|(lane, _)| live >> lane & 1 != 0) {
            let sent = (splat.material, splat.rgb, normals.map(|part| part[lane]));
            let light = lit.emission(&registers, sent, 0, &mut alone);
            (0..3).for_each(|channel| expected[channel][lane] = light[channel]);
        }
        let only_live = |light: [[i32; LANES]; 3]| {
            light.map(|channel| std::array::from_fn(|lane| if live >> lane & 1 != 0 { channel[lane] } else { 0 }))
        };
        let mut seen = Ranges::new(machine.signals.len());
        prop_assert_eq!(only_live(lit.emissions(&splats, rgb, 0, normals, live, &mut seen)), expected);
        prop_assert_eq!(only_live(lit.emissions(&splats, rgb, 0, normals, live, &mut NoProbe)), expected);
        prop_assert_eq!(&seen, &alone);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Of frames of any degree up to the unit's, on several batches, with culled splats between.
    #[test]
    fn a_batch_has_the_colours_of_single_splats(
        of_unit in 1..=3u32, of_frame in 1..=3u32, count in 1..2 * BATCH + 3, seeds in prop::array::uniform32(any::<u64>()),
    ) {
        let harmonics = of_frame.min(of_unit);
        let named = Machine::named("gaussian").unwrap();
        let colour = named.colour.map(|colour| machine::Colour { degree: of_unit, ..colour });
        let machine = Machine { colour, ..named }.elaborate().unwrap();
        let (words, m) = (machine.machine.colour.unwrap(), &machine.machine);
        let mut seed = seeds[0];
        let mut next = |of: Word| {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(seeds[(seed >> 40) as usize % 32] | 1);
            word(of, seed >> 20)
        };
        let splats: Vec<Splat> = (0..count).map(|_| Splat {
            position: [(); 3].map(|()| next(m.splat.position) as i32),
            radius: m.splat.radius.format.one().min(m.splat.radius.format.max()) as i32 / 8,
            opacity: m.splat.opacity.format.one() as i32 / 2,
            ..Splat::default()
        }).collect();
        let unit = machine.colour.as_ref().unwrap();
        let stride = coefficients(harmonics);
        let given: Vec<[i32; 3]> = (0..stride * count).map(|_| [(); 3].map(|()| next(words.coefficient) as i32)).collect();
        let one = |of: Word| of.format.one().min(of.format.max());
        let frame = Frame {
            width: 64,
            height: 64,
            view: View {
                rotation: std::array::from_fn(|row| std::array::from_fn(|column| if row == column { one(m.project.rotation) } else { 0 })),
                eye: [0, 0, -2 * one(m.project.eye)],
                near: 1,
                guard: [one(m.project.slope); 2],
                focal: 32 << m.project.focal.format.frac_bits,
                inverse_focal: Scaled { mantissa: one(m.ellipse.inverse_focal) / 2, places: 4 },
                low_pass: one(m.ellipse.low_pass) / 4,
                cutoff: 9 << m.raster.cutoff.format.frac_bits,
                root_cutoff: 3 << m.ellipse.root_cutoff.format.frac_bits,
                ..View::default()
            },
            ellipsoids: Some(Ellipsoids {
                kernel: crate::frame::Kernel {
                    amplitude: crate::frame::Amplitude::Peak,
                    jacobian: [one(m.project.slope); 2],
                    axes: std::array::from_fn(|row| std::array::from_fn(|column| if row == column { one(m.ellipse.normal) } else { 0 })),
                    scales: [one(m.ellipse.ellipsoid.unwrap().scale); 3],
                    ..crate::frame::Kernel::default()
                },
                harmonics: harmonics as u8,
                coefficients: given.clone(),
                ..Ellipsoids::default()
            }),
            splats,
            ..Frame::default()
        };
        let mut seen = Ranges::new(machine.signals.len());
        let setup = set_up(&machine, &frame, &mut seen);
        let mut alone = Ranges::new(machine.signals.len());
        let (records, colours) = (setup.blocks.concat(), setup.colours.concat());
        prop_assert_eq!(records.len(), colours.len());
        for (record, colour) in records.iter().zip(colours) {
            let at = record.splat as usize;
            let own = given[at * stride..][..stride].iter().flatten().map(|word| i64::from(*word));
            let inputs: Vec<i64> = frame.splats[at].position.map(i64::from).into_iter()
                .chain(frame.view.eye).chain(own).chain([0; 48]).collect();
            let expected = unit.graph().one(&inputs, &mut Tap::new(&mut alone));
            prop_assert_eq!(colour.map(i64::from), expected, "splat {} of {}", at, count);
        }
        // Its words are counted for the splats that are drawn, and for no others.
        let of_colour = |ranges: &Ranges| format!("{:?}", machine.signals.iter().zip(&ranges.0)
            .filter(|(signal, _)| signal.unit == "colour").map(|(_, summary)| summary).collect::<Vec<_>>());
        prop_assert_eq!(of_colour(&seen), of_colour(&alone));
        prop_assert_eq!(set_up(&machine, &frame, &mut NoProbe).colours, setup.colours);
    }
}

//! Shade's bound against docs/book/algorithm-resolve.md §7 in f64, and the integer unit on words.

use super::super::{Input, LightRegisters};
use super::*;
use crate::Machine;
use crate::frame::{self, Scaled};
use crate::functions::Table;
use crate::machine::Interpolation;
use crate::num::Word;
use crate::probe::{NoProbe, Tap};
use crate::real::tests::{Rng, Use, held, quantised, used};
use crate::real::{Near, power_of_two};

/// What a frame says of light, in real numbers.
struct Scene {
    lights: Vec<([f64; 3], [f64; 3])>,
    lit: bool,
    ambient: f64,
    diffuse: f64,
    specular: f64,
    shininess: f64,
    threshold: f64,
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    let length = dot(v, v).sqrt();
    (length > 0.0).then(|| v.map(|x| x / length))
}

impl Scene {
    fn random(rng: &mut Rng) -> Self {
        let direction = |rng: &mut Rng| {
            if rng.below(3) > 0 {
                rng.unit_vector()
            } else {
                [0.0, 0.0, -1.0]
            }
        };
        let lights = (0..rng.below(4))
            .map(|_| (direction(rng), [0; 3].map(|_| rng.channel())))
            .collect();
        Scene {
            lights,
            lit: rng.below(3) > 0,
            ambient: rng.between(0.0, 0.5),
            diffuse: rng.channel(),
            specular: rng.between(0.0, 0.6),
            shininess: rng.one_of(&[0.0, 0.5, 1.0, 2.0, 7.5, 32.0, 200.0]),
            threshold: rng.between(0.05, 1.0),
        }
    }

    /// docs/book/algorithm-resolve.md §7, of a fragment's means.
    fn exact(&self, weight: f64, rgb: [f64; 3], opacity: f64, normal: [f64; 3]) -> [f64; 4] {
        if weight == 0.0 {
            return [0.0; 4];
        }
        let facing = unit(normal).map(|n| if n[2] > 0.0 { n.map(|x| -x) } else { n });
        let mut colour = rgb;
        if self.lit {
            for (channel, colour) in colour.iter_mut().enumerate() {
                let (mut irradiance, mut gloss) = (self.ambient, 0.0);
                for (direction, light) in self.lights.iter().filter(|_| facing.is_some()) {
                    let half_way = unit([direction[0], direction[1], direction[2] - 1.0]);
                    let cosine = |v: [f64; 3]| facing.map_or(0.0, |n| dot(n, v).max(0.0));
                    irradiance += self.diffuse * cosine(*direction) * light[channel];
                    gloss += half_way.map_or(0.0, |h| {
                        self.specular * cosine(h).min(1.0).powf(self.shininess) * light[channel]
                    });
                }
                *colour = (*colour * irradiance + gloss).clamp(0.0, 1.0);
            }
        }
        let covered = opacity * (weight / self.threshold).min(1.0);
        [
            colour[0] * covered,
            colour[1] * covered,
            colour[2] * covered,
            covered,
        ]
    }
}

/// A machine's unit with a scene in its registers, on both sides.
struct Bench {
    machine: Machine,
    shade: Shade,
    words: frame::Lighting,
    tables: Vec<Option<Table>>,
    threshold: i64,
    inverse: Scaled,
    lighting: Lighting<Near>,
}

impl Bench {
    fn new(machine: Machine, scene: &Scene) -> Self {
        let shade = machine.elaborate().unwrap().shade;
        let m = machine.shade;
        let vector = |word: Word, v: [f64; 3]| {
            let [x, y, z] = v.map(|x| held(word, x));
            ([x.0, y.0, z.0], [x.1, y.1, z.1])
        };
        let (mut lights, mut bounds) = (Vec::new(), Vec::new());
        for (direction, _) in &scene.lights {
            let half_way =
                unit([direction[0], direction[1], direction[2] - 1.0]).map(|h| vector(m.light, h));
            let direction = vector(m.light, *direction);
            lights.push(frame::Light {
                direction: direction.0,
                half_way: half_way.map(|h| h.0),
            });
            bounds.push(Light {
                direction: direction.1,
                half_way: half_way.map(|h| h.1),
            });
        }
        let factors = |factor: f64| -> (Vec<[i64; 3]>, Vec<[Near; 3]>) {
            scene
                .lights
                .iter()
                .map(|(_, light)| vector(m.reflectance, light.map(|channel| factor * channel)))
                .unzip()
        };
        let (ambient, diffuse, specular) = (
            held(m.reflectance, scene.ambient),
            factors(scene.diffuse),
            factors(scene.specular),
        );
        let steps = f64::from(m.highlight_table.index_bits).exp2();
        let middle = if m.highlight_table.interpolation == Interpolation::Nearest {
            0.5
        } else {
            0.0
        };
        let power = |i: i64| {
            quantised(
                m.highlight,
                ((i as f64 + middle) / steps).powf(scene.shininess),
            )
        };
        let highlight: Vec<i64> = (0..=steps as i64).map(power).collect();
        let places = (1.0 / scene.threshold).log2().floor() as i64 + 1;
        let mantissa = quantised(
            m.inverse_threshold,
            (1.0 / scene.threshold) * power_of_two(-places as i32),
        );
        let inverse = Scaled {
            mantissa,
            places: -places,
        };
        let (threshold, coverage_threshold) = held(machine.fragment.weight_sum, scene.threshold);
        let curve = shade.power(&highlight, scene.shininess);
        let (words, bounds) = if scene.lit {
            let materials = vec![frame::Material::BlinnPhong {
                ambient: ambient.0,
                diffuse: diffuse.0,
                specular: specular.0,
                highlight,
            }];
            let bound = Material::BlinnPhong {
                ambient: ambient.1,
                diffuse: diffuse.1,
                specular: specular.1,
                highlight: curve,
            };
            ((lights, materials), (bounds, vec![bound]))
        } else {
            (
                (lights, vec![frame::Material::Unlit]),
                (bounds, vec![Material::Unlit]),
            )
        };
        let words = frame::Lighting {
            lights: words.0,
            materials: words.1,
        };
        Bench {
            tables: shade.highlights(&words),
            words,
            threshold,
            inverse,
            lighting: Lighting {
                lights: bounds.0,
                materials: bounds.1,
                coverage_threshold,
                inverse_threshold: Near::held_scaled(
                    1.0 / scene.threshold,
                    m.inverse_threshold,
                    inverse,
                ),
                surroundings: None,
            },
            shade,
            machine,
        }
    }

    fn registers(&self) -> LightRegisters<'_> {
        LightRegisters {
            lighting: &self.words,
            highlights: &self.tables,
            coverage_threshold: self.threshold,
            inverse_threshold: self.inverse,
            surroundings: None,
        }
    }

    /// What the machine makes of sums.
    fn one(&self, input: &Input) -> [f64; 4] {
        let out = self
            .shade
            .one(&self.registers(), input, &mut Tap::new(&mut NoProbe));
        let [r, g, b] = out.colour;
        [r, g, b, out.opacity].map(|word| self.machine.shade.premultiplied.format.value(word))
    }

    /// Sums that are a few places off.
    fn input(&self, rng: &mut Rng, means: &Means) -> Input {
        let f = &self.machine.fragment;
        let off = rng.one_of(&[0, 0, 1, 20]);
        let mut sum = |word: Word, mean: f64| {
            let off = rng.below(2 * off + 1) as i64 - off as i64;
            (quantised(word, means.weight * mean) + off).clamp(word.format.min(), word.format.max())
        };
        Input {
            weight: sum(f.weight_sum, 1.0),
            colour: means.rgb.map(|mean| sum(f.colour_sum, mean)),
            opacity: sum(f.opacity_sum, means.opacity),
            normal: means.normal.map(|mean| sum(f.normal_sum, mean)),
            material: 0,
            pixel: [0; 2],
        }
    }

    /// The same sums as means, with the error that they have, or a wider bound.
    fn sums(&self, rng: &mut Rng, means: &Means, input: &Input) -> Sums<Near> {
        let f = &self.machine.fragment;
        let wider = rng.one_of(&[1.0, 1.0, 1.0, 2.0, 50.0]);
        let weight = f.weight_sum.format.value(input.weight);
        let mean = |word: Word, sum: i64, mean: f64| {
            let error = if weight > 0.0 {
                word.format.value(sum) / weight - mean
            } else {
                0.0
            };
            Near::within(mean, wider * error)
        };
        Sums {
            weight: Near::within(means.weight, wider * (weight - means.weight)),
            rgb: std::array::from_fn(|i| mean(f.colour_sum, input.colour[i], means.rgb[i])),
            opacity: mean(f.opacity_sum, input.opacity, means.opacity),
            normal: std::array::from_fn(|i| mean(f.normal_sum, input.normal[i], means.normal[i])),
            material: 0,
            at: [0.0; 2],
        }
    }
}

/// A fragment, exactly.
#[derive(Debug)]
struct Means {
    weight: f64,
    rgb: [f64; 3],
    opacity: f64,
    normal: [f64; 3],
}

impl Means {
    fn random(rng: &mut Rng, scene: &Scene) -> Self {
        let spread = rng.between(-12.0, 5.0).exp2();
        let near_one = rng.between(0.5, 2.0);
        let weight = rng.one_of(&[spread, near_one, scene.threshold, 0.0]);
        if weight == 0.0 {
            return Means {
                weight,
                rgb: [0.0; 3],
                opacity: 0.0,
                normal: [0.0; 3],
            };
        }
        let length = rng.one_of(&[1.0, 1.0, 0.3, 1e-3, 1e-6, 0.0]);
        let mut normal = rng.unit_vector().map(|part| part * length);
        // Edge on, nearly or exactly; or straight at the first light's highlight.
        match (rng.below(8), scene.lights.first()) {
            (0, _) => normal[2] = rng.one_of(&[0.0, 1e-4, -1e-4, -1e-6]),
            (1, Some((direction, _))) => {
                normal = unit([direction[0], direction[1], direction[2] - 1.0]).unwrap()
            }
            _ => {}
        }
        Means {
            weight,
            rgb: [0; 3].map(|_| rng.channel()),
            opacity: rng.channel(),
            normal,
        }
    }
}

/// Any machine, any light, any fragment.
#[test]
fn shading_is_within_its_bound() {
    for seed in 0..800 {
        let rng = &mut Rng::new(seed);
        let scene = Scene::random(rng);
        let bench = Bench::new(rng.machine(), &scene);
        for _ in 0..40 {
            let means = Means::random(rng, &scene);
            let input = bench.input(rng, &means);
            let bound = bench
                .shade
                .real(&bench.lighting, &bench.sums(rng, &means, &input));
            let exact = scene.exact(means.weight, means.rgb, means.opacity, means.normal);
            let own = bench.one(&input);
            for channel in 0..4 {
                assert!(bound[channel].error.is_finite());
                used(
                    own[channel],
                    exact[channel],
                    bound[channel],
                    &(seed, channel, &means),
                );
            }
        }
    }
}

/// All steps at once, on the named machines, of sums that are right to their last place: unlit and
/// lit. Worst 0.86 to 0.93, where few of the roundings are more than nothing; typically 0.12 to
/// 0.17: six or more of them seldom all go the same way.
#[test]
fn the_bound_of_shading_is_tight() {
    for name in Machine::NAMES {
        // A bound of less than a place is one that 0 or 1 cuts short: too easily reached.
        let place = Machine::named(name)
            .unwrap()
            .shade
            .premultiplied
            .format
            .value(1);
        let mut uses = [Use::default(); 2];
        for seed in 0..400 {
            let rng = &mut Rng::new(seed);
            let scene = Scene::random(rng);
            let bench = Bench::new(Machine::named(name).unwrap(), &scene);
            for _ in 0..100 {
                let means = Means {
                    weight: rng.between(-2.0, 2.0).exp2(),
                    normal: rng.unit_vector(),
                    ..Means::random(rng, &scene)
                };
                let input = bench.input(&mut Rng::new(0), &means);
                let bound = bench.shade.real(
                    &bench.lighting,
                    &bench.sums(&mut Rng::new(0), &means, &input),
                );
                let exact = scene.exact(means.weight, means.rgb, means.opacity, means.normal);
                let own = bench.one(&input);
                for channel in 0..4 {
                    let used = used(own[channel], exact[channel], bound[channel], &means);
                    if bound[channel].error > place {
                        uses[usize::from(scene.lit)].add(used);
                    }
                }
            }
        }
        assert!(
            uses.iter().all(|of| of.is_tight(0.7, 0.1)),
            "{name}: {uses:?}"
        );
    }
}

/// Each step by itself, from sums without error. Worst of reference, lean and tiny: normalisation
/// 0.99, 0.98, 0.95; coverage 1 on each; N·L 0.53, 0.53, 0.43; highlight 0.93, 0.90, 0.60.
/// Typically 0.27, 0.14, 0.03, 0.08.
///
/// N·L is the loosest: at once the three parts of N and of L are rounded, and N by its reciprocal
/// root, which seldom is as wrong as it can be.
#[test]
fn the_bound_of_each_step_is_tight() {
    let add = |u: &mut Use, own: f64, bound: Near, what: &str| {
        u.add(used(own, bound.value, bound, &what))
    };
    for name in Machine::NAMES {
        let mut uses = [Use::default(); 4];
        for seed in 0..40 {
            let rng = &mut Rng::new(seed);
            let scene = Scene {
                lit: true,
                lights: vec![(rng.unit_vector(), [1.0; 3])],
                shininess: 16.0,
                ..Scene::random(rng)
            };
            let bench = Bench::new(Machine::named(name).unwrap(), &scene);
            let (shade, f, registers) = (&bench.shade, &bench.machine.fragment, bench.registers());
            let mut unwatched = NoProbe;
            let tap = &mut Tap::new(&mut unwatched);
            for _ in 0..500 {
                let weight = quantised(f.weight_sum, rng.between(-3.0, 3.0).exp2()).max(1);
                let part = rng.part();
                let colour = (part * weight as f64) as i64;
                let sums = rng
                    .unit_vector()
                    .map(|part| quantised(f.normal_sum, part * f.weight_sum.format.value(weight)));
                let (inverse, exponent) = shade.reciprocal.one(weight, tap);
                let whole = Near::exact(f.weight_sum.format.value(weight));
                let quotient =
                    |word: Word, sum: i64| Near::within(word.format.value(sum) / whole.value, 0.0);

                let share = tap.fit_one_shifted(&shade.colour_share, colour, -exponent);
                let rgb = tap.fit_one(&shade.rgb, share * inverse);
                let bound = mean(
                    quotient(f.colour_sum, colour),
                    whole,
                    &shade.colour_share,
                    shade,
                    &shade.rgb,
                );
                add(
                    &mut uses[0],
                    shade.rgb.word.format.value(rgb),
                    bound,
                    "normalisation",
                );

                let coverage = shade.coverage(&registers, weight, exponent, tap);
                let bound = shade.real_coverage(&bench.lighting, whole);
                add(
                    &mut uses[1],
                    shade.coverage.word.format.value(coverage),
                    bound,
                    "coverage",
                );

                let n =
                    sums.map(|sum| quotient(f.normal_sum, sum).share(&shade.normal_share, whole));
                let n = Near::direction(n, whole, &shade.root).fit(&shade.normal);
                let Some(normal) = shade.unit_normal(sums, exponent, tap) else {
                    continue;
                };
                let towards_viewer = Near::dot(&n, [0.0, 0.0, -1.0].map(Near::exact));
                if towards_viewer.may_cross(Near::exact(0.0)) {
                    continue;
                }
                let n = if towards_viewer.value > 0.0 {
                    n
                } else {
                    n.turned_back()
                };
                let cosine = shade.cosine(normal, bench.words.lights[0].direction, tap);
                let light = bench.lighting.lights[0];
                add(
                    &mut uses[2],
                    shade.cosine.word.format.value(cosine),
                    shade.real_cosine(&n, light.direction),
                    "cosine",
                );

                let half_way = bench.words.lights[0].half_way.unwrap();
                let cosine = shade
                    .cosine(normal, half_way, tap)
                    .min(shade.words.cosine_one - 1);
                let table = bench.tables[0].as_ref().unwrap();
                let highlight = shade
                    .highlight
                    .word
                    .format
                    .value(tap.fit_one(table.fit(), table.exact(cosine)));
                let Material::BlinnPhong {
                    highlight: power, ..
                } = &bench.lighting.materials[0]
                else {
                    unreachable!()
                };
                let bound = shade
                    .real_cosine(&n, light.half_way.unwrap())
                    .at_most(1.0 - shade.cosine.word.format.value(1));
                add(&mut uses[3], highlight, bound.power(power), "highlight");
            }
        }
        assert!(
            uses.iter()
                .zip([0.9, 0.9, 0.4, 0.5])
                .all(|(of, worst)| of.is_tight(worst, 0.02)),
            "{name}: {uses:?}"
        );
    }
}

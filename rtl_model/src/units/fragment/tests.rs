//! Fragment: checked against a small model written from docs/book/algorithm.md §6, and between all
//! of its host implementations.

use super::*;
use crate::kernels::Path;
use crate::num::lanes::Plain;
use crate::num::words::PlainWords;
use crate::num::{Format, LANES, Overflow, Rounding};
use crate::probe::{NoProbe, Ranges};
use proptest::prelude::*;

/// One contribution: weight, depth, r, g, b, α, normal, material.
#[derive(Clone, Debug)]
struct TestContribution {
    weight: i64,
    depth: i64,
    attributes: Attributes,
    material: u32,
}

/// Rules and formats for the model, and the frame's registers.
#[derive(Clone, Debug)]
struct Rules {
    machine: Machine,
    registers: FragmentRegisters,
}

/// Replaces the unit shade by an arbitrary function of a fragment's sums between 0 and 1.
fn trivial_shade(one: i64, sums: &Sums, material: u32) -> Premultiplied {
    let channel = |i: usize| (sums[COLOUR + i] + i64::from(material) * 37) % (one + 1);
    Premultiplied {
        colour: [channel(0), channel(1), channel(2)],
        opacity: sums[OPACITY] * 3 % (one + 1),
    }
}

/// Exact quotient `value / 2^places` in a word.
fn put(word: Word, value: i128, places: i32) -> i64 {
    let format = word.format;
    let (value, divisor) = if places > 0 {
        (value, 1i128 << places)
    } else {
        (value << -places, 1)
    };
    let (floor, rest) = (value.div_euclid(divisor), value.rem_euclid(divisor));
    let up = match word.round {
        Rounding::Truncate => false,
        Rounding::Nearest => 2 * rest >= divisor && rest > 0,
        Rounding::NearestEven => {
            2 * rest > divisor || (2 * rest == divisor && rest > 0 && floor % 2 != 0)
        }
    };
    let rounded = floor + i128::from(up);
    let values = 1i128 << format.width();
    let least = if format.signed { -values / 2 } else { 0 };
    match word.overflow {
        Overflow::Saturate => rounded.clamp(least, least + values - 1) as i64,
        Overflow::Wrap => ((rounded - least).rem_euclid(values) + least) as i64,
    }
}

/// One pixel, as specified in docs/book/algorithm.md §6.
struct Model<'a> {
    rules: &'a Rules,
    slots: Vec<Slot>,
}

impl Model<'_> {
    fn words(&self) -> [Word; SUMS] {
        let m = &self.rules.machine.fragment;
        [
            m.weight_sum,
            m.colour_sum,
            m.colour_sum,
            m.colour_sum,
            m.opacity_sum,
            m.normal_sum,
            m.normal_sum,
            m.normal_sum,
        ]
    }

    fn add(&self, sums: &mut Sums, contribution: &TestContribution) {
        let machine = &self.rules.machine;
        let [rgb, opacity, normal] = [
            machine.splat.rgb,
            machine.splat.opacity,
            machine.fragment.normal,
        ]
        .map(|word| word.format.frac_bits);
        let of_attribute = [0, rgb, rgb, rgb, opacity, normal, normal, normal];
        for (lane, word) in self.words().into_iter().enumerate() {
            let product =
                i128::from(contribution.weight) * i128::from(contribution.attributes[lane]);
            let product_bits = machine.gauss.weight.format.frac_bits + of_attribute[lane];
            let finest = product_bits.max(word.format.frac_bits);
            let exact = (product << (finest - product_bits))
                + (i128::from(sums[lane]) << (finest - word.format.frac_bits));
            sums[lane] = put(word, exact, finest - word.format.frac_bits);
        }
    }

    fn take(&mut self, contribution: &TestContribution) -> Decision {
        let m = self.rules.machine.fragment;
        let near = |slot: &Slot| (slot.depth - contribution.depth).abs();
        let candidates = self
            .slots
            .iter()
            .enumerate()
            .filter(|(_, slot)| !slot.shaded && near(slot) < self.rules.registers.z_threshold);
        // `min_by_key` returns the first among equals: the lowest slot.
        if let Some(at) = candidates
            .min_by_key(|(_, slot)| near(slot))
            .map(|(at, _)| at)
        {
            let mut slot = self.slots[at];
            self.add(&mut slot.sums, contribution);
            if m.fragment_depth == FragmentDepth::Nearest {
                slot.depth = slot.depth.min(contribution.depth);
            }
            self.slots[at] = slot;
            return Decision::Accumulated(at as u8);
        }
        let mut fresh = Slot {
            sums: [0; SUMS],
            depth: contribution.depth,
            material: contribution.material,
            shaded: false,
        };
        self.add(&mut fresh.sums, contribution);
        if self.slots.len() < m.layers as usize {
            self.slots.push(fresh);
            return Decision::Inserted(self.slots.len() as u8 - 1);
        }
        if m.merge == Merge::Replace {
            if fresh.depth < self.slots[0].depth {
                self.slots[0] = fresh;
                return Decision::Replaced;
            }
            return Decision::Dropped;
        }
        self.overflow(fresh)
    }

    fn overflow(&mut self, fresh: Slot) -> Decision {
        let m = self.rules.machine.fragment;
        let mut order: Vec<(Slot, bool)> = self
            .slots
            .iter()
            .map(|slot| (*slot, false))
            .chain([(fresh, true)])
            .collect();
        order.sort_by_key(|(slot, _)| slot.depth);
        let last = order.len() - 1;
        if m.evict_hidden && order[..last].iter().any(|(slot, _)| self.opaque(slot)) {
            let (_, own) = order[last];
            self.slots = order[..last].iter().map(|(slot, _)| *slot).collect();
            return Decision::Evicted(own);
        }
        let front = if m.merge == Merge::FarthestPair {
            last - 1
        } else {
            let gaps: Vec<i64> = order
                .windows(2)
                .map(|pair| pair[1].0.depth - pair[0].0.depth)
                .collect();
            gaps.iter()
                .position(|gap| gap == gaps.iter().min().unwrap())
                .unwrap()
        };
        let merged = self.over(&order[front].0, &order[front + 1].0);
        order[front].0 = merged;
        order.remove(front + 1);
        self.slots = order.into_iter().map(|(slot, _)| slot).collect();
        Decision::Merged(front as u8, front as u8 + 1)
    }

    fn opaque(&self, slot: &Slot) -> bool {
        let m = &self.rules.machine.fragment;
        let limit =
            i128::from((1i64 << m.opaque.format.frac_bits) * i64::from(m.opaque_permille) / 1000);
        let [limit_bits, weight_bits, opacity_bits] =
            [m.opaque, m.weight_sum, m.opacity_sum].map(|word| word.format.frac_bits);
        let [weight, opacity] = [slot.sums[WEIGHT], slot.sums[OPACITY]].map(i128::from);
        if slot.shaded {
            return opacity << limit_bits >= limit << opacity_bits;
        }
        slot.sums[WEIGHT] >= self.rules.registers.coverage_threshold
            && opacity << (limit_bits + weight_bits) >= (limit * weight) << opacity_bits
    }

    /// Colour and opacity as a slot holds them and the blender reads them: C_f + C_b(1 − α_f).
    fn light(&self, slot: &Slot) -> [i128; 4] {
        let machine = &self.rules.machine;
        let lit = machine.shade.premultiplied;
        let own = lit.format.frac_bits;
        let [colour, opacity] = [machine.fragment.colour_sum, machine.fragment.opacity_sum];
        let stored: [i64; 4] = if slot.shaded {
            std::array::from_fn(|i| slot.sums[COLOUR + i])
        } else {
            let Premultiplied {
                colour: [r, g, b],
                opacity: a,
            } = trivial_shade(1 << own, &slot.sums, slot.material);
            let [r, g, b] = [r, g, b].map(|v| put(colour, v.into(), own - colour.format.frac_bits));
            [
                r,
                g,
                b,
                put(opacity, a.into(), own - opacity.format.frac_bits),
            ]
        };
        let held = [colour, colour, colour, opacity].map(|word| word.format.frac_bits);
        std::array::from_fn(|i| put(lit, stored[i].into(), held[i] - own).into())
    }

    fn over(&self, front: &Slot, back: &Slot) -> Slot {
        let machine = &self.rules.machine;
        let own = machine.shade.premultiplied.format.frac_bits;
        let (over, under) = (self.light(front), self.light(back));
        let mut sums = [0; SUMS];
        for i in 0..4 {
            let word = if i < 3 {
                machine.fragment.colour_sum
            } else {
                machine.fragment.opacity_sum
            };
            let exact = (over[i] << own) + under[i] * ((1 << own) - over[3]);
            sums[COLOUR + i] = put(word, exact, 2 * own - word.format.frac_bits);
        }
        Slot {
            sums,
            depth: front.depth,
            material: front.material,
            shaded: true,
        }
    }
}

/// Every contribution's decision, and the pixel's slots after each.
type PixelTrace = Vec<(Decision, Vec<Slot>)>;

fn model(rules: &Rules, contributions: &[TestContribution]) -> PixelTrace {
    let mut model = Model {
        rules,
        slots: Vec::new(),
    };
    contributions
        .iter()
        .map(|contribution| (model.take(contribution), model.slots.clone()))
        .collect()
}

fn machine<const SIMPLE_FITS: bool, A: Accumulator, P: Probe>(
    rules: &Rules,
    contributions: &[TestContribution],
    pixel: u8,
    probe: &mut P,
) -> PixelTrace {
    let unit = rules.machine.elaborate().unwrap().fragment;
    let one = rules.machine.shade.premultiplied.format.one();
    let mut tile = Box::<PackedTile<A>>::default();
    let tap = &mut Tap::new(probe);
    contributions
        .iter()
        .map(|contribution| {
            let mut shade =
                |slot: &Slot, _: &mut Tap<P>| trivial_shade(one, &slot.sums, slot.material);
            let TestContribution {
                weight,
                depth,
                attributes,
                material,
            } = contribution;
            let input = Input {
                weight: *weight,
                depth: *depth,
                attributes,
                material,
            };
            let decision = unit.contribute::<Path<SIMPLE_FITS, Plain, A>, P>(
                &mut tile,
                pixel,
                input,
                &rules.registers,
                &mut shade,
                tap,
            );
            (
                decision,
                (0..tile.live(pixel))
                    .map(|slot| tile.slot(pixel, slot))
                    .collect(),
            )
        })
        .collect()
}

/// Pixel traces of every host implementation that the formats allow.
fn pixel_traces(rules: &Rules, contributions: &[TestContribution]) -> Vec<PixelTrace> {
    let elaborated = rules.machine.elaborate().unwrap();
    let ranges = &mut Ranges::new(elaborated.signals.len());
    let mut all = vec![
        machine::<false, i64, _>(rules, contributions, 0, &mut NoProbe),
        machine::<false, i64, _>(rules, contributions, 255, ranges),
    ];
    let (simple, narrow) = (
        elaborated.fragment.is_simple(),
        elaborated.fragment.is_narrow(),
    );
    if simple {
        all.push(machine::<true, i64, _>(
            rules,
            contributions,
            17,
            &mut NoProbe,
        ));
        all.push(machine::<true, i64, _>(rules, contributions, 17, ranges));
    }
    if narrow {
        all.push(machine::<false, i32, _>(
            rules,
            contributions,
            200,
            &mut NoProbe,
        ));
    }
    if simple && narrow {
        all.push(machine::<true, i32, _>(
            rules,
            contributions,
            3,
            &mut NoProbe,
        ));
        all.push(machine::<true, i32, _>(rules, contributions, 3, ranges));
    }
    all
}

/// A named machine, or one with wider, wrapping or unusually rounded sums; any rule.
fn rules() -> impl Strategy<Value = Rules> {
    let rule = prop::sample::select(vec![
        Merge::NearestPair,
        Merge::FarthestPair,
        Merge::Replace,
    ]);
    let depth = prop::sample::select(vec![FragmentDepth::First, FragmentDepth::Nearest]);
    let odd = prop::sample::select(vec![0u8, 0, 0, 1, 2, 3, 4]);
    let own = (
        prop::sample::select(Machine::NAMES.to_vec()),
        1..=8u32,
        rule,
        any::<bool>(),
        depth,
        odd,
    );
    (own, 0..40i64, 0.0..1.0).prop_map(
        |((name, layers, merge, evict_hidden, fragment_depth, odd), z_threshold, threshold): (
            _,
            _,
            f64,
        )| {
            let mut machine = Machine::named(name).unwrap();
            let f = &mut machine.fragment;
            f.layers = if merge == Merge::Replace { 1 } else { layers };
            (f.merge, f.evict_hidden, f.fragment_depth) = (merge, evict_hidden, fragment_depth);
            match odd {
                1 => f.colour_sum = f.colour_sum.rounded(Rounding::NearestEven),
                2 => f.opacity_sum = f.opacity_sum.rounded(Rounding::Truncate),
                3 => f.normal_sum = f.normal_sum.overflowing(Overflow::Wrap),
                4 => f.weight_sum.format = Format::unsigned(6, 36),
                _ => {}
            }
            let coverage_threshold =
                (threshold * machine.fragment.weight_sum.format.one() as f64) as i64;
            Rules {
                machine,
                registers: FragmentRegisters {
                    z_threshold,
                    coverage_threshold,
                },
            }
        },
    )
}

/// Contributions with few different depths, so that many are equal or about ε apart.
fn contributions(rules: &Rules) -> impl Strategy<Value = Vec<TestContribution>> + use<> {
    let machine = rules.machine.clone();
    let near = rules.registers.z_threshold;
    let one = (any::<u64>(), any::<[u32; 7]>(), 0..6i64, -1..=1i64, 0..4u32);
    let contribution = one.prop_map(move |(weight, words, step, off, material)| {
        let s = &machine.splat;
        let unsigned = |word: Word, any: u32| {
            let one = word.format.one();
            // Half of them are opaque white.
            if any & 1 == 0 {
                one as i32
            } else {
                (i64::from(any >> 1) % (word.format.max() + 1)) as i32
            }
        };
        let n = |any: u32| {
            (i64::from(any) % (1 << machine.fragment.normal.format.width())
                + machine.fragment.normal.format.min()) as i32
        };
        let [r, g, b, a, x, y, z] = words;
        let weight = match weight & 3 {
            0 => machine.gauss.weight.format.max(),
            _ => 1 + (weight >> 2) as i64 % machine.gauss.weight.format.max(),
        };
        TestContribution {
            weight,
            depth: (60 + step * near + off * (step & 1))
                .clamp(0, machine.fragment.depth.format.max()),
            attributes: [
                1,
                unsigned(s.rgb, r),
                unsigned(s.rgb, g),
                unsigned(s.rgb, b),
                unsigned(s.opacity, a),
                n(x),
                n(y),
                n(z),
            ],
            material,
        }
    });
    prop::collection::vec(contribution, 1..40)
}

fn cases() -> impl Strategy<Value = (Rules, Vec<TestContribution>)> {
    rules().prop_flat_map(|rules| (Just(rules.clone()), contributions(&rules)))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Decisions and slots, after every contribution, in every host implementation.
    #[test]
    fn the_unit_is_the_algorithm((rules, contributions) in cases()) {
        let expected = model(&rules, &contributions);
        for (form, pixel_trace) in pixel_traces(&rules, &contributions).into_iter().enumerate() {
            for (step, (own, expected)) in pixel_trace.iter().zip(&expected).enumerate() {
                prop_assert_eq!(own, expected, "form {}, contribution {}", form, step);
            }
        }
    }

    #[test]
    fn every_contribution_has_one_outcome((rules, contributions) in cases()) {
        let pixel_trace = machine::<false, i64, _>(&rules, &contributions, 0, &mut NoProbe);
        let mut outcomes = Outcomes::default();
        pixel_trace.iter().for_each(|(decision, _)| outcomes.count(*decision));
        prop_assert_eq!(outcomes.total(), contributions.len() as u64);
        let count_of = |is: fn(&Decision) -> bool| pixel_trace.iter().filter(|(decision, _)| is(decision)).count() as u64;
        prop_assert_eq!(outcomes.accumulated, count_of(|decision| matches!(decision, Decision::Accumulated(_))));
        prop_assert_eq!(outcomes.merged, count_of(|decision| matches!(decision, Decision::Merged(..))));
        prop_assert_eq!(outcomes.evicted, count_of(|decision| matches!(decision, Decision::Evicted(_))));
        let layers = rules.machine.fragment.layers as u64;
        prop_assert!(outcomes.inserted <= layers && pixel_trace.iter().all(|(_, slots)| slots.len() as u64 <= layers));
        let [stacked, flat] = [outcomes.merged + outcomes.evicted, outcomes.replaced + outcomes.dropped];
        prop_assert_eq!(if rules.machine.fragment.merge == Merge::Replace { stacked } else { flat }, 0);
        prop_assert!(rules.machine.fragment.evict_hidden || outcomes.evicted == 0);
    }

    #[test]
    fn slots_are_in_depth_order_after_a_merge((rules, contributions) in cases()) {
        for (decision, slots) in machine::<false, i64, _>(&rules, &contributions, 0, &mut NoProbe) {
            if matches!(decision, Decision::Merged(..) | Decision::Evicted(_)) {
                prop_assert!(slots.is_sorted_by_key(|slot| slot.depth));
            }
        }
    }
}

/// The reference machine with one rule, ε = 10 unless stated otherwise.
fn reference(layers: u32, merge: Merge, evict_hidden: bool) -> Rules {
    let mut machine = Machine::named("reference").unwrap();
    machine.fragment = crate::machine::Fragment {
        layers,
        merge,
        evict_hidden,
        ..machine.fragment
    };
    let coverage_threshold = machine.fragment.weight_sum.format.one() / 10;
    Rules {
        machine,
        registers: FragmentRegisters {
            z_threshold: 10,
            coverage_threshold,
        },
    }
}

/// Half-transparent grey unless opaque.
fn at(depth: i64, opaque: bool) -> TestContribution {
    let opacity = if opaque { 4096 } else { 1000 };
    TestContribution {
        weight: (1 << 18) - 1,
        depth,
        attributes: [1, 2048, 2048, 2048, opacity, 0, 0, -4096],
        material: 0,
    }
}

fn decisions(rules: &Rules, depths: &[i64]) -> Vec<Decision> {
    let contributions: Vec<TestContribution> =
        depths.iter().map(|depth| at(*depth, false)).collect();
    machine::<true, i32, _>(rules, &contributions, 0, &mut NoProbe)
        .into_iter()
        .map(|(decision, _)| decision)
        .collect()
}

#[test]
fn a_match_is_nearer_than_the_threshold_and_not_at_it() {
    use Decision::{Accumulated, Inserted};
    let rules = reference(8, Merge::FarthestPair, false);
    assert_eq!(
        decisions(&rules, &[100, 109, 91, 110]),
        [Inserted(0), Accumulated(0), Accumulated(0), Inserted(1)]
    );
    assert_eq!(
        decisions(&rules, &[100, 90, 89, 111]),
        [Inserted(0), Inserted(1), Accumulated(1), Inserted(2)]
    );
}

#[test]
fn equal_distances_go_to_the_lowest_slot() {
    use Decision::{Accumulated, Inserted};
    let rules = reference(8, Merge::FarthestPair, false);
    assert_eq!(
        decisions(&rules, &[112, 100, 106]),
        [Inserted(0), Inserted(1), Accumulated(0)]
    );
    assert_eq!(
        decisions(&rules, &[100, 112, 106, 107]),
        [Inserted(0), Inserted(1), Accumulated(0), Accumulated(1)]
    );
}

#[test]
fn among_equal_gaps_the_pair_nearer_to_the_eye_merges() {
    let rules = reference(3, Merge::NearestPair, false);
    assert_eq!(
        decisions(&rules, &[300, 100, 200, 400])[3],
        Decision::Merged(0, 1)
    );
    assert_eq!(
        decisions(&rules, &[300, 100, 210, 400])[3],
        Decision::Merged(1, 2)
    );
    assert_eq!(
        decisions(
            &reference(3, Merge::FarthestPair, false),
            &[300, 100, 200, 250]
        )[3],
        Decision::Merged(2, 3)
    );
}

#[test]
fn a_contribution_comes_after_its_equals() {
    // A shaded fragment at 100 matches nothing, so another contribution at 100 goes behind it: the
    // front one's material stays.
    let rules = reference(1, Merge::FarthestPair, true);
    let contributions = [
        at(100, false),
        at(200, false),
        TestContribution {
            material: 1,
            ..at(100, false)
        },
    ];
    let pixel_trace = machine::<true, i32, _>(&rules, &contributions, 0, &mut NoProbe);
    assert_eq!(
        [pixel_trace[1].0, pixel_trace[2].0],
        [Decision::Merged(0, 1); 2]
    );
    assert_eq!(pixel_trace[2].1[0].material, 0);
}

#[test]
fn a_fragment_behind_an_opaque_one_is_evicted() {
    let rules = reference(2, Merge::FarthestPair, true);
    let pixel_trace = |contributions: &[TestContribution]| {
        machine::<true, i32, _>(&rules, contributions, 0, &mut NoProbe)
            .pop()
            .unwrap()
            .0
    };
    assert_eq!(
        pixel_trace(&[at(100, true), at(200, false), at(300, false)]),
        Decision::Evicted(true)
    );
    assert_eq!(
        pixel_trace(&[at(100, true), at(300, false), at(200, false)]),
        Decision::Evicted(false)
    );
    // The new fragment itself hides the others.
    assert_eq!(
        pixel_trace(&[at(200, false), at(300, false), at(100, true)]),
        Decision::Evicted(false)
    );
    // Nothing is behind it.
    assert_eq!(
        pixel_trace(&[at(100, false), at(300, true), at(200, false)]),
        Decision::Merged(1, 2)
    );
    // It covers too little of the pixel.
    let thin = TestContribution {
        weight: 100,
        ..at(100, true)
    };
    assert_eq!(
        pixel_trace(&[thin, at(200, false), at(300, false)]),
        Decision::Merged(1, 2)
    );
}

/// The short form returns what the wide form returns: for the depths that raster produces, and
/// for some below 0.
#[test]
fn words_of_32_bits_hold_depths_as_wide_ones_do() {
    for name in ["reference", "lean", "volume", "gaussian"] {
        let fragment = Machine::named(name).unwrap().elaborate().unwrap().fragment;
        assert!(fragment.is_depth_narrow(), "{name} has no short form");
        for depth in (-1 << 30..=1 << 30)
            .step_by(1_234_567)
            .chain(-70..70)
            .chain((1 << 30) - 70..1 << 30)
        {
            let wide = fragment
                .depth::<false, Plain, _>(Plain([depth; LANES]), &mut Tap::new(&mut NoProbe))
                .0[0];
            assert_eq!(
                i64::from(
                    fragment
                        .short_depth()
                        .words(PlainWords([depth.max(0) as i32; LANES]))
                        .0[0]
                ),
                wide,
                "{name} at {depth}"
            );
        }
    }
}

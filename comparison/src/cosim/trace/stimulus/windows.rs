//! Windows: made-up cases of clusters: depths at, one LSB within and one LSB beyond the range of
//! slots, weights up to τ, and full pixels.

use super::super::observer::{flag, outcome, outcomes};
use super::{Maker, UNKNOWN, answer, pixel_key};
use rtl_model::num::Format;
use rtl_model::pipeline::ports::{self, Kind};
use rtl_model::pipeline::unit_replay::Windows;
use rtl_model::records::WindowIn;
use rtl_model::units::fragment::window::Cluster;
use rtl_model::units::fragment::{Decision, Premultiplied, Slot, TILE_PX};

/// Indices of words in a record.
const WEIGHT: usize = 2;
const DEPTH: usize = 3;
const OPACITY: usize = 7;
const MATERIAL: usize = 11;

/// Contributions besides the corner cases.
pub const CONTRIBUTIONS: usize = 1024;

impl Maker<'_> {
    /// Contributions that open a cluster, accumulate, arrive late, lie inside, or exceed the number
    /// of slots.
    pub(super) fn windows(&mut self) {
        let Some(mut unit) = Windows::new(self.machine, self.frame) else {
            return;
        };
        let formats = self.formats("fragment.in");
        let m = &self.machine.machine;
        let places = ports::exact_depth(m).frac_bits - m.fragment.depth.format.frac_bits;
        let sides =
            [self.frame.width, self.frame.height].map(|size| i64::from(size).min(TILE_PX as i64));
        let mut at = [0, 0];
        self.fill_cluster(&mut unit, &formats);
        for _ in 0..self.cases + CONTRIBUTIONS {
            if !self.random.one_in(3) {
                at = sides.map(|side| self.random.below(side));
            }
            let held = unit.held(pixel(at)).to_vec();
            let z = self.depth_of_window(&held);
            self.cover_windows(&held, z);
            let mut words: Vec<i64> = formats
                .iter()
                .map(|format| self.random.word(*format))
                .collect();
            words[..2].copy_from_slice(&at);
            words[WEIGHT] = self.weight_of_window(formats[WEIGHT]);
            let below = if places > 0 {
                self.random.below(1 << places) - (1 << (places - 1))
            } else {
                0
            };
            let exact = if places >= 0 {
                (z << places) + below
            } else {
                z >> -places
            };
            if !self.random.one_in(16) {
                words[DEPTH] = exact.clamp(formats[DEPTH].min(), formats[DEPTH].max());
            }
            // Opacities are at most 1; many splats are opaque.
            let one = m.splat.opacity.format.one();
            words[OPACITY] = if self.random.one_in(3) {
                one
            } else {
                words[OPACITY].min(one)
            };
            words[MATERIAL] = self
                .random
                .below(self.frame.lighting.materials.len() as i64);
            self.contribute_to_window(&mut unit, words);
        }
        self.tag("fragment.in", "ends of clusters and random", 0);
        for y in 0..sides[1] {
            for x in 0..sides[0] {
                self.end_of_windows(&mut unit, [x, y]);
            }
        }
    }

    /// The greatest contributions at one place: as many as its sums can hold, and two more.
    fn fill_cluster(&mut self, unit: &mut Windows, formats: &[Format]) {
        let f = &self.machine.machine.fragment;
        let by = formats[WEIGHT].frac_bits - f.weight_sum.format.frac_bits;
        let held = if by >= 0 {
            formats[WEIGHT].max() >> by
        } else {
            formats[WEIGHT].max() << -by
        };
        let count = (f.weight_sum.format.max() / held.max(1) + 2).min(1024);
        for (at, normal) in [
            ([0, 0], Format::max as fn(Format) -> i64),
            ([1, 0], Format::min),
        ] {
            let mut words: Vec<i64> = formats.iter().map(|format| format.max()).collect();
            words[..2].copy_from_slice(&at);
            words[DEPTH] = formats[DEPTH].max() / 2;
            words[MATERIAL] = 0;
            words[8..MATERIAL]
                .iter_mut()
                .zip(&formats[8..])
                .for_each(|(word, format)| *word = normal(*format));
            for _ in 0..count {
                self.contribute_to_window(unit, words.clone());
            }
        }
    }

    /// Mostly about the coverage of a pixel, because a full slot accepts no late contribution;
    /// sometimes any.
    fn weight_of_window(&mut self, format: Format) -> i64 {
        let sum = self.machine.machine.fragment.weight_sum.format;
        let covers = super::moved(
            self.frame.coverage_threshold,
            format.frac_bits - sum.frac_bits,
        );
        let random = &mut self.random;
        let weight = match random.below(8) {
            0 => random.word(format),
            1 => covers + random.below(3) - 1,
            2 | 3 => covers / 2,
            _ => random.below(covers.max(1)),
        };
        weight.clamp(1, format.max())
    }

    /// A depth at an end of the range of a slot, or of one of its sides, or one LSB from it,
    /// between the ends, or anywhere.
    fn depth_of_window(&mut self, held: &[Cluster]) -> i64 {
        let format = self.machine.machine.fragment.depth.format;
        let threshold = self.frame.z_threshold;
        let reach = self
            .frame
            .window
            .as_ref()
            .map_or(threshold, |window| window.reach);
        let layers = i64::from(self.machine.machine.fragment.layers);
        let random = &mut self.random;
        if held.is_empty() || random.one_in(4) {
            // At most a few ε apart; otherwise nothing would be accumulated.
            let spread = (threshold * (2 + 2 * layers)).max(4).min(format.max());
            let near = format.max() / 2 - spread / 2 + random.below(spread);
            return if random.one_in(16) {
                random.word(format)
            } else {
                near.clamp(0, format.max())
            };
        }
        let slot = &held[random.below(held.len() as i64) as usize];
        let ends = [slot.front[0], slot.front[1], slot.back[0], slot.back[1]];
        let end = random.among(&ends);
        let by = random.below(3) - 1;
        let z = match random.below(6) {
            0 => end + by,
            1 => ends[0] + threshold + by,
            2 => ends[3] - threshold + by,
            3 => ends[0] + reach + by,
            4 => (ends[0] + ends[3]) / 2 + by,
            _ => end + random.below(threshold.max(1)) - threshold / 2,
        };
        z.clamp(format.min(), format.max())
    }

    fn cover_windows(&mut self, held: &[Cluster], z: i64) {
        let threshold = self.frame.z_threshold;
        let meet = &mut self.seen.coverage;
        for slot in held {
            let kind = if slot.closed { "a closed" } else { "an open" };
            for (end, name) in [(slot.near(), "nearest end"), (slot.far(), "farthest end")] {
                meet.count_if(
                    z == end,
                    "fragment",
                    &format!("depth at the {name} of {kind} slot"),
                );
            }
            let width = slot.far().max(z) - slot.near().min(z);
            for (by, name) in [(-1, "one narrower than ε"), (0, "as wide as ε")] {
                meet.count_if(
                    width == threshold + by,
                    "fragment",
                    &format!("{kind} slot would be {name}"),
                );
            }
        }
    }

    fn contribute_to_window(&mut self, unit: &mut Windows, words: Vec<i64>) {
        let words = self.held("fragment.in", words);
        let at = [words[0], words[1]];
        let input = self.push("fragment.in", words.clone(), pixel_key(at, UNKNOWN));
        let (random, machine, coverage) = (&mut self.random, self.machine, &mut self.seen);
        let mut requests = Vec::new();
        let words: [i64; WindowIn::WORDS] = words.try_into().unwrap_or_default();
        let decision = unit.take(
            words,
            |slot| logged(slot, answer(random, machine), &mut requests),
            coverage,
        );
        let flags = coverage.flush() | flag::of_decision(decision);
        self.requests(requests, at, input);
        let deepest = self.machine.machine.fragment.layers - 1;
        let [number, slot, place] = outcome(decision, deepest as u8);
        let name = outcomes(Kind::of(self.frame))[usize::from(number)];
        self.seen
            .coverage
            .count("fragment", &format!("{name}, slot {slot}"));
        if let Decision::Closed(..) = decision {
            let closed = unit
                .held(pixel(at))
                .iter()
                .filter(|slot| slot.closed)
                .count();
            self.seen
                .coverage
                .count("fragment", &format!("{closed} are closed"));
        }
        let key = super::Key {
            slot: slot.into(),
            flags,
            ..pixel_key(at, input)
        };
        self.push(
            "fragment.out",
            vec![at[0], at[1], number.into(), slot.into(), place.into()],
            key,
        );
    }

    /// Records of requests to shade and of its answers.
    fn requests(&mut self, requests: Vec<(Slot, Premultiplied)>, at: [i64; 2], input: usize) {
        for (slot, answer) in requests {
            let request = self.push(
                "fragment.request",
                [&slot.sums[..], &[slot.material.into()]].concat(),
                pixel_key(at, input),
            );
            let [r, g, b] = answer.colour;
            self.push(
                "fragment.answer",
                vec![r, g, b, answer.opacity],
                pixel_key(at, request),
            );
        }
    }

    fn end_of_windows(&mut self, unit: &mut Windows, at: [i64; 2]) {
        let (random, machine, coverage) = (&mut self.random, self.machine, &mut self.seen);
        let mut requests = Vec::new();
        let slots = unit.held(pixel(at)).len();
        let layers = unit.layers(
            pixel(at),
            |slot| logged(slot, answer(random, machine), &mut requests),
            coverage,
        );
        coverage.flush();
        coverage.coverage.count(
            "fragment",
            &format!("{slots} slots in the end, {} layers", layers.len()),
        );
        self.requests(requests, at, UNKNOWN);
        for layer in layers {
            let mut words = vec![at[0], at[1], layer.slot as i64, layer.depth];
            words.extend(layer.colour);
            words.push(layer.opacity);
            self.push(
                "fragment.held",
                words,
                super::Key {
                    slot: layer.slot as u32,
                    ..pixel_key(at, UNKNOWN)
                },
            );
        }
    }
}

/// Index of the pixel in its tile.
fn pixel([x, y]: [i64; 2]) -> usize {
    y as usize * TILE_PX + x as usize
}

/// Logs a request to shade with its answer; returns the answer.
fn logged(
    slot: &Slot,
    answer: Premultiplied,
    requests: &mut Vec<(Slot, Premultiplied)>,
) -> Premultiplied {
    requests.push((*slot, answer));
    answer
}

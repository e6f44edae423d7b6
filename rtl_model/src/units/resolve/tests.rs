//! Resolve: laws of blending.

use super::*;
use crate::probe::NoProbe;
use proptest::prelude::*;

fn unit(name: &str) -> (Machine, Resolve) {
    let machine = Machine::named(name).unwrap();
    let resolve = machine.elaborate().unwrap().resolve;
    (machine, resolve)
}

fn one(resolve: &Resolve, layers: &[Layer], background: [i64; 4]) -> [i64; 4] {
    resolve.one(layers, background, &mut Tap::new(&mut NoProbe))
}

fn names() -> impl Strategy<Value = &'static str> {
    prop::sample::select(Machine::NAMES.to_vec())
}

/// A layer whose colour does not exceed its opacity, as from shade; values are fractions of 1.
fn layer(machine: &Machine, parts: [f64; 4]) -> Layer {
    let one = machine.shade.premultiplied.format.one() as f64;
    let opacity = (parts[3] * one) as i64;
    Layer {
        colour: std::array::from_fn(|i| (parts[i] * parts[3] * one) as i64),
        opacity,
        ..Layer::default()
    }
}

fn parts() -> impl Strategy<Value = Vec<[f64; 4]>> {
    let opacity = prop_oneof![Just(0.0), Just(1.0), 0.0..=1.0];
    prop::collection::vec(
        ([0.0..=1.0, 0.0..=1.0, 0.0..=1.0], opacity).prop_map(|([r, g, b], a)| [r, g, b, a]),
        0..8,
    )
}

proptest! {
    #[test]
    fn an_empty_pixel_is_background(name in names(), background in prop::array::uniform4(0.0..=1.0)) {
        let (machine, resolve) = unit(name);
        let one_word = machine.resolve.frame.format.one();
        let background = background.map(|part: f64| (part * one_word as f64) as i64);
        prop_assert_eq!(one(&resolve, &[], background), background);
    }

    #[test]
    fn an_opaque_layer_hides_all_behind_it(name in names(), front in parts(), behind in parts(), rgb in prop::array::uniform3(0.0..=1.0)) {
        let (machine, resolve) = unit(name);
        let [r, g, b] = rgb;
        let stack = |parts: &[[f64; 4]]| parts.iter().map(|parts| layer(&machine, *parts)).collect::<Vec<_>>();
        let front = [front, vec![[r, g, b, 1.0]]].concat();
        let shown = one(&resolve, &stack(&front), [0; 4]);
        let white = machine.resolve.frame.format.one();
        prop_assert_eq!(one(&resolve, &stack(&[front.clone(), behind].concat()), [white; 4]), shown);
        prop_assert_eq!(shown[3], white);
        if front.len() == 1 {
            let exact = stack(&front)[0].colour.map(|word| machine.shade.premultiplied.format.value(word));
            for (channel, exact) in exact.into_iter().enumerate() {
                prop_assert!((machine.resolve.frame.format.value(shown[channel]) - exact).abs() <= machine.resolve.frame.format.value(1) / 2.0);
            }
        }
    }

    /// Checked against front to back in exact arithmetic. Each layer's transmittance may add half
    /// an ulp of error, and the frame word half of its own.
    #[test]
    fn a_blend_is_within_half_an_ulp_per_layer(name in names(), parts in parts(), background in prop::array::uniform4(0.0..=1.0)) {
        let (machine, resolve) = unit(name);
        let layers: Vec<Layer> = parts.iter().map(|parts| layer(&machine, *parts)).collect();
        let (p, frame) = (machine.shade.premultiplied.format, machine.resolve.frame.format);
        let alpha = (background[3] * frame.one() as f64) as i64;
        let background = background.map(|part: f64| ((part * frame.one() as f64) as i64).min(alpha));
        let own = one(&resolve, &layers, background);
        let (mut through, mut sums) = (1.0, [0.0; 4]);
        for layer in &layers {
            for (channel, sum) in sums.iter_mut().enumerate() {
                *sum += through * p.value(if channel < 3 { layer.colour[channel] } else { layer.opacity });
            }
            through *= 1.0 - p.value(layer.opacity);
        }
        let half = machine.resolve.transmittance.format.value(1) / 2.0;
        let bound = frame.value(1) / 2.0 + half * layers.len() as f64 * 2.0;
        for channel in 0..4 {
            let exact = (sums[channel] + through * frame.value(background[channel])).min(1.0);
            prop_assert!((frame.value(own[channel]) - exact).abs() <= bound, "channel {channel} is {own:?}, exactly {exact}");
        }
    }
}

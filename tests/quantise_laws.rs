//! Are the machine's words within half an ulp of the scene's values, at the largest scale that
//! holds everything? The oracle is integer arithmetic on the binary digits of the scene's numbers.

use crate::handmade;
use glam::DVec3;
use proptest::prelude::*;
use rtl_model::Machine;
use rtl_model::num::{Format, Word};
use splatsim::hardware::quantise::{Quantised, quantise};
use splatsim::scene::{Scene, Splat};

/// Fraction bits of the exact numbers below.
const EXACT_PLACES: i32 = 80;

/// A number in units of 2^−80, truncated towards minus infinity if it is finer: this does not
/// change a rounding to a coarser word.
fn exact(x: f64) -> i128 {
    let bits = x.to_bits();
    let exponent = ((bits >> 52) & 0x7ff) as i32;
    assert!(exponent != 0x7ff, "{x} is not a number");
    let fraction = (bits & ((1 << 52) - 1)) as i128;
    let magnitude = if exponent == 0 {
        fraction
    } else {
        fraction | (1 << 52)
    };
    let signed = if x.is_sign_negative() {
        -magnitude
    } else {
        magnitude
    };
    let left = exponent.max(1) - 1075 + EXACT_PLACES;
    assert!(left < 74, "{x} is too large for this test");
    if left >= 0 {
        signed << left
    } else {
        signed >> (-left).min(127)
    }
}

/// The nearest word to an exact number times 2^exponent, ties up.
fn nearest(exact: i128, exponent: i32, format: Format) -> i128 {
    let right = EXACT_PLACES - exponent - format.frac_bits;
    assert!(
        (1..120).contains(&right),
        "2^{exponent} is out of this test's range"
    );
    (exact + (1 << (right - 1))) >> right
}

/// word − number·2^exponent| in units of 2^−20 ulp.
fn error_in_places(word: i32, number: i128, exponent: i32, format: Format) -> i128 {
    let right = EXACT_PLACES - exponent - format.frac_bits;
    ((i128::from(word) << right) - number).abs() >> (right - 20)
}

fn a_splat() -> impl Strategy<Value = Splat> {
    let position = prop::array::uniform3(-20.0..20.0_f64);
    let direction = prop::array::uniform3(-1.0..1.0_f64)
        .prop_filter("too short", |v| DVec3::from_array(*v).length() > 0.1);
    // Halves of an ulp are likely among sixty-fourths, but do not occur among random reals.
    let channel = prop_oneof![
        (0..=8192_u32).prop_map(|n| f64::from(n) / 8192.0),
        0.0..=1.0
    ];
    let opacity = prop_oneof![
        (0..=8192_u32).prop_map(|n| f64::from(n) / 8192.0),
        0.0..=1.0
    ];
    (
        position,
        direction,
        -9.0..3.0_f64,
        prop::array::uniform3(channel),
        opacity,
    )
        .prop_map(|(position, direction, size, rgb, opacity)| Splat {
            position: DVec3::from_array(position),
            normal: DVec3::from_array(direction).normalize(),
            radius: size.exp2(),
            rgb,
            opacity,
            material: 0,
        })
}

/// Splats at any position around an eye with any direction.
fn a_scene() -> impl Strategy<Value = Scene> {
    let eye = prop::array::uniform3(-40.0..40.0_f64);
    (
        prop::collection::vec(a_splat(), 1..12),
        eye,
        0.0..6.0_f64,
        0.001..3.0_f64,
    )
        .prop_map(|(splats, eye, turn, z_threshold)| {
            let mut scene = handmade::scene(64, 48, 60.0, splats);
            scene.camera.eye = DVec3::from_array(eye);
            scene.camera.target = scene.camera.eye + DVec3::new(turn.sin(), 0.2, turn.cos());
            scene.surface.z_threshold = z_threshold;
            scene
        })
}

fn machines() -> impl Iterator<Item = Machine> {
    Machine::NAMES
        .into_iter()
        .map(|name| Machine::named(name).unwrap())
}

fn quantised(scene: &Scene, machine: &Machine) -> Quantised {
    quantise(scene, machine).unwrap()
}

/// The values that must be representable, and their sizes in world units, by docs/book/algorithm.md
/// §1 and §3.
fn needs(scene: &Scene, machine: &Machine, offset: DVec3) -> Vec<(Word, f64)> {
    let forward = (scene.camera.target - scene.camera.eye).normalize();
    let reach = scene.kernel.cutoff.sqrt();
    let mut needs = vec![(machine.fragment.depth, scene.surface.z_threshold)];
    needs.extend(
        (scene.camera.eye - offset)
            .to_array()
            .map(|x| (machine.project.eye, x.abs())),
    );
    for splat in &scene.splats {
        needs.extend(
            (splat.position - offset)
                .to_array()
                .map(|x| (machine.splat.position, x.abs())),
        );
        needs.push((machine.splat.radius, splat.radius));
        needs.push((machine.ellipse.depth_range, splat.radius * reach));
        let deepest = forward.dot(splat.position - scene.camera.eye) + splat.radius * reach;
        needs.extend([machine.project.depth, machine.fragment.depth].map(|word| (word, deepest)));
    }
    needs
}

fn scaled(scene: &Scene, by: f64) -> Scene {
    let mut scene = scene.clone();
    for splat in &mut scene.splats {
        splat.position *= by;
        splat.radius *= by;
    }
    scene.camera.eye *= by;
    scene.camera.target *= by;
    scene.camera.near *= by;
    scene.surface.z_threshold *= by;
    scene
}

/// Every coordinate truncated to sixteen fraction bits, so that sums are exact.
fn on_a_grid(v: DVec3) -> DVec3 {
    (v * 65536.0).round() / 65536.0
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn words_are_the_nearest_and_never_saturate(scene in a_scene()) {
        for machine in machines() {
            let Quantised { frame, scale, .. } = quantised(&scene, &machine);
            let (words, exponent) = (machine.splat, scale.exponent);
            prop_assert_eq!(frame.splats.len(), scene.splats.len());
            for (word, splat) in frame.splats.iter().zip(&scene.splats) {
                for axis in 0..3 {
                    let offset = exact(splat.position[axis]) - exact(scale.offset[axis]);
                    // The difference is computed in f64: a millionth of an ulp may be lost.
                    let error = error_in_places(word.position[axis], offset, exponent, words.position.format);
                    prop_assert!(error <= (1 << 19) + 1, "{} {:?} {:?}", machine.name, word, splat);
                    prop_assert_eq!(i128::from(word.normal[axis]), nearest(exact(splat.normal[axis]), 0, words.normal.format));
                    prop_assert_eq!(i128::from(word.rgb[axis]), nearest(exact(splat.rgb[axis]), 0, words.rgb.format));
                }
                prop_assert_eq!(i128::from(word.radius), nearest(exact(splat.radius), exponent, words.radius.format));
                prop_assert_eq!(i128::from(word.opacity), nearest(exact(splat.opacity), 0, words.opacity.format));
            }
        }
    }

    #[test]
    fn the_scale_is_the_greatest_at_which_everything_fits(scene in a_scene()) {
        for machine in machines() {
            let scale = quantised(&scene, &machine).scale;
            let needs = needs(&scene, &machine, DVec3::from_array(scale.offset));
            let most = |word: Word| word.format.max() as f64 / f64::from(word.format.frac_bits).exp2();
            let fit = |exponent: i32, slack: f64| needs.iter().all(|(word, need)| need * f64::from(exponent).exp2() <= most(*word) * slack);
            prop_assert!(fit(scale.exponent, 1.0 + 1e-12), "{} {:?}", machine.name, scale);
            prop_assert!(!fit(scale.exponent + 1, 1.0 - 1e-12), "{} {:?}", machine.name, scale);
        }
    }

    #[test]
    fn a_scene_of_twice_the_size_has_the_same_words(scene in a_scene(), doublings in -9..9_i32) {
        for machine in machines() {
            let own = quantised(&scene, &machine);
            let other = quantised(&scaled(&scene, f64::from(doublings).exp2()), &machine);
            prop_assert_eq!(own.scale.exponent - doublings, other.scale.exponent);
            prop_assert_eq!(own.frame, other.frame);
        }
    }

    #[test]
    fn a_scene_moved_with_its_eye_has_the_same_words(scene in a_scene(), by in prop::array::uniform3(-1000.0..1000.0_f64)) {
        let by = on_a_grid(DVec3::from_array(by));
        let mut scene = scene;
        scene.splats.iter_mut().for_each(|splat| splat.position = on_a_grid(splat.position));
        scene.camera.eye = on_a_grid(scene.camera.eye);
        scene.camera.target = on_a_grid(scene.camera.target);
        let mut moved = scene.clone();
        moved.splats.iter_mut().for_each(|splat| splat.position += by);
        moved.camera.eye += by;
        moved.camera.target += by;
        for machine in machines() {
            let (own, other) = (quantised(&scene, &machine), quantised(&moved, &machine));
            prop_assert_eq!(DVec3::from_array(own.scale.offset) + by, DVec3::from_array(other.scale.offset));
            prop_assert_eq!(own.frame, other.frame);
        }
    }
}

#[test]
fn the_oracle_counts_right() {
    assert_eq!(exact(1.0), 1 << 80);
    assert_eq!(exact(-0.75), -(3 << 78));
    assert_eq!(exact(-1e-300), -1);
    let format = Format::signed(4, 1);
    assert_eq!(
        [0.24, 0.25, -0.25, -0.26, 3.0].map(|x| nearest(exact(x), 0, format)),
        [0, 1, 0, -1, 6]
    );
    assert_eq!(nearest(exact(3.0), -2, format), 2);
    assert_eq!(error_in_places(1, exact(0.25), 0, format), 1 << 19);
}

use super::*;
use crate::scene::{Overrides, Scene};
use std::collections::HashSet;

fn close(a: DVec3, b: [f64; 3]) -> bool {
    (a - DVec3::from_array(b)).length() < 1e-9
}

#[test]
fn glass_spheres_is_the_scene_of_the_specification() {
    let scene = Scene::load("glass-spheres", &Overrides::default()).unwrap();
    let s = &scene.splats;
    assert_eq!(s.len(), 280_000);
    // Floor: first cell centre −4 + 0.01; ⌊−7.98⌋ + ⌊−7.98⌋ = −16 is even. The second check begins
    // at cell 25.
    assert!(close(s[0].position, [-3.99, -1.0, -3.99]) && s[0].rgb == [0.1, 0.1, 0.3]);
    assert_eq!(
        (s[0].normal, s[0].radius, s[0].opacity, s[0].material),
        (DVec3::Y, 0.02, 1.0, 0)
    );
    assert!(close(s[24].position, [-3.51, -1.0, -3.99]) && s[24].rgb == [0.1, 0.1, 0.3]);
    assert!(close(s[25].position, [-3.49, -1.0, -3.99]) && s[25].rgb == [0.9, 0.9, 0.9]);
    assert!(close(s[400].position, [-3.99, -1.0, -3.97]));
    // Red sphere: cos(polar) = 1 − 1/60000; azimuth 5.083203692 (mod 2π).
    assert!(close(
        s[160_000].position,
        [0.002_092_163_686, -0.005_381_069_287, 0.999_983_333_333]
    ));
    assert!((s[160_000].radius - (4.0 * PI / 60_000.0).sqrt()).abs() < 1e-15);
    assert_eq!(
        (s[160_000].rgb, s[160_000].opacity, s[160_000].material),
        ([0.9, 0.2, 0.1], 0.5, 1)
    );
    // Green and blue, by the same formula: last and first.
    assert!(((s[259_999].position - DVec3::new(0.7, 0.2, 0.5)).length() - 0.8).abs() < 1e-12);
    assert!((s[259_999].position.z - (0.5 + 0.8 * (1.0 / 40_000.0 - 1.0))).abs() < 1e-12);
    assert!((s[260_000].position.z - (0.8 + 0.6 * (1.0 - 1.0 / 20_000.0))).abs() < 1e-12);
    assert_eq!((s[260_000].rgb, s[260_000].opacity), ([0.2, 0.3, 0.9], 1.0));
    assert_eq!(
        (
            scene.surface.z_threshold,
            scene.image.background,
            scene.materials.len()
        ),
        (0.06, [1.0; 4], 2)
    );
}

#[test]
fn every_cloud_has_the_requested_number_of_valid_splats() {
    for builtin in Builtin::ALL {
        for count in (1..40).chain([399, 1000, 12_345]) {
            let splats = builtin.splats(Some(count));
            assert_eq!(splats.len(), count, "{builtin:?}");
            let sound = |s: &Splat| {
                (s.normal.length() - 1.0).abs() < 1e-12
                    && s.radius > 0.0
                    && s.radius.is_finite()
                    && s.position.is_finite()
                    && s.rgb
                        .iter()
                        .chain([&s.opacity])
                        .all(|c| (0.0..=1.0).contains(c))
                    && (s.material as usize) < builtin.materials().len()
            };
            assert!(splats.iter().all(sound), "{builtin:?} {count}");
        }
    }
}

/// The radius is the spacing of the samples: a ball of that radius around a splat contains a few
/// others, not dozens.
#[test]
fn radii_are_the_spacing_of_the_samples() {
    for builtin in Builtin::ALL {
        let splats = builtin.splats(Some(20_000));
        let near = |s: &Splat| {
            splats
                .iter()
                .filter(|o| (o.position - s.position).length() < 1.5 * s.radius)
                .count()
        };
        let counts: Vec<usize> = splats.iter().step_by(501).map(near).collect();
        let mean = counts.iter().sum::<usize>() as f64 / counts.len() as f64;
        // A disc of radius 1.5 σ on samples of spacing σ holds π·1.5² = 7.07 of them.
        assert!((5.0..8.5).contains(&mean), "{builtin:?}: {mean}");
    }
}

#[test]
fn no_splat_of_the_checkerboard_is_wider_than_half_a_check() {
    let widest = Builtin::Checkerboard
        .splats(None)
        .iter()
        .map(|s| s.radius)
        .fold(0.0, f64::max);
    assert!(widest < 0.5, "{widest}");
}

#[test]
fn shuffling_keeps_every_splat_and_depends_only_on_the_seed() {
    let splats = glass_spheres(1000);
    let mut shuffled = splats.clone();
    shuffle(&mut shuffled, 1);
    let places = |splats: &[Splat]| -> HashSet<[u64; 3]> {
        splats
            .iter()
            .map(|s| s.position.to_array().map(f64::to_bits))
            .collect()
    };
    assert_eq!(places(&splats), places(&shuffled));
    let mut numbers: Vec<Splat> = (0..10)
        .map(|i| Splat {
            material: i,
            ..splats[0]
        })
        .collect();
    shuffle(&mut numbers, 1);
    assert_eq!(
        numbers.iter().map(|s| s.material).collect::<Vec<_>>(),
        [9, 0, 1, 4, 8, 2, 3, 7, 6, 5]
    );
}

#[test]
fn splitmix64_is_the_published_one() {
    // First outputs for the seed 1234567, as in Vigna's reference.
    let step = |n: u64| mix(1_234_567u64.wrapping_add(0x9e37_79b9_7f4a_7c15u64.wrapping_mul(n)));
    assert_eq!(
        [step(1), step(2)],
        [6_457_827_717_110_365_317, 3_203_168_211_198_807_973]
    );
}

#[test]
fn every_name_is_a_scene_with_its_splats_in_view() {
    for builtin in Builtin::ALL {
        let scene = Scene::load(
            builtin.name(),
            &Overrides {
                size: Some((64, 48)),
            },
        )
        .unwrap();
        assert_eq!(
            (scene.name.as_str(), scene.image.width, scene.image.height),
            (builtin.name(), 64, 48)
        );
        let view = scene.view();
        let visible = |s: &&Splat| {
            let t = view.rotation * (s.position - view.eye);
            t.z > scene.camera.near
                && t.x.abs() * view.focal_px[0] < t.z * 32.0
                && t.y.abs() * view.focal_px[1] < t.z * 24.0
        };
        let share = scene.splats.iter().filter(visible).count() as f64 / scene.splats.len() as f64;
        assert!(share > 0.5, "{builtin:?}: {share}");
    }
}

//! Does the f64 renderer keep the laws of splatting (docs/book/algorithm.md §3 to §6,
//! docs/book/algorithm-resolve.md §7 and §8)? Small generated scenes.

use std::f64::consts::{PI, TAU};

use crate::handmade::{Rng, confetti, glass, scene, splat};
use crate::tier;
use glam::{DMat3, DVec3};
use splatsim::golden::{
    Decision, FragmentDepth, Group, Merge, Rendering, Rules, ideal, ideal_of, pixel_trace, render,
};
use splatsim::scene::{Camera, Image, Kernel, Light, Material, Scene, Splat};

fn every_rule() -> Vec<Rules> {
    let mut all = Vec::new();
    for layers in [1, 2, 3, 8] {
        for merge in [
            Merge::NearestPair,
            Merge::FarthestPair,
            Merge::Replace,
            Merge::Window,
        ] {
            for evict_hidden in [false, true] {
                for fragment_depth in [FragmentDepth::First, FragmentDepth::Nearest] {
                    let turn_normals = evict_hidden;
                    for group in [Group::First, Group::Interval, Group::Window] {
                        let rules = Rules {
                            layers,
                            merge,
                            evict_hidden,
                            turn_normals,
                            fragment_depth,
                            group,
                            ..Rules::default()
                        };
                        // Windows define their own depths.
                        let is_new =
                            merge != Merge::Window || fragment_depth == FragmentDepth::First;
                        all.extend((rules.is_legal() && is_new).then_some(rules));
                    }
                }
            }
        }
    }
    all
}

fn greatest_difference(a: &Rendering, b: &Rendering) -> f64 {
    let pairs = a
        .picture
        .rgba
        .as_flattened()
        .iter()
        .zip(b.picture.rgba.as_flattened());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Σw over the picture. If no weight reaches the coverage threshold, alpha is the weight in units
/// of the threshold.
fn total_weight(mut scene: Scene) -> f64 {
    scene.surface.coverage_threshold = 1.0;
    ideal(&scene)
        .picture
        .rgba
        .iter()
        .map(|pixel| pixel[3])
        .sum()
}

/// `k²·|c_n|·(1 − e^(−cutoff/2))` for a disc of k pixels in the middle of the picture.
fn expected_weight(k: f64, c_n: f64, cutoff: f64) -> f64 {
    k * k * c_n.abs() * (1.0 - (-cutoff / 2.0).exp())
}

// --- Footprints ---

/// One splat of k = 40 pixels in the middle of 200×200, tilted by `tilt` towards the direction
/// `turn` in the image plane.
fn tilted(tilt: f64, turn: f64) -> Scene {
    let normal = DMat3::from_rotation_z(turn) * DVec3::new(tilt.sin(), 0.0, -tilt.cos());
    scene(
        200,
        200,
        200.0,
        vec![Splat {
            normal,
            ..splat([0.0, 0.0, 1.0], 0.2)
        }],
    )
}

#[test]
fn a_footprint_turned_in_the_image_plane_deposits_the_same_weight() {
    for tilt in [0.0, 0.5, 1.0, 1.4] {
        for turn in 0..12 {
            let weight = total_weight(tilted(tilt, f64::from(turn) * TAU / 12.0 + 0.1));
            let expected = expected_weight(40.0, tilt.cos(), 2.0);
            assert!(
                (weight / expected - 1.0).abs() < 0.01,
                "tilt {tilt} turn {turn}: {weight}, not {expected}"
            );
        }
    }
}

#[test]
fn a_tilted_footprint_deposits_the_cosine_of_its_weight() {
    for cutoff in [2.0, 4.0] {
        for tilt in 0..9 {
            let tilt = f64::from(tilt) * PI / 18.0;
            let mut scene = tilted(tilt, 0.3);
            scene.kernel.cutoff = cutoff;
            let (weight, expected) = (
                total_weight(scene),
                expected_weight(40.0, tilt.cos(), cutoff),
            );
            assert!(
                (weight / expected - 1.0).abs() < 0.01,
                "tilt {tilt}: {weight}, not {expected}"
            );
        }
    }
}

/// Off the axis, `c_n = n·(a, b, 1)` is not a cosine, and the ellipse is stretched.
#[test]
fn a_footprint_off_the_axis_deposits_its_weight_times_c_n() {
    let normal = DVec3::new(0.6, 0.3, -1.0).normalize();
    let scene = scene(
        300,
        300,
        200.0,
        vec![Splat {
            normal,
            ..splat([0.3, -0.25, 1.0], 0.1)
        }],
    );
    let expected = expected_weight(20.0, normal.dot(DVec3::new(0.3, -0.25, 1.0)), 2.0);
    assert!((total_weight(scene) / expected - 1.0).abs() < 0.01);
}

/// EWA's first limit: a footprint much larger than a pixel is the reconstruction kernel itself.
#[test]
fn magnified_a_footprint_is_the_kernel() {
    let scene = scene(100, 100, 100.0, vec![splat([0.0, 0.0, 1.0], 5.0)]);
    for (x, y) in [(50, 50), (3, 90), (99, 0)] {
        let (dx, dy) = (x as f64 - 49.5, y as f64 - 49.5);
        let kernel = (-0.5 * (dx * dx + dy * dy) / (500.0 * 500.0)).exp() / TAU;
        let weight = pixel_trace(&scene, &Rules::default(), x, y).contributions[0].weight;
        assert!((weight / kernel - 1.0).abs() < 1e-5, "{weight} {kernel}");
    }
}

/// EWA's second limit: a footprint much smaller than a pixel is the low-pass filter alone, times
/// the visible area of the disc.
#[test]
fn minified_a_footprint_is_the_low_pass_filter() {
    let normal = DVec3::new(0.5, 0.0, -1.0).normalize();
    for v in [1.0, 2.25] {
        let mut scene = scene(
            100,
            100,
            100.0,
            vec![Splat {
                normal,
                ..splat([0.0, 0.0, 1.0], 1e-5)
            }],
        );
        scene.kernel = Kernel {
            cutoff: 4.0,
            low_pass: v,
            ..scene.kernel
        };
        for (x, y) in [(50, 50), (48, 50), (49, 51)] {
            let (dx, dy) = (x as f64 - 49.5, y as f64 - 49.5);
            let filter = 1e-6 * -normal.z / (TAU * v) * (-0.5 * (dx * dx + dy * dy) / v).exp();
            let weight = pixel_trace(&scene, &Rules::default(), x, y).contributions[0].weight;
            assert!((weight / filter - 1.0).abs() < 1e-5, "{weight} {filter}");
        }
    }
}

/// SS §7 assumes that the weights of a surface sum to about 1: with σ = spacing and cutoff r the
/// sum is 1 − e^(−r/2).
#[test]
fn the_weights_of_a_dense_grid_sum_to_nearly_one() {
    for (cutoff, expected) in [(2.0, 0.632), (4.0, 0.865)] {
        let at = |index: usize| (index as f64 - 30.3) * 0.0413;
        let splats = (0..3600).map(|index| splat([at(index % 60), at(index / 60), 1.0], 0.0413));
        let mut scene = scene(60, 60, 60.0, splats.collect());
        scene.kernel.cutoff = cutoff;
        let mean = total_weight(scene) / 3600.0;
        assert!((mean - expected).abs() < 0.01, "{mean}, not {expected}");
    }
}

/// The depth of the tangent plane, to first order, and the clamp where a low-pass filter widens the
/// footprint beyond the disc.
#[test]
fn depth_follows_the_tangent_plane_as_far_as_the_disc_reaches() {
    let normal = DVec3::new(1.0, 0.0, -1.0).normalize();
    let scene = scene(
        100,
        100,
        100.0,
        vec![Splat {
            normal,
            ..splat([0.0, 0.0, 2.0], 0.2)
        }],
    );
    let z = |x| pixel_trace(&scene, &Rules::default(), x, 50).contributions[0].z;
    // z = 2 + x on the plane; a pixel is 0.02 wide there.
    assert!((z(53) - (2.0 + 3.5 * 0.02)).abs() < 1e-12);
    let thin = DVec3::new(1.0, 0.0, -0.01).normalize();
    let grazing = self::scene(
        100,
        100,
        100.0,
        vec![Splat {
            normal: thin,
            ..splat([0.0, 0.0, 2.0], 0.02)
        }],
    );
    let z = pixel_trace(&grazing, &Rules::default(), 50, 50).contributions[0].z;
    assert!((z - (2.0 + 0.02 * 2.0_f64.sqrt())).abs() < 1e-12, "{z}");
}

/// A needle along the diagonal, where √½·√½ rounds to more than ½, so that the rounded conic is not
/// positive.
#[test]
fn a_weight_never_exceeds_its_amplitude() {
    let normal = DVec3::new(0.5_f64.sqrt(), 0.5_f64.sqrt(), 1e-9);
    let mut scene = scene(
        9,
        9,
        9.0,
        vec![Splat {
            normal,
            ..splat([0.0, 0.0, 1.0], 1.0)
        }],
    );
    scene.kernel.low_pass = 0.0;
    let arrivals = pixel_trace(&scene, &Rules::default(), 6, 2).contributions;
    assert!(
        arrivals[0].radial_index < 0.0 && arrivals[0].weight <= 1.0 / TAU,
        "{arrivals:?}"
    );
}

// --- Culling ---

#[test]
fn a_splat_is_culled_by_the_first_reason_that_holds() {
    let away = |position| Splat {
        normal: DVec3::Z,
        ..splat(position, 0.1)
    };
    let edge_on = Splat {
        normal: DVec3::X,
        ..splat([0.0, 0.0, 1.0], 0.1)
    };
    // The picture ends at 0.5, the affine approximation at 0.75.
    let splats = vec![
        away([0.0, 0.0, -1.0]),
        splat([0.0, 0.0, 0.01], 0.1),
        away([0.7, 0.0, 1.0]),
        splat([-0.7, 0.0, 1.0], 0.1),
        splat([0.0, 0.7, 1.0], 0.1),
        splat([0.76, 0.0, 1.0], 10.0),
        splat([0.0, -0.76, 1.0], 10.0),
        splat([0.74, -0.74, 1.0], 10.0),
        away([0.0, 0.0, 1.0]),
        away([0.2, 0.1, 1.0]),
        away([0.1, 0.2, 1.0]),
        edge_on,
    ];
    let mut scene = scene(40, 40, 40.0, splats);
    scene.surface.cull_backfaces = true;
    let culled = render(&scene, &Rules::default()).culled;
    assert_eq!(
        (culled.near, culled.outside, culled.backface, culled.faint),
        (2, 5, 3, 1)
    );
    scene.surface.cull_backfaces = false;
    assert_eq!(render(&scene, &Rules::default()).culled.backface, 0);
}

// --- Fragments ---

#[test]
fn outcomes_sum_to_fragments() {
    let scene = confetti(300, 1);
    for rules in every_rule() {
        let golden = render(&scene, &rules);
        assert_eq!(golden.outcomes.total(), golden.fragments, "{rules:?}");
    }
    let ideal = ideal(&scene);
    assert_eq!(ideal.outcomes.total(), ideal.fragments);
}

#[test]
fn a_pixel_trace_ends_with_the_colour_of_the_picture() {
    let scene = confetti(300, 2);
    for rules in tier::some([12, 3], every_rule()) {
        let golden = render(&scene, &rules);
        let mut arrivals = 0;
        for (index, pixel) in golden.picture.rgba.iter().enumerate() {
            let trace = pixel_trace(&scene, &rules, index % 40, index / 40);
            assert_eq!(trace.rgba, *pixel);
            assert_eq!(
                !trace.contributions.is_empty(),
                golden.picture.covered[index]
            );
            arrivals += trace.contributions.len() as u64;
        }
        assert_eq!(arrivals, golden.fragments);
    }
}

#[test]
fn ideal_does_not_depend_on_the_order_of_splats() {
    let mut scene = confetti(300, 3);
    let first = ideal(&scene);
    for seed in 0..5 {
        Rng(seed).shuffle(&mut scene.splats);
        let other = ideal(&scene);
        assert!(greatest_difference(&first, &other) < 1e-12);
        assert_eq!(
            (first.fragments, first.outcomes),
            (other.fragments, other.outcomes)
        );
    }
}

/// Five glass sheets 2ε apart, each rougher than a plane but thinner than ε.
#[test]
fn enough_layers_make_golden_equal_ideal() {
    let scene = glass(5, 4);
    let ideal = ideal(&scene);
    assert!(ideal.outcomes.most_surfaces_in_a_pixel == 5);
    for merge in [Merge::NearestPair, Merge::FarthestPair] {
        let golden = |layers| {
            render(
                &scene,
                &Rules {
                    layers,
                    merge,
                    evict_hidden: false,
                    ..Rules::default()
                },
            )
        };
        assert!(greatest_difference(&golden(5), &ideal) < 1e-12);
        assert!(greatest_difference(&golden(4), &ideal) > 1e-3);
    }
}

#[test]
fn replace_is_a_z_buffer() {
    let mut scene = confetti(300, 5);
    scene.materials = vec![Material::Unlit; 2];
    scene.image.background = [0.0; 4];
    let rules = Rules {
        layers: 1,
        merge: Merge::Replace,
        ..Rules::default()
    };
    let golden = render(&scene, &rules);
    for (index, pixel) in golden.picture.rgba.iter().enumerate() {
        // z, W, Σw·α, Σw·rgb
        let mut held: Option<(f64, f64, f64, DVec3)> = None;
        for arrival in pixel_trace(&scene, &Rules::default(), index % 40, index / 40).contributions
        {
            let (splat, w) = (&scene.splats[arrival.splat], arrival.weight);
            let new = (
                arrival.z,
                w,
                w * splat.opacity,
                w * DVec3::from_array(splat.rgb),
            );
            held = Some(match held {
                Some(old) if (new.0 - old.0).abs() < scene.surface.z_threshold => {
                    (old.0, old.1 + new.1, old.2 + new.2, old.3 + new.3)
                }
                Some(old) if old.0 <= new.0 => old,
                _ => new,
            });
        }
        let (_, weight, alpha, rgb) = held.unwrap_or((0.0, 1.0, 0.0, DVec3::ZERO));
        let coverage = alpha / weight * (weight / scene.surface.coverage_threshold).min(1.0);
        let expected = (rgb / weight * coverage).extend(coverage).to_array();
        assert!(
            pixel
                .iter()
                .zip(expected)
                .all(|(a, b)| (a - b).abs() < 1e-12),
            "{pixel:?} {expected:?}"
        );
    }
    assert!(
        golden.outcomes.replaced > 0 && golden.outcomes.dropped > 0 && golden.outcomes.merged == 0
    );
}

#[test]
fn an_opaque_splat_hides_all_behind_it() {
    let mut scene = confetti(100, 6);
    for splat in &mut scene.splats {
        splat.position *= 2.0;
    }
    scene.surface.coverage_threshold = 0.05;
    let wall = Splat {
        rgb: [0.3, 0.6, 0.9],
        ..splat([0.0, 0.0, 0.5], 1.0)
    };
    for place in [0, 50, 100] {
        let mut hidden = scene.clone();
        hidden.splats.insert(place, wall);
        let pictures = every_rule()
            .into_iter()
            .map(|rules| render(&hidden, &rules))
            .chain([ideal(&hidden)]);
        for rendering in pictures {
            for pixel in &rendering.picture.rgba {
                let error = pixel
                    .iter()
                    .zip([0.3, 0.6, 0.9, 1.0])
                    .map(|(a, b)| (a - b).abs())
                    .fold(0.0, f64::max);
                assert!(error < 1e-12, "{pixel:?}");
            }
        }
    }
}

/// Lossless while the opaque fragment stays: the picture equals that without eviction, with fewer
/// merges.
#[test]
fn eviction_of_hidden_fragments_leaves_the_picture() {
    let mut scene = confetti(400, 7);
    scene.surface.coverage_threshold = 0.1;
    scene
        .splats
        .iter_mut()
        .for_each(|splat| splat.opacity = 1.0);
    let rules = Rules {
        layers: 8,
        merge: Merge::FarthestPair,
        evict_hidden: false,
        ..Rules::default()
    };
    let (merging, evicting) = (
        render(&scene, &rules),
        render(
            &scene,
            &Rules {
                evict_hidden: true,
                ..rules
            },
        ),
    );
    assert!(evicting.outcomes.evicted > 0 && evicting.outcomes.merged < merging.outcomes.merged);
    assert!(greatest_difference(&merging, &evicting) < 0.1);
}

// --- Shading ---

/// The colour of the middle pixel of one large lit splat.
fn lit(normal: DVec3, light: DVec3, material: Material) -> [f64; 3] {
    let mut scene = scene(
        10,
        10,
        10.0,
        vec![Splat {
            normal,
            rgb: [0.5, 0.25, 1.0],
            ..splat([0.0, 0.0, 1.0], 2.0)
        }],
    );
    scene.surface.coverage_threshold = 0.01;
    scene.lights = vec![Light {
        direction: light,
        rgb: [1.0, 0.5, 0.25],
    }];
    scene.materials = vec![material];
    let [r, g, b, a] = ideal(&scene).picture.rgba[55];
    assert_eq!(a, 1.0);
    [r, g, b]
}

fn assert_colour(colour: [f64; 3], expected: [f64; 3]) {
    assert!(
        colour
            .iter()
            .zip(expected)
            .all(|(a, b)| (a - b).abs() < 1e-12),
        "{colour:?}, not {expected:?}"
    );
}

#[test]
fn blinn_phong_in_numbers() {
    let material = Material::BlinnPhong {
        ambient: 0.25,
        diffuse: 0.5,
        specular: 0.125,
        shininess: 2.0,
    };
    // Light from the eye: N·L = N·H = 1.
    let expected = [0.5 * 0.75 + 0.125, 0.25 * 0.5 + 0.0625, 0.375 + 0.03125];
    assert_colour(lit(DVec3::NEG_Z, DVec3::NEG_Z, material), expected);
    // Turned away from the eye: flipped, so the result is the same.
    assert_colour(lit(DVec3::Z, DVec3::NEG_Z, material), expected);
    // From the side: N·L = 0, N·H = √½.
    let expected = [0.125 + 0.0625, 0.0625 + 0.03125, 0.25 + 0.015625];
    assert_colour(lit(DVec3::NEG_Z, DVec3::X, material), expected);
    // From the far side of a slope: the halfway vector also points away from it, N·H < 0.
    assert_colour(
        lit(DVec3::new(0.8, 0.0, -0.6), DVec3::NEG_X, material),
        [0.125, 0.0625, 0.25],
    );
    // From straight behind: no halfway vector, only ambient.
    assert_colour(lit(DVec3::NEG_Z, DVec3::Z, material), [0.125, 0.0625, 0.25]);
}

#[test]
fn shading_ends_at_one_and_unlit_is_the_colour_itself() {
    let blinding = Material::BlinnPhong {
        ambient: 9.0,
        diffuse: 0.0,
        specular: 0.0,
        shininess: 1.0,
    };
    assert_colour(lit(DVec3::NEG_Z, DVec3::NEG_Z, blinding), [1.0, 1.0, 1.0]);
    assert_colour(
        lit(DVec3::NEG_Z, DVec3::NEG_Z, Material::Unlit),
        [0.5, 0.25, 1.0],
    );
}

#[test]
fn normals_that_cancel_leave_ambient_light() {
    let material = Material::BlinnPhong {
        ambient: 0.5,
        diffuse: 1.0,
        specular: 1.0,
        shininess: 1.0,
    };
    let front = splat([0.0, 0.0, 1.0], 2.0);
    let mut scene = scene(
        10,
        10,
        10.0,
        vec![
            front,
            Splat {
                normal: DVec3::Z,
                ..front
            },
        ],
    );
    scene.surface.coverage_threshold = 0.01;
    scene.lights = vec![Light {
        direction: DVec3::NEG_Z,
        rgb: [1.0; 3],
    }];
    scene.materials = vec![material];
    assert_eq!(
        ideal_of(&scene, false).picture.rgba[55],
        [0.5, 0.5, 0.5, 1.0]
    );
    // Turned towards the viewer, both normals are equal.
    assert_eq!(ideal(&scene).picture.rgba[55], [1.0; 4]);
    for turn_normals in [false, true] {
        let golden = render(
            &scene,
            &Rules {
                turn_normals,
                ..Rules::default()
            },
        );
        assert_eq!(golden.picture, ideal_of(&scene, turn_normals).picture);
    }
}

/// A light is fixed in the world, not relative to the camera.
#[test]
fn lights_are_given_in_world_space() {
    let material = Material::BlinnPhong {
        ambient: 0.0,
        diffuse: 1.0,
        specular: 0.0,
        shininess: 1.0,
    };
    let mut scene = scene(
        10,
        10,
        10.0,
        vec![Splat {
            normal: DVec3::X,
            ..splat([0.0, 0.0, 0.0], 2.0)
        }],
    );
    scene.camera = Camera {
        eye: DVec3::X,
        target: DVec3::ZERO,
        up: DVec3::Y,
        ..scene.camera
    };
    scene.surface.coverage_threshold = 0.01;
    scene.lights = vec![Light {
        direction: DVec3::X,
        rgb: [1.0; 3],
    }];
    scene.materials = vec![material];
    assert!((ideal(&scene).picture.rgba[55][0] - 1.0).abs() < 1e-12);
}

#[test]
fn the_background_is_straight_and_the_picture_premultiplied() {
    let mut scene = scene(3, 2, 2.0, Vec::new());
    scene.image.background = [0.5, 1.0, 0.25, 0.5];
    let rendering = ideal(&scene);
    assert_eq!(rendering.picture.rgba, vec![[0.25, 0.5, 0.125, 0.5]; 6]);
    assert_eq!(rendering.picture.covered, vec![false; 6]);
}

// --- Determinism, and scenes on the edge ---

#[test]
fn two_threads_draw_what_one_draws() {
    let mut scene = confetti(1000, 8);
    scene.image = Image {
        width: 150,
        height: 90,
        ..scene.image
    };
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| (render(&scene, &Rules::default()), ideal(&scene)))
    };
    assert!(with(1) == with(2) && with(1) == with(5));
}

#[test]
fn no_valid_scene_is_too_odd() {
    let radii = [1e-300, 1e-20, 1e-3, 1.0, 1e20, 1e200];
    let normals = [
        DVec3::NEG_Z,
        DVec3::X,
        DVec3::new(1.0, 0.0, 1e-300),
        DVec3::new(1.0, 1e-9, -1e-9).normalize(),
    ];
    let mut splats = vec![
        splat([0.0, 0.0, 1e300], 1.0),
        splat([1e300, 1e300, 1e-300], 1.0),
    ];
    for radius in radii {
        splats.extend(normals.map(|normal| Splat {
            normal,
            ..splat([0.01, 0.0, 1.0], radius)
        }));
    }
    for (width, height) in [(1, 1), (16384, 1), (1, 16384), (17, 33)] {
        for (low_pass, cutoff) in [(0.0, 2.0), (1.0, 1e-9), (1.0, 1e6)] {
            let mut scene = scene(width, height, 10.0, splats.clone());
            scene.kernel = Kernel {
                cutoff,
                low_pass,
                ..scene.kernel
            };
            for rendering in [render(&scene, &Rules::default()), ideal(&scene)] {
                assert!(
                    rendering
                        .picture
                        .rgba
                        .as_flattened()
                        .iter()
                        .all(|value| (0.0..=1.0 + 1e-12).contains(value))
                );
                assert_eq!(rendering.outcomes.total(), rendering.fragments);
            }
            scene.splats.clear();
            assert_eq!(render(&scene, &Rules::default()).fragments, 0);
        }
    }
}

#[test]
fn a_pixel_outside_the_picture_has_an_empty_trace() {
    assert!(
        pixel_trace(&confetti(10, 9), &Rules::default(), 40, 0)
            .contributions
            .is_empty()
    );
}

#[test]
fn a_decision_names_its_slot() {
    let scene = scene(10, 10, 10.0, vec![splat([0.0, 0.0, 1.0], 1.0); 2]);
    let trace = pixel_trace(&scene, &Rules::default(), 5, 5);
    let decisions: Vec<Decision> = trace
        .contributions
        .iter()
        .map(|arrival| arrival.decision)
        .collect();
    assert_eq!(
        decisions,
        [
            Decision::Inserted { slot: 0 },
            Decision::Accumulated { slot: 0 }
        ]
    );
    assert_eq!(
        (trace.layers.len(), trace.layers[0].coverage),
        (1, 2.0 * trace.contributions[0].weight / 0.4)
    );
}

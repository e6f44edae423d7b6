//! Does the rule `window` agree with the measurements of an independent program, and does it keep
//! its laws (docs/book/algorithm-resolve.md §11)?

use crate::golden_match::{glass_spheres, permutation};
use crate::handmade::{Rng, confetti, glass, scene, splat};
use crate::shared_input;
use crate::tier::{self, Tier};
use splatsim::accuracy::metrics;
use splatsim::golden::{Group, Merge, Rendering, Rules, WindowOptions, ideal, ideal_of, render};
use splatsim::scene::{Overrides, Scene, Splat};

fn window(layers: usize) -> Rules {
    Rules {
        layers,
        group: Group::Window,
        merge: Merge::Window,
        ..Rules::default()
    }
}

/// The simpler rule: fragments as wide as ε, none summed.
fn intervals(layers: usize) -> Rules {
    Rules {
        group: Group::Interval,
        ..window(layers)
    }
}

fn unturned(rules: Rules) -> Rules {
    Rules {
        turn_normals: false,
        ..rules
    }
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

// --- Measurements of an independent program ---

/// Prints the measurements; returns whether all of them are within 0.3 dB of the published ones.
fn agree(scene: &Scene, rows: &[(Rules, f64)]) -> bool {
    let ideals = [false, true].map(|turned| ideal_of(scene, turned).picture);
    let mut all = true;
    for (rules, published) in rows {
        let golden = render(scene, rules);
        let db = metrics(&golden.picture, &ideals[usize::from(rules.turn_normals)])
            .psnr_db
            .unwrap_or(f64::INFINITY);
        let [merged, summed] =
            [golden.outcomes.merged, golden.outcomes.summed].map(|count| count / 1000);
        let (layers, group, join, turned) = (
            rules.layers,
            rules.group,
            rules.window.join,
            rules.turn_normals,
        );
        println!(
            "l = {layers} {group:?} join {join} turned {turned}: {db:.2} dB of {published}, {merged} k merged, {summed} k summed"
        );
        all &= (db - published).abs() <= 0.3;
    }
    all
}

#[test]
fn the_figures_of_the_check_scene_in_surface_order() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let join = |rules| Rules {
        window: WindowOptions {
            join: 0.1,
            ..WindowOptions::default()
        },
        ..rules
    };
    let plain = |layers| unturned(window(layers));
    let rows = [
        (plain(2), 40.6),
        (plain(3), 54.0),
        (plain(4), 58.6),
        (join(plain(3)), 52.7),
        (window(3), 53.8),
        (window(4), 58.1),
        (intervals(3), 49.4),
        (intervals(4), 50.5),
    ];
    assert!(agree(&glass_spheres(), &rows));
}

#[test]
fn the_figures_of_the_check_scene_in_random_order() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let mut scene = glass_spheres();
    scene.splats = permutation(scene.splats.len())
        .into_iter()
        .map(|index| scene.splats[index])
        .collect();
    let plain = |layers| unturned(window(layers));
    let rows = [
        (plain(2), 41.5),
        (plain(3), 47.2),
        (plain(4), 52.1),
        (window(4), 51.7),
        (intervals(3), 46.1),
    ];
    assert!(agree(&scene, &rows));
}

#[test]
fn the_figures_of_the_dragon() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let Some(path) = shared_input::find("scenes/dragon.json") else {
        return;
    };
    let scene = Scene::load(path.to_str().unwrap(), &Overrides::default()).unwrap();
    let plain = |layers| unturned(window(layers));
    let rows = [
        (plain(2), 41.5),
        (plain(3), 47.1),
        (plain(4), 49.5),
        (window(4), 51.1),
        (intervals(3), 42.8),
    ];
    assert!(agree(&scene, &rows));
}

#[test]
fn merges_of_the_check_scene_become_sums() {
    let scene = glass_spheres();
    let golden = render(&scene, &unturned(window(3)));
    println!("{:?}", golden.outcomes);
    assert_eq!(
        [golden.outcomes.merged, golden.outcomes.summed].map(|count| count / 1000),
        [47, 1295]
    );
    let join = WindowOptions {
        join: 0.1,
        ..WindowOptions::default()
    };
    assert_eq!(
        render(
            &scene,
            &Rules {
                window: join,
                ..unturned(window(3))
            }
        )
        .outcomes
        .summed
            / 1000,
        303
    );
}

// --- Laws ---

#[test]
fn windows_equal_ideal_where_every_surface_has_a_slot() {
    for sheets in [1, 5, 8] {
        let scene = glass(sheets, sheets as u64);
        let ideal = ideal(&scene);
        assert_eq!(ideal.outcomes.most_surfaces_in_a_pixel, sheets as u64);
        for layers in sheets..=8 {
            let golden = render(&scene, &window(layers));
            assert!(
                greatest_difference(&golden, &ideal) < 1e-12,
                "{sheets} sheets, l = {layers}"
            );
            assert_eq!(
                golden.outcomes.merged + golden.outcomes.late + golden.outcomes.inside,
                0
            );
        }
    }
    let scene = glass(5, 5);
    assert!(greatest_difference(&render(&scene, &window(4)), &ideal(&scene)) > 1e-3);
}

/// Contributions to a surface with its own slot may come in any order.
#[test]
fn the_order_of_arrival_is_nothing_where_every_surface_has_a_slot() {
    let mut scene = glass(5, 11);
    let first = render(&scene, &window(5));
    for seed in 0..3 {
        Rng(seed).shuffle(&mut scene.splats);
        assert!(greatest_difference(&render(&scene, &window(5)), &first) < 1e-12);
    }
}

#[test]
fn one_splat_none_and_all_at_one_depth_are_ideal() {
    let mut rng = Rng(3);
    let wall = (0..200).map(|_| Splat {
        opacity: rng.roll(),
        ..splat([rng.within(0.6), rng.within(0.4), 1.0], 0.05)
    });
    for splats in [
        Vec::new(),
        vec![splat([0.0, 0.0, 1.0], 0.1)],
        wall.collect(),
    ] {
        let scene = scene(40, 24, 40.0, splats);
        let ideal = ideal(&scene);
        for rules in [1, 2, 8]
            .into_iter()
            .flat_map(|layers| [window(layers), intervals(layers)])
        {
            let golden = render(&scene, &rules);
            assert!(greatest_difference(&golden, &ideal) < 1e-12, "{rules:?}");
            assert_eq!(golden.outcomes.merged + golden.outcomes.summed, 0);
        }
    }
}

/// Fragments that span a depth interval within ε: with enough of them they are as good as the
/// paper's, in any order.
#[test]
fn intervals_go_with_the_paper_s_merges() {
    let scene = glass(5, 4);
    let ideal = ideal(&scene);
    for merge in [Merge::NearestPair, Merge::FarthestPair] {
        let rules = |layers| Rules {
            layers,
            merge,
            group: Group::Interval,
            evict_hidden: false,
            ..Rules::default()
        };
        assert!(greatest_difference(&render(&scene, &rules(5)), &ideal) < 1e-12);
        assert!(render(&scene, &rules(4)).outcomes.merged > 0);
    }
    // Within ε of the first, but not of each other: two intervals, but one fragment in the paper.
    let near = scene.surface.z_threshold * 0.75;
    let splats = [1.0, 1.0 - near, 1.0 + near]
        .map(|z| splat([0.0, 0.0, z], 1.0))
        .to_vec();
    let scene = self::scene(3, 3, 10.0, splats);
    let inserted = |group| {
        render(
            &scene,
            &Rules {
                group,
                ..Rules::default()
            },
        )
        .outcomes
        .inserted
    };
    assert_eq!((inserted(Group::First), inserted(Group::Interval)), (9, 18));
}

#[test]
fn incompatible_rules_are_reported() {
    let merges = [
        Merge::NearestPair,
        Merge::FarthestPair,
        Merge::Replace,
        Merge::Window,
    ];
    let legal = |group| {
        merges.map(|merge| {
            Rules {
                group,
                merge,
                ..Rules::default()
            }
            .is_legal()
        })
    };
    assert_eq!(legal(Group::First), [true, true, true, false]);
    assert_eq!(legal(Group::Interval), [true; 4]);
    assert_eq!(legal(Group::Window), [false, false, false, true]);
    let scene = confetti(200, 3);
    let odd = Rules {
        group: Group::Window,
        merge: Merge::Replace,
        ..Rules::default()
    };
    assert_eq!(render(&scene, &odd), render(&scene, &window(3)));
}

//! A tree of splats: its contents, the cut that a view draws, the cost of the walk, and invalid
//! files.

use crate::handmade::{Rng, confetti, scene, splat};
use crate::program::PROGRAM;
use glam::DVec3;
use rtl_model::Machine;
use rtl_model::timing::{self, Detail as Told, Requester};
use rtl_model::work::{self, Visit, Work};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use splatsim::accuracy::metrics;
use splatsim::golden::{Rules as Rendered, ideal, render};
use splatsim::hardware::{fixed, quantise::quantise};
use splatsim::performance::cost::{Cost, Prices};
use splatsim::performance::recording::Recording;
use splatsim::run::evaluation::Evaluation;
use splatsim::scene::tree::cut::{Budget, Detail, DetailRules, DrawOrder, VisitResult};
use splatsim::scene::tree::{Tree, file};
use splatsim::scene::{Overrides, Scene, Splat};
use std::collections::BTreeSet;
use std::process::Command;
use std::sync::Arc;

const EVERYTHING: DetailRules = DetailRules {
    pixels: 0.0,
    order: DrawOrder::Walk,
    culls: false,
    ahead: 4,
    budget: Budget {
        splats: None,
        bytes: None,
        cycles: None,
    },
};

/// Splats on a ball of radius 1, whose spacing is their width, seen from 4 units from its middle.
fn ball(count: usize) -> Scene {
    let mut rng = Rng(7);
    let radius = (4.0 * std::f64::consts::PI / count as f64).sqrt();
    let splats = (0..count).map(|_| {
        let normal = rng.direction();
        let rgb = [0.5 + 0.5 * normal.x, 0.5 + 0.5 * normal.y, rng.roll()];
        Splat {
            normal,
            rgb,
            opacity: 0.5 + 0.5 * rng.roll(),
            ..splat((normal + 4.0 * DVec3::Z).to_array(), radius)
        }
    });
    let mut scene = scene(48, 40, 60.0, splats.collect());
    scene.surface.z_threshold = 4.0 * radius;
    scene
}

/// The scene as a cut of its tree.
fn cut(scene: &Scene, children: usize, rules: DetailRules) -> Scene {
    let tree = Tree::new(&scene.splats, children).unwrap();
    Scene {
        detail: Some(Detail::new(Arc::new(tree), rules)),
        ..scene.clone()
    }
    .cut()
}

fn detail(scene: &Scene) -> &Detail {
    scene.detail.as_ref().unwrap()
}

/// Positions of all leaves below a node.
fn below(tree: &Tree, number: usize, all: &mut Vec<u32>) {
    let node = &tree.nodes()[number];
    if node.is_leaf() {
        all.push(node.first);
    }
    node.below()
        .filter(|_| !node.is_leaf())
        .for_each(|child| below(tree, child, all));
}

fn leaves_below(tree: &Tree, number: usize) -> Vec<u32> {
    let mut all = Vec::new();
    below(tree, number, &mut all);
    all.sort_unstable();
    all
}

/// One splat, two, all at one position, opposite normals, a row, and crowds.
fn crowds() -> Vec<Vec<Splat>> {
    let facing = |normal: DVec3, nth: usize| Splat {
        normal,
        ..splat([0.01 * nth as f64, 0.0, 2.0], 0.02)
    };
    vec![
        vec![splat([0.0, 0.0, 2.0], 0.1)],
        vec![splat([0.0, 0.0, 2.0], 0.1), splat([0.0, 1.0, 2.0], 0.3)],
        vec![splat([0.1, 0.2, 2.0], 0.1); 37],
        (0..24)
            .map(|nth| facing(if nth % 2 == 0 { DVec3::Z } else { DVec3::NEG_Z }, nth))
            .collect(),
        (0..65)
            .map(|nth| splat([nth as f64, 0.0, 2.0], 1e-3))
            .collect(),
        vec![
            splat([1e30, -1e30, 1e30], 1e30),
            splat([-1e30, 1e30, 1e30], 1e-30),
            splat([0.0; 3], 1e-30),
        ],
        confetti(300, 3).splats,
        ball(500).splats,
    ]
}

#[test]
fn every_leaf_is_in_the_tree_once() {
    assert_eq!(Tree::new(&[], 4), None);
    for (nth, splats) in crowds().iter().enumerate() {
        for children in [2, 3, 4, 16, 64] {
            let tree = Tree::new(splats, children).unwrap();
            assert_eq!(tree.splats(), *splats, "crowd {nth}");
            assert_eq!(
                leaves_below(&tree, 0),
                (0..splats.len() as u32).collect::<Vec<_>>(),
                "crowd {nth}, {children} children"
            );
            assert!(tree.most_children() <= children);
            let inner = tree.nodes().iter().filter(|node| !node.is_leaf());
            assert!(
                inner.clone().all(|node| node.children >= 2)
                    && tree.leaves() + inner.count() == tree.nodes().len()
            );
        }
    }
}

#[test]
fn spheres_and_cones_hold_what_lies_below() {
    for (nth, splats) in crowds().iter().enumerate() {
        let tree = Tree::new(splats, 4).unwrap();
        for (number, node) in tree.nodes().iter().enumerate() {
            let place = format!("crowd {nth}, node {number}");
            assert!(
                node.sphere >= node.splat.radius && node.widest >= node.splat.radius,
                "{place}"
            );
            let numbers = node
                .splat
                .position
                .to_array()
                .into_iter()
                .chain(node.splat.rgb)
                .chain([node.splat.radius, node.splat.opacity]);
            assert!(
                numbers
                    .chain([node.sphere, node.widest])
                    .all(f64::is_finite),
                "{place}"
            );
            for leaf in leaves_below(&tree, number) {
                let leaf = &splats[leaf as usize];
                assert!(
                    (leaf.position - node.splat.position).length() + leaf.radius
                        <= node.sphere * (1.0 + 1e-12),
                    "{place}"
                );
                assert!(
                    leaf.normal.dot(node.splat.normal) >= node.cone && leaf.radius <= node.widest,
                    "{place}"
                );
            }
        }
    }
}

#[test]
fn a_tree_is_the_same_at_any_number_of_threads() {
    let splats = ball(20_000).splats;
    let [one, three] = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| file::bytes(&Tree::new(&splats, 4).unwrap()))
    });
    assert!(one == three);
}

#[test]
fn a_node_from_afar_is_as_bright_as_its_leaves() {
    // A flat patch seen from the front, whose weight is small within a pixel.
    let mut rng = Rng(5);
    let at = |nth: usize, rng: &mut Rng| {
        [
            0.01 * (nth % 20) as f64 - 0.095,
            0.01 * (nth / 20) as f64 - 0.095,
            5.0 + rng.within(1e-4),
        ]
    };
    let patch = (0..400).map(|nth| Splat {
        rgb: [rng.roll(), 0.5, rng.roll()],
        opacity: rng.roll(),
        ..splat(at(nth, &mut rng), 0.01)
    });
    let mut scene = scene(16, 16, 20.0, patch.collect());
    (scene.surface.coverage_threshold, scene.kernel.cutoff) = (1e3, 12.0);
    let sum = |scene: &Scene| {
        let rgba = render(scene, &Rendered::default()).picture.rgba;
        rgba.iter().fold([0.0; 4], |sum, pixel| {
            [0, 1, 2, 3].map(|i| sum[i] + pixel[i])
        })
    };
    let leaves = sum(&scene);
    for pixels in [0.5, 1.0, 1e6] {
        let coarse = cut(
            &scene,
            4,
            DetailRules {
                pixels,
                ..EVERYTHING
            },
        );
        assert!(coarse.splats.len() < 200, "{pixels}");
        let sum = sum(&coarse);
        assert!(
            (sum[3] / leaves[3] - 1.0).abs() < 0.03,
            "{pixels}: {sum:?}, {leaves:?}"
        );
        assert!(
            (0..3).all(|i| ((sum[i] / sum[3]) / (leaves[i] / leaves[3]) - 1.0).abs() < 0.03),
            "{pixels}: {sum:?}, {leaves:?}"
        );
    }
}

#[test]
fn at_no_pixels_the_leaves_are_drawn() {
    for order in [DrawOrder::Walk, DrawOrder::CoarseToFine] {
        let plain = confetti(200, 9);
        let all = cut(
            &plain,
            4,
            DetailRules {
                order,
                ..EVERYTHING
            },
        );
        let places: Vec<u32> = detail(&all)
            .cut
            .drawn
            .iter()
            .map(|node| detail(&all).tree.nodes()[*node as usize].first)
            .collect();
        assert_eq!(places.iter().collect::<BTreeSet<_>>().len(), 200);
        // Bit by bit like the same splats in that order.
        let listed = Scene {
            splats: places
                .iter()
                .map(|place| plain.splats[*place as usize])
                .collect(),
            ..plain.clone()
        };
        assert_eq!(all.splats, listed.splats);
        let machine = fixed::elaborate(&Machine::named("reference").unwrap()).unwrap();
        let [one, other] = [&all, &listed].map(|scene| {
            let evaluation = Evaluation::on(scene, &machine).unwrap();
            (evaluation.draw().frame, evaluation.golden().picture)
        });
        assert_eq!(one, other);
        assert_eq!(ideal(&all).picture, ideal(&plain).picture);
    }
}

#[test]
fn a_cut_covers_every_leaf_once() {
    let scene = ball(700);
    for (pixels, children) in [(0.0, 4), (1.5, 2), (4.0, 4), (10.0, 16), (1e6, 4)] {
        for order in [DrawOrder::Walk, DrawOrder::CoarseToFine] {
            let cut = cut(
                &scene,
                children,
                DetailRules {
                    pixels,
                    order,
                    ..EVERYTHING
                },
            );
            let Detail { tree, cut, .. } = detail(&cut);
            let mut covered: Vec<u32> = cut
                .drawn
                .iter()
                .flat_map(|node| leaves_below(tree, *node as usize))
                .collect();
            covered.sort_unstable();
            assert_eq!(
                covered,
                (0..700).collect::<Vec<u32>>(),
                "{pixels} pixels, {children} children"
            );
            assert!(cut.coarsest_px <= pixels);
            assert!(
                cut.visits
                    .iter()
                    .all(|visit| matches!(visit.found, VisitResult::Opened | VisitResult::Drawn))
            );
            assert_eq!(cut.drawn.len() == 1, pixels == 1e6);
        }
    }
}

#[test]
fn smaller_pixels_never_cut_coarser() {
    let scene = ball(900);
    let cuts: Vec<Scene> = [200.0, 64.0, 32.0, 16.0, 12.0, 9.0, 0.0]
        .map(|pixels| {
            cut(
                &scene,
                4,
                DetailRules {
                    pixels,
                    ..EVERYTHING
                },
            )
        })
        .into();
    let sizes: Vec<usize> = cuts.iter().map(|scene| scene.splats.len()).collect();
    assert!(
        sizes.is_sorted() && sizes[0] < 10 && sizes[2] < sizes[4] && sizes[6] == 900,
        "{sizes:?}"
    );
    // An opened node stays opened.
    let opened = |scene: &Scene| -> BTreeSet<u32> {
        detail(scene)
            .cut
            .visits
            .iter()
            .filter(|visit| visit.found == VisitResult::Opened)
            .map(|visit| visit.node)
            .collect()
    };
    assert!(
        cuts.windows(2)
            .all(|pair| opened(&pair[0]).is_subset(&opened(&pair[1])))
    );
    // The error decreases too, except for random variation.
    let db = |scene: &Scene| {
        metrics(
            &render(scene, &Rendered::default()).picture,
            &ideal(scene).picture,
        )
        .psnr_db
        .unwrap()
    };
    let dbs = [&cuts[1], &cuts[3], &cuts[6]].map(db);
    assert!(dbs[0] + 3.0 < dbs[1] && dbs[1] + 3.0 < dbs[2], "{dbs:?}");
}

/// The walk of the book: a stack of nodes, from which `ahead` are taken at a time; children are
/// pushed in reversed order.
fn walked(tree: &Tree, ahead: usize, opens: impl Fn(u32) -> bool) -> Vec<u32> {
    let (mut drawn, mut stack) = (Vec::new(), Vec::new());
    if opens(0) {
        stack.push(0)
    } else {
        drawn.push(0)
    }
    while !stack.is_empty() {
        let taken: Vec<u32> = (0..ahead).filter_map(|_| stack.pop()).collect();
        let children = taken
            .iter()
            .flat_map(|node| tree.nodes()[*node as usize].below());
        let (waits, small): (Vec<u32>, Vec<u32>) = children
            .map(|child| child as u32)
            .partition(|child| opens(*child));
        drawn.extend(small);
        stack.extend(waits.into_iter().rev());
    }
    drawn
}

#[test]
fn a_walk_draws_in_the_order_of_its_stack() {
    let mut scene = ball(700);
    scene.surface.cull_backfaces = false;
    let view = scene.view();
    for (ahead, children) in [(1, 2), (3, 4), (8, 4), (1000, 5)] {
        let scene = cut(
            &scene,
            children,
            DetailRules {
                pixels: 6.0,
                ahead,
                ..EVERYTHING
            },
        );
        let tree = &detail(&scene).tree;
        let opens = |number: u32| {
            let node = &tree.nodes()[number as usize];
            let nearest = (view.rotation * (node.splat.position - view.eye)).z - node.sphere;
            !node.is_leaf() && 2.0 * node.sphere * view.focal_px[0] / nearest > 6.0
        };
        assert_eq!(
            detail(&scene).cut.drawn,
            walked(tree, ahead, opens),
            "{ahead} {children}"
        );
    }
}

/// Three discs of two sizes in a plane, far apart, so that their second moment dominates.
#[test]
fn an_inner_node_is_as_wide_as_the_second_moment_of_whole_discs() {
    let discs = [
        ([0.0, 0.0, 2.0], 0.1),
        ([1.0, 0.0, 2.0], 0.1),
        ([0.0, 2.0, 2.0], 0.2),
    ];
    let splats: Vec<Splat> = discs
        .iter()
        .map(|(position, radius)| splat(*position, *radius))
        .collect();
    let tree = Tree::new(&splats, 4).unwrap();
    let root = tree.nodes()[0];
    let all: f64 = splats.iter().map(|s| s.radius * s.radius).sum();
    let mean = splats
        .iter()
        .map(|s| s.position * s.radius * s.radius)
        .sum::<DVec3>()
        / all;
    let moment = |s: &Splat| {
        s.radius * s.radius * (s.radius * s.radius + (s.position - mean).length_squared() / 2.0)
    };
    let variance = splats.iter().map(moment).sum::<f64>() / all;
    let sphere = splats
        .iter()
        .map(|s| (s.position - mean).length() + s.radius)
        .fold(0.0, f64::max);
    assert!(all < variance && variance < 2.0 * sphere * sphere);
    assert!(
        (root.splat.radius.powi(2) / variance - 1.0).abs() < 1e-12,
        "{root:?} for {variance}"
    );
    assert!(
        (root.splat.opacity - all / variance).abs() < 1e-12
            && (root.splat.position - mean).length() < 1e-12,
        "{root:?}"
    );
    assert!(
        (root.sphere / sphere - 1.0).abs() < 1e-8 && root.widest == root.splat.radius,
        "{root:?} for {sphere}"
    );
    // Many discs at one position are at most twice as wide as the sphere of the discs, which does
    // not include their own width.
    let stacked = Tree::new(&[splats[0]; 50], 4).unwrap().nodes()[0];
    assert!(
        (stacked.splat.radius.powi(2) / (2.0 * 0.01) - 1.0).abs() < 1e-9,
        "{stacked:?}"
    );
}

#[test]
fn budgets_are_kept_and_used() {
    let scene = ball(900);
    let of = |splats: u64, pixels: f64, culls: bool| {
        let budget = Budget {
            splats: Some(splats),
            ..Budget::default()
        };
        cut(
            &scene,
            4,
            DetailRules {
                pixels,
                budget,
                culls,
                order: DrawOrder::CoarseToFine,
                ..EVERYTHING
            },
        )
    };
    for budget in [1, 2, 3, 10, 100, 500, 899, 900, 10_000] {
        let drawn = of(budget, 0.0, false).splats.len() as u64;
        assert!(
            drawn <= budget && (drawn + 3 >= budget.min(900)),
            "{drawn} of {budget}"
        );
        assert!(of(budget, 0.0, true).splats.len() as u64 <= budget);
    }
    // Fewer if more are not needed.
    let loose = cut(
        &scene,
        4,
        DetailRules {
            pixels: 8.0,
            ..EVERYTHING
        },
    );
    assert_eq!(of(10_000, 8.0, false).splats.len(), loose.splats.len());
    // The largest nodes are opened first: no remaining node is larger than one that was replaced by
    // its children.
    let scene = of(100, 0.0, false);
    let Detail { tree, cut, .. } = detail(&scene);
    let size = |number: u32| {
        let node = &tree.nodes()[number as usize];
        2.0 * node.sphere * 60.0 / (node.splat.position.z - node.sphere)
    };
    assert!(cut.drawn.iter().map(|number| -size(*number)).is_sorted());
    let opened = cut
        .visits
        .iter()
        .filter(|visit| visit.found == VisitResult::Opened)
        .map(|visit| size(visit.node))
        .fold(f64::INFINITY, f64::min);
    let left = cut
        .drawn
        .iter()
        .filter(|number| !tree.nodes()[**number as usize].is_leaf())
        .map(|number| size(*number))
        .fold(0.0, f64::max);
    assert!(left <= opened * (1.0 + 1e-9), "{left} {opened}");
}

#[test]
fn what_is_culled_has_no_contribution() {
    let machine = fixed::elaborate(&Machine::named("reference").unwrap()).unwrap();
    let (mut away, mut outside) = (0, 0);
    for seed in 0..24 {
        let mut rng = Rng(seed);
        let mut scene = ball(400);
        scene.surface.cull_backfaces = seed % 2 == 0;
        scene.camera.eye = rng.direction() * (0.5 + 3.0 * rng.roll()) + 4.0 * DVec3::Z;
        scene.camera.target = scene.camera.eye + rng.direction();
        scene.camera.near = 0.05 + rng.roll();
        scene.kernel.low_pass = 3.0 * rng.roll();
        scene.kernel.cutoff = 1.0 + 3.0 * rng.roll();
        let pixels = [0.0, 2.0, 20.0][seed as usize % 3];
        let culled = cut(
            &scene,
            4,
            DetailRules {
                pixels,
                culls: true,
                ..EVERYTHING
            },
        );
        let Detail { tree, cut, .. } = detail(&culled);
        let lost = |found: VisitResult| {
            let of = cut.visits.iter().filter(|visit| visit.found == found);
            of.flat_map(|visit| leaves_below(tree, visit.node as usize))
                .map(|leaf| scene.splats[leaf as usize])
                .collect::<Vec<_>>()
        };
        let lost = [lost(VisitResult::Away), lost(VisitResult::Outside)];
        (away, outside) = (away + lost[0].len(), outside + lost[1].len());
        let rest = Scene {
            splats: lost.concat(),
            detail: None,
            ..scene.clone()
        };
        assert_eq!(
            render(&rest, &Rendered::default()).fragments,
            0,
            "seed {seed}"
        );
        if !rest.splats.is_empty() {
            let quantised = quantise(&rest, &machine.machine).unwrap();
            assert_eq!(
                fixed::draw(&machine, &quantised).outcomes.total(),
                0,
                "seed {seed}"
            );
        }
        if pixels == 0.0 {
            assert_eq!(
                ideal(&Scene {
                    detail: None,
                    ..culled.clone()
                })
                .picture,
                ideal(&scene).picture,
                "seed {seed}"
            );
        }
    }
    assert!(away > 500 && outside > 2000, "{away} {outside}");
}

#[test]
fn a_view_of_nothing_draws_the_background() {
    let mut scene = ball(50);
    scene.camera.target = DVec3::NEG_Z;
    let scene = cut(
        &scene,
        4,
        DetailRules {
            culls: true,
            ..EVERYTHING
        },
    );
    assert!(scene.splats.is_empty() && detail(&scene).cut.visits.len() == 1);
    let machine = fixed::elaborate(&Machine::named("reference").unwrap()).unwrap();
    let evaluation = Evaluation::on(&scene, &machine).unwrap();
    assert_eq!(
        evaluation.observe().picture.rgba,
        evaluation.golden().picture.rgba
    );
    let work = evaluation.observe().work;
    assert_eq!(work.check(), Ok(()));
    let cycles = timing::replay(&machine.timing, &work, Told::Log);
    assert_eq!(cycles.memory.bytes[Requester::Splats as usize][0], 64);
}

// ---- files ----

#[test]
fn a_tree_that_is_read_is_the_one_that_was_written() {
    for splats in crowds() {
        for children in [2, 16] {
            let tree = Tree::new(&splats, children).unwrap();
            let bytes = file::bytes(&tree);
            assert_eq!(bytes.len(), 64 + 128 * tree.nodes().len());
            assert_eq!(file::parse(&bytes), Ok(tree));
        }
    }
}

#[test]
fn no_damage_is_taken_for_a_tree() {
    let bytes = file::bytes(&Tree::new(&ball(20).splats, 4).unwrap());
    for end in (0..bytes.len())
        .step_by(7)
        .chain([15, 16, 63, 64, bytes.len() - 1])
    {
        assert!(file::parse(&bytes[..end]).is_err(), "{end} bytes");
    }
    assert!(file::parse(&[&bytes[..], &[0]].concat()).is_err());
    for bit in (0..8 * 64).chain((8 * 64..8 * bytes.len()).step_by(37)) {
        let mut damaged = bytes.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert!(file::parse(&damaged).is_err(), "bit {bit}");
    }
    // A header that promises more than any memory holds.
    let mut greedy = bytes[..64].to_vec();
    greedy[16..24].copy_from_slice(&u64::MAX.to_le_bytes());
    assert!(
        file::parse(&greedy)
            .unwrap_err()
            .contains("18446744073709551615 nodes")
    );
}

/// The file with some bytes of a node replaced, and a matching digest.
fn tampered(bytes: &[u8], node: usize, at: usize, with: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes[64 + 128 * node + at..][..with.len()].copy_from_slice(with);
    let digest = Sha256::digest(&bytes[64..]);
    bytes[32..64].copy_from_slice(&digest);
    bytes
}

#[test]
fn a_file_that_lies_is_refused() {
    let tree = Tree::new(&ball(20).splats, 4).unwrap();
    let bytes = file::bytes(&tree);
    let leaf = tree.nodes().len() - 1;
    let number = |value: f64| value.to_le_bytes().to_vec();
    let count = |value: u32| value.to_le_bytes().to_vec();
    let lies: [(usize, usize, Vec<u8>, &str); 14] = [
        (0, 0, number(f64::NAN), "node 0 has a position that is NaN"),
        (
            0,
            24,
            number(3.0),
            "node 0 has a normal that is not a unit vector",
        ),
        (
            leaf,
            48,
            number(0.0),
            "has a radius outside of 1e-30 to 1e30",
        ),
        (
            0,
            56,
            number(1.5),
            "has a colour or an opacity outside of [0, 1]",
        ),
        (
            0,
            80,
            number(f64::NAN),
            "has a colour or an opacity outside of [0, 1]",
        ),
        (0, 88, number(0.0), "is wider than its sphere"),
        (0, 96, number(f64::INFINITY), "is wider than its sphere"),
        (0, 104, number(2.0), "has a cone whose cosine is outside of"),
        (
            0,
            104,
            number(0.99),
            "has a normal below it outside its cone",
        ),
        (0, 116, count(1), "is the root, and its level is not 0"),
        (0, 120, count(0), "has children that are not the next nodes"),
        (1, 120, count(1), "has children that are not the next nodes"),
        (0, 124, count(200), "has one child, or more than 64"),
        (
            leaf,
            120,
            count(77),
            "is a leaf with a duplicate or invalid index",
        ),
    ];
    for (node, at, with, sentence) in lies {
        let refused = file::parse(&tampered(&bytes, node, at, &with)).unwrap_err();
        assert!(refused.contains(sentence), "{sentence}: {refused}");
    }
    let row = Tree::new(&crowds()[4], 4).unwrap();
    let smaller = tampered(
        &file::bytes(&row),
        0,
        88,
        &number(row.nodes()[0].sphere * 0.9),
    );
    assert!(
        file::parse(&smaller)
            .unwrap_err()
            .contains("node 0 has a splat below it outside its sphere")
    );
    // A node at another position than its descendants would be culled at its own position.
    let away = file::bytes(&tree);
    assert!(!tree.nodes()[1].is_leaf());
    let away = tampered(&tampered(&away, 1, 0, &number(1000.0)), 1, 88, &number(1e6));
    assert!(
        file::parse(&away)
            .unwrap_err()
            .contains("node 0 has a node below it outside its sphere")
    );
    // Two leaves at one position.
    let twice = tampered(&bytes, leaf, 120, &count(tree.nodes()[leaf - 1].first));
    assert!(
        file::parse(&twice)
            .unwrap_err()
            .contains("a duplicate or invalid index")
    );
    // For any count, nothing panics and nothing hangs.
    let mut rng = Rng(1);
    for _ in 0..400 {
        let (node, field) = (
            (rng.roll() * tree.nodes().len() as f64) as usize,
            (rng.roll() * 30.0) as usize,
        );
        let with = ((rng.roll() * 4e9) as u32 >> (rng.roll() * 32.0) as u32).to_le_bytes();
        _ = file::parse(&tampered(&bytes, node, 4 * field, &with));
    }
}

// ---- cost ----

/// Work of a cut on the machine `reference`, and its replay with ideal memory with this latency.
fn replayed(scene: &Scene, set: impl Fn(&mut Machine)) -> (Work, timing::Cycles, u64, u64) {
    let mut machine = Machine::named("reference").unwrap();
    set(&mut machine);
    let machine = fixed::elaborate(&machine).unwrap();
    let work = Evaluation::on(scene, &machine).unwrap().observe().work;
    let cycles = timing::replay(&machine.timing, &work, Told::Log);
    let (node_bytes, test) = (
        machine.timing.node_bytes.into(),
        machine.timing.project.latency.into(),
    );
    (work, cycles, node_bytes, test)
}

#[test]
fn a_walk_takes_a_latency_a_round() {
    // A root with 4 leaves: the root, then all four together.
    let splats = (0..4)
        .map(|nth| splat([0.1 * nth as f64, 0.0, 2.0], 0.05))
        .collect();
    let four = cut(&scene(40, 24, 40.0, splats), 4, EVERYTHING);
    for latency in [20, 100] {
        let (_, cycles, node_bytes, test) = replayed(&four, |machine| {
            let memory = &mut machine.timing.memory;
            (memory.ideal, memory.hit_latency, memory.miss_latency) = (true, latency, latency);
        });
        let fetch = cycles
            .units
            .iter()
            .find(|unit| unit.name == "fetch")
            .unwrap();
        let latency = u64::from(latency) + 1;
        let second = latency + test;
        // Bursts follow each other by one cycle, and a node is complete with its last burst.
        let first = node_bytes / 64;
        let here = |node: u64| second + ((node + 1) * node_bytes - 1) / 64 - first + latency;
        let expected = (1..5).fold(vec![latency], |mut log, node| {
            let before = log
                .last()
                .copied()
                .filter(|_| node > 1)
                .map_or(0, |before| before + 1);
            log.push(here(node).max(before));
            log
        });
        assert_eq!(fetch.log, expected);
    }
    // Two levels take two rounds; nodes that are requested together arrive together.
    let deep = |ahead: usize| {
        cut(
            &ball(256),
            4,
            DetailRules {
                ahead,
                ..EVERYTHING
            },
        )
    };
    let fetched = |ahead| {
        let (_, cycles, ..) = replayed(&deep(ahead), |machine| {
            machine.timing.memory.ideal = true;
            machine.timing.project.latency = Some(24);
        });
        *cycles
            .units
            .iter()
            .find(|unit| unit.name == "fetch")
            .unwrap()
            .log
            .last()
            .unwrap()
    };
    let [one, eight] = [fetched(1), fetched(8)];
    assert!(one > 85 * 21 && eight * 3 < one, "{one} {eight}");
}

#[test]
fn a_walk_reads_every_node_of_its_visits() {
    let scene = ball(300);
    for order in [DrawOrder::Walk, DrawOrder::CoarseToFine] {
        let coarse = cut(
            &scene,
            4,
            DetailRules {
                pixels: 40.0,
                order,
                ..EVERYTHING
            },
        );
        let (work, cycles, node_bytes, _) = replayed(&coarse, |_| ());
        assert_eq!(work.check(), Ok(()));
        let fetch = cycles
            .units
            .iter()
            .find(|unit| unit.name == "fetch")
            .unwrap();
        let (read, drawn) = (work.walk.len() as u64, work.cull_reasons.len() as u64);
        assert!(drawn < 200 && read > drawn && drawn == coarse.splats.len() as u64);
        let [bytes, written] = cycles.memory.bytes[Requester::Splats as usize];
        let bursts: BTreeSet<u64> = work
            .walk
            .iter()
            .flat_map(|visit| {
                [u64::from(visit.node), u64::from(visit.node) + 1]
                    .map(|node| node * node_bytes / 64)
            })
            .collect();
        assert!(
            bytes >= 64 * (bursts.len() as u64 - 1),
            "{bytes} bytes, {} bursts",
            bursts.len()
        );
        if order == DrawOrder::Walk {
            assert_eq!((fetch.items, written), (read, 0));
            assert!(bytes <= read * 128);
        } else {
            // The list is written and sorted twice, and each of its records is read again.
            assert_eq!(fetch.items, read + drawn);
            assert!(
                written == 3 * (drawn * 8).div_ceil(64) * 64
                    && bytes > written + 2 * node_bytes * drawn
            );
        }
    }
    // Also on an immediate machine.
    let (work, cycles, ..) = replayed(
        &cut(
            &scene,
            4,
            DetailRules {
                pixels: 40.0,
                ..EVERYTHING
            },
        ),
        |machine| {
            machine.timing.organisation = rtl_model::machine::timing::Organisation::Immediate;
        },
    );
    assert_eq!(cycles.units[0].items, work.walk.len() as u64);
}

#[test]
fn a_walk_is_recorded_and_a_damaged_one_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.work");
    let scene = cut(
        &ball(60),
        4,
        DetailRules {
            pixels: 4.0,
            order: DrawOrder::CoarseToFine,
            ..EVERYTHING
        },
    );
    let (work, ..) = replayed(&scene, |_| ());
    let recording = Recording {
        scene: "ball".into(),
        machine: Machine::named("reference").unwrap(),
        work: work.clone(),
    };
    recording.clone().write(&path).unwrap();
    assert_eq!(Recording::read(&path).unwrap(), recording);
    let last = work.walk.len() - 1;
    let damages: [&dyn Fn(&mut Work); 5] = [
        &|work| work.walk[last].parent = last as u32,
        &|work| work.walk[0].found = work::Found::Outside,
        &|work| work.walk.truncate(last),
        &|work| work.listed[0] = 9999,
        &|work| work.walk.clear(),
    ];
    for damage in damages {
        let mut work = work.clone();
        damage(&mut work);
        assert!(work.check().is_err());
    }
    assert_eq!(
        work.walk[0],
        Visit {
            node: 0,
            parent: 0,
            found: work::Found::Opened
        }
    );
}

#[test]
fn budgets_of_bytes_and_cycles_are_kept_on_every_machine() {
    let scene = ball(400);
    for name in ["reference", "tiny"] {
        let machine = fixed::elaborate(&Machine::named(name).unwrap()).unwrap();
        let node_bytes = u64::from(machine.timing.node_bytes);
        let of = |budget: Budget| {
            cut(
                &scene,
                4,
                DetailRules {
                    budget,
                    order: DrawOrder::CoarseToFine,
                    ..EVERYTHING
                },
            )
        };
        let drawn = |scene: &Scene| {
            let evaluation = Evaluation::on(scene, &machine).unwrap();
            let read = detail(&evaluation.scene).cut.visits.len() as u64;
            (
                read * node_bytes,
                timing::replay(&machine.timing, &evaluation.observe().work, Told::Accounts).total,
            )
        };
        for bytes in [node_bytes, 1000, 4000] {
            let (read, _) = drawn(&of(Budget {
                bytes: Some(bytes),
                ..Budget::default()
            }));
            assert!(
                read <= bytes && read + 4 * node_bytes > bytes,
                "{name}: {read} of {bytes}"
            );
        }
        let [coarsest, finest] = [1, 10_000].map(|splats| {
            drawn(&of(Budget {
                splats: Some(splats),
                ..Budget::default()
            }))
            .1
        });
        for cycles in [coarsest, (coarsest + finest) / 2, finest] {
            let (_, taken) = drawn(&of(Budget {
                cycles: Some(cycles),
                ..Budget::default()
            }));
            assert!(
                taken <= cycles && 10 * taken >= 9 * cycles,
                "{name}: {taken} of {cycles}"
            );
        }
        let refused = |budget: Budget| {
            Evaluation::on(&of(budget), &machine)
                .unwrap_err()
                .to_string()
        };
        let cycles = refused(Budget {
            cycles: Some(coarsest - 1),
            ..Budget::default()
        });
        assert!(
            cycles.contains(&format!(
                "level_of_detail.budget.cycles is {}, and the coarsest frame",
                coarsest - 1
            )),
            "{cycles}"
        );
        assert!(
            refused(Budget {
                bytes: Some(3),
                ..Budget::default()
            })
            .contains("budget.bytes is 3")
        );
    }
}

#[test]
fn stacks_that_a_frame_has_no_room_on_are_refused_by_replays() {
    for ahead in [1, 3, 8] {
        let scene = cut(
            &ball(400),
            4,
            DetailRules {
                ahead,
                ..EVERYTHING
            },
        );
        let deepest = detail(&scene).cut.deepest as u64;
        assert_eq!(replayed(&scene, |_| ()).0.deepest_stack(), deepest);
    }
    let folder = tempfile::tempdir().unwrap();
    let scene = json!({"splats": {"builtin": "torus-knot", "count": 300}, "image": {"width": 24, "height": 24}, "level_of_detail": {"pixels": 0}});
    std::fs::write(folder.path().join("tree.json"), scene.to_string()).unwrap();
    assert_eq!(
        splatsim(
            folder.path(),
            &[
                "run",
                "tree.json",
                "--out",
                "out",
                "--record",
                "frame.work",
                "--quiet"
            ]
        )
        .0,
        0
    );
    let report: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("out/report.json")).unwrap())
            .unwrap();
    let deepest = report["level_of_detail"]["deepest_stack"].as_u64().unwrap();
    let [fits, small] = [deepest, deepest - 1].map(|stack| format!("timing.walk.stack={stack}"));
    for head in [
        &["replay", "frame.work", "--out", "new"][..],
        &["run", "tree.json", "--out", "new"],
    ] {
        let told = splatsim(folder.path(), &[head, &["--timing", &small]].concat());
        assert!(
            told.0 == 2
                && told.2.contains(&format!("{deepest} would do"))
                && !folder.path().join("new").exists(),
            "{told:?}"
        );
    }
    let told = splatsim(folder.path(), &["replay", "frame.work", "--set", &small]);
    assert!(
        told.0 == 2 && told.2.contains(&format!("{deepest} would do")),
        "{told:?}"
    );
    assert_eq!(
        splatsim(folder.path(), &["replay", "frame.work", "--set", &fits]).0,
        0
    );
}

#[test]
fn a_walker_costs_area_where_a_machine_has_one_and_holds_no_more_than_its_stack() {
    let plain = Machine::named("reference").unwrap();
    let with = |stack: u32| {
        let mut machine = plain.clone();
        machine.timing.walk = Some(rtl_model::machine::timing::Walk { stack });
        machine
    };
    let cost =
        |machine: &Machine| Cost::new(&fixed::elaborate(machine).unwrap(), &Prices::default());
    let [none, small, large] = [&plain, &with(16), &with(1024)].map(cost);
    assert!(
        none.units.iter().all(|unit| unit.name != "fetch")
            && small.units.iter().any(|unit| unit.name == "fetch")
    );
    assert_eq!(large.memory_bits - small.memory_bits, 40 * (1024 - 16));
    // Counters of nodes by size: two counts of 32 bits for each of 256 values of a digit. Requests
    // have a queue with or without a walker.
    assert_eq!(small.memory_bits - none.memory_bits, 40 * 16 + 2 * 32 * 256);
    assert!(none.area + 1000.0 < small.area && small.area < large.area);
    let scene = cut(&ball(400), 4, EVERYTHING);
    let deepest = detail(&scene).cut.deepest as u32;
    assert!(deepest > 4 && quantise(&scene, &with(deepest)).is_ok());
    let refused = quantise(&scene, &with(deepest - 1))
        .unwrap_err()
        .to_string();
    assert!(
        refused.contains(&format!(
            "timing.walk.stack is {}, but the walk stores up to {deepest} nodes on it",
            deepest - 1
        )),
        "{refused}"
    );
}

// ---- scenes ----

/// Runs the program in a folder; returns its exit status and its outputs.
fn splatsim(folder: &std::path::Path, arguments: &[&str]) -> (i32, String, String) {
    let output = Command::new(PROGRAM.as_str())
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (
        output.status.code().unwrap(),
        text(&output.stdout),
        text(&output.stderr),
    )
}

/// A two-sided sheet: if the normal of a coarse node faces away, its descendants are still drawn.
#[test]
fn a_sheet_of_two_sides_is_seen_however_coarse() {
    let mut rng = Rng(3);
    let pair = |_| {
        let at = splat([2.0 * rng.roll() - 1.0, 2.0 * rng.roll() - 1.0, 4.0], 0.1);
        [
            at,
            Splat {
                normal: -at.normal,
                ..at
            },
        ]
    };
    let splats: Vec<Splat> = (0..200).flat_map(pair).collect();
    let mut sheet = scene(48, 40, 60.0, splats);
    sheet.surface.cull_backfaces = true;
    let picture = |pixels| {
        render(
            &cut(
                &sheet,
                4,
                DetailRules {
                    pixels,
                    culls: true,
                    ..EVERYTHING
                },
            ),
            &Rendered::default(),
        )
    };
    let covered = |pixels| {
        picture(pixels)
            .picture
            .covered
            .iter()
            .filter(|is| **is)
            .count()
    };
    let all = covered(0.0);
    assert!(all > 200);
    for pixels in [8.0, 30.0, 1e6] {
        assert!(
            covered(pixels) * 10 > all * 9,
            "{pixels}: {} of {all}",
            covered(pixels)
        );
    }
}

#[test]
fn an_inner_node_of_an_unknown_material_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let tree = Tree::new(&ball(20).splats, 4).unwrap();
    std::fs::write(
        folder.path().join("lie.tree"),
        tampered(&file::bytes(&tree), 0, 112, &9u32.to_le_bytes()),
    )
    .unwrap();
    let scene = json!({"splats": {"file": "lie.tree"}, "image": {"width": 32, "height": 32}, "level_of_detail": {"pixels": 10000}});
    std::fs::write(folder.path().join("lie.json"), scene.to_string()).unwrap();
    let (status, _, told) = splatsim(folder.path(), &["run", "lie.json"]);
    assert!(status == 2 && told.contains("material"), "{status} {told}");
}

/// A scene with a tree adds a walker to a machine without one, and its area is counted.
#[test]
fn the_walker_of_a_tree_is_counted_in_the_area() {
    let folder = tempfile::tempdir().unwrap();
    let area = |name: &str, more: &Value| {
        let mut scene = json!({"splats": {"builtin": "torus-knot", "count": 300}, "image": {"width": 24, "height": 24}});
        more.as_object()
            .unwrap()
            .iter()
            .for_each(|(field, value)| scene[field] = value.clone());
        std::fs::write(folder.path().join(name), scene.to_string()).unwrap();
        let (status, _, told) = splatsim(folder.path(), &["run", name, "--out", "out", "--quiet"]);
        assert_eq!(status, 0, "{told}");
        let report: Value =
            serde_json::from_slice(&std::fs::read(folder.path().join("out/report.json")).unwrap())
                .unwrap();
        report["cost"]["area"].as_f64().unwrap()
    };
    let of_run = [
        area("tree.json", &json!({"level_of_detail": {}})),
        area("all.json", &json!({})),
    ];
    assert!(of_run[0] > of_run[1] + 1000.0);
    // The area of a sweep's machines is counted in the same way, and only with a tree.
    let plan = json!({"scenes": ["tree.json", "all.json"], "axes": [], "lockstep": false});
    std::fs::write(folder.path().join("plan.json"), plan.to_string()).unwrap();
    let sweep = || {
        splatsim(
            folder.path(),
            &["sweep", "plan.json", "--out", "swept", "--quiet"],
        )
    };
    assert_eq!(sweep().0, 0);
    let table = std::fs::read_to_string(folder.path().join("swept/sweep.csv")).unwrap();
    // No cell here is quoted.
    let mut lines = table
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>());
    let heads = lines.next().unwrap();
    let place = heads.iter().position(|name| *name == "area").unwrap();
    let of_sweep: Vec<f64> = lines.map(|cells| cells[place].parse().unwrap()).collect();
    assert_eq!(of_sweep, of_run);
    // Rows that were drawn are recognised.
    assert_eq!(sweep().0, 0);
}

#[test]
fn a_scene_draws_a_cut_of_a_tree_in_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, value: &Value| {
        std::fs::write(folder.path().join(name), value.to_string()).unwrap()
    };
    let source = json!({"builtin": "torus-knot", "count": 600});
    let image = json!({"width": 32, "height": 32});
    write("knot.json", &json!({"splats": source}));
    let (status, out, _) = splatsim(
        folder.path(),
        &["tree", "knot.json", "--out", "knot.tree", "--children", "3"],
    );
    assert!(
        status == 0
            && out.contains("knot.json: 600 splats")
            && out.contains("at most 3 children a node"),
        "{out}"
    );
    write(
        "all.json",
        &json!({"splats": {"file": "knot.tree"}, "image": image}),
    );
    write(
        "cut.json",
        &json!({"splats": {"file": "knot.tree"}, "image": image, "level_of_detail": {"pixels": 6}}),
    );
    let load = |name: &str| Scene::load(folder.path().join(name), &Overrides::default()).unwrap();
    // Without a level of detail, the leaves of a tree are drawn.
    let [all, coarse, knot] = ["all.json", "cut.json", "knot.json"].map(load);
    assert!(all.detail.is_none() && all.splats == knot.splats);
    let Detail { tree, cut, rules } = detail(&coarse);
    assert_eq!(
        (tree.most_children(), rules.order, rules.culls),
        (3, DrawOrder::Walk, true)
    );
    assert!(
        coarse.splats.len() < 500
            && cut.coarsest_px <= 6.0
            && coarse.full().unwrap().splats == knot.splats
    );
    // A factor changes the splats, and therefore the tree.
    write(
        "wide.json",
        &json!({"splats": {"file": "knot.tree", "radius_scale": 2}, "level_of_detail": {}}),
    );
    assert_eq!(detail(&load("wide.json")).tree.most_children(), 4);
    let (status, out, error) = splatsim(folder.path(), &["run", "cut.json", "--out", "out"]);
    assert!(
        status == 0 && out.contains("level of detail: "),
        "{out} {error}"
    );
    let report: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("out/report.json")).unwrap())
            .unwrap();
    let told = &report["level_of_detail"];
    assert_eq!(
        (told["leaves"].as_u64(), told["drawn"].as_u64()),
        (Some(600), report["scene"]["splats"].as_u64())
    );
    let read = told["drawn"].as_u64().unwrap()
        + told["away"].as_u64().unwrap()
        + told["outside"].as_u64().unwrap();
    assert!(
        told["read"].as_u64() > Some(read)
            && told["read_bytes"].as_u64()
                == Some(told["read"].as_u64().unwrap() * told["node_bytes"].as_u64().unwrap())
    );
    let (status, out, _) = splatsim(
        folder.path(),
        &[
            "tree",
            "cut.json",
            "--out",
            "again.tree",
            "--children",
            "3",
            "--quiet",
        ],
    );
    assert_eq!((status, out.as_str()), (0, ""));
    let [one, again] =
        ["knot.tree", "again.tree"].map(|name| std::fs::read(folder.path().join(name)).unwrap());
    assert!(one == again);
}

#[test]
fn inputs_without_a_tree_are_refused_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let splat = r#"{"position": [0, 0, 0], "normal": [0, 0, 1], "radius": 1}"#;
    write("one.json", &format!(r#"{{"splats": [{splat}]}}"#));
    write(
        "shells.json",
        r#"{"splats": {"gaussians": "bouquet", "count": 5}, "level_of_detail": {}}"#,
    );
    write("broken.tree", "splatsim-tree-1\nnothing");
    write("other.tree", "plant\n");
    for (name, fields) in [
        ("negative", r#"{"pixels": -1}"#),
        ("none", r#"{"budget": {"splats": 0}}"#),
        ("unknown", r#"{"order": "random"}"#),
    ] {
        write(
            &format!("{name}.json"),
            &format!(r#"{{"splats": [{splat}], "level_of_detail": {fields}}}"#),
        );
    }
    write(
        "cycles.json",
        &format!(r#"{{"splats": [{splat}], "level_of_detail": {{"budget": {{"cycles": 1}}}}}}"#),
    );
    let refused = [
        (
            vec!["tree", "one.json", "--out", "one.ply"],
            "trees are written as .tree",
        ),
        (
            vec!["tree", "one.json", "--out", "nowhere/one.tree"],
            "there is no such folder",
        ),
        (
            vec!["tree", "one.json", "--out", "one.tree", "--children", "1"],
            "--children",
        ),
        (
            vec!["tree", "bouquet", "--out", "one.tree"],
            "a tree is of discs",
        ),
        (vec!["run", "shells.json"], "level_of_detail is of discs"),
        (vec!["run", "broken.tree"], "is damaged: it has 23 bytes"),
        (vec!["run", "other.tree"], "is not a tree of splats"),
        (vec!["run", "negative.json"], "level_of_detail.pixels"),
        (vec!["run", "none.json"], "level_of_detail.budget.splats"),
        (vec!["run", "unknown.json"], "level_of_detail.order"),
        (
            vec!["run", "cycles.json", "--size", "8x8"],
            "level_of_detail.budget.cycles is 1, and the coarsest frame",
        ),
        (
            vec!["trace", "cycles.json", "--size", "8x8", "--out", "t"],
            "level_of_detail.budget is in bytes or cycles",
        ),
    ];
    for (arguments, sentence) in refused {
        let (status, out, error) = splatsim(folder.path(), &arguments);
        assert!(
            status == 2 && out.is_empty() && error.lines().count() == 1 && error.contains(sentence),
            "{arguments:?}: {status} {out} {error}"
        );
    }
    assert!(!folder.path().join("one.tree").exists());
    let (status, ..) = splatsim(
        folder.path(),
        &["tree", "one.json", "--out", "one.tree", "--quiet"],
    );
    assert_eq!(status, 0);
}

//! Does each comparison filter (SS Fig. 8) match its definition?

use crate::handmade::{scene, splat};
use crate::program::PROGRAM;
use assert_cmd::Command;
use glam::{DMat2, DVec2, DVec3};
use proptest::prelude::*;
use serde_json::json;
use splatsim::golden::{ideal, render};
use splatsim::scene::{Filter, Kernel, Scene, Splat};
use std::f64::consts::TAU;

/// Pixels per unit at depth 1, and the side of the picture.
const FOCAL_PX: f64 = 40.0;
const SIDE: usize = 40;

/// A scene whose opacity is a thousandth of the weight of its single splat.
fn alone(splat: Splat, low_pass: f64, filter: Filter) -> Scene {
    let mut scene = scene(SIDE, SIDE, FOCAL_PX, vec![splat]);
    scene.kernel = Kernel {
        cutoff: 6.0,
        low_pass,
        filter,
        ..scene.kernel
    };
    scene.surface.coverage_threshold = 1000.0;
    scene
}

/// Weights of all pixels, row by row; 0 for uncovered pixels.
fn weights(scene: &Scene) -> Vec<f64> {
    ideal(scene)
        .picture
        .rgba
        .iter()
        .map(|pixel| 1000.0 * pixel[3])
        .collect()
}

/// The direction through a pixel's centre.
fn ray(x: f64, y: f64) -> DVec3 {
    let middle = SIDE as f64 / 2.0;
    DVec3::new((x - middle) / FOCAL_PX, (y - middle) / FOCAL_PX, 1.0)
}

/// Heckbert's filter at a pixel: (radial index, weight). Computed from differences of rays a small
/// step apart and the inverse of a matrix.
fn source_space(splat: &Splat, low_pass: f64, x: f64, y: f64) -> Option<(f64, f64)> {
    let meets = |x: f64, y: f64| {
        ray(x, y) * (splat.normal.dot(splat.position) / splat.normal.dot(ray(x, y)))
    };
    let tangent = splat.normal.any_orthonormal_vector();
    let other = splat.normal.cross(tangent);
    let on_plane = |p: DVec3| {
        DVec2::new(
            (p - splat.position).dot(tangent),
            (p - splat.position).dot(other),
        )
    };
    let step = 1e-4;
    let of = |x: f64, y: f64| on_plane(meets(x, y));
    let jacobian = DMat2::from_cols(
        of(x + step, y) - of(x - step, y),
        of(x, y + step) - of(x, y - step),
    ) * (0.5 / step);
    let r2 = splat.radius * splat.radius;
    let variance = DMat2::IDENTITY * r2 + jacobian * jacobian.transpose() * low_pass;
    let radial = of(x, y).dot(variance.inverse() * of(x, y));
    (meets(x, y).z > 0.0).then(|| {
        (
            radial,
            r2 / variance.determinant().sqrt() / TAU * (-0.5 * radial).exp(),
        )
    })
}

prop_compose! {
    /// Some so near that they reach behind the eye's plane, some facing away from the eye.
    fn slanted()(x in -0.2_f64..0.2, y in -0.2_f64..0.2, depth in 0.3_f64..4.0, radius in 0.02_f64..0.25,
        lean in 0.0_f64..1.2, turn in 0.0..TAU, back in any::<bool>()) -> Splat {
        let normal = DVec3::new(lean.sin() * turn.cos(), lean.sin() * turn.sin(), -lean.cos());
        Splat { normal: if back { -normal } else { normal }, ..splat([x * depth, y * depth, depth], radius) }
    }
}

proptest! {
    #[test]
    fn source_space_filters_are_heckberts(splat in slanted(), low_pass in 0.0_f64..2.0) {
        let drawn = weights(&alone(splat, low_pass, Filter::SourceEwa));
        let most = drawn.iter().copied().fold(0.0, f64::max);
        let mut reached = 0;
        for (index, drawn) in drawn.iter().enumerate() {
            let (x, y) = ((index % SIDE) as f64 + 0.5, (index / SIDE) as f64 + 0.5);
            match source_space(&splat, low_pass, x, y) {
                Some((radial, weight)) if radial < 5.999 => {
                    // Near the horizon the filter of a pixel is as wide as the world and very flat:
                    // the box leaves such pixels out.
                    let is_left_out = *drawn == 0.0 && weight < 1e-3 * most;
                    prop_assert!(is_left_out || (drawn - weight).abs() <= 1e-5 * weight + 1e-8 * most, "{drawn} {weight} of {most} at {x} {y}");
                    reached += 1;
                }
                Some((radial, _)) if radial < 6.001 => {}
                _ => prop_assert!(*drawn == 0.0, "{drawn} at {x} {y}"),
            }
        }
        prop_assume!(low_pass > 0.3);
        prop_assert!(reached > 0);
    }

    /// The width of a disc is that of its major axis on the screen: for a small disc, that of the
    /// ray's plane.
    #[test]
    fn a_circle_is_as_wide_as_the_ellipse(splat in slanted(), low_pass in 0.5_f64..2.0) {
        let drawn = weights(&alone(splat, low_pass, Filter::Circular));
        // The variance on the screen is computed from two projected tangents, and its larger
        // eigenvalue from the largest stretch over all directions.
        let (u, v) = splat.normal.any_orthonormal_pair();
        let p = splat.position;
        let project = |t: DVec3| DVec2::new(t.x - p.x / p.z * t.z, t.y - p.y / p.z * t.z) * (splat.radius * FOCAL_PX / p.z);
        let (u, v) = (project(u), project(v));
        let stretch = |turn: f64| (u * turn.cos() + v * turn.sin()).length_squared();
        let major = (0..20_000).map(|i| stretch(TAU * f64::from(i) / 20_000.0)).fold(0.0, f64::max);
        let variance = major + low_pass;
        let centre = DVec2::new(p.x, p.y) / p.z * FOCAL_PX + SIDE as f64 / 2.0;
        for (index, drawn) in drawn.iter().enumerate() {
            let at = DVec2::new((index % SIDE) as f64 + 0.5, (index / SIDE) as f64 + 0.5);
            let radial = (at - centre).length_squared() / variance;
            if radial < 5.99 {
                let weight = major / variance / TAU * (-0.5 * radial).exp();
                prop_assert!((drawn - weight).abs() <= 1e-4 * weight, "{drawn} {weight}");
            } else if radial > 6.01 {
                prop_assert!(*drawn == 0.0);
            }
        }
    }

    /// A disc parallel to the picture needs no approximation: it is a circle.
    #[test]
    fn all_are_one_on_a_disc_that_faces_the_picture(x in -0.2_f64..0.2, y in -0.2_f64..0.2, radius in 0.02_f64..0.25, low_pass in 0.0_f64..2.0) {
        let splat = splat([2.0 * x, 2.0 * y, 2.0], radius);
        let [ewa, circular, source] = [Filter::Ewa, Filter::Circular, Filter::SourceEwa].map(|filter| weights(&alone(splat, low_pass, filter)));
        for ((ewa, circular), source) in ewa.iter().zip(&circular).zip(&source) {
            prop_assert!((ewa - circular).abs() <= 1e-9 && (ewa - source).abs() <= 1e-9, "{ewa} {circular} {source}");
        }
    }
}

/// A pixel beyond the rim of a disc has the depth of the rim, not that of the continued plane: the
/// disc stays in front of a sheet just behind it, and hides it wherever it covers.
#[test]
fn no_disc_reaches_farther_in_depth_than_its_radius() {
    let lean = 1.45_f64;
    let radius = 0.1;
    let red = Splat {
        normal: DVec3::new(lean.sin(), 0.0, -lean.cos()),
        rgb: [1.0, 0.0, 0.0],
        ..splat([0.0, 0.0, 2.0], radius)
    };
    let behind = Splat {
        rgb: [0.0, 1.0, 0.0],
        ..splat([0.0, 0.0, 2.0 + radius * 6.0_f64.sqrt() + 0.02], 3.0)
    };
    let picture = |splats: Vec<Splat>| {
        let mut scene = alone(red, 2.0, Filter::SourceEwa);
        scene.splats = splats;
        (scene.surface.z_threshold, scene.surface.coverage_threshold) = (0.01, 1e-9);
        ideal(&scene).picture.rgba
    };
    let (lone, both) = (picture(vec![red]), picture(vec![red, behind]));
    let covered = lone.iter().filter(|pixel| pixel[3] > 0.5).count();
    assert!(covered > 10);
    for (lone, both) in lone.iter().zip(&both).filter(|(lone, _)| lone[3] > 0.5) {
        assert!(both[0] == lone[0] && both[1] == 0.0, "{lone:?} {both:?}");
    }
}

/// A scene file with a kernel.
fn file(kernel: &serde_json::Value, splats: &serde_json::Value) -> tempfile::NamedTempFile {
    let text = json!({"splats": splats, "kernel": kernel, "image": {"width": 16, "height": 16}});
    let file = tempfile::Builder::new().suffix(".json").tempfile().unwrap();
    std::fs::write(file.path(), text.to_string()).unwrap();
    file
}

#[test]
fn elliptical_is_without_the_low_pass_filter() {
    let load = |kernel| {
        let file = file(&kernel, &json!({"builtin": "torus-knot", "count": 3000}));
        Scene::load(file.path().to_str().unwrap(), &Default::default()).unwrap()
    };
    let [elliptical, off, on] = [
        json!({"filter": "elliptical"}),
        json!({"low_pass": 0}),
        json!({"filter": "ewa"}),
    ]
    .map(load);
    let picture = |scene: &Scene| render(scene, &Default::default()).picture.rgba;
    assert!(picture(&elliptical) == picture(&off) && picture(&off) != picture(&on));
}

#[test]
fn machines_refuse_filters_of_golden_alone_and_invalid_kernels_are_refused() {
    let knot = json!({"builtin": "torus-knot", "count": 300});
    let volume = json!({"volume": {"builtin": "nested-shells", "samples": 8}});
    for (kernel, splats, says) in [
        (
            json!({"filter": "circular"}),
            &knot,
            "kernel.filter is \"circular\", which golden and ideal draw for comparison",
        ),
        (
            json!({"filter": "source-ewa"}),
            &knot,
            "kernel.filter is \"source-ewa\", which golden and ideal draw for comparison",
        ),
        (
            json!({"filter": "elliptical", "low_pass": 1}),
            &knot,
            "which has no low-pass filter",
        ),
        (
            json!({"filter": "source-ewa"}),
            &volume,
            "which is of discs",
        ),
        (json!({"filter": "circular"}), &volume, "which is of discs"),
        (
            json!({"filter": "round"}),
            &knot,
            "it must be one of ewa, elliptical, circular, source-ewa",
        ),
    ] {
        let file = file(&kernel, splats);
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let output = Command::new(PROGRAM.as_str())
            .args([
                "run",
                file.path().to_str().unwrap(),
                "--out",
                out.to_str().unwrap(),
            ])
            .output()
            .unwrap();
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!(
            (output.status.code(), told.lines().count()),
            (Some(2), 1),
            "{told}"
        );
        assert!(told.contains(says) && !out.exists(), "{told}");
    }
}

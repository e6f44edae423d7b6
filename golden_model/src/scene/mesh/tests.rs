//! Meshes: paths, corners and wraps.

use super::*;

#[test]
fn a_name_leads_to_a_file_beside_the_mesh_or_nowhere() {
    let folder = Path::new("/meshes");
    for (name, path) in [
        ("a.png", "/meshes/a.png"),
        ("b/a b.png", "/meshes/b/a b.png"),
        ("./c.mtl", "/meshes/./c.mtl"),
        ("b\\d.png", "/meshes/b/d.png"),
    ] {
        assert_eq!(inside(folder, name).unwrap(), Path::new(path));
    }
    for name in ["../a.png", "b/../../a.png", "/etc/passwd", "..\\a.png", ""] {
        assert!(
            inside(folder, name)
                .unwrap_err()
                .contains("leads out of the mesh's folder"),
            "{name}"
        );
    }
}

#[test]
fn a_thin_triangle_has_an_area_and_a_flat_one_has_none() {
    let triangle = |height: f64, scale: f64| {
        [
            DVec3::ZERO,
            DVec3::X * scale,
            DVec3::new(0.5, height, 0.0) * scale,
        ]
    };
    for scale in [1e-30, 1.0, 1e29] {
        assert!(
            has_area(&triangle(1e-9, scale))
                && !has_area(&triangle(0.0, scale))
                && !has_area(&triangle(1e-15, scale)),
            "{scale}"
        );
    }
    assert!(!has_area(&[DVec3::ONE; 3]));
}

#[test]
fn a_texel_past_the_border_follows_the_wrap() {
    let row = |wrap: Wrap| {
        (-4..7)
            .map(|place| wrap.index(place, 3))
            .collect::<Vec<_>>()
    };
    assert_eq!(row(Wrap::Repeat), [2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0]);
    assert_eq!(row(Wrap::Mirror), [2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0]);
    assert_eq!(row(Wrap::Clamp), [0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2]);
    assert!(
        [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp]
            .iter()
            .all(|wrap| wrap.index(i64::MIN, 3) < 3 && wrap.index(i64::MAX, 3) < 3)
    );
}

/// Two faces at a right angle stay sharp; two that are almost parallel are smoothed.
#[test]
fn sharp_edges_stay_sharp() {
    let raw = |corners: [[f64; 3]; 3]| Raw {
        corners: corners.map(DVec3::from_array),
        normals: None,
        uv: None,
        rgba: [GREY; 3],
        material: 0,
        flat: false,
    };
    let edge = |height: f64, depth: f64| {
        let triangles = vec![
            raw([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
            raw([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-depth, 0.0, height]]),
        ];
        Contents {
            triangles,
            ..Contents::default()
        }
        .checked()
        .unwrap()
        .triangles
    };
    assert_eq!(edge(1.0, 0.0)[0].normals[0], [0.0, 0.0, 1.0]);
    let [x, _, z] = edge(0.1, 1.0)[0].normals[0];
    assert!(x > 0.04 && x < 0.06 && z > 0.99, "{x} {z}");
}

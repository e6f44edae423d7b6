//! Every input results in a scene or one sentence, quickly, and without memory out of proportion to
//! the input.

use crate::shared_input;
use splatsim::scene::{Overrides, Scene};
use std::path::{Path, PathBuf};

fn load(path: &Path) -> splatsim::error::Result<Scene> {
    Scene::load(path.to_str().unwrap(), &Overrides::default())
}

fn check_sound(scene: &Scene, whose: &Path) {
    let view = scene.view();
    assert!(
        view.rotation.is_finite()
            && view.focal_px.into_iter().all(f64::is_finite)
            && scene.camera.near > 0.0,
        "{whose:?}"
    );
    assert!(
        scene.surface.z_threshold > 0.0 && !scene.splats.is_empty(),
        "{whose:?}"
    );
    for splat in &scene.splats {
        let unit = (splat.normal.length() - 1.0).abs() < 1e-12;
        assert!(
            unit && splat.radius > 0.0 && splat.radius.is_finite() && splat.position.is_finite(),
            "{whose:?}: {splat:?}"
        );
        assert!(
            splat
                .rgb
                .iter()
                .chain([&splat.opacity])
                .all(|c| (0.0..=1.0).contains(c)),
            "{whose:?}: {splat:?}"
        );
    }
}

fn check_one_sentence(sentence: &str, whose: &Path) {
    assert!(sentence.starts_with(whose.to_str().unwrap()), "{sentence}");
    assert!(
        !sentence.contains(['\n', '\r']) && sentence.len() < 400,
        "{sentence:?}"
    );
}

#[test]
fn every_odd_or_broken_ply_ends_in_a_scene_or_a_sentence() {
    for folder in ["malformed/ply", "malformed/ply_plyodine"] {
        let Some(folder) = shared_input::find(folder) else {
            return;
        };
        let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .collect();
        files.sort();
        assert!(files.len() >= 49, "{} files", files.len());
        for file in files {
            match load(&file) {
                Ok(scene) => check_sound(&scene, &file),
                Err(error) => check_one_sentence(&error.to_string(), &file),
            }
        }
    }
}

/// The verdicts of the data's own README: sound files must be read, broken ones refused.
#[test]
fn sound_files_are_read_and_broken_ones_are_not() {
    let Some(folder) = shared_input::find("malformed/ply") else {
        return;
    };
    let read = |name: &str| load(&folder.join(name));
    for (name, splats) in [
        ("assimp__Wuson.ply", 11184),
        ("assimp__cube_binary_header_with_RN_newline.ply", 8),
        ("draco__delim_test.ply", 24),
        ("draco__float_inf_point_cloud.ply", 13),
        ("draco__test_more_datatypes.ply", 3),
        ("happly__platonic_shelf_big_endian.ply", 50),
        ("mdal__all_features_inv.ply", 5),
        ("plyrs__house_2_ok_little_endian.ply", 5),
        ("tinyply__sofa.ply", 12103),
        ("trimesh__points_ascii_with_lists.ply", 5),
    ] {
        assert_eq!(read(name).unwrap().splats.len(), splats, "{name}");
    }
    for name in [
        "assimp__payload_JVN42386607.ply",
        "assimp_invalid__empty.ply",
        "trimesh__fuze_ascii.ply",
        "trimesh__empty.ply",
    ] {
        assert!(read(name).is_err(), "{name}");
    }
    // The header promises twelve rows; there are thirteen.
    assert!(
        read("trimesh__points_emptyascii.ply")
            .unwrap_err()
            .to_string()
            .contains("line 23: `-0.009618 -0.013861 0.0384` is one row more")
    );
}

#[test]
fn real_scans_have_as_many_splats_as_points_and_radii_like_their_spacing() {
    let Some(scans) = shared_input::find("scans") else {
        return;
    };
    // Number of points, and limits of the median radius: roughly the extent over the root of the
    // number.
    for (name, count, radii) in [
        ("bun_zipper.ply", 35947, 1e-3..2e-3),
        ("pond.0.ply", 70051, 3e-3..1e-2),
        ("igea.ply", 134345, 3e-4..7e-4),
        ("park_points_rgb.ply", 346010, 0.03..0.08),
        ("vol_total_rgb.ply", 498868, 0.4..0.9),
        ("../scenes/dragon.json", 467605, 0.0003865..0.0003875),
    ] {
        let path = scans.join(name);
        let scene = load(&path).unwrap();
        check_sound(&scene, &path);
        let mut sorted: Vec<f64> = scene.splats.iter().map(|s| s.radius).collect();
        sorted.sort_by(f64::total_cmp);
        let median = (sorted[(count - 1) / 2] + sorted[count / 2]) / 2.0;
        assert_eq!(scene.splats.len(), count, "{name}");
        assert!(radii.contains(&median), "{name}: {median}");
        assert!(sorted[count - 1] <= 4.0 * median * (1.0 + 1e-12), "{name}");
        // Strays of a scan are not framed.
        assert!(
            scene
                .notes
                .iter()
                .all(|note| note.contains("are outside the chosen view")),
            "{:?}",
            scene.notes
        );
    }
}

/// The bunny is closed and seen from outside, so the normals of its faces point outwards.
#[test]
fn normals_from_faces_point_outwards() {
    let Some(scans) = shared_input::find("scans") else {
        return;
    };
    for name in ["bun_zipper.ply", "igea.ply"] {
        let scene = load(&scans.join(name)).unwrap();
        let centre = scene.camera.target;
        let outwards = scene
            .splats
            .iter()
            .filter(|s| s.normal.dot(s.position - centre) > 0.0)
            .count();
        assert!(
            outwards * 10 > scene.splats.len() * 8,
            "{name}: {outwards} of {}",
            scene.splats.len()
        );
    }
}

#[test]
fn wrong_names_and_paths_are_refused_with_the_existing_ones() {
    let told = |name: &str| {
        Scene::load(name, &Overrides::default())
            .unwrap_err()
            .to_string()
    };
    let builtin = "built in are glass-spheres, checkerboard, torus-knot, terrain, marschner-lobb, nested-shells, fuzzy-clouds, bouquet, city";
    assert_eq!(
        told("glas-spheres"),
        format!(
            "glas-spheres: no such file, and no built-in scene either; {builtin} (nearest: `glass-spheres`)"
        )
    );
    assert!(told("").contains(builtin));
    assert!(told("/").contains("is of no known kind"));
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    assert!(
        load(&write("a.obj", b"v 0 0 0"))
            .unwrap_err()
            .to_string()
            .contains("a scene is a .json file, points (.ply, .tree), Gaussians")
    );
    assert!(
        load(&write("a.json", b"\xff\xfe{"))
            .unwrap_err()
            .to_string()
            .contains("cannot be read")
    );
    std::fs::create_dir(folder.path().join("b.ply")).unwrap();
    assert!(
        load(&folder.path().join("b.ply"))
            .unwrap_err()
            .to_string()
            .contains("cannot be read")
    );
}

#[test]
fn a_cloud_is_found_relative_to_its_scene_file() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float radius\nproperty uchar alpha\nend_header\n0 0 0 1 255\n0 0 1 2 51\nnan 0 2 1 0\n";
    std::fs::write(folder.path().join("cloud.PLY"), cloud).unwrap();
    let scene = r#"{"splats": {"file": "cloud.PLY", "material": 1, "radius_scale": 2, "opacity": 0.5}, "materials": [{}, {"unlit": true}]}"#;
    std::fs::write(folder.path().join("scene.json"), scene).unwrap();
    let scene = load(&folder.path().join("scene.json")).unwrap();
    let seen: Vec<_> = scene
        .splats
        .iter()
        .map(|s| (s.radius, s.opacity, s.material))
        .collect();
    assert_eq!(seen, [(2.0, 0.5, 1), (4.0, 0.1, 1)]);
    assert_eq!(scene.notes.len(), 1);
    assert!(
        scene.notes[0]
            .ends_with("cloud.PLY: 1 of 3 vertices have no finite position and were left out")
    );
    assert_eq!(scene.name, "scene.json");
    let alone = load(&folder.path().join("cloud.PLY")).unwrap();
    assert_eq!(
        (
            alone.splats[1].radius,
            alone.splats[1].opacity,
            alone.name.as_str()
        ),
        (2.0, 0.2, "cloud.PLY")
    );
}

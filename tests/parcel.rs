//! Does a scene that is packed for another process come out unchanged?

use crate::tier::{self, Tier};
use splatsim::scene::tree::Tree;
use splatsim::scene::tree::cut::{Budget, Detail, DetailRules, DrawOrder};
use splatsim::scene::{Camera, Overrides, Scene, names, parcel};
use std::sync::Arc;

fn scenes() -> impl Iterator<Item = Scene> {
    names().map(|name| Scene::load(name, &Overrides { size: Some((8, 6)) }).unwrap())
}

#[test]
fn what_is_unpacked_is_what_was_packed() {
    if !tier::runs(Tier::Ci) {
        return;
    }
    let with_a_tree = |scene: Scene| {
        let rules = DetailRules {
            pixels: 1.0,
            order: DrawOrder::CoarseToFine,
            culls: true,
            ahead: 4,
            budget: Budget::default(),
        };
        let tree = Arc::new(Tree::new(&scene.splats[..100], 4).unwrap());
        Scene {
            detail: Some(Detail::new(tree, rules)),
            ..scene
        }
        .cut()
    };
    let knot = with_a_tree(scenes().find(|scene| scene.ellipsoids.is_none()).unwrap());
    let mut count = 0;
    for scene in scenes().chain([knot]) {
        assert!(
            parcel::unpacked(&parcel::packed(&scene).unwrap()).unwrap() == scene,
            "{}",
            scene.name
        );
        count += 1;
    }
    assert!(count > 3);
}

/// For all fields that a scene may omit: a packed value has no field names that would reveal a
/// missing field.
#[test]
fn a_camera_is_unpacked_with_and_without_a_lens_of_its_own() {
    let scene = scenes().next().unwrap();
    let lenses = [None, Some([300.0, 310.5])]
        .into_iter()
        .flat_map(|focal_px| [None, Some([4.0, 2.5])].map(|other| (focal_px, other)));
    for (focal_px, other) in lenses {
        let camera = Camera {
            focal_px,
            centre_px: other,
            picture_px: other.map(|[x, y]| [2.0 * x, y]),
            ..scene.camera
        };
        let scene = Scene {
            camera,
            ..scene.clone()
        };
        assert!(
            parcel::unpacked(&parcel::packed(&scene).unwrap()).unwrap() == scene,
            "{focal_px:?} {other:?}"
        );
    }
}

#[test]
fn no_damage_is_taken_for_a_scene() {
    let packed = parcel::packed(&scenes().next().unwrap()).unwrap();
    for (at, says) in [
        (3, "another version"),
        (60, "damaged"),
        (packed.len() / 2, "damaged"),
        (packed.len() - 9, "damaged"),
    ] {
        let mut bytes = packed.clone();
        bytes[at] ^= 4;
        assert!(
            parcel::unpacked(&bytes)
                .unwrap_err()
                .to_string()
                .contains(says),
            "byte {at}"
        );
    }
    assert!(
        parcel::unpacked(&packed[..packed.len() - 1])
            .unwrap_err()
            .to_string()
            .contains("damaged")
    );
    assert!(parcel::unpacked(&[]).is_err());
}

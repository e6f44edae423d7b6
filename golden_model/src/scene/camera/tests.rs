use crate::scene::json::FrameChoice;
use crate::scene::{Overrides, Scene, json};
use serde_json::{Value, json};
use std::path::Path;

const ALONE: FrameChoice = FrameChoice {
    frame: 0,
    cameras: None,
};

fn scene_of(splats: Value, size: (usize, usize)) -> Scene {
    let text = json!({ "splats": splats }).to_string();
    json::read(
        &text,
        "test.json",
        Path::new(""),
        &Overrides { size: Some(size) },
        ALONE,
    )
    .unwrap()
    .scene
}

fn cube(n: usize) -> Value {
    let at = |i: usize| i as f64 * 3.0 - 1.0;
    (0..n * n * n)
        .map(|i| json!({"position": [at(i % n), at(i / n % n), at(i / n / n)], "radius": 0.1}))
        .collect()
}

/// Part of the picture, from its centre to its edge, reached by the farthest splat in x and y.
fn reach(scene: &Scene) -> [f64; 2] {
    let view = scene.view();
    let mut reach = [0f64; 2];
    for splat in &scene.splats {
        let t = view.rotation * (splat.position - view.eye);
        assert!(
            t.z > scene.camera.near,
            "{} is not before the eye",
            splat.position
        );
        for (axis, lateral) in [t.x, t.y].into_iter().enumerate() {
            reach[axis] =
                reach[axis].max((view.focal_px[axis] * lateral / t.z).abs() / view.half_px[axis]);
        }
    }
    reach
}

#[test]
fn the_eye_sees_every_splat_in_pictures_of_any_shape() {
    for size in [
        (512, 512),
        (1, 1),
        (1920, 1080),
        (100, 900),
        (16384, 1),
        (1, 16384),
    ] {
        let [x, y] = reach(&scene_of(cube(4), size));
        assert!(x < 1.0 && y < 1.0 && x.max(y) > 0.6, "{size:?}: {x} {y}");
    }
}

#[test]
fn strays_do_not_push_the_eye_away() {
    let with_strays = |strays: usize| {
        let mut splats = cube(8).as_array().unwrap().clone();
        splats.extend((0..strays).map(|i| json!({"position": [1e6, i, 0], "radius": 0.1})));
        let camera = scene_of(splats.into(), (64, 64)).camera;
        (camera.eye - camera.target).length()
    };
    assert!(with_strays(2) < 1.1 * with_strays(0));
    assert!(
        with_strays(50) > 100.0 * with_strays(0),
        "a tenth of the cloud is not a stray"
    );
}

/// A cloud of Gaussians, some of which are far away: faint, or small, or large and faint, in every
/// direction.
#[test]
fn faint_and_small_splats_far_away_do_not_push_the_eye_away() {
    let camera = |far: &dyn Fn(usize) -> Option<Value>, opacity: f64| {
        let mut splats: Vec<Value> = cube(5).as_array().unwrap().clone();
        splats.iter_mut().enumerate().for_each(|(i, splat)| {
            splat["opacity"] = json!(opacity - 0.3 * libm::sin(i as f64).abs())
        });
        splats.extend((0..12).filter_map(far));
        let scene = scene_of(splats.into(), (64, 64));
        (
            (scene.camera.eye - scene.camera.target).length(),
            scene.camera.target,
            scene.notes,
        )
    };
    let way = |i: usize| [0, 1, 2].map(|axis| 3000.0 * libm::sin((7 * i + 2 * axis) as f64));
    let (plain, middle, notes) = camera(&|_| None, 0.9);
    assert_eq!(notes, [""; 0]);
    for (what, radius, opacity) in [
        ("faint", 0.1, 0.02),
        ("small", 0.005, 0.9),
        ("large and faint", 50.0, 0.03),
    ] {
        let far =
            |i: usize| Some(json!({"position": way(i), "radius": radius, "opacity": opacity}));
        let (distance, target, notes) = camera(&far, 0.9);
        assert!(
            distance < 1.1 * plain && (target - middle).length() < 0.1 * plain,
            "{what}: {distance}, {target}"
        );
        assert!(
            notes
                .iter()
                .any(|note| note.starts_with("12 of 137 splats are outside the chosen view")),
            "{what}: {notes:?}"
        );
    }
    // With the opacity and size of the others they are part of the scene.
    let far = |many: usize| {
        move |i: usize| {
            (i < many).then(|| json!({"position": way(i), "radius": 0.1, "opacity": 0.9}))
        }
    };
    assert!(
        [1, 2, 12]
            .iter()
            .all(|many| camera(&far(*many), 0.9).0 > 100.0 * plain)
    );
}

/// Without splats far away, opacities and sizes have no effect.
#[test]
fn opacities_of_an_ordinary_scene_leave_its_eye_where_it_is() {
    let at = |weigh: &dyn Fn(usize) -> f64| {
        let mut splats: Vec<Value> = cube(6).as_array().unwrap().clone();
        splats
            .iter_mut()
            .enumerate()
            .for_each(|(i, splat)| splat["opacity"] = json!(weigh(i)));
        scene_of(splats.into(), (64, 64)).camera
    };
    let plain = at(&|_| 1.0);
    assert_eq!(at(&|i| 0.02 + 0.98 * libm::sin(i as f64).abs()), plain);
    assert_eq!(at(&|i| if i < 30 { 0.01 } else { 1.0 }), plain);
    assert_eq!(at(&|_| 0.0), plain);
}

#[test]
fn one_splat_points_in_one_place_lines_and_planes_are_seen() {
    let clouds = [
        json!([{"position": [3, 4, 5]}]),
        json!([{"position": [0, 0, 0], "radius": 100}]),
        json!([{"position": [1e30, -1e30, 1e30]}]),
        json!(vec![json!({"position": [1e6, 1e6, 1e6]}); 100]),
        (0..50).map(|i| json!({"position": [i, 0, 0]})).collect(),
        (0..400)
            .map(|i| json!({"position": [i % 20, 7, i / 20]}))
            .collect(),
        json!([{"position": [1e-300, 0, 0]}, {"position": [0, 0, 0]}]),
    ];
    for cloud in clouds {
        let scene = scene_of(cloud, (512, 512));
        let [x, y] = reach(&scene);
        assert!(x <= 1.0 && y <= 1.0, "{x} {y}");
        let splat = scene.splats[0];
        assert!(
            splat.radius > 0.0 && (splat.normal.length() - 1.0).abs() < 1e-12,
            "{splat:?}"
        );
        assert!(scene.surface.z_threshold > 0.0 && scene.surface.z_threshold.is_finite());
    }
}

#[test]
fn each_field_that_a_camera_lacks_is_filled_in_separately() {
    let read = |camera: Value| {
        let text = json!({"splats": cube(3), "camera": camera}).to_string();
        json::read(
            &text,
            "test.json",
            Path::new(""),
            &Overrides::default(),
            ALONE,
        )
        .unwrap()
        .scene
    };
    let eye_given = read(json!({"eye": [0, 2, 30]})).camera;
    assert_eq!(
        (eye_given.eye.z, eye_given.target.to_array()),
        (30.0, [2.0, 2.0, 2.0])
    );
    let target_given = read(json!({"target": [2, 2, 0], "fov_y_degrees": 60})).camera;
    assert_eq!(
        (target_given.target.to_array(), target_given.fov_y_degrees),
        ([2.0, 2.0, 0.0], 60.0)
    );
    let down = read(json!({"eye": [2, 30, 2]})).camera;
    assert_eq!(down.up.to_array(), [0.0, 0.0, 1.0]);
    assert!((down.near - 0.028).abs() < 1e-15);
}

#[test]
fn turned_cameras_keep_target_and_distance_and_differ_in_direction() {
    let camera = scene_of(cube(2), (64, 64)).camera;
    assert_eq!(camera.turned(0), camera);
    let ways: Vec<_> = (0..40)
        .map(|nth| camera.turned(nth))
        .map(|camera| camera.eye - camera.target)
        .collect();
    let far = (camera.eye - camera.target).length();
    for (i, way) in ways.iter().enumerate() {
        assert!((way.length() / far - 1.0).abs() < 1e-12, "{i}: {way}");
        let to_pole = way.angle_between(camera.up).to_degrees();
        assert!((4.9..175.1).contains(&to_pole), "{i}: {to_pole}");
        assert!(
            ways[..i]
                .iter()
                .all(|other| other.angle_between(*way).to_degrees() > 2.0),
            "{i}"
        );
    }
    let nearly_above = super::Camera {
        eye: camera.target + camera.up + camera.eye * 1e-3,
        ..camera
    };
    assert!((1..20).all(|nth| nearly_above.turned(nth).eye.is_finite()));
}

/// Pixel position of a point, from the top left corner.
fn lands(scene: &Scene, point: [f64; 3]) -> [f64; 2] {
    let view = scene.view();
    let t = view.rotation * (glam::DVec3::from_array(point) - view.eye);
    [0, 1].map(|axis| view.centre_px[axis] + view.focal_px[axis] * t[axis] / t.z)
}

fn seen_through(camera: Value, size: Option<(usize, usize)>) -> Result<Scene, String> {
    let mut camera = camera;
    (camera["eye"], camera["target"], camera["up"]) =
        (json!([0, 0, 5]), json!([0, 0, 0]), json!([0, 1, 0]));
    let image = json!({"width": 200, "height": 100});
    let text = json!({"splats": cube(2), "camera": camera, "image": image}).to_string();
    json::read(
        &text,
        "test.json",
        Path::new(""),
        &Overrides { size },
        ALONE,
    )
    .map(|seen| seen.scene)
    .map_err(|error| error.to_string())
}

/// x = f_x·X/Z + c_x with the eye at z = 5, looking along −z; y points down.
#[test]
fn a_lens_has_two_focal_lengths_and_a_principal_point() {
    let lens = json!({"focal_px": [120, 80], "centre_px": [90, 62.5]});
    let scene = seen_through(lens.clone(), None).unwrap();
    assert_eq!(
        lands(&scene, [1.0, 0.5, 1.0]),
        [90.0 + 120.0 / 4.0, 62.5 - 80.0 * 0.5 / 4.0]
    );
    // Three times the height: offsets from the centre are three times as large, independent of the
    // width.
    let larger = seen_through(lens.clone(), Some((400, 300))).unwrap();
    assert_eq!(
        lands(&larger, [1.0, 0.5, 1.0]),
        [200.0 + 3.0 * 20.0, 3.0 * 52.5]
    );
    // Lengths in pixels of another picture size.
    let mut of_another = lens;
    of_another["picture_px"] = json!([400, 200]);
    assert_eq!(
        lands(&seen_through(of_another, None).unwrap(), [1.0, 0.5, 1.0]),
        [60.0, 26.25]
    );
    let angle = 2.0 * (50.0f64 / 80.0).atan().to_degrees();
    assert!((scene.camera.fov_y_degrees - angle).abs() < 1e-12);
    // The angle and the equivalent lengths give the same camera.
    let [by_angle, by_lengths] = [
        json!({"fov_y_degrees": angle}),
        json!({"focal_px": [80, 80], "fov_y_degrees": angle}),
    ]
    .map(|camera| seen_through(camera, None).unwrap().view());
    assert!(
        (by_angle.focal_px[0] - 80.0).abs() < 1e-12 && by_angle.centre_px == by_lengths.centre_px
    );
    assert_eq!(by_lengths.focal_px, [80.0; 2]);
}

#[test]
fn a_lens_that_contradicts_itself_is_refused() {
    for (camera, sentence) in [
        (
            json!({"focal_px": [80, 80], "fov_y_degrees": 45}),
            "camera has fov_y_degrees 45 and a focal_px equivalent to 64.0",
        ),
        (
            json!({"picture_px": [80, 80]}),
            "camera.picture_px is given without focal_px or centre_px",
        ),
        (json!({"focal_px": [0, 80]}), "camera.focal_px"),
        (json!({"focal_px": [80]}), "camera.focal_px"),
        (json!({"centre_px": [80, 1e9]}), "camera.centre_px"),
        (
            json!({"focal_px": [80, 80], "picture_px": [0, 5]}),
            "camera.picture_px",
        ),
    ] {
        let refused = seen_through(camera.clone(), None).unwrap_err();
        assert!(refused.contains(sentence), "{camera}: {refused}");
    }
}

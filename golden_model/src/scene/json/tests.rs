use super::*;
use proptest::prelude::*;
use serde_json::json;

/// The example of docs/book/scenes.md, on splats that need no file.
fn example() -> Value {
    json!({
        "splats": [
            {"position": [0, 0, 0], "normal": [0, 0, 2], "radius": 0.1, "rgb": [1, 0, 0.5], "opacity": 0.5, "material": 1},
            {"position": [1, 0, 0]},
            {"builtin": "torus-knot", "count": 9, "order": "random", "seed": 3}
        ],
        "camera": {"eye": [0, 1.2, 4.5], "target": [0, -0.2, 0], "up": [0, 1, 0], "fov_y_degrees": 45, "near": 0.05},
        "image": {"width": 32, "height": 16, "background": [1, 1, 1, 1]},
        "kernel": {"cutoff": 2.0, "low_pass": 1.0},
        "surface": {"z_threshold": 0.06, "coverage_threshold": 0.4, "cull_backfaces": false},
        "lights": [{"direction": [0.4, 0.8, 0.5], "rgb": [1, 1, 1]}],
        "materials": [{"unlit": true}, {"ambient": 0.15, "diffuse": 0.8, "specular": 0.3, "shininess": 32}]
    })
}

/// A scene's first frame.
fn read(text: &str, name: &str, folder: &Path, overrides: &Overrides) -> Result<Scene> {
    super::read(
        text,
        name,
        folder,
        overrides,
        FrameChoice {
            frame: 0,
            cameras: None,
        },
    )
    .map(|seen| seen.scene)
}

fn load(value: &Value) -> Result<Scene> {
    read(
        &value.to_string(),
        "s.json",
        Path::new("/nowhere"),
        &Overrides::default(),
    )
}

/// The example with the value at `pointer` replaced, or inserted if its parent exists.
fn with(pointer: &str, value: Value) -> Value {
    let mut scene = example();
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    match scene.pointer_mut(parent).unwrap() {
        Value::Object(fields) => drop(fields.insert(key.into(), value)),
        Value::Array(items) => items[key.parse::<usize>().unwrap()] = value,
        other => panic!("{other}"),
    }
    scene
}

fn sentence(value: &Value) -> String {
    load(value).expect_err("must be refused").to_string()
}

#[test]
fn the_example_is_read_as_written() {
    let scene = load(&example()).unwrap();
    let first = scene.splats[0];
    assert_eq!(
        (first.normal, first.radius, first.opacity, first.material),
        (DVec3::Z, 0.1, 0.5, 1)
    );
    assert_eq!(
        (
            scene.splats.len(),
            scene.image.width,
            scene.surface.z_threshold
        ),
        (11, 32, 0.06)
    );
    assert_eq!(
        scene.materials,
        [Material::Unlit, material(&MaterialFields::default())]
    );
    assert!((scene.lights[0].direction.length() - 1.0).abs() < 1e-15);
    assert!(scene.lights[0].direction.y > 0.7);
}

#[test]
fn what_is_left_out_is_what_the_interface_says() {
    let scene =
        load(&json!({"splats": [{"position": [0, 0, 0]}, {"position": [0, 2, 0]}]})).unwrap();
    let Scene {
        camera,
        image,
        kernel,
        surface,
        lights,
        materials,
        splats,
        ..
    } = scene;
    assert_eq!(
        (image.width, image.height, image.background),
        (512, 512, [0.0; 4])
    );
    assert_eq!((kernel.cutoff, kernel.low_pass), (2.0, 1.0));
    assert_eq!(
        (
            surface.z_threshold,
            surface.coverage_threshold,
            surface.cull_backfaces
        ),
        (8.0, 0.4, false)
    );
    assert_eq!(
        lights,
        [Light {
            direction: (camera.eye - camera.target).normalize(),
            rgb: [1.0; 3]
        }]
    );
    assert_eq!(
        materials,
        [Material::BlinnPhong {
            ambient: 0.15,
            diffuse: 0.8,
            specular: 0.3,
            shininess: 32.0
        }]
    );
    let splat = splats[0];
    assert_eq!(
        (splat.radius, splat.rgb, splat.opacity, splat.material),
        (2.0, [0.5; 3], 1.0, 0)
    );
    assert!(splat.normal.dot(camera.eye - splat.position) > 0.0);
}

#[test]
fn built_in_sources_bring_their_materials_unless_the_scene_has_its_own() {
    let alone = load(&json!({"splats": {"builtin": "glass-spheres", "count": 100}})).unwrap();
    assert_eq!(alone.materials, Builtin::GlassSpheres.materials());
    let mixed = load(
        &json!({"splats": [{"position": [0, 0, 0]}, {"builtin": "glass-spheres", "count": 100}]}),
    )
    .unwrap();
    assert_eq!(
        (
            mixed.materials.len(),
            mixed.splats[0].material,
            mixed.splats[100].material
        ),
        (3, 0, 2)
    );
    let own = json!({"splats": {"builtin": "glass-spheres"}, "materials": [{"unlit": true}]});
    assert_eq!(
        sentence(&own),
        "s.json: splats uses material 1, but `materials` has only the indices 0 to 0"
    );
}

#[test]
fn splats_of_one_array_are_neighbours_and_others_are_not() {
    let near = json!([{"position": [0, 0, 0]}, {"position": [0, 1, 0]}]);
    let far = json!([{"position": [0, 0, 9]}, {"position": [0, 3, 9]}]);
    let scene = load(&json!({"splats": [near, far]})).unwrap();
    assert_eq!(
        scene.splats.iter().map(|s| s.radius).collect::<Vec<_>>(),
        [1.0, 1.0, 3.0, 3.0]
    );
}

#[test]
fn every_error_has_the_field_and_the_correct_form() {
    let cases = [
        (
            "/camera/fov",
            json!(45),
            "camera.fov is not a known field; the nearest is `fov_y_degrees` (known are eye, target, up, fov_y_degrees, focal_px, centre_px, picture_px, near)",
        ),
        (
            "/camra",
            json!({}),
            "camra is not a known field; the nearest is `camera` (known are splats, camera, cameras, camera_path, image, kernel, surface, sheets, level_of_detail, lights, materials, environment)",
        ),
        (
            "/camera/fov_y_degrees",
            json!(200),
            "camera.fov_y_degrees is 200; it must be at least 1e-6 and less than 180",
        ),
        (
            "/camera/fov_y_degrees",
            json!("wide"),
            "camera.fov_y_degrees is a text; it must be a number",
        ),
        (
            "/camera/eye",
            json!([0, 1]),
            "camera.eye has 2 entries; it must have exactly 3",
        ),
        (
            "/camera/eye",
            json!([0, -0.2, 0]),
            "camera.eye and camera.target are the same point; they must differ",
        ),
        (
            "/camera/eye/1",
            json!(1e31),
            "camera.eye[1] is 1e31; it must be at least -1e30 and at most 1e30",
        ),
        (
            "/camera/up",
            json!([0, 0, 0]),
            "camera.up is zero; it must point somewhere",
        ),
        (
            "/camera/up",
            json!([0, 1.4, 4.5]),
            "camera.up is parallel to the view from eye to target; it must point to the side of it",
        ),
        (
            "/camera/near",
            json!(0),
            "camera.near is 0; it must be more than 0 and at most 1e30",
        ),
        (
            "/image/width",
            json!(0),
            "image.width is 0; it must be at least 1 and at most 16384",
        ),
        (
            "/image/width",
            json!(1.5),
            "image.width is 1.5; it must be a whole number",
        ),
        (
            "/image/background/3",
            json!(-1),
            "image.background[3] is -1; it must be at least 0 and at most 1",
        ),
        (
            "/kernel/jacobian",
            json!(null),
            "kernel.jacobian is null; it must be a number",
        ),
        (
            "/surface/cull_backfaces",
            json!(1),
            "surface.cull_backfaces is a number; it must be true or false",
        ),
        (
            "/lights/0/direction",
            json!([0, 0, 0]),
            "lights[0].direction is zero; it must point somewhere",
        ),
        (
            "/lights/0/rbg",
            json!([0, 0, 0]),
            "lights[0].rbg is not a known field; the nearest is `rgb` (known are direction, rgb)",
        ),
        (
            "/lights",
            json!({}),
            "lights is an object; it must be an array",
        ),
        (
            "/materials",
            json!([]),
            "materials has 0 entries; it must have at least 1",
        ),
        (
            "/splats/0/material",
            json!(2),
            "splats[0] uses material 2, but `materials` has only the indices 0 to 1",
        ),
        (
            "/splats/0/normal",
            json!([0, 0, 0]),
            "splats[0].normal is zero; it must point somewhere",
        ),
        (
            "/splats/0/radius",
            json!(-1),
            "splats[0].radius is -1; it must be at least 1e-30 and at most 1e30",
        ),
        (
            "/splats/0/rgb/2",
            json!(1.01),
            "splats[0].rgb[2] is 1.01; it must be at least 0 and at most 1",
        ),
        (
            "/splats/1",
            json!({"positon": [1, 0, 0]}),
            "splats[1].positon is not a known field; the nearest is `position` (known are position, normal, radius, rgb, opacity, material, file, radius_scale, builtin, count, order, seed, volume, array, variance, layer, transfer, gradient, isovalue, flatten, gaussians, degree, splats, place)",
        ),
        (
            "/splats/1",
            json!({}),
            "splats[1] must have one of the fields `position`, `file`, `builtin`, `volume`, `gaussians`, `splats`, `place`",
        ),
        (
            "/splats/1",
            json!(7),
            "splats[1] is a number; it must be an object or an array",
        ),
        (
            "/splats/2/builtin",
            json!("taurus-knot"),
            "splats[2].builtin is `taurus-knot`; it must be one of glass-spheres, checkerboard, torus-knot, terrain (nearest: `torus-knot`)",
        ),
        (
            "/splats/2/order",
            json!("sorted"),
            "splats[2].order is `sorted`; it must be one of surface, random",
        ),
        (
            "/splats/2/cuont",
            json!(3),
            "splats[2].cuont is not a known field; the nearest is `count` (known are builtin, count, order, seed)",
        ),
        (
            "/splats/2/count",
            json!(0),
            "splats[2].count is 0; it must be at least 1 and at most 67108864",
        ),
        (
            "/splats",
            json!([]),
            "holds no splats; a scene needs at least one",
        ),
    ];
    for (pointer, value, expected) in cases {
        assert_eq!(
            sentence(&with(pointer, value)),
            format!("s.json: {expected}")
        );
    }
    assert_eq!(sentence(&json!({})), "s.json: lacks the field `splats`");
    assert_eq!(
        sentence(&json!([])),
        "s.json: is an array; it must be an object"
    );
    let missing = sentence(&json!({"splats": {"file": "gone.ply"}}));
    assert!(
        missing.starts_with("/nowhere/gone.ply: cannot be read: "),
        "{missing}"
    );
}

#[test]
fn text_that_is_no_json_is_refused_with_its_line() {
    let read = |text: &str| {
        read(text, "s.json", Path::new(""), &Overrides::default())
            .expect_err("refused")
            .to_string()
    };
    assert_eq!(
        read("{\n\"splats\": }"),
        "s.json: not JSON: expected value at line 2 column 11"
    );
    assert!(read("").contains("not JSON"));
    assert!(read("{\"splats\": [{\"position\": [1e999, 0, 0]}]}").contains("out of range"));
    assert!(read("{\"splats\": [{\"position\": [NaN, 0, 0]}]}").contains("not JSON"));
    assert!(read(&"[".repeat(100_000)).contains("recursion"));
    assert!(
        read(&format!(
            "{{\"splats\": {}{}}}",
            "[".repeat(100),
            "]".repeat(100)
        ))
        .contains("holds no splats")
    );
}

#[test]
fn sizes_of_the_picture_are_checked_against_their_limits() {
    let size = |width, height| {
        read(
            &example().to_string(),
            "s.json",
            Path::new(""),
            &Overrides {
                size: Some((width, height)),
            },
        )
        .map(|s| s.image)
    };
    assert_eq!(
        size(0, 5).unwrap_err().to_string(),
        "--size is 0x5 pixels; it must be 1 to 16384 on each side"
    );
    assert_eq!(
        size(16385, 5).unwrap_err().to_string(),
        "--size is 16385x5 pixels; it must be 1 to 16384 on each side"
    );
    assert_eq!(
        size(16384, 2049).unwrap_err().to_string(),
        "--size is 16384x2049 pixels; it must be at most 33554432 pixels in all"
    );
    assert_eq!(size(usize::MAX, usize::MAX).unwrap_err().exit_status(), 2);
    for (width, height) in [(1, 1), (16384, 1), (1, 16384), (16384, 2048)] {
        let image = size(width, height).unwrap();
        assert_eq!((image.width, image.height), (width, height));
    }
    let large = with("/image", json!({"width": 16384, "height": 16384}));
    assert_eq!(
        sentence(&large),
        "s.json: image is 16384x16384 pixels; it must be at most 33554432 pixels in all"
    );
}

#[test]
fn the_schema_has_every_field_of_the_reader() {
    let schema = schema();
    for field in [
        "splats",
        "camera",
        "image",
        "kernel",
        "surface",
        "lights",
        "materials",
    ] {
        assert!(schema["properties"].get(field).is_some(), "{field}");
    }
    assert_eq!(schema["required"], json!(["splats"]));
    assert!(validate::check(&example(), &schema).is_ok());
    for builtin in Builtin::ALL {
        let scene: Value = serde_json::from_str(builtin.scene()).unwrap();
        assert!(validate::check(&scene, &schema).is_ok(), "{builtin:?}");
    }
}

/// All JSON pointers into a value.
fn pointers(value: &Value, at: String, all: &mut Vec<String>) {
    all.push(at.clone());
    match value {
        Value::Object(fields) => fields
            .iter()
            .for_each(|(key, value)| pointers(value, format!("{at}/{key}"), all)),
        Value::Array(items) => items
            .iter()
            .enumerate()
            .for_each(|(i, value)| pointers(value, format!("{at}/{i}"), all)),
        _ => {}
    }
}

fn any_json() -> impl Strategy<Value = Value> {
    let odd = [
        json!(null),
        json!(true),
        json!(""),
        json!("surface"),
        json!([]),
        json!({}),
        json!([0, 0, 0]),
        json!({"x": 1}),
    ];
    let number = prop::sample::select(vec![
        0.0,
        -0.0,
        1.0,
        -1.0,
        0.5,
        45.0,
        1e-300,
        5e-324,
        1e30,
        1e31,
        -1e300,
        4_294_967_296.0,
        1.8e19,
    ]);
    let whole = prop::sample::select(vec![0, 1, 2, -1, 16384, 67_108_865, i64::MAX]);
    prop_oneof![
        prop::sample::select(odd.to_vec()),
        number.prop_map(|n| json!(n)),
        whole.prop_map(|n| json!(n))
    ]
}

proptest! {
    /// Schema and types agree: every value that passes the schema can be read; and no value makes
    /// the reader panic.
    #[test]
    fn what_fits_the_schema_is_read(which in any::<prop::sample::Index>(), value in any_json()) {
        let mut all = Vec::new();
        pointers(&example(), String::new(), &mut all);
        let mut scene = example();
        *scene.pointer_mut(&all[which.index(all.len())]).unwrap() = value;
        let fits = validate::check(&scene, &schema()).is_ok();
        let read = serde_json::from_value::<SceneFields>(scene.clone());
        prop_assert!(!fits || read.is_ok(), "{:?}", read.err());
        if let Ok(scene) = load(&scene) {
            prop_assert!(scene.view().rotation.is_finite() && scene.view().focal_px.into_iter().all(f64::is_finite));
            prop_assert!(scene.splats.iter().all(|s| s.radius > 0.0 && (s.normal.length() - 1.0).abs() < 1e-12));
        }
    }
}

#[test]
fn errors_of_volumes_and_gaussians_have_the_field_and_the_reason() {
    let shells = json!({"builtin": "nested-shells", "samples": 8});
    let of = |source: Value| json!({"splats": source});
    let mut thresholds = of(json!({"volume": shells}));
    thresholds["surface"] = json!({"coverage_threshold": 2});
    let mut stop = of(json!({"volume": shells}));
    stop["sheets"] = json!({"stop": 1});
    let raw = |size: [u64; 3], spacing: f64| {
        of(
            json!({"volume": {"file": "x.raw", "size": size, "type": "u8", "spacing": [spacing, 1, 1]}}),
        )
    };
    let falling = json!([{"value": 2, "opacity": 0.1}, {"value": 1, "opacity": 1}]);
    let cases = [
        (
            of(
                json!([{"builtin": "terrain", "count": 9}, {"splats": {"volume": shells}, "place": {"axis": [0, 0, 0]}}]),
            ),
            "splats[1].place.axis is zero; it must point somewhere",
        ),
        (
            of(json!({"splats": {"volume": shells}, "place": {"scale": 0}})),
            "splats.place.scale is 0; it must be at least 1e-30 and at most 1e30",
        ),
        (
            of(
                json!({"splats": {"splats": {"volume": shells}, "place": {"scale": 1e20}}, "place": {"scale": 1e20}}),
            ),
            "splats.place moves splats out of range: positions must be within ±1e30, radii from 1e-30",
        ),
        (
            json!({"splats": {"gaussians": "bouquet"}, "sheets": {"order": "back-to-front"}}),
            "sheets.order is \"back-to-front\", and Gaussians come front-to-back: leave it out; a machine with fragment.sheets.composite, such as cubed, sorts them from the back by itself",
        ),
        (
            json!({"splats": {"gaussians": "bouquet"}, "sheets": {"opacity": "exponential"}}),
            "sheets.opacity is \"exponential\", and the opacity of a Gaussian is its weight: \"linear\", or leave it out",
        ),
        (
            of(json!([{"volume": shells}, {"splats": {"gaussians": "rose"}, "place": {}}])),
            "splats[1].splats.gaussians is `rose`; it must be one of bouquet, city",
        ),
        (
            of(json!({"gaussians": "rose"})),
            "splats.gaussians is `rose`; it must be one of bouquet, city",
        ),
        (
            of(json!({"volume": shells, "transfer": falling})),
            "splats.transfer[1].value is 1, which is not above the 2 before it",
        ),
        (
            of(json!({"volume": shells, "transfer": [{"value": 2, "opacity": 0}]})),
            "shows nothing of the volume; a transfer function must give some of its values an opacity above 0",
        ),
        (
            of(json!({"volume": shells, "isovalue": 7})),
            "has no surface of this isovalue; it must be between the least and the greatest value of the volume",
        ),
        (
            thresholds,
            "surface.coverage_threshold is 2; a volume's splats are lit with weight 1, so at most 1 is right",
        ),
        (
            stop,
            "sheets.stop is 1; it must be at least 0 and less than 1",
        ),
        (
            raw([1, 1, 1], 0.0),
            "splats.volume: `spacing` has a step of 0; each must be finite and above zero",
        ),
        (
            of(json!({"volume": shells, "material": 3})),
            "splats uses material 3, but `materials` has only the indices 0 to 0",
        ),
    ];
    for (scene, expected) in cases {
        assert_eq!(sentence(&scene), format!("s.json: {expected}"));
    }
    let huge = sentence(&raw([1_000_000_000, 1_000_000_000, 9], 1.0));
    assert!(
        huge.starts_with("s.json: splats.volume: ") && huge.len() < 300,
        "{huge}"
    );
}

#[test]
fn given_splats_are_those_of_the_text() {
    let value = json!({"splats": [
        {"position": [0, 0, 0], "normal": [0, 0, 2], "radius": 0.1, "rgb": [1, 0, 0.5], "opacity": 0.5},
        {"position": [1, 0, 0]}, {"position": [0, 1, 0]}, {"position": [0, 0, 1]}
    ]});
    let first = Splat {
        position: DVec3::ZERO,
        normal: 2.0 * DVec3::Z,
        radius: 0.1,
        rgb: [1.0, 0.0, 0.5],
        opacity: 0.5,
        material: 0,
    };
    let at = |position| Splat {
        position,
        normal: DVec3::ZERO,
        radius: 0.0,
        rgb: [0.5; 3],
        opacity: 1.0,
        material: 0,
    };
    let given = vec![first, at(DVec3::X), at(DVec3::Y), at(DVec3::Z)];
    let of = |splats| {
        Scene::of_splats(
            splats,
            r#"{"splats": []}"#,
            "s.json",
            Path::new(""),
            &Overrides::default(),
            0,
        )
    };
    assert_eq!(of(given.clone()).unwrap(), load(&value).unwrap());
    for (wrong, expected) in [
        (
            Splat {
                position: DVec3::NAN,
                ..first
            },
            "s.json: splats[1].position must be three numbers within ±1e30",
        ),
        (
            Splat {
                radius: f64::NAN,
                ..first
            },
            "s.json: splats[1].radius must be 0, which means fitted, or 1e-30 to 1e30",
        ),
        (
            Splat {
                opacity: 1.5,
                ..first
            },
            "s.json: splats[1].opacity must be a number from 0 to 1",
        ),
        (
            Splat {
                material: 1,
                ..first
            },
            "s.json: splats[1] uses material 1, but `materials` has only the indices 0 to 0",
        ),
    ] {
        assert_eq!(of(vec![first, wrong]).unwrap_err().to_string(), expected);
    }
}

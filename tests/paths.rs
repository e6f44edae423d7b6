//! Does each frame of a sequence show the view of its camera, and does the report contain the right
//! flicker?

use crate::program::{says, splatsim, write};
use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use splatsim::scene::{Camera, CameraFile, Overrides, Scene, Sequence};
use splatsim::view::folder::ResultFolder;

/// The single sentence of a refusal.
fn sentence(arguments: &[&str]) -> String {
    let output = splatsim(arguments);
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(
        (
            output.status.code(),
            output.stdout.len(),
            told.lines().count()
        ),
        (Some(2), 0, 1),
        "{arguments:?}: {told}"
    );
    told
}

fn eye(x: f64) -> Value {
    json!({"eye": [x, 1.2, 4.5], "target": [0.0, -0.2, 0.0], "fov_y_degrees": 45.0, "near": 0.05})
}

/// A small scene of a few hundred splats, or Gaussians, with these additional fields.
fn scene(splats: &Value, more: &Value) -> String {
    let mut scene = json!({"splats": splats, "image": {"width": 24, "height": 20}, "lights": [{"direction": [0.4, 0.8, 0.5]}]});
    for (name, value) in more.as_object().unwrap() {
        scene[name] = value.clone();
    }
    scene.to_string()
}

fn spheres(more: &Value) -> String {
    scene(&json!({"builtin": "glass-spheres", "count": 400}), more)
}

fn report(folder: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(folder.join("report.json")).unwrap()).unwrap()
}

// ---- frames ----

/// Surfaces are loaded once, Gaussians for every frame: both must show the view of each camera
/// alone.
#[test]
fn each_frame_is_the_view_of_its_camera_alone() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let cameras = [eye(0.0), eye(0.4), eye(-2.5)];
    let sources = [
        (json!({"builtin": "glass-spheres", "count": 400}), "tiny"),
        (json!({"gaussians": "bouquet", "count": 150}), "gaussian"),
    ];
    for (nth, (splats, machine)) in sources.iter().enumerate() {
        let all = write(
            folder,
            "all.json",
            &scene(splats, &json!({"cameras": cameras})),
        );
        let out = folder.join(format!("all{nth}"));
        says(&[
            "run",
            &all,
            "--machine",
            machine,
            "--out",
            out.to_str().unwrap(),
            "--quiet",
        ]);
        let told = report(&out);
        assert_eq!(told["scene"]["frames"], 3);
        for (frame, camera) in cameras.iter().enumerate() {
            let one = write(
                folder,
                "one.json",
                &scene(splats, &json!({"camera": camera})),
            );
            let alone = folder.join("alone");
            says(&[
                "run",
                &one,
                "--machine",
                machine,
                "--out",
                alone.to_str().unwrap(),
                "--quiet",
            ]);
            for picture in ["fixed", "golden", "ideal"] {
                let bytes = |path: PathBuf| std::fs::read(path).unwrap();
                let same = bytes(out.join(format!("frame_{frame:04}_{picture}.png")))
                    == bytes(alone.join(format!("{picture}.png")));
                assert!(same, "{picture} of frame {frame}, source {nth}");
            }
            let (row, own) = (&told["frames"][frame], report(&alone));
            assert_eq!(
                row["accuracy"]["golden_vs_ideal"],
                own["accuracy"]["golden_vs_ideal"]
            );
            assert_eq!(
                row["accuracy"]["fixed_vs_golden"],
                own["accuracy"]["fixed_vs_golden"]
            );
            assert_eq!(
                (&row["cycles"], &row["frames_per_second"]),
                (&own["cycles"]["total"], &own["cycles"]["frames_per_second"])
            );
            assert_eq!(
                (&row["fragments"], &row["camera"]),
                (&own["scene"]["fragments"], &own["scene"]["camera"])
            );
        }
    }
}

/// In every frame, omitted light and normals are those of the first camera, also if the frame is
/// drawn alone.
#[test]
fn one_frame_by_itself_is_that_of_the_sequence() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let splats: Value = (0..90).map(|i| json!({"position": [f64::from(i % 10) / 5.0 - 1.0, f64::from(i / 10) / 5.0 - 1.0, 0.0]})).collect();
    let cameras = json!({"cameras": [eye(0.0), eye(3.0)], "lights": null});
    let path = write(folder, "scene.json", &scene(&splats, &cameras));
    let (all, one) = (folder.join("all"), folder.join("one"));
    says(&[
        "run",
        &path,
        "--machine",
        "tiny",
        "--out",
        all.to_str().unwrap(),
        "--quiet",
    ]);
    says(&[
        "run",
        &path,
        "--machine",
        "tiny",
        "--out",
        one.to_str().unwrap(),
        "--quiet",
        "--frame",
        "1",
    ]);
    let bytes = |path: PathBuf| std::fs::read(path).unwrap();
    assert!(bytes(all.join("frame_0001_ideal.png")) == bytes(one.join("ideal.png")));
    assert!(bytes(all.join("frame_0000_ideal.png")) != bytes(one.join("ideal.png")));
    assert_eq!(report(&one)["scene"]["frame"], 1);
    let [first, second] =
        [0, 1].map(|frame| Scene::load_frame(&path, &Overrides::default(), frame).unwrap());
    assert_eq!((first.lights, first.splats), (second.lights, second.splats));
    // Commands for one frame use the given frame, otherwise the first.
    let story = |more: &[&str]| {
        says(
            &[
                &["explain", &path, "--pixel", "12,9", "--machine", "tiny"],
                more,
            ]
            .concat(),
        )
    };
    assert!(story(&[]) == story(&["--frame", "0"]) && story(&[]) != story(&["--frame", "1"]));
    let told = sentence(&["explain", &path, "--pixel", "1,1", "--frame", "2"]);
    assert!(
        told.contains("has no frame 2 (--frame): 0 to 1 are right"),
        "{told}"
    );
    assert!(sentence(&["run", "glass-spheres", "--frame", "1"]).contains("only 0 is right"));
    // A trace's scene is redrawn as its first frame; for other frames no scene is kept.
    for (frame, is_there) in [("0", true), ("1", false)] {
        let out = folder.join(format!("trace{frame}"));
        says(&[
            "trace",
            &path,
            "--machine",
            "tiny",
            "--frame",
            frame,
            "--units",
            "gauss",
            "--out",
            out.to_str().unwrap(),
            "--quiet",
        ]);
        assert_eq!(out.join("scene.json").exists(), is_there);
    }
    // A folder of frames is shown: the pictures and a row of every frame.
    let shown = ResultFolder::read(&all).unwrap();
    assert_eq!(
        shown.contents["sequence"]["kinds"],
        json!(["fixed", "golden", "ideal"])
    );
    let names = [
        "0000_fixed",
        "0000_golden",
        "0000_ideal",
        "0001_fixed",
        "0001_golden",
        "0001_ideal",
    ];
    assert_eq!(
        shown.pictures(),
        names.map(|name| format!("frame_{name}.png"))
    );
    let column = |name: &str| {
        shown.contents["tables"][0]["columns"]
            .as_array()
            .unwrap()
            .iter()
            .find(|column| column["name"] == name)
            .unwrap()
            .clone()
    };
    assert_eq!(column("frame")["values"], json!([0, 1]));
    assert_eq!(column("cycles")["rows"].as_u64().unwrap_or(2), 2);
    // If a picture of a kind is missing, this kind is not shown; if the figures of a frame are
    // missing, nothing is shown.
    std::fs::remove_file(all.join("frame_0001_golden.png")).unwrap();
    assert_eq!(
        ResultFolder::read(&all).unwrap().contents["sequence"]["kinds"],
        json!(["fixed", "ideal"])
    );
    let mut broken = report(&all);
    broken["frames"][1]
        .as_object_mut()
        .unwrap()
        .remove("cycles");
    std::fs::write(all.join("report.json"), broken.to_string()).unwrap();
    let told = sentence(&["view", all.to_str().unwrap(), "--no-open"]);
    assert!(
        told.contains(
            "report.json: has no frames[].cycles: it is not a report of `run` on a sequence"
        ),
        "{told}"
    );
}

fn exr(path: &Path) -> Vec<[f32; 4]> {
    use exr::prelude::{ReadChannels, ReadLayers};
    let read = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgba_channels(
            |size, _| (size.width(), vec![[0.0_f32; 4]; size.area()]),
            |(width, pixels), at, (r, g, b, a): (f32, f32, f32, f32)| {
                pixels[at.y() * *width + at.x()] = [r, g, b, a]
            },
        );
    read.first_valid_layer()
        .all_attributes()
        .from_file(path)
        .unwrap()
        .layer_data
        .channel_data
        .pixels
        .1
}

/// The report's flicker, computed from the written pictures: every pixel of this scene that a
/// picture draws is covered.
#[test]
fn flicker_is_that_of_the_written_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let pan = json!({"camera_path": {"pan_pixels": 0.0625, "frames": 3, "camera": eye(0.0)}, "kernel": {"low_pass": 1.0}});
    let path = write(folder, "pan.json", &spheres(&pan));
    let out = folder.join("out");
    let printed = says(&[
        "run",
        &path,
        "--machine",
        "tiny",
        "--exr",
        "--out",
        out.to_str().unwrap(),
    ]);
    let told = report(&out);
    let frame = |n: usize| {
        ["fixed", "golden", "ideal"]
            .map(|picture| exr(&out.join(format!("frame_{n:04}_{picture}.exr"))))
    };
    let frames = [0, 1, 2].map(frame);
    let mut still = 0;
    let mut found = [(0.0, 0); 3];
    for pair in frames.windows(2) {
        let of = |frame: usize, picture: usize, pixel: usize, channel: usize| {
            f64::from(pair[frame][picture][pixel][channel]).clamp(0.0, 1.0)
        };
        for pixel in 0..24 * 20 {
            let is_covered = pair.iter().flatten().any(|picture| picture[pixel][3] > 0.0);
            let moves = (0..3).any(|channel| {
                (of(1, 2, pixel, channel) - of(0, 2, pixel, channel)).abs() >= 0.5 / 255.0
            });
            if moves || !is_covered {
                continue;
            }
            still += 1;
            for (sums, (a, b)) in found.iter_mut().zip([(0, 1), (1, 2), (0, 2)]) {
                let error = |frame: usize, channel: usize| {
                    of(frame, a, pixel, channel) - of(frame, b, pixel, channel)
                };
                let changes =
                    [0, 1, 2].map(|channel| (error(1, channel) - error(0, channel)).abs());
                sums.0 += changes.iter().sum::<f64>() / 3.0;
                sums.1 += i32::from(changes.iter().any(|change| *change > 4.0 / 255.0));
            }
        }
    }
    assert!(
        still > 100 && told["flicker"]["still_pixels"] == still,
        "{still}: {}",
        told["flicker"]
    );
    for ((sum, jumps), name) in
        found
            .into_iter()
            .zip(["fixed_vs_golden", "golden_vs_ideal", "fixed_vs_ideal"])
    {
        let now = &told["flicker"][name];
        let close =
            |field: &str, expected: f64| (now[field].as_f64().unwrap() - expected).abs() < 1e-6;
        assert!(
            close("mean", sum / f64::from(still))
                && close("jumps", f64::from(jumps) / f64::from(still)),
            "{name}: {now} {sum} {jumps}"
        );
        assert!(sum > 0.0);
    }
    assert!(
        found.iter().any(|(_, jumps)| *jumps > 0),
        "nothing jumps: the test asks too little"
    );
    assert!(
        printed.contains("flicker") && printed.contains("still pixels of"),
        "{printed}"
    );
    assert!(
        printed.lines().all(|line| line.chars().count() <= 80),
        "{printed}"
    );
    assert!(
        told["frames"][0]["flicker"].is_null()
            && told["frames"][1]["flicker"]["still_pixels"]
                .as_u64()
                .unwrap()
                > 0
    );
}

#[test]
fn a_sequence_is_the_same_at_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(
        folder.path(),
        "pan.json",
        &spheres(&json!({"camera_path": {"pan_pixels": 2.0, "frames": 3}})),
    );
    let run = |threads: &str| {
        let out = folder.path().join(threads);
        let video = out.join("fixed.y4m");
        let (shown, film) = (out.to_str().unwrap(), video.to_str().unwrap());
        says(&[
            "run",
            &path,
            "--machine",
            "tiny",
            "--threads",
            threads,
            "--out",
            shown,
            "--y4m",
            film,
            "--quiet",
        ]);
        let mut report = report(&out);
        report["host"] = Value::Null;
        let mut names: Vec<_> = std::fs::read_dir(&out)
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        names.sort();
        (report, std::fs::read(video).unwrap(), names)
    };
    let (one, three) = (run("1"), run("3"));
    assert!(one == three);
    assert_eq!(one.2.len(), 3 * 3 + 2, "{:?}", one.2);
}

/// A frame's bytes from its PNG, by the inverse of BT.601's matrix in integers (ITU-R BT.601, 8
/// bits, limited range).
#[test]
fn the_video_shows_the_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // Opaque, so that the straight colours of a PNG equal those over black.
    let more = json!({"cameras": [eye(0.0), eye(0.5)], "image": {"width": 24, "height": 20, "background": [1, 1, 1, 1]}});
    let path = write(folder, "scene.json", &spheres(&more));
    let (out, film) = (folder.join("out"), folder.join("fixed.y4m"));
    says(&[
        "run",
        &path,
        "--machine",
        "lean",
        "--out",
        out.to_str().unwrap(),
        "--y4m",
        film.to_str().unwrap(),
        "--quiet",
    ]);
    let bytes = std::fs::read(film).unwrap();
    let head = b"YUV4MPEG2 W24 H20 F30:1 Ip A1:1 C444\n";
    assert!(bytes.starts_with(head));
    let frames: Vec<&[u8]> = bytes[head.len()..].chunks(6 + 3 * 480).collect();
    assert_eq!(frames.len(), 2);
    for (nth, frame) in frames.into_iter().enumerate() {
        assert!(frame.starts_with(b"FRAME\n") && frame.len() == 6 + 3 * 480);
        let plane = |which: usize, pixel: usize| i32::from(frame[6 + which * 480 + pixel]);
        let png = image::open(out.join(format!("frame_{nth:04}_fixed.png")))
            .unwrap()
            .into_rgb8();
        for (pixel, shown) in png.pixels().enumerate() {
            let (c, d, e) = (
                plane(0, pixel) - 16,
                plane(1, pixel) - 128,
                plane(2, pixel) - 128,
            );
            let rgb = [
                298 * c + 409 * e,
                298 * c - 100 * d - 208 * e,
                298 * c + 516 * d,
            ]
            .map(|value| (value + 128) >> 8);
            assert!(
                rgb.iter()
                    .zip(shown.0)
                    .all(|(a, b)| (a.clamp(&0, &255) - i32::from(b)).abs() <= 3),
                "{pixel}: {rgb:?} {shown:?}"
            );
        }
    }
}

// ---- paths ----

fn cameras(more: &Value) -> Vec<Camera> {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "scene.json", &spheres(more));
    Sequence::load(&path, &Overrides::default(), None)
        .unwrap()
        .cameras()
        .to_vec()
}

/// The matrix of Catmull and Rom for equidistant keys (1974, and any textbook).
fn catmull_rom(p: [f64; 4], t: f64) -> f64 {
    let [a, b, c, d] = p;
    0.5 * (2.0 * b
        + (c - a) * t
        + (2.0 * a - 5.0 * b + 4.0 * c - d) * t * t
        + (3.0 * b - a - 3.0 * c + d) * t * t * t)
}

#[test]
fn a_smooth_path_goes_through_its_keys_and_between_them_as_catmull_and_rom_say() {
    let xs = [0.0, 1.0, -1.0, 0.5];
    let key = |at: usize, x: f64, fov: f64| {
        let mut key = eye(x);
        (key["at"], key["fov_y_degrees"]) = (json!(at), json!(fov));
        key
    };
    let keys: Vec<Value> = xs
        .iter()
        .enumerate()
        .map(|(i, x)| key(4 * i, *x, 40.0 + 5.0 * x))
        .collect();
    let smooth = cameras(&json!({"camera_path": {"keys": keys}}));
    assert_eq!(smooth.len(), 13);
    for (i, x) in xs.iter().enumerate() {
        assert_eq!(
            (smooth[4 * i].eye.x, smooth[4 * i].fov_y_degrees),
            (*x, 40.0 + 5.0 * x)
        );
    }
    for part in 1..4 {
        let expected = catmull_rom(xs, f64::from(part) / 4.0);
        let camera = smooth[4 + part as usize];
        assert!(
            (camera.eye.x - expected).abs() < 1e-12
                && (camera.fov_y_degrees - 40.0 - 5.0 * expected).abs() < 1e-12,
            "{camera:?}"
        );
    }
    let linear =
        cameras(&json!({"camera_path": {"keys": keys, "interpolation": "linear", "frames": 20}}));
    assert!((linear[6].eye.x - 0.0).abs() < 1e-15 && (linear[5].eye.x - 0.5).abs() < 1e-15);
    // It rests at the last key.
    assert!(linear.len() == 20 && linear[19] == linear[12] && linear[12].eye.x == 0.5);
    // Two keys give a straight line, and one a camera at rest.
    let two = cameras(&json!({"camera_path": {"keys": [key(2, 0.0, 45.0), key(7, 1.0, 45.0)]}}));
    assert!(
        (0..8).all(|frame| (two[frame].eye.x - (frame as f64 - 2.0).max(0.0) / 5.0).abs() < 1e-12)
    );
    assert_eq!(
        cameras(&json!({"camera_path": {"keys": [key(0, 0.3, 45.0)], "frames": 5}})).len(),
        5
    );
}

/// Position of a point of the world on the screen, computed from the angles of right-angled
/// triangles, not by the renderers' formula. Pixels from the middle.
fn lands(camera: &Camera, height: f64, point: [f64; 3]) -> [f64; 2] {
    let sub = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    };
    let (forward, up) = (
        sub(camera.target.to_array(), camera.eye.to_array()),
        camera.up.to_array(),
    );
    let right = cross(forward, up);
    let above = cross(right, forward);
    let way = sub(point, camera.eye.to_array());
    let along = dot(way, forward) / dot(forward, forward).sqrt();
    let scale = height / 2.0 / (camera.fov_y_degrees / 2.0 * std::f64::consts::PI / 180.0).tan();
    [
        dot(way, right) / dot(right, right).sqrt(),
        -dot(way, above) / dot(above, above).sqrt(),
    ]
    .map(|aside| scale * aside / along)
}

#[test]
fn a_pan_moves_the_middle_of_the_picture_by_its_pixels() {
    let pan =
        cameras(&json!({"camera_path": {"pan_pixels": 0.0625, "frames": 40, "camera": eye(1.0)}}));
    assert_eq!(pan.len(), 40);
    let middle = pan[0].target.to_array();
    for (frame, camera) in pan.iter().enumerate() {
        let [x, y] = lands(camera, 20.0, middle);
        assert!(
            (x + 0.0625 * frame as f64).abs() < 1e-9 && y.abs() < 1e-9 && camera.eye == pan[0].eye,
            "{frame}: {x} {y}"
        );
    }
}

// ---- cameras of other programs ----

/// Pseudo-random integers.
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
    }
}

/// Rows of the rotation of a unit quaternion, as defined in COLMAP's documents.
fn rotation([w, x, y, z]: [f64; 4]) -> [[f64; 3]; 3] {
    [
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
        ],
        [
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
        ],
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        ],
    ]
}

fn load(folder: &Path, file: &str) -> splatsim::error::Result<Sequence> {
    let file = CameraFile::read(&folder.join(file))?;
    let scene = write(folder, "scene.json", &spheres(&json!({})));
    Sequence::load(&scene, &Overrides::default(), Some(file))
}

/// A little-endian file in the format of COLMAP's `cameras.bin`: one camera with this model and
/// these numbers.
fn cameras_bin(id: u32, model: u32, size: [u64; 2], numbers: &[f64]) -> Vec<u8> {
    let words = [
        1_u64.to_le_bytes().to_vec(),
        id.to_le_bytes().to_vec(),
        model.to_le_bytes().to_vec(),
    ]
    .concat();
    let sizes = size.iter().flat_map(|side| side.to_le_bytes());
    words
        .into_iter()
        .chain(sizes)
        .chain(numbers.iter().flat_map(|number| number.to_le_bytes()))
        .collect()
}

/// An image of `images.bin` with `points` points.
fn image_bin(
    id: u32,
    turn: [f64; 4],
    shift: [f64; 3],
    camera: u32,
    name: &str,
    points: u64,
) -> Vec<u8> {
    let mut bytes = id.to_le_bytes().to_vec();
    turn.iter()
        .chain(&shift)
        .for_each(|number| bytes.extend(number.to_le_bytes()));
    bytes.extend(camera.to_le_bytes());
    bytes.extend(name.as_bytes());
    bytes.push(0);
    bytes.extend(points.to_le_bytes());
    (0..points).for_each(|point| {
        bytes.extend(
            [
                1.5_f64.to_le_bytes(),
                2.5_f64.to_le_bytes(),
                point.to_le_bytes(),
            ]
            .concat(),
        )
    });
    bytes
}

fn write_bytes(folder: &Path, name: &str, bytes: &[u8]) {
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, bytes).unwrap();
}

/// A scene seen by COLMAP's cameras and by the same cameras in the formats of other programs: every
/// point must be at the position of COLMAP's own formula, u = f·x/z + c of x = R·X + t.
#[test]
fn points_land_where_the_formulas_of_colmap_and_nerfstudio_put_them() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut random = noise(7);
    let (width, height, focal) = (640.0_f64, 400.0_f64, 512.5);
    let mut images = String::from("# Image list\n#   POINTS2D[] as (X, Y, POINT3D_ID)\n");
    let (mut poses, mut frames) = (Vec::new(), Vec::new());
    let (mut binary, mut trained, mut video, mut short) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for nth in 0..8 {
        let mut turn = [random(), random(), random(), random()];
        let length = turn.iter().map(|part| part * part).sum::<f64>().sqrt();
        turn = turn.map(|part| part / length);
        let (r, t) = (rotation(turn), [random(), random(), 4.0 + random()]);
        // Named so that the order of names is that of the numbers; below they are written in the
        // reverse order.
        let [w, x, y, z] = turn;
        let line = format!(
            "{} {w:?} {x:?} {y:?} {z:?} {:?} {:?} {:?} 3 view {nth}.png\n1.5 2.5 -1\n",
            100 - nth,
            t[0],
            t[1],
            t[2]
        );
        poses.push((r, t, line));
        // The same camera → world, with y up and z back: columns Rᵀ·(1, −1, −1), position −Rᵀt.
        let column = |axis: usize| [r[axis][0], r[axis][1], r[axis][2]];
        let [right, down, ahead] = [0, 1, 2].map(column);
        let at: Vec<f64> = (0..3)
            .map(|i| -(right[i] * t[0] + down[i] * t[1] + ahead[i] * t[2]))
            .collect();
        let mut rows: Vec<Value> = (0..3)
            .map(|i| json!([right[i], -down[i], -ahead[i], at[i]]))
            .collect();
        rows.push(json!([0, 0, 0, 1]));
        frames.push(json!({"file_path": format!("{nth}.png"), "transform_matrix": rows}));
        short.push(json!({"file_path": format!("{nth}.png"), "transform_matrix": rows[..3]}));
        video.push(json!({"camera_to_world": rows.iter().flat_map(|row| row.as_array().unwrap()).collect::<Vec<_>>(), "aspect": 1,
            "fov": 2.0 * (height / 2.0 / focal).atan().to_degrees()}));
        let axes: Vec<Value> = (0..3)
            .map(|i| json!([right[i], down[i], ahead[i]]))
            .collect();
        trained.push(json!({"id": nth, "img_name": format!("{nth}"), "width": 640, "height": 400, "position": at, "rotation": axes,
            "fy": focal, "fx": focal}));
        binary.push(image_bin(
            100 - nth,
            turn,
            t,
            3,
            &format!("view {nth}.png"),
            u64::from(nth % 3),
        ));
    }
    poses
        .iter()
        .rev()
        .for_each(|(_, _, line)| images.push_str(line));
    write(
        folder,
        "sparse/cameras.txt",
        &format!("# Camera list\n3 SIMPLE_RADIAL 640 400 {focal} 320 200 0\n"),
    );
    write(folder, "sparse/images.txt", &images);
    write(
        folder,
        "bare/cameras.txt",
        &format!("\u{feff}3 SIMPLE_RADIAL 640 400 {focal} 320 200 0\r\n"),
    );
    let bare: String = images
        .lines()
        .filter(|line| !line.starts_with(['#', '1']) || line.contains("view"))
        .map(|line| format!("{line}\r\n"))
        .collect();
    write(folder, "bare/images.txt", &bare);
    write_bytes(
        folder,
        "project/sparse/0/cameras.bin",
        &cameras_bin(3, 2, [640, 400], &[focal, 320.0, 200.0, 0.0]),
    );
    let images_bin = [
        8_u64.to_le_bytes().to_vec(),
        binary.into_iter().rev().flatten().collect(),
    ]
    .concat();
    write_bytes(folder, "project/sparse/0/images.bin", &images_bin);
    write(folder, "cameras.json", &Value::from(trained).to_string());
    write(
        folder,
        "camera_path.json",
        &json!({"camera_type": "perspective", "render_width": 640, "render_height": 400, "fps": 24,
        "camera_path": video, "crop": null})
        .to_string(),
    );
    let more = json!({"w": 640, "h": 400, "fl_x": focal, "frames": short});
    write(folder, "ns/transforms.json", &format!("\u{feff}{more}"));
    let wide = |order: fn(u16) -> [u8; 2]| {
        format!("\u{feff}{more}")
            .encode_utf16()
            .flat_map(order)
            .collect::<Vec<u8>>()
    };
    write_bytes(folder, "wide.json", &wide(u16::to_le_bytes));
    let all = json!({"camera_model": "OPENCV", "w": 640, "h": 400, "fl_x": focal, "fl_y": focal, "cx": 320.0, "cy": 200, "k1": 0.0, "frames": frames});
    write(folder, "transforms.json", &all.to_string());
    let wide = 2.0 * (width / 2.0 / focal).atan();
    write(
        folder,
        "blender.json",
        &json!({"camera_angle_x": wide, "w": 640, "h": 400, "frames": frames}).to_string(),
    );
    let text = [
        "sparse",
        "sparse/images.txt",
        "sparse/cameras.txt",
        "bare",
        "transforms.json",
        "blender.json",
        "ns",
        "wide.json",
    ];
    let others = [
        "project",
        "project/sparse/0",
        "project/sparse/0/images.bin",
        "cameras.json",
        "camera_path.json",
    ];
    for file in text.into_iter().chain(others) {
        let mut sequence = load(folder, file).unwrap();
        assert_eq!(
            (
                sequence.scene().image.width,
                sequence.scene().image.height,
                sequence.cameras().len()
            ),
            (640, 400, 8),
            "{file}"
        );
        for (nth, (r, t, _)) in poses.iter().enumerate() {
            let view = sequence.frame(nth).unwrap().view();
            for _ in 0..20 {
                // In front of the camera, and from there back into the world.
                let c = [2.0 * random(), 2.0 * random(), 3.0 + random()];
                let world: [f64; 3] = std::array::from_fn(|i| {
                    (0..3).map(|axis| r[axis][i] * (c[axis] - t[axis])).sum()
                });
                let (u, v) = (focal * c[0] / c[2] + 320.0, focal * c[1] / c[2] + 200.0);
                let seen = view.rotation * (glam::DVec3::from_array(world) - view.eye);
                let ours = [
                    view.centre_px[0] + view.focal_px[0] * seen.x / seen.z,
                    view.centre_px[1] + view.focal_px[1] * seen.y / seen.z,
                ];
                assert!(
                    (ours[0] - u).abs() < 1e-7 && (ours[1] - v).abs() < 1e-7 && seen.z > 0.0,
                    "{file} {nth}: {ours:?}, not {u} {v}"
                );
                let [x, y] = lands(&sequence.cameras()[nth], height, world);
                assert!(
                    (x + 320.0 - u).abs() < 1e-7 && (y + 200.0 - v).abs() < 1e-7,
                    "{file} {nth}"
                );
            }
        }
    }
}

#[test]
fn a_file_without_the_pictures_size_takes_the_scenes() {
    let folder = tempfile::tempdir().unwrap();
    let matrix = json!([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 5], [0, 0, 0, 1]]);
    write(
        folder.path(),
        "t.json",
        &json!({"camera_angle_x": 0.8, "frames": [{"transform_matrix": matrix}]}).to_string(),
    );
    let sequence = load(folder.path(), "t.json").unwrap();
    assert_eq!(
        (sequence.scene().image.width, sequence.scene().image.height),
        (24, 20)
    );
    let wide = sequence.scene().view();
    assert!((wide.half_px[0] / wide.focal_px[0] - f64::tan(0.4)).abs() < 1e-12);
}

#[test]
fn cameras_that_cannot_be_expressed_are_refused_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let unit = json!([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 5], [0, 0, 0, 1]]);
    let nerfstudio = |more: Value, matrix: &Value| {
        let mut all =
            json!({"w": 64, "h": 48, "fl_x": 50, "frames": [{"transform_matrix": matrix}]});
        more.as_object()
            .unwrap()
            .iter()
            .for_each(|(name, value)| all[name] = value.clone());
        write(folder, "t.json", &all.to_string());
        load(folder, "t.json").unwrap_err().to_string()
    };
    let mirrored = json!([[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 5], [0, 0, 0, 1]]);
    for (told, part) in [
        (
            nerfstudio(json!({"k1": 0.01}), &unit),
            "frames[0]: k1 is 0.01: a lens that distorts",
        ),
        (nerfstudio(json!({"fl_x": 0}), &unit), "must be above 0"),
        (
            nerfstudio(json!({"fl_x": "50"}), &unit),
            "fl_x is not a number",
        ),
        (
            nerfstudio(json!({"w": 1e9}), &unit),
            "w is 1000000000; it must be a whole number of pixels",
        ),
        (
            nerfstudio(json!({"w": 900_000}), &unit),
            "the picture is 900000x48 pixels; it must be 1 to 16384",
        ),
        (
            nerfstudio(json!({"camera_model": "OPENCV_FISHEYE"}), &unit),
            "camera_model is OPENCV_FISHEYE",
        ),
        (
            nerfstudio(json!({}), &mirrored),
            "transform_matrix is not a rotation",
        ),
        (
            nerfstudio(json!({}), &json!([[1, 0], [0, 1]])),
            "four rows of four numbers",
        ),
        (
            nerfstudio(
                json!({}),
                &json!([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 5], [0, 0, 0, 2]]),
            ),
            "its last row must be 0 0 0 1",
        ),
        (
            nerfstudio(
                json!({}),
                &json!([
                    [1, 0, 0, 0],
                    [0, 1, 0, 0],
                    [0, 0, 1, 5],
                    [0, 0, 0, 1],
                    [0, 0, 0, 1]
                ]),
            ),
            "four rows of four",
        ),
        (nerfstudio(json!({"frames": []}), &unit), "has no camera"),
        (
            nerfstudio(json!({"frames": 3}), &unit),
            "has no list `frames`",
        ),
    ] {
        assert!(
            told.starts_with("--cameras ") && told.contains(part) && !told.contains('\n'),
            "{told}, not {part}"
        );
    }
    write(
        folder,
        "t.json",
        r#"{"w": 64, "h": 48, "fl_x": 50, "frames": [{"transform_matrix": [[NaN]]}]}"#,
    );
    assert!(
        load(folder, "t.json")
            .unwrap_err()
            .to_string()
            .contains("not JSON")
    );
    let colmap = |lens: &str, images: &str| {
        write(folder, "c/cameras.txt", lens);
        write(folder, "c/images.txt", images);
        load(folder, "c").unwrap_err().to_string()
    };
    let good = "1 PINHOLE 64 48 50 50 32 24";
    let one = "1 1 0 0 0 0 0 4 1 a.png\n";
    for (told, part) in [
        (
            colmap("1 OPENCV 64 48 50 50 32 24 0 0 0.1 0", ""),
            "cameras.txt: line 1: a lens that distorts cannot be drawn (0.1)",
        ),
        (
            colmap("# of\n1 OPENCV_FISHEYE 64 48 50 50 32 24 0 0 0 0", ""),
            "line 2: the model OPENCV_FISHEYE cannot",
        ),
        (
            colmap("1 PINHOLE 64 48 50 50 32", ""),
            "PINHOLE has 3 numbers",
        ),
        (
            colmap("1 PINHOLE 64 48 50 50 NaN 24", ""),
            "`NaN` is not a finite number",
        ),
        (
            colmap("x PINHOLE 64 48 50 50 32 24", one),
            "`x` is not an identity",
        ),
        (
            colmap("1 PINHOLE 99999999999999999999 48 50 50 31 24", ""),
            "is not a width or height",
        ),
        (
            colmap(&format!("{good}\n{good}"), ""),
            "line 2: camera 1 is defined twice",
        ),
        (colmap(good, ""), "has no camera"),
        (
            colmap(good, "1 1 0 0 0 0 0 4 7 a.png\n"),
            "images.txt: line 1: its camera 7 is not in cameras.txt",
        ),
        (
            colmap(good, "1 0 0 0 0 0 0 4 1 a.png\n"),
            "quaternion is zero",
        ),
        (
            colmap(good, "1 1 0 0 0 0 0 inf 1 a.png\n"),
            "`inf` is not a finite number",
        ),
        (
            colmap(good, "1 1 0 0 0 0 0 4 1 a.png\n1.5 2.5\n"),
            "line 2: a picture is an identity, a quaternion",
        ),
    ] {
        assert!(
            told.starts_with("--cameras ") && told.contains(part) && !told.contains('\n'),
            "{told}, not {part}"
        );
    }
    assert!(
        CameraFile::read(&folder.join("absent.json"))
            .unwrap_err()
            .to_string()
            .contains("cannot be read")
    );
}

#[test]
fn cameras_of_training_and_of_videos_that_cannot_be_read_are_refused_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |all: &Value| {
        write(folder.path(), "x.json", &all.to_string());
        let told = CameraFile::read(&folder.path().join("x.json"))
            .unwrap_err()
            .to_string();
        assert!(
            told.starts_with("--cameras ") && !told.contains('\n'),
            "{told}"
        );
        told
    };
    let good = json!({"width": 96, "height": 72, "position": [0, 0, -4], "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "fx": 120, "fy": 120});
    let trained = |name: &str, value: Value| {
        let mut second = good.clone();
        second[name] = value;
        refused(&json!([good, second]))
    };
    for (told, part) in [
        (
            trained("width", json!(1.5)),
            "[1]: width is 1.5; it must be a whole number",
        ),
        (trained("height", Value::Null), "[1]: has no height"),
        (trained("cx", json!("40")), "[1]: cx is not a number"),
        (
            trained("fx", json!(0)),
            "[1]: its focal lengths are 0 and 120 pixels; they must be above 0",
        ),
        (trained("fy", json!("120")), "[1]: fy is not a number"),
        (
            trained("position", json!([0, 0])),
            "[1]: position must be three numbers",
        ),
        (
            trained("position", json!([0, 0, 1e300])),
            "[1]: its position is",
        ),
        (
            trained("rotation", json!([[1, 0, 0], [0, 1, 0]])),
            "[1]: rotation must be three rows of three numbers",
        ),
        (
            trained("rotation", json!([[1, 0, 0], [0, 1, 0], [0, 0, -1]])),
            "[1]: rotation is not a rotation",
        ),
        (refused(&json!([])), "has no camera"),
        (refused(&json!([7])), "[0]: has no width"),
        (refused(&json!({"cameras": []})), "has no list `frames`"),
        (refused(&json!(7)), "has no list `frames`"),
    ] {
        assert!(told.contains(part), "{told}, not {part}");
    }
    let unit = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 5, 0, 0, 0, 1]);
    let video = |more: Value, camera: Value| {
        let mut all = json!({"render_width": 64, "render_height": 48, "camera_path": [{"camera_to_world": unit, "fov": 50}]});
        more.as_object()
            .unwrap()
            .iter()
            .for_each(|(name, value)| all[name] = value.clone());
        camera
            .as_object()
            .unwrap()
            .iter()
            .for_each(|(name, value)| all["camera_path"][0][name] = value.clone());
        refused(&all)
    };
    for (told, part) in [
        (
            video(json!({"camera_type": "equirectangular"}), json!({})),
            "camera_type is equirectangular; only perspective",
        ),
        (
            video(json!({"render_width": null}), json!({})),
            "has no render_width",
        ),
        (
            video(json!({}), json!({"fov": 180})),
            "camera_path[0]: fov is 180",
        ),
        (
            video(json!({}), json!({"fov": null})),
            "camera_path[0]: has no fov",
        ),
        (
            video(json!({}), json!({"camera_to_world": [1, 2, 3]})),
            "camera_path[0]: camera_to_world must be four rows",
        ),
    ] {
        assert!(told.contains(part), "{told}, not {part}");
    }
}

#[test]
fn broken_binary_cameras_end_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let lens = cameras_bin(1, 1, [64, 48], &[50.0, 50.0, 32.0, 24.0]);
    let image =
        |camera: u32| image_bin(1, [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 4.0], camera, "a.png", 2);
    let images =
        |count: u64, all: &[Vec<u8>]| [count.to_le_bytes().to_vec(), all.concat()].concat();
    let read = |lens: &[u8], images: &[u8]| {
        write_bytes(folder, "cameras.bin", lens);
        write_bytes(folder, "images.bin", images);
        CameraFile::read(folder)
    };
    assert!(read(&lens, &images(1, &[image(1)])).is_ok());
    let refused = |lens: &[u8], images: &[u8]| read(lens, images).unwrap_err().to_string();
    for (told, part) in [
        (
            refused(&lens, &images(1, &[image(2)])),
            "images.bin: image 0 of 1: its camera 2 is not in cameras.bin",
        ),
        (
            refused(&lens, &images(u64::MAX, &[image(1)])),
            "image 1 of 18446744073709551615: the file ends inside it",
        ),
        (
            refused(&lens, &images(1, &[image(1), vec![7]])),
            "its end: 1 bytes follow the last of 1 images",
        ),
        (refused(&lens, &images(0, &[])), "has no camera"),
        (
            refused(&lens, &[1, 2]),
            "images.bin: its header: the file ends inside it",
        ),
        (
            refused(&cameras_bin(1, 5, [64, 48], &[50.0; 8]), &[]),
            "cameras.bin: camera 0 of 1: the model OPENCV_FISHEYE cannot be drawn",
        ),
        (
            refused(&cameras_bin(1, 2, [64, 48], &[50.0, 32.0, 24.0, 0.1]), &[]),
            "a lens that distorts cannot be drawn (0.1)",
        ),
        (
            refused(&cameras_bin(1, 99, [64, 48], &[]), &[]),
            "its model has the number 99; 0 to 11 are known",
        ),
        (
            refused(&cameras_bin(1, 1, [1 << 40, 48], &[50.0; 4]), &[]),
            "its picture is 1099511627776×48",
        ),
        (
            refused(
                &cameras_bin(1, 1, [64, 48], &[50.0, f64::NAN, 32.0, 24.0]),
                &[],
            ),
            "it has a number that is NaN",
        ),
    ] {
        assert!(
            told.starts_with("--cameras ") && told.contains(part) && !told.contains('\n'),
            "{told}, not {part}"
        );
    }
    let whole = images(1, &[image(1)]);
    for length in 0..whole.len() {
        assert!(read(&lens, &whole[..length]).is_err(), "{length}");
    }
    for length in 0..lens.len() {
        assert!(read(&lens[..length], &whole).is_err(), "{length}");
    }
    std::fs::remove_file(folder.join("cameras.bin")).unwrap();
    assert!(
        CameraFile::read(&folder.join("images.bin"))
            .unwrap_err()
            .to_string()
            .contains("cameras.bin: cannot be read")
    );
    assert!(
        CameraFile::read(folder)
            .unwrap_err()
            .to_string()
            .contains("holds no cameras; a folder must hold one of transforms.json")
    );
}

/// Pictures of several sizes are drawn as frames of the most frequent size, each with the vertical
/// angle of its own picture.
#[test]
fn pictures_of_several_sizes_are_drawn_at_the_size_that_most_have() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write(
        folder,
        "c/cameras.txt",
        "1 PINHOLE 60 40 50 50 30 20\n2 PINHOLE 64 48 50 50 32 24\n3 PINHOLE 30 20 25 25 15 10\n",
    );
    let image =
        |nth: usize, camera: usize| format!("{nth} 1 0 0 0 0 0 {} {camera} {nth}.png\n", nth + 4);
    write(
        folder,
        "c/images.txt",
        &[image(0, 1), image(1, 2), image(2, 2), image(3, 3)].concat(),
    );
    let sequence = load(folder, "c").unwrap();
    assert_eq!(
        (sequence.scene().image.width, sequence.scene().image.height),
        (64, 48)
    );
    let tangents: Vec<f64> = sequence
        .cameras()
        .iter()
        .map(|camera| (camera.fov_y_degrees.to_radians() / 2.0).tan())
        .collect();
    for (tangent, expected) in
        tangents
            .iter()
            .zip([20.0 / 50.0, 24.0 / 50.0, 24.0 / 50.0, 10.0 / 25.0])
    {
        assert!((tangent - expected).abs() < 1e-12, "{tangents:?}");
    }
    let notes = &sequence.scene().notes;
    assert!(
        notes
            .iter()
            .any(|note| note
                .contains("2 of 4 pictures are not 64×48: all frames are drawn at one size")),
        "{notes:?}"
    );
    write(folder, "c/cameras.json", "[]");
    let notes = load(folder, "c").unwrap().scene().notes.join("; ");
    assert!(
        notes.contains("is read, not the cameras.json in the same folder"),
        "{notes}"
    );
}

/// u = f_x·X/Z + c_x, v = f_y·Y/Z + c_y, for the lenses of every program. For another picture size
/// both are scaled by the height, about the middle.
#[test]
fn two_focal_lengths_and_a_principal_point_are_those_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let still = json!([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]);
    let frames = json!([{"transform_matrix": still}]);
    write(
        folder,
        "n.json",
        &json!({"w": 64, "h": 48, "fl_x": 50, "fl_y": 61, "cx": 30, "cy": 27.5, "frames": frames})
            .to_string(),
    );
    write(folder, "c/cameras.txt", "1 PINHOLE 64 48 50 61 30 27.5\n");
    write(folder, "c/images.txt", "1 0 1 0 0 0 0 4 1 a.png\n\n");
    let trained = json!({"width": 64, "height": 48, "fx": 50, "fy": 61, "cx": 30, "cy": 27.5, "position": [0, 0, 4],
        "rotation": [[1, 0, 0], [0, -1, 0], [0, 0, -1]]});
    write(folder, "t.json", &json!([trained]).to_string());
    for file in ["n.json", "c", "t.json"] {
        for (scale, size) in [(1.0, None), (2.5, Some((200, 120)))] {
            let cameras = CameraFile::read(&folder.join(file)).unwrap();
            let scene = write(folder, "scene.json", &spheres(&json!({})));
            let sequence = Sequence::load(&scene, &Overrides { size }, Some(cameras)).unwrap();
            let (view, image) = (sequence.scene().view(), sequence.scene().image);
            let seen = view.rotation * (glam::DVec3::new(0.5, 0.25, 1.0) - view.eye);
            let [x, y] =
                [0, 1].map(|axis| view.centre_px[axis] + view.focal_px[axis] * seen[axis] / seen.z);
            let middle = [image.width as f64 / 2.0, image.height as f64 / 2.0];
            let right = middle[0] + scale * (30.0 - 32.0 + 50.0 * 0.5 / 3.0);
            let down = middle[1] + scale * (27.5 - 24.0 - 61.0 * 0.25 / 3.0);
            assert!(
                (x - right).abs() < 1e-9 && (y - down).abs() < 1e-9,
                "{file}: {x} {y}, not {right} {down}"
            );
        }
    }
}

/// The cameras of the other programs with square pixels and a centred axis are the same camera, at
/// (0, 0, −4).
#[test]
fn the_cameras_in_the_shared_folder_are_one_camera() {
    let Some(folder) = crate::shared_input::find("outside/09-cameras") else {
        return;
    };
    for file in ["square", "square/images.txt", "cameras.json"] {
        let sequence = Sequence::load(
            folder.join("scene.json"),
            &Overrides::default(),
            Some(CameraFile::read(&folder.join(file)).unwrap()),
        );
        let sequence = sequence.unwrap();
        let (view, image) = (sequence.scene().view(), sequence.scene().image);
        assert_eq!(
            (image.width, image.height, view.eye),
            (96, 72, glam::DVec3::new(0.0, 0.0, -4.0)),
            "{file}"
        );
        assert!(
            view.focal_px
                .iter()
                .all(|focal| (focal - 120.0).abs() < 1e-9)
                && (view.rotation.row(2) - glam::DVec3::Z).length() < 1e-12,
            "{file}"
        );
        assert!(
            (view.rotation.row(1) - glam::DVec3::Y).length() < 1e-12,
            "{file}"
        );
    }
}

// ---- bad input ----

#[test]
fn absurd_sequences_end_in_a_sentence_and_write_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let key = |at: usize, x: f64, z: f64| json!({"at": at, "eye": [x, 0, z], "target": [0, 0, 0]});
    let path = |keys: Value| json!({"camera_path": {"keys": keys, "interpolation": "linear"}});
    let mut many = String::from("[");
    (0..10_001).for_each(|_| many.write_str("{},").unwrap());
    let many: Value = serde_json::from_str(&(many.trim_end_matches(',').to_owned() + "]")).unwrap();
    let wide = |fov: f64, at: usize| json!({"at": at, "eye": [0, 0, 4], "target": [0, 0, 0], "fov_y_degrees": fov});
    for (more, part) in [
        (
            json!({"cameras": []}),
            "cameras has 0 entries; it must have at least 1",
        ),
        (
            json!({"cameras": many}),
            "cameras has 10001 entries; it must have at most 10000",
        ),
        (
            json!({"camera": {}, "cameras": [{}]}),
            "has camera and cameras; only one of",
        ),
        (
            json!({"cameras": [{}], "camera_path": {"pan_pixels": 1, "frames": 2}}),
            "has cameras and camera_path; only one of",
        ),
        (
            json!({"cameras": [{"eye": [1, 2, 3], "target": [1, 2, 3]}]}),
            "cameras[0].eye and cameras[0].target are the same point",
        ),
        (
            json!({"camera_path": {"pan_pixels": 1, "frames": 1_000_000_000}}),
            "camera_path.frames is 1000000000; it must be at least 1 and at most 10000",
        ),
        (
            json!({"camera_path": {"keys": [key(0, 1.0, 1.0)], "frames": 0}}),
            "camera_path.frames is 0",
        ),
        (path(json!([])), "camera_path.keys has 0 entries"),
        (
            path(json!([key(1_000_000_000, 1.0, 1.0)])),
            "camera_path.keys[0].at is 1000000000",
        ),
        (
            path(json!([key(3, 1.0, 1.0), key(3, 2.0, 1.0)])),
            "camera_path.keys[1].at is 3, which is not above the 3 before it",
        ),
        (
            path(json!([key(0, 1.0, 1.0), key(4, -1.0, -1.0)])),
            "camera_path at frame 2: eye and target are the same point",
        ),
        (
            json!({"camera_path": {"keys": [wide(1.0, 0), wide(179.0, 4), wide(179.0, 8)]}}),
            "fov_y_degrees is",
        ),
        (
            json!({"camera_path": {"frames": 3}}),
            "must have one of the fields",
        ),
        (
            json!({"camera_path": {"pan_pixels": 1, "frames": 3, "keys": []}}),
            "camera_path",
        ),
        (
            json!({"camera_path": {"pan_pixels": 1e30, "frames": 3}}),
            "camera_path.pan_pixels is 1e30",
        ),
    ] {
        let scene = write(folder, "scene.json", &spheres(&more));
        let out = folder.join("out");
        let told = sentence(&[
            "run",
            &scene,
            "--machine",
            "tiny",
            "--out",
            out.to_str().unwrap(),
        ]);
        assert!(
            told.contains(part) && told.len() < 400 && !out.exists(),
            "{told}, not {part}"
        );
    }
    for number in ["NaN", "1e999", "-1e31"] {
        let text =
            spheres(&path(json!([{"at": 0, "eye": ["HERE", 0, 1]}]))).replace("\"HERE\"", number);
        sentence(&["run", &write(folder, "scene.json", &text)]);
    }
    let scene = write(
        folder,
        "scene.json",
        &spheres(&json!({"cameras": [eye(0.0), eye(1.0)]})),
    );
    for flag in [
        &["--preview"][..],
        &["--attribute"],
        &["--ranges"],
        &["--record", "x"],
        &["--timing", "timing.raster.fifo=1,2"],
    ] {
        let told = sentence(&[&["run", &scene], flag].concat());
        assert!(
            told.contains(&format!("{}: scene.json is a sequence of 2", flag[0]))
                && told.contains("--frame N"),
            "{told}"
        );
    }
    let film = folder.join("a.y4m");
    assert!(
        sentence(&["run", "glass-spheres", "--y4m", film.to_str().unwrap()])
            .contains("one frame is not a video")
    );
    assert!(
        sentence(&["run", &scene, "--y4m", folder.to_str().unwrap()])
            .contains("is a folder, and a file is needed")
    );
    assert!(!film.exists() && !folder.join("x").exists());
}

/// A sequence of one frame is a sequence: it is drawn, without flicker.
#[test]
fn one_frame_has_no_flicker() {
    let folder = tempfile::tempdir().unwrap();
    let scene = write(
        folder.path(),
        "scene.json",
        &spheres(&json!({"cameras": [eye(0.0)]})),
    );
    let out = folder.path().join("out");
    let printed = says(&[
        "run",
        &scene,
        "--machine",
        "tiny",
        "--out",
        out.to_str().unwrap(),
    ]);
    assert!(
        report(&out)["flicker"].is_null() && report(&out)["frames"].as_array().unwrap().len() == 1
    );
    assert!(
        printed.contains("1 frame:") && !printed.contains("flicker"),
        "{printed}"
    );
}

/// An earlier version accepted this.
#[test]
fn a_video_is_written_over_no_other_file() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let path = write(
        folder,
        "scene.json",
        &spheres(&json!({"cameras": [eye(0.0), eye(0.5)]})),
    );
    let before = std::fs::read(&path).unwrap();
    let told = sentence(&["run", &path, "--machine", "tiny", "--y4m", &path]);
    assert!(told.contains("already exists and is not a video"), "{told}");
    assert_eq!(std::fs::read(&path).unwrap(), before);
    // A video may be overwritten by another video.
    let film = folder.join("film.y4m");
    for _ in 0..2 {
        says(&[
            "run",
            &path,
            "--machine",
            "tiny",
            "--quiet",
            "--y4m",
            film.to_str().unwrap(),
        ]);
    }
    assert!(std::fs::read(&film).unwrap().starts_with(b"YUV4MPEG2 "));
}

#[test]
fn a_sequence_may_have_a_budget_of_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let more =
        json!({"cameras": [eye(0.0), eye(0.5)], "level_of_detail": {"budget": {"bytes": 40_000}}});
    let path = write(folder, "scene.json", &spheres(&more));
    let (all, one) = (folder.join("all"), folder.join("one"));
    says(&[
        "run",
        &path,
        "--machine",
        "tiny",
        "--quiet",
        "--out",
        all.to_str().unwrap(),
    ]);
    says(&[
        "run",
        &path,
        "--machine",
        "tiny",
        "--quiet",
        "--frame",
        "1",
        "--out",
        one.to_str().unwrap(),
    ]);
    let [all, one] = [all.join("frame_0001_fixed.png"), one.join("fixed.png")]
        .map(|path| std::fs::read(path).unwrap());
    assert!(all == one);
    // Another machine draws other splats, so a replay on it would be of another frame.
    let told = sentence(&[
        "run",
        &path,
        "--machine",
        "tiny",
        "--frame",
        "0",
        "--what-if",
    ]);
    assert!(
        told.contains("--what-if: ") && told.contains("has a budget of bytes or cycles"),
        "{told}"
    );
}

#[test]
fn distorted_lenses_are_refused_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let still = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 5], [0, 0, 0, 1]];
    let read = |more: Value| {
        let mut all = json!({"camera_angle_x": 0.7, "w": 64, "h": 64, "frames": [{"transform_matrix": still}]});
        more.as_object()
            .unwrap()
            .iter()
            .for_each(|(name, value)| all[name] = value.clone());
        CameraFile::read(Path::new(&write(
            folder.path(),
            "transforms.json",
            &all.to_string(),
        )))
    };
    assert!(read(json!({"cx": 32, "cy": 32, "camera_angle_y": 0.7, "is_fisheye": false, "distortion_params": [0, 0.0]})).is_ok());
    for (more, says) in [
        (json!({"cx": "abc"}), "cx is not a number"),
        (json!({"is_fisheye": true}), "is_fisheye"),
        (json!({"distortion_params": [0.5, 0]}), "distortion_params"),
        (json!({"camera_model": 5}), "camera_model is not a text"),
    ] {
        let told = read(more.clone())
            .err()
            .map(|error| error.to_string())
            .unwrap_or_default();
        assert!(told.contains(says), "{more}: {told}");
    }
}

#[test]
fn pictures_of_colmap_come_in_the_order_of_their_names_whatever_parts_the_words() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("cameras.txt"),
        "1 PINHOLE 64 64 60 60 32 32\n",
    )
    .unwrap();
    let read = |images: &str| {
        std::fs::write(folder.path().join("images.txt"), images).unwrap();
        CameraFile::read(folder.path())
    };
    let cameras = read("1  1 0 0 0 0 0 5 1 b.png\n\n2 1 0 0 0 0 0 9  1   a b.png\n\n").unwrap();
    let path = write(folder.path(), "scene.json", &spheres(&json!({})));
    let sequence = Sequence::load(&path, &Overrides::default(), Some(cameras)).unwrap();
    assert_eq!(
        sequence
            .cameras()
            .iter()
            .map(|camera| camera.eye.z)
            .collect::<Vec<_>>(),
        [-9.0, -5.0]
    );
    assert!(read("1 1 0 0 0 0 0 5 1\n\n").is_err());
}

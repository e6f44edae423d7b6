//! Does `run --against` measure golden and fixed against given pictures, and does it compare each
//! frame with its own picture?

use crate::program::{says, splatsim, write};
use std::path::Path;

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageBuffer, ImageEncoder, Rgb, RgbImage, Rgba, RgbaImage};
use serde_json::{Value, json};

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn report(folder: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(folder.join("report.json")).unwrap()).unwrap()
}

/// A few hundred discs in a small picture.
fn spheres(more: &Value) -> String {
    let splats = json!({"builtin": "glass-spheres", "count": 400});
    let mut scene = json!({"splats": splats, "image": {"width": 24, "height": 20}, "lights": [{"direction": [0.4, 0.8, 0.5]}]});
    for (name, value) in more.as_object().unwrap() {
        scene[name] = value.clone();
    }
    scene.to_string()
}

/// The same with a camera that sees only the background.
fn plain(background: [f64; 4]) -> String {
    let camera = json!({"eye": [0, 0, 50], "target": [0, 0, 60], "up": [0, 1, 0], "fov_y_degrees": 40, "near": 0.1});
    spheres(
        &json!({"camera": camera, "image": {"width": 24, "height": 20, "background": background}}),
    )
}

fn decibels(square: f64) -> f64 {
    -10.0 * square.log10()
}

/// PSNR of two PNG files from their stored values, over black.
fn decibels_of_files(a: &Path, b: &Path) -> f64 {
    let codes = |path: &Path| {
        let pixels = image::open(path).unwrap().into_rgba8();
        let over = |pixel: &Rgba<u8>| {
            [0, 1, 2].map(|c| f64::from(pixel[c]) / 255.0 * f64::from(pixel[3]) / 255.0)
        };
        pixels.pixels().flat_map(over).collect::<Vec<f64>>()
    };
    let (a, b) = (codes(a), codes(b));
    decibels(
        a.iter()
            .zip(&b)
            .map(|(a, b)| (a - b) * (a - b))
            .sum::<f64>()
            / a.len() as f64,
    )
}

#[test]
fn golden_as_the_photograph_is_equal_and_fixed_is_as_far_as_the_files_are() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let bouquet = json!({"splats": {"gaussians": "bouquet", "count": 150}, "image": {"width": 24, "height": 20}}).to_string();
    let white = spheres(&json!({"image": {"width": 24, "height": 20, "background": [1, 1, 1, 1]}}));
    let narrow = "gauss.weight=U-2F5";
    for (scene, machine, word) in [
        (spheres(&json!({})), "tiny", narrow),
        (white, "tiny", narrow),
        (bouquet, "gaussian", "gauss.weight=U1F4"),
    ] {
        let scene = write(folder, "scene.json", &scene);
        let (first, second) = (folder.join("first"), folder.join("second"));
        // Words so narrow that pictures differ in 8 bits.
        let run = |more: &[&str]| {
            let narrow = ["run", &scene, "--machine", machine, "--set", word];
            says(&[&narrow[..], more].concat())
        };
        run(&["--out", text(&first)]);
        let golden = first.join("golden.png");
        let told = run(&["--out", text(&second), "--against", text(&golden)]);
        let report = report(&second);
        let against = &report["against"];
        assert_eq!(
            against["golden"],
            json!({"psnr_db": null, "ssim": 1.0, "flip": 0.0})
        );
        assert_eq!(
            (&against["picture"], &against["bits"]),
            (&json!("golden.png"), &json!(8))
        );
        let fixed = against["fixed"]["psnr_db"].as_f64().unwrap();
        let expected = decibels_of_files(&first.join("fixed.png"), &golden);
        assert!(
            (fixed - expected).abs() < 1e-9 && fixed < 70.0,
            "{fixed} and not {expected}"
        );
        let [ssim, flip] = ["ssim", "flip"].map(|name| against["fixed"][name].as_f64().unwrap());
        assert!(ssim < 1.0 && flip > 0.0, "{against}");
        let loss = &against["fixed_minus_golden"];
        assert_eq!(
            (&loss["psnr_db"], loss["flip"].as_f64()),
            (&Value::Null, Some(flip))
        );
        assert!((loss["ssim"].as_f64().unwrap() - (ssim - 1.0)).abs() < 1e-15);
        // Everything else is the same as without a photograph.
        let (mut with, mut without) = (report.clone(), self::report(&first));
        [&mut with, &mut without]
            .into_iter()
            .for_each(|report| _ = report.as_object_mut().unwrap().remove("host"));
        with.as_object_mut().unwrap().remove("against");
        let notes = with["scene"]["notes"].as_array_mut().unwrap();
        notes.retain(|note| !note.as_str().unwrap().starts_with("photographs: "));
        assert!(with == without, "{with}\n{without}");
        let shown = format!("{fixed:.3}");
        assert!(
            told.contains("against golden.png, code values of 8 bits:")
                && told.contains(&shown)
                && told.contains("equal"),
            "{told}"
        );
        assert!(
            told.lines().all(|line| line.chars().count() <= 80),
            "{told}"
        );
    }
}

/// Worked out by hand: a plain red picture, and photographs of one other colour.
#[test]
fn a_plain_photograph_is_as_far_as_a_pencil_finds() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scene = write(folder, "scene.json", &plain([1.0, 0.0, 0.0, 1.0]));
    let out = folder.join("out");
    let against = |name: &str| {
        let photograph = folder.join(name);
        let told = says(&[
            "run",
            &scene,
            "--check",
            "none",
            "--against",
            text(&photograph),
            "--out",
            text(&out),
        ]);
        (report(&out), told)
    };
    RgbImage::from_pixel(24, 20, Rgb([204, 0, 51]))
        .save(folder.join("a.png"))
        .unwrap();
    let (found, told) = against("a.png");
    let luminance = |p: f64, q: f64| (2.0 * p * q + 1e-4) / (p * p + q * q + 1e-4);
    for renderer in ["golden", "fixed"] {
        let of = &found["against"][renderer];
        let [db, ssim] = ["psnr_db", "ssim"].map(|name| of[name].as_f64().unwrap());
        assert!(
            (db - decibels((0.04 + 0.04) / 3.0)).abs() < 1e-9,
            "{renderer}: {db}"
        );
        let expected = (luminance(1.0, 0.8) + 1.0 + luminance(0.0, 0.2)) / 3.0;
        assert!(
            (ssim - expected).abs() < 1e-9,
            "{renderer}: {ssim} and not {expected}"
        );
    }
    assert_eq!(
        found["against"]["fixed_minus_golden"],
        json!({"psnr_db": 0.0, "ssim": 0.0, "flip": 0.0})
    );
    assert!(!told.contains("note: photographs"), "{told}");
    // 52428 is 0.8 of 65535, and 204.0 in 8 bits; 40000 is 155.6 in 8 bits.
    ImageBuffer::<Rgb<u16>, _>::from_pixel(24, 20, Rgb([40000_u16, 0, 0]))
        .save(folder.join("deep.png"))
        .unwrap();
    let (found, _) = against("deep.png");
    let off = 1.0 - 40000.0 / 65535.0;
    assert!(
        (found["against"]["golden"]["psnr_db"].as_f64().unwrap() - decibels(off * off / 3.0)).abs()
            < 1e-9
    );
    assert_eq!(found["against"]["bits"], 16);
    // A grey PNG and a JPEG: both are converted to colours.
    image::GrayImage::from_pixel(24, 20, image::Luma([51]))
        .save(folder.join("grey.png"))
        .unwrap();
    let (found, _) = against("grey.png");
    assert!(
        (found["against"]["golden"]["psnr_db"].as_f64().unwrap()
            - decibels((0.64 + 0.04 + 0.04) / 3.0))
        .abs()
            < 1e-9
    );
    let mut jpeg = Vec::new();
    let pixels = RgbImage::from_pixel(24, 20, Rgb([204, 0, 51]));
    JpegEncoder::new_with_quality(&mut jpeg, 100)
        .write_image(&pixels, 24, 20, ExtendedColorType::Rgb8)
        .unwrap();
    std::fs::write(folder.join("a.jpg"), jpeg).unwrap();
    let (found, _) = against("a.jpg");
    assert!(
        (found["against"]["golden"]["psnr_db"].as_f64().unwrap() - decibels((0.04 + 0.04) / 3.0))
            .abs()
            < 0.1
    );
}

#[test]
fn transparent_pixels_of_a_photograph_are_over_the_background_and_turned_ones_are_not_turned() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let out = folder.join("out");
    let photograph = folder.join("a.png");
    RgbaImage::from_pixel(24, 20, Rgba([255, 0, 0, 51]))
        .save(&photograph)
        .unwrap();
    // Over green, a fifth of red is (0.2, 0.8, 0); over black, which is used if the background is
    // transparent, (0.2, 0, 0).
    for (background, square, back) in [
        ([0.0, 1.0, 0.0, 1.0], 0.08, "0 255 0"),
        ([0.0, 0.0, 0.0, 0.0], 0.04, "0 0 0"),
    ] {
        let scene = write(folder, "scene.json", &plain(background));
        let told = says(&[
            "run",
            &scene,
            "--check",
            "none",
            "--against",
            text(&photograph),
            "--out",
            text(&out),
        ]);
        let db = report(&out)["against"]["golden"]["psnr_db"]
            .as_f64()
            .unwrap();
        assert!(
            (db - decibels(square / 3.0)).abs() < 1e-9,
            "{background:?}: {db}"
        );
        let told = told.replace("\n    ", " ");
        let note = format!(
            "note: photographs: transparent pixels are over the scene's background, {back} of 255, in a.png"
        );
        assert!(told.contains(&note), "{told}");
    }
    // Exif with one entry: orientation 3, upside down.
    let exif =
        [b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x03\0\0\0\0\0\0\0".as_slice()].concat();
    let mut jpeg = Vec::new();
    let mut encoder = JpegEncoder::new_with_quality(&mut jpeg, 100);
    encoder.set_exif_metadata(exif).unwrap();
    encoder
        .write_image(&RgbImage::new(24, 20), 24, 20, ExtendedColorType::Rgb8)
        .unwrap();
    std::fs::write(folder.join("turned.jpg"), jpeg).unwrap();
    let scene = write(folder, "scene.json", &plain([0.0, 0.0, 0.0, 1.0]));
    let told = says(&[
        "run",
        &scene,
        "--check",
        "none",
        "--against",
        text(&folder.join("turned.jpg")),
    ])
    .replace("\n    ", " ");
    assert!(
        told.contains("note: photographs: compared as stored, although their Exif data specify a rotation: turned.jpg (3)"),
        "{told}"
    );
}

// ---- sequences ----

/// A camera at `at`, in the formats of three programs.
fn matrix(x: f64) -> Value {
    json!([[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 5], [0, 0, 0, 1]])
}

/// Draws all frames, and copies golden's picture of each to `name`.
fn golden_of(scene: &str, more: &[&str], names: &[&str], folder: &Path) {
    let drawn = folder.parent().unwrap().join("drawn");
    says(
        &[
            &[
                "run",
                scene,
                "--machine",
                "tiny",
                "--quiet",
                "--out",
                text(&drawn),
            ],
            more,
        ]
        .concat(),
    );
    for (frame, name) in names.iter().enumerate() {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::copy(drawn.join(format!("frame_{frame:04}_golden.png")), path).unwrap();
    }
}

fn of_frames<'r>(report: &'r Value, pointer: &str) -> Vec<&'r Value> {
    report["frames"]
        .as_array()
        .unwrap()
        .iter()
        .map(|frame| frame.pointer(pointer).unwrap())
        .collect()
}

/// Names in another order than their letters, with folders, endings and spaces as programs write
/// them: each frame must equal its own picture.
#[test]
fn pictures_are_matched_by_the_names_in_a_file_of_cameras() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scene = write(folder, "scene.json", &spheres(&json!({})));
    let places = [0.0, 0.7, -0.9];
    let transforms = |names: [&str; 3]| {
        let frames: Vec<Value> = names
            .iter()
            .zip(places)
            .map(|(name, x)| json!({"file_path": name, "transform_matrix": matrix(x)}))
            .collect();
        json!({"w": 24, "h": 20, "fl_x": 26, "frames": frames}).to_string()
    };
    let blender = write(
        folder,
        "blender/transforms.json",
        &transforms(["./train/r_2", "./train/r_10", "./train/r_1"]),
    );
    let deep = write(
        folder,
        "deep/transforms.json",
        &transforms(["../images/b.tif", "images/sub/a.PNG", "images/sub/c.d.jpg"]),
    );
    let trained: Vec<Value> = ["DSC.2", "DSC.10", "DSC.1"]
        .iter()
        .zip(places)
        .map(|(name, x)| {
            let rotation = [[1, 0, 0], [0, -1, 0], [0, 0, -1]];
            json!({"img_name": name, "width": 24, "height": 20, "fx": 26, "fy": 26, "position": [x, 0.0, 5.0], "rotation": rotation})
        })
        .collect();
    let trained = write(folder, "cameras.json", &Value::from(trained).to_string());
    let mut images = String::new();
    // COLMAP's frames are in the order of their names.
    for (x, name) in places
        .iter()
        .zip(["cam 0/b.png", "cam 0/c.png", "cam1/b.png"])
    {
        images += &format!("1 0 1 0 0 {} 0 5 1 {name}\n\n", -x);
    }
    write(
        folder,
        "colmap/cameras.txt",
        "1 PINHOLE 24 20 26 26 12 10\n",
    );
    write(folder, "colmap/images.txt", &images);
    let colmap = text(&folder.join("colmap")).to_owned();
    let cases = [
        (blender.as_str(), ["r_2.png", "r_10.PNG", "r_1.png"]),
        (
            blender.as_str(),
            ["train/r_2.png", "train/r_10.png", "train/r_1.png"],
        ),
        (deep.as_str(), ["b.png", "sub/a.PNG", "images/sub/c.d.png"]),
        (trained.as_str(), ["DSC.2.png", "DSC.10.png", "DSC.1.png"]),
        (colmap.as_str(), ["cam 0/b.png", "c.png", "cam1/b.png"]),
    ];
    for (nth, (cameras, names)) in cases.into_iter().enumerate() {
        let photographs = folder.join(format!("photographs{nth}"));
        golden_of(&scene, &["--cameras", cameras], &names, &photographs);
        std::fs::write(photographs.join("notes.txt"), "no picture").unwrap();
        std::fs::write(photographs.join("._r_2.png"), "hidden").unwrap();
        let out = folder.join("out");
        let run = |more: &[&str]| {
            let all = [
                "run",
                &scene,
                "--machine",
                "tiny",
                "--cameras",
                cameras,
                "--against",
                text(&photographs),
                "--out",
                text(&out),
            ];
            says(&[&all[..], more].concat())
        };
        let told = run(&[]);
        let report = report(&out);
        assert!(
            of_frames(&report, "/against/golden/psnr_db")
                .iter()
                .all(|db| db.is_null()),
            "{cameras} {names:?}: {told}"
        );
        assert!(
            of_frames(&report, "/against/fixed/psnr_db")
                .iter()
                .all(|db| db.is_number()),
            "{told}"
        );
        let pictures: Vec<&str> = names
            .iter()
            .map(|name| name.rsplit('/').next().unwrap())
            .collect();
        assert_eq!(of_frames(&report, "/against/picture"), pictures);
        assert!(
            told.contains("note: photographs: matched by the names in the file of cameras\n")
                && !told.contains("no camera"),
            "{told}"
        );
        // A single frame is compared with the same picture, and needs no other.
        std::fs::remove_file(photographs.join(names[0])).unwrap();
        let told = run(&["--frame", "1"]);
        let one = self::report(&out);
        assert_eq!(one["against"], report["frames"][1]["against"], "{told}");
    }
}

/// Eleven frames of a pan: in alphabetical order r_10 would be before r_2.
#[test]
fn pictures_are_matched_in_order_where_cameras_have_no_names() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let camera = json!({"eye": [0, 1.2, 4.5], "target": [0, -0.2, 0], "up": [0, 1, 0], "fov_y_degrees": 45, "near": 0.05});
    let scene =
        spheres(&json!({"camera_path": {"pan_pixels": 1.5, "frames": 11, "camera": camera}}));
    let scene = write(folder, "scene.json", &scene);
    let names: Vec<String> = (0..11).map(|frame| format!("r_{frame}.png")).collect();
    let photographs = folder.join("photographs");
    golden_of(
        &scene,
        &[],
        &names.iter().map(String::as_str).collect::<Vec<_>>(),
        &photographs,
    );
    std::fs::copy(photographs.join("r_0.png"), photographs.join("z.png")).unwrap();
    let (one, four) = (folder.join("one"), folder.join("four"));
    let run = |out: &Path, threads: &str| {
        let all = [
            "run",
            &scene,
            "--machine",
            "tiny",
            "--against",
            text(&photographs),
            "--out",
            text(out),
            "--threads",
            threads,
        ];
        says(&all).replace("\n    ", " ")
    };
    let told = run(&one, "1");
    let found = report(&one);
    assert!(
        of_frames(&found, "/against/golden/psnr_db")
            .iter()
            .all(|db| db.is_null()),
        "{told}"
    );
    assert_eq!(
        found["against"]["golden"],
        json!({"psnr_db": null, "ssim": 1.0, "flip": 0.0})
    );
    let order = "note: photographs: matched in order of their names, for the cameras have no names: frame 0 is r_0.png, frame 10 is r_10.png";
    assert!(
        told.contains(order)
            && told.contains("note: photographs: one picture has no camera: z.png"),
        "{told}"
    );
    assert!(
        told.contains("infinite") && told.contains("\n10 "),
        "{told}"
    );
    run(&four, "4");
    let mut both = [&one, &four].map(|out| report(out));
    both.iter_mut()
        .for_each(|report| _ = report.as_object_mut().unwrap().remove("host"));
    assert_eq!(both[0], both[1]);
    // The pictures of ideal differ from golden: means are those of the frames' figures.
    for (frame, name) in names.iter().enumerate() {
        let ideal = folder.join(format!("drawn/frame_{frame:04}_ideal.png"));
        std::fs::copy(ideal, photographs.join(name)).unwrap();
    }
    let told = run(&one, "2");
    let found = report(&one);
    for renderer in ["golden", "fixed", "fixed_minus_golden"] {
        for figure in ["psnr_db", "ssim", "flip"] {
            let all = of_frames(&found, &format!("/against/{renderer}/{figure}"));
            let mean = all.iter().map(|value| value.as_f64().unwrap()).sum::<f64>() / 11.0;
            let mean_told = found["against"][renderer][figure].as_f64().unwrap();
            assert!(
                (mean - mean_told).abs() < 1e-12,
                "{renderer} {figure}: {mean_told} and not {mean}"
            );
        }
    }
    for (frame, row) in found["frames"].as_array().unwrap().iter().enumerate() {
        let golden = folder.join(format!("drawn/frame_{frame:04}_golden.png"));
        let expected = decibels_of_files(&golden, &photographs.join(&names[frame]));
        assert!(
            (row["against"]["golden"]["psnr_db"].as_f64().unwrap() - expected).abs() < 1e-9,
            "{frame}"
        );
    }
    let mean = format!(
        "{:.3}",
        found["against"]["golden"]["psnr_db"].as_f64().unwrap()
    );
    assert!(
        told.contains("against photographs, code values, mean of 11 frames:")
            && told.contains(&mean),
        "{told}"
    );
}

// ---- bad input ----

/// The single sentence of the error, before anything is drawn or written.
fn refused(folder: &Path, arguments: &[&str], part: &str) {
    let out = folder.join("never");
    let output = splatsim(&[&["run"], arguments, &["--out", text(&out)]].concat());
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
    assert!(
        told.contains(part) && told.contains("--against"),
        "{told}\nand not: {part}"
    );
    assert!(!out.exists(), "{arguments:?} wrote something");
}

#[test]
fn a_photograph_that_cannot_be_compared_is_refused_before_anything_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scene = write(folder, "scene.json", &spheres(&json!({})));
    let sound = folder.join("sound.png");
    RgbImage::new(24, 20).save(&sound).unwrap();
    RgbImage::new(25, 20).save(folder.join("wide.png")).unwrap();
    RgbImage::new(48, 40)
        .save(folder.join("double.png"))
        .unwrap();
    write(folder, "text.png", "a text");
    write(folder, "empty.png", "");
    let png = std::fs::read(&sound).unwrap();
    std::fs::write(folder.join("cut.png"), &png[..png.len() / 2]).unwrap();
    let noise = RgbImage::from_fn(24, 20, |x, y| {
        Rgb([(x * 37 + y * 91) as u8, (x * y) as u8, (x * 5) as u8])
    });
    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, 90)
        .write_image(&noise, 24, 20, ExtendedColorType::Rgb8)
        .unwrap();
    std::fs::write(folder.join("cut.jpg"), &jpeg[..jpeg.len() - 40]).unwrap();
    // A size that no memory can hold.
    let mut huge = png.clone();
    huge[16..24].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff]);
    std::fs::write(folder.join("huge.png"), huge).unwrap();
    std::fs::create_dir(folder.join("bare")).unwrap();
    write(folder, "bare/notes.txt", "no picture");
    std::fs::create_dir(folder.join("bare/folder.png")).unwrap();
    for name in ["a.png", "b.png"] {
        std::fs::create_dir_all(folder.join("two")).unwrap();
        std::fs::copy(&sound, folder.join("two").join(name)).unwrap();
    }
    for (name, part) in [
        ("none.png", "none.png: cannot be read: No such file"),
        ("text.png", "text.png: is not a PNG or JPEG picture"),
        ("empty.png", "empty.png: is not a PNG or JPEG picture"),
        ("cut.png", "cut.png: cannot be decoded"),
        (
            "cut.jpg",
            "cut.jpg: cannot be decoded: the file ends before the picture does",
        ),
        ("huge.png", "huge.png: "),
        (
            "wide.png",
            "wide.png: has 25×20 pixels, and the scene is drawn with 24×20: pictures of one size are compared; --size 25x20",
        ),
        (
            "double.png",
            "has 48×40 pixels, and the scene is drawn with 24×20",
        ),
        (
            "bare",
            "bare: holds no picture; one per frame is needed, with the ending png, jpg or jpeg",
        ),
        (
            "two",
            "two: holds 2 pictures, and scene.json has one camera: name the picture",
        ),
    ] {
        refused(
            folder,
            &[&scene, "--against", text(&folder.join(name))],
            part,
        );
    }
    let preview = splatsim(&["run", &scene, "--preview", "--against", text(&sound)]);
    assert_eq!(preview.status.code(), Some(2));
}

#[test]
fn photographs_that_do_not_match_the_frames_are_refused_before_anything_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let eye = |x: f64| json!({"eye": [x, 1.2, 4.5], "target": [0.0, -0.2, 0.0]});
    let scene = write(
        folder,
        "scene.json",
        &spheres(&json!({"cameras": [eye(0.0), eye(0.5), eye(1.0)]})),
    );
    let one = write(folder, "one.json", &spheres(&json!({})));
    let sound = folder.join("sound.png");
    RgbImage::new(24, 20).save(&sound).unwrap();
    let put = |names: &[&str]| {
        for name in names {
            let path = folder.join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::copy(&sound, path).unwrap();
        }
    };
    put(&[
        "two/a.png",
        "two/b.png",
        "sizes/a.png",
        "sizes/b.png",
        "broken/a.png",
        "broken/b.png",
    ]);
    RgbImage::new(20, 24)
        .save(folder.join("sizes/c.png"))
        .unwrap();
    write(folder, "broken/c.png", "a text");
    let transforms = |name: &str, pictures: &[&str]| {
        let frame = |picture: &&str| json!({"file_path": picture, "transform_matrix": matrix(0.0)});
        let frames: Vec<Value> = pictures.iter().map(frame).collect();
        write(
            folder,
            name,
            &json!({"w": 24, "h": 20, "fl_x": 26, "frames": frames}).to_string(),
        )
    };
    let named = transforms("named.json", &["images/a.png", "images/x.jpg", "y"]);
    let repeated = transforms("repeated.json", &["cam0/a.png", "cam1/a.png"]);
    put(&["twice/a.png", "twice/b.jpg", "twice/b.jpeg"]);
    let ambiguous = transforms("ambiguous.json", &["a.png", "b"]);
    let at = |name: &str| text(&folder.join(name)).to_owned();
    for (arguments, part) in [
        (
            vec![&*scene, "--against", &at("two")],
            "two: holds 2 pictures, and scene.json has 3 frames: one per frame is needed",
        ),
        (
            vec![&*scene, "--against", &at("sound.png")],
            "is one picture, and scene.json has 3 frames: give a folder of pictures, or choose a frame",
        ),
        (
            vec![&*scene, "--against", &at("sizes")],
            "c.png: has 20×24 pixels, and frame 2 is drawn with 24×20",
        ),
        (
            vec![&*scene, "--against", &at("broken")],
            "c.png: is not a PNG or JPEG picture",
        ),
        (
            vec![&*one, "--cameras", &named, "--against", &at("two")],
            "two: holds no picture of frame 1, which the file of cameras names images/x.jpg: x.png, x.jpg or x.jpeg is needed; 2 of 3 frames \
             have none",
        ),
        (
            vec![&*one, "--cameras", &repeated, "--against", &at("two")],
            "frames 0 (cam0/a.png) and 1 (cam1/a.png) both lead to",
        ),
        (
            vec![&*one, "--cameras", &ambiguous, "--against", &at("twice")],
            "b.jpeg and b.jpg may both be the picture",
        ),
    ] {
        refused(folder, &arguments, part);
    }
    // Pictures that the run itself would replace.
    let own = at("own");
    let cameras = spheres(&json!({"cameras": [eye(0.0)]}));
    put(&["own/a.png"]);
    let output = splatsim(&[
        "run",
        &write(folder, "cameras.json", &cameras),
        "--against",
        &own,
        "--out",
        &own,
    ]);
    let told = String::from_utf8(output.stderr).unwrap();
    assert!(
        output.status.code() == Some(2) && told.contains("own: is the folder of --out too"),
        "{told}"
    );
    assert_eq!(std::fs::read_dir(&own).unwrap().count(), 1);
    // A single frame needs only its own picture; a name that differs from the camera's is reported.
    let told = says(&[
        "run",
        &one,
        "--cameras",
        &named,
        "--frame",
        "2",
        "--check",
        "none",
        "--against",
        &at("sound.png"),
    ]);
    assert!(
        told.replace("\n    ", " ")
            .contains("note: photographs: sound.png is compared; the camera's own is y"),
        "{told}"
    );
}

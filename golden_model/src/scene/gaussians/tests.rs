use super::*;
use crate::scene::formats;
use crate::scene::formats::{Reader, Splats};
use crate::shared_input;
use flate2::Compression;
use flate2::write::GzEncoder;
use proptest::prelude::*;
use std::io::Write;
use std::path::Path;

fn is_gaussians(path: &Path) -> bool {
    if is_ply(path) {
        return std::fs::read(path).is_ok_and(|bytes| is_trained_ply(&bytes));
    }
    matches!(formats::reader(path), Some(Reader::Splats(_)))
}

fn is_ply(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("ply"))
}

fn read(path: &Path) -> Parsed<Gaussians> {
    let bytes = std::fs::read(path).map_err(|e| format!("cannot be read: {e}"))?;
    match formats::reader(path) {
        Some(Reader::Splats(parse)) if !is_ply(path) => match parse(&bytes, Path::new(""))? {
            Splats::Gaussians(gaussians) => Ok(gaussians),
            Splats::Points(_) | Splats::Tree(_) => Err("holds points".into()),
        },
        _ => parse_ply(&bytes),
    }
}

/// Reads a file with this extension and these bytes.
fn read_as(extension: &str, bytes: &[u8]) -> Parsed<Gaussians> {
    let file = tempfile::Builder::new()
        .suffix(extension)
        .tempfile()
        .unwrap();
    std::fs::write(file.path(), bytes).unwrap();
    read(file.path())
}

fn refused(extension: &str, bytes: impl AsRef<[u8]>) -> String {
    let sentence = read_as(extension, bytes.as_ref()).expect_err("must be refused");
    assert!(
        !sentence.contains('\n') && sentence.len() < 300,
        "{sentence}"
    );
    sentence
}

#[track_caller]
fn near(a: DVec3, b: DVec3, most: f64) {
    assert!((a - b).abs().max_element() <= most, "{a} is not {b}");
}

/// q and −q are the same rotation.
#[track_caller]
fn same_rotation(a: DQuat, b: DQuat, most: f64) {
    let angle = 2.0 * a.dot(b).abs().min(1.0).acos();
    assert!(angle <= most, "{a} and {b} are {angle} apart");
}

#[track_caller]
fn same_harmonics(a: &[[f32; 3]], b: &[[f32; 3]], most: f32) {
    assert_eq!(a.len(), b.len());
    a.as_flattened()
        .iter()
        .zip(b.as_flattened())
        .for_each(|(a, b)| assert!((a - b).abs() <= most, "{a} is not {b}"));
}

// ---- files that programs wrote ----

/// Coefficients of a Gaussian after half a turn about x: each harmonic keeps or changes its sign.
fn turned(all: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let direction = DVec3::new(0.3, 0.5, 0.8).normalize();
    let orders = (0..=3).flat_map(|l| (-l..=l).map(move |m| (l, m)));
    let sign = |l, m| {
        (harmonic(l, m, DVec3::new(1.0, -1.0, -1.0) * direction) / harmonic(l, m, direction)) as f32
    };
    all.iter()
        .zip(orders)
        .map(|(rgb, (l, m))| rgb.map(|c| c * sign(l, m)))
        .collect()
}

/// Axes are right, down, forward in files of training programs; right, up, back in `.spz`, which is
/// rotated.
#[test]
fn three_formats_of_the_same_three_gaussians_agree() {
    let Some(folder) = shared_input::find("splats3d") else {
        return;
    };
    let [ply, splat, spz] = ["ply", "splat", "spz"]
        .map(|kind| read(&folder.join("train_3points").with_extension(kind)).unwrap());
    assert_eq!(
        [&ply, &splat, &spz].map(|g| (g.all.len(), g.degree, g.notes.len())),
        [(3, 3, 0), (3, 0, 0), (3, 3, 0)]
    );
    for i in 0..3 {
        let (exact, bytes, fixed) = (ply.all[i], splat.all[i], spz.all[i]);
        near(bytes.position, exact.position, 1e-6);
        near(fixed.position, exact.position, 0.5 / 4096.0 + 1e-6);
        near(bytes.scale / exact.scale, DVec3::ONE, 1e-5);
        near(
            fixed.scale.map(f64::ln),
            exact.scale.map(f64::ln),
            0.5 / 16.0 + 1e-6,
        );
        same_rotation(bytes.rotation, exact.rotation, 0.03);
        same_rotation(fixed.rotation, exact.rotation, 0.01);
        assert!(
            (bytes.opacity - exact.opacity).abs() <= 1.0 / 255.0
                && (fixed.opacity - exact.opacity).abs() <= 1.0 / 255.0
        );
        // A viewer's files have only displayable colours.
        let shown = |g: &Gaussians| colour(&g.harmonics(i)[..1], DVec3::Z).map(|c| c.min(1.0));
        (0..3).for_each(|c| assert!((shown(&splat)[c] - shown(&ply)[c]).abs() <= 1.0 / 255.0));
        same_harmonics(
            &spz.harmonics(i)[..1],
            &ply.harmonics(i)[..1],
            1.0 / 255.0 / 0.15,
        );
        // Niantic's writer rounds to 8 bits, then to 5 bits for degree 1 and 4 bits for the others.
        same_harmonics(
            &spz.harmonics(i)[1..4],
            &ply.harmonics(i)[1..4],
            4.5 / 128.0,
        );
        same_harmonics(&spz.harmonics(i)[4..], &ply.harmonics(i)[4..], 8.5 / 128.0);
    }
}

#[test]
fn a_packed_file_equals_the_expanded_one() {
    let Some(folder) = shared_input::find("splats3d") else {
        return;
    };
    let [packed, expanded] = ["guitar.compressed.ply", "guitar_expanded.ply"]
        .map(|name| read(&folder.join(name)).unwrap());
    assert_eq!(
        (packed.all.len(), packed.degree, packed.notes.len()),
        (90854, 0, 0)
    );
    assert_eq!(
        (expanded.all.len(), expanded.degree, expanded.notes.len()),
        (90854, 0, 0)
    );
    for (i, (a, b)) in packed.all.iter().zip(&expanded.all).enumerate() {
        near(a.position, b.position, 1e-6);
        near(a.scale / b.scale, DVec3::ONE, 1e-5);
        same_rotation(a.rotation, b.rotation, 1e-3);
        assert!((a.opacity - b.opacity).abs() < 1e-6);
        same_harmonics(packed.harmonics(i), expanded.harmonics(i), 1e-5);
    }
}

#[test]
fn gaussians_are_distinguished_from_points_by_extension_and_header() {
    let Some(data) = shared_input::find("") else {
        return;
    };
    let cases = [
        ("splats3d/train_3points.ply", true),
        ("splats3d/train_3points.splat", true),
        ("splats3d/train_3points.spz", true),
        ("splats3d/guitar.compressed.ply", true),
        ("malformed/ply/assimp__gaussian_dc_only.ply", true),
        ("malformed/ply/metalsplatter__beetle.ascii.ply", false),
        ("malformed/ply/assimp_invalid__empty.ply", false),
        ("README.md", false),
        ("gone.ply", false),
    ];
    for (file, expected) in cases {
        assert_eq!(is_gaussians(&data.join(file)), expected, "{file}");
    }
}

#[test]
fn text_files_of_other_projects_are_read_or_refused() {
    let Some(folder) = shared_input::find("malformed/ply") else {
        return;
    };
    let read_file = |name| read(&folder.join(name));
    let dc_only = read_file("assimp__gaussian_dc_only.ply").unwrap();
    assert_eq!((dc_only.all.len(), dc_only.degree), (2, 0));
    assert_eq!(dc_only.harmonics(1), [[0.0, 1.0, 0.0]]);
    near(
        dc_only.all[1].scale,
        DVec3::new(0.1f64, 0.2, 0.3).map(f64::exp),
        1e-7,
    );
    assert_eq!(
        dc_only.all[0],
        Gaussian {
            position: DVec3::ZERO,
            rotation: DQuat::IDENTITY,
            scale: DVec3::ONE,
            opacity: 0.5
        }
    );
    assert_eq!(
        read_file("assimp__gaussian_with_rest.ply").unwrap_err(),
        "has 2 numbers `f_rest_*`; spherical harmonics of degree 0, 1, 2 and 3 have 0, 9, 24 and 45"
    );
    assert_eq!(
        read_file("metalsplatter__beetle.ascii.ply").unwrap_err(),
        "element `vertex` has no number `rot_1`; a trained Gaussian needs x y z, f_dc_0 to 2, opacity, scale_0 to 2 and rot_0 to 3, of which 2D Gaussians lack scale_2"
    );
    for entry in std::fs::read_dir(&folder).unwrap() {
        let _ = read(&entry.unwrap().path());
    }
}

// ---- float PLY ----

/// A file of these columns, each with its value for every Gaussian.
fn float_ply(format: &str, columns: &[(String, Vec<f32>)]) -> Vec<u8> {
    let count = columns[0].1.len();
    let properties: String = columns
        .iter()
        .map(|(name, _)| format!("property float {name}\n"))
        .collect();
    let mut file =
        format!("ply\nformat {format} 1.0\nelement camera 1\nproperty list uchar int f\nelement vertex {count}\n{properties}end_header\n")
            .into_bytes();
    file.extend(if format == "ascii" {
        b"0\n".as_slice()
    } else {
        &[0]
    });
    for i in 0..count {
        for (_, values) in columns {
            match format {
                "ascii" => write!(file, "{} ", values[i]).unwrap(),
                "binary_little_endian" => file.extend(values[i].to_le_bytes()),
                _ => file.extend(values[i].to_be_bytes()),
            }
        }
        if format == "ascii" {
            file.push(b'\n');
        }
    }
    file
}

/// Columns of three Gaussians of a degree; the value of each harmonic encodes its channel and
/// index.
fn columns(degree: usize) -> Vec<(String, Vec<f32>)> {
    let column = |name: &str, values: [f32; 3]| (name.to_owned(), values.to_vec());
    let mut columns = vec![
        column("opacity", [0.0, f32::INFINITY, f32::NEG_INFINITY]),
        column("rot_3", [0.0, 1.0, 0.0]),
        column("rot_0", [2.0, 1.0, 0.0]),
        column("rot_1", [0.0, 1.0, 0.0]),
        column("rot_2", [0.0, 1.0, -1e-30]),
        column("z", [3.0, 0.0, 0.0]),
        column("x", [1.0, 0.0, 0.0]),
        column("y", [2.0, 0.0, 0.0]),
        column("scale_1", [1.0, 0.0, 0.0]),
        column("scale_0", [0.0, 0.0, f32::NEG_INFINITY]),
        column("scale_2", [2.0, 0.0, 0.0]),
    ];
    columns.extend((0..3).map(|c| column(&format!("f_dc_{c}"), [100.0 * c as f32; 3])));
    let n = coefficients(degree) - 1;
    columns.extend((0..3 * n).map(|i| {
        column(
            &format!("f_rest_{i}"),
            [(100 * (i / n) + i % n + 1) as f32; 3],
        )
    }));
    columns
}

#[test]
fn parameters_are_found_by_name_in_every_encoding_and_activated() {
    for (format, degree) in [
        ("ascii", 0),
        ("ascii", 3),
        ("binary_little_endian", 1),
        ("binary_big_endian", 2),
        ("binary_little_endian", 3),
    ] {
        let read = read_as(".PLY", &float_ply(format, &columns(degree))).unwrap();
        assert_eq!(
            (read.all.len(), read.degree, read.notes.len()),
            (3, degree, 0)
        );
        let [a, b, c] = read.all.as_slice() else {
            panic!()
        };
        assert_eq!(a.position, DVec3::new(1.0, 2.0, 3.0));
        near(
            a.scale,
            DVec3::new(1.0, std::f64::consts::E, 7.38905609893065),
            1e-14,
        );
        assert_eq!(a.rotation, DQuat::IDENTITY);
        assert_eq!([a, b, c].map(|g| g.opacity), [0.5, 1.0, 0.0]);
        // A third of a turn about (1, 1, 1) maps x to y.
        near(b.rotation * DVec3::X, DVec3::Y, 1e-15);
        assert_eq!(c.rotation, DQuat::from_xyzw(0.0, -1.0, 0.0, 0.0));
        assert_eq!(c.scale, DVec3::new(SMALLEST_SCALE, 1.0, 1.0));
        for i in 0..3 {
            let expected: Vec<[f32; 3]> = (0..coefficients(degree))
                .map(|k| [k, 100 + k, 200 + k].map(|v| v as f32))
                .collect();
            assert_eq!(read.harmonics(i), expected);
        }
    }
}

#[test]
fn gaussians_that_cannot_be_drawn_are_left_out_and_counted_by_reason() {
    let flawed = [
        ("y", f32::NAN),
        ("scale_1", 100.0),
        ("scale_2", f32::NAN),
        ("opacity", f32::NAN),
        ("f_rest_8", f32::INFINITY),
        ("rot_2", f32::NAN),
    ];
    let mut table = columns(1);
    table
        .iter_mut()
        .for_each(|(_, values)| values.resize(flawed.len() + 1, values[0]));
    for (i, (name, value)) in flawed.into_iter().enumerate() {
        table.iter_mut().find(|(own, _)| own == name).unwrap().1[i] = value;
    }
    // Only the last is complete: its harmonics must not be those of an omitted one.
    table
        .iter_mut()
        .filter(|(name, _)| name == "f_dc_0")
        .for_each(|(_, values)| values[flawed.len()] = 7.0);
    let read = read_as(".ply", &float_ply("binary_little_endian", &table)).unwrap();
    assert_eq!(
        (read.all.len(), read.harmonics(0)[0]),
        (1, [7.0, 100.0, 200.0])
    );
    assert_eq!(
        read.notes,
        [
            "1 of 7 Gaussians have no finite position and were left out",
            "1 of 7 Gaussians have a rotation that is zero or not finite and were left out",
            "2 of 7 Gaussians have a scale that is negative or not finite and were left out",
            "1 of 7 Gaussians have an opacity that is NaN and were left out",
            "1 of 7 Gaussians have a colour that is not finite and were left out",
        ]
    );
    table
        .iter_mut()
        .filter(|(name, _)| name.starts_with("rot_"))
        .for_each(|(_, values)| values.fill(0.0));
    let all_flawed = refused(".ply", float_ply("ascii", &table));
    assert!(
        all_flawed.starts_with("holds no Gaussian that can be drawn: 1 of 7 Gaussians have no finite position and were left out; 6 of 7 ")
    );
}

#[test]
fn headers_that_lie_are_refused_at_once() {
    let file = String::from_utf8(float_ply("ascii", &columns(0))).unwrap();
    for count in ["4000000000", "18446744073709551615"] {
        let sentence = refused(".ply", file.replace("vertex 3", &format!("vertex {count}")));
        assert!(
            sentence.starts_with(&format!("vertex 3 of {count} "))
                && sentence.ends_with("the header promises more"),
            "{sentence}"
        );
    }
    assert!(
        refused(
            ".ply",
            file.replace(
                "element camera",
                "element nothing 18446744073709551615\nelement camera"
            )
            .replace("vertex 3", "vertex 0")
        )
        .contains("holds no Gaussians")
    );
    assert_eq!(
        refused(".ply", "ply\nformat ascii 1.0\nend_header\n"),
        "has no element `vertex`, so there are no Gaussians in it"
    );
    assert!(
        refused(".ply", file.replace("property float scale_1\n", ""))
            .starts_with("element `vertex` has no number `scale_1`; ")
    );
    assert!(
        refused(
            ".ply",
            file.replace("property float rot_0\n", "property list uchar int rot_0\n")
        )
        .starts_with("element `vertex` has no number `rot_0`; ")
    );
    let other = tempfile::Builder::new().suffix(".obj").tempfile().unwrap();
    let sentence = crate::scene::Scene::load(other.path(), &crate::scene::Overrides::default())
        .unwrap_err()
        .to_string();
    assert!(
        sentence
            .contains("is an OBJ file, which is a mesh; `splatsim sample` makes points from it")
            && sentence.contains("Gaussians (.ply, .splat, .spz, .gltf, .glb)"),
        "{sentence}"
    );
    assert!(
        read(Path::new("/nowhere/gone.ply"))
            .unwrap_err()
            .starts_with("cannot be read: ")
    );
}

// ---- packed PLY ----

/// A packed file of `count` equal Gaussians with harmonics of degree 1; the positions of the last
/// chunk are moved by 10.
fn packed_ply(count: usize, chunks: usize) -> Vec<u8> {
    let floats: String = BOUNDS
        .map(|name| format!("property float {name}\n"))
        .concat();
    let uints = ["position", "rotation", "scale", "color"]
        .map(|name| format!("property uint packed_{name}\n"))
        .concat();
    let bytes: String = (0..9)
        .map(|i| format!("property uchar f_rest_{i}\n"))
        .collect();
    let mut file =
        format!("ply\nformat binary_little_endian 1.0\nelement chunk {chunks}\n{floats}element vertex {count}\n{uints}element sh {count}\n{bytes}end_header\n")
            .into_bytes();
    for chunk in 0..chunks {
        let x = if chunk + 1 == chunks { 10.0 } else { 0.0 };
        let bounds: [f32; 12] = [
            x,
            0.0,
            0.0,
            x + 2047.0,
            1023.0,
            2047.0,
            0.0,
            0.0,
            0.0,
            1.0,
            1.0,
            1.0,
        ];
        file.extend(bounds.iter().flat_map(|v| v.to_le_bytes()));
    }
    let words: [u32; 4] = [
        3 << 21 | 5 << 11 | 7,
        1 << 30 | 1023 << 20 | 511 << 10 | 512,
        2047 << 21,
        255 << 24 | 51,
    ];
    (0..count).for_each(|_| file.extend(words.iter().flat_map(|v| v.to_le_bytes())));
    (0..count).for_each(|_| file.extend([0, 255, 127, 128, 128, 128, 128, 128, 0]));
    file
}

const BOUNDS: [&str; 12] = [
    "min_x",
    "min_y",
    "min_z",
    "max_x",
    "max_y",
    "max_z",
    "min_scale_x",
    "min_scale_y",
    "min_scale_z",
    "max_scale_x",
    "max_scale_y",
    "max_scale_z",
];

#[test]
fn packed_words_are_unpacked_between_the_bounds_of_their_chunk() {
    let read = read_as(".ply", &packed_ply(257, 2)).unwrap();
    assert_eq!((read.all.len(), read.degree), (257, 1));
    near(read.all[255].position, DVec3::new(3.0, 5.0, 7.0), 1e-12);
    near(read.all[256].position, DVec3::new(13.0, 5.0, 7.0), 1e-12);
    let gaussian = read.all[0];
    near(
        gaussian.scale,
        DVec3::new(std::f64::consts::E, 1.0, 1.0),
        1e-12,
    );
    assert_eq!(gaussian.opacity, 0.2);
    // x is the largest; w has √½ of the others.
    same_rotation(
        gaussian.rotation,
        DQuat::from_xyzw(0.5f64.sqrt(), 0.0, 0.0, 0.5f64.sqrt()),
        0.003,
    );
    let seen = colour(&read.harmonics(0)[..1], DVec3::X);
    near(DVec3::from_array(seen), DVec3::X, 1e-7);
    let step = 0.5 / 32.0;
    assert_eq!(
        read.harmonics(0)[1..],
        [[-4.0, step, step], [4.0, step, step], [-step, step, -4.0]]
    );
}

#[test]
fn packed_files_that_lack_chunks_or_harmonics_are_refused() {
    assert_eq!(
        refused(".ply", packed_ply(257, 1)),
        "has 1 chunks for 257 Gaussians; there must be 2, one for each 256"
    );
    let file = packed_ply(1, 1);
    let body = file
        .windows(11)
        .position(|window| window == b"end_header\n")
        .unwrap()
        + 11;
    let changed = |from: &str, to: &str| {
        let header = String::from_utf8(file[..body].to_vec()).unwrap();
        assert!(header.contains(from));
        [header.replace(from, to).as_bytes(), &file[body..]].concat()
    };
    assert_eq!(
        refused(".ply", changed("sh 1", "sh 0")),
        "has 0 rows of element `sh` for 1 Gaussians; there must be as many"
    );
    assert!(
        refused(".ply", changed("uchar f_rest_8", "uchar other"))
            .starts_with("has 8 numbers `f_rest_*`; ")
    );
    assert!(refused(".ply", &file[..file.len() - 1]).starts_with("sh 0 of 1: the file ends here"));
    assert!(
        refused(".ply", changed("vertex 1", "vertex 4000000000"))
            .contains(" of 4000000000: the file ends here")
    );
}

// ---- .splat ----

/// A file of one Gaussian.
fn splat_record() -> Vec<u8> {
    let mut file: Vec<u8> = [1.0f32, -2.0, 3.0, 0.25, 0.0, 4.0]
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    file.extend([255, 0, 51, 102, 128, 0, 128, 128]);
    file
}

#[test]
fn splat_records_are_read_byte_for_byte() {
    let mut file = splat_record();
    let read = read_as(".splat", &file).unwrap();
    let expected = Gaussian {
        position: DVec3::new(1.0, -2.0, 3.0),
        rotation: DQuat::from_xyzw(-1.0, 0.0, 0.0, 0.0),
        scale: DVec3::new(0.25, SMALLEST_SCALE, 4.0),
        opacity: 0.4,
    };
    assert_eq!(
        (read.all.as_slice(), read.degree),
        ([expected].as_slice(), 0)
    );
    near(
        DVec3::from_array(colour(read.harmonics(0), DVec3::Y)),
        DVec3::new(1.0, 0.0, 0.2),
        1e-7,
    );

    assert_eq!(
        refused(".splat", &file[1..]),
        "has 31 bytes; a .splat file has 32 for each Gaussian, so it is truncated or another format"
    );
    assert_eq!(refused(".splat", ""), "holds no Gaussians");
    file[28..].fill(128);
    assert_eq!(
        refused(".splat", &file),
        "holds no Gaussian that can be drawn: 1 of 1 Gaussians have a rotation that is zero or not finite and were left out"
    );
}

// ---- .spz ----

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn spz_header(version: u8, count: u32, degree: u8, flags: u8) -> Vec<u8> {
    [
        b"NGSP".as_slice(),
        &[version, 0, 0, 0],
        &count.to_le_bytes(),
        &[degree, 12, flags, 0],
    ]
    .concat()
}

/// Two Gaussians of degree 1, with axes right, up, back: the first at (1, −2, 0.5) and rotated by
/// half a turn about x, the second at 0 without rotation.
fn spz(version: u8) -> Vec<u8> {
    let mut file = spz_header(version, 2, 1, 0);
    match version {
        1 => file.extend([0x00, 0x3c, 0x00, 0xc0, 0x00, 0x38, 0, 0, 0, 0, 0, 0]),
        _ => file.extend([
            0x00, 0x10, 0x00, 0x00, 0xe0, 0xff, 0x00, 0x08, 0x00, 0, 0, 0, 0, 0, 0, 0, 0, 0,
        ]),
    }
    file.extend([51, 255]);
    file.extend([0, 255, 0, 0, 0, 0]);
    file.extend([160, 176, 144, 160, 160, 160]);
    match version {
        3 => file.extend([0, 0, 0, 0, 0, 0, 0, 3 << 6]),
        _ => file.extend([255, 127, 128, 127, 128, 127]),
    }
    file.extend([0, 128, 192, 1, 129, 193, 2, 130, 194]);
    file.extend([128; 9]);
    file
}

#[test]
fn spz_versions_1_to_3_hold_the_same() {
    for version in 1..=3 {
        for bytes in [spz(version), gzip(&spz(version))] {
            let read = read_as(".spz", &bytes).unwrap();
            assert_eq!((read.all.len(), read.degree, read.notes.len()), (2, 1, 0));
            let [a, b] = read.all.as_slice() else {
                panic!()
            };
            assert_eq!(
                (a.position, b.position),
                (DVec3::new(1.0, 2.0, -0.5), DVec3::ZERO)
            );
            assert_eq!((a.opacity, b.opacity), (0.2, 1.0));
            near(
                a.scale,
                DVec3::new(1.0, std::f64::consts::E, (-1.0f64).exp()),
                1e-15,
            );
            same_rotation(a.rotation, DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0), 0.02);
            same_rotation(b.rotation, DQuat::IDENTITY, 0.02);
            let most = 0.5 / 0.15;
            same_harmonics(&read.harmonics(0)[..1], &[[-most, most, -most]], 1e-6);
            let steps = |k: f32| [-1.0 + k / 128.0, k / 128.0, 0.5 + k / 128.0];
            let file: [[f32; 3]; 4] = [[0.0; 3], steps(0.0), steps(1.0), steps(2.0)];
            assert_eq!(read.harmonics(0)[1..], turned(&file)[1..]);
            assert_eq!(read.harmonics(1)[1..], [[0.0; 3]; 3]);
        }
    }
}

#[test]
fn smallest_three_quaternions_have_their_largest_part_in_all_four_places() {
    for largest in 0..4 {
        let mut file = spz_header(3, 1, 0, 0);
        file.extend([0; 9 + 1 + 3 + 3]);
        // In the order x y z w, without the largest: 0.5, −0.25, 0 in steps of √½/511.
        let step = 0.5f64.sqrt() / 511.0;
        let word = largest << 30 | 361u32 << 20 | (512 | 181) << 10;
        file.extend(word.to_le_bytes());
        let mut expected = vec![361.0 * step, -181.0 * step, 0.0];
        expected.insert(
            largest as usize,
            (1.0 - expected.iter().map(|c| c * c).sum::<f64>()).sqrt(),
        );
        let read = read_as(".spz", &file).unwrap();
        let half_turn = DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0);
        same_rotation(
            read.all[0].rotation,
            half_turn * DQuat::from_slice(&expected) * half_turn.inverse(),
            1e-7,
        );
    }
}

#[test]
fn halves_are_the_numbers_that_ieee_754_says() {
    let cases = [
        (0x3c00, 1.0),
        (0xc000, -2.0),
        (0x7bff, 65504.0),
        (0x0001, 2f64.powi(-24)),
        (0x0400, 2f64.powi(-14)),
        (0xfc00, f64::NEG_INFINITY),
    ];
    for (word, value) in cases {
        let mut file = spz_header(1, 1, 0, 0);
        file.extend(u16::to_le_bytes(word));
        file.extend([0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 128, 128, 128]);
        match read_as(".spz", &file) {
            Ok(read) => assert_eq!(read.all[0].position.x, value),
            Err(sentence) => assert!(
                value.is_infinite() && sentence.contains("no finite position"),
                "{sentence}"
            ),
        }
    }
}

#[test]
fn spz_files_that_lie_are_refused() {
    let no_header = "is not an .spz file: it does not begin with the 16 bytes of a header of `NGSP`, under gzip or bare";
    assert_eq!(refused(".spz", ""), no_header);
    assert_eq!(refused(".spz", "NGSP"), no_header);
    assert_eq!(
        refused(".spz", gzip(b"something else, and more of it")),
        no_header
    );
    assert_eq!(
        refused(".spz", spz_header(5, 1, 0, 0)),
        "is an .spz file of version 5; versions 1 to 4 can be read"
    );
    assert_eq!(
        refused(".spz", spz_header(3, 1, 4, 0)),
        "has spherical harmonics of degree 4; degrees 0 to 3 can be read"
    );
    assert_eq!(
        refused(".spz", spz_header(3, 0, 0, 0)),
        "holds no Gaussians"
    );
    let promise = |count| gzip(&[spz_header(3, count, 3, 0), vec![0; 100]].concat());
    assert_eq!(
        refused(".spz", promise(1000)),
        "ends after 100 of the 65000 bytes that its 1000 Gaussians take"
    );
    assert_eq!(
        refused(".spz", promise(u32::MAX)),
        "promises 4294967295 Gaussians, more than a file of its size can hold: they take 279172874175 bytes, at most 67108864 are accepted"
    );
    let whole = gzip(&spz(3));
    assert!(
        refused(".spz", &whole[..whole.len() - 1])
            .starts_with("cannot be uncompressed, it is truncated or damaged: ")
    );
    let mut wrong_sum = whole;
    let at = wrong_sum.len() - 8;
    wrong_sum[at] ^= 1;
    assert!(
        refused(".spz", wrong_sum)
            .starts_with("cannot be uncompressed, it is truncated or damaged: ")
    );
}

#[test]
fn surplus_data_of_an_spz_file_is_noted() {
    let mut file = spz(2);
    file[14] = 1;
    file.extend([1, 2, 3]);
    let read = read_as(".spz", &gzip(&file)).unwrap();
    assert_eq!(
        read.notes,
        ["has 3 bytes after its last Gaussian, which are not read"]
    );
    assert!(read.compensated && !read_as(".spz", &gzip(&spz(2))).unwrap().compensated);
}

// ---- colours ----

/// The associated Legendre function with the Condon-Shortley phase, by recurrence over the degree.
fn legendre(l: i32, m: i32, z: f64) -> f64 {
    let start = (1..=m).fold(1.0, |p, k| -p * f64::from(2 * k - 1) * (1.0 - z * z).sqrt());
    let (mut before, mut p) = (0.0, start);
    for k in m + 1..=l {
        (before, p) = (
            p,
            (f64::from(2 * k - 1) * z * p - f64::from(k + m - 1) * before) / f64::from(k - m),
        );
    }
    p
}

fn harmonic(l: i32, m: i32, direction: DVec3) -> f64 {
    let factorial = |n: i32| (1..=n).map(f64::from).product::<f64>();
    let norm = (f64::from(2 * l + 1) / (4.0 * std::f64::consts::PI) * factorial(l - m.abs())
        / factorial(l + m.abs()))
    .sqrt();
    let around = direction.y.atan2(direction.x) * f64::from(m.abs());
    let wave = match m {
        0 => 1.0,
        _ if m > 0 => 2f64.sqrt() * around.cos(),
        _ => 2f64.sqrt() * around.sin(),
    };
    norm * wave * legendre(l, m.abs(), direction.z)
}

#[test]
fn colours_are_sums_of_spherical_harmonics() {
    for seed in 0..50 {
        let angle = f64::from(seed);
        let direction =
            DVec3::new(angle.sin(), (2.0 * angle).cos(), (3.0 * angle + 1.0).sin()).normalize();
        for degree in 0..=3 {
            let all: Vec<[f32; 3]> = (0..coefficients(degree))
                .map(|k| {
                    [
                        k as f32 * 0.1 - 0.3,
                        0.05,
                        if k == seed as usize % 16 { 1.0 } else { 0.0 },
                    ]
                })
                .collect();
            let orders = (0..=degree as i32).flat_map(|l| (-l..=l).map(move |m| (l, m)));
            let mut expected = [0.5; 3];
            for (rgb, (l, m)) in all.iter().zip(orders) {
                (0..3).for_each(|c| expected[c] += f64::from(rgb[c]) * harmonic(l, m, direction));
            }
            near(
                DVec3::from_array(colour(&all, direction)),
                DVec3::from_array(expected).max(DVec3::ZERO),
                1e-13,
            );
        }
    }
    assert_eq!(colour(&[[-9.0, 0.0, 9.0]], DVec3::X)[..2], [0.0, 0.5]);
}

// ---- damage ----

/// One complete file of each format.
fn whole_files() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        (".ply", float_ply("ascii", &columns(1))),
        (".ply", float_ply("binary_big_endian", &columns(1))),
        (".ply", packed_ply(3, 1)),
        (".splat", splat_record().repeat(3)),
        (".spz", spz(1)),
        (".spz", spz(3)),
        (".spz", gzip(&spz(2))),
    ]
}

fn parse_as(extension: &str, bytes: &[u8]) -> Parsed<Gaussians> {
    match extension {
        ".ply" => parse_ply(bytes),
        ".splat" => splat::parse(bytes),
        _ => spz::parse(bytes),
    }
}

#[test]
fn a_file_truncated_anywhere_is_refused() {
    for (extension, file) in whole_files() {
        assert!(parse_as(extension, &file).is_ok());
        for end in 0..file.len() {
            match parse_as(extension, &file[..end]) {
                Err(sentence) => assert!(
                    sentence.len() < 300 && !sentence.contains('\n'),
                    "{sentence}"
                ),
                // Text may lose its last newline or digits; the last record may be missing.
                Ok(_) => assert!(
                    extension == ".splat" && end % 32 == 0
                        || file.starts_with(b"ply\nformat ascii") && end + 5 > file.len()
                ),
            }
        }
    }
}

proptest! {
    #[test]
    fn no_bytes_make_a_reader_panic(
        which in 0..7usize,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        noise in prop::collection::vec(any::<u8>(), 0..200),
    ) {
        let (extension, mut file) = whole_files().swap_remove(which);
        for (at, byte) in &changes {
            let at = at.index(file.len());
            file[at] = *byte;
        }
        let mut texts: Vec<Parsed<Gaussians>> = vec![parse_as(extension, &file), parse_as(extension, &noise)];
        let header = file.windows(11).position(|w| w == b"end_header\n").map_or(16, |at| at + 11);
        texts.push(parse_as(extension, &[&file[..header.min(file.len())], &noise].concat()));
        for read in texts {
            match read {
                Err(sentence) => prop_assert!(!sentence.is_empty() && !sentence.contains('\n')),
                Ok(read) => for (i, gaussian) in read.all.iter().enumerate() {
                    prop_assert!(gaussian.position.is_finite() && gaussian.rotation.is_normalized());
                    prop_assert!(gaussian.scale.is_finite() && gaussian.scale.min_element() > 0.0);
                    prop_assert!((0.0..=1.0).contains(&gaussian.opacity));
                    prop_assert!(colour(read.harmonics(i), DVec3::Z).iter().all(|c| c.is_finite()));
                },
            }
        }
    }
}

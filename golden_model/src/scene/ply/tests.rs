use super::*;
use crate::output::colour::srgb_decode;
use proptest::prelude::*;
use serde::Serialize;

fn splats(file: &[u8]) -> Vec<Splat> {
    parse(file).unwrap().splats
}

fn refused(file: impl AsRef<[u8]>) -> String {
    let sentence = parse(file.as_ref()).expect_err("must be refused");
    assert!(
        !sentence.contains('\n') && sentence.len() < 300,
        "{sentence}"
    );
    sentence
}

/// A text file of vertices with these properties.
fn text(properties: &str, count: usize, rows: &str) -> String {
    format!("ply\nformat ascii 1.0\nelement vertex {count}\n{properties}\nend_header\n{rows}")
}

const XYZ: &str = "property float x\nproperty float y\nproperty float z";

#[derive(Serialize)]
struct Vertex {
    confidence: f32,
    z: f64,
    red: u8,
    x: f32,
    green: u8,
    ny: f32,
    y: i16,
    nx: f32,
    blue: u8,
    nz: f32,
    radius: f64,
    alpha: u8,
}

#[derive(Serialize)]
struct Camera {
    view: Vec<f32>,
}

#[derive(Serialize)]
struct Mesh {
    camera: Vec<Camera>,
    vertex: Vec<Vertex>,
}

/// An independent writer's files, in all three encodings.
#[test]
fn one_cloud_written_in_three_ways_is_one_cloud() {
    let vertex = |i: u8| Vertex {
        confidence: 0.5,
        z: 1.0 / 3.0,
        red: i,
        x: f32::from(i) / 7.0,
        green: 255,
        ny: 3.0,
        y: -300,
        nx: 0.0,
        blue: 188,
        nz: -4.0,
        radius: 0.125,
        alpha: 51,
    };
    let mesh = Mesh {
        camera: vec![Camera { view: vec![1.0; 5] }],
        vertex: (0..9).map(vertex).collect(),
    };
    use serde_ply::{SerializeOptions, to_bytes};
    let written = [
        SerializeOptions::ascii(),
        SerializeOptions::binary_le(),
        SerializeOptions::binary_be(),
    ]
    .map(|way| splats(&to_bytes(&mesh, way).unwrap()));
    assert_eq!(written[0], written[1]);
    assert_eq!(written[1], written[2]);
    let splat = written[0][7];
    assert_eq!(splat.position, DVec3::new(1.0, -300.0, 1.0 / 3.0));
    assert!((splat.normal - DVec3::new(0.0, 0.6, -0.8)).length() < 1e-15);
    assert_eq!((splat.radius, splat.opacity), (0.125, 0.2));
    assert_eq!(
        splat.rgb,
        [7.0, 255.0, 188.0].map(|code| srgb_decode(code / 255.0))
    );
}

#[test]
fn colours_are_codes_out_of_the_least_full_light_that_holds_them_all() {
    let colour = |kind: &str, row: &str| {
        let properties = format!(
            "{XYZ}\nproperty {kind} diffuse_red\nproperty {kind} diffuse_green\nproperty {kind} diffuse_blue"
        );
        splats(text(&properties, 1, &format!("0 0 0 {row}")).as_bytes())[0].rgb
    };
    let code = |value: f64, full: f64| srgb_decode(value / full);
    assert_eq!(colour("uchar", "0 128 255"), [0.0, code(128.0, 255.0), 1.0]);
    assert_eq!(
        colour("char", "-128 -1 127"),
        [code(128.0, 255.0), 1.0, code(127.0, 255.0)]
    );
    assert_eq!(
        colour("ushort", "0 32768 65535"),
        [0.0, code(32768.0, 65535.0), 1.0]
    );
    assert_eq!(
        colour("ushort", "0 128 255"),
        [0.0, code(128.0, 255.0), 1.0]
    );
    assert_eq!(colour("int", "-5 128 255"), [0.0, code(128.0, 255.0), 1.0]);
    assert_eq!(
        colour("int", "-5 128 300"),
        [0.0, code(128.0, 65535.0), code(300.0, 65535.0)]
    );
    assert_eq!(
        colour("uint", "0 65536 4294967295"),
        [0.0, code(65536.0, 4294967295.0), 1.0]
    );
    assert_eq!(colour("float", "0.25 nan 1.5"), [code(0.25, 1.0), 0.5, 1.0]);
    assert_eq!(
        colour("float", "0.25 -7 260"),
        [code(0.25, 255.0), 0.0, 1.0]
    );
    assert_eq!(
        colour("double", "1000 65535 0"),
        [code(1000.0, 65535.0), 1.0, 0.0]
    );
    // A single implausible number does not change the others.
    assert_eq!(
        colour("float", "0.25 inf 1e30"),
        [code(0.25, 1.0), 1.0, 1.0]
    );
}

#[test]
fn a_comment_makes_colours_linear_light() {
    let properties =
        format!("{XYZ}\nproperty float red\nproperty float green\nproperty float blue");
    let file = text(&properties, 1, "0 0 0 0.25 nan 7").replace(
        "element",
        "comment points; colours are linear light\nelement",
    );
    let cloud = parse(file.as_bytes()).unwrap();
    assert_eq!(
        (cloud.splats[0].rgb, cloud.notes.len()),
        ([0.25, 0.5, 1.0], 0)
    );
}

#[test]
fn opacities_have_a_full_number_of_their_own() {
    let opacity = |kind: &str, row: &str| {
        let properties = format!(
            "{XYZ}\nproperty {kind} red\nproperty {kind} green\nproperty {kind} blue\nproperty {kind} alpha"
        );
        splats(text(&properties, 1, &format!("0 0 0 {row}")).as_bytes())[0].opacity
    };
    assert_eq!(opacity("uchar", "1 2 3 51"), 0.2);
    assert_eq!(opacity("float", "200 100 50 1"), 1.0);
    assert_eq!(opacity("float", "200 100 50 51"), 0.2);
    assert_eq!(opacity("float", "0.5 0.5 0.5 0.25"), 0.25);
    assert_eq!(opacity("ushort", "60000 0 0 13107"), 0.2);
    assert_eq!(opacity("ushort", "60000 0 0 255"), 255.0 / 65535.0);
    assert_eq!(opacity("ushort", "200 0 0 51"), 0.2);
}

#[test]
fn points_without_a_finite_position_are_left_out_and_counted() {
    let cloud = parse(
        text(
            XYZ,
            6,
            "1 2 3\nnan 0 0\n0 -inf 0\n0 0 1e31\n-nan(ind) 1.#QNAN 0\n4 5 6",
        )
        .as_bytes(),
    )
    .unwrap();
    assert_eq!(
        cloud
            .splats
            .iter()
            .map(|s| s.position.x)
            .collect::<Vec<_>>(),
        [1.0, 4.0]
    );
    assert_eq!(
        cloud.notes,
        ["4 of 6 vertices have no finite position and were left out"]
    );
}

#[test]
fn normals_are_made_unit_and_useless_ones_count_as_absent() {
    let properties = format!("{XYZ}\nproperty double nx\nproperty double ny\nproperty double nz");
    let rows = "0 0 0 0 0 3\n0 0 0 0 0 0\n0 0 0 nan 0 1\n0 0 0 1e-300 0 0\n0 0 0 0 -1e300 0\n";
    let normals: Vec<DVec3> = splats(text(&properties, 5, rows).as_bytes())
        .iter()
        .map(|s| s.normal)
        .collect();
    assert_eq!(
        normals,
        [DVec3::Z, DVec3::ZERO, DVec3::ZERO, DVec3::X, -DVec3::Y]
    );
}

#[test]
fn radii_are_read_and_impossible_ones_refused_by_number() {
    let read = |radius: &str| {
        parse(
            text(
                &format!("{XYZ}\nproperty float radius"),
                2,
                &format!("0 0 0 1\n0 0 0 {radius}"),
            )
            .as_bytes(),
        )
    };
    assert_eq!(read("2.5").unwrap().splats[1].radius, 2.5);
    for radius in ["0", "-1", "nan", "inf"] {
        let sentence = read(radius).unwrap_err();
        assert!(
            sentence.starts_with("vertex 1 of 2 has the radius ")
                && sentence.contains("at least 1e-30"),
            "{sentence}"
        );
    }
    let sizes = splats(
        text(
            &format!("{XYZ}\nproperty float psz\nproperty float size"),
            1,
            "0 0 0 7 8",
        )
        .as_bytes(),
    );
    assert_eq!(sizes[0].radius, 0.0);
}

/// A unit square in the plane z = 0, and one point that no face touches.
fn square(faces: &str) -> String {
    let vertices = format!("ply\nformat ascii 1.0\nelement vertex 5\n{XYZ}\n");
    let rows = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n5 5 5\n";
    let (header, body) = faces.split_once('|').unwrap();
    format!("{vertices}{header}\nend_header\n{rows}{body}")
}

#[test]
fn faces_and_strips_give_normals_to_their_vertices() {
    let header = "property list uchar int vertex_ind";
    for file in [
        format!("element face 1\n{header}ices|4 0 1 2 3"),
        format!("element face 2\nproperty uchar flag\n{header}ex|9 3 0 1 2\n9 3 0 2 3"),
        format!("element tristrips 1\n{header}ices|8 1 2 0 3 -1 1 2 0"),
    ] {
        let normals: Vec<DVec3> = splats(square(&file).as_bytes())
            .iter()
            .map(|s| s.normal)
            .collect();
        assert_eq!(
            normals,
            [DVec3::Z, DVec3::Z, DVec3::Z, DVec3::Z, DVec3::ZERO],
            "{file}"
        );
    }
}

#[test]
fn larger_faces_weigh_more() {
    let file = "element face 2\nproperty list uchar int vertex_indices|3 0 1 2\n3 0 4 1";
    let normal = splats(square(file).as_bytes())[0].normal;
    // Twice the areas: (0, 0, 1) and (5,5,5) × (1,0,0) = (0, 5, −5).
    assert!((normal - DVec3::new(0.0, 5.0, -4.0).normalize()).length() < 1e-15);
}

#[test]
fn faces_that_name_no_vertex_are_left_out_and_counted() {
    let file =
        "element face 4\nproperty list uchar int vertex_indices|3 0 1 2\n3 0 1 5\n3 -1 0 1\n2 0 1";
    let cloud = parse(square(file).as_bytes()).unwrap();
    assert_eq!(
        cloud.notes,
        ["2 of 3 triangles name vertices that do not exist and were left out"]
    );
    assert_eq!(cloud.splats[0].normal, DVec3::Z);
}

#[test]
fn text_may_lack_its_last_line_end_and_lines_may_end_in_any_way() {
    let file = text(XYZ, 2, "1 2 3\n\n  4\t5 6");
    for end in ["\n", "\r\n", "\r"] {
        assert_eq!(
            splats(file.replace('\n', end).as_bytes())[1].position,
            DVec3::new(4.0, 5.0, 6.0)
        );
    }
}

#[test]
fn a_mac_header_may_be_followed_by_a_byte_that_is_a_line_feed() {
    let mut file = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex 1\n{}\nend_header\n",
        XYZ.replace("float", "uchar")
    )
    .replace('\n', "\r")
    .into_bytes();
    file.extend([10, 13, 32]);
    assert_eq!(splats(&file)[0].position, DVec3::new(10.0, 13.0, 32.0));
}

#[test]
fn headers_that_lie_are_refused_at_once() {
    let binary = |count: &str| {
        format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{XYZ}\nend_header\n0123456789ab"
        )
    };
    assert_eq!(
        refused(binary("4000000000")),
        "vertex 1 of 4000000000: the file ends here; the header promises more"
    );
    assert_eq!(
        refused(text(XYZ, usize::MAX, "0 0 0")),
        format!(
            "vertex 1 of {} (line 8): the file ends here; the header promises more",
            usize::MAX
        )
    );
    assert!(refused(binary("1e9")).contains("line 3: `1e9` is not a count of elements"));
    // Rows without properties take no memory, for any number in the header.
    let empty_rows = binary("1").replace(
        "element vertex",
        "element nothing 18446744073709551615\nelement vertex",
    );
    assert_eq!(splats(empty_rows.as_bytes()).len(), 1);
    let endless: String = (0..100_000).map(|i| format!("element e{i} 0\n")).collect();
    assert_eq!(
        refused(format!("ply\n{endless}")),
        "has a header of more than 10000 lines"
    );
    let long_list = "element face 1\nproperty list uint int vertex_indices|4294967295 1 2 3";
    assert!(refused(square(long_list)).contains("ends before its last value"));
    assert!(
        refused(square(
            "element face 1\nproperty list int int vertex_indices|-3 1 2 3"
        ))
        .contains("has the length -3")
    );
}

#[test]
fn every_refusal_says_where_and_what() {
    let cases = [
        ("", "is not a PLY file: its first line is not `ply`"),
        ("plyx\n", "is not a PLY file: its first line is not `ply`"),
        (
            "ply\n",
            "ends inside its header: there is no line `end_header`",
        ),
        (
            "ply\nelement vertex 0\nend_header\n",
            "has no `format` line in its header",
        ),
        (
            "ply\nformat ascii 1.0\nend_header\n",
            "has no element `vertex`, so there are no points in it",
        ),
        (
            "ply\nformat ascii 2.0\n",
            "line 2: format `ascii 2.0` is unknown; it must be ascii, binary_little_endian or binary_big_endian, followed by 1.0",
        ),
        (
            "ply\nproperty float x\n",
            "line 2: a property is before the first element",
        ),
        (
            "ply\nelement vertex 1\nproperty flaot x\n",
            "line 3: `flaot` is not a PLY type; types are char, uchar, short, ushort, int, uint, float, double",
        ),
        (
            "ply\nelement vertex 1\nproperty list float int x\n",
            "line 3: the length of a list must be of an integer type",
        ),
        (
            "ply\nelement vertex 1\nelement vertex 1\n",
            "line 3: element `vertex` is there twice",
        ),
    ];
    for (file, expected) in cases {
        assert_eq!(refused(file), expected);
    }
    assert_eq!(
        refused(text("property float x\nproperty list uchar float y", 0, "")),
        "element `vertex` has no number `y`; a point needs x, y and z"
    );
    assert_eq!(
        refused(text(XYZ, 1, "1 2")),
        "vertex 0 of 1 (line 8): the row ends before its last value"
    );
    assert_eq!(
        refused(text(XYZ, 1, "1 2 3 4")),
        "vertex 0 of 1 (line 8): `4` is one value more than the header promises"
    );
    assert_eq!(
        refused(text(XYZ, 1, "1 2 \u{7}three")),
        "vertex 0 of 1 (line 8): `\\u{7}three` is not a value of type float"
    );
    let bytes = XYZ.replace("float", "uchar");
    assert_eq!(
        refused(text(&bytes, 1, "1 2 256")),
        "vertex 0 of 1 (line 8): `256` is not a value of type uchar"
    );
    assert!(refused(text(&bytes, 1, &"9".repeat(1_000_000))).len() < 150);
}

#[test]
fn unknown_header_lines_are_skipped_with_a_note() {
    let file = text(XYZ, 1, "1 2 3").replace("end_header", "Created by hand\nend_header");
    assert_eq!(
        parse(file.as_bytes()).unwrap().notes,
        ["line 7: `Created` is not a PLY keyword; the line was skipped"]
    );
}

/// Writes one value in a type and an encoding.
fn put(file: &mut Vec<u8>, value: f64, kind: Scalar, encoding: PlyEncoding) {
    let mut bytes = match kind {
        Scalar::I8 => (value as i8).to_le_bytes().to_vec(),
        Scalar::U8 => (value as u8).to_le_bytes().to_vec(),
        Scalar::I16 => (value as i16).to_le_bytes().to_vec(),
        Scalar::U16 => (value as u16).to_le_bytes().to_vec(),
        Scalar::I32 => (value as i32).to_le_bytes().to_vec(),
        Scalar::U32 => (value as u32).to_le_bytes().to_vec(),
        Scalar::F32 => (value as f32).to_le_bytes().to_vec(),
        Scalar::F64 => value.to_le_bytes().to_vec(),
    };
    match encoding {
        PlyEncoding::Text => file.extend(format!("{value} ").bytes()),
        PlyEncoding::LittleEndian => file.append(&mut bytes),
        PlyEncoding::BigEndian => {
            bytes.reverse();
            file.append(&mut bytes);
        }
    }
}

fn any_kind() -> impl Strategy<Value = Scalar> {
    prop::sample::select(TYPES.map(|(kind, ..)| kind).to_vec())
}

proptest! {
    /// x, y, z and radius among other scalars and lists, in any order, with any types and encoding.
    #[test]
    fn any_order_and_types_of_properties_are_read(
        kinds in prop::collection::vec(any_kind(), 8),
        lengths in prop::collection::vec(0..4u8, 8),
        order in Just((0..8usize).collect::<Vec<_>>()).prop_shuffle(),
        rows in prop::collection::vec(prop::array::uniform4(1..100u8), 1..5),
        encoding in prop::sample::select(vec![PlyEncoding::Text, PlyEncoding::LittleEndian, PlyEncoding::BigEndian]),
    ) {
        const NAMES: [&str; 8] = ["x", "y", "z", "radius", "quality", "a", "b", "c"];
        let named = match encoding { PlyEncoding::Text => "ascii", PlyEncoding::LittleEndian => "binary_little_endian", PlyEncoding::BigEndian => "binary_big_endian" };
        let mut file = format!("ply\nformat {named} 1.0\nelement vertex {}\n", rows.len());
        for &i in &order {
            let list = if i > 4 { "list uchar " } else { "" };
            file += &format!("property {list}{} {}\n", kinds[i].name(), NAMES[i]);
        }
        file += "end_header\n";
        let mut file = file.into_bytes();
        for row in &rows {
            for &i in &order {
                if i < 5 {
                    put(&mut file, f64::from(row[i % 4]), kinds[i], encoding);
                } else {
                    put(&mut file, f64::from(lengths[i]), Scalar::U8, encoding);
                    (0..lengths[i]).for_each(|n| put(&mut file, f64::from(n), kinds[i], encoding));
                }
            }
            if encoding == PlyEncoding::Text {
                file.push(b'\n');
            }
        }
        let read = splats(&file);
        prop_assert_eq!(read.len(), rows.len());
        for (splat, row) in read.iter().zip(&rows) {
            prop_assert_eq!(splat.position.to_array(), [row[0], row[1], row[2]].map(f64::from));
            prop_assert_eq!(splat.radius, f64::from(row[3]));
        }
        // A file that is truncated anywhere is refused without a panic.
        for end in 0..file.len() - 1 {
            if let Ok(cloud) = parse(&file[..end]) {
                prop_assert!(encoding == PlyEncoding::Text && cloud.splats.len() == rows.len());
            }
        }
    }

    #[test]
    fn no_bytes_make_the_reader_panic(body in prop::collection::vec(any::<u8>(), 0..200), at in any::<prop::sample::Index>(), byte in any::<u8>()) {
        let header = square("element face 3\nproperty list uchar int vertex_indices|3 0 1 2\n4 0 1 2 3\n3 4 4 4\n").into_bytes();
        let mut flipped = header.clone();
        flipped[at.index(header.len())] = byte;
        let _ = parse(&flipped);
        let _ = parse(&body);
        let _ = parse(&[b"ply\nformat binary_big_endian 1.0\nelement face 9\nproperty list int char vertex_index\nelement vertex 3\nproperty char x\nproperty short y\nproperty double z\nend_header\n", body.as_slice()].concat());
    }
}

//! Tests: volumes of every format, written into small files and read back.

use super::*;
use crate::shared_input;
use base64::Engine;
use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use proptest::prelude::*;
use std::fs;
use std::io::Write;
use tempfile::TempDir;

const SIZE: [usize; 3] = [3, 2, 2];

fn is_volume(path: &Path) -> bool {
    matches!(
        formats::reader(path),
        Some(Reader::Volume(_) | Reader::Image(_))
    )
}

/// Reads bytes as the file of that name in a folder.
fn parse(name: &str, bytes: &[u8], folder: &Path) -> Parsed<Volume> {
    match formats::reader(Path::new(name)) {
        Some(Reader::Volume(parse)) => parse(bytes, folder),
        Some(Reader::Image(parse)) => parse(bytes, &Arrays::default()),
        _ => panic!("{name} is not a volume"),
    }
}

/// The samples of the small volume; all types can represent them.
const SAMPLES: [u8; 12] = [0, 1, 2, 3, 100, 127, 6, 7, 8, 9, 10, 11];

const TYPES: [SampleType; 10] = [
    SampleType::U8,
    SampleType::I8,
    SampleType::U16,
    SampleType::I16,
    SampleType::U32,
    SampleType::I32,
    SampleType::U64,
    SampleType::I64,
    SampleType::F32,
    SampleType::F64,
];

const ORDERS: [ByteOrder; 2] = [ByteOrder::Little, ByteOrder::Big];

/// The samples as bytes; signed and float types have a negative one instead of the 1.
fn encode(sample_type: SampleType, order: ByteOrder) -> Vec<u8> {
    let word = |(i, value): (usize, &u8)| {
        let signed = if i == 1 && is_signed(sample_type) {
            -i64::from(*value)
        } else {
            i64::from(*value)
        };
        let mut word = match sample_type {
            SampleType::F32 => (signed as f32).to_le_bytes().to_vec(),
            SampleType::F64 => (signed as f64).to_le_bytes().to_vec(),
            _ => signed.to_le_bytes()[..sample_type.bytes()].to_vec(),
        };
        if order == ByteOrder::Big {
            word.reverse();
        }
        word
    };
    SAMPLES.iter().enumerate().flat_map(word).collect()
}

fn is_signed(sample_type: SampleType) -> bool {
    !matches!(
        sample_type,
        SampleType::U8 | SampleType::U16 | SampleType::U32 | SampleType::U64
    )
}

fn expected(sample_type: SampleType) -> Vec<f32> {
    let mut values: Vec<f32> = SAMPLES.iter().map(|&value| value.into()).collect();
    if is_signed(sample_type) {
        values[1] = -1.0;
    }
    values
}

fn text(sample_type: SampleType) -> String {
    expected(sample_type)
        .iter()
        .map(|value| format!("{value}\n"))
        .collect()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn hex(bytes: &[u8]) -> Vec<u8> {
    bytes
        .iter()
        .flat_map(|byte| format!("{byte:02X} ").into_bytes())
        .collect()
}

fn base64(bytes: &[u8]) -> String {
    base64::engine::general_purpose::STANDARD.encode(bytes)
}

/// Writes the files into one folder and reads the first.
fn read_files(files: &[(&str, &[u8])]) -> Result<Volume, String> {
    let folder = TempDir::new().unwrap();
    for (name, bytes) in files {
        fs::write(folder.path().join(name), bytes).unwrap();
    }
    read(&folder.path().join(files[0].0))
}

fn joined(header: &str, data: &[u8]) -> Vec<u8> {
    [header.as_bytes(), data].concat()
}

/// The file is refused, and the sentence has all these words.
#[track_caller]
fn refused(result: Result<Volume, String>, words: &[&str]) {
    let sentence = result.expect_err("was read");
    for word in words {
        assert!(sentence.contains(word), "`{word}` is not in: {sentence}");
    }
    assert!(
        !sentence.contains('\n') && sentence.len() < 400,
        "{sentence}"
    );
}

#[track_caller]
fn check(volume: Result<Volume, String>, sample_type: SampleType) -> Volume {
    let volume = volume.unwrap();
    assert_eq!(volume.size, SIZE);
    assert_eq!(volume.values, expected(sample_type), "{sample_type:?}");
    volume
}

// ---- plain samples ----

fn raw_description(json: &str) -> RawDescription {
    serde_json::from_str(json).unwrap()
}

#[test]
fn plain_samples_of_every_type_and_byte_order_are_read() {
    let names = ["u8", "i8", "u16", "i16", "u32", "i32", "", "", "f32", "f64"];
    for ((sample_type, name), order) in TYPES
        .into_iter()
        .zip(names)
        .filter(|(_, name)| !name.is_empty())
        .flat_map(|t| ORDERS.map(|o| (t, o)))
    {
        let folder = TempDir::new().unwrap();
        fs::write(
            folder.path().join("x.raw"),
            [&b"head"[..], &encode(sample_type, order), b"tail"].concat(),
        )
        .unwrap();
        let endian = if order == ByteOrder::Big {
            "big"
        } else {
            "little"
        };
        let json = format!(
            r#"{{"file":"x.raw","size":[3,2,2],"type":"{name}","endian":"{endian}","spacing":[1,2,3.5],"origin":[4,5,6],"skip":4}}"#
        );
        let volume = check(
            read_raw(&raw_description(&json), folder.path()),
            sample_type,
        );
        assert_eq!(
            (volume.axes, volume.origin),
            (diagonal([1.0, 2.0, 3.5]), [4.0, 5.0, 6.0])
        );
    }
}

#[test]
fn a_description_of_plain_samples_has_defaults_and_no_unknown_fields() {
    let description = raw_description(r#"{"file":"x.raw","size":[3,2,2],"type":"u8"}"#);
    assert_eq!(
        (
            description.endian,
            description.spacing,
            description.origin,
            description.skip
        ),
        (ByteOrder::Little, [1.0; 3], [0.0; 3], 0)
    );
    assert!(
        serde_json::from_str::<RawDescription>(
            r#"{"file":"x.raw","size":[3,2,2],"type":"u8","foo":1}"#
        )
        .is_err()
    );
    assert!(
        serde_json::from_str::<RawDescription>(r#"{"file":"x.raw","size":[3,2,2],"type":"u64"}"#)
            .is_err()
    );
    let schema = serde_json::to_string(&schemars::schema_for!(RawDescription)).unwrap();
    assert!(
        schema.contains("f64") && !schema.contains("u64") && !schema.contains("i64"),
        "{schema}"
    );
}

#[test]
fn a_broken_description_of_plain_samples_ends_in_a_sentence() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("x.raw"), SAMPLES).unwrap();
    let good = raw_description(r#"{"file":"x.raw","size":[3,2,2],"type":"u8"}"#);
    let with = |change: &dyn Fn(&mut RawDescription)| {
        let mut description = good.clone();
        change(&mut description);
        read_raw(&description, folder.path())
    };
    assert!(with(&|_| ()).is_ok());
    refused(with(&|d| d.size = [0, 1, 1]), &["`size`", "at least one"]);
    refused(
        with(&|d| d.size = [1_000_000_000; 3]),
        &["`size`", "at most 2147483648"],
    );
    refused(
        with(&|d| d.size = [usize::MAX, 2, 1]),
        &["`size`", "at most"],
    );
    refused(
        with(&|d| d.size = [1_000_000_000, 1, 1]),
        &["x.raw", "12 bytes", "take 1000000000"],
    );
    refused(with(&|d| d.spacing[1] = 0.0), &["`spacing`", "step of 0"]);
    refused(
        with(&|d| d.spacing[1] = -1.0),
        &["`spacing`", "step of -1", "above zero"],
    );
    refused(with(&|d| d.spacing[1] = f64::NAN), &["`spacing`", "NaN"]);
    refused(with(&|d| d.origin[1] = f64::INFINITY), &["`origin`", "inf"]);
    refused(with(&|d| d.skip = 1), &["x.raw", "11 bytes"]);
    refused(
        with(&|d| d.skip = u64::MAX),
        &["x.raw", "`skip`", "only 12"],
    );
    refused(
        with(&|d| d.file = "none.raw".into()),
        &["none.raw", "cannot be read"],
    );
    refused(
        with(&|d| d.file = "/dev/zero".into()),
        &["`file`", "relative"],
    );
    refused(
        with(&|d| d.file = "../../../../../../../dev/zero".into()),
        &["it is a device", "a file is needed"],
    );
    refused(
        with(&|d| d.file = ".".into()),
        &["it is a folder", "a file is needed"],
    );
    fs::write(
        folder.path().join("x.raw"),
        [0.0_f32.to_le_bytes(), f32::NAN.to_le_bytes()].concat(),
    )
    .unwrap();
    let absent = with(&|d| (d.size, d.sample_type) = ([1, 2, 1], SampleType::F32)).unwrap();
    assert!(absent.values[0] == 0.0 && absent.values[1].is_nan());
    fs::write(
        folder.path().join("x.raw"),
        [0.0_f32.to_le_bytes(), f32::INFINITY.to_le_bytes()].concat(),
    )
    .unwrap();
    refused(
        with(&|d| (d.size, d.sample_type) = ([1, 2, 1], SampleType::F32)),
        &["sample (0, 1, 0) is inf", "or NaN where there is none"],
    );
    fs::write(folder.path().join("x.raw"), 1e300_f64.to_le_bytes()).unwrap();
    refused(
        with(&|d| (d.size, d.sample_type) = ([1, 1, 1], SampleType::F64)),
        &["sample (0, 0, 0) is inf"],
    );
}

// ---- paths ----

#[test]
fn volumes_are_recognised_by_their_extension() {
    for name in [
        "a.nrrd", "a.nhdr", "a.mhd", "a.mha", "a.nii", "a.nii.gz", "a.vti", "A.NII.GZ", "a.b.NRRD",
    ] {
        assert!(is_volume(Path::new(name)), "{name}");
    }
    for name in [
        "a.json", "a.gz", "a.raw", "nrrd", "a.vtk", "a.hdr", "", "a.nrrd/",
    ] {
        assert_eq!(is_volume(Path::new(name)), name == "a.nrrd/", "{name}");
    }
}

#[test]
fn a_path_that_is_no_volume_ends_in_a_sentence() {
    refused(read(Path::new("/nowhere/x.nrrd")), &["cannot be read"]);
    refused(read_files(&[("x.hdr", b"")]), &["a pair of .hdr and .img"]);
    refused(read_files(&[("x.foo", b"")]), &[".nrrd", ".vti"]);
    let folder = TempDir::new().unwrap();
    fs::create_dir(folder.path().join("x.nii")).unwrap();
    refused(read(&folder.path().join("x.nii")), &["it is a folder"]);
    for name in [
        "x.nrrd", "x.nhdr", "x.mhd", "x.mha", "x.nii", "x.nii.gz", "x.vti",
    ] {
        refused(read_files(&[(name, b"")]), &[]);
    }
}

// ---- NRRD ----

const NRRD_NAMES: [&[&str]; 10] = [
    &["uchar", "unsigned char", "uint8", "uint8_t"],
    &["signed char", "int8", "int8_t"],
    &[
        "ushort",
        "unsigned short",
        "unsigned short int",
        "uint16",
        "uint16_t",
    ],
    &[
        "short",
        "short int",
        "signed short",
        "signed short int",
        "int16",
        "int16_t",
    ],
    &["uint", "unsigned int", "uint32", "uint32_t"],
    &["int", "signed int", "int32", "int32_t"],
    &[
        "ulonglong",
        "unsigned long long",
        "unsigned long long int",
        "uint64",
        "uint64_t",
    ],
    &[
        "longlong",
        "long long",
        "long long int",
        "signed long long",
        "signed long long int",
        "int64",
        "int64_t",
    ],
    &["float", "FLOAT"],
    &["double"],
];

fn nrrd_header(name: &str, order: ByteOrder, encoding: &str, more: &str) -> String {
    let endian = if order == ByteOrder::Big {
        "big"
    } else {
        "little"
    };
    format!(
        "NRRD0004\n# a comment\ntype: {name}\ndimension: 3\nsizes: 3 2 2\nendian: {endian}\nencoding: {encoding}\nkey:=value\n{more}"
    )
}

#[test]
fn nrrd_of_every_type_byte_order_and_encoding_is_read() {
    for (sample_type, names) in TYPES.into_iter().zip(NRRD_NAMES) {
        for (order, name) in ORDERS
            .into_iter()
            .flat_map(|order| names.iter().map(move |name| (order, name)))
        {
            let bytes = encode(sample_type, order);
            for (encoding, data) in [
                ("raw", bytes.clone()),
                ("gzip", gzip(&bytes)),
                (
                    "gz",
                    [gzip(&bytes[..5]), gzip(&bytes[5..]), b"\n".to_vec()].concat(),
                ),
                ("ASCII", text(sample_type).into_bytes()),
                ("txt", text(sample_type).into_bytes()),
                ("hex", hex(&bytes)),
            ] {
                let header = nrrd_header(name, order, encoding, "");
                check(
                    read_files(&[("x.nrrd", &joined(&(header.clone() + "\n"), &data))]),
                    sample_type,
                );
                check(
                    read_files(&[(
                        "x.nrrd",
                        &joined(&(header.replace('\n', "\r\n") + "\r\n"), &data),
                    )]),
                    sample_type,
                );
                let header = header + "data file: x.bin\n";
                check(
                    read_files(&[("x.nhdr", header.as_bytes()), ("x.bin", &data)]),
                    sample_type,
                );
            }
        }
    }
}

fn nrrd(more: &str, data: &[u8]) -> Result<Volume, String> {
    read_files(&[(
        "x.nrrd",
        &joined(
            &(nrrd_header("uchar", ByteOrder::Little, "raw", more) + "\n"),
            data,
        ),
    )])
}

#[test]
fn nrrd_grids_are_read() {
    let grid = |more: &str| {
        nrrd(more, &SAMPLES)
            .map(|volume| (volume.axes, volume.origin))
            .unwrap()
    };
    assert_eq!(grid(""), (diagonal([1.0; 3]), [0.0; 3]));
    assert_eq!(
        grid("spacings: 1 -2.5 3\naxis mins: 4 5 nan\n"),
        (diagonal([1.0, -2.5, 3.0]), [4.0, 5.0, 0.0])
    );
    assert_eq!(
        grid("axis mins: 0 0 0\naxis maxs: 4 3 2\n"),
        (diagonal([2.0, 3.0, 2.0]), [0.0; 3])
    );
    assert_eq!(
        grid("axis mins: 0 0 0\naxis maxs: 6 4 2\ncenters: cell cell node\n"),
        (diagonal([2.0, 2.0, 2.0]), [1.0, 1.0, 0.0])
    );
    assert_eq!(
        grid(
            "space: right-anterior-superior\nspace directions: (0,2,0) (-1,0,0)( 0, 0 ,3)\nspace origin: (7,8,9)\nspacings: 1 1 1\n"
        ),
        (
            [[0.0, 2.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 3.0]],
            [7.0, 8.0, 9.0]
        )
    );
}

/// Signs that convert the coordinates of each space to right, anterior and superior, from the names
/// of its axes.
#[test]
fn every_spelling_of_an_nrrd_space_lands_in_one_world() {
    let grid = |space: &str, time: bool| {
        let (directions, origin) = if time {
            ("(2,1,0,0) (0,3,0,0) (0,0,4,0)", "(5,6,7,1)")
        } else {
            ("(2,1,0) (0,3,0) (0,0,4)", "(5,6,7)")
        };
        nrrd(
            &format!("space: {space}\nspace directions: {directions}\nspace origin: {origin}\n"),
            &SAMPLES,
        )
        .unwrap()
    };
    let cases = [
        ("right-anterior-superior", "RAS", [1.0, 1.0, 1.0]),
        ("left-anterior-superior", "LAS", [-1.0, 1.0, 1.0]),
        ("left-posterior-superior", "LPS", [-1.0, -1.0, 1.0]),
        ("scanner-xyz", "scanner xyz", [1.0, 1.0, 1.0]),
        ("3D-right-handed", "3drighthanded", [1.0, 1.0, 1.0]),
        ("3D-left-handed", "3D left handed", [1.0, 1.0, -1.0]),
    ];
    for (long, short, signs) in cases {
        let by_signs = |vector: [f64; 3]| [0, 1, 2].map(|i| vector[i] * signs[i]);
        let expected = [[2.0, 1.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 4.0]].map(by_signs);
        let timed = if short.len() == 3 {
            format!("{short}T")
        } else {
            format!("{short}-time")
        };
        let spellings = [
            (long, false),
            (short, false),
            (&long.to_uppercase(), false),
            (&format!("{long}-time"), true),
            (&timed, true),
        ];
        for (spelling, time) in spellings {
            let volume = grid(spelling, time);
            assert_eq!(
                (volume.axes, volume.origin),
                (expected, by_signs([5.0, 6.0, 7.0])),
                "{spelling}"
            );
            assert_eq!(
                volume.notes.is_empty(),
                signs == [1.0; 3],
                "{spelling}: {:?}",
                volume.notes
            );
        }
    }
    assert!(nrrd("", &SAMPLES).unwrap().notes[0].contains("no `space`"));
    for (space, vectors) in [
        ("LPST", "(1,0,0) (0,1,0) (0,0,1)"),
        ("LPS", "(1,0,0,0) (0,1,0,0) (0,0,1,0)"),
    ] {
        refused(
            nrrd(
                &format!("space: {space}\nspace directions: {vectors}\n"),
                &SAMPLES,
            ),
            &["`space directions`", "3 times a vector"],
        );
    }
    refused(
        nrrd(
            "space: LPST\nspace directions: (1,0,0,1) (0,1,0,0) (0,0,1,0)\n",
            &SAMPLES,
        ),
        &["in space and in time"],
    );
}

#[test]
fn an_nrrd_axis_of_time_is_dropped() {
    let header = nrrd_header(
        "uchar",
        ByteOrder::Little,
        "raw",
        "space: RAST\nspace directions: (1,0,0,0) (0,1,0,0) (0,0,2,0) (0,0,0,3)\n",
    );
    let header = header
        .replace("dimension: 3", "dimension: 4")
        .replace("3 2 2", "3 2 2 1")
        + "\n";
    let volume = check(
        read_files(&[("x.nrrd", &joined(&header, &SAMPLES))]),
        SampleType::U8,
    );
    assert_eq!(volume.axes, diagonal([1.0, 1.0, 2.0]));
    // And not another axis with one sample.
    let first = header.replace("3 2 2 1", "1 3 4 1").replace(
        "(1,0,0,0) (0,1,0,0) (0,0,2,0) (0,0,0,3)",
        "(0,0,0,3) (1,0,0,0) (0,1,0,0) (0,0,2,0)",
    );
    let volume = read_files(&[("x.nrrd", &joined(&first, &SAMPLES))]).unwrap();
    assert_eq!(
        (volume.size, volume.axes),
        ([3, 4, 1], diagonal([1.0, 1.0, 2.0]))
    );
}

#[test]
fn nrrd_axes_of_length_one_are_dropped() {
    let with = |sizes: &str, more: &str| {
        let header = nrrd_header("uchar", ByteOrder::Little, "raw", more)
            .replace("dimension: 3", "dimension: 4");
        read_files(&[(
            "x.nrrd",
            &joined(&(header.replace("3 2 2", sizes) + "\n"), &SAMPLES),
        )])
    };
    let directions = "space directions: none (1,0,0) (0,1,0) (0,0,2)\n";
    assert_eq!(
        check(with("1 3 2 2", directions), SampleType::U8).axes,
        diagonal([1.0, 1.0, 2.0])
    );
    assert_eq!(
        check(with("3 2 2 1", "spacings: 1 2 3 nan\n"), SampleType::U8).axes,
        diagonal([1.0, 2.0, 3.0])
    );
    refused(with("2 3 2 1", directions), &["`space directions`", "none"]);
    refused(with("3 2 2 2", ""), &["`sizes` is 3 2 2 2", "length 1"]);
}

#[test]
fn nrrd_skips_lines_and_bytes() {
    check(
        nrrd(
            "line skip: 2\nbyte skip: 3\n",
            &[b"a\nb\nabc".as_slice(), &SAMPLES].concat(),
        ),
        SampleType::U8,
    );
    check(
        nrrd(
            "byte skip: -1\n",
            &[b"anything".as_slice(), &SAMPLES].concat(),
        ),
        SampleType::U8,
    );
    let packed = |more: &str| {
        let header = nrrd_header("uchar", ByteOrder::Little, "gzip", more) + "\n";
        read_files(&[(
            "x.nrrd",
            &joined(&header, &gzip(&[b"four".as_slice(), &SAMPLES].concat())),
        )])
    };
    check(packed("byte skip: 4\n"), SampleType::U8);
    check(packed("byte skip: -1\n"), SampleType::U8);
    refused(packed(""), &["unpack to more than the 12 bytes"]);
    refused(packed("byte skip: 5\n"), &["11 bytes", "take 12"]);
    refused(
        packed("byte skip: 18446744073709551615\n"),
        &["`byte skip`"],
    );
    refused(
        packed("byte skip: 9223372036854775807\n"),
        &["0 bytes", "take 12"],
    );
}

#[test]
fn a_broken_nrrd_ends_in_a_sentence() {
    let good = nrrd_header("short", ByteOrder::Little, "raw", "spacings: 1 1 1\n");
    let data = encode(SampleType::I16, ByteOrder::Little);
    let with = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        read_files(&[("x.nrrd", &joined(&(good.replace(from, to) + "\n"), &data))])
    };
    check(with("short", "short"), SampleType::I16);
    refused(
        with("NRRD0004", "NRRD0009"),
        &["version `0009`", "0001 to 0005"],
    );
    refused(with("NRRD0004", "PLY"), &["`NRRD`"]);
    refused(
        with("type: short", "type: foo"),
        &["`type` is `foo`", "8, 16, 32", "float and double"],
    );
    refused(with("type: short", "type: block"), &["`type` is `block`"]);
    refused(with("type: short\n", ""), &["no `type`"]);
    refused(with("dimension: 3", "dimension: 2"), &["`dimension` is 2"]);
    refused(
        with("dimension: 3", "dimension: 1000000000"),
        &["`dimension` is 1000000000"],
    );
    refused(
        with("dimension: 3", "dimension: x"),
        &["`dimension` is `x`", "whole number"],
    );
    refused(
        with("sizes: 3 2 2", "sizes: 3 2"),
        &["`sizes` is `3 2`", "3 whole numbers"],
    );
    refused(
        with("sizes: 3 2 2", "sizes: 3 -2 2"),
        &["`sizes`", "whole numbers"],
    );
    refused(
        with("sizes: 3 2 2", "sizes: 3 0 2"),
        &["`sizes` is 3 × 0 × 2"],
    );
    refused(
        with("sizes: 3 2 2", "sizes: 1000000000 1000000000 1000000000"),
        &["`sizes`", "at most"],
    );
    refused(
        with("sizes: 3 2 2", "sizes: 1000000000 1 1"),
        &["24 bytes", "take 2000000000"],
    );
    refused(with("endian: little\n", ""), &["no `endian`"]);
    refused(
        with("endian: little", "endian: middle"),
        &["`endian` is `middle`"],
    );
    refused(
        with("encoding: raw", "encoding: bzip2"),
        &["`encoding` is `bzip2`", "raw, gzip, ascii and hex"],
    );
    refused(with("encoding: raw", "encoding: gzip"), &["broken"]);
    refused(with("encoding: raw", "encoding: hex"), &["hexadecimal"]);
    refused(
        with("encoding: raw", "encoding: ascii"),
        &["sample (0, 0, 0)", "not a number"],
    );
    refused(
        with("spacings: 1 1 1", "spacings: 1 0 1"),
        &["`spacings`", "not zero"],
    );
    refused(
        with("spacings: 1 1 1", "spacings: 1 nan 1"),
        &["`spacings`", "NaN"],
    );
    refused(
        with("spacings: 1 1 1", "spacings: 1 inf 1"),
        &["`spacings`", "inf"],
    );
    refused(
        with(
            "spacings: 1 1 1",
            "space directions: (1,0,0) (1,1,0) (2,1,0)",
        ),
        &["`space directions`", "in a plane"],
    );
    refused(
        with("spacings: 1 1 1", "space: left-posterior-inferior"),
        &[
            "`space` is `left-posterior-inferior`",
            "left-posterior-superior",
        ],
    );
    refused(
        with("spacings: 1 1 1", "space directions: (1,0,0) (0,1,0)"),
        &["`space directions`", "3 times"],
    );
    refused(
        with("spacings: 1 1 1", "space directions: (1,0) (0,1) (1,1)"),
        &["`space directions`", "vector"],
    );
    refused(
        with("spacings: 1 1 1", "space origin: (1,0,nan)"),
        &["`space origin`", "NaN"],
    );
    refused(
        with("spacings: 1 1 1", "space origin: none"),
        &["`space origin`"],
    );
    refused(
        with("spacings: 1 1 1", "spacing: 1 1 1"),
        &["`spacing` is not a field"],
    );
    refused(
        with("spacings: 1 1 1", "spacings: 1 1 1\nspacings: 1 1 1"),
        &["`spacings` is there twice"],
    );
    refused(with("spacings: 1 1 1", "nonsense"), &["`nonsense`"]);
    refused(
        with("spacings: 1 1 1", "byte skip: -2"),
        &["`byte skip` is -2"],
    );
    refused(
        with("spacings: 1 1 1", "byte skip: 99"),
        &["`byte skip`", "99", "24"],
    );
    refused(
        with("spacings: 1 1 1", "line skip: 18446744073709551615"),
        &["`line skip`"],
    );
    refused(
        with("spacings: 1 1 1", "data file: LIST\na.raw"),
        &["several files"],
    );
    refused(
        with("spacings: 1 1 1", "data file: x%03d.raw 1 10 1"),
        &["several files"],
    );
    refused(
        with("spacings: 1 1 1", "data file: none.raw"),
        &["none.raw", "cannot be read"],
    );
    refused(
        with("spacings: 1 1 1", "data file: /dev/zero"),
        &["relative"],
    );
    refused(
        read_files(&[("x.nhdr", good.as_bytes())]),
        &["neither", "`data file`"],
    );
    let short = good.clone() + "data file: x.raw\n";
    refused(
        read_files(&[("x.nhdr", short.as_bytes()), ("x.raw", &data[1..])]),
        &["x.raw", "23 bytes", "take 24"],
    );
}

// ---- MetaImage ----

const META_TYPES: [&str; 10] = [
    "MET_UCHAR",
    "MET_CHAR",
    "MET_USHORT",
    "MET_SHORT",
    "MET_UINT",
    "MET_INT",
    "MET_ULONG_LONG",
    "MET_LONG_LONG",
    "MET_FLOAT",
    "MET_DOUBLE",
];

fn meta_header(name: &str, order: ByteOrder, more: &str, file: &str) -> String {
    let msb = if order == ByteOrder::Big {
        "True"
    } else {
        "False"
    };
    format!(
        "ObjectType = Image\nNDims = 3\nComment = mine\nBinaryDataByteOrderMSB = {msb}\n{more}DimSize = 3 2 2\nElementType = {name}\nElementDataFile = {file}\n"
    )
}

#[test]
fn metaimage_of_every_type_byte_order_and_encoding_is_read() {
    for (sample_type, name) in TYPES.into_iter().zip(META_TYPES) {
        for order in ORDERS {
            let bytes = encode(sample_type, order);
            for (more, data) in [
                ("", bytes.clone()),
                ("HeaderSize = 2\n", [b"ab".as_slice(), &bytes].concat()),
                ("HeaderSize = -1\n", [b"abc".as_slice(), &bytes].concat()),
                ("CompressedData = True\n", zlib(&bytes)),
                ("CompressedData = True\n", gzip(&bytes)),
                ("BinaryData = False\n", text(sample_type).into_bytes()),
            ] {
                check(
                    read_files(&[(
                        "x.mha",
                        &joined(&meta_header(name, order, more, "LOCAL"), &data),
                    )]),
                    sample_type,
                );
                let header = meta_header(name, order, more, "my x.raw");
                check(
                    read_files(&[("x.mhd", header.as_bytes()), ("my x.raw", &data)]),
                    sample_type,
                );
            }
        }
    }
    let long = meta_header("MET_LONG", ByteOrder::Little, "", "LOCAL");
    check(
        read_files(&[(
            "x.mha",
            &joined(&long, &encode(SampleType::I32, ByteOrder::Little)),
        )]),
        SampleType::I32,
    );
}

#[test]
fn metaimage_grids_are_read() {
    let grid = |more: &str| {
        let header = meta_header("MET_UCHAR", ByteOrder::Little, more, "LOCAL");
        read_files(&[("x.mha", &joined(&header, &SAMPLES))])
            .map(|volume| (volume.axes, volume.origin))
            .unwrap()
    };
    assert_eq!(grid(""), (diagonal([-1.0, -1.0, 1.0]), [0.0; 3]));
    assert_eq!(
        grid("ElementSize = 1 1 2\n"),
        (diagonal([-1.0, -1.0, 2.0]), [0.0; 3])
    );
    for (offset, matrix) in [
        ("Offset", "TransformMatrix"),
        ("Position", "Orientation"),
        ("Origin", "Rotation"),
    ] {
        assert_eq!(
            grid(&format!(
                "ElementSpacing = 2 3 4\n{offset} = 5 6 7\n{matrix} = 0 1 0 -1 0 0 0 0 -1\n"
            )),
            (
                [[0.0, -2.0, 0.0], [3.0, 0.0, 0.0], [0.0, 0.0, -4.0]],
                [-5.0, -6.0, 7.0]
            )
        );
    }
}

#[test]
fn a_broken_metaimage_ends_in_a_sentence() {
    let good = meta_header(
        "MET_SHORT",
        ByteOrder::Little,
        "ElementSpacing = 1 1 1\n",
        "LOCAL",
    );
    let data = encode(SampleType::I16, ByteOrder::Little);
    let with = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        read_files(&[("x.mha", &joined(&good.replace(from, to), &data))])
    };
    check(with("Image", "Image"), SampleType::I16);
    refused(
        with("ObjectType = Image", "ObjectType = Tube"),
        &["`ObjectType` is `Tube`"],
    );
    refused(
        with("NDims = 3", "NDims = 2"),
        &["`NDims` is `2`", "only 3"],
    );
    refused(with("NDims = 3\n", ""), &["no `NDims`"]);
    refused(
        with("DimSize = 3 2 2", "DimSize = 3 2"),
        &["`DimSize`", "3 whole numbers"],
    );
    refused(
        with("DimSize = 3 2 2", "DimSize = 1000000000 1000000000 1"),
        &["`DimSize`", "at most"],
    );
    refused(
        with("DimSize = 3 2 2", "DimSize = 1000000000 1 1"),
        &["24 bytes", "take 2000000000"],
    );
    refused(
        with("DimSize = 3 2 2", "DimSize = 0 1 1"),
        &["at least one"],
    );
    refused(
        with("MET_SHORT", "MET_FOO"),
        &["`ElementType` is `MET_FOO`", "MET_SHORT"],
    );
    refused(
        with("MSB = False", "MSB = perhaps"),
        &["`BinaryDataByteOrderMSB`", "True or False"],
    );
    refused(with("Comment = mine", "Comment"), &["`Comment`"]);
    refused(
        with("Comment = mine", "NDims = 3"),
        &["`NDims` is there twice"],
    );
    refused(
        with("Comment = mine", "ElementNumberOfChannels = 3"),
        &["`ElementNumberOfChannels` is `3`", "only 1"],
    );
    refused(
        with("Comment = mine", "HeaderSize = -2"),
        &["`HeaderSize` is -2"],
    );
    refused(
        with("Comment = mine", "HeaderSize = 99"),
        &["`HeaderSize`", "99"],
    );
    refused(with("Comment = mine", "CompressedData = True"), &["broken"]);
    refused(
        with("Comment = mine", "CompressedData = True\nHeaderSize = -1"),
        &["`HeaderSize`"],
    );
    refused(
        with("Comment = mine", "Offset = 1 2 nan"),
        &["`Offset`", "NaN"],
    );
    refused(
        with("Comment = mine", "TransformMatrix = 1 0 0 1 1 0 2 1 0"),
        &["`TransformMatrix`", "in a plane"],
    );
    refused(
        with("Comment = mine", "TransformMatrix = 0 0 0 0 1 0 0 0 1"),
        &["`TransformMatrix`", "length 0"],
    );
    refused(
        with("ElementSpacing = 1 1 1", "ElementSpacing = 1 0 1"),
        &["`ElementSpacing`", "above zero"],
    );
    refused(
        with("ElementSpacing = 1 1 1", "ElementSpacing = 1 -1 1"),
        &["`ElementSpacing`", "above zero"],
    );
    refused(
        with("ElementSpacing = 1 1 1", "ElementSpacing = 1 inf 1"),
        &["`ElementSpacing`", "inf"],
    );
    refused(with("= LOCAL", "= LIST\na.raw"), &["several files"]);
    refused(with("= LOCAL", "= x%03d.raw 1 9 1"), &["several files"]);
    refused(
        with("= LOCAL", "= none.raw"),
        &["none.raw", "cannot be read"],
    );
    refused(with("= LOCAL", "="), &["`ElementDataFile`"]);
    refused(with("= LOCAL", "= x.mha/../../dev"), &["cannot be read"]);
    refused(with("ElementDataFile = LOCAL\n", "x = y\n"), &[]);
    refused(
        read_files(&[
            ("x.mhd", good.replace("LOCAL", "x.raw").as_bytes()),
            ("x.raw", &data[1..]),
        ]),
        &["x.raw", "23 bytes"],
    );
    let packed = good.replace("Comment = mine", "CompressedData = True");
    refused(
        read_files(&[("x.mha", &joined(&packed, &zlib(&[0; 25])))]),
        &["more than the 24 bytes"],
    );
    refused(
        read_files(&[("x.mha", &joined(&packed, &zlib(&[0; 23])))]),
        &["23 bytes", "take 24"],
    );
    refused(
        read_files(&[("x.mha", &joined(&packed, &zlib(&data)[..9]))]),
        &["ends early"],
    );
}

// ---- NIfTI ----

const NIFTI_CODES: [i16; 10] = [2, 256, 512, 4, 768, 8, 1280, 1024, 16, 64];

/// A header under construction, in one byte order.
struct Nifti {
    bytes: Vec<u8>,
    order: ByteOrder,
}

impl Nifti {
    fn new(code: i16, order: ByteOrder) -> Nifti {
        let mut nifti = Nifti {
            bytes: vec![0; 352],
            order,
        };
        nifti.put(0, 348_i32.to_le_bytes());
        nifti.shorts(40, &[3, 3, 2, 2, 1, 1, 1, 1]);
        nifti.shorts(70, &[code]);
        nifti.floats(76, &[1.0, 1.0, 2.0, 3.0]);
        nifti.floats(108, &[352.0]);
        nifti.bytes[344..348].copy_from_slice(b"n+1\0");
        nifti
    }

    fn put<const N: usize>(&mut self, at: usize, mut word: [u8; N]) {
        if self.order == ByteOrder::Big {
            word.reverse();
        }
        self.bytes[at..at + N].copy_from_slice(&word);
    }

    fn shorts(&mut self, at: usize, words: &[i16]) {
        words
            .iter()
            .enumerate()
            .for_each(|(i, word)| self.put(at + 2 * i, word.to_le_bytes()));
    }

    fn floats(&mut self, at: usize, words: &[f32]) {
        words
            .iter()
            .enumerate()
            .for_each(|(i, word)| self.put(at + 4 * i, word.to_le_bytes()));
    }
}

/// Reads a volume of 8-bit samples with a modified header.
fn nifti(change: impl Fn(&mut Nifti)) -> Result<Volume, String> {
    let mut nifti = Nifti::new(2, ByteOrder::Little);
    change(&mut nifti);
    read_files(&[("x.nii", &[nifti.bytes, SAMPLES.to_vec()].concat())])
}

#[test]
fn nifti_of_every_type_and_byte_order_is_read_gzipped_or_not() {
    for ((sample_type, code), order) in TYPES
        .into_iter()
        .zip(NIFTI_CODES)
        .flat_map(|t| ORDERS.map(|o| (t, o)))
    {
        let file = [Nifti::new(code, order).bytes, encode(sample_type, order)].concat();
        assert_eq!(
            check(read_files(&[("x.nii", &file)]), sample_type).axes,
            diagonal([1.0, 2.0, 3.0])
        );
        check(read_files(&[("x.nii.gz", &gzip(&file))]), sample_type);
    }
}

#[test]
fn nifti_samples_are_scaled() {
    let values = |slope, inter| {
        nifti(|header| header.floats(112, &[slope, inter])).map(|volume| volume.values[4])
    };
    assert_eq!(
        (values(2.0, -5.0), values(0.0, 7.0), values(f32::NAN, 7.0)),
        (Ok(195.0), Ok(100.0), Ok(100.0))
    );
    assert!(
        values(1.0, f32::NAN)
            .unwrap_err()
            .contains("`scl_inter` is NaN")
    );
    assert!(
        values(3e38, 0.0)
            .unwrap_err()
            .contains("sample (2, 0, 0) is inf")
    );
}

#[test]
fn nifti_grids_are_read_from_sform_then_qform_then_pixdim() {
    let grid = |change: &dyn Fn(&mut Nifti)| {
        nifti(change)
            .map(|volume| (volume.axes, volume.origin))
            .unwrap()
    };
    let sform = |header: &mut Nifti, shear: f32| {
        header.shorts(254, &[1]);
        header.floats(
            280,
            &[
                0.0, -2.0, 0.0, 10.0, 1.0, shear, 0.0, 11.0, 0.0, 0.0, 3.0, 12.0,
            ],
        );
    };
    // A quarter turn about z.
    let qform = |header: &mut Nifti, qfac: f32| {
        header.shorts(252, &[1]);
        header.floats(256, &[0.0, 0.0, 0.5_f32.sqrt(), 7.0, 8.0, 9.0]);
        header.floats(76, &[qfac]);
    };
    let near =
        |(axes, origin): ([[f64; 3]; 3], [f64; 3]), expected: [[f64; 3]; 3], at: [f64; 3]| {
            let close = axes
                .iter()
                .flatten()
                .zip(expected.iter().flatten())
                .all(|(a, b)| (a - b).abs() < 1e-6);
            assert!(close && origin == at, "{axes:?} {origin:?}");
        };
    let from_sform = (
        [[0.0, 1.0, 0.0], [-2.0, 0.0, 0.0], [0.0, 0.0, 3.0]],
        [10.0, 11.0, 12.0],
    );
    assert_eq!(grid(&|header| sform(header, 0.0)), from_sform);
    assert_eq!(
        grid(&|header| (sform(header, 0.0), qform(header, 1.0)).0),
        from_sform
    );
    near(
        grid(&|header| qform(header, 1.0)),
        [[0.0, 1.0, 0.0], [-2.0, 0.0, 0.0], [0.0, 0.0, 3.0]],
        [7.0, 8.0, 9.0],
    );
    near(
        grid(&|header| qform(header, -1.0)),
        [[0.0, 1.0, 0.0], [-2.0, 0.0, 0.0], [0.0, 0.0, -3.0]],
        [7.0, 8.0, 9.0],
    );
    let sheared = (
        [[0.0, 1.0, 0.0], [-2.0, 1.0, 0.0], [0.0, 0.0, 3.0]],
        [10.0, 11.0, 12.0],
    );
    assert_eq!(grid(&|header| sform(header, 1.0)), sheared);
    assert_eq!(
        grid(&|header| (sform(header, 1.0), qform(header, 1.0)).0),
        sheared
    );
    // A transform that spans no space is replaced by the next one.
    let flat = |header: &mut Nifti| (sform(header, 0.0), header.floats(312, &[0.0; 3])).0;
    assert_eq!(
        grid(&|header| flat(header)),
        (diagonal([1.0, 2.0, 3.0]), [0.0; 3])
    );
    near(
        grid(&|header| (flat(header), qform(header, 1.0)).0),
        [[0.0, 1.0, 0.0], [-2.0, 0.0, 0.0], [0.0, 0.0, 3.0]],
        [7.0, 8.0, 9.0],
    );
    // A quaternion whose vector is longer than 1 by rounding is a half turn.
    near(
        grid(&|header| (qform(header, 1.0), header.floats(256, &[0.0, 0.0, 1.0001])).0),
        [[-1.0, 0.0, 0.0], [0.0, -2.0, 0.0], [0.0, 0.0, 3.0]],
        [7.0, 8.0, 9.0],
    );
}

#[test]
fn a_nifti_says_which_of_its_grids_is_drawn() {
    let notes = |change: &dyn Fn(&mut Nifti)| nifti(change).unwrap().notes.join("; ");
    let sform = |header: &mut Nifti, at: f32| {
        header.shorts(254, &[2]);
        header.floats(
            280,
            &[1.0, 0.0, 0.0, at, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0],
        );
    };
    let qform = |header: &mut Nifti| header.shorts(252, &[1]);
    assert!(notes(&|_| ()).contains("neither sform nor qform"));
    assert_eq!(notes(&|header| sform(header, 5.0)), "");
    assert_eq!(notes(&|header| (sform(header, 0.4), qform(header)).1), "");
    assert!(notes(&|header| (sform(header, 0.6), qform(header)).1).contains("the sform is drawn"));
    assert!(
        notes(&|header| (sform(header, 0.0), header.floats(312, &[0.0; 3])).1)
            .contains("its sform is set")
    );
}

#[test]
fn a_broken_nifti_ends_in_a_sentence() {
    check(nifti(|_| ()), SampleType::U8);
    check(nifti(|header| header.shorts(40, &[4])), SampleType::U8);
    check(nifti(|header| header.floats(108, &[0.0])), SampleType::U8);
    refused(
        nifti(|header| header.bytes[0] = 1),
        &["`sizeof_hdr`", "348"],
    );
    refused(
        nifti(|header| header.put(0, 540_i32.to_le_bytes())),
        &["NIfTI-2"],
    );
    refused(
        nifti(|header| header.bytes[345] = b'i'),
        &["pair of .hdr and .img"],
    );
    refused(nifti(|header| header.bytes[344] = 0), &["Analyze"]);
    refused(nifti(|header| header.shorts(40, &[2])), &["`dim[0]` is 2"]);
    refused(
        nifti(|header| header.shorts(40, &[-1])),
        &["`dim[0]` is -1"],
    );
    refused(
        nifti(|header| header.shorts(40, &[4, 3, 2, 2, 5])),
        &["`dim[4]` is 5"],
    );
    refused(nifti(|header| header.shorts(42, &[0])), &["`dim[1]` is 0"]);
    refused(
        nifti(|header| header.shorts(42, &[-3])),
        &["`dim[1]` is -3"],
    );
    refused(
        nifti(|header| header.shorts(42, &[i16::MAX; 3])),
        &["`dim`", "at most"],
    );
    refused(
        nifti(|header| header.shorts(42, &[3, 2, 3])),
        &["12 bytes", "take 18"],
    );
    refused(
        nifti(|header| header.shorts(70, &[128])),
        &["`datatype` is 128"],
    );
    refused(
        nifti(|header| header.floats(108, &[100.0])),
        &["`vox_offset` is 100"],
    );
    refused(
        nifti(|header| header.floats(108, &[f32::NAN])),
        &["`vox_offset` is NaN"],
    );
    refused(
        nifti(|header| header.floats(108, &[1e30])),
        &["`vox_offset`"],
    );
    refused(
        nifti(|header| header.floats(108, &[9999.0])),
        &["`vox_offset` is 9999", "ends before"],
    );
    refused(
        nifti(|header| header.floats(80, &[0.0])),
        &["`pixdim`", "step of 0"],
    );
    refused(
        nifti(|header| header.floats(80, &[-1.0])),
        &["`pixdim`", "step of -1"],
    );
    refused(
        nifti(|header| header.floats(80, &[f32::INFINITY])),
        &["`pixdim`", "inf"],
    );
    refused(nifti(|header| header.bytes.truncate(100)), &["348 bytes"]);
    let whole = gzip(&[Nifti::new(2, ByteOrder::Little).bytes, SAMPLES.to_vec()].concat());
    refused(read_files(&[("x.nii.gz", &whole[..40])]), &["ends early"]);
}

// ---- VTI ----

const VTI_TYPES: [&str; 10] = [
    "UInt8", "Int8", "UInt16", "Int16", "UInt32", "Int32", "UInt64", "Int64", "Float32", "Float64",
];

fn vti_header(root: &str, image: &str, arrays: &str, rest: &str) -> String {
    format!(
        "<?xml version=\"1.0\"?>\n<!-- a > comment -->\n<VTKFile type=\"ImageData\" version='1.0' {root}>\n  <ImageData {image}>\n  <Piece Extent=\"0 2 0 1 0 1\">\n\
         <CellData><DataArray type=\"Int8\" Name=\"cells\" format=\"ascii\">1 1</DataArray></CellData>\n<PointData Scalars=\"it\">\n{arrays}\n</PointData></Piece></ImageData>\n{rest}"
    )
}

const VTI_IMAGE: &str = "WholeExtent=\"0 2 0 1 0 1\" Origin=\"1 2 3\" Spacing=\"1 2 3.5\"";

/// The length of the block, or of its packed parts, and the block itself.
fn vti_block(
    bytes: &[u8],
    order: ByteOrder,
    word_bytes: usize,
    packed: bool,
) -> (Vec<u8>, Vec<u8>) {
    let word = |value: usize| {
        let mut word = value.to_le_bytes()[..word_bytes].to_vec();
        if order == ByteOrder::Big {
            word.reverse();
        }
        word
    };
    if !packed {
        return (word(bytes.len()), bytes.to_vec());
    }
    let parts: Vec<_> = bytes.chunks(5).map(zlib).collect();
    let mut lengths = vec![parts.len(), 5, bytes.len() % 5];
    lengths.extend(parts.iter().map(Vec::len));
    (lengths.into_iter().flat_map(word).collect(), parts.concat())
}

#[test]
fn vti_of_every_type_byte_order_and_encoding_is_read() {
    for ((sample_type, name), order) in TYPES
        .into_iter()
        .zip(VTI_TYPES)
        .flat_map(|t| ORDERS.map(|o| (t, o)))
    {
        let bytes = encode(sample_type, order);
        for (word_bytes, packed) in [(4, false), (8, false), (4, true), (8, true)] {
            let endian = if order == ByteOrder::Big {
                "Big"
            } else {
                "Little"
            };
            let compressor = if packed {
                "compressor=\"vtkZLibDataCompressor\""
            } else {
                ""
            };
            let root = format!(
                "byte_order=\"{endian}Endian\" header_type=\"UInt{}\" {compressor}",
                8 * word_bytes
            );
            let (lengths, block) = vti_block(&bytes, order, word_bytes, packed);
            let both = [lengths.clone(), block.clone()].concat();
            let (together, apart) = (base64(&both), base64(&lengths) + &base64(&block));
            let array = |format: &str, inside: &str| {
                format!(
                    "<DataArray type=\"Int8\" Name=\"other\" format=\"ascii\">7</DataArray><DataArray type=\"{name}\" Name=\"it\" NumberOfComponents=\"1\" {format}>{inside}</DataArray>"
                )
            };
            let appended = array("format=\"appended\" offset=\"4\"", "");
            let after = "<AppendedData encoding=\"base64\">\n _AAAA";
            let raw = vti_header(
                &root,
                VTI_IMAGE,
                &appended,
                "<AppendedData encoding=\"raw\">\n_skip",
            );
            for file in [
                vti_header(
                    &root,
                    VTI_IMAGE,
                    &array("format=\"ascii\"", &text(sample_type)),
                    "</VTKFile>",
                )
                .into_bytes(),
                vti_header(
                    &root,
                    VTI_IMAGE,
                    &array("format=\"binary\"", &format!("\n {together}\n")),
                    "</VTKFile>",
                )
                .into_bytes(),
                vti_header(
                    &root,
                    VTI_IMAGE,
                    &array("format=\"binary\"", &apart),
                    "</VTKFile>",
                )
                .into_bytes(),
                vti_header(
                    &root,
                    VTI_IMAGE,
                    &appended,
                    &format!("{after}{together}</AppendedData></VTKFile>"),
                )
                .into_bytes(),
                vti_header(
                    &root,
                    VTI_IMAGE,
                    &appended,
                    &format!("{after}{apart}\n</AppendedData></VTKFile>"),
                )
                .into_bytes(),
                [raw.as_bytes(), &both, b"\n</AppendedData></VTKFile>"].concat(),
            ] {
                let volume = check(read_files(&[("x.vti", &file)]), sample_type);
                assert_eq!(
                    (volume.axes, volume.origin),
                    (diagonal([1.0, 2.0, 3.5]), [1.0, 2.0, 3.0])
                );
            }
        }
    }
}

fn vti_ascii() -> String {
    let array = format!(
        "<DataArray type=\"UInt8\" Name=\"it\" format=\"ascii\">{}</DataArray>",
        text(SampleType::U8)
    );
    vti_header("", VTI_IMAGE, &array, "</VTKFile>")
}

fn vti_with(from: &str, to: &str) -> Result<Volume, String> {
    assert!(vti_ascii().contains(from), "{from}");
    read_files(&[("x.vti", vti_ascii().replace(from, to).as_bytes())])
}

#[test]
fn vti_extents_may_start_anywhere_and_axes_may_be_turned() {
    let volume = check(
        vti_with("\"0 2 0 1 0 1\"", "\"1 3 -1 0 0 1\""),
        SampleType::U8,
    );
    assert_eq!(volume.origin, [2.0, 0.0, 3.0]);
    let volume = check(
        vti_with("Spacing=", "Direction=\"0 -1 0 1 0 0 0 0 1\" Spacing="),
        SampleType::U8,
    );
    assert_eq!(
        volume.axes,
        [[0.0, 1.0, 0.0], [-2.0, 0.0, 0.0], [0.0, 0.0, 3.5]]
    );
}

/// Arrays of one component are selected by name; a note reports the selection if the file leaves it
/// open.
#[test]
fn an_array_of_a_vti_is_drawn_by_its_name() {
    let [zeros, ones] = ["0", "1"].map(|value| [value; 12].join(" "));
    let array = |name: &str, values: &str| {
        format!("<DataArray type=\"Float32\" Name=\"{name}\" format=\"ascii\">{values}</DataArray>")
    };
    let both = array("zero", &zeros) + &array("one", &ones);
    let file = |scalars: &str| {
        vti_header("", VTI_IMAGE, &both, "</VTKFile>").replace(" Scalars=\"it\"", scalars)
    };
    let read = |file: &str, values: Option<&str>, variance: Option<&str>| {
        let folder = TempDir::new().unwrap();
        let path = folder.path().join("x.vti");
        fs::write(&path, file).unwrap();
        read_samples(&path, &Arrays { values, variance })
            .map(|samples| (samples.values()[0], samples.notes().join("")))
    };
    for scalars in ["", " Scalars=\"zero\""] {
        assert_eq!(
            read(&file(scalars), Some("one"), None),
            Ok((1.0, String::new())),
            "{scalars}"
        );
    }
    assert_eq!(
        read(&file(" Scalars=\"one\""), None, None),
        Ok((1.0, String::new()))
    );
    assert_eq!(
        read(&file(""), None, None),
        Ok((
            0.0,
            "array `zero` is drawn, the first; `array` may name one".into()
        ))
    );
    assert_eq!(
        read(&file(""), Some("two"), None),
        Err("has no array `two` in <PointData>; there is zero, one".into())
    );
    assert!(
        read(&file(""), None, Some("one"))
            .unwrap_err()
            .contains("whose kernels come from its spacing")
    );
}

#[test]
fn vti_without_an_active_array_takes_the_first_of_one_component() {
    let vectors = "<PointData><DataArray type=\"UInt8\" NumberOfComponents=\"3\" format=\"ascii\">1 2 3</DataArray>";
    check(
        vti_with("<PointData Scalars=\"it\">", vectors),
        SampleType::U8,
    );
}

#[test]
fn a_broken_vti_ends_in_a_sentence() {
    check(vti_with("UInt8", "UInt8"), SampleType::U8);
    refused(vti_with("VTKFile", "svg"), &["no <VTKFile>"]);
    refused(
        vti_with("type=\"ImageData\"", "type=\"PolyData\""),
        &["is a VTP file by its content"],
    );
    refused(vti_with("WholeExtent", "Extend"), &["`WholeExtent`"]);
    refused(
        vti_with("\"0 2 0 1 0 1\"", "\"0 2 0 1\""),
        &["`WholeExtent`", "6 whole numbers"],
    );
    refused(
        vti_with("\"0 2 0 1 0 1\"", "\"0 -1 0 1 0 1\""),
        &["`WholeExtent` is 0 × 2 × 2"],
    );
    refused(
        vti_with("\"0 2 0 1 0 1\"", "\"0 1000000000 0 1000000000 0 1\""),
        &["at most"],
    );
    refused(
        vti_with(
            "\"0 2 0 1 0 1\"",
            "\"-2147483648 2147483647 0 2147483647 0 2147483647\"",
        ),
        &["at most"],
    );
    refused(
        vti_with("\"0 2 0 1 0 1\"", "\"0 999999999 0 0 0 0\""),
        &["12 numbers", "1000000000"],
    );
    refused(
        vti_with("Piece Extent=\"0 2", "Piece Extent=\"0 1"),
        &["`Extent`", "same"],
    );
    refused(vti_with("</Piece>", "</Piece><Piece>"), &["several pieces"]);
    refused(
        vti_with("Spacing=\"1 2 3.5\"", "Spacing=\"1 0 1\""),
        &["`Spacing`", "above zero"],
    );
    refused(
        vti_with("Spacing=\"1 2 3.5\"", "Spacing=\"1 -1 1\""),
        &["`Spacing`", "above zero"],
    );
    refused(
        vti_with("Origin=\"1 2 3\"", "Origin=\"1 2 nan\""),
        &["`Origin`", "NaN"],
    );
    refused(
        vti_with("Spacing=", "Direction=\"1 1 2 0 1 1 0 0 0\" Spacing="),
        &["`Direction`", "in a plane"],
    );
    refused(
        vti_with("UInt8", "String"),
        &["`type` is `String`", "Float32"],
    );
    refused(
        vti_with("Name=\"it\"", "Name=\"it\" NumberOfComponents=\"3\""),
        &["`NumberOfComponents` is `3`"],
    );
    refused(vti_with("<PointData", "<PointDate"), &["<PointData>"]);
    refused(
        vti_with("Name=\"it\" format=\"ascii\"", "Name=\"it\" format=\"foo\""),
        &["array `it`", "`format` is `foo`"],
    );
    refused(
        vti_with(
            "Name=\"it\" format=\"ascii\"",
            "Name=\"it\" format=\"appended\"",
        ),
        &["no <AppendedData>"],
    );
    refused(
        vti_with(
            "Name=\"it\" format=\"ascii\"",
            "Name=\"it\" format=\"binary\"",
        ),
        &["array `it`", "the block"],
    );
    refused(
        vti_with("Name=\"it\" format", "Name=\"it\" format="),
        &["name=\"value\""],
    );
    refused(vti_with("version='1.0'", "version='1.0"), &[]);
    refused(vti_with("100", "foo"), &["sample (1, 1, 0): `foo`"]);
    refused(
        vti_with("</VTKFile>", "<!--").and(vti_with("comment -->", "comment")),
        &["inside a comment"],
    );
}

#[test]
fn a_broken_vti_block_ends_in_a_sentence() {
    let with = |root: &str, block: &[u8], encoding: &str, offset: &str| {
        let array = format!(
            "<DataArray type=\"UInt8\" Name=\"it\" format=\"appended\" offset=\"{offset}\"/>"
        );
        let header = vti_header(
            root,
            VTI_IMAGE,
            &array,
            &format!("<AppendedData encoding=\"{encoding}\">_"),
        );
        read_files(&[("x.vti", &joined(&header, block))])
    };
    let plain = |length: u32| [&length.to_le_bytes()[..], &SAMPLES].concat();
    check(with("", &plain(12), "raw", "0"), SampleType::U8);
    refused(
        with("", &plain(13), "raw", "0"),
        &["declares 13 bytes", "take 12"],
    );
    refused(with("", &plain(u32::MAX), "raw", "0"), &["4294967295"]);
    refused(with("", &plain(12)[..15], "raw", "0"), &["11 bytes"]);
    refused(
        with("", &plain(12)[..3], "raw", "0"),
        &["inside its header"],
    );
    refused(with("", &plain(12), "raw", "99"), &["`offset`", "99"]);
    refused(
        with("", &plain(12), "raw", "18446744073709551615"),
        &["`offset`"],
    );
    refused(with("", &plain(12), "raw", "x"), &["`offset` is `x`"]);
    refused(
        with("", &plain(12), "base85", "0"),
        &["`encoding`", "base85"],
    );
    refused(
        with("header_type=\"UInt16\"", &plain(12), "raw", "0"),
        &["`header_type`", "UInt16"],
    );
    refused(
        with("byte_order=\"Odd\"", &plain(12), "raw", "0"),
        &["`byte_order`", "Odd"],
    );
    refused(
        with(
            "compressor=\"vtkLZ4DataCompressor\"",
            &plain(12),
            "raw",
            "0",
        ),
        &["`compressor`", "vtkZLibDataCompressor"],
    );
    let packed = |words: &[u64], data: &[u8]| {
        let words: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        with(
            "header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\"",
            &[&words[..], data].concat(),
            "raw",
            "0",
        )
    };
    let data = zlib(&SAMPLES);
    let length = data.len() as u64;
    check(packed(&[1, 12, 0, length], &data), SampleType::U8);
    check(packed(&[1, 99, 12, length], &data), SampleType::U8);
    refused(packed(&[0, 12, 0, length], &data), &["0 bytes"]);
    refused(
        packed(&[u64::MAX, 0, 12, length], &data),
        &["inside its header"],
    );
    refused(
        packed(&[u64::MAX, u64::MAX, 1, length], &data),
        &["declares"],
    );
    refused(
        packed(&[1, 12, 0, u64::MAX], &data),
        &["part 0 of 1 ends early"],
    );
    refused(packed(&[1, 12, 0, length - 1], &data), &["ends early"]);
    refused(
        packed(&[1, 12, 0, length], &zlib(&SAMPLES[1..])[..]),
        &["ends early"],
    );
    let short = zlib(&SAMPLES[1..]);
    refused(
        packed(&[1, 12, 0, short.len() as u64], &short),
        &["11 bytes, not to 12"],
    );
    let long = zlib(&[0; 13]);
    refused(
        packed(&[1, 12, 0, long.len() as u64], &long),
        &["more than the 12 bytes"],
    );
}

// ---- mutations ----

/// Small valid files, one of each kind.
fn sound_files() -> Vec<(&'static str, Vec<u8>)> {
    let little = ByteOrder::Little;
    let bytes = encode(SampleType::I16, little);
    let appended = "<DataArray type=\"Int16\" Name=\"it\" format=\"appended\" offset=\"0\"/>";
    let (lengths, block) = vti_block(&bytes, little, 4, true);
    let vti = vti_header(
        "compressor=\"vtkZLibDataCompressor\"",
        VTI_IMAGE,
        appended,
        "<AppendedData encoding=\"raw\">_",
    );
    let nrrd_grid = "space: LPS\nspace directions: (1,0,0) (0,1,0) (0,0,2)\nspace origin: (0,0,0)\nline skip: 0\nbyte skip: -1\n\n";
    let meta_grid = "ElementSpacing = 1 1 2\nOffset = 0 0 1\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nHeaderSize = 0\nCompressedData = True\n";
    let nii = [
        Nifti::new(4, ByteOrder::Big).bytes,
        encode(SampleType::I16, ByteOrder::Big),
    ]
    .concat();
    vec![
        (
            "x.nrrd",
            joined(&nrrd_header("short", little, "raw", nrrd_grid), &bytes),
        ),
        (
            "x.nrrd",
            joined(
                &nrrd_header("short", little, "gzip", nrrd_grid),
                &gzip(&bytes),
            ),
        ),
        (
            "x.nrrd",
            joined(
                &nrrd_header(
                    "short",
                    little,
                    "hex",
                    "spacings: 1 1 2\naxis mins: 0 0 0\n\n",
                ),
                &hex(&bytes),
            ),
        ),
        (
            "x.nrrd",
            joined(
                &nrrd_header("short", little, "ascii", "centers: cell cell node\n\n"),
                text(SampleType::I16).as_bytes(),
            ),
        ),
        (
            "x.mha",
            joined(
                &meta_header("MET_SHORT", little, meta_grid, "LOCAL"),
                &zlib(&bytes),
            ),
        ),
        ("x.nii", nii.clone()),
        ("x.nii.gz", gzip(&nii)),
        ("x.vti", joined(&vti, &[lengths, block].concat())),
        ("x.vti", vti_ascii().into_bytes()),
    ]
}

#[derive(Clone, Debug)]
enum Mutation {
    Cut(usize),
    Byte(usize, u8),
    Remove(usize, usize),
    Repeat(usize, usize),
    Insert(usize, &'static str),
}

fn mutations() -> impl Strategy<Value = Vec<Mutation>> {
    let tokens = [
        "-1",
        "0",
        "99999999999999999999",
        "1000000000",
        "nan",
        "-",
        "\n",
        "\n\n",
        "\"",
        "<",
        ">",
        "(",
        ")",
        "=",
        ":",
        "é",
        "\0",
    ];
    let one = prop_oneof![
        any::<usize>().prop_map(Mutation::Cut),
        (any::<usize>(), any::<u8>()).prop_map(|(at, byte)| Mutation::Byte(at, byte)),
        (any::<usize>(), 1..20_usize).prop_map(|(at, length)| Mutation::Remove(at, length)),
        (any::<usize>(), 1..40_usize).prop_map(|(at, length)| Mutation::Repeat(at, length)),
        (any::<usize>(), prop::sample::select(tokens.to_vec()))
            .prop_map(|(at, token)| Mutation::Insert(at, token)),
    ];
    prop::collection::vec(one, 1..4)
}

fn mutate(bytes: &mut Vec<u8>, mutation: &Mutation) {
    let length = bytes.len().max(1);
    let end = |at: usize, run: usize, bytes: &[u8]| (at % length + run).min(bytes.len());
    match *mutation {
        Mutation::Cut(at) => bytes.truncate(at % length),
        Mutation::Byte(at, byte) => bytes
            .iter_mut()
            .skip(at % length)
            .take(1)
            .for_each(|old| *old = byte),
        Mutation::Remove(at, run) => {
            drop(bytes.drain((at % length).min(bytes.len())..end(at, run, bytes)))
        }
        Mutation::Repeat(at, run) => {
            bytes.extend_from_within((at % length).min(bytes.len())..end(at, run, bytes))
        }
        Mutation::Insert(at, token) => {
            let at = (at % length).min(bytes.len());
            bytes.splice(at..at, token.bytes());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_mutation_of_a_sound_file_panics(which in 0..9_usize, mutations in mutations()) {
        let (name, mut bytes) = sound_files().swap_remove(which);
        mutations.iter().for_each(|mutation| mutate(&mut bytes, mutation));
        match parse(name, &bytes, Path::new("/nowhere")) {
            Ok(volume) => {
                prop_assert_eq!(volume.values.len(), volume.size.iter().product::<usize>());
                prop_assert!(!volume.values.iter().any(|value| value.is_infinite()));
                prop_assert!(volume.axes.iter().flatten().chain(&volume.origin).all(|x| x.is_finite()));
            }
            Err(sentence) => prop_assert!(!sentence.contains('\n') && sentence.len() < 600, "{}", sentence),
        }
    }
}

#[test]
fn every_sound_file_is_read_and_none_of_its_truncations_panics() {
    for (name, bytes) in sound_files() {
        check(
            parse(name, &bytes, Path::new("")),
            if name == "x.vti" && bytes.starts_with(b"<?xml") && bytes.ends_with(b"</VTKFile>") {
                SampleType::U8
            } else {
                SampleType::I16
            },
        );
        for length in 0..bytes.len() {
            let _ = parse(name, &bytes[..length], Path::new(""));
        }
    }
}

// ---- real data ----

fn range(volume: &Volume) -> (f32, f32) {
    volume
        .values
        .iter()
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &value| {
            (low.min(value), high.max(value))
        })
}

#[test]
fn real_volumes_have_the_range_that_their_source_states() {
    let Some(folder) = shared_input::find("volumes") else {
        return;
    };
    let head = r#"{"file":"CThead_256x256x113_u16be.raw","size":[256,256,113],"type":"u16","endian":"big","spacing":[1,1,2]}"#;
    let head = read_raw(&raw_description(head), &folder).unwrap();
    assert_eq!(
        (range(&head), head.axes),
        ((0.0, 3272.0), diagonal([1.0, 1.0, 2.0]))
    );
    let headsq = r#"{"file":"headsq_64x64x93_i16le.raw","size":[64,64,93],"type":"i16","spacing":[3.2,3.2,1.5]}"#;
    let headsq = read_raw(&raw_description(headsq), &folder).unwrap();
    assert_eq!(
        (range(&headsq), headsq.axes),
        ((0.0, 3926.0), diagonal([3.2, 3.2, 1.5]))
    );
    let engine = read(&folder.join("engine_256x256x128_u8.nii")).unwrap();
    let zeros = engine.values.iter().filter(|&&value| value == 0.0).count() as f64
        / engine.values.len() as f64;
    assert_eq!(
        (engine.size, engine.axes, engine.origin),
        ([256, 256, 128], diagonal([1.0; 3]), [-127.0, -127.0, -64.0])
    );
    assert!((0.80..0.82).contains(&zeros), "{zeros}");
}

#[test]
fn every_real_nrrd_ends_in_a_volume_or_a_sentence() {
    let Some(folder) = shared_input::find("malformed/nrrd") else {
        return;
    };
    let with = |name: &str| read(&folder.join(name));
    let ball = with("BallBinary30x30x30.nrrd").unwrap();
    assert_eq!(
        (ball.size, ball.axes, ball.origin, range(&ball)),
        ([30; 3], diagonal([-1.0, -1.0, 1.0]), [0.0; 3], (0.0, 257.0))
    );
    for name in [
        "BallBinary30x30x30.nhdr",
        "BallBinary30x30x30_byteskip_minus_one.nhdr",
        "BallBinary30x30x30_byteskip_minus_one_nifti.nhdr",
        "BallBinary30x30x30_gz.nrrd",
        "BallBinary30x30x30_gz_byteskip_minus_one.nrrd",
    ] {
        assert!(with(name).as_ref() == Ok(&ball), "{name}");
    }
    // The NIfTI file of the same image has a qform, in right-anterior-superior coordinates.
    let nifti = with("BallBinary30x30x30.nii.gz").unwrap();
    assert!(
        (nifti.axes, nifti.origin) == (ball.axes, ball.origin) && nifti.values == ball.values,
        "{:?}",
        nifti.axes
    );
    // Its `byte skip` is commented out, so the NIfTI header would be read as samples.
    refused(
        with("BallBinary30x30x30_nifti.nhdr"),
        &["BallBinary30x30x30.nii.gz", "more than the 54000 bytes"],
    );
    refused(
        with("BallBinary30x30x30_bz2.nrrd"),
        &["`encoding` is `bzip2`"],
    );
    refused(with("test1d_ascii.nrrd"), &["`dimension` is 1"]);
    let one = with("test_simple4d_raw.nrrd").unwrap();
    assert_eq!((one.size, one.axes), ([1; 3], diagonal([1.5, 1.5, 1.0])));
    for entry in fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        let outcome = read(&path).map(|volume| format!("{:?} {:?}", volume.size, range(&volume)));
        println!(
            "{}: {outcome:?}",
            path.file_name().unwrap_or_default().display()
        );
    }
}

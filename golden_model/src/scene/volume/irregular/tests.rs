//! Tests: irregular grids and points of every kind and encoding, written into small files and read
//! back; and broken files.

use super::*;
use crate::scene::cells::{Cells, Sampled};
use crate::scene::memory;
use crate::scene::voxels::{Classification, TransferPoint};
use base64::Engine;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use proptest::prelude::*;
use std::io::Write;

/// Encoding of an array.
#[derive(Clone, Copy, Debug, PartialEq)]
enum ArrayEncoding {
    Ascii,
    Binary,
    AppendedRaw,
    AppendedBase64,
}

use ArrayEncoding::{AppendedBase64, AppendedRaw, Ascii, Binary};

/// A file while it is written: tags, and appended data.
struct Writer {
    encoding: ArrayEncoding,
    packed: bool,
    big: bool,
    appended: Vec<u8>,
}

impl Writer {
    fn block(&self, bytes: &[u8]) -> [Vec<u8>; 2] {
        let word = |value: usize| {
            let bytes = (value as u64).to_le_bytes();
            if self.big {
                bytes.into_iter().rev().collect::<Vec<u8>>()
            } else {
                bytes.to_vec()
            }
        };
        if !self.packed {
            return [word(bytes.len()), bytes.to_vec()];
        }
        let parts: Vec<Vec<u8>> = bytes
            .chunks(32)
            .map(|part| {
                let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
                encoder.write_all(part).unwrap();
                encoder.finish().unwrap()
            })
            .collect();
        let lengths = [parts.len(), 32, bytes.len() % 32]
            .into_iter()
            .chain(parts.iter().map(Vec::len));
        [lengths.flat_map(word).collect(), parts.concat()]
    }

    fn array(&mut self, name: &str, components: usize, values: &[f64]) -> String {
        let bytes: Vec<u8> = values
            .iter()
            .flat_map(|v| {
                if self.big {
                    v.to_be_bytes()
                } else {
                    v.to_le_bytes()
                }
            })
            .collect();
        let head = format!(
            "<DataArray type=\"Float64\" Name=\"{name}\" NumberOfComponents=\"{components}\""
        );
        let encode = |bytes: &[u8]| base64::engine::general_purpose::STANDARD.encode(bytes);
        let [lengths, block] = self.block(&bytes);
        match self.encoding {
            Ascii => {
                let text: Vec<String> = values.iter().map(|v| format!("{v:?}")).collect();
                format!("{head} format=\"ascii\">\n{}\n</DataArray>", text.join(" "))
            }
            Binary => format!(
                "{head} format=\"binary\"> {}{} </DataArray>",
                encode(&lengths),
                encode(&block)
            ),
            AppendedRaw | AppendedBase64 => {
                let offset = self.appended.len();
                if self.encoding == AppendedRaw {
                    self.appended.extend([lengths, block].concat());
                } else {
                    self.appended
                        .extend((encode(&lengths) + &encode(&block)).into_bytes());
                }
                format!("{head} format=\"appended\" offset=\"{offset}\"/>")
            }
        }
    }

    fn file(self, set: &str, whole: &str, piece: &str, inside: &str) -> Vec<u8> {
        let compressor = if self.packed {
            " compressor=\"vtkZLibDataCompressor\""
        } else {
            ""
        };
        let order = if self.big {
            "BigEndian"
        } else {
            "LittleEndian"
        };
        let mut file = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"{set}\" version=\"1.0\" byte_order=\"{order}\" header_type=\"UInt64\"{compressor}>\n\
             <{set} {whole}><Piece {piece}>\n{inside}\n</Piece></{set}>\n"
        )
        .into_bytes();
        if !self.appended.is_empty() {
            let encoding = if self.encoding == AppendedRaw {
                "raw"
            } else {
                "base64"
            };
            file.extend(format!("<AppendedData encoding=\"{encoding}\">\n_").into_bytes());
            file.extend(self.appended);
            file.extend(b"\n</AppendedData>");
        }
        file.extend(b"</VTKFile>\n");
        file
    }
}

const SIZE: [usize; 3] = [3, 2, 2];
const X: [f64; 3] = [0.5, 1.5, 4.0];
const Y: [f64; 2] = [-1.0, 1.0 / 3.0];
const Z: [f64; 2] = [7.0, 5.0];

fn values() -> Vec<f64> {
    (0..12).map(|i| f64::from(i) - 2.5).collect()
}

fn points() -> Vec<f64> {
    (0..12)
        .flat_map(|i| [i % 3, i / 3 % 2, i / 6].map(|at| f64::from(at) + 0.1 * f64::from(i)))
        .collect()
}

/// Extension, reader and valid file of each kind.
type Read = fn(&[u8], &Arrays) -> Parsed<Irregular>;
const KINDS: [(&str, Read); 4] = [
    ("RectilinearGrid", read_rectilinear),
    ("StructuredGrid", read_curvilinear),
    ("UnstructuredGrid", read_unstructured),
    ("PolyData", read_poly_data),
];

fn written(set: &str, encoding: ArrayEncoding, packed: bool, big: bool) -> Vec<u8> {
    let mut writer = Writer {
        encoding,
        packed,
        big,
        appended: Vec::new(),
    };
    let other = writer.array("other", 1, &[0.0; 12]);
    let mine = writer.array("mine", 1, &values());
    let width = writer.array("width", 1, &values().map(|v| v + 3.0));
    let data = format!("<PointData Scalars=\"mine\">{other}{mine}{width}</PointData>\n<CellData/>");
    let cells = "<Cells><DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">0 1 2</DataArray></Cells>";
    if set == "RectilinearGrid" {
        let axes = [&X[..], &Y, &Z].map(|axis| writer.array("axis", 1, axis));
        let inside = format!("{data}<Coordinates>{}</Coordinates>", axes.concat());
        return writer.file(
            set,
            "WholeExtent=\"0 2 0 1 4 5\"",
            "Extent=\"0 2 0 1 4 5\"",
            &inside,
        );
    }
    let inside = format!(
        "{data}<Points>{}</Points>{cells}",
        writer.array("Points", 3, &points())
    );
    if set == "StructuredGrid" {
        return writer.file(
            set,
            "WholeExtent=\"0 2 0 1 0 1\"",
            "Extent=\"0 2 0 1 0 1\"",
            &inside,
        );
    }
    writer.file(
        set,
        "",
        "NumberOfPoints=\"12\" NumberOfCells=\"1\"",
        &inside,
    )
}

trait Map {
    fn map(&self, change: impl Fn(f64) -> f64) -> Vec<f64>;
}

impl Map for Vec<f64> {
    fn map(&self, change: impl Fn(f64) -> f64) -> Vec<f64> {
        self.iter().map(|value| change(*value)).collect()
    }
}

#[test]
fn every_kind_and_encoding_is_read_to_the_last_bit() {
    for ((set, read), encoding) in KINDS
        .into_iter()
        .flat_map(|kind| [Ascii, Binary, AppendedRaw, AppendedBase64].map(|e| (kind, e)))
    {
        for (packed, big) in [(false, false), (true, false), (false, true), (true, true)] {
            let case = format!("{set} {encoding:?} {packed} {big}");
            let field =
                read(&written(set, encoding, packed, big), &Arrays::default()).expect(&case);
            assert_eq!(
                field.values,
                values().iter().map(|v| *v as f32).collect::<Vec<_>>(),
                "{case}"
            );
            let all: Vec<DVec3> = points()
                .as_chunks()
                .0
                .iter()
                .copied()
                .map(DVec3::from_array)
                .collect();
            let expected = match set {
                "RectilinearGrid" => {
                    SamplePlaces::Rectilinear([X.to_vec(), Y.to_vec(), Z.to_vec()])
                }
                "StructuredGrid" => SamplePlaces::Curvilinear(SIZE, all),
                _ => SamplePlaces::Scattered(all, None),
            };
            assert_eq!(field.places, expected, "{case}");
        }
    }
}

/// ParaView adds the length of vectors inside their array.
#[test]
fn information_inside_an_array_does_not_end_the_list_of_arrays() {
    for (set, read) in KINDS {
        let text = String::from_utf8(written(set, Ascii, false, false)).unwrap();
        let key = "<InformationKey name=\"L2_NORM_RANGE\" location=\"vtkDataArray\" length=\"2\">\n<Value index=\"0\">\n0.5\n</Value>\n\
            <Value index=\"1\">\n9\n</Value>\n</InformationKey>\n";
        let numbers = ["1.0"; 36].join(" ");
        let vectors = format!(
            "<DataArray type=\"Float64\" Name=\"flow\" NumberOfComponents=\"3\" format=\"ascii\">\n{numbers}\n{key}</DataArray>"
        );
        let expected = read(text.as_bytes(), &Arrays::default()).unwrap();
        for scalars in [
            "<PointData Scalars=\"mine\">",
            "<PointData Vectors=\"flow\">",
            "<PointData Scalars=\"\">",
        ] {
            let changed = text.replace(
                "<PointData Scalars=\"mine\">",
                &format!("{scalars}{vectors}"),
            );
            let changed = if set == "RectilinearGrid" {
                changed
            } else {
                changed.replace(
                    "\n</DataArray></Points>",
                    &format!("\n{key}</DataArray></Points>"),
                )
            };
            let field = read(changed.as_bytes(), &Arrays::default()).expect(set);
            assert_eq!(field.places, expected.places, "{set}");
            assert_eq!(
                field.values.iter().all(|value| *value == 0.0),
                !scalars.contains("mine"),
                "{set} {scalars}"
            );
        }
    }
}

/// A header that requires more memory than available is refused before unpacking.
#[test]
fn a_small_file_cannot_demand_more_memory_than_there_is() {
    let count: u64 = 700_000_000;
    let lengths: Vec<u8> = [1, 3 * 8 * count, 0, 11]
        .into_iter()
        .flat_map(u64::to_le_bytes)
        .collect();
    let mut writer = Writer {
        encoding: AppendedRaw,
        packed: true,
        big: false,
        appended: Vec::new(),
    };
    let points = writer.array("points", 3, &[]);
    writer.appended = [lengths, vec![0; 11]].concat();
    let values = "<DataArray type=\"Float64\" Name=\"v\" format=\"ascii\">1</DataArray>";
    let inside = format!("<PointData>{values}</PointData><Points>{points}</Points>");
    let file = writer.file(
        "PolyData",
        "",
        &format!("NumberOfPoints=\"{count}\""),
        &inside,
    );
    let words = match memory::check(3 * count, "packed numbers", 32) {
        Err(sentence) => sentence,
        Ok(()) => "the compressed data is broken".into(),
    };
    let until = words.rfind(" of memory").unwrap_or(words.len());
    refused(
        read_poly_data(&file, &Arrays::default()),
        &["array `points`", &words[..until]],
    );
}

#[test]
fn arrays_are_found_by_their_names() {
    for (set, read) in KINDS {
        let file = written(set, AppendedRaw, true, false);
        let other = read(
            &file,
            &Arrays {
                values: Some("other"),
                variance: None,
            },
        )
        .unwrap();
        assert_eq!(other.values, [0.0; 12]);
        refused(
            read(
                &file,
                &Arrays {
                    values: Some("wind"),
                    variance: None,
                },
            ),
            &["no array `wind`", "other, mine, width"],
        );
        let variances = read(
            &file,
            &Arrays {
                values: None,
                variance: Some("width"),
            },
        );
        match set {
            "RectilinearGrid" | "StructuredGrid" => {
                refused(variances, &["`variance` is of points"])
            }
            _ => {
                let SamplePlaces::Scattered(_, Some(variances)) = variances.unwrap().places else {
                    panic!("{set}")
                };
                assert_eq!(variances[3], [3.5, 3.5, 3.5, 0.0, 0.0, 0.0]);
                refused(
                    read(
                        &file,
                        &Arrays {
                            values: None,
                            variance: Some("mine"),
                        },
                    ),
                    &["point 0 is [-2.5]", "above 0"],
                );
            }
        }
    }
}

#[test]
fn variances_have_one_three_or_six_components_and_are_positive() {
    let with = |components: usize, variance: &[f64]| -> Parsed<[f64; 6]> {
        let mut writer = Writer {
            encoding: Ascii,
            packed: false,
            big: false,
            appended: Vec::new(),
        };
        let arrays = writer.array("v", 1, &[1.0]) + &writer.array("w", components, variance);
        let inside = format!(
            "<PointData>{arrays}</PointData><Points>{}</Points>",
            writer.array("p", 3, &[0.0; 3])
        );
        let file = writer.file("PolyData", "", "NumberOfPoints=\"1\"", &inside);
        match read_poly_data(
            &file,
            &Arrays {
                values: None,
                variance: Some("w"),
            },
        )?
        .places
        {
            SamplePlaces::Scattered(_, Some(variances)) => Ok(variances[0]),
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(
        with(3, &[1.0, 2.0, 3.0]).unwrap(),
        [1.0, 2.0, 3.0, 0.0, 0.0, 0.0]
    );
    assert_eq!(
        with(6, &[2.0, 2.0, 2.0, 1.0, -1.0, 0.5]).unwrap(),
        [2.0, 2.0, 2.0, 1.0, -1.0, 0.5]
    );
    for flat in [
        &[1.0, 1.0, 1.0, 1.0, 0.0, 0.0][..],
        &[1.0, 0.0, 1.0, 0.0, 0.0, 0.0],
        &[1.0, 1.0, 1.0, 0.0, 2.0, 0.0],
    ] {
        assert!(
            with(6, flat)
                .unwrap_err()
                .contains("above 0 in all directions"),
            "{flat:?}"
        );
    }
    assert!(
        with(2, &[1.0, 1.0])
            .unwrap_err()
            .contains("`NumberOfComponents` is `2`")
    );
}

#[track_caller]
fn refused(result: Parsed<Irregular>, words: &[&str]) {
    let sentence = result.expect_err("was read");
    for word in words {
        assert!(sentence.contains(word), "`{word}` is not in: {sentence}");
    }
    assert!(
        !sentence.contains('\n') && sentence.len() < 400,
        "{sentence}"
    );
}

/// The ASCII file of a kind with one word changed, read.
fn with(set: &str, from: &str, to: &str) -> Parsed<Irregular> {
    let text = String::from_utf8(written(set, Ascii, false, false)).unwrap();
    assert!(text.contains(from), "{from}");
    let read = KINDS.iter().find(|(name, _)| *name == set).unwrap().1;
    read(text.replacen(from, to, 1).as_bytes(), &Arrays::default())
}

#[test]
fn a_broken_file_ends_in_a_sentence() {
    for (set, _) in KINDS {
        assert!(with(set, set, set).is_ok());
        refused(with(set, "<VTKFile", "<svg"), &["no <VTKFile>"]);
        refused(
            with(set, &format!("type=\"{set}\""), "type=\"ImageData\""),
            &["ImageData", &format!("only {set}")],
        );
        refused(
            with(set, "</Piece>", "</Piece><Piece>"),
            &["several pieces"],
        );
        refused(with(set, "<PointData", "<PointDate"), &["<PointData>"]);
        refused(
            with(set, "-2.5", "inf"),
            &[
                "array `mine`: sample (0, 0, 0) is inf",
                "or NaN where there is none",
            ],
        );
        assert!(with(set, "-2.5", "NaN").unwrap().values[0].is_nan());
        refused(with(set, "-2.5", "1e39"), &["inf", "32-bit"]);
        refused(with(set, "-2.5", "x"), &["`x` is not a number"]);
        refused(with(set, "8.5", ""), &["11 numbers"]);
        refused(
            with(set, "8.5", "8.5 9.5"),
            &["array `mine`: there are more numbers than the 12 of"],
        );
        refused(
            with(set, "Scalars=\"mine\"", "Scalars=\"ghost\""),
            &[
                "`Scalars` of <PointData>: has no array `ghost`",
                "other, mine, width",
            ],
        );
        refused(
            with(
                set,
                "Name=\"mine\" NumberOfComponents=\"1\"",
                "Name=\"mine\" NumberOfComponents=\"2\"",
            ),
            &["`2`", "1 component"],
        );
    }
    let rectilinear = |from, to| with("RectilinearGrid", from, to);
    refused(
        rectilinear("0.5 1.5 4.0", "0.5 1.5 1.5"),
        &["array `axis`", "ascend"],
    );
    refused(rectilinear("0.5 1.5 4.0", "0.5 1.5"), &["2 numbers"]);
    refused(rectilinear("0.5 1.5 4.0", "0.5 1.5 NaN"), &["NaN"]);
    refused(rectilinear("0.5 1.5 4.0", "0.5 1.5 1e31"), &["1e31"]);
    refused(
        rectilinear("<Coordinates>", "<Coordinates><DataArray/>"),
        &["4 arrays"],
    );
    refused(
        rectilinear("\"0 2 0 1 4 5\"", "\"0 2 0 1 4 6\""),
        &["`Extent`", "same"],
    );
    let curvilinear = |from, to| with("StructuredGrid", from, to);
    refused(
        curvilinear("<Points>", "<Pints>"),
        &["no <DataArray> in <Points>"],
    );
    refused(
        curvilinear("NumberOfComponents=\"3\"", "NumberOfComponents=\"2\""),
        &["points have 3"],
    );
    refused(
        curvilinear("0.0 0.0 0.0 1.1", "0.0 inf 0.0 1.1"),
        &["array `Points`", "inf"],
    );
    for set in ["UnstructuredGrid", "PolyData"] {
        refused(
            with(set, "NumberOfPoints=\"12\"", "NumberOfPoints=\"-1\""),
            &["`NumberOfPoints` is `-1`"],
        );
        refused(
            with(set, "NumberOfPoints=\"12\"", "NumberOfPoints=\"0\""),
            &["at least one"],
        );
        refused(
            with(set, "NumberOfPoints=\"12\"", "NumberOfPoints=\"13\""),
            &["36 numbers", "39"],
        );
        refused(
            with(
                set,
                "NumberOfPoints=\"12\"",
                "NumberOfPoints=\"99999999999999\"",
            ),
            &["at most"],
        );
        refused(
            with(
                set,
                "NumberOfPoints=\"12\"",
                "NumberOfPoints=\"2000000000\"",
            ),
            &["at most"],
        );
        refused(
            with(set, "NumberOfPoints=\"12\"", "Points=\"12\""),
            &["no attribute `NumberOfPoints`"],
        );
    }
}

/// The samples of a field give splats of finite numbers, for any positions.
fn check_samples(field: &Irregular) {
    let point = |value, depth| TransferPoint {
        value,
        rgb: [1.0; 3],
        depth,
    };
    let gradient = vec![[0.0, 0.5], [1.0, 1.0]];
    let classification = Classification {
        transfer: vec![point(-3.0, 0.1), point(9.0, 1.0)],
        gradient,
        radius: 0.7,
        material: 0,
    };
    let cells = Cells::new(field, classification.radius);
    let layer = cells.default_layer().unwrap_or(1.0);
    let (
        Sampled {
            splats,
            orientations,
            ..
        },
        flat,
    ) = cells.samples(&classification, layer);
    assert!(
        layer > 0.0
            && splats.len() == orientations.len()
            && splats.len() + flat <= field.values.len()
    );
    for (splat, orientation) in splats.iter().zip(orientations) {
        assert!(
            splat.position.is_finite()
                && splat.normal.is_finite()
                && splat.radius > 0.0
                && splat.radius.is_finite(),
            "{splat:?}"
        );
        assert!(
            splat.opacity > 0.0
                && !splat.opacity.is_nan()
                && orientation.scales.min_element() > 0.0,
            "{splat:?} {orientation:?}"
        );
        assert!(
            orientation.rotation.is_normalized() && orientation.scales.max_element() <= 1.0,
            "{orientation:?}"
        );
    }
}

proptest! {
    /// A file with a few changed bytes is read, or gives a sentence.
    #[test]
    fn changed_bytes_never_panic(
        kind in 0..4_usize,
        encoding in prop::sample::select(vec![Ascii, Binary, AppendedRaw, AppendedBase64]),
        packed: bool,
        changes in prop::collection::vec((any::<prop::sample::Index>(), prop::sample::select(b"09-.<>\"/= eN\0\xff".to_vec())), 1..8),
        cut in prop::option::of(any::<prop::sample::Index>()),
        variance: bool,
    ) {
        let (set, read) = KINDS[kind];
        let mut file = written(set, encoding, packed, false);
        for (at, byte) in changes {
            let at = at.index(file.len());
            file[at] = byte;
        }
        if let Some(cut) = cut {
            file.truncate(cut.index(file.len()));
        }
        match read(&file, &Arrays { values: None, variance: variance.then_some("width") }) {
            Ok(field) => {
                prop_assert!(field.values.iter().all(|v| v.is_finite()) && !field.values.is_empty());
                check_samples(&field);
            }
            Err(sentence) => prop_assert!(!sentence.contains('\n') && sentence.len() < 400, "{sentence}"),
        }
    }
}

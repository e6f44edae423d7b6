//! Are files of other programs read with their intended meaning, and are ambiguities reported in a
//! note?
//!
//! Files are generated here byte by byte; those of `outside/` were written by the programs
//! themselves.

use crate::program::PROGRAM;
use crate::shared_input;
use assert_cmd::Command;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::{DQuat, DVec3};
use serde_json::{Value, json};
use splatsim::golden::{Rules, render};
use splatsim::hardware::quantise::quantise;
use splatsim::hardware::{fixed, machines};
use splatsim::scene::mesh::Mesh;
use splatsim::scene::{Overrides, Scene};
use std::io::Cursor;
use tempfile::TempDir;

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

fn write(folder: &TempDir, name: &str, bytes: impl AsRef<[u8]>) -> String {
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    path.to_str().unwrap().to_owned()
}

fn load(folder: &TempDir, name: &str, bytes: impl AsRef<[u8]>) -> Scene {
    Scene::load(write(folder, name, bytes), &Overrides::default()).unwrap()
}

/// The single sentence of a refusal, by `run` or by `sample`.
#[track_caller]
fn refused(command: &str, path: &str) -> String {
    let more = if command == "sample" {
        ["--points", "9", "--out", "never.ply"].as_slice()
    } else {
        &[]
    };
    let output = Command::new(PROGRAM.as_str())
        .arg(command)
        .arg(path)
        .args(more)
        .output()
        .unwrap();
    let sentence = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(
        (output.status.code(), output.stdout.len()),
        (Some(2), 0),
        "{command} {path}: {sentence}"
    );
    assert!(
        sentence.trim_end().lines().count() == 1 && sentence.len() < 700,
        "{sentence}"
    );
    sentence.trim_end().to_owned()
}

// ---- colours of PLY files ----

/// Linear light of an sRGB code in [0, 1]: a second implementation of the definition (IEC
/// 61966-2-1).
fn light(code: f64) -> f64 {
    if code <= 0.04045 {
        code / 12.92
    } else {
        ((code + 0.055) / 1.055).powf(2.4)
    }
}

/// A text PLY of a point cloud; the colour of each row follows its position.
fn cloud(properties: &[&str], rows: &[&str]) -> String {
    let colours: String = properties
        .iter()
        .map(|property| format!("property {property}\n"))
        .collect();
    let rows: String = rows
        .iter()
        .enumerate()
        .map(|(i, row)| format!("{i} 0 0 {row}\n"))
        .collect();
    format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n{colours}end_header\n{rows}",
        rows.lines().count()
    )
}

/// The code 200 100 50 in each notation, and whether a note must state the assumption.
#[test]
fn colours_of_a_ply_are_those_of_viewers_for_all_types_and_names() {
    let folder = folder();
    let rgb = |kind: &str, names: [&str; 3]| names.map(|name| format!("{kind} {name}"));
    let names = ["red", "green", "blue"];
    for (properties, row, is_noted) in [
        (rgb("uchar", names), "200 100 50", false),
        (rgb("uint8", ["r", "g", "b"]), "200 100 50", false),
        (rgb("uchar", ["R", "G", "B"]), "200 100 50", false),
        (rgb("uchar", ["Red", "Green", "Blue"]), "200 100 50", false),
        (
            rgb("uchar", ["diffuse_red", "diffuse_green", "diffuse_blue"]),
            "200 100 50",
            false,
        ),
        (
            rgb("uchar", ["diffuse_r", "diffuse_g", "diffuse_b"]),
            "200 100 50",
            false,
        ),
        (
            rgb("float", ["scalar_red", "scalar_green", "scalar_blue"]),
            "200 100 50",
            true,
        ),
        (rgb("int", names), "200 100 50", false),
        (rgb("ushort", names), "200 100 50", true),
        (rgb("ushort", names), "51400 25700 12850", false),
        (rgb("uint", names), "51400 25700 12850", true),
        (rgb("float", names), "200 100 50", true),
        (rgb("double", ["r", "g", "b"]), "200 100 50", true),
        (rgb("float", names), "0.784314 0.392157 0.196078", true),
        (
            rgb("double", ["diffuse_red", "diffuse_green", "diffuse_blue"]),
            "0.784314 0.392157 0.196078",
            true,
        ),
        (rgb("float", names), "51400 25700 12850", true),
    ] {
        let properties: Vec<&str> = properties.iter().map(String::as_str).collect();
        let file = cloud(&properties, &[row, row, row]);
        let scene = load(&folder, "a.ply", &file);
        for (read, code) in scene.splats[1].rgb.iter().zip([200.0, 100.0, 50.0]) {
            // NaN is not near either.
            assert!(
                (read - light(code / 255.0)).abs() <= 3e-6,
                "{properties:?} {row}: {:?}",
                scene.splats[1].rgb
            );
        }
        let notes = scene.notes.join("; ");
        assert_eq!(
            notes.contains("taken as sRGB codes"),
            is_noted,
            "{properties:?} {row}: {notes}"
        );
    }
}

/// The whole cloud determines full light: one bright point among dark ones is enough.
#[test]
fn the_brightest_point_determines_full_light() {
    let folder = folder();
    let properties = ["float red", "float green", "float blue"];
    let dark = load(
        &folder,
        "dark.ply",
        cloud(&properties, &["0.5 0.25 0", "0.5 0.25 0", "0.5 0.25 0"]),
    );
    let bright = load(
        &folder,
        "bright.ply",
        cloud(&properties, &["0.5 0.25 0", "0.5 0.25 0", "255 0 0"]),
    );
    assert!((dark.splats[0].rgb[0] - light(0.5)).abs() < 1e-12);
    assert!((bright.splats[0].rgb[0] - light(0.5 / 255.0)).abs() < 1e-12);
    assert_eq!(bright.splats[2].rgb, [1.0, 0.0, 0.0]);
}

#[test]
fn unread_properties_that_look_like_colours_are_reported() {
    let folder = folder();
    for properties in [
        [
            "uchar specular_red",
            "uchar specular_green",
            "uchar specular_blue",
        ]
        .as_slice(),
        &["uint rgba"],
        &["uchar red"],
    ] {
        let row = vec!["200"; properties.len()].join(" ");
        let scene = load(&folder, "a.ply", cloud(properties, &[&row, &row, &row]));
        assert_eq!(scene.splats[0].rgb, [0.5; 3]);
        assert!(
            scene
                .notes
                .iter()
                .any(|note| note.contains("looks like a colour and is not read")),
            "{properties:?}: {:?}",
            scene.notes
        );
    }
    let both = cloud(
        &[
            "uchar red",
            "uchar green",
            "uchar blue",
            "uchar diffuse_red",
            "uchar diffuse_green",
            "uchar diffuse_blue",
        ],
        &["255 0 0 0 255 0"; 3],
    );
    let scene = load(&folder, "a.ply", both);
    assert_eq!(scene.splats[0].rgb, [1.0, 0.0, 0.0]);
    assert!(
        scene
            .notes
            .iter()
            .any(|note| note.contains("has several colours: red, green and blue are read")),
        "{:?}",
        scene.notes
    );
}

/// `sample` writes linear light in floats, with a comment that states it: the colours are read back
/// unchanged and without a note.
#[test]
fn points_of_sample_are_read_back_with_the_colours_that_were_sampled() {
    let folder = folder();
    let mesh = write(
        &folder,
        "quad.obj",
        "v 0 0 0 0.5 0.5 0.5\nv 2 0 0 0.5 0.5 0.5\nv 2 1 0 0.5 0.5 0.5\nf 1 2 3\n",
    );
    let out = folder.path().join("points.ply");
    let sample = [
        "sample",
        &mesh,
        "--points",
        "50",
        "--out",
        out.to_str().unwrap(),
    ];
    Command::new(PROGRAM.as_str())
        .args(sample)
        .assert()
        .success();
    let scene = Scene::load(&out, &Overrides::default()).unwrap();
    // Colours of an OBJ's vertices are sRGB codes.
    let expected = light(0.5);
    assert!(
        scene
            .splats
            .iter()
            .all(|splat| splat.rgb.iter().all(|c| (c - expected).abs() < 1e-6)),
        "{:?}",
        scene.splats[0].rgb
    );
    assert!(scene.notes.is_empty(), "{:?}", scene.notes);
}

#[test]
fn colours_of_three_programs_have_the_same_middle_pixel() {
    let Some(outside) = shared_input::find("outside/08-ply-colours") else {
        return;
    };
    let folder = folder();
    let files = std::fs::read_dir(&outside)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let files: Vec<_> = files
        .filter(|path| path.extension().is_some_and(|end| end == "ply"))
        .collect();
    assert!(files.len() >= 3);
    for file in files {
        let mut scene: Value =
            serde_json::from_slice(&std::fs::read(outside.join("scene.json")).unwrap()).unwrap();
        scene["splats"]["file"] = json!(std::fs::canonicalize(&file).unwrap());
        let scene = write(&folder, "scene.json", scene.to_string());
        let out = folder.path().join("out");
        Command::new(PROGRAM.as_str())
            .args([
                "run",
                &scene,
                "--quiet",
                "--check",
                "none",
                "--out",
                out.to_str().unwrap(),
            ])
            .assert()
            .success();
        let picture = image::open(out.join("fixed.png")).unwrap().into_rgb8();
        let pixel = picture.get_pixel(16, 16).0;
        assert!(
            pixel
                .iter()
                .zip([200u8, 100, 50])
                .all(|(read, right)| read.abs_diff(right) <= 1),
            "{file:?}: {pixel:?}"
        );
    }
}

// ---- content and names ----

/// A few splats in a file of every format with a signature, and the proper extension of its name.
fn contents() -> Vec<(&'static str, Vec<u8>)> {
    let points = cloud(&["uchar red", "uchar green", "uchar blue"], &["1 2 3"; 4]).into_bytes();
    let gaussians = gaussian_ply(&[], 3).into_bytes();
    let nrrd = b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n\n\x00\x10\x20\x30\x40\x50\x60\x70".to_vec();
    let mha = b"ObjectType = Image\nNDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n\x00\x10\x20\x30\x40\x50\x60\x70".to_vec();
    let vti = b"<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"0.1\" byte_order=\"LittleEndian\"><ImageData WholeExtent=\"0 1 0 1 0 1\" Origin=\"0 0 0\" Spacing=\"1 1 1\"><Piece Extent=\"0 1 0 1 0 1\"><PointData Scalars=\"s\"><DataArray type=\"UInt8\" Name=\"s\" format=\"ascii\">0 16 32 48 64 80 96 112</DataArray></PointData></Piece></ImageData></VTKFile>".to_vec();
    vec![
        (".ply", points),
        (".ply", gaussians),
        (".nrrd", nrrd),
        (".mha", mha),
        (".vti", vti),
        (".nii", nifti()),
        (".spz", spz(3, 0, &[0; 20])),
        (".spz", spz_of_tables(&spz(3, 0, &[0; 20])[16..], 1, 0)),
        (
            ".glb",
            glb(
                &gaussian_gltf(&json!({}), 1).0,
                &gaussian_gltf(&json!({}), 1).1,
            ),
        ),
        (
            ".json",
            br#"{"splats": [{"position": [0, 0, 0], "normal": [0, 0, 1], "radius": 0.5}]}"#
                .to_vec(),
        ),
    ]
}

/// A volume of 2×2×2 bytes.
fn nifti() -> Vec<u8> {
    let mut file = vec![0; 352];
    file[0..4].copy_from_slice(&348i32.to_le_bytes());
    for (i, size) in [3i16, 2, 2, 2, 1, 1, 1, 1].into_iter().enumerate() {
        file[40 + 2 * i..42 + 2 * i].copy_from_slice(&size.to_le_bytes());
    }
    file[70..72].copy_from_slice(&2i16.to_le_bytes());
    file[72..74].copy_from_slice(&8i16.to_le_bytes());
    (0..4).for_each(|i| file[76 + 4 * i..80 + 4 * i].copy_from_slice(&1f32.to_le_bytes()));
    file[108..112].copy_from_slice(&352f32.to_le_bytes());
    file[344..348].copy_from_slice(b"n+1\0");
    file.extend((0..8).map(|i| i * 16));
    file
}

#[test]
fn the_content_determines_the_format_for_any_name() {
    let folder = folder();
    let ends = [
        ".ply", ".splat", ".spz", ".tree", ".nrrd", ".mha", ".mhd", ".nii", ".nii.gz", ".vti",
        ".vtu", ".glb", ".gltf", ".json", ".obj", ".xyz", ".las", ".SPLAT",
    ];
    for (own, bytes) in contents() {
        let right = load(&folder, &format!("right{own}"), &bytes);
        assert!(
            !right.notes.iter().any(|note| note.contains("by its name")),
            "{own}: {:?}",
            right.notes
        );
        for end in ends {
            let name = format!("wrong{end}");
            let scene = load(&folder, &name, &bytes);
            assert_eq!(scene.splats, right.splats, "{own} as {end}");
            let told = scene
                .notes
                .iter()
                .any(|note| note.contains("by its content"));
            let same = [own, end].iter().all(|end| [".mha", ".mhd"].contains(end))
                || [own, end]
                    .iter()
                    .all(|end| [".nii", ".nii.gz"].contains(end))
                || [own, end].iter().all(|end| [".glb", ".gltf"].contains(end));
            assert_eq!(
                told,
                !(own == end || same),
                "{own} as {end}: {:?}",
                scene.notes
            );
        }
        // The same in a scene file.
        if own != ".json" {
            write(&folder, "inside.SPLAT", &bytes);
            let scene = load(
                &folder,
                "scene.json",
                r#"{"splats": {"file": "inside.SPLAT"}}"#,
            );
            assert_eq!(scene.splats.len(), right.splats.len(), "{own}");
            assert!(
                scene
                    .notes
                    .iter()
                    .any(|note| note.contains("by its content")),
                "{own}: {:?}",
                scene.notes
            );
        }
    }
}

#[test]
fn a_mesh_is_read_by_its_content_and_a_run_points_to_sample() {
    let folder = folder();
    let obj = "# a triangle\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let stl = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n";
    let mut binary = [vec![b's'; 80], 1u32.to_le_bytes().to_vec(), vec![0; 12]].concat();
    binary.extend(
        [0f32, 0., 0., 1., 0., 0., 0., 1., 0.]
            .iter()
            .flat_map(|c| c.to_le_bytes()),
    );
    binary.extend([0; 2]);
    let gltf = triangle_gltf(&json!({})).to_string();
    for (own, bytes) in [
        (".obj", obj.as_bytes()),
        (".ply", ply.as_bytes()),
        (".stl", stl.as_bytes()),
        (".stl", &binary),
        (".gltf", gltf.as_bytes()),
    ] {
        for end in [
            ".obj", ".ply", ".stl", ".gltf", ".glb", ".splat", ".xyz", ".mesh",
        ] {
            let mesh = Mesh::load(write(&folder, &format!("mesh{end}"), bytes)).unwrap();
            assert_eq!(mesh.triangles.len(), 1, "{own} as {end}");
            assert!((mesh.triangles[0].twice_area().length() - 1.0).abs() < 1e-12);
            let told = mesh
                .notes
                .iter()
                .any(|note| note.contains("by its content"));
            let is_same = own == end || end == ".mesh" || own == ".gltf" && end == ".glb";
            assert_eq!(told, !is_same, "{own} as {end}: {:?}", mesh.notes);
        }
        if own != ".ply" {
            for end in [own, ".splat", ".nrrd"] {
                let sentence = refused("run", &write(&folder, &format!("mesh{end}"), bytes));
                assert!(
                    sentence.contains("`splatsim sample`"),
                    "{own} as {end}: {sentence}"
                );
            }
        }
    }
    // A volume cannot be used as a mesh, nor a mesh as a volume.
    let sentence = refused("sample", &write(&folder, "v.obj", nifti()));
    assert!(
        sentence.contains("is a NIfTI-1 file by its content, which holds no triangles"),
        "{sentence}"
    );
    write(&folder, "cloud.nrrd", cloud(&[], &["", "", ""]));
    let sentence = refused(
        "run",
        &write(
            &folder,
            "scene.json",
            r#"{"splats": {"volume": "cloud.nrrd"}}"#,
        ),
    );
    assert!(
        sentence.contains("cloud.nrrd: is a PLY file by its content, which holds no volume"),
        "{sentence}"
    );
}

#[test]
fn files_that_are_not_read_are_refused_with_a_program_that_converts_them() {
    let folder = folder();
    for (name, bytes, advice) in [
        (
            "a.sog",
            b"PK\x03\x04rest".as_slice(),
            "splat-transform writes it as .ply",
        ),
        ("b.ksplat", b"\0\0\0\0", "splat-transform writes it as .ply"),
        ("c.las", b"LASF\0\0", "pdal translate IN OUT.ply"),
        ("d.laz", b"", "pdal translate IN OUT.ply"),
        ("las.ply", b"LASF\0\0", "pdal translate IN OUT.ply"),
        ("e.pcd", b"# .PCD v0.7", "pcl_pcd2ply"),
        ("f.xyz", b"0 0 0\n", "CloudCompare writes it as .ply"),
        (
            "g.vtk",
            b"# vtk DataFile Version 3.0\n",
            "ParaView writes it",
        ),
        (
            "h.fbx",
            b"Kaydara FBX Binary  \0",
            "from which `splatsim sample` makes points",
        ),
    ] {
        let path = write(&folder, name, bytes);
        let bare = refused("run", &path);
        let inside = refused(
            "run",
            &write(
                &folder,
                "scene.json",
                json!({"splats": {"file": name}}).to_string(),
            ),
        );
        for sentence in [&bare, &inside] {
            assert!(
                sentence.contains("which is not read") && sentence.contains(advice),
                "{name}: {sentence}"
            );
            assert!(
                sentence.contains("points (.ply, .tree), Gaussians (.ply, .splat, .spz, .gltf, .glb), a volume (.nrrd"),
                "{name}: {sentence}"
            );
        }
    }
    let unknown = write(&folder, "a.odd", "odd");
    write(&folder, "scene.json", r#"{"splats": {"file": "a.odd"}}"#);
    for path in [
        unknown,
        folder
            .path()
            .join("scene.json")
            .to_str()
            .unwrap()
            .to_owned(),
    ] {
        assert!(
            refused("run", &path)
                .contains("is of no known kind; a scene is a .json file, points (.ply, .tree)")
        );
    }
}

#[test]
fn a_ply_of_gaussians_named_splat_is_read_as_a_ply() {
    let Some(file) = shared_input::find("outside/18-ply-named-splat/renamed.splat") else {
        return;
    };
    let scene = Scene::load(&file, &Overrides::default()).unwrap();
    assert_eq!(scene.splats.len(), 40);
    assert!(
        scene.notes.iter().any(
            |note| note.contains("is a PLY file by its content, and a .splat file by its name")
        ),
        "{:?}",
        scene.notes
    );
}

// ---- meshes ----

fn png(rgba: [u8; 4]) -> Vec<u8> {
    let mut bytes = Vec::new();
    image::RgbaImage::from_pixel(2, 2, image::Rgba(rgba))
        .write_to(&mut Cursor::new(&mut bytes), image::ImageFormat::Png)
        .unwrap();
    bytes
}

/// A square of one quadrilateral and one adjacent triangle, with these properties of faces and
/// these ends of their rows.
fn faces(comments: &str, vertex: [&str; 2], properties: &str, rows: [&str; 2]) -> String {
    let places = ["0 0 0", "1 0 0", "1 1 0", "0 1 0", "2 0 0"]
        .map(|place| format!("{place} {}\n", vertex[1]))
        .concat();
    format!(
        "ply\nformat ascii 1.0\n{comments}element vertex 5\nproperty float x\nproperty float y\nproperty float z\n{}element face 2\n\
         property list uchar int vertex_indices\n{properties}end_header\n{places}4 0 1 2 3 {}\n3 1 4 2 {}\n",
        vertex[0], rows[0], rows[1]
    )
}

#[test]
fn texture_coordinates_of_faces_are_those_of_their_corners() {
    let folder = folder();
    write(&folder, "first one.png", png([255, 0, 0, 255]));
    write(&folder, "second.png", png([0, 255, 0, 255]));
    let comments = "comment TextureFile first one.png\ncomment TextureFile second.png\n";
    let properties = "property list uchar float texcoord\nproperty int texnumber\n";
    let grey = [
        "property uchar red\nproperty uchar green\nproperty uchar blue\n",
        "192 192 192",
    ];
    let file = faces(
        comments,
        grey,
        properties,
        ["8 0 0 1 0 1 1 0 0.25 0", "6 0.5 0 1 0 0.5 1 1"],
    );
    let mesh = Mesh::load(write(&folder, "a.ply", file)).unwrap();
    let uv: Vec<_> = mesh
        .triangles
        .iter()
        .map(|triangle| triangle.uv.unwrap())
        .collect();
    // v increases upwards in the file and downwards in the picture.
    let expected = [
        [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]],
        [[0.0, 1.0], [1.0, 0.0], [0.0, 0.75]],
        [[0.5, 1.0], [1.0, 1.0], [0.5, 0.0]],
    ];
    assert_eq!(uv, expected);
    let texel = |triangle: usize| {
        let texture = mesh.materials[mesh.triangles[triangle].material as usize]
            .texture
            .unwrap();
        mesh.textures[texture].image.texels[0]
    };
    assert_eq!(
        [0, 1, 2].map(texel),
        [[255, 0, 0, 255], [255, 0, 0, 255], [0, 255, 0, 255]]
    );
    // The colour is that of the picture alone: MeshLab writes grey for vertices without a colour.
    assert!(
        mesh.triangles
            .iter()
            .all(|triangle| triangle.rgba == [[1.0; 4]; 3])
    );
    // A single picture needs no number, and a face may have no picture.
    let one = faces(
        "comment TextureFile second.png\n",
        ["", ""],
        "property list uchar float texcoord\n",
        ["8 0 0 1 0 1 1 0 1", "0"],
    );
    let mesh = Mesh::load(write(&folder, "b.ply", one)).unwrap();
    assert_eq!(
        mesh.triangles
            .iter()
            .map(|triangle| triangle.uv.is_some())
            .collect::<Vec<_>>(),
        [true, true, false]
    );
    assert!(
        mesh.materials[mesh.triangles[0].material as usize]
            .texture
            .is_some()
    );
    assert!(
        mesh.materials[mesh.triangles[2].material as usize]
            .texture
            .is_none()
    );
    for (file, sentence) in [
        (
            faces(
                comments,
                ["", ""],
                properties,
                ["8 0 0 1 0 1 1 0 1 0", "6 0 0 0 0 0 0 2"],
            ),
            "a face has the picture 2, and the header names 2",
        ),
        (
            faces(
                "comment TextureFile gone.png\n",
                ["", ""],
                properties,
                ["8 0 0 1 0 1 1 0 1 0", "0 0"],
            ),
            "`gone.png` cannot be read",
        ),
        (
            faces(
                "comment TextureFile ../second.png\n",
                ["", ""],
                properties,
                ["8 0 0 1 0 1 1 0 1 0", "0 0"],
            ),
            "leads out of the mesh's folder",
        ),
    ] {
        assert!(refused("sample", &write(&folder, "c.ply", file)).contains(sentence));
    }
    // Lists of another length are left out and counted.
    let odd = faces(
        "",
        ["", ""],
        "property list uchar float texcoord\n",
        ["2 0 0", "6 0 0 0 0 0 0"],
    );
    let mesh = Mesh::load(write(&folder, "d.ply", odd)).unwrap();
    assert!(
        mesh.triangles[0].uv.is_none()
            && mesh
                .notes
                .iter()
                .any(|note| note.starts_with("1 faces have texture coordinates")),
        "{:?}",
        mesh.notes
    );
}

#[test]
fn colours_of_faces_are_read_where_vertices_have_none() {
    let folder = folder();
    let properties =
        "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n";
    let rows = ["200 100 50 255", "0 255 0 51"];
    let vertices = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    let near = |rgba: [f32; 4], code: [f64; 3], alpha: f64| {
        let right = code.map(|code| light(code / 255.0));
        rgba[..3]
            .iter()
            .zip(right)
            .all(|(read, right)| (f64::from(*read) - right).abs() < 1e-6)
            && (f64::from(rgba[3]) - alpha).abs() < 1e-6
    };
    // Vertices without colours, and vertices that are all MeshLab's grey.
    for vertex in [["", ""], [vertices, "192 192 192"]] {
        let mesh =
            Mesh::load(write(&folder, "a.ply", faces("", vertex, properties, rows))).unwrap();
        let colours: Vec<_> = mesh
            .triangles
            .iter()
            .map(|triangle| triangle.rgba)
            .collect();
        assert!(
            colours[0]
                .iter()
                .chain(&colours[1])
                .all(|&rgba| near(rgba, [200.0, 100.0, 50.0], 1.0)),
            "{colours:?}"
        );
        assert!(
            colours[2]
                .iter()
                .all(|&rgba| near(rgba, [0.0, 255.0, 0.0], 0.2)),
            "{colours:?}"
        );
    }
    // Colours of corners, as MeshLab writes them.
    let wedges = faces(
        "",
        ["", ""],
        "property list uchar float color\n",
        ["12 1 0 0 0 1 0 0 0 1 1 1 1", "9 0 0 0 0 0 0 0 0 0"],
    );
    let mesh = Mesh::load(write(&folder, "b.ply", wedges)).unwrap();
    assert_eq!(
        mesh.triangles[1].rgba,
        [
            [1.0, 0.0, 0.0, 1.0],
            [0.0, 0.0, 1.0, 1.0],
            [1.0, 1.0, 1.0, 1.0]
        ]
    );
}

fn triangle_gltf(more: &Value) -> Value {
    let mut buffer: Vec<u8> = [0f32, 0., 0., 1., 0., 0., 0., 1., 0., 7., 8., 9.]
        .iter()
        .flat_map(|c| c.to_le_bytes())
        .collect();
    buffer.extend(
        [0i16, 0, 0, 0, 32767, 0, 0, 0, 0, 32767, 0, 0]
            .iter()
            .flat_map(|c| c.to_le_bytes()),
    );
    let mut document = json!({
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "buffers": [{"byteLength": buffer.len(), "uri": format!("data:application/octet-stream;base64,{}", STANDARD.encode(&buffer))}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 12}, {"buffer": 0, "byteOffset": 48, "byteLength": 24, "byteStride": 8}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5122, "normalized": true, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [32767, 32767, 0]}
        ]
    });
    for (path, value) in more.as_object().unwrap() {
        match document.pointer_mut(path) {
            Some(place) => *place = value.clone(),
            None => document[&path[1..]] = value.clone(),
        }
    }
    document
}

#[test]
fn gltf_of_other_programs_is_read_and_unknown_requirements_are_named() {
    let folder = folder();
    let area = |more: Value| {
        let mesh = Mesh::load(write(&folder, "a.gltf", triangle_gltf(&more).to_string())).unwrap();
        (mesh.triangles[0].twice_area().length() / 2.0, mesh.notes)
    };
    let own = json!({"/meshes/0/primitives/0/attributes": {"POSITION": 0, "_BATCHID": 1, "_FEATURE_ID_0": 1, "OTHER:THING": 1}});
    let quantised = json!({"/meshes/0/primitives/0/attributes": {"POSITION": 2}, "/extensionsUsed": ["KHR_mesh_quantization"],
        "/extensionsRequired": ["KHR_mesh_quantization"]});
    for more in [own, quantised] {
        let (area, notes) = area(more.clone());
        assert!(
            (area - 0.5).abs() < 1e-12 && notes.is_empty(),
            "{more}: {area} {notes:?}"
        );
    }
    let (_, notes) = area(
        json!({"/extensionsUsed": ["KHR_materials_unlit"], "/extensionsRequired": ["KHR_materials_unlit"]}),
    );
    assert!(
        notes[0].contains("requires the extension KHR_materials_unlit"),
        "{notes:?}"
    );
    for name in [
        "KHR_draco_mesh_compression",
        "EXT_meshopt_compression",
        "ACME_anything",
    ] {
        let path = write(
            &folder,
            "a.gltf",
            triangle_gltf(&json!({"/extensionsUsed": [name], "/extensionsRequired": [name]}))
                .to_string(),
        );
        let sentence = refused("sample", &path);
        assert!(
            sentence.contains(&format!("requires the extension {name}, which is not read"))
                && !sentence.contains("sound"),
            "{sentence}"
        );
    }
    let wild = write(
        &folder,
        "a.gltf",
        triangle_gltf(&json!({"/meshes/0/primitives/0/attributes": {"POSITION": 0, "_A": 99}}))
            .to_string(),
    );
    assert!(refused("sample", &wild).contains("an attribute names accessor 99 of 3"));
}

#[test]
fn text_stl_may_begin_with_blanks_and_be_in_either_case() {
    let folder = folder();
    let text = "solid a\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1 0 0\n   vertex 0 1e0 0\n  endloop\n endfacet\nendsolid a\n";
    for (i, text) in [
        text.to_owned(),
        text.to_uppercase(),
        format!(" \n\t{text}"),
        format!("\u{feff}{text}"),
        text.replace('\n', "\r\n"),
        text.replace('\n', "\r"),
        text.replacen("solid", "Solid", 1)
            .replace("facet", "Facet")
            .replace("vertex", "Vertex"),
    ]
    .into_iter()
    .enumerate()
    {
        let mesh =
            Mesh::load(write(&folder, "a.stl", &text)).unwrap_or_else(|e| panic!("{i}: {e}"));
        assert!(
            mesh.triangles.len() == 1
                && (mesh.triangles[0].twice_area().length() - 1.0).abs() < 1e-12,
            "{i}"
        );
    }
}

#[test]
fn meshes_of_other_programs_have_half_a_unit_of_area() {
    let Some(outside) = shared_input::find("outside") else {
        return;
    };
    let mut count = 0;
    for folder in ["05-gltf-attributes", "06-gltf-quantised", "07-stl-text"] {
        for entry in std::fs::read_dir(outside.join(folder)).unwrap() {
            let path = entry.unwrap().path();
            let is_mesh = path
                .extension()
                .is_some_and(|end| end == "stl" || end == "gltf");
            if !is_mesh || path.ends_with("khr-gaussian-splatting.gltf") {
                continue;
            }
            let mesh = Mesh::load(&path).unwrap();
            let area: f64 = mesh
                .triangles
                .iter()
                .map(|triangle| triangle.twice_area().length() / 2.0)
                .sum();
            assert!((area - 0.5).abs() < 1e-6, "{path:?}: {area}");
            count += 1;
        }
    }
    assert!(count >= 4, "{count}");
    let gaussians = outside.join("05-gltf-attributes/khr-gaussian-splatting.gltf");
    assert_eq!(
        Scene::load(&gaussians, &Overrides::default())
            .unwrap()
            .splats
            .len(),
        3
    );
    assert!(refused("sample", gaussians.to_str().unwrap()).contains("holds Gaussians"));
}

// ---- Gaussians ----

/// Gaussians as training programs write them, without the named properties.
fn gaussian_ply(without: &[&str], count: usize) -> String {
    let names =
        "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    let names: Vec<&str> = names
        .split(' ')
        .filter(|name| !without.contains(name))
        .collect();
    let value = |name: &str, i: usize| match name {
        "x" => i as f64 * 0.3,
        "y" => 0.1 * i as f64,
        "z" => -0.2,
        "f_dc_0" => 1.0,
        "opacity" => 2.2,
        "scale_0" => -1.5,
        "scale_1" => -2.2,
        "scale_2" => -13.8,
        "rot_0" => 0.9,
        "rot_1" => 0.1 + 0.2 * i as f64,
        "rot_2" => 0.3,
        _ => 0.0,
    };
    let row = |i: usize| {
        names
            .iter()
            .map(|name| value(name, i).to_string())
            .collect::<Vec<_>>()
            .join(" ")
    };
    let header: String = names
        .iter()
        .map(|name| format!("property float {name}\n"))
        .collect();
    let rows: String = (0..count).map(|i| row(i) + "\n").collect();
    format!("ply\nformat ascii 1.0\nelement vertex {count}\n{header}end_header\n{rows}")
}

/// An unpacked `.spz` file with one Gaussian per 20 bytes, of degree 0.
fn spz(version: u32, degree: u8, rows: &[u8]) -> Vec<u8> {
    let header = [
        b"NGSP".as_slice(),
        &version.to_le_bytes(),
        &1u32.to_le_bytes(),
        &[degree, 12, 0, 0],
    ]
    .concat();
    [&header, rows].concat()
}

/// The same tables as a file of version 4, each in one Zstandard frame with a single raw block (RFC
/// 8878).
fn spz_of_tables(tables: &[u8], count: u32, degree: u8) -> Vec<u8> {
    let lengths = [9, 1, 3, 3, 4, [0, 9, 24, 45][degree as usize]].map(|row| row * count as usize);
    let lengths: Vec<usize> = lengths.into_iter().filter(|length| *length > 0).collect();
    let mut header = [
        b"NGSP".as_slice(),
        &4u32.to_le_bytes(),
        &count.to_le_bytes(),
        &[degree, 12, 0, lengths.len() as u8],
    ]
    .concat();
    header.extend(32u32.to_le_bytes());
    header.extend([0; 12]);
    let (mut frames, mut rest) = (Vec::new(), tables);
    for length in lengths {
        let (table, after) = rest.split_at(length);
        rest = after;
        // A single segment with its size in 4 bytes; the last block is raw.
        let frame = [
            &[0x28, 0xb5, 0x2f, 0xfd, 0xa0],
            (length as u32).to_le_bytes().as_slice(),
            &((length as u32) << 3 | 1).to_le_bytes()[..3],
            table,
        ]
        .concat();
        header.extend(
            [frame.len() as u64, length as u64]
                .iter()
                .flat_map(|size| size.to_le_bytes()),
        );
        frames.extend(frame);
    }
    [header, frames].concat()
}

#[test]
fn an_spz_of_version_4_holds_what_one_of_version_3_does() {
    let folder = folder();
    // Two Gaussians of degree 1, with arbitrary bytes.
    let tables: Vec<u8> = (0..58u32).map(|i| (i * 37 + 11) as u8).collect();
    let mut v3 = spz(3, 1, &tables);
    v3[8] = 2;
    let v4 = spz_of_tables(&tables, 2, 1);
    let [old, new] =
        [("a.spz", &v3), ("b.spz", &v4)].map(|(name, bytes)| load(&folder, name, bytes));
    assert_eq!(
        (old.splats.len(), &old.splats, &old.ellipsoids),
        (2, &new.splats, &new.ellipsoids)
    );
    // Truncated and inconsistent files are refused, and quickly.
    for end in 0..v4.len() {
        refused_quietly(&folder, &v4[..end]);
    }
    let changed = |at: usize, bytes: &[u8]| {
        let mut file = v4.clone();
        file[at..at + bytes.len()].copy_from_slice(bytes);
        refused_quietly(&folder, &file)
    };
    assert!(
        changed(8, &u32::MAX.to_le_bytes())
            .contains("promises 4294967295 Gaussians, more than a file of its size can hold")
    );
    assert!(
        changed(8, &3u32.to_le_bytes())
            .contains("has a table of 18 bytes, and its 3 Gaussians take 27")
    );
    assert!(changed(15, &[9]).contains("has 9 tables; 2 Gaussians of degree 1 have 6"));
    assert!(
        changed(16, &u32::MAX.to_le_bytes())
            .contains("its header and the sizes of its tables take more")
    );
    assert!(changed(32, &u64::MAX.to_le_bytes()).contains("are left of the file"));
    assert!(
        changed(40, &u64::MAX.to_le_bytes()).contains("has a table of 18446744073709551615 bytes")
    );
    if let Some(outside) = shared_input::find("outside/02-spz-v4") {
        let [old, new] = ["forty.v3.spz", "forty.v4.spz"]
            .map(|name| Scene::load(outside.join(name), &Overrides::default()).unwrap());
        assert_eq!(
            (old.splats.len(), &old.splats, &old.ellipsoids),
            (40, &new.splats, &new.ellipsoids)
        );
    }
}

/// The refusal of a file that is not a scene.
#[track_caller]
fn refused_quietly(folder: &TempDir, bytes: &[u8]) -> String {
    let sentence = Scene::load(write(folder, "bad.spz", bytes), &Overrides::default())
        .unwrap_err()
        .to_string();
    assert!(
        !sentence.contains('\n') && sentence.len() < 500,
        "{sentence}"
    );
    sentence
}

/// A picture on the scene's machine, 8 bits per channel.
fn drawn(folder: &TempDir, file: &str) -> Vec<u8> {
    let camera =
        json!({"eye": [0, 0, -4], "target": [0, 0, 0], "up": [0, -1, 0], "fov_y_degrees": 40});
    let scene = json!({"splats": {"file": file}, "camera": camera, "image": {"width": 64, "height": 64, "background": [0, 0, 0, 1]}});
    let scene = write(folder, "drawn.json", scene.to_string());
    let out = folder.path().join("out");
    Command::new(PROGRAM.as_str())
        .args([
            "run",
            &scene,
            "--quiet",
            "--machine",
            "gaussian",
            "--out",
            out.to_str().unwrap(),
        ])
        .assert()
        .success();
    let pictures = ["fixed.png", "golden.png"]
        .map(|name| image::open(out.join(name)).unwrap().into_rgb8().into_raw());
    pictures.concat()
}

#[test]
fn gaussians_without_a_third_scale_are_discs() {
    let folder = folder();
    let full = write(&folder, "3d.ply", gaussian_ply(&[], 3));
    let flat = write(&folder, "2d.ply", gaussian_ply(&["scale_2"], 3));
    let scene = Scene::load(&flat, &Overrides::default()).unwrap();
    assert!(
        scene
            .notes
            .iter()
            .any(|note| note.contains("has no scale_2: its Gaussians are read as 2D ones")),
        "{:?}",
        scene.notes
    );
    let mut pairs = vec![(full, flat)];
    if let Some(outside) = shared_input::find("outside/01-2dgs") {
        let path = |name: &str| {
            std::fs::canonicalize(outside.join(name))
                .unwrap()
                .to_str()
                .unwrap()
                .to_owned()
        };
        pairs.push((path("same-with-scale_2.ply"), path("disc.ply")));
    }
    for (full, flat) in pairs {
        let [thick, thin] = [&full, &flat].map(|file| drawn(&folder, file));
        let most = thick
            .iter()
            .zip(&thin)
            .map(|(a, b)| a.abs_diff(*b))
            .max()
            .unwrap();
        assert!(
            most <= 1 && thick.iter().any(|c| *c > 100),
            "{flat}: {most} codes apart"
        );
    }
}

/// JSON and buffer of `count` Gaussians with harmonics of degree 1 under one node.
fn gaussian_gltf(node: &Value, count: usize) -> (Value, Vec<u8>) {
    let mut buffer = Vec::new();
    let (mut views, mut accessors, mut attributes) =
        (Vec::new(), Vec::new(), serde_json::Map::new());
    let names = [
        "POSITION",
        "ROTATION",
        "SCALE",
        "OPACITY",
        "SH_DEGREE_0_COEF_0",
        "SH_DEGREE_1_COEF_0",
        "SH_DEGREE_1_COEF_1",
        "SH_DEGREE_1_COEF_2",
    ];
    for (place, name) in names.into_iter().enumerate() {
        let width = [3, 4, 3, 1, 3, 3, 3, 3][place];
        let value = |i: usize, c: usize| match name {
            "ROTATION" => [0.1, 0.3, 0.2, 0.9][c] / 0.95f32.sqrt(),
            "SCALE" => [0.2, 0.1, 0.05][c],
            "OPACITY" => 0.8,
            _ => ((i * 5 + c * 3 + place * 7) % 11) as f32 / 11.0,
        };
        let start = buffer.len();
        buffer.extend((0..count * width).flat_map(|k| value(k / width, k % width).to_le_bytes()));
        views.push(json!({"buffer": 0, "byteOffset": start, "byteLength": buffer.len() - start}));
        let kind = ["SCALAR", "", "VEC3", "VEC4"][width - 1];
        let mut accessor =
            json!({"bufferView": place, "componentType": 5126, "count": count, "type": kind});
        if place == 0 {
            (accessor["min"], accessor["max"]) = (json!([0, 0, 0]), json!([1, 1, 1]));
        }
        accessors.push(accessor);
        let prefix = if place == 0 {
            ""
        } else {
            "KHR_gaussian_splatting:"
        };
        attributes.insert(format!("{prefix}{name}"), json!(place));
    }
    let mut node = node.clone();
    node["mesh"] = json!(0);
    let extension = json!({"KHR_gaussian_splatting": {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}});
    let document = json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_gaussian_splatting"],
        "extensionsRequired": ["KHR_gaussian_splatting"],
        "nodes": [node],
        "meshes": [{"primitives": [{"mode": 0, "attributes": attributes, "extensions": extension}]}],
        "buffers": [{"byteLength": buffer.len()}],
        "bufferViews": views,
        "accessors": accessors
    });
    (document, buffer)
}

fn glb(document: &Value, buffer: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bin = buffer.to_vec();
    bin.resize(bin.len().next_multiple_of(4), 0);
    let chunk = |kind: &[u8; 4], bytes: &[u8]| {
        [&(bytes.len() as u32).to_le_bytes(), kind.as_slice(), bytes].concat()
    };
    let chunks = [chunk(b"JSON", &json), chunk(b"BIN\0", &bin)].concat();
    [
        b"glTF".as_slice(),
        &2u32.to_le_bytes(),
        &(12 + chunks.len() as u32).to_le_bytes(),
        &chunks,
    ]
    .concat()
}

/// The covariance of a scene's splat, from its axes.
fn covariance(scene: &Scene, splat: usize) -> glam::DMat3 {
    let orientation = scene.ellipsoids.as_ref().unwrap().orientation(splat);
    let axes = glam::DMat3::from_quat(orientation.rotation)
        * glam::DMat3::from_diagonal(orientation.scales * scene.splats[splat].radius);
    axes * axes.transpose()
}

#[track_caller]
fn near(a: glam::DMat3, b: glam::DMat3, most: f64) {
    let apart = (a - b).to_cols_array().iter().fold(0.0, |most: f64, c| {
        if c.is_nan() {
            f64::INFINITY
        } else {
            most.max(c.abs())
        }
    });
    assert!(apart <= most, "{a} is not {b}");
}

#[test]
fn gaussians_of_a_gltf_are_where_its_nodes_bring_them() {
    let folder = folder();
    let half_turn = DQuat::from_rotation_x(std::f64::consts::PI);
    let own = glam::DMat3::from_quat(DQuat::from_xyzw(0.1, 0.3, 0.2, 0.9).normalize())
        * glam::DMat3::from_diagonal(DVec3::new(0.2, 0.1, 0.05));
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -1.0).normalize(), 0.7);
    let rotation = json!([turn.x, turn.y, turn.z, turn.w]);
    for (node, linear, way) in [
        (json!({}), glam::DMat3::IDENTITY, DVec3::ZERO),
        (
            json!({"rotation": rotation, "translation": [1, 2, 3], "scale": [2, 2, 2]}),
            glam::DMat3::from_quat(turn) * 2.0,
            DVec3::new(1.0, 2.0, 3.0),
        ),
        (
            json!({"rotation": rotation, "scale": [1, 2, 0.5]}),
            glam::DMat3::from_quat(turn) * glam::DMat3::from_diagonal(DVec3::new(1.0, 2.0, 0.5)),
            DVec3::ZERO,
        ),
    ] {
        let (document, buffer) = gaussian_gltf(&node, 2);
        let scene = load(&folder, "a.glb", glb(&document, &buffer));
        assert_eq!(
            (scene.splats.len(), scene.notes.len()),
            (2, 0),
            "{:?}",
            scene.notes
        );
        let place = DVec3::new(5.0, 8.0, 0.0) / 11.0;
        let expected = half_turn * (linear * place + way);
        assert!(
            (scene.splats[1].position - expected).length() < 1e-5,
            "{} is not {expected}",
            scene.splats[1].position
        );
        let axes = glam::DMat3::from_quat(half_turn) * linear * own;
        near(covariance(&scene, 1), axes * axes.transpose(), 1e-6);
        assert!((scene.splats[0].opacity - 0.8).abs() < 1e-6);
        // Colours are computed from the file's own coefficients, for the position of the eye in the
        // file's coordinates.
        let view = (scene.splats[1].position - scene.camera.eye).normalize();
        let back = if node.get("rotation").is_some() {
            turn.conjugate()
        } else {
            DQuat::IDENTITY
        };
        let seen = back * (half_turn.conjugate() * view);
        for channel in 0..3 {
            let coefficient = |place: usize| ((5 + channel * 3 + place * 7) % 11) as f64 / 11.0;
            let first = 0.488_602_511_902_919_9
                * (-coefficient(5) * seen.y + coefficient(6) * seen.z - coefficient(7) * seen.x);
            let colour = (0.5 + 0.282_094_791_773_878_14 * coefficient(4) + first).max(0.0);
            assert!(
                (scene.splats[1].rgb[channel] - colour).abs() < 1e-5,
                "{} is not {colour}",
                scene.splats[1].rgb[channel]
            );
        }
    }
    for node in [
        json!({"scale": [1, 1, -1]}),
        json!({"scale": [0, 1, 1]}),
        json!({"matrix": [1, 0, 0, 0, 0.5, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}),
    ] {
        let (document, buffer) = gaussian_gltf(&node, 1);
        let sentence = refused("run", &write(&folder, "a.glb", glb(&document, &buffer)));
        assert!(
            sentence.contains("node 0: its transform shears, mirrors or flattens"),
            "{sentence}"
        );
    }
}

#[test]
fn gaussians_of_a_gltf_may_be_quantised_and_are_checked() {
    let folder = folder();
    let (document, buffer) = gaussian_gltf(&json!({}), 2);
    let exact = load(&folder, "a.glb", glb(&document, &buffer));
    // Rotations, scales and opacities as integers of 8 and 16 bits, after the floats.
    let rotation = [0.1, 0.3, 0.2, 0.9].map(|c: f64| c / 0.95f64.sqrt());
    let mut long = buffer.clone();
    (0..2).for_each(|_| {
        long.extend(
            rotation
                .iter()
                .flat_map(|c| ((c * 32767.0).round() as i16).to_le_bytes()),
        )
    });
    (0..2).for_each(|_| {
        long.extend(
            [0.2, 0.1, 0.05]
                .iter()
                .flat_map(|c: &f64| ((c * 65535.0).round() as u16).to_le_bytes())
                .chain([0; 2]),
        )
    });
    (0..2).for_each(|_| long.extend([204, 0, 0, 0]));
    let mut quantised = document.clone();
    quantised["buffers"][0]["byteLength"] = json!(long.len());
    let views = quantised["bufferViews"].as_array_mut().unwrap();
    views[1] = json!({"buffer": 0, "byteOffset": buffer.len(), "byteLength": 16});
    views[2] =
        json!({"buffer": 0, "byteOffset": buffer.len() + 16, "byteLength": 16, "byteStride": 8});
    views[3] =
        json!({"buffer": 0, "byteOffset": buffer.len() + 32, "byteLength": 8, "byteStride": 4});
    for (accessor, kind) in [(1, 5122), (2, 5123), (3, 5121)] {
        quantised["accessors"][accessor]["componentType"] = json!(kind);
        quantised["accessors"][accessor]["normalized"] = json!(true);
    }
    let scene = load(&folder, "b.glb", glb(&quantised, &long));
    near(covariance(&scene, 1), covariance(&exact, 1), 1e-5);
    assert!((scene.splats[1].opacity - 0.8).abs() < 1e-6);
    // The default camera differs a little.
    assert!(
        (DVec3::from_array(scene.splats[1].rgb) - DVec3::from_array(exact.splats[1].rgb)).length()
            < 1e-4
    );
    let changed = |path: &str, value: Value| {
        let mut document = document.clone();
        *document.pointer_mut(path).unwrap() = value;
        refused("run", &write(&folder, "c.glb", glb(&document, &buffer)))
    };
    assert!(
        changed("/accessors/1/count", json!(u32::MAX))
            .contains("accessor 1 has 4294967295 rows and should have 2")
    );
    assert!(
        changed("/accessors/0/count", json!(u32::MAX))
            .contains("accessor 0 ends past buffer view 0")
            || changed("/accessors/0/count", json!(u32::MAX)).contains("rows and should have")
    );
    assert!(
        changed("/accessors/3/type", json!("VEC3"))
            .contains("accessor 3 has another number of components")
    );
    let primitive = "/meshes/0/primitives/0/attributes";
    let mut attributes = document.pointer(primitive).unwrap().clone();
    attributes
        .as_object_mut()
        .unwrap()
        .remove("KHR_gaussian_splatting:SCALE");
    assert!(
        changed(primitive, attributes)
            .contains("Gaussians have no attribute KHR_gaussian_splatting:SCALE")
    );
    let mut attributes = document.pointer(primitive).unwrap().clone();
    attributes
        .as_object_mut()
        .unwrap()
        .remove("KHR_gaussian_splatting:SH_DEGREE_1_COEF_1");
    assert!(
        changed(primitive, attributes)
            .contains("Gaussians have no attribute KHR_gaussian_splatting:SH_DEGREE_1_COEF_1")
    );
    let linear = {
        let mut document = document.clone();
        document["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"]["colorSpace"] =
            json!("lin_rec709_display");
        load(&folder, "d.glb", glb(&document, &buffer))
    };
    assert!(
        linear
            .notes
            .iter()
            .any(|note| note.contains("has the colour space lin_rec709_display")),
        "{:?}",
        linear.notes
    );
}

// ---- opacities that are compensated ----

/// A ball of σ 0.2 pixels and opacity 0.9, centred on the corner of four pixels, as written by the
/// program Brush.
fn small_ball(comment: &str) -> String {
    let [scale, logit] = [(0.2f64 / 64.0).ln(), 9f64.ln()];
    format!(
        "ply\nformat ascii 1.0\n{comment}element vertex 1\n{}end_header\n0 0 1 1 0 0 0 {scale} {scale} {scale} {logit} 1 1 1\n",
        [
            "x", "y", "z", "rot_0", "rot_1", "rot_2", "rot_3", "scale_0", "scale_1", "scale_2",
            "opacity", "f_dc_0", "f_dc_1", "f_dc_2"
        ]
        .map(|name| format!("property float {name}\n"))
        .concat()
    )
}

/// With the low-pass filter of 0.3 pixel² the variance is 0.34, and the pixel's centre is half a
/// pixel to each side: α is 0.9·e^(−0.25/0.34), and with compensation √(0.04²/0.34²) of that
/// (gsplat, `antialiased`).
#[test]
fn a_file_for_mip_splatting_gets_fainter_and_any_other_does_not() {
    let folder = folder();
    let plain = 0.9 * f64::exp(-0.25 / 0.34);
    for (comment, kernel, expected) in [
        ("", json!({}), plain),
        ("comment SplatRenderMode: default\n", json!({}), plain),
        (
            "comment SplatRenderMode: mip\n",
            json!({}),
            plain * 0.04 / 0.34,
        ),
        (
            "comment splatrendermode:Mip\n",
            json!({}),
            plain * 0.04 / 0.34,
        ),
        (
            "comment SplatRenderMode: mip\n",
            json!({"compensate_opacity": false}),
            plain,
        ),
        ("", json!({"compensate_opacity": true}), plain * 0.04 / 0.34),
    ] {
        write(&folder, "ball.ply", small_ball(comment));
        let camera = json!({"eye": [0, 0, 0], "target": [0, 0, 1], "focal_px": [64, 64]});
        let scene = json!({"splats": {"file": "ball.ply"}, "kernel": kernel, "camera": camera, "image": {"width": 8, "height": 8}});
        let scene = load(&folder, "scene.json", scene.to_string());
        let told = scene
            .notes
            .iter()
            .any(|note| note.contains("opacities are compensated for the low-pass filter"));
        assert_eq!(
            told,
            comment.to_lowercase().contains("mip") && kernel == json!({}),
            "{comment}: {:?}",
            scene.notes
        );
        let golden = render(&scene, &Rules::default()).picture;
        let machine = machines::load("gaussian", &[]).unwrap();
        let words = quantise(&scene, &machine).unwrap();
        let drawing = rtl_model::pipeline::draw_unobserved(
            &fixed::elaborate(&machine).unwrap(),
            &words.frame,
        );
        let one = machine.resolve.frame.format.one() as f64;
        for pixel in [27, 28, 35, 36] {
            let [exact, held] = [
                golden.rgba[pixel][3],
                f64::from(drawing.frame[pixel][3]) / one,
            ];
            assert!(
                (exact - expected).abs() < 1e-7,
                "{comment} {kernel}: golden has {exact}, not {expected}"
            );
            assert!(
                (held - expected).abs() < 2e-3,
                "{comment} {kernel}: the machine has {held}, not {expected}"
            );
        }
    }
}

#[test]
fn files_with_the_factor_are_not_compensated_again() {
    let folder = folder();
    let discs =
        json!({"splats": [{"position": [0, 0, 0]}], "kernel": {"compensate_opacity": true}});
    assert!(
        refused("run", &write(&folder, "discs.json", discs.to_string()))
            .contains("discs and volumes have that factor already")
    );
    // Alongside other splats, Gaussians are drawn like volumes.
    write(
        &folder,
        "ball.ply",
        small_ball("comment SplatRenderMode: mip\n"),
    );
    let beside = json!({"splats": [{"file": "ball.ply"}, {"position": [0, 0, 0]}]});
    assert!(
        !load(&folder, "scene.json", beside.to_string())
            .kernel
            .compensate_opacity
    );
}

#[test]
fn the_balls_in_the_shared_folder_are_as_bright_as_their_trainer_draws_them() {
    let Some(path) = shared_input::find("outside/03-mip-comment/scene.json") else {
        return;
    };
    let scene = Scene::load(&path, &Overrides::default()).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    let other = if text.contains("mip.ply") {
        text.replace("mip.ply", "plain.ply")
    } else {
        text.replace("plain.ply", "mip.ply")
    };
    let other = Scene::from_text(
        &other,
        "scene.json",
        path.parent().unwrap(),
        &Overrides::default(),
        0,
    )
    .unwrap();
    let brightest = |scene: &Scene| {
        render(scene, &Rules::default())
            .picture
            .rgba
            .iter()
            .map(|pixel| pixel[0])
            .fold(0.0, f64::max)
    };
    let [a, b] = [brightest(&scene), brightest(&other)];
    let code = |light: f64| {
        (255.0
            * if scene.image.encoded {
                light
            } else {
                light.powf(1.0 / 2.2)
            })
        .round()
    };
    let codes = [code(a.min(b)), code(a.max(b))];
    println!("{codes:?}");
    assert!(
        (codes[0] - 13.0).abs() <= 1.0 && (codes[1] - 108.0).abs() <= 1.0,
        "{codes:?}"
    );
}

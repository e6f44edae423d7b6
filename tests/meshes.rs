//! Is a mesh read correctly in every format, or refused in one sentence without any output?

use crate::shared_input;
use assert_cmd::Command;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::DVec3;
use serde_json::{Value, json};
use splatsim::scene::mesh::{Mesh, Triangle, Wrap};
use std::io::Cursor;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

fn write(folder: &TempDir, name: &str, bytes: impl AsRef<[u8]>) -> String {
    let path = folder.path().join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(&path, bytes).unwrap();
    path.to_str().unwrap().to_owned()
}

fn read(folder: &TempDir, name: &str, bytes: impl AsRef<[u8]>) -> Mesh {
    Mesh::load(write(folder, name, bytes)).unwrap()
}

/// A PNG of one colour.
fn png(rgba: [u8; 4]) -> Vec<u8> {
    let mut bytes = Vec::new();
    image::RgbaImage::from_pixel(2, 2, image::Rgba(rgba))
        .write_to(&mut Cursor::new(&mut bytes), image::ImageFormat::Png)
        .unwrap();
    bytes
}

// ---- One quad in every format ----

const OBJ: &str = "mtllib q.mtl\nv 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl glass\nf 1/1 2/2 3/3 4/4\n";
const MTL: &str = "newmtl glass\nKd 0.25 0.5 1\nd 0.5\nmap_Kd q.png\n";
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty float s\nproperty float t\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 0 0\n2 0 0 1 0\n2 1 0 1 1\n0 1 0 0 1\n4 0 1 2 3\n";
const CORNERS: [[f32; 3]; 4] = [
    [0.0, 0.0, 0.0],
    [2.0, 0.0, 0.0],
    [2.0, 1.0, 0.0],
    [0.0, 1.0, 0.0],
];
const UV: [[f32; 2]; 4] = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
const ORDER: [usize; 6] = [0, 1, 2, 0, 2, 3];

fn stl_text() -> String {
    let vertex = |i: &usize| {
        format!(
            "vertex {} {} {}\n",
            CORNERS[*i][0], CORNERS[*i][1], CORNERS[*i][2]
        )
    };
    let facet = |corners: &[usize]| {
        format!(
            "facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n",
            corners.iter().map(vertex).collect::<String>()
        )
    };
    format!(
        "solid quad\n{}endsolid quad\n",
        ORDER.chunks(3).map(facet).collect::<String>()
    )
}

fn stl_binary() -> Vec<u8> {
    let mut bytes = [vec![0; 80], 2u32.to_le_bytes().to_vec()].concat();
    for corners in ORDER.chunks(3) {
        bytes.extend([0; 12]);
        bytes.extend(
            corners
                .iter()
                .flat_map(|&i| CORNERS[i])
                .flat_map(f32::to_le_bytes),
        );
        bytes.extend([0; 2]);
    }
    bytes
}

/// Positions, texture coordinates and indices, one after another.
fn buffer() -> Vec<u8> {
    let floats = CORNERS
        .as_flattened()
        .iter()
        .chain(UV.as_flattened())
        .flat_map(|c| c.to_le_bytes());
    floats
        .chain(ORDER.iter().flat_map(|&i| (i as u16).to_le_bytes()))
        .collect()
}

fn gltf() -> Value {
    json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "materials": [{"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [0.25, 0.5, 1, 0.5], "baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"wrapS": 33071, "wrapT": 33648}],
        "images": [{"uri": "q.png"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [2, 1, 0]},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 32},
            {"buffer": 0, "byteOffset": 80, "byteLength": 12},
        ],
        "buffers": [{"byteLength": 92, "uri": format!("data:application/octet-stream;base64,{}", STANDARD.encode(buffer()))}],
    })
}

/// The same as a GLB that contains its picture.
fn glb() -> Vec<u8> {
    let picture = png([255, 255, 255, 255]);
    let mut document = gltf();
    document["buffers"] = json!([{"byteLength": 92 + picture.len()}]);
    document["bufferViews"]
        .as_array_mut()
        .unwrap()
        .push(json!({"buffer": 0, "byteOffset": 92, "byteLength": picture.len()}));
    document["images"] = json!([{"bufferView": 3, "mimeType": "image/png"}]);
    packed(&document, &[buffer(), picture].concat())
}

fn packed(document: &Value, buffer: &[u8]) -> Vec<u8> {
    let padded = |bytes: &[u8], with: u8| {
        [
            bytes,
            &vec![with; bytes.len().next_multiple_of(4) - bytes.len()],
        ]
        .concat()
    };
    let chunk = |kind: &[u8; 4], bytes: &[u8]| {
        [&(bytes.len() as u32).to_le_bytes(), &kind[..], bytes].concat()
    };
    let chunks = [
        chunk(b"JSON", &padded(document.to_string().as_bytes(), b' ')),
        chunk(b"BIN\0", &padded(buffer, 0)),
    ]
    .concat();
    [
        b"glTF",
        &2u32.to_le_bytes()[..],
        &(12 + chunks.len() as u32).to_le_bytes()[..],
        &chunks,
    ]
    .concat()
}

fn every_quad() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("q.obj", OBJ.into()),
        ("q.ply", PLY.into()),
        ("t.stl", stl_text().into()),
        ("b.stl", stl_binary()),
        ("q.gltf", gltf().to_string().into()),
        ("q.glb", glb()),
    ]
}

fn with_quads() -> TempDir {
    let folder = folder();
    every_quad().into_iter().for_each(|(name, bytes)| {
        write(&folder, name, bytes);
    });
    write(&folder, "q.mtl", MTL);
    write(&folder, "q.png", png([255, 255, 255, 128]));
    folder
}

#[test]
fn a_quad_is_the_same_in_every_format() {
    let folder = with_quads();
    for (name, _) in every_quad() {
        let mesh = Mesh::load(folder.path().join(name)).unwrap();
        let corners: Vec<[f32; 3]> = mesh
            .triangles
            .iter()
            .flat_map(|t| t.corners)
            .map(|c| c.as_vec3().to_array())
            .collect();
        assert_eq!(corners, ORDER.map(|i| CORNERS[i]), "{name}");
        assert!(
            mesh.triangles
                .iter()
                .flat_map(|t| t.normals)
                .all(|normal| normal == [0.0, 0.0, 1.0]),
            "{name}"
        );
        let uv: Vec<[f32; 2]> = mesh
            .triangles
            .iter()
            .filter_map(|t| t.uv)
            .flatten()
            .collect();
        assert_eq!(
            uv,
            if name.ends_with("stl") {
                vec![]
            } else {
                ORDER.map(|i| UV[i]).to_vec()
            },
            "{name}"
        );
        assert_eq!(
            (mesh.degenerate, mesh.notes),
            (0, Vec::<String>::new()),
            "{name}"
        );
    }
}

#[test]
fn glass_is_glass() {
    let folder = with_quads();
    for name in ["q.obj", "q.gltf", "q.glb"] {
        let mesh = Mesh::load(folder.path().join(name)).unwrap();
        let material = &mesh.materials[mesh.triangles[0].material as usize];
        assert_eq!(
            (material.rgba, material.texture),
            ([0.25, 0.5, 1.0, 0.5], Some(0)),
            "{name}"
        );
        assert_eq!(material.alpha.of(0.5), 0.5, "{name}");
    }
    let of = |material: Value| {
        let mut document = gltf();
        document["materials"] = json!([material]);
        let mesh = read(&folder, "m.gltf", document.to_string());
        let material = &mesh.materials[0];
        [0.2, 0.8].map(|picture| material.alpha.of(material.rgba[3] as f64 * picture))
    };
    let factor = json!({"baseColorFactor": [1, 1, 1, 0.5]});
    assert_eq!(of(json!({"pbrMetallicRoughness": factor})), [1.0, 1.0]);
    assert_eq!(
        of(json!({"pbrMetallicRoughness": factor, "alphaMode": "MASK", "alphaCutoff": 0.3})),
        [0.0, 1.0]
    );
    let glass = json!({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}});
    assert!(
        of(glass)
            .iter()
            .all(|opacity| (opacity - 0.04).abs() < 1e-6)
    );
}

#[test]
fn a_texture_is_extended_by_the_rule_of_its_sampler() {
    let folder = with_quads();
    let wrap = |name: &str| Mesh::load(folder.path().join(name)).unwrap().textures[0].wrap;
    assert_eq!(
        (wrap("q.gltf"), wrap("q.obj")),
        ([Wrap::Clamp, Wrap::Mirror], [Wrap::Repeat; 2])
    );
}

// ---- OBJ ----

#[test]
fn an_obj_may_count_from_behind_break_lines_and_colour_its_vertices() {
    let folder = folder();
    let text = "v 0 0 0 1 0 0 # red\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nf -3 \\\n -2 -1\nl 1 2\nv 0 0 1\nf 1//1 2//1 4//1\nvn 0 -2 0\n";
    let mesh = read(&folder, "a.obj", text);
    assert_eq!(mesh.triangles.len(), 2);
    assert_eq!(
        mesh.triangles[0].rgba,
        [
            [1.0, 0.0, 0.0, 1.0],
            [0.0, 1.0, 0.0, 1.0],
            [0.0, 0.0, 1.0, 1.0]
        ]
    );
    assert_eq!(mesh.triangles[1].normals, [[0.0, -1.0, 0.0]; 3]);
    assert_eq!(mesh.triangles[1].corners[2], DVec3::Z);
}

#[test]
fn an_mtl_gives_opacity_in_three_ways_and_colour_in_two() {
    let folder = folder();
    write(
        &folder,
        "a b.mtl",
        "newmtl one\nKd 0.5\nTr 0.75\nnewmtl two words\nKd 1 0 0\nd -halo 0.5\nmap_Kd -s 2 2 -clamp on pictures/a b.png\n",
    );
    write(&folder, "pictures/a b.png", png([255; 4]));
    let mesh = read(
        &folder,
        "a.obj",
        "mtllib a b.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl one\nf 1 2 3\nusemtl two words\nf 1 2 3\nusemtl three\nf 1 2 3\n",
    );
    let material = |i: usize| &mesh.materials[mesh.triangles[i].material as usize];
    assert_eq!(
        (material(0).rgba, material(1).rgba),
        ([0.5, 0.5, 0.5, 0.25], [1.0, 0.0, 0.0, 0.5])
    );
    assert_eq!((material(0).texture, material(1).texture), (None, Some(0)));
    assert_eq!(mesh.triangles[2].rgba[0], [0.5, 0.5, 0.5, 1.0]);
    assert_eq!(mesh.notes.len(), 2, "{:?}", mesh.notes);
    assert!(
        mesh.notes[0].starts_with("options of a texture")
            && mesh.notes[1].ends_with("are grey: three"),
        "{:?}",
        mesh.notes
    );
}

/// The crate `tobj` is an independent reader; its positions are f32.
#[test]
fn objs_are_read_as_by_tobj() {
    let names = [
        "models/helicopter/helicopter.obj",
        "models/space-shuttle-orbiter/space-shuttle-orbiter.obj",
        "scans/armadillo.obj",
        "malformed/obj/tinyobj/map-bump.obj",
    ];
    for name in names {
        let Some(path) = shared_input::find(name) else {
            return;
        };
        let options = tobj::LoadOptions {
            triangulate: true,
            ignore_points: true,
            ignore_lines: true,
            ..Default::default()
        };
        let (models, materials) = tobj::load_obj(&path, &options).unwrap();
        let position = |mesh: &tobj::Mesh, i: &u32| -> [f32; 3] {
            mesh.positions[*i as usize * 3..][..3].try_into().unwrap()
        };
        let theirs: Vec<[f32; 3]> = models
            .iter()
            .flat_map(|m| m.mesh.indices.iter().map(|i| position(&m.mesh, i)))
            .collect();
        // A missing picture is an error here.
        let mesh = match Mesh::load(&path) {
            Err(error) if name.ends_with("map-bump.obj") => {
                assert!(
                    error.to_string().contains(".png` cannot be read"),
                    "{error}"
                );
                continue;
            }
            mesh => mesh.unwrap(),
        };
        let triangles: Vec<_> = theirs
            .chunks(3)
            .filter(|t| t[0] != t[1] && t[1] != t[2] && t[0] != t[2])
            .collect();
        let ours = |t: &Triangle| t.corners.map(|corner| corner.as_vec3().to_array());
        assert!(
            mesh.triangles.len() + mesh.degenerate == theirs.len() / 3,
            "{name}"
        );
        assert!(
            mesh.degenerate > 0
                || mesh
                    .triangles
                    .iter()
                    .zip(&triangles)
                    .all(|(t, o)| ours(t) == **o),
            "{name}"
        );
        let uv = models.iter().any(|m| !m.mesh.texcoords.is_empty());
        assert_eq!(mesh.triangles.iter().any(|t| t.uv.is_some()), uv, "{name}");
        let glass = materials
            .unwrap_or_default()
            .iter()
            .filter(|m| m.dissolve.is_some_and(|d| d < 1.0))
            .count();
        assert_eq!(
            mesh.materials.iter().filter(|m| m.rgba[3] < 1.0).count(),
            glass,
            "{name}"
        );
    }
}

// ---- glTF ----

#[test]
fn nodes_move_turn_scale_and_mirror_their_children() {
    let folder = with_quads();
    let placed = |nodes: Value| {
        let mut document = gltf();
        document["nodes"] = nodes;
        read(&folder, "n.gltf", document.to_string()).triangles[0]
    };
    // A quarter turn about z, after a scale and before a translation; the child's own translation
    // is applied first.
    let turned = placed(json!([
        {"children": [1], "translation": [10, 0, 0], "rotation": [0, 0, 0.5f64.sqrt(), 0.5f64.sqrt()], "scale": [2, 3, 1]},
        {"mesh": 0, "translation": [0, 0, 5]},
    ]));
    let expected = [[10.0, 0.0, 5.0], [10.0, 4.0, 5.0], [7.0, 4.0, 5.0]];
    assert!(
        turned
            .corners
            .iter()
            .zip(expected)
            .all(|(c, e)| c.distance(DVec3::from_array(e)) < 1e-5),
        "{:?}",
        turned.corners
    );
    assert!(turned.face().distance(DVec3::Z) < 1e-6);
    let mirrored = placed(json!([{"mesh": 0, "scale": [-1, 1, 1]}]));
    assert!(
        mirrored.face().distance(DVec3::Z) < 1e-6 && mirrored.corners[2].x == -2.0,
        "{mirrored:?}"
    );
}

#[test]
fn strips_fans_sparse_values_and_texture_transforms_are_read() {
    let folder = with_quads();
    let changed = |change: &dyn Fn(&mut Value)| {
        let mut document = gltf();
        change(&mut document);
        read(&folder, "c.gltf", document.to_string())
    };
    for (mode, second) in [(5, [2, 1, 0]), (6, [0, 2, 0])] {
        let mesh =
            changed(&|document| document["meshes"][0]["primitives"][0]["mode"] = json!(mode));
        let corners = mesh.triangles[1].corners.map(|c| c.as_vec3().to_array());
        // 0 1 2 0 2 3: in a strip the second triangle is 2 1 0; in a fan 0 2 0 has no area, and the
        // next triangle is 0 0 2.
        if mode == 5 {
            assert_eq!(corners, second.map(|i: usize| CORNERS[i]));
        } else {
            assert_eq!(
                (mesh.degenerate, corners),
                (2, [0, 2, 3].map(|i: usize| CORNERS[i]))
            );
        }
    }
    let sparse = changed(&|document| {
        let mut bytes = buffer();
        bytes.extend([2, 0, 0, 0]);
        bytes.extend([9.0f32, 8.0, 7.0].iter().flat_map(|c| c.to_le_bytes()));
        document["buffers"] = json!([{"byteLength": bytes.len(), "uri": format!("data:;base64,{}", STANDARD.encode(&bytes))}]);
        document["bufferViews"]
            .as_array_mut()
            .unwrap()
            .push(json!({"buffer": 0, "byteOffset": 92, "byteLength": 4}));
        document["bufferViews"]
            .as_array_mut()
            .unwrap()
            .push(json!({"buffer": 0, "byteOffset": 96, "byteLength": 12}));
        document["accessors"][0]["sparse"] = json!({"count": 1, "indices": {"bufferView": 3, "componentType": 5121}, "values": {"bufferView": 4}});
    });
    assert_eq!(sparse.triangles[0].corners[2], DVec3::new(9.0, 8.0, 7.0));
    let moved = changed(&|document| {
        let transform =
            json!({"offset": [0.5, 0], "scale": [2, 1], "rotation": std::f64::consts::FRAC_PI_2});
        document["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] =
            json!({"KHR_texture_transform": transform});
    });
    // (1, 1) is scaled to (2, 1), turned to (1, −2), translated to (1.5, −2).
    let [u, v] = moved.triangles[0].uv.unwrap()[1];
    assert!((u - 1.5).abs() < 1e-6 && (v + 2.0).abs() < 1e-6, "{u} {v}");
}

/// Another program converted the data's glTF to OBJ: node transforms are applied, opacity is in
/// `d`.
#[test]
fn the_helicopter_is_the_same_as_gltf_and_as_obj() {
    let Some(folder) = shared_input::find("models/helicopter") else {
        return;
    };
    let [gltf, obj] =
        ["scene.gltf", "helicopter.obj"].map(|name| Mesh::load(folder.join(name)).unwrap());
    assert_eq!(
        gltf.triangles.len() + gltf.degenerate,
        obj.triangles.len() + obj.degenerate
    );
    let area = |mesh: &Mesh, of: &dyn Fn(f32) -> bool| -> f64 {
        let counts = |t: &&Triangle| of(mesh.materials[t.material as usize].rgba[3]);
        mesh.triangles
            .iter()
            .filter(counts)
            .map(|t| t.twice_area().length() / 2.0)
            .sum()
    };
    for of in [
        &(|opacity: f32| opacity < 1.0) as &dyn Fn(f32) -> bool,
        &|opacity| opacity == 1.0,
    ] {
        let (one, other) = (area(&gltf, of), area(&obj, of));
        assert!(
            one > 0.0 && (one / other - 1.0).abs() < 1e-3,
            "{one} {other}"
        );
    }
}

#[test]
fn real_models_have_their_glass_and_pictures() {
    let Some(models) = shared_input::find("models") else {
        return;
    };
    let table = Mesh::load(models.join("glass-table.glb")).unwrap();
    assert!(
        table
            .triangles
            .iter()
            .any(|t| table.materials[t.material as usize].rgba[3] < 0.5)
    );
    let truck = Mesh::load(models.join("CesiumMilkTruck.glb")).unwrap();
    assert!(!truck.textures.is_empty() && truck.triangles.len() > 3000);
    let shuttle =
        Mesh::load(models.join("space-shuttle-orbiter/space-shuttle-orbiter.obj")).unwrap();
    assert_eq!(shuttle.textures.len(), 3);
}

// ---- Faults ----

/// Runs `sample` in a folder on one of its meshes; returns the sentence of the error, and checks
/// that nothing was written.
fn refused(folder: &TempDir, name: &str) -> String {
    let before = names(folder.path());
    let mesh = folder.path().join(name);
    let out = folder.path().join("out.ply");
    let mut command = Command::new(env!("CARGO_BIN_EXE_splatsim"));
    let output = command
        .arg("sample")
        .arg(&mesh)
        .args(["--points", "10", "--out"])
        .arg(&out)
        .timeout(Duration::from_secs(60))
        .output()
        .unwrap();
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(
        (output.status.code(), output.stdout.as_slice()),
        (Some(2), &b""[..]),
        "{name}: {told}"
    );
    assert_eq!(names(folder.path()), before, "{name}");
    assert!(
        told.starts_with(&format!("splatsim: {}: ", mesh.display()))
            && told.lines().count() == 1
            && told.len() < 600,
        "{told}"
    );
    told
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn a_broken_mesh_is_one_sentence_and_nothing_is_written() {
    let folder = with_quads();
    write(&folder, "text.png", "no picture");
    write(&folder, "gif.png", b"GIF89a\x01\x00\x01\x00\x00\x00\x00;");
    write(&folder, "short.png", &png([255; 4])[..40]);
    write(&folder, "wide.png", wide_png());
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let obj = |rest: &str| format!("{corners}{rest}").into_bytes();
    let textured = |field: &str| {
        let library = field.replace([' ', '/'], "-") + ".mtl";
        write(&folder, &library, format!("newmtl a\n{field}\n"));
        format!("mtllib {library}\n{corners}usemtl a\nf 1 2 3\n").into_bytes()
    };
    let gltf_with = |path: &str, value: Value| {
        let mut document = gltf();
        *document.pointer_mut(path).unwrap() = value;
        document.to_string().into_bytes()
    };
    let mut huge_stl = stl_binary();
    huge_stl[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    let mut nan_stl = stl_binary();
    nan_stl[96..100].copy_from_slice(&f32::NAN.to_le_bytes());
    let mut long_glb = glb();
    long_glb[8..12].copy_from_slice(&u32::MAX.to_le_bytes());
    let mut short_glb = glb();
    short_glb[8..12].copy_from_slice(&3u32.to_le_bytes());
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        (
            "a.off",
            b"OFF".to_vec(),
            "is a mesh of another program, which is not read; MeshLab or Blender writes it as .ply, .obj or .glb",
        ),
        (
            "a.mesh",
            b"4 1".to_vec(),
            "is of no known kind; a mesh is one of .ply, .gltf, .glb, .obj, .stl, or `plane`",
        ),
        ("a.obj", b"".to_vec(), "has no triangles"),
        (
            "a.obj",
            obj("f 1 2 4"),
            "line 4: a face names number 4 of 3 vertices",
        ),
        (
            "a.obj",
            obj("f 1/1 2/1 3/1"),
            "line 4: a face names number 1 of 0 texture coordinates",
        ),
        ("a.obj", obj("f 0 1 2"), "line 4: `0` is not an index"),
        ("a.obj", obj("f -4 1 2"), "line 4: `-4` is not an index"),
        ("a.obj", obj("f 1 2 x"), "line 4: `x` is not an index"),
        (
            "a.obj",
            obj("f 1/1/1/1 2 3"),
            "line 4: `1/1/1/1` is not a corner of a face",
        ),
        (
            "a.obj",
            obj("v 1 2"),
            "line 4: a number is missing at its end",
        ),
        (
            "a.obj",
            obj("v nan 0 0\nf 1 2 4"),
            "triangle 0 of 1 has a corner without a finite position",
        ),
        (
            "a.obj",
            obj("v 1e31 0 0\nf 1 2 4"),
            "triangle 0 of 1 has a corner without a finite position",
        ),
        (
            "a.obj",
            obj("vt nan 0\nf 1/1 2/1 3/1"),
            "triangle 0 of 1 has a texture coordinate or a colour that is not finite",
        ),
        (
            "a.obj",
            obj("f 1 1 2\nf 1 2 2"),
            "has no triangle with an area among its 2",
        ),
        (
            "a.obj",
            obj("mtllib none.mtl\nf 1 2 3"),
            "`none.mtl` cannot be read",
        ),
        (
            "a.obj",
            obj("mtllib ../q.mtl\nf 1 2 3"),
            "`../q.mtl` leads out of the mesh's folder",
        ),
        (
            "a.obj",
            textured("map_Kd absent.png"),
            "map_Kd-absent.png.mtl, line 2: `absent.png` cannot be read",
        ),
        (
            "a.obj",
            textured("map_Kd /etc/hostname.png"),
            "leads out of the mesh's folder",
        ),
        (
            "a.obj",
            textured("map_Kd text.png"),
            "`text.png` is not a PNG or JPEG picture",
        ),
        (
            "a.obj",
            textured("map_Kd gif.png"),
            "`gif.png` is not a PNG or JPEG picture",
        ),
        (
            "a.obj",
            textured("map_Kd short.png"),
            "`short.png` cannot be decoded",
        ),
        (
            "a.obj",
            textured("map_Kd wide.png"),
            "`wide.png` cannot be decoded",
        ),
        (
            "a.obj",
            textured("Kd 0.5 0.5"),
            "line 2: a number is missing",
        ),
        (
            "a.obj",
            textured("d 1.5"),
            "line 2: 1.5 is not within 0 and 1",
        ),
        (
            "a.ply",
            PLY.replace("4 0 1 2 3", "4 0 1 2 4").into(),
            "1 of 2 triangles name vertices that do not exist",
        ),
        (
            "a.ply",
            PLY.replace("2 1 0 1 1", "nan 1 0 1 1").into(),
            "triangle 0 of 2 has a corner without a finite position",
        ),
        (
            "a.ply",
            PLY.replace("face 1", "face 999999999999").into(),
            "the file ends here",
        ),
        (
            "a.ply",
            PLY.replace("face 1", "face 0")
                .replace("4 0 1 2 3\n", "")
                .into(),
            "has no triangles",
        ),
        ("a.ply", b"solid".to_vec(), "is not a PLY file"),
        (
            "a.stl",
            b"solid a\nvertex 0 0\n".to_vec(),
            "line 2: a vertex needs three numbers",
        ),
        (
            "a.stl",
            b"solid a\nvertex 0 0 0\nvertex 0 0 1\nendloop\n".to_vec(),
            "line 4: a loop of 2 vertices is not a triangle",
        ),
        (
            "a.stl",
            b"solid a\nvertex 0 0 0\n".to_vec(),
            "ends inside a loop",
        ),
        ("a.stl", b"short".to_vec(), "is not an STL file"),
        (
            "a.stl",
            huge_stl,
            "promises 4294967295 triangles, and has room for 2",
        ),
        (
            "a.stl",
            nan_stl,
            "triangle 0 of 2 has a corner without a finite position",
        ),
        ("a.glb", long_glb, "declares 4294967295 bytes"),
        ("a.glb", short_glb, "declares 3 bytes"),
        (
            "a.glb",
            b"glTF\x02\0\0\0".to_vec(),
            "ends inside its header",
        ),
        ("a.gltf", b"{}".to_vec(), "is not valid glTF 2.0"),
        ("a.gltf", b"[".repeat(100_000), "is not valid glTF 2.0"),
        (
            "a.gltf",
            gltf_with(
                "/nodes",
                json!([{"children": [1]}, {"children": [0], "mesh": 0}]),
            ),
            "is reached twice, so its nodes are not a tree",
        ),
        (
            "a.gltf",
            gltf_with("/nodes", json!([{"children": [0], "mesh": 0}])),
            "node 0 is reached twice",
        ),
        (
            "a.gltf",
            gltf_with("/accessors/0/count", json!(u32::MAX)),
            "accessor 0 ends past buffer view 0",
        ),
        (
            "a.gltf",
            gltf_with("/accessors/2/count", json!(u64::MAX / 2)),
            "accessor 2 ends past buffer view 2",
        ),
        (
            "a.gltf",
            gltf_with("/accessors/1/count", json!(3)),
            "accessor 1 has 3 rows and should have 4",
        ),
        (
            "a.gltf",
            gltf_with("/accessors/0/bufferView", Value::Null),
            "is not valid glTF 2.0: invalid glTF: accessors[0].bufferView",
        ),
        (
            "a.gltf",
            gltf_with(
                "/accessors/0",
                json!({"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [2, 1, 0]}),
            ),
            "a triangle names number 4 of 3 vertices",
        ),
        (
            "a.gltf",
            gltf_with("/bufferViews/0/byteLength", json!(u32::MAX)),
            "buffer view 0 ends past buffer 0",
        ),
        (
            "a.gltf",
            gltf_with("/buffers/0/byteLength", json!(1e12 as u64)),
            "buffer 0 should have 1000000000000 bytes and has 92",
        ),
        (
            "a.gltf",
            gltf_with("/buffers/0/uri", json!("../b.bin")),
            "leads out of the mesh's folder",
        ),
        (
            "a.gltf",
            gltf_with("/buffers/0/uri", json!("%2e%2e/b.bin")),
            "leads out of the mesh's folder",
        ),
        (
            "a.gltf",
            gltf_with("/buffers/0/uri", json!("https://example.org/b.bin")),
            "only files in the mesh's folder are read",
        ),
        (
            "a.gltf",
            gltf_with("/buffers/0/uri", json!("b.bin")),
            "buffer 0: `b.bin` cannot be read",
        ),
        (
            "a.gltf",
            gltf_with("/buffers/0/uri", json!("data:;base64,!")),
            "cannot be decoded",
        ),
        (
            "a.gltf",
            gltf_with("/images/0/uri", json!("absent.png")),
            "image 0: `absent.png` cannot be read",
        ),
        (
            "a.gltf",
            gltf_with("/images/0/uri", json!("text.png")),
            "image 0 is not a PNG or JPEG picture",
        ),
        (
            "a.gltf",
            gltf_with("/images", json!([{}])),
            "image 0 has no data",
        ),
        (
            "a.gltf",
            gltf_with("/meshes/0/primitives/0/attributes/POSITION", json!(8)),
            "positions name accessor 8 of 3",
        ),
        (
            "a.gltf",
            gltf_with("/meshes/0/primitives/0/indices", json!(7)),
            "is not valid glTF 2.0",
        ),
    ];
    for (name, bytes, sentence) in cases {
        write(&folder, name, &bytes);
        let told = refused(&folder, name);
        assert!(told.contains(sentence), "{sentence}\n{told}");
    }
}

/// A PNG whose header promises 2³⁰ rows.
fn wide_png() -> Vec<u8> {
    let mut bytes = png([255; 4]);
    bytes[16..24].copy_from_slice(&[0x40, 0, 0, 0, 0x40, 0, 0, 0]);
    let sum = crc(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&sum.to_be_bytes());
    bytes
}

fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ byte as u32, |crc, _| {
            if crc & 1 == 1 {
                crc >> 1 ^ 0xedb8_8320
            } else {
                crc >> 1
            }
        })
    })
}

/// Every format with some bytes changed, cut or doubled: a mesh, or one sentence.
#[test]
fn changed_bytes_make_a_mesh_or_a_sentence() {
    let folder = with_quads();
    let mut state = 1u64;
    let mut next = |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    for (name, sound) in every_quad() {
        let mut refused = 0;
        for _ in 0..600 {
            let mut bytes = sound.clone();
            for _ in 0..1 + next(3) {
                let place = next(bytes.len());
                match next(5) {
                    0 => bytes.truncate(place.max(1)),
                    1 => bytes[place] = [0, 255, b'0', b'9', b'-', b'.'][next(6)],
                    2 => drop(bytes.splice(place..place, *b"99")),
                    _ => bytes[place] ^= 1 << next(8),
                }
            }
            if let Err(error) = Mesh::load(write(&folder, &format!("changed-{name}"), &bytes)) {
                let told = error.to_string();
                assert!(!told.contains(['\n', '\r']) && told.len() < 700, "{told}");
                refused += 1;
            }
        }
        assert!((1..600).contains(&refused), "{name}: {refused}");
    }
}

#[test]
fn every_odd_or_broken_obj_ends_in_a_mesh_or_a_sentence() {
    for (folder, sound) in [
        ("malformed/obj", 20),
        ("malformed/ply", 10),
        ("malformed/ply_plyodine", 0),
    ] {
        let Some(folder) = shared_input::find(folder) else {
            return;
        };
        let mut open = vec![folder];
        let (mut read, mut refused) = (0, 0);
        while let Some(path) = open.pop() {
            if path.is_dir() {
                open.extend(
                    std::fs::read_dir(path)
                        .unwrap()
                        .map(|entry| entry.unwrap().path()),
                );
                continue;
            }
            match Mesh::load(&path) {
                Ok(mesh) => {
                    read += 1;
                    let is_unit =
                        |n: &[f32; 3]| (n.iter().map(|c| c * c).sum::<f32>() - 1.0).abs() < 1e-5;
                    assert!(mesh.triangles.iter().all(|t| t.normals.iter().all(is_unit) && t.twice_area().length() > 0.0), "{path:?}");
                    assert!(
                        mesh.triangles
                            .iter()
                            .all(|t| (t.material as usize) < mesh.materials.len()),
                        "{path:?}"
                    );
                }
                Err(error) => {
                    refused += 1;
                    assert!(
                        error.to_string().starts_with(path.to_str().unwrap())
                            && !error.to_string().contains('\n'),
                        "{error}"
                    );
                }
            }
        }
        assert!(read >= sound && refused > 5, "{read} {refused}");
    }
}

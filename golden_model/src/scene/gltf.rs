//! GlTF: opens a glTF 2.0 file, as JSON with buffers inside or in separate files, or as GLB, for
//! the readers of meshes and of Gaussians.
//!
//! ```text
//! bytes ─► [JSON] ─► attributes unknown to the crate, required extensions ─► [gltf] ─► document, validated
//!                                                   buffers, accessors, nodes, every range checked ◄─┘
//! ```
//! The crate `gltf` reads and validates the JSON. Buffers, accessors and the tree of nodes are read
//! here with all ranges checked, because the crate's readers panic past a buffer's end and do not
//! terminate on cycles.
//!
//! Attributes whose names begin with an underscore belong to an application (glTF 2.0, 3.7.2.1),
//! those with a colon to an extension; the crate accepts neither. `KHR_mesh_quantization` allows
//! component types that are always read.

use crate::output::text::clipped;
use ::gltf::accessor::{DataType, Dimensions};
use ::gltf::buffer::{Source, View};
use ::gltf::json::Root;
use ::gltf::json::validation::Checked;
use ::gltf::{Accessor, Document, Glb, Node, Primitive, Semantic};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::DMat4;
use serde_json::Value;
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

type Parsed<T> = Result<T, String>;

/// Bytes of a GLB's header.
const GLB_HEADER: usize = 12;
/// The extension of Gaussians, and the prefix of its attributes.
const GAUSSIANS: &str = "KHR_gaussian_splatting";
/// Extensions that may be required: they are read, or do not affect shapes and base colours.
const READ: [&str; 5] = [
    GAUSSIANS,
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_transmission",
];
const HARMLESS: [&str; 4] = ["KHR_materials_", "KHR_lights_", "KHR_xmp", "EXT_lights_"];

/// An open file.
pub(super) struct File {
    pub document: Document,
    pub notes: Vec<String>,
    buffers: Vec<Vec<u8>>,
    folder: PathBuf,
    /// Attributes that the crate does not read, by mesh and primitive.
    own: HashMap<(usize, usize), Own>,
}

/// Attributes of a primitive that belong to an application or an extension, and the object of the
/// extension of Gaussians.
#[derive(Default)]
pub(super) struct Own {
    /// Numbers of accessors.
    pub attributes: BTreeMap<String, usize>,
    pub gaussians: Option<Value>,
}

impl Own {
    /// Number of the accessor of an attribute of the extension of Gaussians.
    pub fn of_gaussians(&self, name: &str) -> Option<usize> {
        self.attributes.get(&format!("{GAUSSIANS}:{name}")).copied()
    }
}

fn unsound(fault: impl std::fmt::Display) -> String {
    format!(
        "is not valid glTF 2.0: {}",
        clipped_sentence(&fault.to_string())
    )
}

/// A fault without its line and column, which are not those of the file.
fn without_place(fault: &str) -> &str {
    fault
        .rsplit_once(" at line ")
        .map_or(fault, |(fault, _)| fault)
}

impl File {
    /// Reads a file and those that it names. The error is the second half of a sentence that begins
    /// with the file's name.
    pub fn parse(bytes: &[u8], folder: &Path) -> Parsed<File> {
        let (json, blob) = if bytes.starts_with(b"glTF") {
            check_length(bytes)?;
            let glb = Glb::from_slice(bytes).map_err(unsound)?;
            (
                glb.json.into_owned(),
                glb.bin.map(std::borrow::Cow::into_owned),
            )
        } else {
            (
                bytes
                    .strip_prefix(b"\xef\xbb\xbf")
                    .unwrap_or(bytes)
                    .to_vec(),
                None,
            )
        };
        let mut json: Value = serde_json::from_slice(&json).map_err(unsound)?;
        let notes = take_extensions(&mut json)?;
        let own = take_attributes(&mut json)?;
        // As text again, so that the deserialiser is compiled in its own crate and not here.
        let root = Root::from_slice(&serde_json::to_vec(&json).map_err(unsound)?)
            .map_err(|fault| unsound(without_place(&fault.to_string())))?;
        check_positions(&root)?;
        let document = Document::from_json(root).map_err(unsound)?;
        if let Some(number) = own
            .values()
            .flat_map(|own| own.attributes.values())
            .find(|number| **number >= document.accessors().len())
        {
            return Err(unsound(format!(
                "an attribute names accessor {number} of {}",
                document.accessors().len()
            )));
        }
        let mut file = File {
            document,
            notes,
            buffers: Vec::new(),
            folder: folder.to_owned(),
            own,
        };
        file.read_buffers(blob)?;
        Ok(file)
    }

    /// Attributes of a primitive that the crate does not read.
    pub fn own(&self, mesh: usize, primitive: usize) -> Option<&Own> {
        self.own.get(&(mesh, primitive))
    }

    /// Whether a primitive of a mesh holds Gaussians.
    pub fn is_gaussians(&self, mesh: usize, primitive: usize) -> bool {
        let has_any = |own: &Own| {
            own.gaussians.is_some()
                || own
                    .attributes
                    .keys()
                    .any(|name| name.starts_with(&format!("{GAUSSIANS}:")))
        };
        self.own(mesh, primitive).is_some_and(has_any)
    }

    /// Rows of the accessor with this number; there must be `count` of this kind.
    pub fn numbered<const N: usize>(
        &self,
        number: usize,
        count: usize,
        kind: Dimensions,
    ) -> Parsed<Vec<[f64; N]>> {
        let accessor = self
            .document
            .accessors()
            .nth(number)
            .ok_or_else(|| unsound(format!("there is no accessor {number}")))?;
        if accessor.dimensions() != kind {
            return Err(format!(
                "accessor {number} has another number of components than its attribute"
            ));
        }
        if accessor.count() != count {
            return Err(format!(
                "accessor {number} has {} rows and should have {count}",
                accessor.count()
            ));
        }
        self.rows(&accessor)
    }

    /// Nodes of the default scene, else of the first, else all, starting from the roots, each with
    /// its transform: that of its ancestors times its own. A node that is reached twice is an
    /// error.
    pub fn nodes(&self) -> Parsed<Vec<(Node<'_>, DMat4)>> {
        let document = &self.document;
        let scene = document
            .default_scene()
            .or_else(|| document.scenes().next());
        let mut open: Vec<_> = match scene {
            Some(scene) => scene.nodes().collect(),
            None => {
                let children: Vec<usize> = document
                    .nodes()
                    .flat_map(|node| node.children().map(|child| child.index()))
                    .collect();
                let mut is_root = vec![true; document.nodes().len()];
                children
                    .into_iter()
                    .for_each(|child| is_root[child] = false);
                document
                    .nodes()
                    .filter(|node| is_root[node.index()])
                    .collect()
            }
        };
        open.reverse();
        let mut open: Vec<_> = open
            .into_iter()
            .map(|node| (node, DMat4::IDENTITY))
            .collect();
        let mut met = vec![false; document.nodes().len()];
        let mut nodes = Vec::new();
        while let Some((node, above)) = open.pop() {
            if std::mem::replace(&mut met[node.index()], true) {
                return Err(format!(
                    "node {} is reached twice, so its nodes are not a tree",
                    node.index()
                ));
            }
            let transform = above
                * DMat4::from_cols_array_2d(
                    &node
                        .transform()
                        .matrix()
                        .map(|column| column.map(f64::from)),
                );
            let children: Vec<_> = node.children().collect();
            nodes.push((node, transform));
            open.extend(children.into_iter().rev().map(|child| (child, transform)));
        }
        Ok(nodes)
    }

    fn read_buffers(&mut self, mut blob: Option<Vec<u8>>) -> Parsed<()> {
        for buffer in self.document.buffers() {
            let number = buffer.index();
            let bytes = match buffer.source() {
                Source::Bin => blob
                    .take()
                    .ok_or_else(|| format!("buffer {number} has no data"))?,
                Source::Uri(uri) => self
                    .resource(uri)
                    .map_err(|e| format!("buffer {number}: {e}"))?,
            };
            if bytes.len() < buffer.length() {
                return Err(format!(
                    "buffer {number} should have {} bytes and has {}",
                    buffer.length(),
                    bytes.len()
                ));
            }
            self.buffers.push(bytes);
        }
        Ok(())
    }

    /// Data of a URI: inside it, or from a file in the mesh's folder.
    pub fn resource(&self, uri: &str) -> Parsed<Vec<u8>> {
        let Some(data) = uri.strip_prefix("data:") else {
            if uri.contains("://") {
                return Err(format!(
                    "`{}` is elsewhere; only files in the mesh's folder are read",
                    clipped(uri)
                ));
            }
            return super::mesh::read_inside(&self.folder, &percent_decoded(uri)?);
        };
        let (_, encoded) = data
            .split_once(";base64,")
            .ok_or("data in a URI must be `;base64,`")?;
        STANDARD
            .decode(encoded)
            .map_err(|e| format!("data in a URI cannot be decoded: {e}"))
    }

    pub fn view(&self, view: &View) -> Parsed<&[u8]> {
        let buffer = &self.buffers[view.buffer().index()];
        let end = view
            .offset()
            .checked_add(view.length())
            .filter(|&end| end <= buffer.len());
        let end = end.ok_or_else(|| {
            format!(
                "buffer view {} ends past buffer {}",
                view.index(),
                view.buffer().index()
            )
        })?;
        Ok(&buffer[view.offset()..end])
    }

    /// Rows of an accessor, N numbers each; integers are scaled to [0, 1] or [−1, 1] if the file
    /// says so.
    pub fn rows<const N: usize>(&self, accessor: &Accessor) -> Parsed<Vec<[f64; N]>> {
        let number = accessor.index();
        let view = accessor
            .view()
            .ok_or_else(|| format!("accessor {number} has no buffer view"))?;
        let stride = view.stride().unwrap_or(accessor.size());
        let bytes = span(
            self.view(&view)?,
            accessor.offset(),
            accessor.count(),
            stride,
            accessor.size(),
        )
        .ok_or_else(|| format!("accessor {number} ends past buffer view {}", view.index()))?;
        let (kind, scaled) = (accessor.data_type(), accessor.normalized());
        let row = |bytes: &[u8]| {
            std::array::from_fn(|i| component(kind, scaled, &bytes[i * kind.size()..]))
        };
        let mut rows: Vec<[f64; N]> = bytes.chunks(stride.max(1)).map(row).collect();
        if let Some(sparse) = accessor.sparse() {
            let (places, values) = (sparse.indices(), sparse.values());
            let kind_of_index = match places.index_type() {
                ::gltf::accessor::sparse::IndexType::U8 => DataType::U8,
                ::gltf::accessor::sparse::IndexType::U16 => DataType::U16,
                ::gltf::accessor::sparse::IndexType::U32 => DataType::U32,
            };
            let past = || format!("accessor {number} has sparse values past a buffer view");
            let (place_bytes, value_bytes) =
                (self.view(&places.view())?, self.view(&values.view())?);
            let place_size = kind_of_index.size();
            let place_bytes = span(
                place_bytes,
                places.offset(),
                sparse.count(),
                place_size,
                place_size,
            )
            .ok_or_else(past)?;
            let value_bytes = span(
                value_bytes,
                values.offset(),
                sparse.count(),
                accessor.size(),
                accessor.size(),
            )
            .ok_or_else(past)?;
            for (place, value) in place_bytes
                .chunks(place_size)
                .zip(value_bytes.chunks(accessor.size()))
            {
                let place = component(kind_of_index, false, place) as usize;
                *rows.get_mut(place).ok_or_else(|| {
                    format!("accessor {number} has a sparse value for row {place}")
                })? = row(value);
            }
        }
        Ok(rows)
    }

    /// Rows of a vertex attribute, one per vertex; None if there is no such attribute.
    pub fn attribute<const N: usize>(
        &self,
        primitive: &Primitive,
        semantic: &Semantic,
        count: usize,
        kind: Dimensions,
    ) -> Parsed<Option<Vec<[f64; N]>>> {
        let Some(accessor) = primitive
            .get(semantic)
            .filter(|accessor| accessor.dimensions() == kind)
        else {
            return Ok(None);
        };
        let rows = self.rows(&accessor)?;
        if rows.len() != count {
            return Err(format!(
                "accessor {} has {} rows and should have {count}",
                accessor.index(),
                rows.len()
            ));
        }
        Ok(Some(rows))
    }
}

/// Removes required extensions from the JSON if they are read or harmless; the others are refused
/// by name.
fn take_extensions(json: &mut Value) -> Parsed<Vec<String>> {
    let Some(required) = json
        .as_object_mut()
        .and_then(|root| root.remove("extensionsRequired"))
    else {
        return Ok(Vec::new());
    };
    let names = required
        .as_array()
        .ok_or_else(|| unsound("`extensionsRequired` is not an array"))?;
    let names: Vec<&str> = names
        .iter()
        .map(|name| name.as_str().unwrap_or("?"))
        .collect();
    let unread: Vec<&str> = names
        .iter()
        .copied()
        .filter(|name| !READ.contains(name))
        .collect();
    let is_harmless = |name: &&&str| HARMLESS.iter().any(|beginning| name.starts_with(beginning));
    if let Some(name) = unread.iter().find(|name| !is_harmless(name)) {
        return Err(format!(
            "requires the extension {}, which is not read; gltf-transform, gltfpack or Blender writes the file without it",
            clipped(name)
        ));
    }
    Ok(unread
        .iter()
        .map(|name| {
            format!(
                "requires the extension {}, which is not read: base colours are drawn without it",
                clipped(name)
            )
        })
        .collect())
}

/// Removes attributes of applications and extensions, and the objects of the extension of
/// Gaussians, from the JSON.
fn take_attributes(json: &mut Value) -> Parsed<HashMap<(usize, usize), Own>> {
    let mut all = HashMap::new();
    let meshes = json.get_mut("meshes").and_then(Value::as_array_mut);
    for (mesh, fields) in meshes.into_iter().flatten().enumerate() {
        let primitives = fields.get_mut("primitives").and_then(Value::as_array_mut);
        for (number, primitive) in primitives.into_iter().flatten().enumerate() {
            let mut own = Own::default();
            if let Some(attributes) = primitive
                .get_mut("attributes")
                .and_then(Value::as_object_mut)
            {
                let names = attributes
                    .keys()
                    .filter(|name| name.starts_with('_') || name.contains(':'));
                for name in names.cloned().collect::<Vec<_>>() {
                    let index = attributes
                        .remove(&name)
                        .as_ref()
                        .and_then(Value::as_u64)
                        .and_then(|index| usize::try_from(index).ok());
                    let index = index.ok_or_else(|| {
                        unsound(format!(
                            "the attribute {} names no accessor",
                            clipped(&name)
                        ))
                    })?;
                    own.attributes.insert(name, index);
                }
            }
            own.gaussians = primitive
                .get_mut("extensions")
                .and_then(Value::as_object_mut)
                .and_then(|all| all.remove(GAUSSIANS));
            if !own.attributes.is_empty() || own.gaussians.is_some() {
                all.insert((mesh, number), own);
            }
        }
    }
    Ok(all)
}

/// Checks that the accessors of positions exist: the crate uses them before it validates them.
fn check_positions(root: &Root) -> Parsed<()> {
    let primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let positions = primitives.filter_map(|primitive| {
        primitive
            .attributes
            .get(&Checked::Valid(Semantic::Positions))
    });
    match positions
        .map(|index| index.value())
        .find(|&index| index >= root.accessors.len())
    {
        Some(index) => Err(format!(
            "is not valid glTF 2.0: positions name accessor {index} of {}",
            root.accessors.len()
        )),
        None => Ok(()),
    }
}

/// Checks the length in a GLB header: at least that of the header (the crate subtracts it), and at
/// most the file's.
fn check_length(bytes: &[u8]) -> Parsed<()> {
    let length = bytes
        .get(8..GLB_HEADER)
        .map(|length| u32::from_le_bytes(length.try_into().expect("four bytes")) as usize);
    match length {
        Some(length) if (GLB_HEADER..=bytes.len()).contains(&length) => Ok(()),
        Some(length) => Err(format!("declares {length} bytes, and has {}", bytes.len())),
        None => Err("ends inside its header".into()),
    }
}

/// The beginning of a message, which may list every error of a large file.
fn clipped_sentence(text: &str) -> String {
    let line: String = text.chars().take(200).collect();
    line.replace(char::is_control, " ")
}

/// The bytes of `count` rows, without the gap after the last; None if they end past the view or
/// rows overlap.
fn span(view: &[u8], offset: usize, count: usize, stride: usize, size: usize) -> Option<&[u8]> {
    if count == 0 {
        return Some(&[]);
    }
    let length = (count - 1).checked_mul(stride)?.checked_add(size)?;
    let end = offset.checked_add(length)?;
    (stride >= size).then(|| view.get(offset..end))?
}

fn component(kind: DataType, scaled: bool, bytes: &[u8]) -> f64 {
    let mut low_first = [0; 4];
    low_first[..kind.size()].copy_from_slice(&bytes[..kind.size()]);
    let word = u32::from_le_bytes(low_first);
    let (value, most) = match kind {
        DataType::I8 => (word as u8 as i8 as f64, i8::MAX as f64),
        DataType::U8 => (word as f64, u8::MAX as f64),
        DataType::I16 => (word as u16 as i16 as f64, i16::MAX as f64),
        DataType::U16 => (word as f64, u16::MAX as f64),
        DataType::U32 => (word as f64, u32::MAX as f64),
        DataType::F32 => return f32::from_bits(word) as f64,
    };
    if scaled {
        (value / most).max(-1.0)
    } else {
        value
    }
}

/// A URI's path with `%20` and the like decoded.
fn percent_decoded(uri: &str) -> Parsed<String> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, after @ ..] = rest {
        rest = after;
        let code = || {
            std::str::from_utf8(after.get(..2)?)
                .ok()
                .and_then(|hex| u8::from_str_radix(hex, 16).ok())
        };
        match (first, code()) {
            (b'%', Some(code)) => {
                bytes.push(code);
                rest = &after[2..];
            }
            _ => bytes.push(*first),
        }
    }
    String::from_utf8(bytes).map_err(|_| format!("`{}` is not UTF-8", clipped(uri)))
}

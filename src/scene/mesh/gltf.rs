//! GlTF: reads triangles from glTF 2.0, as JSON with its buffers beside it or in it, or as GLB.
//!
//! The crate `gltf` reads and validates the JSON; buffers, accessors and the tree of nodes are read here, every range checked, because that
//! crate's readers panic past a buffer's end and follow cycles for ever.
//!
//! - The default scene, else the first, else all nodes. A node's transform is that of its ancestors times its own.
//! - Colour is the base colour (of `KHR_materials_pbrSpecularGlossiness` the diffuse one) times its picture times colours at vertices; metalness and roughness are not read.
//! - Opacity follows `alphaMode`. A material that transmits (`KHR_materials_transmission`) keeps what it reflects.
//! - Points and lines are passed over, with a note; skins, morphs and animations are not read.

use super::{Alpha, Contents, Image, Material, Parsed, Raw, Texture, Wrap, beside};
use crate::output::text::clipped;
use ::gltf::accessor::{DataType, Dimensions};
use ::gltf::buffer::{Source, View};
use ::gltf::json::Root;
use ::gltf::json::validation::Checked;
use ::gltf::material::AlphaMode;
use ::gltf::mesh::Mode;
use ::gltf::texture::{Info, WrappingMode};
use ::gltf::{Accessor, Document, Gltf, Primitive, Semantic};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::{DMat3, DMat4, DVec2, DVec3};
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// Share of light that glass of index 1.5 reflects when seen from the front, ((1.5 − 1)/(1.5 + 1))²: what stays of a transmitting material.
const REFLECTED: f32 = 0.04;
/// Bytes of a GLB's header.
const GLB_HEADER: usize = 12;

/// Reads the bytes of a glTF or GLB file and the files that it names; the error is the second half of a sentence that begins with the
/// file's name.
pub(super) fn read(bytes: &[u8], folder: &Path) -> Parsed<Contents> {
    if bytes.starts_with(b"glTF") {
        check_length(bytes)?;
    }
    let unsound = |e: ::gltf::Error| format!("is no sound glTF 2.0: {}", clipped_sentence(&e.to_string()));
    let Gltf { document, blob } = Gltf::from_slice_without_validation(bytes).map_err(unsound)?;
    let root = document.into_json();
    check_positions(&root)?;
    let document = Document::from_json(root).map_err(unsound)?;
    let mut reading = Reading {
        document: &document,
        folder,
        buffers: Vec::new(),
        contents: Contents::default(),
        textures: HashMap::new(),
        passed_over: 0,
    };
    reading.read_buffers(blob)?;
    reading.read_materials()?;
    reading.read_nodes()?;
    let Reading { mut contents, passed_over, .. } = reading;
    if passed_over > 0 {
        contents.notes.push(format!("{passed_over} sets of points or lines have no surface and were left out"));
    }
    Ok(contents)
}

/// Positions name accessors that exist: the crate looks them up before it validates them.
fn check_positions(root: &Root) -> Parsed<()> {
    let primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let positions = primitives.filter_map(|primitive| primitive.attributes.get(&Checked::Valid(Semantic::Positions)));
    match positions.map(|index| index.value()).find(|&index| index >= root.accessors.len()) {
        Some(index) => Err(format!("is no sound glTF 2.0: positions name accessor {index} of {}", root.accessors.len())),
        None => Ok(()),
    }
}

/// A material's base colour and picture, or what older files have in their place.
fn base<'a>(material: &::gltf::Material<'a>) -> ([f32; 4], Option<Info<'a>>) {
    if let Some(older) = material.pbr_specular_glossiness() {
        return (older.diffuse_factor(), older.diffuse_texture());
    }
    let pbr = material.pbr_metallic_roughness();
    (pbr.base_color_factor(), pbr.base_color_texture())
}

/// A GLB says its length, which must be that of a header at least (the crate subtracts it) and lie in the file.
fn check_length(bytes: &[u8]) -> Parsed<()> {
    let length = bytes.get(8..GLB_HEADER).map(|length| u32::from_le_bytes(length.try_into().expect("four bytes")) as usize);
    match length {
        Some(length) if (GLB_HEADER..=bytes.len()).contains(&length) => Ok(()),
        Some(length) => Err(format!("says that it has {length} bytes, and has {}", bytes.len())),
        None => Err("ends inside its header".into()),
    }
}

/// The beginning of a message, which may list every fault of a large file.
fn clipped_sentence(text: &str) -> String {
    let line: String = text.chars().take(200).collect();
    line.replace(char::is_control, " ")
}

struct Reading<'a> {
    document: &'a Document,
    folder: &'a Path,
    buffers: Vec<Vec<u8>>,
    contents: Contents,
    /// Index into the contents' textures by that of the file's.
    textures: HashMap<usize, usize>,
    passed_over: usize,
}

/// A material's way from a vertex's texture coordinates to its picture's.
struct Mapping {
    set: u32,
    /// Offset, rotation and scale of `KHR_texture_transform`.
    offset: DVec2,
    turn: DVec2,
    scale: DVec2,
}

impl<'a> Reading<'a> {
    fn read_buffers(&mut self, mut blob: Option<Vec<u8>>) -> Parsed<()> {
        for buffer in self.document.buffers() {
            let number = buffer.index();
            let bytes = match buffer.source() {
                Source::Bin => blob.take().ok_or_else(|| format!("buffer {number} has no data"))?,
                Source::Uri(uri) => self.resource(uri).map_err(|e| format!("buffer {number}: {e}"))?,
            };
            if bytes.len() < buffer.length() {
                return Err(format!("buffer {number} should have {} bytes and has {}", buffer.length(), bytes.len()));
            }
            self.buffers.push(bytes);
        }
        Ok(())
    }

    /// Bytes behind a URI: data in it, or a file beside the mesh.
    fn resource(&self, uri: &str) -> Parsed<Vec<u8>> {
        let Some(data) = uri.strip_prefix("data:") else {
            if uri.contains("://") {
                return Err(format!("`{}` lies elsewhere; only files beside the mesh are read", clipped(uri)));
            }
            return beside(self.folder, &percent_decoded(uri)?);
        };
        let (_, encoded) = data.split_once(";base64,").ok_or("data in a URI must be `;base64,`")?;
        STANDARD.decode(encoded).map_err(|e| format!("data in a URI cannot be decoded: {e}"))
    }

    fn view(&self, view: &View) -> Parsed<&[u8]> {
        let buffer = &self.buffers[view.buffer().index()];
        let end = view.offset().checked_add(view.length()).filter(|&end| end <= buffer.len());
        let end = end.ok_or_else(|| format!("buffer view {} ends past buffer {}", view.index(), view.buffer().index()))?;
        Ok(&buffer[view.offset()..end])
    }

    /// Rows of an accessor, N numbers each; integers are scaled to [0, 1] or [−1, 1] where the file says so.
    fn rows<const N: usize>(&self, accessor: &Accessor) -> Parsed<Vec<[f64; N]>> {
        let number = accessor.index();
        let view = accessor.view().ok_or_else(|| format!("accessor {number} has no buffer view"))?;
        let stride = view.stride().unwrap_or(accessor.size());
        let bytes = span(self.view(&view)?, accessor.offset(), accessor.count(), stride, accessor.size())
            .ok_or_else(|| format!("accessor {number} ends past buffer view {}", view.index()))?;
        let (kind, scaled) = (accessor.data_type(), accessor.normalized());
        let row = |bytes: &[u8]| std::array::from_fn(|i| component(kind, scaled, &bytes[i * kind.size()..]));
        let mut rows: Vec<[f64; N]> = bytes.chunks(stride.max(1)).map(row).collect();
        if let Some(sparse) = accessor.sparse() {
            let (places, values) = (sparse.indices(), sparse.values());
            let kind_of_index = match places.index_type() {
                ::gltf::accessor::sparse::IndexType::U8 => DataType::U8,
                ::gltf::accessor::sparse::IndexType::U16 => DataType::U16,
                ::gltf::accessor::sparse::IndexType::U32 => DataType::U32,
            };
            let past = || format!("accessor {number} has sparse values past a buffer view");
            let (place_bytes, value_bytes) = (self.view(&places.view())?, self.view(&values.view())?);
            let place_size = kind_of_index.size();
            let place_bytes = span(place_bytes, places.offset(), sparse.count(), place_size, place_size).ok_or_else(past)?;
            let value_bytes = span(value_bytes, values.offset(), sparse.count(), accessor.size(), accessor.size()).ok_or_else(past)?;
            for (place, value) in place_bytes.chunks(place_size).zip(value_bytes.chunks(accessor.size())) {
                let place = component(kind_of_index, false, place) as usize;
                *rows.get_mut(place).ok_or_else(|| format!("accessor {number} has a sparse value for row {place}"))? = row(value);
            }
        }
        Ok(rows)
    }

    fn read_materials(&mut self) -> Parsed<()> {
        for material in self.document.materials() {
            let (factor, picture) = base(&material);
            let texture = picture.map(|info| self.texture(&info)).transpose()?;
            let through = material.transmission().map_or(0.0, |t| t.transmission_factor().clamp(0.0, 1.0));
            let kept = 1.0 - through * (1.0 - REFLECTED);
            let alpha = match material.alpha_mode() {
                AlphaMode::Opaque => Alpha::Opaque(kept),
                AlphaMode::Mask => Alpha::Mask(material.alpha_cutoff().unwrap_or(0.5)),
                AlphaMode::Blend => Alpha::Blend,
            };
            let [r, g, b, a] = factor.map(|factor| factor.clamp(0.0, 1.0));
            self.contents.materials.push(Material { rgba: [r, g, b, a * kept], texture, alpha });
        }
        // That of triangles without one.
        self.contents.materials.push(Material { alpha: Alpha::Opaque(1.0), ..Material::none() });
        Ok(())
    }

    fn texture(&mut self, info: &Info) -> Parsed<usize> {
        let texture = info.texture();
        if let Some(&known) = self.textures.get(&texture.index()) {
            return Ok(known);
        }
        let number = texture.source().index();
        let of_image = |e: String| format!("image {number} {e}");
        let image = &self.document.as_json().images[number];
        let bytes = match (&image.uri, &image.buffer_view) {
            (Some(uri), _) => self.resource(uri).map_err(|e| format!("image {number}: {e}"))?,
            (None, Some(view)) => {
                let view = self.document.views().nth(view.value()).ok_or_else(|| of_image("has no data".into()))?;
                self.view(&view)?.to_vec()
            }
            (None, None) => return Err(of_image("has no data".into())),
        };
        let wrap = |mode| match mode {
            WrappingMode::Repeat => Wrap::Repeat,
            WrappingMode::MirroredRepeat => Wrap::Mirror,
            WrappingMode::ClampToEdge => Wrap::Clamp,
        };
        let sampler = texture.sampler();
        self.contents.reserve_picture(&bytes).map_err(of_image)?;
        let image = Arc::new(Image::decode(&bytes).map_err(of_image)?);
        self.contents.textures.push(Texture { image, wrap: [wrap(sampler.wrap_s()), wrap(sampler.wrap_t())] });
        self.textures.insert(texture.index(), self.contents.textures.len() - 1);
        Ok(self.contents.textures.len() - 1)
    }

    /// Walks the tree from its roots; a node that is met twice makes it none.
    fn read_nodes(&mut self) -> Parsed<()> {
        let document = self.document;
        let scene = document.default_scene().or_else(|| document.scenes().next());
        let mut open: Vec<_> = match scene {
            Some(scene) => scene.nodes().collect(),
            None => {
                let children: Vec<usize> = document.nodes().flat_map(|node| node.children().map(|child| child.index())).collect();
                let mut is_root = vec![true; document.nodes().len()];
                children.into_iter().for_each(|child| is_root[child] = false);
                document.nodes().filter(|node| is_root[node.index()]).collect()
            }
        };
        open.reverse();
        let mut open: Vec<_> = open.into_iter().map(|node| (node, DMat4::IDENTITY)).collect();
        let mut met = vec![false; document.nodes().len()];
        while let Some((node, above)) = open.pop() {
            if std::mem::replace(&mut met[node.index()], true) {
                return Err(format!("node {} is met twice, so its nodes are no tree", node.index()));
            }
            let transform = above * DMat4::from_cols_array_2d(&node.transform().matrix().map(|column| column.map(f64::from)));
            for primitive in node.mesh().iter().flat_map(|mesh| mesh.primitives()) {
                self.primitive(&primitive, transform).map_err(|e| format!("node {}: {e}", node.index()))?;
            }
            let children: Vec<_> = node.children().collect();
            open.extend(children.into_iter().rev().map(|child| (child, transform)));
        }
        Ok(())
    }

    fn attribute<const N: usize>(
        &self,
        primitive: &Primitive,
        semantic: &Semantic,
        count: usize,
        kind: Dimensions,
    ) -> Parsed<Option<Vec<[f64; N]>>> {
        let Some(accessor) = primitive.get(semantic).filter(|accessor| accessor.dimensions() == kind) else { return Ok(None) };
        let rows = self.rows(&accessor)?;
        if rows.len() != count {
            return Err(format!("accessor {} has {} rows and should have {count}", accessor.index(), rows.len()));
        }
        Ok(Some(rows))
    }

    fn primitive(&mut self, primitive: &Primitive, transform: DMat4) -> Parsed<()> {
        if matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            self.passed_over += 1;
            return Ok(());
        }
        let positions = primitive.get(&Semantic::Positions).filter(|accessor| accessor.dimensions() == Dimensions::Vec3);
        let positions = positions.ok_or("a set of triangles has no positions")?;
        let count = positions.count();
        let corners = self.corners(primitive, count)?;
        self.contents.reserve(corners.len())?;
        let places: Vec<[f64; 3]> = self.rows(&positions)?;

        let normals: Option<Vec<[f64; 3]>> = self.attribute(primitive, &Semantic::Normals, count, Dimensions::Vec3)?;
        let (_, info) = base(&primitive.material());
        let mapping = Mapping::of(info.as_ref());
        let uv: Option<Vec<[f64; 2]>> = self.attribute(primitive, &Semantic::TexCoords(mapping.set), count, Dimensions::Vec2)?;
        let colours: Option<Vec<[f64; 4]>> = self.attribute(primitive, &Semantic::Colors(0), count, Dimensions::Vec4)?;
        let colours_3: Option<Vec<[f64; 3]>> = self.attribute(primitive, &Semantic::Colors(0), count, Dimensions::Vec3)?;

        let material = primitive.material().index().unwrap_or(self.document.materials().len()) as u32;
        let linear = DMat3::from_mat4(transform);
        let normal_map = linear.inverse().transpose();
        // A mirror turns the order of corners, and with it the side that a face shows.
        let mirrored = linear.determinant() < 0.0;
        let rgba = |i: usize| match (&colours, &colours_3) {
            (Some(rows), _) => rows[i].map(|c| c as f32),
            (None, Some(rows)) => [rows[i][0] as f32, rows[i][1] as f32, rows[i][2] as f32, 1.0],
            (None, None) => [1.0; 4],
        };
        for [a, b, c] in corners {
            let corners = if mirrored { [a, c, b] } else { [a, b, c] };
            self.contents.triangles.push(Raw {
                corners: corners.map(|i| transform.transform_point3(DVec3::from_array(places[i]))),
                normals: normals.as_ref().map(|rows| corners.map(|i| normal_map * DVec3::from_array(rows[i]))),
                uv: uv.as_ref().map(|rows| corners.map(|i| mapping.apply(rows[i]))),
                rgba: corners.map(rgba),
                material,
                flat: true,
            });
        }
        Ok(())
    }

    /// Indices of triangles' corners, all in range.
    fn corners(&self, primitive: &Primitive, count: usize) -> Parsed<Vec<[usize; 3]>> {
        let order: Vec<usize> = match primitive.indices() {
            None => (0..count).collect(),
            Some(accessor) if accessor.dimensions() == Dimensions::Scalar => {
                self.rows::<1>(&accessor)?.into_iter().map(|[index]| index as usize).collect()
            }
            Some(accessor) => return Err(format!("accessor {} has no indices", accessor.index())),
        };
        if let Some(index) = order.iter().find(|&&index| index >= count) {
            return Err(format!("a triangle names number {} of {count} vertices", index + 1));
        }
        Ok(match primitive.mode() {
            Mode::TriangleStrip => order.windows(3).enumerate().map(|(i, w)| [w[i % 2], w[1 - i % 2], w[2]]).collect(),
            Mode::TriangleFan => order.windows(2).skip(1).map(|w| [order[0], w[0], w[1]]).collect(),
            _ => order.chunks_exact(3).map(|w| [w[0], w[1], w[2]]).collect(),
        })
    }
}

impl Mapping {
    fn of(info: Option<&Info>) -> Mapping {
        let transform = info.and_then(|info| info.texture_transform());
        let set = transform.as_ref().and_then(|t| t.tex_coord()).unwrap_or(info.map_or(0, |info| info.tex_coord()));
        let pair = |pair: [f32; 2]| DVec2::from_array(pair.map(f64::from));
        let angle = transform.as_ref().map_or(0.0, |t| t.rotation() as f64);
        Mapping {
            set,
            offset: transform.as_ref().map_or(DVec2::ZERO, |t| pair(t.offset())),
            turn: DVec2::new(libm::cos(angle), libm::sin(angle)),
            scale: transform.as_ref().map_or(DVec2::ONE, |t| pair(t.scale())),
        }
    }

    /// Offset after rotation after scale (`KHR_texture_transform`; v grows down).
    fn apply(&self, uv: [f64; 2]) -> [f32; 2] {
        let scaled = DVec2::from_array(uv) * self.scale;
        let (cos, sin) = (self.turn.x, self.turn.y);
        let turned = DVec2::new(cos * scaled.x + sin * scaled.y, cos * scaled.y - sin * scaled.x);
        (turned + self.offset).to_array().map(|c| c as f32)
    }
}

/// The bytes of `count` rows, the last one without what lies between rows; none where they end past the view or rows overlap.
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
    if scaled { (value / most).max(-1.0) } else { value }
}

/// A URI's path with `%20` and its like decoded.
fn percent_decoded(uri: &str) -> Parsed<String> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, after @ ..] = rest {
        rest = after;
        let code = || std::str::from_utf8(after.get(..2)?).ok().and_then(|hex| u8::from_str_radix(hex, 16).ok());
        match (first, code()) {
            (b'%', Some(code)) => {
                bytes.push(code);
                rest = &after[2..];
            }
            _ => bytes.push(*first),
        }
    }
    String::from_utf8(bytes).map_err(|_| format!("`{}` is no UTF-8", clipped(uri)))
}

//! GlTF: reads triangles from glTF 2.0, as JSON with buffers inside or in separate files, or as
//! GLB.
//!
//! JSON, buffers and accessors are read by [`crate::scene::gltf`].
//!
//! - The default scene is read, else the first, else all nodes. A node's transform is that of its
//!   ancestors times its own.
//! - Colour is the base colour (for `KHR_materials_pbrSpecularGlossiness` the diffuse one) times
//!   its picture times vertex colours; metalness and roughness are not read.
//! - Opacity follows `alphaMode`. A material that transmits (`KHR_materials_transmission`) keeps
//!   only its reflected part.
//! - Points and lines are skipped with a note; skins, morphs and animations are not read.

use super::{Alpha, Contents, Image, Material, Parsed, Raw, Texture, Wrap};
use crate::scene::gltf::File;
use ::gltf::accessor::Dimensions;
use ::gltf::material::AlphaMode;
use ::gltf::mesh::Mode;
use ::gltf::texture::{Info, WrappingMode};
use ::gltf::{Primitive, Semantic};
use glam::{DMat3, DMat4, DVec2, DVec3};
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// Share of light that glass of index 1.5 reflects, seen from the front, ((1.5 − 1)/(1.5 + 1))²:
/// the opacity of a transmitting material.
const REFLECTED: f32 = 0.04;

/// Reads the bytes of a glTF or GLB file and the files that it names. The error is the second half
/// of a sentence that begins with the file's name.
pub(super) fn read(bytes: &[u8], folder: &Path) -> Parsed<Contents> {
    let file = File::parse(bytes, folder)?;
    let mut contents = Contents::default();
    contents.notes.extend(file.notes.iter().cloned());
    let mut reading = Reading {
        file: &file,
        contents,
        textures: HashMap::new(),
        passed_over: 0,
        gaussians: 0,
    };
    reading.read_materials()?;
    for (node, transform) in file.nodes()? {
        for primitive in node
            .mesh()
            .iter()
            .flat_map(|mesh| mesh.primitives().map(|primitive| (mesh.index(), primitive)))
        {
            reading
                .primitive(primitive, transform)
                .map_err(|e| format!("node {}: {e}", node.index()))?;
        }
    }
    let Reading {
        mut contents,
        passed_over,
        gaussians,
        ..
    } = reading;
    if passed_over > 0 {
        contents.notes.push(format!(
            "{passed_over} sets of points or lines have no surface and were left out"
        ));
    }
    if gaussians > 0 && contents.triangles.is_empty() {
        return Err("holds Gaussians (KHR_gaussian_splatting) and no triangles; `splatsim run` draws them as they are".into());
    }
    Ok(contents)
}

/// A material's base colour and picture, or their equivalents in older files.
fn base<'a>(material: &::gltf::Material<'a>) -> ([f32; 4], Option<Info<'a>>) {
    if let Some(older) = material.pbr_specular_glossiness() {
        return (older.diffuse_factor(), older.diffuse_texture());
    }
    let pbr = material.pbr_metallic_roughness();
    (pbr.base_color_factor(), pbr.base_color_texture())
}

struct Reading<'a> {
    file: &'a File,
    contents: Contents,
    /// Index into the contents' textures, by that of the file.
    textures: HashMap<usize, usize>,
    /// Number of sets of points or lines, and of Gaussians.
    passed_over: usize,
    gaussians: usize,
}

/// Mapping from a vertex's texture coordinates to those of the picture.
struct Mapping {
    set: u32,
    /// Offset, rotation and scale of `KHR_texture_transform`.
    offset: DVec2,
    turn: DVec2,
    scale: DVec2,
}

impl Reading<'_> {
    fn read_materials(&mut self) -> Parsed<()> {
        for material in self.file.document.materials() {
            let (factor, picture) = base(&material);
            let texture = picture.map(|info| self.texture(&info)).transpose()?;
            let through = material
                .transmission()
                .map_or(0.0, |t| t.transmission_factor().clamp(0.0, 1.0));
            let kept = 1.0 - through * (1.0 - REFLECTED);
            let alpha = match material.alpha_mode() {
                AlphaMode::Opaque => Alpha::Opaque(kept),
                AlphaMode::Mask => Alpha::Mask(material.alpha_cutoff().unwrap_or(0.5)),
                AlphaMode::Blend => Alpha::Blend,
            };
            let [r, g, b, a] = factor.map(|factor| factor.clamp(0.0, 1.0));
            self.contents.materials.push(Material {
                rgba: [r, g, b, a * kept],
                texture,
                alpha,
            });
        }
        // The material of triangles without one.
        self.contents.materials.push(Material {
            alpha: Alpha::Opaque(1.0),
            ..Material::none()
        });
        Ok(())
    }

    fn texture(&mut self, info: &Info) -> Parsed<usize> {
        let texture = info.texture();
        if let Some(&known) = self.textures.get(&texture.index()) {
            return Ok(known);
        }
        let number = texture.source().index();
        let of_image = |e: String| format!("image {number} {e}");
        let image = &self.file.document.as_json().images[number];
        let bytes = match (&image.uri, &image.buffer_view) {
            (Some(uri), _) => self
                .file
                .resource(uri)
                .map_err(|e| format!("image {number}: {e}"))?,
            (None, Some(view)) => {
                let view = self
                    .file
                    .document
                    .views()
                    .nth(view.value())
                    .ok_or_else(|| of_image("has no data".into()))?;
                self.file.view(&view)?.to_vec()
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
        self.contents.textures.push(Texture {
            image,
            wrap: [wrap(sampler.wrap_s()), wrap(sampler.wrap_t())],
        });
        self.textures
            .insert(texture.index(), self.contents.textures.len() - 1);
        Ok(self.contents.textures.len() - 1)
    }

    fn primitive(&mut self, (mesh, primitive): (usize, Primitive), transform: DMat4) -> Parsed<()> {
        if self.file.is_gaussians(mesh, primitive.index()) {
            self.gaussians += 1;
        }
        if matches!(
            primitive.mode(),
            Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip
        ) {
            self.passed_over += 1;
            return Ok(());
        }
        let positions = primitive
            .get(&Semantic::Positions)
            .filter(|accessor| accessor.dimensions() == Dimensions::Vec3);
        let positions = positions.ok_or("a set of triangles has no positions")?;
        let count = positions.count();
        let corners = self.corners(&primitive, count)?;
        self.contents.reserve(corners.len())?;
        let places: Vec<[f64; 3]> = self.file.rows(&positions)?;

        let normals: Option<Vec<[f64; 3]>> =
            self.file
                .attribute(&primitive, &Semantic::Normals, count, Dimensions::Vec3)?;
        let (_, info) = base(&primitive.material());
        let mapping = Mapping::of(info.as_ref());
        let uv: Option<Vec<[f64; 2]>> = self.file.attribute(
            &primitive,
            &Semantic::TexCoords(mapping.set),
            count,
            Dimensions::Vec2,
        )?;
        let colours: Option<Vec<[f64; 4]>> =
            self.file
                .attribute(&primitive, &Semantic::Colors(0), count, Dimensions::Vec4)?;
        let colours_3: Option<Vec<[f64; 3]>> =
            self.file
                .attribute(&primitive, &Semantic::Colors(0), count, Dimensions::Vec3)?;

        let material = primitive
            .material()
            .index()
            .unwrap_or(self.file.document.materials().len()) as u32;
        let linear = DMat3::from_mat4(transform);
        let normal_map = linear.inverse().transpose();
        // A mirroring transform reverses the order of corners, and thus the front of a face.
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
                normals: normals
                    .as_ref()
                    .map(|rows| corners.map(|i| normal_map * DVec3::from_array(rows[i]))),
                uv: uv
                    .as_ref()
                    .map(|rows| corners.map(|i| mapping.apply(rows[i]))),
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
            Some(accessor) if accessor.dimensions() == Dimensions::Scalar => self
                .file
                .rows::<1>(&accessor)?
                .into_iter()
                .map(|[index]| index as usize)
                .collect(),
            Some(accessor) => return Err(format!("accessor {} has no indices", accessor.index())),
        };
        if let Some(index) = order.iter().find(|&&index| index >= count) {
            return Err(format!(
                "a triangle names number {} of {count} vertices",
                index + 1
            ));
        }
        Ok(match primitive.mode() {
            Mode::TriangleStrip => order
                .windows(3)
                .enumerate()
                .map(|(i, w)| [w[i % 2], w[1 - i % 2], w[2]])
                .collect(),
            Mode::TriangleFan => order
                .windows(2)
                .skip(1)
                .map(|w| [order[0], w[0], w[1]])
                .collect(),
            _ => order.chunks_exact(3).map(|w| [w[0], w[1], w[2]]).collect(),
        })
    }
}

impl Mapping {
    fn of(info: Option<&Info>) -> Mapping {
        let transform = info.and_then(|info| info.texture_transform());
        let set = transform
            .as_ref()
            .and_then(|t| t.tex_coord())
            .unwrap_or(info.map_or(0, |info| info.tex_coord()));
        let pair = |pair: [f32; 2]| DVec2::from_array(pair.map(f64::from));
        let angle = transform.as_ref().map_or(0.0, |t| t.rotation() as f64);
        Mapping {
            set,
            offset: transform.as_ref().map_or(DVec2::ZERO, |t| pair(t.offset())),
            turn: DVec2::new(libm::cos(angle), libm::sin(angle)),
            scale: transform.as_ref().map_or(DVec2::ONE, |t| pair(t.scale())),
        }
    }

    /// Offset after rotation after scale (`KHR_texture_transform`; v points down).
    fn apply(&self, uv: [f64; 2]) -> [f32; 2] {
        let scaled = DVec2::from_array(uv) * self.scale;
        let (cos, sin) = (self.turn.x, self.turn.y);
        let turned = DVec2::new(
            cos * scaled.x + sin * scaled.y,
            cos * scaled.y - sin * scaled.x,
        );
        (turned + self.offset).to_array().map(|c| c as f32)
    }
}

//! PLY: converts a PLY file's faces to triangles; vertices, faces, colours and encodings are read
//! as for clouds ([`crate::scene::ply`]).
//!
//! - Texture coordinates are those of faces (`texcoord`), else of vertices. Pictures are the files
//!   of `comment TextureFile`, as written by MeshLab. The picture of a triangle replaces its other
//!   colours.
//! - Other colours are those of faces if vertices have none, or all the same: MeshLab writes a grey
//!   for vertices without a colour.

use super::{Alpha, Contents, GREY, Image, Material, Parsed, Raw, Texture, Wrap, read_inside};
use crate::output::text::clipped;
use crate::scene::ply;
use std::path::Path;
use std::sync::Arc;

/// Reads the bytes of a PLY file and the pictures that it names. The error is the second half of a
/// sentence that begins with the file's name.
pub(super) fn read(bytes: &[u8], folder: &Path) -> Parsed<Contents> {
    let ply::Faced {
        vertices,
        uv,
        has_normals,
        has_colours,
        triangles,
        refused,
        pictures,
        notes,
    } = ply::parse_faced(bytes)?;
    if refused > 0 {
        return Err(format!(
            "{refused} of {} triangles name vertices that do not exist",
            refused + triangles.len()
        ));
    }
    let mut contents = Contents {
        notes,
        ..Contents::default()
    };
    contents.reserve(triangles.len())?;
    contents.triangles.reserve_exact(triangles.len());
    let colours_vary = has_colours
        && vertices
            .iter()
            .any(|v| v.rgb != vertices[0].rgb || v.opacity != vertices[0].opacity);
    let faces_vary = triangles
        .iter()
        .any(|triangle| triangle.rgba.is_some() && triangle.rgba != triangles[0].rgba);
    if colours_vary && faces_vary {
        contents
            .notes
            .push("has colours of vertices and of faces; those of vertices are drawn".into());
    }
    for triangle in triangles {
        let vertex = triangle.corners.map(|corner| &vertices[corner as usize]);
        let uv = triangle.uv.or_else(|| {
            uv.as_ref()
                .map(|uv| triangle.corners.map(|corner| uv[corner as usize]))
        });
        let picture = triangle
            .picture
            .filter(|_| uv.is_some() && !pictures.is_empty());
        if let Some(number) = picture.filter(|&number| number as usize >= pictures.len()) {
            return Err(format!(
                "a face has the picture {number}, and the header names {} in lines `comment TextureFile`",
                pictures.len()
            ));
        }
        let of_vertices = vertex.map(|v| {
            [
                v.rgb[0] as f32,
                v.rgb[1] as f32,
                v.rgb[2] as f32,
                v.opacity as f32,
            ]
        });
        let of_face = triangle.rgba.filter(|_| !colours_vary);
        let rgba = match picture {
            Some(_) => [[1.0; 4]; 3],
            None => of_face.unwrap_or(if has_colours {
                of_vertices
            } else {
                of_vertices.map(|[.., alpha]| [GREY[0], GREY[1], GREY[2], alpha])
            }),
        };
        contents.triangles.push(Raw {
            corners: vertex.map(|v| v.position),
            normals: has_normals.then(|| vertex.map(|v| v.normal)),
            uv,
            rgba,
            // The first material is for triangles without a picture.
            material: picture.map_or(0, |number| number + 1),
            flat: false,
        });
    }
    contents.add_pictures(&pictures, folder)?;
    Ok(contents)
}

impl Contents {
    /// One material without a picture, then one per picture; unused pictures are not read.
    fn add_pictures(&mut self, names: &[String], folder: &Path) -> Parsed<()> {
        self.materials.push(Material::none());
        let mut is_used = vec![false; names.len()];
        self.triangles
            .iter()
            .filter(|triangle| triangle.material > 0)
            .for_each(|triangle| is_used[triangle.material as usize - 1] = true);
        for (name, is_used) in names.iter().zip(is_used) {
            let mut material = Material::none();
            if is_used {
                let of_file = |e: String| format!("`{}` {e}", clipped(name));
                let bytes = read_inside(folder, name)?;
                self.reserve_picture(&bytes).map_err(of_file)?;
                let image = Arc::new(Image::decode(&bytes).map_err(of_file)?);
                self.textures.push(Texture {
                    image,
                    wrap: [Wrap::Repeat; 2],
                });
                material = Material {
                    texture: Some(self.textures.len() - 1),
                    alpha: Alpha::Blend,
                    ..Material::none()
                };
            }
            self.materials.push(material);
        }
        Ok(())
    }
}

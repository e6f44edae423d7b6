//! Mesh: reads triangles and their materials from a file, complete and checked, for sampling into
//! points.
//!
//! The data of a [`Mesh`] are complete: every corner has a normal and a colour, every triangle has
//! an area and an existing material. Holes in its surface are allowed. Triangles without area are
//! left out and counted.
//!
//! Readers: Wavefront OBJ with its MTL, PLY with faces, glTF 2.0 and GLB, STL. Each converts bytes,
//! and files in the mesh's folder, to `Raw` triangles. Paths out of that folder are refused.

mod gltf;
mod obj;
mod picture;
mod ply;
mod stl;

pub use picture::{Image, Texture, Wrap};

use super::formats::{self, Content};
use super::{memory, unit};
use crate::error::{Error, Result};
use crate::input;
use crate::output::text::clipped;
use glam::DVec3;
use std::collections::HashMap;
use std::ffi::OsStr;
use std::path::{Component, Path, PathBuf};

type Parsed<T> = std::result::Result<T, String>;

/// Coordinates beyond this count as missing, as in clouds ([`super::ply`]).
use super::ply::FARTHEST;

/// Most bytes per triangle while it is read and sampled: two copies of [`Raw`], one of
/// [`Triangle`], sums of areas.
const TRIANGLE_BYTES: u64 = 1_000;
/// Most bytes per texel: decoded, as bytes, and in a pyramid.
const TEXEL_BYTES: u64 = 24;
/// Default colour, linear light, as for points without a colour.
const GREY: [f32; 4] = [0.5, 0.5, 0.5, 1.0];
/// Area over the square of the longest side below which a triangle counts as flat: the direction of
/// its normal would be determined by f64 rounding.
const LEAST_SHAPE: f64 = 1e-14;
/// Cosine between a face and the mean of the faces around a corner, above which the corner gets the
/// mean normal (40°): sharper edges stay sharp. Two faces at a right angle are 45° from their mean,
/// the three of a cube 55°.
const SMOOTH_COSINE: f64 = 0.766;

/// A surface of triangles with their colours.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Never empty; in the file's order.
    pub triangles: Vec<Triangle>,
    /// Materials that triangles refer to; never empty.
    pub materials: Vec<Material>,
    /// Textures that materials refer to.
    pub textures: Vec<Texture>,
    /// Triangles without area, which were left out.
    pub degenerate: usize,
    /// Notes on omissions and oddities, one sentence each.
    pub notes: Vec<String>,
}

/// Three corners with an area above 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// World space.
    pub corners: [DVec3; 3],
    /// Unit vectors, world space.
    pub normals: [[f32; 3]; 3],
    /// Texture coordinates; (0, 0) is the picture's upper left corner, (1, 1) the lower right one.
    pub uv: Option<[[f32; 2]; 3]>,
    /// Linear light and opacity, factors on the material's.
    pub rgba: [[f32; 4]; 3],
    /// Index into [`Mesh::materials`].
    pub material: u32,
}

impl Triangle {
    /// Twice the area, along the geometric normal.
    pub fn twice_area(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a)
    }

    /// The geometric unit normal.
    pub fn face(&self) -> DVec3 {
        unit(self.twice_area()).unwrap_or(DVec3::Z)
    }
}

/// Colour and opacity of triangles.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Linear light and opacity, each in [0, 1].
    pub rgba: [f32; 4],
    /// Index into [`Mesh::textures`]: a picture that multiplies colours and opacities.
    pub texture: Option<usize>,
    /// Use of opacity.
    pub alpha: Alpha,
}

impl Material {
    /// The default material.
    fn none() -> Material {
        Material {
            rgba: [1.0; 4],
            texture: None,
            alpha: Alpha::Blend,
        }
    }
}

/// Use of the product of all opacities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Alpha {
    /// It is the opacity.
    Blend,
    /// It is ignored; the opacity is this.
    Opaque(f32),
    /// At or above this opaque, below transparent.
    Mask(f32),
}

impl Alpha {
    /// The opacity.
    pub fn of(self, product: f64) -> f64 {
        match self {
            Alpha::Blend => product.clamp(0.0, 1.0),
            Alpha::Opaque(opacity) => opacity as f64,
            Alpha::Mask(least) => f64::from(product >= least as f64),
        }
    }
}

/// A triangle of a file.
#[derive(Clone, Copy, Debug)]
struct Raw {
    corners: [DVec3; 3],
    normals: Option<[DVec3; 3]>,
    uv: Option<[[f32; 2]; 3]>,
    rgba: [[f32; 4]; 3],
    material: u32,
    /// Whether missing normals are those of the face, not smoothed.
    flat: bool,
}

/// Results of a reader.
#[derive(Debug, Default)]
struct Contents {
    triangles: Vec<Raw>,
    materials: Vec<Material>,
    textures: Vec<Texture>,
    notes: Vec<String>,
}

/// The second argument is the folder of the file.
type Reader = fn(&[u8], &Path) -> Parsed<Contents>;

fn reader(content: Option<Content>) -> Option<Reader> {
    match content? {
        Content::Obj => Some(obj::read),
        Content::Ply => Some(ply::read),
        Content::Gltf => Some(gltf::read),
        Content::Stl => Some(|bytes, _| stl::read(bytes)),
        _ => None,
    }
}

/// The square from 0 to 1 of the plane z = 0, with an upright picture: the only mesh without a
/// file.
const PLANE: &str =
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";

impl Mesh {
    /// The built-in mesh `plane`: the square from 0 to 1 of the plane z = 0, with texture
    /// coordinates.
    pub fn plane() -> Mesh {
        let contents = obj::read(PLANE.as_bytes(), Path::new("")).and_then(Contents::checked);
        contents.expect("a square is sound")
    }

    /// Reads a mesh, by its content, or by its extension if the content is ambiguous. `plane` is
    /// [`Mesh::plane`] if there is no such file.
    ///
    /// # Errors
    /// [`Error::Input`], a sentence with the file, the line or part, and the problem.
    pub fn load(path: impl AsRef<OsStr>) -> Result<Mesh> {
        let path = Path::new(path.as_ref());
        let name = path.to_string_lossy();
        if name == "plane" && !path.is_file() {
            return Ok(Mesh::plane());
        }
        let input_error = |sentence: String| Error::input(format!("{name}: {sentence}"));
        let bytes = input::read(path).map_err(|e| input_error(format!("cannot be read: {e}")))?;
        let content = formats::mesh(&bytes, path);
        let reader = reader(content).ok_or_else(|| input_error(formats::no_mesh(content, path)))?;
        let mut contents =
            reader(&bytes, path.parent().unwrap_or(Path::new(""))).map_err(input_error)?;
        contents.notes.extend(formats::contradiction(path));
        contents.checked().map_err(input_error)
    }
}

impl Contents {
    /// Checks that there is memory for this many more triangles.
    fn reserve(&self, more: usize) -> Parsed<()> {
        memory::check(
            (self.triangles.len() as u64).saturating_add(more as u64),
            "triangles",
            TRIANGLE_BYTES,
        )
    }

    /// Checks that there is memory for this picture.
    fn reserve_picture(&self, bytes: &[u8]) -> Parsed<()> {
        let held = self
            .textures
            .iter()
            .map(|texture| texture.image.texels.len() as u64)
            .sum::<u64>();
        memory::check(
            held.saturating_add(Image::texels(bytes)?),
            "texels",
            TEXEL_BYTES,
        )
        .map_err(|e| format!("is too large: {e}"))
    }

    fn checked(mut self) -> Parsed<Mesh> {
        let all = self.triangles.len();
        if all == 0 {
            return Err("has no triangles, so there is no surface to sample".into());
        }
        if let Some(number) = self
            .triangles
            .iter()
            .position(|t| !t.corners.iter().all(|&corner| is_placed(corner)))
        {
            return Err(format!(
                "triangle {number} of {all} has a corner without a finite position"
            ));
        }
        if let Some(number) = self.triangles.iter().position(|t| !is_finite(t)) {
            return Err(format!(
                "triangle {number} of {all} has a texture coordinate or a colour that is not finite"
            ));
        }
        self.triangles
            .retain(|triangle| has_area(&triangle.corners));
        let degenerate = all - self.triangles.len();
        if self.triangles.is_empty() {
            return Err(format!("has no triangle with an area among its {all}"));
        }
        if self.materials.is_empty() {
            self.materials.push(Material::none());
        }
        let smooth = Smooth::of(&self.triangles);
        let triangles = self
            .triangles
            .iter()
            .map(|raw| smooth.complete(raw))
            .collect();
        Ok(Mesh {
            triangles,
            materials: self.materials,
            textures: self.textures,
            degenerate,
            notes: self.notes,
        })
    }
}

fn is_placed(corner: DVec3) -> bool {
    corner.to_array().iter().all(|c| c.abs() <= FARTHEST)
}

fn is_finite(raw: &Raw) -> bool {
    raw.rgba
        .as_flattened()
        .iter()
        .chain(raw.uv.iter().flat_map(|uv| uv.as_flattened()))
        .all(|c| c.is_finite())
}

fn has_area([a, b, c]: &[DVec3; 3]) -> bool {
    let (u, v, w) = (b - a, c - a, c - b);
    let longest = u.length().max(v.length()).max(w.length());
    // Divided first, so that no square underflows or overflows.
    longest > 0.0 && (u / longest).cross(v / longest).length() > LEAST_SHAPE
}

/// Mean normals of the faces around each corner, weighted by their angles, for triangles without
/// normals. The weight of a face does not depend on its triangulation (Thürmer and Wüthrich 1998).
struct Smooth(HashMap<[u64; 3], DVec3>);

impl Smooth {
    fn of(triangles: &[Raw]) -> Smooth {
        let mut sums = HashMap::new();
        for raw in triangles
            .iter()
            .filter(|raw| raw.normals.is_none() && !raw.flat)
        {
            let [a, b, c] = raw.corners;
            let Some(normal) = unit((b - a).cross(c - a)) else {
                continue;
            };
            for (corner, one, other) in [(a, b, c), (b, c, a), (c, a, b)] {
                *sums.entry(place(corner)).or_insert(DVec3::ZERO) +=
                    normal * angle(one - corner, other - corner);
            }
        }
        Smooth(sums)
    }

    fn complete(&self, raw: &Raw) -> Triangle {
        let Raw {
            corners,
            uv,
            rgba,
            material,
            ..
        } = *raw;
        let mut triangle = Triangle {
            corners,
            normals: [[0.0; 3]; 3],
            uv,
            rgba,
            material,
        };
        let face = triangle.face();
        let around = |corner: DVec3| {
            self.0
                .get(&place(corner))
                .and_then(|&sum| unit(sum))
                .filter(|mean| mean.dot(face) >= SMOOTH_COSINE)
        };
        triangle.normals = std::array::from_fn(|i| {
            let own = raw.normals.and_then(|normals| unit(normals[i]));
            own.or_else(|| around(corners[i]))
                .unwrap_or(face)
                .as_vec3()
                .to_array()
        });
        triangle
    }
}

/// Angle between two vectors of any length, radians.
fn angle(a: DVec3, b: DVec3) -> f64 {
    unit(a)
        .zip(unit(b))
        .map_or(0.0, |(a, b)| libm::acos(a.dot(b).clamp(-1.0, 1.0)))
}

/// A position as a comparable key; 0 and −0 are equal.
fn place(corner: DVec3) -> [u64; 3] {
    corner.to_array().map(|c| (c + 0.0).to_bits())
}

/// Bytes of a file that another one names, in the same folder or below.
pub(super) fn read_inside(folder: &Path, name: &str) -> Parsed<Vec<u8>> {
    let path = inside(folder, name)?;
    input::read(&path).map_err(|e| format!("`{}` cannot be read: {e}", clipped(name)))
}

/// Path of a file that another one names; it must be in the same folder or below.
fn inside(folder: &Path, name: &str) -> Parsed<PathBuf> {
    let relative = PathBuf::from(name.replace('\\', "/"));
    if relative
        .components()
        .all(|part| matches!(part, Component::Normal(_) | Component::CurDir))
        && !name.is_empty()
    {
        return Ok(folder.join(relative));
    }
    Err(format!(
        "`{}` leads out of the mesh's folder; put the file into that folder and use its name without a path",
        clipped(name)
    ))
}

#[cfg(test)]
mod tests;

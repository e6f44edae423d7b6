//! OBJ: reads triangles from Wavefront's text, materials from MTL files, and their pictures.
//!
//! An own reader, because the crate `tobj` (4.0.5) panics at `Kd 0.5` and at relative indices
//! before the first vertex, and its errors have no line numbers. Tests compare this reader with it
//! on valid files.
//!
//! - Polygons become fans. Lines, points, curves, groups and smoothing groups are skipped.
//! - A face may refer to vertices further down; a relative index counts from the line of the face.
//! - `Kd` is linear light, as modellers export it; colours after a vertex's position are sRGB
//!   codes.
//! - Opacity is `d`, or 1 − `Tr`, times that of the picture of `map_Kd`. Options of `map_Kd` are
//!   skipped with a note.
//! - A material that no library defines is grey, with a note; a missing library is an error.

use super::{Alpha, Contents, GREY, Image, Material, Parsed, Raw, Texture, Wrap, read_inside};
use crate::output::colour::srgb_decode;
use crate::output::text::{clipped, listed};
use glam::DVec3;
use std::collections::HashMap;
use std::path::Path;
use std::str::SplitAsciiWhitespace;
use std::sync::Arc;

/// Indices of a face's corner: position, texture coordinate, normal.
type Corner = [Option<usize>; 3];

#[derive(Default)]
struct Obj {
    positions: Vec<DVec3>,
    colours: HashMap<usize, [f32; 3]>,
    coordinates: Vec<[f32; 2]>,
    normals: Vec<DVec3>,
    faces: Vec<Face>,
    /// Corners of all faces in sequence.
    corners: Vec<Corner>,
    libraries: Vec<String>,
    /// Names of materials in the order of their first use.
    used: Vec<String>,
    place_of_name: HashMap<String, usize>,
}

struct Face {
    line: usize,
    /// Index of its first corner, and their number.
    corners: (usize, usize),
    /// Index into [`Obj::used`].
    material: Option<usize>,
}

/// Reads the bytes of an OBJ file and the files that it names. The error is the second half of a
/// sentence that begins with the file's name.
pub(super) fn read(bytes: &[u8], folder: &Path) -> Parsed<Contents> {
    let obj = Obj::parse(bytes)?;
    let mut library = Library::default();
    obj.libraries
        .iter()
        .try_for_each(|name| library.add(folder, name))?;
    obj.contents(library)
}

/// Lines without comments; lines that end in `\` are joined with the next. Each has the number of
/// its first line.
fn lines(bytes: &[u8]) -> impl Iterator<Item = (usize, String)> {
    let mut numbered = bytes.split(|&byte| byte == b'\n').enumerate();
    std::iter::from_fn(move || {
        let (number, first) = numbered.next()?;
        let mut line = String::from_utf8_lossy(first).trim_end().to_owned();
        while line.ends_with('\\') {
            line.pop();
            let Some((_, next)) = numbered.next() else {
                break;
            };
            line.push(' ');
            line.push_str(String::from_utf8_lossy(next).trim_end());
        }
        line.truncate(line.find('#').unwrap_or(line.len()));
        Some((number + 1, line))
    })
}

/// A line's first word, and the rest.
fn keyword(line: &str) -> (&str, &str) {
    let line = line.trim();
    line.split_once(|c: char| c.is_ascii_whitespace())
        .map_or((line, ""), |(word, rest)| (word, rest.trim()))
}

/// The next number; NaN is accepted here and refused later.
fn number(words: &mut SplitAsciiWhitespace) -> Parsed<f64> {
    let word = words.next().ok_or("a number is missing at its end")?;
    word.parse()
        .map_err(|_| format!("`{}` is not a number", clipped(word)))
}

fn numbers<const N: usize>(words: &mut SplitAsciiWhitespace) -> Parsed<[f64; N]> {
    let mut all = [0.0; N];
    for value in &mut all {
        *value = number(words)?;
    }
    Ok(all)
}

impl Obj {
    fn parse(bytes: &[u8]) -> Parsed<Obj> {
        let mut obj = Obj::default();
        let mut material = None;
        for (number, line) in lines(bytes) {
            let (word, rest) = keyword(&line);
            let done = match word {
                "v" => obj.vertex(&mut rest.split_ascii_whitespace()),
                "vt" => obj.coordinate(&mut rest.split_ascii_whitespace()),
                "vn" => numbers(&mut rest.split_ascii_whitespace())
                    .map(|normal| obj.normals.push(DVec3::from_array(normal))),
                "f" | "fo" => obj.face(number, rest, material),
                "usemtl" => {
                    material = Some(obj.named(rest));
                    Ok(())
                }
                "mtllib" => {
                    obj.libraries.push(rest.to_owned());
                    Ok(())
                }
                _ => Ok(()),
            };
            done.map_err(|sentence| at(number, sentence))?;
        }
        Ok(obj)
    }

    fn vertex(&mut self, words: &mut SplitAsciiWhitespace) -> Parsed<()> {
        self.positions.push(DVec3::from_array(numbers(words)?));
        // A single additional number is a weight, which is only for curves.
        let rest: Vec<&str> = words.collect();
        if let [.., r, g, b] = rest.as_slice() {
            let code = |word: &str| {
                word.parse()
                    .map_err(|_| format!("`{}` is not a number", clipped(word)))
            };
            let rgb = [code(r)?, code(g)?, code(b)?];
            self.colours.insert(
                self.positions.len() - 1,
                rgb.map(|code: f64| srgb_decode(code) as f32),
            );
        }
        Ok(())
    }

    fn coordinate(&mut self, words: &mut SplitAsciiWhitespace) -> Parsed<()> {
        let u = number(words)?;
        // For a picture of one row only u is written.
        let v = words.next().map_or(Ok(0.0), |word| {
            word.parse::<f64>()
                .map_err(|_| format!("`{}` is not a number", clipped(word)))
        })?;
        // Rows of a picture point down, coordinates of an OBJ up.
        self.coordinates.push([u as f32, (1.0 - v) as f32]);
        Ok(())
    }

    fn face(&mut self, line: usize, rest: &str, material: Option<usize>) -> Parsed<()> {
        let first = self.corners.len();
        for word in rest.split_ascii_whitespace() {
            let counts = [
                self.positions.len(),
                self.coordinates.len(),
                self.normals.len(),
            ];
            self.corners.push(corner(word, counts)?);
        }
        self.faces.push(Face {
            line,
            corners: (first, self.corners.len() - first),
            material,
        });
        Ok(())
    }

    fn named(&mut self, name: &str) -> usize {
        if let Some(&place) = self.place_of_name.get(name) {
            return place;
        }
        self.used.push(name.to_owned());
        self.place_of_name
            .insert(name.to_owned(), self.used.len() - 1);
        self.used.len() - 1
    }

    fn contents(self, library: Library) -> Parsed<Contents> {
        let mut contents = library.contents;
        contents.reserve(self.corners.len())?;
        // The last material is for faces without one.
        let found = self
            .used
            .iter()
            .map(|name| library.materials.get(name).cloned());
        let missing: Vec<String> = self
            .used
            .iter()
            .filter(|name| !library.materials.contains_key(*name))
            .map(|name| clipped(name))
            .collect();
        contents.materials = found
            .map(|material| material.unwrap_or_else(Material::none))
            .chain([Material::none()])
            .collect();
        if !missing.is_empty() {
            contents.notes.push(format!(
                "materials without a description are grey: {}",
                listed(&missing)
            ));
        }
        for face in &self.faces {
            let corners = &self.corners[face.corners.0..][..face.corners.1];
            corners
                .iter()
                .try_for_each(|corner| self.check(corner))
                .map_err(|sentence| at(face.line, sentence))?;
            let material = face.material.unwrap_or(self.used.len());
            let is_known = self
                .used
                .get(material)
                .is_some_and(|name| library.materials.contains_key(name));
            for i in 2..corners.len() {
                contents.triangles.push(self.raw(
                    [corners[0], corners[i - 1], corners[i]],
                    material as u32,
                    is_known,
                ));
            }
        }
        Ok(contents)
    }

    fn check(&self, corner: &Corner) -> Parsed<()> {
        let counts = [
            self.positions.len(),
            self.coordinates.len(),
            self.normals.len(),
        ];
        for ((index, count), what) in
            corner
                .iter()
                .zip(counts)
                .zip(["vertices", "texture coordinates", "normals"])
        {
            if let Some(index) = index.filter(|&index| index >= count) {
                return Err(format!(
                    "a face names number {} of {count} {what}",
                    index.saturating_add(1)
                ));
            }
        }
        Ok(())
    }

    fn raw(&self, corners: [Corner; 3], material: u32, is_known: bool) -> Raw {
        let position = corners.map(|[position, ..]| position.expect("every corner has one"));
        let colour = |i: usize| {
            self.colours
                .get(&position[i])
                .map(|&[r, g, b]| [r, g, b, 1.0])
        };
        let all = |place: usize| corners.iter().all(|corner| corner[place].is_some());
        Raw {
            corners: position.map(|i| self.positions[i]),
            normals: all(2)
                .then(|| corners.map(|[.., normal]| self.normals[normal.expect("all have one")])),
            uv: all(1)
                .then(|| corners.map(|[_, uv, _]| self.coordinates[uv.expect("all have one")])),
            // Grey is for corners without material and colour.
            rgba: std::array::from_fn(|i| {
                colour(i).unwrap_or(if is_known { [1.0; 4] } else { GREY })
            }),
            material,
            flat: false,
        }
    }
}

fn at(line: usize, sentence: String) -> String {
    format!("line {line}: {sentence}")
}

/// A corner, `v`, `v/vt`, `v//vn` or `v/vt/vn`.
fn corner(word: &str, counts: [usize; 3]) -> Parsed<Corner> {
    let mut corner = [None; 3];
    for (place, part) in word.split('/').enumerate() {
        let slot = corner
            .get_mut(place)
            .ok_or_else(|| format!("`{}` is not a corner of a face", clipped(word)))?;
        if !part.is_empty() {
            *slot = Some(index(part, counts[place])?);
        }
    }
    if corner[0].is_none() {
        Err(format!("`{}` is not a corner of a face", clipped(word)))
    } else {
        Ok(corner)
    }
}

fn index(word: &str, count: usize) -> Parsed<usize> {
    let wrong = || {
        format!(
            "`{}` is not an index; they begin with 1, and −1 is the last one so far",
            clipped(word)
        )
    };
    match word.parse::<i64>() {
        Ok(index) if index > 0 => Ok(index as usize - 1),
        Ok(index) if index < 0 => count
            .checked_sub(index.unsigned_abs() as usize)
            .ok_or_else(wrong),
        _ => Err(wrong()),
    }
}

// ---- MTL ----

#[derive(Default)]
struct Library {
    materials: HashMap<String, Material>,
    texture_of_file: HashMap<String, usize>,
    /// Textures and notes.
    contents: Contents,
}

impl Library {
    /// Reads the libraries of a `mtllib` line: one, whose name may have spaces, or several.
    fn add(&mut self, folder: &Path, names: &str) -> Parsed<()> {
        let whole = read_inside(folder, names);
        let parts: Vec<&str> = names.split_ascii_whitespace().collect();
        if parts.len() < 2 || whole.is_ok() {
            return self.read(folder, names, &whole?);
        }
        parts
            .iter()
            .try_for_each(|name| self.read(folder, name, &read_inside(folder, name)?))
    }

    fn read(&mut self, folder: &Path, name: &str, bytes: &[u8]) -> Parsed<()> {
        let mut current: Option<(String, Material)> = None;
        for (number, line) in lines(bytes) {
            let (word, rest) = keyword(&line);
            let within = |sentence: String| format!("{}, line {number}: {sentence}", clipped(name));
            if word == "newmtl" {
                self.materials.extend(current.replace((
                    rest.to_owned(),
                    Material {
                        rgba: [1.0; 4],
                        texture: None,
                        alpha: Alpha::Blend,
                    },
                )));
            } else if let Some((_, material)) = &mut current {
                self.field(material, folder, word, rest).map_err(within)?;
            }
        }
        self.materials.extend(current);
        Ok(())
    }

    fn field(
        &mut self,
        material: &mut Material,
        folder: &Path,
        word: &str,
        rest: &str,
    ) -> Parsed<()> {
        let mut words = rest.split_ascii_whitespace();
        match word {
            "Kd" => {
                let red = share(&mut words)?;
                // One number stands for all three.
                let rest = if words.clone().next().is_none() {
                    [red; 2]
                } else {
                    [share(&mut words)?, share(&mut words)?]
                };
                material.rgba[..3].copy_from_slice(&[red, rest[0], rest[1]]);
            }
            "d" => {
                if words.clone().next() == Some("-halo") {
                    words.next();
                }
                material.rgba[3] = share(&mut words)?;
            }
            "Tr" => material.rgba[3] = 1.0 - share(&mut words)?,
            "map_Kd" => material.texture = Some(self.texture(folder, rest)?),
            _ => {}
        }
        Ok(())
    }

    fn texture(&mut self, folder: &Path, rest: &str) -> Parsed<usize> {
        let file = after_options(rest);
        if file.len() < rest.len() {
            self.contents.notes.push(format!(
                "options of a texture are not read: `{}`",
                clipped(rest)
            ));
        }
        if let Some(&texture) = self.texture_of_file.get(file) {
            return Ok(texture);
        }
        let of_file = |e: String| format!("`{}` {e}", clipped(file));
        let bytes = read_inside(folder, file)?;
        self.contents.reserve_picture(&bytes).map_err(of_file)?;
        let image = Image::decode(&bytes).map_err(of_file)?;
        self.contents.textures.push(Texture {
            image: Arc::new(image),
            wrap: [Wrap::Repeat; 2],
        });
        self.texture_of_file
            .insert(file.to_owned(), self.contents.textures.len() - 1);
        Ok(self.contents.textures.len() - 1)
    }
}

/// A number in [0, 1].
fn share(words: &mut SplitAsciiWhitespace) -> Parsed<f32> {
    let value = number(words)?;
    if (0.0..=1.0).contains(&value) {
        Ok(value as f32)
    } else {
        Err(format!("{value} is not within 0 and 1"))
    }
}

/// The file's name after options and their values; it may have spaces.
fn after_options(text: &str) -> &str {
    let mut rest = text;
    while rest.starts_with('-') {
        let (option, mut after) = keyword(rest);
        let most = match option {
            "-o" | "-s" | "-t" => 3,
            "-mm" => 2,
            _ => 1,
        };
        for i in 0..most {
            let (word, next) = keyword(after);
            // The second and third number are optional.
            if i > 0 && word.parse::<f64>().is_err() {
                break;
            }
            after = next;
        }
        rest = after;
    }
    rest
}

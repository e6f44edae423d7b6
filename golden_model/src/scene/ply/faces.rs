//! Faces: converts a PLY file's polygons and strips to triangles, with the attributes of their
//! faces as written by MeshLab: texture coordinates, the index of a picture, colours.
//! ```text
//! vertex_indices      list of n vertices                    ─► a fan of n − 2 triangles
//! texcoord            list of 2 n numbers, u v per corner, v counts up
//! texnumber           index of the `comment TextureFile` line, from 0; −1 none; default: the first
//! red green blue      of the whole face                     color    list of 3 n or 4 n numbers, of its corners
//! ```

use super::colours::{Columns, Extent, Meaning};
use super::{Body, Element, Parsed, Property, PropertyKind, Scalar, Triangle, from_upper_left};
use crate::scene::{Splat, unit};

/// Triangles of the file.
pub(super) struct Faces {
    vertices: usize,
    /// Indices of vertices.
    triangles: Vec<[u32; 3]>,
    /// Attributes of the faces of these triangles, if any face has some: for a scan nothing is
    /// stored.
    attributes: Option<Vec<Triangle>>,
    total: usize,
    refused: usize,
    /// Type and extent of the colours of triangles.
    colours: Option<(Scalar, Extent)>,
    opacities: Option<(Scalar, Extent)>,
    notes: Vec<String>,
    /// Number of faces whose lists do not match their corners.
    odd: usize,
}

/// Indices of the properties of a face.
struct FaceLayout {
    corners: Option<usize>,
    texture: Option<usize>,
    picture: Option<usize>,
    wedges: Option<(usize, Scalar)>,
    rgb: Option<([usize; 3], Scalar)>,
    alpha: Option<(usize, Scalar)>,
}

impl FaceLayout {
    fn has_attributes(&self) -> bool {
        self.texture.is_some()
            || self.picture.is_some()
            || self.wedges.is_some()
            || self.rgb.is_some()
    }
}

/// Values of one face.
#[derive(Default)]
struct Face {
    corners: Vec<f64>,
    texture: Vec<f64>,
    picture: Option<f64>,
    wedges: Vec<f64>,
    rgba: Option<[f64; 4]>,
}

/// Attributes of a triangle's face, by the index of the corner in it.
#[derive(Default)]
struct FaceAttributes<'a> {
    texture: Option<&'a [[f64; 2]]>,
    picture: Option<u32>,
    wedges: Option<Vec<[f64; 4]>>,
    rgba: Option<[f64; 4]>,
}

fn list<'e>(element: &'e Element, names: &[&str]) -> Option<(usize, Scalar)> {
    let item = |p: &'e Property| {
        if let PropertyKind::List { item, .. } = p.kind {
            Some(item)
        } else {
            None
        }
    };
    element
        .properties
        .iter()
        .enumerate()
        .find_map(|(place, p)| {
            names
                .contains(&p.name.as_str())
                .then(|| item(p).map(|item| (place, item)))?
        })
}

impl Faces {
    pub fn new(vertices: usize) -> Self {
        Faces {
            vertices,
            triangles: Vec::new(),
            attributes: None,
            total: 0,
            refused: 0,
            colours: None,
            opacities: None,
            notes: Vec::new(),
            odd: 0,
        }
    }

    /// Reads polygons and triangle strips only; the rows of other elements are skipped.
    pub fn read(&mut self, body: &mut Body, element: &Element) -> Parsed<()> {
        let corners = list(element, &["vertex_indices", "vertex_index"]).map(|(place, _)| place);
        self.rows(
            body,
            element,
            &FaceLayout {
                corners,
                texture: None,
                picture: None,
                wedges: None,
                rgb: None,
                alpha: None,
            },
        )
    }

    /// Reads faces with all of their attributes.
    pub fn read_all(&mut self, body: &mut Body, element: &Element) -> Parsed<()> {
        if element.name != "face" {
            return self.read(body, element);
        }
        let Columns { rgb, alpha, notes } = Columns::of(element);
        let wedges = list(element, &["color", "colour", "wedge_color"]);
        // Drops notes about lists that are read after all.
        self.notes
            .extend(notes.into_iter().filter(|_| wedges.is_none()));
        let layout = FaceLayout {
            corners: list(element, &["vertex_indices", "vertex_index"]).map(|(place, _)| place),
            texture: list(element, &["texcoord", "texcoords", "texture_coordinates"])
                .map(|(place, _)| place),
            picture: element
                .properties
                .iter()
                .position(|p| p.name == "texnumber" && matches!(p.kind, PropertyKind::Scalar(_))),
            wedges,
            // Colours of corners override those of their face.
            rgb: rgb.filter(|_| wedges.is_none()),
            alpha: alpha.filter(|_| rgb.is_some() && wedges.is_none()),
        };
        if layout.has_attributes() {
            let bare = |&corners: &[u32; 3]| Triangle {
                corners,
                uv: None,
                rgba: None,
                picture: Some(0),
            };
            self.attributes = Some(self.triangles.iter().map(bare).collect());
        }
        let of_kind = |kind: Scalar| (kind, Extent::of(kind));
        let of_corners = wedges.map(|(_, kind)| of_kind(kind));
        self.colours = of_corners.or(layout.rgb.map(|(_, kind)| of_kind(kind)));
        self.opacities = of_corners.or(layout.alpha.map(|(_, kind)| of_kind(kind)));
        self.rows(body, element, &layout)
    }

    fn rows(&mut self, body: &mut Body, element: &Element, layout: &FaceLayout) -> Parsed<()> {
        let mut face = Face::default();
        for number in 0..element.rows() {
            face.clear();
            body.row(element, number, |property, value| {
                face.take(layout, property, value)
            })?;
            match element.name.as_str() {
                "face" => self.add_polygon(&face),
                "tristrips" => face
                    .corners
                    .split(|&corner| corner < 0.0)
                    .for_each(|strip| self.add_strip(strip)),
                _ => {}
            }
        }
        Ok(())
    }

    fn add_polygon(&mut self, face: &Face) {
        let count = face.corners.len();
        let attributes = face.attributes();
        let is_odd = attributes.texture.is_none() && !face.texture.is_empty()
            || attributes.wedges.is_none() && !face.wedges.is_empty();
        self.odd += usize::from(is_odd);
        for i in 2..count {
            self.add(
                [face.corners[0], face.corners[i - 1], face.corners[i]],
                [0, i - 1, i],
                &attributes,
            );
        }
    }

    fn add_strip(&mut self, corners: &[f64]) {
        for (i, corner) in corners.windows(3).enumerate() {
            let turn = i % 2;
            self.add(
                [corner[turn], corner[1 - turn], corner[2]],
                [0; 3],
                &FaceAttributes {
                    picture: Some(0),
                    ..FaceAttributes::default()
                },
            );
        }
    }

    fn add(&mut self, corners: [f64; 3], places: [usize; 3], attributes: &FaceAttributes) {
        self.total += 1;
        if !corners
            .iter()
            .all(|&c| c >= 0.0 && c < self.vertices as f64)
        {
            self.refused += 1;
            return;
        }
        let rgba = attributes
            .wedges
            .as_ref()
            .map(|all| places.map(|place| all[place]))
            .or(attributes.rgba.map(|rgba| [rgba; 3]));
        for rgba in rgba.iter().flatten() {
            self.colours = self.colours.map(|(kind, extent)| {
                (
                    kind,
                    rgba[..3]
                        .iter()
                        .fold(extent, |extent, &value| extent.with(value)),
                )
            });
            self.opacities = self
                .opacities
                .map(|(kind, extent)| (kind, extent.with(rgba[3])));
        }
        let corners = corners.map(|c| c as u32);
        self.triangles.push(corners);
        if let Some(all) = &mut self.attributes {
            all.push(Triangle {
                corners,
                uv: attributes
                    .texture
                    .map(|all| places.map(|place| from_upper_left(all[place]))),
                rgba: rgba.map(|rgba| rgba.map(|corner| corner.map(|value| value as f32))),
                picture: attributes.picture,
            });
        }
    }

    pub fn note(&self) -> Option<String> {
        let Faces { refused, total, .. } = self;
        (*refused > 0).then(|| {
            format!(
                "{refused} of {total} triangles name vertices that do not exist and were left out"
            )
        })
    }

    /// All triangles with their colours in linear light, the number of triangles with invalid
    /// vertices, and notes.
    pub fn finish(mut self, linear: bool) -> (Vec<Triangle>, usize, Vec<String>) {
        // If faces have no attributes, all have the first picture.
        let bare = |&corners: &[u32; 3]| Triangle {
            corners,
            uv: None,
            rgba: None,
            picture: Some(0),
        };
        let mut triangles = self
            .attributes
            .take()
            .unwrap_or_else(|| self.triangles.iter().map(bare).collect());
        if let Some((kind, extent)) = self.colours {
            let colours = Meaning::of_colours(kind, extent, linear);
            let opacities = self
                .opacities
                .map(|(own, extent)| Meaning::of_opacities(own, extent, Some((kind, &colours))));
            for corner in triangles
                .iter_mut()
                .filter_map(|triangle| triangle.rgba.as_mut())
                .flatten()
            {
                let light = |value: f32| colours.light(value.into()).unwrap_or(super::GREY) as f32;
                let [red, green, blue, alpha] = *corner;
                let alpha = opacities
                    .as_ref()
                    .and_then(|meaning| meaning.light(alpha.into()))
                    .unwrap_or(1.0) as f32;
                *corner = [light(red), light(green), light(blue), alpha];
            }
            self.notes.extend(colours.note("face", kind, extent));
        }
        if self.odd > 0 {
            self.notes.push(format!(
                "{} faces have texture coordinates or colours of another number than their corners; they were left out",
                self.odd
            ));
        }
        (triangles, self.refused, self.notes)
    }

    /// Normal of each vertex: the mean of its triangles' normals, weighted by area; None if that is
    /// 0.
    pub fn give_normals(&self, splats: &mut [Splat]) {
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|i| splats[i as usize].position);
            let twice_area = (b - a).cross(c - a);
            if twice_area.is_finite() {
                triangle
                    .iter()
                    .for_each(|&i| splats[i as usize].normal += twice_area);
            }
        }
        splats
            .iter_mut()
            .for_each(|s| s.normal = unit(s.normal).unwrap_or(glam::DVec3::ZERO));
    }
}

impl Face {
    fn clear(&mut self) {
        self.corners.clear();
        self.texture.clear();
        self.wedges.clear();
        (self.picture, self.rgba) = (None, None);
    }

    fn take(&mut self, layout: &FaceLayout, property: usize, value: f64) {
        let FaceLayout {
            corners,
            texture,
            picture,
            wedges,
            rgb,
            alpha,
        } = layout;
        let channel =
            rgb.and_then(|(places, _)| places.iter().position(|&place| place == property));
        let channel = channel.or(alpha.filter(|&(place, _)| place == property).map(|_| 3));
        if *corners == Some(property) {
            self.corners.push(value);
        } else if *texture == Some(property) {
            self.texture.push(value);
        } else if *picture == Some(property) {
            self.picture = Some(value);
        } else if wedges.is_some_and(|(place, _)| place == property) {
            self.wedges.push(value);
        } else if let Some(channel) = channel {
            self.rgba.get_or_insert([0.0, 0.0, 0.0, f64::NAN])[channel] = value;
        }
    }

    /// The values that match the corners.
    fn attributes(&self) -> FaceAttributes<'_> {
        let count = self.corners.len();
        let wedges = match self.wedges.len() {
            length if count > 0 && length == 3 * count => Some(
                self.wedges
                    .as_chunks()
                    .0
                    .iter()
                    .map(|&[red, green, blue]| [red, green, blue, f64::NAN])
                    .collect(),
            ),
            length if count > 0 && length == 4 * count => Some(self.wedges.as_chunks().0.to_vec()),
            _ => None,
        };
        // An index below 0 stands for no picture.
        let picture = self
            .picture
            .map_or(Some(0), |number| (number >= 0.0).then_some(number as u32));
        FaceAttributes {
            texture: (self.texture.len() == 2 * count).then(|| self.texture.as_chunks().0),
            picture,
            wedges,
            rgba: self.rgba,
        }
    }
}

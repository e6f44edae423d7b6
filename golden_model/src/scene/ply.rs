//! PLY: reads a cloud of points from a file in any of the format's variants. Its header and rows
//! are also used by the readers of trained Gaussians.
//!
//! An own reader, because `serde-ply` fails on existing files: headers with the line ends of old
//! Macs (Rhino still writes them), text without a final newline. Its errors have neither row nor
//! line. Values are stored directly in splats. Memory is reserved only up to what the file's length
//! supports, so a header cannot demand memory.
//!
//! - Text is read by lines, one row per line. Blank lines and unknown header lines are skipped; too
//!   few or too many values are refused.
//! - Colours of any type are sRGB codes and are decoded, unless a comment declares linear light
//!   ([`colours`]).
//! - Vertices without a finite position (or beyond ±1e30, which some scanners use for holes) are
//!   left out and counted in a note.
//! - Faces are only used for normals if the file has none; a face with a vertex index out of range
//!   is left out and counted.

mod colours;
mod faces;

use super::{LEAST_RADIUS, Splat, unit};
pub(super) use crate::output::text::clipped as clip;
use colours::{Columns, Extent, Meaning};
use faces::Faces;
use glam::DVec3;
use rayon::prelude::*;
use rayon::slice::ChunksExact;
use std::ops::Range;

/// Points of a file. A normal or a radius of zero means that the file has none.
#[derive(Debug)]
pub(super) struct Cloud {
    pub splats: Vec<Splat>,
    /// Notes on omissions and oddities, one sentence each.
    pub notes: Vec<String>,
}

/// Coordinates beyond this count as missing; squares and products of smaller ones are finite in
/// f64.
pub(super) const FARTHEST: f64 = 1e30;

/// Most lines of a header; real ones have a hundred. Each name is compared with all names before
/// it, which must be quick.
const LONGEST_HEADER: usize = 10_000;

pub(super) type Parsed<T> = Result<T, String>;

/// Reads the bytes of a PLY file. The error is the second half of a sentence that begins with the
/// file's name.
pub(super) fn parse(bytes: &[u8]) -> Parsed<Cloud> {
    let (header, mut body) = read_header(bytes)?;
    let vertices = header
        .elements
        .iter()
        .find(|e| e.name == "vertex")
        .ok_or("has no element `vertex`, so there are no points in it")?;
    let layout = VertexLayout::of(vertices)?;
    let mut notes = header.notes.clone();
    if vertices.properties.iter().any(|p| p.name == "f_dc_0") {
        notes.push("looks like trained 3D Gaussians, but has no scales and rotations: shown as plain points".into());
    }
    let (mut splats, mut faces) = (Vec::new(), Faces::new(vertices.count));
    let mut rest = header.elements.iter();
    for element in rest.by_ref() {
        match element.name.as_str() {
            "vertex" => splats = read_vertices(&mut body, element, &layout)?,
            _ => faces.read(&mut body, element)?,
        }
        if layout.has_normals() && !splats.is_empty() {
            break;
        }
    }
    body.finish(rest)?;
    notes.extend(layout.decode(&mut splats, &header));
    if !layout.has_normals() {
        faces.give_normals(&mut splats);
        notes.extend(faces.note());
    }
    layout.check_radii(&splats)?;
    notes.extend(drop_unplaced(&mut splats));
    Ok(Cloud { splats, notes })
}

/// Vertices and triangles of a file, for [`super::mesh`].
#[derive(Debug)]
pub(super) struct Faced {
    /// As those of a [`Cloud`], with any positions.
    pub vertices: Vec<Splat>,
    /// Texture coordinates of vertices, from the picture's upper left corner.
    pub uv: Option<Vec<[f32; 2]>>,
    pub has_normals: bool,
    /// Whether vertices have colours.
    pub has_colours: bool,
    /// All vertex indices are in range.
    pub triangles: Vec<Triangle>,
    /// Number of triangles with vertex indices out of range.
    pub refused: usize,
    /// Names of pictures by index.
    pub pictures: Vec<String>,
    pub notes: Vec<String>,
}

/// A triangle of a face, with the attributes of the face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Triangle {
    /// Indices of vertices.
    pub corners: [u32; 3],
    /// The corners' own texture coordinates, from the picture's upper left corner.
    pub uv: Option<[[f32; 2]; 3]>,
    /// Linear light and opacity of the corners.
    pub rgba: Option<[[f32; 4]; 3]>,
    /// Index into [`Faced::pictures`]; None if the face has no picture.
    pub picture: Option<u32>,
}

/// Reads the bytes of a PLY file as a mesh. The error is the second half of a sentence that begins
/// with the file's name.
pub(super) fn parse_faced(bytes: &[u8]) -> Parsed<Faced> {
    let (header, mut body) = read_header(bytes)?;
    let vertices = header
        .elements
        .iter()
        .find(|e| e.name == "vertex")
        .ok_or("has no element `vertex`, so there are no corners in it")?;
    let layout = VertexLayout::of(vertices)?;
    let has_uv = layout.is_filled[TEXTURE..].iter().all(|&filled| filled);
    let (mut splats, mut uv, mut faces) = (Vec::new(), Vec::new(), Faces::new(vertices.count));
    for element in &header.elements {
        if element.name != "vertex" {
            faces.read_all(&mut body, element)?;
            continue;
        }
        splats.reserve(body.room(element));
        body.rows(
            element,
            &layout.slot_of_property,
            &mut [0.0; SLOTS.len()],
            |values| {
                splats.push(layout.splat(values));
                if has_uv {
                    uv.push(from_upper_left([values[TEXTURE], values[TEXTURE + 1]]));
                }
            },
        )?;
    }
    body.finish(std::iter::empty())?;
    let mut notes = header.notes.clone();
    notes.extend(layout.decode(&mut splats, &header));
    let (triangles, refused, of_faces) = faces.finish(header.has_linear_colours());
    notes.extend(of_faces);
    Ok(Faced {
        vertices: splats,
        uv: has_uv.then_some(uv),
        has_normals: layout.has_normals(),
        has_colours: layout.colours.rgb.is_some(),
        triangles,
        refused,
        pictures: header.pictures(),
        notes,
    })
}

/// Rows of a picture point down, coordinates of a PLY up.
fn from_upper_left([u, v]: [f64; 2]) -> [f32; 2] {
    [u as f32, (1.0 - v) as f32]
}

// ---- header ----

#[derive(Clone, Copy, PartialEq, Debug)]
enum PlyEncoding {
    Text,
    LittleEndian,
    BigEndian,
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

enum PropertyKind {
    Scalar(Scalar),
    List { count: Scalar, item: Scalar },
}

struct Property {
    name: String,
    kind: PropertyKind,
}

/// One table of the file, as in the header.
pub(super) struct Element {
    pub name: String,
    pub count: usize,
    properties: Vec<Property>,
}

/// The tables of a file in order, and notes on the header.
pub(super) struct Header {
    pub elements: Vec<Element>,
    /// Text after `comment`, line by line.
    pub comments: Vec<String>,
    pub notes: Vec<String>,
}

/// Each type with both of its names.
const TYPES: [(Scalar, &str, &str); 8] = [
    (Scalar::I8, "char", "int8"),
    (Scalar::U8, "uchar", "uint8"),
    (Scalar::I16, "short", "int16"),
    (Scalar::U16, "ushort", "uint16"),
    (Scalar::I32, "int", "int32"),
    (Scalar::U32, "uint", "uint32"),
    (Scalar::F32, "float", "float32"),
    (Scalar::F64, "double", "float64"),
];

impl Scalar {
    fn named(name: &str) -> Parsed<Scalar> {
        let found = TYPES
            .iter()
            .find(|(_, old, new)| [*old, *new].contains(&name));
        let names = || TYPES.map(|(_, old, _)| old).join(", ");
        found
            .map(|(kind, ..)| *kind)
            .ok_or_else(|| format!("`{}` is not a PLY type; types are {}", clip(name), names()))
    }

    fn name(self) -> &'static str {
        TYPES[self as usize].1
    }

    fn bytes(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::F64 => 8,
        }
    }

    fn is_float(self) -> bool {
        matches!(self, Scalar::F32 | Scalar::F64)
    }

    fn holds(self, value: f64) -> bool {
        let (low, high) = match self {
            Scalar::I8 => (i8::MIN as f64, i8::MAX as f64),
            Scalar::U8 => (0.0, u8::MAX as f64),
            Scalar::I16 => (i16::MIN as f64, i16::MAX as f64),
            Scalar::U16 => (0.0, u16::MAX as f64),
            Scalar::I32 => (i32::MIN as f64, i32::MAX as f64),
            Scalar::U32 => (0.0, u32::MAX as f64),
            Scalar::F32 | Scalar::F64 => return true,
        };
        value.fract() == 0.0 && (low..=high).contains(&value)
    }

    fn read(self, bytes: &[u8], encoding: PlyEncoding) -> f64 {
        let mut low_first = [0; 8];
        let raw = &mut low_first[..bytes.len()];
        raw.copy_from_slice(bytes);
        if encoding == PlyEncoding::BigEndian {
            raw.reverse();
        }
        let word = u64::from_le_bytes(low_first);
        match self {
            Scalar::I8 => word as i8 as f64,
            Scalar::I16 => word as i16 as f64,
            Scalar::I32 => word as i32 as f64,
            Scalar::U8 | Scalar::U16 | Scalar::U32 => word as f64,
            Scalar::F32 => f32::from_bits(word as u32) as f64,
            Scalar::F64 => f64::from_bits(word),
        }
    }
}

impl Element {
    /// The names of all properties, lists included.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.properties.iter().map(|p| p.name.as_str())
    }

    /// For each property its index in `names`; all names must exist as single numbers.
    pub(super) fn slots(&self, names: &[String]) -> Parsed<Vec<Option<usize>>> {
        let is_number = |name: &&String| {
            self.properties
                .iter()
                .any(|p| p.name == **name && matches!(p.kind, PropertyKind::Scalar(_)))
        };
        match names.iter().find(|name| !is_number(name)) {
            Some(missing) => Err(format!(
                "element `{}` has no number `{missing}`",
                clip(&self.name)
            )),
            None => Ok(self
                .names()
                .map(|own| names.iter().position(|name| name == own))
                .collect()),
        }
    }

    /// Number of rows to read: rows without properties take no memory, for any number in the
    /// header.
    fn rows(&self) -> usize {
        if self.properties.is_empty() {
            0
        } else {
            self.count
        }
    }

    /// The shortest possible row in bytes: it limits the number of rows in a file of a given
    /// length.
    fn shortest_row(&self, encoding: PlyEncoding) -> usize {
        let shortest = |p: &Property| match (&p.kind, encoding) {
            (_, PlyEncoding::Text) => 2,
            (PropertyKind::Scalar(t), _) | (PropertyKind::List { count: t, .. }, _) => t.bytes(),
        };
        self.properties.iter().map(shortest).sum::<usize>().max(1)
    }
}

/// Header and text rows, split at the line end of the first line.
struct PlyLines<'a> {
    rest: &'a [u8],
    end: u8,
    number: usize,
}

impl<'a> PlyLines<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        let end_of_first = bytes.iter().position(|&b| b == b'\r' || b == b'\n');
        let mac =
            end_of_first.is_some_and(|i| bytes[i] == b'\r' && bytes.get(i + 1) != Some(&b'\n'));
        PlyLines {
            rest: bytes,
            end: if mac { b'\r' } else { b'\n' },
            number: 0,
        }
    }
}

impl<'a> Iterator for PlyLines<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        let length = self
            .rest
            .iter()
            .position(|&b| b == self.end)
            .unwrap_or(self.rest.len());
        let line = &self.rest[..length];
        self.rest = self.rest.get(length + 1..).unwrap_or_default();
        self.number += 1;
        Some(line.trim_ascii())
    }
}

/// Reads the header. The error is the second half of a sentence that begins with the file's name.
pub(super) fn read_header(bytes: &[u8]) -> Parsed<(Header, Body<'_>)> {
    let mut lines = PlyLines::new(bytes);
    if lines.next() != Some(b"ply") {
        return Err("is not a PLY file: its first line is not `ply`".into());
    }
    let mut header = Header {
        elements: Vec::new(),
        comments: Vec::new(),
        notes: Vec::new(),
    };
    let mut encoding = None;
    loop {
        let line = lines
            .next()
            .ok_or("ends inside its header: there is no line `end_header`")?;
        if lines.number > LONGEST_HEADER {
            return Err(format!("has a header of more than {LONGEST_HEADER} lines"));
        }
        let line = String::from_utf8_lossy(line);
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words.as_slice() {
            ["end_header"] => break,
            ["comment", ..] => header.comments.push(
                line.trim_start()
                    .trim_start_matches("comment")
                    .trim()
                    .to_owned(),
            ),
            [] | ["obj_info", ..] => {}
            ["format", rest @ ..] => {
                encoding = Some(format(rest).map_err(|e| at_line(lines.number, e))?)
            }
            ["element", rest @ ..] => header.element(rest).map_err(|e| at_line(lines.number, e))?,
            ["property", rest @ ..] => header
                .property(rest)
                .map_err(|e| at_line(lines.number, e))?,
            [word, ..] => header.notes.push(format!(
                "line {}: `{}` is not a PLY keyword; the line was skipped",
                lines.number,
                clip(word)
            )),
        }
    }
    let encoding = encoding.ok_or("has no `format` line in its header")?;
    Ok((header, Body { lines, encoding }))
}

fn at_line(number: usize, sentence: String) -> String {
    format!("line {number}: {sentence}")
}

fn format(words: &[&str]) -> Parsed<PlyEncoding> {
    match words {
        ["ascii", "1.0"] => Ok(PlyEncoding::Text),
        ["binary_little_endian", "1.0"] => Ok(PlyEncoding::LittleEndian),
        ["binary_big_endian", "1.0"] => Ok(PlyEncoding::BigEndian),
        _ => Err(format!(
            "format `{}` is unknown; it must be ascii, binary_little_endian or binary_big_endian, followed by 1.0",
            clip(&words.join(" "))
        )),
    }
}

impl Header {
    fn has_linear_colours(&self) -> bool {
        self.comments
            .iter()
            .any(|comment| colours::is_linear(comment))
    }

    /// Names after `TextureFile` in comments, as written by MeshLab; they may have blanks.
    fn pictures(&self) -> Vec<String> {
        let name = |comment: &String| {
            let (word, name) = comment.split_once(|c: char| c.is_ascii_whitespace())?;
            word.eq_ignore_ascii_case("texturefile")
                .then(|| name.trim().to_owned())
        };
        self.comments.iter().filter_map(name).collect()
    }

    fn element(&mut self, words: &[&str]) -> Parsed<()> {
        let [name, count] = words else {
            return Err("an element line must read `element NAME COUNT`".into());
        };
        let count = count
            .parse()
            .map_err(|_| format!("`{}` is not a count of elements", clip(count)))?;
        if self.elements.iter().any(|e| e.name == *name) {
            return Err(format!("element `{}` is there twice", clip(name)));
        }
        self.elements.push(Element {
            name: name.to_string(),
            count,
            properties: Vec::new(),
        });
        Ok(())
    }

    fn property(&mut self, words: &[&str]) -> Parsed<()> {
        let (name, kind) = match words {
            ["list", count, item, name] => (
                name,
                PropertyKind::List {
                    count: Scalar::named(count)?,
                    item: Scalar::named(item)?,
                },
            ),
            [kind, name] => (name, PropertyKind::Scalar(Scalar::named(kind)?)),
            _ => return Err(
                "a property line must read `property TYPE NAME` or `property list TYPE TYPE NAME`"
                    .into(),
            ),
        };
        if matches!(kind, PropertyKind::List { count, .. } if count.is_float()) {
            return Err("the length of a list must be of an integer type".into());
        }
        let element = self
            .elements
            .last_mut()
            .ok_or("a property is before the first element")?;
        if element.properties.iter().any(|p| p.name == *name) {
            return Err(format!("property `{}` is there twice", clip(name)));
        }
        element.properties.push(Property {
            name: name.to_string(),
            kind,
        });
        Ok(())
    }
}

// ---- rows ----

/// A number's type, and its bytes in a row.
type RowField = (Scalar, Range<usize>);

/// Rows after the header: those of each element, in the header's order.
pub(super) struct Body<'a> {
    lines: PlyLines<'a>,
    encoding: PlyEncoding,
}

impl<'a> Body<'a> {
    /// Most rows of the element that the file can have: a limit for reserved memory.
    pub(super) fn room(&self, element: &Element) -> usize {
        element
            .count
            .min(self.lines.rest.len() / element.shortest_row(self.encoding))
    }

    /// Reads all rows of the next element, and passes each row's numbers to `each`, every property
    /// in its slot of `values`.
    pub(super) fn rows(
        &mut self,
        element: &Element,
        slots: &[Option<usize>],
        values: &mut [f64],
        mut each: impl FnMut(&[f64]),
    ) -> Parsed<()> {
        for number in 0..element.rows() {
            self.row(element, number, |property, value| {
                if let Some(slot) = slots[property] {
                    values[slot] = value;
                }
            })?;
            each(values);
        }
        Ok(())
    }

    /// All rows of the next element, and the position of each property in a row, if all rows have
    /// the same length, so that threads can share them. None for text, for lists, and if the file
    /// ends too early.
    fn equal_rows(&mut self, element: &Element) -> Option<(ChunksExact<'a, u8>, Vec<RowField>)> {
        if self.encoding == PlyEncoding::Text {
            return None;
        }
        let mut row = 0;
        let field = |property: &Property| match property.kind {
            PropertyKind::Scalar(kind) => {
                let first = row;
                row += kind.bytes();
                Some((kind, first..row))
            }
            PropertyKind::List { .. } => None,
        };
        let fields: Vec<RowField> = element
            .properties
            .iter()
            .map(field)
            .collect::<Option<_>>()?;
        let (rows, rest) = self
            .lines
            .rest
            .split_at_checked(element.rows().checked_mul(row)?)?;
        self.lines.rest = rest;
        Some((rows.par_chunks_exact(row.max(1)), fields))
    }

    /// Passes each value of the next row to `value`, with the index of its property; a list's
    /// values one by one.
    fn row(
        &mut self,
        element: &Element,
        number: usize,
        value: impl FnMut(usize, f64),
    ) -> Parsed<()> {
        let read = match self.encoding {
            PlyEncoding::Text => self.text_row(element, value),
            encoding => read_values(
                element,
                |kind| take(&mut self.lines.rest, kind, encoding),
                value,
            ),
        };
        read.map_err(|e| {
            let line = if self.encoding == PlyEncoding::Text {
                format!(" (line {})", self.lines.number)
            } else {
                String::new()
            };
            format!(
                "{} {number} of {}{line}: {e}",
                clip(&element.name),
                element.count
            )
        })
    }

    /// Refuses surplus lines of text after the last element; other encodings may have trailing
    /// data.
    pub(super) fn finish<'e>(&mut self, left: impl Iterator<Item = &'e Element>) -> Parsed<()> {
        if self.encoding != PlyEncoding::Text {
            return Ok(());
        }
        let promised = left.map(Element::rows).fold(0, usize::saturating_add);
        match self
            .lines
            .by_ref()
            .filter(|line| !line.is_empty())
            .nth(promised)
        {
            None => Ok(()),
            Some(line) => {
                let number = self.lines.number;
                Err(at_line(
                    number,
                    format!(
                        "`{}` is one row more than the header promises",
                        clip(&String::from_utf8_lossy(line))
                    ),
                ))
            }
        }
    }

    fn text_row(&mut self, element: &Element, value: impl FnMut(usize, f64)) -> Parsed<()> {
        let line = self.lines.find(|line| !line.is_empty()).ok_or(ENDS_EARLY)?;
        let mut words = line
            .split(u8::is_ascii_whitespace)
            .filter(|word| !word.is_empty());
        read_values(
            element,
            |kind| {
                number(
                    words.next().ok_or("the row ends before its last value")?,
                    kind,
                )
            },
            value,
        )?;
        match words.next() {
            None => Ok(()),
            Some(word) => Err(format!(
                "`{}` is one value more than the header promises",
                clip(&String::from_utf8_lossy(word))
            )),
        }
    }
}

const ENDS_EARLY: &str = "the file ends here; the header promises more";

fn read_values(
    element: &Element,
    mut next: impl FnMut(Scalar) -> Parsed<f64>,
    mut value: impl FnMut(usize, f64),
) -> Parsed<()> {
    for (i, property) in element.properties.iter().enumerate() {
        match property.kind {
            PropertyKind::Scalar(kind) => value(i, next(kind)?),
            PropertyKind::List { count, item } => {
                let length = next(count)?;
                if length < 0.0 {
                    return Err(format!(
                        "list `{}` has the length {length}",
                        clip(&property.name)
                    ));
                }
                for _ in 0..length as u64 {
                    value(i, next(item)?);
                }
            }
        }
    }
    Ok(())
}

fn take(rest: &mut &[u8], kind: Scalar, encoding: PlyEncoding) -> Parsed<f64> {
    let (bytes, after) = rest.split_at_checked(kind.bytes()).ok_or(ENDS_EARLY)?;
    *rest = after;
    Ok(kind.read(bytes, encoding))
}

fn number(word: &[u8], kind: Scalar) -> Parsed<f64> {
    let text = std::str::from_utf8(word).unwrap_or("");
    let parsed = match kind {
        // Rounded once, to the value of a binary file.
        Scalar::F32 => text.parse::<f32>().map(f64::from),
        _ => text.parse(),
    };
    match parsed {
        Ok(value) if kind.holds(value) => Ok(value),
        // Forms of NaN in C libraries: `-nan(ind)`, `1.#QNAN`, `nan(0x8000)`.
        Err(_) if kind.is_float() && (text.contains("nan") || text.contains(".#")) => Ok(f64::NAN),
        _ => Err(format!(
            "`{}` is not a value of type {}",
            clip(&String::from_utf8_lossy(word)),
            kind.name()
        )),
    }
}

// ---- vertices ----

/// Slots of a vertex's values, with all names of each; names of colours are in [`colours`].
const SLOTS: [&[&str]; 13] = [
    &["x"],
    &["y"],
    &["z"],
    &["nx"],
    &["ny"],
    &["nz"],
    &[],
    &[],
    &[],
    &[],
    &["radius"],
    &["s", "u", "texture_u"],
    &["t", "v", "texture_v"],
];
const NORMAL: usize = 3;
const COLOUR: usize = 6;
const ALPHA: usize = 9;
const RADIUS: usize = 10;
/// Texture coordinates, used only by meshes.
const TEXTURE: usize = 11;
/// Default colour, linear light.
const GREY: f64 = 0.5;

/// Slot of each property of the vertices.
struct VertexLayout {
    slot_of_property: Vec<Option<usize>>,
    is_filled: [bool; SLOTS.len()],
    colours: Columns,
}

impl VertexLayout {
    fn of(vertices: &Element) -> Parsed<VertexLayout> {
        let mut is_filled = [false; SLOTS.len()];
        let colours = Columns::of(vertices);
        let slot_of_property = vertices
            .properties
            .iter()
            .enumerate()
            .map(|(place, property)| {
                let PropertyKind::Scalar(_) = property.kind else {
                    return None;
                };
                let channel = colours
                    .rgb
                    .and_then(|(places, _)| places.iter().position(|&own| own == place))
                    .map(|channel| COLOUR + channel);
                let alpha = colours
                    .alpha
                    .filter(|&(own, _)| own == place)
                    .map(|_| ALPHA);
                let other = || {
                    SLOTS
                        .iter()
                        .position(|names| names.contains(&property.name.as_str()))
                };
                let slot = channel.or(alpha).or_else(other)?;
                (!std::mem::replace(&mut is_filled[slot], true)).then_some(slot)
            });
        let slot_of_property = slot_of_property.collect();
        if let Some(missing) = (0..NORMAL).find(|&slot| !is_filled[slot]) {
            return Err(format!(
                "element `vertex` has no number `{}`; a point needs x, y and z",
                SLOTS[missing][0]
            ));
        }
        Ok(VertexLayout {
            slot_of_property,
            is_filled,
            colours,
        })
    }

    fn has_normals(&self) -> bool {
        self.is_filled[NORMAL..COLOUR].iter().all(|&filled| filled)
    }

    /// A splat whose colour and opacity are still in the file's encoding.
    fn splat(&self, values: &[f64]) -> Splat {
        let vector = |slot| DVec3::from_slice(&values[slot..slot + 3]);
        Splat {
            position: vector(0),
            normal: if self.has_normals() {
                unit(vector(NORMAL)).unwrap_or(DVec3::ZERO)
            } else {
                DVec3::ZERO
            },
            radius: values[RADIUS],
            rgb: std::array::from_fn(|i| values[COLOUR + i]),
            opacity: values[ALPHA],
            material: 0,
        }
    }

    /// Converts colours and opacities of all splats to linear light; assumptions become notes.
    fn decode(&self, splats: &mut [Splat], header: &Header) -> Vec<String> {
        let rgb = |extent: Extent, splat: &Splat| {
            splat
                .rgb
                .iter()
                .fold(extent, |extent, &value| extent.with(value))
        };
        let opacity = |extent: Extent, splat: &Splat| extent.with(splat.opacity);
        let colours = self
            .colours
            .rgb
            .map(|(_, kind)| (kind, extent(splats, kind, rgb)));
        let colours = colours.map(|(kind, extent)| {
            (
                kind,
                extent,
                Meaning::of_colours(kind, extent, header.has_linear_colours()),
            )
        });
        let of_colours = colours.as_ref().map(|(kind, _, meaning)| (*kind, meaning));
        let opacities = self.colours.alpha.map(|(_, kind)| {
            Meaning::of_opacities(kind, extent(splats, kind, opacity), of_colours)
        });
        splats.par_iter_mut().for_each(|splat| {
            let light = |value| {
                of_colours
                    .and_then(|(_, meaning)| meaning.light(value))
                    .unwrap_or(GREY)
            };
            splat.rgb = splat.rgb.map(light);
            splat.opacity = opacities
                .as_ref()
                .and_then(|meaning| meaning.light(splat.opacity))
                .unwrap_or(1.0);
        });
        let note = colours
            .as_ref()
            .and_then(|(kind, extent, meaning)| meaning.note("vertex", *kind, *extent));
        self.colours.notes.iter().cloned().chain(note).collect()
    }

    fn check_radii(&self, splats: &[Splat]) -> Parsed<()> {
        let wrong = |s: &Splat| is_placed(s) && !(LEAST_RADIUS..=FARTHEST).contains(&s.radius);
        match splats.iter().position(wrong) {
            Some(number) if self.is_filled[RADIUS] => Err(format!(
                "vertex {number} of {} has the radius {}; it must be at least {LEAST_RADIUS:e} and at most {FARTHEST:e}",
                splats.len(),
                splats[number].radius
            )),
            _ => Ok(()),
        }
    }
}

fn extent(
    splats: &[Splat],
    kind: Scalar,
    add: impl Fn(Extent, &Splat) -> Extent + Send + Sync,
) -> Extent {
    splats
        .par_iter()
        .fold(|| Extent::of(kind), add)
        .reduce(|| Extent::of(kind), Extent::and)
}

fn read_vertices(body: &mut Body, element: &Element, layout: &VertexLayout) -> Parsed<Vec<Splat>> {
    if let Some((rows, fields)) = body.equal_rows(element) {
        let encoding = body.encoding;
        let slotted = fields
            .iter()
            .zip(&layout.slot_of_property)
            .filter_map(|(field, slot)| slot.map(|slot| (field, slot)));
        let slotted: Vec<(&RowField, usize)> = slotted.collect();
        let splat = |row: &[u8]| {
            let mut values = [0.0; SLOTS.len()];
            slotted.iter().for_each(|((kind, bytes), slot)| {
                values[*slot] = kind.read(&row[bytes.clone()], encoding)
            });
            layout.splat(&values)
        };
        return Ok(rows.map(splat).collect());
    }
    let mut splats = Vec::with_capacity(body.room(element));
    body.rows(
        element,
        &layout.slot_of_property,
        &mut [0.0; SLOTS.len()],
        |values| splats.push(layout.splat(values)),
    )?;
    Ok(splats)
}

fn is_placed(splat: &Splat) -> bool {
    splat
        .position
        .to_array()
        .iter()
        .all(|c| c.abs() <= FARTHEST)
}

fn drop_unplaced(splats: &mut Vec<Splat>) -> Option<String> {
    let all = splats.len();
    splats.retain(is_placed);
    let dropped = all - splats.len();
    (dropped > 0)
        .then(|| format!("{dropped} of {all} vertices have no finite position and were left out"))
}

#[cfg(test)]
mod tests;

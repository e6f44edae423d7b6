//! Vtk: splits a VTK XML file into tags, and converts its arrays to numbers (docs.vtk.org, "VTK XML
//! File Formats").
//!
//! An own scanner for tags and attributes: a file with raw appended samples is not XML. Arrays are
//! ASCII, base64, or appended as base64 or raw, plain or packed by zlib, with any integer or float
//! type and byte order; a file has one piece. The crate `vtkio` panics on broken files and refuses
//! some valid ones (docs/book/volumes-irregular.md).

use super::decode::{FARTHEST, Parsed, SampleLayout, clip, number, numbers, take_all, unpacker};
use super::{ByteOrder, SampleType, skip_bytes};
use crate::scene::memory;
use std::borrow::Cow;

const TYPES: [(SampleType, &str); 10] = [
    (SampleType::I8, "Int8"),
    (SampleType::U8, "UInt8"),
    (SampleType::I16, "Int16"),
    (SampleType::U16, "UInt16"),
    (SampleType::I32, "Int32"),
    (SampleType::U32, "UInt32"),
    (SampleType::I64, "Int64"),
    (SampleType::U64, "UInt64"),
    (SampleType::F32, "Float32"),
    (SampleType::F64, "Float64"),
];

// ---- tags ----

#[derive(Default)]
pub(super) struct Tag<'a> {
    pub name: &'a str,
    attributes: Vec<(&'a str, &'a str)>,
    /// Text between this tag and the next.
    text: &'a [u8],
}

impl<'a> Tag<'a> {
    pub fn get(&self, attribute: &str) -> Option<&'a str> {
        self.attributes
            .iter()
            .find(|(name, _)| *name == attribute)
            .map(|(_, value)| *value)
    }

    pub fn need(&self, attribute: &str) -> Parsed<&'a str> {
        self.get(attribute)
            .ok_or_else(|| format!("<{}> has no attribute `{attribute}`", clip(self.name)))
    }

    /// Parses the text between `<` and `>`.
    fn parse(inside: &'a [u8]) -> Parsed<Tag<'a>> {
        let inside = str::from_utf8(inside)
            .map_err(|_| "has a tag that is not UTF-8 text")?
            .trim_ascii_end()
            .trim_end_matches('/');
        let (name, mut rest) = inside
            .split_once(|c: char| c.is_ascii_whitespace())
            .unwrap_or((inside, ""));
        let mut attributes = Vec::new();
        while !rest.trim_ascii().is_empty() {
            let attribute = rest.split_once('=').and_then(|(attribute, rest)| {
                let rest = rest.trim_ascii_start();
                let quote = rest.chars().next().filter(|c| ['"', '\''].contains(c))?;
                let (value, rest) = rest.get(1..)?.split_once(quote)?;
                Some((attribute.trim_ascii(), value, rest))
            });
            let (attribute, value, after) = attribute.ok_or_else(|| {
                format!(
                    "<{}> has an attribute that is not name=\"value\"",
                    clip(name)
                )
            })?;
            attributes.push((attribute, value));
            rest = after;
        }
        Ok(Tag {
            name,
            attributes,
            text: &[],
        })
    }
}

fn find(bytes: &[u8], pattern: &[u8]) -> Option<usize> {
    bytes
        .windows(pattern.len())
        .position(|window| window == pattern)
}

/// Removes and returns the next tag; `None` at the end. Comments and declarations are skipped.
fn next_tag<'a>(rest: &mut &'a [u8]) -> Parsed<Option<Tag<'a>>> {
    const ENDS: &str = "ends inside a tag";
    while let Some(start) = find(rest, b"<") {
        let inside = &rest[start + 1..];
        if inside.starts_with(b"!--") {
            let end = find(inside, b"-->").ok_or("ends inside a comment")?;
            *rest = &inside[end + 3..];
            continue;
        }
        let mut quote = None;
        let end = inside.iter().position(|&byte| {
            match quote {
                Some(open) if open == byte => quote = None,
                None if [b'"', b'\''].contains(&byte) => quote = Some(byte),
                _ => {}
            }
            quote.is_none() && byte == b'>'
        });
        let end = end.ok_or(ENDS)?;
        *rest = &inside[end + 1..];
        if !inside.starts_with(b"?") && !inside.starts_with(b"!") {
            let mut tag = Tag::parse(&inside[..end])?;
            tag.text = &rest[..find(rest, b"<").unwrap_or(rest.len())];
            return Ok(Some(tag));
        }
    }
    Ok(None)
}

// ---- arrays ----

/// Number of components of an array, as text.
pub(super) fn components<'a>(array: &Tag<'a>) -> &'a str {
    array.get("NumberOfComponents").unwrap_or("1").trim_ascii()
}

fn sample_type(array: &Tag) -> Parsed<SampleType> {
    let name = array.need("type")?;
    let found = TYPES
        .iter()
        .find(|(_, known)| *known == name)
        .map(|(sample_type, _)| *sample_type);
    found.ok_or_else(|| {
        format!(
            "`type` is `{}`; {} are read",
            clip(name),
            TYPES.map(|(_, name)| name).join(", ")
        )
    })
}

// ---- file ----

/// A file of one data set in one piece.
#[derive(Default)]
pub(super) struct File<'a> {
    root: Tag<'a>,
    /// The tag of the file's type.
    pub set: Tag<'a>,
    pub piece: Tag<'a>,
    point_data: Tag<'a>,
    /// Arrays by the tag that contains them: `PointData`, `Coordinates` or `Points`.
    arrays: Vec<(&'static str, Tag<'a>)>,
    /// The tag of the appended samples, and everything after its underscore.
    appended: Option<(Tag<'a>, &'a [u8])>,
}

/// Tags whose arrays are read.
const SECTIONS: [&str; 3] = ["PointData", "Coordinates", "Points"];

impl<'a> File<'a> {
    /// Splits a file whose `type` is `set`, which is also the name of a tag.
    pub fn scan(bytes: &'a [u8], set: &str) -> Parsed<File<'a>> {
        let mut file = File::default();
        let mut section = None;
        let mut rest = bytes;
        while let Some(tag) = next_tag(&mut rest)? {
            match tag.name {
                "VTKFile" => file.root = tag,
                name if name == set => file.set = tag,
                "Piece" if !file.piece.name.is_empty() => {
                    return Err("has several pieces; all must be in one <Piece>".into());
                }
                "Piece" => file.piece = tag,
                "DataArray" => file.arrays.extend(section.map(|section| (section, tag))),
                "AppendedData" => {
                    let data = rest
                        .trim_ascii_start()
                        .strip_prefix(b"_")
                        .ok_or("has no underscore at the start of <AppendedData>")?;
                    file.appended = Some((tag, data));
                    break;
                }
                // Elements inside an array do not end the list of arrays.
                "/DataArray" | "InformationKey" | "/InformationKey" | "Value" | "/Value" => {}
                name => {
                    section = SECTIONS.into_iter().find(|section| *section == name);
                    if name == "PointData" {
                        file.point_data = tag;
                    }
                }
            }
        }
        if file.root.name.is_empty() {
            return Err("is not a VTK XML file: there is no <VTKFile> in it".into());
        }
        if file.root.need("type")? != set {
            return Err(format!(
                "`type` of <VTKFile> is `{}`; only {set} is read",
                clip(file.root.need("type")?)
            ));
        }
        Ok(file)
    }

    /// Samples along each axis, from `WholeExtent`, and the index of the first; the piece must
    /// cover all of it.
    pub fn extent(&self) -> Parsed<([usize; 3], [f64; 3])> {
        let (whole, extent) = (self.set.need("WholeExtent")?, self.piece.get("Extent"));
        let range: Vec<i32> = numbers(whole, 6, "WholeExtent")?;
        if let Some(extent) = extent
            && numbers::<i32>(extent, 6, "Extent")? != range
        {
            return Err(format!(
                "`Extent` of the piece is `{}`, but `WholeExtent` is `{}`; both must be the same",
                clip(extent),
                clip(whole)
            ));
        }
        // An extent that ends before it starts has no samples; `SampleLayout` refuses that.
        let size = [0, 2, 4].map(|i| {
            usize::try_from(i64::from(range[i + 1]) - i64::from(range[i]) + 1).unwrap_or(0)
        });
        Ok((size, [0, 2, 4].map(|i| f64::from(range[i]))))
    }

    /// The arrays in a tag of this name.
    pub fn arrays(&self, section: &str) -> impl Iterator<Item = &Tag<'a>> {
        self.arrays
            .iter()
            .filter(move |(of, _)| *of == section)
            .map(|(_, array)| array)
    }

    /// The array of samples: the one of this name, else the one that `PointData` selects, else the
    /// first of one component; in the last case a note is added if there are others.
    pub fn active_array(&self, named: Option<&str>) -> Parsed<(&Tag<'a>, Option<String>)> {
        let mut note = None;
        let of_name = |name: &str| {
            self.arrays("PointData")
                .find(|array| array.get("Name") == Some(name))
        };
        let array = match named {
            Some(name) => of_name(name).ok_or_else(|| self.no_array(name))?,
            None => {
                let first = || {
                    self.arrays("PointData")
                        .find(|array| components(array) == "1")
                        .or(self.arrays("PointData").next())
                };
                match self
                    .point_data
                    .get("Scalars")
                    .filter(|name| !name.is_empty())
                {
                    // An empty list has its own message.
                    Some(name) if first().is_some() => of_name(name).ok_or_else(|| {
                        format!("`Scalars` of <PointData>: {}", self.no_array(name))
                    })?,
                    _ => {
                        let array = first().ok_or(
                            "has no <DataArray> in <PointData>; samples at points are read",
                        )?;
                        note = self.others(array);
                        array
                    }
                }
            }
        };
        match components(array) {
            "1" => Ok((array, note)),
            other => Err(format!(
                "`NumberOfComponents` is `{}`; only arrays of 1 component are read",
                clip(other)
            )),
        }
    }

    /// A note with the drawn array, if a scene may have meant another.
    fn others(&self, array: &Tag) -> Option<String> {
        let name = |array: &Tag| clip(array.get("Name").unwrap_or_default());
        let fit = self
            .arrays("PointData")
            .filter(|other| components(other) == "1");
        let others: Vec<String> = fit
            .map(name)
            .filter(|other| *other != name(array))
            .collect();
        (!others.is_empty()).then(|| {
            format!(
                "array `{}` is drawn, the first; `array` may name {}",
                name(array),
                clip(&others.join(", "))
            )
        })
    }

    /// An array of samples at points, of any number of components, by its name.
    pub fn named_array(&self, name: &str) -> Parsed<&Tag<'a>> {
        self.arrays("PointData")
            .find(|array| array.get("Name") == Some(name))
            .ok_or_else(|| self.no_array(name))
    }

    fn no_array(&self, name: &str) -> String {
        let names: Vec<String> = self
            .arrays("PointData")
            .filter_map(|array| array.get("Name"))
            .map(clip)
            .collect();
        let known = if names.is_empty() {
            "no array with a name".into()
        } else {
            clip(&names.join(", "))
        };
        format!(
            "has no array `{}` in <PointData>; there is {known}",
            clip(name)
        )
    }

    fn order(&self) -> Parsed<ByteOrder> {
        match self.root.get("byte_order") {
            None | Some("LittleEndian") => Ok(ByteOrder::Little),
            Some("BigEndian") => Ok(ByteOrder::Big),
            Some(other) => Err(format!(
                "`byte_order` is `{}`; it must be LittleEndian or BigEndian",
                clip(other)
            )),
        }
    }

    /// The samples of an array, which must match `size`, the value of `field`.
    pub fn values(&self, array: &Tag<'a>, size: [usize; 3], field: &str) -> Parsed<Vec<f32>> {
        self.read(
            array,
            size,
            field,
            |layout, bytes| layout.values(bytes),
            |layout, text| layout.text_values(text),
        )
    }

    /// The positions in an array: finite, and within the range of a scene.
    pub fn places(&self, array: &Tag<'a>, size: [usize; 3], field: &str) -> Parsed<Vec<f64>> {
        let reals = self.read(
            array,
            size,
            field,
            |layout, bytes| layout.reals(bytes),
            |layout, text| layout.finite(layout.text_reals(text)?),
        )?;
        match reals.iter().find(|place| place.abs() > FARTHEST) {
            None => Ok(reals),
            Some(place) => Err(format!(
                "`{field}` holds {place:e}; a place must be within ±{FARTHEST:e}"
            )),
        }
    }

    fn read<T>(
        &self,
        array: &Tag<'a>,
        size: [usize; 3],
        field: &str,
        of_bytes: impl Fn(&SampleLayout, &[u8]) -> Parsed<Vec<T>>,
        of_text: impl Fn(&SampleLayout, &[u8]) -> Parsed<Vec<T>>,
    ) -> Parsed<Vec<T>> {
        let order = self.order()?;
        let layout = SampleLayout::new(size, sample_type(array)?, order, field)?;
        let of_block = |block: &[u8]| of_bytes(&layout, &self.unblock(block, order, &layout)?);
        let values = match array.need("format")? {
            "ascii" => layout
                .ends(array.text)
                .and_then(|()| of_text(&layout, array.text)),
            "binary" => of_block(&base64(array.text)),
            "appended" => self.appended(array).and_then(|block| of_block(&block)),
            other => Err(format!(
                "`format` is `{}`; ascii, binary and appended are read",
                clip(other)
            )),
        };
        values.map_err(|e| {
            format!(
                "array `{}`: {e}",
                clip(array.get("Name").unwrap_or_default())
            )
        })
    }

    /// The block of an appended array, and everything after it.
    fn appended(&self, array: &Tag) -> Parsed<Cow<'a, [u8]>> {
        let (tag, data) = self
            .appended
            .as_ref()
            .ok_or("`format` is appended, but there is no <AppendedData>")?;
        let data = skip_bytes(
            data,
            number(array.need("offset")?, "offset", "a whole number")?,
            "offset",
        )?;
        match tag.need("encoding")? {
            "raw" => Ok(Cow::Borrowed(data)),
            "base64" => Ok(Cow::Owned(base64(data))),
            other => Err(format!(
                "`encoding` of <AppendedData> is `{}`; raw and base64 are read",
                clip(other)
            )),
        }
    }

    /// The bytes of the samples in a block: after their length, or in parts packed by zlib, after
    /// the lengths of the parts.
    fn unblock<'b>(
        &self,
        block: &'b [u8],
        order: ByteOrder,
        layout: &SampleLayout,
    ) -> Parsed<Cow<'b, [u8]>> {
        let want = layout.bytes();
        let word_bytes = match self.root.get("header_type") {
            None | Some("UInt32") => 4,
            Some("UInt64") => 8,
            Some(other) => {
                return Err(format!(
                    "`header_type` is `{}`; it must be UInt32 or UInt64",
                    clip(other)
                ));
            }
        };
        let wrong =
            |length: u64| format!("the block declares {length} bytes, but the samples take {want}");
        let mut words = block.chunks_exact(word_bytes).map(|word| {
            let digit = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
            if order == ByteOrder::Big {
                word.iter().fold(0, digit)
            } else {
                word.iter().rev().fold(0, digit)
            }
        });
        let mut word = || words.next().ok_or("the block ends inside its header");
        match self.root.get("compressor") {
            None | Some("") => {
                let length = word()?;
                if length != want as u64 {
                    return Err(wrong(length));
                }
                Ok(Cow::Borrowed(&block[word_bytes..]))
            }
            Some("vtkZLibDataCompressor") => {
                let (parts, full, last) = (word()?, word()?, word()?);
                // A last part of zero means that it is as long as the others.
                let last = if last == 0 { full } else { last };
                let length = parts
                    .saturating_sub(1)
                    .saturating_mul(full)
                    .saturating_add(last);
                if parts == 0 || length != want as u64 {
                    return Err(wrong(if parts == 0 { 0 } else { length }));
                }
                // One byte of a file may unpack to a thousand.
                memory::check(
                    layout.count() as u64,
                    "packed numbers",
                    layout.unpacked_bytes(),
                )?;
                let lengths_end = usize::try_from(parts)
                    .ok()
                    .and_then(|n| n.checked_add(3)?.checked_mul(word_bytes));
                let mut packed = lengths_end
                    .and_then(|end| block.get(end..))
                    .ok_or("the block ends inside its header")?;
                let mut samples = Vec::new();
                for part in 0..parts {
                    let most = usize::try_from(if part + 1 == parts { last } else { full })
                        .unwrap_or(usize::MAX);
                    let cut = usize::try_from(word()?)
                        .ok()
                        .and_then(|length| packed.split_at_checked(length));
                    let (this, rest) =
                        cut.ok_or_else(|| format!("compressed part {part} of {parts} ends early"))?;
                    packed = rest;
                    let bytes = take_all(&mut unpacker(this), most)?;
                    if bytes.len() < most {
                        return Err(format!(
                            "compressed part {part} of {parts} unpacks to {} bytes, not to {most}",
                            bytes.len()
                        ));
                    }
                    samples.extend(bytes);
                }
                Ok(Cow::Owned(samples))
            }
            Some(other) => Err(format!(
                "`compressor` is `{}`; only vtkZLibDataCompressor is read",
                clip(other)
            )),
        }
    }
}

/// Decodes base64 up to the first other character. Padding may be inside: VTK encodes lengths and
/// samples separately.
fn base64(text: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    // The bits of the current group of four digits, and the number of digits.
    let (mut group, mut digits) = (0, 0);
    for &character in text
        .iter()
        .filter(|character| !character.is_ascii_whitespace())
    {
        let digit = match character {
            b'A'..=b'Z' => character - b'A',
            b'a'..=b'z' => character - b'a' + 26,
            b'0'..=b'9' => character - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            b'=' => {
                (group, digits) = (0, 0);
                continue;
            }
            _ => break,
        };
        group = group << 6 & 0xfff | u32::from(digit);
        digits += 1;
        if digits > 1 {
            bytes.push((group >> (8 - 2 * digits)) as u8);
        }
        digits %= 4;
    }
    bytes
}

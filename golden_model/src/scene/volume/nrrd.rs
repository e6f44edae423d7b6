//! Nrrd: reads a volume from an NRRD file, or from a detached header and its data file
//! (teem.sourceforge.net/nrrd/format.html, versions 1 to 5).
//!
//! - Axes of length 1 are dropped until three are left, those without a space direction first.
//! - `space directions` override `spacings`, which override the steps of `axis mins` and `axis
//!   maxs`.
//! - `space` names the coordinate system, which is converted to the common one ([`super::world`]);
//!   a header without it is drawn unchanged, with a note.
//! - Unknown fields are refused, as the format requires; key/value pairs and comments are skipped.

use super::decode::{
    Fields, Parsed, SampleLayout, check_grid, clip, diagonal, in_data_file, next_line, number,
    numbers, pass_over, read_beside, take_all, unpacker,
};
use super::world::{World, unoriented};
use super::{ByteOrder, SampleType, Volume, skip_bytes};
use std::path::Path;

/// Each type with all of its names, without blanks and `_t`.
const TYPES: [(SampleType, &[&str]); 10] = [
    (SampleType::I8, &["signedchar", "int8"]),
    (SampleType::U8, &["uchar", "unsignedchar", "uint8"]),
    (
        SampleType::I16,
        &[
            "short",
            "shortint",
            "signedshort",
            "signedshortint",
            "int16",
        ],
    ),
    (
        SampleType::U16,
        &["ushort", "unsignedshort", "unsignedshortint", "uint16"],
    ),
    (SampleType::I32, &["int", "signedint", "int32"]),
    (SampleType::U32, &["uint", "unsignedint", "uint32"]),
    (
        SampleType::I64,
        &[
            "longlong",
            "longlongint",
            "signedlonglong",
            "signedlonglongint",
            "int64",
        ],
    ),
    (
        SampleType::U64,
        &[
            "ulonglong",
            "unsignedlonglong",
            "unsignedlonglongint",
            "uint64",
        ],
    ),
    (SampleType::F32, &["float"]),
    (SampleType::F64, &["double"]),
];

/// Fields that are read.
const FIELDS: [&str; 16] = [
    "type",
    "dimension",
    "sizes",
    "encoding",
    "endian",
    "data file",
    "line skip",
    "byte skip",
    "spacings",
    "space",
    "space dimension",
    "space directions",
    "space origin",
    "axis mins",
    "axis maxs",
    "centers",
];

/// Other fields of the format, without blanks.
const IGNORED: [&str; 14] = [
    "blocksize",
    "content",
    "min",
    "max",
    "oldmin",
    "oldmax",
    "number",
    "sampleunits",
    "thicknesses",
    "labels",
    "units",
    "kinds",
    "spaceunits",
    "measurementframe",
];

/// Most axes that the format allows.
const MOST_AXES: usize = 16;

#[derive(Clone, Copy, PartialEq)]
enum NrrdEncoding {
    Raw,
    Gzip,
    Text,
    Hex,
}

pub(in crate::scene) fn read(bytes: &[u8], folder: &Path) -> Parsed<Volume> {
    let (header, attached) = read_header(bytes)?;
    let encoding = encoding(&header)?;
    let sample_type = sample_type(&header)?;
    let order = byte_order(&header, encoding, sample_type)?;
    let space = header.get("space").map(space).transpose()?;
    let numbers = if space.is_some_and(|(_, has_time)| has_time) {
        4
    } else {
        3
    };
    let grid = three_axes(read_axes(&header, numbers)?)?;
    let layout = SampleLayout::new(
        grid.each_ref().map(|axis| axis.size),
        sample_type,
        order,
        "sizes",
    )?;
    let axes = if grid.iter().all(|axis| axis.direction.is_some()) {
        grid.each_ref()
            .map(|axis| axis.direction.unwrap_or_default())
    } else {
        diagonal(grid.each_ref().map(|axis| axis.spacing))
    };
    let axes_field = if header.get("space directions").is_some() {
        "space directions"
    } else {
        "spacings"
    };
    let origin = match header.get("space origin") {
        Some(text) => only_vector(text, numbers)?,
        None => grid.each_ref().map(Axis::first_position),
    };
    check_grid(&axes, axes_field, &origin, "space origin")?;
    let (axes, origin) = space.map_or((axes, origin), |(world, _)| world.turned(axes, origin));
    let note = match space {
        Some((world, _)) => world.note(),
        None => Some(unoriented("has no `space`")),
    };
    let values = match (header.get("data file"), attached) {
        (Some(name), _) => {
            let data = read_beside(folder, name, "data file")?;
            read_samples(&data, &header, encoding, &layout).map_err(|e| in_data_file(name, e))?
        }
        (None, Some(data)) => read_samples(data, &header, encoding, &layout)?,
        (None, None) => {
            return Err(
                "has neither a `data file` nor an empty line with the samples after it".into(),
            );
        }
    };
    Ok(Volume {
        size: layout.size,
        axes,
        origin,
        values,
        notes: note.into_iter().collect(),
    })
}

/// The fields, and the data after the empty line at their end.
fn read_header(bytes: &[u8]) -> Parsed<(Fields, Option<&[u8]>)> {
    let mut rest = bytes;
    let magic = next_line(&mut rest).unwrap_or_default().trim_ascii_end();
    let version = magic
        .strip_prefix(b"NRRD")
        .ok_or("is not an NRRD file: its first line does not begin with `NRRD`")?;
    if !matches!(
        version,
        b"0001" | b"0002" | b"0003" | b"0004" | b"0005" | b"00.01"
    ) {
        return Err(format!(
            "is of NRRD version `{}`; versions 0001 to 0005 are read",
            clip(&String::from_utf8_lossy(version))
        ));
    }
    let mut header = Fields::new();
    while let Some(line) = next_line(&mut rest) {
        if line.is_empty() {
            return Ok((header, Some(rest)));
        }
        let line = String::from_utf8_lossy(line);
        if !line.starts_with('#') {
            add_field(&mut header, &line)?;
        }
    }
    Ok((header, None))
}

fn add_field(header: &mut Fields, line: &str) -> Parsed<()> {
    let (name, value) = line
        .split_once(':')
        .ok_or_else(|| format!("header line `{}` is not `field: value`", clip(line)))?;
    if value.starts_with('=') {
        return Ok(());
    }
    let name = name
        .to_lowercase()
        .replace(' ', "")
        .replace("centerings", "centers");
    match FIELDS.iter().find(|field| field.replace(' ', "") == name) {
        Some(&"data file") if value.trim_start().starts_with("LIST") || value.contains('%') => {
            Err(format!(
                "`data file` is `{}`; samples spread over several files are not read",
                clip(value.trim())
            ))
        }
        Some(field) => header.add(field, value.trim().into()),
        None if IGNORED.contains(&name.as_str()) => Ok(()),
        None => Err(format!(
            "`{}` is not a field of an NRRD header",
            clip(&name)
        )),
    }
}

fn sample_type(header: &Fields) -> Parsed<SampleType> {
    let name = header.need("type")?;
    let bare = name.to_lowercase().replace(' ', "");
    let bare = bare.strip_suffix("_t").unwrap_or(&bare);
    let found = TYPES
        .iter()
        .find(|(_, names)| names.contains(&bare))
        .map(|(sample_type, _)| *sample_type);
    found.ok_or_else(|| {
        format!(
            "`type` is `{}`; integers of 8, 16, 32 and 64 bits, float and double are read",
            clip(name)
        )
    })
}

/// The coordinate system of `space`, and whether vectors have a fourth number, time.
fn space(name: &str) -> Parsed<(World, bool)> {
    let known = || {
        format!(
            "`space` is `{}`; {}, and these with -time are read",
            clip(name),
            World::names()
        )
    };
    World::of_nrrd(name).ok_or_else(known)
}

fn encoding(header: &Fields) -> Parsed<NrrdEncoding> {
    let name = header.need("encoding")?;
    match name.to_lowercase().as_str() {
        "raw" => Ok(NrrdEncoding::Raw),
        "gz" | "gzip" => Ok(NrrdEncoding::Gzip),
        "txt" | "text" | "ascii" => Ok(NrrdEncoding::Text),
        "hex" => Ok(NrrdEncoding::Hex),
        _ => Err(format!(
            "`encoding` is `{}`; raw, gzip, ascii and hex are read",
            clip(name)
        )),
    }
}

fn byte_order(
    header: &Fields,
    encoding: NrrdEncoding,
    sample_type: SampleType,
) -> Parsed<ByteOrder> {
    match header.get("endian").map(str::to_lowercase).as_deref() {
        Some("little") => Ok(ByteOrder::Little),
        Some("big") => Ok(ByteOrder::Big),
        Some(other) => Err(format!(
            "`endian` is `{}`; it must be little or big",
            clip(other)
        )),
        None if encoding == NrrdEncoding::Text || sample_type.bytes() == 1 => Ok(ByteOrder::Little),
        None => Err("there is no `endian` in the header; it must be little or big".into()),
    }
}

// ---- axes ----

#[derive(Clone, Copy)]
struct Axis {
    size: usize,
    direction: Option<[f64; 3]>,
    spacing: f64,
    min: f64,
    /// Samples are at the centres of cells, half a step from the axis's end.
    in_cells: bool,
}

impl Axis {
    fn first_position(&self) -> f64 {
        if self.in_cells {
            self.min + self.spacing / 2.0
        } else {
            self.min
        }
    }
}

fn read_axes(header: &Fields, numbers_each: usize) -> Parsed<Vec<Axis>> {
    let dimension: usize = number(header.need("dimension")?, "dimension", "a whole number")?;
    if !(3..=MOST_AXES).contains(&dimension) {
        return Err(format!(
            "`dimension` is {dimension}; a volume has 3 (or more, where the others are of length 1)"
        ));
    }
    let sizes = numbers(header.need("sizes")?, dimension, "sizes")?;
    let per_axis = |field| {
        header
            .get(field)
            .map(|text| numbers::<f64>(text, dimension, field))
            .transpose()
    };
    let (spacings, mins, maxs) = (
        per_axis("spacings")?,
        per_axis("axis mins")?,
        per_axis("axis maxs")?,
    );
    let directions = header
        .get("space directions")
        .map(|text| vectors(text, dimension, numbers_each, "space directions"))
        .transpose()?;
    let directions = directions
        .map(|all| all.into_iter().map(in_space).collect::<Parsed<Vec<_>>>())
        .transpose()?;
    let mut centers = header
        .get("centers")
        .unwrap_or_default()
        .split_ascii_whitespace();
    let axis = |(i, size): (usize, usize)| {
        let in_cells = centers.next() == Some("cell");
        let steps = if in_cells {
            size as f64
        } else {
            size.saturating_sub(1).max(1) as f64
        };
        // NaN means "unknown" in `axis mins` and `axis maxs`.
        let end = |ends: &Option<Vec<f64>>| {
            ends.as_ref()
                .map(|ends| ends[i])
                .filter(|end| !end.is_nan())
        };
        let spacing = match (&spacings, end(&mins), end(&maxs)) {
            (Some(spacings), ..) => spacings[i],
            (None, Some(min), Some(max)) if size > 1 => (max - min) / steps,
            _ => 1.0,
        };
        Axis {
            size,
            direction: directions.as_ref().and_then(|d| d[i]),
            spacing,
            min: end(&mins).unwrap_or(0.0),
            in_cells,
        }
    };
    Ok(sizes.into_iter().enumerate().map(axis).collect())
}

fn three_axes(mut axes: Vec<Axis>) -> Parsed<[Axis; 3]> {
    let written = axes
        .iter()
        .map(|axis| axis.size.to_string())
        .collect::<Vec<_>>()
        .join(" ");
    while axes.len() > 3 {
        let without_direction = axes
            .iter()
            .rposition(|axis| axis.size == 1 && axis.direction.is_none());
        let droppable = without_direction.or_else(|| axes.iter().rposition(|axis| axis.size == 1));
        axes.remove(droppable.ok_or_else(|| {
            format!(
                "`sizes` is {written}; a volume has 3 axes, and only others of length 1 are dropped"
            )
        })?);
    }
    let axes = [axes[0], axes[1], axes[2]];
    let directions = axes.iter().filter(|axis| axis.direction.is_some()).count();
    if directions == 1 || directions == 2 {
        return Err(
            "`space directions` has `none` for an axis of the volume; it must be a vector".into(),
        );
    }
    Ok(axes)
}

/// The spatial part of a step; None if it is only in time.
fn in_space(step: Option<[f64; 4]>) -> Parsed<Option<[f64; 3]>> {
    match step {
        Some([x, y, z, time]) if time != 0.0 && [x, y, z] != [0.0; 3] => Err(format!(
            "`space directions` has a step ({x},{y},{z},{time}) in space and in time; it must be in one of them"
        )),
        Some([x, y, z, 0.0]) => Ok(Some([x, y, z])),
        _ => Ok(None),
    }
}

/// Vectors of 3 or 4 numbers in parentheses, or `none`; for 3 numbers the fourth is 0.
fn vectors(
    text: &str,
    count: usize,
    numbers_each: usize,
    field: &str,
) -> Parsed<Vec<Option<[f64; 4]>>> {
    let like = if numbers_each == 4 {
        "(1,0,0,0)"
    } else {
        "(1,0,0)"
    };
    let wrong = || {
        format!(
            "`{field}` is `{}`; it must be {count} times a vector like {like} or none",
            clip(text)
        )
    };
    let mut vectors = Vec::new();
    let mut rest = text.trim();
    while !rest.is_empty() {
        let (vector, after) = match rest.strip_prefix("none") {
            Some(after) => (None, after),
            None => {
                let (inside, after) = rest
                    .strip_prefix('(')
                    .and_then(|rest| rest.split_once(')'))
                    .ok_or_else(wrong)?;
                let parsed: Option<Vec<f64>> = inside
                    .split(',')
                    .map(|word| word.trim().parse().ok())
                    .collect();
                let mut parsed = parsed
                    .filter(|numbers| numbers.len() == numbers_each)
                    .ok_or_else(wrong)?;
                parsed.resize(4, 0.0);
                let vector: [f64; 4] = parsed.try_into().map_err(|_| wrong())?;
                (Some(vector), after)
            }
        };
        vectors.push(vector);
        rest = after.trim_start();
    }
    if vectors.len() == count {
        Ok(vectors)
    } else {
        Err(wrong())
    }
}

fn only_vector(text: &str, numbers: usize) -> Parsed<[f64; 3]> {
    let vector = vectors(text, 1, numbers, "space origin")?
        .into_iter()
        .next()
        .flatten();
    vector
        .map(|[x, y, z, _]| [x, y, z])
        .ok_or_else(|| "`space origin` is none; it must be a vector like (0,0,0)".into())
}

// ---- samples ----

fn read_samples(
    mut data: &[u8],
    header: &Fields,
    encoding: NrrdEncoding,
    layout: &SampleLayout,
) -> Parsed<Vec<f32>> {
    for _ in 0..number::<u64>(
        header.get("line skip").unwrap_or("0"),
        "line skip",
        "a whole number",
    )? {
        next_line(&mut data).ok_or("`line skip` skips more lines than there are")?;
    }
    let skip: i64 = number(
        header.get("byte skip").unwrap_or("0"),
        "byte skip",
        "a whole number or -1",
    )?;
    // −1: the samples are at the end of the file.
    let skip = match (u64::try_from(skip), encoding) {
        (Ok(skip), _) => skip,
        (Err(_), NrrdEncoding::Raw) if skip == -1 => {
            data.len().saturating_sub(layout.bytes()) as u64
        }
        (Err(_), NrrdEncoding::Gzip) if skip == -1 => {
            pass_over(&mut unpacker(data), u64::MAX)?.saturating_sub(layout.bytes() as u64)
        }
        _ => {
            return Err(format!(
                "`byte skip` is {skip}; it must be zero or more, or -1 with the encodings raw and gzip"
            ));
        }
    };
    match encoding {
        NrrdEncoding::Raw => layout.values(skip_bytes(data, skip, "byte skip")?),
        NrrdEncoding::Text => layout.text_values(skip_bytes(data, skip, "byte skip")?),
        NrrdEncoding::Hex => layout.values(&unhex(
            skip_bytes(data, skip, "byte skip")?,
            layout.bytes(),
        )?),
        NrrdEncoding::Gzip => {
            let mut source = unpacker(data);
            pass_over(&mut source, skip)?;
            layout.values(&take_all(&mut source, layout.bytes())?)
        }
    }
}

/// At most `most` bytes, each from two hexadecimal digits.
fn unhex(text: &[u8], most: usize) -> Parsed<Vec<u8>> {
    let digit = |byte: &u8| {
        (*byte as char)
            .to_digit(16)
            .ok_or_else(|| format!("`{}` is not a hexadecimal digit", byte.escape_ascii()))
    };
    let mut digits = text
        .iter()
        .filter(|byte| !byte.is_ascii_whitespace())
        .map(digit);
    let mut bytes = Vec::new();
    while bytes.len() < most {
        let (Some(high), Some(low)) = (digits.next(), digits.next()) else {
            break;
        };
        bytes.push((high? << 4 | low?) as u8);
    }
    Ok(bytes)
}

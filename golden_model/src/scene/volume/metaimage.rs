//! MetaImage: reads a volume from an `.mha` file, or from an `.mhd` header and its data file
//! (docs.itk.org, "MetaIO").
//!
//! Coordinates are left-posterior-superior, as defined by ITK, and are converted to the common
//! system. `AnatomicalOrientation` repeats `TransformMatrix` and is not read. Keys that do not
//! affect the samples are skipped: users may add their own.

use super::decode::{
    Fields, Parsed, SampleLayout, check_grid, clip, diagonal, in_data_file, next_line, number,
    numbers, positive, read_beside, take_all, triple, unpacker,
};
use super::world::World;
use super::{ByteOrder, SampleType, Volume, skip_bytes};
use std::path::Path;

/// `MET_LONG` has 32 bits in files, on every computer.
const TYPES: [(SampleType, &str); 12] = [
    (SampleType::I8, "MET_CHAR"),
    (SampleType::U8, "MET_UCHAR"),
    (SampleType::I16, "MET_SHORT"),
    (SampleType::U16, "MET_USHORT"),
    (SampleType::I32, "MET_INT"),
    (SampleType::U32, "MET_UINT"),
    (SampleType::I32, "MET_LONG"),
    (SampleType::U32, "MET_ULONG"),
    (SampleType::I64, "MET_LONG_LONG"),
    (SampleType::U64, "MET_ULONG_LONG"),
    (SampleType::F32, "MET_FLOAT"),
    (SampleType::F64, "MET_DOUBLE"),
];

const KEYS: [&str; 19] = [
    "ObjectType",
    "NDims",
    "DimSize",
    "ElementType",
    "ElementNumberOfChannels",
    "BinaryData",
    "BinaryDataByteOrderMSB",
    "ElementByteOrderMSB",
    "CompressedData",
    "HeaderSize",
    "ElementSpacing",
    "ElementSize",
    "Offset",
    "Position",
    "Origin",
    "TransformMatrix",
    "Orientation",
    "Rotation",
    "ElementDataFile",
];

pub(in crate::scene) fn read(bytes: &[u8], folder: &Path) -> Parsed<Volume> {
    let (header, local) = read_header(bytes)?;
    must_be(&header, "ObjectType", "Image")?;
    must_be(&header, "ElementNumberOfChannels", "1")?;
    header.need("NDims")?;
    must_be(&header, "NDims", "3")?;
    let order = match header.first_of(&["BinaryDataByteOrderMSB", "ElementByteOrderMSB"]) {
        Some((key, _)) if yes(&header, key, false)? => ByteOrder::Big,
        _ => ByteOrder::Little,
    };
    let layout = SampleLayout::new(
        triple(header.need("DimSize")?, "DimSize")?,
        sample_type(&header)?,
        order,
        "DimSize",
    )?;
    let (axes, origin) = read_grid(&header)?;
    let (axes, origin) = World::LPS.turned(axes, origin);
    let values = match header.need("ElementDataFile")? {
        "LOCAL" | "Local" | "local" => read_samples(local, &header, &layout)?,
        name if name.starts_with("LIST") || name.contains('%') => {
            return Err(format!(
                "`ElementDataFile` is `{}`; samples spread over several files are not read",
                clip(name)
            ));
        }
        name => {
            let data = read_beside(folder, name, "ElementDataFile")?;
            read_samples(&data, &header, &layout).map_err(|e| in_data_file(name, e))?
        }
    };
    Ok(Volume {
        size: layout.size,
        axes,
        origin,
        values,
        notes: World::LPS.note().into_iter().collect(),
    })
}

/// The relevant keys, and the data after `ElementDataFile`, which is the last.
fn read_header(bytes: &[u8]) -> Parsed<(Fields, &[u8])> {
    let mut rest = bytes;
    let mut header = Fields::new();
    while let Some(line) = next_line(&mut rest) {
        let line = String::from_utf8_lossy(line);
        if line.trim().is_empty() {
            continue;
        }
        let (key, value) = line
            .split_once('=')
            .ok_or_else(|| format!("header line `{}` is not `key = value`", clip(&line)))?;
        if let Some(key) = KEYS.iter().find(|known| **known == key.trim()) {
            header.add(key, value.trim().into())?;
            if *key == "ElementDataFile" {
                break;
            }
        }
    }
    Ok((header, rest))
}

fn must_be(header: &Fields, key: &str, value: &str) -> Parsed<()> {
    match header.get(key) {
        Some(other) if other != value => Err(format!(
            "`{key}` is `{}`; only {value} is read",
            clip(other)
        )),
        _ => Ok(()),
    }
}

fn yes(header: &Fields, key: &str, default: bool) -> Parsed<bool> {
    match header.get(key).map(str::to_lowercase).as_deref() {
        None => Ok(default),
        Some("true" | "t" | "1") => Ok(true),
        Some("false" | "f" | "0") => Ok(false),
        Some(other) => Err(format!(
            "`{key}` is `{}`; it must be True or False",
            clip(other)
        )),
    }
}

fn sample_type(header: &Fields) -> Parsed<SampleType> {
    let name = header.need("ElementType")?;
    let found = TYPES
        .iter()
        .find(|(_, known)| *known == name)
        .map(|(sample_type, _)| *sample_type);
    found.ok_or_else(|| {
        format!(
            "`ElementType` is `{}`; {} are read",
            clip(name),
            TYPES.map(|(_, name)| name).join(", ")
        )
    })
}

fn read_grid(header: &Fields) -> Parsed<([[f64; 3]; 3], [f64; 3])> {
    let (spacing_key, spacing) = match header.first_of(&["ElementSpacing", "ElementSize"]) {
        Some((key, text)) => (key, triple(text, key)?),
        None => ("ElementSpacing", [1.0; 3]),
    };
    positive(spacing, spacing_key)?;
    let (origin_key, origin) = match header.first_of(&["Offset", "Position", "Origin"]) {
        Some((key, text)) => (key, triple(text, key)?),
        None => ("Offset", [0.0; 3]),
    };
    // Three numbers for each axis: the direction of its step.
    let (axes_key, axes) = match header.first_of(&["TransformMatrix", "Orientation", "Rotation"]) {
        Some((key, text)) => {
            let matrix: Vec<f64> = numbers(text, 9, key)?;
            (
                key,
                [0, 1, 2].map(|i| [0, 1, 2].map(|j| matrix[3 * i + j] * spacing[i])),
            )
        }
        None => (spacing_key, diagonal(spacing)),
    };
    check_grid(&axes, axes_key, &origin, origin_key)?;
    Ok((axes, origin))
}

fn read_samples(data: &[u8], header: &Fields, layout: &SampleLayout) -> Parsed<Vec<f32>> {
    let compressed = yes(header, "CompressedData", false)?;
    let skip: i64 = number(
        header.get("HeaderSize").unwrap_or("0"),
        "HeaderSize",
        "a whole number or -1",
    )?;
    // −1: the samples are at the end of the file.
    let skip = match u64::try_from(skip) {
        Ok(skip) => skip,
        Err(_) if skip == -1 && !compressed => data.len().saturating_sub(layout.bytes()) as u64,
        Err(_) => {
            return Err(format!(
                "`HeaderSize` is {skip}; it must be zero or more, or -1 where samples are not compressed"
            ));
        }
    };
    let data = skip_bytes(data, skip, "HeaderSize")?;
    if compressed {
        layout.values(&take_all(&mut unpacker(data), layout.bytes())?)
    } else if yes(header, "BinaryData", true)? {
        layout.values(data)
    } else {
        layout.text_values(data)
    }
}

//! Volume: reads a scalar field on a grid from NRRD, MetaImage, NIfTI-1, VTK's XML or plain
//! samples; or at points, from VTK's XML.
//!
//! Own readers, because the files have few, simple layouts, and every error must end in a sentence.
//! Memory is reserved only up to what the file's length supports, so a header cannot demand memory.
//! Medical formats are converted to one coordinate system, right-anterior-superior ([`world`]).

mod decode;
pub(super) mod irregular;
pub(super) mod metaimage;
pub(super) mod nifti;
pub(super) mod nrrd;
#[cfg(test)]
mod tests;
pub(super) mod vti;
mod vtk;
mod world;

use super::formats::{self, Reader};
pub use decode::{ByteOrder, SampleType};
use decode::{
    Parsed, SampleLayout, check_grid, clip, diagonal, in_data_file, positive, read_beside,
    read_file,
};
pub use irregular::{Arrays, Irregular, SamplePlaces};
use std::path::Path;

/// A scalar field on an evenly spaced grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Volume {
    /// Samples along each axis, x fastest; at least 1 each, at most 2³¹ in all.
    pub size: [usize; 3],
    /// World vector of one step along each axis (spacing times direction); they span space, at any
    /// angles.
    pub axes: [[f64; 3]; 3],
    /// World position of the first sample.
    pub origin: [f64; 3],
    /// The samples, x fastest; finite, or NaN for a missing sample.
    pub values: Vec<f32>,
    /// Assumptions and conversions of the reader, for the summary; each is the second half of a
    /// sentence that begins with the file's name.
    pub notes: Vec<String>,
}

/// A scalar field.
pub enum Samples {
    /// On an evenly spaced grid.
    Even(Volume),
    /// On another grid, or at points.
    Uneven(Irregular),
}

impl Samples {
    /// All samples.
    pub fn values(&self) -> &[f32] {
        match self {
            Samples::Even(volume) => &volume.values,
            Samples::Uneven(field) => &field.values,
        }
    }

    /// Notes of the reader, each the second half of a sentence.
    pub fn notes(&self) -> &[String] {
        match self {
            Samples::Even(volume) => &volume.notes,
            Samples::Uneven(field) => &field.notes,
        }
    }
}

/// Description of a file of plain samples.
#[derive(Clone, Debug, PartialEq, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawDescription {
    /// The file of samples, relative to the folder of this description.
    pub file: String,
    /// Samples along x, y and z; x is fastest in the file.
    pub size: [usize; 3],
    /// Type of a sample.
    #[serde(rename = "type")]
    pub sample_type: SampleType,
    /// Order of the bytes of a sample.
    #[serde(default)]
    pub endian: ByteOrder,
    /// World units from one sample to the next along x, y and z, > 0.
    #[serde(default = "unit_spacing")]
    pub spacing: [f64; 3],
    /// World position of the first sample.
    #[serde(default)]
    pub origin: [f64; 3],
    /// Bytes before the first sample.
    #[serde(default)]
    pub skip: u64,
}

fn unit_spacing() -> [f64; 3] {
    [1.0; 3]
}

/// Reads a field in the format of the extension. Only VTK's formats have names of arrays.
///
/// # Errors
/// As [`read`].
pub fn read_samples(path: &Path, arrays: &Arrays) -> Result<Samples, String> {
    match formats::reader(path) {
        Some(Reader::Irregular(parse)) => {
            return parse(&read_file(path)?, arrays).map(Samples::Uneven);
        }
        Some(Reader::Image(parse)) => return parse(&read_file(path)?, arrays).map(Samples::Even),
        _ => {}
    }
    let volume = read(path)?;
    let field = arrays
        .values
        .map(|_| "array")
        .or(arrays.variance.map(|_| "variance"));
    field.map_or(Ok(Samples::Even(volume)), |field| {
        Err(format!(
            "is of a format without named arrays, and `{field}` requests one"
        ))
    })
}

/// Reads a volume in the format of the extension; of named arrays the one that the file selects, or
/// the first.
///
/// # Errors
/// One sentence that does not contain `path`, but names a second file if the error is there.
pub fn read(path: &Path) -> Result<Volume, String> {
    if let Some(Reader::Volume(parse)) = formats::reader(path) {
        return parse(&read_file(path)?, path.parent().unwrap_or(Path::new("")));
    }
    if let Some(Reader::Image(parse)) = formats::reader(path) {
        return parse(&read_file(path)?, &Arrays::default());
    }
    if path.is_file() {
        Err(formats::no_volume(path))
    } else {
        read_file(path).and(Err(formats::no_volume(path)))
    }
}

/// Reads plain samples; bytes after the last sample are ignored.
///
/// # Errors
/// One sentence: the wrong field of the description, or the error in the file of samples, with its
/// name.
pub fn read_raw(description: &RawDescription, folder: &Path) -> Result<Volume, String> {
    let layout = SampleLayout::new(
        description.size,
        description.sample_type,
        description.endian,
        "size",
    )?;
    positive(description.spacing, "spacing")?;
    let axes = diagonal(description.spacing);
    check_grid(&axes, "spacing", &description.origin, "origin")?;
    let bytes = read_beside(folder, &description.file, "file")?;
    let values =
        skip_bytes(&bytes, description.skip, "skip").and_then(|samples| layout.values(samples));
    let values = values.map_err(|e| in_data_file(&description.file, e))?;
    Ok(Volume {
        size: layout.size,
        axes,
        origin: description.origin,
        values,
        notes: vec![],
    })
}

/// The bytes after the first `skip`.
fn skip_bytes<'a>(bytes: &'a [u8], skip: u64, field: &str) -> Parsed<&'a [u8]> {
    let rest = usize::try_from(skip)
        .ok()
        .and_then(|skip| bytes.get(skip..));
    rest.ok_or_else(|| {
        format!(
            "`{field}` skips {} bytes, but there are only {}",
            clip(&skip.to_string()),
            bytes.len()
        )
    })
}

//! Formats: the one list of files that scenes are read from, by the end of their names.
//!
//! A format is added by its reader and a line here: what a scene may name, and what an error says can be read, follow from it.

use super::gaussians::{self, Gaussians};
use super::volume::{self, Volume};
use std::path::Path;

type Parsed<T> = Result<T, String>;

/// Reader of a file's bytes; the error is the second half of a sentence that begins with the file's name.
#[derive(Clone, Copy)]
pub(super) enum Reader {
    /// Points, or trained Gaussians where the header has their properties.
    Ply,
    Gaussians(fn(&[u8]) -> Parsed<Gaussians>),
    /// A header may name a second file, which lies in that folder.
    Volume(fn(&[u8], &Path) -> Parsed<Volume>),
}

const FORMATS: [(&str, Reader); 10] = [
    (".ply", Reader::Ply),
    (".splat", Reader::Gaussians(gaussians::splat::parse)),
    (".spz", Reader::Gaussians(gaussians::spz::parse)),
    (".nrrd", Reader::Volume(volume::nrrd::read)),
    (".nhdr", Reader::Volume(volume::nrrd::read)),
    (".mhd", Reader::Volume(volume::metaimage::read)),
    (".mha", Reader::Volume(volume::metaimage::read)),
    (".nii", Reader::Volume(|bytes, _| volume::nifti::read(bytes))),
    (".nii.gz", Reader::Volume(|bytes, _| volume::nifti::read(bytes))),
    (".vti", Reader::Volume(|bytes, _| volume::vti::read(bytes))),
];

/// Reader of a file by the end of its name, in either case of letters; none where it is of no format that is known.
pub(super) fn reader(path: &Path) -> Option<Reader> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    FORMATS.iter().find(|(end, _)| name.ends_with(end)).map(|(_, reader)| *reader)
}

/// Ends of the names of points, of Gaussians and of volumes, for a sentence.
pub(super) fn names() -> [String; 3] {
    let of = |is: fn(&Reader) -> bool| FORMATS.iter().filter(|(_, reader)| is(reader)).map(|(end, _)| *end).collect::<Vec<_>>().join(", ");
    [
        of(|reader| matches!(reader, Reader::Ply)),
        of(|reader| matches!(reader, Reader::Ply | Reader::Gaussians(_))),
        of(|reader| matches!(reader, Reader::Volume(_))),
    ]
}

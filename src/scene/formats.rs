//! Formats: the one list of files that scenes are read from, by the end of their names.
//!
//! A format is added by its reader and a line here: what a scene may name, and what an error says can be read, follow from it.

use super::gaussians::{self, Gaussians};
use super::ply::{self, Cloud};
use super::tree::{self, Tree};
use super::volume::{self, Arrays, Irregular, Volume};
use std::path::Path;

type Parsed<T> = Result<T, String>;

/// Contents of a file of splats.
pub(super) enum Splats {
    Points(Cloud),
    Gaussians(Gaussians),
    Tree(Tree),
}

/// Reader of a file's bytes; the error is the second half of a sentence that begins with the file's name.
#[derive(Clone, Copy)]
pub(super) enum Reader {
    Splats(fn(&[u8]) -> Parsed<Splats>),
    /// A header may name a second file, which lies in that folder.
    Volume(fn(&[u8], &Path) -> Parsed<Volume>),
    /// A regular grid of which a scene may ask for an array by name.
    Image(fn(&[u8], &Arrays) -> Parsed<Volume>),
    /// A scene may ask for arrays by name.
    Irregular(fn(&[u8], &Arrays) -> Parsed<Irregular>),
}

/// Contents that a format can have.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Points,
    Gaussians,
    Volume,
}

const FORMATS: &[(&str, &[Kind], Reader)] = &[
    (".ply", &[Kind::Points, Kind::Gaussians], Reader::Splats(points_or_gaussians)),
    (".tree", &[Kind::Points], Reader::Splats(|bytes| tree::file::parse(bytes).map(Splats::Tree))),
    (".splat", &[Kind::Gaussians], Reader::Splats(|bytes| gaussians::splat::parse(bytes).map(Splats::Gaussians))),
    (".spz", &[Kind::Gaussians], Reader::Splats(|bytes| gaussians::spz::parse(bytes).map(Splats::Gaussians))),
    (".nrrd", &[Kind::Volume], Reader::Volume(volume::nrrd::read)),
    (".nhdr", &[Kind::Volume], Reader::Volume(volume::nrrd::read)),
    (".mhd", &[Kind::Volume], Reader::Volume(volume::metaimage::read)),
    (".mha", &[Kind::Volume], Reader::Volume(volume::metaimage::read)),
    (".nii", &[Kind::Volume], Reader::Volume(|bytes, _| volume::nifti::read(bytes))),
    (".nii.gz", &[Kind::Volume], Reader::Volume(|bytes, _| volume::nifti::read(bytes))),
    (".vti", &[Kind::Volume], Reader::Image(volume::vti::read)),
    (".vtr", &[Kind::Volume], Reader::Irregular(volume::irregular::read_rectilinear)),
    (".vts", &[Kind::Volume], Reader::Irregular(volume::irregular::read_curvilinear)),
    (".vtu", &[Kind::Volume], Reader::Irregular(volume::irregular::read_unstructured)),
    (".vtp", &[Kind::Volume], Reader::Irregular(volume::irregular::read_poly_data)),
];

/// A PLY's header says which it has.
fn points_or_gaussians(bytes: &[u8]) -> Parsed<Splats> {
    if gaussians::is_trained_ply(bytes) {
        return gaussians::parse_ply(bytes).map(Splats::Gaussians);
    }
    ply::parse(bytes).map(Splats::Points)
}

/// Reader of a file by the end of its name, in either case of letters; none where it is of no format that is known.
pub(super) fn reader(path: &Path) -> Option<Reader> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    FORMATS.iter().find(|(end, ..)| name.ends_with(end)).map(|(.., reader)| *reader)
}

/// Reader of a file of splats of no known name: it may be a PLY all the same.
pub(super) fn default_reader() -> Reader {
    Reader::Splats(points_or_gaussians)
}

/// Ends of the names of points, of Gaussians and of volumes, for a sentence.
pub(super) fn names() -> [String; 3] {
    [Kind::Points, Kind::Gaussians, Kind::Volume].map(|kind| {
        let of_kind = FORMATS.iter().filter(|(_, kinds, _)| kinds.contains(&kind));
        of_kind.map(|(end, ..)| *end).collect::<Vec<_>>().join(", ")
    })
}

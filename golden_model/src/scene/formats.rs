//! Formats: lists the file formats of scenes and meshes, and detects the format of a file.
//!
//! ```text
//! first bytes ─► [Content::of] ─► format ──┬─► reader, if the context can use it
//! extension   ─► if bytes are ambiguous ───┘   else a sentence: the format, and a program that converts it
//! ```
//! The content decides: a file is read as the format of its first bytes, and a note reports a
//! contradicting name. A new format needs a reader, a line here and its first bytes; the list of
//! formats for scenes and for error messages follows.

use super::gaussians::{self, Gaussians};
use super::ply::{self, Cloud};
use super::tree::{self, Tree};
use super::volume::{self, Arrays, Irregular, Volume};
use flate2::read::GzDecoder;
use std::io::Read;
use std::path::Path;

type Parsed<T> = Result<T, String>;

/// Contents of a file of splats.
pub(super) enum Splats {
    Points(Cloud),
    Gaussians(Gaussians),
    Tree(Tree),
}

/// Reader of a file's bytes. The error is the second half of a sentence that begins with the file's
/// name.
#[derive(Clone, Copy)]
pub(super) enum Reader {
    /// The file may name others in this folder.
    Splats(fn(&[u8], &Path) -> Parsed<Splats>),
    /// A header may name a second file in this folder.
    Volume(fn(&[u8], &Path) -> Parsed<Volume>),
    /// A regular grid; the scene may select an array by name.
    Image(fn(&[u8], &Arrays) -> Parsed<Volume>),
    /// The scene may select arrays by name.
    Irregular(fn(&[u8], &Arrays) -> Parsed<Irregular>),
}

/// Kinds of content of a format.
#[derive(Clone, Copy, PartialEq, Eq)]
enum ContentKind {
    Points,
    Gaussians,
    Volume,
    Mesh,
}

/// Formats that are detected from bytes or from the extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Content {
    Ply,
    Tree,
    Splat,
    Spz,
    Gltf,
    Nrrd,
    MetaImage,
    Nifti,
    Vti,
    Vtr,
    Vts,
    Vtu,
    Vtp,
    Obj,
    Stl,
    /// A scene, or any other JSON.
    Json,
    Foreign(Foreign),
}

/// Formats that are not read, with free programs that convert them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Foreign {
    /// Gaussians as pictures in a ZIP, or in the format of a single viewer.
    Sog,
    Ksplat,
    /// Any other ZIP.
    Zip,
    Las,
    Pcd,
    E57,
    /// Points as lines of text.
    Lines,
    Vtk,
    Dicom,
    Nifti2,
    NiftiPair,
    Hdf5,
    /// Meshes of other programs.
    Mesh,
    Picture,
}

struct Format {
    content: Content,
    ends: &'static [&'static str],
    kinds: &'static [ContentKind],
    reader: Option<Reader>,
}

const fn format(
    content: Content,
    ends: &'static [&'static str],
    kinds: &'static [ContentKind],
    reader: Option<Reader>,
) -> Format {
    Format {
        content,
        ends,
        kinds,
        reader,
    }
}

const FORMATS: &[Format] = &[
    format(
        Content::Ply,
        &[".ply"],
        &[
            ContentKind::Points,
            ContentKind::Gaussians,
            ContentKind::Mesh,
        ],
        Some(Reader::Splats(|bytes, _| points_or_gaussians(bytes))),
    ),
    format(
        Content::Tree,
        &[".tree"],
        &[ContentKind::Points],
        Some(Reader::Splats(|bytes, _| {
            tree::file::parse(bytes).map(Splats::Tree)
        })),
    ),
    format(
        Content::Splat,
        &[".splat"],
        &[ContentKind::Gaussians],
        Some(Reader::Splats(|bytes, _| {
            gaussians::splat::parse(bytes).map(Splats::Gaussians)
        })),
    ),
    format(
        Content::Spz,
        &[".spz"],
        &[ContentKind::Gaussians],
        Some(Reader::Splats(|bytes, _| {
            gaussians::spz::parse(bytes).map(Splats::Gaussians)
        })),
    ),
    format(
        Content::Gltf,
        &[".gltf", ".glb"],
        &[ContentKind::Gaussians, ContentKind::Mesh],
        Some(Reader::Splats(|bytes, folder| {
            gaussians::gltf::parse(bytes, folder).map(Splats::Gaussians)
        })),
    ),
    format(
        Content::Nrrd,
        &[".nrrd", ".nhdr"],
        &[ContentKind::Volume],
        Some(Reader::Volume(volume::nrrd::read)),
    ),
    format(
        Content::MetaImage,
        &[".mhd", ".mha"],
        &[ContentKind::Volume],
        Some(Reader::Volume(volume::metaimage::read)),
    ),
    format(
        Content::Nifti,
        &[".nii", ".nii.gz"],
        &[ContentKind::Volume],
        Some(Reader::Volume(|bytes, _| volume::nifti::read(bytes))),
    ),
    format(
        Content::Vti,
        &[".vti"],
        &[ContentKind::Volume],
        Some(Reader::Image(volume::vti::read)),
    ),
    format(
        Content::Vtr,
        &[".vtr"],
        &[ContentKind::Volume],
        Some(Reader::Irregular(volume::irregular::read_rectilinear)),
    ),
    format(
        Content::Vts,
        &[".vts"],
        &[ContentKind::Volume],
        Some(Reader::Irregular(volume::irregular::read_curvilinear)),
    ),
    format(
        Content::Vtu,
        &[".vtu"],
        &[ContentKind::Volume],
        Some(Reader::Irregular(volume::irregular::read_unstructured)),
    ),
    format(
        Content::Vtp,
        &[".vtp"],
        &[ContentKind::Volume],
        Some(Reader::Irregular(volume::irregular::read_poly_data)),
    ),
    format(Content::Obj, &[".obj"], &[ContentKind::Mesh], None),
    format(Content::Stl, &[".stl"], &[ContentKind::Mesh], None),
    format(Content::Json, &[".json"], &[], None),
    format(Content::Foreign(Foreign::Sog), &[".sog"], &[], None),
    format(
        Content::Foreign(Foreign::Ksplat),
        &[".ksplat", ".lcc"],
        &[],
        None,
    ),
    format(Content::Foreign(Foreign::Zip), &[".zip"], &[], None),
    format(Content::Foreign(Foreign::Las), &[".las", ".laz"], &[], None),
    format(Content::Foreign(Foreign::Pcd), &[".pcd"], &[], None),
    format(Content::Foreign(Foreign::E57), &[".e57"], &[], None),
    format(
        Content::Foreign(Foreign::Lines),
        &[".xyz", ".pts", ".ptx", ".asc", ".csv", ".txt"],
        &[],
        None,
    ),
    format(Content::Foreign(Foreign::Vtk), &[".vtk"], &[], None),
    format(Content::Foreign(Foreign::Dicom), &[".dcm"], &[], None),
    format(
        Content::Foreign(Foreign::NiftiPair),
        &[".hdr", ".img"],
        &[],
        None,
    ),
    format(
        Content::Foreign(Foreign::Hdf5),
        &[".h5", ".hdf5"],
        &[],
        None,
    ),
    format(
        Content::Foreign(Foreign::Mesh),
        &[
            ".off", ".fbx", ".dae", ".3ds", ".3mf", ".blend", ".usd", ".usdz", ".usdc",
        ],
        &[],
        None,
    ),
    format(
        Content::Foreign(Foreign::Picture),
        &[".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff"],
        &[],
        None,
    ),
];

/// The header of a PLY file determines which of them it has.
fn points_or_gaussians(bytes: &[u8]) -> Parsed<Splats> {
    if gaussians::is_trained_ply(bytes) {
        return gaussians::parse_ply(bytes).map(Splats::Gaussians);
    }
    ply::parse(bytes).map(Splats::Points)
}

/// Bytes of a file that are used for detection.
const HEAD: u64 = 1 << 16;
/// Bytes used after unpacking gzip.
const UNPACKED_HEAD: u64 = 1024;

impl Content {
    /// The format by a file's bytes, or else by its extension in either case.
    fn of_file(path: &Path) -> Option<Content> {
        Content::by_bytes(path).or_else(|| Content::by_name(path))
    }

    fn by_name(path: &Path) -> Option<Content> {
        let name = path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .to_lowercase();
        FORMATS
            .iter()
            .find(|format| format.ends.iter().any(|end| name.ends_with(end)))
            .map(|format| format.content)
    }

    fn by_bytes(path: &Path) -> Option<Content> {
        // Files that are not regular may never end, or block.
        let metadata = std::fs::metadata(path)
            .ok()
            .filter(std::fs::Metadata::is_file)?;
        let mut head = Vec::new();
        crate::input::open(path)
            .ok()?
            .take(HEAD)
            .read_to_end(&mut head)
            .ok()?;
        Content::of(&head, metadata.len())
    }

    /// The format by the first bytes of a file of this length; None if they are ambiguous.
    pub(super) fn of(head: &[u8], length: u64) -> Option<Content> {
        if head.starts_with(&[0x1f, 0x8b]) {
            let mut inside = Vec::new();
            // A head that ends inside a gzip block still gives the bytes before it.
            let _ = GzDecoder::new(head)
                .take(UNPACKED_HEAD)
                .read_to_end(&mut inside);
            return Content::of_magic(&inside).filter(|content| {
                matches!(
                    content,
                    Content::Spz | Content::Nifti | Content::Foreign(Foreign::Nifti2)
                )
            });
        }
        Content::of_magic(head)
            .or_else(|| Content::of_binary_stl(head, length))
            .or_else(|| Content::of_text(head))
    }

    fn of_magic(head: &[u8]) -> Option<Content> {
        let at = |place: usize, magic: &[u8]| {
            head.get(place..)
                .is_some_and(|rest| rest.starts_with(magic))
        };
        let starts = |magic: &str| head.starts_with(magic.as_bytes());
        let is_ply = starts("ply") && head.get(3).is_some_and(|byte| byte.is_ascii_whitespace());
        Some(match () {
            () if is_ply => Content::Ply,
            () if starts("splatsim-tree-") => Content::Tree,
            () if starts("NGSP") => Content::Spz,
            () if starts("glTF") => Content::Gltf,
            () if starts("NRRD00") => Content::Nrrd,
            () if at(344, b"n+1\0") => Content::Nifti,
            () if at(4, b"n+2\0") || at(4, b"ni2\0") => Content::Foreign(Foreign::Nifti2),
            () if at(344, b"ni1\0") => Content::Foreign(Foreign::NiftiPair),
            () if starts("PK\u{3}\u{4}") => Content::Foreign(Foreign::Zip),
            () if starts("LASF") => Content::Foreign(Foreign::Las),
            () if starts("ASTM-E57") => Content::Foreign(Foreign::E57),
            () if starts("# .PCD") => Content::Foreign(Foreign::Pcd),
            () if starts("# vtk DataFile") => Content::Foreign(Foreign::Vtk),
            () if at(128, b"DICM") => Content::Foreign(Foreign::Dicom),
            () if at(0, b"\x89HDF\r\n") => Content::Foreign(Foreign::Hdf5),
            () if starts("Kaydara FBX") || starts("BLENDER") => Content::Foreign(Foreign::Mesh),
            () if at(0, b"\x89PNG\r\n")
                || at(0, b"\xff\xd8\xff")
                || at(0, b"RIFF") && at(8, b"WEBP") =>
            {
                Content::Foreign(Foreign::Picture)
            }
            () => return None,
        })
    }

    /// Binary STL has no magic number, but its length must fit its number of triangles.
    fn of_binary_stl(head: &[u8], length: u64) -> Option<Content> {
        let count = u32::from_le_bytes(*head.get(80..84)?.first_chunk()?);
        (count > 0 && length == 84 + 50 * u64::from(count)).then_some(Content::Stl)
    }

    /// Formats of text: keywords in either case, with blanks before them.
    fn of_text(head: &[u8]) -> Option<Content> {
        // Samples after a header need not be text, so only the beginning is checked.
        let text = String::from_utf8_lossy(head);
        let text = text.trim_start_matches('\u{feff}').trim_start();
        let lower = text
            .get(..text.floor_char_boundary(4096))
            .unwrap_or_default()
            .to_ascii_lowercase();
        let is_word = |word: &str| {
            lower.starts_with(word)
                && !lower[word.len()..].starts_with(|c: char| c.is_ascii_alphanumeric())
        };
        if lower.starts_with('{') {
            // In a long file both may come late: then its name decides.
            let has = |key: &str| text.contains(&format!("\"{key}\""));
            return if has("asset") {
                Some(Content::Gltf)
            } else {
                has("splats").then_some(Content::Json)
            };
        }
        if lower.starts_with('<') {
            let tag = &lower[lower.find("<vtkfile")?..];
            let tag = &tag[..tag.find('>').unwrap_or(tag.len())];
            let kinds = [
                ("imagedata", Content::Vti),
                ("rectilineargrid", Content::Vtr),
                ("structuredgrid", Content::Vts),
            ];
            let kinds = kinds.into_iter().chain([
                ("unstructuredgrid", Content::Vtu),
                ("polydata", Content::Vtp),
            ]);
            let value = tag
                .split_ascii_whitespace()
                .find_map(|word| word.strip_prefix("type="))?
                .trim_start_matches(['"', '\'']);
            return kinds
                .into_iter()
                .find(|(name, _)| value.starts_with(name))
                .map(|(_, content)| content);
        }
        if is_word("solid") && (lower.contains("facet") || lower.contains("endsolid")) {
            return Some(Content::Stl);
        }
        if ["objecttype", "ndims"].iter().any(|key| is_word(key))
            && lower.lines().next().is_some_and(|line| line.contains('='))
        {
            return Some(Content::MetaImage);
        }
        if is_word("off") || is_word("coff") || is_word("noff") {
            return Some(Content::Foreign(Foreign::Mesh));
        }
        is_obj(&lower).then_some(Content::Obj)
    }

    /// Name of the format with its article.
    fn name(self) -> &'static str {
        match self {
            Content::Ply => "a PLY file",
            Content::Tree => "a tree of splats",
            Content::Splat => "a .splat file",
            Content::Spz => "an .spz file",
            Content::Gltf => "a glTF file",
            Content::Nrrd => "an NRRD file",
            Content::MetaImage => "a MetaImage file",
            Content::Nifti => "a NIfTI-1 file",
            Content::Vti => "a VTI file",
            Content::Vtr => "a VTR file",
            Content::Vts => "a VTS file",
            Content::Vtu => "a VTU file",
            Content::Vtp => "a VTP file",
            Content::Obj => "an OBJ file",
            Content::Stl => "an STL file",
            Content::Json => "a JSON file",
            Content::Foreign(foreign) => foreign.name(),
        }
    }

    fn format(self) -> Option<&'static Format> {
        FORMATS.iter().find(|format| format.content == self)
    }
}

impl Foreign {
    fn name(self) -> &'static str {
        match self {
            Foreign::Sog => "a .sog file",
            Foreign::Ksplat => "a .ksplat or .lcc file",
            Foreign::Zip => "a ZIP archive",
            Foreign::Las => "a LAS or LAZ file",
            Foreign::Pcd => "a PCD file",
            Foreign::E57 => "an E57 file",
            Foreign::Lines => "a table of points in text",
            Foreign::Vtk => "a legacy VTK file",
            Foreign::Dicom => "a DICOM file",
            Foreign::Nifti2 => "a NIfTI-2 file",
            Foreign::NiftiPair => "half of a pair of .hdr and .img",
            Foreign::Hdf5 => "an HDF5 file",
            Foreign::Mesh => "a mesh of another program",
            Foreign::Picture => "a picture",
        }
    }

    /// A free program that converts it to a format that is read.
    fn advice(self) -> &'static str {
        match self {
            Foreign::Sog | Foreign::Ksplat => "splat-transform writes it as .ply",
            Foreign::Zip => "unpack it; splat-transform converts .sog to .ply",
            Foreign::Las => {
                "PDAL (`pdal translate IN OUT.ply`) writes it as .ply, las2txt of LAStools as text"
            }
            Foreign::Pcd => "pcl_pcd2ply of PCL, or CloudCompare, writes it as .ply",
            Foreign::E57 | Foreign::Lines => "CloudCompare writes it as .ply",
            Foreign::Vtk => "ParaView writes it as .vti, .vtr, .vts, .vtu or .vtp",
            Foreign::Dicom => "dcm2niix writes it as .nii",
            Foreign::Nifti2 => "nibabel writes it as NIfTI-1",
            Foreign::NiftiPair => "a NIfTI-1 volume must be a single .nii or .nii.gz",
            Foreign::Hdf5 => "h5py and nibabel write its arrays as .nii",
            Foreign::Mesh => {
                "MeshLab or Blender writes it as .ply, .obj or .glb, from which `splatsim sample` makes points"
            }
            Foreign::Picture => "a picture is not a scene",
        }
    }
}

/// Whether lines of text are an OBJ file, by their first words; at least one line must be a vertex
/// of three numbers or more.
fn is_obj(lower: &str) -> bool {
    const WORDS: [&str; 20] = [
        "v", "vt", "vn", "vp", "f", "fo", "l", "p", "o", "g", "s", "mg", "usemtl", "mtllib",
        "usemap", "maplib", "lod", "cstype", "deg", "end",
    ];
    let mut has_vertex = false;
    // The last line may be incomplete.
    for line in lower.lines().take(200) {
        let mut words = line.split_ascii_whitespace();
        let Some(word) = words.next().filter(|word| !word.starts_with('#')) else {
            continue;
        };
        if !WORDS.contains(&word) {
            return false;
        }
        if word == "v" {
            let numbers = words.take_while(|word| word.parse::<f64>().is_ok()).count();
            has_vertex |= numbers >= 3;
        }
    }
    has_vertex
}

/// The reader of a file, by its content, or by its extension if the content is ambiguous; None if
/// its format cannot be drawn.
pub(super) fn reader(path: &Path) -> Option<Reader> {
    Content::of_file(path).and_then(Content::format)?.reader
}

/// The format of a mesh, by its bytes, or by the file's extension if they are ambiguous.
pub(super) fn mesh(bytes: &[u8], path: &Path) -> Option<Content> {
    let head = &bytes[..bytes.len().min(HEAD as usize)];
    Content::of(head, bytes.len() as u64).or_else(|| Content::by_name(path))
}

/// Whether a file has a scene, or other JSON, independent of its name.
pub(super) fn is_json(path: &Path) -> bool {
    Content::of_file(path) == Some(Content::Json)
}

/// A note if the content of a file contradicts its name.
pub(super) fn contradiction(path: &Path) -> Option<String> {
    let named = Content::by_name(path)?;
    let held = Content::by_bytes(path)?;
    (named != held).then(|| {
        format!(
            "is {} by its content, and {} by its name; the content was read",
            held.name(),
            named.name()
        )
    })
}

/// Why a file cannot be read as splats: the second half of a sentence that begins with the file's
/// name.
pub(super) fn no_splats(path: &Path) -> String {
    let [points, gaussians, volumes, _] = names();
    let read = format!(
        "a scene is a .json file, points ({points}), Gaussians ({gaussians}), a volume ({volumes}) or a built-in name"
    );
    refusal(Content::of_file(path), path, "holds no splats", &read)
}

/// Why a file cannot be read as a volume: the second half of a sentence that begins with the file's
/// name.
pub(super) fn no_volume(path: &Path) -> String {
    let [.., volumes, _] = names();
    refusal(
        Content::of_file(path),
        path,
        "holds no volume",
        &format!("{volumes} are read"),
    )
}

/// Why a file cannot be read as a mesh: the second half of a sentence that begins with the file's
/// name.
pub(super) fn no_mesh(content: Option<Content>, path: &Path) -> String {
    let [.., meshes] = names();
    refusal(
        content,
        path,
        "holds no triangles",
        &format!("a mesh is one of {meshes}, or `plane`"),
    )
}

fn refusal(content: Option<Content>, path: &Path, why: &str, read: &str) -> String {
    let named = Content::by_name(path);
    match content {
        None => format!("is of no known kind; {read}"),
        Some(Content::Foreign(foreign)) => {
            // The name distinguishes kinds of ZIP.
            let foreign = if named == Some(Content::Foreign(Foreign::Sog)) {
                Foreign::Sog
            } else {
                foreign
            };
            format!(
                "is {}, which is not read; {}; {read}",
                foreign.name(),
                foreign.advice()
            )
        }
        Some(content) => {
            let by = if named.is_some_and(|named| named != content) {
                " by its content"
            } else {
                ""
            };
            let is_mesh = content
                .format()
                .is_some_and(|format| format.kinds == [ContentKind::Mesh]);
            let why = if is_mesh {
                "is a mesh; `splatsim sample` makes points from it"
            } else {
                why
            };
            format!("is {}{by}, which {why}; {read}", content.name())
        }
    }
}

/// Extensions of points, of Gaussians, of volumes and of meshes, for a sentence.
pub(super) fn names() -> [String; 4] {
    [
        ContentKind::Points,
        ContentKind::Gaussians,
        ContentKind::Volume,
        ContentKind::Mesh,
    ]
    .map(|kind| {
        let of_kind = FORMATS.iter().filter(|format| format.kinds.contains(&kind));
        of_kind
            .flat_map(|format| format.ends)
            .copied()
            .collect::<Vec<_>>()
            .join(", ")
    })
}

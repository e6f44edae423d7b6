//! Matching: which picture of a folder belongs to which camera: by the names in a file of cameras,
//! otherwise by order.

use crate::error::{Error, Result};
use crate::output::text::{clipped, listed, one_line};
use crate::scene::Sequence;
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// File extensions of pictures that can be read.
const READ: [&str; 3] = ["png", "jpg", "jpeg"];
/// Further extensions of pictures in files of cameras: the compared picture may have another
/// format.
const KNOWN: [&str; 8] = ["tif", "tiff", "bmp", "webp", "gif", "ppm", "exr", "heic"];

/// A picture for each frame.
pub(super) struct MatchedFiles {
    /// None for a frame that is not drawn.
    pub files: Vec<Option<PathBuf>>,
    pub notes: Vec<String>,
}

/// Pictures of folders, in order; each folder is listed once.
struct Folders {
    whose: String,
    listed: BTreeMap<PathBuf, Vec<String>>,
}

/// Matches a picture, or those of a folder, with all frames or with the `only` one.
///
/// # Errors
/// [`Error::Input`] if a frame has no picture, or the match is ambiguous.
pub(super) fn matched(
    path: &Path,
    sequence: &Sequence,
    only: Option<usize>,
) -> Result<MatchedFiles> {
    let whose = format!("--against {}", path.display());
    let input_error = |what: String| Error::input(format!("{whose}: {what}"));
    let names = sequence.pictures();
    let frames = names.len();
    if !path.is_dir() {
        let frame = match (only, frames) {
            (Some(frame), _) => frame,
            (None, 1) => 0,
            (None, _) => {
                return Err(input_error(format!(
                    "is one picture, and {} has {frames} frames: give a folder of pictures, or choose a frame with --frame N",
                    sequence.scene().name
                )));
            }
        };
        let mut files = vec![None; frames];
        files[frame] = Some(path.to_owned());
        let own = path.file_name().unwrap_or_default().to_string_lossy();
        let other = names[frame].filter(|name| {
            parts(name)
                .last()
                .is_some_and(|last| bare(last) != bare(&own))
        });
        let notes = other.map(|name| {
            format!(
                "photographs: {} is compared; the camera's own is {}",
                one_line(&own),
                clipped(name)
            )
        });
        return Ok(MatchedFiles {
            files,
            notes: notes.into_iter().collect(),
        });
    }
    let mut folders = Folders {
        whose: whose.clone(),
        listed: BTreeMap::new(),
    };
    let all = folders.pictures(path)?.to_vec();
    let unnamed = names.iter().filter(|name| name.is_none()).count();
    if unnamed == 0 {
        return by_name(path, &names, only, &mut folders);
    }
    if all.is_empty() {
        return Err(input_error(format!(
            "holds no picture; one per frame is needed, with the ending {}",
            endings()
        )));
    }
    if frames == 1 && all.len() > 1 {
        let what = format!(
            "holds {} pictures, and {} has one camera: name the picture",
            all.len(),
            sequence.scene().name
        );
        return Err(input_error(what));
    }
    if all.len() < frames {
        let what = format!(
            "holds {} pictures, and {} has {frames} frames: one per frame is needed",
            all.len(),
            sequence.scene().name
        );
        return Err(input_error(what));
    }
    let of_frame = |frame: usize| {
        only.is_none_or(|only| only == frame)
            .then(|| path.join(&all[frame]))
    };
    let mut notes = Vec::new();
    let (first, last) = (only.unwrap_or(0), only.unwrap_or(frames - 1));
    if frames > 1 {
        let why = if unnamed == frames {
            "the cameras have no names".into()
        } else {
            format!("{unnamed} of {frames} cameras have no name")
        };
        let [one, other] =
            [first, last].map(|frame| format!("frame {frame} is {}", one_line(&all[frame])));
        let example = if first == last {
            one
        } else {
            format!("{one}, {other}")
        };
        notes.push(format!(
            "photographs: matched in order of their names, for {why}: {example}"
        ));
    }
    notes.extend(left_over(&all[frames..]));
    Ok(MatchedFiles {
        files: (0..frames).map(of_frame).collect(),
        notes,
    })
}

fn by_name(
    path: &Path,
    names: &[Option<&str>],
    only: Option<usize>,
    folders: &mut Folders,
) -> Result<MatchedFiles> {
    let mut files = vec![None; names.len()];
    let mut absent = Vec::new();
    for (frame, name) in names
        .iter()
        .enumerate()
        .filter(|(frame, _)| only.is_none_or(|only| only == *frame))
    {
        let Some(name) = name else { continue };
        match folders.find(path, name)? {
            Some(file) => files[frame] = Some(file),
            None => absent.push((frame, *name)),
        }
    }
    let wanted = only.map_or(names.len(), |_| 1);
    if let Some((frame, name)) = absent.first() {
        let stem = parts(name)
            .last()
            .map_or_else(String::new, |last| clipped(bare(last)));
        let count = if absent.len() > 1 {
            format!("; {} of {wanted} frames have none", absent.len())
        } else {
            String::new()
        };
        let [png, jpg, jpeg] = READ.map(|ending| format!("{stem}.{ending}"));
        return Err(Error::input(format!(
            "{}: holds no picture of frame {frame}, which the file of cameras names {}: {png}, {jpg} or {jpeg} is needed{count}",
            folders.whose,
            clipped(name)
        )));
    }
    let mut frame_of: BTreeMap<&Path, usize> = BTreeMap::new();
    for (frame, file) in files.iter().enumerate() {
        let Some(file) = file else { continue };
        if let Some(before) = frame_of.insert(file, frame) {
            let [one, other] =
                [before, frame].map(|frame| clipped(names[frame].unwrap_or_default()));
            return Err(Error::input(format!(
                "{}: frames {before} ({one}) and {frame} ({other}) both lead to {}: each needs a picture of its own, in folders as the file of \
                 cameras has them",
                folders.whose,
                file.display()
            )));
        }
    }
    let mut notes = Vec::new();
    if only.is_none() {
        notes.push("photographs: matched by the names in the file of cameras".to_owned());
        let used: BTreeSet<&Path> = frame_of.into_keys().collect();
        let in_use: BTreeSet<&Path> = used.iter().filter_map(|file| file.parent()).collect();
        let of_folder = |folder: &Path| {
            let all = folders.listed.get(folder).into_iter().flatten();
            all.filter(|name| !used.contains(&*folder.join(name)))
                .cloned()
                .collect::<Vec<_>>()
        };
        let rest: Vec<String> = in_use.into_iter().flat_map(of_folder).collect();
        notes.extend(left_over(&rest));
    }
    Ok(MatchedFiles { files, notes })
}

fn left_over(rest: &[String]) -> Option<String> {
    let names: Vec<String> = rest.iter().map(|name| one_line(name)).collect();
    match names.len() {
        0 => None,
        1 => Some(format!(
            "photographs: one picture has no camera: {}",
            names[0]
        )),
        many => Some(format!(
            "photographs: {many} pictures have no camera: {}",
            listed(&names)
        )),
    }
}

fn endings() -> String {
    let [png, jpg, jpeg] = READ;
    format!("{png}, {jpg} or {jpeg}")
}

impl Folders {
    /// Pictures in a folder, in order, without hidden files.
    fn pictures(&mut self, folder: &Path) -> Result<&[String]> {
        if !self.listed.contains_key(folder) {
            let cannot = |error: std::io::Error| {
                Error::input(format!(
                    "{}: {} cannot be read: {error}",
                    self.whose,
                    folder.display()
                ))
            };
            let mut names = Vec::new();
            for entry in std::fs::read_dir(folder).map_err(cannot)? {
                let entry = entry.map_err(cannot)?;
                let Ok(name) = entry.file_name().into_string() else {
                    continue;
                };
                let is_picture = ending(&name)
                    .is_some_and(|ending| READ.contains(&&*ending.to_ascii_lowercase()));
                if is_picture && !name.starts_with('.') && entry.path().is_file() {
                    names.push(name);
                }
            }
            names.sort_by(|a, b| in_order(a, b));
            self.listed.insert(folder.to_owned(), names);
        }
        Ok(&self.listed[folder])
    }

    /// The picture that a file of cameras names. Its folders are used as far as they exist; its
    /// name is matched without extension if the file itself is absent.
    fn find(&mut self, root: &Path, name: &str) -> Result<Option<PathBuf>> {
        let parts = parts(name);
        let Some((last, above)) = parts.split_last() else {
            return Ok(None);
        };
        for first in 0..=above.len() {
            let folder = above[first..]
                .iter()
                .fold(root.to_owned(), |folder, part| folder.join(part));
            if !folder.is_dir() {
                continue;
            }
            let whose = self.whose.clone();
            let all = self.pictures(&folder)?;
            if all.iter().any(|name| name == last) {
                return Ok(Some(folder.join(last)));
            }
            match all
                .iter()
                .filter(|name| bare(name) == bare(last))
                .collect::<Vec<_>>()
                .as_slice()
            {
                [] => {}
                [one] => return Ok(Some(folder.join(one))),
                [one, other, ..] => {
                    let (one, other, name) = (one_line(one), one_line(other), clipped(name));
                    return Err(Error::input(format!(
                        "{whose}: {one} and {other} may both be the picture that the file of cameras names {name}: only one may be there"
                    )));
                }
            }
        }
        Ok(None)
    }
}

/// Folders and file of a path in the notation of any system, after its last `..`.
fn parts(path: &str) -> Vec<&str> {
    let behind = path
        .split(['/', '\\'])
        .rev()
        .take_while(|part| *part != "..");
    let mut parts: Vec<&str> = behind
        .filter(|part| !part.is_empty() && *part != "." && !part.ends_with(':'))
        .collect();
    parts.reverse();
    parts
}

fn ending(name: &str) -> Option<&str> {
    name.rsplit_once('.').map(|(_, ending)| ending)
}

/// A name without the extension of a picture; other dots belong to the name.
fn bare(name: &str) -> &str {
    match name.rsplit_once('.') {
        Some((stem, ending))
            if READ
                .iter()
                .chain(&KNOWN)
                .any(|known| ending.eq_ignore_ascii_case(known)) =>
        {
            stem
        }
        _ => name,
    }
}

/// Compares names letter by letter, and numbers in them by value: 9 before 10.
fn in_order(a: &str, b: &str) -> Ordering {
    let pieces = |text: &str| -> Vec<String> {
        let mut pieces: Vec<String> = Vec::new();
        for letter in text.chars() {
            match pieces.last_mut().filter(|piece| {
                piece.ends_with(|last: char| last.is_ascii_digit()) == letter.is_ascii_digit()
            }) {
                Some(piece) => piece.push(letter),
                None => pieces.push(letter.into()),
            }
        }
        pieces
    };
    let (of_a, of_b) = (pieces(a), pieces(b));
    let mut compared = of_a.iter().zip(&of_b).map(|(a, b)| {
        let is_number = |piece: &str| piece.starts_with(|first: char| first.is_ascii_digit());
        if !is_number(a) || !is_number(b) {
            return a.cmp(b);
        }
        let [a, b] = [a, b].map(|number| number.trim_start_matches('0'));
        a.len().cmp(&b.len()).then_with(|| a.cmp(b))
    });
    let first = compared
        .find(|order| order.is_ne())
        .unwrap_or(Ordering::Equal);
    first
        .then_with(|| of_a.len().cmp(&of_b.len()))
        .then_with(|| a.cmp(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_are_ordered_by_their_values() {
        let mut names = [
            "r_10.png",
            "r_9.png",
            "r_1.png",
            "r_01.png",
            "r.png",
            "a2b",
            "a2",
            "a10",
            "r_1_2.png",
        ];
        names.sort_by(|a, b| in_order(a, b));
        assert_eq!(
            names,
            [
                "a2",
                "a2b",
                "a10",
                "r.png",
                "r_01.png",
                "r_1.png",
                "r_1_2.png",
                "r_9.png",
                "r_10.png"
            ]
        );
    }

    #[test]
    fn a_path_of_any_system_has_parts() {
        assert_eq!(parts("./train/r_0"), ["train", "r_0"]);
        assert_eq!(parts("../../images//a.png"), ["images", "a.png"]);
        assert_eq!(parts(r"C:\data\cam0\a.png"), ["data", "cam0", "a.png"]);
        assert!(parts("..").is_empty() && parts("").is_empty());
        assert_eq!(
            (
                bare("a.b.PNG"),
                bare("DSC.0001"),
                bare("a.tiff"),
                bare("plain")
            ),
            ("a.b", "DSC.0001", "a", "plain")
        );
    }
}

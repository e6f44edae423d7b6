//! Colmap: reads COLMAP's cameras and images, as text or binary; world → camera, x right, y down, z
//! forward. Sorted by the pictures' names. Points are not needed.

use super::{Intrinsics, LONGEST_SIDE, Lens, Parsed, Pose, check_position, named};
use crate::error::{Error, Result};
use crate::input;
use crate::output::text::clipped;
use glam::{DQuat, DVec3};
use std::collections::BTreeMap;
use std::path::Path;

/// Lens models with their numbers of parameters, in the order of their codes in binary files.
const MODELS: [(&str, usize); 12] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
    ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
];

/// Intrinsics by camera id.
type Lenses = BTreeMap<u32, Intrinsics>;
/// A line or a record, and what is wrong with it.
type Wrong = (String, String);

fn lens(model: &str, numbers: &[f64], size: [u32; 2]) -> Parsed<Intrinsics> {
    let (focal, centre, distortion): ([f64; 2], [f64; 2], &[f64]) = match (model, numbers) {
        ("SIMPLE_PINHOLE", &[f, cx, cy]) => ([f; 2], [cx, cy], &[]),
        ("PINHOLE", &[fx, fy, cx, cy]) => ([fx, fy], [cx, cy], &[]),
        ("SIMPLE_RADIAL", &[f, cx, cy, ref distortion @ ..]) if distortion.len() == 1 => {
            ([f; 2], [cx, cy], distortion)
        }
        ("RADIAL", &[f, cx, cy, ref distortion @ ..]) if distortion.len() == 2 => {
            ([f; 2], [cx, cy], distortion)
        }
        ("OPENCV", &[fx, fy, cx, cy, ref distortion @ ..]) if distortion.len() == 4 => {
            ([fx, fy], [cx, cy], distortion)
        }
        ("FULL_OPENCV", &[fx, fy, cx, cy, ref distortion @ ..]) if distortion.len() == 8 => {
            ([fx, fy], [cx, cy], distortion)
        }
        (
            "SIMPLE_PINHOLE" | "PINHOLE" | "SIMPLE_RADIAL" | "RADIAL" | "OPENCV" | "FULL_OPENCV",
            _,
        ) => {
            return Err(format!(
                "{model} has {} numbers, which are not as many as it needs",
                numbers.len()
            ));
        }
        _ => {
            return Err(format!(
                "the model {} cannot be drawn; use PINHOLE, with undistorted pictures",
                clipped(model)
            ));
        }
    };
    if let Some(amount) = distortion.iter().find(|amount| **amount != 0.0) {
        return Err(format!(
            "a lens that distorts cannot be drawn ({amount}); `colmap image_undistorter` makes pictures and cameras without distortion"
        ));
    }
    Intrinsics::new(size, focal, centre.map(Some))
}

/// A picture's name and camera; `turn` is the quaternion w, x, y, z.
fn pose(turn: [f64; 4], shift: [f64; 3], lens: u32, known: &Lenses, lenses: &str) -> Parsed<Pose> {
    let intrinsics = known
        .get(&lens)
        .ok_or(format!("its camera {lens} is not in {lenses}"))?;
    let [w, x, y, z] = turn;
    let turn = DQuat::from_xyzw(x, y, z, w);
    let length = turn.length();
    if !(length > 1e-100 && length.is_finite()) {
        return Err("its quaternion is zero or too large; it must turn".into());
    }
    // World → camera: the eye maps to 0.
    let back = (turn / length).conjugate();
    let eye = back * -DVec3::from_array(shift);
    check_position(eye)?;
    let (forward, up) = (back * DVec3::Z, back * DVec3::NEG_Y);
    Ok(Pose {
        picture: None,
        eye,
        forward,
        up,
        lens: Lens::Known(*intrinsics),
    })
}

fn in_order(mut poses: Vec<(String, Pose)>) -> Vec<Pose> {
    poses.sort_by(|(a, _), (b, _)| a.cmp(b));
    poses
        .into_iter()
        .map(|(name, pose)| Pose {
            picture: Some(name),
            ..pose
        })
        .collect()
}

fn wrong(path: &Path) -> impl Fn(Wrong) -> Error {
    let name = named(path);
    move |(place, sentence)| Error::input(format!("{name}: {place}: {sentence}"))
}

fn unreadable(path: &Path) -> impl Fn(std::io::Error) -> Error {
    let name = named(path);
    move |e| Error::input(format!("{name}: cannot be read: {e}"))
}

// ---- text ----

/// `cameras.txt` and `images.txt` in a folder; also returns the name of the second for messages.
pub(super) fn read_text(folder: &Path) -> Result<(String, Vec<Pose>)> {
    let [lenses, images] = ["cameras.txt", "images.txt"].map(|file| folder.join(file));
    let text = input::read_text(&lenses).map_err(unreadable(&lenses))?;
    let known = text_lenses(&text).map_err(wrong(&lenses))?;
    let text = input::read_text(&images).map_err(unreadable(&images))?;
    let poses = text_poses(&text, &known).map_err(wrong(&images))?;
    Ok((named(&images), in_order(poses)))
}

/// Lines without comments and blank lines, each with its number.
fn lines(text: &str) -> impl Iterator<Item = (String, &str)> {
    let text = text.trim_start_matches('\u{feff}');
    let lines = text
        .lines()
        .enumerate()
        .map(|(i, line)| (i + 1, line.trim()));
    lines
        .filter(|(_, line)| !line.starts_with('#'))
        .map(|(number, line)| (format!("line {number}"), line))
}

fn finite(word: &str) -> Parsed<f64> {
    word.parse()
        .ok()
        .filter(|number: &f64| number.is_finite())
        .ok_or(format!("`{}` is not a finite number", clipped(word)))
}

fn identity(word: &str) -> Parsed<u32> {
    word.parse().map_err(|_| {
        format!(
            "`{}` is not an identity; a whole number from 0 to {} is right",
            clipped(word),
            u32::MAX
        )
    })
}

fn text_lenses(text: &str) -> std::result::Result<Lenses, Wrong> {
    let mut known = Lenses::new();
    for (place, line) in lines(text).filter(|(_, line)| !line.is_empty()) {
        let (id, lens) = text_lens(line).map_err(|sentence| (place.clone(), sentence))?;
        if known.insert(id, lens).is_some() {
            return Err((place, format!("camera {id} is defined twice")));
        }
    }
    Ok(known)
}

/// `CAMERA_ID MODEL WIDTH HEIGHT PARAMS…`
fn text_lens(line: &str) -> Parsed<(u32, Intrinsics)> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [id, model, width, height, parameters @ ..] = words.as_slice() else {
        return Err(
            "a camera is an identity, a model, width, height and the model's numbers".into(),
        );
    };
    let numbers: Vec<f64> = parameters
        .iter()
        .map(|word| finite(word))
        .collect::<Parsed<_>>()?;
    let side = |word: &str| {
        let side = word
            .parse()
            .ok()
            .filter(|side| (1..=LONGEST_SIDE).contains(side));
        side.ok_or(format!(
            "`{}` is not a width or height; a whole number of pixels from 1 to 10⁶ is right",
            clipped(word)
        ))
    };
    let size = [side(width)?, side(height)?];
    Ok((identity(id)?, lens(model, &numbers, size)?))
}

/// Whether a line has a picture's points, three numbers each, or none.
fn is_of_points(line: &str) -> bool {
    let count = line
        .split_whitespace()
        .try_fold(0_usize, |count, word| finite(word).ok().map(|_| count + 1));
    count.is_some_and(|count| count.is_multiple_of(3))
}

/// `IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME`, followed by a line of the picture's points,
/// which may be missing.
fn text_poses(text: &str, known: &Lenses) -> std::result::Result<Vec<(String, Pose)>, Wrong> {
    let mut poses = Vec::new();
    let mut lines = lines(text).peekable();
    while let Some((place, line)) = lines.next() {
        if line.is_empty() {
            continue;
        }
        poses.push(text_pose(line, known).map_err(|sentence| (place, sentence))?);
        lines.next_if(|(_, points)| is_of_points(points));
    }
    Ok(poses)
}

fn text_pose(line: &str, known: &Lenses) -> Parsed<(String, Pose)> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [_, qw, qx, qy, qz, tx, ty, tz, lens, _, ..] = words.as_slice() else {
        return Err("a picture is an identity, a quaternion, a translation, a camera and a name; a line of its points may follow, three \
                    numbers each"
            .into());
    };
    let [w, x, y, z] = [finite(qw)?, finite(qx)?, finite(qy)?, finite(qz)?];
    let pose = pose(
        [w, x, y, z],
        [finite(tx)?, finite(ty)?, finite(tz)?],
        identity(lens)?,
        known,
        "cameras.txt",
    )?;
    // Names may contain spaces.
    let behind = |rest: &str| {
        rest.trim_start()
            .split_once(char::is_whitespace)
            .map_or("", |(_, behind)| behind)
            .len()
    };
    let name = (0..9)
        .fold(line, |rest, _| &rest[rest.len() - behind(rest)..])
        .trim();
    Ok((name.to_owned(), pose))
}

// ---- binary ----

/// `cameras.bin` and `images.bin` in a folder; also returns the name of the second for messages.
pub(super) fn read_binary(folder: &Path) -> Result<(String, Vec<Pose>)> {
    let [lenses, images] = ["cameras.bin", "images.bin"].map(|file| folder.join(file));
    let bytes = input::read(&lenses).map_err(unreadable(&lenses))?;
    let known = binary_lenses(&bytes).map_err(wrong(&lenses))?;
    let bytes = input::read(&images).map_err(unreadable(&images))?;
    let poses = binary_poses(&bytes, &known).map_err(wrong(&images))?;
    Ok((named(&images), in_order(poses)))
}

/// The rest of a file of little-endian numbers.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn pass(&mut self, count: usize) -> Parsed<&'a [u8]> {
        let (head, rest) = self
            .0
            .split_at_checked(count)
            .ok_or("the file ends inside it")?;
        self.0 = rest;
        Ok(head)
    }

    fn word<const N: usize>(&mut self) -> Parsed<[u8; N]> {
        self.pass(N)?
            .try_into()
            .map_err(|_| "the file ends inside it".into())
    }

    fn u32(&mut self) -> Parsed<u32> {
        self.word().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Parsed<u64> {
        self.word().map(u64::from_le_bytes)
    }

    fn finite(&mut self) -> Parsed<f64> {
        let number = self.word().map(f64::from_le_bytes)?;
        if number.is_finite() {
            Ok(number)
        } else {
            Err(format!(
                "it has a number that is {number}; all must be finite"
            ))
        }
    }

    /// Text up to a zero byte.
    fn text(&mut self) -> Parsed<String> {
        let length = self
            .0
            .iter()
            .position(|byte| *byte == 0)
            .ok_or("the file ends inside its name")?;
        let text = String::from_utf8_lossy(self.pass(length)?).into_owned();
        self.pass(1)?;
        Ok(text)
    }
}

/// All records of a file. The header has their number; no memory is reserved by it.
fn records<T>(
    bytes: &[u8],
    what: &str,
    read: impl Fn(&mut Bytes) -> Parsed<T>,
) -> std::result::Result<Vec<T>, Wrong> {
    let mut rest = Bytes(bytes);
    let count = rest
        .u64()
        .map_err(|sentence| ("its header".to_string(), sentence))?;
    let mut all = Vec::new();
    for nth in 0..count {
        all.push(
            read(&mut rest).map_err(|sentence| (format!("{what} {nth} of {count}"), sentence))?,
        );
    }
    if rest.0.is_empty() {
        return Ok(all);
    }
    Err((
        "its end".into(),
        format!(
            "{} bytes follow the last of {count} {what}s; none may",
            rest.0.len()
        ),
    ))
}

fn binary_lenses(bytes: &[u8]) -> std::result::Result<Lenses, Wrong> {
    let one = |rest: &mut Bytes| {
        let (id, model) = (rest.u32()?, rest.u32()?);
        let (width, height) = (rest.u64()?, rest.u64()?);
        let known = usize::try_from(model)
            .ok()
            .and_then(|model| MODELS.get(model));
        let (model, count) = known.ok_or(format!(
            "its model has the number {model}; 0 to {} are known",
            MODELS.len() - 1
        ))?;
        let numbers: Vec<f64> = (0..*count).map(|_| rest.finite()).collect::<Parsed<_>>()?;
        let side = |side: u64| {
            u32::try_from(side)
                .ok()
                .filter(|side| (1..=LONGEST_SIDE).contains(side))
        };
        let size = side(width)
            .zip(side(height))
            .map(|(width, height)| [width, height]);
        let size = size.ok_or(format!(
            "its picture is {width}×{height}; 1 to 10⁶ pixels on each side are right"
        ))?;
        Ok((id, lens(model, &numbers, size)?))
    };
    let mut known = Lenses::new();
    for (id, lens) in records(bytes, "camera", one)? {
        if known.insert(id, lens).is_some() {
            return Err((format!("camera {id}"), "it is defined twice".into()));
        }
    }
    Ok(known)
}

fn binary_poses(bytes: &[u8], known: &Lenses) -> std::result::Result<Vec<(String, Pose)>, Wrong> {
    let one = |rest: &mut Bytes| {
        rest.u32()?;
        let turn = [
            rest.finite()?,
            rest.finite()?,
            rest.finite()?,
            rest.finite()?,
        ];
        let shift = [rest.finite()?, rest.finite()?, rest.finite()?];
        let pose = pose(turn, shift, rest.u32()?, known, "cameras.bin")?;
        let name = rest.text()?;
        // Two numbers and an id per point.
        let points = rest.u64()?;
        let bytes = usize::try_from(points)
            .ok()
            .and_then(|points| points.checked_mul(24))
            .unwrap_or(usize::MAX);
        rest.pass(bytes)?;
        Ok((name, pose))
    };
    records(bytes, "image", one)
}

//! Camera file: reads the cameras of other programs: nerfstudio's `transforms.json`, COLMAP's text.
//!
//! ```text
//! nerfstudio  camera → world, x right, y up, z back        ─┐
//! COLMAP      world → camera, x right, y down, z forward   ─┴─► eye, forward, up ─► a camera a frame
//! ```
//! A camera here has square pixels, no distortion, and its axis through the picture's middle; whatever else a file has is refused, beyond a
//! hundredth of a pixel. Sources: nerfstudio, *Data conventions*; COLMAP, *Output format* and *Camera models*.

use super::camera::Ball;
use super::json::NEAR_OF_DISTANCE;
use super::path::MOST_FRAMES;
use super::ply::FARTHEST;
use super::{Camera, Image, Splat, strict_json};
use crate::error::{Error, Result};
use crate::input;
use crate::output::text::clipped;
use glam::{DMat3, DQuat, DVec3};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// How far a picture may be off for what a camera here cannot say, pixels.
const MOST_OFF_PX: f64 = 0.01;
/// How far a matrix may be off a rotation.
const MOST_OFF_ROTATION: f64 = 1e-3;

/// Cameras as a file has them.
#[derive(Clone, Debug)]
pub struct CameraFile {
    /// The file's, for sentences.
    pub(super) name: String,
    /// Width and height of all pictures, where the file says so.
    pub(super) size: Option<(usize, usize)>,
    poses: Vec<Pose>,
}

/// One camera.
#[derive(Clone, Copy, Debug)]
struct Pose {
    eye: DVec3,
    /// Unit vectors, world space.
    forward: DVec3,
    up: DVec3,
    field_of_view: FieldOfView,
}

/// Full angle of view, radians.
#[derive(Clone, Copy, Debug, PartialEq)]
enum FieldOfView {
    Vertical(f64),
    /// Where a file has no picture's size: that of the scene's picture decides.
    Horizontal(f64),
}

/// What a file says of its lens; sides and lengths in pixels.
#[derive(Clone, Copy, Debug)]
struct Lens {
    size: (usize, usize),
    focal: [f64; 2],
    principal: [f64; 2],
}

impl Lens {
    /// The vertical angle of view, or why no camera here has it.
    fn field_of_view(&self) -> std::result::Result<FieldOfView, String> {
        let (size, [fx, fy]) = ([self.size.0 as f64, self.size.1 as f64], self.focal);
        if !(fx > 0.0 && fy > 0.0 && fx.is_finite() && fy.is_finite()) {
            return Err(format!("its focal lengths are {fx} and {fy} pixels; they must be above 0"));
        }
        // What is no number is off, too.
        let is_off = |by: f64| by.is_nan() || by > MOST_OFF_PX;
        if is_off((fx / fy - 1.0).abs() * size[0] / 2.0) {
            return Err(format!("its focal lengths are {fx} and {fy} pixels; only square pixels can be drawn, with one of both"));
        }
        let [cx, cy] = self.principal;
        let middle = size.map(|side| side / 2.0);
        if is_off((cx - middle[0]).abs()) || is_off((cy - middle[1]).abs()) {
            return Err(format!(
                "its principal point is {cx}, {cy}; only the middle of the picture can be drawn, {}, {}",
                middle[0], middle[1]
            ));
        }
        Ok(FieldOfView::Vertical(2.0 * libm::atan(middle[1] / fy)))
    }
}

impl CameraFile {
    /// Reads `transforms.json`, or the folder of COLMAP's `cameras.txt` and `images.txt`, or either of these.
    ///
    /// # Errors
    /// [`Error::Input`], a sentence: which file and line or frame, what is wrong there, what would be right.
    pub fn read(path: &Path) -> Result<Self> {
        let is = |name: &str| path.file_name().is_some_and(|own| own.eq_ignore_ascii_case(name));
        let ends = |end: &str| path.extension().is_some_and(|own| own.eq_ignore_ascii_case(end));
        let file = if path.is_dir() {
            colmap(path)
        } else if is("images.txt") || is("cameras.txt") {
            colmap(path.parent().unwrap_or(Path::new("")))
        } else if ends("json") {
            let name = format!("--cameras {}", path.display());
            let poses = nerfstudio(&read(path, &name)?).map_err(|sentence| Error::input(format!("{name}: {sentence}")));
            poses.map(|(size, poses)| CameraFile { name, size, poses })
        } else {
            let hint = if ends("bin") { ": `colmap model_converter --output_type TXT` makes them of binary ones" } else { "" };
            Err(Error::input(format!(
                "--cameras {}: is of no known kind; nerfstudio's transforms.json is, or the folder of COLMAP's cameras.txt and images.txt{hint}",
                path.display()
            )))
        }?;
        match file.poses.len() {
            0 => Err(Error::input(format!("{}: has no camera; it must have one a frame", file.name))),
            many if many > MOST_FRAMES => Err(Error::input(format!("{}: has {many} cameras; at most {MOST_FRAMES} are right", file.name))),
            _ => Ok(file),
        }
    }

    /// A camera a frame. Targets lie as far as the middle of the splats, and the near plane as it does where a scene leaves it out.
    pub(super) fn cameras(&self, image: &Image, splats: &[Splat]) -> Result<Vec<Camera>> {
        let ball = Ball::around(splats);
        let aspect = image.height as f64 / image.width as f64;
        let camera = |(frame, pose): (usize, &Pose)| {
            let distance = (ball.centre - pose.eye).length().max(ball.radius);
            let fov_y = match pose.field_of_view {
                FieldOfView::Vertical(angle) => angle,
                FieldOfView::Horizontal(angle) => 2.0 * libm::atan(libm::tan(angle / 2.0) * aspect),
            };
            let target = pose.eye + distance * pose.forward;
            let near = distance * NEAR_OF_DISTANCE;
            let camera = Camera { eye: pose.eye, target, up: pose.up, fov_y_degrees: fov_y.to_degrees(), near };
            camera.check(&format!("{}: frame {frame}: ", self.name), "").map(|()| camera)
        };
        self.poses.iter().enumerate().map(camera).collect::<std::result::Result<_, String>>().map_err(Error::input)
    }
}

fn read(path: &Path, name: &str) -> Result<String> {
    input::read_text(path).map_err(|e| Error::input(format!("{name}: cannot be read: {e}")))
}

type Poses = (Option<(usize, usize)>, Vec<Pose>);

fn check_position(eye: DVec3) -> std::result::Result<(), String> {
    if eye.abs().max_element() <= FARTHEST { Ok(()) } else { Err(format!("its position is {eye}; it must lie within ±{FARTHEST:e}")) }
}

/// All pictures of a sequence have one size.
fn one_size(known: &mut Option<(usize, usize)>, size: (usize, usize)) -> std::result::Result<(), String> {
    let &mut (width, height) = known.get_or_insert(size);
    if (width, height) == size {
        return Ok(());
    }
    Err(format!("its picture is {}×{}, and those before are {width}×{height}; all must have one size", size.0, size.1))
}

// ---- nerfstudio ----

/// What distorts, in a file of nerfstudio's.
const DISTORTIONS: [&str; 8] = ["k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"];

fn nerfstudio(text: &str) -> std::result::Result<Poses, String> {
    let all = strict_json::parse(text)?;
    let frames = all["frames"].as_array().ok_or("has no list `frames`: it is no transforms.json")?;
    let mut size = None;
    let pose = |(i, frame): (usize, &Value)| {
        let told = |sentence: String| format!("frames[{i}]: {sentence}");
        let (field_of_view, own) = Told { all: &all, frame }.field_of_view().map_err(told)?;
        own.map_or(Ok(()), |own| one_size(&mut size, own)).map_err(told)?;
        let (axes, eye) = transform(&frame["transform_matrix"]).map_err(told)?;
        Ok(Pose { eye, forward: -axes.z_axis, up: axes.y_axis, field_of_view })
    };
    let poses = frames.iter().enumerate().map(pose).collect::<std::result::Result<_, String>>()?;
    Ok((size, poses))
}

/// A frame's fields, which go before those of all.
struct Told<'a> {
    all: &'a Value,
    frame: &'a Value,
}

impl Told<'_> {
    fn number(&self, name: &str) -> std::result::Result<Option<f64>, String> {
        match self.frame.get(name).or(self.all.get(name)) {
            None => Ok(None),
            Some(value) => value.as_f64().map(Some).ok_or(format!("{name} is no number")),
        }
    }

    fn field_of_view(&self) -> std::result::Result<(FieldOfView, Option<(usize, usize)>), String> {
        let told = |name: &str| self.frame.get(name).or(self.all.get(name));
        let model = told("camera_model").map_or(Some("PINHOLE"), Value::as_str).ok_or("camera_model is no text")?;
        if !["PINHOLE", "SIMPLE_PINHOLE", "OPENCV"].contains(&model) {
            return Err(format!(
                "camera_model is {}; only PINHOLE, SIMPLE_PINHOLE and OPENCV without distortion can be drawn",
                clipped(model)
            ));
        }
        for name in DISTORTIONS {
            if let Some(amount) = self.number(name)?.filter(|amount| *amount != 0.0) {
                return Err(format!("{name} is {amount}: a lens that distorts cannot be drawn; cameras of undistorted pictures can"));
            }
        }
        if told("is_fisheye").is_some_and(|is| *is != Value::Bool(false)) {
            return Err("is_fisheye is set: a lens that distorts cannot be drawn; cameras of undistorted pictures can".into());
        }
        let is_straight =
            |amounts: &Value| amounts.as_array().is_some_and(|amounts| amounts.iter().all(|amount| amount.as_f64() == Some(0.0)));
        if told("distortion_params").is_some_and(|amounts| !is_straight(amounts)) {
            return Err("distortion_params are not all 0: a lens that distorts cannot be drawn; cameras of undistorted pictures can".into());
        }
        let side = |name: &str| {
            let side = self.number(name)?;
            match side.filter(|side| *side >= 1.0 && *side <= 1e6 && side.fract() == 0.0) {
                None if side.is_some() => {
                    Err(format!("{name} is {}; it must be a whole number of pixels from 1 to 10⁶", side.unwrap_or(0.0)))
                }
                side => Ok(side.map(|side| side as usize)),
            }
        };
        let size = side("w")?.zip(side("h")?);
        let [fx, fy, cx, cy] = ["fl_x", "fl_y", "cx", "cy"].map(|name| self.number(name));
        let (fx, fy, cx, cy) = (fx?, fy?, cx?, cy?);
        if let Some([fx, fy]) = fx.or(fy).map(|focal| [fx.unwrap_or(focal), fy.unwrap_or(focal)]) {
            let size = size.ok_or("has fl_x or fl_y without w and h: the picture's sides are needed")?;
            let principal = [cx.unwrap_or(size.0 as f64 / 2.0), cy.unwrap_or(size.1 as f64 / 2.0)];
            return Ok((Lens { size, focal: [fx, fy], principal }.field_of_view()?, Some(size)));
        }
        let angle = self.number("camera_angle_x")?.ok_or("has neither fl_x nor camera_angle_x")?;
        if !(angle > 0.0 && angle < std::f64::consts::PI) {
            return Err(format!("camera_angle_x is {angle}; it must lie between 0 and π"));
        }
        let vertical = self.number("camera_angle_y")?;
        if vertical.is_some_and(|angle| !(angle > 0.0 && angle < std::f64::consts::PI)) {
            return Err("camera_angle_y must lie between 0 and π".into());
        }
        let Some(size) = size else {
            // Without sides nobody knows where the middle is, nor what a square pixel is.
            let name = [("cx", cx), ("cy", cy), ("camera_angle_y", vertical)].into_iter().find(|(_, value)| value.is_some());
            return name.map_or(Ok((FieldOfView::Horizontal(angle), None)), |(name, _)| Err(format!("has {name} without w and h")));
        };
        let [width, height] = [size.0 as f64, size.1 as f64];
        let focal = width / 2.0 / libm::tan(angle / 2.0);
        let focal = [focal, vertical.map_or(focal, |angle| height / 2.0 / libm::tan(angle / 2.0))];
        let principal = [cx.unwrap_or(width / 2.0), cy.unwrap_or(height / 2.0)];
        Ok((Lens { size, focal, principal }.field_of_view()?, Some(size)))
    }
}

/// Axes and position of a camera, world space.
fn transform(matrix: &Value) -> std::result::Result<(DMat3, DVec3), String> {
    let row = |row: &Value| -> Option<[f64; 4]> {
        let numbers: Option<Vec<f64>> = row.as_array()?.iter().map(Value::as_f64).collect();
        numbers?.try_into().ok()
    };
    let rows: Option<Vec<[f64; 4]>> = matrix.as_array().and_then(|rows| rows.iter().map(row).collect());
    let Some([x, y, z, last]) = rows.and_then(|rows| <[[f64; 4]; 4]>::try_from(rows).ok()) else {
        return Err("transform_matrix must be four rows of four numbers".into());
    };
    let column = |i: usize| DVec3::new(x[i], y[i], z[i]);
    let axes = DMat3::from_cols(column(0), column(1), column(2));
    let off = (axes.transpose() * axes - DMat3::IDENTITY).to_cols_array().into_iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    if !(off <= MOST_OFF_ROTATION && axes.determinant() > 0.0 && last == [0.0, 0.0, 0.0, 1.0]) {
        return Err(
            "transform_matrix is no rotation and a position: its columns must be unit vectors, right-handed, its last row 0 0 0 1".into()
        );
    }
    check_position(column(3)).map(|()| (axes, column(3)))
}

// ---- COLMAP ----

fn colmap(folder: &Path) -> Result<CameraFile> {
    let [lenses, images] = ["cameras.txt", "images.txt"].map(|file| folder.join(file));
    let name = |path: &Path| format!("--cameras {}", path.display());
    let wrong = |path: &Path| {
        let name = name(path);
        move |(line, sentence): (usize, String)| Error::input(format!("{name}: line {line}: {sentence}"))
    };
    let text = read(&lenses, &name(&lenses))?;
    let known = colmap_lenses(&text).map_err(wrong(&lenses))?;
    let (size, poses) = colmap_poses(&read(&images, &name(&images))?, &known).map_err(wrong(&images))?;
    Ok(CameraFile { name: name(&images), size, poses })
}

/// A line, from 1, and what is wrong with it.
type Wrong = (usize, String);
type Lenses<'t> = BTreeMap<&'t str, (FieldOfView, (usize, usize))>;

/// Lines that say something.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().enumerate().map(|(i, line)| (i + 1, line.trim())).filter(|(_, line)| !line.starts_with('#'))
}

fn finite(word: &str) -> std::result::Result<f64, String> {
    word.parse().ok().filter(|number: &f64| number.is_finite()).ok_or(format!("`{}` is no finite number", clipped(word)))
}

fn colmap_lenses(text: &str) -> std::result::Result<Lenses<'_>, Wrong> {
    let mut known = BTreeMap::new();
    for (number, line) in lines(text).filter(|(_, line)| !line.is_empty()) {
        let (id, lens) = colmap_lens(line).map_err(|sentence| (number, sentence))?;
        if known.insert(id, lens).is_some() {
            return Err((number, format!("camera {} is there a second time", clipped(id))));
        }
    }
    Ok(known)
}

/// A camera's identity, its angle, and the size of its pictures.
type NamedLens<'t> = (&'t str, (FieldOfView, (usize, usize)));

/// `CAMERA_ID MODEL WIDTH HEIGHT PARAMS…`
fn colmap_lens(line: &str) -> std::result::Result<NamedLens<'_>, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [id, model, width, height, parameters @ ..] = words.as_slice() else {
        return Err("a camera is an identity, a model, width, height and the model's numbers".into());
    };
    let numbers: Vec<f64> = parameters.iter().map(|word| finite(word)).collect::<std::result::Result<_, _>>()?;
    let (focal, principal, distortion): ([f64; 2], [f64; 2], &[f64]) = match (*model, numbers.as_slice()) {
        ("SIMPLE_PINHOLE", &[f, cx, cy]) => ([f; 2], [cx, cy], &[]),
        ("PINHOLE", &[fx, fy, cx, cy]) => ([fx, fy], [cx, cy], &[]),
        ("SIMPLE_RADIAL", &[f, cx, cy, ref distortion @ ..]) if distortion.len() == 1 => ([f; 2], [cx, cy], distortion),
        ("RADIAL", &[f, cx, cy, ref distortion @ ..]) if distortion.len() == 2 => ([f; 2], [cx, cy], distortion),
        ("OPENCV", &[fx, fy, cx, cy, ref distortion @ ..]) if distortion.len() == 4 => ([fx, fy], [cx, cy], distortion),
        ("FULL_OPENCV", &[fx, fy, cx, cy, ref distortion @ ..]) if distortion.len() == 8 => ([fx, fy], [cx, cy], distortion),
        ("SIMPLE_PINHOLE" | "PINHOLE" | "SIMPLE_RADIAL" | "RADIAL" | "OPENCV" | "FULL_OPENCV", _) => {
            return Err(format!("{model} has {} numbers, which are not as many as it needs", numbers.len()));
        }
        _ => return Err(format!("the model {} cannot be drawn; PINHOLE can, of undistorted pictures", clipped(model))),
    };
    if let Some(amount) = distortion.iter().find(|amount| **amount != 0.0) {
        return Err(format!(
            "a lens that distorts cannot be drawn ({amount}); `colmap image_undistorter` makes pictures and cameras of one that does not"
        ));
    }
    let side = |word: &str| {
        let side = word.parse().ok().filter(|side| (1..=1_000_000).contains(side));
        side.ok_or(format!("`{}` is no width or height; a whole number of pixels from 1 to 10⁶ is right", clipped(word)))
    };
    let size = (side(width)?, side(height)?);
    Ok((id, (Lens { size, focal, principal }.field_of_view()?, size)))
}

/// Two lines a picture: `IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME`, and its points, which are not needed. In the order of the names.
fn colmap_poses(text: &str, known: &Lenses) -> std::result::Result<Poses, Wrong> {
    let (mut size, mut poses) = (None, Vec::new());
    let mut lines = lines(text);
    while let Some((number, line)) = lines.next() {
        if line.is_empty() {
            continue;
        }
        let told = |sentence: String| (number, sentence);
        let (name, pose, own) = colmap_pose(line, known).map_err(told)?;
        one_size(&mut size, own).map_err(told)?;
        poses.push((name, pose));
        if let Some((number, points)) = lines.next() {
            let count = points.split_whitespace().try_fold(0, |count, word| finite(word).map(|_| count + 1));
            if count.map_err(|sentence| (number, sentence))? % 3 != 0 {
                return Err((number, "a picture's points come here, three numbers each, or an empty line".into()));
            }
        }
    }
    poses.sort_by_key(|(name, _): &(&str, Pose)| *name);
    Ok((size, poses.into_iter().map(|(_, pose)| pose).collect()))
}

fn colmap_pose<'t>(line: &'t str, known: &Lenses) -> std::result::Result<(&'t str, Pose, (usize, usize)), String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [_, qw, qx, qy, qz, tx, ty, tz, lens, _, ..] = words.as_slice() else {
        return Err("a picture is an identity, a quaternion, a translation, a camera and a name".into());
    };
    let numbers = [qw, qx, qy, qz, tx, ty, tz].map(|word| finite(word));
    let [w, x, y, z, tx, ty, tz] = match numbers.iter().find_map(|number| number.as_ref().err()) {
        Some(sentence) => return Err(sentence.clone()),
        None => numbers.map(|number| number.unwrap_or(0.0)),
    };
    let (field_of_view, size) = *known.get(lens).ok_or(format!("its camera {} is not in cameras.txt", clipped(lens)))?;
    let turn = DQuat::from_xyzw(x, y, z, w);
    let length = turn.length();
    if !(length > 1e-100 && length.is_finite()) {
        return Err("its quaternion is zero or too large; it must turn".into());
    }
    // World → camera: what lies at the eye comes to 0.
    let back = (turn / length).conjugate();
    let eye = back * -DVec3::new(tx, ty, tz);
    check_position(eye)?;
    // A name may have spaces.
    let behind = |rest: &'t str| rest.trim_start().split_once(char::is_whitespace).map_or("", |(_, behind)| behind);
    let name = (0..9).fold(line, |rest, _| behind(rest)).trim();
    Ok((name, Pose { eye, forward: back * DVec3::Z, up: back * DVec3::NEG_Y, field_of_view }, size))
}

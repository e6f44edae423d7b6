//! Camera file: reads the cameras of other programs: nerfstudio's `transforms.json` and
//! `camera_path.json`, COLMAP's text and binary files, and the `cameras.json` of programs that
//! train Gaussians.
//!
//! ```text
//! nerfstudio  camera → world, x right, y up, z back        ─┐
//! COLMAP      world → camera, x right, y down, z forward   ─┼─► eye, forward, up, intrinsics ─► one camera per frame
//! training    camera → world, x right, y down, z forward   ─┘
//! ```
//! Readers give each picture its focal lengths and its principal point in pixels ([`Intrinsics`]).
//! Distortion is refused by each reader. Sources: nerfstudio, *Data conventions* and
//! `camera_paths.py`; COLMAP, *Output format* and *Camera models*; graphdeco-inria,
//! gaussian-splatting, `camera_utils.py`.

mod colmap;
mod nerfstudio;
mod trained;

use super::camera::Ball;
use super::json::{CameraFields, NEAR_OF_DISTANCE};
use super::path::MOST_FRAMES;
use super::ply::FARTHEST;
use super::{Camera, Image, Splat, strict_json, validate};
use crate::error::{Error, Result};
use glam::{DMat3, DVec3};
use schemars::schema_for;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Tolerance, pixels, for square pixels and a centred axis.
const MOST_OFF_PX: f64 = 0.01;
/// Greatest deviation of a matrix from a rotation.
const MOST_OFF_ROTATION: f64 = 1e-3;
/// Longest side of a picture in a file, pixels.
const LONGEST_SIDE: u32 = 1_000_000;

/// The error is the second half of a sentence that begins with the file's name.
type Parsed<T> = std::result::Result<T, String>;

/// Cameras of a file.
#[derive(Clone, Debug)]
pub struct CameraFile {
    /// Name of the file for messages.
    pub(super) name: String,
    /// Width and height of most pictures, if the file has them: all are drawn at this size.
    pub(super) size: Option<(usize, usize)>,
    /// Assumptions about missing data, for the summary.
    pub(super) notes: Vec<String>,
    poses: Vec<Pose>,
    /// Cameras recorded by a search, used unchanged instead of poses.
    own: Vec<Camera>,
}

/// One camera.
#[derive(Clone, Debug)]
struct Pose {
    /// Name of the picture from this camera, as in the file.
    picture: Option<String>,
    eye: DVec3,
    /// Unit vectors, world space.
    forward: DVec3,
    up: DVec3,
    lens: Lens,
}

/// Lens data of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Lens {
    Known(Intrinsics),
    /// Full horizontal angle of view, radians, if a file has no picture size: it applies to the
    /// scene's picture.
    HorizontalAngle(f64),
}

/// Projection of one picture: u = focal · x/z + centre, in pixels of a picture of this size.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Intrinsics {
    focal_px: [f64; 2],
    centre_px: [f64; 2],
    size: [u32; 2],
}

impl Intrinsics {
    /// The principal point is the centre by default.
    fn new(size: [u32; 2], focal_px: [f64; 2], centre_px: [Option<f64>; 2]) -> Parsed<Self> {
        let [fx, fy] = focal_px;
        if !(fx > 0.0 && fy > 0.0 && fx.is_finite() && fy.is_finite()) {
            return Err(format!(
                "its focal lengths are {fx} and {fy} pixels; they must be above 0"
            ));
        }
        let centre_px = [0, 1].map(|axis| centre_px[axis].unwrap_or(f64::from(size[axis]) / 2.0));
        if centre_px.iter().any(|centre| !centre.is_finite()) {
            return Err(format!(
                "its principal point is {}, {}; it must be finite",
                centre_px[0], centre_px[1]
            ));
        }
        Ok(Intrinsics {
            focal_px,
            centre_px,
            size,
        })
    }

    /// The full vertical angle of view, radians.
    fn vertical_angle(&self) -> f64 {
        2.0 * libm::atan(f64::from(self.size[1]) / 2.0 / self.focal_px[1])
    }

    /// A camera with this lens. If pixels are square and the axis is central, to a hundredth of a
    /// pixel, it has only an angle of view.
    fn seen(&self, camera: Camera) -> Camera {
        let ([fx, fy], [cx, cy]) = (self.focal_px, self.centre_px);
        let [width, height] = self.size.map(f64::from);
        let off_px = [
            (fx / fy - 1.0).abs() * width / 2.0,
            (cx - width / 2.0).abs(),
            (cy - height / 2.0).abs(),
        ];
        if off_px.into_iter().all(|off| off <= MOST_OFF_PX) {
            return camera;
        }
        Camera {
            focal_px: Some([fx, fy]),
            centre_px: Some([cx, cy]),
            picture_px: Some([width, height]),
            ..camera
        }
    }
}

impl Pose {
    /// Full vertical angle of view in a picture of the scene, radians. A picture of another size is
    /// scaled by its height.
    fn vertical_angle(&self, image: &Image) -> f64 {
        match &self.lens {
            Lens::Known(intrinsics) => intrinsics.vertical_angle(),
            Lens::HorizontalAngle(angle) => {
                2.0 * libm::atan(libm::tan(angle / 2.0) * image.height as f64 / image.width as f64)
            }
        }
    }
}

/// Files in a folder, in the order in which they are searched for. COLMAP's two files count as one,
/// by the first.
const IN_FOLDER: [&str; 6] = [
    "transforms.json",
    "cameras.txt",
    "cameras.bin",
    "cameras.json",
    "camera_path.json",
    "transforms_train.json",
];
/// Subfolders that are searched: COLMAP's projects have their files there.
const FOLDERS: [&str; 3] = ["", "sparse/0", "sparse"];

impl CameraFile {
    /// Reads a file of cameras, or the folder of one: `transforms.json`, COLMAP's `cameras` and
    /// `images` as `.txt` or `.bin`, `cameras.json` or `camera_path.json`.
    ///
    /// # Errors
    /// [`Error::Input`], a sentence with the file, the line or frame, the problem and the correct
    /// form.
    pub fn read(path: &Path) -> Result<Self> {
        let mut notes = Vec::new();
        let path = &if path.is_dir() {
            found_in(path, &mut notes)?
        } else {
            path.to_owned()
        };
        let is = |names: [&str; 2]| {
            path.file_name()
                .is_some_and(|own| names.iter().any(|name| own.eq_ignore_ascii_case(name)))
        };
        let folder = path.parent().unwrap_or(Path::new(""));
        let (name, poses) = if is(["images.txt", "cameras.txt"]) {
            colmap::read_text(folder)?
        } else if is(["images.bin", "cameras.bin"]) {
            colmap::read_binary(folder)?
        } else if path
            .extension()
            .is_some_and(|own| own.eq_ignore_ascii_case("json"))
        {
            let name = named(path);
            let input_error = |sentence: String| Error::input(format!("{name}: {sentence}"));
            let value = strict_json::read(path).map_err(input_error)?;
            if let Some(cameras) = value.get("splatsim_cameras") {
                let own = recorded(cameras).map_err(input_error)?;
                return Ok(CameraFile {
                    name,
                    size: None,
                    notes: Vec::new(),
                    poses: Vec::new(),
                    own,
                });
            }
            let poses = of_json(&value, &mut notes).map_err(input_error)?;
            (name, poses)
        } else {
            return Err(Error::input(format!(
                "{}: is of no known kind; transforms.json and camera_path.json of nerfstudio are, cameras.json of programs that train \
                 Gaussians, COLMAP's cameras and images as .txt or .bin, or a folder of one of these",
                named(path)
            )));
        };
        let input_error = |sentence: String| Error::input(format!("{name}: {sentence}"));
        match poses.len() {
            0 => {
                return Err(input_error(
                    "has no camera; it must have one per frame".into(),
                ));
            }
            many if many > MOST_FRAMES => {
                return Err(input_error(format!(
                    "has {many} cameras; at most {MOST_FRAMES} are right"
                )));
            }
            _ => {}
        }
        let size = common_size(&poses, &mut notes);
        let notes = notes
            .into_iter()
            .map(|note| format!("{name}: {note}"))
            .collect();
        Ok(CameraFile {
            name,
            size,
            notes,
            poses,
            own: Vec::new(),
        })
    }

    /// The name of each camera's picture, as in the file: a path, or a name that may lack its
    /// extension. None if the file has none.
    pub(super) fn pictures(&self) -> Vec<Option<&str>> {
        self.poses
            .iter()
            .map(|pose| pose.picture.as_deref())
            .collect()
    }

    /// One camera per frame. Targets are at the distance of the splats' centre, and the near plane
    /// at its default unless the scene has one.
    pub(super) fn cameras(&self, image: &Image, splats: &[Splat]) -> Result<Vec<Camera>> {
        if !self.own.is_empty() {
            return Ok(self.own.clone());
        }
        let ball = Ball::around(splats);
        let camera = |(frame, pose): (usize, &Pose)| {
            let distance = (ball.centre - pose.eye).length().max(ball.radius);
            let target = pose.eye + distance * pose.forward;
            let near = distance * NEAR_OF_DISTANCE;
            let camera = Camera {
                eye: pose.eye,
                target,
                up: pose.up,
                fov_y_degrees: pose.vertical_angle(image).to_degrees(),
                near,
                focal_px: None,
                centre_px: None,
                picture_px: None,
            };
            let camera = match &pose.lens {
                Lens::Known(intrinsics) => intrinsics.seen(camera),
                Lens::HorizontalAngle(_) => camera,
            };
            camera
                .check(&format!("{}: frame {frame}: ", self.name), "")
                .map(|()| camera)
        };
        self.poses
            .iter()
            .enumerate()
            .map(camera)
            .collect::<Parsed<_>>()
            .map_err(Error::input)
    }
}

/// Cameras recorded by a search: a list of names and cameras.
fn recorded(cameras: &Value) -> Parsed<Vec<Camera>> {
    let cameras = cameras.as_array().filter(|cameras| !cameras.is_empty());
    let cameras =
        cameras.ok_or("splatsim_cameras is not a list of cameras; it must have one per frame")?;
    if cameras.len() > MOST_FRAMES {
        return Err(format!(
            "has {} cameras; at most {MOST_FRAMES} are right",
            cameras.len()
        ));
    }
    let schema = schema_for!(CameraFields).to_value();
    let camera = |(frame, recorded): (usize, &Value)| {
        let begin = format!("splatsim_cameras[{frame}].camera");
        let value = recorded
            .get("camera")
            .ok_or_else(|| format!("{begin} is missing"))?;
        validate::check(value, &schema).map_err(|violation| format!("{begin}: {violation}"))?;
        let camera: Camera =
            serde_json::from_value(value.clone()).map_err(|error| format!("{begin}: {error}"))?;
        if camera.picture_px.is_none() && (camera.focal_px.is_some() || camera.centre_px.is_some())
        {
            return Err(format!(
                "{begin}: has focal_px or centre_px without picture_px"
            ));
        }
        check_position(camera.eye)?;
        camera.check(&format!("{begin}: "), "").map(|()| camera)
    };
    cameras.iter().enumerate().map(camera).collect()
}

/// The file's name in messages.
fn named(path: &Path) -> String {
    format!("--cameras {}", path.display())
}

/// The file of cameras in a folder; a note if there are others.
fn found_in(folder: &Path, notes: &mut Vec<String>) -> Result<PathBuf> {
    for inside in FOLDERS.map(|inside| folder.join(inside)) {
        let there: Vec<&str> = IN_FOLDER
            .into_iter()
            .filter(|file| inside.join(file).is_file())
            .collect();
        if let [first, others @ ..] = there.as_slice() {
            if !others.is_empty() {
                notes.push(format!(
                    "is read, not the {} in the same folder",
                    others.join(", ")
                ));
            }
            return Ok(inside.join(first));
        }
    }
    Err(Error::input(format!(
        "{}: holds no cameras; a folder must hold one of {} (COLMAP's also in sparse/0)",
        named(folder),
        IN_FOLDER.join(", ")
    )))
}

/// Detects from the content which program wrote it.
fn of_json(value: &Value, notes: &mut Vec<String>) -> Parsed<Vec<Pose>> {
    if let Some(cameras) = value.as_array() {
        trained::poses(cameras)
    } else if let Some(path) = value.get("camera_path") {
        nerfstudio::path(value, path, notes)
    } else if let Some(frames) = value.get("frames") {
        nerfstudio::transforms(value, frames)
    } else {
        Err("has no list `frames` as a transforms.json, no list `camera_path` as a camera_path.json, and is not a list of cameras as a \
             cameras.json"
            .into())
    }
}

/// The size of most pictures; the first of these if several are equally frequent.
fn common_size(poses: &[Pose], notes: &mut Vec<String>) -> Option<(usize, usize)> {
    let mut sizes: Vec<([u32; 2], usize)> = Vec::new();
    for pose in poses {
        if let Lens::Known(Intrinsics { size, .. }) = pose.lens {
            match sizes.iter_mut().find(|(known, _)| *known == size) {
                Some((_, count)) => *count += 1,
                None => sizes.push((size, 1)),
            }
        }
    }
    let most = sizes.iter().map(|(_, count)| *count).max()?;
    let ([width, height], count) = *sizes.iter().find(|(_, count)| *count == most)?;
    if sizes.len() > 1 {
        notes.push(format!(
            "{} of {} pictures are not {width}×{height}: all frames are drawn at one size, each with the vertical angle of view of its picture",
            poses.len() - count,
            poses.len()
        ));
    }
    Some((width as usize, height as usize))
}

// ---- what the formats share ----

fn check_position(eye: DVec3) -> Parsed<()> {
    if eye.abs().max_element() <= FARTHEST {
        Ok(())
    } else {
        Err(format!(
            "its position is {eye}; it must be within ±{FARTHEST:e}"
        ))
    }
}

/// Refuses axes that are not orthonormal and right-handed.
fn check_rotation(axes: &DMat3, field: &str) -> Parsed<()> {
    let off = (axes.transpose() * *axes - DMat3::IDENTITY)
        .to_cols_array()
        .into_iter()
        .fold(0.0, |most: f64, value| most.max(value.abs()));
    if axes.is_finite() && off <= MOST_OFF_ROTATION && axes.determinant() > 0.0 {
        return Ok(());
    }
    Err(format!(
        "{field} is not a rotation: its columns must be unit vectors at right angles, right-handed"
    ))
}

/// A side of a picture, pixels.
fn side(pixels: f64, name: &str) -> Parsed<u32> {
    if (1.0..=f64::from(LONGEST_SIDE)).contains(&pixels) && pixels.fract() == 0.0 {
        return Ok(pixels as u32);
    }
    Err(format!(
        "{name} is {pixels}; it must be a whole number of pixels from 1 to 10⁶"
    ))
}

/// An optional field.
fn number(object: &Value, name: &str) -> Parsed<Option<f64>> {
    match object.get(name) {
        None | Some(Value::Null) => Ok(None),
        Some(value) => value
            .as_f64()
            .map(Some)
            .ok_or(format!("{name} is not a number")),
    }
}

/// Rows of N numbers.
fn rows<const N: usize>(value: &Value) -> Option<Vec<[f64; N]>> {
    let row = |row: &Value| -> Option<[f64; N]> {
        let numbers: Option<Vec<f64>> = row.as_array()?.iter().map(Value::as_f64).collect();
        numbers?.try_into().ok()
    };
    value.as_array()?.iter().map(row).collect()
}

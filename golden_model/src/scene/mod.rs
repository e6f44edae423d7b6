//! Scene: everything that is drawn and how it is viewed, complete and checked, in f64 and world
//! units.
//!
//! A [`Scene`] is complete: readers fill in what a file leaves out (docs/book/scenes.md).

mod builtin;
mod camera;
mod camera_file;
mod cells;
pub mod digest;
mod environment;
mod fields;
mod formats;
mod gaussians;
mod gltf;
mod json;
pub mod memory;
pub mod mesh;
mod neighbours;
pub mod parcel;
mod path;
mod placement;
mod ply;
mod sequence;
pub mod tree;
mod volume;
mod voxels;

pub mod strict_json;
pub mod validate;

pub use builtin::{Builtin, names};
pub use camera_file::CameraFile;
pub use environment::{Environment, Mirror};
pub use gaussians::MachineHarmonics;
pub use json::{MOST_PIXELS, schema};
pub use path::MOST_FRAMES;
pub use sequence::Sequence;

use crate::error::{Error, Result};
use crate::input;
use glam::{DMat3, DQuat, DVec3};
use json::{FrameChoice, LoadedFrame};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::ffi::OsStr;
use std::path::Path;
use std::sync::Arc;

/// Least radius, world units. Positions and radii end at 10³⁰, so a radius is never less than 10⁻⁶¹
/// of a distance. Its fourth power, which is in a footprint's determinant, is then still a normal
/// number of f64 (2.2·10⁻³⁰⁸); squares of less would underflow and give 0/0.
pub const LEAST_RADIUS: f64 = 1e-30;

/// Radial index at which the weight of an opaque Gaussian is 1/255, the least that an 8-bit screen
/// shows: e^(−r/2) = 1/255 at r = 2·ln 255.
pub fn gaussian_cutoff() -> f64 {
    2.0 * libm::log(255.0)
}

/// One splat: a Gaussian disc (docs/book/algorithm.md §2), or an ellipsoid ([`Scene::ellipsoids`]).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Splat {
    /// Centre, world units.
    pub position: DVec3,
    /// Unit normal, world space.
    pub normal: DVec3,
    /// Standard deviation σ of the reconstruction kernel in the tangent plane, world units, at
    /// least [`LEAST_RADIUS`].
    pub radius: f64,
    /// Linear light, each in [0, 1]; for Gaussians in the encoding of their file, ≥ 0.
    pub rgb: [f64; 3],
    /// α in [0, 1]; for volumes the optical depth through the kernel's centre, ≥ 0.
    pub opacity: f64,
    /// Index into [`Scene::materials`].
    pub material: u32,
}

/// Position of the eye and its view (docs/book/algorithm.md §1), as in a scene file.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// World position of the eye.
    #[serde(deserialize_with = "camera::from_array")]
    #[schemars(with = "[f64; 3]")]
    pub eye: DVec3,
    /// World position at the centre of the picture.
    #[serde(deserialize_with = "camera::from_array")]
    #[schemars(with = "[f64; 3]")]
    pub target: DVec3,
    /// Up direction in the picture; not parallel to `target − eye`.
    #[serde(deserialize_with = "camera::from_array")]
    #[schemars(with = "[f64; 3]")]
    pub up: DVec3,
    /// Full vertical angle of view, degrees, in (0, 180). If `focal_px` is given, the equivalent
    /// angle.
    pub fov_y_degrees: f64,
    /// Splats at or nearer than this depth are culled, world units, > 0.
    pub near: f64,
    /// Focal lengths along x and y, in pixels of a picture of `picture_px`; default: both follow
    /// from `fov_y_degrees`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub focal_px: Option<[f64; 2]>,
    /// Principal point: intersection of the camera's axis with a picture of `picture_px`, pixels
    /// from its top left corner; default: its centre.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub centre_px: Option<[f64; 2]>,
    /// Width and height that `focal_px` and `centre_px` refer to: in a picture of another size both
    /// are scaled by its height. Default: those of the picture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture_px: Option<[f64; 2]>,
}

/// The picture to draw.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Image {
    /// Pixels, 1 to 16384.
    pub width: usize,
    /// Pixels, 1 to 16384.
    pub height: usize,
    /// Linear RGB and straight alpha, each in [0, 1].
    pub background: [f64; 4],
    /// Colours are not linear light but screen codes: those of trained Gaussians, which are blended
    /// in that encoding.
    pub encoded: bool,
}

/// The footprint's constants.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Kernel {
    /// Fragments exist if the radial index is below this, > 0.
    pub cutoff: f64,
    /// Variance of the low-pass filter, pixel², ≥ 0.
    pub low_pass: f64,
    /// Splats whose centre is farther to the side than this, in half pictures, are culled: the
    /// affine approximation is invalid there. Above 0.
    pub guard: f64,
    /// Slopes a and b in an ellipsoid's Jacobian are clamped to this, in half pictures. Above 0.
    pub jacobian: f64,
    /// Filter of a splat; filters other than the papers' are for comparison.
    pub filter: Filter,
    /// Opacities of Gaussians are reduced in proportion to their widening by the low-pass filter.
    pub compensate_opacity: bool,
}

/// Filter of a splat (SS Fig. 8). Splats without a low-pass filter are [`Filter::Ewa`] with a
/// variance of 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Filter {
    /// The projected ellipse, convolved with the low-pass filter in the picture: the affine
    /// approximation at the splat's centre.
    Ewa,
    /// A circle with the radius of that ellipse's major axis. Discs only; no machine has it.
    Circular,
    /// Heckbert's: the pixel's low-pass filter is mapped to the splat's plane at the intersection
    /// with the pixel's ray, and convolved there with the splat. Discs only; no machine has it.
    SourceEwa,
}

/// Meaning of an ellipsoid's amplitude.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Amplitude {
    /// That of the disc spanned by its first two axes (SS §5): for kernels flattened along the
    /// third, which is the normal.
    Disc,
    /// Opacity times the kernel's integral along the ray, relative to that of a ball of radius σ
    /// (EWA (33)).
    LineIntegral,
    /// The opacity itself, at the peak: the convention of trained Gaussians.
    Peak,
}

/// Principal axes of a splat's kernel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Orientation {
    /// The axes are the columns of its matrix, world space.
    pub rotation: DQuat,
    /// Standard deviations along them relative to the splat's radius, which is the largest: at most
    /// 1, above 0.
    pub scales: DVec3,
}

/// Axes and rules that make ellipsoids of a scene's splats (EWA §6.2,
/// docs/book/algorithm-resolve.md §9).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ellipsoids {
    /// One for each splat, or a single one for all.
    pub orientations: Vec<Orientation>,
    /// Meaning of amplitudes.
    pub amplitude: Amplitude,
    /// Splats are lit before they are drawn (EWA §6.1), instead of fragments after.
    pub preshaded: bool,
    /// Drawn in the order of depth, nearest first; equal depths in input order.
    pub sorted: bool,
    /// Spherical harmonics that splats have instead of colours; their rgb is evaluated for this
    /// camera. `None` where a colour is the same from all directions.
    pub harmonics: Option<Harmonics>,
}

/// Spherical harmonics of splats' colours (`gaussians::colour`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Harmonics {
    /// Degree, 1 to 3.
    pub degree: u8,
    /// Rotation from the axes of the harmonics to the world.
    pub turn: DQuat,
    /// Red, green and blue of `(degree + 1)²` coefficients for each splat in turn.
    pub coefficients: Arc<Vec<[f32; 3]>>,
}

impl Ellipsoids {
    /// Orientation of a splat by its number.
    pub fn orientation(&self, splat: usize) -> &Orientation {
        &self.orientations[if self.orientations.len() == 1 {
            0
        } else {
            splat
        }]
    }
}

/// Opacity of an optical depth x.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Opacity {
    /// x, limited to 1: e^(−x) ≈ 1 − x (EWA (6)).
    Linear,
    /// 1 − e^(−x).
    Exponential,
    /// x/(1 + x): the share of a weighted sum beside a background of weight 1.
    Weighted,
}

impl Opacity {
    /// α/x.
    pub fn over_depth(self, depth: f64) -> f64 {
        match self {
            Opacity::Linear if depth <= 1.0 => 1.0,
            Opacity::Linear => 1.0 / depth,
            Opacity::Weighted => 1.0 / (1.0 + depth),
            Opacity::Exponential if depth == 0.0 => 1.0,
            Opacity::Exponential => -libm::expm1(-depth) / depth,
        }
    }
}

/// Assignment of splats to sheets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Sheet {
    /// Consecutive splats with the same number: a slice of a volume.
    Slice(Vec<u32>),
    /// Each splat is its own sheet: a Gaussian.
    Splat,
    /// All splats together: Gaussians on a machine that sums them in any order. No scene has it.
    Sum,
}

/// Grouping of splats by sheets instead of surfaces (EWA §7.1).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sheets {
    /// Assignment of splats to sheets.
    pub of: Sheet,
    /// The deepest sheet comes first.
    pub back_to_front: bool,
    /// Opacity of a sheet.
    pub opacity: Opacity,
    /// A pixel whose transmittance is below this accepts no more, in [0, 1); 0 turns this off.
    pub stop: f64,
    /// The sheet that stops a pixel is still blended.
    pub keeps_last: bool,
    /// Smaller weights make no fragment, in [0, 1].
    pub least_weight: f64,
    /// Upper limit of weights if each splat is a sheet, in (0, 1].
    pub most_weight: f64,
    /// Depth from which the weights of summed Gaussians are 0, if they fall with depth, world units,
    /// above 0. `None`: chosen for the view ([`Scene::weight_distance`]).
    pub weight_distance: Option<f64>,
}

impl Sheets {
    /// Rules of a machine that sums Gaussians: no order, and no stop.
    fn summed(&self) -> Self {
        Sheets {
            of: Sheet::Sum,
            back_to_front: false,
            opacity: Opacity::Weighted,
            stop: 0.0,
            ..*self
        }
    }
}

/// Rules by which fragments become surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Surface {
    /// ε: contributions with a smaller difference in depth belong together, world units, > 0.
    pub z_threshold: f64,
    /// τ: weight sum from which a pixel counts as fully covered, > 0.
    pub coverage_threshold: f64,
    /// Drop splats whose normal points away from the eye.
    pub cull_backfaces: bool,
}

/// A directional light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Light {
    /// Unit vector from the surface towards the light, world space.
    pub direction: DVec3,
    /// Linear light, each ≥ 0.
    pub rgb: [f64; 3],
}

/// Reflectance of a surface (docs/book/algorithm-resolve.md §7).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Material {
    /// The colour without lighting.
    Unlit,
    /// Blinn-Phong with the viewer at infinity.
    BlinnPhong {
        /// Part of the colour that is independent of lights, ≥ 0.
        ambient: f64,
        /// Lambert factor, ≥ 0.
        diffuse: f64,
        /// Highlight factor, ≥ 0.
        specular: f64,
        /// Highlight exponent, ≥ 0.
        shininess: f64,
    },
}

/// Everything a renderer needs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    /// Name in reports: file name or built-in name.
    pub name: String,
    /// In input order, which is the machine's order.
    pub splats: Vec<Splat>,
    /// The eye.
    pub camera: Camera,
    /// The picture.
    pub image: Image,
    /// The footprint.
    pub kernel: Kernel,
    /// Axes and rules of ellipsoids; None for discs.
    pub ellipsoids: Option<Ellipsoids>,
    /// Grouping by sheets; None if fragments are grouped by depth.
    pub sheets: Option<Sheets>,
    /// Surface reconstruction.
    pub surface: Surface,
    /// May be empty: then there is only ambient light.
    pub lights: Vec<Light>,
    /// Never empty; every splat's index is in range.
    pub materials: Vec<Material>,
    /// Light from all directions, reflected by materials; None if no material reflects.
    pub environment: Option<Arc<Environment>>,
    /// Tree that the splats are a cut of; None without a tree.
    pub detail: Option<tree::cut::Detail>,
    /// The cameras of a sequence, if the scene is a frame of one.
    pub path: Option<FramePath>,
    /// Notes of a reader on omissions and oddities, one sentence each, for the summary.
    pub notes: Vec<String>,
}

/// A frame of a sequence, which may depend on the frames before it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FramePath {
    /// The camera of each frame.
    pub cameras: Arc<Vec<Camera>>,
    /// The frame, counted from 0.
    pub frame: usize,
}

/// Values of the command line that override a scene's own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overrides {
    /// Width and height of the picture, pixels.
    pub size: Option<(usize, usize)>,
}

/// The viewing transform: numbers that follow from camera and image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// World → camera directions: rows are right, down, forward (x right, y down, z forward).
    pub rotation: DMat3,
    /// World position of the eye.
    pub eye: DVec3,
    /// Pixels per unit of `t_x/t_z` and of `t_y/t_z` (docs/book/algorithm.md §1): both are `s` if
    /// equal.
    pub focal_px: [f64; 2],
    /// Half the picture's width and height, pixels.
    pub half_px: [f64; 2],
    /// Principal point, pixels from the picture's top left corner: `half_px` unless the camera has
    /// another.
    pub centre_px: [f64; 2],
}

impl View {
    /// The larger of both focal lengths.
    pub fn longest_focal_px(&self) -> f64 {
        self.focal_px[0].max(self.focal_px[1])
    }

    /// Slope `t_x/t_z` or `t_y/t_z` of a ray N half pictures from the principal point; a half
    /// picture reaches to the farther side of the picture.
    pub fn slope(&self, axis: usize, half_pictures: f64) -> f64 {
        let [centre, size] = [self.centre_px[axis], 2.0 * self.half_px[axis]];
        half_pictures * centre.max(size - centre) / self.focal_px[axis]
    }

    /// Offset of the principal point from the picture's centre, pixels.
    pub fn off_middle_px(&self) -> [f64; 2] {
        [0, 1].map(|axis| self.centre_px[axis] - self.half_px[axis])
    }

    /// Squares and product of both focal lengths, xx, xy and yy, relative to the square of the
    /// larger; None if pixels are square.
    pub fn aspect(&self) -> Option<[f64; 3]> {
        let [x, y] = self
            .focal_px
            .map(|focal_px| focal_px / self.longest_focal_px());
        (x != y).then_some([x * x, x * y, y * y])
    }

    /// Slopes `t_x/t_z` and `t_y/t_z` of the ray through a point of the picture, given in pixels
    /// from its top left corner.
    pub fn slopes(&self, at_px: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| (at_px[axis] - self.centre_px[axis]) / self.focal_px[axis])
    }
}

impl Scene {
    /// Reads a scene: the path of a `.json` scene file or of a file of splats or, if there is no
    /// such file, the name of a built-in scene. For a sequence it is the first frame, and a note
    /// reports this.
    ///
    /// # Errors
    /// [`Error::Input`], a sentence with the file, the field or row, the problem and the correct
    /// form.
    pub fn load(name_or_path: impl AsRef<OsStr>, overrides: &Overrides) -> Result<Scene> {
        Scene::load_frame(name_or_path, overrides, 0)
    }

    /// Reads one frame of a sequence; other scenes have only frame 0.
    ///
    /// # Errors
    /// As [`Scene::load`]; also if there is no such frame.
    pub fn load_frame(
        name_or_path: impl AsRef<OsStr>,
        overrides: &Overrides,
        frame: usize,
    ) -> Result<Scene> {
        let LoadedFrame {
            mut scene,
            cameras,
            is_sequence,
            ..
        } = Scene::seen(
            name_or_path.as_ref(),
            overrides,
            FrameChoice {
                frame,
                cameras: None,
            },
        )?;
        if is_sequence {
            scene.notes.push(format!(
                "frame {frame} of a sequence of {} (--frame)",
                cameras.len()
            ));
        }
        Ok(scene)
    }

    /// Reads the text of a scene file. Paths in it are relative to `folder`; `name` begins every
    /// error. For a sequence it is frame `frame`.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn from_text(
        text: &str,
        name: &str,
        folder: &Path,
        overrides: &Overrides,
        frame: usize,
    ) -> Result<Scene> {
        Ok(json::read(
            text,
            name,
            folder,
            overrides,
            FrameChoice {
                frame,
                cameras: None,
            },
        )?
        .scene)
    }

    /// Reads the text of a scene file with these splats instead of its own. A normal or a radius of
    /// 0 is fitted to the nearest splats, like missing ones.
    ///
    /// # Errors
    /// As [`Scene::load`]; also the first number of a splat that is out of range.
    pub fn of_splats(
        splats: Vec<Splat>,
        text: &str,
        name: &str,
        folder: &Path,
        overrides: &Overrides,
        frame: usize,
    ) -> Result<Scene> {
        Ok(json::read_with(
            splats,
            text,
            name,
            folder,
            overrides,
            FrameChoice {
                frame,
                cameras: None,
            },
        )?
        .scene)
    }

    fn seen(
        name_or_path: &OsStr,
        overrides: &Overrides,
        which: FrameChoice,
    ) -> Result<LoadedFrame> {
        let path = Path::new(name_or_path);
        let name = &*path.to_string_lossy();
        if let (Some(text), false) = (builtin::scene(name), path.is_file()) {
            return json::read(text, name, Path::new(""), overrides, which);
        }
        let input_error = |sentence: String| Error::input(format!("{name}: {sentence}"));
        if !path.exists() {
            return Err(input_error(no_such_file(name)));
        }
        if formats::is_json(path) {
            let text =
                input::read_text(path).map_err(|e| input_error(format!("cannot be read: {e}")))?;
            let mut seen = json::read(
                &text,
                name,
                path.parent().unwrap_or(Path::new("")),
                overrides,
                which,
            )?;
            seen.scene.notes.extend(formats::contradiction(path));
            return Ok(seen);
        }
        if formats::reader(path).is_some() {
            return json::of_file(path, name, overrides, which);
        }
        Err(input_error(formats::no_splats(path)))
    }

    /// Text of a `.json` scene or of a built-in one, as for [`Scene::load`]; None if there is none.
    pub fn text(name_or_path: impl AsRef<OsStr>) -> Option<String> {
        let path = Path::new(name_or_path.as_ref());
        if let (Some(text), false) = (path.to_str().and_then(builtin::scene), path.is_file()) {
            return Some(text.to_owned());
        }
        formats::is_json(path).then(|| input::read_text(path).ok())?
    }

    /// Becomes another frame of its sequence.
    fn see(&mut self, camera: Camera, frame: usize) {
        self.camera = camera;
        if let Some(path) = &mut self.path {
            path.frame = frame;
        }
    }

    /// All cameras of the sequence that the scene is a frame of. A scene that is not seen by the
    /// camera of its frame is a single picture.
    pub fn cameras_of_path(&self) -> &[Camera] {
        self.own_path()
            .map_or(std::slice::from_ref(&self.camera), |path| &path.cameras)
    }

    /// The sequence that it is a frame of, if the camera of its frame sees it.
    fn own_path(&self) -> Option<&FramePath> {
        self.path
            .as_ref()
            .filter(|path| path.cameras.get(path.frame) == Some(&self.camera))
    }

    /// Whether it is a frame of a sequence with several.
    pub fn is_of_sequence(&self) -> bool {
        (self.path.as_ref()).is_some_and(|path| path.cameras.len() > 1)
    }

    /// The cameras of the frames before this one; none for a single picture.
    pub fn cameras_before(&self) -> &[Camera] {
        self.own_path()
            .map_or(&[], |path| &path.cameras[..path.frame])
    }

    /// Whether its splats are sorted by depth before they are drawn.
    pub fn is_sorted(&self) -> bool {
        (self.ellipsoids.as_ref()).is_some_and(|ellipsoids| ellipsoids.sorted)
    }

    /// Whether each splat is a Gaussian that is blended separately.
    pub fn is_of_gaussians(&self) -> bool {
        (self.sheets.as_ref()).is_some_and(|sheets| sheets.of == Sheet::Splat)
    }

    /// Rules of sheets on a machine that sums Gaussians, or on one that does not. `None` where
    /// fragments are grouped by depth.
    pub fn sheets_for(&self, sums_gaussians: bool) -> Option<Cow<'_, Sheets>> {
        let own = self.sheets.as_ref()?;
        Some(if sums_gaussians && own.of == Sheet::Splat {
            Cow::Owned(own.summed())
        } else {
            Cow::Borrowed(own)
        })
    }

    /// The least weight that makes a fragment; 0 if all do.
    pub fn least_weight(&self) -> f64 {
        self.sheets
            .as_ref()
            .map_or(0.0, |sheets| sheets.least_weight)
    }

    /// The least opacity with weights that count, if a splat's greatest weight is its opacity and
    /// small weights are dropped.
    pub fn least_opacity(&self) -> Option<f64> {
        let is_peak = self
            .ellipsoids
            .as_ref()
            .is_some_and(|ellipsoids| ellipsoids.amplitude == Amplitude::Peak);
        Some(self.least_weight()).filter(|least| is_peak && *least > 0.0)
    }

    /// Depth σ from which the weights of summed Gaussians are 0, on a machine whose weights fall with
    /// depth. `None` where splats are not Gaussians. The default is twice the greatest depth of a
    /// centre: there, the weight is ½.
    pub fn weight_distance(&self) -> Option<f64> {
        let sheets = self.sheets.as_ref().filter(|_| self.is_of_gaussians())?;
        Some(sheets.weight_distance.unwrap_or_else(|| {
            let view = self.view();
            let depths = (self.splats.iter())
                .map(|splat| view.rotation.row(2).dot(splat.position - view.eye));
            // Gaussians at the near plane and before it are culled.
            2.0 * depths.fold(self.camera.near, f64::max)
        }))
    }

    /// Whether a peak is its splat's opacity times √(det V_r/det V).
    pub fn compensates(&self) -> bool {
        self.kernel.compensate_opacity
            && self
                .ellipsoids
                .as_ref()
                .is_some_and(|ellipsoids| ellipsoids.amplitude == Amplitude::Peak)
    }

    /// The viewing transform (docs/book/algorithm.md §1): `t = rotation · (p − eye)`.
    pub fn view(&self) -> View {
        self.camera.view(&self.image)
    }

    /// Appends a material without reflection. `environment.mirrors` has one entry per material, so
    /// both lists grow together.
    fn add_material(&mut self, material: Material) {
        self.materials.push(material);
        if let Some(environment) = &mut self.environment {
            Arc::make_mut(environment).mirrors.push(Mirror::NONE);
        }
    }
}

impl Camera {
    /// The viewing transform of this camera for a picture.
    pub fn view(&self, image: &Image) -> View {
        let forward = (self.target - self.eye).normalize();
        let right = forward.cross(self.up).normalize();
        let down = forward.cross(right);
        let size_px = [image.width as f64, image.height as f64];
        let half_px = size_px.map(|side| side / 2.0);
        // Scaled by the height, as for a vertical angle of view: pixels keep their shape.
        let picture_px = self.picture_px.unwrap_or(size_px);
        let scale = size_px[1] / picture_px[1];
        View {
            rotation: DMat3::from_cols(right, down, forward).transpose(),
            eye: self.eye,
            focal_px: self.focal_px.map_or(
                [half_px[1] / libm::tan(self.fov_y_degrees.to_radians() / 2.0); 2],
                |focal_px| focal_px.map(|px| scale * px),
            ),
            half_px,
            centre_px: self.centre_px.map_or(half_px, |centre| {
                [0, 1].map(|i| half_px[i] + scale * (centre[i] - picture_px[i] / 2.0))
            }),
        }
    }
}

/// Half a sentence about a name that is neither a file nor a built-in scene.
fn no_such_file(name: &str) -> String {
    let names: Vec<&str> = builtin::names().collect();
    let nearest = validate::in_brackets(name, &names);
    format!(
        "no such file, and no built-in scene either; built in are {}{nearest}",
        names.join(", ")
    )
}

/// The unit vector; None if the vector is zero or not finite.
fn unit(vector: DVec3) -> Option<DVec3> {
    let longest = vector.abs().max_element();
    // Divided first: squares of very long or very short vectors do not fit f64.
    (vector.is_finite() && longest > 0.0).then(|| (vector / longest).normalize())
}

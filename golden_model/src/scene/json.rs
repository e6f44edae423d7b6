//! JSON: reads a scene file (docs/book/scenes.md) and fills in what it leaves out.
//!
//! The types below are the file format: the JSON Schema is derived from them, and a file is checked
//! against the schema before it is read into them. Rules that a schema cannot express (directions
//! of length 0, indices out of range) are checked afterwards.

use super::cells::{Cells, Sampled, Slices};
use super::gaussians::{Gaussian, Gaussians};
use super::volume::{Arrays, RawDescription, Samples};
use super::voxels::{Classification, MOST_OPACITY, TransferPoint, Voxels, depth_of_layer};
use super::{
    Amplitude, Camera, Ellipsoids, FramePath, Harmonics, Image, Kernel, LEAST_RADIUS, Light,
    Material, Opacity, Orientation, Overrides, Scene, Sheet, Sheets, Splat, Surface,
};
use super::{Environment, Mirror, environment::BuiltinEnvironment};
use super::{
    builtin::{self, Builtin, SplatOrder},
    camera::Ball,
    camera_file::CameraFile,
    fields,
    formats::{self, Reader, Splats},
    gaussians, memory, neighbours,
    path::{LAST_FRAME, MOST_FRAMES},
    placement::Placement,
    ply,
    tree::{
        MOST_CHILDREN, Tree,
        cut::{Budget, Detail, DetailRules, DrawOrder},
    },
    unit, volume,
};
use crate::error::{Error, Result};
use crate::input;
use crate::output::{colour::srgb_decode, text::one_line};
use crate::scene::{Filter, gaussian_cutoff, strict_json, validate};
use glam::{DQuat, DVec3};
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::Value;
use std::f64::consts::TAU;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The default of ε is this many times the median radius: it suits three scans
/// (docs/book/algorithm.md §2).
const Z_THRESHOLD_OF_RADIUS: f64 = 4.0;
/// The default near plane is at this part of the distance from the eye to its target.
pub(super) const NEAR_OF_DISTANCE: f64 = 1e-3;
/// Longest side of a picture, pixels; like [`MOST_PIXELS`], a limit that a desktop computer can
/// hold a few times.
const LONGEST_SIDE: usize = 16384;
/// Most pixels of a picture.
pub const MOST_PIXELS: usize = 1 << 25;
/// Least radius of a volume's kernels, in steps of the grid. The optical depth through the centre
/// of a kernel that represents a whole cell of opacity 1 is 1/(2πr²), here 1.6·10¹¹; with thinner
/// kernels a volume is points in empty space.
const LEAST_STEPS: f64 = 1e-6;

/// Default limit of a Gaussian's opacity.
const MOST_WEIGHT: f64 = 0.99;
/// Flatness of discs that are drawn together with ellipsoids: the greatest that a scene may choose.
const FLATTEST: f64 = 1e6;

/// A scene: splats, and how they are viewed. All numbers in world units, linear light and degrees.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "splatsim scene")]
struct SceneFields {
    /// Source of the splats.
    splats: Source,
    /// The eye. Missing fields are chosen so that the splats fill the picture. `cameras` or
    /// `camera_path` may be used instead.
    camera: Option<CameraFields>,
    /// One camera per frame: a sequence. Other defaults of a scene, such as normals and the light,
    /// are chosen for the first camera.
    #[schemars(length(min = 1, max = MOST_FRAMES))]
    cameras: Option<Vec<CameraFields>>,
    /// A sequence along a path.
    camera_path: Option<PathFields>,
    /// The picture.
    #[serde(default)]
    image: ImageFields,
    /// The footprint.
    #[serde(default)]
    kernel: KernelFields,
    /// Rules by which fragments become surfaces.
    #[serde(default)]
    surface: SurfaceFields,
    /// Compositing of a volume's slices, or of Gaussians.
    #[serde(default)]
    sheets: SheetFields,
    /// Draws a cut of a tree of the splats instead of all splats, which is the default. Discs only.
    level_of_detail: Option<DetailFields>,
    /// Directional lights; default: one white light from behind the eye.
    lights: Option<Vec<LightFields>>,
    /// Materials that splats' `material` refers to; default: those of the built-in sources,
    /// otherwise one Blinn-Phong.
    #[schemars(length(min = 1))]
    materials: Option<Vec<MaterialFields>>,
    /// Light from all directions, reflected by materials with `reflect`.
    environment: Option<EnvironmentFields>,
}

/// A picture of all directions, or built-in surroundings.
#[derive(Deserialize, JsonSchema)]
#[serde(untagged)]
enum EnvironmentFields {
    Builtin(BuiltinSurroundings),
    File(EnvironmentFile),
}

/// Built-in surroundings.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct BuiltinSurroundings {
    builtin: BuiltinEnvironment,
}

/// A latitude-longitude picture, twice as wide as high: PNG (sRGB), Radiance or EXR (linear light).
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct EnvironmentFile {
    /// Path of the picture, relative to the scene file. Up is y; its centre is towards −z.
    file: PathBuf,
    /// Factor on all light.
    #[serde(default = "one")]
    #[schemars(range(min = 0, max = 1e6))]
    scale: f64,
}

/// A splat, a file, a built-in cloud, a volume, Gaussians, any of these at another place, or an
/// array of all these.
#[derive(Deserialize, JsonSchema)]
#[serde(untagged)]
enum Source {
    // First, because variants are tried in this order and there may be millions of splats.
    Splat(SplatFields),
    File(FileSource),
    Builtin(BuiltinSource),
    Volume(VolumeSource),
    Gaussians(GaussianSource),
    #[serde(deserialize_with = "placed")]
    Placed(PlacedSource),
    Several(Vec<Source>),
    /// Splats that are not in the text.
    #[serde(skip)]
    Given(Vec<Splat>),
}

/// Accepts objects only: an array would be tried as its fields one by one, and thus twice at every
/// depth of arrays.
fn placed<'de, D: serde::Deserializer<'de>>(
    from: D,
) -> std::result::Result<PlacedSource, D::Error> {
    let object = serde_json::Map::deserialize(from)?;
    PlacedSource::deserialize(serde_json::Value::Object(object)).map_err(serde::de::Error::custom)
}

/// Sources at another place.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct PlacedSource {
    splats: Box<Source>,
    place: PlaceFields,
}

/// A placement: scaled about the origin, then rotated about it, then moved.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct PlaceFields {
    /// Factor on all positions and radii.
    #[schemars(range(min = 1e-30, max = 1e30))]
    scale: f64,
    /// Axis of rotation, of any length except 0.
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    axis: [f64; 3],
    /// Angle, counter-clockwise as seen from the tip of the axis.
    #[schemars(range(min = -360, max = 360))]
    degrees: f64,
    /// Translation.
    #[serde(rename = "move")]
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    way: [f64; 3],
}

/// Points, trained Gaussians or a volume, by the content of the file.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct FileSource {
    /// Path of the file, relative to the scene file. Trained Gaussians: rotations are quaternions,
    /// real part first (`rot_0` is w), of any length except 0; `f_rest` has all coefficients of
    /// red, then of green, then of blue.
    file: PathBuf,
    /// Index into `materials`.
    #[serde(default)]
    #[schemars(range(max = u32::MAX))]
    material: u32,
    /// Factor on all radii, from the file or fitted.
    #[serde(default = "one")]
    #[schemars(range(min = 1e-30, max = 1e30))]
    radius_scale: f64,
    /// Factor on all opacities.
    #[serde(default = "one")]
    #[schemars(range(min = 0, max = 1))]
    opacity: f64,
}

/// A scalar field on a grid or at points, drawn through a transfer function or as an isosurface.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct VolumeSource {
    volume: VolumeFile,
    /// Name of the array of samples in a file of points; default: the one that the file names, else
    /// the first of one component. For `.vti`, `.vtr`, `.vts`, `.vtu` and `.vtp`.
    array: Option<String>,
    /// Name of the array with the variance of each point's kernel, world units²: 1 component (the
    /// same in all directions), 3 (along x, y and z) or 6 (xx, yy, zz, xy, yz and xz). Default:
    /// from the distance to the 6 nearest points. For `.vtu` and `.vtp`.
    variance: Option<String>,
    /// Thickness of the layer that `opacity` refers to, world units; default: the shortest step of
    /// the grid, or, if steps differ, the median of the samples' shortest steps.
    #[schemars(range(min = 1e-30, max = 1e30))]
    layer: Option<f64>,
    /// Colour and opacity by value, in ascending order; between two values colour and optical
    /// depth, −ln(1 − opacity), are linear. Default: a white ramp.
    #[schemars(length(min = 1))]
    transfer: Option<Vec<TransferFields>>,
    /// Factor on optical depth by gradient magnitude, in ascending order; default: 1.
    #[serde(default)]
    gradient: Vec<GradientFields>,
    /// Standard deviation of the kernel along each axis, in steps of the grid along it, or in the
    /// mean distance to the nearest points. With kernels thinner than the least, a volume is
    /// invisible. With `variance`, which gives the width of kernels, a standard deviation is this
    /// part of a step.
    #[serde(default = "kernel_steps")]
    #[schemars(range(min = 1e-6, max = 100))]
    radius: f64,
    /// Draws the surface at which the field has this value, instead of using the transfer function.
    /// Not for `.vtr`, `.vts`, `.vtu` and `.vtp`.
    #[schemars(range(min = -1e30, max = 1e30))]
    isovalue: Option<f64>,
    /// Factor by which kernels are flatter along the gradient; with an infinite factor they are
    /// discs. For `isovalue`.
    #[serde(default = "flat")]
    #[schemars(range(min = 1, max = 1e6))]
    flatten: f64,
    /// Index into `materials`.
    #[serde(default)]
    #[schemars(range(max = u32::MAX))]
    material: u32,
}

/// Built-in Gaussians.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct GaussianSource {
    gaussians: BuiltinGaussians,
    #[serde(default = "gaussian_count")]
    #[schemars(range(min = 1, max = 67_108_864))]
    count: usize,
    /// Degree of the spherical harmonics of the colours; 0: the same colour from all directions.
    #[serde(default)]
    #[schemars(range(max = 3))]
    degree: u8,
}

#[derive(Deserialize, JsonSchema, Clone, Copy)]
#[serde(rename_all = "kebab-case")]
enum BuiltinGaussians {
    /// Flowers: flat petals, thin stems, and a haze behind them.
    Bouquet,
    /// A street between houses and trees, with the statistics of trained scenes.
    City,
}

/// A file of a known format, relative to the scene file; a file of plain samples; or a built-in
/// field.
#[derive(Deserialize, JsonSchema)]
#[serde(untagged)]
enum VolumeFile {
    Path(PathBuf),
    Builtin(BuiltinField),
    Raw(RawDescription),
}

/// A built-in field.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct BuiltinField {
    builtin: fields::BuiltinFieldName,
    /// Samples along each axis.
    #[serde(default = "field_samples")]
    #[schemars(range(min = 2, max = 512))]
    samples: usize,
}

/// A value of the field with its colour and opacity.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct TransferFields {
    #[schemars(range(min = -1e30, max = 1e30))]
    value: f64,
    /// Linear light.
    #[serde(default = "white")]
    #[schemars(inner(range(min = 0, max = 1)))]
    rgb: [f64; 3],
    /// Part of the light behind a layer that does not pass through it. The layer has the thickness
    /// of the grid's shortest step, or `layer`. 1 counts as 1 − 2⁻¹⁶.
    #[schemars(range(min = 0, max = 1))]
    opacity: f64,
}

/// A gradient magnitude, in values per world unit, and a factor on optical depth.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct GradientFields {
    #[schemars(range(min = 0, max = 1e30))]
    magnitude: f64,
    #[schemars(range(min = 0, max = 1))]
    factor: f64,
}

/// Order in which sheets are blended.
#[derive(Deserialize, JsonSchema, Clone, Copy, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum SheetOrder {
    FrontToBack,
    BackToFront,
}

/// Opacity of an optical depth x: x, limited to 1; or 1 − e^(−x).
#[derive(Deserialize, JsonSchema, Clone, Copy, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum OpacityLaw {
    Linear,
    Exponential,
}

#[derive(Deserialize, JsonSchema, Default)]
#[serde(deny_unknown_fields, default)]
struct SheetFields {
    /// Default: front-to-back, which is the only order for Gaussians.
    order: Option<SheetOrder>,
    /// Default: exponential. For volumes.
    opacity: Option<OpacityLaw>,
    /// A pixel whose transmittance is below this accepts no more; default: 1/1024 for volumes, 1e-4
    /// for Gaussians.
    #[schemars(range(min = 0), extend("exclusiveMaximum" = 1))]
    stop: Option<f64>,
    /// Whether the contribution that stops a pixel is blended; default: true for volumes, false for
    /// Gaussians.
    keep_last: Option<bool>,
    /// Smaller weights make no fragment; default: 0 for volumes, 1/255 for Gaussians.
    #[schemars(range(min = 0, max = 1))]
    least_weight: Option<f64>,
    /// Upper limit of a Gaussian's weight; default: 0.99.
    #[schemars(range(max = 1), extend("exclusiveMinimum" = 0))]
    most_weight: Option<f64>,
    /// Depth σ from which a Gaussian has no weight, world units, on a machine that sums Gaussians
    /// with weights that fall with depth (`sort.depth_weight`); default: twice the greatest depth of
    /// a Gaussian's centre, in each view.
    #[schemars(range(max = 1e30), extend("exclusiveMinimum" = 0))]
    weight_distance: Option<f64>,
}

/// A built-in cloud.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct BuiltinSource {
    builtin: Builtin,
    /// Number of splats; default: enough for a closed surface at 512×512.
    #[schemars(range(min = 1, max = 67_108_864))]
    count: Option<usize>,
    #[serde(default)]
    order: SplatOrder,
    /// Seed of the random order.
    #[serde(default)]
    seed: u64,
}

/// One splat.
#[derive(Deserialize, JsonSchema, Clone)]
#[serde(deny_unknown_fields)]
struct SplatFields {
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    position: [f64; 3],
    /// Of any length except 0; default: fitted to the nearest splats of the same array.
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    normal: Option<[f64; 3]>,
    /// Standard deviation of the kernel; default: mean distance to the 6 nearest splats of the same
    /// array.
    #[schemars(range(min = 1e-30, max = 1e30))]
    radius: Option<f64>,
    /// Linear light.
    #[serde(default = "grey")]
    #[schemars(inner(range(min = 0, max = 1)))]
    rgb: [f64; 3],
    #[serde(default = "one")]
    #[schemars(range(min = 0, max = 1))]
    opacity: f64,
    /// Index into `materials`.
    #[serde(default)]
    #[schemars(range(max = u32::MAX))]
    material: u32,
}

#[derive(Deserialize, JsonSchema, Clone, Default)]
#[serde(deny_unknown_fields, default)]
pub(super) struct CameraFields {
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    eye: Option<[f64; 3]>,
    /// Point at the centre of the picture.
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    target: Option<[f64; 3]>,
    /// Up direction in the picture; default: y (for Gaussians −y), or z if the eye looks along y.
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    up: Option<[f64; 3]>,
    /// Full vertical angle of view; default: 45, or the equivalent of `focal_px`. With narrower
    /// angles than the least, coordinates in the picture exceed f64.
    #[schemars(range(min = 1e-6), extend("exclusiveMaximum" = 180))]
    fov_y_degrees: Option<f64>,
    /// Focal lengths along x and y, in pixels of a picture of `picture_px`. If they differ, pixels
    /// are not square.
    #[schemars(inner(range(min = 1e-3, max = 1e9)))]
    focal_px: Option<[f64; 2]>,
    /// Principal point: intersection of the camera's axis with a picture of `picture_px`, pixels
    /// from its top left corner (x to the right, y down; the centre of the first pixel is 0.5,
    /// 0.5). Default: the centre.
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    centre_px: Option<[f64; 2]>,
    /// Width and height that `focal_px` and `centre_px` refer to; default: those of `image`. In a
    /// picture of another size (`--size`) both are scaled by its height, about its centre.
    #[schemars(inner(range(min = 1, max = 1e6)))]
    picture_px: Option<[f64; 2]>,
    /// Splats whose centres are at or nearer than this depth are not drawn, including Gaussians;
    /// default: a thousandth of the distance to the target.
    #[schemars(range(max = 1e30), extend("exclusiveMinimum" = 0))]
    near: Option<f64>,
}

/// Cameras between key frames, or a slow pan.
#[derive(Deserialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum PathFields {
    Keys(KeyedFields),
    Pan(PanFields),
}

/// A camera for every frame, interpolated between key frames.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct KeyedFields {
    /// In the order of their frames. The camera rests before the first and after the last.
    #[schemars(length(min = 1, max = MOST_FRAMES))]
    pub keys: Vec<KeyFields>,
    /// Number of frames; default: up to the last key's.
    #[schemars(range(min = 1, max = MOST_FRAMES))]
    pub frames: Option<usize>,
    /// Interpolation between two keys.
    #[serde(default)]
    pub interpolation: Interpolation,
}

/// Interpolation between two keys of eye, target, up and angle of view; the near plane is always
/// linear.
#[derive(Deserialize, JsonSchema, Clone, Copy, Default, PartialEq)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Interpolation {
    /// Cubic Hermite curves with the slopes of Catmull and Rom, (next − last)/(frames between
    /// them): smooth at keys.
    #[default]
    Smooth,
    /// Straight lines.
    Linear,
}

/// The camera at a frame, otherwise like `camera`.
#[derive(Deserialize, JsonSchema, Clone)]
#[serde(deny_unknown_fields)]
pub(super) struct KeyFields {
    /// The frame, greater than that of the previous key.
    #[schemars(range(max = LAST_FRAME))]
    pub at: usize,
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    eye: Option<[f64; 3]>,
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    target: Option<[f64; 3]>,
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    up: Option<[f64; 3]>,
    #[serde(default = "default_fov")]
    #[schemars(range(min = 1e-6), extend("exclusiveMaximum" = 180))]
    fov_y_degrees: f64,
    #[schemars(range(max = 1e30), extend("exclusiveMinimum" = 0))]
    near: Option<f64>,
}

impl KeyFields {
    fn camera(&self) -> CameraFields {
        let &KeyFields {
            at: _,
            eye,
            target,
            up,
            fov_y_degrees,
            near,
        } = self;
        CameraFields {
            eye,
            target,
            up,
            fov_y_degrees: Some(fov_y_degrees),
            near,
            ..CameraFields::default()
        }
    }
}

/// A pan to the right: the eye is fixed, and the picture moves to the left by the same amount per
/// frame.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct PanFields {
    /// Movement of the centre of the first picture, pixels per frame.
    #[schemars(range(min = -1e4, max = 1e4))]
    pub pan_pixels: f64,
    /// Number of frames.
    #[schemars(range(min = 1, max = MOST_FRAMES))]
    pub frames: usize,
    /// Camera of the first frame.
    #[serde(default)]
    camera: CameraFields,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct ImageFields {
    #[schemars(range(min = 1, max = LONGEST_SIDE))]
    width: usize,
    #[schemars(range(min = 1, max = LONGEST_SIDE))]
    height: usize,
    /// Linear RGB and straight alpha.
    #[schemars(inner(range(min = 0, max = 1)))]
    background: [f64; 4],
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct KernelFields {
    /// Fragments exist if the radial index is below this; default: 2 for surfaces, 4 for volumes,
    /// 2·ln 255 = 11.0825 for Gaussians, at which the weight of an opaque one is 1/255.
    #[schemars(range(max = 100), extend("exclusiveMinimum" = 0))]
    cutoff: Option<f64>,
    /// Variance of the low-pass filter, pixel²; default: 1, for Gaussians 0.3, without making them
    /// fainter: their opacity is that of the peak.
    #[schemars(range(min = 0, max = 1e6))]
    low_pass: Option<f64>,
    /// Whether a Gaussian is made fainter in proportion to its widening by the low-pass filter: its
    /// peak is then opacity · √(det V_r/det V), as required by Gaussians trained with
    /// Mip-Splatting's filter. Discs and volumes always have that factor. Default: as in the file
    /// of the Gaussians (`comment SplatRenderMode: mip` of a PLY, the flag of a `.spz`), else
    /// false.
    compensate_opacity: Option<bool>,
    /// Filtering of a volume's kernels.
    low_pass_by: LowPass,
    /// Filter of a splat; filters other than the papers' are for comparison.
    filter: FilterField,
    /// Splats whose centres are farther to the side than this, in half pictures, are not drawn;
    /// default: 1.5, for Gaussians 100.
    #[schemars(range(max = 100), extend("exclusiveMinimum" = 0))]
    guard: Option<f64>,
    /// An ellipsoid farther to the side than this, in half pictures, is projected as if it were at
    /// this limit.
    #[schemars(range(max = 100), extend("exclusiveMinimum" = 0))]
    jacobian: f64,
}

#[derive(Deserialize, JsonSchema, Clone, Copy, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum FilterField {
    /// The projected ellipse with the low-pass filter, as in the papers.
    Ewa,
    /// The ellipse without the filter: as if `low_pass` were 0.
    Elliptical,
    /// A circle with the radius of the ellipse's major axis, with the filter. Discs only; it is
    /// drawn only by `golden` and `ideal`, in the example `filters`.
    Circular,
    /// Heckbert's source-space EWA: the filter is mapped to the splat's plane along each pixel's
    /// ray. Discs only; drawn like `circular`.
    SourceEwa,
}

#[derive(Deserialize, JsonSchema, Clone, Copy, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum LowPass {
    /// Each footprint is convolved with the filter (EWA §6.2).
    Convolution,
    /// Each kernel is enlarged, equally in all directions, until its thinnest axis is as wide as
    /// the filter (Swan et al. 1997).
    Scaling,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct SurfaceFields {
    /// Contributions with a smaller difference in depth belong together; default: 4 × the median
    /// radius.
    #[schemars(range(max = 1e30), extend("exclusiveMinimum" = 0))]
    z_threshold: Option<f64>,
    /// Weight sum from which a pixel counts as fully covered.
    #[schemars(range(max = 1e30), extend("exclusiveMinimum" = 0))]
    coverage_threshold: f64,
    /// Drop splats whose normal points away from the eye.
    cull_backfaces: bool,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct LightFields {
    /// From the surface towards the light, world space, of any length except 0.
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    direction: [f64; 3],
    /// Linear light; may be brighter than 1.
    #[serde(default = "white")]
    #[schemars(inner(range(min = 0, max = 1e6)))]
    rgb: [f64; 3],
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct MaterialFields {
    /// The colour without lighting; the other fields are then ignored.
    unlit: bool,
    #[schemars(range(min = 0, max = 1e6))]
    ambient: f64,
    #[schemars(range(min = 0, max = 1e6))]
    diffuse: f64,
    #[schemars(range(min = 0, max = 1e6))]
    specular: f64,
    #[schemars(range(min = 0, max = 1e6))]
    shininess: f64,
    /// Reflected part of the light that leaves the surface; also for unlit materials. Requires
    /// `environment`.
    #[schemars(range(min = 0, max = 1))]
    reflect: f64,
    /// Factor on the reflected light.
    #[schemars(inner(range(min = 0, max = 1)))]
    tint: [f64; 3],
}

/// Selection from a tree of splats (docs/book/level-of-detail.md).
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct DetailFields {
    /// The coarsest nodes are drawn whose spheres have at most this diameter on the screen, pixels;
    /// 0 draws every splat.
    #[schemars(range(min = 0, max = 1e6))]
    pixels: f64,
    /// Order of drawing; default: `walk`, or with a budget `coarse-to-fine`.
    order: Option<DetailOrder>,
    /// Leaves out nodes outside the picture and, if `cull_backfaces` is true, those whose normals
    /// all face away.
    cull: bool,
    /// Number of nodes whose children the traversal unit requests at a time.
    #[schemars(range(min = 1, max = 1024))]
    ahead: usize,
    /// Most children per node if the tree is built from splats; a tree file has its own number.
    #[schemars(range(min = 2, max = MOST_CHILDREN))]
    children: usize,
    /// Limits per frame: the largest nodes are replaced by their children first, until there is no
    /// room for the next.
    budget: BudgetFields,
}

impl Default for DetailFields {
    fn default() -> Self {
        DetailFields {
            pixels: 1.0,
            order: None,
            cull: true,
            ahead: 8,
            children: 4,
            budget: BudgetFields::default(),
        }
    }
}

#[derive(Deserialize, JsonSchema, Clone, Copy, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum DetailOrder {
    /// In the order of the traversal.
    Walk,
    /// The largest on the screen first.
    CoarseToFine,
}

/// Limits per frame; by default there is none.
#[derive(Deserialize, JsonSchema, Default)]
#[serde(deny_unknown_fields, default)]
struct BudgetFields {
    /// Splats that are drawn.
    #[schemars(range(min = 1))]
    splats: Option<u64>,
    /// Bytes of nodes that are read from memory, in the machine's formats.
    #[schemars(range(min = 1))]
    bytes: Option<u64>,
    /// Cycles of the frame on the machine.
    #[schemars(range(min = 1))]
    cycles: Option<u64>,
}

impl DetailFields {
    fn rules(&self) -> DetailRules {
        let BudgetFields {
            splats,
            bytes,
            cycles,
        } = self.budget;
        let usual = if splats.or(bytes).or(cycles).is_some() {
            DrawOrder::CoarseToFine
        } else {
            DrawOrder::Walk
        };
        DetailRules {
            pixels: self.pixels,
            order: match self.order {
                Some(DetailOrder::Walk) => DrawOrder::Walk,
                Some(DetailOrder::CoarseToFine) => DrawOrder::CoarseToFine,
                None => usual,
            },
            culls: self.cull,
            ahead: self.ahead,
            budget: Budget {
                splats,
                bytes,
                cycles,
            },
        }
    }
}

fn one() -> f64 {
    1.0
}

fn default_fov() -> f64 {
    45.0
}

fn kernel_steps() -> f64 {
    0.7
}

fn flat() -> f64 {
    100.0
}

fn field_samples() -> usize {
    96
}

fn gaussian_count() -> usize {
    40_000
}

fn grey() -> [f64; 3] {
    [0.5; 3]
}

fn white() -> [f64; 3] {
    [1.0; 3]
}

impl Default for ImageFields {
    fn default() -> Self {
        ImageFields {
            width: 512,
            height: 512,
            background: [0.0; 4],
        }
    }
}

impl Default for KernelFields {
    fn default() -> Self {
        KernelFields {
            cutoff: None,
            low_pass: None,
            compensate_opacity: None,
            low_pass_by: LowPass::Convolution,
            filter: FilterField::Ewa,
            guard: None,
            jacobian: 1.3,
        }
    }
}

impl Default for SurfaceFields {
    fn default() -> Self {
        SurfaceFields {
            z_threshold: None,
            coverage_threshold: 0.4,
            cull_backfaces: false,
        }
    }
}

impl Default for PlaceFields {
    fn default() -> Self {
        PlaceFields {
            scale: 1.0,
            axis: [0.0, 1.0, 0.0],
            degrees: 0.0,
            way: [0.0; 3],
        }
    }
}

impl Default for MaterialFields {
    fn default() -> Self {
        MaterialFields {
            unlit: false,
            ambient: 0.15,
            diffuse: 0.8,
            specular: 0.3,
            shininess: 32.0,
            reflect: 0.0,
            tint: [1.0; 3],
        }
    }
}

/// The JSON Schema of a scene file.
pub fn schema() -> Value {
    schemars::schema_for!(SceneFields).to_value()
}

/// One frame of a scene.
pub(super) struct LoadedFrame {
    pub scene: Scene,
    /// One camera per frame.
    pub cameras: Vec<Camera>,
    /// Whether cameras were given, even a single one: then it is a sequence.
    pub is_sequence: bool,
    /// Whether frames differ only in the camera. Splats of volumes and Gaussians depend on the eye
    /// in order and colour.
    pub shares_splats: bool,
}

/// Selection of a frame, and a file of cameras that replaces the scene's own.
#[derive(Clone, Copy)]
pub(super) struct FrameChoice<'a> {
    pub frame: usize,
    pub cameras: Option<&'a CameraFile>,
}

/// Reads a scene file's text. Paths in it are relative to `folder`; `name` begins every error.
pub(super) fn read(
    text: &str,
    name: &str,
    folder: &Path,
    overrides: &Overrides,
    which: FrameChoice,
) -> Result<LoadedFrame> {
    build(fields(text, name)?, name, folder, overrides, which)
}

/// Reads a scene file's text, with these splats instead of its own. A normal or a radius of 0 is
/// fitted.
pub(super) fn read_with(
    splats: Vec<Splat>,
    text: &str,
    name: &str,
    folder: &Path,
    overrides: &Overrides,
    which: FrameChoice,
) -> Result<LoadedFrame> {
    let mut fields = fields(text, name)?;
    fields.splats = Source::Given(splats);
    build(fields, name, folder, overrides, which)
}

fn fields(text: &str, name: &str) -> Result<SceneFields> {
    let input_error = |sentence: String| Error::input(format!("{name}: {sentence}"));
    let value = strict_json::parse(text).map_err(input_error)?;
    validate::check(&value, &schema()).map_err(|violation| input_error(violation.to_string()))?;
    serde_json::from_value(value).map_err(|e| input_error(e.to_string()))
}

/// Makes the scene of a file of splats, with defaults for all else; `name` begins every error.
pub(super) fn of_file(
    file: &Path,
    name: &str,
    overrides: &Overrides,
    which: FrameChoice,
) -> Result<LoadedFrame> {
    let fields = SceneFields {
        splats: Source::File(FileSource {
            file: file.to_owned(),
            material: 0,
            radius_scale: 1.0,
            opacity: 1.0,
        }),
        camera: None,
        cameras: None,
        camera_path: None,
        image: ImageFields::default(),
        kernel: KernelFields::default(),
        surface: SurfaceFields::default(),
        sheets: SheetFields::default(),
        level_of_detail: None,
        lights: None,
        materials: None,
        environment: None,
    };
    build(fields, name, Path::new(""), overrides, which)
}

fn build(
    fields: SceneFields,
    name: &str,
    folder: &Path,
    overrides: &Overrides,
    which: FrameChoice,
) -> Result<LoadedFrame> {
    let input_error = |sentence: String| Error::input(format!("{name}: {sentence}"));
    let environment = environment(&fields, folder).map_err(input_error)?;
    let image = image(&fields.image, name, overrides, which.cameras)?;
    fields.check_cameras().map_err(input_error)?;
    fields.splats.check_memory().map_err(input_error)?;
    let mut gathered = Gathered::new(name, folder, &fields);
    gathered.add(&fields.splats, "splats")?;
    if gathered.splats.is_empty() {
        return Err(input_error(gathered.nothing().into()));
    }
    let kind = gathered.kind();
    if kind == SceneKind::Mixed {
        let count = gathered.splats.len() as u64;
        memory::check(count, "splats", memory::GAUSSIAN_BYTES)
            .map_err(|sentence| input_error(format!("splats: {sentence}")))?;
    }
    // Training programs use y down, as for their cameras.
    let up = if kind == SceneKind::Gaussians {
        DVec3::NEG_Y
    } else {
        DVec3::Y
    };
    let cameras = match which.cameras {
        Some(file) => file.cameras(&image, &gathered.splats)?,
        None => fields
            .seen_by(up, &image, &gathered.splats)
            .map_err(input_error)?,
    };
    let Some(&camera) = cameras.get(which.frame) else {
        let right = if cameras.len() == 1 {
            "only 0 is right".into()
        } else {
            format!("0 to {} are right", cameras.len() - 1)
        };
        return Err(input_error(format!(
            "has no frame {} (--frame): {right}",
            which.frame
        )));
    };
    // Everything else that depends on the eye uses the first one: the world is fixed while the eye
    // moves.
    if which.cameras.is_none() && fields.frames_itself() {
        let (missed, all) = (
            cameras[0].misses(&image, &gathered.splats),
            gathered.splats.len(),
        );
        if missed > 0 {
            gathered.notes.push(format!(
                "{missed} of {all} splats are outside the chosen view; set `camera` to show them"
            ));
        }
    }
    gathered
        .notes
        .extend(which.cameras.iter().flat_map(|file| &file.notes).cloned());
    gathered.complete(cameras[0].eye);
    let lights = lights(fields.lights, &cameras[0]).map_err(input_error)?;
    let surface = surface(&fields.surface, &gathered.splats);
    if [SceneKind::Volume, SceneKind::Mixed].contains(&kind) && surface.coverage_threshold > 1.0 {
        return Err(input_error(format!(
            "surface.coverage_threshold is {}; a volume's splats are lit with weight 1, so at most 1 is right",
            surface.coverage_threshold
        )));
    }
    if fields.kernel.low_pass_by == LowPass::Scaling && kind != SceneKind::Volume {
        return Err(input_error(
            "kernel.low_pass_by is \"scaling\", and only the kernels of a volume are scaled".into(),
        ));
    }
    if fields.kernel.filter == FilterField::Elliptical
        && fields
            .kernel
            .low_pass
            .is_some_and(|variance| variance > 0.0)
    {
        return Err(input_error("kernel.filter is \"elliptical\", which has no low-pass filter, and kernel.low_pass is not 0".into()));
    }
    if fields.kernel.compensate_opacity == Some(true)
        && ![SceneKind::Gaussians, SceneKind::Mixed].contains(&kind)
    {
        return Err(input_error(
            "kernel.compensate_opacity is true, and discs and volumes have that factor already; it is for Gaussians".into(),
        ));
    }
    let of_discs = [FilterField::Circular, FilterField::SourceEwa];
    if of_discs.contains(&fields.kernel.filter) && !gathered.media.is_empty() {
        let name = if fields.kernel.filter == FilterField::Circular {
            "circular"
        } else {
            "source-ewa"
        };
        return Err(input_error(format!(
            "kernel.filter is \"{name}\", which is of discs, and these splats are none"
        )));
    }
    if surface.cull_backfaces && kind != SceneKind::Surfaces {
        return Err(input_error(
            "surface.cull_backfaces is true, and neither voxels nor Gaussians have a back".into(),
        ));
    }
    if gathered.comes_by_depth() && fields.sheets.order == Some(SheetOrder::BackToFront) {
        return Err(input_error("sheets.order is \"back-to-front\", and samples that are sorted by depth come front-to-back".into()));
    }
    if kind == SceneKind::Gaussians {
        if fields.sheets.order == Some(SheetOrder::BackToFront) {
            return Err(input_error("sheets.order is \"back-to-front\", and Gaussians come front-to-back: leave it out; a machine with fragment.sheets.composite, such as cubed, sorts them from the back by itself".into()));
        }
        if fields.sheets.opacity == Some(OpacityLaw::Exponential) {
            return Err(input_error(
                "sheets.opacity is \"exponential\", and the opacity of a Gaussian is its weight: \"linear\", or leave it out".into(),
            ));
        }
    }
    if fields.sheets.weight_distance.is_some() && kind != SceneKind::Gaussians {
        return Err(input_error(
            "sheets.weight_distance is given, and only the weights of Gaussians fall with depth: leave it out".into(),
        ));
    }
    let detail = match &fields.level_of_detail {
        None => None,
        Some(_) if !gathered.media.is_empty() => {
            return Err(input_error("level_of_detail is of discs, and these splats are voxels, Gaussians or an isosurface".into()));
        }
        Some(fields) => Some(gathered.detail(fields).map_err(input_error)?),
    };
    let compensate_opacity = kind == SceneKind::Gaussians
        && fields
            .kernel
            .compensate_opacity
            .unwrap_or_else(|| gathered.compensates());
    let Gathered {
        splats,
        materials,
        notes,
        media,
        ..
    } = gathered;
    // A scene's name may become a comment of one line.
    let name = one_line(
        &Path::new(name)
            .file_name()
            .unwrap_or_default()
            .to_string_lossy(),
    );
    let kernel = Kernel {
        compensate_opacity,
        ..kernel(&fields.kernel, kind)
    };
    let mut scene = Scene {
        name,
        splats,
        camera,
        image,
        kernel,
        ellipsoids: None,
        sheets: None,
        surface,
        lights,
        materials,
        environment,
        detail,
        path: None,
        notes,
    };
    match kind {
        SceneKind::Mixed => mixed(media, &fields.sheets, &mut scene),
        SceneKind::Surfaces => surfaces(media, &mut scene),
        SceneKind::Volume | SceneKind::Gaussians => media
            .into_iter()
            .for_each(|part| part.medium.complete(&fields.sheets, &mut scene)),
    }
    if fields.kernel.low_pass_by == LowPass::Scaling {
        scene.scale_kernels();
    }
    let mut scene = scene.cut();
    let is_sequence =
        which.cameras.is_some() || fields.cameras.is_some() || fields.camera_path.is_some();
    scene.path = is_sequence.then(|| FramePath {
        cameras: Arc::new(cameras.clone()),
        frame: which.frame,
    });
    // With a tree, each camera has its own cut.
    let shares_splats = kind == SceneKind::Surfaces && scene.detail.is_none();
    Ok(LoadedFrame {
        scene,
        cameras,
        is_sequence,
        shares_splats,
    })
}

/// Surroundings and the materials' reflections of them; None if no material reflects.
fn environment(
    fields: &SceneFields,
    folder: &Path,
) -> std::result::Result<Option<Arc<Environment>>, String> {
    let materials = fields.materials.as_deref().unwrap_or_default();
    let shiny = materials.iter().position(|material| material.reflect > 0.0);
    let mut environment = match (&fields.environment, shiny) {
        (None, None) => return Ok(None),
        (None, Some(material)) => {
            return Err(format!(
                "materials[{material}].reflect is above 0, and the scene has no `environment` to mirror"
            ));
        }
        (Some(EnvironmentFields::Builtin(BuiltinSurroundings { builtin })), _) => {
            Environment::builtin(*builtin)
        }
        (Some(EnvironmentFields::File(EnvironmentFile { file, scale })), _) => {
            let file = folder.join(file);
            let of_file = |sentence: String| format!("environment: {}: {sentence}", file.display());
            let bytes = input::read(&file).map_err(|e| of_file(format!("cannot be read: {e}")))?;
            Environment::decode(&bytes, *scale).map_err(of_file)?
        }
    };
    environment.mirrors = materials
        .iter()
        .map(|&MaterialFields { reflect, tint, .. }| Mirror { reflect, tint })
        .collect();
    Ok(shiny.map(|_| Arc::new(environment)))
}

/// Kind of a scene, which determines defaults.
#[derive(Clone, Copy, Debug, PartialEq)]
enum SceneKind {
    Surfaces,
    Volume,
    Gaussians,
    /// Several of these in one frame.
    Mixed,
}

fn kernel(fields: &KernelFields, kind: SceneKind) -> Kernel {
    let (cutoff, low_pass, guard) = match kind {
        SceneKind::Surfaces => (2.0, 1.0, 1.5),
        SceneKind::Volume | SceneKind::Mixed => (4.0, 1.0, 1.5),
        // Training programs also draw splats far to the side.
        SceneKind::Gaussians => (gaussian_cutoff(), 0.3, 100.0),
    };
    Kernel {
        cutoff: fields.cutoff.unwrap_or(cutoff),
        low_pass: if fields.filter == FilterField::Elliptical {
            0.0
        } else {
            fields.low_pass.unwrap_or(low_pass)
        },
        filter: match fields.filter {
            FilterField::Ewa | FilterField::Elliptical => Filter::Ewa,
            FilterField::Circular => Filter::Circular,
            FilterField::SourceEwa => Filter::SourceEwa,
        },
        compensate_opacity: false,
        guard: fields.guard.unwrap_or(guard),
        jacobian: fields.jacobian,
    }
}

// ---- volumes and Gaussians ----

/// Splats other than discs.
enum Medium {
    /// Voxels, in the order of the samples until the view is known.
    Volume(Voxels),
    /// Samples with individual kernels, in the order of the samples; for a rectilinear grid with
    /// its slices.
    Cells(Vec<Orientation>, Option<Slices>),
    /// Flat splats on a surface, and the area that each represents, world units².
    Isosurface(Vec<Orientation>, f64),
    /// Trained Gaussians, whose colours depend on the eye, and their rotation since they were read.
    Gaussians(Gaussians, DQuat),
}

/// A range of a scene's splats that are not discs.
struct MediumPart {
    splats: Range<usize>,
    medium: Medium,
}

impl SheetFields {
    /// Sheets of a medium that emits and absorbs.
    fn of_volume(&self, of: Sheet, back_to_front: bool) -> Sheets {
        Sheets {
            of,
            back_to_front,
            opacity: match self.opacity {
                Some(OpacityLaw::Linear) => Opacity::Linear,
                Some(OpacityLaw::Exponential) | None => Opacity::Exponential,
            },
            stop: self.stop.unwrap_or(1.0 / 1024.0),
            keeps_last: self.keep_last.unwrap_or(true),
            least_weight: self.least_weight.unwrap_or(0.0),
            most_weight: self.most_weight.unwrap_or(1.0),
            weight_distance: None,
        }
    }
}

impl Medium {
    /// Moves it to another place, without its splats.
    fn put(&mut self, place: &Placement) {
        match self {
            Medium::Volume(voxels) => voxels.put(place),
            Medium::Cells(orientations, slices) => {
                orientations
                    .iter_mut()
                    .for_each(|orientation| place.turn(orientation));
                slices.iter_mut().for_each(|slices| slices.put(place));
            }
            Medium::Isosurface(orientations, area) => {
                orientations
                    .iter_mut()
                    .for_each(|orientation| place.turn(orientation));
                *area *= place.scale * place.scale;
            }
            Medium::Gaussians(_, turn) => *turn = place.turn * *turn,
        }
    }

    fn complete(self, fields: &SheetFields, scene: &mut Scene) {
        match self {
            Medium::Volume(voxels) => {
                let back_to_front = fields.order == Some(SheetOrder::BackToFront);
                let (splats, orientation, of) = voxels.ordered(
                    std::mem::take(&mut scene.splats),
                    &scene.view(),
                    back_to_front,
                );
                scene.splats = splats;
                scene.ellipsoids = Some(Ellipsoids::of_volume(vec![orientation], false));
                scene.sheets = Some(fields.of_volume(of, back_to_front));
            }
            Medium::Cells(orientations, slices) => {
                let sorted = slices.is_none();
                let (mut orientations, numbers, back_to_front) = match slices {
                    // Each sample is its own sheet, like a Gaussian.
                    None => (
                        orientations,
                        (0..scene.splats.len() as u32).collect(),
                        false,
                    ),
                    Some(slices) => {
                        let back_to_front = fields.order == Some(SheetOrder::BackToFront);
                        let (order, numbers) = slices.ordered(&scene.view(), back_to_front);
                        scene.splats = order
                            .iter()
                            .map(|splat| scene.splats[*splat as usize])
                            .collect();
                        (
                            order
                                .iter()
                                .map(|splat| orientations[*splat as usize])
                                .collect(),
                            numbers,
                            back_to_front,
                        )
                    }
                };
                if orientations
                    .iter()
                    .all(|orientation| *orientation == orientations[0])
                {
                    orientations.truncate(1);
                }
                scene.ellipsoids = Some(Ellipsoids::of_volume(orientations, sorted));
                scene.sheets = Some(fields.of_volume(Sheet::Slice(numbers), back_to_front));
            }
            Medium::Isosurface(orientations, _) => {
                scene.ellipsoids = Some(Ellipsoids {
                    orientations,
                    amplitude: Amplitude::Disc,
                    preshaded: false,
                    sorted: false,
                    harmonics: None,
                });
            }
            Medium::Gaussians(gaussians, turn) => {
                let eye = scene.camera.eye;
                for (index, splat) in scene.splats.iter_mut().enumerate() {
                    splat.rgb = seen_colour(&gaussians, index, turn, splat.position - eye);
                }
                let orientations = gaussians
                    .all
                    .iter()
                    .map(|gaussian| of_gaussian(gaussian, turn))
                    .collect();
                let harmonics =
                    gaussians
                        .into_harmonics()
                        .map(|(degree, coefficients)| Harmonics {
                            degree,
                            turn,
                            coefficients: Arc::new(coefficients),
                        });
                scene.ellipsoids = Some(Ellipsoids {
                    orientations,
                    amplitude: Amplitude::Peak,
                    preshaded: false,
                    sorted: true,
                    harmonics,
                });
                scene.sheets = Some(Sheets {
                    of: Sheet::Splat,
                    back_to_front: false,
                    opacity: Opacity::Linear,
                    stop: fields.stop.unwrap_or(1e-4),
                    keeps_last: fields.keep_last.unwrap_or(false),
                    least_weight: fields.least_weight.unwrap_or(1.0 / 255.0),
                    most_weight: fields.most_weight.unwrap_or(MOST_WEIGHT),
                    weight_distance: fields.weight_distance,
                });
                scene.image.encoded = true;
            }
        }
    }
}

/// Colour of a rotated Gaussian, seen along `way` from the eye.
fn seen_colour(gaussians: &Gaussians, index: usize, turn: DQuat, way: DVec3) -> [f64; 3] {
    gaussians::colour(
        gaussians.harmonics(index),
        turn.conjugate() * unit(way).unwrap_or(DVec3::Z),
    )
}

fn of_gaussian(gaussian: &Gaussian, turn: DQuat) -> Orientation {
    // Without rotation there is no product: old scenes keep their last bits.
    let rotation = if turn == DQuat::IDENTITY {
        gaussian.rotation
    } else {
        turn * gaussian.rotation
    };
    Orientation {
        rotation,
        scales: gaussian.scale / gaussian.scale.max_element(),
    }
}

/// A disc as an ellipsoid, `flatten` times thinner along its normal.
fn of_disc(normal: DVec3, flatten: f64) -> Orientation {
    Orientation {
        rotation: DQuat::from_rotation_arc(DVec3::Z, normal),
        scales: DVec3::new(1.0, 1.0, 1.0 / flatten),
    }
}

/// Surfaces only: if one has flattened kernels, all have.
fn surfaces(media: Vec<MediumPart>, scene: &mut Scene) {
    if media.is_empty() {
        return;
    }
    let mut all: Vec<Orientation> = scene
        .splats
        .iter()
        .map(|splat| of_disc(splat.normal, FLATTEST))
        .collect();
    for MediumPart { splats, medium } in media {
        if let Medium::Isosurface(orientations, _) = medium {
            all[splats].copy_from_slice(&orientations);
        }
    }
    Medium::Isosurface(all, 0.0).complete(&SheetFields::default(), scene);
}

/// Everything in one frame: each splat is its own sheet, sorted by depth, that emits and absorbs
/// like those of a volume (EWA Fig. 16).
///
/// A surface is a thin layer of that optical depth: its flattened kernels share the optical depth
/// of its opacity, in proportion to the area that each represents; a disc of σ represents σ². The
/// optical depth of a Gaussian along the ray is that of its peak's opacity. It emits the light that
/// its colour has on a screen.
fn mixed(media: Vec<MediumPart>, fields: &SheetFields, scene: &mut Scene) {
    let cutoff = scene.kernel.cutoff;
    // Peak of a flattened kernel, seen from the front, that represents `part` of σ².
    let layer = |opacity: f64, part: f64| depth_of_layer(opacity, cutoff) * part / TAU;
    let mut all: Vec<Orientation> = scene
        .splats
        .iter()
        .map(|splat| of_disc(splat.normal, flat()))
        .collect();
    let mut is_disc = vec![true; scene.splats.len()];
    let eye = scene.camera.eye;
    let unlit = scene.materials.len() as u32;
    for MediumPart {
        splats: range,
        medium,
    } in media
    {
        is_disc[range.clone()].fill(false);
        let splats = &mut scene.splats[range.clone()];
        match medium {
            Medium::Volume(voxels) => all[range].fill(voxels.orientation()),
            Medium::Cells(orientations, _) => all[range].copy_from_slice(&orientations),
            Medium::Isosurface(orientations, area) => {
                all[range].copy_from_slice(&orientations);
                splats.iter_mut().for_each(|splat| {
                    splat.opacity = layer(splat.opacity, area / (splat.radius * splat.radius))
                });
            }
            Medium::Gaussians(gaussians, turn) => {
                for (index, splat) in splats.iter_mut().enumerate() {
                    let (way, of) = (
                        splat.position - eye,
                        of_gaussian(&gaussians.all[index], turn),
                    );
                    splat.rgb = seen_colour(&gaussians, index, turn, way).map(srgb_decode);
                    splat.material = unlit;
                    // A ball has its depth through its centre; an ellipsoid has 1/(Πsᵢ·√Σ(dᵢ/sᵢ)²)
                    // of that along d.
                    let along = of.rotation.conjugate() * unit(way).unwrap_or(DVec3::Z) / of.scales;
                    let depth = -libm::log1p(
                        -splat
                            .opacity
                            .min(fields.most_weight.unwrap_or(MOST_WEIGHT))
                            .min(MOST_OPACITY),
                    );
                    splat.opacity = depth * of.scales.element_product() * along.length();
                    all[range.start + index] = of;
                }
                if scene.materials.len() as u32 == unlit {
                    scene.add_material(Material::Unlit);
                }
            }
        }
    }
    let discs = scene
        .splats
        .iter_mut()
        .zip(is_disc)
        .filter(|(_, is_disc)| *is_disc);
    discs.for_each(|(splat, _)| splat.opacity = layer(splat.opacity, 1.0));
    scene.ellipsoids = Some(Ellipsoids::of_volume(all, true));
    let numbers = (0..scene.splats.len() as u32).collect();
    scene.sheets = Some(fields.of_volume(Sheet::Slice(numbers), false));
}

/// Checks that values ascend.
fn ascending(
    values: impl Iterator<Item = f64> + Clone,
    path: &str,
    field: &str,
) -> std::result::Result<(), String> {
    let pairs = values.clone().zip(values.skip(1)).enumerate();
    match pairs.into_iter().find(|(_, (a, b))| a >= b) {
        Some((i, (a, b))) => Err(format!(
            "{path}[{}].{field} is {b}, which is not above the {a} before it",
            i + 1
        )),
        None => Ok(()),
    }
}

// ---- splats ----

/// The splats of all sources, while they are read.
struct Gathered<'a> {
    name: &'a str,
    folder: &'a Path,
    splats: Vec<Splat>,
    /// Ends of the clouds within which splats are neighbours, and the factor on their radii.
    clouds: Vec<(usize, f64)>,
    materials: Vec<Material>,
    materials_are_given: bool,
    /// Splats that are not discs, in the order of the splats.
    media: Vec<MediumPart>,
    /// Cutoff of a volume's kernels.
    volume_cutoff: f64,
    /// Whether samples were left out because their cell has no volume.
    lacks_cells: bool,
    /// A tree that was read, if it has all splats, and no other source or factor changed them.
    tree: Option<Tree>,
    notes: Vec<String>,
}

impl<'a> Gathered<'a> {
    fn new(name: &'a str, folder: &'a Path, fields: &SceneFields) -> Self {
        let materials = match &fields.materials {
            Some(given) => given.iter().map(material).collect(),
            None if fields.splats.is_only_builtin() => vec![],
            None => vec![material(&MaterialFields::default())],
        };
        let materials_are_given = fields.materials.is_some();
        let volume_cutoff = kernel(&fields.kernel, SceneKind::Volume).cutoff;
        Gathered {
            name,
            folder,
            splats: vec![],
            clouds: vec![],
            materials,
            materials_are_given,
            media: vec![],
            volume_cutoff,
            lacks_cells: false,
            tree: None,
            notes: vec![],
        }
    }

    fn add(&mut self, source: &Source, path: &str) -> Result<()> {
        match source {
            Source::File(file) => self.add_file(file, path),
            Source::Builtin(builtin) => self.add_builtin(builtin, path),
            Source::Splat(splat) => self.add_splat(splat, path),
            Source::Volume(volume) => self.add_volume(volume, path),
            Source::Gaussians(GaussianSource {
                gaussians,
                count,
                degree,
            }) => {
                let make = match gaussians {
                    BuiltinGaussians::Bouquet => gaussians::bouquet,
                    BuiltinGaussians::City => gaussians::city,
                };
                self.take_gaussians(make(*count, *degree), [1.0; 2]);
                Ok(())
            }
            Source::Placed(source) => self.add_placed(source, path),
            Source::Several(sources) => self.add_several(sources, path),
            Source::Given(splats) => self.add_given(splats, path),
        }
    }

    fn kind(&self) -> SceneKind {
        match self.media.as_slice() {
            parts
                if parts
                    .iter()
                    .all(|part| matches!(part.medium, Medium::Isosurface(..))) =>
            {
                SceneKind::Surfaces
            }
            [part] if part.splats == (0..self.splats.len()) => match part.medium {
                Medium::Volume(_) | Medium::Cells(..) => SceneKind::Volume,
                Medium::Gaussians(..) => SceneKind::Gaussians,
                Medium::Isosurface(..) => SceneKind::Surfaces,
            },
            _ => SceneKind::Mixed,
        }
    }

    /// Whether splats are their own sheets, sorted by depth, and may also be drawn as a volume.
    fn comes_by_depth(&self) -> bool {
        self.kind() == SceneKind::Mixed
            || matches!(
                self.media.as_slice(),
                [MediumPart {
                    medium: Medium::Cells(_, None),
                    ..
                }]
            )
    }

    /// Why there are no splats.
    fn nothing(&self) -> &'static str {
        if self.lacks_cells {
            return "shows nothing of the volume; samples that its transfer function shows have a cell of no volume";
        }
        match self.media.first().map(|part| &part.medium) {
            Some(Medium::Volume(_) | Medium::Cells(..)) => {
                "shows nothing of the volume; a transfer function must give some of its values an opacity above 0"
            }
            Some(Medium::Isosurface(..)) => {
                "has no surface of this isovalue; it must be between the least and the greatest value of the volume"
            }
            _ => "holds no splats; a scene needs at least one",
        }
    }

    /// Adds splats other than discs.
    fn add_medium(&mut self, splats: Vec<Splat>, medium: Medium) {
        self.end_cloud(1.0);
        let start = self.splats.len();
        self.splats.extend(splats);
        self.media.push(MediumPart {
            splats: start..self.splats.len(),
            medium,
        });
        self.end_cloud(1.0);
    }

    fn add_placed(&mut self, source: &PlacedSource, path: &str) -> Result<()> {
        let (first, media) = (self.splats.len(), self.media.len());
        let PlaceFields {
            scale,
            axis,
            degrees,
            way,
        } = source.place;
        let axis = direction(axis, &format!("{path}.place.axis"))
            .map_err(|sentence| self.input_error(sentence))?;
        let place = Placement {
            scale,
            turn: DQuat::from_axis_angle(axis, degrees.to_radians()),
            way: DVec3::from_array(way),
        };
        self.add(&source.splats, &format!("{path}.splats"))?;
        self.end_cloud(1.0);
        self.splats[first..]
            .iter_mut()
            .for_each(|splat| place.put(splat));
        self.media[media..]
            .iter_mut()
            .for_each(|part| part.medium.put(&place));
        let is_sound = |splat: &Splat| {
            // A radius of 0 is fitted later.
            let radius =
                splat.radius == 0.0 || (LEAST_RADIUS..=ply::FARTHEST).contains(&splat.radius);
            radius && splat.position.abs().max_element() <= ply::FARTHEST
        };
        if self.splats[first..].iter().all(is_sound) {
            return Ok(());
        }
        Err(self.input_error(format!(
            "{path}.place moves splats out of range: positions must be within ±{:e}, radii from {LEAST_RADIUS:e}",
            ply::FARTHEST
        )))
    }

    fn add_volume(&mut self, source: &VolumeSource, path: &str) -> Result<()> {
        let material = self.known_material(source.material, path)?;
        let arrays = Arrays {
            values: source.array.as_deref(),
            variance: source.variance.as_deref(),
        };
        let (file, read) = match &source.volume {
            VolumeFile::Path(file) => {
                let file = self.folder.join(file);
                self.add_notes(formats::contradiction(&file).as_slice(), &file);
                (file.clone(), volume::read_samples(&file, &arrays))
            }
            _ if arrays.values.or(arrays.variance).is_some() => {
                let field = if arrays.values.is_some() {
                    "array"
                } else {
                    "variance"
                };
                return Err(self.input_error(format!(
                    "{path}.{field} names an array of a VTK file, and this is another format"
                )));
            }
            VolumeFile::Raw(raw) => (
                self.folder.join(&raw.file),
                volume::read_raw(raw, self.folder).map(Samples::Even),
            ),
            VolumeFile::Builtin(BuiltinField { builtin, samples }) => (
                PathBuf::from("built-in field"),
                Ok(Samples::Even(builtin.volume(*samples))),
            ),
        };
        let samples = read.map_err(|sentence| match &source.volume {
            VolumeFile::Raw(_) => self.input_error(format!("{path}.volume: {sentence}")),
            _ => Error::input(format!("{}: {sentence}", file.display())),
        })?;
        self.add_notes(samples.notes(), &file);
        let (all, absent) = (
            samples.values().len(),
            samples
                .values()
                .iter()
                .filter(|value| value.is_nan())
                .count(),
        );
        if absent == all {
            return Err(Error::input(format!(
                "{}: all of its {all} samples are NaN; there is nothing to draw",
                file.display()
            )));
        }
        if absent > 0 {
            self.add_notes(
                &[format!(
                    "{absent} of {all} samples are NaN: they are drawn as empty"
                )],
                &file,
            );
        }
        let cutoff = self.volume_cutoff;
        let transfer = match &source.transfer {
            Some(points) => {
                ascending(
                    points.iter().map(|p| p.value),
                    &format!("{path}.transfer"),
                    "value",
                )
                .map_err(|sentence| self.input_error(sentence))?;
                points
                    .iter()
                    .map(
                        |&TransferFields {
                             value,
                             rgb,
                             opacity,
                         }| TransferPoint {
                            value,
                            rgb,
                            depth: depth_of_layer(opacity, cutoff),
                        },
                    )
                    .collect()
            }
            None => Classification::usual(samples.values(), cutoff),
        };
        let magnitudes = source.gradient.iter().map(|point| point.magnitude);
        ascending(magnitudes, &format!("{path}.gradient"), "magnitude")
            .map_err(|sentence| self.input_error(sentence))?;
        let gradient = source
            .gradient
            .iter()
            .map(|point| [point.magnitude, point.factor])
            .collect();
        let classification = Classification {
            transfer,
            gradient,
            radius: source.radius,
            material,
        };
        let is_thin = source.radius < LEAST_STEPS;
        let of_kernels = |sigma: f64| {
            if (LEAST_RADIUS..=ply::FARTHEST).contains(&sigma) && !is_thin {
                return Ok(());
            }
            Err(self.input_error(format!(
                "{path} has kernels of {:e} steps, {sigma:e} world units; they must have {LEAST_STEPS:e} steps and {LEAST_RADIUS:e} world units or more, \
                 and at most {:e} world units",
                source.radius,
                ply::FARTHEST
            )))
        };
        let memory = |count: u64, what: &str, bytes_each: u64| {
            let held = self.splats.len() as u64;
            // With other media, every splat has its own orientation.
            let (count, what, bytes_each) = if held > 0 {
                (count + held, "splats", memory::GAUSSIAN_BYTES)
            } else {
                (count, what, bytes_each)
            };
            memory::check(count, what, bytes_each)
                .map_err(|sentence| self.input_error(format!("{path}: {sentence}")))
        };
        let (splats, medium, what) = match (&samples, source.isovalue) {
            (Samples::Even(volume), isovalue) => {
                of_kernels(classification.sigma(volume))?;
                let [x, y, z] = volume.size;
                let what = format!("voxels are seen ({x} × {y} × {z})");
                match isovalue {
                    Some(isovalue) => {
                        memory(
                            Classification::on_surface(volume, isovalue),
                            "splats of a surface",
                            memory::GAUSSIAN_BYTES,
                        )?;
                        let (splats, orientations, area) =
                            classification.isosurface(volume, isovalue, source.flatten);
                        (splats, Medium::Isosurface(orientations, area), what)
                    }
                    None => {
                        memory(
                            classification.seen(samples.values()),
                            "voxels",
                            memory::DISC_BYTES,
                        )?;
                        let (splats, voxels) = classification.voxels(volume, source.layer);
                        (splats, Medium::Volume(voxels), what)
                    }
                }
            }
            (Samples::Uneven(_), Some(_)) => {
                return Err(self.input_error(format!(
                    "{path}.isovalue is not read of VTR, VTS, VTU and VTP; `transfer` shows them"
                )));
            }
            (Samples::Uneven(field), None) => {
                memory(
                    classification.seen(samples.values()),
                    "samples",
                    memory::GAUSSIAN_BYTES,
                )?;
                let cells = Cells::new(field, source.radius);
                // If no sample has a cell, none is visible either.
                let layer = source
                    .layer
                    .or_else(|| cells.default_layer())
                    .unwrap_or(1.0);
                let (
                    Sampled {
                        splats,
                        orientations,
                        slices,
                    },
                    flat,
                ) = cells.samples(&classification, layer);
                splats
                    .iter()
                    .try_for_each(|splat| of_kernels(splat.radius))?;
                if flat > 0 {
                    self.lacks_cells = true;
                    self.notes.push(format!(
                        "{}: {flat} samples have a cell of no volume and were left out",
                        file.display()
                    ));
                }
                (
                    splats,
                    Medium::Cells(orientations, slices),
                    "samples are seen".to_string(),
                )
            }
        };
        self.notes.push(format!(
            "{} of {} {what}",
            splats.len(),
            samples.values().len()
        ));
        self.add_medium(splats, medium);
        Ok(())
    }

    fn add_gaussians(&mut self, gaussians: Gaussians, file: &Path, source: &FileSource) {
        let mut gaussians = gaussians;
        self.add_notes(&std::mem::take(&mut gaussians.notes), file);
        self.take_gaussians(gaussians, [source.radius_scale, source.opacity]);
    }

    fn add_notes(&mut self, notes: &[String], file: &Path) {
        self.notes.extend(
            notes
                .iter()
                .map(|note| format!("{}: {note}", file.display())),
        );
    }

    /// Gaussians with radii and opacities scaled by these factors.
    fn take_gaussians(&mut self, gaussians: Gaussians, [radius_scale, opacity]: [f64; 2]) {
        let splat = |gaussian: &Gaussian| Splat {
            position: gaussian.position,
            normal: DVec3::Z,
            radius: (gaussian.scale.max_element() * radius_scale)
                .clamp(LEAST_RADIUS, ply::FARTHEST),
            rgb: [0.0; 3],
            opacity: gaussian.opacity * opacity,
            material: 0,
        };
        let splats = gaussians.all.iter().map(splat).collect();
        self.add_medium(splats, Medium::Gaussians(gaussians, DQuat::IDENTITY));
    }

    /// Whether the file of the Gaussians has compensated opacities; adds a note.
    fn compensates(&mut self) -> bool {
        let compensates = self.media.iter().any(
            |part| matches!(&part.medium, Medium::Gaussians(gaussians, _) if gaussians.compensated),
        );
        if compensates {
            let note = "opacities are compensated for the low-pass filter, as the file requires (`kernel.compensate_opacity`: false turns it off)";
            self.notes.push(note.into());
        }
        compensates
    }

    /// Consecutive splats of an array are one cloud; every other source is its own cloud.
    fn add_several(&mut self, sources: &[Source], path: &str) -> Result<()> {
        for (i, source) in sources.iter().enumerate() {
            if !matches!(source, Source::Splat(_)) {
                self.end_cloud(1.0);
            }
            self.add(source, &format!("{path}[{i}]"))?;
        }
        self.end_cloud(1.0);
        Ok(())
    }

    fn add_file(&mut self, source: &FileSource, path: &str) -> Result<()> {
        let material = self.known_material(source.material, path)?;
        let file = self.folder.join(&source.file);
        let input_error =
            |sentence: String| Error::input(format!("{}: {sentence}", file.display()));
        let cannot = |e: std::io::Error| input_error(format!("cannot be read: {e}"));
        let parse = match formats::reader(&file) {
            Some(Reader::Splats(parse)) => parse,
            Some(Reader::Volume(_) | Reader::Image(_) | Reader::Irregular(_)) => {
                return self.add_volume(&VolumeSource::of(source), path);
            }
            None => {
                std::fs::metadata(&file).map_err(cannot)?;
                return Err(input_error(formats::no_splats(&file)));
            }
        };
        let bytes = input::read(&file).map_err(cannot)?;
        self.add_notes(formats::contradiction(&file).as_slice(), &file);
        match parse(&bytes, file.parent().unwrap_or(Path::new(""))).map_err(input_error)? {
            Splats::Gaussians(gaussians) => {
                self.add_gaussians(gaussians, &file, source);
            }
            Splats::Tree(tree) => {
                for splat in tree.splats() {
                    let material =
                        self.known_material(splat.material.saturating_add(material), path)?;
                    self.splats.push(Splat {
                        material,
                        opacity: splat.opacity * source.opacity,
                        ..splat
                    });
                }
                for node in tree.nodes() {
                    self.known_material(node.splat.material.saturating_add(material), path)?;
                }
                self.tree = Some(tree);
                self.end_cloud(source.radius_scale);
            }
            Splats::Points(cloud) => {
                let own = |splat: Splat| Splat {
                    material,
                    opacity: splat.opacity * source.opacity,
                    ..splat
                };
                self.splats.extend(cloud.splats.into_iter().map(own));
                self.add_notes(&cloud.notes, &file);
                self.end_cloud(source.radius_scale);
            }
        }
        Ok(())
    }

    fn add_builtin(&mut self, source: &BuiltinSource, path: &str) -> Result<()> {
        let mut first = 0;
        if self.materials_are_given {
            self.known_material(source.builtin.materials().len() as u32 - 1, path)?;
        } else {
            first = self.materials.len() as u32;
            self.materials.extend(source.builtin.materials());
        }
        let mut splats = source.builtin.splats(source.count);
        if source.order == SplatOrder::Random {
            builtin::shuffle(&mut splats, source.seed);
        }
        self.splats.extend(splats.into_iter().map(|splat| Splat {
            material: splat.material + first,
            ..splat
        }));
        self.end_cloud(1.0);
        Ok(())
    }

    fn add_splat(&mut self, splat: &SplatFields, path: &str) -> Result<()> {
        let normal = splat
            .normal
            .map(|normal| direction(normal, &format!("{path}.normal")))
            .transpose();
        self.splats.push(Splat {
            position: DVec3::from_array(splat.position),
            normal: normal
                .map_err(|sentence| self.input_error(sentence))?
                .unwrap_or(DVec3::ZERO),
            radius: splat.radius.unwrap_or(0.0),
            rgb: splat.rgb,
            opacity: splat.opacity,
            material: self.known_material(splat.material, path)?,
        });
        Ok(())
    }

    fn add_given(&mut self, splats: &[Splat], path: &str) -> Result<()> {
        for (number, splat) in splats.iter().enumerate() {
            let input_error = |field: &str, right: &str| {
                self.input_error(format!("{path}[{number}].{field} must be {right}"))
            };
            let is_within = |vector: DVec3| {
                vector
                    .to_array()
                    .iter()
                    .all(|part| part.abs() <= ply::FARTHEST)
            };
            let share = |part: f64| (0.0..=1.0).contains(&part);
            if !is_within(splat.position) {
                return Err(input_error(
                    "position",
                    &format!("three numbers within ±{:e}", ply::FARTHEST),
                ));
            }
            if !is_within(splat.normal) {
                return Err(input_error(
                    "normal",
                    &format!("three numbers within ±{:e}", ply::FARTHEST),
                ));
            }
            if splat.radius != 0.0 && !(LEAST_RADIUS..=ply::FARTHEST).contains(&splat.radius) {
                return Err(input_error(
                    "radius",
                    &format!(
                        "0, which means fitted, or {LEAST_RADIUS:e} to {:e}",
                        ply::FARTHEST
                    ),
                ));
            }
            if !splat.rgb.into_iter().all(share) {
                return Err(input_error("rgb", "three numbers from 0 to 1"));
            }
            if !share(splat.opacity) {
                return Err(input_error("opacity", "a number from 0 to 1"));
            }
            self.known_material(splat.material, &format!("{path}[{number}]"))?;
            self.splats.push(Splat {
                normal: unit(splat.normal).unwrap_or(DVec3::ZERO),
                ..*splat
            });
        }
        self.end_cloud(1.0);
        Ok(())
    }

    /// A tree of all splats: the one that was read, if it has exactly these.
    fn detail(&mut self, fields: &DetailFields) -> std::result::Result<Detail, String> {
        memory::check(
            self.splats.len() as u64,
            "splats of a tree",
            memory::DISC_BYTES + memory::NODE_BYTES,
        )?;
        let read = self.tree.take().filter(|tree| tree.splats() == self.splats);
        let tree = read
            .or_else(|| Tree::new(&self.splats, fields.children))
            .ok_or("holds no splats; a tree needs at least one")?;
        Ok(Detail::new(Arc::new(tree), fields.rules()))
    }

    fn known_material(&self, index: u32, path: &str) -> Result<u32> {
        let count = if self.materials_are_given {
            self.materials.len()
        } else {
            1
        };
        if (index as usize) < count {
            return Ok(index);
        }
        Err(self.input_error(format!(
            "{path} uses material {index}, but `materials` has only the indices 0 to {}",
            count - 1
        )))
    }

    fn input_error(&self, sentence: String) -> Error {
        Error::input(format!("{}: {sentence}", self.name))
    }

    fn end_cloud(&mut self, radius_scale: f64) {
        self.clouds.push((self.splats.len(), radius_scale));
    }

    /// Fills in missing normals and radii, cloud by cloud.
    fn complete(&mut self, eye: DVec3) {
        self.end_cloud(1.0);
        let mut start = 0;
        // Both are in the order of the splats; other media are clouds of their own.
        let mut media = self
            .media
            .iter()
            .map(|part| &part.splats)
            .filter(|splats| !splats.is_empty())
            .peekable();
        for &(end, radius_scale) in &self.clouds {
            if media.next_if(|splats| **splats == (start..end)).is_none() {
                let cloud = &mut self.splats[start..end];
                neighbours::fit(cloud, eye);
                cloud.iter_mut().for_each(|s| {
                    s.radius = (s.radius * radius_scale).clamp(LEAST_RADIUS, ply::FARTHEST)
                });
            }
            start = end;
        }
    }
}

impl VolumeSource {
    /// A single file, with defaults for all else.
    fn of(source: &FileSource) -> Self {
        VolumeSource {
            volume: VolumeFile::Path(source.file.clone()),
            array: None,
            variance: None,
            layer: None,
            transfer: None,
            gradient: Vec::new(),
            radius: kernel_steps() * source.radius_scale,
            isovalue: None,
            flatten: flat(),
            material: source.material,
        }
    }
}

impl Source {
    /// Refuses splats requested by number that do not fit into memory, before any are made.
    fn check_memory(&self) -> std::result::Result<(), String> {
        let what = if matches!(self, Source::Gaussians(_)) {
            "Gaussians"
        } else {
            "splats"
        };
        // If one splat has an orientation, all have one.
        let bytes_each = match self {
            // Coefficients of the scene, and their words.
            Source::Gaussians(source) => {
                memory::GAUSSIAN_BYTES + 2 * memory::harmonics_bytes(source.degree)
            }
            _ if self.is_medium() => memory::GAUSSIAN_BYTES,
            _ => memory::DISC_BYTES,
        };
        memory::check(self.promised(), what, bytes_each)
            .map_err(|sentence| format!("splats: {sentence}"))
    }

    /// Whether it is known before reading files that some splats are not discs.
    fn is_medium(&self) -> bool {
        match self {
            Source::Gaussians(_) | Source::Volume(_) => true,
            Source::Several(sources) => sources.iter().any(Source::is_medium),
            Source::Placed(source) => source.splats.is_medium(),
            Source::File(_) | Source::Splat(_) | Source::Given(_) | Source::Builtin(_) => false,
        }
    }

    /// Number of splats requested by number.
    fn promised(&self) -> u64 {
        match self {
            Source::Builtin(source) => source.count.unwrap_or(0) as u64,
            Source::Gaussians(source) => source.count as u64,
            Source::Several(sources) => sources.iter().map(Source::promised).sum(),
            Source::Placed(source) => source.splats.promised(),
            // For files the length is checked instead.
            Source::File(_) | Source::Splat(_) | Source::Given(_) | Source::Volume(_) => 0,
        }
    }

    fn is_only_builtin(&self) -> bool {
        match self {
            Source::Builtin(_) => true,
            Source::Several(sources) => sources.iter().all(Source::is_only_builtin),
            Source::Placed(source) => source.splats.is_only_builtin(),
            Source::File(_)
            | Source::Splat(_)
            | Source::Given(_)
            | Source::Volume(_)
            | Source::Gaussians(_) => false,
        }
    }
}

// ---- the view ----

/// The unit vector of a direction of any length except 0.
fn direction(vector: [f64; 3], path: &str) -> std::result::Result<DVec3, String> {
    unit(DVec3::from_array(vector))
        .ok_or_else(|| format!("{path} is zero; it must point somewhere"))
}

fn image(
    fields: &ImageFields,
    name: &str,
    overrides: &Overrides,
    cameras: Option<&CameraFile>,
) -> Result<Image> {
    let of_cameras = cameras.and_then(|file| file.size);
    let (width, height) = overrides
        .size
        .or(of_cameras)
        .unwrap_or((fields.width, fields.height));
    let input_error = |right: String| {
        let whose = match (overrides.size, of_cameras, cameras) {
            (Some(_), ..) => "--size".into(),
            (_, Some(_), Some(file)) => format!("{}: the picture", file.name),
            _ => format!("{name}: image"),
        };
        Error::input(format!(
            "{whose} is {width}x{height} pixels; it must be {right}"
        ))
    };
    if !(1..=LONGEST_SIDE).contains(&width) || !(1..=LONGEST_SIDE).contains(&height) {
        return Err(input_error(format!("1 to {LONGEST_SIDE} on each side")));
    }
    if width * height > MOST_PIXELS {
        return Err(input_error(format!("at most {MOST_PIXELS} pixels in all")));
    }
    Ok(Image {
        width,
        height,
        background: fields.background,
        encoded: false,
    })
}

impl SceneFields {
    /// Checks that at most one of the three kinds of cameras is given.
    fn check_cameras(&self) -> std::result::Result<(), String> {
        let given = [
            ("camera", self.camera.is_some()),
            ("cameras", self.cameras.is_some()),
            ("camera_path", self.camera_path.is_some()),
        ];
        let given: Vec<&str> = given
            .iter()
            .filter(|(_, is_given)| *is_given)
            .map(|(name, _)| *name)
            .collect();
        if given.len() > 1 {
            return Err(format!(
                "has {}; only one of `camera`, `cameras` and `camera_path` may be given",
                given.join(" and ")
            ));
        }
        if let Some(PathFields::Keys(path)) = &self.camera_path {
            path.check()
        } else {
            Ok(())
        }
    }

    /// Whether the position of the single camera is to be chosen.
    fn frames_itself(&self) -> bool {
        self.cameras.is_none()
            && self.camera_path.is_none()
            && self
                .camera
                .as_ref()
                .is_none_or(|camera| camera.eye.is_none())
    }

    /// One camera per frame.
    fn seen_by(
        &self,
        up: DVec3,
        image: &Image,
        splats: &[Splat],
    ) -> std::result::Result<Vec<Camera>, String> {
        let picture = [self.image.width as f64, self.image.height as f64];
        let complete = |fields: &CameraFields, whose: &str| {
            camera(fields, whose, up, (image, picture), splats)
        };
        if let Some(cameras) = &self.cameras {
            return cameras
                .iter()
                .enumerate()
                .map(|(i, fields)| complete(fields, &format!("cameras[{i}]")))
                .collect();
        }
        match &self.camera_path {
            Some(PathFields::Keys(path)) => {
                let keys = path.keys.iter().enumerate();
                let keys = keys.map(|(i, key)| {
                    Ok((
                        key.at,
                        complete(&key.camera(), &format!("camera_path.keys[{i}]"))?,
                    ))
                });
                path.cameras(&keys.collect::<std::result::Result<Vec<_>, String>>()?)
            }
            Some(PathFields::Pan(path)) => {
                path.cameras(&complete(&path.camera, "camera_path.camera")?, image)
            }
            None => Ok(vec![complete(
                self.camera.as_ref().unwrap_or(&CameraFields::default()),
                "camera",
            )?]),
        }
    }
}

/// Tolerance for two equal angles of view, as a part of one.
const SAME_ANGLE: f64 = 1e-6;

/// Completes a camera; `whose` begins every error. The scene is drawn at the size of `image`, which
/// may differ from `picture`, the size in the scene file.
fn camera(
    fields: &CameraFields,
    whose: &str,
    usual_up: DVec3,
    (image, picture): (&Image, [f64; 2]),
    splats: &[Splat],
) -> std::result::Result<Camera, String> {
    let &CameraFields {
        focal_px,
        centre_px,
        picture_px,
        ..
    } = fields;
    let has_lens = focal_px.is_some() || centre_px.is_some();
    if picture_px.is_some() && !has_lens {
        return Err(format!(
            "{whose}.picture_px is given without focal_px or centre_px"
        ));
    }
    let picture_px = has_lens.then(|| picture_px.unwrap_or(picture));
    let meant = focal_px
        .zip(picture_px)
        .map(|([_, fy], [_, height])| 2.0 * libm::atan(height / 2.0 / fy).to_degrees());
    if let (Some(angle), Some(meant)) = (fields.fov_y_degrees, meant)
        && (angle / meant - 1.0).abs() > SAME_ANGLE
    {
        return Err(format!(
            "{whose} has fov_y_degrees {angle} and a focal_px equivalent to {meant}; give only one of them"
        ));
    }
    let fov_y_degrees = meant.or(fields.fov_y_degrees).unwrap_or_else(default_fov);
    // Tangents of half the angles of view: horizontal to vertical.
    let aspect = match (focal_px, picture_px) {
        (Some([fx, fy]), Some([width, height])) => width * fy / (fx * height),
        _ => image.width as f64 / image.height as f64,
    };
    let (eye, target) = eye_and_target(fields, fov_y_degrees, aspect, splats);
    let distance = (target - eye).length();
    let forward = (target - eye) / distance;
    let up = match fields.up {
        Some(up) => direction(up, &format!("{whose}.up"))?,
        None if forward.y.abs() > 0.999 => DVec3::Z,
        None => usual_up,
    };
    let near = fields.near.unwrap_or(distance * NEAR_OF_DISTANCE);
    let camera = Camera {
        eye,
        target,
        up,
        fov_y_degrees,
        near,
        focal_px,
        centre_px,
        picture_px,
    };
    camera.check("", &format!("{whose}.")).map(|()| camera)
}

fn eye_and_target(
    fields: &CameraFields,
    fov_y_degrees: f64,
    aspect: f64,
    splats: &[Splat],
) -> (DVec3, DVec3) {
    let [eye, target] = [fields.eye, fields.target].map(|point| point.map(DVec3::from_array));
    if let (Some(eye), Some(target)) = (eye, target) {
        return (eye, target);
    }
    let ball = Ball::around(splats);
    let target = target.unwrap_or(ball.centre);
    (
        eye.unwrap_or_else(|| target + ball.way_to_eye(fov_y_degrees, aspect)),
        target,
    )
}

fn lights(
    fields: Option<Vec<LightFields>>,
    camera: &Camera,
) -> std::result::Result<Vec<Light>, String> {
    let Some(lights) = fields else {
        return Ok(vec![Light {
            direction: (camera.eye - camera.target).normalize(),
            rgb: white(),
        }]);
    };
    let light = |(i, light): (usize, &LightFields)| {
        Ok(Light {
            direction: direction(light.direction, &format!("lights[{i}].direction"))?,
            rgb: light.rgb,
        })
    };
    lights.iter().enumerate().map(light).collect()
}

fn surface(fields: &SurfaceFields, splats: &[Splat]) -> Surface {
    let usual = || {
        let radius = neighbours::median(splats.iter().map(|s| s.radius).collect())
            .expect("a scene has splats");
        radius * Z_THRESHOLD_OF_RADIUS
    };
    Surface {
        z_threshold: fields.z_threshold.unwrap_or_else(usual),
        coverage_threshold: fields.coverage_threshold,
        cull_backfaces: fields.cull_backfaces,
    }
}

fn material(fields: &MaterialFields) -> Material {
    let &MaterialFields {
        unlit,
        ambient,
        diffuse,
        specular,
        shininess,
        ..
    } = fields;
    if unlit {
        Material::Unlit
    } else {
        Material::BlinnPhong {
            ambient,
            diffuse,
            specular,
            shininess,
        }
    }
}

#[cfg(test)]
mod tests;

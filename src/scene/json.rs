//! JSON: reads a scene file (docs/book/scenes.md) and fills in what it leaves out.
//!
//! The types below are the file format: the JSON Schema is derived from them, and a file is held
//! against that schema before it is read into them. What a schema cannot say (directions that are
//! zero, indices out of range) comes after.

use super::cells::{Cells, Sampled, Slices};
use super::gaussians::{Gaussian, Gaussians};
use super::volume::{Arrays, RawDescription, Samples};
use super::voxels::{Classification, MOST_OPACITY, TransferPoint, Voxels, depth_of_layer};
use super::{
    Amplitude, Camera, Ellipsoids, Image, Kernel, LEAST_RADIUS, Light, Material, Opacity,
    Orientation, Overrides, Scene, Sheet, Sheets, Splat, Surface,
};
use super::{Environment, Mirror, environment::BuiltinEnvironment};
use super::{
    builtin::{self, Builtin, Order},
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
        cut::{Budget, Detail, Order as DrawOrder, Rules},
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

/// ε, left out, is this many times the median radius: served well on three scans
/// (docs/book/algorithm.md §2).
const Z_THRESHOLD_OF_RADIUS: f64 = 4.0;
/// The near plane, left out, lies at this share of the way from the eye to its target.
pub(super) const NEAR_OF_DISTANCE: f64 = 1e-3;
/// Most pixels of a picture along a side, and in all: what a desktop computer still holds a few
/// times over.
const LONGEST_SIDE: usize = 16384;
/// Pixels of the largest picture.
pub const MOST_PIXELS: usize = 1 << 25;
/// Least radius of a volume's kernels, in steps of the grid: through the middle of one that stands
/// for a whole cell of opacity 1 the optical depth is 1/(2πr²), here 1.6·10¹¹, and beyond that a
/// volume is points in empty space.
const LEAST_STEPS: f64 = 1e-6;

/// No Gaussian is more opaque than this where a scene says nothing else.
const MOST_WEIGHT: f64 = 0.99;
/// How many times flatter discs are than wide where ellipsoids are drawn beside them: as far as a
/// scene may flatten any.
const FLATTEST: f64 = 1e6;

/// A scene: splats, and how they are looked at. All numbers in world units, linear light and
/// degrees.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "splatsim scene")]
struct SceneFields {
    /// Where the splats come from.
    splats: Source,
    /// The eye; what is left out is chosen so that the splats fill the picture. In its place may
    /// stand `cameras` or `camera_path`.
    camera: Option<CameraFields>,
    /// A camera a frame: a sequence. What else a scene leaves out, as normals and the light, is
    /// chosen for the first.
    #[schemars(length(min = 1, max = MOST_FRAMES))]
    cameras: Option<Vec<CameraFields>>,
    /// The same by a path.
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
    /// How a volume's slices, or Gaussians, become pictures.
    #[serde(default)]
    sheets: SheetFields,
    /// Draws a cut of a tree of the splats instead of all of them; left out, all. Of discs.
    level_of_detail: Option<DetailFields>,
    /// Directional lights; left out: one white light from behind the eye.
    lights: Option<Vec<LightFields>>,
    /// What splats' `material` counts in; left out: the built-in sources' own, for others one
    /// Blinn-Phong.
    #[schemars(length(min = 1))]
    materials: Option<Vec<MaterialFields>>,
    /// Light from all around, which materials with `reflect` mirror.
    environment: Option<EnvironmentFields>,
}

/// A picture of all directions, or surroundings that splatsim makes itself.
#[derive(Deserialize, JsonSchema)]
#[serde(untagged)]
enum EnvironmentFields {
    Builtin(BuiltinSurroundings),
    File(EnvironmentFile),
}

/// Surroundings that splatsim makes itself.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct BuiltinSurroundings {
    builtin: BuiltinEnvironment,
}

/// A latitude-longitude picture, twice as wide as high: PNG (sRGB), Radiance or EXR (linear light).
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct EnvironmentFile {
    /// Path of the picture, relative to the scene file. Up is y, its middle lies towards −z.
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
    // First, because they are tried in this order and there may be millions of this one.
    Splat(SplatFields),
    File(FileSource),
    Builtin(BuiltinSource),
    Volume(VolumeSource),
    Gaussians(GaussianSource),
    #[serde(deserialize_with = "placed")]
    Placed(PlacedSource),
    Several(Vec<Source>),
    /// Splats that no text holds.
    #[serde(skip)]
    Given(Vec<Splat>),
}

/// Of an object alone: an array would be tried as its fields one by one, and so twice at every
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

/// Another place: made larger about the origin, then turned about it, then moved.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct PlaceFields {
    /// Factor on all positions and radii.
    #[schemars(range(min = 1e-30, max = 1e30))]
    scale: f64,
    /// What it is turned about, of any length but 0.
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    axis: [f64; 3],
    /// How far, counter-clockwise seen from where the axis points to.
    #[schemars(range(min = -360, max = 360))]
    degrees: f64,
    /// How far it is moved.
    #[serde(rename = "move")]
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    way: [f64; 3],
}

/// Points, trained Gaussians or a volume, by the end of the file's name.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct FileSource {
    /// Path of the file, relative to the scene file. Of trained Gaussians: rotations are
    /// quaternions, real part first (`rot_0` is w), of any length but 0; `f_rest` has all
    /// coefficients of red, then of green, then of blue.
    file: PathBuf,
    /// Index into `materials`.
    #[serde(default)]
    #[schemars(range(max = u32::MAX))]
    material: u32,
    /// Factor on all radii, be they the file's or fitted.
    #[serde(default = "one")]
    #[schemars(range(min = 1e-30, max = 1e30))]
    radius_scale: f64,
    /// Factor on all opacities.
    #[serde(default = "one")]
    #[schemars(range(min = 0, max = 1))]
    opacity: f64,
}

/// A scalar field on a grid or at points, seen through a transfer function or along an isosurface.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct VolumeSource {
    volume: VolumeFile,
    /// Which of a file's arrays at points has the samples; left out: the one that the file names,
    /// else the first of one component. Of `.vti`, `.vtr`, `.vts`, `.vtu` and `.vtp`.
    array: Option<String>,
    /// Which array has the variance of each point's kernel, world units²: of 1 component, the same
    /// in all directions, of 3, along x, y and z, or of 6, xx, yy, zz, xy, yz and xz. Left out:
    /// from the distance to the 6 nearest points. Of `.vtu` and `.vtp`.
    variance: Option<String>,
    /// How thick the layer is that `opacity` is of, world units; left out: the shortest step of the
    /// grid, or where steps differ the median of each sample's shortest.
    #[schemars(range(min = 1e-30, max = 1e30))]
    layer: Option<f64>,
    /// Colour and opacity by value, in ascending order; between two values colour and optical
    /// depth, −ln(1 − opacity), are linear. Left out: a white ramp.
    #[schemars(length(min = 1))]
    transfer: Option<Vec<TransferFields>>,
    /// Factor on optical depth by gradient magnitude, in ascending order; left out: 1.
    #[serde(default)]
    gradient: Vec<GradientFields>,
    /// Standard deviation of the kernel along each axis, in steps of the grid along it, or in the
    /// mean distance to the nearest points. Thinner than the least, no light would meet one. With
    /// `variance`, which says how wide kernels are, what part of a step that is.
    #[serde(default = "kernel_steps")]
    #[schemars(range(min = 1e-6, max = 100))]
    radius: f64,
    /// Draws the surface where the field has this value, instead of what the transfer function
    /// shows. Not read of `.vtr`, `.vts`, `.vtu` and `.vtp`.
    #[schemars(range(min = -1e30, max = 1e30))]
    isovalue: Option<f64>,
    /// How many times flatter kernels are along the gradient; infinitely flat they are discs. For
    /// `isovalue`.
    #[serde(default = "flat")]
    #[schemars(range(min = 1, max = 1e6))]
    flatten: f64,
    /// Index into `materials`.
    #[serde(default)]
    #[schemars(range(max = u32::MAX))]
    material: u32,
}

/// Gaussians that splatsim makes itself.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct GaussianSource {
    gaussians: BuiltinGaussians,
    #[serde(default = "gaussian_count")]
    #[schemars(range(min = 1, max = 67_108_864))]
    count: usize,
}

#[derive(Deserialize, JsonSchema, Clone, Copy)]
#[serde(rename_all = "kebab-case")]
enum BuiltinGaussians {
    /// Flowers: petals are flat, stems are needles, and a haze lies behind them.
    Bouquet,
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

/// A field that splatsim makes itself.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct BuiltinField {
    builtin: fields::Field,
    /// Samples along each axis.
    #[serde(default = "field_samples")]
    #[schemars(range(min = 2, max = 512))]
    samples: usize,
}

/// A value of the field, and how it looks.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct TransferFields {
    #[schemars(range(min = -1e30, max = 1e30))]
    value: f64,
    /// Linear light.
    #[serde(default = "white")]
    #[schemars(inner(range(min = 0, max = 1)))]
    rgb: [f64; 3],
    /// Of a layer as thick as the shortest step of the grid, or `layer`: what part of the light
    /// behind it does not come through. 1 counts as 1 − 2⁻¹⁶.
    #[schemars(range(min = 0, max = 1))]
    opacity: f64,
}

/// A gradient magnitude, in values a world unit, and a factor on optical depth.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct GradientFields {
    #[schemars(range(min = 0, max = 1e30))]
    magnitude: f64,
    #[schemars(range(min = 0, max = 1))]
    factor: f64,
}

/// In which order sheets are blended.
#[derive(Deserialize, JsonSchema, Clone, Copy, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum SheetOrder {
    FrontToBack,
    BackToFront,
}

/// What opacity an optical depth has: itself, as far as 1; or 1 − e^(−x).
#[derive(Deserialize, JsonSchema, Clone, Copy)]
#[serde(rename_all = "kebab-case")]
enum OpacityLaw {
    Linear,
    Exponential,
}

#[derive(Deserialize, JsonSchema, Default)]
#[serde(deny_unknown_fields, default)]
struct SheetFields {
    /// Left out: front-to-back. Gaussians know no other.
    order: Option<SheetOrder>,
    /// Left out: exponential. For volumes.
    opacity: Option<OpacityLaw>,
    /// A pixel that lets through less than this takes nothing more; left out: 1/1024 for volumes,
    /// 1e-4 for Gaussians.
    #[schemars(range(min = 0), extend("exclusiveMaximum" = 1))]
    stop: Option<f64>,
    /// What makes a pixel stop is blended still; left out: so for volumes, not for Gaussians.
    keep_last: Option<bool>,
    /// Lesser weights make no fragment; left out: 0 for volumes, 1/255 for Gaussians.
    #[schemars(range(min = 0, max = 1))]
    least_weight: Option<f64>,
    /// No Gaussian is more opaque than this; left out: 0.99.
    #[schemars(range(max = 1), extend("exclusiveMinimum" = 0))]
    most_weight: Option<f64>,
}

/// A cloud that splatsim makes itself.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct BuiltinSource {
    builtin: Builtin,
    /// How many splats; left out: enough for a closed surface at 512×512.
    #[schemars(range(min = 1, max = 67_108_864))]
    count: Option<usize>,
    #[serde(default)]
    order: Order,
    /// Which of the random orders.
    #[serde(default)]
    seed: u64,
}

/// One splat.
#[derive(Deserialize, JsonSchema, Clone)]
#[serde(deny_unknown_fields)]
struct SplatFields {
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    position: [f64; 3],
    /// Of any length but 0; left out: fitted to the nearest splats of the same array.
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    normal: Option<[f64; 3]>,
    /// Standard deviation of the kernel; left out: mean distance to the 6 nearest splats of the
    /// same array.
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
    /// What lands on the middle of the picture.
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    target: Option<[f64; 3]>,
    /// What is up in the picture; left out: y (for Gaussians −y), or z where the eye looks along y.
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    up: Option<[f64; 3]>,
    /// Full vertical angle of view; left out, 45, or what `focal_px` means. Narrower than the
    /// least, the picture's coordinates leave f64.
    #[schemars(range(min = 1e-6), extend("exclusiveMaximum" = 180))]
    fov_y_degrees: Option<f64>,
    /// Focal lengths along x and y, pixels of a picture of `picture_px`. Two different ones are
    /// pixels that are not square.
    #[schemars(inner(range(min = 1e-3, max = 1e9)))]
    focal_px: Option<[f64; 2]>,
    /// Principal point: where the axis of the camera meets a picture of `picture_px`, pixels from
    /// its top left corner (x to the right, y down; the centre of the first pixel is 0.5, 0.5).
    /// Left out, the middle.
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    centre_px: Option<[f64; 2]>,
    /// Width and height that `focal_px` and `centre_px` refer to; left out, `image`. In a picture
    /// of another size (`--size`) both are scaled by its height, about its middle.
    #[schemars(inner(range(min = 1, max = 1e6)))]
    picture_px: Option<[f64; 2]>,
    /// Splats whose centres lie at or nearer than this depth are not drawn, Gaussians too; left
    /// out: a thousandth of the way to the target.
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

/// A camera for every frame between those of some.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct KeyedFields {
    /// In the order of their frames. Before the first and after the last the camera rests.
    #[schemars(length(min = 1, max = MOST_FRAMES))]
    pub keys: Vec<KeyFields>,
    /// How many frames; left out: up to the last key's.
    #[schemars(range(min = 1, max = MOST_FRAMES))]
    pub frames: Option<usize>,
    /// What lies between two keys.
    #[serde(default)]
    pub interpolation: Interpolation,
}

/// What lies between two keys: of eye, target, up and angle of view; the near plane is always
/// linear.
#[derive(Deserialize, JsonSchema, Clone, Copy, Default, PartialEq)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Interpolation {
    /// Cubic Hermite curves with Catmull and Rom's slopes, (next − last)/(their frames apart): no
    /// jolt at a key.
    #[default]
    Smooth,
    /// Straight lines.
    Linear,
}

/// A camera at a frame, as `camera` otherwise.
#[derive(Deserialize, JsonSchema, Clone)]
#[serde(deny_unknown_fields)]
pub(super) struct KeyFields {
    /// The frame, above the key's before.
    #[schemars(range(max = LAST_FRAME))]
    pub at: usize,
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    eye: Option<[f64; 3]>,
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    target: Option<[f64; 3]>,
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    up: Option<[f64; 3]>,
    #[serde(default = "usual_fov")]
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

/// A pan to the right: the eye stays, and the picture moves to the left by as much in every frame.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct PanFields {
    /// How far the middle of the first picture moves in a frame, pixels.
    #[schemars(range(min = -1e4, max = 1e4))]
    pub pan_pixels: f64,
    /// How many frames.
    #[schemars(range(min = 1, max = MOST_FRAMES))]
    pub frames: usize,
    /// That of the first frame.
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
    /// Fragments exist where the radial index is below this; left out: 2 for surfaces, 4 for
    /// volumes, 2·ln 255 = 11.0825 for Gaussians, where an opaque one weighs 1/255.
    #[schemars(range(max = 100), extend("exclusiveMinimum" = 0))]
    cutoff: Option<f64>,
    /// Variance of the low-pass filter, pixel²; left out: 1, for Gaussians 0.3, which makes none of
    /// them fainter: opacity is at the peak.
    #[schemars(range(min = 0, max = 1e6))]
    low_pass: Option<f64>,
    /// Whether a Gaussian is made fainter by as much as the low-pass filter widens it: its peak is
    /// opacity · √(det V_r/det V), which Gaussians trained with Mip-Splatting's filter expect.
    /// Discs and volumes always have that factor. Left out, what the file of the Gaussians says
    /// (`comment SplatRenderMode: mip` of a PLY, the flag of a `.spz`), else false.
    compensate_opacity: Option<bool>,
    /// How a volume's kernels are filtered.
    low_pass_by: LowPass,
    /// What is drawn of a splat; others than the papers' are for comparison.
    filter: FilterField,
    /// Splats whose centres lie farther to the side than this, in half pictures, are not drawn;
    /// left out: 1.5, for Gaussians 100.
    #[schemars(range(max = 100), extend("exclusiveMinimum" = 0))]
    guard: Option<f64>,
    /// Farther to the side than this, in half pictures, an ellipsoid is projected as if it were
    /// there.
    #[schemars(range(max = 100), extend("exclusiveMinimum" = 0))]
    jacobian: f64,
}

#[derive(Deserialize, JsonSchema, Clone, Copy, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum FilterField {
    /// The projected ellipse with the low-pass filter: the papers' own.
    Ewa,
    /// The ellipse without the filter: as if `low_pass` were 0.
    Elliptical,
    /// A circle as wide as the ellipse's major axis, with the filter. Of discs; `golden` and
    /// `ideal` alone draw it, in the example `filters`.
    Circular,
    /// Heckbert's source-space EWA: the filter is brought onto the splat's plane along each pixel's
    /// ray. Of discs; drawn as `circular` is.
    SourceEwa,
}

#[derive(Deserialize, JsonSchema, Clone, Copy, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum LowPass {
    /// Each footprint is convolved with the filter (EWA §6.2).
    Convolution,
    /// Each kernel is enlarged, the same in all directions, until its thinnest axis is as wide as
    /// the filter (Swan et al. 1997).
    Scaling,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct SurfaceFields {
    /// Contributions nearer than this in depth belong together; left out: 4 × the median radius.
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
    /// From the surface to the light, world space, of any length but 0.
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
    /// The colour as it is; the other fields then mean nothing.
    unlit: bool,
    #[schemars(range(min = 0, max = 1e6))]
    ambient: f64,
    #[schemars(range(min = 0, max = 1e6))]
    diffuse: f64,
    #[schemars(range(min = 0, max = 1e6))]
    specular: f64,
    #[schemars(range(min = 0, max = 1e6))]
    shininess: f64,
    /// Share of what leaves the surface that is its surroundings, mirrored; of unlit materials too.
    /// Needs `environment`.
    #[schemars(range(min = 0, max = 1))]
    reflect: f64,
    /// Factor on what is mirrored.
    #[schemars(inner(range(min = 0, max = 1)))]
    tint: [f64; 3],
}

/// How much of a tree of splats is drawn (docs/book/level-of-detail.md).
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct DetailFields {
    /// The coarsest nodes are drawn whose spheres are no larger on the screen, pixels across; 0
    /// draws every splat.
    #[schemars(range(min = 0, max = 1e6))]
    pixels: f64,
    /// In which order; left out: `walk`, or with a budget `coarse-to-fine`.
    order: Option<DetailOrder>,
    /// Leaves out nodes outside of the picture, and where `cull_backfaces` is true those whose
    /// normals all face away.
    cull: bool,
    /// Nodes whose children a walker asks for at a time.
    #[schemars(range(min = 1, max = 1024))]
    ahead: usize,
    /// Most children of a node where the tree is built from splats; a tree that is read has its
    /// own.
    #[schemars(range(min = 2, max = MOST_CHILDREN))]
    children: usize,
    /// What the frame may take: the largest nodes become their children first, and none for which
    /// there is no room.
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
    /// As the walk comes to them.
    Walk,
    /// The largest on the screen first.
    CoarseToFine,
}

/// What a frame may take; what is left out has no limit.
#[derive(Deserialize, JsonSchema, Default)]
#[serde(deny_unknown_fields, default)]
struct BudgetFields {
    /// Splats that are drawn.
    #[schemars(range(min = 1))]
    splats: Option<u64>,
    /// Bytes of nodes that are read from memory, by the machine's words.
    #[schemars(range(min = 1))]
    bytes: Option<u64>,
    /// Cycles of the frame on the machine.
    #[schemars(range(min = 1))]
    cycles: Option<u64>,
}

impl DetailFields {
    fn rules(&self) -> Rules {
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
        Rules {
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

fn usual_fov() -> f64 {
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

/// A scene as one of its frames shows it.
pub(super) struct Seen {
    pub scene: Scene,
    /// A camera a frame.
    pub cameras: Vec<Camera>,
    /// Whether cameras were given, be it one: then it is a sequence.
    pub is_sequence: bool,
    /// Whether frames differ in nothing but the camera: splats of volumes and Gaussians are ordered
    /// and coloured for the eye.
    pub shares_splats: bool,
}

/// Which frame is seen, and by cameras of which file instead of the scene's own.
#[derive(Clone, Copy)]
pub(super) struct Which<'a> {
    pub frame: usize,
    pub cameras: Option<&'a CameraFile>,
}

/// Reads a scene file's text. Files that it names lie relative to `folder`; `name` begins every
/// error.
pub(super) fn read(
    text: &str,
    name: &str,
    folder: &Path,
    overrides: &Overrides,
    which: Which,
) -> Result<Seen> {
    build(fields(text, name)?, name, folder, overrides, which)
}

/// The same with these splats instead of the text's own, which may be any. A normal or a radius of
/// 0 is fitted.
pub(super) fn read_with(
    splats: Vec<Splat>,
    text: &str,
    name: &str,
    folder: &Path,
    overrides: &Overrides,
    which: Which,
) -> Result<Seen> {
    let mut fields = fields(text, name)?;
    fields.splats = Source::Given(splats);
    build(fields, name, folder, overrides, which)
}

fn fields(text: &str, name: &str) -> Result<SceneFields> {
    let input_error = |sentence: String| Error::input(format!("{name}: {sentence}"));
    let value = strict_json::parse(text).map_err(input_error)?;
    validate::check(&value, &schema()).map_err(|misfit| input_error(misfit.to_string()))?;
    serde_json::from_value(value).map_err(|e| input_error(e.to_string()))
}

/// Makes the scene of a file of splats alone, all else left out; `name` begins every error.
pub(super) fn of_file(
    file: &Path,
    name: &str,
    overrides: &Overrides,
    which: Which,
) -> Result<Seen> {
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
    which: Which,
) -> Result<Seen> {
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
    if kind == Kind::Mixed {
        let count = gathered.splats.len() as u64;
        memory::check(count, "splats", memory::GAUSSIAN_BYTES)
            .map_err(|sentence| input_error(format!("splats: {sentence}")))?;
    }
    // Training programs have y down, as their cameras do.
    let up = if kind == Kind::Gaussians {
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
            "0 alone is right".into()
        } else {
            format!("0 to {} are right", cameras.len() - 1)
        };
        return Err(input_error(format!(
            "has no frame {} (--frame): {right}",
            which.frame
        )));
    };
    // Whatever else depends on the eye is the first one's: the world stays as it is while the eye
    // moves.
    if which.cameras.is_none() && fields.frames_itself() {
        let (missed, all) = (
            cameras[0].misses(&image, &gathered.splats),
            gathered.splats.len(),
        );
        if missed > 0 {
            gathered.notes.push(format!("{missed} of {all} splats lie outside of the frame that was chosen; `camera` shows them"));
        }
    }
    gathered
        .notes
        .extend(which.cameras.iter().flat_map(|file| &file.notes).cloned());
    gathered.complete(cameras[0].eye);
    let lights = lights(fields.lights, &cameras[0]).map_err(input_error)?;
    let surface = surface(&fields.surface, &gathered.splats);
    if [Kind::Volume, Kind::Mixed].contains(&kind) && surface.coverage_threshold > 1.0 {
        return Err(input_error(format!(
            "surface.coverage_threshold is {}; a volume's splats are lit with weight 1, so at most 1 is right",
            surface.coverage_threshold
        )));
    }
    if fields.kernel.low_pass_by == LowPass::Scaling && kind != Kind::Volume {
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
        && ![Kind::Gaussians, Kind::Mixed].contains(&kind)
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
    if surface.cull_backfaces && kind != Kind::Surfaces {
        return Err(input_error(
            "surface.cull_backfaces is true, and neither voxels nor Gaussians have a back".into(),
        ));
    }
    if gathered.comes_by_depth() && fields.sheets.order == Some(SheetOrder::BackToFront) {
        return Err(input_error("sheets.order is \"back-to-front\", and samples that are sorted by depth come front-to-back".into()));
    }
    let detail = match &fields.level_of_detail {
        None => None,
        Some(_) if !gathered.media.is_empty() => {
            return Err(input_error("level_of_detail is of discs, and these splats are voxels, Gaussians or an isosurface".into()));
        }
        Some(fields) => Some(gathered.detail(fields).map_err(input_error)?),
    };
    let compensate_opacity = kind == Kind::Gaussians
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
    // What is written of a scene may be a comment of one line.
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
        notes,
    };
    match kind {
        Kind::Mixed => mixed(media, &fields.sheets, &mut scene),
        Kind::Surfaces => surfaces(media, &mut scene),
        Kind::Volume | Kind::Gaussians => media
            .into_iter()
            .for_each(|part| part.medium.complete(&fields.sheets, &mut scene)),
    }
    if fields.kernel.low_pass_by == LowPass::Scaling {
        scene.scale_kernels();
    }
    let scene = scene.cut();
    let is_sequence =
        which.cameras.is_some() || fields.cameras.is_some() || fields.camera_path.is_some();
    // Of a tree each camera has a cut of its own.
    let shares_splats = kind == Kind::Surfaces && scene.detail.is_none();
    Ok(Seen {
        scene,
        cameras,
        is_sequence,
        shares_splats,
    })
}

/// Surroundings, and what the materials do with them; none where no material mirrors anything.
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

/// What a scene's defaults depend on.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Surfaces,
    Volume,
    Gaussians,
    /// Several of these in one frame.
    Mixed,
}

fn kernel(fields: &KernelFields, kind: Kind) -> Kernel {
    let (cutoff, low_pass, guard) = match kind {
        Kind::Surfaces => (2.0, 1.0, 1.5),
        Kind::Volume | Kind::Mixed => (4.0, 1.0, 1.5),
        // Programs that train draw what lies far to the side as well.
        Kind::Gaussians => (gaussian_cutoff(), 0.3, 100.0),
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

/// What more than discs a scene is of.
enum Medium {
    /// Splats are voxels, in the order of the samples until the view is known.
    Volume(Voxels),
    /// Splats are samples with kernels of their own, in the order of the samples; of a rectilinear
    /// grid with its slices.
    Cells(Vec<Orientation>, Option<Slices>),
    /// Splats lie on a surface and are flat; and the area that each stands for, world units².
    Isosurface(Vec<Orientation>, f64),
    /// Splats are trained; colours wait for the eye. All are turned by this since they were read.
    Gaussians(Gaussians, DQuat),
}

/// Some of a scene's splats that are more than discs.
struct Part {
    splats: Range<usize>,
    medium: Medium,
}

impl SheetFields {
    /// Of what emits.
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
        }
    }
}

impl Medium {
    /// Brings it to another place, without its splats.
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
                    // A sample by itself is a sheet, as a Gaussian is.
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
                    harmonics: 0,
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
                let harmonics = gaussians.degree as u8;
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
                });
                scene.image.encoded = true;
            }
        }
    }
}

/// Colour of a Gaussian that was turned, seen along a way from the eye.
fn seen_colour(gaussians: &Gaussians, index: usize, turn: DQuat, way: DVec3) -> [f64; 3] {
    gaussians::colour(
        gaussians.harmonics(index),
        turn.conjugate() * unit(way).unwrap_or(DVec3::Z),
    )
}

fn of_gaussian(gaussian: &Gaussian, turn: DQuat) -> Orientation {
    // A turn by nothing is no product: old scenes keep their last bits.
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

/// A disc as an ellipsoid that is `flatten` times thinner along its normal.
fn of_disc(normal: DVec3, flatten: f64) -> Orientation {
    Orientation {
        rotation: DQuat::from_rotation_arc(DVec3::Z, normal),
        scales: DVec3::new(1.0, 1.0, 1.0 / flatten),
    }
}

/// Surfaces alone: where one is of flattened kernels, all are.
fn surfaces(media: Vec<Part>, scene: &mut Scene) {
    if media.is_empty() {
        return;
    }
    let mut all: Vec<Orientation> = scene
        .splats
        .iter()
        .map(|splat| of_disc(splat.normal, FLATTEST))
        .collect();
    for Part { splats, medium } in media {
        if let Medium::Isosurface(orientations, _) = medium {
            all[splats].copy_from_slice(&orientations);
        }
    }
    Medium::Isosurface(all, 0.0).complete(&SheetFields::default(), scene);
}

/// Everything in one frame: each splat is a sheet of its own, sorted by depth, that emits and
/// absorbs as a volume's do (EWA Fig. 16).
///
/// A surface is a thin layer of that depth: its kernels, flattened, share the optical depth of its
/// opacity, by the area that each stands for; a disc of σ stands for σ². A Gaussian is as deep
/// along the way to the eye as its peak is opaque, and sends the light that its colour is on a
/// screen.
fn mixed(media: Vec<Part>, fields: &SheetFields, scene: &mut Scene) {
    let cutoff = scene.kernel.cutoff;
    // Peak of a flattened kernel seen from the front, which stands for a part of σ².
    let layer = |opacity: f64, part: f64| depth_of_layer(opacity, cutoff) * part / TAU;
    let mut all: Vec<Orientation> = scene
        .splats
        .iter()
        .map(|splat| of_disc(splat.normal, flat()))
        .collect();
    let mut is_disc = vec![true; scene.splats.len()];
    let eye = scene.camera.eye;
    let unlit = scene.materials.len() as u32;
    for Part {
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
                    // Of a ball the depth through its middle is the opacity; an ellipsoid has
                    // 1/(Πsᵢ·√Σ(dᵢ/sᵢ)²) of that along d.
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

/// Points that must ascend.
fn ascending(
    values: impl Iterator<Item = f64> + Clone,
    path: &str,
    field: &str,
) -> std::result::Result<(), String> {
    let pairs = values.clone().zip(values.skip(1)).enumerate();
    match pairs.into_iter().find(|(_, (a, b))| a >= b) {
        Some((i, (a, b))) => Err(format!(
            "{path}[{}].{field} is {b}, which does not lie above the {a} before it",
            i + 1
        )),
        None => Ok(()),
    }
}

// ---- splats ----

/// The splats of all sources, while they are being read.
struct Gathered<'a> {
    name: &'a str,
    folder: &'a Path,
    splats: Vec<Splat>,
    /// Ends of the clouds whose splats are each other's neighbours, and the factor on their radii.
    clouds: Vec<(usize, f64)>,
    materials: Vec<Material>,
    materials_are_given: bool,
    /// What is more than discs, in the order of the splats.
    media: Vec<Part>,
    /// Where a volume's kernels end.
    volume_cutoff: f64,
    /// Whether samples were left out that have a cell of no volume.
    lacks_cells: bool,
    /// A tree that was read: of all splats, if no other source or factor changed them.
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
        let volume_cutoff = kernel(&fields.kernel, Kind::Volume).cutoff;
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
                gaussians: BuiltinGaussians::Bouquet,
                count,
            }) => {
                self.take_gaussians(gaussians::bouquet(*count), [1.0; 2]);
                Ok(())
            }
            Source::Placed(source) => self.add_placed(source, path),
            Source::Several(sources) => self.add_several(sources, path),
            Source::Given(splats) => self.add_given(splats, path),
        }
    }

    fn kind(&self) -> Kind {
        match self.media.as_slice() {
            parts
                if parts
                    .iter()
                    .all(|part| matches!(part.medium, Medium::Isosurface(..))) =>
            {
                Kind::Surfaces
            }
            [part] if part.splats == (0..self.splats.len()) => match part.medium {
                Medium::Volume(_) | Medium::Cells(..) => Kind::Volume,
                Medium::Gaussians(..) => Kind::Gaussians,
                Medium::Isosurface(..) => Kind::Surfaces,
            },
            _ => Kind::Mixed,
        }
    }

    /// Whether splats are sheets of their own, drawn by depth, that may also be drawn as a volume.
    fn comes_by_depth(&self) -> bool {
        self.kind() == Kind::Mixed
            || matches!(
                self.media.as_slice(),
                [Part {
                    medium: Medium::Cells(_, None),
                    ..
                }]
            )
    }

    /// What is wrong where there are no splats.
    fn nothing(&self) -> &'static str {
        if self.lacks_cells {
            return "shows nothing of the volume; samples that its transfer function shows have a cell of no volume";
        }
        match self.media.first().map(|part| &part.medium) {
            Some(Medium::Volume(_) | Medium::Cells(..)) => {
                "shows nothing of the volume; a transfer function must give some of its values an opacity above 0"
            }
            Some(Medium::Isosurface(..)) => {
                "has no surface of this isovalue; it must lie between the least and the greatest value of the volume"
            }
            _ => "holds no splats; a scene needs at least one",
        }
    }

    /// Adds splats that are more than discs.
    fn add_medium(&mut self, splats: Vec<Splat>, medium: Medium) {
        self.end_cloud(1.0);
        let start = self.splats.len();
        self.splats.extend(splats);
        self.media.push(Part {
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
            "{path}.place brings splats beyond what a scene holds: positions lie within ±{:e}, radii from {LEAST_RADIUS:e}",
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
                    "{path}.{field} names an array of a file of VTK's, and this is none"
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
            // Beside others every splat has an orientation of its own.
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
                // Where no sample has a cell, none is seen either.
                let layer = source.layer.or_else(|| cells.usual_layer()).unwrap_or(1.0);
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

    /// Gaussians whose radii and opacities are that much greater.
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

    /// Whether the file of the Gaussians says that their opacities are compensated; a note says so.
    fn compensates(&mut self) -> bool {
        let asks = self.media.iter().any(
            |part| matches!(&part.medium, Medium::Gaussians(gaussians, _) if gaussians.compensated),
        );
        if asks {
            let says = "opacities are compensated for the low-pass filter, as the file asks (`kernel.compensate_opacity`: false draws them without)";
            self.notes.push(says.into());
        }
        asks
    }

    /// Splats that follow each other in an array are one cloud; every other source is one of its
    /// own.
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
        if source.order == Order::Random {
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

    /// A tree of all splats: the one that was read, where it is of just these.
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

    /// Fills in what files leave out of their splats, cloud by cloud.
    fn complete(&mut self, eye: DVec3) {
        self.end_cloud(1.0);
        let mut start = 0;
        // Both in the order of the splats; what is more than discs is a cloud of its own.
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
    /// A file alone, all else left out.
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
    /// Says what the splats that are asked for by number would take, before any are made.
    fn check_memory(&self) -> std::result::Result<(), String> {
        let what = if matches!(self, Source::Gaussians(_)) {
            "Gaussians"
        } else {
            "splats"
        };
        // Where any has an orientation, all have one.
        let bytes_each = if self.is_medium() {
            memory::GAUSSIAN_BYTES
        } else {
            memory::DISC_BYTES
        };
        memory::check(self.promised(), what, bytes_each)
            .map_err(|sentence| format!("splats: {sentence}"))
    }

    /// Whether anything of it is known to be more than discs before files are read.
    fn is_medium(&self) -> bool {
        match self {
            Source::Gaussians(_) | Source::Volume(_) => true,
            Source::Several(sources) => sources.iter().any(Source::is_medium),
            Source::Placed(source) => source.splats.is_medium(),
            Source::File(_) | Source::Splat(_) | Source::Given(_) | Source::Builtin(_) => false,
        }
    }

    /// How many splats are asked for by number.
    fn promised(&self) -> u64 {
        match self {
            Source::Builtin(source) => source.count.unwrap_or(0) as u64,
            Source::Gaussians(source) => source.count as u64,
            Source::Several(sources) => sources.iter().map(Source::promised).sum(),
            Source::Placed(source) => source.splats.promised(),
            // A file vouches for its own by its length.
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

/// A direction of any length but 0, made a unit vector.
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
    /// At most one of the three ways to say what sees the scene.
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

    /// Whether the one camera's place is left to be chosen.
    fn frames_itself(&self) -> bool {
        self.cameras.is_none()
            && self.camera_path.is_none()
            && self
                .camera
                .as_ref()
                .is_none_or(|camera| camera.eye.is_none())
    }

    /// A camera a frame.
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

/// How far two angles of view may differ that mean the same, as a part of one.
const SAME_ANGLE: f64 = 1e-6;

/// Completes a camera; `whose` begins every complaint. A picture of the scene is an `image`, which
/// may be larger or smaller than the `picture` that the scene file has.
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
            "{whose}.picture_px is the size that focal_px and centre_px refer to, and neither is given"
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
            "{whose} has fov_y_degrees {angle} and a focal_px that means {meant}; one of both is enough"
        ));
    }
    let fov_y_degrees = meant.or(fields.fov_y_degrees).unwrap_or_else(usual_fov);
    // Tangents of half the angles of view, across to down.
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

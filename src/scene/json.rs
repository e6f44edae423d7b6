//! JSON: reads a scene file (INTERFACE: "Scene") and fills in what it leaves out.
//!
//! The types below are the file format: the JSON Schema is derived from them, and a file is held against that schema
//! before it is read into them. What a schema cannot say (directions that are zero, indices out of range) comes after.

use super::{Camera, Image, Kernel, Light, Material, Overrides, Scene, Splat, Surface};
use super::{
    builtin::{self, Builtin, Order},
    camera::Ball,
    neighbours, ply, unit,
};
use crate::error::{Error, Result};
use crate::validate;
use glam::DVec3;
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::{Value, json};
use std::path::Path;

/// ε, left out, is this many times the median radius: served well on three scans (ALGORITHM §2).
const Z_THRESHOLD_OF_RADIUS: f64 = 4.0;
/// The near plane, left out, lies at this share of the way from the eye to its target.
const NEAR_OF_DISTANCE: f64 = 1e-3;
/// Most pixels of a picture along a side, and in all: what a desktop computer still holds a few times over.
const LONGEST_SIDE: usize = 16384;
const MOST_PIXELS: usize = 1 << 25;
/// Nearer than this the eye and its target are one point: squares of such distances vanish in f64.
const NEAREST_TARGET: f64 = 1e-100;
/// Sine of the least angle between the view and up; below it rounding would turn the picture.
const LEAST_SINE: f64 = 1e-9;

/// A scene: splats, and how they are looked at. All numbers in world units, linear light and degrees.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "splatsim scene")]
struct SceneFields {
    /// Where the splats come from.
    splats: Source,
    /// The eye; what is left out is chosen so that the splats fill the picture.
    #[serde(default)]
    camera: CameraFields,
    /// The picture.
    #[serde(default)]
    image: ImageFields,
    /// The footprint.
    #[serde(default)]
    kernel: KernelFields,
    /// How fragments become surfaces.
    #[serde(default)]
    surface: SurfaceFields,
    /// Directional lights; left out: one white light from behind the eye.
    lights: Option<Vec<LightFields>>,
    /// What splats' `material` counts in; left out: the built-in sources' own, for others one Blinn-Phong.
    #[schemars(length(min = 1))]
    materials: Option<Vec<MaterialFields>>,
}

/// A splat, a file, a built-in cloud, or an array of these.
#[derive(Deserialize, JsonSchema)]
#[serde(untagged)]
enum Source {
    // First, because they are tried in this order and there may be millions of this one.
    Splat(SplatFields),
    File(FileSource),
    Builtin(BuiltinSource),
    Several(Vec<Source>),
}

/// Points of a PLY file.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct FileSource {
    /// Path of the PLY, relative to the scene file.
    file: String,
    /// Index into `materials`.
    #[serde(default)]
    #[schemars(range(max = u32::MAX))]
    material: u32,
    /// Factor on all radii, be they the file's or fitted.
    #[serde(default = "one")]
    #[schemars(range(max = 1e30), extend("exclusiveMinimum" = 0))]
    radius_scale: f64,
    /// Factor on all opacities.
    #[serde(default = "one")]
    #[schemars(range(min = 0, max = 1))]
    opacity: f64,
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
    /// Standard deviation of the kernel; left out: mean distance to the 6 nearest splats of the same array.
    #[schemars(range(max = 1e30), extend("exclusiveMinimum" = 0))]
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

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct CameraFields {
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    eye: Option<[f64; 3]>,
    /// What lands on the middle of the picture.
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    target: Option<[f64; 3]>,
    /// What is up in the picture; left out: y, or z where the eye looks along y.
    #[schemars(inner(range(min = -1e30, max = 1e30)))]
    up: Option<[f64; 3]>,
    /// Full vertical angle of view. Narrower than the least, f64 has no use for the picture's coordinates.
    #[schemars(range(min = 1e-6), extend("exclusiveMaximum" = 180))]
    fov_y_degrees: f64,
    /// Splats at or nearer than this depth are not drawn; left out: a thousandth of the way to the target.
    #[schemars(range(max = 1e30), extend("exclusiveMinimum" = 0))]
    near: Option<f64>,
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
    /// Fragments exist where the radial index is below this.
    #[schemars(range(max = 100), extend("exclusiveMinimum" = 0))]
    cutoff: f64,
    /// Variance of the low-pass filter, pixel².
    #[schemars(range(min = 0, max = 1e6))]
    low_pass: f64,
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
}

fn one() -> f64 {
    1.0
}

fn grey() -> [f64; 3] {
    [0.5; 3]
}

fn white() -> [f64; 3] {
    [1.0; 3]
}

impl Default for CameraFields {
    fn default() -> Self {
        CameraFields { eye: None, target: None, up: None, fov_y_degrees: 45.0, near: None }
    }
}

impl Default for ImageFields {
    fn default() -> Self {
        ImageFields { width: 512, height: 512, background: [0.0; 4] }
    }
}

impl Default for KernelFields {
    fn default() -> Self {
        KernelFields { cutoff: 2.0, low_pass: 1.0 }
    }
}

impl Default for SurfaceFields {
    fn default() -> Self {
        SurfaceFields { z_threshold: None, coverage_threshold: 0.4, cull_backfaces: false }
    }
}

impl Default for MaterialFields {
    fn default() -> Self {
        MaterialFields { unlit: false, ambient: 0.15, diffuse: 0.8, specular: 0.3, shininess: 32.0 }
    }
}

/// The JSON Schema of a scene file.
pub fn schema() -> Value {
    schemars::schema_for!(SceneFields).to_value()
}

/// Reads a scene file's text. Files that it names lie relative to `folder`; `name` begins every error.
pub(super) fn read(text: &str, name: &str, folder: &Path, overrides: &Overrides) -> Result<Scene> {
    let value: Value = serde_json::from_str(text).map_err(|e| Error::input(format!("{name}: not JSON: {e}")))?;
    read_value(value, name, folder, overrides)
}

/// The scene of a PLY alone: all else left out.
pub(super) fn of_cloud(path: &Path, name: &str, overrides: &Overrides) -> Result<Scene> {
    let file = path.file_name().unwrap_or_default().to_string_lossy();
    read_value(json!({"splats": {"file": file}}), name, path.parent().unwrap_or(Path::new("")), overrides)
}

fn read_value(value: Value, name: &str, folder: &Path, overrides: &Overrides) -> Result<Scene> {
    let told = |sentence: String| Error::input(format!("{name}: {sentence}"));
    validate::check(&value, &schema()).map_err(|misfit| told(misfit.to_string()))?;
    let fields: SceneFields = serde_json::from_value(value).map_err(|e| told(e.to_string()))?;
    build(fields, name, folder, overrides)
}

fn build(fields: SceneFields, name: &str, folder: &Path, overrides: &Overrides) -> Result<Scene> {
    let told = |sentence: String| Error::input(format!("{name}: {sentence}"));
    let image = image(&fields.image, name, overrides)?;
    let mut gathered = Gathered::new(name, folder, &fields);
    gathered.add(&fields.splats, "splats")?;
    if gathered.splats.is_empty() {
        return Err(told("holds no splats; a scene needs at least one".into()));
    }
    let camera = camera(&fields.camera, &image, &gathered.splats).map_err(told)?;
    gathered.complete(camera.eye);
    let Gathered { splats, materials, notes, .. } = gathered;
    let lights = lights(fields.lights, &camera).map_err(told)?;
    let surface = surface(&fields.surface, &splats);
    let kernel = Kernel { cutoff: fields.kernel.cutoff, low_pass: fields.kernel.low_pass };
    let name = Path::new(name).file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Scene { name, splats, camera, image, kernel, surface, lights, materials, notes })
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
        Gathered { name, folder, splats: vec![], clouds: vec![], materials, materials_are_given, notes: vec![] }
    }

    fn add(&mut self, source: &Source, path: &str) -> Result<()> {
        match source {
            Source::File(file) => self.add_file(file, path),
            Source::Builtin(builtin) => self.add_builtin(builtin, path),
            Source::Splat(splat) => self.add_splat(splat, path),
            Source::Several(sources) => self.add_several(sources, path),
        }
    }

    /// Splats that follow each other in an array are one cloud; every other source is one of its own.
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
        let told = |sentence: String| Error::input(format!("{}: {sentence}", file.display()));
        let bytes = std::fs::read(&file).map_err(|e| told(format!("cannot be read: {e}")))?;
        let cloud = ply::parse(&bytes).map_err(told)?;
        let own = |splat: Splat| Splat { material, opacity: splat.opacity * source.opacity, ..splat };
        self.splats.extend(cloud.splats.into_iter().map(own));
        self.notes.extend(cloud.notes.iter().map(|note| format!("{}: {note}", file.display())));
        self.end_cloud(source.radius_scale);
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
        self.splats.extend(splats.into_iter().map(|splat| Splat { material: splat.material + first, ..splat }));
        self.end_cloud(1.0);
        Ok(())
    }

    fn add_splat(&mut self, splat: &SplatFields, path: &str) -> Result<()> {
        let normal = splat.normal.map(|normal| direction(normal, &format!("{path}.normal"))).transpose();
        self.splats.push(Splat {
            position: DVec3::from_array(splat.position),
            normal: normal.map_err(|sentence| self.told(sentence))?.unwrap_or(DVec3::ZERO),
            radius: splat.radius.unwrap_or(0.0),
            rgb: splat.rgb,
            opacity: splat.opacity,
            material: self.known_material(splat.material, path)?,
        });
        Ok(())
    }

    fn known_material(&self, index: u32, path: &str) -> Result<u32> {
        let count = if self.materials_are_given { self.materials.len() } else { 1 };
        if (index as usize) < count {
            return Ok(index);
        }
        Err(self.told(format!("{path} uses material {index}, but `materials` has only the indices 0 to {}", count - 1)))
    }

    fn told(&self, sentence: String) -> Error {
        Error::input(format!("{}: {sentence}", self.name))
    }

    fn end_cloud(&mut self, radius_scale: f64) {
        self.clouds.push((self.splats.len(), radius_scale));
    }

    /// Fills in what files leave out of their splats, cloud by cloud.
    fn complete(&mut self, eye: DVec3) {
        self.end_cloud(1.0);
        let mut start = 0;
        for &(end, radius_scale) in &self.clouds {
            let cloud = &mut self.splats[start..end];
            neighbours::fit(cloud, eye);
            cloud.iter_mut().for_each(|s| s.radius = (s.radius * radius_scale).clamp(f64::MIN_POSITIVE, ply::FARTHEST));
            start = end;
        }
    }
}

impl Source {
    fn is_only_builtin(&self) -> bool {
        match self {
            Source::Builtin(_) => true,
            Source::Several(sources) => sources.iter().all(Source::is_only_builtin),
            Source::File(_) | Source::Splat(_) => false,
        }
    }
}

// ---- the view ----

/// A direction of any length but 0, made a unit vector.
fn direction(vector: [f64; 3], path: &str) -> std::result::Result<DVec3, String> {
    unit(DVec3::from_array(vector)).ok_or_else(|| format!("{path} is zero; it must point somewhere"))
}

fn image(fields: &ImageFields, name: &str, overrides: &Overrides) -> Result<Image> {
    let (width, height) = overrides.size.unwrap_or((fields.width, fields.height));
    let told = |right: String| {
        let whose = if overrides.size.is_some() { "--size".into() } else { format!("{name}: image") };
        Error::input(format!("{whose} is {width}x{height} pixels; it must be {right}"))
    };
    if !(1..=LONGEST_SIDE).contains(&width) || !(1..=LONGEST_SIDE).contains(&height) {
        return Err(told(format!("1 to {LONGEST_SIDE} on each side")));
    }
    if width * height > MOST_PIXELS {
        return Err(told(format!("at most {MOST_PIXELS} pixels in all")));
    }
    Ok(Image { width, height, background: fields.background })
}

fn camera(fields: &CameraFields, image: &Image, splats: &[Splat]) -> std::result::Result<Camera, String> {
    let (eye, target) = eye_and_target(fields, image, splats);
    let distance = (target - eye).length();
    if distance < NEAREST_TARGET {
        return Err("camera.eye and camera.target are the same point; they must differ".into());
    }
    let forward = (target - eye) / distance;
    let up = match fields.up {
        Some(up) => direction(up, "camera.up")?,
        None if forward.y.abs() > 0.999 => DVec3::Z,
        None => DVec3::Y,
    };
    if forward.cross(up).length() < LEAST_SINE {
        return Err("camera.up is parallel to the view from eye to target; it must point to the side of it".into());
    }
    let near = fields.near.unwrap_or(distance * NEAR_OF_DISTANCE);
    Ok(Camera { eye, target, up, fov_y_degrees: fields.fov_y_degrees, near })
}

fn eye_and_target(fields: &CameraFields, image: &Image, splats: &[Splat]) -> (DVec3, DVec3) {
    let [eye, target] = [fields.eye, fields.target].map(|point| point.map(DVec3::from_array));
    if let (Some(eye), Some(target)) = (eye, target) {
        return (eye, target);
    }
    let ball = Ball::around(splats);
    let target = target.unwrap_or(ball.centre);
    let aspect = image.width as f64 / image.height as f64;
    (eye.unwrap_or_else(|| target + ball.way_to_eye(fields.fov_y_degrees, aspect)), target)
}

fn lights(fields: Option<Vec<LightFields>>, camera: &Camera) -> std::result::Result<Vec<Light>, String> {
    let Some(lights) = fields else {
        return Ok(vec![Light { direction: (camera.eye - camera.target).normalize(), rgb: white() }]);
    };
    let light = |(i, light): (usize, &LightFields)| {
        Ok(Light { direction: direction(light.direction, &format!("lights[{i}].direction"))?, rgb: light.rgb })
    };
    lights.iter().enumerate().map(light).collect()
}

fn surface(fields: &SurfaceFields, splats: &[Splat]) -> Surface {
    let usual = || {
        let radius = neighbours::median(splats.iter().map(|s| s.radius).collect()).expect("a scene has splats");
        radius * Z_THRESHOLD_OF_RADIUS
    };
    Surface {
        z_threshold: fields.z_threshold.unwrap_or_else(usual),
        coverage_threshold: fields.coverage_threshold,
        cull_backfaces: fields.cull_backfaces,
    }
}

fn material(fields: &MaterialFields) -> Material {
    let &MaterialFields { unlit, ambient, diffuse, specular, shininess } = fields;
    if unlit { Material::Unlit } else { Material::BlinnPhong { ambient, diffuse, specular, shininess } }
}

#[cfg(test)]
mod tests;

//! Scene: everything that is to be drawn and how it is looked at, complete and checked, in f64 and world units.
//!
//! A value of [`Scene`] has no holes left: readers fill in what a file leaves out (INTERFACE: "Scene").

mod builtin;
mod camera;
mod json;
mod neighbours;
mod ply;

pub use builtin::Builtin;
pub use json::schema;

use crate::error::{Error, Result};
use glam::{DMat3, DVec3};
use std::path::Path;

/// One surface splat: a Gaussian disc (ALGORITHM §2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Splat {
    /// Centre, world units.
    pub position: DVec3,
    /// Unit normal, world space.
    pub normal: DVec3,
    /// Standard deviation σ of the reconstruction kernel in the tangent plane, world units, > 0.
    pub radius: f64,
    /// Linear light, each in [0, 1].
    pub rgb: [f64; 3],
    /// α in [0, 1].
    pub opacity: f64,
    /// Index into [`Scene::materials`].
    pub material: u32,
}

/// Where the eye is and what it sees (ALGORITHM §1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// World position of the eye.
    pub eye: DVec3,
    /// World position that lands on the middle of the picture.
    pub target: DVec3,
    /// Direction that is up in the picture; not parallel to `target − eye`.
    pub up: DVec3,
    /// Full vertical angle of view, degrees, in (0, 180).
    pub fov_y_degrees: f64,
    /// Splats at or nearer than this depth are culled, world units, > 0.
    pub near: f64,
}

/// The picture to make.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Image {
    /// Pixels, 1 to 16384.
    pub width: usize,
    /// Pixels, 1 to 16384.
    pub height: usize,
    /// Linear RGB and straight alpha, each in [0, 1].
    pub background: [f64; 4],
}

/// The footprint's constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kernel {
    /// Fragments exist where the radial index is below this, > 0.
    pub cutoff: f64,
    /// Variance of the low-pass filter, pixel², ≥ 0.
    pub low_pass: f64,
}

/// How fragments become surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// ε: contributions nearer than this in depth belong together, world units, > 0.
    pub z_threshold: f64,
    /// τ: weight sum from which a pixel counts as fully covered, > 0.
    pub coverage_threshold: f64,
    /// Drop splats whose normal points away from the eye.
    pub cull_backfaces: bool,
}

/// A directional light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Unit vector from the surface towards the light, world space.
    pub direction: DVec3,
    /// Linear light, each ≥ 0.
    pub rgb: [f64; 3],
}

/// How a surface answers light (ALGORITHM §7).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Material {
    /// The colour as it is.
    Unlit,
    /// Blinn-Phong with the viewer at infinity.
    BlinnPhong {
        /// Share of the colour that needs no light, ≥ 0.
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
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// What to call it in reports: file name or built-in name.
    pub name: String,
    /// In input order, which is the order the machine sees.
    pub splats: Vec<Splat>,
    /// The eye.
    pub camera: Camera,
    /// The picture.
    pub image: Image,
    /// The footprint.
    pub kernel: Kernel,
    /// Surface reconstruction.
    pub surface: Surface,
    /// May be empty: then only ambient light.
    pub lights: Vec<Light>,
    /// Never empty; every splat's index is in range.
    pub materials: Vec<Material>,
    /// What a reader left out or found odd, one sentence each, for the summary.
    pub notes: Vec<String>,
}

/// What the command line says over a scene's own file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overrides {
    /// Width and height of the picture, pixels.
    pub size: Option<(usize, usize)>,
}

/// The viewing transform in numbers: what camera and image make of world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// World → camera directions: rows are right, down, forward (x right, y down, z forward).
    pub rotation: DMat3,
    /// World position of the eye.
    pub eye: DVec3,
    /// `s`: pixels per unit of `t_x/t_z` (ALGORITHM §1).
    pub focal_px: f64,
    /// Half the picture's width and height, pixels.
    pub half_px: [f64; 2],
}

impl Scene {
    /// Reads a scene: the path of a `.json` scene file or of a `.ply` cloud, or, where there is no such file, the name of
    /// a built-in scene.
    ///
    /// # Errors
    /// [`Error::Input`], one sentence: which file, which field or row, what is wrong with it, what would be right.
    pub fn load(name_or_path: &str, overrides: &Overrides) -> Result<Scene> {
        let path = Path::new(name_or_path);
        let builtin = Builtin::ALL.into_iter().find(|builtin| builtin.name() == name_or_path);
        if let (Some(builtin), false) = (builtin, path.exists()) {
            return json::read(builtin.scene(), name_or_path, Path::new(""), overrides);
        }
        let told = |sentence: String| Error::input(format!("{name_or_path}: {sentence}"));
        if !path.exists() {
            let names = Builtin::ALL.map(Builtin::name).join(", ");
            return Err(told(format!("no such file, and no built-in scene either; built in are {names}")));
        }
        match path.extension().and_then(|e| e.to_str()).map(str::to_lowercase).as_deref() {
            Some("ply") => json::of_cloud(path, name_or_path, overrides),
            Some("json") => {
                let text = std::fs::read_to_string(path).map_err(|e| told(format!("cannot be read: {e}")))?;
                json::read(&text, name_or_path, path.parent().unwrap_or(Path::new("")), overrides)
            }
            _ => Err(told("is of no known kind; a scene is a .json file, a .ply file or a built-in name".into())),
        }
    }

    /// The text of a `.json` scene or of a built-in one, as [`Scene::load`] finds it; none where there is none.
    pub fn text(name_or_path: &str) -> Option<String> {
        let path = Path::new(name_or_path);
        if !path.exists() {
            return Builtin::ALL.into_iter().find(|builtin| builtin.name() == name_or_path).map(|builtin| builtin.scene().to_owned());
        }
        path.extension().filter(|extension| extension.eq_ignore_ascii_case("json"))?;
        std::fs::read_to_string(path).ok()
    }

    /// The viewing transform (ALGORITHM §1): `t = rotation · (p − eye)`.
    pub fn view(&self) -> View {
        let forward = (self.camera.target - self.camera.eye).normalize();
        let right = forward.cross(self.camera.up).normalize();
        let down = forward.cross(right);
        let half_px = [self.image.width as f64 / 2.0, self.image.height as f64 / 2.0];
        View {
            rotation: DMat3::from_cols(right, down, forward).transpose(),
            eye: self.camera.eye,
            focal_px: half_px[1] / libm::tan(self.camera.fov_y_degrees.to_radians() / 2.0),
            half_px,
        }
    }
}

/// The vector's direction, however long it is; none where it is zero or not finite.
fn unit(vector: DVec3) -> Option<DVec3> {
    let longest = vector.abs().max_element();
    // Divided first: squares of very long or very short vectors do not fit f64.
    (vector.is_finite() && longest > 0.0).then(|| (vector / longest).normalize())
}

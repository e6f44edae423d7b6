//! Frame: everything the machine is given for one picture, in words: constants in registers, splats in memory.
//!
//! The bench makes it (`quantise.rs` there is the one door from real numbers to bits); the machine only reads it.

/// One splat record (formats: machine `splat`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Splat {
    /// Centre.
    pub position: [i32; 3],
    /// Normal.
    pub normal: [i32; 3],
    /// σ.
    pub radius: i32,
    /// Colour.
    pub rgb: [i32; 3],
    /// α.
    pub opacity: i32,
    /// Index into [`Lighting::materials`].
    pub material: u32,
}

/// A positive constant as a mantissa and a power of two: `value = mantissa · 2^−places`, the mantissa in [½, 1].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Scaled {
    /// Word of the format named where it is used.
    pub mantissa: i64,
    /// Places to the right.
    pub places: i64,
}

/// The viewing registers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct View {
    /// Rows right, down, forward (`project.rotation`).
    pub rotation: [[i64; 3]; 3],
    /// The eye (`project.eye`).
    pub eye: [i64; 3],
    /// Depth at or below which splats are culled (`project.depth`).
    pub near: i64,
    /// Greatest |a| and |b| (`project.slope`).
    pub guard: [i64; 2],
    /// s (`project.focal`).
    pub focal: i64,
    /// 1/s (`ellipse.inverse_focal`).
    pub inverse_focal: Scaled,
    /// Variance of the low-pass filter (`ellipse.low_pass`).
    pub low_pass: i64,
    /// Cutoff (`raster.cutoff`).
    pub cutoff: i64,
    /// √cutoff (`ellipse.root_cutoff`).
    pub root_cutoff: i64,
    /// Drop splats that face away.
    pub cull_backfaces: bool,
}

/// A light, in camera space.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Light {
    /// Towards the light (`shade.light`).
    pub direction: [i64; 3],
    /// Half-way between light and viewer (`shade.light`); none where they are opposite.
    pub half_way: Option<[i64; 3]>,
}

/// A material's answer to the lights.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Material {
    /// The colour as it is.
    Unlit,
    /// Blinn-Phong.
    BlinnPhong {
        /// Ambient factor (`shade.reflectance`).
        ambient: i64,
        /// Diffuse factor times light, for each light (`shade.reflectance`).
        diffuse: Vec<[i64; 3]>,
        /// Specular factor times light, for each light (`shade.reflectance`).
        specular: Vec<[i64; 3]>,
        /// Words of x^shininess over [0, 1] (`shade.highlight`): at the steps' middles or at their ends.
        highlight: Vec<i64>,
    },
}

/// The lighting registers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Lighting {
    /// Directional lights.
    pub lights: Vec<Light>,
    /// Never empty where there are splats.
    pub materials: Vec<Material>,
}

/// One picture's work.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Frame {
    /// Pixels a row, 1 to 16384.
    pub width: u32,
    /// Rows, 1 to 16384.
    pub height: u32,
    /// Viewing registers.
    pub view: View,
    /// ε (`fragment.depth`).
    pub z_threshold: i64,
    /// τ (`fragment.weight_sum`).
    pub coverage_threshold: i64,
    /// 1/τ (`shade.inverse_threshold`).
    pub inverse_threshold: Scaled,
    /// Premultiplied RGBA behind everything (`resolve.frame`).
    pub background: [i64; 4],
    /// Lighting registers.
    pub lighting: Lighting,
    /// Splats in input order.
    pub splats: Vec<Splat>,
}

pub mod real;

//! Frame: all inputs of the machine for one picture, as words: constants in registers, splats in
//! memory.
//!
//! The bench makes the frame (only its `quantise.rs` converts real numbers into bits); the machine
//! only reads it.

pub mod lists;

pub use lists::{KeptLists, ListsBefore};

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

/// A positive constant as a mantissa and a power of two: `value = mantissa · 2^−places`, the
/// mantissa in [½, 1].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Scaled {
    /// Word of the format named where it is used.
    pub mantissa: i64,
    /// Right shift, bits.
    pub places: i64,
}

/// Registers of pixels that are not square: s_x and s_y instead of s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Aspect {
    /// s_x, s_y (`project.focal`).
    pub focal: [i64; 2],
    /// 1/s_x, 1/s_y (`ellipse.inverse_focal`).
    pub inverse_focal: [Scaled; 2],
    /// s_x², s_x·s_y and s_y², relative to s² (`ellipse.aspect`).
    pub squares: [i64; 3],
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
    /// s (`project.focal`); where pixels are not square, the larger of both.
    pub focal: i64,
    /// 1/s (`ellipse.inverse_focal`).
    pub inverse_focal: Scaled,
    /// Principal point from the picture's middle (`project.pixel`).
    pub centre: [i64; 2],
    /// Further registers if pixels are not square.
    pub aspect: Option<Aspect>,
    /// Variance of the low-pass filter (`ellipse.low_pass`).
    pub low_pass: i64,
    /// Cutoff (`raster.cutoff`).
    pub cutoff: i64,
    /// √cutoff (`ellipse.root_cutoff`).
    pub root_cutoff: i64,
    /// Drop splats that face away.
    pub cull_backfaces: bool,
}

impl View {
    /// s_x, s_y.
    pub fn focals(&self) -> [i64; 2] {
        self.aspect.map_or([self.focal; 2], |aspect| aspect.focal)
    }

    /// s_x², s_x·s_y and s_y² relative to s², in words in which `one` represents 1.
    pub fn squares(&self, one: i64) -> [i64; 3] {
        self.aspect.map_or([one; 3], |aspect| aspect.squares)
    }

    /// 1/s_x, 1/s_y.
    pub fn inverse_focals(&self) -> [Scaled; 2] {
        self.aspect
            .map_or([self.inverse_focal; 2], |aspect| aspect.inverse_focal)
    }
}

/// A light, in camera space.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Light {
    /// Towards the light (`shade.light`).
    pub direction: [i64; 3],
    /// Half-way between light and viewer (`shade.light`); none if they are opposite.
    pub half_way: Option<[i64; 3]>,
}

/// Reflection of light by a material.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Material {
    /// The colour itself.
    Unlit,
    /// Blinn-Phong.
    BlinnPhong {
        /// Ambient factor (`shade.reflectance`).
        ambient: i64,
        /// Diffuse factor times light, for each light (`shade.reflectance`).
        diffuse: Vec<[i64; 3]>,
        /// Specular factor times light, for each light (`shade.reflectance`).
        specular: Vec<[i64; 3]>,
        /// Words of x^shininess over [0, 1] (`shade.highlight`), at the middles or at the ends of
        /// the steps.
        highlight: Vec<i64>,
    },
}

/// Reflection of the surroundings by a material.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mirror {
    /// 1 − reflect: the share of its own colour (`reflect.reflectance`).
    pub kept: i64,
    /// Reflect times tint (`reflect.reflectance`).
    pub mirrored: [i64; 3],
}

/// Surroundings, and how materials reflect them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Surroundings {
    /// One for each material.
    pub mirrors: Vec<Mirror>,
    /// The octahedral map in camera space, its middle towards the viewer: texels (`reflect.light`)
    /// row by row.
    pub texels: Vec<[i64; 3]>,
}

/// The lighting registers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Lighting {
    /// Directional lights.
    pub lights: Vec<Light>,
    /// Not empty if there are splats.
    pub materials: Vec<Material>,
}

/// Meaning of an ellipsoid's amplitude.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Amplitude {
    /// That of the disc spanned by its first two axes (Surface Splatting §5), for kernels that are
    /// flat along the third.
    #[default]
    Disc,
    /// Opacity times the kernel's integral along the ray, relative to that of a ball of radius σ
    /// (EWA (33)).
    LineIntegral,
    /// The opacity itself, at the peak.
    Peak,
    /// The opacity at the peak, reduced by the widening of the low-pass filter: times √(det V_r/det
    /// V).
    Compensated,
}

/// Registers common to all ellipsoids of a frame.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Kernel {
    /// Meaning of amplitudes.
    pub amplitude: Amplitude,
    /// Greatest |a| and |b| in the Jacobian (`project.slope`).
    pub jacobian: [i64; 2],
    /// Principal axes in camera space (`ellipse.normal`), for splats without axes of their own.
    pub axes: [[i64; 3]; 3],
    /// Standard deviations along them relative to σ (`ellipse.scale`).
    pub scales: [i64; 3],
    /// Splats with less opacity are not drawn (`splat.opacity`): none of their weights would count.
    pub least_opacity: i64,
    /// Words of the table of cutoffs by opacity, for boxes (`raster.cutoff`); empty if all boxes
    /// use the cutoff of the view.
    pub reach: Vec<i64>,
    /// 1/σ (`sort.depth_weight.share`): weights are 0 from this depth on. Machines without weights
    /// that fall with depth do not use it.
    pub inverse_distance: Scaled,
}

/// An ellipsoid's own axes, in its record.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Orientation {
    /// Unit quaternion w, x, y, z (`ellipse.quaternion`).
    pub quaternion: [i32; 4],
    /// Standard deviations relative to σ (`ellipse.scale`).
    pub scales: [i32; 3],
}

/// The splats of a frame as ellipsoids.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ellipsoids {
    /// Registers common to all of them.
    pub kernel: Kernel,
    /// One per splat, or empty if all have the kernel's axes.
    pub own: Vec<Orientation>,
    /// Splats are lit before they are drawn, each separately: a volume emits light (EWA §6.1).
    pub preshaded: bool,
    /// Splats are drawn in the order of their depths, within the resolution of the sort's key.
    pub sorted: bool,
    /// Degree of the spherical harmonics that splats have instead of colours; 0: they have colours.
    pub harmonics: u8,
    /// Coefficients of the harmonics (`colour.coefficient`), each multiplied by the constant of its
    /// polynomial: (degree + 1)² for each splat in turn; none if splats have colours.
    pub coefficients: Vec<[i32; 3]>,
}

/// Meaning of a sheet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Each {
    /// All splats with the same number.
    #[default]
    Slice,
    /// Each splat.
    Splat,
}

/// Fragments are grouped by sheets instead of depths.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sheets {
    /// Meaning of a sheet.
    pub each: Each,
    /// The number of each splat's sheet, if a sheet is a slice.
    pub numbers: Vec<u32>,
    /// The deepest sheet comes first.
    pub back_to_front: bool,
    /// A pixel with less transmittance than this (`fragment.opacity_sum`) stops: it accepts nothing
    /// more. 0: never.
    pub stop: i64,
    /// The sheet that stops a pixel is still blended.
    pub keeps_last: bool,
    /// Smaller weights make no fragment (`gauss.weight`).
    pub least_weight: i64,
    /// If each splat is a sheet, weights are limited to this (`gauss.weight`).
    pub most_weight: i64,
    /// Words of the table of α/x (`fragment.ratio`); empty if opacity is the weight itself.
    pub ratio: Vec<i64>,
}

/// Fragments are grouped by intervals or windows.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Window {
    /// A contribution joins a cluster that remains narrower than this (`fragment.depth`).
    pub reach: i64,
    /// Words of the table of −2·ln(1 − min(α, 0.95)) by α (`fragment.window.density`).
    pub density: Vec<i64>,
    /// Words of the table of 1 − e^(−x) (`fragment.window.hidden`).
    pub hidden: Vec<i64>,
}

/// The input of one picture.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Frame {
    /// Pixels per row, 1 to 16384.
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
    /// Axes of ellipsoids; none if the splats are discs.
    pub ellipsoids: Option<Ellipsoids>,
    /// Grouping of fragments by sheets; none if by depth.
    pub sheets: Option<Sheets>,
    /// Registers of windows; none if fragments are grouped otherwise.
    pub window: Option<Window>,
    /// Surroundings to reflect, if any.
    pub surroundings: Option<Surroundings>,
    /// On a machine that keeps lists from frame to frame, those of the frame before; none in a
    /// first frame.
    pub lists: ListsBefore,
}

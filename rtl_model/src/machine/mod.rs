//! Machine: every format, table and rule of a splatting machine on one page, and the named machines.
//!
//! A description says nothing of what is built from it: it knows no unit. Units read their formats from here and from nowhere else.

use crate::num::{Format, Word};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

mod named;
pub mod timing;

/// A whole machine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    /// Name in reports.
    pub name: String,
    /// The splat record in memory.
    pub splat: Splat,
    /// World point → camera → pixel.
    pub project: Project,
    /// Normal and radius → conic, box, depth slopes.
    pub ellipse: Ellipse,
    /// Spherical harmonics → colour; left out, records hold colours alone, which somebody else has worked out for the view.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub colour: Option<Colour>,
    /// Depth order; left out, splats stay in input order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sort: Option<Sort>,
    /// Forward differencing: ellipse → fragments.
    pub raster: Raster,
    /// Radial index → weight.
    pub gauss: Gauss,
    /// At most `layers` fragments a pixel.
    pub fragment: Fragment,
    /// Normalise and light.
    pub shade: Shade,
    /// Mirror surroundings in what is lit; left out, the machine knows none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reflect: Option<Reflect>,
    /// Blend into the frame.
    pub resolve: Resolve,
    /// The microarchitecture: where time goes. It changes no picture.
    pub timing: timing::Timing,
}

/// A reciprocal or root: table, then Newton steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FunctionUnit {
    /// The table has 2^this words, 1 to 12.
    pub table_bits: u32,
    /// Newton steps after the table, 0 to 3; each about doubles the right bits.
    pub newton_steps: u32,
    /// Fraction bits of mantissas and result, 4 to 30.
    pub bits: u32,
}

/// Between a table's words.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// The word of the step that the argument lies in.
    Nearest,
    /// A straight line between the words at the step's ends.
    Linear,
}

/// A function table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TableShape {
    /// The table has 2^this steps, 1 to 12.
    pub index_bits: u32,
    /// Between its words.
    pub interpolation: Interpolation,
}

/// The splat record: words as they lie in memory, at most 32 bits each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Splat {
    /// Centre, machine units: the scene is scaled by a power of two and moved to fit.
    pub position: Word,
    /// Unit normal, world axes.
    pub normal: Word,
    /// σ, machine units.
    pub radius: Word,
    /// Linear light.
    pub rgb: Word,
    /// α.
    pub opacity: Word,
}

/// Formats of the unit `project`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Project {
    /// The eye, machine units.
    pub eye: Word,
    /// Position less eye, by a power of two that each splat picks for itself so that the largest part lies in [½, 1).
    pub relative: Word,
    /// Elements of the viewing rotation.
    pub rotation: Word,
    /// Camera coordinates t, by the same power of two.
    pub camera: Word,
    /// t_z, machine units.
    pub depth: Word,
    /// 1/t_z.
    pub reciprocal: FunctionUnit,
    /// a = t_x/t_z and b = t_y/t_z, and the guard band that they must lie in.
    pub slope: Word,
    /// s, pixels.
    pub focal: Word,
    /// Position on the screen from its middle, pixels; and the principal point from there.
    pub pixel: Word,
}

/// Formats of the unit `ellipse`. Sizes are relative to a power of two that each splat picks for itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ellipse {
    /// Normal in camera space.
    pub normal: Word,
    /// g, the normal's share along the screen.
    pub tilt: Word,
    /// c_n = n·(a, b, 1).
    pub facing: Word,
    /// s·σ, normalised to [1, 2). Of pixels that are not square s is the larger focal length.
    pub scaled_radius: Word,
    /// k' = k/2^e, the radius on the screen.
    pub size: Word,
    /// k'², and its products with `aspect`.
    pub size_squared: Word,
    /// s_x², s_x·s_y and s_y² relative to s², for pixels that are not square; left out, the machine draws square ones alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aspect: Option<Word>,
    /// [1+a², ab; ab, 1+b²] − ggᵀ.
    pub shape: Word,
    /// v/4^e.
    pub low_pass: Word,
    /// V/4^e on the diagonal.
    pub variance: Word,
    /// V01/4^e.
    pub variance_cross: Word,
    /// k'²·c_n: signed area of the unfiltered footprint.
    pub area: Word,
    /// det V/16^e.
    pub determinant: Word,
    /// 1/√det.
    pub root: FunctionUnit,
    /// 1/det, mantissa.
    pub inverse: Word,
    /// Q00 and Q11, pixel⁻².
    pub conic: Word,
    /// Q01, pixel⁻².
    pub conic_cross: Word,
    /// √(det V_r/det V).
    pub visibility: Word,
    /// The constant 1/2π.
    pub inverse_two_pi: Word,
    /// A.
    pub amplitude: Word,
    /// √(cutoff·V).
    pub extent_root: FunctionUnit,
    /// Half-extents of the box, pixels.
    pub extent: Word,
    /// 1/|c_n|.
    pub slope_reciprocal: FunctionUnit,
    /// 1/s, mantissa in [½, 1].
    pub inverse_focal: Word,
    /// t_z/s and t_z/(s·c_n), mantissas.
    pub depth_step: Word,
    /// z_x and z_y, machine units a pixel; clamped, for a grazing plane's slope has no limit.
    pub depth_slope: Word,
    /// √cutoff.
    pub root_cutoff: Word,
    /// σ·√cutoff, machine units: the depth clamp's half-width.
    pub depth_range: Word,
    /// Words for ellipsoids; left out, the machine draws discs alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ellipsoid: Option<Ellipsoid>,
}

/// Formats of the unit `ellipse` for ellipsoids.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ellipsoid {
    /// Orientation in the splat record: elements of a unit quaternion.
    pub quaternion: Word,
    /// Standard deviations in the splat record, relative to σ, the largest; products of two of them too.
    pub scale: Word,
    /// sᵢ·gᵢ: what an axis leaves on the screen.
    pub stretch: Word,
    /// |(a, b, 1)|: how much longer than t_z the way to the splat is.
    pub ray: Word,
    /// √(1 + a² + b²).
    pub ray_root: FunctionUnit,
    /// √(det V_r), for opacities that are compensated for the low-pass filter; left out, the machine compensates none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compensation_root: Option<FunctionUnit>,
    /// The table of cutoffs by opacity, for boxes of splats whose weights count from some least one on, has 2^this words, 1 to 12; left
    /// out, every box is that of the frame's cutoff.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reach_bits: Option<u32>,
}

/// The unit `colour`: harmonics of trained Gaussians. It has no formats yet: what it computes is computed in f64.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Colour {
    /// Greatest degree of spherical harmonics that it works out, 1 to 3.
    pub degree: u32,
}

/// Start of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Rows {
    /// Each row's first pixel is evaluated afresh.
    Seeded,
    /// Only the box's first pixel is; rows are differenced as pixels are.
    Differenced,
}

/// Formats of the unit `raster`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Raster {
    /// Start of a row.
    pub rows: Rows,
    /// The cutoff.
    pub cutoff: Word,
    /// First pixel less centre, pixels.
    pub offset: Word,
    /// Q00·dx + 2·Q01·dy and Q11·dy.
    pub gradient: Word,
    /// The differencing register of r; its adder wraps.
    pub radial: Word,
    /// First differences.
    pub first: Word,
    /// Second differences.
    pub second: Word,
    /// The differencing register of z, machine units; its adder wraps.
    pub depth: Word,
}

/// Formats of the unit `gauss`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gauss {
    /// r as the table sees it; the table spans all that this word holds.
    pub radial_index: Word,
    /// e^(−r/2).
    pub table: TableShape,
    /// The table's words and result.
    pub falloff: Word,
    /// w = A·e^(−r/2).
    pub weight: Word,
}

/// Which pair of fragments is merged when a pixel has no slot left. Traces number them in this order, from 0 on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Merge {
    /// The two with the smallest difference in depth (Surface Splatting §6).
    NearestPair,
    /// The two deepest.
    FarthestPair,
    /// None: the nearer fragment replaces the other (a z-buffer, one layer).
    Replace,
    /// Two of one window add up, or else the two deepest close; for [`Group::Interval`] (which never adds up) and [`Group::Window`].
    Window,
}

/// Which contributions become one fragment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Group {
    /// Those within ε of the fragment's depth (Surface Splatting §6).
    #[default]
    First,
    /// Those whose depths, all of them together, are narrower than ε.
    Interval,
    /// Small clusters, summed while they surely belong to one window of ε; the windows are formed at the end, from the nearest depth on.
    Window,
}

/// Which depth stands for a fragment of many contributions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FragmentDepth {
    /// That of the first.
    First,
    /// That of the nearest.
    Nearest,
}

/// Rules and formats of the unit `fragment`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fragment {
    /// Fragments a pixel can hold, 1 to 8.
    pub layers: u32,
    /// Rule for a full pixel.
    pub merge: Merge,
    /// Rule for what a contribution is added to.
    #[serde(default, skip_serializing_if = "is_first")]
    pub group: Group,
    /// Before merging: drop the deepest if something lies behind an opaque fragment.
    pub evict_hidden: bool,
    /// Which depth a fragment has.
    pub fragment_depth: FragmentDepth,
    /// Setup turns each splat's normal towards the viewer, so that those of a sheet's two sides do not cancel in the sum.
    #[serde(default = "turned")]
    pub turn_normals: bool,
    /// The limit from which a fragment counts as opaque, in thousandths of full opacity.
    pub opaque_permille: u32,
    /// The opacity limit as a register.
    pub opaque: Word,
    /// z of a contribution and of a fragment, machine units; also ε.
    pub depth: Word,
    /// Camera-space normal of a contribution.
    pub normal: Word,
    /// Σw.
    pub weight_sum: Word,
    /// Σw·rgb.
    pub colour_sum: Word,
    /// Σw·α.
    pub opacity_sum: Word,
    /// Σw·n.
    pub normal_sum: Word,
    /// Words for grouping by sheets; left out, the machine groups by depth alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sheets: Option<Sheets>,
    /// Options and words of grouping by intervals and windows; left out where `group` is `first`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub window: Option<Window>,
}

/// Whether a description need not say it: those from before there was a choice do not.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "the form that serde asks for")]
fn is_first(group: &Group) -> bool {
    *group == Group::First
}

/// Options and formats of the unit `fragment` for intervals and windows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Window {
    /// A contribution joins a cluster that stays narrower than so many thousandths of ε, 0 to 1000; at 0 it joins one that spans its depth.
    /// Intervals join at 1000, whatever this says.
    pub join_permille: u32,
    /// Closed slots take late contributions to their front and their back.
    pub late: bool,
    /// Closed slots take what lies between their front and their back.
    pub inside: bool,
    /// Σw·z.
    pub depth_sum: Word,
    /// TF, TB and T: what is seen behind the front of a closed slot, before its back, and through windows.
    pub through: Word,
    /// 1/max(W, τ), 1/(τ − α·W) and 1/A, one after the other.
    pub reciprocal: FunctionUnit,
    /// Numerators, by the power of two that normalises what divides them.
    pub share: Word,
    /// Quotients: a window's opacity, β, and the part of its own colour that a closed slot loses.
    pub part: Word,
    /// −2·ln(1 − min(α, 0.95)).
    pub density: Word,
    /// The same, over what `splat.opacity` holds.
    pub density_table: TableShape,
    /// x = w·density as the table sees it; the table spans all that this word holds.
    pub exponent: Word,
    /// 1 − e^(−x).
    pub hidden_table: TableShape,
    /// The table's words and result: what a splat hides that lies inside of a closed slot.
    pub hidden: Word,
}

/// Of machines described before there was a choice, too.
fn turned() -> bool {
    true
}

/// Formats of the unit `fragment` for sheets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sheets {
    /// x = Σw as the table sees it; the table spans all that this word holds.
    pub depth_index: Word,
    /// α/x.
    pub table: TableShape,
    /// The table's words and result.
    pub ratio: Word,
}

/// How the splats of a tile come into the order of their depths. Each kind gives the same order, and so the same picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SortKind {
    /// A radix sort of the entries of all lists, in memory: one pass for each digit of the key.
    #[default]
    Radix,
    /// Each tile's list by itself, in the buffer of a sorter (`timing.sort`). A list that is longer than the buffer is sorted in chunks,
    /// which are merged in memory.
    Tile,
    /// As `tile`, but a list that is longer than the buffer is first distributed to buckets in memory, by the upper bits of the key; then
    /// each bucket is sorted.
    Hierarchical,
}

impl SortKind {
    fn is_radix(&self) -> bool {
        *self == SortKind::Radix
    }
}

/// The sort by depth between setup and raster.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sort {
    /// What is sorted at a time, and where; left out, `radix`.
    #[serde(default, skip_serializing_if = "SortKind::is_radix")]
    pub kind: SortKind,
    /// Depth as the sort sees it, machine units: splats with equal keys stay in input order.
    pub key: Word,
    /// Bits of the tile's number in front of the depth in the key of `radix`, 1 to 20: a picture has at most 2^this tiles of 16×16 pixels,
    /// whatever the side of the machine's tiles. Left out, the key is the depth alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tile_bits: Option<u32>,
    /// Bits of the key that one pass of the radix sort looks at, 1 to 16; the other kinds do not use it.
    pub digit_bits: u32,
}

impl Sort {
    /// Bits of the whole key: the tile's number and the depth.
    pub(crate) fn key_bits(&self) -> u32 {
        self.key.format.width().max(1) as u32 + self.tile_bits.unwrap_or(0).min(MOST_TILE_BITS)
    }

    /// Passes over all entries, one per digit of the key.
    pub(crate) fn passes(&self) -> u32 {
        self.key_bits().div_ceil(self.digit_bits.clamp(1, 16))
    }
}

/// Most bits of a tile's number.
pub(crate) const MOST_TILE_BITS: u32 = 20;

/// Formats of the unit `shade`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Shade {
    /// 1/W.
    pub reciprocal: FunctionUnit,
    /// 1/|n|.
    pub root: FunctionUnit,
    /// Σw·rgb and Σw·α by the power of two that normalises W.
    pub share: Word,
    /// Σw·n by the same power of two.
    pub normal_share: Word,
    /// Σw·rgb/W.
    pub rgb: Word,
    /// Σw·α/W.
    pub opacity: Word,
    /// The unit normal.
    pub normal: Word,
    /// Directions L and H of a light.
    pub light: Word,
    /// N·L and N·H.
    pub cosine: Word,
    /// x^shininess.
    pub highlight_table: TableShape,
    /// The highlight table's words and result.
    pub highlight: Word,
    /// Material × light constants: ambient, diffuse, specular.
    pub reflectance: Word,
    /// ambient + Σ diffuse·max(0, N·L)·light.
    pub irradiance: Word,
    /// Colour that leaves the surface, clamped to 1.
    pub colour: Word,
    /// 1/τ, mantissa in [½, 1].
    pub inverse_threshold: Word,
    /// min(1, W/τ).
    pub coverage: Word,
    /// α', and colour·α'.
    pub premultiplied: Word,
}

/// From where a mirror is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Sight {
    /// From far along the viewing axis, whatever the pixel.
    Axis,
    /// From the eye, along the pixel's own ray.
    Ray,
}

/// Rules and formats of the unit `reflect`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Reflect {
    /// From where a mirror is looked at.
    pub sight: Sight,
    /// a and b of the pixel's ray (a, b, 1). Of `axis` they are 0: the word is not built there, and may be left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slope: Option<Word>,
    /// N·V.
    pub facing: Word,
    /// R = 2(N·V)N − V.
    pub direction: Word,
    /// 1/(|x| + |y| + |z|) of R.
    pub reciprocal: FunctionUnit,
    /// Magnitude of a coordinate in the octahedral map, 0 to 1.
    pub coordinate: Word,
    /// The map has 2^this texels a side, 1 to 8.
    pub index_bits: u32,
    /// Place between two texels, 0 to 1.
    pub fraction: Word,
    /// Texels, and what lies between them.
    pub light: Word,
    /// Material constants: 1 − reflect, and reflect × tint.
    pub reflectance: Word,
}

/// Formats of the unit `resolve`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Resolve {
    /// Share of the light from behind that is left.
    pub transmittance: Word,
    /// A channel of the frame: linear light, premultiplied, over the background; the background too.
    pub frame: Word,
}

impl FunctionUnit {
    /// Format of mantissas and results: `U1F{bits}`.
    pub fn format(self) -> Format {
        Format::unsigned(1, self.bits.clamp(4, 30) as i32)
    }
}

impl Machine {
    /// Bits of one fragment in the frame buffer: sums, depth, material index (8) and the shaded flag. Of windows the larger of an open slot,
    /// which has both ends of its span and Σw·z too, and a closed one: colour and opacity, four depths, two weights, TF and TB.
    pub fn fragment_bits(&self) -> i32 {
        let f = &self.fragment;
        let [weight, opacity, colour, normal, depth] =
            [f.weight_sum, f.opacity_sum, f.colour_sum, f.normal_sum, f.depth].map(|word| word.format.width());
        let sums = weight + opacity + 3 * (colour + normal) + 8 + 1;
        match &f.window {
            None => sums + depth,
            Some(words) => {
                let closed = 3 * colour + opacity + 4 * depth + 2 * weight + 2 * words.through.format.width() + 1;
                closed.max(sums + 2 * depth + words.depth_sum.format.width())
            }
        }
    }
}

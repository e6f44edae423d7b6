//! Machine: every format, table and rule of a splatting machine on one page, and the named
//! machines.
//!
//! A description does not depend on the units. The units read their formats only from here.

use crate::num::{Format, Word};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

mod named;
mod published;
pub mod timing;

/// A whole machine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    /// Name in reports.
    pub name: String,
    /// Operators on floating-point words. Left out: `exact`.
    #[serde(default, skip_serializing_if = "Operators::are_exact")]
    pub operators: Operators,
    /// The splat record in memory.
    pub splat: Splat,
    /// World point → camera → pixel.
    pub project: Project,
    /// Normal and radius → conic, box, depth slopes.
    pub ellipse: Ellipse,
    /// Spherical harmonics → colour. Left out: records hold colours only, which were computed
    /// elsewhere for the view.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub colour: Option<Colour>,
    /// Lists of tiles. Left out: a splat has an entry in every tile that its box touches.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bin: Option<Bin>,
    /// Sort by depth. Left out: splats stay in input order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sort: Option<Sort>,
    /// Contribution test of blocks of pixels. Left out: every block of a splat's box is drawn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contribution: Option<Contribution>,
    /// Forward differencing: ellipse → fragments.
    pub raster: Raster,
    /// Radial index → weight.
    pub gauss: Gauss,
    /// At most `layers` fragments per pixel.
    pub fragment: Fragment,
    /// Normalise and light.
    pub shade: Shade,
    /// Mirror the scene's environment. Left out: the machine refuses scenes that need it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reflect: Option<Reflect>,
    /// Blend into the frame.
    pub resolve: Resolve,
    /// The microarchitecture. It changes no picture.
    pub timing: timing::Timing,
}

/// What a product or a sum of floating-point words is before it becomes a word.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Operators {
    /// Exact: only words are rounded.
    #[default]
    Exact,
    /// Rounded to nearest even, to the significant bits of the more precise operand, before another
    /// operator reads it. Units: `project`, `ellipse`, `colour`, `contribution`, `gauss`, `resolve`.
    Rounded,
}

impl Operators {
    fn are_exact(&self) -> bool {
        *self == Operators::Exact
    }
}

/// A reciprocal or root: table, then Newton steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FunctionUnit {
    /// The table has 2^this words, 1 to 12.
    pub table_bits: u32,
    /// Newton steps after the table, 0 to 3. Each about doubles the number of correct bits.
    pub newton_steps: u32,
    /// Fraction bits of mantissas and result, 4 to 30.
    pub bits: u32,
}

/// Interpolation between the words of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// The word of the step that contains the argument.
    Nearest,
    /// A line between the words at the ends of the step.
    Linear,
}

/// A function table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TableShape {
    /// The table has 2^this steps, 1 to 12.
    pub index_bits: u32,
    /// Interpolation between its words.
    pub interpolation: Interpolation,
}

/// The splat record: words as they are stored in memory, at most 32 bits each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Splat {
    /// Centre, machine units: the scene is scaled by a power of two and moved to fit.
    pub position: Word,
    /// Unit normal, world axes.
    pub normal: Word,
    /// σ, machine units.
    pub radius: Word,
    /// Linear light. With `fragment.sheets.composite` it may have no integer bits: 1 is then its
    /// greatest value.
    pub rgb: Word,
    /// α, likewise.
    pub opacity: Word,
}

/// Formats of the unit `project`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Project {
    /// The eye, machine units.
    pub eye: Word,
    /// Position minus eye, divided by a power of two. Each splat has its own, so that the largest
    /// component is in [½, 1).
    pub relative: Word,
    /// Elements of the viewing rotation.
    pub rotation: Word,
    /// Camera coordinates t, divided by the same power of two.
    pub camera: Word,
    /// t_z, machine units.
    pub depth: Word,
    /// 1/t_z.
    pub reciprocal: FunctionUnit,
    /// a = t_x/t_z and b = t_y/t_z, and the guard band that limits them.
    pub slope: Word,
    /// s, pixels.
    pub focal: Word,
    /// Position on the screen relative to its middle, pixels; also the principal point.
    pub pixel: Word,
}

/// Formats of the unit `ellipse`. Sizes are relative to a power of two, which is separate for each
/// splat.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ellipse {
    /// Normal in camera space.
    pub normal: Word,
    /// g, the component of the normal along the screen.
    pub tilt: Word,
    /// c_n = n·(a, b, 1).
    pub facing: Word,
    /// s·σ, normalised to [1, 2). For pixels that are not square, s is the larger focal length.
    pub scaled_radius: Word,
    /// k' = k/2^e, the radius on the screen.
    pub size: Word,
    /// k'², and its products with `aspect`.
    pub size_squared: Word,
    /// s_x², s_x·s_y and s_y² relative to s², for pixels that are not square. Left out: the machine
    /// draws only square pixels.
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
    /// z_x and z_y, machine units per pixel. They are clamped, because the slope of a plane at a
    /// grazing angle is unbounded.
    pub depth_slope: Word,
    /// √cutoff.
    pub root_cutoff: Word,
    /// σ·√cutoff, machine units: half of the width of the depth clamp.
    pub depth_range: Word,
    /// Words for ellipsoids. Left out: the machine draws only discs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ellipsoid: Option<Ellipsoid>,
}

/// Formats of the unit `ellipse` for ellipsoids.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ellipsoid {
    /// Orientation in the splat record: elements of a unit quaternion.
    pub quaternion: Word,
    /// Standard deviations in the splat record, relative to σ, the largest; also products of two of
    /// them.
    pub scale: Word,
    /// sᵢ·gᵢ: the projection of an axis to the screen.
    pub stretch: Word,
    /// |(a, b, 1)|: the distance to the splat divided by t_z.
    pub ray: Word,
    /// √(1 + a² + b²).
    pub ray_root: FunctionUnit,
    /// √(det V_r), for opacities that are compensated for the low-pass filter. Left out: the
    /// machine does not compensate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compensation_root: Option<FunctionUnit>,
    /// The table of cutoffs by opacity has 2^this words, 1 to 12. It makes boxes smaller if there
    /// is a least weight that counts. Left out: every box ends at the frame's cutoff.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reach_bits: Option<u32>,
}

/// Formats of the unit `colour`: harmonics of trained Gaussians → colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Colour {
    /// Greatest degree of spherical harmonics that the unit evaluates, 1 to 3.
    pub degree: u32,
    /// Coefficient of a harmonic, multiplied by the constant of the harmonic's polynomial, as the
    /// splat's record has it.
    pub coefficient: Word,
    /// The splat's centre relative to the eye, normalised.
    pub relative: Word,
    /// 1/|relative|.
    pub root: FunctionUnit,
    /// Unit vector from the eye to the splat.
    pub direction: Word,
    /// Product of two coordinates of the direction.
    pub monomial: Word,
    /// Polynomial of degree 3 in the direction.
    pub basis: Word,
}

impl Default for Colour {
    fn default() -> Self {
        let signed = |int_bits, frac_bits| Word::new(Format::signed(int_bits, frac_bits));
        Colour {
            degree: 3,
            coefficient: signed(4, 14),
            relative: signed(1, 17),
            root: FunctionUnit {
                table_bits: 8,
                newton_steps: 1,
                bits: 18,
            },
            direction: signed(2, 16),
            monomial: signed(2, 16),
            basis: signed(3, 15),
        }
    }
}

/// Decides whether a splat gets an entry in the list of a tile that its box touches. Each test
/// gives the same picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BinTest {
    /// Always.
    #[default]
    Box,
    /// If the tile's part of the box meets a box that is turned with the ellipse.
    OrientedBox,
    /// If the tile's part of the box meets the ellipse.
    Ellipse,
}

/// Lists of tiles, on a binned machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Bin {
    /// Test of a tile; left out, `box`.
    pub test: BinTest,
    /// Tiles of a splat's box that are listed per cycle, and tested, if there is a test, 1 to 16;
    /// left out, 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tiles_per_cycle: Option<u32>,
    /// Side of a subtile: 4, 8 or 16 pixels. Each entry of a list then has a mask with one bit per
    /// subtile of the tile, by rows. A bit is the result of the test for the subtile. The rasteriser
    /// skips subtiles whose bit is not set. Left out, entries have no mask.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub subtile_px: Option<u32>,
    /// Where masks are made; left out, in `bin`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub masks: Option<MaskMaker>,
    /// Subtiles that are tested per cycle, 1 to 64; left out, 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mask_tests: Option<u32>,
}

/// Where the masks of list entries are made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MaskMaker {
    /// In `bin`, once per entry: masks are written, sorted and read with their entries. An entry
    /// without a set bit is not written.
    #[default]
    Bin,
    /// In `list`, when the record of an entry has arrived: entries in memory have no mask.
    List,
}

/// Which pixels of a block are evaluated by the contribution test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Leaders {
    /// The four corner pixels.
    Corners,
    /// The first pixel of the block and the last one.
    Diagonal,
}

impl Leaders {
    /// Leader pixels of a block.
    pub const fn count(self) -> u32 {
        match self {
            Leaders::Corners => 4,
            Leaders::Diagonal => 2,
        }
    }
}

/// Formats of the unit `contribution`: the test of blocks of pixels by r at a few of their pixels,
/// the leaders. The rasteriser passes over a block if r is at or above the Gaussian's cutoff at all
/// of its leaders. The test changes the picture: a small Gaussian between leaders is lost. Only for
/// machines that draw Gaussians.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Contribution {
    /// Side of a block: 4 or 8 pixels. Blocks are aligned to the picture.
    pub block_px: u32,
    /// Leader pixels of a block.
    pub leaders: Leaders,
    /// Leader minus centre, pixels.
    pub offset: Word,
    /// dx² and dy².
    pub square: Word,
    /// dx·dy.
    pub product: Word,
    /// Q00 and Q11.
    pub conic: Word,
    /// Q01.
    pub conic_cross: Word,
    /// r at a leader.
    pub radial: Word,
}

/// How r comes to each pixel of the box.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Rows {
    /// The first pixel of each row is evaluated from the conic.
    Seeded,
    /// Only the first pixel of the box is evaluated from the conic; rows are differenced like
    /// pixels.
    Differenced,
    /// Each pixel is evaluated from the conic, with products. A pixel whose r is below 0, by
    /// rounding, makes no fragment.
    Direct,
}

/// Formats of the unit `raster`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Raster {
    /// How r comes to each pixel of the box.
    pub rows: Rows,
    /// The cutoff.
    pub cutoff: Word,
    /// Greatest cutoff, 1 to 32: a scene's own is limited to it. Left out: it is not limited.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub most_cutoff: Option<u32>,
    /// First pixel minus centre, pixels.
    pub offset: Word,
    /// Q00·dx + 2·Q01·dy and Q11·dy; `direct` does not use it.
    pub gradient: Word,
    /// dx², dx·dy and dy², for `direct` only. Left out: exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub square: Option<Word>,
    /// The differencing register of r; its adder wraps. With `direct`, r itself.
    pub radial: Word,
    /// First differences; `direct` does not use it.
    pub first: Word,
    /// Second differences; `direct` does not use it.
    pub second: Word,
    /// The differencing register of z, machine units; its adder wraps.
    pub depth: Word,
}

/// Formats of the unit `gauss`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gauss {
    /// r, the index of the table. The table covers the whole range of this word.
    pub radial_index: Word,
    /// e^(−r/2).
    pub table: TableShape,
    /// The table's words and result. With `fragment.sheets.composite` it may have no integer bits:
    /// it then holds 1 less an ulp, and the table is scaled by that.
    pub falloff: Word,
    /// w = A·e^(−r/2).
    pub weight: Word,
}

/// Which pair of fragments is merged when a pixel has no free slot. Traces number the rules in this
/// order, from 0 on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Merge {
    /// The two with the smallest difference in depth (Surface Splatting §6).
    NearestPair,
    /// The two deepest.
    FarthestPair,
    /// No pair: the nearer fragment replaces the other (a z-buffer, one layer).
    Replace,
    /// Two fragments of one window are summed; if there are none, the two deepest are closed. This
    /// rule is for the groups `window` and `interval`; `interval` never sums.
    Window,
}

/// Which contributions become one fragment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Group {
    /// Contributions within ε of the fragment's depth (Surface Splatting §6).
    #[default]
    First,
    /// Contributions whose depths together span less than ε.
    Interval,
    /// Small clusters, summed if they certainly belong to one window of ε. The windows are formed
    /// at the end, from the nearest depth on.
    Window,
}

/// The depth of a fragment of many contributions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FragmentDepth {
    /// The depth of the first contribution.
    First,
    /// The depth of the nearest contribution.
    Nearest,
}

/// Rules and formats of the unit `fragment`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fragment {
    /// Fragments that a pixel can hold, 1 to 8.
    pub layers: u32,
    /// Rule for a full pixel.
    pub merge: Merge,
    /// Rule that selects the fragment to which a contribution is added.
    #[serde(default, skip_serializing_if = "is_first")]
    pub group: Group,
    /// Before merging: drop the deepest fragment if it is behind an opaque one.
    pub evict_hidden: bool,
    /// The depth of a fragment.
    pub fragment_depth: FragmentDepth,
    /// Setup turns each splat's normal towards the viewer, so that the normals of the two sides of
    /// a surface do not cancel in the sum.
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
    /// Words for grouping by sheets. Left out: the machine groups only by depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sheets: Option<Sheets>,
    /// Options and words for grouping by intervals and windows; left out if `group` is `first`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub window: Option<Window>,
}

/// Whether a description leaves the field out, as old descriptions do.
#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "the signature that serde requires"
)]
fn is_first(group: &Group) -> bool {
    *group == Group::First
}

/// Options and formats of the unit `fragment` for intervals and windows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Window {
    /// A contribution joins a cluster if the cluster stays narrower than this many thousandths of
    /// ε, 0 to 1000. At 0 it joins a cluster whose span contains its depth. Intervals always join
    /// at 1000.
    pub join_permille: u32,
    /// Closed slots accept late contributions to their front and their back.
    pub late: bool,
    /// Closed slots accept contributions between their front and their back.
    pub inside: bool,
    /// Σw·z.
    pub depth_sum: Word,
    /// TF, TB and T: the transmittance behind the front of a closed slot, before its back, and of
    /// windows.
    pub through: Word,
    /// 1/max(W, τ), 1/(τ − α·W) and 1/A, computed one after the other.
    pub reciprocal: FunctionUnit,
    /// Numerators, divided by the power of two that normalises their denominators.
    pub share: Word,
    /// Quotients: the opacity of a window, β, and the share of its own colour that a closed slot
    /// loses.
    pub part: Word,
    /// −2·ln(1 − min(α, 0.95)).
    pub density: Word,
    /// The table of `density`, over the range of `splat.opacity`.
    pub density_table: TableShape,
    /// x = w·density, the index of the table. The table covers the whole range of this word.
    pub exponent: Word,
    /// 1 − e^(−x).
    pub hidden_table: TableShape,
    /// The table's words and result: the opacity of a splat inside a closed slot.
    pub hidden: Word,
}

/// The default, also for machine files that are older than the field.
fn turned() -> bool {
    true
}

/// Formats of the unit `fragment` for sheets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sheets {
    /// x = Σw, the index of the table. The table covers the whole range of this word.
    pub depth_index: Word,
    /// α/x.
    pub table: TableShape,
    /// The table's words and result.
    pub ratio: Word,
    /// Colour and opacity of a pixel. Given: the machine draws only Gaussians, the farthest first,
    /// and blends each into its pixel, which holds nothing else. It has no table. Left out: a pixel
    /// has the words of sums, and the order is the scene's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub composite: Option<Word>,
}

/// How the splats of a tile come into the order of their depths. Each kind except `incremental` and
/// `none` gives the same order, and so the same picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SortKind {
    /// A radix sort of the entries of all lists, in memory: one pass for each digit of the key.
    #[default]
    Radix,
    /// Each tile's list separately, in the buffer of a sorter (`timing.sort`). A list that is
    /// longer than the buffer is sorted in chunks, which are merged in memory.
    Tile,
    /// As `tile`, but a list that is longer than the buffer is first distributed to buckets in
    /// memory, by the upper bits of the key; then each bucket is sorted.
    Hierarchical,
    /// Each tile's list is kept from frame to frame, and moves towards the order of the depths: an
    /// entry by less than a chunk per frame (`sort.incremental`). The picture of a frame therefore
    /// depends on the frames before it. A first frame is sorted completely. `digit_bits` is not
    /// used.
    Incremental,
    /// Not at all: the Gaussians of a pixel are summed, which needs no order. With w = Σw_i and the
    /// colours c_i, a pixel is (Σw_i·c_i + background)/(w + 1) (sort-free weighted sums,
    /// arXiv 2410.18931). Weights are the same for all depths, or fall with depth
    /// (`sort.depth_weight`). The table of `fragment.sheets` holds 1/(w + 1). `key` and `digit_bits`
    /// are not used.
    None,
}

impl SortKind {
    fn is_radix(&self) -> bool {
        *self == SortKind::Radix
    }
}

/// Lists that are kept from frame to frame. Both fields decide the picture, and equal those of the
/// timing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Incremental {
    /// Side of a tile, pixels: a multiple of 16, and `timing.tile.side_px`; left out, 16.
    pub tile_px: u32,
    /// Entries of a stored list that are sorted at a time, a power of two from 4 to 65536, and
    /// `timing.sort.buffer_entries`. In odd frames, counted from 0, the first chunk has half as
    /// many. Left out, 256.
    pub chunk: u32,
}

impl Default for Incremental {
    fn default() -> Self {
        Incremental {
            tile_px: 16,
            chunk: 256,
        }
    }
}

/// Weights of summed Gaussians that fall with depth: a Gaussian at depth t_z counts max(0, 1 −
/// t_z/σ) times its opacity, where σ is the scene's `sheets.weight_distance` (LC-WSR of arXiv
/// 2410.18931).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DepthWeight {
    /// t_z/σ; also the mantissa of 1/σ, in [½, 1].
    pub share: Word,
    /// max(0, 1 − t_z/σ).
    pub weight: Word,
}

impl Default for DepthWeight {
    fn default() -> Self {
        let word = Word::new(Format::unsigned(1, 16));
        DepthWeight {
            share: word,
            weight: word,
        }
    }
}

/// The sort by depth between setup and raster.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sort {
    /// Kind of the sort; left out, `radix`.
    #[serde(default, skip_serializing_if = "SortKind::is_radix")]
    pub kind: SortKind,
    /// The sort key: depth, machine units. Splats with equal keys stay in input order.
    pub key: Word,
    /// Bits of the tile index in front of the depth in the key of `radix`, 1 to 20: a picture has
    /// at most 2^this tiles of 16×16 pixels, or of the machine's tiles if they are smaller. Left
    /// out, the key is only the depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tile_bits: Option<u32>,
    /// Bits of the key that one pass of the radix sort uses, 1 to 16; the other kinds do not use
    /// it.
    pub digit_bits: u32,
    /// Lists of the kind `incremental`; left out there, tiles of 16 pixels and chunks of 256
    /// entries.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub incremental: Option<Incremental>,
    /// Weights that fall with depth, for the kind `none`; left out, weights do not depend on depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_weight: Option<DepthWeight>,
}

impl Sort {
    /// Bits of the whole key: tile index and depth.
    pub(crate) fn key_bits(&self) -> u32 {
        self.key.format.width().max(1) as u32 + self.tile_bits.unwrap_or(0).min(MOST_TILE_BITS)
    }

    /// Passes over all entries, one per digit of the key.
    pub(crate) fn passes(&self) -> u32 {
        self.key_bits().div_ceil(self.digit_bits.clamp(1, 16))
    }
}

/// Greatest width of a tile index, bits.
pub(crate) const MOST_TILE_BITS: u32 = 20;

/// Formats of the unit `shade`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Shade {
    /// 1/W.
    pub reciprocal: FunctionUnit,
    /// 1/|n|.
    pub root: FunctionUnit,
    /// Σw·rgb and Σw·α, divided by the power of two that normalises W.
    pub share: Word,
    /// Σw·n, divided by the same power of two.
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
    /// Colour of the surface, clamped to 1.
    pub colour: Word,
    /// 1/τ, mantissa in [½, 1].
    pub inverse_threshold: Word,
    /// min(1, W/τ).
    pub coverage: Word,
    /// α', and colour·α'.
    pub premultiplied: Word,
}

/// The direction from which a mirror is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Sight {
    /// Along the viewing axis, for every pixel.
    Axis,
    /// Along the ray from the eye to the pixel.
    Ray,
}

/// Rules and formats of the unit `reflect`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Reflect {
    /// The direction from which a mirror is seen.
    pub sight: Sight,
    /// a and b of the pixel's ray (a, b, 1). With `axis` they are 0: the word is not needed, and
    /// may be left out.
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
    /// The map has 2^this texels per side, 1 to 8.
    pub index_bits: u32,
    /// Position between two texels, 0 to 1.
    pub fraction: Word,
    /// Texels, and interpolated light.
    pub light: Word,
    /// Material constants: 1 − reflect, and reflect × tint.
    pub reflectance: Word,
}

/// Formats of the unit `resolve`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Resolve {
    /// Transmittance: the share of the light from behind that remains.
    pub transmittance: Word,
    /// A channel of the frame: linear light, premultiplied, over the background. Also the
    /// background itself.
    pub frame: Word,
}

impl FunctionUnit {
    /// Format of mantissas and results: `U1F{bits}`.
    pub fn format(self) -> Format {
        Format::unsigned(1, self.bits.clamp(4, 30) as i32)
    }
}

impl Fragment {
    /// The word of a pixel that holds a composite only.
    pub fn composite(&self) -> Option<Word> {
        self.sheets.and_then(|sheets| sheets.composite)
    }
}

impl Machine {
    /// How lists are kept from frame to frame; none if they are not.
    pub fn keeps_lists(&self) -> Option<Incremental> {
        let sort = self
            .sort
            .filter(|sort| sort.kind == SortKind::Incremental)?;
        Some(sort.incremental.unwrap_or_default())
    }

    /// The sort, unless its kind is `none`.
    pub fn sorting(&self) -> Option<Sort> {
        self.sort.filter(|sort| sort.kind != SortKind::None)
    }

    /// Whether the Gaussians of a pixel are summed, in any order.
    pub fn sums_gaussians(&self) -> bool {
        self.sort.is_some_and(|sort| sort.kind == SortKind::None)
    }

    /// Words of weights that fall with depth, if Gaussians are summed with such weights.
    pub fn depth_weight(&self) -> Option<DepthWeight> {
        self.sort
            .filter(|_| self.sums_gaussians())
            .and_then(|sort| sort.depth_weight)
    }

    /// Bits of one fragment in the frame buffer: sums, depth, material index (8) and the shaded
    /// flag. With windows, a slot is as large as the larger of an open one, which also has both
    /// ends of its span and Σw·z, and a closed one, which has colour and opacity, four depths, two
    /// weights, TF and TB. A pixel of Gaussians that are blended one by one has only its composite.
    pub fn fragment_bits(&self) -> i32 {
        let f = &self.fragment;
        if let Some(word) = f.composite() {
            return 4 * word.format.stored_bits();
        }
        let [weight, opacity, colour, normal, depth] = [
            f.weight_sum,
            f.opacity_sum,
            f.colour_sum,
            f.normal_sum,
            f.depth,
        ]
        .map(|word| word.format.stored_bits());
        let sums = weight + opacity + 3 * (colour + normal) + 8 + 1;
        match &f.window {
            None => sums + depth,
            Some(words) => {
                let closed = 3 * colour
                    + opacity
                    + 4 * depth
                    + 2 * weight
                    + 2 * words.through.format.stored_bits()
                    + 1;
                closed.max(sums + 2 * depth + words.depth_sum.format.stored_bits())
            }
        }
    }
}

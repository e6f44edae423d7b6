//! Machine: every format, table and rule of a splatting machine on one page; named machines; elaboration.
//!
//! A description is checked once, as an RTL elaboration would: [`Machine::elaborate`] returns a machine that cannot fail,
//! or every misfit at once, in sentences. The units read their formats from here and from nowhere else.

use crate::num::{Format, Overflow, Reciprocal, ReciprocalRoot, Rounding, Table, Word};
use crate::units::{ellipse, fragment, gauss, project, raster, resolve, shade};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

mod elaboration;
pub mod timing;

pub use elaboration::{Elaboration, MAX_OPERAND_BITS, Operator, Part, Signal};

/// A whole machine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    /// What to call it in reports.
    pub name: String,
    /// The splat record in memory.
    pub splat: Splat,
    /// World point → camera → pixel.
    pub project: Project,
    /// Normal and radius → conic, box, depth slopes.
    pub ellipse: Ellipse,
    /// Forward differencing: ellipse → fragments.
    pub raster: Raster,
    /// Radial index → weight.
    pub gauss: Gauss,
    /// At most `layers` fragments a pixel.
    pub fragment: Fragment,
    /// Normalise and light.
    pub shade: Shade,
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
    /// Position on the screen from its middle, pixels.
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
    /// s·σ, normalised to [1, 2).
    pub scaled_radius: Word,
    /// k' = k/2^e, the radius on the screen.
    pub size: Word,
    /// k'².
    pub size_squared: Word,
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
}

/// How rows begin.
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
    /// How rows begin.
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

/// Which pair of fragments is merged when a pixel has no slot left.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Merge {
    /// The two with the smallest difference in depth (Surface Splatting §6).
    NearestPair,
    /// The two deepest.
    FarthestPair,
    /// None: the nearer fragment replaces the other (a z-buffer, one layer).
    Replace,
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
    /// What to do when they are full.
    pub merge: Merge,
    /// Before merging: drop the deepest if something lies behind an opaque fragment.
    pub evict_hidden: bool,
    /// Which depth a fragment has.
    pub fragment_depth: FragmentDepth,
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
}

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

/// Formats of the unit `resolve`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Resolve {
    /// What is left of the light from behind.
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

/// A machine that has been checked and can draw.
#[derive(Clone, Debug)]
pub struct Elaborated {
    /// The description.
    pub machine: Machine,
    /// Every signal, in the order of the diagram.
    pub signals: Vec<Signal>,
    /// What its units are built of.
    pub parts: Vec<Part>,
    pub(crate) project: project::Project,
    pub(crate) ellipse: ellipse::Ellipse,
    pub(crate) raster: raster::Raster,
    pub(crate) gauss: gauss::Gauss,
    /// At most l fragments a pixel.
    pub fragment: fragment::Fragment,
    /// Normalise and light.
    pub shade: shade::Shade,
    /// Blend into the frame.
    pub resolve: resolve::Resolve,
    /// The microarchitecture.
    pub timing: timing::Elaborated,
}

impl Elaborated {
    /// Every reciprocal, by the name of its unit and its own.
    pub fn reciprocals(&self) -> [(&'static str, &Reciprocal); 3] {
        [
            ("project.reciprocal", self.project.reciprocal()),
            ("ellipse.slope_reciprocal", self.ellipse.slope_reciprocal()),
            ("shade.reciprocal", self.shade.reciprocal()),
        ]
    }

    /// Every reciprocal root, by the name of its unit and its own.
    pub fn roots(&self) -> [(&'static str, &ReciprocalRoot); 3] {
        [("ellipse.root", self.ellipse.root()), ("ellipse.extent_root", self.ellipse.extent_root()), ("shade.root", self.shade.root())]
    }

    /// The constant 1/2π as `ellipse` holds it (`ellipse.inverse_two_pi`).
    pub fn inverse_two_pi(&self) -> i64 {
        self.ellipse.inverse_two_pi()
    }

    /// The table of e^(−r/2), `gauss.table`.
    pub fn gaussian(&self) -> &Table {
        self.gauss.table()
    }
}

impl Machine {
    /// Checks the description and works out everything that does not change while it draws; or every misfit, a sentence each.
    pub fn elaborate(&self) -> Result<Elaborated, Vec<String>> {
        let e = &mut Elaboration::default();
        self.splat.check(e);
        let elaborated = Elaborated {
            project: project::Project::new(e, self),
            ellipse: ellipse::Ellipse::new(e, self),
            raster: raster::Raster::new(e, self),
            gauss: e.per_lane(|e| gauss::Gauss::new(e, self)),
            fragment: fragment::Fragment::new(e, self, raster::Raster::depth_exact(self)),
            shade: shade::Shade::new(e, self),
            resolve: resolve::Resolve::new(e, self),
            timing: self.elaborate_timing(e),
            machine: self.clone(),
            signals: std::mem::take(&mut e.signals),
            parts: std::mem::take(&mut e.parts),
        };
        if e.misfits.is_empty() { Ok(elaborated) } else { Err(std::mem::take(&mut e.misfits)) }
    }

    /// Bits of one fragment in the frame buffer: sums, depth, material index (8) and the shaded flag.
    pub fn fragment_bits(&self) -> i32 {
        let f = &self.fragment;
        let sums = [f.weight_sum, f.opacity_sum].map(|w| w.format.width()).iter().sum::<i32>();
        let vectors = 3 * (f.colour_sum.format.width() + f.normal_sum.format.width());
        sums + vectors + f.depth.format.width() + 8 + 1
    }

    /// A machine by its name.
    pub fn named(name: &str) -> Option<Machine> {
        match name {
            "reference" => Some(reference()),
            "lean" => Some(lean()),
            "tiny" => Some(tiny()),
            _ => None,
        }
    }

    /// The names, the default first.
    pub const NAMES: [&str; 3] = ["reference", "lean", "tiny"];
}

impl Splat {
    fn check(&self, e: &mut Elaboration) {
        for (name, word, signed) in [
            ("position", self.position, true),
            ("normal", self.normal, true),
            ("radius", self.radius, false),
            ("rgb", self.rgb, false),
            ("opacity", self.opacity, false),
        ] {
            e.port("splat", name, word);
            e.signedness("splat", name, word, signed);
        }
        e.holds_one("splat", "rgb", self.rgb);
        e.holds_one("splat", "opacity", self.opacity);
        e.holds_one("splat", "normal", self.normal);
    }
}

const fn signed(int_bits: i32, frac_bits: i32) -> Word {
    Word::new(Format::signed(int_bits, frac_bits))
}

const fn unsigned(int_bits: i32, frac_bits: i32) -> Word {
    Word::new(Format::unsigned(int_bits, frac_bits))
}

/// The default: an engineer would call its picture exact. No multiplier operand over 27 bits; a fragment fits the paper's 38 bytes.
fn reference() -> Machine {
    let fine = FunctionUnit { table_bits: 8, newton_steps: 2, bits: 26 };
    Machine {
        name: "reference".into(),
        splat: Splat {
            position: signed(1, 26),
            normal: signed(2, 22),
            radius: unsigned(0, 27),
            rgb: unsigned(1, 12),
            opacity: unsigned(1, 12),
        },
        project: Project {
            eye: signed(3, 26),
            relative: signed(1, 26).rounded(Rounding::Truncate),
            rotation: signed(2, 25),
            camera: signed(2, 25),
            depth: unsigned(1, 26),
            reciprocal: fine,
            slope: signed(4, 22),
            focal: unsigned(15, 12),
            pixel: signed(15, 14),
        },
        ellipse: Ellipse {
            normal: signed(2, 22),
            tilt: signed(4, 22),
            facing: signed(4, 22),
            scaled_radius: unsigned(1, 26).rounded(Rounding::Truncate),
            size: unsigned(0, 26),
            size_squared: unsigned(0, 27),
            shape: signed(6, 21),
            low_pass: unsigned(3, 24),
            variance: unsigned(5, 21),
            variance_cross: signed(6, 21),
            area: signed(4, 22),
            determinant: unsigned(8, 40),
            root: fine,
            inverse: unsigned(1, 26),
            conic: unsigned(2, 25),
            conic_cross: signed(2, 25),
            visibility: unsigned(1, 24),
            inverse_two_pi: unsigned(-2, 24),
            amplitude: unsigned(-2, 24),
            extent_root: FunctionUnit { table_bits: 8, newton_steps: 1, bits: 18 },
            extent: unsigned(15, 4),
            slope_reciprocal: FunctionUnit { table_bits: 8, newton_steps: 1, bits: 20 },
            inverse_focal: unsigned(1, 24),
            depth_step: unsigned(1, 25),
            depth_slope: signed(3, 24),
            root_cutoff: unsigned(3, 16),
            depth_range: unsigned(0, 26),
        },
        raster: Raster {
            rows: Rows::Differenced,
            cutoff: unsigned(5, 16),
            offset: signed(15, 12),
            gradient: signed(12, 15),
            radial: signed(20, 27).overflowing(Overflow::Wrap),
            first: signed(16, 27),
            second: signed(4, 25),
            depth: signed(18, 26).overflowing(Overflow::Wrap),
        },
        gauss: Gauss {
            radial_index: unsigned(2, 18),
            table: TableShape { index_bits: 8, interpolation: Interpolation::Linear },
            falloff: unsigned(1, 20),
            weight: unsigned(-2, 20),
        },
        fragment: Fragment {
            layers: 3,
            merge: Merge::FarthestPair,
            evict_hidden: true,
            fragment_depth: FragmentDepth::First,
            opaque_permille: 999,
            opaque: unsigned(1, 12),
            depth: unsigned(1, 25),
            normal: signed(2, 12),
            weight_sum: unsigned(5, 20),
            colour_sum: unsigned(5, 20),
            opacity_sum: unsigned(5, 20),
            normal_sum: signed(6, 20),
        },
        shade: Shade {
            reciprocal: FunctionUnit { table_bits: 8, newton_steps: 1, bits: 20 },
            root: FunctionUnit { table_bits: 8, newton_steps: 1, bits: 20 },
            share: unsigned(2, 20),
            normal_share: signed(2, 20),
            rgb: unsigned(1, 18),
            opacity: unsigned(1, 18),
            normal: signed(2, 18),
            light: signed(2, 18),
            cosine: signed(2, 18),
            highlight_table: TableShape { index_bits: 10, interpolation: Interpolation::Linear },
            highlight: unsigned(1, 18),
            reflectance: unsigned(4, 18),
            irradiance: unsigned(4, 18),
            colour: unsigned(1, 18),
            inverse_threshold: unsigned(1, 18),
            coverage: unsigned(1, 18),
            premultiplied: unsigned(1, 18),
        },
        resolve: Resolve { transmittance: unsigned(1, 18), frame: unsigned(1, 16) },
        timing: timing::DEFAULT,
    }
}

/// The cheapest whose picture is still good: no multiplier operand over 18 bits, no accumulator over 24.
fn lean() -> Machine {
    let unit = FunctionUnit { table_bits: 8, newton_steps: 1, bits: 17 };
    let base = reference();
    Machine {
        name: "lean".into(),
        splat: Splat {
            position: signed(1, 22),
            normal: signed(2, 14),
            radius: unsigned(-3, 20),
            rgb: unsigned(1, 11),
            opacity: unsigned(1, 11),
        },
        project: Project {
            eye: signed(3, 22),
            relative: signed(1, 17).rounded(Rounding::Truncate),
            rotation: signed(2, 16),
            camera: signed(2, 16),
            depth: unsigned(1, 22),
            reciprocal: unit,
            slope: signed(2, 16),
            focal: unsigned(11, 7),
            pixel: signed(12, 8),
        },
        ellipse: Ellipse {
            normal: signed(2, 15),
            tilt: signed(3, 14),
            facing: signed(3, 15),
            scaled_radius: unsigned(1, 17).rounded(Rounding::Truncate),
            size: unsigned(0, 17),
            size_squared: unsigned(0, 18),
            shape: signed(4, 14),
            low_pass: unsigned(3, 15),
            variance: unsigned(4, 13),
            variance_cross: signed(4, 13),
            area: signed(3, 15),
            determinant: unsigned(7, 30),
            root: unit,
            inverse: unsigned(1, 17),
            conic: unsigned(2, 16),
            conic_cross: signed(2, 16),
            visibility: unsigned(1, 16),
            inverse_two_pi: unsigned(-2, 18),
            amplitude: unsigned(-2, 18),
            extent_root: FunctionUnit { table_bits: 8, newton_steps: 0, bits: 12 },
            extent: unsigned(12, 3),
            slope_reciprocal: FunctionUnit { table_bits: 8, newton_steps: 1, bits: 14 },
            inverse_focal: unsigned(1, 16),
            depth_step: unsigned(1, 17),
            depth_slope: signed(1, 17),
            root_cutoff: unsigned(3, 10),
            depth_range: unsigned(-3, 20),
        },
        raster: Raster {
            rows: Rows::Seeded,
            cutoff: unsigned(5, 10),
            offset: signed(10, 8),
            gradient: signed(8, 10),
            radial: signed(9, 15).overflowing(Overflow::Wrap),
            first: signed(8, 15),
            second: signed(3, 15),
            depth: signed(4, 20).overflowing(Overflow::Wrap),
        },
        gauss: Gauss {
            radial_index: unsigned(2, 12),
            table: TableShape { index_bits: 6, interpolation: Interpolation::Linear },
            falloff: unsigned(1, 14),
            weight: unsigned(-2, 17),
        },
        fragment: Fragment {
            depth: unsigned(1, 20),
            opaque: unsigned(1, 12),
            normal: signed(2, 10),
            weight_sum: unsigned(4, 14),
            colour_sum: unsigned(4, 14),
            opacity_sum: unsigned(4, 14),
            normal_sum: signed(5, 13),
            ..base.fragment
        },
        shade: Shade {
            reciprocal: FunctionUnit { table_bits: 8, newton_steps: 1, bits: 16 },
            root: FunctionUnit { table_bits: 8, newton_steps: 1, bits: 16 },
            share: unsigned(2, 14),
            normal_share: signed(2, 14),
            rgb: unsigned(1, 14),
            opacity: unsigned(1, 14),
            normal: signed(2, 14),
            light: signed(2, 14),
            cosine: signed(2, 14),
            highlight_table: TableShape { index_bits: 8, interpolation: Interpolation::Linear },
            highlight: unsigned(1, 14),
            reflectance: unsigned(3, 12),
            irradiance: unsigned(3, 12),
            colour: unsigned(1, 14),
            inverse_threshold: unsigned(1, 14),
            coverage: unsigned(1, 14),
            premultiplied: unsigned(1, 14),
        },
        resolve: Resolve { transmittance: unsigned(1, 14), frame: unsigned(1, 12) },
        timing: timing::DEFAULT,
    }
}

/// Visibly coarse and quick: about eight bits everywhere, for tests and for seeing errors.
fn tiny() -> Machine {
    let unit = FunctionUnit { table_bits: 6, newton_steps: 0, bits: 9 };
    let base = reference();
    Machine {
        name: "tiny".into(),
        splat: Splat {
            position: signed(1, 11),
            normal: signed(2, 6),
            radius: unsigned(-3, 14),
            rgb: unsigned(1, 7),
            opacity: unsigned(1, 7),
        },
        project: Project {
            eye: signed(3, 11),
            relative: signed(1, 9).rounded(Rounding::Truncate),
            rotation: signed(2, 8),
            camera: signed(2, 9),
            depth: unsigned(1, 12),
            reciprocal: unit,
            slope: signed(2, 9),
            focal: unsigned(11, 2),
            pixel: signed(12, 3),
        },
        ellipse: Ellipse {
            normal: signed(2, 7),
            tilt: signed(3, 7),
            facing: signed(3, 7),
            scaled_radius: unsigned(1, 8).rounded(Rounding::Truncate),
            size: unsigned(0, 8),
            size_squared: unsigned(0, 9),
            shape: signed(4, 6),
            low_pass: unsigned(3, 8),
            variance: unsigned(4, 6),
            variance_cross: signed(4, 6),
            area: signed(3, 7),
            determinant: unsigned(7, 14),
            root: unit,
            inverse: unsigned(1, 8),
            conic: unsigned(2, 8),
            conic_cross: signed(2, 8),
            visibility: unsigned(1, 8),
            inverse_two_pi: unsigned(-2, 10),
            amplitude: unsigned(-2, 10),
            extent_root: unit,
            extent: unsigned(12, 2),
            slope_reciprocal: unit,
            inverse_focal: unsigned(1, 8),
            depth_step: unsigned(1, 8),
            depth_slope: signed(1, 10),
            root_cutoff: unsigned(3, 6),
            depth_range: unsigned(-3, 11),
        },
        raster: Raster {
            rows: Rows::Seeded,
            cutoff: unsigned(5, 4),
            offset: signed(10, 3),
            gradient: signed(8, 5),
            radial: signed(9, 8).overflowing(Overflow::Wrap),
            first: signed(8, 8),
            second: signed(3, 8),
            depth: signed(4, 12).overflowing(Overflow::Wrap),
        },
        gauss: Gauss {
            radial_index: unsigned(2, 6),
            table: TableShape { index_bits: 5, interpolation: Interpolation::Nearest },
            falloff: unsigned(1, 8),
            weight: unsigned(-2, 10),
        },
        fragment: Fragment {
            depth: unsigned(1, 10),
            opaque: unsigned(1, 10),
            normal: signed(2, 6),
            weight_sum: unsigned(3, 8),
            colour_sum: unsigned(3, 8),
            opacity_sum: unsigned(3, 8),
            normal_sum: signed(4, 8),
            ..base.fragment
        },
        shade: Shade {
            reciprocal: FunctionUnit { table_bits: 6, newton_steps: 0, bits: 8 },
            root: FunctionUnit { table_bits: 6, newton_steps: 0, bits: 8 },
            share: unsigned(2, 8),
            normal_share: signed(2, 8),
            rgb: unsigned(1, 8),
            opacity: unsigned(1, 8),
            normal: signed(2, 8),
            light: signed(2, 8),
            cosine: signed(2, 8),
            highlight_table: TableShape { index_bits: 6, interpolation: Interpolation::Nearest },
            highlight: unsigned(1, 8),
            reflectance: unsigned(3, 6),
            irradiance: unsigned(3, 6),
            colour: unsigned(1, 8),
            inverse_threshold: unsigned(1, 8),
            coverage: unsigned(1, 8),
            premultiplied: unsigned(1, 8),
        },
        resolve: Resolve { transmittance: unsigned(1, 8), frame: unsigned(1, 8) },
        timing: timing::DEFAULT,
    }
}

//! Ellipse: turns a normal and a radius into a conic, an amplitude, a box and a depth plane (docs/book/algorithm.md §3, second half of
//! "setup").
//!
//! ```text
//! radius ─►(× s)─►(× 1/t_z)─► size k' = k/2^e ─►(× aspect)─► k'² ─┬─────────────►(×)─► variance V' ─┬─► extent ─► box
//! normal ─►[ W·n ]─┬─► tilt g ─►[ 1+a² … − ggᵀ ]─► shape ────────┘  low_pass v/4^e ──(+)─┘          │
//!                  ├─► facing c_n ─► area k'²·c_n ─► determinant ─►[ 1/√ ]─┬─► inverse ─►(×)────────┴─► conic
//!                  │     └─►[ 1/|c_n| ]─► depth_slope                      └─► visibility ─► amplitude
//!                  └─►[ −n where n_z > 0 ]─► normal of the fragments
//! ```
//! Each splat picks a power of two 2^e near its own radius in pixels and works relative to it, so that footprints of a
//! tenth of a pixel and of a thousand pixels keep the same relative precision in the same words.
//! det V' = area² + v'·tr V' − v'²: the three terms of docs/book/algorithm.md §3 with v'·tr V_r' + v'² gathered, none of which can go
//! negative.
//!
//! Where pixels are not square, k'² is three words: k'_x², k'_x·k'_y and k'_y², each k'² times a register (`aspect`) of at most 1, for k' is
//! that of the larger focal length; and the depth slopes come of a step each. Where they are square the registers are 1 and change no bit.
//!
//! Losses: every word is rounded to nearest, but `scaled_radius`, which a normaliser cuts; `extent` gets one more place than it
//! needs, so the box never loses a pixel to rounding; `depth_slope` is clamped, for a grazing plane's slope has no limit and
//! the depth clamp (`depth_range`) rules there.
//!
//! Culls: *faint* where c_n, det V', σ or A is 0; *backface* where c_n > 0, if asked; *outside* where the box misses the picture.

use crate::elaboration::latency::{PRODUCT, Path};
use crate::elaboration::{Elaboration, MAX_OPERAND_BITS, Operator};
use crate::frame::{Scaled, View};
use crate::functions::reciprocal::{NORMALISED_FRAC_BITS, Scientific};
use crate::functions::{Reciprocal, ReciprocalRoot, square_root};
use crate::machine::Machine;
use crate::num::{Exact, Exacts, Fit, Format, Rounding, Word, Words, align, three, two};
use crate::probe::{Probe, Tap};
use crate::records::unit;

use ellipsoid::Ellipsoids;

const UNIT: &str = unit::ELLIPSE;

/// Input port, eight splats: the splat's words and the point's.
#[derive(Clone, Copy, Debug)]
pub struct Input<W> {
    /// Normal, world axes (`splat.normal`).
    pub normal: [W; 3],
    /// σ (`splat.radius`).
    pub radius: W,
    /// t_z/2^exponent (`project.camera`).
    pub forward: W,
    /// The power of two that t is relative to.
    pub exponent: W,
    /// 2^exponent/t_z.
    pub inverse_depth: Scientific<W>,
    /// a, b (`project.slope`).
    pub slope: [W; 2],
    /// Position from the picture's middle (`project.pixel`).
    pub pixel: [W; 2],
}

/// Output port, eight splats.
#[derive(Clone, Copy, Debug)]
pub struct Output<W> {
    /// Camera-space normal (`fragment.normal`).
    pub normal: [W; 3],
    /// Q00, Q01, Q11 (`ellipse.conic`, `ellipse.conic_cross`).
    pub conic: [W; 3],
    /// A (`ellipse.amplitude`).
    pub amplitude: W,
    /// First and last column and row, inside the picture.
    pub columns: [W; 2],
    /// First and last row, inside the picture.
    pub rows: [W; 2],
    /// z_x, z_y (`ellipse.depth_slope`).
    pub depth_slope: [W; 2],
    /// Half-width of the depth clamp (`ellipse.depth_range`).
    pub depth_range: W,
    /// Faces away, and that counts.
    pub backface: W,
    /// Nothing to see.
    pub faint: W,
    /// The box misses the picture.
    pub outside: W,
}

/// Longest way: normal, tilt, shape, variance, determinant, root, inverse, conic; visibility and amplitude, extents and slopes beside that.
pub fn path(machine: &Machine) -> Path {
    let (m, p) = (&machine.ellipse, &machine.project);
    let bits = |word: Word| word.format.width();
    let root = m.root.bits.min(64) as i32;
    // An ellipsoid's axes come from its quaternion, and are stretched before they are squared.
    let own = m.ellipsoid.map_or(Path::default(), |of| {
        let quaternion = bits(of.quaternion);
        Path::default()
            .product(quaternion, quaternion)
            .sum(2 * quaternion)
            .fit(bits(machine.splat.normal))
            .product(bits(m.tilt), bits(of.scale))
    });
    Path { cycles: 0, ..own }
        .product(bits(p.rotation), bits(machine.splat.normal))
        .sum_of_three(bits(p.rotation) + bits(machine.splat.normal))
        .fit(bits(m.normal))
        .product(bits(p.slope), bits(m.normal))
        .sum_of_three(bits(p.slope) + bits(m.normal))
        .fit(bits(m.tilt))
        .product(bits(m.tilt), bits(m.tilt))
        .sum(2 * bits(m.tilt))
        .fit(bits(m.shape))
        .beside(size_path(machine))
        .product(bits(m.size_squared), bits(m.shape))
        .sum(bits(m.size_squared) + bits(m.shape))
        .fit(bits(m.variance))
        .sum(bits(m.variance))
        .product(bits(m.low_pass), bits(m.variance))
        .sum(bits(m.determinant))
        .fit(bits(m.determinant))
        // Registers that the squares of an area have.
        .wait(PRODUCT)
        .normalise(bits(m.determinant))
        .then(square_root::path(m.root, bits(m.determinant)))
        .product(root, root)
        .fit(bits(m.inverse))
        .product(bits(m.variance), bits(m.inverse))
        .shift(bits(m.conic))
        .fit(bits(m.conic))
        // And those of an amplitude.
        .wait(PRODUCT)
}

/// Way of a size: focal length, normalise, 1/t_z, square, aspect.
fn size_path(machine: &Machine) -> Path {
    let (m, p) = (&machine.ellipse, &machine.project);
    let bits = |word: Word| word.format.width();
    let squared = Path::default()
        .product(bits(p.focal), bits(machine.splat.radius))
        .normalise(bits(p.focal) + bits(machine.splat.radius))
        .fit(bits(m.scaled_radius))
        .product(bits(m.scaled_radius), p.reciprocal.bits.min(64) as i32)
        .shift(bits(m.size))
        .fit(bits(m.size))
        .product(bits(m.size), bits(m.size))
        .fit(bits(m.size_squared));
    m.aspect.map_or(squared, |aspect| squared.product(bits(m.size_squared), bits(aspect)).fit(bits(m.size_squared)))
}

/// The elaborated unit.
#[derive(Clone, Debug)]
pub struct Ellipse {
    normal: Fit,
    turns_normals: bool,
    fragment_normal: Fit,
    tilt: Fit,
    facing: Fit,
    scaled_radius: Fit,
    size: Fit,
    size_squared: Fit,
    /// Products of `size_squared` and `aspect`; none where all pixels are square.
    stretched: Option<Fit>,
    shape: Fit,
    low_pass: Fit,
    variance: Fit,
    variance_cross: Fit,
    area: Fit,
    determinant: Fit,
    root: ReciprocalRoot,
    inverse: Fit,
    conic: Fit,
    conic_cross: Fit,
    visibility: Fit,
    amplitude: Fit,
    inverse_two_pi: i64,
    extent_root: ReciprocalRoot,
    extent: Fit,
    edge: Fit,
    slope_reciprocal: Reciprocal,
    depth_step: Fit,
    slope_scale: Fit,
    depth_slope: Fit,
    depth_range: Fit,
    places: Places,
    ellipsoids: Option<Ellipsoids>,
}

/// Footprint of both kinds of splats.
struct Footprint<W> {
    conic: [W; 3],
    amplitude: W,
    columns: [W; 2],
    rows: [W; 2],
    faint: W,
    outside: W,
}

/// Where binary points lie, for aligning the terms of sums.
#[derive(Clone, Copy, Debug)]
struct Places {
    slope: u32,
    /// s·σ as an exact product.
    scaled_radius: i64,
    /// Terms of `shape`: one, a², g².
    shape: [u32; 3],
    /// Terms of `variance`: k'²·shape, v'.
    variance: [u32; 2],
    /// Terms of `determinant`: area², v'·tr, v'².
    determinant: [u32; 3],
    /// Terms of an edge: pixel, extent; and their common fraction bits.
    edge: [u32; 2],
    edge_frac_bits: u32,
}

/// 1/2π with 62 fraction bits.
const INVERSE_TWO_PI_Q62: i64 = 733_972_625_820_500_307;

impl Ellipse {
    /// Elaborates the unit.
    pub fn new(e: &mut Elaboration, machine: &Machine) -> Self {
        let (m, p) = (&machine.ellipse, &machine.project);
        for (name, word, signed) in [
            ("normal", m.normal, true),
            ("tilt", m.tilt, true),
            ("facing", m.facing, true),
            ("scaled_radius", m.scaled_radius, false),
            ("size", m.size, false),
            ("size_squared", m.size_squared, false),
            ("shape", m.shape, true),
            ("low_pass", m.low_pass, false),
            ("variance", m.variance, false),
            ("variance_cross", m.variance_cross, true),
            ("area", m.area, true),
            ("inverse", m.inverse, false),
            ("conic", m.conic, false),
            ("conic_cross", m.conic_cross, true),
            ("visibility", m.visibility, false),
            ("inverse_two_pi", m.inverse_two_pi, false),
            ("amplitude", m.amplitude, false),
            ("extent", m.extent, false),
            ("inverse_focal", m.inverse_focal, false),
            ("depth_step", m.depth_step, false),
            ("depth_slope", m.depth_slope, true),
            ("root_cutoff", m.root_cutoff, false),
            ("depth_range", m.depth_range, false),
        ] {
            e.port(UNIT, name, word);
            e.signedness(UNIT, name, word, signed);
        }
        e.signedness(UNIT, "determinant", m.determinant, false);
        e.saturates(UNIT, "determinant", m.determinant);
        // The magnitude of the least area, and the sum of two variances, are multiplier operands too.
        for (name, word, limit) in [("area", m.area, MAX_OPERAND_BITS - 1), ("variance", m.variance, MAX_OPERAND_BITS - 2)] {
            let Format { frac_bits, .. } = word.format;
            e.require(word.format.width() <= limit, || {
                let fits = Format { int_bits: limit - frac_bits.min(limit), frac_bits: frac_bits.min(limit), ..word.format };
                format!("ellipse.{name} is {word}, {} bits where {limit} can be used: {fits} would fit", word.format.width())
            });
        }
        for (name, word) in [("normal", m.normal), ("scaled_radius", m.scaled_radius), ("inverse", m.inverse), ("visibility", m.visibility)]
        {
            e.holds_one(UNIT, name, word);
        }
        e.holds_one(UNIT, "inverse_focal", m.inverse_focal);
        let inverse_depth = p.reciprocal.format();

        let normal = e.copies(3, |e| {
            let rotated = e.copies(3, |e| e.times(UNIT, p.rotation, machine.splat.normal));
            let sum = e.sum(UNIT, [rotated; 3]);
            e.fit(UNIT, "normal", m.normal, sum)
        });
        let leaned = e.copies(4, |e| e.times(UNIT, p.slope, m.normal));
        let tilt = e.copies(2, |e| {
            let sum = e.sum(UNIT, [leaned, m.normal.into()]);
            e.fit(UNIT, "tilt", m.tilt, sum)
        });
        let sum = e.sum(UNIT, [leaned, leaned, m.normal.into()]);
        let facing = e.fit(UNIT, "facing", m.facing, sum);

        let scaled = e.times(UNIT, p.focal, machine.splat.radius);
        e.normaliser(UNIT, scaled.bits());
        let normalised = Exact { int_bits: 1, frac_bits: NORMALISED_FRAC_BITS };
        let scaled_radius = e.fit(UNIT, "scaled_radius", m.scaled_radius, normalised);
        let sized = e.times(UNIT, m.scaled_radius, inverse_depth);
        let size = e.fit_shifted(UNIT, "size", m.size, sized);
        let squared = e.times(UNIT, m.size, m.size);
        let size_squared = e.fit(UNIT, "size_squared", m.size_squared, squared);
        let stretched = m.aspect.map(|aspect| {
            e.port(UNIT, "aspect", aspect);
            e.signedness(UNIT, "aspect", aspect, false);
            e.holds_one(UNIT, "aspect", aspect);
            e.copies(3, |e| {
                let product = e.times(UNIT, m.size_squared, aspect);
                e.fit(UNIT, "size_squared", m.size_squared, product)
            })
        });

        let one = Exact { int_bits: 1, frac_bits: 0 };
        let shape = e.copies(3, |e| {
            let slope_squared = e.times(UNIT, p.slope, p.slope);
            let tilt_squared = e.times(UNIT, m.tilt, m.tilt);
            let sum = e.sum(UNIT, [slope_squared, one, tilt_squared]);
            e.fit(UNIT, "shape", m.shape, sum)
        });
        let low_pass = e.fit_shifted(UNIT, "low_pass", m.low_pass, m.low_pass.into());
        let spread = e.copies(3, |e| e.times(UNIT, m.size_squared, m.shape));
        let variance = e.copies(2, |e| {
            let sum = e.sum(UNIT, [spread, m.low_pass.into()]);
            e.fit(UNIT, "variance", m.variance, sum)
        });
        let variance_cross = e.fit(UNIT, "variance_cross", m.variance_cross, spread);

        let turned = e.times(UNIT, m.size_squared, m.facing);
        let area = e.fit(UNIT, "area", m.area, turned);
        let trace = Format { int_bits: m.variance.format.int_bits + 1, ..m.variance.format };
        let area_squared = e.times(UNIT, m.area, m.area);
        let filtered = e.times(UNIT, m.low_pass, trace);
        let filter_squared = e.times(UNIT, m.low_pass, m.low_pass);
        e.part(UNIT, Operator::Adder(trace.width()));
        // One face of a disc, three of an ellipsoid.
        let squares = if m.ellipsoid.is_some() { e.sum(UNIT, [area_squared; 3]) } else { area_squared };
        let sum = e.sum(UNIT, [squares, filtered, filter_squared]);
        let determinant = e.fit(UNIT, "determinant", m.determinant, sum);
        e.normaliser(UNIT, m.determinant.format.width());
        let root = ReciprocalRoot::new(e, UNIT, "root", m.root, m.determinant.format.frac_bits);
        let square = e.times(UNIT, m.root.format(), m.root.format());
        let inverse = e.fit(UNIT, "inverse", m.inverse, square);
        let conic = e.copies(2, |e| {
            let inverted = e.times(UNIT, m.variance, m.inverse);
            e.fit_shifted(UNIT, "conic", m.conic, inverted)
        });
        let inverted_cross = e.times(UNIT, m.variance_cross, m.inverse);
        let conic_cross = e.fit_shifted(UNIT, "conic_cross", m.conic_cross, inverted_cross);
        let seen = e.times(UNIT, m.area, m.root.format());
        let visibility = e.fit_shifted(UNIT, "visibility", m.visibility, seen);
        let shown = e.times(UNIT, m.visibility, m.inverse_two_pi);
        let amplitude = e.fit(UNIT, "amplitude", m.amplitude, shown);

        let reach = e.copies(2, |e| e.times(UNIT, machine.raster.cutoff, m.variance));
        e.copies(2, |e| e.normaliser(UNIT, reach.bits()));
        e.holds_exact("the operand of ellipse.extent_root, raster.cutoff · ellipse.variance, normalised,", reach.scaled(1).plus(reach));
        let extent_root = e.copies(2, |e| ReciprocalRoot::new(e, UNIT, "extent_root", m.extent_root, reach.frac_bits));
        let root_bits = m.extent_root.format();
        let extent = e.copies(2, |e| {
            let reached = e.times(UNIT, root_bits, root_bits).scaled(1);
            e.fit_shifted(UNIT, "extent", m.extent, reached)
        });
        let edge_frac_bits = p.pixel.format.frac_bits.max(m.extent.format.frac_bits);
        // The picture's middle lies up to 8192 pixels from its first.
        let middle = Exact { int_bits: 14, frac_bits: 1 };
        let edge = e.copies(4, |e| {
            let sum = e.sum(UNIT, [p.pixel.into(), middle, m.extent.into(), m.extent.into()]);
            let edge = e.fit(UNIT, "edge", Word::new(Format::signed(17, 0)).rounded(Rounding::Truncate), sum);
            e.limit(UNIT, 17);
            edge
        });
        // A box in which the first lies behind the last; magnitudes of facing and area; each scale to either side.
        let steps = if m.aspect.is_some() { 2 } else { 1 };
        e.adders(UNIT, 2, 17);
        for (word, copies) in [(m.facing, 1), (m.area, 1), (m.depth_step, steps)] {
            e.copies(copies, |e| e.limit(UNIT, word.format.width()));
        }

        e.normaliser(UNIT, m.facing.format.width());
        let slope_reciprocal = Reciprocal::new(e, UNIT, "slope_reciprocal", m.slope_reciprocal, m.facing.format.frac_bits);
        let depth_step = e.copies(steps, |e| {
            let step = e.times(UNIT, p.camera, m.inverse_focal);
            e.fit(UNIT, "depth_step", m.depth_step, step)
        });
        let slope_scale = e.copies(steps, |e| {
            let steep = e.times(UNIT, m.depth_step, m.slope_reciprocal.format());
            e.fit(UNIT, "depth_step", m.depth_step, steep)
        });
        let depth_slope = e.copies(2, |e| {
            let leaning = e.times(UNIT, m.depth_step, m.normal);
            e.fit_shifted(UNIT, "depth_slope", m.depth_slope, leaning)
        });
        let deep = e.times(UNIT, machine.splat.radius, m.root_cutoff);
        let depth_range = e.fit(UNIT, "depth_range", m.depth_range, deep);
        let turns_normals = machine.fragment.turn_normals;
        let mut seen_normal = Exact::from(m.normal);
        if turns_normals {
            // The least word has no opposite among the words.
            seen_normal.int_bits += 1;
            e.copies(3, |e| e.limit(UNIT, m.normal.format.width() + 1));
        }
        let fragment_normal = e.copies(3, |e| e.fit(unit::FRAGMENT, "normal", machine.fragment.normal, seen_normal));

        let ellipsoids = Ellipsoids::new(e, machine);
        let f = |word: Word| word.format.frac_bits;
        let shape_align = align([2 * f(p.slope), 2 * f(m.tilt)]);
        Ellipse {
            places: Places {
                slope: f(p.slope) as u32,
                scaled_radius: i64::from(scaled.frac_bits),
                shape: [(2 * f(p.slope)) as u32 + shape_align[0], shape_align[0], shape_align[1]],
                variance: align([spread.frac_bits, f(m.low_pass)]),
                determinant: align([area_squared.frac_bits, filtered.frac_bits, filter_squared.frac_bits]),
                edge: align([f(p.pixel), f(m.extent)]),
                edge_frac_bits: edge_frac_bits.max(1) as u32,
            },
            ellipsoids,
            inverse_two_pi: Fit::new(0, m.inverse_two_pi, Exact { int_bits: 0, frac_bits: 62 }).one(INVERSE_TWO_PI_Q62),
            normal,
            turns_normals,
            fragment_normal,
            tilt,
            facing,
            scaled_radius,
            size,
            size_squared,
            stretched,
            shape,
            low_pass,
            variance,
            variance_cross,
            area,
            determinant,
            root,
            inverse,
            conic,
            conic_cross,
            visibility,
            amplitude,
            extent_root,
            extent,
            edge,
            slope_reciprocal,
            depth_step,
            slope_scale,
            depth_slope,
            depth_range,
        }
    }

    /// 1/2π.
    pub fn inverse_two_pi(&self) -> i64 {
        self.inverse_two_pi
    }

    /// 1/√det V.
    pub fn root(&self) -> &ReciprocalRoot {
        &self.root
    }

    /// √(cutoff·V).
    pub fn extent_root(&self) -> &ReciprocalRoot {
        &self.extent_root
    }

    /// |(a, b, 1)|.
    pub fn ray_root(&self) -> Option<&ReciprocalRoot> {
        self.ellipsoids.as_ref().map(Ellipsoids::ray_root)
    }

    /// √(det V_r).
    pub fn compensation_root(&self) -> Option<&ReciprocalRoot> {
        self.ellipsoids.as_ref().and_then(Ellipsoids::compensation_root)
    }

    /// 1/c_n.
    pub fn slope_reciprocal(&self) -> &Reciprocal {
        &self.slope_reciprocal
    }

    /// Sets eight discs up.
    #[inline(always)]
    pub fn lanes<W: Words, P: Probe>(&self, view: &View, size_px: [u32; 2], input: &Input<W>, tap: &mut Tap<P>) -> Output<W> {
        let normal = self.camera_normal(view, input.normal, tap);
        let (tilt, facing) = self.turn(input.slope, normal, tap);
        let zero = W::splat(0);
        let away = if view.cull_backfaces { facing.above(zero) } else { zero };
        let blind = facing.is_zero() | input.radius.is_none();
        tap.drop_where(away | blind);
        let one = W::splat(1);
        let facing = one.where_else(blind, facing);
        let radius = input.radius.max(one);

        let sized = self.size(view, radius, input, tap);
        let shape = self.disc(input.slope, tilt, tap);
        let shown = |[area]: [W; 1], inverse_root: &Scientific<W>, tap: &mut Tap<P>| {
            let visibility = tap.fit_shifted(&self.visibility, area.abs() * inverse_root.mantissa, -inverse_root.exponent);
            tap.fit_words(&self.amplitude, visibility * W::splat(self.inverse_two_pi))
        };
        let cutoff = W::splat(view.cutoff);
        let footprint = self.footprint(cutoff, view, size_px, input.pixel, sized, (shape, [facing]), shown, tap);
        Output {
            normal: self.seen_normal(normal, tap),
            conic: footprint.conic,
            amplitude: footprint.amplitude,
            columns: footprint.columns,
            rows: footprint.rows,
            depth_slope: self.depth_slope(view, input, normal, facing, tap),
            depth_range: tap.fit_words(&self.depth_range, radius * W::splat(view.root_cutoff)),
            backface: away,
            faint: blind | footprint.faint,
            outside: footprint.outside,
        }
    }

    /// From a shape's variance without size, and its faces, to a conic and a box.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "the wires between the halves of the unit, one by one")]
    fn footprint<W: Words, P: Probe, const FACES: usize>(
        &self,
        cutoff: W,
        view: &View,
        size_px: [u32; 2],
        pixel: [W; 2],
        (size_squared, exponent): ([W; 3], W),
        (shape, faces): ([W; 3], [W; FACES]),
        amplitude: impl FnOnce([W; FACES], &Scientific<W>, &mut Tap<P>) -> W,
        tap: &mut Tap<P>,
    ) -> Footprint<W> {
        let low_pass = tap.fit_shifted(&self.low_pass, W::Exact::splat(view.low_pass), exponent + exponent);
        let variance = self.variance(shape, size_squared, low_pass, tap);
        let mut areas = faces;
        for area in &mut areas {
            *area = tap.fit_words(&self.area, size_squared[1] * *area);
        }
        let determinant = self.determinant(areas, variance, low_pass, tap);
        let flat = W::Exact::splat(1).above(determinant);
        tap.drop_where(flat);

        let inverse_root = self.root.lanes(determinant.max(W::Exact::splat(1)), tap);
        let conic = self.conic(variance, inverse_root, exponent, tap);
        let amplitude = amplitude(areas, &inverse_root, tap);
        let dark = amplitude.is_none();

        let across = [variance[0], variance[2]];
        let [columns, rows] = two!(axis => self.side(cutoff, size_px[axis], pixel[axis], across[axis], exponent, tap));
        let outside = columns[0].above(columns[1]) | rows[0].above(rows[1]);
        tap.drop_where(dark | outside);
        Footprint { conic, amplitude, columns, rows, faint: flat | dark, outside }
    }

    #[inline(always)]
    fn camera_normal<W: Words, P: Probe>(&self, view: &View, normal: [W; 3], tap: &mut Tap<P>) -> [W; 3] {
        three!(row => tap.fit_words(&self.normal, W::dot(view.rotation[row], normal)))
    }

    /// The normal that fragments sum: towards the viewer where the machine turns it, so that a sheet's two sides do not cancel.
    #[inline(always)]
    fn seen_normal<W: Words, P: Probe>(&self, normal: [W; 3], tap: &mut Tap<P>) -> [W; 3] {
        let mut seen = normal;
        if self.turns_normals {
            let away = normal[2].above(W::splat(0));
            seen = three!(axis => (-normal[axis]).where_else(away, normal[axis]));
        }
        three!(axis => tap.fit_words(&self.fragment_normal, seen[axis].exact()))
    }

    /// Whether the normal of a splat is turned on its way to the fragments.
    pub fn turns(&self, view: &View, normal: [i32; 3]) -> bool {
        let z: i64 = view.rotation[2].iter().zip(normal).map(|(row, part)| row * i64::from(part)).sum();
        self.turns_normals && self.normal.one(z) > 0
    }

    /// g and c_n.
    #[inline(always)]
    fn turn<W: Words, P: Probe>(&self, [a, b]: [W; 2], n: [W; 3], tap: &mut Tap<P>) -> ([W; 2], W) {
        let [x, y, z] = three!(axis => n[axis].exact().left(self.places.slope));
        let tilt = [tap.fit_words(&self.tilt, x - a * n[2]), tap.fit_words(&self.tilt, y - b * n[2])];
        (tilt, tap.fit_words(&self.facing, a * n[0] + b * n[1] + z))
    }

    /// k'_x², k'_x·k'_y, k'_y², and e.
    #[inline(always)]
    fn size<W: Words, P: Probe>(&self, view: &View, radius: W, input: &Input<W>, tap: &mut Tap<P>) -> ([W; 3], W) {
        let scaled = (W::splat(view.focal) * radius).max(W::Exact::splat(1));
        let lead = scaled.leading_zeros() - W::splat(2);
        let mantissa = tap.fit_top(&self.scaled_radius, scaled.left_by(lead));
        let floor = i64::from(NORMALISED_FRAC_BITS) - self.places.scaled_radius;
        // k = mantissa · inverse_depth · 2^power, where the product lies in [½, 2].
        let inverse_depth = input.inverse_depth;
        let power = inverse_depth.exponent - input.exponent + W::splat(floor) - lead;
        let exponent = (power + W::splat(1)).max(W::splat(0));
        let size = tap.fit_shifted(&self.size, mantissa * inverse_depth.mantissa, exponent - power);
        let squared = tap.fit_words(&self.size_squared, size * size);
        let squares = match (view.aspect, &self.stretched) {
            (Some(aspect), Some(fit)) => three!(i => tap.fit_words(fit, squared * W::splat(aspect.squares[i]))),
            _ => [squared; 3],
        };
        (squares, exponent)
    }

    /// [1+a² … − ggᵀ].
    #[inline(always)]
    fn disc<W: Words, P: Probe>(&self, [a, b]: [W; 2], g: [W; 2], tap: &mut Tap<P>) -> [W; 3] {
        let [one, slopes, tilts] = self.places.shape;
        let one = W::Exact::splat(1 << one);
        let shape = [
            one + (a * a).left(slopes) - (g[0] * g[0]).left(tilts),
            (a * b).left(slopes) - (g[0] * g[1]).left(tilts),
            one + (b * b).left(slopes) - (g[1] * g[1]).left(tilts),
        ];
        three!(i => tap.fit_words(&self.shape, shape[i]))
    }

    /// V00', V01', V11'.
    #[inline(always)]
    fn variance<W: Words, P: Probe>(&self, [xx, xy, yy]: [W; 3], size_squared: [W; 3], low_pass: W, tap: &mut Tap<P>) -> [W; 3] {
        let [spread, filter] = self.places.variance;
        let low_pass = low_pass.exact().left(filter);
        [
            tap.fit_words(&self.variance, (size_squared[0] * xx).left(spread) + low_pass),
            tap.fit_words(&self.variance_cross, size_squared[1] * xy),
            tap.fit_words(&self.variance, (size_squared[2] * yy).left(spread) + low_pass),
        ]
    }

    #[inline(always)]
    fn determinant<W: Words, P: Probe, const FACES: usize>(
        &self,
        areas: [W; FACES],
        variance: [W; 3],
        low_pass: W,
        tap: &mut Tap<P>,
    ) -> W::Exact {
        let [squares, filtered, filters] = self.places.determinant;
        let trace = variance[0] + variance[2];
        let mut exact = (low_pass * trace).left(filtered) - (low_pass * low_pass).left(filters);
        for area in areas {
            exact = exact + (area * area).left(squares);
        }
        tap.fit_wide(&self.determinant, exact)
    }

    #[inline(always)]
    fn conic<W: Words, P: Probe>(&self, v: [W; 3], inverse_root: Scientific<W>, exponent: W, tap: &mut Tap<P>) -> [W; 3] {
        let inverse = tap.fit_words(&self.inverse, inverse_root.mantissa * inverse_root.mantissa);
        let more = (exponent - inverse_root.exponent).left(1);
        [
            tap.fit_shifted(&self.conic, v[2] * inverse, more),
            tap.fit_shifted(&self.conic_cross, -(v[1] * inverse), more),
            tap.fit_shifted(&self.conic, v[0] * inverse, more),
        ]
    }

    /// First and last column, or row, clipped to the picture; the first lies behind the last where nothing is left.
    #[inline(always)]
    fn side<W: Words, P: Probe>(&self, cutoff: W, pixels: u32, pixel: W, variance: W, exponent: W, tap: &mut Tap<P>) -> [W; 2] {
        let reach = (cutoff * variance).max(W::Exact::splat(1));
        let (root, power) = self.extent_root.root_lanes(reach, tap);
        let extent = tap.fit_shifted(&self.extent, root, -power - exponent);
        let [pixel_align, extent_align] = self.places.edge;
        let last_px = i64::from(pixels) - 1;
        // From the centre of pixel 0 to the picture's middle: (pixels − 1)/2.
        let first_centre = W::Exact::splat(last_px << (self.places.edge_frac_bits - 1));
        let centre = pixel.exact().left(pixel_align) + first_centre;
        let extent = (extent.exact() + W::Exact::splat(1)).left(extent_align);
        let up = W::Exact::splat((1 << self.places.edge_frac_bits) - 1);
        let first = tap.fit_words(&self.edge, centre - extent + up).max(W::splat(0));
        let last = tap.fit_words(&self.edge, centre + extent).min(W::splat(last_px));
        [first, last]
    }

    #[inline(always)]
    fn depth_slope<W: Words, P: Probe>(&self, view: &View, input: &Input<W>, n: [W; 3], facing: W, tap: &mut Tap<P>) -> [W; 2] {
        let inverse = self.slope_reciprocal.lanes(facing.exact().abs(), tap);
        let scale = |inverse_focal: Scaled, tap: &mut Tap<P>| {
            let step = tap.fit_words(&self.depth_step, input.forward * W::splat(inverse_focal.mantissa));
            let scale = tap.fit_words(&self.slope_scale, step * inverse.mantissa);
            let away = scale.where_else(W::splat(0).above(facing), -scale);
            (away, W::splat(inverse_focal.places) - inverse.exponent - input.exponent)
        };
        let across = scale(view.inverse_focals()[0], tap);
        // Of square pixels it is the same step.
        let down = view.aspect.map_or(across, |aspect| scale(aspect.inverse_focal[1], tap));
        [tap.fit_shifted(&self.depth_slope, across.0 * n[0], across.1), tap.fit_shifted(&self.depth_slope, down.0 * n[1], down.1)]
    }
}

pub mod ellipsoid;
pub mod real;

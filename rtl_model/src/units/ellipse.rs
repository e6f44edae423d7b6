//! Ellipse: turns a normal and a radius into a conic, an amplitude, a box and a depth plane
//! (docs/book/algorithm.md §3, second half of "setup").
//!
//! ```text
//! radius ─►(× s)─►(× 1/t_z)─► size k' = k/2^e ─►(× aspect)─► k'² ─┬─────────────►(×)─► variance V' ─┬─► extent ─► box
//! normal ─►[ W·n ]─┬─► tilt g ─►[ 1+a² … − ggᵀ ]─► shape ────────┘  low_pass v/4^e ──(+)─┘          │
//!                  ├─► facing c_n ─► area k'²·c_n ─► determinant ─►[ 1/√ ]─┬─► inverse ─►(×)────────┴─► conic
//!                  │     └─►[ 1/|c_n| ]─► depth_slope                      └─► visibility ─► amplitude
//!                  └─►[ −n where n_z > 0 ]─► normal of the fragments
//! ```
//! For each splat the unit chooses a power of two 2^e near the splat's radius in pixels and works
//! relative to it. Footprints of 0.1 and of 1000 pixels therefore keep the same relative precision
//! in the same words. det V' = area² + v'·tr V' − v'²: these are the three terms of
//! docs/book/algorithm.md §3, with v'·tr V_r' + v'² gathered. No term can be negative.
//!
//! Where pixels are not square, k'² is three words: k'_x², k'_x·k'_y and k'_y². Each is k'² times
//! a register (`aspect`) of at most 1, because k' uses the larger focal length. The depth slopes
//! then have one step per axis. Where pixels are square the registers are 1 and change no bit.
//!
//! Losses: every word is rounded to nearest, except `scaled_radius`, which a normaliser truncates.
//! `extent` gets one ulp more than it needs, so the box never loses a pixel to rounding.
//! `depth_slope` is clamped: a grazing plane's slope has no limit, and there the depth clamp
//! (`depth_range`) takes over.
//!
//! Culls: *faint* where c_n, det V', σ or A is 0; *backface* where c_n > 0, if culling of backfaces
//! is on; *outside* where the box misses the picture.

use crate::elaboration::latency::Path;
use crate::elaboration::{Elaboration, MAX_OPERAND_BITS, Operator, Signal};
use crate::frame::{self, Frame, Kernel, Scaled, View};
use crate::functions::reciprocal::NORMALISED_FRAC_BITS;
use crate::functions::{Reciprocal, ReciprocalRoot};
use crate::graph::{Asked, Builder, Graph, Power, Program, Wire};
use crate::machine::Machine;
use crate::num::{Exact, Fit, Format, Rounding, Word, three, two};
use crate::records::{MIDDLE, PLACE, unit};
use std::sync::OnceLock;

use ellipsoid::Ellipsoids;

const UNIT: &str = unit::ELLIPSE;

/// Inputs of each splat: normal, radius; from `project` the exponent, t_z, 1/t_z and its exponent,
/// slope, pixel. Ellipsoids add opacity and cutoff of the box. Ellipsoids with their own axes add
/// quaternion and standard deviations. Then [`Ellipse::registers`].
pub const INPUTS: usize = 12;
/// Inputs of each ellipsoid.
pub const ELLIPSOID_INPUTS: usize = INPUTS + 2;
/// Inputs of each ellipsoid with its own axes.
pub const OWN_INPUTS: usize = ELLIPSOID_INPUTS + 7;
/// Results: normal, conic, amplitude, columns, rows, depth slope, depth range, backface, faint,
/// outside.
pub const OUTPUTS: usize = 17;
/// Results that have bounds: normal, its component towards the viewer, facing, determinant, conic,
/// amplitude, half-extents, depth slope, depth range.
const BOUNDS: usize = 15;

/// Kind of splat that the unit sets up. Each variant has its own graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    /// Pixels are not square, and the machine has the words for that.
    has_aspect: bool,
    /// `None` for discs.
    ellipsoid: Option<ellipsoid::Variant>,
}

impl Variant {
    /// Whether pixels are not square, and the machine has the words for that.
    pub fn has_aspect(self) -> bool {
        self.has_aspect
    }

    /// `None` for discs.
    pub fn ellipsoid(self) -> Option<ellipsoid::Variant> {
        self.ellipsoid
    }

    /// Inputs of each splat, before the registers.
    pub fn inputs(self) -> usize {
        match self.ellipsoid {
            None => INPUTS,
            Some(ellipsoid) => {
                if ellipsoid.own {
                    OWN_INPUTS
                } else {
                    ELLIPSOID_INPUTS
                }
            }
        }
    }
}

/// A variant's arithmetic.
#[derive(Clone, Debug)]
pub struct Datapath {
    /// For one splat.
    pub graph: Graph<OUTPUTS>,
    /// For batches.
    pub program: Program,
    bounds: Asked<BOUNDS>,
}

/// Elaborated unit.
#[derive(Clone, Debug)]
pub struct Ellipse {
    machine: Machine,
    signals: Vec<Signal>,
    /// Built at first use.
    datapaths: [OnceLock<Datapath>; VARIANTS],
    normal: Fit,
    root: ReciprocalRoot,
    extent_root: ReciprocalRoot,
    slope_reciprocal: Reciprocal,
    inverse_two_pi: i64,
    ellipsoids: Option<Ellipsoids>,
}

/// Variants: discs and each variant of ellipsoids, with and without an aspect.
const VARIANTS: usize = 2 * (1 + ellipsoid::VARIANTS);

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
            e.number(UNIT, name, word, signed);
        }
        // A box has an ulp more than the root.
        e.fixed_point(UNIT, "extent", m.extent);
        e.signedness(UNIT, "determinant", m.determinant, false);
        e.saturates(UNIT, "determinant", m.determinant);
        // The magnitude of the least area and the sum of two variances are multiplier operands
        // too.
        for (name, word, limit) in [
            ("area", m.area, MAX_OPERAND_BITS - 1),
            ("variance", m.variance, MAX_OPERAND_BITS - 2),
        ] {
            let Format { frac_bits, .. } = word.format;
            e.require(word.format.width() <= limit, || {
                let fits = Format {
                    int_bits: limit - frac_bits.min(limit),
                    frac_bits: frac_bits.min(limit),
                    ..word.format
                };
                format!(
                    "ellipse.{name} is {word}, {} bits where {limit} can be used: {fits} would fit",
                    word.format.width()
                )
            });
        }
        for (name, word) in [
            ("normal", m.normal),
            ("scaled_radius", m.scaled_radius),
            ("inverse", m.inverse),
            ("visibility", m.visibility),
        ] {
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
        e.copies(2, |e| {
            let sum = e.sum(UNIT, [leaned, m.normal.into()]);
            e.fit(UNIT, "tilt", m.tilt, sum)
        });
        let sum = e.sum(UNIT, [leaned, leaned, m.normal.into()]);
        e.fit(UNIT, "facing", m.facing, sum);

        let scaled = e.times(UNIT, p.focal, machine.splat.radius);
        e.normaliser(UNIT, scaled.bits());
        let normalised = Exact {
            int_bits: 1,
            frac_bits: NORMALISED_FRAC_BITS,
        };
        e.fit(UNIT, "scaled_radius", m.scaled_radius, normalised);
        let sized = e.times(UNIT, m.scaled_radius, inverse_depth);
        e.fit_shifted(UNIT, "size", m.size, sized);
        let squared = e.times(UNIT, m.size, m.size);
        e.fit(UNIT, "size_squared", m.size_squared, squared);
        m.aspect.map(|aspect| {
            e.number(UNIT, "aspect", aspect, false);
            e.holds_one(UNIT, "aspect", aspect);
            e.copies(3, |e| {
                let product = e.times(UNIT, m.size_squared, aspect);
                e.fit(UNIT, "size_squared", m.size_squared, product)
            })
        });

        let one = Exact {
            int_bits: 1,
            frac_bits: 0,
        };
        e.copies(3, |e| {
            let slope_squared = e.times(UNIT, p.slope, p.slope);
            let tilt_squared = e.times(UNIT, m.tilt, m.tilt);
            let sum = e.sum(UNIT, [slope_squared, one, tilt_squared]);
            e.fit(UNIT, "shape", m.shape, sum)
        });
        e.fit_shifted(UNIT, "low_pass", m.low_pass, m.low_pass);
        let spread = e.copies(3, |e| e.times(UNIT, m.size_squared, m.shape));
        e.copies(2, |e| {
            let sum = e.sum(UNIT, [spread, m.low_pass.into()]);
            e.fit(UNIT, "variance", m.variance, sum)
        });
        e.fit(UNIT, "variance_cross", m.variance_cross, spread);

        let turned = e.times(UNIT, m.size_squared, m.facing);
        e.fit(UNIT, "area", m.area, turned);
        let trace = Format {
            int_bits: m.variance.format.int_bits + 1,
            ..m.variance.format
        };
        let area_squared = e.times(UNIT, m.area, m.area);
        let filtered = e.times(UNIT, m.low_pass, trace);
        let filter_squared = e.times(UNIT, m.low_pass, m.low_pass);
        e.part(UNIT, Operator::Adder(trace.width()));
        // A disc has one face, an ellipsoid three.
        let squares = if m.ellipsoid.is_some() {
            e.sum(UNIT, [area_squared; 3])
        } else {
            area_squared
        };
        let sum = e.sum(UNIT, [squares, filtered, filter_squared]);
        e.fit(UNIT, "determinant", m.determinant, sum);
        e.normaliser(UNIT, m.determinant.format.width());
        let root = ReciprocalRoot::new(e, UNIT, "root", m.root, m.determinant.format.frac_bits);
        let square = e.times(UNIT, m.root.format(), m.root.format());
        e.fit(UNIT, "inverse", m.inverse, square);
        e.copies(2, |e| {
            let inverted = e.times(UNIT, m.variance, m.inverse);
            e.fit_shifted(UNIT, "conic", m.conic, inverted)
        });
        let inverted_cross = e.times(UNIT, m.variance_cross, m.inverse);
        e.fit_shifted(UNIT, "conic_cross", m.conic_cross, inverted_cross);
        let seen = e.times(UNIT, m.area, m.root.format());
        e.fit_shifted(UNIT, "visibility", m.visibility, seen);
        let shown = e.times(UNIT, m.visibility, m.inverse_two_pi);
        e.fit(UNIT, "amplitude", m.amplitude, shown);

        let reach = e.copies(2, |e| e.times(UNIT, machine.raster.cutoff, m.variance));
        e.copies(2, |e| e.normaliser(UNIT, reach.bits()));
        e.holds_exact(
            "the operand of ellipse.extent_root, raster.cutoff · ellipse.variance, normalised,",
            reach.scaled(1).plus(reach),
        );
        let extent_root = e.copies(2, |e| {
            ReciprocalRoot::new(e, UNIT, "extent_root", m.extent_root, reach.frac_bits)
        });
        let root_bits = m.extent_root.format();
        e.copies(2, |e| {
            let reached = e.times(UNIT, root_bits, root_bits).scaled(1);
            e.fit_shifted(UNIT, "extent", m.extent, reached)
        });
        // The picture's middle is up to 8192 pixels from its first pixel.
        let middle = MIDDLE;
        e.copies(4, |e| {
            let sum = e.sum(
                UNIT,
                [p.pixel.into(), middle, m.extent.into(), m.extent.into()],
            );
            e.fit(UNIT, "edge", EDGE, sum);
            e.limit(UNIT, 17);
        });
        // Test for an empty box (first beyond last); magnitudes of facing and area; each scale
        // to either side.
        let steps = if m.aspect.is_some() { 2 } else { 1 };
        e.adders(UNIT, 2, 17);
        for (word, copies) in [(m.facing, 1), (m.area, 1), (m.depth_step, steps)] {
            e.copies(copies, |e| e.limit(UNIT, word.format.width()));
        }

        e.normaliser(UNIT, m.facing.format.width());
        let slope_reciprocal = Reciprocal::new(
            e,
            UNIT,
            "slope_reciprocal",
            m.slope_reciprocal,
            m.facing.format.frac_bits,
        );
        e.copies(steps, |e| {
            let step = e.times(UNIT, p.camera, m.inverse_focal);
            e.fit(UNIT, "depth_step", m.depth_step, step)
        });
        e.copies(steps, |e| {
            let steep = e.times(UNIT, m.depth_step, m.slope_reciprocal.format());
            e.fit(UNIT, "depth_step", m.depth_step, steep)
        });
        e.copies(2, |e| {
            let leaning = e.times(UNIT, m.depth_step, m.normal);
            e.fit_shifted(UNIT, "depth_slope", m.depth_slope, leaning)
        });
        let deep = e.times(UNIT, machine.splat.radius, m.root_cutoff);
        e.fit(UNIT, "depth_range", m.depth_range, deep);
        let turns_normals = machine.fragment.turn_normals;
        let mut seen_normal = Exact::from(m.normal);
        if turns_normals {
            // The most negative word has no negation in its format.
            seen_normal.int_bits += 1;
            e.copies(3, |e| e.limit(UNIT, m.normal.format.width() + 1));
        }
        e.copies(3, |e| {
            e.fit(
                unit::FRAGMENT,
                "normal",
                machine.fragment.normal,
                seen_normal,
            )
        });

        let ellipsoids = Ellipsoids::new(e, machine);
        Ellipse {
            machine: machine.clone(),
            signals: e.signals.clone(),
            datapaths: [const { OnceLock::new() }; VARIANTS],
            inverse_two_pi: Fit::new(
                0,
                m.inverse_two_pi,
                Exact {
                    int_bits: 0,
                    frac_bits: 62,
                },
            )
            .one(INVERSE_TWO_PI_Q62),
            normal,
            root,
            extent_root,
            slope_reciprocal,
            ellipsoids,
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
        self.ellipsoids
            .as_ref()
            .and_then(Ellipsoids::compensation_root)
    }

    /// 1/c_n.
    pub fn slope_reciprocal(&self) -> &Reciprocal {
        &self.slope_reciprocal
    }

    /// Whether a splat's normal is negated before it reaches the fragments.
    pub fn turns(&self, view: &View, normal: [i32; 3]) -> bool {
        let z: i64 = view.rotation[2]
            .iter()
            .zip(normal)
            .map(|(row, part)| row * i64::from(part))
            .sum();
        self.machine.fragment.turn_normals && self.normal.one(z) > 0
    }

    /// The variant for a frame. Discs on a machine that lacks the words for its ellipsoids.
    pub fn variant(&self, has_aspect: bool, ellipsoids: Option<ellipsoid::Variant>) -> Variant {
        let has_aspect = has_aspect && self.machine.ellipse.aspect.is_some();
        Variant {
            has_aspect,
            ellipsoid: ellipsoids.filter(|_| self.ellipsoids.is_some()),
        }
    }

    /// The variant for a frame.
    pub fn variant_of(&self, frame: &Frame) -> Variant {
        let of_ellipsoids = |of: &frame::Ellipsoids| ellipsoid::Variant {
            own: !of.own.is_empty(),
            amplitude: of.kernel.amplitude,
        };
        self.variant(
            frame.view.aspect.is_some(),
            frame.ellipsoids.as_ref().map(of_ellipsoids),
        )
    }

    /// A variant's arithmetic.
    pub fn datapath(&self, variant: Variant) -> &Datapath {
        let number = 2 * variant
            .ellipsoid
            .map_or(0, |ellipsoid| 1 + ellipsoid.number())
            + usize::from(variant.has_aspect);
        self.datapaths[number].get_or_init(|| {
            // Its parts are already declared.
            let e = &mut Elaboration::new(self.machine.operators);
            e.signals.clone_from(&self.signals);
            let g = &mut Builder::new(e, UNIT);
            let (results, bounded) = set_up(g, &self.machine, variant);
            let graph = g.build(results);
            debug_assert_eq!(
                e.signals.len(),
                self.signals.len(),
                "every signal is declared"
            );
            Datapath {
                program: graph.program(),
                bounds: graph.asked(bounded),
                graph,
            }
        })
    }

    /// The kind of splat that takes longest.
    pub fn slowest(&self) -> Variant {
        let slowest = self.machine.ellipse.ellipsoid.map(|words| {
            let amplitude = if words.compensation_root.is_some() {
                frame::Amplitude::Compensated
            } else {
                frame::Amplitude::LineIntegral
            };
            ellipsoid::Variant {
                own: true,
                amplitude,
            }
        });
        self.variant(true, slowest)
    }

    /// Its critical path, which is at least that of discs.
    pub fn path(&self) -> Path {
        let [discs, slowest] = [self.variant(true, None), self.slowest()]
            .map(|variant| self.datapath(variant).graph.path());
        discs.parallel(slowest)
    }

    /// Registers of a view and a picture, in the input order of a variant's graph.
    pub fn registers(
        &self,
        variant: Variant,
        view: &View,
        size_px: [u32; 2],
        kernel: &Kernel,
    ) -> Vec<i64> {
        let mut registers = view.rotation.as_flattened().to_vec();
        registers.extend([
            -i64::from(view.cull_backfaces),
            view.focal,
            view.low_pass,
            view.root_cutoff,
            self.inverse_two_pi,
        ]);
        if variant.ellipsoid.is_none() {
            registers.push(view.cutoff);
        }
        let steps = if variant.has_aspect { 2 } else { 1 };
        registers.extend(
            view.inverse_focals()[..steps]
                .iter()
                .flat_map(|Scaled { mantissa, places }| [-places, *mantissa]),
        );
        if let (true, Some(aspect)) = (variant.has_aspect, view.aspect) {
            registers.extend(aspect.squares);
        }
        for pixels in size_px {
            // From the centre of pixel 0 to the picture's middle: (pixels − 1)/2.
            let last_px = i64::from(pixels) - 1;
            registers.extend([last_px, last_px]);
        }
        if let Some(ellipsoid) = variant.ellipsoid {
            registers.extend(kernel.jacobian);
            if !ellipsoid.own {
                registers.extend(kernel.axes.as_flattened());
                registers.extend(kernel.scales);
            }
            if ellipsoid.depth_weight(&self.machine).is_some() {
                let Scaled { mantissa, places } = kernel.inverse_distance;
                registers.extend([-places, mantissa]);
            }
        }
        registers
    }
}

/// First and last columns and rows, before they are clipped to the picture.
const EDGE: Word = Word::new(Format::signed(17, 0)).rounded(Rounding::Truncate);

/// Wires that the parts of the unit share.
struct Wires {
    radius: Wire,
    forward: Wire,
    inverse_depth: Wire,
    slope: [Wire; 2],
    pixel: [Wire; 2],
    rotation: [[Wire; 3]; 3],
    cull: Wire,
    focal: Wire,
    low_pass: Wire,
    cutoff: Wire,
    root_cutoff: Wire,
    inverse_two_pi: Wire,
    inverse_focals: Vec<Wire>,
    aspect: Option<[Wire; 3]>,
    /// (pixels − 1)/2, and pixels − 1.
    size: [[Wire; 2]; 2],
}

/// A disc or an ellipsoid, from its record to its conic and box; then the wires that have bounds.
fn set_up(
    g: &mut Builder,
    machine: &Machine,
    variant: Variant,
) -> ([Wire; OUTPUTS], [Wire; BOUNDS]) {
    let (m, p) = (&machine.ellipse, &machine.project);
    let normal = three!(_i => g.input(machine.splat.normal));
    let radius = g.input(machine.splat.radius);
    let exponent = g.power_input(Power::ONE);
    let forward = g.input_under(p.camera, exponent);
    let reciprocal = Word::new(p.reciprocal.format());
    let inverse_depth = g.input(reciprocal);
    let inverse_power = g.power_input(exponent.inverse());
    g.relate(inverse_depth, inverse_power);
    let slope = two!(_i => g.input(p.slope));
    let pixel = two!(_i => g.input(p.pixel));
    let of_ellipsoid = variant
        .ellipsoid
        .zip(m.ellipsoid.as_ref())
        .map(|(ellipsoid, words)| {
            let opacity = g.input(machine.splat.opacity);
            let cutoff = g.input(machine.raster.cutoff);
            let own = ellipsoid.own.then(|| {
                (
                    [(); 4].map(|()| g.input(words.quaternion)),
                    three!(_i => g.input(words.scale)),
                )
            });
            (ellipsoid, words, opacity, cutoff, own)
        });
    let rotation = three!(_row => three!(_i => g.input(p.rotation)));
    let cull = g.condition_input();
    let [focal, low_pass, root_cutoff, inverse_two_pi] =
        [p.focal, m.low_pass, m.root_cutoff, m.inverse_two_pi].map(|word| g.input(word));
    let cutoff = of_ellipsoid
        .as_ref()
        .map(|of| of.3)
        .unwrap_or_else(|| g.input(machine.raster.cutoff));
    let steps = if variant.has_aspect { 2 } else { 1 };
    let inverse_focals = (0..steps).map(|_| {
        let power = g.power_input(Power::ONE);
        g.input_under(m.inverse_focal, power)
    });
    let inverse_focals: Vec<Wire> = inverse_focals.collect();
    let aspect = m
        .aspect
        .filter(|_| variant.has_aspect)
        .map(|word| three!(_i => g.input(word)));
    let size = two!(_axis => {
        let first_centre = g.state(MIDDLE, false);
        [first_centre, g.state(PLACE, false)]
    });
    let w = Wires {
        radius,
        forward,
        inverse_depth,
        slope,
        pixel,
        rotation,
        cull,
        focal,
        low_pass,
        cutoff,
        root_cutoff,
        inverse_two_pi,
        inverse_focals,
        aspect,
        size,
    };
    match of_ellipsoid {
        None => disc(g, machine, &w, normal),
        Some((variant, words, opacity, _, own)) => {
            ellipsoid::set_up(g, machine, &w, normal, (variant, words, opacity, own))
        }
    }
}

/// A disc.
fn disc(
    g: &mut Builder,
    machine: &Machine,
    w: &Wires,
    normal: [Wire; 3],
) -> ([Wire; OUTPUTS], [Wire; BOUNDS]) {
    let m = &machine.ellipse;
    let normal = camera_normal(g, machine, w, normal);
    let (tilt, facing) = turn(g, machine, w.slope, normal);
    let across = g.magnitude(facing);
    let edge_on = g.is_none(across);
    let (away, blind) = culled(g, w, facing, edge_on);
    let (squares, exponent) = sized(g, machine, w);
    let shape = {
        let ([a, b], [g_x, g_y]) = (w.slope, tilt);
        let mut part = |slopes: [Wire; 2], tilts: [Wire; 2], is_diagonal: bool| {
            let (slopes, tilts) = (g.times(slopes[0], slopes[1]), g.times(tilts[0], tilts[1]));
            let mut sum = g.minus(slopes, tilts);
            if is_diagonal {
                let one = g.one(g.shape(sum));
                sum = g.plus(sum, one);
            }
            g.fit("shape", m.shape, sum)
        };
        [
            part([a, a], [g_x, g_x], true),
            part([a, b], [g_x, g_y], false),
            part([b, b], [g_y, g_y], true),
        ]
    };
    let footprint = footprint(
        g,
        machine,
        w,
        (squares, exponent),
        (shape, vec![facing]),
        |g, areas, root| {
            let visibility = visibility(g, machine, areas[0], root);
            let shown = g.times(visibility, w.inverse_two_pi);
            g.fit("amplitude", m.amplitude, shown)
        },
    );
    let seen = seen_normal(g, machine, normal);
    let depth_slope = depth_slope(g, machine, w, normal, (facing, across));
    let deep = g.times(w.radius, w.root_cutoff);
    let depth_range = g.fit("depth_range", m.depth_range, deep);
    done(
        g,
        &footprint,
        (seen, normal[2], facing),
        (depth_slope, depth_range),
        [away, blind],
    )
}

/// Results in output order.
fn done(
    g: &mut Builder,
    footprint: &Footprint,
    ([n, m, o], towards_viewer, facing): ([Wire; 3], Wire, Wire),
    ([slope_x, slope_y], depth_range): ([Wire; 2], Wire),
    [away, blind]: [Wire; 2],
) -> ([Wire; OUTPUTS], [Wire; BOUNDS]) {
    let Footprint {
        determinant,
        conic: [xx, xy, yy],
        amplitude,
        extent: [width, height],
        sides,
        faint,
        outside,
    } = *footprint;
    let faint = g.either(blind, faint);
    let [[first_column, last_column], [first_row, last_row]] = sides;
    (
        [
            n,
            m,
            o,
            xx,
            xy,
            yy,
            amplitude,
            first_column,
            last_column,
            first_row,
            last_row,
            slope_x,
            slope_y,
            depth_range,
            away,
            faint,
            outside,
        ],
        [
            n,
            m,
            o,
            towards_viewer,
            facing,
            determinant,
            xx,
            xy,
            yy,
            amplitude,
            width,
            height,
            slope_x,
            slope_y,
            depth_range,
        ],
    )
}

/// Cull flags: backface, where that is culled; faint, where the splat has no size or `nothing`
/// holds.
fn culled(g: &mut Builder, w: &Wires, facing: Wire, nothing: Wire) -> (Wire, Wire) {
    let zero = g.constant(0, g.shape(facing));
    let turned_away = g.above(facing, zero);
    let away = g.both(turned_away, w.cull);
    let empty = g.is_none(w.radius);
    let blind = g.either(nothing, empty);
    let dropped = g.either(away, blind);
    g.drop_where(dropped);
    (away, blind)
}

/// A direction in camera space.
fn camera_normal(g: &mut Builder, machine: &Machine, w: &Wires, direction: [Wire; 3]) -> [Wire; 3] {
    three!(row => {
        let turned = g.dot(w.rotation[row], direction);
        g.fit("normal", machine.ellipse.normal, turned)
    })
}

/// The normal that fragments sum. It is turned towards the viewer where the machine does that, so
/// that the two sides of a sheet do not cancel.
fn seen_normal(g: &mut Builder, machine: &Machine, normal: [Wire; 3]) -> [Wire; 3] {
    three!(axis => {
        let seen = if machine.fragment.turn_normals { g.turned(normal[axis], normal[2]) } else { normal[axis] };
        g.fit_of(unit::FRAGMENT, "normal", machine.fragment.normal, seen)
    })
}

/// g and c_n.
fn turn(g: &mut Builder, machine: &Machine, [a, b]: [Wire; 2], n: [Wire; 3]) -> ([Wire; 2], Wire) {
    let m = &machine.ellipse;
    let tilt = [(a, n[0]), (b, n[1])].map(|(slope, part)| {
        let leaned = g.times(slope, n[2]);
        let tilt = g.minus(part, leaned);
        g.fit("tilt", m.tilt, tilt)
    });
    let [x, y] = [(a, n[0]), (b, n[1])].map(|(slope, part)| g.times(slope, part));
    let across = g.plus(x, y);
    let facing = g.plus(across, n[2]);
    (tilt, g.fit("facing", m.facing, facing))
}

/// k'_x², k'_x·k'_y, k'_y², and 2^e.
fn sized(g: &mut Builder, machine: &Machine, w: &Wires) -> ([Wire; 3], Power) {
    let m = &machine.ellipse;
    let scaled = g.times(w.focal, w.radius);
    let scaled = g.at_least_an_ulp(scaled);
    let [normalised] = g.normalised(scaled, [scaled], 1);
    let mantissa = g.fit("scaled_radius", m.scaled_radius, normalised);
    // k = mantissa · inverse_depth, where the product is in [½, 2] times their power.
    let product = g.times(mantissa, w.inverse_depth);
    let exponent = g.at_least_one(g.power(product).shifted(1));
    let size = g.fit_to("size", m.size, product, exponent);
    let squared = g.times(size, size);
    let squared = g.fit("size_squared", m.size_squared, squared);
    let squares = match w.aspect {
        None => [squared; 3],
        Some(aspect) => three!(i => {
            let stretched = g.times(squared, aspect[i]);
            g.fit("size_squared", m.size_squared, stretched)
        }),
    };
    (squares, exponent)
}

/// Screen footprint, common to discs and ellipsoids.
struct Footprint {
    determinant: Wire,
    conic: [Wire; 3],
    amplitude: Wire,
    /// Half-extents of the box.
    extent: [Wire; 2],
    /// First and last column and row.
    sides: [[Wire; 2]; 2],
    faint: Wire,
    outside: Wire,
}

/// Computes a conic and a box from a shape's variance without size, and its faces.
fn footprint(
    g: &mut Builder,
    machine: &Machine,
    w: &Wires,
    (squares, exponent): ([Wire; 3], Power),
    (shape, faces): ([Wire; 3], Vec<Wire>),
    amplitude: impl FnOnce(&mut Builder, &[Wire], Wire) -> Wire,
) -> Footprint {
    let m = &machine.ellipse;
    let squared = exponent.power(2);
    let low_pass = g.fit_to("low_pass", m.low_pass, w.low_pass, squared);
    let [spread_x, spread_xy, spread_y] = three!(i => g.times(squares[i], shape[i]));
    let filtered = g.plus(spread_x, low_pass);
    let xx = g.fit("variance", m.variance, filtered);
    let xy = g.fit("variance_cross", m.variance_cross, spread_xy);
    let filtered = g.plus(spread_y, low_pass);
    let yy = g.fit("variance", m.variance, filtered);
    let areas: Vec<Wire> = faces
        .into_iter()
        .map(|face| {
            let turned = g.times(squares[1], face);
            g.fit("area", m.area, turned)
        })
        .collect();
    // Area² + v'·tr V' − v'².
    let covered = squared_sum(g, &areas);
    let trace = g.plus(xx, yy);
    let spread = g.times(low_pass, trace);
    let sum = g.plus(covered, spread);
    let twice = g.times(low_pass, low_pass);
    let exact = g.minus(sum, twice);
    let determinant = g.fit("determinant", m.determinant, exact);
    let flat = g.is_none(determinant);
    g.drop_where(flat);

    let positive = g.at_least_an_ulp(determinant);
    let root = g.inverse_root("root", m.root, positive);
    let inverse = g.times(root, root);
    let inverse = g.fit("inverse", m.inverse, inverse);
    let [inverted_y, inverted_xy, inverted_x] =
        [yy, xy, xx].map(|variance| g.times(variance, inverse));
    let conic_xx = g.fit_to("conic", m.conic, inverted_y, Power::ONE);
    let cross = g.negated(inverted_xy);
    let conic_xy = g.fit_to("conic_cross", m.conic_cross, cross, Power::ONE);
    let conic_yy = g.fit_to("conic", m.conic, inverted_x, Power::ONE);
    let amplitude = amplitude(g, &areas, root);
    let dark = g.is_none(amplitude);

    let across = [xx, yy];
    let extent = |g: &mut Builder, axis: usize| {
        let reach = g.times(w.cutoff, across[axis]);
        let reach = g.at_least_an_ulp(reach);
        let root = g.root("extent_root", m.extent_root, reach);
        let extent = g.fit_to("extent", m.extent, root, Power::ONE);
        g.an_ulp_more(extent)
    };
    let width = extent(g, 0);
    let columns = side(g, w, 0, width);
    let height = extent(g, 1);
    let rows = side(g, w, 1, height);
    let [misses_x, misses_y] = [columns, rows].map(|[first, last]| g.above(first, last));
    let outside = g.either(misses_x, misses_y);
    let dropped = g.either(dark, outside);
    g.drop_where(dropped);
    Footprint {
        determinant,
        conic: [conic_xx, conic_xy, conic_yy],
        amplitude,
        extent: [width, height],
        sides: [columns, rows],
        faint: g.either(flat, dark),
        outside,
    }
}

/// Σ area², of at least one.
fn squared_sum(g: &mut Builder, areas: &[Wire]) -> Wire {
    let mut sum = g.times(areas[0], areas[0]);
    for area in &areas[1..] {
        let square = g.times(*area, *area);
        sum = g.plus(sum, square);
    }
    sum
}

/// Visible part of an area: area times 1/√det V.
fn visibility(g: &mut Builder, machine: &Machine, area: Wire, root: Wire) -> Wire {
    let area = g.magnitude(area);
    let seen = g.times(area, root);
    g.fit_to("visibility", machine.ellipse.visibility, seen, Power::ONE)
}

/// First and last column, or row, clipped to the picture. The first is beyond the last where the
/// splat is outside.
fn side(g: &mut Builder, w: &Wires, axis: usize, extent: Wire) -> [Wire; 2] {
    let [first_centre, last_px] = w.size[axis];
    let centre = g.plus(w.pixel[axis], first_centre);
    let from = g.minus(centre, extent);
    let shape = g.shape(from);
    let up = g.constant(
        (1 << shape.frac_bits.clamp(0, 62)) - 1,
        Exact {
            int_bits: 0,
            ..shape
        },
    );
    let from = g.plus(from, up);
    let first = g.fit("edge", EDGE, from);
    let to = g.plus(centre, extent);
    let last = g.fit("edge", EDGE, to);
    [g.not_below_0(first), g.lesser(last, last_px)]
}

/// z_x, z_y.
fn depth_slope(
    g: &mut Builder,
    machine: &Machine,
    w: &Wires,
    n: [Wire; 3],
    (facing, across): (Wire, Wire),
) -> [Wire; 2] {
    let m = &machine.ellipse;
    let across = g.at_least_an_ulp(across);
    let inverse = g.reciprocal("slope_reciprocal", m.slope_reciprocal, across);
    let scales = w.inverse_focals.iter().map(|inverse_focal| {
        let step = g.times(w.forward, *inverse_focal);
        let step = g.fit("depth_step", m.depth_step, step);
        let steep = g.times(step, inverse);
        let steep = g.fit("depth_step", m.depth_step, steep);
        g.opposed(steep, facing)
    });
    let scales: Vec<Wire> = scales.collect();
    // Square pixels have the same step on both axes.
    let scales = [scales[0], *scales.last().unwrap_or(&scales[0])];
    two!(axis => {
        let leaning = g.times(scales[axis], n[axis]);
        g.fit_to("depth_slope", m.depth_slope, leaning, Power::ONE)
    })
}

pub mod ellipsoid;
pub mod real;

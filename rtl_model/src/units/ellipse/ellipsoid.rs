//! Ellipsoids: turns three principal axes into a conic, an amplitude and a box (EWA §6.2,
//! docs/book/algorithm-resolve.md §9).
//!
//! ```text
//! quaternion ─►[ R ]─► rᵢ ─►[ W·r ]─┬─► tilt gᵢ ─►(× sᵢ)─► stretch ─►[ Σ sᵢ²gᵢgᵢᵀ ]─► shape ┐
//!                                   └─► facing cᵢ ─►(× sⱼsₖ)─► face ─► area k'²·sⱼsₖcᵢ ─────┴─► as for a disc
//! ```
//! The variance V = J W V Wᵀ Jᵀ of the local affine approximation (EWA (31), third row and column
//! dropped) is the sum of each axis's contribution on the screen, V_r = k² Σ sᵢ² gᵢgᵢᵀ with
//! gᵢ = (r_x − a·r_z, r_y − b·r_z). Its determinant is the sum over pairs of axes of the area that
//! they span there, det V_r = k⁴ Σ (sⱼsₖcᵢ)² with cᵢ = rᵢ·(a, b, 1). No term is negative, so
//! nothing cancels. A disc is the ellipsoid with s = (1, 1, 0): one face, seen under c₃ = c_n. All
//! later steps are those of a disc.
//!
//! a and b are clamped in the Jacobian only (`jacobian`): far off the axis the approximation has
//! no meaning.
//!
//! The frame selects the meaning of the amplitude ([`Amplitude`]): a disc's, the integral along
//! the ray, the peak itself, or the peak times √(det V_r/det V). The root of det V_r is taken of
//! the sum of the squared faces, and then replaces the one face of a disc.
//!
//! Where the amplitude is the peak itself and weights below a least weight do not count, no weight
//! counts beyond r = 2·ln(α/least). The box then uses that cutoff where it is less than the
//! frame's. It comes from a table addressed by the leading bits of the opacity.
//!
//! Where Gaussians are summed with weights that fall with depth, the opacity is multiplied by such a
//! weight before anything else (LC-WSR of arXiv 2410.18931):
//!
//! ```text
//! t_z ─►(× 1/σ)─► share ─►[ max(0, 1 − ·) ]─► weight ─►(× opacity)─► weighted opacity
//! ```
//! Each of the three words is rounded. A weighted opacity of 0 culls as *faint*. The table of cutoffs
//! is addressed by the opacity of the record, which is not less: a box is at most too large.

use super::{
    BOUNDS, Ellipse, OUTPUTS, UNIT, Wires, camera_normal, culled, depth_slope, done, footprint,
    seen_normal, sized, squared_sum, turn, visibility,
};
use crate::elaboration::{Elaboration, Operator};
use crate::frame::{Amplitude, Kernel, View};
use crate::functions::{ReciprocalRoot, table};
use crate::graph::{Builder, Power, Wire};
use crate::machine::{self, DepthWeight, Machine};
use crate::num::{Exact, Word, three, two};

/// Parts of the unit that only ellipsoids use.
#[derive(Clone, Debug)]
pub(super) struct Ellipsoids {
    ray_root: ReciprocalRoot,
    compensation_root: Option<ReciprocalRoot>,
    /// Bits of opacity below the address of the cutoff table, and the table's last address.
    reach: [u32; 2],
}

/// Options of a frame that change the graph of its ellipsoids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    /// Each splat has its own axes: a unit quaternion (w, x, y, z) and standard deviations, relative
    /// to σ. Otherwise the frame's axes are used.
    pub own: bool,
    /// Meaning of the amplitude.
    pub amplitude: Amplitude,
}

/// Number of variants.
pub(super) const VARIANTS: usize = 8;

impl Variant {
    /// Words of weights that fall with depth, on a machine that sums such Gaussians.
    pub fn depth_weight(self, machine: &Machine) -> Option<DepthWeight> {
        let is_peak = matches!(self.amplitude, Amplitude::Peak | Amplitude::Compensated);
        machine.depth_weight().filter(|_| is_peak)
    }

    pub(super) fn number(self) -> usize {
        let amplitude = match self.amplitude {
            Amplitude::Disc => 0,
            Amplitude::LineIntegral => 1,
            Amplitude::Peak => 2,
            Amplitude::Compensated => 3,
        };
        2 * amplitude + usize::from(self.own)
    }
}

/// The two other axes.
const OTHERS: [[usize; 2]; 3] = [[1, 2], [2, 0], [0, 1]];

/// Shape of the cutoff table: bits of its address, and the other bits of an opacity below 1.
/// `None` where there is no table.
fn reach_shape(e: &mut Elaboration, machine: &Machine) -> Option<[u32; 2]> {
    let opacity = machine.splat.opacity.format.frac_bits.clamp(1, 31) as u32;
    let bits = e.within(
        UNIT,
        "ellipsoid.reach_bits",
        machine.ellipse.ellipsoid?.reach_bits?,
        1,
        opacity.min(12),
    );
    Some([bits, opacity - bits])
}

/// Parts and elaboration errors of weights that fall with depth.
fn declare_depth_weight(e: &mut Elaboration, machine: &Machine, words: &DepthWeight) {
    for (name, word) in [("share", words.share), ("weight", words.weight)] {
        e.number("sort.depth_weight", name, word, false);
        e.holds_one("sort.depth_weight", name, word);
    }
    let product = e.times(UNIT, machine.project.camera, words.share);
    e.fit_shifted(UNIT, "depth_share", words.share, product);
    let rest = unit_interval(words.share);
    e.adders(UNIT, 1, rest.plus(words.share).bits());
    e.choice(UNIT, 2, rest.bits());
    e.fit(UNIT, "depth_weight", words.weight, rest);
    let weighted = e.times(UNIT, machine.splat.opacity, words.weight);
    e.fit(UNIT, "weighted_opacity", machine.splat.opacity, weighted);
}

/// Numbers from 0 to 1 with the fraction bits of a word.
fn unit_interval(word: Word) -> Exact {
    Exact {
        int_bits: 1,
        frac_bits: word.format.frac_bits,
    }
}

/// The opacity times a weight that falls with depth: max(0, 1 − t_z/σ).
fn weighted_opacity(
    g: &mut Builder,
    machine: &Machine,
    words: &DepthWeight,
    (forward, opacity): (Wire, Wire),
) -> Wire {
    let power = g.power_input(Power::ONE);
    let inverse_distance = g.input_under(words.share, power);
    let product = g.times(forward, inverse_distance);
    let share = g.fit_to("depth_share", words.share, product, Power::ONE);
    let one = g.one(words.share);
    let rest = g.minus(one, share);
    let rest = g.natural(rest);
    let weight = g.fit("depth_weight", words.weight, rest);
    let weighted = g.times(opacity, weight);
    g.fit("weighted_opacity", machine.splat.opacity, weighted)
}

impl Ellipsoids {
    pub(super) fn new(e: &mut Elaboration, machine: &Machine) -> Option<Self> {
        let (m, p) = (&machine.ellipse, &machine.project);
        let words = m.ellipsoid.as_ref()?;
        for (name, word, signed) in [
            ("quaternion", words.quaternion, true),
            ("scale", words.scale, false),
            ("stretch", words.stretch, true),
            ("ray", words.ray, false),
        ] {
            e.number(UNIT, name, word, signed);
        }
        e.holds_one(UNIT, "quaternion", words.quaternion);
        e.holds_one(UNIT, "scale", words.scale);
        e.copies(9, |e| {
            let square = e.times(UNIT, words.quaternion, words.quaternion);
            let sum = e.sum(
                UNIT,
                [
                    Exact {
                        int_bits: 1,
                        frac_bits: 0,
                    },
                    square.doubled(),
                    square.doubled(),
                ],
            );
            e.fit(UNIT, "rotation", machine.splat.normal, sum)
        });
        // An ellipsoid turns two axes more than a disc.
        e.copies(6, |e| {
            let rotated = e.copies(3, |e| e.times(UNIT, p.rotation, machine.splat.normal));
            e.sum(UNIT, [rotated; 3]);
        });
        e.copies(6, |e| {
            let stretched = e.times(UNIT, words.scale, m.tilt);
            e.fit(UNIT, "stretch", words.stretch, stretched)
        });
        e.copies(3, |e| {
            let squares = e.copies(3, |e| e.times(UNIT, words.stretch, words.stretch));
            let sum = e.sum(UNIT, [squares; 3]);
            e.fit(UNIT, "shape", m.shape, sum)
        });
        e.copies(3, |e| {
            let product = e.times(UNIT, words.scale, words.scale);
            e.fit(UNIT, "scale", words.scale, product)
        });
        e.copies(3, |e| {
            let turned = e.times(UNIT, words.scale, m.facing);
            e.fit(UNIT, "face", m.facing, turned)
        });
        // An ellipsoid squares two faces more than a disc.
        let squared = e.copies(2, |e| e.times(UNIT, m.area, m.area));
        let slope_squared = e.copies(2, |e| e.times(UNIT, p.slope, p.slope));
        let length_squared = e.sum(
            UNIT,
            [
                Exact {
                    int_bits: 1,
                    frac_bits: 0,
                },
                slope_squared,
                slope_squared,
            ],
        );
        e.normaliser(UNIT, length_squared.bits());
        e.holds_exact(
            "the operand of ellipse.ray_root, 1 + a² + b², normalised,",
            length_squared.scaled(1).plus(length_squared),
        );
        let ray_root = ReciprocalRoot::new(
            e,
            UNIT,
            "ray_root",
            words.ray_root,
            length_squared.frac_bits,
        );
        let root_bits = words.ray_root.format();
        let root = e.times(UNIT, root_bits, root_bits).scaled(1);
        e.fit_shifted(UNIT, "ray", words.ray, root);
        let thick = e.times(UNIT, m.size_squared, words.ray);
        e.fit(UNIT, "area", m.area, thick);
        let compensation_root = words.compensation_root.map(|shape| {
            let squares = e.sum(UNIT, [squared; 3]);
            e.normaliser(UNIT, squares.bits());
            let normalised = squares.scaled(1).plus(squares);
            e.holds_exact(
                "the operand of ellipse.compensation_root, the sum of squared areas, normalised,",
                normalised,
            );
            let root = ReciprocalRoot::new(e, UNIT, "compensation_root", shape, squares.frac_bits);
            let bits = shape.format();
            let spanned = e.times(UNIT, bits, bits).scaled(1);
            e.fit_shifted(UNIT, "area", m.area, spanned);
            root
        });
        let shown = e.times(UNIT, m.visibility, machine.splat.opacity);
        let reach = reach_shape(e, machine).map_or([0; 2], |[bits, below]| {
            e.part(
                UNIT,
                Operator::Rom([1 << bits, machine.raster.cutoff.format.width()]),
            );
            // An opacity of at least 1 uses the last address.
            e.choice(UNIT, 2, bits as i32);
            [below, (1 << bits) - 1]
        });
        e.fit(UNIT, "amplitude", m.amplitude, shown);
        e.fit(UNIT, "amplitude", m.amplitude, machine.splat.opacity);
        if let Some(words) = machine.depth_weight() {
            declare_depth_weight(e, machine, &words);
        }
        Some(Ellipsoids {
            ray_root,
            compensation_root,
            reach,
        })
    }

    pub(super) fn ray_root(&self) -> &ReciprocalRoot {
        &self.ray_root
    }

    pub(super) fn compensation_root(&self) -> Option<&ReciprocalRoot> {
        self.compensation_root.as_ref()
    }

    /// Cutoff of a box.
    fn cutoff(&self, view: &View, kernel: &Kernel, opacity: i32) -> i64 {
        let [below, last] = self.reach;
        let address = table::address(opacity.max(0).into(), below).min(last as usize);
        kernel.reach.get(address).copied().unwrap_or(view.cutoff)
    }
}

impl Ellipse {
    /// Cutoff of an ellipsoid's box, from its opacity.
    pub fn box_cutoff(&self, view: &View, kernel: &Kernel, opacity: i32) -> i64 {
        self.ellipsoids
            .as_ref()
            .map_or(view.cutoff, |own| own.cutoff(view, kernel, opacity))
    }
}

/// Columns of the rotation that a quaternion represents.
fn directions(g: &mut Builder, machine: &Machine, [w, x, y, z]: [Wire; 4]) -> [[Wire; 3]; 3] {
    let mut pair = |a: [Wire; 2], b: [Wire; 2], is_sum: bool| {
        let (a, b) = (g.times(a[0], a[1]), g.times(b[0], b[1]));
        let pair = if is_sum { g.plus(a, b) } else { g.minus(a, b) };
        g.scaled(pair, 1)
    };
    let twice = [
        [
            pair([y, y], [z, z], true),
            pair([x, y], [w, z], true),
            pair([x, z], [w, y], false),
        ],
        [
            pair([x, y], [w, z], false),
            pair([x, x], [z, z], true),
            pair([y, z], [w, x], true),
        ],
        [
            pair([x, z], [w, y], true),
            pair([y, z], [w, x], false),
            pair([x, x], [y, y], true),
        ],
    ];
    three!(axis => three!(row => {
        let element = twice[axis][row];
        let element = if axis == row {
            let one = g.one(g.shape(element));
            g.minus(one, element)
        } else {
            element
        };
        g.fit("rotation", machine.splat.normal, element)
    }))
}

/// A quaternion, and standard deviations.
type Axes = ([Wire; 4], [Wire; 3]);

/// An ellipsoid, from its record to its conic and box; then the wires that have bounds.
pub(super) fn set_up(
    g: &mut Builder,
    machine: &Machine,
    w: &Wires,
    normal: [Wire; 3],
    (variant, words, opacity, own): (Variant, &machine::Ellipsoid, Wire, Option<Axes>),
) -> ([Wire; OUTPUTS], [Wire; BOUNDS]) {
    let m = &machine.ellipse;
    let limits = two!(_i => g.input(machine.project.slope));
    let (axes, scales) = match own {
        Some((quaternion, scales)) => {
            let directions = directions(g, machine, quaternion);
            (
                directions.map(|direction| camera_normal(g, machine, w, direction)),
                scales,
            )
        }
        None => (
            three!(_axis => three!(_i => g.input(m.normal))),
            three!(_i => g.input(words.scale)),
        ),
    };
    let opacity = variant.depth_weight(machine).map_or(opacity, |words| {
        weighted_opacity(g, machine, &words, (w.forward, opacity))
    });
    let slope = two!(axis => {
        let (limit, least) = (limits[axis], g.negated(limits[axis]));
        let slope = g.lesser(w.slope[axis], limit);
        g.greater(slope, least)
    });
    let turned = axes.map(|axis| turn(g, machine, slope, axis));
    let stretched = three!(axis => turned[axis].0.map(|tilt| {
        let stretched = g.times(scales[axis], tilt);
        g.fit("stretch", words.stretch, stretched)
    }));
    let mut sum =
        |i: usize, j: usize| g.dot(stretched.map(|axis| axis[i]), stretched.map(|axis| axis[j]));
    let shape = [sum(0, 0), sum(0, 1), sum(1, 1)].map(|sum| g.fit("shape", m.shape, sum));
    let pairs = OTHERS.map(|[j, k]| {
        let pair = g.times(scales[j], scales[k]);
        g.fit("scale", words.scale, pair)
    });
    let faces = three!(axis => {
        let face = g.times(pairs[axis], turned[axis].1);
        g.fit("face", m.facing, face)
    });

    let facing = turned[2].1;
    let across = g.magnitude(facing);
    let is_flat = variant.amplitude == Amplitude::Disc;
    let nothing = g.is_none(if is_flat { across } else { opacity });
    let (away, blind) = culled(g, w, facing, nothing);
    let (squares, exponent) = sized(g, machine, w);
    let ray = (variant.amplitude == Amplitude::LineIntegral).then(|| {
        let [a, b] = slope.map(|slope| g.times(slope, slope));
        let squares = g.plus(a, b);
        let one = g.one(g.shape(squares));
        let squares = g.plus(squares, one);
        let root = g.root("ray_root", words.ray_root, squares);
        g.fit_to("ray", words.ray, root, Power::ONE)
    });
    let footprint = footprint(
        g,
        machine,
        w,
        (squares, exponent),
        (shape, faces.to_vec()),
        |g, areas, root| {
            let weighed = |g: &mut Builder, area: Wire| {
                let shown = visibility(g, machine, area, root);
                let weighed = g.times(shown, opacity);
                g.fit("amplitude", m.amplitude, weighed)
            };
            match (variant.amplitude, ray, words.compensation_root) {
                (Amplitude::Disc, ..) => {
                    let shown = visibility(g, machine, areas[2], root);
                    let shown = g.times(shown, w.inverse_two_pi);
                    g.fit("amplitude", m.amplitude, shown)
                }
                (Amplitude::LineIntegral, Some(ray), _) => {
                    let thick = g.times(squares[1], ray);
                    let along = g.fit("area", m.area, thick);
                    weighed(g, along)
                }
                (Amplitude::Compensated, _, Some(config)) => {
                    let spanned = squared_sum(g, areas);
                    let spanned = g.at_least_an_ulp(spanned);
                    let root = g.root("compensation_root", config, spanned);
                    let spanned = g.fit_to("area", m.area, root, exponent.power(2));
                    weighed(g, spanned)
                }
                (Amplitude::Peak, ..) => g.fit("amplitude", m.amplitude, opacity),
                // A machine without the root refuses frames with compensation.
                _ => g.constant(0, m.amplitude.into()),
            }
        },
    );
    let normal = camera_normal(g, machine, w, normal);
    let (slope, range) = if is_flat {
        let deep = g.times(w.radius, w.root_cutoff);
        let range = g.fit("depth_range", m.depth_range, deep);
        (depth_slope(g, machine, w, axes[2], (facing, across)), range)
    } else {
        let [zero, none] = [m.depth_slope, m.depth_range].map(|word| g.constant(0, word.into()));
        ([zero; 2], none)
    };
    let seen = seen_normal(g, machine, normal);
    let facing = if is_flat { facing } else { g.one(m.facing) };
    done(
        g,
        &footprint,
        (seen, normal[2], facing),
        (slope, range),
        [away, blind],
    )
}

//! Ellipsoids: turns three principal axes into a conic, an amplitude and a box (EWA §6.2, docs/book/algorithm-resolve.md §9).
//!
//! ```text
//! quaternion ─►[ R ]─► rᵢ ─►[ W·r ]─┬─► tilt gᵢ ─►(× sᵢ)─► stretch ─►[ Σ sᵢ²gᵢgᵢᵀ ]─► shape ┐
//!                                   └─► facing cᵢ ─►(× sⱼsₖ)─► face ─► area k'²·sⱼsₖcᵢ ─────┴─► as for a disc
//! ```
//! The variance V = J W V Wᵀ Jᵀ of the local affine approximation (EWA (31), third row and column dropped) is the sum of what each axis
//! leaves on the screen, V_r = k² Σ sᵢ² gᵢgᵢᵀ with gᵢ = (r_x − a·r_z, r_y − b·r_z); and its determinant is the sum of what each pair of
//! axes spans there, det V_r = k⁴ Σ (sⱼsₖcᵢ)² with cᵢ = rᵢ·(a, b, 1): no term is ever negative, none cancels. A disc is the ellipsoid
//! with s = (1, 1, 0): one face, seen under c₃ = c_n. So all that follows is the disc's.
//!
//! In the Jacobian, and nowhere else, a and b are clamped (`jacobian`), for the approximation has no meaning far to the side.
//!
//! What the amplitude is follows from what is drawn ([`Amplitude`]): a disc's, the integral along the ray, the peak itself, or the peak times
//! √(det V_r/det V). That root is taken of the sum of the squared faces, and goes on as the one face of a disc does.
//!
//! Where it is the peak itself and lesser weights than some do not count, none counts beyond r = 2·ln(α/least): the box has that cutoff,
//! from a table by the first bits of the opacity, where it is less than the frame's.

use super::{Ellipse, Input, Output, UNIT};
use crate::elaboration::{Elaboration, Operator};
use crate::frame::{Amplitude, Kernel, View};
use crate::functions::reciprocal::Scientific;
use crate::functions::{ReciprocalRoot, table};
use crate::machine::Machine;
use crate::num::{Exact, Exacts, Fit, Words, three, two};
use crate::probe::{Probe, Tap};

/// Parts of the unit for ellipsoids alone.
#[derive(Clone, Debug)]
pub(super) struct Ellipsoids {
    rotation: Fit,
    stretch: Fit,
    shape: Fit,
    scales: Fit,
    face: Fit,
    ray_root: ReciprocalRoot,
    ray: Fit,
    along: Fit,
    compensation: Option<Compensation>,
    weighed: Fit,
    peak: Fit,
    /// Bits of opacity below the address of the table of cutoffs, and its last address.
    reach: [u32; 2],
    /// 1 as an element of the rotation, before it is fitted.
    one: i64,
    /// 1 as a squared slope.
    ray_one: i64,
}

/// √(det V_r) and the word that takes it.
#[derive(Clone, Debug)]
struct Compensation {
    root: ReciprocalRoot,
    spanned: Fit,
}

/// Input port, eight splats: orientation and standard deviations.
#[derive(Clone, Copy, Debug)]
pub enum Axes<W> {
    /// The splat's own: a unit quaternion (w, x, y, z) and its standard deviations, relative to σ.
    Own([W; 4], [W; 3]),
    /// The frame's.
    Frame,
}

/// The two other axes.
const OTHERS: [[usize; 2]; 3] = [[1, 2], [2, 0], [0, 1]];

/// Shape of the table of cutoffs: bits of its address, and bits of an opacity below 1 that are not among them; none where there is no table.
fn reach_shape(e: &mut Elaboration, machine: &Machine) -> Option<[u32; 2]> {
    let opacity = machine.splat.opacity.format.frac_bits.clamp(1, 31) as u32;
    let bits = e.within(UNIT, "ellipsoid.reach_bits", machine.ellipse.ellipsoid?.reach_bits?, 1, opacity.min(12));
    Some([bits, opacity - bits])
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
            e.port(UNIT, name, word);
            e.signedness(UNIT, name, word, signed);
        }
        e.holds_one(UNIT, "quaternion", words.quaternion);
        e.holds_one(UNIT, "scale", words.scale);
        let rotation = e.copies(9, |e| {
            let square = e.times(UNIT, words.quaternion, words.quaternion);
            let sum = e.sum(UNIT, [Exact { int_bits: 1, frac_bits: 0 }, square.doubled(), square.doubled()]);
            e.fit(UNIT, "rotation", machine.splat.normal, sum)
        });
        // Two axes more than a disc has to turn.
        e.copies(6, |e| {
            let rotated = e.copies(3, |e| e.times(UNIT, p.rotation, machine.splat.normal));
            e.sum(UNIT, [rotated; 3]);
        });
        let stretch = e.copies(6, |e| {
            let stretched = e.times(UNIT, words.scale, m.tilt);
            e.fit(UNIT, "stretch", words.stretch, stretched)
        });
        let shape = e.copies(3, |e| {
            let squares = e.copies(3, |e| e.times(UNIT, words.stretch, words.stretch));
            let sum = e.sum(UNIT, [squares; 3]);
            e.fit(UNIT, "shape", m.shape, sum)
        });
        let scales = e.copies(3, |e| {
            let product = e.times(UNIT, words.scale, words.scale);
            e.fit(UNIT, "scale", words.scale, product)
        });
        let face = e.copies(3, |e| {
            let turned = e.times(UNIT, words.scale, m.facing);
            e.fit(UNIT, "face", m.facing, turned)
        });
        // Two faces more than a disc has to square.
        let squared = e.copies(2, |e| e.times(UNIT, m.area, m.area));
        let slope_squared = e.copies(2, |e| e.times(UNIT, p.slope, p.slope));
        let length_squared = e.sum(UNIT, [Exact { int_bits: 1, frac_bits: 0 }, slope_squared, slope_squared]);
        e.normaliser(UNIT, length_squared.bits());
        e.holds_exact("the operand of ellipse.ray_root, 1 + a² + b², normalised,", length_squared.scaled(1).plus(length_squared));
        let ray_root = ReciprocalRoot::new(e, UNIT, "ray_root", words.ray_root, length_squared.frac_bits);
        let root_bits = words.ray_root.format();
        let root = e.times(UNIT, root_bits, root_bits).scaled(1);
        let ray = e.fit_shifted(UNIT, "ray", words.ray, root);
        let thick = e.times(UNIT, m.size_squared, words.ray);
        let along = e.fit(UNIT, "area", m.area, thick);
        let compensation = words.compensation_root.map(|shape| {
            let squares = e.sum(UNIT, [squared; 3]);
            e.normaliser(UNIT, squares.bits());
            let normalised = squares.scaled(1).plus(squares);
            e.holds_exact("the operand of ellipse.compensation_root, the sum of squared areas, normalised,", normalised);
            let root = ReciprocalRoot::new(e, UNIT, "compensation_root", shape, squares.frac_bits);
            let bits = shape.format();
            let spanned = e.times(UNIT, bits, bits).scaled(1);
            Compensation { root, spanned: e.fit_shifted(UNIT, "area", m.area, spanned) }
        });
        let shown = e.times(UNIT, m.visibility, machine.splat.opacity);
        let reach = reach_shape(e, machine).map_or([0; 2], |[bits, below]| {
            e.part(UNIT, Operator::Rom([1 << bits, machine.raster.cutoff.format.width()]));
            // An opacity of 1 and above has the last address.
            e.choice(UNIT, 2, bits as i32);
            [below, (1 << bits) - 1]
        });
        Some(Ellipsoids {
            rotation,
            stretch,
            shape,
            scales,
            face,
            ray_root,
            ray,
            along,
            compensation,
            reach,
            weighed: e.fit(UNIT, "amplitude", m.amplitude, shown),
            peak: e.fit(UNIT, "amplitude", m.amplitude, machine.splat.opacity.into()),
            one: 1 << (2 * words.quaternion.format.frac_bits).clamp(0, 62),
            ray_one: 1 << (2 * p.slope.format.frac_bits).clamp(0, 62),
        })
    }

    pub(super) fn ray_root(&self) -> &ReciprocalRoot {
        &self.ray_root
    }

    pub(super) fn compensation_root(&self) -> Option<&ReciprocalRoot> {
        self.compensation.as_ref().map(|compensation| &compensation.root)
    }

    /// The cutoff of a box.
    fn cutoff(&self, view: &View, kernel: &Kernel, opacity: i32) -> i64 {
        let [below, last] = self.reach;
        let address = table::address(opacity.max(0).into(), below).min(last as usize);
        kernel.reach.get(address).copied().unwrap_or(view.cutoff)
    }

    /// |(a, b, 1)|.
    #[inline(always)]
    fn ray<W: Words, P: Probe>(&self, [a, b]: [W; 2], tap: &mut Tap<P>) -> W {
        let (root, power) = self.ray_root.root_lanes(a * a + b * b + W::Exact::splat(self.ray_one), tap);
        tap.fit_shifted(&self.ray, root, -power)
    }

    /// The columns of the rotation that a quaternion means.
    #[inline(always)]
    fn directions<W: Words, P: Probe>(&self, [w, x, y, z]: [W; 4], tap: &mut Tap<P>) -> [[W; 3]; 3] {
        let one = W::Exact::splat(self.one);
        let columns = [
            [one - (y * y + z * z).left(1), (x * y + w * z).left(1), (x * z - w * y).left(1)],
            [(x * y - w * z).left(1), one - (x * x + z * z).left(1), (y * z + w * x).left(1)],
            [(x * z + w * y).left(1), (y * z - w * x).left(1), one - (x * x + y * y).left(1)],
        ];
        three!(axis => three!(row => tap.fit_words(&self.rotation, columns[axis][row])))
    }
}

impl Ellipse {
    /// The cutoff of an ellipsoid's box, from its opacity.
    pub fn box_cutoff(&self, view: &View, kernel: &Kernel, opacity: i32) -> i64 {
        self.ellipsoids.as_ref().map_or(view.cutoff, |own| own.cutoff(view, kernel, opacity))
    }

    /// Sets eight ellipsoids up; on a machine that has none of what they need, nothing is drawn.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "the ports of the unit, one by one")]
    pub fn ellipsoids<W: Words, P: Probe>(
        &self,
        view: &View,
        kernel: &Kernel,
        size_px: [u32; 2],
        input: &Input<W>,
        axes: Axes<W>,
        opacity: W,
        tap: &mut Tap<P>,
    ) -> Option<Output<W>> {
        let own = self.ellipsoids.as_ref()?;
        let zero = W::splat(0);
        let (axes, scales) = match axes {
            Axes::Own(quaternion, scales) => {
                let directions = own.directions(quaternion, tap);
                (three!(axis => self.camera_normal(view, directions[axis], tap)), scales)
            }
            Axes::Frame => (kernel.axes.map(|axis| axis.map(W::splat)), kernel.scales.map(W::splat)),
        };
        let limit = kernel.jacobian.map(W::splat);
        let slope = two!(axis => input.slope[axis].min(limit[axis]).max(-limit[axis]));
        let turned = three!(axis => self.turn(slope, axes[axis], tap));
        let stretched = three!(axis => two!(side => tap.fit_words(&own.stretch, scales[axis] * turned[axis].0[side])));
        let sum = |i: usize, j: usize| {
            let [x, y, z] = three!(axis => stretched[axis][i] * stretched[axis][j]);
            x + y + z
        };
        let shape = [sum(0, 0), sum(0, 1), sum(1, 1)];
        let shape = three!(i => tap.fit_words(&own.shape, shape[i]));
        let pairs = three!(axis => tap.fit_words(&own.scales, scales[OTHERS[axis][0]] * scales[OTHERS[axis][1]]));
        let faces = three!(axis => tap.fit_words(&own.face, pairs[axis] * turned[axis].1));

        let facing = turned[2].1;
        let flattened = kernel.amplitude == Amplitude::Disc;
        let blind = input.radius.is_none() | if flattened { facing.is_zero() } else { opacity.is_none() };
        let away = if view.cull_backfaces { facing.above(zero) } else { zero };
        tap.drop_where(away | blind);
        let radius = input.radius.max(W::splat(1));
        let sized = self.size(view, radius, input, tap);
        let ray = if kernel.amplitude == Amplitude::LineIntegral { own.ray(slope, tap) } else { zero };
        let amplitude = |areas: [W; 3], inverse_root: &Scientific<W>, tap: &mut Tap<P>| {
            let shown =
                |area: W, tap: &mut Tap<P>| tap.fit_shifted(&self.visibility, area.abs() * inverse_root.mantissa, -inverse_root.exponent);
            match kernel.amplitude {
                Amplitude::Disc => {
                    let visibility = shown(areas[2], tap);
                    tap.fit_words(&self.amplitude, visibility * W::splat(self.inverse_two_pi))
                }
                Amplitude::LineIntegral => {
                    let along = tap.fit_words(&own.along, sized.0[1] * ray);
                    let visibility = shown(along, tap);
                    tap.fit_words(&own.weighed, visibility * opacity)
                }
                Amplitude::Peak => tap.fit_words(&own.peak, opacity.exact()),
                Amplitude::Compensated => match &own.compensation {
                    Some(compensation) => {
                        let [x, y, z] = three!(axis => areas[axis] * areas[axis]);
                        let squares = (x + y + z).max(W::Exact::splat(1));
                        let (root, power) = compensation.root.root_lanes(squares, tap);
                        let visibility = shown(tap.fit_shifted(&compensation.spanned, root, -power), tap);
                        tap.fit_words(&own.weighed, visibility * opacity)
                    }
                    // No frame asks this of a machine without.
                    None => zero,
                },
            }
        };
        let cutoff = if kernel.reach.is_empty() {
            W::splat(view.cutoff)
        } else {
            W::from_array(opacity.to_array().map(|opacity| own.cutoff(view, kernel, opacity) as i32))
        };
        let footprint = self.footprint(cutoff, view, size_px, input.pixel, sized, (shape, faces), amplitude, tap);
        let normal = self.camera_normal(view, input.normal, tap);
        let (depth_slope, depth_range) = if flattened {
            let facing = W::splat(1).where_else(facing.is_zero(), facing);
            let range = tap.fit_words(&self.depth_range, radius * W::splat(view.root_cutoff));
            (self.depth_slope(view, input, axes[2], facing, tap), range)
        } else {
            ([zero; 2], zero)
        };
        Some(Output {
            normal: self.seen_normal(normal, tap),
            conic: footprint.conic,
            amplitude: footprint.amplitude,
            columns: footprint.columns,
            rows: footprint.rows,
            depth_slope,
            depth_range,
            backface: away,
            faint: blind | footprint.faint,
            outside: footprint.outside,
        })
    }
}

pub mod real;

//! Project: takes a splat's centre to camera space and to the screen (Surface Splatting §3, first half of "setup").
//!
//! ```text
//! position ─►(− eye)─►[ << ]─► relative ─►[ W· ]─► camera t ─┬─►[ 1/t_z ]─► inverse_depth ─┐
//!                       └─► exponent ──────────────┐         ├────────────────────────────(×)─► slope (a, b) ─►(× s)─►(+ centre)─► pixel
//!                                                  └────────►[ >> ]─► depth t_z
//! ```
//! Each splat picks a power of two near its own distance from the eye, and t is relative to it: the quotients a and b do not
//! see it, and splats at a hundredth and at a hundred units keep the same relative precision in the same words.
//!
//! Losses: `relative` is cut by its normaliser; `camera`, `depth`, `slope` and `pixel` are rounded to nearest, for a picture is
//! a mean of many splats' errors and a cut would move it; the reciprocal's inner words are its own affair.
//!
//! Culls: *near* where t_z ≤ near; *outside* where |a| or |b| exceeds the guard band, tested as |t_x| > guard·t_z, exactly
//! and before the division, so that no quotient ever saturates; *transparent* where an ellipsoid's opacity is below the least whose
//! weights count at all.
//!
//! Law: `a_projected_point_is_within_its_last_places`.

use crate::elaboration::Elaboration;
use crate::elaboration::latency::Path;
use crate::frame::{Kernel, View};
use crate::functions::reciprocal::Scientific;
use crate::functions::{Reciprocal, reciprocal};
use crate::machine::Machine;
use crate::num::{Exact, Exacts, Fit, Word, Words, align, three, two};
use crate::probe::{Probe, Tap};
use crate::records::unit;

const UNIT: &str = unit::PROJECT;

/// Fraction bits of a difference shifted left until its largest part fills 62 bits.
const NORMALISED_FRAC_BITS: i32 = 62;

/// Longest way: difference, normalise, rotate, 1/t_z, quotient, pixel.
pub fn path(machine: &Machine) -> Path {
    let m = &machine.project;
    let bits = |word: Word| word.format.width();
    let difference = Exact::from(machine.splat.position).plus(m.eye).bits();
    let reciprocal = m.reciprocal.bits.min(64) as i32;
    Path::default()
        .sum(difference)
        // The largest of three magnitudes says how far all go.
        .limit(difference)
        .normalise(difference)
        .fit(bits(m.relative))
        .product(bits(m.rotation), bits(m.relative))
        .sum_of_three(bits(m.rotation) + bits(m.relative))
        .fit(bits(m.camera))
        .then(reciprocal::path(m.reciprocal, bits(m.camera)))
        .product(bits(m.camera), reciprocal)
        .shift(bits(m.slope))
        .fit(bits(m.slope))
        // The principal point is one more row of the product's tree.
        .product(bits(m.focal), bits(m.slope))
        .fit(bits(m.pixel))
}

/// The elaborated unit.
#[derive(Clone, Debug)]
pub struct Project {
    relative: Fit,
    camera: Fit,
    depth: Fit,
    slope: Fit,
    pixel: Fit,
    reciprocal: Reciprocal,
    /// Left shifts that align position and eye, and the fraction bits that both then have.
    align: [u32; 2],
    difference_frac_bits: i64,
    slope_frac_bits: u32,
    /// Left shifts that align s·a and the principal point.
    screen_align: [u32; 2],
}

/// Output port, eight splats.
#[derive(Clone, Copy, Debug)]
pub struct Projected<W> {
    /// t/2^exponent (`project.camera`).
    pub camera: [W; 3],
    /// The power of two that t is relative to.
    pub exponent: W,
    /// t_z (`project.depth`).
    pub depth: W,
    /// 2^exponent/t_z: mantissa (`project.reciprocal.result`) and power of two.
    pub inverse_depth: Scientific<W>,
    /// a, b (`project.slope`).
    pub slope: [W; 2],
    /// Position from the picture's middle (`project.pixel`).
    pub pixel: [W; 2],
    /// At or before the near plane.
    pub near: W,
    /// Outside the guard band.
    pub outside: W,
    /// Too little opacity.
    pub transparent: W,
}

impl Project {
    /// Elaborates the unit.
    pub fn new(e: &mut Elaboration, machine: &Machine) -> Self {
        let m = &machine.project;
        for (name, word, signed) in [
            ("eye", m.eye, true),
            ("relative", m.relative, true),
            ("rotation", m.rotation, true),
            ("camera", m.camera, true),
            ("depth", m.depth, false),
            ("slope", m.slope, true),
            ("focal", m.focal, false),
            ("pixel", m.pixel, true),
        ] {
            e.port(UNIT, name, word);
            e.signedness(UNIT, name, word, signed);
        }
        e.holds_one(UNIT, "rotation", m.rotation);
        e.require(m.pixel.format.frac_bits >= 1, || "project.pixel needs at least one fraction bit: pixel centres lie at halves".into());
        let difference = e.copies(3, |e| {
            let difference = e.sum(UNIT, [machine.splat.position.into(), m.eye.into()]);
            e.normaliser(UNIT, difference.bits());
            difference
        });
        // The largest of three magnitudes says how far all go.
        e.adders(UNIT, 3, difference.bits());
        e.holds_exact("the difference of splat.position and project.eye", difference);
        let [position, eye] = [machine.splat.position, m.eye].map(|word| word.format.frac_bits);
        let normalised = Exact { int_bits: 0, frac_bits: NORMALISED_FRAC_BITS };
        let relative = e.copies(3, |e| e.fit(UNIT, "relative", m.relative, normalised));
        let camera = e.copies(3, |e| {
            let rotated = e.copies(3, |e| e.times(UNIT, m.rotation, m.relative));
            let sum = e.sum(UNIT, [rotated; 3]);
            e.fit(UNIT, "camera", m.camera, sum)
        });
        let depth = e.fit_shifted(UNIT, "depth", m.depth, m.camera.into());
        // |t_x| is aligned with guard · t_z: a bit more than the product, for the least word's magnitude is one above the greatest.
        let beyond = e.copies(2, |e| {
            let limit = e.times(UNIT, m.camera, m.slope);
            let beyond = e.sum(UNIT, [limit, m.camera.into()]);
            e.adders(UNIT, 1, beyond.bits());
            beyond
        });
        e.limit(UNIT, m.camera.format.width());
        e.adders(UNIT, 1, m.depth.format.width());
        e.holds_exact("the comparison of project.camera with the guard band project.slope", beyond);
        e.normaliser(UNIT, m.camera.format.width());
        let reciprocal = Reciprocal::new(e, UNIT, "reciprocal", m.reciprocal, m.camera.format.frac_bits);
        // The quotient's binary point moves with the exponent of 1/t_z.
        let slope = e.copies(2, |e| {
            let quotient = e.times(UNIT, m.camera, m.reciprocal.format());
            e.fit_shifted(UNIT, "slope", m.slope, quotient)
        });
        // An ellipsoid's opacity is compared with the least.
        if machine.ellipse.ellipsoid.is_some() {
            e.adders(UNIT, 1, machine.splat.opacity.format.width());
        }
        let pixel = e.copies(2, |e| {
            let screen = e.times(UNIT, m.focal, m.slope);
            let from_middle = e.sum(UNIT, [screen, m.pixel.into()]);
            e.fit(UNIT, "pixel", m.pixel, from_middle)
        });
        let screen_frac_bits = m.focal.format.frac_bits + m.slope.format.frac_bits;
        Project {
            relative,
            camera,
            depth,
            slope,
            pixel,
            reciprocal,
            align: align([position, eye]),
            difference_frac_bits: i64::from(position.max(eye)),
            slope_frac_bits: m.slope.format.frac_bits as u32,
            screen_align: align([screen_frac_bits, m.pixel.format.frac_bits]),
        }
    }

    /// 1/t_z.
    pub fn reciprocal(&self) -> &Reciprocal {
        &self.reciprocal
    }

    /// Which of eight ellipsoids have too little opacity.
    #[inline(always)]
    pub fn transparent<W: Words>(&self, kernel: &Kernel, opacity: W) -> W {
        W::splat(kernel.least_opacity).above(opacity)
    }

    /// Projects eight splats, some of which may be known to have too little opacity; lanes that end culled carry harmless words from there
    /// on.
    #[inline(always)]
    pub fn lanes<W: Words, P: Probe>(&self, view: &View, position: [W; 3], transparent: W, tap: &mut Tap<P>) -> Projected<W> {
        let (relative, exponent) = self.relative(view, position, tap);
        let camera = three!(row => tap.fit_words(&self.camera, W::dot(view.rotation[row], relative)));
        let forward = camera[2].max(W::splat(1));
        let depth = tap.fit_shifted(&self.depth, camera[2].max(W::splat(0)).exact(), -exponent);
        let near = depth.above(W::splat(view.near)).not();
        let limit = two!(axis => W::splat(view.guard[axis]) * forward);
        let beyond = two!(axis => camera[axis].exact().abs().left(self.slope_frac_bits).above(limit[axis]));
        let outside = beyond[0] | beyond[1];
        tap.drop_where(near | outside | transparent);

        let inverse_depth = self.reciprocal.lanes(forward.exact(), tap);
        let offset = two!(axis => W::splat(0).where_else(near | outside, camera[axis]));
        let slope = two!(axis => tap.fit_shifted(&self.slope, offset[axis] * inverse_depth.mantissa, -inverse_depth.exponent));
        let [of_screen, of_centre] = self.screen_align;
        let (focal, centre) = (view.focals(), view.centre.map(|centre| centre << of_centre));
        let pixel = two!(axis => {
            let screen = (W::splat(focal[axis]) * slope[axis]).left(of_screen);
            tap.fit_wide(&self.pixel, screen + W::Exact::splat(centre[axis])).low()
        });
        Projected { camera: [camera[0], camera[1], forward], exponent, depth, inverse_depth, slope, pixel, near, outside, transparent }
    }

    /// Position less eye, and the power of two that it is relative to.
    #[inline(always)]
    fn relative<W: Words, P: Probe>(&self, view: &View, position: [W; 3], tap: &mut Tap<P>) -> ([W; 3], W) {
        let [of_position, of_eye] = self.align;
        let difference = three!(axis => position[axis].exact().left(of_position) - W::Exact::splat(view.eye[axis] << of_eye));
        let [x, y, z] = three!(axis => difference[axis].abs());
        // As many as those of the largest.
        let lead = (x | y | z | W::Exact::splat(1)).leading_zeros() - W::splat(2);
        let relative = three!(axis => tap.fit_top(&self.relative, difference[axis].left_by(lead)));
        (relative, W::splat(i64::from(NORMALISED_FRAC_BITS) - self.difference_frac_bits) - lead)
    }
}

pub mod real;

#[cfg(test)]
mod tests;

//! Discs: `project` and `ellipse` of discs for the host, eight splats at a time in registers, for
//! runs without a probe.
//!
//! Both units are specified as graphs, and this code uses the graphs' words and function units. A
//! batch of the graphs takes 1.8 times as many instructions per splat. Names and order are those of
//! the graphs.
//!
//! Law: `discs_are_set_up_as_by_their_graphs`.

use super::set_up::Made;
use crate::elaboration::Signal;
use crate::frame::{Scaled, Splat, View};
use crate::functions::reciprocal::{NORMALISED_FRAC_BITS, Scientific};
use crate::functions::{Reciprocal, ReciprocalRoot};
use crate::graph::Graph;
use crate::machine::Machine;
use crate::num::{Exacts, Fit, LANES, Word, Words, align, three, two};
use crate::probe::{NoProbe, Tap};
use crate::records::unit;
use crate::units::{ellipse, project};

/// Fraction bits of a difference shifted left until its largest part fills 62 bits.
const PARTS_FRAC_BITS: i32 = NORMALISED_FRAC_BITS + 1;

/// Function units.
#[derive(Clone, Debug)]
struct FunctionUnits {
    reciprocal: Reciprocal,
    root: ReciprocalRoot,
    extent_root: ReciprocalRoot,
    slope_reciprocal: Reciprocal,
}

/// Constants of both units for the host.
#[derive(Clone, Debug)]
pub struct Discs {
    units: FunctionUnits,
    relative: Fit,
    camera: Fit,
    depth: Fit,
    projected_slope: Fit,
    pixel: Fit,
    normal: Fit,
    turns_normals: bool,
    fragment_normal: Fit,
    tilt: Fit,
    facing: Fit,
    scaled_radius: Fit,
    size: Fit,
    size_squared: Fit,
    /// Products of `size_squared` and `aspect`; `None` where all pixels are square.
    stretched: Option<Fit>,
    shape: Fit,
    low_pass: Fit,
    variance: Fit,
    variance_cross: Fit,
    area: Fit,
    determinant: Fit,
    inverse: Fit,
    conic: Fit,
    conic_cross: Fit,
    visibility: Fit,
    amplitude: Fit,
    inverse_two_pi: i64,
    extent: Fit,
    edge: Fit,
    depth_step: Fit,
    slope_scale: Fit,
    depth_slope: Fit,
    depth_range: Fit,
    places: Alignment,
}

/// Left shifts that align the terms of sums, and their fraction bits.
#[derive(Clone, Copy, Debug)]
struct Alignment {
    /// Position, eye; and their common fraction bits.
    position: [u32; 2],
    difference: i64,
    slope: u32,
    /// s·a, principal point.
    screen: [u32; 2],
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

/// Results of `project`.
struct Projected<W> {
    camera: [W; 3],
    exponent: W,
    depth: W,
    inverse_depth: Scientific<W>,
    slope: [W; 2],
    pixel: [W; 2],
    near: W,
    outside: W,
}

/// Screen footprint of a disc.
struct Footprint<W> {
    conic: [W; 3],
    amplitude: W,
    columns: [W; 2],
    rows: [W; 2],
    faint: W,
    outside: W,
}

impl Discs {
    /// Extracts the constants from the graphs of both units.
    pub fn new(
        machine: &Machine,
        signals: &[Signal],
        point: &Graph<{ project::OUTPUTS }>,
        disc: &Graph<{ ellipse::OUTPUTS }>,
        inverse_two_pi: i64,
    ) -> Self {
        let (p, m) = (&machine.project, &machine.ellipse);
        let f = |word: Word| word.format.frac_bits;
        let of_point = |name: &str| point.fit_of_signal(signals, unit::PROJECT, name, 0);
        let nth = |name: &str, nth: usize| disc.fit_of_signal(signals, unit::ELLIPSE, name, nth);
        let of_disc = |name: &str| nth(name, 0);
        let variance = f(m.size_squared) + f(m.shape);
        let shape = align([2 * f(p.slope), 2 * f(m.tilt)]);
        let [position, eye] = [machine.splat.position, p.eye].map(f);
        let [reciprocal] = point.reciprocals() else {
            unreachable!("project has one")
        };
        let ([slope_reciprocal], [root, extent_root, ..]) = (disc.reciprocals(), disc.roots())
        else {
            unreachable!("ellipse has these")
        };
        let units = FunctionUnits {
            reciprocal: reciprocal.clone(),
            root: root.clone(),
            extent_root: extent_root.clone(),
            slope_reciprocal: slope_reciprocal.clone(),
        };
        Discs {
            units,
            relative: of_point("relative"),
            camera: of_point("camera"),
            depth: of_point("depth"),
            projected_slope: of_point("slope"),
            pixel: of_point("pixel"),
            normal: of_disc("normal"),
            turns_normals: machine.fragment.turn_normals,
            fragment_normal: disc.fit_of_signal(signals, unit::FRAGMENT, "normal", 0),
            tilt: of_disc("tilt"),
            facing: of_disc("facing"),
            scaled_radius: of_disc("scaled_radius"),
            size: of_disc("size"),
            size_squared: of_disc("size_squared"),
            stretched: m.aspect.map(|_| nth("size_squared", 1)),
            shape: of_disc("shape"),
            low_pass: of_disc("low_pass"),
            variance: of_disc("variance"),
            variance_cross: of_disc("variance_cross"),
            area: of_disc("area"),
            determinant: of_disc("determinant"),
            inverse: of_disc("inverse"),
            conic: of_disc("conic"),
            conic_cross: of_disc("conic_cross"),
            visibility: of_disc("visibility"),
            amplitude: of_disc("amplitude"),
            inverse_two_pi,
            extent: of_disc("extent"),
            edge: of_disc("edge"),
            depth_step: of_disc("depth_step"),
            slope_scale: nth("depth_step", 1),
            depth_slope: of_disc("depth_slope"),
            depth_range: of_disc("depth_range"),
            places: Alignment {
                position: align([position, eye]),
                difference: i64::from(position.max(eye)),
                slope: f(p.slope) as u32,
                screen: align([f(p.focal) + f(p.slope), f(p.pixel)]),
                scaled_radius: i64::from(f(p.focal) + f(machine.splat.radius)),
                shape: [(2 * f(p.slope)) as u32 + shape[0], shape[0], shape[1]],
                variance: align([variance, f(m.low_pass)]),
                determinant: align([
                    2 * f(m.area),
                    f(m.low_pass) + f(m.variance),
                    2 * f(m.low_pass),
                ]),
                edge: align([f(p.pixel), f(m.extent)]),
                edge_frac_bits: f(p.pixel).max(f(m.extent)).max(1) as u32,
            },
        }
    }
}

impl Discs {
    /// Sets up eight discs. After it is culled, a lane holds arbitrary but harmless words.
    #[inline(always)]
    pub(super) fn set_up<W: Words>(
        &self,
        view: &View,
        size_px: [u32; 2],
        splats: &[Splat; LANES],
    ) -> Made<W> {
        // The first eight words of each record as stored: the eighth, red, is not used here.
        let mut records = [W::splat(0); LANES];
        for (record, splat) in records.iter_mut().zip(splats) {
            let Splat {
                position: [x, y, z],
                normal: [n, m, o],
                radius,
                rgb: [red, ..],
                ..
            } = *splat;
            *record = W::from_array([x, y, z, n, m, o, radius, red]);
        }
        let [x, y, z, n, m, o, radius, _] = W::transposed(records);
        let point = self.projected(view, [x, y, z]);
        let normal = self.camera_normal(view, [n, m, o]);
        let (tilt, facing) = self.turn(point.slope, normal);
        let (zero, one) = (W::splat(0), W::splat(1));
        let away = if view.cull_backfaces {
            facing.above(zero)
        } else {
            zero
        };
        let blind = facing.is_zero() | radius.is_none();
        let facing = one.where_else(blind, facing);
        let radius = radius.max(one);

        let sized = self.size(view, radius, &point);
        let shape = self.shape(point.slope, tilt);
        let footprint = self.footprint(view, size_px, point.pixel, sized, (shape, facing));
        Made {
            culled: [
                point.near,
                point.outside,
                zero,
                away,
                blind | footprint.faint,
                footprint.outside,
            ],
            pixel: point.pixel,
            depth: point.depth,
            conic: footprint.conic,
            depth_slope: self.depth_slope(view, &point, normal, facing),
            depth_range: self.depth_range.words(radius * W::splat(view.root_cutoff)),
            sides: [footprint.columns, footprint.rows],
            amplitude: footprint.amplitude,
            normal: self.seen_normal(normal),
        }
    }

    #[inline(always)]
    fn projected<W: Words>(&self, view: &View, position: [W; 3]) -> Projected<W> {
        let (relative, exponent) = self.relative(view, position);
        let camera = three!(row => self.camera.words(W::dot(view.rotation[row], relative)));
        let forward = camera[2].max(W::splat(1));
        let depth = self
            .depth
            .words_shifted(camera[2].max(W::splat(0)).exact(), -exponent);
        let near = depth.above(W::splat(view.near)).not();
        let limit = two!(axis => W::splat(view.guard[axis]) * forward);
        let beyond =
            two!(axis => camera[axis].exact().abs().left(self.places.slope).above(limit[axis]));
        let outside = beyond[0] | beyond[1];

        let inverse_depth = self
            .units
            .reciprocal
            .lanes(forward.exact(), &mut Tap::new(&mut NoProbe));
        let offset = two!(axis => W::splat(0).where_else(near | outside, camera[axis]));
        let slope = two!(axis => self.projected_slope.words_shifted(offset[axis] * inverse_depth.mantissa, -inverse_depth.exponent));
        let [of_screen, of_centre] = self.places.screen;
        let (focal, centre) = (view.focals(), view.centre.map(|centre| centre << of_centre));
        let pixel = two!(axis => {
            let screen = (W::splat(focal[axis]) * slope[axis]).left(of_screen);
            self.pixel.wide(screen + W::Exact::splat(centre[axis])).low()
        });
        Projected {
            camera: [camera[0], camera[1], forward],
            exponent,
            depth,
            inverse_depth,
            slope,
            pixel,
            near,
            outside,
        }
    }

    /// Position less eye, and the power of two that it is relative to.
    #[inline(always)]
    fn relative<W: Words>(&self, view: &View, position: [W; 3]) -> ([W; 3], W) {
        let [of_position, of_eye] = self.places.position;
        let difference = three!(axis => position[axis].exact().left(of_position) - W::Exact::splat(view.eye[axis] << of_eye));
        let [x, y, z] = three!(axis => difference[axis].abs());
        // Leading zeros of the largest difference.
        let lead = (x | y | z | W::Exact::splat(1)).leading_zeros() - W::splat(2);
        let relative = three!(axis => self.relative.top(difference[axis].left_by(lead)));
        (
            relative,
            W::splat(i64::from(PARTS_FRAC_BITS) - self.places.difference) - lead,
        )
    }

    /// Computes a conic and a box from a shape's variance without size, and its faces.
    #[inline(always)]
    fn footprint<W: Words>(
        &self,
        view: &View,
        size_px: [u32; 2],
        pixel: [W; 2],
        (size_squared, exponent): ([W; 3], W),
        (shape, facing): ([W; 3], W),
    ) -> Footprint<W> {
        let low_pass = self
            .low_pass
            .words_shifted(W::Exact::splat(view.low_pass), exponent + exponent);
        let variance = self.variance(shape, size_squared, low_pass);
        let area = self.area.words(size_squared[1] * facing);
        let determinant = self.determinant(area, variance, low_pass);
        let flat = W::Exact::splat(1).above(determinant);

        let inverse_root = self.units.root.lanes(
            determinant.max(W::Exact::splat(1)),
            &mut Tap::new(&mut NoProbe),
        );
        let conic = self.conic(variance, inverse_root, exponent);
        let visibility = self
            .visibility
            .words_shifted(area.abs() * inverse_root.mantissa, -inverse_root.exponent);
        let amplitude = self
            .amplitude
            .words(visibility * W::splat(self.inverse_two_pi));
        let dark = amplitude.is_none();

        let across = [variance[0], variance[2]];
        let [columns, rows] = two!(axis => self.side(view.cutoff, size_px[axis], pixel[axis], across[axis], exponent));
        let outside = columns[0].above(columns[1]) | rows[0].above(rows[1]);
        Footprint {
            conic,
            amplitude,
            columns,
            rows,
            faint: flat | dark,
            outside,
        }
    }

    #[inline(always)]
    fn camera_normal<W: Words>(&self, view: &View, normal: [W; 3]) -> [W; 3] {
        three!(row => self.normal.words(W::dot(view.rotation[row], normal)))
    }

    /// The normal that fragments sum. It is turned towards the viewer where the machine does that,
    /// so that the two sides of a sheet do not cancel.
    #[inline(always)]
    fn seen_normal<W: Words>(&self, normal: [W; 3]) -> [W; 3] {
        let mut seen = normal;
        if self.turns_normals {
            let away = normal[2].above(W::splat(0));
            seen = three!(axis => (-normal[axis]).where_else(away, normal[axis]));
        }
        three!(axis => self.fragment_normal.words(seen[axis].exact()))
    }

    /// g and c_n.
    #[inline(always)]
    fn turn<W: Words>(&self, [a, b]: [W; 2], n: [W; 3]) -> ([W; 2], W) {
        let [x, y, z] = three!(axis => n[axis].exact().left(self.places.slope));
        let tilt = [self.tilt.words(x - a * n[2]), self.tilt.words(y - b * n[2])];
        (tilt, self.facing.words(a * n[0] + b * n[1] + z))
    }

    /// k'_x², k'_x·k'_y, k'_y², and e.
    #[inline(always)]
    fn size<W: Words>(&self, view: &View, radius: W, point: &Projected<W>) -> ([W; 3], W) {
        let scaled = (W::splat(view.focal) * radius).max(W::Exact::splat(1));
        let lead = scaled.leading_zeros() - W::splat(2);
        let mantissa = self.scaled_radius.top(scaled.left_by(lead));
        let floor = i64::from(NORMALISED_FRAC_BITS) - self.places.scaled_radius;
        // k = mantissa · inverse_depth · 2^power, where the product is in [½, 2].
        let inverse_depth = point.inverse_depth;
        let power = inverse_depth.exponent - point.exponent + W::splat(floor) - lead;
        let exponent = (power + W::splat(1)).max(W::splat(0));
        let size = self
            .size
            .words_shifted(mantissa * inverse_depth.mantissa, exponent - power);
        let squared = self.size_squared.words(size * size);
        let squares = match (view.aspect, &self.stretched) {
            (Some(aspect), Some(fit)) => {
                three!(i => fit.words(squared * W::splat(aspect.squares[i])))
            }
            _ => [squared; 3],
        };
        (squares, exponent)
    }

    /// [1+a² … − ggᵀ].
    #[inline(always)]
    fn shape<W: Words>(&self, [a, b]: [W; 2], g: [W; 2]) -> [W; 3] {
        let [one, slopes, tilts] = self.places.shape;
        let one = W::Exact::splat(1 << one);
        let shape = [
            one + (a * a).left(slopes) - (g[0] * g[0]).left(tilts),
            (a * b).left(slopes) - (g[0] * g[1]).left(tilts),
            one + (b * b).left(slopes) - (g[1] * g[1]).left(tilts),
        ];
        three!(i => self.shape.words(shape[i]))
    }

    /// V00', V01', V11'.
    #[inline(always)]
    fn variance<W: Words>(
        &self,
        [xx, xy, yy]: [W; 3],
        size_squared: [W; 3],
        low_pass: W,
    ) -> [W; 3] {
        let [spread, filter] = self.places.variance;
        let low_pass = low_pass.exact().left(filter);
        [
            self.variance
                .words((size_squared[0] * xx).left(spread) + low_pass),
            self.variance_cross.words(size_squared[1] * xy),
            self.variance
                .words((size_squared[2] * yy).left(spread) + low_pass),
        ]
    }

    #[inline(always)]
    fn determinant<W: Words>(&self, area: W, variance: [W; 3], low_pass: W) -> W::Exact {
        let [squares, filtered, filters] = self.places.determinant;
        let trace = variance[0] + variance[2];
        let exact = (low_pass * trace).left(filtered) - (low_pass * low_pass).left(filters)
            + (area * area).left(squares);
        self.determinant.wide(exact)
    }

    #[inline(always)]
    fn conic<W: Words>(&self, v: [W; 3], inverse_root: Scientific<W>, exponent: W) -> [W; 3] {
        let inverse = self
            .inverse
            .words(inverse_root.mantissa * inverse_root.mantissa);
        let more = (exponent - inverse_root.exponent).left(1);
        [
            self.conic.words_shifted(v[2] * inverse, more),
            self.conic_cross.words_shifted(-(v[1] * inverse), more),
            self.conic.words_shifted(v[0] * inverse, more),
        ]
    }

    /// First and last column, or row, clipped to the picture. The first is beyond the last where
    /// the splat is outside.
    #[inline(always)]
    fn side<W: Words>(
        &self,
        cutoff: i64,
        pixels: u32,
        pixel: W,
        variance: W,
        exponent: W,
    ) -> [W; 2] {
        let reach = (W::splat(cutoff) * variance).max(W::Exact::splat(1));
        let (root, power) = self
            .units
            .extent_root
            .root_lanes(reach, &mut Tap::new(&mut NoProbe));
        let extent = self.extent.words_shifted(root, -power - exponent);
        let [pixel_align, extent_align] = self.places.edge;
        let last_px = i64::from(pixels) - 1;
        // From the centre of pixel 0 to the picture's middle: (pixels − 1)/2.
        let first_centre = W::Exact::splat(last_px << (self.places.edge_frac_bits - 1));
        let centre = pixel.exact().left(pixel_align) + first_centre;
        let extent = (extent.exact() + W::Exact::splat(1)).left(extent_align);
        let up = W::Exact::splat((1 << self.places.edge_frac_bits) - 1);
        let first = self.edge.words(centre - extent + up).max(W::splat(0));
        let last = self.edge.words(centre + extent).min(W::splat(last_px));
        [first, last]
    }

    #[inline(always)]
    fn depth_slope<W: Words>(
        &self,
        view: &View,
        point: &Projected<W>,
        n: [W; 3],
        facing: W,
    ) -> [W; 2] {
        let inverse = self
            .units
            .slope_reciprocal
            .lanes(facing.exact().abs(), &mut Tap::new(&mut NoProbe));
        let across = self.slope_scale(view.inverse_focals()[0], point, &inverse, facing);
        // Square pixels have the same step on both axes.
        let down = match view.aspect {
            None => across,
            Some(aspect) => self.slope_scale(aspect.inverse_focal[1], point, &inverse, facing),
        };
        [
            self.depth_slope.words_shifted(across.0 * n[0], across.1),
            self.depth_slope.words_shifted(down.0 * n[1], down.1),
        ]
    }

    /// The factor of the normal in a depth slope, and its exponent. It is not a closure, because
    /// vector instructions would not be inlined in one that is called twice.
    #[inline(always)]
    fn slope_scale<W: Words>(
        &self,
        inverse_focal: Scaled,
        point: &Projected<W>,
        inverse: &Scientific<W>,
        facing: W,
    ) -> (W, W) {
        let step = self
            .depth_step
            .words(point.camera[2] * W::splat(inverse_focal.mantissa));
        let scale = self.slope_scale.words(step * inverse.mantissa);
        let away = scale.where_else(W::splat(0).above(facing), -scale);
        (
            away,
            W::splat(inverse_focal.places) - inverse.exponent - point.exponent,
        )
    }
}

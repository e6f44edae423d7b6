//! Pipeline over the reals: one splat, and one of its contributions, through the units' bounds.

use crate::frame::Frame;
use crate::functions::table::real::Power;
use crate::num::two;
use crate::pipeline::Elaborated;
use crate::real::frame::{Ellipsoid, Splat, View};
use crate::real::{MixedPrecision, Near, Real, Scale};
use crate::units::fragment::sheets;
use crate::units::fragment::sheets::real::Ratio;
use crate::units::shade::real::{Lighting, Sums};
use crate::units::{ellipse, project, raster};
use std::array;
use std::ops::Range;

/// A splat that has been set up, as exact arithmetic and the machine both understand it.
#[derive(Clone, Copy, Debug)]
pub struct Footprint {
    /// Where it is.
    pub point: project::real::Projected<Near>,
    /// Its look.
    pub ellipse: ellipse::real::Output<Near>,
    walk: raster::real::Walk,
    /// Of gauss.
    table_error: f64,
}

/// One splat at one pixel, but for its [`depth`](Footprint::depth) there.
#[derive(Clone, Copy, Debug)]
pub struct Contribution {
    /// r.
    pub radial: Near,
    /// w.
    pub weight: Near,
}

impl Footprint {
    /// Sets splats up for a picture of `size_px`, as [`Elaborated::real_set_up`].
    pub fn batch<const ITEMS: usize>(
        machine: &Elaborated,
        view: &View<Near>,
        splats: &[Splat<Near>; ITEMS],
        ellipsoids: [Option<&Ellipsoid<Near>>; ITEMS],
        size_px: [u32; 2],
    ) -> [Self; ITEMS] {
        machine
            .real_set_up(view, splats, ellipsoids)
            .map(|(point, ellipse)| Footprint::new(machine, point, ellipse, size_px))
    }

    fn new(
        machine: &Elaborated,
        point: project::real::Projected<Near>,
        ellipse: ellipse::real::Output<Near>,
        size_px: [u32; 2],
    ) -> Self {
        // The box is seeded at its first pixel, or where it enters the picture.
        let reach = two!(axis => {
            let to_edge = (f64::from(size_px[axis]) / 2.0 + point.pixel[axis].high()).max(0.0);
            let to_side = ellipse.extent[axis].high() + 1.0;
            if machine.raster.is_direct() { to_side } else { to_side.min(to_edge + 1.0) }
        });
        let walk = machine.raster.near(&walked(&point, &ellipse), reach);
        Footprint {
            point,
            ellipse,
            walk,
            table_error: machine.gauss.table_error(),
        }
    }

    /// Contribution of the splat to the pixel whose centre lies at `at` from the picture's middle.
    pub fn contribution(&self, machine: &Elaborated, at: [f64; 2]) -> Contribution {
        let radial = machine.raster.near_radial(&self.walk, at);
        Contribution {
            radial,
            weight: machine
                .gauss
                .real_within(radial, self.ellipse.amplitude, self.table_error),
        }
    }

    /// z of the splat at that pixel, machine units.
    pub fn depth(&self, machine: &Elaborated, at: [f64; 2]) -> Near {
        machine.real_depth(machine.raster.near_depth(&self.walk, at))
    }
}

/// Input port of raster, from setup.
pub fn walked<R: Real>(
    point: &project::real::Projected<R>,
    ellipse: &ellipse::real::Output<R>,
) -> raster::real::Input<R> {
    raster::real::Input {
        pixel: point.pixel,
        conic: ellipse.conic,
        depth: point.depth,
        depth_slope: ellipse.depth_slope,
        depth_range: ellipse.depth_range,
    }
}

impl Elaborated {
    /// Project and ellipse, of discs or of ellipsoids of one kind.
    pub fn real_set_up<R: Real, const ITEMS: usize>(
        &self,
        view: &View<R>,
        splats: &[Splat<R>; ITEMS],
        ellipsoids: [Option<&Ellipsoid<R>>; ITEMS],
    ) -> [(project::real::Projected<R>, ellipse::real::Output<R>); ITEMS] {
        let positions = splats.each_ref().map(|splat| splat.position);
        let points = self.project.real(view, positions);
        let inputs = array::from_fn(|item| ellipse::real::Input {
            splat: splats[item],
            forward: points[item].camera[2],
            exponent: points[item].exponent,
            inverse_depth: points[item].inverse_depth,
            slope: points[item].slope,
        });
        let ellipses = self.ellipse.real(view, ellipsoids, &inputs);
        array::from_fn(|item| (points[item], ellipses[item]))
    }

    /// Whether the machine turns the normal of a frame's splat towards the viewer.
    pub fn turns_normal(&self, frame: &Frame, splat: usize) -> bool {
        self.ellipse.turns(&frame.view, frame.splats[splat].normal)
    }

    /// Greatest distance of the table of `gauss` from e^(−r/2), before its result is fitted.
    pub fn gauss_table_error(&self) -> f64 {
        self.gauss.table_error()
    }

    /// A contribution's weight.
    pub fn real_weight<R: Real>(&self, radial: R, amplitude: R) -> R {
        self.gauss.real(radial, amplitude)
    }

    /// A contribution's depth, as a fragment keeps it.
    pub fn real_depth<R: Real>(&self, depth: R) -> R {
        depth.fit(self.fragment.depth_fit(), Scale::ONE)
    }

    /// A sum of a fragment (weight, rgb, opacity, normal) after one more contribution.
    pub fn real_accumulated<R: Real>(&self, lane: usize, sum: R, weight: R, attribute: R) -> R {
        self.fragment.real_accumulated(lane, sum, weight, attribute)
    }

    /// Registers at the first pixels of some rows of a box
    /// ([`raster::Raster::mixed_precision_rows`]).
    pub fn mixed_precision_rows<'a>(
        &self,
        input: &raster::real::Input<MixedPrecision<'a>>,
        first: [f64; 2],
        rows: Range<u32>,
    ) -> impl Iterator<Item = raster::real::Row<'a>> {
        self.raster.mixed_precision_rows(input, first, rows)
    }

    /// r and z at some columns from the first pixel of a row.
    pub fn mixed_precision_pixel<'a>(
        &self,
        row: &raster::real::Row<'a>,
        columns: f64,
    ) -> [MixedPrecision<'a>; 2] {
        self.raster.mixed_precision_pixel(row, columns)
    }

    /// Whether a pixel with this r makes a fragment.
    pub fn keeps(&self, radial: f64, cutoff: f64) -> bool {
        self.raster.keeps(radial, cutoff)
    }

    /// The light that a splat sends which is lit before it is drawn, from its own colour and
    /// normal.
    pub fn real_emission<R: Real>(
        &self,
        lighting: &Lighting<R>,
        rgb: [R; 3],
        normal: [R; 3],
        material: u32,
    ) -> [R; 3] {
        let one = rgb[0].constant_like(1.0);
        let (rgb, normal) = self.fragment.real_emitting(rgb, normal);
        let [r, g, b, _] = self.shade.real(
            lighting,
            &Sums {
                weight: one,
                rgb,
                opacity: one,
                normal,
                material,
                at: [0.0; 2],
            },
        );
        [r, g, b].map(|channel| channel.fit(&self.emission, Scale::ONE))
    }

    /// Colour times opacity, and opacity, of a sheet that is done.
    pub fn real_close<R: Real>(
        &self,
        weight: R,
        rgb: [R; 3],
        registers: &sheets::SheetRegisters,
        ratio: &Ratio,
    ) -> [R; 4] {
        self.fragment.real_close(weight, rgb, registers, ratio)
    }

    /// Least distance of depths that the sort tells apart, machine units; none where it sorts
    /// nothing.
    pub fn real_key<R: Real>(&self, depth: R) -> R {
        self.sort
            .as_ref()
            .map_or(depth, |key| depth.fit(key, Scale::ONE))
    }

    /// Shades one fragment: colour times opacity, and opacity.
    pub fn real_shade<R: Real>(&self, lighting: &Lighting<R>, sums: &Sums<R>) -> [R; 4] {
        self.shade.real(lighting, sums)
    }

    /// Words that a slot keeps of a fragment that was shaded for a merge.
    pub fn real_stored<R: Real>(&self, shaded: [R; 4]) -> [R; 4] {
        self.fragment.real_stored(shaded)
    }

    /// Light that a merge or resolve reads of a fragment that a merge left.
    pub fn real_read<R: Real>(&self, slot: [R; 4]) -> [R; 4] {
        self.fragment.real_read(slot)
    }

    /// Front over back, into a slot.
    pub fn real_merge<R: Real>(&self, front: [R; 4], back: [R; 4]) -> [R; 4] {
        self.fragment.real_blend(front, back)
    }

    /// Layers front to back over the background.
    pub fn real_resolve<R: Real>(&self, layers: &[[R; 4]], background: [R; 4]) -> [R; 4] {
        self.resolve.real(layers, background)
    }

    /// A material's highlight, from its words.
    pub fn real_highlight(&self, words: &[i64], shininess: f64) -> Power {
        self.shade.power(words, shininess)
    }
}

//! Pipeline over the reals: one splat, and one of its contributions, through the units' bounds.

use crate::frame::real::{Splat, View};
use crate::machine::Elaborated;
use crate::num::table::real::Power;
use crate::num::two;
use crate::real::{Near, Real, Scale};
use crate::units::shade::real::{Lighting, Sums};
use crate::units::{ellipse, project, raster};

/// A splat that has been set up, as exact arithmetic and the machine both understand it.
#[derive(Clone, Copy, Debug)]
pub struct Footprint {
    /// Where it is.
    pub point: project::real::Projected<Near>,
    /// What it looks like.
    pub ellipse: ellipse::real::Output<Near>,
    walk: raster::real::Walk,
}

/// One splat at one pixel.
#[derive(Clone, Copy, Debug)]
pub struct Contribution {
    /// r.
    pub radial: Near,
    /// w.
    pub weight: Near,
    /// z, machine units.
    pub depth: Near,
}

impl Footprint {
    /// Sets a splat up for a picture of `size_px`.
    pub fn new(machine: &Elaborated, view: &View<Near>, splat: &Splat<Near>, size_px: [u32; 2]) -> Self {
        let point = machine.project.real(view, splat.position);
        let input = ellipse::real::Input {
            splat: *splat,
            forward: point.camera[2],
            exponent: point.exponent,
            inverse_depth: point.inverse_depth,
            slope: point.slope,
        };
        let ellipse = machine.ellipse.real(view, &input);
        // The box is seeded at its first pixel, or where it enters the picture.
        let reach = two!(axis => {
            let to_edge = (f64::from(size_px[axis]) / 2.0 + point.pixel[axis].high()).max(0.0);
            (ellipse.extent[axis].high() + 1.0).min(to_edge + 1.0)
        });
        let input = raster::real::Input {
            pixel: point.pixel,
            conic: ellipse.conic,
            depth: point.depth,
            depth_slope: ellipse.depth_slope,
            depth_range: ellipse.depth_range,
        };
        Footprint { point, ellipse, walk: machine.raster.near(&input, reach) }
    }

    /// What the splat gives to the pixel whose centre lies at `at` from the picture's middle.
    pub fn contribution(&self, machine: &Elaborated, at: [f64; 2]) -> Contribution {
        let radial = machine.raster.near_radial(&self.walk, at);
        Contribution {
            radial,
            weight: machine.gauss.real(radial, self.ellipse.amplitude),
            depth: machine.raster.near_depth(&self.walk, at).fit(machine.fragment.depth_fit(), Scale::ONE),
        }
    }
}

impl Elaborated {
    /// Shades one fragment: colour times opacity, and opacity.
    pub fn real_shade(&self, lighting: &Lighting<Near>, sums: &Sums<Near>) -> [Near; 4] {
        self.shade.real(lighting, sums)
    }

    /// What a slot keeps of a fragment that was shaded for a merge.
    pub fn real_stored(&self, shaded: [Near; 4]) -> [Near; 4] {
        self.fragment.real_stored(shaded)
    }

    /// What a merge or resolve reads of a fragment that a merge left.
    pub fn real_read(&self, slot: [Near; 4]) -> [Near; 4] {
        self.fragment.real_read(slot)
    }

    /// Front over back, into a slot.
    pub fn real_merge(&self, front: [Near; 4], back: [Near; 4]) -> [Near; 4] {
        self.fragment.real_blend(front, back)
    }

    /// Layers front to back over the background.
    pub fn real_resolve(&self, layers: &[[Near; 4]], background: [Near; 4]) -> [Near; 4] {
        self.resolve.real(layers, background)
    }

    /// A material's highlight, from its words.
    pub fn real_highlight(&self, words: &[i64], shininess: f64) -> Power {
        self.shade.power(words, shininess)
    }
}

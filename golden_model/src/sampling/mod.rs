//! Sampling: computes points of a mesh's surface, each with the normal, radius, colour and opacity
//! of a splat.
//! ```text
//! mesh ─► [surface] ─► [pattern]: where ─► [radii]: how wide ─► [texture]: which colour ─► splats ─► [file]
//! ```
//! The same mesh, request and seed give the same points, with any number of threads.
//!
//! Laws (tests/sampling.rs): `there_are_exactly_as_many_points_as_asked_for`,
//! `points_lie_on_the_mesh`, `areas_have_points_in_proportion`, `a_sampled_plane_has_no_hole`.

mod cells;
pub mod file;
pub mod gaussian;
mod pattern;
mod radii;
mod solve;
mod surface;
mod texture;

pub use solve::Solution;

use crate::output::text::thousands;
use crate::scene::Splat;
use crate::scene::memory;
use crate::scene::mesh::{Image, Mesh, Texture, Wrap};
use rayon::prelude::*;
use std::sync::Arc;
use surface::Surface;

/// Greatest number of bytes per point during sampling: position, splat, neighbours and, if colours
/// are solved for, a row of the matrix.
const POINT_BYTES: u64 = 900;
/// Least ratio of spacing and largest coordinate: positions have a resolution of 10⁻¹⁶ of that
/// coordinate, and a spacing should have at least three digits.
const LEAST_SPACING: f64 = 1e-12;
/// Radius over the root of a point's area, and over the mean distance to its neighbours. Cut at 2,
/// kernels of width equal to that root weigh 0.63 on average, and 0.24 in the widest gap of a
/// blue-noise pattern, where 0.4 cover a pixel. With these factors the least weight of 20,000
/// points is 0.46 or more.
const OF_AREA: f64 = 1.2;
const OF_NEIGHBOURS: f64 = 1.1;
/// Factor for stratified points, whose gaps are wider: the least weight is 0.62 and 0.53.
const OF_STRATA: f64 = 1.25;
/// Least side of a checkerboard's picture, texels.
const CHECKERBOARD_TEXELS: usize = 2048;

/// Number of points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Amount {
    /// This many, at least 1.
    Points(usize),
    /// This many per unit of area, above 0.
    Density(f64),
}

/// Arrangement of points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pattern {
    /// All distances are at least a limit that is as large as possible.
    BlueNoise,
    /// One in each part of the surface, with parts of equal area.
    Stratified,
}

/// Origin of radii (SS §5: the local density of samples).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Radii {
    /// Mean distance to the six nearest points on the same side.
    Neighbours,
    /// Root of a point's area.
    Area,
}

/// How texels of a picture become colours of points (SS §5 and Appendix A).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Acquisition {
    /// The texel at the point.
    Nearest,
    /// The mean of texels under the point's kernel: view-independent EWA.
    Ewa,
    /// The colours whose kernels together come closest to the picture.
    Optimised,
}

/// The picture on the surface.
#[derive(Clone, Debug)]
pub enum Picture {
    /// The materials' own textures.
    Own,
    /// This picture everywhere.
    Texture(Texture),
}

impl Picture {
    /// N×N checks, black and white, over each unit square of texture coordinates; the upper left
    /// one is white.
    pub fn checkerboard(checks: usize) -> Picture {
        let texels = CHECKERBOARD_TEXELS.div_ceil(checks);
        let side = checks * texels;
        let code = |place: usize| {
            if (place / side / texels + place % side / texels).is_multiple_of(2) {
                255
            } else {
                0
            }
        };
        let texels = (0..side * side)
            .map(|place| [code(place), code(place), code(place), 255])
            .collect();
        Picture::Texture(Texture {
            image: Arc::new(Image {
                width: side,
                height: side,
                texels,
            }),
            wrap: [Wrap::Repeat; 2],
        })
    }
}

/// All parameters of a sampling.
#[derive(Clone, Debug)]
pub struct SamplingRequest {
    /// Number of points.
    pub amount: Amount,
    /// Arrangement.
    pub pattern: Pattern,
    /// Seed of all pseudorandom numbers.
    pub seed: u64,
    /// Radii.
    pub radii: Radii,
    /// Colours.
    pub acquisition: Acquisition,
    /// Picture of the colours.
    pub picture: Picture,
    /// Radial index at which kernels are cut when they are drawn, above 0.
    pub cutoff: f64,
}

/// Points of a surface.
#[derive(Clone, Debug)]
pub struct Sampled {
    /// Colours may be outside [0, 1] if they were solved for.
    pub splats: Vec<Splat>,
    /// World units squared.
    pub area: f64,
    /// Least distance between two points of a blue-noise pattern, world units.
    pub spacing: Option<f64>,
    /// Residuals of the colours that were solved for.
    pub solution: Option<Solution>,
    /// Points whose colour is outside [0, 1].
    pub beyond: usize,
    /// Greatest excess.
    pub most_beyond: f64,
    /// Notes, one sentence each.
    pub notes: Vec<String>,
}

/// Samples a mesh. The error is the second half of a sentence that begins with the mesh's name.
pub fn sample(mesh: &Mesh, request: &SamplingRequest) -> Result<Sampled, String> {
    let surface = Surface::of(mesh);
    let area = surface.area();
    let count = count(request.amount, area)?;
    let typical = (area / count as f64).sqrt();
    let farthest = surface.farthest();
    if !(typical.is_normal() && typical >= LEAST_SPACING * farthest) {
        return Err(format!(
            "has an area of {area:.3e}, so {} points would lie {typical:.3e} apart, which cannot be resolved at {farthest:.3e} from the origin",
            thousands(count as u64)
        ));
    }
    let (sites, spacing) = match request.pattern {
        Pattern::BlueNoise => {
            let (sites, spacing) = pattern::blue_noise(&surface, count, request.seed);
            (sites, Some(spacing))
        }
        Pattern::Stratified => (pattern::stratified(&surface, count, request.seed), None),
    };
    let mut splats: Vec<Splat> = sites.par_iter().map(|site| surface.splat(site)).collect();
    let faces: Vec<_> = sites
        .par_iter()
        .map(|site| mesh.triangles[site.triangle as usize].face())
        .collect();
    let wider = if request.pattern == Pattern::Stratified {
        OF_STRATA
    } else {
        1.0
    };
    match request.radii {
        Radii::Area => splats
            .iter_mut()
            .for_each(|splat| splat.radius = wider * OF_AREA * typical),
        Radii::Neighbours => {
            radii::from_neighbours(&mut splats, &faces, typical, wider * OF_NEIGHBOURS)
        }
    }
    let colours = texture::Acquired::of(mesh, &sites, &splats, &faces, request)?;
    for (splat, rgb) in splats.iter_mut().zip(&colours.rgba) {
        let [r, g, b, opacity] = *rgb;
        (splat.rgb, splat.opacity) = ([r, g, b], opacity);
    }
    let beyond = |splat: &Splat| {
        splat
            .rgb
            .iter()
            .map(|c| (c - 1.0).max(-c))
            .fold(0.0, f64::max)
    };
    // Differences below one ulp of f32, the format of colours in files, are not an excess.
    let excess: Vec<f64> = splats
        .iter()
        .map(beyond)
        .filter(|excess| *excess > f32::EPSILON as f64)
        .collect();
    Ok(Sampled {
        area,
        spacing,
        solution: colours.solution,
        beyond: excess.len(),
        most_beyond: excess.into_iter().fold(0.0, f64::max),
        notes: colours.notes,
        splats,
    })
}

fn count(amount: Amount, area: f64) -> Result<usize, String> {
    let count = match amount {
        Amount::Points(count) => count as f64,
        Amount::Density(density) => (density * area).round().max(1.0),
    };
    if !(1.0..=u32::MAX as f64).contains(&count) {
        return Err(format!(
            "would have {count} points; from 1 to {} can be made",
            u32::MAX
        ));
    }
    memory::check(count as u64, "points", POINT_BYTES)?;
    Ok(count as usize)
}

#[cfg(test)]
mod tests;

//! Texture: gives points the colours of a picture (texture acquisition, SS §5 and Appendix A).
//! ```text
//! texel i: a Gaussian n_i around its middle ──► t, affine for each triangle ──► n_i∘t⁻¹ on the surface ─┐
//! point k: its kernel r_k, a Gaussian in the tangent plane ─────────────────────────────────────────────┴─► ⟨r_k, n_i∘t⁻¹⟩
//! ```
//! - nearest: w_k = c_i of the texel at the point.
//! - EWA, independent of any view: w_k = Σ_i c_i ⟨r_k, n_i∘t⁻¹⟩, with the sum of products
//!   normalised to 1.
//! - optimised: R w = c with R_kj = ⟨r_k, r_j⟩ ([`super::solve`]).
//!
//! r_k has the width of the drawn splat, which a renderer cuts at the scene's cutoff
//! ([`super::gaussian::cut`]). Where a kernel extends past its triangle, t is extrapolated: across
//! a seam of the texture it reads the neighbouring texels of the picture.

use super::gaussian::cut;
use super::solve::{Matrix, Solution};
use super::surface::Site;
use super::{Acquisition, Picture, SamplingRequest};
use crate::scene::Splat;
use crate::scene::mesh::{Alpha, Image, Material, Mesh, Texture, Triangle, Wrap};
use glam::{DMat2, DVec2, DVec3};
use rayon::prelude::*;
use std::sync::OnceLock;

/// Variance of a texel's Gaussian, texels squared: that of the square of a texel.
const TEXEL: f64 = 1.0 / 12.0;
/// Radial index of the farthest texels under a kernel: e^(−4.5) = 1.1 % of the weight is beyond.
const REACH: f64 = 9.0;
/// Greatest number of texels under one kernel; wider kernels use a higher level of the pyramid,
/// with a quarter of the texels per level.
const MOST_TEXELS: f64 = 4096.0;

/// Colours and opacities of all points.
pub(super) struct Acquired {
    pub rgba: Vec<[f64; 4]>,
    pub solution: Option<Solution>,
    pub notes: Vec<String>,
}

impl Acquired {
    pub fn of(
        mesh: &Mesh,
        sites: &[Site],
        splats: &[Splat],
        faces: &[DVec3],
        request: &SamplingRequest,
    ) -> Result<Acquired, String> {
        let painting = Painting::of(mesh, &request.picture)?;
        let drawn = cut(request.cutoff);
        let colour = |(site, splat): (&Site, &Splat)| {
            painting.colour(site, drawn * splat.radius, request.acquisition)
        };
        let mut rgba: Vec<[f64; 4]> = sites.par_iter().zip(splats).map(colour).collect();
        let mut solution = None;
        if request.acquisition == Acquisition::Optimised {
            let places: Vec<DVec3> = splats.iter().map(|splat| splat.position).collect();
            let radii: Vec<f64> = splats.iter().map(|splat| drawn * splat.radius).collect();
            let matrix = Matrix::of(&places, faces, &radii)?;
            let averages: Vec<[f64; 3]> = rgba.iter().map(|&[r, g, b, _]| [r, g, b]).collect();
            let is_averaged: Vec<bool> = sites
                .iter()
                .map(|site| {
                    painting
                        .texture(&mesh.triangles[site.triangle as usize])
                        .is_some()
                })
                .collect();
            let (colours, found) =
                matrix.solve(&matrix.right_sides(&averages, &is_averaged), &averages);
            rgba.iter_mut()
                .zip(colours)
                .for_each(|(rgba, colour)| rgba[..3].copy_from_slice(&colour));
            solution = Some(found);
        }
        Ok(Acquired {
            rgba,
            solution,
            notes: painting.notes,
        })
    }
}

/// A mesh and its textures.
struct Painting<'a> {
    mesh: &'a Mesh,
    /// Whether one picture replaces all colours.
    is_covered: bool,
    pyramids: Vec<Pyramid<'a>>,
    notes: Vec<String>,
}

impl<'a> Painting<'a> {
    fn of(mesh: &'a Mesh, picture: &'a Picture) -> Result<Self, String> {
        let mut notes = Vec::new();
        let textures = match picture {
            Picture::Own => mesh.textures.iter().collect(),
            Picture::Texture(texture) => {
                let bare = mesh
                    .triangles
                    .iter()
                    .filter(|triangle| triangle.uv.is_none())
                    .count();
                if bare == mesh.triangles.len() {
                    return Err(
                        "has no texture coordinates, so no picture can be put onto it".into(),
                    );
                }
                if bare > 0 {
                    notes.push(format!(
                        "{bare} of {} triangles have no texture coordinates and keep their colours",
                        mesh.triangles.len()
                    ));
                }
                vec![texture]
            }
        };
        let pyramids = textures.into_iter().map(Pyramid::of).collect();
        Ok(Painting {
            mesh,
            is_covered: matches!(picture, Picture::Texture(_)),
            pyramids,
            notes,
        })
    }

    fn material(&self, triangle: &Triangle) -> &Material {
        &self.mesh.materials[triangle.material as usize]
    }

    /// The picture on a triangle, and the texture coordinates of its corners.
    fn texture(&self, triangle: &Triangle) -> Option<(&Pyramid<'a>, [DVec2; 3])> {
        let uv = triangle.uv?.map(|uv| DVec2::from_array(uv.map(f64::from)));
        let number = if self.is_covered {
            0
        } else {
            self.material(triangle).texture?
        };
        Some((&self.pyramids[number], uv))
    }

    /// Linear light and opacity of a point whose kernel has this radius.
    fn colour(&self, site: &Site, radius: f64, acquisition: Acquisition) -> [f64; 4] {
        let triangle = &self.mesh.triangles[site.triangle as usize];
        let material = self.material(triangle);
        let [_, v, w] = site.weights;
        // Corners with the same colour have that colour without any rounding of weights.
        let own = |c: usize| {
            let [p, q, r] = triangle.rgba.map(|rgba| rgba[c] as f64);
            (p + (q - p) * v + (r - p) * w) * material.rgba[c] as f64
        };
        let mut rgba: [f64; 4] = std::array::from_fn(own);
        if let Some((pyramid, uv)) = self.texture(triangle) {
            if self.is_covered {
                rgba[..3].fill(1.0);
            }
            let texel = pyramid.under(triangle, uv, site, radius, acquisition);
            rgba = std::array::from_fn(|c| rgba[c] * texel[c]);
        }
        let alpha: Alpha = material.alpha;
        [
            rgba[0].clamp(0.0, 1.0),
            rgba[1].clamp(0.0, 1.0),
            rgba[2].clamp(0.0, 1.0),
            alpha.of(rgba[3]),
        ]
    }
}

/// A picture and its halves, quarters and so on, each computed on first use.
struct Pyramid<'a> {
    texture: &'a Texture,
    halves: Vec<OnceLock<Level>>,
}

/// A picture of premultiplied linear light and opacity.
struct Level {
    width: usize,
    texels: Vec<[f32; 4]>,
}

impl<'a> Pyramid<'a> {
    fn of(texture: &'a Texture) -> Self {
        let Image { width, height, .. } = *texture.image;
        let halvings = usize::BITS - (width.max(height) - 1).leading_zeros();
        Pyramid {
            texture,
            halves: (0..halvings).map(|_| OnceLock::new()).collect(),
        }
    }

    fn size(&self, level: usize) -> [usize; 2] {
        let Image { width, height, .. } = *self.texture.image;
        [width, height].map(|side| side.div_ceil(1 << level))
    }

    fn texel(&self, level: usize, [column, row]: [usize; 2]) -> [f32; 4] {
        if level == 0 {
            let [r, g, b, alpha] = self.texture.image.linear(column, row);
            return [r * alpha, g * alpha, b * alpha, alpha];
        }
        let level = self.level(level);
        level.texels[row * level.width + column]
    }

    fn level(&self, level: usize) -> &Level {
        self.halves[level - 1].get_or_init(|| {
            let ([width, height], [wide, high]) = (self.size(level), self.size(level - 1));
            let mean = |place: usize| {
                let (column, row) = (place % width * 2, place / width * 2);
                let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| {
                    self.texel(
                        level - 1,
                        [(column + x).min(wide - 1), (row + y).min(high - 1)],
                    )
                });
                std::array::from_fn(|c| four.iter().map(|texel| texel[c]).sum::<f32>() / 4.0)
            };
            Level {
                width,
                texels: (0..width * height).map(mean).collect(),
            }
        })
    }

    /// Mean linear light and opacity under a kernel.
    fn under(
        &self,
        triangle: &Triangle,
        uv: [DVec2; 3],
        site: &Site,
        radius: f64,
        acquisition: Acquisition,
    ) -> [f64; 4] {
        let Image { width, height, .. } = *self.texture.image;
        let size = DVec2::new(width as f64, height as f64);
        let middle =
            (uv[0] * site.weights[0] + uv[1] * site.weights[1] + uv[2] * site.weights[2]) * size;
        if acquisition == Acquisition::Nearest {
            let [column, row] = self.index(0, middle.floor());
            return self.texture.image.linear(column, row).map(f64::from);
        }
        let to_texels = to_texture(triangle, uv.map(|uv| uv * size));
        let variance = to_texels * to_texels.transpose() * (radius * radius);
        self.average(middle, variance)
    }

    /// The mean of texels around a position of the picture, weighted by a Gaussian of this variance
    /// (texels squared) and by their opacities.
    fn average(&self, middle: DVec2, variance: DMat2) -> [f64; 4] {
        let own = DMat2::from_diagonal(DVec2::splat(TEXEL));
        let extent = |variance: DMat2| {
            DVec2::new(
                (REACH * variance.x_axis.x).sqrt(),
                (REACH * variance.y_axis.y).sqrt(),
            )
        };
        let count = |extent: DVec2| (2.0 * extent.x + 1.0) * (2.0 * extent.y + 1.0);
        let (mut level, mut scale) = (0, DVec2::ONE);
        let whole = self.size(0).map(|side| side as f64);
        let mut scaled = variance + own;
        while level < self.halves.len() && count(extent(scaled)) > MOST_TEXELS {
            level += 1;
            let size = self.size(level).map(|side| side as f64);
            scale = DVec2::new(size[0] / whole[0], size[1] / whole[1]);
            let shrink = DMat2::from_diagonal(scale);
            scaled = shrink * variance * shrink + own;
        }
        // At the top of the pyramid the picture is one texel, for any size of kernel.
        let texels = count(extent(scaled));
        if texels.is_nan() || texels > 4.0 * MOST_TEXELS {
            return straight(self.texel(level, [0, 0]).map(f64::from));
        }
        let (middle, extent, inverse) = (middle * scale, extent(scaled), scaled.inverse());
        let (low, high) = (
            (middle - extent - 0.5).ceil(),
            (middle + extent - 0.5).floor(),
        );
        let (mut sum, mut weights) = ([0.0; 4], 0.0);
        let mut row = low.y;
        while row <= high.y {
            let mut column = low.x;
            while column <= high.x {
                let d = DVec2::new(column + 0.5, row + 0.5) - middle;
                let radial = d.dot(inverse * d);
                if radial < REACH {
                    let weight = (-0.5 * radial).exp();
                    let texel = self.texel(level, self.index(level, DVec2::new(column, row)));
                    (0..4).for_each(|c| sum[c] += weight * texel[c] as f64);
                    weights += weight;
                }
                column += 1.0;
            }
            row += 1.0;
        }
        if weights > 0.0 {
            straight(sum.map(|c| c / weights))
        } else {
            straight(
                self.texel(level, self.index(level, middle.floor()))
                    .map(f64::from),
            )
        }
    }

    fn index(&self, level: usize, texel: DVec2) -> [usize; 2] {
        let [width, height] = self.size(level);
        let [across, down]: [Wrap; 2] = self.texture.wrap;
        [
            across.index(texel.x as i64, width),
            down.index(texel.y as i64, height),
        ]
    }
}

/// The linear part of t⁻¹, from a triangle's tangent plane to texels; its columns are the images of
/// the plane's two axes. The direction of the first axis does not matter for round kernels.
fn to_texture(triangle: &Triangle, uv: [DVec2; 3]) -> DMat2 {
    let [a, b, c] = triangle.corners;
    let x = (b - a).normalize();
    let y = triangle.face().cross(x);
    let flat = |corner: DVec3| DVec2::new((corner - a).dot(x), (corner - a).dot(y));
    DMat2::from_cols(uv[1] - uv[0], uv[2] - uv[0]) * DMat2::from_cols(flat(b), flat(c)).inverse()
}

fn straight([r, g, b, alpha]: [f64; 4]) -> [f64; 4] {
    if alpha > 0.0 {
        [r / alpha, g / alpha, b / alpha, alpha]
    } else {
        [0.0; 4]
    }
}

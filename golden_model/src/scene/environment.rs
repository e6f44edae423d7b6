//! Environment: light from all directions, from a picture or built-in, and its value for a
//! direction.
//!
//! A picture is latitude-longitude: twice as wide as high, its upper edge straight up (+y), its
//! middle column towards −z, +x a quarter of the width to the right of it.

use crate::output::colour::srgb_decode;
use glam::DVec3;
use image::{DynamicImage, ImageFormat, ImageReader, Limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};
use std::io::Cursor;

/// Longest side of a picture, texels.
const LONGEST_SIDE: u32 = 16384;
/// Most bytes that decoding may take.
const MOST_BYTES: u64 = 1 << 30;
/// Brightest light of a texel: what half floats hold.
const BRIGHTEST: f32 = 65504.0;

/// Built-in surroundings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BuiltinEnvironment {
    /// A blue sky that is lighter towards the horizon, a sun, and a brown ground.
    Sky,
}

/// Light from all directions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Environment {
    /// Texels per row.
    width: usize,
    /// Rows.
    height: usize,
    /// Linear light, row by row, row 0 straight up.
    texels: Vec<[f32; 3]>,
    /// Reflection of each material of the scene.
    pub mirrors: Vec<Mirror>,
}

/// Reflection of the surroundings by a material.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mirror {
    /// Share of the outgoing light that is reflected, 0 to 1; the rest is the material's own
    /// colour.
    pub reflect: f64,
    /// Factor on the reflected light, each channel in [0, 1].
    pub tint: [f64; 3],
}

impl Mirror {
    /// No reflection.
    pub const NONE: Mirror = Mirror {
        reflect: 0.0,
        tint: [1.0; 3],
    };
}

impl Environment {
    /// From texels row by row, twice as many columns as rows.
    ///
    /// # Errors
    /// The second half of a sentence that begins with the picture's name.
    fn new(width: usize, height: usize, texels: Vec<[f32; 3]>) -> Result<Self, String> {
        if width == 0 || width != 2 * height {
            return Err(format!(
                "has {width} × {height} texels; surroundings are latitude-longitude, all around by pole to pole: twice as wide as high"
            ));
        }
        if let Some(at) = texels
            .iter()
            .position(|texel| texel.iter().any(|light| !light.is_finite() || *light < 0.0))
        {
            let (row, column) = (at / width, at % width);
            return Err(format!(
                "has a texel in row {row}, column {column} that is not a finite light ≥ 0: {:?}",
                texels[at]
            ));
        }
        Ok(Environment {
            width,
            height,
            texels,
            mirrors: Vec::new(),
        })
    }

    /// Built-in surroundings.
    pub fn builtin(which: BuiltinEnvironment) -> Self {
        let BuiltinEnvironment::Sky = which;
        let (width, height) = (512, 256);
        let texel = |at: usize| {
            let (row, column) = ((at / width) as f64 + 0.5, (at % width) as f64 + 0.5);
            sky(direction([column / width as f64, row / height as f64])).map(|light| light as f32)
        };
        Environment {
            width,
            height,
            texels: (0..width * height).map(texel).collect(),
            mirrors: Vec::new(),
        }
    }

    /// Decodes a PNG (sRGB), a Radiance picture or an EXR (linear light), all of it times `scale`.
    ///
    /// # Errors
    /// The second half of a sentence that begins with the picture's name.
    pub fn decode(bytes: &[u8], scale: f64) -> Result<Self, String> {
        let known = |format: &ImageFormat| {
            matches!(
                format,
                ImageFormat::Png | ImageFormat::Hdr | ImageFormat::OpenExr
            )
        };
        let format = image::guess_format(bytes)
            .ok()
            .filter(known)
            .ok_or("is not a PNG, Radiance or EXR picture")?;
        let cannot = |error: image::ImageError| format!("cannot be decoded: {error}");
        let reader = || {
            let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
            let mut limits = Limits::default();
            (
                limits.max_image_width,
                limits.max_image_height,
                limits.max_alloc,
            ) = (Some(LONGEST_SIDE), Some(LONGEST_SIDE), Some(MOST_BYTES));
            reader.limits(limits);
            reader
        };
        // The header is checked before memory is allocated.
        let (width, height) = reader().into_dimensions().map_err(cannot)?;
        if width.max(height) > LONGEST_SIDE
            || u64::from(width) * u64::from(height) * 24 > MOST_BYTES
        {
            return Err(format!(
                "has {width} × {height} texels, more than can be read"
            ));
        }
        let picture = reader().decode().map_err(cannot)?;
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let encoded = !matches!(
            picture,
            DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_)
        );
        let light = |channel: f32| {
            let linear = if encoded {
                srgb_decode(f64::from(channel))
            } else {
                f64::from(channel)
            };
            let scaled = (linear * scale) as f32;
            if scaled.is_nan() {
                scaled
            } else {
                scaled.min(BRIGHTEST)
            }
        };
        let is_finite = picture
            .to_rgb32f()
            .pixels()
            .all(|texel| texel.0.iter().all(|light| light.is_finite()));
        let texels: Vec<[f32; 3]> = if is_finite {
            picture
                .to_rgb32f()
                .pixels()
                .map(|texel| texel.0.map(light))
                .collect()
        } else {
            picture.to_rgb32f().pixels().map(|texel| texel.0).collect()
        };
        Environment::new(width, height, texels)
    }

    /// Light from a direction of any length except 0, interpolated between the four nearest texels.
    pub fn light(&self, direction: DVec3) -> [f64; 3] {
        let [across, down] = place(direction);
        let (x, y) = (
            across * self.width as f64 - 0.5,
            (down * self.height as f64 - 0.5).clamp(0.0, self.height as f64 - 1.0),
        );
        let (left, above) = (
            x.floor(),
            y.floor().min((self.height as f64 - 2.0).max(0.0)),
        );
        let texel = |column: f64, row: f64| {
            let column = (column as i64).rem_euclid(self.width as i64) as usize;
            self.texels[(row as usize).min(self.height - 1) * self.width + column].map(f64::from)
        };
        let line = |row: f64| {
            let [from, to] = [texel(left, row), texel(left + 1.0, row)];
            std::array::from_fn::<f64, 3, _>(|i| from[i] + (to[i] - from[i]) * (x - left))
        };
        let [upper, lower] = [line(above), line(above + 1.0)];
        std::array::from_fn(|i| upper[i] + (lower[i] - upper[i]) * (y - above))
    }

    /// Whether a material of the scene reflects anything.
    pub fn is_seen(&self) -> bool {
        self.mirrors.iter().any(|mirror| mirror.reflect > 0.0)
    }

    /// Number of rows; there are twice as many columns.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Its whole content as bytes.
    pub(super) fn bytes(&self) -> impl Iterator<Item = u8> {
        let size = [self.width as u64, self.height as u64]
            .into_iter()
            .flat_map(u64::to_le_bytes);
        let mirrors = self
            .mirrors
            .iter()
            .flat_map(|mirror| [[mirror.reflect].as_slice(), &mirror.tint].concat())
            .flat_map(f64::to_le_bytes);
        size.chain(
            self.texels
                .as_flattened()
                .iter()
                .flat_map(|light| light.to_le_bytes()),
        )
        .chain(mirrors)
    }
}

/// Position of a direction in the picture, from its upper left corner, 0 to 1.
fn place(direction: DVec3) -> [f64; 2] {
    let unit = direction.normalize();
    // −z is at the centre, +x to the right of it.
    [
        0.5 + libm::atan2(unit.x, -unit.z) / TAU,
        libm::acos(unit.y.clamp(-1.0, 1.0)) / PI,
    ]
}

/// The direction at a position in the picture.
fn direction([across, down]: [f64; 2]) -> DVec3 {
    let (turn, from_top) = ((across - 0.5) * TAU, down * PI);
    let ring = libm::sin(from_top);
    DVec3::new(
        ring * libm::sin(turn),
        libm::cos(from_top),
        -ring * libm::cos(turn),
    )
}

/// The built-in sky.
fn sky(direction: DVec3) -> [f64; 3] {
    let mix = |from: [f64; 3], to: [f64; 3], part: f64| {
        [0, 1, 2].map(|i| from[i] + (to[i] - from[i]) * part)
    };
    let (horizon, zenith) = ([0.75, 0.82, 0.9], [0.1, 0.25, 0.6]);
    let (near_ground, far_ground) = ([0.22, 0.17, 0.12], [0.1, 0.08, 0.06]);
    let up = direction.y;
    if up < 0.0 {
        return mix(near_ground, far_ground, libm::sqrt(-up));
    }
    let sun = DVec3::new(0.5, 0.6, 0.6).normalize().dot(direction);
    // A disc of about 12 degrees with a soft rim, and a glow.
    let disc = ((sun - 0.994) / 0.003).clamp(0.0, 1.0);
    let glow = 0.4 * libm::pow(sun.max(0.0), 32.0);
    let sky = mix(horizon, zenith, libm::sqrt(up));
    mix(
        sky.map(|light| (light + glow).min(1.0)),
        [1.0, 0.97, 0.85],
        disc,
    )
}

#[cfg(test)]
mod tests;

//! Picture: the result of a renderer, and its file formats.

use std::path::Path;

use exr::image::SpecificChannels;
use exr::image::write::WritableImage;
use exr::math::Vec2;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::output::colour::{srgb_byte, srgb_decode, srgb_encode};
use crate::output::files::write_beside;

/// A finished picture: linear light, RGBA, colour premultiplied by alpha, over the background.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Picture {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row-major, row 0 on top.
    pub rgba: Vec<[f64; 4]>,
    /// Whether any splat made a fragment at the pixel, row-major.
    pub covered: Vec<bool>,
}

impl Picture {
    /// Writes an 8-bit PNG: sRGB-encoded, straight alpha.
    pub fn write_png(&self, path: &Path) -> Result<()> {
        let pixels: Vec<[u8; 4]> = self.rgba.par_iter().map(|pixel| encode(*pixel)).collect();
        let (width, height) = (self.width as u32, self.height as u32);
        write_beside(path, |file| {
            let png = PngEncoder::new(file);
            png.write_image(
                pixels.as_flattened(),
                width,
                height,
                ExtendedColorType::Rgba8,
            )
            .map_err(|error| error.to_string())
        })
    }

    /// As [`Picture::write_png`] for a picture whose colours may be `encoded`: values for a screen
    /// instead of linear light.
    pub fn write_shown(&self, encoded: bool, path: &Path) -> Result<()> {
        if encoded {
            self.decoded().write_png(path)
        } else {
            self.write_png(path)
        }
    }

    /// The picture with its colours interpreted as values for a screen: linear light that
    /// [`Picture::write_png`] encodes to exactly these values.
    pub fn decoded(&self) -> Picture {
        Picture {
            rgba: self.rgba.par_iter().map(|pixel| decode(*pixel)).collect(),
            covered: self.covered.clone(),
            ..*self
        }
    }

    /// Code values, 0 to 1, of a PNG with this many bits per channel (8 or 16), over black where
    /// the picture is not opaque. `encoded` as in [`Picture::write_shown`]. A pixel that is not
    /// finite is NaN.
    pub fn stored(&self, encoded: bool, bits: u32) -> Picture {
        let most = f64::from((1_u32 << bits) - 1);
        let code = |[r, g, b, alpha]: [f64; 4]| {
            let straight = |value: f64| {
                if alpha > 0.0 {
                    (value / alpha).clamp(0.0, 1.0)
                } else {
                    0.0
                }
            };
            let shown = |value: f64| {
                if encoded {
                    straight(value)
                } else {
                    srgb_encode(straight(value))
                }
            };
            [shown(r), shown(g), shown(b), alpha.clamp(0.0, 1.0)]
                .map(|value| (most * value).round())
        };
        let codes = |pixel: [f64; 4]| match bits {
            // Equal to the written bits.
            8 => encode(if encoded { decode(pixel) } else { pixel }).map(f64::from),
            _ => code(pixel),
        };
        let stored = |pixel: &[f64; 4]| {
            if pixel.iter().any(|channel| !channel.is_finite()) {
                return [f64::NAN; 4];
            }
            let [r, g, b, alpha] = codes(*pixel).map(|code| code / most);
            [r * alpha, g * alpha, b * alpha, 1.0]
        };
        Picture {
            rgba: self.rgba.par_iter().map(stored).collect(),
            covered: self.covered.clone(),
            ..*self
        }
    }

    /// Writes an OpenEXR file: float32, linear light, RGBA premultiplied over the background, row 0
    /// on top.
    pub fn write_exr(&self, path: &Path) -> Result<()> {
        let pixel = |at: Vec2<usize>| {
            let [r, g, b, a] = self.rgba[at.y() * self.width + at.x()].map(|value| value as f32);
            (r, g, b, a)
        };
        let image = exr::image::Image::from_channels(
            (self.width, self.height),
            SpecificChannels::rgba(pixel),
        );
        write_beside(path, |file| {
            image
                .write()
                .to_buffered(file)
                .map_err(|error| error.to_string())
        })
    }
}

/// Linear light of a pixel with values for a screen.
fn decode([r, g, b, alpha]: [f64; 4]) -> [f64; 4] {
    let light = |value: f64| {
        if alpha > 0.0 {
            srgb_decode((value / alpha).clamp(0.0, 1.0)) * alpha
        } else {
            0.0
        }
    };
    [light(r), light(g), light(b), alpha]
}

/// A pixel as a PNG holds it: colour no longer premultiplied, sRGB-encoded; alpha is linear.
fn encode([r, g, b, alpha]: [f64; 4]) -> [u8; 4] {
    let byte = |value: f64| (255.0 * value.clamp(0.0, 1.0)).round() as u8;
    let straight = |value: f64| {
        if alpha > 0.0 {
            (value / alpha).clamp(0.0, 1.0)
        } else {
            0.0
        }
    };
    let [r, g, b] = [r, g, b].map(|value| srgb_byte(straight(value)));
    [r, g, b, byte(alpha)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two rows of three pixels, with a colour that is only visible through alpha and one outside
    /// [0, 1].
    fn picture() -> Picture {
        let rgba = vec![
            [0.0, 0.0, 0.0, 0.0],
            [0.25, 0.125, 0.0, 0.5],
            [1.0, 1.0, 1.0, 1.0],
            [0.21404114, 0.0, 0.5, 1.0],
            [1.5, -0.5, 0.0, 0.8],
            [0.1, 0.2, 0.3, 1.0],
        ];
        Picture {
            width: 3,
            height: 2,
            rgba,
            covered: vec![true; 6],
        }
    }

    #[test]
    fn a_png_holds_straight_alpha_and_srgb() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        picture().write_png(&path).unwrap();
        let read = image::open(&path).unwrap().into_rgba8();
        assert_eq!(read.dimensions(), (3, 2));
        let pixels: Vec<[u8; 4]> = read.pixels().map(|pixel| pixel.0).collect();
        // sRGB of 0.5, 0.25, 0.21404114, 0.1, 0.2, 0.3: 187.5160, 136.9577, 127.5000, 89.0, 123.6,
        // 148.9 of 255.
        assert_eq!(pixels[0], [0, 0, 0, 0]);
        assert_eq!(pixels[1], [188, 137, 0, 128]);
        assert_eq!(pixels[2], [255, 255, 255, 255]);
        assert_eq!((pixels[3][1], pixels[3][2]), (0, 188));
        assert_eq!(pixels[4], [255, 0, 0, 204]);
        assert_eq!(pixels[5], [89, 124, 149, 255]);
    }

    #[test]
    fn code_values_equal_those_of_a_png() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        // With a value exactly between two codes, and colours that are already codes.
        let mut picture = picture();
        picture.rgba[3] = [127.5 / 255.0, 0.1, 0.9, 1.0];
        for encoded in [false, true] {
            picture.write_shown(encoded, &path).unwrap();
            let read = image::open(&path).unwrap().into_rgba8();
            for (stored, pixel) in picture.stored(encoded, 8).rgba.iter().zip(read.pixels()) {
                let [r, g, b, alpha] = pixel.0.map(|code| f64::from(code) / 255.0);
                assert_eq!(*stored, [r * alpha, g * alpha, b * alpha, 1.0]);
            }
        }
        // 0.1 is 0.349190 in sRGB, which is 22884.2 of 65535; encoded it is 6553.5.
        assert_eq!(picture.stored(false, 16).rgba[5][0], 22884.0 / 65535.0);
        assert_eq!(picture.stored(true, 16).rgba[5][0], 6554.0 / 65535.0);
        picture.rgba[0][3] = f64::INFINITY;
        assert!(
            picture.stored(false, 8).rgba[0]
                .iter()
                .all(|value| value.is_nan())
        );
    }

    #[test]
    fn an_exr_contains_the_values_of_the_picture() {
        use exr::prelude::{ReadChannels, ReadLayers};
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.exr");
        picture().write_exr(&path).unwrap();
        let read = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .rgba_channels(
                |size, _| (size.width(), vec![[0.0_f32; 4]; size.area()]),
                |(width, pixels), at, (r, g, b, a): (f32, f32, f32, f32)| {
                    pixels[at.y() * *width + at.x()] = [r, g, b, a]
                },
            )
            .first_valid_layer()
            .all_attributes()
            .from_file(&path)
            .unwrap();
        let (width, pixels) = read.layer_data.channel_data.pixels;
        let expected: Vec<[f32; 4]> = picture()
            .rgba
            .iter()
            .map(|pixel| pixel.map(|value| value as f32))
            .collect();
        assert_eq!((width, pixels), (3, expected));
    }

    #[test]
    fn a_picture_that_cannot_be_written_names_the_path() {
        let folder = tempfile::tempdir().unwrap();
        let nowhere = folder.path().join("absent").join("picture.exr");
        assert!(
            picture()
                .write_exr(&nowhere)
                .unwrap_err()
                .to_string()
                .contains("absent")
        );
    }
}

//! Picture: decodes a texture's PNG or JPEG, within limits, and maps coordinates to texels.

use super::Parsed;
use crate::output::colour::srgb_decode;
use ::image::{ImageFormat, ImageReader, Limits};
use std::io::Cursor;
use std::sync::{Arc, LazyLock};

/// Longest side of a texture, texels.
const LONGEST_SIDE: u32 = 16384;
/// Most bytes that decoding may take.
const MOST_BYTES: u64 = 1 << 30;

/// Linear light of the 256 codes of a byte.
static LINEAR: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|code| srgb_decode(code as f64 / 255.0) as f32));

/// A picture: 8 bits per channel, sRGB-encoded colours and straight, linear opacity.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Texels per row, at least 1.
    pub width: usize,
    /// Rows, at least 1.
    pub height: usize,
    /// Row-major, row 0 on top.
    pub texels: Vec<[u8; 4]>,
}

/// A reader of a PNG or JPEG.
fn reader(bytes: &[u8]) -> Parsed<ImageReader<Cursor<&[u8]>>> {
    let format = ::image::guess_format(bytes)
        .ok()
        .filter(|format| matches!(format, ImageFormat::Png | ImageFormat::Jpeg));
    let mut reader = ImageReader::with_format(
        Cursor::new(bytes),
        format.ok_or("is not a PNG or JPEG picture")?,
    );
    let mut limits = Limits::default();
    (
        limits.max_image_width,
        limits.max_image_height,
        limits.max_alloc,
    ) = (Some(LONGEST_SIDE), Some(LONGEST_SIDE), Some(MOST_BYTES));
    reader.limits(limits);
    Ok(reader)
}

fn cannot(error: ::image::ImageError) -> String {
    format!("cannot be decoded: {error}")
}

impl Image {
    /// Number of texels in the header of a PNG or JPEG.
    ///
    /// # Errors
    /// The second half of a sentence that begins with the picture's name.
    pub fn texels(bytes: &[u8]) -> Parsed<u64> {
        let (width, height) = reader(bytes)?.into_dimensions().map_err(cannot)?;
        Ok(width as u64 * height as u64)
    }

    /// Decodes a PNG or JPEG.
    ///
    /// # Errors
    /// The second half of a sentence that begins with the picture's name.
    pub fn decode(bytes: &[u8]) -> Parsed<Image> {
        let picture = reader(bytes)?.decode().map_err(cannot)?.into_rgba8();
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        if width == 0 || height == 0 {
            return Err("has no texels".into());
        }
        Ok(Image {
            width,
            height,
            texels: picture.pixels().map(|texel| texel.0).collect(),
        })
    }

    /// Linear light and opacity of a texel.
    pub fn linear(&self, column: usize, row: usize) -> [f32; 4] {
        let [r, g, b, alpha] = self.texels[row * self.width + column];
        let light = |code: u8| LINEAR[code as usize];
        [light(r), light(g), light(b), alpha as f32 / 255.0]
    }
}

/// Continuation of a picture beyond its border.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// Repeated.
    Repeat,
    /// Repeated, every other copy mirrored.
    Mirror,
    /// The last texel.
    Clamp,
}

impl Wrap {
    /// Index of the texel at a place of a row of `count`.
    pub fn index(self, place: i64, count: usize) -> usize {
        let count = count as i64;
        let index = match self {
            Wrap::Repeat => place.rem_euclid(count),
            Wrap::Clamp => place.clamp(0, count - 1),
            Wrap::Mirror => {
                let within = place.rem_euclid(2 * count);
                within.min(2 * count - 1 - within)
            }
        };
        index as usize
    }
}

/// A picture on a surface.
#[derive(Clone, Debug)]
pub struct Texture {
    /// Its texels, which materials may share.
    pub image: Arc<Image>,
    /// Continuation beyond its border, horizontal and vertical.
    pub wrap: [Wrap; 2],
}

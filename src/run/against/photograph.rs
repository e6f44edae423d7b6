//! Photograph: decodes a PNG or JPEG of 8 or 16 bits per channel to code values, over the
//! background of the scene.

use super::FrameView;
use crate::output::picture::Picture;
use crate::output::text::one_line;
use image::metadata::Orientation;
use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use std::io::Cursor;

/// Greatest number of bytes for decoding: the largest frame, 16384 × 16384 pixels, with 8 bytes per
/// pixel.
const MOST_BYTES: u64 = 1 << 31;

/// A photograph of a view.
#[derive(Clone, Debug)]
pub(super) struct Photograph {
    /// Its file, on one line.
    pub name: String,
    /// Bits per channel, 8 or 16.
    pub bits: u32,
    /// Code values from 0 to 1, opaque.
    pub picture: Picture,
    /// A pixel was not opaque.
    pub is_transparent: bool,
    /// Exif orientation (1 to 8), if viewers have to turn the picture.
    pub orientation: Option<u8>,
}

fn cannot(error: image::ImageError) -> String {
    format!("cannot be decoded: {error}")
}

impl Photograph {
    /// Decodes a file. `whose` is the frame that it belongs to.
    ///
    /// # Errors
    /// The second half of a sentence that begins with the file's name.
    pub fn decode(
        bytes: &[u8],
        name: String,
        view: &FrameView,
        whose: &str,
    ) -> Result<Self, String> {
        let known = |format: &ImageFormat| matches!(format, ImageFormat::Png | ImageFormat::Jpeg);
        let format = image::guess_format(bytes)
            .ok()
            .filter(known)
            .ok_or("is not a PNG or JPEG picture")?;
        let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
        let mut limits = Limits::default();
        limits.max_alloc = Some(MOST_BYTES);
        reader.limits(limits);
        let mut decoder = reader.into_decoder().map_err(cannot)?;
        // Checked before memory is allocated: the decoded picture has the size of the frame.
        let (width, height) = decoder.dimensions();
        if [width as usize, height as usize] != [view.width, view.height] {
            return Err(format!(
                "has {width}×{height} pixels, and {whose} is drawn with {}×{}: pictures of one size are compared; --size {width}x{height} \
                 draws at the photograph's",
                view.width, view.height
            ));
        }
        // The decoder of `image` fills in missing data.
        if format == ImageFormat::Jpeg && !ends(bytes) {
            return Err("cannot be decoded: the file ends before the picture does".into());
        }
        let orientation = decoder
            .orientation()
            .ok()
            .filter(|turn| *turn != Orientation::NoTransforms)
            .map(Orientation::to_exif);
        let decoded = DynamicImage::from_decoder(decoder).map_err(cannot)?;
        let bits = match decoded.color() {
            ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16 => 16,
            _ => 8,
        };
        let mut is_transparent = false;
        let mut over = |[r, g, b, alpha]: [f64; 4]| {
            is_transparent |= alpha < 1.0;
            let [back_r, back_g, back_b] = view.background.map(|back| back * (1.0 - alpha));
            [
                r * alpha + back_r,
                g * alpha + back_g,
                b * alpha + back_b,
                1.0,
            ]
        };
        let rgba: Vec<[f64; 4]> = if bits == 16 {
            decoded
                .into_rgba16()
                .pixels()
                .map(|pixel| over(pixel.0.map(|code| f64::from(code) / 65535.0)))
                .collect()
        } else {
            decoded
                .into_rgba8()
                .pixels()
                .map(|pixel| over(pixel.0.map(|code| f64::from(code) / 255.0)))
                .collect()
        };
        let covered = vec![true; rgba.len()];
        let picture = Picture {
            width: view.width,
            height: view.height,
            rgba,
            covered,
        };
        Ok(Photograph {
            name: one_line(&name),
            bits,
            picture,
            is_transparent,
            orientation,
        })
    }
}

/// Whether a JPEG has its end: a marker D9 after its segments and scans (ITU-T T.81, annex B).
fn ends(bytes: &[u8]) -> bool {
    // After the start of the image.
    let mut at = 2;
    while let Some(found) = bytes
        .get(at..)
        .and_then(|rest| rest.iter().position(|byte| *byte == 0xff))
    {
        at += found;
        let marker = bytes.get(at + 1).copied();
        match marker {
            Some(0xd9) => return true,
            // Fill bytes; the byte 0xff in a scan; restarts; markers without a length.
            Some(0xff) => at += 1,
            Some(0x00 | 0x01 | 0xd0..=0xd8) => at += 2,
            Some(_) => match bytes.get(at + 2..at + 4) {
                Some(&[high, low]) => at += 2 + usize::from(u16::from_be_bytes([high, low])).max(2),
                _ => return false,
            },
            None => return false,
        }
    }
    false
}

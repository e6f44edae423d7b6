//! Memory: estimates the memory of a scene before it is made, and of a frame before it is drawn,
//! because a failed allocation ends the process without a message.

use super::{Image, Scene, Splat};
use crate::error::Error;
use crate::input::memory::free;
use crate::output::text::{gigabytes, thousands};

/// Peak bytes of a `run` per disc or voxel: pictures, words, records and golden's own data (200,000
/// to 800,000 discs of `terrain` on 16×16 pixels, release build).
pub(super) const DISC_BYTES: u64 = 1_130;
/// Bytes per splat while a tree is built: its own node and at most one more above it, with their
/// sums.
pub(super) const NODE_BYTES: u64 = 1_100;
/// Bytes per Gaussian with an orientation and harmonics of degree 0 (`bouquet`).
pub(super) const GAUSSIAN_BYTES: u64 = 1_660;

/// Bytes of a splat's coefficients of harmonics, or of their words; none where it has a colour.
pub(super) fn harmonics_bytes(degree: u8) -> u64 {
    if degree == 0 {
        return 0;
    }
    let each = std::mem::size_of::<[f32; 3]>() as u64;
    each * (u64::from(degree) + 1).pow(2)
}

/// Bytes of a `run` per pixel: pictures, error measures and the frame's words. Files are encoded
/// from copies.
const PIXEL_BYTES: u64 = 220;

/// Bytes of a `run` in addition to the scene itself.
pub fn of_frame(scene: &Scene) -> u64 {
    let pixels = scene.image.width as u64 * scene.image.height as u64;
    let splat_bytes = if scene.ellipsoids.is_some() {
        GAUSSIAN_BYTES
    } else {
        DISC_BYTES
    };
    let harmonics = scene
        .ellipsoids
        .as_ref()
        .and_then(|ellipsoids| ellipsoids.harmonics.as_ref())
        .map_or(0, |harmonics| harmonics_bytes(harmonics.degree));
    let rest = splat_bytes + harmonics - std::mem::size_of::<Splat>() as u64;
    pixels
        .saturating_mul(PIXEL_BYTES)
        .saturating_add(rest.saturating_mul(scene.splats.len() as u64))
}

/// Refuses a frame that does not fit into memory.
///
/// # Errors
/// [`Error::Input`] with the needed and the free memory.
pub fn check_frame(scene: &Scene) -> Result<(), Error> {
    let Image { width, height, .. } = scene.image;
    let too_large = |sentence: String| {
        let splats = thousands(scene.splats.len() as u64);
        Error::input(format!(
            "{}: a frame of {width}×{height} pixels and {splats} splats is too large here: {sentence}",
            scene.name
        ))
    };
    crate::input::memory::check(of_frame(scene)).map_err(too_large)
}

/// Refuses more than the free memory; the error is the second half of a sentence.
pub(crate) fn check(count: u64, what: &str, bytes_each: u64) -> Result<(), String> {
    free().map_or(Ok(()), |free| check_against(free, count, what, bytes_each))
}

fn check_against(free: u64, count: u64, what: &str, bytes_each: u64) -> Result<(), String> {
    let needed = count.saturating_mul(bytes_each);
    if needed <= free {
        return Ok(());
    }
    Err(format!(
        "{} {what} would take about {} of memory, and {} are free",
        thousands(count),
        gigabytes(needed),
        gigabytes(free)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_refused_in_numbers() {
        assert_eq!(
            check_against(1_130_000, 1_000, "splats", DISC_BYTES),
            Ok(())
        );
        assert_eq!(
            check_against(8_000_000_000, 67_108_864, "Gaussians", GAUSSIAN_BYTES).unwrap_err(),
            "67,108,864 Gaussians would take about 111.4 GB of memory, and 8.0 GB are free"
        );
    }

    #[test]
    fn coefficients_of_harmonics_are_counted() {
        let bytes = |degree: u8| {
            let text = format!(
                r#"{{"splats": {{"gaussians": "city", "count": 10, "degree": {degree}}}}}"#
            );
            let folder = std::path::Path::new("");
            let overrides = crate::scene::Overrides {
                size: Some((16, 16)),
            };
            of_frame(&Scene::from_text(&text, "s.json", folder, &overrides, 0).unwrap())
        };
        // 4, 9 and 16 of three words of four bytes.
        assert_eq!(
            [1, 2, 3].map(|degree| bytes(degree) - bytes(0)),
            [480, 1080, 1920]
        );
    }
}

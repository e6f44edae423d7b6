//! Digest: names a text, or all that is drawn of a scene, by its SHA-256.

use super::{Ellipsoids, Orientation, Scene, Sheet, Sheets};
use crate::output::text::hex;
use sha2::{Digest, Sha256};

/// Hexadecimal digits of the first bytes of a SHA-256.
pub fn digest(text: &[u8]) -> String {
    hex(&Sha256::digest(text)[..12])
}

/// A digest of all that is drawn of a scene.
pub fn digest_of(scene: &Scene) -> String {
    let mut sha = Sha256::new();
    let Scene { camera, image, kernel, surface, lights, materials, .. } = scene;
    sha.update(format!("{camera:?}{image:?}{kernel:?}{surface:?}{lights:?}{materials:?}"));
    if let Some(Ellipsoids { orientations, amplitude, preshaded, sorted }) = &scene.ellipsoids {
        sha.update(format!("{amplitude:?}{preshaded}{sorted}"));
        for Orientation { rotation, scales } in orientations {
            let numbers = [rotation.to_array().as_slice(), scales.to_array().as_slice()].concat();
            numbers.iter().for_each(|number| sha.update(number.to_le_bytes()));
        }
    }
    if let Some(sheets) = &scene.sheets {
        let numbers: &[u32] = if let Sheet::Slice(numbers) = &sheets.of { numbers } else { &[] };
        numbers.iter().for_each(|number| sha.update(number.to_le_bytes()));
        let Sheets { back_to_front, opacity, stop, keeps_last, least_weight, most_weight, .. } = sheets;
        sha.update(format!("{back_to_front}{opacity:?}{stop}{keeps_last}{least_weight}{most_weight}"));
    }
    for splat in &scene.splats {
        let numbers = [splat.position.to_array(), splat.normal.to_array(), splat.rgb, [splat.radius, splat.opacity, splat.material.into()]];
        numbers.as_flattened().iter().for_each(|number| sha.update(number.to_le_bytes()));
    }
    hex(&sha.finalize())
}

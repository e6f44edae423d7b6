//! Digest: names a text, or all that is drawn of a scene, by its SHA-256.

use super::{Ellipsoids, Orientation, Scene, Sheet, Sheets, Splat};
use crate::output::text::hex;
use sha2::{Digest, Sha256};

/// Hexadecimal digits of the first bytes of a SHA-256.
pub fn digest(text: &[u8]) -> String {
    hex(&Sha256::digest(text)[..12])
}

/// A digest of all that is drawn of a scene.
pub fn digest_of(scene: &Scene) -> String {
    // Every field by its name, here and below: one that is new must be dealt with.
    let Scene {
        // What it is called, and what readers found odd, draws nothing.
        name: _,
        notes: _,
        splats,
        camera,
        image,
        kernel,
        ellipsoids,
        sheets,
        surface,
        lights,
        materials,
    } = scene;
    let mut sha = Sha256::new();
    sha.update(format!("{camera:?}{image:?}{kernel:?}{surface:?}{lights:?}{materials:?}"));
    if let Some(Ellipsoids { orientations, amplitude, preshaded, sorted, harmonics }) = ellipsoids {
        sha.update(format!("{amplitude:?}{preshaded}{sorted}"));
        // It changes no picture, but what is read.
        if *harmonics > 0 {
            sha.update([*harmonics]);
        }
        for Orientation { rotation, scales } in orientations {
            add(&mut sha, &[rotation.to_array().as_slice(), scales.to_array().as_slice()].concat());
        }
    }
    if let Some(Sheets { of, back_to_front, opacity, stop, keeps_last, least_weight, most_weight }) = sheets {
        let numbers: &[u32] = if let Sheet::Slice(numbers) = of { numbers } else { &[] };
        numbers.iter().for_each(|number| sha.update(number.to_le_bytes()));
        sha.update(format!("{back_to_front}{opacity:?}{stop}{keeps_last}{least_weight}{most_weight}"));
    }
    for Splat { position, normal, radius, rgb, opacity, material } in splats {
        let numbers = [position.to_array(), normal.to_array(), *rgb, [*radius, *opacity, (*material).into()]];
        add(&mut sha, numbers.as_flattened());
    }
    hex(&sha.finalize())
}

fn add(sha: &mut Sha256, numbers: &[f64]) {
    numbers.iter().for_each(|number| sha.update(number.to_le_bytes()));
}

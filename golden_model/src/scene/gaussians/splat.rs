//! Splat: reads Gaussians from `.splat` files, which have only 32 bytes per Gaussian
//! (antimatter15's viewer).
//! ```text
//! position: 3 × f32   scale: 3 × f32   red green blue opacity: 4 × u8   quaternion w x y z: 4 × u8, 128 is 0
//! ```
//! Little-endian. Scales are linear; the colour is the same from all directions.

use super::{Gaussian, Gaussians, Intake, Parsed, harmonics_of, part};
use glam::{DQuat, DVec3};

const BYTES: usize = 32;

pub(in crate::scene) fn parse(bytes: &[u8]) -> Parsed<Gaussians> {
    let (records, surplus) = bytes.as_chunks::<BYTES>();
    if !surplus.is_empty() {
        return Err(format!(
            "has {} bytes; a .splat file has {BYTES} for each Gaussian, so it is truncated or another format",
            bytes.len()
        ));
    }
    let mut intake = Intake::new(0, records.len(), Vec::new());
    for record in records {
        let floats = record.as_chunks().0;
        let float = |i: usize| f64::from(f32::from_le_bytes(floats[i]));
        let [red, green, blue, opacity] = floats[6].map(part);
        let [w, x, y, z] = floats[7].map(|code| (f64::from(code) - 128.0) / 128.0);
        let raw = Gaussian {
            position: DVec3::new(float(0), float(1), float(2)),
            rotation: DQuat::from_xyzw(x, y, z, w),
            scale: DVec3::new(float(3), float(4), float(5)),
            opacity,
        };
        intake.push(raw, [harmonics_of([red, green, blue])]);
    }
    intake.finish()
}

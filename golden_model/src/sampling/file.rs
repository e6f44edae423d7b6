//! File: writes points as a PLY that can be read as a scene (docs/book/scenes.md): binary,
//! positions in f64, all other values in f32.

use crate::error::Result;
use crate::output::files::write_beside;
use crate::scene::Splat;
use std::io::Write;
use std::path::Path;

/// Properties after the position, each a float.
const PROPERTIES: [&str; 8] = ["nx", "ny", "nz", "red", "green", "blue", "alpha", "radius"];

/// Bytes of a PLY: colours are linear light without clamping, also outside [0, 1].
pub fn ply(splats: &[Splat]) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\ncomment points of a mesh, by splatsim sample; colours are linear light\nelement vertex {}\n",
        splats.len()
    )
    .into_bytes();
    bytes.extend(
        ["x", "y", "z"]
            .iter()
            .flat_map(|name| format!("property double {name}\n").into_bytes()),
    );
    bytes.extend(
        PROPERTIES
            .iter()
            .flat_map(|name| format!("property float {name}\n").into_bytes()),
    );
    bytes.extend(b"end_header\n");
    for splat in splats {
        bytes.extend(
            splat
                .position
                .to_array()
                .iter()
                .flat_map(|c| c.to_le_bytes()),
        );
        let floats = splat
            .normal
            .to_array()
            .into_iter()
            .chain(splat.rgb)
            .chain([splat.opacity, splat.radius]);
        bytes.extend(floats.flat_map(|c| (c as f32).to_le_bytes()));
    }
    bytes
}

/// Writes points into a file; returns its number of bytes.
///
/// # Errors
/// [`crate::error::Error::Job`] if the file cannot be written.
pub fn write(path: &Path, splats: &[Splat]) -> Result<usize> {
    let bytes = ply(splats);
    write_beside(path, |file| {
        file.write_all(&bytes).map_err(|e| e.to_string())
    })?;
    Ok(bytes.len())
}

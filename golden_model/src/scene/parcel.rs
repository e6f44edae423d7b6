//! Parcel: encodes a scene as bytes, for another process that cannot read its files.
//!
//! ```text
//! Scene ─► "splatsim-scene VERSION\n", digest, postcard ─► Scene
//! ```
//! A scene is encoded after reading: nothing is fitted or built again. Only the same version
//! decodes it.
//!
//! Laws (tests/parcel.rs): `what_is_unpacked_is_what_was_packed`, `no_damage_is_taken_for_a_scene`.

use super::Scene;
use super::digest::digest_of;
use crate::error::{Error, Result};

/// Beginning of every parcel.
const MAGIC: &str = concat!("splatsim-scene ", env!("CARGO_PKG_VERSION"), "\n");

/// Encodes a scene.
///
/// # Errors
/// [`Error::Job`] if there is not enough memory.
pub fn packed(scene: &Scene) -> Result<Vec<u8>> {
    postcard::to_extend(&(digest_of(scene), scene), MAGIC.as_bytes().to_vec())
        .map_err(|error| Error::job(error.to_string()))
}

/// Decodes a scene.
///
/// # Errors
/// [`Error::Input`], one sentence, if it was encoded by another version or is damaged.
pub fn unpacked(bytes: &[u8]) -> Result<Scene> {
    let version = env!("CARGO_PKG_VERSION");
    let packed_by = || {
        Error::input(format!(
            "the scene was packed by another version of splatsim than {version}"
        ))
    };
    let rest = bytes.strip_prefix(MAGIC.as_bytes()).ok_or_else(packed_by)?;
    let damaged = || Error::input("the packed scene is damaged");
    let (digest, scene): (String, Scene) = postcard::from_bytes(rest).map_err(|_| damaged())?;
    if digest == digest_of(&scene) {
        Ok(scene)
    } else {
        Err(damaged())
    }
}

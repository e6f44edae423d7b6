//! Parcel: makes bytes of a scene, for another process that cannot read its files.
//!
//! ```text
//! Scene ─► "splatsim-scene VERSION\n", digest, postcard ─► Scene
//! ```
//! A scene travels as it was read: what readers fit or build is not done again. Only the version
//! that packed it unpacks it.
//!
//! Laws (tests/parcel.rs): `what_is_unpacked_is_what_was_packed`, `no_damage_is_taken_for_a_scene`.

use super::Scene;
use super::digest::digest_of;
use crate::error::{Error, Result};

/// Beginning of every parcel.
const MAGIC: &str = concat!("splatsim-scene ", env!("CARGO_PKG_VERSION"), "\n");

/// A scene as bytes.
///
/// # Errors
/// [`Error::Job`] where there is no memory for them.
pub fn packed(scene: &Scene) -> Result<Vec<u8>> {
    postcard::to_extend(&(digest_of(scene), scene), MAGIC.as_bytes().to_vec())
        .map_err(|error| Error::job(error.to_string()))
}

/// The scene of some bytes.
///
/// # Errors
/// [`Error::Input`], one sentence, where another version has packed it, or it is damaged.
pub fn unpacked(bytes: &[u8]) -> Result<Scene> {
    let version = env!("CARGO_PKG_VERSION");
    let packed_by = || {
        Error::input(format!(
            "the scene was packed by another version of splatsim than {version}, which is here"
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

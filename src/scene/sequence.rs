//! Sequence: a scene seen by one camera after the other.
//!
//! The world stays as it is while the eye moves: what a scene leaves out (normals, their signs, the
//! light) is chosen for the first camera. Surfaces are loaded once, and frames differ in the camera
//! alone. Volumes and Gaussians are ordered and coloured for the eye: they are read anew for each
//! frame.

use super::json::{Seen, Which};
use super::{Camera, CameraFile, Overrides, Scene};
use crate::error::Result;
use std::ffi::{OsStr, OsString};

/// A scene and its cameras, one a frame.
#[derive(Clone, Debug)]
pub struct Sequence {
    name_or_path: OsString,
    overrides: Overrides,
    file: Option<CameraFile>,
    cameras: Vec<Camera>,
    is_sequence: bool,
    shares_splats: bool,
    /// As the frame that was asked for last shows it.
    scene: Scene,
}

impl Sequence {
    /// Reads a scene as [`Scene::load`] does, and all its cameras; or those of a file in their
    /// place.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] as [`Scene::load`].
    pub fn load(
        name_or_path: impl AsRef<OsStr>,
        overrides: &Overrides,
        file: Option<CameraFile>,
    ) -> Result<Self> {
        let name_or_path = name_or_path.as_ref().to_owned();
        let which = Which {
            frame: 0,
            cameras: file.as_ref(),
        };
        let Seen {
            scene,
            cameras,
            is_sequence,
            shares_splats,
        } = Scene::seen(&name_or_path, overrides, which)?;
        Ok(Sequence {
            name_or_path,
            overrides: *overrides,
            file,
            cameras,
            is_sequence,
            shares_splats,
            scene,
        })
    }

    /// Whether it was written as one, be it of one frame: with `cameras`, a `camera_path` or a file
    /// of cameras.
    pub fn is_sequence(&self) -> bool {
        self.is_sequence
    }

    /// The camera of each frame; never empty.
    pub fn cameras(&self) -> &[Camera] {
        &self.cameras
    }

    /// The name of the picture that each camera took, as a file of cameras has it; none where
    /// nothing has it.
    pub fn pictures(&self) -> Vec<Option<&str>> {
        let named = self
            .file
            .as_ref()
            .map(CameraFile::pictures)
            .unwrap_or_default();
        if named.len() == self.cameras.len() {
            named
        } else {
            vec![None; self.cameras.len()]
        }
    }

    /// Whether frames differ in the camera alone, as those of surfaces do.
    pub fn shares_splats(&self) -> bool {
        self.shares_splats
    }

    /// The scene as the frame that was asked for last shows it: at first the first.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// That scene alone.
    pub fn into_scene(self) -> Scene {
        self.scene
    }

    /// The scene as a frame shows it.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] where there is no such frame, or where a file cannot be read
    /// a second time.
    pub fn frame(&mut self, frame: usize) -> Result<&Scene> {
        match self.cameras.get(frame) {
            Some(camera) if self.shares_splats => self.scene.camera = *camera,
            Some(camera) if self.scene.camera == *camera => {}
            _ => {
                self.scene = Scene::seen(
                    &self.name_or_path,
                    &self.overrides,
                    Which {
                        frame,
                        cameras: self.file.as_ref(),
                    },
                )?
                .scene
            }
        }
        Ok(&self.scene)
    }
}

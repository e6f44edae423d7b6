//! Sequence: a scene viewed by one camera after another.
//!
//! The world is fixed while the eye moves: missing data (normals, their signs, the light) are
//! chosen for the first camera. Surfaces are loaded once, and frames differ only in the camera.
//! Volumes and Gaussians depend on the eye in order and colour: they are read again for each frame.

use super::json::{FrameChoice, LoadedFrame};
use super::{Camera, CameraFile, Overrides, Scene};
use crate::error::Result;
use std::ffi::{OsStr, OsString};

/// A scene and its cameras, one per frame.
#[derive(Clone, Debug)]
pub struct Sequence {
    name_or_path: OsString,
    overrides: Overrides,
    file: Option<CameraFile>,
    cameras: Vec<Camera>,
    is_sequence: bool,
    shares_splats: bool,
    /// The frame that was requested last.
    scene: Scene,
}

impl Sequence {
    /// Reads a scene like [`Scene::load`], with all its cameras, or with those of a file.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] as [`Scene::load`].
    pub fn load(
        name_or_path: impl AsRef<OsStr>,
        overrides: &Overrides,
        file: Option<CameraFile>,
    ) -> Result<Self> {
        let name_or_path = name_or_path.as_ref().to_owned();
        let which = FrameChoice {
            frame: 0,
            cameras: file.as_ref(),
        };
        let LoadedFrame {
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

    /// Whether it was defined as a sequence, even of one frame: with `cameras`, a `camera_path` or
    /// a file of cameras.
    pub fn is_sequence(&self) -> bool {
        self.is_sequence
    }

    /// The camera of each frame; never empty.
    pub fn cameras(&self) -> &[Camera] {
        &self.cameras
    }

    /// The name of the picture of each camera, as in a file of cameras; None if there is none.
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

    /// Whether frames differ only in the camera, like those of surfaces.
    pub fn shares_splats(&self) -> bool {
        self.shares_splats
    }

    /// The frame that was requested last; initially the first.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// That scene.
    pub fn into_scene(self) -> Scene {
        self.scene
    }

    /// The scene in a frame.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] if there is no such frame, or if a file cannot be read again.
    pub fn frame(&mut self, frame: usize) -> Result<&Scene> {
        match self.cameras.get(frame) {
            Some(camera) if self.shares_splats => self.scene.see(*camera, frame),
            Some(camera) if self.scene.camera == *camera => self.scene.see(*camera, frame),
            _ => {
                self.scene = Scene::seen(
                    &self.name_or_path,
                    &self.overrides,
                    FrameChoice {
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

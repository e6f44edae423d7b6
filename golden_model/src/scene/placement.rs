//! Placement: moves splats to another place: scales them about the origin, rotates them about it,
//! then translates them.
//!
//! Opacities do not change: a scaled object transmits as much light as before.

use super::{Orientation, Splat};
use glam::{DQuat, DVec3};

/// Maps a source's own coordinates to the scene's.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// Above 0.
    pub scale: f64,
    /// Unit quaternion.
    pub turn: DQuat,
    /// World units.
    pub way: DVec3,
}

impl Placement {
    /// The identity.
    pub const NONE: Placement = Placement {
        scale: 1.0,
        turn: DQuat::IDENTITY,
        way: DVec3::ZERO,
    };

    /// Transforms a position.
    pub fn point(&self, point: DVec3) -> DVec3 {
        self.vector(point) + self.way
    }

    /// Transforms a vector between two positions.
    pub fn vector(&self, way: DVec3) -> DVec3 {
        self.turn * (way * self.scale)
    }

    /// Transforms a splat; a missing radius or normal (0) is not changed.
    pub fn put(&self, splat: &mut Splat) {
        splat.position = self.point(splat.position);
        splat.normal = super::unit(self.turn * splat.normal).unwrap_or(DVec3::ZERO);
        splat.radius *= self.scale;
    }

    /// Rotates the axes of a kernel.
    pub fn turn(&self, orientation: &mut Orientation) {
        orientation.rotation = (self.turn * orientation.rotation).normalize();
    }

    /// This placement after another one.
    pub fn after(&self, first: &Placement) -> Placement {
        Placement {
            scale: self.scale * first.scale,
            turn: self.turn * first.turn,
            way: self.point(first.way),
        }
    }
}

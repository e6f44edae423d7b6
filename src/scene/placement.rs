//! Placement: brings splats to another place: made larger about the origin, then turned about it,
//! then moved.
//!
//! Opacities stay: what is made larger lets as much light through as before.

use super::{Orientation, Splat};
use glam::{DQuat, DVec3};

/// From a source's own coordinates to the scene's.
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
    /// Where nothing is changed.
    pub const NONE: Placement = Placement {
        scale: 1.0,
        turn: DQuat::IDENTITY,
        way: DVec3::ZERO,
    };

    /// A place, brought there.
    pub fn point(&self, point: DVec3) -> DVec3 {
        self.vector(point) + self.way
    }

    /// A way, from one place to another.
    pub fn vector(&self, way: DVec3) -> DVec3 {
        self.turn * (way * self.scale)
    }

    /// A splat; what it has not got yet, a radius or a normal of 0, stays so.
    pub fn put(&self, splat: &mut Splat) {
        splat.position = self.point(splat.position);
        splat.normal = super::unit(self.turn * splat.normal).unwrap_or(DVec3::ZERO);
        splat.radius *= self.scale;
    }

    /// Axes of a kernel.
    pub fn turn(&self, orientation: &mut Orientation) {
        orientation.rotation = (self.turn * orientation.rotation).normalize();
    }

    /// This one after another.
    pub fn after(&self, first: &Placement) -> Placement {
        Placement {
            scale: self.scale * first.scale,
            turn: self.turn * first.turn,
            way: self.point(first.way),
        }
    }
}

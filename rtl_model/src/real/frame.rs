//! Inputs of the machine over the reals: the exact number of each register and record, and its
//! word.

use crate::frame::Amplitude;

/// One splat, in machine units.
#[derive(Clone, Copy, Debug)]
pub struct Splat<R> {
    /// Centre.
    pub position: [R; 3],
    /// Normal, world axes.
    pub normal: [R; 3],
    /// σ.
    pub radius: R,
    /// Colour.
    pub rgb: [R; 3],
    /// α.
    pub opacity: R,
    /// Whether the machine turns the normal towards the viewer, if its decisions are followed; else
    /// each side decides separately.
    pub turned: Option<bool>,
}

/// The viewing registers, in machine units and pixels.
#[derive(Clone, Copy, Debug)]
pub struct View<R> {
    /// Rows right, down, forward.
    pub rotation: [[R; 3]; 3],
    /// The eye.
    pub eye: [R; 3],
    /// Depth at or below which splats are culled.
    pub near: R,
    /// Greatest |a| and |b|.
    pub guard: [R; 2],
    /// s; where pixels are not square, the larger of both.
    pub focal: R,
    /// s_x, s_y.
    pub focals: [R; 2],
    /// 1/s_x, 1/s_y.
    pub inverse_focals: [R; 2],
    /// Principal point from the picture's middle, pixels.
    pub centre: [R; 2],
    /// s_x², s_x·s_y and s_y², relative to s²; none if pixels are square.
    pub aspect: Option<[R; 3]>,
    /// Variance of the low-pass filter.
    pub low_pass: R,
    /// Cutoff.
    pub cutoff: R,
    /// √cutoff.
    pub root_cutoff: R,
    /// 1/2π.
    pub inverse_two_pi: R,
}

/// Axes of an ellipsoid.
#[derive(Clone, Copy, Debug)]
pub struct Ellipsoid<R> {
    /// Meaning of its amplitude.
    pub amplitude: Amplitude,
    /// Greatest |a| and |b| in the Jacobian.
    pub jacobian: [R; 2],
    /// Cutoff of its box.
    pub cutoff: R,
    /// 1/σ, if weights fall with depth.
    pub inverse_distance: Option<R>,
    /// Its axes.
    pub orientation: Orientation<R>,
}

/// Principal axes, and standard deviations relative to σ.
#[derive(Clone, Copy, Debug)]
pub enum Orientation<R> {
    /// The splat's own.
    Own {
        /// w, x, y, z.
        quaternion: [R; 4],
        /// Along each axis.
        scales: [R; 3],
    },
    /// The frame's, in camera space.
    Frame {
        /// Unit vectors.
        axes: [[R; 3]; 3],
        /// Along each axis.
        scales: [R; 3],
    },
}

//! Path: computes the camera of every frame between key frames, or of a slow pan.
//!
//! ```text
//! keys (frame, camera) ─► smooth: cubic Hermite by Catmull and Rom's slopes ─┬─► one camera per frame, checked
//!                      └► linear ────────────────────────────────────────────┘
//! ```

use super::json::{Interpolation, KeyedFields, PanFields};
use super::{Camera, Image};
use glam::DVec3;

/// Most frames of a sequence: names of their pictures have four digits.
pub const MOST_FRAMES: usize = 10_000;
/// The last frame of the longest sequence, counted from 0.
pub(super) const LAST_FRAME: usize = MOST_FRAMES - 1;
/// Least angle of view of a scene file, degrees.
const LEAST_FOV_DEGREES: f64 = 1e-6;

/// Eye, target, up and angle of view.
type Numbers = [f64; 10];

fn numbers(camera: &Camera) -> Numbers {
    let [[a, b, c], [d, e, f], [g, h, i]] =
        [camera.eye, camera.target, camera.up].map(|vector| vector.to_array());
    [a, b, c, d, e, f, g, h, i, camera.fov_y_degrees]
}

impl KeyedFields {
    /// Checks that the frames of keys ascend.
    pub fn check(&self) -> Result<(), String> {
        let pairs = self.keys.iter().zip(&self.keys[1..]).enumerate();
        match pairs.into_iter().find(|(_, (a, b))| a.at >= b.at) {
            Some((i, (a, b))) => Err(format!(
                "camera_path.keys[{}].at is {}, which is not above the {} before it",
                i + 1,
                b.at,
                a.at
            )),
            None => Ok(()),
        }
    }

    /// The camera of every frame.
    ///
    /// # Errors
    /// A sentence if a camera between two keys is invalid: eye at the target, up along the view, or
    /// an angle out of range.
    pub fn cameras(&self, keys: &[(usize, Camera)]) -> Result<Vec<Camera>, String> {
        let last = keys[keys.len() - 1].0;
        (0..self.frames.unwrap_or(last + 1))
            .map(|frame| self.camera(keys, frame))
            .collect()
    }

    fn camera(&self, keys: &[(usize, Camera)], frame: usize) -> Result<Camera, String> {
        let after = keys.partition_point(|(at, _)| *at <= frame);
        if after == 0 || after == keys.len() || keys[after - 1].0 == frame {
            return Ok(keys[after.saturating_sub(1)].1);
        }
        let [a, b] = [after - 1, after];
        let span = (keys[b].0 - keys[a].0) as f64;
        let part = (frame - keys[a].0) as f64 / span;
        let (from, to) = (numbers(&keys[a].1), numbers(&keys[b].1));
        let between: Numbers = match self.interpolation {
            Interpolation::Linear => std::array::from_fn(|i| from[i] + part * (to[i] - from[i])),
            Interpolation::Smooth => {
                let [leaves, arrives] = [slope(keys, a), slope(keys, b)];
                std::array::from_fn(|i| {
                    hermite(
                        [from[i], to[i]],
                        [span * leaves[i], span * arrives[i]],
                        part,
                    )
                })
            }
        };
        let [a1, a2, a3, b1, b2, b3, c1, c2, c3, fov_y_degrees] = between;
        let near = keys[a].1.near + part * (keys[b].1.near - keys[a].1.near);
        let up = DVec3::new(c1, c2, c3).normalize_or_zero();
        let camera = Camera {
            eye: DVec3::new(a1, a2, a3),
            target: DVec3::new(b1, b2, b3),
            up,
            fov_y_degrees,
            near,
            focal_px: None,
            centre_px: None,
            picture_px: None,
        };
        let begin = format!("camera_path at frame {frame}: ");
        camera.check(&begin, "")?;
        if !(LEAST_FOV_DEGREES..180.0).contains(&fov_y_degrees) {
            return Err(format!(
                "{begin}fov_y_degrees is {fov_y_degrees:.3}, and must be at least {LEAST_FOV_DEGREES:e} and less than 180; \
                 use keys nearer to each other, or linear interpolation"
            ));
        }
        Ok(camera)
    }
}

/// Change per frame at a key: from the key before to the one after; at an end from that to its
/// neighbour.
fn slope(keys: &[(usize, Camera)], at: usize) -> Numbers {
    let (before, after) = (at.saturating_sub(1), (at + 1).min(keys.len() - 1));
    let (from, to) = (numbers(&keys[before].1), numbers(&keys[after].1));
    std::array::from_fn(|i| (to[i] - from[i]) / (keys[after].0 - keys[before].0) as f64)
}

/// The cubic with these end values and slopes, over [0, 1].
fn hermite([from, to]: [f64; 2], [leaves, arrives]: [f64; 2], part: f64) -> f64 {
    let (square, cube) = (part * part, part * part * part);
    from + (3.0 * square - 2.0 * cube) * (to - from)
        + (cube - 2.0 * square + part) * leaves
        + (cube - square) * arrives
}

impl Camera {
    /// Rotated to the right about the eye, so that the centre of the picture moves `pixels` to the
    /// left.
    pub fn panned(&self, image: &Image, pixels: f64) -> Camera {
        let view = self.view(image);
        let [right, down, forward] = [
            view.rotation.row(0),
            view.rotation.row(1),
            view.rotation.row(2),
        ];
        // The tangent of the angle of rotation.
        let ahead = (forward + right * (pixels / view.focal_px[0])).normalize();
        // The picture's own up: with another one the view would roll.
        Camera {
            target: self.eye + ahead * (self.target - self.eye).length(),
            up: -down,
            ..*self
        }
    }
}

impl PanFields {
    /// The camera of every frame: in frame k the centre of the first picture is k · `pan_pixels` to
    /// the left.
    ///
    /// # Errors
    /// A sentence if a frame has no valid camera, as for [`KeyedFields::cameras`].
    pub fn cameras(&self, first: &Camera, image: &Image) -> Result<Vec<Camera>, String> {
        let camera = |frame: usize| {
            let camera = first.panned(image, frame as f64 * self.pan_pixels);
            camera
                .check(&format!("camera_path at frame {frame}: "), "")
                .map(|()| camera)
        };
        std::iter::once(Ok(*first))
            .chain((1..self.frames).map(camera))
            .collect()
    }
}

//! Camera: chooses the eye if a scene has none, so that the splats fill the picture.
//!
//! ```text
//! positions ─► box of all but 0.5 % on each side of each axis ─► ball of all ──────────────────────────────────────┐
//! positions, opacity, radius ─► box of all but 2 % of visible weight ─► ball of visible weight, if less than half ─┴─► eye, target
//! ```
//! The second ball is for scenes with a few faint or small splats far away. It is used only if the
//! splats outside it have, on average, less than half the visible weight of all. Equal splats never
//! lead to it.

use super::{Camera, Image, Splat, neighbours};
use glam::{DQuat, DVec3};
use serde::{Deserialize, Deserializer, Serialize, Serializer, ser::SerializeStruct};

/// Direction of the eye from the splats: in front, slightly to the right and above (y is up).
const FROM: DVec3 = DVec3::new(0.35, 0.3, 1.0);
/// Margin around the splats, as a factor on their distance.
const MARGIN: f64 = 1.05;
/// Stray points of a scan are outside this share of its points, on each side of each axis.
const STRAYS: f64 = 0.005;
/// All but this share of the splats' weight is inside the visible box, on each side of each axis,
/// and within the usual reach of its centre.
const UNSEEN: f64 = 0.02;
/// Farther than this many usual reaches, a splat is outside.
const REACH: f64 = 1.5;
/// The ball of visible weight is used if it is less than this part of the ball of all.
const SMALLER: f64 = 0.5;
/// Splats outside must have less than this part of the mean weight.
const FAINTER: f64 = 0.5;
/// Splats sampled for boxes, at most twice as many: enough for a share of 2 %, and quickly sorted.
const MEASURED: usize = 1 << 17;
/// Extent to which a splat is visible, radii.
const VISIBLE_RADII: f64 = 2.0;

/// A ball around the splats without strays.
pub(super) struct Ball {
    pub centre: DVec3,
    pub radius: f64,
}

/// Weight of each splat: opacity times area, the area limited to the median. None if all weights
/// are equal.
fn weights(splats: &[Splat]) -> Option<Vec<f64>> {
    let median = neighbours::median(splats.iter().map(|splat| splat.radius).collect())?;
    let weight = |splat: &Splat| {
        let size = if median > 0.0 {
            (splat.radius / median).min(1.0)
        } else {
            1.0
        };
        splat.opacity.min(1.0) * size * size
    };
    let weights: Vec<f64> = splats.iter().map(weight).collect();
    weights
        .iter()
        .any(|weight| *weight != weights[0])
        .then_some(weights)
}

/// The first value, in ascending order, before which more than this share of the weight is.
fn quantile(ascending: impl Iterator<Item = (f64, f64)>, most: f64) -> f64 {
    let (mut passed, mut last) = (0.0, 0.0);
    for (value, weight) in ascending {
        (passed, last) = (passed + weight, value);
        if passed > most {
            break;
        }
    }
    last
}

impl Ball {
    /// The ball around the visible splats: all of them, or those that are not both far away and
    /// faint or small.
    pub fn around(splats: &[Splat]) -> Ball {
        let all = Ball::of_all(splats);
        Ball::of_seen(splats)
            .filter(|seen| seen.radius < SMALLER * all.radius)
            .unwrap_or(all)
    }

    /// The ball around the centre of the box with all but a share of the visible weight, including
    /// splats slightly outside the box. None if the splats outside are not fainter or smaller than
    /// the others.
    fn of_seen(splats: &[Splat]) -> Option<Ball> {
        let weights = weights(splats)?;
        let all: f64 = weights.iter().sum();
        let stride = splats.len().div_ceil(MEASURED);
        let measured = || splats.iter().zip(&weights).step_by(stride);
        let most = UNSEEN * measured().map(|(_, weight)| weight).sum::<f64>();
        let ends = |value: &dyn Fn(&Splat) -> f64| {
            let mut values: Vec<(f64, f64)> = measured()
                .map(|(splat, weight)| (value(splat), *weight))
                .collect();
            values.sort_by(|(a, _), (b, _)| a.total_cmp(b));
            [
                quantile(values.iter().copied(), most),
                quantile(values.iter().rev().copied(), most),
            ]
        };
        let spans = [0, 1, 2].map(|axis| ends(&|splat| splat.position[axis]));
        let centre = DVec3::from_array(spans.map(|[low, high]| low + (high - low) / 2.0));
        let reach =
            |splat: &Splat| (splat.position - centre).length() + VISIBLE_RADII * splat.radius;
        let [_, usual] = ends(&reach);
        let (mut radius, mut outside, mut outside_weight) = (0.0_f64, 0, 0.0);
        for (splat, weight) in splats.iter().zip(&weights) {
            let reach = reach(splat);
            if reach <= REACH * usual {
                radius = radius.max(reach);
            } else {
                (outside, outside_weight) = (outside + 1, outside_weight + weight);
            }
        }
        let are_faint = outside_weight / all < FAINTER * f64::from(outside) / splats.len() as f64;
        are_faint.then(|| Ball::sound(centre, radius))
    }

    /// A ball that an eye can see.
    fn sound(centre: DVec3, radius: f64) -> Ball {
        // A smaller ball would be at the rounding of the eye's own coordinates.
        let least = if radius > 0.0 {
            centre.length() * 1e-6
        } else {
            VISIBLE_RADII * neighbours::lone_radius(centre)
        };
        Ball {
            centre,
            radius: radius.max(least),
        }
    }

    /// The ball around the centre of the box without strays, as large as the contents of that box.
    /// Splats without a radius (0) count as points; the ball never has radius 0.
    fn of_all(splats: &[Splat]) -> Ball {
        let span = |axis: usize| {
            let mut values: Vec<f64> = splats.iter().map(|s| s.position[axis]).collect();
            let strays = ((values.len() - 1) as f64 * STRAYS) as usize;
            let last = values.len() - 1 - strays;
            let low = *values.select_nth_unstable_by(strays, f64::total_cmp).1;
            let high = *values.select_nth_unstable_by(last, f64::total_cmp).1;
            (low, high)
        };
        let [x, y, z] = [0, 1, 2].map(span);
        let (low, high) = (DVec3::new(x.0, y.0, z.0), DVec3::new(x.1, y.1, z.1));
        let centre = (low + high) / 2.0;
        let reach = |s: &Splat| (s.position - centre).length() + VISIBLE_RADII * s.radius;
        let inside = splats
            .iter()
            .filter(|s| s.position.cmpge(low).all() && s.position.cmple(high).all());
        Ball::sound(centre, inside.map(reach).fold(0.0, f64::max))
    }

    /// Vector from the ball's centre to an eye that sees all of it, in a picture of `aspect` =
    /// width / height.
    pub fn way_to_eye(&self, fov_y_degrees: f64, aspect: f64) -> DVec3 {
        let tan_y = libm::tan(fov_y_degrees.to_radians() / 2.0);
        let tan = tan_y.min(tan_y * aspect);
        // 1/sin of the narrower half angle: the ball touches the edge of the picture.
        FROM.normalize() * (MARGIN * self.radius * (1.0 + 1.0 / (tan * tan)).sqrt())
    }
}

/// As in a scene file: fields that are left out are not written. Formats without field names get
/// every field.
impl Serialize for Camera {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let &Camera {
            eye,
            target,
            up,
            fov_y_degrees,
            near,
            focal_px,
            centre_px,
            picture_px,
        } = self;
        let skips = serializer.is_human_readable();
        let mut camera = serializer.serialize_struct("Camera", 8)?;
        camera.serialize_field("eye", &eye.to_array())?;
        camera.serialize_field("target", &target.to_array())?;
        camera.serialize_field("up", &up.to_array())?;
        camera.serialize_field("fov_y_degrees", &fov_y_degrees)?;
        camera.serialize_field("near", &near)?;
        for (name, value) in [
            ("focal_px", focal_px),
            ("centre_px", centre_px),
            ("picture_px", picture_px),
        ] {
            if skips && value.is_none() {
                camera.skip_field(name)?;
            } else {
                camera.serialize_field(name, &value)?;
            }
        }
        camera.end()
    }
}

/// A vector as in a scene file.
pub(super) fn from_array<'de, D: Deserializer<'de>>(deserializer: D) -> Result<DVec3, D::Error> {
    <[f64; 3]>::deserialize(deserializer).map(DVec3::from_array)
}

/// Least distance of eye and target: squares of smaller distances underflow in f64.
const NEAREST_TARGET: f64 = 1e-100;
/// Sine of the least angle between view direction and up; below it rounding would rotate the
/// picture.
const LEAST_SINE: f64 = 1e-9;

impl Camera {
    /// Returns a sentence if eye, target or up are invalid. `begin` starts the sentence; `own` is
    /// the prefix of the field names.
    pub(super) fn check(&self, begin: &str, own: &str) -> Result<(), String> {
        let distance = (self.target - self.eye).length();
        // Also if the distance is NaN.
        if distance.is_nan() || distance < NEAREST_TARGET {
            return Err(format!(
                "{begin}{own}eye and {own}target are the same point; they must differ"
            ));
        }
        let sine = ((self.target - self.eye) / distance)
            .cross(self.up.normalize_or_zero())
            .length();
        if sine.is_nan() || sine < LEAST_SINE {
            return Err(format!(
                "{begin}{own}up is parallel to the view from eye to target; it must point to the side of it"
            ));
        }
        Ok(())
    }
}

impl Camera {
    /// Number of splats whose centres are outside the picture, or too near.
    pub(super) fn misses(&self, image: &Image, splats: &[Splat]) -> usize {
        let view = self.view(image);
        let is_seen = |splat: &&Splat| {
            let seen = view.rotation * (splat.position - view.eye);
            let is_within = |axis: usize| {
                let (way, centre) = (view.focal_px[axis] * seen[axis], view.centre_px[axis]);
                -centre * seen.z <= way && way <= (2.0 * view.half_px[axis] - centre) * seen.z
            };
            seen.z > self.near && is_within(0) && is_within(1)
        };
        splats.len() - splats.iter().filter(is_seen).count()
    }
}

/// Angle between consecutive cameras, degrees: the golden angle keeps all of them apart.
const TURN_DEGREES: f64 = 137.507_764;
/// Greatest change of elevation, degrees.
const RISE_DEGREES: f64 = 20.0;

impl Camera {
    /// Camera number `nth` around the same target, at the same distance: rotated about `up`, and
    /// slightly raised or lowered. Number 0 is this one.
    pub fn turned(&self, nth: usize) -> Camera {
        if nth == 0 {
            return *self;
        }
        let up = self.up.normalize();
        let about = DQuat::from_axis_angle(up, (TURN_DEGREES * nth as f64).to_radians());
        let way = about * (self.eye - self.target);
        let right = up.cross(way).normalize();
        // Evenly spread, by the golden ratio again; never over the pole.
        let rise = RISE_DEGREES * (2.0 * (nth as f64 * 0.618_033_988_75).fract() - 1.0);
        let height = way.angle_between(up).to_degrees();
        let rise = rise.clamp(height - 175.0, height - 5.0);
        Camera {
            eye: self.target + DQuat::from_axis_angle(right, -rise.to_radians()) * way,
            ..*self
        }
    }

    /// The camera at `distance` times its own distance, with the near plane scaled too.
    pub fn scaled(&self, distance: f64) -> Camera {
        // An unchanged distance must not change any bit.
        if distance == 1.0 {
            return *self;
        }
        Camera {
            eye: self.target + distance * (self.eye - self.target),
            near: distance * self.near,
            ..*self
        }
    }

    /// Nearby camera number `nth`: the target's surroundings shift by less than half a pixel in x
    /// and y. Number 0 is this one.
    pub fn nudged(&self, nth: usize, image: &Image) -> Camera {
        if nth == 0 {
            return *self;
        }
        let view = self.view(image);
        let distance = (self.target - self.eye).length();
        // Evenly spread over the pixel: multiples of the inverse of the plastic number and of its
        // square.
        let [x, y] = [
            (0.754_877_666_247, view.focal_px[0]),
            (0.569_840_290_998, view.focal_px[1]),
        ]
        .map(|(step, focal_px)| ((nth as f64 * step).fract() - 0.5) * (distance / focal_px));
        let by = view.rotation.row(0) * x + view.rotation.row(1) * y;
        Camera {
            eye: self.eye + by,
            target: self.target + by,
            ..*self
        }
    }
}

#[cfg(test)]
mod tests;

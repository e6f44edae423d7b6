//! Searched: for what a machine was searched, as its file has it; and whether a scene lies outside
//! of that.
//!
//! A machine that `search` narrowed holds its target on the scenes, sizes and distances that it was
//! drawn on. Elsewhere words may saturate.
//!
//! Law: `a_machine_that_was_searched_warns_outside_of_that` (tests/search.rs).

use crate::scene::digest::digest_of_places;
use crate::scene::{Camera, Scene};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What fixed is compared with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Against {
    /// Exact arithmetic by the machine's own rules: the arithmetic's error, which is what words
    /// make.
    #[default]
    Golden,
    /// The method without a limit: the whole error, of arithmetic and method.
    Ideal,
}

impl Against {
    /// As a difference of pictures.
    pub fn difference(self) -> &'static str {
        match self {
            Against::Golden => "fixed − golden",
            Against::Ideal => "fixed − ideal",
        }
    }
}

/// How decibels, or the greatest error, are measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Metric {
    /// Of the two pictures as they are, flips and all.
    #[default]
    Psnr,
    /// Of the machine's picture and golden's that the machine's own decisions lead: rounding alone,
    /// no flips.
    Lockstep,
}

impl Metric {
    fn is_usual(&self) -> bool {
        *self == Metric::default()
    }
}

/// What a machine must reach, on every scene and view.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// Least PSNR over all pixels, dB.
    pub psnr_db: Option<f64>,
    /// Greatest error of any pixel.
    pub max_error: Option<f64>,
    /// No word leaves its range, except declared clamps.
    pub no_saturation: bool,
    /// What both are measured against.
    #[serde(default)]
    pub against: Against,
    /// How both are measured; left out where flips count.
    #[serde(default, skip_serializing_if = "Metric::is_usual")]
    pub metric: Metric,
    /// Least frames per second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames_per_second: Option<f64>,
}

/// For what a machine was searched: there it meets the target, and nothing is known of it
/// elsewhere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SearchRecord {
    /// What it meets.
    pub target: Target,
    /// On what.
    pub scenes: Vec<SceneRecord>,
}

/// A scene that a machine was searched on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneRecord {
    /// File or built-in name.
    pub name: String,
    /// Digest of where its splats are and how large.
    pub splats: String,
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The least and the greatest distance from eye to target among the cameras, world units.
    pub distance: [f64; 2],
    /// Cameras that were searched on, then those that it held on unseen.
    pub cameras: Vec<Camera>,
    /// Where those were taken from; left out where from all around the first, as far as it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub domain: Option<DomainRecord>,
}

/// All cameras that a machine was searched for: some of them it was tried on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DomainRecord {
    /// Of a list, or the scene's own.
    pub cameras: Vec<Camera>,
    /// And all around their targets.
    pub around: bool,
    /// The nearest and the farthest, as a part of the distance of each.
    pub distance: [f64; 2],
}

/// By such a part distances may differ, and eyes and targets lie apart, as a part of the distance.
const SAME: f64 = 0.01;

fn distance(camera: &Camera) -> f64 {
    (camera.eye - camera.target).length()
}

impl SceneRecord {
    /// Of a scene and the cameras that it was drawn from.
    pub fn new(scene: &Scene, cameras: Vec<Camera>) -> Self {
        let least = cameras.iter().map(distance).fold(f64::INFINITY, f64::min);
        let most = cameras.iter().map(distance).fold(0.0, f64::max);
        SceneRecord {
            name: scene.name.clone(),
            splats: digest_of_places(scene),
            width: scene.image.width,
            height: scene.image.height,
            distance: [least, most],
            cameras,
            domain: None,
        }
    }

    /// How a scene with the same splats lies outside.
    fn outside(&self, scene: &Scene) -> Vec<String> {
        let mut outside = Vec::new();
        let (width, height) = (scene.image.width, scene.image.height);
        if [width, height] != [self.width, self.height] {
            outside.push(format!(
                "{width}×{height} pixels instead of {}×{}",
                self.width, self.height
            ));
        }
        outside.extend(self.camera_outside(&scene.camera));
        outside
    }

    /// How a camera lies outside. From its distance a record of several holds all around, as their
    /// unseen ones showed.
    fn camera_outside(&self, camera: &Camera) -> Option<String> {
        if let Some(domain) = &self.domain {
            return domain.outside(camera);
        }
        let now = distance(camera);
        let Some(alike) = self.cameras.iter().find(|other| sees_alike(camera, other)) else {
            return Some(ANOTHER.into());
        };
        let [least, most] = self.distance;
        if now < least * (1.0 - SAME) || now > most * (1.0 + SAME) {
            let told = if is_near(least, most) {
                format!("{least:.3}")
            } else {
                format!("{least:.3} to {most:.3}")
            };
            return Some(format!("an eye {now:.3} from its target instead of {told}"));
        }
        let is_same = (camera.eye - alike.eye).length() <= SAME * distance(alike);
        (self.cameras.len() == 1 && !is_same).then(|| "an eye that looks from another side".into())
    }
}

/// Of a camera that is none of those that were searched.
const ANOTHER: &str = "a camera with another target, angle of view or lens";

fn is_near(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME * b.abs()
}

fn sees_alike(camera: &Camera, other: &Camera) -> bool {
    let lens = |camera: &Camera| (camera.focal_px, camera.centre_px, camera.picture_px);
    is_near(camera.fov_y_degrees, other.fov_y_degrees)
        && lens(camera) == lens(other)
        && (camera.target - other.target).length() <= SAME * distance(other)
}

impl DomainRecord {
    /// How a camera lies outside, beside the one that it is nearest to.
    fn outside(&self, camera: &Camera) -> Option<String> {
        let [nearest, farthest] = self.distance;
        let now = distance(camera);
        let mut outside = Some(ANOTHER.to_owned());
        for own in self.cameras.iter().filter(|own| sees_alike(camera, own)) {
            let [least, most] = [nearest, farthest].map(|part| part * distance(own));
            if now < least * (1.0 - SAME) || now > most * (1.0 + SAME) {
                outside = Some(format!(
                    "an eye {now:.3} from its target instead of {least:.3} to {most:.3}"
                ));
                continue;
            }
            let there = own.scaled(now / distance(own)).eye;
            if self.around || (camera.eye - there).length() <= SAME * now {
                return None;
            }
            outside = Some("an eye that looks from another side".into());
        }
        outside
    }
}

impl SearchRecord {
    /// How a scene lies outside of what was searched, in half sentences; none where it lies inside.
    pub fn outside(&self, scene: &Scene) -> Vec<String> {
        let splats = digest_of_places(scene);
        let of_scene = self
            .scenes
            .iter()
            .filter(|record| record.splats == splats)
            .map(|record| record.outside(scene));
        // A scene may be there more than once, in several sizes.
        let nearest = of_scene.min_by_key(Vec::len);
        nearest.unwrap_or_else(|| {
            vec![format!(
                "the scene {} instead of {}",
                scene.name,
                self.scene_names()
            )]
        })
    }

    /// The scenes, one after another.
    pub fn scene_names(&self) -> String {
        let mut names: Vec<&str> = self
            .scenes
            .iter()
            .map(|scene| scene.name.as_str())
            .collect();
        names.dedup();
        names.join(", ")
    }

    /// The target in words.
    pub fn target_text(&self) -> String {
        self.target.aims().join(", ")
    }
}

impl Target {
    /// The difference of pictures that it measures.
    pub fn difference(&self) -> String {
        let metric = if self.metric == Metric::Lockstep {
            " in lockstep"
        } else {
            ""
        };
        format!("{}{metric}", self.against.difference())
    }

    /// What is wanted, in words.
    pub fn aims(&self) -> Vec<String> {
        let against = self.difference();
        let mut aims = Vec::new();
        aims.extend(
            self.psnr_db
                .map(|db| format!("at least {db} dB, {against}")),
        );
        aims.extend(
            self.max_error
                .map(|most| format!("nowhere more than {most} off, {against}")),
        );
        aims.extend(self.no_saturation.then(|| "no saturation".to_owned()));
        aims.extend(
            self.frames_per_second
                .map(|fps| format!("at least {fps} frames/s")),
        );
        aims
    }
}

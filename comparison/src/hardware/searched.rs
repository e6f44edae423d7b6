//! Searched: the search record of a machine, and the test whether a scene is outside of it.
//!
//! A machine narrowed by `search` meets its target on the scenes, sizes and distances of the
//! search. Elsewhere words may saturate.
//!
//! Law: `a_machine_that_was_searched_warns_outside_of_that` (tests/search.rs).

use crate::scene::digest::digest_of_places;
use crate::scene::{Camera, Scene};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Picture that fixed is compared with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Against {
    /// Exact arithmetic by the machine's own rules: measures the error of the arithmetic, caused by
    /// the words.
    #[default]
    Golden,
    /// The method without limits: measures the whole error, of arithmetic and method.
    Ideal,
}

impl Against {
    /// Name of the picture difference.
    pub fn difference(self) -> &'static str {
        match self {
            Against::Golden => "fixed − golden",
            Against::Ideal => "fixed − ideal",
        }
    }
}

/// Which picture decibels, or the greatest error, are measured on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Metric {
    /// On the two pictures as they are, including flips.
    #[default]
    Psnr,
    /// In lockstep: the reference with every decision forced to the machine's. Measures rounding
    /// only, without flips.
    Lockstep,
}

impl Metric {
    fn is_usual(&self) -> bool {
        *self == Metric::default()
    }
}

/// Target of a search, on every scene and view.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// Least PSNR over all pixels, dB.
    pub psnr_db: Option<f64>,
    /// Greatest error of any pixel.
    pub max_error: Option<f64>,
    /// No word leaves its range, except at declared clamps.
    pub no_saturation: bool,
    /// Reference of both measurements.
    #[serde(default)]
    pub against: Against,
    /// How both are measured; left out where flips count.
    #[serde(default, skip_serializing_if = "Metric::is_usual")]
    pub metric: Metric,
    /// Least frames per second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames_per_second: Option<f64>,
}

/// Record of a search: the target that the machine meets, and the scenes on which it does.
/// Elsewhere nothing is known.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SearchRecord {
    /// Target that the machine meets.
    pub target: Target,
    /// Scenes on which it does.
    pub scenes: Vec<SceneRecord>,
}

/// A scene of a search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneRecord {
    /// File or built-in name.
    pub name: String,
    /// Digest of the positions and sizes of its splats.
    pub splats: String,
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The least and the greatest distance from eye to target among the cameras, world units.
    pub distance: [f64; 2],
    /// Cameras of the search, then unseen cameras on which the target was checked.
    pub cameras: Vec<Camera>,
    /// Domain of the unseen cameras; left out for all around the first, at its distance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub domain: Option<DomainRecord>,
}

/// Domain of cameras of a search; the machine was tried on some of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DomainRecord {
    /// Cameras of a list, or the scene's own.
    pub cameras: Vec<Camera>,
    /// Whether all directions around their targets are included.
    pub around: bool,
    /// Nearest and farthest distance, as a fraction of each camera's distance.
    pub distance: [f64; 2],
}

/// Tolerance for distances, eyes and targets, as a fraction of the distance.
const SAME: f64 = 0.01;

fn distance(camera: &Camera) -> f64 {
    (camera.eye - camera.target).length()
}

impl SceneRecord {
    /// Record of a scene and the cameras of its search.
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

    /// How a scene with the same splats differs.
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

    /// How a camera differs. A record of several cameras covers all directions at its distances, as
    /// the unseen cameras showed.
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
            let recorded = if is_near(least, most) {
                format!("{least:.3}")
            } else {
                format!("{least:.3} to {most:.3}")
            };
            return Some(format!(
                "an eye {now:.3} from its target instead of {recorded}"
            ));
        }
        let is_same = (camera.eye - alike.eye).length() <= SAME * distance(alike);
        (self.cameras.len() == 1 && !is_same).then(|| "an eye that looks from another side".into())
    }
}

/// Text for a camera that matches none of the search.
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
    /// How a camera differs from the nearest one in the domain.
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
    /// How a scene differs from those of the search, in phrases; empty if it does not.
    pub fn outside(&self, scene: &Scene) -> Vec<String> {
        let splats = digest_of_places(scene);
        let of_scene = self
            .scenes
            .iter()
            .filter(|record| record.splats == splats)
            .map(|record| record.outside(scene));
        // A scene may be recorded several times, in several sizes.
        let nearest = of_scene.min_by_key(Vec::len);
        nearest.unwrap_or_else(|| {
            vec![format!(
                "the scene {} instead of {}",
                scene.name,
                self.scene_names()
            )]
        })
    }

    /// Names of the scenes, as a list.
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
    /// The picture difference that it measures.
    pub fn difference(&self) -> String {
        let metric = if self.metric == Metric::Lockstep {
            " in lockstep"
        } else {
            ""
        };
        format!("{}{metric}", self.against.difference())
    }

    /// Conditions of the target, in words.
    pub fn aims(&self) -> Vec<String> {
        let against = self.difference();
        let mut aims = Vec::new();
        aims.extend(
            self.psnr_db
                .map(|db| format!("at least {db} dB, {against}")),
        );
        aims.extend(
            self.max_error
                .map(|most| format!("no pixel more than {most} off, {against}")),
        );
        aims.extend(self.no_saturation.then(|| "no saturation".to_owned()));
        aims.extend(
            self.frames_per_second
                .map(|fps| format!("at least {fps} frames/s")),
        );
        aims
    }
}

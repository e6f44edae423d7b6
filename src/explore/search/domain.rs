//! Domain: the views on which a machine must meet the target: cameras of a scene, distances, one
//! size.
//!
//! ```text
//! the scene's camera, turned about its target ─┐
//! cameras of a list, no repeats in a row ──────┴─► nearer or farther ─► a view
//! ```
//! The first searched views are of the first camera, at both ends of the range of distances. Unseen
//! views are from the whole domain.
//!
//! Law (tests/search.rs): `a_machine_holds_on_the_whole_domain`.

use crate::error::Result;
use crate::hardware::searched::{DomainRecord, SceneRecord};
use crate::scene::{Camera, Scene, Sequence};
use std::ffi::OsStr;

/// Views of a scene at one size.
#[derive(Clone, Debug)]
pub struct Domain {
    /// The scene's name, with the size if there are several.
    pub label: String,
    scene: Scene,
    /// Set if cameras come from a list.
    list: Option<Sequence>,
    /// Range of distances, as factors on each camera's distance from its target.
    distance: [f64; 2],
}

/// A view of a domain.
#[derive(Clone, Debug)]
pub struct Member {
    /// The domain's label, and the camera.
    pub name: String,
    /// The scene from this camera.
    pub scene: Scene,
}

/// Golden ratio: its multiples spread the cameras of a list.
const GOLDEN: f64 = 0.618_033_988_75;
/// Inverse of the plastic number: its multiples spread distances, independently of cameras.
const PLASTIC: f64 = 0.754_877_666_247;

fn part(nth: usize, step: f64) -> f64 {
    (nth as f64 * step).fract()
}

impl Domain {
    /// The scene's own camera and those around its target, at the same distance.
    pub fn around(scene: Scene) -> Self {
        Domain {
            label: scene.name.clone(),
            scene,
            list: None,
            distance: [1.0; 2],
        }
    }

    /// The cameras of a sequence.
    pub fn of_list(sequence: Sequence) -> Self {
        let scene = sequence.scene().clone();
        Domain {
            list: Some(sequence),
            ..Domain::around(scene)
        }
    }

    /// Sets the range of distances, as factors.
    pub fn from_distances(self, distance: [f64; 2]) -> Self {
        Domain { distance, ..self }
    }

    /// Adds the size to the labels of domains that share a scene.
    pub fn label_all(domains: &mut [Domain]) {
        let names: Vec<String> = domains
            .iter()
            .map(|domain| domain.scene.name.clone())
            .collect();
        for domain in domains.iter_mut().filter(|domain| {
            names
                .iter()
                .filter(|name| **name == domain.scene.name)
                .count()
                > 1
        }) {
            let image = &domain.scene.image;
            domain.label = format!("{} at {}×{}", domain.scene.name, image.width, image.height);
        }
    }

    /// The scene from its first camera.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    fn cameras(&self) -> &[Camera] {
        self.list
            .as_ref()
            .map_or(std::slice::from_ref(&self.scene.camera), Sequence::cameras)
    }

    /// The views that are searched first.
    pub fn first(&self) -> Vec<Member> {
        let [nearest, farthest] = self.distance;
        let ends = if nearest == farthest {
            vec![nearest]
        } else {
            vec![nearest, farthest]
        };
        let name_at = |at: f64| {
            if at == 1.0 {
                self.label.clone()
            } else {
                format!("{} from {}", self.label, distance_label(at))
            }
        };
        ends.into_iter()
            .map(|at| Member {
                name: name_at(at),
                scene: seen(&self.scene, self.scene.camera.scaled(at)),
            })
            .collect()
    }

    /// Unseen view number `nth`, from 1.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] if a file cannot be read again.
    pub fn nth(&self, nth: usize) -> Result<Member> {
        let [nearest, farthest] = self.distance;
        let at = if nearest == farthest {
            nearest
        } else {
            nearest * libm::pow(farthest / nearest, part(nth, PLASTIC))
        };
        let (from, scene) = match &self.list {
            None => (
                format!("view {nth}"),
                seen(&self.scene, self.scene.camera.turned(nth).scaled(at)),
            ),
            Some(list) => {
                let number = self.order()[nth % self.cameras().len()];
                let mut list = list.clone();
                let scene = list.frame(number)?;
                (
                    format!("camera {number}"),
                    seen(scene, scene.camera.scaled(at)),
                )
            }
        };
        let from = if at == 1.0 {
            from
        } else {
            format!("{from}, {}", distance_label(at))
        };
        Ok(Member {
            name: format!("{} from {from}", self.label),
            scene,
        })
    }

    /// Cameras of the list in the order in which they are tried; the first stays first.
    fn order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.cameras().len()).collect();
        order.sort_by(|a, b| part(*a, GOLDEN).total_cmp(&part(*b, GOLDEN)));
        order
    }

    /// Entry for a machine's file, with the cameras that were tried.
    pub fn record(&self, tried: Vec<Camera>) -> SceneRecord {
        let is_usual = self.list.is_none() && self.distance == [1.0; 2];
        let domain = DomainRecord {
            cameras: self.cameras().to_vec(),
            around: self.list.is_none(),
            distance: self.distance,
        };
        SceneRecord {
            domain: (!is_usual).then_some(domain),
            ..SceneRecord::new(&self.scene, tried)
        }
    }

    /// Loads a domain by the name of its scene, with or without `--frame`.
    ///
    /// # Errors
    /// As [`Sequence::load`].
    pub fn load(
        name: &OsStr,
        load: impl FnOnce(&OsStr) -> Result<Sequence>,
        frame: Option<usize>,
    ) -> Result<Self> {
        let mut sequence = load(name)?;
        match frame {
            None if sequence.is_sequence() => Ok(Domain::of_list(sequence)),
            frame => {
                sequence.frame(frame.unwrap_or(0))?;
                Ok(Domain::around(sequence.into_scene()))
            }
        }
    }
}

fn seen(scene: &Scene, camera: Camera) -> Scene {
    if camera == scene.camera {
        scene.clone()
    } else {
        Scene {
            camera,
            ..scene.clone()
        }
        .cut()
    }
}

fn distance_label(at: f64) -> String {
    format!("at {at:.2}")
}

impl Member {
    /// This view and its nearby cameras, less than a pixel apart; `count` in total.
    pub fn and_nearby(self, count: usize) -> Vec<Member> {
        let Member { name, scene } = self;
        let nearby = |nth: usize| {
            let name = if nth == 0 {
                name.clone()
            } else {
                format!("{name}, nudged {nth}")
            };
            Member {
                name,
                scene: seen(&scene, scene.camera.nudged(nth, &scene.image)),
            }
        };
        (0..count.max(1)).map(nearby).collect()
    }
}

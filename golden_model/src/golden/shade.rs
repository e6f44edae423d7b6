//! Shade: turns the sums of a fragment into a premultiplied colour (docs/book/algorithm-resolve.md
//! §7), and fragments into a pixel.

use glam::{DVec3, DVec4};

use super::Rules;
use super::footprint::Footprint;
use super::fragments::Fragment;
use super::reflection::{Reflected, Reflection, Surroundings};
use crate::scene::{Material, Scene};

/// Scene data that shading needs, in camera space.
pub struct Shader {
    lights: Vec<CameraLight>,
    materials: Vec<Material>,
    /// None if nothing is mirrored.
    surroundings: Option<Surroundings>,
    half_px: [f64; 2],
    coverage_threshold: f64,
    background: DVec4,
}

struct CameraLight {
    direction: DVec3,
    /// Halfway to the viewer at infinity; none if the light direction is opposite to the viewer's.
    halfway: Option<DVec3>,
    rgb: DVec3,
}

impl Shader {
    /// A shader that mirrors surroundings exactly.
    pub fn new(scene: &Scene) -> Self {
        Shader::mirroring(scene, None)
    }

    /// A shader that mirrors them by a machine's rules.
    pub fn of(scene: &Scene, rules: &Rules) -> Self {
        Shader::mirroring(scene, rules.reflection)
    }

    fn mirroring(scene: &Scene, way: Option<Reflection>) -> Self {
        let rotation = scene.view().rotation;
        let lights = scene.lights.iter().map(|light| {
            let direction = rotation * light.direction;
            let halfway = (direction - DVec3::Z).try_normalize();
            CameraLight {
                direction,
                halfway,
                rgb: DVec3::from_array(light.rgb),
            }
        });
        let [r, g, b, a] = scene.image.background;
        Shader {
            lights: lights.collect(),
            materials: scene.materials.clone(),
            surroundings: Surroundings::new(scene, way),
            half_px: scene.view().half_px,
            coverage_threshold: scene.surface.coverage_threshold,
            background: DVec4::new(r * a, g * a, b * a, a),
        }
    }

    /// A shader of a scene without light and with one material.
    #[cfg(test)]
    pub fn unlit(coverage_threshold: f64) -> Self {
        let materials = vec![Material::Unlit; 3];
        Shader {
            lights: Vec::new(),
            materials,
            surroundings: None,
            half_px: [0.0; 2],
            coverage_threshold,
            background: DVec4::ZERO,
        }
    }

    /// A pixel without fragments.
    pub fn background(&self) -> [f64; 4] {
        self.background.to_array()
    }

    /// Sum of weights from which a fragment covers its pixel.
    pub fn coverage_threshold(&self) -> f64 {
        self.coverage_threshold
    }

    /// Premultiplied colour and coverage of a fragment, also if a merge has already shaded it.
    pub fn premultiplied(&self, fragment: &Fragment) -> DVec4 {
        if fragment.shaded {
            return fragment.rgb.extend(fragment.alpha);
        }
        // All of its weights may have underflowed.
        if fragment.weight == 0.0 {
            return DVec4::ZERO;
        }
        let coverage =
            fragment.alpha / fragment.weight * (fragment.weight / self.coverage_threshold).min(1.0);
        (self.colour(fragment) * coverage).extend(coverage)
    }

    /// The light of a splat that is lit before it is drawn.
    pub fn emission(&self, footprint: &Footprint) -> DVec3 {
        let Footprint {
            rgb,
            normal,
            material,
            centre,
            ..
        } = *footprint;
        let pixel = centre.map(|centre| centre as u16);
        self.colour(&Fragment {
            weight: 1.0,
            rgb,
            normal,
            material,
            pixel,
            ..Fragment::default()
        })
    }

    /// The colour of the fragment: its own under the lights, plus the reflected light.
    fn colour(&self, fragment: &Fragment) -> DVec3 {
        let colour = self.own_colour(fragment);
        let Some(surroundings) = &self.surroundings else {
            return colour;
        };
        let normal = facing(fragment.normal / fragment.weight);
        normal.map_or(colour, |normal| {
            surroundings.mirrored(
                fragment.material,
                self.off_middle(fragment.pixel),
                normal,
                colour,
            )
        })
    }

    /// Reflected light of a fragment; none if there is none, or the fragment is already shaded.
    pub fn mirrored(&self, fragment: &Fragment) -> Option<Reflected> {
        let surroundings = self
            .surroundings
            .as_ref()
            .filter(|_| !fragment.shaded && fragment.weight != 0.0)?;
        surroundings.seen(
            fragment.material,
            self.off_middle(fragment.pixel),
            facing(fragment.normal / fragment.weight)?,
        )
    }

    /// A pixel's centre relative to the middle of the picture.
    pub fn off_middle(&self, pixel: [u16; 2]) -> [f64; 2] {
        std::array::from_fn(|axis| f64::from(pixel[axis]) + 0.5 - self.half_px[axis])
    }

    /// The fragment's own colour under the lights.
    fn own_colour(&self, fragment: &Fragment) -> DVec3 {
        let rgb = fragment.rgb / fragment.weight;
        match self.materials[fragment.material as usize] {
            Material::Unlit => rgb,
            Material::BlinnPhong {
                ambient,
                diffuse,
                specular,
                shininess,
            } => {
                let mut lit = DVec3::splat(ambient);
                let mut highlight = DVec3::ZERO;
                if let Some(normal) = facing(fragment.normal / fragment.weight) {
                    for light in &self.lights {
                        lit += light.rgb * (diffuse * normal.dot(light.direction).max(0.0));
                        if let Some(halfway) = light.halfway {
                            highlight += light.rgb
                                * (specular * libm::pow(normal.dot(halfway).max(0.0), shininess));
                        }
                    }
                }
                (rgb * lit + highlight).clamp(DVec3::ZERO, DVec3::ONE)
            }
        }
    }

    /// The pixel: layers front to back (in the given order for equal z), over the background.
    pub fn resolve(&self, layers: &mut [Fragment]) -> [f64; 4] {
        layers.sort_by(|a, b| a.z.total_cmp(&b.z));
        self.blend(layers.iter())
    }

    /// Layers in the order given, front to back, over the background.
    pub fn blend<'a>(&self, layers: impl Iterator<Item = &'a Fragment>) -> [f64; 4] {
        self.blend_lit(layers.map(|layer| self.premultiplied(layer)))
    }

    /// As [`Shader::blend`], for results of [`Shader::premultiplied`].
    pub fn blend_lit(&self, layers: impl Iterator<Item = DVec4>) -> [f64; 4] {
        over(layers.fold(DVec4::ZERO, over), self.background).to_array()
    }
}

/// The unit normal on the side that faces the viewer; none if the normals cancel.
fn facing(sum: DVec3) -> Option<DVec3> {
    let normal = sum.try_normalize()?;
    Some(if normal.z > 0.0 { -normal } else { normal })
}

/// Front over back, both premultiplied.
pub fn over(front: DVec4, back: DVec4) -> DVec4 {
    front + back * (1.0 - front.w)
}

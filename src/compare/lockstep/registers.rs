//! Registers: what the machine was given, word by word, beside the exact numbers that the words stand for.

use crate::golden::shade::Shader;
use crate::quantise::{Quantised, quantised as constant};
use crate::scene::{Light, Material, Scene, View};
use glam::DVec3;
use rtl_model::frame;
use rtl_model::frame::real::{self, Splat};
use rtl_model::machine::{Elaborated, Machine};
use rtl_model::num::Word;
use rtl_model::real::Near;
use rtl_model::units::shade::real::{self as shade, Lighting};
use std::f64::consts::TAU;

/// A vector and its words.
pub fn vector(value: DVec3, word: Word, held: [i64; 3]) -> [Near; 3] {
    [0, 1, 2].map(|axis| Near::held(value[axis], word, held[axis]))
}

/// The viewing registers; lengths in machine units.
pub fn view(scene: &Scene, view: &View, machine: &Machine, quantised: &Quantised) -> real::View<Near> {
    let (p, e, raster) = (&machine.project, &machine.ellipse, &machine.raster);
    let (held, scale) = (&quantised.frame.view, &quantised.scale);
    let guard = |axis: usize| Near::held(1.5 * view.half_px[axis] / view.focal_px, p.slope, held.guard[axis]);
    real::View {
        rotation: [0, 1, 2].map(|row| vector(view.rotation.row(row), p.rotation, held.rotation[row])),
        eye: vector((view.eye - DVec3::from_array(scale.offset)) * scale.factor(), p.eye, held.eye),
        near: Near::held(scene.camera.near * scale.factor(), p.depth, held.near),
        guard: [guard(0), guard(1)],
        focal: Near::held(view.focal_px, p.focal, held.focal),
        inverse_focal: Near::held_scaled(1.0 / view.focal_px, e.inverse_focal, held.inverse_focal),
        low_pass: Near::held(scene.kernel.low_pass, e.low_pass, held.low_pass),
        cutoff: Near::held(scene.kernel.cutoff, raster.cutoff, held.cutoff),
        root_cutoff: Near::held(scene.kernel.cutoff.sqrt(), e.root_cutoff, held.root_cutoff),
        inverse_two_pi: Near::held(1.0 / TAU, e.inverse_two_pi, constant(e.inverse_two_pi, 1.0 / TAU)),
    }
}

/// A splat's record; lengths in machine units.
pub fn splat(scene: &Scene, machine: &Machine, quantised: &Quantised, index: usize) -> Splat<Near> {
    let (words, scale) = (&machine.splat, &quantised.scale);
    let (exact, held): (_, &frame::Splat) = (&scene.splats[index], &quantised.frame.splats[index]);
    let of = |value: f64, word: Word, held: i32| Near::held(value, word, i64::from(held));
    let position = (exact.position - DVec3::from_array(scale.offset)) * scale.factor();
    Splat {
        position: vector(position, words.position, held.position.map(i64::from)),
        normal: vector(exact.normal, words.normal, held.normal.map(i64::from)),
        radius: of(exact.radius * scale.factor(), words.radius, held.radius),
        rgb: [0, 1, 2].map(|channel| of(exact.rgb[channel], words.rgb, held.rgb[channel])),
        opacity: of(exact.opacity, words.opacity, held.opacity),
    }
}

/// The lighting registers, in camera space.
pub fn lighting(scene: &Scene, view: &View, machine: &Elaborated, quantised: &Quantised) -> Lighting<Near> {
    let (words, frame) = (&machine.machine.shade, &quantised.frame);
    let light = |(exact, held): (&Light, &frame::Light)| {
        let direction = view.rotation * exact.direction;
        let half_way = |held: [i64; 3]| vector((direction - DVec3::Z).normalize(), words.light, held);
        shade::Light { direction: vector(direction, words.light, held.direction), half_way: held.half_way.map(half_way) }
    };
    let material = |(exact, held): (&Material, &frame::Material)| match (exact, held) {
        (
            Material::BlinnPhong { ambient, diffuse, specular, shininess },
            frame::Material::BlinnPhong { ambient: held_ambient, diffuse: held_diffuse, specular: held_specular, highlight },
        ) => {
            let answers = |factor: f64, held: &[[i64; 3]]| {
                let answer =
                    |(light, held): (&Light, &[i64; 3])| [0, 1, 2].map(|i| Near::held(factor * light.rgb[i], words.reflectance, held[i]));
                scene.lights.iter().zip(held).map(answer).collect()
            };
            shade::Material::BlinnPhong {
                ambient: Near::held(*ambient, words.reflectance, *held_ambient),
                diffuse: answers(*diffuse, held_diffuse),
                specular: answers(*specular, held_specular),
                highlight: machine.real_highlight(highlight, *shininess),
            }
        }
        _ => shade::Material::Unlit,
    };
    Lighting {
        lights: scene.lights.iter().zip(&frame.lighting.lights).map(light).collect(),
        materials: scene.materials.iter().zip(&frame.lighting.materials).map(material).collect(),
        coverage_threshold: coverage_threshold(scene, &machine.machine, quantised),
        inverse_threshold: Near::held_scaled(1.0 / scene.surface.coverage_threshold, words.inverse_threshold, frame.inverse_threshold),
    }
}

/// τ.
pub fn coverage_threshold(scene: &Scene, machine: &Machine, quantised: &Quantised) -> Near {
    Near::held(scene.surface.coverage_threshold, machine.fragment.weight_sum, quantised.frame.coverage_threshold)
}

/// The background, premultiplied.
pub fn background(shader: &Shader, machine: &Machine, quantised: &Quantised) -> [Near; 4] {
    let (exact, word) = (shader.background(), machine.resolve.frame);
    [0, 1, 2, 3].map(|i| Near::held(exact[i], word, quantised.frame.background[i]))
}

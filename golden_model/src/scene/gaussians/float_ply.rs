//! Float PLY: reads Gaussians in the format of training programs: one named number per parameter
//! (Kerbl et al. 2023).
//!
//! Scales are logarithms, opacities are logits, quaternions are w x y z of any length. `f_rest_*`
//! has all coefficients of red, then of green, then of blue; their number determines the degree.
//! Without `scale_2` they are 2D Gaussians (Huang et al. 2024): discs, whose third standard
//! deviation is 0.

use super::{Gaussian, Gaussians, Intake, Parsed, coefficients, exp, sigmoid};
use crate::scene::ply::{Body, Element, Header};
use glam::{DQuat, DVec3};

/// Parameters of every Gaussian, in the order in which they are used. Those of the harmonics
/// follow, then the third scale, which 2D Gaussians lack.
const NAMES: [&str; 13] = [
    "x", "y", "z", "rot_1", "rot_2", "rot_3", "rot_0", "scale_0", "scale_1", "opacity", "f_dc_0",
    "f_dc_1", "f_dc_2",
];
const THIRD_SCALE: &str = "scale_2";
const ROTATION: usize = 3;
const SCALE: usize = 7;
const OPACITY: usize = 9;
const HARMONICS: usize = 10;

/// Whether the vertices have the parameters of trained Gaussians.
pub(super) fn is_trained(header: &Header) -> bool {
    let has = |element: &Element| {
        ["scale_0", "rot_0"]
            .iter()
            .all(|name| element.names().any(|own| own == *name))
    };
    header.elements.iter().any(|e| e.name == "vertex" && has(e))
}

pub(super) fn parse(header: &Header, mut body: Body) -> Parsed<Gaussians> {
    let mut elements = header.elements.iter();
    while let Some(element) = elements.next() {
        if element.name == "vertex" {
            let gaussians = read(header, element, &mut body)?;
            return body.finish(elements).map(|()| gaussians);
        }
        body.rows(element, &element.slots(&[])?, &mut [], |_| ())?;
    }
    Err("has no element `vertex`, so there are no Gaussians in it".into())
}

fn read(header: &Header, vertices: &Element, body: &mut Body) -> Parsed<Gaussians> {
    let degree = degree(vertices)?;
    let is_flat = !vertices.names().any(|name| name == THIRD_SCALE);
    let third = (!is_flat).then(|| THIRD_SCALE.to_owned());
    let names: Vec<String> = NAMES
        .map(String::from)
        .into_iter()
        .chain(rest_names(degree))
        .chain(third)
        .collect();
    let needs = |e| {
        format!(
            "{e}; a trained Gaussian needs x y z, f_dc_0 to 2, opacity, scale_0 to 2 and rot_0 to 3, of which 2D Gaussians lack scale_2"
        )
    };
    let slots = vertices.slots(&names).map_err(needs)?;
    let mut notes = header.notes.clone();
    if is_flat {
        notes.push(
            "has no scale_2: its Gaussians are read as 2D ones, discs of no thickness".into(),
        );
    }
    let mut intake = Intake::new(degree, body.room(vertices), notes);
    let harmonics = HARMONICS..HARMONICS + 3 * coefficients(degree);
    body.rows(vertices, &slots, &mut vec![0.0; names.len()], |values| {
        let raw = Gaussian {
            position: DVec3::from_slice(values),
            rotation: DQuat::from_slice(&values[ROTATION..]),
            // e^−∞ is 0.
            scale: exp(DVec3::new(
                values[SCALE],
                values[SCALE + 1],
                if is_flat {
                    f64::NEG_INFINITY
                } else {
                    values[harmonics.end]
                },
            )),
            opacity: sigmoid(values[OPACITY]),
        };
        intake.push(
            raw,
            values[harmonics.clone()]
                .as_chunks()
                .0
                .iter()
                .map(|rgb: &[f64; 3]| rgb.map(|c| c as f32)),
        );
    })?;
    intake.finish()
}

/// The degree, from the number of non-constant coefficients in the element.
pub(super) fn degree(element: &Element) -> Parsed<usize> {
    let count = element
        .names()
        .filter(|name| name.starts_with("f_rest_"))
        .count();
    (0..=3)
        .find(|&degree| 3 * (coefficients(degree) - 1) == count)
        .ok_or_else(|| format!("has {count} numbers `f_rest_*`; spherical harmonics of degree 0, 1, 2 and 3 have 0, 9, 24 and 45"))
}

/// Names of all coefficients except the constant ones: red, green and blue of each in turn.
pub(super) fn rest_names(degree: usize) -> Vec<String> {
    let per_channel = coefficients(degree) - 1;
    (0..per_channel)
        .flat_map(|k| (0..3).map(move |channel| format!("f_rest_{}", channel * per_channel + k)))
        .collect()
}

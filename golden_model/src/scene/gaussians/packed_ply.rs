//! Packed PLY: reads Gaussians from the compressed `.ply` files of SuperSplat (PlayCanvas), 16
//! bytes each.
//! ```text
//! packed_position, packed_scale   x: 11 bits   y: 10   z: 11   in the chunk's range
//! packed_rotation                 index: 2   three others: 10 each, in ±√½; `index` is that of the largest of w x y z
//! packed_color                    red: 8   green: 8   blue: 8   opacity: 8
//! ```
//! One chunk covers 256 Gaussians. Scales are logarithms. Colours are the same from all directions,
//! in the chunk's range if it has one. The element `sh` has one byte for each other coefficient, in
//! the order of `f_rest_*` of a float PLY, in ±4.

use super::{Gaussian, Gaussians, Intake, Parsed, exp, float_ply, harmonics_of};
use crate::scene::ply::{Body, Element, Header};
use glam::{DQuat, DVec3};
use std::f64::consts::SQRT_2;

/// Gaussians per chunk.
const CHUNK: usize = 256;

const BOUNDS: [&str; 12] = [
    "min_x",
    "min_y",
    "min_z",
    "max_x",
    "max_y",
    "max_z",
    "min_scale_x",
    "min_scale_y",
    "min_scale_z",
    "max_scale_x",
    "max_scale_y",
    "max_scale_z",
];
const COLOUR_BOUNDS: [&str; 6] = ["min_r", "min_g", "min_b", "max_r", "max_g", "max_b"];
const WORDS: [&str; 4] = [
    "packed_position",
    "packed_rotation",
    "packed_scale",
    "packed_color",
];

/// Ranges of a chunk's positions, log scales and colours.
struct Chunk {
    position: [DVec3; 2],
    scale: [DVec3; 2],
    colour: [DVec3; 2],
}

/// Whether the vertices are packed.
pub(super) fn is_packed(header: &Header) -> bool {
    header
        .elements
        .iter()
        .any(|e| e.name == "vertex" && e.names().any(|name| name == WORDS[0]))
}

pub(super) fn parse(header: &Header, mut body: Body) -> Parsed<Gaussians> {
    let (mut chunks, mut words, mut rest, mut degree) = (Vec::new(), Vec::new(), Vec::new(), 0);
    for element in &header.elements {
        match element.name.as_str() {
            "chunk" => chunks = read_chunks(&mut body, element)?,
            "vertex" => words = read_words(&mut body, element)?,
            "sh" => {
                degree = float_ply::degree(element)?;
                rest = read_rest(&mut body, element, degree)?;
            }
            _ => body.rows(element, &element.slots(&[])?, &mut [], |_| ())?,
        }
    }
    body.finish(std::iter::empty())?;
    let (needed, per_gaussian) = (words.len().div_ceil(CHUNK), super::coefficients(degree) - 1);
    if chunks.len() < needed {
        return Err(format!(
            "has {} chunks for {} Gaussians; there must be {needed}, one for each {CHUNK}",
            chunks.len(),
            words.len()
        ));
    }
    if rest.len() != words.len() * per_gaussian {
        return Err(format!(
            "has {} rows of element `sh` for {} Gaussians; there must be as many",
            rest.len() / per_gaussian,
            words.len()
        ));
    }
    let mut intake = Intake::new(degree, words.len(), header.notes.clone());
    for (i, &words) in words.iter().enumerate() {
        let (raw, constant) = unpack(words, &chunks[i / CHUNK]);
        let rest = &rest[i * per_gaussian..][..per_gaussian];
        intake.push(
            raw,
            std::iter::once(constant).chain(rest.iter().map(|rgb| rgb.map(coefficient))),
        );
    }
    intake.finish()
}

fn read_chunks(body: &mut Body, element: &Element) -> Parsed<Vec<Chunk>> {
    let has_colours = element.names().any(|name| name == COLOUR_BOUNDS[0]);
    let colour_names: &[&str] = if has_colours { &COLOUR_BOUNDS } else { &[] };
    let names = owned(&[&BOUNDS, colour_names].concat());
    let mut chunks = Vec::with_capacity(body.room(element));
    body.rows(
        element,
        &element.slots(&names)?,
        &mut vec![0.0; names.len()],
        |values| {
            let pair = |first: usize| {
                [
                    DVec3::from_slice(&values[first..]),
                    DVec3::from_slice(&values[first + 3..]),
                ]
            };
            let colour = if has_colours {
                pair(BOUNDS.len())
            } else {
                [DVec3::ZERO, DVec3::ONE]
            };
            chunks.push(Chunk {
                position: pair(0),
                scale: pair(6),
                colour,
            });
        },
    )?;
    Ok(chunks)
}

fn read_words(body: &mut Body, element: &Element) -> Parsed<Vec<[u32; 4]>> {
    let mut words = Vec::with_capacity(body.room(element));
    // Through i64, words keep their bits even if the header declares them as `int`.
    body.rows(
        element,
        &element.slots(&owned(&WORDS))?,
        &mut [0.0; 4],
        |values| words.push(std::array::from_fn(|i| values[i] as i64 as u32)),
    )?;
    Ok(words)
}

/// All coefficients except the constant ones, as bytes: 45 per Gaussian for degree 3.
fn read_rest(body: &mut Body, element: &Element, degree: usize) -> Parsed<Vec<[u8; 3]>> {
    let names = float_ply::rest_names(degree);
    let mut rest = Vec::with_capacity(body.room(element).saturating_mul(names.len() / 3));
    body.rows(
        element,
        &element.slots(&names)?,
        &mut vec![0.0; names.len()],
        |values| {
            rest.extend(
                values
                    .as_chunks()
                    .0
                    .iter()
                    .map(|rgb: &[f64; 3]| rgb.map(|code| code as u8)),
            );
        },
    )?;
    Ok(rest)
}

fn owned(names: &[&str]) -> Vec<String> {
    names.iter().map(ToString::to_string).collect()
}

/// The Gaussian and its constant coefficients.
fn unpack([position, rotation, scale, colour]: [u32; 4], chunk: &Chunk) -> (Gaussian, [f32; 3]) {
    let rgb = DVec3::new(part(colour, 24, 8), part(colour, 16, 8), part(colour, 8, 8));
    let gaussian = Gaussian {
        position: between(chunk.position, unpack_vector(position)),
        rotation: unpack_rotation(rotation),
        scale: exp(between(chunk.scale, unpack_vector(scale))),
        opacity: part(colour, 0, 8),
    };
    (
        gaussian,
        harmonics_of(between(chunk.colour, rgb).to_array()),
    )
}

/// `bits` bits of the word from bit `low` on, as a part of their greatest value.
fn part(word: u32, low: u32, bits: u32) -> f64 {
    let most = (1 << bits) - 1;
    f64::from(word >> low & most) / f64::from(most)
}

fn between([least, most]: [DVec3; 2], at: DVec3) -> DVec3 {
    least * (DVec3::ONE - at) + most * at
}

fn unpack_vector(word: u32) -> DVec3 {
    DVec3::new(part(word, 21, 11), part(word, 11, 10), part(word, 0, 11))
}

fn unpack_rotation(word: u32) -> DQuat {
    let [a, b, c] = [20, 10, 0].map(|low| (part(word, low, 10) - 0.5) * SQRT_2);
    let largest = (1.0 - (a * a + b * b + c * c)).max(0.0).sqrt();
    let [w, x, y, z] = match word >> 30 {
        0 => [largest, a, b, c],
        1 => [a, largest, b, c],
        2 => [a, b, largest, c],
        _ => [a, b, c, largest],
    };
    DQuat::from_xyzw(x, y, z, w)
}

/// The middle of a byte's interval in ±4; the first and the last byte are the limits.
fn coefficient(code: u8) -> f32 {
    match code {
        0 => -4.0,
        255 => 4.0,
        _ => (f32::from(code) + 0.5) / 32.0 - 4.0,
    }
}

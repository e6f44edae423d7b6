//! Colours: finds the colours of a PLY element by name, and converts them to linear light.
//! ```text
//! names of properties ─► [Columns]                               which property is red, green, blue, alpha
//! type, greatest number, `comment colours are linear light` ─► [Meaning] ─► linear light, opacity
//! ```
//! Other programs (MeshLab, CloudCompare, Easy3D, VTK) use screen codes: sRGB codes of any type.
//! PLY does not define the number of full light. An 8-bit integer has full light at 255. For other
//! types it is the least of [`FULL`] that no colour exceeds; a note reports it if it is ambiguous.

use super::{Element, PropertyKind, Scalar, clip};
use crate::output::colour::srgb_decode;

/// Prefixes of the names of a colour's channels, in the order of preference; case does not matter.
const PREFIXES: [&str; 8] = [
    "", "diffuse_", "vertex_", "color_", "colour_", "col_", "rgb_", "scalar_",
];
const CHANNELS: [[&str; 4]; 2] = [["red", "green", "blue", "alpha"], ["r", "g", "b", "a"]];

/// Numbers of full light: floats from 0 to 1, and integers of 8, 16 and 32 bits, which may also be
/// stored as floats.
const FULL: [f64; 4] = [1.0, 255.0, 65535.0, 4_294_967_295.0];
/// Factor by which floats may exceed full light, after sharpening or interpolation.
const OVERSHOOT: f64 = 2.0;
/// Integers of more than 8 bits whose greatest is below this may have another full light than
/// 65535: 10 bits or 12.
const DIM: f64 = 4096.0;
/// If a header has this comment, at the end of a line, its colours are linear light, like those of
/// `splatsim sample`.
const LINEAR: [&str; 2] = ["colours are linear light", "colors are linear light"];

/// Whether a comment declares linear light.
pub(super) fn is_linear(comment: &str) -> bool {
    let comment = comment.to_ascii_lowercase();
    LINEAR
        .iter()
        .any(|words| comment.trim_end_matches('.').ends_with(words))
}

/// Properties of an element that are its colours.
#[derive(Default)]
pub(super) struct Columns {
    /// Indices of properties, and their type.
    pub rgb: Option<([usize; 3], Scalar)>,
    pub alpha: Option<(usize, Scalar)>,
    /// Notes on properties that look like colours and are not read.
    pub notes: Vec<String>,
}

impl Columns {
    pub fn of(element: &Element) -> Columns {
        let names: Vec<String> = element.names().map(str::to_lowercase).collect();
        let scalar = |name: &str| {
            let place = names.iter().position(|own| own == name)?;
            if let PropertyKind::Scalar(kind) = element.properties[place].kind {
                Some((place, kind))
            } else {
                None
            }
        };
        let families = PREFIXES.iter().flat_map(|prefix| {
            CHANNELS.map(|channels| channels.map(|channel| format!("{prefix}{channel}")))
        });
        let complete = families.filter_map(|family| {
            let [red, green, blue] = [0, 1, 2].map(|channel| scalar(&family[channel]));
            let (red, green, blue) = (red?, green?, blue?);
            // For several types a float is the most general.
            let kind = [red.1, green.1, blue.1]
                .into_iter()
                .find(|kind| kind.is_float())
                .unwrap_or(red.1);
            Some(([red.0, green.0, blue.0], kind, family))
        });
        let complete: Vec<_> = complete.collect();
        let (mut columns, whose) = (Columns::default(), clip(&element.name));
        match complete.as_slice() {
            [] => {
                columns.alpha = scalar("alpha");
                // The properties of trained Gaussians, `f_dc_0`, have a separate note.
                let is_colour = |name: &&str| {
                    let name = name.to_lowercase();
                    name.split(['_', '-', '.'])
                        .any(|word| LIKE_COLOURS.contains(&word))
                };
                if let Some(name) = element.names().find(is_colour) {
                    columns.notes.push(format!(
                        "element `{whose}` has `{}`, which looks like a colour and is not read; colours are red, green and blue, or r, g and b",
                        clip(name)
                    ));
                }
            }
            [(places, kind, family), others @ ..] => {
                columns.rgb = Some((*places, *kind));
                columns.alpha = scalar(&family[3]);
                if let Some((.., other)) = others.first() {
                    columns.notes.push(format!(
                        "element `{whose}` has several colours: {}, {} and {} are read, {} and its like are not",
                        family[0], family[1], family[2], other[0]
                    ));
                }
            }
        }
        columns
    }
}

/// Words in names of properties that some programs use for colours.
const LIKE_COLOURS: [&str; 10] = [
    "red", "green", "blue", "rgb", "rgba", "color", "colour", "colors", "colours", "bgr",
];

/// Least and greatest plausible number of an element.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    least: f64,
    greatest: f64,
    /// Numbers beyond this are not colours: a single one would make all others black.
    limit: f64,
    /// Number of these.
    beyond: usize,
}

impl Extent {
    pub fn of(kind: Scalar) -> Extent {
        let limit = if kind.is_float() {
            OVERSHOOT * FULL[2]
        } else {
            FULL[3]
        };
        Extent {
            least: 0.0,
            greatest: 0.0,
            limit,
            beyond: 0,
        }
    }

    pub fn with(self, value: f64) -> Extent {
        if value.is_nan() {
            return self;
        }
        if value.abs() > self.limit {
            return Extent {
                beyond: self.beyond + 1,
                ..self
            };
        }
        Extent {
            least: self.least.min(value),
            greatest: self.greatest.max(value),
            ..self
        }
    }

    pub fn and(self, other: Extent) -> Extent {
        let beyond = self.beyond + other.beyond;
        Extent {
            beyond,
            ..self.with(other.least).with(other.greatest)
        }
    }
}

/// Encoding of the numbers of colours, or of opacities.
pub(super) struct Meaning {
    /// The number of full light.
    full: f64,
    /// The numbers are sRGB codes.
    encoded: bool,
    /// Added to numbers below 0: 8-bit codes in a signed type.
    wrap: f64,
    /// Linear light of the 256 codes of a byte: decoding them one by one would take longer than
    /// reading the file.
    codes: Vec<f64>,
}

impl Meaning {
    /// Encoding of colours of this type and extent; `linear` if the header declares linear light.
    pub fn of_colours(kind: Scalar, extent: Extent, linear: bool) -> Meaning {
        let full = if linear && kind.is_float() {
            1.0
        } else {
            full(kind, extent)
        };
        let code = |code: usize| {
            if linear {
                code as f64 / 255.0
            } else {
                srgb_decode(code as f64 / 255.0)
            }
        };
        Meaning {
            full,
            encoded: !linear,
            wrap: wrap(kind),
            codes: (0..256).map(code).collect(),
        }
    }

    /// Encoding of opacities, which are linear for any type.
    pub fn of_opacities(
        kind: Scalar,
        extent: Extent,
        colours: Option<(Scalar, &Meaning)>,
    ) -> Meaning {
        // A cloud may be nearly transparent: its colours also indicate the type.
        let same = colours
            .filter(|(other, _)| *other == kind && !kind.is_float())
            .map_or(0.0, |(_, meaning)| meaning.full);
        Meaning {
            full: full(kind, extent).max(same),
            encoded: false,
            wrap: wrap(kind),
            codes: Vec::new(),
        }
    }

    /// Linear light; None for NaN.
    pub fn light(&self, value: f64) -> Option<f64> {
        let value = if value < 0.0 {
            value + self.wrap
        } else {
            value
        };
        if value.is_nan() {
            return None;
        }
        let code = value.clamp(0.0, self.full);
        if self.full == 255.0 && code.fract() == 0.0 && !self.codes.is_empty() {
            return Some(self.codes[code as usize]);
        }
        let part = code / self.full;
        Some(if self.encoded {
            srgb_decode(part)
        } else {
            part
        })
    }

    /// A sentence on the assumed encoding of an element's colours, if the file is ambiguous.
    pub fn note(&self, element: &str, kind: Scalar, extent: Extent) -> Option<String> {
        let Extent {
            least,
            greatest,
            beyond,
            ..
        } = extent;
        let is_black = greatest <= 0.0 && least >= 0.0 && beyond == 0;
        let is_clear = match kind {
            Scalar::F32 | Scalar::F64 => false,
            Scalar::I8 if least < 0.0 => false,
            // All but black, if 1 is not full light.
            _ if greatest <= 1.0 => false,
            Scalar::I8 | Scalar::U8 => true,
            Scalar::U16 => greatest >= DIM,
            Scalar::I16 | Scalar::I32 | Scalar::U32 => greatest <= 255.0,
        };
        if !self.encoded || is_black || is_clear {
            return None;
        }
        let clamped = if beyond > 0 {
            format!(
                " ({beyond} numbers are past {} and were clamped)",
                extent.limit
            )
        } else {
            String::new()
        };
        let linear = if kind.is_float() {
            "; `comment colours are linear light` in its header means linear light"
        } else {
            ""
        };
        Some(format!(
            "colours of element `{}` are {} and end at {}{clamped}: taken as sRGB codes from 0 to {}{linear}",
            clip(element),
            kind.name(),
            rounded(greatest),
            self.full
        ))
    }
}

/// The number of full light for numbers of this type and extent.
fn full(kind: Scalar, extent: Extent) -> f64 {
    let holds = |full: f64| match kind {
        Scalar::I8 | Scalar::U8 => full == 255.0,
        Scalar::F32 | Scalar::F64 => extent.greatest <= OVERSHOOT * full,
        _ => full >= 255.0 && extent.greatest <= full,
    };
    FULL.into_iter()
        .find(|&full| holds(full))
        .unwrap_or(FULL[3])
}

fn wrap(kind: Scalar) -> f64 {
    if kind == Scalar::I8 { 256.0 } else { 0.0 }
}

/// Rounded to at most three decimals.
fn rounded(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

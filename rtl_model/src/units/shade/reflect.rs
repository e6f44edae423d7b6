//! Reflect: mirrors surroundings in what shade has lit (Surface Splatting §4,
//! docs/book/reflection.md). It stands in shade, behind the unit normal, and its light goes out at
//! shade's port.
//!
//! ```text
//! pixel ─►[ slope ]─► V = −(a, b, 1) ─┐
//! normal N ──────────────────►[ N·V ]─┴─►[ 2(N·V)N − V ]─► R ─►[ 1/(|x|+|y|+|z|) ]─►(×)─► |x|, |y| ─►[ fold ]─►[ map ]─► light
//! colour ─►(× 1 − reflect)─►(+)◄─(× reflect·tint)◄─ light          └► at most 1 ─► colour
//! ```
//! The map is an octahedron laid flat, its middle towards the viewer: where R points away from him
//! its corners are folded over. So R need not be of length 1, and V is not. From far along the axis
//! (`axis`) a and b are 0: no word for them, four products fewer and no pixel.
//!
//! Losses: all words are rounded; `coordinate` is clamped to 1, what is mixed to 1. Where the
//! normals of a fragment cancel nothing is mirrored.
//!
//! Laws: `a_mirror_turns_a_ray_about_its_normal`, `a_flat_sky_is_its_colour_everywhere`,
//! `nothing_mirrored_changes_nothing`; of the bound, tests/reflection.rs.

use crate::elaboration::Elaboration;
use crate::elaboration::latency::Path;
use crate::frame::{Frame, Scaled, Surroundings};
use crate::functions::{Map, Reciprocal, map, reciprocal};
use crate::machine::{Machine, Reflect as Description, Sight};
use crate::num::{Exact, Fit, Format, Word, three};
use crate::probe::{NoProbe, Probe, Tap};
use crate::records::unit;

const UNIT: &str = unit::REFLECT;

/// A pixel's distance from the middle of the picture.
const FROM_MIDDLE: Format = Format::signed(14, 1);
/// Most texels along a side of the map, as a power of two.
const MOST_INDEX_BITS: u32 = 8;

/// Registers that a frame loads.
#[derive(Clone, Copy, Debug)]
pub struct Registers<'a> {
    /// The map, and what materials do with it.
    pub surroundings: &'a Surroundings,
    /// Width and height of the picture.
    pub size_px: [i64; 2],
    /// 1/s_x, 1/s_y (`ellipse.inverse_focal`).
    pub inverse_focals: [Scaled; 2],
    /// Principal point from the picture's middle (`project.pixel`).
    pub centre: [i64; 2],
}

impl<'a> Registers<'a> {
    /// A frame's; none where it mirrors nothing.
    pub fn of(frame: &'a Frame) -> Option<Self> {
        let size_px = [frame.width, frame.height].map(i64::from);
        let surroundings = frame.surroundings.as_ref()?;
        Some(Registers {
            surroundings,
            size_px,
            inverse_focals: frame.view.inverse_focals(),
            centre: frame.view.centre,
        })
    }
}

fn map_words(machine: &Machine, m: &Description) -> map::Words {
    let cached = machine
        .timing
        .environment
        .map(|environment| environment.ways);
    let index_bits = m.index_bits.clamp(1, MOST_INDEX_BITS);
    // A place is half a coordinate, more or less than a half.
    map::Words {
        index_bits,
        place_bits: m.coordinate.format.frac_bits + 1,
        fraction: m.fraction,
        light: m.light,
        cached,
    }
}

/// The word of slopes. A machine that has none for its rays is a misfit, told as that.
fn slope_word(m: &Description) -> Word {
    m.slope.unwrap_or(m.facing)
}

/// Longest way from the unit normal to the light that it mirrors.
pub fn way_to_light(machine: &Machine, m: &Description) -> Path {
    let [normal, facing, direction, coordinate] =
        [machine.shade.normal, m.facing, m.direction, m.coordinate].map(|word| word.format.width());
    let reciprocal_bits = m.reciprocal.bits.min(64) as i32;
    let seen = match m.sight {
        // The normal's own third part, and three products.
        Sight::Axis => Path::default().fit(facing),
        Sight::Ray => {
            let slope = slope_word(m).format.width();
            Path::default()
                .product(normal, slope)
                .sum_of_three(normal + slope)
                .fit(facing)
        }
    };
    seen.product(facing, normal)
        .sum(facing + normal)
        .fit(direction)
        .sum_of_three(direction)
        .then(reciprocal::path(m.reciprocal, direction + 2))
        .product(direction, reciprocal_bits)
        .shift(direction + reciprocal_bits)
        .fit(coordinate)
        .limit(coordinate)
        // Folded, and on its side of the middle.
        .sum(coordinate)
        .sum(coordinate)
        .then(map::path(&map_words(machine, m)))
}

/// Longest way from light to the colour that leaves.
pub fn way_to_colour(machine: &Machine, m: &Description) -> Path {
    let [light, reflectance, colour] =
        [m.light, m.reflectance, machine.shade.colour].map(|word| word.format.width());
    Path::default()
        .product(light.max(colour), reflectance)
        .sum(light.max(colour) + reflectance)
        .limit(light + reflectance)
        .fit(colour)
}

/// The elaborated unit.
#[derive(Clone, Debug)]
pub struct Reflect {
    sight: Sight,
    slope: Fit,
    facing: Fit,
    direction: Fit,
    reciprocal: Reciprocal,
    coordinate: Fit,
    map: Map,
    colour: Fit,
    words: Words,
}

/// What a mirror shows at a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seen {
    /// a and b of the ray (`reflect.slope`).
    pub slopes: [i64; 2],
    /// R (`reflect.direction`).
    pub direction: [i64; 3],
    /// Column and row of the first of four texels.
    pub texel: [usize; 2],
    /// Light between them (`reflect.light`).
    pub light: [i64; 3],
}

/// Places that align terms, and the words for 1.
#[derive(Clone, Copy, Debug)]
struct Words {
    /// Fraction bits of pixels less that of twice a distance.
    half: u32,
    /// 1 beside slopes.
    forward: i64,
    /// Fraction bits of slopes.
    slope_places: u32,
    /// Twice a facing × normal, and what is added to it.
    mirrored: u32,
    seen: u32,
    coordinate_one: i64,
    reflectance_one: i64,
    /// Colour × reflectance, and light × reflectance.
    kept: u32,
    lit: u32,
    /// 1 in the exact sum of both.
    colour_one: i64,
}

impl Reflect {
    /// Elaborates the unit; none where the machine has none.
    pub fn new(e: &mut Elaboration, machine: &Machine) -> Option<Self> {
        let m = machine.reflect.as_ref()?;
        let (normal, colour) = (machine.shade.normal, machine.shade.colour);
        let (is_ray, slope_word) = (m.sight == Sight::Ray, slope_word(m));
        e.require(!is_ray || m.slope.is_some(), || {
            format!("{UNIT}.sight is `ray`, and it has no word {UNIT}.slope: {slope_word} would do")
        });
        for (name, word, signed) in [
            ("slope", slope_word, true),
            ("facing", m.facing, true),
            ("direction", m.direction, true),
            ("coordinate", m.coordinate, false),
            ("fraction", m.fraction, false),
            ("light", m.light, false),
            ("reflectance", m.reflectance, false),
        ] {
            if is_ray || name != "slope" {
                e.number(UNIT, name, word, signed);
                e.holds_one(UNIT, name, word);
                e.fixed_point(UNIT, name, word);
            }
        }
        e.within(UNIT, "index_bits", m.index_bits, 1, MOST_INDEX_BITS);
        let pixel = machine.project.pixel;
        let from_centre = Exact::from(FROM_MIDDLE).plus(pixel);
        let offset = Format::signed(from_centre.int_bits + 1, from_centre.frac_bits);
        let sloped = Exact::from(offset).times(machine.ellipse.inverse_focal);
        let (slope, slope_places, facing_sum) = if is_ray {
            e.copies(2, |e| {
                e.sum(UNIT, [FROM_MIDDLE.into(), pixel.into()]);
                e.times(UNIT, offset, machine.ellipse.inverse_focal)
            });
            let slope = e.copies(2, |e| e.fit_shifted(UNIT, "slope", slope_word, sloped));
            let along = e.copies(2, |e| e.times(UNIT, normal, slope_word));
            (
                slope,
                slope_word.format.frac_bits.clamp(0, 30) as u32,
                e.sum(UNIT, [along, along, normal.into()]),
            )
        } else {
            (Fit::new(0, slope_word, sloped), 0, normal.into())
        };
        // The normal's negative.
        e.adders(UNIT, 1, facing_sum.bits());
        let facing = e.fit(UNIT, "facing", m.facing, facing_sum);
        let doubled = e.copies(3, |e| e.times(UNIT, m.facing, normal)).doubled();
        let seen = if is_ray {
            Exact::from(slope_word)
        } else {
            Exact {
                int_bits: 1,
                frac_bits: 0,
            }
        };
        let mirrored = e.copies(if is_ray { 3 } else { 1 }, |e| e.sum(UNIT, [doubled, seen]));
        let direction = e.copies(3, |e| e.fit(UNIT, "direction", m.direction, mirrored));
        let direction_bits = m.direction.format.width();
        // Magnitudes, their sum, and at least a place of it.
        e.adders(UNIT, 3, direction_bits);
        e.adders(UNIT, 2, direction_bits + 2);
        e.normaliser(UNIT, direction_bits + 2);
        let reciprocal = Reciprocal::new(
            e,
            UNIT,
            "reciprocal",
            m.reciprocal,
            m.direction.format.frac_bits,
        );
        let laid = e.copies(2, |e| e.times(UNIT, m.direction, m.reciprocal.format()));
        let coordinate = e.copies(2, |e| e.fit_shifted(UNIT, "coordinate", m.coordinate, laid));
        let coordinate_bits = m.coordinate.format.width();
        e.copies(2, |e| {
            e.limit(UNIT, coordinate_bits);
            // 1 − the other one, or not; 1 more or 1 less.
            e.adders(UNIT, 2, coordinate_bits);
            e.choice(UNIT, 2, coordinate_bits);
        });
        let map = Map::new(e, UNIT, map_words(machine, m));
        let kept = e.copies(3, |e| e.times(UNIT, colour, m.reflectance));
        let lit = e.copies(3, |e| e.times(UNIT, m.light, m.reflectance));
        let mixed_places = kept.frac_bits.max(lit.frac_bits);
        let places = |finer: i32, coarser: i32| (finer - coarser).clamp(0, 62) as u32;
        Some(Reflect {
            sight: m.sight,
            slope,
            facing,
            direction,
            reciprocal,
            coordinate,
            map,
            colour: e.copies(3, |e| {
                let sum = e.sum(UNIT, [kept, lit]);
                // At most 1, or no normal.
                e.limit(UNIT, sum.bits());
                e.choice(UNIT, 2, colour.format.width());
                e.fit(UNIT, "colour", colour, sum)
            }),
            words: Words {
                half: (pixel.format.frac_bits - 1).clamp(0, 62) as u32,
                forward: 1 << slope_places,
                slope_places,
                mirrored: 1 + places(mirrored.frac_bits, doubled.frac_bits),
                seen: places(mirrored.frac_bits, seen.frac_bits),
                coordinate_one: m.coordinate.format.one(),
                reflectance_one: m.reflectance.format.one(),
                kept: places(mixed_places, kept.frac_bits),
                lit: places(mixed_places, lit.frac_bits),
                colour_one: 1 << mixed_places.clamp(0, 62),
            },
        })
    }

    /// Its map.
    pub fn map(&self) -> &Map {
        &self.map
    }

    /// 1/(|x| + |y| + |z|).
    pub fn reciprocal(&self) -> &Reciprocal {
        &self.reciprocal
    }

    /// Whether a material mirrors anything: what does not passes as it is.
    pub fn mirrors(&self, registers: &Registers, material: usize) -> bool {
        let mirror = registers.surroundings.mirrors[material];
        mirror.mirrored != [0; 3] || mirror.kept != self.words.reflectance_one
    }

    /// The colour that leaves a surface of this colour and unit normal, at most 1; `pixel` is a
    /// column and a row.
    pub fn one<P: Probe>(
        &self,
        registers: &Registers,
        material: usize,
        pixel: [i64; 2],
        normal: [i64; 3],
        colour: [i64; 3],
        tap: &mut Tap<P>,
    ) -> [i64; 3] {
        let (w, mirror) = (self.words, registers.surroundings.mirrors[material]);
        let direction = self.direction(registers, pixel, normal, tap);
        let place = self.place(direction, tap);
        let light = self.map.light(&registers.surroundings.texels, place, tap);
        let exact = three!(i => ((colour[i] * mirror.kept) << w.kept) + ((light[i] * mirror.mirrored[i]) << w.lit));
        tap.fit_three(&self.colour, three!(i => exact[i].min(w.colour_one)))
    }

    /// What a mirror of this unit normal shows at a pixel.
    pub fn seen(&self, registers: &Registers, pixel: [i64; 2], normal: [i64; 3]) -> Seen {
        let probe = &mut NoProbe;
        let tap = &mut Tap::new(probe);
        let slopes = self.slopes(registers, pixel, tap);
        let direction = self.direction(registers, pixel, normal, tap);
        let place = self.place(direction, tap);
        let light = self.map.light(&registers.surroundings.texels, place, tap);
        Seen {
            slopes,
            direction,
            texel: self.map.texel(place),
            light,
        }
    }

    /// R, where the mirror is seen.
    fn direction<P: Probe>(
        &self,
        registers: &Registers,
        pixel: [i64; 2],
        n: [i64; 3],
        tap: &mut Tap<P>,
    ) -> [i64; 3] {
        let w = self.words;
        let [a, b] = self.slopes(registers, pixel, tap);
        let facing = tap.fit_one(
            &self.facing,
            -(n[0] * a + n[1] * b + (n[2] << w.slope_places)),
        );
        let seen = [a, b, w.forward];
        tap.fit_three(
            &self.direction,
            three!(i => ((facing * n[i]) << w.mirrored) + (seen[i] << w.seen)),
        )
    }

    /// a and b of the pixel's ray (a, b, 1).
    fn slopes<P: Probe>(
        &self,
        registers: &Registers,
        pixel: [i64; 2],
        tap: &mut Tap<P>,
    ) -> [i64; 2] {
        if self.sight == Sight::Axis {
            return [0; 2];
        }
        [0, 1].map(|axis| {
            let Scaled { mantissa, places } = registers.inverse_focals[axis];
            let from_middle = (2 * pixel[axis] + 1 - registers.size_px[axis]) << self.words.half;
            tap.fit_one_shifted(
                &self.slope,
                (from_middle - registers.centre[axis]) * mantissa,
                places,
            )
        })
    }

    /// Where a direction lies in the map, from 0 to 1 with one fraction bit more than `coordinate`.
    fn place<P: Probe>(&self, [x, y, z]: [i64; 3], tap: &mut Tap<P>) -> [i64; 2] {
        let one = self.words.coordinate_one;
        let sum = (x.abs() + y.abs() + z.abs()).max(1);
        let (inverse, exponent) = self.reciprocal.one(sum, tap);
        let [across, down] = [x, y].map(|part| {
            tap.fit_one_shifted(&self.coordinate, part.abs() * inverse, -exponent)
                .min(one)
        });
        // What points away from the viewer lies beyond the diagonals.
        let [across, down] = if z >= 0 {
            [one - down, one - across]
        } else {
            [across, down]
        };
        [
            one + if x >= 0 { across } else { -across },
            one + if y >= 0 { down } else { -down },
        ]
    }
}

pub mod real;

#[cfg(test)]
mod tests;

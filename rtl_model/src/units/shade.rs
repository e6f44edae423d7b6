//! Shade: turns a fragment's sums into the light that leaves it (docs/book/algorithm-resolve.md
//! §7): normalise, Blinn-Phong, coverage.
//!
//! ```text
//! weight_sum ─►[ 1/W ]─┬────────────►(×)─► rgb, opacity ──────────────────►(×)─► colour ─►(×)─► premultiplied
//! colour_sum ─►[ << ]──┴─► share ─────┘                irradiance ──────────┘               │
//! normal_sum ─►[ << ]─► normal_share ─►[ 1/|n| ]─► normal ─►[ N·L, N·H ]─┬┘ highlight ─►(+) │
//! weight_sum ─►[ min(1, W/τ) ]─► coverage ────────────────────────────────────────────────►(×)
//! ```
//! Sums are first shifted by the power of two that brings W to [1, 2), so that a thinly covered
//! pixel keeps its colour's precision.
//!
//! Losses: all words are rounded to nearest; `colour` is clamped to 1 before it is fitted.
//!
//! Laws: `white_stays_white`, `shading_ignores_the_length_of_a_normal`.

use crate::elaboration::latency::{Path, SUM};
use crate::elaboration::{Elaboration, Operator};
use crate::frame::{Frame, Light, Lighting, Material, Scaled};
use crate::functions::{Reciprocal, ReciprocalRoot, Table, reciprocal, square_root, table};
use crate::machine::Machine;
use crate::num::{Fit, Word, three};
use crate::probe::{NoProbe, Probe, Tap};
use crate::records::unit;
use reflect::Reflect;

pub use crate::records::{ShadeInput as Input, ShadeOutput as Output};

const UNIT: &str = unit::SHADE;

/// Registers that a frame loads.
#[derive(Clone, Copy, Debug)]
pub struct LightRegisters<'a> {
    /// Lights and materials.
    pub lighting: &'a Lighting,
    /// The materials' highlight tables, by material.
    pub highlights: &'a [Option<Table>],
    /// τ (`fragment.weight_sum`).
    pub coverage_threshold: i64,
    /// 1/τ (`shade.inverse_threshold`).
    pub inverse_threshold: Scaled,
    /// What is mirrored; none where nothing is.
    pub surroundings: Option<reflect::Registers<'a>>,
}

impl<'a> LightRegisters<'a> {
    /// A frame's, with its materials' tables ([`Shade::highlights`]).
    pub fn of(frame: &'a Frame, highlights: &'a [Option<Table>]) -> Self {
        let Frame {
            lighting,
            coverage_threshold,
            inverse_threshold,
            ..
        } = frame;
        LightRegisters {
            lighting,
            highlights,
            coverage_threshold: *coverage_threshold,
            inverse_threshold: *inverse_threshold,
            surroundings: reflect::Registers::of(frame),
        }
    }
}

/// Longest way: 1/W beside the unit normal; cosine; highlight beside irradiance and colour;
/// coverage and opacity.
pub fn path(machine: &Machine) -> Path {
    let (m, f) = (&machine.shade, &machine.fragment);
    let bits = |word: Word| word.format.width();
    let [share, normal, root] = [
        bits(m.normal_share),
        bits(m.normal),
        m.root.bits.min(64) as i32,
    ];
    let unit_normal = Path::default()
        .normalise(bits(f.weight_sum))
        .product_of(m.normal_share, m.normal_share)
        .sum_of_three(2 * share)
        .then(square_root::path(m.root, 2 * share))
        .product(m.normal_share.format.factor_bits(), root)
        .shift(normal)
        .fit_word(m.normal, share + root);
    let shining =
        table::path(m.highlight_table, bits(m.highlight)).product_of(m.highlight, m.reflectance);
    let lighting = Path::default()
        .product_of(m.cosine, m.reflectance)
        .accumulate([m.irradiance])
        .product_of(m.rgb, m.irradiance);
    let prepared = reciprocal::path(m.reciprocal, bits(f.weight_sum)).parallel(unit_normal);
    let lit = prepared
        .product_of(m.normal, m.light)
        .sum_of_three(normal + bits(m.light))
        .fit(bits(m.cosine))
        // Each has registers of its own, and coverage some.
        .then(Path {
            cycles: shining.cycles + lighting.cycles + SUM,
            ..shining.parallel(lighting)
        })
        .accumulate([m.colour]);
    let leaving = match &machine.reflect {
        None => lit,
        Some(m) => lit
            .parallel(prepared.then(reflect::way_to_light(machine, m)))
            .then(reflect::way_to_colour(machine, m)),
    };
    leaving
        .product_of(m.colour, m.premultiplied)
        .fit_word(m.premultiplied, bits(m.colour) + bits(m.premultiplied))
}

/// The elaborated unit.
#[derive(Clone, Debug)]
pub struct Shade {
    reciprocal: Reciprocal,
    root: ReciprocalRoot,
    weight_share: Fit,
    colour_share: Fit,
    opacity_share: Fit,
    normal_share: Fit,
    rgb: Fit,
    opacity: Fit,
    normal: Fit,
    cosine: Fit,
    highlight: Fit,
    irradiance: Fit,
    colour: Fit,
    coverage: Fit,
    covered: Fit,
    premultiplied: Fit,
    words: Words,
    highlight_table: crate::machine::TableShape,
    /// None where the machine mirrors nothing.
    reflect: Option<Reflect>,
}

/// Places that align terms, and the words for 1.
#[derive(Clone, Copy, Debug)]
struct Words {
    /// Ambient with cosine × reflectance.
    ambient: u32,
    /// Lit colour with highlight × reflectance.
    lit: u32,
    glossy: u32,
    /// 1 in the exact sum of both.
    colour_one: i64,
    rgb_to_colour: u32,
    opacity_one: i64,
    coverage_one: i64,
    cosine_one: i64,
    highlight_argument_bits: u32,
}

impl Shade {
    /// Elaborates the unit.
    pub fn new(e: &mut Elaboration, machine: &Machine) -> Self {
        let (m, f) = (&machine.shade, &machine.fragment);
        for (name, word, signed) in [
            ("share", m.share, false),
            ("normal_share", m.normal_share, true),
            ("rgb", m.rgb, false),
            ("opacity", m.opacity, false),
            ("normal", m.normal, true),
            ("light", m.light, true),
            ("cosine", m.cosine, true),
            ("highlight", m.highlight, false),
            ("reflectance", m.reflectance, false),
            ("irradiance", m.irradiance, false),
            ("colour", m.colour, false),
            ("inverse_threshold", m.inverse_threshold, false),
            ("coverage", m.coverage, false),
            ("premultiplied", m.premultiplied, false),
        ] {
            e.number(UNIT, name, word, signed);
            e.holds_one(UNIT, name, word);
        }
        // A cosine is the argument of a table, up to the last place below 1.
        e.fixed_point(UNIT, "cosine", m.cosine);
        e.fixed_point(UNIT, "highlight", m.highlight);
        e.normaliser(UNIT, f.weight_sum.format.width());
        let reciprocal = Reciprocal::new(
            e,
            UNIT,
            "reciprocal",
            m.reciprocal,
            f.weight_sum.format.frac_bits,
        );
        let inverse = m.reciprocal.format();
        let divided = e.copies(4, |e| e.times(UNIT, m.share, inverse));
        let squared = e.copies(3, |e| e.times(UNIT, m.normal_share, m.normal_share));
        e.holds_exact(
            "the operand of shade.root, Σ shade.normal_share², normalised,",
            squared.plus(squared).plus(squared).plus(squared),
        );
        let squares = e.sum(UNIT, [squared; 3]);
        e.normaliser(UNIT, squares.bits());
        let root = ReciprocalRoot::new(e, UNIT, "root", m.root, squared.frac_bits);
        let unit_normal = e.copies(3, |e| e.times(UNIT, m.normal_share, m.root.format()));
        // One light, and its half-way vector, at a time.
        let projected = e.copies(6, |e| e.times(UNIT, m.normal, m.light));
        let lit = e.copies(3, |e| e.times(UNIT, m.cosine, m.reflectance));
        let coloured = e.copies(3, |e| e.times(UNIT, m.rgb, m.irradiance));
        let glossy = e.copies(3, |e| e.times(UNIT, m.highlight, m.reflectance));
        let covered = e.times(UNIT, m.share, m.inverse_threshold);
        let thinned = e.times(UNIT, m.opacity, m.coverage);
        let premultiplied = e.copies(3, |e| e.times(UNIT, m.colour, m.premultiplied));
        let cosine_bits = m.cosine.format.frac_bits.clamp(1, 30);
        let highlight_table =
            table::shape(e, UNIT, "highlight_table", m.highlight_table, cosine_bits);
        let fraction_bits = Table::fraction_bits(highlight_table.index_bits, cosine_bits as u32);
        table::interpolator(e, UNIT, highlight_table, m.highlight, fraction_bits);
        // Its words are the materials': as many as a frame has.
        e.part(
            UNIT,
            Operator::Rom([
                1 << highlight_table.index_bits,
                m.highlight.format.stored_bits(),
            ]),
        );
        let colour_frac_bits = coloured.frac_bits.max(glossy.frac_bits);
        // At most 1, and coverage 1 from the threshold on.
        e.limit(UNIT, m.opacity.format.width());
        e.limit(UNIT, m.coverage.format.width());
        e.adders(UNIT, 1, f.weight_sum.format.width());
        // The normal, turned; cosines, not negative, and that of a highlight below 1.
        e.copies(3, |e| e.limit(UNIT, m.normal.format.width()));
        e.choice(UNIT, 3, m.cosine.format.stored_bits());
        e.limit(UNIT, m.cosine.format.width());
        let places = |finer: i32, coarser: i32| (finer - coarser).clamp(0, 62) as u32;
        Shade {
            reciprocal,
            root,
            weight_share: e.fit_shifted(UNIT, "share", m.share, f.weight_sum),
            colour_share: e.copies(3, |e| e.fit_shifted(UNIT, "share", m.share, f.colour_sum)),
            opacity_share: e.fit_shifted(UNIT, "share", m.share, f.opacity_sum),
            normal_share: e.copies(3, |e| {
                e.fit_shifted(UNIT, "normal_share", m.normal_share, f.normal_sum)
            }),
            rgb: e.copies(3, |e| e.fit(UNIT, "rgb", m.rgb, divided)),
            opacity: e.fit(UNIT, "opacity", m.opacity, divided),
            normal: e.copies(3, |e| e.fit_shifted(UNIT, "normal", m.normal, unit_normal)),
            cosine: e.copies(2, |e| {
                let sum = e.sum(UNIT, [projected; 3]);
                e.fit(UNIT, "cosine", m.cosine, sum)
            }),
            highlight: e.fit(
                UNIT,
                "highlight",
                m.highlight,
                table::interpolated(m.highlight, fraction_bits),
            ),
            irradiance: e.copies(3, |e| {
                let sum = lit.plus(lit).plus(lit);
                e.part(UNIT, Operator::Adder(sum.bits()));
                e.fit(UNIT, "irradiance", m.irradiance, sum)
            }),
            colour: e.copies(3, |e| {
                let sum = e.sum(UNIT, [coloured, glossy, glossy]);
                // Or unlit; at most 1.
                e.choice(UNIT, 2, sum.bits());
                e.limit(UNIT, sum.bits());
                e.fit(UNIT, "colour", m.colour, sum)
            }),
            coverage: e.fit_shifted(UNIT, "coverage", m.coverage, covered),
            covered: e.fit(UNIT, "premultiplied", m.premultiplied, thinned),
            premultiplied: e.copies(3, |e| {
                e.fit(UNIT, "premultiplied", m.premultiplied, premultiplied)
            }),
            words: Words {
                ambient: places(lit.frac_bits, m.reflectance.format.frac_bits),
                lit: places(colour_frac_bits, coloured.frac_bits),
                glossy: places(colour_frac_bits, glossy.frac_bits),
                colour_one: 1 << colour_frac_bits.clamp(0, 62),
                rgb_to_colour: places(colour_frac_bits, m.rgb.format.frac_bits),
                opacity_one: m.opacity.format.one(),
                coverage_one: m.coverage.format.one(),
                cosine_one: m.cosine.format.one(),
                highlight_argument_bits: cosine_bits as u32,
            },
            highlight_table,
            reflect: Reflect::new(e, machine),
        }
    }

    /// What mirrors surroundings; none where the machine has none.
    pub fn reflect(&self) -> Option<&Reflect> {
        self.reflect.as_ref()
    }

    /// 1/W.
    pub fn reciprocal(&self) -> &Reciprocal {
        &self.reciprocal
    }

    /// 1/|n|.
    pub fn root(&self) -> &ReciprocalRoot {
        &self.root
    }

    /// The highlight table of each material, elaborated from its words.
    pub fn highlights(&self, lighting: &Lighting) -> Vec<Option<Table>> {
        let table = |material: &Material| match material {
            Material::Unlit => None,
            Material::BlinnPhong { highlight, .. } => Some(self.highlight(highlight)),
        };
        lighting.materials.iter().map(table).collect()
    }

    fn highlight(&self, words: &[i64]) -> Table {
        let shape = self.highlight_table;
        Table::new(
            self.highlight,
            shape.index_bits,
            self.words.highlight_argument_bits,
            shape.interpolation,
            words,
        )
    }

    /// Shades one fragment.
    pub fn one<P: Probe>(
        &self,
        registers: &LightRegisters,
        input: &Input,
        tap: &mut Tap<P>,
    ) -> Output {
        if input.weight <= 0 {
            return Output::default();
        }
        let (inverse, exponent) = self.reciprocal.one(input.weight, tap);
        let share = tap.fit_three_shifted(&self.colour_share, input.colour, -exponent);
        let rgb = tap.fit_three(&self.rgb, three!(i => share[i] * inverse));
        let opacity_share = tap.fit_one_shifted(&self.opacity_share, input.opacity, -exponent);
        let opacity = tap
            .fit_one(&self.opacity, opacity_share * inverse)
            .min(self.words.opacity_one);

        let colour = self.lit(registers, input, rgb, exponent, tap);
        let coverage = self.coverage(registers, input.weight, exponent, tap);
        let opacity = tap.fit_one(&self.covered, opacity * coverage);
        Output {
            colour: tap.fit_three(&self.premultiplied, three!(i => colour[i] * opacity)),
            opacity,
        }
    }

    /// What a fragment mirrors; none where that is nothing.
    pub fn mirrored(&self, registers: &LightRegisters, input: &Input) -> Option<reflect::Seen> {
        let (unit, of) = self
            .mirror(registers, input.material as usize)
            .filter(|_| input.weight > 0)?;
        let probe = &mut NoProbe;
        let tap = &mut Tap::new(probe);
        let (_, exponent) = self.reciprocal.one(input.weight, tap);
        Some(unit.seen(
            of,
            input.pixel,
            self.unit_normal(input.normal, exponent, tap)?,
        ))
    }

    /// What mirrors in a material, and its registers; none where nothing does.
    fn mirror<'a>(
        &'a self,
        registers: &'a LightRegisters,
        material: usize,
    ) -> Option<(&'a Reflect, &'a reflect::Registers<'a>)> {
        self.reflect
            .as_ref()
            .zip(registers.surroundings.as_ref())
            .filter(|(unit, of)| unit.mirrors(of, material))
    }

    /// min(1, W/τ).
    fn coverage<P: Probe>(
        &self,
        registers: &LightRegisters,
        weight: i64,
        exponent: i64,
        tap: &mut Tap<P>,
    ) -> i64 {
        if weight >= registers.coverage_threshold {
            return self.words.coverage_one;
        }
        let share = tap.fit_one_shifted(&self.weight_share, weight, -exponent);
        let Scaled { mantissa, places } = registers.inverse_threshold;
        tap.fit_one_shifted(&self.coverage, share * mantissa, exponent + places)
            .min(self.words.coverage_one)
    }

    /// The colour that leaves the surface, at most 1.
    fn lit<P: Probe>(
        &self,
        registers: &LightRegisters,
        input: &Input,
        rgb: [i64; 3],
        exponent: i64,
        tap: &mut Tap<P>,
    ) -> [i64; 3] {
        let w = self.words;
        let material = input.material as usize;
        let mirror = self.mirror(registers, material);
        let (
            Material::BlinnPhong {
                ambient,
                diffuse,
                specular,
                ..
            },
            Some(table),
        ) = (
            &registers.lighting.materials[material],
            &registers.highlights[material],
        )
        else {
            let colour = tap.fit_three(
                &self.colour,
                three!(i => (rgb[i] << w.rgb_to_colour).min(w.colour_one)),
            );
            let Some((unit, of)) = mirror else {
                return colour;
            };
            let normal = self.unit_normal(input.normal, exponent, tap);
            return normal.map_or(colour, |normal| {
                unit.one(of, material, input.pixel, normal, colour, tap)
            });
        };
        let normal = self.unit_normal(input.normal, exponent, tap);
        let mut irradiance = [*ambient << w.ambient; 3];
        let mut gloss = [0; 3];
        for (
            i,
            Light {
                direction,
                half_way,
            },
        ) in registers.lighting.lights.iter().enumerate()
        {
            let Some(normal) = normal else { break };
            let towards = self.cosine(normal, *direction, tap);
            let shine = half_way.map_or(0, |half_way| {
                let cosine = self.cosine(normal, half_way, tap).min(w.cosine_one - 1);
                tap.fit_one(table.fit(), table.exact(cosine))
            });
            irradiance = three!(channel => irradiance[channel] + towards * diffuse[i][channel]);
            gloss = three!(channel => gloss[channel] + shine * specular[i][channel]);
        }
        let irradiance = tap.fit_three(&self.irradiance, irradiance);
        let exact = three!(channel => ((rgb[channel] * irradiance[channel]) << w.lit) + (gloss[channel] << w.glossy));
        let colour = tap.fit_three(
            &self.colour,
            three!(channel => exact[channel].min(w.colour_one)),
        );
        match (mirror, normal) {
            (Some((unit, of)), Some(normal)) => {
                unit.one(of, material, input.pixel, normal, colour, tap)
            }
            _ => colour,
        }
    }

    /// max(0, N·direction).
    fn cosine<P: Probe>(&self, n: [i64; 3], direction: [i64; 3], tap: &mut Tap<P>) -> i64 {
        let exact = n[0] * direction[0] + n[1] * direction[1] + n[2] * direction[2];
        tap.fit_one(&self.cosine, exact).max(0)
    }

    /// The unit normal, turned towards the viewer; none where the sums cancel.
    fn unit_normal<P: Probe>(
        &self,
        sums: [i64; 3],
        exponent: i64,
        tap: &mut Tap<P>,
    ) -> Option<[i64; 3]> {
        let share = tap.fit_three_shifted(&self.normal_share, sums, -exponent);
        let squared = share[0] * share[0] + share[1] * share[1] + share[2] * share[2];
        if squared == 0 {
            return None;
        }
        let (inverse, exponent) = self.root.one(squared, tap);
        let normal =
            tap.fit_three_shifted(&self.normal, three!(i => share[i] * inverse), -exponent);
        Some(if normal[2] > 0 {
            three!(i => -normal[i])
        } else {
            normal
        })
    }
}

pub mod lanes;
pub mod real;
pub mod reflect;

#[cfg(test)]
mod tests;

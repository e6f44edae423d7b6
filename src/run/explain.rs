//! Explain: pixel trace of one pixel, of the machine and of `golden` in parallel: every
//! contribution, decision and layer.

use crate::error::{Error, Result};
use crate::golden;
use crate::golden::{PixelTrace, TracedContribution};
use crate::hardware::fixed;
use crate::hardware::quantise::{Quantised, Scale, quantise};
use crate::output::text::{aligned, plain_table};
use crate::scene::{Scene, Sheet};
use rtl_model::Machine;
use rtl_model::pipeline;
use rtl_model::pipeline::Elaborated;
use rtl_model::probe::Observer;
use rtl_model::units::fragment::{Contribution, Decision, Side};
use rtl_model::units::resolve::Layer;
use rtl_model::units::shade;
use rtl_model::units::shade::reflect;
use serde::Serialize;
use std::any::Any;
use std::collections::{HashMap, HashSet};
use std::fmt::Write;

/// Observes one pixel.
#[derive(Clone, Debug, Default)]
struct PixelProbe {
    pixel: [u32; 2],
    contributions: Vec<(Contribution, Decision)>,
    layers: Vec<Layer>,
    frame: Option<[i64; 4]>,
    /// Inputs to shading at the pixel since the last contribution, in the order of slots.
    lit: Vec<shade::Input>,
}

impl Observer<'static> for PixelProbe {
    fn fork(&self) -> Box<dyn Observer<'static>> {
        Box::new(PixelProbe {
            pixel: self.pixel,
            ..PixelProbe::default()
        })
    }

    fn hand_over(self: Box<Self>) -> Box<dyn Any + Send> {
        self
    }

    fn take_over(&mut self, seen: Box<dyn Any + Send>) {
        if let Ok(fork) = seen.downcast::<PixelProbe>() {
            self.contributions.extend(fork.contributions);
            self.layers.extend(fork.layers);
            self.lit.extend(fork.lit);
            self.frame = self.frame.or(fork.frame);
        }
    }

    fn contribution(&mut self, x: u32, y: u32, contribution: &Contribution, decision: Decision) {
        if [x, y] == self.pixel {
            self.lit.clear();
            self.contributions.push((*contribution, decision));
        }
    }

    fn shade_out(&mut self, input: &shade::Input, _output: &shade::Output) {
        if input.pixel == self.pixel.map(i64::from) {
            self.lit.push(*input);
        }
    }

    fn resolved(&mut self, x: u32, y: u32, layers: &[Layer], frame: [i64; 4]) {
        if [x, y] == self.pixel {
            self.layers = layers.to_vec();
            self.frame = Some(frame);
        }
    }
}

/// Returns the pixel trace of pixel (x, y) as text.
///
/// # Errors
/// [`Error::Input`] if the pixel is outside the picture, or the machine cannot be built or cannot
/// hold the scene.
pub fn explain(scene: &Scene, machine: &Machine, [x, y]: [usize; 2]) -> Result<String> {
    let seen = ObservedPixel::new(scene, machine, [x, y])?;
    let side_by_side = seen.explanation(scene);
    let mut text = format!("pixel {x},{y} of {} on {}\n\n", scene.name, machine.name);
    let _ = writeln!(text, "{}\n", side_by_side.contributions());
    let _ = writeln!(text, "{}\n", side_by_side.layers());
    if let Some(mirrors) = side_by_side.mirrors() {
        let _ = writeln!(text, "{mirrors}\n");
    }
    let _ = write!(text, "{}", side_by_side.end(seen.word));
    Ok(text)
}

/// The pixel trace in numbers.
///
/// # Errors
/// As [`explain`].
pub fn explained(scene: &Scene, machine: &Machine, pixel: [usize; 2]) -> Result<Explained> {
    let seen = ObservedPixel::new(scene, machine, pixel)?;
    Ok(seen.explanation(scene).numbers(scene, pixel, seen.word))
}

/// A pixel trace in numbers: depths in world units, colours in linear light, premultiplied.
#[derive(Clone, Debug, Serialize)]
pub struct Explained {
    /// The scene's name.
    pub scene: String,
    /// The machine's name.
    pub machine: String,
    /// Column and row; 0,0 is top left.
    pub pixel: [usize; 2],
    /// Slots per pixel.
    pub slots: u64,
    /// Contributions in the machine's order. Those that only `golden` has come before the next one
    /// that both have.
    pub contributions: Vec<ExplainedContribution>,
    /// Layers at the end, front to back.
    pub layers: ExplainedLayers,
    /// Reflected light of layers that no merge had shaded; left out if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mirrors: Option<ExplainedMirrors>,
    /// The machine's pixel.
    pub fixed: [f64; 4],
    /// The pixel of `golden`.
    pub golden: [f64; 4],
    /// Format of the frame word.
    pub frame_format: String,
    /// The frame word, channel by channel.
    pub frame_words: [i64; 4],
}

/// One contribution, on the machine and in `golden`.
#[derive(Clone, Debug, Serialize)]
pub struct ExplainedContribution {
    /// Index of its splat in the scene.
    pub splat: usize,
    /// None if only `golden` has it.
    pub fixed: Option<ExplainedArrival>,
    /// None if only the machine has it.
    pub golden: Option<ExplainedArrival>,
    /// Whether the two decided differently.
    pub flip: bool,
}

/// A contribution in one of the two.
#[derive(Clone, Debug, Serialize)]
pub struct ExplainedArrival {
    /// `r` at the pixel's centre.
    pub radial_index: f64,
    /// `w`.
    pub weight: f64,
    /// Depth, world units.
    pub z: f64,
    /// Its outcome, in words.
    pub decision: String,
    /// The slot that it went into, if its number is known.
    pub slot: Option<usize>,
}

/// Layers on the machine and in `golden`.
#[derive(Clone, Debug, Serialize)]
pub struct ExplainedLayers {
    /// Layers of the machine.
    pub fixed: Vec<ExplainedLayer>,
    /// Layers of `golden`.
    pub golden: Vec<ExplainedLayer>,
}

/// One layer.
#[derive(Clone, Debug, Serialize)]
pub struct ExplainedLayer {
    /// Its slot.
    pub slot: usize,
    /// Its depth, world units.
    pub z: f64,
    /// Sum of its weights; none for a merged layer.
    pub weight: Option<f64>,
    /// Colour times opacity.
    pub rgb: [f64; 3],
    /// Opacity.
    pub opacity: f64,
}

/// Reflected light on the machine and in `golden`.
#[derive(Clone, Debug, Serialize)]
pub struct ExplainedMirrors {
    /// Reflected light on the machine.
    pub fixed: Vec<ExplainedMirror>,
    /// Reflected light in `golden`.
    pub golden: Vec<ExplainedMirror>,
}

/// Reflected light of one layer.
#[derive(Clone, Debug, Serialize)]
pub struct ExplainedMirror {
    /// The layer's position, front to back.
    pub layer: usize,
    /// a and b of the ray (a, b, 1) that is mirrored.
    pub slopes: [f64; 2],
    /// Its mirror image, in camera space.
    pub direction: [f64; 3],
    /// Column and row of the first of the map's four texels.
    pub texel: [usize; 2],
    /// Light interpolated between them.
    pub light: [f64; 3],
    /// Share of this light in the reflected colour: reflect times tint.
    pub share: [f64; 3],
}

/// All observations of a pixel.
struct ObservedPixel {
    machine: Elaborated,
    scale: Scale,
    probe: PixelProbe,
    trace: PixelTrace,
    /// Reflected light of the machine's layers.
    mirrors: Vec<ExplainedMirror>,
    /// The frame word.
    word: [i64; 4],
}

impl ObservedPixel {
    fn new(scene: &Scene, machine: &Machine, [x, y]: [usize; 2]) -> Result<Self> {
        let (width, height) = (scene.image.width, scene.image.height);
        if x >= width || y >= height {
            return Err(Error::input(format!(
                "--pixel {x},{y}: the picture is {width}×{height}, so X is 0 to {} and Y 0 to {}",
                width - 1,
                height - 1
            )));
        }
        let elaborated = fixed::elaborate(machine)?;
        let quantised = quantise(scene, machine)?;
        let mut probe = PixelProbe {
            pixel: [x as u32, y as u32],
            ..PixelProbe::default()
        };
        // Only an observed drawing reports the inputs to shading.
        let draw = if quantised.frame.surroundings.is_some() {
            pipeline::draw_observed
        } else {
            pipeline::draw_with_decisions
        };
        let drawing = draw(&elaborated, &quantised.frame, &mut probe);
        let mirrors = mirrors(&elaborated, &quantised, &probe);
        let trace = golden::pixel_trace(scene, &fixed::rules(machine), x, y);
        let word = drawing.frame[y * width + x].map(i64::from);
        Ok(ObservedPixel {
            machine: elaborated,
            scale: quantised.scale,
            probe,
            trace,
            mirrors,
            word,
        })
    }

    fn explanation<'a>(&'a self, scene: &'a Scene) -> Explanation<'a> {
        let ObservedPixel {
            machine,
            scale,
            probe,
            trace,
            mirrors,
            ..
        } = self;
        Explanation {
            machine,
            scale: *scale,
            fixed: probe,
            golden: trace,
            mirrors,
            sheet: (scene.sheets.as_ref()).map(|sheets| match &sheets.of {
                Sheet::Splat if machine.machine.sums_gaussians() => &Sheet::Sum,
                of => of,
            }),
        }
    }
}

struct Explanation<'a> {
    machine: &'a Elaborated,
    scale: Scale,
    fixed: &'a PixelProbe,
    golden: &'a PixelTrace,
    mirrors: &'a [ExplainedMirror],
    /// None if fragments are grouped by depth.
    sheet: Option<&'a Sheet>,
}

/// A contribution on the machine, in `golden`, or in both.
type MatchedPair<'a> = (
    Option<&'a (Contribution, Decision)>,
    Option<&'a TracedContribution>,
);

impl Explanation<'_> {
    /// Matches contributions of the same splat, in the machine's order. Those that only `golden`
    /// has come before the next one that both have.
    fn pairs(&self) -> Vec<MatchedPair<'_>> {
        let (fixed, golden) = (&self.fixed.contributions, &self.golden.contributions);
        let in_golden: HashMap<usize, usize> = golden
            .iter()
            .enumerate()
            .map(|(nth, arrival)| (arrival.splat, nth))
            .collect();
        let in_fixed: HashSet<usize> = fixed
            .iter()
            .map(|(contribution, _)| contribution.splat as usize)
            .collect();
        let mut alone = golden
            .iter()
            .enumerate()
            .filter(|(_, arrival)| !in_fixed.contains(&arrival.splat))
            .peekable();
        let mut pairs: Vec<MatchedPair> = Vec::new();
        for one in fixed {
            let splat = one.0.splat as usize;
            let nth = in_golden.get(&splat).copied();
            while let Some((_, arrival)) = alone
                .next_if(|(other, arrival)| nth.map_or(arrival.splat < splat, |nth| *other < nth))
            {
                pairs.push((None, Some(arrival)));
            }
            pairs.push((Some(one), nth.map(|nth| &golden[nth])));
        }
        pairs.extend(alone.map(|(_, arrival)| (None, Some(arrival))));
        pairs
    }

    fn world_depth(&self, word: i64) -> f64 {
        self.machine.machine.fragment.depth.format.value(word) / self.scale.factor()
    }

    fn contributions(&self) -> String {
        let pairs = self.pairs();
        if pairs.is_empty() {
            return "No splat touches this pixel.".into();
        }
        let mut table = plain_table(&[
            "splat", "r", "w", "z", "decision", "golden r", "w", "z", "decision", "",
        ]);
        let mut flips = 0;
        for (fixed, golden) in &pairs {
            let splat = fixed
                .map(|(c, _)| c.splat as usize)
                .or(golden.map(|a| a.splat))
                .unwrap_or_default();
            let mut row = vec![splat.to_string()];
            row.extend(fixed.map_or_else(nothing, |(c, decision)| self.machine_row(c, *decision)));
            row.extend(golden.map_or_else(nothing, |arrival| self.golden_row(arrival)));
            let flip = row[4] != row[8];
            flips += usize::from(flip);
            row.push(if flip { "◄".into() } else { String::new() });
            table.add_row(row);
        }
        let mark = if flips > 0 { " (◄)" } else { "" };
        let count = pairs.len();
        format!(
            "{}\n\n{count} contributions, {flips} decided differently by the machine and by golden{mark}",
            aligned(table).trim_fmt()
        )
    }

    fn machine_row(&self, c: &Contribution, decision: Decision) -> [String; 4] {
        row_of(self.machine_arrival(c, decision))
    }

    fn golden_row(&self, arrival: &TracedContribution) -> [String; 4] {
        row_of(self.golden_arrival(arrival))
    }

    fn machine_arrival(&self, c: &Contribution, decision: Decision) -> ExplainedArrival {
        let gauss = &self.machine.machine.gauss;
        let of_sheet = self.sheet_decision(c.splat as usize, machine_sheet_decision(decision));
        let slot = match decision {
            Decision::Accumulated(slot)
            | Decision::Inserted(slot)
            | Decision::Late(slot, _)
            | Decision::Inside(slot) => Some(slot.into()),
            _ => None,
        };
        ExplainedArrival {
            radial_index: gauss.radial_index.format.value(c.radial_index),
            weight: gauss.weight.format.value(c.weight),
            z: self.world_depth(c.depth),
            slot: slot.filter(|_| of_sheet.is_none()),
            decision: of_sheet.unwrap_or_else(|| machine_decision(decision)),
        }
    }

    fn golden_arrival(&self, arrival: &TracedContribution) -> ExplainedArrival {
        let of_sheet = self.sheet_decision(arrival.splat, golden_sheet_decision(arrival.decision));
        let slot = match arrival.decision {
            golden::Decision::Accumulated { slot }
            | golden::Decision::Inserted { slot }
            | golden::Decision::Late { slot, .. }
            | golden::Decision::Inside { slot } => Some(slot),
            _ => None,
        };
        ExplainedArrival {
            radial_index: arrival.radial_index,
            weight: arrival.weight,
            z: arrival.z,
            slot: slot.filter(|_| of_sheet.is_none()),
            decision: of_sheet.unwrap_or_else(|| golden_decision(arrival.decision)),
        }
    }

    fn numbers(&self, scene: &Scene, pixel: [usize; 2], word: [i64; 4]) -> Explained {
        let machine = &self.machine.machine;
        let contribution = |(fixed, golden): (
            Option<&(Contribution, Decision)>,
            Option<&TracedContribution>,
        )| {
            let splat = fixed
                .map(|(c, _)| c.splat as usize)
                .or(golden.map(|arrival| arrival.splat))
                .unwrap_or_default();
            let fixed = fixed.map(|(c, decision)| self.machine_arrival(c, *decision));
            let golden = golden.map(|arrival| self.golden_arrival(arrival));
            let decision = |arrival: &Option<ExplainedArrival>| {
                arrival.as_ref().map(|arrival| arrival.decision.clone())
            };
            let flip = decision(&fixed) != decision(&golden);
            ExplainedContribution {
                splat,
                fixed,
                golden,
                flip,
            }
        };
        let premultiplied = machine.shade.premultiplied.format;
        let fixed = self.fixed.layers.iter().map(|layer| ExplainedLayer {
            slot: layer.slot,
            z: self.world_depth(layer.depth),
            weight: (!layer.merged).then(|| machine.fragment.weight_sum.format.value(layer.weight)),
            rgb: layer.colour.map(|channel| premultiplied.value(channel)),
            opacity: premultiplied.value(layer.opacity),
        });
        let golden = self.golden.layers.iter().map(|layer| ExplainedLayer {
            slot: layer.slot,
            z: layer.z,
            weight: (!layer.shaded).then_some(layer.weight),
            rgb: layer.colour,
            opacity: layer.coverage,
        });
        let format = machine.resolve.frame.format;
        Explained {
            scene: scene.name.clone(),
            machine: machine.name.clone(),
            pixel,
            slots: machine.fragment.layers.into(),
            contributions: self.pairs().into_iter().map(contribution).collect(),
            layers: ExplainedLayers {
                fixed: fixed.collect(),
                golden: golden.collect(),
            },
            mirrors: self.both_mirrors(),
            fixed: word.map(|channel| format.value(channel)),
            golden: self.golden.rgba,
            frame_format: format.to_string(),
            frame_words: word,
        }
    }

    /// None if fragments are grouped by depth.
    fn sheet_decision(&self, splat: usize, fate: SheetDecision) -> Option<String> {
        Some(match (self.sheet?, fate) {
            (_, SheetDecision::Dropped) => "too late".into(),
            (Sheet::Splat, _) => "blend".into(),
            (Sheet::Slice(numbers), SheetDecision::Added) => format!("add to {}", numbers[splat]),
            // Which one comes first is no decision.
            (Sheet::Sum, SheetDecision::Added | SheetDecision::Opened) => "add".into(),
            (Sheet::Slice(numbers), SheetDecision::Opened) => format!("open {}", numbers[splat]),
        })
    }

    /// The composite of all sheets.
    fn composite(&self) -> String {
        let premultiplied = self.machine.machine.shade.premultiplied.format;
        let mut table = plain_table(&["all sheets", "red", "green", "blue", "opacity"]);
        let fixed = self.fixed.layers.iter().map(|layer| {
            let [r, g, b] = layer.colour;
            (
                "fixed",
                [r, g, b, layer.opacity].map(|word| premultiplied.value(word)),
            )
        });
        let golden = self.golden.layers.iter().map(|layer| {
            let [r, g, b] = layer.colour;
            ("golden", [r, g, b, layer.coverage])
        });
        for (name, channels) in fixed.chain(golden) {
            table.add_row(
                std::iter::once(name.to_owned())
                    .chain(channels.map(|channel| format!("{channel:.5}"))),
            );
        }
        format!(
            "All sheets together; colour is multiplied by opacity:\n\n{}",
            aligned(table)
        )
    }

    fn layers(&self) -> String {
        let mut table = plain_table(&[
            "layer", "slot", "z", "weight", "red", "green", "blue", "opacity",
        ]);
        let premultiplied = self.machine.machine.shade.premultiplied.format;
        let weight = self.machine.machine.fragment.weight_sum.format;
        let merged = |merged: bool, weight: f64| {
            if merged {
                "merged".into()
            } else {
                format!("{weight:.5}")
            }
        };
        for (i, layer) in self.fixed.layers.iter().enumerate() {
            let mut row = vec![
                format!("fixed {i}"),
                layer.slot.to_string(),
                format!("{:.5}", self.world_depth(layer.depth)),
            ];
            row.push(merged(layer.merged, weight.value(layer.weight)));
            row.extend(
                layer
                    .colour
                    .iter()
                    .chain([&layer.opacity])
                    .map(|word| format!("{:.5}", premultiplied.value(*word))),
            );
            table.add_row(row);
        }
        for (i, layer) in self.golden.layers.iter().enumerate() {
            let mut row = vec![
                format!("golden {i}"),
                layer.slot.to_string(),
                format!("{:.5}", layer.z),
            ];
            row.push(merged(layer.shaded, layer.weight));
            row.extend(
                layer
                    .colour
                    .iter()
                    .chain([&layer.coverage])
                    .map(|value| format!("{value:.5}")),
            );
            table.add_row(row);
        }
        if self.fixed.layers.is_empty() && self.golden.layers.is_empty() {
            return "No layer is left: the pixel is background.".into();
        }
        if self.sheet.is_some() {
            return self.composite();
        }
        format!(
            "Layers at the end, front to back; colour is shaded and multiplied by opacity:\n\n{}",
            aligned(table)
        )
    }

    /// Reflected light of layers; none if there is none.
    fn both_mirrors(&self) -> Option<ExplainedMirrors> {
        let golden: Vec<ExplainedMirror> = (self.golden.layers.iter().enumerate())
            .filter_map(|(layer, of)| {
                let golden::Reflected {
                    slopes,
                    direction,
                    texel,
                    light,
                    share,
                } = of.mirrored?;
                Some(ExplainedMirror {
                    layer,
                    slopes,
                    direction,
                    texel,
                    light,
                    share,
                })
            })
            .collect();
        let fixed = self.mirrors.to_vec();
        (!fixed.is_empty() || !golden.is_empty()).then_some(ExplainedMirrors { fixed, golden })
    }

    fn mirrors(&self) -> Option<String> {
        let ExplainedMirrors { fixed, golden } = self.both_mirrors()?;
        let mut table = plain_table(&[
            "mirror",
            "ray a",
            "b",
            "goes to x",
            "y",
            "z",
            "texel",
            "light r",
            "g",
            "b",
            "share r",
            "g",
            "b",
        ]);
        for (whose, mirror) in fixed
            .iter()
            .map(|one| ("fixed", one))
            .chain(golden.iter().map(|one| ("golden", one)))
        {
            let ExplainedMirror {
                layer,
                slopes,
                direction,
                texel: [column, row],
                light,
                share,
            } = mirror;
            let numbers = |of: &[f64]| {
                of.iter()
                    .map(|value| format!("{value:.4}"))
                    .collect::<Vec<_>>()
            };
            let cells = [
                vec![format!("{whose} {layer}")],
                numbers(slopes),
                numbers(direction),
                vec![format!("{column},{row}")],
            ];
            table.add_row([cells.concat(), numbers(light), numbers(share)].concat());
        }
        Some(format!(
            "Reflected light of layers that no merge had shaded; texel is the first of four:\n\n{}",
            aligned(table).trim_fmt()
        ))
    }

    fn end(&self, word: [i64; 4]) -> String {
        let format = self.machine.machine.resolve.frame.format;
        let mut table = plain_table(&["blended", "red", "green", "blue", "alpha"]);
        let fixed = word.map(|word| format.value(word));
        let golden = self.golden.rgba;
        let row = |name: &str, values: [f64; 4]| {
            std::iter::once(name.to_owned())
                .chain(values.map(|v| format!("{v:.6}")))
                .collect::<Vec<_>>()
        };
        table.add_row(row("fixed", fixed));
        table.add_row(row("golden", golden));
        table.add_row(row(
            "difference",
            std::array::from_fn(|channel| fixed[channel] - golden[channel]),
        ));
        let words = word.map(|word| format!("{word:x}")).join(" ");
        format!(
            "{}\n\nframe word ({format}, hexadecimal): {words}",
            aligned(table)
        )
    }
}

/// Reflected light of layers that no merge had shaded. They were lit last, in the order of their
/// slots.
fn mirrors(
    machine: &Elaborated,
    Quantised { frame, .. }: &Quantised,
    probe: &PixelProbe,
) -> Vec<ExplainedMirror> {
    let (Some(words), Some(surroundings)) = (&machine.machine.reflect, &frame.surroundings) else {
        return Vec::new();
    };
    let highlights = machine.shade.highlights(&frame.lighting);
    let registers = shade::LightRegisters::of(frame, &highlights);
    let mut unlit: Vec<(usize, &Layer)> = probe
        .layers
        .iter()
        .enumerate()
        .filter(|(_, layer)| !layer.merged)
        .collect();
    unlit.sort_by_key(|(_, layer)| layer.slot);
    let slope = words.slope.map(|word| word.format);
    let explained = |((layer, _), input): ((usize, &Layer), &shade::Input)| {
        let reflect::Seen {
            slopes,
            direction,
            texel,
            light,
        } = machine.shade.mirrored(&registers, input)?;
        Some(ExplainedMirror {
            layer,
            slopes: slopes.map(|word| slope.map_or(0.0, |format| format.value(word))),
            direction: direction.map(|word| words.direction.format.value(word)),
            texel,
            light: light.map(|word| words.light.format.value(word)),
            share: surroundings.mirrors[input.material as usize]
                .mirrored
                .map(|word| words.reflectance.format.value(word)),
        })
    };
    // Splats that are lit before they are drawn are not lit here.
    let mut all: Vec<ExplainedMirror> = unlit
        .into_iter()
        .zip(&probe.lit)
        .filter_map(explained)
        .collect();
    all.sort_by_key(|mirror| mirror.layer);
    all
}

/// The cells of a contribution.
fn row_of(arrival: ExplainedArrival) -> [String; 4] {
    let ExplainedArrival {
        radial_index,
        weight,
        z,
        decision,
        ..
    } = arrival;
    [
        format!("{radial_index:.5}"),
        format!("{weight:.6}"),
        format!("{z:.5}"),
        decision,
    ]
}

fn nothing() -> [String; 4] {
    std::array::from_fn(|column| {
        if column == 3 {
            "none".into()
        } else {
            "–".into()
        }
    })
}

fn machine_decision(decision: Decision) -> String {
    match decision {
        Decision::Accumulated(slot) => format!("add to {slot}"),
        Decision::Inserted(slot) => format!("open {slot}"),
        Decision::Merged(front, back) => format!("merge {front}+{back}"),
        Decision::Evicted(true) => "evicted".into(),
        Decision::Evicted(false) => "evict deepest".into(),
        Decision::Replaced => "replace".into(),
        Decision::Dropped => "drop".into(),
        Decision::Late(slot, Side::Front) => format!("late, front of {slot}"),
        Decision::Late(slot, Side::Back) => format!("late, back of {slot}"),
        Decision::Inside(slot) => format!("inside {slot}"),
        Decision::Summed(slot, _) => format!("sum {slot}+{}", slot + 1),
        Decision::Closed(_, false) => "close the deepest two".into(),
        Decision::Closed(_, true) => "close the deepest inside".into(),
    }
}

fn golden_decision(decision: golden::Decision) -> String {
    match decision {
        golden::Decision::Accumulated { slot } => format!("add to {slot}"),
        golden::Decision::Inserted { slot } => format!("open {slot}"),
        golden::Decision::Merged { slot, .. } => format!("merge {slot}+{}", slot + 1),
        golden::Decision::Late {
            slot,
            side: golden::Side::Front,
        } => format!("late, front of {slot}"),
        golden::Decision::Late {
            slot,
            side: golden::Side::Back,
        } => format!("late, back of {slot}"),
        golden::Decision::Inside { slot } => format!("inside {slot}"),
        golden::Decision::Summed { slot, .. } => format!("sum {slot}+{}", slot + 1),
        // The same text as for the machine, which does not report the slot: it is always the last
        // but one.
        golden::Decision::Closed { inside: false, .. } => "close the deepest two".into(),
        golden::Decision::Closed { inside: true, .. } => "close the deepest inside".into(),
        golden::Decision::Evicted { slot: None } => "evicted".into(),
        golden::Decision::Evicted { slot: Some(_) } => "evict deepest".into(),
        golden::Decision::Replaced => "replace".into(),
        golden::Decision::Dropped => "drop".into(),
    }
}

/// Outcomes of a contribution if fragments are grouped by sheets.
#[derive(Clone, Copy)]
enum SheetDecision {
    Added,
    Opened,
    Dropped,
}

fn machine_sheet_decision(decision: Decision) -> SheetDecision {
    match decision {
        Decision::Accumulated(_) => SheetDecision::Added,
        Decision::Dropped => SheetDecision::Dropped,
        _ => SheetDecision::Opened,
    }
}

fn golden_sheet_decision(decision: golden::Decision) -> SheetDecision {
    match decision {
        golden::Decision::Accumulated { .. } => SheetDecision::Added,
        golden::Decision::Dropped => SheetDecision::Dropped,
        _ => SheetDecision::Opened,
    }
}

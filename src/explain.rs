//! Explain: one pixel's whole story, the machine beside `golden`: every contribution, decision and layer.

use crate::error::{Error, Result};
use crate::fixed;
use crate::golden::{self, Arrival, Story};
use crate::quantise::{Scale, quantise};
use crate::report::{aligned, plain_table};
use crate::scene::Scene;
use rtl_model::Machine;
use rtl_model::machine::Elaborated;
use rtl_model::pipeline;
use rtl_model::probe::Watcher;
use rtl_model::units::fragment::{Contribution, Decision};
use rtl_model::units::resolve::Layer;
use std::any::Any;
use std::fmt::Write;

/// Watches one pixel.
#[derive(Clone, Debug, Default)]
struct Witness {
    pixel: [u32; 2],
    contributions: Vec<(Contribution, Decision)>,
    layers: Vec<Layer>,
    frame: Option<[i64; 4]>,
}

impl Watcher<'static> for Witness {
    fn fork(&self) -> Box<dyn Watcher<'static>> {
        Box::new(Witness { pixel: self.pixel, ..Witness::default() })
    }

    fn hand_over(self: Box<Self>) -> Box<dyn Any + Send> {
        self
    }

    fn take_over(&mut self, seen: Box<dyn Any + Send>) {
        if let Ok(fork) = seen.downcast::<Witness>() {
            self.contributions.extend(fork.contributions);
            self.layers.extend(fork.layers);
            self.frame = self.frame.or(fork.frame);
        }
    }

    fn contribution(&mut self, x: u32, y: u32, contribution: &Contribution, decision: Decision) {
        if [x, y] == self.pixel {
            self.contributions.push((*contribution, decision));
        }
    }

    fn resolved(&mut self, x: u32, y: u32, layers: &[Layer], frame: [i64; 4]) {
        if [x, y] == self.pixel {
            self.layers = layers.to_vec();
            self.frame = Some(frame);
        }
    }
}

/// Tells the story of pixel (x, y).
///
/// # Errors
/// [`Error::Input`] where the pixel lies outside the picture, the machine cannot be built or cannot hold the scene.
pub fn explain(scene: &Scene, machine: &Machine, [x, y]: [usize; 2]) -> Result<String> {
    let (width, height) = (scene.image.width, scene.image.height);
    if x >= width || y >= height {
        return Err(Error::input(format!(
            "--pixel {x},{y}: the picture is {width}×{height}, so X is 0 to {} and Y 0 to {}",
            width - 1,
            height - 1
        )));
    }
    scene.of_discs("explain tells the story of")?;
    let elaborated = fixed::elaborate(machine)?;
    let quantised = quantise(scene, machine)?;
    let mut witness = Witness { pixel: [x as u32, y as u32], ..Witness::default() };
    let drawing = pipeline::draw_decided(&elaborated, &quantised.frame, &mut witness);
    let story = golden::story(scene, &fixed::rules(machine), x, y);
    let told = Told { machine: &elaborated, scale: quantised.scale, fixed: &witness, golden: &story };

    let mut text = format!("pixel {x},{y} of {} on {}\n\n", scene.name, machine.name);
    let _ = writeln!(text, "{}\n", told.contributions());
    let _ = writeln!(text, "{}\n", told.layers());
    let word = drawing.frame[y * width + x].map(i64::from);
    let _ = write!(text, "{}", told.end(word));
    Ok(text)
}

struct Told<'a> {
    machine: &'a Elaborated,
    scale: Scale,
    fixed: &'a Witness,
    golden: &'a Story,
}

/// A contribution on the machine, in `golden`, or in both.
type Pair<'a> = (Option<&'a (Contribution, Decision)>, Option<&'a Arrival>);

impl Told<'_> {
    /// Both lists are in splat order: brings equal splats side by side.
    fn pairs(&self) -> Vec<Pair<'_>> {
        let (mut fixed, mut golden) = (self.fixed.contributions.iter().peekable(), self.golden.arrivals.iter().peekable());
        let mut pairs = Vec::new();
        loop {
            let next = [fixed.peek().map(|(c, _)| c.splat as usize), golden.peek().map(|a| a.splat)];
            let Some(splat) = next.into_iter().flatten().min() else { return pairs };
            pairs.push((fixed.next_if(|(c, _)| c.splat as usize == splat), golden.next_if(|a| a.splat == splat)));
        }
    }

    fn world_depth(&self, word: i64) -> f64 {
        self.machine.machine.fragment.depth.format.value(word) / self.scale.factor()
    }

    fn contributions(&self) -> String {
        let pairs = self.pairs();
        if pairs.is_empty() {
            return "No splat touches this pixel.".into();
        }
        let mut table = plain_table(&["splat", "r", "w", "z", "decision", "golden r", "w", "z", "decision", ""]);
        let mut flips = 0;
        for (fixed, golden) in &pairs {
            let splat = fixed.map(|(c, _)| c.splat as usize).or(golden.map(|a| a.splat)).unwrap_or_default();
            let mut row = vec![splat.to_string()];
            row.extend(fixed.map_or_else(nothing, |(c, decision)| self.machine_row(c, *decision)));
            row.extend(golden.map_or_else(nothing, golden_row));
            let flip = row[4] != row[8];
            flips += usize::from(flip);
            row.push(if flip { "◄".into() } else { String::new() });
            table.add_row(row);
        }
        let mark = if flips > 0 { " (◄)" } else { "" };
        let count = pairs.len();
        format!("{}\n\n{count} contributions, {flips} decided otherwise by the machine than by golden{mark}", aligned(table).trim_fmt())
    }

    fn machine_row(&self, c: &Contribution, decision: Decision) -> [String; 4] {
        let gauss = &self.machine.machine.gauss;
        let decision = match decision {
            Decision::Accumulated(slot) => format!("add to {slot}"),
            Decision::Inserted(slot) => format!("open {slot}"),
            Decision::Merged(front, back) => format!("merge {front}+{back}"),
            Decision::Evicted(true) => "evicted".into(),
            Decision::Evicted(false) => "evict deepest".into(),
            Decision::Replaced => "replace".into(),
            Decision::Dropped => "drop".into(),
        };
        [
            format!("{:.5}", gauss.radial_index.format.value(c.radial_index)),
            format!("{:.6}", gauss.weight.format.value(c.weight)),
            format!("{:.5}", self.world_depth(c.depth)),
            decision,
        ]
    }

    fn layers(&self) -> String {
        let mut table = plain_table(&["layer", "slot", "z", "weight", "red", "green", "blue", "opacity"]);
        let premultiplied = self.machine.machine.shade.premultiplied.format;
        let weight = self.machine.machine.fragment.weight_sum.format;
        let merged = |merged: bool, weight: f64| if merged { "merged".into() } else { format!("{weight:.5}") };
        for (i, layer) in self.fixed.layers.iter().enumerate() {
            let mut row = vec![format!("fixed {i}"), layer.slot.to_string(), format!("{:.5}", self.world_depth(layer.depth))];
            row.push(merged(layer.merged, weight.value(layer.weight)));
            row.extend(layer.colour.iter().chain([&layer.opacity]).map(|word| format!("{:.5}", premultiplied.value(*word))));
            table.add_row(row);
        }
        for (i, layer) in self.golden.layers.iter().enumerate() {
            let mut row = vec![format!("golden {i}"), layer.slot.to_string(), format!("{:.5}", layer.z)];
            row.push(merged(layer.shaded, layer.weight));
            row.extend(layer.colour.iter().chain([&layer.coverage]).map(|value| format!("{value:.5}")));
            table.add_row(row);
        }
        if self.fixed.layers.is_empty() && self.golden.layers.is_empty() {
            return "Nothing is left to blend: the pixel is background.".into();
        }
        format!("Layers at the end, front to back; colour is shaded and multiplied by opacity:\n\n{}", aligned(table))
    }

    fn end(&self, word: [i64; 4]) -> String {
        let format = self.machine.machine.resolve.frame.format;
        let mut table = plain_table(&["blended", "red", "green", "blue", "alpha"]);
        let fixed = word.map(|word| format.value(word));
        let golden = self.golden.rgba;
        let row =
            |name: &str, values: [f64; 4]| std::iter::once(name.to_owned()).chain(values.map(|v| format!("{v:.6}"))).collect::<Vec<_>>();
        table.add_row(row("fixed", fixed));
        table.add_row(row("golden", golden));
        table.add_row(row("difference", std::array::from_fn(|channel| fixed[channel] - golden[channel])));
        let words = word.map(|word| format!("{word:x}")).join(" ");
        format!("{}\n\nframe word ({format}, hexadecimal): {words}", aligned(table))
    }
}

fn nothing() -> [String; 4] {
    std::array::from_fn(|column| if column == 3 { "none".into() } else { "–".into() })
}

fn golden_row(arrival: &Arrival) -> [String; 4] {
    let decision = match arrival.decision {
        golden::Decision::Accumulated { slot } => format!("add to {slot}"),
        golden::Decision::Inserted { slot } => format!("open {slot}"),
        golden::Decision::Merged { slot, .. } => format!("merge {slot}+{}", slot + 1),
        golden::Decision::Evicted { slot: None } => "evicted".into(),
        golden::Decision::Evicted { slot: Some(_) } => "evict deepest".into(),
        golden::Decision::Replaced => "replace".into(),
        golden::Decision::Dropped => "drop".into(),
    };
    [format!("{:.5}", arrival.radial_index), format!("{:.6}", arrival.weight), format!("{:.5}", arrival.z), decision]
}

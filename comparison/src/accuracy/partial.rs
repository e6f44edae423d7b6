//! MixedPrecision: draws a scene in mixed precision: some words of a machine are quantised, the
//! others are f64.
//!
//! ```text
//! chosen words ─►┬─ set up: splats, project, ellipse ─► footprints ─┐
//!                └─ fill: raster, gauss, fragment, shade, resolve ◄─┴─► picture
//! ```
//! The arithmetic is that of the units over the reals (`real.rs` of each). The rules for fragments
//! and sheets are golden's, applied to the resulting numbers. With all words chosen it is the
//! machine, except for bits that f64 loses in its longest products. With no word chosen it is
//! `golden`.
//!
//! Laws (tests/attribution.rs): `with_no_word_it_is_golden`, `with_every_word_it_is_the_machine`.

mod sheets;
mod window;

use crate::golden::footprint::pixels;
use crate::golden::fragments::{Fragment, PairRule, nearest_within};
use crate::golden::lists::{Listed, TileOrder};
use crate::golden::shade::Shader;
use crate::golden::tiles::{Cover, PIXELS_IN_A_TILE, Painter, fill_ordered};
use crate::golden::{FragmentDepth, Outcomes, Rules};
use crate::hardware::fixed;
use crate::hardware::quantise::{Quantised, quantise_after};
use crate::hardware::registers::{Chosen, INPUTS, Registers, SheetWords, WindowWords};
use crate::output::picture::Picture;
use crate::scene::{Scene, View};
use glam::DVec3;
use rayon::prelude::*;
use rtl_model::elaboration::{Signal, unit};
use rtl_model::pipeline::Elaborated;
use rtl_model::pipeline::real::walked;
use rtl_model::real::frame::Splat;
use rtl_model::real::{MixedPrecision, Switches};
use rtl_model::units::ellipse::real::Output;
use rtl_model::units::project::real::Projected;
use rtl_model::units::raster::real::Input;
use rtl_model::units::shade::real::{Lighting, Sums};
use sheets::SheetPixels;
use std::array;
use std::ops::Range;
use window::WindowPixels;

/// The units, the splat's record before them and the sort between them, in the order of the
/// diagram.
pub const UNITS: [&str; unit::WORDED.len() + 1] = unit::after("splat", unit::WORDED);

/// Word that only machines with the unit `colour` have.
const OF_COLOUR: &str = "colour.coefficient";

/// Words that only machines for ellipsoids have.
const OF_ELLIPSOIDS: [&str; 2] = ["ellipse.quaternion", "ellipse.scale"];

/// The word that a signal belongs to; signals inside a function unit belong to the unit's word.
fn word_of(signal: &Signal) -> String {
    let name = signal.name.split('.').next().unwrap_or_default();
    format!("{}.{name}", signal.unit)
}

/// Every word of a machine, as `unit.word`, in the order of the diagram.
pub fn words(machine: &Elaborated) -> Vec<String> {
    let mut words: Vec<String> = INPUTS
        .iter()
        .map(|&name| name.to_owned())
        .chain(machine.signals.iter().map(word_of))
        .collect();
    let ellipsoids = machine.machine.ellipse.ellipsoid.is_some();
    // Sides of a box are whole pixels in any arithmetic.
    let reflects = machine.machine.reflect.is_some();
    words.retain(|word| {
        word != "ellipse.edge" && (ellipsoids || !OF_ELLIPSOIDS.contains(&word.as_str()))
    });
    let has_colour = machine.machine.colour.is_some();
    let weighs = machine.machine.depth_weight().is_some();
    words.retain(|word| weighs || word != "sort.share");
    words.retain(|word| {
        (reflects || word != "reflect.reflectance") && (has_colour || word != OF_COLOUR)
    });
    words.sort_by_key(|word| {
        UNITS
            .iter()
            .position(|unit| word.split('.').next() == Some(unit))
    });
    let mut unique = Vec::new();
    for word in words {
        if !unique.contains(&word) {
            unique.push(word);
        }
    }
    unique
}

/// The chosen words of a machine.
#[derive(Clone, Debug)]
pub struct ChosenWords {
    inputs: Vec<&'static str>,
    switches: Switches,
}

impl ChosenWords {
    /// The words for which `is_chosen` is true.
    pub fn new(machine: &Elaborated, is_chosen: impl Fn(&str) -> bool) -> Self {
        ChosenWords {
            inputs: INPUTS.into_iter().filter(|name| is_chosen(name)).collect(),
            switches: Switches(
                machine
                    .signals
                    .iter()
                    .map(|signal| is_chosen(&word_of(signal)))
                    .collect(),
            ),
        }
    }

    fn hold(&self) -> Chosen<'_> {
        Chosen {
            inputs: &self.inputs,
            switches: &self.switches,
        }
    }
}

/// A splat after setup, in plain numbers, so that other words can be chosen for the fill.
#[derive(Clone, Debug)]
pub struct Footprint {
    columns: Range<u32>,
    rows: Range<u32>,
    input: Input<f64>,
    amplitude: f64,
    /// rgb, α, normal.
    attributes: [f64; ATTRIBUTES],
    material: u32,
    /// Windows only: the splat's own colour under the lights.
    light: [f64; 3],
    splat: u32,
    /// Cutoff of leaders, if blocks are tested.
    leader_cutoff: f64,
    /// Sort key.
    key: f64,
}

/// The drawn splats of a frame, in drawing order, or with an order of its own in each tile.
#[derive(Clone, Debug)]
pub struct DrawnFootprints {
    footprints: Vec<Footprint>,
    order: Option<TileOrder>,
}

/// Attributes of a contribution: rgb, α, normal.
const ATTRIBUTES: usize = 7;

/// Scene and machine of a drawing.
#[derive(Clone, Debug)]
pub struct MixedDrawing<'a> {
    scene: &'a Scene,
    machine: &'a Elaborated,
    quantised: &'a Quantised,
    eye: View,
    rules: Rules,
}

/// Splats that are set up together.
const BATCH: usize = 8;

impl<'a> MixedDrawing<'a> {
    /// The drawing of `scene` on `machine`.
    pub fn new(scene: &'a Scene, machine: &'a Elaborated, quantised: &'a Quantised) -> Self {
        MixedDrawing {
            scene,
            machine,
            quantised,
            eye: scene.view(),
            rules: fixed::rules(&machine.machine),
        }
    }

    fn registers(&self) -> Registers<'_> {
        Registers {
            scene: self.scene,
            eye: &self.eye,
            machine: self.machine,
            quantised: self.quantised,
        }
    }

    /// Sets up all splats with the chosen words, in drawing order.
    pub fn set_up(&self, choice: &ChosenWords) -> DrawnFootprints {
        let (registers, hold) = (self.registers(), choice.hold());
        let view = registers.view(&hold);
        let ellipsoids = self.scene.ellipsoids.as_ref();
        let preshaded = ellipsoids.is_some_and(|ellipsoids| ellipsoids.preshaded);
        let windows = self.quantised.frame.window.is_some();
        let lighting = (preshaded || windows).then(|| registers.lighting(&hold));
        type SetUp<'a> = (Projected<MixedPrecision<'a>>, Output<MixedPrecision<'a>>);
        let one = |index: usize, splat: &Splat<MixedPrecision>, (point, ellipse): SetUp| {
            let backface = self.scene.surface.cull_backfaces && ellipse.facing.value > 0.0;
            let is_dark = |number: MixedPrecision| number.value == 0.0 || number.value.is_nan();
            let faint = [
                ellipse.facing,
                splat.radius,
                ellipse.determinant,
                ellipse.amplitude,
            ]
            .into_iter()
            .any(is_dark);
            let beyond = point.inside.iter().any(|inside| inside.value < 0.0);
            let near = point.depth.value <= view.near.value || point.depth.value.is_nan();
            if near || beyond || backface || faint {
                return None;
            }
            let [width, height] = [self.scene.image.width, self.scene.image.height];
            let [columns, rows] = [(0, width), (1, height)].map(|(axis, size)| {
                pixels(
                    self.eye.half_px[axis] + point.pixel[axis].value,
                    ellipse.extent[axis].value,
                    size,
                )
            });
            let Input {
                pixel,
                conic,
                depth,
                depth_slope,
                depth_range,
            } = walked(&point, &ellipse);
            let material = self.scene.splats[index].material;
            let lit = lighting.as_ref().map(|lighting| {
                self.machine
                    .real_emission(lighting, splat.rgb, ellipse.normal, material)
            });
            let light = lit.unwrap_or(splat.rgb);
            let [r, g, b] = if windows { splat.rgb } else { light };
            let [x, y, z] = ellipse.normal;
            let footprint = Footprint {
                columns: columns?,
                rows: rows?,
                input: Input {
                    pixel: pixel.map(number),
                    conic: conic.map(number),
                    depth: depth.value,
                    depth_slope: depth_slope.map(number),
                    depth_range: depth_range.value,
                },
                amplitude: ellipse.amplitude.value,
                attributes: [r, g, b, splat.opacity, x, y, z].map(number),
                material,
                light: light.map(number),
                splat: index as u32,
                leader_cutoff: registers
                    .leader_cutoff(&hold, index)
                    .map_or(f64::INFINITY, number),
                key: self.machine.real_key(point.depth).value,
            };
            (!footprint.columns.is_empty() && !footprint.rows.is_empty()).then_some(footprint)
        };
        let splats = self.scene.splats.len();
        // The last batch repeats the last splat.
        let batch = |nth: usize| {
            let indices: [usize; BATCH] =
                array::from_fn(|item| (nth * BATCH + item).min(splats - 1));
            let all = indices.map(|index| registers.splat(&hold, index));
            let ellipsoids = indices.map(|index| registers.ellipsoid(&hold, index));
            let ellipsoids = ellipsoids.each_ref().map(Option::as_ref);
            let set_up = self.machine.real_set_up(&view, &all, ellipsoids);
            let items = indices.into_iter().zip(all).zip(set_up);
            let items = items.take(splats - nth * BATCH);
            items.filter_map(|((index, splat), set_up)| one(index, &splat, set_up))
        };
        let mut footprints: Vec<Footprint> = (0..splats.div_ceil(BATCH))
            .into_par_iter()
            .flat_map_iter(batch)
            .collect();
        let order = self.order(choice, &footprints);
        if let Some(order) = order {
            return DrawnFootprints {
                footprints,
                order: Some(order),
            };
        }
        if (self.quantised.frame.ellipsoids.as_ref()).is_some_and(|ellipsoids| ellipsoids.sorted) {
            footprints.sort_by(|a, b| a.key.total_cmp(&b.key));
            // The farthest first; equal keys stay in the order of the scene.
            if (self.quantised.frame.sheets.as_ref()).is_some_and(|sheets| sheets.back_to_front) {
                footprints.sort_by(|a, b| b.key.total_cmp(&a.key));
            }
        }
        DrawnFootprints {
            footprints,
            order: None,
        }
    }

    /// The order of each tile on a machine that keeps lists: earlier frames are set up with the
    /// same words.
    fn order(&self, choice: &ChosenWords, footprints: &[Footprint]) -> Option<TileOrder> {
        let of = |footprint: &Footprint| Listed {
            splat: footprint.splat,
            sides: [footprint.columns.clone(), footprint.rows.clone()],
            key: footprint.key,
        };
        let before = |earlier: &Scene| {
            let single = Scene {
                path: None,
                ..earlier.clone()
            };
            // The scale of the whole path.
            let quantised = quantise_after(earlier, &self.machine.machine, None);
            quantised.map_or_else(
                |_| Vec::new(),
                |quantised| {
                    let set_up =
                        MixedDrawing::new(&single, self.machine, &quantised).set_up(choice);
                    set_up.footprints.iter().map(of).collect()
                },
            )
        };
        let lists = self.rules.lists?;
        // A first frame is sorted.
        if self.scene.cameras_before().is_empty() {
            return None;
        }
        let now: Vec<Listed> = footprints.iter().map(of).collect();
        lists.order_after(self.scene, before, &now)
    }

    /// Draws footprints with the chosen words.
    pub fn fill(&self, choice: &ChosenWords, set_up: &DrawnFootprints) -> Picture {
        let (footprints, order) = (&set_up.footprints, set_up.order.as_ref());
        let (registers, hold) = (self.registers(), choice.hold());
        let shader = Shader::of(self.scene, &self.rules);
        let frame = FrameWords {
            stage: self,
            cutoff: registers.view(&hold).cutoff.value,
            z_threshold: registers.z_threshold(&hold).value,
            coverage_threshold: registers.coverage_threshold(&hold).value,
            opaque: registers.opaque(&hold, self.rules.opaque).value,
            lighting: registers.lighting(&hold),
            background: registers.background(&hold, &shader),
            sheets: SheetWords::new(&hold, self.scene, self.machine, self.quantised),
            windows: WindowWords::new(&hold, self.scene, self.machine, self.quantised),
            shader: &shader,
            switches: &choice.switches,
        };
        let drawn: Vec<FrameFootprint> = footprints
            .iter()
            .map(|footprint| FrameFootprint {
                frame: &frame,
                footprint,
            })
            .collect();
        let background = self.machine.real_resolve(&[], frame.background).map(number);
        if let Some(words) = &frame.windows {
            return fill_ordered(&self.scene.image, &drawn, order, background, || {
                WindowPixels::new(&frame, words)
            })
            .picture;
        }
        match &frame.sheets {
            None => {
                fill_ordered(&self.scene.image, &drawn, order, background, || {
                    FragmentPixels::new(&frame)
                })
                .picture
            }
            Some(words) => {
                fill_ordered(&self.scene.image, &drawn, order, background, || {
                    SheetPixels::new(&frame, words)
                })
                .picture
            }
        }
    }
}

fn number(mixed: MixedPrecision) -> f64 {
    mixed.value
}

/// Values that the whole frame has in common.
struct FrameWords<'a> {
    stage: &'a MixedDrawing<'a>,
    cutoff: f64,
    z_threshold: f64,
    coverage_threshold: f64,
    opaque: f64,
    lighting: Lighting<MixedPrecision<'a>>,
    background: [MixedPrecision<'a>; 4],
    /// None if fragments are grouped by depth.
    sheets: Option<SheetWords<'a, MixedPrecision<'a>>>,
    /// None if fragments are not grouped by windows.
    windows: Option<WindowWords<MixedPrecision<'a>>>,
    shader: &'a Shader,
    switches: &'a Switches,
}

impl<'a> FrameWords<'a> {
    fn word(&self, value: f64) -> MixedPrecision<'a> {
        MixedPrecision::new(value, self.switches)
    }
}

/// One footprint and the frame that it is drawn into.
struct FrameFootprint<'a> {
    frame: &'a FrameWords<'a>,
    footprint: &'a Footprint,
}

/// One splat at one pixel.
struct MixedContribution<'a> {
    footprint: &'a Footprint,
    /// Column and row.
    pixel: [u32; 2],
    weight: f64,
    /// Machine units.
    depth: f64,
}

impl<'a> Cover for FrameFootprint<'a> {
    type Contribution = MixedContribution<'a>;

    fn sides(&self) -> [Range<u32>; 2] {
        [self.footprint.columns.clone(), self.footprint.rows.clone()]
    }

    fn contribute(
        &self,
        columns: Range<u32>,
        rows: Range<u32>,
        mut take: impl FnMut([u32; 2], MixedContribution<'a>),
    ) {
        let (frame, footprint) = (self.frame, self.footprint);
        let (machine, half_px) = (frame.stage.machine, frame.stage.eye.half_px);
        let Input {
            pixel,
            conic,
            depth,
            depth_slope,
            depth_range,
        } = footprint.input;
        let word = |value: f64| frame.word(value);
        let input = Input {
            pixel: pixel.map(word),
            conic: conic.map(word),
            depth: word(depth),
            depth_slope: depth_slope.map(word),
            depth_range: word(depth_range),
        };
        let (left, top) = (footprint.columns.start, footprint.rows.start);
        let least_weight = frame
            .sheets
            .as_ref()
            .map_or(0.0, |words| words.least_weight.value);
        let first = [
            f64::from(left) + 0.5 - half_px[0],
            f64::from(top) + 0.5 - half_px[1],
        ];
        let kept = self.kept_blocks(&input, [columns.clone(), rows.clone()]);
        let downwards =
            machine.mixed_precision_rows(&input, first, rows.start - top..rows.end - top);
        for (y, row) in rows.zip(downwards) {
            for x in columns.clone() {
                let [radial, depth] = machine.mixed_precision_pixel(&row, f64::from(x - left));
                if machine.keeps(radial.value, frame.cutoff) && kept([x, y]) {
                    let weight = machine.real_weight(radial, word(footprint.amplitude)).value;
                    // A weight that rounds to 0 makes no fragment.
                    if weight > 0.0 && weight >= least_weight {
                        take(
                            [x, y],
                            MixedContribution {
                                footprint,
                                pixel: [x, y],
                                weight,
                                depth: machine.real_depth(depth).value,
                            },
                        );
                    }
                }
            }
        }
    }
}

impl FrameFootprint<'_> {
    /// Whether the block of a pixel is kept, for the pixels of a part of the box.
    fn kept_blocks(
        &self,
        input: &Input<MixedPrecision>,
        [columns, rows]: [Range<u32>; 2],
    ) -> impl Fn([u32; 2]) -> bool {
        let stage = self.frame.stage;
        let unit = (stage.machine).tests_blocks(&stage.quantised.frame);
        let side = unit.map_or(1, |unit| unit.block_px());
        let middle = stage.eye.half_px.map(|half_px| half_px - 0.5);
        let blocks = |range: &Range<u32>| range.start / side..range.end.div_ceil(side);
        let (across, first) = (
            blocks(&columns).len(),
            [columns.start / side, rows.start / side],
        );
        let kept: Option<Vec<bool>> = unit.map(|unit| {
            let block = |[x, y]: [u32; 2]| {
                let radial = unit.real(input.pixel, input.conic, [x * side, y * side], middle);
                radial
                    .iter()
                    .any(|radial| radial.value < self.footprint.leader_cutoff)
            };
            let all = blocks(&rows).flat_map(|y| blocks(&columns).map(move |x| [x, y]));
            all.map(block).collect()
        });
        move |[x, y]| {
            kept.as_ref().is_none_or(|kept| {
                let [x, y] = [x / side - first[0], y / side - first[1]].map(|at| at as usize);
                kept[y * across + x]
            })
        }
    }
}

/// The fragments of a tile's pixels, by golden's rules; depths in machine units.
struct FragmentPixels<'a> {
    frame: &'a FrameWords<'a>,
    fragments: Vec<Vec<Fragment>>,
}

impl<'a> FragmentPixels<'a> {
    fn new(frame: &'a FrameWords<'a>) -> Self {
        FragmentPixels {
            frame,
            fragments: vec![Vec::new(); PIXELS_IN_A_TILE],
        }
    }
}

impl<'a> Painter for FragmentPixels<'a> {
    type Contribution = MixedContribution<'a>;

    fn take(&mut self, pixel: usize, arrival: MixedContribution<'a>) {
        let (frame, fragments) = (self.frame, &mut self.fragments[pixel]);
        let rules = &frame.stage.rules;
        if let Some(slot) = nearest_within(frame.z_threshold, arrival.depth, fragments) {
            let fragment = &mut fragments[slot];
            frame.accumulate(fragment, &arrival);
            if rules.fragment_depth == FragmentDepth::Nearest {
                fragment.z = fragment.z.min(arrival.depth);
            }
            return;
        }
        let (material, pixel) = (
            arrival.footprint.material,
            arrival.pixel.map(|place| place as u16),
        );
        let mut new = Fragment {
            z: arrival.depth,
            material,
            pixel,
            ..Fragment::default()
        };
        frame.accumulate(&mut new, &arrival);
        if fragments.len() < rules.layers {
            fragments.push(new);
            return;
        }
        match rules.merge.pair() {
            Some(pair) => frame.overflow(fragments, new, pair),
            None if new.z < fragments[0].z => fragments[0] = new,
            None => {}
        }
    }

    fn finish(&mut self, pixel: usize) -> [f64; 4] {
        let (frame, fragments) = (self.frame, &mut self.fragments[pixel]);
        fragments.sort_by(|a, b| a.z.total_cmp(&b.z));
        let layers: Vec<[MixedPrecision; 4]> = fragments
            .drain(..)
            .map(|fragment| frame.light(&fragment))
            .collect();
        frame
            .stage
            .machine
            .real_resolve(&layers, frame.background)
            .map(number)
    }

    fn outcomes(&self) -> Outcomes {
        Outcomes::default()
    }
}

impl<'a> FrameWords<'a> {
    fn accumulate(&self, fragment: &mut Fragment, arrival: &MixedContribution) {
        let weight = self.word(arrival.weight);
        let sum = |lane: usize, sum: f64, attribute: f64| {
            self.stage
                .machine
                .real_accumulated(lane, self.word(sum), weight, self.word(attribute))
                .value
        };
        let [r, g, b, opacity, x, y, z] = arrival.footprint.attributes;
        let Fragment {
            weight: all,
            rgb,
            alpha,
            normal,
            ..
        } = *fragment;
        fragment.weight = sum(0, all, 1.0);
        fragment.rgb = DVec3::new(sum(1, rgb.x, r), sum(2, rgb.y, g), sum(3, rgb.z, b));
        fragment.alpha = sum(4, alpha, opacity);
        fragment.normal = DVec3::new(
            sum(5, normal.x, x),
            sum(6, normal.y, y),
            sum(7, normal.z, z),
        );
    }

    /// Makes room for one fragment: drops a hidden one, or merges two.
    fn overflow(&self, fragments: &mut Vec<Fragment>, new: Fragment, pair: PairRule) {
        let rules = &self.stage.rules;
        fragments.sort_by(|a, b| a.z.total_cmp(&b.z));
        let place = fragments.partition_point(|fragment| fragment.z <= new.z);
        fragments.insert(place, new);
        let deepest = fragments.len() - 1;
        let hides = |fragment: &Fragment| fragment.is_opaque(self.opaque, self.coverage_threshold);
        if rules.evict_hidden && fragments[..deepest].iter().any(hides) {
            fragments.truncate(deepest);
            return;
        }
        let front = pair(fragments);
        let [over, under] = [front, front + 1].map(|slot| self.stored(&fragments[slot]));
        let [r, g, b, alpha] = self.stage.machine.real_merge(over, under).map(number);
        fragments[front] = Fragment {
            rgb: DVec3::new(r, g, b),
            alpha,
            shaded: true,
            ..fragments[front]
        };
        fragments.remove(front + 1);
    }

    /// The operand of a merge: a shaded fragment is first stored in a slot.
    fn stored(&self, fragment: &Fragment) -> [MixedPrecision<'a>; 4] {
        if fragment.shaded {
            self.light(fragment)
        } else {
            self.stage.machine.real_stored(self.light(fragment))
        }
    }

    /// Premultiplied colour and opacity of a fragment.
    fn light(&self, fragment: &Fragment) -> [MixedPrecision<'a>; 4] {
        let Fragment {
            weight,
            rgb,
            alpha,
            normal,
            ..
        } = *fragment;
        if fragment.shaded {
            return self
                .stage
                .machine
                .real_read([rgb.x, rgb.y, rgb.z, alpha].map(|channel| self.word(channel)));
        }
        let mean = |sum: f64| self.word(if weight > 0.0 { sum / weight } else { 0.0 });
        let sums = Sums {
            weight: self.word(weight),
            rgb: rgb.to_array().map(mean),
            opacity: mean(alpha),
            normal: normal.to_array().map(mean),
            material: fragment.material,
            at: self.shader.off_middle(fragment.pixel),
        };
        self.stage.machine.real_shade(&self.lighting, &sums)
    }
}

//! Quantise: the only place where real numbers become bits.
//!
//! ```text
//! scene (f64, world units) ─►[ × 2^exponent, − offset ]─► machine units ─►[ round, saturate ]─► frame (words)
//! ```
//! One power of two and one offset map a scene to the machine's position format, as large as every
//! word allows. Both are reported. `golden` and `ideal` never use these words.

use crate::error::{Error, Result};
use crate::golden::{octahedral, window_density};
use crate::hardware::fixed::lists_before;
use crate::output::text::listed;
use crate::scene::tree::cut::{self, Budget, DrawOrder};
use crate::scene::{
    Amplitude, Ellipsoids, Filter, Harmonics, Light, MachineHarmonics, Material, Mirror,
    Orientation, Scene, Sheet, Sheets, Splat, View,
};
use glam::{DMat3, DQuat, DVec3};
use rayon::prelude::*;
use rtl_model::frame::{self, Frame, Scaled};
use rtl_model::machine::{Interpolation, Machine, Sight, TableShape};
use rtl_model::num::{Format, Word};
use rtl_model::pipeline::Reach;
use rtl_model::real::power_of_two;
use rtl_model::work::{Found, TILE_PX, Visit, Work};
use schemars::JsonSchema;
use serde::Serialize;
use std::sync::Arc;

pub use rtl_model::frame::ListsBefore;

/// Scale from world units to machine units: `machine = (world − offset) · 2^exponent`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Scale {
    /// Power of two.
    pub exponent: i32,
    /// World position of the machine's origin.
    pub offset: [f64; 3],
}

impl Scale {
    /// Machine units of one world unit.
    pub fn factor(&self) -> f64 {
        f64::from(self.exponent).exp2()
    }
}

/// A scene in words.
#[derive(Clone, Debug, PartialEq)]
pub struct Quantised {
    /// Input of the machine.
    pub frame: Frame,
    /// Scale from world units.
    pub scale: Scale,
    /// Notes on settings that could not be represented, one sentence each.
    pub notes: Vec<String>,
    /// Texels of the surroundings before quantisation; empty without reflection.
    pub texels: Vec<[f64; 3]>,
    /// Conversion of the scene's harmonics, if the machine evaluates them.
    pub harmonics: Option<MachineHarmonics>,
    /// Walk that finds the splats in a tree, if there is one.
    pub walk: Option<TreeWalk>,
    /// 1/σ, machine units: the depth from which weights are 0, if they fall with depth.
    pub inverse_distance: Option<f64>,
}

/// Walk of a frame's tree of splats, for timing ([`TreeWalk::record`]).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TreeWalk {
    visits: Vec<Visit>,
    ahead: u32,
    /// Empty where splats are drawn in the order of the walk.
    listed: Vec<u32>,
}

impl TreeWalk {
    fn new(detail: &cut::Detail) -> Self {
        let visit = |visit: &cut::Visit| Visit {
            node: visit.node,
            parent: visit.parent,
            found: match visit.found {
                cut::VisitResult::Opened => Found::Opened,
                cut::VisitResult::Drawn => Found::Drawn,
                cut::VisitResult::Away => Found::Away,
                cut::VisitResult::Outside => Found::Outside,
            },
        };
        TreeWalk {
            visits: detail.cut.visits.iter().map(visit).collect(),
            ahead: detail.rules.ahead as u32,
            listed: if detail.rules.order == DrawOrder::CoarseToFine {
                detail.cut.drawn.clone()
            } else {
                Vec::new()
            },
        }
    }

    /// Adds the walk to the record of the frame.
    pub fn record(&self, work: &mut Work) {
        (work.walk, work.ahead, work.listed) =
            (self.visits.clone(), self.ahead, self.listed.clone());
    }
}

/// Some splats of a scene. They get the words that they have in the whole scene.
#[derive(Clone, Debug)]
pub struct Part {
    extents: Extents,
    splats: Vec<u32>,
    least: u32,
    weight_distance: Option<f64>,
}

impl Part {
    /// No splat yet of a scene.
    pub fn of(scene: &Scene) -> Self {
        Part {
            extents: Extents::of(scene, &scene.view()),
            splats: Vec::new(),
            least: scene.splats.len().min(2) as u32,
            weight_distance: scene.weight_distance(),
        }
    }

    /// The part with these splats, in any order. It has at least two splats if the scene does: axes
    /// of a single splat would be those of the whole frame.
    pub fn with(&self, mut splats: Vec<u32>) -> Self {
        if splats.len() < 2 {
            splats.extend(0..self.least);
        }
        splats.sort_unstable();
        splats.dedup();
        Part { splats, ..*self }
    }

    /// Items of these splats; each splat has `stride` of them.
    fn of_items<T: Clone>(&self, items: &[T], stride: usize) -> Vec<T> {
        let own = self.splats.iter().map(|splat| *splat as usize * stride);
        own.flat_map(|first| &items[first..first + stride])
            .cloned()
            .collect()
    }

    /// The scene with these splats only.
    fn cut(&self, scene: &Scene) -> Scene {
        let ellipsoids = |whole: &Ellipsoids| Ellipsoids {
            orientations: match whole.orientations.len() {
                1 => whole.orientations.clone(),
                _ => self.of_items(&whole.orientations, 1),
            },
            amplitude: whole.amplitude,
            preshaded: whole.preshaded,
            sorted: whole.sorted,
            harmonics: whole.harmonics.as_ref().map(|harmonics| Harmonics {
                coefficients: Arc::new(self.of_items(
                    &harmonics.coefficients,
                    (usize::from(harmonics.degree) + 1).pow(2),
                )),
                ..*harmonics
            }),
        };
        let sheets = |whole: &Sheets| Sheets {
            of: match &whole.of {
                Sheet::Slice(numbers) => Sheet::Slice(self.of_items(numbers, 1)),
                Sheet::Splat => Sheet::Splat,
                Sheet::Sum => Sheet::Sum,
            },
            weight_distance: self.weight_distance,
            ..*whole
        };
        Scene {
            name: scene.name.clone(),
            splats: self.of_items(&scene.splats, 1),
            ellipsoids: scene.ellipsoids.as_ref().map(ellipsoids),
            sheets: scene.sheets.as_ref().map(sheets),
            lights: scene.lights.clone(),
            materials: scene.materials.clone(),
            environment: scene.environment.clone(),
            detail: None,
            path: None,
            notes: Vec::new(),
            ..*scene
        }
    }
}

/// Quantises a part of a scene for a machine. A scene with a tree of splats has no parts.
///
/// # Errors
/// As [`quantise`].
pub fn quantise_part(scene: &Scene, part: &Part, machine: &Machine) -> Result<Quantised> {
    quantise_scaled(&part.cut(scene), part.extents, machine)
}

/// Quantises a scene for a machine.
///
/// # Errors
/// [`Error::Input`] where registers cannot hold constants of the scene, with every such register
/// and a format that would hold them.
pub fn quantise(scene: &Scene, machine: &Machine) -> Result<Quantised> {
    quantise_after(scene, machine, lists_before(scene, machine)?)
}

/// [`quantise`] of a frame, with what the machine has in memory after the frame before it.
///
/// # Errors
/// As [`quantise`].
pub fn quantise_after(scene: &Scene, machine: &Machine, lists: ListsBefore) -> Result<Quantised> {
    // The scale covers every leaf, drawn or not.
    let all = scene.full().map(|full| Scene {
        splats: [full.splats, scene.splats.clone()].concat(),
        ..full
    });
    let whole = all.as_ref().unwrap_or(scene);
    let mut extents = Extents::of(whole, &scene.view());
    // Keys of one frame are compared with those of the frame before: all frames have one scale.
    if machine.keeps_lists().is_some() {
        for camera in scene.cameras_of_path() {
            extents.include(&Extents::of(whole, &camera.view(&scene.image)));
        }
    }
    let mut quantised = quantise_scaled(scene, extents, machine)?;
    quantised.frame.lists = lists;
    Ok(quantised)
}

fn quantise_scaled(scene: &Scene, extents: Extents, machine: &Machine) -> Result<Quantised> {
    if scene.kernel.filter != Filter::Ewa {
        let filter = if scene.kernel.filter == Filter::Circular {
            "circular"
        } else {
            "source-ewa"
        };
        let reason =
            "which golden and ideal draw for comparison (the example `filters`): no machine has it";
        return Err(Error::input(format!(
            "machine {} cannot draw {}: kernel.filter is \"{filter}\", {reason}",
            machine.name, scene.name
        )));
    }
    let view = scene.view();
    let scale = extents.scale(scene, machine);
    let mut registers = RegisterLoader {
        machine,
        errors: Vec::new(),
        notes: Vec::new(),
        texels: Vec::new(),
        harmonics: None,
    };
    let walk = registers.walk(scene);
    let inverse_distance = registers.inverse_distance(scene, &scale);
    let frame = Frame {
        width: scene.image.width as u32,
        height: scene.image.height as u32,
        view: registers.view(scene, &view, &scale),
        z_threshold: registers.z_threshold(scene, &scale),
        coverage_threshold: registers
            .hold(
                "fragment.weight_sum",
                machine.fragment.weight_sum,
                scene.surface.coverage_threshold,
            )
            .max(1),
        inverse_threshold: scaled(
            machine.shade.inverse_threshold,
            1.0 / scene.surface.coverage_threshold,
        ),
        background: registers.background(scene.image.background),
        lighting: registers.lighting(scene, &view),
        splats: registers.splats(scene, &scale),
        ellipsoids: registers.ellipsoids(scene, &view, inverse_distance),
        sheets: registers.sheets(scene),
        window: registers.window(scene, &scale),
        surroundings: registers.surroundings(scene, &view),
        lists: None,
    };
    if registers.errors.is_empty() {
        return Ok(Quantised {
            frame,
            scale,
            notes: registers.notes,
            texels: registers.texels,
            harmonics: registers.harmonics,
            walk,
            inverse_distance,
        });
    }
    let errors: Vec<String> = registers
        .errors
        .into_iter()
        .map(RegisterError::sentence)
        .collect();
    Err(Error::input(format!(
        "machine {} cannot draw {}: {}",
        machine.name,
        scene.name,
        listed(&errors)
    )))
}

/// Note on a sort key with too few tile bits for a picture of this size, in tiles of 16×16 pixels,
/// the smallest.
pub fn lacks_tile_bits(machine: &Machine, size: [usize; 2]) -> Option<String> {
    let bits = machine.sorting().and_then(|sort| sort.tile_bits)?;
    let side_px = TILE_PX.min(machine.timing.tile.side_px as usize).max(1);
    let tiles: usize = size.map(|pixels| pixels.div_ceil(side_px)).iter().product();
    let needed = tiles.next_power_of_two().ilog2();
    (needed > bits).then(|| {
        format!("sort.tile_bits is {bits}, and the picture has {tiles} tiles of {side_px}×{side_px} pixels: {needed} bits are needed")
    })
}

/// Greatest magnitudes in world units, around the middle of the splats.
#[derive(Clone, Copy, Debug, Default)]
struct Extents {
    offset: DVec3,
    position: f64,
    radius: f64,
    depth: f64,
    eye: f64,
    root_cutoff: f64,
}

impl Extents {
    fn of(scene: &Scene, view: &View) -> Self {
        let (low, high) = scene.splats.iter().fold(
            (DVec3::INFINITY, DVec3::NEG_INFINITY),
            |(low, high), splat| (low.min(splat.position), high.max(splat.position)),
        );
        let offset = if scene.splats.is_empty() {
            view.eye
        } else {
            low + (high - low) / 2.0
        };
        let mut need = Extents {
            offset,
            eye: (view.eye - offset).abs().max_element(),
            root_cutoff: scene.kernel.cutoff.sqrt(),
            ..Extents::default()
        };
        for splat in &scene.splats {
            let depth = (view.rotation * (splat.position - view.eye)).z;
            need.position = need
                .position
                .max((splat.position - offset).abs().max_element());
            need.radius = need.radius.max(splat.radius);
            need.depth = need.depth.max(depth + splat.radius * need.root_cutoff);
        }
        need
    }

    /// Covers another view of the same splats.
    fn include(&mut self, other: &Extents) {
        self.depth = self.depth.max(other.depth);
        self.eye = self.eye.max(other.eye);
    }

    /// The greatest power of two with which every value is in range.
    fn scale(&self, scene: &Scene, machine: &Machine) -> Scale {
        let need = self;
        let limits = [
            (machine.splat.position, need.position),
            (machine.splat.radius, need.radius),
            (machine.ellipse.depth_range, need.radius * need.root_cutoff),
            (machine.project.eye, need.eye),
            (machine.project.depth, need.depth),
            (machine.fragment.depth, need.depth),
            (machine.fragment.depth, scene.surface.z_threshold),
        ];
        let exponent = limits
            .into_iter()
            .filter(|(_, needed)| *needed > 0.0)
            .map(|(word, needed)| places_to_spare(word, needed))
            .min();
        Scale {
            exponent: exponent.unwrap_or(0).clamp(-900, 900),
            offset: need.offset.to_array(),
        }
    }
}

/// Greatest exponent at which `needed · 2^exponent` rounds into the word.
fn places_to_spare(word: Word, needed: f64) -> i32 {
    let most = word.format.value(word.format.max());
    let guess = libm::floor(libm::log2(most / needed)).clamp(-2000.0, 2000.0) as i32;
    // log2 may be off by one ulp at a power of two.
    if needed * f64::from(guess).exp2() > most {
        guess - 1
    } else {
        guess
    }
}

/// A real number as a word: rounded by the word's mode, saturated.
pub(crate) fn quantised(word: Word, value: f64) -> i64 {
    let rounded = word.rounded_real(value * power_of_two(word.format.frac_bits));
    (rounded as i64).clamp(word.format.min(), word.format.max())
}

/// A positive number as a mantissa in [½, 1] and a power of two.
fn scaled(word: Word, value: f64) -> Scaled {
    let (mantissa, exponent) = libm::frexp(value);
    Scaled {
        mantissa: quantised(word, mantissa),
        places: -i64::from(exponent),
    }
}

/// Whether the machine computes colours from the scene's harmonics.
fn has_harmonics(scene: &Scene, machine: &Machine) -> bool {
    let ellipsoids = scene.ellipsoids.as_ref();
    machine.colour.is_some() && ellipsoids.is_some_and(|ellipsoids| ellipsoids.harmonics.is_some())
}

fn splats(scene: &Scene, machine: &Machine, scale: &Scale) -> Vec<frame::Splat> {
    let (words, factor, offset) = (
        machine.splat,
        scale.factor(),
        DVec3::from_array(scale.offset),
    );
    let vector = |word: Word, v: DVec3| v.to_array().map(|x| quantised(word, x) as i32);
    let has_harmonics = has_harmonics(scene, machine);
    let splat = |splat: &Splat| frame::Splat {
        position: vector(words.position, (splat.position - offset) * factor),
        normal: vector(words.normal, splat.normal),
        radius: quantised(words.radius, splat.radius * factor) as i32,
        rgb: if has_harmonics {
            [0; 3]
        } else {
            (splat.rgb).map(|channel| quantised(words.rgb, channel) as i32)
        },
        opacity: quantised(words.opacity, splat.opacity) as i32,
        material: splat.material,
    };
    scene.splats.par_iter().map(splat).collect()
}

/// Loads registers and collects errors.
struct RegisterLoader<'a> {
    machine: &'a Machine,
    errors: Vec<RegisterError>,
    notes: Vec<String>,
    texels: Vec<[f64; 3]>,
    harmonics: Option<MachineHarmonics>,
}

/// Reason why a scene cannot be drawn: a register with its worst value out of range, or a rule
/// without a register.
struct RegisterError {
    /// Empty for a rule.
    register: String,
    farthest: f64,
    sentence: String,
    /// Number of other values that the register cannot hold.
    others: usize,
}

impl RegisterError {
    fn sentence(self) -> String {
        if self.others == 0 {
            self.sentence
        } else {
            format!(
                "{} ({} more values do not fit either)",
                self.sentence, self.others
            )
        }
    }
}

impl RegisterLoader<'_> {
    fn refuse(&mut self, sentence: String) {
        self.errors.push(RegisterError {
            register: String::new(),
            farthest: 0.0,
            sentence,
            others: 0,
        });
    }

    /// Reports a register once, for any number of values out of range.
    fn overflow(&mut self, register: &str, value: f64, sentence: String) {
        match self
            .errors
            .iter_mut()
            .find(|error| error.register == register)
        {
            None => self.errors.push(RegisterError {
                register: register.to_owned(),
                farthest: value.abs(),
                sentence,
                others: 0,
            }),
            Some(error) => {
                error.others += 1;
                if value.abs() > error.farthest {
                    (error.farthest, error.sentence) = (value.abs(), sentence);
                }
            }
        }
    }

    /// A constant that must be in range.
    fn hold(&mut self, name: &str, word: Word, value: f64) -> i64 {
        let format = word.format;
        let (least, most) = (format.value(format.min()), format.value(format.max()));
        let half = format.value(1) / 2.0;
        if value > most + half || value < least - half {
            let int_bits =
                libm::floor(libm::log2(value.abs())) as i32 + if format.signed { 2 } else { 1 };
            let fits = Format {
                int_bits,
                frac_bits: (format.width() - int_bits).max(0),
                ..format
            };
            let sentence = format!(
                "{name} {word} holds {least} to {most}, but the scene needs {value}: {fits} would hold it"
            );
            self.overflow(name, value, sentence);
        }
        quantised(word, value)
    }

    fn view(&mut self, scene: &Scene, view: &View, scale: &Scale) -> frame::View {
        let (p, e, raster) = (
            self.machine.project,
            self.machine.ellipse,
            self.machine.raster,
        );
        let eye = (view.eye - DVec3::from_array(scale.offset)) * scale.factor();
        // Beyond the range of the slope's word nothing could be drawn: the guard band ends there.
        let focal_px = view.longest_focal_px();
        frame::View {
            rotation: std::array::from_fn(|row| {
                view.rotation
                    .row(row)
                    .to_array()
                    .map(|x| quantised(p.rotation, x))
            }),
            eye: eye.to_array().map(|x| self.hold("project.eye", p.eye, x)),
            near: quantised(p.depth, scene.camera.near * scale.factor()).max(0),
            guard: [0, 1].map(|axis| quantised(p.slope, view.slope(axis, scene.kernel.guard))),
            focal: self.hold("project.focal", p.focal, focal_px),
            inverse_focal: scaled(e.inverse_focal, 1.0 / focal_px),
            centre: view
                .off_middle_px()
                .map(|off| self.hold("project.pixel", p.pixel, off)),
            aspect: self.aspect(view),
            low_pass: self.hold("ellipse.low_pass", e.low_pass, scene.kernel.low_pass),
            cutoff: self.cutoff(raster.cutoff, limited_cutoff(self.machine, scene)),
            root_cutoff: self.hold(
                "ellipse.root_cutoff",
                e.root_cutoff,
                limited_cutoff(self.machine, scene).sqrt(),
            ),
            cull_backfaces: scene.surface.cull_backfaces,
        }
    }

    /// Registers for pixels that are not square.
    fn aspect(&mut self, view: &View) -> Option<frame::Aspect> {
        let (focal_px, squares) = (view.focal_px, view.aspect()?);
        let (p, e) = (self.machine.project, self.machine.ellipse);
        let Some(word) = e.aspect else {
            let [x, y] = focal_px;
            self.refuse(format!(
                "it draws only square pixels, and the camera's focal lengths are {x} and {y} pixels: `--set ellipse.aspect=U1F{}` gives it \
                 the registers",
                e.size_squared.format.width().clamp(1, 26)
            ));
            return None;
        };
        Some(frame::Aspect {
            focal: focal_px.map(|focal_px| self.hold("project.focal", p.focal, focal_px)),
            inverse_focal: focal_px.map(|focal_px| scaled(e.inverse_focal, 1.0 / focal_px)),
            squares: squares.map(|square| self.hold("ellipse.aspect", word, square)),
        })
    }

    /// The cutoff, which must also be in the range of the table.
    fn cutoff(&mut self, word: Word, cutoff: f64) -> i64 {
        let reach = self.machine.gauss.radial_index;
        let most = f64::from(reach.format.int_bits).exp2();
        if cutoff > most {
            self.refuse(format!("gauss.radial_index {reach} spans radial indices below {most}, but the scene's cutoff is {cutoff}"));
        }
        self.hold("raster.cutoff", word, cutoff).max(1)
    }

    fn walk(&mut self, scene: &Scene) -> Option<TreeWalk> {
        let detail = scene.detail.as_ref()?;
        let Budget { bytes, cycles, .. } = detail.rules.budget;
        if bytes.or(cycles).is_some() {
            self.refuse("level_of_detail.budget is in bytes or cycles; only `run` and sweeps search a cut for it".into());
        }
        let walk = self.machine.timing.walk;
        let (stack, deepest) = (walk.unwrap_or_default().stack, detail.cut.deepest);
        if deepest > stack as usize {
            self.refuse(format!(
                "timing.walk.stack is {stack}, but the walk stores up to {deepest} nodes on it"
            ));
        }
        if walk.is_none() {
            self.notes.push("the machine has no `timing.walk`: the tree is walked by the default one, which is not in its area".into());
        }
        Some(TreeWalk::new(detail))
    }

    /// 1/σ, machine units, if weights fall with depth.
    fn inverse_distance(&mut self, scene: &Scene, scale: &Scale) -> Option<f64> {
        if self.machine.depth_weight().is_some() {
            return Some(1.0 / (scene.weight_distance()? * scale.factor()));
        }
        if let Some(distance) = scene
            .sheets
            .as_ref()
            .and_then(|sheets| sheets.weight_distance)
        {
            self.notes.push(format!("sheets.weight_distance is {distance}, but weights fall with depth only on a machine with `sort.depth_weight`"));
        }
        None
    }

    fn ellipsoids(
        &mut self,
        scene: &Scene,
        view: &View,
        inverse_distance: Option<f64>,
    ) -> Option<frame::Ellipsoids> {
        let ellipsoids = scene.ellipsoids.as_ref()?;
        let machine = self.machine;
        let Some(words) = &machine.ellipse.ellipsoid else {
            self.refuse(
                "it draws only discs, and these splats are ellipsoids: `--machine volume` or `--machine gaussian` draws them".into(),
            );
            return None;
        };
        if ellipsoids.sorted && machine.sort.is_none() {
            self.refuse("it has no `sort`, and these splats are drawn in the order of depth: `--machine gaussian` sorts".into());
        }
        if ellipsoids.sorted && machine.sums_gaussians() && !scene.is_of_gaussians() {
            self.refuse("its sort.kind is none, which sums Gaussians of one source, and these splats are drawn in the order of depth: `--machine gaussian` sorts".into());
        }
        let size = [scene.image.width, scene.image.height];
        if let Some(sentence) = lacks_tile_bits(machine, size).filter(|_| ellipsoids.sorted) {
            self.refuse(sentence);
        }
        if scene.compensates() && words.compensation_root.is_none() {
            self.refuse(
                "it has no `ellipse.ellipsoid.compensation_root`, and these Gaussians' opacities are compensated for the low-pass filter: \
                 `--machine gaussian` has one, or `kernel.compensate_opacity` of the scene may be false"
                    .into(),
            );
        }
        let scales = |scales: DVec3| scales.to_array().map(|scale| quantised(words.scale, scale));
        let (least_opacity, reach) = scene.least_opacity().map_or((0, Vec::new()), |least| {
            // A weight of 0 never counts.
            let (reach, least) = (
                Reach::new(machine),
                quantised(machine.gauss.weight, least).max(1),
            );
            (
                reach.least_opacity(least),
                words.reach_bits.map_or_else(Vec::new, |bits| {
                    reach_words(machine, &reach, bits, least, scene)
                }),
            )
        });
        let same = ellipsoids.orientations.len() == 1;
        let turned = view.rotation * DMat3::from_quat(ellipsoids.orientations[0].rotation);
        let own = |orientation: &Orientation| {
            let DQuat { x, y, z, w } = orientation.rotation;
            frame::Orientation {
                quaternion: [w, x, y, z].map(|part| quantised(words.quaternion, part) as i32),
                scales: scales(orientation.scales).map(|scale| scale as i32),
            }
        };
        let harmonics = self.harmonics(ellipsoids);
        Some(frame::Ellipsoids {
            kernel: frame::Kernel {
                amplitude: match ellipsoids.amplitude {
                    Amplitude::Disc => frame::Amplitude::Disc,
                    Amplitude::LineIntegral => frame::Amplitude::LineIntegral,
                    Amplitude::Peak if scene.compensates() => frame::Amplitude::Compensated,
                    Amplitude::Peak => frame::Amplitude::Peak,
                },
                jacobian: [0, 1].map(|axis| {
                    quantised(
                        machine.project.slope,
                        view.slope(axis, scene.kernel.jacobian),
                    )
                }),
                axes: [turned.x_axis, turned.y_axis, turned.z_axis].map(|axis| {
                    axis.to_array()
                        .map(|part| quantised(machine.ellipse.normal, part))
                }),
                scales: scales(ellipsoids.orientations[0].scales),
                least_opacity,
                reach,
                inverse_distance: inverse_distance.zip(machine.depth_weight()).map_or_else(
                    Scaled::default,
                    |(inverse, words)| {
                        let Scaled { mantissa, places } = scaled(words.share, inverse);
                        // A port has 8 bits for the power.
                        let places = places.clamp(-127, 127);
                        Scaled { mantissa, places }
                    },
                ),
            },
            own: if same {
                Vec::new()
            } else {
                ellipsoids.orientations.par_iter().map(own).collect()
            },
            preshaded: ellipsoids.preshaded,
            sorted: ellipsoids.sorted && machine.sorting().is_some(),
            harmonics: harmonics.map_or(0, |harmonics| harmonics.degree),
            coefficients: harmonics.map_or_else(Vec::new, |own| self.coefficients(own)),
        })
    }

    /// Records of splats, and a note on colours that their words cannot hold.
    fn splats(&mut self, scene: &Scene, scale: &Scale) -> Vec<frame::Splat> {
        let word = self.machine.splat.rgb;
        let most = word.format.value(word.format.max());
        let bright = |splat: &&Splat| {
            splat
                .rgb
                .iter()
                .any(|channel| *channel > most + word.format.value(1))
        };
        let beyond = scene.splats.par_iter().filter(bright).count();
        if beyond > 0 && !has_harmonics(scene, self.machine) {
            self.notes.push(format!(
                "{beyond} of {} splats are brighter than splat.rgb holds, {most}",
                scene.splats.len()
            ));
        }
        splats(scene, self.machine, scale)
    }

    /// The harmonics from which the machine computes colours; none where its input has colours.
    fn harmonics<'s>(&mut self, ellipsoids: &'s Ellipsoids) -> Option<&'s Harmonics> {
        let (harmonics, colour) = (ellipsoids.harmonics.as_ref()?, self.machine.colour?);
        let degree = u32::from(harmonics.degree);
        if degree > colour.degree {
            self.refuse(format!(
                "colour.degree is {}, but its splats have spherical harmonics of degree {degree}",
                colour.degree
            ));
        }
        Some(harmonics)
    }

    /// Words of all coefficients.
    fn coefficients(&mut self, harmonics: &Harmonics) -> Vec<[i32; 3]> {
        let word = self.machine.colour.unwrap_or_default().coefficient;
        let of_machine = MachineHarmonics::new(harmonics.degree, harmonics.turn);
        let [least, most] =
            [word.format.min(), word.format.max()].map(|end| word.format.value(end));
        let (words, beyond): (Vec<Vec<[i32; 3]>>, Vec<usize>) = harmonics
            .coefficients
            .par_chunks((usize::from(harmonics.degree) + 1).pow(2))
            .map(|own| {
                let own: Vec<[f64; 3]> = of_machine.of(own).collect();
                let is_beyond = |value: &&f64| **value < least || **value > most;
                let beyond = own.as_flattened().iter().filter(is_beyond).count();
                let words = own
                    .iter()
                    .map(|rgb| rgb.map(|value| quantised(word, value) as i32));
                (words.collect(), beyond)
            })
            .unzip();
        self.harmonics = Some(of_machine);
        let beyond: usize = beyond.iter().sum();
        if beyond > 0 {
            self.notes.push(format!(
                "{beyond} of {} coefficients of harmonics are outside of {least} to {most}, which colour.coefficient holds",
                3 * harmonics.coefficients.len()
            ));
        }
        words.concat()
    }

    fn sheets(&mut self, scene: &Scene) -> Option<frame::Sheets> {
        let machine = self.machine;
        let composite = machine.fragment.composite();
        let is_of_gaussians = scene.is_of_gaussians();
        if composite.is_some() && !is_of_gaussians {
            self.refuse(
                "it blends each Gaussian into its pixel, and these splats are no Gaussians: `--machine gaussian` draws them, or `reference` if they are discs".into(),
            );
            return None;
        }
        if machine.contribution.is_some() && !is_of_gaussians {
            self.refuse(
                "its `contribution` tests blocks of pixels for Gaussians of one source, and these splats are others, or come from several sources: leave `contribution` out".into(),
            );
            return None;
        }
        let sheets = &*scene.sheets_for(machine.sums_gaussians())?;
        let Some(words) = &machine.fragment.sheets else {
            self.refuse(
                "it groups only by depth, and these splats are grouped by sheets: `--machine volume` or `--machine gaussian` does".into(),
            );
            return None;
        };
        let (each, numbers) = match &sheets.of {
            Sheet::Slice(numbers) => (frame::Each::Slice, numbers.clone()),
            Sheet::Splat => (frame::Each::Splat, Vec::new()),
            // All have number 0.
            Sheet::Sum => (frame::Each::Slice, Vec::new()),
        };
        Some(frame::Sheets {
            each,
            numbers,
            back_to_front: sheets.back_to_front || composite.is_some(),
            // Nothing is hidden by what is drawn later.
            stop: composite.map_or_else(
                || quantised(machine.fragment.opacity_sum, sheets.stop),
                |_| 0,
            ),
            keeps_last: sheets.keeps_last,
            least_weight: quantised(machine.gauss.weight, sheets.least_weight),
            most_weight: self.hold("gauss.weight", machine.gauss.weight, sheets.most_weight),
            ratio: if each == frame::Each::Slice {
                table_words(words.table, words.depth_index, words.ratio, |depth| {
                    sheets.opacity.over_depth(depth)
                })
            } else {
                Vec::new()
            },
        })
    }

    /// Registers of windows; `None` where the machine groups by depth or the scene by sheets.
    fn window(&mut self, scene: &Scene, scale: &Scale) -> Option<frame::Window> {
        let fragment = &self.machine.fragment;
        let words = fragment
            .window
            .as_ref()
            .filter(|_| scene.sheets.is_none())?;
        let reach = f64::from(words.join_permille.min(1000)) / 1000.0
            * scene.surface.z_threshold
            * scale.factor();
        Some(frame::Window {
            reach: quantised(fragment.depth, reach),
            density: table_words(
                words.density_table,
                self.machine.splat.opacity,
                words.density,
                window_density,
            ),
            hidden: table_words(words.hidden_table, words.exponent, words.hidden, |x| {
                -libm::expm1(-x)
            }),
        })
    }

    fn z_threshold(&mut self, scene: &Scene, scale: &Scale) -> i64 {
        let word = self.machine.fragment.depth;
        let z_threshold = quantised(word, scene.surface.z_threshold * scale.factor());
        if z_threshold == 0 {
            let last_place = word.format.value(1) / scale.factor();
            self.notes.push(format!(
                "the z threshold {} is below the LSB of fragment.depth, {last_place}: that is used instead",
                scene.surface.z_threshold
            ));
        }
        z_threshold.max(1)
    }

    fn background(&mut self, [r, g, b, a]: [f64; 4]) -> [i64; 4] {
        [r * a, g * a, b * a, a]
            .map(|channel| self.hold("resolve.frame", self.machine.resolve.frame, channel))
    }

    fn lighting(&mut self, scene: &Scene, view: &View) -> frame::Lighting {
        let word = self.machine.shade.light;
        let vector = |v: DVec3| v.to_array().map(|x| quantised(word, x));
        let light = |light: &Light| {
            let direction = view.rotation * light.direction;
            let half_way = direction - DVec3::Z;
            let is_some = half_way.length() > 1e-9;
            frame::Light {
                direction: vector(direction),
                half_way: is_some.then(|| vector(half_way.normalize())),
            }
        };
        frame::Lighting {
            lights: scene.lights.iter().map(light).collect(),
            materials: scene
                .materials
                .iter()
                .map(|material| self.material(material, &scene.lights))
                .collect(),
        }
    }

    /// Surroundings; `None` where nothing reflects.
    fn surroundings(&mut self, scene: &Scene, view: &View) -> Option<frame::Surroundings> {
        let environment = scene
            .environment
            .as_deref()
            .filter(|environment| environment.is_seen())?;
        let machine = self.machine;
        let Some(words) = &machine.reflect else {
            self.refuse(
                "it has no `reflect`, and materials of the scene reflect their surroundings (see the book's chapter Reflection for a machine that can)"
                    .into(),
            );
            return None;
        };
        let is_lit_first = machine.fragment.window.is_some()
            || scene
                .ellipsoids
                .as_ref()
                .is_some_and(|ellipsoids| ellipsoids.preshaded);
        if words.sight == Sight::Ray && is_lit_first {
            self.refuse(
                "its reflect.sight is `ray`, but splats that are lit before they are drawn have no pixel: use `axis`".into(),
            );
        }
        let word = words.reflectance;
        let mirror = |mirror: &Mirror| frame::Mirror {
            kept: quantised(word, 1.0 - mirror.reflect),
            mirrored: mirror
                .tint
                .map(|tint| quantised(word, mirror.reflect * tint)),
        };
        // Elaborated maps are not larger.
        let texels = octahedral(environment, view.rotation, words.index_bits.clamp(1, 8));
        let most = words.light.format.value(words.light.format.max());
        let beyond = texels
            .iter()
            .filter(|texel| texel.iter().any(|light| *light > most))
            .count();
        if beyond > 0 {
            self.notes
                .push(format!("{beyond} of {} texels of the surroundings are brighter than reflect.light holds, {most}", texels.len()));
        }
        let held = frame::Surroundings {
            mirrors: environment.mirrors.iter().map(mirror).collect(),
            texels: texels
                .iter()
                .map(|texel| texel.map(|light| quantised(words.light, light)))
                .collect(),
        };
        self.texels = texels;
        Some(held)
    }

    fn material(&mut self, material: &Material, lights: &[Light]) -> frame::Material {
        let Material::BlinnPhong {
            ambient,
            diffuse,
            specular,
            shininess,
        } = *material
        else {
            return frame::Material::Unlit;
        };
        let word = self.machine.shade.reflectance;
        let mut answer = |factor: f64| {
            lights
                .iter()
                .map(|light| {
                    light
                        .rgb
                        .map(|channel| self.hold("shade.reflectance", word, factor * channel))
                })
                .collect()
        };
        let (diffuse, specular) = (answer(diffuse), answer(specular));
        frame::Material::BlinnPhong {
            ambient: self.hold("shade.reflectance", word, ambient),
            diffuse,
            specular,
            highlight: highlight_words(self.machine, shininess),
        }
    }
}

/// A function over the range of an argument's word, at the middles or at the ends of the table's
/// steps.
fn table_words(
    shape: TableShape,
    argument: Word,
    result: Word,
    function: impl Fn(f64) -> f64,
) -> Vec<i64> {
    // Elaborated tables are not larger.
    let steps = 1usize << shape.index_bits.min(12);
    let range = f64::from(argument.format.int_bits).exp2();
    let (count, shift) = match shape.interpolation {
        Interpolation::Nearest => (steps, 0.5),
        Interpolation::Linear => (steps + 1, 0.0),
    };
    (0..count)
        .map(|i| quantised(result, function((i as f64 + shift) / steps as f64 * range)))
        .collect()
}

/// The cutoff that a machine uses for a scene.
pub fn limited_cutoff(machine: &Machine, scene: &Scene) -> f64 {
    let most = machine.raster.most_cutoff.map_or(f64::INFINITY, f64::from);
    scene.kernel.cutoff.min(most)
}

/// Extra reach of a box, as a fraction of the radial index, for errors of the conic's words and the
/// differencing registers. A pixel that they draw nearer than it is then still is in the box.
const REACH_MARGIN: f64 = 1.0 / 32.0;

/// Cutoffs by opacity, for boxes. Each step over [0, 1], including 1, reaches as far as the weights
/// of its greatest opacity count, rounded up, but not beyond the frame's cutoff.
fn reach_words(machine: &Machine, reach: &Reach, bits: u32, least: i64, scene: &Scene) -> Vec<i64> {
    let (opacity, word, radial) = (
        machine.splat.opacity.format,
        machine.raster.cutoff,
        machine.gauss.radial_index.format,
    );
    let steps = 1i64 << bits.min(12);
    let frame = quantised(word, limited_cutoff(machine, scene)).max(1);
    let cutoff = |step: i64| {
        let end = opacity.one() * (step + 1) / steps;
        let greatest = if step + 1 == steps {
            end.min(opacity.max())
        } else {
            end - 1
        };
        let Some(farthest) = reach.farthest(greatest, least) else {
            return 1;
        };
        // The radial index was rounded by less than one ulp.
        let cutoff = radial.value(farthest + 1) * (1.0 + REACH_MARGIN);
        ((cutoff * f64::from(word.format.frac_bits).exp2()).ceil() as i64).clamp(1, frame)
    };
    (0..steps).map(cutoff).collect()
}

/// x^shininess over [0, 1], at the middles or at the ends of the table's steps.
fn highlight_words(machine: &Machine, shininess: f64) -> Vec<i64> {
    let (shape, word) = (machine.shade.highlight_table, machine.shade.highlight);
    let steps = 1usize << shape.index_bits;
    let (count, shift) = match shape.interpolation {
        Interpolation::Nearest => (steps, 0.5),
        Interpolation::Linear => (steps + 1, 0.0),
    };
    (0..count)
        .map(|i| {
            quantised(
                word,
                libm::pow((i as f64 + shift) / steps as f64, shininess),
            )
        })
        .collect()
}

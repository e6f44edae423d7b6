//! Redraw: draws the frame of a folder again, for data that its files do not contain: exact values,
//! and counts per pixel.
//!
//! ```text
//! report.json ─► scene, machine ─► same camera, splats? ─► draw ─► same contributions, errors? ─┬─► pixel: words, linear light, errors, bound, flips
//!                                                                                               ├─► maps: bound, covered, contributions, layers, merges
//!                                                                                               └─► pixel trace, as in `explain`
//! ```
//! Law (tests/view.rs): `a_pixel_has_the_values_of_the_run`.

use super::folder::DrawnRun;
use crate::accuracy::{KINDS, Lockstep, distance};
use crate::error::{Error, Result};
use crate::golden;
use crate::hardware::fixed;
use crate::output::picture::Picture;
use crate::run::detail::bounded;
use crate::run::evaluation::Evaluation;
use crate::run::explain::{Explained, explained};
use crate::run::preview;
use crate::scene::{Overrides, Scene, memory};
use rtl_model::Machine;
use rtl_model::num::Format;
use rtl_model::pipeline;
use rtl_model::probe::Observer;
use rtl_model::units::fragment::{Contribution, Decision, TILE_AREA, TILE_PX};
use rtl_model::units::resolve::Layer;
use serde_json::{Value, json};
use std::any::Any;
use std::collections::BTreeMap;
use std::ffi::OsStr;

/// Maps in addition to the pictures of a run, in the order of their keys.
pub const MAPS: [&str; 5] = ["bound", "covered", "contributions", "layers", "merges"];

/// A frame with all data about its pixels.
#[derive(Debug)]
pub struct Redraw {
    scene: Scene,
    machine: Machine,
    frame: Format,
    words: Vec<[u32; 4]>,
    golden: Picture,
    ideal: Picture,
    lockstep: Lockstep,
    /// Per pixel: contributions, layers at the end, merges.
    counts: Vec<[u32; 3]>,
}

impl Redraw {
    /// Draws the frame of a run again; `scene` is the path of its scene if it was moved.
    ///
    /// # Errors
    /// [`Error::Input`] if the scene cannot be read any more, or is not the one that was drawn.
    pub fn new(run: &DrawnRun, scene: Option<&OsStr>) -> Result<Self> {
        let [width, height] = run.preview_of.unwrap_or(run.size);
        let name = scene.unwrap_or(OsStr::new(&run.scene));
        let scene = Scene::load_frame(
            name,
            &Overrides {
                size: Some((width, height)),
            },
            run.frame,
        )?;
        let scene = if run.preview_of.is_some() {
            preview::scene(&scene)?
        } else {
            scene
        };
        let name = scene.name.clone();
        let other = |what: &str| {
            Error::input(format!(
                "{name}: is no longer the scene of report.json: it has {what}"
            ))
        };
        if [scene.image.width, scene.image.height] != run.size {
            return Err(other("another size"));
        }
        if json!(scene.camera) != run.camera {
            return Err(other("another camera"));
        }
        let [splats, contributions] = run.counts;
        // For a tree, the cut within its budget on this machine.
        let scene = bounded(scene, &fixed::elaborate(&run.machine)?)?;
        if scene.splats.len() as u64 != splats {
            return Err(other(&format!(
                "{} splats, and {splats} were drawn",
                scene.splats.len()
            )));
        }
        memory::check_frame(&scene)?;
        let evaluation = Evaluation::new(&scene, &run.machine)?;
        let mut census = Census::default();
        let drawing = pipeline::draw_with_decisions(
            &evaluation.machine,
            &evaluation.quantised.frame,
            &mut census,
        );
        if drawing.outcomes.total() != contributions {
            return Err(other(&format!(
                "{} contributions, and {contributions} were made",
                drawing.outcomes.total()
            )));
        }
        let (golden, lockstep) = (evaluation.golden().picture, evaluation.lockstep());
        let ideal = golden::ideal(&scene).picture;
        let fixed = evaluation.picture(&drawing);
        for (pictures, reported) in [(&fixed, &golden), (&golden, &ideal)]
            .into_iter()
            .zip(&run.accuracy)
        {
            let now = distance(pictures.0, pictures.1);
            if !is_near(now.psnr_db, reported["psnr_db"].as_f64())
                || !is_near(Some(now.max_error), reported["max_error"].as_f64())
            {
                return Err(other(
                    "another picture: colours, lights, or the version that drew it differ",
                ));
            }
        }
        let counts = census.counts(scene.image.width, scene.image.height);
        let frame = run.machine.resolve.frame.format;
        let words = drawing.frame;
        Ok(Redraw {
            machine: run.machine.clone(),
            frame,
            words,
            golden,
            ideal,
            lockstep,
            counts,
            scene,
        })
    }

    fn index(&self, [x, y]: [usize; 2]) -> Option<usize> {
        let (width, height) = (self.scene.image.width, self.scene.image.height);
        (x < width && y < height).then(|| y * width + x)
    }

    /// All data of a pixel in numbers; none outside the picture.
    pub fn pixel(&self, [x, y]: [usize; 2]) -> Option<Value> {
        let index = self.index([x, y])?;
        let words = self.words[index].map(i64::from);
        let fixed = words.map(|word| self.frame.value(word));
        let golden = self.golden.rgba[index];
        let error: [f64; 4] = std::array::from_fn(|channel| fixed[channel] - golden[channel]);
        let flipped = self.lockstep.flipped[index];
        let flips: Vec<&str> = (0..KINDS.len())
            .filter(|kind| flipped >> kind & 1 == 1)
            .map(|kind| KINDS[kind])
            .collect();
        let [contributions, layers, merges] = self.counts[index];
        let bound = self.lockstep.bound[index];
        Some(json!({
            "x": x, "y": y, "format": self.frame.to_string(), "words": words, "encoded": self.scene.image.encoded,
            "fixed": fixed, "golden": golden, "ideal": self.ideal.rgba[index], "error": error,
            "error_ulp": error.map(|error| error / self.frame.value(1)), "error_255": error.map(|error| 255.0 * error),
            "bound": bound.is_finite().then_some(bound), "flips": flips,
            "covered": self.covered(index), "contributions": contributions, "layers": layers, "merges": merges,
        }))
    }

    fn covered(&self, index: usize) -> bool {
        self.counts[index][0] > 0 || self.golden.covered[index]
    }

    /// A map, pixel by pixel as little-endian float32, row 0 first; none for an unknown name.
    pub fn map(&self, name: &str) -> Option<Vec<u8>> {
        let pixels = 0..self.counts.len();
        let value = |index: usize| -> Option<f32> {
            Some(match name {
                "bound" => self.lockstep.bound[index] as f32,
                "covered" => f32::from(u8::from(self.covered(index))),
                "contributions" => self.counts[index][0] as f32,
                "layers" => self.counts[index][1] as f32,
                "merges" => self.counts[index][2] as f32,
                _ => return None,
            })
        };
        let values: Option<Vec<f32>> = pixels.map(value).collect();
        Some(values?.into_iter().flat_map(f32::to_le_bytes).collect())
    }

    /// The pixel trace of [`explained`].
    ///
    /// # Errors
    /// As [`explained`].
    pub fn story(&self, pixel: [usize; 2]) -> Result<Explained> {
        explained(&self.scene, &self.machine, pixel)
    }
}

/// Whether two figures are equal except for the last bits, which can differ between computers; or
/// both are none, for equal pictures.
fn is_near(now: Option<f64>, then: Option<f64>) -> bool {
    match (now, then) {
        (Some(now), Some(then)) => (now - then).abs() <= 1e-7 * then.abs().max(1e-6),
        (now, then) => now == then,
    }
}

/// Counts of a tile's pixels: contributions, layers at the end, merges.
type Counts = Vec<[u32; 3]>;

/// Counts events at each pixel, tile by tile.
#[derive(Debug, Default)]
struct Census {
    /// Finished tiles, by column and row.
    tiles: BTreeMap<[u32; 2], Counts>,
    /// The current tile.
    open: Option<([u32; 2], Counts)>,
}

impl Census {
    fn at(&mut self, x: u32, y: u32) -> &mut [u32; 3] {
        let side = TILE_PX as u32;
        let tile = [x / side, y / side];
        if self.open.as_ref().is_none_or(|(open, _)| *open != tile) {
            self.close();
        }
        let (_, counts) = self
            .open
            .get_or_insert_with(|| (tile, vec![[0; 3]; TILE_AREA]));
        &mut counts[(y % side * side + x % side) as usize]
    }

    fn close(&mut self) {
        if let Some((tile, counts)) = self.open.take() {
            self.add(tile, counts);
        }
    }

    fn add(&mut self, tile: [u32; 2], counts: Counts) {
        let all = self
            .tiles
            .entry(tile)
            .or_insert_with(|| vec![[0; 3]; TILE_AREA]);
        for (all, more) in all.iter_mut().zip(counts) {
            (0..3).for_each(|count| all[count] += more[count]);
        }
    }

    fn counts(mut self, width: usize, height: usize) -> Counts {
        self.close();
        let mut all = vec![[0; 3]; width * height];
        for ([column, row], counts) in self.tiles {
            let (left, top) = (column as usize * TILE_PX, row as usize * TILE_PX);
            for y in 0..TILE_PX.min(height - top) {
                let columns = TILE_PX.min(width - left);
                let (to, from) = ((top + y) * width + left, y * TILE_PX);
                all[to..to + columns].copy_from_slice(&counts[from..from + columns]);
            }
        }
        all
    }
}

impl Observer<'static> for Census {
    fn fork(&self) -> Box<dyn Observer<'static>> {
        Box::new(Census::default())
    }

    fn hand_over(mut self: Box<Self>) -> Box<dyn Any + Send> {
        self.close();
        self
    }

    fn take_over(&mut self, seen: Box<dyn Any + Send>) {
        if let Ok(fork) = seen.downcast::<Census>() {
            fork.tiles
                .into_iter()
                .for_each(|(tile, counts)| self.add(tile, counts));
        }
    }

    fn contribution(&mut self, x: u32, y: u32, _: &Contribution, decision: Decision) {
        let counts = self.at(x, y);
        counts[0] += 1;
        counts[2] += u32::from(matches!(
            decision,
            Decision::Merged(..) | Decision::Closed(..)
        ));
    }

    fn resolved(&mut self, x: u32, y: u32, layers: &[Layer], _: [i64; 4]) {
        self.at(x, y)[1] += layers.len() as u32;
    }
}

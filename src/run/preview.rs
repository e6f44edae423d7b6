//! Preview: a run with a quarter of the columns and rows, and an extrapolation to the whole
//! picture.
//!
//! ```text
//! scene ───────────────► areas of all footprints ─► contributions of the whole
//! scene at 1/8 of its side ─► [figures] ─┐
//! scene at 1/4 ───► run ────► [figures] ─┴─► effect of the last doubling on all other figures
//! ```
//! Contributions can be counted without drawing: they are the pixels within each ellipse. No other
//! figure can be predicted: decibels depend on single flips, cycles on how often neighbours meet in
//! a pixel.
//!
//! Law: `contributions_of_the_whole_are_within_the_stated_uncertainty`.

use crate::accuracy::distance;
use crate::error::{Error, Result};
use crate::golden;
use crate::hardware::fixed;
use crate::output::text::{aligned, duration, gigabytes, plain_table, thousands, wrapped};
use crate::run::evaluation::Evaluation;
use crate::run::timed;
use crate::scene::{Scene, memory};
use rtl_model::Machine;
use rtl_model::num::Rounding;
use rtl_model::timing::{self, Detail};
use schemars::JsonSchema;
use serde::Serialize;

/// One in this many columns and rows is drawn.
pub const PART: usize = 4;
/// Least number of pixels of the whole's shorter side.
const LEAST_SIDE_PX: usize = 128;
/// Least relative uncertainty of contributions, unless the preview's own deviation is greater. It
/// covers rims, and splats that coarse words make faint.
const LEAST_OFF: f64 = 0.05;

/// Figures of a picture of one size.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Figures {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Contributions that the machine made.
    pub contributions: u64,
    /// Cycles of the frame.
    pub cycles: u64,
    /// Bytes to and from memory.
    pub memory_bytes: u64,
    /// PSNR of the arithmetic's error.
    pub fixed_vs_golden_psnr_db: Option<f64>,
    /// PSNR of the method's error.
    pub golden_vs_ideal_psnr_db: Option<f64>,
    /// PSNR of the whole error.
    pub fixed_vs_ideal_psnr_db: Option<f64>,
}

/// Extrapolation from a preview to the whole picture.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Preview {
    /// Columns and rows of the whole.
    pub of: [usize; 2],
    /// Estimated contributions of the whole.
    pub contributions: u64,
    /// Estimated relative uncertainty of `contributions`.
    pub off: f64,
    sizes: Vec<Figures>,
}

/// The same scene with its columns and rows divided by `part`.
fn smaller(scene: &Scene, part: usize) -> Scene {
    let mut scene = scene.clone();
    scene.image.width = (scene.image.width / part).max(1);
    scene.image.height = (scene.image.height / part).max(1);
    scene.cut()
}

/// The scene as a preview draws it.
///
/// # Errors
/// [`Error::Input`] if the scene is already small.
pub fn scene(whole: &Scene) -> Result<Scene> {
    let (width, height) = (whole.image.width, whole.image.height);
    if width.min(height) < LEAST_SIDE_PX {
        let sentence = format!(
            "--preview: {width}×{height} pixels are few; a preview needs at least {LEAST_SIDE_PX} per side"
        );
        return Err(Error::input(sentence));
    }
    Ok(smaller(whole, PART))
}

/// Estimated contributions of a scene on a machine, without weights that round to 0.
fn contributions(scene: &Scene, machine: &Machine) -> u64 {
    let weight = machine.gauss.weight;
    let place = weight.format.value(1);
    golden::contributions(
        scene,
        if weight.round == Rounding::Truncate {
            place
        } else {
            place / 2.0
        },
    )
}

/// Relative uncertainty of the whole's contributions, from the expected and the counted
/// contributions of a smaller picture, where splats are smaller and fainter. (`tiny` has no words
/// for splats seen edge-on, and may leave out a third where this is 5 %.)
fn uncertainty(expected: u64, had: u64) -> f64 {
    (expected as f64 / had.max(1) as f64 - 1.0)
        .abs()
        .max(LEAST_OFF)
}

fn figures(scene: &Scene, machine: &Machine) -> Result<Figures> {
    let evaluation = Evaluation::new(scene, machine)?;
    let (drawing, _, work) = fixed::draw_measured(&evaluation.machine, &evaluation.quantised);
    let cycles = timing::replay(&evaluation.machine.timing, &work, Detail::Total);
    let [fixed, golden, ideal] = [
        evaluation.picture(&drawing),
        evaluation.golden().picture,
        golden::ideal(scene).picture,
    ];
    Ok(Figures {
        width: scene.image.width,
        height: scene.image.height,
        contributions: drawing.outcomes.total(),
        cycles: cycles.total,
        memory_bytes: cycles.memory.total_bytes(),
        fixed_vs_golden_psnr_db: distance(&fixed, &golden).psnr_db,
        golden_vs_ideal_psnr_db: distance(&golden, &ideal).psnr_db,
        fixed_vs_ideal_psnr_db: distance(&fixed, &ideal).psnr_db,
    })
}

impl Preview {
    /// Extrapolates to a whole, from the figures `now` of a run of its preview.
    ///
    /// # Errors
    /// As [`crate::run::run`].
    pub fn new(whole: &Scene, machine: &Machine, now: Figures) -> Result<Self> {
        let less = figures(&smaller(whole, 2 * PART), machine)?;
        let off = uncertainty(contributions(&scene(whole)?, machine), now.contributions);
        Ok(Preview {
            of: [whole.image.width, whole.image.height],
            contributions: contributions(whole, machine),
            off,
            sizes: vec![less, now],
        })
    }

    /// Factor by which the whole takes longer, for a scene with `splats` splats.
    pub fn growth(&self, splats: usize) -> f64 {
        let now = self.sizes.last().map_or(0, |now| now.contributions);
        time_ratio(splats, now as f64, self.contributions as f64)
    }

    /// Describes what was left out and how reliable the figures are, at most 80 columns wide.
    /// `seconds` is the estimated time of the whole.
    pub fn summary(&self, seconds: f64) -> String {
        let [less, now] = &self.sizes[..] else {
            return String::new();
        };
        let size = |figures: &Figures| format!("{}×{}", figures.width, figures.height);
        let mut table = plain_table(&["", &size(less), &size(now), "last doubling"]);
        let share = |a: u64, b: u64| {
            if a == 0 {
                "–".to_owned()
            } else {
                format!("{:+.0}%", 100.0 * (b as f64 / a as f64 - 1.0))
            }
        };
        for (name, count) in [
            (
                "contributions",
                (|f| f.contributions) as fn(&Figures) -> u64,
            ),
            ("cycles", |f| f.cycles),
            ("bytes to and from memory", |f| f.memory_bytes),
        ] {
            table.add_row([
                name.to_owned(),
                thousands(count(less)),
                thousands(count(now)),
                share(count(less), count(now)),
            ]);
        }
        for (name, db) in [
            (
                "fixed − golden, dB",
                (|f| f.fixed_vs_golden_psnr_db) as fn(&Figures) -> Option<f64>,
            ),
            ("golden − ideal, dB", |f| f.golden_vs_ideal_psnr_db),
            ("fixed − ideal, dB", |f| f.fixed_vs_ideal_psnr_db),
        ] {
            let decibels = |db: Option<f64>| db.map_or("equal".into(), |db| format!("{db:.1}"));
            let change = db(less)
                .zip(db(now))
                .map_or("–".into(), |(less, now)| format!("{:+.1}", now - less));
            table.add_row([
                name.to_owned(),
                decibels(db(less)),
                decibels(db(now)),
                change,
            ]);
        }
        let [width, height] = self.of;
        let left_out = PART * PART - 1;
        let head = format!(
            "preview of {width}×{height}: {left_out} of {} pixels left out, no splat",
            PART * PART
        );
        let whole = format!(
            "the whole has about {} contributions, ±{:.0}%, and takes about {} here; other figures do not scale: two more doublings will change them again, as the last one did",
            thousands(rounded(self.contributions)),
            100.0 * self.off,
            duration(seconds)
        );
        format!(
            "{}\n{}\n{}",
            wrapped(&head),
            aligned(table).trim_fmt(),
            wrapped(&whole)
        )
    }
}

/// Jobs longer than this are announced, seconds.
const LONG: f64 = 10.0;
/// Splats and pixels from which a job may be long.
const MANY: usize = 2_000_000;

/// Bytes of memory from which a job is announced.
const MUCH: u64 = 1 << 30;

/// Sentence to print before a job that takes long or needs much memory, and its estimated seconds;
/// none for other jobs. The estimate takes at most a fortieth of the job: every splat is set up
/// once, which gives the contributions and the speed of this computer.
pub fn announcement(scene: &Scene, machine: &Machine) -> Option<(String, f64)> {
    let pixels = scene.image.width * scene.image.height;
    if scene.splats.len().max(pixels) < MANY
        || scene.image.width.min(scene.image.height) < LEAST_SIDE_PX
    {
        return None;
    }
    let (contributions, seconds) = timed(|| contributions(scene, machine));
    let [splat, contribution, pixel] = RUN_OVER_SET_UP;
    let each = |count: f64| count / scene.splats.len().max(1) as f64;
    let expected =
        seconds * (splat + contribution * each(contributions as f64) + pixel * each(pixels as f64));
    let is_quicker = each(contributions as f64) > SMALL;
    let bytes = memory::of_frame(scene);
    let note = || {
        let (splats, contributions) = (
            thousands(scene.splats.len() as u64),
            thousands(rounded(contributions)),
        );
        let hint = if is_quicker {
            " (--preview is quicker)"
        } else {
            ""
        };
        let memory = gigabytes(bytes);
        (
            format!(
                "{splats} splats, about {contributions} contributions: about {} and {memory} of memory{hint}",
                duration(expected)
            ),
            expected,
        )
    };
    (expected > LONG || bytes > MUCH).then(note)
}

/// Pixels per splat below which a smaller picture saves nothing: the low-pass filter alone covers
/// about ten, on each of two pictures.
const SMALL: f64 = 30.0;
/// Time of a run per splat, per contribution and per pixel, in units of one setup of a splat.
/// Fitted with a margin: 4.7 million points at 512², glass-spheres at 2048², the dragon scan at
/// 1600² and terrain at 2048×1536 took 21, 26, 16 and 20 s; these factors give 27, 36, 20 and 23
/// (two cores).
const RUN_OVER_SET_UP: [f64; 3] = [35.0, 2.5, 6.0];
/// Setup of a splat in units of one contribution (instructions at the time of the fit: 340 and
/// 250).
const SET_UP: f64 = 1.36;

/// Ratio of the times of a frame with `now` and with `before` contributions of the same splats.
fn time_ratio(splats: usize, before: f64, now: f64) -> f64 {
    let set_up = SET_UP * splats as f64;
    (set_up + now) / (set_up + before).max(1.0)
}

/// Rounded to three digits.
fn rounded(count: u64) -> u64 {
    let place = 10u64.pow(count.max(1).ilog10().saturating_sub(2));
    (count + place / 2) / place * place
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hardware::quantise::quantise;
    use crate::scene::Overrides;

    #[test]
    fn contributions_of_the_whole_are_within_the_stated_uncertainty() {
        let surfaces =
            ["glass-spheres", "checkerboard", "torus-knot", "terrain"].map(|scene| (scene, "lean"));
        let ellipsoids = [
            ("nested-shells", "volume"),
            ("marschner-lobb", "volume"),
            ("bouquet", "gaussian"),
        ];
        for (name, machine) in surfaces.into_iter().chain(ellipsoids) {
            let whole = Scene::load(
                name,
                &Overrides {
                    size: Some((160, 128)),
                },
            )
            .unwrap();
            let machine = Machine::named(machine).unwrap();
            let counted = golden::contributions(&whole, 0.0) as f64;
            let drawn = golden::render(&whole, &fixed::rules(&machine)).fragments as f64;
            assert!(
                (counted / drawn - 1.0).abs() < 1e-5,
                "{name}: {counted} were counted, {drawn} were drawn"
            );
            let about = contributions(&whole, &machine) as f64;
            let elaborated = fixed::elaborate(&machine).unwrap();
            let is = fixed::draw(&elaborated, &quantise(&whole, &machine).unwrap())
                .outcomes
                .total() as f64;
            let small = super::scene(&whole).unwrap();
            let had = fixed::draw(&elaborated, &quantise(&small, &machine).unwrap())
                .outcomes
                .total();
            let off = uncertainty(contributions(&small, &machine), had);
            assert!(
                (about / is - 1.0).abs() <= off,
                "{name} on {}: {about} is said, and {is} it is",
                machine.name
            );
        }
    }

    #[test]
    fn estimates_have_three_digits() {
        assert_eq!(
            [0, 7, 999, 1004, 1005, 14_051_197, 99_950].map(rounded),
            [0, 7, 999, 1000, 1010, 14_100_000, 100_000]
        );
    }

    #[test]
    fn a_small_picture_has_no_preview_and_a_small_job_no_announcement() {
        let scene = |side| {
            Scene::load(
                "torus-knot",
                &Overrides {
                    size: Some((side, 512)),
                },
            )
            .unwrap()
        };
        assert!(
            super::scene(&scene(127))
                .unwrap_err()
                .to_string()
                .contains("127×512 pixels are few")
        );
        let smaller = super::scene(&scene(130)).unwrap();
        assert_eq!(
            (
                smaller.image.width,
                smaller.image.height,
                smaller.splats.len()
            ),
            (32, 128, scene(130).splats.len())
        );
        assert_eq!(
            announcement(&scene(512), &Machine::named("tiny").unwrap()),
            None
        );
    }
}

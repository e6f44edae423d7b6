//! Preview: the job with a quarter of the columns and rows, and what that says of the whole.
//!
//! ```text
//! scene ───────────────► areas of all footprints ─► contributions of the whole
//! scene at 1/8 of its side ─► [figures] ─┐
//! scene at 1/4 ───► run ────► [figures] ─┴─► what the last doubling did to all else
//! ```
//! Contributions can be counted without drawing: they are the pixels within each ellipse. Nothing
//! else can be told before: decibels hang on single flips, cycles on how often neighbours meet in a
//! pixel.
//!
//! Law: `contributions_of_the_whole_are_as_close_as_is_said`.

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

/// Of columns and rows, one in so many is drawn.
pub const PART: usize = 4;
/// Pixels that the shorter side of the whole has at least.
const LEAST_SIDE_PX: usize = 128;
/// As a part of them, contributions are off by this, if those of the preview do not say more: rims,
/// and what coarse words make faint.
const LEAST_OFF: f64 = 0.05;

/// Figures of a picture of one size.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Figures {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Contributions that the machine made.
    pub contributions: u64,
    /// Cycles of the frame.
    pub cycles: u64,
    /// Bytes to and from memory.
    pub memory_bytes: u64,
    /// The arithmetic's error.
    pub fixed_vs_golden_psnr_db: Option<f64>,
    /// The method's error.
    pub golden_vs_ideal_psnr_db: Option<f64>,
    /// The whole error.
    pub fixed_vs_ideal_psnr_db: Option<f64>,
}

/// Preview: what was left out, and what the rest says.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Preview {
    /// Pixels of the whole.
    pub of: [usize; 2],
    /// Contributions of the whole, about.
    pub contributions: u64,
    /// As a part of them, they are off by at most about this.
    pub off: f64,
    sizes: Vec<Figures>,
}

/// The same scene with so many times fewer columns and rows.
fn smaller(scene: &Scene, part: usize) -> Scene {
    let mut scene = scene.clone();
    scene.image.width = (scene.image.width / part).max(1);
    scene.image.height = (scene.image.height / part).max(1);
    scene.cut()
}

/// The scene as a preview draws it.
///
/// # Errors
/// [`Error::Input`] where it is small already.
pub fn scene(whole: &Scene) -> Result<Scene> {
    let (width, height) = (whole.image.width, whole.image.height);
    if width.min(height) < LEAST_SIDE_PX {
        let sentence = format!(
            "--preview: {width}×{height} pixels are few already; with {LEAST_SIDE_PX} or more a side there is something to leave out"
        );
        return Err(Error::input(sentence));
    }
    Ok(smaller(whole, PART))
}

/// Contributions of a scene on a machine, about: weights that round to 0 are none.
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

/// How far contributions of the whole may be off where so many were expected of a smaller picture,
/// and so many it had: there, splats are smaller and fainter. (`tiny` has no words for splats seen
/// edge-on, and may leave out a third where this says 5 %.)
fn off(expected: u64, had: u64) -> f64 {
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
    /// Of a whole, and the figures `now` of a run of its preview.
    ///
    /// # Errors
    /// As [`crate::run::run`].
    pub fn new(whole: &Scene, machine: &Machine, now: Figures) -> Result<Self> {
        let less = figures(&smaller(whole, 2 * PART), machine)?;
        let off = off(contributions(&scene(whole)?, machine), now.contributions);
        Ok(Preview {
            of: [whole.image.width, whole.image.height],
            contributions: contributions(whole, machine),
            off,
            sizes: vec![less, now],
        })
    }

    /// Factor by which the whole takes longer, with so many splats.
    pub fn growth(&self, splats: usize) -> f64 {
        let now = self.sizes.last().map_or(0, |now| now.contributions);
        longer(splats, now as f64, self.contributions as f64)
    }

    /// Says what was left out and how far figures can be trusted, at most 80 columns wide. The
    /// whole would take so many seconds.
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
            "the whole has about {} contributions, {:.0}% more or less, and takes about {} here; other figures do not scale: what the last doubling changed, two more will change again",
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
/// Splats and pixels from which on a job may be long.
const MANY: usize = 2_000_000;

/// Bytes from which on a job's memory is announced.
const MUCH: u64 = 1 << 30;

/// Sentence to say before a job that takes long or much memory, and the seconds that it may take;
/// none otherwise. It takes a fortieth of the job or less: every splat is set up once, which tells
/// the contributions and how fast this computer is.
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

/// Pixels of a splat below which a smaller picture saves nothing: its low-pass filter alone reaches
/// about ten, on each of two pictures.
const SMALL: f64 = 30.0;
/// Times to set a splat up that a run takes for each splat, each contribution and each pixel.
/// Fitted, on the long side: 4.7 million points at 512², glass-spheres at 2048², the dragon scan at
/// 1600² and terrain at 2048×1536 took 21, 26, 16 and 20 s where this tells 27, 36, 20 and 23 (two
/// cores).
const RUN_OVER_SET_UP: [f64; 3] = [35.0, 2.5, 6.0];
/// A splat is set up in the time of so many contributions (instructions, when this was fitted: 340
/// and 250).
const SET_UP: f64 = 1.36;

/// How many times as long a frame takes with other contributions of as many splats.
fn longer(splats: usize, before: f64, now: f64) -> f64 {
    let set_up = SET_UP * splats as f64;
    (set_up + now) / (set_up + before).max(1.0)
}

/// To three digits.
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
    fn contributions_of_the_whole_are_as_close_as_is_said() {
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
                    size: Some((256, 256)),
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
            let off = off(contributions(&small, &machine), had);
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
                "terrain",
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

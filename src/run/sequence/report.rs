//! Report of a sequence: `report.json` for a scene with many cameras (docs/book/paths.md), and its
//! summary for a terminal.

use crate::accuracy::flicker::{Flicker, FlickerChange};
use crate::accuracy::{Metrics, db_text};
use crate::output::text::{aligned, plain_table, share, thousands, wrapped};
use crate::run::against::{Against, Means};
use crate::run::report::{CulledReport, Distances, MachineReport};
use crate::scene::Camera;
use schemars::JsonSchema;
use serde::Serialize;
use std::fmt::Write;

/// Results of a sequence. All fields except `host` are the same for the same input on every
/// computer, with any number of threads.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[schemars(rename = "SequenceReport")]
pub struct Report {
    /// Version of this program.
    pub version: &'static str,
    /// The scene.
    pub scene: SceneReport,
    /// The machine.
    pub machine: MachineReport,
    /// Worst, median and 99th percentile over the frames.
    pub spreads: Spreads,
    /// Flicker over all pairs of frames; none for a single frame.
    pub flicker: Option<Flicker>,
    /// Golden and fixed against photographs of the views, means over the frames; only if
    /// photographs were given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub against: Option<Means>,
    /// One row per frame.
    pub frames: Vec<FrameReport>,
    /// Time on this computer.
    pub host: Host,
}

/// Figures of the scene.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[schemars(rename = "SequenceScene")]
pub struct SceneReport {
    /// File or built-in name.
    pub name: String,
    /// Pixels.
    pub width: usize,
    /// Pixels.
    pub height: usize,
    /// Splats of the scene.
    pub splats: u64,
    /// Frames.
    pub frames: u64,
    /// Notes of readers and quantiser, without repetitions.
    pub notes: Vec<String>,
}

/// One frame.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct FrameReport {
    /// Its number, from 0.
    pub frame: u64,
    /// The whole camera, in the form of a scene file.
    pub camera: Camera,
    /// Power of two from world units to machine units. If it changes between frames, so does the
    /// rounding of every splat.
    pub scale_exponent: i32,
    /// Splats that were not drawn, by the first reason that holds.
    pub culled: CulledReport,
    /// Contributions that the machine made.
    pub fragments: u64,
    /// Saturated results, without those of declared clamps.
    pub saturated: u64,
    /// Results that wrapped.
    pub wrapped: u64,
    /// Cycles from the first request to the last word written.
    pub cycles: u64,
    /// Frames per second, if all frames took as long as this one.
    pub frames_per_second: f64,
    /// The unit, or memory, whose limit costs the most cycles.
    pub bottleneck: &'static str,
    /// Bytes from and to memory.
    pub memory_bytes: u64,
    /// Distances of the pictures.
    pub accuracy: Distances,
    /// Golden and fixed against a photograph of the view; only if photographs were given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub against: Option<Against>,
    /// Flicker against the frame before; none for the first.
    pub flicker: Option<Flicker>,
}

/// Statistics of a figure over all frames, where greater is better. None stands for equal pictures,
/// which is better than any number.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Spread {
    /// Value of the worst frame.
    pub worst: Option<f64>,
    /// Value that 99 frames in 100 reach: with n frames, the ⌈n/100⌉-th from the worst.
    pub percentile_99: Option<f64>,
    /// Value that half of the frames reach: the ⌈n/2⌉-th from the worst.
    pub median: Option<f64>,
}

/// Figures over all frames.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Spreads {
    /// Frames per second.
    pub frames_per_second: Spread,
    /// PSNR of the arithmetic's error, dB.
    pub fixed_vs_golden_psnr_db: Spread,
    /// PSNR of the method's error, dB.
    pub golden_vs_ideal_psnr_db: Spread,
    /// PSNR of the whole error, dB.
    pub fixed_vs_ideal_psnr_db: Spread,
}

/// Wall-clock figures of this computer, over all frames; nothing else in a report depends on the
/// computer.
#[derive(Clone, Copy, Debug, Default, Serialize, JsonSchema)]
#[schemars(rename = "SequenceHost")]
pub struct Host {
    /// Threads that were used.
    pub threads: usize,
    /// Time to read the scene, including neighbours.
    pub load_seconds: f64,
    /// Time of the machine, including the recording of its work.
    pub fixed_seconds: f64,
    /// Time of `golden`.
    pub golden_seconds: f64,
    /// Time of `ideal`.
    pub ideal_seconds: f64,
}

impl Spread {
    /// Statistics of values; none is better than any number.
    ///
    /// # Panics
    /// If there are no values: a sequence has at least one frame.
    pub fn new(values: impl IntoIterator<Item = Option<f64>>) -> Self {
        let mut sorted: Vec<f64> = values
            .into_iter()
            .map(|value| value.unwrap_or(f64::INFINITY))
            .collect();
        sorted.sort_by(f64::total_cmp);
        let nth = |per_cent: usize| {
            Some(sorted[(sorted.len() * per_cent).div_ceil(100) - 1])
                .filter(|value| value.is_finite())
        };
        Spread {
            worst: Some(sorted[0]).filter(|value| value.is_finite()),
            percentile_99: nth(1),
            median: nth(50),
        }
    }
}

impl Spreads {
    /// Statistics of these frames.
    pub fn new(frames: &[FrameReport]) -> Self {
        let of = |value: fn(&FrameReport) -> Option<f64>| Spread::new(frames.iter().map(value));
        Spreads {
            frames_per_second: of(|frame| Some(frame.frames_per_second)),
            fixed_vs_golden_psnr_db: of(|frame| frame.accuracy.fixed_vs_golden.psnr_db),
            golden_vs_ideal_psnr_db: of(|frame| frame.accuracy.golden_vs_ideal.psnr_db),
            fixed_vs_ideal_psnr_db: of(|frame| frame.accuracy.fixed_vs_ideal.psnr_db),
        }
    }
}

impl Report {
    /// The summary, at most 80 columns wide.
    pub fn summary(&self) -> String {
        let (scene, machine) = (&self.scene, &self.machine.description.name);
        let splats = thousands(scene.splats);
        let frames = if scene.frames == 1 {
            "1 frame".into()
        } else {
            format!("{} frames", thousands(scene.frames))
        };
        let title = format!(
            "{} on {machine}, {}×{}, {frames}: {splats} splats",
            scene.name, scene.width, scene.height
        );
        let mut text = format!("{}\n\n{}\n", wrapped(&title), self.spread_table());
        if let Some(means) = &self.against {
            let frames: Vec<(u64, &Against)> = self
                .frames
                .iter()
                .filter_map(|row| Some((row.frame, row.against.as_ref()?)))
                .collect();
            let _ = write!(text, "\n{}\n", means.tables(&frames));
        }
        if let Some(flicker) = &self.flicker {
            let _ = write!(text, "\n{}\n", flicker_table(flicker));
        }
        for note in &scene.notes {
            let _ = writeln!(text, "{}", wrapped(&format!("note: {note}")));
        }
        let Host {
            load_seconds,
            fixed_seconds,
            golden_seconds,
            ideal_seconds,
            ..
        } = self.host;
        let _ = write!(
            text,
            "\nhost: load {load_seconds:.2} s, fixed {fixed_seconds:.2} s, golden {golden_seconds:.2} s, ideal {ideal_seconds:.2} s"
        );
        text
    }

    fn spread_table(&self) -> String {
        let not_finite = |metrics: fn(&Distances) -> Metrics| {
            self.frames
                .iter()
                .map(|f| metrics(&f.accuracy).not_finite)
                .sum::<u64>()
        };
        let mut table = plain_table(&["", "worst frame", "99 % of frames", "median"]);
        let s = &self.spreads;
        for (name, spread, broken) in [
            ("frames/s", s.frames_per_second, 0),
            (
                "fixed − golden, dB",
                s.fixed_vs_golden_psnr_db,
                not_finite(|d| d.fixed_vs_golden),
            ),
            (
                "golden − ideal, dB",
                s.golden_vs_ideal_psnr_db,
                not_finite(|d| d.golden_vs_ideal),
            ),
            (
                "fixed − ideal, dB",
                s.fixed_vs_ideal_psnr_db,
                not_finite(|d| d.fixed_vs_ideal),
            ),
        ] {
            let cell = |value: Option<f64>| db_text(value, broken, |value| format!("{value:.1}"));
            table.add_row([
                name.to_owned(),
                cell(spread.worst),
                cell(spread.percentile_99),
                cell(spread.median),
            ]);
        }
        aligned(table).trim_fmt()
    }
}

fn flicker_table(flicker: &Flicker) -> String {
    let mut table = plain_table(&["flicker", "mean change", "jumps > 4/255"]);
    let pairs = [
        ("fixed − golden", flicker.fixed_vs_golden),
        ("golden − ideal", flicker.golden_vs_ideal),
        ("fixed − ideal", flicker.fixed_vs_ideal),
    ];
    for (name, FlickerChange { mean, jumps }) in pairs {
        let shown = |value: Option<f64>, show: fn(f64) -> String| {
            db_text(value, flicker.not_finite, show).replace("equal", "–")
        };
        table.add_row([
            name.to_owned(),
            shown(mean, |mean| format!("{:.4}/255", 255.0 * mean)),
            shown(jumps, |jumps| format!("{:.4} %", 100.0 * jumps)),
        ]);
    }
    let (still, covered) = (flicker.still_pixels, flicker.covered_pixels);
    let line = format!(
        "at {} still pixels of {} covered ones ({}), frame to frame: where ideal changes by less than 0.5/255",
        thousands(still),
        thousands(covered),
        share(still, covered)
    );
    format!("{}\n{}", aligned(table).trim_fmt(), wrapped(&line))
}

#[cfg(test)]
mod tests {
    use super::Spread;

    /// Nearest ranks, counted by hand; none (equal pictures) is better than any number.
    #[test]
    fn percentiles_are_counted_from_the_worst() {
        let of = |values: Vec<Option<f64>>| Spread::new(values);
        let many = of((0..200).rev().map(|value| Some(f64::from(value))).collect());
        assert_eq!(
            many,
            Spread {
                worst: Some(0.0),
                percentile_99: Some(1.0),
                median: Some(99.0)
            }
        );
        let few = of(vec![Some(3.0), None, Some(2.0)]);
        assert_eq!(
            few,
            Spread {
                worst: Some(2.0),
                percentile_99: Some(2.0),
                median: Some(3.0)
            }
        );
        assert_eq!(
            of(vec![None, None, Some(1.0)]),
            Spread {
                worst: Some(1.0),
                percentile_99: Some(1.0),
                median: None
            }
        );
        assert_eq!(
            of(vec![None]),
            Spread {
                worst: None,
                percentile_99: None,
                median: None
            }
        );
    }
}

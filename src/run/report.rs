//! Report: results of a run, as `report.json` (docs/book/reference/report.md) and as a summary for
//! a terminal of 80 columns.

use crate::accuracy::attribution::Attribution;
use crate::accuracy::ranges::SignalReport;
use crate::accuracy::{Metrics, Summary, db_text, metrics};
use crate::hardware::quantise::Scale;
use crate::output::picture::Picture;
use crate::output::text::{aligned, plain_table, thousands, wrapped};
use crate::performance::answers::Answers;
use crate::performance::cost::CostReport;
use crate::performance::cycles::CyclesReport;
use crate::performance::timings::Timings;
use crate::run::against::Against;
use crate::run::detail::DetailReport;
use crate::run::preview::{Figures, Preview};
use crate::scene::Camera;
use comfy_table::Table;
use rtl_model::elaboration::{Operator, Part};
use rtl_model::machine::Machine;
use rtl_model::pipeline::Culled;
use rtl_model::pipeline::Elaborated;
use rtl_model::units::fragment::Outcomes;
use schemars::JsonSchema;
use serde::Serialize;
use std::fmt::Write;

/// Above this, two pictures differ only by a few ulp of f64, and the summary prints only the limit.
const MOST_DB: f64 = 200.0;

/// Results of a run. All fields except `host` are the same for the same input on every computer,
/// with any number of threads.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Report {
    /// Version of this program.
    pub version: &'static str,
    /// The scene.
    pub scene: SceneReport,
    /// The drawn cut of a tree of splats; only if the scene has a tree.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub level_of_detail: Option<DetailReport>,
    /// The machine.
    pub machine: MachineReport,
    /// Distances of the pictures.
    pub accuracy: Accuracy,
    /// Golden and fixed against a photograph of the view; only if one was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub against: Option<Against>,
    /// Outcomes of the contributions on the machine.
    pub fragments: Fragments,
    /// The range of every signal.
    pub signals: Vec<SignalReport>,
    /// Cycles of the machine.
    pub cycles: CyclesReport,
    /// Area, and energy per frame.
    pub cost: CostReport,
    /// Cycles of other microarchitectures; only if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub timings: Option<Timings>,
    /// Fields of `timing` that would make the frame faster; only if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub answers: Option<Answers>,
    /// Extrapolation to a larger picture; only for a preview.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preview: Option<Preview>,
    /// Figures of the golden renderer for the same scene.
    pub golden: Golden,
    /// Error attribution; only if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attribution: Option<Attribution>,
    /// Factor of `error.png`.
    pub error_scale: f64,
    /// Time on this computer.
    pub host: Host,
}

/// Figures of the scene.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct SceneReport {
    /// File or built-in name.
    pub name: String,
    /// Frame of a sequence, from 0; only if the scene is part of one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<u64>,
    /// Pixels.
    pub width: usize,
    /// Pixels.
    pub height: usize,
    /// Splats of the scene.
    pub splats: u64,
    /// Splats that were not drawn, by the first reason that holds.
    pub culled: CulledReport,
    /// Contributions that the machine made.
    pub fragments: u64,
    /// The whole camera, in the form of a scene file.
    pub camera: Camera,
    /// Scale from world units to machine units.
    pub scale: Scale,
    /// Notes of readers and quantiser.
    pub notes: Vec<String>,
}

/// Splats that were not drawn.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct CulledReport {
    near: u64,
    outside: u64,
    faint: u64,
    backface: u64,
    /// Opacity too small for any weight to count.
    transparent: u64,
}

impl From<Culled> for CulledReport {
    fn from(culled: Culled) -> Self {
        let Culled {
            near,
            outside,
            faint,
            backface,
            transparent,
        } = culled;
        CulledReport {
            near,
            outside,
            faint,
            backface,
            transparent,
        }
    }
}

/// Figures of the machine.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct MachineReport {
    /// The whole description.
    pub description: Machine,
    /// Bits of one fragment in the frame buffer.
    pub fragment_bits: i32,
    /// Bits of the widest multiplier operand.
    pub widest_operand_bits: i32,
    /// The microarchitecture with all defaults filled in.
    pub timing: rtl_model::elaboration::microarchitecture::Microarchitecture,
    /// How the scene exceeds the conditions that the machine was searched for; empty if it does
    /// not. Only for a machine whose file contains these conditions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outside_of_search: Option<Vec<String>>,
}

/// Distances of the three pictures.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Distances {
    /// The arithmetic's error.
    pub fixed_vs_golden: Metrics,
    /// The method's error.
    pub golden_vs_ideal: Metrics,
    /// The whole error: the arithmetic's and the method's.
    pub fixed_vs_ideal: Metrics,
}

impl Distances {
    /// Compares the three pictures.
    pub fn between(fixed: &Picture, golden: &Picture, ideal: &Picture) -> Self {
        Distances {
            fixed_vs_golden: metrics(fixed, golden),
            golden_vs_ideal: metrics(golden, ideal),
            fixed_vs_ideal: metrics(fixed, ideal),
        }
    }
}

/// Distances of the three pictures, and the distance by arithmetic only.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Accuracy {
    /// Distances of the pictures.
    #[serde(flatten)]
    pub distances: Distances,
    /// The arithmetic's error only: against `golden` led by the machine's decisions. Absent after
    /// `run --check none`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lockstep: Option<Summary>,
}

/// Outcomes of contributions.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Fragments {
    accumulated: u64,
    inserted: u64,
    merged: u64,
    evicted: u64,
    replaced: u64,
    dropped: u64,
    /// Windows only, as the two below: blended over the front or under the back of a closed slot.
    #[serde(skip_serializing_if = "is_none")]
    late: u64,
    /// Blended between the front and the back of a closed slot.
    #[serde(skip_serializing_if = "is_none")]
    inside: u64,
    /// Caused the sum of two slots.
    #[serde(skip_serializing_if = "is_none")]
    summed: u64,
    most_in_a_pixel: u64,
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "the signature that serde requires"
)]
fn is_none(count: &u64) -> bool {
    *count == 0
}

impl From<Outcomes> for Fragments {
    fn from(o: Outcomes) -> Self {
        Fragments {
            accumulated: o.accumulated,
            inserted: o.inserted,
            merged: o.merged,
            evicted: o.evicted,
            replaced: o.replaced,
            dropped: o.dropped,
            late: o.late,
            inside: o.inside,
            summed: o.summed,
            most_in_a_pixel: o.most_in_a_pixel,
        }
    }
}

/// Figures of the golden renderer.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct Golden {
    /// Contributions.
    pub fragments: u64,
    /// Splats not drawn.
    pub culled: crate::golden::Culled,
    /// Outcomes of the contributions.
    pub outcomes: crate::golden::Outcomes,
}

/// Wall-clock figures of this computer; nothing else in a report depends on the computer.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Host {
    /// Threads that were used.
    pub threads: usize,
    /// Absolute path of the scene's file, from which `view` draws it again. None for a built-in
    /// scene.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scene_file: Option<String>,
    /// Time to read the scene, including neighbours.
    pub load_seconds: f64,
    /// Time to quantise the scene.
    pub quantise_seconds: f64,
    /// Time of the machine without probes.
    pub fixed_seconds: f64,
    /// Time of the machine with ranges observed and work recorded.
    pub watched_seconds: f64,
    /// The same time as `watched_seconds`; the two were separate in earlier versions.
    pub recorded_seconds: f64,
    /// Time of the replay, in parallel with lockstep.
    pub replay_seconds: f64,
    /// Time of `golden`.
    pub golden_seconds: f64,
    /// Time of `ideal`.
    pub ideal_seconds: f64,
    /// Time of the machine with `golden` in lockstep, in parallel with the replay; absent after
    /// `run --check none`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lockstep_seconds: Option<f64>,
    /// Time of error attribution; only if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attribution_seconds: Option<f64>,
    /// Estimated seconds of the whole picture of a preview.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub whole_seconds: Option<f64>,
    /// Contributions per second of the machine without probes.
    pub fragments_per_second: f64,
}

impl MachineReport {
    /// Describes a machine.
    pub fn new(machine: &Elaborated) -> Self {
        let operands = |part: &Part| {
            if let Operator::Multiplier(bits) = part.operator {
                bits
            } else {
                [0; 2]
            }
        };
        let widest = machine.parts.iter().flat_map(operands).max();
        MachineReport {
            description: machine.machine.clone(),
            fragment_bits: machine.machine.fragment_bits(),
            widest_operand_bits: widest.unwrap_or(0),
            timing: machine.timing.clone(),
            outside_of_search: None,
        }
    }
}

impl Report {
    /// Figures of a preview.
    pub fn figures(&self) -> Figures {
        let Distances {
            fixed_vs_golden,
            golden_vs_ideal,
            fixed_vs_ideal,
        } = self.accuracy.distances;
        Figures {
            width: self.scene.width,
            height: self.scene.height,
            contributions: self.scene.fragments,
            cycles: self.cycles.total,
            memory_bytes: self.cycles.memory.bytes,
            fixed_vs_golden_psnr_db: fixed_vs_golden.psnr_db,
            golden_vs_ideal_psnr_db: golden_vs_ideal.psnr_db,
            fixed_vs_ideal_psnr_db: fixed_vs_ideal.psnr_db,
        }
    }

    /// The summary, at most 80 columns wide.
    pub fn summary(&self) -> String {
        let mut text = String::new();
        let scene = &self.scene;
        let [splats, fragments] = [scene.splats, scene.fragments].map(thousands);
        let machine = &self.machine.description.name;
        let title = format!(
            "{} on {machine}, {}×{}: {splats} splats, {fragments} contributions",
            scene.name, scene.width, scene.height
        );
        let _ = writeln!(text, "{}\n", wrapped(&title));
        let _ = writeln!(text, "{}\n", self.accuracy_table());
        if let Some(against) = &self.against {
            let _ = writeln!(text, "{}\n", against.table());
        }
        let _ = writeln!(text, "{}\n", self.lockstep_summary());
        let _ = writeln!(text, "{}\n", self.work_table());
        let _ = writeln!(text, "{}\n{}\n", self.cycles.summary(), self.cost.summary());
        if let Some(timings) = &self.timings {
            let _ = writeln!(text, "{}\n", timings.table());
        }
        if let Some(answers) = &self.answers {
            let _ = writeln!(text, "{}\n", answers.table());
        }
        if let Some(detail) = &self.level_of_detail {
            let _ = writeln!(text, "{}", wrapped(&detail.summary()));
        }
        let _ = writeln!(text, "{}", self.signal_summary());
        for note in &scene.notes {
            let _ = writeln!(text, "{}", wrapped(&format!("note: {note}")));
        }
        if let Some(attribution) = &self.attribution {
            let _ = writeln!(text, "\n{}", attribution.summary());
        }
        let _ = write!(text, "\n{}", self.host_summary());
        if let Some(preview) = &self.preview {
            let _ = write!(
                text,
                "\n\n{}\n",
                preview.summary(self.host.whole_seconds.unwrap_or(0.0))
            );
        }
        text
    }

    fn accuracy_table(&self) -> Table {
        let mut table = plain_table(&[
            "",
            "PSNR dB",
            "covered dB",
            "SSIM",
            "max error",
            "mean error",
            "px > 1/255",
        ]);
        let Distances {
            fixed_vs_golden,
            golden_vs_ideal,
            fixed_vs_ideal,
        } = self.accuracy.distances;
        for (name, m) in [
            ("fixed − golden", fixed_vs_golden),
            ("golden − ideal", golden_vs_ideal),
            ("fixed − ideal", fixed_vs_ideal),
        ] {
            let shown = |db: f64| {
                if db > MOST_DB {
                    format!("> {MOST_DB}")
                } else {
                    format!("{db:.1}")
                }
            };
            let db = |db: Option<f64>| db_text(db, m.not_finite, shown);
            table.add_row([
                name.into(),
                db(m.psnr_db),
                db(m.psnr_covered_db),
                format!("{:.5}", m.ssim),
                format!("{:.4}", m.max_error),
                format!("{:.1e}", m.mean_error),
                thousands(m.pixels_over_1_255),
            ]);
        }
        aligned(table)
    }

    fn lockstep_summary(&self) -> String {
        let Some(l) = &self.accuracy.lockstep else {
            return "not run in lockstep, so no bound was checked (--check none)".into();
        };
        let f = &l.flips;
        let kinds = f
            .by_kind()
            .into_iter()
            .chain([("unexplained", f.unexplained)]);
        let kinds: Vec<String> = kinds
            .filter(|(_, count)| *count > 0)
            .map(|(kind, count)| format!("{} {kind}", thousands(count)))
            .collect();
        let kinds = if kinds.is_empty() {
            String::new()
        } else {
            format!(" ({})", kinds.join(", "))
        };
        let db = db_text(l.psnr_db, l.not_finite, |db| format!("{db:.1} dB"));
        let all = self.scene.width * self.scene.height;
        let sampled = l.sampled_pixels.map_or(String::new(), |pixels| {
            format!(
                " at {} of {} pixels",
                thousands(pixels),
                thousands(all as u64)
            )
        });
        let bound = match l.bound.nine_in_ten {
            Some(bound) => format!(
                "at most {:.2}/255 at 90 % of the covered pixels",
                255.0 * bound
            ),
            None if l.bound.share_over_1 > 0.0 => {
                "infinite at 10 % or more of the covered pixels".into()
            }
            None => "no pixel is covered".into(),
        };
        let beyond = match l.bound_violations {
            1 => "1 pixel".to_owned(),
            count => format!("{} pixels", thousands(count)),
        };
        [
            format!("in lockstep{sampled}, golden led by the machine's decisions: {db}, at most {:.4} off", l.max_error),
            format!("bound: {bound}, exceeded at {beyond}"),
            format!("decisions that golden takes differently: {}{kinds}", thousands(l.decision_flips)),
        ]
        .map(|line| wrapped(&line))
        .join("\n")
    }

    fn work_table(&self) -> Table {
        let f = &self.fragments;
        let g = &self.golden.outcomes;
        let row = |name: &str, counts: [u64; 6]| {
            std::iter::once(name.to_owned())
                .chain(counts.map(thousands))
                .collect::<Vec<_>>()
        };
        let of_windows = [f.late, f.inside, f.summed, g.late, g.inside, g.summed];
        if of_windows.iter().any(|count| *count > 0) {
            let mut table = plain_table(&[
                "",
                "accumulated",
                "inserted",
                "late",
                "inside",
                "summed",
                "closed",
                "evicted",
            ]);
            let row = |name: &str, counts: [u64; 7]| {
                std::iter::once(name.to_owned())
                    .chain(counts.map(thousands))
                    .collect::<Vec<_>>()
            };
            table.add_row(row(
                "fixed",
                [
                    f.accumulated,
                    f.inserted,
                    f.late,
                    f.inside,
                    f.summed,
                    f.merged,
                    f.evicted,
                ],
            ));
            table.add_row(row(
                "golden",
                [
                    g.accumulated,
                    g.inserted,
                    g.late,
                    g.inside,
                    g.summed,
                    g.merged,
                    g.evicted,
                ],
            ));
            return aligned(table);
        }
        let mut table = plain_table(&[
            "",
            "accumulated",
            "inserted",
            "merged",
            "evicted",
            "replaced",
            "dropped",
        ]);
        table.add_row(row(
            "fixed",
            [
                f.accumulated,
                f.inserted,
                f.merged,
                f.evicted,
                f.replaced,
                f.dropped,
            ],
        ));
        table.add_row(row(
            "golden",
            [
                g.accumulated,
                g.inserted,
                g.merged,
                g.evicted,
                g.replaced,
                g.dropped,
            ],
        ));
        aligned(table)
    }

    fn signal_summary(&self) -> String {
        let culled = &self.scene.culled;
        let reasons = [
            ("near", culled.near),
            ("outside", culled.outside),
            ("transparent", culled.transparent),
            ("faint", culled.faint),
            ("backface", culled.backface),
        ];
        let culled: Vec<String> = reasons
            .iter()
            .filter(|(_, count)| *count > 0)
            .map(|(reason, count)| format!("{} {reason}", thousands(*count)))
            .collect();
        let culled = if culled.is_empty() {
            "none".into()
        } else {
            culled.join(", ")
        };
        let over: Vec<&SignalReport> = self
            .signals
            .iter()
            .filter(|signal| signal.overflows() > 0)
            .collect();
        let mut text = format!(
            "culled: {culled}\nsignals: {} observed, outside their range {}",
            self.signals.len(),
            if over.is_empty() {
                "none".into()
            } else {
                over.len().to_string()
            }
        );
        for signal in over {
            let declared = if signal.is_declared_clamp() {
                ", a declared clamp"
            } else {
                ""
            };
            let what = if signal.wrapped() > 0 {
                "wrapped"
            } else {
                "saturated"
            };
            let times = if signal.overflows() == 1 {
                "once".into()
            } else {
                thousands(signal.overflows()) + " times"
            };
            let line = format!(
                "  {}.{} ({}) {what} {times}{declared}",
                signal.unit, signal.name, signal.format
            );
            let _ = write!(text, "\n{}", wrapped(&line));
            if let Some(remedy) = signal.remedy() {
                let _ = write!(
                    text,
                    "\n{}",
                    wrapped(&format!(
                        "  (kernels seen along their length exceed its range; `{remedy}` holds them)"
                    ))
                );
            }
        }
        text
    }

    fn host_summary(&self) -> String {
        let h = &self.host;
        let times = [
            ("load", h.load_seconds),
            ("fixed", h.fixed_seconds),
            ("golden", h.golden_seconds),
            ("ideal", h.ideal_seconds),
        ];
        let times = times
            .map(|(what, seconds)| format!("{what} {seconds:.2} s"))
            .join(", ");
        format!(
            "host: {times}\n      fixed makes {:.0} M contributions per second",
            h.fragments_per_second / 1e6
        )
    }
}

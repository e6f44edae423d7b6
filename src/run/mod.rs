//! Run: the main job. Draws a scene on the machine, with `golden` and with `ideal`, compares the
//! pictures, and reports.
//!
//! ```text
//! scene ─┬─► quantise ─► fixed ─┬─► compare ─► report.json, summary
//!        ├─► golden ────────────┤
//!        └─► ideal ─────────────┘
//! ```

pub mod against;
pub mod compare;
pub mod detail;
pub mod evaluation;
pub mod explain;
pub mod preview;
pub mod report;
pub mod sequence;

use crate::accuracy::attribution::attribute;
use crate::accuracy::{CheckedTiles, ErrorPicture, Lockstep, error_picture, ranges};
use crate::error::Result;
use crate::golden;
use crate::golden::Rendering;
use crate::hardware::fixed;
use crate::output::chart;
use crate::output::files::{Unwritten, write_as_one, write_beside};
use crate::output::picture::Picture;
use crate::performance::answers::Answers;
use crate::performance::cost::{CostReport, Prices};
use crate::performance::cycles::{CyclesReport, Requests};
use crate::performance::recording::files_of_cycles;
use crate::performance::timings::{Timings, Variants};
use crate::run::against::Photographs;
use crate::run::detail::DetailReport;
use crate::run::evaluation::{Evaluation, Observed};
use crate::run::report::{Accuracy, Distances, Golden, Host, MachineReport, Report, SceneReport};
use crate::scene::{Scene, memory};
use rtl_model::Machine;
use rtl_model::timing::{Detail, RecordedFrame};
use rtl_model::work::Work;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// How much of a frame is checked in lockstep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Check {
    /// All tiles.
    #[default]
    Full,
    /// One tile in eight.
    Sampled,
    /// No tile.
    None,
}

impl Check {
    fn tiles(self) -> Option<CheckedTiles> {
        match self {
            Check::Full => Some(CheckedTiles::All),
            Check::Sampled => Some(CheckedTiles::Sampled),
            Check::None => None,
        }
    }
}

/// Options of a run. By default nothing optional is done.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Attribute the error.
    pub attribution: bool,
    /// Tiles that are checked in lockstep.
    pub check: Check,
    /// Replay the frame on other microarchitectures.
    pub timings: Option<Variants>,
    /// Find changes that make the frame faster (what-if).
    pub answers: bool,
    /// Record every request to memory.
    pub requests: bool,
    /// Record work, for timing to replay.
    pub record: bool,
    /// Unit costs of bits.
    pub prices: Prices,
    /// How the scene exceeds the conditions that the machine was searched for; none if it was not
    /// searched.
    pub outside_of_search: Option<Vec<String>>,
    /// Number of the frame, if the scene is part of a sequence.
    pub frame: Option<u64>,
    /// The file that the scene was read from; none for a built-in scene.
    pub scene_file: Option<PathBuf>,
    /// The photograph of the frame, among those of its sequence.
    pub against: Option<Photographs>,
}

/// Files that every run of one frame writes, except `report.json`.
const ALWAYS: [&str; 9] = [
    "fixed.png",
    "golden.png",
    "ideal.png",
    "error.png",
    "ranges.png",
    "cycles.png",
    "cycles.csv",
    "roofline.png",
    "roofline.svg",
];

/// Files that only some runs write.
const OPTIONAL: [&str; 12] = [
    "flips.png",
    "bounds.png",
    "attribution.png",
    "timings.png",
    "tiles.csv",
    "requests.ramulator2",
    "requests.dramsim3",
    "requests.json",
    "fixed.exr",
    "golden.exr",
    "ideal.exr",
    // Written by `replay` of a recording.
    "cycles.json",
];

/// Three pictures, their difference, and the report.
#[derive(Clone, Debug)]
pub struct RunResult {
    /// Picture of the hardware.
    pub fixed: Picture,
    /// Picture of exact arithmetic by the same rules.
    pub golden: Picture,
    /// Picture without a limit of fragments.
    pub ideal: Picture,
    /// |fixed − golden|, scaled to be seen.
    pub error: ErrorPicture,
    /// The machine with `golden` in lockstep, unless it was disabled.
    pub lockstep: Option<Lockstep>,
    /// Every request to memory, if requested.
    pub requests: Option<Requests>,
    /// Recorded work, if requested.
    pub work: Option<Work>,
    /// Figures.
    pub report: Report,
    /// Colours are values for a screen, not linear light.
    pub encoded: bool,
}

/// Draws `scene` on `machine` and compares; optionally attributes the error. `load_seconds` is
/// copied into the report.
///
/// # Errors
/// [`crate::error::Error::Input`] if the machine cannot be built or cannot hold the scene.
pub fn run(
    scene: &Scene,
    machine: &Machine,
    load_seconds: f64,
    options: &Options,
) -> Result<RunResult> {
    memory::check_frame(scene)?;
    let attributed = options.attribution;
    let mut elaborated = fixed::elaborate(machine)?;
    let changes_lists = options
        .timings
        .as_ref()
        .is_some_and(Variants::changes_lists);
    elaborated.records_choices = options.answers || changes_lists;
    let elaborated = elaborated;
    let (evaluation, quantise_seconds) = timed(|| Evaluation::on(scene, &elaborated));
    let evaluation = evaluation?;
    let scene = &*evaluation.scene;
    // Drawn only to measure its time.
    let (_, fixed_seconds) = timed(|| evaluation.draw());
    let (observed, observed_seconds) = timed(|| evaluation.observe());
    let Observed {
        drawing,
        picture: fixed,
        signals,
        work,
    } = observed;
    let detail = if options.requests {
        Detail::Log
    } else {
        Detail::Histograms
    };
    let replay = || {
        let frame = RecordedFrame::new(&work);
        let (cycles, seconds) = timed(|| frame.replay(&elaborated.timing, detail));
        let timings = options
            .timings
            .as_ref()
            .map(|variants| Timings::new(variants, &frame));
        let answers = options
            .answers
            .then(|| Answers::new(&elaborated, &frame, &cycles, &options.prices));
        let report = CyclesReport::on(&elaborated.timing, &frame, &cycles);
        (cycles, report, seconds, timings, answers)
    };
    let (golden, golden_seconds) = timed(|| evaluation.golden());
    let exact = || {
        let (ideal, ideal_seconds) = timed(|| golden::ideal(scene));
        let distances = Distances::between(&fixed, &golden.picture, &ideal.picture);
        (
            ideal,
            ideal_seconds,
            distances,
            error_picture(&fixed, &golden.picture),
        )
    };
    // A replay uses one thread; the other threads run the lockstep.
    let (
        (cycles, cycles_report, replay_seconds, timings, answers),
        (ideal, ideal_seconds, distances, error),
    ) = rayon::join(replay, exact);
    // The recorded work is large.
    let work = options.record.then_some(work);
    let (lockstep, lockstep_seconds) = timed(|| {
        options
            .check
            .tiles()
            .map(|tiles| evaluation.lockstep_in(tiles))
    });
    let (attribution, attribution_seconds) = timed(|| {
        attributed.then(|| attribute(scene, &elaborated, &evaluation.quantised, &golden.picture))
    });

    let frame = options.frame.unwrap_or(0) as usize;
    let against = options
        .against
        .as_ref()
        .map(|photographs| photographs.compare(frame, &golden.picture, &fixed))
        .transpose()?;
    let of_photographs = options
        .against
        .as_ref()
        .map(Photographs::notes)
        .unwrap_or_default();

    let fragments = drawing.outcomes.total();
    let report = Report {
        version: env!("CARGO_PKG_VERSION"),
        scene: SceneReport {
            name: scene.name.clone(),
            frame: options.frame,
            width: scene.image.width,
            height: scene.image.height,
            splats: scene.splats.len() as u64,
            culled: drawing.culled.into(),
            fragments,
            camera: scene.camera,
            scale: evaluation.quantised.scale,
            notes: scene
                .notes
                .iter()
                .chain(&evaluation.quantised.notes)
                .chain(of_photographs)
                .cloned()
                .collect(),
        },
        level_of_detail: scene
            .detail
            .as_ref()
            .map(|detail| DetailReport::new(detail, elaborated.timing.node_bytes)),
        machine: MachineReport {
            outside_of_search: options.outside_of_search.clone(),
            ..MachineReport::new(&elaborated)
        },
        accuracy: Accuracy {
            distances,
            lockstep: lockstep.as_ref().map(|lockstep| lockstep.summary(&fixed)),
        },
        against,
        fragments: drawing.outcomes.into(),
        signals,
        cost: CostReport::new(&elaborated, &cycles, &options.prices),
        cycles: cycles_report,
        timings,
        answers,
        preview: None,
        golden: found(&golden),
        attribution,
        error_scale: error.scale,
        host: Host {
            threads: rayon::current_num_threads(),
            scene_file: options
                .scene_file
                .as_ref()
                .map(|path| path.to_string_lossy().into_owned()),
            load_seconds,
            quantise_seconds,
            fixed_seconds,
            watched_seconds: observed_seconds,
            recorded_seconds: observed_seconds,
            replay_seconds,
            golden_seconds,
            ideal_seconds,
            lockstep_seconds: lockstep.is_some().then_some(lockstep_seconds),
            attribution_seconds: attributed.then_some(attribution_seconds),
            whole_seconds: None,
            fragments_per_second: fragments as f64 / fixed_seconds,
        },
    };
    let requests = options
        .requests
        .then(|| Requests::new(&elaborated.timing, cycles.requests));
    let encoded = scene.image.encoded;
    Ok(RunResult {
        fixed,
        golden: golden.picture,
        ideal: ideal.picture,
        error,
        lockstep,
        requests,
        work,
        report,
        encoded,
    })
}

fn found(golden: &Rendering) -> Golden {
    Golden {
        fragments: golden.fragments,
        culled: golden.culled,
        outcomes: golden.outcomes,
    }
}

/// Runs `work`: its result, and its time in seconds.
pub fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, start.elapsed().as_secs_f64())
}

impl RunResult {
    /// Writes pictures and report into a folder; returns the paths.
    ///
    /// # Errors
    /// [`crate::error::Error::Job`] if a file cannot be written; no file is left half-written.
    pub fn write(&self, folder: &Path, exr: bool) -> Result<Vec<PathBuf>> {
        let flips = self.lockstep.as_ref().map(Lockstep::flip_picture);
        let mut files: Vec<Unwritten> = Vec::new();
        let drawn = [
            ("fixed", &self.fixed),
            ("golden", &self.golden),
            ("ideal", &self.ideal),
        ];
        for (name, picture) in drawn {
            files.push((
                folder.join(format!("{name}.png")),
                Box::new(move |path| picture.write_shown(self.encoded, path)),
            ));
        }
        files.push((
            folder.join("error.png"),
            Box::new(|path| self.error.picture.write_png(path)),
        ));
        if let Some(flips) = &flips {
            files.push((
                folder.join("flips.png"),
                Box::new(|path| flips.write_png(path)),
            ));
        }
        for (name, picture) in drawn.into_iter().take(if exr { 3 } else { 0 }) {
            files.push((
                folder.join(format!("{name}.exr")),
                Box::new(move |path| picture.write_exr(path)),
            ));
        }
        if let Some(lockstep) = &self.lockstep {
            files.push((
                folder.join("bounds.png"),
                Box::new(|path| chart::write_png(&[&lockstep.bound_chart()], 1, [900, 640], path)),
            ));
        }
        if let Some(attribution) = &self.report.attribution {
            let charts = |path: &Path| {
                let [units, words] = attribution.charts();
                chart::write_png(&[&units, &words], 2, [760, 560], path)
            };
            files.push((folder.join("attribution.png"), Box::new(charts)));
        }
        let ranges = |path: &Path| {
            let Report {
                scene,
                machine,
                signals,
                ..
            } = &self.report;
            let chart = ranges::chart(&scene.name, &machine.description.name, signals);
            chart::write_png(&[&chart], 1, chart.size_px(), path)
        };
        files.push((folder.join("ranges.png"), Box::new(ranges)));
        let Report {
            cycles,
            timings,
            answers,
            ..
        } = &self.report;
        files.extend(files_of_cycles(
            cycles,
            timings.as_ref(),
            answers.as_ref(),
            self.requests.as_ref(),
            folder,
        ));
        let report = |path: &Path| {
            write_beside(path, |file| {
                serde_json::to_writer_pretty(file, &self.report).map_err(|e| e.to_string())
            })
        };
        files.push((folder.join("report.json"), Box::new(report)));
        // Optional files of an earlier run would not belong to these pictures.
        write_as_one(folder, files, &OPTIONAL)
    }
}

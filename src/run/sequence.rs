//! Sequence: draws a scene frame by frame, on the machine, with `golden` and with `ideal`, and
//! compares frames with those before them.
//!
//! ```text
//! camera 0 ─► fixed, golden, ideal ─┬─► pictures, video, a row of the report
//! camera 1 ─► fixed, golden, ideal ─┼─► …, and flicker against frame 0
//!    …                              └─► worst, median, 99th percentile ─► report.json, summary
//! ```
//! Two frames are in memory at a time.

mod report;

pub use report::{FrameReport, Host, Report, SceneReport, Spread, Spreads};

use crate::accuracy::flicker::{FlickerSums, Pictures};
use crate::error::{Error, Result};
use crate::golden;
use crate::golden::ListMemory;
use crate::hardware::fixed;
use crate::hardware::quantise::{ListsBefore, quantise_after};
use crate::output::files::{Unwritten, remove_if_there, write_all, write_beside};
use crate::output::picture::Picture;
use crate::output::progress::Progress;
use crate::output::video::Video;
use crate::performance::cycles::CyclesReport;
use crate::run::against::{Means, Photographs};
use crate::run::evaluation::{Evaluation, Observed};
use crate::run::report::{Distances, MachineReport};
use crate::run::timed;
use crate::scene::{Scene, Sequence, memory};
use rtl_model::Machine;
use rtl_model::pipeline::Elaborated;
use rtl_model::timing::{self, Detail};
use std::path::{Path, PathBuf};

/// Files to be written in addition to the report.
#[derive(Clone, Debug, Default)]
pub struct Output {
    /// Folder of the pictures.
    pub folder: Option<PathBuf>,
    /// Write OpenEXR pictures too.
    pub exr: bool,
    /// File for the machine's pictures as a video.
    pub video: Option<PathBuf>,
}

/// Checks that the machine can hold every frame, before any is drawn.
///
/// # Errors
/// [`crate::error::Error::Input`] if it cannot, or if a frame's scene cannot be read again.
pub fn check(sequence: &mut Sequence, machine: &Machine) -> Result<()> {
    memory::check_frame(sequence.scene())?;
    for frame in 0..sequence.cameras().len() {
        let scene = sequence.frame(frame)?;
        // The cut within a budget of bytes or cycles is computed when the frame is drawn.
        let is_open = scene.detail.as_ref().is_some_and(|detail| {
            detail
                .rules
                .budget
                .bytes
                .or(detail.rules.budget.cycles)
                .is_some()
        });
        if !is_open {
            quantise_after(scene, machine, None).map_err(|error| match error {
                Error::Input(sentence) => Error::input(format!("frame {frame}: {sentence}")),
                job @ Error::Job(_) => job,
            })?;
        }
    }
    Ok(())
}

/// Draws every frame on `machine` and compares, also with `photographs` if there are any.
/// `progress` is updated after each frame.
///
/// # Errors
/// [`crate::error::Error::Input`] if the machine cannot be built or cannot hold a frame;
/// [`crate::error::Error::Job`] if a file cannot be written.
pub fn run(
    sequence: &mut Sequence,
    machine: &Machine,
    photographs: Option<&Photographs>,
    load_seconds: f64,
    output: &Output,
    progress: &Progress,
) -> Result<Report> {
    let elaborated = fixed::elaborate(machine)?;
    let first = sequence.frame(0)?;
    let mut scene = SceneReport {
        name: first.name.clone(),
        width: first.image.width,
        height: first.image.height,
        splats: first.splats.len() as u64,
        frames: sequence.cameras().len() as u64,
        notes: sequence.scene().notes.clone(),
    };
    scene
        .notes
        .extend_from_slice(photographs.map(Photographs::notes).unwrap_or_default());
    output
        .folder
        .as_deref()
        .map_or(Ok(()), |folder| begin(folder, sequence.cameras().len()))?;
    let mut video = output
        .video
        .as_deref()
        .map(|path| Video::create(path, scene.width, scene.height))
        .transpose()?;
    let (mut frames, mut before) = (Vec::new(), None);
    let mut lists = (None, ListMemory::default());
    let mut all = FlickerSums::default();
    let mut host = Host {
        threads: rayon::current_num_threads(),
        load_seconds,
        ..Host::default()
    };
    for number in 0..sequence.cameras().len() {
        let seen = sequence.frame(number)?;
        let drawn = DrawnFrame::new(seen, &elaborated, &mut lists, &mut host)?;
        let encoded = seen.image.encoded;
        let Pictures { golden, fixed, .. } = &drawn.pictures;
        let against = photographs
            .map(|photographs| photographs.compare(number, golden, fixed))
            .transpose()?;
        if let Some(folder) = &output.folder {
            write_frame(&drawn.pictures, number, encoded, output.exr, folder).map_err(|error| {
                Error::job(format!(
                    "{error}; the run is not finished, and {} has no report.json",
                    folder.display()
                ))
            })?;
        }
        if let Some(video) = &mut video {
            video.push(&drawn.pictures.fixed, encoded)?;
        }
        let sums = before
            .as_ref()
            .map(|before: &Pictures| FlickerSums::new(before.all(), drawn.pictures.all()));
        all = sums.as_ref().map_or(all, |sums| all.and(sums));
        let fresh = drawn
            .notes
            .into_iter()
            .filter(|note| !scene.notes.contains(note))
            .collect::<Vec<_>>();
        scene.notes.extend(fresh);
        frames.push(FrameReport {
            frame: number as u64,
            flicker: sums.map(|sums| sums.flicker()),
            against,
            ..drawn.report
        });
        before = Some(drawn.pictures);
        progress.step();
    }
    video.map_or(Ok(()), Video::finish)?;
    let flicker = (frames.len() > 1).then(|| all.flicker());
    Ok(Report {
        version: env!("CARGO_PKG_VERSION"),
        scene,
        machine: MachineReport::new(&elaborated),
        spreads: Spreads::new(&frames),
        flicker,
        against: Means::new(frames.iter().filter_map(|frame| frame.against.as_ref())),
        frames,
        host,
    })
}

/// A frame after drawing and comparison.
struct DrawnFrame {
    pictures: Pictures,
    report: FrameReport,
    notes: Vec<String>,
}

impl DrawnFrame {
    /// Draws the next frame; `lists` is what the machine and golden have in memory before it, and
    /// then after it.
    fn new(
        scene: &Scene,
        machine: &Elaborated,
        (lists, memory): &mut (ListsBefore, ListMemory),
        host: &mut Host,
    ) -> Result<Self> {
        let evaluation = Evaluation::after(scene, machine, lists.take())?;
        *lists = evaluation.lists_after();
        let (observed, fixed_seconds) = timed(|| evaluation.observe());
        let overflows = observed.overflows();
        let Observed {
            drawing,
            picture: fixed,
            work,
            ..
        } = observed;
        let replay = || {
            CyclesReport::new(
                &machine.timing,
                &work,
                &timing::replay(&machine.timing, &work, Detail::Histograms),
            )
        };
        let (golden, golden_seconds) = timed(|| evaluation.golden_next(memory).picture);
        let exact = || {
            let (ideal, seconds) = timed(|| golden::ideal(scene).picture);
            let accuracy = Distances::between(&fixed, &golden, &ideal);
            (ideal, seconds, accuracy)
        };
        // A replay uses one thread; the other threads draw `ideal`.
        let (cycles, (ideal, ideal_seconds, accuracy)) = rayon::join(replay, exact);
        host.fixed_seconds += fixed_seconds;
        host.golden_seconds += golden_seconds;
        host.ideal_seconds += ideal_seconds;
        let report = FrameReport {
            frame: 0,
            camera: scene.camera,
            scale_exponent: evaluation.quantised.scale.exponent,
            culled: drawing.culled.into(),
            fragments: drawing.outcomes.total(),
            saturated: overflows.saturated,
            wrapped: overflows.wrapped,
            cycles: cycles.total,
            frames_per_second: cycles.frames_per_second,
            bottleneck: cycles.bottleneck,
            memory_bytes: cycles.memory.bytes,
            accuracy,
            against: None,
            flicker: None,
        };
        let notes = evaluation.quantised.notes.clone();
        Ok(DrawnFrame {
            pictures: Pictures {
                fixed,
                golden,
                ideal,
            },
            report,
            notes,
        })
    }
}

/// File name of a picture of a frame, such as `frame_0012_fixed.png`.
pub fn file_name(frame: usize, picture: &str, ending: &str) -> String {
    format!("frame_{frame:04}_{picture}.{ending}")
}

/// Removes the report and files of an earlier run: frames appear one by one, and from the first one
/// on the old report does not describe them.
fn begin(folder: &Path, frames: usize) -> Result<()> {
    remove_if_there(&folder.join("report.json"))?;
    super::ALWAYS
        .iter()
        .chain(&super::OPTIONAL)
        .try_for_each(|name| remove_if_there(&folder.join(name)))?;
    let is_stale = |name: &str| {
        frame_of(name).is_some_and(|(frame, ending)| frame >= frames || ending == "exr")
    };
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_name().to_str().is_some_and(is_stale) {
            remove_if_there(&entry.path())?;
        }
    }
    Ok(())
}

/// Frame and extension of a name that [`file_name`] returns; none for any other name.
fn frame_of(name: &str) -> Option<(usize, &str)> {
    let (stem, ending) = name
        .split_once('.')
        .filter(|(_, ending)| ["png", "exr"].contains(ending))?;
    let (number, picture) = stem.strip_prefix("frame_")?.split_once('_')?;
    let frame = number.parse().ok()?;
    (["fixed", "golden", "ideal"].contains(&picture) && file_name(frame, picture, ending) == name)
        .then_some((frame, ending))
}

fn write_frame(
    pictures: &Pictures,
    frame: usize,
    encoded: bool,
    exr: bool,
    folder: &Path,
) -> Result<()> {
    let each: [(&str, &Picture); 3] = [
        ("fixed", &pictures.fixed),
        ("golden", &pictures.golden),
        ("ideal", &pictures.ideal),
    ];
    let mut files: Vec<Unwritten> = Vec::new();
    for (name, picture) in each {
        files.push((
            folder.join(file_name(frame, name, "png")),
            Box::new(move |path| picture.write_shown(encoded, path)),
        ));
        if exr {
            files.push((
                folder.join(file_name(frame, name, "exr")),
                Box::new(move |path| picture.write_exr(path)),
            ));
        }
    }
    write_all(files).map(drop)
}

impl Report {
    /// Writes `report.json` into a folder.
    ///
    /// # Errors
    /// [`crate::error::Error::Job`] if it cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        write_beside(&folder.join("report.json"), |file| {
            serde_json::to_writer_pretty(file, self).map_err(|e| e.to_string())
        })
    }
}

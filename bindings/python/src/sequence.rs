//! Sequence: draws every frame of a scene, and compares.

use crate::models::Machine;
use crate::work::{done, json};
use pyo3::prelude::*;
use splatsim::error::Error;
use splatsim::hardware::fixed;
use splatsim::output::files::Folder;
use splatsim::output::progress::Progress;
use splatsim::run::sequence::{self as running, Output};
use splatsim::run::timed;
use splatsim::scene::{CameraFile, Overrides, Sequence};
use std::ffi::OsString;
use std::path::PathBuf;

/// Draws all frames; returns the report and the output of the command line.
#[pyfunction]
#[pyo3(signature = (name, size, cameras, machine, folder, exr, video, progress))]
#[expect(
    clippy::too_many_arguments,
    reason = "as many as a sequence has options"
)]
pub(crate) fn sequence(
    py: Python<'_>,
    name: OsString,
    size: Option<(usize, usize)>,
    cameras: Option<PathBuf>,
    machine: Option<&Machine>,
    folder: Option<PathBuf>,
    exr: bool,
    video: Option<PathBuf>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(String, String)> {
    let machine = machine.cloned();
    let report = done(py, progress, move || {
        let cameras = cameras.as_deref().map(CameraFile::read).transpose()?;
        let (sequence, load_seconds) =
            timed(|| Sequence::load(&name, &Overrides { size }, cameras));
        let mut sequence = sequence?;
        if !sequence.is_sequence() {
            return Err(Error::input(format!(
                "{} has one camera: a scene with `cameras` or `camera_path` is needed",
                sequence.scene().name
            )));
        }
        let (drawing, mut outside) = Machine::of(machine.as_ref(), sequence.scene())?;
        fixed::elaborate(&drawing)?;
        running::check(&mut sequence, &drawing)?;
        // Each camera may be outside.
        for frame in (0..sequence.cameras().len())
            .filter(|_| outside.is_some())
            .collect::<Vec<_>>()
        {
            let (_, of_frame) = Machine::of(machine.as_ref(), sequence.frame(frame)?)?;
            let all = outside.get_or_insert_default();
            let fresh: Vec<String> = of_frame
                .into_iter()
                .flatten()
                .filter(|what| !all.contains(what))
                .collect();
            all.extend(fresh);
        }
        let _open = folder.as_deref().map(Folder::open).transpose()?;
        let progress = Progress::of_steps(false, sequence.cameras().len() as u64, "frames");
        let output = Output { folder, exr, video };
        let mut report = running::run(
            &mut sequence,
            &drawing,
            None,
            load_seconds,
            &output,
            &progress,
        )?;
        report.machine.outside_of_search = outside;
        output
            .folder
            .as_deref()
            .map_or(Ok(()), |folder| report.write(folder))?;
        Ok(report)
    })?;
    Ok((json(&report)?, report.summary()))
}

//! Draw: a frame and its report; its recorded work; a pixel trace; a trace of the wires.

use crate::models::{Machine, Scene};
use crate::work::{done, json, raised, refused};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use splatsim::cosim::trace::{Origin, Window, trace as write_trace};
use splatsim::hardware::fixed;
use splatsim::output::files::Folder;
use splatsim::performance::cost::Prices;
use splatsim::performance::recording;
use splatsim::performance::timings::{Axes, Variants};
use splatsim::run::explain::{explain as explanation, explained};
use splatsim::run::{Check, Options, RunResult, run as drawn};
use std::path::PathBuf;
use std::sync::Arc;

/// A drawn frame.
#[pyclass(frozen, name = "Outcome", module = "splatsim._native")]
pub(crate) struct DrawnFrame {
    outcome: Arc<RunResult>,
    machine: rtl_model::Machine,
}

/// Parses `timing.raster.fifo=1,2,4`.
fn axes(texts: &[String]) -> PyResult<Vec<Axes>> {
    texts
        .iter()
        .map(|text| {
            text.parse()
                .map_err(|sentence| refused(format!("--timing {text}: {sentence}")))
        })
        .collect()
}

/// Draws a scene on a machine and in exact arithmetic.
#[pyfunction]
#[pyo3(signature = (scene, machine, check, attribute, answers, requests, timing, prices, progress))]
#[expect(clippy::too_many_arguments, reason = "as many as a run has options")]
pub(crate) fn run(
    py: Python<'_>,
    scene: &Scene,
    machine: Option<&Machine>,
    check: &str,
    attribute: bool,
    answers: bool,
    requests: bool,
    timing: Vec<String>,
    prices: Option<PathBuf>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<DrawnFrame> {
    let (machine, outside_of_search) = Machine::of(machine, &scene.scene).map_err(raised)?;
    let axes = axes(&timing)?;
    let check = match check {
        "full" => Check::Full,
        "sampled" => Check::Sampled,
        "none" => Check::None,
        other => {
            return Err(refused(format!(
                "check is {other}: it can be full, sampled or none"
            )));
        }
    };
    let Scene {
        scene, frame, file, ..
    } = scene.clone();
    done(py, progress, move || {
        fixed::elaborate(&machine)?;
        let timings = Variants::new(&machine, &axes)?;
        if let Some(timings) = &timings {
            timings.check_scene(&scene)?;
        }
        let prices = Prices::load_or_default(prices.as_deref())?;
        let options = Options {
            attribution: attribute,
            timings,
            answers,
            requests,
            record: true,
            prices,
            outside_of_search,
            frame,
            scene_file: file,
            check,
            against: None,
        };
        let outcome = drawn(&scene, &machine, 0.0, &options)?;
        Ok(DrawnFrame {
            outcome: Arc::new(outcome),
            machine,
        })
    })
}

#[pymethods]
impl DrawnFrame {
    /// The report, as in `report.json`.
    fn report(&self) -> PyResult<String> {
        json(&self.outcome.report)
    }

    /// Output of the command line.
    fn summary(&self) -> String {
        self.outcome.report.summary()
    }

    /// Columns and rows of the pictures.
    #[getter]
    fn size(&self) -> (usize, usize) {
        (self.outcome.fixed.width, self.outcome.fixed.height)
    }

    /// A picture as f64, four per pixel, row by row from the top.
    fn picture<'py>(&self, py: Python<'py>, which: &str) -> PyResult<Bound<'py, PyBytes>> {
        let RunResult {
            fixed,
            golden,
            ideal,
            error,
            ..
        } = &*self.outcome;
        let picture = match which {
            "fixed" => fixed,
            "golden" => golden,
            "ideal" => ideal,
            "error" => &error.picture,
            _ => {
                return Err(refused(format!(
                    "{which}: no such picture; there are fixed, golden, ideal, error"
                )));
            }
        };
        let numbers = picture.rgba.as_flattened();
        PyBytes::new_with(py, size_of_val(numbers), |bytes| {
            for (place, number) in bytes.chunks_exact_mut(size_of::<f64>()).zip(numbers) {
                place.copy_from_slice(&number.to_ne_bytes());
            }
            Ok(())
        })
    }

    /// Writes the files of `run --out`; returns their paths.
    fn write(&self, py: Python<'_>, folder: PathBuf, exr: bool) -> PyResult<Vec<PathBuf>> {
        let outcome = Arc::clone(&self.outcome);
        done(py, None, move || {
            let _open = Folder::open(&folder)?;
            outcome.write(&folder, exr)
        })
    }

    /// The recorded work.
    fn recording(&self) -> Option<Recording> {
        let work = self.outcome.work.clone()?;
        Some(Recording(recording::Recording {
            scene: self.outcome.report.scene.name.clone(),
            machine: self.machine.clone(),
            work,
        }))
    }
}

/// A frame's recorded work.
#[pyclass(frozen, module = "splatsim._native")]
#[derive(Clone)]
pub(crate) struct Recording(recording::Recording);

#[pymethods]
impl Recording {
    /// Reads a file of `write` or `run --record`.
    #[staticmethod]
    fn read(path: PathBuf) -> PyResult<Self> {
        recording::Recording::read(&path)
            .map(Recording)
            .map_err(raised)
    }

    /// Writes it into a file.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        recording::Recording::may_be_written(&path).map_err(raised)?;
        let own = self.0.clone();
        done(py, None, move || own.write(&path))
    }

    /// The recording with a change such as `timing.raster.fifo=4`.
    fn changed(&self, setting: &str) -> PyResult<Self> {
        let mut own = self.0.clone();
        own.set(setting).map_err(raised)?;
        Ok(Recording(own))
    }

    /// The frame's time, its time with other timings, and what-if results: three texts, `null`
    /// where not requested.
    fn replay(
        &self,
        py: Python<'_>,
        timing: Vec<String>,
        answers: bool,
        prices: Option<PathBuf>,
    ) -> PyResult<(String, String, String)> {
        let axes = axes(&timing)?;
        let own = self.0.clone();
        let replayed = done(py, None, move || {
            fixed::elaborate(&own.machine)?;
            own.check(&axes)?;
            let prices = answers
                .then(|| Prices::load_or_default(prices.as_deref()))
                .transpose()?;
            own.replay(&axes, false, prices.as_ref())
        })?;
        Ok((
            json(&replayed.cycles)?,
            json(&replayed.timings)?,
            json(&replayed.answers)?,
        ))
    }
}

/// A pixel trace, as text and as JSON.
#[pyfunction]
pub(crate) fn explain(
    py: Python<'_>,
    scene: &Scene,
    machine: Option<&Machine>,
    x: usize,
    y: usize,
) -> PyResult<(String, String)> {
    let (machine, _) = Machine::of(machine, &scene.scene).map_err(raised)?;
    let scene = Arc::clone(&scene.scene);
    let (text, numbers) = done(py, None, move || {
        Ok((
            explanation(&scene, &machine, [x, y])?,
            explained(&scene, &machine, [x, y])?,
        ))
    })?;
    Ok((text, json(&numbers)?))
}

/// Writes a trace; returns the output of the command line.
#[pyfunction]
#[pyo3(signature = (scene, machine, folder, units, splats, pixels, sample, stimulus, waves, seed))]
#[expect(clippy::too_many_arguments, reason = "as many as a trace has options")]
pub(crate) fn trace(
    py: Python<'_>,
    scene: &Scene,
    machine: Option<&Machine>,
    folder: PathBuf,
    units: Vec<String>,
    splats: Option<[u32; 2]>,
    pixels: Option<[u32; 4]>,
    sample: Option<u32>,
    stimulus: Option<u32>,
    waves: Option<[u64; 2]>,
    seed: u64,
) -> PyResult<String> {
    if sample == Some(0) {
        return Err(refused("sample is 0: it must be at least 1"));
    }
    let (machine, _) = Machine::of(machine, &scene.scene).map_err(raised)?;
    let Scene {
        scene,
        text,
        file,
        frame,
    } = scene.clone();
    let file = file
        .and_then(|file| std::path::absolute(file).ok())
        .and_then(|file| file.to_str().map(str::to_owned));
    let window = Window {
        units,
        splats,
        pixels,
        sample,
        stimulus,
        waves,
        seed,
    };
    done(py, None, move || {
        let frame = frame
            .and_then(|frame| usize::try_from(frame).ok())
            .unwrap_or(0);
        let origin = Origin {
            text: text.as_deref(),
            source: file.as_deref(),
            frame,
        };
        write_trace(&scene, origin, &machine, &window, &folder).map(|written| written.table())
    })
}

//! Points: runs a sweep in pieces: a folder that receives rows, and a stage that draws some, in
//! this process or another.

use crate::explore::Exploration;
use crate::work::{done, json, refused};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rayon::ThreadPoolBuilder;
use splatsim::error::{Error, Result};
use splatsim::explore::sweep::plan::Points;
use splatsim::explore::sweep::{self, SweepOptions, stage, table};
use splatsim::output::files::Folder;
use splatsim::performance::cost::Prices;
use splatsim::scene::parcel;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// The plan from a text or a name.
pub(crate) fn plan(name: &str, text: Option<&str>) -> Result<Points> {
    text.map_or_else(
        || Points::load(name),
        |text| Points::from_text(text, name, Path::new("")),
    )
}

/// Runs `work` on this number of threads.
pub(crate) fn on_threads<T: Send>(
    threads: usize,
    work: impl FnOnce() -> Result<T> + Send,
) -> Result<T> {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|e| Error::job(format!("no {threads} threads can be started: {e}")))?
        .install(work)
}

/// A sweep whose rows are drawn elsewhere.
#[pyclass(frozen, module = "splatsim._native")]
pub(crate) struct Sweep(Arc<Mutex<Option<sweep::Sweep>>>);

#[pymethods]
impl Sweep {
    /// Opens a folder and locks it against other writers until it is closed.
    #[staticmethod]
    fn open(
        py: Python<'_>,
        name: String,
        text: Option<String>,
        folder: PathBuf,
        most: u64,
        prices: Option<PathBuf>,
    ) -> PyResult<Self> {
        done(py, None, move || {
            let points = plan(&name, text.as_deref())?;
            let options = SweepOptions {
                shard: None,
                most,
                prices: Prices::load_or_default(prices.as_deref())?,
                progress: false,
            };
            let own = sweep::Sweep::open(points, &folder, &options, Folder::open)?;
            Ok(Sweep(Arc::new(Mutex::new(Some(own)))))
        })
    }

    /// Number of scenes of the plan, and of all points.
    fn counts(&self, py: Python<'_>) -> PyResult<(usize, u64)> {
        self.with(py, |own| {
            Ok((own.points().plan.scenes.len(), own.points().count()))
        })
    }

    /// Points on a scene that are missing in the folder, grouped by frames that they may share.
    fn missing(&self, py: Python<'_>, scene: usize) -> PyResult<Vec<Vec<u64>>> {
        self.with(py, move |own| {
            Ok(own.points().together(&own.missing(scene)))
        })
    }

    /// Plan and unit costs, for a stage.
    fn plan(&self, py: Python<'_>) -> PyResult<String> {
        let (points, prices) = self.with(py, |own| Ok((own.points().clone(), own.prices())))?;
        json(&(points, prices))
    }

    /// A scene of the plan, for a stage.
    fn scene<'py>(&self, py: Python<'py>, scene: usize) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = self.with(py, move |own| parcel::packed(&own.scene(scene)?))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Stores rows that a stage has drawn; they are in the folder when this returns.
    fn keep(&self, py: Python<'_>, numbers: Vec<u64>, batch: &[u8]) -> PyResult<()> {
        let batch = batch.to_vec();
        self.with(py, move |own| own.push_batch(&numbers, &batch))
    }

    /// Writes the table of all rows, and closes the folder.
    fn finish(&self, py: Python<'_>) -> PyResult<Exploration> {
        let own = self.own().take().ok_or_else(closed)?;
        let outcome = done(py, None, move || own.finish())?;
        Ok(Exploration {
            summary: outcome.summary(),
            files: outcome.files,
            json: String::new(),
        })
    }

    /// Closes the folder; its contents stay.
    fn close(&self) {
        self.own().take();
    }
}

impl Sweep {
    fn own(&self) -> std::sync::MutexGuard<'_, Option<sweep::Sweep>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Runs `work` on the sweep, without the interpreter's lock.
    fn with<T: Send + 'static>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut sweep::Sweep) -> Result<T> + Send + 'static,
    ) -> PyResult<T> {
        let own = Arc::clone(&self.0);
        let work = move || {
            own.lock()
                .unwrap_or_else(PoisonError::into_inner)
                .as_mut()
                .map(work)
        };
        done(py, None, move || work().transpose())?.ok_or_else(closed)
    }
}

fn closed() -> PyErr {
    refused("the sweep is closed")
}

/// Draws points of a plan on one scene.
#[pyclass(frozen, module = "splatsim._native")]
pub(crate) struct Stage(Arc<stage::Stage>);

#[pymethods]
impl Stage {
    /// A stage for a plan and one of its scenes, as a sweep returns them.
    #[new]
    fn new(
        py: Python<'_>,
        plan: String,
        number: usize,
        scene: &[u8],
        threads: usize,
    ) -> PyResult<Self> {
        let scene = scene.to_vec();
        done(py, None, move || {
            let (points, prices): (Points, Prices) =
                serde_json::from_str(&plan).map_err(|error| {
                    Error::input(format!("the plan is not of this version: {error}"))
                })?;
            let scene = parcel::unpacked(&scene)?;
            on_threads(threads, || {
                Ok(Stage(Arc::new(stage::Stage::new(
                    &points, &prices, number, scene,
                ))))
            })
        })
    }

    /// The rows of points, as a Parquet file.
    fn draw<'py>(
        &self,
        py: Python<'py>,
        numbers: Vec<u64>,
        threads: usize,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let stage = Arc::clone(&self.0);
        let bytes = done(py, None, move || {
            on_threads(threads, || rows(&stage, &numbers))
        })?;
        Ok(PyBytes::new(py, &bytes))
    }
}

/// Rows by their points, as Parquet.
fn rows(stage: &stage::Stage, numbers: &[u64]) -> Result<Vec<u8>> {
    let mut rows = BTreeMap::new();
    stage.draw(numbers, |number, row| {
        rows.insert(number, row);
        Ok(())
    })?;
    table::packed(&stage.columns(), &rows)
}

/// Draws points of a plan without a folder: a Parquet file of rows for each scene with points.
#[pyfunction]
#[pyo3(signature = (name, text, numbers, prices))]
pub(crate) fn draw(
    py: Python<'_>,
    name: String,
    text: Option<String>,
    numbers: Vec<u64>,
    prices: Option<PathBuf>,
) -> PyResult<Vec<Vec<u8>>> {
    done(py, None, move || {
        let points = plan(&name, text.as_deref())?;
        let prices = Prices::load_or_default(prices.as_deref())?;
        if numbers.is_empty() {
            return Err(Error::input(format!("{name}: no points are given")));
        }
        if let Some(number) = numbers.iter().find(|number| **number >= points.count()) {
            return Err(Error::input(format!(
                "{name}: no point {number}: the plan has {}",
                points.count()
            )));
        }
        let on_scene = |nth: usize| {
            numbers
                .iter()
                .copied()
                .filter(|number| points.point(*number).0 == nth)
                .collect::<Vec<u64>>()
        };
        let all = (0..points.plan.scenes.len())
            .map(|nth| (nth, on_scene(nth)))
            .filter(|(_, numbers)| !numbers.is_empty());
        all.map(|(nth, numbers)| {
            rows(
                &stage::Stage::new(&points, &prices, nth, points.scene(nth)?),
                &numbers,
            )
        })
        .collect()
    })
}

//! Crew: passes machines of a search to a Python object for measurement, and measures them on a
//! worker.

use crate::points::on_threads;
use crate::work::{SplatsimError, done, sentence};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use splatsim::error::{Error, Result};
use splatsim::explore::search::crew::{self, PackedView};
use std::sync::Arc;

/// A crew that is a Python object with `width()`, `learn(view)` and `measure(machines, target)`.
pub(crate) struct PythonCrew(pub Py<PyAny>);

impl PythonCrew {
    fn call<T>(&self, call: impl FnOnce(&Bound<'_, PyAny>) -> PyResult<T>) -> Result<T> {
        Python::attach(|py| call(self.0.bind(py)).map_err(|raised| fault(py, &raised)))
    }
}

/// Converts an exception of a callback to an error of the job. The package's own exceptions give
/// only their sentence.
fn fault(py: Python<'_>, raised: &PyErr) -> Error {
    if raised.is_instance_of::<SplatsimError>(py) {
        sentence(py, raised)
    } else {
        Error::job(raised.to_string())
    }
}

impl crew::Crew for PythonCrew {
    fn width(&self) -> usize {
        self.call(|crew| crew.call_method0("width")?.extract())
            .unwrap_or(1)
    }

    fn learn(&mut self, view: Vec<u8>) -> Result<()> {
        self.call(|crew| {
            crew.call_method1("learn", (PyBytes::new(crew.py(), &view),))
                .map(drop)
        })
    }

    fn measure(&mut self, machines: &[String], target: &str) -> Result<Vec<String>> {
        self.call(|crew| crew.call_method1("measure", (machines, target))?.extract())
    }
}

/// A view on a worker.
#[pyclass(frozen, module = "splatsim._native")]
#[derive(Clone)]
pub(crate) struct View(Arc<PackedView>);

#[pymethods]
impl View {
    /// A view from the bytes that a crew was given.
    #[new]
    fn new(py: Python<'_>, view: &[u8]) -> PyResult<Self> {
        let view = view.to_vec();
        done(py, None, move || {
            Ok(View(Arc::new(PackedView::unpacked(&view)?)))
        })
    }
}

/// Measures a machine on views, for a crew.
#[pyfunction]
pub(crate) fn measure(
    py: Python<'_>,
    views: Vec<Py<View>>,
    machine: String,
    target: String,
    threads: usize,
) -> PyResult<String> {
    let views: Vec<Arc<PackedView>> = views.iter().map(|view| Arc::clone(&view.get().0)).collect();
    done(py, None, move || {
        on_threads(threads, || {
            crew::measured(views.iter().map(Arc::as_ref), &machine, &target)
        })
    })
}

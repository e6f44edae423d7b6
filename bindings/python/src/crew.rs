//! Crew: has machines of a search measured by whom Python asks, and measures them as a member.

use crate::points::on_threads;
use crate::work::{SplatsimError, done, sentence};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use splatsim::error::{Error, Result};
use splatsim::explore::search::crew::{self, PackedView};
use std::sync::Arc;

/// A crew that is an object of Python's: `width()`, `learn(view)` and `measure(machines, target)`.
pub(crate) struct Asked(pub Py<PyAny>);

impl Asked {
    fn call<T>(&self, call: impl FnOnce(&Bound<'_, PyAny>) -> PyResult<T>) -> Result<T> {
        Python::attach(|py| call(self.0.bind(py)).map_err(|raised| fault(py, &raised)))
    }
}

/// An exception of a callback as a fault of the job; of its own exceptions the sentence alone.
fn fault(py: Python<'_>, raised: &PyErr) -> Error {
    if raised.is_instance_of::<SplatsimError>(py) {
        sentence(py, raised)
    } else {
        Error::job(raised.to_string())
    }
}

impl crew::Crew for Asked {
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

/// A view in a member's hands.
#[pyclass(frozen, module = "splatsim._native")]
#[derive(Clone)]
pub(crate) struct View(Arc<PackedView>);

#[pymethods]
impl View {
    /// The view that a crew was told of.
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

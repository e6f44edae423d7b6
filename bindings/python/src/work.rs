//! Work: a worker thread, a calling thread that handles Ctrl-C, and errors as exceptions.

use pyo3::create_exception;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use splatsim::error::Error;
use splatsim::output::progress::{Watch, watched_by};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::Builder;
use std::time::{Duration, Instant};

create_exception!(
    splatsim,
    SplatsimError,
    PyValueError,
    "An error, in a sentence."
);
create_exception!(
    splatsim,
    InputError,
    SplatsimError,
    "An argument or a file is wrong: the command line's exit status 2."
);
create_exception!(
    splatsim,
    JobError,
    SplatsimError,
    "The work failed, for example on a full disk: the command line's exit status 1."
);

/// Interval between two checks for Ctrl-C.
const CHECK_EVERY: Duration = Duration::from_millis(50);
/// Interval between two calls of a progress callback.
const PROGRESS_EVERY: Duration = Duration::from_millis(200);
/// Stack of a main thread.
const STACK_BYTES: usize = 8 << 20;
/// Time that a stopped job has to finish its current point.
const LAST_POINT: Duration = Duration::from_millis(500);

pub(crate) fn raised(error: Error) -> PyErr {
    match error {
        Error::Input(sentence) => InputError::new_err(sentence),
        Error::Job(sentence) => JobError::new_err(sentence),
    }
}

/// The error for an exception of [`raised`].
pub(crate) fn sentence(py: Python<'_>, raised: &PyErr) -> Error {
    let sentence = raised.value(py).to_string();
    if raised.is_instance_of::<InputError>(py) {
        Error::input(sentence)
    } else {
        Error::job(sentence)
    }
}

/// An exception for errors that are possible only from Python.
pub(crate) fn refused(sentence: impl Into<String>) -> PyErr {
    raised(Error::input(sentence))
}

pub(crate) fn json(value: &impl serde::Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(|error| raised(Error::job(error.to_string())))
}

/// Runs `work` on another thread, without the interpreter's lock. If a signal handler or `progress`
/// raises, the exception is raised immediately; the work is stopped and its unfinished result is
/// dropped.
pub(crate) fn done<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce() -> Result<T, Error> + Send + 'static,
) -> PyResult<T> {
    let watch = Arc::new(Watch::default());
    let (sender, result) = channel();
    let watched = Arc::clone(&watch);
    let thread = Builder::new().stack_size(STACK_BYTES).spawn(move || {
        // After an exception the receiver is gone.
        let _ = sender.send(watched_by(&watched, work));
    });
    thread.map_err(|error| raised(Error::job(format!("no thread can be started: {error}"))))?;
    let result = Mutex::new(result);
    let mut reported = Instant::now();
    loop {
        match py.detach(|| received(&result, CHECK_EVERY)) {
            Ok(done) => {
                progress.map_or(Ok(()), |progress| report_progress(progress, &watch))?;
                return done.map_err(raised);
            }
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err(
                    "splatsim has failed: this is a bug",
                ));
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
        let heard = py.check_signals().and_then(|()| match progress {
            Some(progress) if reported.elapsed() >= PROGRESS_EVERY => {
                reported = Instant::now();
                report_progress(progress, &watch)
            }
            _ => Ok(()),
        });
        if let Err(raised) = heard {
            watch.stop();
            // A journal is closed with the current point, if that ends soon; the result is dropped.
            let _ = py.detach(|| received(&result, LAST_POINT));
            return Err(raised);
        }
    }
}

/// Result of a thread, if it arrives within some time. The mutex is required because values used
/// without the interpreter's lock must be `Sync`.
fn received<T>(result: &Mutex<Receiver<T>>, within: Duration) -> Result<T, RecvTimeoutError> {
    result
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .recv_timeout(within)
}

/// Calls a callback with the finished amount, the total if known, and a message.
fn report_progress(progress: &Bound<'_, PyAny>, watch: &Watch) -> PyResult<()> {
    let (done, total, message) = watch.now();
    progress.call1((done, total, message)).map(drop)
}

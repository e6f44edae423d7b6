//! Work: a thread that works, one that waits and hears Ctrl-C, and faults as exceptions.

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
    "What is wrong, in a sentence."
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
    "The work itself failed, as where a disk is full: the command line's exit status 1."
);

/// Between two looks for Ctrl-C.
const LISTEN_EVERY: Duration = Duration::from_millis(50);
/// Between two calls of a progress callback.
const TELL_EVERY: Duration = Duration::from_millis(200);
/// As much as a main thread has.
const STACK_BYTES: usize = 8 << 20;
/// For how long a stopped job may finish the point that it is at.
const LAST_POINT: Duration = Duration::from_millis(500);

pub(crate) fn raised(error: Error) -> PyErr {
    match error {
        Error::Input(sentence) => InputError::new_err(sentence),
        Error::Job(sentence) => JobError::new_err(sentence),
    }
}

/// The fault that an exception of [`raised`] says.
pub(crate) fn sentence(py: Python<'_>, raised: &PyErr) -> Error {
    let sentence = raised.value(py).to_string();
    if raised.is_instance_of::<InputError>(py) {
        Error::input(sentence)
    } else {
        Error::job(sentence)
    }
}

/// An exception for what only a call from Python can get wrong.
pub(crate) fn refused(sentence: impl Into<String>) -> PyErr {
    raised(Error::input(sentence))
}

pub(crate) fn json(value: &impl serde::Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(|error| raised(Error::job(error.to_string())))
}

/// Does `work` on another thread, without the interpreter's lock. Where a signal or `progress`
/// raises, that is raised at once; the work is told to stop, and what it has begun ends unseen.
pub(crate) fn done<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce() -> Result<T, Error> + Send + 'static,
) -> PyResult<T> {
    let watch = Arc::new(Watch::default());
    let (sender, result) = channel();
    let watched = Arc::clone(&watch);
    let thread = Builder::new().stack_size(STACK_BYTES).spawn(move || {
        // Nobody listens any more where the other thread has raised.
        let _ = sender.send(watched_by(&watched, work));
    });
    thread.map_err(|error| raised(Error::job(format!("no thread can be started: {error}"))))?;
    let result = Mutex::new(result);
    let mut told = Instant::now();
    loop {
        match py.detach(|| received(&result, LISTEN_EVERY)) {
            Ok(done) => {
                progress.map_or(Ok(()), |progress| tell(progress, &watch))?;
                return done.map_err(raised);
            }
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err(
                    "splatsim has failed: this is a fault of its own",
                ));
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
        let heard = py.check_signals().and_then(|()| match progress {
            Some(progress) if told.elapsed() >= TELL_EVERY => {
                told = Instant::now();
                tell(progress, &watch)
            }
            _ => Ok(()),
        });
        if let Err(raised) = heard {
            watch.stop();
            // A journal is closed with the point that is being drawn, if that is soon; what comes
            // of it nobody wants.
            let _ = py.detach(|| received(&result, LAST_POINT));
            return Err(raised);
        }
    }
}

/// What a thread sends within some time. The lock is there for the interpreter's, beside which
/// nothing of one thread alone may be used.
fn received<T>(result: &Mutex<Receiver<T>>, within: Duration) -> Result<T, RecvTimeoutError> {
    result
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .recv_timeout(within)
}

/// Calls a callback with what is done, of how much where that is known, and a message.
fn tell(progress: &Bound<'_, PyAny>, watch: &Watch) -> PyResult<()> {
    let (done, total, message) = watch.now();
    progress.call1((done, total, message)).map(drop)
}

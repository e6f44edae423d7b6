//! splatsim for Python: what `bindings/python/splatsim` stands on. Texts are JSON, arrays are
//! buffers; names and types for people are there.
//!
//! Work is done on a thread of its own while the interpreter's lock is free; the thread that waits
//! for it hears Ctrl-C. A fault is an exception with the command line's sentence. No panic crosses:
//! a thread that panics ends in an exception too.

mod crew;
mod draw;
mod explore;
mod models;
mod points;
mod sequence;
mod units;
mod work;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    #[pymodule_export]
    use crate::crew::{View, measure};
    #[pymodule_export]
    use crate::draw::{Outcome, Recording, explain, run, trace};
    #[pymodule_export]
    use crate::explore::{Job, search, sweep};
    #[pymodule_export]
    use crate::models::{Machine, Scene};
    #[pymodule_export]
    use crate::points::{Stage, Sweep, draw};
    #[pymodule_export]
    use crate::sequence::sequence;
    #[pymodule_export]
    use crate::units::Unit;
    #[pymodule_export]
    use crate::work::SplatsimError;
    #[pymodule_export]
    use crate::work::{InputError, JobError};
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("VERSION", env!("CARGO_PKG_VERSION"))
    }
}

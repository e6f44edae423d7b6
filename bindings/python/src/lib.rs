//! splatsim for Python: the native part of `bindings/python/splatsim`. Texts are JSON, arrays are
//! buffers; the public names and types are in the Python part.
//!
//! Work runs on its own thread with the interpreter's lock released; the calling thread handles
//! Ctrl-C meanwhile. An error is an exception with the command line's sentence. A panic does not
//! cross the boundary: a thread that panics ends in an exception too.

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
    use crate::draw::{DrawnFrame, Recording, explain, run, trace};
    #[pymodule_export]
    use crate::explore::{Exploration, search, sweep};
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

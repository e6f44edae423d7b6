//! Trace: records on the wires between units, with the pages of the book that explain them.

pub use comparison::cosim::trace::*;

use crate::error::Result;
use crate::scene::Scene;
use rtl_model::Machine;
use std::path::Path;

/// Text of a chapter of the book.
macro_rules! chapter {
    ($name:literal) => {
        include_str!(concat!("../../docs/book/", $name))
    };
}

const PAGES: Pages = Pages {
    files: chapter!("trace-files.md"),
    numbers: chapter!("numbers.md"),
    units: chapter!("units.md"),
    fragments: chapter!("units-fragments.md"),
    ellipsoids: chapter!("ellipsoids.md"),
    windows: chapter!("windows.md"),
};

/// Draws a scene on a machine and writes the records at the ports
/// ([`comparison::cosim::trace::trace`]), with these pages in the README.
///
/// # Errors
/// [`Error::Input`](crate::error::Error::Input) if the window or the machine is not possible,
/// [`Error::Job`](crate::error::Error::Job) if a file cannot be written.
pub fn trace(
    scene: &Scene,
    origin: Origin,
    machine: &Machine,
    window: &Window,
    folder: &Path,
) -> Result<Written> {
    comparison::cosim::trace::trace(scene, origin, machine, window, &PAGES, folder)
}

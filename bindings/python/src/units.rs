//! Units: one unit of a machine, record by record or array by array.

use crate::models::{Machine, Scene};
use crate::work::{done, raised, refused};
use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use self_cell::self_cell;
use splatsim::cosim::live::{Constants, Record};
use splatsim::cosim::scoreboard::{PortSide, Scoreboard};
use splatsim::error::Error;
use std::sync::{Arc, Mutex, PoisonError};

self_cell!(
    struct Cell {
        owner: Constants,
        #[covariant]
        dependent: Scoreboard,
    }
);

/// A unit by itself, and its output records that have not been read.
#[pyclass(frozen, module = "splatsim._native")]
pub(crate) struct Unit(Arc<Mutex<Cell>>);

fn with<T>(cell: &Mutex<Cell>, work: impl FnOnce(&mut Scoreboard) -> T) -> T {
    cell.lock()
        .unwrap_or_else(PoisonError::into_inner)
        .with_dependent_mut(|_, board| work(board))
}

/// A port of the unit by name.
fn side(board: &Scoreboard, port: &str) -> PyResult<PortSide> {
    const NAMES: [&str; 5] = ["in", "out", "request", "answer", "held"];
    let found = NAMES
        .iter()
        .position(|name| *name == port)
        .map(|at| PortSide::ALL[at]);
    let own: Vec<&str> = NAMES
        .into_iter()
        .zip(PortSide::ALL)
        .filter(|(_, side)| board.port(*side).is_some())
        .map(|(name, _)| name)
        .collect();
    let found = found.filter(|side| board.port(*side).is_some());
    found.ok_or_else(|| {
        refused(format!(
            "{} has no port {port}; it has {}",
            board.name(),
            own.join(", ")
        ))
    })
}

/// Words as consecutive i64.
fn bytes<'py>(py: Python<'py>, records: &[Record]) -> PyResult<Bound<'py, PyBytes>> {
    let words = || records.iter().flatten();
    PyBytes::new_with(py, words().count() * size_of::<i64>(), |bytes| {
        for (place, word) in bytes.chunks_exact_mut(size_of::<i64>()).zip(words()) {
            place.copy_from_slice(&word.to_ne_bytes());
        }
        Ok(())
    })
}

#[pymethods]
impl Unit {
    #[new]
    fn new(
        py: Python<'_>,
        name: String,
        machine: Option<&Machine>,
        scene: &Scene,
        seed: u64,
    ) -> PyResult<Self> {
        let (machine, _) = Machine::of(machine, &scene.scene).map_err(raised)?;
        let scene = Arc::clone(&scene.scene);
        done(py, None, move || {
            let constants = Constants::new(&scene, &machine)?;
            Ok(Unit(Arc::new(Mutex::new(Cell::try_new(
                constants,
                |of| Scoreboard::new(of, &name, seed),
            )?))))
        })
    }

    /// Names of a port's fields.
    fn fields(&self, port: &str) -> PyResult<Vec<String>> {
        with(&self.0, |board| {
            let port = board.port(side(board, port)?);
            Ok(port.map_or_else(Vec::new, |port| {
                port.stream
                    .fields
                    .iter()
                    .map(|field| field.name.clone())
                    .collect()
            }))
        })
    }

    /// A constant of a frame, such as `light`: names of its fields, and its records.
    fn registers(&self, name: &str) -> PyResult<(Vec<String>, Vec<Record>)> {
        let cell = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let found = cell.with_dependent(|constants, _| constants.registers(name));
        let (port, records) = found.ok_or_else(|| {
            refused(format!(
                "{name} is not constant in a frame: frame, light, material and reflection are"
            ))
        })?;
        Ok((
            port.stream
                .fields
                .iter()
                .map(|field| field.name.clone())
                .collect(),
            records,
        ))
    }

    /// Passes a record to the unit; its output is queued.
    fn give(&self, words: Record) -> PyResult<()> {
        with(&self.0, |board| {
            board
                .step(&words)
                .map_err(|fault| refused(format!("{}.in: {fault}", board.name())))
        })
    }

    /// Ends a frame; the final output is queued.
    fn end(&self) -> PyResult<()> {
        with(&self.0, |board| {
            board
                .end()
                .map_err(|fault| refused(format!("{}.in: {fault}", board.name())))
        })
    }

    /// Number of queued records.
    fn waiting(&self, port: &str) -> PyResult<usize> {
        with(&self.0, |board| Ok(board.waiting(side(board, port)?)))
    }

    /// Removes and returns the queued records.
    fn take(&self, port: &str) -> PyResult<Vec<Record>> {
        with(&self.0, |board| {
            let side = side(board, port)?;
            Ok(std::iter::from_fn(|| board.next(side)).collect())
        })
    }

    /// Removes the oldest queued record; returns how a device's record differs from it.
    fn compare(&self, port: &str, words: Record) -> PyResult<Option<String>> {
        with(&self.0, |board| {
            let side = side(board, port)?;
            Ok(board.compare(side, &words).err())
        })
    }

    /// A valid random input record.
    fn random(&self) -> Record {
        with(&self.0, |board| board.made_up())
    }

    /// Passes consecutive records to the unit; returns the number of output records for each, and
    /// the output records.
    fn map<'py>(
        &self,
        py: Python<'py>,
        words: PyBuffer<i64>,
        fields: usize,
    ) -> PyResult<(Bound<'py, PyBytes>, Bound<'py, PyBytes>)> {
        let words: Vec<i64> = words.to_vec(py)?;
        let cell = Arc::clone(&self.0);
        let (counts, out) = done(py, None, move || {
            with(&cell, |board| {
                let (mut counts, mut out) = (Vec::new(), Vec::new());
                for (number, words) in words.chunks_exact(fields.max(1)).enumerate() {
                    let name = board.name();
                    board.step(words).map_err(|fault| {
                        Error::input(format!("{name}.in: record {number}: {fault}"))
                    })?;
                    let given: Vec<Record> =
                        std::iter::from_fn(|| board.next(PortSide::Out)).collect();
                    counts.push(vec![given.len() as i64]);
                    out.extend(given);
                }
                Ok((counts, out))
            })
        })?;
        Ok((bytes(py, &counts)?, bytes(py, &out)?))
    }
}

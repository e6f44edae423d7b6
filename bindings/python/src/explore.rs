//! Explore: sweeps and searches.

use crate::crew::PythonCrew;
use crate::models::{Machine, Scene};
use crate::points::plan;
use crate::work::{done, json, raised, refused};
use pyo3::prelude::*;
use splatsim::explore::search as searching;
use splatsim::explore::search::Target;
use splatsim::explore::search::crew::on_crew;
use splatsim::explore::sweep as sweeping;
use splatsim::hardware::machines::draws_alone;
use splatsim::hardware::searched::Against;
use splatsim::performance::cost::Prices;
use std::path::PathBuf;
use std::sync::Arc;

/// Outcome of a sweep or a search.
#[pyclass(frozen, get_all, name = "Job", module = "splatsim._native")]
pub(crate) struct Exploration {
    /// Files that were written.
    pub files: Vec<PathBuf>,
    /// Output of the command line.
    pub summary: String,
    /// Report of a search; empty for a sweep, whose rows are in its files.
    pub json: String,
}

/// Runs a sweep.
#[pyfunction]
#[pyo3(signature = (name, text, folder, shard, most, prices, progress))]
#[expect(clippy::too_many_arguments, reason = "as many as a sweep has options")]
pub(crate) fn sweep(
    py: Python<'_>,
    name: String,
    text: Option<String>,
    folder: PathBuf,
    shard: Option<String>,
    most: u64,
    prices: Option<PathBuf>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Exploration> {
    let shard = shard
        .map(|text| {
            text.parse()
                .map_err(|sentence| refused(format!("--shard {text}: {sentence}")))
        })
        .transpose()?;
    done(py, progress, move || {
        let points = plan(&name, text.as_deref())?;
        let options = sweeping::SweepOptions {
            shard,
            most,
            prices: Prices::load_or_default(prices.as_deref())?,
            progress: false,
        };
        let outcome = sweeping::run(&points, &folder, &options)?;
        Ok(Exploration {
            summary: outcome.summary(),
            files: outcome.files,
            json: String::new(),
        })
    })
}

/// Finds the narrowest machine that meets a target.
#[pyfunction]
#[pyo3(signature = (scenes, machine, folder, target_psnr, max_error, against_ideal, no_saturation, views, seed, tries, only, prices, crew, progress))]
#[expect(clippy::too_many_arguments, reason = "as many as a search has options")]
pub(crate) fn search(
    py: Python<'_>,
    scenes: Vec<Py<Scene>>,
    machine: Option<&Machine>,
    folder: PathBuf,
    target_psnr: Option<f64>,
    max_error: Option<f64>,
    against_ideal: bool,
    no_saturation: bool,
    views: usize,
    seed: u64,
    tries: u64,
    only: Vec<String>,
    prices: Option<PathBuf>,
    crew: Option<Py<PyAny>>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Exploration> {
    let scenes: Vec<Arc<splatsim::scene::Scene>> = scenes
        .iter()
        .map(|scene| Arc::clone(&scene.get().scene))
        .collect();
    let first = scenes
        .first()
        .ok_or_else(|| refused("a search needs at least one scene"))?;
    let (machine, _) = Machine::of(machine, first).map_err(raised)?;
    let against = if against_ideal {
        Against::Ideal
    } else {
        Against::Golden
    };
    let target = Target {
        psnr_db: target_psnr,
        max_error,
        no_saturation,
        against,
        ..Target::default()
    };
    let outcome = done(py, progress, move || {
        let prices = Prices::load_or_default(prices.as_deref())?;
        let options = searching::SearchOptions {
            target,
            views,
            robust: 1,
            seed,
            tries,
            only,
            prices,
            screen: true,
            budget: None,
            progress: false,
        };
        let scenes: Vec<_> = scenes.iter().map(|scene| (**scene).clone()).collect();
        draws_alone(&machine, "a search draws each of its views alone")?;
        let search = || searching::run(&scenes, &machine, &folder, &options);
        match crew {
            Some(crew) => on_crew(Box::new(PythonCrew(crew)), search),
            None => search(),
        }
    })?;
    Ok(Exploration {
        summary: outcome.summary(),
        json: json(&outcome)?,
        files: outcome.files,
    })
}

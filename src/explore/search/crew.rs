//! Crew: measures machines of a search in several worker processes. Results and files are the same
//! as with one process.
//!
//! ```text
//! views ─► every worker, once ──────────────┐
//! machines that may be requested next ─► workers ─► results, by key ─► request of the search ─► row
//! ```
//! A search requests one machine after another, and each result decides the next request. Workers
//! measure likely next machines in advance. A wrong guess only costs time.

use super::{Drawn, SearchErrors, View, drawn, worst_of};
use crate::accuracy::screen::{Estimate, Screening};
use crate::error::{Error, Result};
use crate::hardware::fixed;
use crate::hardware::searched::Target;
use crate::run::timed;
use rtl_model::Machine;
use rtl_model::pipeline::Elaborated;
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::collections::HashMap;

/// Worker processes that measure machines.
pub trait Crew {
    /// Number of machines that keep all workers busy.
    fn width(&self) -> usize;

    /// Adds a view, as bytes for [`PackedView::unpacked`], for all later measurements.
    ///
    /// # Errors
    /// If no worker can be reached.
    fn learn(&mut self, view: Vec<u8>) -> Result<()>;

    /// Measures machines on all views, each by [`measured`]. Machines and target are JSON.
    ///
    /// # Errors
    /// If workers fail, or the search was cancelled.
    fn measure(&mut self, machines: &[String], target: &str) -> Result<Vec<String>>;
}

thread_local! {
    static CREW: RefCell<Option<Box<dyn Crew>>> = const { RefCell::new(None) };
}

/// Runs `work`, a search, with worker processes.
pub fn on_crew<T>(crew: Box<dyn Crew>, work: impl FnOnce() -> T) -> T {
    CREW.set(Some(crew));
    let done = work();
    CREW.set(None);
    done
}

/// What is measured.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Request {
    pub target: Target,
    /// Set if a sample of the tiles may be enough.
    pub screening: Option<Screening>,
    /// Set if the first view that misses the aim is enough.
    pub in_turn: Option<InTurn>,
}

/// How views are drawn one after another.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct InTurn {
    /// Indices of all views.
    pub order: Vec<usize>,
    /// Factor by which the allowed squared error is less than the target's.
    pub stricter: f64,
}

/// What was measured of a machine.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Measurement {
    /// Errors on all views, or why there are none; `None` if the machine was not drawn on all.
    pub found: Option<std::result::Result<SearchErrors, String>>,
    /// Load on samples of all views, or on the first view that misses the aim; `None` if they do
    /// not decide.
    pub estimate: Option<Estimate>,
    /// Squared error per tile, of each view that was drawn in full.
    pub tiles: Vec<Vec<f64>>,
    pub seconds: f64,
    /// Part of `seconds` for samples.
    pub sampling: f64,
    /// Part of `seconds` in which pictures were compared.
    pub comparing: f64,
}

impl Measurement {
    /// Draws in this process.
    pub fn on(views: &[&View], elaborated: &Elaborated, request: &Request) -> Self {
        let Request {
            target,
            screening,
            in_turn,
        } = request;
        let estimate = || {
            let screening = screening.as_ref()?;
            let views: Option<Vec<_>> = views.iter().map(|view| view.sampled(target)).collect();
            // A machine that cannot hold a view fails with a sentence when it is drawn in full.
            let estimate = screening.estimate(&views?, elaborated, target.max_error);
            estimate.unwrap_or_default()
        };
        let (estimate, sampling) = timed(estimate);
        let mut measurement = Measurement {
            found: None,
            estimate,
            tiles: Vec::new(),
            seconds: sampling,
            sampling,
            comparing: 0.0,
        };
        if estimate.is_none() && (screening.is_none() || in_turn.is_some()) {
            let ((), seconds) =
                timed(|| measurement.draw(views, elaborated, target, in_turn.as_ref()));
            measurement.seconds += seconds;
        }
        measurement
    }

    /// Draws the views in full: all of them, or up to the first that misses the aim.
    fn draw(
        &mut self,
        views: &[&View],
        elaborated: &Elaborated,
        target: &Target,
        in_turn: Option<&InTurn>,
    ) {
        let given = || (0..views.len()).collect();
        let order: Vec<usize> = in_turn.map_or_else(given, |of| of.order.clone());
        let mut all: Vec<Option<Drawn>> = views.iter().map(|_| None).collect();
        for (nth, view) in order.iter().enumerate() {
            let drawn = match drawn(elaborated, views[*view], target) {
                Ok(drawn) => drawn,
                Err(error) => {
                    self.found = Some(Err(error.to_string()));
                    return;
                }
            };
            self.comparing += drawn.comparing;
            if let Some(InTurn { stricter, .. }) = in_turn {
                let load = drawn.found.load_of(target) * stricter;
                if load > 1.0 && nth + 1 < order.len() {
                    let tiles = (nth + 1) * drawn.tiles.len();
                    self.estimate = Some(Estimate {
                        tiles: tiles as u64,
                        load,
                        low: load,
                        high: load,
                        max_error: drawn.found.max_error_of(target),
                    });
                    return;
                }
            }
            all[*view] = Some(drawn);
        }
        let all: Vec<Drawn> = all.into_iter().flatten().collect();
        let found: Vec<SearchErrors> = all.iter().map(|drawn| drawn.found).collect();
        self.found = Some(Ok(worst_of(&found)));
        self.tiles = all.into_iter().map(|drawn| drawn.tiles).collect();
    }
}

/// A view as a worker receives it.
pub struct PackedView(View);

impl PackedView {
    /// Unpacks a view.
    ///
    /// # Errors
    /// [`Error::Input`] if the bytes are damaged, or of another version.
    pub fn unpacked(bytes: &[u8]) -> Result<Self> {
        postcard::from_bytes(bytes)
            .map(PackedView)
            .map_err(|_| Error::input("the packed view is damaged, or of another version"))
    }
}

/// Measures a machine on views; all texts are JSON.
///
/// # Errors
/// [`Error::Input`] if a text is not of this version.
pub fn measured<'v>(
    views: impl IntoIterator<Item = &'v PackedView>,
    machine: &str,
    target: &str,
) -> Result<String> {
    let other = |error: serde_json::Error| {
        Error::input(format!(
            "the machine to measure is of another version: {error}"
        ))
    };
    let machine: Machine = serde_json::from_str(machine).map_err(other)?;
    let request: Request = serde_json::from_str(target).map_err(other)?;
    let elaborated = fixed::elaborate(&machine)?;
    let views: Vec<&View> = views.into_iter().map(|PackedView(view)| view).collect();
    text(&Measurement::on(&views, &elaborated, &request))
}

fn text(value: &impl Serialize) -> Result<String> {
    serde_json::to_string(value).map_err(|error| Error::job(error.to_string()))
}

/// Measurements in advance by worker processes, not yet requested by the search.
#[derive(Default)]
pub(super) struct Prefetch {
    crew: Option<Box<dyn Crew>>,
    /// Number of views that the workers have.
    learnt: usize,
    measured: HashMap<String, Measurement>,
}

impl Prefetch {
    /// With this thread's worker processes, if there are any.
    pub fn new() -> Self {
        Prefetch {
            crew: CREW.take(),
            ..Prefetch::default()
        }
    }

    /// Number of machines that should be measured at once.
    pub fn width(&self) -> usize {
        self.crew.as_ref().map_or(1, |crew| crew.width().max(1))
    }

    /// The measurement of a machine by its key.
    pub fn get(&self, key: &str) -> Option<&Measurement> {
        self.measured.get(key)
    }

    /// Measures machines, given by their keys, that were not measured yet.
    pub fn measure(
        &mut self,
        views: &[View],
        request: &Request,
        machines: &[(String, Machine)],
    ) -> Result<()> {
        let Some(crew) = &mut self.crew else {
            return Ok(());
        };
        let unknown: Vec<&(String, Machine)> = machines
            .iter()
            .filter(|(key, _)| !self.measured.contains_key(key))
            .collect();
        if unknown.is_empty() {
            return Ok(());
        }
        for view in &views[self.learnt.min(views.len())..] {
            crew.learn(postcard::to_stdvec(view).map_err(|error| Error::job(error.to_string()))?)?;
        }
        self.learnt = views.len();
        let texts = unknown
            .iter()
            .map(|(_, machine)| text(machine))
            .collect::<Result<Vec<_>>>()?;
        let answers = crew.measure(&texts, &text(request)?)?;
        if answers.len() != unknown.len() {
            return Err(Error::job(format!(
                "{} machines were to be measured, and {} were",
                unknown.len(),
                answers.len()
            )));
        }
        for ((key, _), answer) in unknown.into_iter().zip(&answers) {
            let measured = serde_json::from_str(answer).map_err(|error| {
                Error::job(format!(
                    "the measurement of a machine is malformed: {error}"
                ))
            })?;
            self.measured.insert(key.clone(), measured);
        }
        Ok(())
    }

    /// Removes and returns the measurement of a machine; measures it now if there is none.
    pub fn taken(
        &mut self,
        views: &[View],
        request: &Request,
        (key, machine): (&str, &Machine),
        elaborated: &Elaborated,
    ) -> Result<Measurement> {
        let here = || Measurement::on(&views.iter().collect::<Vec<_>>(), elaborated, request);
        if self.crew.is_none() {
            return Ok(here());
        }
        self.measure(views, request, &[(key.to_owned(), machine.clone())])?;
        Ok(self.measured.remove(key).unwrap_or_else(here))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explore::search::{Against, Domain, Metric};
    use crate::scene::{Overrides, Scene};

    /// Two views of a scene of few splats.
    fn views(machine: &Machine) -> Vec<View> {
        let overrides = Overrides {
            size: Some((32, 32)),
        };
        let mut scene = Scene::load("glass-spheres", &overrides).unwrap();
        scene.splats = scene.splats.into_iter().step_by(40).collect();
        scene
            .splats
            .iter_mut()
            .for_each(|splat| splat.radius *= 6.0);
        let domain = Domain::around(scene);
        [1, 2]
            .map(|nth| View::new(0, domain.nth(nth).unwrap(), machine).with_ideal())
            .into()
    }

    #[test]
    fn views_are_drawn_up_to_the_first_that_misses_the_aim() {
        let machine = Machine::named("reference").unwrap();
        let elaborated = machine.elaborate().unwrap();
        let views = views(&machine);
        let views: Vec<&View> = views.iter().collect();
        let target = Target {
            psnr_db: Some(50.0),
            max_error: None,
            frames_per_second: None,
            no_saturation: false,
            against: Against::Golden,
            metric: Metric::Psnr,
        };
        let measured = |stricter: Option<f64>, order: [usize; 2]| {
            let request = Request {
                target,
                screening: None,
                in_turn: stricter.map(|stricter| InTurn {
                    order: order.into(),
                    stricter,
                }),
            };
            Measurement::on(&views, &elaborated, &request)
        };
        let whole = measured(None, [0, 1]);
        let found = whole.found.unwrap().unwrap();
        assert!(found.load_of(&target) <= 1.0);
        assert_eq!(whole.estimate, None);
        let tiles = whole.tiles[0].len();
        // All meet it: the same as without an order.
        for order in [[0, 1], [1, 0]] {
            let in_turn = measured(Some(1.0), order);
            assert_eq!(in_turn.found.unwrap().unwrap(), found);
            assert_eq!(in_turn.tiles, whole.tiles);
            assert_eq!(in_turn.estimate, None);
        }
        // None meets it: the first is enough.
        let alone: Vec<f64> = views
            .iter()
            .map(|view| {
                let drawn = drawn(&elaborated, view, &target).unwrap();
                1e6 * drawn.found.load_of(&target)
            })
            .collect();
        for order in [[0, 1], [1, 0]] {
            let in_turn = measured(Some(1e6), order);
            assert_eq!(in_turn.found, None);
            let estimate = in_turn.estimate.unwrap();
            assert_eq!(estimate.tiles, tiles as u64);
            assert_eq!(estimate.load, alone[order[0]]);
            assert!(estimate.low > 1.0);
        }
    }
}

//! Crew: measures machines of a search in other processes, several at once; what is found and
//! written is what one process finds and writes.
//!
//! ```text
//! views ─► every member, once ─┐
//! machines that may be asked for next ─► members ─► measured, by keys ─► the search asks ─► row
//! ```
//! A search asks for one machine after the other, and each answer decides what it asks next. A crew
//! is given guesses at what that may be: they cost time where they are wrong, and change nothing.

use super::{Found, View, drawn, found_on};
use crate::error::{Error, Result};
use crate::hardware::fixed;
use crate::hardware::searched::Target;
use crate::run::timed;
use rtl_model::Machine;
use rtl_model::pipeline::Elaborated;
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::collections::HashMap;

/// Whoever measures machines.
pub trait Crew {
    /// Machines that keep all members busy.
    fn width(&self) -> usize;

    /// One more view, as bytes for [`Sight::unpacked`], that machines are measured on from now on.
    ///
    /// # Errors
    /// Where nobody can be told.
    fn learn(&mut self, view: Vec<u8>) -> Result<()>;

    /// Measures machines on all views that were learnt, each by [`measured`], which takes a machine
    /// and the target as texts.
    ///
    /// # Errors
    /// Where members fail, or nobody wants it any more.
    fn measure(&mut self, machines: &[String], target: &str) -> Result<Vec<String>>;
}

thread_local! {
    static CREW: RefCell<Option<Box<dyn Crew>>> = const { RefCell::new(None) };
}

/// Does `work`, a search, with a crew.
pub fn on_crew<T>(crew: Box<dyn Crew>, work: impl FnOnce() -> T) -> T {
    CREW.set(Some(crew));
    let done = work();
    CREW.set(None);
    done
}

/// What a machine does on all views, or why it does nothing there.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Measured {
    pub found: std::result::Result<Found, String>,
    pub seconds: f64,
}

impl Measured {
    /// Draws, here.
    pub fn on<'v>(
        views: impl IntoIterator<Item = &'v View>,
        elaborated: &Elaborated,
        target: &Target,
    ) -> Self {
        let (found, seconds) = timed(|| found_on(views, |view| drawn(elaborated, view, target)));
        Measured {
            found: found.map_err(|error| error.to_string()),
            seconds,
        }
    }
}

/// A view in a member's hands.
pub struct Sight(View);

impl Sight {
    /// The view of some bytes.
    ///
    /// # Errors
    /// [`Error::Input`] where they are damaged, or of another version.
    pub fn unpacked(bytes: &[u8]) -> Result<Self> {
        postcard::from_bytes(bytes)
            .map(Sight)
            .map_err(|_| Error::input("the packed view is damaged, or of another version"))
    }
}

/// Measures a machine on views; all texts are JSON.
///
/// # Errors
/// [`Error::Input`] where a text is none of this version.
pub fn measured<'v>(
    sights: impl IntoIterator<Item = &'v Sight>,
    machine: &str,
    target: &str,
) -> Result<String> {
    let other = |error: serde_json::Error| {
        Error::input(format!(
            "the machine to measure is of another version: {error}"
        ))
    };
    let machine: Machine = serde_json::from_str(machine).map_err(other)?;
    let target: Target = serde_json::from_str(target).map_err(other)?;
    let elaborated = fixed::elaborate(&machine)?;
    text(&Measured::on(
        sights.into_iter().map(|Sight(view)| view),
        &elaborated,
        &target,
    ))
}

fn text(value: &impl Serialize) -> Result<String> {
    serde_json::to_string(value).map_err(|error| Error::job(error.to_string()))
}

/// What a search's crew has measured, and what nobody has asked for yet.
#[derive(Default)]
pub(super) struct Foresight {
    crew: Option<Box<dyn Crew>>,
    /// Views that it knows.
    learnt: usize,
    measured: HashMap<String, Measured>,
}

impl Foresight {
    /// With this thread's crew, if it has one.
    pub fn new() -> Self {
        Foresight {
            crew: CREW.take(),
            ..Foresight::default()
        }
    }

    /// Machines that are worth being measured at once.
    pub fn width(&self) -> usize {
        self.crew.as_ref().map_or(1, |crew| crew.width().max(1))
    }

    /// What is known of the machine of a key.
    pub fn get(&self, key: &str) -> Option<&Measured> {
        self.measured.get(key)
    }

    /// Has machines measured that are not known yet, by their keys.
    pub fn measure(
        &mut self,
        views: &[View],
        target: &Target,
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
        let answers = crew.measure(&texts, &text(target)?)?;
        if answers.len() != unknown.len() {
            return Err(Error::job(format!(
                "{} machines were to be measured, and {} were",
                unknown.len(),
                answers.len()
            )));
        }
        for ((key, _), answer) in unknown.into_iter().zip(&answers) {
            let measured = serde_json::from_str(answer)
                .map_err(|error| Error::job(format!("a machine's measures are none: {error}")))?;
            self.measured.insert(key.clone(), measured);
        }
        Ok(())
    }

    /// What was measured of the machine of a key, by the crew, or here where there is none.
    pub fn taken(
        &mut self,
        views: &[View],
        target: &Target,
        (key, machine): (&str, &Machine),
        elaborated: &Elaborated,
    ) -> Result<Measured> {
        if self.crew.is_none() {
            return Ok(Measured::on(views, elaborated, target));
        }
        self.measure(views, target, &[(key.to_owned(), machine.clone())])?;
        Ok(self
            .measured
            .remove(key)
            .unwrap_or_else(|| Measured::on(views, elaborated, target)))
    }
}

//! Evaluation: one scene on one machine: elaborate, quantise, draw, compare. All jobs that rate a
//! machine use it.
//!
//! ```text
//! machine ─► elaborate ─┐
//! scene ────────────────┴─► quantise ─┬─► draw, observed ─► picture, signals, work
//!   └─► golden, by the machine's rules │
//!                                      └─► lockstep
//! ```

use crate::accuracy::ranges::{Overflows, SignalReport};
use crate::accuracy::{CheckedTiles, Lockstep, lockstep_in};
use crate::error::Result;
use crate::golden;
use crate::golden::{ListMemory, Rendering, Rules};
use crate::hardware::fixed;
use crate::hardware::quantise::{ListsBefore, Quantised, quantise, quantise_after};
use crate::output::picture::Picture;
use crate::run::detail;
use crate::scene::Scene;
use rtl_model::pipeline::Elaborated;
use rtl_model::work::Work;
use rtl_model::{Drawing, Machine};
use std::borrow::Cow;

/// A scene on a machine that can hold it.
#[derive(Clone, Debug)]
pub struct Evaluation<'a> {
    /// In world units; for a tree the cut within its budget on this machine.
    pub scene: Cow<'a, Scene>,
    /// The checked machine.
    pub machine: Cow<'a, Elaborated>,
    /// The scene in the machine's words.
    pub quantised: Quantised,
}

/// A frame with all observations made while it was drawn.
#[derive(Clone, Debug)]
pub struct Observed {
    /// Frame words and counts.
    pub drawing: Drawing,
    /// The frame as real numbers.
    pub picture: Picture,
    /// The range of every signal.
    pub signals: Vec<SignalReport>,
    /// Recorded work, for timing to replay.
    pub work: Work,
}

impl Observed {
    /// Results out of their format's range.
    pub fn overflows(&self) -> Overflows {
        Overflows::of(&self.signals)
    }
}

impl<'a> Evaluation<'a> {
    /// Checks the machine and quantises the scene.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] if the machine cannot be built or cannot hold the scene.
    pub fn new(scene: &'a Scene, machine: &Machine) -> Result<Self> {
        let elaborated = fixed::elaborate(machine)?;
        let scene = detail::within_budget(scene, &elaborated)?;
        let quantised = quantise(&scene, machine)?;
        Ok(Evaluation {
            scene,
            machine: Cow::Owned(elaborated),
            quantised,
        })
    }

    /// Quantises the scene for a machine that is already elaborated.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] if the machine cannot hold the scene.
    pub fn on(scene: &'a Scene, machine: &'a Elaborated) -> Result<Self> {
        let lists = fixed::lists_before(scene, &machine.machine)?;
        Evaluation::after(scene, machine, lists)
    }

    /// The next frame of a sequence on a machine that is already elaborated; `lists` is what it has
    /// in memory after the frame before, and none before the first one.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] if the machine cannot hold the scene.
    pub fn after(scene: &'a Scene, machine: &'a Elaborated, lists: ListsBefore) -> Result<Self> {
        let scene = detail::within_budget(scene, machine)?;
        let quantised = quantise_after(&scene, &machine.machine, lists)?;
        Ok(Evaluation {
            scene,
            machine: Cow::Borrowed(machine),
            quantised,
        })
    }

    /// What the machine has in memory after the frame, for the next one.
    pub fn lists_after(&self) -> ListsBefore {
        fixed::lists_after(&self.machine, &self.quantised)
    }

    /// The machine's rules for fragments.
    pub fn rules(&self) -> Rules {
        fixed::rules(&self.machine.machine)
    }

    /// Draws the frame without a probe.
    pub fn draw(&self) -> Drawing {
        fixed::draw(&self.machine, &self.quantised)
    }

    /// Draws the frame once, and observes the range of every signal and the work.
    pub fn observe(&self) -> Observed {
        let (drawing, ranges, work) = fixed::draw_measured(&self.machine, &self.quantised);
        let signals = self
            .machine
            .signals
            .iter()
            .zip(&ranges.0)
            .map(|(signal, range)| SignalReport::new(signal, range))
            .collect();
        Observed {
            picture: self.picture(&drawing),
            drawing,
            signals,
            work,
        }
    }

    /// A frame as real numbers.
    pub fn picture(&self, drawing: &Drawing) -> Picture {
        fixed::picture(&self.machine, drawing)
    }

    /// Picture of exact arithmetic by the same rules.
    pub fn golden(&self) -> Rendering {
        golden::render(&self.scene, &self.rules())
    }

    /// [`Evaluation::golden`] of the frame of a sequence after those that are in `memory`.
    pub fn golden_next(&self, memory: &mut ListMemory) -> Rendering {
        golden::render_next(&self.scene, &self.rules(), memory)
    }

    /// The machine with `golden` in lockstep.
    pub fn lockstep(&self) -> Lockstep {
        self.lockstep_in(CheckedTiles::All)
    }

    /// Lockstep in some tiles.
    pub fn lockstep_in(&self, tiles: CheckedTiles) -> Lockstep {
        lockstep_in(&self.scene, &self.machine, &self.quantised, tiles)
    }
}
